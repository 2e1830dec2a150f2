"""The judgement of a fault campaign's runs: their result, and the checks of the gates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...drive.simulated import SimulatedDrive
from ...plant.legs import HIGH, LOW, OFF

TRIP_FLAG = 4


@dataclass
class Result:
    """One run. `error` is empty if the drive did everything that it must."""

    fault: str
    state: str
    scheme: str
    setup: str
    cause: str = ""
    periods: int = 0  #: from injection to gates off, or to the trip state
    error: str = ""


def sign(rng: np.random.Generator) -> int:
    return int(rng.choice([-1, 1]))


def gates_off(sim: SimulatedDrive) -> bool:
    m, words = sim.controller.map, sim.controller.register_words()
    flags = [int(words[m.epwm + leg * m.stride + m.tzflg]) & TRIP_FLAG for leg in range(6)]
    return all(flags)


def shoot_through(sim: SimulatedDrive, legs: np.ndarray) -> str:
    """Check the dead time of the edges since the log began. `legs` has the states before them and
    is updated."""
    clock_Hz = float(sim.controller.map.pwm_clock_Hz)
    dead = math.ceil(sim.setup["inverter.dead_time_us"] * 1e-6 * clock_Hz - 0.01)
    if sim.gate_mistake:
        return sim.gate_mistake
    since = np.full(6, -(10**9))
    for count, leg, state in sim.edges:
        before = legs[leg]
        if {before, state} == {LOW, HIGH}:
            return f"leg {leg} changed over without dead time"
        if before == OFF and state != OFF and 0 <= count - since[leg] < dead:
            return f"leg {leg}: {count - since[leg]} counts of dead time"
        if state == OFF:
            since[leg] = count
        legs[leg] = state
    return ""
