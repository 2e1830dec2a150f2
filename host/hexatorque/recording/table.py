"""Tables of numbers in text files from any program: oscilloscopes, spreadsheets, loggers.

The structure is found from the numbers: the delimiter is the one that gives rows of numbers, the
table begins with the first of these rows, and names and units stand in the lines just above. There
is no rule for a maker. Columns are separated by commas, semicolons or tabs. The decimal sign is a
point or a comma, never both. Samples must be equally spaced: values are never interpolated, and no
row is ever left out.

pandas and numpy have to be told delimiter, decimal sign and first row. The standard library's csv
splits the rows.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import StringIO

import numpy as np

from .formats import RecordingError

#: Delimiters, in the order in which they are tried. A comma may also be the decimal sign.
DELIMITERS = "\t;,"
#: The table has to begin within so many lines that are not blank.
_SAMPLE_LINES = 300
#: `speed [rpm]`, `Time (s)`, and `in s`, `CH1 in V`, `Time / s`
_UNIT = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*", re.DOTALL)
_IN_UNIT = re.compile(r"(?:(.+) )?(?:in|/) ([^\s\d]{1,4})")
#: `V(out)`, `I(L1)`: a node and a part of LTspice, no unit.
_NODE = re.compile(r"(V|I)[a-z]?\(([^()]+)\)")
_TIME = re.compile(r"(?:time|t|t_?out|zeit|temps|tempo|tiempo|x-axis)(?:[ _](\w+))?", re.IGNORECASE)
#: Units of time. Case matters: MS is no time. Some oscilloscopes write S for seconds.
_SECONDS = {
    "s": 1.0, "S": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "ps": 1e-12,
    "min": 60.0, "h": 3600.0,
}  # fmt: skip
_SECOND_WORDS = ("sec", "second", "seconds")
#: Names of a column that counts the samples, where start and increment tell the time.
_COUNTS = ("x", "n", "index", "sample", "samples", "point", "points", "sequence")
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d]*)"
_START = re.compile(r"start|x ?orig(?:in)?|x ?org|x ?zero|t0", re.IGNORECASE)
_STEP = re.compile(r"x ?inc(?:rement)?|increment|tinc|sample interval", re.IGNORECASE)
_PER_COLUMN_UNITS = re.compile(r"(?:vertical |y[ -]?)?units?", re.IGNORECASE)
_TIME_UNITS = re.compile(r"(?:horizontal|x|time)[ -]?units?", re.IGNORECASE)
#: A line below which the samples begin, without names.
_DATA = re.compile(r"data:[,;\s]*", re.IGNORECASE)
#: Units as words, and quantities whose prefix is taken into the numbers. Case matters.
_WORDS = {
    "volt": "V", "volts": "V", "amp": "A", "amps": "A", "ampere": "A", "watt": "W", "value": "",
}  # fmt: skip
_PREFIXES = {
    "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6,
    "micro": 1e-6, "milli": 1e-3, "kilo": 1e3,
}  # fmt: skip
_PREFIXED = re.compile(
    r"([pnuµμmkM]|(?i:micro|milli|kilo))(V|A|W|Wb|Hz|ohm|Ω|(?i:volts?|amps?|ampere|watt))"
)
#: Times may deviate this much from equal steps, in steps, because they often have few digits.
SLACK = 0.25
#: What ∞ means, which PicoScope writes.
CLIPPED = ": the channel was out of range; choose a larger range at the scope"
#: Largest number of missing steps in a plain table.
MOST_LOST_ROWS = 10**7


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
    if '"' not in line:
        return line.split(delimiter)
    return next(csv.reader([line], delimiter=delimiter), [])


@dataclass
class Table:
    """A table in a text.

    names: the cells of the line of names; begin: where the rows begin in `text`; line: the number
    of that line; first: the first of its columns, as a header may stand left of it; headings: names
    and units; start_s, step_s: the time axis by the header.
    """

    text: str
    names: list[str]
    delimiter: str
    begin: int
    line: int
    first: int = 0
    headings: list[tuple[str, str]] = field(default_factory=list)
    start_s: float | None = None
    step_s: float | None = None

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
        comma = self.delimiter != "," and "," in text
        # Which of both is the decimal sign has to be seen cell by cell.
        if '"' in text or (comma and "." in text):
            return self._one_by_one(kinds, strict)
        d, end = self.delimiter, self.first + len(kinds)
        extra = text.lstrip("\n").partition("\n")[0].count(d) + 1 - end
        if extra < 0 or not self._alike(text, extra):
            return self._one_by_one(kinds, strict)
        if comma:
            text = text.replace(",", ".")
        for _ in range(2 * (d + d in text)):  # twice, because pairs of delimiters overlap
            text = text.replace(d + d, f"{d}nan{d}")
        if f"{d}\n" in text:
            text = text.replace(f"{d}\n", f"{d}nan\n")
        if text.endswith(d):
            text += "nan"
        if f"\n{d}" in text or text.startswith(d):
            text = "nan" * text.startswith(d) + text.replace(f"\n{d}", f"\nnan{d}")
        fields = [f"f{i}" for i in range(len(kinds))]
        try:
            table = np.loadtxt(
                StringIO(text), delimiter=d, dtype=np.dtype(list(zip(fields, kinds))), ndmin=1,
                comments=None, usecols=range(self.first, end),
            )  # fmt: skip
        except ValueError:
            return self._one_by_one(kinds, strict)
        return [table[name] for name in fields]

    def _alike(self, text: str, extra: int) -> bool:
        """Whether every row has as many cells as the first one, the last `extra` of them empty."""
        raw = np.frombuffer(text.encode(), np.uint8)
        ends = np.flatnonzero(raw == ord("\n"))
        at = np.flatnonzero(raw == ord(self.delimiter))
        ends = np.append(ends, len(raw))
        counts = np.diff(np.searchsorted(at, ends), prepend=0)
        used = counts[np.diff(ends, prepend=-1) > 1]
        if (used != used[0]).any():
            return False
        tail = self.delimiter * extra
        return not extra or text.count(tail + "\n") + text.endswith(tail) == len(used)

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

    def place(self, row: int) -> str:
        """Where a row stands, in messages."""
        return f"line {self.line_of(row)}"

    def name(self, column: int) -> str:
        """The name of a column in messages."""
        return self.names[column] or f"column {self.first + column + 1}"

    def _one_by_one(self, kinds: list[str], strict: bool) -> list[np.ndarray | None]:
        """Read the columns cell by cell, so that an error names the wrong cell."""
        columns: list[list[float]] = [[] for _ in kinds]
        wrong: list[tuple[int, str] | None] = [None] * len(kinds)
        # The first number with either decimal sign: column, line, text.
        signs: dict[str, list[tuple[int, int, str]]] = {",": [], ".": []}
        end = self.first + len(kinds)
        for number, line in self.rows():
            found = cells(line, self.delimiter)
            if len(found) < end or "".join(found[end:]).strip():
                raise RecordingError(
                    f"line {number}: {len(found) - self.first} cells where there are {len(kinds)} "
                    "names"
                )
            for n, (cell, kind) in enumerate(zip(found[self.first :], kinds)):
                try:
                    columns[n].append(_number(cell.strip(), kind))
                except ValueError:
                    wrong[n] = wrong[n] or (number, cell)
                    continue
                for sign, seen in signs.items():
                    if sign in cell and not any(n == one[0] for one in seen):
                        seen.append((n, number, cell.strip()))
        out: list[np.ndarray | None] = []
        for n, (values, kind) in enumerate(zip(columns, kinds)):
            if bad := wrong[n]:
                if not strict and not np.isfinite(values).any():
                    out.append(None)
                    continue
                clipped = CLIPPED if "∞" in bad[1] else ""
                raise RecordingError(
                    f"line {bad[0]}, {self.name(n)}: {bad[1].strip()[:40]!r} is not a "
                    f"{'' if kind[0] == 'f' else 'whole '}number{clipped}"
                )
            out.append(np.array(values, kind))
        firsts = [
            min((one for one in seen if out[one[0]] is not None), key=lambda one: one[1:2],
                default=None)
            for seen in signs.values()
        ]  # fmt: skip
        if firsts[0] and firsts[1]:
            usual, other = sorted((one for one in firsts if one), key=lambda one: one[1])
            sign = "comma" if "," in usual[2] else "point"
            raise RecordingError(
                f"line {other[1]}, {self.name(other[0])}: {other[2][:40]!r}: only a decimal {sign} "
                f"is allowed, as in line {usual[1]} ({usual[2][:40]!r})"
            )
        return out


def _number(cell: str, kind: str = "f8") -> float:
    """A number with a decimal point or comma. ValueError if it is none."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    if kind[0] != "f":
        return int(cell)
    return float(cell.replace(",", ".")) if cell else np.nan


