"""Faults: rows that kill, hang, raise or lie, workers and drivers that are killed."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import kill_driver
import numpy as np
import pandas as pd
import psutil
import pytest
import toy_evaluation
from joblib.externals.loky import get_reusable_executor
from mcstudy_tools import generator
from numpy.testing import assert_array_equal
from test_runner import N, run, task

from mcstudy.execution import runner
from mcstudy.execution.chunk import read_traces
from mcstudy.execution.results import ResultsFolder, digest

GUILTY = 137
"""Run of the row that goes wrong; its x lies below that of rows without a product."""


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    return ResultsFolder(tmp_path / "study")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return run(task(), ResultsFolder(tmp_path_factory.mktemp("reference")))


@pytest.fixture(autouse=True)
def fresh_workers() -> Iterator[None]:
    """Leave no broken or hanging worker to the next test."""
    yield
    get_reusable_executor().shutdown(wait=True, kill_workers=True)


def faulty(evaluate: Any, kind: int = 0, **more: Any) -> runner.Task:
    fault = {"x": float(task().inputs[GUILTY, 0]), "kind": kind}
    work = task(evaluate=evaluate, argument=fault)
    return replace(work, evaluator=replace(work.evaluator, **more))


def reason_of(found: pd.DataFrame, reference: pd.DataFrame, status: str) -> str:
    """Return the reason of the guilty row; all others must be as they were."""
    assert_array_equal(found["run"], np.arange(N))
    guilty = found.iloc[GUILTY]
    assert guilty["status"] == status
    assert np.isnan(guilty["total"])
    pd.testing.assert_frame_equal(*(table.drop(index=GUILTY) for table in (found, reference)))
    return str(guilty["reason"])


def test_a_row_that_kills_its_process_crashed(
    folder: ResultsFolder, reference: pd.DataFrame
) -> None:
    found = run(faulty(toy_evaluation.evaluate_and_die), folder, workers=2)
    assert "died" in reason_of(found, reference, "crashed")
    assert read_traces(folder.path / "running") == []


def test_a_process_that_dies_once_costs_no_row(
    folder: ResultsFolder, reference: pd.DataFrame, tmp_path: Path
) -> None:
    work = task(evaluate=toy_evaluation.evaluate_and_die_once, argument=tmp_path / "mark")
    assert digest(run(work, folder, workers=2)) == digest(reference)


def test_a_row_that_hangs_costs_one_timeout(folder: ResultsFolder, reference: pd.DataFrame) -> None:
    # The loop holds the interpreter: no thread and no signal handler of Python's gets through.
    start = time.monotonic()
    found = run(faulty(toy_evaluation.evaluate_and_hang, run_time=2.0), folder, workers=2)
    assert "longer than 2 s" in reason_of(found, reference, "timeout")
    assert time.monotonic() - start < 60.0


@pytest.mark.parametrize("workers", [1, 2])
def test_a_row_that_raises_is_booked_with_its_reason(
    folder: ResultsFolder, reference: pd.DataFrame, workers: int
) -> None:
    found = run(faulty(toy_evaluation.evaluate_and_raise), folder, workers=workers)
    assert reason_of(found, reference, "error") == "ValueError: a bug of two lines"


@pytest.mark.parametrize(("kind", "status", "reason"), [
    (0, "not_finite", "total has no finite value"),
    (1, "not_finite", "total has no finite value"),
    (2, "unphysical", "total = 1e+06 is outside 0 to 2"),
])  # fmt: skip
def test_a_number_that_is_none_is_never_ok(
    folder: ResultsFolder, reference: pd.DataFrame, kind: int, status: str, reason: str
) -> None:
    bounds = np.array([[0.0, 2.0], [-np.inf, np.inf]])
    found = run(faulty(toy_evaluation.evaluate_beyond, kind, bounds=bounds), folder)
    assert reason_of(found, reference, status) == reason


# -- kills: processes start anew each time, which takes seconds ------------------------------


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return digest(kill_driver.complete(tmp_path_factory.mktemp("undisturbed") / "study"))


def start_driver(path: Path) -> subprocess.Popen[bytes]:
    here = Path(__file__).parent
    return subprocess.Popen(
        [sys.executable, str(here / "kill_driver.py"), str(path)],
        env=os.environ | {"PYTHONPATH": f"{here}{os.pathsep}{Path.cwd()}"},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def kept(path: Path) -> int:
    held = ResultsFolder(path).done()
    return 0 if held is None else len(held)


def test_a_driver_that_is_killed_midway_loses_nothing(tmp_path: Path, undisturbed: str) -> None:
    path = tmp_path / "study"
    driver = start_driver(path)
    while not kept(path) and driver.poll() is None:
        time.sleep(0.02)
    driver.kill()
    driver.wait()
    assert 0 < kept(path) < kill_driver.N
    assert digest(kill_driver.complete(path)) == undisturbed


@pytest.mark.slow
def test_twenty_kills_of_the_driver_lose_nothing(tmp_path: Path, undisturbed: str) -> None:
    rng, path, grown = generator(1), tmp_path / "study", []
    start = time.monotonic()
    assert start_driver(tmp_path / "whole").wait() == 0
    whole = time.monotonic() - start
    for _ in range(20):
        driver = start_driver(path)
        time.sleep(whole * float(rng.uniform(0.1, 1.0)))
        driver.kill()
        driver.wait()
        grown.append(kept(path))
    assert grown == sorted(grown)
    assert max(grown) > 0
    assert digest(kill_driver.complete(path)) == undisturbed


@pytest.mark.parametrize("count", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_kills_of_a_worker_lose_nothing(tmp_path: Path, undisturbed: str, count: int) -> None:
    rng, kills, over = generator(2), [], threading.Event()

    def kill_now_and_then() -> None:
        while len(kills) < count and not over.is_set():
            time.sleep(float(rng.uniform(0.05, 0.6)))
            workers = [
                child for child in psutil.Process().children()
                if any("loky" in word for word in child.cmdline())
                and not any("resource_tracker" in word for word in child.cmdline())
            ]  # fmt: skip
            if workers:
                kills.append(workers[int(rng.integers(len(workers)))].pid)
                os.kill(kills[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill_now_and_then)
    killer.start()
    try:
        # A study may be over before its last kill: then once more.
        while len(kills) < count:
            path = tmp_path / f"study{len(kills)}"
            found = kill_driver.complete(path, 2, kill_driver.SLOWNESS)
            assert digest(found) == undisturbed
    finally:
        over.set()
        killer.join()
