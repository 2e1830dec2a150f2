"""Which tests `make test`, `make test-targets` and `make test-quick` run when.

Each test is in one stage. `make test` runs the first two, at the same time, `make test-targets`
the last.

computes: all that is in none of the other stages.
waits: the test depends on how fast other processes answer, or starts many of them. It mostly
  waits, so several of these run at once. What computes is nice to them.
target: the test needs a program that `make` does not install: an emulator, a cross compiler or a
  browser. Or it builds the firmware again, in a copy of the tree.

`--stage NAME` runs one of them and does not even import the files that have no test of it.
`make test-quick` runs the stage `quick`: what computes, without the slow files, which take more
than some seconds of computing time.

`--results FILE` keeps for tools/summary.py how each test ended.
"""

import functools
import json
import os
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import pytest
from forked import end_server

# Every run draws the same inputs, as it runs the same cases of a campaign: who clones this sees
# what CI saw. HT_INPUTS=new draws others. A wheel is tried where hypothesis is not installed.
if os.environ.get("HT_INPUTS") != "new" and find_spec("hypothesis"):
    import hypothesis

    same = hypothesis.settings(derandomize=True, database=None)
    hypothesis.settings.register_profile("same inputs", parent=same)
    hypothesis.settings.load_profile("same inputs")

TESTS = Path(__file__).parent
# What is no terminal has no width. GNU readline sets this for processes that pytest starts.
os.environ.pop("COLUMNS", None)

WAITS = (
    "host/boards/test_pil_board.py",
    "host/boards/test_served_board.py",
    "host/boards/test_xcp.py",
    "host/monitor/test_command.py",
    "host/monitor/test_commission.py",
    "host/monitor/test_server.py",
    "host/monitor/test_sets.py",
    "host/monitor/test_traces.py",
    "host/serial",
    "host/sweeps/test_cluster.py",
    "host/sweeps/test_engine.py",
    "project/test_forked.py",
    "project/test_own_machine_page.py",
    "project/test_tutorial.py",
    "project/test_xcp_page.py",
)
TARGET = (
    "host/boards/test_budget.py",
    "host/boards/test_calls.py",
    "host/boards/test_pil.py",
    "host/boards/test_vectors_on_avr.py",
    "host/monitor/test_analysis.py",
    "host/monitor/test_commission_page.py",
    "host/monitor/test_deadman.py",
    "host/monitor/test_page.py",
    "host/monitor/test_parameters_page.py",
    "host/monitor/test_plots.py",
    "project/test_adding.py",
    "project/test_c2000_build.py",
    "project/test_check_c.py",
    "project/test_rules.py",
    "web/test_web.py",
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
    "host/fmu",
    "host/laws",
    "host/plant",
    "host/recording/test_files.py",
    "host/recording/test_writer.py",
    "project",
)
#: Only some tests of these files are in the stage `target`. They have a mark of this name.
TARGET_IN_PART = (
    "host/boards/test_served_board.py",
    "host/boards/test_xcp.py",
    "project/test_initial_values.py",
    "project/test_stages.py",
)
STAGES = ("computes", "waits", "target")


def within(file: Path, names: tuple[str, ...]) -> bool:
    return any(path == file or path in file.parents for path in (TESTS / name for name in names))


@functools.cache
def stages(file: Path) -> tuple[str, ...]:
    """The stages that a file has tests of. The first is that of tests without a mark."""
    of_files = {"waits": WAITS, "target": TARGET}
    first = next((stage for stage, names in of_files.items() if within(file, names)), "computes")
    return (first, "target") if within(file, TARGET_IN_PART) else (first,)


def stage_of(item: pytest.Item) -> str:
    first, *others = stages(item.path)
    if item.get_closest_marker("target") is None:
        return first
    assert others, f"{item.path} is missing in TARGET_IN_PART"
    return "target"


def pytest_addoption(parser):
    parser.addoption("--stage", choices=(*STAGES, "quick"), help="only the tests of this stage")
    parser.addoption("--results", type=Path, metavar="FILE", help="keep how each test ended")


def pytest_configure(config):
    config.addinivalue_line("markers", "target: for `make test-targets`, though its file is not")


def pytest_unconfigure():
    end_server()


def pytest_terminal_summary(terminalreporter, exitstatus, config):
    """Only the process that tells the user calls this."""
    file = config.getoption("--results")
    if file is None:
        return
    ended = (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.NO_TESTS_COLLECTED)
    stats = terminalreporter.stats
    took_s: Counter[str] = Counter()
    for reports in stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                took_s[report.nodeid.split("::")[0]] += report.duration
    found = {
        "ended": exitstatus in ended,
        "took_s": took_s,
        "passed": [report.nodeid for report in stats.get("passed", [])],
        "failed": [report.nodeid for kind in ("failed", "error") for report in stats.get(kind, [])],
        "skipped": [report.longrepr[2] for report in stats.get("skipped", [])],
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(found))


def left_out(file: Path, stage: str) -> bool:
    if stage == "quick":
        return within(file, SLOW) or "computes" not in stages(file)
    return stage not in stages(file)


def pytest_ignore_collect(collection_path, config):
    stage = config.getoption("--stage")
    if stage is None:
        return None
    # Of a folder that has nothing for the stage, not even conftest.py is imported.
    folder = collection_path.is_dir()
    if not folder and not collection_path.match("test_*.py"):
        return None
    files = collection_path.rglob("test_*.py") if folder else [collection_path]
    return all(left_out(file, stage) for file in files) or None


def pytest_collection_modifyitems(config, items):
    named = (*WAITS, *TARGET, *TARGET_IN_PART, *SLOW)
    assert all((TESTS / name).exists() for name in named)
    stage = config.getoption("--stage")
    wanted = "computes" if stage == "quick" else stage
    here, others = [], []
    for item in items:
        (here if stage_of(item) == wanted or stage is None else others).append(item)
    if others:
        config.hook.pytest_deselected(items=others)
        items[:] = here
