"""The points of a Sobol design. Library: SALib."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from .errors import StudyError


def library() -> Any:
    """SALib's modules that draw and analyse."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SALib.analyze import sobol as analyze
            from SALib.sample import sobol as sample
    except ImportError:
        raise StudyError(
            "a sobol design needs SALib, which is not installed: pip install 'hexatorque[sweep]'"
        ) from None
    return sample, analyze


def problem(names: Sequence[str]) -> dict[str, Any]:
    """The problem for SALib: every key goes from 0 to 1."""
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def drawn(samples: int, free: Sequence[bool], seed: int) -> np.ndarray:
    """Shares of the axes: (points, axes). free: of each axis whether it has more than one value."""
    sample, _ = library()
    if samples & (samples - 1) or samples < 2:
        raise StudyError(f"samples = {samples}: a sobol design needs a power of 2")
    count = sum(free)
    if count < 2:
        raise StudyError("a sobol design needs two keys that vary")
    names = [str(number) for number in range(count)]
    points = sample.sample(problem(names), samples, calc_second_order=False, seed=seed)
    shares = np.zeros((len(points), len(free)))
    shares[:, list(free)] = points
    return shares
