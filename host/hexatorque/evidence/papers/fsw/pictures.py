"""The fronts of all schemes over switching frequency, and our ratios at all points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ....analysis import plots
from ....analysis.schemes import STYLE
from .judging import TARGETS, At
from .points import A, B
from .search import JUDGED, OURS

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

#: What a row of the picture shows.
Row = TypeVar("Row")
LABELS = {
    "td_Nm": "Td [N m]",
    "thd_inf_pct": "THD∞ [%]",
    "ixy_rms_A": "x–y rms [A]",
    "loss_W": "loss [W]",
}
#: Last switching frequency on the axis.
LAST_KHZ = 6.0
#: Points of the short picture: low, medium and high voltage, and another machine.
SHOWN = (("A", 100, 10), ("A", 900, 10), ("B", 2500, 2), ("B", 3500, 2))
DASHES = {"κ=0": "-", "κ=1": "-", "alternating": "-", "free": ":"}
INK = {"κ=0": "#cc79a7", "κ=1": "#882255", "alternating": "#999933", "free": "#332288"}


def envelope(f_sw_Hz: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest value within each switching frequency: the corners of a falling staircase."""
    order = np.lexsort((values, f_sw_Hz))
    f, v = f_sw_Hz[order], np.minimum.accumulate(values[order])
    corner = np.concatenate(([True], v[1:] < v[:-1])) if len(v) else np.zeros(0, bool)
    return f[corner], v[corner]


def _style(name: str) -> dict[str, Any]:
    if not name.startswith(OURS):
        # FDR's line is wider, because DDR's often covers it.
        return {"color": STYLE[name]["color"], "linewidth": 2.6 if name == "fdr" else 1.2}
    kind = name.removeprefix(OURS).strip()
    return {"color": INK[kind], "linewidth": 2.0, "linestyle": DASHES[kind]}


def staircase(axis: Axes, rows: list[dict], figure: str, last_kHz: float, **style: Any) -> None:
    """The best value of a figure within each switching frequency."""
    f_kHz = np.array([row["f_sw_Hz"] for row in rows]) / 1e3
    f, v = envelope(f_kHz, np.array([row[figure] for row in rows]))
    if len(f):
        f, v = np.append(f, max(f[-1], last_kHz)), np.append(v, v[-1])
        axis.step(f, v, where="post", **style)


def carrier_line(axis: Axes, at_1kHz: float, last_kHz: float) -> None:
    """The ripple of carrier modulation falls with the switching frequency."""
    f_kHz = np.linspace(1.0, last_kHz, 29)
    label = "carrier modulation, computed"
    axis.plot(f_kHz, at_1kHz / f_kHz, "--", color=plots.INK, linewidth=1.1, label=label)


def logarithmic(axis: Axes) -> None:
    """The vertical axis, with 1, 2 and 5 of each decade named."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set_yscale("log")
    axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.yaxis.set_minor_locator(NullLocator())


def _panel(axis: Axes, at: At, figure: str) -> None:
    for name, rows in at.rows.items():
        style = _style(name)
        f_kHz = [row["f_sw_Hz"] / 1e3 for row in rows]
        values = [row[figure] for row in rows]
        axis.plot(f_kHz, values, ".", color=style["color"], alpha=0.25, markersize=2.5)
        staircase(axis, rows, figure, LAST_KHZ, label=name, **style)
    if figure != "loss_W":
        if line := at.line(1e3):
            carrier_line(axis, getattr(line, figure), LAST_KHZ)
        logarithmic(axis)
    axis.set_xlim(0, LAST_KHZ)
    shown = [r[figure] for rows in at.rows.values() for r in rows if r["f_sw_Hz"] < 1e3 * LAST_KHZ]
    if shown and figure == "loss_W":
        axis.set_ylim(0.98 * min(shown), min(1.02 * max(shown), 1.6 * min(shown)))


def page(
    rows: dict[str, Row],
    panel: Callable[[Axes, Row, str], None],
    path: Path,
    height_in: float,
    width_in: float,
    columns: int,
) -> Path:
    """One row a point, under its title; one column a figure, which the panel draws; one legend of
    so many columns."""
    drawn, axes = plots.new_figure(len(rows), len(JUDGED), height_in, width_in)
    for row, (title, at) in zip(axes, rows.items()):
        for axis, figure in zip(row, JUDGED):
            panel(axis, at, figure)
            axis.set_ylabel(LABELS[figure], **plots.LABEL)
        row[0].set_title(title, loc="left", **plots.TITLE)
    for axis in axes[-1]:
        axis.set_xlabel("switching frequency [kHz]", **plots.LABEL)
    labels: dict[str, Artist] = {}
    for axis in axes.flat:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            labels.setdefault(label, handle)
    drawn.legend(
        list(labels.values()),
        list(labels),
        loc="outside upper center",
        ncols=columns,
        **plots.LEGEND,
    )
    return plots.save(drawn, path)


def fronts(points: list[At], path: Path) -> Path:
    rows = {at.place.name: at for at in points}
    return page(rows, _panel, path, 2.1 * len(points) + 0.8, 12.0, 5)


def ratios(points: list[At], path: Path) -> Path:
    """Ours over the best table setting at every point, and the targets."""
    drawn, axes = plots.new_figure(1, 2, 0.28 * len(points) + 1.4, 10.0, sharey=True)
    names = [at.place.name for at in points]
    for axis, target in zip(axes[0], TARGETS):
        for key, most, marker, colour, word in (
            ("td_ratio", target.td, "o", "#0072b2", "Td"),
            ("thd_ratio", target.thd, "s", "#d55e00", "THD∞"),
        ):
            found = [(n, row[key]) for n, at in enumerate(points) if (row := at.ratios(target))]
            if found:
                y, x = zip(*found)
                axis.plot(x, y, marker, color=colour, markersize=5, label=word)
            axis.axvline(most, color=colour, linewidth=1, linestyle="--", label=f"target {most:g}")
        axis.axvline(1, color=plots.INK, linewidth=0.8)
        axis.set_xscale("log")
        ticks = (0.1, 0.2, 0.5, 1, 2)
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.minorticks_off()
        axis.set_xlabel("over the best table setting", **plots.LABEL)
        title = target.variant
        if target.sampled_Hz < 1e9:
            title += f", table schemes sampled at ≤ {target.sampled_Hz / 1e3:g} kHz"
        axis.set_title(title, **plots.TITLE)
        axis.legend(**plots.LEGEND)
    axes[0, 0].set_yticks(range(len(names)), names)
    axes[0, 0].invert_yaxis()
    return plots.save(drawn, path)


def draw(points: list[At], path: Path) -> Path:
    """The short picture at `path`; beside it all ratios, and all points of each machine if they are
    more than the short picture shows."""
    ratios(points, path.with_stem(f"{path.stem}-ratios"))
    if len(points) > len(SHOWN):
        for letter, setup in (("A", A), ("B", B)):
            own = [at for at in points if at.place.setup == setup]
            fronts(own, path.with_stem(f"{path.stem}-{letter}"))
    wanted = [
        at for at in points if (at.place.name[0], at.place.speed_rpm, at.place.torque_Nm) in SHOWN
    ]
    return fronts(wanted, path)
