"""Wrong parameters of the controller, 30 % up and down, each alone, on the bench at the machine's
last point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..papers.engine.job import Job
from . import search
from .methods import Method
from .places import Place

NAMES = ("sigma_ls_H", "lxy_H", "rs_ohm")
FACTORS = (0.7, 1.3)
CASES = tuple((name, factor) for name in NAMES for factor in FACTORS)
#: Largest deviation of the mean flux: a wrong resistance turns it, which is no loss of the drive.
FLUX_SHARE = 0.3


def run(
    case: tuple[str, float], method: Method, place: Place, row: Mapping[str, Any], job: Job
) -> dict[str, Any]:
    """The figures with a wrong parameter; `lost` if the drive does not hold the point, `refused`
    too if it does not accept the setting."""
    name, factor = case
    values = {**row, name: factor * place.base.parameter(name)}
    try:
        found = search.attempt(method, place, values, job, flux_share=FLUX_SHARE)
    except search.REFUSED as refused:
        return {"lost": "refused", "refused": str(refused)}
    return found or {"lost": "does not hold the point"}
