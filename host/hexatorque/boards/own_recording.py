"""The simulation's own values of a virtual board, written into a file as it goes on: a journal, as
a client's recording has (recording/writer.py). So the memory that it needs does not grow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..recording.formats import RecordingError
from ..recording.journal import Stream
from ..recording.writer import Writer, refuse_unfinished

if TYPE_CHECKING:
    from ..drive.simulated import SimulatedDrive
    from ..recording.recording import Recording

#: Simulated time between two writes.
PART_S = 0.2


class _File:
    """One file, of one rate."""

    def __init__(self, path: Path, first: Recording) -> None:
        stream = Stream(
            tuple(first.units.items()), first.rate_Hz, start_s=first.start_s, meta=first.meta
        )
        self.writer = Writer.open(path, stream)
        self.rows = 0
        self._jumps = 0.0  # switching frequency times samples

    def append(self, part: Recording) -> None:
        ticks = np.arange(self.rows, self.rows + len(part), dtype=np.int64)
        names = [name for name, _ in self.writer.stream.channels]
        self.writer.append(ticks, np.column_stack([part[name] for name in names]))
        self.rows += len(part)
        self._jumps += (part.meta["f_sw_Hz"] or 0.0) * len(part)

    def close(self, ended: str, **state: object) -> None:
        average = {"f_sw_Hz": self._jumps / self.rows if self.rows else None}
        self.writer.close(ended, **state, **average)


class OwnRecording:
    """path: the file; paths: it, and one more each time that f_isr_Hz has changed, because a file
    has one rate. They are finished at the end: a board must not stand still meanwhile. tell: is
    called with messages for the user. failed: why it could not be written on."""

    def __init__(
        self, sim: SimulatedDrive, path: Path, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        refuse_unfinished(path)
        self.path = path
        self.failed: RecordingError | None = None
        self._sim = sim
        self._tell = tell
        self._files: list[_File] = []
        self._kept_s = sim.time_s

    @property
    def seconds(self) -> float:
        return sum(one.rows / one.writer.stream.rate_Hz for one in self._files)

    @property
    def paths(self) -> list[Path]:
        return [one.writer.path for one in self._files]

    def keep(self) -> None:
        """Write the samples so far, if they are enough, or if the next run would delete it: its
        rate is another one."""
        enough = self._sim.time_s - self._kept_s >= PART_S
        if not self.failed and (enough or self._sim.timers_written):
            self._keep()

    def _keep(self) -> None:
        self._kept_s = self._sim.time_s
        part = self._sim.take()
        try:
            self._append(part)
        except RecordingError as error:
            self.failed = error
            self._tell(f"the recording ends: {error}")

    def _append(self, part: Recording) -> None:
        if not len(part):
            return
        if not self._files or part.rate_Hz != self._files[-1].writer.stream.rate_Hz:
            path = self.path
            if self._files:
                path = path.with_stem(f"{path.stem}-{len(self._files) + 1}")
                self._tell(f"f_isr_Hz has changed: the recording goes on in {path}")
            self._files.append(_File(path, part))
        self._files[-1].append(part)

    def close(self) -> None:
        """Finish the files. RecordingError on failure; the journal is then kept."""
        if not self.failed:
            self._keep()
        if not self._files:
            raise self.failed or RecordingError(f"{self.path}: nothing was simulated")
        for one in self._files[:-1]:
            one.close("f_isr_Hz has changed")
        self._files[-1].close(
            str(self.failed or "user"), state=self._sim.state, faults=self._sim.faults
        )
        if self.failed:
            raise self.failed
