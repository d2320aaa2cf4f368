"""Shells that bodies press on: their motion between two poses of the bodies.

The bodies' surfaces move straight from pose to pose, in some tens of the shells' own steps; the
impulses on them, over the time between, are the loads that they feel. A stiff body (the head)
presses by an elastic foundation, any other by the law of its flesh at its deepest node, shared out
over the nodes by their depth and area.

A group of shells is stepped from the first contact near it until the loads on it have been light
for a while; at rest it is a rigid surface.
"""

import math

from models.compilation import inlined_kernel, kernel
from models.contact.friction import SLIP_VELOCITY, STICKING
from models.crash.sheet import (
    FRESH,
    NOW,
    RESTING,
    SHOT,
    SHOTS,
    SLID,
    STEPPED,
    STEPS,
    STOPPED,
    TAKEN,
    WORK,
)
from models.crash.surfaces import law_force
from models.shells.assembly import NODES, TOUCHED, displacement_of, load_groups, move_groups

MARGIN = 0.03
"""Distance (m) between poses within which a node can come into contact (assumed, far more than the
travel of a step)."""
AWAKE = 0.01
"""Distance (m) of a body from a group at rest at which it begins to be stepped (assumed, far more
than the travel of a step)."""
DEEPEST = 0.2
"""Displacement (m) of a group beyond its space at rest that is looked at (assumed)."""
CALMING = 0.01
"""Time (s) over which the force on a group is averaged (assumed)."""
LIGHT = 200.0
"""Mean force (N) on a group below which it is stepped no more (assumed): a limb that drags over the
hood does not dent it."""
BLOW = 500.0
"""Force (N) at which a group at rest is stepped again, and its mean force when it is woken
(assumed)."""


@inlined_kernel
def _is_near(sheet, ellipsoids, g, i):
    """Return whether a segment's ellipsoid comes near a node of a group, to first order."""
    present, body = sheet.present, sheet.body
    sa, sb, sc = ellipsoids.square[i, 0], ellipsoids.square[i, 1], ellipsoids.square[i, 2]
    size = math.sqrt(max(sa, max(sb, sc)))
    for k in range(3):
        c = present[i, k]
        if not sheet.box[g, 0, k] - size - AWAKE < c < sheet.box[g, 1, k] + size + AWAKE:
            return False
    for t in range(body.first[TOUCHED, g], body.first[TOUCHED, g + 1]):
        n = body.touched[t]
        dx = body.nodes.position[n, 0] - present[i, 0]
        dy = body.nodes.position[n, 1] - present[i, 1]
        dz = body.nodes.position[n, 2] - present[i, 2]
        qa = present[i, 3] * dx + present[i, 6] * dy + present[i, 9] * dz
        qb = present[i, 4] * dx + present[i, 7] * dy + present[i, 10] * dz
        qc = present[i, 5] * dx + present[i, 8] * dy + present[i, 11] * dz
        level = qa * qa / sa + qb * qb / sb + qc * qc / sc
        if level < 1.0:
            return True
        length = math.sqrt(level)
        slope = math.sqrt((qa / sa) ** 2 + (qb / sb) ** 2 + (qc / sc) ** 2) / length
        # The node's area is as near as its place.
        if (length - 1.0) / slope < AWAKE + 0.5 * math.sqrt(body.area[t]):
            return True
    return False


@kernel
def wake_groups(sheet, ellipsoids):
    """Wake the fresh groups that a segment comes near, and return whether any is not fresh.

    Parameters
    ----------
    sheet : Sheet
    ellipsoids : Ellipsoids
        Surfaces of the segments.
    """
    any_used = False
    for g in range(sheet.state.shape[0]):
        if sheet.state[g] == FRESH:
            for i in range(sheet.number.shape[0]):
                if _is_near(sheet, ellipsoids, g, i):
                    sheet.state[g] = STEPPED
                    sheet.body.awake[g] = True
                    sheet.mean[g] = BLOW
                    break
        any_used |= sheet.state[g] != FRESH
    return any_used


