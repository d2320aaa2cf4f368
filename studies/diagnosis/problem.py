"""Measured data and a model as the problem of a diagnosis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.diagnosis.channels import computed_channels
from mcstudy.diagnosis.noise import estimate_noise
from mcstudy.diagnosis.problem import Observation, Problem, Scalar, Signal, Test, Unknown
from mcstudy.errors import UserError
from mcstudy.measurement.measured_data import HEADER, Measured
from mcstudy.studyfile.distributions import Distribution
from mcstudy.studyfile.input_space import InputSpace
from models.criteria.filters import settling_time
from models.criteria.units import STANDARD_GRAVITY
from models.protocol import Channel, Input, Model
from studies.diagnosis.model_choice import ModelChoice
from studies.diagnosis.simulation import Simulation, channel_units

Array = NDArray[np.float64]

BIN = 5e-5
"""s: finer samples of a signal are averaged."""
BEFORE = 1e-3
"""Minimum lead (s) before the first sizeable sample; earlier samples count as noise."""
SIZEABLE, STILL = 0.05, 1e-3
"""Shares of the peak above which a sample is sizeable, and below which a simulation is at rest."""
MIN_COUNT = 3
"""Minimum number of tests of a diagnosis."""
DEAR = 0.01
"""CPU time (s) of a run above which fewer forms of causes are tried."""


def build_problem(data: Measured, choice: ModelChoice, simulation: Simulation) -> Problem:
    """Return the problem of measured tests.

    Parameters
    ----------
    data : Measured
        Measured tests.
    choice : ModelChoice
        The model; the data override its values.
    simulation : Simulation
        Of that model.

    Raises
    ------
    UserError
        If the data do not fit the model, or hold a channel that repeats another one.
    """
    model, header = simulation.model(()), data.header
    place = data.source / HEADER
    inputs = {item.name: item for item in model.inputs}
    for table in (choice.uncertain, header.inputs):
        for name in table:
            if name not in inputs:
                raise UserError(
                    f"{place}: model {choice.name!r} has no input {name!r}; it has "
                    f"{', '.join(inputs)}"
                )
    if len(data.tests) < MIN_COUNT:
        raise UserError(f"{data.source / 'tests.csv'}: a diagnosis takes {MIN_COUNT} tests or more")
    recorded = [_recorded(data, inputs, k, choice.fixed) for k in range(len(data.tests))]
    seen = [simulation(given, {}) for given, _ in recorded] if header.signals else []
    noise = _noise_of(data, channel_units(model, list(header.signals)), seen)
    tests = tuple(_test(data, model, k, *given, noise) for k, given in enumerate(recorded))
    refused = computed_channels(
        tests, mass="headform_mass", speed="impact_speed", gravity=STANDARD_GRAVITY
    )
    for name, how in refused.items():
        raise UserError(
            f"{place}: signals.{name} is {how}: it repeats the information of the "
            "accelerometer; remove it"
        )
    return Problem(
        tests=tests,
        unknowns=tuple(
            Unknown(name, _prior_of(place, name, distribution, inputs[name].unit))
            for name, distribution in choice.uncertain.items()
        ),
        simulate=simulation,
        ranges={name: (item.low, item.high) for name, item in inputs.items()},
        dear=model.cost > DEAR,
    )


def _prior_of(place: Path, name: str, distribution: Distribution, unit: str) -> InputSpace:
    if distribution.parents:
        raise UserError(f"{place}: uncertain.{name} may not depend on another input")
    try:
        return InputSpace({name: distribution}, {name: unit})
    except ValueError as error:
        raise UserError(f"{place}: uncertain.{name}.unit: {error}") from None


@dataclass(frozen=True)
class _Channel:
    """Unit in the model, standard deviation and correlation of the noise of a signal."""

    unit: str
    sd: float
    correlation: float


def _noise_of(
    data: Measured, names: Mapping[str, str], seen: Sequence[Observation | None]
) -> dict[str, _Channel]:
    """Return the noise of the signals, from samples at which the simulated tests are at rest."""
    found = {}
    place = data.source / HEADER
    for name, entry in data.header.signals.items():
        if name not in names:
            raise UserError(f"{place}: signals.{name}: the model has no such channel")
        unit = names[name]
        series = [_thinned(*data.signal(test, name, unit)) for test in data.tests["test"]]
        scale = units.factor(entry.unit, unit)
        shrink = np.sqrt(_bin_size(data.signal(data.tests["test"].iloc[0], name, unit)[0]))
        try:
            least = max(BEFORE, settling_time(entry.channel_class) if entry.channel_class else 0.0)
            before = [max(least, _rise(*one.signals[name]) if one else 0.0) for one in seen]
            noise = estimate_noise(
                [_lead_in(*s, early) for s, early in zip(series, before, strict=True)],
                entry.sd * scale / shrink,
            )
        except ValueError as error:
            raise UserError(f"{place}: signals.{name}: {error}") from None
        found[name] = _Channel(unit, noise.sd, noise.correlation)
    return found


def _bin_size(time: Array) -> int:
    return max(1, int(BIN / float(np.median(np.diff(time))) + 1e-6))


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Return a signal averaged over bins, if it is finer than them."""
    size = _bin_size(time)
    if size == 1:
        return time, values
    count = time.size // size
    means = [x[: count * size].reshape(count, size).mean(axis=1) for x in (time, values)]
    return means[0], means[1]


