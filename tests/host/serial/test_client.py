"""The client with a fake board that is silent, slow, or sends damaged or wrong replies."""

import binascii
import re
import struct
import threading
import time
import types
from pathlib import Path

import numpy as np
import pytest
from peer import Peer, frame, parameter
from waiting import until

from hexatorque import firmware
from hexatorque.drive.board import BoardDrive
from hexatorque.results import RESULTS
from hexatorque.serial import LinkError, sharing, wire
from hexatorque.serial.exchange import NoReply
from hexatorque.serial.wire import Op

WRITE, STREAM, LIST = 7, 11, 2
PROTOCOL = Path(__file__).parents[3] / "docs" / "protocol.md"


@pytest.fixture
def peer():
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture
def drive(peer):
    with BoardDrive.open(peer.port) as drive:
        yield drive


def of(peer, op):
    return [body for body in peer.requests if body[0] == op]


def different(peer, op):
    """The number of requests without repetitions."""
    return len(set(of(peer, op)))


def test_nothing_of_the_compiled_firmware_is_needed(peer, monkeypatch):
    def none(*_):
        raise AssertionError("the compiled firmware was asked")

    for name in ("parameters", "channels", "schemes", "causes"):
        monkeypatch.setattr(firmware, name, none)
    with BoardDrive.open(peer.port) as drive:
        assert list(drive.params) == ["scheme", "speed_ref_rpm", "dead_time_us"]
        row = drive.params["speed_ref_rpm"]
        assert (row.min, row.max, row.unit, row.live) == (-400, 400, "r/min", True)
        assert drive.params["scheme"].choices == ("dtc1", "fdr", "ddr")
        assert drive.params["dead_time_us"].initial == 2.3  # not 2.299999952316284
        assert drive.channels == (("speed_rpm", "r/min"), ("torque_Nm", "N m"))
        assert drive.get("scheme") == "fdr" and drive.get("dead_time_us") == 2.3
        drive.set("scheme", "ddr")
        assert drive.get("scheme") == "ddr" and drive.state == "idle"


def test_of_a_board_that_says_nothing_about_its_states_the_worst_is_assumed(peer):
    """Such is a board of version 2.0. What a later version appends is ignored; a row that is too
    short is not taken for one."""
    with BoardDrive.open(peer.port) as drive:
        assert (drive.condition, drive.dictionary.minor) == (firmware.State("idle"), 0)
        assert drive.condition.at_work and drive.condition.gates_on and drive.condition.controls
    peer.additions = struct.pack("<H5B", 7, 0, 1, 7, 7, 0) + b"more of a later version"
    with BoardDrive.open(peer.port) as drive:
        assert drive.dictionary.minor == 7
        assert [tuple(state) for state in drive.dictionary.states] == [
            ("idle", False, False, False),
            ("calibrate", True, False, False),
            ("build", True, True, True),
            ("run", True, True, True),
            ("fault", False, False, False),
        ]
        peer.state = 9  # not in its dictionary
        assert drive.condition == firmware.State("9")
        peer.state = 0
    peer.additions = peer.additions[:6]
    with pytest.raises(LinkError, match="row of additions is too short"):
        BoardDrive.open(peer.port)


def test_faults_that_no_reply_has_are_asked_for_while_there_are_any(peer, drive):
    def asked():
        return [body for body in of(peer, LIST) if body[6] == wire.FAULTS]

    assert drive.client.get_status() and not asked()
    peer.words = (0x20041, 0)
    drive.client.get_status()
    assert drive.client.faults == 0x20000, "every reply has the first sixteen"
    peer.words = (0, 0x20041)
    drive.client.get_status()
    count = len(asked())
    assert count and drive.client.faults == 0
    drive.client.get_status()
    assert len(asked()) == count


