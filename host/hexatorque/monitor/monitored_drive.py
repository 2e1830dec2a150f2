"""One drive under the monitor, with its traces, its capture and its recording.

All pages share this object. The client's thread puts samples into an unbounded queue. A thread
here moves them into a ring of limited size. Each page reads the ring when it is ready to draw,
so a slow page cannot delay the line.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..commissioning.choices import CHOICES
from ..commissioning.sequence import STEPS
from ..drive import limits, parameter_sets
from ..drive.board import BoardDrive, parameter_set
from ..drive.captures import TRIGGERS, Trigger
from ..drive.parameter_sets import ParameterSetError, Values
from ..drive.recorder import Recorder
from ..firmware import FAULT, IDLE, WARNINGS, Snapshot, State, grouped
from ..recording.formats import SUFFIXES, RecordingError
from ..recording.recording import Recording
from ..serial import LinkError, wire
from ..serial.client import HEARTBEAT_S, Stopped
from ..serial.stream import Stream
from .deadman import HIDDEN_S, SILENT_S, DeadMan
from .guided import Guided
from .traces import Ring

#: A page gets no samples while its latest answer is older than this.
BEHIND_S = 0.5
#: The newest sample is shown as a number only if it is not older than this.
FRESH_S = 1.0
#: The figures in the header are means over this time: a torque that is controlled by a comparator
#: jumps from sample to sample.
MEAN_S = 0.25
#: Width of the gap in the traces where the board was reset.
BREAK_S = 0.05
#: STOP is repeated for this long if it fails.
STOP_S = 1.0
#: Captures that are kept, and the largest number of their values.
CAPTURES, CAPTURES_VALUES = 12, 1 << 23
#: Attempts to upload a capture.
FETCH_TRIES = 5
#: Length of the history that pages can show, and its largest number of values.
HISTORY_S, HISTORY_VALUES = 60.0, 1 << 23
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


class Capture(NamedTuple):
    """trigger: as it was armed, such as `rising:state:1.5`."""

    number: int
    recording: Recording
    trigger: str

    @property
    def values(self) -> int:
        return len(self.recording) * len(self.recording.channels)

    def file(self, suffix: str) -> bytes:
        """As a file. `.json` is the file of metadata that belongs to `.csv`."""
        with tempfile.TemporaryDirectory() as folder:
            kind = ".csv" if suffix == ".json" else suffix
            path = self.recording.save(Path(folder) / f"capture{kind}")
            return path.with_suffix(suffix).read_bytes()


class MonitoredDrive:
    """Traces, captures, records and commands one drive. `close` stops the drive if it was started
    here. It does not close the `BoardDrive`."""

    def __init__(
        self,
        drive: BoardDrive,
        folder: Path,
        silent_s: float = SILENT_S,
        hidden_s: float = HIDDEN_S,
    ) -> None:
        self.drive = drive
        self.folder = folder
        self.dead_man = DeadMan(silent_s, hidden_s)
        #: Counts the choices of channels and rate, so that a page notices a new one.
        self.epoch = 0
        self.ring: Ring | None = None
        self.stream: Stream | None = None
        self.values: dict[str, str | float] = {}
        self.values_version = 0
        self.snapshot: Snapshot | None = None
        self.snapshot_version = 0
        self.captures: dict[int, Capture] = {}  #: the latest ones by their numbers, in order
        self.capture_number = 0  #: of the latest one
        self.notice = ""  #: an event that no page asked for, such as an automatic stop
        self.reset = ""  #: what a reset of the board has changed, until a user has read it
        self.guided: Guided | None = None  #: the latest commissioning
        self.guided_version = 0
        self._recorder: Recorder | None = None
        self._capture_text = ""
        self._trigger = ""  # of the capture that was armed last
        self._capture_wanted = 0  # number of the capture that was armed last
        self._pages: dict[int, float] = {}  # page -> when the frame was sent that it last answered
        self._page = 0  # number of the newest page
        self._pushed_s = -math.inf  # when the latest samples came
        self._told: Stopped | None = None  # the stop that `notice` was about
        self._was_reset = threading.Event()
        self._counted = (0, 0.0)
        self._rate_Hz = 0.0
        self._received = 0
        self._closing = threading.Event()
        self._refresh = threading.Event()
        self._lock = threading.RLock()  # for everything that pages change; held only briefly
        names = [name for name, _ in drive.channels]
        wanted = [name for name in CHANNELS if name in names] or names[:4]
        try:
            self.select(wanted[: drive.hello.stream_channels], RATE_HZ)
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
        with self._lock:
            try:
                if self._recorder:
                    self.record_stop()
            finally:
                if self.stream:
                    self.stream.close()

    # -- data for the pages --------------------------------------------------------------

    def device(self) -> dict:
        """What does not change: the board's identity and its dictionary."""
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
            "triggers": TRIGGERS,
            "steps": [{"name": name, "help": text} for name, text in STEPS.items()],
            "choices": {name: choice._asdict() for name, choice in CHOICES.items()},
            "states": [state.name for state in dictionary.states],
            "parameters": [
                {
                    "name": row.name, "unit": row.unit, "min": row.min, "max": row.max,
                    "initial": row.initial, "live": row.live, "choices": row.choices,
                    "whole": row.whole, "help": row.help,
                }
                for row in dictionary.parameters.values()
            ],
            "groups": [
                {"title": title, "names": names}
                for title, names in grouped(dictionary.parameters).items()
            ],
            "channels": [row._asdict() for row in dictionary.channels],
            "limits": [
                limit._asdict()
                for limit in limits.of_board(
                    dictionary.parameters, [row.name for row in dictionary.channels]
                )
            ],
            "faults": [row._asdict() for row in dictionary.faults],
            "warnings": [{"bit": bit, "name": text} for bit, text in WARNINGS.items()],
        }  # fmt: skip

    def status(self) -> dict:
        """What changes. This sends no request: every reply and the heartbeat carry these data."""
        client, stream = self.drive.client, self.stream
        latest, board, state = client.latest, client.status, self._state()
        ring = self.ring
        ticks = ring.boards_end * stream.decimation if ring and stream else 0
        return {
            "state": state.name if state else "",
            "may_start": state is not None and state.name == IDLE,
            "may_clear": state is not None and state.name == FAULT,
            "working": self.working(),
            "faults": self.drive.dictionary.causes(latest.faults) if latest else [],
            "time_s": (ticks or (latest.tick if latest else 0)) / self.drive.hello.f_isr_Hz,
            "plugged": client.transport.plugged,
            "broken": str(client.broken) if client.broken else "",
            "notice": self.notice,
            "reset": self.reset,
            "resets": self.drive.resets,
            "marks_s": [n / stream.rate_Hz for n in ring.marks] if ring and stream else [],
            "stops_in_s": self.dead_man.stops_in_s(time.monotonic()) if self.working() else None,
            "pages": len(self._pages),
            "channels": stream.channels if stream else (),
            "epoch": self.epoch,
            "f_isr_Hz": self.drive.hello.f_isr_Hz,
            "rate_Hz": stream.rate_Hz if stream else 0,
            "measured_Hz": self._rate_Hz,
            "gaps": stream.gaps if stream else 0,
            "lost": stream.lost if stream else 0,
            "damaged": client.damaged + (stream.damaged if stream else 0),
            "retries": client.counters.retries,
            "reconnects": client.counters.reconnects,
            "board_damaged": board.damaged if board else 0,
            "board_overruns": board.overruns if board else 0,
            "board_dropped": board.dropped if board else 0,
            "guarded": board.guarded if board else False,
            "values": self.values_version,
            "snapshot": self.snapshot_version,
            "capture": self.capture_number,
            "capture_state": self._capture_text,
            "commissioning": self.guided_version,
            "record": _recording_status(self._recorder) if self._recorder else None,
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
            with self._without_traces():
                self.drive.set_many(values)
        else:
            self.drive.set_many(values)
        now = self.drive.get_many(list(values))
        self._refresh.set()
        return now

    @contextlib.contextmanager
    def _without_traces(self) -> Iterator[None]:
        """Stop the traces, and start them again afterwards: the board changes the rate of its
        interrupts and writes its memory only while it streams nothing."""
        with self._lock:
            old = self.stream
            self.select([], None)
            try:
                yield
            finally:
                if old:
                    rate_Hz = min(old.rate_Hz, float(self.drive.get("f_isr_Hz")))
                    self.select(list(old.channels), rate_Hz)

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
        with self._without_traces():
            self.drive.store_parameters()

    def forget(self) -> None:
        self._not_while_commissioning("forget the parameters")
        with self._without_traces():
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
            if self._capture_text not in ("", "complete"):
                raise LinkError("commission: cancel the capture first")
            self.notice = ""
            self.dead_man.started(time.monotonic())
            self.guided = Guided(self.drive, steps, current_A, choices, self._guided_changed)

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

    # -- traces ------------------------------------------------------------------------------

    def select(self, channels: list[str], rate_Hz: float | None) -> None:
        """Trace these channels at `rate_Hz`, or as fast as the line allows if that is too fast
        or None. LinkError if a name is unknown or given twice, if there are too many, or while
        a recording runs."""
        with self._lock:
            if self._recorder:
                raise LinkError("channels: end the recording first", mistake=True)
            self.drive.dictionary.channel_ids(channels)
            if len(set(channels)) != len(channels):
                raise LinkError("channels: one is named twice", mistake=True)
            if len(channels) > (most := self.drive.hello.stream_channels):
                raise LinkError(f"{len(channels)} channels: up to {most}", mistake=True)
            old, self.stream, self.ring = self.stream, None, None
            self.epoch += 1
            if old:
                old.close()
            try:
                self._open(channels, rate_Hz)
            except LinkError:
                if old:
                    self._open(old.channels, old.rate_Hz)
                raise

    def _open(self, channels: list[str] | tuple[str, ...], rate_Hz: float | None) -> None:
        if not channels:
            return
        try:
            stream = self.drive.stream(channels, rate_Hz)
        except LinkError as error:
            if error.status != wire.Status.BUDGET:
                raise
            stream = self.drive.stream(channels)
        most = HISTORY_VALUES // len(channels)
        self.ring = Ring(len(channels), min(most, math.ceil(HISTORY_S * stream.rate_Hz)))
        self.stream = stream

    def traced(self) -> tuple[int, Ring, Stream] | None:
        """The epoch, the ring and the stream of the present traces; None without traces."""
        with self._lock:
            if self.ring is None or self.stream is None:
                return None
            return self.epoch, self.ring, self.stream

    def _move(self) -> None:
        """The thread that moves samples from the client's queue into the ring."""
        while not self._closing.wait(MOVE_S):
            with self._lock:
                if self.stream is None or self.ring is None:
                    continue
                try:
                    blocks = self.stream.waiting()
                except LinkError:  # it has ended: `_watch` opens another, or the page says why
                    continue
                if not blocks:
                    self._count(0)
                    continue
                ticks = np.concatenate([t for t, _ in blocks])
                values = np.concatenate([v for _, v in blocks])
                self.ring.push(ticks // self.stream.decimation, values)
                self._pushed_s = time.monotonic()
                self._count(len(ticks))
                if self._recorder:
                    try:
                        self._recorder.put(ticks, values)
                    except RecordingError as error:
                        recorder, self._recorder = self._recorder, None
                        self.notice = f"recording ended: {error}"
                        with contextlib.suppress(RecordingError):
                            recorder.writer.close(str(error))

    def newest(self) -> np.ndarray | None:
        """The newest sample, (channels,); None if it is older than `FRESH_S`."""
        ring = self.ring
        if ring is None or time.monotonic() - self._pushed_s > FRESH_S:
            return None
        return ring.newest()

    def mean(self) -> np.ndarray:
        """The mean of the latest `MEAN_S`, (channels,). NaN for a channel that has no newest value:
        its control does not run."""
        with self._lock:
            ring, stream = self.ring, self.stream
        if ring is None or stream is None or not ring.end:
            return np.empty(0)
        part = ring.part(ring.end - max(1, round(MEAN_S * stream.rate_Hz)), ring.end)
        there = np.isfinite(part)
        total = np.where(there, part, 0.0).sum(axis=1, dtype=float)
        return np.where(there[:, -1], total / np.maximum(1, there.sum(axis=1)), np.nan)

    def _count(self, samples: int) -> None:
        """Measure the samples per second, over the latest second."""
        self._received += samples
        now = time.monotonic()
        before, since = self._counted
        if now - since >= 1.0:
            self._rate_Hz = (self._received - before) / (now - since) if since else 0.0
            self._counted = (self._received, now)

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
        self.notice = f"stopped{at}: {reason}"

    def _tell_of_silence(self) -> None:
        """The drive was stopped because the monitor itself did not run for a while."""
        stopped = self.drive.stopped
        if stopped and stopped is not self._told:
            self._told = stopped
            self.dead_man.ended()
            self.notice = f"stopped at tick {stopped.tick}: {stopped.why('the monitor')}"
            self._halt(self.notice)

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
        self._end_recording("board reset")
        with self._lock:
            self._restart_traces()
        self._read_values()
        self._read_snapshot()

    def _restart_traces(self) -> None:
        """Trace the same channels. The board's ticks have started again from 0."""
        old, ring = self.stream, self.ring
        if old is None or ring is None:
            return
        old.close()
        try:
            self._open(old.channels, min(old.rate_Hz, float(self.drive.get("f_isr_Hz"))))
        except LinkError as error:
            if not error.mistake:
                raise
            self.stream = self.ring = None
            self.notice = str(error)
        if self.stream and self.stream.rate_Hz == old.rate_Hz:
            ring.begin_anew(math.ceil(BREAK_S * old.rate_Hz))
            self.ring = ring
        else:
            self.epoch += 1

    def _fault(self) -> tuple[bool, int]:
        latest, state = self.drive.client.latest, self._state()
        if latest is None or state is None:
            return False, 0
        return state.name == FAULT, latest.faults

    def _read_values(self) -> None:
        values = self.drive.get_all()
        if values != self.values:
            self.values = values
            self.values_version += 1

    def _read_snapshot(self) -> None:
        self.snapshot = self.drive.snapshot
        self.snapshot_version += 1

    # -- burst capture -------------------------------------------------------------------------

    def arm(
        self, channels: list[str], samples: int, pre: int, trigger: str, prescaler: int
    ) -> None:
        """Arm a capture, as `BoardDrive.arm`. The trigger's channel is captured too, so that its
        level can be seen."""
        try:
            on = Trigger.parse(trigger).channel
        except RecordingError as error:
            raise LinkError(str(error), mistake=True) from None
        if on and on not in channels:
            channels = [*channels, on]
        with self._lock:
            self._not_while_commissioning("capture")
            self.drive.arm(channels, samples, pre, trigger, prescaler)
            self._trigger = trigger
            self._capture_wanted += 1
            wanted = self._capture_wanted
        self._capture_text = "armed"
        threading.Thread(
            target=self._fetch, args=(wanted,), name="capture", daemon=True
        ).start()  # fmt: skip

    def trigger(self) -> None:
        self.drive.trigger()

    def cancel(self) -> None:
        with self._lock:
            self._capture_wanted += 1
            self._capture_text = ""
            self.drive.cancel()

    def _fetch(self, wanted: int) -> None:
        """Wait for a capture and upload it, unless a newer one replaces it."""

        def tell(text: str) -> None:
            with self._lock:
                if wanted == self._capture_wanted:
                    self._capture_text = text

        def uploaded(share: float) -> None:
            tell(f"uploading, {share:.0%}")

        words: dict[int, str] = {
            wire.CaptureState.FILLING: "filling the pre-trigger",
            wire.CaptureState.WAITING: "waiting for the trigger",
            wire.CaptureState.TRIGGERED: "triggered",
            wire.CaptureState.SUMMING: "triggered",
        }
        failed = 0
        while not self._closing.wait(HEARTBEAT_S):
            if wanted != self._capture_wanted:
                return
            try:
                # A fresh STATUS: the heartbeat's latest one may describe the capture before.
                board = self.drive.client.get_status()
                if board.capture == wire.CaptureState.NONE:
                    tell("gone: the board no longer has it")
                    return
                if board.capture != wire.CaptureState.COMPLETE:
                    tell(words.get(board.capture, ""))
                    continue
                found = self.drive.captured(1.0, uploaded=uploaded)
            except LinkError as error:
                tell(str(error))
                failed += self.drive.client.transport.plugged
                if failed == FETCH_TRIES:
                    return
                continue
            with self._lock:
                if wanted == self._capture_wanted:
                    self._keep(found)
                    tell("complete")
            return

    def _keep(self, recording: Recording) -> None:
        """Add a capture. The oldest ones go where there are too many of them."""
        self.capture_number += 1
        number = self.capture_number
        self.captures[number] = Capture(number, recording, self._trigger)

        def values() -> int:
            return sum(one.values for one in self.captures.values())

        while len(self.captures) > 1 and (
            len(self.captures) > CAPTURES or values() > CAPTURES_VALUES
        ):
            del self.captures[next(iter(self.captures))]

    def capture(self, number: int | None = None) -> Capture:
        """The capture with this number; None: the latest."""
        with self._lock:
            found = self.captures.get(self.capture_number if number is None else number)
            if found:
                return found
            if not self.captures:
                raise LinkError("there is no capture yet", mistake=True)
            kept = ", ".join(map(str, self.captures))
            raise LinkError(f"capture {number} is not kept: {kept} are", mistake=True)

    # -- recording -------------------------------------------------------------------------------

    def record_start(self, suffix: str) -> Path:
        with self._lock:
            if self._recorder:
                raise LinkError("a recording is under way", mistake=True)
            if self.stream is None:
                raise LinkError("choose channels to record", mistake=True)
            if suffix not in SUFFIXES:
                raise LinkError(f"suffix {suffix!r}: choose {', '.join(SUFFIXES)}", mistake=True)
            name = self.drive.hello.device.replace(" ", "-")
            path = self.folder / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}{suffix}"
            self._recorder = Recorder(self.drive, path, self.stream)
            return path

    def record_stop(self) -> Path:
        with self._lock:
            if self._recorder is None:
                raise LinkError("nothing is being recorded", mistake=True)
            recorder, self._recorder = self._recorder, None
            return recorder.close("user")

    def _end_recording(self, why: str) -> None:
        """Close the recording, if there is one; `why` is the reason."""
        with self._lock:
            if self._recorder is None:
                return
            recorder, self._recorder = self._recorder, None
            try:
                recorder.close(why)
                self.notice = f"recording ended: {why}"
            except RecordingError as error:
                self.notice = f"recording ended: {why}; {error}"


def _recording_status(recorder: Recorder) -> dict:
    return {
        "file": str(recorder.path),
        "rows": recorder.samples,
        "seconds": recorder.seconds,
    }
