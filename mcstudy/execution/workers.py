"""Workers: processes of this machine, or a cluster."""

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

import joblib

Item = TypeVar("Item")
Result = TypeVar("Result")

Workers = int | str
"""Processes of this machine (-1: one a core, at least two), or the address of a dask scheduler
(``tcp://...``, or ``local`` for a cluster of this machine's own)."""


@contextlib.contextmanager
def parallel_backend(workers: Workers) -> Iterator[None]:
    """Let evaluators use processes of this machine, or a cluster.

    Parameters
    ----------
    workers : int or str
        Processes, -1 for one a core, or the address of a dask scheduler.

    Raises
    ------
    UserError
        If the cluster's extra is not installed, or no scheduler or worker answers.
    """
    if isinstance(workers, str):
        # Imported late: it takes half a second, and only clusters need it.
        from mcstudy.execution.cluster import on_cluster

        with on_cluster(workers):
            yield
        return
    # A user's file in the working folder, such as signal.py, must not shadow a module.
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    # With a single process joblib runs in the driver, which a crash would end.
    n_jobs = max(2, os.cpu_count() or 1) if workers == -1 else workers
    with joblib.parallel_config(backend="loky", n_jobs=n_jobs):
        yield


def run_jobs(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> list[Result]:
    """Return the results of a function for each item, in order, computed in parallel.

    For fits and trials; rows of a model are run by an ``Evaluator``.

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


def stream_jobs(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> Iterator[Result]:
    """Yield the results of a function for each item as they come, computed in parallel.

    Parameters
    ----------
    function : callable
        Top-level function of one item.
    items : iterable
    workers : int
        Processes, -1 for one a core.
    """
    with parallel_backend(workers):
        pool = joblib.Parallel(return_as="generator_unordered")
        yield from pool(joblib.delayed(function)(item) for item in items)
