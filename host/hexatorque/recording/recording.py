"""Recordings: named channels with units on one time axis, and metadata.

A simulation, an emulated processor and a test bench all give this type. Channels such as
`i_u1_A` and `torque_Nm` are measured or estimated by the controller (the firmware's channels).
Channels such as `plant.i_u1_A` are true values, which only a simulation has.

The suffix of a file decides its format: see `formats` and docs/recordings.md.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from . import formats
from .channels import Channels
from .formats import RecordingError

__all__ = ["TRIGGER", "Recording", "RecordingError"]

#: Key of `meta`: time of the trigger on the recording's own time axis. Recordings are
#: aligned by it; a capture sets it.
TRIGGER = "trigger_s"

FORMAT = "hexatorque-recording-2"
#: Key of `meta`: wall-clock time of time 0 of the recording's own time axis (`clock_text`).
STARTED = "started"
#: Keys of `meta`: the board's count of fast interrupts at the first sample, and from one
#: sample to the next.
FIRST_TICK, DECIMATION = "first_tick", "decimation"
#: Lines of `print(recording)` that name channels.
CHANNEL_LINES = 4
#: The types of samples that every file format can store.
TYPES = ("float32", "float64", "bool", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)))


@dataclass(repr=False)
class Recording:
    """Equally sampled channels.

    rate_Hz: samples per second; start_s: time of the first sample;
    channels: name -> (n,) array, all of one length, NaN where a sample was lost. Of a simulation
        they are `Channels`, which behave like a dictionary;
    units: name -> unit;
    meta: anything that JSON can hold (set-up, parameters, firmware build, counters);
    notes: remarks for the user that came up when the file was read; they are not saved.
    """

    rate_Hz: float
    channels: dict[str, np.ndarray] | Channels
    units: dict[str, str] = field(default_factory=dict)
    meta: dict = field(default_factory=dict)
    start_s: float = 0.0
    notes: list[str] = field(default_factory=list, compare=False)

    def __post_init__(self) -> None:
        lengths = Channels(self.channels).lengths()
        if len(lengths) > 1:
            raise RecordingError(f"channels of different lengths: {sorted(lengths)}")

    def __len__(self) -> int:
        return len(next(iter(self.channels.values()), ()))

    def __repr__(self) -> str:
        samples = f"{len(self)} samples at {self.rate_Hz:g} Hz"
        return f"<Recording: {samples}, {len(self.channels)} channels>"

    def __str__(self) -> str:
        """What is in it, in a few lines."""
        first = f"{self.duration_s:.4g} s from {self.start_s:.4g} s on"
        lines = [f"{first}: {len(self)} samples at {self.rate_Hz:g} Hz"]
        channels = textwrap.fill(
            ", ".join(self.channels), 100, initial_indent="  ", subsequent_indent="  ",
            break_long_words=False, break_on_hyphens=False, max_lines=CHANNEL_LINES,
            placeholder=" ...",
        )  # fmt: skip
        lines += [f"{len(self.channels)} channels:", channels] if channels else ["no channels"]
        if self.meta:
            lines.append(f"meta: {', '.join(self.meta)}")
        return "\n".join([*lines, *self.notes])

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __getitem__(self, name: str) -> np.ndarray:
        try:
            return self.channels[name]
        except KeyError:
            raise KeyError(f"no channel {name!r}; there are {', '.join(self.channels)}") from None

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample."""
        return self.start_s + np.arange(len(self)) / self.rate_Hz

    @property
    def duration_s(self) -> float:
        """Number of samples over their rate."""
        return len(self) / self.rate_Hz

    @property
    def ticks(self) -> np.ndarray | None:
        """The board's count of fast interrupts at each sample, (n,) uint32, modulo 2**32. None if
        the recording does not come from a board."""
        first, step = self.meta.get(FIRST_TICK), self.meta.get(DECIMATION)
        if type(first) is not int or type(step) is not int:
            return None
        ticks = (first + step * np.arange(len(self), dtype=np.int64)) % 2**32
        return ticks.astype(np.uint32)

    @property
    def trigger_s(self) -> float | None:
        """Time of the trigger; None without one."""
        value = self.meta.get(TRIGGER)
        return float(value) if isinstance(value, int | float) and np.isfinite(value) else None

    def window(self, begin_s: float, end_s: float) -> Recording:
        """The samples with begin_s <= time < end_s (a view)."""
        first = max(0, int(np.ceil((begin_s - self.start_s) * self.rate_Hz - 1e-6)))
        last = max(first, int(np.ceil((end_s - self.start_s) * self.rate_Hz - 1e-6)))
        part = Channels(self.channels).part(first, last)
        meta, ticks = self.meta, self.ticks
        if ticks is not None and len(ticks):
            meta = {**meta, FIRST_TICK: (int(ticks[0]) + first * meta[DECIMATION]) % 2**32}
        return Recording(self.rate_Hz, part, self.units, meta, self.start_s + first / self.rate_Hz)

    def save(self, path: str | Path) -> Path:
        """Write a file; its suffix decides the format (`formats.SUFFIXES`). Returns the path. An
        older file is replaced only when the new one is complete. RecordingError on failure."""
        path = Path(path)
        writer = formats.module(path)
        check_names(self.channels)
        for name, data in self.channels.items():
            kind, dimensions = np.asarray(data).dtype.name, np.ndim(data)
            if kind not in TYPES or dimensions != 1:
                raise RecordingError(
                    f"channel {name!r}: {dimensions} dimensions of {kind}, where one of numbers "
                    "is needed"
                )
        try:
            with formats.replacing(path) as draft:
                writer.save(self, draft)
        except Exception as error:  # the libraries raise many kinds
            failed = formats.NotWritten if isinstance(error, OSError) else RecordingError
            raise failed(f"{path}: {formats.one_line(error)}") from None
        return path

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read a file from `save` or `writer`, or the journal (.part) of a recording that was not
        closed. RecordingError if that is not possible."""
        path = Path(path)
        reader = formats.reader(path)
        try:
            return reader.load(path)
        except (OSError, RecordingError) as error:
            raise RecordingError(f"{path}: {formats.one_line(error)}") from None
        except Exception as error:  # a damaged file makes a parser raise anything
            raise RecordingError(f"{path}: not a recording ({formats.one_line(error)})") from None


def check_names(names: Iterable[str]) -> None:
    """Raise RecordingError for a channel name that cannot stand in the first line of a table."""
    for name in names:
        if not name or name != name.strip() or not name.isprintable():
            raise RecordingError(f"channel {name!r}: a name of printing characters is needed")
        if name in ("time_s", "tick"):
            raise RecordingError(f"channel {name!r}: that is the name of the time base")


def clock_text(wall_s: float) -> str:
    """Seconds since 1970 as ISO 8601 text in this computer's time zone, in whole milliseconds."""
    return datetime.fromtimestamp(round(wall_s, 3)).astimezone().isoformat(timespec="milliseconds")


