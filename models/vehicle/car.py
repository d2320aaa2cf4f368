"""A car as the models with surfaces use it: mesh, laws of its regions, distance field, shells.

A car is a vehicle of the data folder, whose mesh is generated, or a car file: a user's mesh, the
zones of a vehicle whose laws its facets have, and perhaps a user's deck of shells.
"""

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.vehicle.profile import Vehicle, load_vehicle
from models.vehicle.structure.build import build_structure, check_size
from models.vehicle.structure.change import Change
from models.vehicle.structure.own_front import changed, read_own_front
from models.vehicle.structure.panel import Structure
from models.vehicle.surface.field import DistanceField
from models.vehicle.surface.generator import generate_surface, laws_of_regions
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.reader import read_surface
from models.vehicle.surface.store import load_field

Array = NDArray[np.float64]

FORMAT = "mcstudy-car/1"
_KEYS = {"format", "mesh", "unit", "lift", "vehicle", "zone", "regions", "shells"}
_SHELLS = {"deck", "units", "ignore"}
_RULES = {"part", "file", "box"}


@dataclass(frozen=True)
class Car:
    """A car of facets.

    Attributes
    ----------
    vehicle : Vehicle
        Its zones give the laws.
    mesh : SurfaceMesh
        Regions are zones of the vehicle, or its lamps.
    digest : str
        Of a user's mesh and rules; empty for a vehicle of the data folder.
    notes : list of str
        What was changed in a user's mesh, and what is left open.
    own_shells : Structure or None
        A user's deck of shells.
    """

    vehicle: Vehicle
    mesh: SurfaceMesh
    digest: str
    notes: list[str]
    own_shells: Structure | None = None

    def structure(self, size: float, change: Change) -> Structure:
        """Return the shells of the car's front.

        Parameters
        ----------
        size : float
            Size of the elements of generated shells, m.
        change : Change
            Factors.

        Raises
        ------
        ValueError
            If the car has no shells, the size is not within 8 to 60 mm, or what is asked for does
            not apply to a user's deck.
        """
        if self.own_shells is not None:
            if change.rib != 1.0:
                raise ValueError("rib_depth: a user's deck has no ribs that could be changed")
            return changed(self.own_shells, change, [zone.name for zone in self.vehicle.zones])
        if self.digest:
            raise ValueError("the car file has no table 'shells': it has no finite elements")
        check_size(size)
        return build_structure(self.vehicle, size, change)

    def field(self) -> DistanceField:
        """Return the distance field, whose regions are the rows of the vehicle's zones."""
        return load_field(self.mesh, laws_of_regions(self.vehicle, self.mesh))


