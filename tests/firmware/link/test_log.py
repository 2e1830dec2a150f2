"""What a drive remembers: events with the right causes, counters that survive power-off, written
with the gates off only. (Power that fails within a write, damage and wear: tests/c/test_log.c.)"""

import struct
import zlib

import numpy as np
import pytest
from device import (
    CLEAR,
    DONE,
    FORGET_LOG,
    ID,
    LENGTH,
    LIST,
    SESSION,
    START,
    STATE,
    STOP,
    STORE,
    Device,
)

from hexatorque import firmware
from hexatorque.firmware import MemoryStore, ffi, lib
from hexatorque.serial import wire

ROWS = [lib.ht_fault_describe(row) for row in range(lib.ht_fault_count())]
FAULTS = {ffi.string(row.name).decode(): row.bit for row in ROWS}
#: Fast interrupts in which everything that waits is written, and the memory is read at a start.
SETTLE = 400


class Watched(MemoryStore):
    """Notes the state of the drive at each write."""

    device = None

    def __init__(self, areas=None):
        super().__init__(areas)
        self.states = set()
        self.erases = self.blocks = 0

    def put(self, begin, raw):
        assert begin >= self.LOG, "the parameters' areas are not the log's"
        if self.device:
            self.states.add(self.device.state)
            assert self.device.gates_off
        self.erases += len(raw) > self.BLOCK
        self.blocks += len(raw) == self.BLOCK
        return super().put(begin, raw)


def board(areas=None, **more):
    store = Watched(areas)
    device = Device(store=store, **more)
    store.device = device
    device.tick(SETTLE)
    return device


def again(device):
    """The same memory after a power-off."""
    return board(device.controller.store.areas)


def counters(device):
    payload = device.done(LIST, "BH", wire.COUNTERS, 0).payload
    return wire.parse_counters(payload, len(FAULTS))


def events(device):
    count = counters(device).events
    return [
        wire.parse_event(device.done(LIST, "BH", wire.EVENTS, row).payload, row)
        for row in range(count)
    ]


def trip(device, bits):
    lib.ht_drive_trip(device.drive, bits)
    device.tick(SETTLE)


def clear(device):
    assert device.ask(CLEAR).status == DONE


def test_the_first_event_tells_why_the_board_started():
    device = board()
    (first,) = events(device)
    assert (first.event, first.sequence) == (lib.HT_EVENT_START, 1)
    assert firmware.reset_cause(first.reset) == "power-on"
    later = again(device)
    assert [one.sequence for one in events(later)] == [2, 1]


@pytest.mark.parametrize("name", [n for n in FAULTS if n != "system clock wrong"])
def test_each_trip_is_there_with_its_cause_after_a_power_off(name):
    device = board()
    device.drive.speed_rpm = 321.0
    device.sense(6, 3000)
    device.tick(2)
    vdc = device.channel("vdc_V")
    trip(device, FAULTS[name])
    after = again(device)
    latest = events(after)[1]  # before it the present start
    assert latest.event == lib.HT_EVENT_TRIP
    assert latest.faults == FAULTS[name]
    assert latest.vdc_V == np.float32(vdc)
    assert latest.state == lib.HT_STATE_IDLE
    trips = dict(zip(FAULTS, counters(after).trips))
    assert trips == {other: int(other == name) for other in FAULTS}
    assert counters(after).vdc_V >= np.float32(vdc)


def test_with_a_wrong_clock_nothing_is_written():
    """The flash is timed by it."""
    device = board()
    before = bytes(device.controller.store.areas)
    trip(device, FAULTS["system clock wrong"])
    assert bytes(device.controller.store.areas) == before
    assert events(device)[0].faults == FAULTS["system clock wrong"]


