"""Voltage vectors and virtual vectors of both papers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....analysis import plots
from ....firmware import lib
from ....recording.recording import Recording
from ..engine import geometry
from ..engine.figure import Figure, Verdict, claim
from ..engine.geometry import AB, XY
from ..engine.job import Job
from ..engine.pulses import Played, pattern, play

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

COLOURS = {"L": plots.COLOUR["i_u1"], "ML": plots.COLOUR["i_u2"], "MS": plots.COLOUR["i_x"],
           "S": plots.COLOUR["torque"]}  # fmt: skip
#: Paper A, Table I: group -> sample, alpha-beta and x-y length [Vdc], % of L.
TABLE_I = {
    "L": (48, 0.6440, 0.1725, 100.0),
    "ML": (57, 0.4714, 0.4714, 73.21),
    "MS": (16, 0.3333, 0.3333, 51.76),
    "S": (54, 0.1725, 0.6440, 26.79),
}
#: Rounding of the firmware's float32 tables, in Vdc.
FLOAT32 = 2e-7


def rounded(what: str, ours: float, paper: float, digits: int, unit: str) -> Verdict:
    """Compares our value, rounded to the printed digits, with a printed value."""
    return claim(what, round(ours, digits) == paper, ours, paper, unit, required=True)


def firmware_vectors() -> tuple[np.ndarray, np.ndarray]:
    """The firmware's table of vectors in alpha-beta and x-y, as complex numbers, by state word."""
    table = lib.ht_vector
    return (
        np.array([complex(v.ab.alpha, v.ab.beta) for v in table]),
        np.array([complex(v.xy.x, v.xy.y) for v in table]),
    )


def all_states() -> tuple[Played, Recording]:
    """The 64 states on the simulated inverter, each for one period. The recording has one row per
    state."""
    played = play([pattern((word,) * 3, 1.0, 1.0) for word in range(64)])
    rec = played.recording
    channels = {"word": np.arange(64)} | {name: rec[name][3::4] for name in rec.channels}
    ab, xy = firmware_vectors()
    for name, values in (("alpha", ab.real), ("beta", ab.imag), ("x", xy.real), ("y", xy.imag)):
        channels[f"v_{name}_pu"] = values
    units = {**rec.units, **{f"v_{name}_pu": "Vdc" for name in ("alpha", "beta", "x", "y")}}
    return played, Recording(rec.rate_Hz / 4, channels, units, rec.meta)


def _as_tabulated(played: Played) -> list[Verdict]:
    ab, xy = firmware_vectors()
    table = float(max(abs(ab - AB).max(), abs(xy - XY).max()))
    mean = played.mean_pu
    legs = max(abs(mean[:, 0] + 1j * mean[:, 1] - AB).max(),
               abs(mean[:, 2] + 1j * mean[:, 3] - XY).max())  # fmt: skip
    return [
        claim("64 vectors of the firmware, from the phase angles", table < FLOAT32,
              f"within {table:.0e} Vdc", "exact", required=True),
        claim("64 states on the simulated inverter, from the phase angles", legs < FLOAT32,
              f"within {legs:.0e} Vdc", "exact", required=True),
    ]  # fmt: skip


