"""Trips by hardware are counted. After some of them a start must wait, because each start may be
another short circuit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import Controller, FirmwareError, lib

#: The slow interrupt measures the time: it is late by two of its periods at most.
SLOW_HZ = (10.0, 20.0)
LATE_S = 2 / min(SLOW_HZ)
EXACT_S = 1e-3  #: sums of singles


class Bench:
    """A drive that is started and tripped, and a clock: one fast interrupt per slow one."""

    def __init__(self, **values):
        self.controller = Controller("f28377s", {"f_slow_Hz": SLOW_HZ[0], **values})
        m, words = self.controller.map, self.controller.register_words()
        for k in range(7):
            words[m.adc_result[k]] = 2048 << m.adc_shift  # no current, some voltage
        self.fast()

    @property
    def drive(self):
        return self.controller.drive

    def fast(self):
        lib.ht_virtual_period(self.drive)

    def slow(self):
        self.fast()
        lib.ht_drive_slow_isr(self.drive)

    def wait(self, seconds):
        """Returns the time that has passed."""
        period_s = 1 / self.controller.get("f_slow_Hz")
        passed_s = 0.0
        while passed_s < seconds:
            self.slow()
            passed_s += period_s
        return passed_s

    def start(self):
        before = self.controller.state, self.drive.trips, self.drive.quiet_s
        result = lib.ht_drive_start(self.drive)
        if result != lib.HT_OK:
            assert (self.controller.state, self.drive.trips, self.drive.quiet_s) == before
        return result

    def trip(self):
        self.fast()
        self.controller.set_trip_pin(0)
        self.fast()
        assert self.controller.faults == ["external trip"]
        self.controller.set_trip_pin(1)
        assert lib.ht_drive_clear(self.drive) == lib.HT_OK


WAITS = st.one_of(st.just(0.0), st.floats(0.05, 8.0))
ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("trip"), WAITS),
        st.tuples(st.just("stop"), WAITS),
        st.tuples(st.just("rate"), st.sampled_from(SLOW_HZ)),
    ),
    max_size=20,
)


@settings(max_examples=60, deadline=None)
@given(most=st.integers(0, 4), wait_s=st.floats(1.0, 6.0), actions=ACTIONS)
def test_a_start_is_refused_exactly_while_too_many_trips_are_recent(most, wait_s, actions):
    """Trips that follow each other within the time make a series. The drive starts while it has
    fewer than `restart_count`, and when the time has passed since the latest one."""
    bench = Bench(restart_count=most, restart_wait_s=wait_s)
    series, quiet_s = 0, 0.0
    for what, value in actions:
        if what == "rate":
            bench.controller.set("f_slow_Hz", value)
            continue
        quiet_s += bench.wait(value)
        if wait_s - EXACT_S <= quiet_s <= wait_s + LATE_S + EXACT_S:
            quiet_s += bench.wait(2 * LATE_S)
        series = 0 if quiet_s > wait_s else series
        told = lib.ht_drive_restart_wait(bench.drive)
        if most and series >= most:
            assert bench.start() == lib.HT_ERROR_RESTART
            left_s = wait_s - quiet_s
            assert left_s - EXACT_S <= told <= left_s + LATE_S + 2
            continue
        assert told == 0
        assert bench.start() == lib.HT_OK
        if what == "trip":
            bench.trip()
            series, quiet_s = series + 1, 0.0
        else:
            lib.ht_drive_stop(bench.drive)


def test_the_defaults_refuse_the_fourth_start_for_a_minute():
    bench = Bench()
    for _ in range(3):
        assert bench.start() == lib.HT_OK
        bench.trip()
    assert bench.start() == lib.HT_ERROR_RESTART
    assert lib.ht_drive_restart_wait(bench.drive) == 60
    bench.wait(59.5)
    assert bench.start() == lib.HT_ERROR_RESTART
    assert lib.ht_drive_restart_wait(bench.drive) == 1
    bench.wait(0.5 + LATE_S)
    assert bench.start() == lib.HT_OK


@pytest.mark.parametrize("fault", ("DC link", "commanded stop"))
def test_other_faults_and_stops_do_not_count(fault):
    bench = Bench()
    m, words = bench.controller.map, bench.controller.register_words()
    for _ in range(10):
        assert bench.start() == lib.HT_OK
        bench.fast()
        if fault == "DC link":
            words[m.adc_result[6]] = 4095 << m.adc_shift
            bench.fast()
            assert bench.controller.faults == ["dc-link voltage too high"]
            words[m.adc_result[6]] = 2048 << m.adc_shift
            assert lib.ht_drive_clear(bench.drive) == lib.HT_OK
        else:
            lib.ht_drive_stop(bench.drive)


def test_neither_a_stop_nor_a_clear_nor_another_fault_forgets_the_trips():
    bench = Bench(restart_count=1)
    assert bench.start() == lib.HT_OK
    bench.trip()
    lib.ht_drive_stop(bench.drive)
    lib.ht_drive_trip(bench.drive, 0x0002)
    assert lib.ht_drive_clear(bench.drive) == lib.HT_OK
    assert bench.start() == lib.HT_ERROR_RESTART


def test_a_trip_that_the_slow_interrupt_has_not_seen_yet_counts():
    bench = Bench(restart_count=2, restart_wait_s=1.0)
    assert bench.start() == lib.HT_OK
    bench.trip()
    bench.wait(0.9)
    assert bench.start() == lib.HT_OK
    bench.trip()
    assert bench.start() == lib.HT_ERROR_RESTART
    assert lib.ht_drive_restart_wait(bench.drive) == 1


def test_the_limit_may_be_changed_while_a_start_must_wait():
    bench = Bench(restart_count=1)
    assert bench.start() == lib.HT_OK
    bench.trip()
    with pytest.raises(FirmwareError, match="too many trips by hardware"):
        bench.controller.start()
    bench.wait(12.0)
    with pytest.raises(FirmwareError, match=r"; a start is refused for another 48 s$"):
        bench.controller.start()
    bench.controller.set("restart_count", 0)
    bench.wait(LATE_S)
    assert bench.start() == lib.HT_OK


def test_the_count_outlasts_its_overflow():
    bench = Bench(restart_count=2)
    for name in ("trips", "trips_forgotten", "trips_noticed"):
        setattr(bench.drive, name, 0xFFFF)
    for result in (lib.HT_OK, lib.HT_OK, lib.HT_ERROR_RESTART):
        assert bench.start() == result
        if result == lib.HT_OK:
            bench.trip()


def test_a_wait_that_has_passed_by_a_shorter_parameter_is_a_second_yet():
    """The slow interrupt forgets the trips; until then a start is refused."""
    bench = Bench()
    for _ in range(3):
        assert bench.start() == lib.HT_OK
        bench.trip()
    bench.wait(30.0)
    bench.controller.set("restart_wait_s", 10.0)
    bench.fast()
    assert lib.ht_drive_restart_wait(bench.drive) == 1
    bench.slow()
    assert lib.ht_drive_restart_wait(bench.drive) == 0


def test_the_quiet_time_ends_at_65535_seconds():
    bench = Bench()
    bench.drive.quiet_s = 0xFFFE
    for expected in (0xFFFF, 0xFFFF):
        bench.wait(1.05)
        assert bench.drive.quiet_s == expected


@pytest.mark.parametrize(
    ("most", "waits"), [(4, False), (3, True), (2, True), (1, True), (0, False)]
)
def test_a_limit_that_changes_counts_the_trips_that_there_were(most, waits):
    bench = Bench(restart_count=9, restart_wait_s=60.0)
    for _ in range(3):
        assert bench.start() == lib.HT_OK
        bench.trip()
    bench.controller.set("restart_count", most)
    assert bench.start() == (lib.HT_ERROR_RESTART if waits else lib.HT_OK)
