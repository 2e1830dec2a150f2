"""Frames in C are compared with the library `cobs`, zlib, the definitions, and the golden frames of
tests/vectors. The host's codec is compared with the golden frames too."""

import json
import random
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from campaigns import examples
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib
from hexatorque.serial import wire

LONGEST = 508
VECTORS = Path(__file__).parents[2] / "vectors" / "link.json"


def rows(table):
    found = json.loads(VECTORS.read_text())["tables"][table]
    return [dict(zip(found["columns"], row, strict=True)) for row in found["rows"]]


def cells(raw: bytes):
    """Bytes in 16-bit cells, as on a C28x. The upper halves are deliberately not zero."""
    return ffi.new("uint16_t[]", [o | (0xA500 if k % 2 else 0) for k, o in enumerate(raw)])


def encoded(body: bytes) -> bytes:
    """The frame that the firmware makes, with its final zero."""
    packet, out = ffi.new("ht_packet *"), ffi.new("ht_outgoing *")
    lib.ht_packet_begin(packet)
    for byte in body:
        lib.ht_packet_add8(packet, byte)
    assert packet.n == len(body)
    assert not packet.full
    lib.ht_outgoing_set(out, packet)
    assert out.sent == 0
    return bytes(out.octet[0 : out.n])


class Receiver:
    """The firmware's receiver."""

    def __init__(self) -> None:
        self.incoming = ffi.new("ht_incoming *")
        lib.ht_incoming_reset(self.incoming)

    def take(self, raw: bytes) -> list[bytes | None]:
        """The received bodies. A damaged frame gives None."""
        found = []
        for byte in raw:
            status = lib.ht_incoming_take(self.incoming, byte)
            if status == lib.HT_INCOMING_WHOLE:
                found.append(bytes(self.incoming.octet[0 : self.incoming.n]))
            elif status == lib.HT_INCOMING_DAMAGED:
                found.append(None)
        return found


def by_definition(raw: bytes) -> int:
    """Division of the message, lowest bit first, by the reflected 0x104C11DB7."""
    remainder = 0xFFFFFFFF
    for byte in raw:
        for bit in range(8):
            carry = (remainder ^ (byte >> bit)) & 1
            remainder = (remainder >> 1) ^ (0xEDB88320 * carry)
    return remainder ^ 0xFFFFFFFF


# --- CRC ----------------------------------------------------------------------------------


def test_crc_has_its_published_check_value():
    assert lib.ht_crc32(0, cells(b"123456789"), 9) == 0xCBF43926 == by_definition(b"123456789")


@given(st.binary(max_size=600), st.integers(0, 600))
def test_crc_agrees_with_zlib_and_the_definition(raw, cut):
    whole = lib.ht_crc32(0, cells(raw), len(raw))
    assert whole == zlib.crc32(raw) == by_definition(raw)
    first = lib.ht_crc32(0, cells(raw[:cut]), len(raw[:cut]))
    assert lib.ht_crc32(first, cells(raw[cut:]), len(raw[cut:])) == whole


@given(st.lists(st.integers(0, 2**32 - 1), max_size=100), st.integers(0, 2**32 - 1))
def test_crc_of_values_agrees_with_zlib(values, crc):
    wanted = zlib.crc32(struct.pack(f"<{len(values)}I", *values), crc)
    assert lib.ht_crc32_values(crc, values, len(values)) == wanted


@given(st.integers(0, 2**32 - 1))
def test_numbers_are_packed_low_byte_first(bits):
    into = ffi.new("uint16_t[4]")
    lib.ht_put32(into, bits)
    assert bytes(into) == struct.pack("<I", bits)
    assert lib.ht_get32(cells(bytes(into))) == bits
    lib.ht_put16(into, bits & 0xFFFF)
    assert lib.ht_get16(cells(bytes(into))) == bits & 0xFFFF
    value = np.uint32(bits).view(np.float32)
    if not np.isnan(value):  # Python would change the bits of a NaN
        assert lib.ht_float_bits(float(value)) == bits
        assert lib.ht_float_of(bits) == value


# --- every length -------------------------------------------------------------------------

