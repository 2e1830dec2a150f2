"""The board's tick and this computer's clock: when a sample was taken, and how exactly that is
known.

A reply contains the board's tick at an instant between the request and the reply. From then on
the tick counts `f_isr_Hz` per second, as exactly as the board's oscillator runs.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from ..recording.recording import STARTED, clock_text
from .client import Client
from .wire import Op

#: Key of the metadata: the uncertainty of `started`, plus or minus, in s.
UNCERTAINTY = "started_uncertainty_s"
#: Largest relative error of a crystal, over its range of temperature.
OSCILLATOR = 100e-6
#: A relative error above this is not a crystal's: a virtual board runs too slowly or too fast.
NO_CRYSTAL = 1e-3
#: `started` is written in whole milliseconds.
ROUNDING_S = 0.0005
TRIES = 4


@dataclass(frozen=True)
class Reading:
    """The board's tick was `tick` at `wall_s` (s since 1970), plus or minus `within_s`."""

    tick: int
    wall_s: float
    within_s: float


def read(client: Client, tries: int = TRIES) -> Reading:
    """Read the tick several times. The reading with the fastest reply is returned."""
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
    """Ticks from `before` to `tick`, negative if `tick` is earlier. The counter may wrap."""
    return (tick - before + 2**31) % 2**32 - 2**31


class Clock:
    """now: the reading from which times are computed; earlier: an older reading at the same rate,
    which shows whether the board's clock runs at the stated rate."""

    def __init__(self, f_isr_Hz: float, now: Reading, earlier: Reading | None = None) -> None:
        self._f_isr_Hz, self._now = f_isr_Hz, now
        self._slip_s = 0.0
        if earlier:
            passed_s = now.wall_s - earlier.wall_s
            slip_s = abs(after(now.tick, earlier.tick) / f_isr_Hz - passed_s)
            if slip_s > NO_CRYSTAL * passed_s + now.within_s + earlier.within_s:
                self._slip_s = slip_s

    def when(self, tick: int, time_s: float = 0.0) -> dict:
        """Metadata with the wall-clock time of time 0, if `tick` is at `time_s`."""
        age_s = after(self._now.tick, tick) / self._f_isr_Hz + time_s
        within_s = self._now.within_s + OSCILLATOR * abs(age_s) + self._slip_s + ROUNDING_S
        return {
            STARTED: clock_text(self._now.wall_s - age_s),
            UNCERTAINTY: float(f"{within_s:.2g}"),
        }
