"""Surfaces of a pedestrian's segments and their contact laws against car, road and each other."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import data
from models.compilation import kernel
from models.contact.law import KNOTS, ForceCurve, combine_curves
from models.pedestrian.anthropometry import SEGMENTS, Body, region_of
from models.pedestrian.tissue import self_contact_pairs

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Ellipsoids(NamedTuple):
    """Surfaces of ``n`` segments and their contact laws.

    Attributes
    ----------
    square : (n, 3) array
        Squared semi-axes, m2.
    reach : (n,) array
        Largest semi-axis, m.
    offset : (n, 3) array
        Ellipsoid centre from the centre of mass, own axes, m.
    laws : (m, KNOTS, 4) array
        Combined laws; see ``models.contact.law``.
    counts : (m,) array
        Number of knots of each law.
    damping : (m,) array
        Damping of each law, N s/m.
    surface_law : (n, z + 1) array
        Law of a segment against a zone, -1 where they pass through each other; last column the
        road.
    pairs : (p, 3) array
        First segment, second segment and law of the contacts between segments.
    pair_gap : (p,) array
        Overlap of the undeformed ellipsoids that carries no force, m.
    pair_friction : float
        Coefficient of friction between segments.
    """

    square: Array
    reach: Array
    offset: Array
    laws: Array
    counts: Index
    damping: Array
    surface_law: Index
    pairs: Index
    pair_gap: Array
    pair_friction: float


@kernel
def _combine_all(
    surface_d, surface_f, surface_n, surface_r, body_d, body_f, body_n, body_r, laws, counts
):
    bodies = body_n.shape[0]
    for j in range(surface_n.shape[0]):
        for i in range(bodies):
            k = j * bodies + i
            counts[k] = combine_curves(
                surface_d[j, : surface_n[j]], surface_f[j, : surface_n[j]], surface_r[j],
                body_d[i, : body_n[i]], body_f[i, : body_n[i]], body_r[i], laws[k],
            )  # fmt: skip


def _stack(curves: list[ForceCurve]) -> tuple[Array, Array, NDArray[np.int64], Array]:
    depth, force = np.zeros((len(curves), KNOTS)), np.zeros((len(curves), KNOTS))
    for row, curve in enumerate(curves):
        depth[row, : curve.penetration.size] = curve.penetration
        force[row, : curve.force.size] = curve.force
    sizes = np.array([curve.penetration.size for curve in curves], dtype=np.int64)
    return depth, force, sizes, np.array([curve.unloading_ratio for curve in curves])


RIGID = ForceCurve(np.array([0.0, 1e-6]), np.array([0.0, 1e5]), 1.0 + 1e-9)
"""The road: 100 kN/mm, far stiffer than any tissue."""
ELASTIC = 1.000001
"""Unloading ratio of an elastic body; a force curve requires more than one."""


def build_ellipsoids(
    body: Body,
    tissue: Mapping[str, ForceCurve],
    zone_curves: list[ForceCurve],
    returned: float = 1.0,
) -> Ellipsoids:
    """Return the surfaces of a body and their laws against zones, road and each other.

    Parameters
    ----------
    body : Body
    tissue : mapping of str to ForceCurve
        Loading curve of each body region.
    zone_curves : list of ForceCurve
        Loading curves of the car's zones, in order.
    returned : float
        Factor on the share of the energy that the road contact returns.
    """
    regions = list(tissue)
    bodies = [tissue[region] for region in regions]
    # Surfaces: the zones, the road, and every region as the other side of a self-contact.
    surfaces = [*zone_curves, RIGID, *bodies]
    laws = np.zeros((len(surfaces) * len(bodies), KNOTS, 4))
    counts = np.zeros(laws.shape[0], dtype=np.int64)
    _combine_all(*_stack(surfaces), *_stack(bodies), laws, counts)
    if returned != 1.0:
        k = len(zone_curves)
        springy = [
            replace(curve, unloading_ratio=max(curve.unloading_ratio / returned, ELASTIC))
            for curve in bodies
        ]
        rows = slice(k * len(bodies), (k + 1) * len(bodies))
        _combine_all(*_stack([RIGID]), *_stack(springy), laws[rows], counts[rows])
    damping = np.repeat([curve.damping for curve in surfaces], len(bodies))
    row = np.array([regions.index(region_of(segment)) for segment in SEGMENTS])
    zones = len(zone_curves)
    surface_law = np.arange(zones + 1)[None, :] * len(bodies) + row[:, None]
    pairs = np.array(
        [(i, j, (zones + 1 + row[j]) * len(bodies) + row[i]) for i, j in self_contact_pairs()],
        dtype=np.int64,
    )
    return Ellipsoids(
        square=body.semi_axes**2,
        reach=body.semi_axes.max(axis=1),
        offset=body.ellipsoid - body.centre,
        laws=laws,
        counts=counts,
        damping=damping,
        surface_law=surface_law.astype(np.int64),
        pairs=pairs,
        pair_gap=np.zeros(len(pairs)),
        pair_friction=float(data.load("pedestrians/tissue.toml")["self_contact"]["friction"]),
    )
