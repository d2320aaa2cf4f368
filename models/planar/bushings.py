"""Joints that yield, in the plane: the spatial springs and dampers between two points.

Pymunk has no such joint, and its steps are long, so the force is that at the step's end (backward
Euler for one spring on the effective mass of the two segments, free of all others): it is stable
at any step and tends to the exact spring force as steps shrink.
"""

import math

from models.compilation import inlined_kernel
from models.multibody.bushings import spring_force
from models.planar.space import ANGLE, FORCE_X, FORCE_Z, SPEED_X, SPEED_Z, SPIN, TORQUE, X, Z


@inlined_kernel
def add_bushings(body, joints, state, ahead, given):
    """Add the forces of the joints that yield to the loads of a step.

    Parameters
    ----------
    body : PlanarBody
    joints : PlanarJoints
    state : (b, 6) array
        x, z (m), angle (rad) and their rates of all bodies.
    ahead : float
        Length of the step, s.
    given : (b, 5) array
        Forces (N) and torques (N m) are increased in place.
    """
    for i in range(1, body.mass.shape[0]):
        if not joints.yields[i]:
            continue
        p = body.parent[i]
        # The child's joint point, and its lever arm on both segments, after the step.
        turn = state[i, ANGLE] + ahead * state[i, SPIN]
        c, s = math.cos(turn), math.sin(turn)
        ax, az = body.joint[i, 0] - body.centre[i, 0], body.joint[i, 1] - body.centre[i, 1]
        rx, rz = c * ax - s * az, s * ax + c * az
        x = state[i, X] + ahead * state[i, SPEED_X] + rx
        z = state[i, Z] + ahead * state[i, SPEED_Z] + rz
        turn = state[p, ANGLE] + ahead * state[p, SPIN]
        c, s = math.cos(turn), math.sin(turn)
        ax, az = body.joint[i, 0] - body.centre[p, 0], body.joint[i, 1] - body.centre[p, 1]
        px, pz = (
            x - state[p, X] - ahead * state[p, SPEED_X],
            z - state[p, Z] - ahead * state[p, SPEED_Z],
        )
        dx, dz = px - (c * ax - s * az), pz - (s * ax + c * az)
        # Velocity relative to the coincident point of the parent.
        vx = state[i, SPEED_X] - state[i, SPIN] * rz - state[p, SPEED_X] + state[p, SPIN] * pz
        vz = state[i, SPEED_Z] + state[i, SPIN] * rx - state[p, SPEED_Z] - state[p, SPIN] * px
        fx, fz = 0.0, 0.0
        for k in range(3):
            ex = c * body.axes[p, k, 0] - s * body.axes[p, k, 1]
            ez = s * body.axes[p, k, 0] + c * body.axes[p, k, 1]
            stretch, rate = ex * dx + ez * dz, ex * vx + ez * vz
            damping = joints.give_damping[i, k]
            stiffness = max(joints.give_low[i, k], joints.give_high[i, k])
            held = spring_force(joints, i, k, stretch) + damping * rate
            held /= 1.0 + ahead * (damping + ahead * stiffness) * body.mobility[i]
            fx -= held * ex
            fz -= held * ez
        given[i, FORCE_X] += fx
        given[i, FORCE_Z] += fz
        given[i, TORQUE] += rx * fz - rz * fx
        given[p, FORCE_X] -= fx
        given[p, FORCE_Z] -= fz
        given[p, TORQUE] -= px * fz - pz * fx
