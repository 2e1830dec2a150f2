"""Thermistors: from a reading to a temperature, and to a fault where it tells none."""

import re

import numpy as np
import pytest

from hexatorque.firmware import Controller, FirmwareError, ffi, lib

FULL, END = lib.HT_ADC_FULL, lib.HT_NTC_END_COUNTS
DEVICES = ("f28335", "f28377s")
#: 10 kohm at 25 degC, as motors and modules have them.
NTC = {"ohm": 10e3, "beta": 3950.0, "pull_up": 4700.0}


def configured(ohm, beta, pull_up, readings_Hz=50.0):
    config = ffi.new("ht_ntc_config *")
    lib.ht_ntc_configure(config, ohm, beta, pull_up, readings_Hz)
    return config


def reading_of(degC, ohm, beta, pull_up):
    """Counts, not rounded, by the divider and the beta equation."""
    r = ohm * np.exp(beta * (1 / (degC + 273.15) - 1 / 298.15))
    return FULL * r / (r + pull_up)


@pytest.mark.parametrize("beta", (1000.0, 3435.0, 3950.0, 4500.0))
@pytest.mark.parametrize("ohm", (100.0, 5e3, 10e3, 1e6))
def test_temperatures_are_those_of_the_beta_equation(ohm, beta):
    for pull_up in (0.2 * ohm, ohm, 3 * ohm):
        config = configured(ohm, beta, pull_up)
        degC = np.linspace(-60, 300, 400)
        counts = reading_of(degC, ohm, beta, pull_up).astype(np.float32)
        seen = (counts >= END) & (counts <= FULL - END)
        assert seen.sum() > 50
        # A float's step in the reading, a slope of up to 90 K per unit of its logarithm.
        found = np.array([lib.ht_ntc_degC(config, float(c)) for c in counts[seen]])
        assert np.abs(found - degC[seen]).max() < 0.02


@pytest.mark.parametrize("share", (0.51, 0.72, 0.99, 1.01, 1.4, 1.9, 3.99))
def test_the_logarithm_is_exact_to_a_few_floats_wherever_the_ratio_lies(share):
    """1e-6 in the logarithm is 1e-4 K here. The ratio's float and 1/T take half of it."""
    beta, counts = 1000.0, np.arange(END, FULL - END, 97.0)
    config = configured(1e4, beta, share * 1e4)
    exact = 1 / (1 / 298.15 + np.log(share * counts / (FULL - counts)) / beta) - 273.15
    near = (exact > -20) & (exact < 40)
    assert near.sum() > 3
    found = np.array([lib.ht_ntc_degC(config, c) for c in counts[near]])
    assert np.abs(found - exact[near]).max() < 1e-4


