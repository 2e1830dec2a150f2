"""The commands for boards as a user types them, with a virtual board."""

import json
import os
import re
import signal
import time
import tomllib

import click
import numpy as np
import pytest
from forked import Forked
from waiting import until

from hexatorque import firmware
from hexatorque.cli.board.curves import Curves, braille
from hexatorque.cli.main import main
from hexatorque.drive.board import BoardDrive
from hexatorque.recording.recording import Recording


@pytest.fixture
def call(board, capsys):
    """call(...) -> code, what was printed; --device is added."""

    def run(*words: str):
        code = main(["board", *words, "--device", board])
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def background(*words: str) -> Forked:
    return Forked(["-m", "hexatorque", "board", *words], pipes=("stdout", "stderr"))


def line_with(process: Forked, word: str) -> None:
    for line in process.stdout:
        if word in line:
            return
    raise AssertionError(f"no {word!r}: {process.stderr.read()}")


def test_status(call):
    code, out, _ = call("status", "--json")
    status = json.loads(out)
    assert (code, status["state"], status["faults"]) == (0, "idle", [])
    assert status["device"] == "virtual f28377s" and status["session"] is False
    code, out, _ = call("status")
    assert code == 0 and "state  idle" in out


def test_status_names_the_lost_phase_and_the_torque_that_is_left(call, board):
    """A start without u1. The parameter alone would allow more torque."""
    change = {"scheme": "ddr", "lost_legs": 32, "ride_through": "least-loss", "i_rated_A": 2.6}
    with BoardDrive.open(board) as drive:
        assert "phase u1 lost" not in json.loads(call("status", "--json")[1])["warnings"]
        before = drive.get_many(list(change))
        drive.set_many(change)
        drive.start()
        until(lambda: drive.state == "run")
        time.sleep(0.1)
        status = json.loads(call("status", "--json")[1])
        said = call("status")[1]
        streams = [drive.stream(["vdc_V"], rate_Hz=10) for _ in range(drive.hello.streams)]
        busy = json.loads(call("status", "--json")[1])
        for stream in streams:
            stream.close()
        drive.stop()
        drive.set_many(before)
    assert status["warnings"] == ["phase u1 lost"]
    assert 3.0 < status["torque_limit_Nm"] < 4.0
    assert "warnings  phase u1 lost" in said and "torque_limit_Nm  3.3" in said
    assert isinstance(status["speed_rpm"], float) and re.search(
        r"^ *speed_rpm  -?\d+\.\d$", said, re.M
    )
    assert busy["speed_rpm"] is None
    assert (busy["warnings"], busy["torque_limit_Nm"], busy["state"]) == (None, None, "run")


def test_a_phase_lost_during_a_recording_is_told_in_its_end_and_in_the_file(call, board, tmp_path):
    """The drive goes on without it, so state and faults alone would not say so."""
    file = tmp_path / "ride.csv"
    words = ["stream", "i_u1_A", "speed_rpm", "--rate", "500", "-o", str(file)]
    _, out, _ = call(*words, "--duration", "0.2", "--json")
    assert json.loads(out)["warnings"] == Recording.load(file).meta["warnings"]
    change = {"scheme": "ddr", "lost_legs": 32, "ride_through": "least-loss", "i_rated_A": 2.6}
    with BoardDrive.open(board) as drive:
        before = drive.get_many(list(change))
    setting = [word for name, value in change.items() for word in ("--set", f"{name}={value}")]
    try:
        code, said, err = call(*words, "--duration", "1.5", "--start", *setting)
        captured = call("capture", "i_u1_A", "--samples", "100", "-o", str(tmp_path / "c.csv"))[1]
    finally:
        with BoardDrive.open(board) as drive:
            drive.set_many(before)
            drive.start()  # which forgets the warnings
            drive.stop()
    assert code == 0, err
    assert "warnings  phase u1 lost" in said and "warnings  phase u1 lost" in captured
    for name in ("ride.csv", "c.csv"):
        assert Recording.load(tmp_path / name).meta["warnings"] == ["phase u1 lost"]


