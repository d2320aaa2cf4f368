"""The hood of the hidden effects: its contact laws and the motion of the headform into it.

SciPy's adaptive Runge-Kutta solver integrates the contact in two phases, into the hood and out of
it; where a part of the hood has mass and moves on its own, a fixed step of second order does.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate

from studies.validation.diagnosis.laboratory import Hidden, Laboratory

Array = NDArray[np.float64]
Law = Callable[[float, float], float]

STEP = 5e-6
"""s of the fixed step."""
LONGEST = 0.2
"""s of contact."""


@dataclass(frozen=True)
class Impact:
    """A headform's contact: functions of the time since first contact (s), end and rebound.

    Attributes
    ----------
    force : of the hood on the headform, N.
    mass : of the headform, kg.
    end : of the contact, s.
    rebound : speed, m/s.
    guide : force of the guide against the way into the hood, N.
    """

    force: Callable[[Array], Array]
    mass: float
    end: float
    rebound: float
    guide: Callable[[Array], Array] = np.zeros_like


def find(hidden: Sequence[Hidden], name: str) -> Hidden | None:
    """Return a hidden effect by name, or None."""
    return next((h for h in hidden if h.name == name), None)


def strike(
    hidden: Sequence[Hidden], lab: Laboratory, speed: float, scale: float, order: int
) -> Impact:
    """Return the impact of a headform.

    Parameters
    ----------
    hidden : sequence of Hidden
        Effects.
    lab : Laboratory
    speed : float
        True impact speed, m/s.
    scale : float
        Factor on the hood's forces.
    order : int
        Number of the test, from 0.
    """
    mass = lab.mass
    if (h := find(hidden, "mass_error")) is not None:
        mass *= h.numbers["factor"]
    law = _loading(hidden, lab, scale, order)
    inertia = find(hidden, "hood_inertia")
    if inertia is not None and inertia.form == "local_spring":
        return _strike_sprung(law, _unloading(hidden, lab), mass, speed, inertia.numbers)
    return _strike(
        law, _unloading(hidden, lab), mass, speed, inertia, find(hidden, "guide_friction")
    )


def _guide(h: Hidden | None, rate: float) -> float:
    """Return the force (N) of the guide against the way into the hood at a rate (m/s)."""
    if h is None:
        return 0.0
    size = h.numbers["force"]
    if h.form == "greased":
        size *= abs(rate) / 8.0
    elif h.form == "stribeck":
        # Grease carries more and more of the load as the headform gets faster.
        size *= 0.3 + float(np.exp(-abs(rate) / 3.0))
    return float(size * np.sign(rate))


def _loading(hidden: Sequence[Hidden], lab: Laboratory, scale: float, order: int) -> Law:
    """Return the force (N) into the hood at penetration and rate."""
    x, f = np.array(lab.curve).T
    last = (f[-1] - f[-2]) / (x[-1] - x[-2])
    changes = {h.name: h for h in hidden}
    progress = order / max(lab.tests - 1, 1)

    def plain(depth: float) -> float:
        force = scale * float(np.interp(depth, x, f) + last * max(0.0, depth - x[-1]))
        if (h := changes.get("hood_force_scale")) is not None:
            if h.form == "ageing":
                force *= 1.0 - h.numbers["loss"] * progress
            else:
                force *= h.numbers["factor"]
        if (h := changes.get("rupture")) is not None and depth > h.numbers["depth"]:
            # Outside the catalogue: a weld breaks, and what it carried is lost.
            force *= 1.0 - h.numbers["share"]
        if (h := changes.get("hood_yield")) is not None:
            force = _yielded(force, h)
        if (h := changes.get("hood_bottoming")) is not None:
            force += _bottoming(max(0.0, depth - h.numbers["clearance"]), h)
        return force

    def law(depth: float, rate: float) -> float:
        if depth <= 0.0:
            return 0.0
        force = plain(depth)
        if rate > 0.0 and (h := changes.get("rate_dependent_hood")) is not None:
            force += _rate_force(force, depth, rate, h)
        if (h := changes.get("ringing")) is not None:
            # Outside the catalogue: the panel rings as it is pushed in.
            force *= 1.0 + h.numbers["share"] * np.sin(2.0 * np.pi * depth / h.numbers["length"])
        return float(force)

    if (h := changes.get("skin_compliance")) is None:
        return law
    # The skin is massless: hood and skin carry the same force, their penetrations add.
    hood = np.concatenate([np.linspace(0.0, 0.02, 400), np.linspace(0.0203, 0.2, 400)])
    carried = np.array([law(float(d), 0.0) for d in hood])
    whole = hood + _skin(carried, h)

    def with_skin(depth: float, rate: float) -> float:
        return law(float(np.interp(depth, whole, hood)), rate)

    return with_skin


def _skin(force: Array, h: Hidden) -> Array:
    """Return the penetration (m) of the headform's skin at forces (N)."""
    if h.form == "hertz":
        return np.asarray(h.numbers["compliance"] * 4000.0 * (force / 4000.0) ** (2.0 / 3.0))
    return np.asarray(h.numbers["compliance"] * force)


