"""Measured data: a folder of tests with recorded inputs, scalars and signals.

::

    measured.toml     what was measured, with units and standard uncertainties
    tests.csv         one row a test: id, recorded inputs, measured scalars
    signals/<id>.csv  time (s) and channels of a test

Tables are as ``mcstudy.tables`` reads them. A signal is named after the model's history that it
measures, ``<group>_<channel>``, for example ``head_acceleration``. Folders of ISO-MME tests are
read into the same structure.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.files import parse_toml, read_study_text
from mcstudy.measurement import isomme
from mcstudy.measurement.sampling_times import regular_times
from mcstudy.studyfile.distributions import Distribution, Unit
from mcstudy.studyfile.lines import with_line
from mcstudy.studyfile.reading import first_problem
from mcstudy.tables import TextTable, read_csv

Array = NDArray[np.float64]

FORMAT = "mcstudy-measured/1"
HEADER = "measured.toml"

EMPTY = "leave a field empty where nothing was measured"
MIN_SAMPLES = 8
"""Samples below which a signal cannot be used."""
FINEST, COARSEST = 1e-8, 1.0
"""s, range of the sampling interval of a crash recorder (assumed)."""
LARGEST = 1e9
"""Largest sample of a signal, in any unit; a larger one counts as a mistake (assumed)."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Recorded(_Table):
    """A recorded input or a measured scalar: a column of ``tests.csv``, unit, uncertainty."""

    unit: Unit = "1"
    sd: Annotated[FiniteFloat, Field(ge=0.0)] = 0.0


class Signal(_Table):
    """A channel: unit, standard deviation of its white noise after the filter, the filter."""

    unit: Unit = "1"
    sd: Annotated[FiniteFloat, Field(ge=0.0)] = 0.0
    filter: Literal["none", "CFC60", "CFC180", "CFC600", "CFC1000"] = "none"

    @property
    def channel_class(self) -> float:
        """Channel frequency class; 0 if the signal is raw."""
        return 0.0 if self.filter == "none" else float(self.filter.removeprefix("CFC"))


class Header(_Table):
    """``measured.toml``."""

    format: Literal["mcstudy-measured/1"]
    title: str
    model: str
    fixed: dict[str, FiniteFloat | list[list[FiniteFloat]]] = {}
    uncertain: dict[str, Distribution] = {}
    inputs: dict[str, Recorded] = {}
    scalars: dict[str, Recorded] = {}
    signals: dict[str, Signal] = {}


@dataclass(frozen=True)
class Measured:
    """Measured tests.

    Attributes
    ----------
    source : path of the data.
    header : contents of ``measured.toml``.
    tests : table, a row a test: ``test`` and the columns of inputs and scalars, in the header's
        units; NaN where a scalar was not measured.
    signals : by test and channel, (n, 2) time (s) and value in the channel's unit.
    notes : choices among channels, taken and left out, by test.
    """

    source: Path
    header: Header
    tests: pd.DataFrame
    signals: dict[str, dict[str, Array]]
    notes: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def input_value(self, name: str, test: int, unit: str) -> tuple[float, float] | None:
        """Return a recorded input of a test and its standard uncertainty.

        A value fixed for all tests is exact; None if the input is neither recorded nor fixed.

        Parameters
        ----------
        name : str
            Of the input.
        test : int
            Row of the test.
        unit : str
            Unit of the result.

        Raises
        ------
        UserError
            If the units do not fit.
        """
        if name in self.header.inputs:
            entry = self.header.inputs[name]
            try:
                scale = units.factor(entry.unit, unit)
            except ValueError as error:
                raise UserError(f"{self.source}: inputs.{name}.unit: {error}") from None
            return float(self.tests[name].iloc[test]) * scale, entry.sd * scale
        fixed = self.header.fixed.get(name)
        return (float(fixed), 0.0) if isinstance(fixed, float | int) else None

    def signal(self, test: str, name: str, unit: str) -> tuple[Array, Array]:
        """Return time (s) and values of a channel of a test.

        Parameters
        ----------
        test : str
            Name of the test.
        name : str
            Name of the channel.
        unit : str
            Unit of the values.

        Raises
        ------
        UserError
            If the test has no such channel or the units do not fit.
        """
        if name not in self.signals.get(test, {}):
            raise UserError(f"{self.source}: test {test!r} has no signal {name!r}")
        try:
            scale = units.factor(self.header.signals[name].unit, unit)
        except ValueError as error:
            raise UserError(f"{self.source}: signals.{name}.unit: {error}") from None
        table = self.signals[test][name]
        return table[:, 0], table[:, 1] * scale


