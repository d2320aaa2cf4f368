"""A user's own mesh of a car: reading, units, placing on the road, and what is wrong with it.

STL, PLY and OBJ are read by trimesh, LS-DYNA keyword shells by lsdyna-mesh-reader; neither format
states its unit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from models.vehicle.surface.mesh import SurfaceMesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Content = TypeVar("Content")

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units of a mesh, in m."""
LENGTH, WIDTH, HEIGHT = (2.4, 7.0), (1.2, 2.8), (0.7, 3.2)
"""Sizes (m) between which a car, or its front with the windscreen, lies (assumed)."""
CLEARANCE = (-0.02, 0.6)
"""Heights (m) between which the lowest point of a car lies above the road (assumed)."""
KEYWORD = (".k", ".key", ".dyn")
"""Endings of LS-DYNA keyword files."""
OPEN_ABOVE = 0.02
"""Share of a mesh's area by which more of it faces down than up if it is open above (assumed)."""
FORMATS = (".stl", ".ply", ".obj", *KEYWORD)


@dataclass(frozen=True)
class ReadSurface:
    """A mesh as it was understood.

    Attributes
    ----------
    mesh : SurfaceMesh
        In the frame of the static car, m.
    notes : list of str
        What was changed, and what is left open.
    shift : (3,) array
        What was added to the coordinates of the file, once in m, m.
    """

    mesh: SurfaceMesh
    notes: list[str]
    shift: Array


def read_surface(
    path: Path, unit: str = "m", lift: float = 0.0, more: Sequence[Path] = ()
) -> ReadSurface:
    """Return a mesh of a car with x forward and z up, moved so that its foremost point is at x = 0.

    Regions are the parts of the file: shells by part, groups of an OBJ file, else one region.

    Parameters
    ----------
    path : Path
        STL, PLY, OBJ or LS-DYNA keyword file.
    unit : str
        Unit of its coordinates.
    lift : float
        Height to add, m.
    more : sequence of Path
        Further files of the same car, each one region.

    Raises
    ------
    ValueError
        In one line, if a file cannot be read or the mesh is no car in this frame and unit.
    """
    if unit not in UNITS:
        raise ValueError(f"unit must be one of {', '.join(UNITS)}, given {unit!r}")
    raw = read_mesh(path)
    for other in more:
        part = read_mesh(other)
        raw = SurfaceMesh(
            np.concatenate([raw.nodes, part.nodes]),
            np.concatenate([raw.facets, part.facets + len(raw.nodes)]),
            np.concatenate([raw.region, np.full(len(part.facets), len(raw.names))]),
            (*raw.names, other.stem),
        )
    _check_size(path, raw, unit)
    scaled = replace(raw, nodes=raw.nodes * UNITS[unit])
    notes = []
    bad = scaled.degenerate_facets()
    if bad.size:
        where = scaled.corners[bad[0]].mean(axis=0)
        notes.append(
            f"{bad.size:,} facets without an area are left out, the first at {_place(where)}"
        )
    compact = scaled.compact()
    low, high = compact.box
    shift = np.array([-high[0], -0.5 * (low[1] + high[1]), lift])
    notes.append(
        f"moved by {shift[0]:+.3f} m along x and {shift[1]:+.3f} m along y: "
        "foremost point and middle"
    )
    mesh = replace(compact, nodes=compact.nodes + shift)
    mesh = _face_outwards(path, mesh, notes)
    _check_placing(path, mesh)
    return ReadSurface(mesh, notes, shift)