def _yielded(force: float, h: Hidden) -> float:
    above = force - h.numbers["force"]
    if above <= 0.0:
        return force
    if h.form == "smooth":
        width = 0.15 * h.numbers["force"]
        above = h.numbers["remaining"] * above + width * np.tanh(above / width) * (
            1.0 - h.numbers["remaining"]
        )
    else:
        above *= h.numbers["remaining"]
    return float(h.numbers["force"] + above)


def _bottoming(beyond: float, h: Hidden) -> float:
    stiffness = h.numbers["stiffness"]
    if h.form == "quadratic":
        return float(stiffness * beyond**2 / 0.01)
    if h.form == "hertz":
        return float(stiffness * beyond**1.5 / 0.1)
    if h.form == "soft_start":
        # The stiffness fades in over a soft layer.
        layer = h.numbers["layer"]
        return float(stiffness * (beyond - layer * (1.0 - np.exp(-beyond / layer))))
    if h.form == "hardening":
        return float(stiffness * 0.01 * np.expm1(beyond / 0.01))
    return float(stiffness * beyond)


def _rate_force(force: float, depth: float, rate: float, h: Hidden) -> float:
    """Return the additional force (N) of a rate of penetration."""
    numbers = h.numbers
    if h.form == "dashpot":
        return numbers["damping"] * rate * min(1.0, depth / 0.002)
    if h.form == "ramped":
        return numbers["damping"] * rate * min(1.0, depth / numbers["ramp"])
    if h.form == "fading":
        # A dashpot of the outer panel alone, gone once it touches the inner one.
        left = float(np.exp(-depth / numbers["end"]))
        return numbers["damping"] * rate * min(1.0, depth / 0.002) * left
    if h.form == "relative":
        return force * numbers["per_speed"] * rate
    if h.form == "dry":
        # Seams of the hood rub: the force hardly depends on how fast they do.
        return float(numbers["force"] * np.tanh(rate / 0.05) * min(1.0, depth / 0.002))
    if h.form == "logarithmic":
        return float(force * numbers["share"] * np.log1p(rate / 0.5))
    return float(force * numbers["share"] * (rate / 8.0) ** numbers["exponent"])


@dataclass(frozen=True)
class _Unloading:
    """Slope over secant slope at 30 mm, its growth with depth, and the curvature of the way out."""

    ratio: float
    growth: float = 0.0
    curvature: float = 1.0
    skin: Hidden | None = None

    def slope(self, top: float, deepest: float) -> float:
        """Return the mean slope (N/m) from a largest penetration (m) with a force (N)."""
        skin = 0.0 if self.skin is None else float(_skin(np.array(top), self.skin))
        hood = deepest - skin
        ratio = 1.0 + (self.ratio - 1.0) * (hood / 0.03) ** self.growth
        # The skin is elastic: it recovers whole.
        return float(top / (hood / ratio + skin))

    def force(self, top: float, deepest: float, depth: float) -> float:
        """Return the force (N) on the way out."""
        share = 1.0 + self.slope(top, deepest) * (depth - deepest) / top
        return float(top * max(0.0, share) ** self.curvature)


def _unloading(hidden: Sequence[Hidden], lab: Laboratory) -> _Unloading:
    h = find(hidden, "unloading_slope")
    if h is None:
        return _Unloading(lab.ratio, skin=find(hidden, "skin_compliance"))
    if h.form == "curved":
        return _Unloading(lab.ratio, curvature=h.numbers["curvature"])
    if h.form == "deep":
        return _Unloading(lab.ratio, growth=h.numbers["growth"])
    return _Unloading(1.0 + (lab.ratio - 1.0) * h.numbers["factor"])


class _Event:
    """Ends an integration where a value falls through zero."""

    terminal, direction = True, -1.0

    def __init__(self, value: Callable[[Array], float]) -> None:
        self._value = value

    def __call__(self, _t: float, y: Array) -> float:
        return self._value(y)


