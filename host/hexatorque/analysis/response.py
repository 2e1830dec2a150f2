"""Step responses: how long they take to settle and how far they overshoot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Response(NamedTuple):
    """settling_s: from the step until the signal stays within the band, NaN if it does not;
    overshoot: furthest beyond the target, in the direction of the step, 0 if it is not passed;
    deviation: furthest from the target, either way, after the step."""

    settling_s: float
    overshoot: float
    deviation: float


def step_response(
    time_s: np.ndarray, signal: np.ndarray, step_s: float, target: float, band: float
) -> Response:
    """Response to a step at `step_s` that should end at `target`; settled within +-band.
    Filter a rippling signal first (`moving_mean`)."""
    after = time_s >= step_s
    t, y = time_s[after], np.asarray(signal, dtype=float)[after]
    if y.size == 0:
        raise ValueError("the step is after the end of the recording")
    outside = np.nonzero(np.abs(y - target) > band)[0]
    if outside.size == 0:
        settling_s = 0.0
    elif outside[-1] + 1 == y.size:
        settling_s = float("nan")
    else:
        settling_s = float(t[outside[-1] + 1] - step_s)
    direction = np.sign(target - y[0])
    beyond = direction * (y - target)
    return Response(settling_s, float(max(0.0, beyond.max())), float(np.abs(y - target).max()))


def moving_mean(signal: np.ndarray, rate_Hz: float, span_s: float) -> np.ndarray:
    """Mean over `span_s` centred on each sample; shorter at the ends."""
    x = np.asarray(signal, dtype=float)
    half = max(0, round(span_s * rate_Hz / 2))
    total = np.concatenate(([0.0], np.cumsum(x)))
    n = np.arange(x.size)
    low, high = np.maximum(n - half, 0), np.minimum(n + half + 1, x.size)
    return (total[high] - total[low]) / (high - low)
