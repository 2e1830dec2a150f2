"""The compiled firmware in Python: its tables of parameters and channels, its entry points for
compiled callers, and a `Controller` for each simulated drive."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, TypedDict

import numpy as np

from . import given
from ._firmware import ffi, lib
from .chips import BOARDS, DEVICES
from .errors import InputError
from .results import RESULTS, text_of, waiting

#: A struct or pointer of the C: cffi knows its type, a type checker does not.
CData = Any


def _text(pointer: CData) -> str:
    return ffi.string(pointer).decode()


class State(NamedTuple):
    """A row of the firmware's table of states. Of a state that is not known, everything is
    assumed that calls for care."""

    name: str
    at_work: bool = True  #: the gates are on, or go on without another command
    gates_on: bool = True
    controls: bool = True  #: torque and flux are controlled

    @classmethod
    def of(cls, name: str, flags: int) -> State:
        bits = (lib.HT_AT_WORK, lib.HT_GATES_ON, lib.HT_CONTROLS)
        return cls(name, *(bool(flags & bit) for bit in bits))


STATE_TABLE = tuple(
    State.of(_text(lib.ht_state_name(state)), lib.ht_state_flags(state))
    for state in range(lib.HT_STATES)
)
STATES = tuple(state.name for state in STATE_TABLE)
#: Names of the states of which the host asks.
IDLE, CALIBRATE, BUILD, RUN, FAULT, TEST = (
    STATES[number]
    for number in (
        lib.HT_STATE_IDLE, lib.HT_STATE_CALIBRATE, lib.HT_STATE_BUILD, lib.HT_STATE_RUN,
        lib.HT_STATE_FAULT, lib.HT_STATE_TEST,
    )
)  # fmt: skip


def _faults() -> dict[int, str]:
    rows = (lib.ht_fault_describe(row) for row in range(lib.ht_fault_count()))
    return {row.bit: _text(row.name) for row in rows}


#: Bit -> name of a fault.
FAULTS = _faults()
#: HT_FAULT_PHASE, which is no enumerator.
PHASE_LOST = lib.HT_NUMBER_PHASE_LOST


def causes(bits: int) -> list[str]:
    """Names of the faults whose bits are set."""
    return [text for bit, text in FAULTS.items() if bits & bit]


def _warnings() -> dict[int, str]:
    rows = (lib.ht_warning_describe(row) for row in range(lib.ht_warning_count()))
    return {row.bit: _text(row.name) for row in rows}


#: Bit -> text of a warning.
WARNINGS = _warnings()


def warnings(bits: int) -> list[str]:
    """Texts of the warnings whose bits are set."""
    return [text for bit, text in WARNINGS.items() if bits & bit]


def _events() -> dict[int, str]:
    rows = (lib.ht_event_describe(row) for row in range(lib.ht_event_count()))
    return {row.number: _text(row.text) for row in rows}


#: Number of an event of the log -> what it is.
EVENTS = _events()


def reset_cause(number: int) -> str:
    """The cause of a board's reset; the number if that is unknown."""
    row = lib.ht_reset_describe(number)
    return str(number) if row == ffi.NULL else _text(row.name)


def _limits() -> dict[int, str]:
    rows = (lib.ht_limit_describe(row) for row in range(lib.HT_LIMITS))
    return {row.bit: _text(row.name) for row in rows}


#: Limits that keep the torque from its reference: bit of channel `limits` -> name.
LIMITS = _limits()


def limits(bits: int) -> list[str]:
    """Names of the limits whose bits are set."""
    return [text for bit, text in LIMITS.items() if bits & bit]


class FirmwareError(InputError):
    """The firmware refused a value or a command."""


