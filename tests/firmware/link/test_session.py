"""The session, and the watchdog: a drive that a host has started does not run without this host."""

import struct

import pytest
from device import (
    ARM,
    BUSY,
    CLEAR,
    CLOSE,
    DONE,
    FIELD,
    GET,
    HELLO,
    LIST,
    NONCE,
    OPEN,
    SESSION,
    SNAPSHOT,
    START,
    STATE,
    STATUS,
    STOP,
    TO_RUN,
    TRIGGER,
    WRITE,
    Device,
    frame,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

OTHER = 0x4321


def nonce(value):
    """OPEN's payload, with some mark."""
    return struct.pack("<HI", value, 7)


def until_fault(device, most):
    """Interrupts until the drive is in fault, or None."""
    for k in range(most):
        device.tick()
        if device.state == "fault":
            return k + 1
    return None


# --- session ------------------------------------------------------------------------------


def marks(device, value):
    """Send OPEN with a mark. Returns the marks in force by its reply and by STATUS."""
    opened = device.done(OPEN, "HI", NONCE, value).payload
    return struct.unpack("<I", opened)[0], struct.unpack_from("<I", device.ask(STATUS).payload, 16)[
        0
    ]


def test_the_first_mark_stays_until_a_reset():
    """A client that knows the mark can notice a reset, even if others have opened sessions
    since."""
    device = Device(session=False)
    assert struct.unpack_from("<I", device.ask(STATUS).payload, 16) == (0,)
    assert marks(device, 0) == (0, 0)  # none given
    assert marks(device, 0xFEDCBA98) == (0xFEDCBA98, 0xFEDCBA98)
    assert marks(device, 5) == (0xFEDCBA98, 0xFEDCBA98)
    assert device.ask(CLOSE, session=NONCE).status == DONE
    assert device.ask(OPEN, struct.pack("<HI", 0, 9)).status == FIELD  # changes nothing
    assert marks(device, 6) == (0xFEDCBA98, 0xFEDCBA98)
    assert marks(Device(session=False), 6) == (6, 6)  # after a reset


def test_one_client_has_the_session_from_open_to_close():
    device = Device(session=False)
    none = device.ask(OPEN, nonce(0))
    assert (none.status, none.payload) == (FIELD, b"\0\0")
    assert device.ask(OPEN, nonce(NONCE)).status == DONE
    assert device.ask(OPEN, nonce(NONCE)).status == DONE  # is confirmed
    assert device.ask(OPEN, nonce(OTHER)).status == BUSY
    assert device.ask(CLOSE, session=OTHER).status == SESSION
    assert device.ask(CLOSE, session=NONCE).status == DONE
    assert device.ask(CLOSE, session=NONCE).status == SESSION
    assert device.ask(OPEN, nonce(OTHER)).status == DONE
    assert device.ask(TRIGGER, session=NONCE).status == SESSION
    assert device.ask(TRIGGER, session=OTHER).status != SESSION


def flags(device, session):
    return struct.unpack_from("<B", device.ask(STATUS, session=session).payload)[0]


def test_status_says_who_has_the_session():
    device = Device(session=False)
    assert flags(device, 0) == 0
    device.ask(OPEN, nonce(NONCE))
    assert flags(device, 0) == 1
    assert flags(device, OTHER) == 1
    assert flags(device, NONCE) == 3
    device.session = NONCE
    device.done(START)
    assert flags(device, NONCE) == 7
    assert flags(device, 0) == 5
    device.done(STOP)
    assert flags(device, NONCE) == 3


def test_a_second_host_may_read_and_stop_only():
    """The second host gets a refusal, but may read and stop. The first notices only the stop."""
    device = Device()
    device.run()
    assert device.ask(OPEN, nonce(OTHER)).status == BUSY
    for op, payload in ((START, b""), (CLEAR, b""), (WRITE, struct.pack("<Hf", 9, 1.0))):
        assert device.ask(op, payload, session=OTHER).status == SESSION
    assert device.ask(GET, nonce(9), session=OTHER).status == DONE
    assert device.state == "run"
    assert device.ask(STOP, session=OTHER).status == DONE
    assert device.state == "idle"
    assert device.service.session == NONCE


def test_an_old_start_is_not_repeated_after_another_clients_stop():
    """The first host missed the reply to its START. It repeats the START after the second host's
    STOP."""
    device = Device()
    start = device.request(START)
    assert device.answer(start).status == DONE
    assert device.ask(STOP, session=OTHER).status == DONE
    assert device.answer(start).status == STATE
    assert device.state == "idle"
    assert device.ask(START).status == DONE  # a new one


@pytest.mark.parametrize("op", [STATUS, STOP, SNAPSHOT])
def test_a_start_with_the_bytes_of_an_old_one_is_new_once_its_host_has_gone_on(op):
    """A host that has asked something else has got the reply to its START. As the numbers of
    requests wrap, a later START may have the same bytes."""
    device = Device()
    start = device.request(START)
    assert device.answer(start).status == DONE
    device.ask(op)
    assert device.ask(STOP, session=OTHER).status == DONE
    assert device.answer(start).status == DONE
    assert device.state == "calibrate"


@pytest.mark.parametrize("watchdog_ms", [5, 20])
def test_a_session_without_requests_ends(watchdog_ms):
    """It ends after four times the watchdog's time, and its streams end with it."""
    device = Device(watchdog_ms=watchdog_ms)
    device.stream(0, 10, "state")
    limit = 4 * watchdog_ms * 10
    asked = device.ask(STATUS).tick
    while device.service.session:
        device.tick()
    assert device.now - asked == limit + 2  # the background runs before the interrupt
    device.tick(100)
    device.samples(0)
    device.tick(100)
    assert device.samples(0) == []
    assert device.ask(TRIGGER, session=NONCE).status == SESSION
    assert device.ask(OPEN, nonce(OTHER)).status == DONE


def test_a_watchdog_of_no_time_has_a_millisecond():
    """0 ms must neither wrap round to 120 hours nor leave a drive without a watchdog."""
    device = Device(session=False, watchdog_ms=0)
    assert device.service.setup.watchdog_ms == 1
    assert device.ask(OPEN, nonce(NONCE)).status == DONE
    device.tick(30)
    assert device.service.session == NONCE
    device.tick(20)  # four times its time
    assert device.service.session == 0


def test_a_session_with_requests_stays():
    device = Device(watchdog_ms=5)
    for _ in range(20):
        device.tick(150)
        device.done(STATUS)
    device.tick(150)
    device.ask(STATUS, session=OTHER)  # somebody else's request is no sign of life
    device.tick(60)
    assert device.service.session == 0


def test_streams_end_with_close():
    device = Device()
    device.stream(0, 5, "state")
    device.tick(50)
    assert len(device.samples(0)) > 5
    device.done(CLOSE)
    device.samples(0)
    device.tick(100)
    assert device.samples(0) == []


# --- watchdog -----------------------------------------------------------------------------


@pytest.mark.parametrize("f_isr_Hz", [5000.0, 10000.0, 20000.0])
@pytest.mark.parametrize("watchdog_ms", [0, 1, 7, 250])
def test_the_watchdog_runs_out_after_its_time(watchdog_ms, f_isr_Hz):
    """The time is counted in interrupts, from the first one after the request. The gates go off in
    the interrupt in which it runs out. A board whose time is set to 0 waits 1 ms, because the
    counter must not go below 0."""
    device = Device(watchdog_ms=watchdog_ms, f_isr_Hz=f_isr_Hz)
    watchdog_ms = max(1, watchdog_ms)
    begun = device.done(START).tick
    assert device.state == "calibrate"
    limit = round(watchdog_ms * 1e-3 * f_isr_Hz)
    for _ in range(limit + 10):
        if device.state == "fault":
            break
        assert device.service.armed
        device.tick()
    assert device.drive.snapshot.tick - (begun + 1) == limit
    assert device.controller.faults == ["link lost"]
    assert device.gates_off
    assert not device.service.armed
    assert struct.unpack_from("<H", device.ask(HELLO).payload, 32) == (watchdog_ms,)


def test_a_start_without_a_heartbeat_ends_in_link_lost():
    """It ends in the fault `link lost`, which needs a CLEAR."""
    device = Device()
    device.done(START)
    device.tick(TO_RUN)
    assert device.state == "run"
    assert not device.gates_off
    assert until_fault(device, 2500 - TO_RUN + 10) is not None
    assert device.gates_off
    assert device.ask(START).status == STATE
    reply = device.ask(STATUS)
    assert (reply.state, reply.faults) == ("fault", 0x1000)
    device.done(CLEAR)
    device.run()


SESSION_REQUESTS = {
    "STATUS": (STATUS, b""),
    "HELLO": (HELLO, b""),
    "GET": (GET, nonce(0)),
    "refused": (START, b""),
    "wrong length": (STATUS, b"?"),
    "unknown": (63, b""),
}


@pytest.mark.parametrize("name", SESSION_REQUESTS)
def test_every_request_of_the_session_restarts_the_watchdog(name):
    op, payload = SESSION_REQUESTS[name]
    device = Device(watchdog_ms=20)
    device.run()
    for _ in range(10):
        device.tick(150)
        asked = device.ask(op, payload).tick
        assert device.state == "run"
    until_fault(device, 300)
    assert device.drive.snapshot.tick - (asked + 1) == 200


def test_a_repetition_restarts_the_watchdog():
    """The reply was lost, but the repetition shows that the host still runs."""
    device = Device(watchdog_ms=20)
    device.run()
    body = device.request(STATUS)
    for _ in range(5):
        assert device.answer(body) is not None
        device.tick(150)
    assert device.state == "run"


NO_FOOD = {
    "nobody's STATUS": lambda d: frame(d.request(STATUS, session=0)),
    "another's STATUS": lambda d: frame(d.request(STATUS, session=OTHER)),
    "another's OPEN": lambda d: frame(d.request(OPEN, nonce(OTHER), session=0)),
    "HELLO": lambda d: frame(d.request(HELLO, session=0)),
    "LIST": lambda d: frame(d.request(LIST, b"\0\0\0", session=0)),
    "SNAPSHOT": lambda d: frame(d.request(SNAPSHOT, session=0)),
    "damaged": lambda d: frame(d.request(STATUS))[:-3] + b"\x55\x55\0",
    "noise": lambda d: bytes(range(256)),
    "zeros": lambda d: bytes(20),
    "a sample": lambda d: frame(b"\x40\0" + nonce(NONCE) + bytes(6)),
    "a request without a head": lambda d: frame(b"\x05\x01\x34\x12"),
}


@pytest.mark.parametrize("name", NO_FOOD)
def test_nothing_else_restarts_the_watchdog(name):
    device = Device(watchdog_ms=20)
    device.run()
    asked = device.ask(STATUS).tick
    for _ in range(30):
        device.put(NO_FOOD[name](device))
        device.tick(10)
    assert device.drive.snapshot.tick - (asked + 1) == 200
    assert device.controller.faults == ["link lost"]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 260), min_size=1, max_size=12))
