"""Distance fields kept on disk, by the content of their meshes."""

import contextlib
import hashlib
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.compilation import is_usable, user_cache
from models.vehicle.surface.field import DistanceField
from models.vehicle.surface.field_build import SPACING, VERSION, build_field
from models.vehicle.surface.mesh import SurfaceMesh


def load_field(
    mesh: SurfaceMesh, regions: NDArray[np.int64], spacing: float = SPACING
) -> DistanceField:
    """Return the distance field of a mesh, from the user's cache if it was built before.

    Parameters
    ----------
    mesh : SurfaceMesh
    regions : (names,) array of int
        Region of the field for each region of the mesh.
    spacing : float
        Distance of the grid's nodes, m.

    Raises
    ------
    ValueError
        If the mesh has no inside; see ``build_field``.
    """
    file = _file_of(mesh, regions, spacing)
    if file is not None:
        # A file that cannot be read is built anew.
        unreadable = contextlib.suppress(
            OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile
        )
        with unreadable, np.load(file) as held:
            return DistanceField(*(held[name] for name in DistanceField._fields))
    field = build_field(mesh, regions, spacing)
    if file is not None:
        with contextlib.suppress(OSError):
            with tempfile.NamedTemporaryFile(dir=file.parent, delete=False) as part:
                np.savez(part, **field._asdict())
            Path(part.name).replace(file)
    return field


def _file_of(mesh: SurfaceMesh, regions: NDArray[np.int64], spacing: float) -> Path | None:
    """Return the file of a field, or None where no cache can be written."""
    base = user_cache()
    folder = None if base is None else base / "mcstudy" / "surfaces"
    if folder is None or not is_usable(folder):
        return None
    digest = hashlib.sha256(f"{VERSION} {spacing!r}".encode())
    for array in (mesh.nodes, mesh.facets, mesh.region, regions):
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return folder / f"{digest.hexdigest()[:24]}.npz"
