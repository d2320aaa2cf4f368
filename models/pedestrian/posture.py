"""Running posture: position and angular velocity of every segment at a phase of the gait."""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from models import data
from models.pedestrian.anthropometry import PARENTS, SEGMENTS, Body, region_of
from models.rotation import axis_rotation, matrix_of, multiply

Array = NDArray[np.float64]

# Sign of flexion about +y, which tilts the upper end of a segment forwards.
_FLEXION = {"thigh": -1.0, "shank": 1.0, "foot": -1.0, "upper_arm": -1.0, "forearm": -1.0}

_JOINT = {
    "thigh": "hip",
    "shank": "knee",
    "foot": "ankle",
    "upper_arm": "shoulder",
    "forearm": "elbow",
}


@dataclass(frozen=True)
class Posture:
    """Orientation and motion of the segments in world axes.

    Attributes
    ----------
    root_position, root_velocity : (3,) array
        Centre of mass of the hip segment, m and m/s; the lowest point of the body is on the road.
    orientation : (15, 4) array
        Quaternions.
    angular_velocity : (15, 3) array
        rad/s.
    """

    root_position: Array
    root_velocity: Array
    orientation: Array
    angular_velocity: Array


_LEG = {"thigh": "hip", "shank": "knee", "foot": "ankle"}


@functools.cache
def _gait() -> CubicSpline:
    """Return the flexion (rad) of hip, knee and ankle over the gait cycle."""
    table = data.load("gait/running.toml")
    phase = np.append(table["phase"], 1.0)
    angles = [np.radians(np.append(table[name], table[name][0])) for name in _LEG.values()]
    return CubicSpline(phase, np.stack(angles, axis=1), bc_type="periodic")


def cycle_frequency(running_speed: float, stature: float) -> float:
    """Return gait cycles per second at a running speed (m/s) and stature (m)."""
    table = data.load("gait/running.toml")
    speed = running_speed / table["reference_speed"]
    length = stature / table["reference_stature"]
    return float(table["cycle_frequency"] * math.sqrt(speed / length))


def joint_flexion(phase: float) -> dict[str, tuple[float, float]]:
    """Return flexion (rad) and its rate per cycle (rad) of one side's limb joints.

    Parameters
    ----------
    phase : float
        Share of the gait cycle since this side's foot strike.

    Returns
    -------
    dict
        Keys are the regions of the outer segments: thigh (hip joint), shank (knee), foot (ankle),
        upper_arm (shoulder), forearm (elbow).
    """
    table, spline = data.load("gait/running.toml"), _gait()
    p = phase % 1.0
    angles, rates = spline(p).tolist(), spline(p, 1).tolist()
    flexion = dict(zip(_LEG, zip(angles, rates, strict=True), strict=True))
    # The arm swings against the leg of its side: back when the hip is most flexed.
    forward = _most_flexed_phase()
    amplitude = math.radians(table["shoulder_amplitude"])
    angle = 2.0 * math.pi * (p - forward)
    flexion["upper_arm"] = (
        -amplitude * math.cos(angle),
        2.0 * math.pi * amplitude * math.sin(angle),
    )
    flexion["forearm"] = (math.radians(table["elbow"]), 0.0)
    return flexion


@functools.cache
def _most_flexed_phase() -> float:
    grid = np.linspace(0.0, 1.0, 1001)
    return float(grid[np.argmax(_gait()(grid)[:, 0])])


def _braced_flexion(region: str) -> float:
    """Return the flexion (rad) of a limb joint in the braced stance."""
    return math.radians(data.load("gait/braced.toml")[_JOINT[region]])


def standing_posture(body: Body) -> Posture:
    """Return the upright body at rest, facing along x."""
    n = len(SEGMENTS)
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return Posture(body.centre[0].copy(), np.zeros(3), orientation, np.zeros((n, 3)))


def running_posture(
    body: Body,
    *,
    gait_phase: float,
    facing_angle: float,
    running_speed: float,
    braced: float = 0.0,
) -> Posture:
    """Return the posture of a running body.

    Parameters
    ----------
    body : Body
    gait_phase : float
        0 to 1 since the left foot's strike; the right leg is half a cycle behind.
    facing_angle : float
        Direction of running from x (the car's travel) towards y (its left), rad.
    running_speed : float
        m/s.
    braced : float
        Interpolation share between running (0) and a braced stance (1) whose limbs do not swing.
    """
    lean = math.radians(data.load("gait/running.toml")["trunk_lean"])
    frequency = cycle_frequency(running_speed, body.stature)
    sides = {"left": joint_flexion(gait_phase), "right": joint_flexion(gait_phase + 0.5)}
    pitch = np.zeros(len(SEGMENTS))
    rate = np.zeros(len(SEGMENTS))
    for i, segment in enumerate(SEGMENTS):
        region = region_of(segment)
        if i == 0:
            pitch[i] = lean
            continue
        pitch[i], rate[i] = pitch[PARENTS[i]], rate[PARENTS[i]]
        if region in _FLEXION:
            angle, per_cycle = sides["left" if segment.endswith("_left") else "right"][region]
            if braced > 0.0:
                angle += braced * (_braced_flexion(region) - angle)
                per_cycle *= 1.0 - braced
            pitch[i] += _FLEXION[region] * angle
            rate[i] += _FLEXION[region] * per_cycle * frequency
        elif region in ("neck", "head"):
            # The two neck joints each take half of the rotation that keeps the face upright.
            pitch[i] -= 0.5 * lean
    heading = axis_rotation(2, facing_angle)
    leaning = np.array([axis_rotation(1, angle) for angle in pitch.tolist()])
    orientation = multiply(heading, leaning.T).T.copy()
    lateral = matrix_of(heading)[:, 1]
    forward = matrix_of(heading)[:, 0]
    root = np.array([0.0, 0.0, -_lowest_point(body, orientation)])
    return Posture(root, running_speed * forward, orientation, rate[:, None] * lateral)


def segment_centres(body: Body, orientation: Array, root_position: Array) -> Array:
    """Return the centres of mass of the segments.

    Parameters
    ----------
    body : Body
    orientation : (15, 4) array
        Quaternions of the segments.
    root_position : (3,) array
        Centre of mass of the hip segment, m.

    Returns
    -------
    (15, 3) array
        World axes, m.
    """
    return _centres(body, np.array([matrix_of(q) for q in orientation]), root_position)


def _centres(body: Body, rotation: Array, root_position: Array) -> Array:
    centre = np.empty((len(SEGMENTS), 3))
    centre[0] = root_position
    for i, parent in enumerate(PARENTS):
        if parent >= 0:
            joint = centre[parent] + rotation[parent] @ (body.joint[i] - body.centre[parent])
            centre[i] = joint + rotation[i] @ (body.centre[i] - body.joint[i])
    return centre


def _lowest_point(body: Body, orientation: Array) -> float:
    """Return the height of the body's lowest point with the root's centre at the origin."""
    rotation = np.array([matrix_of(q) for q in orientation])
    centre = _centres(body, rotation, np.zeros(3))
    low = np.inf
    for i, upward in enumerate(rotation[:, 2]):
        height = centre[i, 2] + upward @ (body.ellipsoid[i] - body.centre[i])
        low = min(low, height - float(np.linalg.norm(upward * body.semi_axes[i])))
    return low
