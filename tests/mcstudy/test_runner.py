"""The runner: same numbers however it is run, nothing lost that arrived, nothing run twice."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import pytest
import toy_evaluation
from mcstudy_tools import Array
from numpy.testing import assert_array_equal

from mcstudy.errors import StudyError
from mcstudy.execution import runner
from mcstudy.execution.evaluator import Evaluator
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder, digest
from mcstudy.sampling import designs

N = 240
SIZE = 20


def task(n: int = N, evaluate: Any = toy_evaluation.evaluate, argument: Any = None) -> runner.Task:
    return runner.Task(
        evaluator=Evaluator(evaluate, argument, toy_evaluation.OUTPUTS),
        inputs=designs.draw("latin-hypercube", n, SIZE, 2, seed=4),
        input_names=toy_evaluation.NAMES,
        replicate=np.arange(n) // SIZE,
    )


def run(
    work: runner.Task, folder: ResultsFolder, workers: int = 1, progress: Progress | None = None
) -> pd.DataFrame:
    with folder.open_for_writing(), joblib.parallel_config(backend="loky", n_jobs=workers):
        return runner.run(work, folder, progress or Progress(quiet=True))


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    return ResultsFolder(tmp_path / "study")


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    with warnings.catch_warnings():
        # One worker gives no warning.
        warnings.simplefilter("error")
        return run(task(), ResultsFolder(tmp_path_factory.mktemp("reference")))


class Recording:
    """An evaluation in this process that keeps the rows it is given and may stop."""

    def __init__(self, work: runner.Task, stop_after: int = 10**9, error: Any = None) -> None:
        self.ids = {tuple(row): k for k, row in enumerate(work.inputs.tolist())}
        self.seen: list[int] = []
        self.calls, self.stop_after, self.error = 0, stop_after, error

    def __call__(
        self, argument: object, rows: Array, started: toy_evaluation.Started
    ) -> tuple[Array, list[str]]:
        self.calls += 1
        if self.calls > self.stop_after:
            raise self.error
        self.seen += [self.ids[tuple(row)] for row in rows.tolist()]
        return toy_evaluation.evaluate(argument, rows)


def recorded(n: int = N, **stop: Any) -> tuple[runner.Task, Recording]:
    recording = Recording(task(n), **stop)
    return task(n, evaluate=recording), recording


def test_the_table_holds_inputs_outputs_and_status_by_run(reference: pd.DataFrame) -> None:
    work = task()
    columns = ["run", "replicate", "x", "y", "total", "product", "status", "reason"]
    assert list(reference.columns) == columns
    assert_array_equal(reference["run"], np.arange(N))
    assert_array_equal(reference["replicate"], np.arange(N) // SIZE)
    assert_array_equal(reference[["x", "y"]], work.inputs)
    assert_array_equal(reference["total"], work.inputs.sum(axis=1))
    # A tenth of every Latin hypercube of twenty lies above nine tenths.
    unsolved = reference["x"] > toy_evaluation.UNSOLVED
    assert unsolved.sum() == N // 10
    assert (reference["status"] == np.where(unsolved, "no_contact", "ok")).all()
    assert reference["product"].isna().equals(unsolved)


@pytest.mark.parametrize(("n", "chunk_time", "fewest", "most"), [(60, 0.0, 60, 60),
                                                                 (N, 1e9, 2, N // 10)])  # fmt: skip
def test_the_size_of_chunks_changes_no_number(
    folder: ResultsFolder, reference: pd.DataFrame, n: int, chunk_time: float, fewest: int,
    most: int,
) -> None:  # fmt: skip
    work = task(n)
    work = replace(work, evaluator=replace(work.evaluator, chunk_time=chunk_time))
    assert digest(run(work, folder)) == digest(reference.iloc[:n])
    assert fewest <= len(list((folder.path / "parts").iterdir())) <= most


def test_an_evaluator_gives_rows_in_their_order_without_a_folder(reference: pd.DataFrame) -> None:
    work = task()
    with joblib.parallel_config(backend="loky", n_jobs=2):
        batch = work.evaluator.evaluate(work.inputs)
    assert_array_equal(batch.outputs, reference[[*toy_evaluation.OUTPUTS]].to_numpy())
    assert batch.status == reference["status"].tolist()


def test_a_chunk_is_evaluated_whole_and_row_by_row_after_a_failure(reference: pd.DataFrame) -> None:
    sizes = []

    def evaluate(_argument: object, rows: Array, started: Any) -> tuple[Array, list[str]]:
        sizes.append(len(rows))
        if (rows[:, 0] > toy_evaluation.UNSOLVED).any() and len(rows) > 1:
            raise ValueError("one of them")
        return toy_evaluation.evaluate(None, rows)

    with joblib.parallel_config(n_jobs=1):
        batch = Evaluator(evaluate, None, toy_evaluation.OUTPUTS).evaluate(task().inputs)
    assert batch.status == reference["status"].tolist()
    assert max(sizes) > 1 and sizes.count(1) > 1


def test_one_run_is_a_study_too(folder: ResultsFolder) -> None:
    work = task(SIZE)
    single = replace(work, inputs=work.inputs[:1], replicate=np.array([0]))
    assert len(run(single, folder)) == 1


@pytest.mark.parametrize(
    ("error", "seen"), [(KeyboardInterrupt(), KeyboardInterrupt), (MemoryError(), StudyError)]
)
def test_an_interrupted_run_keeps_what_arrived_and_goes_on(
    folder: ResultsFolder, reference: pd.DataFrame, error: Any, seen: type[BaseException]
) -> None:
    work, recording = recorded(stop_after=5, error=error)
    with pytest.raises(seen):
        run(work, folder)
    held = folder.done()
    arrived = set() if held is None else set(held["run"].tolist())
    assert 0 < len(arrived) < N
    assert arrived <= set(recording.seen)
    work, recording = recorded()
    assert digest(run(work, folder)) == digest(reference)
    assert sorted(recording.seen) == sorted(set(range(N)) - arrived)


def test_a_run_resumed_with_other_workers_gives_the_same_numbers(
    folder: ResultsFolder, reference: pd.DataFrame
) -> None:
    for start in (180, 20, 100):
        folder.add_part(reference.iloc[start : start + 33])
    assert digest(run(task(), folder, workers=2)) == digest(reference)
    assert digest(folder.runs()) == digest(reference)


def test_kept_runs_are_not_run_again_but_those_of_a_torn_part(
    folder: ResultsFolder, reference: pd.DataFrame
) -> None:
    folder.add_part(reference.iloc[:60])
    folder.add_part(reference.iloc[60:120].assign(total=-1.0))
    torn = min((folder.path / "parts").iterdir())
    torn.write_bytes(torn.read_bytes()[:-40])
    work, recording = recorded()
    found = run(work, folder)
    assert set(recording.seen) == set(range(60)) | set(range(120, N))
    kept = found["run"].between(60, 119)
    assert_array_equal(found["total"], np.where(kept, -1.0, reference["total"]))


def test_a_study_of_another_size_goes_on(folder: ResultsFolder, reference: pd.DataFrame) -> None:
    folder.compact(reference)
    for n in (N, N // 2):
        work, recording = recorded(n)
        assert digest(run(work, folder)) == digest(reference.iloc[:n])
        assert recording.calls == 0
    folder.compact(reference)
    work, recording = recorded(2 * N)
    doubled = run(work, folder)
    assert digest(doubled.iloc[:N]) == digest(reference)
    assert sorted(recording.seen) == list(range(N, 2 * N))
    assert digest(doubled) == digest(run(task(2 * N), ResultsFolder(folder.path / "afresh")))


@pytest.mark.parametrize(("complete", "failed"), [({"ok"}, 12), ({"ok", "no_contact"}, 0)])
def test_progress_counts_the_failures_of_this_session(
    folder: ResultsFolder, reference: pd.DataFrame, complete: set[str], failed: int
) -> None:
    folder.add_part(reference.iloc[:120])
    progress = Progress(quiet=True, complete=frozenset(complete))
    run(task(), folder, progress=progress)
    assert progress.failed == failed
