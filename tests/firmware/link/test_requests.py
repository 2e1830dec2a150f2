"""Requests as docs/protocol.md defines them: which ones are carried out and which are refused, and
that a refused request changes nothing."""

import math
import re
import struct
import zlib

import numpy as np
import protocol_examples
import pytest
from device import (
    ARM,
    CANCEL,
    CAPTURE,
    CHANNELS,
    CLEAR,
    CLOSE,
    CONFIG,
    DICTIONARY,
    DONE,
    FORGET,
    FORGET_LOG,
    GET,
    HELLO,
    ID,
    LENGTH,
    LIST,
    MARK,
    NO_CAPTURE,
    NONCE,
    OPCODE,
    OPEN,
    PARAMETERS,
    READ,
    SAMPLING,
    SAVE,
    SESSION,
    SNAPSHOT,
    START,
    STATE,
    STATUS,
    STOP,
    STORE,
    STREAM,
    TRIGGER,
    TURNING,
    VALUE,
    WRITE,
    Device,
    frame,
)

from hexatorque import firmware
from hexatorque.firmware import ffi, lib
from hexatorque.serial import wire

NEEDS_SESSION = wire.NEEDS_SESSION  # the client opens a session for these
NEEDS_DICTIONARY = {GET, WRITE, START, CLEAR, STREAM, ARM, SAVE, FORGET, FORGET_LOG}
#: A payload of a right length.
RIGHT = {
    LIST: struct.pack("<BH", 0, 0),
    OPEN: struct.pack("<HI", NONCE, MARK),
    GET: struct.pack("<H", 0),
    WRITE: struct.pack("<Hf", PARAMETERS["speed_ref_rpm"], 1.0),
    STREAM: struct.pack("<BBHH", 0, 1, 10, 0),
    ARM: struct.pack("<BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0),
    READ: struct.pack("<II", 0, 0),
}
WRONG = {
    HELLO: [1],
    LIST: [0, 2, 4],
    OPEN: [0, 2, 5, 7],
    CLOSE: [1],
    STATUS: [1],
    GET: [1, 3, 202, 501],
    WRITE: [0, 5, 7, 486],
    START: [1],
    STOP: [1, 6],
    CLEAR: [1],
    STREAM: [0, 3, 5],
    ARM: [0, 17, 19],
    CAPTURE: [1],
    READ: [0, 7, 9],
    TRIGGER: [1],
    CANCEL: [1],
    SNAPSHOT: [1],
    SAVE: [1],
    FORGET: [1],
}


def everything(device):
    """The state that a refused request must not change."""
    s = device.service
    return (
        [lib.ht_drive_get(device.drive, k) for k in range(lib.ht_param_count())],
        device.state,
        s.session,
        s.burst.state,
        s.burst.number,
        [(x.active, x.n, x.decimation) for x in s.streams.stream],
    )


@pytest.fixture
def device():
    return Device()


# --- which requests are accepted --------------------------------------------------------------


@pytest.mark.parametrize("op", range(1, 20))
def test_a_request_of_a_wrong_length_is_refused(device, op):
    before = everything(device)
    for n in WRONG[op]:
        reply = device.ask(op, bytes(n))
        assert (reply.status, reply.payload) == (LENGTH, b""), n
    assert everything(device) == before


@pytest.mark.parametrize("op", range(1, 20))
def test_requests_that_need_a_session_are_refused_without_it(device, op):
    before = everything(device)
    for session in (0, NONCE + 1, 0xFFFF):
        reply = device.ask(op, RIGHT.get(op, b""), session=session)
        if op in NEEDS_SESSION:
            assert (reply.status, reply.payload) == (SESSION, b"")
        else:
            assert reply.status == DONE
    assert everything(device) == before
    closed = Device(session=False)
    for session in (0, NONCE):
        status = closed.ask(op, RIGHT.get(op, b""), session=session).status
        assert (status == SESSION) == (op in NEEDS_SESSION)


@pytest.mark.parametrize("op", range(1, 20))
def test_requests_with_a_stale_dictionary_are_refused(device, op):
    before = everything(device)
    for wrong in (1, 0x8000, 0xFFFF):
        reply = device.ask(op, RIGHT.get(op, b""), dictionary=device.dictionary ^ wrong)
        if op in NEEDS_DICTIONARY:
            assert (reply.status, reply.payload) == (DICTIONARY, b"")
            assert everything(device) == before
        else:
            assert reply.status != DICTIONARY


@pytest.mark.parametrize("op", [21, 32, 63])
def test_an_unknown_opcode_is_refused(device, op):
    assert device.ask(op).status == OPCODE
    assert device.ask(op, bytes(300)).status == OPCODE


def test_what_is_no_request_is_dropped_and_counted(device):
    """As the page tells it. Other bodies are an echo of the device's own, for example."""
    page = protocol_examples.PAGE.read_text()
    first, last = (
        int(n, 16) for n in re.search(r"request's \((0x\w+) to (0x\w+)\)", page).groups()
    )
    assert f"| 0x{first:02X} … 0x{last:02X} | host | request |" in page
    for op in range(256):
        damaged = device.service.damaged
        reply = device.answer(struct.pack("<BBHH", op, 1, 0, 0), 30)
        assert (reply is not None) == (first <= op <= last) == (device.service.damaged == damaged)


def test_bodies_outside_the_lengths_of_the_page_are_dropped_and_counted(device):
    page = protocol_examples.PAGE.read_text()
    least, most = map(int, re.search(r"A body is (\d+) to (\d+) bytes long", page).groups())
    assert most == wire.LONGEST_BODY and device.ask(HELLO).status == DONE
    longest = device.request(GET, bytes(most - 6))
    for n in (*range(1, 7), most - 1, most, most + 1, most + 2):
        damaged = device.service.damaged
        body = (longest + bytes(2))[:n]
        reply = device.answer(body, 100)
        if least <= n <= most:  # from two bytes on there is an id to answer to
            assert reply.status == (DONE if n == 6 else LENGTH), n
            assert device.service.damaged == damaged
        else:
            assert reply is None and device.service.damaged == damaged + 1, n


def test_every_reply_has_status_state_faults_and_tick(device):
    device.id = 254
    for _ in range(4):  # ids wrap
        reply = device.ask(STATUS)
        assert (reply.status, reply.state, reply.faults) == (DONE, "idle", 0)
        assert 0 <= device.now - reply.tick < 10


# --- the dictionary ---------------------------------------------------------------------------


def test_the_dictionary_has_every_row_and_its_crc(device):
    hello = device.done(HELLO).payload
    version, crc, f_isr_Hz, budget, *rows = struct.unpack_from("<HIfI4H", hello)
    longest, streams, per_stream, per_capture, taken, memory, watchdog_ms = struct.unpack_from(
        "<HBBBBIH", hello, 22
    )
    assert (version, f_isr_Hz, budget, longest) == (2, 10000.0, 112500, 508)
    assert (streams, per_stream, per_capture, taken, memory) == (4, 32, 16, 1, 20480)
    assert watchdog_ms == 250
    assert hello[34:].split(b"\0")[0] == b"virtual f28377s"
    assert Device(session=False).ask(HELLO).payload[27] == 0
    found = 0
    texts = []
    for kind, count in enumerate(rows):
        for row in range(count):
            payload = device.done(LIST, "BH", kind, row).payload
            assert struct.unpack_from("<BH", payload) == (kind, row)
            assert len(payload) <= 498
            found = zlib.crc32(payload, found)
            texts.append(payload[{0: 17, 1: 4, 2: 5, 3: 3}[kind] :].split(b"\0")[:-1])
        reply = device.ask(LIST, struct.pack("<BH", kind, count))
        assert (reply.status, reply.payload) == (ID, b"\xff\xff")
    assert found == crc
    for kind, row in ((4, 1), (5, 1), (6, 1), (7, 1), (9, len(firmware.LIMITS)), (10, 0), (255, 0)):
        assert device.ask(LIST, struct.pack("<BH", kind, row)).status == ID
    names = [t[0].decode() for t in texts]
    assert names[: rows[0]] == list(PARAMETERS)
    assert names[rows[0] : rows[0] + rows[1]] == list(CHANNELS)
    assert names[-len(firmware.STATES) :] == list(firmware.STATES)
    # Each kind has its number of texts, so no row is cut.
    per_kind = [4] * rows[0] + [3] * rows[1] + [2] * rows[2] + [1] * rows[3]
    assert [len(t) for t in texts] == per_kind


def test_the_row_of_additions_has_the_flags_of_states(device):
    """It is neither counted by HELLO nor covered by the CRC: clients of version 2.0 compute that
    without it."""
    payload = device.done(LIST, "BH", 4, 0).payload
    kind, row, minor, *flags = struct.unpack(f"<BHH{len(payload) - 5}B", payload)
    assert (kind, row, minor) == (4, 0, 5)
    gates = {"build", "run", "test"}
    assert dict(zip(firmware.STATES, flags, strict=True)) == {
        name: (name in gates | {"calibrate"}) + 2 * (name in gates) + 4 * (name in gates - {"test"})
        for name in firmware.STATES
    }


def test_the_row_of_the_reset_says_why_the_board_started(device):
    """A virtual board starts by power-on, and no watchdog resets it."""
    payload = device.done(LIST, "BH", 5, 0).payload
    assert struct.unpack_from("<BHBH", payload) == (5, 0, 1, 0)
    assert payload[6:] == b"power-on\0\0"


@pytest.mark.parametrize("cause", range(lib.HT_RESETS))
@pytest.mark.parametrize("watchdogs", (0, 1, 65535))
def test_every_cause_of_a_reset_is_told_with_its_text(device, cause, watchdogs):
    device.controller.board.reset.cause = cause
    device.controller.board.reset.watchdogs = watchdogs
    row = lib.ht_reset_describe(cause)
    texts = ffi.string(row.name), ffi.string(row.help), b""
    payload = device.done(LIST, "BH", 5, 0).payload
    assert struct.unpack_from("<BHBH", payload) == (5, 0, cause, watchdogs)
    assert payload[6:].split(b"\0") == list(texts) and texts[0]
    assert wire.parse_reset(payload) == (cause, watchdogs, *(t.decode() for t in texts[:2]))
    assert wire.parse_reset(payload + b"later\0\x01") == wire.parse_reset(payload)


def test_a_board_that_does_not_know_its_reset_has_no_such_row(device):
    device.service.setup.reset = ffi.NULL
    assert device.ask(LIST, struct.pack("<BH", 5, 0)).status == ID


def test_parameters_in_the_dictionary(device):
    for row in firmware.parameters("f28377s").values():
        payload = device.done(LIST, "BH", 0, row.id).payload
        kind, flags, low, high, initial = struct.unpack_from("<BBfff", payload, 3)
        assert (kind, flags) == (0, row.live + 2 * row.whole)
        assert (
            np.float32([low, high, initial]).tolist()
            == np.float32([row.min, row.max, row.initial]).tolist()
        )
        name, unit, choices, text, _ = payload[17:].decode().split("\0")
        assert (name, unit, text) == (row.name, row.unit, row.help)
        assert tuple(choices.split("|") if choices else ()) == row.choices


# --- parameters -------------------------------------------------------------------------------


def test_get_returns_the_values_in_force(device):
    ids = list(range(len(PARAMETERS)))
    for some in (ids[: lib.HT_NUMBER_GET], ids[lib.HT_NUMBER_GET :]):
        values = device.done(GET, f"{len(some)}H", *some).payload
        assert struct.unpack(f"<{len(some)}f", values) == tuple(
            lib.ht_drive_get(device.drive, k) for k in some
        )
    assert len(device.done(GET, "100H", *[3] * 100).payload) == 400
    assert device.done(GET).payload == b""
    for bad in (len(ids), 0x8000, 0xFFFF):
        reply = device.ask(GET, struct.pack("<3H", 0, bad, 1))
        assert (reply.status, reply.payload) == (ID, struct.pack("<H", bad))


def test_write_takes_effect_in_the_interrupt_that_it_names(device):
    device.run()
    reply = device.write(scheme=0, speed_ref_rpm=-12.5, torque_limit_Nm=7.0)
    assert reply.status == DONE
    tick, *values = struct.unpack("<I3f", reply.payload)
    assert values == [0.0, -12.5, 7.0]
    assert reply.tick < tick <= device.now
    assert device.channel("scheme") == 0.0
    assert device.value("speed_ref_rpm") == -12.5


def test_a_written_scheme_applies_from_the_tick_on(device):
    """The channel `scheme` is the one in force: a stream of it changes at the reply's tick."""
    device.run()
    assert device.stream(0, 2, "scheme").status == DONE
    for scheme in (0, 5, 2):
        device.samples(0)
        reply = device.write(scheme=scheme)
        (tick,) = struct.unpack_from("<I", reply.payload)
        device.tick(20)
        got = {t: v[0] for _, t, v in device.samples(0)}
        assert {v for t, v in got.items() if t >= tick} == {scheme}
        assert scheme not in {v for t, v in got.items() if t < tick}


BAD = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_write_with_a_bad_value_is_refused_as_a_whole(device, name):
    """A value that is NaN, infinite, out of range or between two choices is refused, also among
    many good ones."""
    row = firmware.parameters()[name]
    beyond = [np.nextafter(np.float32(row.max), np.float32(np.inf))]
    beyond += [np.nextafter(np.float32(row.min), np.float32(-np.inf))]
    beyond += [row.min + 0.5, row.max - 0.25] if row.whole else []
    before = everything(device)
    for value in [*BAD, *map(float, beyond)]:
        pairs = [("kp_speed_Nms_rad", 0.9), (name, value), ("ki_speed_Nm_rad", 0.3)]
        payload = b"".join(struct.pack("<Hf", PARAMETERS[n], v) for n, v in pairs)
        reply = device.ask(WRITE, payload)
        assert reply.status == VALUE, value
        assert reply.payload == struct.pack("<H", row.id)
        assert everything(device) == before


def test_parameters_that_are_whole_numbers():
    whole = {n for n, row in firmware.parameters().items() if row.whole and not row.choices}
    assert whole == {"pole_pairs", "encoder_counts_rev", "lost_legs", "restart_count"}
    assert not lib.ht_param_valid(PARAMETERS["pole_pairs"], 2.5)
    assert lib.ht_param_valid(PARAMETERS["rs_ohm"], 2.5)


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("pole_pairs", 3.0, 2.5),
        ("encoder_counts_rev", 1001.0, 1000.5),
        ("encoder_counts_rev", 3999999.0, 3999998.75),
    ],
)
def test_fractions_of_whole_numbers_are_refused(device, name, good, bad):
    """Half a pole pair and half an encoder edge do not exist."""
    was = device.value(name)
    reply = device.write(**{name: bad})
    assert (reply.status, reply.payload) == (VALUE, struct.pack("<H", PARAMETERS[name]))
    assert device.value(name) == was
    with pytest.raises(firmware.FirmwareError, match=r"allowed range is .*, whole numbers only"):
        device.controller.set(name, bad)
    assert device.write(**{name: good}).status == DONE
    assert device.value(name) == good


