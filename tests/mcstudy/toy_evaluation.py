"""What the workers of the runner's tests run: cheap, top-level, importable in a fresh process."""

import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Started = Callable[[int], None]
Found = tuple[Array, list[str]]

NAMES = ("x", "y")
OUTPUTS = ("total", "product")
UNSOLVED = 0.9
"""Rows whose x lies above end with a status of their own and without a product."""


def ignore(_row: int) -> None:
    """Tell nobody which row begins."""


class Fault(TypedDict):
    """Which row goes wrong, the one with this x, and in which of several ways."""

    x: float
    kind: int


def evaluate(argument: object, rows: Array, started: Started = ignore) -> Found:
    """Return x + y and x * y; rows with x above ``UNSOLVED`` have no product."""
    unsolved = rows[:, 0] > UNSOLVED
    product = np.where(unsolved, np.nan, rows[:, 0] * rows[:, 1])
    status = np.where(unsolved, "no_contact", "ok")
    return np.stack([rows[:, 0] + rows[:, 1], product], axis=1), status.tolist()


def evaluate_slowly(argument: float, rows: Array, started: Started = ignore) -> Found:
    """Take some time, in s, for every row."""
    time.sleep(argument * len(rows))
    return evaluate(None, rows)


def _is_faulty(fault: Fault, rows: Array) -> bool:
    return bool((rows[:, 0] == fault["x"]).any())


def evaluate_and_die(fault: Fault, rows: Array, started: Started = ignore) -> Found:
    """End the process at one row, without a word."""
    if _is_faulty(fault, rows):
        os._exit(1)
    return evaluate_slowly(0.002, rows)


def evaluate_and_die_once(mark: Path, rows: Array, started: Started = ignore) -> Found:
    """End the process at the first row, the first time."""
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return evaluate_slowly(0.002, rows)


def evaluate_and_hang(fault: Fault, rows: Array, started: Started = ignore) -> Found:
    """Never come back from one row, and let nothing else in the process run either."""
    if _is_faulty(fault, rows):
        # A match that backtracks for ever does so in C, with the interpreter held.
        re.fullmatch(r"(a+)+b", "a" * 64)
    return evaluate_slowly(0.002, rows)


def evaluate_and_raise(fault: Fault, rows: Array, started: Started = ignore) -> Found:
    """Raise at one row."""
    if _is_faulty(fault, rows):
        raise ValueError("a bug\nof two lines")
    return evaluate(None, rows)


def evaluate_beyond(fault: Fault, rows: Array, started: Started = ignore) -> Found:
    """Give numbers that are none, as if all were well: NaN, infinity, a million."""
    outputs, status = evaluate(None, rows)
    outputs[rows[:, 0] == fault["x"], 0] = {0: np.nan, 1: np.inf, 2: 1e6}[fault["kind"]]
    return outputs, status
