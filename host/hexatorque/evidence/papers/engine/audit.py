"""Checks paper B's switching tables in a running drive: each period's state word is compared with
the word that the tables demand, computed from angles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .... import setups
from ....experiments import operating_points
from ....recording.recording import Recording
from . import geometry
from .figure import Verdict, claim, not_printed
from .job import Job

SPEED_RPM, LOAD_NM = 500.0, 0.3
KEPT = ("sector", "torque_level", "flux_level", "psi_alpha_Wb", "psi_beta_Wb", "psi_x_Wb",
        "psi_y_Wb", "flux_ref_Wb", "torque_ref_Nm", "torque_decided_Nm")  # fmt: skip


@dataclass
class Audit:
    """A run, one row per period. word: the word on the legs; wanted: the word by the tables and the
    rules of docs/schemes.md; hold: `flux_hold` replaces a zero vector; psi, psi_xy: the flux
    estimates on which the decision is based, Wb."""

    setup: setups.Setup
    recording: Recording
    word: np.ndarray
    wanted: np.ndarray
    hold: np.ndarray
    psi: np.ndarray
    psi_xy: np.ndarray

    def met(self, level: int, flux_up: int, sector: int, words: Iterable[int] = range(64)) -> int:
        """Periods in a cell of the switching table, with one of `words` on the legs."""
        rec = self.recording
        demand = (rec["torque_level"] == level) & (rec["flux_level"] == flux_up)
        return int(np.sum(demand & (rec["sector"] == sector) & np.isin(self.word, list(words))))

    @property
    def idle(self) -> np.ndarray:
        return self.recording["torque_level"] == 0

    @property
    def right(self) -> int:
        return int(np.sum(self.word == self.wanted))


def opposing(pair: tuple[int, int], psi_xy: complex) -> int:
    """The word of the pair whose x-y voltage opposes the x-y flux."""
    return min(pair, key=lambda word: (geometry.XY[word] * psi_xy.conjugate()).real)


def vector(scheme: str, level: int, angle_deg: int, psi_xy: complex) -> int:
    """The word towards `angle_deg` in alpha-beta."""
    large = geometry.word_along("L", angle_deg)
    if scheme == "dtc1":
        return large
    strong = geometry.word_along("S", angle_deg) if scheme == "dtc3" and abs(level) < 2 else large
    return opposing((strong, geometry.word_along("ML", angle_deg)), psi_xy)


def words_of(gates: np.ndarray) -> np.ndarray:
    """State word of each period, from its four samples of `plant.gates`. At the second sample the
    dead time is over, and a single-vector scheme holds the word from then on. If it does not, the
    result is -1."""
    legs = gates.astype(int).reshape(-1, 4)[:, 1:, None] >> 2 * np.arange(5, -1, -1) & 3
    words = legs @ (1 << np.arange(5, -1, -1))
    steady = (legs < 2).all(axis=(1, 2)) & (words == words[:, :1]).all(axis=1)
    return np.where(steady, words[:, 0], -1)


def audit(job: Job, scheme: str) -> Audit:
    """Runs a drive at light load that reverses and returns. Without latency the control step
    decides on the values that the telemetry shows for the same period, and its word is on the legs
    at once."""
    setup = setups.load("paper-b").changed(controller__scheme=scheme, timing__latency="none")
    part_s = 0.25 if job.quick else 1.0
    full = operating_points.transient(
        operating_points.Point(setup, SPEED_RPM, LOAD_NM),
        [(part_s, "speed_ref_rpm", -SPEED_RPM), (2 * part_s, "speed_ref_rpm", SPEED_RPM)],
        3 * part_s,
        job.progress,
    )
    word = words_of(full["plant.gates"])
    channels = {name: full[name][::4] for name in KEPT}
    rec = Recording(full.rate_Hz / 4, channels, full.units, full.meta)
    psi = rec["psi_alpha_Wb"].astype(float) + 1j * rec["psi_beta_Wb"]
    psi_xy = rec["psi_x_Wb"].astype(float) + 1j * rec["psi_y_Wb"]
    weak = abs(psi) < (1 - setup.parameter("flux_hold")) * rec["flux_ref_Wb"]
    hold = (rec["torque_level"] == 0) & weak
    wanted = _wanted(scheme, rec, word, hold, psi, psi_xy)
    rec.channels |= {"word": word, "word_by_table": wanted, "flux_hold": hold}
    # The first period's zero vector depends on a word before the recording.
    rec = rec.window(1 / rec.rate_Hz, full.duration_s)
    return Audit(setup, rec, word[1:], wanted[1:], hold[1:], psi[1:], psi_xy[1:])


def _wanted(
    scheme: str,
    rec: Recording,
    word: np.ndarray,
    hold: np.ndarray,
    psi: np.ndarray,
    psi_xy: np.ndarray,
) -> np.ndarray:
    level = rec["torque_level"].astype(int)
    away = np.where(rec["flux_level"] == 1, 75, 105) * np.sign(level)
    ahead = rec["torque_ref_Nm"] > rec["torque_decided_Nm"]
    away = np.where(hold, np.where(ahead, 15, -15), away)
    angle = (30 * geometry.sector(psi) + away) % 360
    wanted = np.empty(len(rec), int)
    for n in range(len(rec)):
        if level[n] == 0 and not hold[n]:
            wanted[n] = geometry.nearest_zero(int(word[n - 1]))
        else:
            wanted[n] = vector(scheme, level[n], int(angle[n]), complex(psi_xy[n]))
    return wanted


def verdicts(run: Audit) -> list[Verdict]:
    """The verdicts for a running drive."""
    name = run.setup["controller.scheme"].upper()
    total = len(run.word)
    sectors = int(np.sum(geometry.sector(run.psi) == run.recording["sector"]))
    levels = (-2, -1, 0, 1, 2) if name == "DTC3" else (-1, 0, 1)
    cells = [run.met(level, up, s) for level in levels for up in (0, 1) for s in range(12)]
    return [
        claim(f"{name} running: the table's vector is on the legs", run.right == total,
              f"{run.right} of {total} periods", "all", required=True),
        claim(f"{name} running: the sector is where the flux points", sectors == total,
              f"{sectors} of {total} periods", "all", required=True),
        not_printed(f"{name} running: cells of the table that were met",
                    f"{sum(n > 0 for n in cells)} of {len(cells)}"),
        not_printed(f"{name} running: zero vectors that flux_hold replaced",
                    f"{run.hold.sum()} of {run.idle.sum()}",
                    why="This rule is ours (docs/schemes.md); no paper has it. These periods are "
                        "checked against it."),
    ]  # fmt: skip
