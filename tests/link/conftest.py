"""A virtual board in a process of its own, as a user would have it, and directories that are
the test's own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import hexatorque

HOST = Path(hexatorque.__file__).parents[1]
BOARD = """
import sys
from hexatorque import scenario
from hexatorque.virtual_board import Terminal, VirtualBoard, serve
setup = scenario.load("paper-a-feasible").changed(
    timing__device="f28377s",
    controller__build_s=0.05, controller__build_current_A=20.0)
board = VirtualBoard(setup, baud=int(sys.argv[1]) or None)
with Terminal() as line:
    print(line.port, flush=True)
    serve(board, line, until=lambda: False)
"""


class Process:
    """A virtual board that can be unplugged: a process, and the name by which it is known."""

    def __init__(self, link: Path, baud: int = 0) -> None:
        self.url, self._baud = str(link), baud
        self._process: subprocess.Popen | None = None
        self.plug()

    def plug(self) -> None:
        environment = {**os.environ, "PYTHONPATH": str(HOST)}
        self._process = subprocess.Popen(
            [sys.executable, "-c", BOARD, str(self._baud)],
            stdout=subprocess.PIPE, text=True, env=environment,
        )  # fmt: skip
        port = self._process.stdout.readline().strip()
        assert port.startswith("/dev/pts/")
        os.symlink(port, self.url)

    def unplug(self) -> None:
        os.unlink(self.url)
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        self._process.stdout.close()


@pytest.fixture(autouse=True)
def own_directories(tmp_path, monkeypatch):
    for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME"):
        (tmp_path / name).mkdir()
        monkeypatch.setenv(name, str(tmp_path / name))


@pytest.fixture(scope="session")
def shared_board(tmp_path_factory):
    process = Process(tmp_path_factory.mktemp("dev") / "ttyHT0")
    yield process
    process.unplug()


@pytest.fixture
def board(shared_board):
    """A board that a test leaves idle and without faults."""
    from hexatorque.link.drive import Drive

    yield shared_board.url
    with Drive.open(shared_board.url) as drive:
        drive.stop()
        if drive.state == "fault":
            drive.clear()


@pytest.fixture
def own_board(tmp_path):
    """A board to be unplugged."""
    process = Process(tmp_path / "ttyHT1")
    yield process
    process.unplug()
