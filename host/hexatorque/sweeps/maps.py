"""Pictures of a study, a panel a figure.

`draw`: over two keys a map for each kind of drive, over one a line for each; where points are drawn
at random they are dots over the first two keys. `front`: over another figure, with the best
compromises. `sensitivity`: how much each key matters. `energies`: where the energy of
a drive cycle goes. A kind of drive is a scheme and a choice for each key whose values are words.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.plots import LABEL, TITLE, new_figure
from ..analysis.schemes import STYLE
from ..recording.formats import one_line, replacing
from ..setups import Setup
from .cycle import Cycle
from .errors import StudyError
from .sensitivity import indices
from .space import SCHEME, Axis, unit_of
from .table import Results
from .work import unit

#: More figures than this are not drawn: the picture would have too many panels.
MOST_FIGURES = 4
#: Of all other figures less is better.
MORE_IS_BETTER = ("efficiency_pct",)
#: A grid with so many values of each key has contours.
CONTOURS_FROM, CONTOURS = 5, 9
PANEL_IN = (3.6, 3.0)


def draw(results: Results, title: str, path: Path) -> Path:
    """The first figures over the first keys that vary and are numbers. What else varies is
    averaged."""
    cases = [results.space.case(int(n)) for n in np.flatnonzero(results.done)]
    rows = results.figures[results.done]
    numeric = [axis.path for axis in results.space.design.axes if _counts(axis)][:2]
    names = results.metrics[:MOST_FIGURES]
    if not cases or not numeric:
        raise StudyError("no picture: no key that is a number varies")
    over = np.array([[float(case.values[key]) for key in numeric] for case in cases])
    schemes = [_kind(results, int(n)) for n in np.flatnonzero(results.done)]
    panels = list(dict.fromkeys(schemes)) if len(numeric) == 2 else [""]
    figure, axes = new_figure(
        len(names), len(panels), PANEL_IN[1] * len(names), max(6.0, PANEL_IN[0] * len(panels))
    )
    figure.suptitle(title, fontsize=11)
    for row, name in enumerate(names):
        values = rows[:, row]
        good = values[np.isfinite(values)]
        span = (good.min(), good.max()) if good.size else (0.0, 1.0)
        for ax, scheme in zip(axes[row], panels):
            ax.set_title("\n".join(filter(None, (scheme, f"{name} [{unit(name)}]"))), **TITLE)
            ax.set_xlabel(_label(numeric[0]), **LABEL)
            if len(numeric) == 1:
                _lines(ax, over[:, 0], values, np.array(schemes))
                continue
            ax.set_ylabel(_label(numeric[1]), **LABEL)
            its = np.array([one == scheme for one in schemes])
            drawn = _map(ax, over[its], values[its], results.space.design.shares is None, span)
            figure.colorbar(drawn, ax=ax)
    return _save(figure, path)


def front(results: Results, title: str, over: str, path: Path) -> Path:
    """Every run as a dot over the figure `over`. The line joins the runs to which no other one is
    better in both figures: less is better, of an efficiency more."""
    names = [name for name in results.metrics if name != over][:MOST_FIGURES]
    if not names:
        raise StudyError(f"no picture: no other figure than {over}")
    numbers = np.flatnonzero(results.done)
    schemes = np.array([_kind(results, int(n)) for n in numbers])
    x = results.figures[numbers, results.metrics.index(over)]
    figure, axes = new_figure(1, len(names), PANEL_IN[1] + 1.0, max(6.0, PANEL_IN[0] * len(names)))
    figure.suptitle(title, fontsize=11)
    for ax, name in zip(axes[0], names):
        y = results.figures[numbers, results.metrics.index(name)]
        for scheme in dict.fromkeys(schemes):
            its = (schemes == scheme) & np.isfinite(x) & np.isfinite(y)
            style = {"color": None, **_style(scheme, list(schemes))}
            small = style | {"ls": "none", "ms": 3.0, "alpha": 0.45, "mew": 0}
            (dots,) = ax.plot(x[its], y[its], **small)
            best = _best(x[its], y[its], name in MORE_IS_BETTER)
            style["color"] = dots.get_color()
            ax.plot(x[its][best], y[its][best], ms=4.5, lw=1.4, label=scheme or None, **style)
        ax.set_xlabel(f"{over} [{unit(over)}]", **LABEL)
        ax.set_title(f"{name} [{unit(name)}]", **TITLE)
    if any(schemes):
        axes[0, 0].legend(frameon=False, fontsize=8)
    return _save(figure, path)


def _best(x: np.ndarray, y: np.ndarray, more: bool) -> list[int]:
    """Places of the points to which none is better in both, by rising x."""
    found: list[int] = []
    cost = -y if more else y
    for at in np.lexsort((cost, x)):
        if not found or cost[at] < cost[found[-1]]:
            found.append(int(at))
    return found


def sensitivity(results: Results, title: str, path: Path) -> Path:
    """The indices of a Sobol design as bars: pale what a key causes with others, with its 95 %
    range as a line, dark alone."""
    lines = list(indices(results))
    names = results.metrics[:MOST_FIGURES]
    keys = list(dict.fromkeys(line[2] for line in lines))
    schemes = list(dict.fromkeys(line[0] for line in lines))
    height_in = 1.2 + 0.26 * len(keys) * len(schemes)
    figure, axes = new_figure(1, len(names), height_in, 2.2 + 2.4 * len(names), sharey=True)
    words = "share of the variance that a key causes alone (dark) and with others (pale, 95 %)"
    figure.suptitle(f"{title}: {words}", fontsize=11)
    width = 0.8 / len(schemes)
    for ax, name in zip(axes[0], names):
        for k, scheme in enumerate(schemes):
            its = [line for line in lines if line[0] == scheme and line[1] == name]
            at = [keys.index(line[2]) + (k - (len(schemes) - 1) / 2) * width for line in its]
            colour = STYLE.get(scheme, {}).get("color", "#0072b2")
            joint = [max(0.0, line[5]) for line in its]
            ax.barh(at, joint, 0.9 * width, color=colour, alpha=0.3)
            ax.errorbar(joint, at, xerr=[line[6] for line in its], fmt="none", ecolor="0.4", lw=0.8)
            alone = [max(0.0, line[3]) for line in its]
            ax.barh(at, alone, 0.9 * width, color=colour, label=scheme or None)
        ax.set_title(name, **TITLE)
        ax.set_xlim(0, 1.05)
    axes[0, 0].set_yticks(range(len(keys)), keys, fontsize=8)
    axes[0, 0].invert_yaxis()
    if any(schemes):
        axes[0, -1].legend(frameon=False, fontsize=8)
    return _save(figure, path)


#: Parts of the lost energy, and what is left of it.
PARTS = {
    "copper_loss_Wh": ("stator copper", "#0072b2"),
    "conduction_loss_Wh": ("conduction", "#e69f00"),
    "switching_loss_Wh": ("switching", "#d55e00"),
}
REST = ("rotor, iron and friction", "#999999")


def energies(results: Results, title: str, cycle: Cycle, setup: Setup, path: Path) -> Path:
    """The cycle, and below it where each scheme loses energy. Without the parts, the figures that
    there are, as bars."""
    numbers = [int(n) for n in np.flatnonzero(results.done) if n not in results.failures]
    if not numbers:
        raise StudyError("no picture: no run has figures")
    names = [_kind(results, n) for n in numbers]
    seen = list(dict.fromkeys(names))

    def mean(figure: str) -> np.ndarray:
        """The mean of a figure over the seeds, for each scheme; 0 if it was not asked for or is not
        known."""
        if figure not in results.metrics:
            return np.zeros(len(seen))
        values = np.nan_to_num(results.figures[numbers, results.metrics.index(figure)])
        return np.array([values[[one == name for one in names]].mean() for name in seen])

    shown = [name for name in PARTS if name in results.metrics]
    if "loss_Wh" not in results.metrics:
        raise StudyError("no picture: the metric loss_Wh is needed")
    figure, axes = new_figure(3, 1, 5.4 + 0.3 * len(seen), 8.0)
    figure.suptitle(title, fontsize=11)
    speed_rpm, torque_Nm = cycle.over(setup)
    for ax, values, label in (
        (axes[0, 0], speed_rpm, "speed [r/min]"),
        (axes[1, 0], torque_Nm, "torque at the shaft [N m]"),
    ):
        ax.plot(cycle.time_s, values, color="#333333", lw=1.2)
        ax.set_title(f"{cycle.name}: {label}", **TITLE)
        ax.set_xlabel("time [s]", **LABEL)
        ax.set_xlim(0, cycle.duration_s)
    ax, left = axes[2, 0], np.zeros(len(seen))
    rest = mean("loss_Wh") - sum((mean(name) for name in shown), np.zeros(len(seen)))
    for values, (label, colour) in [*((mean(name), PARTS[name]) for name in shown), (rest, REST)]:
        ax.barh(range(len(seen)), values, 0.65, left, color=colour, label=label)
        left = left + values
    for k, (total_Wh, percent) in enumerate(zip(left, mean("efficiency_pct"))):
        said = f" {total_Wh:.3g} Wh" + (f", efficiency {percent:.1f} %" if percent else "")
        ax.text(total_Wh, k, said, va="center", fontsize=8)
    ax.set_yticks(range(len(seen)), seen)
    ax.invert_yaxis()
    ax.set_xlim(0, 1.35 * left.max())
    ax.set_xlabel("lost over the cycle [Wh]", **LABEL)
    ax.legend(frameon=False, fontsize=8, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.3))
    return _save(figure, path)


def _save(figure: Any, path: Path) -> Path:
    try:
        with replacing(path) as draft:
            figure.savefig(draft)
    except OSError as error:
        raise StudyError(f"{path}: {one_line(error)}") from None
    return path


def over_numbers(results: Results) -> bool:
    """Whether a key that is a number varies, so that there is something to draw over."""
    return any(_counts(axis) for axis in results.space.design.axes)


def _counts(axis: Axis) -> bool:
    """Whether it is a number that varies."""
    return axis.free and all(
        isinstance(value, (int, float)) and not isinstance(value, bool) for value in axis.values
    )


def _kind(results: Results, number: int) -> str:
    """The scheme of a run, and its choice for each key whose values are words."""
    values = results.space.case(number).values
    words = [
        f"{axis.path.rpartition('.')[2]} {values[axis.path]}"
        for axis in results.space.design.axes
        if axis.free and axis.path != SCHEME and not _counts(axis)
    ]
    scheme = [str(values[SCHEME])] if SCHEME in values else []
    return ", ".join(scheme + words)


def _style(kind: str, kinds: list[str]) -> dict[str, Any]:
    """A scheme's own colour and marker. Its second and third kind have empty markers and dashes."""
    scheme = kind.partition(",")[0]
    alike = [one for one in dict.fromkeys(kinds) if one.partition(",")[0] == scheme]
    style: dict[str, Any] = {"marker": "o", **STYLE.get(scheme, {})}
    if at := alike.index(kind):
        style |= {"ls": ("--", ":", "-.")[(at - 1) % 3], "mfc": "none"}
    return style


