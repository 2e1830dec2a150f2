"""The names in the firmware's table of chips and boards, ht_chips.def, numbers of its headers,
and how it is compiled on a computer.

They are read from the text: cmake/initial_values.py needs them where there is no compiled firmware.
"""

from __future__ import annotations

import re
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent
#: The firmware's sources: inside the installed package, or in the work tree.
SOURCES = next(
    folder / "firmware"
    for folder in (PACKAGE / "source", PACKAGE.parents[1])
    if (folder / "firmware").is_dir()
)
_TABLE = (SOURCES / "port" / "c2000" / "ht_chips.def").read_text(encoding="utf-8")

#: The chips for which the firmware has drivers and a register model, by number (`ht_device`).
DEVICES = tuple(re.findall(r"^HT_CHIP\((\w+),", _TABLE, re.M))
#: The boards with them.
BOARDS = tuple(re.findall(r"^HT_CHIP_BOARD\(\w+, (\w+)\)", _TABLE, re.M))

#: Options of a C compiler for exact C99 arithmetic, on which equal bits depend.
EXACT = ("-std=c99", "-ffp-contract=off", "-fno-math-errno")

#: Assumed C28x cycles for one instruction of the Cortex-M4F, smallest and largest assumption. Each
#: has two numbers: for any other instruction, and for a branch, call or return.
C28X_CYCLES = ((1.0, 4.0), (1.5, 7.0))
#: So the smallest estimate is at least this share of the largest one.
LEAST_ESTIMATE = min(low / high for low, high in zip(*C28X_CYCLES))


@lru_cache(maxsize=1)
def budget() -> dict[str, Any]:
    """The limits of the firmware's costs."""
    return tomllib.loads((SOURCES / "budget.toml").read_text(encoding="utf-8"))


def number_of(header: str, name: str) -> float:
    """The number that a header of the firmware defines as a macro of this name."""
    text = (SOURCES / header).read_text(encoding="utf-8")
    (number,) = re.findall(rf"^#define {name} ([-\d.e]+)[fu]?\b", text, re.M)
    return float(number)


def range_of(parameter: str) -> tuple[float, float]:
    """The least and the largest value of a controller parameter that is a number."""
    rows = (SOURCES / "app" / "ht_params.def").read_text(encoding="utf-8")
    pattern = rf'^HT_PARAM\({parameter}, \w+, "[^"]*", ([-\d.e]+)f, ([-\d.e]+)f,'
    ((least, most),) = re.findall(pattern, rows, re.M)
    return float(least), float(most)
