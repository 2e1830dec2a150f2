"""Set-ups and scenarios: TOML files with every value named, checked and tagged.

A *set-up* describes machine, inverter, sensors, timing, load and controller. A
*scenario* starts from a set-up (`setup = "paper-b"`), overrides values and adds a
profile of references and loads over time.

A value is either bare (`rs_ohm = 1.8`) or carries where it comes from:
`rs_ohm = { value = 1.8, tag = "paper", note = "Table III" }` with tag paper,
assumed or measured. Unknown keys and impossible values are refused with the key's
name and the allowed range, all of a file together.

`keys` has the quantities, `schema` checks a file against them, `loading` reads files,
`setup` is the result, `to_parameters` makes the controller's parameters of it.

Importing this needs nothing but Python, and no compiled firmware; checking a file does.
"""

from .keys import KEYS, LATENCIES, LOADS, TAGS, USER
from .loading import builtin_names, load, parse
from .setup import Setup, describe, show
from .to_parameters import parameters
from .values import Profile, SetupError, Value

__all__ = [
    "KEYS",
    "LATENCIES",
    "LOADS",
    "TAGS",
    "USER",
    "Profile",
    "Setup",
    "SetupError",
    "Value",
    "builtin_names",
    "describe",
    "json_schema",
    "load",
    "parameters",
    "parse",
    "show",
]


def json_schema() -> dict:
    """JSON Schema of a set-up or scenario file, for editors."""
    from . import schema

    return schema.json_schema()
