"""Captures under the monitor: armed, waited for, uploaded, and the latest ones kept."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path
from typing import NamedTuple

from ..drive.board import BoardDrive
from ..drive.captures import Trigger
from ..recording.formats import RecordingError
from ..recording.recording import Recording
from ..serial import LinkError, wire
from ..serial.client import HEARTBEAT_S

#: Captures that are kept, and the largest number of their values.
CAPTURES, CAPTURES_VALUES = 12, 1 << 23
#: Attempts to upload a capture.
FETCH_TRIES = 5


class Capture(NamedTuple):
    """trigger: as it was armed, such as `rising:state:1.5`."""

    number: int
    recording: Recording
    trigger: str

    @property
    def values(self) -> int:
        return len(self.recording) * len(self.recording.channels)

    def file(self, suffix: str) -> bytes:
        """The capture as a file. `.json` is the file of metadata that belongs to `.csv`."""
        with tempfile.TemporaryDirectory() as folder:
            kind = ".csv" if suffix == ".json" else suffix
            path = self.recording.save(Path(folder) / f"capture{kind}")
            return path.with_suffix(suffix).read_bytes()


class Captures:
    """The captures of a drive. kept: the latest ones by their numbers, in order; number: of the
    latest one; text: how far the one is that was armed last, empty if none was."""

    def __init__(self, drive: BoardDrive, closing: threading.Event) -> None:
        self.drive = drive
        self.kept: dict[int, Capture] = {}
        self.number = 0
        self.text = ""
        self.lock = threading.RLock()
        self._closing = closing
        self._trigger = ""  # of the capture that was armed last
        self._wanted = 0  # number of the capture that was armed last

    @property
    def under_way(self) -> bool:
        return self.text not in ("", "complete")

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
        with self.lock:
            self.drive.arm(channels, samples, pre, trigger, prescaler)
            self._trigger = trigger
            self._wanted += 1
            wanted = self._wanted
        self.text = "armed"
        threading.Thread(
            target=self._fetch, args=(wanted,), name="capture", daemon=True
        ).start()  # fmt: skip

    def trigger(self) -> None:
        self.drive.trigger()

    def cancel(self) -> None:
        with self.lock:
            self._wanted += 1
            self.text = ""
            self.drive.cancel()

    def _fetch(self, wanted: int) -> None:
        """Wait for a capture and upload it, unless a newer one replaces it."""

        def tell(text: str) -> None:
            with self.lock:
                if wanted == self._wanted:
                    self.text = text

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
            if wanted != self._wanted:
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
            with self.lock:
                if wanted == self._wanted:
                    self._keep(found)
                    tell("complete")
            return

    def _keep(self, recording: Recording) -> None:
        """Add a capture. The oldest ones go where there are too many of them."""
        self.number += 1
        number = self.number
        self.kept[number] = Capture(number, recording, self._trigger)

        def values() -> int:
            return sum(one.values for one in self.kept.values())

        while len(self.kept) > 1 and (len(self.kept) > CAPTURES or values() > CAPTURES_VALUES):
            del self.kept[next(iter(self.kept))]

    def get(self, number: int | None = None) -> Capture:
        """The capture with this number; None: the latest."""
        with self.lock:
            found = self.kept.get(self.number if number is None else number)
            if found:
                return found
            if not self.kept:
                raise LinkError("there is no capture yet", mistake=True)
            kept = ", ".join(map(str, self.kept))
            raise LinkError(f"capture {number} is not kept: {kept} are", mistake=True)