@pytest.mark.parametrize("f_isr_Hz", [1527.0, 7300.0, 10001.0, 49999.0])
def test_hello_has_the_boards_actual_rate(f_isr_Hz):
    """Periods are whole counts of the PWM clock, here 100 MHz."""
    device = Device()
    f_slow_Hz = f_isr_Hz / round(f_isr_Hz / 100.0)
    assert device.write(f_isr_Hz=f_isr_Hz, f_slow_Hz=f_slow_Hz).status == DONE
    assert device.value("f_isr_Hz") == f_isr_Hz
    (rate_Hz,) = struct.unpack_from("<f", device.done(HELLO).payload, 6)
    counts = round(1e8 / f_isr_Hz)
    assert rate_Hz == np.float32(1e8 / counts)
    assert device.drive.config.control.period.counts == counts


def test_interrupt_rates_that_do_not_fit_are_refused(device):
    before = everything(device)
    for f_isr_Hz, status in ((999.0, VALUE), (50001.0, VALUE), (1500.0, CONFIG), (10050.0, CONFIG)):
        reply = device.write(f_isr_Hz=f_isr_Hz)
        assert reply.status == status, f_isr_Hz  # below 1526 Hz a period has too many counts
    assert everything(device) == before


def test_an_unknown_parameter_is_refused(device):
    before = everything(device)
    for bad in (len(PARAMETERS), 0x0100, 0xFFFF):
        pairs = struct.pack("<HfHf", PARAMETERS["speed_ref_rpm"], 5.0, bad, 1.0)
        reply = device.ask(WRITE, pairs)
        assert (reply.status, reply.payload) == (ID, struct.pack("<H", bad))
        assert everything(device) == before


