"""Requests as fast as the line carries them, together with the fastest possible stream. Time is
counted in fast interrupts. In each of them the line carries a number of bytes."""

import struct

import numpy as np
import pytest
from device import (
    DONE,
    GET,
    HELLO,
    LIST,
    NONCE,
    OPEN,
    PARAMETERS,
    SNAPSHOT,
    START,
    STATUS,
    STOP,
    STREAM,
    WRITE,
    Device,
    frame,
)

from hexatorque import firmware
from hexatorque.serial import wire

NAMES = [name for name, _ in firmware.channels()]
SPEED = PARAMETERS["speed_ref_rpm"]
FLOODS = {
    "STATUS": (STATUS, b""),
    "HELLO": (HELLO, b""),
    "SNAPSHOT": (SNAPSHOT, b""),
    "longest LIST": (LIST, struct.pack("<BH", 0, PARAMETERS["flux_check"])),
    "GET of 100": (GET, struct.pack("<100H", *[SPEED] * 100)),
    "WRITE of one": (WRITE, struct.pack("<Hf", SPEED, 1.0)),
    "WRITE of 80": (WRITE, struct.pack("<Hf", SPEED, 1.0) * 80),
    "OPEN": (OPEN, struct.pack("<HI", NONCE, 1)),
    "another STREAM": (STREAM, struct.pack("<BBH", 1, 0, 1)),
    "refused": (63, b""),
}


def flood(device, op, payload, ticks):
    """Send requests without a pause for a time. Returns the bodies that came, in order."""
    board = device.controller.board
    bodies = []
    for _ in range(ticks):
        while board.serial.in_head - board.serial.in_tail < 1000:
            device.put(frame(device.request(op, payload)))
        device.tick()
        bodies += device.receive()
    return bodies


def fullest(device, count):
    """Set stream 0 with that many channels as fast as the board allows. Returns its decimation."""
    names = (2 * NAMES)[:count]
    refused = device.stream(0, 1, *names)
    (least,) = struct.unpack("<H", refused.payload)
    assert device.stream(0, least, *names).status == DONE
    return least


def ticks_of(bodies):
    return [struct.unpack_from("<I", body, 2)[0] for body in bodies if body[0] == 0x40]


def length(body):
    """The number of bytes on the line."""
    return len(frame(body)) - 1  # the board sends no zero before a frame


@pytest.mark.parametrize("what", FLOODS)
@pytest.mark.parametrize("baud, count", [(1250000, 1), (1250000, 32), (937500, 8), (115200, 4)])
def test_a_flood_of_requests_loses_no_samples(what, baud, count):
    device = Device(baud=baud)
    every = fullest(device, count)
    bodies = flood(device, *FLOODS[what], ticks=4000)
    assert set(np.diff(ticks_of(bodies))) == {every}
    assert device.service.streams.dropped == 0
    # The stream does not stop all replies: they have the remaining tenth of the line.
    op = FLOODS[what][0]
    replies = [body for body in bodies if body[0] == op | 0x80]
    tenth = 0.1 * device.service.setup.line.octets_per_s * 4000 / 1e4
    assert len(replies) >= int(0.7 * tenth / (length(replies[0]) + 8))


def test_a_flood_beside_capture_data_loses_no_samples():
    device = Device()
    device.done(12, "BBHIIHf2H", 2, 0, 1, 5000, 0, 0, 0.0, 0, 1)
    device.done(15)
    device.tick(6000)
    device.done(STATUS)
    every = fullest(device, 8)
    device.done(14, "II", 0, 10000)
    bodies = flood(device, STATUS, b"", 2000)
    assert set(np.diff(ticks_of(bodies))) == {every}
    assert device.service.streams.dropped == 0


