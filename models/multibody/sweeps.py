"""Exact dynamics of a tree of rigid segments with spherical joints, in two sweeps.

With absolute orientations and joints that leave all rotation free, the torque of a joint is known
(it is the joint's resistance), so a subtree acts on its parent only by a force at the joint point.
That force is linear in the acceleration of the point: the subtree is a 3x3 *articulated mass*
there. One sweep from the leaves to the root accumulates these masses, a second sweep back gives all
accelerations. This is Featherstone's articulated-body recursion (R. Featherstone, Rigid Body
Dynamics Algorithms, 2008, chapter 7) for the case in which the joint's motion subspace is the whole
of rotation; no large system is solved and no joint drifts.

For a segment with joint point J, mass m, centre of mass at r from J, inertia I about the centre
of mass, children c attached at d_c with articulated masses M_c and bias forces b_c::

    f = M a_J - K alpha + p          force that the parent applies at J
    n = -K^T a_J + G alpha + s       torque that the joint applies

    M = m 1 + sum M_c     K = m [r] + sum M_c [d_c]     G = I - m [r][r] - sum [d_c] M_c [d_c]

where ``[r]`` is the cross-product matrix. Eliminating alpha gives the segment's own articulated
mass ``M - K G^-1 K^T`` and bias ``p + K G^-1 (s - n)``.

A joint that yields carries a force that is known from the stretch between its points (see
``models.multibody.bushings``), like its torque. Its child is then a second root: the articulated
mass gives the joint point's acceleration directly, ``M a_J + b = f``, and the force and the torque
act on the parent, but no mass. A compliant joint therefore costs less than an exact one, and as its
stiffness grows the motion tends to that of the exact joint.
"""

from models.compilation import inlined_kernel


@inlined_kernel
def solve_accelerations(tree, motion, loads):
    """Compute the accelerations of all segments from loads and motion.

    Parameters
    ----------
    tree : Tree
        Constant data of the segments.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        ``joint_acceleration`` and ``angular_acceleration`` are filled; workspace is overwritten.
    """
    _sweep_to_root(tree, motion, loads)
    _sweep_to_leaves(tree, motion, loads)


