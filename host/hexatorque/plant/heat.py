"""The machine's temperatures: two bodies, the winding and the frame.

The winding has six parts, one on each leg. The frame has the iron and the rotor:

    (C/6) d theta_k/dt = R_s(theta_k) i_k^2 - (theta_k - theta_f)/(6 R)
    C_f d theta_f/dt = sum of (theta_k - theta_f)/(6 R) + P_rotor + P_iron - (theta_f - ambient)/R_f

with C = winding_s/R and C_f = frame_s/R_f. R_s and R_r grow with the temperatures of their bodies.

The compiled loop adds up the losses (`add_heat`). Every few milliseconds, outside of its steps, the
bodies advance under their means, exactly, and the machine gets its resistances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .compiled import compiled
from .machine import losses, phase_current
from .record import names_of

HEAT = np.dtype(
    [
        ("on", "i8"),  # 0: temperatures are not followed
        ("rr_ohm", "f8"),
        ("i_A", "f8", (6,)),  # at the end of the latest step: phase currents on the legs
        ("rotor_A", "f8", (2,)),
        ("iron_W", "f8"),
        ("i2_A2s", "f8", (6,)),  # integrals of their squares, of the rotor's, and of iron_W
        ("rotor2_A2s", "f8"),
        ("iron_J", "f8"),
        ("now_A", "f8", (2,)),
        ("winding_degC", "f8"),  # of the hottest part, and of the frame: for a record
        ("frame_degC", "f8"),
    ]
)

#: Change of the resistances per kelvin, relative to those at 20 degC: copper. Aluminium's is the
#: same within 3 %.
PER_K = 0.00393
#: Real time between two steps of the bodies.
STEP_S = 5e-3


@compiled
def add_heat(m, y, dt):
    """Add the losses of a step that ends with the state y. Between two edges a current is nearly a
    straight line from a to b, whose square's integral is dt (a^2 + a b + b^2)/3."""
    h = m.heat
    share = dt / 3.0
    for leg in range(6):
        a = h.i_A[leg]
        b = phase_current(m, y, leg)
        h.i2_A2s[leg] += share * (a * a + a * b + b * b)
        h.i_A[leg] = b
    iron_W = losses(m, y, h.now_A)
    for axis in range(2):
        a = h.rotor_A[axis]
        b = h.now_A[axis] / h.rr_ohm
        h.rotor2_A2s += share * (a * a + a * b + b * b)
        h.rotor_A[axis] = b
    h.iron_J += 0.5 * dt * (h.iron_W + iron_W)
    h.iron_W = iron_W


def warmer(ohm: Any, degC: Any, stated_degC: float) -> Any:
    """A resistance at another temperature than where it is stated."""
    return ohm * (1 + PER_K * (degC - 20)) / (1 + PER_K * (stated_degC - 20))


class Bodies:
    """The temperatures of one machine, and its resistances.

    winding_degC: (6,) of the parts on the legs; frame_degC: of the frame; heat_J, ambient_J: what
    the losses have brought so far, and what has gone to the ambient.
    """

    def __init__(self, values: Mapping[str, float], machine: Any, make: Callable, m: Any) -> None:
        """values: the set-up's section [heat]; machine: the constants of which `make` makes m."""
        self.on = values["winding_K_W"] > 0
        self._values, self._machine, self._make, self._m = values, machine, make, m
        self._lapse = values["time_lapse"]
        self._steps: dict[float, np.ndarray] = {}
        self.winding_degC = np.full(6, float(values["ambient_degC"]))
        self.frame_degC = float(values["ambient_degC"])
        self.heat_J = self.ambient_J = 0.0
        m.heat.on = int(self.on)
        m.heat.rr_ohm = getattr(machine, "rr_ohm", 1.0)
        if self.on:
            self._warm()

    @property
    def stored_J(self) -> float:
        """The heat that winding and frame hold above the ambient temperature."""
        v = self._values
        rise = np.mean(self.winding_degC) - v["ambient_degC"]
        frame = v["frame_s"] / v["frame_K_W"] * (self.frame_degC - v["ambient_degC"])
        return float(v["winding_s"] / v["winding_K_W"] * rise + frame)

    def _ohm(self) -> np.ndarray:
        """R_s on each leg."""
        p = self._machine
        cold = (p.rs_ohm + np.array(p.drs_ohm))[p.phase_of_leg]
        return warmer(cold, self.winding_degC, self._values["ohm_degC"])

    def _warm(self) -> None:
        """The machine gets the resistances of its temperatures."""
        p = self._machine
        added = np.empty(6)
        added[p.phase_of_leg] = self._ohm() - p.rs_ohm
        changed: dict[str, Any] = {"drs_ohm": tuple(added)}
        if hasattr(p, "rr_ohm"):
            changed["rr_ohm"] = warmer(p.rr_ohm, self.frame_degC, self._values["ohm_degC"])
            self._m.heat.rr_ohm = changed["rr_ohm"]
        self._m.heat.winding_degC = self.winding_degC.max()
        self._m.heat.frame_degC = self.frame_degC
        made = self._make(replace(p, **changed))
        for name in names_of(made.dtype):
            if name not in ("heat", "inertia"):  # a brake may hold the shaft
                self._m[name] = made[name]

    def _step(self, time_s: float) -> np.ndarray:
        """(8, 15): the seven rises after this time, and the energy that has gone to the ambient,
        from rises, an energy and seven powers before. The frame is the seventh."""
        from scipy.linalg import expm

        if time_s not in self._steps:
            v = self._values
            per_part = 6 * v["winding_K_W"]
            a = np.zeros((15, 15))
            part_J_K = v["winding_s"] / per_part
            frame_J_K = v["frame_s"] / v["frame_K_W"]
            for k in range(6):
                a[k, k] = -1 / (per_part * part_J_K)
                a[k, 6] = 1 / (per_part * part_J_K)
                a[6, k] = 1 / (per_part * frame_J_K)
                a[k, 8 + k] = 1 / part_J_K
            a[6, 6] = -(6 / per_part + 1 / v["frame_K_W"]) / frame_J_K
            a[6, 14] = 1 / frame_J_K
            a[7, 6] = 1 / v["frame_K_W"]
            self._steps[time_s] = expm(a * time_s)[:8]
        return self._steps[time_s]

    def advance(self, time_s: float) -> None:
        """The losses that have been added up belong to this time."""
        h = self._m.heat
        ohm = self._ohm()
        frame_J = float(3 * h.rr_ohm * h.rotor2_A2s + h.iron_J)
        watts = np.append(ohm * h.i2_A2s, frame_J) / time_s
        h.i2_A2s = 0.0
        h.rotor2_A2s = h.iron_J = 0.0
        ambient = self._values["ambient_degC"]
        rises = np.append(self.winding_degC, self.frame_degC) - ambient
        lapse_s = time_s * self._lapse
        after = self._step(lapse_s) @ np.concatenate([rises, [0.0], watts])
        self.winding_degC = after[:6] + ambient
        self.frame_degC = float(after[6]) + ambient
        self.heat_J += float(watts.sum()) * lapse_s
        self.ambient_J += float(after[7])
        self._warm()
