"""What is written while a board is recorded: rows of tick and values as they come.

A journal (`NAME.npz.part`): a line of JSON (`Stream.to_json`), a line of JSON with the
counters filled with blanks to 256 bytes, then rows of fixed size, little-endian: u32 tick,
float32 values. A file that ends anywhere is good up to its last whole row.

The tick is the time base: the drive's count of fast interrupts, modulo 2**32.
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
COUNTERS_LINE = 256  #: bytes, with the line's end: written again in place
LONGEST_HEADER = 1 << 24
#: Lost samples times channels that are filled with NaN, at most: 400 MB.
MOST_LOST_VALUES = 10**8
#: Of a recording that nothing was counted for.
COUNTERS = {"drops": 0, "crc_errors": 0, "damaged_samples": 0}
#: Key of the metadata: fast interrupts per second.
TICK_HZ = "tick_Hz"


@dataclass(frozen=True)
class Stream:
    """What a stream of samples is.

    channels: (name, unit) each; tick_Hz: ticks per second; decimation: ticks from one
    sample to the next; start_s: time of the first sample; meta: of the recording.
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
    """Stream, rows and counters of an open journal."""
    file.seek(0)
    stream = Stream.from_json(json.loads(file.readline(LONGEST_HEADER)))
    line = file.read(COUNTERS_LINE)
    try:
        counters = json.loads(line)
    except ValueError:  # broken off while it was written: the rows are good without
        counters = {}
    octets = file.read()
    whole = len(octets) - len(octets) % stream.row.itemsize
    return stream, np.frombuffer(octets[:whole], stream.row), counters


def load(path: Path) -> Recording:
    """The recording of a journal that was left behind."""
    with path.open("rb") as file:
        stream, rows, counters = read(file)
    return assemble(stream, rows["tick"], rows["values"], counters, closed=False)


Ticks = TypeVar("Ticks", int, np.ndarray)


def nearest_places(since: Ticks, decimation: int) -> Ticks:
    """The sample numbers of rows so many ticks after the first: the nearest."""
    return (since + decimation // 2) // decimation


def ascending(ticks: np.ndarray, decimation: int) -> tuple[np.ndarray, np.ndarray]:
    """(places, kept): the sample number of each row that is kept, counted from the first
    row, and which rows those are. Not kept: rows that are not later than all before
    (ticks are modulo 2**32), and single ones that are not on the stream's raster. Behind an
    interruption the board goes on at any tick: such rows are at the nearest place."""
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
    """(n, ...) values at their places, NaN between."""
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
    """The metadata of a recording of a board."""
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
    """The equally sampled recording of (n,) ticks and (n, channels) values as they came:
    NaN where samples are missing, and how many in the metadata."""
    places, kept = ascending(ticks, stream.decimation)
    samples = int(places[-1]) + 1 if len(places) else 0
    table = fill(places, np.asarray(values[kept], np.float32))
    meta = metadata(
        stream,
        int(ticks[0]) if len(ticks) else None,
        int(np.sum(np.diff(places) > 1)),
        samples - len(places),
        {"unusable_rows": int(np.sum(~kept)), **counters},
        closed,
    )
    channels = {
        name: np.ascontiguousarray(table[:, column], np.float32)
        for column, (name, _) in enumerate(stream.channels)
    }
    return Recording(stream.rate_Hz, channels, dict(stream.channels), meta, stream.start_s)
