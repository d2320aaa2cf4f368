"""Fifteen segments of a pedestrian, scaled from age, stature and mass.

Proportions (mass shares, semi-axes and joint heights over stature) are interpolated in age between
the reference bodies of ``data/pedestrians/segments.toml`` and held constant outside them. Lengths
are proportional to stature, the two transverse semi-axes to sqrt(mass / stature), so that density
stays near that of the reference. A given head mass changes the head alone, and the rest of the body
is scaled to keep the total.
"""

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models import data

Array = NDArray[np.float64]

SEGMENTS = (
    "hip",
    "abdomen",
    "chest",
    "neck",
    "head",
    "upper_arm_left",
    "forearm_left",
    "upper_arm_right",
    "forearm_right",
    "thigh_left",
    "shank_left",
    "foot_left",
    "thigh_right",
    "shank_right",
    "foot_right",
)
PARENTS = (-1, 0, 1, 2, 3, 2, 5, 2, 7, 0, 9, 10, 0, 12, 13)
HEAD = SEGMENTS.index("head")
LARGEST_HEAD_SHARE = 0.5
"""Share of the body's mass beyond which a head is refused (assumed; a newborn's is about 0.3)."""
BODY_MASS_INDEX = (8.0, 80.0)
"""kg/m2, possible range (assumed; starved adults reach about 10, the heaviest about 75)."""
HEAD_INERTIA_FACTOR = 1.15
"""A skull carries its mass further out than a homogeneous ellipsoid: the data sheet allows 15 %
more for the head [estimated]."""
TRUNK = tuple(SEGMENTS.index(name) for name in ("hip", "abdomen", "chest"))


def region_of(segment: str) -> str:
    """Return the body region of a segment: its name without the side."""
    return segment.removesuffix("_left").removesuffix("_right")


def is_possible(stature: float, body_mass: float, head_mass: float) -> bool:
    """Return whether a body of these dimensions can exist.

    Parameters
    ----------
    stature : float
        m.
    body_mass, head_mass : float
        kg.
    """
    low, high = BODY_MASS_INDEX
    return head_mass < LARGEST_HEAD_SHARE * body_mass and low <= body_mass / stature**2 <= high


@dataclass(frozen=True)
class Body:
    """A standing pedestrian; rows follow ``SEGMENTS``, positions from the soles' midpoint.

    Attributes
    ----------
    age : float
        Years.
    stature : float
        m.
    body_mass : float
        kg.
    mass : (15,) array
        kg.
    inertia : (15, 3) array
        Principal moments about the centre of mass, kg m2.
    semi_axes : (15, 3) array
        m.
    centre : (15, 3) array
        Centres of mass, m.
    ellipsoid : (15, 3) array
        Centres of the ellipsoids, m.
    joint : (15, 3) array
        Joints to the parents, m.
    """

    age: float
    stature: float
    body_mass: float
    mass: Array
    inertia: Array
    semi_axes: Array
    centre: Array
    ellipsoid: Array
    joint: Array


@dataclass(frozen=True)
class _Proportions:
    age: float
    mass: Array  # share of body mass
    semi_axes: Array  # over _axis_scale
    centre: Array
    ellipsoid: Array
    joint: Array


def _axis_scale(stature: float, body_mass: float) -> Array:
    """Return the scale of the semi-axes: stature along a segment, build across it."""
    scale = np.empty((len(SEGMENTS), 3))
    scale[:, :2] = np.sqrt(body_mass / stature)
    scale[:, 2] = stature
    # The skull is bone: its breadth follows stature, not build.
    scale[HEAD] = stature
    return scale


@functools.cache
def _reference(name: str) -> _Proportions:
    entry = data.load("pedestrians/segments.toml")[name]
    stature, body_mass = entry["stature"], entry["body_mass"]
    mass, semi, centre, ellipsoid, joint = [], [], [], [], []
    for segment in SEGMENTS:
        row = entry["segments"][region_of(segment)]
        mirror = np.array([1.0, -1.0 if segment.endswith("_right") else 1.0, 1.0])
        mass.append(row["mass"])
        semi.append(row["semi_axes"])
        centre.append(row["centre"] * mirror)
        ellipsoid.append(row.get("ellipsoid", row["centre"]) * mirror)
        joint.append(row["joint"] * mirror)
    shares = np.array(mass)
    axes = np.array(semi) / _axis_scale(stature, body_mass)
    return _Proportions(
        age=entry["age"],
        mass=shares / shares.sum(),
        semi_axes=axes,
        centre=np.array(centre) / stature,
        ellipsoid=np.array(ellipsoid) / stature,
        joint=np.array(joint) / stature,
    )


def build_body(
    age: float, stature: float, body_mass: float, head_mass: float | None = None
) -> Body:
    """Return the segments of a pedestrian.

    Parameters
    ----------
    age : float
        Years; selects the proportions, from the 7-year-old's to the adult's.
    stature, body_mass : float
        m and kg.
    head_mass : float, optional
        kg; by default the share of the body mass at that age.

    Raises
    ------
    ValueError
        If a value is not positive or the head is heavier than half of the body.
    """
    if not (age > 0.0 and stature > 0.0 and body_mass > 0.0):
        raise ValueError(
            f"age, stature and body mass must be positive: {age}, {stature}, {body_mass}"
        )
    child, adult = _reference("child_7y"), _reference("adult_male")
    share = min(max((age - child.age) / (adult.age - child.age), 0.0), 1.0)

    def between(a: Array, b: Array) -> Array:
        return (1.0 - share) * a + share * b

    mass = between(child.mass, adult.mass) * body_mass
    if head_mass is not None:
        if not 0.0 < head_mass < LARGEST_HEAD_SHARE * body_mass:
            raise ValueError(f"head mass {head_mass:g} kg does not fit a body of {body_mass:g} kg")
        mass *= (body_mass - head_mass) / (body_mass - mass[HEAD])
        mass[HEAD] = head_mass
    axes = between(child.semi_axes, adult.semi_axes) * _axis_scale(stature, body_mass)
    squares = axes**2
    inertia = mass[:, None] / 5.0 * (squares.sum(axis=1, keepdims=True) - squares)
    inertia[HEAD] *= HEAD_INERTIA_FACTOR
    return Body(
        age=age,
        stature=stature,
        body_mass=body_mass,
        mass=mass,
        inertia=inertia,
        semi_axes=axes,
        centre=between(child.centre, adult.centre) * stature,
        ellipsoid=between(child.ellipsoid, adult.ellipsoid) * stature,
        joint=between(child.joint, adult.joint) * stature,
    )
