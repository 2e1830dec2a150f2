"""Paper B's sweeps: one quantity over a grid of operating points, for the three schemes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..analysis import plots
from ..recording import Recording
from .figure import Figure
from .job import Job
from .paper_b import COLOUR, MARKER, SCHEMES, point

#: Scheme -> (rows, columns).
Grid = dict[str, np.ndarray]


def measured(
    job: Job, rows: tuple[float, ...], columns: np.ndarray, at: Callable, value: Callable
) -> Grid:
    """Scheme -> (rows, columns): `value` of the metrics at the points `at(row, column)`,
    given as (speed, load). NaN where the drive does not get there."""
    grid = [(s, row, column) for s in SCHEMES for row in rows for column in columns]
    found = job.metrics([point(s, *at(row, column)) for s, row, column in grid])
    values = [np.nan if m is None else value(m) for m in found]
    table = np.array(values, dtype=float).reshape(len(SCHEMES), len(rows), len(columns))
    return dict(zip(SCHEMES, table))


def draw_grid(
    x: np.ndarray, titles: list[str], grid: Grid, x_label: str, y_label: str, share: float = 0.0
) -> Callable:
    """Writes one panel per row of the grid, a line per scheme and one at `share` of DTC1."""

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, len(titles), 3.9, sharey=True)
        for row, (axis, title) in enumerate(zip(axes[0], titles)):
            for scheme, values in grid.items():
                axis.plot(x, values[row], marker=MARKER[scheme], color=COLOUR[scheme],
                          markersize=4, linewidth=1.2, label=scheme.upper())  # fmt: skip
            if share:
                axis.plot(x, share * grid["dtc1"][row], "--", color=plots.INK, linewidth=0.9,
                          label=f"{share:g} × DTC1")  # fmt: skip
            axis.set_title(title, **plots.TITLE)
            axis.set_xlabel(x_label, **plots.LABEL)
        high = axes[0, 0].get_ylim()[1]
        axes[0, 0].set_ylim(0, 1.15 * high)  # room for the legend
        axes[0, 0].set_ylabel(y_label, **plots.LABEL)
        axes[0, -1].legend(loc="upper right", ncols=2, **plots.LEGEND)
        return plots.save(figure, path)

    return draw


def record_grid(x_name: str, unit: str, x: np.ndarray, grid: Grid, rows: list[str]) -> Recording:
    channels = {x_name: x} | {
        f"{scheme} {name}": values[row]
        for scheme, values in grid.items()
        for row, name in enumerate(rows)
    }
    return Recording(1.0, channels, {x_name: unit}, {"rows": x_name})


def _finite(values: np.ndarray) -> list[list[float | None]]:
    return [[value if np.isfinite(value) else None for value in row] for row in values.tolist()]


def grid_figure(grid: Grid, **parts) -> Figure:
    return Figure(
        metrics={scheme: _finite(values) for scheme, values in grid.items()},
        setups=[point(scheme).setup for scheme in SCHEMES],
        **parts,
    )