@inlined_kernel
def _put_to_rest(sheet, g):
    """Stop a group where it is."""
    body = sheet.body
    sheet.state[g] = RESTING
    body.awake[g] = False
    sheet.account[STOPPED] += body.moving[g]
    body.moving[g] = 0.0
    for n in range(body.first[NODES, g], body.first[NODES, g + 1]):
        for k in range(3):
            body.nodes.velocity[n, k] = 0.0
            body.nodes.spin[n, k] = 0.0


@kernel
def find_candidates(sheet, reach):
    """List the nodes of groups not fresh that each segment can touch until the next pose.

    Parameters
    ----------
    sheet : Sheet
    reach : (n,) array
        Largest distance of the segments' surfaces from their centres, m.
    """
    body = sheet.body
    for i in range(reach.shape[0]):
        found = 0
        far = reach[i] + MARGIN
        for g in range(sheet.state.shape[0]):
            near = sheet.state[g] != FRESH
            for k in range(3):
                c = sheet.present[i, k]
                near &= sheet.box[g, 0, k] - far - DEEPEST < c < sheet.box[g, 1, k] + far
            if not near:
                continue
            for t in range(body.first[TOUCHED, g], body.first[TOUCHED, g + 1]):
                n = body.touched[t]
                square = 0.0
                for k in range(3):
                    square += (body.nodes.position[n, k] - sheet.present[i, k]) ** 2
                if square < far * far:
                    sheet.candidate[i, found] = t
                    found += 1
        sheet.number[i] = found


@inlined_kernel
def _press(sheet, ellipsoids, i, law, mu, share, span, spin, step):
    """Press a segment, at a share of the way between its poses, on the sheet.

    ``span`` is the time between the poses, ``spin`` (3,) the segment's angular velocity.
    """
    past, present, body = sheet.past, sheet.present, sheet.body
    nodes = body.nodes
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
        n = body.touched[t]
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
        total += body.area[t] * depth
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
        n = body.touched[t]
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
        push = stiff * body.area[t] * depth
        if push <= 0.0:
            continue
        sx, sy, sz = sx - rate * nx, sy - rate * ny, sz - rate * nz
        slip = sx * sx + sy * sy + sz * sz
        drag = mu[body.region[t]] * push / math.sqrt(slip + SLIP_VELOCITY * SLIP_VELOCITY)
        drag = min(drag, STICKING * nodes.mass[n] / step)
        moved = depth + displacement_of(body, t)
        if moved > sheet.sunk[i]:
            sheet.sunk[i], sheet.sunk_at[i] = moved, t
        # On the node; the body takes the opposite.
        fx, fy, fz = push * nx + drag * sx, push * ny + drag * sy, push * nz + drag * sz
        nodes.force[n, 0] += fx
        nodes.force[n, 1] += fy
        nodes.force[n, 2] += fz
        sheet.pressed[t, 0] += fx
        sheet.pressed[t, 1] += fy
        sheet.pressed[t, 2] += fz
        sheet.account[SLID] += step * drag * slip
        sheet.load[i, sheet.group[t]] += push
        region = body.region[t]
        J, place = sheet.impulse, sheet.place
        J[i, region, 0] -= fx
        J[i, region, 1] -= fy
        J[i, region, 2] -= fz
        J[i, region, 3] -= dy * fz - dz * fy
        J[i, region, 4] -= dz * fx - dx * fz
        J[i, region, 5] -= dx * fy - dy * fx
        J[i, region, 6] -= push * nx
        J[i, region, 7] -= push * ny
        J[i, region, 8] -= push * nz
        place[i, region, 0] += push * nodes.position[n, 0]
        place[i, region, 1] += push * nodes.position[n, 1]
        place[i, region, 2] += push * nodes.position[n, 2]
        place[i, region, 3] += push


