"""How a set of headform tests was made, and what is hidden in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

GRAVITY = 9.80665
"""m/s^2 (BIPM, SI Brochure, the standard value)."""

Knots = tuple[tuple[float, float], ...]

CURVE: Knots = ((0.0, 0.0), (0.015, 2600.0), (0.055, 3600.0), (0.1, 5200.0))
"""The hood's loading curve, m and N."""
CURVES: tuple[Knots, ...] = (
    CURVE,
    ((0.0, 0.0), (0.01, 1500.0), (0.03, 3400.0), (0.1, 6000.0)),
    ((0.0, 0.0), (0.02, 2400.0), (0.1, 5600.0)),
)
"""Hoods: with a plateau, soft at first, nearly straight."""
HEADFORMS = (2.5, 3.5, 4.5)
"""Masses (kg) of headforms: child of EEVC WG17 and GTR 9, adult of GTR 9."""


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
    repeats : int
        How many of them are at the middle speed, the others at speeds of their own.
    slowest, fastest : float
        Impact speeds, m/s.
    mass : float
        Headform mass, kg.
    ratio : float
        Unloading slope of the hood over its secant slope.
    curve : sequence of pairs
        The hood's loading curve, m and N.
    rate : float
        Sampling rate, Hz.
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
    rising : bool
        Whether the speed rises from test to test.
    """

    tests: int = 18
    repeats: int = 0
    slowest: float = 5.0
    fastest: float = 10.0
    mass: float = 2.5
    ratio: float = 7.0
    curve: Knots = CURVE
    rate: float = 20_000.0
    speed_sd: float = 0.05
    noise_sd: float = 1.0
    force_sd: float = 20.0
    rebound_sd: float = 0.02
    scatter: float = 0.01
    scale_sd: float = 0.06
    force: bool = False
    rebound: bool = False
    rising: bool = False


def draw_laboratory(rng: np.random.Generator, *, force: bool) -> Laboratory:
    """Return a laboratory other than the usual one.

    Parameters
    ----------
    rng : Generator
    force : bool
        Whether a load cell and a rebound speed are recorded.
    """
    tests = int(rng.integers(6, 41))
    mass = float(rng.choice(HEADFORMS))
    return Laboratory(
        tests=tests,
        repeats=int(rng.choice([0, tests // 3])),
        slowest=float(rng.uniform(3.0, 6.0)),
        fastest=float(rng.uniform(8.5, 11.0)),
        mass=mass,
        ratio=float(rng.uniform(4.0, 9.0)),
        curve=CURVES[rng.integers(len(CURVES))],
        rate=float(rng.choice([10_000.0, 20_000.0, 50_000.0])),
        speed_sd=float(rng.uniform(0.02, 0.1)),
        noise_sd=float(np.exp(rng.uniform(np.log(0.4), np.log(2.0)))),
        scatter=float(np.exp(rng.uniform(np.log(0.004), np.log(0.02)))),
        scale_sd=float(rng.uniform(0.04, 0.15)),
        force=force,
        rebound=force,
        rising=bool(rng.random() < 0.25),
    )
