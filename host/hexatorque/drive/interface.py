"""The methods that every drive has, simulated or real.

`simulated.SimulatedDrive` and `board.BoardDrive` both have them, so one script works with both:

def bench(drive):
    drive.set_many({"scheme": "ddr", "speed_ref_rpm": 0})
    drive.start()
    drive.run(0.6)
    drive.set("speed_ref_rpm", 400)
    drive.run(1.0)
    drive.check()
    return drive.take()
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from itertools import groupby
from typing import Any, Self, SupportsFloat

from .. import given
from ..errors import HexatorqueError, InputError
from ..firmware import FAULT, IDLE, Parameter, Snapshot, State
from ..recording.recording import Recording
from ..setups.values import Profile, SetupError
from .trips import WAY_TO_SPEED, Trip, details, too_fast

#: Called with the number of seconds that have just passed.
Progress = Callable[[float], None]


class DriveFault(HexatorqueError, RuntimeError):
    """The drive tripped. causes: names of the faults; time_s: instant of the trip, in s since the
    drive was opened; trip: what the firmware saved then (`Trip`), or None."""

    def __init__(self, causes: list[str], time_s: float, trip: Trip | None = None) -> None:
        text = f"drive tripped at {time_s:.4f} s: {', '.join(causes)}"
        super().__init__(str(trip) if trip else text)
        self.causes = causes
        self.time_s = trip.time_s if trip else time_s
        self.trip = trip


def finite(value: object) -> float | None:
    """The number that a value is, also as text; None if it is no number, or not a finite one."""
    value = given.numeric(value)
    if not isinstance(value, SupportsFloat):
        return None
    try:
        number = float(value)
    except (TypeError, OverflowError):  # an array, or a whole number of hundreds of digits
        return None
    return number if math.isfinite(number) else None


def seconds(duration_s: object, rounding_s: float = 0.0) -> float:
    """A duration. InputError if it is no number, or further below 0 than rounding explains."""
    number = finite(duration_s)
    if number is None or number < -rounding_s:
        raise InputError(f"duration_s = {duration_s}: a time of 0 s or more is needed")
    return max(0.0, number)


class DriveVerbs(ABC):
    """The functions of every drive, simulated or on a board.

    taken_tick: count of fast interrupts at which the latest `set_many` was taken over.
    """

    @property
    @abstractmethod
    def params(self) -> Mapping[str, Parameter]:
        """The parameters by name. Each has `unit`, `min`, `max`, `choices`, `help`, and `live`:
        whether it may change while the drive runs."""

    @property
    @abstractmethod
    def channels(self) -> tuple[tuple[str, str], ...]:
        """(name, unit) of each quantity that the firmware measures or estimates. A recording has
        them under these names."""

    @property
    @abstractmethod
    def condition(self) -> State:
        """The state: its `name`, and whether the drive is `at_work`, its `gates_on`, and whether
        it `controls` torque and flux."""

    @property
    def state(self) -> str:
        """The state's name. All are in firmware/app/ht_states.def."""
        return self.condition.name

    @property
    @abstractmethod
    def faults(self) -> list[str]:
        """Names of the latched faults; empty if the drive has not tripped."""

    @property
    @abstractmethod
    def snapshot(self) -> Snapshot | None:
        """The values that the firmware saved at the latest fault, by name: six currents `i_A`,
        `vdc_V`, the flux `psi_Wb` (alpha, beta), `torque_Nm`, `speed_rpm` and others; None if there
        was none."""

    taken_tick: int = 0

    @property
    @abstractmethod
    def time_s(self) -> float:
        """Seconds since the drive was opened."""

    @abstractmethod
    def get(self, name: str) -> str | float:
        """The value of a parameter: a number in its unit, or the name of a choice. The name may be
        a set-up's key, controller.NAME. InputError names the nearest one if there is none."""

    @abstractmethod
    def set_many(self, values: Mapping[str, object]) -> None:
        """Set several values, name -> value, as `set` does. If one is refused, none changes."""

    def set(self, name: str, value: object) -> None:
        """Set one value: a parameter, such as `set("speed_ref_rpm", 400)`; `params` names them, and
        a set-up's key controller.NAME is the same. A simulated drive also takes `load_Nm` and
        `vdc_V` of its plant. InputError names the allowed range if the value is refused."""
        self.set_many({name: value})

    @abstractmethod
    def start(self) -> None:
        """Start the drive: it measures its sensors' offsets, builds up the flux, and then follows
        `speed_ref_rpm`. An error says why if the drive is not idle, or turns too fast."""

    @abstractmethod
    def stop(self) -> None:
        """Take the gates off: the machine coasts, and the state becomes idle."""

    @abstractmethod
    def clear(self) -> None:
        """Clear the latched faults, after which the drive can start again. An error says why if
        their cause is still there."""

    @abstractmethod
    def run(self, duration_s: float, record: bool = True, progress: Progress | None = None) -> None:
        """Let `duration_s` pass, and record unless `record` is False. `progress` is called with the
        seconds that have just passed. InputError if `duration_s` is below 0 or no number."""

    @abstractmethod
    def discard(self) -> None:
        """Delete the samples recorded so far."""

    @abstractmethod
    def take(self) -> Recording:
        """Return the samples recorded since the last `take`, `discard` or unrecorded run."""

    @abstractmethod
    def arm(
        self,
        channels: Sequence[str],
        samples: int,
        pre: int = 0,
        trigger: str = "manual",
        prescaler: int = 1,
    ) -> None:
        """Arm a capture of the firmware's channels: `samples` samples, one every `prescaler`
        fast interrupts, `pre` of them before the trigger. The trigger is `manual`, `fault`,
        `command`, or KIND:CHANNEL:LEVEL such as `rising:torque_Nm:5`, where KIND is rising,
        falling, above or below. An error names a channel that there is not, or what is too much."""

    @abstractmethod
    def trigger(self) -> None:
        """Trigger the armed capture now, whatever its own trigger is."""

    @abstractmethod
    def cancel(self) -> None:
        """Disarm the capture."""

    @abstractmethod
    def captured(
        self,
        timeout_s: float | None = None,
        now: bool = False,
        full: Callable[[], None] | None = None,
    ) -> Recording:
        """Let time pass until the armed capture is complete, and return it; its trigger is at
        time 0. `now`: trigger it as soon as its `pre` samples are there. `full` is called when all
        samples are taken: from a board they come in a second or more. An error says so if none is
        armed, or if it is not complete within `timeout_s` (default: no limit)."""

    def capture(
        self,
        channels: Sequence[str],
        samples: int,
        pre: int = 0,
        trigger: str = "manual",
        prescaler: int = 1,
        timeout_s: float | None = None,
    ) -> Recording:
        """`arm`, then `captured`. A manual trigger is sent as soon as `pre` samples are there."""
        self.arm(channels, samples, pre, trigger, prescaler)
        return self.captured(timeout_s, trigger == "manual")

    @abstractmethod
    def close(self) -> None:
        """Close the drive. A drive that was started here stops."""

    def check(self) -> None:
        """Nothing if the drive is well; DriveFault if it has tripped."""
        if self.state == FAULT:
            raise DriveFault(self.faults, self.time_s, self.trip)

    @property
    def trip(self) -> Trip | None:
        """Why the drive tripped; None if it has not, or if the firmware saved nothing."""
        faults, snapshot = self.faults, self.snapshot
        if not faults or snapshot is None:
            return None
        return Trip(
            self._time_of_tick(snapshot["tick"]),
            snapshot["state"],
            tuple(faults),
            details(snapshot, lambda name: self.params[name].parse(self.get(name))),
        )

    @abstractmethod
    def _time_of_tick(self, tick: int) -> float:
        """`time_s` of the fast interrupt with this number."""

    def run_profile(
        self, profile: Profile, progress: Progress | None = None, record: bool = True
    ) -> None:
        """Start the drive and follow a profile, whose time 0 is now. If its first command is a
        start, the drive waits for it. `progress` and `record` are as in `run`. An error names what
        of the profile this drive cannot do."""
        if not isinstance(profile, Profile):
            raise InputError(
                f"{profile!r}: a profile is needed, such as load('examples/reversal.toml').profile"
            )
        events: list[tuple[float, str, object]] = []
        events += [(t, "speed_ref_rpm", v) for t, v in profile.speed_rpm]
        events += [(t, "load_Nm", v) for t, v in profile.load_Nm]
        events += [(t, "vdc_V", v) for t, v in profile.vdc_V]
        events += [(t, name, v) for t, name, v in profile.set]
        named = {name for _, name, _ in events}
        events += [(t, "", verb) for t, verb in profile.command]
        events.sort(key=lambda event: event[0])
        if lines := profile.too_late():
            raise SetupError("\n".join(lines))
        self._can_follow(named, bool(profile.broken))
        self._refuse_over_speed(events)
        begin_s = self.time_s
        if self.state == IDLE and not profile.starts_later:
            self.start()
        for time_s, phase, kind in profile.broken:
            self.break_leg(phase, kind, time_s)
        for time_s, name, value in events:
            self.run(max(0.0, time_s - (self.time_s - begin_s)), record, progress)
            if name:
                self.set(name, value)
            elif value == "stop":
                self.stop()
            else:
                self.start()
        self.run(max(0.0, profile.duration_s - (self.time_s - begin_s)), record, progress)

    def _refuse_over_speed(self, events: Sequence[tuple[float, str, object]]) -> None:
        """SetupError if the drive would trip before it has one of its speed references."""
        way: dict[str, Any] = {name: self.get(name) for name in WAY_TO_SPEED}
        for time_s, together in groupby([(0.0, "", None), *events], key=lambda event: event[0]):
            for _, name, value in together:
                if name in way:
                    row = self.params[name]
                    way[name] = row.show(row.parse(value))
            if too_fast(*way.values()):
                asked_rpm, trip_rpm = way["speed_ref_rpm"], way["speed_trip_rpm"]
                raise SetupError(
                    f"profile: speed reference {asked_rpm:g} r/min at {time_s:g} s: allowed range "
                    f"is -{trip_rpm:g} .. {trip_rpm:g} r/min, both excluded: there the drive "
                    f"trips (speed_trip_rpm{self._why_so_low()})"
                )

    def _why_so_low(self) -> str:
        """Magnets may be why the speed trip is no higher."""
        wanted = {"machine": "magnet", "trip_state": "gates-off"}
        if any(n not in self.params or self.get(n) != value for n, value in wanted.items()):
            return ""
        return ": above it the magnets would rectify without gates, unless trip_state permits it"

    def break_leg(self, phase: str, kind: str, after_s: float = 0.0) -> None:
        """Break the leg of a phase in `after_s` seconds. Only a simulated drive can."""
        raise SetupError("break_leg: only a simulated drive can break a leg")

    def _can_follow(self, names: AbstractSet[str], breaks: bool) -> None:  # noqa: B027 (most can)
        """Raise an error if this drive cannot set one of a profile's names, or cannot break."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
