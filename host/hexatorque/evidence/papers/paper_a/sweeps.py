"""Paper A, Fig. 15: switching frequency and THD over speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....analysis import plots
from ....analysis.schemes import STYLE
from ....experiments.operating_points import Point
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, claim, not_printed
from ..engine.job import Job
from . import common as a
from .what_if import NEAREST, machine

#: Classical DTC is paper B's DTC1: one large vector a period.
SCHEMES = ("dtc1", *a.SCHEMES)
NAMES = {"dtc1": "classical DTC", **a.NAMES}
QUICK_RPM = (100.0, 400.0, 800.0, 1350.0)
FULL_RPM = (100.0, 200.0, 400.0, 600.0, 800.0, 1000.0, 1100.0, 1200.0, 1350.0)
#: "The same": the means over the speeds differ by no more than this.
SAME = 0.03
#: Name of the variation of Table IV whose f_sw is nearest to the printed one.
OTHER_NAME = f"leakage × {NEAREST[0]:g}, drops {NEAREST[1]:g} V"
COLOURS = {name: STYLE[name]["color"] for name in ("dtc1", "fdr", "ddr")}

#: Name -> (load, scheme) -> value at each speed.
Sweep = dict[str, dict[tuple[float, str], np.ndarray]]


def _sweep(
    job: Job,
    speeds: tuple[float, ...],
    loads: tuple[float, float],
    schemes: tuple[str, ...],
    count: int,
    **changes: float,
) -> tuple[Sweep, Sweep]:
    """Means over `count` neighbouring speeds, and their half spreads. NaN if the drive does not
    reach a point."""
    near = a.NEAR[:count]
    points = [
        Point(a.setup(s, **changes), n * speed, load)
        for load in loads
        for s in schemes
        for speed in speeds
        for n in near
    ]
    found = iter(job.metrics(points))
    names = ("f_sw_Hz", "ixy_rms_A", "h5_pct", "delta_i_A", *a.BANDS)
    middle: Sweep = {name: {} for name in names}
    spread: Sweep = {name: {} for name in names}
    for load in loads:
        for s in schemes:
            rows = [[_flat(next(found)) for _ in near] for _ in speeds]
            for name in names:
                values = np.array([[row.get(name, np.nan) for row in point] for point in rows])
                middle[name][load, s] = values.mean(axis=1)
                spread[name][load, s] = np.ptp(values, axis=1) / 2
    return middle, spread


def _flat(row: dict | None) -> dict[str, float]:
    return {**row, **row["thd_pct"]} if row else {}


def _verdicts(
    found: tuple[Sweep, Sweep],
    other: tuple[Sweep, Sweep],
    speeds: tuple[float, ...],
    loads: tuple[float, ...],
) -> list[Verdict]:
    """found: means and half spreads of all schemes; other: those of FDR and DDR with the variation
    OTHER_NAME."""
    sweep, _ = found
    rows: list[Verdict] = []
    for load, when in zip(loads, ("no load", "rated load")):
        fsw = {s: sweep["f_sw_Hz"][load, s] for s in SCHEMES}
        apart = float(np.mean(fsw["ddr"]) / np.mean(fsw["fdr"])) - 1
        lowest = np.minimum(fsw["fdr"], fsw["ddr"]) / fsw["dtc1"]
        rows += [
            claim(f"{when}: every scheme runs at every speed",
                  all(np.isfinite(values).all() for values in fsw.values()),
                  f"{sum(np.isfinite(v).sum() for v in fsw.values())} points", "runs"),
            claim(f"{when}: f_sw of DDR equals FDR's, mean over the speeds within {SAME:.0%}",
                  abs(apart) <= SAME, f"{apart:+.1%}", "the same"),
            claim(f"{when}: f_sw of FDR and DDR above classical DTC's at every speed",
                  bool(np.all(lowest > 1)), f"{lowest.min():.2f} to {lowest.max():.2f} times",
                  "above"),
        ]  # fmt: skip
        for band in a.BANDS:
            rows += [
                _lower(found, band, load, speeds, when, f"{WHY_RIPPLE} See {OTHER_NAME}."),
                _lower(other, band, load, speeds, f"{when}, {OTHER_NAME}", WHY_RIPPLE),
            ]
        classical, ddr = (sweep["5kHz"][load, s].mean() for s in ("dtc1", "ddr"))
        rows.append(
            not_printed(f"{when}: THD of classical DTC and DDR, 5 kHz, mean",
                        a.arrow(classical, ddr, "%", 1))
        )  # fmt: skip
    return rows


def _lower(
    found: tuple[Sweep, Sweep],
    band: str,
    load: float,
    speeds: tuple[float, ...],
    when: str,
    why: str,
) -> Verdict:
    """The verdict on whether DDR's THD is lower than FDR's at every speed that is reached."""
    sweep, spread = found
    scatter = np.maximum(*(spread[band][load, s] for s in a.SCHEMES))
    fdr, ddr = (sweep[band][load, s] for s in a.SCHEMES)
    reached = np.isfinite(fdr) & np.isfinite(ddr)
    lower = ddr < fdr
    fdr_mean, ddr_mean = fdr[reached].mean(), ddr[reached].mean()
    return claim(
        f"{when}: THD lower with DDR, {a.BAND_NAMES[band]}",
        bool(np.all(lower[reached])),
        f"at {np.sum(lower)} of {np.sum(reached)} speeds, mean "
        f"{a.arrow(fdr_mean, ddr_mean, '%', 2)}",
        "lower",
        why=_where(sweep, load, speeds, ddr - fdr, scatter) + why,
    )


WHY_RIPPLE = (
    " An x–y command also moves the virtual vector in α–β. The ripple depends on the leakage and "
    "the x–y currents on the devices' voltage drops. Neither is printed."
)


def _where(
    sweep: Sweep,
    load: float,
    speeds: tuple[float, ...],
    excess: np.ndarray,
    scatter: np.ndarray,
) -> str:
    """Text that says where DDR's THD is not lower, and how much x-y current there was to remove."""
    where = np.nonzero(excess >= 0)[0]
    if where.size == 0:
        return ""
    xy = {s: sweep["ixy_rms_A"][load, s][where].mean() for s in a.SCHEMES}
    return (
        f"DDR's THD is higher at {', '.join(f'{speeds[n]:g}' for n in where)} r/min, by "
        f"{np.max(excess[where]):.2f} points at most, with a scatter of up to "
        f"±{np.max(scatter[where]):.2f}. There the switching ripple in α–β outweighs what the x–y "
        f"regulator removes (x–y current {a.milli(xy['fdr'], xy['ddr'])} rms)."
    )


