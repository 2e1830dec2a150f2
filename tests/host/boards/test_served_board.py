"""What a client does with a board, from its dictionary to a capture and to a client that dies:
one script, for the virtual board and for the same firmware on emulated processors, each started
by `hexatorque board serve` and reached through its pseudo-terminal.
"""

import json
import math
import os
import signal
import struct
import time

import numpy as np
import pytest
from campaigns import WHOLE
from forked import Forked
from waiting import WAIT_S, alive

import hexatorque
from hexatorque import firmware
from hexatorque.boards import emulated
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.firmware import FirmwareError
from hexatorque.recording.recording import Recording
from hexatorque.serial import LinkError, wire
from hexatorque.serial.wire import CaptureState, Op, Status

#: Arguments of `hexatorque board serve`.
BOARDS = {
    "virtual": (),
    "mps2-an386": ("--machine", "mps2-an386"),
    "mps2-an500": ("--machine", "mps2-an500"),
}
#: Each emulated board has the same program as the virtual one, so it does all of this only if the
#: campaigns are whole. The Cortex-M7's images take half a minute to build.
NAMES = list(BOARDS) if WHOLE else ["virtual", "mps2-an386"]
DYING = list(BOARDS) if WHOLE else ["virtual"]


def boards(names):
    """As parameters: what is emulated is a test for `make test-targets`."""
    return [pytest.param(n, marks=() if n == "virtual" else pytest.mark.target) for n in names]


#: Fast interrupts between a client's death and the gates: 350 ms.
STOPPED_TICKS = 3500
WATCHDOG_TICKS = 2500
#: Paper A's machine with its flux built up in 50 ms, through the link.
QUICK = {"build_s": 0.05, "build_current_A": 20.0}
STREAMED = ("i_u1_A", "i_w1_A", "i_v1_A", "vdc_V", "psi_alpha_Wb", "torque_Nm", "torque_ref_Nm",
            "speed_rpm")  # fmt: skip
#: The reference comes from the slow interrupt, between two samples.
CAPTURED = ("state", "i_u1_A", "i_u2_A", "i_w1_A", "i_w2_A", "i_v1_A", "i_v2_A", "psi_alpha_Wb",
            "psi_beta_Wb", "torque_Nm", "torque_ref_Nm", "speed_rpm")  # fmt: skip

#: Starts the drive and says the tick of the board's latest reply until it is killed.
DOOMED = """
import sys, time
from hexatorque.drive.board import BoardDrive
with BoardDrive.open(sys.argv[1]) as drive:
    drive.start()
    while True:
        print(drive.state, drive.client.latest.tick, flush=True)
        time.sleep(0.01)
"""


@pytest.fixture(autouse=True)
def own_directory(tmp_path, monkeypatch):
    (tmp_path / "run").mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))


def process(*command):
    return Forked(command, pipes=("stdout", "stderr"))


def until(what, within_s=WAIT_S):
    """Whether `what()` comes true in time."""
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        if what():
            return True
        time.sleep(0.01)
    return bool(what())


