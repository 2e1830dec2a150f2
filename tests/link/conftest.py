"""Virtual boards, and directories that are the test's own."""

import pytest
from board_process import Process


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
        drive.set("speed_ref_rpm", 0.0)
        while abs(drive.capture(["speed_rpm"], 1)["speed_rpm"][0]) > 20:
            pass


@pytest.fixture
def own_board(tmp_path):
    """A board to be unplugged."""
    process = Process(tmp_path / "ttyHT1")
    yield process
    process.unplug()
