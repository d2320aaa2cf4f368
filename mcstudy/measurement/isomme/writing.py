"""Tests written as ISO-MME."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcstudy.errors import UserError
from mcstudy.measurement.isomme.files import MISSING

Array = NDArray[np.float64]

_WIDTH = 28
"""Column of the colon in a header."""


def write_test(
    folder: Path | str,
    name: str,
    channels: Mapping[str, tuple[Array, str]],
    *,
    start: float,
    interval: float,
    title: str = "",
    comment: str = "",
    velocity: float = np.nan,
    mass: float = np.nan,
) -> Path:
    """Write a test and return its ``.mme`` file.

    Parameters
    ----------
    folder : Path or str
        The test's folder, created.
    name : str
        Of the test, letters and digits.
    channels : mapping
        Values and unit by 16-character code.
    start : float
        Time of the first sample, s.
    interval : float
        Sampling interval, s.
    title, comment : str
        Of the test.
    velocity : float
        m/s, of test object 1.
    mass : float
        kg, of test object 1.

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
            "Comments": comment or MISSING,
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
