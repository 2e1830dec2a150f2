"""Paper A's schemes exchanged while running: Fig. 9 (400 r/min without load) and Fig. 10
(100 r/min at rated load). Here DDR also comes back: DDR, FDR, DDR in one recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ....analysis import plots
from ....analysis.spectrum import channel, fundamental_Hz, harmonics, low_pass, thd_pct
from ....experiments.operating_points import Point, transient
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, claim
from ..engine.job import Job
from . import common as a

XY = ("plant.i_x_A", "plant.i_y_A")
PHASES = ("plant.i_u1_A", "plant.i_u2_A")
ALPHA_BETA = ("plant.i_alpha_A", "plant.i_beta_A")
V_XY = ("v_x_pu", "v_y_pu")
#: Parts of a recording, in order, and the time that the currents have to settle in each.
PARTS = ("ddr", "fdr", "ddr again")
SETTLE_S = 0.2
#: "Reappears" means at least this factor. The measured factors are 2 in rms, and 10 and more in
#: single lines.
MORE = 1.5


def _recorded(job: Job, speed_rpm: float, load_Nm: float, instants: tuple[float, ...]) -> Recording:
    off_s, on_s, end_s = instants
    return transient(
        Point(a.setup("ddr"), speed_rpm, load_Nm),
        [(off_s, "scheme", "fdr"), (on_s, "scheme", "ddr")],
        end_s,
        job.progress,
    )


def _parts(rec: Recording, instants: tuple[float, ...]) -> dict[str, Recording]:
    begins = (0.0, instants[0] + SETTLE_S, instants[1] + SETTLE_S)
    return {part: rec.window(b, e) for part, b, e in zip(PARTS, begins, instants)}


def _figures(rec: Recording) -> dict:
    """The figures of merit of one part."""
    f1_Hz = abs(fundamental_Hz(rec))
    i1 = {name: harmonics(rec[name], rec.rate_Hz, f1_Hz, (1,))[1] for name in PHASES}
    return {
        "ixy_rms_A": a.rms(channel(rec, "i_x_A"), channel(rec, "i_y_A")),
        "xy_line_A": {str(k): v for k, v in a.xy_lines_A(rec).items()},
        "delta_i_A": abs(i1[PHASES[0]] - i1[PHASES[1]]),
        "thd_pct": thd_pct(channel(rec, "i_u1_A"), rec.rate_Hz, f1_Hz),
        "v_xy_rms_pu": a.rms(rec["v_x_pu"], rec["v_y_pu"]),
        "speed_rpm": float(channel(rec, "speed_rpm").mean()),
        "torque_Nm": float(channel(rec, "torque_Nm").mean()),
        "seconds": rec.duration_s,
    }


def _verdicts(figures: dict[str, dict]) -> list[Verdict]:
    ddr, fdr, again = (figures[part] for part in PARTS)
    rows = []
    for what, pick in (
        ("x–y current, rms", lambda f: f["ixy_rms_A"]),
        ("x–y current at f₁", lambda f: f["xy_line_A"]["1"]),
        ("x–y current at 5 f₁", lambda f: f["xy_line_A"]["5"]),
        ("x–y current at 7 f₁", lambda f: f["xy_line_A"]["7"]),
        ("ΔI", lambda f: f["delta_i_A"]),
    ):
        before, off, on = pick(ddr), pick(fdr), pick(again)
        rows += [
            claim(f"{what} reappears when DDR is switched off in flight", off > MORE * before,
                  a.milli(before, off), "reappears", required=True),
            claim(f"{what} vanishes when DDR is switched on again", on * MORE < off,
                  a.milli(off, on), "vanishes", required=True),
        ]  # fmt: skip
    rows.append(
        claim("x–y voltage commands are zero under FDR, and only there",
              fdr["v_xy_rms_pu"] == 0 < min(ddr["v_xy_rms_pu"], again["v_xy_rms_pu"]),
              f"{ddr['v_xy_rms_pu']:.4f}, {fdr['v_xy_rms_pu']:g}, {again['v_xy_rms_pu']:.4f} V_dc",
              "zero", required=True)
    )  # fmt: skip
    return rows


def _draw(
    rec: Recording, parts: dict[str, Recording], instants: tuple[float, ...], rows: list[tuple]
) -> Callable[[Path], Path]:
    """Left: the whole recording. Right: around the instant at which DDR is switched off, behind the
    low-pass. Below: spectra of x and u1 under DDR and FDR. rows: (channels, label)."""

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(len(rows) + 1, 2, 1.0 + 1.85 * (len(rows) + 1))
        off_s, on_s, end_s = instants
        f1_Hz = abs(fundamental_Hz(parts["fdr"]))
        around = (off_s - 1.5 / f1_Hz, off_s + 2.5 / f1_Hz)
        t = rec.time_s
        inside = (t >= around[0]) & (t < around[1])
        for (left, right), (names, label) in zip(axes, rows):
            for name in names:
                a.trace(left, t, rec[name], name, linewidth=0.6)
                y = np.asarray(rec[name], dtype=float)
                if name not in V_XY:  # commands are drawn without the low-pass
                    y = low_pass(y, rec.rate_Hz, a.LOW_PASS_HZ)
                a.trace(right, 1e3 * (t[inside] - off_s), y[inside], name, linewidth=1.0)
            left.set_xlim(0, end_s)
            right.set_xlim(*(1e3 * (edge - off_s) for edge in around))
            for at in (off_s, on_s):
                left.axvline(at, color=plots.INK, linewidth=0.9, linestyle="--")
            right.axvline(0, color=plots.INK, linewidth=0.9, linestyle="--")
            left.set_ylabel(label, **plots.LABEL)
            right.legend(loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1.2,
                         **plots.LEGEND)  # fmt: skip
        axes[-2, 0].set_xlabel("time [s]", **plots.LABEL)
        axes[-2, 1].set_xlabel("time since DDR is off [ms]", **plots.LABEL)
        axes[0, 0].set_title("DDR, FDR, DDR again", **plots.TITLE)
        axes[0, 1].set_title("DDR to FDR, behind 1 kHz low-pass", **plots.TITLE)
        for ax, name, top_A in ((axes[-1, 0], "plant.i_x_A", 1.0), (axes[-1, 1], PHASES[0], 20.0)):
            for part, colour in (("fdr", plots.COLOUR["torque"]), ("ddr again", "#0072b2")):
                label = a.NAMES[part.partition(" ")[0]]
                a.lines(ax, parts[part], (name,), top_A, color=colour, label=label)
            ax.set_ylabel(f"{a.SYMBOLS[name]} [A]", **plots.LABEL)
        axes[-1, 1].legend(loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1.2,
                           **plots.LEGEND)  # fmt: skip
        return plots.save(figure, path)

    return draw


def _figure(
    job: Job, speed_rpm: float, load_Nm: float, instants: tuple[float, ...], rows: list[tuple]
) -> Figure:
    rec = _recorded(job, speed_rpm, load_Nm, instants)
    parts = _parts(rec, instants)
    figures = {part: _figures(piece) for part, piece in parts.items()}
    names = tuple(name for names, _ in rows for name in names) + ("scheme",)
    return Figure(
        metrics={"instants_s": list(instants), **figures},
        verdicts=_verdicts(figures),
        draw=_draw(rec, parts, instants, rows),
        recordings={"": a.extract(rec, names, every=2)},
        setups=[a.setup("ddr")],
        caption="At the dashed lines DDR is switched off, and on again. The paper shows the first "
        f"of these. The figures of a part begin {SETTLE_S:g} s after the change of scheme.",
    )


def a9(job: Job) -> Figure:
    """400 r/min without load."""
    rows = [
        (XY, "x–y currents [A]"),
        (PHASES, "phase currents [A]"),
        (V_XY, "x–y commands [$V_{dc}$]"),
    ]
    return _figure(job, 400.0, 0.0, (0.5, 1.5, 2.5), rows)


def a10(job: Job) -> Figure:
    """100 r/min at rated load."""
    rows = [
        (XY, "x–y currents [A]"),
        (PHASES, "phase currents [A]"),
        (ALPHA_BETA, "α–β currents [A]"),
        (V_XY, "x–y commands [$V_{dc}$]"),
    ]
    figure = _figure(job, 100.0, a.rated()[1], (1.0, 2.5, 4.0), rows)
    fdr, ddr = figure.metrics["fdr"]["thd_pct"], figure.metrics["ddr again"]["thd_pct"]
    figure.verdicts += [
        claim(f"THD of i_u1 lower with DDR, {a.BAND_NAMES[b]}", ddr[b] < fdr[b],
              a.arrow(fdr[b], ddr[b], "%", 2), "12.44 → 8.13 %")
        for b in a.BANDS
    ]  # fmt: skip
    return figure