def header(
    rate_Hz: float,
    start_s: float,
    samples: int | None,
    columns: Iterable[tuple[str, str, str]],
    meta: dict,
) -> dict:
    """The header: everything in a recording except its samples. It is the same in every file
    format. columns: name, unit and type of each channel; samples: their number, None while more
    are coming."""
    columns = list(columns)
    return {
        "format": FORMAT,
        "rate_Hz": rate_Hz,
        "start_s": start_s,
        "samples": samples,
        "units": {name: unit for name, unit, _ in columns},
        "types": {name: kind for name, _, kind in columns},
        "meta": meta,
    }


def header_of(rec: Recording) -> dict:
    columns = [
        (name, rec.units.get(name, ""), np.asarray(data).dtype.name)
        for name, data in rec.channels.items()
    ]
    return header(rec.rate_Hz, rec.start_s, len(rec), columns, rec.meta)


def header_text(rec: Recording, **more: object) -> str:
    """`header_of` as one line of JSON."""
    return to_json({**header_of(rec), **more})


def to_json(data: object) -> str:
    """JSON on one line. numpy's numbers become numbers; types that JSON does not know, text."""
    return json.dumps(data, default=lambda x: x.tolist() if hasattr(x, "tolist") else str(x))


def from_header(text: str | bytes, channels: dict[str, np.ndarray]) -> Recording:
    """Make a recording from a header (`header_text`) and its samples, name -> array."""
    return from_fields(json.loads(text), channels)


def from_fields(fields: dict, channels: dict[str, np.ndarray]) -> Recording:
    """Make a recording from a parsed header and its samples."""
    rate_Hz, start_s = float(fields["rate_Hz"]), float(fields["start_s"])
    units, meta = fields["units"], fields["meta"]
    types, samples = fields.get("types", {}), fields.get("samples")
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
    """The samples, (n,), in their former type. Some formats have no bool, and old files do not
    state the type."""
    if np.ndim(data) != 1:
        raise ValueError(f"samples of {np.ndim(data)} dimensions")
    if kind == "bool":
        data = data != 0
    data = data.astype(kind or data.dtype, casting="same_kind", copy=False)
    # Some libraries attach metadata to the type. The view has none.
    return np.ascontiguousarray(data).view(data.dtype.name)
