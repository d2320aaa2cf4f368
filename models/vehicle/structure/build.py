"""The structure of a vehicle of the data folder: its hood and the panels around it."""

from collections.abc import Mapping
from typing import Any

from models import data
from models.vehicle.profile import Vehicle
from models.vehicle.structure.change import Change
from models.vehicle.structure.hood import HOOD, build_hood
from models.vehicle.structure.panel import Structure
from models.vehicle.structure.panels import build_panel, mirrored_sides
from models.vehicle.surface.generator import loft_of

SMALLEST, LARGEST = 0.008, 0.06
"""Sizes of the elements, m (assumed)."""


def structure_table(vehicle: str) -> dict[str, Any]:
    """Return the data file of a vehicle's shells.

    Raises
    ------
    ValueError
        If there is none.
    """
    if vehicle not in data.names("fem"):
        known = ", ".join(data.names("fem"))
        raise ValueError(f"{vehicle!r} has no finite elements; there are those of {known}")
    return data.load(f"fem/{vehicle}.toml")


def check_size(size: float) -> None:
    """Raise ``ValueError`` if an element size (m) is not within 8 to 60 mm."""
    if not SMALLEST <= size <= LARGEST:
        raise ValueError(
            f"element_size must lie within {SMALLEST:g} and {LARGEST:g} m, given {size:g}"
        )


def panel_names(table: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the rows of a data file that can be meshed.

    Parameters
    ----------
    table : mapping
    """
    return (HOOD, *(row["name"] for row in table["panels"]))


def build_structure(
    vehicle: Vehicle, size: float, change: Change | None = None, only: tuple[str, ...] | None = None
) -> Structure:
    """Return the front of a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
    size : float
        Size of the elements, m.
    change : Change, optional
    only : tuple of str, optional
        Rows to mesh, see ``panel_names``; all by default.

    Raises
    ------
    ValueError
        If the vehicle has no finite elements.
    """
    change = change or Change()
    table = structure_table(vehicle.name)
    panels = []
    for name in panel_names(table) if only is None else only:
        if name == HOOD:
            sheet, strength, rib = change.factors(HOOD)
            panels.append(build_hood(vehicle, table, size, rib=rib, sheet=sheet, strength=strength))
            continue
        entry = next(row for row in table["panels"] if row["name"] == name)
        zone = entry.get("zone", entry["span"][0])
        sheet, strength, _ = change.factors(zone, backed=True)
        panels += [
            build_panel(
                vehicle, loft_of(vehicle.name), entry, table["materials"], size, sheet=sheet,
                strength=strength, behind=change.force.get(zone, 1.0), mirrored=mirrored,
            )
            for mirrored in mirrored_sides(entry)
        ]  # fmt: skip
    return Structure(tuple(panels))
