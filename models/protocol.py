"""The crash model protocol: named inputs and outputs, single runs with histories, and batches.

A model never raises for a row of inputs inside its ranges: a run that fails is a row with a status
other than ``ok`` and NaN where an output has no value. A row of a batch depends on that row alone.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OK = "ok"


@dataclass(frozen=True)
class Input:
    """An input of a model.

    Attributes
    ----------
    name : str
    unit : str
        Unit in which the model takes the value (SI).
    meaning : str
    nominal : float
        Nominal value.
    low, high : float
        Bounds of the valid range.
    source : str
        Source of the nominal value, with its label.
    ignored : str
        Why the model accepts the input without using it; empty if it uses it.
    """

    name: str
    unit: str
    meaning: str
    nominal: float
    low: float
    high: float
    source: str = ""
    ignored: str = ""


@dataclass(frozen=True)
class Output:
    """An output of a model.

    Attributes
    ----------
    name, unit, meaning : str
    low, high : float
        Bounds beyond which a run is not physical, whatever its inputs.
    """

    name: str
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class Channel:
    """A channel of the histories, ``<group>_<channel>``, that tests may measure.

    Attributes
    ----------
    filter_option : str
        Option of the model that sets the channel frequency class of the filter; empty if the model
        does not filter the channel.
    straight : str
        Channel that is measured instead in a straight impact, if there is one.
    outputs : tuple of str
        Outputs computed from the channel alone, which are therefore no independent evidence.
    code : str
        ISO-MME channel code with ``{}`` for the device; empty if it has none.
    """

    filter_option: str = ""
    straight: str = ""
    outputs: tuple[str, ...] = ()
    code: str = ""


@dataclass(frozen=True)
class History:
    """Time histories on one time axis.

    Attributes
    ----------
    time : (n,) array
        s.
    channels : mapping of str to (n,) array
        Values by name.
    units : mapping of str to str
        Unit by name.
    """

    time: Array
    channels: Mapping[str, Array]
    units: Mapping[str, str]


def history_of(time: Array, channels: Mapping[str, tuple[Array, str]]) -> History:
    """Return a history of channels given as values and unit by name."""
    return History(
        time,
        {name: values for name, (values, _) in channels.items()},
        {name: unit for name, (_, unit) in channels.items()},
    )


def chosen_histories(
    time: Array,
    sources: Mapping[str, Mapping[str, tuple[str, Callable[[], Array]]]],
    wanted: Collection[str] | None,
) -> dict[str, History]:
    """Return histories by group, restricted to the wanted channels ``<group>_<channel>`` if given.

    Parameters
    ----------
    time : (n,) array
        s.
    sources : mapping
        Unit of each channel and a function that computes its values, by group and name.
    wanted : collection of str, optional
        Names ``<group>_<channel>``; by default all.

    Returns
    -------
    dict of str to History
    """
    found = {}
    for group, channels in sources.items():
        chosen = {
            name: (source(), unit)
            for name, (unit, source) in channels.items()
            if wanted is None or f"{group}_{name}" in wanted
        }
        if chosen:
            found[group] = history_of(time, chosen)
    return found


@dataclass(frozen=True)
class Mesh:
    """A surface of facets in a scene.

    Attributes
    ----------
    name : str
    nodes : (f, k, 3) or (k, 3) array
        Positions, m: at each time if the surface deforms, else always the same.
    faces : (t, 3) or (t, 4) array
        Nodes of each facet, counterclockwise seen from outside.
    body : str
        Rigid body in whose frame they are: ``car``, or an ellipsoid, in whose place it is drawn;
        empty for world axes.
    time : (f,) array or None
        Times of the shapes of a surface that deforms, each lasting to the next, s; by default the
        frames of the scene.
    """

    name: str
    nodes: Array
    faces: NDArray[np.int64]
    body: str = ""
    time: Array | None = None


@dataclass(frozen=True)
class ContactForces:
    """Contact forces in a scene, drawn as arrows.

    Attributes
    ----------
    place : (f, m, 3) array
        Points of application, world axes, m; NaN where there is no force.
    force : (f, m, 3) array
        World axes, N.
    """

    place: Array
    force: Array


@dataclass(frozen=True)
class Scene:
    """Data for a picture or an animation of a run.

    Attributes
    ----------
    time : (f,) array
        s.
    names : sequence of str
        Names of the ellipsoids.
    semi_axes : (n, 3) array
        m.
    centre : (f, n, 3) array
        Centres of the ellipsoids, world axes, m.
    orientation : (f, n, 4) array
        Quaternions (w, x, y, z).
    car : (f, 3) array
        x, y (m) and yaw (rad) of the car's frame.
    outline : sequence of (k, 2) array
        Lines x, z (m) of the car's side view in its frame.
    plan : (k, 2) array
        x, y (m), outline of the car from above in its frame.
    meshes : sequence of Mesh
        Surfaces of facets.
    forces : ContactForces or None
        Of car and road on the body.
    tape : (k, 3) array or None
        Corners of the tape that measures the wrap-around distance of the head's first contact,
        from the road on, in the car's frame, m.
    """

    time: Array
    names: Sequence[str]
    semi_axes: Array
    centre: Array
    orientation: Array
    car: Array
    outline: Sequence[Array]
    plan: Array
    meshes: Sequence[Mesh] = ()
    forces: ContactForces | None = None
    tape: Array | None = None


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes
    ----------
    inputs : mapping of str to float
    status : str
        ``ok`` or the reason for failure.
    end_reason : str
        Why the simulation ended.
    outputs : mapping of str to float
    histories : mapping of str to History
        By group.
    scene : Scene, optional
    recalled : bool
        Whether a crash that was kept was recorded anew, not stepped.
    """

    inputs: Mapping[str, float]
    status: str
    end_reason: str
    outputs: Mapping[str, float]
    histories: Mapping[str, History] = field(default_factory=dict)
    scene: Scene | None = None
    recalled: bool = False


