"""The shell element: one point in its plane, several through its thickness.

Strains come from the nodes' displacement and rotation in a frame that turns with the element, so a
rigid motion of any size leaves stresses and energy as they are (T. Belytschko, J. I. Lin and
C. S. Tsay, Comput. Methods Appl. Mech. Eng. 42, 225, 1984). What one point cannot see is
stabilised by the stiffness of the assumed strains, without a coefficient to choose:

- in the plane by the strains of pure bending (T. Belytschko and L. P. Bindeman, Comput. Methods
  Appl. Mech. Eng. 88, 311, 1991, optimal bending in plane stress);
- in bending by the curvatures of the hourglass modes of the rotations;
- in transverse shear by the strains at the middles of the edges (K.-J. Bathe and E. N. Dvorkin,
  Int. J. Numer. Methods Eng. 21, 367, 1985).

Nodes off the element's mean plane are tied to it by rigid links along the normal, and a penalty
ties the rotation about the normal to that of the element.
"""

import math

from models.compilation import inlined_kernel
from models.shells.material import return_to_yield, static_yield
from models.shells.state import WORK_BOW, WORK_DRILL, WORK_SECTION, WORK_SHEAR

SHEAR_FACTOR = 5.0 / 6.0
"""Transverse shear stiffness of a homogeneous section over G h (E. Reissner)."""
DRILLING = 0.01
"""Drilling stiffness over G h A (assumed; small against bending, found sufficient)."""