def load_measured(folder: Path | str, channels: Sequence[str] = ()) -> Measured:
    """Read a folder of measured data: the format above, an ISO-MME test, or a folder of those.

    Parameters
    ----------
    folder : Path or str
        Of the data.
    channels : sequence of str
        Channels to take of ISO-MME tests; see ``mcstudy.measurement.isomme.head_acceleration``.

    Raises
    ------
    UserError
        If the folder cannot be read or something in it is wrong; the message names the place.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise UserError(f"{folder}: is no folder of measured data")
    if (folder / HEADER).exists():
        if channels:
            raise UserError(f"{folder}: --channel is for ISO-MME tests; {HEADER} names the signals")
        return _read_folder(folder)
    tests = isomme.find_tests(folder)
    if tests:
        return _from_isomme(folder, [isomme.read_test(path) for path in tests], channels)
    raise UserError(f"{folder}: holds neither {HEADER} nor an ISO-MME test (.mme)")


def _read_folder(folder: Path) -> Measured:
    place = folder / HEADER
    text = read_study_text(place)
    table = parse_toml(text, str(place))
    try:
        header = Header.model_validate(table)
    except ValidationError as error:
        raise UserError(f"{place}: {with_line(first_problem(error, table), text)}") from None
    if "test" in {*header.inputs, *header.scalars}:
        raise UserError(f"{place}: 'test' is the id of a test, it cannot be an input or a scalar")
    named = read_csv(folder / "tests.csv", text=("test",))
    wanted = ("test", *header.inputs, *header.scalars)
    for column in wanted:
        if column not in named.columns:
            raise UserError(f"{folder / 'tests.csv'}: column {column!r} is missing")
    tests = _frame(named)
    if tests.empty:
        raise UserError(f"{folder / 'tests.csv'}: holds no tests")
    lines = tests.index
    repeated = tests["test"].duplicated()
    if repeated.any():
        row = int(np.argmax(repeated))
        raise UserError(
            f"{folder / 'tests.csv'}: line {lines[row]}: test {tests['test'].iloc[row]!r} is there "
            "already"
        )
    for name in header.inputs:
        missing = ~np.isfinite(tests[name].to_numpy())
        if missing.any():
            line = lines[int(np.argmax(missing))]
            raise UserError(
                f"{folder / 'tests.csv'}: line {line}: column {name!r} must be a number"
            )
    tests = tests.reset_index(drop=True)
    for name, entry in header.inputs.items():
        _check_unit(place, f"inputs.{name}", entry.unit)
    for name, entry in header.scalars.items():
        _check_unit(place, f"scalars.{name}", entry.unit)
    for name, signal in header.signals.items():
        _check_unit(place, f"signals.{name}", signal.unit)
    for name, distribution in header.uncertain.items():
        _check_unit(place, f"uncertain.{name}", distribution.unit)
    signals: dict[str, dict[str, Array]] = {}
    for test in tests["test"] if header.signals else ():
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}", test):
            raise UserError(f"{folder / 'tests.csv'}: test id {test[:80]!r} cannot name a file")
        path = folder / "signals" / f"{test}.csv"
        frame = _frame(read_csv(path))
        if frame.columns[0] != "time":
            raise UserError(f"{path}: line 1: the first column must be 'time' (s)")
        if not any(name in frame.columns for name in header.signals):
            raise UserError(
                f"{path}: line 1: none of the signals {', '.join(header.signals)} is a column"
            )
        signals[test] = {
            name: _series(path, frame, name) for name in header.signals if name in frame.columns
        }
    return Measured(folder, header, tests, signals)


def _series(path: Path, frame: pd.DataFrame, name: str) -> Array:
    """Return time and values of a column where both are given."""
    table: Array = frame[["time", name]].to_numpy(dtype=float)
    given = np.flatnonzero(np.isfinite(table).all(axis=1))
    table = table[given]
    if len(table) < MIN_SAMPLES:
        raise UserError(
            f"{path}: line {frame.index[-1] if len(frame) else 1}: column {name!r} ends after "
            f"{len(table)} samples, {MIN_SAMPLES} are needed"
        )
    back = np.diff(table[:, 0]) <= 0.0
    if back.any():
        line = frame.index[given[int(np.argmax(back)) + 1]]
        raise UserError(f"{path}: line {line}: time must rise")
    _check_samples(f"{path}: column {name!r}", table[:, 0], table[:, 1])
    table[:, 0] = regular_times(table[:, 0])
    return table


def _check_samples(place: str, time: Array, values: Array) -> None:
    """Refuse implausible times and values, with which nothing can be computed."""
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not FINEST <= step <= COARSEST:
        raise UserError(
            f"{place}: its samples lie {step:.3g} s apart, {FINEST:g} to {COARSEST:g} s are "
            "possible: times must be in s"
        )
    if np.any(np.diff(time) <= 0.0):
        raise UserError(f"{place}: its times are too large to resolve their steps")
    worst = float(values[np.argmax(np.abs(values))])
    if abs(worst) > LARGEST:
        raise UserError(f"{place}: holds {worst:.3g}, no sample is above {LARGEST:g}")


def _frame(table: TextTable) -> pd.DataFrame:
    """Return a table of numbers, except for columns of text, indexed by line of the file."""
    columns = {
        name: fields if name in table.text else table.numbers(name, advice=EMPTY)
        for name, fields in table.columns.items()
    }
    return pd.DataFrame(columns, index=pd.Index(table.lines, dtype=np.int64))


def _check_unit(place: Path, key: str, name: str) -> None:
    """Refuse an unknown unit."""
    known = units.unit_names()
    if name not in known:
        raise UserError(
            f"{place}: {key}.unit: unknown unit {name!r}: use one of {', '.join(known)}"
        )


def _from_isomme(folder: Path, tests: Sequence[isomme.Test], channels: Sequence[str]) -> Measured:
    """Return ISO-MME tests of a headform: speed, mass and head acceleration."""
    rows, signals, notes = [], {}, {}
    filters = set()
    for test in tests:
        found = isomme.head_acceleration(test, channels)
        speed, mass = test.velocity_of(found.object), test.mass_of(found.object)
        if not (np.isfinite(speed) and np.isfinite(mass)):
            raise UserError(
                f"{test.path}: 'Velocity test object {found.object}' and 'Mass test object "
                f"{found.object}' must be given"
            )
        channel = found.channel
        if channel.time.size < MIN_SAMPLES:
            raise UserError(
                f"{test.path}: {channel.code} holds {channel.time.size} samples, {MIN_SAMPLES} "
                "are needed"
            )
        _check_samples(f"{test.path}: {channel.code}", channel.time, channel.values)
        filters.add(channel.filter)
        rows.append({"test": test.name, "impact_speed": speed, "headform_mass": mass})
        signals[test.name] = {
            "head_acceleration": np.stack([regular_times(channel.time), channel.values], 1)
        }
        notes[test.name] = found.notes
    if len(filters) > 1:
        raise UserError(f"{folder}: head accelerations are filtered differently: {sorted(filters)}")
    table = pd.DataFrame(rows)
    if table["test"].duplicated().any():
        raise UserError(f"{folder}: two ISO-MME tests have the same name")
    header = Header.model_validate(
        {
            "format": FORMAT,
            "title": tests[0].title or folder.name,
            "model": "headform",
            "inputs": {"impact_speed": {"unit": "m/s"}, "headform_mass": {"unit": "kg"}},
            "signals": {"head_acceleration": {"unit": "g", "filter": filters.pop()}},
        }
    )
    return Measured(folder, header, table, signals, notes)