def _rise(time: Array, values: Array) -> float:
    """Return the time (s) that a simulated signal takes from rest to its first sizeable sample.

    In a crash the head moves long before it strikes: such samples hold more than noise.
    """
    size, peak = np.abs(values), float(np.abs(values).max())
    sizeable, moving = (int(np.argmax(size >= share * peak)) for share in (SIZEABLE, STILL))
    return float(time[sizeable] - time[moving])


def _lead_in(time: Array, values: Array, before: float) -> Array:
    """Return the samples before contact, ``before`` (s) which the filter has not answered yet."""
    first = int(np.argmax(np.abs(values) >= SIZEABLE * np.abs(values).max()))
    return np.asarray(values[time < time[first] - before])


def _recorded(
    data: Measured, known: Mapping[str, Input], row: int, fixed: Mapping[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the inputs of a test as recorded, and the standard uncertainties of doubtful ones."""
    name = str(data.tests["test"].iloc[row])
    inputs, doubtful = dict(fixed), {}
    for column in data.header.inputs:
        found = data.input_value(column, row, known[column].unit)
        assert found is not None
        item = known[column]
        if not item.low <= found[0] <= item.high:
            raise UserError(
                f"{data.source / 'tests.csv'}: test {name!r}: {column} = {found[0]:g} {item.unit} "
                f"is outside {item.low:g} to {item.high:g} {item.unit}"
            )
        inputs[column] = found[0]
        if found[1] > 0.0:
            doubtful[column] = found[1]
    return inputs, doubtful


def _test(
    data: Measured,
    model: Model,
    row: int,
    inputs: Mapping[str, float],
    doubtful: Mapping[str, float],
    noise: Mapping[str, _Channel],
) -> Test:
    header = data.header
    name = str(data.tests["test"].iloc[row])
    signals = []
    for channel, entry in noise.items():
        time, values = _thinned(*data.signal(name, channel, entry.unit))
        signals.append(Signal(channel, time, values, entry.sd, entry.correlation))
    derived = {
        output
        for channel in header.signals
        for output in model.channels.get(channel, Channel()).outputs
    }
    scalars, judged = [], []
    for scalar in _scalars(data, model, row):
        if scalar.name in derived:
            judged.append(scalar)
        else:
            scalars.append(scalar)
    return Test(
        name, inputs, doubtful, tuple(signals), tuple(scalars), tuple(judged),
        {"order": float(row)} | _covariates(data, row),
    )  # fmt: skip


def _scalars(data: Measured, model: Model, row: int) -> list[Scalar]:
    place = data.source / HEADER
    outputs = {item.name: item.unit for item in model.outputs}
    if not data.header.signals:
        outputs["ais"] = "1"
    found = []
    for name, entry in data.header.scalars.items():
        if name not in outputs:
            raise UserError(
                f"{place}: scalars.{name}: the model has no such output; it has "
                f"{', '.join(outputs)}"
            )
        try:
            scale = units.factor(entry.unit, outputs[name])
        except ValueError as error:
            raise UserError(f"{place}: scalars.{name}.unit: {error}") from None
        if entry.sd == 0.0:
            raise UserError(f"{place}: scalars.{name}: state its standard uncertainty sd")
        value = float(data.tests[name].iloc[row]) * scale
        # Missing values have no weight.
        missing = not np.isfinite(value)
        found.append(
            Scalar(name, 0.0 if missing else value, np.inf if missing else entry.sd * scale)
        )
    return found


def _covariates(data: Measured, row: int) -> dict[str, float]:
    """Return the columns of the table that are neither inputs nor scalars."""
    taken = {"test", *data.header.inputs, *data.header.scalars}
    return {
        str(column): float(data.tests[column].iloc[row])
        for column in data.tests.columns
        if column not in taken
    }
