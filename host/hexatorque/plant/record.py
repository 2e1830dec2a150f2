"""Records: the data that Python passes to the compiled plant."""

from __future__ import annotations

from typing import Any

import numpy as np


def names_of(dtype: np.dtype) -> tuple[str, ...]:
    """The fields of a record's type."""
    return dtype.names or ()


def record(dtype: np.dtype, **fields: Any) -> np.record:
    """A record of `dtype` with every field set; compiled code sees and changes it
    in place."""
    missing = set(names_of(dtype)) ^ set(fields)
    if missing:
        raise TypeError(f"fields do not match: {sorted(missing)}")
    row = np.zeros(1, dtype).view(np.recarray)[0]
    for name, value in fields.items():
        row[name] = value
    return row
