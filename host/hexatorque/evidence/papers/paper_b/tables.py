"""Paper B's switching tables: as compiled, and as applied in a running drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .... import setups
from ....analysis import plots
from ..engine import geometry
from ..engine.audit import Audit, audit, verdicts
from ..engine.figure import Figure, Verdict, claim
from ..engine.geometry import ROMAN, XY
from ..engine.job import Job
from ..engine.law import Law

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Demand = tuple[int, int]  #: d_m, d_psi
#: Sector i as printed.
TABLE_I = {(1, 1): 60, (1, 0): 28, (-1, 1): 35, (-1, 0): 3}
TABLE_II_B = {(1, 1): 24, (1, 0): 44, (-1, 1): 19, (-1, 0): 39}
#: Table IV, sector i: number x of the virtual vector, which is V_Lx at levels 2 and -2, and V_Sx at
#: levels 1 and -1.
TABLE_IV = {(2, 1): 3, (2, 0): 4, (1, 1): 3, (1, 0): 4,
            (-1, 1): 10, (-1, 0): 9, (-2, 1): 10, (-2, 0): 9}  # fmt: skip
#: Table III, row V60: switching table to use, by x-y sector i..xii, ...
TABLE_III_V60 = [2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 2, 2]
#: ... and by the sentence in section IV-A: V24 (table 2) with the x-y flux in sectors v to x, else
#: V60.
SENTENCE_V60 = [1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 1, 1]
V60 = 2  #: its direction k

#: x-y flux that opposes the large vector's x-y voltage or points along it, Wb per Vdc.
AGAINST, ALONG = -0.02, 0.02
COLOURS = {"L": plots.COLOUR["i_u1"], "ML": plots.COLOUR["i_u2"], "S": plots.COLOUR["torque"]}


def _law(scheme: str) -> Law:
    return Law(setups.load("paper-b").changed(controller__scheme=scheme))


def exact(what: str, ours: list, paper: list) -> Verdict:
    right = sum(a == b for a, b in zip(ours, paper, strict=True))
    return claim(what, right == len(paper), f"{right} of {len(paper)} cells", "all",
                 required=True)  # fmt: skip


class Table:
    """A switching table as compiled. rows: demand -> sector 0..11 -> words, one for each x-y flux
    of `sides`; printed: the words of sector i."""

    def __init__(self, name: str, law: Law, sides: tuple[float, ...],
                 printed: dict[Demand, tuple[int, ...]]) -> None:  # fmt: skip
        self.name, self.printed = name, printed
        self.rows = {
            demand: [tuple(self._word(law, demand, s, side) for side in sides) for s in range(12)]
            for demand in printed
        }
        self._zeros = [law.words(s, 0, up) for s in range(12) for up in (True, False)]

    @staticmethod
    def _word(law: Law, demand: Demand, s: int, side: float) -> int:
        # The vector's direction follows from the demand. 75 degrees from the flux raises the flux,
        # 105 degrees lowers it. A vector ahead of the flux raises the torque.
        angle = (30 * s + int(np.sign(demand[0])) * (75 if demand[1] else 105)) % 360
        words = law.words(s, demand[0], bool(demand[1]), side * XY[geometry.word_along("L", angle)])
        (word,) = set(words)  # a single vector for the whole period
        return word

    def verdicts(self) -> list[Verdict]:
        """The verdicts: sector i is compared with the print, each other sector with the print
        turned by 30 degrees a sector."""
        turned = {
            demand: [tuple(geometry.turned(word, s) for word in words) for s in range(12)]
            for demand, words in self.printed.items()
        }
        others = [[cell for row in rows.values() for cell in row[1:]]
                  for rows in (self.rows, turned)]  # fmt: skip
        zeros = [len(set(w)) == 1 and w[0] in geometry.ZEROS for w in self._zeros]
        return [
            exact(f"{self.name}, sector i as printed", [row[0] for row in self.rows.values()],
                  list(self.printed.values())),
            exact(f"{self.name}, sectors ii to xii, turned", *others),
            exact(f"{self.name}, zero vector without torque demand", zeros, [True] * 24),
        ]  # fmt: skip

    def draw(self, ax: Axes, run: Audit) -> None:
        demands = sorted(self.rows, reverse=True)
        texts = [[f"{self._label(d, s)}\n{run.met(*d, s, self.rows[d][s])}" for s in range(12)]
                 for d in demands]  # fmt: skip
        colours = [[COLOURS[geometry.group(cell[0])] for cell in self.rows[d]] for d in demands]
        names = [rf"$d_m$ = {level:+d}, $d_\psi$ = {up}" for level, up in demands]
        plots.cells(ax, names, ["i (printed)", *ROMAN[1:]], texts, colours)
        ax.set_title(f"{self.name}: vector by sector of the flux, periods in the run",
                     **plots.TITLE)  # fmt: skip

    def _label(self, demand: Demand, s: int) -> str:
        words = self.rows[demand][s]
        if len(words) == 1:
            return f"V{words[0]}"
        number = round(float(geometry.degrees(geometry.AB[words[0]])) + 15) // 30
        return f"$V_{{{geometry.group(words[0])}{number}}}$ {words[0]}|{words[1]}"


def _figure(run: Audit, tables: list[Table], caption: str) -> Figure:
    def draw(path: Path) -> Path:
        sizes = [len(table.rows) for table in tables]
        figure, axes = plots.new_figure(
            len(tables), 1, sum(0.6 + 0.38 * n for n in sizes),
            gridspec_kw={"height_ratios": [n + 1 for n in sizes]},
        )  # fmt: skip
        for ax, table in zip(axes[:, 0], tables, strict=True):
            table.draw(ax, run)
        return plots.save(figure, path)

    cells = {
        table.name: {f"dm {d[0]:+d} dpsi {d[1]}": row for d, row in table.rows.items()}
        for table in tables
    }
    return Figure(
        metrics={"periods": len(run.word), "right": run.right, "by_sector": cells},
        verdicts=[*(v for table in tables for v in table.verdicts()), *verdicts(run)],
        draw=draw,
        recordings={"": run.recording},
        setups=[run.setup],
        caption=f"{caption} Without torque demand, the zero vector with the fewest transitions is "
        "applied. The paper prints sector i. The other sectors follow by turning it; sector s "
        "reaches from 30 s - 15 to 30 s + 15 degrees. The small numbers count the periods in which "
        "a drive that reverses between +500 and -500 r/min applied the vector for that demand.",
    )


def b_t1(job: Job) -> Figure:
    """Table I: DTC1."""
    printed: dict[Demand, tuple[int, ...]] = {demand: (word,) for demand, word in TABLE_I.items()}
    table = Table("Table I", _law("dtc1"), (ALONG,), printed)
    return _figure(audit(job, "dtc1"), [table], "Switching table of DTC1.")


def b_t2(job: Job) -> Figure:
    """Table II: DTC2's two tables, one with large and one with medium-large vectors."""
    law = _law("dtc2")
    tables = [
        Table(name, law, (side,), {demand: (word,) for demand, word in printed.items()})
        for name, side, printed in (
            ("Table II-a", AGAINST, TABLE_I),
            ("Table II-b", ALONG, TABLE_II_B),
        )
    ]
    caption = (
        "Switching tables of DTC2: a large vector, or the medium-large vector in the same "
        "direction. The one that lowers the x-y flux is applied."
    )
    return _figure(audit(job, "dtc2"), tables, caption)


