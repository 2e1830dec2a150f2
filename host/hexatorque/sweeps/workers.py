"""Who computes the runs: processes here, any executor, or a Dask cluster.

All of them are used through `concurrent.futures`. Their own part is to end a run that hangs: a
future that runs cannot be cancelled.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from types import ModuleType
from typing import Any, Protocol

from .. import system
from .errors import StudyError

#: A process that is this much over its time limit is killed: it does not look at the time itself.
GRACE_S = 10.0
#: A task has so many runs that it takes about this long: handing it over takes one or two
#: milliseconds of it, whatever is in it.
TASK_S, MOST_RUNS = 0.15, 8
#: Imported by the server from which the workers are forked.
LOADED_ONCE = "hexatorque.sweeps.warm"
_STARTING = threading.Lock()


class Died(Exception):
    """The process of a task has ended without a result. The argument: whether it has been tried
    often enough."""


class Workers(Protocol):
    """slots: how many tasks may be under way; batch: runs of the next task, so that handing it over
    takes little of its time."""

    batch: int

    @property
    def slots(self) -> int: ...

    def look(self) -> None:
        """Called all the time. Raises StudyError if the workers have gone."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future: ...

    def result(self, future: Future) -> Any:
        """The result of a future that is done. Raises Died."""

    def overdue(self, future: Future, limit_s: float) -> bool:
        """Whether a task, whose runs have this limit together, gives no answer any more."""

    def abandon(self, future: Future) -> None:
        """End the workers of an overdue task."""

    def close(self) -> None:
        """End the workers without waiting for the runs under way."""


# -- processes on this machine ---------------------------------------------------------------


@contextmanager
def _bare_start() -> Iterator[None]:
    """A process that starts in this block does not import the program's main file, which need not
    be protected by `if __name__ == "__main__"` then, and has one thread for linear algebra."""
    with _STARTING:
        main, before = sys.modules["__main__"], os.environ.get("OPENBLAS_NUM_THREADS")
        sys.modules["__main__"] = ModuleType("__main__")
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        try:
            yield
        finally:
            sys.modules["__main__"] = main
            if before is None:
                del os.environ["OPENBLAS_NUM_THREADS"]
            else:
                os.environ["OPENBLAS_NUM_THREADS"] = before


def _begin() -> None:
    """In a worker, before its first task: Ctrl-C is for the parent, and when the parent has gone,
    however it ended, so does the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def load_ahead() -> None:
    """Start the server from which the workers are forked, if it does not run yet. It loads the
    simulation, which takes more than a second, while the caller reads and checks its study."""
    system.worker_context(LOADED_ONCE)
    with _bare_start():
        system.prepare_workers()


class _Process:
    """One worker: a pool of one process, so that its death concerns one task."""

    def __init__(self) -> None:
        context = system.worker_context(LOADED_ONCE)
        self.ready_s: float | None = None
        self._pool = ProcessPoolExecutor(1, context, _begin)
        with _bare_start():
            self._pid = self._pool.submit(os.getpid)
        self._pid.add_done_callback(self._ready)

    def _ready(self, pid: Future) -> None:
        if not pid.cancelled() and pid.exception() is None:
            self.ready_s = time.monotonic()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        return self._pool.submit(function, *arguments)

    def end(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
        if self.ready_s is not None:
            system.kill(self._pid.result())


class Processes:
    """So many processes on this machine. One that dies or hangs is replaced."""

    def __init__(self, jobs: int | None = None) -> None:
        self.slots = jobs or system.usable_cores()
        self.batch = 1
        self._idle: list[_Process] = []
        self._busy: dict[Future, tuple[_Process, float]] = {}

    def look(self) -> None:
        """They cannot go as a whole."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        process = self._idle.pop() if self._idle else _Process()
        try:
            future = process.submit(function, *arguments)
        except BrokenProcessPool:  # it died while it was idle
            process.end()
            process = _Process()
            future = process.submit(function, *arguments)
        self._busy[future] = (process, time.monotonic())
        return future

    def result(self, future: Future) -> Any:
        process, given_s = self._busy.pop(future)
        try:
            found = future.result()
        except BrokenProcessPool:
            process.end()
            if process.ready_s is None:
                raise StudyError(
                    "the worker processes do not start: try `hexatorque run` first"
                ) from None
            raise Died(False) from None
        except BaseException:
            process.end()
            raise
        self._idle.append(process)
        if process.ready_s is not None:
            runs = len(found) if isinstance(found, list) else 1
            run_s = (time.monotonic() - max(given_s, process.ready_s)) / max(1, runs)
            self.batch = max(1, min(MOST_RUNS, int(TASK_S / run_s)))
        return found

    def overdue(self, future: Future, limit_s: float) -> bool:
        process, given_s = self._busy[future]
        if process.ready_s is None:
            return False
        return time.monotonic() > max(given_s, process.ready_s) + limit_s + GRACE_S

    def abandon(self, future: Future) -> None:
        self._busy.pop(future)[0].end()

    def close(self) -> None:
        for process in [*self._idle, *(process for process, _ in self._busy.values())]:
            process.end()
        self._idle, self._busy = [], {}


# -- an executor of the caller ---------------------------------------------------------------


class Given:
    """An executor that the caller has made and closes. If it breaks, the study ends."""

    batch = 1

    def __init__(self, executor: Executor, jobs: int | None = None) -> None:
        self._executor = executor
        # Two tasks a worker, so that none waits for the next one.
        self.slots = 2 * (jobs or getattr(executor, "_max_workers", None) or system.usable_cores())

    def look(self) -> None:
        """An executor that has broken says so in its futures."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        return self._executor.submit(function, *arguments)

    def result(self, future: Future) -> Any:
        return future.result()

    def overdue(self, future: Future, limit_s: float) -> bool:
        return False

    def abandon(self, future: Future) -> None:
        future.cancel()

    def close(self) -> None:
        pass