def load_car(name: str) -> Car:
    """Return a car.

    Parameters
    ----------
    name : str
        Name of a vehicle of the data folder, or path of a car file (``.toml``).

    Raises
    ------
    ValueError
        In one line, if there is no such vehicle, or the file or its mesh is not valid.
    """
    if not name.endswith(".toml"):
        vehicle = load_vehicle(name)
        return Car(vehicle, generate_surface(name), "", [])
    try:
        table = tomllib.loads(Path(name).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{name}: cannot be read ({error})") from None
    try:
        return _read_car(table, Path(name).parent)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _read_car(table: Mapping[str, Any], folder: Path) -> Car:
    """Return the car of a car file's table, files beside it in ``folder``."""
    _check_table(table)
    vehicle = load_vehicle(table["vehicle"])
    rules = table.get("regions", [])
    files = [folder / rule["file"] for rule in rules if "file" in rule]
    read = read_surface(
        folder / table["mesh"], table.get("unit", "m"), float(table.get("lift", 0.0)), files
    )
    row = np.full(len(read.mesh.facets), _zone(vehicle, table["zone"], "zone"))
    # The first rule that fits a facet gives its zone: later ones are written first.
    for k in range(len(rules) - 1, -1, -1):
        own = _facets_of(read.mesh, rules[k], f"regions[{k}]")
        row[own] = _zone(vehicle, rules[k]["zone"], f"regions[{k}].zone")
    used, region = np.unique(row, return_inverse=True)
    names = tuple(vehicle.zones[k].name for k in used.tolist())
    mesh = replace(read.mesh, region=region.reshape(-1), names=names)
    digest = hashlib.sha256()
    for array in (mesh.nodes, mesh.facets, row):
        digest.update(np.ascontiguousarray(array).tobytes())
    shells, notes = None, read.notes
    if "shells" in table:
        entry = table["shells"]
        shells, more = read_own_front(
            folder / entry["deck"], entry["units"], entry.get("ignore", []), read.shift, mesh,
            laws_of_regions(vehicle, mesh),
        )  # fmt: skip
        notes = [*notes, *more]
        digest.update(shells.digest.encode())
    return Car(vehicle, mesh, digest.hexdigest()[:12], notes, shells)


def _check_table(table: Mapping[str, Any]) -> None:
    """Raise ``ValueError`` if a car file lacks a key, or has one unknown or of a wrong type."""
    if table.get("format") != FORMAT:
        raise ValueError(f'format must be "{FORMAT}", given {table.get("format")!r}')
    for key in table:
        if key not in _KEYS:
            raise ValueError(f"{key}: unknown key; a car file has {', '.join(sorted(_KEYS))}")
    for key in ("mesh", "vehicle", "zone", "unit"):
        if not isinstance(table.get(key, "m" if key == "unit" else None), str):
            raise ValueError(f"{key}: must be a text")
    lift = table.get("lift", 0.0)
    if isinstance(lift, bool) or not isinstance(lift, int | float):
        raise ValueError("lift: must be a height in m")
    _check_shells(table.get("shells"))
    rules = table.get("regions", [])
    if not isinstance(rules, list) or not all(isinstance(rule, dict) for rule in rules):
        raise ValueError("regions: must be tables [[regions]]")
    for k, rule in enumerate(rules):
        place = f"regions[{k}]"
        if not isinstance(rule.get("zone"), str):
            raise ValueError(f"{place}.zone: must be a text")
        if len(_RULES & set(rule)) != 1 or set(rule) - _RULES - {"zone"}:
            raise ValueError(f"{place}: has zone and one of part, file and box")
        for key in ("part", "file"):
            if not isinstance(rule.get(key, ""), str):
                raise ValueError(f"{place}.{key}: must be a text")


def _check_shells(entry: Any) -> None:
    """Raise ``ValueError`` if a car file's table of shells is not valid."""
    if entry is None:
        return
    if not isinstance(entry, dict) or set(entry) - _SHELLS:
        raise ValueError(f"shells: is a table with {', '.join(sorted(_SHELLS))}")
    for key in ("deck", "units"):
        if not isinstance(entry.get(key), str):
            raise ValueError(f"shells.{key}: must be a text")
    ignore = entry.get("ignore", [])
    if not isinstance(ignore, list) or not all(isinstance(name, str) for name in ignore):
        raise ValueError("shells.ignore: must be a list of keywords")


def _zone(vehicle: Vehicle, name: str, place: str) -> int:
    """Return the row of a zone."""
    row = vehicle.zone_index(name)
    if row < 0:
        known = ", ".join(zone.name for zone in vehicle.zones)
        raise ValueError(f"{place}: {vehicle.name} has no zone {name!r}; it has {known}")
    return row


def _facets_of(mesh: SurfaceMesh, rule: Mapping[str, Any], place: str) -> NDArray[np.bool_]:
    """Return which facets a rule covers."""
    if "box" in rule:
        try:
            low, high = np.array(rule["box"], dtype=np.float64).reshape(2, 3)
        except (ValueError, TypeError):
            raise ValueError(
                f"{place}.box: must be two corners [[x, y, z], [x, y, z]] in m"
            ) from None
        middle = mesh.corners.mean(axis=1)
        found = ((middle >= np.minimum(low, high)) & (middle <= np.maximum(low, high))).all(axis=1)
    else:
        name = Path(rule["file"]).stem if "file" in rule else rule["part"]
        if name not in mesh.names:
            raise ValueError(
                f"{place}: the mesh has no part {name!r}; it has {', '.join(mesh.names)}"
            )
        found = mesh.region == mesh.names.index(name)
    if not found.any():
        raise ValueError(f"{place}: covers no facet")
    return np.asarray(found)
