"""Every test is in one stage, and each stage is run by one command (`tests/conftest.py`)."""

import os
import re
import shutil
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


STAGE = """#!/bin/sh
echo "$PYTEST_DEBUG_TEMPROOT" >>roots
: >"$PYTEST_DEBUG_TEMPROOT/file"
"""


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
    run, told = recipe("test").splitlines()
    assert f"-j2 {' '.join(COMMANDS['test'])} " in run
    assert told == f"\t@$(call summary,{' '.join(COMMANDS['test'].values())})"


def test_continuous_integration_runs_both_commands_with_more_of_the_campaigns():
    """`make test` is run by an ordinary user, and its closing line is the last."""
    lines = (ROOT / ".ci" / "run").read_text().splitlines()
    more = next(n for n, line in enumerate(lines) if line.startswith("export HT_WHOLE="))
    assert lines.index("make test-targets") > more
    assert lines[-1] == "tools/newcomer.sh"
    newcomer = (ROOT / "tools" / "newcomer.sh").read_text().splitlines()
    assert newcomer[-1].startswith("as_user ") and newcomer[-1].endswith('"${2:-test}"')


def test_no_stage_needs_a_name_that_another_user_may_have(tmp_path):
    """What each keeps in the shared temporary folder has a new name and is gone at the end. The
    names of old are taken."""
    tree, shared = tmp_path / "a tree", tmp_path / "shared"
    shared.mkdir()
    for name in ("tools/setup.sh", "pyproject.toml", "CMakeLists.txt", ".venv/bin/python"):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).touch()
    for name in ("firmware", "host", "cmake", "tests/c", "tests/prove"):
        (tree / name).mkdir(parents=True)
    shutil.copy(ROOT / "Makefile", tree)
    python = tree / ".venv" / "bin" / "python"
    python.write_text(STAGE)
    python.chmod(0o755)
    (tree / ".venv" / ".installed").touch()
    stages = list(COMMANDS["test"])
    taken = [shared / stage.replace("test", "hexatorque") for stage in stages]
    for file in taken:
        file.touch()
    for _ in range(2):
        done = subprocess.run(
            ["make", "--no-print-directory", *stages], cwd=tree, capture_output=True, text=True,
            env=os.environ | {"TMPDIR": str(shared)},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        assert sorted(shared.iterdir()) == sorted(taken)
    roots = [Path(line) for line in (tree / "roots").read_text().splitlines()]
    assert len(set(roots)) == 4 and {root.parent for root in roots} == {shared}


@pytest.mark.target
def test_every_test_is_in_one_stage():
    """Pytest itself says what each stage would run. It reads all tests five times: too much for
    `make test`."""
    every = collected()
    assert len(every) > 4000
    of_stages = [test for parts in COMMANDS.values() for stage in parts.values()
                 for test in collected("--stage", stage)]  # fmt: skip
    assert sorted(of_stages) == sorted(every)
