"""The package on Windows, under wine: `make test-windows`."""

import json
import os
import re
import subprocess
from contextlib import contextmanager
from pathlib import Path
from urllib.request import HTTPCookieProcessor, build_opener

import numpy as np
import pytest
import windows
from fmu_masters import COURSES, Plant, command

from hexatorque import firmware, setups
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.fmu import controller
from hexatorque.plant.loop import PLANT_CHANNELS

if "HT_WINDOWS" not in os.environ:
    pytest.skip("make test-windows runs this", allow_module_level=True)

EXAMPLES = windows.ROOT / "examples"
#: No test needs as long. The first start compiles the simulation, and the computer may be busy.
WAIT_S = 1500


PYTHON = ("wine", windows.PYTHON / "python.exe")


def words_of(*words):
    return [*PYTHON, "-m", "hexatorque", *words]


def started(*words):
    """A program of Windows that has ended. Its output is UTF-8."""
    return subprocess.run(
        words, env=windows.environment(), stdin=subprocess.DEVNULL, timeout=WAIT_S,
        capture_output=True, encoding="utf-8",
    )  # fmt: skip


@pytest.fixture
def there(tmp_path, monkeypatch):
    """Run a command on Windows. Returns what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(*words, code=0):
        done = started(*words_of(*words))
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    return run


@contextmanager
def staying(ready, *words):
    """A command that goes on. Gives what `ready`, a pattern, finds in what it prints."""
    process = subprocess.Popen(
        words_of(*words), env=windows.environment(), stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
    )  # fmt: skip
    try:
        said = ""
        for line in process.stdout:
            said += line
            if found := re.search(ready, said):
                break
        else:
            raise AssertionError(said)
        yield found[1]
    finally:
        process.kill()
        process.wait(30)
        process.stdout.close()


@pytest.fixture
def board(there):
    """The name of the port of a virtual board on Windows."""
    with staying(r"(socket://\S+),", "board", "serve", "--tcp", "0", "--load", "1") as port:
        yield port


@pytest.mark.parametrize("setup", ["paper-a", "magnet-interior"])
def test_a_recording_has_the_same_bits(there, tmp_path, setup):
    text = (EXAMPLES / "reversal.toml").read_text().replace("paper-a-feasible", setup)
    (tmp_path / "own.toml").write_text(text)
    there("run", "own.toml", "-o", "there.npz")
    assert main(["run", "own.toml", "-o", "here.npz"]) == 0
    with np.load("here.npz") as here, np.load("there.npz") as other:
        assert sorted(here) == sorted(other) and len(list(here)) > 20
        for name in here:
            if here[name].dtype.kind == "f":
                assert other[name].tobytes() == here[name].tobytes(), name


def test_a_machine_of_ones_own(there):
    plate = (
        "power_kW=5.5,voltage_V=400,current_A=5.9,power_factor=0.8,frequency_Hz=50,speed_rpm=1450"
    )
    there("new", "mine.toml", "--nameplate", f"{plate},poles=4")
    assert "ready: " in there("check", "mine.toml")


def test_a_picture(there, tmp_path):
    there("run", str(EXAMPLES / "reversal.toml"), "-o", "there.npz")
    there("plot", "there.npz", "-o", "there.png")
    assert (tmp_path / "there.png").read_bytes().startswith(b"\x89PNG")


def test_a_sweep_with_two_processes(there, tmp_path):
    there("sweep", "--grid", "machine.rs_ohm=1:1.4:3", "--jobs", "2", "-o", "swept")
    assert len((tmp_path / "swept" / "table.csv").read_text().splitlines()) == 4


def test_parameters_are_tuned(there, tmp_path):
    there("tune", "paper-a-feasible", "--trials", "2", "-o", "tuned")
    assert (tmp_path / "tuned" / "report.html").exists()


def test_a_client_here_drives_a_board_there(board):
    with BoardDrive.open(board) as drive:
        drive.set("speed_ref_rpm", 300)
        drive.start()
        drive.run(2.0)
        assert np.mean(drive.take()["speed_rpm"][-100:]) == pytest.approx(300, abs=5)
        drive.stop()


def test_a_client_there_drives_it(there, board, tmp_path):
    assert "paper-a-feasible" in there("board", "list")
    there("board", "params", "save", "set.toml")
    there(
        "board", "stream", "i_u1_A", "speed_rpm", "--duration", "0.5", "--start", "-o", "bench.npz"
    )
    assert (tmp_path / "bench.npz").exists()


def test_a_board_there_is_commissioned(there, board):
    assert "wiring" in there("board", "commission", "--steps", "wiring")


def test_the_page(there, board):
    with (
        staying(r"(http://\S+)", "board", "monitor", "--no-browser") as page,
        build_opener(HTTPCookieProcessor()).open(page, timeout=30) as answer,
    ):
        assert "hexatorque" in answer.read().decode()


def controller_course(setup):
    """What the controller FMU gets in each period beside the simulation's plant, and the channels
    of the simulation's controller."""
    plant, inputs, rows = Plant(setup), [], []
    for k in range(2700):
        given = COURSES["controller"].get(k, {})
        command(plant.sim, given)
        plant.step()
        inputs.append(plant.inputs | given)
        rows.append(plant.channels)
    return inputs, {f"channel.{n}": c for (n, _), c in zip(firmware.channels(), zip(*rows))}


def drive_course(setup):
    """The same of the drive FMU, with the plant's true values. Those of a period's beginning are
    in the row of the period before: an FMU's are those at its end."""
    sim, inputs, rows, plant = SimulatedDrive(setup, 1), [], [], []
    for k in range(2500):
        inputs.append(COURSES["drive"].get(k, {}))
        command(sim, inputs[-1])
        true, channels = sim.rows(1)
        plant.append(true[0].copy())
        rows.append(channels[0].copy())
    true, _ = sim.rows(1)
    plant.append(true[0].copy())
    names = [f"channel.{n}" for n, _ in firmware.channels()]
    expected = dict(zip(names, np.transpose(rows)))
    return inputs, expected | {
        f"plant.{name}": column[1:] for (name, _), column in zip(PLANT_CHANNELS, zip(*plant))
    }


@pytest.mark.parametrize("version", (2, 3))
@pytest.mark.parametrize("of, course", (("controller", controller_course), ("drive", drive_course)))
def test_an_fmu_has_the_bits_of_the_simulation(tmp_path, monkeypatch, of, course, version):
    """FMPy finds no mistake in it and runs it there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(controller, "HERE", "x86_64-windows-gnu")
    setup = setups.load("paper-b").changed(
        {"controller.scheme": "db-dtfc", "timing.latency": "predicted"}
        | {"controller.calibration_s": 0.01, "controller.build_s": 0.1}
    )
    controller.write(Path("there.fmu"), setup, of, version, only_here=True)
    inputs, expected = course(setup)
    Path("inputs.json").write_text(json.dumps(inputs))
    script = Path(__file__).with_name("fmu_there.py")
    done = started(*PYTHON, script, "there.fmu", "inputs.json", "outputs.npz")
    assert done.returncode == 0, done.stdout + done.stderr
    with np.load("outputs.npz") as found:
        assert {*found["state"]} >= {0, 1, 2, 3}  # it has run
        for name, values in expected.items():
            here = np.array(values, found[name].dtype)
            assert here.tobytes() == found[name].tobytes(), name