@pytest.mark.parametrize(
    ("fault", "times"),
    [("mute", 2), ("damage", 1), ("late", 1), ("late", 2), ("twice", 1), ("cut", 2)],
)
def test_a_request_is_carried_out_once_whatever_happens(peer, drive, fault, times):
    drive.client.open_session()
    for value in (100.0, 200.0):
        before = len(of(peer, WRITE))
        with drive.client._one_at_a_time:  # no heartbeat takes the peer's faults
            peer.faults = [fault] * times
            drive.set("speed_ref_rpm", value)
        asked = of(peer, WRITE)[before:]
        assert peer.values[1] == value == drive.get("speed_ref_rpm")
        assert len(set(asked)) == 1  # the same bytes again
        if fault in ("mute", "damage", "cut"):
            assert len(asked) >= 1 + times
    assert peer.executed.count(WRITE) == 2
    if fault in ("damage", "cut"):
        assert drive.client.damaged == 2 * times
    assert drive.client.counters.retries > 0 or fault == "twice"


def test_a_process_gets_more_tries_than_a_line(peer):
    """It may have to wait for the processor."""
    assert sharing.tries(peer.port) == 16
    assert sharing.tries("/dev/ttyUSB0") == 8


def test_a_process_gets_sixteen_tries(peer, drive):
    drive.client.open_session()
    with drive.client._one_at_a_time:
        peer.faults = ["mute"] * 16
        begun = time.monotonic()
        with pytest.raises(NoReply, match=r"no reply to WRITE within 0\.[89]"):
            drive.set("speed_ref_rpm", 1.0)
        assert 16 * sharing.REPLY_S < time.monotonic() - begun
        assert len(of(peer, WRITE)) == 16 and peer.values[1] == 0.0
        drive.set("speed_ref_rpm", 2.0)
    assert peer.values[1] == 2.0
    ids = [body[1] for body in of(peer, WRITE)]
    assert len(set(ids)) == 2


@pytest.mark.parametrize("op", sorted(wire.SLOW))
def test_a_request_that_writes_a_flash_is_not_repeated_while_the_board_writes(peer, drive, op):
    """It waits as long as the page says, which is longer than a flash takes."""
    page = " ".join(PROTOCOL.read_text(encoding="utf-8").split())
    told = r"while it writes, which takes up to (\d+) s, .* waits (\d+) s longer than for others"
    flash_s, longer_s = map(float, re.search(told, page).groups())
    job = sharing.Job(op)
    sharing.Server(types.SimpleNamespace(url="", write=len), 1_250_000, None)._begin(job, 0.0)
    others_s = sharing.reply_s(1_250_000, len(job.sent) + wire.reply_bytes(op, 0))
    assert job.deadline_s == longer_s + others_s > flash_s
    drive.client.open_session()
    with drive.client._one_at_a_time:
        peer.faults = ["late"]  # by more than others wait
        {Op.SAVE: drive.store_parameters, Op.FORGET: drive.forget_parameters}[op]()
    assert len(of(peer, op)) == 1 and peer.executed.count(op) == 1


def test_the_reply_time_is_the_time_on_the_line_plus_50_ms():
    assert sharing.reply_s(9600, 500) == pytest.approx(0.05 + 500 / 960)
    # Samples may go first, nine times as many bytes as the reply has.
    assert wire.reply_bytes(Op.LIST, 3) == 11 * 517
    assert wire.reply_bytes(Op.STATUS, 0) == 11 * 120


@pytest.mark.parametrize("url", ["/dev/pts/7", "/dev/ttyUSB0"])
def test_two_lost_requests_in_a_row_do_not_end_a_drive(url):
    """A pseudo-terminal too may lead to a board on a line that loses bytes. The third request comes
    before the watchdog's time is over."""
    line = types.SimpleNamespace(url=url, write=len)
    one = sharing.Server(line, 1_250_000, None)
    beat = sharing.Job(Op.STATUS)
    one._begin(beat, 0.0)
    assert sharing.HEARTBEAT_S + 2 * beat.deadline_s < 0.25


def test_the_heartbeat_keeps_the_session_and_does_nothing_else(peer, drive):
    time.sleep(0.3)
    assert not of(peer, Op.STATUS)[2:] and peer.session == 0  # before and after it had a mark
    drive.start()
    begun = time.monotonic()
    peer.requests.clear()
    until(lambda: len(set(of(peer, Op.STATUS))) >= 8)
    beats = of(peer, Op.STATUS)
    assert len(set(beats)) <= 2 + (time.monotonic() - begun) / 0.08  # one that is late is repeated
    nonces = {struct.unpack_from("<H", body, 2)[0] for body in beats}
    assert nonces == {peer.session} and 0 not in nonces
    drive.close()
    assert peer.requests[-1][0] == Op.CLOSE and peer.session == 0


