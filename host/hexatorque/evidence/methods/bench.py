"""One setting on a test bench: a second machine holds the speed, the drive makes the torque.

So nothing waits for a speed loop, and a setting costs about a second of simulated time. The drive
starts at standstill, builds its flux, and follows the speed up to the point; then the torque
reference is corrected twice until the mean torque is the one that was asked for. The bench holds
the speed by its inertia: from the change of speed, the mean torque follows exactly.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ... import firmware, laws
from ...analysis.losses import bridge, copper_loss_W
from ...analysis.metrics import i_xy_A, torque_ripple_td_Nm
from ...analysis.spectrum import channel, fundamental_Hz, thd_inf_pct
from ...drive.interface import Progress
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import MOST_EDGES, NOT_MEASURED
from ...experiments.prepare import magnetise
from ...laws.law import Law
from ...plant.edges import Edges
from ...plant.vsd import PHASES
from ...recording.recording import Recording
from ...setups import Setup
from .methods import SAMPLES
from .places import Place

INERTIA_KGM2 = 1e3
CALIBRATION_S, BUILD_S = 0.005, 0.15
RAMP_S, STEPS = 0.1, 40
#: Before each correction of the torque reference, and the time over which the mean is taken.
SETTLE_S, MEAN_S = 0.08, 0.06
CORRECTIONS = 2
#: The recording lasts at least this long and this many cycles of the fundamental. With four, the
#: second harmonic is outside the bins that count as fundamental.
WINDOW_S, CYCLES = 0.2, 4
#: Deviations at which the drive does not hold the point: torque relative to the point's and to the
#: set-up's; mean flux relative to its reference.
TORQUE_SHARES, FLUX_SHARE = (0.02, 0.01), 0.06
#: A 600 V, 20 A module, as data sheets state it. The drops do not act on the currents here: they
#: would differ little between the schemes, and compensation would come into the comparison.
DEVICE = {"v_switch_V": 1.0, "r_switch_ohm": 0.025, "v_diode_V": 0.9, "r_diode_ohm": 0.02}
ENERGIES = {"e_on_mJ": 0.6, "e_off_mJ": 0.6, "e_ref_V": 300.0, "e_ref_A": 20.0}


def bench_setup(
    setup: Setup, scheme: str, values: dict[str, Any], build_s: float = BUILD_S
) -> Setup:
    """The set-up on the bench, with a setting of the controller. All schemes predict."""
    controller = {f"controller__{name}": value for name, value in values.items()}
    energies = {f"inverter__{name}": value for name, value in ENERGIES.items()}
    return setup.changed(
        controller__scheme=scheme,
        timing__latency="predicted",
        controller__control_mode="torque",
        controller__calibration_s=CALIBRATION_S,
        controller__build_s=build_s,
        machine__inertia_kgm2=INERTIA_KGM2,
        machine__viscous_Nms=0.0,
        load__kind="constant",
        **controller,
        **energies,
    )


def approach(
    setup: Setup, place: Place, progress: Progress | None = None, law: Law | None = None
) -> SimulatedDrive:
    """A drive in steady state at the point, under a law in place of the scheme if one is given.
    Raises DriveFault."""
    sim = SimulatedDrive(setup, SAMPLES, laws.controller_of(law) if law else firmware.Controller)
    speed_rad_s = place.speed_rpm * math.pi / 30
    magnetise(sim, 0.01, progress)
    sim.check()
    torque_Nm = math.copysign(1.0, place.speed_rpm) * place.torque_Nm
    reference_Nm = torque_Nm
    sim.set("torque_ref_Nm", reference_Nm)
    for step in range(1, STEPS + 1):
        sim.plant_state[6] = speed_rad_s * step / STEPS
        sim.run(RAMP_S / STEPS, record=False, progress=progress)
    for _ in range(CORRECTIONS):
        sim.run(SETTLE_S, record=False, progress=progress)
        sim.check()
        sim.plant_state[6], begun_s = speed_rad_s, sim.time_s
        sim.run(MEAN_S, record=False, progress=progress)
        gained_rad_s = sim.plant_state[6] - speed_rad_s
        mean_Nm = INERTIA_KGM2 * gained_rad_s / (sim.time_s - begun_s)
        reference_Nm += torque_Nm - mean_Nm
        sim.set("torque_ref_Nm", float(reference_Nm))
    sim.run(SETTLE_S, record=False, progress=progress)
    sim.check()
    return sim


def figures(rec: Recording, edges: Edges, modules: int = 1) -> dict[str, float]:
    """The compared figures. loss_W: stator copper, conduction and switching. modules: of DEVICE in
    parallel, for the currents of a large machine; the switching losses are the same."""
    phases_A = np.stack([channel(rec, f"i_{phase}_A") for phase in PHASES])
    i_x, i_y = i_xy_A(rec)
    parameters = rec.meta["parameters"]
    shared = {name: DEVICE[name] / modules for name in ("r_switch_ohm", "r_diode_ohm")}
    with_device = {**parameters, "inverter": parameters["inverter"] | DEVICE | shared}
    lost = bridge(replace(rec, meta={**rec.meta, "parameters": with_device}), edges)
    copper_W = copper_loss_W(rec)
    return {
        "f_sw_Hz": rec.meta["f_sw_Hz"],
        "td_Nm": torque_ripple_td_Nm(rec),
        "thd_inf_pct": thd_inf_pct(phases_A, rec.rate_Hz, abs(fundamental_Hz(rec))),
        "ixy_rms_A": float(np.sqrt(np.mean(i_x**2 + i_y**2))),
        "loss_W": copper_W + lost["conduction_loss_W"] + lost["switching_loss_W"],
        "copper_loss_W": copper_W,
        "conduction_loss_W": lost["conduction_loss_W"],
        "switching_loss_W": lost["switching_loss_W"],
        "idc_ripple_A": lost["idc_ripple_A"],
        "torque_Nm": float(np.mean(channel(rec, "torque_Nm"))),
        "flux_Wb": float(np.mean(np.hypot(rec["plant.psi_alpha_Wb"], rec["plant.psi_beta_Wb"]))),
    }


def measure(
    scheme: str,
    values: dict[str, Any],
    place: Place,
    progress: Progress | None = None,
    window_s: float = WINDOW_S,
    law: Law | None = None,
    build_s: float = BUILD_S,
    flux_share: float = FLUX_SHARE,
) -> dict[str, float] | None:
    """The figures of one setting, of the scheme or of a law in its place. None if the drive does
    not hold the point, or trips. build_s: time for the flux; a large machine needs more.
    flux_share: largest deviation of the mean flux."""
    base = place.base
    setup = bench_setup(base, scheme, values, build_s)
    try:
        sim = approach(setup, place, progress, law)
        omega_rad_s = abs(sim.controller.channel("omega_sync_rad_s"))
        cycle_s = 2 * math.pi / max(omega_rad_s, 1.0)
        cycles = max(CYCLES, math.ceil(window_s / cycle_s))
        sim.log_edges(round(cycles * cycle_s / sim.period_s + 100) * MOST_EDGES)
        start, begin = sim.inverter.leg.copy(), sim.periods
        sim.run((cycles + 0.02) * cycle_s, progress=progress)
        sim.check()
        found = figures(sim.take(), sim.edges_since(begin, start), place.modules)
    except NOT_MEASURED:
        return None
    flux_ref_Wb = sim.controller.channel("flux_ref_Wb")
    relative, of_rated = TORQUE_SHARES
    allowed_Nm = relative * abs(place.torque_Nm) + of_rated * base["point.load_Nm"]
    wanted_Nm = math.copysign(1.0, place.speed_rpm) * place.torque_Nm
    if abs(found["torque_Nm"] - wanted_Nm) > allowed_Nm:
        return None
    if abs(found["flux_Wb"] / flux_ref_Wb - 1) > flux_share:
        return None
    if not all(math.isfinite(value) for value in found.values()):
        return None
    return found
