"""Where runs are done: processes of this machine, or a cluster."""

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

import joblib

Item = TypeVar("Item")
Result = TypeVar("Result")

Workers = int | str
"""Processes of this machine (-1: one a core, two at least), or the address of a dask scheduler
(``tcp://...``, or ``local`` for a cluster of this machine's own)."""


@contextlib.contextmanager
def parallel_backend(workers: Workers) -> Iterator[None]:
    """Let evaluators use processes of this machine, or a cluster.

    Parameters
    ----------
    workers : processes, -1 for one a core, or the address of a dask scheduler.

    Raises
    ------
    UserError
        If the cluster's extra is not installed, or no scheduler or worker answers.
    """
    if isinstance(workers, str):
        # Half a second of imports that only a study on a cluster needs.
        from mcstudy.execution.cluster import on_cluster

        with on_cluster(workers):
            yield
        return
    # A file of the user's own in the working folder, such as signal.py, is no module of ours.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    # With a single process joblib runs it all here, where a crash takes the driver along.
    n_jobs = max(2, os.cpu_count() or 1) if workers == -1 else workers
    with joblib.parallel_config(backend="loky", n_jobs=n_jobs):
        yield


def run_jobs(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> list[Result]:
    """Return what a function gives for each item, in their order, by processes of this machine.

    For work that is no row of a model: fits, trials. Rows go through an ``Evaluator``.

    Parameters
    ----------
    function : callable
        Top-level function of one item.
    items : iterable
    workers : int
        Processes, -1 for one a core.
    """
    with parallel_backend(workers):
        found: list[Result] = joblib.Parallel()(joblib.delayed(function)(item) for item in items)
    return found
