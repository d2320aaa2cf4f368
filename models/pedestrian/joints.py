"""Joint resistance of a pedestrian, scaled from the 7-year-old reference."""

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import data
from models.pedestrian.anthropometry import SEGMENTS, Body, region_of
from models.pedestrian.scaling import scale_between
from models.rotation import axis_rotation, multiply

Array = NDArray[np.float64]

NECK_JOINTS = ("neck", "head")
TWIST_FRICTION = 0.1
"""Friction about the twist axis over that about the others: a limb's weight, for which the bound is
set, has no lever about its own length (assumed)."""


class Joints(NamedTuple):
    """Joint data of ``n`` segments (row 0, the root, is not used).

    Attributes
    ----------
    centre : (n, 4) array
        Quaternion of the child relative to its parent at the centre of the range.
    half_range : (n, 3) array
        Half width of the range, rad.
    neutral : (n, 3) array
        Rotation from the centre at which the passive stiffness has no torque, rad.
    stiffness_low, stiffness_high : (n, 3) array
        Passive stiffness on either side of the neutral value, N m/rad.
    stop_low, stop_high : (n, 3) array
        Stiffness beyond the range, N m/rad.
    damping : (n, 3) array
        N m s/rad.
    friction : (n,) array
        N m.
    onset : (n,) array
        Rotation over which the stops taper in, rad.
    yields : (n,) array of bool
        Whether the joint's two points can separate.
    give_low, give_high : (n, 3) array
        Stiffness against separation in either direction of the parent's axes, N/m.
    give_damping : (n, 3) array
        N s/m.
    give_range : (n,) array
        Separation in either direction beyond which the stiffness is higher, m.
    """

    centre: Array
    half_range: Array
    neutral: Array
    stiffness_low: Array
    stiffness_high: Array
    stop_low: Array
    stop_high: Array
    damping: Array
    friction: Array
    onset: Array
    yields: NDArray[np.bool_]
    give_low: Array
    give_high: Array
    give_damping: Array
    give_range: Array


def build_joints(
    body: Body,
    *,
    neck_stiffness: float = 1.0,
    muscle_tone: float = 1.0,
    neck_tension_stiffness: float = 1.0,
    shoulder_stiffness: float = 1.0,
) -> Joints:
    """Return the resistance of the 14 joints of a body.

    Parameters
    ----------
    body : Body
    neck_stiffness : float
        Factor on passive stiffness, stops and damping of the two neck joints.
    muscle_tone : float
        Factor on joint friction; 1 is the setting in which a joint just holds its limb.
    neck_tension_stiffness : float
        Factor on the tensile stiffness of the neck.
    shoulder_stiffness : float
        Factor on the stiffness of the shoulder girdle; its damping scales with the square root.
    """
    reference = data.load("pedestrians/segments.toml")["child_7y"]
    scale = scale_between(body.stature, body.age, reference["stature"], reference["age"])
    base = _reference_joints()
    factor = np.where(_NECK_ROWS, neck_stiffness, 1.0)[:, None]
    moment = scale.moment * factor
    # Friction holds the limb's weight: it scales with mass times length, not with tissue.
    weight = body.body_mass * body.stature / (reference["body_mass"] * reference["stature"])
    joints = base._replace(
        stiffness_low=base.stiffness_low * moment,
        stiffness_high=base.stiffness_high * moment,
        stop_low=base.stop_low * moment,
        stop_high=base.stop_high * moment,
        damping=base.damping * scale.rotational_damping * factor,
        friction=base.friction * weight * muscle_tone,
        give_low=base.give_low * scale.stiffness,
        give_high=base.give_high * scale.stiffness,
        give_damping=base.give_damping * scale.damping,
        give_range=base.give_range * scale.length,
    )
    joints.give_high[SEGMENTS.index("head"), 2] *= neck_tension_stiffness
    for i in (SEGMENTS.index("upper_arm_left"), SEGMENTS.index("upper_arm_right")):
        joints.give_low[i] *= shoulder_stiffness
        joints.give_high[i] *= shoulder_stiffness
        joints.give_damping[i] *= np.sqrt(shoulder_stiffness)
    return joints


