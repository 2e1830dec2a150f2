"""Hands the runs of a study to workers, and takes their rows as they come."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass
from itertools import islice

from ..errors import HexatorqueError
from . import work as working
from .errors import StudyError
from .space import Case
from .work import Row, Work
from .workers import Died, Workers

#: The workers are looked at this often.
LOOK_S = 0.5
#: A run whose process died is tried that many times: it may have been chance.
TRIES = 2


@dataclass(frozen=True)
class _Task:
    cases: tuple[Case, ...]
    tries: int = 1


def rows(work: Work, cases: Iterable[Case], workers: Workers) -> Iterator[Row]:
    """The row of every case, in any order. Raises StudyError if the study cannot go on. The workers
    are closed at the end, also if the caller takes no more rows."""
    left, again = iter(cases), deque[_Task]()
    busy: dict[Future, _Task] = {}

    def next_task() -> _Task | None:
        if again:
            return again.popleft()
        batch = tuple(islice(left, workers.batch))
        return _Task(batch) if batch else None

    try:
        while True:
            workers.look()
            while len(busy) < workers.slots and (task := next_task()):
                busy[workers.submit(working.do, work, task.cases)] = task
            if not busy:
                return
            done, _ = wait(busy, LOOK_S, FIRST_COMPLETED)
            for future in done:
                task = busy.pop(future)
                try:
                    found = _result(workers, future)
                except Died as died:
                    (enough,) = died.args
                    once_more = len(task.cases) > 1 or not (enough or task.tries >= TRIES)
                    more = _parts(task) if once_more else []
                    again.extend(more)
                    found = [] if more else [working.lost(work, task.cases[0], "its process died")]
                yield from found
            for future, task in list(busy.items()):
                if not workers.overdue(future, work.limit_s * len(task.cases)):
                    continue
                workers.abandon(future)
                del busy[future]
                if len(task.cases) > 1:
                    again.extend(_parts(task))
                else:
                    yield working.lost(work, task.cases[0], working.time_up(work))
    finally:
        workers.close()


def _parts(task: _Task) -> list[_Task]:
    """The runs of a task that has failed as a whole, one by one."""
    tries = 1 if len(task.cases) > 1 else task.tries + 1
    return [_Task((case,), tries) for case in task.cases]


def _result(workers: Workers, future: Future) -> list[Row]:
    try:
        return workers.result(future)
    except (Died, HexatorqueError):
        raise
    except (BrokenExecutor, CancelledError) as error:
        raise StudyError(f"the workers have gone ({type(error).__name__})") from None
    except Exception as error:  # not of a run, but on the way to it
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise StudyError(f"a worker cannot take part: {text}") from None
