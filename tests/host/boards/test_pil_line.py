"""The target's end of processor in the loop, byte by byte: requests in the link's frames, and
what becomes of damaged, lost and doubled bytes. The frames: tests/firmware/link/test_packet.py."""

import itertools
import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque import firmware
from hexatorque.firmware import ffi, lib
from hexatorque.serial import wire

HEAD = struct.Struct("<BBBBI")
DAMAGED = lib.HT_OP_PIL_DAMAGED | lib.HT_OP_REPLY


def frame(opcode, number=1, payload=b""):
    """A request on the line, with its closing zero."""
    return wire.frame(bytes([opcode, number]) + payload)[1:]


def init():
    """INIT of device 0. All parameters have their defaults, so no octet says that one follows."""
    return bytes(1) + bytes(-(-len(firmware.parameters()) // 8))


class TargetLine:
    """A register target in this process."""

    def __init__(self):
        self.line = ffi.new("ht_pil_line *")
        lib.ht_pil_line_reset(self.line)

    def take(self, raw):
        """Bodies of the replies."""
        found = []
        for byte in raw:
            if lib.ht_pil_line_take(self.line, byte):
                out = self.line.out
                found.append(wire.unframe(bytes(out.octet[0 : out.n - 1])))
        return found


# --- damage ---------------------------------------------------------------------------------


def test_every_wrong_bit_of_a_request_is_noticed():
    good = frame(lib.HT_OP_PIL_HELLO)
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        replies = TargetLine().take(bytes(bad) + b"\0")
        assert replies and all(body[0] == DAMAGED for body in replies), f"bit {bit}"


@pytest.mark.parametrize("opcode", ["HELLO", "STEP"])
def test_every_byte_lost_or_doubled_is_noticed(opcode):
    good = frame(getattr(lib, f"HT_OP_PIL_{opcode}"), 9, bytes([1, 0, 3, 3, 5]))
    for at in range(len(good) - 1):
        lost = good[:at] + good[at + 1 :]
        doubled = good[: at + 1] + good[at:]
        for bad in (lost, doubled):
            replies = TargetLine().take(bad)
            assert [body[0] for body in replies] == [DAMAGED], at
    assert TargetLine().take(good[:-1]) == []  # the closing zero is lost: waits ...
    line = TargetLine()
    (body,) = line.take(good[:-1] + good)  # ... and two frames become one
    assert body[0] == DAMAGED
    (body,) = line.take(good + b"\0\0")  # the closing zero doubled: no frame between zeros
    assert body[:2] == bytes([good[1] | lib.HT_OP_REPLY, 9])


@settings(max_examples=150, deadline=None)
@given(st.integers(2, 6), st.data())
def test_damaged_line(sent, data):
    """Whatever happens to the bytes: a reply is to a request that was sent, at most once, or says
    that a frame was damaged."""
    stream = bytearray(b"".join(frame(lib.HT_OP_PIL_HELLO, n) for n in range(sent)))
    for _ in range(data.draw(st.integers(0, 4))):
        at = data.draw(st.integers(0, len(stream) - 1))
        match data.draw(st.sampled_from(("lose", "flip", "insert", "double"))):
            case "lose":
                del stream[at]
            case "insert":
                stream.insert(at, data.draw(st.integers(0, 255)))
            case "double":
                stream.insert(at, stream[at])
            case _:
                stream[at] ^= 1 << data.draw(st.integers(0, 7))
    target = TargetLine()
    replies = target.take(bytes(stream))
    numbers = [body[1] for body in replies if body[0] != DAMAGED]
    assert numbers == sorted(set(numbers)) and set(numbers) <= set(range(sent))
    target.take(b"\0")
    (body,) = target.take(frame(lib.HT_OP_PIL_HELLO, 77))
    assert body[1] == 77


@pytest.mark.parametrize("seed", range(20))
def test_a_request_after_a_zero_is_found_after_any_bytes(seed):
    rng = random.Random(seed)
    target = TargetLine()
    noise = bytes(rng.choice((0, 1, 255, rng.randrange(256))) for _ in range(rng.randrange(3000)))
    assert all(body[0] == DAMAGED for body in target.take(noise))
    target.take(b"\0")
    (body,) = target.take(frame(lib.HT_OP_PIL_HELLO, 3))
    head = HEAD.unpack(body[: HEAD.size])
    assert head[:3] == (lib.HT_OP_PIL_HELLO | lib.HT_OP_REPLY, 3, lib.HT_OK)


# --- requests -------------------------------------------------------------------------------


def result(body):
    return HEAD.unpack(body[: HEAD.size])[2]


@pytest.mark.parametrize("payload", [b"", init()[:-1], init() + b"\0", bytes([2]) + init()[1:]])
def test_init_that_is_wrong_is_refused(payload):
    """Too short, too long, no such device; and then there is no drive."""
    target = TargetLine()
    (body,) = target.take(frame(lib.HT_OP_PIL_INIT, 1, payload))
    assert result(body) == lib.HT_PIL_REFUSED and len(body) == HEAD.size
    (body,) = target.take(frame(lib.HT_OP_PIL_START, 2, bytes(2)))
    assert result(body) == lib.HT_PIL_REFUSED


@pytest.mark.parametrize(
    "hardware",
    [b"\0", b"\0\1", b"\0\2\7\0", bytes([255, 255]) + bytes(510)],
    ids=["half a head", "no value", "one value of two", "beyond the last register"],
)
def test_impossible_changes_are_refused(hardware):
    target = TargetLine()
    (body,) = target.take(frame(lib.HT_OP_PIL_INIT, 1, init()))
    assert result(body) == lib.HT_OK
    (body,) = target.take(frame(lib.HT_OP_PIL_STOP, 2, bytes(2) + hardware[:500]))
    assert result(body) == lib.HT_PIL_REFUSED


def test_only_changed_channels_are_sent():
    """After INIT those that are not 0; a second STOP changes none."""
    target = TargetLine()
    target.take(frame(lib.HT_OP_PIL_INIT, 1, init()))
    replies = [target.take(frame(lib.HT_OP_PIL_STOP, n, bytes(2)))[0] for n in (2, 3)]
    flags = -(-len(firmware.channels()) // 8)
    at = HEAD.size + 4
    assert replies[1][at : at + flags] == bytes(flags)
    assert len(replies[1]) == at + flags + 12  # accesses, violations, sum of registers


# --- registers ------------------------------------------------------------------------------


@pytest.fixture(params=firmware.DEVICES)
def mirrors(request):
    """Two register files of a device, in agreement."""
    found = []
    for _ in range(2):
        registers, mirror = ffi.new("ht_regfile *"), ffi.new("ht_mirror *")
        map_ = getattr(lib, f"ht_{request.param}")
        lib.ht_regfile_reset(registers, ffi.addressof(map_))
        lib.ht_mirror_init(mirror, registers, ffi.addressof(map_))
        found.append((mirror, registers))
    return found


def told(mirror):
    packet = ffi.new("ht_packet *")
    lib.ht_packet_begin(packet)
    lib.ht_mirror_tell(mirror, packet)
    assert not packet.full
    return packet


def cells(mirror):
    return [mirror.cell[i][0] for i in range(mirror.count)]


@pytest.mark.parametrize("seed", range(30))
def test_changes_arrive(mirrors, seed):
    """Any set of changes makes the two files agree, in no more bytes than promised."""
    (here, _), (there, _) = mirrors
    rng = random.Random(seed)
    share = rng.choice((0.0, 0.05, 0.3, 0.34, 0.5, 1.0))
    for i in range(here.count):
        if rng.random() < share:
            here.cell[i][0] ^= rng.randrange(1, 0x10000)
    packet = told(here)
    assert packet.n <= 2 + 2 * here.count
    reader = ffi.new("ht_reader *")
    lib.ht_reader_begin(reader, packet.octet, packet.n)
    assert lib.ht_mirror_take(there, reader)
    assert cells(here) == cells(there)
    assert told(here).n == told(there).n == 0
    assert all(lib.ht_mirror_digest(here, n) == lib.ht_mirror_digest(there, n) for n in range(16))


def test_longest_runs(mirrors):
    """Changes with one and with two unchanged registers in between: the worst there is."""
    (here, _), _ = mirrors
    for step in (1, 2, 3):
        for i in range(0, here.count, step):
            here.cell[i][0] ^= 1
        assert told(here).n <= 2 + 2 * here.count


def test_digest_notices_any_register(mirrors):
    (here, _), (there, _) = mirrors
    for i, bit in itertools.product(range(here.count), (0, 15)):
        here.cell[i][0] ^= 1 << bit
        assert lib.ht_mirror_digest(here, i) != lib.ht_mirror_digest(there, i)
        here.cell[i][0] ^= 1 << bit


def test_the_largest_reply_fits(mirrors):
    """Every channel and every register changed."""
    channels = len(firmware.channels())
    assert channels <= lib.HT_PIL_CHANNELS
    registers = max(mirror.count for mirror, _ in mirrors)
    largest = HEAD.size + 4 + -(-channels // 8) + 4 * channels + 12 + 2 + 2 * registers
    assert largest <= wire.LONGEST_BODY


# --- snapshot -------------------------------------------------------------------------------


def test_snapshot_has_the_protocols_layout():
    """docs/protocol.md, SNAPSHOT; and back."""
    s = ffi.new("ht_snapshot *")
    s.tick, s.state, s.faults, s.samples.position = 0x12345, 3, 0x8005, 0xFEDC0007
    s.warnings = 0x0110
    s.samples.adc[0:7] = range(100, 107)
    measured = getattr(s, "in")
    measured.i_A.p[0:6] = range(11, 17)
    measured.vdc_V, measured.torque_ref_Nm, measured.flux_ref_Wb = 17, 18, 19
    s.estimate.psi_Wb.alpha, s.estimate.psi_Wb.beta, s.estimate.torque_Nm = 20, 21, 22
    s.speed_rpm = 23
    packet = ffi.new("ht_packet *")
    lib.ht_packet_begin(packet)
    lib.ht_snapshot_add(packet, s)
    raw = bytes(packet.octet[0 : packet.n])
    words = (0x12345, 3, 0x8005, 0x0110, *range(100, 107), 0xFEDC0007)
    assert raw == struct.pack("<I3H7HI13f", *words, *range(11, 24))
    assert len(raw) == lib.HT_SNAPSHOT_BYTES
    back = ffi.new("ht_snapshot *")
    lib.ht_snapshot_take(packet.octet, back)
    assert firmware.snapshot_of(back) == firmware.snapshot_of(s)
    assert wire.parse_snapshot(raw) == firmware.snapshot_numbers(s)