@dataclass(frozen=True)
class Batch:
    """Outputs of a batch.

    Attributes
    ----------
    outputs : (n, outputs) array
        In the model's order, NaN where an output has no value.
    status : list of str
        ``ok`` or the reason, by row.
    """

    outputs: Array
    status: list[str]


class Model(Protocol):
    """A crash model."""

    @property
    def name(self) -> str:
        """Name under which it is registered."""

    @property
    def version(self) -> str:
        """Version; it changes whenever the results may change."""

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs in order."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Outputs in order."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that can be switched on."""

    @property
    def partial_status(self) -> frozenset[str]:
        """Statuses of complete runs in which some outputs have no value."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Channels that tests may measure, by name; other channels have no entry."""

    @property
    def isomme_device(self) -> str:
        """Two letters of ISO/TS 13499 for the test object, empty if there are none."""

    @property
    def accidents(self) -> bool:
        """Whether a run is a complete accident, of which only scalars are measured."""

    @property
    def cost(self) -> float:
        """Approximate CPU time of a run in s."""

    def run(self, inputs: Mapping[str, float]) -> Run:
        """Run once, with time histories; inputs left out take their nominal values."""

    def observe(
        self,
        inputs: Mapping[str, float],
        channels: Collection[str],
        outputs: Collection[str] = (),
    ) -> Run:
        """Run once and return only what a test records.

        Parameters
        ----------
        inputs : mapping of str to float
            Inputs left out take their nominal values.
        channels : collection of str
            Names ``<group>_<channel>``.
        outputs : collection of str
            Names of outputs.
        """

    def run_batch(self, rows: Array, started: Callable[[int], None] | None = None) -> Batch:
        """Run (n, inputs) rows.

        Parameters
        ----------
        rows : (n, inputs) array
            In the order of ``inputs``.
        started : callable, optional
            Called with the number of each row before it is run.
        """


def complete_status(model: Model) -> frozenset[str]:
    """Return the statuses of runs that count as complete: ``ok`` and the partial ones."""
    return frozenset({OK}) | model.partial_status


def complete_inputs(model: Model, given: Mapping[str, float]) -> dict[str, float]:
    """Return all inputs by name, nominal where not given.

    Raises
    ------
    ValueError
        If a name is unknown or a value lies outside its range; the message names both.
    """
    known = {item.name: item for item in model.inputs}
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise ValueError(
            f"model {model.name!r} has no input {unknown[0]!r}; it has {', '.join(known)}"
        )
    values = {name: float(given.get(name, item.nominal)) for name, item in known.items()}
    for name, value in values.items():
        item = known[name]
        if not item.low <= value <= item.high:
            raise ValueError(
                f"input {name!r} = {value:g} {item.unit} is outside the valid range "
                f"{item.low:g} to {item.high:g} {item.unit} of model {model.name!r}"
            )
    return values
