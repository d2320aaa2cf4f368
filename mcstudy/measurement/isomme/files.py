"""The files of an ISO-MME test.

``<NAME>.mme`` describes the test, ``Channel/<NAME>.chn`` lists the channels, ``Channel/<NAME>.001``
and so on hold one channel each: a header of ``name :value`` lines, split at the first colon, then
one sample a line. ``NOVALUE`` stands for a missing value.

Headers are read of every channel, samples only of the selected ones: other channels may hold a
single value, no times or no code.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError
from mcstudy.files import lines_of, read_text

Array = NDArray[np.float64]

MISSING = "NOVALUE"
FILTERS = {"A": "CFC1000", "B": "CFC600", "C": "CFC180", "D": "CFC60"}
"""Filter by the last character of a channel code."""
RAW = "0"
"""Last character of the code of a channel that is not filtered."""
SOUND = ("", "ok", "scaling factor applied", "linearised data", "linearized data")
"""Values of 'Data status' of usable channels; the format also has channel failed, system failed,
meaningless, questionable and no data."""
TIME = "TI"
"""Physical dimension, characters 13 and 14, of a channel of times."""
UNEQUAL = 1e-3
"""Tolerated difference of times in the last sample, in intervals a sample (assumed)."""


@dataclass(frozen=True)
class Channel:
    """A channel: code, unit, times (s), values (NaN where missing), filter, notes."""

    code: str
    unit: str
    time: Array
    values: Array
    filter: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChannelFile:
    """A channel file: header, code, lines.

    Attributes
    ----------
    path : of the file.
    code : in capital letters, not always of 16 characters.
    header : values by lower-case name.
    lines : of the file.
    first : number of the first line that is a sample, from 0.
    """

    path: Path
    code: str
    header: Mapping[str, str]
    lines: Sequence[str]
    first: int

    @property
    def status(self) -> str:
        """Value of 'Data status', empty if none is given."""
        return _given(self.header, "data status").lower()

    @property
    def source(self) -> str:
        """Value of 'Data source', empty if none is given."""
        return _given(self.header, "data source").lower()

    @cached_property
    def count(self) -> int:
        """Number of samples."""
        return sum(1 for line in self.lines[self.first :] if line.strip())

    @property
    def object(self) -> int:
        """Number of the test object, 1 if none is given."""
        number = _given(self.header, "test object number") or self.code[:1]
        return int(number) if re.fullmatch(r"[1-9]", number) else 1

    @property
    def filter(self) -> str:
        """Filter of the signal, ``none`` if it is raw or unknown.

        The header's channel frequency class is used where the code does not state the filter.
        """
        letter = self.code[15:16]
        if letter in FILTERS or letter == RAW:
            return FILTERS.get(letter, "none")
        return self.stated_filter or "none"

    @property
    def stated_filter(self) -> str:
        """Filter by the header's channel frequency class, empty if it states none."""
        stated = re.sub(r"[^0-9.]", "", _given(self.header, "channel frequency class"))
        names = {name.removeprefix("CFC"): name for name in FILTERS.values()}
        return names.get(stated.removesuffix(".0"), "")