def test_a_run_is_counted_and_written_after_it():
    device = board()
    assert device.ask(START).status == DONE
    for _ in range(400):
        device.tick(100)
        device.ask(wire.Op.STATUS)  # or the watchdog stops it
    assert device.state == "run"
    rate = device.controller.number("f_isr_Hz")
    ticks = device.now
    device.controller.store.states.clear()
    lib.ht_drive_trip(device.drive, FAULTS["over-current"])
    device.tick(SETTLE)
    assert device.controller.store.states == {"fault"}
    after = again(device)
    kept = counters(after)
    assert kept.starts == 1
    assert kept.powered_s == pytest.approx(ticks / rate, abs=1.0)
    assert 0 < kept.gates_s <= kept.powered_s and kept.gates_s >= kept.powered_s - 1.5
    found = events(after)[1]
    assert firmware.STATES[found.state] == "run" and found.faults == FAULTS["over-current"]


def test_nothing_is_written_or_read_in_the_flash_while_the_drive_is_at_work():
    device = board()
    trip(device, FAULTS["external trip"])
    clear(device)
    assert device.ask(START).status == DONE
    store = device.controller.store
    store.states.clear()
    blocks = store.blocks
    device.drive.warnings |= 0x0001
    device.tick(150)
    assert device.state == "run"
    assert store.blocks == blocks
    # The warning waits in RAM and can be read; what is in the flash cannot, for now.
    latest = wire.parse_event(device.done(LIST, "BH", wire.EVENTS, 0).payload, 0)
    assert (latest.event, latest.warnings) == (lib.HT_EVENT_WARNING, 1)
    assert device.ask(LIST, struct.pack("<BH", wire.EVENTS, 1)).status == STATE
    device.tick(50)
    assert counters(device).events == 3  # once in a run
    device.done(STOP)
    device.tick(SETTLE)
    assert [one.event for one in events(again(device))[1:]] == [
        lib.HT_EVENT_WARNING, lib.HT_EVENT_TRIP, lib.HT_EVENT_START,
    ]  # fmt: skip


def test_a_trip_is_counted_even_if_the_power_fails_right_after_its_event():
    device = board()
    lib.ht_drive_trip(device.drive, FAULTS["over-current"])
    store = device.controller.store
    blocks = store.blocks
    while store.blocks < blocks + 4:  # the event, and not yet the count
        lib.ht_service_turn(ffi.addressof(device.service))
    for areas in (store.areas, bytearray(store.areas)):
        assert dict(zip(FAULTS, counters(board(bytearray(areas))).trips))["over-current"] == 1


def test_trips_without_end_do_not_wear_the_memory():
    """As many as there are tokens are written; the others are counted."""
    device = board()
    store = device.controller.store
    many = 150
    for _ in range(many):
        trip(device, FAULTS["over-current"])
        clear(device)
    found = counters(device)
    assert dict(zip(FAULTS, found.trips))["over-current"] == many
    assert found.missed == many + 1 - 64  # the start took one
    device.session = 0
    device.tick(13000)  # the session ends, and the area may change
    assert store.erases <= 1
    assert store.blocks <= 4 * (2 * 64 + 70 * (store.erases + 1))
    device.tick(620000)  # a minute: another token
    after = counters(again(device))
    assert dict(zip(FAULTS, after.trips))["over-current"] == many


def test_emptied_it_keeps_its_counters():
    device = board()
    trip(device, FAULTS["over-current"])
    assert device.ask(FORGET_LOG).status == DONE  # in fault: the gates are off
    device.tick(SETTLE)
    (only,) = events(device)
    assert only.event == lib.HT_EVENT_FORGOTTEN
    after = again(device)
    assert [one.event for one in events(after)] == [lib.HT_EVENT_START, lib.HT_EVENT_FORGOTTEN]
    assert dict(zip(FAULTS, counters(after).trips))["over-current"] == 1


def test_what_is_refused():
    device = board()
    assert device.ask(LIST, struct.pack("<BH", wire.COUNTERS, 1)).status == ID
    assert device.ask(LIST, struct.pack("<BH", wire.EVENTS, counters(device).events)).status == ID
    assert device.ask(FORGET_LOG, b"\0").status == LENGTH
    assert device.ask(FORGET_LOG, session=1).status == SESSION
    assert device.ask(START).status == DONE
    device.tick(20)
    assert device.ask(FORGET_LOG).status == STATE


