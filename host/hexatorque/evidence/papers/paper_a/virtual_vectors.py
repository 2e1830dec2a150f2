"""Paper A's virtual vectors: three large vectors within a period."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .... import setups
from ....analysis import plots
from ....experiments import operating_points
from ....plant.vsd import PHASES
from ....recording.recording import Recording
from ..engine import geometry
from ..engine.figure import Figure, Verdict, claim
from ..engine.job import Job
from ..engine.law import Law
from ..engine.pulses import pattern, play

COLOURS = {"L": plots.COLOUR["i_u1"], "S": plots.COLOUR["torque"]}

#: Paper A, Table II: switching sequences and state words of the virtual vectors.
TABLE_II = (
    ("771004", 0b110001, 0b110000, 0b111000), ("773100", 0b110000, 0b111000, 0b111100),
    ("677300", 0b111000, 0b111100, 0b011100), ("467700", 0b111100, 0b011100, 0b001100),
    ("047710", 0b011100, 0b001100, 0b001110), ("007731", 0b001100, 0b001110, 0b001111),
    ("006773", 0b001110, 0b001111, 0b000111), ("004677", 0b001111, 0b000111, 0b000011),
    ("100477", 0b000111, 0b000011, 0b100011), ("310077", 0b000011, 0b100011, 0b110011),
    ("730067", 0b100011, 0b110011, 0b110001), ("770046", 0b110011, 0b110001, 0b110000),
)  # fmt: skip
#: Fixed duty ratios: action points, eqs. (5) and (14).
T1, T2 = 2 - np.sqrt(3), np.sqrt(3) - 1


def _fdr_run(job: Job) -> tuple[setups.Setup, Recording]:
    """A run of FDR in both directions, with the state words in the middle of the three
    intervals."""
    setup = setups.load("paper-a").changed(controller__scheme="fdr")
    part_s = 0.2 if job.quick else 0.8
    full = operating_points.transient(
        operating_points.Point(setup, 400.0, 2.0), [(part_s, "speed_ref_rpm", -400.0)], 2 * part_s,
        job.progress, samples_per_period=6,
    )  # fmt: skip
    gates = full["plant.gates"].astype(int).reshape(-1, 6)[:, 1::2]
    legs = gates[..., None] >> 2 * np.arange(5, -1, -1) & 3
    words = np.where((legs < 2).all(axis=-1), legs @ (1 << np.arange(5, -1, -1)), -1)
    kept = ("torque_level", "flux_level", "sector")
    channels = {name: full[name][::6] for name in kept}
    channels |= {f"s{n + 1}": words[:, n] for n in range(3)}
    return setup, Recording(full.rate_Hz / 6, channels, meta=full.meta)


def _choices(rec: Recording, words: np.ndarray) -> tuple[int, int]:
    """The number of periods in which the table's row was applied, and the number that followed a
    torque demand. With shadow load, the decision of a step is on the legs in the next period."""
    level, up = rec["torque_level"][:-1], rec["flux_level"][:-1]
    angle = 30 * rec["sector"][:-1] + np.sign(level) * np.where(up == 1, 75, 105)
    demand = np.flatnonzero(level)
    right = [geometry.word_along("L", int(angle[n]) % 360) == words[n + 1, 1] for n in demand]
    return sum(right), len(demand)


def a_t2(job: Job) -> Figure:
    """Table II: twelve virtual vectors, each three consecutive large vectors."""
    setup, rec = _fdr_run(job)
    law = Law(setup)
    # If torque and flux have to rise, the 75/105 table chooses virtual vector k in sector k - 2.
    rows = [law.words((k - 2) % 12, 1, True) for k in range(12)]
    sequences = [geometry.digits(row) for row in rows]
    played = play([pattern(row, T1, T2) for row in rows])
    middles = [played.period * t for t in (T1 / 2, 0.5, (T2 + 1) / 2)]
    heard = [
        tuple(int("".join(map(str, played.levels_at(n, at))), 2) for at in middles)
        for n in range(12)
    ]
    words = np.array([rec[f"s{n}"] for n in (1, 2, 3)]).T
    active = ~((words[:, :1] == words).all(axis=1) & np.isin(words[:, 0], geometry.ZEROS))
    chosen, asked = _choices(rec, words)
    printed = [row[1:] for row in TABLE_II]
    periods = [int(np.sum((words == row).all(axis=1))) for row in printed]
    seen = sum(periods)

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, 1, 4.6)
        names = [f"$VV_{{L{k + 1}}}$" for k in range(12)]
        heads = ["sequence", *(f"{p}" for p in PHASES), "$V_1$", "$V_2$", "$V_3$", "periods in run"]
        shade = {"0": "#ffffff", "7": "#9aa1ab"} | dict.fromkeys("1346", COLOURS["L"])
        texts, colours = [], []
        for row, sequence, count in zip(rows, sequences, periods, strict=True):
            texts.append([sequence, *sequence, *(f"{w}  {w:06b}" for w in row), str(count)])
            colours.append(["#ffffff", *(shade.get(d, COLOURS["S"]) for d in sequence),
                            *["#ffffff"] * 4])  # fmt: skip
        plots.cells(axes[0, 0], names, heads, texts, colours, 8.5)
        return plots.save(figure, path)

    def exact(what: str, ours: list, paper: list) -> Verdict:
        right = sum(a == b for a, b in zip(ours, paper, strict=True))
        return claim(what, right == 12, f"{right} of 12", "12 rows", required=True)

    digits = sorted(set("".join(sequences)))
    return Figure(
        metrics={"sequences": sequences, "words": rows, "periods_in_run": periods},
        paper={"sequences": [row[0] for row in TABLE_II]},
        verdicts=[
            exact("switching sequences as compiled", sequences, [row[0] for row in TABLE_II]),
            exact("state words as compiled", rows, printed),
            exact("state words on the simulated inverter", heard, printed),
            claim("FDR running: active periods that are one of the rows", seen == active.sum(),
                  f"{seen} of {active.sum()}", "all", required=True),
            claim("FDR running: rows that table 75/105 asks for", chosen == asked,
                  f"{chosen} of {asked}", "all", required=True),
            claim("FDR running: rows that were met", min(periods) > 0,
                  sum(n > 0 for n in periods), 12, required=True),
            claim("sequences 2 and 5 do not occur", not {"2", "5"} & set(digits),
                  " ".join(digits), "0 1 3 4 6 7", required=True),
        ],
        draw=draw,
        recordings={"": rec},
        setups=[setup],
        caption="Virtual vectors of FDR-DTC and DDR-DTC as the firmware forms them. A leg's digit "
                "is 4 S1 + 2 S2 + S3. Grey legs are high for the whole period. Blue legs have one "
                "transition within it. The run reverses from +400 to -400 r/min.",
    )  # fmt: skip
