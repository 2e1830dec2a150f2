"""The energies of a drive cycle: the switched drive follows the cycle, and its energies are added.

The speed loop follows the cycle's speed, while the load takes its torque. The torque of the
rotor's own inertia comes on top, and shaft_Wh has it, too.

drawn_Wh, returned_Wh: from and to the dc link, switching losses included; shaft_Wh: the net energy
that the shaft has given; loss_Wh: the difference; copper_loss_Wh: of the stator;
conduction_loss_Wh, switching_loss_Wh: of the inverter; efficiency_pct: the output of both ends over
the input of both ends; f_sw_Hz: mean; speed_error_rpm: root of the mean square.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..analysis.losses import balance, bridge, copper_loss_W
from ..analysis.spectrum import channel
from ..drive.simulated import SimulatedDrive
from ..experiments.operating_points import MOST_EDGES, Point, approach
from ..setups import Setup
from .cycle import STEP_S, Cycle

#: Steps of a window. What flows in and what flows back is told apart by window.
STEPS = 10
JOULES_A_WH = 3600.0


def figures(setup: Setup, cycle: Cycle, look: Callable[[float], None]) -> dict[str, float]:
    """The drive's figures over the cycle, as in UNITS; NaN where the set-up has no data. The drive
    has settled at the cycle's first row before it begins."""
    setup = setup.changed(load__kind="constant")
    speed_rpm, torque_Nm = cycle.over(setup)
    way = -1.0 if speed_rpm[0] < 0 else 1.0
    sim = approach(Point(setup, float(speed_rpm[0]), way * float(torque_Nm[0])), look)
    steps = round(cycle.duration_s / STEP_S)
    middle_s = STEP_S * (np.arange(steps) + 0.5)
    references = np.interp(middle_s, cycle.time_s, speed_rpm)
    loads = np.interp(middle_s, cycle.time_s, torque_Nm)
    begun = sim.periods
    windows = []
    for first in range(0, steps, STEPS):
        period, legs = sim.periods, sim.inverter.leg.copy()
        sim.log_edges(math.ceil(STEPS * STEP_S / sim.period_s + 1) * MOST_EDGES)
        for step in range(first, min(first + STEPS, steps)):
            sim.set_many({"speed_ref_rpm": references[step], "load_Nm": loads[step]})
            sim.run((step + 1) * STEP_S - (sim.periods - begun) * sim.period_s, progress=look)
        sim.check()
        windows.append(
            _window(sim, period, legs, (period - begun) * sim.period_s, cycle, speed_rpm)
        )
    return _total(np.array(windows))


def _window(
    sim: SimulatedDrive,
    period: int,
    legs: np.ndarray,
    from_s: float,
    cycle: Cycle,
    speed_rpm: np.ndarray,
) -> list[float]:
    """Length of a window and mean values in it, from what has been recorded since `period`."""
    rec = sim.take()
    at_s = from_s + np.arange(len(rec)) / rec.rate_Hz
    error_rpm = channel(rec, "speed_rpm") - np.interp(at_s, cycle.time_s, speed_rpm)
    inverter = bridge(rec, sim.edges_since(period, legs))
    power = balance(rec, inverter)
    return [
        len(rec) / rec.rate_Hz,
        power["input_W"],
        power["shaft_W"],
        copper_loss_W(rec),
        inverter["conduction_loss_W"],
        inverter["switching_loss_W"],
        rec.meta["f_sw_Hz"],
        float(np.mean(error_rpm**2)),
    ]


def _total(windows: np.ndarray) -> dict[str, float]:
    length_s, input_W, shaft_W, copper_W, conduction_W, switching_W, f_sw_Hz, square = windows.T

    def energy_Wh(power_W: np.ndarray) -> float:
        return float(length_s @ power_W) / JOULES_A_WH

    drawn_Wh, returned_Wh = energy_Wh(np.maximum(input_W, 0)), energy_Wh(np.maximum(-input_W, 0))
    motored_Wh, braked_Wh = energy_Wh(np.maximum(shaft_W, 0)), energy_Wh(np.maximum(-shaft_W, 0))
    gone_in = drawn_Wh + braked_Wh
    return {
        "drawn_Wh": drawn_Wh,
        "returned_Wh": returned_Wh,
        "shaft_Wh": motored_Wh - braked_Wh,
        "loss_Wh": drawn_Wh - returned_Wh - (motored_Wh - braked_Wh),
        "copper_loss_Wh": energy_Wh(copper_W),
        "conduction_loss_Wh": energy_Wh(conduction_W),
        "switching_loss_Wh": energy_Wh(switching_W),
        "efficiency_pct": 100 * (motored_Wh + returned_Wh) / gone_in if gone_in else math.nan,
        "f_sw_Hz": float(length_s @ f_sw_Hz / length_s.sum()),
        "speed_error_rpm": math.sqrt(float(length_s @ square / length_s.sum())),
    }
