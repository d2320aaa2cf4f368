"""A sheet of shells that bodies press on: its motion between two poses of the bodies.

The bodies' surfaces move straight from pose to pose, in some tens of the sheet's own steps; the
impulses on them, over the time between, are the loads that they feel. A stiff body (the head)
presses by an elastic foundation, any other by the law of its flesh at its deepest node, shared out
over the nodes by their depth and area.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel
from models.contact.friction import SLIP_VELOCITY, STICKING
from models.crash.surfaces import law_force
from models.shells.element import update_element
from models.shells.explicit import advance, clear_loads
from models.shells.material import Materials
from models.shells.parts import Gaps, Supports, Ties, apply_parts
from models.shells.state import Nodes, Shells

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MARGIN = 0.03
"""Distance (m) between poses within which a node can come into contact (assumed, far more than the
travel of a step)."""
AWAKE = 0.03
"""Distance (m) of a body from the sheet's plane at which the sheet begins to be stepped."""
ASLEEP = 0.02
"""Time (s) without a load after which the sheet is stepped no more (assumed)."""
LIGHT = 30.0
"""Force (N) on a segment below which the sheet counts as free of it (assumed): a limb that drags
over the hood does not dent it."""

# Entries of the clock.
NOW, RUNNING, LAST_CONTACT, STEPS = range(4)
# Entries of the account (J): the work of the bodies on the sheet, friction, kinetic, parts.
WORK, SLID, MOVING, PARTS = range(4)


class Sheet(NamedTuple):
    """A sheet, its supports and its state, in the frame of the static car.

    Attributes
    ----------
    nodes : Nodes
    shells : Shells
    materials : Materials
    start : (n, 3) array
        Places of the nodes at rest, m.
    ties, gaps, supports
        See ``models.shells.parts``.
    touched : (t,) array of int
        Nodes that bodies can touch.
    area : (t,) array
        Area about each, m2.
    pressed : (t, 3) array
        Force of the bodies on each at present, N.
    box : (2, 3) array
        Corners of the space in which bodies wake the sheet, m.
    normal : (3,) array
        Outward normal of the sheet's plane.
    foundation : (n,) array
        Elastic foundation of each segment, Pa/m; 0 for the law of its flesh.
    step : float
        Largest step, s.
    clock : (4,) array
        Time reached (s), whether it runs, time of the last contact (s), steps.
    past, present : (n, 12) array
        Centres and rotations of the segments at both poses.
    turn : (3, 3) array
        Workspace.
    candidate : (n, c) array of int
        Entries of ``touched`` that a segment can touch until the next pose.
    number : (n,) array of int
        Number of them.
    depth : (c,) array
        Workspace.
    impulse : (n, 10) array
        Force, torque about the centre, normal force and its size, as sums over the steps and then
        means, N and N m.
    place : (n, 4) array
        Sum of the normal force times the place of contact, and of the force.
    largest : (n,) array
        Largest depth of a segment in the sheet's surface so far, m.
    sunk : (n,) array
        Largest depth so far with the displacement of the sheet, m.
    account : (4,) array
        J.
    lowest : (t,) array
        Largest displacement of each node into the car, m.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """

    nodes: Nodes
    shells: Shells
    materials: Materials
    start: Array
    ties: Ties
    gaps: Gaps
    supports: Supports
    touched: Index
    area: Array
    pressed: Array
    box: Array
    normal: Array
    foundation: Array
    step: float
    clock: Array
    past: Array
    present: Array
    turn: Array
    candidate: Index
    number: Index
    depth: Array
    impulse: Array
    place: Array
    largest: Array
    sunk: Array
    account: Array
    lowest: Array
    frame: Array
    local: Array


@inlined_kernel
def is_near_sheet(sheet, reach):
    """Return whether a segment of the present pose is within reach of the sheet.

    Parameters
    ----------
    sheet : Sheet
    reach : (n,) array
        Largest distance of the segments' surfaces from their centres, m.
    """
    for i in range(reach.shape[0]):
        near = True
        height = 0.0
        for k in range(3):
            c = sheet.present[i, k]
            near &= sheet.box[0, k] - reach[i] < c < sheet.box[1, k] + reach[i]
            height += sheet.normal[k] * (c - sheet.start[0, k])
        if near and abs(height) < reach[i] + AWAKE:
            return True
    return False


