"""The drive application through its registers: states, protection, parameters.

The tests call the fast interrupt themselves and set the ADC result registers as the converter
would. The trip flags show whether the gates are on.
"""

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque import firmware
from hexatorque.firmware import Controller, FirmwareError, ffi, lib, parameters

#: Addresses of the results of six currents and the dc link, and the shift to the left.
ADC = {
    "f28335": (range(0x7108, 0x710F), 4),
    "f28377s": ((0x0B00, 0x0B20, 0x0B01, 0x0B21, 0x0B02, 0x0B22, 0x0B03), 0),
}
TZFLG = {"f28335": (0x6816, 0x40), "f28377s": (0x4093, 0x100)}
CMPA = {"f28335": (0x6809, 0x40), "f28377s": (0x406B, 0x100)}
QPOSCNT = {"f28335": 0x6B00, "f28377s": 0x5100}
PIEACK, OST = 0x0CE1, 0x0004
I_FULL, VDC_FULL = 30.0, 500.0
#: The tests do not depend on any default. Calibration and build-up take 20 and 100 interrupts.
SETUP = {
    "f_isr_Hz": 10000.0, "f_slow_Hz": 100.0, "dead_time_us": 2.3, "load_mode": "shadow",
    "calibration_s": 0.002, "build_s": 0.01, "encoder_counts_rev": 8192.0, "pole_pairs": 2.0,
    "i_full_A": I_FULL, "vdc_full_V": VDC_FULL, "i_trip_A": 25.0,
    "vdc_min_V": 150.0, "vdc_max_V": 400.0, "torque_limit_Nm": 15.0, "kp_speed_Nms_rad": 0.4,
    "torque_band_Nm": 0.5, "torque_inner_Nm": 0.289, "flux_ref_Wb": 0.6, "flux_min_Wb": 0.1,
    "observer": "hybrid", "crossover_Hz": 1.0, "rr_ohm": 2.0, "lr_H": 0.299, "lm_H": 0.284,
    "scheme": "ddr", "field_weakening": "off",
    # These tests load one phase at a time, which no machine could do.
    "i_sum_trip_A": 1000.0,
    # The flux does not follow the shaft here, and the current neither flux nor voltage.
    "encoder_trip_rpm": 0.0, "flux_check": 0.0, "stuck_trip_A": 0.0, "loss_check": 0.0,
}  # fmt: skip
POWERED = tuple(state.name for state in firmware.STATE_TABLE if state.controls)
#: The states of a drive that was started, in order; the state test is started in another mode.
DRIVEN = tuple(s.name for s in firmware.STATE_TABLE if s.at_work and s.name != firmware.TEST)
GATES_OFF = tuple(
    s.name for s in firmware.STATE_TABLE if not s.gates_on and s.name != firmware.FAULT
)


class Bench:
    """A controller whose sensors the test sets."""

    def __init__(self, device="f28335", **values):
        self.device = device
        self.controller = Controller(device, SETUP | values)
        self.words = self.controller.register_words()
        self.offset = np.zeros(6)
        self.amperes = np.zeros(6)
        self.vdc = 250.0

    @property
    def drive(self):
        return self.controller.drive

    @property
    def state(self):
        return self.controller.state

    @property
    def gates_on(self):
        base, stride = TZFLG[self.device]
        flags = [int(self.words[base + leg * stride]) & OST for leg in range(6)]
        assert len(set(flags)) == 1  # all legs together
        return not flags[0]

    def trip_from_outside(self):
        base, stride = TZFLG[self.device]
        for leg in range(6):
            self.words[base + leg * stride] |= OST

    def fast(self, times=1):
        addresses, shift = ADC[self.device]
        counts = np.rint(2048 + self.offset + self.amperes / I_FULL * 2048)
        counts = np.append(counts, np.rint(self.vdc / VDC_FULL * 4096))
        self.words[list(addresses)] = np.clip(counts, 0, 4095).astype(np.uint16) << shift
        for _ in range(times):
            lib.ht_drive_fast_isr(self.drive)

    def follow_flux(self):
        """The machine's flux has reached its reference. Without it nothing behind these registers
        would ever change the rotor's."""
        measured(self).flux_ref_Wb = self.drive.flux_ref_Wb
        self.drive.control.estimate.psi_Wb = [self.drive.flux_ref_Wb, 0.0]

    @property
    def cmpa(self):
        """The compare value of each leg."""
        base, stride = CMPA[self.device]
        return [int(self.words[base + leg * stride]) for leg in range(6)]

    @cmpa.setter
    def cmpa(self, counts):
        base, stride = CMPA[self.device]
        for leg in range(6):
            self.words[base + leg * stride] = counts

    def slow(self):
        """Run a fast interrupt and then a slow one."""
        self.drive.tick_last = (self.drive.tick - 1) & 0xFFFFFFFF
        lib.ht_drive_slow_isr(self.drive)

    def run_to(self, state):
        self.controller.start()
        for _ in range(1000):
            if self.state == state:
                return self
            self.fast()
        raise AssertionError(f"{state} not reached, in {self.state}")

    def violations(self):
        return self.controller.registers.violations


@pytest.fixture(params=ADC)
def bench(request):
    return Bench(request.param)


# --- states ---------------------------------------------------------------------


def test_states_in_order_and_gates_in_build_and_run_only(bench):
    assert (bench.state, bench.gates_on) == ("idle", False)
    bench.fast(5)
    assert (bench.state, bench.gates_on) == ("idle", False)
    bench.controller.start()
    seen = []
    for _ in range(160):
        before = bench.state
        bench.fast()
        seen.append(bench.state)
        assert bench.gates_on == (before in POWERED)
    changes = [n for n in range(1, 160) if seen[n] != seen[n - 1]]
    assert [seen[0]] + [seen[n] for n in changes] == ["calibrate", "build", "run"]
    assert changes == [19, 119]
    assert bench.violations() == 0


#: What only the control computes, beside what a sensor or the drive itself knows.
OF_CONTROL = (
    "torque_Nm", "torque_decided_Nm", "torque_ref_Nm", "torque_level", "psi_alpha_Wb",
    "psi_beta_Wb", "psi_x_Wb", "psi_y_Wb", "v_x_pu", "v_y_pu", "omega_sync_rad_s", "flux_level",
    "flux_ref_Wb", "sector", "interrupt_us", "limits",
)  # fmt: skip


def channels(bench):
    """All channels by name, read together."""
    names = [name for name, _ in firmware.channels()]
    values = np.empty(len(names), np.float32)
    lib.ht_channels_read(bench.drive, ffi.cast("float *", values.ctypes.data))
    return dict(zip(names, values, strict=True))


@pytest.mark.parametrize("mode", ("drive", "test"))
def test_what_the_control_computes_is_nan_while_it_does_not_run(mode):
    """Otherwise recordings and plots would show its last values as if they were present ones: a
    torque without any current, a flux after a fault."""
    bench = Bench(start_mode="drive", test_s=0.01)
    bench.run_to("run").fast(5)
    assert bench.controller.channel("flux_ref_Wb") > 0.0
    bench.controller.stop()
    bench.controller.set("start_mode", mode)
    bench.controller.start()
    for n in range(400):
        if n == 300:
            bench.vdc = 1000.0  # a fault
        controls = bench.controller.condition.controls
        for id, (name, value) in enumerate(channels(bench).items()):
            blank = name in OF_CONTROL and not controls
            assert np.isnan(value) == blank, (name, bench.state)
            one = np.float32(lib.ht_channel_read(bench.drive, id))
            assert np.array_equal(one, value, equal_nan=True)
        bench.fast()


@pytest.mark.parametrize(
    ("mode", "wanted"),
    [("drive", {"calibrate", "build", "run", "fault"}), ("test", {"idle", "calibrate", "test"})],
)
def test_the_table_of_states_tells_when_gates_may_be_on(mode, wanted):
    """Gates are on in no state without that flag. A drive that is not at work stays off until a
    command; one that is at work does without."""
    bench = Bench(start_mode=mode, test_s=0.01)
    bench.controller.start()
    seen = set()
    for n in range(400):
        now = bench.controller.condition
        seen.add(now)
        bench.fast()
        assert now.gates_on or not bench.gates_on, now
        assert now.at_work or not bench.controller.condition.at_work, now
        assert now.at_work or not (now.gates_on or now.controls)
        if n == 300:
            bench.vdc = 1000.0  # a fault
    assert {state.name for state in seen} == wanted


def test_of_an_unknown_state_everything_is_assumed():
    unknown = firmware.State.of("", lib.ht_state_flags(lib.HT_STATES))
    assert unknown == firmware.State("")


def test_legs_are_low_before_the_gates_come_on(bench):
    """During calibration the pattern has no edge, and its start level is low."""
    bench.cmpa = 77
    bench.controller.start()
    bench.fast()
    assert bench.cmpa == [bench.drive.config.control.period.counts] * 6


def test_before_the_first_interrupt_nothing_is_measured(bench):
    """Memory may hold anything when a drive is set up. A fault that comes before any sample shows
    zeros, not what was there, the checks begin with a leg that exists, and nothing is learnt."""
    drive = unwritten("ht_drive *")
    controller = bench.controller
    assert lib.ht_drive_init(drive, controller.port, [controller.drive.params]) == lib.HT_OK
    assert drive.stuck_leg in range(6)
    assert drive.sets.ohm == 0.0
    assert drive.speed_rpm == 0.0
    assert (drive.tick, drive.taken_tick) == (0, 1)  # the parameters count from then on
    lib.ht_drive_stand_in(drive, lib.HT_FAULT_CLOCK)
    seen = getattr(drive.snapshot, "in")
    assert list(seen.i_A.p) == [0.0] * 6
    assert (seen.vdc_V, seen.torque_ref_Nm, seen.turn_rad) == (0, 0, 0)


def test_flux_reference_rises_linearly_over_the_build_up(bench):
    """From nearly nothing to the parameter, and the control step gets the same."""
    bench.run_to("build")
    flux_Wb = []
    while bench.state == "build":
        bench.fast()
        if bench.state == "build":
            flux_Wb.append(bench.drive.flux_ref_Wb)
            assert measured(bench).flux_ref_Wb == flux_Wb[-1]
    share = np.arange(1, 100) / 100  # of build_s
    np.testing.assert_allclose(flux_Wb, SETUP["flux_ref_Wb"] * share, atol=0.01)
    assert bench.drive.flux_ref_Wb == pytest.approx(SETUP["flux_ref_Wb"])


def test_the_speed_regulator_begins_without_an_integral(bench):
    bench.drive.speed.integral_Nm = 2.0
    bench.run_to("build")
    assert bench.drive.speed.integral_Nm == 0.0


def test_an_interrupt_within_a_start_does_no_harm(bench):
    """A start sets the ticks to zero first and the state last. An interrupt in between must not use
    up the tick in which the legs go low, and it must not count as a sample of the offsets."""
    bench.offset[:] = 100
    bench.controller.start()
    bench.drive.state = lib.HT_STATE_IDLE
    bench.fast()
    bench.drive.state = lib.HT_STATE_CALIBRATE
    bench.cmpa = 77
    bench.fast()
    assert bench.cmpa == [bench.drive.config.control.period.counts] * 6
    while bench.state == "calibrate":
        bench.fast()
    assert bench.state == "build"
    assert list(bench.drive.offset_counts) == [2148.0] * 6


def test_stop_from_every_state(bench):
    for state in DRIVEN:
        bench.run_to(state)
        bench.controller.stop()
        assert (bench.state, bench.gates_on) == ("idle", False)
        bench.fast(3)
        assert (bench.state, bench.gates_on) == ("idle", False)


def test_start_and_clear_only_where_allowed(bench):
    with pytest.raises(FirmwareError):
        bench.controller.clear()
    bench.run_to("run")
    with pytest.raises(FirmwareError):
        bench.controller.start()
    assert bench.state == "run"


def test_interrupt_is_acknowledged(bench):
    for _ in bench.run_to("run"), None:
        bench.words[PIEACK] = 0x0FFF
        bench.fast()
        assert bench.words[PIEACK] == 0x0FFE


# --- measurement -----------------------------------------------------------------


def measured(bench):
    return getattr(bench.drive, "in")  # a Python keyword


def test_currents_and_voltage_are_scaled(bench):
    bench.amperes = np.array([1.0, -1.0, 2.0, 0.5, 0.0, -3.0])
    bench.fast()
    assert list(measured(bench).i_A.p) == pytest.approx(bench.amperes, abs=I_FULL / 4096 * 1.01)
    assert measured(bench).vdc_V == pytest.approx(250.0, abs=VDC_FULL / 8192 * 1.01)


def test_offsets_are_calibrated_out(bench):
    bench.offset = np.array([150, -150, 20, -3, 0, 77])
    bench.run_to("build")
    assert list(bench.drive.offset_counts) == pytest.approx(2048 + bench.offset)
    bench.amperes = np.array([1.0, -1.0, 2.0, 0.5, 0.0, -3.0])
    bench.fast()
    assert list(measured(bench).i_A.p) == pytest.approx(bench.amperes, abs=I_FULL / 4096 * 1.01)


def test_speed_from_the_encoder_across_its_wrap(bench):
    """8192 counts a revolution, 100 Hz: 1024 counts are 750 r/min."""
    address = QPOSCNT[bench.device]
    for start, moved, rpm in ((100, 1024, 750), (0xFFFFFF00, 1024, 750), (500, -1024, -750)):
        for position in (start, (start + moved) % 2**32):
            bench.words[address : address + 2] = position & 0xFFFF, position >> 16
            bench.fast()
            bench.slow()
        assert bench.drive.speed_rpm == pytest.approx(rpm, rel=1e-6)


def test_rotor_angle_from_sample_to_sample(bench):
    """With two pole pairs and 8192 counts, the test checks the electrical angle since the previous
    sample, also across the counter's wrap. A jump of the counter counts as 1.5 rad at most."""
    address = QPOSCNT[bench.device]

    def turned(counts):
        bench.words[address : address + 2] = counts & 0xFFFF, counts >> 16
        bench.fast()
        return measured(bench).turn_rad

    turned(0xFFFFFFF0)
    count = 2 * 2 * np.pi / 8192
    assert turned(0x10) == pytest.approx(32 * count, rel=1e-6)
    assert turned(0x10) == 0
    assert turned(0xFFFFFFFF) == pytest.approx(-17 * count, rel=1e-6)
    assert turned(5000) == 1.5
    assert turned(0) == -1.5


