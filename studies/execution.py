"""What every sampled study shares: its model, its runs in parallel, its manifest."""

import os
import platform
import time
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import joblib
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mcstudy import config, runner
from mcstudy.config import SampledStudy, Study
from mcstudy.errors import UserError
from mcstudy.progress import Progress
from mcstudy.results import ResultsFolder, check_failures, digest
from models.protocol import Model, complete_status
from models.registry import load_model
from studies import evaluation

PACKAGES = ("numpy", "scipy", "numba", "pandas", "joblib", "pyarrow")


def load_study_model(study: Study) -> Model:
    """Return the model of a study.

    Raises
    ------
    UserError
        If the model or an option is unknown.
    """
    try:
        return load_model(study.model.name, study.model.options)
    except (ValueError, TypeError) as error:
        raise UserError(f"model: {error}") from None


def run_rows(
    study: SampledStudy,
    model: Model,
    columns: Mapping[str, NDArray[np.float64]],
    folder: ResultsFolder,
    *,
    design: Mapping[str, Any],
    replicate: NDArray[np.int64],
    workers: int,
    quiet: bool,
) -> pd.DataFrame:
    """Run what is missing of a design, keep it, write the manifest and return all its runs.

    Parameters
    ----------
    study, model : of the folder, which is open for writing.
    columns : (n,) values of every input of the model.
    design : what the manifest says of the design. replicate : (n,) of each row.
    workers : processes, -1 for one a core. quiet : no progress line.

    Raises
    ------
    StudyError
        If too many runs failed, or the workers are lost.
    """
    rows = np.stack([columns[item.name] for item in model.inputs], axis=1)
    task = runner.Task(
        evaluate=evaluation.evaluate,
        argument={
            "name": study.model.name,
            "options": study.model.options,
            "version": model.version,
        },
        inputs=rows,
        input_names=[item.name for item in model.inputs],
        output_names=[item.name for item in model.outputs],
        replicate=replicate,
    )
    complete = complete_status(model)
    manifest = _manifest(study, model, config.numbers_digest(study, model), design, workers)
    if not (folder.path / "manifest.json").exists():
        folder.write_json("manifest.json", manifest)
    start = time.perf_counter()
    with joblib.parallel_config(backend="loky", n_jobs=workers):
        runs = runner.run(task, folder, Progress(quiet=quiet, complete=complete))
    # A study that was larger before keeps its further runs.
    folder.compact(held if (held := folder.done()) is not None else runs)
    counts = {str(k): int(v) for k, v in runs["status"].value_counts().items()}
    manifest |= {
        "wall_time_s": round(time.perf_counter() - start, 3),
        "counts": counts,
        "digest": digest(runs),
        "finished": True,
    }
    folder.write_json("manifest.json", manifest)
    check_failures(counts, set(counts) - complete, study.max_failure_rate)
    return runs


def _manifest(
    study: SampledStudy,
    model: Model,
    topics: Mapping[str, str],
    design: Mapping[str, Any],
    workers: int,
) -> dict[str, Any]:
    return {
        "format": "mcstudy-results/1",
        "study": study.name,
        "kind": study.kind,
        "seed": study.seed,
        "model": {"name": model.name, "version": model.version, "options": study.model.options},
        "design": dict(design),
        "numbers": dict(topics),
        "hash": config.hash_of(dict(topics)),
        "versions": {"mcstudy": version("mcstudy"), "python": platform.python_version()}
        | {name: version(name) for name in PACKAGES},
        "machine": {"system": platform.system(), "processor": platform.machine(),
                    "cores": os.cpu_count()},
        "workers": workers,
        "finished": False,
    }  # fmt: skip
