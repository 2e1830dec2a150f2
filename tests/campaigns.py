"""Campaigns are tests of very many cases. `make test` runs a part of each, so that it takes
minutes. With HT_WHOLE=1 a campaign runs every case; CI does.
"""

import dataclasses
import math
import os
from collections import Counter
from collections.abc import Sequence

WHOLE = os.environ.get("HT_WHOLE", "") not in ("", "0")


def part(cases: Sequence, number: int) -> list:
    """All cases if the campaigns are whole, else `number` of them, always the same ones.

    Each value of each property of a case occurs about equally often in the part. Cases are
    tuples, dataclasses or plain values.
    """
    return list(cases) if WHOLE or number >= len(cases) else spread(cases, number)


def examples(number: int) -> int:
    """How many inputs Hypothesis makes: all if the campaigns are whole, else a quarter."""
    return number if WHOLE else number // 4


def spread(cases: Sequence, number: int) -> list:
    # A stride of the golden ratio is the most even spread over a list without properties.
    size = len(cases)
    stride = next(n for n in range(round(0.618 * size), 2 * size) if math.gcd(n, size) == 1)
    left = [k * stride % size for k in range(size)]
    chosen: Counter = Counter()
    result = []
    for _ in range(number):
        best = min(left, key=lambda k: sum(chosen[p] for p in properties(cases[k])))
        left.remove(best)
        chosen.update(properties(cases[best]))
        result.append(cases[best])
    return result


def properties(case) -> list:
    if dataclasses.is_dataclass(case):
        case = dataclasses.astuple(case)
    return list(enumerate(case)) if isinstance(case, tuple) else []
