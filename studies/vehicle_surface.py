"""What was understood of a car's mesh: regions, wrap-around lines, open edges, a picture."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.figures import style
from mcstudy.figures.surface import Facets, draw_surface
from mcstudy.report import Table
from mcstudy.text import number
from models.vehicle.car import load_car
from models.vehicle.profile import vehicle_names
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.reader import read_surface
from models.vehicle.surface.wrap import wrap_line

DISTANCES = (1.0, 1.25, 1.5, 1.7, 2.1)
"""Wrap-around distances (m) of the lines drawn; child headforms strike between 1.0 and 1.5 m, adult
ones to 2.1 m (Euro NCAP [recalled])."""
STATIONS = 25
"""Lateral stations of a wrap-around line."""


@dataclass(frozen=True)
class SurfaceSummary:
    """A mesh and what was found.

    Attributes
    ----------
    mesh : SurfaceMesh
    notes : list of str
        What was changed, and what is left open.
    wrap_lines : dict
        (k, 3) points of the wrap-around lines by label.
    """

    mesh: SurfaceMesh
    notes: list[str]
    wrap_lines: dict[str, NDArray[np.float64]]

    def numbers(self) -> dict[str, object]:
        """Return the summary's numbers for JSON, in m and m2."""
        mesh = self.mesh
        return {
            "nodes": len(mesh.nodes),
            "facets": len(mesh.facets),
            "box": mesh.box,
            "closed": mesh.is_closed,
            "open_edges": len(mesh.open_edges()),
            "regions": {
                name: float(mesh.areas[mesh.region == k].sum()) for k, name in enumerate(mesh.names)
            },
            "notes": self.notes,
        }

    def table(self) -> Table:
        """Return the regions with their facets and areas."""
        mesh = self.mesh
        rows = []
        for k, name in enumerate(mesh.names):
            own = mesh.region == k
            corners = mesh.corners[own].reshape(-1, 3)
            low, high = corners.min(axis=0), corners.max(axis=0)
            spans = [f"{a:.2f} to {b:.2f}" for a, b in zip(low, high, strict=True)]
            rows.append([name, f"{int(own.sum()):,}", number(float(mesh.areas[own].sum())), *spans])
        head = ["region", "facets", "area [m2]", "x [m]", "y [m]", "z [m]"]
        return Table("Regions of the surface.", head, rows)


def understand_surface(source: str, unit: str = "m", lift: float = 0.0) -> SurfaceSummary:
    """Return what a mesh file, or a vehicle of the data folder, is understood to be.

    Parameters
    ----------
    source : str
        Path of a mesh or of a car file (``.toml``), or name of a vehicle.
    unit : str
        Unit of the mesh's coordinates.
    lift : float
        Height to add, m.

    Raises
    ------
    UserError
        If the mesh cannot be read, or is no car in this frame and unit.
    """
    try:
        if source in vehicle_names():
            mesh, notes = load_car(source).mesh, ["generated from the zones of the vehicle's file"]
        elif source.endswith(".toml"):
            car = load_car(source)
            mesh, notes = car.mesh, [*car.notes, f"regions have the laws of {car.vehicle.name}"]
        else:
            read = read_surface(Path(source), unit, lift)
            mesh, notes = read.mesh, read.notes
    except ValueError as error:
        raise UserError(str(error)) from None
    low, high = mesh.box[:, 1]
    stations = np.linspace(0.96 * low, 0.96 * high, STATIONS)
    lines = {f"WAD {d:g} m": wrap_line(mesh, d, stations) for d in DISTANCES}
    shown = {label: line for label, line in lines.items() if np.isfinite(line).any()}
    return SurfaceSummary(mesh, notes, shown)


def draw_summary(summary: SurfaceSummary, folder: Path) -> Path:
    """Write the picture of a mesh and return its path.

    Parameters
    ----------
    summary : SurfaceSummary
        From ``understand_surface``.
    folder : Path
        Created if it does not exist.

    Raises
    ------
    UserError
        If the folder cannot be written.
    """
    mesh = summary.mesh
    figure = draw_surface(
        Facets(mesh.corners, mesh.region, mesh.names),
        summary.wrap_lines,
        mesh.nodes[mesh.open_edges()],
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        style.save({"surface": figure}, folder)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error})") from None
    return folder / "surface.png"