# --- protection --------------------------------------------------------------------


def overcurrent(leg, sign):
    def cause(bench):
        bench.amperes[leg] = sign * 25.1

    return cause


def vdc(value):
    def cause(bench):
        bench.vdc = value

    return cause


CAUSES = [
    *[(overcurrent(leg, sign), lib.HT_FAULT_OVERCURRENT) for leg in range(6) for sign in (1, -1)],
    (vdc(401.0), lib.HT_FAULT_VDC_HIGH),
    (vdc(149.0), lib.HT_FAULT_VDC_LOW),
    (Bench.trip_from_outside, lib.HT_FAULT_EXTERNAL),
]


@pytest.mark.parametrize(("cause", "bit"), CAUSES)
def test_fault_turns_the_gates_off_in_the_same_interrupt(bench, cause, bit):
    bench.run_to("run").fast(3)
    assert bench.gates_on
    cause(bench)
    bench.fast()
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("fault", False, bit)


@pytest.mark.parametrize("state", [name for name in DRIVEN if name != firmware.RUN])
@pytest.mark.parametrize("case", (0, -3, -2))
def test_faults_before_the_run_turn_the_gates_off(bench, state, case):
    cause, bit = CAUSES[case]
    bench.run_to(state).fast()
    cause(bench)
    bench.fast()
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("fault", False, bit)


def test_idle_ignores_the_sensors(bench):
    bench.vdc = 0.0
    bench.fast(3)
    assert (bench.state, bench.drive.faults) == ("idle", 0)


def test_values_just_inside_the_limits_are_no_fault(bench):
    bench.run_to("run")
    bench.amperes[3], bench.vdc = 24.9, 399.0
    bench.fast()
    bench.amperes[3], bench.vdc = -24.9, 151.0
    bench.fast()
    assert (bench.state, bench.drive.faults) == ("run", 0)


def test_several_faults_are_all_latched(bench):
    bench.run_to("run")
    bench.amperes[0], bench.vdc = 29.0, 100.0
    bench.fast()
    assert bench.drive.faults == lib.HT_FAULT_OVERCURRENT | lib.HT_FAULT_VDC_LOW
    assert len(bench.controller.faults) == 2


@pytest.mark.parametrize("leg", range(6))
def test_currents_of_a_set_must_add_up(bench, leg):
    """A sensor that reads 3 A too much, well below the over-current level."""
    bench.run_to("run")
    bench.controller.set("i_sum_trip_A", 2.0)
    bench.amperes[leg] = 1.5
    bench.fast()
    assert bench.state == "run"
    bench.amperes[leg] = 3.0
    bench.fast()
    assert (bench.state, bench.gates_on) == ("fault", False)
    assert bench.drive.faults == lib.HT_FAULT_CURRENT_SUM


def test_the_current_magnitude_trips_although_no_phase_does(bench):
    """24 A in every phase along its axis is 24 A in alpha-beta, below the phase limit."""
    bench.run_to("run")
    bench.amperes[:] = 24.0 * np.cos(np.deg2rad([0, 30, 120, 150, 240, 270]) - 0.25)
    bench.controller.set("i_ab_trip_A", 24.5)
    bench.fast()
    assert bench.drive.faults & lib.HT_FAULT_OVERCURRENT == 0
    bench.controller.set("i_ab_trip_A", 23.5)
    bench.fast()
    assert bench.drive.faults & lib.HT_FAULT_OVERCURRENT
    assert not bench.gates_on


def count(bench, rpm):
    """Encoder counts of one slow period at `rpm`."""
    words, address = bench.words, QPOSCNT[bench.device]
    now = int(words[address]) + (int(words[address + 1]) << 16)
    now = (now + round(rpm / 60 * 8192 / 100)) & 0xFFFFFFFF
    words[address], words[address + 1] = now & 0xFFFF, now >> 16
    bench.fast()


def turn(bench, rpm):
    """The same, then the slow interrupt."""
    count(bench, rpm)
    bench.slow()


@pytest.mark.parametrize("sign", [1, -1])
def test_over_speed_is_a_fault(bench, sign):
    bench.run_to("run")
    bench.controller.set("speed_trip_rpm", 2000.0)
    turn(bench, sign * 1900)
    bench.fast()
    assert bench.drive.faults & lib.HT_FAULT_OVERSPEED == 0
    turn(bench, sign * 2100)
    bench.fast()
    assert bench.drive.faults & lib.HT_FAULT_OVERSPEED
    assert not bench.gates_on


#: After a reset nobody knows what flux there is. So many interrupts until 2 % of it are left.
FLUX_DECAYS = round(np.log(50) * SETUP["lr_H"] / SETUP["rr_ohm"] * SETUP["f_isr_Hz"])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_turning_machine_whose_flux_is_known_is_caught(bench, sign):
    turn(bench, sign * 100)
    bench.fast(FLUX_DECAYS - 5)
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()
    bench.fast(10)
    bench.run_to("build")
    assert bench.drive.catches == 1
    bench.fast()
    assert bench.gates_on
    omega = bench.drive.control.observer.omega_sync_rad_s
    assert omega == pytest.approx(sign * 2 * 100 * np.pi / 30, rel=0.02)
    bench.fast(200)
    assert bench.state == "run"
    assert bench.drive.flux_unknown == 0


