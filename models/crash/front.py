"""The car's front as an interface: the functions that every front geometry must provide.

Contact, first contact and the choice of step call the front, not its zones. A front is a named
tuple of arrays; its type selects, when the kernels are compiled, the functions that are called. A
new geometry (a surface of facets, a patch that deforms) is a named tuple, these functions for it,
and one line in ``FRONTS``.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from numba.extending import overload

from models.compilation import MERGED_FLAGS
from models.crash import facet_front, facet_survey, sheet_front, zone_front
from models.crash.facet_front import FacetFront
from models.crash.sheet_front import SheetFront
from models.vehicle.zones import Zones


class Answers(NamedTuple):
    """The functions of a front geometry; see those of the same name in this module.

    Attributes
    ----------
    prepare, carry, patch_count, reach_of, survey, may_touch, is_near, separation_of : callable
        Compiled functions.
    pressure_point, are_joined, friction_of, ploughing_of, react : callable
        Compiled functions.
    """

    prepare: Callable[..., Any]
    carry: Callable[..., Any]
    patch_count: Callable[..., Any]
    reach_of: Callable[..., Any]
    survey: Callable[..., Any]
    may_touch: Callable[..., Any]
    is_near: Callable[..., Any]
    separation_of: Callable[..., Any]
    pressure_point: Callable[..., Any]
    are_joined: Callable[..., Any]
    friction_of: Callable[..., Any]
    ploughing_of: Callable[..., Any]
    react: Callable[..., Any]


FRONTS: dict[type, Answers] = {
    Zones: Answers(
        prepare=zone_front.nothing_to_prepare,
        carry=zone_front.nothing_to_carry,
        patch_count=zone_front.zone_count,
        reach_of=zone_front.zone_reach,
        survey=zone_front.zone_survey,
        may_touch=zone_front.zone_may_touch,
        is_near=zone_front.zone_is_near,
        separation_of=zone_front.zone_separation,
        pressure_point=zone_front.zone_pressure_point,
        are_joined=zone_front.zones_are_joined,
        friction_of=zone_front.zone_friction,
        ploughing_of=zone_front.zone_ploughing,
        react=zone_front.zone_reaction,
    ),
    FacetFront: Answers(
        prepare=zone_front.nothing_to_prepare,
        carry=zone_front.nothing_to_carry,
        patch_count=facet_front.facet_count,
        reach_of=facet_survey.facet_reach,
        survey=facet_survey.facet_survey,
        may_touch=facet_front.facet_may_touch,
        is_near=facet_front.facet_is_near,
        separation_of=facet_front.facet_separation,
        pressure_point=facet_front.facet_pressure_point,
        are_joined=facet_front.facets_are_joined,
        friction_of=facet_front.facet_friction,
        ploughing_of=facet_front.facet_ploughing,
        react=facet_front.facet_reaction,
    ),
}
FRONTS[SheetFront] = FRONTS[FacetFront]._replace(
    prepare=sheet_front.sheet_prepare,
    carry=sheet_front.sheet_carry,
    may_touch=sheet_front.sheet_may_touch,
    separation_of=sheet_front.sheet_separation,
)
"""Functions of each front geometry, by its type; a sheet answers as facets but for its own."""


def _answered(question):
    """Select, by the type of the front, the function that is compiled into a caller."""

    @functools.wraps(question)
    def stub(*_arguments):
        raise NotImplementedError(f"{question.__name__} is for compiled code only")

    @overload(stub, jit_options=MERGED_FLAGS)
    def _choose(front, *rest):
        answer = getattr(FRONTS[front.instance_class], question.__name__)
        return lambda front, *rest: answer(front, *rest)

    return stub


@_answered
def prepare(front, ellipsoids, car, cosine, sine, motion, contacts, time):
    """Advance a front with a state of its own to a time.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front; its state is changed.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    cosine, sine : float
        Of the car's yaw.
    motion : Motion
        Positions and velocities of the segments.
    contacts : Contacts
        Centres of the ellipsoids.
    time : float
        s.
    """


@_answered
def carry(front, car, cosine, sine, motion, loads, contacts, power, segment):
    """Add to a segment the loads of a front with a state of its own.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    car : (6,) array
        x, y (m) and yaw (rad) of the car's frame and their rates.
    cosine, sine : float
        Of the car's yaw.
    motion : Motion
        Positions and velocities of the segments.
    loads : Loads
        Increased in place.
    contacts : Contacts
        Forces, points and normals are set.
    power : (channels,) array
        Power (W) on the body by work channel; increased in place.
    segment : int
        Row of the segment.
    """


@_answered
def patch_count(front):
    """Return the number of patches of a front."""


@_answered
def reach_of(front, ellipsoids, segment):
    """Return the largest distance (m) of a segment's surface from its ellipsoid's centre."""


@_answered
def survey(front, ellipsoids, motion, segment, cx, cy, cz, cosine, sine):
    """Look at a segment as a whole before its patches are asked for.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front; its workspace is filled.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions and velocities of the segments.
    segment : int
        Row of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.
    """


@_answered
def may_touch(front, patch, reach, x, z):
    """Return whether the surveyed segment can be in contact with a patch.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    patch : int
        Row of the patch.
    reach : float
        Largest distance of the segment's surface from its centre, m.
    x, z : float
        Ellipsoid centre in the car's frame, m.
    """


@_answered
def is_near(front, patch, margin, x, y, z):
    """Return whether a point lies within a margin of a patch.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    patch : int
        Row of the patch.
    margin : float
        m.
    x, y, z : float
        Point in the car's frame, m.
    """


@_answered
def separation_of(front, ellipsoids, contacts, patch, segment, cx, cy, cz, cosine, sine):
    """Return the separation of a segment from a patch, with the contact geometry.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    contacts : Contacts
        State and results of the contacts.
    patch, segment : int
        Rows of the patch and of the segment.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.
    cosine, sine : float
        Of the car's yaw.

    Returns
    -------
    tuple of float
        ``(separation, nx, ny, nz, px, py, pz, weight, region)``: separation (m, negative in
        contact), normal and deepest point (m) in the car's frame, weight 0 to 1 of the force, and
        region whose law applies.
    """


@_answered
def pressure_point(front, patch, share, flesh, px, py, pz, cx, cy, cz):
    """Return the point at which the force of a patch on the surveyed segment acts.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    patch : int
        Row of the patch.
    share : float
        From ``models.contact.dent.pressure_share``.
    flesh : float
        Penetration of the segment's flesh, m.
    px, py, pz : float
        Deepest point in the car's frame, m.
    cx, cy, cz : float
        Ellipsoid centre in the car's frame, m.

    Returns
    -------
    x, y, z : float
        In the car's frame, m.
    """


@_answered
def are_joined(front, patch, other):
    """Return whether a segment that slides from one patch to another stays in contact.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    patch, other : int
        Rows of the patches.
    """


@_answered
def friction_of(front, region):
    """Return the coefficient of friction of a region."""


@_answered
def ploughing_of(front, region):
    """Return the share of the ploughing resistance of a lasting dent in a region."""


@_answered
def react(front, patch, px, py, pz, fx, fy, fz):
    """Apply the force of a segment to a patch.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front.
    patch : int
        Row of the patch.
    px, py, pz : float
        Point of application in the car's frame, m.
    fx, fy, fz : float
        Force in world axes, N.
    """
