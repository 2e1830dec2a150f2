"""Finite control set model predictive control: one vector over the whole period, the one with the
lowest cost.

Barrero, Arahal, Gregor, Toral, Duran, "A proof of concept study of predictive current control for
VSI-driven asymmetrical dual three-phase AC machines", IEEE Trans. Ind. Electron. 56(6), 2009. The
cost is theirs: the squared error of the stator current in alpha-beta, plus a weight times that in
x-y. Its references follow here from the references of torque and flux.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .law import Law, record
from .patterns import VECTORS, transitions, vector
from .predictions import current_ahead, current_reference, xy_ahead


class Reference(Law):
    """weight_xy: of the squared x-y current, relative to alpha-beta; weight_switching_A2: of each
    leg that switches."""

    name = "fcs-mpc"
    returns = "vectors"
    reach_pu = 0.622008  # dodecagon of the large vectors

    def __init__(self, weight_xy: float = 0.05, weight_switching_A2: float = 0.0) -> None:
        self.weights = {"xy": weight_xy, "switching_A2": weight_switching_A2}

    def memory(self, parameters: Any) -> np.record:
        return record(**self.weights)

    @staticmethod
    def step(seen: Any, memory: Any) -> Any:
        wanted_A = current_reference(seen)
        best, least = 0, np.inf
        for word in range(64):
            error_A = wanted_A - current_ahead(seen, VECTORS[word, 0])
            i_xy_A = xy_ahead(seen, VECTORS[word, 1])
            moves = transitions(np.int64(seen.before), word)
            cost = (
                abs(error_A) ** 2
                + memory.xy * abs(i_xy_A) ** 2
                + memory.switching_A2 * moves
            )  # fmt: skip
            if cost < least:
                best, least = word, cost
        return vector(best)
