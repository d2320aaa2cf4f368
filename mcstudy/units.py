"""Units of study files and their conversion to the models' units on input."""

import math

_UNITS: dict[str, tuple[str, float]] = {
    "1": ("ratio", 1.0),
    "%": ("ratio", 0.01),
    "m": ("length", 1.0),
    "cm": ("length", 0.01),
    "mm": ("length", 0.001),
    "kg": ("mass", 1.0),
    "g_mass": ("mass", 0.001),
    "s": ("time", 1.0),
    "ms": ("time", 0.001),
    "year": ("age", 1.0),
    "month": ("age", 1.0 / 12.0),
    "m/s": ("speed", 1.0),
    "km/h": ("speed", 1.0 / 3.6),
    "mph": ("speed", 0.44704),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
    "rad/s": ("angular speed", 1.0),
    "deg/s": ("angular speed", math.pi / 180.0),
    "rad/s2": ("angular acceleration", 1.0),
    "g": ("acceleration in g", 1.0),
    "m/s2": ("acceleration in g", 1.0 / 9.80665),
    "N": ("force", 1.0),
    "kN": ("force", 1000.0),
    "J": ("energy", 1.0),
    "N s/m": ("damping", 1.0),
    "N/m": ("stiffness", 1.0),
    "m/N": ("compliance", 1.0),
}
_SPELLINGS = {
    "-": "1", "percent": "%", "kph": "km/h", "kmh": "km/h", "km/hr": "km/h",
    "degree": "deg", "degrees": "deg", "°": "deg", "radian": "rad", "years": "year",
    "months": "month", "deg/sec": "deg/s", "m/sec": "m/s", "sec": "s",
    "m/(s*s)": "m/s2", "m/s^2": "m/s2", "m/s²": "m/s2", "m/s/s": "m/s2", "m/s**2": "m/s2",
    "rad/(s*s)": "rad/s2", "rad/s^2": "rad/s2", "rad/s²": "rad/s2", "rad/s**2": "rad/s2",
    "ns/m": "N s/m", "n*s/m": "N s/m",
}  # fmt: skip
"""Other ways to write a unit, in lower case."""
_LOWER = {name.lower(): name for name in _UNITS}


def canonical(name: str) -> str:
    """Return the canonical name of a unit in any case or spelling; unknown units unchanged.

    No two units here differ in case alone.
    """
    lower = " ".join(name.split()).lower()
    return name if name in _UNITS else _LOWER.get(lower, _SPELLINGS.get(lower, name))


def unit_names() -> tuple[str, ...]:
    """Return the units that a study file may use."""
    return tuple(_UNITS)


def factor(unit: str, target: str) -> float:
    """Return the factor that converts a value from ``unit`` to ``target``.

    Raises
    ------
    ValueError
        If a unit is unknown or the two measure different things.
    """
    unit, target = canonical(unit), canonical(target)
    for name in (unit, target):
        if name not in _UNITS:
            raise ValueError(f"unknown unit {name!r}: use one of {', '.join(_UNITS)}")
    (dimension, size), (wanted, target_size) = _UNITS[unit], _UNITS[target]
    if dimension != wanted:
        raise ValueError(f"unit {unit!r} measures {dimension}, but {wanted} ({target!r}) is needed")
    return size / target_size