def test_a_heartbeat_keeps_the_drive_running(pauses):
    """The drive runs as long as no pause is longer than the watchdog's time."""
    device = Device(watchdog_ms=20)
    device.run()
    asked = device.ask(STATUS).tick
    for pause in pauses:
        device.tick(pause)
        # An interrupt takes bytes that came before it: 14 bytes need one or two.
        body = device.request(STATUS)
        reply = device.answer(body)
        if device.now - asked > 203 and reply.tick - asked > 200:
            assert reply.state == "fault"
            assert device.drive.snapshot.tick - (asked + 1) == 200
            return
        assert reply.state == "run"
        asked = reply.tick


def test_status_has_the_time_that_is_left():
    device = Device()
    assert device.watchdog() == (False, 0)
    device.run()
    asked = device.ask(STATUS).tick
    device.tick(500)
    armed, left_ms = device.watchdog()
    assert armed
    assert left_ms == pytest.approx(250 - (device.now - asked) / 10, abs=1)


def is_disarmed(device):
    """The gates are off, and the watchdog trips no more."""
    assert device.gates_off
    assert not device.service.armed
    device.tick(300)
    return "link lost" not in device.controller.faults


@pytest.mark.parametrize("request_", [STOP, CLOSE])
def test_stop_and_close_disarm_the_watchdog(request_):
    device = Device(watchdog_ms=20)
    device.run()
    device.done(request_)
    assert device.state == "idle"
    assert is_disarmed(device)