def under(text: str, line: str) -> Table | None:
    """The table below `line` if the text begins with this line; otherwise None."""
    if not (text.startswith(line) and text[len(line) : len(line) + 1] in ("\n", "")):
        return None
    return Table(text, cells(line, ","), ",", len(line) + 1, 2)


@dataclass
class _Line:
    number: int
    begin: int
    end: int
    text: str
    cells: list[str] = field(default_factory=list)
    numbers: frozenset[int] = frozenset()

    def cell(self, column: int) -> str:
        return self.cells[column] if column < len(self.cells) else ""

    @property
    def only_numbers(self) -> bool:
        return len(self.numbers) == sum(map(bool, self.cells)) > 0


def _first_lines(text: str) -> tuple[list[_Line], str]:
    """The lines in which the table has to begin, and the delimiters that are possible."""
    lines: list[_Line] = []
    delimiters, number, at = DELIMITERS, 0, 0
    while at < len(text) and len(lines) < _SAMPLE_LINES:
        end = text.find("\n", at)
        end = len(text) if end < 0 else end
        number, line = number + 1, text[at:end]
        if not lines and line.lower().startswith("sep=") and len(line.rstrip()) == 5:  # for Excel
            delimiters = line[4]
        elif line.strip() and not line.lstrip().startswith(("#", "%")):
            lines.append(_Line(number, at, end, line))
        at = end + 1
    return lines, delimiters


