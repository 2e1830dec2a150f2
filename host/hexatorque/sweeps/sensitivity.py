"""Which key matters how much: Sobol indices of a study. Library: SALib.

S1 is the share of a figure's variance that one key causes alone, ST the share that it causes
together with others. A key that has one value only takes no part.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import StudyError

if TYPE_CHECKING:
    from .space import Axis, Design
    from .table import Results

COLUMNS = ("controller.scheme", "figure", "key", "S1", "S1_conf", "ST", "ST_conf")


def _library() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SALib import analyze, sample
            from SALib.analyze import sobol as _
            from SALib.sample import sobol as _  # noqa: F401, F811
    except ImportError:
        raise StudyError(
            "a sobol design needs SALib, which is not installed: pip install 'hexatorque[sweep]'"
        ) from None
    return sample.sobol, analyze.sobol


def _problem(axes: Sequence[Axis]) -> dict[str, Any]:
    free = [axis.path for axis in axes if _free(axis)]
    return {"num_vars": len(free), "names": free, "bounds": [[0.0, 1.0]] * len(free)}


def _free(axis: Axis) -> bool:
    return len(axis.values) != 1


def drawn(samples: int, axes: Sequence[Axis], seed: int) -> np.ndarray:
    """Shares of the axes: (points, axes)."""
    sample, _ = _library()
    problem = _problem(axes)
    if samples & (samples - 1) or samples < 2:
        raise StudyError(f"samples = {samples}: a sobol design needs a power of 2")
    if problem["num_vars"] < 2:
        raise StudyError("a sobol design needs two keys that vary")
    free = sample.sample(problem, samples, calc_second_order=False, seed=seed)
    shares = np.zeros((len(free), len(axes)))
    shares[:, [_free(axis) for axis in axes]] = free
    return shares


def indices(results: Results) -> Iterator[list[Any]]:
    """A line, as in COLUMNS, for each scheme, figure and key, over the mean of the noise's seeds.
    Where a run failed, its sample is left out for all keys."""
    _, analyze = _library()
    space = results.space
    design: Design = space.design
    problem = _problem(design.axes)
    block = problem["num_vars"] + 2
    figures = results.figures.reshape(
        design.points, max(1, len(space.schemes)), max(1, len(space.seeds)), -1
    ).mean(axis=2)
    for k, scheme in enumerate(space.schemes or ("",)):
        for n, name in enumerate(results.metrics):
            values = figures[:, k, n].reshape(-1, block)
            values = values[np.isfinite(values).all(axis=1)].ravel()
            nothing = np.full(block - 2, np.nan)
            found = dict.fromkeys(("S1", "S1_conf", "ST", "ST_conf"), nothing)
            if values.size >= 2 * block and np.ptp(values) > 0:
                found = analyze.analyze(problem, values, calc_second_order=False, seed=design.seed)
            for j, path in enumerate(problem["names"]):
                yield [scheme, name, path, *(float(found[c][j]) for c in COLUMNS[3:])]
