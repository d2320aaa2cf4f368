"""The facet crash model behind the model protocol."""

import math
from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from models import data
from models.crash.facet_front import FacetFront
from models.crash.facet_survey import empty_findings
from models.crash.model import TICK
from models.crash.outcome import ANGULAR_CLASS, LINEAR_CLASS, Raw
from models.crash.scenario import Scenario
from models.crash.tape import Tape, path_at
from models.effects.registry import effects_of
from models.multibody.model import MultibodyModel
from models.pedestrian.anthropometry import HEAD, SEGMENTS, TRUNK, Body
from models.pedestrian.body_mesh import load_body_meshes
from models.pedestrian.skin import (
    FINE,
    SUBDIVISIONS,
    Skin,
    bare_skin,
    build_skin,
    joint_caps,
    segment_mesh,
)
from models.protocol import Mesh
from models.vehicle.car import load_car
from models.vehicle.profile import dive_shift, diving_points, static_point
from models.vehicle.surface.field import DistanceField, distances
from models.vehicle.surface.generator import laws_of_regions
from models.vehicle.surface.mesh import SurfaceMesh
from models.vehicle.surface.store import load_field
from models.vehicle.surface.wrap import leading_edge_distance, section, wrap_distance, wrap_path

Array = NDArray[np.float64]

CHILDREN = ("facets", "ellipsoids")
"""Surfaces of the child."""
LOADS = ("distributed", "deepest")
"""Distributions of the load over the points of a segment."""

_TABLE = data.load("facet.toml")


class FacetModel(MultibodyModel):
    """The body of the multibody model with a surface of facets against a car of facets.

    See ``CrashModel`` for the other parameters. Inputs and nominal values are those of the
    multibody model.

    Parameters
    ----------
    vehicle : str
        Name of a vehicle of the data folder, or path of a car file (``.toml``) with a user's mesh.
    subdivisions : int
        Of the icosahedra that are the surface of the limbs: 2 gives 162 points a segment. Head and
        trunk have three at least, 642 points each.
    child : str
        ``facets``, or ``ellipsoids`` as in the multibody model.
    body : str
        Path of a body file (``.toml``) with meshes of the user's own for some or all segments.
    load : str
        ``distributed`` over the points inside the car, or carried by the ``deepest`` one, as in the
        multibody model.

    Raises
    ------
    ValueError
        If an option is none of these, the car or body file is not valid, or the number of
        subdivisions is not within 1 to 4.
    """

    name = "facet"
    version = f"{MultibodyModel.version}.{_TABLE['version']}"
    effects: tuple[str, ...] = effects_of("facet")
    cost = float(_TABLE["cost"])

    def __init__(
        self,
        vehicle: str = "family_car_1990s",
        subdivisions: int = SUBDIVISIONS,
        child: str = "facets",
        body: str = "",
        load: str = "distributed",
        tick: float = TICK,
        channel_class: float = LINEAR_CLASS,
        angular_class: float = ANGULAR_CLASS,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        hood_curve: Sequence[Sequence[float]] | None = None,
    ) -> None:
        if not 1 <= subdivisions <= 4:
            raise ValueError(f"subdivisions must lie within 1 and 4, given {subdivisions}")
        for option, value, known in (("child", child, CHILDREN), ("load", load, LOADS)):
            if value not in known:
                raise ValueError(f"{option} must be one of {', '.join(known)}, given {value!r}")
        if child == "ellipsoids" and load == "distributed":
            raise ValueError("load: ellipsoids have no points that share it; choose 'deepest'")
        if body and child == "ellipsoids":
            raise ValueError("body: its meshes are facets; choose child 'facets'")
        self.car = car = load_car(vehicle)
        super().__init__(car.vehicle.name, tick, channel_class, angular_class, effects, hood_curve)
        self._own = load_body_meshes(body) if body else None
        own = [car.digest, self._own.digest if self._own else ""]
        self.version = "+".join([self.version, *(digest for digest in own if digest)])
        self._subdivisions = [int(subdivisions)] * len(SEGMENTS)
        for row in (HEAD, *TRUNK):
            self._subdivisions[row] = max(int(subdivisions), FINE)
        self._bare = child == "ellipsoids"
        self._distributed = np.array([float(load == "distributed")])
        self.mesh = car.mesh
        self._field = self._field_of(car.mesh)
        self._found = empty_findings(len(self.vehicle.zones))

    @property
    def _setup(self) -> tuple[Hashable, ...]:
        return (*super()._setup, *self._subdivisions, self._bare, *self._distributed)

    def front_of(self, scenario: Scenario) -> FacetFront:
        """Return the front of facets of a scenario."""
        dive = scenario.dive_angle
        return FacetFront(
            field=self._field,
            dive=np.array([math.cos(dive), math.sin(dive), *dive_shift(self.vehicle, dive)]),
            friction=scenario.zones.friction,
            ploughing=scenario.zones.ploughing,
            skin=self._skin(scenario.body),
            distributed=self._distributed,
            found=self._found,
        )

    def _field_of(self, mesh: SurfaceMesh) -> DistanceField:
        """Return the distance field of the car."""
        return load_field(mesh, laws_of_regions(self.vehicle, mesh))

    def _skin(self, body: Body) -> Skin:
        """Return the surface of a body."""
        if self._bare:
            return bare_skin(body.semi_axes)
        if self._own is None:
            return build_skin(body.semi_axes, self._subdivisions, caps=joint_caps(body))
        shapes = self._own.shapes_of(body)
        # The joints of a user's mesh are its own.
        caps = {row: cap for row, cap in joint_caps(body).items() if row not in shapes}
        return build_skin(body.semi_axes, self._subdivisions, shapes, caps)

    def _tape(self, scenario: Scenario, zone: int, point: Array) -> Tape:
        """Return what a tape on the mesh measures, in the plane of the head's first contact."""
        x, z = static_point(self.vehicle, scenario.dive_angle, point[[0, 2]])
        place = np.array([[x, point[1], z]])
        depth, gradient = distances(self._field, place)
        surface = place[0] - depth[0] * gradient[0] / np.linalg.norm(gradient[0])
        lines = section(self.mesh, float(surface[1]))
        if not len(lines):
            return Tape(math.nan, math.nan, np.empty((0, 3)))
        end = surface[[0, 2]]
        return Tape(
            wrap_distance(lines, end),
            leading_edge_distance(lines),
            path_at(wrap_path(lines, end), float(surface[1])),
        )

    def _meshes(self, raw: Raw) -> list[Mesh]:
        """Return the diving car and, if it has facets, the child."""
        car = self.mesh.nodes.copy()
        car[:, [0, 2]] = diving_points(self.vehicle, raw.scenario.dive_angle, car[:, [0, 2]])
        found = [Mesh("car", car, self.mesh.facets, "car")]
        if not self._bare:
            body = raw.scenario.body
            shapes = self._own.shapes_of(body) if self._own else {}
            for k, name in enumerate(SEGMENTS):
                if k in shapes:
                    found.append(Mesh(name, shapes[k].nodes, shapes[k].facets, name))
                else:
                    found.append(Mesh(name, *segment_mesh(body, k), name))
        return found
