"""Which tests `make test` and `make test-quick` run when.

timed   The test depends on how fast other processes answer. These tests mostly wait. They run
        apart from the others, which would keep the processors busy.
slow    The file takes more than some seconds of computing time. `make test-quick` leaves it out.
"""

from pathlib import Path

import pytest

TESTS = Path(__file__).parent

TIMED = (
    "host/boards/test_pil_board.py",
    "host/boards/test_served_board.py",
    "host/monitor",
    "host/serial",
    "project/test_tutorial.py",
)
SLOW = (
    "firmware/core/test_pattern.py",
    "firmware/port",
    "host/analysis/test_plots.py",
    "host/boards",
    "host/cli/test_cli.py",
    "host/cli/test_compiling.py",
    "host/drive",
    "host/evidence",
    "host/plant",
    "host/recording/test_files.py",
    "project",
)


def pytest_configure(config):
    config.addinivalue_line("markers", "timed: depends on how fast other processes answer")
    config.addinivalue_line("markers", "slow: left out by `make test-quick`")


def pytest_collection_modifyitems(items):
    marks = [(TESTS / name, pytest.mark.timed) for name in TIMED]
    marks += [(TESTS / name, pytest.mark.slow) for name in SLOW]
    assert all(path.exists() for path, _ in marks)
    for item in items:
        for path, mark in marks:
            if item.path == path or path in item.path.parents:
                item.add_marker(mark)
