"""XCP on a served board: by sockets, and by pyXCP on the virtual board and on an emulated
processor, whose recording is compared with that of our own stream."""

import csv
import json
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from forked import Forked
from waiting import WAIT_S

from hexatorque import firmware
from hexatorque.drive.board import BoardDrive

TOOL = Path(__file__).with_name("xcp_tool.py")
MACHINES = {"virtual": (), "mps2-an386": ("--machine", "mps2-an386")}
NAMES = ["virtual", pytest.param("mps2-an386", marks=pytest.mark.target)]
QUICK = {"build_s": 0.05, "build_current_A": 20.0}
MEASURED = ("i_u1_A", "i_w2_A", "vdc_V", "torque_Nm", "speed_rpm")
#: Addresses as docs/xcp.md defines them.
PARAMETERS = {name: 0x2000 + 4 * row.id for name, row in firmware.parameters().items()}
CHANNELS = {name: 0x1000 + 4 * k for k, (name, _) in enumerate(firmware.channels())}


@pytest.fixture(autouse=True)
def own_directory(tmp_path, monkeypatch):
    (tmp_path / "run").mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def serve():
    """serve(name, *options): starts `hexatorque board serve`, and returns what it said.
    serve.end() ends the latest one."""
    processes = []

    def begin(name, *options):
        command = ("-m", "hexatorque", "board", "serve", "--json", "--xcp", "0")
        process = Forked((*command, *MACHINES[name], *options), pipes=("stdout", "stderr"))
        processes.append(process)
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        return json.loads(line)

    def end():
        process = processes.pop()
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=WAIT_S)

    begin.end = end
    yield begin
    while processes:
        end()


