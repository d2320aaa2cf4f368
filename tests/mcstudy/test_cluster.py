"""A study on a dask cluster of this machine, started by hand, one worker killed meanwhile."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import kill_driver
import numpy as np
import pytest
from test_faults import complete

from mcstudy.errors import StudyError, UserError
from mcstudy.execution import runner
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.execution.workers import parallel_backend

pytest.importorskip("distributed")
HERE = Path(__file__).parent


class Cluster:
    """A scheduler and workers as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = os.environ | {"PYTHONPATH": f"{HERE}{os.pathsep}{Path.cwd()}"}
        port = ["--port", "0", "--dashboard-address", ":0", "--host", "127.0.0.1"]
        self.scheduler = self._start("scheduler", *port)
        self.address = self._address()
        self.workers = [self.start_worker(k) for k in range(2)]

    def _start(self, what: str, *arguments: str) -> "subprocess.Popen[bytes]":
        log = (self.folder / f"{what}{len(list(self.folder.glob('*.log')))}.log").open("wb")
        return subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + what, *arguments],
            env=self.environment, stdout=log, stderr=log, cwd=self.folder,
        )  # fmt: skip

    def _address(self) -> str:
        until = time.monotonic() + 60.0
        while time.monotonic() < until:
            found = re.search(r"Scheduler at:\s+(tcp://\S+)", self.log("scheduler0"))
            if found:
                return found[1]
            time.sleep(0.1)
        raise AssertionError(self.log("scheduler0"))

    def log(self, name: str) -> str:
        path = self.folder / f"{name}.log"
        return path.read_text(encoding="utf-8") if path.exists() else ""

    def start_worker(self, _number: int) -> "subprocess.Popen[bytes]":
        return self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"
        )

    def stop(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    folder = tmp_path / "cluster"
    folder.mkdir()
    started = Cluster(folder)
    yield started
    started.stop()


def run_there(address: str, folder: ResultsFolder) -> str:
    with folder.open_for_writing(), parallel_backend(address):
        found = runner.run(kill_driver.work(0.05), folder, Progress(quiet=True))
    np.testing.assert_array_equal(found["run"], np.arange(kill_driver.N))
    return digest(found)


def wait_for_parts(folder: ResultsFolder) -> None:
    until = time.monotonic() + 60.0
    while not list(folder.path.glob("parts/*.parquet")) and time.monotonic() < until:
        time.sleep(0.02)


def test_a_lost_worker_costs_no_run_and_changes_no_number(cluster: Cluster, tmp_path: Path) -> None:
    folder = ResultsFolder(tmp_path / "study")

    def kill_one() -> None:
        wait_for_parts(folder)
        cluster.workers[0].kill()

    killer = threading.Thread(target=kill_one)
    killer.start()
    found = run_there(cluster.address, folder)
    killer.join()
    assert cluster.workers[0].wait() != 0
    assert found == digest(complete(tmp_path / "here"))


def test_a_cluster_without_workers_is_told_and_what_arrived_goes_on(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcstudy.execution.cluster.GRACE", 1.0)
    folder = ResultsFolder(tmp_path / "study")

    def kill_both() -> None:
        wait_for_parts(folder)
        for worker in cluster.workers:
            worker.kill()

    killer = threading.Thread(target=kill_both)
    killer.start()
    with pytest.raises(StudyError, match="lost all its workers"):
        run_there(cluster.address, folder)
    killer.join()
    held = folder.done()
    assert held is not None
    assert 0 < len(held) < kill_driver.N
    assert (held["status"] != "crashed").all()
    assert digest(complete(folder.path)) == digest(complete(tmp_path / "here"))


def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcstudy.execution.cluster.CONNECT_TIME", 1.0)
    for address in ("tcp://127.0.0.1:9", "nonsense", "tcp://"):
        with pytest.raises(UserError, match="--cluster") as error, parallel_backend(address):
            pass
        assert "\n" not in str(error.value)
