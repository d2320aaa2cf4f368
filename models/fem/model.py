"""The finite-element crash model behind the model protocol."""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import data
from models.crash.facet_survey import empty_findings
from models.crash.model import TICK
from models.crash.outcome import ANGULAR_CLASS, LINEAR_CLASS, Raw
from models.crash.record import Column, HeadContact
from models.crash.scenario import HOOD, Scenario
from models.crash.sheet import (
    FRESH,
    NOW,
    TAKEN,
    WORK,
    Sheet,
    booked_energy,
    build_sheet,
    keep_shape,
    shapes_of,
)
from models.crash.sheet_front import SheetFront
from models.declaration import read_inputs, read_outputs
from models.effects.registry import effects_of
from models.facet.model import FacetModel
from models.multibody.model import MultibodyModel
from models.pedestrian.anthropometry import HEAD, SEGMENTS, Body
from models.pedestrian.tissue import build_tissue
from models.protocol import Input, Mesh
from models.shells.assembly import NODES
from models.shells.settling import AROUND, SETTLING, dent_near, settle, settling_steps
from models.shells.state import WORK_BOW
from models.vehicle.profile import Vehicle, diving_points, static_point
from models.vehicle.structure.build import structure_table
from models.vehicle.structure.change import Change
from models.vehicle.structure.cover import REPLACED, with_replaced
from models.vehicle.structure.panel import Structure
from models.vehicle.surface.field import DistanceField
from models.vehicle.surface.generator import laws_of_regions
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.store import load_field
from models.vehicle.surface.wrap import leading_edge_distance, section, wrap_distance

Array = NDArray[np.float64]

SIZE = 0.02
"""Default size of the elements, m."""
REFERENCE = 0.03
"""Penetration (m) at which a corridor's curve is compared with its median (assumed)."""

DENT = (
    "permanent_dent",
    "dent_behind_edge",
    "hood_intrusion",
    "pelvis_dent",
    "pelvis_dent_behind_edge",
)
"""Outputs of the dents."""
PELVIS = SEGMENTS.index("hip")

_TABLE = data.load("fem.toml")
_MORE = read_inputs(data.load("headform.toml")["fem"])


