"""Streams: blocks of samples with the board's ticks. Lost samples are counted."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator

import numpy as np

from ..results import RESULTS
from . import BOARD_RESET, RESET_VALUES, LinkError, wire
from .client import Client
from .dictionary import Dictionary
from .wire import Hello, Reply, Status

#: A board's period is a whole number of counts of a PWM clock of 100 MHz or more. Its rate may
#: therefore be half a count below the f_isr_Hz that was written.
HALF_COUNT_S = 5e-9
#: Largest decimation that STREAM can carry.
MOST_DECIMATION = 0xFFFF


def decimation_for(f_isr_Hz: float, rate_Hz: float) -> int:
    """The decimation whose rate is nearest to `rate_Hz`. LinkError if that is out of range."""
    slowest = f_isr_Hz / MOST_DECIMATION
    if not slowest <= rate_Hz <= f_isr_Hz * (1 + HALF_COUNT_S * f_isr_Hz):
        raise LinkError(
            f"rate_Hz = {rate_Hz:g}: allowed range is {slowest:.3g} .. {f_isr_Hz:g} Hz",
            mistake=True,
        )
    return max(1, round(f_isr_Hz / rate_Hz))


class Stream:
    """One stream of the board, until `close` or a reset of the board.

    Iterating gives blocks (ticks int64 (n,), values float32 (n, channels)) in order. Ticks are
    the board's count of fast interrupts, continued beyond 2^32. They do not depend on this
    computer's clock. An interruption may last half of 2^32 ticks, which is 59 hours at 10 kHz.
    After an interruption the stream is set again and may continue at any tick, so the step over
    it need not be a multiple of the decimation. After a reset `read` raises the error `ended`.
    The queue is unbounded: a slow reader loses nothing.
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
        self.lost = 0  #: samples that never came, by their ticks
        self.damaged = 0  #: samples of a wrong length, twice received, or out of order
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
        #: The error that ended the stream: the board was reset.
        self.ended: LinkError | None = None
        self._from: int | None = None  # tick at which the stream was set
        self._fresh = True  # no sample has come since then
        self._tick: int | None = None  # the latest sample's tick, as the board counts
        self._time = 0  # the same tick, continued beyond 2^32
        self._slot = client.take_stream()
        try:
            self.decimation = self._begin(decimation)
        except BaseException:
            client.free_stream(self._slot)
            raise
        client.on_return.append(self._again)
        client.on_forgotten.append(self._end)

    @property
    def rate_Hz(self) -> float:
        return self.f_isr_Hz / self.decimation

    def _begin(self, decimation: int | None) -> int:
        """Set the stream. Without a decimation, take the smallest for which the line is fast
        enough."""
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
                f"{len(self._ids)} channels at {self.rate_Hz:.6g} Hz: "
                f"{RESULTS[Status.BUDGET].text}; {best}",
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
        """Set the stream again after an interruption."""
        if self.ended is None and self._set(self.decimation).status != Status.DONE:
            raise LinkError("the stream cannot be set again", mistake=True)

    def _end(self) -> None:
        """The board was reset. Its ticks start again from 0, so the stream cannot continue."""
        at = "before its first sample" if self._tick is None else f"at tick {self._time}"
        self.ended = LinkError(
            f"{self._client.url}: the board was reset; the recording ends {at}; {RESET_VALUES}",
            ended=BOARD_RESET,
        )
        self._detach()

    # -- the reader's thread -------------------------------------------------------------

    def _begun(self, reply: Reply) -> None:
        if self._tick is None and self._from is not None:
            # Set again before the first sample: missing samples count from the first setting.
            self._time = self._from + 1 - self.decimation
            self._tick = self._time & 0xFFFFFFFF
        self._from, self._fresh = reply.tick, True

    def _push(self, bodies: list[bytes]) -> None:
        size = self._type.itemsize
        good = [body for body in bodies if len(body) == size]
        self.damaged += len(bodies) - len(good)
        rows = np.frombuffer(b"".join(good), self._type)
        if self._fresh:
            rows = self._first(rows)
        if not len(rows):
            return
        assert self._tick is not None
        # These differences wrap, as the board's counter does.
        steps = np.diff(rows["tick"], prepend=np.uint32(self._tick)).astype(np.int32)
        if (steps != self.decimation).any():
            rows, steps = self._mend(rows)
            if not len(rows):
                return
        ticks = self._time + np.cumsum(steps, dtype=np.int64)
        self._tick, self._time = int(rows["tick"][-1]), int(ticks[-1])
        self._blocks.put((ticks, rows["values"].copy()))

    def _first(self, rows: np.ndarray) -> np.ndarray:
        """The rows that belong to the stream as it is now. How many samples are missing before
        the very first one follows from its number, which counts modulo 256, and from the tick of
        the reply: the board takes sample 0 within a few interrupts of that tick."""
        assert self._from is not None
        ahead = (rows["tick"] - np.uint32(self._from)).astype(np.int32)
        rows = rows[ahead >= 0]  # earlier rows belong to a former stream
        if not len(rows):
            return rows
        self._fresh = False
        if self._tick is None:
            first, number = int(rows["tick"][0]), int(rows["number"][0])
            passed = ((first - self._from) & 0xFFFFFFFF) / self.decimation
            missed = number + 256 * max(0, round((passed - number) / 256))
            self.gaps += missed > 0
            self.lost += missed
            self._time = first - self.decimation
            self._tick = self._time & 0xFFFFFFFF
        return rows

    def _mend(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Count missing samples, and drop those that do not belong to the stream."""
        last, keep, steps = self._tick, [], []
        for place, tick in enumerate(rows["tick"].tolist()):
            step = (tick - last) & 0xFFFFFFFF
            if step == 0 or step >= 1 << 31:
                self.damaged += 1
                continue
            missed = (step - 1) // self.decimation
            self.gaps += missed > 0
            self.lost += missed
            keep.append(place)
            steps.append(step)
            last = tick
        return rows[keep], np.array(steps, np.int64)

    # -- public methods --------------------------------------------------------------------

    def read(self, timeout_s: float | None = None) -> tuple[np.ndarray, np.ndarray] | None:
        """The next block; None if none comes within `timeout_s`. After a reset of the board:
        LinkError, once all blocks have been read."""
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            wait_s = 0.2 if end is None else min(0.2, max(0.0, end - time.monotonic()))
            try:
                return self._blocks.get(timeout=wait_s)
            except queue.Empty:
                if self.ended and self._blocks.empty():
                    raise self.ended from None
                if self._client.broken:
                    raise self._client.broken from None
                if end is not None and time.monotonic() >= end:
                    return None

    def waiting(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """All blocks that have come."""
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
        if self.ended is None and self._again in self._client.on_return:
            self._detach()
            self._client.free_stream(self._slot)

    def _detach(self) -> None:
        for listeners, mine in (
            (self._client.on_return, self._again),
            (self._client.on_forgotten, self._end),
        ):
            if mine in listeners:
                listeners.remove(mine)
        if self.ended:
            self._client.forget_stream(self._slot)

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def on_a_grid(ticks: np.ndarray, values: np.ndarray, decimation: int) -> np.ndarray:
    """The rows at equal steps from the first tick on, (n, k); missing rows are NaN. After an
    interruption a row may lie between two steps; it goes to the nearest one."""
    if not len(ticks):
        return values
    place = (ticks - ticks[0] + decimation // 2) // decimation
    row = np.arange(len(place))
    place = np.maximum.accumulate(place - row) + row  # each row gets its own place
    grid = np.full((int(place[-1]) + 1, values.shape[1]), np.nan, np.float32)
    grid[place] = values
    return grid
