"""Relay, brake and fan: the order of what they do, step by step."""

import numpy as np
import pytest

from hexatorque.firmware import Controller, FirmwareError, ffi, lib

SLOW_HZ = 100.0
RELAY, BRAKE, FAN = lib.HT_OUT_PRECHARGE, lib.HT_OUT_BRAKE, lib.HT_OUT_FAN


@pytest.fixture
def make():
    kept = []

    def made(**values):
        kept.append(Controller("f28377s", values))
        state = ffi.new("ht_outputs_state *")
        lib.ht_outputs_reset(state)
        return ffi.addressof(kept[-1].drive.config.outputs), state

    return made


def step(cfg, st, vdc_V=0.0, works=False):
    st.on = lib.ht_outputs_step(cfg, st, vdc_V, works)
    return st.on


@pytest.mark.parametrize("rc_s", (0.005, 0.1, 0.5, 1.0))
@pytest.mark.parametrize("source_V", (250.0, 320.0))
def test_the_relay_bridges_a_resistor_that_has_charged_the_link(make, rc_s, source_V):
    """What the closing relay then carries is at most a tenth of the inrush without a resistor."""
    cfg, st = make(precharge_V=240.0)
    time_s, v, closed_s = 0.0, 0.0, None
    while time_s < 12 * rc_s + 2:
        v = source_V * (1 - np.exp(-time_s / rc_s))
        if step(cfg, st, v) and closed_s is None:
            closed_s = time_s
            assert v > 0.9 * source_V, v
            assert not lib.ht_outputs_charged(cfg, st), "the relay still closes"
        if lib.ht_outputs_charged(cfg, st):
            break
        time_s += 1 / SLOW_HZ
    assert closed_s and 0.09 < time_s - closed_s < 0.13


def test_the_relay_opens_when_the_link_has_gone_and_waits_for_the_next_charge(make):
    cfg, st = make(precharge_V=240.0, vdc_min_V=150.0)
    for _ in range(100):
        step(cfg, st, 300.0)
    assert st.on == RELAY and lib.ht_outputs_charged(cfg, st)
    for vdc_V in (200.0, 160.0, 290.0):  # a dip that the drive rides through
        assert step(cfg, st, vdc_V) == RELAY
    assert step(cfg, st, 149.0) == 0 and not lib.ht_outputs_charged(cfg, st)
    for _ in range(9):
        assert step(cfg, st, 300.0) == 0
    for _ in range(100):
        assert step(cfg, st, 230.0) == 0, "below its level"
    assert step(cfg, st, float("nan")) == 0


def test_without_a_relay_nothing_waits_for_one(make):
    cfg, st = make()
    assert step(cfg, st, 0.0) == 0 and lib.ht_outputs_charged(cfg, st)
    assert step(cfg, st, 300.0, works=True) == 0


def test_a_start_waits_for_the_relay():
    controller = Controller("f28377s", {"precharge_V": 240.0})
    with pytest.raises(FirmwareError, match="the dc link is not charged"):
        controller.start()
    assert controller.state == "idle"


def test_the_fan_goes_on_after_the_work(make):
    cfg, st = make(fan_s=2.0)
    assert step(cfg, st, 0.0) == 0
    assert step(cfg, st, 0.0, works=True) == FAN
    after = [step(cfg, st) for _ in range(300)]
    assert after[:199] == [FAN] * 199 and not any(after[201:])


def phases(cfg, st, torques, follows=True):
    return [lib.ht_outputs_brake(cfg, st, torque, follows) for torque in torques]


@pytest.mark.parametrize("sign", (1, -1))
def test_the_brake_opens_when_the_torque_is_there_and_closes_before_it_goes(make, sign):
    cfg, st = make(brake_open_s=0.1, brake_close_s=0.2, brake_Nm=8.0 * sign)
    too_little = (0.0, 7.0, -9.0, 7.1)
    assert phases(cfg, st, [sign * x for x in too_little]) == [lib.HT_BRAKE_BUILDS] * 4
    # A single sample is ripple.
    phases(cfg, st, [sign * 9.0, sign * 5.0])
    assert not lib.ht_outputs_lifted(cfg, st)
    phases(cfg, st, [sign * 8.0] * 3)
    assert lib.ht_outputs_lifted(cfg, st) and st.brake == lib.HT_BRAKE_OPENS
    seen = phases(cfg, st, [0.0] * 12)
    assert seen[:9] == [lib.HT_BRAKE_OPENS] * 9 and seen[11] == lib.HT_BRAKE_OPEN
    assert not lib.ht_outputs_close(cfg, st)  # told to close
    assert not lib.ht_outputs_lifted(cfg, st)
    seen = phases(cfg, st, [0.0] * 22, follows=False)
    assert seen[:19] == [lib.HT_BRAKE_CLOSES] * 19 and seen[21] == lib.HT_BRAKE_CLOSED
    assert lib.ht_outputs_close(cfg, st)
    # The stop is taken back: from the beginning.
    assert phases(cfg, st, [0.0]) == [lib.HT_BRAKE_BUILDS]


def test_a_stop_before_the_brake_has_opened_leaves_it_closed(make):
    cfg, st = make(brake_open_s=0.1, brake_Nm=8.0)
    assert lib.ht_outputs_close(cfg, st)
    phases(cfg, st, [9.0] * 10, follows=False)
    assert st.brake == lib.HT_BRAKE_BUILDS and not lib.ht_outputs_lifted(cfg, st)


def test_without_a_brake_it_is_open_and_no_output_is_on(make):
    cfg, st = make()
    assert phases(cfg, st, [0.0]) == [lib.HT_BRAKE_OPEN]
    assert lib.ht_outputs_close(cfg, st) and not lib.ht_outputs_lifted(cfg, st)
