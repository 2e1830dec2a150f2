"""Paper A's transients, Fig. 11 to 14: do FDR and DDR respond alike?"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....analysis import plots
from ..engine.figure import Figure, beside, not_printed
from ..engine.job import Job
from . import common as a
from .steps import MEAN_S, SPEED_BAND, TORQUE_BAND, Pair, Step, overlap, pairs, verdicts

XY = ("plant.i_x_A", "plant.i_y_A")
SPEED, TORQUE = ("plant.speed_rpm",), ("plant.torque_Nm",)
U1, U2 = ("plant.i_u1_A",), ("plant.i_u2_A",)
LABELS = {
    XY: "x–y currents [A]",
    XY[:1]: "$i_x$ [A]",
    SPEED: "speed [r/min]",
    TORQUE: "torque [N m]",
    U1: "$i_{u1}$ [A]",
    U2: "$i_{u2}$ [A]",
}


def _draw(
    shown: dict[str, Pair], rows: list[tuple[str, ...]], span_s: tuple[float, float]
) -> Callable[[Path], Path]:
    """Draws a pair of columns, FDR and DDR, for each of `shown`. The other scheme is black and
    dashed."""

    styles: dict[str, dict[str, Any]] = {
        "plant.torque_Nm": {"linewidth": 0.4, "alpha": 0.45, "label": None},
        "plant.speed_rpm": {"linewidth": 2.5},
    }

    def draw(path: Path) -> Path:
        columns = 2 * len(shown)
        width_in = plots.WIDTH_IN if columns == 2 else 11.5
        figure, axes = plots.new_figure(
            len(rows), columns, 0.6 + 1.75 * len(rows), width_in, sharey="row", sharex="all"
        )
        places = [(title, pair, s) for title, pair in shown.items() for s in a.SCHEMES]
        for column, (title, pair, scheme) in zip(axes.T, places):
            rec = pair.recordings[scheme].window(*span_s)
            t = rec.time_s
            other = a.SCHEMES[scheme == "fdr"]
            whole_s = pair.recordings[scheme].time_s
            inside = (whole_s >= t[0] - 1e-9) & (whole_s <= t[-1] + 1e-9)
            for ax, names in zip(column, rows):
                for name in names:
                    a.trace(ax, t, rec[name], name, **styles.get(name, {}))
                    if name == "plant.torque_Nm":
                        own = pair.curves[scheme][name][inside]
                        a.trace(ax, t, own, name, linewidth=2.0, label="$T_e$, mean")
                    if name in pair.curves[other]:
                        curve = pair.curves[other][name][inside]
                        ax.plot(*plots.thin(t, curve), "--", color=plots.INK, linewidth=0.9,
                                label=f"{a.NAMES[other]}, mean")  # fmt: skip
                ax.axvline(pair.step.at_s, color="#9aa1ab", linewidth=0.8, linestyle=":")
            column[0].set_title(f"{a.NAMES[scheme]}{title}", **plots.TITLE)
            column[-1].set_xlabel("time [s]", **plots.LABEL)
        for row, names in zip(axes, rows):
            row[0].set_ylabel(LABELS[names], **plots.LABEL)
            for ax in row if names in (SPEED, TORQUE) else ():
                ax.legend(loc="best", handlelength=1.8, **plots.LEGEND)
            if len(names) > 1:
                row[-1].legend(loc="center left", bbox_to_anchor=(1, 0.5), **plots.LEGEND)
        axes[0, 0].set_xlim(*span_s)
        return plots.save(figure, path)

    return draw


def _figure(
    job: Job,
    shown: dict[str, Step],
    rows: list[tuple[str, ...]],
    span_s: tuple[float, float],
    caption: str,
    gains: Step | None = None,
) -> Figure:
    """shown: title -> step; these are drawn and judged. gains: a step with the printed gains of the
    speed loop, of which only the curves are judged."""
    made = dict(zip(shown, pairs(job, shown.values(), 4 if job.quick else 12)))
    found = []
    for title, pair in made.items():
        judge = verdicts if pair.step.reached else overlap
        found += judge(pair, _prefix(title))
    every = dict(made)
    if gains:
        [slow] = pairs(job, [gains], 2 if job.quick else 4)
        every["printed gains"] = slow
        fdr_ms, ddr_ms = (1e3 * slow.figures[s]["speed_settling_s"] for s in a.SCHEMES)
        found += overlap(slow, "printed gains: ")
        found.append(
            not_printed("printed gains: settling time of speed", a.arrow(fdr_ms, ddr_ms, "ms", 0))
        )
        caption += (
            " The speed loop has the printed K_p, but K_i = 2 N m/rad. With the printed 0.2 N m/"
            "rad the speed takes seconds to settle (see the verdicts with printed gains)."
        )
    names = tuple(dict.fromkeys(name for row in rows for name in (*row, *SPEED, *TORQUE)))
    return Figure(
        metrics={
            _prefix(title).rstrip(": ") or "step": {
                **{s: _finite(figures) for s, figures in pair.figures.items()},
                "apart": {name: pair.apart(name) for name in (*SPEED, *TORQUE)},
            }
            for title, pair in every.items()
        },
        verdicts=found,
        draw=_draw(made, rows, span_s),
        recordings={
            f"{s}-{title.strip(', ').replace(' ', '-')}".rstrip("-"):
            a.extract(pair.recordings[s], names, every=2)
            for title, pair in made.items()
            for s in a.SCHEMES
        },
        setups=[pair.step.setup(s) for pair in every.values() for s in a.SCHEMES],
        caption=f"{caption} Black and dashed: the other scheme's mean curve over several instants "
        f"of the step. Speed and torque are evaluated as means over {1e3 * MEAN_S:.0f} ms. They "
        f"have settled when they stay within {SPEED_BAND:.0%} of rated speed or {TORQUE_BAND:.0%} "
        "of rated torque.",
    )  # fmt: skip


def _finite(figures: dict[str, float]) -> dict[str, float | None]:
    return {key: value if math.isfinite(value) else None for key, value in figures.items()}


def _prefix(title: str) -> str:
    title = title.strip(", ")
    return f"{title}: " if title else ""


def _share(share: float) -> float:
    """Load torque in N m."""
    return share * a.rated()[1]


def a11(job: Job) -> Figure:
    """+400 to -400 r/min without load."""
    step = Step(400.0, 0.0, "speed_ref_rpm", -400.0, 0.3, 2.0, -400.0, 0.0)
    gains = replace(step, set_up=a.PRINTED)
    return _figure(job, {"": step}, [XY, U2, SPEED], (0.0, 1.6), "Reversal without load.", gains)


def a12(job: Job) -> Figure:
    """-400 to +400 r/min at 75 % load: one load that keeps its sign, and one that always brakes."""
    load_Nm = _share(0.75)
    step = Step(-400.0, -load_Nm, "speed_ref_rpm", 400.0, 0.3, 2.0, 400.0, load_Nm)
    brake = replace(step, load_Nm=load_Nm, load="friction")
    return _figure(
        job, {", load of one sign": step, ", load brakes": brake},
        [SPEED, TORQUE, U1, XY[:1]], (0.0, 1.6),
        "Reversal at 75 % of rated torque. The paper does not say in which direction its load "
        "acts. Left: the load keeps its sign, so it drives before the reversal and brakes after "
        "it. Right: the load always brakes.",
        replace(step, set_up=a.PRINTED),
    )  # fmt: skip


def load_step() -> Step:
    load_Nm = _share(0.75)
    return Step(400.0, 0.0, "load_Nm", load_Nm, 0.3, 2.0, 400.0, load_Nm)


def a13(job: Job) -> Figure:
    """75 % load step at 400 r/min."""
    step = load_step()
    gains = replace(step, set_up=a.PRINTED, duration_s=7.0)
    return _figure(job, {"": step}, [XY, U2, TORQUE], (0.0, 1.2),
                   "Load step of 75 % of rated torque.", gains)  # fmt: skip


def a14(job: Job) -> Figure:
    """Rated load taken off at 1350 r/min."""
    speed_rpm, load_Nm = a.rated()
    step = Step(speed_rpm, load_Nm, "load_Nm", 0.0, 0.3, 2.0, speed_rpm, 0.0)
    printed = replace(step, set_up=a.PRINTED, reached=False)
    figure = _figure(
        job, {", field weakening": step, ", as printed": printed},
        [SPEED, TORQUE, U1, XY[:1]], (0.0, 1.2),
        "The rated load is taken off; the speed reference is 1350 r/min. Right: as printed, with "
        "0.6 Wb at 250 V. These values do not allow that speed. The drive does not trip; before "
        "and after the step it runs as fast as the voltage allows.",
    )  # fmt: skip
    for scheme in a.SCHEMES:
        rec = figure.recordings[f"{scheme}-as-printed"]
        before, after = (
            float(part["plant.speed_rpm"].mean())
            for part in (rec.window(0, step.at_s), rec.window(step.duration_s - 0.5, 9))
        )
        figure.verdicts.append(
            beside(f"as printed: speed under rated load, {a.NAMES[scheme]}", before, speed_rpm,
                   "r/min", within=0.02, why=a.infeasible())
        )  # fmt: skip
        figure.verdicts.append(
            beside(f"as printed: speed without load, {a.NAMES[scheme]}", after, speed_rpm,
                   "r/min", within=0.02, why=a.infeasible())
        )  # fmt: skip
    return figure
