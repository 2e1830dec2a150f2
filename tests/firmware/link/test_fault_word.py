"""Faults beyond the sixteenth bit (docs/protocol.md): a client that knows them reads them, and for
an earlier one every reply has the layout that it knows."""

import struct

import pytest
from device import DONE, ID, LENGTH, LIST, SNAPSHOT, STATUS, STOP, Device

from hexatorque.firmware import ffi, lib
from hexatorque.serial import wire

#: A bit beyond the sixteenth, and one below.
HIGH, LOW = 0x80000000, 0x0002
STATUS_LAYOUT = "<BBHIIIIB"


@pytest.fixture
def device():
    return Device()


def words(device):
    return wire.parse_fault_words(device.done(LIST, "BH", wire.FAULTS, 0).payload)


def flags(device):
    reply = device.done(STATUS)
    assert len(reply.payload) == struct.calcsize(STATUS_LAYOUT)
    return struct.unpack(STATUS_LAYOUT, reply.payload)[0]


def test_all_bits_of_a_trip_are_latched_kept_and_sent(device):
    assert words(device) == (0, 0) and not flags(device) & 8
    device.run()
    lib.ht_drive_trip(device.drive, HIGH | LOW)
    assert device.drive.faults == HIGH | LOW and device.gates_off
    assert words(device) == (HIGH | LOW, HIGH | LOW)
    assert flags(device) & 8
    lib.ht_drive_trip(device.drive, 0x10000)
    assert words(device) == (HIGH | LOW | 0x10000, HIGH | LOW), "the snapshot is the first trip's"
    assert lib.ht_drive_clear(device.drive) == lib.HT_OK
    assert words(device) == (0, HIGH | LOW) and not flags(device) & 8


def test_a_fault_of_the_slow_interrupt_reaches_the_fast_one_whole(device):
    device.run()
    device.drive.slow_faults = HIGH
    device.tick()
    assert (device.drive.faults, device.state) == (HIGH, "fault")


def test_an_earlier_client_sees_the_state_and_the_first_sixteen_bits(device):
    device.run()
    lib.ht_drive_trip(device.drive, HIGH | LOW)
    reply = device.ask(STOP)
    assert (reply.state, reply.faults) == ("fault", LOW)
    kept = device.done(SNAPSHOT).payload
    assert len(kept) == 80 and struct.unpack_from("<IHH", kept)[2] == LOW
    device.drive.faults = HIGH
    reply = device.ask(STATUS)
    assert (reply.state, reply.faults) == ("fault", 0)
    assert wire.parse_status(reply.payload).more_faults


def test_only_row_0_and_its_length_are_known(device):
    assert device.ask(LIST, struct.pack("<BH", wire.FAULTS, 1)).status == ID
    assert device.ask(LIST, struct.pack("<BHB", wire.FAULTS, 0, 0)).status == LENGTH


def test_the_client_reads_a_row_without_bit_and_what_is_appended_later():
    for row, bit in ((15, 0x8000), (16, 0x10000), (31, 0x80000000)):
        payload = struct.pack("<BHH", wire.Kind.FAULT, row, bit & 0xFFFF) + b"name\0help\0"
        assert wire.parse_row(payload, wire.Kind.FAULT, row) == (bit, "name", "help")
    payload = struct.pack("<BHII", wire.FAULTS, 0, HIGH, LOW)
    assert wire.parse_fault_words(payload + b"later") == (HIGH, LOW)
    for wrong in (payload[:-1], b"\x05" + payload[1:]):
        with pytest.raises(wire.WireError, match="not the row of the faults"):
            wire.parse_fault_words(wrong)


def test_the_dictionary_sends_the_first_sixteen_bits_and_every_text(device):
    for row in range(lib.ht_fault_count()):
        fault = lib.ht_fault_describe(row)
        reply = device.done(LIST, "BH", wire.Kind.FAULT, row)
        assert reply.status == DONE
        assert struct.unpack_from("<H", reply.payload, 3)[0] == fault.bit & 0xFFFF
        read = wire.parse_row(reply.payload, wire.Kind.FAULT, row)
        assert (read.bit, read.name) == (fault.bit, ffi.string(fault.name).decode())
