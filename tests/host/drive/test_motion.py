"""Ramps, stops, and limits of torque and power of their own, on the simulated drive: against the
kinematics of the shaft."""

import math

import numpy as np
import pytest

from hexatorque import SetupError, SimulatedDrive, firmware, load

RAD_S = math.pi / 30
SCHEMES = ("ddr", "dtc3", "db-dtfc", "foc")


def running(setup="paper-b", speed_rpm=1000.0, scheme="db-dtfc", **parameters):
    """A drive that has settled at this speed."""
    base = load(setup).changed(
        controller__scheme=scheme, timing__latency="predicted", controller__stop_s=30.0
    )
    sim = SimulatedDrive(base, samples_per_period=1)
    sim.start()
    sim.set("speed_ref_rpm", speed_rpm)
    sim.run(2.0, record=False)
    assert abs(sim.speed_rpm - speed_rpm) < 20.0, sim.faults
    sim.set_many(parameters)
    sim.run(0.01)
    sim.take()
    return sim


def after(sim, seconds, **changes):
    """The recording of the `seconds` after a change, its time from there."""
    sim.set_many(changes)
    sim.run(seconds)
    return sim.take()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_speed_follows_its_ramp(scheme):
    """Up at 800 r/min/s, down at 400 r/min/s, through 0 with both."""
    sim = running(speed_rpm=400.0, scheme=scheme, ramp_up_rpm_s=800.0, ramp_down_rpm_s=400.0)
    for target, seconds in ((1200.0, 1.0), (-400.0, 3.0 + 0.5)):
        before = sim.speed_rpm
        rows = after(sim, seconds + 0.5, speed_ref_rpm=target)
        time_s = rows.time_s - rows.time_s[0]
        if target > before:
            wanted = np.minimum(before + 800.0 * time_s, target)
        else:
            down_s = before / 400.0
            wanted = np.maximum(before - 400.0 * time_s, 0.0)
            wanted -= np.clip(800.0 * (time_s - down_s), 0.0, -target)
        # The regulator's lag, and what follows of the corner.
        assert np.abs(rows["speed_rpm"] - wanted).max() < 60.0
        assert sim.speed_rpm == pytest.approx(target, abs=25.0)
        assert not sim.faults


def test_a_ramp_of_less_jerk_takes_the_torque_slowly():
    """800 r/min/s reached in 0.4 s: the torque at the ramp's start rises as slowly."""
    steep = running(ramp_up_rpm_s=800.0)
    soft = running(ramp_up_rpm_s=800.0, ramp_jerk_rpm_s2=2000.0)
    begun = [
        float(np.mean(after(sim, 0.1, speed_ref_rpm=1800.0)["torque_Nm"][-200:]))
        for sim in (steep, soft)
    ]
    steady = [float(np.mean(after(sim, 0.3)["torque_Nm"][-200:])) for sim in (steep, soft)]
    assert begun[1] < 0.6 * begun[0]
    assert steady[1] == pytest.approx(steady[0], rel=0.35)


def test_the_ramp_waits_while_the_torque_is_limited():
    """The drive cannot follow a ramp that asks for more than the torque limit gives: the reference
    does not run away, and there is no overshoot when the speed arrives."""
    sim = running("paper-a-feasible", 200.0, ramp_up_rpm_s=20000.0, torque_limit_Nm=3.0)
    rows = after(sim, 4.0, speed_ref_rpm=1000.0)
    acts = np.asarray(rows["limits"]).astype(int)
    assert ((acts & firmware.lib.HT_LIMIT_TORQUE) > 0).mean() > 0.1
    waits = (acts & firmware.lib.HT_LIMIT_RAMP) > 0  # because another one acts, and it is told
    assert waits.any() and waits.sum() < (acts > 0).sum()
    assert rows["speed_rpm"].max() < 1000.0 + 25.0
    ramp_rpm = sim.controller.drive.ramp.speed_rpm
    assert ramp_rpm == 1000.0


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("motion", ("stop", "quick-stop"))
@pytest.mark.parametrize("control_mode", ("speed", "torque"))
def test_a_stop_comes_to_a_standstill_and_switches_off(scheme, motion, control_mode):
    sim = running(scheme=scheme, ramp_down_rpm_s=500.0, quick_stop_rpm_s=2000.0)
    sim.set("control_mode", control_mode)
    rows = after(sim, 3.0, motion=motion)
    assert sim.state == firmware.IDLE and not sim.faults
    on = np.asarray(rows["state"]) == firmware.STATES.index(firmware.RUN)
    took_s = float(rows.time_s[on][-1] - rows.time_s[0])
    rate = 500.0 if motion == "stop" else 2000.0
    assert took_s == pytest.approx(1000.0 / rate, abs=0.25)
    assert abs(rows["speed_rpm"][on][-1]) < 60.0
    with pytest.raises(firmware.FirmwareError, match="motion"):
        sim.start()
    sim.set("motion", "follow")
    sim.run(0.5)
    sim.start()


