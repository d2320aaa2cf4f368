"""The headform impactor test behind the model protocol."""

import hashlib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.corridor import Corridor, load_corridors
from models.contact.headform import HeadformContact
from models.contact.law import (
    DAMPING_ONSET,
    KNOTS,
    SURFACE,
    ForceCurve,
    combine_curves,
    interpolate_law,
    law_of,
    stiffest_slope,
)
from models.criteria.units import STANDARD_GRAVITY
from models.declaration import read_channels, read_inputs, read_outputs, run_rows
from models.effects.chain import build_chain
from models.effects.reading import Reading, Record, record_reading
from models.effects.registry import effects_of
from models.headform import outcome
from models.headform.impact import (
    COLUMNS,
    DEEPEST,
    END_TIME,
    NORMAL,
    SAMPLES,
    SUMMARY,
    TANGENTIAL,
    Impactor,
    Surface,
    strike,
)
from models.headform.outcome import SAMPLING_RATE, Test
from models.protocol import (
    OK,
    Batch,
    Input,
    Output,
    Run,
    complete_inputs,
)
from models.vehicle.profile import load_vehicle

Array = NDArray[np.float64]

LONGEST_CONTACT = 1.0
"""s of contact after which a run counts as failed."""
FINEST = 5
"""Smallest number of steps per sample."""
PHASE = 0.05
"""Largest step times the highest natural frequency of the contact (1 is a radian)."""
DAMPING_WEIGHT = 25.0
"""Weight of a damping rate against a frequency in the step: its force starts with a jump."""
MAX_STEPS = 4000
"""Largest number of steps per sample."""

ELASTIC = 1.000001
"""Unloading ratio of an elastic spring; a force curve requires more than one."""

TIME_LIMIT = "time_limit"
NOT_FINITE = "not_finite"

_TABLE = data.load("headform.toml")
_OUTPUTS = read_outputs(_TABLE)


def headform_names() -> tuple[str, ...]:
    """Return the names of the headforms in the data file."""
    return tuple(data.load("headforms.toml")["headforms"])


