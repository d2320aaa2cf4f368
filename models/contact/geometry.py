"""Separation of an ellipsoid from a plane, a roll (cylinder) or another ellipsoid.

For two convex bodies the signed separation is the largest, over unit directions n, of the gap
between their supporting planes: ``s(n) = n.d - h1(n) - h2(n)``, with d from the second centre to
the first and ``h(n) = sqrt(n.A n)`` the support function of an ellipsoid of shape matrix
``A = R diag(a^2) R^T``. Negative s is penetration. The maximum is found by Newton's method on the
direction, with the step halved where it overshoots. Symmetric matrices are stored as six scalars:
xx, xy, xz, yy, yz, zz.
"""

import math

from models.compilation import inlined_kernel, kernel

ITERATIONS = 60
TOLERANCE = 1e-7
"""Last Newton step (rad): the error of the separation is its square times a semi-axis."""


@inlined_kernel
def shape_matrix(rotation, i, a2, b2, c2):
    """Return the six entries of ``R diag(a2, b2, c2) R^T`` (m2) with R = ``rotation[i]``.

    Parameters
    ----------
    rotation : (n, 3, 3) array
        Rotation matrices.
    i : int
        Row.
    a2, b2, c2 : float
        Squared semi-axes, m2.

    Returns
    -------
    tuple of float
        xx, xy, xz, yy, yz, zz.
    """
    x0, x1, x2 = rotation[i, 0, 0], rotation[i, 0, 1], rotation[i, 0, 2]
    y0, y1, y2 = rotation[i, 1, 0], rotation[i, 1, 1], rotation[i, 1, 2]
    z0, z1, z2 = rotation[i, 2, 0], rotation[i, 2, 1], rotation[i, 2, 2]
    return (
        a2 * x0 * x0 + b2 * x1 * x1 + c2 * x2 * x2,
        a2 * x0 * y0 + b2 * x1 * y1 + c2 * x2 * y2,
        a2 * x0 * z0 + b2 * x1 * z1 + c2 * x2 * z2,
        a2 * y0 * y0 + b2 * y1 * y1 + c2 * y2 * y2,
        a2 * y0 * z0 + b2 * y1 * z1 + c2 * y2 * z2,
        a2 * z0 * z0 + b2 * z1 * z1 + c2 * z2 * z2,
    )


@kernel
def roll_direction(d1, d3, p11, p13, p33):
    """Return the separating direction and separation of an ellipsoid from a roll's axis.

    The ellipsoid is projected along the roll's axis, which gives an ellipse in the normal plane.
    Subtract the roll's radius to get the separation from the roll.

    Parameters
    ----------
    d1, d3 : float
        Centre of the ellipse from the roll's axis, m.
    p11, p13, p33 : float
        Shape entries of the ellipse, m2.

    Returns
    -------
    n1, n3, separation : float
        Unit direction towards the ellipse, and separation in m.
    """
    length = math.sqrt(d1 * d1 + d3 * d3)
    if length < 1e-12:
        return 1.0, 0.0, -math.sqrt(p11)
    n1, n3 = d1 / length, d3 / length
    m1, m3, turn, best = n1, n3, 0.0, -math.inf
    for _ in range(ITERATIONS):
        q = p11 * n1 * n1 + 2.0 * p13 * n1 * n3 + p33 * n3 * n3
        h = math.sqrt(q)
        separation = n1 * d1 + n3 * d3 - h
        if separation < best:
            # Overshot: half the turn from the best direction so far.
            turn *= 0.5
        else:
            best, m1, m3 = separation, n1, n3
            # Derivatives with respect to the angle of n.
            q1 = 2.0 * ((p33 - p11) * n1 * n3 + p13 * (n1 * n1 - n3 * n3))
            q2 = 2.0 * ((p33 - p11) * (n1 * n1 - n3 * n3) - 4.0 * p13 * n1 * n3)
            slope = -d1 * n3 + d3 * n1 - 0.5 * q1 / h
            curvature = -d1 * n1 - d3 * n3 - 0.5 * q2 / h + 0.25 * q1 * q1 / (q * h)
            if curvature < -1e-9:
                turn = min(max(-slope / curvature, -0.5), 0.5)
            else:
                turn = 0.3 if slope > 0.0 else -0.3
        if abs(turn) < TOLERANCE:
            break
        n1, n3 = m1 - turn * m3, m3 + turn * m1
        scale = 1.0 / math.sqrt(n1 * n1 + n3 * n3)
        n1, n3 = n1 * scale, n3 * scale
    return m1, m3, best


