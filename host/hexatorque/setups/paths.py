"""Keys as they are written everywhere: `section.key`, such as `machine.rs_ohm`.

The command line (`--set`, `--grid`), files of studies, and Python (`setup["machine.rs_ohm"]`,
`setup.changed({"machine.rs_ohm": 2})`) all come here. `keys` has the quantities; those of the
section `controller` are the firmware's parameters.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from ..given import suggest
from .keys import KEYS, PROFILE, SECTIONS, TIMING_OWNS, Key
from .values import SetupError

CONTROLLER, PROFILE_SECTION = "controller", "profile"
#: Sections whose values have a path.
WITH_PATHS = (*SECTIONS, PROFILE_SECTION)


@lru_cache(maxsize=1)
def controller() -> dict[str, Key]:
    """The keys of the section controller: all parameters but those of `TIMING_OWNS`."""
    from .. import firmware

    return {
        name: Key(
            "choice" if row.choices else "integer" if row.whole else "number",
            row.help, row.unit, row.min, row.max, row.choices,
        )
        for name, row in firmware.parameters_of_all_boards().items()
        if name not in TIMING_OWNS
    }  # fmt: skip


def keys(section: str) -> Mapping[str, Key]:
    """The keys of a section."""
    if section == CONTROLLER:
        return controller()
    return PROFILE if section == PROFILE_SECTION else KEYS[section]


def every() -> Iterator[str]:
    """All paths."""
    return (f"{section}.{key}" for section in WITH_PATHS for key in keys(section))


def split(path: object) -> tuple[str, str]:
    """Section and key. SetupError for a path that there is not."""
    text = path if isinstance(path, str) else repr(path)
    section, dot, key = text.strip().partition(".")
    if not dot or not isinstance(path, str):
        raise SetupError(f"unknown key {text}: SECTION.KEY is needed{_meant(text)}")
    if section not in WITH_PATHS:
        raise SetupError(unknown_section(section, WITH_PATHS))
    if key not in keys(section):
        raise SetupError(unknown_key(section, key))
    return section, key


def key_of(path: str) -> Key:
    section, key = split(path)
    return keys(section)[key]


def unknown_section(section: str, known: Iterable[str]) -> str:
    """The line about a section that there is not."""
    return f"unknown section {section!r}{suggest(section, known)}"


def unknown_key(section: str, key: str) -> str:
    """The line about a key that a section does not have."""
    if section == CONTROLLER and key in TIMING_OWNS:
        latencies = ", ".join(KEYS["timing"]["latency"].choices)
        return f"{section}.{key}: set timing.latency ({latencies}) instead"
    return f"unknown key {section}.{key}{suggest(key, keys(section))}"


def _meant(key: str) -> str:
    """The sections to which a key without its section may belong."""
    names = {name.lower() for section in WITH_PATHS for name in keys(section)}
    close = difflib.get_close_matches(key.lower(), names, 1)
    found = [path for path in every() if close and path.partition(".")[2].lower() == close[0]]
    return f"; did you mean {' or '.join(found)}?" if found else ", as in machine.rs_ohm"


def assignment(text: str, option: str) -> tuple[str, str]:
    """Path and value of SECTION.KEY=VALUE; the value as text, which a set-up reads."""
    path, equals, value = (part.strip() for part in text.partition("="))
    if not path or not equals or not value:
        raise SetupError(f"{option} {text}: SECTION.KEY=VALUE is needed, as in machine.rs_ohm=2")
    split(path)
    return path, value


def sections(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Values by path as the sections of a set-up's file. One SetupError with a line for every
    unknown path."""
    found: dict[str, dict[str, Any]] = {}
    lines = []
    for path, value in values.items():
        try:
            section, key = split(path)
        except SetupError as error:
            lines.append(str(error))
        else:
            found.setdefault(section, {})[key] = value
    if lines:
        raise SetupError("\n".join(lines))
    return found
