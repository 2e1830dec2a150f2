"""Measuring by XCP: how lists are put together, when values are taken, what a line carries."""

import itertools
import struct

import pytest
from device import CHANNELS, DONE, PARAMETERS, Device
from xcp_master import (
    ACTIVE,
    CHANNELS_AT,
    CONFIG,
    DENIED,
    EV,
    MEMORY,
    MODE,
    PARAMETERS_AT,
    RANGE,
    RES,
    SEQUENCE,
    Master,
    channel,
    frame_length,
    parameter,
)

from hexatorque.firmware import ffi, lib

LISTS, ODTS, ENTRIES, ODT_ENTRIES = 8, 32, 128, 32
FAST, SLOW = 0, 1
#: Channels that any address of the table may stand for.
ALL = [CHANNELS_AT + 4 * k for k in range(len(CHANNELS))]


@pytest.fixture
def master():
    return Master(Device(session=False))


def samples(master, first, sizes):
    """(time, values) of each sample of a list, whose packets from `first` on have these numbers of
    values."""
    master.packets += master.receive()
    mine = [p for p in master.packets if first <= p[0] < first + len(sizes)]
    master.packets = [p for p in master.packets if p not in mine]
    found = []
    for k in range(0, len(mine), len(sizes)):
        rows = mine[k : k + len(sizes)]
        assert [p[0] for p in rows] == list(range(first, first + len(sizes)))
        (time,) = struct.unpack_from("<I", rows[0], 1)
        values = [struct.unpack(f"<{n}f", p[1 + 4 * (j == 0) :]) for j, (p, n) in
                  enumerate(zip(rows, sizes))]  # fmt: skip
        found.append((time, sum(values, ())))
    return found


# --- putting lists together -----------------------------------------------------------------


def test_the_slave_says_what_it_can_measure(master):
    properties, lists, events, least, key = struct.unpack("<BHHBB", master.ask("B", 0xDA))
    assert properties == 0x93  # dynamic, prescaler, time stamps, overload by an event
    assert (lists, events, least, key) == (0, 2, 0, 0)
    assert master.ask("B", 0xD9) == bytes([4, 4, 0, 0, 0x3C, 1, 0])


@pytest.mark.parametrize(("event", "name", "rate"), [
    (0, b"fast", "f_isr_Hz"), (1, b"slow", "f_slow_Hz"),
])  # fmt: skip
def test_an_event_has_name_and_period(master, event, name, rate):
    rate_Hz = master.value(parameter(rate))
    _, lists, n, cycle, unit, _ = master.ask("BBH", 0xD7, 0, event)
    assert (lists, n) == (LISTS, len(name))
    assert cycle * 10.0 ** (unit - 9) == pytest.approx(1 / rate_Hz)
    assert master.ask("BB", 0xF5, n) == name
    assert master.code("BBH", 0xD7, 0, 2) == RANGE


def allocate(master, lists=1, odts=1, entries=1):
    master.ask("B", 0xD6)
    master.ask("BBH", 0xD5, 0, lists)
    for k in range(lists):
        master.ask("BBHB", 0xD4, 0, k, odts)
    for k, j in itertools.product(range(lists), range(odts)):
        master.ask("BBHBB", 0xD3, 0, k, j, entries)


def test_memory_is_allocated_in_order(master):
    assert master.code("BBHB", 0xD4, 0, 0, 1) == SEQUENCE
    assert master.code("BBHBB", 0xD3, 0, 0, 0, 1) == SEQUENCE
    master.ask("BBH", 0xD5, 0, 2)
    assert master.code("BBHBB", 0xD3, 0, 0, 0, 1) == SEQUENCE
    master.ask("BBHB", 0xD4, 0, 0, 1)
    assert master.code("BBH", 0xD5, 0, 1) == SEQUENCE
    assert master.code("BBHB", 0xD4, 0, 0, 1) == SEQUENCE  # a list's packets come at once
    master.ask("BBHBB", 0xD3, 0, 0, 0, 1)
    assert master.code("BBHB", 0xD4, 0, 1, 1) == SEQUENCE
    assert master.code("BBHBB", 0xD3, 0, 0, 0, 1) == SEQUENCE
    master.ask("B", 0xD6)
    master.ask("BBH", 0xD5, 0, 1)


