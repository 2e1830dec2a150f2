"""Recorded time is the board's time. Whatever is stopped, lost or reset, every sample has the tick
that the board gave it, and missing samples are counted."""

import json
import os
import signal
import struct
import time

import numpy as np
import pytest
from campaigns import examples, part
from forked import Forked
from hypothesis import given, settings
from hypothesis import strategies as st
from waiting import until

from hexatorque.drive.board import BoardDrive
from hexatorque.serial import LinkError, wire
from hexatorque.serial.client import Client
from hexatorque.serial.dictionary import Dictionary
from hexatorque.serial.stream import Stream
from hexatorque.serial.wire import Op, Status

WORD = 1 << 32
CHANNEL = wire.ChannelRow("tick", "", "")
HELLO = wire.Hello(2, 0, 1e4, 10**5, (0, 1, 0, 5), 508, 4, 32, 16, False, 100, 250, "model", "")


class Board:
    """A model of the board and of the transport, without real time: interrupts happen only when the
    test calls `interrupts`. due: the board's samples, (number of resets, true tick)."""

    def __init__(self, tick: int) -> None:
        self.true_tick = tick  # counted on beyond 2^32
        self.life = 0  # counts resets
        self.mark = self.session = 0
        self.decimation = self.left = self.number = 0
        self.waiting: list[bytes] = []  # on the line
        self.due: list[tuple[int, int]] = []
        self.begun: dict[int, int] = {}  # life -> tick of its first sample, had none been lost
        self.plugged, self.heard = True, 0
        self.reason = "unplugged"
        self.bauds = (1,)

    def connect(self, url, bauds, bodies, lost):
        self.bodies, self.lost = bodies, lost
        return self

    def start(self):
        pass

    def close(self):
        self.plugged = False

    def again(self):
        return False

    def interrupts(self, count: int, lose=()) -> None:
        """Run a number of fast interrupts. Samples whose place is in `lose` do not reach the
        host."""
        sampled = 0
        for _ in range(count):
            self.true_tick += 1
            if not self.decimation:
                continue
            self.left -= 1
            if self.left == 0:
                self.left = self.decimation
                self._sample(sampled in lose)
                sampled += 1

    def _sample(self, lost: bool) -> None:
        if not lost:
            head = (0x40, self.number & 0xFF, self.true_tick % WORD)
            value = float(self.true_tick % 65536)
            self.waiting.append(struct.pack("<BBIf", *head, value))
        self.due.append((self.life, self.true_tick))
        self.number += 1

    def arrive(self) -> None:
        bodies, self.waiting = self.waiting, []
        self.bodies(bodies)

    def reset(self) -> None:
        self.life += 1
        self.true_tick = self.mark = self.session = self.decimation = 0

    def forget_session(self) -> None:
        self.session = self.decimation = 0

    def write(self, body: bytes) -> None:
        op, id, session, _, payload = wire.parse_request(body)
        status, answer = Status.DONE, b""
        if op == Op.OPEN:
            self.session, mark = struct.unpack("<HI", payload)
            mark = (mark + self.life * 7919) % WORD or 1  # as the server does
            self.mark = self.mark or mark
            answer = self.mark.to_bytes(4, "little")
        elif op == Op.STATUS:
            flags = bool(self.session) | (session == self.session != 0) << 1
            answer = struct.pack("<BBHIIIIB", flags, 0, 0, 0, 0, 0, self.mark, 0)
        elif op == Op.STREAM:
            if session != self.session:
                status = Status.NO_SESSION
            else:
                _, channels, self.decimation = struct.unpack_from("<BBH", payload)
                self.decimation *= channels > 0
                self.left, self.number = 1, 0
                self.begun.setdefault(self.life, self.true_tick + 1)
        reply = wire.reply(op, id, status, 0, 0, self.true_tick % WORD, answer)
        self.waiting.append(reply)
        self.arrive()


class Quiet(Client):
    """A client without the thread that keeps the session. The test calls it instead."""

    def _keep(self) -> None:
        pass

    def look(self) -> None:
        """Do once what the thread does repeatedly."""
        self._asked_s = 0.0
        self.keep_up()


STEP = st.one_of(
    st.tuples(st.just("run"), st.integers(1, 400), st.sets(st.integers(0, 60), max_size=20)),
    st.tuples(st.just("stall"), st.integers(1, 10**9)),  # nobody reads; the board lost its session
    st.tuples(st.just("lose"), st.integers(1, 3000)),  # all that comes in this time
    st.just(("reset",)),
    st.just(("look",)),
)


