"""CSV text: `time_s`, the board's `tick` if there is one, and the channels with their units. Each
sample has a line; the cells of a lost sample are empty. The header is in a .json file beside it
(`recording.header`). docs/recordings.md has an example.

A recording that is still being written (`writer`) has the same two files. Until it is closed,
`samples` is null and the metadata contain `"closed": false`.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable
from io import StringIO
from pathlib import Path

import numpy as np

from .. import given
from . import plain, table
from .formats import TEXTS, RecordingError, beside, one_line
from .journal import COUNTERS, TICK_HZ, Stream, ascending, assemble, fill
from .recording import (
    DECIMATION,
    Recording,
    check_names,
    from_fields,
    header,
    header_of,
    to_json,
)

#: Formats with enough digits to restore each type exactly. Integers are written in full.
_DIGITS = {"float32": "%.9g", "float64": "%.17g"}
_LINES = 10_000  #: lines that are formatted at a time
#: A gap of up to this many lost samples has a line for each. A longer gap has only one line; its
#: length follows from the tick.
LONGEST_GAP = 100_000


def lines(columns: list[np.ndarray], formats: list[str]) -> str:
    """The text of rows. columns: (n,) each; formats: how to print each column."""
    line = ",".join(formats) + "\n"
    row = [value for values in zip(*(c.tolist() for c in columns)) for value in values]
    return line * len(columns[0]) % tuple(row)


def first_line(names: Iterable[str], units: Iterable[str], ticks: bool) -> str:
    """The line of names. A name that contains a comma is in quotes."""
    named = (table.heading(name, unit) for name, unit in zip(names, units, strict=True))
    return _line(["time_s", *["tick"] * ticks, *named]) + "\n"


def _line(cells: list[str]) -> str:
    line = StringIO()
    csv.writer(line, lineterminator="").writerow(cells)
    return line.getvalue()


def json_text(fields: dict) -> str:
    return json.dumps(json.loads(to_json(fields)), indent=1) + "\n"


def save(rec: Recording, path: Path) -> None:
    fields = header_of(rec)
    beside(path)[0].write_text(json_text(fields), encoding="utf-8")
    ticks = rec.ticks
    formats = ["%.12g", *["%d"] * (ticks is not None)]
    formats += [_DIGITS.get(kind, "%d") for kind in fields["types"].values()]
    columns = [rec.time_s, *([] if ticks is None else [ticks])]
    columns += map(np.asarray, rec.channels.values())
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(first_line(list(rec.channels), fields["units"].values(), ticks is not None))
        for i in range(0, len(rec), _LINES):
            text = lines([c[i : i + _LINES] for c in columns], formats)
            file.write(text.replace(",nan", ","))


# -- while the samples arrive


def stream_head(stream: Stream) -> str:
    """First line of a recording that is being written."""
    check_names(name for name, _ in stream.channels)
    names, units = zip(*stream.channels)
    return first_line(names, units, ticks=True)


def stream_lines(stream: Stream, since: np.ndarray, ticks: np.ndarray, values: np.ndarray) -> str:
    """Lines of the rows that have come. since: ticks from the recording's first row to each."""
    time_s = stream.start_s + since / stream.tick_Hz
    formats = ["%.12g", "%d", *["%.9g"] * values.shape[1]]
    return lines([time_s, ticks, *values.T], formats)


def gap_lines(stream: Stream, since: int, tick: int, lost: int) -> str:
    """Lines for `lost` samples that are missing after the sample at `since`."""
    if lost > LONGEST_GAP:
        lost = 1
    steps = stream.decimation * np.arange(1, lost + 1, dtype=np.int64)
    columns = [stream.start_s + (since + steps) / stream.tick_Hz, (tick + steps) % 2**32]
    return lines(columns, ["%.12g", "%d" + "," * len(stream.channels)])


def stream_header(stream: Stream, samples: int | None, meta: dict) -> str:
    """The contents of the .json file."""
    columns = [(name, unit, "float32") for name, unit in stream.channels]
    return json_text(header(stream.rate_Hz, stream.start_s, samples, columns, meta))


# -- reading


