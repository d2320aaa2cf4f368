"""Runs on a dask.distributed cluster.

joblib's own dask backend (1.6) waits for ever when a worker is lost: it notes the error on the
future and never calls back. The backend here calls back with the loss, and the runner handles it.
It relies on private names of joblib, which it checks. Importing this module imports dask.
"""

import asyncio
import contextlib
import logging
import os
import time
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import joblib
from joblib import _dask

from mcstudy.errors import UserError
from mcstudy.execution.evaluator import LostChunk

CONNECT_TIME = 20.0
"""s in which a scheduler and a first worker must answer."""
GRACE = 20.0
"""s without any worker after which a cluster counts as lost."""
_PRIVATE = ("_collect", "_results", "_callbacks", "waiting_futures", "retrieve_result_callback")


class _Lost:
    """Callback value of a future without a result."""

    def __init__(self, reason: str) -> None:
        self.reason = reason


class ClusterBackend(_dask.DaskDistributedBackend):  # type: ignore[misc]
    """joblib's dask backend, extended to return lost chunks."""

    is_remote = True

    def effective_n_jobs(self, n_jobs: int) -> int:
        """Return the cores of the cluster, at least two: with one joblib would run locally."""
        return max(2, int(sum(self.client.ncores().values())))

    def start_call(self) -> None:
        """Start to collect results and to monitor the workers."""
        super().start_call()
        self.client.loop.add_callback(self._watch)

    async def _watch(self) -> None:
        seen = time.monotonic()
        while self._continue:
            if await self.client.scheduler.ncores():
                seen = time.monotonic()
            elif time.monotonic() - seen > GRACE:
                for future in list(self._results):
                    self._call_back(future, _Lost(LostChunk.NO_WORKERS))
            await asyncio.sleep(0.5)

    async def _collect(self) -> None:
        while self._continue:
            async for future, result in self.waiting_futures:
                if future.status == "finished":
                    self._call_back(future, result)
                else:
                    reason = result[1] if isinstance(result, tuple) else future.status
                    self._call_back(future, _Lost(" ".join(str(reason).split())[:200]))
            await asyncio.sleep(0.01)

    def _call_back(self, future: Any, result: Any) -> None:
        if future in self._results:
            self._results.pop(future).set_result(result)
            self._callbacks.pop(future)(result)

    def retrieve_result_callback(self, out: Any) -> Any:
        """Return the results of a task, or the record of its loss."""
        if isinstance(out, _Lost):
            return [LostChunk(out.reason)]
        return super().retrieve_result_callback(out)

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        return (ClusterBackend, ())


@contextlib.contextmanager
def on_cluster(address: str) -> Iterator[None]:
    """Let the runner use the cluster of a scheduler.

    Raises
    ------
    UserError
        If the cluster's extra is not installed, or no scheduler or worker answers.
    """
    with _client(address) as client, joblib.parallel_config(backend=ClusterBackend(client=client)):
        yield


@contextlib.contextmanager
def _client(address: str) -> Iterator[Any]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise UserError(
            "--cluster: needs dask.distributed; install it with pip install 'mcstudy[cluster]'"
        ) from None
    missing = [name for name in _PRIVATE if name not in _names_of(_dask.DaskDistributedBackend)]
    if missing:
        raise UserError(
            f"--cluster: joblib {joblib.__version__} has another dask backend than this program "
            f"knows ({missing[0]} is missing); install joblib 1.6"
        )
    with contextlib.ExitStack() as stack:
        target: Any = address
        if address == "local":
            target = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=max(2, os.cpu_count() or 1), threads_per_worker=1,
                    dashboard_address=None,
                )
            )  # fmt: skip
        try:
            client = stack.enter_context(distributed.Client(target, timeout=CONNECT_TIME))
            client.wait_for_workers(1, timeout=CONNECT_TIME)
        except (OSError, TimeoutError, ValueError) as error:
            detail = " ".join(str(error).split())[:120]
            raise UserError(
                f"--cluster {address}: no scheduler with workers answers ({detail})"
            ) from None
        # A chunk that kills its worker must not kill three more: the runner does the retries.
        client.run_on_scheduler(_no_retries)
        try:
            yield client
        finally:
            # Log messages of the shutdown are suppressed.
            logging.getLogger("distributed").setLevel(logging.CRITICAL)
            logging.getLogger("asyncio").setLevel(logging.CRITICAL)


def _no_retries(dask_scheduler: Any) -> None:
    dask_scheduler.allowed_failures = 0


def _names_of(backend: Any) -> set[str]:
    """Return the names of a class and of the attributes that its constructor sets."""
    return {*dir(backend), *backend.__init__.__code__.co_names}
