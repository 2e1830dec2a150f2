"""Write the test vectors (*.json here) as C tables: header.py vectors.h

The build calls it. It needs Python alone.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent

#: Table -> C type, its members with the columns they come from, and codes for words.
C_TABLES = {
    "states": ("float alpha, beta, x, y; uint16_t nearest_zero;",
               ("alpha", "beta", "x", "y", "nearest_zero")),
    "table_2": ("uint16_t sequence[6]; uint16_t word[3];", ("sequence", "word1", "word2", "word3")),
    "sectors": ("float alpha, beta; uint16_t sector;", ("alpha", "beta", "sector")),
    "switching": ("uint16_t table, sector; int16_t torque, flux; uint16_t k;",
                  ("table", "sector", "torque", "flux", "k")),
    "selection": ("uint16_t k, xy_sector, table;", ("k", "xy_sector", "table")),
    "decisions": ("uint16_t scheme, sector; int16_t d_m, d_psi; uint16_t word_against, word_along;",
                  ("scheme", "sector", "d_m", "d_psi", "word_against", "word_along")),
    "duties": ("uint16_t group, k; float v_x, v_y, t1, t2;",
               ("group", "k", "v_x", "v_y", "T1", "T2")),
    "compare": ("float t1, t2; uint16_t sequence, period, first, shortest, start, ca, cb;",
                ("T1", "T2", "sequence", "period", "first", "shortest", "start", "CA", "CB")),
}  # fmt: skip
CODES = {"45/135": 0, "75/105": 1, "dtc1": 0, "dtc2": 1, "dtc3": 2, "L": 0, "ML": 1}
PREAMBLE = """/* Made by tests/vectors/header.py from the rows of the JSON files there, which
 * tests/vectors/README.md describes.
 *
 * Tables are read a row at a time, so that a processor with little memory, or with program
 * memory apart, can keep them there: define HT_ROM and HT_ROM_ROW before including this
 * (AVR: PROGMEM and memcpy_P). */
#ifndef HT_VECTORS_H
#define HT_VECTORS_H

#include <stdint.h>

#ifndef HT_ROM
#define HT_ROM
#define HT_ROM_ROW(to, from) (*(to) = *(from))
#endif
"""


def as_c(value: object, column: str) -> str:
    if column == "sequence" and isinstance(value, str):
        return "{" + ", ".join(value) + "}"
    if isinstance(value, str):
        return str(CODES[value])
    if isinstance(value, float):
        text = f"{value:.9g}"
        return f"{text}f" if any(c in text for c in ".e") else f"{text}.0f"
    return str(value)


def header() -> str:
    files = [json.loads(path.read_text()) for path in sorted(HERE.glob("*.json"))]
    by_name = {name: table for file in files for name, table in file.get("tables", {}).items()}
    parts = [PREAMBLE]
    for name, (members, wanted) in C_TABLES.items():
        columns, rows = by_name[name]["columns"], by_name[name]["rows"]
        kind = "virtual_vectors" if name == "table_2" else name
        parts.append(f"typedef struct {{ {members} }} ht_{kind}_row;")
        parts.append(f"static const ht_{kind}_row ht_{kind}_rows[{len(rows)}] HT_ROM = {{")
        for row in rows:
            values = dict(zip(columns, row, strict=True))
            cells = [as_c(values[column], column) for column in wanted]
            if name == "table_2":
                cells = [cells[0], "{" + ", ".join(cells[1:]) + "}"]
            parts.append("    {" + ", ".join(cells) + "},")
        parts.append("};\n")
    return "\n".join([*parts, "#endif\n"])


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(header())