def test_a_session_that_the_board_lost_is_opened_again(peer, drive):
    drive.set("speed_ref_rpm", 1.0)
    peer.session = 0
    drive.set("speed_ref_rpm", 2.0)
    assert peer.values[1] == 2.0 and drive.client.counters.reconnects == 1


def test_open_waits_for_the_end_of_a_dead_clients_session(peer, drive):
    peer.refuse[Op.OPEN] = (20, b"")
    threading.Timer(0.8, peer.refuse.clear).start()
    drive.set("speed_ref_rpm", 3.0)
    assert peer.values[1] == 3.0
    drive.close()
    peer.refuse[Op.OPEN] = (20, b"")
    with BoardDrive.open(peer.port) as second, pytest.raises(LinkError, match="another client has"):
        second.client.open_session()


@pytest.mark.parametrize(
    ("status", "payload", "text", "mistake"),
    [
        (1, b"\1\0", "speed_ref_rpm = 9: no such parameter or channel", True),
        (2, b"\1\0", "speed_ref_rpm = 9: allowed is -400 .. 400 r/min", True),
        (26, b"\1\0", "can change only while nothing is streamed or captured", False),
        (4, b"\xff\xff", "speed_ref_rpm = 9: parameters do not fit together", True),
        (5, b"\xff\xff", "the hardware cannot do this", True),
        (6, b"\xff\xff", "the machine turns faster than start_max_rpm", False),
        (19, b"", "dictionary has changed", False),
        (20, b"", "another client has a session", False),
        (77, b"", "status 77", False),
    ],
)
def test_refusals_say_what_and_why(peer, drive, status, payload, text, mistake):
    peer.refuse[WRITE] = (status, payload)
    with pytest.raises(LinkError) as caught:
        drive.set("speed_ref_rpm", 9)
    assert text in str(caught.value)
    assert (caught.value.status, caught.value.mistake) == (status, mistake)


@pytest.mark.parametrize(
    ("op", "status", "payload", "text"),
    [
        (Op.STREAM, 23, b"", "all of the board's streams are in use"),
        (Op.STREAM, 24, b"\2\0", "decimation: allowed range is 1 .. 65535"),
        (Op.ARM, 24, b"\1\0", "trigger: the board does not know this one"),
        (Op.ARM, 24, b"\x0e\0", "level of the trigger: a number is needed"),
        (Op.ARM, 25, b"\0\x50\0\0", "samples: allowed range is 1 .. 20480"),
        (Op.ARM, 24, b"\7\0", "byte 7 of the payload is out of range"),
        (Op.ARM, 24, b"", "the board refuses a part of this request"),
    ],
)
def test_refusals_name_the_field(peer, drive, op, status, payload, text):
    peer.refuse[op] = (status, payload)
    with pytest.raises(LinkError, match=f"^what: {re.escape(text)}$") as caught:
        drive.client.do(op, what="what")
    assert caught.value.mistake


@pytest.mark.parametrize(
    ("payload", "left"),
    [(b"\x2c\x01", "; a start is refused for another 300 s"), (b"", "")],
)
def test_a_start_after_too_many_external_trips_names_the_limits_and_the_time_left(
    peer, drive, payload, left
):
    """It is no mistake of the request: the same one is accepted later."""
    peer.refuse[Op.START] = (11, payload)
    with pytest.raises(LinkError) as caught:
        drive.start()
    assert str(caught.value) == (
        "start: too many trips by hardware in a row (restart_count, restart_wait_s): "
        "find their cause" + left
    )
    assert (caught.value.status, caught.value.mistake) == (wire.Status.RESTART, False)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("speed_ref_rpm", 400.5, "allowed range is -400 .. 400 r/min"),
        ("speed_ref_rpm", float("nan"), "allowed range"),
        ("speed_ref_rpm", float("-inf"), "allowed range"),
        ("speed_ref_rpm", "fast", "a number is needed"),
        ("scheme", "ddr-ml", "choose one of dtc1, fdr, ddr"),
        ("rs_ohm", 1.0, "no parameter 'rs_ohm'"),
        ("load_Nm", 1.0, "belongs to the test bench"),
    ],
)
def test_a_value_out_of_range_is_not_sent(peer, drive, name, value, text):
    with pytest.raises(LinkError, match=text) as caught:
        drive.set_many({"dead_time_us": 1.0, name: value})
    assert caught.value.mistake and not of(peer, WRITE)


