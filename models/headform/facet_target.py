"""A headform against the surface of facets of a whole car, at any point and from any elevation."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.headform import HeadformContact
from models.contact.law import KNOTS, ForceCurve, stiffest_slope
from models.crash.ellipsoids import Ellipsoids
from models.crash.facet_front import FacetFront
from models.crash.facet_survey import empty_findings
from models.crash.scenario import HOOD
from models.crash.surfaces import CHANNELS, empty_contacts, law_surface
from models.declaration import read_inputs
from models.effects.chain import EffectChain
from models.effects.registry import effects_of, load_effect
from models.headform.facet_impact import FACET_COLUMNS, FORCE, Sphere, strike_facets
from models.headform.impact import NORMAL, SAMPLES, SUMMARY, Impactor
from models.headform.target import (
    LONGEST_CONTACT,
    SAMPLING_RATE,
    Strike,
    impact_axes,
    skin_of,
    steps_per_sample,
    write_law,
)
from models.multibody.tree import Motion, empty_loads, empty_motion
from models.pedestrian.skin import FINE, Skin, build_skin
from models.protocol import Input
from models.vehicle.car import load_car
from models.vehicle.surface.field import distances
from models.vehicle.surface.wrap import wrap_point

Array = NDArray[np.float64]

TOUCHED = 1e-6
"""Distance (m) of a headform from the surface at which it touches it."""
BACKWARDS = 200
"""Largest number of steps in which a headform is moved back to its first contact."""
FURTHEST = 0.5
"""Distance (m) over which a headform is moved back at most."""

_TABLE = data.load("headform.toml")
_SHARED = ("impact_speed", "headform_mass", "headform_diameter", "hood_stiffness",
           "hood_force_scale", "friction_body_car")  # fmt: skip


@dataclass(frozen=True)
class ImpactPoint:
    """A point of the surface.

    Attributes
    ----------
    position : (3,) array
        In the frame of the static car, m.
    normal : (3,) array
        Outward unit normal.
    region : str
        Name of the region.
    """

    position: Array
    normal: Array
    region: str


class FacetTarget:
    """The whole front of a car as a rigid surface of facets with the laws of its zones.

    Parameters
    ----------
    nominal : mapping of str to float
        Nominal values of the headform's inputs.
    skin : ForceCurve, optional
        The headform's skin; by default it is rigid.
    vehicle : str, optional
        Name of a vehicle, or path of a car file (``.toml``); by default the family car.
    hood_curve : sequence of pairs, optional
        Knots (penetration m, force N) of the hood's loading curve, in place of its corridor.

    Raises
    ------
    ValueError
        If there is no such vehicle, or the car file is not valid.
    """

    # A rigid surface has no mass of its own, and the laws of its zones no rate but their damping.
    effects: tuple[str, ...] = tuple(
        name
        for name in effects_of("headform")
        if load_effect(name).stage != "contact" or name == "skin_compliance"
    )
    without: tuple[str, ...] = ("unloading_slope_growth", "unloading_slope_curvature")

    def __init__(
        self,
        nominal: Mapping[str, float],
        skin: ForceCurve | None,
        vehicle: str | None,
        hood_curve: Sequence[Sequence[float]] | None = None,
    ) -> None:
        self._skin = skin
        car = load_car(vehicle or "family_car_1990s")
        self.vehicle, self.mesh, self._field = car.vehicle, car.mesh, car.field()
        if hood_curve is not None:
            self.vehicle = self.vehicle.with_curve(HOOD, hood_curve)
        self.digest = f"+{car.digest}" if car.digest else ""
        shared = {item.name: item for item in read_inputs(_TABLE)}
        items = [*(shared[name] for name in _SHARED), *read_inputs(_TABLE["facet"])]
        self.inputs: tuple[Input, ...] = tuple(
            replace(item, nominal=float(nominal.get(item.name, item.nominal))) for item in items
        )
        self._impact_point = functools.lru_cache(maxsize=4096)(self._find)

    def impact_point(self, distance: float, y: float) -> ImpactPoint | None:
        """Return a point of the surface, or None if the surface does not reach it.

        Parameters
        ----------
        distance : float
            Wrap-around distance, m.
        y : float
            Lateral position, m.
        """
        return self._impact_point(distance, y)

    def _find(self, distance: float, y: float) -> ImpactPoint | None:
        position = wrap_point(self.mesh, distance, y)
        if not np.isfinite(position).all():
            return None
        _, gradient = distances(self._field, position[None])
        size = float(np.linalg.norm(gradient[0]))
        if size == 0.0:
            return None
        away = np.linalg.norm(self.mesh.corners.mean(axis=1) - position, axis=1)
        region = self.mesh.names[self.mesh.region[int(np.argmin(away))]]
        return ImpactPoint(position, gradient[0] / size, region)

    def hood_curve(self, values: Mapping[str, float], chain: EffectChain) -> ForceCurve:
        """Return the loading curve of the hood, with effects.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        chain : EffectChain
            Effects that are switched on.
        """
        row = self.vehicle.zone_index(HOOD)
        curve = self.vehicle.zones[row].corridor.curve(values["hood_stiffness"])
        return chain.act("curve", curve.scaled(force=values["hood_force_scale"]), values)

    def _curves(self, values: Mapping[str, float], chain: EffectChain) -> list[ForceCurve]:
        """Return the loading curves of all zones."""
        hood = self.hood_curve(values, chain)
        return [
            hood if zone.name == HOOD else zone.corridor.curve(values[zone.coordinate])
            for zone in self.vehicle.zones
        ]

    def strike(
        self, values: Mapping[str, float], chain: EffectChain, impactor: Impactor
    ) -> Strike | None:
        """Return the impact, or None if the headform does not meet the surface.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name, with effects.
        chain : EffectChain
            Effects that are switched on.
        impactor : Impactor
            The headform.
        """
        point = self.impact_point(values["wrap_around_distance"], values["lateral_position"])
        if point is None:
            return None
        down = values["impact_elevation"]
        heading = np.array([-math.cos(down), 0.0, -math.sin(down)])
        placed = self._place(point, heading, impactor.radius)
        if placed is None:
            return None
        centre, axes = placed
        velocity = values["impact_speed"] * heading
        curves = self._curves(values, chain)
        contact = chain.act("contact", HeadformContact(values["friction_body_car"], 0.0, 0.0),
                            values)  # fmt: skip
        skin = skin_of(self._skin, contact, max(float(c.force[-1]) for c in curves))
        ellipsoids = sphere(impactor.radius, curves, skin)
        stiffest = max(stiffest_slope(c.penetration, c.force, c.unloading_ratio) for c in curves)
        stride = steps_per_sample(stiffest, max(c.damping for c in curves), impactor.mass)
        regions = len(curves)
        contacts = empty_contacts(1, regions, 0)
        record = np.empty((round(LONGEST_CONTACT * SAMPLING_RATE), FACET_COLUMNS))
        summary = np.zeros(SUMMARY)
        strike_facets(
            self._front(contact.friction, values["ploughing"], impactor.radius), ellipsoids,
            Sphere(np.array([impactor.mass]), np.array([impactor.inertia])),
            moving(centre, velocity), empty_loads(1), contacts, np.zeros(CHANNELS),
            np.zeros((2, 3)), np.zeros(6), axes, 1.0 / (SAMPLING_RATE * stride), stride,
            record, summary,
        )  # fmt: skip
        kept = record[: int(summary[SAMPLES])].copy()
        if not np.any(kept[:, NORMAL]):
            return None
        dents = [float(law_surface(ellipsoids, j, contacts.largest[0, j])) for j in range(regions)]
        struck = int(np.argmax(dents))
        lasting = 1.0 - 1.0 / curves[struck].unloading_ratio
        return Strike(
            speeds=(float(-velocity @ axes[0]), float(velocity @ axes[1])),
            record=kept,
            summary=summary,
            force=kept[:, FORCE:],
            dent=(dents[struck], dents[struck] * lasting),
        )

    def _place(
        self, point: ImpactPoint, heading: Array, radius: float
    ) -> tuple[Array, Array] | None:
        """Return the centre at first contact and the axes there, or None if it moves away."""
        centre = point.position + radius * point.normal
        travelled = 0.0
        for _ in range(BACKWARDS):
            distance, gradient = distances(self._field, centre[None])
            spare = float(distance[0]) - radius
            if spare >= -TOUCHED:
                break
            # Elsewhere the surface is nearer: the headform touches it there first.
            travelled -= spare
            centre = centre + spare * heading
        else:
            return None
        normal = gradient[0] / np.linalg.norm(gradient[0])
        if travelled > FURTHEST or heading @ normal >= 0.0:
            return None
        return centre, impact_axes(normal, heading)

    def _front(self, friction: float, ploughing: float, radius: float) -> FacetFront:
        regions = len(self.vehicle.zones)
        shares = np.array([zone.ploughing for zone in self.vehicle.zones])
        return FacetFront(
            field=self._field,
            dive=np.array([1.0, 0.0, 0.0, 0.0]),
            friction=np.full(regions, friction),
            ploughing=ploughing * shares,
            skin=sphere_skin(radius),
            distributed=np.ones(1),
            found=empty_findings(regions),
        )


@functools.lru_cache(maxsize=64)
def sphere_skin(radius: float) -> Skin:
    """Return the surface points of a sphere of a radius in m."""
    return build_skin(np.full((1, 3), radius), [FINE])


def moving(centre: Array, velocity: Array) -> Motion:
    """Return the motion of one body without rotation.

    Parameters
    ----------
    centre, velocity : (3,) array
        m and m/s.
    """
    motion = empty_motion(1)
    motion.centre[0] = centre
    motion.velocity[0] = velocity
    motion.rotation[0] = np.eye(3)
    return motion


def sphere(radius: float, curves: list[ForceCurve], skin: ForceCurve | None) -> Ellipsoids:
    """Return one sphere and its laws against the zones.

    Parameters
    ----------
    radius : float
        m.
    curves : list of ForceCurve
        Loading curves of the zones, in order.
    skin : ForceCurve, optional
        The sphere's skin; by default it is rigid.
    """
    laws = np.zeros((len(curves), KNOTS, 4))
    counts = [write_law(curve, skin, law) for curve, law in zip(curves, laws, strict=True)]
    return Ellipsoids(
        square=np.full((1, 3), radius**2),
        reach=np.array([radius]),
        offset=np.zeros((1, 3)),
        laws=laws,
        counts=np.array(counts, dtype=np.int64),
        damping=np.array([curve.damping for curve in curves]),
        surface_law=np.append(np.arange(len(curves)), -1)[None],
        pairs=np.zeros((0, 3), dtype=np.int64),
        pair_gap=np.zeros(0),
        pair_friction=0.0,
    )