def test_a_write_of_many_sets_all_or_none(device):
    """The largest number of parameters is written: all of them or none, whichever of them is
    bad."""
    ident = PARAMETERS["speed_ref_rpm"]
    good = [struct.pack("<Hf", ident, float(k)) for k in range(80)]
    for at in (0, 1, 40, 79):
        bad = [*good]
        bad[at] = struct.pack("<Hf", ident, math.nan)
        assert device.ask(WRITE, b"".join(bad)).status == VALUE
        assert device.value("speed_ref_rpm") == 0.0
    reply = device.ask(WRITE, b"".join(good))
    assert reply.status == DONE
    assert len(reply.payload) == 4 + 80 * 4
    assert device.value("speed_ref_rpm") == 79.0  # the last one counts


@pytest.mark.parametrize("name", [n for n, r in firmware.parameters().items() if not r.live])
def test_some_parameters_change_only_while_idle(device, name):
    row = firmware.parameters()[name]
    value = lib.ht_drive_get(device.drive, row.id)
    device.run()
    before = everything(device)
    pairs = struct.pack("<HfHf", PARAMETERS["speed_ref_rpm"], 5.0, row.id, value)
    reply = device.ask(WRITE, pairs)
    assert (reply.status, reply.payload) == (STATE, struct.pack("<H", row.id))
    assert everything(device) == before
    device.done(STOP)
    assert device.ask(WRITE, pairs).status == DONE


