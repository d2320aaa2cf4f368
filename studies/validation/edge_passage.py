"""A limb held deep in the hood's edge and moved from the grille to the hood.

The case's authors chose facets because an ellipsoid that sinks deep into facets, as limbs do, meets
a force that changes its size and direction suddenly.
"""

import numpy as np
from numpy.typing import NDArray

from mcstudy.figures import style
from mcstudy.figures.panels import Curve, Panel, draw_panels
from models.component.passage import force_along
from models.facet.model import FacetModel
from models.multibody.setup import Crash, build_crash
from models.pedestrian.anthropometry import SEGMENTS
from models.vehicle.profile import Vehicle
from studies.validation.check import Part, check

Array = NDArray[np.float64]

LIMB = SEGMENTS.index("forearm_left")
DEPTH = 0.025
"""Penetration (m) at which the limb is held."""
STEP = 0.001
"""Distance (m) of the places along the path."""
FRONTS: dict[str, tuple[str, str] | None] = {
    "zones, ellipsoid": None,
    "facets, ellipsoid": ("ellipsoids", "deepest"),
    "facets, load distributed": ("facets", "distributed"),
}
"""Surface of the child and distribution of the load by label; None for the zones."""


def validate(workers: int) -> Part:
    """Return the part on the passage of the hood's edge."""
    forces, along = {}, np.zeros(0)
    for label, options in FRONTS.items():
        child, load = options or ("facets", "distributed")
        model = FacetModel(child=child, load=load)
        values = {item.name: item.nominal for item in model.inputs} | {"dive_angle": 0.0}
        crash = build_crash(values, model.vehicle)
        assert crash is not None
        along, places = _path(crash, model.vehicle)
        front = crash.front if options is None else model.front_of(crash.scenario)
        forces[label] = force_along(crash, front, LIMB, places)
    jumps = {label: _largest_turn(force) for label, force in forces.items()}
    panels = [
        Panel("path along the profile [mm]", "force of the car on the limb [kN]",
              [Curve(1e3 * along, np.linalg.norm(force, axis=1) / 1e3, label, style.PALETTE[k])
               for k, (label, force) in enumerate(forces.items())], legend="upper right"),
        Panel("path along the profile [mm]", "direction of the force from the horizontal [°]",
              [Curve(1e3 * along, _direction(force), label, style.PALETTE[k])
               for k, (label, force) in enumerate(forces.items())], legend="lower right"),
    ]  # fmt: skip
    said = ", ".join(f"{label} {jump:.1f}°" for label, jump in jumps.items())
    return Part(
        "Passage of the hood's edge",
        (
            f"A forearm across the car is held {1e3 * DEPTH:.0f} mm deep and moved from the grille "
            f"over the hood's edge. Largest turn of the force over {1e3 * STEP:.0f} mm: {said}.",
        ),
        [check("edge_turn", jumps["facets, load distributed"])],
        {"Size and direction of the force along the same path.":
         draw_panels(panels, columns=2, width=4.6, height=3.6)},
    )  # fmt: skip


def _path(crash: Crash, vehicle: Vehicle) -> tuple[Array, Array]:
    """Return the path (n,) in m and the limb's centres (n, 3), at one depth below the zones."""
    grille, edge, hood = (
        vehicle.zones[vehicle.zone_index(name)] for name in ("grille", "hood_edge", "hood")
    )
    radius = float(np.sqrt(crash.scenario.ellipsoids.square[LIMB, 0]))
    start, end = edge.arc
    angle = np.linspace(max(start, 0.0), end, 200)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outwards = np.array([-hood.direction[1], hood.direction[0]])
    outwards *= np.sign(outwards[1])
    lower = np.array([grille.direction[1], -grille.direction[0]])
    lower *= np.sign(lower[0])
    line = np.concatenate([
        grille.origin + np.linspace(0.3, 0.9, 60)[:, None] * grille.length * grille.direction
        + (radius - DEPTH) * lower,
        edge.origin + (edge.radius + radius - DEPTH) * ring,
        hood.origin + np.linspace(0.01, 0.2, 150)[:, None] * hood.direction
        + (radius - DEPTH) * outwards,
    ])  # fmt: skip
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    along = np.arange(0.0, length[-1], STEP)
    x, z = (np.interp(along, length, line[:, axis]) for axis in (0, 1))
    return along, np.stack([x, np.full(along.size, 0.2), z], axis=1)


def _direction(force: Array) -> Array:
    """Return the direction (n,) of forces from the horizontal, in degrees."""
    return np.asarray(np.degrees(np.arctan2(force[:, 2], force[:, 0])))


def _largest_turn(force: Array) -> float:
    """Return the largest change of the direction from one place to the next, in degrees."""
    loaded = np.linalg.norm(force, axis=1) > 1.0
    turn = np.abs(np.diff(_direction(force)))[loaded[1:] & loaded[:-1]]
    return float(turn.max(initial=0.0))
