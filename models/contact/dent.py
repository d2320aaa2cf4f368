"""Effects of a deep contact: where the pressure acts and the ploughing resistance to sliding.

A body that penetrates a surface presses on a cap of its own surface, not at its deepest point.
Sections of an ellipsoid parallel to the struck surface are ellipses whose centres lie on the line
from the deepest point to the ellipsoid's centre, so the centre of pressure lies on that line, at
the mean depth of the pressed area:

- flattened flesh lies entirely in the plane of contact, at its own full depth;
- a panel wraps around the body. Under an even pressure (a sheet that yields) the cap
  ``z = d rho^2`` has the mean height ``int d rho^2 rho drho / int rho drho = d / 2``. A pressure
  that grows with the local depth gives ``d / 3``, the centroid of the dented volume ``2 d / 3``.

A body that slides in its own dent pushes the material ahead of it. Only the front half of the patch
is loaded then. With patch semi-axes ``a`` along and ``b`` across the slip and an even pressure p it
carries the normal force ``p pi a b / 2``, and p on the groove's cross section ``(4 / 3) b d``
resists the slip, so their ratio is ``8 d / (3 pi a)``; with ``a = sqrt(2 R d)``, R the radius of
curvature along the slip, it is ``(4 / (3 pi)) sqrt(2 d / R)`` (for a sphere: J. Goddard and
H. Wilman, Wear 5, 1962 [recalled]). Pressure is normal to the body's surface: the force passes near
the body's centre and hardly rotates it.
"""

import math

from models.compilation import inlined_kernel

WRAPPED = 0.5
"""Mean depth of the pressed cap over its full depth under an even pressure."""
PLOUGHING = 4.0 / (3.0 * math.pi)
"""Force against slip over normal force, for a patch as wide as the radius of curvature."""


@inlined_kernel
def pressure_share(flesh, dent, support):
    """Return the distance of the centre of pressure from the deepest point, over ``support``.

    Parameters
    ----------
    flesh, dent : float
        Penetration of the body and of the surface, m.
    support : float
        Distance of the ellipsoid's centre from its tangent plane at the deepest point, m.

    Returns
    -------
    float
        0 at the deepest point, 1 at the ellipsoid's centre.
    """
    return min((flesh + WRAPPED * dent) / support, 1.0)


@inlined_kernel
def ploughing_coefficient(A, support, dent, tx, ty, tz):
    """Return the ploughing force of an ellipsoid over its normal force.

    Parameters
    ----------
    A : (6,) tuple of float
        Shape entries of the ellipsoid, m2.
    support : float
        As in ``pressure_share``, m.
    dent : float
        Penetration of the surface, m.
    tx, ty, tz : float
        Unit vector of the slip, tangential at the deepest point.
    """
    # The inverse shape's quadratic form gives the curvature: 1 / R = support t.A^-1 t.
    c0 = A[3] * A[5] - A[4] * A[4]
    c1 = A[2] * A[4] - A[1] * A[5]
    c2 = A[1] * A[4] - A[2] * A[3]
    c3 = A[0] * A[5] - A[2] * A[2]
    c4 = A[1] * A[2] - A[0] * A[4]
    c5 = A[0] * A[3] - A[1] * A[1]
    form = (
        c0 * tx * tx
        + c3 * ty * ty
        + c5 * tz * tz
        + 2.0 * (c1 * tx * ty + c2 * tx * tz + c4 * ty * tz)
    ) / (A[0] * c0 + A[1] * c1 + A[2] * c2)
    # The patch is no wider than the body.
    return PLOUGHING * math.sqrt(min(2.0 * dent * support * form, 1.0))
