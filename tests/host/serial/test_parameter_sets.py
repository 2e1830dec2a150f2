"""Whole sets of parameters on a virtual board: all or none, and what differs."""

import json

import numpy as np
import pytest
from board_process import CHANGES
from rich.console import Console

from hexatorque import firmware, setups
from hexatorque.cli import parameter_sets as commands
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.drive.parameter_sets import (
    NotTaken,
    ParameterSetError,
    defaults,
    difference,
    write_all,
)
from hexatorque.serial import LinkError

PAPER_B = setups.load("paper-b").changed(timing__device="f28377s")


@pytest.fixture
def drive(board):
    """With the parameters as they were, in the end."""
    with BoardDrive.open(board) as drive:
        before = drive.get_all()
        yield drive
        drive.stop()
        write_all(drive, before)


def same(a, b):
    return a == b if isinstance(a, str) else np.float32(a) == np.float32(b)


def test_a_set_up_comes_onto_a_board(drive):
    wanted = setups.parameters(PAPER_B)
    before = drive.get_all()
    changed = write_all(drive, wanted)
    there = drive.get_all()
    assert set(there) == set(wanted)
    assert all(same(there[name], wanted[name]) for name in wanted)
    assert set(changed) == {name for name in wanted if not same(before[name], wanted[name])}
    assert write_all(drive, wanted) == {}


def test_no_set_in_between_is_in_force(drive):
    """One after the other would be refused: a limit goes beyond the sensor's old range before the
    range follows. Both ways round, from the small drive to the large one and back."""
    large = {"vdc_full_V": 1000.0, "vdc_max_V": 900.0, "i_full_A": 300.0, "i_trip_A": 250.0}
    small = drive.get_many(list(large))
    for name in ("vdc_max_V", "i_trip_A"):
        with pytest.raises(LinkError, match="do not fit together"):
            drive.set(name, large[name])
    write_all(drive, large)
    assert drive.get_many(list(large)) == large
    with pytest.raises(LinkError, match="do not fit together"):
        drive.set("i_full_A", small["i_full_A"])
    write_all(drive, small)
    assert drive.get_many(list(large)) == small


def test_all_that_a_board_does_not_allow_is_named_and_nothing_written(drive):
    before = drive.get_all()
    wrong = {**setups.parameters(PAPER_B), "dead_time_us": 0.5, "scheme": "ddt", "kappa_x": 1.0}
    with pytest.raises(ParameterSetError) as error:
        write_all(drive, wrong)
    lines = str(error.value).splitlines()
    assert sorted(line.split(":")[0] for line in lines) == [
        "dead_time_us = 0.5",
        "no parameter 'kappa_x' on this board; did you mean 'kappa'?",
        "scheme = 'ddt'",
    ]
    assert "1 .. 20 us" in str(error.value) and error.value.exit_code == 2
    assert drive.get_all() == before


def test_a_set_that_does_not_fit_together_changes_nothing(drive):
    before = drive.get_all()
    with pytest.raises(LinkError, match="do not fit together"):
        write_all(drive, {**setups.parameters(PAPER_B), "flux_min_Wb": 99.0})
    assert drive.get_all() == before


def test_while_the_drive_runs_only_what_may_change(drive):
    drive.start()
    before = drive.get_all()
    with pytest.raises(LinkError, match="gates are off"):
        write_all(drive, setups.parameters(PAPER_B))
    assert drive.get_all() == before
    assert write_all(drive, {**before, "torque_band_Nm": 0.7}) == {"torque_band_Nm": 0.7}
    assert drive.get("torque_band_Nm") == np.float32(0.7).astype(str).astype(float)


class Forgetful:
    """A board that says it took a value, and keeps another."""

    params = firmware.parameters("f28377s")

    def __init__(self):
        self.values = defaults(self.params)

    def get_many(self, names):
        return {name: self.values[name] for name in names}

    def set_many(self, values):
        self.values.update(values)
        if values.get("rs_ohm") == 3.0:
            self.values["rs_ohm"] = 2.0


def test_what_reads_back_otherwise_is_taken_back():
    drive = Forgetful()
    with pytest.raises(NotTaken, match=r"rs_ohm differ.*former values are in force"):
        write_all(drive, {"rs_ohm": 3.0, "rr_ohm": 3.5})
    assert drive.values == defaults(drive.params)


