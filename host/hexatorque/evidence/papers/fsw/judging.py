"""One point: the best settings of the table schemes there, and what ours is beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import carrier
from .points import Place, setup_of
from .search import OURS, SLOW_HZ, best

#: The limit of the verdicts.
LIMIT_HZ = 3000.0


@dataclass(frozen=True)
class Target:
    """Ours over the best table setting: Td and THD∞ at most these. The table schemes are sampled at
    sampled_Hz at most."""

    variant: str
    td: float
    thd: float
    sampled_Hz: float


TARGETS = (
    Target(f"{OURS} κ=0", 0.8, 0.5, 1e9),
    Target(f"{OURS} κ=1", 0.7, 1.0, SLOW_HZ),
)


@dataclass(frozen=True)
class At:
    """One point. rows: variant -> its settings with which the drive holds the point."""

    place: Place
    rows: dict[str, list[dict]]

    @property
    def tables(self) -> dict[str, list[dict]]:
        return {name: rows for name, rows in self.rows.items() if not name.startswith(OURS)}

    def best_table(self, figure: str, sampled_Hz: float = 1e9) -> tuple[str, dict] | None:
        """The table scheme whose best setting within LIMIT_HZ is the lowest, and that setting."""
        found = [
            (name, row)
            for name, rows in self.tables.items()
            if (row := best(rows, figure, LIMIT_HZ, sampled_Hz))
        ]
        return min(found, key=lambda pair: pair[1][figure], default=None)

    def ratios(self, target: Target) -> dict | None:
        """The one setting of ours that comes nearest to both targets, and its ratios to the best
        table settings, which may be another one for each figure. None without such settings."""
        td = self.best_table("td_Nm", target.sampled_Hz)
        thd = self.best_table("thd_inf_pct", target.sampled_Hz)
        mine = [row for row in self.rows[target.variant] if row["f_sw_Hz"] <= LIMIT_HZ]
        if not (td and thd and mine):
            return None

        def of(row: dict) -> tuple[float, float]:
            return row["td_Nm"] / td[1]["td_Nm"], row["thd_inf_pct"] / thd[1]["thd_inf_pct"]

        row = min(mine, key=lambda row: max(of(row)[0] / target.td, of(row)[1] / target.thd))
        return {
            **row, "td_ratio": of(row)[0], "thd_ratio": of(row)[1],
            "td_against": td[0], "thd_against": thd[0],
        }  # fmt: skip

    def ratio(self, figure: str) -> float | None:
        """Our best setting of any variant over the best table setting."""
        table = self.best_table(figure)
        ours = [r for name, rows in self.rows.items() if name.startswith(OURS) for r in rows]
        mine = best(ours, figure, LIMIT_HZ)
        return mine[figure] / table[1][figure] if mine and table else None

    def line(self, f_sw_Hz: float) -> carrier.Ripple | None:
        """The analytic line, at the flux that the drive has. None beyond linear modulation."""
        fluxes = [row["flux_Wb"] for row in self.rows[TARGETS[0].variant]]
        if not fluxes:
            return None
        try:
            return carrier.ripple(
                setup_of(self.place), self.place, f_sw_Hz, float(np.median(fluxes))
            )
        except ValueError:
            return None