def b_t4(job: Job) -> Figure:
    """Table IV: DTC3's virtual vectors V_L (large and medium-large) and V_S (small and
    medium-large). One of the two real vectors is applied in each period."""
    printed = {
        (level, up): tuple(
            geometry.word_along(group, 15 + 30 * (number - 1))
            for group in ("L" if abs(level) == 2 else "S", "ML")
        )
        for (level, up), number in TABLE_IV.items()
    }
    table = Table("Table IV", _law("dtc3"), (AGAINST, ALONG), printed)
    return _figure(audit(job, "dtc3"), [table], "Virtual vectors of DTC3 as pairs of real ones: "
                   "large or small | medium-large.")  # fmt: skip


def _selection(scheme: str) -> np.ndarray:
    """(12, 12): switching table 1 or 2 by direction k and x-y sector, as compiled."""
    law, chosen = _law(scheme), np.empty((12, 12), int)
    for k in range(12):
        for j in range(12):
            psi_xy = 0.02 * np.exp(1j * np.deg2rad(30 * j))
            # If torque and flux have to rise, direction k is chosen in sector k - 2.
            word = law.words((k - 2) % 12, law.full_level, True, psi_xy)[0]
            chosen[k, j] = {"L": 1, "ML": 2}[geometry.group(word)]
    return chosen


