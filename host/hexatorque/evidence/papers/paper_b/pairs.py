"""Paper B's virtual vectors: pairs of real vectors, one of which is applied in each period."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .... import setups
from ....analysis import plots
from ....analysis.run import Run
from ....experiments import operating_points
from ....recording.recording import Recording
from ..both.vectors import number
from ..engine import geometry
from ..engine.audit import words_of
from ..engine.figure import Figure, beside, claim, not_printed
from ..engine.geometry import AB, XY
from ..engine.job import Job
from ..engine.law import Law

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"L": plots.COLOUR["i_u1"], "S": plots.COLOUR["torque"]}
#: Paper B: lengths [Vdc] by eq. (7), and the share of each of the two real vectors by section V-A.
LENGTH = {"S": 0.322, "L": 0.5575}
SHARE_PCT = 50.0
SPEEDS = ((500.0, 2.0), (1500.0, 2.0), (2500.0, 2.0))
LEVEL = {"L": 2, "S": 1}  #: torque levels that call for V_L and V_S


def _repeated(law: Law, level: int, k: int, periods: int) -> np.ndarray:
    """State words if virtual vector k is requested again and again. The x-y flux follows from them
    (300 V, periods of 100 us, no resistance)."""
    words, psi_xy = [], 1e-4j  # not zero, because zero is on the line between the two choices
    for _ in range(periods):
        words.append(law.words((k - 2) % 12, level, True, psi_xy)[0])
        psi_xy += XY[words[-1]] * 0.03
    return np.array(words)


def _strong(words: np.ndarray) -> float:
    """Share of the large or small vector, that is, the one that is not medium-large."""
    return float(np.mean([geometry.group(int(w)) != "ML" for w in words]))


def _shares(run: Run) -> tuple[dict[str, float], Recording]:
    """The share of the large vector at level 2, that of the small one at level 1, and that of
    either in the period after a small one. Also returns the periods as a recording."""
    full = run.recording
    rec = Recording(
        full.rate_Hz / 4,
        {"word": words_of(full["plant.gates"])}
        | {name: full[name][::4] for name in ("torque_level", "sector", "psi_x_Wb", "psi_y_Wb")},
        full.units, full.meta,
    )  # fmt: skip
    level, word = abs(rec["torque_level"]), rec["word"]
    small = [geometry.group(int(w)) == "S" for w in word[:-1]]
    shares = {name: _strong(word[level == n]) for name, n in LEVEL.items()}
    return shares | {"after S": _strong(word[1:][small & (level[1:] > 0)])}, rec


def b6(job: Job) -> Figure:
    """Fig. 6: 24 virtual vectors of DTC3, lengths and shares."""
    setup = setups.load("paper-b").changed(controller__scheme="dtc3", timing__latency="none")
    law, periods = Law(setup), 400 if job.quick else 2000
    words = {(name, k): _repeated(law, level, k, periods)
             for name, level in LEVEL.items() for k in range(12)}  # fmt: skip
    pairs = {key: sorted(set(map(int, w)), key=lambda w: geometry.group(w) == "ML")
             for key, w in words.items()}  # fmt: skip
    # `half` is the paper's value, the plain mean of both vectors. `real` is ours, the mean over the
    # periods of the run.
    half = {key: complex(AB[pair].mean()) for key, pair in pairs.items()}
    real = {key: complex(AB[w].mean()) for key, w in words.items()}
    left = max(abs(XY[w].mean()) for w in words.values())
    mean = {name: {
        "half": float(np.mean([abs(half[name, k]) for k in range(12)])),
        "real": float(np.mean([abs(real[name, k]) for k in range(12)])),
        "share": float(np.mean([_strong(words[name, k]) for k in range(12)])),
    } for name in LEVEL}  # fmt: skip
    # V.x + M.(1 - x) = 0 in x-y, where M opposes V.
    zero_mean = {
        name: abs(XY[57]) / (abs(XY[57]) + abs(XY[w])) for name, w in (("L", 48), ("S", 54))
    }
    runs = job.runs(operating_points.Point(setup, *point) for point in SPEEDS)
    shares, recordings = zip(*map(_shares, runs), strict=True)
    on_axis = all(abs(geometry.apart(geometry.degrees(v), 15 + 30 * k)) < 1e-6
                  for (_, k), v in half.items())  # fmt: skip

    def draw(path: Path) -> Path:
        figure, (axes,) = plots.new_figure(1, 2, 4.6, gridspec_kw={"width_ratios": [1, 1.1]})
        _draw_lengths(axes[0], half, real)
        _draw_shares(axes[1], {n: [mean[n]["share"], *(s[n] for s in shares)] for n in LEVEL})
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2,
                      **plots.LEGEND)  # fmt: skip
        return plots.save(figure, path)

    drawn = (
        "Which vector of a pair is applied depends on the x-y flux that the pairs before it have "
        "left. S leaves much x-y flux, so L and S are rare after it."
    )
    return Figure(
        metrics={"pairs": {f"V_{n}{k + 1}": pair for (n, k), pair in pairs.items()}, "mean": mean,
                 "running": {f"{rpm:.0f} r/min": s for (rpm, _), s in zip(SPEEDS, shares)}},
        paper={"lengths_pu": LENGTH, "share_pct": SHARE_PCT},
        verdicts=[
            claim("virtual vectors, at 15 degrees and every 30 from there",
                  on_axis and len(half) == 24, len(half), 24, required=True),
            beside("length of V_S with equal shares", mean["S"]["half"], LENGTH["S"], "Vdc",
                   within=5e-4 / LENGTH["S"], required=True),
            beside("length of V_L with equal shares", mean["L"]["half"], LENGTH["L"], "Vdc",
                   within=5e-5 / LENGTH["L"],
                   why="The paper averages the rounded lengths 0.644 and 0.471."),
            beside("ratio of the lengths, H_A to H_B", mean["S"]["half"] / mean["L"]["half"],
                   LENGTH["S"] / LENGTH["L"], within=5e-4, required=True),
            *[claim(f"share of {name} in V_{name}, one pair repeated, as its x-y length asks",
                    abs(mean[name]["share"] - zero_mean[name]) < 2 / periods,
                    100 * mean[name]["share"], 100 * zero_mean[name], "%", required=True)
              for name in LENGTH],
            *[beside(f"share of {name} in V_{name}, one pair repeated", 100 * mean[name]["share"],
                     SHARE_PCT, "%", why="The two lengths differ in x-y, so equal shares leave an "
                                         "x-y voltage. The choice by the x-y flux settles where "
                                         "the two balance.")
              for name in LENGTH],
            *[beside(f"share of {name} in V_{name}, {rpm:.0f} r/min and 2 N m", 100 * share[name],
                     SHARE_PCT, "%", why=drawn)
              for (rpm, _), share in zip(SPEEDS, shares, strict=True) for name in LENGTH],
            not_printed("share of L and S in the period after S, 2500 r/min",
                        100 * shares[-1]["after S"], "%"),
            not_printed("length of V_S without x-y voltage on average", mean["S"]["real"], "Vdc"),
            not_printed("length of V_L without x-y voltage on average", mean["L"]["real"], "Vdc"),
            not_printed("x-y voltage left after one pair repeated", left, "Vdc"),
        ],
        draw=draw,
        recordings={f"{rpm:.0f}": rec for (rpm, _), rec in zip(SPEEDS, recordings, strict=True)},
        setups=[setup],
        caption="A virtual vector of DTC3 is a pair of real vectors. One of them is applied in "
                "each period. Arrows show the mean with equal shares, as the paper takes it. Dots "
                "show the mean if one pair is requested again and again and the firmware chooses "
                "by the x-y flux. Bars show how often the large or small vector of the pair is "
                "then applied, and how often in a running drive.",
    )  # fmt: skip


def _draw_lengths(ax: Axes, half: dict, real: dict) -> None:
    """Draw arrows and dots. Both are given by (name, k)."""
    for (name, k), tip in half.items():
        colour, dot = COLOURS[name], real[name, k]
        style = {"arrowstyle": "->", "color": colour, "lw": 1}
        ax.annotate("", (tip.real, tip.imag), (0, 0), arrowprops=style)
        label = "" if k else f"$V_{name}$, no x–y voltage on average"
        ax.plot(dot.real, dot.imag, "o", color=colour, markersize=3.5, label=label)
        number(ax, dot * (1 + 0.075 / abs(dot)), f"$V_{{{name}{k + 1}}}$", fontsize=7.5)
    ax.set_aspect("equal")
    ax.set_xlim(-0.75, 0.75)
    ax.set_ylim(-0.75, 0.75)
    ax.set_xlabel("$v_d$ [$V_{dc}$]", **plots.LABEL)
    ax.set_ylabel("$v_q$ [$V_{dc}$]", **plots.LABEL)
    ax.set_title("d–q: arrows with equal shares", **plots.TITLE)


def _draw_shares(ax: Axes, values: dict[str, list[float]]) -> None:
    """Draw bars: first one pair repeated, then each speed."""
    for shift, name, of in ((-0.2, "L", "large"), (0.2, "S", "small")):
        bars = ax.bar(np.arange(len(values[name])) + shift, 100 * np.array(values[name]), 0.38,
                      color=COLOURS[name], label=f"of {of} in $V_{name}$")  # fmt: skip
        ax.bar_label(bars, fmt="%.0f", fontsize=8.5, label_type="center", color="white")
    ax.axhline(SHARE_PCT, linestyle="--", color=plots.INK, linewidth=1, label="paper")
    names = ["one pair\nrepeated", *(f"{rpm:.0f}\nr/min" for rpm, _ in SPEEDS)]
    ax.set_xticks(range(len(names)), names)
    ax.grid(False, axis="x")
    ax.set_ylim(0, 100)
    ax.set_ylabel("share of periods [%]", **plots.LABEL)
    ax.set_title("share of the large or small vector in its pair", **plots.TITLE)
    ax.legend(loc="upper right", ncols=3, **plots.LEGEND)