@dataclass(frozen=True)
class Parameter:
    """One row of the firmware's parameter table."""

    id: int
    name: str
    unit: str
    min: float
    max: float
    initial: float
    live: bool  #: may change while the drive runs
    choices: tuple[str, ...]
    help: str
    whole: bool = False  #: takes whole numbers only

    def parse(self, value: object) -> float:
        """The number for a value, which is a number or the name of a choice, also as text with a
        decimal comma or in capital letters. FirmwareError if it is out of range."""
        value = given.plain(value)
        if self.choices:
            if isinstance(value, bool):
                value = "on" if value else "off"
            text = given.choice(str(value), self.choices)
            if text in self.choices:
                return float(self.choices.index(text))
            raise FirmwareError(f"{self.name} = {value!r}: choose one of {', '.join(self.choices)}")
        value = given.numeric(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise FirmwareError(f"{self.name} = {value!r}: a number is needed")
        try:
            number = float(value)
        except OverflowError:  # a whole number beyond all others
            number = math.inf if value > 0 else -math.inf
        # As the drive has them: a limit that is read back may have become a little less.
        kept, least, most = (ctypes.c_float(one).value for one in (number, self.min, self.max))
        if not least <= kept <= most or (self.whole and number % 1 != 0):
            unit = f" {self.unit}" if self.unit else ""
            whole = ", whole numbers only" if self.whole else ""
            raise FirmwareError(
                f"{self.name} = {number:.9g}: allowed range is "
                f"{self.min:.9g} .. {self.max:.9g}{unit}{whole}"
            )
        return number

    def show(self, value: float) -> str | float:
        return self.choices[int(value)] if self.choices else value


@lru_cache
def parameters(device: str = "") -> dict[str, Parameter]:
    """The parameter table, by name. With `device`, the ranges are those of that board."""
    if device:
        port = ffi.new("ht_port *")
        lib.ht_port_bind(port, ffi.NULL, board_of(device))  # touches no register
        return {name: _on_port(row, port) for name, row in parameters().items()}
    table = {}
    for index in range(lib.ht_param_count()):
        row = lib.ht_param_describe(index)
        choices = _text(row.choices)
        name = _text(row.name)
        table[name] = Parameter(
            index, name, _text(row.unit), decimal(row.min), decimal(row.max),
            decimal(row.initial), row.when == lib.HT_WHEN_LIVE,
            tuple(choices.split("|")) if choices else (), _text(row.help),
            row.whole,
        )  # fmt: skip
    return table


@lru_cache(maxsize=1)
def _group_of() -> dict[str, str]:
    """Name of a parameter -> title of its group."""
    return {
        row.name: _text(lib.ht_group_title(lib.ht_param_group(row.id)))
        for row in parameters().values()
    }


#: Title for parameters that only another firmware has.
OTHER_GROUP = "Other"


def grouped(names: Iterable[str]) -> dict[str, list[str]]:
    """The parameters by the titles of their groups, both in the table's order. Groups without any
    of them are left out."""
    titles = [_text(lib.ht_group_title(k)) for k in range(lib.ht_group_count())]
    groups: dict[str, list[str]] = {title: [] for title in (*titles, OTHER_GROUP)}
    for name in names:
        groups[_group_of().get(name, OTHER_GROUP)].append(name)
    return {title: members for title, members in groups.items() if members}


@lru_cache
def parameters_of_all_boards() -> dict[str, Parameter]:
    """The parameter table, by name, with the ranges of all boards together."""
    boards = [parameters(device) for device in DEVICES]
    return {
        name: replace(
            row, min=min(own[name].min for own in boards), max=max(own[name].max for own in boards)
        )
        for name, row in parameters().items()
    }


def _on_port(row: Parameter, port: CData) -> Parameter:
    span = lib.ht_param_range(port, row.id)
    return replace(row, min=decimal(span.min), max=decimal(span.max))


def board_of(device: str) -> CData:
    """A board's table."""
    if device not in BOARDS:
        raise FirmwareError(f"device = {device!r}: choose one of {', '.join(DEVICES)}")
    return ffi.addressof(getattr(lib, f"ht_board_{device}"))


def decimal(value: float) -> float:
    """The shortest decimal number with the same float32, as it is written in a table."""
    return float(np.format_float_positional(np.float32(value)))


@lru_cache(maxsize=1)
def channels() -> tuple[tuple[str, str], ...]:
    """Telemetry channels: (name, unit), in order."""
    rows = (lib.ht_channel_describe(i) for i in range(lib.ht_channel_count()))
    return tuple((_text(r.name), _text(r.unit)) for r in rows)


def row_of(table: Mapping[str, Parameter], name: str) -> Parameter:
    """The parameter of this name, which may be a set-up's key `controller.NAME`. FirmwareError
    names the nearest one if there is none."""
    plain = given.parameter_name(name)
    if plain not in table:
        raise FirmwareError(unknown(name, table))
    return table[plain]


def unknown(name: str, table: Iterable[str]) -> str:
    """The line about a parameter that there is not."""
    plain = given.parameter_name(name)
    section, dot, key = plain.rpartition(".")
    if dot and key in set(table):
        return (
            f"no parameter {plain!r}: the section {section} belongs to a set-up; "
            f"did you mean 'controller.{key}'?"
        )
    return f"no parameter {plain!r}{given.suggest(key, table)}"


def schemes() -> tuple[str, ...]:
    return parameters()["scheme"].choices


def table_schemes() -> tuple[str, ...]:
    """The schemes with comparators and a switching table."""
    rows = ((name, lib.ht_scheme_describe(k)) for k, name in enumerate(schemes()))
    return tuple(name for name, row in rows if row.law == lib.HT_LAW_TABLE)


def needs_prediction(scheme: str) -> bool:
    """True if the scheme works with shadow load and prediction only. FirmwareError names the
    schemes if there is none of this name."""
    row = lib.ht_scheme_describe(int(parameters()["scheme"].parse(scheme)))
    return lib.ht_law_commands_voltage(row.law)


def address(function: str) -> int:
    """Address of a firmware function."""
    return int(ffi.cast("uintptr_t", ffi.addressof(lib, function)))


def _most_pulse_us(value_of: Callable[[str], Any]) -> float:
    """Longest `min_pulse_us` of which a period holds two."""
    names = ("f_isr_Hz", "load_mode", "write_delay_us", "dead_time_us")
    f_isr_Hz, immediate, write_us, dead_us = (parameters()[n].parse(value_of(n)) for n in names)
    return max(0.0, (1e6 / f_isr_Hz - (write_us if immediate else 0.0)) / 2 - dead_us)


def _most_share(level: str, full: str, share: float) -> Callable[[Callable[[str], Any]], float]:
    """Largest `comparator_above_pu` with which the comparators' level is within the range."""

    def most(value_of: Callable[[str], Any]) -> float:
        level_at, full_at = (parameters()[name].parse(value_of(name)) for name in (level, full))
        return (1 - level_at / full_at) / share

    return most


def _rounded(value: float, way: Callable[[float], int]) -> str:
    """Four digits, on the allowed side: the text is taken when it is given back."""
    if not 0 < value < math.inf:
        return f"{value:.4g}"
    nearest = float(f"{value:.4g}")
    if math.isclose(nearest, value, rel_tol=1e-6):
        return f"{nearest:.4g}"
    digit = 10.0 ** (math.floor(math.log10(value)) - 3)
    return f"{way(value / digit) * digit:.4g}"


def _values(value_of: Callable[[str], Any]) -> dict[str, float]:
    return {name: row.parse(value_of(name)) for name, row in parameters().items()}


def _params(value_of: Callable[[str], Any]) -> CData:
    """The C's `ht_params`."""
    return ffi.new("ht_params *", [list(_values(value_of).values())])


def induced_rpm(v: Mapping[str, Any], volts: float) -> float:
    """Speed at which the magnets that the parameters tell induce this voltage between two
    terminals."""
    terminal_Wb = lib.ht_magnet_terminal_Wb(v["psi_f_Wb"], v["emf5_share"], v["emf7_share"])
    return float(volts / (terminal_Wb * v["pole_pairs"]) * 30 / math.pi)


def _most_rpm(value_of: Callable[[str], Any]) -> float:
    v = _values(value_of)
    return induced_rpm(v, v["vdc_max_V"])


#: Misfit -> the largest value of its first parameter beside the others.
_MOST: dict[int, Callable[[Callable[[str], Any]], float]] = {
    lib.HT_MISFIT_MIN_PULSE: _most_pulse_us,
    lib.HT_MISFIT_COMPARATOR_I: _most_share("i_trip_A", "i_full_A", 1.0),
    lib.HT_MISFIT_COMPARATOR_VDC: _most_share("vdc_max_V", "vdc_full_V", 0.5),
    lib.HT_MISFIT_CEILING: _most_rpm,
    lib.HT_MISFIT_SALIENCY: lambda value_of: _values(value_of)["sigma_ls_H"],
}


def least_band_V(value_of: Callable[[str], Any]) -> float:
    """Least `vdc_band_V` that the capacitor holds."""
    return float(lib.ht_misfit_band_V(_params(value_of)))


def _least_stop_s(misfit: int) -> Callable[[Callable[[str], Any]], float]:
    """Least `stop_s` that holds a misfit's ramp."""

    def least(value_of: Callable[[str], Any]) -> float:
        return float(lib.ht_misfit_stop_s(_params(value_of), misfit))

    return least


def _least_winding_s(value_of: Callable[[str], Any]) -> float:
    """Least `winding_s` that the slow interrupts follow; infinite if the frame is too quick."""
    others = lib.ht_misfit_heat_per_s(_params(value_of))
    others -= 1 / parameters()["winding_s"].parse(value_of("winding_s"))
    left = 0.125 * parameters()["f_slow_Hz"].parse(value_of("f_slow_Hz")) - others
    return 1 / left if left > 0 else math.inf


def _least_short_A(value_of: Callable[[str], Any]) -> float:
    """Largest current of the short circuit of all legs, which the magnets must bear."""
    return float(lib.ht_magnet_trip_short_A(_params(value_of)))


def least_ripple_Hz(value_of: Callable[[str], Any]) -> float:
    """Least `f_isr_Hz` at which the ripple of interleaved carriers is small enough."""
    return float(lib.ht_misfit_ripple_Hz(_params(value_of)))


def _least_counts(value_of: Callable[[str], Any]) -> float:
    """Fewest readings in a revolution that tell the rotor's angle."""
    return float(lib.ht_absolute_least(_values(value_of)["pole_pairs"]))


def _least_lxy_H(value_of: Callable[[str], Any]) -> float:
    """Least `lxy_H` with which a period of the scheme's vectors stays below `i_trip_A`."""
    v = _values(value_of)
    winding = lib.ht_winding_of(ffi.new("float[]", list(v.values())))
    step_pu = lib.ht_scheme_xy_step_pu(lib.ht_scheme_describe(int(v["scheme"])), winding)
    return float(step_pu * v["vdc_max_V"] / (v["i_trip_A"] * v["f_isr_Hz"]))


#: The same with its least value.
_LEAST: dict[int, Callable[[Callable[[str], Any]], float]] = {
    lib.HT_MISFIT_VDC_BAND: least_band_V,
    lib.HT_MISFIT_STOP_TIME: _least_stop_s(lib.HT_MISFIT_STOP_TIME),
    lib.HT_MISFIT_QUICK_STOP_TIME: _least_stop_s(lib.HT_MISFIT_QUICK_STOP_TIME),
    lib.HT_MISFIT_HEAT_TIMES: _least_winding_s,
    lib.HT_MISFIT_SHORT_BEARS: _least_short_A,
    lib.HT_MISFIT_XY_RIPPLE: least_ripple_Hz,
    lib.HT_MISFIT_ABSOLUTE: _least_counts,
    lib.HT_MISFIT_XY_STEP: _least_lxy_H,
}
#: Of these the value is the second's: the first is a choice.
_OF_SECOND = (lib.HT_MISFIT_XY_STEP,)


#: Misfit of a thermistor -> where it is.
_NTC = {lib.HT_MISFIT_WINDING_NTC: "winding", lib.HT_MISFIT_SINK_NTC: "sink"}


def _pull_up_text(misfit: int, value_of: Callable[[str], Any]) -> str:
    """Pull-up resistors with which the readings tell all temperatures."""
    table, place = parameters(), _NTC[misfit]
    hot_degC = lib.ht_misfit_ntc_degC(_params(value_of), misfit)
    ohm, beta_K = (
        table[name].parse(value_of(name)) for name in (f"{place}_ntc_ohm", f"{place}_ntc_K")
    )
    config = ffi.new("ht_ntc_config *")

    def share_at(degC: float) -> float:
        """Pull-up over resistance at 25 degC with which the middle reading tells this."""
        low, high = 1e-6, 1e6
        while high > low * (1 + 1e-6):
            middle = math.sqrt(low * high)
            lib.ht_ntc_configure(config, ohm, beta_K, middle * ohm, 1.0)
            hotter = lib.ht_ntc_degC(config, lib.HT_ADC_FULL / 2) > degC
            low, high = (middle, high) if hotter else (low, middle)
        return low

    ends = lib.HT_NTC_END_COUNTS / (lib.HT_ADC_FULL - lib.HT_NTC_END_COUNTS)
    least, most = share_at(lib.HT_NTC_COLD_DEGC) * ohm * ends, share_at(hot_degC) * ohm / ends
    return f"{least:.4g} to {most:.4g}"


def misfit_text(misfit: int, value_of: Callable[[str], Any]) -> str:
    """Why parameters do not fit together. misfit: what the firmware said (ht_misfits.def);
    value_of: the value that was asked for, or is in force, by the parameter's name."""
    text = RESULTS[lib.HT_ERROR_CONFIG].text
    reason = misfit_reason(misfit, value_of)
    return f"{text}: {reason}" if reason else text


def misfit_names(misfit: int) -> tuple[str, ...]:
    """The parameters that a misfit is about, one or two."""
    row, table = lib.ht_misfit_describe(misfit), list(parameters())
    return tuple(dict.fromkeys((table[row.first], table[row.second])))


def misfit_reason(misfit: int, value_of: Callable[[str], Any]) -> str:
    """The same without the words that parameters do not fit together; "" for an unknown misfit."""
    row = lib.ht_misfit_describe(misfit)
    if row == ffi.NULL:
        return ""
    table = list(parameters().values())
    first, second = table[row.first], table[row.second]

    def shown(p: Parameter, share: float = 1.0) -> str:
        value = p.parse(value_of(p.name))
        if p.choices:
            return f"{p.name} = {p.show(value)}"
        return f"{p.name} = {share * value:.6g} {p.unit}".rstrip()

    if row.share == 0:
        both = dict.fromkeys((shown(first), shown(second)))
        allowed = ""
        if misfit in _MOST:
            most = f"{_rounded(_MOST[misfit](value_of), math.floor)} {first.unit}".rstrip()
            least = f"{first.min:.4g} " if first.min else "up "
            allowed = f"allowed is {least}to {most}: "
        if misfit in _NTC:
            allowed = f"allowed is {_pull_up_text(misfit, value_of)} {first.unit}: "
        if misfit in _LEAST:
            of, beside = (second, first) if misfit in _OF_SECOND else (first, second)
            enough = _LEAST[misfit](value_of)
            least = f"{_rounded(enough, math.ceil)} {of.unit}".rstrip()
            name = f"{of.name} = " if misfit in _OF_SECOND else ""
            allowed = f"allowed is {name}{least} and more: "
            if enough > of.max:
                other = beside.name if beside is not of else "another parameter"
                allowed = f"no value in its range is enough, change {other}: "
        return f"{', '.join(both)}: {allowed}{_text(lib.ht_misfit_demand(misfit))}"
    share = decimal(row.share)
    word = "allowed is up to" if row.touch else "must be below"
    times = "" if share == 1 else f"{share:g} "
    return f"{shown(first)}: {word} {times}{shown(second, share)}"


def misfit_of(device: str, numbers: Sequence[float]) -> int:
    """The first misfit of all parameters on a board, by number; 0 if they fit together."""
    params = ffi.new("ht_params *", [list(numbers)])
    return lib.ht_misfit_of(params, board_of(device).map.pwm_clock_Hz)


class Order(NamedTuple):
    """`less` is at most `share` times `more` (ht_misfits.def)."""

    less: str
    share: float
    more: str


@lru_cache(maxsize=1)
def orders() -> tuple[Order, ...]:
    """The orders that the firmware demands of its parameters."""
    names = list(parameters())
    rows = (lib.ht_misfit_describe(misfit) for misfit in range(1, lib.HT_MISFITS))
    return tuple(Order(names[r.first], decimal(r.share), names[r.second]) for r in rows if r.share)


#: All legs as a state word (HT_ALL_LEGS).
ALL_LEGS = lib.HT_NUMBER_ALL_LEGS

#: Text for the set of parameters that a start took, by its number (ht_sets.def).
PARAMETER_SETS = tuple(_text(lib.ht_set_text(number)) for number in range(lib.ht_set_count()))


class _Kept(TypedDict):
    tick: int
    adc_counts: list[int]
    position_counts: int
    i_A: list[float]
    vdc_V: float
    torque_ref_Nm: float
    flux_ref_Wb: float
    psi_Wb: list[float]
    torque_Nm: float
    speed_rpm: float


class SnapshotNumbers(_Kept):
    """The values that the firmware saved at a fault; state, faults and warnings as numbers."""

    state: int
    faults: int
    warnings: int


class Snapshot(_Kept):
    """The same, with state, faults and warnings by name."""

    state: str
    faults: list[str]
    warnings: list[str]


def snapshot_numbers(s: CData) -> SnapshotNumbers | None:
    """The fields of an `ht_snapshot` by name; None if there was no fault."""
    if not s.tick:
        return None
    measured = getattr(s, "in")
    return {
        "tick": s.tick,
        "state": s.state,
        "faults": s.faults,
        "warnings": s.warnings,
        "adc_counts": list(s.samples.adc),
        "position_counts": s.samples.position,
        "i_A": list(measured.i_A.p),
        "vdc_V": measured.vdc_V,
        "torque_ref_Nm": measured.torque_ref_Nm,
        "flux_ref_Wb": measured.flux_ref_Wb,
        "psi_Wb": [s.estimate.psi_Wb.alpha, s.estimate.psi_Wb.beta],
        "torque_Nm": s.estimate.torque_Nm,
        "speed_rpm": s.speed_rpm,
    }


def snapshot_of(s: CData) -> Snapshot | None:
    """The same, with state, faults and warnings by name."""
    kept = snapshot_numbers(s)
    if kept is None:
        return None
    return {
        **kept,
        "state": STATES[kept["state"]],
        "faults": causes(kept["faults"]),
        "warnings": warnings(kept["warnings"]),
    }


class Store:
    """A memory for a drive's saved parameters and for its log (ht_store_port.h). This class has
    none: the log forgets with the end of the controller."""

    def __init__(self) -> None:
        self.handle = ffi.new("ht_store *")
        lib.ht_store_none(self.handle)
        self.log = ffi.new("ht_drive_log *")
        lib.ht_log_none(self.log)


class MemoryStore(Store):
    """A memory in the bytes `areas`: two areas of the parameters, then two of the log; missing
    ones are added. Erased bytes are 0xFF, and words have the low byte first. Give the same `areas`
    to the next controller to keep what is saved."""

    BLOCK = lib.HT_STORE_FILE_BLOCK
    AREA = lib.HT_STORE_FILE_BLOCKS * BLOCK
    LOG_AREA = lib.HT_STORE_FILE_LOG_BLOCKS * BLOCK
    LOG = lib.HT_STORE_FILE_AREAS * AREA  #: where the log begins
    SIZE = LOG + lib.HT_STORE_FILE_AREAS * LOG_AREA

    def __init__(self, areas: bytearray | None = None) -> None:
        super().__init__()
        self.areas = bytearray() if areas is None else areas
        self.areas.extend(b"\xff" * (self.SIZE - len(self.areas)))
        # This object keeps the callbacks alive. An exception in one counts as a failure, and is
        # printed on stderr.
        self._read = ffi.callback("bool(void *, uint16_t, uint16_t, uint16_t *)", self._do_read)
        self._write = ffi.callback(
            "bool(void *, uint16_t, uint16_t, const uint16_t *)", self._do_write
        )
        port = self.handle.port
        port.read, port.write = self._read, self._write
        port.blocks = lib.HT_STORE_FILE_BLOCKS
        self._read_log = ffi.callback(
            "bool(void *, uint16_t, uint16_t, uint16_t *)", self._do_read_log
        )
        self._write_log = ffi.callback(
            "bool(void *, uint16_t, uint16_t, const uint16_t *)", self._do_write_log
        )
        port = self.log.ring.port
        port.read, port.write = self._read_log, self._write_log
        port.blocks = lib.HT_STORE_FILE_LOG_BLOCKS

    def _do_read(self, at: CData, area: int, block: int, words: CData) -> bool:
        return self._take(area * self.AREA + block * self.BLOCK, words)

    def _do_write(self, at: CData, area: int, block: int, words: CData) -> bool:
        begin = area * self.AREA
        return self.put(*self._wanted(begin, self.AREA, block, words))

    def _do_read_log(self, at: CData, area: int, block: int, words: CData) -> bool:
        return self._take(self.LOG + area * self.LOG_AREA + block * self.BLOCK, words)

    def _do_write_log(self, at: CData, area: int, block: int, words: CData) -> bool:
        begin = self.LOG + area * self.LOG_AREA
        return self.put(*self._wanted(begin, self.LOG_AREA, block, words))

    def _take(self, begin: int, words: CData) -> bool:
        ffi.memmove(words, bytes(self.areas[begin : begin + self.BLOCK]), self.BLOCK)
        return True

    def _wanted(self, begin: int, size: int, block: int, words: CData) -> tuple[int, bytes]:
        """The place and the bytes of a write."""
        if words == ffi.NULL:
            return begin, b"\xff" * size
        return begin + block * self.BLOCK, bytes(ffi.buffer(words, self.BLOCK))

    def put(self, begin: int, raw: bytes) -> bool:
        """Write bytes into the areas, from `begin` on. Returns whether that worked."""
        self.areas[begin : begin + len(raw)] = raw
        return True


class Controller:
    """The firmware of one drive on its own chip. It starts as after a reset: first the board, then
    the drive. `device` is any of BOARDS, which decides the pins and the PWM modules."""

    #: Entry points for compiled callers. Their argument is `handle`; the last one also takes the
    #: address of the channels.
    entries = ("ht_virtual_period", "ht_drive_slow_isr", "ht_channels_read")
    processor = "host"

    def __init__(
        self,
        device: str,
        values: Mapping[str, object],
        *,
        active_low: bool | None = None,
        store: Store | None = None,
    ) -> None:
        """values: parameters; active_low: whether the gate drivers invert, None for the build's
        own setting; store: a memory whose saved parameters replace `values`."""
        self.parameters = parameters(device)
        board = self._board = ffi.new("ht_board *", board_of(device)[0])
        if active_low is not None:
            board.gates_active_low = active_low
        self.map = board.map
        self.registers = ffi.new("ht_regfile *")
        self.port = ffi.new("ht_port *")
        self.drive = ffi.new("ht_drive *")
        lib.ht_regfile_reset(self.registers, self.map)
        self.registers.gates_active_low = board.gates_active_low
        lib.ht_port_bind(self.port, self.registers, board)
        if not lib.ht_board_start(self.port):
            raise FirmwareError(f"{device}: the board does not start")
        params = ffi.new("ht_params *")
        lib.ht_params_default(params)
        for name, value in values.items():
            row = row_of(self.parameters, name)
            params.v[row.id] = row.parse(value)
        self.store = store or Store()
        result = lib.ht_store_start(self.store.handle, self.drive, self.port, params)
        if result == lib.HT_ERROR_CONFIG:
            raise FirmwareError(f"controller set-up: {self._why_unfit(params)}")
        self._check(result, "controller set-up")

    def _why_unfit(self, params: Any) -> str:
        """Why parameters (ht_params) do not fit together."""
        misfit = lib.ht_misfit_of(params, self.map.pwm_clock_Hz)
        asked = {name: row.show(params.v[row.id]) for name, row in self.parameters.items()}
        return misfit_text(misfit, asked.__getitem__)

    def _check(self, result: int, what: str) -> None:
        if result != lib.HT_OK:
            raise FirmwareError(f"{what}: {text_of(result, self.state)}")

    @property
    def parameter_set(self) -> str:
        """Text for the set of parameters that the start took."""
        return PARAMETER_SETS[self.store.handle.set]

    @property
    def handle(self) -> int:
        """Address of the drive, the argument of its entry points."""
        return int(ffi.cast("uintptr_t", self.drive))

    @property
    def period_counts(self) -> int:
        return self.drive.config.control.period.counts

    @property
    def fast_per_slow(self) -> int:
        """Fast interrupts from one slow interrupt to the next."""
        return round(self.number("f_isr_Hz") / self.number("f_slow_Hz"))

    @property
    def shadow(self) -> bool:
        """Whether a switching pattern takes effect in the next period instead of at once."""
        return self.drive.config.control.shadow

    def confirm(self) -> None:
        """Raise an error if the latest call failed. In this process it cannot fail."""

    def channel(self, name: str) -> float:
        """Present value of a telemetry channel."""
        values = ffi.new("float[]", len(channels()))
        lib.ht_channels_read(self.drive, values)
        return values[[n for n, _ in channels()].index(name)]

    def set_trip_pin(self, level: int) -> None:
        """Set the level of the trip pin, 0 or 1."""
        lib.ht_regfile_pin(self.registers, self.port.board.trip.gpio, level)

    def register_words(self) -> np.ndarray:
        """The register file below 0x8000, uint16. The array shows changes as they happen."""
        words = np.frombuffer(ffi.buffer(self.registers.word), np.uint16)
        return words[:0x8000]

    @property
    def condition(self) -> State:
        """The state, with what it says about the drive."""
        return STATE_TABLE[self.drive.state]

    @property
    def state(self) -> str:
        return self.condition.name

    @property
    def faults(self) -> list[str]:
        return causes(self.drive.faults)

    @property
    def snapshot(self) -> Snapshot | None:
        """The values that the firmware saved at the latest fault, or None."""
        return snapshot_of(self.drive.snapshot)

    def get(self, name: str) -> str | float:
        """A parameter's value, a choice by name."""
        return row_of(self.parameters, name).show(self.number(name))

    def number(self, name: str) -> float:
        """A parameter's value as a number."""
        return lib.ht_drive_get(self.drive, row_of(self.parameters, name).id)

    def set(self, name: str, value: object) -> None:
        self.set_many({name: value})

    def set_many(self, values: Mapping[str, object]) -> None:
        """Set several values. If one is refused, none changes."""
        values = {row_of(self.parameters, name).name: value for name, value in values.items()}
        rows = [self.parameters[name] for name in values]
        if not rows:
            return
        ids = ffi.new("uint16_t[]", [row.id for row in rows])
        numbers = ffi.new("float[]", [row.parse(v) for row, v in zip(rows, values.values())])
        at = ffi.new("uint16_t *")
        result = lib.ht_drive_write(self.drive, ids, numbers, len(rows), at)
        asked = ", ".join(f"{name} = {value}" for name, value in values.items())
        if result == lib.HT_ERROR_CONFIG:
            text = misfit_text(
                at[0], lambda name: values[name] if name in values else self.get(name)
            )
            raise FirmwareError(f"{asked}: {text}")
        self._check(result, asked)

    def start(self) -> None:
        result = lib.ht_drive_start(self.drive)
        if result == lib.HT_ERROR_RESTART:
            raise FirmwareError(f"start: {waiting(lib.ht_drive_restart_wait(self.drive))}")
        self._check(result, "start")

    def stop(self) -> None:
        lib.ht_drive_stop(self.drive)

    def clear(self) -> None:
        self._check(lib.ht_drive_clear(self.drive), "clear")
