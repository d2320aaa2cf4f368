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

import joblib
import kill_driver
import numpy as np
import pandas as pd
import psutil
import pytest
import toy_evaluation
from test_runner import N, run, task

from mcstudy.execution import runner
from mcstudy.execution.chunk import read_traces
from mcstudy.execution.progress import Progress
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
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor().shutdown(wait=True, kill_workers=True)


def fault(kind: int = 0) -> toy_evaluation.Fault:
    return {"x": float(task().inputs[GUILTY, 0]), "kind": kind}


def faulty(evaluate: Any, **more: Any) -> runner.Task:
    work = task(evaluate=evaluate, argument=fault())
    return replace(work, evaluator=replace(work.evaluator, **more))


def check_all_but_one(found: pd.DataFrame, reference: pd.DataFrame, status: str) -> str:
    """Return the reason of the guilty row; all others must be as they were."""
    np.testing.assert_array_equal(found["run"], np.arange(N))
    guilty = found.iloc[GUILTY]
    assert guilty["status"] == status
    assert np.isnan(guilty["total"])
    others = found.drop(index=GUILTY).reset_index(drop=True)
    pd.testing.assert_frame_equal(others, reference.drop(index=GUILTY).reset_index(drop=True))
    return str(guilty["reason"])


def test_a_row_that_kills_its_process_is_booked_as_crashed(
    folder: ResultsFolder, reference: pd.DataFrame
) -> None:
    found = run(faulty(toy_evaluation.evaluate_and_die), folder, workers=2)
    assert "died" in check_all_but_one(found, reference, "crashed")
    assert read_traces(folder.path / "running") == []


def test_a_row_that_hangs_costs_one_timeout(folder: ResultsFolder, reference: pd.DataFrame) -> None:
    # The loop holds the interpreter: no thread and no signal handler of Python's gets through.
    work = faulty(toy_evaluation.evaluate_and_hang, run_time=4.0)
    start = time.monotonic()
    found = run(work, folder, workers=2)
    assert "longer than 4 s" in check_all_but_one(found, reference, "timeout")
    assert time.monotonic() - start < 60.0


@pytest.mark.parametrize("workers", [1, 2])
def test_a_row_that_raises_is_booked_with_its_reason(
    folder: ResultsFolder, reference: pd.DataFrame, workers: int
) -> None:
    found = run(faulty(toy_evaluation.evaluate_and_raise), folder, workers=workers)
    assert check_all_but_one(found, reference, "error") == "ValueError: a bug of two lines"


@pytest.mark.parametrize(
    ("kind", "status", "reason"),
    [
        (0, "not_finite", "total has no finite value"),
        (1, "not_finite", "total has no finite value"),
        (2, "unphysical", "total = 1e+06 is outside 0 to 2"),
    ],
)
def test_a_number_that_is_none_is_never_ok(
    folder: ResultsFolder, reference: pd.DataFrame, kind: int, status: str, reason: str
) -> None:
    bounds = np.array([[0.0, 2.0], [-np.inf, np.inf]])
    work = task(evaluate=toy_evaluation.evaluate_beyond, argument=fault(kind=kind))
    work = replace(work, evaluator=replace(work.evaluator, bounds=bounds))
    assert check_all_but_one(run(work, folder), reference, status) == reason


def complete(path: Path) -> pd.DataFrame:
    """Return the whole study after some last quiet runs."""
    folder = ResultsFolder(path)
    with folder.open_for_writing(), joblib.parallel_config(backend="loky", n_jobs=2):
        found = runner.run(kill_driver.work(0.05), folder, Progress(quiet=True))
    np.testing.assert_array_equal(found["run"], np.arange(kill_driver.N))
    assert (found["status"] != "crashed").all()
    return found


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    return digest(complete(tmp_path_factory.mktemp("undisturbed") / "study"))


def start_driver(path: Path) -> subprocess.Popen[bytes]:
    here = Path(__file__).parent
    return subprocess.Popen(
        [sys.executable, str(here / "kill_driver.py"), str(path), "2"],
        env=os.environ | {"PYTHONPATH": f"{here}{os.pathsep}{Path.cwd()}"},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def test_twenty_kills_of_the_driver_lose_nothing(tmp_path: Path, undisturbed: str) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / "study"
    start = time.monotonic()
    assert start_driver(tmp_path / "whole").wait() == 0
    whole = time.monotonic() - start
    grown = []
    for _ in range(20):
        driver = start_driver(path)
        time.sleep(whole * float(rng.uniform(0.1, 1.0)))
        driver.kill()
        driver.wait()
        held = ResultsFolder(path).done()
        grown.append(0 if held is None else len(held))
    assert grown == sorted(grown)
    assert max(grown) > 0
    assert digest(complete(path)) == undisturbed


def test_ten_kills_of_a_worker_lose_nothing(tmp_path: Path, undisturbed: str) -> None:
    rng, kills = np.random.default_rng(2), []
    over = threading.Event()

    def kill_now_and_then() -> None:
        while len(kills) < 10 and not over.is_set():
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
        found = complete(tmp_path / "study")
        while len(kills) < 10:
            # The study was over before the tenth kill: once more from half of it.
            half = ResultsFolder(tmp_path / f"again{len(kills)}")
            half.add_part(found.iloc[:40])
            assert digest(complete(half.path)) == undisturbed
    finally:
        over.set()
        killer.join()
    assert digest(found) == undisturbed
