"""Tests of a model that is linear in everything: what a diagnosis gives can be had by hand."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcstudy.diagnosis.problem import (
    Cause,
    Form,
    Observation,
    Parameter,
    Problem,
    Signal,
    Test,
    Unknown,
)
from mcstudy.studyfile.distributions import Normal
from mcstudy.studyfile.input_space import InputSpace

Array = NDArray[np.float64]

TIME = np.linspace(-0.004, 0.02, 121)
RANGES = {"impact_speed": (0.0, 100.0), "scale": (-100.0, 100.0)}


def normal(name: str) -> InputSpace:
    """Prior of a standard normal: a value that is its own score."""
    return InputSpace({name: Normal(distribution="normal", mean=0.0, sd=1.0)}, {name: "1"})


def pulse(time: Array) -> Array:
    """A smooth pulse from 0 to 15 ms, one high."""
    inside = (time > 0.0) & (time < 0.015)
    return np.where(inside, np.sin(np.pi * time / 0.015) ** 2, 0.0)


@dataclass(frozen=True)
class Linear:
    """Signal: (10 speed + 3 scale) pulse + bump's size times a narrow pulse late in it."""

    def __call__(
        self, inputs: Mapping[str, float], effects: Mapping[str, Mapping[str, float]]
    ) -> Observation | None:
        # Wider than the measurement and fine, so that interpolation loses nothing.
        time = np.linspace(-0.01, 0.03, 8001)
        values = (10.0 * inputs["impact_speed"] + 3.0 * inputs["scale"]) * pulse(time)
        if "bump" in effects:
            narrow = np.exp(-0.5 * ((time - 0.011) / 0.0008) ** 2)
            values = values + 6.0 * effects["bump"]["size"] * narrow * inputs["impact_speed"] / 8.0
        return Observation({"head_acceleration": (time, values)}, {})


SIZE = Parameter("size", "1", "", normal("size"), 0.0, "normal")
BUMP = Cause(
    "bump", "a bump", (Form("bump", "bump", {}, (SIZE,)),), "size", "late in the pulse", (), "no"
)


def make_problem(
    seed: int, *, tests: int = 12, bump: float = 0.0, noise: float = 1.0, speed_sd: float = 0.05
) -> Problem:
    """Return tests with noise, doubtful speeds and one shared scale, and perhaps a bump."""
    rng = np.random.default_rng(seed)
    scale = float(rng.standard_normal())
    rows = []
    for k in range(tests):
        speed = 5.0 + 5.0 * k / (tests - 1)
        effects = {"bump": {"size": bump}} if bump else {}
        seen = Linear()({"impact_speed": speed, "scale": scale}, effects)
        assert seen is not None
        values = np.interp(TIME, *seen.signals["head_acceleration"])
        level = 1.0 + 0.01 * rng.standard_normal()
        values = values * level + noise * rng.standard_normal(TIME.size)
        recorded = speed + speed_sd * rng.standard_normal()
        rows.append(
            Test(f"t{k}", {"impact_speed": recorded}, {"impact_speed": speed_sd},
                 (Signal("head_acceleration", TIME, values, noise),), (), (), {"order": float(k)})
        )  # fmt: skip
    return Problem(tuple(rows), (Unknown("scale", normal("scale")),), Linear(), RANGES)
