"""Change values in the text of a set-up. All the rest stays as it is: comments, order, the user's
own tables. It needs tomlkit, which comes with the extra `tune`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from ..setups.keys import FILES
from ..setups.loading import beside, placed
from ..setups.values import Value

#: Section -> key -> value.
Changes = Mapping[str, Mapping[str, Value]]


def edited(source: str, changes: Changes) -> str:
    """The text with the values changed or added."""
    text: Any = tomlkit.parse(source)
    for section, values in changes.items():
        if section not in text:
            text[section] = tomlkit.table()
        for key, value in values.items():
            text[section][key] = _toml(value)
    return tomlkit.dumps(text)


def moved(source: str, folder: Path) -> str:
    """The text of a file of this folder, for another folder: the set-up that it starts from and the
    files that it names are still found."""
    text: Any = tomlkit.parse(source)
    name = str(text.get("setup", ""))
    there = beside(name, folder) if name else name
    if there != name:
        text["setup"] = str(Path(there).resolve())
    for section, key in (path.split(".") for path in FILES):
        row, at = text.get(section, {}), key
        if isinstance(row.get(key), dict):
            row, at = row[key], "value"
        if row.get(at):
            row[at] = placed(row[at], folder.resolve())
    return tomlkit.dumps(text)


def _toml(value: Value) -> Any:
    if value.tag == "user":
        return value.value
    row = tomlkit.inline_table()
    row.update({"value": value.value, "tag": value.tag})
    if value.note:
        row["note"] = value.note
    return row