@inlined_kernel
def place_element(nodes, shells, e, frame, local):
    """Fill the frame (3, 3) and the local coordinates (9,) of an element at its present place.

    Parameters
    ----------
    nodes : Nodes
    shells : Shells
    e : int
        Row of the element.
    frame : (3, 3) array
        Filled: local axes, one a row.
    local : (9,) array
        Filled: local x and y of the nodes and height of the first over the mean plane, m.
    """
    x = nodes.position
    n1, n2, n3, n4 = shells.node[e, 0], shells.node[e, 1], shells.node[e, 2], shells.node[e, 3]
    # Lines through the middles of opposite sides.
    ax = x[n2, 0] + x[n3, 0] - x[n1, 0] - x[n4, 0]
    ay = x[n2, 1] + x[n3, 1] - x[n1, 1] - x[n4, 1]
    az = x[n2, 2] + x[n3, 2] - x[n1, 2] - x[n4, 2]
    bx = x[n3, 0] + x[n4, 0] - x[n1, 0] - x[n2, 0]
    by = x[n3, 1] + x[n4, 1] - x[n1, 1] - x[n2, 1]
    bz = x[n3, 2] + x[n4, 2] - x[n1, 2] - x[n2, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    sa = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    sb = 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
    # The first axis lies between the first line and the second one turned back by 90 degrees.
    ux = sa * ax + sb * (by * nz - bz * ny)
    uy = sa * ay + sb * (bz * nx - bx * nz)
    uz = sa * az + sb * (bx * ny - by * nx)
    su = 1.0 / math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = su * ux, su * uy, su * uz
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    frame[0, 0], frame[0, 1], frame[0, 2] = ux, uy, uz
    frame[1, 0], frame[1, 1], frame[1, 2] = vx, vy, vz
    frame[2, 0], frame[2, 1], frame[2, 2] = nx, ny, nz
    cx = 0.25 * (x[n1, 0] + x[n2, 0] + x[n3, 0] + x[n4, 0])
    cy = 0.25 * (x[n1, 1] + x[n2, 1] + x[n3, 1] + x[n4, 1])
    cz = 0.25 * (x[n1, 2] + x[n2, 2] + x[n3, 2] + x[n4, 2])
    for k in range(4):
        n = shells.node[e, k]
        dx, dy, dz = x[n, 0] - cx, x[n, 1] - cy, x[n, 2] - cz
        local[k] = ux * dx + uy * dy + uz * dz
        local[4 + k] = vx * dx + vy * dy + vz * dz
        if k == 0:
            local[8] = nx * dx + ny * dy + nz * dz


@inlined_kernel
def update_element(nodes, shells, materials, e, step, frame, local):
    """Advance an element to the present place of its nodes and add its forces to them.

    Parameters
    ----------
    nodes : Nodes
        ``force`` and ``moment`` are increased in place.
    shells : Shells
        State of the element; updated.
    materials : Materials
    e : int
        Row of the element.
    step : float
        Time since the last update, s.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """
    place_element(nodes, shells, e, frame, local)
    x1, x2, x3, x4 = local[0], local[1], local[2], local[3]
    y1, y2, y3, y4 = local[4], local[5], local[6], local[7]
    z = local[8]
    old, turned = shells.local, shells.frame
    # Displacements in the turning frame.
    u1, u2, u3, u4 = x1 - old[e, 0], x2 - old[e, 1], x3 - old[e, 2], x4 - old[e, 3]
    v1, v2, v3, v4 = y1 - old[e, 4], y2 - old[e, 5], y3 - old[e, 6], y4 - old[e, 7]
    w = z - old[e, 8]
    # Rotation of the frame: its sine about the axis.
    rx, ry, rz = 0.0, 0.0, 0.0
    for k in range(3):
        ox, oy, oz = turned[e, k, 0], turned[e, k, 1], turned[e, k, 2]
        nx, ny, nz = frame[k, 0], frame[k, 1], frame[k, 2]
        rx += 0.5 * (oy * nz - oz * ny)
        ry += 0.5 * (oz * nx - ox * nz)
        rz += 0.5 * (ox * ny - oy * nx)
    for k in range(3):
        for j in range(3):
            turned[e, k, j] = frame[k, j]
    for k in range(9):
        old[e, k] = local[k]
    # Rotations of the nodes against the frame: a along x, b along y, c along the normal.
    a1, b1, c1 = _against(nodes, shells.node[e, 0], step, rx, ry, rz, frame)
    a2, b2, c2 = _against(nodes, shells.node[e, 1], step, rx, ry, rz, frame)
    a3, b3, c3 = _against(nodes, shells.node[e, 2], step, rx, ry, rz, frame)
    a4, b4, c4 = _against(nodes, shells.node[e, 3], step, rx, ry, rz, frame)
    # Links from the nodes, at heights z, -z, z, -z, to the mean plane.
    u1, u2, u3, u4 = u1 - z * b1, u2 + z * b2, u3 - z * b3, u4 + z * b4
    v1, v2, v3, v4 = v1 + z * a1, v2 - z * a2, v3 + z * a3, v4 - z * a4

    area = 0.5 * ((x3 - x1) * (y4 - y2) + (x2 - x4) * (y3 - y1))
    half = 0.5 / area
    bx1, bx2 = half * (y2 - y4), half * (y3 - y1)
    by1, by2 = half * (x4 - x2), half * (x1 - x3)
    bx3, bx4, by3, by4 = -bx1, -bx2, -by1, -by2
    # Projected hourglass vector.
    hx = x1 - x2 + x3 - x4
    hy = y1 - y2 + y3 - y4
    g1 = 0.25 * (1.0 - hx * bx1 - hy * by1)
    g2 = 0.25 * (-1.0 - hx * bx2 - hy * by2)
    g3 = 0.25 * (1.0 - hx * bx3 - hy * by3)
    g4 = 0.25 * (-1.0 - hx * bx4 - hy * by4)
    # Natural derivatives at the middle.
    xs, xt = 0.25 * (x2 + x3 - x1 - x4), 0.25 * (x3 + x4 - x1 - x2)
    ys, yt = 0.25 * (y2 + y3 - y1 - y4), 0.25 * (y3 + y4 - y1 - y2)
    inverse = 4.0 / area
    sx, sy, tx, ty = inverse * yt, -inverse * xt, -inverse * ys, inverse * xs

    # Strains of the mean plane, curvatures, mean transverse shear.
    exx = bx1 * u1 + bx2 * u2 + bx3 * u3 + bx4 * u4
    eyy = by1 * v1 + by2 * v2 + by3 * v3 + by4 * v4
    uy = by1 * u1 + by2 * u2 + by3 * u3 + by4 * u4
    vx = bx1 * v1 + bx2 * v2 + bx3 * v3 + bx4 * v4
    exy = uy + vx
    kxx = bx1 * b1 + bx2 * b2 + bx3 * b3 + bx4 * b4
    kyy = -(by1 * a1 + by2 * a2 + by3 * a3 + by4 * a4)
    kxy = by1 * b1 + by2 * b2 + by3 * b3 + by4 * b4 - bx1 * a1 - bx2 * a2 - bx3 * a3 - bx4 * a4
    sxz = 0.25 * (b1 + b2 + b3 + b4)
    syz = -0.25 * (a1 + a2 + a3 + a4)

    k = shells.material[e]
    young, poisson = materials.young[k], materials.poisson[k]
    plane = young / (1.0 - poisson * poisson)
    modulus = 0.5 * young / (1.0 + poisson)
    h = shells.thickness[e]
    volume = area * h
    # Through the thickness.
    fxx, fyy, fxy, mxx, myy, mxy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    thinning, work, soft = 0.0, 0.0, 0.0
    points = shells.place.shape[0]
    for q in range(points):
        place, weight = 0.5 * h * shells.place[q], 0.5 * shells.weight[q]
        dxx, dyy, dxy = exx + place * kxx, eyy + place * kyy, exy + place * kxy
        pxx, pyy, pxy = shells.stress[e, q, 0], shells.stress[e, q, 1], shells.stress[e, q, 2]
        qxx = pxx + plane * (dxx + poisson * dyy)
        qyy = pyy + plane * (dyy + poisson * dxx)
        qxy = pxy + modulus * dxy
        mises = qxx * qxx - qxx * qyy + qyy * qyy + 3.0 * qxy * qxy
        limit = materials.yield_stress[k]
        tangent = 1.0
        if mises > limit * limit:
            strain = shells.plastic[e, q]
            static = static_yield(materials, k, strain)
            if mises > static * static:
                total, difference = qxx + qyy, qxx - qyy
                g, strain = return_to_yield(materials, k, total, difference, qxy, strain, step)
                total /= 1.0 + g * young / (3.0 * (1.0 - poisson))
                other = 1.0 / (1.0 + g * young / (1.0 + poisson))
                difference, qxy = difference * other, qxy * other
                qxx, qyy = 0.5 * (total + difference), 0.5 * (total - difference)
                shells.plastic[e, q] = strain
                hardening = materials.slope[k]
                tangent = hardening / (young + hardening)
        soft += weight * tangent
        work += weight * (
            0.5 * (pxx + qxx) * dxx + 0.5 * (pyy + qyy) * dyy + 0.5 * (pxy + qxy) * dxy
        )
        # Normal strain of plane stress: elastic and, without change of volume, plastic.
        grown = qxx + qyy - pxx - pyy
        thinning += weight * (-(dxx + dyy) + (1.0 - 2.0 * poisson) / young * grown)
        shells.stress[e, q, 0], shells.stress[e, q, 1], shells.stress[e, q, 2] = qxx, qyy, qxy
        fxx, fyy, fxy = fxx + weight * qxx, fyy + weight * qyy, fxy + weight * qxy
        mxx += weight * place * qxx
        myy += weight * place * qyy
        mxy += weight * place * qxy
    shells.thickness[e] = h * (1.0 + thinning)
    shells.energy[WORK_SECTION] += work * volume
    fxx, fyy, fxy = volume * fxx, volume * fyy, volume * fxy
    mxx, myy, mxy = volume * mxx, volume * myy, volume * mxy

    # Transverse shear, elastic.
    bend = SHEAR_FACTOR * modulus * volume
    pxz, pyz = shells.shear[e, 0], shells.shear[e, 1]
    qxz, qyz = pxz + sxz, pyz + syz
    shells.shear[e, 0], shells.shear[e, 1] = qxz, qyz
    shells.energy[WORK_SHEAR] += 0.5 * bend * ((pxz + qxz) * sxz + (pyz + qyz) * syz)
    fxz, fyz = bend * qxz, bend * qyz

    # Hourglass modes.
    hu = g1 * u1 + g2 * u2 + g3 * u3 + g4 * u4
    hv = g1 * v1 + g2 * v2 + g3 * v3 + g4 * v4
    ha = g1 * a1 + g2 * a2 + g3 * a3 + g4 * a4
    hb = g1 * b1 + g2 * b2 + g3 * b3 + g4 * b4
    third = area / 3.0
    hxx, hyy = third * (sx * sx + tx * tx), third * (sy * sy + ty * ty)
    flexural = plane * h * h * h / 12.0
    # Shear along the natural axes at the middles of opposite edges: half their difference.
    es = w + 0.125 * (
        (b3 + b4) * (x3 - x4)
        - (a3 + a4) * (y3 - y4)
        - (b1 + b2) * (x2 - x1)
        + (a1 + a2) * (y2 - y1)
    )
    et = w + 0.125 * (
        (b2 + b3) * (x3 - x2)
        - (a2 + a3) * (y3 - y2)
        - (b1 + b4) * (x4 - x1)
        + (a1 + a4) * (y4 - y1)
    )
    mixed = 0.5 * (1.0 - poisson)
    cs = SHEAR_FACTOR * modulus * h * third * (sx * sx + sy * sy)
    ct = SHEAR_FACTOR * modulus * h * third * (tx * tx + ty * ty)
    bow = shells.bow
    o0, o1, o2, o3, o4, o5 = bow[e, 0], bow[e, 1], bow[e, 2], bow[e, 3], bow[e, 4], bow[e, 5]
    p0 = o0 + soft * young * h * hxx * hu
    p1 = o1 + soft * young * h * hyy * hv
    p2 = o2 + soft * flexural * (hxx + mixed * hyy) * hb
    p3 = o3 + soft * flexural * (hyy + mixed * hxx) * ha
    p4 = o4 + cs * es
    p5 = o5 + ct * et
    bow[e, 0], bow[e, 1], bow[e, 2], bow[e, 3], bow[e, 4], bow[e, 5] = p0, p1, p2, p3, p4, p5
    shells.energy[WORK_BOW] += 0.5 * (
        (o0 + p0) * hu + (o1 + p1) * hv + (o2 + p2) * hb + (o3 + p3) * ha
        + (o4 + p4) * es + (o5 + p5) * et
    )  # fmt: skip

    # Drilling.
    spin = 0.5 * (vx - uy)
    stiff = 0.25 * DRILLING * modulus * volume
    d1, d2 = shells.drill[e, 0] + c1 - spin, shells.drill[e, 1] + c2 - spin
    d3, d4 = shells.drill[e, 2] + c3 - spin, shells.drill[e, 3] + c4 - spin
    shells.energy[WORK_DRILL] += 0.5 * stiff * (
        (shells.drill[e, 0] + d1) * (c1 - spin) + (shells.drill[e, 1] + d2) * (c2 - spin)
        + (shells.drill[e, 2] + d3) * (c3 - spin) + (shells.drill[e, 3] + d4) * (c4 - spin)
    )  # fmt: skip
    shells.drill[e, 0], shells.drill[e, 1] = d1, d2
    shells.drill[e, 2], shells.drill[e, 3] = d3, d4
    t1, t2, t3, t4 = stiff * d1, stiff * d2, stiff * d3, stiff * d4
    twist = 0.5 * (t1 + t2 + t3 + t4)
    fuy, fvx = fxy + twist, fxy - twist

    # Forces on the nodes: the transposed relations, with a sign for the reaction.
    quarter_a, quarter_b = -0.25 * fyz, 0.25 * fxz
    b34, a34 = 0.125 * p4 * (x3 - x4), -0.125 * p4 * (y3 - y4)
    b12, a12 = -0.125 * p4 * (x2 - x1), 0.125 * p4 * (y2 - y1)
    b23, a23 = 0.125 * p5 * (x3 - x2), -0.125 * p5 * (y3 - y2)
    b14, a14 = -0.125 * p5 * (x4 - x1), 0.125 * p5 * (y4 - y1)
    # A rotation against the frame is one against the slope of the mean plane as well.
    sum_a = -fyz + 2.0 * (a12 + a34 + a23 + a14)
    sum_b = fxz + 2.0 * (b12 + b34 + b23 + b14)
    bowed = p4 + p5
    l1 = g1 * bowed + bx1 * sum_b - by1 * sum_a
    l2 = g2 * bowed + bx2 * sum_b - by2 * sum_a
    l3 = g3 * bowed + bx3 * sum_b - by3 * sum_a
    l4 = g4 * bowed + bx4 * sum_b - by4 * sum_a
    _push(nodes, shells.node[e, 0], frame, z, l1,
          bx1 * fxx + by1 * fuy + g1 * p0, by1 * fyy + bx1 * fvx + g1 * p1,
          -by1 * myy - bx1 * mxy + quarter_a + g1 * p3 + a12 + a14,
          bx1 * mxx + by1 * mxy + quarter_b + g1 * p2 + b12 + b14, t1)  # fmt: skip
    _push(nodes, shells.node[e, 1], frame, -z, l2,
          bx2 * fxx + by2 * fuy + g2 * p0, by2 * fyy + bx2 * fvx + g2 * p1,
          -by2 * myy - bx2 * mxy + quarter_a + g2 * p3 + a12 + a23,
          bx2 * mxx + by2 * mxy + quarter_b + g2 * p2 + b12 + b23, t2)  # fmt: skip
    _push(nodes, shells.node[e, 2], frame, z, l3,
          bx3 * fxx + by3 * fuy + g3 * p0, by3 * fyy + bx3 * fvx + g3 * p1,
          -by3 * myy - bx3 * mxy + quarter_a + g3 * p3 + a34 + a23,
          bx3 * mxx + by3 * mxy + quarter_b + g3 * p2 + b34 + b23, t3)  # fmt: skip
    _push(nodes, shells.node[e, 3], frame, -z, l4,
          bx4 * fxx + by4 * fuy + g4 * p0, by4 * fyy + bx4 * fvx + g4 * p1,
          -by4 * myy - bx4 * mxy + quarter_a + g4 * p3 + a34 + a14,
          bx4 * mxx + by4 * mxy + quarter_b + g4 * p2 + b34 + b14, t4)  # fmt: skip


@inlined_kernel
def _against(nodes, n, step, rx, ry, rz, frame):
    """Return the rotation of a node against the frame in local axes; ``r`` is the frame's own."""
    wx, wy, wz = step * nodes.spin[n, 0], step * nodes.spin[n, 1], step * nodes.spin[n, 2]
    # The frame's rotation is known by its sine.
    sine = 1.0 - (wx * wx + wy * wy + wz * wz) / 6.0
    dx, dy, dz = sine * wx - rx, sine * wy - ry, sine * wz - rz
    return (
        frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz,
        frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz,
        frame[2, 0] * dx + frame[2, 1] * dy + frame[2, 2] * dz,
    )


@inlined_kernel
def _push(nodes, n, frame, z, lift, fx, fy, ma, mb, mc):
    """Subtract the forces that act where a node's link, of height ``z``, meets the mean plane."""
    ma += z * fy
    mb -= z * fx
    for j in range(3):
        nodes.force[n, j] -= frame[0, j] * fx + frame[1, j] * fy + frame[2, j] * lift
        nodes.moment[n, j] -= frame[0, j] * ma + frame[1, j] * mb + frame[2, j] * mc
