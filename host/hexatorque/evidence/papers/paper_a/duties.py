"""Paper A's virtual vectors within a period: pulse patterns, duty ratios, utilisation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....analysis import plots
from ....firmware import lib
from ....plant.vsd import PHASES
from ....recording.recording import Recording
from ..engine import geometry
from ..engine.figure import Figure, beside, claim, not_printed
from ..engine.job import Job
from ..engine.pulses import SAMPLES, Played, lane, pattern, play, with_cases

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def action_points(k: int, v_x: float, v_y: float) -> tuple[float, float]:
    """T1 and T2 of the large virtual vector k for an x-y command [Vdc]."""
    p = lib.ht_duty(lib.HT_L, k, {"x": v_x, "y": v_y})
    return p.t1, p.t2


def _alpha_beta(group: int, k: int, t: np.ndarray) -> np.ndarray:
    """(n, 2): mean alpha-beta voltage [Vdc] of virtual vector k with duties t (n, 3)."""
    words = [lib.ht_group[group][(k + d) % 12] for d in (-1, 0, 1)]
    vectors = [lib.ht_vector[word].ab for word in words]
    return t @ np.array([[v.alpha, v.beta] for v in vectors])


def _duties(group: int, k: int, v_x: np.ndarray, v_y: float) -> np.ndarray:
    """(n, 3): the firmware's duties for x-y commands [Vdc]."""
    points = [lib.ht_duty(group, k, {"x": float(x), "y": v_y}) for x in v_x]
    return np.array([[p.t1, p.t2 - p.t1, 1 - p.t2] for p in points])


#: Paper A, Fig. 5: the printed range, and the exact values by eqs. (4), (13), (24).
ETA_PRINTED_PCT = (90.91, 96.61)
ETA_EXACT_PCT = (90.8965, 96.6105)
ETA_FDR_PCT = 92.82


def a5(job: Job) -> Figure:
    """DC-link utilisation, eq. (24): mean alpha-beta voltage divided by the length of a large
    vector. It is computed for v_x within TMVCL, three values of v_y and all twelve virtual
    vectors."""
    limit = float(lib.ht_tmvcl_pu[lib.HT_L])
    v_x = np.linspace(-limit, limit, 41 if job.quick else 201)
    large = np.hypot(lib.ht_vector[48].ab.alpha, lib.ht_vector[48].ab.beta)
    eta = {
        (sign, k): 100
        * np.hypot(*_alpha_beta(lib.HT_L, k, _duties(lib.HT_L, k, v_x, sign * limit)).T)
        / large
        for sign in (-1, 0, 1)
        for k in range(12)
    }
    zero = _duties(lib.HT_L, 0, np.zeros(1), 0.0)
    fdr = float(100 * np.hypot(*_alpha_beta(lib.HT_L, 0, zero)[0]) / large)
    low, high = (float(f([f(values) for values in eta.values()])) for f in (np.min, np.max))
    channels = {"v_x_pu": v_x} | {
        f"eta_k{k + 1}_vy{sign:+d}_pct": values for (sign, k), values in eta.items()
    }

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, 3, 3.6, sharey=True)
        names = {-1: "-TMVCL", 0: "0", 1: "+TMVCL"}
        for axis, sign in zip(axes[0], names):
            for k in range(12):
                axis.plot(v_x, eta[sign, k], color=plots.COLOUR["i_u1"], linewidth=0.9)
            axis.axhline(fdr, linestyle="--", color=plots.INK, linewidth=1, label="FDR, all k")
            axis.set_title(f"$v_y^*$ = {names[sign]}", **plots.TITLE)
            axis.set_xlabel("$v_x^*$ [$V_{dc}$]", **plots.LABEL)
            axis.set_xlim(-limit, limit)
        axes[0, 0].set_ylabel(r"$\eta$ [%]", **plots.LABEL)
        axes[0, 1].legend(loc="upper center", **plots.LEGEND)
        return plots.save(figure, path)

    return Figure(
        metrics={"eta_min_pct": low, "eta_max_pct": high, "eta_fdr_pct": fdr, "tmvcl_pu": limit},
        paper={"eta_min_pct": ETA_PRINTED_PCT[0], "eta_max_pct": ETA_PRINTED_PCT[1]},
        verdicts=[
            beside("η, lowest, by the paper's equations", low, ETA_EXACT_PCT[0], "%", within=1e-5,
                   required=True),
            beside("η, highest, by the paper's equations", high, ETA_EXACT_PCT[1], "%",
                   within=1e-5, required=True),
            beside("η, lowest, as printed", low, ETA_PRINTED_PCT[0], "%", within=6e-5,
                   why="The printed end is rounded up: the paper's own equations give 90.8965 %."),
            beside("η, highest, as printed", high, ETA_PRINTED_PCT[1], "%", within=6e-5),
            beside("η of FDR, eq. (25)", fdr, ETA_FDR_PCT, "%", within=6e-5, required=True),
        ],
        draw=draw,
        recordings={"": Recording(1.0, channels, {"v_x_pu": "Vdc"}, {"rows": "v_x command"})},
        caption="Length of the mean alpha-beta voltage divided by the length of a large vector. "
                "Solid: the twelve virtual vectors with the firmware's duties. Dashed: fixed "
                "duties.",
    )  # fmt: skip


