"""A recording of columns whose names, units and times are another program's: of a text (`table`),
or of MATLAB's variables (`workspace`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from .formats import RecordingError
from .journal import TICK_HZ, fill
from .recording import DECIMATION, FIRST_TICK, Recording, check_names
from .table import MOST_LOST_ROWS, SLACK, si


class Source(Protocol):
    """headings: the name and the unit of each column."""

    headings: list[tuple[str, str]]

    def name(self, column: int) -> str:
        """The name of a column in messages."""

    def place(self, row: int) -> str:
        """Where a row stands, in messages."""


def recording(
    source: Source,
    columns: Sequence[np.ndarray | None],
    at: int | None,
    time_s: np.ndarray,
    notes: list[str],
) -> Recording:
    """columns: (n,) each, None without any number; at: the column that is the time, None if there
    is none; time_s: (n,), equally spaced but for rows that are missing; notes: what was assumed.
    RecordingError in one line."""
    rate_Hz, places = _raster(source, time_s)
    meta: dict = {}
    channels, units = {}, {}
    for n, ((name, unit), column) in enumerate(zip(source.headings, columns)):
        if n == at or (not name and (column is None or np.isnan(column).all())):
            continue
        if column is None:
            notes.append(f"{source.name(n)} holds no numbers: left out")
            continue
        if np.isinf(column).any():
            row = int(np.argmax(np.isinf(column)))
            raise RecordingError(f"{source.place(row)}, {source.name(n)}: not a finite number")
        name = name or source.name(n)
        if name == "tick":
            meta.update(_ticks(source, column, places, rate_Hz))
            continue
        if name in channels:
            raise RecordingError(f"two columns are named {name}")
        units[name], factor = si(unit)
        if factor != 1:
            column = column * factor
            notes.append(f"{name}: {unit} are made {units[name]}")
        channels[name] = fill(places, column)
    if not channels:
        raise RecordingError("no column beside the time holds numbers")
    check_names(channels)
    lost = np.isnan(np.array(list(channels.values()))).all(axis=0)
    meta["gaps"] = int(np.sum(np.diff(lost, prepend=False) & lost))
    meta["lost_samples"] = int(lost.sum())
    notes.append(f"{len(lost)} samples at {rate_Hz:.9g} Hz")
    return Recording(rate_Hz, channels, units, meta, float(time_s[0]), notes)


def _ticks(source: Source, column: np.ndarray, places: np.ndarray, rate_Hz: float) -> dict:
    """The metadata that follow from a column of ticks."""
    since = np.diff(column, prepend=column[0]) % 2**32
    step = float(np.sum(since)) / float(places[-1])
    wrong = ~((since == np.diff(places, prepend=0) * step) & (column % 1 == 0) & (step % 1 == 0))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise RecordingError(f"{source.place(row)}: tick and time_s do not fit together")
    return {FIRST_TICK: int(column[0]) % 2**32, DECIMATION: int(step), TICK_HZ: rate_Hz * step}


def _raster(source: Source, time_s: np.ndarray) -> tuple[float, np.ndarray]:
    """The samples per second, and the place of each row. The times must ascend in equal steps; a
    step may be a multiple where rows are missing. RecordingError otherwise."""
    if len(time_s) < 2:
        raise RecordingError("two rows or more are needed to know the time between samples")
    bad = np.flatnonzero(~np.isfinite(time_s))
    if len(bad):
        raise RecordingError(f"{source.place(int(bad[0]))}: no time")
    number = np.arange(len(time_s))
    span_s = float(time_s[-1] - time_s[0])
    step_s = span_s / number[-1]
    if span_s > 0 and np.all(abs(time_s - time_s[0] - number * step_s) <= SLACK * step_s):
        return _plain_rate(number[-1] / span_s, number[-1]), number
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    if step_s > 0:
        places = np.round(steps / step_s)
        wrong = (np.abs(steps - places * step_s) > SLACK * step_s) | (places < 1)
    else:
        wrong = steps <= 0
    if wrong.any():
        at = int(np.argmax(wrong))
        raise RecordingError(
            f"{source.place(at + 1)}: time goes from {time_s[at]:.9g} s to "
            f"{time_s[at + 1]:.9g} s, most steps are {step_s:.6g} s: equally spaced samples "
            "are needed"
        )
    if places.sum() - len(steps) > MOST_LOST_ROWS:
        raise RecordingError(
            f"{places.sum() - len(steps):.0f} rows are missing: too many to fill in"
        )
    places = np.concatenate([[0], np.cumsum(places.astype(np.int64))])
    return _plain_rate(places[-1] / span_s, int(places[-1])), places


def _plain_rate(rate_Hz: float, samples: int) -> float:
    """The rate, rounded to the fewest digits that change it by less than a millionth, and the
    times by less than a hundredth of a step."""
    for digits in range(1, 17):
        short = float(f"{rate_Hz:.{digits}g}")
        if abs(1 - short / rate_Hz) < min(1e-6, 0.01 / samples):
            return short
    return rate_Hz
