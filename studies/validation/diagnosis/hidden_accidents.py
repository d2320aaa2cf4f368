"""Accident collections with a hidden effect: the crash core with altered inputs.

Nothing of the diagnosis's catalogue is used but for a slope and for late braking, which act on the
equations of motion: a wet road is a longer slide of those who pass a place, a nose that dives more
is another angle, a softer hood another factor.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy.studyfile.study_inputs import map_inputs
from models.registry import load_model
from studies.kinds import load_study
from studies.monte_carlo.schema import MonteCarloStudy
from studies.validation.diagnosis.laboratory import Hidden

Array = NDArray[np.float64]

RECORDED = {"impact_speed": ("m/s", 0.8), "stature": ("m", 0.0), "body_mass": ("kg", 0.0)}
"""Recorded inputs of an accident: unit and standard uncertainty."""
SCALARS = {"throw_distance": ("m", 0.5), "wad": ("m", 0.04), "hic15": ("1", 60.0)}
"""Measured scalars: unit and standard uncertainty."""

Alter = Callable[[Array, Mapping[str, float]], Array]


def _times(values: Array, numbers: Mapping[str, float]) -> Array:
    return values * numbers["factor"]


def _over(values: Array, numbers: Mapping[str, float]) -> Array:
    return values / numbers["factor"]


ALTERED: dict[str, dict[str, Alter]] = {
    "brake_dive": {"dive_angle": lambda values, numbers: values + numbers["angle"]},
    "hood_force_scale": {"hood_force_scale": _times},
    "mass_error": {"body_mass": _times},
    "muscle_tone": {"neck_stiffness": _times, "muscle_tone": _times},
    "shoulder_compliance": {"shoulder_stiffness": _over},
    "speed_bias": {"impact_speed": _times},
    "friction_level": {"friction_body_road": _times},
}
"""Effects by the inputs that differ from the recorded ones."""
IN_THE_MODEL = ("late_braking", "road_slope")
"""Effects that the crash model itself has."""


def make_accidents(
    folder: Path, study_file: Path, hidden: Sequence[Hidden], seed: int, accidents: int = 60
) -> None:
    """Write a collection of accidents with the effects in it.

    Parameters
    ----------
    folder : path
        New folder.
    study_file : path
        Monte Carlo study that the inputs of the accidents are drawn from.
    hidden : sequence of Hidden
        Effects, by altered inputs.
    seed : int
        Seed of the draws.
    accidents : int
        Number of accidents.
    """
    rng = np.random.default_rng(seed)
    study = load_study(study_file)
    assert isinstance(study, MonteCarloStudy)
    model = load_model(study.model.name, study.model.options)
    spare = 2 * accidents
    columns = map_inputs(study, model, rng.random((spare, len(study.inputs))))
    altered = alter({k: v.copy() for k, v in columns.items()}, hidden)
    inside = {h.name: h.numbers for h in hidden if h.name in IN_THE_MODEL}
    model = load_model(study.model.name, study.model.options, inside)
    altered |= {item.name: np.full(spare, item.nominal) for item in model.inputs[len(columns) :]}
    names = [item.name for item in model.inputs]
    batch = model.run_batch(np.stack([altered[name] for name in names], axis=1))
    outputs = {item.name: batch.outputs[:, k] for k, item in enumerate(model.outputs)}
    outputs["throw_distance"] = _thrown(altered, outputs, hidden)
    good = np.flatnonzero(np.all([np.isfinite(outputs[name]) for name in SCALARS], axis=0))[
        :accidents
    ]
    table = {"test": [f"a{k + 1:03d}" for k in range(good.size)]}
    frame = pd.DataFrame(table)
    for name, (_, sd) in RECORDED.items():
        frame[name] = columns[name][good] + sd * rng.standard_normal(good.size)
    for name, (_, sd) in SCALARS.items():
        frame[name] = outputs[name][good] + sd * rng.standard_normal(good.size)
    folder.mkdir(parents=True)
    frame.to_csv(folder / "tests.csv", index=False)
    (folder / "measured.toml").write_text(_header(study), encoding="utf-8")


def alter(columns: dict[str, Array], hidden: Sequence[Hidden]) -> dict[str, Array]:
    """Return the inputs as they truly were."""
    for h in hidden:
        for name, how in ALTERED.get(h.name, {}).items():
            columns[name] = how(columns[name], h.numbers)
    return columns


def _thrown(
    columns: Mapping[str, Array], outputs: Mapping[str, Array], hidden: Sequence[Hidden]
) -> Array:
    """Return the throw distances (m), lengthened where the road beyond a place is wet.

    A body that still has the speed v at the place slides v^2 / (2 mu g) on from there.
    """
    throw = outputs["throw_distance"]
    for h in hidden:
        if h.name == "wet_road":
            beyond = np.maximum(throw - h.numbers["place"], 0.0)
            throw = throw + beyond * (1.0 / h.numbers["factor"] - 1.0)
        elif h.name == "tape":
            # Outside the catalogue: every throw is taped too short by a length.
            throw = throw - h.numbers["length"]
    return throw


def _header(study: MonteCarloStudy) -> str:
    lines = [
        'format = "mcstudy-measured/1"',
        'title = "Child pedestrians, one car"',
        'model = "multibody"',
        "",
        "[fixed]",
        *(f"{name} = {entry.value!r}" for name, entry in study.fixed.items()),
    ]
    for table, entries in (("inputs", RECORDED), ("scalars", SCALARS)):
        for name, (unit, sd) in entries.items():
            lines += ["", f"[{table}.{name}]", f'unit = "{unit}"', f"sd = {sd}"]
    return "\n".join(lines) + "\n"
