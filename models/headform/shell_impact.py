"""A rigid headform against a sheet of shells: contact and the compiled step loop.

The headform's skin is an elastic foundation: nodes within its sphere press with a stiffness per
area. Gravity is neglected, as for a headform against a plane.
"""

import math

from models.compilation import inlined_kernel, kernel
from models.contact.friction import SLIP_VELOCITY, STICKING
from models.headform.facet_impact import FORCE
from models.headform.impact import (
    ABSORBED,
    DEEPEST,
    END_SLIDE,
    END_SPIN,
    END_TIME,
    NORMAL,
    PENETRATION,
    RATE,
    REBOUND,
    SAMPLES,
    SLIDE,
    SPIN,
    TANGENTIAL,
)
from models.shells.assembly import displacement_of, load_groups, move_groups

# Places of the energy balance (J); the last is the sum of the elements' four.
KINETIC, SECTION, SHEAR, BOW, DRILL, PARTS, SKIN, FRICTION, HEADFORM, INTERNAL = range(10)
BALANCE = 10


@inlined_kernel
def press_sphere(
    nodes, touched, foundation, friction, centre, velocity, spin, radius, step, load
):  # fmt: skip
    """Add the contact of a sphere with nodes and return stored energy and power of friction.

    Parameters
    ----------
    nodes : Nodes
        ``force`` is increased in place.
    touched : (t,) array of int
        Nodes that the sphere can touch.
    foundation : (t,) array
        Stiffness of the sphere's skin over each node's area, N/m; 0 for a node that it passes.
    friction : float
        Coefficient of friction.
    centre, velocity, spin : (3,) array
        Of the sphere, m, m/s and rad/s.
    radius : float
        m.
    step : float
        s.
    load : (9,) array
        Filled: force, torque and normal part of the force on the sphere, N and N m.

    Returns
    -------
    stored, power : float
        J and W.
    """
    stored, power = 0.0, 0.0
    for j in range(9):
        load[j] = 0.0
    for i in range(touched.shape[0]):
        if foundation[i] == 0.0:
            continue
        n = touched[i]
        dx = nodes.position[n, 0] - centre[0]
        if abs(dx) >= radius:
            continue
        dy = nodes.position[n, 1] - centre[1]
        dz = nodes.position[n, 2] - centre[2]
        square = dx * dx + dy * dy + dz * dz
        if square >= radius * radius:
            continue
        away = math.sqrt(square)
        # Unit vector from the sphere into the sheet.
        ux, uy, uz = dx / away, dy / away, dz / away
        depth = radius - away
        push = foundation[i] * depth
        stored += 0.5 * push * depth
        rx, ry, rz = away * ux, away * uy, away * uz
        sx = nodes.velocity[n, 0] - velocity[0] - (spin[1] * rz - spin[2] * ry)
        sy = nodes.velocity[n, 1] - velocity[1] - (spin[2] * rx - spin[0] * rz)
        sz = nodes.velocity[n, 2] - velocity[2] - (spin[0] * ry - spin[1] * rx)
        rate = sx * ux + sy * uy + sz * uz
        sx, sy, sz = sx - rate * ux, sy - rate * uy, sz - rate * uz
        slip = sx * sx + sy * sy + sz * sz
        drag = friction * push / math.sqrt(slip + SLIP_VELOCITY * SLIP_VELOCITY)
        drag = min(drag, STICKING * nodes.mass[n] / step)
        fx, fy, fz = push * ux - drag * sx, push * uy - drag * sy, push * uz - drag * sz
        power += drag * slip
        nodes.force[n, 0] += fx
        nodes.force[n, 1] += fy
        nodes.force[n, 2] += fz
        load[0] -= fx
        load[1] -= fy
        load[2] -= fz
        load[3] -= ry * fz - rz * fy
        load[4] -= rz * fx - rx * fz
        load[5] -= rx * fy - ry * fx
        load[6] -= push * ux
        load[7] -= push * uy
        load[8] -= push * uz
    return stored, power


