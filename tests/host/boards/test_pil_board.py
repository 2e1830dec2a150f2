"""Processor in the loop over a serial line: the C2000 boards' own image on the register
model, at the other end of a pseudo terminal. Bytes take their time there, the watchdog
runs, and the first forbidden register access or gate pin that is no input ends it
(tests/c/run_pil.c).
"""

import contextlib
import difflib
import fcntl
import os
import pty
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import tty

import c2000_image as image
import pytest
from waiting import WAIT_S

from hexatorque import firmware
from hexatorque.boards import pil_board
from hexatorque.boards.processor import TargetError
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import pil
from hexatorque.firmware import ffi, lib
from hexatorque.serial import wire
from hexatorque.setups import Profile, SetupError

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which(image.CC) is None,
    reason="Linux and a C compiler are needed",
)

PROFILE = Profile(
    duration_s=0.3, speed_rpm=((0.11, 100.0), (0.2, -200.0)), load_Nm=((0.15, 5.0),),
    set=((0.17, "scheme", "dtc3"), (0.25, "scheme", "ddr")), samples_per_period=1,
)  # fmt: skip
SHORT = Profile(duration_s=0.02, samples_per_period=1)
F28335, F28377S, LAUNCHPAD = image.BOARDS
CHIP, SERVER = "ht_pil_chip.c", "ht_pil_server.c"


@pytest.fixture(scope="module")
def builder(tmp_path_factory):
    return image.Builder(tmp_path_factory.mktemp("pil"))


class Line:
    """A pseudo-terminal. `name` is the serial port; the board has the other end."""

    def __init__(self):
        self.far, self.near = pty.openpty()
        tty.setraw(self.near)
        self.name = os.ttyname(self.near)

    def hang_up(self):
        for end in (self.far, self.near):
            with contextlib.suppress(OSError):
                os.close(end)


class Board(Line):
    def __init__(self, program, baud=pil_board.BAUD):
        super().__init__()
        self.process = subprocess.Popen(
            [program, str(baud)], stdin=self.far, stdout=self.far, stderr=subprocess.PIPE, text=True
        )

    def said(self):
        return self.process.communicate(timeout=WAIT_S)[1].strip()

    def unplug(self):
        self.process.kill()
        self.process.communicate()
        self.hang_up()


@contextlib.contextmanager
def powered(program, baud=pil_board.BAUD):
    it = Board(program, baud)
    try:
        yield it
    finally:
        it.unplug()


@pytest.fixture(scope="module")
def programs(builder):
    return {name: builder.build(name, pil=True) for name in image.BOARDS}


@pytest.fixture
def a_board(programs):
    with powered(programs[F28335]) as it:
        yield it


def target_of(line, timeout_s=1.0):
    return pil_board.BoardTarget(line.name, timeout_s=timeout_s)


def request():
    """A HELLO as it is on the line, without a zero before it."""
    return wire.frame(bytes([lib.HT_OP_PIL_HELLO, 1]))[1:]


def replies(raw):
    """Bodies of the replies in what came from a board."""
    assert raw[-1:] in (b"", b"\0")
    return [wire.unframe(frame) for frame in raw.split(b"\0")[:-1]]


def is_hello(raw):
    """The one reply to `request`, and nothing else."""
    (body,) = replies(raw)
    return body[:2] == bytes([lib.HT_OP_PIL_HELLO | lib.HT_OP_REPLY, 1])


def answer(line, within_s=WAIT_S):
    """All bytes that come: a reply, and what follows it before the line is quiet."""
    os.set_blocking(line.near, False)
    got, until = b"", time.monotonic() + within_s
    while time.monotonic() < until:
        with contextlib.suppress(BlockingIOError):
            got += os.read(line.near, 4096)
            if got.endswith(b"\0"):
                until = min(until, time.monotonic() + 0.2)
        time.sleep(0.005)
    return got


def disturb(it, number):
    """A signal to the world around the chip, once that is there."""
    os.write(it.near, request())
    answer(it, 0.2)
    it.process.send_signal(number)
    time.sleep(0.05)


# --- the image ------------------------------------------------------------------------


def image_difference(name, lines):
    want = image.golden(name, pil=True).read_text().splitlines()
    return list(difflib.unified_diff(want, image.describe(name, lines), "golden", "found", n=0))


