"""The variables of an FMU, from the firmware's tables: what a model description tells
of them."""

from __future__ import annotations

from dataclasses import dataclass

from .. import firmware
from ..firmware import ffi, lib
from ..setups import Setup, parameters

REAL, FLAG, WHOLE, CHOICE = (
    lib.HT_FMU_REAL, lib.HT_FMU_FLAG, lib.HT_FMU_WHOLE, lib.HT_FMU_CHOICE,
)  # fmt: skip
#: Kinds of FMUs -> number.
KINDS = {"controller": lib.HT_FMU_CONTROLLER, "drive": lib.HT_FMU_DRIVE}
#: Roles of variables, with FMI's words.
INPUT, OUTPUT, PARAMETER, TIME = "input", "output", "parameter", "independent"


@dataclass(frozen=True)
class Variable:
    """One variable. start: its number at the beginning, None for an output; live: a parameter that
    may change while the drive runs."""

    reference: int
    name: str
    role: str
    kind: int
    unit: str
    help: str
    start: float | None = None
    min: float | None = None
    max: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = True


def starts(setup: Setup) -> dict[str, float]:
    """The numbers of all parameters of the set-up."""
    table = firmware.parameters(setup["timing.device"])
    return {name: table[name].parse(value) for name, value in parameters(setup).items()}


def variables(setup: Setup, of: str) -> list[Variable]:
    """All variables of an FMU of this kind: time, inputs, outputs, channels, parameters."""
    values = starts(setup)
    table = firmware.parameters(setup["timing.device"])
    given = {"vdc_V": float(setup["inverter.vdc_V"])}
    found = [Variable(lib.HT_FMU_TIME, "time", TIME, REAL, "s", "time")]
    for row in range(lib.HT_FMU_ROWS):
        info = lib.ht_fmu_describe(row)
        if not info.of & KINDS[of]:
            continue
        name, unit, text = (ffi.string(t).decode() for t in (info.name, info.unit, info.help))
        if info.direction == lib.HT_FMU_OUTPUT:
            found.append(Variable(row, name, OUTPUT, info.kind, unit, text))
            continue
        start = values.get(name, given.get(name, 0.0))
        limits = (table[name].min, table[name].max) if name in table else (None, None)
        found.append(Variable(row, name, INPUT, info.kind, unit, text, start, *limits))
    for number in range(lib.ht_channel_count()):
        info = lib.ht_channel_describe(number)
        name, unit, text = (ffi.string(t).decode() for t in (info.name, info.unit, info.help))
        reference = lib.HT_FMU_CHANNEL + number
        found.append(Variable(reference, f"channel.{name}", OUTPUT, REAL, unit, text))
    for p in table.values():
        reference = lib.HT_FMU_PARAMETER + p.id
        kind = lib.ht_fmu_kind(KINDS[of], reference)
        if kind != lib.HT_FMU_UNKNOWN:
            more = (p.min, p.max, p.choices, p.live)
            name = f"parameter.{p.name}"
            start = values[p.name]
            found.append(Variable(reference, name, PARAMETER, kind, p.unit, p.help, start, *more))
    return found