def test_a_fault_disarms_the_watchdog():
    device = Device(watchdog_ms=20)
    device.run()
    device.sense(1, 4095)
    device.tick(3)
    assert device.state == "fault"
    found = ["over-current", "currents of a set do not add up to zero"]
    assert device.controller.faults == found
    assert is_disarmed(device)


def test_a_start_without_a_session_is_not_guarded():
    device = Device(watchdog_ms=5)
    assert lib.ht_drive_start(device.drive) == lib.HT_OK
    device.done(STATUS)
    device.tick(1000)
    assert device.state == "run"
    assert device.service.session == 0
    assert device.ask(OPEN, nonce(OTHER)).status == DONE
    assert device.ask(CLOSE, session=OTHER).status == DONE
    assert device.state == "run"  # this session did not start the drive
    device.ask(STOP)
    assert device.state == "idle"


def test_a_refused_start_does_not_arm_the_watchdog():
    device = Device(watchdog_ms=5)
    assert lib.ht_drive_start(device.drive) == lib.HT_OK
    assert device.ask(START).status == STATE
    assert not device.service.armed
    device.tick(300)
    assert device.state == "run"


def test_session_and_watchdog_survive_a_wrap_of_the_counter():
    """The counter of interrupts wraps while the drive runs. This has no effect on session and
    watchdog."""
    device = Device(watchdog_ms=20)
    device.drive.tick = 2**32 - 400
    device.service.session_tick = device.drive.tick
    device.run()
    for _ in range(20):
        device.tick(100)
        assert device.ask(STATUS).state == "run"
    assert device.now < 4000
    assert device.service.session == NONCE
    assert until_fault(device, 250) is not None
    device.tick(900)
    assert device.service.session == 0


