"""The board's tick against this computer's clock: when a sample was taken, and how well that
is known.

A reply tells the board's tick at an instant between the request and the reply. From there
the tick counts `f_isr_Hz` a second, as far as its oscillator keeps time.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from ..recording.recording import STARTED, clock_text
from .client import Client
from .wire import Op

#: Key of the metadata: how far `started` may be wrong, either way.
UNCERTAINTY = "started_uncertainty_s"
#: A crystal's error, with room for its temperature.
OSCILLATOR = 100e-6
#: Error of a board's pace that no crystal has: a virtual board that was held up or is fast.
NO_CRYSTAL = 1e-3
#: `started` is told in whole milliseconds.
ROUNDING_S = 0.0005
TRIES = 4


@dataclass(frozen=True)
class Reading:
    """The board had `tick` at `wall_s` (since 1970), give or take `within_s`."""

    tick: int
    wall_s: float
    within_s: float


def read(client: Client, tries: int = TRIES) -> Reading:
    """The reply that took the least time."""
    best: Reading | None = None
    for _ in range(tries):
        asked_s = time.monotonic()
        tick = client.do(Op.STATUS).tick
        took_s = time.monotonic() - asked_s
        if best is None or took_s / 2 < best.within_s:
            best = Reading(tick, time.time() - took_s / 2, took_s / 2)
    assert best
    return best


def after(tick: int, before: int) -> int:
    """Ticks from one to the other, either way round the counter's end."""
    return (tick - before + 2**31) % 2**32 - 2**31


class Clock:
    """`earlier`: another reading since which the board has counted on at this rate; it shows
    whether the board keeps time at all."""

    def __init__(self, f_isr_Hz: float, now: Reading, earlier: Reading | None = None) -> None:
        self._f_isr_Hz, self._now = f_isr_Hz, now
        self._slip_s = 0.0
        if earlier:
            passed_s = now.wall_s - earlier.wall_s
            slip_s = abs(after(now.tick, earlier.tick) / f_isr_Hz - passed_s)
            if slip_s > NO_CRYSTAL * passed_s + now.within_s + earlier.within_s:
                self._slip_s = slip_s

    def when(self, tick: int, time_s: float = 0.0) -> dict:
        """Metadata: the wall-clock time of time 0, where `tick` is at `time_s`."""
        age_s = after(self._now.tick, tick) / self._f_isr_Hz + time_s
        within_s = self._now.within_s + OSCILLATOR * abs(age_s) + self._slip_s + ROUNDING_S
        return {
            STARTED: clock_text(self._now.wall_s - age_s),
            UNCERTAINTY: float(f"{within_s:.2g}"),
        }
