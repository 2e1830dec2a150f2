"""What the simulation of a virtual board sees, written into a file as it goes on: a journal, as a
client's recording has (recording/writer.py). So the memory that it needs does not grow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..recording.formats import RecordingError
from ..recording.journal import Stream
from ..recording.writer import Writer

if TYPE_CHECKING:
    from ..drive.simulated import SimulatedDrive
    from ..recording.recording import Recording

#: Simulated time between two writes.
PART_S = 0.2


class OwnRecording:
    """path: the file; failed: why it could not be written on, "" if it could."""

    def __init__(self, sim: SimulatedDrive, path: Path) -> None:
        self.path = path
        self.failed = ""
        self._sim = sim
        self._writer: Writer | None = None
        self._rows = 0
        self._kept_s = sim.time_s
        self._jumps = 0.0  # switching frequency times samples

    @property
    def seconds(self) -> float:
        return self._rows / self._writer.stream.rate_Hz if self._writer else 0.0

    def keep(self) -> None:
        """Write what has come, if it is enough."""
        if not self.failed and self._sim.time_s - self._kept_s >= PART_S:
            self._keep()

    def _keep(self) -> None:
        self._kept_s = self._sim.time_s
        part = self._sim.take()
        try:
            self._append(part)
        except RecordingError as error:
            self.failed = str(error)

    def _append(self, part: Recording) -> None:
        if not len(part):
            return
        if self._writer and part.rate_Hz != self._writer.stream.rate_Hz:
            self._writer.close("f_isr_Hz has changed")  # the next one takes its place
            self._writer = None
        if self._writer is None:
            self._rows, self._jumps = 0, 0.0
            channels = tuple(part.units.items())
            self._writer = Writer.open(
                self.path, Stream(channels, part.rate_Hz, start_s=part.start_s, meta=part.meta)
            )
        ticks = np.arange(self._rows, self._rows + len(part), dtype=np.int64)
        names = [name for name, _ in self._writer.stream.channels]
        self._writer.append(ticks, np.column_stack([part[name] for name in names]))
        self._rows += len(part)
        self._jumps += (part.meta["f_sw_Hz"] or 0.0) * len(part)

    def close(self) -> None:
        """Finish the file. RecordingError on failure; the journal is then kept."""
        if not self.failed:
            self._keep()
        if self._writer is None:
            raise RecordingError(self.failed or f"{self.path}: nothing was simulated")
        state = {"state": self._sim.state, "faults": self._sim.faults}
        average = {"f_sw_Hz": self._jumps / self._rows if self._rows else None}
        self._writer.close(self.failed or "user", **state, **average)
        if self.failed:
            raise RecordingError(self.failed)
