"""Laws that do what an agent says, and bring the drive to its operating point before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from numba import njit

from ..laws.law import Law, record
from ..laws.patterns import VECTORS, centred, vector

#: Share of the x-y current that the law before the agent takes away in a period, and the weight of
#: the x-y voltage where it chooses a vector.
XY_GAIN, XY_WEIGHT = 0.3, 0.3


@njit
def _wanted_pu(seen):
    """Deadbeat control of torque and flux: voltages in alpha-beta and x-y, units of V_dc."""
    r = seen.rotor_Wb
    b = seen.torque_ref_Nm * seen.sigma_ls_H / (3 * seen.pole_pairs * abs(r) ** 2)
    a = max((seen.flux_ref_Wb / abs(r)) ** 2 - b * b, 0.01) ** 0.5
    wanted_Wb = (a + 1j * b) * r * (1 + 1j * seen.omega_rad_s * seen.ts_s)
    v = (wanted_Wb - seen.psi_Wb) / seen.ts_s + seen.rs_ohm * seen.i_A
    v_xy = -XY_GAIN * seen.lxy_H / seen.ts_s * seen.i_xy_A
    return v / seen.vdc_V, v_xy / seen.vdc_V


class Voltage(Law):
    """memory.v, memory.v_xy: commanded, in units of V_dc, while memory.acting."""

    name: ClassVar[str] = "agent"

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        if memory.acting:
            return centred(memory.v, memory.v_xy)
        v, v_xy = _wanted_pu(seen)
        return centred(v, v_xy)

    def memory(self, parameters: Mapping[str, float | str]) -> np.record:
        return record(acting=0, v=0j, v_xy=0j)


class Switching(Law):
    """memory.word: state word of the six legs, while memory.acting."""

    name: ClassVar[str] = "agent"
    returns: ClassVar[Literal["duties", "vectors"]] = "vectors"

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        word = memory.word
        if not memory.acting:
            v, v_xy = _wanted_pu(seen)
            least = np.inf
            for k in range(64):
                ab, xy = abs(VECTORS[k, 0] - v), abs(VECTORS[k, 1] - v_xy)
                cost = ab * ab + XY_WEIGHT * xy * xy
                if cost < least:
                    least, word = cost, k
        return vector(word)

    def memory(self, parameters: Mapping[str, float | str]) -> np.record:
        return record(acting=0, word=0)
