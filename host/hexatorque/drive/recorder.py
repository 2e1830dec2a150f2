"""Recording a stream into a file, as `hexatorque board stream` and the web page do.

with drive.stream(channels) as stream, Recorder(drive, "run.csv", stream) as recorder:
    for ticks, values in stream:
        recorder.put(ticks, values)
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..recording import journal
from ..recording.writer import Writer, why
from ..serial import LinkError
from ..serial.stream import Stream

if TYPE_CHECKING:
    from .board import BoardDrive

#: The counters in the file are updated this often.
COUNT_S = 1.0


class Recorder:
    """writer: the file; samples: the number of rows so far; stops: texts for the metadata, one for
    each time that the dead man of the pages stopped the drive."""

    def __init__(self, drive: BoardDrive, path: str | Path, stream: Stream) -> None:
        channels = tuple((name, stream.units[name]) for name in stream.channels)
        kind = journal.Stream(channels, stream.f_isr_Hz, stream.decimation, meta=drive.meta())
        self._drive, self._stream = drive, stream
        self.samples = 0
        self.stops: list[str] = []
        self._before = self._counters()
        self.writer = Writer.open(path, kind, drive.clock())
        self._begun_s = self._counted_s = time.monotonic()

    @property
    def path(self) -> Path:
        return self.writer.path

    @property
    def seconds(self) -> float:
        """Seconds since the recording began."""
        return time.monotonic() - self._begun_s

    def put(self, ticks: np.ndarray, values: np.ndarray) -> None:
        """Add a block of the stream."""
        self.writer.append(ticks, values)
        self.samples += len(ticks)
        if time.monotonic() - self._counted_s > COUNT_S:
            self.count()

    def count(self) -> None:
        """Write the error counters into the file. They count from the recording's beginning."""
        self._counted_s = time.monotonic()
        now = self._counters()
        self.writer.count(**{name: now[name] - self._before[name] for name in now})

    def _counters(self) -> dict[str, int]:
        status = self._drive.client.status
        return {
            "drops": status.dropped if status else 0,  # frames that the board could not send
            **self._drive.line_counters(),
            "damaged_samples": self._stream.damaged,
        }

    def close(self, ended: str = "user", **meta: object) -> Path:
        """Finish the file. `ended` is the reason: "user", "duration", "board reset", ..."""
        if self.writer.closed:
            return self.path
        with suppress(LinkError):  # a disconnected board has no newer counters
            self._drive.client.get_status()
        self.count()
        if self.stops:
            meta["stops"] = self.stops
        return self.writer.close(ended, **meta)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, *_: object) -> None:
        """An error that ends the block may give the reason itself, in its attribute `ended`."""
        self.close(why(error))
