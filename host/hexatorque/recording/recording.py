"""Recordings: named channels with units on one time axis, and metadata.

A simulation, an emulated processor and a test bench all give this type. Its
channels are told apart by name. `plant.torque_Nm` is the true value, which only a simulation has;
`torque_Nm` is what the firmware measures or estimates, and `firmware.torque_Nm` is the same channel
under a name that says so.

The suffix of a file decides its format: see `formats` and docs/recordings.md.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..given import other_file, suggest
from . import formats
from .channels import Channels
from .formats import RecordingError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ..analysis.panels import Panel

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
#: Key of `meta`: pairs of time, on the recording's own time axis, and speed reference from then on.
#: A simulation knows them.
SPEED_REFERENCE = "speed_ref_rpm"
#: Lines of `print(recording)` that name channels.
CHANNEL_LINES = 4
#: The types of samples that every file format can store.
TYPES = ("float32", "float64", "bool", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)))


#: In front of a name: the true value, and what the firmware measures or estimates. The firmware's
#: channels have their name without the prefix in files, as on a board.
TRUE, FIRMWARE = "plant.", "firmware."
#: Shown by `plot` if nothing is named, as far as it is there.
SHOWN = ("i_u1", "i_u2", "torque", "speed")


@dataclass(repr=False)
class Recording:
    """Equally sampled channels.

    recording["plant.torque_Nm"]      # the true torque, (n,) array in N m; only of a simulation
    recording["firmware.torque_Nm"]   # the firmware's estimate; "torque_Nm" is the same channel
    recording.plot("torque")          # both in one panel

    rate_Hz: samples per second; start_s: time of the first sample in s;
    channels: name -> (n,) array, all of one length, NaN where a sample was lost. Of a simulation
        they are `Channels`, which behave like a dictionary;
    units: name -> unit;
    meta: anything that JSON can hold (set-up, parameters, firmware build, counters); `f_sw_Hz` is
        the mean switching frequency of a simulation;
    notes: remarks for the user that came up when the file was read; they are not saved.
    """

    rate_Hz: float
    channels: dict[str, np.ndarray] | Channels
    units: dict[str, str] = field(default_factory=dict)
    meta: dict = field(default_factory=dict)
    start_s: float = 0.0
    notes: list[str] = field(default_factory=list, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.channels, Mapping):
            raise RecordingError(f"channels = {self.channels!r}: names with arrays are needed")
        lengths = Channels(self.channels).lengths()
        if len(lengths) > 1:
            raise RecordingError(f"channels of different lengths: {sorted(lengths)}")

    def __len__(self) -> int:
        return len(next(iter(self.channels.values()), ()))

    def __repr__(self) -> str:
        samples = f"{len(self)} samples at {self.rate_Hz:g} Hz"
        return f"<Recording: {samples}, {len(self.channels)} channels>"

    def __str__(self) -> str:
        """Its content in a few lines."""
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

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._own(name) in self.channels

    def __iter__(self) -> Iterator[str]:
        """The channels' names, as pandas has it for columns."""
        return iter(self.channels)

    def __getitem__(self, name: str) -> np.ndarray:
        """The samples of a channel, (n,), in `units[name]`. RecordingError names the nearest
        channel if there is none of this name."""
        if name not in self:
            raise RecordingError(f"no channel {name!r}{suggest(name, self.channels)}")
        return self.channels[self._own(name)]

    def _own(self, name: str) -> str:
        """The channel's name in `channels`."""
        return name if name in self.channels else name.removeprefix(FIRMWARE)

    def plot(self, *names: str, file: str | Path | None = None) -> Figure:
        """Draw channels over time, in a panel each. A name is a channel, such as
        "plant.torque_Nm", or a quantity, such as "torque": then the true value and the firmware's
        are in one panel. Without a name: currents, torque and speed.

        The figure is matplotlib's. A notebook shows it; in a script, `file="torque.png"` writes it,
        or `matplotlib.pyplot.show()` opens a window. RecordingError if there is no such channel,
        or if the file cannot be written."""
        from ..analysis.panels import over_time

        if file is not None and _file(file).suffix != ".png":
            raise RecordingError(f"{file}: a picture is a .png")
        panels = [self._panel(name) for name in names or self._shown()]
        try:
            return over_time(self.time_s, panels, file)
        except OSError as error:
            raise RecordingError(f"{file}: {formats.one_line(error)}") from None

    def _shown(self) -> list[str]:
        found = [quantity for quantity in SHOWN if self._of_quantity(quantity)]
        if not self.channels:
            raise RecordingError("the recording has no channels")
        return found or list(self.channels)[: len(SHOWN)]

    def _of_quantity(self, quantity: str) -> list[str]:
        """The channels `quantity_UNIT`, the true one first. A number without a unit, such as
        `torque_level`, is no quantity."""
        found = [
            name
            for name in self.channels
            if _quantity(name) == quantity and self.units.get(name, "")
        ]
        return sorted(found, key=lambda name: not name.startswith(TRUE))

    def _panel(self, name: str) -> Panel:
        from ..analysis.panels import Line, Panel

        channels = [self._own(name)] if name in self else self._of_quantity(name)
        if not channels:
            quantities = [_quantity(one) for one in self.channels if self.units.get(one, "")]
            known = dict.fromkeys([*self.channels, *quantities])
            raise RecordingError(f"no channel {name!r}{suggest(name, known)}")
        lines = [
            Line(
                f"{one} (true)" if one.startswith(TRUE) else f"{one} (firmware)", self.channels[one]
            )
            for one in channels
        ]
        return Panel(name, self.units.get(channels[0], ""), lines)

    def to_pandas(self, *names: str) -> pd.DataFrame:
        """A pandas DataFrame: a column for each channel, or for those named; the index is `time_s`.
        `attrs["units"]` has the units, `attrs["meta"]` the metadata. RecordingError if there is no
        such channel, or if pandas is not installed."""
        try:
            import pandas as pd
        except ImportError:
            raise RecordingError(
                "a DataFrame needs pandas, which is not installed: pip install 'hexatorque[sweep]'"
            ) from None
        columns = {name: self[name] for name in names or self.channels}
        frame = pd.DataFrame(columns, index=pd.Index(self.time_s, name="time_s"))
        units = {name: self.units.get(self._own(name), "") for name in columns}
        frame.attrs.update({"units": units, "meta": self.meta})
        return frame

    @property
    def time_s(self) -> np.ndarray:
        """Time of each sample in s, (n,)."""
        return self.start_s + np.arange(len(self)) / self.rate_Hz

    @property
    def duration_s(self) -> float:
        """Number of samples over their rate, in s."""
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
        """Time of the trigger in s, on the recording's own time axis; None without one."""
        value = self.meta.get(TRIGGER)
        return float(value) if isinstance(value, int | float) and np.isfinite(value) else None

    def window(self, begin_s: float, end_s: float) -> Recording:
        """The samples with begin_s <= time < end_s, as a view. Outside of the recording there are
        none. RecordingError if one is no number."""
        first = self._sample_at(begin_s)
        last = max(first, self._sample_at(end_s))
        part = Channels(self.channels).part(first, last)
        meta, ticks = self.meta, self.ticks
        if ticks is not None and len(ticks):
            meta = {**meta, FIRST_TICK: (int(ticks[0]) + first * meta[DECIMATION]) % 2**32}
        return Recording(self.rate_Hz, part, self.units, meta, self.start_s + first / self.rate_Hz)

    def _sample_at(self, time_s: float) -> int:
        """The first sample that is not before this time; their number if none is."""
        try:
            samples = np.ceil((float(time_s) - self.start_s) * self.rate_Hz - 1e-6)
            return int(np.clip(samples, 0, len(self)))
        except (TypeError, ValueError):
            raise RecordingError(f"{time_s!r}: a time in s is needed") from None

    def save(self, path: str | Path) -> Path:
        """Write a file; its suffix decides the format (`formats.SUFFIXES`). Returns the path. An
        older file is replaced only when the new one is complete. RecordingError on failure."""
        path = _file(path)
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
        """Read a file from `save` or `Writer`, or the journal (.part) of a recording that was not
        closed. RecordingError if that is not possible."""
        path = _file(path)
        reader = formats.reader(path)
        try:
            return reader.load(path)
        except (OSError, RecordingError) as error:
            meant = other_file(path) if isinstance(error, FileNotFoundError) else ""
            raise RecordingError(f"{path}: {formats.one_line(error)}{meant}") from None
        except Exception as error:  # a damaged file makes a parser raise anything
            raise RecordingError(f"{path}: not a recording ({formats.one_line(error)})") from None


def _file(path: object) -> Path:
    if not isinstance(path, str | Path):
        raise RecordingError(f"file = {path!r}: the name of a file is needed")
    return Path(path)


def _quantity(name: str) -> str:
    """The quantity of a channel: its name without prefix and unit."""
    return name.removeprefix(TRUE).rpartition("_")[0]


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