def a15(job: Job) -> Figure:
    """Classical DTC, FDR and DDR over speed, without load and at rated load."""
    speeds = QUICK_RPM if job.quick else FULL_RPM
    loads = (0.0, a.rated()[1])
    found = sweep, spread = _sweep(job, speeds, loads, SCHEMES, 1 if job.quick else 3)
    varied = other, _ = _sweep(
        job, speeds, loads, a.SCHEMES, 1 if job.quick else 2, **machine(*NEAREST)
    )

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(3, 2, 8.4, sharex="all", sharey="row")
        shown = (
            ("f_sw_Hz", "switching frequency [kHz]", 1e-3, SCHEMES),
            ("5kHz", "THD of $i_{u1}$, 5 kHz [%]", 1.0, a.SCHEMES),
            ("h50", "THD of $i_{u1}$, harmonics ≤ 50 [%]", 1.0, a.SCHEMES),
        )
        for row, (name, label, scale, schemes) in zip(axes, shown):
            for ax, load in zip(row, loads):
                for s in schemes:
                    ax.errorbar(
                        speeds, scale * sweep[name][load, s], scale * spread[name][load, s],
                        color=COLOURS[s], marker="o", markersize=3.5, linewidth=1.3, capsize=2,
                        label=NAMES[s],
                    )  # fmt: skip
                for s in a.SCHEMES:
                    ax.plot(speeds, scale * other[name][load, s], "--", color=COLOURS[s],
                            linewidth=0.9, label=f"{NAMES[s]},\n{OTHER_NAME}")  # fmt: skip
            row[0].set_ylabel(label, **plots.LABEL)
            row[0].set_ylim(bottom=0)
        for ax, title in zip(axes[0], ("no load", f"rated load, {loads[1]:g} N m")):
            ax.set_title(title, **plots.TITLE)
        for ax in axes[-1]:
            ax.set_xlabel("speed [r/min]", **plots.LABEL)
        handles, names = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=5, **plots.LEGEND)
        return plots.save(figure, path)

    channels = {"speed_rpm": np.array(speeds)} | {
        f"{name}.{s}.{load:g}Nm": values
        for name, rows in sweep.items()
        for (load, s), values in rows.items()
    }
    channels |= {
        f"{name}.{s}.{load:g}Nm.varied": values
        for name, rows in other.items()
        for (load, s), values in rows.items()
    }
    return Figure(
        metrics={
            "speed_rpm": list(speeds),
            **{
                f"{load:g} N m": {
                    s: {name: [_plain(v) for v in rows[load, s]] for name, rows in sweep.items()}
                    for s in SCHEMES
                }
                for load in loads
            },
            OTHER_NAME: {
                f"{load:g} N m": {
                    s: {name: [_plain(v) for v in rows[load, s]] for name, rows in other.items()}
                    for s in a.SCHEMES
                }
                for load in loads
            },
        },
        verdicts=_verdicts(found, varied, speeds, loads),
        draw=draw,
        recordings={"": Recording(1.0, channels, {"speed_rpm": "r/min"}, {"rows": "speed"})},
        setups=[a.setup(s) for s in SCHEMES] + [a.setup(s, **machine(*NEAREST)) for s in a.SCHEMES],
        caption="The set-up has field weakening, which acts above about 1000 r/min. Classical DTC "
        "applies one large vector a period (paper B's DTC1). Bars show the spread over "
        "speeds within 1 %, because switching tables are chaotic in detail. Dashed lines "
        "are with the leakage and the voltage drops that bring f_sw nearest to Table IV. "
        "With these, rated load at 1350 r/min is out of reach.",
    )


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