def _used(runs: list[Audit]) -> np.ndarray:
    """(2, 12, 12): periods by table used, direction k and x-y sector."""
    used = np.zeros((2, 12, 12), int)
    for run in runs:
        active = (~run.idle) | run.hold
        words = run.word[active]
        k = np.round((geometry.degrees(geometry.AB[words]) - 15) / 30).astype(int) % 12
        table = np.array([geometry.group(int(w)) == "ML" for w in words], int)
        np.add.at(used, (table, k, geometry.sector(run.psi_xy[active])), 1)
    return used


def b_t3(job: Job) -> Figure:
    """Table III: the choice between the two tables by the sector of the x-y flux."""
    schemes = ("dtc2", "dtc3")
    runs = [audit(job, scheme) for scheme in schemes]
    tables = {scheme: _selection(scheme) for scheme in schemes}
    selection = tables["dtc2"]
    # The medium-large vector is right where the large one would raise the x-y flux.
    turn = np.exp(1j * np.deg2rad(30 * np.arange(12)))
    derived = np.where(np.real(np.outer(XY[geometry.WORDS["L"]], turn.conj())) > 0, 2, 1)
    used = _used(runs)
    agree = int(used[0][derived == 1].sum() + used[1][derived == 2].sum())
    total = int(used[:, V60].sum())
    said = sum(int(used[table - 1, V60, j]) for j, table in enumerate(SENTENCE_V60))

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, 1, 5.4)
        both = zip(selection, used.sum(axis=0), strict=True)
        texts = [[f"{t}\n{n}" for t, n in zip(*row, strict=True)] for row in both]
        colours = [[COLOURS["L" if t == 1 else "ML"] for t in row] for row in selection]
        names = [f"V{word}" for word in geometry.WORDS["L"]]
        names[V60] += " (printed)"
        plots.cells(axes[0, 0], names, ROMAN, texts, colours)
        axes[0, 0].set_title("Table III: switching table 1 (large or small vector) or 2 (medium-"
                             "large) by sector of the x-y flux, periods in the runs",
                             **plots.TITLE)  # fmt: skip
        return plots.save(figure, path)

    return Figure(
        metrics={"selection": selection.tolist(), "periods": int(used.sum()), "right": agree},
        paper={"V60": TABLE_III_V60},
        verdicts=[
            exact("Table III, row V60 as printed", selection[V60].tolist(), TABLE_III_V60),
            *[exact(f"Table III for all 12 vectors, {scheme.upper()}, from the x-y angles",
                    table.ravel().tolist(), derived.ravel().tolist())
              for scheme, table in tables.items()],
            claim("DTC2 and DTC3 running: the choice is Table III's", agree == used.sum(),
                  f"{agree} of {used.sum()} periods", "all", required=True),
            claim("the sentence in section IV-A: V24 with the x-y flux in v to x", said == total,
                  f"{said} of {total} periods of V60 or V24", "all",
                  why="The sentence contradicts Table III and its own aim: in sectors v to x, V60 "
                      "lowers the x-y flux and V24 raises it."),
        ],
        draw=draw,
        recordings={run.setup["controller.scheme"]: run.recording for run in runs},
        setups=[run.setup for run in runs],
        caption="Choice between the two switching tables of DTC2 and DTC3. The paper prints the "
                "row of V60. The other rows follow from the same rule: never the vector that "
                "raises the x-y flux. The small numbers count periods of two drives that reverse "
                "between +500 and -500 r/min.",
    )  # fmt: skip
