"""Samples as they come: blocks of rows on the board's own time, losses counted."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator

import numpy as np

from . import LinkError, wire
from .client import Client
from .dictionary import Dictionary
from .wire import Hello, Reply, Status

#: A board's period is whole counts of a PWM clock of 100 MHz or more: its rate may be half a
#: count below the f_isr_Hz that was written.
HALF_COUNT_S = 5e-9
#: Longest decimation that the wire can carry.
MOST_DECIMATION = 0xFFFF


def decimation_for(f_isr_Hz: float, rate_Hz: float) -> int:
    """The decimation next to a rate."""
    slowest = f_isr_Hz / MOST_DECIMATION
    if not slowest <= rate_Hz <= f_isr_Hz * (1 + HALF_COUNT_S * f_isr_Hz):
        raise LinkError(
            f"rate_Hz = {rate_Hz:g}: allowed range is {slowest:.3g} .. {f_isr_Hz:g} Hz",
            mistake=True,
        )
    return max(1, round(f_isr_Hz / rate_Hz))


class Stream:
    """One stream of the board, from now on until `close`.

    Iterating gives blocks (ticks int64 (n,), values float32 (n, channels)) in order. Ticks
    count fast interrupts, on beyond 2^32, and ascend by whole decimations; should the board
    restart, they go on by this computer's clock. The queue between is unbounded: a slow
    reader loses nothing.
    """

    def __init__(
        self,
        client: Client,
        hello: Hello,
        dictionary: Dictionary,
        channels: tuple[str, ...] | list[str],
        decimation: int | None = None,
    ) -> None:
        self.channels = tuple(channels)
        self.units = {row.name: row.unit for row in dictionary.channels}
        self.f_isr_Hz = hello.f_isr_Hz
        self.gaps = 0  #: interruptions
        self.lost = 0  #: samples that never came
        self.damaged = 0  #: samples of a wrong length, doubled or out of order
        self._client = client
        self._ids = dictionary.channel_ids(self.channels)
        if not 1 <= len(self._ids) <= hello.stream_channels:
            raise LinkError(
                f"{len(self._ids)} channels: a stream has 1 to {hello.stream_channels}",
                mistake=True,
            )
        if decimation is not None and not 1 <= decimation <= MOST_DECIMATION:
            raise LinkError(
                f"decimation = {decimation}: allowed range is 1 .. {MOST_DECIMATION}", mistake=True
            )
        self._type = wire.sample_type(len(self._ids))
        self._blocks: queue.SimpleQueue[tuple[np.ndarray, np.ndarray]] = queue.SimpleQueue()
        self._from = 0  # tick from which the stream is in force
        self._fresh = True  # no sample yet since it is
        self._tick = 0  # of the latest sample, as the board counts
        self._time = 0  # the same, as we count
        self._seen_s: float | None = None  # when that came
        self._slot = client.take_stream()
        try:
            self.decimation = self._begin(decimation)
        except BaseException:
            client.free_stream(self._slot)
            raise
        client.on_return.append(self._again)

    @property
    def rate_Hz(self) -> float:
        return self.f_isr_Hz / self.decimation

    def _begin(self, decimation: int | None) -> int:
        """Set the stream; without a decimation, with the smallest that fits."""
        wanted = 1 if decimation is None else decimation
        self.decimation = wanted
        reply = self._set(wanted)
        if reply.status == Status.BUDGET:
            (fits,) = wire.unpack("H", reply.payload)
            if decimation is None and fits:
                return self._begin(fits)
            best = (
                f"the smallest decimation that fits is {fits}, {self.f_isr_Hz / fits:.6g} Hz"
                if fits
                else "nothing more fits beside the other streams"
            )
            raise LinkError(
                f"{len(self._ids)} channels at {self.rate_Hz:.6g} Hz: more than the line carries; "
                + best,
                reply.status,
                mistake=True,
            )
        if reply.status != Status.DONE:
            raise self._client.refused(reply, "stream")
        return wanted

    def _set(self, decimation: int) -> Reply:
        payload = wire.stream(self._slot, self._ids, decimation)
        return self._client.ask_stream(self._slot, payload, self._push, self._begun)

    def _again(self) -> None:
        """The board is back after an interruption."""
        if self._set(self.decimation).status != Status.DONE:
            raise LinkError("the stream cannot be set again", mistake=True)

    # -- the reader's thread -------------------------------------------------------------

    def _begun(self, reply: Reply) -> None:
        self._from, self._fresh = reply.tick, True

    def _push(self, bodies: list[bytes]) -> None:
        size = self._type.itemsize
        good = [body for body in bodies if len(body) == size]
        self.damaged += len(bodies) - len(good)
        rows = np.frombuffer(b"".join(good), self._type)
        now_s = time.monotonic()
        if self._fresh:
            rows = self._first(rows, now_s)
        if not len(rows):
            return
        # Wraps as the board's counter does.
        steps = np.diff(rows["tick"], prepend=np.uint32(self._tick)).astype(np.int32)
        if (steps != self.decimation).any():
            rows, steps = self._mend(rows)
            if not len(rows):
                return
        ticks = self._time + np.cumsum(steps, dtype=np.int64)
        self._tick, self._time = int(rows["tick"][-1]), int(ticks[-1])
        self._seen_s = now_s
        self._blocks.put((ticks, rows["values"].copy()))

    def _first(self, rows: np.ndarray, now_s: float) -> np.ndarray:
        """Join the first samples since the stream is in force to what was before."""
        ahead = (rows["tick"] - np.uint32(self._from)).astype(np.int32)
        rows = rows[ahead >= 0]  # before: left over from another stream
        if not len(rows):
            return rows
        self._fresh = False
        first, missed = int(rows["tick"][0]), int(rows["number"][0])
        if self._seen_s is None:
            self.gaps += missed > 0
            self.lost += missed
            self._time = first - self.decimation
        else:
            step = (first - self._tick) & 0xFFFFFFFF
            by_clock = (now_s - self._seen_s) * self.f_isr_Hz
            if abs(step - by_clock) > self.f_isr_Hz + 0.1 * by_clock:  # its counter restarted
                step = by_clock
            # The board begins anew at any tick; rows stay on the raster of the first one.
            places = max(1, round(step / self.decimation))
            self.gaps += 1
            self.lost += places - 1
            self._time += (places - 1) * self.decimation
        self._tick = (first - self.decimation) & 0xFFFFFFFF
        return rows

    def _mend(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Count what is missing, leave out what does not belong."""
        last, keep, steps = self._tick, [], []
        for place, tick in enumerate(rows["tick"].tolist()):
            step = (tick - last) & 0xFFFFFFFF
            if step == 0 or step >= 1 << 31:
                self.damaged += 1
                continue
            if step != self.decimation:
                self.gaps += 1
                self.lost += max(0, step // self.decimation - 1)
            keep.append(place)
            steps.append(step)
            last = tick
        return rows[keep], np.array(steps, np.int64)

    # -- the user's ------------------------------------------------------------------------

    def read(self, timeout_s: float | None = None) -> tuple[np.ndarray, np.ndarray] | None:
        """The next block; None if there is none in time."""
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            wait_s = 0.2 if end is None else min(0.2, max(0.0, end - time.monotonic()))
            try:
                return self._blocks.get(timeout=wait_s)
            except queue.Empty:
                if self._client.broken:
                    raise self._client.broken from None
                if end is not None and time.monotonic() >= end:
                    return None

    def waiting(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """All blocks that are there."""
        blocks = []
        while not self._blocks.empty():
            blocks.append(self._blocks.get())
        return blocks

    def __iter__(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        while True:
            block = self.read()
            assert block is not None
            yield block

    def close(self) -> None:
        if self._again in self._client.on_return:
            self._client.on_return.remove(self._again)
            self._client.free_stream(self._slot)

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def on_a_grid(ticks: np.ndarray, values: np.ndarray, decimation: int) -> np.ndarray:
    """(n, k) rows at equal steps from the first tick on; rows that are missing are NaN."""
    if not len(ticks):
        return values
    place = (ticks - ticks[0] + decimation // 2) // decimation
    grid = np.full((int(place[-1]) + 1, values.shape[1]), np.nan, np.float32)
    grid[place] = values
    return grid
