"""The fronts of all methods over switching frequency."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis import plots
from ...analysis.schemes import STYLE
from .judging import At

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABELS = {
    "td_Nm": "Td [N m]",
    "thd_inf_pct": "THD∞ [%]",
    "ixy_rms_A": "x–y rms [A]",
    "loss_W": "loss [W]",
}
#: The variants of our schemes, and the laws of the host.
INK = {
    "κ=0": "#cc79a7", "κ=1": "#117733", "alternating": "#999933", "free": "#332288",
    "smooth": "#e60000", "clean": "#0000ff",
}  # fmt: skip
LAW_COLOURS = {
    "dtc-svm": "#17becf",
    "lvv-mpc": "#bcbd22",
    "vv-mpc": "#9467bd",
    "fcs-mpc": "#e0007f",
}


@dataclass(frozen=True)
class Look:
    """How a page of fronts looks: ends of the axis of switching frequency; whether every setting is
    a dot; height of a point and of the legend; width; columns of the legend."""

    first_kHz: float
    last_kHz: float
    dots: bool
    height_in: float
    legend_in: float
    width_in: float
    columns: int


def envelope(f_sw_Hz: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest value within each switching frequency: the corners of a falling staircase."""
    order = np.lexsort((values, f_sw_Hz))
    f, v = f_sw_Hz[order], np.minimum.accumulate(values[order])
    corner = np.concatenate(([True], v[1:] < v[:-1])) if len(v) else np.zeros(0, bool)
    return f[corner], v[corner]


def style(name: str) -> dict[str, Any]:
    if name in LAW_COLOURS:
        return {"color": LAW_COLOURS[name], "linestyle": (0, (4, 1.2)), "linewidth": 1.5}
    scheme, _, kind = name.partition(" ")
    if kind:
        line = ":" if kind == "free" else "-"
        return {"color": INK[kind], "linewidth": 2.0, "linestyle": line}
    # Wider lines lie below those that often cover them.
    width = {"fdr": 2.6, "db-dtfc": 3.2, "foc": 2.2, "db-ipwm": 2.0}.get(scheme, 1.2)
    return {"color": STYLE[scheme]["color"], "linewidth": width}


def _staircase(axis: Axes, rows: list[dict], figure: str, last_kHz: float, **style: Any) -> None:
    """The best value of a figure within each switching frequency."""
    f_kHz = np.array([row["f_sw_Hz"] for row in rows]) / 1e3
    f, v = envelope(f_kHz, np.array([row[figure] for row in rows]))
    if len(f):
        f, v = np.append(f, max(f[-1], last_kHz)), np.append(v, v[-1])
        axis.step(f, v, where="post", **style)


def _computed(axis: Axes, at_1kHz: float, last_kHz: float, line: str, label: str) -> None:
    """A ripple that falls with the switching frequency."""
    f_kHz = np.linspace(1.0, last_kHz, 29)
    axis.plot(f_kHz, at_1kHz / f_kHz, line, color=plots.INK, linewidth=1.1, label=label)


def logarithmic(axis: Axes, *of: str) -> None:
    """The axes "x", "y" of a panel, with 1, 2 and 5 of each decade named."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set(**{f"{one}scale": "log" for one in of})
    for one in (getattr(axis, f"{one}axis") for one in of):
        one.set_major_locator(LogLocator(subs=(1, 2, 5)))
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        one.set_minor_locator(NullLocator())


def _panel(axis: Axes, at: At, figure: str, look: Look) -> None:
    for name, rows in at.rows.items():
        own = style(name)
        if look.dots:
            f_kHz = [row["f_sw_Hz"] / 1e3 for row in rows]
            values = [row[figure] for row in rows]
            axis.plot(f_kHz, values, ".", color=own["color"], alpha=0.25, markersize=2.5)
        _staircase(axis, rows, figure, look.last_kHz, label=name, **own)
    axis.set_xlim(look.first_kHz, look.last_kHz)
    if figure != "loss_W":
        if line := at.line(1e3):
            value = getattr(line, figure)
            _computed(axis, value, look.last_kHz, "--", "carrier modulation, computed")
        if figure in at.least_at_1kHz:
            value = at.least_at_1kHz[figure]
            _computed(axis, value, look.last_kHz, "-", "limit of all pulse patterns")
        logarithmic(axis, "y")
    elif look.dots:
        last_Hz = 1e3 * look.last_kHz
        shown = [r[figure] for rows in at.rows.values() for r in rows if r["f_sw_Hz"] < last_Hz]
        if shown:
            axis.set_ylim(0.98 * min(shown), min(1.02 * max(shown), 1.6 * min(shown)))


def one_legend(drawn: Figure, axes: np.ndarray, columns: int) -> None:
    """One legend of all panels, above them."""
    labels: dict[str, Artist] = {}
    for axis in axes.flat:
        for handle, name in zip(*axis.get_legend_handles_labels()):
            labels.setdefault(name, handle)
    drawn.legend(
        list(labels.values()),
        list(labels),
        loc="outside upper center",
        ncols=columns,
        **plots.LEGEND,
    )


def fronts(points: dict[str, At], look: Look, path: Path) -> Path:
    """One row for each point, under its title; one column for each figure; one legend."""
    height_in = look.height_in * len(points) + look.legend_in
    drawn, axes = plots.new_figure(len(points), len(LABELS), height_in, look.width_in)
    for row, (title, at) in zip(axes, points.items()):
        for axis, (figure, text) in zip(row, LABELS.items()):
            _panel(axis, at, figure, look)
            axis.set_ylabel(text, **plots.LABEL)
        row[0].set_title(title, loc="left", **plots.TITLE)
    for axis in axes[-1]:
        axis.set_xlabel("switching frequency [kHz]", **plots.LABEL)
    one_legend(drawn, axes, look.columns)
    return plots.save(drawn, path)
