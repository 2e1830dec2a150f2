"""Recordings: named channels with units on one time base, and metadata.

One type for simulation, emulated processor and bench. Channel names:
`i_u1_A`, `torque_Nm`, ... are what the controller measured or estimated (the
telemetry channels of the firmware); `plant.i_u1_A`, ... are true values, which
only a simulation has.

Files: `.npz`, or `.csv` with the metadata in a `.json` beside it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from zipfile import BadZipFile

import numpy as np


class RecordingError(ValueError):
    """A recording file that cannot be read or written."""


@dataclass
class Recording:
    """Equally sampled channels.

    rate_Hz: samples per second; start_s: time of the first sample;
    channels: name -> (n,) array, all of one length; units: name -> unit;
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

    def window(self, begin_s: float, end_s: float) -> Recording:
        """The samples with begin_s <= time < end_s (a view)."""
        first = max(0, int(np.ceil((begin_s - self.start_s) * self.rate_Hz - 1e-6)))
        last = max(first, int(np.ceil((end_s - self.start_s) * self.rate_Hz - 1e-6)))
        part = {name: data[first:last] for name, data in self.channels.items()}
        return Recording(
            self.rate_Hz, part, self.units, self.meta, self.start_s + first / self.rate_Hz
        )

    def save(self, path: str | Path) -> Path:
        """Write by suffix; returns the path. Refuses other suffixes."""
        path = Path(path)
        writer = {".npz": _save_npz, ".csv": _save_csv}.get(path.suffix)
        if writer is None:
            raise RecordingError(f"{path}: unknown suffix, use .npz or .csv")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            writer(self, path)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from None
        return path

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read what `save` wrote."""
        path = Path(path)
        reader = {".npz": _load_npz, ".csv": _load_csv}.get(path.suffix)
        if reader is None:
            raise RecordingError(f"{path}: unknown suffix, use .npz or .csv")
        try:
            return reader(path)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror or error}") from None
        except (ValueError, KeyError, TypeError, BadZipFile) as error:
            raise RecordingError(f"{path}: not a recording ({error})") from None


def _header(rec: Recording) -> dict:
    return {
        "format": "hexatorque-recording-1",
        "rate_Hz": rec.rate_Hz,
        "start_s": rec.start_s,
        "units": {name: rec.units.get(name, "") for name in rec.channels},
        "meta": rec.meta,
    }


def _save_npz(rec: Recording, path: Path) -> None:
    header = np.frombuffer(json.dumps(_header(rec)).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez_compressed(
            file, header=header, **{f"channel:{k}": v for k, v in rec.channels.items()}
        )


def _load_npz(path: Path) -> Recording:
    with np.load(path, allow_pickle=False) as data:
        header = json.loads(bytes(data["header"]).decode())
        channels = {
            key.removeprefix("channel:"): data[key] for key in data.files if key != "header"
        }
    return Recording(
        header["rate_Hz"], channels, header["units"], header["meta"], header["start_s"]
    )


def _save_csv(rec: Recording, path: Path) -> None:
    path.with_suffix(".json").write_text(json.dumps(_header(rec), indent=1) + "\n")
    names = list(rec.channels)
    table = np.column_stack([rec.time_s, *(rec.channels[n] for n in names)])
    with path.open("w") as file:
        file.write(",".join(["time_s", *names]) + "\n")
        np.savetxt(file, table, fmt="%.9g", delimiter=",")


def _load_csv(path: Path) -> Recording:
    header = json.loads(path.with_suffix(".json").read_text())
    with path.open() as file:
        names = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    if table.shape[1] != len(names):
        raise ValueError(f"{len(names)} names for {table.shape[1]} columns")
    channels = {name: table[:, i] for i, name in enumerate(names) if name != "time_s"}
    return Recording(
        header["rate_Hz"], channels, header["units"], header["meta"], header["start_s"]
    )
