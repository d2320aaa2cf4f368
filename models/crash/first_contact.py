"""Start of a crash: initial overlaps of the segments, and the position of first contact."""

import numpy as np

from models.compilation import kernel
from models.contact.geometry import ellipsoid_direction
from models.crash.front import patch_count, separation_of, survey
from models.crash.surfaces import shape_of

SEARCH_AHEAD = 1.5
"""m ahead of the car at which the search for first contact starts."""
SEARCH_BEHIND = -0.6
"""m behind the car's foremost point where the search for first contact ends."""


@kernel
def widen_gaps(ellipsoids, contacts):
    """Widen the gap of every pair of segments to their present overlap.

    Neighbouring ellipsoids overlap at rest; only a larger overlap is contact.
    """
    for k in range(ellipsoids.pairs.shape[0]):
        i, j = ellipsoids.pairs[k, 0], ellipsoids.pairs[k, 1]
        _, _, _, separation = ellipsoid_direction(
            contacts.centre[i, 0] - contacts.centre[j, 0],
            contacts.centre[i, 1] - contacts.centre[j, 1],
            contacts.centre[i, 2] - contacts.centre[j, 2],
            shape_of(contacts, i),
            shape_of(contacts, j),
            0.0,
            0.0,
            0.0,
        )
        ellipsoids.pair_gap[k] = max(ellipsoids.pair_gap[k], -separation)


@kernel
def _touches(front, ellipsoids, motion, contacts, shift):
    for i in range(ellipsoids.reach.shape[0]):
        if ellipsoids.surface_law[i, 0] < 0:
            continue
        x, y, z = contacts.centre[i, 0] + shift, contacts.centre[i, 1], contacts.centre[i, 2]
        survey(front, ellipsoids, motion, i, x, y, z, 1.0, 0.0)
        for j in range(patch_count(front)):
            found = separation_of(front, ellipsoids, contacts, j, i, x, y, z, 1.0, 0.0)
            if found[0] < 0.0 and found[7] > 0.0:
                return True
    return False


@kernel
def first_contact_shift(front, ellipsoids, motion, contacts):
    """Return the shift in x (m) that brings the body just into contact with the car, or NaN.

    Parameters
    ----------
    front : named tuple
        Geometry of the car's front, one of the types in ``FRONTS``.
    ellipsoids : Ellipsoids
        Surfaces of the segments and their contact laws.
    motion : Motion
        Positions of the segments.
    contacts : Contacts
        Ellipsoid centres and shapes; unchanged.
    """
    clear, step = SEARCH_AHEAD, 0.02
    while not _touches(front, ellipsoids, motion, contacts, clear - step):
        clear -= step
        if clear < SEARCH_BEHIND:
            return np.nan
    low, high = clear - step, clear
    for _ in range(40):
        middle = 0.5 * (low + high)
        if _touches(front, ellipsoids, motion, contacts, middle):
            low = middle
        else:
            high = middle
    return high
