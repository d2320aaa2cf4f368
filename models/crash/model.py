"""Code that crash models share behind the protocol: runs, batches, statuses."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.crash import outcome
from models.crash.memory import CrashMemory
from models.crash.record import END_REASONS, SEGMENT_ENTRIES, Column, Frame, Summary
from models.crash.scenario import HOOD, Scenario
from models.crash.scene import build_scene
from models.crash.tape import Tape, tape_on_zones
from models.declaration import run_rows
from models.effects.chain import build_chain
from models.pedestrian.anthropometry import SEGMENTS, is_possible
from models.protocol import OK, Batch, Channel, Input, Mesh, Output, Run, complete_inputs
from models.vehicle.profile import Vehicle, load_vehicle

Array = NDArray[np.float64]

TICK = 1e-4
"""Default finest step (s): HIC15 is within 0.7 % of its value at a quarter of the step."""
TIME_LIMIT = 12.0
"""s of crash after which a run counts as failed."""
FRAME_INTERVAL = 2e-3
"""s between frames of a scene."""

NO_CONTACT = "no_contact"
NO_HEAD_CONTACT = "no_head_contact"
IMPOSSIBLE_BODY = "impossible_body"


class CrashModel(ABC):
    """A pedestrian against a braking car, from first contact to rest.

    A subclass defines ``name``, ``version``, inputs, outputs and the step loop.

    Parameters
    ----------
    vehicle : str
        Name of a vehicle of the data folder.
    tick : float
        Finest step in s.
    channel_class : float
        Channel frequency class of the head's acceleration; 0 leaves it unfiltered.
    angular_class : float
        Channel frequency class of the head's angular velocity and acceleration; 0 leaves them
        unfiltered.
    effects : mapping, optional
        Parameter values of each effect that is switched on, by effect; those left out take the
        median of their prior.
    hood_curve : sequence of pairs, optional
        Knots (penetration m, force N) of the hood's loading curve, in place of its corridor.

    Raises
    ------
    ValueError
        If the vehicle or an effect is unknown, the curve is none, the step is not within 1 us to
        0.2 ms, or a channel frequency class is too high for the sampling rate of 10 kHz.
    """

    name: str
    version: str
    outputs: tuple[Output, ...]
    effects: tuple[str, ...]
    channels: Mapping[str, Channel]
    isomme_device: str
    accidents = True
    cost: float
    # Whether outputs need nothing but the raw results of their own run.
    repeatable = True
    partial_status = frozenset({NO_HEAD_CONTACT})
    _own_inputs: tuple[Input, ...]

    def __init__(
        self,
        vehicle: str = "family_car_1990s",
        tick: float = TICK,
        channel_class: float = outcome.LINEAR_CLASS,
        angular_class: float = outcome.ANGULAR_CLASS,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        hood_curve: Sequence[Sequence[float]] | None = None,
    ) -> None:
        if not 1e-6 <= float(tick) <= 2e-4:
            raise ValueError(f"tick must lie within 1e-6 and 2e-4 s, given {tick}")
        self.classes = outcome.FilterClasses(float(channel_class), float(angular_class))
        for option, value in (("channel_class", channel_class), ("angular_class", angular_class)):
            if not 0.0 <= float(value) <= outcome.HIGHEST_CLASS:
                raise ValueError(
                    f"{option} must lie within 0 and {outcome.HIGHEST_CLASS:g}, given {value}"
                )
        self.vehicle: Vehicle = load_vehicle(vehicle)
        if hood_curve is not None:
            self.vehicle = self.vehicle.with_curve(HOOD, hood_curve)
        self._car = (vehicle, hood_curve and tuple(tuple(knot) for knot in hood_curve))
        self.tick = float(tick)
        self._chain = build_chain(self.name, effects)
        self._memory = CrashMemory(self._chain)
        n, zones = len(SEGMENTS), len(self.vehicle.zones)
        self._record = np.zeros((int(TIME_LIMIT / self.tick) + 2, Column.REGION_FORCE + zones + 1))
        self._frames = np.zeros(
            (int(TIME_LIMIT / FRAME_INTERVAL) + 2, Frame.POSES + SEGMENT_ENTRIES * n)
        )

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs in order."""
        return self._own_inputs + self._chain.inputs

    @property
    def _setup(self) -> tuple[Hashable, ...]:
        """Options on which a crash depends beside its inputs."""
        return (type(self), self.version, self._car, self.tick, self.classes)

    def run(self, inputs: Mapping[str, float]) -> Run:
        """Run once, with time histories and scene.

        Raises
        ------
        ValueError
            If an input is unknown or outside its range.
        """
        values = complete_inputs(self, inputs)
        return self._run(values, self._simulate(values), None, None, scene=True)

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
        values = complete_inputs(self, inputs)
        kept = self._memory.recall(self._setup, values) if self.repeatable else None
        raw = self._simulate(values) if kept is None else kept
        if self.repeatable and kept is None:
            self._memory.keep(self._setup, values, raw)
        run = self._run(values, raw, outputs, channels, scene=False)
        return replace(run, recalled=kept is not None)

    def reached(self) -> float:
        """Return the time (s) that the run under way has reached; 0 for a model of quick runs."""
        return 0.0

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
        return run_rows(self, rows, self._row, started)

    def _meshes(self, raw: outcome.Raw) -> Sequence[Mesh]:
        """Return the surfaces of facets for pictures, in the frames of their bodies."""
        return ()

    def _more_measures(self, raw: outcome.Raw) -> dict[str, Callable[[], float]]:
        """Return the evaluators of outputs that a model adds or replaces."""
        return {}

    def _tape(self, scenario: Scenario, zone: int, point: Array) -> Tape:
        """Return what a tape on the car measures; see ``models.crash.tape.tape_on_zones``."""
        return tape_on_zones(scenario, zone, point)

    @abstractmethod
    def _step(self, values: dict[str, float]) -> outcome.Raw | None:
        """Return the raw results of the step loop, or None if the body never touches the car."""

    def _simulate(self, values: dict[str, float]) -> outcome.Raw | str:
        """Return the raw results of the step loop, or the status that prevents the run."""
        if not is_possible(values["stature"], values["body_mass"], values["head_mass"]):
            return IMPOSSIBLE_BODY
        raw = self._step(values)
        return NO_CONTACT if raw is None else raw

    def _run(
        self,
        values: dict[str, float],
        raw: outcome.Raw | str,
        outputs: Collection[str] | None,
        channels: Collection[str] | None,
        *,
        scene: bool,
    ) -> Run:
        if isinstance(raw, str):
            return Run(values, raw, raw, self._empty(outputs))
        signals = outcome.Signals(raw)
        status, measured = self._judge(raw, signals, outputs)
        reason = END_REASONS[int(raw.summary[Summary.END_REASON])]
        histories = outcome.histories(raw, signals, channels)
        return Run(
            values,
            status,
            reason,
            measured,
            histories,
            build_scene(raw, self._tape, self._meshes(raw)) if scene else None,
        )

    def _row(self, values: dict[str, float]) -> tuple[str, dict[str, float]]:
        """Return status and outputs of one run."""
        raw = self._simulate(values)
        if isinstance(raw, str):
            return raw, self._empty()
        return self._judge(raw, outcome.Signals(raw))

    def _empty(self, wanted: Collection[str] | None = None) -> dict[str, float]:
        names = (item.name for item in self.outputs if wanted is None or item.name in wanted)
        return dict.fromkeys(names, math.nan)

    def _judge(
        self, raw: outcome.Raw, signals: outcome.Signals, wanted: Collection[str] | None = None
    ) -> tuple[str, dict[str, float]]:
        """Return the status of a run and its outputs, or only the wanted ones."""
        outputs = self._empty(wanted)
        reason = END_REASONS[int(raw.summary[Summary.END_REASON])]
        if not reason.startswith("rest"):
            return reason, outputs
        measures = outcome.measures(raw, signals, self._tape) | self._more_measures(raw)
        outputs |= {name: measures[name]() for name in outputs if name in measures}
        if math.isnan(measures["head_impact_time"]()):
            return NO_HEAD_CONTACT, outputs
        if not all(math.isfinite(value) for value in outputs.values()):
            return "not_finite", self._empty(wanted)
        return OK, outputs
