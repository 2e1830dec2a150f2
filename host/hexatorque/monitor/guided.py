"""The commissioning under the monitor: step by step, each one when a user says so.

`commissioning.sequence` does the work, in a thread. It commands the drive through `Stoppable`,
which starts nothing any more once it was halted.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any, cast

from ..commissioning.excitation import CommissioningError, Limits
from ..commissioning.kinds import kind_of
from ..commissioning.pictures import pictures
from ..commissioning.plans import plan
from ..commissioning.regression import Value
from ..commissioning.result import Findings, set_up_of_board
from ..commissioning.sequence import commission, default_current_A
from ..drive.board import BoardDrive
from ..drive.interface import DriveVerbs
from ..errors import HexatorqueError
from ..recording.recording import Recording
from ..serial import LinkError


class Stoppable:
    """A drive that can be halted from another thread. After that it neither starts nor waits nor
    captures: the work in hand ends with an error. What puts an end to it still works."""

    def __init__(self, drive: DriveVerbs) -> None:
        self._drive = drive
        self.halted = ""  #: why
        #: Held while a START is under way, so that a STOP comes after it.
        self.starting = threading.Lock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._drive, name)

    def check_halt(self, *_: object) -> None:
        if self.halted:
            raise CommissioningError(self.halted)

    def start(self) -> None:
        with self.starting:
            self.check_halt()
            self._drive.start()

    def run(self, duration_s: float, record: bool = True) -> None:
        self.check_halt()
        self._drive.run(duration_s, record, self.check_halt)

    def arm(self, *arguments: Any) -> None:
        self.check_halt()
        self._drive.arm(*arguments)

    def captured(self, *arguments: Any, **named: Any) -> Recording:
        self.check_halt()
        return self._drive.captured(*arguments, **named)

    def check(self) -> None:
        self.check_halt()
        self._drive.check()

    capture = DriveVerbs.capture


class Guided:
    """One commissioning. `state` is `asking` (the gates are off, and it waits for `go_on`),
    `measuring`, or in the end `done`, `mistakes` (of the wiring), `stopped` or `failed`.

    choices: of `commissioning.choices`; changed: called whenever a page has something new to show.
    """

    def __init__(
        self,
        drive: DriveVerbs,
        steps: Sequence[str],
        current_A: float | None,
        choices: dict[str, float],
        changed: Callable[[], None],
    ) -> None:
        self.stoppable = Stoppable(drive)
        self.drive = cast(DriveVerbs, self.stoppable)
        self.steps = kind_of(drive).with_needs(steps)
        self.state = "measuring"
        self.found: Findings | None = None
        self.written = False
        self._shown: dict[str, Any] = {}  # step -> what a page shows of it
        self._problems: list[str] = []
        self._before: dict[str, object] = {}  # parameter -> what was in force
        self._known: dict[str, Value] = {}  # parameter -> what was measured
        self._step = ""  # the one in hand
        self._run_on = False
        self._choices, self._changed = (current_A, choices), changed
        self._go = threading.Event()
        self._thread = threading.Thread(target=self._run, name="commissioning", daemon=True)
        self._thread.start()

    @property
    def active(self) -> bool:
        return self.state in ("asking", "measuring")

    def go_on(self, step: str, run_on: bool) -> None:
        """The user has read what this step does. `run_on`: the steps after it begin by themselves.
        LinkError if another one is next."""
        if self.state != "asking" or step != self._step:
            raise LinkError(f"commissioning: {step} is not the step that waits", mistake=True)
        self._run_on = run_on
        self._tell("measuring")
        self._go.set()

    def halt(self, why: str) -> None:
        """Start nothing more. The caller stops the drive after this."""
        self.stoppable.halted = self.stoppable.halted or why
        self._go.set()
        with self.stoppable.starting:
            pass  # a START that was under way is over, and no other one follows

    def join(self) -> None:
        self._thread.join()

    def _tell(self, state: str) -> None:
        self.state = state
        self._changed()

    # -- the thread ------------------------------------------------------------------------

    def _run(self) -> None:
        state = "failed"
        try:
            current_A, choices = self._choices
            if current_A is None:
                current_A = default_current_A(self.drive)
            limits = Limits(current_A, choices["travel"], choices["speed"])
            found = commission(
                self.drive, limits, self.steps, choices["turns"], self._report, keep=False,
                begin=lambda step: self._begin(step, limits), end=self._end, pause=True,
            )  # fmt: skip
            self._problems = found.mistakes
            state = "mistakes" if found.mistakes else "done"
        except HexatorqueError as error:
            state = "stopped" if self.stoppable.halted else "failed"
            self._problems = (self.stoppable.halted or str(error)).splitlines()
        except Exception as error:  # the page has to say that nothing goes on
            self._problems = [f"{type(error).__name__}: {error}"]
            raise
        finally:
            self._tell(state)

    def _begin(self, step: str, limits: Limits) -> None:
        self._step = step
        words = plan(self.drive, limits, step, self._choices[1]["turns"])
        self._shown[step] = {"plan": words._asdict(), "lines": [], "values": [], "pictures": []}
        if not self._run_on or step in kind_of(self.drive).asks:
            self._go.clear()
            self._tell("asking")
            self.stoppable.check_halt()
            self._go.wait()
        self._changed()
        self.stoppable.check_halt()

    def _report(self, line: str) -> None:
        self._shown[self._step]["lines"].append(line)
        self._changed()

    def _end(self, step: str, found: Findings) -> None:
        self.found = found
        now = {} if found.mistakes else found.parameters(self.drive)
        for name in now.keys() - self._before.keys():
            self._before[name] = self.drive.get(name)
        self._shown[step] |= {
            "values": self._rows({k: v for k, v in now.items() if v != self._known.get(k)}),
            "pictures": [one._asdict() for one in pictures(step, found)],
        }
        self._known = now
        self._changed()

    def _rows(self, values: dict[str, Value]) -> list[dict]:
        """The measured values beside those that were in force before."""
        return [
            {
                "name": name, "unit": self.drive.params[name].unit, "value": value.value,
                "uncertainty": value.uncertainty, "before": self._before[name],
            }
            for name, value in values.items()
        ]  # fmt: skip

    # -- for the page ----------------------------------------------------------------------

    def _usable(self) -> Findings | None:
        """The findings at its end; None if the wiring is wrong."""
        return None if self.active or not self.found or self.found.mistakes else self.found

    def described(self) -> dict:
        found = self._usable()
        return {
            "state": self.state, "step": self._step, "problems": self._problems,
            "steps": [{"name": name, **self._shown.get(name, {})} for name in self.steps],
            "values": self._rows(self._known) if found else [],
            "setup": bool(found and found.whole()), "written": self.written,
        }  # fmt: skip

    def write(self) -> None:
        """Write the parameters that follow from the steps that have ended, all or none."""
        found = self._usable()
        if not found or not self._known:
            raise LinkError("commissioning: there is nothing to write", mistake=True)
        found.load(self.drive)
        self.written = True
        self._changed()

    def setup_text(self) -> str:
        """A set-up with the measured values, as `board commission --out` writes it."""
        found = self._usable()
        if not found or not found.whole():
            step = kind_of(self.drive).whole
            raise LinkError(f"commissioning: a set-up needs the step {step} at least", mistake=True)
        return set_up_of_board(found, cast(BoardDrive, self.drive))