def test_a_board_without_a_log_has_no_counters_and_no_events():
    device = Device()
    device.service.setup.log = ffi.NULL
    for kind in (wire.COUNTERS, wire.EVENTS):
        assert device.ask(LIST, struct.pack("<BH", kind, 0)).status == ID
    assert device.ask(FORGET_LOG).status == STORE


def test_without_a_memory_the_latest_events_are_there_until_the_power_goes():
    device = Device()
    device.tick(SETTLE)
    for _ in range(12):
        trip(device, FAULTS["over-current"])
        clear(device)
    found = counters(device)
    assert not found.kept and found.events == 8 and found.missed == 0
    assert [one.sequence for one in events(device)] == list(range(13, 5, -1))


def test_an_erase_waits_until_no_client_is_there():
    """It would miss its answers: on a chip it takes up to seconds."""
    areas = bytearray(b"\xff" * MemoryStore.SIZE)
    areas[MemoryStore.LOG + MemoryStore.LOG_AREA - 1] = 0  # no log, and not blank
    device = board(areas)
    store = device.controller.store
    trip(device, FAULTS["over-current"])
    assert store.erases == store.blocks == 0
    assert counters(device).events == 2  # waiting
    device.session = 0
    device.tick(12000)  # the session ends
    assert store.erases == 1 and store.blocks > 0
    assert [one.event for one in events(device)] == [lib.HT_EVENT_TRIP, lib.HT_EVENT_START]


def later(device, seconds):
    """So much time passes between two turns of the background."""
    device.drive.tick += round(seconds * device.controller.number("f_isr_Hz"))
    device.tick(SETTLE)


def test_time_is_counted_however_late_a_turn_comes_and_written_once_an_hour():
    device = board()
    store, blocks = device.controller.store, device.controller.store.blocks
    later(device, 3)
    assert counters(device).powered_s == 3
    later(device, 3590)
    assert store.blocks == blocks
    later(device, 10)
    assert store.blocks == blocks + 4  # a record
    later(device, 10)
    assert store.blocks == blocks + 4
    kept = counters(again(device))
    assert kept.powered_s == 3603 and (kept.starts, kept.gates_s) == (0, 0)


def test_tokens_come_once_a_minute_and_after_a_power_off_none_at_once():
    """An event takes one, and the counts of trips follow it. After the power-off an hour is behind
    the clock. So late a turn ends the session."""
    old = board()
    later(old, 3700)
    device = again(old)
    for _ in range(80):
        trip(device, FAULTS["over-current"])
        clear(device)
    assert counters(device).missed == 80 + 1 - 64  # the start took one
    later(device, 90)
    trip(device, FAULTS["over-current"])
    assert counters(device).missed == 81 - 64  # there was one
    assert lib.ht_drive_clear(device.drive) == lib.HT_OK
    device.tick(2)
    trip(device, FAULTS["over-current"])
    assert counters(device).missed == 82 - 64


def test_a_start_that_trips_before_the_background_looks_is_counted():
    device = board()
    assert lib.ht_drive_start(device.drive) == lib.HT_OK
    lib.ht_virtual_period(device.drive)
    assert device.state == "calibrate"
    lib.ht_drive_trip(device.drive, FAULTS["over-current"])
    device.tick(SETTLE)
    assert counters(device).starts == 1
    assert firmware.STATES[events(device)[0].state] == "calibrate"


def test_a_temperature_that_nothing_tells_is_absent():
    device = board()
    device.tick(SETTLE)
    (first,) = events(device)
    assert np.isnan([first.winding_degC, first.device_degC, first.sink_degC]).all()
    assert counters(device).winding_degC == 0
    told = board(winding_K_W=0.4)
    told.tick(SETTLE)
    assert counters(told).winding_degC == told.controller.number("ambient_degC") > 0


