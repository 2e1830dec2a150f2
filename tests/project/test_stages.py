"""Every test is in one stage, and each stage is run by one command (`tests/conftest.py`)."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
#: Command -> the commands of the Makefile that it runs, and the stage of each.
COMMANDS = {
    "test": {"test-computes": "computes", "test-waits": "waits"},
    "test-targets": {"test-targets": "target"},
}


def recipe(command: str) -> str:
    makefile = (ROOT / "Makefile").read_text()
    (text,) = re.findall(rf"^{command}: (?!export).*\n((?:\t.*\n)+)", makefile, re.M)
    return text


def collected(*arguments: str) -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", *arguments, "tests"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return [line for line in done.stdout.splitlines() if "::" in line]


def test_each_stage_is_run_by_one_command():
    for parts in COMMANDS.values():
        for part, stage in parts.items():
            found = re.findall(r"call (?:stage|waiting),[^,]+,(\w+)\)", recipe(part))
            assert found == [stage]
    assert recipe("test").split()[-2:] == list(COMMANDS["test"])


def test_continuous_integration_runs_both_commands_with_whole_campaigns():
    lines = (ROOT / ".ci" / "run").read_text().splitlines()
    whole = next(n for n, line in enumerate(lines) if line.startswith("export HT_WHOLE=1"))
    for command in COMMANDS:
        assert lines.index(f"make {command}") > whole
    assert lines[-1] == "make test"  # its closing line is the last


@pytest.mark.target
def test_every_test_is_in_one_stage():
    """Pytest itself says what each stage would run. It reads all tests five times: too much for
    `make test`."""
    every = collected()
    assert len(every) > 4000
    of_stages = [test for parts in COMMANDS.values() for stage in parts.values()
                 for test in collected("--stage", stage)]  # fmt: skip
    assert sorted(of_stages) == sorted(every)