def test_whole_numbers_only(peer):
    peer.rows[2] = parameter(2, 2, 1, 64, 4, "pole_pairs")
    peer.crc = binascii.crc32(b"".join(peer.rows))
    with BoardDrive.open(peer.port) as drive:
        text = "pole_pairs = 2.5: allowed range is 1 .. 64, whole numbers only"
        with pytest.raises(LinkError, match=text) as caught:
            drive.set("pole_pairs", 2.5)
        assert caught.value.mistake and not of(peer, WRITE)
        drive.set("pole_pairs", 3)
        assert peer.values[2] == 3.0


def test_a_readback_that_differs_is_an_error(peer, drive):
    peer.values = Stubborn(peer.values)
    with pytest.raises(LinkError, match="speed_ref_rpm: 0 is in force instead of 5"):
        drive.set("speed_ref_rpm", 5.0)


class Stubborn(dict):
    def update(self, *_):
        pass


def cache() -> list[Path]:
    import os

    return list(Path(os.environ["XDG_CACHE_HOME"]).rglob("dictionary-*"))


def rows_asked(peer) -> int:
    """Without the row of additions, which the CRC does not cover."""
    return len({body for body in of(peer, LIST) if body[6] <= 3})


def test_a_saved_dictionary_is_used_only_with_the_right_crc(peer):
    BoardDrive.open(peer.port).close()
    asked = rows_asked(peer)
    assert asked == len(peer.rows) and len(cache()) == 1
    BoardDrive.open(peer.port).close()
    assert rows_asked(peer) == asked
    kept = cache()[0]
    good = kept.read_bytes()
    for damaged in (good[:-1], good[:40] + b"X" + good[41:], b"", b"\xff\xff", good + good[:9]):
        kept.write_bytes(damaged)
        before = rows_asked(peer)
        with BoardDrive.open(peer.port) as drive:
            assert list(drive.params) == ["scheme", "speed_ref_rpm", "dead_time_us"]
        assert rows_asked(peer) == before + len(peer.rows)
        assert kept.read_bytes() == good


def test_a_dictionary_that_is_not_what_hello_says_is_refused(peer):
    peer.crc ^= 1
    with pytest.raises(LinkError, match="the dictionary's CRC is"):
        BoardDrive.open(peer.port)
    assert not cache()


def test_another_firmware_is_another_dictionary(peer):
    with BoardDrive.open(peer.port) as drive:
        peer.rows[1] = peer.rows[1].replace(b"r/min\0\0", b"rad/s\0\0")
        peer.crc = binascii.crc32(b"".join(peer.rows))
        with pytest.raises(LinkError, match="dictionary has changed"):
            drive.get("scheme")
    with BoardDrive.open(peer.port) as drive:
        assert drive.params["speed_ref_rpm"].unit == "rad/s"


def test_another_protocol_is_refused(peer):
    peer.protocol = 1
    with pytest.raises(LinkError, match="protocol version 1, this client speaks 2"):
        BoardDrive.open(peer.port)


# -- streams


def feed(peer, stream, ticks, number=0):
    """Samples whose values are their ticks."""
    raw = b""
    for place, tick in enumerate(ticks):
        raw += peer.sample(0, number + place, tick, tick & 0xFFFF, -1.0)
    peer.write(raw)
    rows = []
    while block := stream.read(0.15 if rows and rows[-1][0] >= ticks[-1] else 2.0):
        assert block[0].dtype == np.int64 and block[1].dtype == np.float32
        rows += zip(block[0].tolist(), block[1][:, 0].tolist())
    return rows


