"""Frames: what arrives is what was sent, or nothing."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

PART, WHOLE, BROKEN = lib.HT_FRAME_PART, lib.HT_FRAME_WHOLE, lib.HT_FRAME_BROKEN


def octets_of(words, kind=3, number=7) -> bytes:
    frame = ffi.new("ht_frame *")
    lib.ht_frame_begin(frame, kind, number)
    for word in words:
        lib.ht_frame_add(frame, word)
    size = lib.ht_frame_end(frame)
    return bytes(lib.ht_frame_octet(frame, i) for i in range(size))


class Receiver:
    def __init__(self):
        self.frame = ffi.new("ht_frame *")
        lib.ht_frame_reset(self.frame)

    def take(self, octets: bytes) -> list:
        """Every status but PART, payloads in place of WHOLE."""
        found = []
        used = ffi.new("uint16_t *")
        while octets:
            status = lib.ht_frame_take(self.frame, octets, len(octets), used)
            octets = octets[used[0] :]
            if status == WHOLE:
                words = lib.ht_frame_payload(self.frame)
                found.append([words[i] for i in range(lib.ht_frame_length(self.frame))])
            elif status == BROKEN:
                found.append(BROKEN)
        return found


def fletcher32(words) -> int:
    """The definition: two running sums modulo 65535."""
    a = b = 0
    for word in words:
        a = (a + word) % 65535
        b = (b + a) % 65535
    return b << 16 | a


def test_layout():
    """Octet by octet, as docs/pil.md has it."""
    octets = octets_of([0x1234, 0xABCD], kind=0x83, number=0x42)
    assert octets[:10] == bytes.fromhex("a55a 0200 8342 3412 cdab")
    words = [2, 0x4283, 0x1234, 0xABCD]
    assert octets[10:] == fletcher32(words).to_bytes(4, "little")


@given(st.lists(st.integers(0, 0xFFFF), max_size=700))
def test_checksum(words):
    assert lib.ht_fletcher(0, words, len(words)) == fletcher32(words)


def test_checksum_of_the_largest_words():
    words = [0xFFFF] * 1000 + [0xFFFE] * 1000
    assert lib.ht_fletcher(0, words, len(words)) == fletcher32(words)


@given(
    st.lists(st.lists(st.integers(0, 0xFFFF), max_size=512), min_size=1, max_size=3),
    st.randoms(use_true_random=False),
)
def test_frames_in_pieces(payloads, rng):
    stream = b"".join(octets_of(p) for p in payloads)
    receiver = Receiver()
    found = []
    while stream:
        n = rng.randint(1, 100)
        found += receiver.take(stream[:n])
        stream = stream[n:]
    assert found == payloads


def test_payload_is_limited():
    assert octets_of([1] * 600) == octets_of([1] * 512)


def test_every_flipped_bit_is_noticed():
    good = octets_of(list(range(20)))
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        receiver = Receiver()
        assert receiver.take(bytes(bad)) in ([], [BROKEN]), f"bit {bit}"


@pytest.mark.parametrize("seed", range(20))
def test_finds_back_after_noise(seed):
    """Whatever came before, sync words and lengths in it too: after octets for one
    largest frame of zeros the next frame is found."""
    rng = random.Random(seed)
    receiver = Receiver()
    noise = bytes(rng.choice((0xA5, 0x5A, rng.randrange(256))) for _ in range(rng.randrange(3000)))
    assert all(status == BROKEN for status in receiver.take(noise))
    receiver.take(bytes(2 * (3 + 512 + 2)))
    assert receiver.take(octets_of([1, 2, 3])) == [[1, 2, 3]]


def test_sync_after_a_false_first_octet():
    assert Receiver().take(b"\xa5" + octets_of([9])) == [[9]]
