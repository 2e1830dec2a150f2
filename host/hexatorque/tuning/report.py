"""The results of a tuning: a set-up, a report with the trade-off, and the same as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import firmware
from ..setups import SetupError, builtin_names, parameters
from ..setups.loading import builtin_text, source_of
from ..setups.paths import CONTROLLER
from ..setups.values import Value
from . import space
from .aim import PARTS
from .tuning import Outcome, Tuned, note

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Panels side by side.
COLUMNS = 3


def make_folder(folder: Path) -> None:
    """Make it before anything runs."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SetupError(f"{folder}: {error.strerror}") from None


def setup_text(tuned: Tuned, source: str) -> str:
    """The user's file, or the built-in set-up, with the tuned values and those that the command
    gave, and all else as it was. `source`: its name or path."""
    built_in = source in builtin_names()
    from ..setups import load
    from . import edit

    path = Path(source)
    text = builtin_text(source) if built_in else edit.moved(source_of(path), path.parent)
    given = load(source)
    changes: dict[str, dict[str, Value]] = {}
    for section, values in tuned.request.setup.values.items():
        other = {k: v for k, v in values.items() if given[f"{section}.{k}"] != v.value}
        if section == CONTROLLER:
            other |= space.tagged(tuned.best.chosen, note(tuned.request))
        if other:
            changes[section] = other
    return edit.edited(text, changes) if changes else text


def rows_of_parameters(tuned: Tuned) -> list[tuple[str, float, float, str]]:
    """Name, value before, value after and unit of each parameter that differs; a derived one may
    follow a tuned one."""
    before, after = parameters(tuned.request.setup), parameters(tuned.setup)
    table = firmware.parameters()
    return [
        (name, float(before[name]), float(after[name]), table[name].unit)
        for name in before
        if before[name] != after[name]
    ]


def rows_of_figures(tuned: Tuned) -> list[tuple[str, str, str, float, float, int]]:
    """Point, figure, unit, value before, value after and digits."""
    rows = []
    for point, a, b in zip(tuned.request.points, tuned.start.figures, tuned.best.figures):
        for part in PARTS.values():
            values = (getattr(one, part.figure) for one in (a, b))
            rows.append((str(point), part.title, part.unit, *values, part.digits))
    return rows


def change(before: float, after: float) -> str:
    return f"{100 * (after / before - 1):+.0f} %" if before > 0 else "–"


