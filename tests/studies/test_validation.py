"""The validation: checks, references, parts, report and the verb of the command line."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headform_studies import assert_stands_alone, mcstudy, told

from mcstudy.errors import StudyError
from mcstudy.execution.results import ResultsFolder
from mcstudy.figures.panels import Curve, Panel, draw_panels
from models.component.neck_pendulum import swing_neck
from models.pedestrian.anthropometry import build_body
from models.pedestrian.joints import build_joints
from studies.validation import (
    dummy_head,
    head_impact,
    headform_impacts,
    hidden_speeds,
    numerics,
    separation,
    throw_distance,
)
from studies.validation import parts as parts_module
from studies.validation.check import Check, Part, check, references
from studies.validation.parts import MEASURED, PARTS, part_names, run_parts
from studies.validation.report import check_exact, table_of, validate

LABELS = {"found", "recalled", "estimated", "assumed", "measured", "exact"}
NAN = math.nan


def a_check(**changes: Any) -> Check:
    plain = Check(
        key="k", what="a thing", unit="m", low=1.0, high=2.0, source="somebody", label="found",
        ours=1.5, reason="", exact=False,
    )  # fmt: skip
    return dataclasses.replace(plain, **changes)


@pytest.mark.parametrize(
    ("low", "high", "ours", "verdict"),
    [
        (1.0, 2.0, 1.5, "inside"),
        (1.0, 2.0, 1.0, "inside"),
        (1.0, 2.0, 2.0, "inside"),
        (1.0, 2.0, math.nextafter(1.0, 0.0), "OUTSIDE"),
        (1.0, 2.0, math.nextafter(2.0, 3.0), "OUTSIDE"),
        (NAN, 2.0, -1e9, "inside"),
        (NAN, 2.0, 2.1, "OUTSIDE"),
        (1.0, NAN, 1e9, "inside"),
        (1.0, NAN, 0.9, "OUTSIDE"),
        (1.0, 1.0, 1.0, "inside"),
        (1.0, 2.0, NAN, "not run"),
        (NAN, 2.0, NAN, "not run"),
        (1.0, 2.0, math.inf, "OUTSIDE"),
        (NAN, 2.0, math.inf, "OUTSIDE"),
    ],
)
def test_verdict(low: float, high: float, ours: float, verdict: str) -> None:
    assert a_check(low=low, high=high, ours=ours).verdict == verdict


def test_bounds_in_words() -> None:
    assert a_check(low=1.0, high=2500.0).reference == "1 to 2,500"
    assert a_check(low=NAN, high=2.0).reference == "at most 2"
    assert a_check(low=1.0, high=NAN).reference == "at least 1"
    assert a_check(low=2.0, high=2.0).reference == "2"
    assert a_check().cited == "1 to 2 m · somebody [found]"


def test_references_are_complete() -> None:
    for key, row in references()["checks"].items():
        assert set(row) <= {"what", "unit", "low", "high", "source", "label", "reason"}, key
        assert row["what"] and row["source"], key
        assert row["label"] in LABELS, key
        assert "low" in row or "high" in row, key
        assert row.get("low", -math.inf) <= row.get("high", math.inf), key
        # A closed form has no excuse.
        assert row["label"] != "exact" or "reason" not in row, key
    with pytest.raises(KeyError):
        check("no_such_reference", 1.0)


def test_pulses_of_the_neck_pendulum_stop_it() -> None:
    for pulse in references()["neck_pulses"].values():
        lost = np.array(pulse["lost"])
        assert (np.diff(lost, axis=0) > 0.0).all()
        assert lost[0].tolist() == [0.0, 0.0]
        assert lost[-1, 1] == pulse["speed"]


def test_the_excuse_of_the_neck_holds() -> None:
    # "at factor 2.2 all three flexion numbers are inside"
    body = build_body(6.0, 1.17, 23.4, 3.47)
    pulse = references()["neck_pulses"]["flexion"]
    test = swing_neck(
        body, build_joints(body, neck_stiffness=2.2), "flexion", pulse["speed"],
        np.array(pulse["lost"]),
    )  # fmt: skip
    checks = [
        check("neck_flexion_angle", math.degrees(test.angle.max())),
        check("neck_flexion_moment", test.moment.max()),
        check("neck_flexion_decay", 1e3 * test.decay_time(5.0)),
    ]
    assert [c.verdict for c in checks] == ["inside"] * 3


@pytest.mark.parametrize(
    ("friction", "low", "high"), [(0.6, 39.6, 46.2), (0.66, 40.5, 48.5), (0.7, 40.9, 49.9)]
)
def test_searle_at_fourteen_metres(friction: float, low: float, high: float) -> None:
    # Data sheet, section 6, to the printed digit; its g of 9.81 is 0.01 km/h.
    found = 3.6 * np.array(separation.searle(np.array(14.0), friction))
    np.testing.assert_allclose(found, [low, high], atol=0.06)
    assert found[1] / found[0] == pytest.approx(math.sqrt(1.0 + friction**2), rel=1e-12)


@pytest.mark.parametrize(
    ("relation", "speed"),
    [
        (throw_distance.toor_wrap, 44.3),
        (throw_distance.toor_forward, 41.3),
        (throw_distance.happer_wrap, 45.2),
        (lambda s: 3.6 * throw_distance.wood_simms(s), 48.5),
        (lambda s: 3.6 * throw_distance.wood_simms(s, 2.5), 33.7),
        (lambda s: 3.6 * throw_distance.wood_simms(s, 4.5), 60.6),
    ],
)
def test_regressions_at_fourteen_metres(
    relation: Callable[[np.ndarray], np.ndarray], speed: float
) -> None:
    assert float(relation(np.array(14.0))) == pytest.approx(speed, abs=0.05)
    assert (np.diff(relation(np.linspace(1.0, 60.0, 60))) > 0.0).all()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Part]]:
    """All parts, their sweeps cut down to a few runs, without measured data."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(throw_distance, "SPEEDS", np.array([40.0]))
        patch.setattr(throw_distance, "FRICTIONS", (0.6,))
        patch.setattr(throw_distance, "PHASES", (0.17, 0.5))
        patch.setattr(head_impact, "SPEEDS", np.array([40.0]))
        patch.setattr(head_impact, "STATURES", np.array([1.10, 1.40]))
        patch.setattr(head_impact, "PHASES", (0.0, 0.5))
        patch.setattr(numerics, "INSIDE", 4)
        patch.setattr(numerics, "CORNERS", 2)
        patch.setattr(headform_impacts, "SPEEDS", np.linspace(4.0, 14.0, 3))
        for name, few in (("RUNS", 256), ("HIDDEN", 12), ("COMPARED", 1), ("STEPS", 120),
                          ("SKIPPED", 40)):  # fmt: skip
            patch.setattr(hidden_speeds, name, few)
        nowhere = tmp_path_factory.mktemp("nowhere")
        found = run_parts(part_names(), measured=nowhere, workers=1, quiet=True)
        yield dict(zip(part_names(), found, strict=True))


