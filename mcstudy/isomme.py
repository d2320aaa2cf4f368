"""ISO-MME (ISO/TS 13499): crash test data as text, one folder a test.

``<NAME>.mme`` describes the test, ``Channel/<NAME>.chn`` lists the channels, ``Channel/<NAME>.001``
and so on hold one channel each: a header of ``name :value`` lines, split at the first colon, then
one sample a line. ``NOVALUE`` stands for a missing value.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy import units
from mcstudy.errors import UserError

Array = NDArray[np.float64]

MISSING = "NOVALUE"
FILTERS = {"A": "CFC1000", "B": "CFC600", "C": "CFC180", "D": "CFC60"}
"""Filter by the last character of a channel code; any other stands for a raw signal."""
_UNITS = {"m/(s*s)": "m/s2", "m/s^2": "m/s2", "m/s²": "m/s2"}
_WIDTH = 28


@dataclass(frozen=True)
class Channel:
    """A channel: code of 16 characters, unit, times (s), values (NaN where missing)."""

    code: str
    unit: str
    time: Array
    values: Array

    @property
    def filter(self) -> str:
        """Filter of the signal, ``none`` if it is raw or unknown."""
        return FILTERS.get(self.code[15:16], "none")


@dataclass(frozen=True)
class Test:
    """A test: name, title, speed (m/s) and mass (kg) of test object 1 (NaN if missing)."""

    name: str
    title: str
    velocity: float
    mass: float
    channels: tuple[Channel, ...]


def find_tests(folder: Path) -> list[Path]:
    """Return the ``.mme`` files of a folder or of its direct subfolders, by name."""
    here = [p for p in folder.iterdir() if p.suffix.lower() == ".mme"]
    below = [p for d in folder.iterdir() if d.is_dir() for p in d.iterdir()
             if p.suffix.lower() == ".mme"]  # fmt: skip
    return sorted(here or below)


def read_test(path: Path) -> Test:
    """Read an ISO-MME test from its ``.mme`` file.

    Raises
    ------
    UserError
        If a file is missing or not of the format; the message names it.
    """
    header = _header(_lines(path))
    folder = next(
        (d for d in path.parent.iterdir() if d.is_dir() and d.name.lower() == "channel"), None
    )
    if folder is None:
        raise UserError(f"{path}: has no folder 'Channel' beside it")
    pattern = re.compile(rf"{re.escape(path.stem)}\.\d{{3,}}", re.IGNORECASE)
    files = sorted(p for p in folder.iterdir() if pattern.fullmatch(p.name))
    if not files:
        raise UserError(f"{folder}: holds no channels of {path.stem}")
    return Test(
        name=path.stem,
        title="" if header.get("title", MISSING).upper() == MISSING else header["title"],
        velocity=_number(path, header, "m/s", "velocity test object 1"),
        mass=_number(path, header, "kg", "mass test object 1", "mass of test object 1"),
        channels=tuple(_channel(file) for file in files),
    )


def head_acceleration(test: Test) -> Channel:
    """Return the resultant head acceleration (g): a resultant channel, or made of x, y and z.

    Raises
    ------
    UserError
        If the test has neither, or speed or mass of the test object is missing.
    """
    if not (np.isfinite(test.velocity) and np.isfinite(test.mass)):
        raise UserError(
            f"{test.name}: 'Velocity test object 1' and 'Mass test object 1' must be given"
        )
    found = {
        c.code[14]: c for c in test.channels if c.code[2:6] == "HEAD" and c.code[12:14] == "AC"
    }
    if "R" in found:
        parts = [found["R"]]
    elif {"X", "Y", "Z"} <= set(found):
        parts = [found[axis] for axis in "XYZ"]
    else:
        raise UserError(
            f"{test.name}: has no head acceleration, resultant (??HEAD??????ACR?) or in x, y and z"
        )
    if any(p.time.shape != parts[0].time.shape or np.any(p.time != parts[0].time) for p in parts):
        raise UserError(f"{test.name}: the head acceleration's components differ in time")
    if len({part.filter for part in parts}) > 1:
        raise UserError(f"{test.name}: the head acceleration's components are filtered differently")
    try:
        values = np.array([part.values * units.factor(part.unit, "g") for part in parts])
    except ValueError as error:
        raise UserError(f"{test.name}: {parts[0].code}: {error}") from None
    kept = np.isfinite(values).all(axis=0)
    code = parts[0].code[:14] + "R" + parts[0].code[15:]
    # A resultant channel stays as it is: its noise before contact may be of either sign.
    found_values = values[0] if len(parts) == 1 else np.sqrt((values**2).sum(axis=0))
    return Channel(code, "g", parts[0].time[kept], found_values[kept])


def write_test(
    folder: Path | str,
    name: str,
    channels: Mapping[str, tuple[Array, str]],
    *,
    start: float,
    interval: float,
    title: str = "",
    velocity: float = np.nan,
    mass: float = np.nan,
) -> Path:
    """Write a test and return its ``.mme`` file.

    Parameters
    ----------
    folder : the test's folder, created.
    name : of the test, letters and digits.
    channels : values and unit by 16-character code.
    start, interval : s, time of the first sample and between samples.
    title, velocity, mass : of the test; m/s and kg of test object 1.

    Raises
    ------
    UserError
        If the folder cannot be written.
    ValueError
        If a code has not 16 characters.
    """
    bad = [code for code in channels if not re.fullmatch(r"[A-Z0-9]{16}", code)]
    if bad:
        raise ValueError(f"an ISO-MME channel code has 16 letters and digits, given {bad[0]!r}")

    def given(value: float) -> str:
        return f"{value:.9g}" if np.isfinite(value) else MISSING

    folder = Path(folder)
    mme = folder / f"{name}.mme"
    try:
        (folder / "Channel").mkdir(parents=True, exist_ok=True)
        _write(mme, {
            "Data format edition number": "1.6",
            "Laboratory name": "mcstudy",
            "Title": title or MISSING,
            "Type of the test": "simulation",
            "Number of test objects": "1",
            "Name of test object 1": name,
            "Velocity test object 1": given(velocity),
            "Mass test object 1": given(mass),
        })  # fmt: skip
        index = {"Instrumentation standard": "ISO 6487", "Number of channels": str(len(channels))}
        index |= {f"Name of channel {k:03d}": f"{code} / {code}"
                  for k, code in enumerate(channels, start=1)}  # fmt: skip
        _write(folder / "Channel" / f"{name}.chn", index)
        for k, (code, (values, unit)) in enumerate(channels.items(), start=1):
            _write(folder / "Channel" / f"{name}.{k:03d}", {
                "Test object number": code[0],
                "Name of the channel": code,
                "Channel code": code,
                "Unit": unit,
                "Data source": "calculation",
                "Data status": "ok",
                "Reference channel": "implicit",
                "Sampling interval": f"{interval:.9g}",
                "Time of first sample": f"{start:.9g}",
                "Number of samples": str(values.size),
                "First global maximum value": f"{np.nanmax(values):.6E}",
                "First global minimum value": f"{np.nanmin(values):.6E}",
            }, values)  # fmt: skip
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error})") from None
    return mme


def _write(path: Path, header: Mapping[str, str], samples: Array | None = None) -> None:
    lines = [f"{key:<{_WIDTH}}:{' '.join(value.split())}" for key, value in header.items()]
    if samples is not None:
        lines += [f"{v:.6E}" if np.isfinite(v) else MISSING for v in samples]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _lines(path: Path) -> list[str]:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    try:
        return raw.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        # Older programs write the Western code page.
        return raw.decode("latin-1").splitlines()


def _header(lines: list[str]) -> dict[str, str]:
    """Return the header by lower-case name."""
    pairs = (line.partition(":") for line in lines if ":" in line)
    return {key.strip().lower(): value.strip() for key, _, value in pairs}


def _number(path: Path, header: Mapping[str, str], unit: str, *names: str) -> float:
    """Return the first of the named values in ``unit``, NaN if none is given.

    A unit may follow the number.
    """
    for name in names:
        text = header.get(name, MISSING)
        if text.upper() in ("", MISSING):
            continue
        value, _, given = text.partition(" ")
        try:
            return float(value) * (units.factor(given.strip(), unit) if given.strip() else 1.0)
        except ValueError:
            raise UserError(f"{path}: {name!r} is {text[:40]!r}, not a number in {unit}") from None
    return np.nan


def _channel(path: Path) -> Channel:
    lines = _lines(path)
    first = next((k for k, line in enumerate(lines) if ":" not in line and line.strip()), None)
    header = _header(lines[:first])
    samples = [line.strip() for line in lines[first:] if line.strip()] if first is not None else []
    code = header.get("channel code", "")
    if len(code) != 16:
        raise UserError(f"{path}: channel code {code[:40]!r} has not 16 characters")
    try:
        values = np.array([np.nan if s == MISSING else float(s) for s in samples])
    except ValueError as error:
        raise UserError(f"{path}: {error}") from None
    interval = _number(path, header, "s", "sampling interval")
    start = _number(path, header, "s", "time of first sample")
    count = _number(path, header, "1", "number of samples")
    if not interval > 0.0 or not np.isfinite(start):
        raise UserError(f"{path}: 'Sampling interval' and 'Time of first sample' must be given")
    if values.size < 2:
        raise UserError(f"{path}: holds no samples")
    if np.isfinite(count) and count != values.size:
        raise UserError(f"{path}: holds {values.size} samples, its header says {count:g}")
    unit = header.get("unit", "1")
    time: Array = start + interval * np.arange(values.size, dtype=np.float64)
    return Channel(code, _UNITS.get(unit, unit), time, values)
