"""Recording a live board into a file. Appended samples are safe even if the process dies.

    with Writer.open("out/run.mf4", Stream(channels, tick_Hz, decimation, meta=...)) as writer:
        writer.append(ticks, values)
        writer.count(drops=3, crc_errors=1)

The metadata say when the recording began (`started`) and why it ended (`ended`: "user",
"duration", "board reset", ... or the text of an error).

Every append is one write to the file, and the process buffers nothing. A .csv file grows in
place. Every other format is first written to a journal `NAME.SUFFIX.part`, which is converted
when the writer is closed. Only one thread at a time may use a writer.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from . import csv, journal
from .formats import PART, NotWritten, RecordingError, beside, check_output, one_line
from .journal import Stream
from .recording import STARTED, clock_text


class Clock(Protocol):
    """Relates a board's tick to the wall clock (`serial.clock.Clock`)."""

    def when(self, tick: int, time_s: float = 0.0) -> dict:
        """Metadata with the wall-clock time of time 0, if `tick` is at `time_s`."""


def growing_file(path: Path) -> Path:
    """The file that a recording with this path is written into."""
    return path if path.suffix == ".csv" else path.with_name(path.name + PART)


def refuse_unfinished(path: Path) -> None:
    """Raise RecordingError rather than overwrite a recording that was not closed."""
    growing = growing_file(path)
    left = growing.exists()
    if left and growing == path:
        left = False
        with suppress(OSError, ValueError, AttributeError):
            header = json.loads(beside(path)[0].read_text(encoding="utf-8"))
            left = False in (header.get("closed"), header.get("meta", {}).get("closed"))
    if left:
        raise RecordingError(
            f"{growing}: a recording that was not closed is there: move or delete it"
        )


