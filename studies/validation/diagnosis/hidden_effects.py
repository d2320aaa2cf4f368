"""Data with a hidden effect, by a generator that shares no code with the diagnosis.

The headform's contact is integrated by SciPy's adaptive Runge-Kutta solver in two phases, into the
hood and out of it, with contact laws written here. A set of tests has recorded speeds that are off,
sensor noise, a small scatter from test to test, and at most one or two effects in one of several
functional forms. The answer key is returned apart from the data.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import integrate, signal

Array = NDArray[np.float64]
Law = Callable[[float, float], float]

GRAVITY = 9.80665
RATE = 20_000.0
LEAD, TAIL = 0.004, 0.006
CURVE = ((0.0, 0.0), (0.015, 2600.0), (0.055, 3600.0), (0.1, 5200.0))


@dataclass(frozen=True)
class Hidden:
    """One effect: its name, functional form and numbers."""

    name: str
    form: str = "catalogue"
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Laboratory:
    """How a set of tests was made.

    Attributes
    ----------
    tests : int
        Number of tests.
    slowest, fastest : float
        Impact speeds, m/s.
    mass : float
        Headform mass, kg.
    speed_sd : float
        Of the recorded speed, m/s.
    noise_sd : float
        Of the acceleration after the filter, g.
    force_sd : float
        Of the load cell, N.
    rebound_sd : float
        Of the rebound speed, m/s.
    scatter : float
        Of the pulse from test to test, relative.
    scale_sd : float
        Of the logarithm of the hood's unknown force scale.
    force, rebound : bool
        Whether a load cell and a rebound speed were recorded.
    """

    tests: int = 18
    slowest: float = 5.0
    fastest: float = 10.0
    mass: float = 2.5
    ratio: float = 7.0
    speed_sd: float = 0.05
    noise_sd: float = 1.0
    force_sd: float = 20.0
    rebound_sd: float = 0.02
    scatter: float = 0.01
    scale_sd: float = 0.06
    force: bool = False
    rebound: bool = False


def make_tests(
    folder: Path,
    hidden: Sequence[Hidden],
    seed: int,
    laboratory: Laboratory | None = None,
    *,
    header_of: Laboratory | None = None,
) -> None:
    """Write a folder of measured tests with the effects in it.

    Parameters
    ----------
    folder : path
        New folder.
    hidden : sequence of Hidden
        Effects in the data.
    seed : int
        Seed of speeds, noise and scatter.
    laboratory : Laboratory, optional
        How the tests were made.
    header_of : Laboratory, optional
        What ``measured.toml`` states of it, by default the truth.
    """
    lab = laboratory or Laboratory()
    rng = np.random.default_rng(seed)
    scale = float(np.exp(rng.normal(0.0, lab.scale_sd)))
    speeds = np.sort(rng.uniform(lab.slowest, lab.fastest, lab.tests))
    rng.shuffle(speeds)
    rows = []
    (folder / "signals").mkdir(parents=True)
    for k, speed in enumerate(speeds):
        time, force, acceleration, rebound = _strike(hidden, lab, float(speed), scale, k)
        # Scatter of the whole pulse: a level and a slow wave of their own in each test.
        level, wave = rng.normal(0.0, lab.scatter, 2)
        phase = rng.uniform(0.0, 6.28)
        share = 1.0 + level + wave * np.sin(np.pi * time / max(time[-1], 1e-9) + phase)
        read = _read(hidden, acceleration * share / GRAVITY, time)
        shown = _filtered(read, _class_of(hidden)) + rng.normal(0.0, lab.noise_sd, time.size)
        columns = {"time": _clock(hidden, time), "head_acceleration": shown}
        if lab.force:
            columns["hood_force"] = _filtered(force * share, 1000.0) + rng.normal(
                0.0, lab.force_sd, time.size
            )
        name = f"t{k + 1:02d}"
        pd.DataFrame(columns).to_csv(folder / "signals" / f"{name}.csv", index=False)
        row = {"test": name, "impact_speed": _recorded(hidden, float(speed))
               + rng.normal(0.0, lab.speed_sd)}  # fmt: skip
        if lab.rebound:
            row["rebound_speed"] = rebound + rng.normal(0.0, lab.rebound_sd)
        rows.append(row)
    pd.DataFrame(rows).to_csv(folder / "tests.csv", index=False)
    (folder / "measured.toml").write_text(_header(header_of or lab), encoding="utf-8")


def _header(lab: Laboratory) -> str:
    knots = ", ".join(f"[{x}, {f}]" for x, f in CURVE)
    text = f"""format = "mcstudy-measured/1"
