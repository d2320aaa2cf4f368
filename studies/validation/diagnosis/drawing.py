"""What is hidden in a set of tests, drawn from a seed that the finder never sees."""

from collections.abc import Callable

import numpy as np

from studies.validation.diagnosis.hidden_effects import Hidden, Laboratory

Draw = Callable[[np.random.Generator], Hidden]


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _factor(name: str, low: float, high: float) -> Draw:
    return lambda rng: Hidden(
        name, "catalogue", {"factor": 1.0 + _sign(rng) * _between(rng, low, high)}
    )


def _one(name: str, form: str, **ranges: tuple[float, float]) -> Draw:
    return lambda rng: Hidden(
        name, form, {key: _between(rng, *limits) for key, limits in ranges.items()}
    )


# Sizes from what can hardly be seen to what nobody would miss.
CATALOGUE: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "catalogue", clearance=(0.02, 0.038), stiffness=(1e5, 6e5)),
        _one("hood_bottoming", "quadratic", clearance=(0.018, 0.034), stiffness=(1e5, 6e5)),
    ],
    "hood_yield": [
        _one("hood_yield", "catalogue", force=(1800.0, 3200.0), remaining=(0.02, 0.4)),
    ],
    "rate_dependent_hood": [
        _one("rate_dependent_hood", "dashpot", damping=(3.0, 80.0)),
        _one("rate_dependent_hood", "relative", per_speed=(0.002, 0.04)),
        _one("rate_dependent_hood", "power", share=(0.02, 0.3), exponent=(0.25, 0.4)),
    ],
    "unloading_slope": [_factor("unloading_slope", 0.05, 0.4)],
    "sensor_gain": [_factor("sensor_gain", 0.004, 0.06)],
    "sensor_offset": [
        lambda rng: Hidden(
            "sensor_offset", "catalogue", {"offset": _sign(rng) * _between(rng, 0.3, 4.0)}
        )
    ],
    "sensor_saturation": [_one("sensor_saturation", "catalogue", limit=(90.0, 160.0))],
    "sensor_filter": [_one("sensor_filter", "catalogue", channel_class=(90.0, 600.0))],
    "time_scale": [_factor("time_scale", 0.002, 0.04)],
    "speed_bias": [_factor("speed_bias", 0.005, 0.05)],
    "mass_error": [_factor("mass_error", 0.005, 0.06)],
}
OTHER_FORMS: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "hertz", clearance=(0.02, 0.034), stiffness=(3e5, 9e5)),
    ],
    "hood_yield": [_one("hood_yield", "smooth", force=(1800.0, 2800.0), remaining=(0.02, 0.3))],
    "rate_dependent_hood": [_one("rate_dependent_hood", "logarithmic", share=(0.02, 0.12))],
    "sensor_saturation": [_one("sensor_saturation", "soft", limit=(150.0, 400.0))],
}
OUTSIDE: list[Draw] = [
    _one("ageing", "", loss=(0.003, 0.02)),
    _one("ringing", "", share=(0.03, 0.2), length=(0.008, 0.02)),
    _one("cable", "", size=(1.0, 8.0)),
]
KINDS = ("none", "catalogue", "other form", "outside", "pair")


def draw(seed: int, kind: str, laboratory: Laboratory | None = None) -> list[Hidden]:
    """Return what is hidden in the set of a seed."""
    rng = np.random.default_rng([seed, 77])
    if kind == "none":
        return []
    if kind == "outside":
        return [OUTSIDE[rng.integers(len(OUTSIDE))](rng)]
    table = OTHER_FORMS if kind == "other form" else CATALOGUE
    names = rng.permutation(sorted(table))[: 2 if kind == "pair" else 1]
    return [table[name][rng.integers(len(table[name]))](rng) for name in names]
