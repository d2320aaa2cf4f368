"""The car's front as a seam of the physics: what every geometry of it answers.

Contact, first contact and the choice of step ask the front, not its zones. A front is a named tuple
of arrays; its type chooses, when the kernels are compiled, the functions that answer. A new
geometry (a surface of facets, a patch that deforms) is a named tuple, these functions for it, and
one line in ``FRONTS``.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.extending import overload

from models.compilation import MERGED_FLAGS
from models.crash import zone_front
from models.vehicle.zones import Zones


class Answers(NamedTuple):
    """The functions by which a front answers; see those of the same name in this module.

    Attributes
    ----------
    patch_count, is_near, is_across, separation_of, are_joined, friction_of, ploughing_of, react :
        compiled functions.
    """

    patch_count: Callable[..., Any]
    is_near: Callable[..., Any]
    is_across: Callable[..., Any]
    separation_of: Callable[..., Any]
    are_joined: Callable[..., Any]
    friction_of: Callable[..., Any]
    ploughing_of: Callable[..., Any]
    react: Callable[..., Any]


FRONTS: dict[type, Answers] = {
    Zones: Answers(
        patch_count=zone_front.zone_count,
        is_near=zone_front.zone_is_near,
        is_across=zone_front.zone_is_across,
        separation_of=zone_front.zone_separation,
        are_joined=zone_front.zones_are_joined,
        friction_of=zone_front.zone_friction,
        ploughing_of=zone_front.zone_ploughing,
        react=zone_front.zone_reaction,
    ),
}
"""By the type of a front how it answers."""


def _answered(question):
    """Let the type of the front choose which of its functions is compiled into a caller."""

    @overload(question, jit_options=MERGED_FLAGS)
    def _choose(front, *rest):
        answer = getattr(FRONTS[front.instance_class], question.__name__)
        return lambda front, *rest: answer(front, *rest)

    return question


@_answered
def patch_count(front):
    """Return the number of patches that are asked one after the other."""
    raise NotImplementedError("compiled code only")


@_answered
def is_near(front, patch, margin, x, z):
    """Return whether a point (m, car frame) lies within ``margin`` of a patch in side view."""
    raise NotImplementedError("compiled code only")


@_answered
def is_across(front, patch, margin, y):
    """Return whether a point lies within ``margin`` (m) of the width of a patch."""
    raise NotImplementedError("compiled code only")


@_answered
def separation_of(front, ellipsoids, contacts, patch, segment, cx, cy, cz, cosine, sine):
    """Return separation, normal, contact point, weight and region of a segment and a patch."""
    raise NotImplementedError("compiled code only")


@_answered
def are_joined(front, patch, other):
    """Return whether what slides from one patch to another stays in contact."""
    raise NotImplementedError("compiled code only")


@_answered
def friction_of(front, region):
    """Return the coefficient of friction of a region."""
    raise NotImplementedError("compiled code only")


@_answered
def ploughing_of(front, region):
    """Return the share of a lasting dent's resistance against slip in a region."""
    raise NotImplementedError("compiled code only")


@_answered
def react(front, patch, px, py, pz, fx, fy, fz):
    """Take the force (N, world axes) of a segment on a patch at a point (m, car frame)."""
    raise NotImplementedError("compiled code only")
