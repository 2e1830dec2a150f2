"""Burst capture, directly and over the line. It is compared with a model that has the whole signal
and searches for the trigger afterwards."""

import struct
import zlib

import numpy as np
import pytest
from campaigns import examples
from device import (
    ARM,
    CANCEL,
    CAPTURE,
    CHANNELS,
    CLEAR,
    COMPLETE,
    DONE,
    FIELD,
    FILLING,
    ID,
    LENGTH,
    MEMORY,
    NO_CAPTURE,
    NO_CHANNEL,
    NONE,
    READ,
    STATE,
    STOP,
    TRIGGER,
    WAITING,
    Device,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

MANUAL, RISING, FALLING, ABOVE, BELOW, FAULT, COMMAND = range(7)
SIZE = 120


class Burst:
    """The capture in C. It is fed with rows of a signal (ticks, channels)."""

    def __init__(self, size: int = SIZE, first_tick: int = 1) -> None:
        self.burst = ffi.new("ht_burst *")
        self.memory = ffi.new("uint32_t[]", size + 1)
        self.memory[size] = 0xDEADBEEF  # not its own
        lib.ht_burst_init(self.burst, self.memory, size)
        self.tick = first_tick - 1
        self._row = np.zeros(1, np.float32)
        self._read = ffi.callback("float(*)(const void *, uint16_t)", lambda _, c: self._row[c])
        self._source = ffi.new("ht_source *", {"read": self._read, "object": ffi.NULL})

    def arm(self, n=1, trigger=MANUAL, prescaler=1, samples=1, before=0, channel=0, level=0.0):
        setup = ffi.new("ht_burst_setup *")
        setup.n, setup.trigger, setup.prescaler = n, trigger, prescaler
        setup.samples, setup.before, setup.channel, setup.level = samples, before, channel, level
        for k in range(min(n, 16)):
            setup.id[k] = k
        self.answer = lib.ht_burst_arm(self.burst, setup)
        return self.answer == lib.HT_BURST_ARMED

    def sample(self, row, fault=False):
        self._row = row
        self.tick = (self.tick + 1) & 0xFFFFFFFF
        lib.ht_burst_sample(self.burst, self._source, self.tick, fault)
        assert self.memory[len(self.memory) - 1] == 0xDEADBEEF

    @property
    def state(self):
        return self.burst.state

    def finish(self):
        """Sum up, and return the values as float32, the oldest first."""
        turns = 0
        while self.state == lib.HT_BURST_SUMMING:
            lib.ht_burst_sum(self.burst)
            turns += 1
        assert self.state == COMPLETE
        n = lib.ht_burst_values(self.burst)
        assert turns == -(-n // 16)
        values = np.array([lib.ht_burst_value(self.burst, k) for k in range(n)], np.uint32)
        assert self.burst.crc == zlib.crc32(values.astype("<u4").tobytes())
        return values.view(np.float32).reshape(-1, self.burst.setup.n)


def fires(kind, level, signal, faults, commands, k):
    """Whether the protocol's definition gives a trigger at sample `k`."""
    now, last = signal[k], signal[k - 1] if k else np.nan
    match kind:
        case 1:
            return last <= level < now
        case 2:
            return last >= level > now
        case 3:
            return now > level
        case 4:
            return now < level
        case 5:
            return k > 0 and faults[k] and not faults[k - 1]
        case 6:
            return commands[k]
    return False


def model(kind, level, before, samples, signal, faults, commands, manual):
    """The index of the trigger's sample, or None. All arguments are per sample, not per tick. Edges
    of faults and levels are checked from the first sample on. No trigger counts before `before`
    samples are in memory, but a manual trigger is kept until then."""
    for k in range(len(signal)):
        if k >= before and (
            fires(kind, level, signal, faults, commands, k) or (manual is not None and k >= manual)
        ):
            return k
    return None


values = st.sampled_from([np.nan, -np.inf, np.inf, -2.0, -1.0, -0.0, 0.0, 1.0, 1.5, 2.0])


@settings(max_examples=examples(400), deadline=None)
@given(
    kind=st.integers(0, 6),
    level=values.filter(lambda v: not np.isnan(v)),
    n=st.integers(1, 16),
    prescaler=st.integers(1, 4),
    size=st.tuples(st.integers(1, 30), st.integers(0, 29)),
    signal=st.lists(values, min_size=1, max_size=60),
    faults=st.lists(st.booleans(), min_size=60, max_size=60),
    commands=st.sets(st.integers(0, 239), max_size=3),
    manual=st.none() | st.integers(0, 239),
)
@example(RISING, 0.0, 1, 1, (3, 0), [-1.0, 0.0, 1.0, 2.0, 2.0], [False] * 60, set(), None)
@example(RISING, 0.0, 1, 1, (3, 2), [-1.0, np.nan, 1.0, -1.0, 1.0], [False] * 60, set(), None)
@example(FAULT, 0.0, 2, 1, (4, 3), [0.0] * 30, [True] * 10 + [False] * 4 + [True] * 46, set(), None)
def test_captures_agree_with_a_search_over_the_whole_signal(
    kind, level, n, prescaler, size, signal, faults, commands, manual
):
    samples, before = size[0], size[1] % size[0]
    n = min(n, SIZE // samples)
    burst = Burst()
    assert burst.arm(n, kind, prescaler, samples, before, 0, level)
    # One row per tick, with the trigger's channel first. The values of the other channels encode
    # tick and channel.
    ticks = len(signal) * prescaler
    rows = np.add.outer(100.0 * np.arange(ticks), np.arange(n)).astype(np.float32)
    rows[:, 0] = np.repeat(np.array(signal, np.float32), prescaler)
    manual = None if manual is None or manual >= ticks else manual
    for t in range(ticks):
        if t in commands:
            burst.burst.command = 1
        if t == manual:
            burst.burst.manual = 1
        burst.sample(rows[t], faults[t // prescaler])
    # Samples are taken at ticks 0, prescaler, 2 prescaler ... A command or a manual trigger before
    # tick t acts at the next sample.
    taken = rows[::prescaler]
    commanded = np.zeros(len(taken) + 1, bool)
    commanded[[-(-t // prescaler) for t in commands if t < ticks]] = True
    from_manual = None if manual is None else -(-manual // prescaler)
    at = model(
        kind, level, before, samples, taken[:, 0], faults[: len(taken)], commanded, from_manual
    )
    if at is None:
        assert burst.state == (WAITING if len(taken) >= before else FILLING)
        return
    assert burst.burst.tick == 1 + at * prescaler
    first = at - before
    if first + samples > len(taken):
        assert burst.state == lib.HT_BURST_TRIGGERED
        return
    got = burst.finish()
    assert got.tobytes() == taken[first : first + samples].tobytes()


@pytest.mark.parametrize("sign, kind", [(1, RISING), (-1, FALLING)])
def test_an_edge_goes_from_one_side_of_the_level_to_the_other(sign, kind):
    """A signal that begins beyond the level has made no edge, nor has one that stays before it or
    comes back to exactly the level."""
    burst = Burst()
    burst.arm(trigger=kind, level=sign * 2.0)
    for value in (3, 3, 2, 1, 1, 2):
        burst.sample(np.float32([sign * value]))
        assert burst.state == WAITING, value
    burst.sample(np.float32([sign * 3]))
    assert burst.finish()[:, 0].tolist() == [sign * 3]
    assert burst.burst.tick == 7


def test_captures_outside_the_bounds_are_refused():
    burst = Burst()
    good = dict(n=3, trigger=RISING, prescaler=1, samples=40, before=39, level=0.0)
    assert burst.arm(**good)
    number = burst.burst.number
    for change, answer in (
        (dict(n=0), lib.HT_BURST_BAD_N),
        (dict(n=17, samples=1, before=0), lib.HT_BURST_BAD_N),
        (dict(samples=41), lib.HT_BURST_TOO_LARGE),
        (dict(samples=0, before=0), lib.HT_BURST_BAD_SAMPLES),
        (dict(samples=2**32 - 1, before=0), lib.HT_BURST_TOO_LARGE),
        (dict(samples=2**31, n=2, before=0), lib.HT_BURST_TOO_LARGE),
        (dict(before=40), lib.HT_BURST_BAD_BEFORE),
        (dict(before=2**32 - 1), lib.HT_BURST_BAD_BEFORE),
        (dict(prescaler=0), lib.HT_BURST_BAD_PRESCALER),
        (dict(trigger=7), lib.HT_BURST_BAD_TRIGGER),
        (dict(trigger=65535), lib.HT_BURST_BAD_TRIGGER),
        (dict(level=float("nan")), lib.HT_BURST_BAD_LEVEL),
    ):
        assert not burst.arm(**{**good, **change}), change
        assert burst.answer == answer, change
        assert burst.burst.number == number
        assert burst.state == FILLING
        assert burst.burst.setup.samples == 40
    for change in (
        dict(level=float("inf")),
        dict(samples=1, before=0),
        dict(n=16, samples=7, before=6),
    ):
        assert burst.arm(**{**good, **change}), change


def test_capture_numbers_and_ticks_wrap():
    burst = Burst(first_tick=2**32 - 2)
    for k in range(300):
        assert burst.arm()
        assert burst.burst.number == (k + 1) % 256
    burst.arm(samples=4, before=2)
    for k in range(8):
        burst.burst.manual = k == 3
        burst.sample(np.float32([k]))
    assert burst.burst.tick == 1  # 2^32 - 2, - 1, 0, 1
    assert burst.finish()[:, 0].tolist() == [1, 2, 3, 4]


def test_a_cancelled_capture_takes_no_more_samples():
    burst = Burst()
    burst.arm(samples=4, before=2)
    burst.sample(np.float32([1]))
    lib.ht_burst_cancel(burst.burst)
    for _ in range(9):
        burst.sample(np.float32([1]))
    lib.ht_burst_sum(burst.burst)
    assert burst.state == NONE


# --- over the line ------------------------------------------------------------------------


def arm(device, *channels, trigger=MANUAL, samples=100, before=50, prescaler=1, level=0.0, at=None):
    ids = [CHANNELS[c] for c in channels]
    return device.ask(
        ARM,
        struct.pack(
            f"<BBHIIHf{len(ids)}H",
            *(len(ids), trigger, prescaler, samples, before),
            *(CHANNELS[at or channels[0]], level),
            *ids,
        ),
    )


def progress(device):
    """state, number, prescaler, samples, before, tick, crc"""
    return struct.unpack_from("<BBHIIII", device.done(CAPTURE).payload)


def read(device, first, count):
    """{place: values} of the data that come after the reply."""
    device.bodies.clear()
    device.done(READ, "II", first, count)
    device.tick(40 + 2 * count)
    device.bodies += device.receive()
    found = {}
    for body in device.bodies:
        if body[0] == 0x50:
            place = struct.unpack_from("<I", body, 2)[0]
            assert place not in found
            found[place] = np.frombuffer(body, "<f4", offset=6)
    return found


def test_a_capture_is_uploaded_sample_for_sample():
    """The capture has every sample of the channels. It is read in pieces, some of them twice, while
    a stream takes most of the line."""
    device = Device()
    names = ("i_u1_A", "i_u2_A", "vdc_V")
    assert arm(device, *names, trigger=RISING, level=2.0, samples=150, before=60).status == DONE
    seen = {}
    for k in range(400):
        device.sense(0, 2048 + (200 if k > 250 else k % 5))
        device.sense(6, 2000 + k)
        device.tick()
        seen[device.now] = [device.channel(n) for n in names]
    for _ in range(10):
        state, number, prescaler, samples, before, tick, crc = progress(device)
        if state == COMPLETE:
            break
        device.tick(5)
    assert (state, number, prescaler, samples, before) == (COMPLETE, 1, 1, 150, 60)
    listed = device.done(CAPTURE).payload[20:]
    assert listed == struct.pack("<3H", *(CHANNELS[name] for name in names))
    wanted = np.float32([seen[tick - 60 + k] for k in range(150)])
    assert (wanted[:60, 0] <= 2.0).all()
    assert wanted[60, 0] > 2.0
    assert zlib.crc32(wanted.tobytes()) == crc
    whole = read(device, 0, 450)
    assert {len(v) for v in list(whole.values())[:-1]} == {60}
    assert np.concatenate(list(whole.values())).tobytes() == wanted.tobytes()
    part = read(device, 67, 100)
    assert list(part) == [67, 127]
    assert np.concatenate(list(part.values())).tobytes() == wanted.ravel()[67:167].tobytes()
    assert device.stream(0, 2, *["vdc_V"] * 2).status == DONE
    assert sorted(read(device, 390, 60)) == [390]
    samples_seen = device.samples(0)
    assert set(np.diff([s[1] for s in samples_seen])) == {2}
    assert read(device, 450, 0) == {}
    assert read(device, 449, 1)[449].tolist() == [wanted[-1, -1]]
    outside = ((450, 1, 4), (449, 2, 4), (451, 0, 0), (0, 451, 4), (2**32 - 1, 2, 0))
    for first, count, field in (*outside, (1, 2**32 - 1, 4)):
        reply = device.ask(READ, struct.pack("<II", first, count))
        assert (reply.status, reply.payload) == (FIELD, struct.pack("<H", field))


def test_read_needs_a_complete_capture():
    device = Device()
    assert device.ask(READ, struct.pack("<II", 0, 0)).status == NO_CAPTURE
    assert device.ask(TRIGGER).status == NO_CAPTURE
    arm(device, "vdc_V", samples=100, before=99)
    assert progress(device)[0] == FILLING
    assert device.ask(READ, struct.pack("<II", 0, 1)).status == NO_CAPTURE
    device.done(TRIGGER)  # waits until it is full
    device.tick(60)
    assert progress(device)[6] == 0
    device.tick(60)
    assert progress(device)[0] == COMPLETE
    assert device.ask(TRIGGER).status == NO_CAPTURE
    device.done(CANCEL)
    assert (progress(device)[0], progress(device)[6]) == (NONE, 0)
    assert device.ask(READ, struct.pack("<II", 0, 1)).status == NO_CAPTURE


def test_the_tick_of_the_trigger_is_zero_until_there_is_one():
    """Also if the capture before had one."""
    device = Device()
    for _ in range(2):
        arm(device, "vdc_V", samples=100, before=99)
        for state in (FILLING, WAITING):
            device.tick(2 if state == FILLING else 100)
            found = progress(device)
            assert (found[0], found[5]) == (state, 0)
        device.done(TRIGGER)
        assert progress(device)[5] > 0


def completed(device):
    arm(device, "vdc_V", "state", samples=2000, before=10)
    device.tick(20)
    device.done(TRIGGER)
    device.tick(2500)
    assert progress(device)[0] == COMPLETE


@pytest.mark.parametrize("how", ["refused", "armed", "cancelled", "zero values", "another"])
def test_a_read_ends_with_its_capture_or_by_a_read_of_zero_values(how):
    device = Device(baud=115200)
    completed(device)
    device.done(READ, "II", 0, 3000)
    device.tick(60)
    if how == "refused":
        assert arm(device, "vdc_V", samples=10**6).status == MEMORY
        assert arm(device, "vdc_V", samples=5, before=5).status == FIELD
    elif how == "armed":
        assert arm(device, "vdc_V", samples=10, before=5).status == DONE
    elif how == "cancelled":
        device.done(CANCEL)
    elif how == "zero values":
        device.done(READ, "II", 0, 0)
    else:
        device.done(READ, "II", 2000, 7)
    place = len(device.bodies)
    device.tick(3000)
    device.bodies += device.receive()
    data = [struct.unpack_from("<I", b, 2)[0] for b in device.bodies[place:] if b[0] == 0x50]
    if how == "refused":
        assert data == list(range(data[0], 2000, 60))[: len(data)]  # goes on
        assert len(data) > 10
    else:
        assert data == ([2000] if how == "another" else [])


@pytest.mark.parametrize(
    "make",
    [
        lambda d: d.done(STOP),
        lambda d: d.write(speed_ref_rpm=3.0),
        lambda d: d.run(),
    ],
)
def test_command_is_a_trigger(make):
    device = Device()
    arm(device, "state", trigger=COMMAND, samples=20, before=10)
    device.tick(30)
    assert device.ask(CLEAR).status == STATE  # a refused command is no trigger
    device.tick(5)
    assert progress(device)[0] == WAITING
    make(device)
    device.tick(30)
    assert progress(device)[0] == COMPLETE


def test_fault_is_a_trigger():
    device = Device()
    device.run()
    arm(device, "state", "faults", trigger=FAULT, samples=20, before=10)
    device.tick(30)
    device.sense(2, 4095)
    device.tick(60)
    state, *_, tick, _ = progress(device)
    assert state == COMPLETE
    assert tick == device.drive.snapshot.tick
    values = np.concatenate(list(read(device, 0, 40).values())).reshape(-1, 2)
    assert (values[:10, 1] == 0).all()
    assert (values[10:, 1] != 0).all()


@pytest.mark.parametrize(
    "change, status, detail",
    [
        # The field's place in the payload.
        (dict(n=17), FIELD, struct.pack("<H", 0)),
        (dict(n=0), FIELD, struct.pack("<H", 0)),
        (dict(trigger=7), FIELD, struct.pack("<H", 1)),
        (dict(prescaler=0), FIELD, struct.pack("<H", 2)),
        (dict(samples=0, before=0), FIELD, struct.pack("<H", 4)),
        (dict(before=10), FIELD, struct.pack("<H", 8)),
        (dict(level=np.nan), FIELD, struct.pack("<H", 14)),
        # The number of samples that 20480 values can hold.
        (dict(samples=20480 // 2 + 1), MEMORY, struct.pack("<I", 10240)),
        (dict(samples=2**31 + 1), MEMORY, struct.pack("<I", 10240)),
        (dict(n=1, ids=(0,), samples=20481), MEMORY, struct.pack("<I", 20480)),
        (dict(channel=NO_CHANNEL), ID, struct.pack("<H", NO_CHANNEL)),
        (dict(ids=(0, NO_CHANNEL)), ID, struct.pack("<H", NO_CHANNEL)),
        (dict(ids=(0,)), LENGTH, b""),
        (dict(ids=(0, 1, 2)), LENGTH, b""),
    ],
)
def test_an_arm_that_is_refused_changes_nothing(change, status, detail):
    device = Device()
    arm(device, "state", trigger=ABOVE, level=1e9, samples=30, before=3)
    device.tick(10)
    was = progress(device)
    p = {
        **dict(n=2, trigger=1, prescaler=1, samples=10, before=3, channel=0, level=0.0, ids=(0, 1)),
        **change,
    }
    if p["n"] not in (2,):
        p["ids"] = (0,) * p["n"]
    body = struct.pack("<BBHIIHf", *(p[k] for k in list(p)[:7]))
    reply = device.ask(ARM, body + struct.pack(f"<{len(p['ids'])}H", *p["ids"]))
    assert (reply.status, reply.payload) == (status, detail)
    assert progress(device) == was


def test_capture_outlives_its_session():
    device = Device(watchdog_ms=5)
    arm(device, "state", samples=100, before=10)
    device.tick(300)
    assert device.service.session == 0
    assert progress(device)[0] == WAITING
    assert device.ask(TRIGGER).status == 18