class FemModel(FacetModel):
    """The facet model with a front of finite elements, coupled to the body at every step of it.

    See ``CrashModel`` for the other parameters.

    Parameters
    ----------
    vehicle : str
        Name of a vehicle that has a front of finite elements, or path of a car file with a deck of
        shells.
    element_size : float
        Size of the generated elements, m.

    Raises
    ------
    ValueError
        If the vehicle has no finite elements, or the size is not within 8 to 60 mm.
    """

    name = "fem"
    version = f"{FacetModel.version}.{_TABLE['version']}"
    cost = float(_TABLE["cost"])
    effects: tuple[str, ...] = effects_of("fem")
    outputs = MultibodyModel.outputs + read_outputs(_TABLE)
    _own_inputs: tuple[Input, ...] = (
        *(
            replace(item, ignored=_TABLE["ignored"].get(item.name, ""))
            for item in MultibodyModel._own_inputs
        ),
        *_MORE,
    )
    coarse = int(_TABLE["coarse"])
    # Dents are read from the shells of the latest run.
    repeatable = False

    def __init__(
        self,
        vehicle: str = "family_car_1990s",
        element_size: float = SIZE,
        tick: float = TICK,
        channel_class: float = LINEAR_CLASS,
        angular_class: float = ANGULAR_CLASS,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        self.size = float(element_size)
        super().__init__(
            vehicle, tick=tick, channel_class=channel_class, angular_class=angular_class,
            effects=effects,
        )  # fmt: skip
        if not self.car.digest:
            self.version = f"{self.version}.{structure_table(vehicle)['version']}"
        self._found = empty_findings(len(self.vehicle.zones) + 1)
        self._values: Mapping[str, float] = {}
        self._sheet: Sheet | None = None
        self._structure: Structure | None = None

    def reached(self) -> float:
        """Return the time (s) that the run under way has reached."""
        return float(self._sheet.clock[NOW]) if self._sheet is not None else 0.0

    def _step(self, values: dict[str, float]) -> Raw | None:
        self._values = values
        return super()._step(values)

    def front_of(self, scenario: Scenario) -> Any:
        """Return the front of a scenario: facets, and shells in place of some of them."""
        values = self._chain.act("inputs", self._values, self._values)
        self._structure = self.car.structure(self.size, change_of(self.vehicle, values))
        foundation = head_foundation(scenario.body, values["head_stiffness"])
        zones = len(self.vehicle.zones)
        self._sheet = build_sheet(self._structure.assemble(), foundation, zones)
        return SheetFront(
            *super().front_of(scenario), sheet=self._sheet, spins=np.zeros((len(SEGMENTS), 3))
        )

    def _field_of(self, mesh: SurfaceMesh) -> DistanceField:
        """Return the distance field of the car, whose last region are the facets replaced."""
        whole = with_replaced(mesh, self.car.structure(self.size, Change()))
        rows = laws_of_regions(self.vehicle, mesh)
        self.mesh = whole
        return load_field(whole, np.append(rows, len(self.vehicle.zones)))

    def _more_measures(self, raw: Raw) -> dict[str, Callable[[], float]]:
        """Return the evaluators of the outputs that the shells give."""
        sheet = self._sheet
        assert sheet is not None
        work = float(sheet.account[WORK])
        residual = (work - booked_energy(sheet)) / work if work > 0.0 else 0.0
        energy = sheet.body.shells.energy
        share = float(energy[WORK_BOW] / energy.sum()) if work > 0.0 else 0.0

        @functools.cache
        def dents() -> dict[str, float]:
            return self._dents(raw, sheet)

        def of_dent(name: str) -> Callable[[], float]:
            return lambda: dents()[name]

        force = raw.record[:, Column.HEAD_CAR_FORCE]
        return {name: of_dent(name) for name in DENT} | {
            "head_contact_force": lambda: float(force.max()),
            "hood_energy_residual": lambda: residual,
            "hourglass_share": lambda: share,
        }

    def _dents(self, raw: Raw, sheet: Sheet) -> dict[str, float]:
        """Return the outputs of the dents of head and pelvis, once the shells are at rest."""
        body = sheet.body
        body.awake[:] = sheet.state != FRESH
        if body.awake.any():
            settle(body, body.step, settling_steps(body.step))
            last = sheet.film_time[max(int(sheet.clock[TAKEN]) - 1, 0)]
            keep_shape(sheet, last + SETTLING)
        found = dict.fromkeys(DENT, math.nan)
        if math.isfinite(raw.head_contact[HeadContact.TIME]):
            contact = raw.head_contact[HeadContact.POINT : HeadContact.POINT + 3]
            x, z = static_point(self.vehicle, raw.scenario.dive_angle, contact[[0, 2]])
            place = np.array([x, contact[1], z])
            start = body.start[body.touched]
            depth, where = dent_near(body, place)
            own = np.linalg.norm(start - place, axis=1) < AROUND
            found["permanent_dent"] = depth
            found["dent_behind_edge"] = self._behind_edge(start[where])
            found["hood_intrusion"] = float(sheet.lowest[own].max(initial=0.0))
        if sheet.sunk[PELVIS] > 0.0:
            place = body.start[body.touched[sheet.sunk_at[PELVIS]]]
            depth, where = dent_near(body, place)
            found["pelvis_dent"] = depth
            found["pelvis_dent_behind_edge"] = self._behind_edge(body.start[body.touched[where]])
        return found

    def _behind_edge(self, point: Array) -> float:
        """Return how far (m) a point lies behind the hood's leading edge line, by tape."""
        lines = section(self.mesh, float(point[1]))
        return wrap_distance(lines, point[[0, 2]]) - leading_edge_distance(lines)

    def _meshes(self, raw: Raw) -> list[Mesh]:
        """Return the car without what the shells replace, the shells over time, and the child."""
        found = super()._meshes(raw)
        sheet, structure = self._sheet, self._structure
        assert sheet is not None
        assert structure is not None
        car = found[0]
        kept = self.mesh.region != self.mesh.names.index(REPLACED)
        found[0] = Mesh("car", car.nodes, car.faces[kept], "car")
        time, shapes = shapes_of(sheet)
        shapes[..., [0, 2]] = diving_points(
            self.vehicle, raw.scenario.dive_angle, shapes[..., [0, 2]]
        )
        number = np.full(len(sheet.body.start), -1)
        number[sheet.body.touched] = np.arange(len(sheet.body.touched))
        base = sheet.body.first[NODES]
        for k, panel in enumerate(structure.panels):
            faces = number[panel.elements[panel.outer] + base[k]]
            rows, faces = np.unique(faces, return_inverse=True)
            found.append(Mesh(panel.name, shapes[:, rows], faces.reshape(-1, 4), "car", time))
        return found


def change_of(vehicle: Vehicle, values: Mapping[str, float]) -> Change:
    """Return what a run's inputs change in the shells.

    A corridor's coordinate stands for its curve's force over the median's at a reference depth.

    Parameters
    ----------
    vehicle : Vehicle
    values : mapping of str to float
        All inputs by name.
    """
    force = {}
    depth = np.array([REFERENCE])
    for zone in vehicle.zones:
        curve = zone.corridor.curve(values[zone.coordinate])
        force[zone.name] = float(curve.at(depth)[0] / zone.corridor.median.at(depth)[0])
    force[HOOD] *= values["hood_force_scale"]
    return Change(
        sheet=values["sheet_thickness"],
        strength=values["yield_stress"],
        rib=values["rib_depth"],
        force=force,
    )


def head_foundation(body: Body, head_stiffness: float) -> Array:
    """Return the elastic foundations (n,) of a body's segments, Pa/m: only the head has one.

    A sphere of radius R pressed to the depth d into a foundation K feels K pi R d^2, which is the
    force of the head's tissue at one depth of the data file.

    Parameters
    ----------
    body : Body
    head_stiffness : float
        Factor on the stiffness of the head's tissue.
    """
    foundation = np.zeros(len(SEGMENTS))
    depth = float(_TABLE["head_depth"])
    tissue = build_tissue(body)["head"].scaled(force=head_stiffness)
    radius = float(np.cbrt(np.prod(body.semi_axes[HEAD])))
    foundation[HEAD] = float(tissue.at(np.array([depth]))[0]) / (math.pi * radius * depth**2)
    return foundation
