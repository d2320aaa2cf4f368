"""Joints that yield along and across: three springs and dampers between the two joint points.

The child's joint point is free; a force holds it at its place on the parent. The stretch is taken
in the parent's axes, with a stiffness of its own on either side of zero (tension and compression
of a neck), and force and reaction act at the same point, the child's, so that neither momentum is
lost: these are three slide joints with springs before the spherical one. Beyond its range a spring
is stiffer: what in a body would tear still holds.
"""

import math

from models.compilation import inlined_kernel

BEYOND = 5.0
"""Stiffness beyond the range over that within it (assumed)."""


@inlined_kernel
def spring_force(joints, i, k, stretch):
    """Return the force (N) that pulls a stretch (m) back."""
    stiffness = joints.give_high[i, k] if stretch > 0.0 else joints.give_low[i, k]
    beyond = max(abs(stretch) - joints.give_range[i], 0.0)
    return stiffness * (stretch + math.copysign((BEYOND - 1.0) * beyond, stretch))


@inlined_kernel
def apply_bushings(tree, joints, motion, loads, power):
    """Write ``loads.joint_force`` of the joints that yield; add elastic and damping power (W).

    ``power[0]`` gets the elastic part, ``power[1]`` damping.
    """
    for i in range(1, tree.mass.shape[0]):
        if not tree.yields[i]:
            continue
        p = tree.parent[i]
        dx, dy, dz = motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2]
        wx = motion.angular_velocity[p, 0]
        wy = motion.angular_velocity[p, 1]
        wz = motion.angular_velocity[p, 2]
        # Velocity of the child's joint point against the point of the parent that is there.
        vx = motion.joint_velocity[i, 0] - motion.joint_velocity[p, 0] - wy * dz + wz * dy
        vy = motion.joint_velocity[i, 1] - motion.joint_velocity[p, 1] - wz * dx + wx * dz
        vz = motion.joint_velocity[i, 2] - motion.joint_velocity[p, 2] - wx * dy + wy * dx
        fx, fy, fz = 0.0, 0.0, 0.0
        for k in range(3):
            ex, ey, ez = (
                motion.rotation[p, 0, k],
                motion.rotation[p, 1, k],
                motion.rotation[p, 2, k],
            )
            stretch = ex * dx + ey * dy + ez * dz - tree.joint_in_parent[i, k]
            rate = ex * vx + ey * vy + ez * vz
            elastic = spring_force(joints, i, k, stretch)
            viscous = joints.give_damping[i, k] * rate
            power[0] -= elastic * rate
            power[1] -= viscous * rate
            force = -elastic - viscous
            fx += force * ex
            fy += force * ey
            fz += force * ez
        loads.joint_force[i, 0], loads.joint_force[i, 1], loads.joint_force[i, 2] = fx, fy, fz
