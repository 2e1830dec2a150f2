"""The plant in C as a library that Python calls in place of the one that numba compiles."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..chips import EXACT
from ..errors import HexatorqueError
from ..plant.loop import Chip, Plant, Samples
from .plant import CODE


def build(files: dict[str, str], folder: Path, compiler: str, *more: str) -> Library:
    """Compile the translated functions. more: options and sources for the compiler."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    path = folder / "libplant.so"
    options = ["-O3", *EXACT, "-shared", "-fPIC", *more]
    command = [compiler, *options, "-o", path.name, CODE, "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise HexatorqueError(f"{compiler} failed:\n{done.stderr.strip()}")
    return Library(path)


class Library:
    """The functions of the plant in C, with the arguments of those in plant.loop."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path.resolve()))
        count = ctypes.c_int64.in_dll(self._library, "plant_error_count").value
        self._errors = (ctypes.c_char_p * count).in_dll(self._library, "plant_errors")

    def run_periods(
        self, n: int, first: int, timing: np.record, plant: Plant, vdc_V: float, chip: Chip,
        fast: Any, slow: Any, read: Any, samples: Samples, logged: int,
    ) -> int:  # fmt: skip
        parts = _addresses([*chip[:4]], chip.handle)
        taken = _addresses(
            [samples.instants, samples.plant, samples.channels, samples.edges], samples.address
        )
        # As in the structure: the address stands before the channels.
        order = [0, 1, 2, 3, 10, 4, 5, 6, 7, 8, 9]
        return self.call(
            "plant_run_periods",
            n, first, timing, _addresses(plant), ctypes.c_double(vdc_V), parts,
            *(entry.__wrapper_address__() for entry in (fast, slow, read)),
            taken[order], logged,
        )  # fmt: skip

    def call(self, name: str, *arguments: Any) -> int:
        """A function that takes whole numbers, records and arrays, and returns a whole number."""
        failed = ctypes.c_int(0)
        function = getattr(self._library, name)
        function.restype = ctypes.c_int64
        given = [
            a if isinstance(a, ctypes.c_double)
            else ctypes.c_void_p(_address(a)) if isinstance(a, np.ndarray | np.record)
            else ctypes.c_int64(int(a))
            for a in arguments
        ]  # fmt: skip
        result = function(*given, ctypes.byref(failed))
        if failed.value:
            raise ArithmeticError((self._errors[failed.value - 1] or b"").decode())
        return result


def _address(part: np.ndarray | np.record) -> int:
    return part.__array_interface__["data"][0]


def _addresses(parts: Sequence[Any], *numbers: int) -> np.ndarray:
    """A structure of addresses: tables have their size behind theirs."""
    found: list[int] = []
    for part in parts:
        found.append(_address(part))
        if isinstance(part, np.ndarray) and part.ndim == 2:
            found += part.shape
    return np.array([*found, *numbers], np.uint64)
