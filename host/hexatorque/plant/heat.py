"""The machine's temperatures: two bodies, the winding and the frame.

The winding has six parts, one on each leg. The frame has the iron and the rotor:

    (C/6) d theta_k/dt = R_s(theta_k) i_k^2 - (theta_k - theta_f)/(6 R)
    C_f d theta_f/dt = sum of (theta_k - theta_f)/(6 R) + P_rotor + P_iron - (theta_f - ambient)/R_f

with C = winding_s/R and C_f = frame_s/R_f. R_s and R_r grow with the temperatures of their bodies.

The compiled loop integrates the losses (meter.py). Every few milliseconds, outside of its steps,
the bodies advance under their means, exactly, and the machine gets its resistances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .meter import IRON_J, LEG_A2S, ROTOR_V2S
from .record import names_of

#: Change of the resistances per kelvin, relative to those at 20 degC: copper. Aluminium's is the
#: same within 3 %.
PER_K = 0.00393
#: Real time between two steps of the bodies.
STEP_S = 5e-3


def warmer(ohm: Any, degC: Any, stated_degC: float) -> Any:
    """A resistance at another temperature than where it is stated."""
    return ohm * (1 + PER_K * (degC - 20)) / (1 + PER_K * (stated_degC - 20))


class Bodies:
    """The temperatures of one machine, and its resistances.

    winding_degC: (6,) of the parts on the legs; frame_degC: of the frame; heat_J, ambient_J: what
    the losses have brought so far, and what has gone to the ambient.
    """

    def __init__(
        self, values: Mapping[str, float], machine: Any, make: Callable, m: Any, inverter: np.record
    ) -> None:
        """values: the set-up's section [heat]; machine: the constants of which `make` makes m;
        inverter: the record whose meter integrates the losses."""
        self.on = values["winding_K_W"] > 0
        self._values, self._machine, self._make, self._m = values, machine, make, m
        self._inverter, self._rr_ohm = inverter, getattr(machine, "rr_ohm", 1.0)
        self._lapse = values["time_lapse"]
        self._steps: dict[float, np.ndarray] = {}
        self.winding_degC = np.full(6, float(values["ambient_degC"]))
        self.frame_degC = float(values["ambient_degC"])
        self.heat_J = self.ambient_J = 0.0
        if self.on:
            inverter.meter.on = 1
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
            self._rr_ohm = changed["rr_ohm"]
        self._inverter.winding_degC = self.winding_degC.max()
        self._inverter.frame_degC = self.frame_degC
        made = self._make(replace(p, **changed))
        for name in names_of(made.dtype):
            if name != "inertia":  # a brake may hold the shaft
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
        x = self._inverter.meter.x
        frame_J = 3 * x[ROTOR_V2S] / self._rr_ohm + x[IRON_J]
        watts = np.append(self._ohm() * x[LEG_A2S : LEG_A2S + 6], frame_J) / time_s
        x[LEG_A2S : LEG_A2S + 6] = x[ROTOR_V2S] = x[IRON_J] = 0.0
        ambient = self._values["ambient_degC"]
        rises = np.append(self.winding_degC, self.frame_degC) - ambient
        lapse_s = time_s * self._lapse
        after = self._step(lapse_s) @ np.concatenate([rises, [0.0], watts])
        self.winding_degC = after[:6] + ambient
        self.frame_degC = float(after[6]) + ambient
        self.heat_J += float(watts.sum()) * lapse_s
        self.ambient_J += float(after[7])
        self._warm()
