"""Over-current and over-voltage by the F28377S's comparators: registers worked out from TI's
manual, levels from the sensors' equation, and what a short circuit or a lost load between two
samples reaches with and without them.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from hexatorque.firmware import (
    ALL_LEGS,
    FAULTS,
    WARNINGS,
    Controller,
    FirmwareError,
    lib,
    parameters,
)

BOARDS = ("f28377s", "launchxl_f28377s")
#: CMPSS1 ... 3, and the phase (u1 u2 w1 w2 v1 v2) whose pin is the positive input: ADCINA2, A4, B2.
PHASE_OF = {1: 0, 2: 4, 3: 1}
#: The dc link is at ADCIN14, the positive input of CMPSS4.
OF_VDC = 4
CMPSS, STRIDE, DACH, DACL = 0x5C80, 0x20, 0x06, 0x12
ADC = (0x0B00, 0x0B20, 0x0B01, 0x0B21, 0x0B02, 0x0B22, 0x0B03)
TZFLG, OST = 0x93, 0x0004
VDDA, V_REF, I_FULL, I_TRIP = 3.3, 3.0, 30.0, 20.0
VDC, VDC_MAX, VDC_FULL = 250.0, 400.0, 500.0
SETUP = {
    "f_isr_Hz": 10000.0, "calibration_s": 0.002, "build_s": 0.01, "i_full_A": I_FULL,
    "vdc_full_V": VDC_FULL, "i_trip_A": I_TRIP, "vdc_min_V": 150.0, "vdc_max_V": VDC_MAX,
    "i_sum_trip_A": 1000.0, "encoder_trip_rpm": 0.0, "flux_check": 0.0, "stuck_trip_A": 0.0,
    "loss_check": 0.0, "scheme": "ddr", "load_mode": "shadow",
}  # fmt: skip


def volts(amperes, offset=0.0):
    """At the pin: half of V_REF without current, from 0 to V_REF for plus and minus I_FULL."""
    return V_REF * (0.5 + offset / 4096 + amperes / (2 * I_FULL))


def link_volts(vdc_V):
    """At the pin of the dc link: from 0 to V_REF for 0 to VDC_FULL."""
    return V_REF * vdc_V / VDC_FULL


class Rig:
    """A drive whose sensors the test sets."""

    def __init__(self, device="f28377s", **values):
        self.controller = Controller(device, SETUP | values)
        self.rf = self.controller.registers
        self.legs = list(self.controller.port.leg)
        self.offset = np.zeros(6)
        self.amperes = np.zeros(6)
        self.vdc_V = VDC

    def fast(self, times=1):
        counts = 2048 + self.offset + self.amperes / I_FULL * 2048
        counts = np.append(counts, self.vdc_V / VDC_FULL * 4096)
        counts = np.clip(np.rint(counts), 0, 4095)
        for address, count in zip(ADC, counts, strict=True):
            self.rf.word[address] = int(count)
        for _ in range(times):
            lib.ht_drive_fast_isr(self.controller.drive)

    def start(self):
        assert lib.ht_drive_start(self.controller.drive) == lib.HT_OK
        self.fast(25)
        assert self.state == lib.HT_STATE_BUILD
        assert self.gates_on
        return self

    @property
    def state(self):
        return self.controller.drive.state

    @property
    def told(self):
        """The fault and the warning of the snapshot."""
        kept = self.controller.drive.snapshot
        return FAULTS[kept.faults], WARNINGS[kept.warnings] if kept.warnings else ""

    @property
    def gates_on(self):
        return not any(self.rf.word[leg + TZFLG] & OST for leg in self.legs)

    def levels(self, number):
        """Voltages of both DACs."""
        base = CMPSS + STRIDE * (number - 1)
        return [self.rf.word[base + at] / 4096 * VDDA for at in (DACL, DACH)]

    def pin(self, number, amperes, ns):
        lib.ht_regfile_analog(self.rf, number, volts(amperes), ns)

    def link(self, vdc_V, ns):
        lib.ht_regfile_analog(self.rf, OF_VDC, link_volts(vdc_V), ns)


@pytest.mark.parametrize("device", BOARDS)
def test_registers_of_the_comparators(device):
    rig = Rig(device)
    for number in range(1, 9):
        base = CMPSS + STRIDE * (number - 1)
        used = number in PHASE_OF or number == OF_VDC
        # DACs on; the low one inverted; both filters' outputs to the X-BAR
        assert rig.rf.word[base] == (0x8A08 if used else 0)
        # reference VDDA, free run
        assert rig.rf.word[base + 4] == (0x8000 if used else 0)
        for control in (0x16, 0x18):  # 15 of 20 samples, each of 10 clocks
            assert rig.rf.word[base + control] & 0x7FFF == (0x1D30 if used else 0)
            assert rig.rf.word[base + control + 1] == (9 if used else 0)
    # position 1 (high or low) of the multiplexers 0, 2, 4; position 0 (high) of multiplexer 6
    assert list(rig.rf.word[0x7A04:0x7A06]) == [0x0111, 0]
    assert list(rig.rf.word[0x7A22:0x7A24]) == [0x0055, 0]
    for leg in rig.legs:
        assert rig.rf.word[leg + 0xC0] == 0x0403  # DCBH: TRIP5, beside DCAH: TRIP4
        assert rig.rf.word[leg + 0x82] == 0x0082  # DCBEVT1, DCAEVT1: at high
        assert rig.rf.word[leg + 0xC4] == 0x0002  # not synchronised
        assert rig.rf.word[leg + 0x80] & 0x8000  # a one-shot trip
        assert rig.rf.word[leg + 0x84] >> 8 == (1 if rig.rf.gates_active_low else 2)
    assert rig.rf.violations == 0


def test_the_other_chip_has_none():
    controller = Controller("f28335", SETUP)
    assert [lib.ht_board_cmpss(controller.port.board, leg) for leg in range(7)] == [0] * 7
    assert lib.ht_port_beyond(controller.port) == 0


@pytest.mark.parametrize("device", BOARDS)
def test_a_channel_has_the_comparator_of_its_pin(device):
    """ADC-A converts channels 0, 2, 4, 6, ADC-B the others."""
    pins = {("A", 2): 1, ("A", 4): 2, ("B", 2): 3, ("A", 14): 4, ("B", 14): 4}
    board = Rig(device).controller.port.board
    for k in range(7):
        assert lib.ht_board_cmpss(board, k) == pins.get(("AB"[k % 2], board.channel[k]), 0)


def test_levels_are_above_the_softwares_in_both_directions():
    """With the offset of each sensor; a step of the DAC is 3.3 V / 4096, a count of the ADC 3.0 V /
    4096. 10 % of the sensor's range above, never less, and two steps more at the most."""
    random = np.random.default_rng(5)
    step = VDDA / 4096
    for _ in range(20):
        trip = float(random.uniform(3.0, 0.8 * I_FULL))
        rig = Rig(i_trip_A=trip)
        rig.offset = np.rint(random.uniform(-150, 150, 6))
        rig.start()
        for number, phase in PHASE_OF.items():
            low, high = rig.levels(number)
            off = rig.offset[phase]
            assert -1e-6 <= high - volts(trip + 0.1 * I_FULL, off) <= 2.5 * step
            wanted = max(volts(-trip - 0.1 * I_FULL, off), 0.0)
            assert -2.5 * step <= low - wanted <= 1e-6


