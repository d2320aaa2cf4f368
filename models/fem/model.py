"""The finite-element crash model behind the model protocol."""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import data
from models.crash.model import TICK
from models.crash.outcome import ANGULAR_CLASS, LINEAR_CLASS, Raw
from models.crash.record import Column, HeadContact
from models.crash.scenario import HOOD, Scenario
from models.crash.sheet import MOVING, PARTS, RUNNING, WORK, Sheet
from models.crash.sheet_front import SheetFront
from models.declaration import read_inputs, read_outputs
from models.effects.registry import effects_of
from models.facet.model import FacetModel
from models.multibody.model import MultibodyModel
from models.pedestrian.anthropometry import HEAD, SEGMENTS, Body
from models.pedestrian.tissue import build_tissue
from models.protocol import Input, Mesh
from models.shells.explicit import build_shells, stable_step
from models.shells.hood_mesh import OUTER, HoodMesh, build_hood, check_size, hood_table, outer_areas
from models.shells.settling import AROUND, dent_near, settle, settling_steps
from models.shells.state import WORK_BOW
from models.vehicle.profile import Vehicle, diving_points, static_point
from models.vehicle.surface.mesh import SurfaceMesh

Array = NDArray[np.float64]

SIZE = 0.02
"""Default size of the elements, m."""
ABOVE = 0.3
"""Height (m) of the space above the hood in which bodies wake the sheet."""

DENT = ("permanent_dent", "dent_behind_edge", "hood_intrusion")
"""Outputs of the head's dent."""

_TABLE = data.load("fem.toml")
_MORE = read_inputs(data.load("headform.toml")["fem"])


class FemModel(FacetModel):
    """The facet model with a hood of finite elements, coupled to the body at every step of it.

    See ``CrashModel`` for the other parameters.

    Parameters
    ----------
    vehicle : str
        Name of a vehicle that has a hood of finite elements.
    element_size : float
        Size of the elements, m.

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

    def __init__(
        self,
        vehicle: str = "family_car_1990s",
        element_size: float = SIZE,
        tick: float = TICK,
        channel_class: float = LINEAR_CLASS,
        angular_class: float = ANGULAR_CLASS,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        check_size(float(element_size))
        table = hood_table(vehicle)
        super().__init__(
            vehicle, tick=tick, channel_class=channel_class, angular_class=angular_class,
            effects=effects,
        )  # fmt: skip
        self.size = float(element_size)
        self.version = f"{self.version}.{table['version']}"
        self._values: Mapping[str, float] = {}
        self._sheet: Sheet | None = None
        self._hood: HoodMesh | None = None

    def _step(self, values: dict[str, float]) -> Raw | None:
        self._values = values
        return super()._step(values)

    def front_of(self, scenario: Scenario) -> Any:
        """Return the front of a scenario: facets, and the sheet in place of the hood."""
        values = self._values
        self._hood = hood = build_hood(
            self.vehicle, self.size, rib=values["rib_depth"], sheet=values["sheet_thickness"],
            strength=values["yield_stress"],
        )  # fmt: skip
        foundation = head_foundation(scenario.body, values["head_stiffness"])
        self._sheet = build_sheet(hood, foundation)
        return SheetFront(
            *super().front_of(scenario),
            sheet=self._sheet,
            row=np.array([self.vehicle.zone_index(HOOD)]),
            spins=np.zeros((len(SEGMENTS), 3)),
        )

    def _regions_of(self, mesh: SurfaceMesh) -> SurfaceMesh:
        """Return the car's mesh with a hood that reaches to the fenders, as the sheet does."""
        table = hood_table(self.vehicle.name)
        return with_whole_hood(self.vehicle, mesh, table["hood"]["half_width"])

    def _more_measures(self, raw: Raw) -> dict[str, Callable[[], float]]:
        """Return the evaluators of the outputs that the sheet gives."""
        sheet, hood = self._sheet, self._hood
        assert sheet is not None
        assert hood is not None
        account = sheet.account
        booked = float(sheet.shells.energy.sum() + account[MOVING] + account[PARTS])
        work = float(account[WORK])
        residual = (work - booked) / work if work > 0.0 else 0.0
        energy = sheet.shells.energy
        share = float(energy[WORK_BOW] / energy.sum()) if work > 0.0 else 0.0

        @functools.cache
        def dent() -> dict[str, float]:
            return self._dent_of(raw, sheet, hood)

        def of_dent(name: str) -> Callable[[], float]:
            return lambda: dent()[name]

        force = raw.record[:, Column.HEAD_CAR_FORCE]
        return {name: of_dent(name) for name in DENT} | {
            "head_contact_force": lambda: float(force.max()),
            "hood_energy_residual": lambda: residual,
            "hourglass_share": lambda: share,
        }

    def _dent_of(self, raw: Raw, sheet: Sheet, hood: HoodMesh) -> dict[str, float]:
        """Return the outputs of the head's dent, after the hood has come to rest."""
        settle(
            sheet.nodes, sheet.shells, sheet.materials, sheet.start, sheet.ties, sheet.gaps,
            sheet.supports, sheet.step,
            settling_steps(sheet.step) if sheet.clock[RUNNING] > 0.0 else 0,
            sheet.frame, sheet.local,
        )  # fmt: skip
        if not math.isfinite(raw.head_contact[HeadContact.TIME]):
            return dict.fromkeys(DENT, math.nan)
        contact = raw.head_contact[HeadContact.POINT : HeadContact.POINT + 3]
        x, z = static_point(self.vehicle, raw.scenario.dive_angle, contact[[0, 2]])
        place = np.array([x, contact[1], z])
        start, now = sheet.start[sheet.touched], sheet.nodes.position[sheet.touched]
        depth, where = dent_near(start, now, sheet.normal, place)
        own = np.linalg.norm(start - place, axis=1) < AROUND
        behind = float(hood.plan[sheet.touched[where], 0])
        return dict(
            zip(DENT, (depth, behind, float(sheet.lowest[own].max(initial=0.0))), strict=True)
        )

    def _meshes(self, raw: Raw) -> list[Mesh]:
        """Return the car without its hood, the dented hood, and the child."""
        found = super()._meshes(raw)
        sheet, hood = self._sheet, self._hood
        assert sheet is not None
        assert hood is not None
        kept = self.mesh.region != self.mesh.names.index(HOOD)
        car = found[0]
        found[0] = Mesh("car", car.nodes, car.faces[kept], "car")
        outer = hood.elements[(hood.sheet[hood.elements] == OUTER).all(axis=1)]
        nodes = sheet.nodes.position.copy()
        nodes[:, [0, 2]] = diving_points(self.vehicle, raw.scenario.dive_angle, nodes[:, [0, 2]])
        return [*found, Mesh("hood", nodes, outer, "car")]