title = "Hood, child headform"
model = "headform"

[fixed]
headform_mass = {lab.mass}
hood_unloading_ratio = {lab.ratio}
hood_curve = [{knots}]

[uncertain.hood_force_scale]
distribution = "lognormal"
median = 1.0
sigma = {lab.scale_sd}

[inputs.impact_speed]
unit = "m/s"
sd = {lab.speed_sd}

[signals.head_acceleration]
unit = "g"
sd = {lab.noise_sd}
filter = "CFC1000"
"""
    if lab.force:
        text += f'\n[signals.hood_force]\nunit = "N"\nsd = {lab.force_sd}\nfilter = "CFC1000"\n'
    if lab.rebound:
        text += f'\n[scalars.rebound_speed]\nunit = "m/s"\nsd = {lab.rebound_sd}\n'
    return text


def _numbers(hidden: Sequence[Hidden], name: str) -> Hidden | None:
    return next((h for h in hidden if h.name == name), None)


def _loading(hidden: Sequence[Hidden], scale: float, order: int) -> Law:
    """Return the force (N) into the hood at penetration and rate."""
    x, f = np.array(CURVE).T
    last = (f[-1] - f[-2]) / (x[-1] - x[-2])
    changes = {h.name: h for h in hidden}

    def law(depth: float, rate: float) -> float:
        if depth <= 0.0:
            return 0.0
        force = scale * (float(np.interp(depth, x, f)) + last * max(0.0, depth - x[-1]))
        if "hood_force_scale" in changes:
            force *= changes["hood_force_scale"].numbers["factor"]
        if "ageing" in changes:
            # Outside the catalogue: every hit softens the hood a little.
            force *= (1.0 - changes["ageing"].numbers["loss"]) ** order
        if "hood_yield" in changes:
            h = changes["hood_yield"]
            above = force - h.numbers["force"]
            if above > 0.0:
                if h.form == "smooth":
                    width = 0.15 * h.numbers["force"]
                    above = h.numbers["remaining"] * above + width * np.tanh(above / width) * (
                        1.0 - h.numbers["remaining"]
                    )
                else:
                    above *= h.numbers["remaining"]
                force = h.numbers["force"] + above
        if "hood_bottoming" in changes:
            h = changes["hood_bottoming"]
            beyond = max(0.0, depth - h.numbers["clearance"])
            if h.form == "quadratic":
                force += h.numbers["stiffness"] * beyond**2 / 0.01
            elif h.form == "hertz":
                force += h.numbers["stiffness"] * beyond**1.5 / 0.1
            else:
                force += h.numbers["stiffness"] * beyond
        if "rate_dependent_hood" in changes and rate > 0.0:
            h = changes["rate_dependent_hood"]
            if h.form == "dashpot":
                force += h.numbers["damping"] * rate * min(1.0, depth / 0.002)
            elif h.form == "relative":
                force *= 1.0 + h.numbers["per_speed"] * rate
            elif h.form == "logarithmic":
                force *= 1.0 + h.numbers["share"] * np.log1p(rate / 0.5)
            else:
                force *= 1.0 + h.numbers["share"] * (rate / 8.0) ** h.numbers["exponent"]
        if "ringing" in changes:
            # Outside the catalogue: the panel rings as it is pushed in.
            h = changes["ringing"]
            force *= 1.0 + h.numbers["share"] * np.sin(2.0 * np.pi * depth / h.numbers["length"])
        return float(force)

    return law


class _Event:
    """Ends an integration where a value falls through zero."""

    terminal, direction = True, -1.0

    def __init__(self, value: Callable[[Array], float]) -> None:
        self._value = value

    def __call__(self, _t: float, y: Array) -> float:
        return self._value(y)


def _strike(
    hidden: Sequence[Hidden], lab: Laboratory, speed: float, scale: float, order: int
) -> tuple[Array, Array, Array, float]:
    """Return time (s), force (N), acceleration of the head (m/s2) and rebound speed (m/s)."""
    mass = lab.mass
    if (h := _numbers(hidden, "mass_error")) is not None:
        mass *= h.numbers["factor"]
    ratio = lab.ratio
    if (h := _numbers(hidden, "unloading_slope")) is not None:
        ratio = 1.0 + (ratio - 1.0) * h.numbers["factor"]
    law = _loading(hidden, scale, order)
    options: Any = {"rtol": 1e-9, "atol": 1e-10, "max_step": 1e-4, "dense_output": True}

    def into(_t: float, y: Array) -> list[float]:
        return [y[1], -law(y[0], y[1]) / mass]

    stopped = _Event(lambda y: float(y[1]))
    first = integrate.solve_ivp(into, (0.0, 0.2), [0.0, speed], events=stopped, **options)
    turn, deepest = float(first.t[-1]), float(first.y[0, -1])
    top = law(deepest, 0.0)
    slope = ratio * top / deepest

    def spring(depth: float) -> float:
        return max(0.0, top + slope * (depth - deepest))

    def out(_t: float, y: Array) -> list[float]:
        return [y[1], -spring(y[0]) / mass]

    parted = _Event(lambda y: float(y[0] - (deepest - top / slope)))
    second = integrate.solve_ivp(out, (turn, turn + 0.2), [deepest, 0.0], events=parted, **options)
    end, rebound = float(second.t[-1]), -float(second.y[1, -1])
    into_hood, out_of_hood = first.sol, second.sol
    assert into_hood is not None and out_of_hood is not None
    time = np.arange(round(-LEAD * RATE), round((end + TAIL) * RATE)) / RATE
    force = np.zeros(time.size)
    for k, t in enumerate(time):
        if 0.0 <= t <= turn:
            depth, rate = into_hood(float(t))
            force[k] = law(float(depth), float(rate))
        elif turn < t <= end:
            force[k] = spring(float(out_of_hood(float(t))[0]))
    return time, force, force / mass, rebound


def _read(hidden: Sequence[Hidden], acceleration: Array, time: Array) -> Array:
    """Return what the accelerometer reads (g)."""
    for h in hidden:
        if h.name == "sensor_gain":
            acceleration = acceleration * h.numbers["factor"]
        elif h.name == "sensor_offset":
            acceleration = acceleration + h.numbers["offset"]
        elif h.name == "sensor_saturation":
            limit = h.numbers["limit"]
            soft = h.form == "soft"
            acceleration = (
                limit * np.tanh(acceleration / limit) if soft else np.minimum(acceleration, limit)
            )
        elif h.name == "cable":
            # Outside the catalogue: a loose cable adds bursts of hum.
            acceleration = acceleration + h.numbers["size"] * np.sin(2e3 * np.pi * time) * (
                time > 0
            )
    return acceleration


def _class_of(hidden: Sequence[Hidden]) -> float:
    h = _numbers(hidden, "sensor_filter")
    return 1000.0 if h is None else h.numbers["channel_class"]


def _filtered(values: Array, channel_class: float) -> Array:
    """Return values through a two-pole Butterworth filter, forward and backward (SAE J211)."""
    sections = signal.butter(2, 2.0775 * channel_class, fs=RATE, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, values))


def _clock(hidden: Sequence[Hidden], time: Array) -> Array:
    h = _numbers(hidden, "time_scale")
    return time if h is None else time * h.numbers["factor"]


def _recorded(hidden: Sequence[Hidden], speed: float) -> float:
    h = _numbers(hidden, "speed_bias")
    return speed if h is None else speed / h.numbers["factor"]