@pytest.mark.parametrize("name", image.BOARDS)
def test_registers_after_the_start(programs, name):
    good, lines = image.run(programs[name], "registers")
    assert good and not image.complaints(lines)
    assert not image_difference(name, lines)


@pytest.mark.parametrize("name", image.BOARDS)
def test_nothing_that_could_reach_the_gates_is_touched(programs, name):
    """No PWM module is written, no pin is an output, and the modules of the plant are unchanged."""
    _, lines = image.run(programs[name], "registers")
    said = image.describe(name, lines)
    assert any(row.startswith("SCIA.SCICTL1") for row in said)
    for what in ("EPWM", "EQEP", "ADC", "PIE", "VECTOR"):
        assert not [row for row in said if row.startswith(what)]
    assert all(row.endswith("outputs:") for row in said if "DIR " in row)


def test_both_chips_divide_their_clocks_to_the_same_rate():
    """LSPCLK / (8 (BRR + 1)), exactly: 75 and 50 MHz."""
    dividers = {}
    for name in image.BOARDS:
        rows = [r.split() for r in image.golden(name, pil=True).read_text().splitlines()]
        value = {row[0]: int(row[2], 16) for row in rows}
        dividers[name] = 256 * value["SCIA.SCIHBAUD"] + value["SCIA.SCILBAUD"] + 1
    assert 75e6 / 8 / dividers[F28335] == pil_board.BAUD
    assert 50e6 / 8 / dividers[F28377S] == 50e6 / 8 / dividers[LAUNCHPAD] == pil_board.BAUD


# --- the loop ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "device", "latency"),
    [(F28335, "f28335", "predicted"), (F28377S, "f28377s", "immediate"),
     (LAUNCHPAD, "f28335", "shadow")],
)  # fmt: skip
def test_every_register_and_channel_bit_by_bit(programs, quick, name, device, latency):
    """The board's processor and the chip whose driver runs on the PC need not be the same."""
    setup = quick.changed(timing__device=device, timing__latency=latency)
    with powered(programs[name]) as it, target_of(it) as target:
        outcome = pil.compare(setup, PROFILE, target)
        assert target.link.calls == 1
    assert outcome.failures() == []
    assert (outcome.steps, outcome.state) == (3000, "run")


def test_a_fault_and_its_snapshot(a_board, quick):
    setup = quick.changed(controller__i_trip_A=6.0)
    with target_of(a_board) as target:
        outcome = pil.compare(setup, Profile(duration_s=0.1, samples_per_period=1), target)
    assert outcome.difference is None
    assert outcome.faults == outcome.snapshot["faults"] == ["over-current"]


def test_one_bit_of_a_parameter_shows(a_board, quick):
    with target_of(a_board) as target:
        make = target.controller
        target.controller = lambda device, values: make(
            device, {**values, "rs_ohm": values["rs_ohm"] * (1 + 1.2e-7)}
        )
        outcome = pil.compare(quick, Profile(duration_s=0.15, samples_per_period=1), target)
    assert outcome.difference is not None


def test_runs_one_after_the_other_without_a_reset(a_board, quick):
    for device in (*firmware.DEVICES, firmware.DEVICES[0]):
        with target_of(a_board) as target:
            outcome = pil.compare(quick.changed(timing__device=device), SHORT, target)
        assert outcome.failures() == []
    assert a_board.process.poll() is None


