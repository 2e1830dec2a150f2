"""The mean torque in torque mode: with `torque_mean_s` it is the reference, under a table too,
which keeps the torque on one side of it; and none of the limits and states is circumvented."""

import numpy as np
import pytest
from campaigns import part

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive

BASE = setups.load("small-2kw")
RATED_NM, RATED_RPM, MEAN_S = BASE["rated.torque_Nm"], BASE["rated.speed_rpm"], 0.5
#: Slow interrupts as often as a new set-up has them at most: a mean of 500 of them.
QUICK = {"controller__f_slow_Hz": 1000.0, "controller__torque_mean_s": MEAN_S}


def at_speed(scheme, share, torque_Nm=0.0, **changes):
    """A drive in torque mode; the load brakes it to this share of rated speed."""
    speed_rpm = share * RATED_RPM
    setup = BASE.with_scheme(
        scheme, load__kind="generator", load__at_rpm=speed_rpm, **{**QUICK, **changes}
    )
    sim = SimulatedDrive(setup, 1)
    sim.start()
    sim.run(float(setup.parameter("calibration_s")) + float(setup.parameter("build_s")) + 0.05)
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(1.0, record=False)
    sim.load_Nm = 1.2 * RATED_NM
    sim.set_many({"control_mode": "torque", "torque_ref_Nm": torque_Nm})
    return sim


def taken(sim, time_s):
    sim.discard()
    sim.run(time_s)
    sim.check()
    return sim.take()


def mean_Nm(sim, time_s=1.0):
    return float(np.mean(taken(sim, time_s)["plant.torque_Nm"]))


CASES = [
    (scheme, share, sign)
    for scheme in ("ddr", "dtc2", "fdr")
    for share in (0.05, 0.15, 0.3)
    for sign in (1, -1)
]


@pytest.mark.parametrize(("scheme", "share", "sign"), part(CASES, 6))
def test_the_mean_is_the_reference_within_a_hundredth_of_rated(scheme, share, sign):
    sim = at_speed(scheme, share, sign * 0.5 * RATED_NM)
    sim.run(6 * MEAN_S, record=False)
    assert mean_Nm(sim) == pytest.approx(sign * 0.5 * RATED_NM, abs=0.01 * RATED_NM)


def test_without_it_the_mean_is_off():
    sim = at_speed("ddr", 0.3, 0.5 * RATED_NM, controller__torque_mean_s=0.0)
    sim.run(1.0, record=False)
    assert mean_Nm(sim) < 0.47 * RATED_NM


@pytest.mark.parametrize("sign", [1, -1])
def test_a_step_of_the_reference_goes_no_further_than_without_it(sign):
    """But for the torque by which the reference is moved: it was learnt before, at less torque."""
    peaks = []
    for mean_s in (0.0, MEAN_S):
        sim = at_speed("ddr", 0.3, sign * 0.1 * RATED_NM, controller__torque_mean_s=mean_s)
        sim.run(3 * MEAN_S, record=False)
        moved_Nm = abs(sim.controller.drive.torque_more_Nm)
        sim.set("torque_ref_Nm", sign * 0.8 * RATED_NM)
        peaks.append(max(sign * taken(sim, 0.3)["plant.torque_Nm"]))
    band_Nm = float(sim.get("torque_band_Nm"))
    assert 0 < moved_Nm < band_Nm and peaks[1] < peaks[0] + band_Nm


@pytest.mark.parametrize("sign", [1, -1])
def test_the_torque_limit_is_not_exceeded(sign):
    """Nor does anything wind up at it: with less asked for, the mean is there at once."""
    limit_Nm = 0.6 * RATED_NM
    sim = at_speed("ddr", 0.15, sign * RATED_NM, controller__torque_limit_Nm=limit_Nm)
    sim.run(6 * MEAN_S)
    assert max(abs(sim.take()["torque_ref_Nm"])) == pytest.approx(limit_Nm, rel=1e-6)
    sim.set("torque_ref_Nm", sign * 0.4 * RATED_NM)
    sim.run(0.02, record=False)
    assert mean_Nm(sim, 0.3) == pytest.approx(sign * 0.4 * RATED_NM, abs=0.03 * RATED_NM)


@pytest.mark.parametrize("end", ["stop", "fault"])
def test_a_stop_and_a_fault_forget_it(end):
    sim = at_speed("ddr", 0.3, 0.5 * RATED_NM)
    sim.run(3 * MEAN_S, record=False)
    drive = sim.controller.drive
    assert drive.torque_more_Nm > 0.02 * RATED_NM
    if end == "fault":
        sim.set("i_trip_A", 2.0)
    else:
        sim.stop()
    sim.run(0.05, record=False)
    assert bool(sim.faults) == (end == "fault") and drive.torque_more_Nm == 0
