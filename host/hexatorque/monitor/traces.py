"""The latest samples in memory, and their envelopes for drawing."""

from __future__ import annotations

import threading

import numpy as np


class Ring:
    """(channels, capacity) of the latest samples on an equal grid; missing ones are NaN.

    Samples have numbers: their tick divided by the decimation. After a reset the board counts
    from 0 again; the ring's numbers go on (`begin_anew`). One thread pushes, any number of
    threads look.
    """

    def __init__(self, channels: int, capacity: int) -> None:
        self.capacity = capacity
        self.begin = 0  #: number of the first sample that ever was
        self.end = 0  #: number behind the newest sample
        self.marks: list[int] = []  #: numbers at which the board began anew
        self._ahead = 0  # of the board's numbers
        self._gap = 0  # of the next push, which is the first since the board began anew
        self._values = np.full((channels, capacity), np.nan, np.float32)
        self._lock = threading.Lock()

    def push(self, numbers: np.ndarray, values: np.ndarray) -> None:
        """numbers (n,) ascending, behind all that came before; values (n, channels)."""
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
        """The next samples have numbers that do not follow; they are put behind the newest,
        `gap` >= 1 samples apart. How much time was between is not known."""
        with self._lock:
            if self.end:
                self._gap = gap

    @property
    def boards_end(self) -> int:
        """`end` as the board counts."""
        return self.end - self._ahead

    def part(self, first: int, last: int) -> np.ndarray:
        """(channels, last - first): a copy; NaN for what is not there (any more)."""
        with self._lock:
            out = np.full((len(self._values), last - first), np.nan, np.float32)
            begin = max(first, self.begin, self.end - self.capacity)
            end = min(last, self.end)
            if begin < end:
                here = self._values[:, np.arange(begin, end) % self.capacity]
                out[:, begin - first : end - first] = here
            return out

    def newest(self) -> np.ndarray | None:
        """(channels,): the newest sample."""
        if self.end == 0:
            return None
        return self.part(self.end - 1, self.end)[:, 0]

    def envelope(self, width: int, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest, (channels, last - first) each, of the samples in bins `first`
        to `last`: bin n holds samples n * width to (n + 1) * width. NaN for an empty bin."""
        part = self.part(first * width, last * width)
        if width == 1:
            return part, part
        bins = part.reshape(len(part), last - first, width)
        return np.fmin.reduce(bins, axis=2), np.fmax.reduce(bins, axis=2)


class View:
    """One page's look at a ring: bins of a window, each handed out again until it is full.

    A page that was not asked for a while gets the newest window only.
    """

    def __init__(self, ring: Ring, rate_Hz: float, window_s: float, bins: int) -> None:
        self.ring = ring
        self.width = max(1, -(-round(window_s * rate_Hz) // bins))
        self.count = -(-round(window_s * rate_Hz) // self.width) + 1
        self._next = 0

    def news(self) -> tuple[int, np.ndarray, np.ndarray] | None:
        """Number of the first bin, smallest, largest (channels, n) since the last call."""
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
