"""Shells of a car's front in a crash: their state, what bodies do to them, and their film."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.shells.assembly import NODES, TOUCHED, Assembly

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SHOT, SHOTS = 2e-3, 150
"""Time (s) between the pictures of a film, and their largest number; the last one stays."""
# Entries of the clock.
NOW, STEPS, TAKEN = range(3)
# States of a group.
FRESH, STEPPED, RESTING = range(3)
# Entries of the account (J): work of the bodies on the shells awake, friction, motion stopped.
WORK, SLID, STOPPED = range(3)


class Sheet(NamedTuple):
    """Shells in the frame of the static car, and what bodies do to them.

    Attributes
    ----------
    body : Assembly
        The shells.
    pressed : (t, 3) array
        Force of the bodies on each touched node at present, N.
    group : (t,) array of int
        Group of each touched node.
    box : (groups, 2, 3) array
        Corners of the space of each group, m.
    foundation : (n,) array
        Elastic foundation of each segment, Pa/m; 0 for the law of its flesh.
    clock : (3,) array
        Time reached (s), steps, pictures of the film.
    state : (groups,) array of int
        FRESH, STEPPED or RESTING.
    mean : (groups,) array
        Mean force of the bodies, N.
    past, present : (n, 12) array
        Centres and rotations of the segments at both poses.
    turn : (3, 3) array
        Workspace.
    candidate : (n, t) array of int
        Touched nodes that a segment can touch until the next pose.
    number : (n,) array of int
        Number of them.
    depth : (t,) array
        Workspace.
    impulse : (n, regions, 10) array
        Force, torque about the centre, normal force and its size, by segment and region, as sums
        over the steps and then means, N and N m.
    place : (n, regions, 4) array
        Sum of the normal force times the place of contact, and of the force.
    load : (n, groups) array
        Sum of the normal forces on each group over the steps, N.
    largest : (n,) array
        Largest depth of a segment in the shells' surface so far, m.
    sunk : (n,) array
        Largest depth so far with the displacement of the shells, m.
    sunk_at : (n,) array of int
        Touched node at which that was.
    account : (3,) array
        J.
    lowest : (t,) array
        Largest displacement of each touched node into the car, m.
    film : (f, t, 3) array of float32
        Displacements of the touched nodes at times, m.
    film_time : (f,) array
        s.
    """

    body: Assembly
    pressed: Array
    group: Index
    box: Array
    foundation: Array
    clock: Array
    state: Index
    mean: Array
    past: Array
    present: Array
    turn: Array
    candidate: Index
    number: Index
    depth: Array
    impulse: Array
    place: Array
    load: Array
    largest: Array
    sunk: Array
    sunk_at: Index
    account: Array
    lowest: Array
    film: NDArray[np.float32]
    film_time: Array


def build_sheet(body: Assembly, foundation: Array, regions: int) -> Sheet:
    """Return shells at rest that bodies press on.

    Parameters
    ----------
    body : Assembly
    foundation : (n,) array
        Elastic foundation of each segment, Pa/m; 0 for the law of its flesh.
    regions : int
        Number of the car's zones.
    """
    segments, groups, touched = len(foundation), len(body.awake), len(body.touched)
    first = body.first[NODES]
    spaces = [body.start[first[g] : first[g + 1]] for g in range(groups)]
    return Sheet(
        body=body, pressed=np.zeros((touched, 3)),
        group=np.repeat(np.arange(groups), np.diff(body.first[TOUCHED])),
        box=np.array([[space.min(axis=0), space.max(axis=0)] for space in spaces]),
        foundation=foundation, clock=np.zeros(3), state=np.zeros(groups, dtype=np.int64),
        mean=np.zeros(groups), past=np.zeros((segments, 12)), present=np.zeros((segments, 12)),
        turn=np.zeros((3, 3)), candidate=np.zeros((segments, touched), dtype=np.int64),
        number=np.zeros(segments, dtype=np.int64), depth=np.zeros(touched),
        impulse=np.zeros((segments, regions, 10)), place=np.zeros((segments, regions, 4)),
        load=np.zeros((segments, groups)), largest=np.zeros(segments), sunk=np.zeros(segments),
        sunk_at=np.zeros(segments, dtype=np.int64), account=np.zeros(3), lowest=np.zeros(touched),
        film=np.zeros((SHOTS, touched, 3), dtype=np.float32), film_time=np.zeros(SHOTS),
    )  # fmt: skip


def booked_energy(sheet: Sheet) -> float:
    """Return all energy that the shells have taken in, J."""
    body = sheet.body
    return float(
        body.shells.energy.sum() + body.moving.sum() + body.stored.sum() + sheet.account[STOPPED]
    )


def keep_shape(sheet: Sheet, time: float) -> None:
    """Make the present shape the last picture of the film, from a time (s) on."""
    row = min(int(sheet.clock[TAKEN]), SHOTS - 1)
    moved = sheet.body.nodes.position - sheet.body.start
    sheet.film[row] = moved[sheet.body.touched]
    sheet.film_time[row] = time
    sheet.clock[TAKEN] = row + 1


def shapes_of(sheet: Sheet) -> tuple[Array, Array]:
    """Return times (f,) in s and places (f, t, 3) in m of the touched nodes, from rest on.

    Parameters
    ----------
    sheet : Sheet
    """
    taken = int(sheet.clock[TAKEN])
    start = sheet.body.start[sheet.body.touched]
    shapes = np.concatenate([start[None], start + sheet.film[:taken]])
    return np.concatenate([[0.0], sheet.film_time[:taken]]), shapes