def _label(path: str) -> str:
    unit = unit_of(path)
    return f"{path} [{unit}]" if unit else path


def _mean(x: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distinct rows of `x`, and the mean of the values of each; NaN where there is none."""
    distinct, place = np.unique(x, axis=0, return_inverse=True)
    place, good = place.ravel(), np.isfinite(values)
    total = np.bincount(place[good], values[good], len(distinct))
    count = np.bincount(place[good], minlength=len(distinct))
    return distinct, np.where(count, total / np.maximum(count, 1), math.nan)


def _lines(ax: Any, x: np.ndarray, values: np.ndarray, schemes: np.ndarray) -> None:
    for scheme in dict.fromkeys(schemes):
        at, mean = _mean(x[schemes == scheme], values[schemes == scheme])
        ax.plot(at, mean, markersize=4, label=scheme, **_style(scheme, list(schemes)))
    if any(schemes):
        ax.legend(frameon=False, fontsize=8)


def _map(ax: Any, x: np.ndarray, values: np.ndarray, grid: bool, span: tuple) -> Any:
    from matplotlib.ticker import MaxNLocator

    points, mean = _mean(x, values)
    limits = {"vmin": span[0], "vmax": span[1], "cmap": "viridis"}
    a, b = np.unique(points[:, 0]), np.unique(points[:, 1])
    if not grid or len(a) * len(b) != len(points):
        return ax.scatter(points[:, 0], points[:, 1], c=mean, s=14, **limits)
    ax.grid(False)
    # The points are in the order of the first key, then of the second.
    field = np.ma.masked_invalid(mean.reshape(len(a), len(b)).T)
    if min(len(a), len(b)) < CONTOURS_FROM or span[0] == span[1]:
        return ax.pcolormesh(a, b, field, shading="nearest", **limits)
    levels = MaxNLocator(CONTOURS).tick_values(*span)
    lines = ax.contour(a, b, field, levels, colors="white", linewidths=0.6)
    ax.clabel(lines, fontsize=6.5)
    return ax.contourf(a, b, field, levels, zorder=0, **limits)
