"""A headform against the hood of finite elements, at any point and from any elevation."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.law import ForceCurve
from models.declaration import read_inputs
from models.effects.chain import EffectChain
from models.effects.registry import effects_of, load_effect
from models.headform.facet_impact import FACET_COLUMNS, FORCE
from models.headform.impact import END_TIME, NORMAL, SAMPLES, SUMMARY, Impactor
from models.headform.shell_impact import (
    BALANCE,
    BOW,
    INTERNAL,
    strike_shells,
)
from models.headform.target import SAMPLING_RATE, Strike, impact_axes
from models.protocol import Input
from models.shells.assembly import TOUCHED, Assembly
from models.shells.settling import dent_near, settle, settling_steps
from models.vehicle.car import load_car
from models.vehicle.structure.build import structure_table
from models.vehicle.structure.change import Change
from models.vehicle.structure.panel import Structure
from models.vehicle.surface.wrap import wrap_point

Array = NDArray[np.float64]

LONGEST = 0.06
"""s of contact after which a run counts as failed."""
LEAVING = 0.002
"""Time (s) without contact after which the headform has left: a vibrating sheet may come after it.
"""
FURTHEST = 0.3
"""Distance (m) over which a headform is moved to the sheet at most."""
HOURGLASS_LIMIT = 0.1
"""Share of the internal energy in hourglass modes beyond which a mesh is too coarse (usual)."""

_TABLE = data.load("headform.toml")
_SHARED = ("impact_speed", "headform_mass", "headform_diameter", "friction_body_car")
_FROM_FACETS = ("wrap_around_distance", "lateral_position", "impact_elevation")


NEAR = 0.1
"""Distance (m) of a group of shells from the headform up to which it is stepped (assumed): farther
ones would not be touched."""


class FemTarget:
    """The front of a vehicle as shells: a hood of two sheets with ribs, and panels around it.

    Parameters
    ----------
    nominal : mapping of str to float
        Nominal values of the headform's inputs.
    vehicle : str, optional
        Name of a vehicle, or path of a car file with a deck of shells; by default the family car.
    size : float
        Size of the generated elements, m.

    Raises
    ------
    ValueError
        If there is no such vehicle, it has no finite elements, or the size is not within 8 to 60
        mm.
    """

    # The sheets have the mass and the rate of their own; a curve does not apply.
    effects: tuple[str, ...] = tuple(
        name
        for name in effects_of("headform")
        if load_effect(name).stage not in ("contact", "curve")
    )
    without: tuple[str, ...] = ()

    def __init__(self, nominal: Mapping[str, float], vehicle: str | None, size: float) -> None:
        self.car = load_car(vehicle or "family_car_1990s")
        self.vehicle, self.mesh = self.car.vehicle, self.car.mesh
        self.size = size
        # Refuses a car without shells, and a size out of range.
        self.car.structure(size, Change())
        version = self.car.digest or structure_table(self.vehicle.name)["version"]
        self.digest = f"+fem{version}"
        self._foundation = float(_TABLE["fem"]["foundation"])
        shared = {item.name: item for item in read_inputs(_TABLE)}
        facet = {item.name: item for item in read_inputs(_TABLE["facet"])}
        items = [
            *(shared[name] for name in _SHARED),
            *(facet[name] for name in _FROM_FACETS),
            *read_inputs(_TABLE["fem"]),
        ]
        self.inputs: tuple[Input, ...] = tuple(
            replace(item, nominal=float(nominal.get(item.name, item.nominal))) for item in items
        )

    def hood_curve(self, values: Mapping[str, float], chain: EffectChain) -> ForceCurve:
        """Refuse: a hood of finite elements has no loading curve.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        chain : EffectChain
            Effects that are switched on.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError("a hood of finite elements has no loading curve; fit one to its pulses")

    def structure(self, values: Mapping[str, float]) -> Structure:
        """Return the shells for the inputs.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        """
        change = Change(
            sheet=values["sheet_thickness"], strength=values["yield_stress"],
            rib=values["rib_depth"],
        )  # fmt: skip
        return self.car.structure(self.size, change)

    def strike(
        self, values: Mapping[str, float], chain: EffectChain, impactor: Impactor
    ) -> Strike | None:
        """Return the impact, or None if the headform does not meet the hood.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name, with effects.
        chain : EffectChain
            Effects that are switched on.
        impactor : Impactor
            The headform.
        """
        aim = wrap_point(self.mesh, values["wrap_around_distance"], values["lateral_position"])
        if not np.isfinite(aim).all():
            return None
        body = self.structure(values).assemble()
        start = body.start[body.touched]
        outward = body.normal[int(np.argmin(np.linalg.norm(start - aim, axis=1)))]
        down = values["impact_elevation"]
        heading = np.array([-math.cos(down), 0.0, -math.sin(down)])
        centre = _place(aim + impactor.radius * outward, heading, start, impactor.radius)
        if centre is None or heading @ outward >= 0.0:
            return None
        awake = _wake(body, centre, impactor.radius + NEAR)
        stride = math.ceil(1.0 / (SAMPLING_RATE * body.step))
        step = 1.0 / (SAMPLING_RATE * stride)
        velocity = values["impact_speed"] * heading
        axes = impact_axes(outward, heading)
        record = np.empty((round(LONGEST * SAMPLING_RATE), FACET_COLUMNS))
        summary, balance = np.zeros(SUMMARY), np.zeros(BALANCE)
        speeds = (float(-velocity @ axes[0]), float(velocity @ axes[1]))
        lowest = np.zeros(2)
        strike_shells(
            body, self._foundation * np.where(awake, body.area, 0.0), values["friction_body_car"],
            impactor.mass, impactor.inertia, impactor.radius, centre, velocity, np.zeros(3), axes,
            step, stride, LEAVING, np.zeros(9), record, balance, summary, lowest,
        )  # fmt: skip
        kept = record[: int(summary[SAMPLES])].copy()
        if not np.any(kept[:, NORMAL]):
            return None
        if not math.isnan(summary[END_TIME]):
            settle(body, step, settling_steps(step))
        dent, _ = dent_near(body, aim)
        internal = float(balance[INTERNAL])
        return Strike(
            speeds=speeds,
            record=kept[: _end(kept)],
            summary=summary,
            force=kept[: _end(kept), FORCE:],
            dent=(float(lowest[0]), dent),
            doubtful=bool(balance[BOW] > HOURGLASS_LIMIT * internal),
        )


def _end(record: Array) -> int:
    """Return the number of samples up to the last one with a force, and one more."""
    return min(int(np.flatnonzero(record[:, NORMAL])[-1]) + 2, len(record))


def _wake(body: Assembly, centre: Array, reach: float) -> NDArray[np.bool_]:
    """Wake the groups with a node within reach of a point, and return which nodes (t,) are theirs.

    ``reach`` is in m.
    """
    near = np.linalg.norm(body.start[body.touched] - centre, axis=1) < reach
    group = np.repeat(np.arange(len(body.awake)), np.diff(body.first[TOUCHED]))
    body.awake[np.unique(group[near])] = True
    return np.asarray(body.awake[group])


def _place(centre: Array, heading: Array, points: Array, radius: float) -> Array | None:
    """Return the centre of a sphere moved along a heading until it touches the first point."""
    away = points - centre
    along = away @ heading
    beside = np.square(away).sum(axis=1) - along**2
    near = beside < radius**2
    if not near.any():
        return None
    travel = float((along[near] - np.sqrt(radius**2 - beside[near])).min())
    return None if abs(travel) > FURTHEST else centre + travel * heading