def test_line_with_a_network_address(programs, quick):
    """What pyserial opens as socket://, e.g. a serial server's port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        name = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with pil_board.BoardTarget(name) as target:
            far, _ = server.accept()
            with (
                far,
                subprocess.Popen(
                    [programs[F28335], str(pil_board.BAUD)], stdin=far, stdout=far
                ) as it,
            ):
                assert pil.compare(quick, SHORT, target).failures() == []
                it.kill()


def test_command(a_board, tmp_path, capsys):
    scenario = tmp_path / "short.toml"
    scenario.write_text('setup = "paper-a-feasible"\n[profile]\nduration_s = 0.02\n')
    output = str(tmp_path / "o.npz")
    assert main(["evidence", "pil", str(scenario), "--device", a_board.name, "-o", output]) == 0
    assert "identical" in capsys.readouterr().out
    assert (tmp_path / "o.npz").exists()


# --- hosts that disappear, lines that damage bytes ---------------------------------------------


#: The reply to a damaged frame.
DAMAGED = bytes([lib.HT_OP_PIL_DAMAGED | lib.HT_OP_REPLY, *bytes(lib.HT_PIL_REPLY_HEAD - 1)])


def test_hello(a_board):
    os.write(a_board.near, request())
    (body,) = replies(answer(a_board))
    head, identity = struct.unpack("<BBBBI", body[:8]), struct.unpack("<4HI", body[8:])
    assert head == (lib.HT_OP_PIL_HELLO | lib.HT_OP_REPLY, 1, lib.HT_OK, 0, 0)
    own = ffi.new("ht_pil_identity *")
    lib.ht_pil_identify(own)
    assert identity == (own.version, own.params, own.channels, 0, own.names)  # no registers


def test_half_a_request_ends_with_the_next_zero(a_board):
    """A host disappeared in the middle of a request. The next host begins with a zero. The board
    reports a damaged frame, and answers the request that follows."""
    os.write(a_board.near, request()[:-3])
    assert answer(a_board, 0.5) == b""
    os.write(a_board.near, b"\0")
    assert replies(answer(a_board)) == [DAMAGED]
    os.write(a_board.near, b"\0" + request())
    assert is_hello(answer(a_board))


def test_the_board_waits_for_a_slow_host(a_board):
    """A frame in pieces."""
    whole = request()
    for n in range(len(whole)):
        os.write(a_board.near, whole[n : n + 1])
        time.sleep(0.02)
    assert is_hello(answer(a_board))


def test_request_of_the_link_is_refused(a_board):
    """A program that searches for a drive does not take this board for one."""
    os.write(a_board.near, wire.frame(wire.request(wire.Op.START, 7, 0x0100, 7))[1:])
    (body,) = replies(answer(a_board))
    assert body[:3] == bytes([wire.Op.START | lib.HT_OP_REPLY, 7, lib.HT_PIL_REFUSED])


@pytest.mark.parametrize(
    "left", [b"\x22\x01", b"\x01", b"\xff" * 600, bytes(range(256)) * 4],
    ids=["half a frame", "one byte", "too long", "anything"],
)  # fmt: skip
def test_a_host_connects_to_the_board_in_any_earlier_state(a_board, quick, left):
    """At once: it does not wait for the board's time-out."""
    os.write(a_board.near, left)
    with target_of(a_board) as target:
        controller = target.controller("f28335", quick.controller_values())
        controller.start()
        assert controller.state == "calibrate"


def test_a_host_that_disappears_during_a_run(a_board, quick):
    with target_of(a_board) as target:
        sim = SimulatedDrive(quick, 1, target.controller)
        sim.start()
        sim.run(0.12)
        os.write(a_board.near, request()[:3])
    with target_of(a_board) as target:
        assert pil.compare(quick, SHORT, target).failures() == []


def test_a_receiver_overrun_is_survived(a_board, quick):
    """Bytes that come too fast are lost, but the board and the line continue to work."""
    with target_of(a_board) as target:
        controller = target.controller("f28335", quick.controller_values())
        a_board.process.send_signal(signal.SIGUSR1)
        time.sleep(0.05)
        with pytest.raises(TargetError, match=r"no reply in time|did not arrive whole"):
            controller.start()
    with target_of(a_board) as target:
        assert pil.compare(quick, SHORT, target).failures() == []


def test_framing_error(a_board, quick):
    """As when a cable is plugged in: the receiver stops until its driver resets it."""
    disturb(a_board, signal.SIGUSR2)
    with target_of(a_board) as target:
        assert pil.compare(quick, SHORT, target).failures() == []


