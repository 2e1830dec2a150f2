"""Pages whose commands are run in their order, in an empty folder.

A comment before a block says what a test does with it:

    <!-- file: NAME -->        the block is the content of this file
    <!-- not run: REASON -->   a command that needs a browser, or installs
    <!-- stays: TEXT -->       a command that goes on; it is ready when it has printed TEXT
    <!-- picture: FILE -->     the picture that follows is this file

All other blocks of kind bash are run. A block of kind text is what the command before it
prints: each of its lines must be there. Equations (math) are not checked. HT_RENEW=1 writes the
pictures into docs/images.

A process takes one to two seconds of computing time before it begins. So only the page's first
command and those that use a board are processes. The other commands of hexatorque are called here.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import numpy as np

from hexatorque.cli.main import main

DOCS = Path(__file__).resolve().parents[2] / "docs"
#: A comment, if there is one, then a block or a picture.
PART = re.compile(
    r"(?:^<!-- (?P<what>[a-z ]+): (?P<detail>.*?) -->\n)?"
    r"^(?:```(?P<kind>\w+)\n(?P<text>.*?)^```$|!\[.*?\]\((?P<picture>\S+)\))",
    re.S | re.M,
)
READY_S = 60
#: A command in README's list, and what it says about it.
COMMAND = re.compile(r"^    (hexatorque .*?)(?:  +# (.*))?$", re.M)


class Terminals:
    """A shell in a folder, with what was left running in other terminals."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.staying: list[subprocess.Popen] = []
        self.printed = ""
        self.started = False
        import matplotlib  # here: every process of the tests imports this file

        run, cache = folder / "run", folder / "cache"  # no board or port server but ours
        run.mkdir(mode=0o700)
        cache.mkdir()
        bin_folder = Path(sys.executable).parent
        self.environment = {
            **os.environ,
            "PATH": f"{bin_folder}:{os.environ['PATH']}",
            "XDG_RUNTIME_DIR": str(run),
            "XDG_CACHE_HOME": str(cache),
            "MPLCONFIGDIR": matplotlib.get_cachedir(),  # its list of fonts takes seconds to make
            "COLUMNS": "120",
            "PYTHONUNBUFFERED": "1",
        }

    def run(self, command: str) -> None:
        words = shlex.split(command)
        uses_board = words[1] == "board" and words[2] != "compare"
        here = self.started and words[0] == "hexatorque" and not uses_board
        self.started |= words[0] == "hexatorque"
        if here:
            self.call(words[1:])
        else:
            self.start(command)

    def call(self, words: list[str]) -> None:
        """Run a command of hexatorque in this process."""
        output = io.StringIO()
        with (
            contextlib.chdir(self.folder),
            mock.patch.dict(os.environ, self.environment),
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(output),
        ):
            code = main(words)
        self.printed = output.getvalue()
        assert code == 0, f"hexatorque {shlex.join(words)}\n{self.printed}"

    def start(self, command: str) -> None:
        """Run a command as a shell does."""
        done = subprocess.run(
            ["bash", "-ec", command],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=300,
        )
        self.printed = done.stdout
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"

    def stay(self, command: str, ready: str) -> None:
        output = self.folder / f"terminal-{len(self.staying)}.txt"
        with output.open("w") as file:
            process = subprocess.Popen(
                command.split(), cwd=self.folder, env=self.environment, stdout=file, stderr=file
            )
        self.staying.append(process)
        end = time.monotonic() + READY_S
        while ready not in output.read_text():
            assert process.poll() is None, f"{command} has ended: {output.read_text()}"
            assert time.monotonic() < end, f"{command} said only: {output.read_text()}"
            time.sleep(0.1)

    def close(self) -> None:
        for process in reversed(self.staying):
            process.send_signal(signal.SIGINT)
        for process in self.staying:
            process.wait(30)


def readmes_commands() -> list[tuple[str, str]]:
    """Each command of README's list with its comment, in their order."""
    return COMMAND.findall((DOCS.parent / "README.md").read_text())


def plain(text: str) -> str:
    return " ".join(text.split())


def same_picture(drawn: Path, shown: Path) -> None:
    """Equal but for what another version of the drawing library does to letters."""
    from matplotlib import image

    a, b = image.imread(drawn)[..., :3], image.imread(shown)[..., :3]
    assert a.shape == b.shape, f"{shown.name}: {a.shape}, {b.shape}"
    assert np.mean(np.abs(a - b)) < 0.02, f"{shown.name} shows something else"


def follow(page: str, terminals: Terminals) -> None:
    """Run the page, and compare what it prints and draws."""
    unknown = set()
    for part in PART.finditer(page):
        what, detail, text = part["what"], part["detail"], part["text"]
        if what == "file":
            (terminals.folder / detail).write_text(text)
        elif what == "stays":
            terminals.stay(text.strip(), detail)
        elif what == "picture":
            drawn, shown = terminals.folder / detail, DOCS / part["picture"]
            if os.environ.get("HT_RENEW"):
                shutil.copyfile(drawn, shown)
            same_picture(drawn, shown)
        elif what == "not run":
            continue
        elif part["kind"] == "bash":
            for command in re.sub(r"\\\n", " ", text).splitlines():
                terminals.run(command)
        elif part["kind"] == "text":
            for line in text.splitlines():
                assert plain(line) in plain(terminals.printed), f"not printed: {line}"
        elif part["kind"] not in (None, "math"):
            unknown.add(part["kind"])
    assert not unknown, "blocks that nothing checks"
