"""What a set-up is made of: its values, its profile, and the error about them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from ..errors import InputError


class SetupError(InputError):
    """A set-up or scenario that cannot be used. One line for each mistake: the key, its value,
    what is allowed."""


@dataclass(frozen=True)
class Value:
    value: Any
    tag: str
    note: str = ""


@dataclass(frozen=True)
class Profile:
    """References and loads over time. Steps are (time s, value)."""

    duration_s: float = 1.0
    speed_rpm: tuple[tuple[float, float], ...] = ()
    load_Nm: tuple[tuple[float, float], ...] = ()
    vdc_V: tuple[tuple[float, float], ...] = ()
    set: tuple[tuple[float, str, Any], ...] = ()  #: (time, controller parameter, value)
    broken: tuple[tuple[float, str, str], ...] = ()  #: (time, phase, what breaks)
    samples_per_period: int = 4

    @property
    def steps(self) -> dict[str, tuple[tuple[float, Any], ...]]:
        """The steps (time s, value) of each quantity that changes."""
        ordered = {"speed_rpm": self.speed_rpm, "load_Nm": self.load_Nm, "vdc_V": self.vdc_V}
        return {
            **ordered,
            "set": tuple((time_s, value) for time_s, _, value in self.set),
            "broken": tuple((time_s, kind) for time_s, _, kind in self.broken),
        }

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
