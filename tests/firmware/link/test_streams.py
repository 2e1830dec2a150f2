"""Sample streams: the ring buffer between interrupt and background, and the frames of a board."""

import struct

import numpy as np
import pytest
from device import BUDGET, DONE, FIELD, ID, LENGTH, NO_CHANNEL, NO_STREAM, STREAM, Device
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque import firmware
from hexatorque.firmware import ffi, lib

RING = len(ffi.new("ht_streams *").ring)


class Ring:
    """The ring buffer in C. It is fed with values that encode channel and tick."""

    def __init__(self, tick: int = 0) -> None:
        self.streams = ffi.new("ht_streams *")
        lib.ht_streams_reset(self.streams)
        self.tick = tick
        self._read = ffi.callback("float(*)(const void *, uint16_t)", self._value)
        self._source = ffi.new("ht_source *", {"read": self._read, "object": ffi.NULL})
        self._out = ffi.new("ht_stream_sample *")

    def _value(self, _, channel: int) -> float:
        return float(1000 * channel + self.tick % 1000)

    def set(self, slot, channels, decimation=1):
        lib.ht_streams_set(self.streams, slot, channels, len(channels), decimation)
        lib.ht_streams_begin(self.streams, slot)

    def sample(self, n=1):
        for _ in range(n):
            self.tick = (self.tick + 1) & 0xFFFFFFFF
            lib.ht_streams_sample(self.streams, self._source, self.tick)

    def next(self):
        if not lib.ht_streams_next(self.streams, self._out):
            return None
        o = self._out
        values = [lib.ht_float_of(v) for v in o.value[0 : o.n]]
        return o.stream, o.number, o.tick, values

    def all(self):
        return list(iter(self.next, None))


def expected(slot, channels, decimation, since, n):
    """Samples of `n` ticks after tick `since`."""
    return [
        (slot, number % 256, tick, [1000.0 * c + tick % 1000 for c in channels])
        for number, tick in enumerate(range(since + 1, since + n + 1, decimation))
    ]


@pytest.mark.parametrize("decimation", [1, 2, 7, 255])
@pytest.mark.parametrize("count", [1, 8, 32])
def test_a_sample_every_decimation_ticks(count, decimation):
    ring = Ring()
    channels = list(range(count))
    ring.set(2, channels, decimation)
    found = []
    for _ in range(400):
        ring.sample()
        found += ring.all()
    assert found == expected(2, channels, decimation, 0, 400)


def test_numbers_and_ticks_wrap():
    ring = Ring(tick=2**32 - 150)
    ring.set(0, [1])
    found = []
    for _ in range(300):
        ring.sample()
        found += ring.all()
    assert [f[1] for f in found] == [k % 256 for k in range(300)]
    assert [f[2] for f in found] == [(2**32 - 149 + k) % 2**32 for k in range(300)]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 40), st.integers(0, 40)), min_size=1, max_size=40),
    st.lists(st.tuples(st.integers(1, 32), st.integers(1, 5)), min_size=1, max_size=4),
)
def test_the_ring_keeps_order_and_counts_losses(bursts, streams):
    """At any speed of writer and reader, the samples come out in order. Samples that did not fit
    are counted, and their numbers and ticks are missing."""
    ring = Ring()
    for slot, (count, decimation) in enumerate(streams):
        ring.set(slot, list(range(count)), decimation)
    due, fill, lost, found = [], 0, 0, []
    # The expected samples follow from the size alone. Each takes 2 + n values, and one value stays
    # free.
    inside = []
    for writes, reads in bursts:
        for _ in range(writes):
            tick = ring.tick + 1
            ring.sample()
            for slot, (count, decimation) in enumerate(streams):
                if (tick - 1) % decimation == 0:
                    number = (tick - 1) // decimation % 256
                    if fill + count + 2 <= RING - 1:
                        fill += count + 2
                        inside.append((slot, number, tick, count))
                    else:
                        lost += 1
        for _ in range(min(reads, len(inside))):
            slot, number, tick, count = inside.pop(0)
            due.append((slot, number, tick, [1000.0 * c + tick % 1000 for c in range(count)]))
            fill -= count + 2
            found.append(ring.next())
    assert found == due
    assert ring.streams.dropped == lost
    assert len(ring.all()) == len(inside)


