"""The translated functions of the plant, and its records as C."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..plant import loop, machine
from ..plant.gates import GATES
from ..plant.inverter import INVERTER
from ..plant.load import LOAD, set_load, shaft_step_s
from ..plant.pwm import PWM, PWM_MAP
from ..plant.record import names_of
from ..plant.sensors import SENSORS, sample_encoder
from .translator import COMPLEX_TYPE, HELPERS, Translator
from .types import INT, REAL, SINGLE, UINT, WORD, Array, Entry, Table

HEADER, CODE = "ht_plant.h", "ht_plant.c"
_ABOUT = """\
/* The plant of hexatorque's simulation, with its bits: translated from the Python functions of
 * host/hexatorque/plant by host/hexatorque/to_c. */
"""


def _chosen(function: Any, kinds: Sequence[Any]) -> Any:
    """The machine model's implementation, where the models have several."""
    models = machine._MODELS.get(function)
    if models is None:
        return function
    names = kinds[0].dtype.names
    return next(made for model, made in models.items() if model in names)


def translate(kind: np.dtype) -> dict[str, str]:
    """File's name -> text of the plant with a machine whose record is of this type."""
    t = Translator(_chosen)
    y = Array(REAL, (8,))
    instants = Array(INT, (None,))
    timing = t.record(loop.TIMING, "plant_timing")
    plant = t.parts(
        "plant",
        machine=t.record(kind, "plant_machine"),
        load=t.record(LOAD, "plant_load"),
        inverter=t.record(INVERTER, "plant_inverter"),
        sensors=t.record(SENSORS, "plant_sensors"),
        y=y,
    )
    pwm = t.record(PWM, "plant_pwm")
    chip = t.parts(
        "plant_chip",
        map=t.record(PWM_MAP, "plant_map"),
        pwm=pwm,
        gates=t.record(GATES, "plant_gates"),
        registers=Array(WORD, (None,)),
        handle=UINT,
    )
    samples = t.parts(
        "plant_samples",
        instants=instants,
        plant=Table(SINGLE),
        address=UINT,
        channels=Table(SINGLE),
        edges=Table(INT),
    )
    t.function(
        loop.run_periods,
        [INT, INT, timing, plant, REAL, chip, Entry(1), Entry(1), Entry(2), samples, INT],
        "plant_run_periods",
    )
    m, load, inverter = (kind for _, kind in plant.fields[:3])
    row = Array(SINGLE, (None,))
    t.function(loop._record, [row, m, inverter, y, Array(REAL, (4,))], "plant_look")
    t.function(machine.phase_current, [m, y, INT], "plant_current_A")
    t.function(set_load, [load, INT, REAL, REAL], "plant_set_load")
    t.function(shaft_step_s, [load, REAL, REAL, REAL, REAL], "plant_shaft_step_s")
    return files(t)


def translate_encoder() -> dict[str, str]:
    """The same of the encoder alone."""
    t = Translator(_chosen)
    sensors = t.record(SENSORS, "plant_sensors")
    t.function(sample_encoder, [sensors, REAL, Array(WORD, (None,))], "plant_encoder")
    return files(t)


def initialiser(part: np.record | np.ndarray) -> str:
    """The value of a record or an array in C."""
    if isinstance(part, np.void):
        rows = [f".{name} = {initialiser(part[name])}" for name in names_of(part.dtype)]
        return f"{{{', '.join(rows)}}}"
    if part.shape:
        return f"{{{', '.join(initialiser(one) for one in part.ravel())}}}"
    number = part.item()
    if isinstance(number, complex):
        return f"{{{number.real!r}, {number.imag!r}}}"
    if part.dtype == np.uint64:
        return f"UINT64_C({number})"
    if isinstance(number, float):
        return "INFINITY" if number == np.inf else repr(number)
    return f"INT64_C({number})"


def files(t: Translator) -> dict[str, str]:
    """The translation as a header and a source file: name -> text."""
    texts = ", ".join(f'"{text}"' for text in t.errors)
    header = f"""\
{_ABOUT}#ifndef HT_PLANT_H
#define HT_PLANT_H

#include <stdbool.h>
#include <stdint.h>

{COMPLEX_TYPE}

{t.types()}

{t.declarations()}

extern const char *const plant_errors[];
extern const int64_t plant_error_count;
#endif
"""
    code = f"""\
{_ABOUT}#include "{HEADER}"

#include <math.h>

{HELPERS}
{t.functions()}
/* What `*failed` says, from 1 on. */
const char *const plant_errors[] = {{{texts or 0}}};
const int64_t plant_error_count = {len(t.errors)};
"""
    return {HEADER: header, CODE: code}