def test_parameters(call, tmp_path):
    code, out, _ = call("params", "list", "--json")
    rows = json.loads(out)
    assert code == 0 and rows["scheme"]["choices"][0] == "dtc1"
    assert rows["rs_ohm"]["unit"] == "ohm" and rows["rs_ohm"]["max"] == 1000
    # Into a pipe: a line per parameter, however long.
    lines = call("params", "list")[1].splitlines()
    assert sum("│" in line for line in lines) == len(rows)
    (line,) = [line for line in lines if line.startswith("│ rs_ohm ")]
    assert "stator resistance" in line and "0 .. 1000" in line
    code, out, _ = call("set", "rs_ohm=1.75", "scheme=fdr", "--json")
    assert (code, json.loads(out)) == (0, {"rs_ohm": 1.75, "scheme": "fdr"})
    code, out, _ = call("params", "get", "rs_ohm", "scheme", "--json")
    assert json.loads(out) == {"rs_ohm": 1.75, "scheme": "fdr"}
    file = tmp_path / "of" / "board.toml"
    assert call("params", "save", str(file))[0] == 0
    saved = tomllib.loads(file.read_text())["parameters"]
    assert saved["rs_ohm"] == 1.75 and saved["scheme"] == "fdr" and set(saved) == set(rows)
    assert call("set", "rs_ohm=1.8")[0] == 0 and call("set", "scheme=ddr")[0] == 0
    code, out, _ = call("params", "load", str(file), "--json")
    assert (code, json.loads(out)["changed"]) == (0, {"rs_ohm": 1.75, "scheme": "fdr"})
    code, out, _ = call("params", "load", str(file), "--json")
    assert json.loads(out)["changed"] == {}
    assert call("set", "rs_ohm=1.8", "scheme=ddr")[0] == 0


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["params", "get", "nope"], "no parameter 'nope'; known: "),
        (["set", "sped_ref_rpm=1"], "no parameter 'sped_ref_rpm'; did you mean 'speed_ref_rpm'?"),
        (["set", "rs_ohm"], "'rs_ohm': write NAME=VALUE"),
        (["set", "rs_ohm=-1"], "rs_ohm = -1: allowed range is 0 .. 1000 ohm"),
        (["set", "rs_ohm=nan"], "rs_ohm = nan: allowed range is 0 .. 1000 ohm"),
        (["set", "rs_ohm=much"], "rs_ohm = 'much': a number is needed"),
        (["set", "rs_ohm=1.7", "scheme=x"], "scheme = 'x': choose one of dtc1"),
        (["set", "scheme=x"], "scheme = 'x': choose one of dtc1"),
        (["set", "speed=1e9"], "speed_ref_rpm = 1e+09: allowed range is -60000 .. 60000 r/min"),
        (["stream", "nope", "-o", "x.csv"], "no channel 'nope'; known: state, faults"),
        (["stream", "torqe_Nm", "-o", "x.csv"], "no channel 'torqe_Nm'; did you mean 'torque_Nm'?"),
        (["stream", "state", "--rate", "1e6", "-o", "x.csv"], "rate_Hz = 1e+06: allowed range"),
        (["stream", "state", "-o", "x.txt"], "unknown suffix"),
        (["capture", "state", "--trigger", "x", "-o", "x.csv"], "trigger 'x': choose one of"),
        (["capture", "state", "--samples", "99999", "-o", "x.csv"], "allowed range is 1 .. 20480"),
        (["watch", "nope"], "no channel 'nope'"),
    ],
)
def test_mistakes_end_in_one_line(call, words, text, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, err = call(*words)
    assert code == 2 and text in err and err.count("\n") == 1 and "Traceback" not in err
    assert call("params", "get", "rs_ohm", "--json")[1] == '{\n "rs_ohm": 1.8\n}\n'


def test_load_is_all_or_nothing(call, tmp_path):
    file = tmp_path / "b.toml"
    for text, said in [
        ("[parameters]\nrs_ohm = 1.5\nnope = 1\n", "no parameter 'nope'"),
        ("[parameters]\nrs_ohm = 1.5\nrr_ohm = -3\n", "rr_ohm = -3: allowed range"),
        ("[parameters]\nrs_ohm = 1.5\nscheme = 3\n", "scheme = 3: choose one of"),
        ("[parameters]\nrs_ohm = 1.5\ntorque_inner_Nm = 900\n", "do not fit together"),
        ("[parameters]\nrs_ohm = [1.5]\n", "rs_ohm = [1.5]: a number is needed"),
        ("rs_ohm = 1.5\n", "one table [parameters] is needed"),
        ("[parameters", str(file)),
    ]:
        file.write_text(text)
        code, _, err = call("params", "load", str(file))
        assert code == 2 and said in err and err.count("\n") == 1
        assert call("params", "get", "rs_ohm")[1].split() == ["rs_ohm", "1.8"]
    assert call("params", "load", str(tmp_path / "none.toml"))[0] == 2


def test_a_start_is_guarded_and_ended_by_a_signal(call, board):
    for number in (signal.SIGINT, signal.SIGTERM):
        process = background("start", "--speed", "50", "--device", board)
        line_with(process, "run")
        assert call("set", "speed=80")[0] == 0  # from another process
        assert json.loads(call("status", "--json")[1])["guarded"]
        process.send_signal(number)
        _, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (0, "")
        status = json.loads(call("status", "--json")[1])
        assert (status["state"], status["faults"], status["guarded"]) == ("idle", [], False)
        assert (status["reset"], status["watchdog_resets"]) == ("power-on", 0)
        to_rest(board)


def stopped_for_a_while(process: Forked, board: str, state: str = firmware.RUN) -> int:
    """Stop the process, once its drive is in this state, until the drive is off. Returns the
    board's tick before."""
    with BoardDrive.open(board) as watch:
        until(lambda: watch.state == state or process.poll() is not None)
        assert process.poll() is None
        tick = watch.client.latest.tick
        process.send_signal(signal.SIGSTOP)
        try:
            until(lambda: not watch.condition.at_work)
            assert watch.faults == []
        finally:
            process.send_signal(signal.SIGCONT)
    return tick


def told(text: str, after: int) -> None:
    """The text says when and why the drive was stopped."""
    found = re.search(r"stopped at tick (\d+): this program was silent for 250 ms", text)
    assert found and after < int(found[1]) < after + 100_000, text


def test_a_guard_that_did_not_run_says_that_its_drive_was_stopped(call, board):
    process = background("start", "--json", "--device", board)
    after = stopped_for_a_while(process, board)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 1
    told(err, after)
    told(json.loads(out)["stopped"], after)
    to_rest(board)


def test_a_recording_of_a_drive_that_was_stopped_for_silence_says_so(call, board, tmp_path):
    file = tmp_path / "run.csv"
    words = ("stream", "speed_rpm", "--rate", "1000", "-o", str(file), "--start", "--json")
    process = background(*words, "--device", board)
    after = stopped_for_a_while(process, board)
    out, err = process.communicate(timeout=30)  # it does not wait for a signal
    assert process.returncode == 1
    told(err, after)
    told(json.loads(out)["ended"], after)
    recording = Recording.load(file)
    told(recording.meta["ended"], after)
    assert recording.meta["lost_samples"] == 0 and recording.meta["closed"]
    to_rest(board)


def test_a_capture_of_a_drive_that_was_stopped_for_silence_ends(call, board, tmp_path):
    trigger = ("--trigger", "rising:i_u1_A:900")
    words = ("capture", "i_u1_A", "--start", *trigger, "-o", str(tmp_path / "never.csv"))
    process = background(*words, "--device", board)
    after = stopped_for_a_while(process, board)
    _, err = process.communicate(timeout=30)  # nothing will ever trigger it
    assert process.returncode == 1
    told(err, after)
    to_rest(board)


def test_a_commissioning_that_was_stopped_for_silence_says_so(call, board):
    words = ("commission", "--steps", "resistance", "--json")
    process = background(*words, "--device", board)
    after = stopped_for_a_while(process, board, firmware.TEST)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    told(err, after)
    to_rest(board)


def to_rest(board: str) -> None:
    with BoardDrive.open(board) as drive:
        while abs(drive.capture(["speed_rpm"], 1)["speed_rpm"][0]) > 20:
            pass


def test_a_start_that_trips(call, board):
    with BoardDrive.open(board) as drive:
        trip_A = drive.get("i_trip_A")
    code, out, err = call("start", "--set", "i_trip_A=0.1", "--json")
    with BoardDrive.open(board) as drive:
        drive.set("i_trip_A", trip_A)
    said = json.loads(out)
    assert code == 1 and (said["state"], said["faults"]) == ("fault", ["over-current"])
    assert said["trip"]["faults"] == ["over-current"]
    assert said["trip"]["details"][0].endswith("i_trip_A = 0.1 A")
    assert "the drive tripped at " in err and "in state build: over-current; phase " in err


def test_a_trip_between_two_looks_at_the_board_is_told(call, board, monkeypatch):
    """The state was read before it, the faults behind it."""
    limits = BoardDrive.limits.fget

    def tripped(drive):
        if drive.state == "run":
            drive.set("i_trip_A", 0.1)
            until(lambda: drive.faults)
        return limits(drive)

    with BoardDrive.open(board) as drive:
        trip_A = drive.get("i_trip_A")
    monkeypatch.setattr(BoardDrive, "limits", property(tripped))
    code, out, err = call("start", "--json")
    monkeypatch.undo()
    with BoardDrive.open(board) as drive:
        drive.set("i_trip_A", trip_A)
    said = json.loads(out)
    assert code == 1 and (said["state"], said["faults"]) == ("fault", ["over-current"])
    assert "the drive tripped at " in err


def test_a_start_that_is_refused_says_what_to_do(call, board, tmp_path):
    with BoardDrive.open(board) as drive:
        trip_A = drive.get("i_trip_A")
    assert call("start", "--set", "i_trip_A=0.1")[0] == 1
    assert call("set", f"i_trip_A={trip_A}")[0] == 0
    code, _, err = call("start")
    assert code == 1 and "start: not allowed in state fault; clear the fault first" in err
    # A recording of what the fault left is none that trips.
    file = str(tmp_path / "after.csv")
    code, _, err = call("stream", "state", "--rate", "100", "--duration", "0.1", "-o", file)
    assert (code, err) == (0, "")
    assert call("clear")[0] == 0


def test_a_capture_of_a_drive_that_trips_before_its_trigger_ends(call, board, tmp_path):
    """It has no --timeout. A trip that is the trigger is captured, with what comes after it."""
    file = tmp_path / "never.csv"
    with BoardDrive.open(board) as drive:
        trip_A = drive.get("i_trip_A")
    words = ("capture", "i_u1_A", "--samples", "2000", "-o", str(file), "--start")
    for trigger in ("rising:speed_rpm:5000", "fault"):
        code, _, err = call(*words, "--trigger", trigger, "--set", "i_trip_A=0.1")
        assert code == 1 and err.count("\n") == 1
        if trigger == "fault":
            assert "the drive tripped: over-current" in err
            assert len(Recording.load(file)) == 2000
        else:
            assert err == (
                "hexatorque: capture: the drive tripped (over-current) before the trigger\n"
            )
            assert not file.exists()
        assert json.loads(call("status", "--json")[1])["capture"] in ("none", "complete")
        assert call("clear")[0] == 0
    assert call("set", f"i_trip_A={trip_A}")[0] == 0


def test_a_capture_of_a_drive_that_another_client_stops_ends(call, board, tmp_path):
    file = str(tmp_path / "never.csv")
    words = ("capture", "i_u1_A", "--trigger", "fault", "-o", file, "--start")
    waiting = background(*words, "--device", board)
    until(lambda: json.loads(call("status", "--json")[1])["state"] == "run")
    assert call("stop")[0] == 0
    _, said = waiting.communicate(timeout=30)
    assert waiting.returncode == 1
    assert said == "hexatorque: capture: the drive stopped (state idle) before the trigger\n"


@pytest.mark.parametrize(
    "words",
    [
        ["start", "--duration", "-1"],
        ["stream", "state", "-o", "x.csv", "--duration", "nan"],
        ["capture", "state", "-o", "x.csv", "--timeout", "-1"],
        ["watch", "state", "--window", "0"],
        ["watch", "state", "--duration", "inf"],
        ["status", "--baud", "0"],
        ["list", "--baud", "-5"],
        ["serve", "--baud", "0"],
        ["monitor", "--baud", "-1"],
    ],
)
def test_times_and_rates_are_above_zero(words, capsys):
    assert main(["board", *words]) == 2
    said = capsys.readouterr().err
    assert "above 0" in said and said.count("\n") == 1 and words[-2] in said


def test_ports_that_are_none(capsys, tmp_path):
    for port, code, said in [
        (str(tmp_path), 2, "not a serial port"),
        (os.devnull, 2, "not a serial port"),  # many processes have it open
        ("socket://here", 2, "write socket://HOST:PORT"),
    ]:
        assert main(["board", "status", "--device", port]) == code
        assert capsys.readouterr().err == f"hexatorque: {port}: {said}\n"


def test_a_name_belongs_to_one_board(tmp_path, capsys):
    """A second board does not take the name of one that runs; that of a killed board it does."""
    name = tmp_path / "board"
    first = background("serve", "--setup", "paper-b", "--link", str(name))
    line_with(first, "Ctrl-C")
    port = os.readlink(name)
    assert main(["board", "serve", "--setup", "paper-b", "--link", str(name)]) == 2
    assert "another board" in capsys.readouterr().err and os.readlink(name) == port
    first.kill()
    first.communicate()
    again = background("serve", "--setup", "paper-b", "--link", str(name))
    line_with(again, "Ctrl-C")
    again.terminate()
    again.communicate(timeout=30)
    assert not name.is_symlink()


def test_a_board_does_not_take_the_name_of_a_link_to_anything_else(tmp_path):
    name = tmp_path / "board"
    name.symlink_to(tmp_path)
    assert main(["board", "serve", "--setup", "paper-b", "--link", str(name)]) == 2
    assert name.resolve() == tmp_path


def test_a_recording_of_a_board_is_checked_before_it_runs(capsys):
    assert main(["board", "serve", "--record", "x.xyz"]) == 2
    said = capsys.readouterr()
    assert "unknown suffix" in said.err and said.out == ""


def test_stop_and_clear_from_elsewhere(call, board):
    process = background("start", "--speed", "50", "--device", board)
    line_with(process, "run")
    code, out, _ = call("stop", "--json")
    assert (code, json.loads(out)) == (0, {"state": "idle"})
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0 and "stopped by somebody else" in out
    code, _, err = call("clear")
    assert code == 1 and "clear: not allowed in state idle" in err


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_stream_for_a_time(call, tmp_path, suffix):
    file = tmp_path / f"run{suffix}"
    code, out, _ = call(
        "stream", "speed_rpm", "torque_Nm", "--rate", "1000", "--duration", "1.5",
        "--start", "--speed", "100", "-o", str(file), "--json",
    )  # fmt: skip
    summary = json.loads(out)
    assert code == 0 and (summary["samples"], summary["lost_samples"]) == (1500, 0)
    recording = Recording.load(file)
    assert list(recording.channels) == ["speed_rpm", "torque_Nm"] and len(recording) == 1500
    assert recording.rate_Hz == 1000 and recording.units["torque_Nm"] == "N m"
    assert recording["speed_rpm"][-1] > 60 > 10 > abs(recording["speed_rpm"][0])
    meta = recording.meta
    assert meta["closed"] and meta["gaps"] == meta["lost_samples"] == meta["crc_errors"] == 0
    assert meta["parameters"]["controller"]["speed_ref_rpm"] == 100 and meta["state"] == "run"
    assert meta["ended"] == "duration" and meta["started_uncertainty_s"] > 0
    assert json.loads(call("status", "--json")[1])["state"] == "idle"  # what it started


def until_rows(file, number):
    end = time.monotonic() + 60
    while not file.exists() or file.read_text().count("\n") < number:
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_stream_ends_by_a_signal_with_a_whole_file(board, tmp_path):
    file = tmp_path / "run.csv"
    process = background("stream", "vdc_V", "--rate", "500", "--device", board, "-o", str(file))
    line_with(process, "500 Hz")
    until_rows(file, 320)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")
    recording = Recording.load(file)
    assert recording.meta["closed"] and len(recording) > 300
    assert recording.meta["ended"] == "user"
    assert not np.isnan(recording["vdc_V"]).any()


def test_a_killed_stream_leaves_what_it_had(board, tmp_path):
    file = tmp_path / "run.csv"
    process = background("stream", "vdc_V", "--rate", "500", "--device", board, "-o", str(file))
    line_with(process, "500 Hz")
    until_rows(file, 320)
    process.kill()
    process.communicate()
    recording = Recording.load(file)
    assert not recording.meta["closed"] and len(recording) > 300


def test_capture(call, tmp_path):
    file = tmp_path / "step.npz"
    code, out, _ = call(
        "capture", "i_u1_A", "speed_rpm", "--samples", "1000", "--pre", "300", "--trigger",
        "rising:speed_rpm:20", "--start", "--speed", "100", "--timeout", "60", "-o", str(file),
        "--json",
    )  # fmt: skip
    assert code == 0 and json.loads(out)["samples"] == 1000
    recording = Recording.load(file)
    assert recording.rate_Hz == 10000 and recording.start_s == -0.03
    assert recording["speed_rpm"][299] < 20 <= recording["speed_rpm"][300]
    assert recording.meta["trigger_s"] == 0
    code, _, err = call(
        "capture", "state", "--trigger", "fault", "--timeout", "0.2", "-o", str(file)
    )
    assert code == 1 and "not complete within 0.2 s (waiting)" in err
    assert json.loads(call("status", "--json")[1])["capture"] == "none"


def test_watch(call):
    code, out, _ = call("watch", "vdc_V", "speed_rpm", "--duration", "0.5")
    assert (code == 0 and "vdc_V" in out and "speed_rpm" in out and "⠉" in out) or "⠤" in out
    code, out, _ = call("watch", "vdc_V", "--duration", "0.5", "--json")
    assert code == 0 and json.loads(out)["vdc_V"] > 100


def test_a_curve_is_where_its_points_are():
    corners = braille(np.array([0.0, 0.999, 0.0, 0.999]), np.array([0, 0, 1.0, 1.0]), 3, 2)
    assert corners == ["⠁⠀⠈", "⡀⠀⢀"]
    curves = Curves(("a",), ["V"], window_s=1.0)
    curves.add(np.array([0.0, 1.0, 2.0]), np.array([[5.0], [6.0], [7.0]], np.float32))
    text = "\n".join(part.plain for part in curves.drawn(12).renderables)
    assert text.startswith("a 7 V   6 .. 7\n")  # 5 is older than the window
    assert curves.latest() == [7.0]


def test_list(board, capsys, monkeypatch):
    from hexatorque.serial import devices, runtime

    monkeypatch.setattr(devices.list_ports, "comports", lambda: [])
    assert main(["board", "list"]) == 1
    assert "no board found; start a virtual one" in capsys.readouterr().err
    runtime.Announcement(os.path.realpath(board), "my board")
    assert main(["board", "list", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["where"] == "my board" and found["device"] == "virtual f28377s"
    assert main(["board", "status", "--json"]) == 0  # the only one needs no --device


def test_list_names_who_has_a_port(board, capsys, monkeypatch):
    from hexatorque.serial import devices, runtime

    monkeypatch.setattr(devices.list_ports, "comports", lambda: [])
    runtime.Announcement(os.path.realpath(board), "my board")
    code = "import sys; f = open(sys.argv[1]); print(flush=True); sys.stdin.read()"
    with Forked(["-c", code, board], pipes=("stdin", "stdout")) as other:
        other.stdout.readline()
        assert main(["board", "list"]) == 1
        busy, none = capsys.readouterr().err.splitlines()
        other.stdin.close()
    assert f": in use by process {other.pid} (" in busy and "no board found" in none


def test_a_stream_that_is_refused_does_not_begin(call, tmp_path):
    file = str(tmp_path / "x.csv")
    code, out, err = call("stream", "state", "state", "-o", file)
    assert (code, out) == (2, "") and "each of another name" in err
    code, out, _ = call("stream", "state", "--rate", "100", "--duration", "0.1", "-o", file)
    assert code == 0 and out.startswith("1 channel at 100 Hz\n")


def test_values_as_people_write_them(call):
    """A decimal comma as on the web page, and names of choices in capital letters."""
    before = json.loads(call("params", "get", "rs_ohm", "scheme", "speed_ref_rpm", "--json")[1])
    code, out, _ = call("set", "rs_ohm=1,75", "scheme=FDR", "speed=-0,5", "--json")
    changed = {"rs_ohm": 1.75, "scheme": "fdr", "speed_ref_rpm": -0.5}
    assert (code, json.loads(out)) == (0, changed)
    code, _, err = call("set", "rs_ohm=1.000,5")
    assert code == 2 and "rs_ohm = '1.000,5': a number is needed" in err
    assert call("set", *(f"{name}={value}" for name, value in before.items()))[0] == 0


def test_an_option_takes_a_decimal_comma():
    from hexatorque.cli import options

    assert options.number("-2,5") == -2.5 and options.seconds("0,5") == 0.5
    assert options.number("1,000") == 1.0
    for text in ("1.000,5", "1,000,5", "1,000.5", ","):
        with pytest.raises(click.BadParameter):
            options.number(text)