@pytest.mark.parametrize(("rpm", "weak"), [(500, False), (1900, True)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_caught_shaft_gets_a_flux_that_the_scheme_can_turn(bench, sign, rpm, weak):
    """With half of the link at most. If that is more than the reference, it gets the reference."""
    bench.controller.set("build_s", 0.1)
    turn(bench, sign * rpm)
    bench.fast(FLUX_DECAYS)
    bench.run_to("build")
    while bench.state == "build":
        flux_Wb = bench.drive.flux_ref_Wb
        bench.fast()
    reach_pu = min(0.5, bench.drive.config.flux.reach_pu)
    wanted_Wb = reach_pu * bench.vdc / (rpm * np.pi / 30 * SETUP["pole_pairs"])
    reference_Wb = bench.controller.get("flux_ref_Wb")
    assert (wanted_Wb < reference_Wb) == weak
    assert flux_Wb == pytest.approx(min(wanted_Wb, reference_Wb), rel=0.01)


@pytest.mark.parametrize(
    ("fault", "known"),
    [(lib.HT_FAULT_OVERCURRENT, True), (lib.HT_FAULT_VDC_HIGH, True), (lib.HT_FAULT_LINK, True),
     (lib.HT_FAULT_FLUX, False), (lib.HT_FAULT_ENCODER, False), (lib.HT_FAULT_STUCK, False)],
)  # fmt: skip
def test_after_a_fault_of_the_estimate_the_flux_is_not_known(bench, fault, known):
    bench.run_to("run")
    lib.ht_drive_trip(bench.drive, fault)
    bench.fast()
    bench.controller.clear()
    turn(bench, 100)
    if known:
        bench.controller.start()
        return
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()
    bench.fast(FLUX_DECAYS)
    bench.controller.start()


@pytest.mark.parametrize("values", [{"lost_legs": 1.0}, {"start_mode": "test"}])
def test_a_turning_machine_is_not_caught_without_a_leg_or_for_a_test(bench, values):
    turn(bench, 100)
    bench.fast(FLUX_DECAYS)
    bench.controller.set_many({"ride_through": "least-loss", "i_rated_A": 5.0} | values)
    bench.fast(FLUX_DECAYS)  # of a new set-up the flux is not known at first
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()


def test_the_calibration_waits_for_the_end_of_the_currents(bench):
    """5 ms after the gates went off."""
    bench.run_to("run")
    bench.controller.stop()
    bench.fast(10)
    bench.controller.start()
    bench.amperes[:] = 1.0
    bench.fast(39)
    bench.amperes[:] = 0.0
    bench.fast(19)
    assert bench.state == "calibrate"
    bench.fast()
    assert bench.state == "build"
    assert list(bench.drive.offset_counts) == [2048.0] * 6


@pytest.mark.parametrize("sign", [1, -1])
def test_no_start_into_a_turning_machine(bench, sign):
    turn(bench, sign * 100)
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()
    assert bench.state == "idle"
    turn(bench, sign * 10)
    bench.controller.start()
    assert bench.state == "calibrate"


def test_no_start_into_a_turning_machine_after_a_new_set_up(bench):
    """A parameter that sets the drive up again does not stop the shaft. The slow period in which it
    comes counts in full."""
    turn(bench, 100)
    bench.controller.set("build_s", 0.02)
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()
    words, address = bench.words, QPOSCNT[bench.device]
    words[address] += round(100 / 60 * 8192 / 100)  # the counts of a whole slow period
    bench.fast()
    bench.controller.set("build_s", 0.03)
    bench.slow()
    assert bench.drive.speed_rpm == pytest.approx(100, abs=1)
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()


def test_a_new_set_up_clears_no_fault(bench):
    """The fault and its snapshot stay until a clear."""
    bench.run_to("run")
    bench.vdc = 0.0
    bench.fast()
    kept = bench.controller.snapshot
    bench.vdc = 250.0
    bench.controller.clear()
    bench.drive.faults = lib.HT_FAULT_VDC_LOW  # as if a stop overtook the fault
    bench.controller.set("build_s", 0.02)
    assert bench.controller.snapshot == kept
    with pytest.raises(FirmwareError):
        bench.controller.start()


@pytest.mark.parametrize("tick", [2, 50, 99])
def test_external_trip_is_noticed_during_build(bench, tick):
    bench.run_to("build")
    bench.fast(tick)
    bench.trip_from_outside()
    bench.fast()
    assert bench.state == "fault"
    assert bench.drive.faults == lib.HT_FAULT_EXTERNAL


def test_a_lower_flux_reference_while_running_is_no_fault(bench):
    bench.run_to("run")
    bench.controller.set("flux_min_Wb", 0.01)
    bench.controller.set("flux_ref_Wb", 0.05)
    bench.slow()
    bench.fast(3)
    assert bench.state == "run"


@pytest.mark.parametrize(
    ("name", "value"), [("i_trip_A", 29.0), ("vdc_max_V", 490.0), ("flux_trip_Wb", 0.5)]
)
def test_trip_level_that_cannot_be_reached_is_refused(bench, name, value):
    before = bench.controller.get(name)
    with pytest.raises(FirmwareError, match="do not fit together"):
        bench.controller.set(name, value)
    assert bench.controller.get(name) == before


def test_fault_is_latched_until_cleared(bench):
    bench.run_to("run")
    bench.vdc = 100.0
    bench.fast()
    bench.vdc = 250.0
    bench.fast(50)
    assert (bench.state, bench.gates_on) == ("fault", False)
    with pytest.raises(FirmwareError):
        bench.controller.start()
    bench.controller.stop()
    assert bench.state == "fault"
    bench.controller.clear()
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("idle", False, 0)
    bench.run_to("run").fast(2)
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("run", True, 0)
    assert bench.violations() == 0


@pytest.mark.parametrize(("counts", "ok"), ((198, True), (-198, True), (202, False), (-202, False)))
def test_calibration_refuses_a_large_offset(bench, counts, ok):
    bench.offset[4] = counts
    bench.controller.start()
    bench.fast(20)
    assert bench.state == ("build" if ok else "fault")
    assert bench.drive.faults == (0 if ok else lib.HT_FAULT_CALIBRATION)
    assert not bench.gates_on


def test_impossible_estimate_is_a_fault(bench):
    for bad, cause in (
        (np.nan, lib.HT_FAULT_NONFINITE),
        (np.inf, lib.HT_FAULT_NONFINITE),
        (50.0, lib.HT_FAULT_FLUX),
    ):
        bench.run_to("run").fast()
        bench.drive.control.observer.psi_Wb.beta = bad
        bench.fast()
        assert (bench.state, bench.gates_on) == ("fault", False)
        assert bench.drive.faults == cause
        bench.controller.clear()


# --- slow loop ---------------------------------------------------------------------


def test_torque_mode_is_limited_and_reaches_the_fast_loop(bench):
    bench.controller.set("control_mode", "torque")
    bench.run_to("run")
    for wanted, given in ((3.0, 3.0), (99.0, 15.0), (-99.0, -15.0)):
        bench.controller.set("torque_ref_Nm", wanted)
        bench.fast()  # takes it over
        bench.slow()
        bench.fast()
        assert measured(bench).torque_ref_Nm == given


def test_parameters_reach_both_interrupts_together(bench):
    """Two parameters that belong together, one of the slow loop and one of the protection. A slow
    interrupt before the fast one uses neither new value; a slow interrupt after it uses both."""
    bench.controller.set("control_mode", "torque")
    bench.run_to("run").fast()
    ids = [parameters()[n].id for n in ("torque_ref_Nm", "torque_limit_Nm", "i_trip_A")]
    at = ffi.new("uint16_t *")
    assert lib.ht_drive_write(bench.drive, ids, [9.0, 4.0, 7.0], 3, at) == lib.HT_OK
    before = bench.drive.config
    bench.slow()
    assert bench.drive.torque_ref_Nm == 0.0
    assert before.params.v[ids[1]] == 15.0 and before.protect.i_trip_A == 25.0
    bench.fast()
    assert bench.drive.taken_tick == bench.drive.tick
    bench.slow()
    assert bench.drive.torque_ref_Nm == 4.0
    assert bench.drive.config.protect.i_trip_A == 7.0


@pytest.mark.parametrize("refused", [{"torque_inner_Nm": 3.0}, {"f_isr_Hz": 1234.5}])
def test_a_refusal_leaves_the_parameters_that_still_wait(bench, refused):
    """Two writes before the next fast interrupt, the first accepted, the second refused: the
    interrupt takes over the first, whether the second concerned the set-up or not."""
    if "f_isr_Hz" not in refused:
        bench.run_to("run")
    bench.fast()
    bench.controller.set("kp_xy_pu_A", 0.0123)
    before = bench.drive.params
    rate_Hz, inner_Nm = (before.v[parameters()[n].id] for n in ("f_isr_Hz", "torque_inner_Nm"))
    with pytest.raises(FirmwareError, match="do not fit together"):
        bench.controller.set_many(refused)
    assert bench.drive.staged != ffi.NULL
    bench.fast()
    control = bench.drive.config.control
    assert control.table_law.xy.kp_pu_A == pytest.approx(0.0123)
    assert control.observer.inv_ts == rate_Hz
    assert control.table_law.torque_inner_Nm == inner_Nm


def test_a_new_set_up_includes_what_waits_and_leaves_nothing_to_wait_for(bench):
    """Two writes before the next fast interrupt, both accepted. The second sets the drive up, which
    is in force at once: its reply, which is held back while anything is staged, need not wait."""
    bench.controller.set("kp_xy_pu_A", 0.0123)
    assert bench.drive.staged != ffi.NULL
    bench.controller.set("pole_pairs", 3.0)
    assert bench.drive.staged == ffi.NULL
    assert bench.drive.config.control.table_law.xy.kp_pu_A == pytest.approx(0.0123)
    assert bench.drive.config.control.observer.torque_gain == 9.0  # three for each pole pair


IDS = {name: row.id for name, row in parameters().items()}


@pytest.mark.parametrize(
    ("last", "value", "result", "where"),
    [
        (IDS["torque_ref_Nm"], np.nan, lib.HT_ERROR_VALUE, IDS["torque_ref_Nm"]),
        (IDS["torque_ref_Nm"], 1e9, lib.HT_ERROR_VALUE, IDS["torque_ref_Nm"]),
        (9999, 0.0, lib.HT_ERROR_ID, 9999),
        (IDS["pole_pairs"], 3.0, lib.HT_ERROR_STATE, IDS["pole_pairs"]),
        (IDS["flux_min_Wb"], 50.0, lib.HT_ERROR_CONFIG, lib.HT_MISFIT_FLUX_MIN),
    ],
)
def test_a_write_sets_all_parameters_or_none(bench, last, value, result, where):
    bench.run_to("run").fast()
    ids = [IDS[name] for name in ("torque_ref_Nm", "kp_speed_Nms_rad", "torque_band_Nm")]
    at = ffi.new("uint16_t *")
    before = list(bench.drive.params.v)
    given = [1.0, 2.0, 3.0, value]
    assert lib.ht_drive_write(bench.drive, [*ids, last], given, 4, at) == result
    assert at[0] == where
    bench.fast(3)
    assert list(bench.drive.params.v) == before == list(bench.drive.config.params.v)


def pull_out_Nm(flux_Wb):
    """The largest torque of the bench's machine over all slips at this stator flux. It is air-gap
    power divided by synchronous speed, from the equivalent circuit behind the stator."""
    w, pairs = 2 * np.pi * 50, 2
    lr, lm, sigma_ls, rr = 0.299, 0.284, 0.025, 2.0
    ls = sigma_ls + lm**2 / lr
    slip = np.geomspace(1e-4, 10, 20001)
    # Rows of the circuit: w psi_s = w (ls i_s + lm i_r), 0 = r/s i_r + j w (lm i_s + lr i_r)
    i_r = -1j * w * lm * flux_Wb / ls / (rr / slip + 1j * w * (lr - lm**2 / ls))
    return (3 * pairs * rr / slip * abs(i_r) ** 2 / w).max()


@pytest.mark.parametrize("mode", ["torque", "speed"])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_torque_reference_stays_within_what_the_flux_can_give(bench, mode, sign):
    """With a weak field the torque is limited to a share of the pull-out torque."""
    bench.controller.set("control_mode", mode)
    bench.controller.set("sigma_ls_H", 0.025)
    bench.controller.set("torque_ref_Nm", sign * 15.0)
    bench.controller.set("speed_ref_rpm", sign * 5000.0)
    bench.controller.set("adapt_s", 0.0)  # else it would be lowered where the flux stands still
    bench.run_to("run")
    bench.slow()
    bench.fast()
    assert measured(bench).torque_ref_Nm == sign * 15.0
    for flux_Wb in (0.2, 0.1):
        bench.controller.set("flux_ref_Wb", flux_Wb)
        bench.fast()  # takes it over
        bench.slow()
        bench.follow_flux()
        bench.slow()
        bench.fast()
        asked = sign * measured(bench).torque_ref_Nm
        assert asked == pytest.approx(0.8 * pull_out_Nm(flux_Wb), rel=0.001)
    assert abs(bench.drive.speed.integral_Nm) <= asked


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("share", "weakened"), [(0.5, True), (0.9, True), (1.0, True), (-0.9, True), (1.0, False)]
)
def test_a_weakened_flux_is_limited_by_the_pull_out_that_the_current_shows(
    bench, share, weakened, sign
):
    """The leakage is 1.7 times the believed one. The current is that of the circuit seen from the
    stator at this share of the true pull-out torque; -0.9: with more slip than at pull-out."""
    flux_Wb, believed_H, true_H, lm_H, lr_H = 0.2, 0.025, 0.0425, 0.284, 0.299
    bench.controller.set("sigma_ls_H", believed_H)
    bench.run_to("run").fast()
    measured(bench).flux_ref_Wb = bench.drive.flux_ramp_Wb = flux_Wb
    ls_H = believed_H + lm_H**2 / lr_H
    at = 1j * np.geomspace(1e-2, 1e2, 100001)  # slip over that of pull-out
    i_A = flux_Wb / ls_H * (1 + at * ls_H / true_H) / (1 + at)
    most_Nm = (6 * flux_Wb * i_A.imag).max()
    side = slice(0, 50000) if share > 0 else slice(50000, None)
    shown_A = i_A[side][np.argmin(abs(6 * flux_Wb * i_A.imag[side] - abs(share) * most_Nm))]
    bench.controller.set("field_weakening", "on")
    full_Wb = 1.5 * flux_Wb if weakened else flux_Wb
    bench.controller.set("flux_ref_Wb", full_Wb)
    bench.fast()
    omega_rad_s = 1000.0 if weakened else 0.0
    for _ in range(4):
        bench.drive.control.estimate.psi_Wb = [flux_Wb, 0.0]
        bench.drive.control.observer.i_A = [shown_A.real, sign * shown_A.imag]
        bench.drive.control.observer.omega_sync_rad_s = omega_rad_s
        bench.drive.control.estimate.torque_Nm = sign * 6 * flux_Wb * shown_A.imag
        bench.drive.flux_ramp_Wb = full_Wb
        bench.slow()
        omega_rad_s *= bench.drive.flux_ref_Wb / flux_Wb  # the voltage leaves flux_Wb
    shown = weakened and abs(share) > 0.8
    expected_Nm = 0.8 * most_Nm if shown else 0.8 * pull_out_Nm(flux_Wb)
    assert bench.drive.torque_limit_Nm == pytest.approx(expected_Nm, rel=0.01)


@pytest.mark.parametrize(("then_A", "now_A"), ((5.0, 5.0), (4.0, 4.5), (5.0, 4.5), (3.0, 6.0)))
def test_torque_is_limited_by_what_the_current_along_the_flux_leaves(bench, then_A, now_A):
    """That current is the measured one. One that grows is taken to grow on for a slow period."""
    bench.controller.set("sigma_ls_H", 0.01)
    bench.controller.set("i_trip_A", 9.0)
    bench.run_to("run").fast()
    for along_A in (then_A, now_A):
        bench.follow_flux()
        bench.drive.control.observer.i_A = [along_A, 0.0]
        bench.slow()
    config = ffi.addressof(bench.drive.config.derating)
    most_A = lib.ht_derated_most_A(config, ffi.NULL, bench.vdc, 0.6)
    expected_A = now_A + max(now_A - then_A, 0.0)
    across_A = max(most_A**2 - expected_A**2, 0.0) ** 0.5
    assert 3 * 2 * 0.6 * across_A < 15.0
    # A little less where the rotor flux, which stands still while torque comes, limits it.
    left_Nm = 3 * 2 * 0.6 * across_A
    assert 0.93 * left_Nm <= bench.drive.torque_limit_Nm <= 1.001 * left_Nm


def test_the_current_along_the_flux_is_followed_from_the_build_up_on(bench):
    """Else the first one in RUN would be taken for one that has just grown from nothing."""
    bench.run_to("build").fast()
    measured(bench).flux_ref_Wb = 0.3
    bench.drive.control.estimate.psi_Wb = [0.0, 0.3]
    bench.drive.control.observer.i_A = [1.0, 4.0]
    bench.slow()
    assert (bench.state, bench.drive.along_A) == ("build", 4.0)


def steady_Nm(flux_Wb, most_A, sigma_ls):
    """The largest torque over all slips at this stator flux with at most this current, by the
    circuit as seen from the stator: L_s, beside it the rotor's branch at the slip's speed."""
    lr, lm, rr = 0.299, 0.284, 2.0
    ls = sigma_ls + lm**2 / lr
    w = np.geomspace(1e-3, 1e3, 200001)  # of the slip
    i = flux_Wb / ls * (1 + 1j * w * lr / rr) / (1 + 1j * w * lr * sigma_ls / (rr * ls))
    torque = 3 * 2 * flux_Wb * np.abs(i.imag)
    return torque[np.abs(i) <= most_A].max()


def at_once_Nm(flux_Wb, rotor_Wb, most_A, sigma_ls):
    """The largest torque of all currents of this size or less that make this stator flux out of
    that rotor flux."""
    angle, most_Nm = np.linspace(np.pi, 0.0, 8001), 0.0
    for size in np.linspace(0.0, most_A, 401)[1:]:
        made = np.abs(rotor_Wb + sigma_ls * size * np.exp(1j * angle))  # rises
        if made[0] <= flux_Wb <= made[-1]:
            torque = 3 * 2 * rotor_Wb * size * np.sin(np.interp(flux_Wb, made, angle))
            most_Nm = max(most_Nm, torque)
    return most_Nm


@pytest.mark.parametrize(("weak", "flux_Wb", "least"), ((True, 0.3, 0), (False, 0.5, 1)))
def test_torque_is_limited_by_what_the_current_makes_now_and_later(bench, weak, flux_Wb, least):
    """Without a current along the flux that is measured. In a weak field the steady state to come
    counts; while the flux rises, from 0.5 to 0.6 Wb here, the rotor flux that has not followed."""
    sigma_ls = 0.01
    bench.controller.set("sigma_ls_H", sigma_ls)
    bench.controller.set("i_trip_A", 9.0)
    bench.run_to("run").fast()
    asked_Wb = flux_Wb if weak else 0.6
    step_Wb = 0.6 / (bench.controller.number("build_s") * bench.controller.number("f_slow_Hz"))
    for _ in range(400):  # the rotor flux is followed by a low pass
        bench.drive.flux_ramp_Wb = asked_Wb - step_Wb
        measured(bench).flux_ref_Wb = flux_Wb
        bench.drive.control.estimate.psi_Wb = [flux_Wb, 0.0]
        bench.drive.control.observer.i_A = [0.0, 0.0]
        bench.slow()
    reference_Wb, rotor_Wb = bench.drive.flux_ref_Wb, bench.drive.protect.rotor_now_Wb
    assert rotor_Wb == pytest.approx(flux_Wb, rel=1e-3)
    config = ffi.addressof(bench.drive.config.derating)
    most_A = lib.ht_derated_most_A(config, ffi.NULL, bench.vdc, asked_Wb)
    # A flux that rises takes 0.9 of the current.
    assert reference_Wb == pytest.approx(min(asked_Wb, rotor_Wb + 0.9 * sigma_ls * most_A))
    both = (
        steady_Nm(reference_Wb, most_A, sigma_ls),
        at_once_Nm(reference_Wb, rotor_Wb, most_A, sigma_ls),
    )
    assert both[least] < 0.97 * both[1 - least]
    assert bench.drive.torque_limit_Nm == pytest.approx(both[least], rel=0.002)


@pytest.mark.parametrize("observer", ["voltage", "compensated", "hybrid"])
def test_stator_resistance_can_change_while_running(bench, observer):
    """Without adaptation the configured value is the one in use."""
    bench.controller.set("observer", observer)
    bench.controller.set("adapt_s", 0.0 if observer == "hybrid" else 1.0)
    bench.run_to("run")
    bench.controller.set("rs_ohm", 2.5)
    bench.fast()
    bench.slow()
    assert bench.drive.control.observer.rs_ohm == 2.5


def test_speed_mode_starts_with_the_proportional_part(bench):
    bench.run_to("run")
    bench.controller.set("speed_ref_rpm", 100.0)
    bench.fast()
    bench.slow()
    assert bench.drive.torque_ref_Nm == pytest.approx(0.4 * 100 * np.pi / 30, rel=1e-4)


def test_the_slow_loop_does_nothing_outside_run(bench):
    bench.controller.set("speed_ref_rpm", 100.0)
    bench.slow()
    assert (bench.drive.torque_ref_Nm, bench.drive.speed.integral_Nm) == (0, 0)


# --- parameters ----------------------------------------------------------------------

VALUE, CONFIG = lib.HT_ERROR_VALUE, lib.HT_ERROR_CONFIG
STATE, ID = lib.HT_ERROR_STATE, lib.HT_ERROR_ID
EXTERNAL = lib.HT_FAULT_EXTERNAL


def everything(bench):
    """Everything that a parameter could change: the drive and its registers. A configuration that
    is neither in force nor waiting is where the next one is written, and says nothing."""
    drive, rf = bench.drive, bench.controller.registers
    data = bytearray(ffi.buffer(drive))
    size = ffi.sizeof("ht_drive_config")
    for k in range(2):
        one = ffi.addressof(drive.configs, k)
        if one not in (drive.config, drive.staged):
            begin = int(ffi.cast("uintptr_t", one)) - int(ffi.cast("uintptr_t", drive))
            data[begin : begin + size] = bytes(size)
    return bytes(data), bytes(ffi.buffer(rf.word))


def set_raw(bench, name, value):
    """Set a parameter without the host's own checks."""
    return lib.ht_drive_set(bench.drive, parameters()[name].id, value)


def refused(bench, name, value):
    before = everything(bench)
    result = set_raw(bench, name, value)
    untouched = everything(bench) == before
    assert result == lib.HT_OK or untouched, f"{name} refused, yet something changed"
    return result


@pytest.mark.parametrize("name", parameters())
def test_value_out_of_range_is_refused(name):
    bench, row = Bench(), parameters()[name]
    bad = [np.nan, np.inf, -np.inf]
    bad += [np.nextafter(np.float32(row.max), np.float32(np.inf))]
    bad += [np.nextafter(np.float32(row.min), np.float32(-np.inf))]
    if row.choices:
        bad += [0.5, row.max + 1, -1.0]
    for value in bad:
        assert refused(bench, name, value) == VALUE
    assert lib.ht_drive_get(bench.drive, row.id) == np.float32(
        row.parse(SETUP.get(name, row.show(row.initial)))
    )


@pytest.mark.parametrize("name", parameters())
def test_initial_values_are_valid_and_can_be_set(name):
    bench, row = Bench(), parameters()[name]
    assert set_raw(bench, name, row.initial) == lib.HT_OK
    assert lib.ht_drive_get(bench.drive, row.id) == np.float32(row.initial)


@pytest.mark.parametrize("state", (*DRIVEN, firmware.FAULT))
def test_idle_parameters_are_refused_outside_idle(bench, state):
    bench.run_to("run" if state == "fault" else state)
    if state == "fault":
        bench.vdc = 0.0
        bench.fast()
    assert bench.state == state
    for name, row in parameters().items():
        result = refused(bench, name, row.initial)
        assert result == (lib.HT_OK if row.live else STATE), name


INCONSISTENT = (
    ("torque_inner_Nm", 0.6),  # above the outer band
    ("torque_band_Nm", 0.1),  # below the inner band
    ("torque_release_Nm", 0.5),  # not below the band
    ("torque_release_Nm", -0.5),  # not within the band on the other side
    ("flux_min_Wb", 0.7),  # above the reference
    ("flux_ref_Wb", 0.05),  # below the minimum
    ("vdc_min_V", 400.0),
    ("vdc_max_V", 150.0),
)


@pytest.mark.parametrize(("name", "value"), INCONSISTENT)
@pytest.mark.parametrize("state", ("idle", "run"))
def test_inconsistent_values_are_refused(bench, name, value, state):
    if state == "run":
        bench.run_to("run")
    assert refused(bench, name, value) == CONFIG


def test_period_that_does_not_fit_the_counter_is_refused():
    assert refused(Bench("f28335"), "f_isr_Hz", 2000.0) == CONFIG  # 75000 counts
    assert refused(Bench("f28377s"), "f_isr_Hz", 2000.0) == lib.HT_OK  # 50000 counts


@pytest.mark.parametrize("state", ("idle", "run"))
def test_dead_time_that_the_board_does_not_allow_is_refused(bench, state):
    """The minimum is 1 us for the power stage. 10 bits at 150 MHz are 6.82 us. The maximum of any
    board is 20 us."""
    most = {"f28335": 6.82, "f28377s": 20.0}[bench.device]
    if state == "run":
        bench.run_to("run")
    for us in (0.0, -1.0, 0.5, 0.999, most * 1.001, 163.0, np.nan, np.inf):
        assert refused(bench, "dead_time_us", us) == VALUE
    for us in (1.0, most) if state == "idle" else ():
        assert refused(bench, "dead_time_us", us) == lib.HT_OK
    assert bench.controller.registers.violations == 0


def test_message_of_a_refused_dead_time_names_the_boards_range():
    for device, most in (("f28335", "6.82"), ("f28377s", "20")):
        said = rf"dead_time_us = 0\.1: allowed range is 1 \.\. {most} us"
        with pytest.raises(FirmwareError, match=said):
            Controller(device, SETUP | {"dead_time_us": 0.1})
        bench = Bench(device)
        with pytest.raises(FirmwareError, match=said):
            bench.controller.set("dead_time_us", 0.1)
        assert bench.controller.get("dead_time_us") == pytest.approx(2.3)


@pytest.mark.parametrize("device", ("f28335", "f28377s"))
def test_start_values_without_dead_time_are_refused(device):
    """The firmware itself refuses them, without the host's checks."""
    bench = Bench(device)
    params = ffi.new("ht_params *")
    params[0] = bench.drive.params
    dbred = {"f28335": 0x6810, "f28377s": 0x4051}[device]
    before = int(bench.words[dbred])
    for us in (0.0, 0.9):
        params.v[parameters()["dead_time_us"].id] = us
        assert lib.ht_drive_init(bench.drive, bench.controller.port, params) == VALUE
    assert int(bench.words[dbred]) == before


@pytest.mark.parametrize("state", ("idle", "run"))
def test_a_pulse_that_the_board_does_not_allow_is_refused(bench, state):
    """The minimum is 2 us for the power stage."""
    if state == "run":
        bench.run_to("run")
    for us in (0.0, 1.999, 20.1, np.nan):
        assert refused(bench, "min_pulse_us", us) == VALUE
    if state == "idle":
        assert refused(bench, "min_pulse_us", 2.0) == lib.HT_OK
    params = ffi.new("ht_params *", bench.drive.params)
    params.v[parameters()["min_pulse_us"].id] = 1.9
    assert lib.ht_drive_init(bench.drive, bench.controller.port, params) == VALUE


@pytest.mark.parametrize(
    ("device", "clock", "registers", "most"),
    [("f28335", 150, (0x6810, 0x6811), 6.82), ("f28377s", 100, (0x4051, 0x4053), 20.0)],
)
def test_dead_time_is_rounded_up(device, clock, registers, most):
    """The dead time is never shorter than requested, and never a whole count longer. A value
    that is a whole number of counts except for rounding (2.3 us are 230 of 10 ns) gives that
    number."""
    bench = Bench(device)
    whole = {1.0: clock, 2.0: 2 * clock, 2.3: 23 * clock // 10, most: round(most * clock)}
    exact = [count / clock for count in range(clock, round(most * clock), 37)]
    between = [1.001, 1.0051, 2.301, 2.2999, 3.333, 6.0007, 6.7939]
    for us in (*whole, *exact, *between):
        bench.controller.set("dead_time_us", us)
        counts, other = (int(bench.words[register]) for register in registers)
        assert counts == other == whole.get(us, counts)
        assert -0.011 <= counts - us * clock < 1 - 0.009, us
    assert bench.controller.registers.violations == 0


@pytest.mark.parametrize("state", DRIVEN)
def test_low_trip_pin_is_a_fault_and_refuses_start_and_clear(bench, state):
    bench.run_to(state)
    bench.controller.set_trip_pin(0)
    bench.fast()
    assert (bench.state, bench.drive.faults) == ("fault", EXTERNAL)
    before = bench.controller.registers.accesses
    for command in (bench.controller.start, bench.controller.clear):
        with pytest.raises(FirmwareError, match=r"the trip pin is low .*: release it, then"):
            command()
    assert bench.controller.registers.accesses - before == 2  # a check each, no write
    for _ in range(20):
        bench.fast()
        assert (bench.state, bench.gates_on, bench.drive.faults) == ("fault", False, EXTERNAL)
    bench.controller.set_trip_pin(1)
    bench.controller.clear()
    assert bench.run_to("run").gates_on
    assert bench.controller.registers.violations == 0


def test_trip_pin_that_goes_low_within_the_interrupt_that_switches_on(bench):
    """The pin goes low between its check and the release. The latch is set again, and the next
    interrupt finds it."""
    bench.run_to("build")
    bench.fast()
    assert bench.gates_on
    bench.controller.set_trip_pin(0)
    assert not bench.gates_on
    bench.fast()
    assert (bench.state, bench.drive.faults) == ("fault", EXTERNAL)


@pytest.mark.parametrize("state", POWERED)
@pytest.mark.parametrize("leg", range(6))
def test_trip_of_one_leg_alone_is_found(bench, state, leg):
    """In RUN it is found within six interrupts, in BUILD in the next one."""
    bench.run_to(state)
    bench.fast(2)
    base, stride = TZFLG[bench.device]
    bench.words[base + leg * stride] |= OST
    bench.fast(6 if state == "run" else 1)
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("fault", False, EXTERNAL)


def test_an_unknown_id_is_refused():
    bench = Bench()
    before = everything(bench)
    for index in (lib.ht_param_count(), 0xFFFF):
        assert lib.ht_drive_set(bench.drive, index, 0.0) == ID
        assert lib.ht_drive_get(bench.drive, index) == 0.0
        assert lib.ht_param_describe(index) == ffi.NULL
    assert everything(bench) == before


def test_bad_start_values_are_refused():
    for values in (
        {"torque_inner_Nm": 1.0},
        {"f_isr_Hz": 2000.0},
        {"dead_time_us": 10.0},
        {"flux_min_Wb": 1.0},
        {"load_mode": "immediate", "f_isr_Hz": 20000.0, "write_delay_us": 26.0},
    ):
        with pytest.raises(FirmwareError):
            Controller("f28335", SETUP | values)


def test_live_change_takes_effect_at_the_next_fast_interrupt(bench):
    bench.run_to("run")
    bench.controller.set("scheme", "dtc3")
    bench.controller.set("flux_band_Wb", 0.02)
    assert bench.drive.config.control.scheme == lib.HT_DDR
    bench.fast()
    config = bench.drive.config.control
    assert (config.scheme, config.table_law.torque_levels) == (lib.HT_DTC3, 5)
    assert config.table_law.flux_band_Wb == np.float32(0.02)


def test_the_configuration_follows_from_the_parameters(bench):
    clock = {"f28335": 150e6, "f28377s": 100e6}[bench.device]
    config = bench.drive.config.control
    assert config.period.counts == round(clock / 10000)
    assert config.observer.ts_s == np.float32(1e-4)
    assert config.observer.torque_gain == 6.0
    assert config.dead.dead_pu == pytest.approx(0.023)
    assert config.period.shortest == round((2.3e-6 + 2e-6) * clock)
    observer = config.observer  # R_r 2 ohm, L_r 299 mH, L_m 284 mH, crossover 1 Hz
    assert observer.hybrid_gain == pytest.approx(2 * np.pi * 1e-4, rel=1e-5)
    assert observer.rotor_decay == pytest.approx(1e-4 * 2 / 0.299, rel=1e-5)
    assert observer.rotor_drive == pytest.approx(1e-4 * 2 * 0.284 / 0.299, rel=1e-5)
    assert observer.lm_over_lr == pytest.approx(0.284 / 0.299, rel=1e-5)
    assert (config.shadow, config.predict, config.period.first) == (True, True, 0)
    dead = {"f28335": 0x6810, "f28377s": 0x4051}[bench.device]
    assert bench.words[dead] == round(2.3e-6 * clock)
    # A mean over 0.2 s, sampled with f_slow_Hz.
    assert bench.drive.config.omega_mean_gain == pytest.approx(1 / (1 + 0.2 * 100), rel=1e-5)
    for value, only_v0 in (("V0", True), ("nearest", False)):
        bench.controller.set("zero_vector", value)
        bench.fast()
        assert bench.drive.config.control.only_v0 == only_v0
    for value in (True, False):
        bench.controller.set("zero_hold", value)
        bench.fast()
        assert bench.drive.config.control.table_law.hold_on_zero == value
    for kappa in (0.0, 0.25, 1.0):
        bench.controller.set_many({"scheme": "db-dtfc", "kappa": kappa})
        bench.fast()
        assert bench.drive.config.control.modulator.kappa == kappa
    # What the sets differ by: means over 0.05 s, the result over 0.2 s; only where the x-y currents
    # are regulated.
    for scheme, learns in (("dtc1", 0), ("dtc3", 0), ("fdr", 0), ("ddr", 1), ("ddr-ml", 1),
                           ("db-dtfc", 1), ("foc", 1)):  # fmt: skip
        bench.controller.set("scheme", scheme)
        bench.fast()
        sets = bench.drive.config.sets
        assert sets.gain == pytest.approx(1 / (1 + 0.05 * 100), rel=1e-5)
        assert sets.slow_gain == pytest.approx(learns / (1 + 0.2 * 100), rel=1e-5)
        assert sets.least_A2 == pytest.approx(bench.drive.config.control.leg_loss.zero_A**2)
    bench.controller.set("scheme", "ddr")
    for name, kind in (
        ("voltage", lib.HT_OBSERVER_VOLTAGE),
        ("compensated", lib.HT_OBSERVER_COMPENSATED),
        ("hybrid", lib.HT_OBSERVER_HYBRID),
    ):
        bench.controller.set("observer", name)
        assert bench.drive.config.control.observer.kind == kind
    bench.controller.set("load_mode", "immediate")
    bench.controller.set("write_delay_us", 5.0)
    config = bench.drive.config.control
    assert (config.shadow, config.predict) == (False, False)
    assert config.period.first == round(5e-6 * clock)


@pytest.mark.parametrize(
    ("gathered", "off_legs", "learns"), [(0, 0, True), (1, 0, False), (0, 1, False)]
)
def test_the_sets_difference_is_not_learnt_while_a_leg_may_be_lost(
    bench, gathered, off_legs, learns
):
    """The residual of a lost leg says nothing of the resistances."""
    bench.run_to("run")
    control = bench.drive.control
    control.observer.i_A.alpha, control.leg_loss.low_V.x = 500.0, 100.0
    control.leg_loss.count, bench.drive.off_legs = gathered, off_legs
    bench.slow()
    assert (bench.drive.sets.ohm > 0.0) == learns


@pytest.mark.parametrize(("scheme", "group"), [("ddr", lib.HT_L), ("ddr-ml", lib.HT_ML)])
def test_limit_of_the_xy_command_is_that_of_the_scheme(bench, scheme, group):
    bench.controller.set("scheme", scheme)
    bench.fast()
    assert bench.drive.config.control.table_law.xy_limit_pu == lib.ht_tmvcl_pu[group]


def test_channels_carry_the_state(bench):
    bench.run_to("run")
    bench.amperes[2] = 1.5
    bench.fast()
    values = channels(bench)
    assert values["state"] == lib.HT_STATE_RUN
    assert values["i_w1_A"] == pytest.approx(1.5, abs=0.01)
    assert values["vdc_V"] == pytest.approx(250, abs=0.1)
    assert values["flux_ref_Wb"] == np.float32(0.6)
    # w1 alone: a sixth of it in -x, cos 30 / 3 in -y
    l_xy = bench.drive.config.control.observer.lxy_H
    assert values["psi_x_Wb"] == pytest.approx(-l_xy * 1.5 / 6, rel=0.02)
    assert values["psi_y_Wb"] == pytest.approx(-l_xy * 1.5 * 0.288675, rel=0.02)


def test_there_are_no_more_channels_than_are_described():
    assert len(firmware.channels()) == lib.ht_channel_count()
    assert lib.ht_channel_describe(lib.ht_channel_count()) == ffi.NULL


@pytest.mark.parametrize("position", [12345, 0xFFFFFF00])
def test_set_up_starts_at_the_encoders_position(bench, position):
    """A set-up causes no jump in speed, whatever the counter's position is."""
    address = QPOSCNT[bench.device]
    bench.words[address], bench.words[address + 1] = position & 0xFFFF, position >> 16
    assert lib.ht_drive_init(bench.drive, bench.controller.port, [bench.drive.params]) == lib.HT_OK
    bench.fast()
    bench.slow()
    assert bench.drive.speed_rpm == 0
    bench.controller.set("build_s", 0.02)
    bench.fast()
    bench.slow()
    assert bench.drive.speed_rpm == 0
    bench.run_to("run")


@pytest.mark.parametrize("state", ["idle", "fault"])
def test_gates_that_come_on_in_idle_or_fault_go_off_again(bench, state):
    """The next fast interrupt sets the latch again, whatever released it."""
    if state == "fault":
        bench.run_to("run")
        bench.vdc = 0.0
        bench.fast()
    assert bench.state == state
    base, stride = TZFLG[bench.device]
    for leg in range(6):
        bench.words[base + leg * stride] = 0
    bench.fast()
    assert not bench.gates_on


def test_a_fault_just_before_a_stop_still_needs_a_clear(bench):
    bench.drive.faults = lib.HT_FAULT_VDC_LOW
    with pytest.raises(FirmwareError):
        bench.controller.start()
    bench.controller.clear()
    bench.controller.start()
    assert bench.state == "calibrate"


# --- slow faults, snapshot, overrun ------------------------------------------------------


def blind_encoder(bench):
    """The flux does not turn in RUN, but the encoder does. One slow interrupt finds this."""
    bench.controller.set("encoder_trip_rpm", 150.0)
    turn(bench, 2000)


def test_slow_fault_reaches_the_gates_at_the_next_fast_interrupt(bench):
    bench.run_to("run").fast(2)
    blind_encoder(bench)
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("run", True, 0)
    bench.fast()
    assert (bench.state, bench.gates_on) == ("fault", False)
    assert bench.drive.faults == lib.HT_FAULT_ENCODER
    assert bench.controller.faults == ["encoder against flux speed"]


def test_flux_check_works_through_the_registers(bench):
    """The build-up leaves 0.6 Wb along 15 degrees. A current along it of many times the no-load
    current belongs to no machine. The low-pass has 0.2 s."""
    bench.run_to("run").fast(2)
    bench.controller.set("flux_check", 0.7)
    bench.controller.set("i_ab_trip_A", 33.0)
    bench.amperes[:] = 20.0 * np.cos(np.deg2rad([0, 30, 120, 150, 240, 270]) - np.pi / 12)
    bench.drive.control.observer.psi_Wb = [0.6 * np.cos(np.pi / 12), 0.6 * np.sin(np.pi / 12)]
    bench.fast()
    for _ in range(20):
        bench.slow()
    assert bench.drive.slow_faults == lib.HT_FAULT_FLUX
    bench.fast()
    assert (bench.state, bench.gates_on) == ("fault", False)
    assert bench.drive.faults == lib.HT_FAULT_FLUX


@pytest.mark.parametrize("state", GATES_OFF)
def test_slow_faults_do_not_count_with_the_gates_off(bench, state):
    if state != "idle":
        bench.run_to(state).fast()
    bench.drive.slow_faults = lib.HT_FAULT_ENCODER | lib.HT_FAULT_FLUX
    bench.fast(3)
    assert (bench.state, bench.drive.faults) == (state, 0)
    bench.controller.set("encoder_trip_rpm", 150.0)
    turn(bench, 2000)  # finds nothing, and the earlier finding is dropped
    assert bench.drive.slow_faults == 0
    assert bench.drive.protect.speed_error_rpm == 0
    assert bench.state == state


@pytest.mark.parametrize(
    ("share", "rpm", "found"),
    [(0.15, 500.0, False), (0.5, 95.0, False), (0.5, -105.0, True), (0.5, 105.0, True)],
)
def test_flux_that_turns_in_the_build_up(bench, share, rpm, found):
    """The flux turns 100 r/min faster than the encoder: the shaft turns, but the encoder does
    not."""
    bench.controller.set("build_s", 0.1)
    bench.controller.set("encoder_trip_rpm", 150.0)
    electrical = 2 * np.pi / 30  # rad/s per r/min, two pole pairs
    bench.run_to("build").fast(int(1000 * share))
    bench.drive.control.observer.omega_sync_rad_s = rpm * electrical
    bench.slow()
    bench.fast()
    assert (bench.state == "fault") == found
    assert bench.gates_on != found
    assert bench.drive.faults == (lib.HT_FAULT_ENCODER if found else 0)


def test_flux_that_turns_in_the_build_up_with_the_check_off(bench):
    bench.controller.set("build_s", 0.1)
    bench.run_to("build").fast(500)
    bench.drive.control.observer.omega_sync_rad_s = 500.0
    bench.slow()
    bench.fast()
    assert (bench.state, bench.drive.faults) == ("build", 0)


@pytest.mark.parametrize(
    "values, adapts",
    [
        ({}, True),
        ({"adapt_s": 0.0}, False),
        ({"observer": "compensated"}, False),
        # Along the axis of a lost leg R_s counts twice.
        ({"lost_legs": 32, "scheme": "db-dtfc", "ride_through": "least-loss", "i_rated_A": 5.0,
          "sigma_ls_H": 0.025, "lxy_H": 0.01}, False),
    ],
)  # fmt: skip
def test_the_build_up_learns_the_resistance_if_adaptation_is_on(values, adapts):
    bench = Bench(build_s=0.1, **values)
    bench.run_to("build").fast(500)
    before = bench.drive.control.observer.rs_ohm
    observer = bench.drive.control.observer
    observer.psi_r_Wb = [0.5, 0.1]
    observer.i_A = [3.0, 0.8]
    observer.gap_Wb = [0.02, 0.01]  # the voltage model's flux is another one
    for _ in range(5):
        bench.slow()
    assert (observer.rs_ohm != before) == adapts


def test_slow_fault_of_the_run_before_is_forgotten(bench):
    """The drive is cleared and started again before the next slow interrupt."""
    bench.run_to("run").fast(2)
    blind_encoder(bench)
    bench.fast()
    assert bench.state == "fault"
    bench.controller.clear()
    bench.controller.set("start_max_rpm", 5000.0)
    bench.run_to("run").fast(3)
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("run", True, 0)


def test_stuck_sensor_is_found_through_the_registers(bench):
    """Each leg is checked in every sixth interrupt. After 50 checks without a change, the sum of
    its set's other two must not have changed by 1 A."""
    bench.run_to("run")
    bench.controller.set("stuck_trip_A", 1.0)
    for n in range(700):
        bench.amperes[:] = 3.0 * np.sin(2 * np.pi * n / 400 + np.arange(6))
        bench.amperes[3] = 0.7
        bench.fast()
        if bench.state == "fault":
            break
    assert bench.drive.faults == lib.HT_FAULT_STUCK
    assert 6 * 50 < n < 6 * 54
    assert not bench.gates_on


def test_moving_sensors_are_not_stuck(bench):
    bench.run_to("run")
    bench.controller.set("stuck_trip_A", 1.0)
    for n in range(2000):
        bench.amperes[:] = 3.0 * np.sin(2 * np.pi * n / 400 + np.arange(6))
        bench.fast()
    assert bench.state == "run"


def test_the_protection_limits_follow_from_the_parameters(bench):
    """sigma L_s 25 mH, L_m 284 mH, L_r 299 mH, R_r 2 ohm, 2 pole pairs, +-30 A."""
    bench.controller.set("sigma_ls_H", 0.025)
    bench.controller.set("stuck_trip_A", 1.5)
    bench.fast()  # takes them over
    c = bench.drive.config.protect
    ls = 0.025 + 0.284**2 / 0.299
    assert c.ls_H == pytest.approx(ls, rel=1e-5)
    assert c.sigma == pytest.approx(0.025 / ls, rel=1e-5)
    assert c.no_load_A == pytest.approx(0.6 / ls, rel=1e-5)
    assert c.slip_gain == pytest.approx(2 * (0.284 / 0.299) ** 2, rel=1e-5)
    assert c.rpm_per_rad_s == pytest.approx(60 / (2 * np.pi) / 2, rel=1e-5)
    assert c.stuck_counts == pytest.approx(1.5 / (2 * I_FULL / 4096), rel=1e-5)


@pytest.mark.parametrize("f", (10.0, 40.0, 100.0, 500.0))
def test_the_filters_of_the_protection_keep_their_times_at_any_slow_frequency(bench, f):
    """Low-passes of 0.2 s and 50 ms."""
    bench.controller.set("f_slow_Hz", f)
    c = bench.drive.config.protect
    assert c.slow_Hz == f and c.slow_turns_s == pytest.approx(0.5 / np.pi / f)
    for gain, seconds in ((c.flux_gain, 0.2), (c.encoder_gain, 0.05)):
        assert gain / (1 - gain) == pytest.approx(1 / (seconds * f), rel=1e-4)


def kept(bench):
    return bytes(ffi.buffer(ffi.addressof(bench.drive.snapshot)))


@pytest.mark.parametrize("state", DRIVEN)
def test_snapshot_has_the_values_of_the_faulty_interrupt(bench, state):
    assert bench.controller.snapshot is None
    bench.run_to(state).fast(5)
    address = QPOSCNT[bench.device]
    bench.words[address : address + 2] = 0x3456, 0x0012
    bench.amperes[:] = 1.0, 2.0, -3.0, 4.0, 2.0, 26.0
    estimate = bytes(ffi.buffer(ffi.addressof(bench.drive.control.estimate)))
    bench.fast()
    assert bench.state == "fault"
    s = bench.controller.snapshot
    assert s["tick"] == bench.drive.tick
    assert s["state"] == state
    assert s["faults"] == ["over-current"]
    counts = np.rint(2048 + bench.amperes / I_FULL * 2048)
    assert s["adc_counts"] == [*counts, 2048]
    assert s["position_counts"] == 0x123456
    assert s["i_A"] == pytest.approx(bench.amperes, abs=0.01)
    assert s["vdc_V"] == pytest.approx(250.0, abs=0.1)
    raw = bench.drive.snapshot
    assert bytes(ffi.buffer(ffi.addressof(raw.estimate))) == estimate
    assert s["psi_Wb"] == [raw.estimate.psi_Wb.alpha, raw.estimate.psi_Wb.beta]
    assert s["torque_Nm"] == raw.estimate.torque_Nm
    assert (np.hypot(*s["psi_Wb"]) > 0.01) == (state != "calibrate")


def test_snapshot_has_the_references_and_the_speed(bench):
    bench.run_to("run")
    bench.controller.set("control_mode", "torque")
    bench.controller.set("torque_ref_Nm", 3.0)
    bench.controller.set("flux_ref_Wb", 0.55)
    turn(bench, 300)
    bench.fast()
    bench.vdc = 100.0
    bench.fast()
    s = bench.controller.snapshot
    assert (s["torque_ref_Nm"], s["flux_ref_Wb"]) == (3.0, np.float32(0.55))
    assert s["speed_rpm"] == bench.drive.speed_rpm == pytest.approx(300, rel=0.01)


def test_snapshot_is_of_the_first_fault_until_the_next(bench):
    bench.run_to("run").fast(2)
    bench.vdc = 100.0
    bench.fast()
    first = kept(bench)
    assert bench.controller.snapshot["faults"] == ["dc-link voltage too low"]
    bench.vdc, bench.amperes[2] = 450.0, 29.0  # another fault in the state fault
    bench.fast(5)
    bench.slow()
    assert (kept(bench), bench.drive.faults) == (first, lib.HT_FAULT_VDC_LOW)
    bench.vdc, bench.amperes[2] = 250.0, 0.0
    bench.controller.clear()
    assert kept(bench) == first
    bench.run_to("run").fast(2)
    assert kept(bench) == first
    bench.trip_from_outside()
    bench.fast()
    s = bench.controller.snapshot
    assert (s["faults"], s["tick"]) == (["external trip"], bench.drive.tick)


def test_faults_of_one_interrupt_are_all_in_the_snapshot(bench):
    bench.run_to("run").fast(2)
    bench.vdc, bench.amperes[0] = 100.0, 29.0
    bench.fast()
    assert bench.controller.snapshot["faults"] == ["over-current", "dc-link voltage too low"]


def accesses(bench):
    """Register accesses of one fast interrupt that finds no fault."""
    registers = bench.controller.registers
    before = registers.accesses
    bench.fast()
    return registers.accesses - before


def plant_event(bench, access):
    """The next fast event arrives just before this access of the next interrupt."""
    registers = bench.controller.registers
    registers.event_at = registers.accesses + access
    bench.fast()
    assert registers.event_at == 0  # the event did arrive


@pytest.mark.parametrize("state", POWERED)
def test_event_during_the_interrupt_is_an_overrun(bench, state):
    """An event before the first access (the acknowledge) or the last (after the check) is no
    overrun."""
    bench.run_to(state).fast(3)
    total = accesses(bench)
    for access in range(1, total + 1):
        plant_event(bench, access)
        if access in (1, total):
            assert (bench.state, bench.gates_on, bench.drive.faults) == (state, True, 0)
            bench.fast()  # it does not count as one later either
            assert (bench.state, bench.drive.faults) == (state, 0)
        else:
            assert (bench.state, bench.gates_on) == ("fault", False), access
            assert bench.drive.faults == lib.HT_FAULT_OVERRUN
            assert bench.controller.snapshot["faults"] == ["fast interrupt outlasted its period"]
            assert bench.controller.snapshot["state"] == state
            bench.controller.clear()
            bench.run_to(state).fast(3)
    assert bench.violations() == 0


def test_overrun_in_the_interrupt_that_turns_the_gates_on(bench):
    bench.run_to("build")
    plant_event(bench, 5)
    assert (bench.state, bench.gates_on) == ("fault", False)
    assert bench.drive.faults == lib.HT_FAULT_OVERRUN


def test_overrun_in_the_interrupt_that_ends_the_calibration(bench):
    """The next interrupt would turn the gates on."""
    bench.run_to("calibrate")
    bench.fast(bench.drive.calibration_ticks - bench.drive.state_ticks - 1)
    assert bench.state == "calibrate"
    plant_event(bench, 5)
    assert (bench.state, bench.gates_on) == ("fault", False)
    assert bench.drive.faults == lib.HT_FAULT_OVERRUN
    assert bench.controller.snapshot["state"] == "build"


def test_overrun_adds_to_what_the_results_show(bench):
    bench.run_to("run").fast()
    bench.drive.control.observer.psi_Wb.beta = np.nan
    plant_event(bench, 5)
    assert bench.drive.faults == lib.HT_FAULT_OVERRUN | lib.HT_FAULT_NONFINITE


@pytest.mark.parametrize("state", GATES_OFF)
def test_overrun_with_the_gates_off_does_nothing(bench, state):
    if state == "calibrate":
        bench.run_to(state).fast()
    for access in range(1, accesses(bench) + 1):
        plant_event(bench, access)
        assert (bench.state, bench.drive.faults) == (state, 0)


TBCTR_OF_EPWM1 = {"f28335": 0x6804, "f28377s": 0x4004}  # SPRUFG3 2, SPRS881 (memory map)


@pytest.mark.parametrize("load_mode", ("shadow", "immediate"))
@pytest.mark.parametrize("state", POWERED)
@pytest.mark.parametrize("device", TBCTR_OF_EPWM1)
def test_under_immediate_load_the_interrupt_ends_before_write_delay_us(device, state, load_mode):
    """What is written later than that has edges which the counter has passed. Under shadow load
    the pattern is the next period's."""
    clock_Hz = {"f28335": 150e6, "f28377s": 100e6}[device]
    bench = Bench(device, load_mode=load_mode, predict="off", write_delay_us=20.0)
    latest = round(20e-6 * clock_Hz)
    bench.run_to(state).fast(3)
    counter = TBCTR_OF_EPWM1[device]
    for counts in (0, latest // 3, latest):
        bench.words[counter] = counts
        bench.fast()
        assert (bench.state, bench.drive.faults) == (state, 0)
        if state != "test":
            us = bench.controller.channel("interrupt_us")
            assert us == pytest.approx(counts / clock_Hz * 1e6, rel=1e-6)
    bench.words[counter] = latest + 1
    bench.fast()
    if load_mode == "shadow":
        assert (bench.state, bench.drive.faults) == (state, 0)
    else:
        assert (bench.state, bench.gates_on) == ("fault", False)
        assert bench.drive.faults == lib.HT_FAULT_OVERRUN


def test_the_flux_reference_is_reduced_at_standstill_under_load(bench):
    """With adaptation and load, and a mean flux speed below 2.5 rad/s, the flux reference goes to
    92 %, over the ramp. It returns above 4.5 rad/s, without load, or without adaptation."""
    bench.controller.set("control_mode", "torque")
    bench.controller.set("torque_ref_Nm", 12.0)
    bench.run_to("run")

    def settled(omega):
        bench.fast()  # takes new parameters over
        for _ in range(300):
            bench.drive.control.observer.omega_sync_rad_s = omega
            bench.slow()
        return bench.drive.flux_ref_Wb

    full = pytest.approx(0.6, rel=1e-5)
    less = pytest.approx(0.552, rel=1e-5)
    assert settled(0.0) == less
    assert settled(-4.0) == less  # hysteresis
    assert settled(-6.0) == full
    assert settled(-4.0) == full
    assert settled(2.0) == less
    bench.controller.set("torque_ref_Nm", 0.5)
    assert settled(2.0) == full
    bench.controller.set("torque_ref_Nm", -12.0)
    assert settled(2.0) == less
    bench.controller.set("adapt_s", 0.0)
    assert settled(2.0) == full


def test_a_higher_flux_reference_is_approached_by_a_ramp(bench):
    """As fast as in the build-up, which takes eight slow periods here."""
    bench.controller.set("build_s", 0.08)
    bench.run_to("run")
    for wanted in (0.9, 0.4):
        before = bench.drive.flux_ref_Wb
        bench.controller.set("flux_ref_Wb", wanted)
        bench.fast()
        steps = []
        for _ in range(15):
            bench.slow()
            steps.append(bench.drive.flux_ref_Wb)
        largest = max(before, wanted) / 8
        assert np.all(np.abs(np.diff([before, *steps])) <= 1.001 * largest)
        assert abs(steps[0] - before) == pytest.approx(largest, rel=1e-4)
        assert steps[-1] == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("angle_deg", range(0, 360, 20))
def test_field_weakening_leaves_the_voltage_that_the_current_takes(bench, angle_deg):
    """psi = (reach Vdc - R_s |i|) / omega; the current's size is right within 4 %."""
    bench.controller.set("field_weakening", "on")
    bench.controller.set("sigma_ls_H", 0.05)  # with less this current could not change the flux so
    bench.run_to("run").fast()
    drive, angle = bench.drive, np.deg2rad(angle_deg)
    drive.control.observer.i_A = [8.0 * np.cos(angle), 8.0 * np.sin(angle)]
    drive.control.observer.omega_sync_rad_s = omega = 400.0
    bench.slow()
    flux = drive.config.flux
    wanted = (flux.reach_pu * bench.vdc - flux.rs_ohm * 8.0) / omega
    assert flux.flux_min_Wb < wanted < 0.6
    off = 0.04 * flux.rs_ohm * 8.0 / omega + 1e-3 * wanted  # and the converter's resolution
    assert drive.flux_ref_Wb == pytest.approx(wanted, abs=off)


@pytest.mark.parametrize("sign", (1, -1))
@pytest.mark.parametrize("share", (1.1, 0.97, 0.8, 0.0, -0.5))
def test_a_step_of_the_torque_does_not_raise_a_weakened_flux(bench, sign, share):
    """While the torque falls, the flux turns more slowly than the shaft, or back. A machine that
    brakes has a slip of 5 % at most: what is slower than that passes at once, and the flux that it
    would let be needs more voltage afterwards than there is."""
    bench.controller.set("field_weakening", "on")
    bench.controller.set("sigma_ls_H", 0.05)
    bench.run_to("run").fast()
    count(bench, sign * 2000.0)
    drive, shaft = bench.drive, sign * 2 * 2000 * np.pi / 30
    drive.control.observer.i_A = [0.0, 0.0]
    drive.control.observer.omega_sync_rad_s = share * shaft
    bench.slow()
    assert drive.speed_rpm == pytest.approx(sign * 2000, rel=0.005)
    wanted = drive.config.flux.reach_pu * bench.vdc / (abs(shaft) * max(0.95, abs(share)))
    assert 0.1 < wanted < 0.6
    assert drive.flux_ref_Wb == pytest.approx(wanted, rel=0.01)


# --- a shaft that is caught ----------------------------------------------------------------


@pytest.mark.parametrize(("share", "check_rpm", "found"), [(1.4, 150, 0), (1.6, 150, 1), (9, 0, 0)])
@pytest.mark.parametrize("sign", (1, -1))
def test_current_across_the_flux_of_a_caught_shaft_is_an_encoder_fault(
    bench, sign, share, check_rpm, found
):
    """Without slip there is none. share: of the no-load current."""
    bench.controller.set("encoder_trip_rpm", check_rpm)
    bench.run_to("build")
    drive, cfg = bench.drive, bench.drive.config.protect
    drive.catches = 1
    across_A = sign * share * cfg.no_load_A
    leak_Wb = cfg.sigma * cfg.ls_H * across_A
    observer = drive.control.observer
    for _ in range(2000):  # the low pass follows
        drive.control.estimate.psi_Wb = observer.psi_Wb = [0.6, leak_Wb]
        observer.i_A = [0.0, across_A]
        bench.slow()
    assert drive.slow_faults == found * lib.HT_FAULT_ENCODER


# --- no fast interrupt any more -----------------------------------------------------------


def slow_alone(bench):
    lib.ht_drive_slow_isr(bench.drive)


@pytest.mark.parametrize(
    "state", [s.name for s in firmware.STATE_TABLE if s.name != firmware.FAULT]
)
def test_a_lost_fast_interrupt_turns_the_gates_off(bench, state):
    """Two slow interrupts come without a fast one in between. The second one takes the gates off
    and leaves the cause and a snapshot."""
    if state == firmware.TEST:
        bench.controller.set("start_mode", "test")
    bench.fast()
    if state != firmware.IDLE:
        bench.run_to(state)
    slow_alone(bench)
    assert bench.state == state
    slow_alone(bench)
    assert bench.state == "fault"
    assert not bench.gates_on
    assert bench.controller.faults == ["fast interrupt lost"]
    snapshot = bench.controller.snapshot
    assert (snapshot["state"], snapshot["tick"]) == (state, bench.drive.tick)
    with pytest.raises(FirmwareError, match="not allowed in state fault"):
        bench.controller.start()
    # cleared, but still lost: gates off, and the fault again
    bench.controller.clear()
    slow_alone(bench)
    assert bench.controller.faults == ["fast interrupt lost"]
    # it has returned, so a clear lasts
    bench.fast()
    assert not bench.gates_on
    bench.controller.clear()
    bench.fast()
    slow_alone(bench)
    assert bench.state == "idle"
    assert bench.violations() == 0


def test_one_fast_interrupt_between_two_slow_ones_is_enough(bench):
    bench.run_to("run")
    for _ in range(20):
        bench.fast()
        slow_alone(bench)
    assert bench.state == "run"


def test_parameters_do_not_wait_for_a_lost_interrupt(bench):
    bench.run_to("run")
    slow_alone(bench)
    bench.controller.set("i_trip_A", 3.0)
    assert bench.drive.staged != ffi.NULL
    slow_alone(bench)
    assert bench.drive.staged == ffi.NULL
    assert bench.drive.config.params.v[parameters()["i_trip_A"].id] == 3.0


def test_speed_is_measured_without_the_fast_interrupt(bench):
    """When the interrupt returns, a start with a turning shaft must be refused."""
    bench.run_to("run")
    slow_alone(bench)
    slow_alone(bench)
    words, address = bench.words, QPOSCNT[bench.device]
    for _ in range(3):
        words[address] += round(300 / 60 * 8192 / 100)
        slow_alone(bench)
    assert bench.drive.speed_rpm == pytest.approx(300, rel=0.02)


def test_slow_interrupt_at_the_rate_of_the_fast_one_is_refused(bench):
    """If an interrupt came a little late, no fast one would lie between two slow ones."""
    with pytest.raises(FirmwareError, match="do not fit together"):
        bench.controller.set_many({"f_isr_Hz": 1000.0, "f_slow_Hz": 1000.0})


def test_wrong_clock_cannot_be_cleared(bench):
    lib.ht_drive_stand_in(bench.drive, lib.HT_FAULT_CLOCK)
    assert bench.controller.faults == ["system clock wrong"]
    with pytest.raises(FirmwareError, match="not allowed in state fault"):
        bench.controller.clear()
    with pytest.raises(FirmwareError, match="not allowed in state fault"):
        bench.controller.start()
    bench.fast()
    assert bench.state == "fault"
    assert not bench.gates_on


# --- without a leg ----------------------------------------------------------------

RIDE = {
    "scheme": "db-dtfc", "ride_through": "least-loss", "i_rated_A": 5.0, "sigma_ls_H": 0.025,
    "lxy_H": 0.01,
}  # fmt: skip
PHASE_LOST = 0x8000


def off(bench):
    """The legs whose gates are off, a state word."""
    base, stride = TZFLG[bench.device]
    return sum(32 >> leg for leg in range(6) if int(bench.words[base + leg * stride]) & OST)


def loses(bench, leg, lower=False):
    """The next interrupt finds that the leg's upper or lower switch does not conduct."""
    losses = {n: lib.ht_leg_loss_of(n) for n in range(1, 13)}
    (found,) = [n for n, loss in losses.items() if (loss.leg, loss.lower) == (leg, lower)]
    bench.drive.control.leg_loss.found = found


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("device", ADC)
@pytest.mark.parametrize("lower", (False, True))
def test_a_lost_leg_alone_is_switched_off(device, leg, lower):
    bench = Bench(device, **RIDE).run_to("run")
    bench.fast(20)
    assert off(bench) == 0
    loses(bench, leg, lower)
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("run", 32 >> leg, 0)
    switch = lib.HT_WARNING_NO_LOWER if lower else lib.HT_WARNING_NO_UPPER
    assert bench.drive.warnings == 32 >> leg | switch
    bench.fast(200)
    bench.slow()
    assert (bench.state, off(bench)) == ("run", 32 >> leg)
    assert bench.violations() == 0


@pytest.mark.parametrize(("leg", "pair"), ((0, 33), (4, 6), (1, 24)))
def test_with_the_most_torque_the_leg_90_degrees_away_is_off_as_well(bench, leg, pair):
    """It would carry no current. But only the lost one is told."""
    bench = Bench(bench.device, **(RIDE | {"ride_through": "most-torque"})).run_to("run")
    loses(bench, leg)
    bench.fast(20)
    assert (bench.state, off(bench)) == ("run", pair)
    assert bench.drive.warnings & 63 == 32 >> leg


def test_without_ride_through_a_lost_leg_stops(bench):
    bench = Bench(bench.device, **(RIDE | {"ride_through": "off"})).run_to("run")
    loses(bench, 2)
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, PHASE_LOST)


def test_another_law_that_commands_a_voltage_goes_on_without_the_leg(bench):
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 1)
    bench.fast()
    bench.controller.set("scheme", "foc")
    bench.fast(20)
    assert (bench.state, off(bench), bench.drive.faults) == ("run", 16, 0)


def test_a_leg_that_is_lost_in_the_build_up_stops(bench):
    bench = Bench(bench.device, **RIDE).run_to("build")
    bench.fast(20)
    loses(bench, 2)
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, PHASE_LOST)


