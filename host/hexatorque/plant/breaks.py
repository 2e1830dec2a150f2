"""Breaks of the inverter's legs that are to come; `inverter.push_breaks` makes edges of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .legs import BOUNCE, KINDS

#: When it comes, in seconds, and what becomes of the leg (`legs.KINDS`).
Break = tuple[float, str]


def breaks_of(kind: str, begin_s: float, bounce_s: float) -> list[Break]:
    """A contact that opens closes and opens twice more while it bounces (`legs.BOUNCE`)."""
    bounces = BOUNCE if kind == "open" and bounce_s > 0 else ()
    return [(begin_s, kind), *((begin_s + share * bounce_s, then) for share, then in bounces)]


def _schedule(inv: np.record, row: int, counts: int, period: int, timing: np.record) -> None:
    """Let the break in this row of the list come in so many counts; `period` begins now."""
    periods, count = divmod(counts, int(timing.period))
    inv.due_period[row] = period + periods
    inv.due_count[row] = count


def add(inv: np.record, leg: int, breaks: Iterable[Break], period: int, timing: np.record) -> None:
    for due_s, kind in breaks:
        _schedule(inv, inv.due, round(due_s * timing.clock_Hz), period, timing)
        inv.due_leg[inv.due] = leg
        inv.due_kind[inv.due] = KINDS.index(kind)
        inv.due += 1


def new_period(inv: np.record, period: int, timing: np.record, counts: int) -> None:
    """From now on a period has so many counts. The breaks come when they would have come."""
    to_come = (inv.due_period - period) * timing.period + inv.due_count
    timing.period = counts
    for row in range(inv.due):
        _schedule(inv, row, int(to_come[row]), period, timing)
