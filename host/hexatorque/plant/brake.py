"""A holding brake on the shaft: dry friction while it is closed.

It turns, and the brake takes `closed_Nm` against the motion, or it is held, as if its inertia were
infinite, until the other torques exceed the brake's. The brake follows the firmware's
output: it opens and closes with a delay each.

The torque is constant from step to step. A shaft whose speed passes zero within a step stops at the
step's end, and the energy of its motion becomes the brake's heat as well.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled
from .machine import derivative
from .pins import PIN

HOLDING = np.dtype(
    [
        ("torque_Nm", "f8"),  # 0: there is none
        ("open_s", "f8"),  # delays
        ("close_s", "f8"),
        ("inertia_kgm2", "f8"),  # of the free shaft
        ("pin", PIN),  # high: open
        ("told", "i8"),  # the pin
        ("told_s", "f8"),  # for how long
        ("closed_Nm", "f8"),  # the torque that it can hold now
        ("held", "i8"),  # whether the shaft is held
        ("angle_rad", "f8"),  # of the shaft at the latest step
        ("heat_J", "f8"),  # the energy that the brake has taken so far
    ]
)


@compiled
def _against(load, torque_Nm):
    """The load with this torque of the brake against the motion."""
    load.braking_Nm = torque_Nm
    load.constant_Nm = load.hanging_Nm + torque_Nm


@compiled
def _let_go(m, load):
    load.brake.held = 0
    m.inertia = load.brake.inertia_kgm2
    _against(load, 0.0)


@compiled
def _grip(inv, m, load, y):
    """A shaft that stands: the brake holds it, or it slips where the other torques push it."""
    b = load.brake
    _let_go(m, load)
    derivative(m, load, y, inv.no_v, inv.k)
    net_Nm = inv.k[6] * m.inertia
    if abs(net_Nm) > b.closed_Nm:
        _against(load, np.copysign(b.closed_Nm, net_Nm))
    else:
        b.held = 1
        m.inertia = np.inf


@compiled
def settle_brake(inv, m, load, y):
    """After a step that ends with the state y."""
    b = load.brake
    if b.closed_Nm == 0.0:
        return
    b.heat_J += load.braking_Nm * (y[7] - b.angle_rad)
    b.angle_rad = y[7]
    if y[6] * load.braking_Nm <= 0.0:  # held, or it has come to rest
        b.heat_J += 0.5 * b.inertia_kgm2 * y[6] * y[6]
        y[6] = 0.0
        _grip(inv, m, load, y)


@compiled
def command_brake(inv, m, load, y, told, time_s):
    """`told`: the pin, for this time since the last call."""
    b = load.brake
    b.told_s = b.told_s + time_s if told == b.told else 0.0
    b.told = told
    closed_Nm = b.closed_Nm
    if told != 0 and b.told_s >= b.open_s:
        closed_Nm = 0.0
    elif told == 0 and b.told_s >= b.close_s:
        closed_Nm = b.torque_Nm
    if closed_Nm == b.closed_Nm:
        return
    b.closed_Nm = closed_Nm
    inv.brake_Nm = closed_Nm
    b.angle_rad = y[7]
    if closed_Nm == 0.0:
        _let_go(m, load)
    else:
        _against(load, np.copysign(closed_Nm, y[6]))
