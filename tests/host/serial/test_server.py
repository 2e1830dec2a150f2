"""The port server: several processes share a port through it. If it hangs, it is named."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from forked import Forked
from waiting import WAIT_S, until

from hexatorque import system
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.serial import LinkError, devices, runtime, server, sharing, wire
from hexatorque.serial.exchange import Busy, Unpacker, packed
from hexatorque.serial.wire import Op


@pytest.fixture
def first(board):
    with BoardDrive.open(board) as drive:
        assert not drive.client.transport.shared
        yield drive


@pytest.fixture
def second(board, first):
    with BoardDrive.open(board) as drive:
        assert drive.client.transport.shared
        assert drive.client.transport.pid == first.client.transport.pid != os.getpid()
        yield drive


def test_both_command_the_drive(first, second):
    second.set("speed_ref_rpm", 50.0)
    assert first.get("speed_ref_rpm") == 50
    first.start()
    until(lambda: second.state == "run")
    second.stop()
    assert first.state == "idle"
    with pytest.raises(LinkError, match="do not fit together"):
        second.set_many({"torque_inner_Nm": 900.0})


def test_a_second_that_leaves_does_not_stop_the_firsts_drive(board, first):
    first.start()
    with BoardDrive.open(board) as second:
        second.set("speed_ref_rpm", 50.0)
    until(lambda: first.state == "run")
    time.sleep(0.3)
    assert first.state == "run"


@pytest.mark.parametrize("how", ["leaves", "dies", "hangs"])
def test_a_second_that_started_the_drive_and_is_gone_stops_it(board, first, how):
    process = Forked(["-c", SECOND, board, how], pipes=("stdin", "stdout"))
    try:
        assert process.stdout.readline() == "True\n"
        assert first.state == "run"
        begun = first.client.latest.tick
        process.stdin.close()
        until(lambda: first.state == "idle")
        # The server stops it after 250 ms, and on a busy computer it runs late.
        took_s = (first.client.latest.tick - begun) / first.hello.f_isr_Hz
        assert took_s < 2.0 and first.faults == []
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


SECOND = """
import os, signal, sys
from hexatorque.drive.board import BoardDrive
drive = BoardDrive.open(sys.argv[1])
drive.start()
while drive.condition.at_work and drive.state != "run":
    pass
assert drive.state == "run"
print(drive.client.transport.shared, flush=True)
sys.stdin.read()
if sys.argv[2] == "leaves":
    drive.close()
os.kill(os.getpid(), {"leaves": 0, "dies": signal.SIGKILL, "hangs": signal.SIGSTOP}[sys.argv[2]])
"""


@pytest.mark.parametrize("how", ["leaves", "dies"])
def test_the_second_client_continues_without_the_first(board, how):
    """The port stays open, and no sample is lost."""
    process = Forked(["-c", SHOW, board, "shared"], pipes=("stdin", "stdout"))
    try:
        assert process.stdout.readline() == "False\n"
        with BoardDrive.open(board) as second, second.stream(["speed_rpm"], rate_Hz=500) as stream:
            server = second.client.transport.pid
            if how == "dies":
                process.kill()
            process.stdin.close()
            process.wait()
            with BoardDrive.open(board) as third:
                assert third.client.transport.pid == server
                third.start()
                until(lambda: third.state == "run")
                third.stop()
                assert second.state == "idle"
            assert stream.read(1.0) is not None
            assert (stream.gaps, second.client.counters.reconnects) == (0, 0)
    finally:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()


#: A client that prints an attribute of its transport and waits.
SHOW = """
import sys
from hexatorque.drive.board import BoardDrive
with BoardDrive.open(sys.argv[1]) as drive:
    print(getattr(drive.client.transport, sys.argv[2]), flush=True)
    sys.stdin.read()
