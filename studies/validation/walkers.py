"""The pedestrians of the validation: a child and an adult, on a straight braking car's middle."""

import math

import numpy as np

from models.pedestrian.growth import parameters

CENTRAL = {"yaw_rate": 0.0, "lateral_offset": 0.0}
"""Struck by the middle of a car that goes straight: what regressions and tests are about."""
CHILD: dict[str, float] = {}
"""The case's child: all nominal."""
ADULT = {"age": 30.0, "stature": 1.74, "body_mass": 75.7, "head_mass": 4.54, "running_speed": 1.4}
"""50th percentile male, walking [recalled: MADYMO human models; head Hybrid III]."""
SIDES = (0.5 * math.pi, -0.5 * math.pi)
"""Facing angles: crossing from the right and from the left."""


def child_of_stature(stature: float) -> dict[str, float]:
    """Return the inputs of the boy whose age makes a stature (m) the median one."""
    ages = np.linspace(3.1, 12.0, 179)
    medians = np.array([parameters("stature", age)[1] for age in ages])
    age = float(np.interp(stature, medians, ages))
    return {"age": age, "stature": stature, "body_mass": parameters("body_mass", age)[1]}