class HeadformModel:
    """A free headform against one point of a car's front.

    The struck zone is given in one of three ways: its loading curve, a corridor of a data file, or
    a zone of a vehicle.

    Parameters
    ----------
    headform : str
        ``eevc_child``, ``eevc_adult``, ``gtr_child`` or ``gtr_adult``: nominal mass, diameter,
        inertia.
    hood_curve : sequence of pairs, optional
        Knots (penetration m, force N) from (0, 0), extrapolated linearly; the input
        ``hood_stiffness`` does not exist then.
    corridor : str, optional
        Name of a corridor of the data folder, or path of a corridor file (``.toml``).
    vehicle : str, optional
        Name of a vehicle; by default the family car if neither curve nor corridor is given.
    zone : str
        Zone of the corridor or vehicle.
    skin : {"rigid", "vinyl"}
        Whether the headform's skin deforms; the case's paper found it negligible on a hood.
    channel_class : float
        Channel frequency class of the accelerometer; 0 leaves the signal unfiltered.
    effects : mapping, optional
        Parameter values of each effect that is switched on, by effect; those left out take the
        median of their prior.

    Raises
    ------
    ValueError
        If an option is unknown or contradicts another.
    """

    name = "headform"
    effects: tuple[str, ...] = effects_of("headform")
    partial_status: frozenset[str] = frozenset()
    channels = read_channels(_TABLE)
    isomme_device = str(_TABLE["isomme_device"])
    accidents = False
    cost = float(_TABLE["cost"])

    def __init__(
        self,
        headform: str = "eevc_child",
        hood_curve: Sequence[Sequence[float]] | None = None,
        corridor: str | None = None,
        vehicle: str | None = None,
        zone: str = "hood",
        skin: str = "rigid",
        channel_class: float = 1000.0,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        if headform not in headform_names():
            raise ValueError(
                f"no headform {headform!r}: choose one of {', '.join(headform_names())}"
            )
        if sum(option is not None for option in (hood_curve, corridor, vehicle)) > 1:
            raise ValueError("give one of hood_curve, corridor and vehicle, not several")
        if skin not in ("rigid", "vinyl"):
            raise ValueError(f"skin must be 'rigid' or 'vinyl', given {skin!r}")
        self.channel_class = float(channel_class)
        if not 0.0 <= self.channel_class < SAMPLING_RATE / 4.2:
            raise ValueError(f"channel_class must lie within 0 and 4700, given {channel_class}")
        row = data.load("headforms.toml")["headforms"][headform]
        self._gyration = row["inertia"] / (row["mass"] * (0.5 * row["diameter"]) ** 2)
        self._skin = _skin() if skin == "vinyl" else None
        nominal = {"headform_mass": row["mass"], "headform_diameter": row["diameter"]}
        self._curve: ForceCurve | None = None
        self._corridor: Corridor | None = None
        self._digest = ""
        if hood_curve is not None:
            self._curve = _curve_of(hood_curve)
        else:
            self._corridor = _corridor_of(corridor, vehicle, zone)
            median = self._corridor.median
            if corridor is not None and corridor.endswith(".toml"):
                curves = repr(self._corridor).encode()
                self._digest = "+" + hashlib.sha256(curves).hexdigest()[:12]
            nominal |= {
                "hood_unloading_ratio": median.unloading_ratio,
                "hood_damping": median.damping,
                "hood_damping_onset": DAMPING_ONSET if median.damping > 0.0 else 0.0,
            }
        self._inputs = tuple(
            replace(item, nominal=float(nominal.get(item.name, item.nominal)))
            for item in read_inputs(_TABLE)
            if self._corridor is not None or item.name != "hood_stiffness"
        )
        self._chain = build_chain(self.name, effects)
        self._inputs += self._chain.inputs

    @property
    def version(self) -> str:
        """Version of the model's data and equations, with a digest of a corridor file's curves."""
        return str(_TABLE["version"]) + self._digest

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs in order."""
        return self._inputs

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Outputs in order."""
        return _OUTPUTS

    def run(self, inputs: Mapping[str, float]) -> Run:
        """Run once, with time histories.

        Raises
        ------
        ValueError
            If an input is unknown or outside its range.
        """
        return self._run(complete_inputs(self, inputs), None, None)

    def observe(
        self,
        inputs: Mapping[str, float],
        channels: Collection[str],
        outputs: Collection[str] = (),
    ) -> Run:
        """Run once and return only the channels and outputs that are named.

        Parameters
        ----------
        inputs : mapping of str to float
            Inputs left out take their nominal values.
        channels : collection of str
            Names ``<group>_<channel>``, e.g. ``head_acceleration``.
        outputs : collection of str
            Names of outputs.

        Raises
        ------
        ValueError
            If an input is unknown or outside its range.
        """
        return self._run(complete_inputs(self, inputs), outputs, channels)

    def _run(
        self,
        values: dict[str, float],
        outputs: Collection[str] | None,
        channels: Collection[str] | None,
    ) -> Run:
        test = self._strike(values)
        status, measured = self._judge(test, outputs)
        ended = "separation" if status == OK else status
        return Run(values, status, ended, measured, outcome.histories(test, channels))

    def run_batch(self, rows: Array, started: Callable[[int], None] | None = None) -> Batch:
        """Run rows of inputs.

        Parameters
        ----------
        rows : (n, inputs) array
            In the order of ``inputs``, SI units.
        started : callable, optional
            Called with the number of each row before it is run.

        Raises
        ------
        ValueError
            If the array has another number of columns or a value outside its range.
        """
        return run_rows(self, rows, lambda values: self._judge(self._strike(values)), started)

    def hood_curve(self, values: Mapping[str, float]) -> ForceCurve:
        """Return the loading curve of the hood for all inputs by name."""
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
        return self._chain.act("curve", scaled, values)

    def _strike(self, given: Mapping[str, float]) -> Test:
        values = self._chain.act("inputs", given, given)
        curve = self.hood_curve(values)
        contact = self._chain.act(
            "contact",
            HeadformContact(
                values["friction_body_car"], curve.damping, values["hood_damping_onset"]
            ),
            values,
        )
        laws = np.zeros((1, KNOTS, 4))
        skin = self._skin
        if contact.skin_compliance > 0.0:
            skin = _in_series(skin, contact.skin_compliance, float(curve.force[-1]))
        if skin is None:
            count = law_of(curve, laws[0])
        else:
            count = combine_curves(
                curve.penetration, curve.force, curve.unloading_ratio,
                skin.penetration, skin.force, skin.unloading_ratio, laws[0],
            )  # fmt: skip
        mass, radius = values["headform_mass"], 0.5 * values["headform_diameter"]
        impactor = Impactor(mass, self._gyration * mass * radius**2, radius)
        stiffest = stiffest_slope(curve.penetration, curve.force, curve.unloading_ratio)
        frequency = math.sqrt(stiffest / mass) + DAMPING_WEIGHT * contact.damping / mass
        stride = math.ceil(frequency / (PHASE * SAMPLING_RATE))
        stride = min(max(stride, FINEST), MAX_STEPS)
        speed, angle = values["impact_speed"], values["impact_angle"]
        speeds = (speed * math.cos(angle), speed * math.sin(angle))
        record = np.empty((round(LONGEST_CONTACT * SAMPLING_RATE), COLUMNS))
        summary = np.zeros(SUMMARY)
        strike(
            impactor,
            Surface(contact.friction, contact.damping, contact.onset, contact.rate_share,
                    contact.rate_exponent, contact.moved_mass, contact.moved_depth),
            laws, count, *speeds, 1.0 / (SAMPLING_RATE * stride), stride, record, summary,
        )  # fmt: skip
        deepest = summary[DEEPEST]
        hood = float(interpolate_law(laws, 0, count, SURFACE, deepest))
        kept = record[: int(summary[SAMPLES])].copy()
        return Test(
            impactor=impactor,
            speeds=speeds,
            record=kept,
            reading=self._reading(kept, mass, values),
            summary=summary,
            dent=(hood, hood * (1.0 - 1.0 / curve.unloading_ratio)),
            quiet=outcome.quiet_samples(self.channel_class),
        )

    def _reading(self, record: Array, mass: float, values: Mapping[str, float]) -> Record:
        """Return the recorded acceleration, normal and tangential, with free flight around it."""
        quiet = outcome.quiet_samples(self.channel_class)
        padded = np.zeros((record.shape[0] + 2 * quiet, 2))
        forces = record[:, NORMAL : TANGENTIAL + 1]
        padded[quiet : quiet + record.shape[0]] = forces / (mass * STANDARD_GRAVITY)
        felt = Reading(padded, self.channel_class)
        return record_reading(self._chain, values, felt, SAMPLING_RATE, origin=quiet)

    def _judge(
        self, test: Test, wanted: Collection[str] | None = None
    ) -> tuple[str, dict[str, float]]:
        """Return the status of a test and its outputs, or only the wanted ones."""
        names = [item.name for item in _OUTPUTS if wanted is None or item.name in wanted]
        empty = dict.fromkeys(names, math.nan)
        if not np.all(np.isfinite(test.record)):
            return NOT_FINITE, empty
        if math.isnan(test.summary[END_TIME]):
            return TIME_LIMIT, empty
        measures = outcome.measures(test) if names else {}
        return OK, {name: measures[name]() for name in names}


def _in_series(skin: ForceCurve | None, compliance: float, force: float) -> ForceCurve:
    """Return a skin in series with a linear elastic spring."""
    spring = ForceCurve(np.array([0.0, compliance * force]), np.array([0.0, force]), ELASTIC)
    if skin is None:
        return spring
    return ForceCurve(skin.penetration + compliance * skin.force, skin.force, skin.unloading_ratio)


def _skin() -> ForceCurve:
    row = data.load("headforms.toml")["skin"]
    knots = np.array(row["curve"])
    return ForceCurve(knots[:, 0].copy(), knots[:, 1].copy(), row["unloading_ratio"])


def _curve_of(knots: Sequence[Sequence[float]]) -> ForceCurve:
    try:
        table = np.array(knots, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != 2:
            raise ValueError("must be a list of pairs [penetration m, force N]")
        return ForceCurve(table[:, 0].copy(), table[:, 1].copy(), 2.0)
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
