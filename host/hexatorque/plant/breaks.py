"""Breaks of the inverter's legs that are to come. They become edges when their time is there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .compiled import compiled
from .legs import BOUNCE, BREAK, KINDS, MAX_BREAKS
from .pwm import push_edge

COMING = np.dtype(
    [
        ("n", "i8"),  # number of breaks to come:
        ("period", "i8", (MAX_BREAKS,)),  # their periods,
        ("count", "i8", (MAX_BREAKS,)),  # counts in them,
        ("leg", "i8", (MAX_BREAKS,)),  # legs,
        ("kind", "i8", (MAX_BREAKS,)),  # and what breaks
    ]
)

#: When it comes, in seconds, and what becomes of the leg (`legs.KINDS`).
Break = tuple[float, str]


def breaks_of(kind: str, begin_s: float, bounce_s: float) -> list[Break]:
    """A contact that opens closes and opens twice more while it bounces (`legs.BOUNCE`)."""
    bounces = BOUNCE if kind == "open" and bounce_s > 0 else ()
    return [(begin_s, kind), *((begin_s + share * bounce_s, then) for share, then in bounces)]


def _schedule(coming: np.record, row: int, counts: int, period: int, timing: np.record) -> None:
    """Let the break in this row of the list come in so many counts; `period` begins now."""
    periods, count = divmod(counts, int(timing.period))
    coming.period[row] = period + periods
    coming.count[row] = count


def add(
    coming: np.record, leg: int, breaks: Iterable[Break], period: int, timing: np.record
) -> None:
    for due_s, kind in breaks:
        _schedule(coming, coming.n, round(due_s * timing.clock_Hz), period, timing)
        coming.leg[coming.n] = leg
        coming.kind[coming.n] = KINDS.index(kind)
        coming.n += 1


def new_period(coming: np.record, period: int, timing: np.record, counts: int) -> None:
    """From now on a period has so many counts. The breaks come when they would have come."""
    to_come = (coming.period - period) * timing.period + coming.count
    timing.period = counts
    for row in range(coming.n):
        _schedule(coming, row, int(to_come[row]), period, timing)


@compiled
def push_breaks(coming, ps, period, c0, c1, n):
    """Add the breaks of this period's counts c0 <= count < c1 to the n edges, and forget them.
    Returns the new n."""
    left = 0
    for b in range(coming.n):
        count = coming.count[b]
        if coming.period[b] == period and c0 <= count and count < c1:
            n = push_edge(ps, n, count, coming.leg[b], BREAK + coming.kind[b])
        else:
            coming.period[left] = coming.period[b]
            coming.count[left] = count
            coming.leg[left] = coming.leg[b]
            coming.kind[left] = coming.kind[b]
            left += 1
    coming.n = left
    return n