def test_a_stop_that_cannot_be_held_ends_in_coasting():
    """The load drives the shaft on, more than the torque limit holds."""
    sim = running(ramp_down_rpm_s=8000.0, stop_s=1.0, torque_limit_Nm=1.0)
    rows = after(sim, 1.5, motion="stop", load_Nm=-2.0)
    on = np.asarray(rows["state"]) == firmware.STATES.index(firmware.RUN)
    assert float(rows.time_s[on][-1] - rows.time_s[0]) == pytest.approx(1.0, abs=0.03)
    assert sim.state == firmware.IDLE and not sim.faults


def test_a_stop_that_is_taken_back_goes_on_from_the_measured_speed():
    sim = running(ramp_down_rpm_s=500.0, ramp_up_rpm_s=500.0)
    after(sim, 1.0, motion="stop")
    before = sim.speed_rpm
    assert 300.0 < before < 700.0
    rows = after(sim, 2.0, motion="follow")
    assert np.min(rows["speed_rpm"]) > before - 60.0
    assert sim.speed_rpm == pytest.approx(1000.0, abs=25.0) and sim.state == firmware.RUN


def _mean(rows, name):
    return float(np.mean(rows[name]))


@pytest.mark.parametrize("control_mode", ("speed", "torque"))
def test_each_sign_of_the_torque_has_its_limit(control_mode):
    sim = running(torque_limit_Nm=4.0, torque_negative_Nm=1.5)
    if control_mode == "torque":
        rows = after(sim, 0.05, control_mode="torque", torque_ref_Nm=-4.0)
    else:
        rows = after(sim, 0.05, speed_ref_rpm=-1000.0)
    late = np.asarray(rows["torque_ref_Nm"])[200:]
    assert late == pytest.approx(-1.5, abs=1e-6)
    assert (np.asarray(rows["limits"])[200:] == firmware.lib.HT_LIMIT_TORQUE).all()
    rows = after(sim, 0.05, control_mode="torque", torque_ref_Nm=9.0)
    assert np.asarray(rows["torque_ref_Nm"])[200:] == pytest.approx(4.0, abs=1e-6)


@pytest.mark.parametrize("sign", (1, -1))
def test_the_power_at_the_shaft_stays_below_its_limit(sign):
    """Driving and braking. The torque limit alone would allow three times as much."""
    sim = running(power_limit_W=150.0, control_mode="torque", torque_ref_Nm=0.0)
    for asked in (4.0, -4.0):
        rows = after(sim, 0.1, torque_ref_Nm=sign * asked)
        size_rpm = np.abs(rows["speed_rpm"])
        known_rpm = np.minimum(size_rpm[200:], size_rpm[100:-100])  # by the slow loop, a period ago
        power_W = np.abs(rows["torque_ref_Nm"])[200:] * known_rpm * RAD_S
        assert power_W.max() < 1.001 * 150.0
        assert power_W[:-1].mean() > 0.9 * 150.0
        assert (np.asarray(rows["limits"])[200:] == firmware.lib.HT_LIMIT_POWER).all()


@pytest.mark.parametrize(("negative_Nm", "braking_Nm"), ((0.0, None), (0.1, -0.1)))
def test_braking_to_hold_the_link_keeps_to_the_negative_limit(negative_Nm, braking_Nm):
    """While the source is away the drive brakes with what its losses take, 0.2 N m, unless the
    limit is below that."""
    setup = load("paper-b").changed(
        inverter__link_F=2e-3, inverter__source_ohm=0.5, controller__link_F=2e-3,
        controller__vdc_low_V=240.0, controller__vdc_band_V=10.0, controller__vdc_min_V=200.0,
        controller__torque_negative_Nm=negative_Nm, controller__scheme="db-dtfc",
        timing__latency="predicted",
    )  # fmt: skip
    sim = SimulatedDrive(setup, samples_per_period=1)
    sim.start()
    sim.set("speed_ref_rpm", 2000.0)
    sim.run(2.0, record=False)
    sim.vdc_V = 0.0
    sim.run(0.95)
    assert not sim.faults
    assert int(sim.take()["limits"][-1]) & firmware.lib.HT_LIMIT_VDC_LOW
    now_Nm = getattr(sim.controller.drive, "in").torque_ref_Nm
    if braking_Nm is None:
        assert now_Nm < -0.15
    else:
        assert now_Nm == pytest.approx(braking_Nm, rel=1e-6)


@pytest.mark.parametrize(
    ("given", "least"),
    (
        ({"ramp_down_rpm_s": 100.0}, 1 / 100),
        ({"quick_stop_rpm_s": 100.0}, 1 / 100),
        ({"ramp_down_rpm_s": 500.0, "ramp_jerk_rpm_s2": 50.0}, 1 / 500),
    ),
)
def test_a_deadline_that_the_ramp_cannot_hold_is_refused_with_the_least(given, least):
    base = load("paper-b")
    parameters = {f"controller__{name}": value for name, value in given.items()}
    least_s = least * base["controller.speed_trip_rpm"]
    if jerk := given.get("ramp_jerk_rpm_s2"):
        least_s += given["ramp_down_rpm_s"] / jerk
    with pytest.raises(SetupError, match=f"stop_s.*allowed is {least_s:.4g} s and more"):
        base.changed(**parameters, controller__stop_s=0.99 * least_s)
    base.changed(**parameters, controller__stop_s=1.001 * least_s)
