"""Joints that yield in translation: three springs and dampers between the two joint points.

The child's joint point is free; a force holds it at its position on the parent. The stretch is
expressed in the parent's axes, with separate stiffness for either sign (tension and compression of
a neck). Force and reaction act at the same point, the child's, so that linear and angular momentum
are conserved: this equals three slide joints with springs before the spherical joint. Beyond its
range a spring is stiffer: tissue that would tear still carries force in the model.
"""

import math

from models.compilation import inlined_kernel

BEYOND = 5.0
"""Stiffness beyond the range over that within it (assumed)."""


@inlined_kernel
def spring_force(joints, i, k, stretch):
    """Return the restoring force (N) of a spring of a joint that yields.

    Parameters
    ----------
    joints : Joints or PlanarJoints
        Gives stiffness and range.
    i : int
        Row of the joint.
    k : int
        Axis of the parent, 0 to 2.
    stretch : float
        m.
    """
    stiffness = joints.give_high[i, k] if stretch > 0.0 else joints.give_low[i, k]
    beyond = max(abs(stretch) - joints.give_range[i], 0.0)
    return stiffness * (stretch + math.copysign((BEYOND - 1.0) * beyond, stretch))


@inlined_kernel
def apply_bushings(tree, joints, motion, loads, power):
    """Compute the forces of the joints that yield and add their power.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    joints : Joints
        Stiffness, damping and friction of the joints.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``joint_force`` (world axes, N) is filled.
    power : (channels,) array
        W; ``power[0]`` is increased by the elastic part, ``power[1]`` by damping.
    """
    for i in range(1, tree.mass.shape[0]):
        if not tree.yields[i]:
            continue
        p = tree.parent[i]
        dx, dy, dz = motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2]
        wx = motion.angular_velocity[p, 0]
        wy = motion.angular_velocity[p, 1]
        wz = motion.angular_velocity[p, 2]
        # Velocity of the child's joint point relative to the coincident point of the parent.
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