def number(ax: Axes, at: complex, text: str, **style: Any) -> None:
    box = {"boxstyle": "square,pad=0.08", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
    style = {"fontsize": 6.5, "color": plots.INK, **style}
    ax.text(at.real, at.imag, text, ha="center", va="center", linespacing=0.95, bbox=box,
            zorder=4, **style)  # fmt: skip


def _plane(ax: Axes, z: np.ndarray, title: str, axes: Sequence[str], names: dict[str, str]) -> None:
    """Draw all active vectors of one plane with their numbers. Equal vectors share a point."""
    for group, name in names.items():
        words = [w for w in range(64) if geometry.group(w) == group]
        points: dict[complex, list[int]] = {}
        for w in words:
            points.setdefault(complex(np.round(z[w], 6)), []).append(w)
        tips = np.array(sorted(points, key=np.angle))
        ring = np.append(tips, tips[0])
        ax.plot(ring.real, ring.imag, "o-", color=COLOURS[group], markersize=3.5, linewidth=0.8,
                label=name)  # fmt: skip
        for tip, shared in points.items():
            at = tip * (1 + (0.055 if len(shared) == 1 else 0.065) / abs(tip))
            number(ax, at, "\n".join(map(str, shared)))
    ax.set_title(title, **plots.TITLE)
    ax.set_xlabel(f"$v_{axes[0]}$ [$V_{{dc}}$]", **plots.LABEL)
    ax.set_ylabel(f"$v_{axes[1]}$ [$V_{{dc}}$]", **plots.LABEL)
    ax.set_aspect("equal")
    ax.set_xlim(-0.76, 0.76)
    ax.set_ylim(-0.76, 0.76)


def _legend(figure: FigureBase, ax: Axes, columns: int) -> None:
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=columns,
                  **plots.LEGEND)  # fmt: skip


def a1(job: Job) -> Figure:
    """Fig. 1 and Table I: the 64 vectors in both planes, four groups."""
    played, recording = all_states()
    ab, xy = firmware_vectors()
    large = abs(ab[48])
    metrics, verdicts = {}, _as_tabulated(played)
    for name, (sample, r_ab, r_xy, share) in TABLE_I.items():
        words = [w for w in range(64) if geometry.group(w) == name]
        length_ab, length_xy = abs(ab[words]), abs(xy[words])
        share_pct = float(100 * length_ab.mean() / large)
        metrics[name] = {"words": words, "alpha_beta_pu": float(length_ab.mean()),
                         "xy_pu": float(length_xy.mean()), "share_pct": share_pct}  # fmt: skip
        even = np.ptp(length_ab) < FLOAT32 and np.ptp(length_xy) < FLOAT32
        verdicts += [
            rounded(f"Table I, {name}, alpha-beta", float(length_ab.mean()), r_ab, 4, "Vdc"),
            rounded(f"Table I, {name}, x-y", float(length_xy.mean()), r_xy, 4, "Vdc"),
            rounded(f"Table I, {name}, share", share_pct, share, 2, "%"),
            claim(f"Table I, {name}: sample {sample} is one of {len(words)} equally long ones",
                  sample in words and even, bool(sample in words and even), True,
                  required=True),
        ]  # fmt: skip
    active = int(np.sum(abs(ab) > FLOAT32))
    verdicts.append(
        claim("active and zero vectors", active == 60, f"{active}, {64 - active}", "60, 4",
              required=True)
    )  # fmt: skip

    def draw(path: Path) -> Path:
        figure, (axes,) = plots.new_figure(1, 2, 5.5)
        names = {
            g: f"{g}: {m['alpha_beta_pu']:.4f}, {m['xy_pu']:.4f} $V_{{dc}}$, {m['share_pct']:.2f} %"
            for g, m in metrics.items()
        }
        for ax, z, title, pair in zip(
            axes, (ab, xy), ("α–β", "x–y"), (("\\alpha", "\\beta"), "xy"), strict=True
        ):
            _plane(ax, z, title, pair, names)
        for group, style in (("L", "--"), ("ML", ":")):
            corners = [xy[geometry.WORDS[group][k]] for k in (-1, 0, 1, -1)]
            axes[1].plot(np.real(corners), np.imag(corners), style, color=plots.INK,
                         linewidth=1.2, label=f"virtual vector 1 of {group}")  # fmt: skip
        number(axes[0], 0, "0 21\n42 63")
        _legend(figure, axes[1], 3)
        return plots.save(figure, path)

    return Figure(
        metrics=metrics,
        paper={name: row[1:] for name, row in TABLE_I.items()},
        verdicts=verdicts,
        draw=draw,
        recordings={"": recording},
        caption="The 64 states u1 u2 w1 w2 v1 v2 (u1 is the highest bit) in both planes, from the "
        "firmware's table. The legend gives the length in alpha-beta, the length in x-y, "
        "and the share of the large vectors' length. Large and small vectors change "
        "places in x-y. Triangles connect three consecutive vectors; they enclose the "
        "origin. The recording has each state for one period on the simulated inverter.",
    )