@inlined_kernel
def _sweep_to_root(tree, motion, loads):
    n = tree.mass.shape[0]
    loads.articulated[:] = 0.0
    for i in range(n - 1, -1, -1):
        m = tree.mass[i]
        rx, ry, rz = motion.offset[i, 0], motion.offset[i, 1], motion.offset[i, 2]
        wx = motion.angular_velocity[i, 0]
        wy = motion.angular_velocity[i, 1]
        wz = motion.angular_velocity[i, 2]
        fx, fy, fz = loads.force[i, 0], loads.force[i, 1], loads.force[i, 2]
        R00, R01, R02 = motion.rotation[i, 0, 0], motion.rotation[i, 0, 1], motion.rotation[i, 0, 2]
        R10, R11, R12 = motion.rotation[i, 1, 0], motion.rotation[i, 1, 1], motion.rotation[i, 1, 2]
        R20, R21, R22 = motion.rotation[i, 2, 0], motion.rotation[i, 2, 1], motion.rotation[i, 2, 2]
        # Inertia about the centre of mass in world axes.
        A, B, C = tree.inertia[i, 0], tree.inertia[i, 1], tree.inertia[i, 2]
        Ixx = A * R00 * R00 + B * R01 * R01 + C * R02 * R02
        Iyy = A * R10 * R10 + B * R11 * R11 + C * R12 * R12
        Izz = A * R20 * R20 + B * R21 * R21 + C * R22 * R22
        Ixy = A * R00 * R10 + B * R01 * R11 + C * R02 * R12
        Ixz = A * R00 * R20 + B * R01 * R21 + C * R02 * R22
        Iyz = A * R10 * R20 + B * R11 * R21 + C * R12 * R22
        hx = Ixx * wx + Ixy * wy + Ixz * wz
        hy = Ixy * wx + Iyy * wy + Iyz * wz
        hz = Ixz * wx + Iyz * wy + Izz * wz
        # Centripetal acceleration of the centre of mass: w (w.r) - r w^2.
        wr = wx * rx + wy * ry + wz * rz
        ww = wx * wx + wy * wy + wz * wz
        px = m * (wx * wr - rx * ww) - fx
        py = m * (wy * wr - ry * ww) - fy
        pz = m * (wz * wr - rz * ww) - fz
        sx = loads.articulated[i, 24] + wy * hz - wz * hy + ry * pz - rz * py - loads.torque[i, 0]
        sy = loads.articulated[i, 25] + wz * hx - wx * hz + rz * px - rx * pz - loads.torque[i, 1]
        sz = loads.articulated[i, 26] + wx * hy - wy * hx + rx * py - ry * px - loads.torque[i, 2]
        px += loads.articulated[i, 21]
        py += loads.articulated[i, 22]
        pz += loads.articulated[i, 23]
        # M (symmetric), K (full), G (symmetric), children included.
        M00, M01, M02 = (
            m + loads.articulated[i, 0],
            loads.articulated[i, 1],
            loads.articulated[i, 2],
        )
        M11, M12, M22 = (
            m + loads.articulated[i, 3],
            loads.articulated[i, 4],
            m + loads.articulated[i, 5],
        )
        K00, K01, K02 = (
            loads.articulated[i, 6],
            loads.articulated[i, 7] - m * rz,
            loads.articulated[i, 8] + m * ry,
        )
        K10, K11, K12 = (
            loads.articulated[i, 9] + m * rz,
            loads.articulated[i, 10],
            loads.articulated[i, 11] - m * rx,
        )
        K20, K21, K22 = (
            loads.articulated[i, 12] - m * ry,
            loads.articulated[i, 13] + m * rx,
            loads.articulated[i, 14],
        )
        G00 = Ixx + m * (ry * ry + rz * rz) + loads.articulated[i, 15]
        G01 = Ixy - m * rx * ry + loads.articulated[i, 16]
        G02 = Ixz - m * rx * rz + loads.articulated[i, 17]
        G11 = Iyy + m * (rx * rx + rz * rz) + loads.articulated[i, 18]
        G12 = Iyz - m * ry * rz + loads.articulated[i, 19]
        G22 = Izz + m * (rx * rx + ry * ry) + loads.articulated[i, 20]
        # Inverse of G.
        c00 = G11 * G22 - G12 * G12
        c01 = G02 * G12 - G01 * G22
        c02 = G01 * G12 - G02 * G11
        inv = 1.0 / (G00 * c00 + G01 * c01 + G02 * c02)
        V00, V01, V02 = c00 * inv, c01 * inv, c02 * inv
        V11 = (G00 * G22 - G02 * G02) * inv
        V12 = (G01 * G02 - G00 * G12) * inv
        V22 = (G00 * G11 - G01 * G01) * inv
        X00 = K00 * V00 + K01 * V01 + K02 * V02
        X01 = K00 * V01 + K01 * V11 + K02 * V12
        X02 = K00 * V02 + K01 * V12 + K02 * V22
        X10 = K10 * V00 + K11 * V01 + K12 * V02
        X11 = K10 * V01 + K11 * V11 + K12 * V12
        X12 = K10 * V02 + K11 * V12 + K12 * V22
        X20 = K20 * V00 + K21 * V01 + K22 * V02
        X21 = K20 * V01 + K21 * V11 + K22 * V12
        X22 = K20 * V02 + K21 * V12 + K22 * V22
        loads.gain[i, 0, 0], loads.gain[i, 0, 1], loads.gain[i, 0, 2] = X00, X01, X02
        loads.gain[i, 1, 0], loads.gain[i, 1, 1], loads.gain[i, 1, 2] = X10, X11, X12
        loads.gain[i, 2, 0], loads.gain[i, 2, 1], loads.gain[i, 2, 2] = X20, X21, X22
        parent = tree.parent[i]
        if parent >= 0:
            tx, ty, tz = (
                loads.joint_torque[i, 0],
                loads.joint_torque[i, 1],
                loads.joint_torque[i, 2],
            )
        else:
            tx, ty, tz = 0.0, 0.0, 0.0
        nx, ny, nz = tx - sx, ty - sy, tz - sz
        loads.free_spin[i, 0] = V00 * nx + V01 * ny + V02 * nz
        loads.free_spin[i, 1] = V01 * nx + V11 * ny + V12 * nz
        loads.free_spin[i, 2] = V02 * nx + V12 * ny + V22 * nz
        # Articulated mass and bias at the joint point.
        M00 -= X00 * K00 + X01 * K01 + X02 * K02
        M01 -= X00 * K10 + X01 * K11 + X02 * K12
        M02 -= X00 * K20 + X01 * K21 + X02 * K22
        M11 -= X10 * K10 + X11 * K11 + X12 * K12
        M12 -= X10 * K20 + X11 * K21 + X12 * K22
        M22 -= X20 * K20 + X21 * K21 + X22 * K22
        bx = px - (X00 * nx + X01 * ny + X02 * nz)
        by = py - (X10 * nx + X11 * ny + X12 * nz)
        bz = pz - (X20 * nx + X21 * ny + X22 * nz)
        if parent < 0 or tree.yields[i]:
            # The force at the joint is known: zero at the root, the bushing's where it yields.
            bx -= loads.joint_force[i, 0]
            by -= loads.joint_force[i, 1]
            bz -= loads.joint_force[i, 2]
            c00 = M11 * M22 - M12 * M12
            c01 = M02 * M12 - M01 * M22
            c02 = M01 * M12 - M02 * M11
            inv = -1.0 / (M00 * c00 + M01 * c01 + M02 * c02)
            c11 = M00 * M22 - M02 * M02
            c12 = M01 * M02 - M00 * M12
            c22 = M00 * M11 - M01 * M01
            loads.joint_acceleration[i, 0] = inv * (c00 * bx + c01 * by + c02 * bz)
            loads.joint_acceleration[i, 1] = inv * (c01 * bx + c11 * by + c12 * bz)
            loads.joint_acceleration[i, 2] = inv * (c02 * bx + c12 * by + c22 * bz)
            if parent >= 0:
                _react(motion, loads, i, parent)
            continue
        dx, dy, dz = motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2]
        ux = motion.angular_velocity[parent, 0]
        uy = motion.angular_velocity[parent, 1]
        uz = motion.angular_velocity[parent, 2]
        ud = ux * dx + uy * dy + uz * dz
        uu = ux * ux + uy * uy + uz * uz
        cx, cy, cz = ux * ud - dx * uu, uy * ud - dy * uu, uz * ud - dz * uu
        bx += M00 * cx + M01 * cy + M02 * cz
        by += M01 * cx + M11 * cy + M12 * cz
        bz += M02 * cx + M12 * cy + M22 * cz
        # [d] as columns: L = M [d], then -[d] M [d] = -[d] L.
        L00, L01, L02 = M01 * dz - M02 * dy, M02 * dx - M00 * dz, M00 * dy - M01 * dx
        L10, L11, L12 = M11 * dz - M12 * dy, M12 * dx - M01 * dz, M01 * dy - M11 * dx
        L20, L21, L22 = M12 * dz - M22 * dy, M22 * dx - M02 * dz, M02 * dy - M12 * dx
        loads.articulated[parent, 0] += M00
        loads.articulated[parent, 1] += M01
        loads.articulated[parent, 2] += M02
        loads.articulated[parent, 3] += M11
        loads.articulated[parent, 4] += M12
        loads.articulated[parent, 5] += M22
        loads.articulated[parent, 6] += L00
        loads.articulated[parent, 7] += L01
        loads.articulated[parent, 8] += L02
        loads.articulated[parent, 9] += L10
        loads.articulated[parent, 10] += L11
        loads.articulated[parent, 11] += L12
        loads.articulated[parent, 12] += L20
        loads.articulated[parent, 13] += L21
        loads.articulated[parent, 14] += L22
        loads.articulated[parent, 15] += dz * L10 - dy * L20
        loads.articulated[parent, 16] += dz * L11 - dy * L21
        loads.articulated[parent, 17] += dz * L12 - dy * L22
        loads.articulated[parent, 18] += dx * L21 - dz * L01
        loads.articulated[parent, 19] += dx * L22 - dz * L02
        loads.articulated[parent, 20] += dy * L02 - dx * L12
        loads.articulated[parent, 21] += bx
        loads.articulated[parent, 22] += by
        loads.articulated[parent, 23] += bz
        loads.articulated[parent, 24] += dy * bz - dz * by + tx
        loads.articulated[parent, 25] += dz * bx - dx * bz + ty
        loads.articulated[parent, 26] += dx * by - dy * bx + tz


