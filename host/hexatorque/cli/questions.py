"""The questions of `hexatorque new` when it is given no list.

Each question has the value's unit and range. Enter accepts the value in brackets: it follows
from the answers so far, or is usual. Such a value is left out of the list where the set-up would
estimate it by the same rule: there its tag says so.
"""

from __future__ import annotations

from typing import Any

import click

from ..setups import SetupError
from ..setups import new as writing
from ..setups.keys import Key
from ..setups.nameplate import ThreePhase

#: What is asked, in this order. All else has its usual value, and can be changed in the file.
FIRST = "phases"
LAST = ("inertia_kgm2", "displacement_deg", "i_full_A", "dead_time_us", "encoder_ppr", "device")
PLATE = (
    *(FIRST, "power_kW", "voltage_V", "current_A", "power_factor", "frequency_Hz", "speed_rpm"),
    *("poles", "efficiency", "vdc_V", *LAST),
)
CIRCUIT = (
    *(
        FIRST,
        "pole_pairs",
        "rs_ohm",
        "rr_ohm",
        "lls_H",
        "llr_H",
        "lm_H",
        "lxy_H",
        "vdc_V",
        "current_A",
    ),
    *("torque_Nm", "speed_rpm", *LAST),
)
MAGNETS = (
    *(FIRST, "poles", "ke_V", "rs_ohm", "ld_H", "lq_H", "lxy_H", "vdc_V", "current_A"),
    *("torque_Nm", "speed_rpm", *LAST),
)
#: After this answer the plate can contradict itself: before what it does not have is asked.
COMPLETE = "poles"
#: Of values that nothing suggests.
EXAMPLES = {
    "power_kW": "7.5",
    "voltage_V": "400",
    "current_A": "7.8",
    "speed_rpm": "1455",
    "power_factor": "0.85",
    "efficiency": "0.9",
    "pole_pairs": "2",
    "rs_ohm": "1.8",
    "rr_ohm": "2",
    "lls_H": "0.01",
    "lm_H": "0.284",
    "ke_V": "47",
    "ld_H": "0.0021",
    "inertia_kgm2": "0.03",
    "torque_Nm": "40",
    "vdc_V": "600",
}
#: These only begin a question: the answer goes into the list even if it was suggested.
ALWAYS_TOLD = ("frequency_Hz", "poles", "llr_H")
UNKNOWN = "not known"


def ask(title: str) -> str:
    """Asks until the answers make a set-up. Returns its text."""
    click.echo(
        "hexatorque drives six-phase machines: two sets of three phases, 30, 0 or 60 degrees "
        "apart.\n"
        "Enter takes the answer in [brackets]."
    )
    kind = click.prompt(
        "What do you have? nameplate or circuit per phase of an induction machine, or magnets",
        type=click.Choice(["nameplate", "circuit", "magnets"]),
        default="nameplate",
    )
    names, keys, make = {
        "nameplate": (PLATE, writing.NAMEPLATE, writing.from_nameplate),
        "circuit": (CIRCUIT, writing.CIRCUIT, writing.from_circuit),
        "magnets": (MAGNETS, writing.MAGNETS, writing.from_magnets),
    }[kind]
    before: dict[str, str] = {}
    while True:
        given: dict[str, Any] = {}
        told: dict[str, str] = {}
        try:
            for name in names:
                if word := _answer(name, keys[name], given, before.get(name)):
                    given[name] = writing.value(name, word, keys[name])
                    told[name] = word
                if name == COMPLETE and kind == "nameplate":
                    make(_list(told), title)
            return make(_list(told), title)
        except ThreePhase as error:
            click.echo(f"{error}\nAnswer again, for the rewound machine; Enter takes these values.")
            before = before | told | error.rewound
        except SetupError as error:
            click.echo(f"{error}\nAnswer again; Enter keeps your answer.")
            before = before | told


def _list(told: dict[str, str]) -> str:
    return ",".join(f"{name}={word}" for name, word in told.items())


def _answer(name: str, key: Key, given: dict[str, Any], before: str | None) -> str:
    """The word to put into the list; empty: leave it to the set-up."""
    suggested = writing.suggestion(name, given)
    if suggested is None and key.default is not None:
        suggested = key.default or UNKNOWN
    shown = before or (None if suggested is None else str(suggested))
    word = click.prompt(_question(name, key), default=shown, value_proc=_reader(name, key))
    if before is None and word == str(suggested) and name not in ALWAYS_TOLD:
        return ""
    return "" if word == UNKNOWN else word


def _question(name: str, key: Key) -> str:
    about = key.help.split(", 0:")[0]
    if key.kind == "choice":
        return f"{name}: {about}, {' or '.join(key.choices)}"
    example = f", for example {EXAMPLES[name]}" if name in EXAMPLES else ""
    allowed = f"{key.min:.9g} .. {key.max:.9g} {key.unit}".rstrip()
    return f"{name}: {about}, {allowed}{example}"


def _reader(name: str, key: Key):
    def read(text: str) -> str:
        word = text.strip()
        if word == UNKNOWN and key.default is not None:
            return word
        try:
            writing.value(name, word, key)
        except SetupError as error:
            raise click.UsageError(str(error)) from None
        return word

    return read
