"""The firmware on emulated processors: the same bits, and no emulator left behind."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import shorted_machine
from campaigns import WHOLE, part
from waiting import alive

import hexatorque
from hexatorque import firmware, setups
from hexatorque.boards import emulator_process, tools
from hexatorque.boards.processor import TargetError
from hexatorque.cli.main import main
from hexatorque.commissioning import wiring
from hexatorque.commissioning.excitation import Excitation, Limits
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import pil
from hexatorque.setups import Profile

SHORT = Profile(duration_s=0.2, speed_rpm=((0.11, 100.0),), samples_per_period=1)


def gone(pid: int, within_s: float = 60.0) -> bool:
    until = time.monotonic() + within_s
    while alive(pid) and time.monotonic() < until:
        time.sleep(0.02)
    return not alive(pid)


#: One scheme of each of the other laws is never left out.
OTHER_LAWS = ["db-dtfc", "foc-24", "db-ipwm"]


@pytest.mark.parametrize("scheme", [*OTHER_LAWS, *part(firmware.table_schemes(), 2)])
def test_every_scheme_bit_by_bit(paper_a, scheme, need):
    """Two seconds of start, steps of speed and load, schemes changed in flight, reversal."""
    need("mps2-an386")
    setup = paper_a.changed(controller__scheme=scheme)
    with emulator_process.emulator("mps2-an386") as target:
        outcome = pil.compare(setup, pil.transients(setup), target)
    assert outcome.failures() == []
    assert (outcome.steps, outcome.state) == (20000, "run")
    assert outcome.recording.meta["processor"] == "mps2-an386"


#: Those on the Cortex-M7 are for whole campaigns: its images take half a minute to build.
OTHERS = (
    ("mps2-an500", "f28335", "predicted"), ("mps2-an500", "f28377s", "immediate"),
    ("mps2-an386", "f28377s", "predicted"), ("mps2-an386", "f28335", "immediate"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("machine", "device", "latency"),
    OTHERS if WHOLE else [case for case in OTHERS if case[0] == "mps2-an386"],
)
def test_other_machines_devices_and_load_modes(quick, machine, device, latency, need):
    need(machine)
    setup = quick.changed(controller__scheme="dtc3", timing__device=device, timing__latency=latency)
    with emulator_process.emulator(machine) as target:
        outcome = pil.compare(setup, pil.transients(setup), target)
    assert outcome.failures() == []


def test_one_bit_of_a_parameter_shows(quick, m4f):
    """The same comparison, but the target's stator resistance is the next float32."""

    def controller(device, values):
        return m4f.controller(device, {**values, "rs_ohm": values["rs_ohm"] * (1 + 1.2e-7)})

    class Off:
        name = m4f.name

        def __init__(self):
            self.controller = controller

    outcome = pil.compare(quick, SHORT, Off())
    assert outcome.difference is not None


def test_all_bits_of_16_bit_int(quick, need):
    """2500 closed-loop steps on the ATmega2560, through all schemes."""
    need("atmega2560")
    changes = tuple((0.12 + 0.014 * n, "scheme", s) for n, s in enumerate(firmware.schemes()))
    profile = Profile(
        duration_s=0.25, speed_rpm=((0.11, 100.0),), load_Nm=((0.15, 5.0),), set=changes,
        samples_per_period=1,
    )  # fmt: skip
    with emulator_process.emulator("atmega2560") as target:
        outcome = pil.compare(quick, profile, target)
    assert outcome.failures() == []
    assert changes[-1][0] < profile.duration_s
    assert (outcome.steps, outcome.state) == (2500, "run")


