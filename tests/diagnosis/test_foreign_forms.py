"""Effects in forms and sizes that the catalogue does not have; the full tier: ``validate``."""

from pathlib import Path

import pytest

from mcstudy.diagnosis.search import Finding, search
from mcstudy.measurement.measured_data import load_measured
from studies.diagnosis.causes import causes_of
from studies.diagnosis.model_choice import choose_model
from studies.diagnosis.problem import build_problem
from studies.diagnosis.study import simulation_of
from studies.validation.diagnosis.hidden_effects import make_tests
from studies.validation.diagnosis.laboratory import Hidden, Laboratory

GAIN = Hidden("sensor_gain", "catalogue", {"factor": 1.12})
DRY = Hidden("rate_dependent_hood", "dry", {"force": 300.0})
RAMPED = Hidden("rate_dependent_hood", "ramped", {"damping": 100.0, "ramp": 0.005})
SPRUNG = Hidden("hood_inertia", "local_spring", {"mass": 0.3, "spring": 3e6, "loss": 0.1})
LIGHT = Hidden("mass_error", "catalogue", {"factor": 0.78})
BOTTOMING = Hidden("hood_bottoming", "soft_start",
                   {"clearance": 0.028, "stiffness": 3e5, "layer": 0.005})  # fmt: skip
WARMING = Hidden("sensor_gain", "warming", {"change": 0.09})
RINGING = Hidden("ringing", "", {"share": 0.08, "length": 0.012})
CABLE = Hidden("cable", "", {"size": 2.0})
SMOOTH = Hidden("hood_yield", "smooth", {"force": 2800.0, "remaining": 0.3})
FALLING = Hidden("speed_bias", "falling", {"height": 0.4})
CLIPPED = Hidden("sensor_saturation", "catalogue", {"limit": 100.0})


def find(
    folder: Path, hidden: list[Hidden], names: tuple[str, ...], *, force: bool = False
) -> Finding:
    make_tests(folder, hidden, 7, Laboratory(tests=6, force=force, rebound=force))
    data = load_measured(folder)
    choice = choose_model(data, None)
    problem = build_problem(data, choice, simulation_of(data, choice))
    causes = [c for c in causes_of("headform") if c.name in names]
    return search(problem, causes)


@pytest.mark.parametrize(
    ("hidden", "rivals", "named"),
    [
        (GAIN, ("speed_bias",), {"sensor_gain"}),
        (RAMPED, ("hood_inertia",), {"rate_dependent_hood"}),
        (DRY, ("unloading_slope",), {"rate_dependent_hood"}),
        (SPRUNG, ("rate_dependent_hood",), {"hood_inertia"}),
        # Without a load cell the same pulses: a set, not a name.
        (LIGHT, ("hood_force_scale", "sensor_gain"), {"mass_error", "hood_force_scale"}),
        (BOTTOMING, ("hood_yield",), {"hood_bottoming"}),
        (WARMING, ("hood_force_scale", "speed_bias"), {"sensor_gain"}),
        (CLIPPED, ("hood_yield",), {"sensor_saturation"}),
        (SMOOTH, ("hood_inertia",), {"hood_yield"}),
        (FALLING, ("sensor_gain", "hood_force_scale"), {"speed_bias"}),
    ],
    ids=lambda entry: entry.form if isinstance(entry, Hidden) else None,
)
def test_another_form_is_still_the_same_cause(
    hidden: Hidden, rivals: tuple[str, ...], named: set[str], tmp_path: Path
) -> None:
    found = find(tmp_path / "tests", [hidden], (hidden.name, *rivals))
    assert set(found.ambiguous or (found.cause,)) == named
    assert found.second is None


@pytest.mark.parametrize("hidden", [RINGING, CABLE], ids=lambda h: h.name)
def test_what_no_cause_explains_is_not_named(hidden: Hidden, tmp_path: Path) -> None:
    found = find(tmp_path / "tests", [hidden], ("sensor_gain", "sensor_filter", "hood_bottoming"))
    assert found.cause == "unexplained"


BOTTOM = Hidden("hood_bottoming", "catalogue", {"clearance": 0.03, "stiffness": 2e5})


@pytest.mark.parametrize(
    ("large", "small"),
    [
        (BOTTOM, Hidden("sensor_gain", "catalogue", {"factor": 1.08})),
        # A gain below one that takes most of the clipping on.
        (
            Hidden("sensor_gain", "catalogue", {"factor": 0.85}),
            Hidden("sensor_saturation", "catalogue", {"limit": 110.0}),
        ),
    ],
    ids=lambda entry: entry.name,
)
def test_an_effect_beside_a_larger_one_is_the_second_cause(
    large: Hidden, small: Hidden, tmp_path: Path
) -> None:
    found = find(tmp_path / "tests", [large, small], (large.name, small.name))
    assert found.cause == large.name
    assert found.second is not None
    assert found.second.cause.name == small.name


def test_a_second_cause_is_sought_beside_other_forms_of_the_first(tmp_path: Path) -> None:
    """Alone, a gradual saturation imitates the gain, beside which a gain explains nothing."""
    gain = Hidden("sensor_gain", "catalogue", {"factor": 0.88})
    clipped = Hidden("sensor_saturation", "catalogue", {"limit": 97.0})
    names = ("sensor_gain", "sensor_saturation")
    found = find(tmp_path / "tests", [gain, clipped], names, force=True)
    assert found.candidates[0].form.name == "gradual"
    assert found.second is not None
    assert {found.cause, found.second.cause.name} == set(names)
    assert not found.flagged
