"""Quaternion and rotation-matrix kernels.

Quaternions are ``(w, x, y, z)`` and rotate body coordinates into world coordinates.
"""

import math

import numpy as np

from models.compilation import inlined_kernel, kernel


@kernel
def quaternion_to_matrix(q, R):
    """Write the rotation matrix of the unit quaternion ``q`` (4,) into ``R`` (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[0, 1] = 2.0 * (x * y - w * z)
    R[0, 2] = 2.0 * (x * z + w * y)
    R[1, 0] = 2.0 * (x * y + w * z)
    R[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[1, 2] = 2.0 * (y * z - w * x)
    R[2, 0] = 2.0 * (x * z - w * y)
    R[2, 1] = 2.0 * (y * z + w * x)
    R[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@inlined_kernel
def rotate_quaternion(q, i, ax, ay, az):
    """Rotate row ``i`` of ``q`` in place by a world rotation vector.

    Parameters
    ----------
    q : (n, 4) array
        Unit quaternions; row ``i`` is changed.
    i : int
        Row.
    ax, ay, az : float
        Rotation vector in world axes, rad.
    """
    square = ax * ax + ay * ay + az * az
    # sin(t/2)/t and cos(t/2) by series: a step rotates a segment by far less than 0.1 rad,
    # where the first dropped term is below 1e-16.
    if square < 0.01:
        s = 0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square / 645120.0))
        c = 1.0 - square * (0.125 - square * (1.0 / 384.0 - square * (1.0 / 46080.0)))
    else:
        angle = math.sqrt(square)
        s = math.sin(0.5 * angle) / angle
        c = math.cos(0.5 * angle)
    x, y, z = s * ax, s * ay, s * az
    w0, x0, y0, z0 = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    w1 = c * w0 - x * x0 - y * y0 - z * z0
    x1 = c * x0 + x * w0 + y * z0 - z * y0
    y1 = c * y0 - x * z0 + y * w0 + z * x0
    z1 = c * z0 + x * y0 - y * x0 + z * w0
    # One Newton step to unit length: the norm is off by rounding only.
    scale = 1.5 - 0.5 * (w1 * w1 + x1 * x1 + y1 * y1 + z1 * z1)
    q[i, 0], q[i, 1], q[i, 2], q[i, 3] = w1 * scale, x1 * scale, y1 * scale, z1 * scale


def axis_rotation(axis: int, angle: float) -> np.ndarray:
    """Return the quaternion of a rotation by ``angle`` (rad) about axis 0 (x), 1 (y) or 2 (z)."""
    q = np.zeros(4)
    q[0] = math.cos(0.5 * angle)
    q[1 + axis] = math.sin(0.5 * angle)
    return q


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the Hamilton product ``p q``: the rotation ``q`` followed by ``p``."""
    w0, x0, y0, z0 = p
    w1, x1, y1, z1 = q
    return np.array(
        [
            w0 * w1 - x0 * x1 - y0 * y1 - z0 * z1,
            w0 * x1 + x0 * w1 + y0 * z1 - z0 * y1,
            w0 * y1 - x0 * z1 + y0 * w1 + z0 * x1,
            w0 * z1 + x0 * y1 - y0 * x1 + z0 * w1,
        ]
    )


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Return the (3, 3) rotation matrix of the unit quaternion ``q``."""
    R = np.empty((3, 3))
    quaternion_to_matrix(q, R)
    return R