class Writer:
    """A recording that grows on the disk. path: the recording; growing: the file that is written
    now (the journal, or the .csv); stream: its channels, rate and metadata."""

    @classmethod
    def open(cls, path: str | Path, stream: Stream, clock: Clock | None = None) -> Writer:
        """Begin a recording. `clock` gives the time of the first sample; without it, the recording
        starts now. RecordingError if the file cannot be written, or if there is already a
        recording of this name that was not closed."""
        return cls(path, stream, clock)

    def __init__(self, path: str | Path, stream: Stream, clock: Clock | None) -> None:
        self.path = check_output(path)
        self.stream = replace(stream, meta={STARTED: clock_text(time.time()), **stream.meta})
        self._clock = clock
        self.growing = growing_file(self.path)
        self._csv = self.growing == self.path
        self._counters = dict(journal.COUNTERS)
        self._first: int | None = None
        self._last: int | None = None
        self._since_first = 0
        self._gaps = self._lost = 0
        refuse_unfinished(self.path)
        try:
            self._file = self.growing.open("w+b" if self._csv else "x+b", buffering=0)
        except OSError as error:
            raise RecordingError(f"{self.growing}: {one_line(error)}") from None
        self._bytes = 0
        try:
            if self._csv:
                self._write_beside(closed=False)
                self._write(csv.stream_head(self.stream).encode())
            else:
                head = journal.head(self.stream, self._counters)
                self._counters_at = len(head) - journal.COUNTERS_LINE
                self._write(head)
        except RecordingError:  # the file is still empty
            self._file.close()
            for path in beside(self.growing):
                path.unlink(missing_ok=True)
            raise

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, *_: object) -> None:
        """An error that ends the block may give the reason itself, in its attribute `ended`."""
        self.close(why(error))

    @property
    def closed(self) -> bool:
        """Whether the file is complete."""
        return self._file.closed

    def append(self, ticks: np.ndarray, values: np.ndarray) -> None:
        """Append n rows: ticks, (n,) counts of fast interrupts; values, (n, channels) in the
        channels' units. RecordingError if the disk does not take them."""
        if self._file.closed:
            raise RecordingError(f"{self.path}: closed")
        ticks, values = np.asarray(ticks), np.asarray(values, np.float32)
        if values.shape != (len(ticks), len(self.stream.channels)):
            raise RecordingError(
                f"{values.shape} values for {len(ticks)} ticks of {len(self.stream.channels)} "
                "channels"
            )
        if not len(ticks):
            return
        ticks = ticks.astype(np.uint32)
        since = self._check(ticks)
        places = journal.nearest_places(since, self.stream.decimation)
        before = journal.nearest_places(self._since_first, self.stream.decimation)
        missing = np.maximum(np.diff(places, prepend=before) - 1, 0)  # the very first row: 0
        if self._csv:
            steps = np.diff(since, prepend=self._since_first)
            data = self._lines(since, steps, missing, ticks, values).encode()
        else:
            rows = np.empty(len(ticks), self.stream.row)
            rows["tick"], rows["values"] = ticks, values
            data = rows.tobytes()
        self._write(data)
        self._gaps += int(np.count_nonzero(missing))
        self._lost += int(missing.sum())
        self._last, self._since_first = int(ticks[-1]), int(since[-1])
        if self._first is None:
            self._first = int(ticks[0])
            self._begin(self._first)
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise RecordingError(
                f"{self.growing}: deleted while it is written; closing writes it again"
            )

    def _begin(self, tick: int) -> None:
        """Note the time of the first sample."""
        if self._clock is None:
            return
        when = self._clock.when(tick, self.stream.start_s)
        self.stream = replace(self.stream, meta={**self.stream.meta, **when})
        if self._csv:
            with suppress(RecordingError):  # the rows are safe; the header is written again later
                self._write_beside(closed=False)

    def _lines(
        self,
        since: np.ndarray,
        steps: np.ndarray,
        missing: np.ndarray,
        ticks: np.ndarray,
        values: np.ndarray,
    ) -> str:
        """The text of rows, with the lost samples before each."""
        parts, done = [], 0
        for at in np.flatnonzero(missing).tolist():
            parts.append(
                csv.stream_lines(self.stream, since[done:at], ticks[done:at], values[done:at])
            )
            step = int(steps[at])
            last, tick = int(since[at]) - step, int(ticks[at]) - step
            parts.append(csv.gap_lines(self.stream, last, tick, int(missing[at])))
            done = at
        parts.append(csv.stream_lines(self.stream, since[done:], ticks[done:], values[done:]))
        return "".join(parts)

    def _check(self, ticks: np.ndarray) -> np.ndarray:
        """Ticks from the recording's first row to each row."""
        known = ticks if self._last is None else np.concatenate([[self._last], ticks])
        steps = np.diff(known.astype(np.uint32)).astype(np.int32).astype(np.int64)
        # After an interruption the board may continue at any tick, not only at multiples of the
        # decimation.
        bad = steps <= 0
        if bad.any():
            at = int(np.argmax(bad))
            raise RecordingError(
                f"{self.path}: tick {known[at + 1]} after tick {known[at]}: "
                "has the board been started again?"
            )
        since = np.cumsum(steps) + self._since_first
        return since if self._last is not None else np.concatenate([[0], since])

    def count(self, **counters: int) -> None:
        """Set the error counters in the metadata: drops, crc_errors and others."""
        if counters.items() <= self._counters.items():
            return
        new = {**self._counters, **{name: int(value) for name, value in counters.items()}}
        if len(json.dumps(new)) >= journal.COUNTERS_LINE:
            raise RecordingError(f"{self.path}: too many counters")
        self._counters = new
        if self._csv:
            self._write_beside(closed=False)
            return
        try:
            self._file.seek(self._counters_at)
            self._file.write(journal.counters_line(new))
        except OSError as error:
            raise self._failed(error) from None

    def close(self, ended: str = "user", **meta: object) -> Path:
        """Finish the file. ended: the reason; meta: further metadata. RecordingError on failure:
        all samples are kept, and `close` can be called again."""
        if self._file.closed:
            return self.path
        self.stream = replace(self.stream, meta={**self.stream.meta, **meta, "ended": ended})
        try:
            if self._csv:
                self._restore()
                self._write_beside(closed=True)
            else:
                self._convert()
        except OSError as error:
            raise self._failed(error) from None
        except RecordingError as error:
            raise type(error)(f"{error}; the samples are in {self.growing}") from None
        self._file.close()
        if not self._csv:
            with suppress(FileNotFoundError):
                self.growing.unlink()
        return self.path

    def _convert(self) -> None:
        stream, rows, _ = journal.read(self._file)
        stream = replace(stream, meta=self.stream.meta)
        journal.assemble(stream, rows["tick"], rows["values"], self._counters, closed=True).save(
            self.path
        )

    def _restore(self) -> None:
        """Write a .csv file again if it was moved or deleted."""
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(self._file.fileno()), os.stat(self.path)):
                return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file.seek(0)
        with self.path.open("wb") as copy:
            shutil.copyfileobj(self._file, copy)

    def _write(self, data: bytes) -> None:
        """Append all of the data, or leave the file as it was."""
        left = memoryview(data)
        try:
            self._file.seek(self._bytes)
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._bytes)
            raise self._failed(error) from None
        self._bytes += len(data)

    def _write_beside(self, closed: bool) -> None:
        """Replace the header file of a .csv, in one step."""
        path = beside(self.path)[0]
        draft = path.with_name(f".{path.name}.{os.getpid()}")
        samples = None
        if closed:
            began = self._first is not None
            last = journal.nearest_places(self._since_first, self.stream.decimation)
            samples = last + 1 if began else 0
        meta = journal.metadata(
            self.stream, self._first, self._gaps, self._lost,
            {"unusable_rows": 0, **self._counters}, closed,
        )  # fmt: skip
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            draft.write_text(csv.stream_header(self.stream, samples, meta), encoding="utf-8")
            draft.replace(path)
        except OSError as error:
            with suppress(OSError):
                draft.unlink()
            raise self._failed(error) from None

    def _failed(self, error: OSError) -> NotWritten:
        return NotWritten(f"{self.growing}: {one_line(error)}; the samples before are kept")


def why(error: BaseException | None) -> str:
    """The reason why a recording ended, from the error that left its block."""
    if error is None or isinstance(error, KeyboardInterrupt):
        return "user"
    return str(getattr(error, "ended", "") or one_line(error))