def with_whole_hood(vehicle: Vehicle, mesh: SurfaceMesh, half_width: float) -> SurfaceMesh:
    """Return a mesh whose hood reaches to the gap beside the fenders.

    Parameters
    ----------
    vehicle : Vehicle
        Its zones give the regions their names; the strips beside the hood lie within the gap.
    mesh : SurfaceMesh
    half_width : float
        Of the hood, m.
    """
    strips = [
        k
        for k, name in enumerate(mesh.names)
        if vehicle.zone_index(name) >= 0 and vehicle.zones[vehicle.zone_index(name)].inner > 0.0
    ]
    middle = mesh.corners.mean(axis=1)
    above = mesh.area_vectors[:, 2] > 0.5 * mesh.areas
    own = np.isin(mesh.region, strips) & above & (np.abs(middle[:, 1]) < half_width)
    return replace(mesh, region=np.where(own, mesh.names.index(HOOD), mesh.region))


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


def build_sheet(hood: HoodMesh, foundation: Array) -> Sheet:
    """Return the hood at rest as a sheet that bodies press on.

    Parameters
    ----------
    hood : HoodMesh
    foundation : (n,) array
        Elastic foundation of each segment, Pa/m; 0 for the law of its flesh.
    """
    nodes, shells = build_shells(
        hood.position, hood.elements, hood.thickness, hood.material, hood.materials
    )
    touched = np.flatnonzero(hood.sheet == OUTER)
    low, high = hood.position.min(axis=0), hood.position.max(axis=0)
    segments = len(foundation)
    return Sheet(
        nodes=nodes, shells=shells, materials=hood.materials, start=hood.position.copy(),
        ties=hood.ties, gaps=hood.gaps, supports=hood.supports, touched=touched,
        area=outer_areas(hood, shells)[touched], pressed=np.zeros((len(touched), 3)),
        box=np.stack([low, high + np.array([0.0, 0.0, ABOVE])]),
        normal=hood.normal, foundation=foundation,
        step=stable_step(shells, hood.materials), clock=np.zeros(4),
        past=np.zeros((segments, 12)), present=np.zeros((segments, 12)), turn=np.zeros((3, 3)),
        candidate=np.zeros((segments, len(touched)), dtype=np.int64),
        number=np.zeros(segments, dtype=np.int64), depth=np.zeros(len(touched)),
        impulse=np.zeros((segments, 10)), place=np.zeros((segments, 4)),
        largest=np.zeros(segments), sunk=np.zeros(segments), account=np.zeros(4),
        lowest=np.zeros(len(touched)),
        frame=np.zeros((3, 3)), local=np.zeros(9),
    )  # fmt: skip