#: Each temperature of an event, and what tells it.
TOLD = {
    "winding_degC": {"winding_K_W": 0.4},
    "device_degC": {"device_K_W": 0.5},
    "sink_degC": {"sink_ntc_ohm": 10e3},
}


def warm(device, winding_degC, device_degC, counts):
    """The models have these temperatures, and the heat sink's input this reading."""
    ambient_degC = device.controller.number("ambient_degC")
    sink_degC = device.channel("sink_degC")
    device.drive.heat.rise_K = [0.5 * (winding_degC - ambient_degC)] * 5 + [
        winding_degC - ambient_degC
    ]
    device.drive.device_heat.rise_K = [device_degC - sink_degC] + [0.0] * 5
    m = device.controller.map
    for address in m.adc_slow_result:
        device.controller.register_words()[address] = counts << m.adc_shift


@pytest.mark.parametrize("told", [(name,) for name in TOLD] + [tuple(TOLD)])
def test_an_event_has_the_temperatures_that_are_told(told):
    """After a power-off too, and within the quarter of a kelvin that rounding takes."""
    device = board(**{k: v for name in told for k, v in TOLD[name].items()}, device_s=10.0)
    for _ in range(100):  # the sensors' low pass has settled
        warm(device, 93.3, 104.6, 1500)
        device.tick()
        lib.ht_drive_slow_isr(device.drive)
    expected = {name: device.channel(name) for name in told}
    trip(device, FAULTS["over-current"])
    for latest in (events(device)[0], events(again(device))[1]):
        assert latest.faults == FAULTS["over-current"]
        for name in TOLD:
            found = getattr(latest, name)
            assert np.isnan(found) if name not in told else abs(found - expected[name]) <= 0.26
    if len(told) == 3:
        assert expected["sink_degC"] > 50 and len({round(v) for v in expected.values()}) == 3


@pytest.mark.parametrize(("degC", "said"), [(-99.8, -100), (299.4, 299.5), (5e3, 411)])
def test_a_temperature_beyond_what_an_event_holds_is_the_nearest_one(degC, said):
    device = board(winding_K_W=0.4)
    device.drive.heat.rise_K = [degC - device.controller.number("ambient_degC")] * 6
    trip(device, FAULTS["over-current"])
    assert events(device)[0].winding_degC == said


def sealed(words: bytes) -> bytes:
    """A slot of the memory: its words, and their CRC."""
    return words.ljust(60, b"\0") + struct.pack("<I", zlib.crc32(words.ljust(60, b"\0")))


def test_events_of_an_earlier_firmware_are_read():
    """The winding's temperature was a float, and there was no other."""
    old = struct.pack(
        "<BBBBIIIIHHf6fff", lib.HT_EVENT_TRIP, 3, 4, 1, 17, 7000, 3600, FAULTS["over-current"], 0,
        0, 311.0, *(1.5, -1.5, 2.5, -2.5, 0.5, -0.5), -1450.0, 94.6,
    )  # fmt: skip
    areas = bytearray(b"\xff" * MemoryStore.SIZE)
    areas[MemoryStore.LOG : MemoryStore.LOG + 128] = sealed(struct.pack("<HHI", 0xFFFE, 1, 1)) + (
        sealed(old)
    )
    device = again(board(areas, winding_K_W=0.4))
    *new, latest = events(device)
    assert [one.sequence for one in (*new, latest)] == [19, 18, 17]
    assert latest.reset == 1 and latest.scheme == 4 and latest.speed_rpm == -1450
    assert latest.winding_degC == np.float32(94.6)
    assert np.isnan([latest.device_degC, latest.sink_degC]).all()
    assert counters(device).powered_s == 7000 and counters(device).current_A == 2.5