def _strike(
    law: Law,
    unloading: _Unloading,
    mass: float,
    speed: float,
    inertia: Hidden | None,
    guide: Hidden | None,
) -> Impact:
    options: Any = {"rtol": 1e-9, "atol": 1e-10, "max_step": 1e-4, "dense_output": True}

    def moved(depth: float) -> tuple[float, float]:
        """Return the mass (kg) of the hood that moves with the headform, and its growth (kg/m)."""
        if inertia is None:
            return 0.0, 0.0
        whole, over = inertia.numbers["mass"], inertia.numbers["depth"]
        if inertia.form == "linear":
            return whole * min(depth / over, 1.0), whole / over if depth < over else 0.0
        rest = np.exp(-((depth / over) ** 2))
        return whole * (1.0 - rest), 2.0 * whole * depth / over**2 * rest

    def slowing(depth: float, rate: float) -> float:
        carried, growth = moved(depth)
        drag = _guide(guide, rate)
        return (law(depth, rate) + drag + growth * rate * rate) / (mass + carried)

    def into(_t: float, y: Array) -> list[float]:
        return [y[1], -slowing(y[0], y[1])]

    stopped = _Event(lambda y: float(y[1]))
    first = integrate.solve_ivp(into, (0.0, LONGEST), [0.0, speed], events=stopped, **options)
    turn, deepest = float(first.t[-1]), float(first.y[0, -1])
    top = law(deepest, 0.0)
    # The mass that was picked up moves out with the headform.
    heavy = mass + moved(deepest)[0]

    def rebounding(depth: float, rate: float) -> float:
        # At the turn the headform is already on its way out.
        drag = _guide(guide, min(rate, -1e-9))
        return (unloading.force(top, deepest, depth) + drag) / heavy

    def out(_t: float, y: Array) -> list[float]:
        return [y[1], -rebounding(y[0], y[1])]

    parting = deepest - top / unloading.slope(top, deepest)
    parted = _Event(lambda y: float(y[0] - parting))
    second = integrate.solve_ivp(
        out, (turn, turn + LONGEST), [deepest, 0.0], events=parted, **options
    )
    end, rebound = float(second.t[-1]), -float(second.y[1, -1])
    into_hood, out_of_hood = first.sol, second.sol
    assert into_hood is not None and out_of_hood is not None

    def force(time: Array) -> Array:
        found = np.zeros(time.size)
        for k, t in enumerate(time):
            if 0.0 <= t <= turn:
                depth, rate = map(float, into_hood(float(t)))
                found[k] = mass * slowing(depth, rate) - _guide(guide, rate)
            elif turn < t <= end:
                depth, rate = map(float, out_of_hood(float(t)))
                found[k] = mass * rebounding(depth, rate) - _guide(guide, min(rate, -1e-9))
        return found

    def drag(time: Array) -> Array:
        rates = np.where(time < 0.0, speed, -rebound)
        for k, t in enumerate(time):
            if 0.0 <= t <= end:
                rates[k] = (into_hood if t <= turn else out_of_hood)(float(t))[1]
        return np.array([_guide(guide, float(rate)) for rate in rates])

    return Impact(force, mass, end, rebound, np.zeros_like if guide is None else drag)


def _strike_sprung(
    law: Law, unloading: _Unloading, mass: float, speed: float, numbers: Mapping[str, float]
) -> Impact:
    """Return the impact on a part of the hood that has mass, through a local spring."""
    part, spring = numbers["mass"], numbers["spring"]
    head, rate, hood, hood_rate = 0.0, speed, 0.0, 0.0
    deepest = 0.0
    forces = []
    for _ in range(round(LONGEST / STEP)):
        # K. Hunt and F. Crossley's damping: no force without penetration.
        loss = max(0.0, 1.0 + numbers["loss"] * (rate - hood_rate))
        press = spring * max(0.0, head - hood) * loss
        deepest = max(deepest, hood)
        below = law(hood, hood_rate)
        if hood < deepest:
            below = unloading.force(law(deepest, 0.0), deepest, hood)
        forces.append(press)
        rate -= STEP * press / mass
        hood_rate += STEP * (press - below) / part
        head += STEP * rate
        hood += STEP * hood_rate
        if rate < 0.0 and head < hood - 1e-3:
            break
    times = STEP * np.arange(len(forces))
    pushed = np.flatnonzero(np.array(forces) > 0.0)
    end = float(times[pushed[-1]])

    def force(time: Array) -> Array:
        return np.interp(time, times, forces, left=0.0, right=0.0)

    return Impact(force, mass, end, -rate)
