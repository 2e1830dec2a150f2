"""Recordings: named channels with units on one time base, and metadata.

One type for simulation, emulated processor and bench. Channel names:
`i_u1_A`, `torque_Nm`, ... are what the controller measured or estimated (the
telemetry channels of the firmware); `plant.i_u1_A`, ... are true values, which
only a simulation has.

Files by suffix: see `files` and docs/recordings.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import files
from .files import RecordingError

__all__ = ["TRIGGER", "Recording", "RecordingError"]

#: Key of `meta`: time of the trigger on the recording's own time base. Recordings are
#: aligned by it; a capture sets it.
TRIGGER = "trigger_s"

FORMAT = "hexatorque-recording-1"
#: What every kind of file can hold.
TYPES = ("float32", "float64", "bool", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)))


@dataclass
class Recording:
    """Equally sampled channels.

    rate_Hz: samples per second; start_s: time of the first sample;
    channels: name -> (n,) array, all of one length, NaN where a sample was lost;
    units: name -> unit;
    meta: anything JSON can hold (set-up, parameters, firmware build, drops).
    """

    rate_Hz: float
    channels: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)
    meta: dict = field(default_factory=dict)
    start_s: float = 0.0

    def __post_init__(self) -> None:
        lengths = {len(v) for v in self.channels.values()}
        if len(lengths) > 1:
            raise RecordingError(f"channels of different lengths: {sorted(lengths)}")

    def __len__(self) -> int:
        return len(next(iter(self.channels.values()), ()))

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.channels[name]
        except KeyError:
            raise KeyError(f"no channel {name!r}; there are {', '.join(self.channels)}") from None

    @property
    def time_s(self) -> np.ndarray:
        return self.start_s + np.arange(len(self)) / self.rate_Hz

    @property
    def duration_s(self) -> float:
        return len(self) / self.rate_Hz

    @property
    def trigger_s(self) -> float | None:
        """Time of the trigger; None without one."""
        value = self.meta.get(TRIGGER)
        return float(value) if isinstance(value, int | float) and np.isfinite(value) else None

    def window(self, begin_s: float, end_s: float) -> Recording:
        """The samples with begin_s <= time < end_s (a view)."""
        first = max(0, int(np.ceil((begin_s - self.start_s) * self.rate_Hz - 1e-6)))
        last = max(first, int(np.ceil((end_s - self.start_s) * self.rate_Hz - 1e-6)))
        part = {name: data[first:last] for name, data in self.channels.items()}
        return Recording(
            self.rate_Hz, part, self.units, self.meta, self.start_s + first / self.rate_Hz
        )

    def save(self, path: str | Path) -> Path:
        """Write by suffix (`files.SUFFIXES`); returns the path. Until all is written an
        older file of that name stays."""
        path = Path(path)
        writer = files.module(path)
        check_names(self.channels)
        for name, data in self.channels.items():
            kind, dimensions = np.asarray(data).dtype.name, np.ndim(data)
            if kind not in TYPES or dimensions != 1:
                raise RecordingError(
                    f"channel {name!r}: {dimensions} dimensions of {kind}, where one of numbers "
                    "is needed"
                )
        try:
            with files.replacing(path) as draft:
                writer.save(self, draft)
        except Exception as error:  # of libraries, too
            raise RecordingError(f"{path}: {files.one_line(error)}") from None
        return path

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read what `save` wrote, what `files.writer` writes, and the journal of a
        recording that was never closed (.part)."""
        path = Path(path)
        if path.suffix == files.PART:
            from .files import journal as reader
        else:
            reader = files.module(path)
        try:
            return reader.load(path)
        except (OSError, RecordingError) as error:
            raise RecordingError(f"{path}: {files.one_line(error)}") from None
        except Exception as error:  # a damaged file makes a parser raise anything
            raise RecordingError(f"{path}: not a recording ({files.one_line(error)})") from None


def check_names(names: Iterable[str]) -> None:
    """Refuse channel names that a table's head could not hold."""
    for name in names:
        if not name or name != name.strip() or not name.isprintable():
            raise RecordingError(f"channel {name!r}: a name of printing characters is needed")
        if name in ("time_s", "tick"):
            raise RecordingError(f"channel {name!r}: that is the name of the time base")


def header_text(rec: Recording, **more: object) -> str:
    """All of a recording but its samples, as one line of JSON."""
    header = {
        "format": FORMAT,
        "rate_Hz": rec.rate_Hz,
        "start_s": rec.start_s,
        "samples": len(rec),
        "units": {name: rec.units.get(name, "") for name in rec.channels},
        "types": {name: np.asarray(data).dtype.name for name, data in rec.channels.items()},
        "meta": rec.meta,
        **more,
    }
    return to_json(header)


def to_json(data: object) -> str:
    """One line; numbers of numpy as numbers, what JSON does not know as text."""
    return json.dumps(data, default=lambda x: x.tolist() if hasattr(x, "tolist") else str(x))


def from_header(text: str | bytes, channels: dict[str, np.ndarray]) -> Recording:
    """The recording of a header (`header_text`) and its samples, name -> array."""
    header = json.loads(text)
    rate_Hz, start_s = float(header["rate_Hz"]), float(header["start_s"])
    units, meta = header["units"], header["meta"]
    types, samples = header.get("types", {}), header.get("samples")
    if not (np.isfinite([rate_Hz, start_s]).all() and rate_Hz > 0):
        raise ValueError(f"{rate_Hz} samples per second from {start_s} s on")
    if not isinstance(meta, dict) or not all(isinstance(u, str) for u in units.values()):
        raise ValueError("units or metadata of another form")
    if set(units) != set(channels):
        raise ValueError("other channels than its header says")
    if not set(types.values()) <= set(TYPES):
        raise ValueError("samples of an unknown type")
    data = {name: _as_type(channels[name], types.get(name)) for name in units}
    rec = Recording(rate_Hz, data, units, meta, start_s)
    if samples is not None and len(rec) != samples:
        raise ValueError(f"{len(rec)} of {samples} samples")
    return rec


def _as_type(data: np.ndarray, kind: str | None) -> np.ndarray:
    """(n,) samples as they were; some files have no type for bool, old ones tell none."""
    if np.ndim(data) != 1:
        raise ValueError(f"samples of {np.ndim(data)} dimensions")
    if kind == "bool":
        data = data != 0
    return np.ascontiguousarray(data.astype(kind or data.dtype, casting="same_kind", copy=False))
