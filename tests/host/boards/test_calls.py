"""A target that reports its driver's calls instead of registers, as small processors and real
boards do. Here it is a process on this computer, under the sanitizers."""

import subprocess
from pathlib import Path

import pytest

from hexatorque import firmware, setups
from hexatorque.boards import emulator_process, tools
from hexatorque.boards.processor import TargetError
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import pil
from hexatorque.firmware import lib
from hexatorque.setups import Profile

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
FOLDERS = [FIRMWARE / name for name in ("core", "app", "link", "pil", "pil/calls", "port")]
PROFILE = Profile(
    duration_s=0.4, speed_rpm=((0.11, 100.0), (0.25, -200.0)), load_Nm=((0.2, 5.0),),
    set=((0.22, "scheme", "dtc3"), (0.3, "scheme", "ddr")), samples_per_period=1,
)  # fmt: skip


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    image = tmp_path_factory.mktemp("calls") / "calls"
    sources = [file for folder in FOLDERS for file in sorted(folder.glob("*.c"))]
    tools.run(
        [tools.program("cc"), "-O1", "-g", "-ffp-contract=off", "-fno-math-errno",
         "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
         *[f"-I{folder}" for folder in FOLDERS], FIRMWARE.parent / "tests/c/targets/calls_main.c",
         *sources, "-o", image, "-lm"]
    )  # fmt: skip
    return image


@pytest.fixture
def target(program):
    with emulator_process.ProcessTarget("calls", [str(program)], timeout_s=5.0) as target:
        yield target


@pytest.mark.parametrize("latency", ["predicted", "immediate"])
@pytest.mark.parametrize("device", firmware.DEVICES)
def test_equals_the_drive_itself(quick, target, device, latency):
    """Every register and the number of accesses: the host's driver is called as the drive
    would have called it."""
    setup = quick.changed(timing__device=device, timing__latency=latency)
    outcome = pil.compare(setup, PROFILE, target)
    assert outcome.failures() == []
    assert (outcome.steps, outcome.state) == (4000, "run")
    assert target.link.calls == 1


@pytest.mark.parametrize("device", firmware.DEVICES)
def test_thermistors_and_chopper_equal_the_drive_itself(quick, target, device):
    setup = quick.changed(
        {
            "timing.device": device, "sensors.winding_ntc_ohm": 10e3, "sensors.sink_ntc_ohm": 5e3,
            "controller.device_K_W": 1.0, "inverter.link_F": 1e-3, "inverter.chopper_ohm": 30.0,
            "controller.chopper_on_V": 262.0, "controller.chopper_off_V": 258.0,
        }
    )  # fmt: skip
    brakes = Profile(duration_s=0.6, speed_rpm=((0.11, 600.0), (0.3, -600.0)), samples_per_period=1)
    outcome = pil.compare(setup, brakes, target)
    assert outcome.failures() == []
    assert (outcome.steps, outcome.state) == (6000, "run")


@pytest.mark.parametrize("fault", ["flickers", "silent"])
def test_an_absolute_encoder_equals_the_drive_itself(target, fault):
    setup = setups.load("magnet-surface").changed(
        controller__rotor_start="absolute", sensors__absolute_counts_rev=70000,
        sensors__absolute_fault=fault,
    )  # fmt: skip
    turns = Profile(duration_s=1.2, speed_rpm=((1.0, 60.0),), samples_per_period=1)
    outcome = pil.compare(setup, turns, target)
    tripped = fault == "silent"
    assert outcome.difference is None and outcome.steps > 100
    assert outcome.faults == (["absolute encoder"] if tripped else [])
    assert outcome.state == ("fault" if tripped else "run")


def test_commands_trip_and_clear(quick, target):
    sim = SimulatedDrive(quick, 1, target.controller)
    sim.start()
    sim.run(0.105)
    assert sim.controller.state == "run"
    words = sim.controller.register_words()
    flags = 0x6816  # TZFLG of ePWM1
    assert not words[flags] & 4
    sim.stop()
    assert words[flags] & 4
    with pytest.raises(firmware.FirmwareError, match="fit together"):
        sim.set("flux_min_Wb", 90.0)
    sim.controller.set("dead_time_us", 3.0)
    assert words[0x6810] == 450  # DBRED at 150 MHz
    with pytest.raises(firmware.FirmwareError, match=r"allowed range is 1 \.\. 6\.82 us"):
        sim.controller.set("dead_time_us", 19.0)
    sim.start()
    sim.run(0.12)
    words[flags] |= 4
    sim.run(0.001)
    assert sim.controller.faults == ["external trip"]
    sim.clear()
    assert sim.controller.state == "idle"


def test_hardware_that_differs_is_noticed(quick, target):
    """An event comes during the interrupt on the host, but not on the target."""
    sim = SimulatedDrive(quick, 1, target.controller)
    sim.start()
    sim.run(0.11)
    registers = sim.controller.registers
    registers.event_at = registers.accesses + 26
    with pytest.raises(TargetError, match="host and target see different hardware"):
        sim.run(0.001)


def test_refuses_the_other_kind_of_request(quick, target):
    target.controller("f28335", quick.controller_values())
    target.link.calls = 0
    lib.ht_link_request(target.link, lib.HT_OP_PIL_START, 0, 0.0)
    assert target.link.error == lib.HT_LINK_REFUSED


def test_ends_with_its_host(program):
    target = emulator_process.ProcessTarget("calls", [str(program)])
    child = target.process
    target.close()
    assert child.poll() is not None
    assert subprocess.run(["kill", "-0", str(child.pid)], capture_output=True).returncode


def test_a_call_target_is_told_that_the_fast_interrupt_is_lost(quick, target):
    setup = quick.changed(timing__device="f28377s")
    sim = SimulatedDrive(setup, 1, target.controller)
    sim.start()
    sim.run(0.12)
    words = sim.controller.register_words()
    words[0x4093] |= 4  # TZFLG of ePWM1
    words[0x5017] |= 0x40  # ECFLG of eCAP1: the dead man's time has passed
    sim.run(0.001)
    assert sim.controller.faults == [firmware.FAULTS[lib.HT_FAULT_INTERRUPT]]
