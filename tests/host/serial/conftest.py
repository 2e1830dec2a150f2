"""Virtual boards, and directories that are the test's own."""

import contextlib
import os
import signal
import time

import pytest
from board_process import Process
from waiting import WAIT_S


@pytest.fixture
def used_boards():
    """Boards of the whole session that this test uses. They rest when its port servers have
    ended."""
    used = []
    yield used
    for board in used:
        board.rest()


@pytest.fixture(autouse=True)
def own_directories(tmp_path, monkeypatch, used_boards):
    """Each test has its own directory for port servers, which end with the test."""
    for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME"):
        (tmp_path / name).mkdir()
        monkeypatch.setenv(name, str(tmp_path / name))
    yield
    from hexatorque.serial import runtime

    folder = tmp_path / "XDG_RUNTIME_DIR" / "hexatorque"
    locks = {path: runtime.locked(path) for path in folder.glob("port-*.lock")}
    for server in filter(None, locks.values()):
        with contextlib.suppress(ProcessLookupError):
            os.kill(server.pid, signal.SIGCONT)
            os.kill(server.pid, signal.SIGTERM)
    end = time.monotonic() + WAIT_S
    while any(path.exists() for path in locks) and time.monotonic() < end:
        time.sleep(0.01)
    complaints = [path.read_text() for path in folder.glob("port-*.log")]
    assert not any("Traceback" in text for text in complaints), complaints


@pytest.fixture(scope="session")
def session_board(tmp_path_factory):
    process = Process(tmp_path_factory.mktemp("dev") / "ttyHT0")
    process.rest()
    yield process
    process.unplug()


@pytest.fixture
def shared_board(session_board, used_boards):
    session_board.go_on()
    used_boards.append(session_board)
    return session_board


@pytest.fixture
def board(shared_board):
    """A board that a test leaves idle and without faults."""
    from hexatorque.drive.board import BoardDrive

    yield shared_board.url
    with BoardDrive.open(shared_board.url) as drive:
        drive.stop()
        if drive.state == "fault":
            drive.clear()
        drive.set("speed_ref_rpm", 0.0)
        while abs(drive.capture(["speed_rpm"], 1)["speed_rpm"][0]) > 20:
            pass


@pytest.fixture
def own_board(tmp_path):
    """A board to be unplugged."""
    process = Process(tmp_path / "ttyHT1")
    yield process
    process.unplug()