PATTERNS = {
    "no zero": lambda n: bytes(1 + k % 255 for k in range(n)),
    "zeros": bytes,
    "255": lambda n: bytes([255]) * n,
    "a zero at the end": lambda n: bytes([3]) * (n - 1) + bytes(min(n, 1)),
    "a zero after 254": lambda n: (bytes([254]) * 254 + b"\0" + bytes([1]) * n)[:n],
    "a zero after 253": lambda n: (bytes([254]) * 253 + b"\0" + bytes([1]) * n)[:n],
    "few zeros": lambda n: random.Random(n).choices(b"\0\1\2\3\4\5\6\7\xff\xfe", k=n),
}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_frames_of_every_length_come_through(pattern):
    receiver = Receiver()
    for n in range(LONGEST + 1):
        body = bytes(PATTERNS[pattern](n))
        frame = encoded(body)
        checked = body + struct.pack("<I", zlib.crc32(body))
        assert frame == cobs.encode(checked) + b"\0"
        assert frame.index(0) == len(frame) - 1
        assert receiver.take(frame) == [body if n >= 2 else None]
        assert receiver.take(b"\0" + frame + b"\0\0" + frame) == 2 * [body if n >= 2 else None]
    assert len(frame) <= 516 == len(ffi.new("ht_outgoing *").octet)
    for n in (LONGEST + 1, LONGEST + 2, 600, 5000):
        body = bytes(PATTERNS[pattern](n))
        frame = cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"
        assert receiver.take(frame + encoded(b"ok")) == [None, b"ok"]


def test_a_field_that_does_not_fit_is_refused():
    """A field that does not fit is refused and changes nothing. The CRC still has its place."""
    for last, width in ((lib.ht_packet_add16, 2), (lib.ht_packet_add32, 4)):
        for free in range(width):
            packet, out = ffi.new("ht_packet *"), ffi.new("ht_outgoing *")
            lib.ht_packet_begin(packet)
            for _ in range(LONGEST - free):
                lib.ht_packet_add8(packet, 0x55)
            assert not packet.full
            last(packet, 0xFFFF)
            assert packet.full
            assert packet.n == LONGEST - free
            lib.ht_outgoing_set(out, packet)
            raw = bytes(out.octet[0 : out.n])
            assert Receiver().take(raw) == [b"\x55" * (LONGEST - free)]
            lib.ht_packet_begin(packet)
            assert (packet.n, packet.full) == (0, False)


def test_texts_end_with_a_zero():
    packet = ffi.new("ht_packet *")
    lib.ht_packet_begin(packet)
    lib.ht_packet_add_text(packet, b"volt")
    lib.ht_packet_add_text(packet, b"")
    assert bytes(packet.octet[0 : packet.n]) == b"volt\0\0"


# --- damage -------------------------------------------------------------------------------


def reference(raw: bytes) -> list[bytes | None]:
    """The bodies between zeros, decoded by the library."""
    found = []
    for piece in raw.split(b"\0")[:-1]:
        if piece:
            try:
                checked = cobs.decode(piece)
            except cobs.DecodeError:
                checked = b""
            good = 6 <= len(checked) <= LONGEST + 4 and checked[-4:] == struct.pack(
                "<I", zlib.crc32(checked[:-4])
            )
            found.append(checked[:-4] if good else None)
    return found


bodies = st.binary(min_size=2, max_size=40) | st.binary(min_size=240, max_size=LONGEST)


@settings(max_examples=examples(300))
@given(st.lists(bodies, min_size=1, max_size=4), st.data())
def test_a_damaged_line_gives_the_bodies_that_the_reference_gives(sent, data):
    raw = bytearray(b"".join(wire.frame(body) for body in sent))
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(raw) - 1))
        match data.draw(st.sampled_from(("lose", "flip", "insert", "double"))):
            case "lose" if len(raw) > 1:
                del raw[at]
            case "insert":
                raw.insert(at, data.draw(st.integers(0, 255)))
            case "double":
                raw.insert(at, raw[at])
            case _:
                raw[at] ^= 1 << data.draw(st.integers(0, 7))
    line = bytes(raw) + b"\0"
    found = Receiver().take(line)
    assert found == reference(line)
    assert all(body in sent for body in found if body is not None)


