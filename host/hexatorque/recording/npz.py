"""numpy's archive: `header` (JSON as bytes) and `channel:NAME` arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .recording import Recording, from_header, header_text


def save(rec: Recording, path: Path) -> None:
    header = np.frombuffer(header_text(rec).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez_compressed(
            file, header=header, **{f"channel:{k}": v for k, v in rec.channels.items()}
        )


def load(path: Path) -> Recording:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
        channels = {
            key.removeprefix("channel:"): data[key] for key in data.files if key != "header"
        }
        return from_header(bytes(data["header"]), channels)
