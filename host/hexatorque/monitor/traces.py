"""The traces under the monitor: the latest samples in memory, their envelopes for drawing, and the
recording of them."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..drive.board import BoardDrive
from ..drive.recorder import Recorder
from ..recording.formats import SUFFIXES, RecordingError
from ..serial import LinkError, wire
from ..serial.stream import Stream

#: The newest sample is shown as a number only if it is not older than this.
FRESH_S = 1.0
#: The figures in the header are means over this time: a torque that is controlled by a comparator
#: jumps from sample to sample.
MEAN_S = 0.25
#: Width of the gap in the traces where the board was reset.
BREAK_S = 0.05
#: Length of the history that pages can show, and its largest number of values.
HISTORY_S, HISTORY_VALUES = 60.0, 1 << 23


class Ring:
    """The latest samples, (channels, capacity), equally spaced; missing samples are NaN.

    Each sample has a number: its tick divided by the decimation. After a reset the board counts
    from 0 again, while the ring's numbers continue (`begin_anew`). One thread pushes samples.
    Any number of threads may read.
    """

    def __init__(self, channels: int, capacity: int) -> None:
        self.capacity = capacity
        self.begin = 0  #: number of the very first sample
        self.end = 0  #: number of the newest sample, plus one
        self.marks: list[int] = []  #: numbers of the first sample after each reset
        self._ahead = 0  # the ring's numbers minus the board's
        self._gap = 0  # gap before the next push if that is the first one after a reset
        self._values = np.full((channels, capacity), np.nan, np.float32)
        self._lock = threading.Lock()

    def push(self, numbers: np.ndarray, values: np.ndarray) -> None:
        """Add samples. numbers: (n,), ascending, larger than all before; values: (n, channels)."""
        if not len(numbers):
            return
        with self._lock:
            if self._gap:
                self.marks.append(self.end + self._gap // 2)
                self._ahead = self.end + self._gap - int(numbers[0])
                self._gap = 0
            numbers = numbers + self._ahead
            end = int(numbers[-1]) + 1
            if self.end == 0:
                self.begin = self.end = int(numbers[0])
            new = min(end - self.end, self.capacity)
            if new != len(numbers):
                self._values[:, np.arange(end - new, end) % self.capacity] = np.nan
            keep = numbers >= end - self.capacity
            self._values[:, numbers[keep] % self.capacity] = values[keep].T
            self.end = end

    def begin_anew(self, gap: int) -> None:
        """After a reset of the board: put the next samples `gap` >= 1 samples behind the newest,
        whatever their numbers are. How much time the reset took is not known."""
        with self._lock:
            if self.end:
                self._gap = gap

    @property
    def boards_end(self) -> int:
        """`end` in the board's own numbers."""
        return self.end - self._ahead

    def part(self, first: int, last: int) -> np.ndarray:
        """A copy of samples `first` to `last`, (channels, last - first). NaN where the ring has
        no sample, or no longer has it."""
        with self._lock:
            out = np.full((len(self._values), last - first), np.nan, np.float32)
            begin = max(first, self.begin, self.end - self.capacity)
            end = min(last, self.end)
            if begin < end:
                here = self._values[:, np.arange(begin, end) % self.capacity]
                out[:, begin - first : end - first] = here
            return out

    def newest(self) -> np.ndarray | None:
        """The newest sample, (channels,); None if there is none."""
        if self.end == 0:
            return None
        return self.part(self.end - 1, self.end)[:, 0]

    def envelope(self, width: int, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        """The smallest and the largest value in each of the bins `first` to `last`, each
        (channels, last - first). Bin n holds samples n * width to (n + 1) * width. NaN for an
        empty bin."""
        part = self.part(first * width, last * width)
        if width == 1:
            return part, part
        bins = part.reshape(len(part), last - first, width)
        return np.fmin.reduce(bins, axis=2), np.fmax.reduce(bins, axis=2)


class View:
    """The bins of a ring that one page has yet to get.

    A window has at least `bins` bins, unless it has fewer samples: with a bin for each pixel no
    column of the plot stays empty. A bin is sent again until it is full. After a long pause only
    the newest window is sent.
    """

    def __init__(self, ring: Ring, rate_Hz: float, window_s: float, bins: int) -> None:
        self.ring = ring
        self.width = max(1, round(window_s * rate_Hz) // bins)
        self.count = -(-round(window_s * rate_Hz) // self.width) + 1
        self._next = 0

    def news(self) -> tuple[int, np.ndarray, np.ndarray] | None:
        """The bins since the last call: number of the first, smallest and largest values, each
        (channels, n). None if there are none."""
        end = self.ring.end
        if end == 0:
            return None
        last = (end - 1) // self.width + 1
        first = max(self._next, last - self.count)
        if first * self.width >= end:
            return None
        self._next = end // self.width
        lo, hi = self.ring.envelope(self.width, first, last)
        return first, lo, hi


class Traces:
    """The samples of a drive that pages show. ring, stream: of the present traces, None without;
    epoch: counts the choices of channels and rate, so that a page notices a new one; recorder: of
    the recording that runs; measured_Hz: samples per second. `tell` gets messages that no page
    asked for."""

    def __init__(self, drive: BoardDrive, folder: Path, tell: Callable[[str], None]) -> None:
        self.drive = drive
        self.folder = folder
        self.epoch = 0
        self.ring: Ring | None = None
        self.stream: Stream | None = None
        self.recorder: Recorder | None = None
        self.measured_Hz = 0.0
        self.lock = threading.RLock()
        self._tell = tell
        self._pushed_s = -math.inf  # when the latest samples came
        self._counted = (0, 0.0)
        self._received = 0

    def close(self) -> None:
        with self.lock:
            try:
                if self.recorder:
                    self.record_stop()
            finally:
                if self.stream:
                    self.stream.close()

    def status(self) -> dict:
        """The part of them that a page shows."""
        ring, stream, recorder = self.ring, self.stream, self.recorder
        return {
            "marks_s": [n / stream.rate_Hz for n in ring.marks] if ring and stream else [],
            "channels": stream.channels if stream else (),
            "epoch": self.epoch,
            "rate_Hz": stream.rate_Hz if stream else 0,
            "measured_Hz": self.measured_Hz,
            "gaps": stream.gaps if stream else 0,
            "lost": stream.lost if stream else 0,
            "record": {
                "file": str(recorder.path),
                "rows": recorder.samples,
                "seconds": recorder.seconds,
            }
            if recorder
            else None,
        }

    @contextlib.contextmanager
    def stopped(self) -> Iterator[None]:
        """Stop the traces, and start them again afterwards: the board changes the rate of its
        interrupts and writes its memory only while it streams nothing."""
        with self.lock:
            old = self.stream
            self.select([], None)
            try:
                yield
            finally:
                if old:
                    rate_Hz = min(old.rate_Hz, float(self.drive.get("f_isr_Hz")))
                    self.select(list(old.channels), rate_Hz)

    def select(self, channels: list[str], rate_Hz: float | None) -> None:
        """Trace these channels at `rate_Hz`, or as fast as the line allows if that is too fast
        or None. LinkError if a name is unknown or given twice, if there are too many, or while
        a recording runs."""
        with self.lock:
            if self.recorder:
                raise LinkError("channels: end the recording first", mistake=True)
            self.drive.dictionary.channel_ids(channels)
            if len(set(channels)) != len(channels):
                raise LinkError("channels: one is named twice", mistake=True)
            if len(channels) > (most := self.drive.hello.stream_channels):
                raise LinkError(f"{len(channels)} channels: up to {most}", mistake=True)
            old, self.stream, self.ring = self.stream, None, None
            self.epoch += 1
            if old:
                old.close()
            try:
                self._open(channels, rate_Hz)
            except LinkError:
                if old:
                    self._open(old.channels, old.rate_Hz)
                raise

    def _open(self, channels: list[str] | tuple[str, ...], rate_Hz: float | None) -> None:
        if not channels:
            return
        try:
            stream = self.drive.stream(channels, rate_Hz)
        except LinkError as error:
            if error.status != wire.Status.BUDGET:
                raise
            stream = self.drive.stream(channels)
        most = HISTORY_VALUES // len(channels)
        self.ring = Ring(len(channels), min(most, math.ceil(HISTORY_S * stream.rate_Hz)))
        self.stream = stream

    def present(self) -> tuple[int, Ring, Stream] | None:
        """The epoch, the ring and the stream of the present traces; None without traces."""
        with self.lock:
            if self.ring is None or self.stream is None:
                return None
            return self.epoch, self.ring, self.stream

    def move(self) -> None:
        """Move the samples that have come from the client's queue into the ring, and into the
        recording."""
        with self.lock:
            if self.stream is None or self.ring is None:
                return
            try:
                blocks = self.stream.waiting()
            except LinkError:  # it has ended: another is opened, or the page says why
                return
            if not blocks:
                self._count(0)
                return
            ticks = np.concatenate([t for t, _ in blocks])
            values = np.concatenate([v for _, v in blocks])
            self.ring.push(ticks // self.stream.decimation, values)
            self._pushed_s = time.monotonic()
            self._count(len(ticks))
            if self.recorder:
                try:
                    self.recorder.put(ticks, values)
                except RecordingError as error:
                    recorder, self.recorder = self.recorder, None
                    self._tell(f"recording ended: {error}")
                    with contextlib.suppress(RecordingError):
                        recorder.writer.close(str(error))

    def newest(self) -> np.ndarray | None:
        """The newest sample, (channels,); None if it is older than `FRESH_S`."""
        ring = self.ring
        if ring is None or time.monotonic() - self._pushed_s > FRESH_S:
            return None
        return ring.newest()

    def mean(self) -> np.ndarray:
        """The mean of the latest `MEAN_S`, (channels,). NaN for a channel that has no newest value:
        its control does not run."""
        with self.lock:
            ring, stream = self.ring, self.stream
        if ring is None or stream is None or not ring.end:
            return np.empty(0)
        part = ring.part(ring.end - max(1, round(MEAN_S * stream.rate_Hz)), ring.end)
        there = np.isfinite(part)
        total = np.where(there, part, 0.0).sum(axis=1, dtype=float)
        return np.where(there[:, -1], total / np.maximum(1, there.sum(axis=1)), np.nan)

    def _count(self, samples: int) -> None:
        """Measure the samples per second, over the latest second."""
        self._received += samples
        now = time.monotonic()
        before, since = self._counted
        if now - since >= 1.0:
            self.measured_Hz = (self._received - before) / (now - since) if since else 0.0
            self._counted = (self._received, now)

    def restart(self) -> None:
        """Trace the same channels. The board's ticks have started again from 0."""
        with self.lock:
            old, ring = self.stream, self.ring
            if old is None or ring is None:
                return
            old.close()
            try:
                self._open(old.channels, min(old.rate_Hz, float(self.drive.get("f_isr_Hz"))))
            except LinkError as error:
                if not error.mistake:
                    raise
                self.stream = self.ring = None
                self._tell(str(error))
            if self.stream and self.stream.rate_Hz == old.rate_Hz:
                ring.begin_anew(math.ceil(BREAK_S * old.rate_Hz))
                self.ring = ring
            else:
                self.epoch += 1

    def record_start(self, suffix: str) -> Path:
        with self.lock:
            if self.recorder:
                raise LinkError("a recording is under way", mistake=True)
            if self.stream is None:
                raise LinkError("choose channels to record", mistake=True)
            if suffix not in SUFFIXES:
                raise LinkError(f"suffix {suffix!r}: choose {', '.join(SUFFIXES)}", mistake=True)
            name = self.drive.hello.device.replace(" ", "-")
            path = self.folder / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}{suffix}"
            self.recorder = Recorder(self.drive, path, self.stream)
            return path

    def record_stop(self) -> Path:
        with self.lock:
            if self.recorder is None:
                raise LinkError("nothing is being recorded", mistake=True)
            recorder, self.recorder = self.recorder, None
            return recorder.close("user")

    def note_stop(self, text: str) -> None:
        """The drive was stopped, and no page asked for it: a recording tells when and why."""
        with self.lock:
            if self.recorder:
                self.recorder.stops.append(text)

    def end_recording(self, why: str) -> None:
        """Close the recording, if there is one; `why` is the reason."""
        with self.lock:
            if self.recorder is None:
                return
            recorder, self.recorder = self.recorder, None
            try:
                recorder.close(why)
                self._tell(f"recording ended: {why}")
            except RecordingError as error:
                self._tell(f"recording ended: {why}; {error}")
