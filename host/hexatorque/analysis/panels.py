"""Panels in the common style, and how they become a picture. matplotlib is loaded on first use.
This knows no recording and no run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_IN, DPI = 10.0, 150
INK, FAINT = "#20242b", "#d9dde3"
LABEL: dict[str, Any] = {"fontsize": 8.5, "color": INK}
TITLE: dict[str, Any] = {"fontsize": 9.5, "fontweight": "bold", "color": INK}
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8, "labelcolor": INK}
#: Of lines in one panel. Colour-blind readers can distinguish them.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#20242b", "#cc79a7", "#e69f00", "#56b4e9", "#5b4fa2")
HEAD_IN, PANEL_IN = 0.5, 1.9


def new_figure(
    rows: int,
    columns: int,
    height_in: float,
    width_in: float = WIDTH_IN,
    make: Callable[..., Figure] | None = None,
    **shared: Any,
) -> tuple[Figure, np.ndarray]:
    """Makes empty panels in the common style. The axes are a (rows, columns) array. make: makes the
    figure, matplotlib's `Figure` by default, which no window shows."""
    if make is None:
        from matplotlib import figure as figures

        make = figures.Figure
    if rows * columns < 1:
        raise InputError("no runs to draw")
    figure = make(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **shared)
    for ax in axes.flat:
        ax.grid(True, color=FAINT, linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.spines[:].set_color("#9aa1ab")
        ax.tick_params(labelsize=8, colors=INK, color="#9aa1ab", length=3)
    return figure, axes


def save(figure: Figure, path: str | Path) -> Path:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    Path(path).parent.mkdir(parents=True, exist_ok=True)
    # `savefig` draws twice, first only to lay the panels out. But drawing lays them out, too.
    figure.set_facecolor("white")
    FigureCanvasAgg(figure).print_png(path)
    return Path(path)


def thin(t: np.ndarray, y: np.ndarray, buckets: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """Keeps the minimum and the maximum of each bucket, which gives the same picture from fewer
    points. A bucket is NaN (lost samples) only if it has no other values."""
    size = y.size // buckets
    if size < 4:
        return t, y
    block = np.pad(y, (0, -y.size % size), mode="edge").reshape(-1, size)
    lost = np.isnan(block)
    low, high = np.where(lost, np.inf, block), np.where(lost, -np.inf, block)
    at = np.sort([low.argmin(axis=1), high.argmax(axis=1)], axis=0).T
    at = np.minimum((at + size * np.arange(len(block))[:, None]).ravel(), y.size - 1)
    return t[at], y[at]


class Line(NamedTuple):
    label: str
    values: np.ndarray


class Panel(NamedTuple):
    title: str
    unit: str
    lines: Sequence[Line]


def over_time(time_s: np.ndarray, panels: Sequence[Panel], file: str | Path | None) -> Figure:
    """The panels below each other, over the same time. With `file` as a PNG, else as a figure of
    pyplot, which a notebook shows, and `matplotlib.pyplot.show()`."""
    make: Callable[..., Figure] | None = None
    if file is None:
        from matplotlib import pyplot

        make = pyplot.figure
    height_in = HEAD_IN + PANEL_IN * max(1.5, len(panels))
    figure, axes = new_figure(len(panels), 1, height_in, make=make, sharex=True)
    for ax, panel in zip(axes[:, 0], panels, strict=True):
        for colour, line in zip(COLOURS, panel.lines):
            shown = thin(time_s, np.asarray(line.values, float))
            ax.plot(*shown, color=colour, linewidth=1.0, label=line.label)
        ax.set_title(panel.title, loc="left", pad=3, **TITLE)
        ax.set_ylabel(panel.unit, **LABEL)
        ax.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=len(panel.lines), **LEGEND)
    axes[-1, 0].set_xlabel("time [s]", **LABEL)
    if file is not None:
        save(figure, file)
    return figure
