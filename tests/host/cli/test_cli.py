"""The command as a user types it: results, files, and one clear line for a mistake."""

import inspect
import json
import re
import sys
import types

import numpy as np
import pytest

from hexatorque import firmware, setups
from hexatorque.cli.main import main
from hexatorque.evidence.studies import integration
from hexatorque.recording.formats import SUFFIXES
from hexatorque.recording.journal import Stream
from hexatorque.recording.recording import Recording
from hexatorque.recording.writer import Writer

RUN_KEYS = {
    "setup", "scheme", "latency", "speed_ref_rpm", "load_Nm", "speed_rpm", "torque_Nm",
    "torque_error_Nm", "torque_error_pct", "torque_ripple_Nm", "torque_ripple_td_Nm", "flux_Wb",
    "flux_ripple_Wb", "i1_A", "f1_Hz", "thd_pct", "thd_inf_pct", "h5_pct",
    "h7_pct", "ixy_rms_A", "delta_i_A", "delta_i_spread_A", "f_sw_Hz", "copper_loss_W",
    "conduction_loss_W", "switching_loss_W", "idc_A", "idc_ripple_A", "realtime_factor",
    "input_W", "shaft_W", "loss_W", "efficiency_pct",
}  # fmt: skip


def test_compare_writes_everything(tmp_path, capsys):
    code = main(["compare", "--setup", "paper-b", "--schemes", "dtc3,fdr", "--speed", "1500",
                 "--load", "1", "--json", "-o", str(tmp_path)])  # fmt: skip
    out = capsys.readouterr().out
    assert code == 0
    printed = json.loads(out)
    assert printed == json.loads((tmp_path / "metrics.json").read_text())
    assert [(r["scheme"], r["latency"]) for r in printed["runs"]] == [
        ("dtc3", "none"), ("fdr", "none"), ("fdr", "shadow"), ("fdr", "predicted"),
    ]  # fmt: skip
    for run in printed["runs"]:
        assert set(run) == RUN_KEYS
        assert set(run["thd_pct"]) == {"1kHz", "2kHz", "5kHz", "h50"}
        assert run["speed_rpm"] == pytest.approx(1500, rel=0.01)
    assert "paper-b" in printed["paper"]
    report = (tmp_path / "report.html").read_text()
    text = re.sub(r"data:image/png;base64,[A-Za-z0-9+/=]+", "", report)
    assert "http" not in text  # opens without a server
    assert "shadow / predicted" in report
    assert len(list(tmp_path.glob("*.png"))) == 3
    recording = Recording.load(tmp_path / "recordings" / "paper-b-dtc3-none.npz")
    assert recording.meta["scheme"] == "dtc3"


def test_compare_reports_a_point_out_of_reach(tmp_path, capsys):
    code = main(["compare", "--setup", "paper-b", "--schemes", "ddr-ml", "--speed", "12000",
                 "--load", "2", "-o", str(tmp_path)])  # fmt: skip
    assert code == 1
    assert "failed" in capsys.readouterr().out
    assert json.loads((tmp_path / "metrics.json").read_text())["runs"] == []
    assert "ddr-ml" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("suffix", list(SUFFIXES))
