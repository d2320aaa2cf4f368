"""Effects hidden by another program must be found; the full tier: ``validate --diagnosis``."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcstudy.diagnosis.base_model import fit_base
from mcstudy.measurement.measured_data import load_measured
from models.registry import load_model
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import simulation_of
from studies.validation.diagnosis.drawing import CATALOGUE, KINDS, OUTSIDE, draw
from studies.validation.diagnosis.full_scale import FullScaleOutcome, plan_full_scale
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import CURVE, Hidden, Laboratory
from studies.validation.diagnosis.outcomes import run_trials
from studies.validation.diagnosis.tier import TARGETS, analyse, plan
from studies.validation.diagnosis.trial import HeldOut, Outcome, Trial, run_trial

QUIET = Laboratory(tests=3, noise_sd=0.0, scatter=0.0, speed_sd=0.0, scale_sd=0.0)


def test_generator_and_model_agree_where_nothing_is_hidden(tmp_path: Path) -> None:
    make_tests(tmp_path / "m", [], 1, QUIET, header_of=Laboratory())
    data = load_measured(tmp_path / "m")
    model = load_model("headform", {"hood_curve": [list(knot) for knot in CURVE]})
    for row, name in enumerate(data.tests["test"]):
        time, measured = data.signal(name, "head_acceleration", "g")
        speed = float(data.tests["impact_speed"].iloc[row])
        run = model.run({"impact_speed": speed, "headform_mass": 2.5, "hood_unloading_ratio": 7.0})
        head = run.histories["head"]
        ours = np.interp(time, head.time, head.channels["acceleration_normal"])
        inside = (time > 0.0) & (time < head.time[-1])
        assert np.abs(ours - measured)[inside].max() < 2e-3 * measured.max()


@pytest.mark.parametrize(
    ("name", "form", "numbers", "model"),
    [
        ("rate_dependent_hood", "dashpot", {"damping": 60.0}, {"damping": 60.0, "share": 0.0}),
        ("hood_bottoming", "catalogue", {"clearance": 0.03, "stiffness": 2e5},
         {"clearance": 0.03, "stiffness": 2e5, "power": 1.0}),
        ("hood_bottoming", "quadratic", {"clearance": 0.028, "stiffness": 4e5},
         {"clearance": 0.028, "stiffness": 4e5, "power": 2.0}),
        ("hood_yield", "catalogue", {"force": 2800.0, "remaining": 0.2},
         {"force": 2800.0, "remaining": 0.2}),
        ("hood_inertia", "catalogue", {"mass": 0.4, "depth": 0.01}, {"mass": 0.4, "depth": 0.01}),
        ("hood_inertia", "local_spring", {"mass": 0.2, "spring": 1e6, "loss": 0.0},
         {"mass": 0.2, "stiffness": 1e6, "damping_ratio": 0.0}),
        ("skin_compliance", "catalogue", {"compliance": 1e-6}, {"compliance": 1e-6, "power": 1.0}),
        ("skin_compliance", "hertz", {"compliance": 1e-6},
         {"compliance": 1e-6, "power": 2.0 / 3.0}),
        ("guide_friction", "catalogue", {"force": 60.0}, {"force": 60.0, "exponent": 0.0}),
        ("guide_friction", "greased", {"force": 60.0}, {"force": 60.0, "exponent": 1.0}),
        ("unloading_slope", "curved", {"curvature": 1.8}, {"factor": 1.0, "curvature": 1.8}),
        ("unloading_slope", "deep", {"growth": 0.6}, {"factor": 1.0, "growth": 0.6}),
    ],
)  # fmt: skip
def test_generator_and_model_agree_on_effects(
    tmp_path: Path, name: str, form: str, numbers: dict[str, float], model: dict[str, float]
) -> None:
    make_tests(tmp_path / "m", [Hidden(name, form, numbers)], 1, QUIET, header_of=Laboratory())
    data = load_measured(tmp_path / "m")
    curve = [list(knot) for knot in CURVE]
    extended = load_model("headform", {"hood_curve": curve}, {name: model})
    test = data.tests["test"].iloc[0]
    time, measured = data.signal(test, "head_acceleration", "g")
    speed = float(data.tests["impact_speed"].iloc[0])
    run = extended.run({"impact_speed": speed, "headform_mass": 2.5, "hood_unloading_ratio": 7.0})
    head = run.histories["head"]
    ours = np.interp(time, head.time, head.channels["acceleration_normal"])
    assert np.abs(ours - measured).max() < 0.02 * measured.max()


def test_a_guide_that_rubs_slows_the_headform_both_ways_and_leaves_the_load_cell(
    tmp_path: Path,
) -> None:
    lab = replace(QUIET, force=True, force_sd=0.0)
    rubbing = Hidden("guide_friction", "catalogue", {"force": 100.0})
    make_tests(tmp_path / "m", [rubbing], 1, lab, header_of=Laboratory(force=True))
    data = load_measured(tmp_path / "m")
    test = data.tests["test"].iloc[0]
    time, head = data.signal(test, "head_acceleration", "g")
    _, cell = data.signal(test, "hood_force", "N")
    drag = 100.0 / 2.5 / 9.80665
    before, contact = time < -0.001, (time > 0.001) & (time < 0.008)
    np.testing.assert_allclose(head[before], drag, rtol=0.05)
    np.testing.assert_allclose(cell[before], 0.0, atol=1.0)
    np.testing.assert_allclose((head - cell / 2.5 / 9.80665)[contact], drag, rtol=0.05)
    np.testing.assert_allclose(head[-10:], -drag, rtol=0.05)


def test_what_is_hidden_depends_on_the_seed_alone() -> None:
    for kind in KINDS:
        assert draw(3, kind) == draw(3, kind)
    assert draw(1, "none") == []
    assert {h.name for k in range(90) for h in draw(k, "own form")} == set(CATALOGUE)
    assert {h.name for k in range(40) for h in draw(k, "outside")} == {
        make(np.random.default_rng(0)).name for make in OUTSIDE
    }
    assert all(len(draw(k, "pair")) == 2 for k in range(5))


def trial(hidden: list[Hidden], seed: int, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    monkeypatch.setattr("studies.validation.diagnosis.trial.draw", lambda _seed, _kind: hidden)
    return run_trial(Trial(seed, "own form", force=False))


BOTTOMING = Hidden("hood_bottoming", "catalogue", {"clearance": 0.03, "stiffness": 2e5})
CATALOGUED = [
    BOTTOMING,
    Hidden("sensor_gain", "catalogue", {"factor": 1.06}),
    Hidden("rate_dependent_hood", "dashpot", {"damping": 40.0}),
    Hidden("sensor_saturation", "catalogue", {"limit": 110.0}),
]
AGEING = Hidden("hood_force_scale", "ageing", {"loss": 0.15})
FOREIGN = [Hidden("rupture", "", {"depth": 0.02, "share": 0.1}), Hidden("cable", "", {"size": 0.8})]


@pytest.mark.parametrize(
    ("hidden", "cause"),
    [([BOTTOMING], "hood_bottoming"), ([], None), ([AGEING], "unexplained")],
)
def test_a_few_tests_name_what_is_hidden_among_few_causes_and_nothing_else(
    hidden: list[Hidden], cause: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = "studies.validation.diagnosis.trial"
    few = [c for c in causes_of("headform") if c.name in ("hood_bottoming", "sensor_offset")]
    monkeypatch.setattr(f"{where}.Laboratory", partial(Laboratory, tests=6))
    monkeypatch.setattr(f"{where}.causes_of", lambda *_: few)
    outcome = trial(hidden, 21, monkeypatch)
    names = (cause,) if hidden == [BOTTOMING] else ()
    assert (outcome.cause, outcome.named, outcome.second) == (cause, names, None)
    assert outcome.detected == (cause is not None)
    assert (outcome.size > 2.0) if hidden else outcome.size == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("hidden", CATALOGUED, ids=lambda h: h.name)
def test_an_effect_of_the_catalogue_is_named(
    hidden: Hidden, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = trial([hidden], 21, monkeypatch)
    assert outcome.size > 2.0
    assert outcome.cause == hidden.name
    assert outcome.second is None


@pytest.mark.slow
@pytest.mark.parametrize("hidden", FOREIGN, ids=lambda h: h.name)
def test_an_effect_outside_the_catalogue_is_not_named(
    hidden: Hidden, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = trial([hidden], 22, monkeypatch)
    assert outcome.detected
    assert outcome.named == ()


@pytest.mark.slow
def test_nothing_hidden_nothing_named(monkeypatch: pytest.MonkeyPatch) -> None:
    # An alarm may be false once in twenty; a name must not come of it.
    outcome = trial([], 23, monkeypatch)
    assert outcome.named == ()
    assert outcome.size == 0.0


@pytest.mark.parametrize("factor", [0.88, 1.06, 1.12])
@pytest.mark.parametrize("seed", [5, 7])
def test_a_gain_of_all_tests_is_not_taken_for_repeatability(
    factor: float, seed: int, tmp_path: Path
) -> None:
    gain = Hidden("sensor_gain", "catalogue", {"factor": factor})
    make_tests(tmp_path / "tests", [gain], seed, Laboratory())
    data = load_measured(tmp_path / "tests")
    choice = choose_model(data, None)
    _, base = fit_base(build_problem(data, choice, simulation_of(data, choice)))
    # The tests differ by 1 % of their level.
    assert 0.006 < base.scatter.level < 0.02


def outcome_of(kind: str, names: tuple[str, ...], cause: str | None, **more: Any) -> Outcome:
    values: dict[str, Any] = {
        "trial": Trial(1, kind, force=False), "hidden": names, "names": names, "size": 3.0,
        "p_value": 0.5 if cause is None else 0.001, "cause": cause, "ambiguous": (),
        "second": None, "second_ambiguous": (), "flagged": False, "why": "", "seconds": 1.0,
    }  # fmt: skip
    return Outcome(**(values | more))


def test_rates_count_what_they_say() -> None:
    outcomes = [
        outcome_of("none", (), None),
        outcome_of("none", (), "sensor_gain"),
        outcome_of("own form", ("sensor_gain",), "sensor_gain"),
        outcome_of("own form", ("sensor_gain",), "speed_bias"),
        outcome_of("own form", ("time_scale",), "speed_bias",
                   ambiguous=("speed_bias", "time_scale")),
        outcome_of("outside", ("cable",), "unexplained"),
        outcome_of("outside", ("cable",), "sensor_filter"),
        outcome_of("pair", ("sensor_gain", "mass_error"), "sensor_gain", second="mass_error"),
    ]  # fmt: skip
    found = analyse(outcomes)
    rates = {key: row["value"] for key, row in found["rates"].items()}
    assert rates["false_alarms"] == 0.5
    assert rates["false_names"] == 0.5
    assert rates["own_named"] == pytest.approx(2.0 / 3.0)
    assert rates["own_single_wrong"] == pytest.approx(1.0 / 3.0)
    assert "foreign_named" not in rates
    assert rates["outside_unexplained"] == 0.5
    assert rates["pair_both"] == 1.0
    # The median of the sizes, all of one class.
    power, pairs = found["power"]
    assert (power["kind"], power["size"], power["trials"]) == ("own form", 3.0, 3)
    assert power["named"]["value"] == pytest.approx(2.0 / 3.0)
    assert (pairs["kind"], pairs["named"]["value"]) == ("pair", 1.0)
    assert found["confusion"]["sensor_gain"] == {"sensor_gain": 1, "speed_bias": 1}
    assert found["confusion"]["nothing"] == {"adequate": 1, "sensor_gain": 1}


def test_an_interrupted_validation_goes_on_where_it_stopped(tmp_path: Path) -> None:
    tried: list[Trial] = []

    def run(trial: Trial) -> Outcome:
        tried.append(trial)
        if len(tried) == 3:
            raise KeyboardInterrupt
        gains = {"inside": HeldOut(0.4, float("nan"), 0.9, 0.9)}
        return outcome_of(trial.kind, ("sensor_gain",), "sensor_gain", trial=trial, gains=gains)

    trials = [Trial(k, "own form", force=False) for k in range(4)]
    with pytest.raises(KeyboardInterrupt):
        run_trials(tmp_path, trials, run, Outcome, 1, quiet=True)
    (file,) = tmp_path.iterdir()
    # The machine went down in the middle of a line.
    file.write_text(file.read_text() + '\n{"trial": {"se')
    tried.append(trials[0])
    found = run_trials(tmp_path, trials, run, Outcome, 1, quiet=True)
    assert tried[4:] == trials[2:]
    assert [outcome.trial for outcome in found] == trials
    assert found[0].gains["inside"].crps == 0.4
    assert np.isnan(found[0].gains["inside"].against_process)
    assert len(list(run_trials(tmp_path, trials, run, Outcome, 1, quiet=True))) == 4
    assert len(tried) == 6


def test_kept_outcomes_of_full_scale_tests_are_those_that_ran(tmp_path: Path) -> None:
    trials = plan_full_scale(["none", "hood_yield"], 2, 1, ("multibody", "planar"))
    ran = [
        FullScaleOutcome(t, "", None, (), False, 0.4, None, 1_620, 9.5, "adequate")
        if t.cause == "none"
        else FullScaleOutcome(t, "", t.cause, (t.cause,), True, 0.0, True, 7_380, 260.0, "one")
        for t in trials
    ]
    by_trial = dict(zip(trials, ran, strict=True))
    args = (tmp_path, trials)
    first = run_trials(*args, by_trial.__getitem__, FullScaleOutcome, 1, quiet=True)
    again = run_trials(*args, {}.__getitem__, FullScaleOutcome, 1, quiet=True)
    assert first == again == ran


def test_a_plan_has_every_kind_and_about_the_number_asked_for() -> None:
    trials = plan(200)
    assert {t.kind for t in trials} == set(KINDS)
    assert 190 <= len(trials) <= 210
    assert len(set(trials)) == len(trials)
    foreign = [t for t in trials if t.kind in ("foreign form", "outside")]
    assert len(foreign) >= 0.45 * len([t for t in trials if t.kind != "none"])
    assert {target.key for target in TARGETS} >= {"false_alarms", "own_named", "pair_both"}