def _cut(lines: list[_Line], delimiter: str) -> None:
    for line in lines:
        line.cells = [cell.strip() for cell in cells(line.text, delimiter)]
        line.numbers = frozenset(n for n, cell in enumerate(line.cells) if _is_number(cell))


def _delimiter(lines: list[_Line], known: str) -> str:
    """The delimiter that gives most rows of nothing but numbers; else most with some numbers; else
    most cells."""

    def score(d: str) -> tuple[int, ...]:
        _cut(lines, d)
        counts = [len(line.numbers) for line in lines]
        rows = sum(line.only_numbers and n > 1 for line, n in zip(lines, counts))
        most = 0 if any(counts) else max(len(line.cells) for line in lines)
        return rows, sum(n > 1 for n in counts), sum(n > 0 for n in counts), most

    return max(known, key=score)


def without_spaces(text: str) -> str:
    """The text with tabs for the spaces between columns if nothing else separates them, as in
    PSIM's tables."""
    rows = [line.split() for line in text.splitlines()[:_SAMPLE_LINES] if line.strip()]
    numbers = sum(len(row) > 1 and all(map(_is_number, row)) for row in rows)
    if not rows or 2 * numbers <= len(rows) or "\t" in text or ";" in text:
        return text
    return "\n".join("\t".join(line.split()) for line in text.splitlines()) + "\n"


