"""The Pymunk space of a crash: segments, joints, road, and the car as a kinematic body.

Pymunk solves the joints and the contact with the road; forces of deformation (car, flesh, joint
stops) are computed outside and set before every step.
"""

import math
from typing import NamedTuple

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk.batch import BodyFields, Buffer, get_space_bodies

from models.contact.road import Road
from models.crash.ellipsoids import Ellipsoids
from models.planar.body import PlanarBody, outline
from models.planar.chipmunk import READ_BODY, WRITE_BODY, address_of, transfer
from models.planar.joints import PlanarJoints

Array = NDArray[np.float64]

ITERATIONS = 10
"""Sweeps of Pymunk's solver per step over joints and contacts; a hundred move HIC15 by 0.1 %."""
JOINT_RELAXATION = 0.005
"""Relaxation time (s) of a joint that has drifted (assumed)."""
CONTACT_RELAXATION = 0.02
"""Relaxation time (s) of an overlap with the road (assumed)."""
SLOP = 1e-3
"""m of overlap with the road that Pymunk leaves."""
CORNERS = 16
"""Corners of the polygon for a segment's projection; its error is 1 % of the width."""
REACH = 600.0
"""m of road ahead and behind: the fastest car of the inputs, over the time limit."""
THICKNESS = 1.0
"""m of road."""

# Columns of a body's state.
X, Z, ANGLE, SPEED_X, SPEED_Z, SPIN = range(6)
STATE = 6
# Columns of what is written to a body before a step: its velocity again, or the car's new one.
GIVEN_X, GIVEN_Z, FORCE_X, FORCE_Z, TORQUE = range(5)
GIVEN = 5

_STATE_FIELDS = (
    BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
)
_GIVEN_FIELDS = BodyFields.VELOCITY | BodyFields.FORCE | BodyFields.TORQUE


class Link(NamedTuple):
    """A space as used by the compiled step loop: addresses, and positions in the two arrays.

    Attributes
    ----------
    space : int
        Address of the space.
    reader, read_data : int
        Addresses of the transfer into ``state``.
    read_place : (1,) array
        Its index of the next value.
    writer, write_data : int
        Addresses of the transfer out of ``given``.
    write_place : (1,) array
        Its index of the next value.
    car : int
        Row of the car.
    """

    space: int
    reader: int
    read_data: int
    read_place: NDArray[np.int32]
    writer: int
    write_data: int
    write_place: NDArray[np.int32]
    car: int


class PlanarSpace:
    """A new space for one crash.

    Pymunk numbers bodies and keeps contacts from step to step, so a space that has been used gives
    different bits: every run builds its own.

    Parameters
    ----------
    body : PlanarBody
    joints : PlanarJoints
    road : Road
    ellipsoids : Ellipsoids
        Give the energy that flesh returns.
    speed : float
        Speed of the car at first contact, m/s.

    Attributes
    ----------
    state : (b, 6) array
        x, z (m), angle (rad) and their rates of all bodies, segments first.
    space : pymunk.Space
    given : (b, 5) array
        Velocity (m/s), force (N) and torque (N m) for the next step.
    link : Link
    """

    def __init__(
        self,
        body: PlanarBody,
        joints: PlanarJoints,
        road: Road,
        ellipsoids: Ellipsoids,
        speed: float,
    ) -> None:
        self.space = space = pymunk.Space()
        space.gravity = road.gravity_along, -road.gravity_down
        space.iterations = ITERATIONS
        space.collision_slop = SLOP
        space.collision_bias = math.exp(-1.0 / CONTACT_RELAXATION)
        segments = [_segment(body, i) for i in range(body.mass.size)]
        space.add(*segments)
        car = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        car.velocity = speed, 0.0
        space.add(car)
        for i, parent in enumerate(body.parent):
            if parent >= 0:
                held = None if joints.yields[i] else body.joint[i]
                space.add(*_joint(segments[parent], segments[i], held, joints, i))
        for i, segment in enumerate(segments):
            shape = pymunk.Poly(segment, outline(body, i, CORNERS))
            shape.friction = 1.0
            shape.elasticity = _restitution(ellipsoids, i)
            # Segments and car meet by their own laws, not by Pymunk's.
            shape.filter = pymunk.ShapeFilter(group=1)
            space.add(shape)
        space.add(*_road(space.static_body, road))
        buffer, loads = Buffer(), Buffer()
        get_space_bodies(space, BodyFields.BODY_ID, buffer)
        rows = np.frombuffer(buffer.int_buf(), dtype=np.uintp).tolist()
        row = rows.index(car.id)
        if rows[: len(segments)] != [segment.id for segment in segments]:
            raise RuntimeError("Pymunk does not give the bodies in the order in which they came")
        # From here on the buffer keeps its place: it holds all bodies.
        get_space_bodies(space, _STATE_FIELDS, buffer)
        self.state: Array = np.frombuffer(buffer.float_buf()).reshape(-1, STATE)
        self.given: Array = np.zeros((len(rows), GIVEN))
        loads.set_float_buf(self.given)
        self._read, self._write = transfer(buffer, _STATE_FIELDS), transfer(loads, _GIVEN_FIELDS)
        self.link = Link(
            address_of(space), READ_BODY, self._read.data, self._read.place,
            WRITE_BODY, self._write.data, self._write.place, row,
        )  # fmt: skip


