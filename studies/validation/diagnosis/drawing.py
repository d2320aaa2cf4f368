"""Hidden effects of a set of tests, drawn from a seed unknown to the diagnosis."""

from collections.abc import Callable

import numpy as np

from studies.validation.diagnosis.hidden_effects import Hidden

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


# Sizes from about the minimum detectable effect to some ten times that.
CATALOGUE: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "catalogue", clearance=(0.028, 0.040), stiffness=(4e4, 4e5)),
        _one("hood_bottoming", "quadratic", clearance=(0.026, 0.038), stiffness=(4e4, 4e5)),
    ],
    "hood_yield": [
        _one("hood_yield", "catalogue", force=(2500.0, 3400.0), remaining=(0.1, 0.6)),
    ],
    "rate_dependent_hood": [
        _one("rate_dependent_hood", "dashpot", damping=(2.0, 25.0)),
        _one("rate_dependent_hood", "relative", per_speed=(0.0008, 0.012)),
        _one("rate_dependent_hood", "power", share=(0.008, 0.1), exponent=(0.25, 0.4)),
    ],
    "unloading_slope": [_factor("unloading_slope", 0.02, 0.25)],
    "sensor_gain": [_factor("sensor_gain", 0.006, 0.06)],
    "sensor_offset": [
        lambda rng: Hidden(
            "sensor_offset", "catalogue", {"offset": _sign(rng) * _between(rng, 0.3, 4.0)}
        )
    ],
    "sensor_saturation": [_one("sensor_saturation", "catalogue", limit=(110.0, 165.0))],
    "sensor_filter": [_one("sensor_filter", "catalogue", channel_class=(250.0, 900.0))],
    "time_scale": [_factor("time_scale", 0.005, 0.05)],
    "speed_bias": [_factor("speed_bias", 0.006, 0.05)],
    "mass_error": [_factor("mass_error", 0.005, 0.06)],
}
OTHER_FORMS: dict[str, list[Draw]] = {
    "hood_bottoming": [
        _one("hood_bottoming", "hertz", clearance=(0.026, 0.038), stiffness=(1e5, 6e5)),
    ],
    "hood_yield": [_one("hood_yield", "smooth", force=(2400.0, 3300.0), remaining=(0.1, 0.6))],
    "rate_dependent_hood": [_one("rate_dependent_hood", "logarithmic", share=(0.004, 0.04))],
    "sensor_saturation": [_one("sensor_saturation", "soft", limit=(250.0, 700.0))],
}
OUTSIDE: list[Draw] = [
    _one("ageing", "", loss=(0.001, 0.008)),
    _one("ringing", "", share=(0.01, 0.08), length=(0.008, 0.02)),
    _one("cable", "", size=(0.4, 3.0)),
]
KINDS = ("none", "catalogue", "other form", "outside", "pair")


def draw(seed: int, kind: str) -> list[Hidden]:
    """Return the hidden effects of the set of a seed."""
    rng = np.random.default_rng([seed, 77])
    if kind == "none":
        return []
    if kind == "outside":
        return [OUTSIDE[rng.integers(len(OUTSIDE))](rng)]
    table = OTHER_FORMS if kind == "other form" else CATALOGUE
    names = rng.permutation(sorted(table))[: 2 if kind == "pair" else 1]
    return [table[name][rng.integers(len(table[name]))](rng) for name in names]