@pytest.fixture
def stream(drive):
    with drive.stream(["speed_rpm", "torque_Nm"], rate_Hz=1000) as stream:
        yield stream


def test_gaps_are_counted_by_tick(peer, stream):
    peer_ticks = [1010, 1020, 1050, 1060, 1160]
    rows = feed(peer, stream, peer_ticks)
    assert rows == [(t, float(t)) for t in peer_ticks]
    assert (stream.gaps, stream.lost, stream.damaged) == (2, 2 + 9, 0)


def test_samples_missing_at_the_beginning_follow_from_the_number(peer, stream):
    assert feed(peer, stream, [1040, 1050], number=3) == [(1040, 1040.0), (1050, 1050.0)]
    assert (stream.gaps, stream.lost) == (1, 3)


def test_doubled_and_old_samples_are_left_out(peer, stream):
    rows = feed(peer, stream, [1010, 1010, 1020, 1030, 1020, 1040])
    assert [t for t, _ in rows] == [1010, 1020, 1030, 1040]
    assert (stream.gaps, stream.lost, stream.damaged) == (0, 0, 2)


def test_samples_of_another_stream_before_are_left_out(peer, stream):
    """They were still on the line when the stream was set, and are older than the reply."""
    assert [t for t, _ in feed(peer, stream, [980, 990, 1000, 1010])] == [1000, 1010]
    assert stream.lost == 2  # by the numbers of these samples


def test_the_tick_wraps(peer, drive):
    peer.tick = 0xFFFFFFFF - 25
    with drive.stream(["speed_rpm", "torque_Nm"], decimation=10) as stream:
        ticks = [0xFFFFFFFF - 15 + 10 * n for n in range(5)]
        rows = feed(peer, stream, ticks)
        assert [t for t, _ in rows] == ticks  # counted on beyond 2^32
        assert [v for _, v in rows] == [float(t & 0xFFFF) for t in ticks]
        assert stream.lost == stream.gaps == 0


def test_samples_before_a_reply_are_the_old_streams(peer, drive):
    """One read contains samples before and after the reply to STREAM."""
    client, got = drive.client, []

    def old(bodies):
        got.extend(("old", body[1]) for body in bodies)

    def new(bodies):
        got.extend(("new", body[1]) for body in bodies)

    def accepted(reply):
        client._sinks[0] = new

    client._sinks[0], client._awaited = old, (STREAM, 5, accepted)
    reply = struct.pack("<BBBBHI", STREAM + 0x80, 5, 0, 0, 0, 1000) + bytes(8)
    samples = [struct.pack("<BBIf", 0x40, n, t, 0.0) for n, t in ((1, 990), (2, 995), (0, 1000))]
    client._bodies([*samples[:2], reply, samples[2]])
    assert got == [("old", 1), ("old", 2), ("new", 0)]
    client._sinks[0] = None


def test_frames_of_another_width_are_not_samples(peer, stream):
    peer.write(peer.sample(0, 0, 1010, 1.0) + peer.sample(0, 1, 1020, 1.0, 2.0, 3.0))
    assert feed(peer, stream, [1030], number=2) == [(1030, 1030.0)]
    assert stream.damaged == 2 and stream.lost == 2


def reset(peer):
    """Do what a board does that is switched off and on."""
    peer.session, peer.mark, peer.tick = 0, 0, 3
    peer.values = {0: 1.0, 1: 0.0, 2: 2.3}


def test_a_reset_ends_a_stream_and_is_reported(peer, drive):
    told = []
    drive.on_reset.append(lambda: told.append((threading.current_thread().name, drive.state)))
    with drive.stream(["speed_rpm", "torque_Nm"], decimation=10) as stream:
        assert len(feed(peer, stream, [1010, 1020])) == 2
        peer.write(peer.sample(0, 2, 1030, 1.0, 2.0))
        until(lambda: stream._tick == 1030)
        reset(peer)
        until(lambda: told)
        ticks, _ = stream.read(1.0)  # what came before is not lost
        assert ticks.tolist() == [1030]
        for _ in range(2):
            with pytest.raises(LinkError) as caught:
                stream.read(1.0)
        assert str(caught.value) == (
            f"{peer.port}: the board was reset; the recording ends at tick 1030; "
            "its parameters are at their saved or initial values"
        )
        assert (stream.gaps, stream.lost) == (0, 0)
    assert drive.resets == 1
    ((thread, state),) = told
    assert thread.startswith("keeper") and state == "idle"
    assert different(peer, STREAM) == 1  # not set again
    with drive.stream(["speed_rpm"], decimation=10) as stream:  # but a new one can be
        peer.write(peer.sample(0, 0, 13, 1.0))
        assert stream.read(2.0)[0].tolist() == [13]


