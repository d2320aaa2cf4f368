"""Joints in the plane: the spherical joints of the body, restricted to rotation about y.

A spherical joint restricted to one axis has an elastic energy that depends on one angle. Its torque
is the negative slope of that energy; ranges, stops and the neck's stiffness are therefore those of
the spatial body in its posture, without additional assumptions for the plane.
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
MAX_ANGLE = np.radians(170.0)
"""rad from the centre of its range, at which a joint's torque stops growing: half a turn away the
rotation vector jumps to the other side (assumed; no joint's range reaches so far)."""

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_TURN = np.array([0.0, 0.0, -1.0, 0.0])
"""Half a turn from x towards z, which is about -y."""


class PlanarJoints(NamedTuple):
    """Resistance of ``n`` joints (row 0, the root, has none).

    Attributes
    ----------
    torque : (n, CELLS + 1) array
        Torque on the child over its rotation relative to its parent since the start, from -pi to
        pi, N m.
    damping : (n,) array
        N m s/rad.
    friction : (n,) array
        N m.
    yields, give_low, give_high, give_damping, give_range : array
        As in the spatial ``Joints``.
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
    """Return the resistance of a body's joints to rotation about y.

    Parameters
    ----------
    joints : Joints
        Of the spatial body.
    body : PlanarBody
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
    # The table's angles lie between these: the mean torque is the energy drop over the width.
    angle = (np.arange(CELLS + 2) - 0.5) * width - np.pi
    torque = np.zeros((body.parent.size, CELLS + 1))
    for i in range(1, body.parent.size):
        # Child relative to the centre of its range: a quaternion linear in cosine and sine of half
        # the rotation.
        centre = multiply(body.orientation[body.parent[i]], joints.centre[i]) * _CONJUGATE
        start = multiply(centre, body.orientation[i])
        turned = multiply(centre, multiply(_TURN, body.orientation[i]))
        vector = _rotation_vector(
            np.outer(np.cos(0.5 * angle), start) + np.outer(np.sin(0.5 * angle), turned)
        )
        found = -np.diff(elastic_energy(joints, i, vector)) / width
        far = np.linalg.norm(vector, axis=1) > MAX_ANGLE
        torque[i] = _held(found, far[1:] | far[:-1])
    return torque


def _rotation_vector(quaternion: Array) -> Array:
    """Return the rotation vectors (k, 3) in rad, at most pi long, of unit quaternions (k, 4)."""
    signed = quaternion * np.where(quaternion[:, :1] < 0.0, -1.0, 1.0)
    size = np.linalg.norm(signed[:, 1:], axis=1)
    # atan2(s, w) / s is 1 where both meet the identity.
    ratio = np.where(size > 1e-12, np.arctan2(size, signed[:, 0]) / np.maximum(size, 1e-12), 1.0)
    return np.asarray(2.0 * ratio[:, None] * signed[:, 1:])


def _held(torque: Array, far: NDArray[np.bool_]) -> Array:
    """Return a table held constant beyond the first far angle on either side."""
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
