"""Published risk functions, read from a data file."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcstudy.injury.forms import FORMS
from mcstudy.injury.scaling import tolerance_factor

Array = NDArray[np.float64]

HIGHEST_LEVEL = 6


@dataclass(frozen=True)
class Level:
    """Parameters of one AIS level, and their source label: found, recalled or estimated."""

    parameters: tuple[float, ...]
    label: str


@dataclass(frozen=True)
class RiskFunction:
    """A published risk function; attributes as in ``data/risk_functions.toml``."""

    name: str
    title: str
    injury: str
    stimulus: str
    unit: str
    form: str
    scaling: str
    source: str
    levels: Mapping[int, Level]

    def risk(self, level: int, stimulus: Array | float, age: Array | float = 40.0) -> Array:
        """Return the probability of an injury of this AIS level or worse.

        Parameters
        ----------
        level : int
            AIS level that the function has.
        stimulus : (n,) array
            In the function's unit; NaN gives NaN.
        age : (n,) array
            Years; the function's scaling transfers the adult's tolerance to this age.

        Raises
        ------
        ValueError
            If the function has no such level.
        """
        if level not in self.levels:
            known = ", ".join(map(str, self.levels))
            raise ValueError(f"risk function {self.name!r} has no AIS{level}+, only {known}")
        scaled = np.asarray(stimulus, dtype=float) / tolerance_factor(self.scaling, age)
        return FORMS[self.form](scaled, *self.levels[level].parameters)

    @property
    def label(self) -> str:
        """The weakest label of its levels."""
        labels = {level.label for level in self.levels.values()}
        return next(word for word in ("estimated", "recalled", "found") if word in labels)


@cache
def risk_functions() -> Mapping[str, RiskFunction]:
    """Return all published risk functions by name."""
    return {entry["name"]: _read(entry) for entry in _table("risk_functions.toml")["function"]}


def risk_function(name: str) -> RiskFunction:
    """Return a published risk function.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    known = risk_functions()
    if name not in known:
        raise ValueError(f"no risk function {name!r}; there are {', '.join(known)}")
    return known[name]


@dataclass(frozen=True)
class SpeedCurve:
    """Published risk of pedestrians against impact speed in km/h."""

    name: str
    title: str
    form: str
    parameters: tuple[float, ...]
    label: str
    source: str

    def risk(self, speed: Array) -> Array:
        """Return the risk at speeds in km/h; NaN beyond published points."""
        if self.form == "points":
            x, y = self.parameters[::2], self.parameters[1::2]
            return np.asarray(np.interp(speed, x, y, left=np.nan, right=np.nan))
        return FORMS[self.form](np.asarray(speed, dtype=float), *self.parameters)


@cache
def speed_curves() -> tuple[SpeedCurve, ...]:
    """Return the published curves of risk against impact speed."""
    return tuple(
        SpeedCurve(**entry | {"parameters": tuple(entry["parameters"])})
        for entry in _table("speed_curves.toml")["curve"]
    )


def _table(name: str) -> dict[str, Any]:
    text = files("mcstudy.injury").joinpath("data", name).read_text(encoding="utf-8")
    return tomllib.loads(text)


def _read(entry: Mapping[str, Any]) -> RiskFunction:
    levels = {
        int(key): Level(tuple(map(float, row["parameters"])), row["label"])
        for key, row in entry["levels"].items()
    }
    return RiskFunction(**{**entry, "levels": levels})