class Served:
    """`hexatorque board serve` in a process of its own."""

    def __init__(self, *options):
        self.process = process("-m", "hexatorque", "board", "serve", "--json", *options)
        line = self.process.stdout.readline()
        assert line, self.process.communicate()[1]
        self.said = json.loads(line)
        self.port = self.said["port"]

    @property
    def emulator(self):
        """Process id of its QEMU."""
        with open(f"/proc/{self.process.pid}/task/{self.process.pid}/children") as file:
            (pid,) = file.read().split()
        return int(pid)

    def end(self, number=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(number)
        said = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, said[1].strip()


@pytest.fixture
def serve():
    """serve(board, *options), ended with the test."""
    boards = []

    def begin(name, *options):
        boards.append(Served(*BOARDS[name], *options))
        return boards[-1]

    yield begin
    for board in boards:
        board.end(signal.SIGKILL)


def in_state(drive, *states):
    """Wait for one of the states. As long as an emulated board may take that other programs
    slow down."""
    assert until(lambda: drive.state in states), (drive.state, drive.faults)
    return drive.state


@pytest.mark.parametrize("name", boards(NAMES))
def test_from_dictionary_to_capture(name, serve, need, tmp_path):
    if name != "virtual":
        need(name)
    own = tmp_path / "own.npz"
    board = serve(name, "--record", str(own))
    assert name in board.said["title"]

    with BoardDrive.open(board.port, board.said["baud"]) as drive:
        # Who is there: the board's dictionary is this firmware's.
        assert name in drive.hello.device
        assert dict(drive.params) == firmware.parameters("f28335")
        assert drive.channels == firmware.channels()

        # Values: all or none, and read back.
        drive.set_many({**QUICK, "speed_ref_rpm": 100.0})
        assert drive.get("build_s") == pytest.approx(0.05)
        id = drive.params["speed_ref_rpm"].id  # past the client, which knows the range as well
        reply = drive.client.ask(Op.WRITE, struct.pack("<HfHf", id, 200.0, id, 1e9))
        assert (reply.status, reply.payload) == (Status.VALUE, struct.pack("<H", id))
        assert drive.get("speed_ref_rpm") == 100.0

        # Start, kept alive by nothing but the client's heartbeat.
        drive.start()
        in_state(drive, "run", "fault")
        assert (drive.state, drive.faults) == ("run", [])
        with pytest.raises(LinkError, match="run"):
            drive.set("build_s", 0.1)

        # A stream as fast as the line carries it, without a gap.
        with drive.stream(STREAMED) as stream:
            ticks = []
            while sum(map(len, ticks)) < 2500:
                tick, values = next(iter(stream))
                ticks.append(tick)
                assert np.isfinite(values).all()
        # Nine tenths of the line, ten bits a byte, 12 + 4 * 8 bytes a sample.
        bytes_per_period = 0.9 * board.said["baud"] / 10 / drive.hello.f_isr_Hz
        assert stream.decimation == math.ceil(44 / bytes_per_period)
        assert np.all(np.diff(np.concatenate(ticks)) == stream.decimation)
        assert (stream.gaps, stream.lost, stream.damaged) == (0, 0, 0)

        # A capture of every fast interrupt around a step, more than the line could carry.
        drive.arm(CAPTURED, samples=1500, pre=500, trigger="rising:speed_rpm:150")
        assert until(lambda: drive.client.get_status().capture == CaptureState.WAITING)
        drive.set("speed_ref_rpm", 300.0)
        captured = drive.captured(timeout_s=WAIT_S)
        assert captured["speed_rpm"][499] <= 150 < captured["speed_rpm"][500]

        drive.stop()
        assert drive.state == "idle"
        status = drive.client.get_status()
        assert (status.damaged, status.overruns, status.dropped) == (0, 0, 0)
        assert drive.client.counters.damaged == 0

    code, said = board.end()
    assert (code, said) == (0, f"recording: {own}")

    # What the simulation itself recorded of the very same fast interrupts: tick n is its n-th.
    recording = Recording.load(own)
    first = captured.meta["trigger_tick"] - 500 - 1
    per = round(recording.rate_Hz / captured.rate_Hz)
    for channel in CAPTURED:
        there = recording[channel][::per][first : first + 1500]
        assert np.array_equal(captured[channel].view(np.uint32), there.view(np.uint32)), channel


def doomed(board):
    """A client whose drive runs, its latest tick, and the process of the port server."""
    with BoardDrive.open(board.port) as drive:
        drive.set_many(QUICK)
    client = process("-c", DOOMED, board.port)
    for line in client.stdout:
        state, tick = line.split()
        if state == "run":
            break
    else:
        raise AssertionError(client.communicate()[1])
    with BoardDrive.open(board.port) as drive:
        return client, int(tick), drive.client.transport.pid


def latest_tick(client, tick):
    last = [line.split() for line in client.communicate()[0].splitlines(keepends=True)
            if line.endswith("\n")]  # fmt: skip
    return int(last[-1][1]) if last else tick


def runs_again(drive):
    drive.start()
    assert in_state(drive, "run") == "run"
    drive.stop()
    assert (drive.state, drive.faults) == ("idle", [])


@pytest.mark.parametrize("name", boards(DYING))
def test_drive_stops_after_its_client_died(name, serve, need):
    """The port server stops the drive that it started."""
    if name != "virtual":
        need(name)
    board = serve(name)
    client, tick, _ = doomed(board)
    client.kill()
    with BoardDrive.open(board.port) as drive:
        in_state(drive, "idle", "fault")
        assert (drive.state, drive.faults) == ("idle", [])
        assert drive.client.latest.tick > latest_tick(client, tick)
        runs_again(drive)
    assert board.end()[0] == 0


@pytest.mark.parametrize("name", boards(DYING))
def test_drive_stops_after_the_computer_died(name, serve, need):
    """Client and port server at once. The gates are off within 350 ms of the drive's time, and
    the board waits for a clear."""
    if name != "virtual":
        need(name)
    board = serve(name)
    client, tick, server = doomed(board)
    os.kill(server, signal.SIGKILL)
    client.kill()
    tick = latest_tick(client, tick)
    with BoardDrive.open(board.port) as drive:
        in_state(drive, "fault")
        assert drive.faults == ["link lost"]
        assert WATCHDOG_TICKS - 1 <= drive.snapshot["tick"] - tick <= STOPPED_TICKS
        # The dead client's session ends a second later, and a slow emulator's second is longer than
        # a client waits.
        assert until(lambda: not drive.client.get_status().in_session)
        with pytest.raises(LinkError, match="fault"):
            drive.start()
        drive.clear()
        runs_again(drive)
    assert board.end()[0] == 0


# --- what goes wrong ------------------------------------------------------------------


@pytest.mark.target
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_emulator_is_left_behind(serve, need, number):
    need("mps2-an386")
    board = serve("mps2-an386")
    emulator = board.emulator
    assert alive(emulator)
    code, said = board.end(number)
    assert (code, said) == (-9 if number == signal.SIGKILL else 0, "")
    assert until(lambda: not alive(emulator))


@pytest.mark.target
def test_emulator_that_dies(serve, need):
    need("mps2-an386")
    board = serve("mps2-an386")
    os.kill(board.emulator, signal.SIGKILL)
    _, said = board.process.communicate(timeout=WAIT_S)
    assert said.strip() == "hexatorque: mps2-an386: the target has ended (status -9)"
    assert board.process.returncode == 1
    assert not os.path.exists(board.port)


def test_missing_tools(capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["board", "serve", "--machine", "mps2-an386"]) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    assert "qemu-system-arm" in said and "apt-get install" in said


@pytest.mark.parametrize(
    ("options", "said"),
    [({"machine": "atmega2560"}, "mps2-an500"), ({"baud": 23}, "24 .. 1562500"),
     ({"baud": 1_562_501}, "24 .. 1562500"), ({"factor": 0.0}, r"0\.01 \.\. 100")],
)  # fmt: skip
def test_bad_options(quick, options, said):
    with pytest.raises(FirmwareError, match=said):
        emulated.EmulatedBoard(quick, **options)


@pytest.mark.target
@pytest.mark.parametrize("baud", [9600, 115200, 1_562_500])
def test_bytes_take_their_time(quick, need, baud):
    """In the drive's time, whatever the emulator does: start bit, 8 bits, stop bit."""
    need("mps2-an386")
    request = wire.frame(wire.request(Op.HELLO, 1, 0, 0))
    with emulated.EmulatedBoard(quick, baud=baud) as board:
        assert board.controller.put(request) == len(request)
        came = b""
        while not came.strip(b"\0") or came[-1]:  # the reply, up to its closing zero
            board.run(board.sim.period_s)
            came += board.controller.take()
            assert board.sim.time_s < 1.0
    (body,) = wire.Splitter().push(came)
    hello = wire.parse_hello(wire.parse_reply(body).payload)
    bytes_per_s = 25e6 / round(25e6 / baud) / 10  # its divider
    assert hello.budget == pytest.approx(0.9 * bytes_per_s, rel=0.01)
    assert "mps2-an386" in hello.device and hexatorque.__version__ in hello.build
    # Each way may have saved one byte up, and the reply begins in the period in which the
    # request ends. How long the emulator takes at most depends on this computer's load.
    least_s = (len(request) + len(came) - 2) / bytes_per_s - board.sim.period_s
    assert board.sim.time_s >= least_s - 1e-9


@pytest.mark.parametrize("name", boards(NAMES))
def test_parameters_survive_the_end_of_the_process(name, serve, need, tmp_path):
    """The same firmware keeps them in the same file, here and in the emulator."""
    if name != "virtual":
        need(name)
    file = tmp_path / "bench.store"
    board = serve(name, "--store", str(file))
    assert board.said["parameters"] == "built-in"
    with BoardDrive.open(board.port, board.said["baud"]) as drive:
        assert drive.parameter_set == "built-in"
        drive.set_many({"rs_ohm": 1.75, "speed_ref_rpm": 100.0, "dead_time_us": 3.0})
        drive.store_parameters()
        assert drive.parameter_set == "built-in"  # as it started
    board.end(signal.SIGKILL)
    board = serve(name, "--store", str(file))
    assert board.said["parameters"] == "saved"
    with BoardDrive.open(board.port, board.said["baud"]) as drive:
        assert drive.parameter_set == "saved"
        kept = drive.get_many(["rs_ohm", "speed_ref_rpm", "dead_time_us"])
        assert kept == {"rs_ohm": 1.75, "speed_ref_rpm": 0.0, "dead_time_us": 3.0}
    board.end(signal.SIGKILL)
    raw = bytearray(file.read_bytes())
    for at in range(40, len(raw), 50):
        raw[at] ^= 1
    file.write_bytes(raw)
    board = serve(name, "--store", str(file))
    assert "damaged" in board.said["parameters"]
    with BoardDrive.open(board.port, board.said["baud"]) as drive:
        assert "damaged" in drive.parameter_set
        assert drive.get("rs_ohm") != 1.75
        drive.forget_parameters()
    board.end(signal.SIGKILL)
    board = serve(name, "--store", str(file))
    assert board.said["parameters"] == "built-in"