"""


def test_streams_of_both_at_once(first, second):
    mine = first.stream(["speed_rpm"], rate_Hz=500)
    other = second.stream(["torque_Nm", "vdc_V"], rate_Hz=1000)
    assert (mine._slot, other._slot) == (0, 0)  # each its own numbers
    time.sleep(0.5)
    other.close()
    mine.close()
    for stream, every, width in ((mine, 20, 1), (other, 10, 2)):
        blocks = stream.waiting()
        ticks = np.concatenate([t for t, _ in blocks])
        assert len(ticks) > 0.1 * 10000 / every and np.all(np.diff(ticks) == every)
        assert blocks[0][1].shape[1] == width and (stream.lost, stream.damaged) == (0, 0)
    assert np.concatenate([v for _, v in blocks])[:, 1].min() > 100


def test_streams_end_with_their_client(board, first):
    for _ in range(3):
        with BoardDrive.open(board) as second:
            streams = [second.stream(["torque_Nm"], rate_Hz=100) for _ in range(4)]
            with pytest.raises(LinkError, match="all 4 streams are in use") as caught:
                second.stream(["torque_Nm"], rate_Hz=100)
            with pytest.raises(LinkError, match="all of the board's streams") as caught:
                first.stream(["torque_Nm"], rate_Hz=100)
            assert caught.value.status == wire.Status.NO_STREAM == 23
            assert streams[3].read(1.0)
    first.stream(["torque_Nm"], rate_Hz=100).close()


def test_a_second_captures(second):
    recording = second.capture(["vdc_V", "state"], 2000, pre=500, timeout_s=WAIT_S)
    assert len(recording) == 2000 and recording["vdc_V"].min() > 100


def path_of(board):
    return runtime.port_path(board, "sock")


def dial(board):
    return system.dial(path_of(board), WAIT_S)


def test_wrong_bytes_on_the_socket_affect_no_other_client(board, first, second):
    for rubbish in (b"\0" * 9, os.urandom(9000), b"\0" + b"\x05abcd" + b"\0", b"\xff\xff"):
        with dial(board) as peer:
            peer.sendall(rubbish)
    assert second.get("scheme") == "ddr"


def test_files_of_a_dead_server_are_replaced(board):
    path_of(board).write_text("")
    runtime.port_path(board, "lock").write_text("{")
    with BoardDrive.open(board) as drive:
        assert drive.state == "idle"


def test_the_server_is_named_and_ends_after_its_last_client(board):
    lock = runtime.port_path(board, "lock")
    with BoardDrive.open(board) as drive:
        server = runtime.locked(lock)
        assert server.pid == drive.client.transport.pid
        assert server.port == board and "hexatorque.serial.server" in server.command
        assert server.started.startswith("20")
        assert os.getsid(server.pid) != os.getsid(0)  # no Ctrl-C in a terminal is meant for it
    until(lambda: not lock.exists())
    assert not path_of(board).exists()
    with pytest.raises(ProcessLookupError):
        until(lambda: os.kill(server.pid, 0))


def test_many_clients_at_once_start_one_server(board):
    processes = [Forked(["-c", SHOW, board, "pid"], pipes=("stdin", "stdout")) for _ in range(4)]
    pids = {process.stdout.readline() for process in processes}
    for process in processes:
        process.communicate()
    assert len(pids) == 1 and int(pids.pop())


def test_a_stop_goes_before_waiting_requests(board, first):
    """Requests of many clients are queued. A STOP goes before all of them, and withdraws a
    START."""
    with dial(board) as crowd, dial(board) as stopper:
        for peer in (crowd, stopper):
            assert peer.recv(4096)
        crc = first.client.dictionary
        ask = [wire.request(Op.GET, k, 0, crc, bytes(200)) for k in range(6)]
        ask.append(wire.request(Op.START, 6, 0, crc))
        os.kill(first.client.transport.pid, signal.SIGSTOP)
        crowd.sendall(b"".join(packed(body) for body in ask))
        stopper.sendall(packed(wire.request(Op.STOP, 99, 0, 0)))
        os.kill(first.client.transport.pid, signal.SIGCONT)
        replies = {}
        for name, peer in (("stopper", stopper), ("crowd", crowd)):
            unpacker, bodies = Unpacker(), []
            while len(bodies) < (1 if name == "stopper" else 7):
                bodies += [b for b in unpacker.push(peer.recv(65536)) if b[0] not in (0xF1, 0xF2)]
            replies[name] = bodies
    (stopped,) = replies["stopper"]
    stop = wire.parse_reply(stopped)
    assert (stop.op, stop.id, stop.status) == (Op.STOP, 99, 0)
    gets = [wire.parse_reply(body) for body in replies["crowd"] if body[0] == 0x80 + Op.GET]
    assert len(gets) == 6 and sum(reply.tick > stop.tick for reply in gets) >= 5
    (failed,) = [body for body in replies["crowd"] if body[0] == 0xF3]
    assert failed[1:3] == bytes((Op.START, 6)) and b"withdrawn" in failed


def test_a_long_runtime_directory(board, tmp_path, monkeypatch):
    """A socket's address has 107 bytes."""
    folder = tmp_path / ("x" * 100)
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    with BoardDrive.open(board) as drive:
        assert drive.state == "idle"
        pid = drive.client.transport.pid
        os.kill(pid, signal.SIGTERM)
    # The next test's folder is another one: there this server would be a foreign program.
    until(lambda: not os.path.exists(f"/proc/{pid}"))


