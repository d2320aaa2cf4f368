"""Second-order time stepping with one force evaluation a step.

Velocity Verlet with a predicted velocity (L. Verlet, Phys. Rev. 159, 1967; the prediction serves
the velocity-dependent terms)::

    x1 = x0 + h v0 + h^2/2 a0        v* = v0 + h a0
    a1 = a(x1, v*)                   v1 = v0 + h/2 (a0 + a1)

For forces of position alone it is symplectic; damping is stable while its rate is below ``1/h``.
"""

from models.compilation import inlined_kernel
from models.rotation import rotate_quaternion


@inlined_kernel
def predict(motion, loads, old_spin, old_velocity, old_alpha, old_acceleration, h):
    """Advance positions by ``h`` seconds, keep the old rates, and predict the new ones."""
    n = motion.orientation.shape[0]
    half = 0.5 * h * h
    for k in range(3):
        old_velocity[k] = motion.root_velocity[k]
        old_acceleration[k] = loads.joint_acceleration[0, k]
        motion.root_position[k] += h * old_velocity[k] + half * old_acceleration[k]
        motion.root_velocity[k] += h * old_acceleration[k]
    for i in range(n):
        for k in range(3):
            old_spin[i, k] = motion.angular_velocity[i, k]
            old_alpha[i, k] = loads.angular_acceleration[i, k]
            motion.angular_velocity[i, k] += h * old_alpha[i, k]
        rotate_quaternion(
            motion.orientation,
            i,
            h * old_spin[i, 0] + half * old_alpha[i, 0],
            h * old_spin[i, 1] + half * old_alpha[i, 1],
            h * old_spin[i, 2] + half * old_alpha[i, 2],
        )


@inlined_kernel
def correct(motion, loads, old_spin, old_velocity, old_alpha, old_acceleration, h):
    """Replace the predicted rates by the trapezoidal ones."""
    half = 0.5 * h
    for k in range(3):
        motion.root_velocity[k] = old_velocity[k] + half * (
            old_acceleration[k] + loads.joint_acceleration[0, k]
        )
    for i in range(motion.orientation.shape[0]):
        for k in range(3):
            motion.angular_velocity[i, k] = old_spin[i, k] + half * (
                old_alpha[i, k] + loads.angular_acceleration[i, k]
            )
