"""Compiling the simulation takes up to a minute the first time, and again when the source of
the plant has changed; then it comes from a cache on disk. Who waits for it is told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.event import Listener, register, unregister

from ..plant import loop

_KIND = "numba:compile"


class _Watch(Listener):
    """Told by numba when it begins to compile a function, and when that is done."""

    def __init__(self, begun: Callable[[], None], done: Callable[[], None]) -> None:
        self._begun, self._done = begun, done

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"] is loop.run_periods:
            self._begun()

    def on_end(self, event: Any) -> None:
        if event.data["dispatcher"] is loop.run_periods:
            self._done()


@contextmanager
def watched(begun: Callable[[], None], done: Callable[[], None]) -> Iterator[None]:
    """Both are called if the simulation has to be compiled in this block, and not if it comes
    from the cache."""
    watch = _Watch(begun, done)
    register(_KIND, watch)
    try:
        yield
    finally:
        unregister(_KIND, watch)


def compile_now() -> None:
    """Compile the simulation or load it from the cache; both happen once in a process."""
    from .. import setups
    from .simulated import SimulatedDrive

    SimulatedDrive(setups.load("paper-a-feasible"))