@kernel
def ellipsoid_direction(dx, dy, dz, A, B, x, y, z):
    """Return the separating direction and separation of two ellipsoids.

    Parameters
    ----------
    dx, dy, dz : float
        Vector from the second centre to the first, m.
    A, B : (6,) tuple of float
        Shape entries of the first and the second ellipsoid, m2.
    x, y, z : float
        Unit direction to start from; (0, 0, 0) starts along the line of centres.

    Returns
    -------
    nx, ny, nz, separation : float
        Unit direction towards the first ellipsoid, and separation in m.
    """
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length < 1e-12:
        return 0.0, 0.0, 1.0, -math.sqrt(A[5]) - math.sqrt(B[5])
    if x * dx + y * dy + z * dz <= 0.0:
        x, y, z = dx / length, dy / length, dz / length
    px, py, pz, best = x, y, z, -math.inf
    tx, ty, tz, size = 0.0, 0.0, 0.0, 0.0
    for _ in range(ITERATIONS):
        ax = A[0] * x + A[1] * y + A[2] * z
        ay = A[1] * x + A[3] * y + A[4] * z
        az = A[2] * x + A[4] * y + A[5] * z
        bx = B[0] * x + B[1] * y + B[2] * z
        by = B[1] * x + B[3] * y + B[4] * z
        bz = B[2] * x + B[4] * y + B[5] * z
        ha = math.sqrt(ax * x + ay * y + az * z)
        hb = math.sqrt(bx * x + by * y + bz * z)
        separation = dx * x + dy * y + dz * z - ha - hb
        if separation < best:
            # Overshot: half the step from the best direction so far.
            tx, ty, tz, size = 0.5 * tx, 0.5 * ty, 0.5 * tz, 0.5 * size
            if size < TOLERANCE:
                break
            x, y, z = px + tx, py + ty, pz + tz
            s = 1.0 / math.sqrt(x * x + y * y + z * z)
            x, y, z = x * s, y * s, z * s
            continue
        best, px, py, pz = separation, x, y, z
        gx = dx - ax / ha - bx / hb
        gy = dy - ay / ha - by / hb
        gz = dz - az / ha - bz / hb
        # Orthonormal tangents u, v of n.
        if abs(x) < 0.7:
            s = 1.0 / math.sqrt(y * y + z * z)
            ux, uy, uz = 0.0, z * s, -y * s
        else:
            s = 1.0 / math.sqrt(x * x + z * z)
            ux, uy, uz = -z * s, 0.0, x * s
        vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
        gu = gx * ux + gy * uy + gz * uz
        gv = gx * vx + gy * vy + gz * vz
        au, av = ax * ux + ay * uy + az * uz, ax * vx + ay * vy + az * vz
        bu, bv = bx * ux + by * uy + bz * uz, bx * vx + by * vy + bz * vz
        huu = -separation - _quadratic(A, B, ha, hb, ux, uy, uz, ux, uy, uz)
        huv = -_quadratic(A, B, ha, hb, ux, uy, uz, vx, vy, vz)
        hvv = -separation - _quadratic(A, B, ha, hb, vx, vy, vz, vx, vy, vz)
        huu += au * au / (ha * ha * ha) + bu * bu / (hb * hb * hb)
        huv += au * av / (ha * ha * ha) + bu * bv / (hb * hb * hb)
        hvv += av * av / (ha * ha * ha) + bv * bv / (hb * hb * hb)
        determinant = huu * hvv - huv * huv
        if huu < 0.0 and determinant > 0.0:
            su = -(hvv * gu - huv * gv) / determinant
            sv = -(huu * gv - huv * gu) / determinant
        else:
            su, sv = gu / length, gv / length
        size = math.sqrt(su * su + sv * sv)
        if size > 0.5:
            su, sv, size = su * 0.5 / size, sv * 0.5 / size, 0.5
        if size < TOLERANCE:
            break
        tx, ty, tz = su * ux + sv * vx, su * uy + sv * vy, su * uz + sv * vz
        x, y, z = x + tx, y + ty, z + tz
        s = 1.0 / math.sqrt(x * x + y * y + z * z)
        x, y, z = x * s, y * s, z * s
    return px, py, pz, best


@inlined_kernel
def _quadratic(A, B, ha, hb, ux, uy, uz, vx, vy, vz):
    a = (
        ux * (A[0] * vx + A[1] * vy + A[2] * vz)
        + uy * (A[1] * vx + A[3] * vy + A[4] * vz)
        + uz * (A[2] * vx + A[4] * vy + A[5] * vz)
    )
    b = (
        ux * (B[0] * vx + B[1] * vy + B[2] * vz)
        + uy * (B[1] * vx + B[3] * vy + B[4] * vz)
        + uz * (B[2] * vx + B[4] * vy + B[5] * vz)
    )
    return a / ha + b / hb
