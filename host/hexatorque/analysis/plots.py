"""Figures of runs, as PNG files. matplotlib is loaded on first use, without pyplot.

Every function takes runs, writes `path` (about 1500 px wide) and returns it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..setups.keys import LATENCIES
from .metrics import i_xy_A
from .panels import FAINT as FAINT
from .panels import INK, LABEL, LEGEND, TITLE, WIDTH_IN, new_figure, save, thin
from .reference import Reference, reference_values
from .run import Run, by_point
from .spectrum import channel, fundamental_Hz, harmonics, spectrum, whole_cycles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..recording.recording import Recording

#: Spans of `waveforms`. The second is used if there is no usable fundamental.
CYCLES, FALLBACK_S = 2, 0.04
ZOOM_S = 0.01  #: span of torque and flux in `waveforms`: a hundred control periods at 10 kHz
HIGHEST_ORDER, LOWEST_PCT = 25, 0.03  #: in `spectra`
#: Colour of each quantity. Colour-blind readers can distinguish them.
COLOUR = {
    "i_u1": "#0072b2",
    "i_u2": "#e69f00",
    "i_x": "#009e73",
    "i_y": "#cc79a7",
    "torque": "#d55e00",
    "flux": "#5b4fa2",
    "spectrum": "#0072b2",
}
#: Of the phases where all are in one panel.
PHASE_COLOUR = {
    "u1": "#0072b2",
    "u2": "#e69f00",
    "w1": "#009e73",
    "w2": "#d55e00",
    "v1": "#cc79a7",
    "v2": "#56b4e9",
}
LATENCY_COLOUR = {
    "none": "#56b4e9",
    "immediate": "#009e73",
    "shadow": "#d55e00",
    "predicted": "#0072b2",
}


def note(ax: Axes, text: str) -> None:
    """Write a figure of merit into the corner of a panel."""
    box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    ax.text(0.985, 0.965, text, transform=ax.transAxes, ha="right", va="top",
            fontsize=7.5, color=INK, bbox=box, zorder=5)  # fmt: skip


def cells(
    ax: Axes,
    rows: list[str],
    columns: list[str],
    texts: list[list[str]],
    colours: list[list[str]],
    fontsize: float = 8,
) -> None:
    """Draws a table: text on pale cells of the given colours. If a text has two lines, the second
    one is smaller."""
    from matplotlib.patches import Rectangle

    ax.grid(False)
    ax.spines[:].set_visible(False)
    for y, (line, shades) in enumerate(zip(texts, colours, strict=True)):
        for x, (text, shade) in enumerate(zip(line, shades, strict=True)):
            ax.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=shade, alpha=0.22))
            ax.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, fill=False, edgecolor="white",
                                   linewidth=1.2))  # fmt: skip
            first, _, second = text.partition("\n")
            ax.text(x, y - 0.16 * bool(second), first, ha="center", va="center",
                    fontsize=fontsize, color=INK)  # fmt: skip
            ax.text(x, y + 0.24, second, ha="center", va="center", fontsize=0.8 * fontsize,
                    color="#666d78")  # fmt: skip
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(rows)), rows)
    ax.tick_params(length=0)
    ax.xaxis.tick_top()
    ax.xaxis.set_label_position("top")
    ax.set_xlim(-0.5, len(columns) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)


def _value(value: float | None, digits: int, unit: str) -> str:
    return "–" if value is None else f"{value:.{digits}f} {unit}"


def waveforms(runs: list[Run], path: str | Path) -> Path:
    """Draws the ends of the runs of one set-up, one column per run: phase currents and x-y currents
    over two fundamental cycles, torque and stator flux with their references over 10 ms."""
    width_in = max(WIDTH_IN, 1.2 + 1.7 * len(runs))
    figure, axes = new_figure(4, len(runs), 8.6, width_in, sharey="row")
    for column, run in zip(axes.T, runs, strict=True):
        column[0].set_title(f"{run.scheme_label}\n", **TITLE, pad=3)
        column[0].text(0.5, 1.02, run.latency_label, transform=column[0].transAxes,
                       ha="center", fontsize=8, color="#666d78")  # fmt: skip
        _waveform_column(column, run)
        for row in (1, 3):
            column[row].set_xlabel("time [ms]", **LABEL)
    labels = ("phase currents [A]", "x–y currents [A]", "torque [N m]", "|stator flux| [Wb]")
    for row, label in zip(axes, labels, strict=True):
        row[0].set_ylabel(label, **LABEL)
        low, high = row[0].get_ylim()
        row[0].set_ylim(low, high + 0.14 * (high - low))  # room for the notes
        row[-1].legend(loc="center left", bbox_to_anchor=(1, 0.5), handlelength=1.2, **LEGEND)
        last = max(line.get_xdata()[-1] for ax in row for line in ax.lines)
        for ax in row:
            ax.set_xlim(0, last)
    for row in (0, 2):
        for ax in axes[row]:
            ax.tick_params(labelbottom=False)
    figure.suptitle(runs[0].point, fontsize=11.5, color=INK)
    figure.align_ylabels(axes[:, 0])
    return save(figure, path)


def _ending(rec: Recording, span_s: float) -> tuple[Recording, np.ndarray]:
    """The last `span_s` of a recording and its time from 0, in ms."""
    samples = min(len(rec), max(2, round(span_s * rec.rate_Hz)))
    part = rec.window(rec.time_s[-samples], rec.time_s[-1] + 1)
    return part, 1e3 * (part.time_s - part.start_s)


def _waveform_column(column: np.ndarray, run: Run) -> None:
    try:
        span_s = CYCLES / abs(fundamental_Hz(run.recording))
    except ValueError:
        span_s = FALLBACK_S
    cycles, cycles_ms = _ending(run.recording, span_s)
    zoom, zoom_ms = _ending(run.recording, ZOOM_S)
    i_x, i_y = i_xy_A(cycles)
    flux_Wb = np.hypot(channel(zoom, "psi_alpha_Wb"), channel(zoom, "psi_beta_Wb"))

    def draw(ax: Axes, t_ms: np.ndarray, y: np.ndarray, colour: str, label: str) -> None:
        ax.plot(*thin(t_ms, y), color=COLOUR[colour], linewidth=0.9, label=label)

    def reference(ax: Axes, name: str) -> None:
        if name in zoom:
            y = np.asarray(zoom[name], dtype=float)
            ax.plot(*thin(zoom_ms, y), "--", color=INK, linewidth=1.0, label="reference")

    draw(column[0], cycles_ms, channel(cycles, "i_u1_A"), "i_u1", "$i_{u1}$")
    draw(column[0], cycles_ms, channel(cycles, "i_u2_A"), "i_u2", "$i_{u2}$")
    draw(column[1], cycles_ms, i_x, "i_x", "$i_x$")
    draw(column[1], cycles_ms, i_y, "i_y", "$i_y$")
    draw(column[2], zoom_ms, channel(zoom, "torque_Nm"), "torque", "torque")
    reference(column[2], "torque_ref_Nm")
    draw(column[3], zoom_ms, flux_Wb, "flux", r"$|\psi_s|$")
    reference(column[3], "flux_ref_Wb")
    note(column[0], f"THD∞ {_value(run.metrics['thd_inf_pct'], 1, '%')}")
    note(column[1], f"rms {_value(run.metrics['ixy_rms_A'], 3, 'A')}")
    # At the control instants alone, a modulated law would seem to have hardly any ripple.
    td_Nm = run.metrics["torque_ripple_td_Nm"]
    name, ripple_Nm = ("Td", td_Nm) if td_Nm else ("std", run.metrics["torque_ripple_Nm"])
    note(column[2], f"{name} {_value(ripple_Nm, 3, 'N m')}")
    note(column[3], f"std {_value(run.metrics['flux_ripple_Wb'], 4, 'Wb')}")


def spectra(runs: list[Run], path: str | Path) -> Path:
    """Draws the spectra of phase u1 in % of the fundamental, up to order 25. There is one panel per
    run, and all have the same logarithmic scale. The 5th and 7th harmonics are marked."""
    columns = 2 if len(runs) == 4 else max(1, min(3, len(runs)))
    rows = -(-len(runs) // columns)
    figure, axes = new_figure(rows, columns, 0.7 + 2.5 * rows, sharex="all", sharey="all")
    for ax, run in zip(axes.flat, runs, strict=False):
        _spectrum_panel(ax, run)
    for ax in axes.flat[len(runs) :]:
        ax.set_visible(False)
    axes[0, 0].set_xlim(0, HIGHEST_ORDER)
    # The scale is logarithmic because DTC1 has 50 % where DDR has 0.5 %.
    axes[0, 0].set_yscale("log")
    axes[0, 0].set_ylim(LOWEST_PCT, 1500)  # room for the notes above 100 %
    axes[0, 0].set_yticks([0.1, 1, 10, 100], ["0.1", "1", "10", "100"])
    axes[0, 0].minorticks_off()
    axes[0, 0].set_xticks([1, 5, 7, 11, 13, 17, 19, 23, 25])
    for ax in axes[:, 0]:
        ax.set_ylabel("$i_{u1}$ [% of fundamental]", **LABEL)
    for ax in axes.flat[max(0, len(runs) - columns) : len(runs)]:
        ax.set_xlabel("harmonic order", **LABEL)
        ax.tick_params(labelbottom=True)
    title = ", ".join(by_point(runs))
    figure.suptitle(f"{title} – spectrum of phase u1", fontsize=11.5, color=INK)
    return save(figure, path)


def _spectrum_panel(ax: Axes, run: Run) -> None:
    rec, thd = run.recording, run.metrics["thd_pct"]
    f1_Hz = abs(fundamental_Hz(rec))
    signal, _ = whole_cycles(channel(rec, "i_u1_A"), rec.rate_Hz, f1_Hz)
    line = harmonics(signal, rec.rate_Hz, f1_Hz, (1, 5, 7))
    f_Hz, amplitude = spectrum(signal - signal.mean(), rec.rate_Hz)
    order, percent = f_Hz / f1_Hz, 100 * amplitude / line[1]
    shown = order <= HIGHEST_ORDER + 1
    order, percent = order[shown], percent[shown]
    ax.fill_between(order, percent, LOWEST_PCT, color=COLOUR["spectrum"], alpha=0.18, linewidth=0)
    ax.plot(order, percent, color=COLOUR["spectrum"], linewidth=0.9)
    for k, colour in ((5, "#d55e00"), (7, "#009e73")):
        h_pct = 100 * line[k] / line[1]
        if np.isfinite(h_pct):
            ax.plot([k], [h_pct], "v", color=colour, markersize=5, label=f"{k}th {h_pct:.2f} %")
    ax.set_title(run.label, **TITLE)
    note(ax, "THD  " + "   ".join(
        f"{name.replace('kHz', ' kHz').replace('h50', 'h≤50')}: {_value(thd[name], 1, '%')}"
        for name in ("1kHz", "5kHz", "h50")))  # fmt: skip
    ax.legend(loc="upper right", bbox_to_anchor=(1, 0.88), handletextpad=0.2, **LEGEND)


def bars(runs: list[Run], path: str | Path, reference: Reference) -> Path:
    """Draws an overview of distortion, torque ripple, Delta-I and f_sw, with a row per set-up and
    operating point. Bars are ours, by scheme and latency. Diamonds are the paper's measurements."""
    groups = by_point(runs)
    figure, axes = new_figure(len(groups), len(_BARS), 0.75 + 2.6 * len(groups))
    for row, (point, group) in zip(axes, groups.items(), strict=True):
        row[0].set_ylabel(point.replace(": ", "\n"), **TITLE)
        for ax, (title, key, scale) in zip(row, _BARS, strict=True):
            _bar_panel(ax, group, key, scale, reference)
            ax.set_title(title, **LABEL)
    handles: dict[str, Any] = {}
    for ax in axes.flat:
        handles |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    names = [n for n in (*map("latency {}".format, LATENCIES), MEASURED, RELATIVE) if n in handles]
    figure.legend([handles[name] for name in names], names, loc="outside upper center",
                  ncols=len(names), **LEGEND)  # fmt: skip
    return save(figure, path)


