"""Journals: the files that are written while a board is recorded.

A journal (`NAME.npz.part`) has a line of JSON (`Stream.to_json`), a line of JSON with the
counters, padded with blanks to 256 bytes, and rows of fixed size, little-endian: u32 tick,
float32 values. If writing was interrupted, the file is good up to its last complete row.

The time axis is the tick: the drive's count of fast interrupts, modulo 2**32.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from .formats import RecordingError
from .recording import DECIMATION, FIRST_TICK, Recording, check_names, to_json

FORMAT = "hexatorque-journal-1"
COUNTERS_LINE = 256  #: bytes with the end of the line; the line is overwritten in place
LONGEST_HEADER = 1 << 24
#: Largest product of lost samples and channels that is filled with NaN: 400 MB.
MOST_LOST_VALUES = 10**8
#: The counters of a recording for which nothing was counted.
COUNTERS = {"drops": 0, "crc_errors": 0, "damaged_samples": 0}
#: Key of the metadata: fast interrupts per second.
TICK_HZ = "tick_Hz"


@dataclass(frozen=True)
class Stream:
    """The description of a stream of samples.

    channels: (name, unit) each; tick_Hz: ticks per second; decimation: ticks from one
    sample to the next; start_s: time of the first sample; meta: the recording's metadata.
    """

    channels: tuple[tuple[str, str], ...]
    tick_Hz: float
    decimation: int = 1
    start_s: float = 0.0
    meta: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [name for name, _ in self.channels]
        check_names(names)
        if len(set(names)) != len(names) or not names:
            raise RecordingError("a stream needs channels, each of another name")
        if not (np.isfinite([self.tick_Hz, self.start_s]).all() and self.tick_Hz > 0):
            raise RecordingError(f"{self.tick_Hz} ticks per second from {self.start_s} s on")
        if not 1 <= self.decimation < 2**31 or self.decimation != int(self.decimation):
            raise RecordingError(f"decimation {self.decimation}: a whole number from 1 on")

    @property
    def rate_Hz(self) -> float:
        return self.tick_Hz / self.decimation

    @property
    def row(self) -> np.dtype:
        return np.dtype([("tick", "<u4"), ("values", "<f4", (len(self.channels),))])

    def to_json(self) -> dict:
        return {"format": FORMAT, **vars(self)}

    @staticmethod
    def from_json(data: dict) -> Stream:
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']!r}")
        channels = tuple((str(name), str(unit)) for name, unit in data["channels"])
        if not isinstance(data["meta"], dict):
            raise ValueError("metadata of another form")
        return Stream(
            channels, float(data["tick_Hz"]), data["decimation"], float(data["start_s"]),
            data["meta"],
        )  # fmt: skip


def head(stream: Stream, counters: dict) -> bytes:
    """The two lines before the rows."""
    return to_json(stream.to_json()).encode() + b"\n" + counters_line(counters)


def counters_line(counters: dict) -> bytes:
    return to_json(counters).encode().ljust(COUNTERS_LINE - 1)[: COUNTERS_LINE - 1] + b"\n"


def read(file: BinaryIO) -> tuple[Stream, np.ndarray, dict]:
    """The stream, the rows and the counters of an open journal. The rows stay in the file: a
    recording of hours may be larger than the memory."""
    file.seek(0)
    stream = Stream.from_json(json.loads(file.readline(LONGEST_HEADER)))
    line = file.read(COUNTERS_LINE)
    try:
        counters = json.loads(line)
    except ValueError:  # writing this line was interrupted: the rows are still good
        counters = {}
    begin = file.tell()
    n = (file.seek(0, 2) - begin) // stream.row.itemsize
    rows = np.memmap(file, stream.row, "r", begin, (n,)) if n else np.zeros(0, stream.row)
    return stream, rows, counters


def load(path: Path) -> Recording:
    """The recording in a journal that was not closed."""
    with path.open("rb") as file:
        stream, rows, counters = read(file)
        rows = np.array(rows)  # whoever writes it may cut the file
    return assemble(stream, rows["tick"], rows["values"], counters, closed=False)


Ticks = TypeVar("Ticks", int, np.ndarray)


def nearest_places(since: Ticks, decimation: int) -> Ticks:
    """The nearest sample numbers of rows that are `since` ticks after the first."""
    return (since + decimation // 2) // decimation


def ascending(ticks: np.ndarray, decimation: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns (places, kept): which rows are kept, and the sample number of each, counted from the
    first row. A row is dropped if it is not later than all rows before it (ticks are modulo
    2**32), or if it alone is not at a multiple of the decimation. After an interruption the board
    may continue at any tick; such rows get the nearest sample number."""
    steps = np.diff(ticks.astype(np.uint32)).astype(np.int32)  # wraps
    since = np.concatenate([[0], np.cumsum(steps, dtype=np.int64)])[: len(ticks)]
    phase = since % decimation
    as_next = np.append(phase[1:] == phase[:-1], False)[: len(ticks)]
    on_raster = (phase == 0) | as_next | np.roll(as_next, 1)
    place = nearest_places(since, decimation)
    latest = np.maximum.accumulate(np.where(on_raster, place, -1))
    kept = on_raster & (place > np.concatenate([[-1], latest[:-1]])[: len(ticks)])
    return place[kept], kept


def fill(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The values, (n, ...), at their places; NaN in between."""
    lost = int(places[-1]) + 1 - len(places) if len(places) else 0
    if not lost:
        return values
    if lost * values[0].size > MOST_LOST_VALUES:
        at = int(np.argmax(np.diff(places)))
        raise RecordingError(
            f"{lost} samples are missing, most of them between row {at + 1} and row {at + 2}: "
            "too many to fill in"
        )
    if values.dtype.kind != "f":
        raise RecordingError(f"{lost} samples are missing in a channel of whole numbers")
    out = np.full((lost + len(places), *values.shape[1:]), np.nan, values.dtype)
    out[places] = values
    return out


def metadata(
    stream: Stream, first_tick: int | None, gaps: int, lost: int, counters: dict, closed: bool
) -> dict:
    """The metadata of a board's recording."""
    return {
        **COUNTERS,
        **stream.meta,
        FIRST_TICK: first_tick,
        DECIMATION: stream.decimation,
        TICK_HZ: stream.tick_Hz,
        "gaps": gaps,
        "lost_samples": lost,
        **counters,
        "closed": closed,
    }


def assemble(
    stream: Stream, ticks: np.ndarray, values: np.ndarray, counters: dict, closed: bool
) -> Recording:
    """Make the recording from (n,) ticks and (n, channels) values as they came. Missing samples
    are NaN, and the metadata give their number."""
    places, kept = ascending(ticks, stream.decimation)
    samples = int(places[-1]) + 1 if len(places) else 0
    table = fill(places, values if kept.all() else np.asarray(values[kept], np.float32))
    meta = metadata(
        stream,
        int(ticks[0]) if len(ticks) else None,
        int(np.sum(np.diff(places) > 1)),
        samples - len(places),
        {"unusable_rows": int(np.sum(~kept)), **counters},
        closed,
    )
    channels = {name: table[:, column] for column, (name, _) in enumerate(stream.channels)}
    return Recording(stream.rate_Hz, channels, dict(stream.channels), meta, stream.start_s)
