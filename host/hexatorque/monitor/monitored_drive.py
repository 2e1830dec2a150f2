"""One drive under the monitor, with its traces, captures and commissioning.

All pages share this object. The client's thread puts samples into an unbounded queue. A thread
here moves them into a ring of limited size (`traces`). Each page reads the ring when it is ready to
draw, so a slow page cannot delay the line.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from pathlib import Path

from ..commissioning.choices import CHOICES
from ..commissioning.sequence import STEPS
from ..drive import parameter_sets
from ..drive.board import BoardDrive, parameter_set
from ..drive.parameter_sets import ParameterSetError, Values
from ..firmware import FAULT, IDLE, Snapshot, State
from ..serial import LinkError
from ..serial.client import HEARTBEAT_S, Stopped
from . import described
from .captures import Captures
from .deadman import HIDDEN_S, SILENT_S, DeadMan
from .guided import Guided
from .traces import FRESH_S, HISTORY_S, Traces

#: A page gets no samples while its latest answer is older than this.
BEHIND_S = 0.5
#: STOP is repeated for this long if it fails.
STOP_S = 1.0
#: Intervals at which samples are moved into the ring, and at which parameters are read (another
#: client may change them).
MOVE_S, PARAMETERS_S = 0.02, 1.0
#: Samples per second unless the page asks for more. This leaves room on the line.
RATE_HZ = 2000.0
#: Channels that are traced at first, if the board has them.
CHANNELS = (
    "speed_rpm", "torque_ref_Nm", "torque_Nm", "i_u1_A", "i_u2_A", "psi_alpha_Wb",
    "psi_beta_Wb", "vdc_V",
)  # fmt: skip
#: Larger than every float32.
FLOAT32 = 3.5e38


class MonitoredDrive:
    """Traces, captures, records and commands one drive. `close` stops the drive if it was started
    here. It does not close the `BoardDrive`. `say` gets each event that no page asked for, such as
    a stop by the dead man."""

    def __init__(
        self,
        drive: BoardDrive,
        folder: Path,
        silent_s: float = SILENT_S,
        hidden_s: float = HIDDEN_S,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self.drive = drive
        self._say = say
        self.dead_man = DeadMan(silent_s, hidden_s)
        self.values: dict[str, str | float] = {}
        self.values_version = 0
        self.snapshot: Snapshot | None = None
        self.snapshot_version = 0
        self.limits: dict[str, float] = {}  #: that act, and since when, in this computer's seconds
        self.notice = ""  #: an event that no page asked for, such as an automatic stop
        self.reset = ""  #: what a reset of the board has changed, until a user has read it
        self.guided: Guided | None = None  #: the latest commissioning
        self.guided_version = 0
        self._pages: dict[int, float] = {}  # page -> when the frame was sent that it last answered
        self._page = 0  # number of the newest page
        self._told: Stopped | None = None  # the stop that `notice` was about
        self._was_reset = threading.Event()
        self._closing = threading.Event()
        self._refresh = threading.Event()
        self._lock = threading.RLock()  # of pages and commissioning; held only briefly
        self.traces = Traces(drive, folder, self._tell)
        self.captures = Captures(drive, self._closing)
        names = [name for name, _ in drive.channels]
        wanted = [name for name in CHANNELS if name in names] or names[:4]
        try:
            self.traces.select(wanted[: drive.hello.stream_channels], RATE_HZ)
        except LinkError as error:  # other clients use the line; a page can try again later
            if not error.mistake:
                raise
            self.notice = str(error)
        self._read_values()
        self._read_snapshot()
        drive.on_reset.append(self._reset_happened)
        self._threads = [
            threading.Thread(target=self._move, name="samples", daemon=True),
            threading.Thread(target=self._watch, name="watch", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> MonitoredDrive:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._closing.set()
        if self._reset_happened in self.drive.on_reset:
            self.drive.on_reset.remove(self._reset_happened)
        with contextlib.suppress(LinkError):
            if self.dead_man.watches or self._commissioning():
                self.stop("the monitor has ended")
            if self.guided:
                self.guided.join()
        for thread in self._threads:
            thread.join()
        self.traces.close()

    def _tell(self, text: str) -> None:
        self.notice = text
        if self._say:
            self._say(text)

    def _tell_of_stop(self, text: str) -> None:
        self.traces.note_stop(text)
        self._tell(text)

    def _move(self) -> None:
        """The thread that moves samples."""
        while not self._closing.wait(MOVE_S):
            self.traces.move()

    # -- data for the pages --------------------------------------------------------------

    def device(self) -> dict:
        """The constant part: the board's identity and its dictionary."""
        hello, dictionary = self.drive.hello, self.drive.dictionary
        return {
            "device": hello.device,
            "build": hello.build,
            "minor": dictionary.minor,
            "port": self.drive.client.url,
            "baud": self.drive.client.transport.baud,
            "watchdog_ms": hello.watchdog_ms,
            "stream_channels": hello.stream_channels,
            "capture_channels": hello.capture_channels,
            "memory": hello.memory,
            "history_s": HISTORY_S,
            "silent_s": self.dead_man.silent_s,
            "hidden_s": self.dead_man.hidden_s,
            "fresh_s": FRESH_S,
            "steps": [{"name": name, "help": text} for name, text in STEPS.items()],
            "choices": {name: choice._asdict() for name, choice in CHOICES.items()},
            **described.tables(
                dictionary.parameters,
                dictionary.channels,
                dictionary.faults,
                [state.name for state in dictionary.states],
            ),
        }

    def status(self) -> dict:
        """The part that changes. This sends no request: every reply and the heartbeat carry these
        data."""
        client, ring, stream = self.drive.client, self.traces.ring, self.traces.stream
        latest, board, state = client.latest, client.status, self._state()
        ticks = ring.boards_end * stream.decimation if ring and stream else 0
        return {
            **self.traces.status(),
            "state": state.name if state else "",
            "may_start": state is not None and state.name == IDLE,
            "may_clear": state is not None and state.name == FAULT,
            "working": self.working(),
            "faults": self.drive.dictionary.causes(client.faults),
            "limits": [
                {"name": name, "for_s": time.monotonic() - since_s}
                for name, since_s in self.limits.items()
            ],
            "time_s": (ticks or (latest.tick if latest else 0)) / self.drive.hello.f_isr_Hz,
            "plugged": client.transport.plugged,
            "broken": str(client.broken) if client.broken else "",
            "notice": self.notice,
            "reset": self.reset,
            "resets": self.drive.resets,
            "stops_in_s": self.dead_man.stops_in_s(time.monotonic()) if self.working() else None,
            "pages": len(self._pages),
            "f_isr_Hz": self.drive.hello.f_isr_Hz,
            "damaged": client.damaged + (stream.damaged if stream else 0),
            "retries": client.counters.retries,
            "reconnects": client.counters.reconnects,
            "board_damaged": board.damaged if board else 0,
            "board_overruns": board.overruns if board else 0,
            "board_dropped": board.dropped if board else 0,
            "guarded": board.guarded if board else False,
            "values": self.values_version,
            "snapshot": self.snapshot_version,
            "capture": self.captures.number,
            "capture_state": self.captures.text,
            "commissioning": self.guided_version,
        }

    def _state(self) -> State | None:
        """The board's state in its latest reply; None before the first one."""
        latest = self.drive.client.latest
        return self.drive.client.state(latest.state) if latest else None

    def working(self) -> bool:
        """Whether the gates may be on, or may go on without another command."""
        state = self._state()
        measuring = self.guided is not None and self.guided.state == "measuring"
        return measuring or (state is not None and state.at_work)

    # -- pages come and go -----------------------------------------------------------------

    def add_page(self) -> int:
        """Register a new page. Returns its number."""
        with self._lock:
            self._page += 1
            self._pages[self._page] = time.monotonic()
            return self._page

    def remove_page(self, page: int) -> None:
        with self._lock:
            del self._pages[page]

    def page_is_behind(self, page: int) -> bool:
        """Whether the page answers late. It then gets no samples until it has caught up."""
        return time.monotonic() - self._pages[page] > BEHIND_S

    def page_answered(self, page: int, sent_s: float, visible: bool) -> None:
        """The page has shown the frame that was sent at `sent_s` of this computer's monotonic
        clock. The time of the frame counts, not the time of the answer, so an answer that was
        delayed does not keep the drive running."""
        sent_s = min(sent_s, time.monotonic())
        with self._lock:
            if page in self._pages:  # otherwise the page has opened a new connection
                self._pages[page] = max(self._pages[page], sent_s)
        self.dead_man.answered(sent_s, visible)

    # -- commands --------------------------------------------------------------------------

    def start(self) -> None:
        self._not_while_commissioning("start")
        self.notice = ""
        self.drive.start()
        self.dead_man.started(time.monotonic())
        self._refresh.set()

    def stop(self, why: str = "stopped by the user") -> None:
        """Stop the drive. If that fails it is repeated for `STOP_S`: STOP must get through."""
        self._halt(why)
        end = time.monotonic() + STOP_S
        while True:
            try:
                self.drive.stop()
                break
            except LinkError:
                if time.monotonic() > end or not self.drive.client.transport.plugged:
                    raise
        self.dead_man.ended()
        if self._commissioning():
            with contextlib.suppress(LinkError):
                self.drive.cancel()  # nothing waits for a capture any more
        self._refresh.set()

    def clear(self) -> None:
        self.drive.clear()
        self.notice = ""
        self._refresh.set()

    def write(self, values: dict[str, object]) -> dict[str, str | float]:
        """Write several parameters in one fast interrupt, or none. Returns the values that are
        then in force."""
        self._not_while_commissioning("write")
        for name, value in values.items():
            if isinstance(value, (int, float)) and not -FLOAT32 < value < FLOAT32:
                raise LinkError(f"{name}: a finite number is needed", mistake=True)
        if "f_isr_Hz" in values:
            with self.traces.stopped():
                self.drive.set_many(values)
        else:
            self.drive.set_many(values)
        now = self.drive.get_many(list(values))
        self._refresh.set()
        return now

    # -- sets of parameters ------------------------------------------------------------------

    def read_set(self, text: str, file: str) -> dict[str, str | float]:
        """The values in the text of a file, as this board would show them. ParameterSetError with
        a line for each value that it cannot take."""
        values = parameter_sets.read(text, file)
        if values is None:
            raise ParameterSetError(
                f"{file}: a set-up, not a set of parameters: hexatorque board params load --setup"
            )
        rows = self.drive.params
        try:
            parameter_sets.numbers_of(values, rows)
        except ParameterSetError as error:
            lines = [f"{file}: {line}" for line in str(error).splitlines()]
            raise ParameterSetError("\n".join(lines)) from None
        return {name: rows[name].show(rows[name].parse(value)) for name, value in values.items()}

    def difference(self, others: Values) -> dict[str, tuple[object, object]]:
        """The parameters whose values differ from others: what is in force, and the other one."""
        rows = self.drive.params
        return parameter_sets.difference(self.drive.get_many(list(others)), others, rows)

    def keep(self) -> None:
        """The board saves its parameters. Its traces pause meanwhile."""
        self._not_while_commissioning("keep the parameters")
        with self.traces.stopped():
            self.drive.store_parameters()

    def forget(self) -> None:
        self._not_while_commissioning("forget the parameters")
        with self.traces.stopped():
            self.drive.forget_parameters()

    # -- commissioning -----------------------------------------------------------------------

    def _commissioning(self) -> bool:
        return self.guided is not None and self.guided.active

    def _not_while_commissioning(self, what: str) -> None:
        if self._commissioning():
            raise LinkError(f"{what}: a commissioning is under way; stop it first")

    def _halt(self, why: str) -> None:
        if self.guided and self.guided.active:
            self.guided.halt(why)

    def commission(
        self, steps: list[str], current_A: float | None, choices: dict[str, float]
    ) -> None:
        """Begin to commission the drive. It asks before each step."""
        with self._lock:
            self._not_while_commissioning("commission")
            if self.captures.under_way:
                raise LinkError("commission: cancel the capture first")
            self.notice = ""
            self.dead_man.started(time.monotonic())
            self.guided = Guided(self.drive, steps, current_A, choices, self._guided_changed)

    def arm(
        self, channels: list[str], samples: int, pre: int, trigger: str, prescaler: int
    ) -> None:
        """Arm a capture (`Captures.arm`), unless a commissioning makes its own."""
        with self._lock:
            self._not_while_commissioning("capture")
            self.captures.arm(channels, samples, pre, trigger, prescaler)

    def _guided_changed(self) -> None:
        self.guided_version += 1
        self._refresh.set()

    def commissioned(self) -> Guided:
        """The latest commissioning."""
        if self.guided is None:
            raise LinkError("commissioning: none has begun", mistake=True)
        return self.guided

    def go_on(self, step: str, run_on: bool) -> None:
        """Begin the step that was asked for. From now on pages have to watch."""
        self.commissioned().go_on(step, run_on)
        self.dead_man.started(time.monotonic())

    # -- the watch -----------------------------------------------------------------------------

    def _watch(self) -> None:
        """The thread that reads what may have changed, and stops a drive that nobody watches."""
        read_s, shown = 0.0, self._fault()
        while not self._closing.is_set():
            due = self._refresh.wait(HEARTBEAT_S)
            self._refresh.clear()
            try:
                if not self.drive.client.in_session:
                    self.drive.client.get_status()
                self._stop_if_unwatched()
                self._tell_of_silence()
                if self._was_reset.is_set():
                    self._was_reset.clear()
                    try:
                        self._after_reset()
                    except LinkError:
                        self._was_reset.set()  # try again
                        raise
                if due or time.monotonic() - read_s > PARAMETERS_S:
                    self._read_values()
                    self._read_limits()
                    read_s = time.monotonic()
                if (fault := self._fault()) != shown:
                    if fault[0]:
                        self._read_snapshot()
                    shown = fault
            except LinkError:
                # The page shows that the line is down. The watchdog stops the drive.
                self._closing.wait(HEARTBEAT_S)

    def _stop_if_unwatched(self) -> None:
        reason = self.dead_man.reason(time.monotonic(), self.working(), bool(self._pages))
        if not reason:
            return
        self.stop(reason)
        latest = self.drive.client.latest
        at = f" at tick {latest.tick}" if latest else ""
        self._tell_of_stop(f"stopped{at}: {reason}")

    def _tell_of_silence(self) -> None:
        """The drive was stopped because the monitor itself did not run for a while."""
        stopped = self.drive.stopped
        if stopped and stopped is not self._told:
            self._told = stopped
            self.dead_man.ended()
            text = f"stopped at tick {stopped.tick}: {stopped.why('the monitor')}"
            self._tell_of_stop(text)
            self._halt(text)

    # -- a reset of the board ------------------------------------------------------------------

    def _reset_happened(self) -> None:
        """Called in a thread of the client. `_watch` does the work."""
        self._halt("the board was reset")
        self._was_reset.set()
        self._refresh.set()

    def reset_seen(self) -> None:
        self.reset = ""

    def _after_reset(self) -> None:
        """Show the reset, restart the traces, and read parameters and snapshot again. After a
        LinkError it must be called again."""
        self.dead_man.ended()  # the reset has switched the drive off
        set_in_force = self.drive.client.get_status().set
        reset = self.drive.reset
        cause = f" Cause: {reset.cause}." if reset else ""
        self.reset = f"The board was reset. Its parameters: {parameter_set(set_in_force)}.{cause}"
        self.traces.end_recording("board reset")
        self.traces.restart()
        self._read_values()
        self._read_snapshot()

    def _fault(self) -> tuple[bool, int]:
        latest, state = self.drive.client.latest, self._state()
        if latest is None or state is None:
            return False, 0
        return state.name == FAULT, self.drive.client.faults

    def _read_values(self) -> None:
        values = self.drive.get_all()
        if values != self.values:
            self.values = values
            self.values_version += 1

    def _read_limits(self) -> None:
        now_s = time.monotonic()
        found = (self.working() and self.drive.limits) or {}
        self.limits = {name: now_s - for_s for name, for_s in found.items()}

    def log(self) -> dict | None:
        """The board's log; None: it has none."""
        found = self.drive.log
        return found.as_json() if found else None

    def _read_snapshot(self) -> None:
        self.snapshot = self.drive.snapshot
        self.snapshot_version += 1
