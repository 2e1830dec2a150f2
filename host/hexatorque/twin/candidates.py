"""The parameters that may differ between the bench and its set-up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..drive.simulated import SimulatedDrive
from ..experiments.prepare import Prepare, other_dead_time
from ..plant.machines import constants_of, parameters_of
from ..plant.machines.differing import PERCENT, Differing
from ..plant.vsd import PHASES
from ..setups import Setup
from ..setups.keys import KEYS, MOST_NM


@dataclass(frozen=True)
class Candidate:
    """One parameter. A change is a share of its value (unit %), or a number of its own unit.

    keys: the set-up's, which the change concerns; step: change with which the simulation is tried,
    large against the noise; low, high: changes that can be meant; apply: the changed set-up;
    prepare: a change of the simulated drive instead; vdc: true dc-link voltage over the
    measured one."""

    name: str
    keys: tuple[str, ...]
    unit: str
    step: float
    low: float
    high: float
    apply: Callable[[Setup, float], Setup] = lambda setup, change: setup
    prepare: Callable[[float], Prepare] | None = None
    vdc: Callable[[float], float] = lambda change: 1.0
    #: The rest only changes what torque the recorded speed needs.
    shaft_only: bool = False
    #: The phases whose probes of an oscilloscope are meant.
    probes: tuple[str, ...] = ()
    #: The change is added to the torque that the recorded speed needs.
    adds_torque: bool = False

    def shown(self, change: float, sign: bool = True) -> str:
        value = 100 * change if self.unit == PERCENT else change
        return f"{value:{'+' if sign else ''}.3g} {self.unit}".strip()

    @property
    def si_unit(self) -> str:
        return "1" if self.unit in (PERCENT, "") else self.unit


def _path(key: str) -> str:
    return key.replace(".", "__")


def _of_machine(model: str, one: Differing) -> Candidate:
    keys = tuple(f"machine.{key}" for key in one.keys)
    followers = [f"machine.{key}" for key in constants_of(model) if KEYS["machine"][key].follows]

    def changed(value: Any, change: float) -> Any:
        if one.place is None:
            return value * (1 + change) if one.unit == PERCENT else value + change
        return [v + change * (n == one.place) for n, v in enumerate(value)]

    def apply(setup: Setup, change: float) -> Setup:
        # What follows another key stays where it is.
        values = {key: setup[key] for key in followers}
        values |= {key: changed(setup[key], change) for key in keys}
        return setup.changed(**{_path(key): value for key, value in values.items()})

    return Candidate(one.name, keys, one.unit, one.step, one.low, one.high, apply)


def _drops(setup: Setup, change: float) -> Setup:
    keys = ("inverter.v_switch_V", "inverter.v_diode_V")
    return setup.changed(**{_path(key): max(0.0, setup[key] + change) for key in keys})


def _gain(*legs: int) -> Callable[[Setup, float], Setup]:
    def apply(setup: Setup, change: float) -> Setup:
        gains: Any = np.array(setup["sensors.i_gain"], float)
        gains[list(legs)] *= 1 + change
        return setup.changed(sensors__i_gain=gains.tolist())

    return apply


def _vdc_gain(change: float) -> Prepare:
    def prepare(sim: SimulatedDrive) -> None:
        sim.sensors.v_counts_per_V *= 1 + change

    return prepare


#: With every kind of machine.
COMMON: tuple[Candidate, ...] = (
    Candidate(
        "dead time", ("inverter.dead_time_us",), "us", 0.5, -3.0, 5.0, prepare=other_dead_time
    ),
    Candidate(
        "device drops", ("inverter.v_switch_V", "inverter.v_diode_V"), "V", 1.0, -5.0, 10.0, _drops
    ),
    Candidate(
        "V_dc sensor's gain", ("sensors.vdc_full_V",), PERCENT, 0.03, -0.3, 0.3,
        prepare=_vdc_gain, vdc=lambda change: 1 / (1 + change),
    ),
    Candidate(
        "gain of all current sensors", ("sensors.i_gain",), PERCENT, 0.08, -0.3, 0.3,
        _gain(*range(6)),
    ),
    *(
        Candidate(f"gain of current sensor {phase}", ("sensors.i_gain",), PERCENT, 0.03, -0.3, 0.3,
                  _gain(leg))
        for leg, phase in enumerate(PHASES)
    ),
    Candidate("J", ("machine.inertia_kgm2",), PERCENT, 0.2, -0.9, 9.0, shaft_only=True),
    Candidate("friction", ("machine.viscous_Nms",), "N m s", 1e-3, -1e3, 1e3, shaft_only=True),
    Candidate("load", ("load",), "N m", 1.0, -MOST_NM, MOST_NM, shaft_only=True),
)  # fmt: skip
#: Of an oscilloscope.
PROBES: tuple[Candidate, ...] = tuple(
    Candidate(name, (), PERCENT, 1.0, -0.999, 999.0, probes=phases)
    for name, phases in (
        ("scale of all current probes", PHASES),
        *((f"scale of current probe {phase}", (phase,)) for phase in PHASES),
    )
)


def _not_negative(one: Candidate, setup: Setup) -> Candidate:
    """Values of an inverter are 0 at least."""
    values = [setup[key] for key in one.keys if key.startswith("inverter.")]
    return replace(one, low=max(one.low, -max(values))) if values else one


def of_machine(model: str) -> tuple[Candidate, ...]:
    """The parameters of this kind of machine."""
    return tuple(_of_machine(model, one) for one in parameters_of(model).MAY_DIFFER)


def suitable(setup: Setup, outside: bool, torque_known: bool) -> tuple[Candidate, ...]:
    """The parameters that can differ from the set-up's. They depend on the instrument and on the
    recorded channels."""
    common = (_not_negative(one, setup) for one in COMMON)
    found = (*of_machine(setup["machine.model"]), *common, *(PROBES if outside else ()))
    if torque_known:
        return found
    # Without a torque reference, the simulated drive is asked for the load's torque.
    return tuple(
        replace(one, shaft_only=False, adds_torque=True) if one.name == "load" else one
        for one in found
    )
