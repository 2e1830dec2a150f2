"""A command that waits for the simulation to be compiled says so, and no other command does."""

import importlib.util
import json
from contextlib import contextmanager, nullcontext

import pytest

from hexatorque.cli.main import main
from hexatorque.drive import compiling, hardware, simulated
from hexatorque.plant import loop

SOURCE = """
from numba import njit

@njit(cache=True)
def loop(x):
    return x + 1

@njit
def other(x):
    return x + 2
"""


def load(path):
    """Import the module again, as another process would."""
    spec = importlib.util.spec_from_file_location("compiled_in_a_test", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_numba_reports_compiling_and_not_loading(tmp_path, monkeypatch):
    """The first call compiles. Another call does not, and neither does another process with the
    cache."""
    path = tmp_path / "compiled.py"
    path.write_text(SOURCE)
    reports = []
    for process, wanted in enumerate([["begun", "done"], []]):
        module = load(path)
        monkeypatch.setattr(loop, "run_periods", module.loop)
        with compiling.watched(lambda: reports.append("begun"), lambda: reports.append("done")):
            module.other(1)  # compiled too, but it is not the loop
            assert module.loop(1) == 2
            module.loop(2)
        assert reports == wanted, process
        reports.clear()
        assert module.loop(0.5) == 1.5  # compiled outside the watch, so there is no report
        assert reports == []


def test_a_script_that_compiles_is_told_so_once(tmp_path, monkeypatch, capsys):
    """If somebody watches, he tells the user himself."""
    path = tmp_path / "compiled.py"
    path.write_text(SOURCE)
    module = load(path)
    monkeypatch.setattr(loop, "run_periods", module.loop)
    with compiling.told():
        module.other(1)
        assert capsys.readouterr().err == ""
        module.loop(1)
        assert capsys.readouterr().err == f"{compiling.COMPILING}\n"
        module.loop(2)
        with compiling.watched(lambda: None, lambda: None):
            module.loop(0.5)
    module.loop(1j)  # compiled outside
    assert capsys.readouterr().err == ""


def test_the_first_simulated_drive_of_a_process_tells_it(monkeypatch):
    told = []
    monkeypatch.setattr(hardware, "told", lambda: told.append(True) or nullcontext())
    simulated.compile_now()
    assert told == [True]


def test_the_simulation_is_what_is_watched():
    """In a process that has already compiled it, there is no report."""
    simulated.compile_now()
    assert loop.run_periods.signatures
    with compiling.watched(pytest.fail, pytest.fail):
        simulated.compile_now()


@pytest.fixture
def cold(monkeypatch):
    """A simulation without a cache."""

    @contextmanager
    def watched(begun, done):
        begun()
        yield
        done()

    monkeypatch.setattr(compiling, "watched", watched)


def test_a_run_says_that_it_compiles(cold, tmp_path, capsys):
    file = tmp_path / "short.toml"
    file.write_text('setup = "paper-b"\n[profile]\nduration_s = 0.01\n')
    assert main(["run", str(file), "-o", str(tmp_path / "x.npz"), "--json"]) == 0
    said = capsys.readouterr()
    assert said.err.split("\n")[0] == compiling.COMPILING
    assert said.err.count("compiling the simulation") == 1
    assert json.loads(said.out)["state"]


@pytest.mark.parametrize(
    "words",
    [
        ["board", "serve", "--baud", "1"],
        ["compare", "--setup", "paper-b", "--schemes", "dtc1", "--speed", "12000", "-o", "x"],
        ["reach", "--setup", "paper-b", "--schemes", "dtc1", "--load", "50"],
    ],
)
def test_other_commands_report_compiling_too(words, cold, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main(words)
    assert capsys.readouterr().err.count(compiling.COMPILING) == 1


def test_no_report_when_the_code_comes_from_the_cache(tmp_path, capsys):
    simulated.compile_now()
    file = tmp_path / "short.toml"
    file.write_text('setup = "paper-b"\n[profile]\nduration_s = 0.01\n')
    assert main(["run", str(file), "-o", str(tmp_path / "x.npz")]) == 0
    assert capsys.readouterr().err == ""