def _segment(body: PlanarBody, i: int) -> pymunk.Body:
    segment = pymunk.Body(float(body.mass[i]), float(body.inertia[i]))
    segment.position = float(body.centre[i, 0]), float(body.centre[i, 1])
    segment.velocity = float(body.velocity[i, 0]), float(body.velocity[i, 1])
    segment.angular_velocity = float(body.spin[i])
    return segment


def _joint(
    parent: pymunk.Body,
    child: pymunk.Body,
    place: Array | None,
    joints: PlanarJoints,
    row: int,
) -> list[pymunk.Constraint]:
    """Return pivot, damper and friction of a joint; its springs and stops are applied from outside.

    A joint that yields has no position and no pivot.
    """
    damper = pymunk.DampedRotarySpring(parent, child, 0.0, 0.0, float(joints.damping[row]))
    held: list[pymunk.Constraint] = [damper]
    if place is not None:
        pivot = pymunk.PivotJoint(parent, child, (float(place[0]), float(place[1])))
        pivot.error_bias = math.exp(-1.0 / JOINT_RELAXATION)
        held.insert(0, pivot)
    if joints.friction[row] > 0.0:
        brake = pymunk.SimpleMotor(parent, child, 0.0)
        brake.max_force = float(joints.friction[row])
        held.append(brake)
    return held


def _restitution(ellipsoids: Ellipsoids, segment: int) -> float:
    """Return the coefficient of restitution of a segment on the road.

    It is the root of the returned share of the energy in the law against the road, at its last
    knot.
    """
    law = int(ellipsoids.surface_law[segment, -1])
    last = int(ellipsoids.counts[law]) - 1
    depth, _, recovery, _ = ellipsoids.laws[law, last]
    return math.sqrt(min(float(recovery / depth), 1.0))


def _road(ground: pymunk.Body, road: Road) -> list[pymunk.Shape]:
    """Return the shapes of the road: one, or two if its friction changes at some distance."""
    change = min(max(road.wet_from, -REACH), REACH)
    parts = [(-REACH, change, road.friction), (change, REACH, road.wet_friction)]
    shapes: list[pymunk.Shape] = []
    for low, high, friction in parts:
        if high > low:
            corners = [(low, 0.0), (high, 0.0), (high, -THICKNESS), (low, -THICKNESS)]
            shape = pymunk.Poly(ground, corners)
            shape.friction, shape.elasticity = friction, 1.0
            shapes.append(shape)
    return shapes
