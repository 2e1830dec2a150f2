"""Change values in the text of a set-up. All the rest stays as it is: comments, order, the user's
own tables."""

from __future__ import annotations

import copy
import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .loading import beside
from .values import Value

#: Section -> key -> value.
Changes = Mapping[str, Mapping[str, Value]]
_HEADER = re.compile(r"\s*\[")


def edited(source: str, changes: Changes) -> str | None:
    """The text with the values changed or added. None if the text writes one of the sections in a
    way that is not `[section]` and one line for each key: nothing is guessed then."""
    lines = source.splitlines()
    for section, values in changes.items():
        begin, end = _span(lines, section)
        for key, value in values.items():
            row = f"{key} = {_toml(value)}"
            own = re.compile(rf'\s*(?:{key}|"{key}"|\'{key}\')\s*=')
            at = next((k for k in range(begin, end) if own.match(lines[k])), None)
            if at is None:
                while end > begin and not lines[end - 1].strip():
                    end -= 1
                lines.insert(end, row)
                end += 1
            else:
                lines[at] = row + _comment(lines[at])
    text = "\n".join(lines) + "\n"
    try:
        return text if tomllib.loads(text) == _changed(tomllib.loads(source), changes) else None
    except tomllib.TOMLDecodeError:
        return None


def on_top_of(name: str, changes: Changes) -> str:
    """A set-up that starts from the one of this name, or of this file, and changes the values."""
    lines = [f"setup = {json.dumps(name)}"]
    for section, values in changes.items():
        lines += ["", f"[{section}]"]
        lines += [f"{key} = {_toml(value)}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def moved(source: str, folder: Path) -> str:
    """The text of a file of this folder, for another folder: the set-up that it starts from is
    still found."""
    name = tomllib.loads(source).get("setup", "")
    there = beside(name, folder) if name else name
    if there == name:
        return source
    row = f"setup = {json.dumps(str(Path(there).resolve()))}"
    line = re.compile(r"(?m)^[ \t]*setup[ \t]*=.*$")
    return line.sub(lambda found: row + _comment(found[0]), source, count=1)


def _span(lines: list[str], section: str) -> tuple[int, int]:
    """The lines below the header of a section, up to the next header. A section that is not there
    is added at the end."""
    header = re.compile(rf"\s*\[\s*{section}\s*\]\s*(?:#.*)?$")
    begin = next((k for k, line in enumerate(lines) if header.match(line)), None)
    if begin is None:
        lines += ["", f"[{section}]"]
        return len(lines), len(lines)
    after = range(begin + 1, len(lines))
    return begin + 1, next((k for k in after if _HEADER.match(lines[k])), len(lines))


def _comment(line: str) -> str:
    """The comment at the end of a line: the first # outside quotes."""
    quote = ""
    for k, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote and (quote == "'" or line[k - 1] != "\\") else quote
        elif letter in "\"'":
            quote = letter
        elif letter == "#":
            return "  " + line[k:]
    return ""


def _toml(value: Value) -> str:
    plain = json.dumps(value.value)
    if value.tag == "user":
        return plain
    note = f", note = {json.dumps(value.note)}" if value.note else ""
    return f'{{ value = {plain}, tag = "{value.tag}"{note} }}'


def _changed(data: dict[str, Any], changes: Changes) -> dict[str, Any]:
    """What the text must say afterwards."""
    result = copy.deepcopy(data)
    for section, values in changes.items():
        for key, value in values.items():
            result.setdefault(section, {})[key] = tomllib.loads(f"x = {_toml(value)}")["x"]
    return result
