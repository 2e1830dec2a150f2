"""Multi-vector predictive control: a virtual vector of three consecutive large vectors and a zero
vector in every period, with the share of time that leaves the least error.

The virtual vectors are those of paper A, eq. (4): no x-y voltage, |v| = 0.598 V_dc along 12
directions. Their use in predictive control, and the name LVV, are of the review of multi-vector
methods in Machines 12(2), 115, 2024. Cost: the squared error of the stator current in alpha-beta.
It is a parabola in the share d, with its lowest point where the error is across the vector. The
legs get the duty ratios of the mean voltage d v, as a PWM makes them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .law import Law
from .patterns import centred
from .predictions import current_ahead, current_reference

#: (12,) means of the virtual vectors, in units of V_dc.
MEANS = 1 / (math.sqrt(3) * math.cos(math.pi / 12)) * np.exp(
    1j * np.deg2rad(15.0 + 30.0 * np.arange(12))
)  # fmt: skip


class Reference(Law):
    name = "lvv-mpc"
    returns = "duties"
    reach_pu = 1 / math.sqrt(3)

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        error_A = current_reference(seen) - current_ahead(seen, 0j)
        per_V = seen.ts_s * seen.vdc_V / seen.sigma_ls_H
        best, share, least = 0, 0.0, np.inf
        for k in range(12):
            moves_A = per_V * MEANS[k]
            d = (moves_A.conjugate() * error_A).real / abs(moves_A) ** 2
            d = min(max(d, 0.0), 1.0)
            cost = abs(error_A - d * moves_A) ** 2
            if cost < least:
                best, share, least = k, d, cost
        return centred(share * MEANS[best], 0j)
