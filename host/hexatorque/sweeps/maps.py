"""A picture of a study: a panel a figure and scheme. Over two keys it is a map, over one a line for
each scheme; where points are drawn at random they are dots over the first two keys."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.metrics import UNITS
from ..analysis.plots import LABEL, TITLE, new_figure
from ..analysis.schemes import STYLE
from ..recording.formats import one_line, replacing
from .space import SCHEME, StudyError, unit_of
from .table import Results

#: More figures than this are not drawn: the picture would have too many panels.
MOST_FIGURES = 4
PANEL_IN = (3.6, 3.0)


def draw(results: Results, title: str, path: Path) -> Path:
    """The first figures over the first keys that vary and are numbers. What else varies is
    averaged."""
    cases = [results.space.case(int(n)) for n in np.flatnonzero(results.done)]
    rows = results.figures[results.done]
    keys = [axis.path for axis in results.space.design.axes]
    numeric = [key for key in keys if _varies([case.values[key] for case in cases])][:2]
    names = results.metrics[:MOST_FIGURES]
    if not cases or not numeric:
        raise StudyError("no picture: no key that is a number varies")
    over = np.array([[float(case.values[key]) for key in numeric] for case in cases])
    schemes = [str(case.values.get(SCHEME, "")) for case in cases]
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
            ax.set_title(f"{scheme} {name} [{UNITS[name]}]".strip(), **TITLE)
            ax.set_xlabel(_label(numeric[0]), **LABEL)
            if len(numeric) == 1:
                _lines(ax, over[:, 0], values, np.array(schemes))
                continue
            ax.set_ylabel(_label(numeric[1]), **LABEL)
            its = np.array([one == scheme for one in schemes])
            drawn = _map(ax, over[its], values[its], results.space.design.shares is None, span)
            figure.colorbar(drawn, ax=ax)
    try:
        with replacing(path) as draft:
            figure.savefig(draft)
    except OSError as error:
        raise StudyError(f"{path}: {one_line(error)}") from None
    return path


def _varies(values: list[Any]) -> bool:
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
    return numbers and len(set(values)) > 1


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
        ax.plot(at, mean, markersize=4, label=scheme, **STYLE.get(scheme, {"marker": "o"}))
    if any(schemes):
        ax.legend(frameon=False, fontsize=8)


def _map(ax: Any, x: np.ndarray, values: np.ndarray, grid: bool, span: tuple) -> Any:
    points, mean = _mean(x, values)
    limits = {"vmin": span[0], "vmax": span[1], "cmap": "viridis"}
    a, b = np.unique(points[:, 0]), np.unique(points[:, 1])
    if not grid or len(a) * len(b) != len(points):
        return ax.scatter(points[:, 0], points[:, 1], c=mean, s=14, **limits)
    ax.grid(False)
    # The points are in the order of the first key, then of the second.
    return ax.pcolormesh(a, b, mean.reshape(len(a), len(b)).T, shading="nearest", **limits)
