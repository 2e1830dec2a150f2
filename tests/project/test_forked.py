"""A forked process is like one that the interpreter has started (`forked`)."""

import os
import signal
import subprocess
import sys

import pytest
from forked import Forked

SHOW = "import os, sys; print(__name__, sys.argv, os.getcwd(), os.environ['WORD'], input())"


def test_arguments_environment_folder_and_streams(tmp_path):
    environment = {**os.environ, "WORD": "here"}
    command = ["-c", SHOW, "a", "b c"]
    theirs = subprocess.run(
        [sys.executable, *command], input="said\n", env=environment, cwd=tmp_path,
        capture_output=True, text=True,
    )  # fmt: skip
    pipes = ("stdin", "stdout", "stderr")
    ours = Forked(command, pipes=pipes, env=environment, cwd=tmp_path)
    ours.stdin.write("said\n")
    assert ours.communicate(20) == (theirs.stdout, theirs.stderr) == ours.communicate()
    assert ours.returncode == theirs.returncode == 0


@pytest.mark.parametrize(
    ("program", "code", "says"),
    [
        ("import sys; sys.exit(3)", 3, ""),
        ("import sys; sys.exit('no')", 1, "no"),
        ("1 / 0", 1, "ZeroDivisionError: division by zero"),
        ("import atexit, sys; atexit.register(sys.stderr.write, 'ended')", 0, "ended"),
    ],
)
def test_its_end(program, code, says):
    process = Forked(["-c", program], pipes=("stderr",))
    assert process.communicate(20)[1].strip().endswith(says)
    assert process.returncode == code


INTERRUPTED = """
import time
try:
    print(flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("stopped")
"""


def test_signals():
    with Forked(["-c", "import time; print(flush=True); time.sleep(60)"]) as process:
        process.stdout.readline()
        assert process.poll() is None
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.01)
        process.kill()
        assert process.wait(20) == -signal.SIGKILL
    process = Forked(["-c", INTERRUPTED])
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    assert process.communicate(20)[0] == "stopped\n" and process.returncode == 0


def test_a_module_and_what_is_loaded():
    process = Forked(["-m", "hexatorque", "--version"])
    assert process.communicate(20)[0].startswith("hexatorque ")
    loaded = "import sys; print('hexatorque.plant.loop' in sys.modules)"
    assert Forked(["-c", loaded]).communicate(20)[0] == "True\n"
