"""The load on the shaft: its torque as a function of speed."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .compiled import compiled
from .record import record

#: The sum of all terms.
LOAD = np.dtype(
    [
        ("constant_Nm", "f8"),
        ("linear_Nms", "f8"),
        ("quadratic_Nms2", "f8"),
        ("dry_Nm", "f8"),  # opposes motion
        ("eddy_Nm", "f8"),  # peak of an eddy-current brake
        ("eddy_rad_s", "f8"),  # speed of that peak, > 0
    ]
)

#: Speed over which dry friction changes sign.
DRY_RAD_S = 0.5
#: Speed over which an eddy-current brake's torque peaks, relative to `at_rpm`.
EDDY_PEAK = 1.5


@lru_cache(16)
def load_record(kind: str, torque_Nm: float, at_rpm: float) -> np.record:
    """A load that takes `torque_Nm` at `at_rpm`; a constant load takes it at any speed."""
    w = at_rpm * math.pi / 30
    terms = {
        "constant_Nm": 0.0,
        "linear_Nms": 0.0,
        "quadratic_Nms2": 0.0,
        "dry_Nm": 0.0,
        "eddy_Nm": 0.0,
        "eddy_rad_s": EDDY_PEAK * w,
    }
    if kind == "constant":
        terms["constant_Nm"] = torque_Nm
    elif kind == "generator":
        terms["linear_Nms"] = torque_Nm / w
    elif kind == "fan":
        terms["quadratic_Nms2"] = torque_Nm / w**2
    elif kind == "friction":
        terms["dry_Nm"] = torque_Nm / math.tanh(w / DRY_RAD_S)
    else:  # brake
        s = 1 / EDDY_PEAK
        terms["eddy_Nm"] = torque_Nm * (1 + s * s) / (2 * s)
    return record(LOAD, **terms)


@compiled(inline="always")
def load_torque(load, omega):
    """Torque that the load takes at `omega` (mechanical rad/s)."""
    torque = load.constant_Nm + omega * (load.linear_Nms + load.quadratic_Nms2 * abs(omega))
    if load.dry_Nm != 0.0:
        torque += load.dry_Nm * np.tanh(omega / DRY_RAD_S)
    if load.eddy_Nm != 0.0:
        s = omega / load.eddy_rad_s
        torque += load.eddy_Nm * 2.0 * s / (1.0 + s * s)
    return torque


def steepest_Nms(load: np.record, at_rpm: float, viscous_Nms: float) -> float:
    """The largest slope of load and friction over speed, roughly, up to `at_rpm`."""
    w = at_rpm * math.pi / 30
    return float(
        viscous_Nms
        + abs(load.linear_Nms)
        + 2 * abs(load.quadratic_Nms2) * w
        + abs(load.dry_Nm) / DRY_RAD_S
        + 2 * abs(load.eddy_Nm) / load.eddy_rad_s
    )
