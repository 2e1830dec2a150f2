"""tools/setup.sh makes an environment that is whole, whenever an earlier attempt was interrupted.

A stand-in for Python notes its calls and makes an empty file for each thing that it installs. On
request one of its calls stops in the middle.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON = r"""#!/bin/sh
echo "$*" | head -n 1 >>"$CALLS"
number=$(wc -l <"$CALLS")
here=$(dirname "$0")/..
half() { [ "$number" -ne "$STOP_AT" ] || { : >"$CALLS.stopped"; exec sleep 600; }; }
case "$*" in
*"venv --clear"*)
    for last; do :; done
    rm -rf "$last"
    mkdir -p "$last/bin" "$last/lib"
    cp "$0" "$last/bin/python"
    half
    : >"$last/bin/activate"
    ;;
*purelib*) echo "$here/lib" ;;
*"pip install"*)
    for last; do :; done
    name=$(basename "$last")
    : >"$here/lib/$name-half"
    half
    mv "$here/lib/$name-half" "$here/lib/$name"
    ;;
*numba.np*)
    : >"$3"
    : >"$here/lib/compiled-half"
    half
    mv "$here/lib/compiled-half" "$here/lib/compiled"
    ;;
esac
half
"""
#: More than there are calls.
NEVER = 1000


def running(group: int) -> list[str]:
    """The processes of a group that have not ended."""
    found = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            state, _, of, *_ = file.read_text().rpartition(")")[2].split()
            if int(of) == group and state != "Z":
                found.append(file.read_text())
    return found


class Tree:
    def __init__(self, folder: Path) -> None:
        self.folder = folder / "a tree"
        (self.folder / "tools").mkdir(parents=True)
        (self.folder / "host" / "hexatorque").mkdir(parents=True)
        shutil.copy(ROOT / "tools" / "setup.sh", self.folder / "tools")
        shutil.copy(ROOT / "pyproject.toml", self.folder)
        self.python = folder / "python"
        self.python.write_text(PYTHON)
        self.python.chmod(0o755)
        self.calls = folder / "calls"
        self.venv = self.folder / "venv"

    def set_up(self, stop_at: int = NEVER, by: signal.Signals = signal.SIGINT) -> bool:
        """Whether it has not been stopped."""
        for file in self.calls.parent.glob("calls*"):
            file.unlink()
        temporary = self.calls.parent / "temporary"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        process = subprocess.Popen(
            ["tools/setup.sh", "venv"],
            cwd=self.folder,
            env=os.environ
            | {"PYTHON": str(self.python), "CALLS": str(self.calls), "STOP_AT": str(stop_at)}
            | {"TMPDIR": str(temporary)},
            start_new_session=True,  # a group of its own, as in a terminal
            # These tests may run in the background, where SIGINT is ignored.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        stopped = Path(f"{self.calls}.stopped")
        while process.poll() is None and not stopped.exists():
            time.sleep(0.005)
        if stopped.exists():
            os.killpg(process.pid, by)
        process.communicate()
        assert by == signal.SIGKILL or not running(process.pid)
        assert by == signal.SIGKILL or not [*temporary.iterdir()]
        assert stopped.exists() or process.returncode == 0
        return not stopped.exists()

    def found(self) -> set[str]:
        files = self.venv.rglob("*")
        return {str(file.relative_to(self.folder)) for file in files if file.is_file()}


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGKILL], ids=lambda by: by.name)
@pytest.mark.parametrize("whole_before", [False, True])
def test_an_interrupted_set_up_is_made_again(tmp_path, whole_before, by):
    whole = Tree(tmp_path / "whole")
    assert whole.set_up()
    want = whole.found()
    assert {"venv/bin/activate", "venv/lib/compiled", "venv/.installed"} <= want
    assert len(want) == 6  # and Python, hexatorque, the extras
    for number in range(1, NEVER):
        tree = Tree(tmp_path / str(number))
        if whole_before:
            assert tree.set_up()
        if tree.set_up(number, by):
            break
        begun = tree.folder / "venv.half"
        assert begun.exists() or tree.found() == (want if whole_before else set())
        assert not (begun.exists() and (tree.venv / ".installed").exists())  # make would not ask
        assert tree.set_up()
        assert tree.found() == want and not begun.exists(), f"stopped at call {number}"
    assert number > 8


def test_a_long_step_says_for_how_long_already(tmp_path):
    """Here three seconds are one step of `sleep` that waits for nothing, and the step is long: it
    ends when three lines of it have been read."""
    tree = Tree(tmp_path)
    programs = tmp_path / "programs"
    programs.mkdir()
    go_on = tmp_path / "go on"
    slow = f'until [ -e "{go_on}" ]; do /bin/sleep 0.01; done'
    case = 'case "$*" in\n'
    tree.python.write_text(PYTHON.replace(case, f"{case}*install*) {slow} ;;\nesac\n{case}", 1))
    (programs / "sleep").write_text("#!/bin/sh\nexec /bin/sleep 0.01\n")
    (programs / "sleep").chmod(0o755)
    environment = os.environ | {
        "PATH": f"{programs}:{os.environ['PATH']}", "PYTHON": str(tree.python),
        "CALLS": str(tree.calls), "STOP_AT": str(NEVER),
    }  # fmt: skip
    with subprocess.Popen(
        ["tools/setup.sh", "venv"], cwd=tree.folder, env=environment, text=True,
        stdout=subprocess.PIPE, start_new_session=True,
    ) as process:  # fmt: skip
        lines = [process.stdout.readline() for _ in range(4)]
        go_on.touch()
        process.communicate()
    assert process.returncode == 0 and not running(process.pid)
    text = "hexatorque set-up: installing into venv"
    assert lines == [f"{text}\n", *(f"{text} ... {n} s\n" for n in (3, 6, 9))]


#: What pip 23 to 25 say last on the way to either failure, and what set-up makes of it.
COMPILER = (
    "  cc: internal compiler error: Segmentation fault\n"
    "  ERROR: Failed building wheel for hexatorque"
)
NETWORK = (
    "ERROR: Could not find a version that satisfies the requirement scikit-build-core\n"
    "ERROR: No matching distribution found for scikit-build-core"
)


@pytest.mark.parametrize(
    ("said", "blamed", "spared"),
    [
        (COMPILER, "hexatorque could not be built", "network"),
        (NETWORK, "Is there a network?", "compiler"),
    ],
    ids=["compiler", "network"],
)
def test_a_failing_compiler_is_not_taken_for_a_failing_network(tmp_path, said, blamed, spared):
    tree = Tree(tmp_path)
    message = tmp_path / "message"
    message.write_text(f"{said}\n")
    case = 'case "$*" in\n'
    fails = f'*"uv pip install"*) exit 1 ;;\n*"pip install"*) cat "{message}" >&2; exit 1 ;;\n'
    tree.python.write_text(PYTHON.replace(case, f"{case}{fails}", 1))
    done = subprocess.run(
        ["tools/setup.sh", "venv"], cwd=tree.folder, text=True, capture_output=True,
        env=os.environ
        | {"PYTHON": str(tree.python), "CALLS": str(tree.calls), "STOP_AT": str(NEVER)},
    )  # fmt: skip
    assert done.returncode == 1
    assert said in done.stderr  # the user sees the reason too
    verdict = done.stderr.splitlines()[-1]
    assert blamed in verdict and spared not in verdict