def test_a_record_of_a_later_firmware_changes_no_counter_and_is_no_event():
    old = board()
    trip(old, FAULTS["over-current"])
    areas, slot = old.controller.store.areas, 4 * MemoryStore.BLOCK
    free = next(
        at
        for at in range(MemoryStore.LOG, len(areas), slot)
        if areas[at : at + slot] == b"\xff" * slot
    )
    areas[free : free + slot] = sealed(struct.pack("<21H", 0x00FD, *[0xFFFF] * 20))
    later_ = again(old)
    assert [one.event for one in events(later_)][1:] == [lib.HT_EVENT_TRIP, lib.HT_EVENT_START]
    assert counters(later_).missed == 0 and counters(later_).damaged == 0
    assert counters(later_).powered_s < 10


def test_missed_events_are_counted_over_a_power_off():
    old = board()
    for _ in range(80):
        trip(old, FAULTS["over-current"])
        clear(old)
    missed = counters(old).missed
    assert missed > 10
    later(old, 3700)  # a record of the counters
    assert counters(again(old)).missed == missed


def test_counts_end_at_65535():
    device = board()
    row = list(FAULTS).index("over-current")
    device.controller.store.log.trips[row] = 0xFFFE
    for _ in range(2):
        trip(device, FAULTS["over-current"])
        clear(device)
        assert counters(device).trips[row] == 0xFFFF


@pytest.mark.parametrize(
    ("watchdogs", "noted"), [(0, True), (8, True), (9, False), (15, False), (16, True), (17, False)]
)
def test_of_many_starts_by_a_watchdog_ever_fewer_are_noted(watchdogs, noted):
    """All of the first eight, then those with a power of two."""
    device = Device(store=Watched(), session=False)
    device.controller.store.log.reset.watchdogs = watchdogs
    device.tick(SETTLE)
    assert lib.ht_log_events(device.controller.store.log) == noted


def test_an_event_that_cannot_be_read_any_more_is_refused():
    device = board()
    trip(device, FAULTS["over-current"])
    areas = device.controller.store.areas
    assert len(events(device)) == 2
    areas[MemoryStore.LOG :] = bytes(len(areas) - MemoryStore.LOG)
    assert device.ask(LIST, struct.pack("<BH", wire.EVENTS, 0)).status == ID


def test_a_log_is_not_emptied_before_it_is_read_or_while_it_writes():
    old = board()
    trip(old, FAULTS["over-current"])
    device = Device(store=Watched(old.controller.store.areas), session=False)
    log, drive = device.controller.store.log, device.drive
    refused, put = set(), set()
    for _ in range(SETTLE):
        lib.ht_service_turn(ffi.addressof(device.service))
        if not log.started or log.put:
            assert lib.ht_log_forget(log, drive) == lib.HT_ERROR_STATE
            refused.add(log.started)
            put.add(log.put)
    assert refused == {False, True} and len(put) > 1
    assert lib.ht_log_forget(log, drive) == lib.HT_OK


def test_a_record_of_the_counters_follows_a_run_and_otherwise_an_hour():
    """Seconds with the gates on are worth one, too: a run goes on after a start that is kept."""
    device = board()
    store, log = device.controller.store, device.controller.store.log
    blocks = store.blocks
    log.counters.gates_s += 1
    device.tick(SETTLE)
    assert store.blocks == blocks + 4
    log.tokens = 0
    log.counters.gates_s += 1
    device.tick(SETTLE)
    assert store.blocks == blocks + 4, "without a token it waits"


def test_a_log_whose_records_go_into_the_other_area_is_not_emptied():
    device = board()
    for _ in range(5):
        trip(device, FAULTS["over-current"])
        clear(device)
    log = device.controller.store.log
    log.ring.next = log.ring.slots  # full
    device.session = 0
    refused = 0
    for _ in range(12000):  # the session ends
        device.tick()
        if not lib.ht_log_ring_settled(ffi.addressof(log, "ring")):
            assert lib.ht_log_forget(log, device.drive) == lib.HT_ERROR_STATE
            refused += 1
    assert refused > 5
    assert lib.ht_log_events(log) == 6
    assert lib.ht_log_forget(log, device.drive) == lib.HT_OK
