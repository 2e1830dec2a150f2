"""Paper A in steady state: Fig. 7 (100 r/min without load) and Fig. 8 (1350 r/min, rated)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....analysis import plots
from ....analysis.run import Run
from ....analysis.spectrum import fundamental_Hz, low_pass, thd_pct, whole_cycles
from ....experiments.operating_points import Point
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, beside, claim, not_printed
from ..engine.job import Job
from . import common as a

if TYPE_CHECKING:
    from matplotlib.axes import Axes

XY = ("plant.i_x_A", "plant.i_y_A")
PHASES = ("plant.i_u1_A", "plant.i_u2_A")
#: "Gone": under DDR a line of the x-y current is smaller than this share of FDR's.
GONE = 0.25


def _lines(runs: dict[str, list[Run]]) -> dict[str, dict[int, float]]:
    """Scheme -> order -> mean x-y line in ampere."""
    found = {s: [a.xy_lines_A(run.recording) for run in runs[s]] for s in a.SCHEMES}
    return {s: {k: float(np.mean([f[k] for f in found[s]])) for k in a.ORDERS} for s in a.SCHEMES}


def _thd(runs: dict[str, list[Run]]) -> dict[str, dict[str, float]]:
    return {s: {b: a.mean(runs[s], "thd_pct", b) for b in a.BANDS} for s in a.SCHEMES}


def _thd_alpha(runs: dict[str, list[Run]]) -> dict[str, float]:
    """THD (5 kHz) of i_alpha = i_u1 - i_x. Phase u1 would have this THD without x-y current."""
    return {
        s: float(np.mean([
            thd_pct(rec["plant.i_alpha_A"], rec.rate_Hz, abs(fundamental_Hz(rec)))["5kHz"]
            for rec in (run.recording for run in runs[s])
        ]))
        for s in a.SCHEMES
    }  # fmt: skip


def _thd_claims(runs: dict[str, list[Run]], thd: dict) -> list[Verdict]:
    """The paper says that DDR's THD is the lower one. It does not say in which band."""
    alpha = _thd_alpha(runs)
    ripple = {s: 1e3 * a.mean(runs[s], "flux_ripple_Wb") for s in a.SCHEMES}
    why = (
        "This is switching ripple in α–β, which the x–y regulator cannot lower: without any x–y "
        f"current the THD of phase u1 would be {a.arrow(alpha['fdr'], alpha['ddr'], '%', 2)} "
        "(5 kHz). It rises because an x–y command also changes the virtual vector in α–β: its "
        "length is 91 to 97 % of a large vector, and it turns by up to 16°. Flux ripple: "
        f"{a.arrow(ripple['fdr'], ripple['ddr'], 'mWb', 2)}."
    )
    return [
        claim(f"THD of i_u1 falls, {a.BAND_NAMES[band]}", thd["ddr"][band] < thd["fdr"][band],
              a.arrow(thd["fdr"][band], thd["ddr"][band], "%", 2), "lower", why=why)
        for band in a.BANDS
    ]  # fmt: skip


def _metrics(runs: dict[str, list[Run]], lines: dict, thd: dict) -> dict:
    return {
        s: {
            "xy_line_A": {str(k): v for k, v in lines[s].items()},
            "thd_pct": thd[s],
            **{key: a.mean(runs[s], key) for key in
               ("speed_rpm", "torque_Nm", "flux_Wb", "i1_A", "delta_i_A", "ixy_rms_A", "f_sw_Hz")},
            "points": len(runs[s]),
        }
        for s in a.SCHEMES
    }  # fmt: skip