def test_a_trip_wins_over_going_on(bench):
    """Both in the same interrupt, or the trip later."""
    for later in (0, 5):
        bench = Bench(bench.device, **RIDE).run_to("run")
        loses(bench, 4)
        bench.fast(later)
        bench.amperes[0] = 29.0
        bench.fast(2)
        assert (bench.state, off(bench)) == ("fault", 63)
        bench.amperes[0] = 0.0
        bench.fast(20)
        assert off(bench) == 63


def test_a_latch_that_a_disturbance_releases_stops(bench):
    """The gates of the lost leg would be on again."""
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 3)
    bench.fast()
    base, stride = TZFLG[bench.device]
    bench.words[base + 3 * stride] &= ~np.uint16(OST)
    bench.fast(6)
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, EXTERNAL)


def test_a_trip_of_another_leg_stops(bench):
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 3)
    bench.fast()
    bench.words[TZFLG[bench.device][0]] |= OST
    bench.fast(6)
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, EXTERNAL)


def test_one_more_lost_leg_stops(bench):
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 0)
    bench.fast(5)
    loses(bench, 5)
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, PHASE_LOST)
    assert bench.drive.warnings == 0x20 | lib.HT_WARNING_NO_UPPER | lib.HT_WARNING_MORE_LOST


@pytest.mark.parametrize(("legs", "closed"), ((16, 16), (33, 33), (32 + 8, 32 + 8 + 2)))
@pytest.mark.parametrize("mode", ("drive", "test"))
def test_legs_that_are_known_to_be_lost_never_go_on(bench, legs, closed, mode):
    bench = Bench(bench.device, **(RIDE | {"lost_legs": legs, "start_mode": mode}))
    bench.controller.start()
    for _ in range(300):
        bench.fast()
        assert off(bench) & closed == closed
    assert (bench.state, off(bench)) == ("test" if mode == "test" else "run", closed)
    assert bench.drive.warnings == legs
    bench.controller.stop()
    assert off(bench) == 63
    bench.controller.set("lost_legs", 0)
    bench.controller.set("start_mode", "drive")
    bench.run_to("run")
    assert (off(bench), bench.drive.warnings) == (0, 0)


