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
from models.shells.explicit import build_shells, stable_step
from models.shells.hood_mesh import OUTER, HoodMesh, build_hood, check_size, hood_table, outer_areas
from models.shells.settling import dent_near, settle, settling_steps
from models.vehicle.profile import load_vehicle
from models.vehicle.surface.generator import generate_surface
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


class FemTarget:
    """The hood of a vehicle as two sheets of shells with ribs, ties and supports.

    Parameters
    ----------
    nominal : mapping of str to float
        Nominal values of the headform's inputs.
    vehicle : str, optional
        By default the family car.
    size : float
        Size of the elements, m.

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

    def __init__(self, nominal: Mapping[str, float], vehicle: str | None, size: float) -> None:
        check_size(size)
        self.vehicle = load_vehicle(vehicle or "family_car_1990s")
        table = hood_table(self.vehicle.name)
        self.size = size
        self.digest = f"+fem{table['version']}"
        self._foundation = float(table["headform_skin"]["foundation"])
        self.mesh = generate_surface(self.vehicle.name)
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

    def hood(self, values: Mapping[str, float]) -> HoodMesh:
        """Return the mesh for the inputs.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        """
        return build_hood(
            self.vehicle, self.size, rib=values["rib_depth"], sheet=values["sheet_thickness"],
            strength=values["yield_stress"],
        )  # fmt: skip

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
        hood = self.hood(values)
        aim = wrap_point(self.mesh, values["wrap_around_distance"], values["lateral_position"])
        if not np.isfinite(aim).all():
            return None
        down = values["impact_elevation"]
        heading = np.array([-math.cos(down), 0.0, -math.sin(down)])
        touched = np.flatnonzero(hood.sheet == OUTER)
        centre = _place(aim + impactor.radius * hood.normal, heading, hood.position[touched],
                        impactor.radius)  # fmt: skip
        if centre is None or heading @ hood.normal >= 0.0:
            return None
        nodes, shells = build_shells(
            hood.position, hood.elements, hood.thickness, hood.material, hood.materials
        )
        stride = math.ceil(1.0 / (SAMPLING_RATE * stable_step(shells, hood.materials)))
        step = 1.0 / (SAMPLING_RATE * stride)
        velocity = values["impact_speed"] * heading
        axes = impact_axes(hood.normal, heading)
        record = np.empty((round(LONGEST * SAMPLING_RATE), FACET_COLUMNS))
        summary, balance = np.zeros(SUMMARY), np.zeros(BALANCE)
        speeds = (float(-velocity @ axes[0]), float(velocity @ axes[1]))
        parts = (hood.ties, hood.gaps, hood.supports)
        work = (np.zeros((3, 3)), np.zeros(9))
        lowest = np.zeros(2)
        strike_shells(
            nodes, shells, hood.materials, hood.position, *parts, touched,
            self._foundation * outer_areas(hood, shells)[touched], values["friction_body_car"],
            impactor.mass, impactor.inertia, impactor.radius, centre, velocity, np.zeros(3), axes,
            step, stride, LEAVING, np.zeros(9), *work, record, balance, summary, lowest,
        )  # fmt: skip
        kept = record[: int(summary[SAMPLES])].copy()
        if not np.any(kept[:, NORMAL]):
            return None
        if not math.isnan(summary[END_TIME]):
            settle(nodes, shells, hood.materials, hood.position, *parts, step,
                   settling_steps(step), *work)  # fmt: skip
        dent, _ = dent_near(hood.position[touched], nodes.position[touched], hood.normal, aim)
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
