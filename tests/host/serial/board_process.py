"""A virtual board in a process of its own, as a user would have it. Its load stops the
machine quickly, so that it can be started again."""

import os
import signal
from pathlib import Path

from forked import Forked

#: Paper A's machine, quick to build its flux, braked in proportion to its speed.
CHANGES = {
    "timing__device": "f28377s",
    "controller__build_s": 0.05,
    "controller__build_current_A": 20.0,
    "load__kind": "generator",
    "load__at_rpm": 100.0,
}
LOAD_NM = 3.0
BOARD = f"""
import sys
from hexatorque import setups
from hexatorque.boards.virtual import Terminal, VirtualBoard, serve
board = VirtualBoard(setups.load("paper-a-feasible").changed(**{CHANGES}))
board.sim.set("load_Nm", {LOAD_NM})
with Terminal() as line:
    print(line.port, flush=True)
    serve(board, line, until=lambda: False)
"""


class Process:
    """A virtual board that can be unplugged: a process, and the name by which it is known."""

    def __init__(self, link: Path) -> None:
        self.url = str(link)
        self._process: Forked | None = None
        self.plug()

    def plug(self) -> None:
        self._process = Forked(["-c", BOARD])
        port = self._process.stdout.readline().strip()
        assert port.startswith("/dev/pts/")
        os.symlink(port, self.url)

    def rest(self) -> None:
        """Stand still: a board that no test uses would need a tenth of a processor."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._process.send_signal(signal.SIGCONT)

    def unplug(self) -> None:
        os.unlink(self.url)
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()
        self._process.stdout.close()
