"""The latest samples in memory, and their envelopes for drawing."""

from __future__ import annotations

import threading

import numpy as np


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
