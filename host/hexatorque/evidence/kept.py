"""Measured values in files, so that an interrupted sweep can continue."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

#: The parts of this package that can change a measured value. Judging, pictures and tables may
#: change without a new measurement.
MEASURING = (
    "drive", "experiments", "firmware.py", "laws", "plant", "recording", "setups",
    *(f"analysis/{name}.py"
      for name in ("losses", "metrics", "response", "run", "spectrum", "walk")),
    *(f"evidence/methods/{name}.py"
      for name in (
          "bench", "carrier", "errors", "limit", "methods", "places", "search", "steps"
      )),
)  # fmt: skip


#: The whole package: a study may use any part of it.
EVERYTHING = ("",)


@lru_cache
def digest(names: tuple[str, ...] = MEASURING) -> str:
    """A check sum over these files and folders of the package and the compiled firmware."""
    package = Path(__file__).parents[1]
    found = hashlib.sha256()
    for name in names:
        path = package / name
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.suffix in (".csv", ".py", ".toml"):
                found.update(file.relative_to(package).as_posix().encode())
                found.update(file.read_bytes())
    for library in sorted(package.glob("*.so")):
        found.update(library.read_bytes())
    return found.hexdigest()


class Kept:
    """The values that were measured under a key, in a file."""

    def __init__(self, folder: Path, kind: str, *key: object) -> None:
        text = json.dumps([digest(), kind, *key], default=repr, sort_keys=True)
        self.path = folder / f"{kind}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.json"

    def load(self, default: Any = None) -> Any:
        """The default: not measured yet, or a damaged file."""
        try:
            return json.loads(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return default

    def save(self, values: Any) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        part = self.path.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(values) + "\n", encoding="utf-8")
        part.replace(self.path)

    def get(self, measure: Callable[[], Any]) -> Any:
        """A value that is None counts too, so it is kept in a list."""
        if found := self.load():
            return found[0]
        value = measure()
        self.save([value])
        return value
