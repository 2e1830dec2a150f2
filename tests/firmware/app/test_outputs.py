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


def test_a_fan_that_is_taken_away_while_it_goes_on_is_off(make):
    _, st = make(fan_s=2.0)
    st.fan_for = 100.0
    without, _ = make(fan_s=0.0)
    assert step(without, st) == 0


def phases(cfg, st, torques, follows=True):
    return [lib.ht_outputs_brake(cfg, st, torque, follows) for torque in torques]


@pytest.mark.parametrize("sign", (1, -1))
def test_the_brake_opens_when_the_torque_is_there(make, sign):
    cfg, st = make(brake_open_s=0.1, brake_Nm=8.0 * sign)
    too_little = (0.0, 7.0, -9.0, 7.1)
    assert phases(cfg, st, [sign * x for x in too_little]) == [lib.HT_BRAKE_BUILDS] * 4
    # A single sample is ripple.
    phases(cfg, st, [sign * 9.0, sign * 5.0])
    assert not lib.ht_outputs_lifted(cfg, st)
    phases(cfg, st, [sign * 8.0] * 3)
    assert lib.ht_outputs_lifted(cfg, st) and st.brake == lib.HT_BRAKE_OPENS
    seen = phases(cfg, st, [0.0] * 12)
    assert seen[:9] == [lib.HT_BRAKE_OPENS] * 9 and seen[11] == lib.HT_BRAKE_OPEN


@pytest.mark.parametrize("sign", (1, -1))
def test_the_brake_closes_before_the_torque_goes(make, sign):
    cfg, st = make(brake_open_s=0.1, brake_close_s=0.2, brake_Nm=8.0 * sign)
    phases(cfg, st, [sign * 8.0] * 20)
    assert st.brake == lib.HT_BRAKE_OPEN
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


def reference_chopper(volts, on_V, off_V):
    """The same by intervals: the latest sample that is beyond a level decides."""
    states, state = [], False
    for v in volts:
        if v > on_V:
            state = True
        elif v <= off_V:
            state = False
        states.append(state)
    return states


def test_the_chopper_has_hysteresis(make):
    cfg, _ = make(chopper_on_V=340.0, chopper_off_V=330.0)
    rng = np.random.default_rng(3)
    volts = np.clip(np.cumsum(rng.normal(0, 3.0, 5000)) % 60 + 305, 0, None).astype(np.float32)
    volts[::500] = 330.0, 340.0, 329.99, 340.01, 0.0, 500.0, 330.0, 340.0, 330.0, 340.0
    on, seen = False, []
    for v in volts:
        on = lib.ht_outputs_chops(cfg, on, float(v))
        seen.append(on)
    assert seen == reference_chopper(volts, 340.0, 330.0)
    assert 0.2 < np.mean(seen) < 0.8
    none, _ = make()
    assert not any(lib.ht_outputs_chops(none, on, 1e6) for on in (False, True))


class Link:
    """A drive on the register model, whose dc link has the voltage that a test gives it."""

    def __init__(self, device, **values):
        self.controller = Controller(device, {"chopper_on_V": 340.0, "chopper_off_V": 330.0,
                                              "vdc_max_V": 400.0, **values})  # fmt: skip
        self.c, self.m = self.controller, self.controller.map
        for address in self.m.adc_result:
            self.c.register_words()[address] = lib.HT_ADC_MID << self.m.adc_shift
        gpio = self.c.port.board.output[3].gpio
        self.word, self.bit = self.m.gpio_data + 8 * (gpio // 32) + gpio % 32 // 16, gpio % 16

    def step(self, volts, periods=1):
        counts = round(volts / float(self.c.drive.v_per_count))
        self.c.register_words()[self.m.adc_result[lib.HT_ADC_VDC]] = counts << self.m.adc_shift
        for _ in range(periods):
            lib.ht_drive_fast_isr(ffi.addressof(self.c.drive, 0))
        return self.pin

    @property
    def pin(self):
        level = bool(int(self.c.register_words()[self.word]) >> self.bit & 1)
        assert level == bool(int(self.c.channel("outputs")) & lib.HT_OUT_CHOPPER)
        return level


DEVICES = ("f28335", "f28377s")


@pytest.mark.parametrize("device", DEVICES)
def test_the_chopper_follows_the_voltage_in_each_state_within_the_period(device):
    link = Link(device)
    assert not link.step(300.0)
    ramp = (335.0, 341.0, 335.0, 331.0, 329.0, 335.0, 341.0, 300.0)
    wanted = [False, True, True, True, False, False, True, False]
    assert [link.step(v) for v in ramp] == wanted  # idle
    link.c.start()
    states = set()
    for _ in range(5000):
        states.add(link.c.state)
        assert [link.step(v) for v in ramp] == wanted, link.c.state
        if link.c.state in ("run", "fault"):
            break
    # A voltage that jumps and currents that stay at nothing are no machine: it ends in a fault.
    assert {"calibrate", "build"} <= states
    link.step(420.0, 2)
    assert link.c.state == "fault" and link.pin, "an over-voltage is discharged"
    assert not link.step(300.0)
    assert [link.step(v) for v in ramp] == wanted  # fault
    assert link.c.registers.violations == 0


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("latched", (False, True))
def test_the_chopper_is_off_while_the_trip_chain_is_open(device, latched):
    link = Link(device)
    assert link.step(350.0)
    link.c.set_trip_pin(0)
    assert not link.step(350.0)
    if latched:
        link.c.drive.faults = lib.HT_FAULT_EXTERNAL
    link.c.set_trip_pin(1)
    assert link.step(350.0) == (not latched)
    link.c.drive.faults = lib.HT_FAULT_VDC_HIGH | lib.HT_FAULT_OVERCURRENT
    assert link.step(350.0)


@pytest.mark.parametrize("device", DEVICES)
def test_without_the_fast_interrupt_nobody_looks_and_the_chopper_is_off(device):
    link = Link(device)
    assert link.step(350.0)
    for _ in range(2):
        lib.ht_drive_slow_isr(ffi.addressof(link.c.drive, 0))
    assert link.c.drive.faults & lib.HT_FAULT_INTERRUPT and not link.pin
    assert not link.step(350.0), "an interrupt that comes all the same finds the fault"
    link.step(300.0)
    link.c.clear()
    assert link.step(350.0)


def test_a_chopper_that_is_taken_away_or_whose_levels_move_while_it_is_on():
    link = Link("f28377s")
    assert link.step(350.0)
    link.c.set_many({"chopper_off_V": 350.0, "chopper_on_V": 360.0})
    assert not link.step(349.0) and not link.step(359.0) and link.step(361.0)
    link.c.set_many({"chopper_on_V": 0.0, "chopper_off_V": 0.0})
    assert not link.step(390.0)


def test_the_chopper_works_below_and_above_where_the_limits_begin():
    """The level at which the fast interrupt looks is the lower one of both."""
    for high_V, looks_V in ((0.0, 340.0), (320.0, 305.0), (380.0, 340.0)):
        link = Link("f28377s", vdc_high_V=high_V, vdc_band_V=15.0)
        assert link.c.drive.look_above_V == pytest.approx(looks_V)
        assert not link.step(339.0) and link.step(341.0) and link.step(331.0)
        assert not link.step(329.0)
