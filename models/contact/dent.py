"""What a deep contact does: where its pressure acts, and what stands in the way of its sliding.

A body that sinks in presses over a cap of its surface, not at its deepest point. Sections of an
ellipsoid that are parallel to the surface struck are ellipses whose centres lie on the line from
the deepest point to the ellipsoid's centre, so the pressure's centre lies on that line, at the
mean depth of the pressed area:

- flesh that is flattened lies in the plane of contact, all of it at its own full depth;
- a panel is wrapped around the body. Under an even pressure (a sheet that yields) the cap
  ``z = d rho^2`` has its mean height at ``int d rho^2 rho drho / int rho drho = d / 2``. A pressure
  that grows with the local depth gives ``d / 3``, the centroid of the dented volume ``2 d / 3``.

A body that slides in its own dent pushes the material before it. Only the front half of the patch
is loaded then. With patch semi-axes ``a`` along and ``b`` across the slip and an even pressure p it
carries the normal force ``p pi a b / 2``, and p on the groove's cross section ``(4 / 3) b d``
resists the slip, so their ratio is ``8 d / (3 pi a)``; with ``a = sqrt(2 R d)``, R the radius of
curvature along the slip, it is ``(4 / (3 pi)) sqrt(2 d / R)`` (for a sphere: J. Goddard and
H. Wilman, Wear 5, 1962 [recalled]). Pressure is normal to the body's surface: the force passes near
its centre and turns it hardly at all.
"""

import math

from models.compilation import inlined_kernel

WRAPPED = 0.5
"""Mean depth of the pressed cap over its full depth under an even pressure."""
PLOUGHING = 4.0 / (3.0 * math.pi)
"""Force against slip over normal force, for a patch as wide as the radius of curvature."""


@inlined_kernel
def pressure_share(flesh, dent, support):
    """Return the share of the way from the deepest point to the centre where the pressure acts.

    Parameters
    ----------
    flesh, dent : m, penetration of the body and of what it sinks into.
    support : m, height of the ellipsoid's centre over its deepest point.
    """
    return min((flesh + WRAPPED * dent) / support, 1.0)


@inlined_kernel
def ploughing_coefficient(A, support, dent, tx, ty, tz):
    """Return the ploughing force of an ellipsoid over its normal force.

    Parameters
    ----------
    A : six shape entries (m2) of the ellipsoid. support : m, as above. dent : m.
    tx, ty, tz : unit vector of the slip, tangential at the deepest point.
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
