"""Paper A's virtual vectors within a period: pulse patterns, duty ratios, utilisation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..analysis import plots
from ..firmware import lib
from ..recording import Recording
from .figure import Figure, beside
from .job import Job


def _alpha_beta(group: int, k: int, t: np.ndarray) -> np.ndarray:
    """(n, 2): mean alpha-beta voltage [Vdc] of virtual vector k with duties t (n, 3)."""
    words = [lib.ht_group[group][(k + d) % 12] for d in (-1, 0, 1)]
    vectors = [lib.ht_vector[word].ab for word in words]
    return t @ np.array([[v.alpha, v.beta] for v in vectors])


def _duties(group: int, k: int, v_x: np.ndarray, v_y: float) -> np.ndarray:
    """(n, 3): the firmware's duties for x-y commands [Vdc]."""
    points = [lib.ht_duty(group, k, {"x": float(x), "y": v_y}) for x in v_x]
    return np.array([[p.t1, p.t2 - p.t1, 1 - p.t2] for p in points])


#: Paper A, Fig. 5: the range that it prints, and what eqs. (4), (13), (24) give exactly.
ETA_PRINTED_PCT = (90.91, 96.61)
ETA_EXACT_PCT = (90.8965, 96.6105)
ETA_FDR_PCT = 92.82


def a5(job: Job) -> Figure:
    """DC-link utilisation, eq. (24): mean alpha-beta voltage over the length of a large
    vector, for v_x within TMVCL and three v_y, all twelve virtual vectors."""
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
                   why="the printed end is rounded up: its own equations give 90.8965 %"),
            beside("η, highest, as printed", high, ETA_PRINTED_PCT[1], "%", within=6e-5),
            beside("η of FDR, eq. (25)", fdr, ETA_FDR_PCT, "%", within=6e-5, required=True),
        ],
        draw=draw,
        recordings={"": Recording(1.0, channels, {"v_x_pu": "Vdc"}, {"rows": "v_x command"})},
        caption="Length of the mean alpha-beta voltage over that of a large vector. Solid: the "
        "twelve virtual vectors with the firmware's duties; dashed: fixed duties.",
    )  # fmt: skip