def test_levels_follow_the_parameter_with_the_softwares_check():
    rig = Rig().start()
    before = rig.levels(1)
    lib.ht_drive_set(rig.controller.drive, rig.controller.parameters["i_trip_A"].id, 10.0)
    assert rig.levels(1) == before  # not before the interrupt that takes it
    rig.fast()
    assert rig.levels(1) == pytest.approx([volts(-13.0), volts(13.0)], abs=0.003)
    assert rig.rf.violations == 0


def test_a_level_that_is_no_number_is_refused():
    for bad in ("nan", "0", "1e9"):
        with pytest.raises(Exception, match="i_trip_A") as said:
            parameters("f28377s")["i_trip_A"].parse(bad)
        assert "\n" not in str(said.value)
    with pytest.raises(FirmwareError, match=r"i_trip_A = 29 A: allowed is up to .*i_full_A"):
        Rig(i_trip_A=29.0)
    rig = Rig()
    before = rig.levels(1)
    row = rig.controller.parameters["i_trip_A"]
    for bad in (float("nan"), float("inf"), -1.0):
        assert lib.ht_drive_set(rig.controller.drive, row.id, bad) == lib.HT_ERROR_VALUE
    rig.fast()
    assert rig.levels(1) == before


@pytest.mark.parametrize("number", PHASE_OF)
@pytest.mark.parametrize("sign", (1, -1))
def test_a_trip_is_named_and_told_from_the_pin(number, sign):
    rig = Rig().start()
    rig.pin(number, sign * (I_TRIP + 0.08 * I_FULL), 5000)
    assert rig.gates_on
    rig.pin(number, sign * (I_TRIP + 0.12 * I_FULL), 1000)
    assert not rig.gates_on  # no interrupt has come
    rig.pin(number, 0.0, 1000)
    rig.fast(6)
    assert rig.told == ("over-current", "found by a comparator")
    assert lib.ht_drive_clear(rig.controller.drive) == lib.HT_OK
    rig.fast(50)  # until no current flows
    rig.start()
    rig.controller.set_trip_pin(0)
    rig.fast(6)
    assert rig.told == ("external trip", "")
    assert rig.rf.violations == 0