def front(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """The candidates than which no other one has both less ripple and a lower switching frequency,
    means over the points, from the lowest frequency on."""
    best, found = math.inf, []
    for outcome in sorted((o for o in outcomes if not o.lost), key=trade_off):
        if trade_off(outcome)[1] < best:
            best = trade_off(outcome)[1]
            found.append(outcome)
    return found


def trade_off(outcome: Outcome) -> tuple[float, float]:
    """Switching frequency and torque ripple, means over the points."""
    return _mean(outcome, "f_sw_Hz"), _mean(outcome, "torque_ripple_td_Nm")


def _mean(outcome: Outcome, figure: str) -> float:
    return sum(getattr(at, figure) for at in outcome.figures) / len(outcome.figures)


def as_json(tuned: Tuned, file: Path, report: Path) -> dict[str, Any]:
    request = tuned.request
    return {
        "setup": request.setup.name,
        "scheme": str(request.setup.parameter("scheme")),
        "points": [{"speed_rpm": p.speed_rpm, "load_Nm": p.load_Nm} for p in request.points],
        "weights": request.weights,
        "seed": request.seed,
        "trials": len(tuned.tried),
        "lost": sum(bool(o.lost) for o in tuned.tried),
        "refused": tuned.refused,
        "better": tuned.better,
        "ratio": math.exp(tuned.best.aim),
        "parameters": {
            name: {"before": a, "after": b, "unit": unit}
            for name, a, b, unit in rows_of_parameters(tuned)
        },
        "before": [figures.as_json() for figures in tuned.start.figures],
        "after": [figures.as_json() for figures in tuned.best.figures],
        "errors": {name: {"before": a, "after": b} for name, (a, b) in tuned.errors.items()},
        "front": [
            {"f_sw_Hz": trade_off(o)[0], "torque_ripple_td_Nm": trade_off(o)[1], **o.chosen}
            for o in front(tuned.tried)
        ],
        "file": str(file),
        "report": str(report),
    }


def write(tuned: Tuned, source: str, folder: Path, command: str) -> dict[str, Any]:
    """The set-up, the picture, the report and tune.json into an existing folder. Returns what
    tune.json says."""
    from ..analysis.pages import write_page
    from ..analysis.report import picture_source

    request = tuned.request
    file, report = folder / f"{request.setup.name}-tuned.toml", folder / "report.html"
    file.write_text(setup_text(tuned, source), encoding="utf-8")
    picture = draw(tuned, folder / "trade-off.png")
    result = as_json(tuned, file, report)
    (folder / "tune.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    names = list(dict.fromkeys(name for o in front(tuned.tried) for name in o.chosen))
    write_page(
        report,
        "tuning.html",
        title=f"Tuning of {request.setup.name}",
        result=result,
        saved=f"{100 * (1 - result['ratio']):.0f}",
        parameters=[
            (name, f"{a:.4g}", f"{b:.4g}", unit) for name, a, b, unit in rows_of_parameters(tuned)
        ],
        figures=[
            (point, f"{title} [{unit}]", f"{a:.{digits}f}", f"{b:.{digits}f}", change(a, b))
            for point, title, unit, a, b, digits in rows_of_figures(tuned)
        ],
        weights=[(PARTS[name].title, f"{w:g}") for name, w in request.weights.items()],
        errors=[(name, a or "holds", b or "holds") for name, (a, b) in tuned.errors.items()],
        picture=picture_source(picture),
        front_names=names,
        front=[
            (
                *(f"{value:.4g}" for value in trade_off(o)),
                *(f"{o.chosen[name]:.4g}" if name in o.chosen else "as before" for name in names),
            )
            for o in front(tuned.tried)
        ],
        command=command,
    )
    return result


def draw(tuned: Tuned, path: Path) -> Path:
    """Torque ripple against switching frequency of every candidate that holds, a panel for each
    point."""
    from ..analysis import plots

    points = tuned.request.points
    columns = min(COLUMNS, len(points))
    rows = -(-len(points) // columns)
    figure, axes = plots.new_figure(rows, columns, 3.6 * rows)
    for k, axis in enumerate(axes.flat):
        if k >= len(points):
            axis.set_visible(False)
            continue
        held = [o.figures[k] for o in tuned.tried if not o.lost]
        _panel(axis, [(f.f_sw_Hz, f.torque_ripple_td_Nm) for f in held], plots)
        for outcome, marker, colour, label in (
            (tuned.start, "s", plots.COLOUR["torque"], "before"),
            (tuned.best, "*", plots.COLOUR["i_x"], "chosen"),
        ):
            f = outcome.figures[k]
            axis.plot(f.f_sw_Hz / 1e3, f.torque_ripple_td_Nm, marker, ms=11, color=colour,
                      markeredgecolor="white", label=label)  # fmt: skip
        axis.set_title(str(points[k]), **plots.TITLE)
        axis.set_xlabel("switching frequency [kHz]", **plots.LABEL)
        axis.set_ylim(0, None)
    axes[0, 0].set_ylabel("torque ripple Td [N m]", **plots.LABEL)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4, **plots.LEGEND)
    return plots.save(figure, path)


def _panel(axis: Axes, pairs: Sequence[tuple[float, float]], plots: Any) -> None:
    """Every candidate, and the staircase of the lowest ripple within each switching frequency."""
    axis.plot([f / 1e3 for f, _ in pairs], [t for _, t in pairs], ".", ms=5, alpha=0.5,
              color=plots.COLOUR["i_u1"], label="candidates")  # fmt: skip
    stairs: list[tuple[float, float]] = []
    for f, t in sorted(pairs):
        if not stairs or t < stairs[-1][1]:
            stairs.append((f, t))
    last = (max(f for f, _ in pairs), stairs[-1][1])
    axis.step([f / 1e3 for f, _ in (*stairs, last)], [t for _, t in (*stairs, last)], where="post",
              color=plots.COLOUR["i_u1"], lw=1.2, label="best within a frequency")  # fmt: skip
