"""Joints in the plane: the spherical joints of the body, made to turn about y alone.

A spherical joint that may only turn about one axis has an elastic energy over one angle. Its
torque is the slope of that energy; ranges, stops and the neck's stiffness are thus those of the
spatial body in the posture that it has, and no limit of the plane is invented.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.pedestrian.joints import TWIST_FRICTION, Joints, elastic_energy
from models.planar.body import PlanarBody
from models.rotation import multiply

Array = NDArray[np.float64]

CELLS = 256
"""Cells of a torque's table over one turn: 1.4 degrees, a seventh of a stop's onset."""
MAX_SCORE = np.radians(170.0)
"""rad from the centre of its range, at which a joint's torque stops growing: half a turn away the
rotation vector jumps to the other side (assumed; no joint's range reaches so far)."""

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_TURN = np.array([0.0, 0.0, -1.0, 0.0])
"""Half a turn from x towards z, which is about -y."""


class PlanarJoints(NamedTuple):
    """Resistance of ``n`` joints (row 0, the root, has none).

    Attributes
    ----------
    torque : (n, CELLS + 1) N m on the child, over its turn from the start against its parent, from
        -pi to pi. damping : (n,) N m s/rad. friction : (n,) N m.
    yields, give_low, give_high, give_damping, give_range : as of the spatial joints.
    """

    torque: Array
    damping: Array
    friction: Array
    yields: NDArray[np.bool_]
    give_low: Array
    give_high: Array
    give_damping: Array
    give_range: Array


def joints_in_plane(joints: Joints, body: PlanarBody) -> PlanarJoints:
    """Return the resistance of a body's joints to turning about y.

    Parameters
    ----------
    joints : of the spatial body. body : in the plane.
    """
    square = body.normal**2
    weight = np.array([1.0, 1.0, TWIST_FRICTION])
    return PlanarJoints(
        torque=_torque_table(joints, body),
        damping=(square * joints.damping).sum(axis=1),
        friction=joints.friction * (square @ weight),
        yields=joints.yields,
        give_low=joints.give_low,
        give_high=joints.give_high,
        give_damping=joints.give_damping,
        give_range=joints.give_range,
    )


def _torque_table(joints: Joints, body: PlanarBody) -> Array:
    width = 2.0 * np.pi / CELLS
    # Between these lie the table's angles: a cell's mean torque is its drop of energy over width.
    angle = (np.arange(CELLS + 2) - 0.5) * width - np.pi
    torque = np.zeros((body.parent.size, CELLS + 1))
    for i in range(1, body.parent.size):
        # The child from the centre of its range: a quaternion that is linear in cosine and sine of
        # half the turn.
        centre = multiply(body.orientation[body.parent[i]], joints.centre[i]) * _CONJUGATE
        start = multiply(centre, body.orientation[i])
        turned = multiply(centre, multiply(_TURN, body.orientation[i]))
        vector = _rotation_vector(
            np.outer(np.cos(0.5 * angle), start) + np.outer(np.sin(0.5 * angle), turned)
        )
        found = -np.diff(elastic_energy(joints, i, vector)) / width
        far = np.linalg.norm(vector, axis=1) > MAX_SCORE
        torque[i] = _held(found, far[1:] | far[:-1])
    return torque


def _rotation_vector(quaternion: Array) -> Array:
    """Return the rotation vectors (k, 3) in rad of unit quaternions (k, 4), half a turn at most."""
    signed = quaternion * np.where(quaternion[:, :1] < 0.0, -1.0, 1.0)
    size = np.linalg.norm(signed[:, 1:], axis=1)
    # atan2(s, w) / s is 1 where both meet the identity.
    ratio = np.where(size > 1e-12, np.arctan2(size, signed[:, 0]) / np.maximum(size, 1e-12), 1.0)
    return np.asarray(2.0 * ratio[:, None] * signed[:, 1:])


def _held(torque: Array, far: NDArray[np.bool_]) -> Array:
    """Return a table that keeps, beyond the first far angle on either side, its last value."""
    held = torque.copy()
    middle = torque.size // 2
    right = np.flatnonzero(far[middle:])
    if right.size:
        first = middle + int(right[0])
        held[first:] = held[max(first - 1, middle)]
    left = np.flatnonzero(far[:middle])
    if left.size:
        last = int(left[-1])
        held[: last + 1] = held[min(last + 1, middle)]
    return held