def test_another_start_after_a_loss_uses_all_legs_again(bench):
    """What was found is told and not kept."""
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 1)
    bench.fast(5)
    bench.controller.stop()
    bench.run_to("run")
    assert (off(bench), bench.drive.warnings) == (0, 0)


def test_another_scheme_takes_over_without_the_leg_and_one_without_prediction_stops(bench):
    bench = Bench(bench.device, **RIDE).run_to("run")
    loses(bench, 1)
    bench.fast()
    bench.controller.set("scheme", "dtc3")
    bench.fast(50)
    assert (bench.state, off(bench), bench.drive.faults) == ("run", 16, 0)
    bench.controller.set("predict", "off")
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, PHASE_LOST)


@pytest.mark.parametrize("changes", ({"load_mode": "immediate"}, {"predict": "off"}))
def test_without_prediction_a_lost_leg_stops(bench, changes):
    bench = Bench(bench.device, **(RIDE | {"scheme": "ddr"} | changes)).run_to("run")
    loses(bench, 1)
    bench.fast()
    assert (bench.state, off(bench), bench.drive.faults) == ("fault", 63, PHASE_LOST)


def test_one_more_lost_leg_is_named_if_it_alone_carried_no_current(bench):
    for amperes, named in ((0.1, 0x08), (1.5, 0)):
        bench = Bench(bench.device, **RIDE).run_to("run")
        loses(bench, 0)
        bench.fast(5)
        loses(bench, 5)
        for leg, sum_A in enumerate((0.0, 20, amperes, 30, 25, 15)):
            bench.drive.control.leg_loss.leg[leg].sum_A = sum_A
        if not named:
            bench.drive.control.leg_loss.leg[4].sum_A = 2.0
        bench.fast()
        expected = 0x20 | lib.HT_WARNING_NO_UPPER | lib.HT_WARNING_MORE_LOST | named
        assert bench.drive.warnings == expected


