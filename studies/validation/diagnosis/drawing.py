"""Hidden effects of a set of tests, drawn from a seed unknown to the diagnosis.

Own forms are those that the catalogue has; foreign forms are other functions of the same cause.
Sizes reach from about half the smallest visible one to more than ten times it.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from studies.validation.diagnosis.laboratory import Hidden

Draw = Callable[[np.random.Generator], Hidden]
Range = tuple[float, float]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _drawn(
    name: str,
    form: str,
    signed: tuple[str, ...],
    ranges: dict[str, Range],
    rng: np.random.Generator,
) -> Hidden:
    numbers = {key: _between(rng, *limits) for key, limits in ranges.items()}
    for key in signed:
        numbers[key] *= float(rng.choice([-1.0, 1.0]))
    if "excess" in numbers:
        numbers["factor"] = 1.0 + numbers.pop("excess")
    return Hidden(name, form, numbers)


def _one(name: str, form: str, *signed: str, **ranges: Range) -> Draw:
    """Return the draw of a form; numbers that are ``signed`` have a random sign."""
    return partial(_drawn, name, form, signed, ranges)


def _factor(name: str, low: float, high: float) -> Draw:
    return _one(name, "catalogue", "excess", excess=(low, high))


CATALOGUE: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "catalogue", clearance=(0.028, 0.040), stiffness=(4e4, 4e5)),
        _one("hood_bottoming", "quadratic", clearance=(0.026, 0.038), stiffness=(4e4, 4e5)),
    ],
    "hood_yield": [
        _one("hood_yield", "catalogue", force=(2500.0, 3400.0), remaining=(0.1, 0.6)),
    ],
    "rate_dependent_hood": [
        _one("rate_dependent_hood", "dashpot", damping=(2.0, 80.0)),
        _one("rate_dependent_hood", "relative", per_speed=(0.0008, 0.03)),
        _one("rate_dependent_hood", "power", share=(0.008, 0.25), exponent=(0.25, 0.4)),
    ],
    "hood_inertia": [
        _one("hood_inertia", "catalogue", mass=(0.01, 0.6), depth=(0.006, 0.012)),
    ],
    "skin_compliance": [
        _one("skin_compliance", "catalogue", compliance=(2e-8, 8e-7)),
    ],
    "unloading_slope": [_factor("unloading_slope", 0.02, 0.4)],
    "guide_friction": [
        _one("guide_friction", "catalogue", force=(4.0, 80.0)),
        _one("guide_friction", "greased", force=(4.0, 80.0)),
    ],
    "hood_force_scale": [_factor("hood_force_scale", 0.1, 0.4)],
    "sensor_gain": [_factor("sensor_gain", 0.006, 0.15)],
    "sensor_offset": [_one("sensor_offset", "catalogue", "offset", offset=(0.3, 6.0))],
    "sensor_saturation": [_one("sensor_saturation", "catalogue", limit=(80.0, 165.0))],
    "sensor_filter": [_one("sensor_filter", "catalogue", channel_class=(100.0, 900.0))],
    "time_scale": [_factor("time_scale", 0.005, 0.1)],
    "speed_bias": [
        _factor("speed_bias", 0.006, 0.12),
        _one("speed_bias", "offset", "offset", offset=(0.08, 0.8)),
    ],
    "mass_error": [_factor("mass_error", 0.005, 0.23)],
}
FOREIGN: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "hertz", clearance=(0.026, 0.038), stiffness=(1e5, 6e5)),
        _one("hood_bottoming", "soft_start", clearance=(0.024, 0.036), stiffness=(6e4, 6e5),
             layer=(0.003, 0.01)),
        _one("hood_bottoming", "hardening", clearance=(0.024, 0.036), stiffness=(4e4, 3e5)),
    ],
    "hood_yield": [_one("hood_yield", "smooth", force=(2400.0, 3300.0), remaining=(0.1, 0.6))],
    "rate_dependent_hood": [
        _one("rate_dependent_hood", "logarithmic", share=(0.004, 0.15)),
        _one("rate_dependent_hood", "ramped", damping=(8.0, 130.0), ramp=(0.004, 0.008)),
        _one("rate_dependent_hood", "fading", damping=(8.0, 130.0), end=(0.01, 0.03)),
        _one("rate_dependent_hood", "dry", force=(40.0, 400.0)),
    ],
    "hood_inertia": [
        _one("hood_inertia", "local_spring", mass=(0.03, 0.8), spring=(2e6, 4e6),
             loss=(0.05, 0.2)),
        _one("hood_inertia", "linear", mass=(0.02, 0.5), depth=(0.006, 0.015)),
    ],
    "skin_compliance": [_one("skin_compliance", "hertz", compliance=(2e-8, 8e-7))],
    "unloading_slope": [
        _one("unloading_slope", "curved", curvature=(1.2, 2.5)),
        _one("unloading_slope", "deep", "growth", growth=(0.15, 0.8)),
    ],
    "guide_friction": [_one("guide_friction", "stribeck", force=(4.0, 80.0))],
    "hood_force_scale": [_one("hood_force_scale", "ageing", loss=(0.02, 0.25))],
    "sensor_gain": [_one("sensor_gain", "warming", "change", change=(0.01, 0.12))],
    "sensor_offset": [_one("sensor_offset", "drifting", "offset", offset=(0.8, 8.0))],
    "sensor_saturation": [
        _one("sensor_saturation", "soft", limit=(180.0, 700.0)),
        _one("sensor_saturation", "recovery", limit=(90.0, 150.0), depth=(0.05, 0.3),
             time=(0.001, 0.005)),
    ],
    "sensor_filter": [
        _one("sensor_filter", "bessel", channel_class=(100.0, 700.0)),
        _one("sensor_filter", "steep", channel_class=(80.0, 500.0)),
        _one("sensor_filter", "forward", channel_class=(80.0, 500.0)),
    ],
    "speed_bias": [
        _one("speed_bias", "falling", height=(0.03, 0.4)),
        _one("speed_bias", "drifting", "change", change=(0.02, 0.12)),
    ],
}  # fmt: skip
OUTSIDE: list[Draw] = [
    _one("ringing", "", share=(0.02, 0.12), length=(0.008, 0.02)),
    _one("cable", "", size=(0.6, 4.0)),
    _one("rupture", "", depth=(0.015, 0.03), share=(0.05, 0.3)),
    _one("turning", "", rate=(8.0, 40.0)),
    _one("mount_resonance", "", frequency=(500.0, 900.0), damping_ratio=(0.05, 0.15)),
]
CRASHES: dict[str, list[Draw]] = {
    "none": [],
    "sensor_gain": [
        _factor("sensor_gain", 0.03, 0.15),
        _one("sensor_gain", "warming", "change", change=(0.05, 0.15)),
    ],
    "sensor_offset": [
        _one("sensor_offset", "catalogue", "offset", offset=(1.5, 6.0)),
        _one("sensor_offset", "drifting", "offset", offset=(3.0, 10.0)),
    ],
    "sensor_saturation": [
        _one("sensor_saturation", "catalogue", limit=(40.0, 80.0)),
        _one(
            "sensor_saturation",
            "recovery",
            limit=(40.0, 80.0),
            depth=(0.05, 0.3),
            time=(0.001, 0.005),
        ),
    ],
    "sensor_filter": [
        _one("sensor_filter", "catalogue", channel_class=(60.0, 250.0)),
        _one("sensor_filter", "bessel", channel_class=(60.0, 250.0)),
        _one("sensor_filter", "forward", channel_class=(60.0, 250.0)),
    ],
    "time_scale": [_factor("time_scale", 0.01, 0.06)],
    "speed_bias": [_factor("speed_bias", 0.02, 0.1)],
    "hood_bottoming": [
        _one("hood_bottoming", "hertz", clearance=(0.035, 0.05), stiffness=(3e5, 1.5e6)),
    ],
    "hood_yield": [
        _one("hood_yield", "catalogue", force=(1400.0, 2200.0), remaining=(0.1, 0.5)),
    ],
    "mass_error": [_factor("mass_error", 0.08, 0.3)],
    "brake_dive": [_one("brake_dive", "catalogue", "angle", angle=(0.008, 0.04))],
    # Muscles are tenser than relaxed ones: never a negative factor.
    "muscle_tone": [_one("muscle_tone", "catalogue", excess=(0.6, 2.5))],
    "friction_level": [_factor("friction_level", 0.1, 0.4)],
}
"""Effects of full-scale tests by the name of the cause; of the ten and more, those of the
instruments have foreign forms too."""
ACCIDENTS: dict[str, list[Draw]] = {
    "none": [],
    "wet_road": [_one("wet_road", "catalogue", place=(3.0, 9.0), factor=(0.35, 0.65))],
    "road_slope": [_one("road_slope", "catalogue", "angle", angle=(0.04, 0.1))],
    "late_braking": [_one("late_braking", "catalogue", delay=(0.3, 1.2))],
    "speed_bias": [_factor("speed_bias", 0.08, 0.25)],
    "friction_level": [_factor("friction_level", 0.12, 0.45)],
}
"""Effects of accident collections by the name of the cause."""
KINDS = ("none", "own form", "foreign form", "outside", "pair")


def draw_of(seed: int, cause: str, table: dict[str, list[Draw]]) -> list[Hidden]:
    """Return the hidden effect of a full-scale set or a collection.

    Parameters
    ----------
    seed : int
    cause : str
        A key of the table.
    table : dict
        ``CRASHES`` or ``ACCIDENTS``.
    """
    forms = table[cause]
    rng = np.random.default_rng([seed, 79])
    return [forms[seed % len(forms)](rng)] if forms else []


def draw(seed: int, kind: str) -> list[Hidden]:
    """Return the hidden effects of the set of a seed."""
    rng = np.random.default_rng([seed, 77])
    if kind == "none":
        return []
    if kind == "outside":
        return [OUTSIDE[rng.integers(len(OUTSIDE))](rng)]
    table = FOREIGN if kind == "foreign form" else CATALOGUE
    names = rng.permutation(sorted(table))[: 2 if kind == "pair" else 1]
    return [table[name][rng.integers(len(table[name]))](rng) for name in names]