_NECK_ROWS = np.array([region_of(segment) in NECK_JOINTS for segment in SEGMENTS])


@functools.cache
def _reference_joints() -> Joints:
    """Return the joints of the 7-year-old from the data file."""
    table = data.load("pedestrians/joints.toml")
    n = len(SEGMENTS)
    joints = Joints(
        centre=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        half_range=np.full((n, 3), np.pi),
        neutral=np.zeros((n, 3)),
        stiffness_low=np.zeros((n, 3)),
        stiffness_high=np.zeros((n, 3)),
        stop_low=np.zeros((n, 3)),
        stop_high=np.zeros((n, 3)),
        damping=np.zeros((n, 3)),
        friction=np.zeros(n),
        onset=np.full(n, np.radians(table["stop_onset"])),
        yields=np.zeros(n, dtype=np.bool_),
        give_low=np.zeros((n, 3)),
        give_high=np.zeros((n, 3)),
        give_damping=np.zeros((n, 3)),
        give_range=np.full(n, np.inf),
    )
    for i, segment in enumerate(SEGMENTS):
        if i == 0:
            continue
        row, right = table["joints"][region_of(segment)], segment.endswith("_right")
        middle = np.zeros(3)
        for k, axis in enumerate("xyz"):
            low, high = row["range"][axis]
            stiff = row["stiffness"][axis]
            stop = row["stop"][axis]
            if right and axis != "y":
                low, high = -high, -low
                stiff, stop = stiff[::-1], stop[::-1]
            middle[k] = np.radians(0.5 * (low + high))
            joints.half_range[i, k] = np.radians(0.5 * (high - low))
            joints.neutral[i, k] = -middle[k]
            joints.stiffness_low[i, k], joints.stiffness_high[i, k] = stiff
            joints.stop_low[i, k], joints.stop_high[i, k] = stop
        joints.centre[i] = multiply(
            axis_rotation(0, middle[0]),
            multiply(axis_rotation(1, middle[1]), axis_rotation(2, middle[2])),
        )
        joints.damping[i] = row["damping"]
        joints.friction[i] = row["friction"]
        if "give" in row:
            _let_yield(joints, i, row["give"], mirrored=right)
    return joints


def _let_yield(joints: Joints, i: int, row: dict[str, Any], *, mirrored: bool) -> None:
    """Set the springs and dampers of a joint that yields from its table."""
    joints.yields[i] = True
    for k, axis in enumerate("xyz"):
        low, high = row["stiffness"][axis]
        if mirrored and axis == "y":
            low, high = high, low
        joints.give_low[i, k], joints.give_high[i, k] = low, high
    joints.give_damping[i] = row["damping"]
    joints.give_range[i] = row["range"]


def joints_of(joints: Joints, rows: list[int]) -> Joints:
    """Return the joints of some segments, in the order of ``rows``."""
    chosen = {name: np.ascontiguousarray(array[rows]) for name, array in joints._asdict().items()}
    return Joints(**chosen)


def elastic_energy(joints: Joints, joint: int, vector: Array) -> Array:
    """Return the elastic energy of a joint at rotation vectors.

    It contains the passive stiffness about the neutral values, and stops that taper in beyond the
    range; the resulting torque is in ``models.multibody.joints``.

    Parameters
    ----------
    joints : Joints
    joint : int
        Row of the joint.
    vector : (k, 3) array
        Rotation vectors of the child from the centre of its range, rad.

    Returns
    -------
    (k,) array
        J.
    """
    rest = vector - joints.neutral[joint]
    stiffness = np.where(rest > 0.0, joints.stiffness_high[joint], joints.stiffness_low[joint])
    excess = np.maximum(np.abs(vector) - joints.half_range[joint], 0.0)
    stop = np.where(vector > 0.0, joints.stop_high[joint], joints.stop_low[joint])
    onset = joints.onset[joint]
    beyond = np.maximum(excess - onset, 0.0)
    inside = np.minimum(excess, onset)
    depth = inside**3 / (6.0 * onset) + 0.5 * beyond * (beyond + onset)
    return np.asarray((0.5 * stiffness * rest**2 + stop * depth).sum(axis=1))
