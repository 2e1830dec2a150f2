"""What `make test` says at its end."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from summary import summary

TESTS = Path(__file__).resolve().parents[1]
EXAMPLE = """
import pytest

def test_good(): pass
@pytest.mark.parametrize("n", [1, 2])
def test_one_is_bad(n): assert n == 1
@pytest.fixture
def breaks(): yield; raise ValueError
def test_whose_end_fails(breaks): pass
@pytest.mark.skip(reason="no browser")
def test_left(): pass
"""
BAD = ["test_it.py::test_one_is_bad[2]", "test_it.py::test_whose_end_fails"]


def run(folder, text, *more, results="waits.json"):
    """The file that pytest leaves, with the hook of all tests."""
    (folder / "test_it.py").write_text(text)
    file = folder / results
    environment = os.environ | {"PYTHONPATH": str(TESTS)}
    command = [sys.executable, "-m", "pytest", "-p", "conftest", "--results", file, *more]
    subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL)
    return file


@pytest.mark.parametrize("processes", [[], ["-n", "1"]])
def test_what_failed_is_named_and_counted_once(tmp_path, processes):
    lines, well = summary([run(tmp_path, EXAMPLE, *processes)])
    assert not well
    assert lines == [
        "not run, 1: no browser",
        *(f"FAILED {test}" for test in BAD),
        "tests: 2 passed, 2 failed, 1 skipped",
    ]


def test_what_passes_when_it_runs_again_counts_as_passed_and_is_named(tmp_path):
    file = run(tmp_path, EXAMPLE)
    again = run(tmp_path, EXAMPLE.replace("n == 1", "n"), "--last-failed", results="waits.again")
    assert json.loads(again.read_text())["passed"] == BAD  # with a fixture that fails again
    lines, well = summary([file])
    assert f"passed only when it ran again, alone: {BAD[0]}" in lines
    assert f"FAILED {BAD[1]}" in lines and not well
    assert lines[-1] == "tests: 3 passed, 1 failed, 1 skipped"


def test_stages_are_added_and_all_well_is_one_line(tmp_path):
    good = run(tmp_path, "def test_good(): pass")
    other = run(tmp_path, "def test_good(): pass", results="computes.json")
    assert summary([good, other]) == (["tests: 2 passed, 0 failed, 0 skipped"], True)


@pytest.mark.parametrize("text", ["raise ValueError", "import os; os._exit(3)", "def f(: pass"])
def test_a_stage_that_did_not_end_has_failed(tmp_path, text):
    """Its tests could not be read, or its process ended."""
    lines, well = summary([run(tmp_path, text)])
    assert not well and "FAILED stage waits: it did not come to its end" in "\n".join(lines)
    assert lines[-1].endswith(" failed, 0 skipped") and " 0 failed" not in lines[-1]


def test_slow_files_are_named(tmp_path):
    file = run(tmp_path, "import time\ndef test_it(): time.sleep(0.2)")
    found = json.loads(file.read_text())
    assert 0.2 <= found["took_s"]["test_it.py"] < 60
    file.write_text(json.dumps(found | {"took_s": {"a.py": 59.0, "b.py": 61.4, "c.py": 300.0}}))
    assert summary([file])[0][:2] == ["slow, 300 s: c.py", "slow, 61 s: b.py"]