def test_every_reference_is_used_once(small: dict[str, Part]) -> None:
    keys = [c.key for part in small.values() for c in part.checks]
    assert len(set(keys)) == len(keys)
    assert set(keys) == set(references()["checks"])


def test_all_exact_checks_are_inside(small: dict[str, Part]) -> None:
    exact = [c for part in small.values() for c in part.checks if c.exact]
    assert len(exact) >= 7
    assert {c.verdict for c in exact} == {"inside"}


def test_what_lies_outside_has_its_reason(small: dict[str, Part]) -> None:
    # The parts whose numbers do not depend on the size of a sweep.
    for name in ("headform", "body-parts", "standing-child"):
        for c in small[name].checks:
            assert c.verdict != "not run"
            assert c.verdict == "inside" or c.reason, c.key


def test_every_part_says_and_shows_something(small: dict[str, Part]) -> None:
    for name, part in small.items():
        assert part.heading and part.checks, name
        assert all(isinstance(text, str) and text for text in part.paragraphs), name
        assert not any("nan" in text.split() for text in part.paragraphs), name
        for figure in part.figures.values():
            for axes in figure.axes:
                if axes.get_visible():
                    assert "[" in axes.get_xlabel() and "[" in axes.get_ylabel(), name


def test_without_measurements_what_needs_them_is_not_run(small: dict[str, Part]) -> None:
    assert {c.key for c in small["dummy-head"].checks} == set(dummy_head.KEYS)
    for name in MEASURED:
        # The frontal corridors of the trunk are references, not data.
        lacking = [c for c in small[name].checks if not c.key.startswith("frontal")]
        assert {c.verdict for c in lacking} == {"not run"}
        assert not small[name].figures


HOSTILE = "<script src='https://example.org/x.js'>alert(1)</script> & \"quotes\""


def stub(*checks: Check) -> Callable[[int], Part]:
    """Return a part of given checks, one paragraph and one figure of hostile text."""

    def run(workers: int) -> Part:
        line = Curve(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "a & b")
        figure = draw_panels([Panel("x [m]", "y [m]", [line])])
        return Part(HOSTILE, [HOSTILE], checks, {HOSTILE: figure})

    return run


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    def use(*checks: Check) -> None:
        monkeypatch.setitem(PARTS, "headform", stub(*checks))
        monkeypatch.setattr(parts_module, "PARTS", PARTS)

    return use