def test_magnets_with_16_bit_int(need):
    """3400 closed-loop steps on the ATmega2560 through a law of each kind. The encoder tells the
    angle, so no alignment takes a second."""
    need("atmega2560")
    setup = setups.load("magnet-surface").changed(
        sensors__absolute_counts_rev=8192, controller__rotor_start="absolute",
        controller__build_s=0.05, timing__latency="predicted",
    )  # fmt: skip
    changes = (
        (0.15, "scheme", "db-dtfc"), (0.2, "scheme", "foc"), (0.25, "scheme", "db-ipwm"),
        (0.28, "thd_share", 0.5), (0.3, "scheme", "ddr"),
    )  # fmt: skip
    profile = Profile(
        duration_s=0.34, speed_rpm=((0.11, 300.0),), load_Nm=((0.13, 1.0),), set=changes,
        samples_per_period=1,
    )  # fmt: skip
    with emulator_process.emulator("atmega2560") as target:
        outcome = pil.compare(setup.changed(controller__scheme="ddr"), profile, target)
    assert outcome.failures() == []
    assert (outcome.steps, outcome.state) == (3400, "run")


@pytest.mark.parametrize(
    ("name", "scheme"), [("magnet-interior", "foc"), ("magnet-surface", "db-ipwm")]
)
def test_transients_of_magnets_begin_after_their_alignment(m4f, name, scheme):
    setup = setups.load(name).with_scheme(scheme)
    profile = pil.transients(setup)
    assert profile.speed_rpm[0][0] > float(setup.parameter("build_s"))
    outcome = pil.compare(setup, profile, m4f)
    assert outcome.failures() == [] and outcome.state == "run"
    assert abs(outcome.recording["plant.speed_rpm"]).max() > 0.9 * setup["point.speed_rpm"]


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_pulses_with_places_and_sets_that_begin_together_bit_by_bit(m4f, share):
    """At each end of the knob, and by turns; legs are clamped where the sets begin together."""
    setup = setups.load("paper-b").with_scheme(
        "db-ipwm", controller__thd_share=share, controller__clamp="alternating",
        controller__kappa_from_pu=0.3, controller__f_isr_Hz=16e3, timing__latency="predicted",
    )  # fmt: skip
    outcome = pil.compare(setup, pil.transients(setup), m4f)
    assert outcome.failures() == [] and (outcome.steps, outcome.state) == (32000, "run")


def test_the_state_test_bit_by_bit(quick, m4f):
    """Direct voltages, then every wave."""
    changes = [(0.1, "test_x_V", 6.0), (0.11, "test_alpha_V", 4.0), (0.11, "test_Hz", 333.3)]
    waves = firmware.parameters()["test_wave"].choices
    changes += [(0.12 + 0.02 * n, "test_wave", wave) for n, wave in enumerate(waves)]
    profile = Profile(duration_s=0.2, set=tuple(changes), samples_per_period=1)
    outcome = pil.compare(quick.changed(controller__start_mode="test"), profile, m4f)
    assert outcome.failures() == []
    assert outcome.state == "test"
    assert abs(outcome.recording["plant.i_u1_A"]).max() > 0.2


#: The leg breaks, the flux goes down to what the others carry, and another scheme follows.
WITHOUT_A_LEG = Profile(
    duration_s=0.6,
    speed_rpm=((0.11, 300.0),),
    load_Nm=((0.25, 2.0),),
    broken=((0.35, "w1", "open"),),
    set=((0.5, "scheme", "foc"),),
    samples_per_period=1,
)


@pytest.mark.parametrize("scheme", ("ddr", "dtc3", "db-dtfc"))
def test_going_on_without_a_leg_bit_by_bit(quick, m4f, scheme):
    setup = quick.changed(
        controller__scheme=scheme,
        controller__ride_through="least-loss",
        controller__i_rated_A=2.6,
        timing__latency="predicted",
    )
    outcome = pil.compare(setup, WITHOUT_A_LEG, m4f)
    assert outcome.failures() == []
    assert outcome.state == "run"
    assert int(outcome.recording["warnings"][-1]) & 63 == 8


