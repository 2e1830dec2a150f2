"""The table of a study: a row a run, a column a key or a figure, the last one says why a run has no
figures. As CSV with a .json file beside it, as Parquet, and as a DataFrame."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..recording.formats import one_line, replacing
from .errors import StudyError
from .space import SCHEME, Space, unit_of
from .work import Row, unit

if TYPE_CHECKING:
    import pandas as pd

RUN, FAILURE = "run", "failure"
#: Under this name the Parquet file's metadata have what is in the .json file.
META = b"hexatorque"


@dataclass
class Results:
    """The computed figures. They take the same memory from the first row to the last."""

    space: Space
    metrics: tuple[str, ...]
    figures: np.ndarray = field(init=False)
    done: np.ndarray = field(init=False)
    failures: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.figures = np.full((len(self.space), len(self.metrics)), math.nan)
        self.done = np.zeros(len(self.space), bool)

    def add(self, row: Row) -> None:
        self.done[row.number] = True
        self.figures[row.number] = row.figures
        self.failures.pop(row.number, None)
        if row.failure:
            self.failures[row.number] = row.failure

    def forget(self, row: Row) -> None:
        """It has to be computed again."""
        self.done[row.number] = False

    @property
    def missing(self) -> Iterator[int]:
        return (int(number) for number in np.flatnonzero(~self.done))


def units(results: Results) -> dict[str, str]:
    """The columns, with their units."""
    keys = {path: "" if path == SCHEME else unit_of(path) for path in results.space.paths}
    return {RUN: "", **keys, **{name: unit(name) for name in results.metrics}, FAILURE: ""}


def lines(results: Results) -> Iterator[list[Any]]:
    """The rows that are there, in the order of their numbers. A list of numbers is text."""
    for number in np.flatnonzero(results.done):
        case = results.space.case(int(number))
        keys = [_cell(case.values[path]) for path in results.space.paths]
        figures = results.figures[number].tolist()
        yield [int(number), *keys, *figures, results.failures.get(int(number), "")]


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, (list, tuple)) else value


def write_csv(results: Results, meta: dict[str, Any], path: Path) -> None:
    """CSV, and beside it .json with units and what was studied."""
    columns = units(results)
    write_lines(tuple(columns), lines(results), {"units": columns, **meta}, path)


def write_lines(
    columns: Sequence[str], rows: Iterable[Sequence[Any]], meta: dict[str, Any], path: Path
) -> None:
    try:
        with replacing(path) as draft:
            with draft.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(columns)
                for row in rows:
                    writer.writerow("" if _is_nan(cell) else cell for cell in row)
            draft.with_suffix(".json").write_text(
                json.dumps(meta, indent=1) + "\n", encoding="utf-8"
            )
    except OSError as error:
        raise StudyError(f"{path}: {one_line(error)}") from None


def _is_nan(cell: Any) -> bool:
    return isinstance(cell, float) and math.isnan(cell)


def write_parquet(results: Results, meta: dict[str, Any], path: Path) -> bool:
    """Parquet with the units in each column's metadata. False if pyarrow is not installed."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        return False
    columns = units(results)
    arrays = [pa.array(column, from_pandas=True) for column in _columns(results)]
    fields = [
        pa.field(name, array.type, metadata={"unit": unit})
        for (name, unit), array in zip(columns.items(), arrays)
    ]
    text = json.dumps({"units": columns, **meta})
    schema = pa.schema(fields, metadata={META: text.encode()})
    try:
        with replacing(path) as draft:
            parquet.write_table(pa.table(arrays, schema=schema), draft)
    except OSError as error:
        raise StudyError(f"{path}: {one_line(error)}") from None
    return True


def _columns(results: Results) -> list[list[Any]]:
    """The table's columns. A column with numbers and text is text."""
    columns = [list(column) for column in zip(*lines(results))] or [[] for _ in units(results)]
    for k, column in enumerate(columns):
        if any(isinstance(cell, str) for cell in column):
            columns[k] = [str(cell) for cell in column]
        elif any(isinstance(cell, float) for cell in column):
            columns[k] = [float(cell) for cell in column]
    return columns


def data_frame(columns: Mapping[str, Any]) -> pd.DataFrame:
    try:
        import pandas as pd
    except ImportError:
        raise StudyError(
            "a table in Python needs pandas, which is not installed: "
            "pip install 'hexatorque[sweep]'"
        ) from None
    return pd.DataFrame(columns)


def frame(results: Results, meta: dict[str, Any]) -> pd.DataFrame:
    """A pandas DataFrame; `attrs["units"]` has the units."""
    columns = units(results)
    found = data_frame(dict(zip(columns, _columns(results))))
    found.attrs.update({"units": columns, **meta})
    return found
