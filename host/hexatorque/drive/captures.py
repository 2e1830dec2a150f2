"""Captures: their triggers, and a capture in a simulation that works as on a board."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..firmware import channels, ffi, lib
from ..recording.journal import TICK_HZ
from ..recording.recording import DECIMATION, FIRST_TICK, TRIGGER, Recording, RecordingError
from ..setups.values import SetupError

_KIND = "HT_TRIGGER_"
#: Kinds of trigger. The index is the firmware's number.
TRIGGERS = tuple(
    name.removeprefix(_KIND).lower()
    for name in sorted(
        filter(lambda n: n.startswith(_KIND), dir(lib)), key=lambda n: getattr(lib, n)
    )
)


#: Largest trigger level: ARM carries it as a float32.
FLOAT32_MOST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Trigger:
    kind: str
    channel: str = ""
    level: float = 0.0

    @staticmethod
    def parse(text: str) -> Trigger:
        """A trigger from text: `manual`, `fault`, `command`, or KIND:CHANNEL:LEVEL such as
        `rising:torque_Nm:5`, where KIND is rising, falling, above or below. RecordingError for
        any other text."""
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
    """Raise RecordingError if one of these is out of range."""
    if samples < 1:
        raise RecordingError(f"samples = {samples}: 1 or more are needed")
    if not 0 <= pre < samples:
        raise RecordingError(f"pre = {pre}: allowed range is 0 .. {samples - 1}")
    if not 1 <= prescaler <= 0xFFFF:
        raise RecordingError(f"prescaler = {prescaler}: allowed range is 1 .. 65535")


def metadata(trigger_tick: int, pre: int, prescaler: int, f_isr_Hz: float) -> dict:
    """Metadata of a complete capture. Its trigger is at time 0, and no sample is missing."""
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
    """One capture in a simulation. It runs the firmware's code (firmware/link/ht_burst.c) on
    every row of the simulation's telemetry. docs/protocol.md gives the rules."""

    def __init__(
        self, columns: list[int], samples: int, pre: int, prescaler: int, trigger: Trigger, on: int
    ) -> None:
        """columns: the columns of the rows that are kept; on: the column that the trigger
        compares with its level."""
        check(samples, pre, prescaler)
        self.samples, self.pre, self.prescaler = samples, pre, prescaler
        self._memory = ffi.new("uint32_t[]", samples * len(columns))
        self._burst = ffi.new("ht_burst *")
        lib.ht_burst_init(self._burst, self._memory, len(self._memory))
        setup = ffi.new("ht_burst_setup *")
        most = len(setup.id)
        if not 1 <= len(columns) <= most:
            raise RecordingError(f"{len(columns)} channels: allowed range is 1 .. {most}")
        setup.n, setup.id[0 : len(columns)] = len(columns), columns
        setup.samples, setup.before, setup.prescaler = samples, pre, prescaler
        setup.trigger, setup.channel, setup.level = trigger.number, on, trigger.level
        answer = lib.ht_burst_arm(self._burst, setup)
        assert answer == lib.HT_BURST_ARMED, answer
        self._on = on
        self.names: tuple[str, ...] = ()

    @classmethod
    def named(
        cls, names: Sequence[str], samples: int, pre: int, trigger: str, prescaler: int
    ) -> Burst:
        """A capture of the channels of these names. SetupError if the firmware has none of one."""
        what = Trigger.parse(trigger)
        on = {"fault": "faults"}.get(what.kind, what.channel or "state")
        known = [name for name, _ in channels()]
        for name in (*names, on):
            if name not in known:
                raise SetupError(f"no channel {name!r}; there are {', '.join(known)}")
        columns = [known.index(name) for name in names]
        burst = cls(columns, samples, pre, prescaler, what, known.index(on))
        burst.names = tuple(names)
        return burst

    def trigger(self) -> None:
        """Trigger, but not before `pre` samples are there."""
        self._burst.manual = 1

    def commanded(self) -> None:
        """Note that a command was carried out. The trigger `command` fires at the next sample."""
        self._burst.command = 1

    @property
    def complete(self) -> bool:
        return self._burst.state >= lib.HT_BURST_SUMMING

    @property
    def tick(self) -> int | None:
        """Tick of the trigger; None before it."""
        return self._burst.tick if self._burst.state >= lib.HT_BURST_TRIGGERED else None

    @property
    def values(self) -> np.ndarray:
        """(samples, channels) float32 of a complete capture, oldest sample first."""
        memory = np.frombuffer(ffi.buffer(self._memory), np.float32)
        return np.roll(memory, -self._burst.at).reshape(self.samples, -1)

    def recording(self, meta: dict, period_s: float) -> Recording:
        """The complete capture."""
        assert self.tick is not None
        values, units = self.values, dict(channels())
        data = {
            name: np.ascontiguousarray(values[:, column]) for column, name in enumerate(self.names)
        }
        rate_Hz = 1 / (period_s * self.prescaler)
        return Recording(
            rate_Hz,
            data,
            {name: units[name] for name in self.names},
            {**meta, **metadata(self.tick, self.pre, self.prescaler, 1 / period_s)},
            -self.pre / rate_Hz,
        )

    def feed(self, rows: np.ndarray, tick: int) -> None:
        """Add rows, (n, all channels) float32: one for each fast interrupt, from `tick` on."""
        rows = np.ascontiguousarray(rows, np.float32)
        pointer = ffi.cast("float *", rows.ctypes.data)
        n, width = rows.shape
        lib.ht_burst_rows(self._burst, pointer, n, width, tick % 2**32, self._on)
