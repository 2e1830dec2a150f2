"""The reward of an agent, unless its user gives another one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Weights of `tracking`.
XY_WEIGHT, SWITCHING_WEIGHT = 0.2, 0.002
#: Reward of a step that ends in a trip.
TRIP_REWARD = -100.0


class Passed(NamedTuple):
    """The course of a step. plant: true values, a row for each sample, with the columns
    `hexatorque.plant.loop.PLANT_CHANNELS`; error: the controlled value less its reference,
    (samples,), as a share of the largest reference (torque limit, or the largest speed); i_xy_pu:
    size of the true x-y current over `i_trip_A`, (samples,); transitions: of all legs;
    tripped: whether the drive has tripped."""

    plant: np.ndarray
    error: np.ndarray
    i_xy_pu: np.ndarray
    transitions: int
    tripped: bool


def tracking(passed: Passed) -> float:
    """0 at best: less the mean size of the error, 0.2 times that of the x-y current, and 0.002 for
    each transition of a leg. A trip costs 100."""
    if passed.tripped:
        return TRIP_REWARD
    return -float(
        np.mean(np.abs(passed.error))
        + XY_WEIGHT * np.mean(passed.i_xy_pu)
        + SWITCHING_WEIGHT * passed.transitions
    )
