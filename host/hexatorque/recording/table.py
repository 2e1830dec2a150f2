"""Tables of numbers in text files from any program.

Columns are separated by commas, semicolons or tabs. The decimal sign is a point or a comma. Units
stand in the line of names or in the line below it. Samples must be equally spaced: values are
never interpolated.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO

import numpy as np

from .formats import RecordingError

#: Delimiters, in the order in which they are tried. A comma may also be the decimal sign.
DELIMITERS = "\t;,"
_SAMPLE_LINES = 20
#: `speed [rpm]`, `Time (s)`
_UNIT = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*", re.DOTALL)
_TIME = re.compile(r"(?:time|t|zeit)(?:[ _](s|ms|us|µs|ns))?", re.IGNORECASE)
_SECONDS = {
    "": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6,
    "μs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
}  # fmt: skip
#: Times may deviate this much from equal steps, in steps, because they often have few digits.
SLACK = 0.25
#: Largest number of missing steps in a plain table.
MOST_LOST_ROWS = 10**7


def decode(raw: bytes) -> str:
    """The text of a file in UTF-8, in UTF-16 with a byte order mark, or in Windows' code page."""
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = raw.decode("utf-16")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def heading(name: str, unit: str) -> str:
    """A column's heading in the first line. `split` is the inverse."""
    return f"{name} [{unit}]" if unit or split(name) != (name, "") else name


def split(text: str) -> tuple[str, str]:
    """The name and the unit of a heading. The unit is "" if there is none."""
    found = _UNIT.fullmatch(text)
    if not found or not found[1].strip():
        return text.strip(), ""
    return found[1].strip(), (found[2] if found[2] is not None else found[3]).strip()


def cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line], delimiter=delimiter), [])


@dataclass
class Table:
    """A table in a text.

    names: the cells of the line of names; units: the cells of a line of units below it, if there
    is one; begin: where the rows begin in `text`; line: the number of that line.
    """

    text: str
    names: list[str]
    units: list[str] | None
    delimiter: str
    begin: int
    line: int

    def __post_init__(self) -> None:
        #: Whether commas are decimal signs: they do not delimit columns, or are in quotes.
        self.comma = self.text.find("," if self.delimiter != "," else '"', self.begin) >= 0

    def columns(self, kinds: list[str]) -> list[np.ndarray]:
        """The columns as arrays of these types. Empty cells are NaN."""
        return [column for column in self._columns(kinds, True) if column is not None]

    def number_columns(self, kinds: list[str]) -> list[np.ndarray | None]:
        """The same, but None for a column without any number."""
        return self._columns(kinds, False)

    def _columns(self, kinds: list[str], strict: bool) -> list[np.ndarray | None]:
        text = self.text[self.begin :] if self.begin else self.text
        if not text.strip():
            return [np.empty(0, kind) for kind in kinds]
        d = self.delimiter
        if '"' not in text:
            if self.comma:
                text = text.replace(",", ".")
            for _ in range(2 * (d + d in text)):  # twice, because pairs of delimiters overlap
                text = text.replace(d + d, f"{d}nan{d}")
            if f"{d}\n" in text:
                text = text.replace(f"{d}\n", f"{d}nan\n")
            if text.endswith(d):
                text += "nan"
            fields = [f"f{i}" for i in range(len(kinds))]
            row = np.dtype(list(zip(fields, kinds)))
            extra = text.partition("\n")[0].count(d) + 1 - len(kinds)
            try:
                table = np.loadtxt(
                    StringIO(text), delimiter=d, dtype=row, ndmin=1, comments=None,
                    usecols=range(len(kinds)) if extra == 1 else None,
                )  # fmt: skip
            except ValueError:
                pass
            else:
                if extra != 1 or self._extra_is_empty(len(kinds)):
                    return [table[name] for name in fields]
        return self._one_by_one(kinds, strict)

    def rows(self) -> Iterator[tuple[int, str]]:
        """The number and the text of each line that is not blank."""
        number, at = self.line, self.begin
        while at < len(self.text):
            end = self.text.find("\n", at)
            end = len(self.text) if end < 0 else end
            if self.text[at:end].strip():
                yield number, self.text[at:end]
            number, at = number + 1, end + 1

    def line_of(self, row: int) -> int:
        """The number of the line that contains a row."""
        return next(number for n, (number, _) in enumerate(self.rows()) if n == row)

    def _extra_is_empty(self, width: int) -> bool:
        """Whether every row has at most a delimiter after the last column."""
        return all(
            not "".join(cells(line, self.delimiter)[width:]).strip() for _, line in self.rows()
        )

    def _one_by_one(self, kinds: list[str], strict: bool) -> list[np.ndarray | None]:
        """Read the columns cell by cell, so that an error names the wrong cell."""
        columns: list[list[float]] = [[] for _ in kinds]
        wrong: list[tuple[int, str] | None] = [None] * len(kinds)
        for number, line in self.rows():
            found = cells(line, self.delimiter)
            if len(found) < len(kinds) or "".join(found[len(kinds) :]).strip():
                raise RecordingError(
                    f"line {number}: {len(found)} cells where there are {len(kinds)} names"
                )
            for n, (cell, kind) in enumerate(zip(found, kinds)):
                try:
                    columns[n].append(self._number(cell, kind))
                except ValueError:
                    wrong[n] = wrong[n] or (number, cell)
        out: list[np.ndarray | None] = []
        for n, (values, kind) in enumerate(zip(columns, kinds)):
            if bad := wrong[n]:
                if not strict and not np.isfinite(values).any():
                    out.append(None)
                    continue
                raise RecordingError(
                    f"line {bad[0]}, {self.names[n] or f'column {n + 1}'}: "
                    f"{bad[1].strip()[:40]!r} is not a {'' if kind[0] == 'f' else 'whole '}number"
                )
            out.append(np.array(values, kind))
        return out

    def _number(self, cell: str, kind: str) -> float:
        cell = cell.strip()
        if self.comma:
            cell = cell.replace(",", ".")
        if kind[0] != "f":
            return int(cell)
        return float(cell) if cell else np.nan


