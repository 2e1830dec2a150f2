"""Text: `time_s` and the channels, a line per sample, and the header in a .json beside it.

A recording that was written as it arrived (`writer`) has its ticks as second column, lines
only for samples that arrived, and `stream` in the header (`journal.Stream`).
"""

from __future__ import annotations

import csv
import json
from io import StringIO
from pathlib import Path

import numpy as np

from ..recording import Recording, check_names, from_header, header_text, to_json
from . import beside
from .journal import Stream, assemble

#: Digits that give back each type exactly; whole numbers as they are.
_DIGITS = {"float32": "%.9g", "float64": "%.17g"}
_LINES = 10_000  #: formatted at a time


def lines(columns: list[np.ndarray], formats: list[str]) -> str:
    """The text of rows; (n,) columns and how to print each."""
    line = ",".join(formats) + "\n"
    row = [value for values in zip(*(c.tolist() for c in columns)) for value in values]
    return line * len(columns[0]) % tuple(row)


def save(rec: Recording, path: Path) -> None:
    header = json.loads(header_text(rec))
    beside(path)[0].write_text(json.dumps(header, indent=1) + "\n")
    formats = ["%.12g", *(_DIGITS.get(kind, "%d") for kind in header["types"].values())]
    columns = [rec.time_s, *map(np.asarray, rec.channels.values())]
    with path.open("w", encoding="utf-8") as file:
        file.write(_head(["time_s", *rec.channels]))
        for i in range(0, len(rec), _LINES):
            file.write(lines([c[i : i + _LINES] for c in columns], formats))


def load(path: Path) -> Recording:
    text = path.read_text(encoding="utf-8")
    beside_text = beside(path)[0].read_text(encoding="utf-8")
    header = json.loads(beside_text)
    if stream := header.get("stream"):
        return _load_stream(Stream.from_json(stream), header, text)
    types = header.get("types", {})
    names = _names(text)[1:]
    kinds = ["f8", *(types.get(name, "float64").replace("bool", "uint8") for name in names)]
    _, *columns = _table(text, kinds)
    return from_header(beside_text, dict(zip(names, columns, strict=True)))


def _head(names: list[str]) -> str:
    """The line of names; those with commas in quotes."""
    line = StringIO()
    csv.writer(line, lineterminator="\n").writerow(names)
    return line.getvalue()


def _names(text: str) -> list[str]:
    return next(csv.reader([text.partition("\n")[0].strip()]))


def _table(text: str, types: list[str]) -> list[np.ndarray]:
    """The columns below the line of names."""
    row = np.dtype([(f"f{i}", kind) for i, kind in enumerate(types)])
    rows = text.partition("\n")[2]
    if not rows.strip():  # of which numpy would warn
        return [np.empty(0, kind) for kind in types]
    table = np.loadtxt(StringIO(rows), delimiter=",", dtype=row, ndmin=1, comments=None)
    return [table[name] for name in row.names]


# -- as it arrives


def stream_head(stream: Stream) -> str:
    """First line of a recording in the making."""
    check_names(name for name, _ in stream.channels)
    return _head(["time_s", "tick", *(name for name, _ in stream.channels)])


def stream_lines(time_s: np.ndarray, ticks: np.ndarray, values: np.ndarray) -> str:
    formats = ["%.12g", "%d", *["%.9g"] * values.shape[1]]
    return lines([time_s, ticks, *values.T], formats)


def stream_header(stream: Stream, counters: dict, closed: bool) -> str:
    """What stands beside it; most keys are for people and other programs."""
    header = {
        "format": "hexatorque-recording-1",
        "rate_Hz": stream.rate_Hz,
        "units": dict(stream.channels),
        "stream": stream.to_json(),
        "counters": counters,
        "closed": closed,
    }
    return json.dumps(json.loads(to_json(header)), indent=1) + "\n"


def _load_stream(stream: Stream, header: dict, text: str) -> Recording:
    closed = header["closed"] is True
    # The line in which a recording broke off may be a number cut short: it does not count.
    whole = text[: text.rfind("\n") + 1]
    if closed and whole != text:
        raise ValueError("the last line is not whole")
    if whole and _names(whole) != _names(stream_head(stream)):
        raise ValueError("other channels than its header says")
    _, ticks, *columns = _table(whole, ["f8", "u4", *["f4"] * len(stream.channels)])
    values = np.column_stack(columns) if columns else np.empty((len(ticks), 0), np.float32)
    return assemble(stream, ticks, values, header["counters"], closed)