@pytest.mark.parametrize("seed", range(5))
def test_a_higher_reading_is_a_lower_temperature_whatever_the_parameters(seed):
    """So there is no table that could be out of order. Adjacent readings may be the same float."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        ohm, pull_up = 10 ** rng.uniform(0, 6, 2)
        config = configured(ohm, rng.uniform(1000, 10000), pull_up)
        degC = np.array([lib.ht_ntc_degC(config, c) for c in range(END, FULL - END + 1)])
        assert np.isfinite(degC).all() and (degC > -273.15).all()
        assert (np.diff(degC) <= 0).all() and degC[0] > degC[-1]


def take(config, state, readings):
    return [lib.ht_ntc_take(config, state, int(r)) for r in np.atleast_1d(readings)]


@pytest.mark.parametrize(
    ("reading", "kind"),
    [(0, "SHORT"), (END - 1, "SHORT"), (FULL - 1, "OPEN"), (FULL - END + 1, "OPEN")],
)
def test_an_open_and_a_shorted_sensor_are_found_after_a_tenth_of_a_second(reading, kind):
    config, state = configured(**NTC), ffi.new("ht_ntc_state *")
    lib.ht_ntc_reset(state)
    assert not lib.ht_ntc_tells(config, state)
    take(config, state, [2000] * 3)
    before = state.degC
    found = take(config, state, [reading] * 20)
    assert found == [lib.HT_NTC_WHOLE] * 5 + [getattr(lib, f"HT_NTC_{kind}")] * 15
    assert state.degC == before, "what tells nothing moves nothing"
    # A single reading is a disturbance, and one that tells something ends the fault.
    assert take(config, state, [2000]) == [lib.HT_NTC_WHOLE]
    assert take(config, state, [reading, 2000] * 50) == [lib.HT_NTC_WHOLE] * 100


def test_readings_at_the_ends_of_what_they_may_be_tell_a_temperature():
    config, state = configured(**NTC), ffi.new("ht_ntc_state *")
    lib.ht_ntc_reset(state)
    assert take(config, state, [END] * 100) == [lib.HT_NTC_WHOLE] * 100
    assert state.degC > 155
    lib.ht_ntc_reset(state)
    assert take(config, state, [FULL - END] * 100) == [lib.HT_NTC_WHOLE] * 100
    assert lib.ht_ntc_tells(config, state) and state.degC < -20


def test_the_first_reading_counts_as_it_is_and_later_ones_through_a_low_pass():
    config, state = configured(**NTC), ffi.new("ht_ntc_state *")
    lib.ht_ntc_reset(state)
    take(config, state, [1000])
    assert state.counts == 1000
    take(config, state, [2000] * 5)  # 0.1 s: the time constant
    assert 0.58 < (state.counts - 1000) / 1000 < 0.66


class Board:
    """A drive on the register model, whose thermistors' inputs have what a test gives them."""

    def __init__(self, device, **values):
        self.c = Controller(device, values)
        self.m, self.slow = self.c.map, list(self.c.port.board.slow_channel)
        self.words = self.c.register_words()
        for address in self.m.adc_result:
            self.words[address] = lib.HT_ADC_MID << self.m.adc_shift
        self.counts = [2000, 2000]

    def convert(self):
        for k, address in enumerate(self.m.adc_slow_result):
            turn = self.m.adc_slow_select == 0xFFFF
            if turn or self.words[self.m.adc_slow_select] >> 12 == self.slow[k]:
                self.words[address] = self.counts[k] << self.m.adc_shift

    def slow_ticks(self, n):
        drive = ffi.addressof(self.c.drive, 0)
        for _ in range(n):
            for _ in range(3):
                self.convert()
                lib.ht_drive_fast_isr(drive)
            lib.ht_drive_slow_isr(drive)

    def start(self):
        """The state a slow tick after a start, with no fault of before."""
        if self.c.state == "fault":
            self.c.clear()
        self.c.start()
        self.slow_ticks(1)
        return self.c.state


BOTH = {"winding_ntc_ohm": 10e3, "sink_ntc_ohm": 5e3, "sink_ntc_K": 3435.0}


@pytest.mark.parametrize("device", DEVICES)
def test_each_input_tells_its_own_temperature(device):
    board = Board(device, **BOTH)
    board.counts = [
        round(reading_of(80.0, 10e3, 3950.0, 4700.0)), round(reading_of(40.0, 5e3, 3435.0, 4700.0))
    ]  # fmt: skip
    board.slow_ticks(1)
    assert board.c.channel("winding_degC") == board.c.channel("sink_degC") == 40.0, "ambient"
    board.slow_ticks(2)
    assert board.c.channel("winding_degC") == pytest.approx(80, abs=0.1)
    assert board.c.channel("sink_degC") == pytest.approx(40, abs=0.1)
    board.counts[1] = round(reading_of(60.0, 5e3, 3435.0, 4700.0))
    board.slow_ticks(1000)
    assert board.c.channel("winding_degC") == pytest.approx(80, abs=0.1)
    assert board.c.channel("sink_degC") == pytest.approx(60, abs=0.1)
    assert board.c.registers.violations == 0


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("n", (0, 1))
@pytest.mark.parametrize(("reading", "word"), [(0, "shorted"), (4095, "open")])
def test_a_broken_sensor_stops_a_start_by_its_name(device, n, reading, word):
    board = Board(device, **BOTH)
    board.counts[n] = reading
    board.slow_ticks(40)
    assert board.c.state == "idle"
    assert board.start() == "fault"
    place = ("winding", "heat sink")[n]
    assert board.c.faults == [f"{place}'s thermistor {word}"]
    assert board.start() == "fault"
    board.counts[n] = 2000
    board.slow_ticks(5)
    assert board.start() == "calibrate"