@inlined_kernel
def _react(motion, loads, i, parent):
    """Add the force and the torque of a joint that yields, but no mass, to its parent."""
    dx, dy, dz = motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2]
    fx, fy, fz = loads.joint_force[i, 0], loads.joint_force[i, 1], loads.joint_force[i, 2]
    loads.articulated[parent, 21] += fx
    loads.articulated[parent, 22] += fy
    loads.articulated[parent, 23] += fz
    loads.articulated[parent, 24] += dy * fz - dz * fy + loads.joint_torque[i, 0]
    loads.articulated[parent, 25] += dz * fx - dx * fz + loads.joint_torque[i, 1]
    loads.articulated[parent, 26] += dx * fy - dy * fx + loads.joint_torque[i, 2]


@inlined_kernel
def _sweep_to_leaves(tree, motion, loads):
    n = tree.mass.shape[0]
    for i in range(n):
        p = tree.parent[i]
        if p >= 0 and not tree.yields[i]:
            dx, dy, dz = motion.lever[i, 0], motion.lever[i, 1], motion.lever[i, 2]
            ux = motion.angular_velocity[p, 0]
            uy = motion.angular_velocity[p, 1]
            uz = motion.angular_velocity[p, 2]
            qx = loads.angular_acceleration[p, 0]
            qy = loads.angular_acceleration[p, 1]
            qz = loads.angular_acceleration[p, 2]
            ud = ux * dx + uy * dy + uz * dz
            uu = ux * ux + uy * uy + uz * uz
            loads.joint_acceleration[i, 0] = (
                loads.joint_acceleration[p, 0] + qy * dz - qz * dy + ux * ud - dx * uu
            )
            loads.joint_acceleration[i, 1] = (
                loads.joint_acceleration[p, 1] + qz * dx - qx * dz + uy * ud - dy * uu
            )
            loads.joint_acceleration[i, 2] = (
                loads.joint_acceleration[p, 2] + qx * dy - qy * dx + uz * ud - dz * uu
            )
        ax = loads.joint_acceleration[i, 0]
        ay = loads.joint_acceleration[i, 1]
        az = loads.joint_acceleration[i, 2]
        loads.angular_acceleration[i, 0] = (
            loads.free_spin[i, 0]
            + loads.gain[i, 0, 0] * ax
            + loads.gain[i, 1, 0] * ay
            + loads.gain[i, 2, 0] * az
        )
        loads.angular_acceleration[i, 1] = (
            loads.free_spin[i, 1]
            + loads.gain[i, 0, 1] * ax
            + loads.gain[i, 1, 1] * ay
            + loads.gain[i, 2, 1] * az
        )
        loads.angular_acceleration[i, 2] = (
            loads.free_spin[i, 2]
            + loads.gain[i, 0, 2] * ax
            + loads.gain[i, 1, 2] * ay
            + loads.gain[i, 2, 2] * az
        )