def test_every_wrong_bit_and_pair_of_bits_is_found():
    """The frames are a request and a sample."""
    sample = struct.pack("<BBI3f", 0x41, 0, 256, 1.0, 0.0, -2.0)
    for body in (wire.request(wire.Op.START, 3, 0x0100, 7), sample):
        frame = encoded(body)
        n = 8 * len(frame)
        bits = np.frombuffer(frame, np.uint8)
        cases = [(k,) for k in range(n)] + [(j, k) for k in range(n) for j in range(k)]
        receiver = ffi.new("ht_incoming *")
        lib.ht_incoming_reset(receiver)
        for case in cases:
            line = bits.copy()
            for k in case:
                line[k // 8] ^= 1 << (k % 8)
            for byte in (*line.tolist(), 0):
                whole = lib.ht_incoming_take(receiver, byte) == lib.HT_INCOMING_WHOLE
                assert not whole, case


@given(st.integers(0, 30))
def test_lost_bytes_drop_only_the_present_frame(before):
    """The receiver knows that bytes were lost, but not where. It drops the present frame and takes
    the next."""
    frame = encoded(b"a body with \0 in it")
    receiver = Receiver()
    before = min(before, len(frame) - 1)
    receiver.take(frame[:before])
    lib.ht_incoming_discard(receiver.incoming)
    assert receiver.take(frame[before:] + frame) == [None, b"a body with \0 in it"]


# --- golden frames ------------------------------------------------------------------------


@pytest.mark.parametrize("case", rows("frames"), ids=lambda c: c["what"])
def test_golden_frames_are_made_and_read(case):
    body, frame = bytes.fromhex(case["body"]), bytes.fromhex(case["frame"])
    assert int(case["crc"], 16) == zlib.crc32(body)
    assert b"\0" + encoded(body) == frame == wire.frame(body)
    assert Receiver().take(frame) == [body]
    assert wire.unframe(frame[1:-1]) == body


@pytest.mark.parametrize("case", rows("damaged"), ids=lambda c: c["what"])
def test_golden_damage_is_found(case):
    raw = bytes.fromhex(case["bytes"])
    assert Receiver().take(raw + b"\0") == [None]
    assert wire.unframe(raw) is None


def test_golden_frames_equal_the_hosts_frames():
    """Bodies as the host's codec makes and reads them."""
    golden = {case["what"]: bytes.fromhex(case["body"]) for case in rows("frames")}

    def request(op, payload=b""):
        return wire.request(op, op + 6, 0x1234, 0xBEEF, payload)

    assert golden["START"] == request(wire.Op.START)
    stream = wire.stream(1, (2, 3, 8), 4)
    assert golden["STREAM 3 channels, every 4th"] == request(wire.Op.STREAM, stream)
    reply = wire.parse_reply(golden["reply to WRITE, refused"])
    assert reply[:-1] == (wire.Op.WRITE, 13, wire.Status.VALUE, 3, 0x41, 0x01020300)
    hello = wire.parse_hello(wire.parse_reply(golden["reply to HELLO"]).payload)
    assert (hello.crc, hello.budget, hello.rows) == (0x0BADBEEF, 112500, (62, 27, 13, 5))
    assert (hello.memory, hello.watchdog_ms, hello.build) == (20480, 250, "build")
    status = wire.parse_status(wire.parse_reply(golden["reply to STATUS"]).payload)
    assert status == (True, True, True, 2, 180, 3, 0, 1000000, 0x89ABCDEF, 1, False)
    more = wire.parse_reply(golden["reply to STATUS, faults beyond 16 bits"])
    assert wire.parse_status(more.payload).more_faults
    row = struct.pack("<BH", wire.FAULTS, 0)
    assert golden["LIST all bits of the faults"] == request(wire.Op.LIST, row)
    words = wire.parse_reply(golden["reply to LIST, all bits of the faults"])
    assert wire.parse_fault_words(words.payload) == (0x10041, 0x10000)
    for kind, row, what in ((7, 0, "the log's counters"), (8, 0, "the latest event"),
                            (9, 2, "the third limit")):  # fmt: skip
        assert golden[f"LIST {what}"] == request(wire.Op.LIST, struct.pack("<BH", kind, row))
    assert golden["FORGET_LOG"] == request(wire.Op.FORGET_LOG)
    counters = wire.parse_counters(
        wire.parse_reply(golden["reply to LIST, the log's counters"]).payload, 3
    )
    assert counters == (
        True, 12, 2, 1, 7200, 3601, 5, 312.5, 21.25, 1460.0, 96.0, (3, 0, 1)
    )  # fmt: skip
    event = wire.parse_event(wire.parse_reply(golden["reply to LIST, an event"]).payload, 0)
    assert event == (
        2, 3, 4, 1, 17, 7000, 3600, 0x10001, 0x400, 0x10, 311.0,
        (1.5, -1.5, 2.5, -2.5, 0.5, -0.5), -1450.0, 94.5, 101.5, 61.0,
    )  # fmt: skip
    limit = wire.parse_limit(wire.parse_reply(golden["reply to LIST, a limit"]).payload, 2)
    assert limit == (4, True, 0x01020000, 0x01020300, "dc link low", "vdc_low_V")
    sample = np.frombuffer(golden["sample of stream 1"], wire.sample_type(3))[0]
    assert (sample["number"], sample["tick"]) == (255, 0xFFFFFFFF)
    assert sample["values"].tolist() == [1.5, -0.0, 311.0]
    number, first, values = wire.parse_data(golden["data of a capture"])
    assert (number, first) == (3, 600)
    assert values == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
