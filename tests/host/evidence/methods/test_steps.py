"""Rise and overshoot against signals whose answer is known, torque steps in the closed loop, and
wrong parameters."""

import math

import numpy as np
import pytest

from hexatorque.evidence.methods import errors, steps
from hexatorque.evidence.methods.methods import methods
from hexatorque.evidence.methods.places import MACHINES
from hexatorque.evidence.papers.engine.job import Job
from hexatorque.recording.recording import Recording

BY_NAME = {method.name: method for method in methods()}

RATE_HZ = 40e3


def test_rise_of_a_ramp_is_0_8_of_its_length():
    time_s = np.arange(0, 10e-3, 1 / RATE_HZ)
    ramp = np.clip((time_s - 2e-3) / 5e-3, 0, 1)
    for before, after in ((2.0, 10.0), (10.0, -10.0)):
        torque = before + (after - before) * ramp
        rise_s, beyond = steps.rise(time_s, torque, before, after)
        assert rise_s == pytest.approx(4e-3, rel=1e-6)
        assert beyond == pytest.approx(0, abs=1e-12)


def test_rise_and_overshoot_of_a_second_order_system():
    """Damping 0.5: the overshoot is exp(-pi/sqrt(3)) = 16.3 %."""
    time_s = np.arange(0, 20e-3, 1 / RATE_HZ)
    w = 2000.0
    wd = w * np.sqrt(0.75)
    y = 1 - np.exp(-0.5 * w * time_s) * (np.cos(wd * time_s) + np.sin(wd * time_s) / np.sqrt(3))
    rise_s, beyond = steps.rise(time_s, 3 * y - 1, -1.0, 2.0)
    assert beyond == pytest.approx(np.exp(-np.pi / np.sqrt(3)), rel=1e-3)
    crossings = [time_s[np.argmax(y >= level)] for level in (0.1, 0.9)]
    assert rise_s == pytest.approx(crossings[1] - crossings[0], abs=1 / RATE_HZ)


def test_ripple_before_the_step_is_no_crossing():
    """The last crossing of 10 % counts, not one of the ripple."""
    time_s = np.arange(0, 10e-3, 1 / RATE_HZ)
    torque = np.clip((time_s - 4e-3) / 2e-3, 0, 1)
    torque[40] = 0.3
    assert steps.rise(time_s, torque, 0.0, 1.0)[0] == pytest.approx(1.6e-3, rel=1e-6)


def test_a_torque_that_never_comes_has_no_rise():
    time_s = np.arange(0, 10e-3, 1 / RATE_HZ)
    assert np.isnan(steps.rise(time_s, 0.8 * (time_s > 1e-3), 0.0, 1.0)[0])


def stepped(answer, down_s):
    """Steps of 2 N m, answered by this share of them: up by a ramp of 1 ms, down by another."""
    time_s = np.arange(0, 0.2, 1 / RATE_HZ)
    reference, torque = np.ones_like(time_s), np.ones_like(time_s)
    for begin, end in ((0.02, 0.06), (0.1, 0.14)):
        reference[(time_s >= begin) & (time_s < end)] = 3.0
        torque += 2 * answer * np.clip((time_s - begin) / 1e-3, 0, 1)
        torque -= 2 * answer * np.clip((time_s - end) / down_s, 0, 1)
    channels = {"torque_ref_Nm": reference, "plant.torque_Nm": torque}
    return Recording(RATE_HZ, channels, dict.fromkeys(channels, "N m"), {"samples_per_period": 4})


@pytest.mark.parametrize(
    ("answer", "down_s", "down_ms"),
    [
        pytest.param(1.0, 2e-3, 1.6, id="each way has its own mean"),
        # 90 % of the reference's step would never come.
        pytest.param(0.8, 1e-3, 0.8, id="a torque that stays below rises to its own mean"),
    ],
)
def test_steps_are_found_in_the_reference(answer, down_s, down_ms):
    found = steps.rises(stepped(answer, down_s))
    assert found["rise_up_ms"] == pytest.approx(0.8, rel=1e-3)
    assert found["rise_down_ms"] == pytest.approx(down_ms, rel=1e-3)


def test_a_torque_step_of_field_orientation_is_answered_as_its_tuning_says(tmp_path):
    """Without a limit of the voltage the answer is 1 - (1 - a)^k, a = 0.3: from 10 to 90 % in
    about six periods, here of a tenth of a millisecond."""
    place = MACHINES[0].places[0]  # low speed: the voltage does not limit
    row = BY_NAME["foc"].values(place.base, np.array([math.log(5) / math.log(9)]))
    assert row["f_isr_Hz"] == pytest.approx(10e3, rel=0.01)
    found = steps.run("torque step", BY_NAME["foc"], place, row, Job(True, tmp_path))
    for key in ("rise_up_ms", "rise_down_ms"):
        assert 0.4 < found[key] < 0.9
    assert found["overshoot_pct"] < 15


def test_a_wrong_parameter_is_that_of_the_controller(replaced, tmp_path):
    place, method = MACHINES[1].place, BY_NAME["fcs-mpc"]
    seen = replaced(lambda *case: None)
    row = method.values(place.base, np.full(3, 0.5))
    for case in errors.CASES:
        assert "lost" in errors.run(case, method, place, row, Job(True, tmp_path))
    assert [values["rs_ohm"] / place.base.parameter("rs_ohm") for _, values, _ in seen[-2:]] == (
        pytest.approx([0.7, 1.3])
    )
    assert {named["flux_share"] for *_, named in seen} == {errors.FLUX_SHARE}
    assert all("weight_xy" not in values for _, values, _ in seen)


def test_a_wrong_parameter_that_the_firmware_refuses_is_called_so(tmp_path):
    """At 7.8 kHz the small machine has six samples in L_xy / R_s. With R_s 30 % too large the
    firmware sees less than five."""
    base = MACHINES[2].place.base
    row = BY_NAME["foc"].values(base, np.full(1, 0.62))
    assert 5 < row["f_isr_Hz"] * base["machine.lxy_H"] / base["machine.rs_ohm"] < 6.5
    case = (("rs_ohm", 1.3), BY_NAME["foc"], MACHINES[2].place, row, Job(True, tmp_path))
    found = errors.run(*case)
    assert found["lost"] == "refused" and "f_isr_Hz" in found["refused"]