def test_the_report_stands_alone_and_escapes_its_text(
    stubbed: Callable[..., None], tmp_path: Path
) -> None:
    stubbed(
        a_check(what=HOSTILE, source=HOSTILE, ours=9.0, reason=HOSTILE, key="one"),
        a_check(ours=NAN, key="two"),
        a_check(ours=math.inf, key="three", unit="1"),
        a_check(key="four", exact=True),
    )
    folder = ResultsFolder(tmp_path / "out")
    analysis = validate(folder, measured=tmp_path, only=["headform"], quiet=True)
    html = (folder.path / "report.html").read_text(encoding="utf-8")
    assert_stands_alone(html)
    # Heading (twice: contents), paragraph, caption, and the check in its tables.
    assert unescape(html).count(HOSTILE) >= 6
    assert analysis["counts"] == {"inside": 1, "OUTSIDE": 2, "not run": 1}
    one, two, three, _ = analysis["checks"]
    assert one["reason"] == HOSTILE
    assert (two["ours"], two["verdict"]) == (None, "not run")
    assert (three["ours"], three["verdict"]) == (None, "OUTSIDE")
    assert [row[-1] for row in table_of(analysis).rows] == ["OUTSIDE", "not run", "OUTSIDE",
                                                            "inside"]  # fmt: skip
    assert {p.name for p in (folder.path / "figures").iterdir()} == {
        "headform_1.png", "headform_1.svg"
    }  # fmt: skip


def test_a_missed_exact_check_is_a_failed_study(
    stubbed: Callable[..., None], tmp_path: Path
) -> None:
    stubbed(a_check(ours=9.0), a_check(exact=True, label="exact", key="law"))
    folder = ResultsFolder(tmp_path / "out")
    check_exact(validate(folder, measured=tmp_path, only=["headform"], quiet=True))
    stubbed(a_check(exact=True, label="exact", key="law", what="a law", ours=9.0))
    analysis = validate(folder, measured=tmp_path, only=["headform"], quiet=True)
    with pytest.raises(StudyError, match="1 exact checks are missed, first: a law"):
        check_exact(analysis)
    stubbed(a_check(exact=True, label="exact", key="law", ours=NAN))
    with pytest.raises(StudyError):
        check_exact(validate(folder, measured=tmp_path, only=["headform"], quiet=True))


def test_a_missed_law_is_exit_code_1_and_the_table_is_printed(
    stubbed: Callable[..., None], tmp_path: Path
) -> None:
    stubbed(a_check(exact=True, label="exact", what="a law", ours=9.0), a_check(key="x", ours=NAN))
    arguments = ("--only", "headform", "--out", tmp_path / "out", "--measured", tmp_path)
    said = mcstudy("validate", *arguments, "--json")
    assert said.code == 1
    assert json.loads(said.out)["analysis"]["counts"]["OUTSIDE"] == 1
    assert said.err == "mcstudy: 1 exact checks are missed, first: a law\n"


def test_an_unknown_part_is_exit_code_2(tmp_path: Path) -> None:
    arguments = ("--only", "headform", "--only", "neck", "--out", tmp_path / "out")
    said = told(mcstudy("validate", *arguments))
    assert "neck" in said and "body-parts" in said
    assert not (tmp_path / "out").exists()


def test_json_of_parts_is_in_the_order_of_the_report(
    stubbed: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ["body-parts", "headform"]
    stubbed(a_check(key="x"), a_check(key="y", ours=9.0))
    monkeypatch.setitem(PARTS, "body-parts", stub(a_check(key="z")))
    only = [word for name in names for word in ("--only", name)]
    said = mcstudy("validate", *only, "--json", "--out", tmp_path / "v", "--workers", "1")
    assert (said.code, said.err) == (0, "")
    analysis = json.loads(said.out)["analysis"]
    parts = list(dict.fromkeys(c["part"] for c in analysis["checks"]))
    assert parts == [name for name in PARTS if name in names] != names
    assert sum(analysis["counts"].values()) == len(analysis["checks"])
    for entry in analysis["checks"]:
        assert entry["what"] and entry["source"] and entry["verdict"]
        assert entry["label"] in LABELS
        assert f"[{entry['label']}]" in entry["cited"]
    assert json.loads((tmp_path / "v" / "analysis.json").read_text()) == analysis
    assert (tmp_path / "v" / "report.html").stat().st_size > 10_000
