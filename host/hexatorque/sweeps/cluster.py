"""The runs of a study on a Dask cluster. Library: distributed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from .errors import StudyError
from .workers import Died

#: A scheduler answers within this time.
ANSWER_S = 8.0
#: A cluster may be without any worker for this long.
WITHOUT_S = 60.0
#: Most runs a task: handing a task over takes a tenth of a run.
MOST_RUNS = 8
#: So many tasks a thread are under way or wait there.
TASKS = 2
#: The number of threads is asked for this often.
COUNT_S = 2.0
#: A task may wait for another one, and a worker that died costs its time again.
PATIENCE, GRACE_S = 3.0, 30.0


def _ask(address: str) -> None:
    """Raises OSError if no scheduler answers. A client of Dask would wait for ever where somebody
    listens and says nothing."""
    from distributed import Security
    from distributed.core import rpc

    async def identity() -> None:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as there:
            await asyncio.wait_for(there.identity(), ANSWER_S)

    with ThreadPoolExecutor(1) as apart:  # a notebook has a loop of its own in this thread
        apart.submit(asyncio.run, identity()).result()


class Cluster:
    """A Dask cluster. scheduler: its address, or a cluster object, for example of dask-jobqueue;
    runs: of the study."""

    def __init__(self, scheduler: Any, runs: int) -> None:
        try:
            import distributed
        except ImportError:
            raise StudyError(
                "--scheduler needs Dask, which is not installed: pip install 'hexatorque[cluster]'"
            ) from None
        self._killed = distributed.KilledWorker
        self._name = scheduler if isinstance(scheduler, str) else type(scheduler).__name__
        self._log = logging.getLogger("distributed")
        self._level = self._log.level
        self._log.setLevel(logging.CRITICAL)  # what it says is for who runs the cluster
        try:
            if isinstance(scheduler, str):
                _ask(scheduler)
            self._client = distributed.Client(
                scheduler, timeout=ANSWER_S, set_as_default=False, name="hexatorque"
            )
        except (OSError, ValueError, TypeError, ImportError) as error:
            self._log.setLevel(self._level)
            silent = isinstance(error, OSError)  # TimeoutError is one
            why = "does not answer" if silent else " ".join(str(error).split())
            raise StudyError(f"scheduler {self._name}: {why}") from None
        self._executor = self._client.get_executor(pure=False)
        self._given_s: dict[Future, float] = {}
        self._counted_s, self._threads = -COUNT_S, 0
        self._worked_s = time.monotonic()
        try:
            self.look()
            if isinstance(scheduler, str):
                self._wait_for_one()
        except BaseException:
            self.close()
            raise
        self.batch = min(MOST_RUNS, max(1, runs // (4 * TASKS * max(1, self._threads))))

    def _wait_for_one(self) -> None:
        while not self._threads:
            if time.monotonic() - self._worked_s > ANSWER_S:
                raise StudyError(f"scheduler {self._name}: it has no workers")
            time.sleep(0.2)
            self._counted_s = -COUNT_S
            self.look()

    @property
    def slots(self) -> int:
        return max(1, TASKS * self._threads)

    def look(self) -> None:
        """Raises StudyError if the cluster has gone."""
        now_s = time.monotonic()
        if now_s - self._counted_s < COUNT_S:
            return
        try:
            threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=ANSWER_S)
        except Exception:  # each kind of connection has its own errors
            raise StudyError(f"scheduler {self._name}: does not answer any more") from None
        self._counted_s, self._threads = now_s, sum(threads.values())
        if self._threads:
            self._worked_s = now_s
        elif now_s - self._worked_s > WITHOUT_S and self._given_s:
            raise StudyError(f"scheduler {self._name}: no workers for {WITHOUT_S:g} s")

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        future = self._executor.submit(function, *arguments)
        self._given_s[future] = time.monotonic()
        return future

    def result(self, future: Future) -> Any:
        self._given_s.pop(future, None)
        try:
            return future.result()
        except self._killed:  # Dask has tried other workers already
            raise Died(True) from None

    def overdue(self, future: Future, limit_s: float) -> bool:
        return time.monotonic() > self._given_s[future] + PATIENCE * limit_s + GRACE_S

    def abandon(self, future: Future) -> None:
        self._given_s.pop(future, None)
        future.cancel()

    def close(self) -> None:
        with contextlib.suppress(Exception):  # it may have gone
            self._executor.shutdown(wait=False, cancel_futures=True)
        with contextlib.suppress(Exception):
            self._client.close(timeout=ANSWER_S)
        self._log.setLevel(self._level)