def test_a_short_circuit_of_magnets_bit_by_bit(m4f):
    """A trip above the ceiling, the lower switches, and gates off when the shaft is slow enough."""
    setup = setups.load(shorted_machine.NAME).changed(shorted_machine.CHANGES)
    profile = Profile(
        duration_s=0.4,
        speed_rpm=((0.06, shorted_machine.ABOVE_RPM),),
        set=((0.15, *shorted_machine.TRIPS),),
        samples_per_period=1,
    )
    outcome = pil.compare(setup, profile, m4f)
    assert outcome.difference is None and outcome.state == "fault"
    told = [
        shorted_machine.WARNING in firmware.warnings(int(bits))
        for bits in outcome.recording["warnings"]
    ]
    shorted = np.flatnonzero(told)
    assert 0.15 < outcome.recording.time_s[shorted[0]] < 0.152 and not told[-1]


def test_commissioning_names_the_same_mistake(m4f):
    """Two leads are exchanged. The currents that tell it are the same, bit by bit."""
    setup = setups.load("paper-a-feasible").changed(machine__leads=[3, 2, 1, 4, 5, 6])
    answers = []
    for controller in (firmware.Controller, m4f.controller):
        sim = SimulatedDrive(setup, 1, controller)
        with Excitation(sim, Limits(6.0, 0.1)) as test:
            answers.append(wiring.measure(test))
        assert sim.state == "idle"
    assert (answers[0] == answers[1]).all()
    assert [line.split(":")[0] for line in wiring.decide(answers[1]).mistakes] == ["motor lead"] * 2


# --- what goes wrong ------------------------------------------------------------


def test_close_ends_the_emulator(quick, m4f):
    assert alive(m4f.process.pid)
    m4f.close()
    assert not alive(m4f.process.pid)
    m4f.close()


def test_emulator_that_dies(quick, m4f):
    sim = SimulatedDrive(quick, 1, m4f.controller)
    sim.start()
    sim.run(0.01)
    m4f.process.kill()
    with pytest.raises(TargetError, match=r"mps2-an386: the target has ended \(status -9"):
        sim.run(1.0)


def test_emulator_that_hangs(quick, need):
    need("mps2-an386")
    with emulator_process.emulator("mps2-an386") as target:
        sim = SimulatedDrive(quick, 1, target.controller)
        sim.start()
        os.kill(target.process.pid, signal.SIGSTOP)
        target.link.timeout_ms = 1000  # only now: a busy computer may need more for what runs
        with pytest.raises(TargetError, match=r"no reply in time \(1 s\)"):
            sim.run(1.0)


def test_fault_on_the_target_ends_it(quick, tmp_path, need):
    """An undefined instruction in place of the fast interrupt's first."""
    need("mps2-an386")
    image = tools.build("mps2", "pil") / "firmware/port/mps2/pil"

    def listed(*command):
        return subprocess.run([*command, image], capture_output=True, text=True, check=True).stdout

    (row,) = (
        line
        for line in listed("arm-none-eabi-nm").splitlines()
        if line.endswith(" ht_drive_fast_isr")
    )
    (text,) = (
        line.split() for line in listed("arm-none-eabi-objdump", "-h").splitlines()
        if " .text " in line
    )  # fmt: skip
    place = (int(row.split()[0], 16) & ~1) - int(text[3], 16) + int(text[5], 16)
    damaged = bytearray(image.read_bytes())
    damaged[place : place + 2] = b"\x00\xde"
    (tmp_path / "damaged").write_bytes(damaged)
    with emulator_process.ProcessTarget(
        "m", emulator_process.qemu("mps2-an386", tmp_path / "damaged")
    ) as target:
        sim = SimulatedDrive(quick, 1, target.controller)
        with pytest.raises(TargetError, match=r"the target has ended \(status 70\)"):
            sim.run(0.01)


def test_emulator_that_does_not_start(quick):
    command = [sys.executable, "-c", "import sys; sys.exit('no such board')"]
    said = r"nothing: the target has ended \(status 1: no such board\)"
    with (
        emulator_process.ProcessTarget("nothing", command) as target,
        pytest.raises(TargetError, match=said),
    ):
        target.controller("f28335", quick.controller_values())


def emulator_of(host):
    """The number of the emulator's process among the host's own, or None."""
    with open(f"/proc/{host.pid}/task/{host.pid}/children") as file:
        children = file.read().split()
    for child in children:
        with contextlib.suppress(OSError), open(f"/proc/{child}/cmdline") as words:
            if words.read().startswith(tools.program("qemu-system-arm")):
                return int(child)
    return None