def test_a_server_that_is_told_to_end_while_it_ends_leaves_nothing(own_board):
    """The signal comes while it closes the port."""
    process = Forked(["-c", TOLD_LATE, own_board.url], pipes=("stdout", "stderr"))
    said, complaints = process.communicate()  # until the server has ended
    assert json.loads(said) == {"ready": True} and complaints == ""
    left = [runtime.port_path(own_board.url, suffix) for suffix in ("lock", "sock", "log")]
    assert not any(path.exists() for path in left)


TOLD_LATE = """
import os, signal, sys
from hexatorque.serial import port, server
close = port.Line.close
def told(line):
    os.kill(os.getpid(), signal.SIGTERM)
    close(line)
port.Line.close = told
sys.exit(server.main(sys.argv[1], (1250000,), False))
"""


# -- a port that others have, servers that hang


def test_a_foreign_program_is_named(own_board, capsys):
    """Whether it locks the port or not."""
    for lock in (False, True):
        with subprocess.Popen(
            [sys.executable, "-c", FOREIGN, own_board.url, str(lock)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        ) as other:  # fmt: skip
            other.stdout.readline()
            for words in (["status"], ["stop"]):
                assert main(["board", *words, "--device", own_board.url]) == 1
                said = capsys.readouterr().err
                assert f": in use by process {other.pid} (" in said and said.count("\n") == 1
                assert "import sys, serial" in said  # its command
            other.stdin.close()
            other.wait()
    assert main(["board", "status", "--device", own_board.url]) == 0


FOREIGN = """import sys, serial
port = serial.Serial(sys.argv[1], exclusive=True) if sys.argv[2] == "True" else open(sys.argv[1])
print(flush=True)
sys.stdin.read()
"""


def test_the_server_keeps_others_out(board, first, tmp_path):
    import serial

    with pytest.raises(serial.SerialException, match="exclusively lock"):
        serial.Serial(board, exclusive=True)
    # Another user's server, or one with another runtime directory.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "elsewhere"))
        with pytest.raises(Busy, match=f"in use by process {first.client.transport.pid} .*server"):
            BoardDrive.open(board)


HOLDER = """import serial, sys
port = serial.Serial(sys.argv[1], exclusive=True)
print(flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize("words", [["hexatorque.serial.server"], []])
@pytest.mark.parametrize("dies", [True, False])
def test_a_server_waits_for_one_that_is_ending(words, dies, monkeypatch):
    """A killed server may still have its port when it has lost its lock. Nobody else is waited
    for."""
    ours, terminal = os.openpty()
    name = os.ttyname(terminal)
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, name, *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        assert process.stdout.readline()
        begun = time.monotonic()
        if dies or not words:
            monkeypatch.setattr(server, "ENDING_S", 10 * WAIT_S)
        if words and dies:
            threading.Timer(0.1, process.kill).start()
            server._opened(name, 115200).close()
            assert time.monotonic() - begun > 0.1
            return
        with pytest.raises(Busy, match=f"in use by process {process.pid} "):
            server._opened(name, 115200)
        assert (time.monotonic() - begun > server.ENDING_S) == bool(words)
    finally:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()
        os.close(ours)
        os.close(terminal)


@pytest.fixture
def hung(board):
    """A server that is stopped while a drive runs."""
    with BoardDrive.open(board) as drive:
        drive.start()
        until(lambda: drive.state == "run")
        pid = drive.client.transport.pid
        os.kill(pid, signal.SIGSTOP)
        yield drive
        os.kill(pid, signal.SIGCONT)
        until(lambda: drive.state == "fault")


@pytest.mark.parametrize("words", [["stop"], ["status"]])
def test_a_server_that_hangs_is_named(board, hung, words, capsys):
    pid = hung.client.transport.pid
    begun = time.monotonic()
    assert main(["board", *words, "--device", board]) == 1
    took_s = time.monotonic() - begun
    assert capsys.readouterr().err == (
        f"hexatorque: {board}: the port server, process {pid}, does not answer; the board stops "
        f"a running drive by itself after 250 ms; end it with: kill -9 {pid}\n"
    )
    assert took_s > 0.9
    with pytest.raises(LinkError, match=f"process {pid}, does not answer"):
        hung.stop()  # one that was there before is told the same


def test_the_messages_advice_helps(board):
    with BoardDrive.open(board) as drive:
        drive.start()
        until(lambda: drive.state == "run")
        pid = drive.client.transport.pid
        os.kill(pid, signal.SIGSTOP)
        time.sleep(0.4)
        os.kill(pid, signal.SIGKILL)
        until(lambda: drive.client.counters.reconnects == 1)
        assert drive.client.transport.pid != pid
        assert (drive.state, drive.faults) == ("fault", ["link lost"])
        assert drive.resets == 0


def test_a_client_that_does_not_read_blocks_no_other_client(board, first):
    """Its samples are buffered up to a limit. The other clients get theirs."""
    with dial(board) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        crc = first.client.dictionary
        deaf.sendall(packed(wire.request(Op.OPEN, 1, 0, crc, wire.open_session(1, 1))))
        deaf.sendall(packed(wire.request(Op.STREAM, 2, 0, crc, wire.stream(0, (2,) * 6, 10))))
        with first.stream(["speed_rpm"], rate_Hz=500) as stream:
            got = 0
            while got < 1000:  # two seconds of the board's
                got += len(stream.read(WAIT_S)[0])
                assert first.get("scheme") == "ddr"
            assert stream.lost == 0


def test_without_a_reader_memory_is_bounded():
    """The test fills the queue of one client: then samples are dropped, and replies are not."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        peer = sharing.Peer(ours)
        some = object.__new__(sharing.Server)
        some.splitter, some.unknown, some.retries = wire.Splitter(), 0, 0
        for _ in range(400_000):
            some._send(peer, b"\x40" + bytes(41))
        full = len(peer.out)
        assert full < sharing.WAITING_BYTES + 100
        some._answered(peer, bytes(40))
        assert len(peer.out) == full + 42


# -- finding boards


@pytest.fixture
def announced(shared_board, monkeypatch):
    """Only announced boards are found, and not the ports of this computer."""
    monkeypatch.setattr(devices.list_ports, "comports", lambda: [])
    port = os.path.realpath(shared_board.url)
    runtime.Announcement(port, "a virtual board")
    return port


def test_an_announced_board_is_found(announced):
    (found,), _ = devices.find()
    assert (found.port, found.device, found.shared) == (announced, "virtual f28377s", False)
    with BoardDrive.open() as drive:
        assert drive.client.url == announced
        (found,), _ = devices.find()
        assert found.shared


def test_files_of_ended_boards_are_removed(announced, tmp_path):
    stale = runtime.directory() / "board-1.json"
    stale.write_text('{"port": "/dev/pts/0", "title": "gone"}')
    broken = runtime.directory() / "board-2.json"
    broken.write_text("{")
    assert [board.port for board in devices.find()[0]] == [announced]
    assert not stale.exists() and not broken.exists()


def test_a_killed_board_is_not_announced_before_its_parent_has_asked_for_it(tmp_path):
    """Until then it has its process number, and its port's name may be another's already."""
    code = (
        "import signal, sys; from hexatorque.serial import runtime; "
        "runtime.Announcement(sys.argv[1], 'killed'); print(flush=True); signal.pause()"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, env=environment
    ) as process:
        process.stdout.readline()
        assert [board.title for board in runtime.announced()] == ["killed"]
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        os.kill(process.pid, 0)
        assert runtime.announced() == []


def test_a_port_that_another_program_has_open_is_left_alone(announced):
    code = "import sys; f = open(sys.argv[1]); print(flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", code, announced],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as other:  # fmt: skip
        other.stdout.readline()
        found, (busy,) = devices.find()
        assert found == [] and f"in use by process {other.pid} " in str(busy)
        with pytest.raises(LinkError, match=f"no board found.*in use by process {other.pid} "):
            BoardDrive.open()
        other.stdin.close()
        other.wait()
    assert [len(some) for some in devices.find()] == [1, 0]


def test_a_device_that_is_no_board_is_skipped(announced, monkeypatch):
    import types

    master, slave = os.openpty()
    mute = types.SimpleNamespace(device=os.ttyname(slave), description="a modem")
    monkeypatch.setattr(devices.list_ports, "comports", lambda: [mute])
    assert [board.port for board in devices.find()[0]] == [announced]
    os.close(master)
    os.close(slave)


def test_none_and_several_boards(announced, monkeypatch, own_board):
    runtime.Announcement(os.path.realpath(own_board.url), "another")
    with pytest.raises(LinkError, match="2 boards found, choose one: /dev/pts/") as caught:
        BoardDrive.open()
    assert caught.value.mistake
    monkeypatch.setattr(runtime, "announced", lambda: [])
    with pytest.raises(LinkError, match="no board found"):
        BoardDrive.open()


def test_the_runtime_directory_must_belong_to_the_user(monkeypatch, tmp_path):
    assert runtime.directory().stat().st_mode & 0o777 == 0o700
    runtime.directory().chmod(0o755)
    with pytest.raises(LinkError, match="belongs to you alone"):
        runtime.directory()
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    assert runtime.directory() == tmp_path / f"hexatorque-{os.getuid()}"