def find(text: str) -> Table:
    """Find the table in a text, with its delimiter, its names and its units."""
    lines, delimiters = _first_lines(text)
    if not lines:
        raise RecordingError("no table: no line of names")
    delimiter = _delimiter(lines, delimiters)
    _cut(lines, delimiter)
    used, begin = _block(lines)
    first = min(used, default=0)
    data = [n + 1 for n, line in enumerate(lines) if used and _DATA.fullmatch(line.text)]
    begin = data[0] if data else begin
    above = lines[:begin]
    units = above.pop().cells if _ends_with_units(above, used) else []
    names, left = [], 0
    if data:
        header = [line.cells for line in above]
    elif above and (not first or all(map(above[-1].cell, used))):
        names = list(above.pop().cells)
        header = [line.cells for line in above]
    elif first:  # the header stands beside the table
        left = first
        header = [line.cells[:first] for line in lines]
        while begin and len(lines[begin - 1].cells) > max(used):  # an empty row is a row
            begin -= 1
    else:
        raise RecordingError(
            f"line {lines[begin].number}: numbers where the columns' names are needed"
        )
    # `XInc:1e-6` in one cell
    header = [row[0].split(":", 1) if row and not any(row[1:]) else row for row in header]
    start_s, step_s = _start_and_step([*header, names, units])
    nameless = not names
    if names:
        if None not in (start_s, step_s):  # their cells name no columns
            for n, name in enumerate(names):
                if n not in used and (_START.match(name) or _STEP.match(name)):
                    names[n] = ""
        while len(names) > 1 and not names[-1]:
            del names[-1]
    else:
        names = [""] * (max(used) + 1 - left)
    headings = [_heading(name) for name in names]
    for n, below in enumerate(units[: len(headings)]):
        unit = below.strip("[]()").strip()
        headings[n] = headings[n][0], headings[n][1] or unit * bool(si(unit)[0])
    _from_header(headings, header, sorted(n - left for n in used), nameless)
    behind = lines[-1].end + 1, lines[-1].number + 1
    at = (lines[begin].begin, lines[begin].number) if begin < len(lines) else behind
    return Table(text, names, delimiter, *at, left, headings, start_s, step_s)


def _block(lines: list[_Line]) -> tuple[frozenset[int], int]:
    """The columns of numbers, and the first line of their rows."""
    rows = [line for line in lines if line.only_numbers] or [x for x in lines if x.numbers]
    if not rows:
        return frozenset(), len(lines)
    counts = Counter(line.numbers for line in rows)
    used = max(counts, key=lambda one: (len(one) > 1, counts[one], len(one)))
    begin = next(n for n, line in enumerate(lines) if used <= line.numbers)
    first = min(used)

    def titles(n: int) -> bool:
        return n >= 0 and all(lines[n].cell(k) and k not in lines[n].numbers for k in used)

    # A damaged or incomplete row at the top is a row.
    while begin and (
        first in lines[begin - 1].numbers
        or (lines[begin - 1].numbers & used and (first > 0 or titles(begin - 2)))
    ):
        begin -= 1
    return used, begin


def _ends_with_units(above: list[_Line], used: frozenset[int]) -> bool:
    """Whether the last line has the units of the names in the line before."""
    if len(above) < 2 or not used:
        return False
    names, units = above[-2:]
    first = min(used)
    if first in names.numbers or not all(map(names.cell, used)):
        return False
    texts = [cell for cell in units.cells if cell]
    bracketed = all(cell[0] + cell[-1] in ("[]", "()") for cell in texts)
    words = all(si(cell)[0] != cell for cell in texts)
    of_time = units.cell(first).strip("[]()")
    return bracketed or words or seconds_of(of_time) is not None or of_time.lower() in _COUNTS[-1:]


def _heading(cell: str) -> tuple[str, str]:
    node = _NODE.fullmatch(cell)
    if node and si(node[2])[0] not in _WORDS.values():
        return cell, {"V": "V", "I": "A"}[node[1]]
    name, unit = split(cell)
    found = _IN_UNIT.fullmatch(cell)
    if not unit and found and (seconds_of(found[2]) or si(found[2])[0] in _WORDS.values()):
        return found[1] or "time", found[2]
    return name, unit


def _from_header(
    headings: list[tuple[str, str]], header: list[list[str]], used: list[int], nameless: bool
) -> None:
    """Add the names and units that only the header has: rows of a keyword and values."""
    of_values = [n for n in used[1:] or used if n < len(headings)]
    for key, *values in (row for row in header if row):
        values = [value.rpartition(":")[2].strip() for value in values if value]
        if _PER_COLUMN_UNITS.fullmatch(key.strip(" :")):
            for n, value in zip(of_values, values):
                headings[n] = headings[n][0], headings[n][1] or value
        elif _TIME_UNITS.fullmatch(key.strip(" :")) and values and used:
            name, unit = headings[used[0]]
            # A header does not make a time of another name, or of the only column.
            if (nameless and used[1:]) or _TIME.fullmatch(name):
                headings[used[0]] = name or "time", unit or values[0]
        elif nameless and key.lower() == "source":
            for n, value in zip(of_values, values):
                headings[n] = value, headings[n][1]