def read_mesh(path: Path) -> SurfaceMesh:
    """Return the mesh of a file in its own unit.

    Raises
    ------
    ValueError
        In one line, if the file cannot be read.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise ValueError(f"{path}: has the ending {ending!r}; meshes end in {', '.join(FORMATS)}")
    if not path.is_file():
        raise ValueError(f"{path}: is no file")
    raw = _read_keyword(path) if ending in KEYWORD else _read_mesh_file(path)
    if not len(raw.facets):
        raise ValueError(f"{path}: holds no facets")
    lost = np.flatnonzero(~np.isfinite(raw.nodes).all(axis=1))
    if lost.size:
        raise ValueError(
            f"{path}: {lost.size} nodes have no finite place, the first is node {lost[0]}"
        )
    return raw


def _place(point: Array) -> str:
    x, y, z = point
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"


def _parsed(path: Path, parse: Callable[[], Content]) -> Content:
    """Return what a library reads; whatever it raises over a foreign file becomes one line."""
    try:
        return parse()
    except Exception as error:
        said = " ".join(str(error).split())[:120] or type(error).__name__
        raise ValueError(f"{path}: cannot be read ({said})") from None


def _read_mesh_file(path: Path) -> SurfaceMesh:
    """Return an STL, PLY or OBJ file in its own unit."""
    import trimesh

    scene = _parsed(path, lambda: trimesh.load_scene(path, process=False))
    parts = {str(k): v for k, v in scene.geometry.items() if isinstance(v, trimesh.Trimesh)}
    nodes: list[Array] = []
    facets: list[Index] = []
    region: list[Index] = []
    start = 0
    for k, part in enumerate(parts.values()):
        nodes.append(np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3))
        facets.append(np.asarray(part.faces, dtype=np.int64).reshape(-1, 3) + start)
        region.append(np.full(len(facets[-1]), k))
        start += len(nodes[-1])
    if not parts:
        raise ValueError(f"{path}: holds no facets")
    return SurfaceMesh(
        np.concatenate(nodes), np.concatenate(facets), np.concatenate(region), tuple(parts)
    )


def _read_keyword(path: Path) -> SurfaceMesh:
    """Return the shells of an LS-DYNA keyword file in its own unit, a region a part."""
    import lsdyna_mesh_reader

    deck = _parsed(path, lambda: lsdyna_mesh_reader.Deck(str(path)))
    sections = [(s.nid, s.coordinates) for s in deck.node_sections]
    shells = [(s.pid, s.node_ids, s.node_id_offsets) for s in deck.element_shell_sections]
    if not sections or not shells:
        raise ValueError(f"{path}: has no *NODE or no *ELEMENT_SHELL")
    number = np.concatenate([np.asarray(nid) for nid, _ in sections])
    nodes = np.concatenate([np.asarray(xyz, dtype=np.float64) for _, xyz in sections])
    facets, parts = [], []
    for pid, ids, offsets in shells:
        for part, start, end in zip(pid, offsets[:-1], offsets[1:], strict=True):
            corners = [k for k in ids[start:end][:4] if k > 0]
            for third in range(2, len(dict.fromkeys(corners))):
                facets.append((corners[0], corners[third - 1], corners[third]))
                parts.append(int(part))
    order = np.argsort(number)
    wanted = np.array(facets, dtype=np.int64).reshape(-1, 3)
    place = np.searchsorted(number, wanted, sorter=order)
    found = order[np.minimum(place, len(order) - 1)]
    missing = wanted[number[found] != wanted]
    if missing.size:
        raise ValueError(f"{path}: a shell names node {missing[0]}, which is not in *NODE")
    names, region = np.unique(np.array(parts), return_inverse=True)
    return SurfaceMesh(nodes, found, region.reshape(-1), tuple(f"part {k}" for k in names))


def _check_size(path: Path, raw: SurfaceMesh, unit: str) -> None:
    """Refuse a mesh that has not the size of a car, naming the unit or the turn that fits."""
    size = raw.box[1] - raw.box[0]
    if _fits(size * UNITS[unit]):
        return
    for other, scale in UNITS.items():
        if _fits(size * scale):
            raise ValueError(
                f"{path}: is {size[0] * UNITS[unit]:.4g} m long in {unit}; a car in {other}? "
                f"Give --unit {other}"
            )
    long, wide, high = size * UNITS[unit]
    if _fits(np.array([long, high, wide]) if wide < high else np.array([wide, long, high])):
        raise ValueError(
            f"{path}: is {long:.3g} m along x, {wide:.3g} m along y and {high:.3g} m along z; "
            "turn it so that x points forward and z up"
        )
    raise ValueError(
        f"{path}: is {long:.3g} x {wide:.3g} x {high:.3g} m in {unit}: no car in any of the units "
        f"{', '.join(UNITS)}"
    )


def _fits(size: Array) -> bool:
    ranges = (LENGTH, WIDTH, HEIGHT)
    return all(low <= v <= high for v, (low, high) in zip(size.tolist(), ranges, strict=True))


def _check_placing(path: Path, mesh: SurfaceMesh) -> None:
    """Refuse a mesh that stands upside down, faces backwards or does not stand on the road."""
    low, high = mesh.box
    if not CLEARANCE[0] <= low[2] <= CLEARANCE[1]:
        raise ValueError(
            f"{path}: its lowest point is {low[2]:.3f} m above the road; lift it by --lift "
            f"{0.2 - low[2]:+.2f} for a clearance of 0.2 m"
        )
    middle = mesh.corners.mean(axis=1)
    height, length = high[2] - low[2], high[0] - low[0]

    def reach(from_share: float, to_share: float) -> float:
        """Return the length (m) of the car between two shares of its height."""
        share = (middle[:, 2] - low[2]) / height
        held = middle[(share >= from_share) & (share <= to_share), 0]
        return float(np.ptp(held)) if held.size else 0.0

    if mesh.is_closed and reach(0.0, 0.15) < 0.8 * reach(0.85, 1.0):
        raise ValueError(f"{path}: is shorter below than above; it stands upside down")
    if not mesh.is_closed and mesh.area_vectors[:, 2].sum() < -OPEN_ABOVE * mesh.areas.sum():
        raise ValueError(f"{path}: is open above; it stands upside down")

    def top(first: float, last: float) -> float:
        """Return the height (m) of the car between two shares of its length from the front."""
        share = (high[0] - middle[:, 0]) / length
        return float(middle[(share >= first) & (share <= last), 2].max(initial=low[2]))

    front, rear = top(0.03, 0.12), top(0.88, 0.97)
    if front - low[2] > 1.25 * (rear - low[2]):
        raise ValueError(
            f"{path}: is {front:.2f} m high at its front and {rear:.2f} m at its rear; it faces "
            "backwards: x must point forward"
        )


def _face_outwards(path: Path, mesh: SurfaceMesh, notes: list[str]) -> SurfaceMesh:
    """Return a mesh whose facets face outwards, and note what is open or turned."""
    flipped = mesh.flipped_edges()
    if len(flipped):
        where = mesh.nodes[flipped[0]].mean(axis=0)
        raise ValueError(
            f"{path}: {len(flipped):,} edges have facets that face opposite sides, the first at "
            f"{_place(where)}; make their normals consistent"
        )
    crowded = mesh.crowded_edges()
    if len(crowded):
        where = mesh.nodes[crowded[0]].mean(axis=0)
        raise ValueError(
            f"{path}: {len(crowded):,} edges have three facets or more, the first at "
            f"{_place(where)}; leave the inner sheets out"
        )
    inward = _facing_inwards(mesh)
    if inward.any():
        told = "all facets" if inward.all() else f"{int(inward.sum()):,} facets of single sheets"
        notes.append(f"{told} faced inwards and are turned")
        facets = np.where(inward[:, None], mesh.facets[:, ::-1], mesh.facets)
        mesh = replace(mesh, facets=facets)
    gaps = mesh.open_edges()
    if len(gaps):
        ends = mesh.nodes[gaps]
        total = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
        where = ends.mean(axis=1)[np.argmax(ends.mean(axis=1)[:, 0])]
        notes.append(
            f"the surface is open: {len(gaps):,} edges, {total:.2f} m in all, the foremost at "
            f"{_place(where)}; beyond an open edge the inside is what lies behind the last facet"
        )
    return mesh


def _facing_inwards(mesh: SurfaceMesh) -> NDArray[np.bool_]:
    """Return which facets (m,) belong to a sheet, connected by its edges, that faces inwards."""
    ordered = np.sort(mesh.edges, axis=1)
    _, edge = np.unique(ordered, axis=0, return_inverse=True)
    facet = np.repeat(np.arange(len(mesh.facets)), 3)
    count = len(mesh.facets)
    links = coo_array(
        (np.ones(len(facet)), (facet, count + edge.reshape(-1))),
        shape=(count + int(edge.max()) + 1,) * 2,
    )
    _, sheet = connected_components(links, directed=False)
    # Outwards is away from the car's middle axis.
    low, high = mesh.box
    middle = mesh.corners.mean(axis=1)
    axis = np.stack(
        [
            np.clip(middle[:, 0], *(low[0] + share * (high[0] - low[0]) for share in (0.25, 0.75))),
            np.zeros(count),
            np.full(count, low[2] + 0.4 * (high[2] - low[2])),
        ],
        axis=1,
    )
    outward = np.einsum("ij,ij->i", middle - axis, mesh.area_vectors)
    total = np.bincount(sheet[:count], weights=outward)
    return np.asarray(total[sheet[:count]] < 0.0)