def a7(job: Job) -> Figure:
    """The currents in x, y, u1 and u2 at 100 r/min without load: two cycles behind a 1 kHz
    low-pass, and their spectra."""
    runs = a.around(job, 100.0, 0.0, 3 if job.quick else 7)
    lines, thd = _lines(runs), _thd(runs)
    fdr, ddr = lines["fdr"], lines["ddr"]
    names = {1: "fundamental", 5: "5th", 7: "7th"}
    verdicts = [
        claim(f"{names[k]} of the x–y current gone under DDR (below a quarter of FDR's)",
              ddr[k] < GONE * fdr[k], a.milli(fdr[k], ddr[k]), "gone")
        for k in a.ORDERS
    ]  # fmt: skip
    delta = {s: a.mean(runs[s], "delta_i_A") for s in a.SCHEMES}
    verdicts += [
        claim("unequal phase currents under FDR, equal under DDR",
              delta["ddr"] < 0.1 * delta["fdr"],
              f"ΔI {a.milli(delta['fdr'], delta['ddr'])}", "seen"),
        *_thd_claims(runs, thd),
        not_printed("x–y current, rms",
                    a.milli(*(a.mean(runs[s], "ixy_rms_A") for s in a.SCHEMES))),
    ]  # fmt: skip
    shown = {s: a.extract(runs[s][0].recording, XY + PHASES) for s in a.SCHEMES}

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(4, 2, 8.2, sharey="row")
        for column, scheme in zip(axes.T, a.SCHEMES):
            rec = runs[scheme][0].recording
            _two_cycles(column[0], rec, XY)
            _two_cycles(column[1], rec, PHASES)
            a.lines(column[2], rec, XY, 1.0)
            a.lines(column[3], rec, PHASES, 20.0)
            column[0].set_title(f"({'ab'[scheme == 'ddr']}) {a.NAMES[scheme]}", **plots.TITLE)
            xy = lines[scheme]
            plots.note(column[2], "   ".join(f"{names[k]} {1e3 * xy[k]:.1f} mA" for k in a.ORDERS))
            plots.note(column[3], f"THD (5 kHz) {thd[scheme]['5kHz']:.1f} %   "
                       f"ΔI {1e3 * delta[scheme]:.1f} mA")  # fmt: skip
        a.legends(axes, ["x–y currents [A]", "phase currents [A]", "x–y currents [A]",
                         "phase currents [A]"])  # fmt: skip
        return plots.save(figure, path)

    return Figure(
        metrics=_metrics(runs, lines, thd),
        verdicts=verdicts,
        draw=draw,
        recordings=shown,
        setups=[a.setup(s) for s in a.SCHEMES],
        caption="100 r/min without load. The upper rows show two cycles: faint as measured, solid "
        "behind a 1 kHz low-pass without phase shift. The value of a line of the x–y current is "
        "the root mean square of its amplitudes in x and y. Numbers are means over "
        f"{len(runs['fdr'])} speeds within 3 %.",
    )


