"""Full-scale tests with a hidden effect: a crash model with altered inputs, seen by an instrument.

Nothing of the diagnosis's catalogue is used: errors of the instruments are applied to the three
axes of the raw signal by the code of the hidden headform tests, the others are inputs or a loading
curve that differ from those that the folder states.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from models.crash.model import CrashModel
from models.crash.outcome import Raw, Signals
from models.crash.record import Column
from models.criteria.units import STANDARD_GRAVITY
from models.protocol import Model, complete_inputs
from models.registry import load_model
from studies.validation.diagnosis.hidden_accidents import alter
from studies.validation.diagnosis.hidden_hood import find
from studies.validation.diagnosis.hidden_instrument import clock, read_axes
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
UNSEEN = 0.01
"""s after them that the filter still sees."""
RATE = 10_000.0
"""Hz of the recorder."""
HOOD = ((0.0, 0.0), (0.02, 1100.0), (0.06, 2600.0), (0.1, 3600.0))
"""The hood's loading curve, m and N."""


def make_crashes(
    folder: Path,
    hidden: Sequence[Hidden],
    seed: int,
    tests: int = 5,
    model: str = "multibody",
    stated: str | None = None,
) -> None:
    """Write a folder of full-scale tests with the effects in it.

    Parameters
    ----------
    folder : path
        New folder.
    hidden : sequence of Hidden
        Effects, by altered inputs, curves or signals.
    seed : int
        Seed of the draws.
    tests : int
        Number of tests.
    model : str
        Model that stands for reality.
    stated : str, optional
        Model that the folder names to be diagnosed, by default the same.
    """
    rng = np.random.default_rng(seed)
    speeds = np.linspace(*SPEEDS, tests)
    rng.shuffle(speeds)
    scale = float(np.exp(HOOD_SD * rng.standard_normal()))
    options: dict[str, Any] = {"channel_class": 0.0, "hood_curve": _curve(hidden, scale)}
    reality = load_model(model, options)
    nominal = {item.name: np.full(tests, item.nominal) for item in reality.inputs}
    given = nominal | {"impact_speed": speeds}
    given["hood_force_scale"] = np.full(tests, scale)
    true = alter({name: values.copy() for name, values in given.items()}, hidden)
    (folder / "signals").mkdir(parents=True)
    rows = []
    for k in range(tests):
        inputs = {name: float(values[k]) for name, values in true.items()}
        time, axes, outputs = _crash(reality, inputs)
        share = 1.0 + SCATTER * rng.standard_normal()
        end = outputs["head_impact_time"] + AFTER_HEAD
        # An overload at the landing comes after the record.
        before = time <= end + UNSEEN
        time, axes = time[before], axes[before]
        shown = read_axes(hidden, share * axes, time, RATE, k / (tests - 1))
        kept = time <= end
        shown = shown[kept] + NOISE_SD * rng.standard_normal(kept.sum())
        name = f"c{k + 1}"
        pd.DataFrame({"time": clock(hidden, time[kept]), "head_acceleration": shown}).to_csv(
            folder / "signals" / f"{name}.csv", index=False
        )
        row = {"test": name, "impact_speed": speeds[k] + SPEED_SD * rng.standard_normal()}
        for scalar, (_, sd) in SCALARS.items():
            row[scalar] = outputs[scalar] * (1.0 + SCATTER * rng.standard_normal())
            row[scalar] += sd * rng.standard_normal()
        rows.append(row)
    pd.DataFrame(rows).to_csv(folder / "tests.csv", index=False)
    (folder / "measured.toml").write_text(_header(stated or model), encoding="utf-8")


def _crash(reality: Model, inputs: Mapping[str, float]) -> tuple[Array, Array, dict[str, float]]:
    """Return times (n,), head accelerations along its own axes (n, 3), g, and outputs."""
    assert isinstance(reality, CrashModel)
    raw = reality._simulate(complete_inputs(reality, inputs))
    assert isinstance(raw, Raw)
    signals = Signals(raw)
    true = signals.sampled(Column.ACCELERATION, 3, signals.head_time) / STANDARD_GRAVITY
    return signals.head_time, true, reality._judge(raw, signals)[1]


def _curve(hidden: Sequence[Hidden], scale: float) -> list[list[float]]:
    """Return the hood's loading curve as it truly is, before a scale of its forces."""
    x, force = np.array(HOOD).T
    bottom, plateau = find(hidden, "hood_bottoming"), find(hidden, "hood_yield")
    more: Sequence[float] | Array = (
        [] if bottom is None else bottom.numbers["clearance"] + np.array([0.0, 0.006, 0.015])
    )
    # The hood yields at a force, whatever the scale.
    yielding = np.inf if plateau is None else plateau.numbers["force"] / scale
    if plateau is not None:
        more = [float(np.interp(yielding, force, x))]
    depth = np.unique(np.concatenate([x, more]))
    true = np.interp(depth, x, force)
    if bottom is not None:
        beyond = np.maximum(0.0, depth - bottom.numbers["clearance"])
        true = true + bottom.numbers["stiffness"] * beyond**1.5 / 0.1
    if plateau is not None:
        true = true - (1.0 - plateau.numbers["remaining"]) * np.maximum(0.0, true - yielding)
    knots: list[list[float]] = np.stack([depth, true], axis=1).tolist()
    return knots


def _header(model: str) -> str:
    knots = ", ".join(f"[{x}, {f}]" for x, f in HOOD)
    text = f"""format = "mcstudy-measured/1"
title = "Child dummy, family car"
model = "{model}"

[fixed]
hood_curve = [{knots}]

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
    return text + "".join(
        f'\n[scalars.{name}]\nunit = "{unit}"\nsd = {sd}\n' for name, (unit, sd) in SCALARS.items()
    )
