"""Meshes of a user's own for the segments of a body.

A body file names a mesh for some or all segments, in the standing posture of the project's body
(arms hanging, x forward, y left, z up, origin on the ground between the soles), and the person that
they were made for. They are scaled with the semi-axes of the segments to the body of each run.
"""

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.pedestrian.anthropometry import SEGMENTS, Body, build_body, is_possible
from models.pedestrian.skin import SegmentShape
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.reader import UNITS, read_mesh

Array = NDArray[np.float64]

FORMAT = "mcstudy-body/1"
_PERSON = ("age", "stature", "body_mass", "head_mass")
_KEYS = {"format", "unit", *_PERSON, "segments"}
NEAR = 2.0
"""Distance of a mesh's middle from the segment's, in largest semi-axes, beyond which the mesh is
not in its place (assumed)."""
FINENESS = 0.025
"""Longest edge (m) of a mesh: longer ones are cut, so that points lie close enough for contact."""


@dataclass(frozen=True)
class BodyMeshes:
    """Meshes of segments for the person that they were made for.

    Attributes
    ----------
    shapes : mapping of int to SegmentShape
        By row of the segment.
    person : Body
        The person.
    digest : str
        Of the meshes and the person.
    """

    shapes: Mapping[int, SegmentShape]
    person: Body
    digest: str

    def shapes_of(self, body: Body) -> dict[int, SegmentShape]:
        """Return the meshes scaled to another body, by row of the segment.

        Parameters
        ----------
        body : Body
        """
        ratio = body.semi_axes / self.person.semi_axes
        return {
            row: SegmentShape(ratio[row] * shape.nodes, shape.facets)
            for row, shape in self.shapes.items()
        }


def load_body_meshes(name: str) -> BodyMeshes:
    """Return the meshes of a body file.

    Parameters
    ----------
    name : str
        Path of the file (``.toml``).

    Raises
    ------
    ValueError
        In one line, if the file or one of its meshes is not valid.
    """
    try:
        table = tomllib.loads(Path(name).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{name}: cannot be read ({error})") from None
    try:
        return _read(table, Path(name).parent)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _read(table: Mapping[str, Any], folder: Path) -> BodyMeshes:
    """Return the meshes of a body file's table, files beside it in ``folder``."""
    if table.get("format") != FORMAT:
        raise ValueError(f'format must be "{FORMAT}", given {table.get("format")!r}')
    for key in table:
        if key not in _KEYS:
            raise ValueError(f"{key}: unknown key; a body file has {', '.join(sorted(_KEYS))}")
    values = [table.get(key) for key in _PERSON]
    numbers = [float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(numbers) != len(_PERSON):
        raise ValueError(f"{', '.join(_PERSON)}: must be numbers, in years, m and kg")
    if min(numbers) <= 0.0 or not is_possible(*numbers[1:]):
        raise ValueError(f"{', '.join(_PERSON)}: no such person can exist")
    unit = table.get("unit", "m")
    if unit not in UNITS:
        raise ValueError(f"unit must be one of {', '.join(UNITS)}, given {unit!r}")
    files = table.get("segments")
    if not isinstance(files, dict) or not files:
        raise ValueError("[segments]: must name the file of at least one segment")
    person = build_body(*numbers)
    digest = hashlib.sha256(repr(numbers).encode())
    shapes = {}
    for segment, file in files.items():
        if segment not in SEGMENTS or not isinstance(file, str):
            raise ValueError(
                f"segments.{segment}: must be the file of one of {', '.join(SEGMENTS)}"
            )
        row = SEGMENTS.index(segment)
        shape = _shape(read_mesh(folder / file), UNITS[unit], person, row, file)
        digest.update(f"{row}".encode() + shape.nodes.tobytes() + shape.facets.tobytes())
        shapes[row] = shape
    return BodyMeshes(shapes, person, digest.hexdigest()[:12])


def _shape(raw: SurfaceMesh, scale: float, person: Body, row: int, file: str) -> SegmentShape:
    """Return a mesh about the ellipsoid's centre, checked and fine enough.

    Raises
    ------
    ValueError
        If it is open, inside out, or not where the segment is.
    """
    from trimesh.remesh import subdivide_to_size

    mesh = SurfaceMesh(scale * raw.nodes, raw.facets, raw.region, raw.names).compact()
    if not mesh.is_closed:
        raise ValueError(f"{file}: has {len(mesh.open_edges()):,} open edges; a segment is closed")
    facets = mesh.facets if mesh.volume > 0.0 else mesh.facets[:, ::-1]
    nodes = mesh.nodes - person.ellipsoid[row]
    middle = np.linalg.norm(nodes.mean(axis=0))
    if middle > NEAR * person.semi_axes[row].max():
        raise ValueError(
            f"{file}: lies {middle:.3g} m from the {SEGMENTS[row].replace('_', ' ')} of a standing "
            "person; check unit, axes and person"
        )
    fine, cut = subdivide_to_size(nodes, facets, FINENESS)
    joined = SurfaceMesh(
        np.asarray(fine), np.asarray(cut, dtype=np.int64), np.zeros(len(cut), np.int64), ("",)
    ).compact()
    return SegmentShape(np.ascontiguousarray(joined.nodes), joined.facets)