def test_difference_is_by_what_a_board_keeps():
    rows = firmware.parameters()
    third = float(np.float32(1 / 3))
    assert difference({"rs_ohm": 1 / 3}, {"rs_ohm": third}, rows) == {}
    assert difference({"zero_hold": True}, {"zero_hold": "on"}, rows) == {}
    assert (
        difference({"zero_hold": "ON", "rs_ohm": "1,5"}, {"zero_hold": "on", "rs_ohm": 1.5}, rows)
        == {}
    )
    first = {"scheme": "ddr", "rs_ohm": 1.0, "old": 3.0, "lm_H": 0.1}
    second = {"scheme": "fdr", "rs_ohm": 2.0, "rr_ohm": 1.0, "lm_H": 0.1}
    assert difference(first, second, rows) == {
        "scheme": ("ddr", "fdr"),
        "rs_ohm": (1.0, 2.0),
        "rr_ohm": (None, 1.0),
        "old": (3.0, None),
    }


# -- commands ------------------------------------------------------------------------------


@pytest.fixture
def console():
    return Console(width=1000, record=True, quiet=False)


def test_command_loads_a_set_up_and_names_what_stays_behind(drive, console, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'setup = "paper-b"\n[machine]\nrs_ohm = 5.5\n[timing]\ndevice = "f28377s"\n'
        'latency = "none"\n[load]\nkind = "fan"\n[profile]\nspeed_rpm = 100\n'
    )
    assert commands.load(console, drive, str(file)) == 0
    said = console.export_text()
    assert "mine: " in said and "rs_ohm  5.5 ohm" in said
    plant = next(line for line in said.splitlines() if line.startswith("not for a board"))
    for path in ("machine.inertia_kgm2", "inverter.vdc_V", "load.kind", "profile"):
        assert path in plant
    assert "machine.rs_ohm" not in plant
    assert "latency = none" in said
    assert drive.get("rs_ohm") == 5.5
    assert commands.diff(console, drive, str(file)) == 0
    assert "no parameter differs" in console.export_text()


def test_command_says_that_a_set_up_is_for_another_device(drive, console):
    assert commands.load(console, drive, "paper-a") == 0
    assert "timing.device = f28335: this board is a virtual f28377s" in console.export_text()


def test_command_loads_a_saved_file(drive, console, tmp_path, capsys):
    file = tmp_path / "bench.toml"
    file.write_text('[parameters]\nscheme = "fdr"\nrs_ohm = 2.5\n')
    assert commands.load(console, drive, str(file), as_json=True) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["changed"] == {"scheme": "fdr", "rs_ohm": 2.5} and data["parameters"] == 2
    file.write_text("[parameters]\nrs_ohm = 2.5\n[more]\n")
    with pytest.raises(ParameterSetError, match="one table"):
        commands.load(console, drive, str(file))
    file.write_text("[parameters\n")
    with pytest.raises(ParameterSetError, match=r"bench\.toml"):
        commands.load(console, drive, str(file))
    with pytest.raises(ParameterSetError, match=r"none\.toml: No such file"):
        commands.load(console, drive, str(tmp_path / "none.toml"))


def test_command_tells_sets_apart(drive, console, capsys):
    write_all(drive, {"rs_ohm": 2.25})
    assert commands.diff(console, drive, "defaults", as_json=True) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["rs_ohm"] == [1.8, 2.25]
    assert found["build_s"] == [0.3, CHANGES["controller__build_s"]]
    assert commands.diff(console, drive, "board", "board") == 0
    assert commands.diff(console, drive, "paper-b") == 1
    said = console.export_text()
    assert "rs_ohm" in said and "2.25" in said and "virtual f28377s" in said


def test_command_compares_without_a_board(console, capsys):
    assert commands.diff(console, None, "paper-a", "paper-a-feasible", as_json=True) == 1
    assert set(json.loads(capsys.readouterr().out)) == {"field_weakening", "ki_speed_Nm_rad"}
    with pytest.raises(ParameterSetError, match="none to compare with"):
        commands.diff(console, None, "paper-a", "board")


def test_from_the_command_line(drive, capsys):
    """Options and arguments reach the functions above, and their exit codes the shell."""
    port = drive.client.url
    assert main(["board", "params", "load", "--setup", "paper-b", "--device", port]) == 0
    assert "paper-b: " in capsys.readouterr().out
    assert drive.get("rs_ohm") == pytest.approx(setups.load("paper-b").parameter("rs_ohm"))
    assert main(["board", "params", "diff", "paper-b", "--device", port]) == 0
    assert main(["board", "params", "diff", "paper-a", "board", "--json", "--device", port]) == 1
    assert "rs_ohm" in json.loads(capsys.readouterr().out.split("\n", 1)[1])
    for arguments in ([], ["b.toml", "--setup", "paper-b"]):
        assert main(["board", "params", "load", *arguments, "--device", port]) == 2
        assert capsys.readouterr().err.count("\n") == 1