def test_board_that_was_reset_in_between(programs, quick):
    """It no longer has a drive, and reports that."""
    it = Board(programs[F28335])
    with target_of(it) as target:
        controller = target.controller("f28335", quick.controller_values())
        it.process.kill()
        it.process.communicate()
        it.process = subprocess.Popen(
            [programs[F28335], str(pil_board.BAUD)], stdin=it.far, stdout=it.far,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        with pytest.raises(TargetError, match="the target refuses the request"):
            controller.start()
    it.unplug()


def test_quiet_board_keeps_its_watchdog_fed(a_board):
    """In a second of the chip's time its watchdog would have reset it three times."""
    time.sleep(1.0)
    os.write(a_board.near, request())
    assert is_hello(answer(a_board))


# --- messages of the command ------------------------------------------------------------


def fails(capsys, *arguments):
    """The exit code, and the one line of the error message."""
    code = main(["evidence", "pil", "--schemes", "ddr", *arguments])
    said = capsys.readouterr().err.strip()
    assert said.startswith("hexatorque: ") and "\n" not in said
    return code, said


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_no_such_port(capsys):
    code, said = fails(capsys, "--device", "/dev/ttyNOPE0")
    assert code == 2 and "/dev/ttyNOPE0: no such port; there is" in said


def test_not_a_port(capsys):
    assert fails(capsys, "--device", "/dev/null") == (2, "hexatorque: /dev/null: not a serial port")


def test_port_without_a_descriptor(capsys):
    code, said = fails(capsys, "--device", "loop://")
    assert code == 2 and "file descriptor" in said


def test_busy_port(a_board, capsys):
    with target_of(a_board):
        code, said = fails(capsys, "--device", a_board.name)
    assert code == 2 and "busy" in said
    holder = os.open(a_board.name, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(holder, fcntl.LOCK_EX)
    with pytest.raises(SetupError, match="busy"):
        target_of(a_board)
    os.close(holder)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--device", "x", "--machine", "mps2-an386"], "--machine: not with --device"),
     (["--baud", "9600"], "--baud: only with --device"),
     (["--device", "/dev/null", "--baud", "0"], "a rate above 0 is needed")],
)  # fmt: skip
def test_options_that_do_not_fit(arguments, said, capsys):
    code, line = fails(capsys, *arguments)
    assert code == 2 and said in line


def test_a_port_without_an_answer(capsys, monkeypatch):
    line = Line()
    code, said = fails(capsys, "--device", line.name)
    line.hang_up()
    assert code == 1
    assert "no reply in time (2 s; is the board on, with an image for processor in the loop" in said


def chatter(line, raw, stop):
    """What another program of a board may send: after each request, or all the time."""
    with contextlib.suppress(OSError):
        while not stop.is_set():
            os.write(line.far, raw)
            time.sleep(0.002)


def test_line_that_never_gets_quiet(capsys):
    line, stop = Line(), threading.Event()
    talker = threading.Thread(target=chatter, args=(line, b"speed 100\r\n", stop))
    talker.start()
    code, said = fails(capsys, "--device", line.name)
    stop.set()
    talker.join()
    line.hang_up()
    assert code == 1 and "does not get quiet" in said


def test_garbage_for_an_answer():
    """Neither an echo nor a shell's prompt is taken for an answer."""
    line = Line()

    def prompt():
        with contextlib.suppress(OSError):
            while os.read(line.far, 4096):
                os.write(line.far, b"login: ")

    talker = threading.Thread(target=prompt)
    talker.start()
    with (
        pil_board.BoardTarget(line.name, timeout_s=0.5) as target,
        pytest.raises(TargetError, match=r"bytes came, but no reply in them: is the board's rate"),
    ):
        target.controller("f28335", {})
    os.close(line.near)
    talker.join()
    os.close(line.far)


def test_another_rate(programs):
    """The host's end at 115200 baud, the board's at its own."""
    with (
        powered(programs[LAUNCHPAD], 115200) as it,
        pil_board.BoardTarget(it.name, 115200, timeout_s=0.5) as target,
        pytest.raises(TargetError, match=r"no reply in time .*115200 baud"),
    ):
        target.controller("f28377s", {})


def test_image_of_another_rate(builder, quick):
    """-DHT_PIL_BAUD=115200, as the build passes it on."""
    change = (CHIP, '#include "ht_drivers.h"\n',
              '#define HT_PIL_BAUD 115200u\n#include "ht_drivers.h"\n')  # fmt: skip
    program = builder.build(F28377S, change, pil=True)
    with (
        powered(program, 115200) as it,
        pil_board.BoardTarget(it.name, 115200) as target,
    ):
        assert pil.compare(quick, SHORT, target).failures() == []


def test_a_board_unplugged_during_a_run(programs, quick):
    it = Board(programs[F28335])
    with target_of(it) as target:
        sim = SimulatedDrive(quick, 1, target.controller)
        sim.start()
        sim.run(0.01)
        it.unplug()
        with pytest.raises(TargetError, match=r"has ended \(the port is gone: unplugged"):
            sim.run(1.0)


# --- each of these checks can fail --------------------------------------------------------

