"""A study from a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from ..errors import HexatorqueError, InputError
from ..given import suggest, text_of
from ..setups import SetupError, load
from ..setups.keys import FILES
from ..setups.loading import beside, placed
from . import cycle
from .errors import StudyError
from .space import Draw
from .study import Study
from .work import Runs

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
    "cycle": (str, "the name of a cycle or a CSV file"),
    "over": (str, "the name of a metric"),
    "vary": (dict, "a table"),
    "default": (dict, "a table"),
}
#: Keys that are one argument of `Study` together: the argument's class and its fields.
GROUPS: dict[str, tuple[type, dict[str, str]]] = {
    "design": (Draw, {"design": "design", "samples": "samples", "seed": "seed"}),
    "run": (Runs, {"run": "kind", "from_s": "from_s", "cycle": "cycle"}),
}


def ready() -> list[str]:
    """Names of the studies that come with the package."""
    names = [path.name for path in (resources.files(__package__) / "ready").iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def _text(path: Path) -> str:
    if str(path) in ready():
        return (resources.files(__package__) / "ready" / f"{path}.toml").read_text(encoding="utf-8")
    if not path.suffix and not path.exists():
        raise StudyError(f"no study{suggest(path, ready())}")
    try:
        return text_of(path)
    except InputError as error:
        raise StudyError(str(error)) from None


def read(path: Path | str, changes: Mapping[str, Any] | None = None) -> Study:
    """The study in a file, or the one of this name that comes with the package. `changes` replace
    its keys; those of `vary` are by path, and added."""
    path = Path(path)
    try:
        data = tomllib.loads(_text(path))
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: not valid TOML: {error}") from None
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
    try:
        for name, value in data.items():
            if name not in KEYS:
                raise StudyError(f"unknown key {name!r}{suggest(name, KEYS)}")
            kind, needed = KEYS[name]
            if isinstance(value, bool) or not isinstance(value, kind):
                raise StudyError(f"{name} = {value!r}: {needed} is needed")
        for name in ("vary", "default"):
            data[name] = _flat(name, data.get(name, {}), path.parent)
    except StudyError as error:
        raise StudyError(f"{path}: {error}") from None
    if "setup" in data:
        data["setup"] = beside(data["setup"], path.parent)
    if "cycle" in data:
        data["cycle"] = beside(data["cycle"], path.parent, cycle.ready)
    changes = dict(changes or {})
    data["vary"].update(changes.pop("vary", {}))
    try:
        return make({**data, **changes})
    except (StudyError, SetupError) as error:
        raise _named(path, error) from None


def _placed(given: Any, folder: Path) -> Any:
    """Files that a study names are beside it, as the set-up is."""
    if isinstance(given, Mapping):
        return {name: placed(value, folder) for name, value in given.items()}
    return placed(given, folder)


def _named(path: Path, error: HexatorqueError) -> StudyError:
    return StudyError("\n".join(f"{path}: {line}" for line in str(error).splitlines()))


def make(data: Mapping[str, Any]) -> Study:
    """The study of a file's keys; those of `vary` are paths. set: path -> another value of the
    set-up."""
    if "setup" not in data:
        raise StudyError("setup is missing: the name or the file of a set-up")
    given = {name: value for name, value in data.items() if name not in ("setup", "set")}
    for argument, (group, fields) in GROUPS.items():
        there = [name for name in fields if name in given]
        given[argument] = group(**{fields[name]: given.pop(name) for name in there})
    setup = load(data["setup"]).changed(data.get("set"))
    return Study(setup, given.pop("vary", None), **given)


def _flat(name: str, sections: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    found = {}
    for section, keys in sections.items():
        if not isinstance(keys, dict):
            raise StudyError(f"{name}.{section}: a table [{name}.{section}] is needed")
        found.update({f"{section}.{key}": value for key, value in keys.items()})
    for path in FILES & found.keys():
        found[path] = _placed(found[path], folder)
    return found
