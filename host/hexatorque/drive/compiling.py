"""Compiling the simulation, with a message for the user who waits for it.

The first compilation takes up to a minute. After that the result comes from a cache on disk
until the plant's source changes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.event import Listener, register, unregister

from ..plant import loop

#: What the user reads meanwhile.
COMPILING = "compiling the simulation: once, for up to a minute ..."
_KIND = "numba:compile"
#: Those that watch now and tell the user in their own way.
_watches: list[Listener] = []


class _Watch(Listener):
    """Numba calls this when it begins to compile a function, and when it has finished."""

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
    """In this block, `begun` and `done` are called when the simulation is compiled. They are not
    called when it comes from the cache."""
    watch = _Watch(begun, done)
    _watches.append(watch)
    register(_KIND, watch)
    try:
        yield
    finally:
        unregister(_KIND, watch)
        _watches.remove(watch)


@contextmanager
def told() -> Iterator[None]:
    """In this block, a line on standard error says that the simulation is compiled, if nobody
    watches."""

    def tell() -> None:
        if not _watches:
            print(COMPILING, file=sys.stderr, flush=True)

    teller = _Watch(tell, lambda: None)
    register(_KIND, teller)
    try:
        yield
    finally:
        unregister(_KIND, teller)
