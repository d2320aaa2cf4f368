"""Where runs are done: processes of this machine, or a cluster."""

import contextlib
import os
from collections.abc import Iterator

import joblib

Workers = int | str
"""Processes of this machine (-1: one a core, two at least), or the address of a dask scheduler
(``tcp://...``, or ``local`` for a cluster of this machine's own)."""


@contextlib.contextmanager
def at_work(workers: Workers) -> Iterator[None]:
    """Let the runner use processes of this machine, or a cluster.

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