def test_every_start_finds_its_watchdog():
    """Start and stop in quick succession, with any number of interrupts between."""
    for pause in range(1, 8):
        device = Device(watchdog_ms=3)
        for _ in range(4):
            device.done(START)
            device.tick(pause)
            device.done(STOP)
        device.done(START)
        assert until_fault(device, 60) is not None
        assert device.controller.faults == ["link lost"]


def test_a_capture_can_trigger_on_the_loss_of_the_host():
    """The loss of the host is a fault like any other, so a capture can trigger on it."""
    device = Device(watchdog_ms=20)
    device.run()
    payload = struct.pack("<BBHIIHfH", 1, 5, 1, 40, 20, 0, 0.0, 0)
    assert device.ask(ARM, payload).status == DONE
    until_fault(device, 400)
    device.tick(40)
    assert device.service.burst.state == 5
    assert device.service.burst.tick == device.drive.snapshot.tick


def test_what_the_receiver_has_lost_is_told_and_damages_its_frame():
    device = Device()
    line = device.service.setup.line
    whole, lost_at = line.read, [2, 5]

    @ffi.callback("uint16_t(void *, uint16_t *, uint16_t, bool *)")
    def read(at, octets, n, lost):
        came = whole(at, octets, n, lost)
        if came and lost_at and lost_at[0] == device.now - began:
            lost_at.pop(0)
            lost[0] = True
        return came

    line.read = read
    began = device.now
    for octet in frame(device.request(STATUS)):
        device.put(bytes([octet]))
        device.tick()
    device.tick(50)
    assert device.receive() == []
    damaged, overruns = struct.unpack_from("<II", device.ask(STATUS).payload, 4)
    assert (damaged, overruns, lost_at) == (1, 2, [])
