"""Resistance of the spherical joints: range of motion, stops, damping and friction.

The rotation of a child relative to the centre of its range is expressed as a rotation vector
``phi = log(q_centre* q_parent* q_child)`` with components about the child's axes: x lateral
(abduction), y flexion, z twist. Each component has a passive stiffness about its neutral value and
a stop on either side; a stop's stiffness tapers in over ``onset`` rad, so the torque is smooth::

    dU/dphi = k (phi - phi0) + K e^2 / (2 onset)     0 < e < onset,  e = excess beyond the range
              k (phi - phi0) + K (e - onset / 2)     e > onset

The torque is the exact gradient of this potential on the rotation group: with J_r the right
Jacobian of the exponential map, ``tau = -J_r^-T dU/dphi`` (J. Sola, A micro Lie theory, 2018,
eq. 144), so the elastic part conserves energy. Damping acts on each component of the relative
angular velocity; friction (dummy joint setting, muscle tone) opposes it with a bounded torque.
"""

import math

import numpy as np

from models.compilation import inlined_kernel
from models.pedestrian.joints import TWIST_FRICTION

FRICTION_RATE = 3.0
"""Relative angular velocity (rad/s) at which joint friction reaches 71 % of its bound (assumed)."""


DEGREE = 11


def _logarithm_polynomials() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return two functions of a unit quaternion's scalar part w as polynomials in 2 w - 1.

    ``2 h / sin h`` converts the vector part into the rotation vector, ``(1 - h cot h) / (2 h)^2``
    is the second coefficient of J_r^-T, with w = cos h. Both are analytic on [0, 1], nearest pole
    w = -1, so degree 11 approximates them to 1e-8 without a root, a quotient or an arc tangent.
    """
    nodes = 0.5 * (np.cos((np.arange(200) + 0.5) * np.pi / 200.0) + 1.0)
    h = np.arccos(nodes)
    polynomials = []
    for values in (2.0 * h / np.sin(h), (1.0 - h / np.tan(h)) / (4.0 * h * h)):
        fit = np.polynomial.chebyshev.chebfit(2.0 * nodes - 1.0, values, DEGREE)
        polynomials.append(tuple(float(c) for c in np.polynomial.chebyshev.cheb2poly(fit)))
    return polynomials[0], polynomials[1]


LOG_SCALE, LOG_CURVATURE = _logarithm_polynomials()


@inlined_kernel
def _component_torque(joints, i, k, phi):
    rest = phi - joints.neutral[i, k]
    g = rest * (joints.stiffness_high[i, k] if rest > 0.0 else joints.stiffness_low[i, k])
    excess = abs(phi) - joints.half_range[i, k]
    if excess > 0.0:
        onset = joints.onset[i]
        shape = 0.5 * excess * excess / onset if excess < onset else excess - 0.5 * onset
        g += joints.stop_high[i, k] * shape if phi > 0.0 else -joints.stop_low[i, k] * shape
    return g


@inlined_kernel
def apply_joint_torques(tree, joints, motion, loads, power):
    """Compute the joint torques and add their power.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    joints : Joints
        Stiffness, damping and friction of the joints.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``joint_torque`` (world axes, N m) is filled.
    power : (channels,) array
        W; ``power[0]`` is increased by the elastic part, ``power[1]`` by damping and friction.
    """
    for i in range(1, tree.mass.shape[0]):
        p = tree.parent[i]
        # phi = log(centre* parent* child)
        w0, x0, y0, z0 = (
            motion.orientation[p, 0],
            -motion.orientation[p, 1],
            -motion.orientation[p, 2],
            -motion.orientation[p, 3],
        )
        w1, x1, y1, z1 = (
            motion.orientation[i, 0],
            motion.orientation[i, 1],
            motion.orientation[i, 2],
            motion.orientation[i, 3],
        )
        w2 = w0 * w1 - x0 * x1 - y0 * y1 - z0 * z1
        x2 = w0 * x1 + x0 * w1 + y0 * z1 - z0 * y1
        y2 = w0 * y1 - x0 * z1 + y0 * w1 + z0 * x1
        z2 = w0 * z1 + x0 * y1 - y0 * x1 + z0 * w1
        w0, x0, y0, z0 = (
            joints.centre[i, 0],
            -joints.centre[i, 1],
            -joints.centre[i, 2],
            -joints.centre[i, 3],
        )
        w = w0 * w2 - x0 * x2 - y0 * y2 - z0 * z2
        x = w0 * x2 + x0 * w2 + y0 * z2 - z0 * y2
        y = w0 * y2 - x0 * z2 + y0 * w2 + z0 * x2
        z = w0 * z2 + x0 * y2 - y0 * x2 + z0 * w2
        if w < 0.0:
            w, x, y, z = -w, -x, -y, -z
        # Even and odd powers separately: four short dependency chains instead of two long ones.
        t = 2.0 * w - 1.0
        t2 = t * t
        scale, scale_odd = LOG_SCALE[DEGREE - 1], LOG_SCALE[DEGREE]
        k, k_odd = LOG_CURVATURE[DEGREE - 1], LOG_CURVATURE[DEGREE]
        for m in range(DEGREE - 3, -1, -2):
            scale = scale * t2 + LOG_SCALE[m]
            scale_odd = scale_odd * t2 + LOG_SCALE[m + 1]
            k = k * t2 + LOG_CURVATURE[m]
            k_odd = k_odd * t2 + LOG_CURVATURE[m + 1]
        scale += t * scale_odd
        k += t * k_odd
        x *= scale
        y *= scale
        z *= scale
        gx = _component_torque(joints, i, 0, x)
        gy = _component_torque(joints, i, 1, y)
        gz = _component_torque(joints, i, 2, z)
        # -J_r^-T g = -(g - phi x g / 2 + k phi x (phi x g))
        cx, cy, cz = y * gz - z * gy, z * gx - x * gz, x * gy - y * gx
        tx = -gx + 0.5 * cx - k * (y * cz - z * cy)
        ty = -gy + 0.5 * cy - k * (z * cx - x * cz)
        tz = -gz + 0.5 * cz - k * (x * cy - y * cx)
        R00, R01, R02 = motion.rotation[i, 0, 0], motion.rotation[i, 0, 1], motion.rotation[i, 0, 2]
        R10, R11, R12 = motion.rotation[i, 1, 0], motion.rotation[i, 1, 1], motion.rotation[i, 1, 2]
        R20, R21, R22 = motion.rotation[i, 2, 0], motion.rotation[i, 2, 1], motion.rotation[i, 2, 2]
        vx = motion.angular_velocity[i, 0] - motion.angular_velocity[p, 0]
        vy = motion.angular_velocity[i, 1] - motion.angular_velocity[p, 1]
        vz = motion.angular_velocity[i, 2] - motion.angular_velocity[p, 2]
        sx = R00 * vx + R10 * vy + R20 * vz
        sy = R01 * vx + R11 * vy + R21 * vz
        sz = R02 * vx + R12 * vy + R22 * vz
        drag = joints.friction[i] / math.sqrt(
            sx * sx + sy * sy + sz * sz + FRICTION_RATE * FRICTION_RATE
        )
        ux = (joints.damping[i, 0] + drag) * sx
        uy = (joints.damping[i, 1] + drag) * sy
        uz = (joints.damping[i, 2] + TWIST_FRICTION * drag) * sz
        power[0] += tx * sx + ty * sy + tz * sz
        power[1] -= ux * sx + uy * sy + uz * sz
        tx -= ux
        ty -= uy
        tz -= uz
        loads.joint_torque[i, 0] = R00 * tx + R01 * ty + R02 * tz
        loads.joint_torque[i, 1] = R10 * tx + R11 * ty + R12 * tz
        loads.joint_torque[i, 2] = R20 * tx + R21 * ty + R22 * tz