def test_run_writes_a_recording(tmp_path, suffix, capsys):
    if library := SUFFIXES[suffix]:
        pytest.importorskip(library, reason=f"{suffix} needs {library}")
    file = tmp_path / "short.toml"
    file.write_text(
        'setup = "paper-b"\n[controller]\nscheme = "fdr"\n'
        "[profile]\nduration_s = 0.6\nspeed_rpm = [[0.4, 300]]\nsamples_per_period = 1\n"
    )
    output = tmp_path / f"rec{suffix}"
    assert main(["run", str(file), "-o", str(output), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["state"] == "run"
    recording = Recording.load(output)
    assert len(recording) == 6000
    assert recording.units["torque_Nm"] == "N m"
    assert recording["plant.speed_rpm"][-1] > 100


def test_run_says_that_the_profile_ends_before_the_drive_gives_torque(tmp_path, capsys):
    """Magnets are aligned for a second and more, as long as the profile of a plain set-up."""
    output = str(tmp_path / "short.npz")
    assert main(["run", "magnet-surface", "--set", "profile.duration_s=0.2", "-o", output]) == 0
    assert "the profile ends in state build" in capsys.readouterr().out
    assert main(["run", "paper-b", "--set", "profile.duration_s=0.6", "-o", output]) == 0
    assert "the profile ends" not in capsys.readouterr().out


def test_run_says_why_a_drive_tripped(tmp_path, capsys):
    file = tmp_path / "dip.toml"
    file.write_text('setup = "paper-b"\n[profile]\nduration_s = 0.5\nvdc_V = [[0.45, 60]]\n')
    assert main(["run", str(file), "-o", str(tmp_path / "dip.npz")]) == 1
    assert "dc-link voltage too low" in capsys.readouterr().err
    assert (tmp_path / "dip.npz").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["compare", "--setup", "paper-c"], ("paper-c", "paper-b")),
        (["compare", "--schemes", "dtc9"], ("dtc9", "ddr-ml")),
        (
            ["compare", "--setup", "paper-b", "--set", "timing.latency=soon"],
            ("timing.latency", "predicted"),
        ),
        (["compare", "--setup", "paper-b", "--load", "99"], ("99", "allowed range")),
        (["compare", "--setup", "paper-b", "--speed", "0"], ("--speed",)),
        (["compare", "--setup", "paper-b", "--speed", "nan"], ("point.speed_rpm", "allowed range")),
        (["compare", "--setup", "paper-b", "--speed", "1e9"], ("point.speed_rpm", "r/min")),
        (["compare", "--setup", "paper-b", "--load", "inf"], ("point.load_Nm", "allowed range")),
        (["compare", "--schemes", ","], ("no scheme ''", "dtc1")),
        (["reach", "--load", "nan"], ("point.load_Nm", "allowed range")),
        (["reach", "--schemes", "dtc9"], ("dtc9", "ddr-ml")),
        (["run", "nowhere.toml"], ("nowhere.toml", "No such file")),
        (["run", "paper-b", "-o", "x.xls"], ("x.xls", ".csv, .npz,", ".parquet")),
        (["evidence", "pil", "paper-b", "-o", "x.xls"], ("x.xls", ".csv, .npz,", ".parquet")),
        (["plot", "nowhere.npz"], ("nowhere.npz", "No such file")),
        (["plot", "nowhere.npz.part"], ("nowhere.npz.part", "No such file")),
        (["plot", "x.xls"], ("x.xls", "unknown suffix")),
        (["plot", "x.npz", "-o", "x.pdf"], ("x.pdf", ".png")),
        (["plot", "x.npz", "--align", "end"], ("--align end", "trigger, start, none")),
        (["plot", "x.npz", "--window", "1"], ("--window 1", "two times")),
        (["plot", "x.npz", "--window", "2,1"], ("--window 2,1", "ascend")),
        (["plot", "x.npz", "--window", "0,nan"], ("--window", "two times")),
        (["plot", "x.npz@soon"], ("x.npz@soon", "trigger")),
        (["convert", "x.npz", "x.xls"], ("x.xls", "unknown suffix")),
        (["convert", "x.npz", "y.npz"], ("x.npz", "No such file")),
        (["setups", "paper-c"], ("paper-c",)),
        (["evidence", "studies", "low-sped"], ("low-sped", "low-speed")),
        (["evidence", "studies", "all", "nothing"], ("'nothing'", "low-speed")),
        (
            ["evidence", "speed", "--counter", "/no/such/program"],
            ("/no/such/program", "make bench"),
        ),
    ],
)
def test_mistakes_end_in_one_line(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.startswith("hexatorque: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize("command", [["run"], ["evidence", "pil"]])
@pytest.mark.parametrize("output", ["file/x.npz", "folder.npz", "x.mf4"])
def test_an_output_is_refused_before_the_run(command, output, tmp_path, capsys, monkeypatch):
    def never(*_):
        raise AssertionError("it ran")

    monkeypatch.setattr("hexatorque.drive.simulated.SimulatedDrive", never)
    monkeypatch.setattr("hexatorque.evidence.studies.pil.compare", never)
    monkeypatch.setitem(sys.modules, "asammdf", None)
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.npz").mkdir()
    scenario_file = tmp_path / "short.toml"
    scenario_file.write_text('setup = "paper-b"\n[profile]\nduration_s = 0.6\n')
    assert main([*command, str(scenario_file), "-o", str(tmp_path / output)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and err.startswith("hexatorque: ")


def recorded(path, **meta):
    t = np.arange(1000) / 1e3
    return Recording(1e3, {"torque_Nm": np.sin(20 * t)}, {"torque_Nm": "N m"}, meta).save(path)


def test_plot_compares_recordings_of_two_kinds(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded("a.npz", trigger_s=0.3)
    recorded("b.csv")
    arguments = ["plot", "a.npz", "b.csv@0.3", "--window", "-0.1,0.2", "--json"]
    assert main(arguments) == 0
    printed, messages = capsys.readouterr()
    result = json.loads(printed)
    assert result["align"] == "trigger" and result["picture"] == "out/plot.png"
    assert result["channels"]["torque_Nm"]["rms_difference"] == [None, pytest.approx(0, abs=1e-9)]
    assert result["channels"]["torque_Nm"]["samples_compared"] == [0, 300]
    assert (tmp_path / "out" / "plot.png").read_bytes()[:4] == b"\x89PNG"
    assert "rms difference from a.npz" in messages


@pytest.mark.parametrize(
    "wrong",
    [
        ["b.csv", "--channels", "speed_rpm"],
        ["b.csv", "--window", "5,6"],
        ["b.csv", "--align", "trigger"],
        ["a.npz", "-o", "a.npz/x.png"],
    ],
)
def test_a_mistake_in_plot_is_one_line(tmp_path, capsys, monkeypatch, wrong):
    monkeypatch.chdir(tmp_path)
    recorded("a.npz", trigger_s=0.3)
    recorded("b.csv")
    assert main(["plot", *wrong]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_an_unclosed_journal_is_drawn_and_converted(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    writer = Writer.open("x.npz", Stream((("torque_Nm", "N m"),), 1e3))
    writer.append(np.arange(50), np.ones((50, 1)))
    writer._file.close()  # as a killed process leaves it
    assert main(["plot", "x.npz.part", "-o", "x.png", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0]["closed"] is False
    assert main(["convert", "x.npz.part", "new/x.csv"]) == 0
    assert "50 samples of 1 channel\n" in capsys.readouterr().out
    assert len(Recording.load("new/x.csv")) == 50


def test_an_output_folder_that_cannot_be_made_is_reported(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    arguments = ["compare", "--setup", "paper-b", "--schemes", "dtc1", "-o", str(tmp_path / "file")]
    assert main(arguments) == 2
    assert "file" in capsys.readouterr().err


def test_studies_refuse_its_output_folder_before_it_runs(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["evidence", "studies", "all", "-o", str(tmp_path / "file")]) == 2
    err = capsys.readouterr().err
    assert err.startswith("hexatorque: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(("found", "code"), [([], 0), (["gates on [in] fault"], 1)])
def test_studies_report_violated_limits(found, code, tmp_path, capsys, monkeypatch):
    def plot(result, path):
        path.write_text("")
        return path

    study = types.SimpleNamespace(
        study=lambda quick, progress, folder=None: {"quick": quick},
        TITLE="Faults",
        NOTE="what a cell is",
        grid=lambda result: [("a table", ["fault", "`runs`"], [["stall", "`12`"]])],
        failures=lambda result: found,
        plot=plot,
    )
    monkeypatch.setitem(sys.modules, "hexatorque.evidence.studies.faults", study)
    arguments = [
        "evidence",
        "studies",
        "faults",
        "faults",
        "--quick",
        "--json",
        "-o",
        str(tmp_path / "new"),
    ]
    assert main(arguments) == code
    out = capsys.readouterr()
    assert json.loads(out.out) == {"faults": {"quick": True}}
    assert json.loads((tmp_path / "new" / "faults.json").read_text()) == {"quick": True}
    assert (tmp_path / "new" / "faults.png").exists()
    for line in ("Faults\nwhat a cell is\n", "a table", "runs", "stall", *found):
        assert line in out.err
    assert "`" not in out.err


def test_setups_lists_every_value_with_its_tag(capsys):
    assert main(["setups", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert list(listed) == setups.builtin_names()
    rows = listed["paper-b"]
    assert rows["machine"]["rs_ohm"] == {
        "value": 6.0, "unit": "ohm", "tag": "paper", "note": "Table V",
    }  # fmt: skip
    assert set(rows["controller"]) == set(firmware.parameters())
    assert rows["controller"]["sigma_ls_H"]["tag"] == "derived"
    assert main(["setups", "paper-a"]) == 0
    shown = capsys.readouterr().out
    assert "Table III" in shown and "[heat]" in shown


def test_schemes_lists_source_and_options(capsys):
    assert main(["setups", "--schemes", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert tuple(listed["schemes"]) == firmware.schemes()
    assert "controller.table" in listed["options"]
    assert "virtual vectors" in listed["references"]["vv-mpc"]
    assert main(["setups", "--schemes"]) == 0
    assert "ddr-ml" in capsys.readouterr().out


def test_reach_of_a_scheme_is_within_its_bounds(capsys):
    arguments = ["reach", "--setup", "paper-b", "--schemes", "dtc1", "--load", "2", "--json"]
    assert main(arguments) == 0
    speed = json.loads(capsys.readouterr().out)["reachable_rpm"]["dtc1"]
    # 12-step operation would end at 2 Vdc/pi / psi. The circle inside the large vectors, minus the
    # resistive drop, is below.
    assert 3500 < speed < 300 * 0.6366 / 0.4 * 9.5493


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("setup = 5\n", ("setup", "text")),
        ('setup = "loop.toml"\n', ("refer to each other",)),
        ('setup = "a\\u0000b.toml"\n', ("not a text file",)),
        ('setup = "paper-b"\n[profile]\nset = 5\n', ("profile.set",)),
        ('setup = "paper-b"\n[profile]\nsamples_per_period = 4.0\n', ("samples_per_period",)),
        ('setup = "paper-b"\n[machine]\nrs_ohm = 1' + "0" * 400 + "\n", ("machine.rs_ohm",)),
        (
            'setup = "paper-a"\n[controller]\nf_isr_Hz = 30000\n[sensors]\nsample_delay_us = 40\n',
            ("sample_delay_us", "period"),
        ),
        (
            'setup = "paper-b"\n[controller]\nf_slow_Hz = 300\n',
            ("loop.toml: controller.f_isr_Hz = ", "a whole number"),
        ),
    ],
)
def test_files_that_cannot_be_used_are_refused(text, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop.toml").write_text(text)
    assert main(["run", "loop.toml"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    for word in words:
        assert word in err


def test_reach_of_an_impossible_load_is_zero(capsys):
    arguments = ["reach", "--setup", "paper-b", "--schemes", "dtc1", "--load", "50", "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["reachable_rpm"]["dtc1"] == 0


def test_results_that_cannot_be_written_are_reported(tmp_path, capsys):
    (tmp_path / "metrics.json").mkdir()
    arguments = ["compare", "--setup", "paper-b", "--schemes", "dtc1", "-o", str(tmp_path)]
    assert main(arguments) == 2
    assert "metrics.json" in capsys.readouterr().err


def test_an_instruction_counter_that_is_no_program(tmp_path, capsys):
    assert main(["evidence", "speed", "--counter", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_study_writes_its_result_and_picture(tmp_path, capsys, monkeypatch):
    """One operating point, compared with a step that is a quarter as long."""
    monkeypatch.setattr(integration, "SETUPS", ("paper-b",))
    monkeypatch.setattr(integration, "STEPS_US", (100.0, 50.0))
    monkeypatch.setattr(integration, "FINEST_US", 25.0)
    studies = ["evidence", "studies", "integration", "--quick", "--json", "-o", str(tmp_path)]
    assert main(studies) == 0
    printed, table = capsys.readouterr()
    result = json.loads(printed)["integration"]
    assert result == json.loads((tmp_path / "integration.json").read_text())
    (point,) = result["points"]
    assert point["setup"] == "paper-b" and 0 < point["error"][1] < point["error"][0]
    assert result["step_us"] == [100, 50] and result["limit"] == 1e-6
    picture = tmp_path / "integration.png"
    assert "100 us" in table and str(picture) in table.replace("\n", "")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_every_study_has_what_the_command_needs():
    from importlib import import_module

    from hexatorque.evidence.studies import KEEPING, STUDIES

    for name, file in STUDIES.items():
        module = import_module(f".{file}", "hexatorque.evidence.studies")
        assert module.TITLE and module.study and module.grid and module.plot
        keeps = "folder" in inspect.signature(module.study).parameters
        assert keeps == (name in KEEPING)
