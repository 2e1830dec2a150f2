"""One recording of several, as some oscilloscopes write a file for each channel."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .recording import Recording, RecordingError
from .table import SLACK


def joined(files: Sequence[str], recs: Sequence[Recording]) -> Recording:
    """All channels of the recordings; a channel is called `STEM.NAME`, after its file. The
    metadata are those that all have alike. RecordingError if times or names do not fit."""
    first = recs[0]
    channels: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for file, rec in zip(files, recs, strict=True):
        apart = abs(rec.rate_Hz / first.rate_Hz - 1) * len(first)
        shift = abs(rec.start_s - first.start_s) * first.rate_Hz
        for differs, what, values, unit in (
            (len(rec) != len(first), "length", (len(rec), len(first)), "samples"),
            (apart > SLACK, "rate", (rec.rate_Hz, first.rate_Hz), "Hz"),
            (shift > SLACK, "start", (rec.start_s, first.start_s), "s"),
        ):
            if differs:
                raise RecordingError(
                    f"{file}: {what} {values[0]:.9g} {unit}, that of {files[0]} is {values[1]:.9g} "
                    f"{unit}: files of one recording have the same {what}"
                )
        for name, data in rec.channels.items():
            own = f"{Path(file).stem}.{name}"
            if own in channels:
                raise RecordingError(f"{file}: there is a channel {own} already")
            channels[own] = data
            units[own] = rec.units.get(name, "")
    meta = {
        key: value
        for key, value in first.meta.items()
        if all(key in rec.meta and rec.meta[key] == value for rec in recs)
    }
    return Recording(first.rate_Hz, channels, units, meta, first.start_s)
