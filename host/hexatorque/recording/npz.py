"""numpy's archive: `header` (JSON as bytes) and `channel:NAME` arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .recording import Recording, from_header, header_text


def save(rec: Recording, path: Path, compressed: bool = True) -> None:
    header = np.frombuffer(header_text(rec).encode(), np.uint8)
    arrays: dict[str, Any] = {f"channel:{k}": v for k, v in rec.channels.items()}
    with path.open("wb") as file:
        (np.savez_compressed if compressed else np.savez)(file, header=header, **arrays)


def load(path: Path) -> Recording:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
        channels = {
            key.removeprefix("channel:"): data[key] for key in data.files if key != "header"
        }
        return from_header(bytes(data["header"]), channels)
