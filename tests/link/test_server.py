"""Two processes, one port: the second takes part through the first."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest
from board_process import HOST

from hexatorque.link import LinkError, devices, runtime
from hexatorque.link.drive import Drive


@pytest.fixture
def holder(board):
    with Drive.open(board) as drive:
        assert not drive.client.transport.relayed
        yield drive


@pytest.fixture
def guest(board, holder):
    with Drive.open(board) as drive:
        assert drive.client.transport.relayed
        yield drive


def until(condition, seconds=2.0):
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() - begun < seconds
        time.sleep(0.01)


def test_both_command_the_drive(holder, guest):
    guest.set("speed_ref_rpm", 50.0)
    assert holder.get("speed_ref_rpm") == 50
    holder.start()
    until(lambda: guest.state == "run")
    guest.stop()
    assert holder.state == "idle"
    with pytest.raises(LinkError, match="do not fit together"):
        guest.set_many({"torque_inner_Nm": 900.0})


def test_a_guest_that_leaves_does_not_stop_the_holders_drive(board, holder):
    holder.start()
    with Drive.open(board) as guest:
        guest.set("speed_ref_rpm", 50.0)
    until(lambda: holder.state == "run")
    time.sleep(0.3)
    assert holder.state == "run"


@pytest.mark.parametrize("how", ["leaves", "dies", "hangs"])
def test_a_guest_that_started_the_drive_and_is_gone_stops_it(board, holder, how):
    process = subprocess.Popen(
        [sys.executable, "-c", GUEST, board, how],
        stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(HOST)},
    )  # fmt: skip
    try:
        assert process.stdout.readline() == "True\n"
        assert holder.state == "run"
        begun = holder.client.latest.tick
        until(lambda: holder.state == "idle", 1.0)
        took_s = (holder.client.latest.tick - begun) / holder.hello.f_isr_Hz
        assert took_s < 0.35 and holder.faults == []
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


GUEST = """
import os, signal, sys
from hexatorque.link.drive import Drive
drive = Drive.open(sys.argv[1])
drive.start()
while drive.state != "run":
    pass
print(drive.client.transport.relayed, flush=True)
if sys.argv[2] == "leaves":
    drive.close()
os.kill(os.getpid(), {"leaves": 0, "dies": signal.SIGKILL, "hangs": signal.SIGSTOP}[sys.argv[2]])
"""


@pytest.mark.parametrize("how", ["leaves", "dies"])
def test_a_guest_takes_over_from_a_holder_that_is_gone_and_shares_the_port(board, how):
    """Else nobody could stop, clear or start until the guest ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, board],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(HOST)},
    )  # fmt: skip
    try:
        assert process.stdout.readline() == "False\n"
        with Drive.open(board) as guest, guest.stream(["speed_rpm"], rate_Hz=500) as stream:
            assert guest.client.transport.relayed
            if how == "dies":
                process.kill()
            process.stdin.close()
            process.wait()
            until(lambda: guest.client.counters.reconnects == 1, 5.0)
            assert not guest.client.transport.relayed
            with Drive.open(board) as third:
                assert third.client.transport.relayed
                third.start()
                until(lambda: third.state == "run")
                third.stop()
                assert guest.state == "idle"
            assert stream.read(1.0) is not None
    finally:
        process.kill()
        process.wait()
        process.stdin.close()
        process.stdout.close()


HOLDER = """
import sys
from hexatorque.link.drive import Drive
with Drive.open(sys.argv[1]) as drive:
    print(drive.client.transport.relayed, flush=True)
    sys.stdin.read()
"""


def test_streams_of_both_at_once(holder, guest):
    mine = holder.stream(["speed_rpm"], rate_Hz=500)
    other = guest.stream(["torque_Nm", "vdc_V"], rate_Hz=1000)
    assert (mine._slot, other._slot) == (0, 0)  # each its own numbers
    time.sleep(0.5)
    other.close()
    mine.close()
    for stream, every, width in ((mine, 20, 1), (other, 10, 2)):
        blocks = stream.waiting()
        ticks = np.concatenate([t for t, _ in blocks])
        assert len(ticks) > 0.4 * 10000 / every and np.all(np.diff(ticks) == every)
        assert blocks[0][1].shape[1] == width and (stream.lost, stream.damaged) == (0, 0)
    assert np.concatenate([v for _, v in blocks])[:, 1].min() > 100


def test_a_guests_streams_end_with_it(board, holder):
    for _ in range(3):
        with Drive.open(board) as guest:
            streams = [guest.stream(["torque_Nm"], rate_Hz=100) for _ in range(4)]
            with pytest.raises(LinkError, match="all 4 streams are in use"):
                guest.stream(["torque_Nm"], rate_Hz=100)
            with pytest.raises(LinkError, match="all 4 streams are in use"):
                holder.stream(["torque_Nm"], rate_Hz=100)
            assert streams[3].read(1.0)
        until(lambda: not any(holder.client._sinks))