@kernel
def strike_shells(
    body, foundation, friction, mass, inertia, radius, centre, velocity, spin, axes, step, stride,
    least, load, record, balance, summary, lowest,
):  # fmt: skip
    """Step from first contact until the headform has left the sheet.

    Parameters
    ----------
    body : Assembly
        The shells; those awake are changed, and only they are touched.
    foundation, friction
        See ``press_sphere``.
    mass, inertia, radius : float
        Of the headform, kg, kg m2 and m.
    centre, velocity, spin : (3,) array
        Of the headform at first contact, m, m/s and rad/s; changed.
    axes : (3, 3) array
        Initial normal of the surface, direction of the slide and their normal.
    step : float
        s.
    stride : int
        Steps per sample.
    least : float
        Time (s) without contact after which the headform has left: the sheet may come after it.
    load : (9,) array
        Workspace.
    record : (samples, FACET_COLUMNS) array
        Filled, as in ``models.headform.facet_impact``; penetration is the headform's own travel.
    balance : (BALANCE,) array
        Filled: energy by place, J.
    lowest : (2,) array
        Filled: largest displacement of a node into the car and its time, m and s.
    summary : (SUMMARY,) array
        Filled; END_TIME is NaN if the record is full before the contact ends.
    """
    samples, free, deepest, slid = 0, 0.0, 0.0, 0.0
    travel, skin = 0.0, 0.0
    nodes, shells = body.nodes, body.shells
    ended = math.nan
    summary[END_TIME] = math.nan
    for k in range(record.shape[0] * stride + 1):
        load_groups(body, step)
        skin, power = press_sphere(
            nodes, body.touched, foundation, friction, centre, velocity, spin, radius, step, load
        )
        slid += step * power
        if k % stride == 0:
            for i in range(body.touched.shape[0]):
                moved = displacement_of(body, i)
                if moved > lowest[0]:
                    lowest[0], lowest[1] = moved, k * step
        touching = load[6] != 0.0 or load[7] != 0.0 or load[8] != 0.0
        free = 0.0 if touching else free + step
        if touching:
            ended = k * step
        # Velocities lie half a step before the first forces.
        before = step if k > 0 else 0.5 * step
        if k % stride == 0 and samples < record.shape[0]:
            rate, slide = 0.0, 0.0
            for a in range(3):
                # Velocity at the time of the force.
                rate -= (velocity[a] + 0.5 * before * load[a] / mass) * axes[0, a]
                slide += (velocity[a] + 0.5 * before * load[a] / mass) * axes[1, a]
                record[samples, FORCE + a] = (
                    axes[a, 0] * load[0] + axes[a, 1] * load[1] + axes[a, 2] * load[2]
                )
            record[samples, NORMAL] = math.sqrt(load[6] ** 2 + load[7] ** 2 + load[8] ** 2)
            record[samples, TANGENTIAL] = math.sqrt(
                (load[0] - load[6]) ** 2 + (load[1] - load[7]) ** 2 + (load[2] - load[8]) ** 2
            )
            record[samples, PENETRATION] = travel
            record[samples, RATE] = rate
            record[samples, SLIDE] = slide
            record[samples, SPIN] = math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
            samples += 1
        if k > 0 and free > least:
            summary[END_TIME] = ended
            break
        move_groups(body, step, before)
        for a in range(3):
            velocity[a] += before * load[a] / mass
            spin[a] += before * load[3 + a] / inertia
            centre[a] += step * velocity[a]
            travel -= step * velocity[a] * axes[0, a]
        deepest = max(deepest, travel)
    normal, square = 0.0, 0.0
    for a in range(3):
        normal += velocity[a] * axes[0, a]
        square += velocity[a] * velocity[a]
    summary[SAMPLES] = float(samples)
    summary[DEEPEST] = deepest
    summary[REBOUND] = normal
    summary[END_SLIDE] = math.sqrt(max(square - normal * normal, 0.0))
    summary[END_SPIN] = math.sqrt(spin[0] ** 2 + spin[1] ** 2 + spin[2] ** 2)
    balance[KINETIC] = body.moving.sum()
    for j in range(4):
        balance[SECTION + j] = shells.energy[j]
    balance[PARTS] = body.stored.sum()
    balance[SKIN] = skin
    balance[FRICTION] = slid
    balance[HEADFORM] = 0.5 * mass * square + 0.5 * inertia * summary[END_SPIN] ** 2
    balance[INTERNAL] = shells.energy.sum()
    summary[ABSORBED] = 0.0
    for j in range(HEADFORM):
        summary[ABSORBED] += balance[j]