def test_no_more_is_allocated_than_there_is(master):
    assert master.code("BBH", 0xD5, 0, LISTS + 1) == MEMORY
    master.ask("BBH", 0xD5, 0, LISTS)
    assert master.code("BBH", 0xD5, 0, 1) == MEMORY
    assert master.code("BBHB", 0xD4, 0, LISTS, 1) == RANGE
    assert master.code("BBHB", 0xD4, 0, 0, ODTS + 1) == MEMORY
    master.ask("BBHB", 0xD4, 0, 0, ODTS)
    assert master.code("BBHB", 0xD4, 0, 1, 1) == MEMORY
    assert master.code("BBHBB", 0xD3, 0, 0, ODTS, 1) == RANGE
    assert master.code("BBHBB", 0xD3, 0, 0, 0, ODT_ENTRIES + 1) == RANGE
    for j in range(ENTRIES // ODT_ENTRIES):
        master.ask("BBHBB", 0xD3, 0, 0, j, ODT_ENTRIES)
    assert master.code("BBHBB", 0xD3, 0, 0, 4, 1) == MEMORY


def test_the_pointer_goes_through_one_packet(master):
    allocate(master, odts=2, entries=2)
    assert master.code("BBBBI", 0xE1, 0xFF, 4, 0, ALL[0]) == RANGE  # no pointer yet
    master.ask("BBHBB", 0xE2, 0, 0, 0, 0)
    master.ask("BBBBI", 0xE1, 0xFF, 4, 0, ALL[5])
    master.ask("BBBBI", 0xE1, 0xFF, 4, 0, parameter("rs_ohm"))
    assert master.code("BBBBI", 0xE1, 0xFF, 4, 0, ALL[0]) == RANGE
    master.ask("BBHBB", 0xE2, 0, 0, 0, 0)
    assert struct.unpack("<BBBI", master.ask("B", 0xDB)) == (0xFF, 4, 0, ALL[5])
    assert struct.unpack("<BBBI", master.ask("B", 0xDB)) == (0xFF, 4, 0, parameter("rs_ohm"))
    assert master.code("B", 0xDB) == RANGE
    master.ask("BBHBB", 0xE2, 0, 0, 1, 0)
    assert struct.unpack("<BBBI", master.ask("B", 0xDB)) == (0xFF, 0, 0, 0)  # nothing in it
    for pointer in ((0, 2, 0), (0, 0, 2), (1, 0, 0)):
        assert master.code("BBHBB", 0xE2, 0, *pointer) == RANGE


@pytest.mark.parametrize(("entry", "code"), [
    ((0, 4, 0, ALL[0]), RANGE), ((0xFF, 2, 0, ALL[0]), RANGE), ((0xFF, 8, 0, ALL[0]), RANGE),
    ((0xFF, 4, 1, ALL[0]), RANGE), ((0xFF, 4, 0, ALL[0] + 2), RANGE),
    ((0xFF, 4, 0, 0), DENIED), ((0xFF, 4, 0, ALL[-1] + 4), DENIED),
    ((0xFF, 4, 0, PARAMETERS_AT + 4 * len(PARAMETERS)), DENIED),
])  # fmt: skip
def test_only_whole_values_that_exist_are_measured(master, entry, code):
    allocate(master)
    master.ask("BBHBB", 0xE2, 0, 0, 0, 0)
    assert master.code("BBBBI", 0xE1, *entry) == code
    assert master.code("BBH", 0xDE, 1, 0) == CONFIG  # still nothing in it


@pytest.mark.parametrize(("mode", "event", "prescaler", "code"), [
    (0x02, 0, 1, MODE), (0x01, 0, 1, MODE), (0x20, 0, 1, MODE), (0x10, 2, 1, RANGE),
    (0x10, 0, 0, RANGE),
])  # fmt: skip
def test_a_mode_that_the_slave_does_not_have_is_refused(master, mode, event, prescaler, code):
    allocate(master)
    assert master.code("BBHHBB", 0xE0, mode, 0, event, prescaler, 0) == code
    assert master.code("BBHHBB", 0xE0, 0x10, 1, 0, 1, 0) == RANGE


def test_a_list_tells_its_mode(master):
    master.lists((SLOW, 7, [[ALL[0]]]), start=False)
    assert master.ask("BBH", 0xDF, 0, 0) == bytes([0x11, 0, 0, 1, 0, 7, 0])
    master.ask("BB", 0xDD, 1)
    assert master.ask("BBH", 0xDF, 0, 0)[0] == 0x50
    assert master.ask("B", 0xFD)[0] == 0x40
    assert master.code("BBH", 0xDF, 0, 1) == RANGE


def test_a_list_that_runs_is_not_changed(master):
    master.lists((FAST, 10, [[ALL[0]]]))
    assert master.code("BBHBB", 0xE2, 0, 0, 0, 0) == ACTIVE
    assert master.code("BBBBI", 0xE1, 0xFF, 4, 0, ALL[0]) == ACTIVE
    assert master.code("BBHHBB", 0xE0, 0x10, 0, 0, 1, 0) == ACTIVE


def test_a_cleared_list_has_no_values_and_does_not_start(master):
    master.lists((FAST, 10, [[ALL[0]]]))
    master.ask("BBH", 0xE3, 0, 0)
    assert master.ask("B", 0xFD)[0] == 0
    assert master.code("BBH", 0xDE, 1, 0) == CONFIG
    assert master.code("BBH", 0xE3, 0, 1) == RANGE


# --- samples --------------------------------------------------------------------------------


@pytest.mark.parametrize("prescaler", [1, 3, 255])
def test_the_fast_event_is_each_fast_interrupt(master, prescaler):
    n = 5
    master.lists((FAST, prescaler, [[channel("vdc_V")]]))
    master.device.tick(n * prescaler + 20)
    got = samples(master, 0, [1])
    assert len(got) >= n
    times = [time for time, _ in got]
    assert {b - a for a, b in itertools.pairwise(times)} == {100 * prescaler}


def test_the_slow_event_comes_once_after_each_slow_interrupt(master):
    device = master.device
    master.lists((SLOW, 2, [[channel("speed_rpm")]]))
    for _ in range(8):
        lib.ht_virtual_slow(device.controller.board)
        device.tick(10)
    got = samples(master, 0, [1])
    assert {b - a for (a, _), (b, _) in itertools.pairwise(got)} == {2000}
    assert len(got) == 4
    device.tick(100)
    assert samples(master, 0, [1]) == []


def test_a_sample_is_of_one_instant_and_equals_the_streams():
    device = Device()
    master = Master(device)
    names = ["vdc_V", "i_u1_A", "i_u2_A", "state"]
    assert device.stream(0, 3, *names).status == DONE
    device.tick(3)
    device.samples(0)
    master.lists((FAST, 1, [[channel(n) for n in names[:2]], [channel(n) for n in names[2:]]]))
    for k in range(60):
        for which in range(7):
            device.sense(which, 2048 + 3 * k + which)
        device.tick()
    device.tick(20)
    streamed = {tick: values for _, tick, values in device.samples(0)}
    got = samples(master, 0, [2, 2])
    assert len(got) >= 60
    # The first sample's tick is not told. Only one makes the values equal, at all ticks of both.
    fitting = {}
    for begin in range(min(streamed), max(streamed)):
        ticks = {begin + (time - got[0][0]) // 100: values for time, values in got}
        both = ticks.keys() & streamed.keys()
        if len(both) >= 15 and all(ticks[tick] == streamed[tick] for tick in both):
            fitting[begin] = len(both)
    assert len(fitting) == 1
    assert len({values for _, values in got}) > 50


def test_parameters_are_measured_too(master):
    master.lists((FAST, 10, [[parameter("speed_ref_rpm")]]))
    master.write(parameter("speed_ref_rpm"), 123.0)
    master.device.tick(30)
    assert samples(master, 0, [1])[-1][1] == (123.0,)


def test_the_clock_is_that_of_the_time_stamps(master):
    master.lists((FAST, 1, [[ALL[0]]]))
    master.device.tick(20)
    before = samples(master, 0, [1])[-1][0]
    (clock,) = struct.unpack("<xxxI", master.ask("B", 0xDC))
    master.device.tick(20)
    after = samples(master, 0, [1])[-1][0]
    assert before <= clock <= after
    assert after - before < 10000


def test_the_clock_follows_the_rate():
    device = Device(session=False, f_isr_Hz=12500.0, f_slow_Hz=500.0)
    master = Master(device)
    (begin,) = struct.unpack("<xxxI", master.ask("B", 0xDC))
    tick = device.now
    device.tick(10000)
    (end,) = struct.unpack("<xxxI", master.ask("B", 0xDC))
    assert end - begin == pytest.approx(80 * (device.now - tick), abs=160)


def test_no_packet_comes_before_the_answer_to_its_start_nor_after_the_one_to_its_stop(master):
    master.lists((FAST, 1, [[ALL[0]]]), start=False)
    assert master.packets == []
    for layout, values in (("BB", (0xDD, 1)), ("BB", (0xDD, 0)), ("BBH", (0xDE, 1, 0)),
                           ("BBH", (0xDE, 0, 0))):  # fmt: skip
        master.packets.clear()
        master.ask(layout, *values)
        starts = values[1] == 1
        if starts:
            assert master.packets == []
        master.packets.clear()
        master.device.tick(30)
        assert bool(master.receive()) == starts


def test_lists_start_and_stop_one_by_one_and_together(master):
    lists = [(FAST, 10, [[a]]) for a in ALL[:3]]
    assert master.lists(*lists, start=False) == [0, 1, 2]
    master.ask("BBH", 0xDE, 1, 1)
    master.device.tick(50)
    assert {p[0] for p in master.receive()} == {1}
    master.ask("BB", 0xDD, 1)
    master.device.tick(50)
    assert {p[0] for p in master.receive()} == {0, 1, 2}
    master.ask("BBH", 0xDE, 2, 2)
    master.ask("BB", 0xDD, 2)
    master.device.tick(50)
    assert {p[0] for p in master.receive()} == {0, 1}
    assert master.code("BB", 0xDD, 3) == MODE
    assert master.code("BBH", 0xDE, 3, 0) == MODE
    assert master.code("BBH", 0xDE, 1, 3) == RANGE


def test_a_start_of_all_lists_changes_nothing_behind_them(master):
    """With as many lists as there can be, their packets follow in memory."""
    allocate(master, LISTS)
    behind = master.xcp.daq.odt
    before = bytes(ffi.buffer(behind))
    for k in range(1, LISTS):
        master.ask("BBH", 0xDE, 2, k)
    assert master.code("BB", 0xDD, 1) != RES, "nothing was written into the lists"
    assert bytes(ffi.buffer(behind)) == before


def test_a_list_that_is_started_again_goes_on(master):
    first, *_ = master.lists((FAST, 10, [[ALL[0]]]))
    master.device.tick(100)
    master.ask("BBH", 0xDE, 1, 0)
    master.device.tick(100)
    times = [time for time, _ in samples(master, first, [1])]
    assert len(times) >= 19
    steps = {later - time for time, later in itertools.pairwise(times)}
    assert len(steps) == 1


def test_lists_are_gone_after_free_and_after_a_connect(master):
    for layout, *values in (("B", 0xD6), ("BB", 0xFF, 0)):
        master.lists((FAST, 1, [[ALL[0]]]))
        master.device.tick(10)
        master.ask(layout, *values)
        master.receive()
        master.device.tick(30)
        assert master.receive() == []
        assert master.code("BBH", 0xDE, 1, 0) == RANGE


# --- the line -------------------------------------------------------------------------------


def test_lists_that_the_line_does_not_carry_are_refused_and_others_go_on():
    """22 values at 10 kHz are 1 Mbyte/s, more than a serial line has."""
    master = Master(Device(session=False), serial=True)
    wide = [ALL[:22]]
    master.lists((FAST, 100, [[ALL[9]]]), (FAST, 1, wide), start=False)
    master.ask("BBH", 0xDE, 1, 0)
    assert master.code("BBH", 0xDE, 1, 1) == CONFIG
    assert master.code("BB", 0xDD, 1) == CONFIG
    master.device.tick(1000)
    assert len(samples(master, 0, [1])) >= 10
    assert master.packets == []


@pytest.mark.parametrize("serial", [False, True])
def test_the_limit_is_nine_tenths_of_the_line(serial):
    device = Device(session=False, baud=115200)
    master = Master(device, serial=serial)
    octets_per_s = device.controller.board.xcp_serial.line.octets_per_s if serial else 1250000
    n = 4
    a_sample = frame_length(1 + 4 + 4 * n, serial)
    assert a_sample == (28 if serial else 25)
    budget = octets_per_s * 0.9
    good = next(p for p in range(1, 256) if a_sample * 1e4 / p <= budget)
    for prescaler in {good, good - 1} - {0}:
        master.lists((FAST, prescaler, [ALL[:n]]), start=False)
        assert (master.code("BB", 0xDD, 1) == 0xFF) == (prescaler == good)
        master.ask("B", 0xD6)


def test_at_the_limit_of_the_line_nothing_is_lost_and_commands_are_answered():
    """One sample is 124 octets; in 12 periods the line carries 150."""
    device = Device(session=False)
    master = Master(device, serial=True)
    names = ALL[:28]
    master.lists((FAST, 12, [names]))
    for _ in range(40):
        master.read(PARAMETERS_AT, 60)
    device.tick(300)
    got = samples(master, 0, [28])
    assert {b - a for (a, _), (b, _) in itertools.pairwise(got)} == {1200}
    assert master.packets == []


def test_samples_without_room_are_told_by_an_event():
    device = Device(session=False)
    master = Master(device)
    master.lists((FAST, 1, [ALL[:10]]))
    for _ in range(200):  # the background does not come
        lib.ht_drive_fast_isr(device.drive)
        lib.ht_xcp_fast(master.xcp)
    device.tick(400)
    got = samples(master, 0, [10])
    gaps = [b - a for (a, _), (b, _) in itertools.pairwise(got)]
    assert max(gaps) > 100  # whole samples are missing, the rest is right
    assert bytes([EV, 0x06]) in master.packets
