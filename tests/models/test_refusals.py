"""What no model takes, from Python and from files: values out of range, impossible bodies."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mcstudy.execution.results import ResultsFolder
from models.multibody.model import MultibodyModel
from models.pedestrian.anthropometry import build_body, is_possible
from models.protocol import Input, Model
from models.registry import load_model, model_names
from studies import cli

QUIET = settings(derandomize=True, deadline=None, database=None, max_examples=80)
MODELS = {name: load_model(name) for name in model_names()}

STUDY = """\
format = "mcstudy-study/1"
kind = "monte-carlo"
name = "refusals"
title = "What is refused"
max_failure_rate = 0.0

[model]
name = "multibody"

[design]
method = "latin-hypercube"
n = 4
replicate_size = 4

[inputs.impact_speed]
distribution = "uniform"
unit = "km/h"
low = 30.0
high = 40.0

[report]
histories = 0

[fixed]
"""
CASE = """\
format = "mcstudy-study/1"
kind = "reconstruction"
name = "refusals"
title = "What is refused"

[model]
name = "multibody"

[fixed]
"""


def declared(model: Model, name: str) -> Input:
    return next(item for item in model.inputs if item.name == name)


def nominal_rows(model: Model, n: int) -> np.ndarray:
    return np.tile([item.nominal for item in model.inputs], (n, 1))


def refusals(model: Model, name: str, value: float) -> list[str]:
    """Return the messages of ``run`` and of ``run_batch`` with the value in the second row."""
    messages = []
    with pytest.raises(ValueError) as refused:
        model.run({name: value})
    messages.append(str(refused.value))
    rows = nominal_rows(model, 3)
    rows[1, [item.name for item in model.inputs].index(name)] = value
    with pytest.raises(ValueError) as refused:
        model.run_batch(rows)
    return [*messages, str(refused.value)]


@pytest.mark.parametrize(
    ("model", "name", "value"),
    [
        ("multibody", "stature", 3.0),
        ("multibody", "impact_speed", 500.0 / 3.6),
        ("multibody", "hood_stiffness", -0.1),
        ("multibody", "neck_stiffness", -1.0),
        ("multibody", "friction_body_road", -0.6),
        ("multibody", "body_mass", math.nan),
        ("multibody", "age", math.inf),
        ("multibody", "yaw_rate", -math.inf),
        ("headform", "impact_speed", 500.0 / 3.6),
        ("headform", "hood_stiffness", -0.1),
        ("headform", "headform_mass", math.nan),
        ("headform", "headform_mass", math.inf),
    ],
)
def test_input_value_and_range_are_named_on_one_line(model: str, name: str, value: float) -> None:
    item = declared(MODELS[model], name)
    for message in refusals(MODELS[model], name, value):
        assert "\n" not in message
        assert f"{name!r} = {value:g} {item.unit}" in message
        assert f"{item.low:g} to {item.high:g} {item.unit}" in message
        assert model in message


@QUIET
@given(st.data())
def test_anything_outside_a_range_is_refused(data: st.DataObject) -> None:
    model = MODELS[data.draw(st.sampled_from(sorted(MODELS)))]
    item = data.draw(st.sampled_from(model.inputs))
    value = data.draw(st.floats())
    assume(not item.low <= value <= item.high)
    for message in refusals(model, item.name, value):
        assert repr(item.name) in message


@pytest.mark.parametrize("model", sorted(MODELS))
def test_an_unknown_input_is_told_what_there_is(model: str) -> None:
    with pytest.raises(ValueError, match=r"no input 'impact_sped'; it has .*impact_speed"):
        MODELS[model].run({"impact_sped": 10.0})
    with pytest.raises(ValueError, match="shape"):
        MODELS[model].run_batch(nominal_rows(MODELS[model], 2)[:, 1:])
    with pytest.raises(ValueError, match="shape"):
        MODELS[model].run_batch(nominal_rows(MODELS[model], 1)[0])


@pytest.mark.parametrize(
    ("stature", "body_mass", "head_mass", "possible"),
    [
        (1.22, 23.2, 3.26, True),
        (2.1, 13.2, 3.26, False),  # 3 kg/m2
        (1.0, 8.0, 1.5, True),
        (1.0, 7.99, 1.5, False),
        (1.0, 80.0, 3.0, True),
        (1.0, 80.01, 3.0, False),
        (0.9, 10.0, 4.99, True),
        (0.9, 10.0, 5.0, False),  # half of the body
        (0.9, 10.0, 7.0, False),
    ],
)
def test_what_body_can_be(
    stature: float, body_mass: float, head_mass: float, possible: bool
) -> None:
    assert is_possible(stature, body_mass, head_mass) is possible
    if possible:
        body = build_body(7.0, stature, body_mass, head_mass)
        assert body.mass.sum() == pytest.approx(body_mass, rel=1e-12)
        assert (body.mass > 0.0).all() and (body.inertia > 0.0).all()


@QUIET
@given(
    stature=st.floats(0.8, 2.1),
    body_mass=st.floats(9.0, 150.0),
    head_mass=st.floats(1.5, 7.0),
    age=st.floats(3.0, 90.0),
)
def test_bodies_that_cannot_be_have_a_status(
    stature: float, body_mass: float, head_mass: float, age: float
) -> None:
    index = body_mass / stature**2
    assume(index < 8.0 or index > 80.0 or head_mass >= 0.5 * body_mass)
    model = MODELS["multibody"]
    inputs = {"stature": stature, "body_mass": body_mass, "head_mass": head_mass, "age": age}
    assert not is_possible(stature, body_mass, head_mass)
    run = model.run(inputs)
    assert run.status == "impossible_body"
    assert set(run.outputs) == {item.name for item in model.outputs}
    assert all(math.isnan(value) for value in run.outputs.values())
    rows = nominal_rows(model, 1)
    for name, value in inputs.items():
        rows[0, [item.name for item in model.inputs].index(name)] = value
    batch = model.run_batch(rows)
    assert batch.status == ["impossible_body"]
    assert np.isnan(batch.outputs).all()


@pytest.mark.parametrize(
    "body",
    [
        {"stature": 1.1, "body_mass": 9.7, "head_mass": 1.5},  # 8.02 kg/m2
        {"stature": 1.0, "body_mass": 79.9, "head_mass": 7.0},
        {"stature": 0.8, "body_mass": 9.0, "head_mass": 4.49},
        {"stature": 2.1, "body_mass": 150.0, "head_mass": 1.5, "age": 3.0},
    ],
)
def test_the_strangest_bodies_that_can_be_run_without_an_exception(body: dict[str, float]) -> None:
    run = MODELS["multibody"].run(body)
    assert run.status not in ("impossible_body", "no_contact")
    if run.status == "ok":
        assert all(math.isfinite(value) for value in run.outputs.values())


def test_a_run_that_blows_up_is_not_called_ok() -> None:
    # Light limbs (8.3 kg/m2) and a stiff neck: damping rate times tick is 0.97, not 0.5.
    inputs = {
        "impact_speed": 24.65, "running_speed": 2.03, "gait_phase": 0.94, "facing_angle": -3.39,
        "lateral_offset": 0.39, "age": 60.13, "stature": 1.83, "body_mass": 27.86,
        "head_mass": 5.14, "friction_body_road": 1.16, "friction_body_car": 0.47,
        "friction_tyre_road": 1.1, "yaw_rate": -0.15, "dive_angle": 0.08, "hood_stiffness": 0.22,
        "edge_stiffness": 0.82, "bumper_stiffness": 0.93, "neck_stiffness": 4.14,
        "muscle_tone": 1.07,
    }  # fmt: skip
    run = MODELS["multibody"].run(inputs)
    fine = MultibodyModel(tick=2.5e-5).run(inputs)
    # Energy of the fine run is booked to 1e-3; 5 % is the project's own worst case.
    assert abs(fine.outputs["energy_residual"]) < 0.05
    assert run.status != "ok" or abs(run.outputs["energy_residual"]) < 0.05


def command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: Any
) -> tuple[int, str]:
    """Return exit code and standard error of the command line."""
    monkeypatch.setattr(sys, "argv", ["mcstudy", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert isinstance(ended.value.code, int)
    return ended.value.code, capsys.readouterr().err.strip()


BAD = [
    ('stature = { value = 3.0, unit = "m" }', ("fixed.stature", "3 m", "0.8 to 2.1 m")),
    ('stature = { value = 300.0, unit = "cm" }', ("fixed.stature", "3 m", "0.8 to 2.1 m")),
    ("hood_stiffness = { value = -0.1 }", ("fixed.hood_stiffness", "-0.1", "0 to 1")),
    ("hood_stiffness = { value = nan }", ("fixed.hood_stiffness", "nan", "finite")),
    ("hood_stiffness = { value = inf }", ("fixed.hood_stiffness", "inf", "finite")),
    (
        'running_speed = { value = 500.0, unit = "km/h" }',
        ("fixed.running_speed", "138.889 m/s", "0 to 8 m/s"),
    ),
    ("stature_of_child = { value = 1.2 }", ("fixed.stature_of_child", "no input", "stature")),
]


@pytest.mark.parametrize(("line", "told"), BAD)
@pytest.mark.parametrize(("verb", "text"), [("run", STUDY), ("reconstruct", CASE)])
def test_files_with_bad_values_end_with_code_2(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    verb: str,
    text: str,
    line: str,
    told: tuple[str, ...],
) -> None:
    study, out = tmp_path / "bad.toml", tmp_path / "out"
    study.write_text(text + line + "\n")
    code, errors = command(capsys, monkeypatch, verb, study, "--out", out)
    assert code == 2
    assert "\n" not in errors
    assert all(word in errors for word in told), errors
    assert not out.exists()


def test_a_distribution_that_leaves_the_range_ends_with_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = tmp_path / "bad.toml", tmp_path / "out"
    study.write_text(STUDY.replace("high = 40.0", "high = 500.0"))
    code, errors = command(capsys, monkeypatch, "run", study, "--out", out)
    assert code == 2
    assert "inputs.impact_speed" in errors and "0.5 to 40 m/s" in errors
    assert "\n" not in errors
    assert not out.exists()


IMPOSSIBLE = 'stature = { value = 2.1, unit = "m" }\nbody_mass = { value = 13.2, unit = "kg" }\n'


def test_a_study_of_impossible_bodies_fails_and_keeps_the_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(STUDY + IMPOSSIBLE)
    code, errors = command(
        capsys, monkeypatch, "run", study, "--out", out, "--workers", 1, "--quiet"
    )
    assert code == 1
    assert "4 impossible_body" in errors
    runs = ResultsFolder(out).runs()
    assert set(runs["status"]) == {"impossible_body"}
    outputs = [item.name for item in MODELS["multibody"].outputs]
    assert runs[outputs].isna().to_numpy().all()


def test_a_case_of_an_impossible_body_fails_on_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "case.toml"
    study.write_text(CASE + IMPOSSIBLE)
    code, errors = command(capsys, monkeypatch, "reconstruct", study, "--out", tmp_path / "out")
    assert code == 1
    assert errors == "mcstudy: the run ended with status 'impossible_body'"


def test_no_workers_is_a_user_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    code, errors = command(
        capsys, monkeypatch, "run", study, "--out", tmp_path / "out", "--workers", 0, "--quiet"
    )
    assert code == 2
    assert "workers" in errors


@pytest.mark.parametrize("name", model_names())
def test_an_unknown_option_is_named_with_those_that_there_are(name: str) -> None:
    with pytest.raises(ValueError, match=rf"model '{name}' has no option 'colour'; it has .*veh"):
        load_model(name, {"colour": "red"})