def settled(bench):
    """Flux reference and torque limit after many slow interrupts, and on the way there."""
    way = []
    for _ in range(200):
        bench.slow()
        bench.follow_flux()
        way.append((bench.drive.flux_ref_Wb, bench.drive.torque_limit_Nm))
    return np.array(way)


@pytest.mark.parametrize(("rated_A", "flux_ref_Wb"), ((1.5, 0.6), (4.0, 0.6), (4.0, 0.1)))
def test_flux_and_torque_of_a_drive_without_a_leg(rated_A, flux_ref_Wb):
    """Flux: no more than what gives the most torque with the currents that are left. Torque: what
    the currents allow at this flux, or all that is asked for. While a larger flux goes down, the
    torque is not lower than in the end."""
    values = RIDE | {"i_rated_A": rated_A, "flux_ref_Wb": flux_ref_Wb, "flux_min_Wb": 0.05}
    bench = Bench(**values).run_to("run")
    before = settled(bench)[-1]
    assert before[0] == pytest.approx(flux_ref_Wb, rel=1e-5)
    loses(bench, 0)
    bench.fast()
    config, lost = ffi.addressof(bench.drive.config.derating), bench.drive.control.lost
    i_A = lib.ht_derated_A([lost], config.rated_A)
    flux = min(flux_ref_Wb, lib.ht_derated_Wb(config, i_A))
    assert (flux < flux_ref_Wb) == (rated_A < 2.0)
    torque = min(before[1], lib.ht_derated_Nm(config, i_A, flux))
    assert (torque < before[1]) == (flux_ref_Wb > 0.5)
    way = settled(bench)
    assert way[-1] == pytest.approx((flux, torque), rel=1e-4)
    assert way[:, 1].min() > 0.999 * torque