@settings(max_examples=examples(300), deadline=None)
@given(
    start=st.one_of(st.integers(0, WORD - 1), st.integers(WORD - 2000, WORD - 1)),
    decimation=st.one_of(st.integers(1, 12), st.just(300)),
    steps=st.lists(STEP, max_size=14),
)
def test_every_sample_has_the_boards_tick(start, decimation, steps):
    board = Board(start)
    client = Quiet("model", 1, connect=board.connect)
    dictionary = Dictionary(0, {}, (CHANNEL,), (), (), 0)
    stream = Stream(client, HELLO, dictionary, ("tick",), decimation)
    lives, got, lost = [], [], []

    def take() -> None:
        """The samples that have come, with the number of resets before them."""
        blocks = stream.waiting()
        got.extend((lives.count("reset"), int(t)) for ticks, _ in blocks for t in ticks)
        for ticks, values in blocks:
            assert (values[:, 0] == ticks % 65536).all()

    resets = 0
    for what, *rest in steps:
        if what == "run":
            board.interrupts(*rest)
            board.arrive()
        elif what == "stall":
            board.forget_session()
            board.true_tick += rest[0]
            client.look()
        elif what == "lose":
            board.interrupts(rest[0])
            board.waiting.clear()
        elif what == "reset":
            board.arrive()
            take()
            lost.append(stream)
            board.reset()
            client.look()
            resets += 1
            assert client.resets == resets
            with pytest.raises(LinkError, match="the board was reset"):
                stream.read(0)
            lives.append("reset")
            stream = Stream(client, HELLO, dictionary, ("tick",), decimation)
        client.look()
    # A last sample tells what is missing before it.
    board.interrupts(2 * decimation)
    board.arrive()
    take()
    lost.append(stream)
    client.close()
    # Ticks are counted on from the first one that came, so they are true up to whole words.
    due = {life: [t for of, t in board.due if of == life] for life in range(resets + 1)}
    for life in range(resets + 1):
        mine = [tick for of, tick in got if of == life]
        if not mine:
            continue
        offset = next(t for t in due[life] if t % WORD == mine[0] % WORD) - mine[0]
        assert offset % WORD == 0
        true = [tick + offset for tick in mine]
        assert set(true) <= set(due[life]) and true == sorted(set(true))
        # Missing: in each step the samples of a raster that goes on; so before the first.
        steps_ = np.diff(true)
        before = (true[0] - board.begun[life] + decimation - 1) // decimation
        assert lost[life].lost == before + int(((steps_ - 1) // decimation).sum())
        assert lost[life].gaps == (before > 0) + int((steps_ > decimation).sum())
        assert lost[life].damaged == 0


# -- processes that stand still


def stopped(pid: int, seconds: float) -> None:
    os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    os.kill(pid, signal.SIGCONT)


#: Who stands still, and for how many seconds; for 30 as well if asked for.
STANDSTILLS = part([(who, s) for s in (1.0, 5.0) for who in ("client", "guard", "server")], 3)
STANDSTILLS += [
    (who, float(seconds))
    for seconds in filter(None, [os.environ.get("HT_STANDSTILL_S")])
    for who in ("client", "guard", "server")
]


@pytest.fixture
def streaming(board, tmp_path):
    """`hexatorque board stream` in a process of its own."""
    file = tmp_path / "run.csv"
    process = Forked(
        ["-m", "hexatorque", "board", "stream", "speed_rpm", "vdc_V",
         "--rate", "500", "--device", board, "-o", file, "--json"],
        pipes=("stdout", "stderr"),
    )  # fmt: skip
    end = time.monotonic() + 30
    while not file.exists() or file.stat().st_size < 500:
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.05)
    yield process, file
    process.kill()
    process.communicate()


def recorded(process, file, tick_now):
    """The ticks and the counters in the file, as soon as it has reached the board's tick."""
    end = time.monotonic() + 30
    while int(file.read_text().splitlines()[-1].split(",")[1]) < tick_now:
        assert time.monotonic() < end
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 0, err
    table = came(file)
    np.testing.assert_allclose(table[:, 0], (table[:, 1] - table[0, 1]) / 1e4, atol=1e-9)
    return table[:, 1].astype(int), json.loads(out)


def came(file):
    """The rows of a .csv file that have samples. The cells of a lost sample are empty."""
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    return table[~np.isnan(table[:, 2:]).all(axis=1)]


@pytest.mark.parametrize(("who", "seconds"), STANDSTILLS)
def test_after_a_stopped_process_ticks_are_the_boards(board, streaming, who, seconds):
    process, file = streaming
    with BoardDrive.open(board) as drive:
        if who == "guard":
            guard = Forked(["-m", "hexatorque", "board", "start", "--device", board], pipes=())
            until(lambda: drive.state == "run" or guard.poll() is not None)
            assert guard.poll() is None
            pid = guard.pid
        else:
            pid = process.pid if who == "client" else drive.client.transport.pid
        before = drive._now_tick()
        stopped(pid, seconds)
        if who == "server":
            time.sleep(1.0)  # the streams are set again
        after = drive._now_tick()
        ticks, summary = recorded(process, file, after)
        if who == "guard":
            assert drive.state == "idle"  # the drive's, not the recording's business
            guard.kill()
            guard.wait()
        assert drive.resets == 0
    steps = np.diff(ticks)
    assert ticks[0] < before < after <= ticks[-1] and (steps > 0).all()
    missing = int(((steps - 1) // 20).sum())
    assert summary["lost_samples"] == missing and summary["gaps"] == int((steps > 20).sum())
    if who != "server":  # what they did not read has waited for them
        assert missing == 0 and (steps == 20).all()
    elif seconds >= 5:
        assert missing * 20 > (after - before) / 4


def test_a_reset_ends_a_file(own_board, tmp_path):
    file = tmp_path / "run.csv"
    process = Forked(
        ["-m", "hexatorque", "board", "stream", "speed_rpm", "--rate", "500",
         "--device", own_board.url, "-o", file],
        pipes=("stdout", "stderr"),
    )  # fmt: skip
    try:
        end = time.monotonic() + 30
        while not file.exists() or file.stat().st_size < 500:
            assert time.monotonic() < end and process.poll() is None
            time.sleep(0.05)
        own_board.unplug()
        own_board.plug()  # another one, as far as its memory goes
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 1, out
    table = came(file)
    last = int(table[-1, 1])
    assert err == (
        f"hexatorque: {own_board.url}: the board was reset; the recording ends at tick {last}; "
        "its parameters are at their saved or initial values\n"
    )
    assert (np.diff(table[:, 1]) == 20).all()
    beside = json.loads(file.with_suffix(".json").read_text())
    assert beside["meta"]["closed"] and beside["meta"]["ended"] == "board reset"
