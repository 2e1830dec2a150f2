"""Which key matters how much: Sobol indices of a study. Library: SALib.

S1 is the share of a figure's variance that one key causes alone, ST the share that it causes
together with others. A key that has one value only takes no part.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .sobol import library, problem
from .table import Results

COLUMNS = ("controller.scheme", "figure", "key", "S1", "S1_conf", "ST", "ST_conf")


def indices(results: Results) -> Iterator[list[Any]]:
    """A line, as in COLUMNS, for each scheme, figure and key, over the mean of the noise's seeds.
    Where a run failed, its sample is left out for all keys."""
    _, analyze = library()
    space, design = results.space, results.space.design
    paths = [axis.path for axis in design.axes if axis.free]
    block = len(paths) + 2
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
                found = analyze.analyze(
                    problem(paths), values, calc_second_order=False, seed=design.seed
                )
            for j, path in enumerate(paths):
                yield [scheme, name, path, *(float(found[c][j]) for c in COLUMNS[3:])]
