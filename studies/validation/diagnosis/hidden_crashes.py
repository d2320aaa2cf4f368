"""Full-scale tests with a hidden effect: the crash core with altered inputs, seen by an instrument.

Nothing of the diagnosis's catalogue is used: errors of the accelerometer are applied to the signal,
the other effects are inputs that differ from those that the folder states.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from models.registry import load_model
from studies.validation.diagnosis.hidden_accidents import alter
from studies.validation.diagnosis.laboratory import Hidden

Array = NDArray[np.float64]

SPEEDS = (8.5, 11.5)
"""m/s, slowest and fastest test."""
SPEED_SD = 0.05
NOISE_SD = 1.0
"""g, of the acceleration."""
SCATTER = 0.01
"""Relative, of a test's whole pulse and of its scalars."""
HOOD_SD = 0.1
"""Logarithmic, of the hood's stiffness: one value for all tests, which the folder calls unknown."""
SCALARS = {"throw_distance": ("m", 0.3), "wad": ("m", 0.02)}
AFTER_HEAD = 0.03
"""s that are recorded after the head's contact began."""

HEADER = f"""format = "mcstudy-measured/1"
title = "Child dummy, family car"
model = "multibody"

[uncertain.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = {HOOD_SD}

[inputs.impact_speed]
unit = "m/s"
sd = {SPEED_SD}

[signals.head_acceleration]
unit = "g"
sd = {NOISE_SD}
filter = "CFC1000"
"""


def make_crashes(folder: Path, hidden: Sequence[Hidden], seed: int, tests: int = 5) -> None:
    """Write a folder of full-scale tests with the effects in it.

    Parameters
    ----------
    folder : path
        New folder.
    hidden : sequence of Hidden
        Effects, by altered inputs or signals.
    seed : int
        Seed of the draws.
    tests : int
        Number of tests.
    """
    rng = np.random.default_rng(seed)
    model = load_model("multibody")
    nominal = {item.name: np.full(tests, item.nominal) for item in model.inputs}
    speeds = np.linspace(*SPEEDS, tests)
    rng.shuffle(speeds)
    given = nominal | {"impact_speed": speeds}
    given["hood_force_scale"] = np.full(tests, np.exp(HOOD_SD * rng.standard_normal()))
    true = alter({name: values.copy() for name, values in given.items()}, hidden)
    (folder / "signals").mkdir(parents=True)
    rows = []
    for k in range(tests):
        run = model.run({name: float(values[k]) for name, values in true.items()})
        head = run.histories["head"]
        kept = head.time <= run.outputs["head_impact_time"] + AFTER_HEAD
        share = 1.0 + SCATTER * rng.standard_normal()
        shown = share * _read(head.channels["acceleration"][kept], hidden)
        shown += NOISE_SD * rng.standard_normal(shown.size)
        name = f"c{k + 1}"
        pd.DataFrame({"time": head.time[kept], "head_acceleration": shown}).to_csv(
            folder / "signals" / f"{name}.csv", index=False
        )
        row = {"test": name, "impact_speed": speeds[k] + SPEED_SD * rng.standard_normal()}
        for scalar, (_, sd) in SCALARS.items():
            row[scalar] = run.outputs[scalar] * (1.0 + SCATTER * rng.standard_normal())
            row[scalar] += sd * rng.standard_normal()
        rows.append(row)
    pd.DataFrame(rows).to_csv(folder / "tests.csv", index=False)
    scalars = "".join(
        f'\n[scalars.{name}]\nunit = "{unit}"\nsd = {sd}\n' for name, (unit, sd) in SCALARS.items()
    )
    (folder / "measured.toml").write_text(HEADER + scalars, encoding="utf-8")


def _read(acceleration: Array, hidden: Sequence[Hidden]) -> Array:
    """Return what the accelerometer reads."""
    for h in hidden:
        if h.name == "sensor_gain":
            acceleration = acceleration * h.numbers["factor"]
        elif h.name == "sensor_saturation":
            acceleration = np.minimum(acceleration, h.numbers["limit"])
    return acceleration
