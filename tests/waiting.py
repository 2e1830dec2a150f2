"""Waiting for another process, on however busy a computer, or until a simulated drive runs or has
ended its start."""

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")

#: So long only because what does not come must end a test at last.
WAIT_S = 60.0


def until(condition: Callable[[], Found]) -> Found:
    """Wait until the condition is true. Returns its value."""
    end = time.monotonic() + WAIT_S
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {WAIT_S:g} s"
        time.sleep(0.01)
    return found


def alive(pid: int) -> bool:
    """Whether the process runs; a process that has ended but was not waited for does not."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def until_it_runs(sim) -> None:
    """Start a simulated drive, and go on until it is in RUN."""
    sim.start()
    while sim.state in ("calibrate", "build"):
        sim.run(0.05, record=False)
    assert sim.state == "run", sim.faults


def started(drive):
    """Start a simulated drive, and go on until its start has ended, well or not."""
    drive.start()
    while drive.state in ("calibrate", "build"):
        drive.run(drive.period_s * 10, record=False)
    return drive
