"""Progress of a command: its step, how far it is, and for how long already."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

#: What is no terminal gets a line if a piece of work lasts longer than the first time, and another
#: one each time that the second has passed. A work of more than a minute gets fewer lines: the next
#: one comes after this share of the time so far.
FIRST_S, AGAIN_S, SHARE = 2.5, 3.0, 0.05
SIMULATED = "s simulated"
TELLER = "says what is done"


class Work:
    """One piece of work after another: `begin` names the next, `advance` tells how far it is."""

    def __init__(self, bar: Progress | None) -> None:
        self._bar = bar
        self._lock = threading.Lock()
        self._text, self._done, self._unit = "", 0.0, ""
        self._total: float | None = None
        self._task: TaskID | None = None
        self.changed = threading.Event()

    def begin(self, text: str, total: float | None = None, unit: str = SIMULATED) -> None:
        """total: the sum of all calls of `advance`, if that is known."""
        with self._lock:
            self._text, self._done, self._total, self._unit = text, 0.0, total, unit
        self.changed.set()
        if self._bar is not None:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(text, total=total, how_far="")

    def call(self, text: str) -> None:
        """Another text for the work under way."""
        with self._lock:
            self._text = text
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description=text)

    def advance(self, amount: float = 1.0) -> None:
        with self._lock:
            self._done += amount
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, advance=amount, how_far=self._how_far())

    def _how_far(self) -> str:
        if not self._done:
            return ""
        if self._unit == SIMULATED:
            expected = self._total if self._total and self._done <= self._total else None
            of = f" of about {expected:.0f}" if expected else ""
            return f"{self._done:.1f}{of} {SIMULATED}"
        return f"{self._done:.0f} of {self._total:.0f} {self._unit}"

    def __str__(self) -> str:
        with self._lock:
            far = self._how_far()
            return f"{self._text} ... {far}".rstrip()


@contextmanager
def working(
    console: Console, text: str, total: float | None = None, unit: str = SIMULATED
) -> Iterator[Work]:
    """A line that is kept up to date while this block runs, on a terminal. Elsewhere plain lines on
    standard error, for work that takes some seconds. Beside JSON that is no terminal: nothing."""
    with ExitStack() as shown:
        work = Work(shown.enter_context(_bar(console)) if console.is_terminal else None)
        work.begin(text, total, unit)
        if not console.is_terminal and not console.stderr:
            shown.enter_context(_lines(work))
        yield work


def _bar(console: Console) -> Progress:
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[how_far]}"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )


@contextmanager
def _lines(work: Work) -> Iterator[None]:
    ended = False

    def tell() -> None:
        while True:
            work.changed.clear()
            if ended:  # asked after `clear`, which may have taken the last `set` away
                return
            begin_s, wait_s = time.monotonic(), FIRST_S
            while not work.changed.wait(wait_s):
                print(work, file=sys.stderr, flush=True)
                wait_s = max(AGAIN_S, SHARE * (time.monotonic() - begin_s))

    teller = threading.Thread(target=tell, name=TELLER, daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended = True
        work.changed.set()
        teller.join()


@contextmanager
def compiling() -> Iterator[None]:
    """Say so on standard error while the simulation is compiled in this block."""
    from rich.console import Console

    from ..drive.compiling import COMPILING, watched

    console, shown = Console(stderr=True), ExitStack()

    def begun() -> None:
        if console.is_terminal:
            shown.enter_context(working(console, COMPILING))
        else:
            print(COMPILING, file=sys.stderr, flush=True)

    with shown, watched(begun, shown.close):
        yield


def compile_now() -> None:
    """Before a command simulates: compile what has to be compiled, and say so."""
    from ..drive.simulated import compile_now

    with compiling():
        compile_now()
