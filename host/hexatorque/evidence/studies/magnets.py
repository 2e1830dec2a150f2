"""Machines with magnets, and drives that know no more of them than a data sheet: the truth and what
is told of it, for the study `machines`.

The truth. The machines that are built in; and machines drawn around them: each value off by
SCATTER, for another power, voltage, speed and number of poles. The sheet's values are those of
another specimen, cold and with little current: the true magnets are weaker or a little stronger,
the winding is warmer, L_d and L_q are off, L_xy is not told, and neither are the harmonics of the
voltage, the cogging torque and the angle at which the rotor rests.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from ... import setups
from ...plant.machines import DISPLACEMENTS_DEG
from ...plant.machines.magnet_parameters import Parameters
from ...setups import new
from ...setups.design import REACH_PU, USABLE, rpm
from .truths import SCATTER, Told, Truth, asked

WAY = "data sheet of magnets"
#: Drawn machines. In quick form this one; those from DRAWN on are the built-in ones.
DRAWN, QUICK = 100, (101,)

#: Over those of the built-in machine.
POWER, VOLTAGE, SPEED = (0.3, 3.0), (0.7, 1.5), (0.5, 2.0)
POLE_PAIRS = (2, 10)
#: True value over the sheet's: magnets lose 0.1 to 0.2 % of their flux per kelvin, and a sheet
#: allows 5 %; copper gains 0.39 % of its resistance per kelvin.
FLUX, RESISTANCE, INDUCTANCE = (0.92, 1.03), (0.95, 1.35), (0.87, 1.13)
INERTIA = (0.7, 1.3)
#: Largest share of harmonics 5, 7, 11, 13 in the voltage, and of the cogging torque in the rated
#: one.
HARMONICS, COGGING = (0.05, 0.03, 0.015, 0.01), 0.02
#: With a longer time constant of L_xy and R_s the machine is drawn with any winding: five periods
#: of 10 kHz, and what a sheet may be off. The laws of sets 0 or 60 degrees apart need them.
ANY_WINDING_S = 6.5e-4
#: The highest speed, over the one at which current flows once the gates are off. The drive trips
#: at 0.95 of that one by the sheet, and the speed rises when the load drops.
OF_CEILING = 0.75


@dataclass(frozen=True)
class WithMagnets(Truth):
    """sheet: what its sheet states as it is."""

    sheet: dict[str, float]


def numbers(quick: bool) -> Sequence[int]:
    return QUICK if quick else range(DRAWN + len(builtin()))


@cache
def builtin() -> list[setups.Setup]:
    every = map(setups.load, setups.builtin_names())
    return [setup for setup in every if setup["machine.model"] == "magnet"]


def truth(number: int) -> WithMagnets:
    draw, known = random.Random(f"magnets {number}"), builtin()

    def off(value: float) -> float:
        return value * math.exp(draw.gauss(0, SCATTER))

    one = known[number - DRAWN] if number >= DRAWN else draw.choice(known)
    of = Parameters(**one.machine_values())
    current_A = of.current_A(one["rated.torque_Nm"], of.psi_f_Wb) / math.sqrt(2)
    vdc_V = one["inverter.vdc_V"]
    machine: dict[str, Any] = {
        name: getattr(of, name)
        for name in ("pole_pairs", "rs_ohm", "ld_H", "lq_H", "lxy_H", "psi_f_Wb", "inertia_kgm2")
    }
    if number < DRAWN:
        power, voltage, speed = (
            math.exp(draw.uniform(*map(math.log, limits))) for limits in (POWER, VOLTAGE, SPEED)
        )
        current = power / voltage
        current_A, vdc_V = current * current_A, voltage * vdc_V
        machine["pole_pairs"] = draw.randint(*POLE_PAIRS)
        turns = speed * machine["pole_pairs"] / of.pole_pairs  # electrical speed
        saliency = max(1.0, off(of.lq_H / of.ld_H)) if of.lq_H > 1.05 * of.ld_H else 1.0
        ld_H = off(voltage / current / turns * of.ld_H)
        machine |= {
            "rs_ohm": off(voltage / current * of.rs_ohm),
            "ld_H": ld_H,
            "lq_H": saliency * ld_H,
            "lxy_H": draw.uniform(*new.LXY_OF_LD_RANGE) * ld_H,
            "psi_f_Wb": off(voltage / turns * of.psi_f_Wb),
            "inertia_kgm2": off(power / speed**2 * of.inertia_kgm2),
        }
    machine |= {
        "emf_share": [draw.uniform(0, most) for most in HARMONICS],
        "emf_deg": [draw.uniform(-180, 180) for _ in HARMONICS],
        "start_deg": draw.uniform(-180, 180),
    }
    true = Parameters(**machine)
    torque_Nm = true.torque_of_current_Nm(math.sqrt(2) * current_A, true.psi_f_Wb)
    machine["cogging_Nm"] = draw.uniform(0, COGGING) * torque_Nm
    turned = true.turned_rad_s(torque_Nm, math.inf, USABLE * REACH_PU * vdc_V)
    power_kW = 1e-3 * torque_Nm * turned / true.pole_pairs
    xy_s = new.LXY_OF_LD_RANGE[0] * machine["ld_H"] / machine["rs_ohm"]
    if number < DRAWN and xy_s > ANY_WINDING_S:
        machine["displacement_deg"] = random.Random(f"winding {number}").choice(DISPLACEMENTS_DEG)
    name = one.name if number >= DRAWN else f"{number}: like {one.name}"
    sheet = {"current_A": current_A, "vdc_V": vdc_V, "torque_Nm": torque_Nm}
    sheet["speed_rpm"] = rpm(turned / true.pole_pairs)
    return WithMagnets(name, power_kW, machine, draw, sheet)


def told(true: WithMagnets) -> Told:
    """SetupError if `hexatorque new` refuses it."""
    draw, machine = random.Random(true.draw.random()), true.machine

    def before(name: str, over: tuple[float, float]) -> float:
        return machine[name] / draw.uniform(*over)

    given = {
        **true.sheet,
        "poles": 2 * machine["pole_pairs"],
        "rs_ohm": before("rs_ohm", RESISTANCE),
        "ld_H": before("ld_H", INDUCTANCE),
        "inertia_kgm2": before("inertia_kgm2", INERTIA),
    }
    if machine["lq_H"] > 1.05 * machine["ld_H"]:
        given["lq_H"] = max(given["ld_H"], before("lq_H", INDUCTANCE))
    omega = machine["pole_pairs"] * 1000 * math.pi / 30
    given["ke_V"] = math.sqrt(1.5) * before("psi_f_Wb", FLUX) * omega
    text = ",".join(f"{name}={value:.4g}" for name, value in given.items())
    setup = setups.parse(new.from_magnets(text, "machine"), "machine")
    if "displacement_deg" in machine:
        # The scheme that drives every winding; `best` chooses again.
        setup = setup.with_scheme("db-dtfc", machine__displacement_deg=machine["displacement_deg"])
    speed_rpm, vdc_V = given["speed_rpm"], setup["inverter.vdc_V"]
    ceiling_rpm = Parameters(**setup.machine_values()).ceiling_rpm(vdc_V)
    fast = min(1.5, OF_CEILING * ceiling_rpm / speed_rpm)
    return asked(true, Told(setup, speed_rpm, given["torque_Nm"], fast))
