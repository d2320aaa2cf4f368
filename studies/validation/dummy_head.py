"""Q3 child-dummy head impacts: measured force and acceleration against a law from the slow tests.

A robot's bumper (133 kg) struck the head of a whole dummy at 1.0, 1.5 and 3.1 m/s
(D. Paez-Granados and A. Billard, Scientific Reports 12:5285, 2022). The data are not part of the
project; the part is left out where the folder is missing.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import least_squares

from mcstudy.errors import UserError
from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from mcstudy.tables import read_csv
from mcstudy.text import number
from models.contact.law import ForceCurve
from models.contact.loading import choose_knots, fit_loading
from models.criteria import contact_window, effective_mass, head_injury_criterion
from models.criteria.units import STANDARD_GRAVITY
from models.registry import load_model
from studies.validation.check import Check, Part, check

Array = NDArray[np.float64]

FILE = "q3_child_dummy_head_impact.csv"
COLUMNS = ("test_speed_m_s", "time_ms", "head_acc_g", "impact_force_N")
MIN_SAMPLES = 20
"""Samples of one impact, at least."""
ROBOT = 133.0
"""kg [found]."""
KEYS = (
    "dummy_hic",
    "dummy_effective_mass",
    "dummy_peak",
    "dummy_predicted_hic",
    "dummy_duration",
    "dummy_own_law_hic",
)


@dataclass(frozen=True)
class _Impact:
    """One test: speed (m/s), time (s), head acceleration (g), force (N), penetration (m)."""

    speed: float
    time: Array
    acceleration: Array
    force: Array
    penetration: Array


def validate(workers: int, measured: Path) -> Part:
    """Return the part on the dummy's head impacts.

    Raises
    ------
    UserError
        If the file is there but cannot be read.
    """
    path = measured / FILE
    if not path.exists():
        empty: list[Check] = [check(key, np.nan) for key in KEYS]
        missing = f"Not run: {FILE} is not in the folder of measured data (option --measured)."
        return Part("Child-dummy head impacts", (missing,), empty)
    try:
        return _judge(_read(path))
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None


def _judge(impacts: list[_Impact]) -> Part:
    """Return the part for the impacts that were measured.

    Raises
    ------
    ValueError
        If they are no impacts that can be evaluated.
    """
    slow, fast = impacts[:-1], impacts[-1]
    masses = [effective_mass(i.time, i.force, i.acceleration) for i in impacts]
    mass = float(np.mean(masses[:-1]))
    hic = head_injury_criterion(fast.time, fast.acceleration, 0.015, method="grid")[0]
    law = _fit_rate_law(slow, mass)
    rated = [_simulate(law, mass, impact.speed) for impact in impacts]
    straight = _predict(_fit_curve(slow), mass, fast.speed)
    checks = [
        check("dummy_hic", hic),
        check("dummy_effective_mass", float(np.mean(masses))),
        check("dummy_peak", rated[-1].acceleration.max() / fast.acceleration.max()),
        check("dummy_predicted_hic", _hic(rated[-1]) / hic),
        check("dummy_duration", _duration(rated[-1]) / _duration(fast)),
        check("dummy_own_law_hic", _hic(straight) / hic),
    ]
    words = [
        "Effective head mass by impulse over momentum, contact bounded at 5 % of the peak force: "
        f"{', '.join(number(m) for m in masses)} kg at "
        f"{', '.join(number(i.speed, 2) for i in impacts)} m/s.",
        "Two laws were fitted to the two slow tests and, with their mean effective mass of "
        f"{number(mass)} kg, used to predict the fast one, {fast.speed / slow[-1].speed:.1f} times "
        "faster. A power law with a rate term (Hunt and Crossley 1975, "
        f"F = k d^{law.exponent:.2f} (1 + {law.rate:.1f} s/m v)) gives a peak of "
        f"{number(float(rated[-1].acceleration.max()))} g against "
        f"{number(float(fast.acceleration.max()))} g measured "
        f"({_per_cent(rated[-1].acceleration.max() / fast.acceleration.max())}), a force of "
        f"{number(float(rated[-1].force.max()) / 1e3)} kN against "
        f"{number(float(fast.force.max()) / 1e3)} kN "
        f"({_per_cent(rated[-1].force.max() / fast.force.max())}) and HIC15 "
        f"{number(_hic(rated[-1]))} against {number(hic)} ({_per_cent(_hic(rated[-1]) / hic)}).",
        "The crash core's own kind of law, piecewise linear and without rate, gives HIC15 "
        f"{number(_hic(straight))} ({_per_cent(_hic(straight) / hic)}): the two slow tests reach "
        "the same penetration with forces of "
        f"{' and '.join(number(i.force.max() / 1e3, 2) for i in slow)} kN, which no law of "
        "penetration alone can give.",
    ]
    return Part(
        "Child-dummy head impacts",
        words,
        checks,
        {"Q3 head struck by a robot: measured (solid) and by the rate-dependent law of the two "
         "slow tests (dashed).": _draw(impacts, rated)},
    )  # fmt: skip


def _per_cent(ratio: float) -> str:
    return f"{100.0 * (float(ratio) - 1.0):+.0f} %"


def _hic(impact: _Impact) -> float:
    return head_injury_criterion(impact.time, impact.acceleration, 0.015)[0]


def _read(path: Path) -> list[_Impact]:
    text = read_csv(path)
    table = pd.DataFrame({name: text.numbers(name) for name in COLUMNS})
    groups = [part for _, part in table.groupby(COLUMNS[0])]
    if len(groups) < 3 or not np.isfinite(table.to_numpy()).all():
        raise UserError(f"{path}: must hold three tests or more, all of them numbers")
    impacts = []
    for part in groups:
        speed, ms, acceleration, force = part.to_numpy().T
        t = 1e-3 * ms
        if t.size < MIN_SAMPLES or np.any(np.diff(t) <= 0.0):
            raise ValueError(f"time must rise, over {MIN_SAMPLES} samples or more")
        if not (force.max() > 0.0 and acceleration.max() > 0.0 and acceleration.min() >= 0.0):
            raise ValueError("force and acceleration must be positive somewhere")
        head = STANDARD_GRAVITY * cumulative_trapezoid(acceleration, t, initial=0)
        # The robot loses what the force takes from it.
        robot = speed - cumulative_trapezoid(force, t, initial=0) / ROBOT
        depth = cumulative_trapezoid(robot - head, t, initial=0)
        impacts.append(_Impact(float(speed[0]), t, acceleration, force, depth))
    return impacts


@dataclass(frozen=True)
class _RateLaw:
    """F = stiffness d^exponent (1 + rate v), never pulling (K. Hunt and F. Crossley, 1975)."""

    stiffness: float
    exponent: float
    rate: float

    def force(self, depth: Array, speed: Array) -> Array:
        """Return the force (N) at a penetration (m) that grows with ``speed`` (m/s)."""
        power = self.stiffness * np.maximum(depth, 0.0) ** self.exponent
        return np.maximum(power * (1.0 + self.rate * speed), 0.0)


def _simulate(law: _RateLaw, mass: float, speed: float, time: Array | None = None) -> _Impact:
    """Return the impact of head and robot under a rate-dependent law."""
    t = np.arange(0.0, 0.01505, 5e-5) if time is None else time

    def move(_: float, state: Array) -> list[float]:
        force = float(law.force(state[0], state[1]))
        return [float(state[1]), -force * (1.0 / mass + 1.0 / ROBOT)]

    found = solve_ivp(
        move, (0.0, float(t[-1])), [0.0, speed], t_eval=t, max_step=1e-4, rtol=1e-7, atol=1e-9
    )
    depth, rate = found.y
    force = law.force(depth, rate)
    return _Impact(speed, t, force / (mass * STANDARD_GRAVITY), force, depth)


def _fit_rate_law(impacts: list[_Impact], mass: float) -> _RateLaw:
    """Return the law whose simulated forces fit the measured ones best, each over its peak."""

    def misfit(x: Array) -> Array:
        law = _RateLaw(float(np.exp(x[0])), float(x[1]), float(x[2]))
        return np.concatenate(
            [(_simulate(law, mass, i.speed, i.time).force - i.force) / i.force.max()
             for i in impacts]
        )  # fmt: skip

    start = [np.log(1e8), 2.0, 0.3]
    found = least_squares(misfit, start, diff_step=[1e-4] * 3).x
    return _RateLaw(float(np.exp(found[0])), float(found[1]), float(found[2]))


def _fit_curve(impacts: list[_Impact]) -> ForceCurve:
    """Return one loading curve, up to the peaks of the forces, and the mean unloading ratio."""
    ends = [int(np.argmax(impact.force)) for impact in impacts]
    depth = np.concatenate([i.penetration[: k + 1] for i, k in zip(impacts, ends, strict=True)])
    force = np.concatenate([i.force[: k + 1] for i, k in zip(impacts, ends, strict=True)])
    order = np.argsort(depth, kind="stable")
    depth, force = np.maximum(depth[order], 0.0), force[order]
    knots = choose_knots(depth, force, 5)
    # The force falls to nothing at the largest penetration: all of it stays.
    return ForceCurve(knots, fit_loading(depth, force, knots), 50.0)


def _predict(curve: ForceCurve, mass: float, speed: float) -> _Impact:
    """Return the impact of head and robot under the law of the crash core."""
    model = load_model(
        "headform",
        {"hood_curve": curve.knots},
    )
    reduced = mass * ROBOT / (mass + ROBOT)
    run = model.run(
        {"impact_speed": speed, "headform_mass": reduced,
         "hood_unloading_ratio": curve.unloading_ratio}
    )  # fmt: skip
    head, hood = run.histories["head"], run.histories["hood"]
    kept = head.time >= 0.0
    return _Impact(
        speed, head.time[kept], head.channels["acceleration"][kept] * reduced / mass,
        hood.channels["force"][kept], hood.channels["penetration"][kept],
    )  # fmt: skip


def _duration(impact: _Impact) -> float:
    first, last = contact_window(impact.time, impact.force)
    return float(impact.time[last] - impact.time[first])


def _draw(impacts: list[_Impact], simulated: list[_Impact]) -> Figure:
    panels = []
    for xlabel, ylabel, x, y in (
        ("time [ms]", "head acceleration [g]", "time", "acceleration"),
        ("time [ms]", "contact force [kN]", "time", "force"),
        ("penetration [mm]", "contact force [kN]", "penetration", "force"),
    ):
        scale = 1e-3 if y == "force" else 1.0
        curves = []
        for k, (measured, ours) in enumerate(zip(impacts, simulated, strict=True)):
            name = f"{measured.speed:.1f} m/s"
            colour = style.PALETTE[k]
            curves += [
                Curve(1e3 * getattr(measured, x), scale * getattr(measured, y), name, colour),
                Curve(1e3 * getattr(ours, x), scale * getattr(ours, y), None, colour, "--"),
            ]
        limit = 15.0 if x == "time" else None
        panels.append(Panel(xlabel, ylabel, curves, xlim=(0.0, limit), ylim=(0.0, None)))
    return draw_panels(panels, columns=3, width=3.8, height=3.3)