def test_a_reset_is_noticed_without_a_session(peer, drive):
    reset(peer)
    until(lambda: drive.resets == 1)
    assert peer.session == 0 and peer.mark == drive.client.mark != 0


def test_a_request_that_finds_a_reset_board_is_not_carried_out(peer, drive):
    """The request was intended for the board with its former parameters."""
    drive.set("speed_ref_rpm", 5.0)
    with drive.client._one_at_a_time:  # no heartbeat sees it first
        reset(peer)
        with pytest.raises(LinkError, match=r"the board was reset; .*START was not carried out"):
            drive.start()
    assert 8 not in peer.executed
    drive.start()
    assert 8 in peer.executed and drive.resets == 1


def test_a_session_that_ended_is_no_reset(peer, drive):
    """The port server did not run for more than a second. The tick shows that this is a gap."""
    with drive.stream(["speed_rpm", "torque_Nm"], decimation=10) as stream:
        feed(peer, stream, [1010, 1020])
        peer.session, peer.tick = 0, 41_000
        until(lambda: different(peer, STREAM) == 2)
        rows = feed(peer, stream, [41_003, 41_013])
        assert [tick for tick, _ in rows] == [41_003, 41_013]  # on no other raster than its own
        assert (stream.gaps, stream.lost, drive.resets) == (1, (41_003 - 1021) // 10, 0)


@pytest.mark.parametrize("number, first, missed", [(7, 1070, 7), (7, 1070 + 2560, 263)])
def test_more_than_255_samples_may_be_missing_at_the_beginning(peer, stream, number, first, missed):
    feed(peer, stream, [first], number)
    assert (stream.gaps, stream.lost) == (1, missed)


def test_a_stream_over_budget_names_what_fits(peer, drive):
    peer.refuse[STREAM] = (21, struct.pack("<H", 4))
    with pytest.raises(LinkError, match=r"smallest decimation that fits is 4, 2500 Hz"):
        drive.stream(["torque_Nm"], rate_Hz=5000)
    assert all(sink is None for sink in drive.client._sinks)
    peer.refuse[STREAM] = (21, struct.pack("<H", 0))
    with pytest.raises(LinkError, match="nothing more fits beside the other streams"):
        drive.stream(["torque_Nm"], rate_Hz=5000)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"rate_Hz": 10001}, r"allowed range is 0.153 .. 10000 Hz"),
        ({"rate_Hz": 0}, "allowed range"),
        ({"rate_Hz": float("nan")}, "allowed range"),
        ({"decimation": 0}, r"allowed range is 1 .. 65535"),
        ({"decimation": 65536}, "allowed range"),
        ({"decimation": 2, "rate_Hz": 5}, "give one of them"),
    ],
)
def test_impossible_streams(drive, arguments, text):
    with pytest.raises(LinkError, match=text):
        drive.stream(["torque_Nm"], **arguments)


def test_unknown_channels_and_too_many(drive):
    with pytest.raises(LinkError, match="no channel 'x'; known: speed_rpm, torque_Nm"):
        drive.stream(["x"])
    with pytest.raises(LinkError, match="33 channels: a stream has 1 to 32"):
        drive.stream(["torque_Nm"] * 33)
    streams = [drive.stream(["torque_Nm"]) for _ in range(4)]
    with pytest.raises(LinkError, match="all 4 streams are in use"):
        drive.stream(["torque_Nm"])
    streams[2].close()
    assert drive.stream(["torque_Nm"])._slot == 2


# -- captures