#: The papers' figures of distortion and ripple, each beside the one that leaves nothing out
#: (docs/model.md): all phases without a band, the torque between the control instants too.
_BARS = (
    ("THD of $i_{u1}$, 5 kHz [%]", "thd_pct", 1.0),
    (r"THD$_\infty$, all phases [%]", "thd_inf_pct", 1.0),
    ("torque ripple, std [N m]", "torque_ripple_Nm", 1.0),
    ("torque ripple, Td [N m]", "torque_ripple_td_Nm", 1.0),
    (r"$\Delta I_{u1u2}$ [A]", "delta_i_A", 1.0),
    ("$f_{sw}$ [kHz]", "f_sw_Hz", 1e-3),
)
MEASURED, RELATIVE = "paper, measured", "paper, times our DTC1"


def _bar_panel(ax: Axes, group: list[Run], key: str, scale: float, reference: Reference) -> None:
    schemes = list(dict.fromkeys(run.scheme for run in group))
    latencies = {
        scheme: [n for n in LATENCIES if any((r.scheme, r.latency) == (scheme, n) for r in group)]
        for scheme in schemes
    }
    width = min(0.38, 0.8 / max(map(len, latencies.values())))
    # Where the paper gives f_sw relative to DTC1, the base is our DTC1 with the last latency
    # listed.
    dtc1_Hz = {r.latency: r.metrics["f_sw_Hz"] for r in group if r.scheme == "dtc1"}
    base_Hz = next((dtc1_Hz[name] for name in reversed(LATENCIES) if dtc1_Hz.get(name)), None)
    for run in group:
        at, value = schemes.index(run.scheme), run.metrics[key]
        value = value["5kHz"] if key == "thd_pct" else value
        own = latencies[run.scheme]
        offset = (own.index(run.latency) - (len(own) - 1) / 2) * width
        if value is not None:
            ax.bar(at + offset, scale * value, 0.92 * width, label=run.latency_label,
                   color=LATENCY_COLOUR[run.latency])  # fmt: skip
        measured = reference_values(reference, run)
        if key in measured:
            ax.plot([at], [scale * measured[key]], "D", markersize=6, color=INK,
                    markeredgecolor="white", label=MEASURED)  # fmt: skip
        elif key == "f_sw_Hz" and base_Hz and "f_sw_rel" in measured:
            ax.plot([at], [scale * base_Hz * measured["f_sw_rel"]], "D", markersize=5.5,
                    color="white", markeredgecolor=INK, label=RELATIVE)  # fmt: skip
    ax.set_xticks(range(len(schemes)), [scheme.upper() for scheme in schemes])
    if len(schemes) > 4:
        ax.tick_params(axis="x", rotation=60)
    ax.set_xlim(-0.6, len(schemes) - 0.4)
    ax.grid(False, axis="x")
    ax.margins(y=0.1)
    ax.set_ylim(bottom=0)
