"""The steps of commissioning for each kind of machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from ..drive.interface import DriveVerbs
from .excitation import CommissioningError, Limits

#: Limit of the tests at standstill with magnets, over `build_current_A`.
OVER_BUILD = 1.5


class Kind(NamedTuple):
    name: str  #: the parameter `machine`
    steps: Mapping[str, str]  #: name -> its work in words, in their order
    needs: Mapping[str, tuple[str, ...]]  #: step -> the steps that it needs; they run as well
    asks: tuple[str, ...]  #: steps before which a user must have agreed that the shaft turns
    whole: str  #: the step from which on a set-up can be written
    loads: tuple[str, ...] = ()  #: parameters that it loads and that only the gates off let change

    def with_needs(self, steps: Sequence[str]) -> list[str]:
        """The steps and those that they need, in their order. CommissioningError names one that
        this kind does not have."""
        for step in steps:
            if step not in self.steps:
                raise CommissioningError(
                    f"no step {step!r} for a machine of the kind {self.name}: choose from "
                    f"{', '.join(self.steps)}"
                )
        wanted = {need for step in steps for need in (step, *self.needs[step])}
        return [step for step in self.steps if step in wanted]


_WIRING = {"wiring": "sensors, motor leads and the angle between the sets"}
_RESISTANCE = {"resistance": "R_s of each phase, dead time and device drops"}
_MECHANICS = {"mechanics": "inertia, friction and load: the drive accelerates, brakes, then coasts"}
_STANDSTILL = ("wiring", "resistance", "inductance")
INDUCTION = Kind(
    "induction",
    {
        **_WIRING,
        **_RESISTANCE,
        "inductance": "sigma L_s, L_xy",
        "encoder": "its direction and counts: the shaft turns slowly",
        "rotor": "R_r and L_m at standstill",
        "magnetisation": "L_m at five fluxes: the drive runs without load",
        **_MECHANICS,
    },
    {
        "wiring": (),
        "resistance": ("wiring",),
        "inductance": ("wiring", "resistance"),
        "encoder": ("wiring", "resistance"),
        "rotor": _STANDSTILL,
        "magnetisation": (*_STANDSTILL, "encoder", "rotor"),
        "mechanics": (*_STANDSTILL, "encoder", "rotor"),
    },
    (),
    "rotor",
)
MAGNET = Kind(
    "magnet",
    {
        **_WIRING,
        **_RESISTANCE,
        "alignment": "the encoder's direction, counts and zero: direct current turns the shaft",
        "inductance": "L_d, L_q, L_xy",
        "magnets": "their flux and its harmonics: the drive runs without load",
        **_MECHANICS,
    },
    {
        "wiring": (),
        "resistance": ("wiring",),
        "alignment": ("wiring", "resistance"),
        "inductance": ("wiring", "resistance", "alignment"),
        "magnets": (*_STANDSTILL, "alignment"),
        "mechanics": (*_STANDSTILL, "alignment", "magnets"),
    },
    ("alignment",),
    "magnets",
    ("rotor_zero_deg",),
)
KINDS = (INDUCTION, MAGNET)


def kind_of(drive: DriveVerbs) -> Kind:
    """The drive's, by its parameters."""
    name = str(drive.get("machine")) if "machine" in drive.params else INDUCTION.name
    return next(kind for kind in KINDS if kind.name == name)


def at_standstill(drive: DriveVerbs, limits: Limits) -> Limits:
    """The limits of the tests at standstill. With magnets the running drive's ripple may need a
    current that would turn the shaft there: the x-y currents act on the harmonics of its flux."""
    if kind_of(drive) is not MAGNET:
        return limits
    most_A = OVER_BUILD * float(drive.get("build_current_A"))
    return replace(limits, current_A=min(limits.current_A, most_A))
