"""Parquet: columns `time_s`, a board's `tick`, and the channels, each with its unit; the header
under `hexatorque` in the schema's metadata. Library: pyarrow."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .recording import Recording, from_header, header_text

KEY = b"hexatorque"


def save(rec: Recording, path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    ticks = {} if rec.ticks is None else {"tick": rec.ticks}
    columns = {"time_s": rec.time_s, **ticks, **rec.channels}
    units = {"time_s": "s", **rec.units}
    arrays = [pa.array(np.ascontiguousarray(data)) for data in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"unit": units.get(name, "")})
        for name, array in zip(columns, arrays)
    ]
    schema = pa.schema(fields, metadata={KEY: header_text(rec).encode()})
    parquet.write_table(pa.table(arrays, schema=schema), path, write_page_checksum=True)


def load(path: Path) -> Recording:
    from pyarrow import parquet

    with path.open("rb") as file:
        table = parquet.read_table(file, page_checksum_verification=True)
    names = [name for name in table.column_names if name not in ("time_s", "tick")]
    channels = {name: table.column(name).to_numpy() for name in names}
    return from_header(table.schema.metadata[KEY], channels)