def test_a_full_ring_drops_the_oldest_samples():
    ring = Ring()
    ring.set(0, [5])
    ring.sample(1000)  # 341 samples of 3 values fit
    assert ring.streams.dropped == 1000 - (RING - 1) // 3
    assert [f[2] for f in ring.all()] == list(range(1, (RING - 1) // 3 + 1))
    ring.sample(3)
    assert [(f[1], f[2]) for f in ring.all()] == [(k % 256, k + 1) for k in range(1000, 1003)]


def test_a_stream_that_is_set_again_begins_anew():
    """The stream begins again with number 0. No sample of its former setting follows, and the other
    streams continue."""
    ring = Ring()
    ring.set(0, [1, 2])
    ring.set(1, [3], 2)
    ring.sample(5)
    ring.set(0, [4, 5])
    ring.sample(2)
    assert ring.all() == [
        *expected(1, [3], 2, 0, 5),
        (0, 0, 6, [4006.0, 5006.0]),
        (0, 1, 7, [4007.0, 5007.0]),
        (1, 3, 7, [3007.0]),
    ]
    ring.sample(2)
    ring.set(0, [])
    ring.sample(2)
    assert [f[:3] for f in ring.all()] == [(1, 4, 9), (1, 5, 11)]
    lib.ht_streams_reset(ring.streams)
    ring.sample(4)
    assert ring.all() == []
    assert not lib.ht_streams_any(ring.streams)


def test_a_stream_is_set_again_across_the_end_of_the_ring():
    for filled in range(RING - 40, RING, 3):
        ring = Ring()
        ring.set(3, [7])
        for _ in range(filled // 3):
            ring.sample()
            ring.all()
        ring.set(0, [1, 2])
        ring.sample(20)
        ring.set(0, [1, 2])
        ring.sample(2)
        assert [f[1] for f in ring.all() if f[0] == 0] == [0, 1]


# --- over the line ------------------------------------------------------------------------


def test_samples_are_the_channels_at_the_end_of_the_interrupt():
    device = Device()
    device.run()
    names = ("psi_alpha_Wb", "psi_beta_Wb", "sector", "state")
    device.stream(1, 3, *names)
    seen = {}
    for k in range(300):
        device.sense(k % 6, 2048 + 7 * (k % 11))
        device.tick()
        seen[device.now] = tuple(device.channel(n) for n in names)
    got = device.samples(1)
    assert len(got) >= 95
    assert [g[0] for g in got] == [k % 256 for k in range(len(got))]
    assert set(np.diff([g[1] for g in got])) == {3}
    compared = [g for g in got if g[1] in seen]
    assert len(compared) >= 95
    # NaN: what is computed only while the drive controls, after the sensors' jumps have tripped it.
    np.testing.assert_array_equal([g[2] for g in compared], [seen[g[1]] for g in compared])


def test_four_streams_at_once():
    device = Device()
    for slot in range(4):
        reply = device.stream(slot, 7 + slot, *["vdc_V", "i_u1_A"][: 1 + slot % 2])
        assert reply.status == DONE
        rates = [(12 + 4 * (1 + k % 2)) * 1e4 / (7 + k) for k in range(slot + 1)]
        total, most = struct.unpack("<II", reply.payload)
        assert total == pytest.approx(sum(rates), abs=5)
        assert most == 112500
    device.tick(2000)
    for slot in range(4):
        got = device.samples(slot)
        assert len(got) > 2000 // (7 + slot) - 10
        assert set(np.diff([g[1] for g in got])) == {7 + slot}
        assert all(g[2][0] == device.channel("vdc_V") for g in got)
    assert device.service.streams.dropped == 0


@pytest.mark.parametrize("count", [1, 4, 8, 20, 27, 32])
@pytest.mark.parametrize("baud", [115200, 1250000, 3000000])
def test_streams_are_refused_beyond_the_lines_budget(baud, count):
    """A stream that is too fast is refused with the smallest decimation that fits. This decimation
    is accepted and loses nothing. One less does not fit."""
    device = Device(baud=baud)
    actual = device.service.setup.line.octets_per_s
    assert actual == pytest.approx(baud / 10, rel=0.05)
    names = (2 * [name for name, _ in firmware.channels()])[:count]
    sample_bytes = 12 + 4 * count
    wanted = int(np.ceil(sample_bytes * 1e4 / (0.9 * actual)))
    reply = device.stream(0, 1, *names)
    if wanted > 1:
        assert reply.status == BUDGET
        (least,) = struct.unpack("<H", reply.payload)
        assert least in (wanted, wanted + 1)  # loads are whole numbers, rounded up
        if least > 1:
            assert device.stream(0, least - 1, *names).status == BUDGET
        reply = device.stream(0, least, *names)
    else:
        least = 1
    assert reply.status == DONE
    device.tick(600)
    got = device.samples(0)
    assert set(np.diff([g[1] for g in got])) == {least}
    assert device.service.streams.dropped == 0
    # A second one gets what is left, and no more.
    second = device.stream(1, 1, *names)
    assert second.status == BUDGET
    (fits,) = struct.unpack("<H", second.payload)
    if fits:
        assert device.stream(1, fits, *names).status == DONE
    assert device.stream(0, 1).status == DONE
    assert device.stream(1, least, *names).status == DONE


def load(channels, decimation):
    """Bytes a second of a stream at 10 kHz, rounded up."""
    return (12 + 4 * channels) * 10000 // decimation + 1


def leaving(budget, rest):
    """Channels and decimation of two streams that leave so many bytes a second."""
    least = {load(n, d): (n, d) for d in range(2000, 0, -1) for n in range(1, 33)}
    for first, stream in least.items():
        if (second := least.get(budget - rest - first)) is not None:
            return stream, second
    raise AssertionError("no such pair")


@pytest.mark.parametrize("rest", [0, 1, 2, 21, 22, 48888, 48889, 48890])
def test_a_line_that_is_nearly_full(rest):
    """What is left for a third stream, down to nothing: the smallest decimation that fits, 0 for
    none. 48889 is a ninth of what eight channels take in every interrupt."""
    device = Device()
    names = (2 * [name for name, _ in firmware.channels()])[:32]
    reply = device.stream(3, 65535, names[0])
    _, budget = struct.unpack("<II", reply.payload)
    assert device.stream(3, 1).status == DONE
    for slot, (n, decimation) in enumerate(leaving(budget, rest)):
        reply = device.stream(slot, decimation, *names[:n])
        assert reply.status == DONE
    assert struct.unpack("<II", reply.payload) == (budget - rest, budget)
    for n in (1, 8, 32):
        fits = [d for d in range(1, 65536) if load(n, d) <= rest]
        refused = device.stream(2, 1, *names[:n])
        assert refused.status == BUDGET
        assert struct.unpack("<H", refused.payload) == (fits[0] if fits else 0,)


@pytest.mark.parametrize(
    "payload, status, detail",
    [
        (struct.pack("<BBHH", 4, 1, 1, 0), NO_STREAM, None),
        (struct.pack("<BBHH", 255, 1, 1, 0), NO_STREAM, None),
        (struct.pack("<BBH33H", 0, 33, 9, *range(33)), FIELD, 1),
        (struct.pack("<BBHH", 0, 1, 0, 0), FIELD, 2),
        (struct.pack("<BBHHH", 0, 2, 9, 0, NO_CHANNEL), ID, NO_CHANNEL),
        (struct.pack("<BBHHH", 0, 2, 9, 65535, 0), ID, 65535),
        (struct.pack("<BBH", 0, 1, 9), LENGTH, None),
        (struct.pack("<BBHHH", 0, 1, 9, 0, 0), LENGTH, None),
        (struct.pack("<BB", 0, 0), LENGTH, None),
    ],
)
def test_a_refused_stream_changes_nothing(payload, status, detail):
    device = Device()
    device.stream(0, 5, "vdc_V")
    reply = device.ask(STREAM, payload)
    assert reply.status == status
    assert reply.payload == (b"" if detail is None else struct.pack("<H", detail))
    device.tick(50)
    device.samples(0)
    device.tick(50)
    assert len(device.samples(0)) == 10  # it continues unchanged


def test_new_settings_are_not_mixed_with_old_samples():
    """The stream has two channels before, and two others after. Between the reply and the first new
    sample, no old sample may come, although some were waiting."""
    device = Device(baud=115200)
    device.stream(0, 25, "vdc_V", "vdc_V")
    for _ in range(20):  # the line is kept busy: samples wait
        device.put(b"\0")
        device.tick(7)
        reply = device.stream(0, 25, "state", "state")
        assert reply.status == DONE
        place = len(device.bodies)
        device.tick(60)
        device.bodies += device.receive()
        after = [b for b in device.bodies[place:] if b[0] == 0x40]
        assert after[0][1] == 0
        assert all(b[6:] == bytes(8) for b in after)
        device.bodies.clear()
        device.stream(0, 25, "vdc_V", "vdc_V")
        device.tick(60)


def test_a_slow_line_drops_samples_and_counts_them():
    """On a line that carries nothing samples are dropped and counted. Numbers and ticks show it."""
    device = Device()
    device.stream(0, 4, "vdc_V", "state", "faults", "sector", "speed_rpm")
    device.tick(100)
    board = device.controller.board
    device.samples(0)
    # Nothing leaves the transmitter while the credit is deeply negative.
    board.credit_out = -100000.0
    device.tick(2000)
    board.credit_out = 0.0
    device.tick(2000)
    got = device.samples(0)
    steps = np.diff([g[1] for g in got])
    missing = int(np.sum(steps // 4 - 1))
    assert set(steps % 4) == {0}
    assert missing == device.service.streams.dropped > 100
    numbers = np.array([g[0] for g in got])
    assert (np.diff(numbers) % 256 == steps // 4 % 256).all()