def load(path: Path) -> Recording:
    text = given.decode(path.read_bytes())
    if path.suffix.lower() in TEXTS:
        return _plain(text, "a table of another program")
    json_file = path.with_suffix(".json")
    try:
        fields = json.loads(json_file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return _plain(text, f"{json_file.name} is not there")
    except (OSError, ValueError) as error:
        reason = f"its header {json_file.name} cannot be read: {one_line(error)}"
        raise RecordingError(reason) from None
    if not isinstance(fields, dict) or "rate_Hz" not in fields or "units" not in fields:
        return _plain(text, f"{json_file.name} is not of a recording")
    if stream := fields.get("stream"):
        return _former_stream(fields, Stream.from_json(stream), text, json_file.name)
    meta = fields["meta"]
    if meta.get("closed") is False:
        return _growing(fields, text, json_file.name)
    return _whole(fields, text, json_file.name)


def _below(text: str, units: dict[str, str], name: str) -> table.Table:
    """The table of a recording. Its header gives the names and units of the columns."""
    named = [table.heading(channel, unit) for channel, unit in units.items()]
    # The former layout had no units in the line of names.
    known = [["time_s", *t, *c] for t in ([], ["tick"]) for c in (named, list(units))]
    for cells in known:
        if found := table.under(text, _line(cells)):
            return found
    found = table.find(text)  # another program has saved the file again
    if found.names not in known:
        raise RecordingError(
            f"other columns than its header {name} says; without {name} it is read as a plain table"
        )
    return found


def _columns(found: table.Table, kinds: list[str]) -> tuple[np.ndarray | None, list[np.ndarray]]:
    """The ticks (None without ticks) and the channels."""
    ticks = found.names[1:2] == ["tick"]
    kinds = [kind.replace("bool", "uint8") for kind in kinds]
    _, *columns = found.columns(["f8", *["u4"] * ticks, *kinds])
    return (columns[0] if ticks else None), columns[ticks:]


def _whole(fields: dict, text: str, name: str) -> Recording:
    """Read a recording that was closed, or written at once."""
    units, meta = fields["units"], fields["meta"]
    if not text.endswith("\n"):
        raise RecordingError("the last line is not whole")
    types = fields.get("types", {})
    found = _below(text, units, name)
    ticks, columns = _columns(found, [types.get(n, "float64") for n in units])
    if ticks is not None and len(ticks):
        places, kept = ascending(ticks, meta[DECIMATION])
        if not kept.all():
            row = int(np.argmin(kept))
            raise RecordingError(
                f"line {found.line_of(row)}: tick {ticks[row]} does not follow on in steps of "
                f"{meta[DECIMATION]}"
            )
        if int(places[-1]) + 1 > len(places):  # a gap that has only one line
            columns = [fill(places, column) for column in columns]
    return from_fields(fields, dict(zip(units, columns, strict=True)))


def _growing(fields: dict, text: str, name: str) -> Recording:
    """Read a recording that is still being written, or whose process was killed, up to its last
    complete line."""
    meta = fields["meta"]
    stream = Stream(
        tuple(fields["units"].items()),
        float(meta[TICK_HZ]),
        meta[DECIMATION],
        float(fields["start_s"]),
        meta,
    )
    return _as_it_came(stream, {n: meta[n] for n in COUNTERS if n in meta}, text, name, False)


def _former_stream(fields: dict, stream: Stream, text: str, name: str) -> Recording:
    """Read the layout used until 2026: it has no lines for lost samples, and another header."""
    closed = fields["closed"] is True
    if closed and not text.endswith("\n"):
        raise RecordingError("the last line is not whole")
    return _as_it_came(stream, fields["counters"], text, name, closed)


def _as_it_came(stream: Stream, counters: dict, text: str, name: str, closed: bool) -> Recording:
    # An incomplete last line is dropped: its last number may be cut off.
    text = text[: text.rfind("\n") + 1]
    ticks, values = np.empty(0, np.uint32), np.empty((0, len(stream.channels)), np.float32)
    if text:
        found = _below(text, dict(stream.channels), name)
        numbers, columns = _columns(found, ["f4"] * len(stream.channels))
        if numbers is None:
            raise RecordingError("no column tick")
        values = np.column_stack(columns)
        came = ~np.isnan(values).all(axis=1)
        ticks, values = numbers[came], values[came]
    return assemble(stream, ticks, values, counters, closed)


def _plain(text: str, why: str) -> Recording:
    """Read a table without a header: it comes from another program, or its .json is lost."""
    found = table.find(table.without_spaces(text))
    at, unit_s, assumed = table.time_column(found)
    columns = found.number_columns(["f8"] * len(found.names))
    notes = [f"{why}: names, units and time are those of the table itself"]
    notes += [assumed] * bool(assumed)
    if at is None:
        at, time_s = _counted_times(found, columns)
    elif (times := columns[at]) is None:
        raise RecordingError(f"{found.name(at)}: no numbers; time in seconds is needed")
    else:
        time_s = times * unit_s
    return plain.recording(found, columns, at, time_s, notes)


def _counted_times(
    found: table.Table, columns: list[np.ndarray | None]
) -> tuple[int | None, np.ndarray]:
    """The column that counts the samples, if there is one, and the times by start and increment of
    the header."""
    at = table.counted(found, columns)
    length = next((len(column) for column in columns if column is not None), 0)
    count = np.arange(length, dtype=float)
    if at is not None and (column := columns[at]) is not None:
        wrong = np.flatnonzero(~np.isfinite(column) | (np.nan_to_num(column) % 1 != 0))
        if len(wrong):
            raise RecordingError(
                f"line {found.line_of(int(wrong[0]))}, {found.name(at)}: whole numbers that count "
                "the samples are needed"
            )
        count = column - column[:1]
    elif blank := re.search(r"\n\s*\n", text := found.text[found.begin :].rstrip()):
        raise RecordingError(
            f"line {found.line + text.count(chr(10), 0, blank.start()) + 1}: blank, but the lines "
            "are counted"
        )
    assert found.start_s is not None and found.step_s is not None  # time_column said so
    return at, found.start_s + found.step_s * count
