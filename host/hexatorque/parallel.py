"""Work on all cores of this computer, in threads: the compiled simulation releases the GIL.

Studies (`sweeps`) have processes, because a run that hangs or dies must not end the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .system import usable_cores

A = TypeVar("A")
B = TypeVar("B")


def in_order(
    function: Callable[[A], B], items: Iterable[A], jobs: int | None = None, wait: bool = True
) -> Iterator[B]:
    """`function` of every item, in their order, each as soon as it and those before it are there.
    After an exception or an interrupt no further item is started; wait: those under way end
    first."""
    pool = ThreadPoolExecutor(jobs or usable_cores())
    try:
        yield from pool.map(function, items)
    finally:
        pool.shutdown(wait=wait, cancel_futures=True)


def each(function: Callable[[A], B], items: Iterable[A], jobs: int | None = None) -> list[B]:
    return list(in_order(function, items, jobs))
