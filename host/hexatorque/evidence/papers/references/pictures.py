"""The fronts of all methods over switching frequency."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....analysis.schemes import STYLE
from ..fsw.pictures import carrier_line, logarithmic, page, staircase
from .judging import At
from .places import MACHINES, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Last switching frequency on the axis.
LAST_KHZ = 8.0
LAW_COLOURS = {
    "dtc-svm": "#17becf",
    "lvv-mpc": "#bcbd22",
    "vv-mpc": "#9467bd",
    "fcs-mpc": "#e0007f",
}


def _style(name: str) -> dict[str, Any]:
    if name in LAW_COLOURS:
        return {"color": LAW_COLOURS[name], "linestyle": (0, (4, 1.2)), "linewidth": 1.5}
    # Wider lines lie below those that often cover them.
    width = {"fdr": 2.6, "db-dtfc": 3.2, "foc": 2.2}.get(name, 1.2)
    return {"color": STYLE[name]["color"], "linewidth": width}


def _panel(axis: Axes, at: At, figure: str) -> None:
    for name, rows in at.rows.items():
        staircase(axis, rows, figure, LAST_KHZ, label=name, **_style(name))
    if figure != "loss_W":
        if line := at.line(1e3):
            carrier_line(axis, getattr(line, figure), LAST_KHZ)
        logarithmic(axis)
    axis.set_xlim(0.5, LAST_KHZ)


def fronts(points: list[At], path: Path) -> Path:
    rows = {f"{label(at.place)}: {at.m_pu:.2f} V_dc": at for at in points}
    return page(rows, _panel, path, 2.5 * len(points) + 1.0, 11.0, 7)


def draw(points: list[At], path: Path) -> Path:
    """The machines' last points at `path`; the others beside it."""
    last = [machine.place for machine in MACHINES]
    others = [at for at in points if at.place not in last]
    if others:
        fronts(others, path.with_stem(f"{path.stem}-others"))
    return fronts([at for at in points if at.place in last], path)
