#!/usr/bin/env python3
"""Generate firmware/core/ht_tables.c from the geometry of the winding.

Nothing in the output is typed in by hand: phase angles and the definition of
the transform are the only inputs. `--check` compares with the checked-in file
and exits 1 on drift (run by the test suite).

Needs the Python standard library only.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

PHASES_DEG = (0, 30, 120, 150, 240, 270)  # u1 u2 w1 w2 v1 v2
DISPLACEMENTS_DEG = (30, 0, 60)  # of set 2, in the order of ht_winding
OUTPUT = Path(__file__).resolve().parent.parent / "core" / "ht_tables.c"


def transform_columns(displacement_deg: int = 30) -> list[tuple[float, float, float, float]]:
    """Columns of T (4 x 6), one per phase: (alpha, beta, x, y). x - j y is half the difference of
    the sets' vectors, so a phase of set 2 has -alpha, beta there; with 30 degrees these are cosine
    and sine of five times its angle."""
    columns = []
    for leg, deg in enumerate(PHASES_DEG):
        set2 = leg % 2
        th = math.radians(deg + set2 * (displacement_deg - PHASES_DEG[1]))
        alpha, beta = math.cos(th) / 3, math.sin(th) / 3
        columns.append((alpha, beta, -alpha if set2 else alpha, beta if set2 else -beta))
    return columns


def vector(word: int) -> tuple[float, float, float, float]:
    """Voltage vector of a state word, normalised by Vdc."""
    columns = transform_columns()
    legs = [(word >> (5 - leg)) & 1 for leg in range(6)]
    return tuple(sum(columns[leg][a] for leg in range(6) if legs[leg]) for a in range(4))


def groups() -> dict[str, list[int]]:
    """State words of the large, medium-large and small groups, ordered by their
    alpha-beta direction 15 + 30 k degrees, k = 0..11."""
    radius = {
        "L": 2 / 3 * math.cos(math.radians(15)),
        "ML": math.sqrt(2) / 3,
        "S": 2 / 3 * math.cos(math.radians(75)),
    }
    found: dict[str, list[int]] = {name: [-1] * 12 for name in radius}
    for word in range(64):
        a, b, _, _ = vector(word)
        for name, r in radius.items():
            if abs(math.hypot(a, b) - r) < 1e-9:
                k = round((math.degrees(math.atan2(b, a)) - 15) / 30) % 12
                if found[name][k] != -1:
                    raise ValueError(f"two words in direction {k} of group {name}")
                found[name][k] = word
    for name, words in found.items():
        if -1 in words:
            raise ValueError(f"group {name} is incomplete: {words}")
    return found


def alike(displacement_deg: int) -> list[int]:
    """State words with which both sets make the same voltage, for sets that are 0 or 60 degrees
    apart: the large vectors, at 60 n degrees. Each stands twice, for k = 2 n and 2 n + 1."""
    words = []
    for n in range(6):
        word = 0
        for leg in range(6):
            deg = 120 * (leg // 2) + displacement_deg * (leg % 2)
            if math.cos(math.radians(60 * n - deg)) > 0:
                word |= 32 >> leg
        words += [word, word]
    return words


def set2_turn(displacement_deg: int) -> tuple[float, float]:
    """Cosine and sine of what set 2 lies ahead of its place in PHASES_DEG."""
    turn = math.radians(displacement_deg - PHASES_DEG[1])
    return math.cos(turn), math.sin(turn)


def nearest_zero(word: int) -> int:
    """Zero state (0, 21, 42 or 63) with the fewest leg transitions from `word`.
    Each three-leg set decides by majority, so there are no ties."""
    zeros = (0, 21, 42, 63)
    distance = [bin(word ^ z).count("1") for z in zeros]
    best = min(distance)
    assert distance.count(best) == 1
    return zeros[distance.index(best)]


def first_leg(word: int) -> int:
    """First leg, in phase order, whose bit is set in `word`; 6 if there is none."""
    return 6 - word.bit_length()


def duty_rows(words: list[int]) -> list[tuple[float, ...]]:
    """Eq. (13) of paper A expanded for each virtual vector k = (k-1, k, k+1):
    t1 = t1_0 + a1 vx + b1 vy, t2 = t2_0 + a2 vx + b2 vy."""
    rows = []
    for k in range(12):
        v1, v2, v3 = (vector(words[(k + d) % 12])[2:] for d in (-1, 0, 1))
        v13 = (v1[0] - v3[0], v1[1] - v3[1])
        v23 = (v2[0] - v3[0], v2[1] - v3[1])
        det = v13[0] * v23[1] - v13[1] * v23[0]
        gain = 1 / det  # 18 for L, 9 (2 - sqrt 3) for ML
        a1, b1 = gain * v23[1], -gain * v23[0]
        a2, b2 = -gain * v13[1], gain * v13[0]
        rows.append((-a1 * v3[0] - b1 * v3[1], a1, b1, -a2 * v3[0] - b2 * v3[1], a2, b2))
    return rows


def tmvcl(rows: list[tuple[float, ...]]) -> float:
    """Largest per-axis |v_xy| (box) for which every duty of every k is >= 0."""
    limit = math.inf
    for t10, a1, b1, t20, a2, b2 in rows:
        for t0, a, b in ((t10, a1, b1), (t20, a2, b2), (1 - t10 - t20, -a1 - a2, -b1 - b2)):
            limit = min(limit, t0 / (abs(a) + abs(b)))
    return limit


def num(x: float) -> str:
    x = 0.0 if abs(x) < 1e-12 else x
    return f"{x:.9g}f" if any(c in f"{x:.9g}" for c in ".e") else f"{x:.9g}.0f"


def render() -> str:
    group = groups()
    duty = {name: duty_rows(group[name]) for name in ("L", "ML")}
    out = [
        "/* Generated by firmware/tools/generate_tables.py from the winding geometry.",
        " * Do not edit: change the generator and run it again. */",
        '#include "ht_tables.h"',
        "",
        "const ht_vsd ht_transform[HT_WINDINGS][HT_LEGS] = {",
    ]
    vsd = "    {{{{{0}, {1}}}, {{{2}, {3}}}}},{4}"
    for displacement in DISPLACEMENTS_DEG:
        out.append(f"    {{ /* {displacement} deg */")
        out += ["    " + vsd.format(*map(num, c), "") for c in transform_columns(displacement)]
        out.append("    },")
    out += ["};", "", "const ht_vsd ht_vector[64] = {"]
    for word in range(64):
        out.append(vsd.format(*(num(c) for c in vector(word)), f" /* {word:2d} {word:06b} */"))
    out += ["};", "", "const uint16_t ht_group[HT_GROUPS][HT_DIRECTIONS] = {"]
    for name in ("L", "ML", "S"):
        out.append("    {" + ", ".join(map(str, group[name])) + f"}}, /* {name} */")
    for deg in DISPLACEMENTS_DEG[1:]:
        out.append("    {" + ", ".join(map(str, alike(deg))) + f"}}, /* L{deg} */")
    out += ["};", "", "const uint16_t ht_nearest_zero[64] = {"]
    for row in range(0, 64, 16):
        out.append("    " + ", ".join(str(nearest_zero(w)) for w in range(row, row + 16)) + ",")
    out += ["};", "", "const uint16_t ht_first_leg[64] = {"]
    for row in range(0, 64, 16):
        out.append("    " + ", ".join(str(first_leg(w)) for w in range(row, row + 16)) + ",")
    out += ["};", "", "const ht_duty_row ht_duty_table[2][HT_DIRECTIONS] = {"]
    for name in ("L", "ML"):
        out.append(f"    {{ /* {name} */")
        out += ["        {" + ", ".join(num(c) for c in row) + "}," for row in duty[name]]
        out.append("    },")
    limits = ", ".join(num(tmvcl(duty[name])) for name in ("L", "ML"))
    out += ["};", "", f"const float ht_tmvcl_pu[2] = {{{limits}}};", ""]
    out += ["const ht_ab ht_set2_turn[HT_WINDINGS] = {"]
    for deg in DISPLACEMENTS_DEG:
        out.append("    {" + ", ".join(map(num, set2_turn(deg))) + f"}}, /* {deg} deg */")
    out += ["};", ""]
    return "\n".join(out)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="exit 1 if the file differs")
    args = parser.parse_args()
    text = render()
    if args.check:
        if OUTPUT.read_text() != text:
            print(f"{OUTPUT} differs from what the generator makes", file=sys.stderr)
            return 1
        return 0
    OUTPUT.write_text(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