def _start_and_step(rows: list[list[str]]) -> tuple[float | None, float | None]:
    """Time of the first sample and time between samples, where a header tells them: a keyword with
    the value behind it or in its own cell behind `=`, or in the line of names, which is the last
    but one, with the value below it. The value behind `start` is the number of a sample."""
    found: dict[re.Pattern, float] = {}
    for n, row in enumerate(rows):
        for k, cell in enumerate(row):
            key, _, value = cell.partition("=")
            pattern = next((p for p in (_START, _STEP) if p.fullmatch(key.strip(" :"))), None)
            if pattern is None or pattern in found:
                continue
            below = rows[-1][k] if n == len(rows) - 2 and k < len(rows[-1]) else ""
            a_time = key.strip(" :").lower() != "start"
            behind = row[k + 1] if a_time and k == 0 and len(row) > 1 else ""
            for text in (value, behind, below):
                number = re.fullmatch(_NUMBER, text.strip())
                unit_s = 1.0 if number and not number[2] else number and seconds_of(number[2])
                if number and unit_s:
                    found[pattern] = float(number[1]) * unit_s
                    break
    step_s = found.get(_STEP)
    return found.get(_START), step_s if step_s and step_s > 0 else None


def _is_number(cell: str) -> bool:
    try:
        _number(cell or "-")
    except ValueError:
        return False
    return True


def seconds_of(unit: str) -> float | None:
    """A unit of time in seconds; None if it is none."""
    return 1.0 if unit.lower() in _SECOND_WORDS else _SECONDS.get(unit)


def si(unit: str) -> tuple[str, float]:
    """The unit without its prefix, and the factor to it. Units that are unknown stay."""
    found = _PREFIXED.fullmatch(unit)
    prefix, unit = found.groups() if found else ("", unit)
    factor = _PREFIXES.get(prefix if len(prefix) == 1 else prefix.lower(), 1.0)
    return _WORDS.get(unit.lower(), unit), factor


def is_time(name: str) -> bool:
    """Whether a variable of this name is a time: with another word behind it, it is none."""
    found = _TIME.fullmatch(name)
    return found is not None and (not found[1] or seconds_of(found[1]) is not None)


def as_time(name: str, unit: str, shown: str) -> tuple[float, str] | None:
    """The unit of a column in seconds, and a text if something was assumed. None: it is no time.
    shown: its name in messages."""
    found = _TIME.fullmatch(name)
    if not found and not (name.lower() in _SECOND_WORDS and not unit):
        return None
    unit = unit or (found[1] if found else "s") or ""
    if unit and seconds_of(unit) is None:
        raise RecordingError(f"{shown}: time in {unit!r}, known are s, ms, us, ns, ps, min, h")
    return seconds_of(unit) or 1.0, "" if unit else f"{name} is taken as seconds"


def time_column(table: Table) -> tuple[int | None, float, str]:
    """The number of the time column, its unit in seconds, and a text if something was assumed.
    None: the header tells start and increment, so that the rows are counted."""
    for n, (name, unit) in enumerate(table.headings):
        if found := as_time(name, unit, table.name(n)):
            return n, *found
    timed = [n for n, (_, unit) in enumerate(table.headings) if unit and seconds_of(unit)]
    if timed == [0]:
        return 0, seconds_of(table.headings[0][1]) or 1.0, ""
    if table.start_s is not None and table.step_s is not None:
        return None, 1.0, ""
    raise RecordingError(
        "no column of time: one named time_s, Time (s), t [ms] or the like is needed, or start and "
        "increment in the header; there are "
        + ", ".join(table.name(n) for n in range(len(table.names)))[:200]
    )


def counted(table: Table, columns: list[np.ndarray | None]) -> int | None:
    """The column that counts the samples, if there is one."""
    for n, (name, unit) in enumerate(table.headings):
        count = _COUNTS[-1] in (name.lower(), unit.lower()) or (name.lower() in _COUNTS and not n)
        if count and columns[n] is not None:
            return n
    return None
