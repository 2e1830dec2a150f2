"""Waiting for what comes, on however busy a computer."""

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")

#: So long only because what does not come must end a test at last.
WAIT_S = 60.0


def until(condition: Callable[[], Found]) -> Found:
    """Wait until the condition is true. Returns its value."""
    end = time.monotonic() + WAIT_S
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {WAIT_S:g} s"
        time.sleep(0.01)
    return found