# --- the state test ---------------------------------------------------------------


@pytest.fixture(params=ADC)
def testing(request):
    """In the state test, its gates not yet on."""
    return Bench(request.param, start_mode="test", test_s=0.02).run_to("test")


@pytest.mark.parametrize("tick", (2, 50, 190))
def test_an_external_trip_ends_a_test(testing, tick):
    testing.fast(tick)
    assert testing.gates_on
    testing.trip_from_outside()
    testing.fast()
    assert (testing.state, testing.gates_on, testing.drive.faults) == ("fault", False, EXTERNAL)


def test_a_test_does_not_begin_with_the_trip_pin_low(testing):
    """The pin is looked at before the gates go on."""
    testing.controller.set_trip_pin(0)
    for _ in range(3):
        testing.fast()
        assert not testing.gates_on
    assert (testing.state, testing.drive.faults) == ("fault", EXTERNAL)


def test_an_interrupt_that_outlasts_its_period_ends_a_test(testing):
    for tick in (0, 3):
        testing.fast(tick)
        plant_event(testing, 5)
        assert (testing.state, testing.gates_on) == ("fault", False)
        assert testing.drive.faults == lib.HT_FAULT_OVERRUN
        testing.controller.clear()
        testing.run_to("test")
    testing.fast(3)
    assert (testing.state, testing.gates_on) == ("test", True)


# --- magnets --------------------------------------------------------------------

PSI_F = 0.15
MAGNET = {"machine": "magnet", "psi_f_Wb": PSI_F, "rotor_start": "known", "rs_ohm": 1.8}
#: Where the magnets induce V_dc between two terminals, with two pole pairs.
CEILING_RPM = 250.0 / (np.sqrt(3) * PSI_F) / 2 * 30 / np.pi


@pytest.fixture(params=ADC)
def magnets(request):
    return lambda **more: Bench(request.param, **MAGNET | more)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("rpm", "caught"), [(40, False), (1000, True), (0.93 * CEILING_RPM, False)]
)
def test_the_shaft_of_a_known_rotor_is_caught_where_its_current_tells_something(
    magnets, sign, rpm, caught
):
    """Too slow a shaft makes too little of it, too fast a one more voltage than the link has."""
    bench = magnets()
    turn(bench, sign * rpm)
    if not caught:
        with pytest.raises(FirmwareError, match="turns"):
            bench.controller.start()
        assert bench.state == "idle"
        return
    bench.run_to("build").fast()
    assert bench.drive.catches == 1
    assert bench.gates_on


def test_the_shaft_of_an_unknown_rotor_is_not_caught(magnets):
    bench = magnets(rotor_start="align")
    turn(bench, 1000)
    with pytest.raises(FirmwareError, match="turns"):
        bench.controller.start()


@pytest.mark.parametrize("rpm", [0.93 * CEILING_RPM, 1000])
def test_a_shaft_that_begins_to_turn_after_the_start_is_judged_again(magnets, rpm):
    bench = magnets()
    bench.controller.start()
    bench.fast(3)
    turn(bench, rpm)
    while bench.state == "calibrate":
        bench.fast()
    assert bench.state == "build"
    assert bench.drive.catches == (rpm == 1000)


@pytest.mark.parametrize("rpm", [0, 1000])
def test_gates_that_the_trip_pin_keeps_off_are_an_external_trip(magnets, rpm):
    """In the period in which they are to go on: of the alignment, or of a catch."""
    bench = magnets()
    turn(bench, rpm)
    bench.run_to("build")
    bench.controller.set_trip_pin(0)
    bench.fast()
    assert (bench.state, bench.gates_on, bench.drive.faults) == ("fault", False, EXTERNAL)
    assert bench.drive.trips == 1


def caught(bench, share):
    """In RUN at this share of the ceiling: the currents are those of the shorted machine. Returns
    the electrical speed."""
    turn(bench, share * CEILING_RPM)
    bench.run_to("build")
    omega = bench.drive.speed_rpm * 2 * np.pi / 30
    machine = bench.drive.config.control.observer
    phases = np.deg2rad([0, 30, 120, 150, 240, 270])
    for _ in range(150):
        e = lib.ht_magnet_shorted(
            ffi.addressof(machine.magnet), machine.rs_ohm, omega, machine.ts_s,
            bench.drive.rotor_catch.expected_A,
        )  # fmt: skip
        axis = getattr(bench.drive, "in").axis
        i = complex(e.d, e.q) * complex(axis.alpha, axis.beta)
        bench.amperes = (i * np.exp(-1j * phases)).real
        bench.fast()
        if bench.state != "build":
            break
    assert bench.state == "run"
    return omega


@pytest.mark.parametrize(("share", "weak"), [(0.3, False), (0.85, True)])
def test_a_caught_rotor_begins_with_a_flux_that_the_voltage_turns(magnets, share, weak):
    """The magnets' own if the law makes that much of the link."""
    bench = magnets(table="45/135")
    omega = caught(bench, share)
    most_Wb = bench.drive.config.flux.reach_pu * bench.vdc / omega
    assert (most_Wb < PSI_F) == weak
    assert bench.drive.flux_ref_Wb == pytest.approx(min(most_Wb, PSI_F), rel=1e-5)


@pytest.mark.parametrize(
    ("adapt_s", "off_legs", "learns"), [(1.0, 0, 1), (0.0, 0, 0), (1.0, 32, 0)]
)
def test_the_flux_of_the_magnets_is_learnt_in_the_slow_interrupt(
    magnets, adapt_s, off_legs, learns
):
    """If a parameter says so, and with all legs."""
    bench = magnets(table="45/135", adapt_psi_f_s=adapt_s)
    omega = caught(bench, 0.3)
    observer = bench.drive.control.observer
    observer.omega_sync_rad_s = omega
    observer.gap_Wb = [0.01, -0.02]
    before = observer.more_Wb
    bench.drive.off_legs = off_legs
    bench.slow()
    assert (abs(observer.more_Wb - before) > 1e-6) == learns


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("share", [0.3, 0.85])
def test_the_torque_limit_of_magnets_is_the_largest_whose_own_flux_lets_it_be(magnets, sign, share):
    """By bisection: driving takes voltage, which leaves less flux. Braking counts on none."""
    most_Nm = 12.0
    bench = magnets(table="45/135", field_weakening="on", torque_limit_Nm=most_Nm, i_rated_A=6.0)
    caught(bench, share)
    drive = bench.drive
    c, m = drive.config, ffi.addressof(drive.config.control.observer.magnet)
    drive.torque_ref_Nm = 3.0 * sign
    bench.slow()
    i_A = lib.ht_derated_most_A(ffi.addressof(c.derating), ffi.NULL, measured(bench).vdc_V, PSI_F)
    reach_V = c.flux.reach_pu * measured(bench).vdc_V
    rs_ohm = drive.control.observer.rs_ohm
    omega = drive.control.observer.omega_sync_rad_s

    def holds(torque_Nm):
        turned_Wb = lib.ht_magnet_turned_Wb(
            reach_V, omega, rs_ohm, torque_Nm if sign > 0 else 0.0, m.torque_gain
        )
        return lib.ht_magnet_most_Nm(m, i_A, min(turned_Wb, SETUP["flux_ref_Wb"])) >= torque_Nm

    limits = np.linspace(0, most_Nm, 2001)
    largest_Nm = max(limit for limit in limits if holds(limit))
    assert drive.torque_limit_Nm == pytest.approx(largest_Nm, abs=most_Nm / 250)


