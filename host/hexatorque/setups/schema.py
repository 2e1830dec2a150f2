"""The schema of a set-up's file for pydantic: checks, and a JSON Schema for editors.

The types are made from the tables of quantities, `keys.KEYS` and the firmware's parameters.
pydantic does the checking; what it finds is said in one line that names the key, its value and
what is allowed.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)
from pydantic_core import PydanticCustomError, core_schema
from typing_extensions import TypedDict

from .. import firmware, given
from ..plant.legs import KINDS, MAX_BREAKS
from ..plant.machines import MODELS
from ..plant.vsd import PHASES
from . import paths
from .derived import DEFAULTS
from .keys import KEYS, MODEL, PROFILE, SECTIONS, TAGS, USER, Key, needed
from .values import Profile, SetupError, Value

#: Type of the errors whose text is ours: what follows the key in its line.
OURS = "set_up"
#: All there are, but for those of pydantic's own that `_said` has replaced.
SAID = (OURS, "extra_forbidden", "string_type", "dict_type")
DRAFT = "http://json-schema.org/draft-07/schema#"


#: The types below are made of values, at run time: nothing that a type checker can follow.
_Annotated: Any = Annotated
_List: Any = list
_Tuple: Any = tuple
_TypedDict: Any = TypedDict


def _mistake(text: str) -> PydanticCustomError:
    return PydanticCustomError(OURS, "{text}", {"text": text})


# -- types of values -------------------------------------------------------------------------


def _said(text: Callable[[Any], str]) -> WrapValidator:
    """Where pydantic refuses a value, `text(value)` says why."""

    def check(value: Any, inner: Callable[[Any], Any]) -> Any:
        try:
            return inner(value)
        except ValidationError as error:
            if any(found["type"] == OURS for found in error.errors()):
                raise
            raise _mistake(text(value)) from None

    return WrapValidator(check)


def _number_given(value: Any) -> Any:
    return given.numeric(given.plain(value))


def _number(key: Key, label: str = "") -> Any:
    whole = key.kind == "integer"

    def why(value: Any) -> str:
        value = _number_given(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return f"{label} = {value!r}: a number is needed"
        allowed = f"{key.min:.9g} .. {key.max:.9g} {key.unit}".rstrip()
        return f"{label} = {_shown(value)}: allowed range is {allowed}" + (
            ", whole numbers only" if whole else ""
        )

    bounds = Field(
        strict=True, ge=key.min, le=key.max, allow_inf_nan=False, multiple_of=1 if whole else None
    )
    number = Annotated[float, bounds, BeforeValidator(_number_given), _said(why)]
    return Annotated[number, AfterValidator(int)] if whole else number


def _shown(value: float) -> str:
    try:
        return f"{value:.9g}"
    except OverflowError:
        return "a number of hundreds of digits"


def _word_or_integer(value: Any) -> Any:
    """To Python, and so to Literal, 4.0 and 4 are the same, and so are true and 1."""
    if isinstance(value, bool) or not isinstance(value, (str, int)):
        raise ValueError
    return value


EXACTLY = BeforeValidator(_word_or_integer)


def _choice(key: Key) -> Any:
    """A choice by name, in capital or small letters. Where names are numbers, or on and off, the
    bare number and TOML's booleans are understood as well. If all are, a number becomes the name.
    """
    numbers = [int(name) for name in key.choices if name.isdecimal()]
    by_name = BeforeValidator(lambda value: given.choice(given.plain(value), key.choices))
    choice: Any = Annotated[Literal[(*key.choices, *numbers)], EXACTLY]
    if set(key.choices) == {"off", "on"}:
        choice = choice | Annotated[bool, Field(strict=True)]
    names = ", ".join(key.choices)
    named = AfterValidator(str if len(numbers) == len(key.choices) else lambda value: value)
    why = _said(lambda value: f" = {value!r}: choose one of {names}")
    return Annotated[choice, by_name, named, why]


def _list_given(value: Any) -> Any:
    return given.listed(value) if isinstance(value, str) else given.plain(value)


def _numbers(count: int, needed: str) -> Callable[[Key], Any]:
    """So many numbers."""
    return lambda key: _Annotated[
        _Tuple[_number(key), ...],
        Field(min_length=count, max_length=count),
        BeforeValidator(_list_given),
        _said(lambda value: f" = {value!r}: {needed}"),
    ]


def _file(_key: Key) -> Any:
    """The name of a file."""
    return _Annotated[
        str,
        Field(strict=True),
        _said(lambda value: f" = {value!r}: the name of a file is needed"),
    ]


_KINDS: dict[str, Callable[[Key], Any]] = {
    "file": _file,
    "number": _number,
    "integer": _number,
    "choice": _choice,
    "phases": _numbers(6, "six numbers are needed (u1 u2 w1 w2 v1 v2)"),
    "pairs": _numbers(4, "four numbers are needed"),
    "harmonics": _numbers(4, "four numbers are needed (orders 5 7 11 13)"),
}


class WithSource:
    """A bare value, or a table that says where it is from: `{ value, tag, note }`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_wrap_validator_function(_value, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        bare = handler(schema)
        table = {
            "type": "object",
            "properties": {
                "value": bare,
                "tag": {"enum": list(TAGS), "description": "where the value is from"},
                "note": {"type": "string", "description": "the place there, or the reason"},
            },
            "required": ["value"],
            "additionalProperties": False,
        }
        return {"anyOf": [bare, table]}


def _value(raw: Any, inner: Callable[[Any], Any]) -> Value:
    if not isinstance(raw, dict):
        return Value(inner(raw), USER)
    if set(raw) - {"value", "tag", "note"} or "value" not in raw:
        raise _mistake(f": expected value, tag, note; got {sorted(raw)}")
    tag, note = raw.get("tag", USER), raw.get("note", "")
    if not isinstance(note, str):
        raise _mistake(": the note must be text")
    if tag not in (*TAGS, USER):
        raise _mistake(f": tag {tag!r}, choose one of {', '.join(TAGS)}")
    return Value(inner(raw["value"]), tag, note)


# -- sections --------------------------------------------------------------------------------


def _table(name: str, entries: dict[str, Any]) -> Any:
    """A TOML table: every key may be left out, no other key is known."""
    table = _TypedDict(name, entries, total=False)
    table.__pydantic_config__ = ConfigDict(extra="forbid")
    return table


def _section(name: str, keys: dict[str, Key]) -> Any:
    def entry(key: Key) -> Any:
        about = f"{key.help} [{key.unit}]" if key.unit else key.help
        extra = {} if key.default is None else {"default": key.default}
        field = Field(description=about, json_schema_extra=extra)
        return Annotated[_KINDS[key.kind](key), WithSource(), field]

    return _table(name, {key: entry(spec) for key, spec in keys.items()})


# -- profile ---------------------------------------------------------------------------------

TIME = Key("number", "", "s", 0, 1e6)
PAIRS = ": a number or a list of [time_s, value] pairs is needed"
ENTRIES = ": a list of [time_s, parameter, value] is needed"
COMMANDS = ": a list of [time_s, stop or start] is needed"
BREAKS = f": a list of at most {MAX_BREAKS} [time_s, phase, kind] is needed"


def _toml_given(value: Any) -> Any:
    """Text of a command line: a number, or a list as TOML writes it."""
    if isinstance(value, str) and value.lstrip().startswith("["):
        try:
            return tomllib.loads(f"x = {value}")["x"]
        except tomllib.TOMLDecodeError:
            return value
    return _number_given(value)


def _steps(key: Key) -> Any:
    value = _number(replace(key, kind="number"))

    def ascend(steps: tuple) -> tuple:
        if any(later[0] <= earlier[0] for earlier, later in itertools.pairwise(steps)):
            raise _mistake(": times must ascend")
        return steps

    constant = _Annotated[value, AfterValidator(lambda v: ((0.0, v),)), Tag("constant")]
    steps = _Annotated[
        _Tuple[_Tuple[_number(TIME, " time"), value], ...],
        AfterValidator(ascend),
        _said(lambda _: PAIRS),
        Tag("steps"),
    ]

    def which(raw: Any) -> str | None:
        if isinstance(raw, (list, tuple)):
            return "steps"
        return "constant" if type(raw) in (int, float) else None

    return Annotated[
        constant | steps,
        Discriminator(which),
        BeforeValidator(_toml_given),
        _said(lambda _: PAIRS),
        Field(description=f"{key.help} [{key.unit}]: a number, or steps [[time_s, value], ...]"),
    ]


def _live(entry: tuple[float, str, Any]) -> tuple[float, str, Any]:
    """A parameter that changes while the drive runs. Text becomes the number or choice that it
    says."""
    time_s, name, value = entry
    name = given.parameter_name(name)
    if name not in paths.controller():
        raise _mistake(f": no parameter {name!r}{given.suggest(name, paths.controller())}")
    row = firmware.parameters()[name]
    if not row.live:
        raise _mistake(f": {name} cannot change while the drive runs")
    try:
        number = row.parse(value)
    except firmware.FirmwareError as error:
        raise _mistake(f": {error}") from None
    return (time_s, name, row.show(number) if isinstance(value, str) else value)


def _command() -> Any:
    """A command that the drive gets while a profile runs."""
    verb = _choice(Key("choice", "", choices=("stop", "start")))
    return _Annotated[_Tuple[_number(TIME, " time"), verb], _said(lambda _: COMMANDS)]


def _break() -> Any:
    """A leg that breaks."""
    return _Annotated[
        _Tuple[
            _number(TIME, " time"),
            _choice(Key("choice", "", choices=PHASES)),
            _choice(Key("choice", "", choices=KINDS)),
        ],
        _said(lambda _: BREAKS),
    ]


def _profile_type() -> Any:
    live = [
        name
        for name, row in firmware.parameters().items()
        if row.live and name in paths.controller()
    ]
    name = Annotated[str, Field(json_schema_extra={"enum": live})]
    entry = _Annotated[
        _Tuple[_number(TIME, " time"), name, Any], AfterValidator(_live), _said(lambda _: ENTRIES)
    ]
    defaults = Profile()
    samples = (1, 2, 4, 5, 8, 10, 20)
    choose = ", ".join(map(str, samples))

    def field(about: str, default: Any) -> Any:
        return Field(description=about, json_schema_extra={"default": default})

    duration, listed = PROFILE["duration_s"], BeforeValidator(_toml_given)
    entries = {
        "duration_s": Annotated[
            _number(duration), field(f"{duration.help} [{duration.unit}]", defaults.duration_s)
        ],
        **{name: _steps(key) for name, key in PROFILE.items() if key.kind == "steps"},
        "set": _Annotated[
            _List[entry],
            listed,
            _said(lambda _: ENTRIES),
            Field(description=PROFILE["set"].help),
        ],
        "command": _Annotated[
            _List[_command()],
            listed,
            _said(lambda _: COMMANDS),
            Field(description=PROFILE["command"].help),
        ],
        "broken": _Annotated[
            _List[_break()],
            Field(max_length=MAX_BREAKS),
            listed,
            _said(lambda _: BREAKS),
            Field(description=PROFILE["broken"].help),
        ],
        "samples_per_period": Annotated[
            Literal[samples],
            EXACTLY,
            BeforeValidator(_number_given),
            _said(lambda value: f" = {value!r}: choose one of {choose}"),
            field(PROFILE["samples_per_period"].help, defaults.samples_per_period),
        ],
    }
    return Annotated[_table("profile", entries), AfterValidator(_profile)]


def _profile(given: dict[str, Any]) -> Profile:
    ordered = {
        key: tuple(sorted(given.get(key, ()), key=lambda entry: entry[0]))
        for key in ("set", "command", "broken")
    }
    return Profile(**{**given, **ordered})


# -- files -----------------------------------------------------------------------------------

_FILE = TypeAdapter(
    _table(
        "set_up",
        {
            "setup": Annotated[
                str, Field(description="the set-up that this one starts from: name or file")
            ],
            "title": str,
            "paper": Annotated[str, Field(description="which paper it is from")],
            "defaults": Annotated[
                _choice(Key("choice", "", choices=DEFAULTS)),
                Field(
                    description="controller parameters that are left open: derived from the rest "
                    "by rules, or the firmware's defaults; default: those of the set-up that "
                    "this one starts from, else derived"
                ),
            ],
            **{section: _section(section, keys) for section, keys in KEYS.items()},
            "controller": _section("controller", paths.controller()),
            "profile": _profile_type(),
        },
    )
)
_WORDS = ("setup", "title", "paper", "defaults")


def check(data: dict[str, Any]) -> dict[str, Any]:
    """The sections that are given, of `Value`s, the texts and the `Profile`. Raises one
    SetupError with a line for every mistake."""
    try:
        return _FILE.validate_python(data)
    except ValidationError as error:
        # Beside a mistake inside a value, pydantic's word on the whole value says nothing new.
        lines = dict.fromkeys(_line(found) for found in error.errors() if found["type"] in SAID)
        raise SetupError("\n".join(lines)) from None


def _line(found: Any) -> str:
    names = [_printable(name) for name in found["loc"][:2]]
    path, last = ".".join(names), names[-1]
    if found["type"] == OURS:
        return path + found["ctx"]["text"]
    if found["type"] == "extra_forbidden":
        if len(names) == 1:
            return paths.unknown_section(last, (*SECTIONS, *_WORDS, "profile"))
        return paths.unknown_key(names[0], last)
    if found["type"] == "string_type":
        return f"{path} = {found['input']!r}: text is needed"
    return f"{path}: a table is needed"


def _printable(name: object) -> str:
    text = str(name)
    return text if text.isprintable() else repr(text)


def json_schema() -> dict[str, Any]:
    """JSON Schema of a file, for completion and checks in an editor. What a file says wrong as
    a whole, an editor does not see."""
    usual = KEYS["machine"][MODEL].default
    required = {section: _required(section, usual) for section in KEYS if section != "machine"}
    required = {section: names for section, names in required.items() if names["required"]}
    required = {"machine": _required_of_machine(usual), **required}
    return {
        "$schema": DRAFT,
        "title": "hexatorque set-up or scenario",
        **_for_editors(_FILE.json_schema()),
        # A file that starts from no other one has to give everything.
        "if": {"not": {"required": ["setup"]}},
        "then": {"required": list(required), "properties": required},
    }


def _required(section: str, model: str) -> dict[str, Any]:
    return {"required": [key for key in KEYS[section] if needed(section, key, model)]}


def _required_of_machine(usual: str) -> dict[str, Any]:
    """The keys that the section needs depend on its model."""
    needs = _required("machine", usual)
    for model in MODELS:
        if model != usual:
            value = {"required": ["value"], "properties": {"value": {"const": model}}}
            told = {"anyOf": [{"const": model}, value]}
            needs = {
                "if": {"required": [MODEL], "properties": {MODEL: told}},
                "then": _required("machine", model),
                "else": needs,
            }
    return needs


def _for_editors(schema: Any) -> Any:
    """Without the titles that pydantic makes of the keys' names, which an editor shows anyway (a
    key that is called title is a schema, not a text), and with pairs as the older drafts have
    them that editors know."""
    if isinstance(schema, list):
        return [_for_editors(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        "items" if name == "prefixItems" else name: _for_editors(part)
        for name, part in schema.items()
        if not (name == "title" and isinstance(part, str))
    }
