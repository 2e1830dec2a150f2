"""A client of protocol 2.0 works with today's board: each reply has the layout that it knows."""

import struct

import session_2_0
from device import ARM, CAPTURE, CHANNELS, DONE, HELLO, LIST, PARAMETERS, READ, START, Device

#: A client of 2.0 knows these statuses.
STATUSES = {*range(16), *range(16, 27)}
#: Texts behind the fixed part of each kind of row, and the length of that part.
ROWS = {0: (17, 4), 1: (4, 3), 2: (5, 2), 3: (3, 1)}


def todays(one: session_2_0.Exchange, dictionary: int) -> bytes:
    """The request as the same client sends it to this board, whose dictionary may have other rows:
    it finds parameters and channels by their names."""
    ids = {"parameter": PARAMETERS, "channel": CHANNELS}
    named = {kind: session_2_0.names(k) for k, kind in enumerate(ids)}
    payload = b""
    for kind, part in session_2_0.parts(one.op, one.payload):
        if kind:
            (id,) = struct.unpack("<H", part)
            part = struct.pack("<H", ids[kind][named[kind][id]])
        payload += part
    head = struct.unpack_from("<BBHH", one.request)
    known = dictionary if head[3] else 0
    return struct.pack("<BBHH", *head[:3], known) + payload


def check_texts(payload: bytes, fixed: int, texts: int) -> None:
    *found, end = payload[fixed:].split(b"\0")
    assert len(found) == texts and end == b""


def check_layout(one: session_2_0.Exchange, payload: bytes) -> None:
    """A client of 2.0 drops a reply that is one byte longer or shorter."""
    if one.op == HELLO:
        check_texts(payload, 34, 2)
        assert payload[:2] == struct.pack("<H", 2)  # the version with which it compares
    elif one.op == LIST:
        assert payload[:3] == one.payload
        check_texts(payload, *ROWS[payload[0]])
        assert payload[0] > 1 or payload[3] == 0  # the type: a float
    else:
        assert len(payload) == len(one.reply[10:])


def test_the_recording_has_every_request_that_matters():
    asked = {one.op for one in session_2_0.SESSION}
    assert asked >= {HELLO, LIST, 3, 4, 5, 6, 7, START, 9, 11, ARM, CAPTURE, READ, 15, 17, 18}
    later = [one for one in session_2_0.SESSION if one.of_later_version]
    assert len(later) == 6  # kinds 4, 5 and 255 of LIST, three opcodes
    for one in later:
        assert one.reply[2] == (1 if one.op == LIST else 16)


def test_todays_board_answers_a_client_of_version_2_0_as_it_expects():
    device = Device(session=False)
    told = 0
    for one in session_2_0.SESSION:
        if one.of_later_version:
            continue
        if one.op == CAPTURE:
            device.tick(300)  # until it is complete
        device.bodies.clear()
        reply = device.answer(todays(one, device.dictionary))
        assert reply is not None, one
        assert reply.status == one.reply[2] and reply.status in STATUSES, (one, reply)
        if reply.status == DONE:
            check_layout(one, reply.payload)
        if one.then:
            for _ in range(100):
                device.tick(20)
                device.bodies += device.receive()
            kinds = {body[0] for body in one.then}
            came = [body for body in device.bodies if body[0] in kinds]
            assert {len(body) for body in came} >= {len(body) for body in one.then}
            told += len(came)
    assert told > 10
