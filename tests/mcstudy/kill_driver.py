"""A study of the toy evaluation, run in a process of its own that is there to be killed."""

import sys
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import toy_evaluation

from mcstudy.execution import runner
from mcstudy.execution.evaluator import Evaluator
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder
from mcstudy.sampling import designs

N = 400
SLOWNESS = 0.006
"""s a row: the study takes about as long as its processes take to start."""


def work(slowness: float = SLOWNESS) -> runner.Task:
    """Return the study, in chunks of some s."""
    return runner.Task(
        evaluator=Evaluator(
            toy_evaluation.evaluate_slowly, slowness, toy_evaluation.OUTPUTS, chunk_time=0.05
        ),
        inputs=designs.draw("latin-hypercube", N, 20, 2, seed=5),
        input_names=toy_evaluation.NAMES,
        replicate=np.arange(N) // 20,
    )


def complete(path: Path, workers: int = 1, slowness: float = 0.0) -> pd.DataFrame:
    """Run the study to its end, or go on with it, and return all of its runs."""
    folder = ResultsFolder(path)
    with folder.open_for_writing(), joblib.parallel_config(backend="loky", n_jobs=workers):
        found = runner.run(work(slowness), folder, Progress(quiet=True))
        folder.compact(found)
    np.testing.assert_array_equal(found["run"], np.arange(N))
    assert (found["status"] != "crashed").all()
    return found


if __name__ == "__main__":
    complete(Path(sys.argv[1]), 2, SLOWNESS)