def tool(what, *where):
    pytest.importorskip("pyxcp")
    done = subprocess.run(
        [sys.executable, str(TOOL), what, *map(str, where)],
        capture_output=True, text=True, timeout=WAIT_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def where(said, layer):
    if layer == "serial":
        return "sxi", said["port"], said["baud"]
    return "eth", layer, said["xcp"]


# --- sockets --------------------------------------------------------------------------------


def asked(line, packet, counter=0):
    line.send(struct.pack("<HH", len(packet), counter) + packet)
    raw = line.recv(4096)
    (n,) = struct.unpack_from("<H", raw)
    assert len(raw) == 4 + n
    return raw[4:]


def opened(said, kind):
    line = socket.socket(socket.AF_INET, kind)
    line.settimeout(WAIT_S)
    line.connect(("127.0.0.1", said["xcp"]))
    return line


@pytest.mark.parametrize("kind", [socket.SOCK_STREAM, socket.SOCK_DGRAM])
def test_masters_come_one_after_the_other(serve, kind):
    said = serve("virtual")
    for _ in range(3):
        with opened(said, kind) as line:
            assert asked(line, b"\xff\0")[:3] == b"\xff\5\x80"
            read = struct.pack("<BBBBI", 0xF4, 4, 0, 0, CHANNELS["vdc_V"])
            assert asked(line, read) == b"\xff" + struct.pack("<f", 250.0)


def test_a_second_tcp_master_is_turned_away_and_the_first_one_stays(serve):
    said = serve("virtual")
    with opened(said, socket.SOCK_STREAM) as first:
        assert asked(first, b"\xff\0")[0] == 0xFF
        with opened(said, socket.SOCK_STREAM) as second:
            assert second.recv(10) == b""
        assert asked(first, b"\xfd")[0] == 0xFF


def test_the_drive_stops_when_the_masters_connection_breaks(serve):
    said = serve("virtual")
    with BoardDrive.open(said["port"]) as drive:
        drive.set_many(QUICK)
    with opened(said, socket.SOCK_STREAM) as line:
        asked(line, b"\xff\0")
        assert asked(line, b"\xf1\x08") == b"\xff"  # START
        end = time.monotonic() + WAIT_S
        state = 0.0
        while state != 3.0 and time.monotonic() < end:
            read = struct.pack("<BBBBI", 0xF4, 4, 0, 0, CHANNELS["state"])
            (state,) = struct.unpack("<f", asked(line, read)[1:])
        assert state == 3.0  # run
    with BoardDrive.open(said["port"]) as drive:
        end = time.monotonic() + WAIT_S
        while drive.state != "fault" and time.monotonic() < end:
            time.sleep(0.02)
        assert drive.faults == ["link lost"]


@pytest.mark.parametrize("option", ["70000", "-1"])
def test_a_port_that_does_not_exist_is_refused_in_one_line(option):
    process = Forked(
        ("-m", "hexatorque", "board", "serve", "--xcp", option), pipes=("stdout", "stderr")
    )
    said = process.communicate(timeout=WAIT_S)[1].strip()
    assert process.returncode != 0
    assert said.splitlines()[-1].endswith(f"XCP port = {option}: allowed range is 0 .. 65535")


def test_a_port_in_use_is_told_in_one_line(serve):
    said = serve("virtual")
    process = Forked(
        ("-m", "hexatorque", "board", "serve", "--xcp", str(said["xcp"])),
        pipes=("stdout", "stderr"),
    )
    said_too = process.communicate(timeout=WAIT_S)[1].strip()
    assert f"XCP port {said['xcp']}: in use by another program" in said_too.splitlines()[-1]


# --- pyXCP ----------------------------------------------------------------------------------


@pytest.mark.parametrize("layer", ["TCP", "UDP", "serial"])
@pytest.mark.parametrize("name", NAMES)
def test_pyxcp_reads_writes_stores_and_is_refused_by_xcps_own_codes(serve, need, name, layer):
    """A board with a store keeps page 0, and has it after a new start; one without refuses."""
    if name != "virtual":
        need(name)
    stores = layer != "UDP"
    options = ("--store", "own.store") if stores else ()
    said = serve(name, *options)
    Path("addresses.json").write_text(json.dumps(CHANNELS | PARAMETERS))
    # No other client before: its process has the serial port for a second more.
    found = tool("calibrate", *where(said, layer))
    assert name in found.pop("name")
    initial = found.pop("initial")
    assert initial != 0.75
    assert found == {
        "before": 0.0, "written": "done", "after": 123.5, "too large": "ERR_OUT_OF_RANGE",
        "no whole number": "ERR_OUT_OF_RANGE", "a channel": "ERR_WRITE_PROTECTED",
        "no address": "ERR_ACCESS_DENIED", "read of no address": "ERR_ACCESS_DENIED",
        "still": 123.5, "vdc_V": 250.0, "kept": 0.0, "too much": "ERR_DAQ_CONFIG",
        "store": "done" if stores else "ERR_GENERIC",
        "stored": 0.75 if stores else initial,
    }  # fmt: skip
    if stores:
        serve.end()
        with BoardDrive.open(serve(name, *options)["port"], said["baud"]) as drive:
            assert drive.get("kp_speed_Nms_rad") == 0.75


def measured():
    """(time of each sample in fast interrupts since the first one, values)"""
    with open("measured.csv") as file:
        head, *rows = csv.reader(file)
    values = np.array([[float(x) for x in row[2:]] for row in rows], np.float32)
    order = [[name.strip() for name in head[2:]].index(name) for name in MEASURED]
    times_us = np.array([int(row[1]) for row in rows]) / 1000
    return np.round((times_us - times_us[0]) / 100).astype(int), values[:, order]


#: Layer, event, its prescaler, and our stream's fast interrupts from sample to sample. These have
#: no common divisor with those of the event.
MEASURING = {"fast": ("TCP", 0, 3, 10), "slow": ("UDP", 1, 2, 7)}


@pytest.mark.parametrize("event", MEASURING)
@pytest.mark.parametrize("name", NAMES)
def test_pyxcps_recording_equals_that_of_our_own_stream(serve, need, name, event):
    """Both see the same fast interrupts of a drive that runs."""
    if name != "virtual":
        need(name)
    layer, number, prescaler, decimation = MEASURING[event]
    quick = ("--set", "controller.f_slow_Hz=1000")  # else the slow event takes 20 s
    said = serve(name, "--set", "sensors.i_noise_A=0.02", *quick)
    asked_for = {**CHANNELS, "measured": MEASURED, "prescaler": prescaler, "event": number}
    Path("addresses.json").write_text(json.dumps(asked_for))
    with BoardDrive.open(said["port"], said["baud"]) as drive:
        drive.set_many({**QUICK, "speed_ref_rpm": 200.0})
        every = round(drive.get("f_isr_Hz") / drive.get("f_slow_Hz")) if event == "slow" else 1
        drive.start()
        with drive.stream(MEASURED, decimation=decimation) as stream:
            pytest.importorskip("pyxcp")
            with subprocess.Popen(
                [sys.executable, str(TOOL), "measure", *map(str, where(said, layer))],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            ) as process:  # fmt: skip
                blocks = []
                while process.poll() is None:
                    block = stream.read(1.0)
                    if block is not None:
                        blocks.append(block)
                assert process.returncode == 0, process.stdout.read()
        assert (stream.gaps, stream.lost) == (0, 0)
        assert drive.state == "run"
    ticks = np.concatenate([t for t, _ in blocks])
    ours = np.concatenate([v for _, v in blocks]).astype(np.float32)
    since, theirs = measured()
    assert len(since) >= 1000
    assert set(np.diff(since)) == {every * prescaler}, "samples are missing"

    # Noise makes each sample another one: where one is equal, all at ticks of both must be.
    row_of = {row.tobytes(): k for k, row in enumerate(theirs)}
    assert len(row_of) == len(theirs)
    equal = [(k, row_of[row.tobytes()]) for k, row in enumerate(ours) if row.tobytes() in row_of]
    offsets = {int(ticks[k] - since[j]) for k, j in equal}
    assert len(offsets) == 1
    both = set((ticks - offsets.pop()).tolist()) & set(since.tolist())
    assert len(both) == len(equal) > 30


def test_pyxcp_measures_on_the_serial_line_itself(serve):
    """Where it has the line alone, no sample is missing, and they have noise."""
    said = serve("virtual", "--set", "sensors.i_noise_A=0.02")
    asked_for = {**CHANNELS, "measured": MEASURED, "prescaler": 5}
    Path("addresses.json").write_text(json.dumps(asked_for))
    tool("measure", *where(said, "serial"))
    since, theirs = measured()
    assert len(since) >= 1000 and set(np.diff(since)) == {5}
    assert len({row.tobytes() for row in theirs}) > 50


# --- the description ------------------------------------------------------------------------


def described(*options):
    from hexatorque.cli.main import main

    assert main(["board", "a2l", "drive.a2l", *options]) == 0
    return Path("drive.a2l")


def test_the_a2l_is_consistent():
    program = Path(sys.executable).with_name("a2ltool")
    if not program.exists():
        pytest.skip("a2ltool is missing: pip install a2ltool")
    done = subprocess.run(
        [program, "--check", "--strict", described()], capture_output=True, text=True
    )
    assert (done.returncode, "No problems found" in done.stdout) == (0, True), done.stdout


def test_the_a2l_has_the_address_of_every_parameter_and_channel(capsys):
    text = described("--xcp", "4711", "--baud", "937500").read_text()
    words = text.split()
    for name, address in PARAMETERS.items():
        at = words.index(f"controller.{name}")
        assert words[at - 1] == "CHARACTERISTIC"
        assert f"VALUE 0x{address:X} value" in " ".join(words[at : at + 80]), name
    for name, address in CHANNELS.items():
        begin = text.index(f"/begin MEASUREMENT {name} ")
        end = text.index("/end MEASUREMENT", begin)
        assert f"ECU_ADDRESS 0x{address:X}\n" in text[begin:end], name
    assert text.count("/begin CHARACTERISTIC") == len(PARAMETERS)
    assert text.count("/begin MEASUREMENT") == len(CHANNELS)
    assert "XCP_ON_TCP_IP 0x0100 4711 " in text
    assert "XCP_ON_SxI 0x0100 937500" in text
    assert "port 4711" in capsys.readouterr().out


@pytest.mark.parametrize(("arguments", "said"), [
    (("drive.txt",), "drive.txt: the name must end with .a2l"),
    (("drive.a2l", "--xcp", "0"), "--xcp 0: allowed range is 1 .. 65535"),
    (("addresses/none.a2l",), "addresses/none.a2l: "),
])  # fmt: skip
def test_a_wrong_request_for_an_a2l_is_told_in_one_line(capsys, arguments, said):
    from hexatorque.cli.main import main

    Path("addresses").write_text("")
    assert main(["board", "a2l", *arguments]) != 0
    line = capsys.readouterr().err.strip()
    assert said in line
    assert "\n" not in line