def test_values_that_do_not_fit_together_are_refused(device):
    before = everything(device)
    reply = device.write(torque_band_Nm=0.1, torque_inner_Nm=0.2)
    assert (reply.status, reply.payload) == (CONFIG, struct.pack("<H", lib.HT_MISFIT_TORQUE_BANDS))
    reply = device.write(dead_time_us=20.0, f_isr_Hz=1000.0)  # no period of that length
    assert (reply.status, reply.payload) == (CONFIG, struct.pack("<H", lib.HT_MISFIT_PERIOD))
    assert everything(device) == before
    assert device.write(torque_inner_Nm=0.1, torque_band_Nm=0.2).status == DONE


def test_a_scheme_that_needs_another_set_up_is_refused_with_the_reason(device):
    """The status says all: no number comes with it."""
    before = everything(device)
    scheme = firmware.schemes().index("db-dtfc")
    assert device.write(predict=0.0).status == DONE
    reply = device.write(scheme=scheme)
    assert (reply.status, reply.payload) == (lib.HT_ERROR_PREDICTION, b"\xff\xff")
    reply = device.write(scheme=scheme, predict=1.0, f_isr_Hz=2000.0, rs_ohm=30.0)
    assert (reply.status, reply.payload) == (lib.HT_ERROR_SAMPLING, b"\xff\xff")
    assert device.write(predict=1.0).status == DONE
    assert everything(device) == before


