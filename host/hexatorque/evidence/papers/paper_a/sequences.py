"""Paper A's eight switching sequences of a leg, as the PWM registers realise them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....analysis import plots
from ....firmware import ffi, lib
from ..engine.figure import Figure, claim, not_printed
from ..engine.job import Job
from ..engine.pulses import SAMPLES, Played, lane, pattern, period_counts, play, with_cases
from .duties import action_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: S1 S2 S3 of sequences 0 to 7.
SEQUENCES = tuple(f"{n:03b}" for n in range(8))
#: T1, T2 of fixed duties, eqs. (4), (5).
FIXED = (2 - np.sqrt(3), np.sqrt(3) - 1)


def _leg_words(sequence: str) -> tuple[int, int, int]:
    """State words with which every leg follows the same S1 S2 S3."""
    first, second, third = (63 * int(bit) for bit in sequence)
    return first, second, third


def _as_printed(sequence: str, t1: float, t2: float) -> object:
    """Registers exactly by eqs. (17), (18): CA = T1 PRD if S1 differs from S2, else PRD + M. CB
    follows in the same way. M = 1."""
    prd = period_counts() - 1
    s1, s2, s3 = map(int, sequence)
    ca = round(t1 * prd) if s1 != s2 else prd + 1
    cb = round(t2 * prd) if s2 != s3 else prd + 1
    return ffi.new("ht_compare *", {"start": 63 * s1, "ca": [ca] * 6, "cb": [cb] * 6})


def _realised(played: Played, n: int, sequence: str, t1: float, t2: float) -> bool:
    """Whether every leg follows S1 S2 S3 in pattern n, with edges within a count of T1 and T2."""
    p = played.period
    want: list[tuple[float, int]] = [(0, int(sequence[0]))]
    for at, before, after in ((t1, sequence[0], sequence[1]), (t2, sequence[1], sequence[2])):
        if before != after:
            want.append((at * p, int(after)))
    for leg in range(6):
        got = played.levels(n, leg)
        if len(got) != len(want) or any(
            abs(a - b) > 1 or u != v for (a, u), (b, v) in zip(got, want, strict=True)
        ):
            return False
    return True


def a2(job: Job) -> Figure:
    """Fig. 2: the eight switching sequences of a leg, through the firmware's registers and
    the emulated PWM."""
    limit = float(lib.ht_tmvcl_pu[lib.HT_L])
    early, late = (action_points(0, v * limit, -v * limit) for v in (-0.7, 0.7))
    points = {"fixed: FDR": FIXED, "moved: DDR, earlier": early, "moved: DDR, later": late}
    cases = [(name, s, *t) for name, t in points.items() for s in SEQUENCES]
    played = play([pattern(_leg_words(s), *t) for _, s, *t in cases], SAMPLES)
    right = sum(_realised(played, n, s, t1, t2) for n, (_, s, t1, t2) in enumerate(cases))
    jumps = [len(played.levels(n, 0)) - 1 for n in range(8)]
    # Hazards of toggle actions, each after a period of the sequence that is given first. They are
    # played with registers exactly by the equations, and with the firmware's. The leg has to end
    # low.
    hazards = {
        "CA = 0": ("000", "100", 0.0, 0.5),
        "CA = CB": ("000", "010", 0.5, 0.5),
        "CA = 0, high before": ("111", "100", 0.0, 0.5),
    }
    letter, ours = (
        play([make(*one) for first, *case in hazards.values()
              for one in ((first, 0.5, 0.5), case)], SAMPLES)
        for make in (_as_printed, lambda s, t1, t2: pattern(_leg_words(s), t1, t2))
    )  # fmt: skip
    wrong, kept = (
        {name: played.levels(2 * n + 1, 0)[-1][1] for n, name in enumerate(hazards)}
        for played in (letter, ours)
    )
    # One virtual vector is repeated. Count the edges inside the periods and between them.
    same = play([pattern((49, 48, 56), *FIXED)] * 11)
    at = same.edges[(same.edges[:, 0] >= same.period) & (same.edges[:, 0] < 11 * same.period)]
    inside, between = (np.sum((at[:, 0] % same.period > 0) == x) / 10 for x in (True, False))

    def draw(path: Path) -> Path:
        figure, (axes,) = plots.new_figure(1, 4, 4.6, sharex=True)
        for column, (name, t) in enumerate(points.items()):
            for row, sequence in enumerate(SEQUENCES):
                lane(axes[column], played, 8 * column + row, 0, 7 - row, _shade(sequence))
            _marks(axes[column], t)
            axes[column].set_title(name, **plots.TITLE)
            names = [f"{n} = {n:03b}" for n in range(7, -1, -1)]
            axes[column].set_yticks(np.arange(8) + 0.3, names)
        lanes = [(letter, 1, "100, CA = 0"), (ours, 1, "100, guarded"),
                 (letter, 3, "010, CA = CB"), (ours, 3, "010, guarded")]  # fmt: skip
        for row, (source, n, _) in enumerate(lanes):
            colour = plots.COLOUR["torque" if source is letter else "i_u1"]
            lane(axes[3], source, n, 0, 6 - 2 * row, colour)
        axes[3].set_yticks([6.3, 4.3, 2.3, 0.3], [text for *_, text in lanes])
        axes[3].set_title("at the limits", **plots.TITLE)
        for ax in axes:
            ax.grid(False)
            ax.set_ylim(-0.3, 8.9)
            ax.set_xlim(0, 1)
            ax.set_xlabel("period", **plots.LABEL)
        return plots.save(figure, path)

    recording = with_cases(
        played.recording,
        sequence=[int(s, 2) for _, s, *_ in cases],
        t1=[t1 for *_, t1, _ in cases],
        t2=[t2 for *_, t2 in cases],
    )
    return Figure(
        metrics={"action_points": {n: list(map(float, t)) for n, t in points.items()},
                 "jumps_in_period": dict(zip(SEQUENCES, jumps, strict=True)),
                 "level_after_hazard": {"as printed": wrong, "guarded": kept}},
        verdicts=[
            claim("levels S1 S2 S3 with edges at T1 and T2, on all six legs", right == len(cases),
                  f"{right} of {len(cases)}", "all", required=True),
            claim("jumps within a period: two in 2 and 5, else at most one",
                  jumps == [0, 1, 2, 1, 1, 2, 1, 0], " ".join(map(str, jumps)),
                  "0 1 2 1 1 2 1 0", required=True),
            claim("action points are fixed under FDR and move both ways under DDR",
                  early[0] < FIXED[0] < late[0] and early[1] != FIXED[1] != late[1],
                  f"T1 {early[0]:.3f}, {FIXED[0]:.3f}, {late[0]:.3f}", "move", required=True),
            claim("eqs. (17), (18) at T1 = 0: leg low after T1", wrong["CA = 0"] == 0,
                  f"level {wrong['CA = 0']}", "level 0",
                  why="At count 0 the compare event has a higher priority than ZERO on the chip. "
                      "The start level is lost, and the leg toggles from the level that it had. "
                      "The result is right only if that level happens to be S1."),
            claim("eqs. (17), (18) at T1 = T2: leg low after T2", wrong["CA = CB"] == 0,
                  f"level {wrong['CA = CB']}", "level 0",
                  why="Two compare events at one count give only one toggle."),
            claim("the firmware's counts at the same action points", not any(kept.values()),
                  f"levels {' '.join(map(str, kept.values()))}", "levels 0 0 0", required=True),
            claim("at most one jump of a leg in a period (section II-F), one vector repeated",
                  between == 0, f"{inside:.0f} in the period, {between:.0f} between periods",
                  "none between",
                  why="A leg that jumps within a period has to jump back before it can jump "
                      "within the next one."),
            not_printed("switching frequency of one virtual vector repeated",
                        (inside + between) / 12 * 10.0, "kHz"),
        ],
        draw=draw,
        recordings={"": recording},
        caption="A leg's level over a period of the simulated PWM module, without dead time. "
                "Sequences 2 and 5 (orange) occur with medium-large vectors only. The moved "
                "points are those of virtual vector 1 at 0.7 of two opposite corners of the TMVCL "
                "box. At the first corner itself T1 is 0. Right: action points that meet each "
                "other or the start of the period, with registers exactly by eqs. (17), (18), and "
                "with the firmware's, which keep one count between them.",
    )  # fmt: skip


def _shade(sequence: str) -> str:
    return plots.COLOUR["torque" if sequence in ("010", "101") else "i_u1"]


def _marks(ax: Axes, t: tuple[float, float]) -> None:
    for number, (at, top) in enumerate(zip(t, (7.9, 8.4), strict=True), 1):
        ax.plot([at, at], [-0.3, top], "--", color=plots.INK, linewidth=0.8)
        side = "left" if at < 0.2 else "right" if at > 0.8 else "center"
        ax.text(at, top + 0.1, f"$T_{number}$ {at:.3f}", ha=side, fontsize=8, color=plots.INK)
