"""The firmware's answers to a command: its table of results (firmware/app/ht_results.def)."""

from __future__ import annotations

from typing import NamedTuple

from ._firmware import ffi, lib


class Result(NamedTuple):
    text: str  #: {state} stands for the drive's state
    mistake: bool  #: the request is wrong, in whatever state the drive is


def _rows() -> dict[int, Result]:
    rows = (lib.ht_result_describe(row) for row in range(lib.ht_result_count()))
    return {row.number: Result(ffi.string(row.text).decode(), row.mistake) for row in rows}


#: Number -> row. 0, success, is not among them.
RESULTS = _rows()


def waiting(seconds: int) -> str:
    """Why a start must wait, and for how long."""
    return f"{RESULTS[lib.HT_ERROR_RESTART].text}; a start is refused for another {seconds} s"


def text_of(number: int, state: str) -> str:
    """The meaning of a result in this state of the drive. A later firmware may know more of
    them."""
    row = RESULTS.get(number)
    return row.text.format(state=state) if row else f"status {number}"
