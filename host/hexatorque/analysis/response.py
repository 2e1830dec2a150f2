"""Step responses: how long they take to settle and how far they overshoot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError


class Response(NamedTuple):
    """settling_s: time from the step until the signal stays within the band, NaN if it never does;
    overshoot: largest excess over the target in the direction of the step, 0 if there is none;
    deviation: largest distance from the target after the step, in either direction."""

    settling_s: float
    overshoot: float
    deviation: float


def step_response(
    time_s: np.ndarray, signal: np.ndarray, step_s: float, target: float, band: float
) -> Response:
    """The response to a step at `step_s` towards `target`. It has settled within +-band. Filter a
    signal with ripple first (`moving_mean`). InputError if the recording ends before the step."""
    after = time_s >= step_s
    t, y = time_s[after], np.asarray(signal, dtype=float)[after]
    if y.size == 0:
        raise InputError("the step is after the end of the recording")
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
    """The mean over `span_s` around each sample. At the ends the span is shorter."""
    x = np.asarray(signal, dtype=float)
    half = max(0, round(span_s * rate_Hz / 2))
    total = np.concatenate(([0.0], np.cumsum(x)))
    n = np.arange(x.size)
    low, high = np.maximum(n - half, 0), np.minimum(n + half + 1, x.size)
    return (total[high] - total[low]) / (high - low)
