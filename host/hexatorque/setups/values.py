"""The parts of a set-up: its values, its profile, and the error about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from ..errors import InputError


class SetupError(InputError):
    """A set-up or scenario that cannot be used. One line for each mistake: the key, its value,
    what is allowed."""


@dataclass(frozen=True)
class Value:
    """A value that a file gave. value: a number in the key's unit, a choice's name, or six numbers;
    tag: where it is from (`setups.TAGS`, or "user"); note: the place there, or the reason."""

    value: Any
    tag: str
    note: str = ""


@dataclass(frozen=True)
class Profile:
    """References, loads and events over time. Steps are (time in s, value), and times ascend.

    duration_s: simulated time; speed_rpm: steps of the speed reference in r/min; load_Nm: of the
    load torque in N m; vdc_V: of the dc-link voltage in V; set: (time in s, controller parameter,
    value); command: (time in s, stop or start); broken: (time in s, phase, what breaks: none,
    open, blocked, upper or lower); samples_per_period: samples of the plant in a control period.
    """

    duration_s: float = 1.0
    speed_rpm: tuple[tuple[float, float], ...] = ()
    load_Nm: tuple[tuple[float, float], ...] = ()
    vdc_V: tuple[tuple[float, float], ...] = ()
    set: tuple[tuple[float, str, Any], ...] = ()
    command: tuple[tuple[float, str], ...] = ()
    broken: tuple[tuple[float, str, str], ...] = ()
    samples_per_period: int = 4

    @property
    def steps(self) -> dict[str, tuple[tuple[float, Any], ...]]:
        """The steps (time in s, value) of each quantity that changes, by name."""
        ordered = {"speed_rpm": self.speed_rpm, "load_Nm": self.load_Nm, "vdc_V": self.vdc_V}
        return {
            **ordered,
            "set": tuple((time_s, value) for time_s, _, value in self.set),
            "command": self.command,
            "broken": tuple((time_s, kind) for time_s, _, kind in self.broken),
        }

    @property
    def starts_later(self) -> bool:
        """Whether the first start is a command."""
        return bool(self.command) and self.command[0][1] == "start"

    def too_late(self) -> list[str]:
        """A line for each quantity with a step at or after the end."""
        lines = []
        for name, steps in self.steps.items():
            late = [time_s for time_s, _ in steps if time_s >= self.duration_s]
            if late:
                lines.append(
                    f"profile.{name}: step at {late[0]:g} s: the profile ends at "
                    f"duration_s = {self.duration_s:g} s"
                )
        return lines


class Values(Protocol):
    """A set-up, as far as the controller's parameters follow from it."""

    @property
    def values(self) -> dict[str, dict[str, Value]]: ...

    @property
    def profile(self) -> Profile: ...

    @property
    def defaults(self) -> str: ...

    def __getitem__(self, path: str) -> Any: ...

    def machine_values(self) -> dict[str, Any]: ...