def _two_cycles(ax: Axes, rec: Recording, names: tuple[str, ...]) -> None:
    """Draw the last two cycles: faint as they are, solid behind the oscilloscope's low-pass."""
    f1_Hz = abs(fundamental_Hz(rec))
    count = round(2 * rec.rate_Hz / f1_Hz)
    t_ms = 1e3 * np.arange(count) / rec.rate_Hz
    for name in names:
        whole, _ = whole_cycles(rec[name], rec.rate_Hz, f1_Hz)
        filtered = low_pass(whole, rec.rate_Hz, a.LOW_PASS_HZ)
        # Not up to the very end, because the filter takes the signal as periodic.
        part = slice(-count - count // 4, -(count // 4))
        a.trace(ax, t_ms, whole[part], name, alpha=0.28, linewidth=0.5, label=None)
        a.trace(ax, t_ms, filtered[part], name, linewidth=1.1)
    ax.set_xlim(0, t_ms[-1])
    ax.set_xlabel("time [ms]", **plots.LABEL)


SHOWN8 = ("plant.speed_rpm", "plant.torque_Nm", "plant.i_u1_A", "plant.i_x_A")


def a8(job: Job) -> Figure:
    """Rated load at 1350 r/min: as printed (0.6 Wb at 250 V) and with field weakening."""
    speed_rpm, load_Nm = a.rated()
    runs = a.around(job, speed_rpm, load_Nm, 3 if job.quick else 7)
    lines, thd = _lines(runs), _thd(runs)
    printed = {s: a.setup(s, a.PRINTED) for s in a.SCHEMES}

    def as_printed(scheme: str) -> Recording:
        sim = a.asked_for(Point(printed[scheme], speed_rpm, load_Nm), job.progress)
        sim.run(0.5, progress=job.progress)
        return sim.take()

    held = dict(zip(a.SCHEMES, job.each(as_printed, a.SCHEMES)))
    got_rpm = {s: float(held[s]["plant.speed_rpm"].mean()) for s in a.SCHEMES}
    verdicts = [
        beside(f"speed under rated load as printed (0.6 Wb, 250 V), {a.NAMES[s]}", got_rpm[s],
               speed_rpm, "r/min", within=0.02, why=a.infeasible())
        for s in a.SCHEMES
    ]  # fmt: skip
    verdicts += [
        beside(f"the same with field weakening, {a.NAMES[s]}", a.mean(runs[s][:1], "speed_rpm"),
               speed_rpm, "r/min", within=0.02)
        for s in a.SCHEMES
    ]  # fmt: skip
    fdr, ddr = lines["fdr"], lines["ddr"]
    verdicts += [
        claim(f"x–y current at {k} f₁ lower under DDR", ddr[k] < fdr[k],
              a.milli(fdr[k], ddr[k]), "lower")
        for k in a.ORDERS
    ]  # fmt: skip
    verdicts += [
        *_thd_claims(runs, thd),
        not_printed("stator flux after field weakening", a.mean(runs["ddr"], "flux_Wb"), "Wb"),
    ]
    metrics = _metrics(runs, lines, thd)
    for scheme, rec in held.items():
        metrics[scheme]["as_printed"] = {
            "speed_rpm": got_rpm[scheme],
            "torque_Nm": float(rec["plant.torque_Nm"].mean()),
            "state": rec.meta["state"],
            "xy_line_A": {str(k): v for k, v in a.xy_lines_A(rec).items()},
        }
    shown = {s: a.extract(runs[s][0].recording, SHOWN8) for s in a.SCHEMES}
    shown |= {f"{s}-printed": a.extract(held[s], SHOWN8) for s in a.SCHEMES}

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(6, 4, 9.2, 11.5, sharey="row")
        for column, (key, rec) in zip(axes.T, shown.items()):
            scheme, _, variant = key.partition("-")
            full = held[scheme] if variant else runs[scheme][0].recording
            t_ms = 1e3 * (rec.time_s - rec.start_s)
            for ax, name in zip(column, SHOWN8):
                inside = t_ms < 60
                a.trace(ax, t_ms[inside], rec[name][inside], name)
                ax.set_xlim(0, 60)
            a.lines(column[4], full, ("plant.i_x_A",), 1.0)
            a.lines(column[5], full, ("plant.i_u1_A",), 30.0)
            for ax in column[4:]:
                ax.set_xticks([1, 5, 7, 11, 13, 17, 19, 23])
            column[3].set_xlabel("time [ms]", **plots.LABEL)
            title = "as printed" if variant else "field weakening"
            column[0].set_title(f"{a.NAMES[scheme]}, {title}", **plots.TITLE)
            column[0].set_ylim(0, 1500)
            column[1].set_ylim(7, 13)
            xy = a.xy_lines_A(full)
            plots.note(column[4], "  ".join(f"{k}: {1e3 * xy[k]:.0f} mA" for k in a.ORDERS))
        labels = ["speed [r/min]", "torque [N m]", "$i_{u1}$ [A]", "$i_x$ [A]", "$i_x$ [A]",
                  "$i_{u1}$ [A]"]  # fmt: skip
        for row, label in zip(axes, labels):
            row[0].set_ylabel(label, **plots.LABEL)
        return plots.save(figure, path)

    return Figure(
        metrics=metrics,
        verdicts=verdicts,
        draw=draw,
        recordings=shown,
        setups=[a.setup(s) for s in a.SCHEMES] + list(printed.values()),
        paper={
            "speed_rpm": speed_rpm,
            "load_Nm": load_Nm,
            "flux_Wb": printed["fdr"].parameter("flux_ref_Wb"),
        },
        caption="Rated load at 1350 r/min. Left: field weakening lowers the flux reference to "
        "what the voltage allows (set-up paper-a-feasible). Right: the printed 0.6 Wb is "
        "kept (paper-a), and the speed is not reached. The spectra are taken over 10 "
        "cycles and more.",
    )
