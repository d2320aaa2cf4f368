"""A study on a dask cluster of this machine, started by hand, its workers killed meanwhile."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import kill_driver
import pytest

from mcstudy.errors import StudyError, UserError
from mcstudy.execution import runner
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.execution.workers import parallel_backend

pytest.importorskip("distributed")
HERE = Path(__file__).parent


class Cluster:
    """A scheduler and two workers as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.processes = folder, []
        self.start("scheduler", "--port", "0", "--dashboard-address", ":0", "--host", "127.0.0.1")
        until = time.monotonic() + 60.0
        while not (found := re.search(r"Scheduler at:\s+(tcp://\S+)", self.log())):
            assert time.monotonic() < until, self.log()
            time.sleep(0.1)
        self.address = found[1]
        for _ in range(2):
            self.start("worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def start(self, what: str, *arguments: str) -> None:
        log = (self.folder / f"{len(self.processes)}.log").open("wb")
        self.processes.append(subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments],
            env=os.environ | {"PYTHONPATH": f"{HERE}{os.pathsep}{Path.cwd()}"},
            stdout=log, stderr=log, cwd=self.folder,
        ))  # fmt: skip

    def log(self) -> str:
        return (self.folder / "0.log").read_text(encoding="utf-8")

    def kill(self, *which: int) -> None:
        for k in which:
            self.processes[k].kill()
            self.processes[k].wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    (tmp_path / "cluster").mkdir()
    started = Cluster(tmp_path / "cluster")
    yield started
    started.kill(2, 1, 0)


def run_and_kill(cluster: Cluster, folder: ResultsFolder, *which: int) -> str:
    """Run the study there and kill workers as soon as a part has arrived."""

    def wait_and_kill() -> None:
        until = time.monotonic() + 60.0
        while not list(folder.path.glob("parts/*.parquet")) and time.monotonic() < until:
            time.sleep(0.02)
        cluster.kill(*which)

    killer = threading.Thread(target=wait_and_kill)
    killer.start()
    try:
        with folder.open_for_writing(), parallel_backend(cluster.address):
            return digest(runner.run(kill_driver.work(), folder, Progress(quiet=True)))
    finally:
        killer.join()


def test_lost_workers_cost_no_run_and_the_loss_of_all_is_told(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcstudy.execution.cluster.GRACE", 1.0)
    here = digest(kill_driver.complete(tmp_path / "here"))
    assert run_and_kill(cluster, ResultsFolder(tmp_path / "one lost"), 1) == here
    folder = ResultsFolder(tmp_path / "all lost")
    with pytest.raises(StudyError, match="lost all its workers"):
        run_and_kill(cluster, folder, 2)
    held = folder.done()
    assert held is not None
    assert 0 < len(held) < kill_driver.N
    assert (held["status"] != "crashed").all()
    assert digest(kill_driver.complete(folder.path)) == here


def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mcstudy.execution.cluster.CONNECT_TIME", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense", "tcp://"):
        with pytest.raises(UserError, match="--cluster") as error, parallel_backend(address):
            pass
        assert "\n" not in str(error.value)