def test_a_store_that_fails_is_told_from_none():
    class Failing(firmware.MemoryStore):
        def put(self, begin, raw):
            return False

    for store, detail in ((Failing(), b"\0\0"), (None, b"\xff\xff")):
        device = Device(store=store)
        for op in (SAVE, FORGET):
            reply = device.ask(op)
            assert (reply.status, reply.payload) == (STORE, detail)


def test_a_service_without_a_store(device):
    device.service.setup.store = ffi.NULL
    assert device.done(STATUS).payload[-1] == lib.HT_SET_DEFAULTS
    for op in (SAVE, FORGET):
        reply = device.ask(op)
        assert (reply.status, reply.payload) == (STORE, b"\xff\xff")


def test_rate_cannot_change_while_a_stream_or_capture_depends_on_it(device):
    rate = struct.pack("<H", PARAMETERS["f_isr_Hz"])
    device.stream(2, 100, "state")
    reply = device.write(f_isr_Hz=5000.0)
    assert (reply.status, reply.payload) == (SAMPLING, rate)
    assert device.write(f_isr_Hz=10000.0).status == DONE  # as it is
    device.stream(2, 1)
    device.done(ARM, "BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0)
    assert device.write(f_isr_Hz=5000.0).status == SAMPLING
    device.done(TRIGGER)
    device.tick(30)
    assert device.write(f_isr_Hz=5000.0).status == DONE
    assert device.now
    assert struct.unpack_from("<f", device.done(HELLO).payload, 6) == (5000.0,)


# --- commands ---------------------------------------------------------------------------------


def test_commands_in_the_wrong_state_are_refused(device):
    assert device.ask(CLEAR).status == STATE
    device.run()
    assert (device.ask(START).status, device.ask(CLEAR).status) == (STATE, STATE)
    assert device.state == "run"
    device.sense(0, 4095)
    device.tick(2)
    reply = device.ask(START)
    assert (reply.status, reply.payload, reply.state) == (STATE, b"\xff\xff", "fault")
    assert reply.faults & lib.HT_FAULT_OVERCURRENT
    device.done(STOP)  # does not clear a fault
    assert device.state == "fault"
    device.sense(0, 2048)
    assert device.done(CLEAR).status == DONE
    assert (device.state, device.controller.faults) == ("idle", [])


def test_the_start_of_a_turning_machine_is_refused(device):
    device.drive.speed_rpm = 100.0
    assert device.ask(START).status == TURNING
    assert device.state == "idle"


def test_every_client_may_stop(device):
    for session, dictionary in ((0, 0), (NONCE + 1, 0), (NONCE, 0)):
        device.run()
        device.ask(STOP, session=session, dictionary=dictionary)
        assert device.state == "idle"
        assert device.gates_off


def test_the_snapshot_is_that_of_the_drive(device):
    assert device.done(SNAPSHOT).payload == bytes(80)
    device.run()
    device.sense(3, 4095)
    device.tick(5)
    device.drive.snapshot.warnings = 0x0110
    words = struct.unpack("<I3H7HI13f", device.done(SNAPSHOT).payload)
    tick, state, faults, warnings, *rest = words
    assert warnings == 0x0110
    kept = device.controller.snapshot
    told = [tick, firmware.STATES[state], firmware.causes(faults)]
    assert told == [kept[name] for name in ("tick", "state", "faults")]
    assert (rest[:7], rest[7]) == (kept["adc_counts"], kept["position_counts"])
    assert rest[3] == 4095
    names = ("vdc_V", "torque_ref_Nm", "flux_ref_Wb")
    values = [*kept["i_A"], *(kept[n] for n in names), *kept["psi_Wb"]]
    assert rest[8:] == [*values, kept["torque_Nm"], kept["speed_rpm"]]


# --- requests without effect ------------------------------------------------------------------


def test_requests_without_effect_are_answered(device):
    """As docs/protocol.md says, these requests give no error, or an error with the reason."""
    assert (device.done(GET).payload, device.done(CANCEL).payload) == (b"", b"")
    for op, payload in ((TRIGGER, b""), (READ, bytes(8))):
        assert device.ask(op, payload).status == NO_CAPTURE
    assert device.done(CAPTURE).payload == bytes(20)
    assert device.stream(3, 1).status == DONE  # ends a stream that is not on


# --- repetitions ------------------------------------------------------------------------------


def test_repetition_is_answered_and_not_carried_out(device):
    body = device.request(START)
    first = device.answer(body)
    assert (first.status, first.state) == (DONE, "calibrate")
    device.tick(5)
    again = device.answer(body)
    assert again == first  # a second start would be refused
    assert device.state == "calibrate"
    for _ in range(12):
        device.done(STATUS)
        device.tick(15)
    assert device.state == "run"


def test_an_arm_that_is_repeated_arms_once(device):
    payload = struct.pack("<BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0)
    body = device.request(ARM, payload)
    numbers = [device.answer(body).payload for _ in range(3)]
    assert numbers == [b"\x01"] * 3
    assert device.ask(ARM, payload).payload == b"\x02"  # another id is another request


def test_repetition_of_a_write_does_not_overwrite(device):
    body = device.request(WRITE, struct.pack("<Hf", PARAMETERS["speed_ref_rpm"], 7.0))
    first = device.answer(body)
    lib.ht_drive_set(device.drive, PARAMETERS["speed_ref_rpm"], 8.0)  # a debugger
    assert device.answer(body) == first
    assert device.value("speed_ref_rpm") == 8.0


def test_repetition_after_another_request_is_a_new_one(device):
    body = device.request(ARM, struct.pack("<BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0))
    device.answer(body)
    device.ask(STATUS)
    assert device.answer(body).payload == b"\x02"


def test_stop_stops_also_when_repeated():
    """Two programs that send only STOP send the same bytes."""
    device = Device()
    body = struct.pack("<BBHH", STOP, 1, 0, 0)
    device.answer(body)
    lib.ht_drive_start(device.drive)  # a debugger
    device.tick(3)
    assert device.state == "calibrate"
    assert device.answer(body).status == DONE
    assert device.state == "idle"


def turn(device, raw):
    """The background alone."""
    for byte in raw:
        lib.ht_regfile_sci_arrive(device.controller.registers, byte)
        lib.ht_service_turn(ffi.addressof(device.controller.board, "service"))


def test_stop_does_not_wait_for_another_reply(device):
    """The reply to a WRITE waits for a fast interrupt. A STOP does not wait."""
    device.run()
    write = device.request(WRITE, struct.pack("<Hf", PARAMETERS["speed_ref_rpm"], 7.0))
    turn(device, frame(write))
    assert device.service.reply_due
    turn(device, frame(device.request(STOP)))
    assert device.state == "idle"
    assert device.gates_off
    assert device.wait(write).status == DONE


def test_a_request_that_comes_too_soon_is_done_when_repeated(device):
    """While a reply waits, the next request is dropped. It is carried out when it is repeated."""
    write = device.request(WRITE, struct.pack("<Hf", PARAMETERS["speed_ref_rpm"], 7.0))
    early = device.request(CANCEL)
    device.done(ARM, "BBHIIHfH", 1, 0, 1, 10, 5, 0, 0.0, 0)
    device.run()  # parameters are taken over by an interrupt
    turn(device, frame(write))
    turn(device, frame(early))
    assert device.service.burst.state != 0
    assert device.wait(write).status == DONE
    assert device.wait(early, 50) is None
    assert device.answer(early).status == DONE
    assert device.service.burst.state == 0


def test_a_request_of_processor_in_the_loop_is_refused_readably(device):
    """Its HELLO is shorter than the link's requests. It is refused by a reply that its host can
    read."""
    reply = device.answer(bytes([lib.HT_OP_PIL_HELLO, 1]))
    assert reply.status == LENGTH >= lib.HT_PIL_REFUSED


def test_every_limit_is_told_with_its_name_and_whether_it_acts(device):
    for row in range(lib.HT_LIMITS):
        info = lib.ht_limit_describe(row)
        told = wire.parse_limit(device.done(LIST, "BH", wire.LIMITS, row).payload, row)
        assert (told.bit, told.acts) == (1 << row, False)
        assert told.name.encode() == ffi.string(info.name)
        assert told.help
    device.run()
    device.drive.limits = lib.HT_LIMIT_POWER
    acts = [
        wire.parse_limit(device.done(LIST, "BH", wire.LIMITS, row).payload, row).acts
        for row in range(lib.HT_LIMITS)
    ]
    assert acts == [1 << row == lib.HT_LIMIT_POWER for row in range(lib.HT_LIMITS)]