@pytest.mark.parametrize("device", DEVICES)
def test_without_a_sensor_nothing_is_read_and_one_alone_does_not_need_the_other(device):
    board = Board(device)
    board.counts = [0, 4095]
    accesses = []
    for values in ({}, {"winding_ntc_ohm": 10e3}):
        board.c.set_many(values)
        board.slow_ticks(2)
        before = board.c.registers.accesses
        lib.ht_drive_slow_isr(ffi.addressof(board.c.drive, 0))
        accesses.append(board.c.registers.accesses - before)
    assert accesses[1] - accesses[0] == (1 if device == "f28377s" else 3)
    one = Board(device, winding_ntc_ohm=10e3)
    one.counts = [2000, 4095]
    one.slow_ticks(60)
    one.c.start()
    one.slow_ticks(1)
    assert one.c.state == "calibrate"


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("place", ("winding", "sink"))
def test_a_sensor_of_many_times_the_pull_up_is_read_too(device, place):
    board = Board(device, **{f"{place}_ntc_ohm": 100e3, f"{place}_ntc_K": 1500.0})
    board.counts = [round(reading_of(70.0, 100e3, 1500.0, 4700.0))] * 2
    board.slow_ticks(3)
    assert board.c.channel(f"{place}_degC") == pytest.approx(70, abs=1.0)


def reading_limit(degC, ohm, beta, cold):
    """The pull-up with which this temperature reads at an end."""
    r = ohm * np.exp(beta * (1 / (degC + 273.15) - 1 / 298.15))
    ends = END / (FULL - END)
    return r * ends if cold else r / ends


@pytest.mark.parametrize(
    ("place", "ohm", "values"),
    [("winding", 10e3, {}), ("winding", 10e3, {"winding_trip_degC": 180.0}), ("sink", 1e3, {})],
)
def test_a_pull_up_out_of_range_is_refused_with_the_range_that_works(place, ohm, values):
    values = {f"{place}_ntc_ohm": ohm, "ntc_pull_up_ohm": 1e6, **values}
    with pytest.raises(FirmwareError) as error:
        Controller("f28335", values)
    found = re.search(r"allowed is (\S+) to (\S+) ohm: ", str(error.value))
    assert found and "\n" not in str(error.value), error.value
    least, most = map(float, found.groups())
    hot_degC = values.get("winding_trip_degC", 155)
    assert least == pytest.approx(reading_limit(-20, ohm, 3950, cold=True), rel=1e-3)
    assert most == pytest.approx(reading_limit(hot_degC, ohm, 3950, cold=False), rel=1e-3)
    for inside, outside in ((1.01 * least, 0.99 * least), (0.99 * most, 1.01 * most)):
        Controller("f28335", values | {"ntc_pull_up_ohm": inside})
        with pytest.raises(FirmwareError, match=f"{place}_ntc_ohm"):
            Controller("f28335", values | {"ntc_pull_up_ohm": outside})


@pytest.mark.parametrize("pull_share", [1e-25, 1e25])
def test_resistors_that_no_thermistor_has_give_a_finite_temperature(pull_share):
    """The logarithm ends after 64 halves."""
    cfg = ffi.new("ht_ntc_config *", {"pull_share": pull_share, "per_K": 1 / 3950})
    assert -273.15 < lib.ht_ntc_degC(cfg, 2048.0) < 1000