@dataclass(frozen=True)
class Test:
    """A test: name, title, header by lower-case name, channel files."""

    path: Path
    title: str
    header: Mapping[str, str]
    files: tuple[ChannelFile, ...]

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.path.stem

    @property
    def velocity(self) -> float:
        """Speed (m/s) of test object 1, NaN if missing."""
        return self.velocity_of(1)

    @property
    def mass(self) -> float:
        """Mass (kg) of test object 1, NaN if missing."""
        return self.mass_of(1)

    def velocity_of(self, number: int) -> float:
        """Return the speed (m/s) of a test object, NaN if missing."""
        return _number(self.path, self.header, "m/s", f"velocity test object {number}")

    def mass_of(self, number: int) -> float:
        """Return the mass (kg) of a test object, NaN if missing."""
        names = (f"mass test object {number}", f"mass of test object {number}")
        return _number(self.path, self.header, "kg", *names)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All channels, read."""
        return tuple(self.read(file) for file in self.files)

    def read(self, file: ChannelFile) -> Channel:
        """Return a channel of the test with its samples and times.

        An explicit reference channel gives the times where the header names one, else the sampling
        interval, else the test's only channel of times.

        Raises
        ------
        UserError
            If samples or times are missing or wrong; the message names the file and the line.
        """
        if len(file.code) != 16:
            raise UserError(f"{file.path}: channel code {file.code[:40]!r} has not 16 characters")
        values = _samples(file)
        count = _number(file.path, file.header, "1", "number of samples")
        if values.size < 2:
            raise UserError(f"{file.path}: holds {values.size} samples, 2 are needed")
        if np.isfinite(count) and count != values.size:
            raise UserError(f"{file.path}: holds {values.size} samples, its header says {count:g}")
        time, notes = self._times(file, values.size)
        if file.stated_filter not in ("", file.filter) and file.code[15] in FILTERS:
            notes.append(
                f"{file.code}: its code says {file.filter}, its header {file.stated_filter}; taken "
                f"as {file.filter}"
            )
        unit = _given(file.header, "unit") or "1"
        return Channel(file.code, units.canonical(unit), time, values, file.filter, tuple(notes))

    def _times(self, file: ChannelFile, count: int) -> tuple[Array, list[str]]:
        """Return the times (count,) of a channel's samples, in s, and notes on them."""
        interval = _number(file.path, file.header, "s", "sampling interval")
        start = _number(file.path, file.header, "s", "time of first sample")
        nominal: Array | None = None
        if interval > 0.0 and np.isfinite(start):
            nominal = start + interval * np.arange(count, dtype=np.float64)
        explicit = _given(file.header, "reference channel").lower() == "explicit"
        name = _given(file.header, "reference channel name")
        others = [
            f for f in self.files
            if f is not file and f.code[12:14] == TIME and f.count == count
        ]  # fmt: skip
        if explicit and name:
            others = [f for f in self.files if f is not file and _is_named(f, name)]
        if explicit and len(others) != 1:
            raise UserError(
                f"{file.path}: its times stand in a reference channel"
                + (f" {name[:40]!r}" if name else "")
                + f", and the test has {len(others)} of that kind"
            )
        if not explicit and nominal is not None:
            notes = [
                f"{file.code}: times are those of its sampling interval; the channel of times "
                f"{other.path.name} differs from them"
                for other in others
                if self._differs(other, nominal)
            ]
            return nominal, notes
        if len(others) != 1:
            raise UserError(
                f"{file.path}: 'Sampling interval' and 'Time of first sample' must be given, or a "
                "reference channel of times"
            )
        time = self._reference(others[0], count)
        notes = [f"{file.code}: times are those of {others[0].code} ({others[0].path.name})"]
        if nominal is not None and not _is_close(time, nominal):
            notes[0] += f", not its sampling interval of {interval:g} s"
        return time, notes

    def _differs(self, file: ChannelFile, time: Array) -> bool:
        """Return whether a channel of times holds other times; False if it is unusable."""
        try:
            return not _is_close(self._reference(file, time.size), time)
        except UserError:
            return False

    def _reference(self, file: ChannelFile, count: int) -> Array:
        """Return the values of a channel of times in s."""
        time = _samples(file)
        if time.size != count:
            raise UserError(f"{file.path}: holds {time.size} times, the channel {count} samples")
        if not (np.all(np.isfinite(time)) and np.all(np.diff(time) > 0.0)):
            raise UserError(f"{file.path}: times must be given and rise")
        try:
            return time * units.factor(_given(file.header, "unit") or "s", "s")
        except ValueError as error:
            raise UserError(f"{file.path}: {error}") from None


def find_tests(folder: Path) -> list[Path]:
    """Return the ``.mme`` files of a folder or of its direct subfolders, by name.

    Raises
    ------
    UserError
        If a folder cannot be read.
    """
    try:
        here = [p for p in folder.iterdir() if p.suffix.lower() == ".mme"]
        below = [p for d in folder.iterdir() if d.is_dir() for p in d.iterdir()
                 if p.suffix.lower() == ".mme"]  # fmt: skip
    except OSError as error:
        raise UserError(f"{folder}: cannot be read ({error})") from None
    return sorted(here or below)


