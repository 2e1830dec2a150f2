"""Which tests `make test` and `make test-quick` run when.

timed   The test depends on how fast other processes answer. It mostly waits, so several of these
        run at once, apart from tests that would keep the processors busy.
live    The same, but the test keeps a processor busy: a browser, or a board on an emulated
        processor. As many run at once as there are processors.
slow    The file takes more than some seconds of computing time.

`make test-quick` leaves all of these out with `--quick`: it does not even import their files.
"""

import os
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
# What is no terminal has no width. GNU readline sets this for processes that pytest starts.
os.environ.pop("COLUMNS", None)

#: These files are in the Makefile's OTHER_PROCESSES too.
TIMED = (
    "host/boards/test_pil_board.py",
    "host/monitor/test_server.py",
    "host/monitor/test_traces.py",
    "host/serial",
)
LIVE = (
    "host/boards/test_served_board.py",
    "host/monitor/test_command.py",
    "host/monitor/test_deadman.py",
    "host/monitor/test_page.py",
    "host/monitor/test_plots.py",
    "project/test_own_machine_page.py",
    "project/test_tutorial.py",
)
SLOW = (
    "firmware/core/test_modulator.py",
    "firmware/core/test_observer.py",
    "firmware/core/test_pattern.py",
    "firmware/link/test_floods.py",
    "firmware/port",
    "host/analysis/test_plots.py",
    "host/analysis/test_report.py",
    "host/boards",
    "host/cli/test_cli.py",
    "host/cli/test_compiling.py",
    "host/drive",
    "host/evidence",
    "host/plant",
    "host/recording/test_files.py",
    "host/recording/test_writer.py",
    "project",
)


def pytest_addoption(parser):
    parser.addoption("--quick", action="store_true", help="leave out timed, live and slow tests")


def pytest_ignore_collect(collection_path, config):
    left_out = [TESTS / name for name in (*TIMED, *LIVE, *SLOW)]
    return (config.getoption("--quick") and collection_path in left_out) or None


def pytest_configure(config):
    config.addinivalue_line("markers", "timed: waits for other processes")
    config.addinivalue_line("markers", "live: waits for other processes and keeps a processor busy")
    config.addinivalue_line("markers", "slow: takes some seconds of computing time")


def pytest_collection_modifyitems(items):
    marks = [(TESTS / name, pytest.mark.timed) for name in TIMED]
    marks += [(TESTS / name, pytest.mark.live) for name in LIVE]
    marks += [(TESTS / name, pytest.mark.slow) for name in SLOW]
    assert all(path.exists() for path, _ in marks)
    of_file = {
        file: [mark for path, mark in marks if file == path or path in file.parents]
        for file in {item.path for item in items}
    }
    for item in items:
        for mark in of_file[item.path]:
            item.add_marker(mark)
