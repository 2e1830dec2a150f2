"""A study from a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import HexatorqueError
from ..setups import SetupError
from ..setups.values import suggest
from .space import GRID, StudyError
from .study import Study
from .work import POINT

#: Key of the file -> what is needed.
KEYS: dict[str, tuple[type | tuple[type, ...], str]] = {
    "setup": (str, "the name or the file of a set-up"),
    "title": (str, "text"),
    "design": (str, "text"),
    "samples": (int, "a whole number"),
    "seed": (int, "a whole number"),
    "schemes": (list, "a list of names"),
    "seeds": (list, "a list of whole numbers"),
    "metrics": (list, "a list of names"),
    "run": (str, "text"),
    "from_s": ((int, float), "a time in s"),
    "vary": (dict, "a table"),
}


def read(path: Path, changes: Mapping[str, Any] | None = None) -> Study:
    """The study in a file. `changes` replace its keys; those of `vary` are by path, and added."""
    try:
        data = tomllib.loads(path.read_text())
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: not valid TOML: {error}") from None
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: {getattr(error, 'strerror', None) or 'no text file'}") from None
    try:
        for name, value in data.items():
            if name not in KEYS:
                raise StudyError(f"unknown key {name!r}{suggest(name, KEYS)}")
            kind, needed = KEYS[name]
            if isinstance(value, bool) or not isinstance(value, kind):
                raise StudyError(f"{name} = {value!r}: {needed} is needed")
        data["vary"] = _flat(data.get("vary", {}))
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
    changes = dict(changes or {})
    data["vary"].update(changes.pop("vary", {}))
    try:
        return make({**data, **changes})
    except (StudyError, SetupError) as error:
        raise _named(path, error) from None


def _named(path: Path, error: HexatorqueError) -> StudyError:
    return StudyError("\n".join(f"{path}: {line}" for line in str(error).splitlines()))


def make(data: Mapping[str, Any]) -> Study:
    """The study of a file's keys; those of `vary` are paths."""
    if "setup" not in data:
        raise StudyError("setup is missing: the name or the file of a set-up")
    return Study(
        data["setup"],
        data.get("vary", {}),
        data.get("metrics"),
        data.get("design", GRID),
        data.get("samples"),
        data.get("seed", 1),
        data.get("schemes", ()),
        data.get("seeds", ()),
        data.get("run", POINT),
        data.get("from_s", 0.0),
        data.get("title", ""),
    )


def _flat(vary: Mapping[str, Any]) -> dict[str, Any]:
    found = {}
    for section, keys in vary.items():
        if not isinstance(keys, dict):
            raise StudyError(f"vary.{section}: a table [vary.{section}] is needed")
        found.update({f"{section}.{key}": value for key, value in keys.items()})
    return found