def a3(job: Job) -> Figure:
    """Fig. 3: nine forms of virtual vector 1, for x-y commands in {-, 0, +} TMVCL."""
    limit = float(lib.ht_tmvcl_pu[lib.HT_L])
    signs = [(x, y) for y in (1, 0, -1) for x in (-1, 0, 1)]
    words = tuple(lib.ht_group[lib.HT_L][k] for k in (11, 0, 1))
    points = [action_points(0, x * limit, y * limit) for x, y in signs]
    played = play([pattern(words, *t) for t in points], SAMPLES)
    ab = played.mean_pu[:, 0] + 1j * played.mean_pu[:, 1]
    xy = played.mean_pu[:, 2] + 1j * played.mean_pu[:, 3]
    command = limit * np.array([x + 1j * y for x, y in signs])
    miss = float(max(abs((xy - command).real).max(), abs((xy - command).imag).max()))
    # There are two edges. Each is up to half a count away, and its leg adds 1/3 Vdc at most.
    count = 1 / played.period
    quadrants = {(np.sign(z.real), np.sign(z.imag)) for z in xy
                 if min(abs(z.real), abs(z.imag)) > 2 * count}  # fmt: skip
    angle = geometry.apart(geometry.degrees(ab), 15.0)
    length = abs(ab)
    every = [
        geometry.apart(geometry.degrees(complex(*_alpha_beta(lib.HT_L, k, duty)[0])), 15 + 30 * k)
        for k in range(12)
        for duty in (_duties(lib.HT_L, k, np.array([x * limit]), y * limit) for x, y in signs)
    ]
    widest = float(np.max(np.abs(every)))

    def draw(path: Path) -> Path:
        figure, (axes,) = plots.new_figure(1, 3, 4.4, gridspec_kw={"width_ratios": [1, 1, 1.5]})
        for ax, z, word_z, name, pair in (
            (axes[0], xy, geometry.XY, "x–y", "xy"),
            (axes[1], ab, geometry.AB, "α–β", ("\\alpha", "\\beta")),
        ):
            corner = word_z[list(words)]
            for tip, word in zip(corner, words, strict=True):
                ax.plot([0, tip.real], [0, tip.imag], color="#9aa1ab", linewidth=0.8)
                at = tip * (1 + (0.02 if ax is axes[0] else 0.07) / abs(tip))
                ax.text(at.real, at.imag, f"V{word}", fontsize=8, ha="center", va="center",
                        color=plots.INK)  # fmt: skip
            ax.plot(z.real, z.imag, "o", markersize=4, color=plots.COLOUR["i_u1"])
            ax.set_title(f"mean voltage in {name}", **plots.TITLE)
            ax.set_xlabel(f"$v_{pair[0]}$ [$V_{{dc}}$]", **plots.LABEL)
            ax.set_ylabel(f"$v_{pair[1]}$ [$V_{{dc}}$]", **plots.LABEL)
            ax.set_aspect("equal")
        for n, value in enumerate(xy):
            axes[0].annotate(str(n + 1), (value.real, value.imag), (3, 3), fontsize=8,
                             textcoords="offset points", color=plots.INK)  # fmt: skip
            axes[1].annotate(str(n + 1), (ab[n].real, ab[n].imag), (5, -3), fontsize=8,
                             textcoords="offset points", color=plots.INK)  # fmt: skip
        box = limit * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j, -1 - 1j])
        axes[0].plot(box.real, box.imag, "--", color=plots.INK, linewidth=0.8)
        axes[0].set_xlim(-0.2, 0.2)
        axes[0].set_ylim(-0.2, 0.2)
        axes[1].set_xlim(-0.05, 0.8)
        axes[1].set_ylim(-0.3, 0.55)
        _nine(axes[2], played)
        return plots.save(figure, path)

    return Figure(
        metrics={"angle_deg": angle.tolist(), "length_pu": length.tolist(),
                 "action_points": [list(map(float, t)) for t in points],
                 "xy_pu": [[z.real, z.imag] for z in xy], "angle_any_k_deg": widest},
        verdicts=[
            claim("mean x-y voltage is the command, to within a count", miss < count,
                  f"within {miss:.1e} Vdc", f"{count:.1e} Vdc", required=True),
            claim("four quadrants in x-y", len(quadrants) == 4, len(quadrants), 4, required=True),
            claim("close together in alpha-beta: same effect on torque and flux",
                  float(np.abs(angle).max()) < 1.0,
                  f"{angle.min():+.1f} to {angle.max():+.1f} degrees, "
                  f"{length.min():.3f} to {length.max():.3f} Vdc", "same effect",
                  why="The three vectors lie 30 degrees apart, so other duties turn their mean. "
                      "The nine forms are close together, but they are not the same."),
            not_printed("largest turn in alpha-beta of any virtual vector in the box", widest,
                        "degrees"),
        ],
        draw=draw,
        recordings={"": with_cases(
            played.recording,
            v_x_pu=list(command.real), v_y_pu=list(command.imag),
            t1=[t[0] for t in points], t2=[t[1] for t in points],
        )},
        caption="Virtual vector 1 (V49, V48, V56) with the firmware's duties for nine x-y "
                "commands: v_x is -TMVCL, 0, +TMVCL from left to right, v_y is +TMVCL, 0, -TMVCL "
                "from top to bottom. The picture shows the legs over a period, and the mean "
                "voltage of the simulated inverter.",
    )  # fmt: skip


def _nine(ax: Axes, played: Played) -> None:
    """Draw the six-leg patterns of nine periods, three by three."""
    for n in range(9):
        x0, y0 = 1.12 * (n % 3), 7.2 * (2 - n // 3)
        for leg in range(6):
            lane(ax, played, n, leg, y0 + 5 - leg, plots.COLOUR["i_u1"], x0)
        ax.text(x0 + 0.5, y0 + 6.0, str(n + 1), ha="center", fontsize=8, color=plots.INK)
    ticks = [7.2 * (2 - row) + 5.3 - leg for row in range(3) for leg in range(6)]
    ax.set_yticks(ticks, 3 * list(PHASES), fontsize=6.5)
    ax.set_xticks([])
    ax.grid(False)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0)
    ax.set_title("legs over a period", **plots.TITLE)
