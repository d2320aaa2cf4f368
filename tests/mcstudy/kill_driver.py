"""A study of the toy evaluation, run in a process of its own that is there to be killed."""

import sys
from pathlib import Path

import joblib
import numpy as np
import toy_evaluation

from mcstudy.execution import runner
from mcstudy.execution.evaluator import CHUNK_TIME, Evaluator
from mcstudy.execution.progress import Progress
from mcstudy.execution.results import ResultsFolder
from mcstudy.sampling import designs

N = 400
SLOWNESS = 0.006
"""s a row: the study takes about as long as its processes take to start."""


def work(chunk_time: float = CHUNK_TIME) -> runner.Task:
    """Return the study, in chunks of some s."""
    return runner.Task(
        evaluator=Evaluator(
            toy_evaluation.evaluate_slowly, SLOWNESS, toy_evaluation.OUTPUTS, chunk_time=chunk_time
        ),
        inputs=designs.draw("latin-hypercube", N, 20, 2, seed=5),
        input_names=toy_evaluation.NAMES,
        replicate=np.arange(N) // 20,
    )


def main(path: Path, workers: int) -> None:
    """Run the study, or go on with it."""
    folder = ResultsFolder(path)
    with folder.open_for_writing(), joblib.parallel_config(backend="loky", n_jobs=workers):
        folder.compact(runner.run(work(0.05), folder, Progress(quiet=True)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