@pytest.mark.parametrize("what", FLOODS)
@pytest.mark.parametrize("slow", [1.0, 0.5], ids=["as it says", "at half its speed"])
def test_a_reply_waits_no_longer_than_the_protocol_says(what, slow):
    """The test counts the bytes on the line from the end of a request to the end of its reply,
    while streams keep the line busy. On a slow line samples are always waiting."""
    device = Device()
    fullest(device, 32)
    board = device.controller.board
    per_tick = device.service.setup.line.octets_per_s / 1e4
    device.tick(500)
    op, payload = FLOODS[what]
    for _ in range(30):
        body = device.request(op, payload)
        device.put(frame(body))
        while board.serial.in_head != board.serial.in_tail:
            board.credit_out -= (1.0 - slow) * per_tick
            device.tick()
        waited = 0
        reply = None
        while reply is None:
            board.credit_out -= (1.0 - slow) * per_tick
            device.tick()
            waited += slow * per_tick
            for came in device.receive():
                if came[:2] == bytes((op | 0x80, body[1])):
                    reply = came
            assert waited <= wire.reply_bytes(op, len(payload)) + 2 * per_tick
        # The rule in ht_service.h: the rest of a frame, nine times the reply and a sample.
        assert waited <= 140 + 9 * (len(reply) + 8) + 140 + length(reply) + 3 * per_tick
    assert (device.service.streams.dropped > 0) == (slow < 1.0)


def test_a_stop_does_not_wait():
    """STOP acts as soon as its last byte has come, even if replies and samples wait for the
    line."""
    for _ in range(5):
        device = Device()
        device.done(START)
        every = fullest(device, 32)
        bodies = flood(device, GET, FLOODS["GET of 100"][1], 300)
        assert device.state == "run"
        assert set(np.diff(ticks_of(bodies))) == {every}
        board = device.controller.board
        while board.serial.in_head != board.serial.in_tail:
            device.tick()
        stop = frame(struct.pack("<BBHH", STOP, 77, 0, 0))
        device.put(stop)
        device.tick(int(len(stop) / 12.5) + 2)
        assert device.state == "idle"
        assert device.gates_off


def test_a_stream_begins_after_its_reply():
    """Otherwise a client would take the first samples for samples of the stream's former
    setting."""
    device = Device(baud=115200)
    assert device.stream(1, 150, *NAMES[:20]).status == DONE  # keeps the line busy
    for n in range(40):
        names = NAMES[: 1 + n % 3]
        ids = range(1 + n % 3)
        body = device.request(STREAM, struct.pack(f"<BBH{len(names)}H", 0, len(names), 100, *ids))
        device.put(frame(body))
        order = []
        for _ in range(400 + n):
            device.tick()
            order += device.receive()
        at = next(k for k, b in enumerate(order) if b[:2] == bytes((STREAM | 0x80, body[1])))
        assert order[at][2] == DONE
        tick = struct.unpack_from("<I", order[at], 6)[0]
        mine = [b for b in order[at:] if b[0] == 0x40]
        assert mine and all(len(b) == 6 + 4 * len(names) for b in mine)
        assert mine[0][1] == 0
        ticks = ticks_of(mine)
        assert ticks[0] > tick
        assert set(np.diff(ticks)) <= {100}
        was = 1 + (n - 1) % 3
        assert all(len(b) == 6 + 4 * was for b in order[:at] if b[0] == 0x40)


def test_a_session_that_ends_before_the_reply_has_left_begins_no_stream():
    device = Device(watchdog_ms=5)
    assert device.stream(1, 20, *NAMES[:20]).status == DONE
    board = device.controller.board
    board.credit_out = -1e6  # nothing leaves, and a sample is waiting
    device.tick(40)
    device.put(frame(device.request(STREAM, struct.pack("<BBHH", 0, 1, 5, 0))))
    device.tick(30)
    assert device.service.begins == 0
    device.tick(200)
    assert device.service.session == 0
    board.credit_out = 0.0
    device.tick(200)
    assert device.service.begins == 4
    assert not any(stream.active for stream in device.service.streams.stream)
