"""Predictive control over virtual vectors: twelve of a large and a medium-large vector each, whose
mean has no x-y voltage, and the zero vector.

Gonzalez-Prieto, Duran, Aciego, Martin, Barrero, "Model predictive control of six-phase induction
motor drives using virtual voltage vectors", IEEE Trans. Ind. Electron. 65(1), 2018. The cost is the
squared error of the stator current in alpha-beta; x-y is left alone. The shares follow from the
vectors: sqrt(3) - 1 = 0.732 of the period for the large one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..firmware import lib
from .law import Law
from .patterns import VECTORS, transitions, vector, vectors
from .predictions import current_ahead, current_reference

LARGE_SHARE = math.sqrt(3) - 1
#: (12, 2) state words of the large and the medium-large vector along 15 + 30 k degrees.
PAIRS = np.array([[lib.ht_group[group][k] for group in (lib.HT_L, lib.HT_ML)] for k in range(12)])
#: (13,) their means, in units of V_dc; the last one is the zero vector.
MEANS = np.append(
    LARGE_SHARE * VECTORS[PAIRS[:, 0], 0] + (1 - LARGE_SHARE) * VECTORS[PAIRS[:, 1], 0], 0j
)
#: (64,) the zero vector with the fewest transitions, by the state word before.
NEAREST_ZERO = np.array(list(lib.ht_nearest_zero))


class Reference(Law):
    name = "vv-mpc"
    returns = "vectors"
    reach_pu = 1 / math.sqrt(3)

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        wanted_A = current_reference(seen)
        best, least = 0, np.inf
        for k in range(13):
            cost = abs(wanted_A - current_ahead(seen, MEANS[k])) ** 2
            if cost < least:
                best, least = k, cost
        before = np.int64(seen.before)
        if best == 12:
            return vector(NEAREST_ZERO[before])
        large, medium = PAIRS[best, 0], PAIRS[best, 1]
        if transitions(before, large) <= transitions(before, medium):
            return vectors(large, medium, medium, LARGE_SHARE, 1.0)
        return vectors(medium, large, large, 1.0 - LARGE_SHARE, 1.0)
