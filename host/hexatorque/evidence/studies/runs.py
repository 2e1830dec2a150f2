"""The runs of a study that has hundreds of them: in processes, because much of a run holds Python's
lock, and each kept as soon as it is there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from typing import Any, TypeVar

from ...drive.interface import Progress
from ...sweeps.errors import StudyError
from ...sweeps.workers import Died, Processes
from .. import kept

A = TypeVar("A")
#: Of one item; it is told how to report simulated seconds. The result is plain data, for JSON.
Function = Callable[[A, Progress], Any]


def each(
    function: Function[A],
    items: Iterable[A],
    folder: Path | None = None,
    progress: Progress | None = None,
) -> list:
    """`function` of every item, in their order. folder: results are kept there, and those that an
    earlier study has left there are not computed again, unless the package has changed."""
    tasks = list(items)
    found: dict[int, Any] = {}
    places: dict[int, kept.Kept] = {}
    if folder is not None:
        kind = function.__module__.rpartition(".")[2]
        source = kept.digest(kept.EVERYTHING)
        for n, item in enumerate(tasks):
            places[n] = kept.Kept(folder, kind, source, function.__qualname__, item)
            there = places[n].load()
            if isinstance(there, list) and len(there) == 1:
                found[n] = there[0]
    missing = [n for n in range(len(tasks)) if n not in found]
    workers = Processes()
    busy: dict[Future, int] = {}
    try:
        while missing or busy:
            while missing and len(busy) < workers.slots:
                n = missing.pop(0)
                busy[workers.submit(_one, function, tasks[n])] = n
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                n = busy.pop(future)
                try:
                    text, simulated_s = workers.result(future)
                except Died:
                    raise StudyError(f"the process of a run died: {tasks[n]}") from None
                found[n] = json.loads(text)
                if n in places:
                    places[n].save([found[n]])
                if progress:
                    progress(simulated_s)
    finally:
        workers.close()
    return [found[n] for n in range(len(tasks))]


def _one(function: Function[A], item: A) -> tuple[str, float]:
    """In a worker: the result as a kept one is read, and the simulated seconds."""
    seconds = [0.0]

    def progress(simulated_s: float) -> None:
        seconds[0] += simulated_s

    return json.dumps(function(item, progress)), seconds[0]