@inlined_kernel
def find_candidates(sheet, reach):
    """List the nodes that each segment can touch until the next pose."""
    for i in range(reach.shape[0]):
        found = 0
        limit = (reach[i] + MARGIN) ** 2
        for t in range(sheet.touched.shape[0]):
            n = sheet.touched[t]
            square = 0.0
            for k in range(3):
                square += (sheet.nodes.position[n, k] - sheet.present[i, k]) ** 2
            if square < limit:
                sheet.candidate[i, found] = t
                found += 1
        sheet.number[i] = found


@inlined_kernel
def _press(sheet, ellipsoids, i, law, mu, share, span, spin, step):
    """Press a segment, at a share of the way between its poses, on the sheet.

    ``span`` is the time between the poses, ``spin`` (3,) the segment's angular velocity.
    """
    past, present, nodes = sheet.past, sheet.present, sheet.nodes
    keep = 1.0 - share
    cx = keep * past[i, 0] + share * present[i, 0]
    cy = keep * past[i, 1] + share * present[i, 1]
    cz = keep * past[i, 2] + share * present[i, 2]
    ux = (present[i, 0] - past[i, 0]) / span
    uy = (present[i, 1] - past[i, 1]) / span
    uz = (present[i, 2] - past[i, 2]) / span
    R = sheet.turn
    for a in range(3):
        for b in range(3):
            R[a, b] = keep * past[i, 3 + 3 * a + b] + share * present[i, 3 + 3 * a + b]
    sa, sb, sc = ellipsoids.square[i, 0], ellipsoids.square[i, 1], ellipsoids.square[i, 2]
    deepest, total, closing = 0.0, 0.0, 0.0
    for m in range(sheet.number[i]):
        t = sheet.candidate[i, m]
        n = sheet.touched[t]
        sheet.depth[m] = 0.0
        dx, dy, dz = (
            nodes.position[n, 0] - cx,
            nodes.position[n, 1] - cy,
            nodes.position[n, 2] - cz,
        )
        qa = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        qb = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        qc = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        level = qa * qa / sa + qb * qb / sb + qc * qc / sc
        if level >= 1.0 or level < 0.01:
            continue
        size = math.sqrt(level)
        slope = math.sqrt((qa / sa) ** 2 + (qb / sb) ** 2 + (qc / sc) ** 2) / size
        depth = (1.0 - size) / slope
        sheet.depth[m] = depth
        total += sheet.area[t] * depth
        if depth > deepest:
            deepest = depth
            # Outward normal of the body, and how fast the node goes deeper.
            ga, gb, gc = qa / sa, qb / sb, qc / sc
            g = 1.0 / math.sqrt(ga * ga + gb * gb + gc * gc)
            nx = g * (R[0, 0] * ga + R[0, 1] * gb + R[0, 2] * gc)
            ny = g * (R[1, 0] * ga + R[1, 1] * gb + R[1, 2] * gc)
            nz = g * (R[2, 0] * ga + R[2, 1] * gb + R[2, 2] * gc)
            closing = (
                (ux + spin[1] * dz - spin[2] * dy - nodes.velocity[n, 0]) * nx
                + (uy + spin[2] * dx - spin[0] * dz - nodes.velocity[n, 1]) * ny
                + (uz + spin[0] * dy - spin[1] * dx - nodes.velocity[n, 2]) * nz
            )
    if deepest == 0.0:
        return
    sheet.largest[i] = max(sheet.largest[i], deepest)
    stiff = sheet.foundation[i]
    if stiff == 0.0:
        elastic, viscous = law_force(ellipsoids, law, deepest, closing, sheet.largest[i])
        stiff = (elastic + viscous) / total
    for m in range(sheet.number[i]):
        depth = sheet.depth[m]
        if depth == 0.0:
            continue
        t = sheet.candidate[i, m]
        n = sheet.touched[t]
        dx, dy, dz = (
            nodes.position[n, 0] - cx,
            nodes.position[n, 1] - cy,
            nodes.position[n, 2] - cz,
        )
        ga = (R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz) / sa
        gb = (R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz) / sb
        gc = (R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz) / sc
        g = 1.0 / math.sqrt(ga * ga + gb * gb + gc * gc)
        nx = g * (R[0, 0] * ga + R[0, 1] * gb + R[0, 2] * gc)
        ny = g * (R[1, 0] * ga + R[1, 1] * gb + R[1, 2] * gc)
        nz = g * (R[2, 0] * ga + R[2, 1] * gb + R[2, 2] * gc)
        # Velocity of the body's point against the node.
        sx = ux + spin[1] * dz - spin[2] * dy - nodes.velocity[n, 0]
        sy = uy + spin[2] * dx - spin[0] * dz - nodes.velocity[n, 1]
        sz = uz + spin[0] * dy - spin[1] * dx - nodes.velocity[n, 2]
        rate = sx * nx + sy * ny + sz * nz
        push = stiff * sheet.area[t] * depth
        if push <= 0.0:
            continue
        sx, sy, sz = sx - rate * nx, sy - rate * ny, sz - rate * nz
        slip = sx * sx + sy * sy + sz * sz
        drag = mu * push / math.sqrt(slip + SLIP_VELOCITY * SLIP_VELOCITY)
        drag = min(drag, STICKING * nodes.mass[n] / step)
        moved = depth
        for k in range(3):
            moved -= sheet.normal[k] * (nodes.position[n, k] - sheet.start[n, k])
        sheet.sunk[i] = max(sheet.sunk[i], moved)
        # On the node; the body takes the opposite.
        fx, fy, fz = push * nx + drag * sx, push * ny + drag * sy, push * nz + drag * sz
        nodes.force[n, 0] += fx
        nodes.force[n, 1] += fy
        nodes.force[n, 2] += fz
        sheet.pressed[t, 0] += fx
        sheet.pressed[t, 1] += fy
        sheet.pressed[t, 2] += fz
        sheet.account[SLID] += step * drag * slip
        J = sheet.impulse
        J[i, 0] -= fx
        J[i, 1] -= fy
        J[i, 2] -= fz
        J[i, 3] -= dy * fz - dz * fy
        J[i, 4] -= dz * fx - dx * fz
        J[i, 5] -= dx * fy - dy * fx
        J[i, 6] -= push * nx
        J[i, 7] -= push * ny
        J[i, 8] -= push * nz
        sheet.place[i, 0] += push * nodes.position[n, 0]
        sheet.place[i, 1] += push * nodes.position[n, 1]
        sheet.place[i, 2] += push * nodes.position[n, 2]
        sheet.place[i, 3] += push


