"""Campaigns are tests of very many cases. `make test` runs a part of each, so that it takes
minutes. With HT_WHOLE=1 a campaign runs every case, with HT_WHOLE=0.3 three tenths of them. CI runs
such a share: every case takes longer than one waits for CI.
"""

import dataclasses
import math
import os
from collections import Counter
from collections.abc import Sequence


def share(text: str) -> float:
    """What HT_WHOLE asks for, 0 to 1."""
    try:
        asked = float(text or 0)
    except ValueError:
        asked = math.nan
    if not 0 <= asked <= 1:
        raise SystemExit(f"HT_WHOLE={text}: a share of the cases from 0 to 1; 1 runs every case")
    return asked


SHARE = share(os.environ.get("HT_WHOLE", ""))
WHOLE = SHARE == 1


def part(cases: Sequence, number: int) -> list:
    """`number` of the cases, more if HT_WHOLE asks for them, always the same ones.

    Each value of each property of a case occurs about equally often in the part. Cases are
    tuples, dataclasses or plain values.
    """
    number = max(number, math.ceil(SHARE * len(cases)))
    return list(cases) if number >= len(cases) else spread(cases, number)


def examples(number: int) -> int:
    """How many inputs Hypothesis makes: all if the campaigns are whole, a quarter at least."""
    return max(number // 4, math.ceil(SHARE * number))


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
