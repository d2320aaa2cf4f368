"""The front of a car as the compiled core takes it.

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
    kind : (z,) ``ROLL`` or ``PANEL``.
    origin : (z, 2) m, x and z of the roll's axis or of the panel's front border.
    radius : (z,) m (panel: 0).
    direction : (z, 2) unit vector (x, z) along the panel, front to rear.
    length : (z,) m along the panel.
    arc : (z, 2) rad, lowest and highest direction of the roll's normal, from x towards z.
    inner, half_width : (z,) m, the zone's borders left and right of the centre line; a zone with
        ``inner`` above 0 (a fender's side) is a pair of strips.
    curvature : (z,) 1/m seen from above. bend : (z,) m, how far out the zone keeps bending.
    joined : (z, z) whether two zones share a border: what slides from one to the other stays in
        contact.
    box : (z, 4) m, lowest and highest x, lowest and highest z that a contact point can have.
    friction : (z,) against the body. ploughing : (z,) share of the resistance of a lasting dent
        against the slip of the body in it.
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
