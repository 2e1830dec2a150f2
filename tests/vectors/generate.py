#!/usr/bin/env python3
"""Generate the test vectors (*.json here). `header.py` makes C tables of them.

Everything follows from the six phase angles and the definitions in README.md; nothing is
taken from the firmware or from hexatorque. `--check` compares with the files that are
checked in and exits 1 if one differs.

Needs numpy.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from pathlib import Path

import link_frames
import numpy as np

HERE = Path(__file__).resolve().parent

PHASES_DEG = (0, 30, 120, 150, 240, 270)  # u1 u2 w1 w2 v1 v2, u1 the highest bit
BITS = np.arange(64)[:, None] >> np.arange(5, -1, -1) & 1
#: alpha-beta and x-y voltage of each state word, complex, in units of Vdc.
AB, XY = (BITS @ np.exp(1j * n * np.deg2rad(PHASES_DEG)) / 3 for n in (1, 5))
ZEROS = (0, 21, 42, 63)
LENGTH = {
    "L": 2 / 3 * np.cos(np.deg2rad(15)),
    "ML": np.sqrt(2) / 3,
    "MS": 1 / 3,
    "S": 2 / 3 * np.cos(np.deg2rad(75)),
    "0": 0.0,
}
TABLES_DEG = {"45/135": (45, 135), "75/105": (75, 105)}


def number(x: float) -> float:
    """12 decimals: far more than single precision, and the same on every machine."""
    return round(float(x), 12) + 0.0


def group(word: int) -> str:
    (name,) = [name for name, r in LENGTH.items() if abs(abs(AB[word]) - r) < 1e-9]
    return name


def direction(angle_deg: float) -> int:
    """k = 0..11 of the angle 15 + 30 k degrees."""
    k = (angle_deg - 15) / 30
    assert abs(k - round(k)) < 1e-9
    return round(k) % 12


def word(name: str, k: int) -> int:
    """State word of group L, ML or S in direction k."""
    turned = AB * np.exp(-1j * np.deg2rad(15 + 30 * k))
    (found,) = [w for w in range(64) if group(w) == name and abs(np.angle(turned[w])) < 1e-9]
    return found


WORDS = {name: [word(name, k) for k in range(12)] for name in ("L", "ML", "S")}


def virtual(name: str, k: int) -> list[int]:
    """The three words of virtual vector k."""
    return [WORDS[name][(k + d) % 12] for d in (-1, 0, 1)]


def sectors() -> list[list]:
    """Fluxes in the middle of each sector and 0.01 degrees inside both its edges, in several
    lengths."""
    rows = []
    for s, off, length in itertools.product(range(12), (-14.99, 0, 14.99), (1e-3, 0.4, 1.0)):
        psi = length * np.exp(1j * np.deg2rad(30 * s + off))
        rows.append([number(psi.real), number(psi.imag), s])
    return rows


def demanded(table: str, sector: int, torque: int, flux: int) -> int:
    """The direction that raises (+1) or lowers (-1) torque and raises (1) or lowers (0) flux, for a
    flux in the middle of its sector."""
    raising, lowering = TABLES_DEG[table]
    return direction(30 * sector + torque * (raising if flux else lowering))


def adds(k: int, xy_sector: int) -> bool:
    """Whether the large vector k raises an x-y flux in the middle of that sector."""
    return (XY[WORDS["L"][k]] * np.exp(-1j * np.deg2rad(30 * xy_sector))).real > 0


def states() -> list[list]:
    rows = []
    for w in range(64):
        fewest = sorted(ZEROS, key=lambda z: (w ^ z).bit_count())
        assert (w ^ fewest[0]).bit_count() < (w ^ fewest[1]).bit_count()
        name = group(w)
        k = WORDS[name].index(w) if name in WORDS else None
        plane = (AB[w].real, AB[w].imag, XY[w].real, XY[w].imag)
        rows.append([w, *map(number, plane), name, k, fewest[0]])
    return rows


def lengths() -> list[list]:
    rows = []
    for name, sample in (("L", 48), ("ML", 57), ("MS", 16), ("S", 54)):
        assert group(sample) == name
        share = 100 * LENGTH[name] / LENGTH["L"]
        rows.append([name, sample, *map(number, (abs(AB[sample]), abs(XY[sample]), share))])
    return rows


def sequences() -> list[list]:
    rows = []
    for k in range(12):
        words = virtual("L", k)
        digits = BITS[words].T @ (4, 2, 1)
        rows.append([k, "".join(map(str, digits)), *words])
    return rows


def sector_i(name: str) -> list[list]:
    """Sector i of the 75/105 table with the vectors of one group."""
    return [[dm, flux, WORDS[name][demanded("75/105", 0, dm, flux)]]
            for dm, flux in itertools.product((1, -1), (1, 0))]  # fmt: skip


def row_v60() -> list[list]:
    k = WORDS["L"].index(60)
    return [[60, j, 2 if adds(k, j) else 1] for j in range(12)]


def virtual_pairs() -> list[list]:
    rows = []
    for dm, flux in itertools.product((2, 1, -1, -2), (1, 0)):
        k = demanded("75/105", 0, int(np.sign(dm)), flux)
        name = "L" if abs(dm) == 2 else "S"
        rows.append([dm, flux, f"V_{name}{k + 1}", WORDS[name][k], WORDS["ML"][k]])
    return rows


def switching() -> list[list]:
    return [[table, s, torque, flux, demanded(table, s, torque, flux)]
            for table in TABLES_DEG for s in range(12)
            for torque, flux in itertools.product((1, -1), (1, 0))]  # fmt: skip


def selection() -> list[list]:
    return [[k, j, 2 if adds(k, j) else 1] for k in range(12) for j in range(12)]


def decisions() -> list[list]:
    rows = []
    for scheme, levels in (("dtc1", (1, -1)), ("dtc2", (1, -1)), ("dtc3", (2, 1, -1, -2))):
        for s, dm, flux in itertools.product(range(12), levels, (1, 0)):
            k = demanded("75/105", s, int(np.sign(dm)), flux)
            first = WORDS["S" if scheme == "dtc3" and abs(dm) == 1 else "L"][k]
            other = first if scheme == "dtc1" else WORDS["ML"][k]
            rows.append([scheme, s, dm, flux, first, other])
    return rows


def solution(name: str, k: int, v: complex) -> np.ndarray:
    """Duties t1 t2 t3 that give the mean x-y voltage v; they add up to 1."""
    xy = XY[virtual(name, k)]
    return np.linalg.solve([xy.real, xy.imag, np.ones(3)], [v.real, v.imag, 1])


def tmvcl(name: str) -> float:
    """Half side of the largest x-y box in which every duty of every k is >= 0."""
    sides = []
    for k in range(12):
        zero = solution(name, k, 0)
        slopes = np.array([solution(name, k, v) - zero for v in (1, 1j)])
        sides.append((zero / abs(slopes).sum(axis=0)).min())
    assert np.ptp(sides) < 1e-12
    return sides[0]


#: x-y commands in units of TMVCL: a grid over the box, and outside of it.
INSIDE = list(itertools.product((-1, -0.5, 0, 0.5, 1), repeat=2))
OUTSIDE = [(2, 0), (-2, 0), (0, 2), (0, -2), *itertools.product((-1.5, 1.5), repeat=2),
           *itertools.product((-30, 30), (-20, 20))]  # fmt: skip


def duties() -> list[list]:
    rows = []
    for name in ("L", "ML"):
        side = tmvcl(name)
        for k, (ux, uy) in itertools.product(range(12), INSIDE + OUTSIDE):
            x, y = round(ux * side, 9) + 0.0, round(uy * side, 9) + 0.0
            t = solution(name, k, x + 1j * y)
            first = min(max(t[0], 0), 1)
            second = min(max(t[0] + t[1], first), 1)
            reach = max(abs(ux), abs(uy))
            where = "inside" if reach < 1 else "edge" if reach == 1 else "outside"
            rows.append([name, k, x, y, where, *map(number, (*t, first, second))])
    return rows


#: Action points. The first pair are the fixed ones.
POINTS = ((2 - np.sqrt(3), np.sqrt(3) - 1), (0, 0), (0, 1), (1, 1), (0, 0.6), (0.6, 0.6), (0.31, 1),
          (1e-6, 2e-6), (0.999998, 0.999999), (0.13, 0.63), (0.402, 0.83))  # fmt: skip
#: (period, count at which it begins, shortest pulse).
PERIODS = ((8, 0, 1), (9, 0, 4), (8, 3, 2), (100, 0, 1), (10000, 0, 430), (15000, 0, 645),
           (15000, 307, 4700), (65535, 0, 9000), (65535, 30001, 1))  # fmt: skip


def nearest(first: int, t: float, period: int) -> int:
    """The count nearest to an instant. The vectors avoid ties, where single and double precision
    may differ."""
    instant = min(first + t * period, period)
    assert instant == period or abs(instant % 1 - 0.5) > 4e-7 * period, (first, t, period)
    return int(np.floor(instant + 0.5))


def allowed(count: int, low: int, high: int, shortest: int) -> int:
    """The count nearest to `count` that is `low`, `high`, or the shortest pulse away from both; at
    the same distance the one that keeps the pulse, or else the later one."""
    inside = range(low + shortest, high - shortest + 1)
    near = [low, high]
    if inside:
        near = [min(max(count, inside[0]), inside[-1]), *near]
    return min(near, key=lambda c: (abs(c - count), c == low))


def compare() -> list[list]:
    rows = []
    for (period, first, shortest), (t1, t2) in itertools.product(PERIODS, POINTS):
        t1, t2 = number(t1), number(t2)
        for sequence in range(8):
            levels = sequence >> 2, sequence >> 1 & 1, sequence & 1
            # Without a change of level there is no count to move.
            ca = cb = period
            if levels[1] != levels[2]:
                cb = allowed(nearest(first, t2, period), first, period, shortest)
            if levels[0] != levels[1]:
                ca = allowed(min(nearest(first, t1, period), cb), first, cb, shortest)
            at = [first, ca if levels[0] != levels[1] else first, cb, period]
            played = [s for s, begin, end in zip(levels, at, at[1:]) for _ in range(end - begin)]
            jumps = [first + n for n in range(1, len(played)) if played[n] != played[n - 1]]
            start = played[0]
            # The first of two changes is in A. A single one is in A unless it is the second word's.
            in_b = len(jumps) == 1 and jumps[0] == cb and ca != cb and levels[1] != levels[2]
            ca, cb = ([period, *jumps] if in_b else [*jumps, period, period])[:2]
            rows.append([sequence, t1, t2, period, first, shortest, start, ca, cb])
    return rows


#: File -> table -> (columns, rows).
def tables() -> dict[str, dict[str, tuple[list[str], list[list]]]]:
    return {
        "states": {"states": (["word", "alpha", "beta", "x", "y", "group", "k", "nearest_zero"],
                              states())},
        "paper_a": {
            "table_1": (["group", "sample", "alpha_beta", "x_y", "share_pct"], lengths()),
            "table_2": (["k", "sequence", "word1", "word2", "word3"], sequences()),
        },
        "paper_b": {
            "table_1": (["d_m", "d_psi", "vector"], sector_i("L")),
            "table_2a": (["d_m", "d_psi", "vector"], sector_i("L")),
            "table_2b": (["d_m", "d_psi", "vector"], sector_i("ML")),
            "table_3": (["vector", "xy_sector", "table"], row_v60()),
            "table_4": (["d_m", "d_psi", "virtual", "vector1", "vector2"], virtual_pairs()),
        },
        "sectors": {"sectors": (["alpha", "beta", "sector"], sectors())},
        "switching": {"switching": (["table", "sector", "torque", "flux", "k"], switching())},
        "selection": {"selection": (["k", "xy_sector", "table"], selection())},
        "decisions": {"decisions": (["scheme", "sector", "d_m", "d_psi", "word_against",
                                     "word_along"], decisions())},
        "duties": {"duties": (["group", "k", "v_x", "v_y", "where", "t1", "t2", "t3", "T1", "T2"],
                              duties())},
        "compare": {"compare": (["sequence", "T1", "T2", "period", "first", "shortest", "start",
                                 "CA", "CB"],
                                compare())},
        "link": link_frames.tables(),
    }  # fmt: skip


def as_json(content: dict) -> str:
    """One row a line."""
    parts = []
    for name, (columns, rows) in content.items():
        lines = ",\n".join(f"   {json.dumps(row)}" for row in rows)
        parts.append(f'  "{name}": {{\n   "columns": {json.dumps(columns)},\n   "rows": [\n'
                     f"{lines}\n   ]\n  }}")  # fmt: skip
    return '{\n "format": "hexatorque-vectors-1",\n "tables": {\n' + ",\n".join(parts) + "\n }\n}\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="exit 1 if a file differs")
    check = parser.parse_args().check
    files = tables()
    made = {HERE / f"{name}.json": as_json(content) for name, content in files.items()}
    stale = []
    for path, text in made.items():
        if not check:
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            stale.append(path.name)
    if stale:
        print(f"differ from what {Path(__file__).name} makes: {', '.join(stale)}", file=sys.stderr)
    return bool(stale)


if __name__ == "__main__":
    raise SystemExit(main())