def offer(peer, values: np.ndarray, crc: int | None = None, keep=lambda first: True, between=b""):
    """A complete capture of two channels. Data are sent for the first values that `keep` accepts,
    each followed by the bytes `between`."""
    flat = values.astype("<f4").ravel()
    crc = binascii.crc32(flat.tobytes()) if crc is None else crc
    head = struct.pack("<BBHIIIIHH", 5, 9, 2, len(values), 3, 4242, crc, 1, 0)
    peer.capture = (5, head)
    answer = peer._answer

    def answering(op, session, payload):
        if op == Op.READ:
            first, count = struct.unpack("<II", payload)
            raw = b""
            for at in range(first, first + count, 60):
                if keep(at):
                    part = flat[at : min(at + 60, first + count)].tobytes()
                    raw += frame(struct.pack("<BBI", 0x50, 9, at) + part) + between
            threading.Timer(0.01, peer.write, [raw]).start()
        return answer(op, session, payload)

    peer._answer = answering


def test_data_of_another_capture_is_left_out(peer, drive):
    values = np.arange(400, dtype=np.float32).reshape(200, 2)
    offer(peer, values, between=frame(struct.pack("<BBIf", 0x50, 8, 0, 77.0)))
    np.testing.assert_array_equal(drive.captured(1.0)["torque_Nm"], values[:, 0])


def test_lost_capture_data_is_requested_again(peer, drive):
    values = np.arange(400, dtype=np.float32).reshape(200, 2)
    seen = {}

    def keep(first):
        seen[first] = seen.get(first, 0) + 1
        return first not in (60, 180) or seen[first] > 2

    offer(peer, values, keep=keep)
    recording = drive.captured(1.0)
    np.testing.assert_array_equal(recording["torque_Nm"], values[:, 0])
    np.testing.assert_array_equal(recording["speed_rpm"], values[:, 1])
    assert seen[60] == 3 and seen[120] == 1  # only what was missing
    assert recording.rate_Hz == 5000 and recording.start_s == -3 / 5000
    assert recording.meta["trigger_s"] == 0 and recording.meta["trigger_tick"] == 4242


def test_a_capture_with_a_wrong_crc_is_refused(peer, drive):
    offer(peer, np.zeros((10, 2)), crc=1)
    with pytest.raises(LinkError, match="CRC does not fit"):
        drive.captured(1.0)


def test_a_board_that_sends_no_data_is_given_up(peer, drive):
    offer(peer, np.zeros((10, 2)), keep=lambda first: False)
    with pytest.raises(LinkError, match="does not send the capture's data"):
        drive.captured(1.0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"samples": 10241}, r"samples = 10241: allowed range is 1 .. 10240 with 2 channels"),
        ({"samples": 0}, "samples = 0: 1 or more"),
        ({"samples": 10, "pre": 10}, r"pre = 10: allowed range is 0 .. 9"),
        ({"samples": 10, "prescaler": 0}, "prescaler = 0"),
        ({"samples": 10, "trigger": "rising:nope:1"}, "no channel 'nope'"),
        ({"samples": 10, "trigger": "rising:torque_Nm"}, "write rising:CHANNEL:LEVEL"),
        ({"samples": 10, "trigger": "above:torque_Nm:nan"}, "write above:CHANNEL:LEVEL"),
        ({"samples": 10, "trigger": "fault:1"}, "fault takes nothing more"),
        ({"samples": 10, "trigger": "sometimes"}, "choose one of manual, rising"),
    ],
)
def test_impossible_captures(peer, drive, arguments, text):
    with pytest.raises(LinkError, match=text):
        drive.arm(["speed_rpm", "torque_Nm"], **arguments)
    assert not of(peer, Op.ARM)


def test_status_counters_come_through(drive):
    status = drive.client.get_status()
    assert (status.damaged, status.overruns, status.dropped) == (7, 8, 9)


def test_all_statuses_have_a_text(drive):
    assert set(wire.Status) <= {wire.Status.DONE, *RESULTS}
    for status, row in RESULTS.items():
        refused = drive.client.refused(wire.Reply(7, 0, status, 0, 0, 0, b""), "x")
        assert str(refused) == f"x: {row.text.format(state='idle')}"
        assert (refused.status, refused.mistake) == (status, row.mistake)
