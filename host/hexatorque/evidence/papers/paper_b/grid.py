"""Paper B's sweeps: one quantity over a grid of operating points, for all three schemes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ....analysis import plots
from ....recording.recording import Recording
from ..engine.figure import Figure
from ..engine.job import Job
from .common import COLOUR, MARKER, SCHEMES, SETUPS, point

#: Scheme -> (rows, columns).
Grid = dict[str, np.ndarray]


def measured(
    job: Job,
    rows: tuple[float, ...],
    columns: np.ndarray,
    at: Callable[[float, float], tuple[float, float]],
    value: Callable[[dict], float],
) -> dict[str, Grid]:
    """Set-up -> scheme -> (rows, columns): `value` of the metrics at the points `at(row, column)`,
    given as (speed, load). NaN if the drive does not reach a point."""
    grid = [
        (name, s, row, column)
        for name in SETUPS for s in SCHEMES for row in rows for column in columns
    ]  # fmt: skip
    found = job.metrics([point(s, *at(row, column), name=name) for name, s, row, column in grid])
    values = np.array([np.nan if m is None else value(m) for m in found], dtype=float)
    tables = values.reshape(len(SETUPS), len(SCHEMES), len(rows), len(columns))
    return {name: dict(zip(SCHEMES, table)) for name, table in zip(SETUPS, tables)}


def draw_grid(
    x: np.ndarray,
    titles: list[str],
    grids: dict[str, Grid],
    x_label: str,
    y_label: str,
    share: float = 0.0,
) -> Callable:
    """Returns a function that draws a row of panels per set-up. Each panel shows a row of the grid,
    with a line per scheme and one at `share` times DTC1."""

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(len(grids), len(titles), 3.4 * len(grids), sharey=True)
        for panels, (name, grid) in zip(axes, grids.items()):
            for row, (axis, title) in enumerate(zip(panels, titles)):
                for scheme, values in grid.items():
                    axis.plot(x, values[row], marker=MARKER[scheme], color=COLOUR[scheme],
                              markersize=4, linewidth=1.2, label=scheme.upper())  # fmt: skip
                if share:
                    axis.plot(x, share * grid["dtc1"][row], "--", color=plots.INK, linewidth=0.9,
                              label=f"{share:g} × DTC1")  # fmt: skip
                axis.set_title(title, **plots.TITLE)
            panels[0].set_ylabel(f"{name}\n{y_label}", **plots.LABEL)
        for axis in axes[-1]:
            axis.set_xlabel(x_label, **plots.LABEL)
        axes[0, 0].set_ylim(0, None)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4, **plots.LEGEND)
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


def grid_figure(grids: dict[str, Grid], **parts: Any) -> Figure:
    return Figure(
        metrics={
            name: {scheme: _finite(values) for scheme, values in grid.items()}
            for name, grid in grids.items()
        },
        setups=[point(scheme, name=name).setup for name in grids for scheme in SCHEMES],
        **parts,
    )
