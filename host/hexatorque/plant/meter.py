"""Energies that the drive turns into heat and gives to the shaft, integrated beside its state.

Each Runge-Kutta step adds the powers at its own stages, with the voltages that the stage has found.
In every stage the powers of legs, windings and shaft add up to zero, so the balance of energy
closes as exactly as the state is computed, with its fourth order. A rule over the steps' ends (a
straight line between two currents, a threshold without its knee) leaves 2e-5 of the energy open.

The link's own energies are states of the link (link.py), the brake's follows from the angle
(brake.py), a commutation's from the capacitor (junctions.py).
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled
from .load import load_torque
from .machine import common_part, current_with, losses

#: Where each integral is: of the squares of the currents on the six legs and of the voltages that
#: drive the rotor's currents, of the powers of iron, friction and load (without the holding brake),
#: and of the conduction of each device, (6, 4) on the legs.
LEG_A2S, ROTOR_V2S, IRON_J, FRICTION_J, LOAD_J, DEVICE_J, INTEGRALS = 0, 6, 7, 8, 9, 10, 34

METER = np.dtype(
    [
        ("on", "i8"),  # 0: nothing is integrated
        ("x", "f8", (INTEGRALS,)),  # the integrals
        ("total", "f8", (INTEGRALS,)),  # sum of the latest step's powers,
        ("share_s", "f8"),  # and what it is to be multiplied by
        ("device", "i8", (6,)),  # which device of each leg carries its current,
        ("drop_V", "f8", (6,)),  # and what it takes of the voltage, positive with the current
        ("rotor_V", "f8", (2,)),
    ]
)


@compiled
def begin_meter(meter):
    """Begin a step."""
    for r in range(INTEGRALS):
        meter.total[r] = 0.0


@compiled
def add_powers(meter, m, load, y, weight):
    """Add the powers of a state, whose `device` and `drop_V` are known."""
    total = meter.total
    common = common_part(m, y)
    for leg in range(6):
        i = current_with(m, y, common, leg)
        total[LEG_A2S + leg] += weight * (i * i)
        total[DEVICE_J + 4 * leg + meter.device[leg]] += weight * (meter.drop_V[leg] * i)
    total[IRON_J] += weight * losses(m, y, meter.rotor_V)
    for axis in range(2):
        total[ROTOR_V2S] += weight * (meter.rotor_V[axis] * meter.rotor_V[axis])
    omega = y[6]
    total[FRICTION_J] += weight * (m.viscous * omega * omega)
    total[LOAD_J] += weight * ((load_torque(load, omega) - load.braking_Nm) * omega)


@compiled
def accept_meter(meter):
    """The step is taken."""
    for r in range(INTEGRALS):
        meter.x[r] += meter.share_s * meter.total[r]
