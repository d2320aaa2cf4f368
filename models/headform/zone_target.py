"""A headform against a plane with the loading curve of one zone."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.corridor import Corridor, load_corridors, read_curve
from models.contact.headform import HeadformContact
from models.contact.law import (
    DAMPING_ONSET,
    KNOTS,
    SURFACE,
    ForceCurve,
    interpolate_law,
    stiffest_slope,
)
from models.declaration import read_inputs
from models.effects.chain import EffectChain
from models.effects.registry import effects_of
from models.headform.impact import (
    COLUMNS,
    DEEPEST,
    NORMAL,
    RATE,
    SAMPLES,
    SUMMARY,
    TANGENTIAL,
    Impactor,
    Part,
    Surface,
    strike,
    strike_part,
    write_guide_drag,
)
from models.headform.target import (
    LONGEST_CONTACT,
    SAMPLING_RATE,
    Strike,
    skin_of,
    steps_per_sample,
    write_law,
)
from models.protocol import Input
from models.recent import Recent
from models.vehicle.profile import load_vehicle

Array = NDArray[np.float64]


LEFT = 0.005
"""s without contact after which a headform has left a part of the hood that moves on its own."""
MOST = 64
"""Impacts kept, some 10 kB each: those that differ only in how they are recorded share one."""
MOTION = frozenset({"impact_speed", "impact_angle"})
"""Inputs that do not change what is struck."""


class _Hood(NamedTuple):
    """What is struck: its law, number of knots, steps per sample, contact, and part with mass.

    With the force of the rig's guide and the exponent of the speed in it.
    """

    laws: Array
    knots: int
    stride: int
    surface: Surface
    part: Part | None
    unloading_ratio: float
    guide: tuple[float, float]


class ZoneTarget:
    """A plane struck by a headform.

    Parameters
    ----------
    nominal : mapping of str to float
        Nominal values of the headform's inputs.
    skin : ForceCurve, optional
        The headform's skin; by default it is rigid.
    hood_curve, corridor, vehicle, zone
        See ``models.headform.model.HeadformModel``.

    Raises
    ------
    ValueError
        If the curve, corridor, vehicle or zone is not valid.
    """

    effects: tuple[str, ...] = effects_of("headform")
    without: tuple[str, ...] = ()

    def __init__(
        self,
        nominal: Mapping[str, float],
        skin: ForceCurve | None,
        hood_curve: Sequence[Sequence[float]] | None,
        corridor: str | None,
        vehicle: str | None,
        zone: str,
    ) -> None:
        self._skin = skin
        self._strikes: Recent[tuple[float, ...], Strike] = Recent(MOST)
        self._hoods: Recent[tuple[float, ...], _Hood] = Recent(1)
        self._curve: ForceCurve | None = None
        self._corridor: Corridor | None = None
        self.digest = ""
        known = dict(nominal)
        if hood_curve is not None:
            self._curve = _curve_of(hood_curve)
        else:
            self._corridor = _corridor_of(corridor, vehicle, zone)
            median = self._corridor.median
            if corridor is not None and corridor.endswith(".toml"):
                curves = repr(self._corridor).encode()
                self.digest = "+" + hashlib.sha256(curves).hexdigest()[:12]
            known |= {
                "hood_unloading_ratio": median.unloading_ratio,
                "hood_damping": median.damping,
                "hood_damping_onset": DAMPING_ONSET if median.damping > 0.0 else 0.0,
            }
        self.inputs: tuple[Input, ...] = tuple(
            replace(item, nominal=float(known.get(item.name, item.nominal)))
            for item in read_inputs(data.load("headform.toml"))
            if self._corridor is not None or item.name != "hood_stiffness"
        )

    def hood_curve(self, values: Mapping[str, float], chain: EffectChain) -> ForceCurve:
        """Return the loading curve of the zone, with effects.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        chain : EffectChain
            Effects that are switched on.
        """
        if self._corridor is not None:
            curve = self._corridor.curve(values["hood_stiffness"])
        else:
            assert self._curve is not None
            curve = self._curve
        scaled = ForceCurve(
            curve.penetration,
            curve.force * values["hood_force_scale"],
            values["hood_unloading_ratio"],
            values["hood_damping"],
        )
        return chain.act("curve", scaled, values)

    def strike(self, values: Mapping[str, float], chain: EffectChain, impactor: Impactor) -> Strike:
        """Return the impact.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name, with effects.
        chain : EffectChain
            Effects that are switched on.
        impactor : Impactor
            The headform.
        """
        acting = chain.acting(values)
        key = tuple(acting.values())
        struck = self._strikes.get(key)
        if struck is None:
            struck = self._step(acting, self._hood(acting, chain, impactor.mass), impactor)
            self._strikes.put(key, struck)
        return struck

    def _step(self, values: Mapping[str, float], hood: _Hood, impactor: Impactor) -> Strike:
        """Return the impact on a hood."""
        stride = hood.stride
        speed, angle = values["impact_speed"], values["impact_angle"]
        speeds = (speed * math.cos(angle), speed * math.sin(angle))
        impactor = impactor._replace(guide_force=hood.guide[0], guide_exponent=hood.guide[1])
        record = np.empty((round(LONGEST_CONTACT * SAMPLING_RATE), COLUMNS))
        summary = np.zeros(SUMMARY)
        if hood.part is not None:
            strike_part(
                impactor, hood.surface, hood.part, hood.laws, hood.knots, *speeds,
                1.0 / (SAMPLING_RATE * stride), stride, LEFT, record, summary,
            )  # fmt: skip
        else:
            strike(
                impactor, hood.surface, hood.laws, hood.knots, *speeds,
                1.0 / (SAMPLING_RATE * stride), stride, record, summary,
            )  # fmt: skip
        kept = record[: int(summary[SAMPLES])].copy()
        dent = float(interpolate_law(hood.laws, 0, hood.knots, SURFACE, summary[DEEPEST]))
        return Strike(
            speeds=speeds,
            record=kept,
            summary=summary,
            force=kept[:, NORMAL : TANGENTIAL + 1],
            dent=(dent, dent * (1.0 - 1.0 / hood.unloading_ratio)),
            guide=_guide_forces(impactor, kept[:, RATE], speeds[0]),
        )

    def _hood(self, values: Mapping[str, float], chain: EffectChain, mass: float) -> _Hood:
        """Return what is struck, that of the last impact where only the speed is another."""
        key = (mass, *(value for name, value in values.items() if name not in MOTION))
        kept = self._hoods.get(key)
        if kept is not None:
            return kept
        curve = self.hood_curve(values, chain)
        contact = chain.act(
            "contact",
            HeadformContact(
                values["friction_body_car"], curve.damping, values["hood_damping_onset"]
            ),
            values,
        )
        laws = np.zeros((1, KNOTS, 4))
        skin = skin_of(self._skin, contact, float(curve.force[-1]))
        count = write_law(curve, skin, laws[0])
        stiffest = stiffest_slope(curve.penetration, curve.force, curve.unloading_ratio)
        stride = steps_per_sample(stiffest, contact.damping, mass)
        part = None
        if contact.part_mass > 0.0:
            part = Part(contact.part_mass, contact.part_stiffness, contact.part_damping)
            # Its damping tapers in, so that the frequency alone decides.
            stride = max(stride, steps_per_sample(part.stiffness, 0.0, part.mass))
        surface = Surface(
            contact.friction, contact.damping, contact.onset, contact.rate_share,
            contact.rate_exponent, contact.rate_force, contact.pickup,
            curve.unloading_growth, curve.unloading_curvature,
        )  # fmt: skip
        guide = (contact.guide_force, contact.guide_exponent)
        built = _Hood(laws, count, stride, surface, part, curve.unloading_ratio, guide)
        self._hoods.put(key, built)
        return built


def _guide_forces(impactor: Impactor, rates: Array, speed: float) -> Array | None:
    """Return the force of the guide before contact, at each sample of it, and after it."""
    if impactor.guide_force == 0.0:
        return None
    forces = np.empty(rates.size + 2)
    write_guide_drag(impactor, np.concatenate([[speed], rates, rates[-1:]]), forces)
    return forces


def _curve_of(knots: Sequence[Sequence[float]]) -> ForceCurve:
    try:
        return read_curve(knots, 2.0)
    except (ValueError, TypeError) as error:
        raise ValueError(f"hood_curve: {error}") from None


def _corridor_of(corridor: str | None, vehicle: str | None, zone: str) -> Corridor:
    if corridor is None:
        car = load_vehicle(vehicle or "family_car_1990s")
        index = car.zone_index(zone)
        if index < 0:
            names = ", ".join(entry.name for entry in car.zones)
            raise ValueError(f"vehicle {car.name!r} has no zone {zone!r}; it has {names}")
        return car.zones[index].corridor
    table = load_corridors(corridor)
    if zone not in table:
        raise ValueError(f"corridor {corridor!r} has no zone {zone!r}; it has {', '.join(table)}")
    return table[zone]