def under(text: str, line: str) -> Table | None:
    """The table below `line` if the text begins with this line; otherwise None."""
    if not (text.startswith(line) and text[len(line) : len(line) + 1] in ("\n", "")):
        return None
    return Table(text, cells(line, ","), None, ",", len(line) + 1, 2)


def find(text: str) -> Table:
    """Find the table in a text, with its delimiter, decimal sign and lines of names and units."""
    delimiters = DELIMITERS
    lines = Table(text, [], None, ",", 0, 1).rows()
    head = None
    for number, text_line in lines:
        if text_line.lower().startswith("sep=") and len(text_line.rstrip()) == 5:  # for Excel
            delimiters = text_line[4]
        elif not text_line.lstrip().startswith(("#", "%")):
            head = number, text_line
            break
    if head is None:
        raise RecordingError("no table: no line of names")
    sample = [row for row, _ in zip(lines, range(_SAMPLE_LINES))]
    delimiter = _delimiter(head[1], [line for _, line in sample], delimiters)
    names = [cell.strip() for cell in cells(head[1], delimiter)]
    if all(map(_is_number, names)):
        raise RecordingError(f"line {head[0]}: numbers where the columns' names are needed")
    units, after = None, head
    if sample:
        first = [cell.strip() for cell in cells(sample[0][1], delimiter)]
        if len(first) == len(names) and any(first) and not any(map(_is_number, first)):
            units, after = [cell.strip("[]()") for cell in first], sample[0]
    begin, line = 0, 1
    while line <= after[0]:
        end = text.find("\n", begin)
        begin, line = (len(text) if end < 0 else end + 1), line + 1
    return Table(text, names, units, delimiter, begin, line)


def _delimiter(head: str, sample: list[str], known: str) -> str:
    """The delimiter that gives the names and the sample rows the same number of cells."""
    for d in known:
        names = len(cells(head, d))
        widths = {len(cells(line, d)) - (line.endswith(d) and not head.endswith(d))
                  for line in sample}  # fmt: skip
        if names > 1 and widths <= {names}:
            return d
    return max(known, key=lambda d: len(cells(head, d)))


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def time_column(table: Table, headings: list[tuple[str, str]]) -> tuple[int, float, str]:
    """The number of the time column, its unit in seconds, and a text if something was assumed."""
    for n, (name, unit) in enumerate(headings):
        found = _TIME.fullmatch(name)
        if not found:
            continue
        unit = unit or found[1] or ""
        if unit.lower() not in _SECONDS:
            raise RecordingError(f"{table.names[n]}: time in {unit!r}, known are s, ms, us, ns")
        return n, _SECONDS[unit.lower()], "" if unit else f"{name} is taken as seconds"
    raise RecordingError(
        "no column of time: one named time_s, Time (s), t [ms] or the like is needed, there are "
        + ", ".join(name for name in table.names if name)[:200]
    )


def raster(table: Table, time_s: np.ndarray) -> tuple[float, np.ndarray]:
    """The samples per second, and the place of each row. The times must ascend in equal steps; a
    step may be a multiple where rows are missing. RecordingError otherwise."""
    if len(time_s) < 2:
        raise RecordingError("two rows or more are needed to know the time between samples")
    bad = np.flatnonzero(~np.isfinite(time_s))
    if len(bad):
        raise RecordingError(f"line {table.line_of(int(bad[0]))}: no time")
    number = np.arange(len(time_s))
    span_s = float(time_s[-1] - time_s[0])
    step_s = span_s / number[-1]
    if span_s > 0 and np.all(abs(time_s - time_s[0] - number * step_s) <= SLACK * step_s):
        return plain_rate(number[-1] / span_s, number[-1]), number
    steps = np.diff(time_s)
    step_s = float(np.median(steps))
    if step_s > 0:
        places = np.round(steps / step_s)
        wrong = (np.abs(steps - places * step_s) > SLACK * step_s) | (places < 1)
    else:
        wrong = steps <= 0
    if wrong.any():
        at = int(np.argmax(wrong))
        raise RecordingError(
            f"line {table.line_of(at + 1)}: time goes from {time_s[at]:.9g} s to "
            f"{time_s[at + 1]:.9g} s, most steps are {step_s:.6g} s: equally spaced samples "
            "are needed"
        )
    if places.sum() - len(steps) > MOST_LOST_ROWS:
        raise RecordingError(
            f"{places.sum() - len(steps):.0f} rows are missing: too many to fill in"
        )
    places = np.concatenate([[0], np.cumsum(places.astype(np.int64))])
    return plain_rate(places[-1] / span_s, int(places[-1])), places


def plain_rate(rate_Hz: float, samples: int) -> float:
    """The rate, rounded to the fewest digits that change it by less than a millionth, and the
    times by less than a hundredth of a step."""
    for digits in range(1, 17):
        short = float(f"{rate_Hz:.{digits}g}")
        if abs(1 - short / rate_Hz) < min(1e-6, 0.01 / samples):
            return short
    return rate_Hz