def test_switching_noise_passes_the_filter():
    """15 samples of 50 ns: 0.75 us trips, 0.7 us does not, however often."""
    rig = Rig().start()
    for _ in range(100):
        rig.pin(1, I_FULL, 700)
        rig.pin(1, 0.0, 50)
    assert rig.gates_on
    rig.pin(1, I_FULL, 750)
    assert not rig.gates_on


def highest(rig, value, rise_per_s, at_the_pin, at_the_sample):
    """The value at which the gates go off, if it rises like this right after a sample. The next
    interrupt comes 100 us later."""
    t_ns = 0
    while rig.gates_on and t_ns < 200_000:
        t_ns += 50
        value += rise_per_s * 50e-9
        at_the_pin(value)
        if t_ns % 100_000 == 0:
            at_the_sample(value)
            rig.fast()
    return value


@pytest.mark.parametrize(
    ("comparator", "peak_A"),
    [
        (True, pytest.approx(I_TRIP + 0.1 * I_FULL + 0.75, abs=0.1)),
        (False, pytest.approx(100.0)),
    ],
)
def test_a_short_circuit_between_samples_ends_at_the_level(comparator, peak_A):
    """300 V into 0.3 mH: 1 A/us. The interrupt finds what is left to find; the comparator needs the
    way to its level and its filter's time."""
    rig = Rig().start()

    def at_the_pin(amperes):
        if comparator:
            rig.pin(1, min(amperes, 1.09 * I_FULL), 50)

    def at_the_sample(amperes):
        rig.amperes[0] = amperes

    assert highest(rig, 0.0, 300.0 / 0.3e-3, at_the_pin, at_the_sample) == peak_A


@pytest.mark.parametrize("device", BOARDS)
def test_the_page_names_the_phases_that_are_watched(device):
    board = Rig(device).controller.port.board
    names = ("u1", "u2", "w1", "w2", "v1", "v2")
    watched = [n for k, n in enumerate(names) if lib.ht_board_cmpss(board, k)]
    page = (Path(__file__).parents[3] / "docs" / "protection.md").read_text(encoding="utf-8")
    row = re.search(rf"^\| `{device}` \| (.*?) \| (.*?) \|$", page, re.M)
    assert row is not None
    assert row[1].split(", ") == watched
    assert row[2].split(", ") == [n for n in names if n not in watched]


def test_a_trip_of_before_is_forgotten_when_gates_go_on():
    rig = Rig()
    rig.pin(1, I_FULL, 1000)
    rig.pin(1, 0.0, 1000)
    assert lib.ht_port_beyond(rig.controller.port) == 1 << PHASE_OF[1]
    assert lib.ht_port_gates_on(rig.controller.port, ALL_LEGS)
    assert lib.ht_port_beyond(rig.controller.port) == 0
    assert rig.rf.violations == 0


def test_the_dc_links_level_is_above_the_softwares():
    """150 mV at the pin, 5 % of the range, is more than the errors that the page adds up (137 mV).
    Full scale is the most: a divider that reaches no further than the converter still reaches the
    level."""
    step = VDDA / 4096
    for most_V in (160.0, 333.3, VDC_MAX, 0.95 * VDC_FULL):
        rig = Rig(vdc_max_V=most_V)
        high = rig.levels(OF_VDC)[1]
        assert -1e-6 <= high - link_volts(most_V + 0.05 * VDC_FULL) <= 2.5 * step
        assert high <= V_REF + 1.5 * step


def test_the_dc_links_level_follows_the_parameter():
    rig = Rig().start()
    before = rig.levels(OF_VDC)
    lib.ht_drive_set(rig.controller.drive, rig.controller.parameters["vdc_max_V"].id, 300.0)
    assert rig.levels(OF_VDC) == before  # not before the interrupt that takes it
    rig.fast()
    assert rig.levels(OF_VDC)[1] == pytest.approx(link_volts(325.0), abs=0.003)
    assert rig.rf.violations == 0