def running_command(tmp_path, *arguments):
    """`hexatorque ...` as a process, and its emulator's process once there is one."""
    command = [sys.executable, "-m", "hexatorque", *arguments]
    package = str(Path(hexatorque.__file__).parents[1])
    host = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": package},
        # A shell's background job, as these tests may be, ignores Ctrl-C.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    while host.poll() is None:  # first it builds the image
        if (emulator := emulator_of(host)) is not None:
            return host, emulator
        time.sleep(0.05)
    raise AssertionError(host.communicate())


LONG = """setup = "paper-a-feasible"
[profile]
duration_s = 1000.0
samples_per_period = 1
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_emulator_is_left_behind(tmp_path, number, need):
    """The emulator ends with the program, in whatever way the program ends."""
    need("mps2-an386")
    (tmp_path / "long.toml").write_text(LONG.replace("1000.0", "20.0"))
    host, emulator = running_command(tmp_path, "evidence", "pil", "long.toml", "-o", "out.npz")
    time.sleep(0.5)
    assert alive(emulator)
    host.send_signal(number)
    _, said = host.communicate(timeout=60)
    assert gone(emulator)
    if number == signal.SIGINT:
        assert host.returncode == 130
        assert said.splitlines()[-1] == "hexatorque: interrupted"  # after its progress


#: Starts a target that opens its pipes only after this program has died.
DIES_FIRST = """
import os, signal, sys
from hexatorque.boards.emulator_process import ProcessTarget
late = \"\"\"
import os, time
while os.getppid() == {host}:
    time.sleep(0.01)
with open("to_target", "rb") as requests, open("from_target", "wb"):
    requests.read()
\"\"\"
target = ProcessTarget("late", [sys.executable, "-c", late.format(host=os.getpid())])
print(target.process.pid, flush=True)
signal.pause()
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_target_that_starts_after_the_programs_death_ends(tmp_path, number):
    host = subprocess.Popen([sys.executable, "-c", DIES_FIRST], stdout=subprocess.PIPE, text=True,
                            env={**os.environ, "TMPDIR": str(tmp_path)})  # fmt: skip
    target = int(host.stdout.readline())
    host.send_signal(number)
    host.communicate()
    try:
        assert gone(target)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(target, signal.SIGKILL)


# --- the command ----------------------------------------------------------------


def test_command(tmp_path, capsys, need):
    need("mps2-an386")
    assert main(["evidence", "pil", "--schemes", "ddr", "--json", "-o", str(tmp_path)]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["scheme"], row["identical"], row["steps"]) == ("ddr", True, 20000)
    assert row["steps_per_s"] > 0
    assert (tmp_path / "recordings/paper-a-feasible-ddr.npz").exists()


def test_command_with_a_scenario(tmp_path, capsys, need):
    need("mps2-an386")
    (tmp_path / "short.toml").write_text(LONG.replace("1000.0", "0.5"))
    output = tmp_path / "out.csv"
    assert main(["evidence", "pil", str(tmp_path / "short.toml"), "-o", str(output)]) == 0
    assert "identical" in capsys.readouterr().out
    assert output.exists()


@pytest.mark.parametrize("command", [["pil"], ["pil", "--machine", "atmega2560"], ["budget"]])
def test_missing_tools(command, capsys, monkeypatch, tmp_path):
    """One line that names the packages."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(tools, "HEADERS", {"libsimavr": "no/such/header.h"})
    monkeypatch.chdir(tmp_path)
    assert main(["evidence", *command]) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    assert "not found: apt-get install" in said
    assert ("gcc-avr" if "atmega2560" in command else "qemu-system-arm") in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--machine", "z80"], "mps2-an386"), (["--schemes", "dtc9"], "dtc1"),
     (["--load", "100"], "torque limit"), (["a.toml", "--speed", "3"], "not with a scenario")],
)  # fmt: skip
def test_bad_options(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["evidence", "pil", *arguments]) == 2
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    assert said in line
