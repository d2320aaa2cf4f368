"""The headform impactor test behind the model protocol."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.law import ForceCurve
from models.criteria.units import STANDARD_GRAVITY
from models.declaration import read_channels, read_outputs, run_rows
from models.effects.chain import build_chain
from models.effects.reading import Reading, Record, record_reading
from models.effects.registry import effects_of
from models.headform import outcome
from models.headform.facet_target import FacetTarget
from models.headform.fem_target import FemTarget
from models.headform.impact import END_TIME, Impactor
from models.headform.outcome import Test
from models.headform.target import SAMPLING_RATE, Strike, Target, vinyl_skin
from models.headform.zone_target import ZoneTarget
from models.protocol import (
    OK,
    Batch,
    Input,
    Output,
    Run,
    complete_inputs,
)

Array = NDArray[np.float64]

TIME_LIMIT = "time_limit"
NOT_FINITE = "not_finite"
NO_IMPACT = "no_impact"
HOURGLASS = "hourglass"
"""Outputs exist, but hourglass modes hold more of the energy than a mesh should."""
SURFACES = ("zone", "facet", "fem")
"""What a headform strikes."""

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
        ``hood_stiffness`` does not exist then. On facets it replaces the hood's corridor.
    corridor : str, optional
        Name of a corridor of the data folder, or path of a corridor file (``.toml``).
    vehicle : str, optional
        Name of a vehicle; by default the family car if neither curve nor corridor is given.
    zone : str
        Zone of the corridor or vehicle.
    skin : {"rigid", "vinyl"}
        Whether the headform's skin deforms; the case's paper found it negligible on a hood.
    surface : {"zone", "facet", "fem"}
        A plane with the curve of one zone; the whole front of the vehicle as a surface of facets,
        struck at a wrap-around distance and a lateral position; or its hood of finite elements.
    element_size : float
        Size of the finite elements, m.
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
        surface: str = "zone",
        element_size: float = 0.02,
        channel_class: float = 1000.0,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        if headform not in headform_names():
            raise ValueError(
                f"no headform {headform!r}: choose one of {', '.join(headform_names())}"
            )
        given = [hood_curve, corridor] if surface == "facet" else [hood_curve, corridor, vehicle]
        if sum(option is not None for option in given) > 1:
            raise ValueError("give one of hood_curve, corridor and vehicle, not several")
        if skin not in ("rigid", "vinyl"):
            raise ValueError(f"skin must be 'rigid' or 'vinyl', given {skin!r}")
        if surface not in SURFACES:
            raise ValueError(f"surface must be one of {', '.join(SURFACES)}, given {surface!r}")
        self.channel_class = float(channel_class)
        if not 0.0 <= self.channel_class < SAMPLING_RATE / 4.2:
            raise ValueError(f"channel_class must lie within 0 and 4700, given {channel_class}")
        row = data.load("headforms.toml")["headforms"][headform]
        self._gyration = row["inertia"] / (row["mass"] * (0.5 * row["diameter"]) ** 2)
        nominal = {"headform_mass": row["mass"], "headform_diameter": row["diameter"]}
        own = vinyl_skin() if skin == "vinyl" else None
        self.target: Target
        if surface == "facet":
            if corridor is not None:
                raise ValueError(
                    "surface 'facet' takes the curves of a vehicle: leave corridor out"
                )
            self.target = FacetTarget(nominal, own, vehicle, hood_curve)
        elif surface == "fem":
            if hood_curve is not None or corridor is not None or skin != "rigid":
                raise ValueError(
                    "surface 'fem' has sheets of its own: leave hood_curve, corridor and skin out"
                )
            self.target = FemTarget(nominal, vehicle, float(element_size))
            self.partial_status = frozenset({HOURGLASS})
        else:
            self.target = ZoneTarget(nominal, own, hood_curve, corridor, vehicle, zone)
        self.effects = self.target.effects
        for name in effects or ():
            if name in effects_of(self.name) and name not in self.effects:
                raise ValueError(f"effect {name!r} does not apply to surface {surface!r}")
        self._chain = build_chain(self.name, effects, self.target.without)
        self._inputs = self.target.inputs + self._chain.inputs

    @property
    def version(self) -> str:
        """Version of the model's data and equations, with a digest of a corridor file's curves."""
        return str(_TABLE["version"]) + self.target.digest

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
        histories = {} if test is None else outcome.histories(test, channels)
        return Run(values, status, ended, measured, histories)

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
        return self.target.hood_curve(values, self._chain)

    def _strike(self, given: Mapping[str, float]) -> Test | None:
        values = self._chain.act("inputs", given, given)
        mass, radius = values["headform_mass"], 0.5 * values["headform_diameter"]
        impactor = Impactor(mass, self._gyration * mass * radius**2, radius)
        struck = self.target.strike(values, self._chain, impactor)
        if struck is None:
            return None
        return Test(
            impactor=impactor,
            strike=struck,
            reading=self._reading(struck, mass, values),
            quiet=outcome.quiet_samples(self.channel_class),
        )

    def _reading(self, struck: Strike, mass: float, values: Mapping[str, float]) -> Record:
        """Return the recorded components of the acceleration, with free flight around them."""
        force = struck.force
        quiet = outcome.quiet_samples(self.channel_class)
        padded = np.zeros((len(force) + 2 * quiet, force.shape[1]))
        padded[quiet : quiet + len(force)] = force
        if struck.guide is not None:
            padded[:, 0] += np.pad(struck.guide, quiet - 1, mode="edge")
        padded /= mass * STANDARD_GRAVITY
        felt = Reading(padded, self.channel_class)
        return record_reading(self._chain, values, felt, SAMPLING_RATE, origin=quiet)

    def _judge(
        self, test: Test | None, wanted: Collection[str] | None = None
    ) -> tuple[str, dict[str, float]]:
        """Return the status of a test and its outputs, or only the wanted ones."""
        names = [item.name for item in _OUTPUTS if wanted is None or item.name in wanted]
        empty = dict.fromkeys(names, math.nan)
        if test is None:
            return NO_IMPACT, empty
        if not np.all(np.isfinite(test.strike.record)):
            return NOT_FINITE, empty
        if math.isnan(test.strike.summary[END_TIME]):
            return TIME_LIMIT, empty
        measures = outcome.measures(test) if names else {}
        if test.strike.doubtful:
            return HOURGLASS, {name: measures[name]() for name in names}
        return OK, {name: measures[name]() for name in names}