@inlined_kernel
def follow_bodies(sheet, ellipsoids, mu, spins, time):
    """Step the sheet from its own time to another while the bodies move between their poses.

    Parameters
    ----------
    sheet : Sheet
        ``impulse`` becomes the mean loads on the segments.
    ellipsoids : Ellipsoids
        Surfaces of the segments and the laws of their flesh.
    mu : float
        Coefficient of friction.
    spins : (n, 3) array
        Angular velocities of the segments, frame of the sheet, rad/s.
    time : float
        s.
    """
    span = time - sheet.clock[NOW]
    count = max(math.ceil(span / sheet.step), 1)
    step = span / count
    segments = sheet.number.shape[0]
    road = ellipsoids.surface_law.shape[1] - 1
    for k in range(count):
        clear_loads(sheet.nodes)
        for e in range(sheet.shells.node.shape[0]):
            update_element(
                sheet.nodes, sheet.shells, sheet.materials, e, step, sheet.frame, sheet.local
            )
        sheet.account[PARTS] = apply_parts(
            sheet.nodes, sheet.start, sheet.ties, sheet.gaps, sheet.supports
        )
        for t in range(sheet.touched.shape[0]):
            for j in range(3):
                sheet.pressed[t, j] = 0.0
        for i in range(segments):
            if sheet.number[i] > 0:
                _press(
                    sheet, ellipsoids, i, ellipsoids.surface_law[i, road], mu,
                    (k + 1.0) / count, span, spins[i], step,
                )  # fmt: skip
        sheet.account[MOVING] = advance(sheet.nodes, step, step)
        for t in range(sheet.touched.shape[0]):
            n = sheet.touched[t]
            for j in range(3):
                # Velocity at the time of the force: half of its change lies before it.
                change = step * sheet.nodes.force[n, j] / sheet.nodes.mass[n]
                mean = sheet.nodes.velocity[n, j] - 0.5 * change
                sheet.account[WORK] += step * sheet.pressed[t, j] * mean
    sheet.clock[STEPS] += count
    for i in range(segments):
        for j in range(9):
            sheet.impulse[i, j] /= count
        sheet.impulse[i, 9] = math.sqrt(
            sheet.impulse[i, 6] ** 2 + sheet.impulse[i, 7] ** 2 + sheet.impulse[i, 8] ** 2
        )
        if sheet.impulse[i, 9] > LIGHT:
            sheet.clock[LAST_CONTACT] = time
    for t in range(sheet.touched.shape[0]):
        n = sheet.touched[t]
        moved = 0.0
        for k in range(3):
            moved -= sheet.normal[k] * (sheet.nodes.position[n, k] - sheet.start[n, k])
        sheet.lowest[t] = max(sheet.lowest[t], moved)