def read_test(path: Path) -> Test:
    """Read an ISO-MME test from its ``.mme`` file: the headers of all channels.

    Raises
    ------
    UserError
        If a file is missing or not of the format; the message names it.
    """
    header = _header(lines_of(read_text(path)))
    try:
        folder = next(
            (d for d in path.parent.iterdir() if d.is_dir() and d.name.lower() == "channel"), None
        )
        if folder is None:
            raise UserError(f"{path}: has no folder 'Channel' beside it")
        inside = sorted(p for p in folder.iterdir() if p.is_file())
    except OSError as error:
        raise UserError(f"{path.parent}: cannot be read ({error})") from None
    pattern = re.compile(rf"{re.escape(path.stem)}\.(\d{{3,}})", re.IGNORECASE)
    files = [p for p in inside if pattern.fullmatch(p.name)]
    if not files:
        raise UserError(f"{folder}: holds no channels of {path.stem}")
    index = next((p for p in inside if p.name.lower() == f"{path.stem.lower()}.chn"), None)
    listed = {} if index is None else _header(lines_of(read_text(index)))
    return Test(path, _given(header, "title"), header,
                tuple(_channel_file(file, listed) for file in files))  # fmt: skip


def _channel_file(path: Path, listed: Mapping[str, str]) -> ChannelFile:
    lines = lines_of(read_text(path))
    first = next((k for k, line in enumerate(lines) if ":" not in line and line.strip()), None)
    header = _header(lines[:first])
    code = _given(header, "channel code")
    if not code:
        # The index of channels also has it: 'Name of channel 001 :CODE / description'.
        name = _given(listed, f"name of channel {path.suffix[1:]}")
        code = name.partition("/")[0].strip()
    return ChannelFile(path, code.upper(), header, lines, len(lines) if first is None else first)


def _header(lines: Sequence[str]) -> dict[str, str]:
    """Return the header by lower-case name."""
    pairs = (line.partition(":") for line in lines if ":" in line)
    return {key.strip().lower(): value.strip() for key, _, value in pairs}


def _given(header: Mapping[str, str], name: str) -> str:
    """Return a value of a header, empty if it is missing."""
    text = header.get(name, "")
    return "" if text.upper() == MISSING else text


def _number(path: Path, header: Mapping[str, str], unit: str, *names: str) -> float:
    """Return the first of the named values in ``unit``, NaN if none is given.

    A unit may follow the number.
    """
    for name in names:
        text = _given(header, name)
        if not text:
            continue
        value, _, given = text.partition(" ")
        try:
            number = float(value) * (units.factor(given.strip(), unit) if given.strip() else 1.0)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise UserError(f"{path}: {name!r} is {text[:40]!r}, not a number in {unit}")
        return number
    return np.nan


def _samples(file: ChannelFile) -> Array:
    """Return the samples of a channel, NaN where missing, infinite where so written."""
    kept = [(k, line.strip()) for k, line in enumerate(file.lines) if k >= file.first]
    kept = [(k, text) for k, text in kept if text]
    values = np.full(len(kept), np.nan)
    for n, (k, text) in enumerate(kept):
        if text.upper() == MISSING:
            continue
        try:
            # Underscores between digits and digits of other scripts are Python's own.
            values[n] = float(text if text.isascii() and "_" not in text else "")
        except ValueError:
            hint = " (a decimal comma: write a point)" if re.fullmatch(r"[-+\dEe]+,[-+\dEe]+",
                                                                       text) else ""  # fmt: skip
            raise UserError(
                f"{file.path}: line {k + 1}: {text[:40]!r} is no number{hint}"
            ) from None
    return values


def _is_named(file: ChannelFile, name: str) -> bool:
    """Return whether the name of a reference channel refers to this channel."""
    names = (file.code, file.path.name, file.path.suffix[1:],
             _given(file.header, "name of the channel"))  # fmt: skip
    return name.strip().lower() in {known.lower() for known in names if known}


def _is_close(one: Array, other: Array) -> bool:
    """Return whether two columns of times are equal within rounding."""
    interval = float(other[1] - other[0])
    return bool(np.max(np.abs(one - other)) <= UNEQUAL * interval * other.size)
