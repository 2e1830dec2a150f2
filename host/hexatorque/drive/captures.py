"""Captures: what triggers them, and taking one from a simulation as a board does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..recording.journal import TICK_HZ
from ..recording.recording import DECIMATION, FIRST_TICK, TRIGGER, RecordingError

#: In the order of their numbers in docs/protocol.md.
TRIGGERS = ("manual", "rising", "falling", "above", "below", "fault", "command")


#: A level travels as a float.
FLOAT32_MOST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Trigger:
    kind: str
    channel: str = ""
    level: float = 0.0

    @staticmethod
    def parse(text: str) -> Trigger:
        """`manual`, `fault`, `command`, or `rising:torque_Nm:5` (falling, above, below)."""
        kind, *rest = text.split(":")
        if kind not in TRIGGERS:
            raise RecordingError(f"trigger {text!r}: choose one of {', '.join(TRIGGERS)}")
        if kind in ("manual", "fault", "command"):
            if rest:
                raise RecordingError(f"trigger {text!r}: {kind} takes nothing more")
            return Trigger(kind)
        try:
            channel, level = rest
            number = float(level)
        except ValueError:
            number = math.nan
        if not abs(number) <= FLOAT32_MOST:
            raise RecordingError(
                f"trigger {text!r}: write {kind}:CHANNEL:LEVEL, levels up to 3.4e38 either way"
            )
        return Trigger(kind, channel, number)

    @property
    def number(self) -> int:
        return TRIGGERS.index(self.kind)


def check(samples: int, pre: int, prescaler: int) -> None:
    """Refuse what no capture can be."""
    if samples < 1:
        raise RecordingError(f"samples = {samples}: 1 or more are needed")
    if not 0 <= pre < samples:
        raise RecordingError(f"pre = {pre}: allowed range is 0 .. {samples - 1}")
    if not 1 <= prescaler <= 0xFFFF:
        raise RecordingError(f"prescaler = {prescaler}: allowed range is 1 .. 65535")


def metadata(trigger_tick: int, pre: int, prescaler: int, f_isr_Hz: float) -> dict:
    """Of a complete capture: its trigger is at time 0, and no sample is missing."""
    return {
        TRIGGER: 0.0,
        "trigger_tick": trigger_tick,
        FIRST_TICK: (trigger_tick - pre * prescaler) % 2**32,
        DECIMATION: prescaler,
        TICK_HZ: f_isr_Hz,
        "gaps": 0,
        "lost_samples": 0,
        "damaged_samples": 0,
    }


class Burst:
    """Fed with all rows of a simulation's telemetry, keeps those of one capture.

    A trigger counts once `pre` samples are there, and is looked at when a sample is taken;
    an edge is one between two samples that were taken. A command counts at the next sample,
    a manual trigger until it counts.
    """

    def __init__(
        self,
        columns: list[int],
        samples: int,
        pre: int,
        prescaler: int,
        trigger: Trigger,
        on: int,
    ) -> None:
        """`columns` of the rows to keep; `on`: the column that the trigger looks at."""
        check(samples, pre, prescaler)
        self.samples, self.pre, self.prescaler = samples, pre, prescaler
        self.manual = False
        self.command = False
        self.period: int | None = None  #: of the trigger
        self._columns, self._trigger, self._on = columns, trigger, on
        self._skip = 0  # rows until the next sample
        self._taken = 0  # samples taken before the trigger was seen
        self._before: float | None = None  # what the trigger looked at last
        self._kept = np.empty((0, len(columns)), np.float32)

    @property
    def complete(self) -> bool:
        return self.period is not None and len(self._kept) >= self.samples

    @property
    def values(self) -> np.ndarray:
        """(samples, channels) of a complete capture."""
        return self._kept[: self.samples]

    def feed(self, rows: np.ndarray, period: int) -> None:
        """(n, all channels) of periods that began with number `period`."""
        if self.complete:
            return
        taken = rows[self._skip :: self.prescaler]
        first = period + self._skip
        self._skip = (self._skip - len(rows)) % self.prescaler
        if not len(taken):
            return
        place = self._find(taken[:, self._on]) if self.period is None else None
        kept = np.concatenate([self._kept, taken[:, self._columns]])
        if place is not None:
            self.period = first + place * self.prescaler
            kept = kept[len(self._kept) + place - self.pre :]
        elif self.period is None and len(kept) > self.pre:
            kept = kept[len(kept) - self.pre :]
        self._kept = kept

    def _find(self, seen: np.ndarray) -> int | None:
        """Which of these samples triggers, by what the trigger looks at."""
        before = np.concatenate([[np.nan if self._before is None else self._before], seen[:-1]])
        level, counts = np.float32(self._trigger.level), np.zeros(len(seen), bool)
        if self._trigger.kind == "rising":
            counts = (before <= level) & (seen > level)
        elif self._trigger.kind == "falling":
            counts = (before >= level) & (seen < level)
        elif self._trigger.kind == "above":
            counts = seen > level
        elif self._trigger.kind == "below":
            counts = seen < level
        elif self._trigger.kind == "fault":
            counts = (before == 0) & (seen != 0)
        elif self._trigger.kind == "command":
            counts[0] = self.command
        self.command = False
        ready = max(0, self.pre - self._taken)
        self._before = float(seen[-1])
        self._taken += len(seen)
        if self.manual:
            counts[ready : ready + 1] = True
        places = np.flatnonzero(counts[ready:])
        return ready + int(places[0]) if len(places) else None
