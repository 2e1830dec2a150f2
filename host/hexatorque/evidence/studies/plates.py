"""Machines of all sizes from complete plates, for studies whose subject is not the data that a
plate lacks (`machines` is about that).

Each machine is drawn at random, with its circuit. Its plate, with the power factor, and its inertia
are told to `hexatorque new`; the pull-out torque and the shares of the losses, which no plate
states, are assumed there and differ from the machine's. The drive with the derived controller then
has the true machine in front of it.

The machine with the number n is always the same one.
"""

from __future__ import annotations

import math
import random
from dataclasses import replace

from ... import setups
from ...setups import Setup, SetupError, new
from ...setups.keys import TIMING_OWNS
from ...setups.nameplate import FRICTION, IRON, Assumed, Circuit, Nameplate, circuit_of

MACHINES = 200
POWER_KW = (0.37, 250.0)
#: Pull-out torque in rated torques.
PULL_OUT = Assumed(2.8, 2.2, 3.5)
#: Line-to-line voltages: a small machine is not wound for the higher ones, a large one not for
#: the lowest.
VOLTAGES_V = (150.0, 230.0, 400.0, 480.0)
#: A set of a large machine takes this current at most; its voltage is raised until it does.
MOST_A = 400.0


def machine(number: int) -> tuple[Nameplate, Circuit, float]:
    """The plate of a machine, its true circuit, and its inertia."""
    draw = random.Random(number)

    def between(of: Assumed) -> float:
        return draw.uniform(of.low, of.high)

    while True:
        low, high = map(math.log, POWER_KW)
        power_kW = math.exp(draw.uniform(low, high))
        size = (math.log(power_kW) - low) / (high - low)
        pole_pairs, frequency_Hz = draw.randint(1, 4), draw.choice((50.0, 60.0))
        efficiency = 1 - draw.uniform(0.9, 1.1) * 0.28 * math.exp(-2 * size)
        factor = draw.uniform(-0.04, 0.04) + 0.74 + 0.14 * size
        slip = draw.uniform(0.25, 0.4) * (1 - efficiency)
        voltages = [v for v in VOLTAGES_V if _current_A(power_kW, v, efficiency * factor) < MOST_A]
        voltage_V = draw.choice(voltages)
        plate = Nameplate(
            power_kW,
            voltage_V,
            _current_A(power_kW, voltage_V, efficiency * factor),
            frequency_Hz,
            60 * frequency_Hz / pole_pairs * (1 - slip),
            pole_pairs,
            factor,
            efficiency,
            pull_out=between(PULL_OUT),
            iron=between(IRON),
            friction=between(FRICTION),
        )
        # Rotor and load: standard motors have 0.003 kg m2 at 1 kW and 4 poles.
        usual_kgm2 = 0.006 * power_kW**1.3 * (pole_pairs / 2) ** 1.5
        inertia_kgm2 = usual_kgm2 * 10 ** draw.uniform(-1, 1)
        try:
            circuit = circuit_of(plate)
            circuit_of(replace(plate, pull_out=PULL_OUT.value))
        except SetupError:  # no machine has such a plate
            continue
        return plate, circuit, inertia_kgm2


def _current_A(power_kW: float, voltage_V: float, product: float) -> float:
    return 1e3 * power_kW / (2 * math.sqrt(3) * voltage_V * product)


def drive(plate: Nameplate, circuit: Circuit, inertia_kgm2: float) -> Setup:
    """The drive that was designed from the plate, in front of the true machine. The inertia is
    known: nothing but the load decides it."""
    text = plate.told(power_factor=plate.power_factor, inertia_kgm2=inertia_kgm2)
    designed = setups.parse(new.from_nameplate(text, "machine"), "machine")
    values = setups.parameters(designed)
    believed = {f"controller__{n}": v for n, v in values.items() if n not in TIMING_OWNS}
    names = ("rs_ohm", "rr_ohm", "lls_H", "llr_H", "lm_H")
    true = {f"machine__{name}": getattr(circuit, name) for name in names}
    return designed.changed(**believed, **true, machine__lxy_H=circuit.lls_H)