def test_no_stream_left_for_a_guest(holder, guest):
    streams = [holder.stream(["torque_Nm"], rate_Hz=100) for _ in range(4)]
    with pytest.raises(LinkError, match="stream"):
        guest.stream(["torque_Nm"], rate_Hz=100)
    for stream in streams:
        stream.close()


def test_a_guest_captures(guest):
    recording = guest.capture(["vdc_V", "state"], 2000, pre=500, timeout_s=3.0)
    assert len(recording) == 2000 and recording["vdc_V"].min() > 100


def test_the_guest_takes_the_port_over(board):
    holder = Drive.open(board)
    with Drive.open(board) as guest, guest.stream(["vdc_V"], rate_Hz=500) as stream:
        assert stream.read(1.0)
        holder.close()
        until(lambda: not guest.client.transport.relayed and guest.client.transport.plugged)
        until(lambda: guest.client.counters.reconnects == 1)
        stream.waiting()
        ticks, _ = stream.read(1.0)
        assert np.all(np.diff(ticks) == 20) and stream.gaps <= 1
        guest.set("speed_ref_rpm", 0.0)


def test_rubbish_on_the_socket_harms_nobody(board, holder, guest):
    import socket

    for rubbish in (b"\0" * 9, os.urandom(9000), b"\0" + b"\x05abcd" + b"\0"):
        with socket.socket(socket.AF_UNIX) as peer:
            peer.connect(str(runtime.relay_path(board)))
            peer.sendall(rubbish)
    assert guest.get("scheme") == "ddr"


def test_what_a_dead_holder_left_is_no_obstacle(board):
    runtime.relay_path(board).write_text("")
    with Drive.open(board) as drive:
        assert not drive.client.transport.relayed and drive.state == "idle"
    path = runtime.relay_path(board)
    assert not path.exists()


# -- finding boards


@pytest.fixture
def announced(shared_board, monkeypatch):
    """Only what is announced: the ports of this machine are nobody's business."""
    monkeypatch.setattr(devices.list_ports, "comports", lambda: [])
    port = os.path.realpath(shared_board.url)
    path = runtime.announce(port, "a virtual board")
    text = path.read_text().replace(str(os.getpid()), str(shared_board.pid))
    path.write_text(text)
    return port


def test_an_announced_board_is_found(announced):
    (found,) = devices.find()
    assert (found.port, found.device, found.shared) == (announced, "virtual f28377s", False)
    with Drive.open() as drive:
        assert drive.client.url == announced
        (found,) = devices.find()
        assert found.shared


def test_boards_that_are_gone_are_forgotten(announced, tmp_path):
    finished = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"],
                              capture_output=True, text=True, check=True)  # fmt: skip
    stale = runtime.directory() / "board-1.json"
    stale.write_text(f'{{"port": "/dev/pts/0", "pid": {int(finished.stdout)}, "title": "gone"}}')
    broken = runtime.directory() / "board-2.json"
    broken.write_text("{")
    assert [board.port for board in devices.find()] == [announced]
    assert not stale.exists() and not broken.exists()


def test_a_port_that_a_program_has_is_not_touched(announced):
    code = "import sys; f = open(sys.argv[1]); print(flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", code, announced],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as other:  # fmt: skip
        other.stdout.readline()
        assert devices.find() == []
        other.stdin.close()
        other.wait()
    assert len(devices.find()) == 1


def test_a_device_that_is_no_board_is_passed_over(announced, monkeypatch):
    import types

    master, slave = os.openpty()
    mute = types.SimpleNamespace(device=os.ttyname(slave), description="a modem")
    monkeypatch.setattr(devices.list_ports, "comports", lambda: [mute])
    begun = time.monotonic()
    assert [board.port for board in devices.find()] == [announced]
    assert time.monotonic() - begun < 5
    os.close(master)
    os.close(slave)


def test_none_and_several_boards(announced, monkeypatch, own_board):
    runtime.announce(os.path.realpath(own_board.url), "another")
    path = next(p for p in runtime.directory().glob("board-*") if "another" in p.read_text())
    path.write_text(path.read_text().replace(str(os.getpid()), str(own_board.pid)))
    with pytest.raises(LinkError, match="2 boards found, choose one: /dev/pts/") as caught:
        Drive.open()
    assert caught.value.mistake
    monkeypatch.setattr(runtime, "announced", lambda: [])
    with pytest.raises(LinkError, match="no board found"):
        Drive.open()


def test_the_runtime_directory_is_ones_own(monkeypatch, tmp_path):
    assert runtime.directory().stat().st_mode & 0o777 == 0o700
    runtime.directory().chmod(0o755)
    with pytest.raises(LinkError, match="belongs to you alone"):
        runtime.directory()
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    assert runtime.directory() == tmp_path / f"hexatorque-{os.getuid()}"