#: What is broken -> (board, source, text, replacement, what is then said by the run, by
#: the model, or by the difference from the golden registers).
FAULTS = {
    "watchdog: first key missing": (
        F28335, CHIP, "    ht_watchdog_first(&chip);\n", "", "watchdog reset, not serviced"),
    "watchdog: second key missing": (
        F28377S, CHIP, "    ht_watchdog_second(&chip);\n", "", "watchdog reset, not serviced"),
    "watchdog off": (
        F28335, CHIP, "    ht_watchdog_hold(port);", "    HT_EALLOW(port->io);\n"
        "    HT_WR16(port->io, 0x7029u, 0x68u);\n    HT_EDIS(port->io);", "-SYS.WDCR"),
    "no EALLOW for the pins": (
        F28377S, "ht_pins.c", "    HT_EALLOW(port->io);\n    for (n = 0u; n < (2u * "
        "(uint16_t)HT_LEGS); n++) {\n        const", "    for (n = 0u; n < (2u * "
        "(uint16_t)HT_LEGS); n++) {\n        const", "GPADIR: no EALLOW"),
    "no EALLOW for the watchdog": (
        F28335, "ht_watchdog.c",
        "    HT_EALLOW(port->io);\n    HT_WR16(port->io, WDKEY, KEY_FIRST);\n    HT_EDIS",
        "    HT_WR16(port->io, WDKEY, KEY_FIRST);\n    HT_EDIS", "WDKEY: no EALLOW"),
    "pins not released": (
        LAUNCHPAD, CHIP, "    ht_pins_release(port);", "    (void)port;", "PWM is not an input"),
    "pins released as outputs": (
        F28335, "ht_pins.c", "        ht_change32(port->io, first + GPYDIR, bit, 0u);\n", "",
        "PWM is not an input"),
    "pins to the PWM": (
        F28335, CHIP, "        ht_pins_start(port);", "        ht_pins_pwm(port);",
        "not tripped"),
    "another rate": (
        F28335, CHIP, "ht_sci_start(port, HT_PIL_BAUD)", "ht_sci_start(port, 115200u)",
        "no reply in time"),
    "divider off by one": (
        F28377S, "ht_sci.c", "    counts -= 1u;\n", "", "no reply in time"),
    "low-speed clock halved": (
        F28335, "ht_clock_f28335.c", "#define LOSPCP_2 0x0001u", "#define LOSPCP_2 0x0002u",
        "no reply in time"),
    "transmit FIFO not looked at": (
        F28335, "ht_sci.c", "uint16_t room = (uint16_t)(FIFO_DEPTH - level(port, SCIFFTX));",
        "uint16_t room = FIFO_DEPTH;", "transmit FIFO is full"),
    "bytes lost on the way out": (
        F28377S, CHIP, "if (ht_sci_write(&chip, &octet, 1u) == 1u)",
        "if (ht_sci_write(&chip, &octet, 1u) <= 1u)", "did not arrive whole"),
    "last byte kept back": (
        F28335, SERVER, "    bool waiting = line.out.sent < line.out.n;",
        "    bool waiting = (line.out.sent + 1u) < line.out.n;", "no reply in time"),
    "receiver stays where an error stopped it": (
        F28377S, "ht_sci.c", "        HT_WR16(port->io, sci + SCICTL1, SCICTL1_RESET);\n", "",
        "no reply in time"),
    "clock did not start": (
        F28377S, "ht_clock_f28377s.c", "#define LOOKS 60000u", "#define LOOKS 1u",
        "no reply in time"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_found(builder, quick, fault):
    name, source, old, new, said = FAULTS[fault]
    program = builder.build(name, (source, old, new), pil=True)
    found = []
    with powered(program) as it:
        try:
            with target_of(it, timeout_s=0.5) as target:
                found += pil.compare(quick, SHORT, target).failures()
            disturb(it, signal.SIGUSR2)
            with target_of(it, timeout_s=0.5) as target:
                found += pil.compare(quick, SHORT, target).failures()
        except TargetError as error:
            found.append(str(error))
        with contextlib.suppress(subprocess.TimeoutExpired):
            it.process.wait(0.5)
        if it.process.poll() is not None:
            found.append(it.said())
    done = subprocess.run([program, "registers"], capture_output=True, text=True, timeout=WAIT_S)
    found.append(done.stderr)
    if done.returncode == 0:
        found += image_difference(name, done.stdout.splitlines())
    assert any(said in line for line in found), "\n".join(found) or "nothing found"