@pytest.mark.parametrize("zero_deg", [-150.0, -0.5, 0.0, 40.0, 170.0])
def test_a_known_rotor_begins_at_the_angle_that_the_parameter_tells(magnets, zero_deg):
    bench = magnets(rotor_zero_deg=zero_deg, encoder_counts_rev=10000.0)
    bench.run_to("build")
    whole = bench.drive.config.alignment.counts_rev
    turned = bench.drive.rotor.electrical / whole * 360.0
    assert (turned - zero_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("rpm", [0, 1000])
def test_a_known_rotor_is_looked_up_again_at_each_start(magnets, rpm):
    """Whatever was believed while the gates were off, and of a shaft that is caught, too."""
    angles = []
    for off in (0, 1234):
        bench = magnets()
        turn(bench, rpm)
        bench.drive.rotor.electrical += off
        bench.run_to("build")
        assert bench.drive.catches == (rpm > 0)
        angles.append(bench.drive.rotor.electrical)
    assert angles[0] == angles[1]


def test_a_start_waits_four_slow_interrupts_for_an_absolute_encoder(magnets):
    """These boards read none."""
    bench = magnets(rotor_start="absolute", absolute_counts_rev=4096.0)
    bench.controller.start()
    due = round(4 * SETUP["f_isr_Hz"] / SETUP["f_slow_Hz"])
    ticks = next(n for n in range(2 * due) if bench.fast() or bench.state != "calibrate")
    assert ["absolute" in fault for fault in bench.controller.faults] == [True]
    assert ticks == pytest.approx(due, abs=2)


def test_without_weakening_the_voltage_limits_no_torque_of_magnets(magnets):
    """The parameter does, and with weakening the power that the law makes of the link."""
    limits_Nm = {}
    for weakening in ("off", "on"):
        bench = magnets(table="45/135", field_weakening=weakening, torque_limit_Nm=12.0)
        caught(bench, 0.85)
        bench.slow()
        limits_Nm[weakening] = bench.drive.torque_limit_Nm
    assert limits_Nm["off"] == 12.0
    assert limits_Nm["on"] < 9.0


@pytest.mark.parametrize("most_V", [300.0, 400.0, 0.95 * VDC_FULL])
def test_the_dc_links_comparator_trips_above_the_level_or_at_full_scale(most_V):
    """By its share of half of the range and a count."""
    bench = Bench("f28377s", vdc_max_V=most_V, comparator_above_pu=0.1)
    bench.run_to("build")
    level = int(bench.words[0x5C80 + 3 * 0x20 + 0x06])  # CMPSS4: DACHVALS, of 3.3 V
    counts = level / 4096 * 3.3 / 3.0 * 4096
    wanted = min(most_V / VDC_FULL * 4096 + 0.1 * 2048 + 1, 4096)
    assert counts == pytest.approx(wanted, abs=4)


# --- limits and ramps -----------------------------------------------------------


@pytest.mark.parametrize("volts", [150.1, 170.0, 201.0, 250.0, 318.0, 325.0, 340.0])
def test_the_dc_links_levels_limit_the_torque_in_the_fast_interrupt(volts):
    """By the law of the link, and only beyond the bands."""
    bench = Bench(vdc_low_V=200.0, vdc_high_V=320.0, vdc_band_V=10.0)
    bench.run_to("run")
    turn(bench, 500)
    bench.vdc, acts = volts, set()
    for wanted_Nm in (4.0, -4.0):
        bench.follow_flux()
        bench.drive.torque_ref_Nm = wanted_Nm
        bench.fast()
        assert bench.state == "run"
        drive, link = bench.drive, ffi.addressof(bench.drive.config.vdc)
        expected_Nm = wanted_Nm
        if not 210.0 <= volts <= 310.0:
            expected_Nm = lib.ht_vdc_torque_Nm(
                link, wanted_Nm, drive.torque_limit_Nm, drive.speed_rpm * np.pi / 30,
                drive.vdc_from_rpm * np.pi / 30, measured(bench).vdc_V,
            )  # fmt: skip
            expected_Nm = max(expected_Nm, drive.torque_least_Nm)
        assert measured(bench).torque_ref_Nm == pytest.approx(expected_Nm, abs=0.02)
        if abs(expected_Nm - wanted_Nm) > 0.1:
            acts.add(drive.vdc_acts)
        drive.vdc_acts = 0
    low, high = volts < 210.0, volts > 310.0
    assert acts == set(low * [lib.HT_LIMIT_VDC_LOW] + high * [lib.HT_LIMIT_VDC_HIGH])


@pytest.mark.parametrize("state", ["build", "run"])
def test_the_brake_opens_in_run_alone(state):
    bench = Bench(brake_open_s=0.02, brake_Nm=0.0)
    bench.run_to(state)
    opened = False
    for _ in range(20):
        bench.slow()
        opened = opened or bool(bench.drive.outputs.on & lib.HT_OUT_BRAKE)
    assert bench.state == state
    assert opened == (state == "run")


@pytest.mark.parametrize(("least_loss", "falls"), [("on", True), ("off", False)])
def test_at_light_load_the_flux_of_least_loss_is_less(least_loss, falls):
    bench = Bench(flux_least_loss=least_loss, flux_wait_s=0.05)
    bench.run_to("run")
    for _ in range(100):
        bench.fast()
        bench.follow_flux()
        bench.slow()
    assert bench.state == "run"
    assert (bench.drive.flux_ref_Wb < 0.9 * SETUP["flux_ref_Wb"]) == falls


def test_the_rotors_loss_heats_the_frame():
    """3 R_r (L_m/L_r)^2 i^2 in RUN. The current across a rotor flux psi is T/(3 P psi). It counts
    as a tenth of its reference at least, as here, where there is none."""
    bench = Bench(winding_K_W=0.4, winding_s=45.0, frame_K_W=0.25, control_mode="torque")
    bench.run_to("run").follow_flux()
    drive = bench.drive
    drive.torque_ref_Nm = 5.0
    rotor_Wb = 0.1 * SETUP["flux_ref_Wb"]
    i_A = 5.0 / (3 * SETUP["pole_pairs"] * rotor_Wb)
    before_W = drive.heat.frame_sum_W
    bench.slow()
    rotor_ohm = SETUP["rr_ohm"] * (SETUP["lm_H"] / SETUP["lr_H"]) ** 2
    found_W = drive.heat.frame_sum_W - before_W
    assert found_W == pytest.approx(3 * rotor_ohm * i_A**2, rel=0.1)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("negative_Nm", [0.0, 0.4])
def test_the_power_limit_holds_for_driving_and_for_braking(bench, sign, negative_Nm):
    """A smaller limit of the negative torque stays as it is."""
    bench.run_to("run").follow_flux()
    bench.controller.set_many({
        "control_mode": "torque", "power_limit_W": 100.0, "torque_negative_Nm": negative_Nm,
        "speed_trip_rpm": 5000.0,
    })  # fmt: skip
    for rpm, power_counts in ((10.0, False), (1500.0, True)):
        for wanted_Nm in (3.0, -3.0):
            bench.controller.set("torque_ref_Nm", wanted_Nm)
            for _ in range(3):
                turn(bench, sign * rpm)
            least_Nm = -negative_Nm or -3.0
            if power_counts:
                most_Nm = 100.0 / (bench.drive.speed_rpm * np.pi / 30 * sign)
                least_Nm = max(least_Nm, -most_Nm)
            else:
                most_Nm = 3.0
            wanted = np.clip(wanted_Nm, least_Nm, most_Nm)
            assert bench.drive.torque_ref_Nm == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("up, down", [(1000.0, 0.0), (0.0, 1000.0), (0.0, 0.0)])
def test_only_a_ramp_with_a_rate_waits(bench, up, down):
    """The shaft stands, and its torque is at the limit."""
    bench.run_to("run").follow_flux()
    bench.controller.set_many({
        "ramp_up_rpm_s": up, "ramp_down_rpm_s": down, "torque_limit_Nm": 1.0,
        "kp_speed_Nms_rad": 5.0,
    })  # fmt: skip
    bench.controller.set("speed_ref_rpm", 1000.0)
    waits = []
    for _ in range(10):
        turn(bench, 0.0)
        waits.append(bool(bench.drive.limits & lib.HT_LIMIT_RAMP))
    assert bench.drive.limits & lib.HT_LIMIT_TORQUE
    assert any(waits) == (up > 0)
    assert bench.drive.ramp.speed_rpm == 1000.0 or up > 0
    bench.drive.ramp.speed_rpm = 1000.0
    turn(bench, 0.0)
    assert bench.drive.limits == lib.HT_LIMIT_TORQUE  # it has arrived
    bench.controller.set("speed_ref_rpm", 0.0)
    turn(bench, 0.0)
    assert bench.drive.limits == lib.HT_LIMIT_TORQUE or down == 0.0  # it goes towards the shaft


# --- what R_s tells -------------------------------------------------------------

TELLING = {
    "rs_tells": "resistance", "adapt_s": 1.0, "observer": "hybrid", "winding_K_W": 0.4,
    "ride_through": "least-loss", "i_rated_A": 5.0, "loss_check": 0.009,
}  # fmt: skip


def test_r_s_tells_the_temperature_only_under_load_at_low_speed_with_all_legs(bench):
    """There the adapted R_s is exact. What it tells is counted from the first slow interrupt on."""
    bench = Bench(bench.device, **TELLING)

    def tells(state="run", omega=20.0, load_Nm=14.0, off_legs=0, low_V=0.0, share=1.1):
        d = bench.drive
        d.state = getattr(lib, f"HT_STATE_{state.upper()}")
        d.omega_mean_rad_s, d.torque_ref_Nm, d.off_legs = omega, load_Nm, off_legs
        d.flux_ramp_Wb = 0.6
        d.control.leg_loss.low_V = [low_V, 0.0]
        d.control.observer.rs_ohm = share * d.config.control.observer.rs_ohm
        d.heat.telling = 0.0
        d.tick_last = (d.tick - 1) & 0xFFFFFFFF
        lib.ht_drive_slow_isr(d)
        told = d.heat.telling > 0.0
        d.state, d.off_legs = lib.HT_STATE_IDLE, 0
        return told

    assert tells()
    assert not tells(state="build") and not tells(state="fault")
    assert not tells(omega=9.0) and not tells(omega=36.0)
    assert not tells(load_Nm=0.5)
    assert not tells(off_legs=1)
    assert not tells(low_V=200.0)  # a leg may be lost
    assert not tells(share=100.0)  # at its limit
    bench = Bench(bench.device, **TELLING | {"rs_tells": "nothing"})
    assert not tells()


def test_a_build_up_that_was_long_enough_tells_the_resistance_of_a_cold_winding(bench):
    """With R_s that is adapted and not at a limit, and if the drive has come to RUN."""
    bench = Bench(bench.device, **TELLING)

    def learns(state="run", times=1.5, share=1.1):
        d = bench.drive
        d.state = getattr(lib, f"HT_STATE_{state.upper()}")
        d.built = times * d.config.built
        d.control.observer.rs_ohm = share * d.config.control.observer.rs_ohm
        d.heat.ohm_per_K = 0.0
        d.tick_last = (d.tick - 1) & 0xFFFFFFFF
        lib.ht_drive_slow_isr(d)
        d.state = lib.HT_STATE_IDLE
        assert d.built == 0.0  # once
        return d.heat.ohm_per_K > 0.0

    assert learns()
    assert not learns(state="fault")
    assert not learns(times=0.5)
    assert not learns(share=100.0)


@pytest.mark.parametrize("more_ohm", [0.0, 40.0])
def test_looks_tell_the_mean_squares_that_the_samples_miss(bench, more_ohm):
    """By a low pass of ten looks, with the leakage inductance that is learnt."""
    bench = Bench(bench.device, **TELLING)
    bench.run_to("run")
    drive, look = bench.drive, bench.drive.look
    rng = np.random.default_rng(6)
    missed_A2 = np.zeros(6)
    for _ in range(3):
        for _ in range(200):
            bench.amperes = rng.uniform(-3, 3, 6)
            bench.fast()
            bench.follow_flux()
        assert drive.looked == 1 and bench.state == "run"
        drive.control.leg_loss.more_ohm = more_ohm
        c = drive.config.control
        circuit = ffi.new("ht_look_circuit *", {
            "machine": ffi.addressof(c.observer), "lxy_H": c.observer.lxy_H + more_ohm * 1e-4,
            "vdc_V": getattr(drive, "in").vdc_V, "period": ffi.addressof(c.period),
            "dead": ffi.addressof(c.dead),
        })  # fmt: skip
        mean_A2 = ffi.new("ht_six *")
        lib.ht_look_squares(ffi.new("ht_look *", look), circuit, mean_A2)
        begin, end = (np.array(list(look.i_A[n].p)) for n in (0, 1))
        now_A2 = np.array(list(mean_A2.p)) - (begin**2 + end**2) / 2
        missed_A2 += (now_A2 - missed_A2) / 11
        bench.slow()
        np.testing.assert_allclose(list(drive.heat.more_A2), missed_A2, rtol=1e-4, atol=1e-6)
    assert np.abs(missed_A2).max() > 1e-3


def test_a_trip_from_outside_and_by_current_at_once_is_one_trip_by_hardware(bench):
    for faults, trips in (
        (EXTERNAL | lib.HT_FAULT_OVERCURRENT, 1), (lib.HT_FAULT_OVERCURRENT, 0), (EXTERNAL, 1),
    ):  # fmt: skip
        before = bench.drive.trips
        bench.run_to("run")
        lib.ht_drive_trip(bench.drive, faults)
        assert bench.drive.trips - before == trips
        bench.fast()
        bench.controller.clear()


# --- the mean torque ---------------------------------------------------------------
# The reference is moved by the mean of what the torque lacks of it, in torque mode.

#: Time constant of the mean torque, s.
MEAN_S = 2.0


def lack(bench, lacks_Nm, times=1, omega_rad_s=100.0):
    drive = bench.drive
    for _ in range(times):
        drive.omega_mean_rad_s = drive.control.observer.omega_sync_rad_s = omega_rad_s
        drive.control.estimate.torque_Nm = measured(bench).torque_ref_Nm - lacks_Nm
        bench.slow()
        measured(bench).torque_ref_Nm = drive.torque_ref_Nm
    return drive.torque_more_Nm


@pytest.fixture
def holding(bench):
    for name, value in {"control_mode": "torque", "torque_ref_Nm": 4.0, "adapt_s": 0.0}.items():
        bench.controller.set(name, value)
    bench.controller.set("torque_mean_s", MEAN_S)
    bench.run_to("run").fast()
    return bench


@pytest.mark.parametrize("lacks_Nm", [1.0, -1.0])
def test_it_is_learnt_with_its_time_constant_and_added(holding, lacks_Nm):
    assert holding.drive.torque_more_Nm == 0
    times = round(MEAN_S * SETUP["f_slow_Hz"])
    more_Nm = lack(holding, lacks_Nm, times)
    assert more_Nm == pytest.approx((1 - np.exp(-1)) * lacks_Nm, rel=0.01)
    assert holding.drive.torque_ref_Nm == pytest.approx(4.0 + more_Nm)


def test_it_is_a_fifth_of_the_limit_at_most(holding):
    assert lack(holding, 14.0, 400) == pytest.approx(0.2 * SETUP["torque_limit_Nm"])
    assert lack(holding, -14.0, 800) == pytest.approx(-0.2 * SETUP["torque_limit_Nm"])


def test_it_fades_where_the_flux_hardly_turns(holding):
    more_Nm = lack(holding, 1.0, 200)
    times = round(MEAN_S * SETUP["f_slow_Hz"])
    assert lack(holding, 1.0, times, 4.0) == pytest.approx(np.exp(-1) * more_Nm, rel=0.01)


@pytest.mark.parametrize(
    "change",
    [
        lambda bench: bench.controller.set("control_mode", "speed"),
        lambda bench: bench.controller.set("torque_mean_s", 0.0),
        lambda bench: setattr(bench.drive, "off_legs", 32),
        lambda bench: setattr(bench.drive, "state", 0),
    ],
    ids=["speed mode", "off", "without a leg", "idle"],
)
def test_it_is_gone_where_it_does_not_belong(holding, change):
    assert lack(holding, 1.0, 200) > 0.5
    change(holding)
    holding.fast()
    assert lack(holding, 1.0) == 0