def b2(job: Job) -> Figure:
    """Fig. 2: the same vectors with paper B's names, sectors and half-planes."""
    played, recording = all_states()
    ab, xy = firmware_vectors()
    groups = dict(zip(COLOURS, ("$L_1$", "$L_2$", "$L_3$", "$L_4$"), strict=True))
    printed = {"L": (60, 0.644), "ML": (24, 0.471), "S": (36, 0.173)}  # eq. (7)
    lengths = [float(abs(ab[[w for w in range(64) if geometry.group(w) == g]]).mean())
               for g in groups]  # fmt: skip
    distinct = len({complex(np.round(complex(z), 5)) for z in ab if abs(z) > FLOAT32})
    from_v60 = {w: (float(geometry.apart(geometry.degrees(ab[w]), geometry.degrees(ab[60]))),
                    float(geometry.apart(geometry.degrees(xy[w]), geometry.degrees(xy[60]))))
                for w in (24, 36)}  # fmt: skip
    aligned = all(abs(a) < 0.01 for a, _ in from_v60.values())
    opposed = abs(from_v60[36][1]) < 0.01 and abs(abs(from_v60[24][1]) - 180) < 0.01

    def draw(path: Path) -> Path:
        figure, (axes,) = plots.new_figure(1, 2, 5.5)
        for ax, z, title, pair in zip(axes, (ab, xy), ("d–q", "x–y"), ("dq", "xy"), strict=True):
            _plane(ax, z, title, pair, groups)
            for s, name in enumerate(geometry.ROMAN):
                edge, middle = (0.74 * np.exp(1j * np.deg2rad(30 * s + d)) for d in (15, 0))
                ax.plot([0.1 * edge.real, edge.real], [0.1 * edge.imag, edge.imag], "--",
                        color="#9aa1ab", linewidth=0.5)  # fmt: skip
                number(ax, 0.95 * middle, name, fontsize=8.5, color="#666d78")
        number(axes[0], 0, "0 21\n42 63")
        across = 0.76 * 1j * xy[60] / abs(xy[60]) * np.array([-1, 1])
        axes[1].plot(across.real, across.imag, color=plots.INK, linewidth=1.2)
        for name, side in (("$C_1$", -1), ("$C_2$", 1)):
            number(axes[1], side * 0.09 * xy[60] / abs(xy[60]), name, fontsize=10)
        _legend(figure, axes[1], 4)
        return plots.save(figure, path)

    return Figure(
        metrics={"lengths_pu": lengths, "distinct": distinct},
        paper={"lengths_pu": {g: r for g, (_, r) in printed.items()}, "distinct": 48},
        verdicts=[
            *_as_tabulated(played),
            *[rounded(f"length of V{word}, group {groups[g].strip('$')}", float(abs(ab[word])), r,
                      3, "Vdc") for g, (word, r) in printed.items()],
            claim("groups L1 to L4 by descending length", lengths == sorted(lengths)[::-1],
                  " > ".join(f"{r:.3f}" for r in lengths), "descending", required=True),
            claim("distinct active vectors", distinct == 48, distinct, 48, required=True),
            claim("V24 and V36 in phase with V60 in d-q", aligned, aligned, True,
                  required=True),
            claim("V36 in phase with V60, V24 opposed, in x-y", opposed, opposed, True,
                  required=True),
        ],
        draw=draw,
        recordings={"": recording},
        caption="The 64 vectors with paper B's groups and sectors. Phases a to f are u1 u2 w1 w2 "
                "v1 v2. The line in x-y separates the half-planes C1 and C2 of V60 and V24. "
                "Sectors reach from 30 s - 15 to 30 s + 15 degrees in both planes. Only with "
                "these sectors is Table III's row a half-plane across V60.",
    )  # fmt: skip