@kernel
def follow_bodies(sheet, ellipsoids, mu, spins, time):
    """Step the shells from their own time to another while the bodies move between their poses.

    Parameters
    ----------
    sheet : Sheet
        ``impulse`` becomes the mean loads on the segments.
    ellipsoids : Ellipsoids
        Surfaces of the segments and the laws of their flesh.
    mu : (regions,) array
        Coefficients of friction.
    spins : (n, 3) array
        Angular velocities of the segments, frame of the sheet, rad/s.
    time : float
        s.
    """
    body = sheet.body
    nodes = body.nodes
    span = time - sheet.clock[NOW]
    # Groups at rest are still: their loads are those at the present pose.
    count = max(math.ceil(span / body.step), 1) if body.awake.any() else 1
    step = span / count
    segments, regions = sheet.number.shape[0], sheet.impulse.shape[1]
    groups = sheet.state.shape[0]
    road = ellipsoids.surface_law.shape[1] - 1
    for k in range(count):
        load_groups(body, step)
        for t in range(body.touched.shape[0]):
            if body.awake[sheet.group[t]]:
                for j in range(3):
                    sheet.pressed[t, j] = 0.0
        for i in range(segments):
            if sheet.number[i] > 0:
                _press(
                    sheet, ellipsoids, i, ellipsoids.surface_law[i, road], mu,
                    (k + 1.0) / count, span, spins[i], step,
                )  # fmt: skip
        move_groups(body, step, step)
        for g in range(groups):
            if not body.awake[g]:
                continue
            for t in range(body.first[TOUCHED, g], body.first[TOUCHED, g + 1]):
                n = body.touched[t]
                for j in range(3):
                    # Velocity at the time of the force: half of its change lies before it.
                    change = step * nodes.force[n, j] / nodes.mass[n]
                    mean = nodes.velocity[n, j] - 0.5 * change
                    sheet.account[WORK] += step * sheet.pressed[t, j] * mean
    sheet.clock[STEPS] += count
    for i in range(segments):
        for r in range(regions):
            for j in range(9):
                sheet.impulse[i, r, j] /= count
            sheet.impulse[i, r, 9] = math.sqrt(
                sheet.impulse[i, r, 6] ** 2
                + sheet.impulse[i, r, 7] ** 2
                + sheet.impulse[i, r, 8] ** 2
            )
    for g in range(groups):
        force = 0.0
        for i in range(segments):
            force += sheet.load[i, g] / count
        sheet.mean[g] += min(span / CALMING, 1.0) * (force - sheet.mean[g])
        if sheet.state[g] == RESTING and force > BLOW:
            sheet.state[g], body.awake[g] = STEPPED, True
            sheet.mean[g] = force
        if sheet.state[g] == STEPPED:
            for t in range(body.first[TOUCHED, g], body.first[TOUCHED, g + 1]):
                sheet.lowest[t] = max(sheet.lowest[t], displacement_of(body, t))
            if sheet.mean[g] < LIGHT:
                _put_to_rest(sheet, g)


@kernel
def take_picture(sheet, time):
    """Add the present shape to the film if it is time for it."""
    body, row = sheet.body, int(sheet.clock[TAKEN])
    if row == SHOTS or (row > 0 and time < sheet.film_time[row - 1] + SHOT):
        return
    for t in range(body.touched.shape[0]):
        n = body.touched[t]
        for k in range(3):
            sheet.film[row, t, k] = body.nodes.position[n, k] - body.start[n, k]
    sheet.film_time[row] = time
    sheet.clock[TAKEN] += 1


@kernel
def clear_impulses(sheet):
    """Set the loads on the segments to zero."""
    for i in range(sheet.impulse.shape[0]):
        for r in range(sheet.impulse.shape[1]):
            for j in range(10):
                sheet.impulse[i, r, j] = 0.0
            for j in range(4):
                sheet.place[i, r, j] = 0.0
        for g in range(sheet.load.shape[1]):
            sheet.load[i, g] = 0.0
