"""What the workers of the runner's tests run: cheap, top-level, importable in a fresh process."""

import os
import time
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NAMES = ("x", "y")
OUTPUTS = ("total", "product")
UNSOLVED = 0.9
"""Rows whose x lies above end with a status of their own and without a product."""


class Fault(TypedDict):
    """Where a worker process misbehaves; the driver, told by its process id, never does."""

    driver: int
    x: float


def evaluate(argument: object, rows: Array) -> tuple[Array, list[str]]:
    """Return x + y and x * y; rows with x above ``UNSOLVED`` have no product."""
    unsolved = rows[:, 0] > UNSOLVED
    product = np.where(unsolved, np.nan, rows[:, 0] * rows[:, 1])
    status = np.where(unsolved, "no_contact", "ok")
    return np.stack([rows[:, 0] + rows[:, 1], product], axis=1), status.tolist()


def _in_faulty_worker(fault: Fault, rows: Array) -> bool:
    return os.getpid() != fault["driver"] and bool((rows[:, 0] == fault["x"]).any())


def evaluate_and_die(fault: Fault, rows: Array) -> tuple[Array, list[str]]:
    """Kill the worker process at one row, after the other chunks have had time to arrive."""
    if _in_faulty_worker(fault, rows):
        time.sleep(1.5)
        os._exit(1)
    return evaluate(None, rows)


def evaluate_and_hang(fault: Fault, rows: Array) -> tuple[Array, list[str]]:
    """Never come back from one row."""
    if _in_faulty_worker(fault, rows):
        time.sleep(600.0)
    return evaluate(None, rows)
