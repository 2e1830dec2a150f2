"""`hexatorque board monitor` as a process: how it ends, and that the drive then stops."""

import signal
import socket
import time

import pytest
from waiting import WAIT_S, until

from hexatorque.cli.main import main


def run_drive(monitor, frame) -> None:
    """Start the drive and wait until it runs."""
    assert monitor.post("/start", {})[0] == 200
    end = time.monotonic() + WAIT_S
    while frame().get("status", {}).get("state") != "run":
        assert time.monotonic() < end


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_monitor_that_ends_stops_the_drive_and_closes_the_recording(monitor, port, number):
    from hexatorque.drive.board import BoardDrive
    from hexatorque.recording.recording import Recording

    with monitor.page() as frame:
        run_drive(monitor, frame)
        _, answer = monitor.post("/record/start", {"suffix": ".csv"})
        while ((frame().get("status") or {}).get("record") or {"rows": 0})["rows"] <= 500:
            pass
        code, said = monitor.end(number)
    assert code == 0 and "Traceback" not in said
    with BoardDrive.open(port) as drive:
        assert drive.state == "idle" and drive.faults == []
    assert len(Recording.load(answer["file"])) > 500


def test_terminal_and_recording_tell_that_no_page_answered(monitor):
    from hexatorque.recording.recording import Recording

    with monitor.page(answer=lambda sent_s: None) as frame:
        _, answer = monitor.post("/record/start", {"suffix": ".csv"})
        run_drive(monitor, frame)
        end = time.monotonic() + WAIT_S
        while not (notice := frame().get("status", {}).get("notice", "")):
            assert time.monotonic() < end
        assert "no page answered" in notice
        code, said = monitor.end(signal.SIGINT)
    assert code == 0
    assert said.count(f"hexatorque: {notice}\n") == 1
    assert Recording.load(answer["file"]).meta["stops"] == [notice]


def test_the_drive_of_a_killed_monitor_stops(monitor, port):
    """The port server stops it."""
    from hexatorque.drive.board import BoardDrive

    with monitor.page() as frame:
        run_drive(monitor, frame)
        monitor.end(signal.SIGKILL)
    with BoardDrive.open(port) as drive:
        until(lambda: drive.state == "idle")
        assert drive.faults == []
        until(lambda: not drive.client.get_status().in_session)


def test_two_monitors_of_one_board(monitor, port):
    """They share the port, and each can stop the drive."""

    second = type(monitor)("--device", port)
    try:
        with monitor.page() as frame, second.page() as other:
            run_drive(monitor, frame)
            end = time.monotonic() + WAIT_S
            while other().get("status", {}).get("state") != "run":
                assert time.monotonic() < end
            assert second.post("/stop", {})[0] == 200
            while frame().get("status", {}).get("state") != "idle":
                assert time.monotonic() < end
    finally:
        assert second.end(signal.SIGINT)[0] == 0


def test_a_wrong_port_number_gives_one_line(port, capsys):
    with socket.create_server(("127.0.0.1", 0)) as busy:
        number = busy.getsockname()[1]
        assert (
            main(["board", "monitor", "--no-browser", "--device", port, "--port", str(number)]) == 2
        )
    error = capsys.readouterr().err
    assert f"--port {number}" in error and error.count("\n") == 1
    assert main(["board", "monitor", "--no-browser", "--device", "/dev/nothing"]) in (1, 2)
    error = capsys.readouterr().err
    assert "/dev/nothing" in error and error.count("\n") == 1
    assert main(["board", "monitor", "--port", "70000"]) == 2
    assert "0 .. 65535" in capsys.readouterr().err