def test_the_levels_follow_their_share():
    """A share of the range of currents, half of it of the dc link's: 0.15 is 225 mV at each pin.
    The least share is more than the errors that the page adds up."""
    rig = Rig().start()
    parameter = rig.controller.parameters["comparator_above_pu"]
    lib.ht_drive_set(rig.controller.drive, parameter.id, 0.15)
    rig.fast()
    assert rig.levels(1)[1] == pytest.approx(volts(I_TRIP) + 0.225, abs=0.003)
    assert rig.levels(1)[0] == pytest.approx(volts(-I_TRIP) - 0.225, abs=0.003)
    assert rig.levels(OF_VDC)[1] == pytest.approx(link_volts(VDC_MAX) + 0.225, abs=0.003)
    assert parameter.min * V_REF / 2 > 0.137
    assert rig.gates_on


@pytest.mark.parametrize("device", BOARDS)
@pytest.mark.parametrize("mode", ("drive", "test"))
def test_an_over_voltage_between_samples_is_named(device, mode):
    """The reading of the next interrupt is right again, so only the comparator can have found it.
    It is no short circuit: a start need not wait after it."""
    rig = Rig(device, start_mode=mode, restart_count=1)
    assert lib.ht_drive_start(rig.controller.drive) == lib.HT_OK
    rig.fast(25)
    assert rig.gates_on
    rig.link(VDC_MAX + 0.04 * VDC_FULL, 5000)
    assert rig.gates_on
    rig.link(VDC_MAX + 0.06 * VDC_FULL, 1000)
    assert not rig.gates_on  # no interrupt has come
    rig.link(VDC, 1000)
    rig.fast()
    assert rig.told == ("dc-link voltage too high", "found by a comparator")
    assert lib.ht_drive_clear(rig.controller.drive) == lib.HT_OK
    assert lib.ht_drive_start(rig.controller.drive) == lib.HT_OK
    assert rig.rf.violations == 0


def test_the_fault_names_what_has_tripped_and_nothing_of_before():
    """All subsystems share one event. A latch that a subsystem has kept from before the gates came
    on must not name its channel."""
    rig = Rig()
    rig.link(VDC_FULL, 1000)
    rig.link(VDC, 1000)
    rig.start()
    rig.pin(2, 1.2 * I_TRIP, 1000)
    rig.pin(2, 0.0, 1000)
    rig.fast()
    assert rig.told[0] == "over-current"
    assert lib.ht_port_beyond(rig.controller.port) == 1 << PHASE_OF[2]


def test_both_are_named_if_both_have_tripped():
    rig = Rig().start()
    rig.pin(3, 1.2 * I_TRIP, 1000)
    rig.link(VDC_FULL, 1000)
    rig.fast()
    assert rig.controller.drive.snapshot.faults == lib.HT_FAULT_OVERCURRENT | lib.HT_FAULT_VDC_HIGH


def test_a_dc_link_without_voltage_is_no_trip():
    """Its low comparator stands at 0 V, where an offset decides what it says."""
    rig = Rig(vdc_min_V=0.0).start()
    rig.link(0.0, 5000)
    assert rig.gates_on
    rig.vdc_V = 0.0
    rig.fast(10)
    assert rig.gates_on
    assert rig.state == lib.HT_STATE_BUILD


def test_a_dc_link_above_its_level_lets_no_gate_go_on():
    """Its filter's output stays high, so the latch that the start releases is set at once."""
    rig = Rig()
    assert lib.ht_drive_start(rig.controller.drive) == lib.HT_OK
    rig.fast(10)
    rig.link(VDC_FULL, 1000)
    rig.fast(15)
    assert not rig.gates_on
    rig.fast()
    assert rig.told[0] == "dc-link voltage too high"


@pytest.mark.parametrize(
    ("comparator", "peak_V"),
    [
        (True, pytest.approx(VDC_MAX + 0.05 * VDC_FULL + 0.5 * 0.75, abs=0.3)),
        (False, pytest.approx(449.0)),
    ],
)
def test_a_lost_load_between_samples_ends_at_the_level(comparator, peak_V):
    """10 A into 20 uF: 0.5 V/us."""
    rig = Rig().start()

    def at_the_pin(vdc_V):
        if comparator:
            rig.link(vdc_V, 50)

    def at_the_sample(vdc_V):
        rig.vdc_V = vdc_V

    assert highest(rig, 399.0, 10.0 / 20e-6, at_the_pin, at_the_sample) == peak_V
