"""What may differ between a real machine and its set-up. Each kind of machine has its list,
`Parameters.MAY_DIFFER`, which a comparison with a bench tries.

This module imports nothing but Python's own modules.
"""

from __future__ import annotations

from dataclasses import dataclass

PERCENT = "%"


@dataclass(frozen=True)
class Differing:
    """Constants of a machine that change together: by a share of their values (unit %), or by a
    number of their own unit. step: change with which the simulation is tried, large against the
    noise; low, high: changes that can be meant; place: of the one value of a list that changes."""

    name: str
    keys: tuple[str, ...]
    step: float
    low: float = -0.6
    high: float = 1.5
    unit: str = PERCENT
    place: int | None = None


#: Of every kind.
R_S = Differing("R_s", ("rs_ohm",), 0.2)
L_XY = Differing("L_xy", ("lxy_H",), 0.4)
