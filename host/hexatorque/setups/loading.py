"""Reading set-ups: built-in ones by name, TOML files by path."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..given import choice, suggest, text_of
from ..plant.machines import MODELS
from .keys import FILES, KEYS, MODEL, SECTIONS, missing
from .setup import Setup
from .values import SetupError


def builtin_names() -> list[str]:
    folder = resources.files(__package__) / "builtin"
    names = [path.name for path in folder.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load(name_or_path: str | Path) -> Setup:
    """A built-in set-up by name, or a set-up or scenario file. A file that starts from another one
    says where that is as seen from its own folder. SetupError has a line for each mistake: the
    key, its value, and what is allowed; or the nearest name if there is no such set-up."""
    is_name = isinstance(name_or_path, str | Path)
    text = str(name_or_path)
    if not is_name or not text.strip():
        raise SetupError(f"setup = {name_or_path!r}: the name or the file of a set-up is needed")
    if text in builtin_names():
        return parse(builtin_text(text), text)
    path = Path(name_or_path)
    try:
        return parse(source_of(path), path.stem, path.parent)
    except SetupError as error:
        if not path.suffix and not path.exists():
            raise
        lines = [f"{path}: {line}" for line in str(error).splitlines()]
        raise SetupError("\n".join(lines)) from None


def beside(name: str, folder: Path, builtin: Callable[[], list[str]] = builtin_names) -> str:
    """The thing that a file in this folder calls by this name: a built-in set-up, or another
    built-in one, or a file."""
    path = folder / name
    is_file = name not in builtin() and (path.suffix or path.exists())
    return str(path) if is_file else name


def placed(value: Any, folder: Path) -> Any:
    """The value of a key that names a file, or several of them, as a file in this folder has it."""
    if isinstance(value, list):
        return [placed(one, folder) for one in value]
    return str(folder / value) if value and isinstance(value, str) else value


def builtin_text(name: str) -> str:
    return (resources.files(__package__) / "builtin" / f"{name}.toml").read_text(encoding="utf-8")


def source_of(path: Path) -> str:
    """The content of a set-up's file."""
    if not path.suffix and not path.exists():
        raise SetupError(f"no set-up {str(path)!r}{suggest(path, builtin_names())}")
    try:
        return text_of(path)
    except InputError as error:
        raise SetupError(str(error)) from None


def toml_of(source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(source)
    except tomllib.TOMLDecodeError as error:
        raise SetupError(f"not valid TOML: {error}") from None


def parse(source: str, name: str, folder: Path = Path(), *, whole: bool = True) -> Setup:
    """Check the text of a set-up or scenario of a file in this folder. All mistakes are reported
    together. If more is to come, the text is not `whole`: its values need not fit together."""
    from . import schema  # needs pydantic, which takes long to import

    data = toml_of(source)
    base, lines = None, []
    if isinstance(data.get("setup"), str):
        try:
            base = load(beside(data["setup"], folder))
        except RecursionError:
            raise SetupError(f"setup = {data['setup']!r}: the files refer to each other") from None
    try:
        checked = schema.check(data)
    except SetupError as error:
        lines = str(error).splitlines()
    if "setup" not in data:
        lines += _missing(data)
    if lines:
        raise SetupError("\n".join(lines))
    start = base or Setup(name, name, {section: {} for section in SECTIONS})
    setup = Setup(
        name,
        checked.get("title", start.title),
        start.values,
        checked.get("paper", start.paper),
        checked.get("profile", start.profile),
        checked.get("defaults", start.defaults),
    )
    values = {section: checked.get(section, {}) for section in SECTIONS}
    for section, key in (path.split(".") for path in FILES):
        if file := values[section].get(key):
            values[section][key] = replace(file, value=placed(file.value, folder))
    return setup.with_values(values) if whole else setup.with_part(values)


def _missing(data: dict[str, Any]) -> list[str]:
    """A file that starts from no other one has to give everything without a default."""
    tables = {s: entries for s, entries in data.items() if isinstance(entries, dict)}
    model = tables.get("machine", {}).get(MODEL, KEYS["machine"][MODEL].default)
    model = model.get("value") if isinstance(model, dict) else model
    given = choice(model, tuple(MODELS))
    wrong = {section for section in KEYS if section in data and section not in tables}
    lines = missing(tables, given) if given in MODELS else []
    return [line for line in lines if line.partition(".")[0] not in wrong]
