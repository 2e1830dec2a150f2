"""The load on the shaft: its torque as a function of speed."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .brake import HOLDING
from .compiled import compiled
from .elementary import tanh
from .load_kinds import BRAKE, CONSTANT, FAN, FRICTION, GENERATOR, LOADS
from .record import names_of, record

#: The sum of all terms.
LOAD = np.dtype(
    [
        ("constant_Nm", "f8"),  # the load's own and the holding brake's
        ("hanging_Nm", "f8"),
        ("braking_Nm", "f8"),
        ("linear_Nms", "f8"),
        ("quadratic_Nms2", "f8"),
        ("dry_Nm", "f8"),  # opposes motion
        ("eddy_Nm", "f8"),  # peak of an eddy-current brake
        ("eddy_rad_s", "f8"),  # speed of that peak, > 0
        ("brake", HOLDING),
    ]
)

#: Speed over which dry friction changes sign.
DRY_RAD_S = 0.5
#: Speed over which an eddy-current brake's torque peaks, relative to `at_rpm`.
EDDY_PEAK = 1.5


@lru_cache(16)
def load_record(kind: str, torque_Nm: float, at_rpm: float) -> np.record:
    """A load that takes `torque_Nm` at `at_rpm`; a constant load takes it at any speed. There is no
    holding brake. Not to be changed: others use the same record."""
    made = record(LOAD, **dict.fromkeys(names_of(LOAD), 0.0))
    set_load(made, LOADS.index(kind), torque_Nm, at_rpm)
    return made


def set_load(load, kind, torque_Nm, at_rpm):
    """The terms of a load of the kind LOADS[kind]."""
    w = at_rpm * math.pi / 30
    load.hanging_Nm = torque_Nm if kind == CONSTANT else 0.0
    load.constant_Nm = load.hanging_Nm + load.braking_Nm
    load.linear_Nms = torque_Nm / w if kind == GENERATOR else 0.0
    load.quadratic_Nms2 = torque_Nm / (w * w) if kind == FAN else 0.0
    load.dry_Nm = torque_Nm / math.tanh(w / DRY_RAD_S) if kind == FRICTION else 0.0
    s = 1 / EDDY_PEAK
    load.eddy_Nm = torque_Nm * (1 + s * s) / (2 * s) if kind == BRAKE else 0.0
    load.eddy_rad_s = EDDY_PEAK * w


@compiled(inline="always")
def load_torque(load, omega):
    """Torque that the load takes at `omega` (mechanical rad/s)."""
    torque = load.constant_Nm + omega * (load.linear_Nms + load.quadratic_Nms2 * abs(omega))
    if load.dry_Nm != 0.0:
        torque += load.dry_Nm * tanh(omega / DRY_RAD_S)
    if load.eddy_Nm != 0.0:
        s = omega / load.eddy_rad_s
        torque += load.eddy_Nm * 2.0 * s / (1.0 + s * s)
    return torque


#: Longest step, relative to the shaft's shortest time constant. The error of a step is 1e-5 of what
#: decays with it.
SHAFT_SHARE = 0.25


def steepest_Nms(load, at_rpm, viscous_Nms):
    """The largest slope of load and friction over speed, roughly, up to `at_rpm`."""
    w = at_rpm * math.pi / 30
    return (
        viscous_Nms
        + abs(load.linear_Nms)
        + 2 * abs(load.quadratic_Nms2) * w
        + abs(load.dry_Nm) / DRY_RAD_S
        + 2 * abs(load.eddy_Nm) / load.eddy_rad_s
    )


def shaft_step_s(load, at_rpm, viscous_Nms, inertia_kgm2, swing_per_s):
    """Longest step for the shaft: a share of its shortest time constant, J over the slope of the
    load torque, and of its fastest swing against the field."""
    slope_Nms = steepest_Nms(load, at_rpm, viscous_Nms)
    return SHAFT_SHARE / (slope_Nms / inertia_kgm2 + swing_per_s)
