"""COBS and CRC, computed from their definitions. Damaged frames are found."""

import contextlib
import random
import struct

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from peer import cobs_decode, cobs_encode

from hexatorque.serial import wire


def crc_bit_by_bit(data: bytes) -> int:
    """The polynomial x^32 + x^26 + ... + 1 as the shift register that it is."""
    register = 0xFFFFFFFF
    for byte in data:
        for bit in range(8):
            feedback = (register ^ byte >> bit) & 1
            register = register >> 1 ^ (0xEDB88320 if feedback else 0)
    return register ^ 0xFFFFFFFF


BODIES = st.binary(min_size=2, max_size=wire.LONGEST_BODY)
#: Zeros, runs around COBS's group of 254.
RUNS = st.lists(st.tuples(st.integers(0, 2), st.integers(1, 260)), min_size=1, max_size=4).map(
    lambda runs: b"".join(bytes([value]) * count for value, count in runs)[: wire.LONGEST_BODY]
)


def test_crc_check_value():
    assert crc_bit_by_bit(b"123456789") == 0xCBF43926
    body = b"123456789"
    on_line = wire.frame(body)
    assert cobs_decode(on_line[1:-1]) == body + bytes.fromhex("2639f4cb")  # low byte first


@settings(max_examples=150, deadline=None)
@given(BODIES | RUNS)
def test_frame_by_definition(body):
    expected = cobs_encode(body + struct.pack("<I", crc_bit_by_bit(body)))
    assert wire.frame(body) == b"\0" + expected + b"\0"
    assert b"\0" not in expected and len(wire.frame(body)) <= wire.LONGEST_FRAME
    if len(body) >= 2:
        assert wire.unframe(expected) == body


@settings(max_examples=100, deadline=None)
@given(st.lists(BODIES | RUNS.filter(lambda b: len(b) > 1), max_size=5), st.randoms())
def test_the_cut_of_a_line_does_not_matter(bodies, rng):
    line = b"".join(map(wire.frame, bodies))
    splitter, found, at = wire.Splitter(), [], 0
    while at < len(line):
        step = rng.randint(1, 300)
        found += splitter.push(line[at : at + step])
        at += step
    assert found == bodies and splitter.damaged == 0


def test_every_single_and_double_bit_error_is_found():
    body = bytes(range(1, 30))
    good = wire.frame(body)[1:-1]
    bits = len(good) * 8
    rng = random.Random(1)
    pairs = [(a,) for a in range(bits)] + [rng.sample(range(bits), 2) for _ in range(3000)]
    for places in pairs:
        bad = bytearray(good)
        for place in places:
            bad[place // 8] ^= 1 << place % 8
        splitter = wire.Splitter()
        splitter.push(b"\0")
        assert body not in splitter.push(bytes(bad) + b"\0")
        assert splitter.damaged >= 1


def test_damage_costs_one_frame_and_is_counted():
    frames = [wire.frame(bytes([1, n])) for n in range(5)]
    splitter = wire.Splitter()
    splitter.push(b"\0")
    line = frames[0] + frames[1][:4] + frames[2] + frames[3][:3] + b"x" + frames[3][3:] + frames[4]
    assert splitter.push(line) == [b"\1\0", b"\1\2", b"\1\4"]
    assert splitter.damaged == 2


def test_the_rest_of_a_frame_at_the_beginning_is_no_damage():
    splitter = wire.Splitter()
    assert splitter.push(wire.frame(b"ab")[3:] + wire.frame(b"cd")) == [b"cd"]
    assert splitter.damaged == 0
    splitter.restart()
    assert splitter.push(b"junk" + wire.frame(b"ef")) == [b"ef"]
    assert splitter.damaged == 0


def test_endless_noise_takes_no_memory():
    splitter = wire.Splitter()
    splitter.push(b"\0")
    for _ in range(100):
        splitter.push(b"\x55" * 4096)
        assert len(splitter._rest) <= wire.LONGEST_FRAME
    assert splitter.push(b"\0" + wire.frame(b"ok")) == [b"ok"]
    assert splitter.damaged == 1


@pytest.mark.parametrize("size", [0, 1, wire.LONGEST_BODY + 1, 600])
def test_bodies_of_a_wrong_size_are_dropped(size):
    body = bytes([7]) * size
    raw = cobs_encode(body + struct.pack("<I", crc_bit_by_bit(body)))
    assert wire.unframe(raw) is None


def test_samples_are_as_wide_as_the_protocol_says():
    body = struct.pack("<BBI3f", 0x42, 255, 0xFFFFFFFE, 1.5, -2.0, float("inf"))
    (row,) = np.frombuffer(body, wire.sample_type(3))
    assert (row["number"], row["tick"]) == (255, 0xFFFFFFFE)
    assert row["values"].tolist() == [1.5, -2.0, np.inf]
    assert wire.sample_bytes(3) == 12 + 4 * 3


@settings(max_examples=examples(200), deadline=None)
@given(st.binary(max_size=120), st.integers(0, 3))
def test_any_bytes_parse_or_are_refused(raw, kind):
    """No exception but WireError, whatever a board sends."""
    readers = (
        wire.parse_hello,
        wire.parse_status,
        wire.parse_capture,
        wire.parse_snapshot,
        wire.parse_data,
        wire.parse_reply,
        wire.parse_request,
        lambda o: wire.parse_row(bytes([kind, 1, 0]) + o, kind, 1),
        lambda o: wire.parse_hello(b"\1\0" + o),
    )
    for read in readers:
        with contextlib.suppress(wire.WireError):
            read(raw)
