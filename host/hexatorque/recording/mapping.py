"""Names and scales for the channels of a table that knows neither, as an oscilloscope's.

`CH1=i_u1_A*100` makes channel i_u1_A of 100 times CH1. CH1 is in V then, whatever the range was in
which it was measured: `table.si` has taken prefixes into the numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..given import real, suggest
from .channels import Channels
from .recording import TRIGGER, Recording, RecordingError, check_names
from .table import seconds_of

_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?"
_STEP = re.compile(rf"\s*([*/+-])\s*({_NUMBER})\s*")
_TARGET = re.compile(rf"\s*([^\W\d][\w.]*)\s*((?:[*/+-]\s*{_NUMBER}\s*)*)")
#: Units that measure the same; a unit that is not here fits only itself.
_ALIKE = (
    {"A"}, {"V"}, {"Wb", "Vs"}, {"N m", "Nm"}, {"ohm", "Ω"},
    {"r/min", "rpm", "1/min", "U/min", "min-1", "rad/s", "Hz", "1/s"},
)  # fmt: skip
#: Of these, the ones that need no factor between each other.
_SAME = ({"r/min", "rpm", "1/min", "U/min", "min-1"}, {"N m", "Nm"}, {"ohm", "Ω"}, {"Wb", "Vs"})
#: Largest shift of the time.
MOST_SHIFT_S = 1e6


@dataclass(frozen=True)
class Rule:
    """source: the channel as it is called; target: its new name; steps: the operations on its
    values, from left to right; text: as it was typed."""

    source: str
    target: str
    steps: tuple[tuple[str, float], ...]
    text: str

    def values(self, values: np.ndarray) -> np.ndarray:
        """Scaled and shifted. RecordingError if a number becomes too large."""
        new = np.asarray(values, float)
        with np.errstate(over="ignore", invalid="ignore"):
            for sign, number in self.steps:
                if sign in "*/":
                    new = new * number if sign == "*" else new / number
                else:
                    new = new + number if sign == "+" else new - number
        if (np.isfinite(values) & ~np.isfinite(new)).any():
            raise RecordingError(f"--map {self.text}: {self.target} becomes larger than 1.8e308")
        return new


def parse(text: str) -> Rule:
    """A --map option."""
    source, equals, right = text.rpartition("=")
    found = _TARGET.fullmatch(right)
    if not equals or not source.strip() or not found:
        raise RecordingError(
            f"--map {text}: write OLD=NEW, OLD=NEW*K, OLD=NEW/K or OLD=NEW+OFFSET, as in "
            "CH1=i_u1_A*100"
        )
    steps = []
    for sign, number in _STEP.findall(found[2]):
        value = real(number)
        if not np.isfinite(value) or (sign in "*/" and value == 0):
            raise RecordingError(
                f"--map {text}: {number}: a finite number is needed, and none of 0 as a factor"
            )
        steps.append((sign, value))
    return Rule(source.strip(), _known(found[1], text), tuple(steps), text)


def shift(text: str | None) -> float | None:
    """The seconds of a --shift option."""
    if text is None:
        return None
    try:
        value = real(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= MOST_SHIFT_S:
        raise RecordingError(
            f"--shift {text}: seconds are needed, allowed range is -{MOST_SHIFT_S:g} .. "
            f"{MOST_SHIFT_S:g}"
        )
    return value


def mapped(
    files: Sequence[str], recs: Sequence[Recording], maps: Iterable[str], shift_s: float | None
) -> list[Recording]:
    """The recordings with their channels renamed and scaled. A rule concerns every file that has
    its channel; one has to. The shift is added to the times of the files that a rule concerns,
    without rules to those of all."""
    rules = [parse(text) for text in maps]
    for n, rule in enumerate(rules):
        if not any(rule.source in rec.channels for rec in recs):
            known = dict.fromkeys(name for rec in recs for name in rec.channels)
            raise RecordingError(
                f"--map {rule.text}: {' and '.join(files)}: no channel {rule.source!r}"
                f"{suggest(rule.source, known)}"
            )
        if any(rule.target == other.target and rule.source == other.source for other in rules[:n]):
            raise RecordingError(f"--map {rule.text}: this channel is given twice")
    out = []
    for file, rec in zip(files, recs, strict=True):
        try:
            mine = [rule for rule in rules if rule.source in rec.channels]
            new = _applied(rec, mine) if mine else rec
        except RecordingError as error:
            raise RecordingError(f"{file}: {error}") from None
        out.append(_shifted(new, shift_s) if shift_s and (mine or not rules) else new)
    return out


def _applied(rec: Recording, rules: list[Rule]) -> Recording:
    gone = {rule.source for rule in rules}
    channels = {name: data for name, data in rec.channels.items() if name not in gone}
    units = {name: unit for name, unit in rec.units.items() if name not in gone}
    check_names(rule.target for rule in rules)
    own = _units()
    for rule in rules:
        if rule.target in channels:
            raise RecordingError(f"--map {rule.text}: there is a channel {rule.target} already")
        unit = rec.units.get(rule.source, "")
        to = own.get(rule.target.removeprefix("plant."))
        if to is not None:
            _check_unit(rule, unit, to)
        channels[rule.target] = rule.values(np.asarray(rec[rule.source]))
        units[rule.target] = to if to is not None else "" if rule.steps else unit
    return replace(rec, channels=Channels(channels), units=units)


def _shifted(rec: Recording, shift_s: float) -> Recording:
    meta = dict(rec.meta)
    if rec.trigger_s is not None:
        meta[TRIGGER] = rec.trigger_s + shift_s
    return replace(rec, start_s=rec.start_s + shift_s, meta=meta)


def _check_unit(rule: Rule, unit: str, to: str) -> None:
    """A probe gives volts for anything, and a table may tell no unit. Every other unit has to
    measure the same."""
    group = next((one for one in _ALIKE if to in one), {to})
    if unit in ("", "V") or unit == to or any(unit in one and to in one for one in _SAME):
        return
    if unit in group and rule.steps:
        return
    needs = f", and {unit} with a factor" if unit in group else ""
    time = ", a time" if seconds_of(unit) else ""
    allowed = ", ".join(dict.fromkeys([to, "V"]))
    raise RecordingError(
        f"--map {rule.text}: {rule.source} is in {unit}{time}; {rule.target} "
        + (f"is in {to}: allowed are {allowed} or no unit{needs}" if to else "needs V or no unit")
    )


def _units() -> dict[str, str]:
    """The units of the project's own channels."""
    from ..firmware import channels

    return dict(channels())


def _known(name: str, text: str) -> str:
    """The new name. One that is nearly a channel of the project is taken for a mistake."""
    import difflib

    own = _units()
    plain = name.removeprefix("plant.")
    close = difflib.get_close_matches(plain, own, 1, 0.8)
    alike = [known for known in own if known.lower() == plain.lower()] or close
    if plain not in own and alike:
        raise RecordingError(
            f"--map {text}: the project has no channel {name!r}; did you mean {alike[0]!r}?"
        )
    return name
