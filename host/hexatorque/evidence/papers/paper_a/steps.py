"""Paper A's transients: the same step under FDR and under DDR, and whether both responses agree."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ....analysis.response import moving_mean, step_response
from ....analysis.spectrum import low_pass
from ....experiments.operating_points import Point, approach, follow
from ....recording.recording import Recording
from ....setups import Setup
from ..engine.figure import Verdict, claim
from ..engine.job import Job
from . import common as a

#: Speed and torque are evaluated as means over two periods of the speed loop.
MEAN_S = 0.02
#: A signal has settled when it stays this close to its final value, as a share of the rated value.
SPEED_BAND, TORQUE_BAND = 0.01, 0.1
#: "Overlap": settling times differ by no more than this share, everything else by no more than this
#: share of the rated value.
ALIKE = 0.05
#: The instants of the step are this far apart: one period of the speed loop.
APART_S = 0.01


@dataclass(frozen=True)
class Step:
    """The drive is in steady state at a speed and a load. At `at_s`, `name` changes to `value`.
    Afterwards the speed should be `end_rpm` and the load `end_Nm`."""

    speed_rpm: float
    load_Nm: float
    name: str
    value: float
    at_s: float
    duration_s: float
    end_rpm: float
    end_Nm: float
    set_up: str = a.SETUP
    load: str = "constant"
    reached: bool = True  #: False if the voltage does not allow the speed before the step

    def setup(self, scheme: str) -> Setup:
        other = {} if self.load == "constant" else {"load__kind": self.load}
        return a.setup(scheme, self.set_up, **other)

    @property
    def reversal(self) -> bool:
        return self.name == "speed_ref_rpm"


def _record(job: Job, step: Step, scheme: str, late: int) -> Recording:
    """Records the step, `late` periods of the speed loop later than `at_s`. Time 0 is shifted by
    the same amount."""
    point = Point(step.setup(scheme), step.speed_rpm, step.load_Nm)
    begin = approach if step.reached else a.asked_for
    sim = begin(point, job.progress)
    sim.run(late * APART_S, record=False)
    return follow(sim, [(step.at_s, step.name, step.value)], step.duration_s, job.progress)


def _smooth(rec: Recording, name: str) -> np.ndarray:
    return moving_mean(rec[name], rec.rate_Hz, MEAN_S)


def response(step: Step, rec: Recording) -> dict[str, float]:
    """Settling times and extremes of speed and torque after the step.

    speed_beyond_rpm: the overshoot if the step is a reversal, else the largest deviation;
    torque_peak_Nm: the largest |torque|."""
    rated_rpm, rated_Nm = a.rated()
    speed = step_response(rec.time_s, _smooth(rec, "plant.speed_rpm"), step.at_s, step.end_rpm,
                          SPEED_BAND * rated_rpm)  # fmt: skip
    friction_Nm = step.setup("ddr")["machine.viscous_Nms"] * step.end_rpm * math.pi / 30
    torque_Nm = _smooth(rec, "plant.torque_Nm")
    torque = step_response(rec.time_s, torque_Nm, step.at_s, step.end_Nm + friction_Nm,
                           TORQUE_BAND * rated_Nm)  # fmt: skip
    return {
        "speed_settling_s": speed.settling_s,
        "speed_beyond_rpm": speed.overshoot if step.reversal else speed.deviation,
        "torque_settling_s": torque.settling_s,
        "torque_peak_Nm": float(np.abs(torque_Nm[rec.time_s >= step.at_s]).max()),
        "xy_rms_A": a.rms(*(low_pass(rec[n], rec.rate_Hz, a.LOW_PASS_HZ)
                            for n in ("plant.i_x_A", "plant.i_y_A"))),
    }  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """FDR and DDR after the same step: mean figures, mean curves, and one recording of each."""

    step: Step
    figures: dict[str, dict[str, float]]
    curves: dict[str, dict[str, np.ndarray]]
    recordings: dict[str, Recording]

    def apart(self, name: str) -> float:
        """Largest distance between the mean curves of FDR and DDR."""
        fdr, ddr = (self.curves[s][name] for s in a.SCHEMES)
        return float(np.abs(fdr - ddr).max())


def pairs(job: Job, steps: Iterable[Step], count: int) -> list[Pair]:
    """Runs every step under both schemes, at `count` instants each."""
    steps = list(steps)
    keys = [(step, s, late) for step in steps for s in a.SCHEMES for late in range(count)]

    def one(key: tuple[Step, str, int]) -> tuple[dict, dict, Recording | None]:
        step, scheme, late = key
        rec = _record(job, step, scheme, late)
        curves = {name: _smooth(rec, name) for name in ("plant.speed_rpm", "plant.torque_Nm")}
        return response(step, rec), curves, rec if late == 0 else None

    found = dict(zip(keys, job.each(one, keys)))
    made = []
    for step in steps:
        parts = {s: [found[step, s, late] for late in range(count)] for s in a.SCHEMES}
        made.append(
            Pair(
                step,
                {s: _mean([f for f, _, _ in parts[s]]) for s in a.SCHEMES},
                {s: _mean([c for _, c, _ in parts[s]]) for s in a.SCHEMES},
                {s: _recording(parts[s][0][2]) for s in a.SCHEMES},
            )
        )
    return made


def _recording(rec: Recording | None) -> Recording:
    assert rec is not None  # the recording of the first instant is kept
    return rec


def _mean(rows: list[dict]) -> dict:
    mean = {key: np.mean([row[key] for row in rows], axis=0) for key in rows[0]}
    return {key: float(m) if m.ndim == 0 else m for key, m in mean.items()}


def verdicts(pair: Pair, what: str = "") -> list[Verdict]:
    """The verdicts: speed and torque respond alike, and DDR keeps the x-y current low during the
    step."""
    rated_rpm, rated_Nm = a.rated()
    fdr, ddr = (pair.figures[s] for s in a.SCHEMES)
    beyond = "overshoot" if pair.step.reversal else "deviation"
    rows = [
        claim(f"{what}settling time of {name}, within {ALIKE:.0%}",
              abs(ddr[key] / fdr[key] - 1) <= ALIKE,
              a.arrow(1e3 * fdr[key], 1e3 * ddr[key], "ms", 1), "same", required=True)
        for name, key in (("speed", "speed_settling_s"), ("torque", "torque_settling_s"))
    ]  # fmt: skip
    rows += [
        claim(f"{what}{name}, within {ALIKE:.0%} of rated",
              abs(ddr[key] - fdr[key]) <= ALIKE * rated,
              a.arrow(fdr[key], ddr[key], unit, 2), "same", required=True)
        for name, key, unit, rated in (
            (f"{beyond} of speed", "speed_beyond_rpm", "r/min", rated_rpm),
            ("peak of torque", "torque_peak_Nm", "N m", rated_Nm),
        )
    ]  # fmt: skip
    rows += overlap(pair, what, required=True)
    rows.append(
        claim(f"{what}x–y current below 1 kHz lower with DDR, rms",
              ddr["xy_rms_A"] < fdr["xy_rms_A"], a.milli(fdr["xy_rms_A"], ddr["xy_rms_A"]),
              "compensated", required=True)
    )  # fmt: skip
    return rows


def overlap(pair: Pair, what: str, required: bool = False) -> list[Verdict]:
    """The verdicts on the whole curves of speed and torque."""
    rows = []
    for name, unit, rated in zip(("speed", "torque"), ("r/min", "N m"), a.rated()):
        apart = pair.apart(f"plant.{name}_{'rpm' if name == 'speed' else 'Nm'}")
        rows.append(
            claim(f"{what}curves of {name} overlap within {ALIKE:.0%} of rated",
                  apart <= ALIKE * rated, f"{apart:.2f} {unit} apart at most", "overlap",
                  required=required)
        )  # fmt: skip
    return rows
