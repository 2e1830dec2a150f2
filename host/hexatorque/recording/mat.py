"""MATLAB 5: a column per channel under a valid name, `time_s`, a board's `tick`, `rate_Hz`,
`start_s`, struct `units`, and the header as text in `recording_json`. A file without that text is
another program's (`workspace`). Library: scipy."""

from __future__ import annotations

import json
import re
import warnings
from pathlib import Path

import numpy as np

from . import workspace
from .formats import RecordingError
from .recording import Recording, from_header, header_text

LONGEST = 63  #: characters of a name in MATLAB
_KEYWORDS = (
    "break case catch classdef continue else elseif end for function global if otherwise "
    "parfor persistent return spmd switch try while"
)
_OWN = ("time_s", "tick", "rate_Hz", "start_s", "units", "recording_json")


def variables(names: list[str]) -> list[str]:
    """A valid and unique MATLAB name for each channel: `plant.i_u1_A` is plant_i_u1_A."""
    taken = {*_KEYWORDS.split(), *_OWN}
    found = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if plain[0].isalpha() else f"x{plain}"
        candidate, number = plain[:LONGEST], 1
        while candidate in taken:
            number += 1
            candidate = f"{plain[: LONGEST - len(str(number)) - 1]}_{number}"
        taken.add(candidate)
        found.append(candidate)
    return found


def save(rec: Recording, path: Path) -> None:
    from scipy.io import savemat

    own = variables(list(rec.channels))
    columns = {
        variable: np.asarray(data).reshape(-1, 1)
        for variable, data in zip(own, rec.channels.values(), strict=True)
    }
    units = {variable: rec.units.get(name, "") for variable, name in zip(own, rec.channels)}
    contents = {
        "time_s": rec.time_s.reshape(-1, 1),
        **columns,
        "rate_Hz": float(rec.rate_Hz),
        "start_s": float(rec.start_s),
        # Write JSON with ASCII only, because MATLAB's character set may differ.
        "recording_json": header_text(rec, variables=dict(zip(own, rec.channels))),
    }
    if rec.ticks is not None:
        contents["tick"] = rec.ticks.reshape(-1, 1)
    if units:
        contents["units"] = units
    with path.open("wb") as file:
        savemat(file, contents, do_compression=True, long_field_names=True)


def load(path: Path) -> Recording:
    from scipy.io import loadmat

    with path.open("rb") as file:
        try:
            # Of scipy 1.18 on a sparse matrix, which is left out: its class will change.
            with warnings.catch_warnings(action="ignore"):
                contents = loadmat(file, simplify_cells=True)
        except NotImplementedError:
            raise RecordingError(
                "MATLAB 7.3 (HDF5) is not read: save it in MATLAB with -v7"
            ) from None
    header = contents.get("recording_json")
    if not isinstance(header, str):
        return workspace.recording(contents)
    fields = json.loads(header)
    own, types = fields["variables"], fields.get("types", {})
    channels = {name: _column(contents[key], types.get(name)) for key, name in own.items()}
    return from_header(header, channels)


def _column(samples: np.ndarray | float, kind: str | None) -> np.ndarray:
    """The samples, (n,). scipy makes a number of Python out of a single one, which has no type."""
    return np.reshape(np.asarray(samples, kind if np.ndim(samples) == 0 else None), -1)
