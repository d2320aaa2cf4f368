"""The front of a car in the form that the compiled core uses.

The front is a row of *zones* in its own frame (x forward, z up, origin on the road under the
foremost point): rolls (cylinders across the car: lower bumper, bumper, hood edge) and panels
(planes: grille, hood, fender sides, windscreen, roof). Seen from above every zone follows a
parabola of the given curvature.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROLL, PANEL = 0, 1

MAXIMUM_DEPTH = 0.30
"""Depth (m) below a panel beyond which a segment counts as under the car, not in it (assumed)."""


class Zones(NamedTuple):
    """Car front, ``z`` zones.

    Attributes
    ----------
    kind : (z,) array
        ``ROLL`` or ``PANEL``.
    origin : (z, 2) array
        x and z of the roll's axis or of the panel's front border, m.
    radius : (z,) array
        m; 0 for a panel.
    direction : (z, 2) array
        Unit vector (x, z) along the panel, front to rear.
    length : (z,) array
        Along the panel, m.
    arc : (z, 2) array
        Lowest and highest direction of the roll's normal, from x towards z, rad.
    inner, half_width : (z,) array
        The zone's borders left and right of the centre line, m; a zone with ``inner`` above 0 (a
        fender's side) is a pair of strips.
    curvature : (z,) array
        Seen from above, 1/m.
    bend : (z,) array
        Half width over which the zone is curved, m; the surface is straight beyond it.
    joined : (z, z) array of bool
        Whether two zones share a border, across which a sliding segment stays in contact.
    box : (z, 4) array
        Lowest and highest x, lowest and highest z that a contact point can have, m.
    friction : (z,) array
        Coefficient of friction against the body.
    ploughing : (z,) array
        Share of the ploughing resistance of a lasting dent against the slip of the body.
    """

    kind: Index
    origin: Array
    radius: Array
    direction: Array
    length: Array
    arc: Array
    inner: Array
    half_width: Array
    curvature: Array
    bend: Array
    joined: NDArray[np.bool_]
    box: Array
    friction: Array
    ploughing: Array
