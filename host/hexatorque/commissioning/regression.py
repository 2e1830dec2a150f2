"""Least squares with uncertainties."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: Two standard deviations of the gain of a current sensor, whose error may be up to 0.5 % either
#: way and is nobody's knowledge: what one phase shows, what one axis shows, what all phases show
#: together. An error that all sensors share is not contained, nor one of the dc-link sensor.
PHASE_GAIN = 2 * 0.005 / math.sqrt(3)
AXIS_GAIN = PHASE_GAIN / 2
MEAN_GAIN = PHASE_GAIN / math.sqrt(6)


@dataclass(frozen=True)
class Value:
    """A measured value and its uncertainty: two standard deviations, what systematic errors are
    known included."""

    value: float
    uncertainty: float

    def plus(self, systematic: float) -> Value:
        """The same with a further, independent part of the uncertainty."""
        return Value(self.value, float(np.hypot(self.uncertainty, systematic)))

    def plus_share(self, share: float) -> Value:
        """The same with a part that is in proportion to the value."""
        return self.plus(share * abs(self.value))

    def __format__(self, unit: str) -> str:
        return f"{self.value:.4g} {unit} ±{self.uncertainty:.2g}".replace("  ", " ")


def mean(values: list[Value]) -> Value:
    """The mean of values whose errors are independent."""
    errors = np.array([value.uncertainty for value in values])
    return Value(
        float(np.mean([value.value for value in values])),
        float(np.sqrt(errors @ errors) / len(values)),
    )


def linear(columns: list[np.ndarray], target: np.ndarray) -> tuple[list[Value], np.ndarray]:
    """The factors of the columns whose sum comes nearest to the target, and the residual."""
    a = np.column_stack(columns)
    size = np.maximum(np.sqrt((a * a).mean(0)), 1e-300)
    factors, *_ = np.linalg.lstsq(a / size, target, rcond=None)
    rest = target - (a / size) @ factors
    free = max(1, len(target) - a.shape[1])
    covariance = np.linalg.pinv((a / size).T @ (a / size)) * (rest @ rest / free)
    spread = 2 * np.sqrt(np.maximum(np.diag(covariance), 0))
    return [Value(float(f), float(s)) for f, s in zip(factors / size, spread / size)], rest


def nonlinear(
    model: Callable[[np.ndarray], np.ndarray], start: np.ndarray, target: np.ndarray
) -> tuple[list[Value], np.ndarray]:
    """Levenberg-Marquardt on the logarithms of positive unknowns. Returns them and the rest."""
    x = np.log(start)
    rest = target - model(np.exp(x))
    damping = 1e-3
    for _ in range(60):
        slopes = _slopes(model, x)
        normal = slopes.T @ slopes
        step = np.linalg.solve(
            normal + damping * np.diag(np.diag(normal) + 1e-300), slopes.T @ rest
        )
        trial = x + np.clip(step, -1, 1)
        better = target - model(np.exp(trial))
        if np.isfinite(better).all() and better @ better < rest @ rest:
            gain = 1 - (better @ better) / (rest @ rest)
            x, rest, damping = trial, better, damping / 5
            if gain < 1e-7:
                break
        else:
            damping *= 5
            if damping > 1e8:
                break
    slopes = _slopes(model, x)
    free = max(1, len(target) - len(x))
    covariance = np.linalg.pinv(slopes.T @ slopes) * (rest @ rest / free)
    spread = 2 * np.sqrt(np.maximum(np.diag(covariance), 0))
    found = np.exp(x)
    return [Value(float(f), float(f * s)) for f, s in zip(found, spread)], rest


def _slopes(model: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """d model / d x, by differences both ways."""
    h = 1e-4
    columns = []
    for k in range(len(x)):
        way = np.zeros(len(x))
        way[k] = h
        columns.append((model(np.exp(x + way)) - model(np.exp(x - way))) / (2 * h))
    return np.column_stack(columns)
