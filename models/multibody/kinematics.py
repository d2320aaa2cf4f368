"""Positions and velocities of all segments from the generalised state of the tree."""

from models.compilation import inlined_kernel, kernel


@inlined_kernel
def _hang(tree, motion, i, p):
    """Set joint point and joint velocity of a segment to those of its position on the parent."""
    a0 = tree.joint_in_parent[i, 0]
    a1 = tree.joint_in_parent[i, 1]
    a2 = tree.joint_in_parent[i, 2]
    dx = (
        motion.rotation[p, 0, 0] * a0
        + motion.rotation[p, 0, 1] * a1
        + motion.rotation[p, 0, 2] * a2
    )
    dy = (
        motion.rotation[p, 1, 0] * a0
        + motion.rotation[p, 1, 1] * a1
        + motion.rotation[p, 1, 2] * a2
    )
    dz = (
        motion.rotation[p, 2, 0] * a0
        + motion.rotation[p, 2, 1] * a1
        + motion.rotation[p, 2, 2] * a2
    )
    ux = motion.angular_velocity[p, 0]
    uy = motion.angular_velocity[p, 1]
    uz = motion.angular_velocity[p, 2]
    motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2] = dx, dy, dz
    motion.joint[i, 0] = motion.joint[p, 0] + dx
    motion.joint[i, 1] = motion.joint[p, 1] + dy
    motion.joint[i, 2] = motion.joint[p, 2] + dz
    motion.joint_velocity[i, 0] = motion.joint_velocity[p, 0] + uy * dz - uz * dy
    motion.joint_velocity[i, 1] = motion.joint_velocity[p, 1] + uz * dx - ux * dz
    motion.joint_velocity[i, 2] = motion.joint_velocity[p, 2] + ux * dy - uy * dx


@inlined_kernel
def update_kinematics(tree, motion):
    """Compute rotations, centres, joints and centre velocities from the generalised state."""
    n = tree.mass.shape[0]
    for i in range(n):
        w, x, y, z = (
            motion.orientation[i, 0],
            motion.orientation[i, 1],
            motion.orientation[i, 2],
            motion.orientation[i, 3],
        )
        R00 = 1.0 - 2.0 * (y * y + z * z)
        R01 = 2.0 * (x * y - w * z)
        R02 = 2.0 * (x * z + w * y)
        R10 = 2.0 * (x * y + w * z)
        R11 = 1.0 - 2.0 * (x * x + z * z)
        R12 = 2.0 * (y * z - w * x)
        R20 = 2.0 * (x * z - w * y)
        R21 = 2.0 * (y * z + w * x)
        R22 = 1.0 - 2.0 * (x * x + y * y)
        motion.rotation[i, 0, 0], motion.rotation[i, 0, 1], motion.rotation[i, 0, 2] = R00, R01, R02
        motion.rotation[i, 1, 0], motion.rotation[i, 1, 1], motion.rotation[i, 1, 2] = R10, R11, R12
        motion.rotation[i, 2, 0], motion.rotation[i, 2, 1], motion.rotation[i, 2, 2] = R20, R21, R22
        wx = motion.angular_velocity[i, 0]
        wy = motion.angular_velocity[i, 1]
        wz = motion.angular_velocity[i, 2]
        p = tree.parent[i]
        if p < 0:
            for k in range(3):
                motion.joint[i, k] = motion.root_position[k]
                motion.joint_velocity[i, k] = motion.root_velocity[k]
        else:
            if tree.yields[i]:
                # The joint point is part of the state.
                for k in range(3):
                    motion.lever[i, k] = motion.joint[i, k] - motion.joint[p, k]
            else:
                _hang(tree, motion, i, p)
        s0 = tree.centre_from_joint[i, 0]
        s1 = tree.centre_from_joint[i, 1]
        s2 = tree.centre_from_joint[i, 2]
        rx = R00 * s0 + R01 * s1 + R02 * s2
        ry = R10 * s0 + R11 * s1 + R12 * s2
        rz = R20 * s0 + R21 * s1 + R22 * s2
        motion.offset[i, 0], motion.offset[i, 1], motion.offset[i, 2] = rx, ry, rz
        motion.centre[i, 0] = motion.joint[i, 0] + rx
        motion.centre[i, 1] = motion.joint[i, 1] + ry
        motion.centre[i, 2] = motion.joint[i, 2] + rz
        motion.velocity[i, 0] = motion.joint_velocity[i, 0] + wy * rz - wz * ry
        motion.velocity[i, 1] = motion.joint_velocity[i, 1] + wz * rx - wx * rz
        motion.velocity[i, 2] = motion.joint_velocity[i, 2] + wx * ry - wy * rx


@kernel
def seat_joints(tree, motion):
    """Set the points of all joints that yield, and their velocities, to zero stretch.

    Used for a state that is given by the root and the segments' orientations; the kinematics are up
    to date afterwards.
    """
    for i in range(tree.mass.shape[0]):
        # Parents come before children: segments beyond a yielding joint follow it.
        update_kinematics(tree, motion)
        if tree.yields[i]:
            _hang(tree, motion, i, tree.parent[i])
    update_kinematics(tree, motion)


@inlined_kernel
def centre_acceleration(motion, loads, i):
    """Return the acceleration of the centre of mass of segment ``i``.

    Parameters
    ----------
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        Joint and angular accelerations.
    i : int
        Row of the segment.

    Returns
    -------
    ax, ay, az : float
        World axes, m/s2.
    """
    rx, ry, rz = motion.offset[i, 0], motion.offset[i, 1], motion.offset[i, 2]
    wx = motion.angular_velocity[i, 0]
    wy = motion.angular_velocity[i, 1]
    wz = motion.angular_velocity[i, 2]
    qx = loads.angular_acceleration[i, 0]
    qy = loads.angular_acceleration[i, 1]
    qz = loads.angular_acceleration[i, 2]
    wr = wx * rx + wy * ry + wz * rz
    ww = wx * wx + wy * wy + wz * wz
    ax = loads.joint_acceleration[i, 0] + qy * rz - qz * ry + wx * wr - rx * ww
    ay = loads.joint_acceleration[i, 1] + qz * rx - qx * rz + wy * wr - ry * ww
    az = loads.joint_acceleration[i, 2] + qx * ry - qy * rx + wz * wr - rz * ww
    return ax, ay, az
