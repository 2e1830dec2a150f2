"""Which parameter limits which channel: the one table of it."""

from __future__ import annotations

from collections.abc import Container
from typing import NamedTuple

from ..firmware import TEST
from ..plant.vsd import PHASES


class Limit(NamedTuple):
    """A parameter whose value is a level that channels of the same unit must not pass. signs: 1 for
    the value itself, -1 for the same in the other direction; state: the limit is in force in this
    state only, "" for always."""

    parameter: str
    channels: tuple[str, ...]
    signs: tuple[int, ...]
    state: str = ""


_CURRENTS = tuple(f"i_{phase}_A" for phase in PHASES)
_FLUX = ("psi_alpha_Wb", "psi_beta_Wb")
BOTH = (1, -1)

LIMITS = (
    Limit("i_trip_A", _CURRENTS, BOTH),
    Limit("test_current_A", _CURRENTS, BOTH, TEST),
    Limit("vdc_max_V", ("vdc_V",), (1,)),
    Limit("vdc_min_V", ("vdc_V",), (1,)),
    Limit("speed_trip_rpm", ("speed_rpm",), BOTH),
    Limit("flux_trip_Wb", _FLUX, BOTH),
    Limit("torque_limit_Nm", ("torque_ref_Nm",), BOTH),
    Limit("flux_min_Wb", ("flux_ref_Wb",), (1,)),
)


def of_board(parameters: Container[str], channels: Container[str]) -> list[Limit]:
    """The limits of a board that has these parameters and channels."""
    found = []
    for limit in LIMITS:
        there = tuple(name for name in limit.channels if name in channels)
        if limit.parameter in parameters and there:
            found.append(limit._replace(channels=there))
    return found
