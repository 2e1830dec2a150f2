"""The firmware of a drive, with a law of the host in place of a scheme's."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numba import carray, cfunc, config, njit, types
from numba.core.errors import NumbaError

from ..firmware import CData, Controller, ffi, lib, parameters, schemes
from ..given import parameter_name
from .law import RETURNS, SEEN, Law, LawError

#: The scheme whose way the drive goes: it needs the x-y prediction and has no integrators.
BASE = "dtc2"
_KINDS = {"duties": lib.HT_RETURNS_DUTIES, "vectors": lib.HT_RETURNS_VECTORS}
#: Names of the values, for messages.
_VALUES = {
    "duties": tuple(f"duty ratio of leg {leg}" for leg in ("u1", "u2", "w1", "w2", "v1", "v2")),
    "vectors": ("state word s0", "state word s1", "state word s2", "instant t1", "instant t2"),
}
_EMPTY = np.dtype([("unused", "f8")])


@lru_cache
def _compiled(step: Any, memory: np.dtype, wanted: int) -> Any:
    """A C function that calls `step`, compiled for this type of memory."""
    inner = njit(step)

    @cfunc(types.int32(types.voidptr, types.voidptr, types.voidptr))
    def entry(seen_at, memory_at, values_at):
        seen = carray(seen_at, 1, SEEN)[0]
        own = carray(memory_at, 1, memory)[0]
        values = carray(values_at, 6, np.float32)
        try:
            result = inner(seen, own)
        except Exception:
            return -1
        count = len(result)
        if count == wanted:
            for k in range(wanted):
                values[k] = result[k]
        return count

    return entry


_compiling = threading.Lock()


def _first_line(error: NumbaError) -> str:
    """Numba's message, without colours and without its context."""
    lines = re.sub(r"\x1b\[\d*m", "", str(error)).splitlines()
    said = [line.strip() for line in lines if line.strip() and "nopython mode" not in line]
    return said[0] if said else type(error).__name__


class LawController(Controller):
    """One drive. It is named by its law, and it stops if the law's step fails or returns what
    cannot be a pattern: then the gates are off, and `confirm` raises a LawError."""

    entries = ("ht_host_law_fast", "ht_host_law_slow", "ht_host_law_channels")

    def __init__(self, law: Law, device: str, values: Mapping[str, object]) -> None:
        self.law = law
        if law.returns not in RETURNS:
            raise LawError(
                f"law {law.label}: returns = {law.returns!r}: choose one of {', '.join(RETURNS)}"
            )
        if (values.get("load_mode"), values.get("predict")) != ("shadow", "on"):
            raise LawError(f'law {law.label}: it needs timing.latency = "predicted"')
        if values.get("machine", "induction") != "induction":
            raise LawError(f"law {law.label}: it needs a machine with a winding on its rotor")
        if values.get("displacement_deg", "30") != "30":
            raise LawError(f"law {law.label}: it needs sets that are 30 degrees apart")
        super().__init__(device, self._with_base(values))
        self._error: Exception | None = None
        self._law = ffi.new("ht_host_law *")
        self._law.drive = self.drive
        self._law.kind = _KINDS[law.returns]
        self._seen = np.frombuffer(ffi.buffer(ffi.addressof(self._law, "seen")), SEEN).view(
            np.recarray
        )[0]
        self._prepare()

    def _with_base(self, values: Mapping[str, object]) -> dict[str, object]:
        row = lib.ht_scheme_describe(schemes().index(BASE))
        margin = float(str(values["fw_margin"])) * self.law.reach_pu / row.reach_pu
        own = {"scheme": BASE, "table": "75/105", "torque_levels": "auto"}
        return {**values, **own, "fw_margin": min(margin, parameters()["fw_margin"].max)}

    def _prepare(self) -> None:
        """Memory as it is at a start, and the function that works on it."""
        numbers = {name: self.get(name) for name in self.parameters}
        made = self.law.memory(numbers)
        initial = np.zeros(1, _EMPTY) if made is None else np.atleast_1d(np.asarray(made))
        self._initial, self._memory = initial.copy(), initial.copy()
        self._own = self._memory.view(np.recarray)[0]
        h = self._law
        h.size = self._memory.nbytes
        h.initial = ffi.cast("void *", self._initial.ctypes.data)
        h.memory = ffi.cast("void *", self._memory.ctypes.data)
        h.step = self._entry()

    def _entry(self) -> CData:
        law = self.law
        address = law.entry(self._own)
        if address is not None:
            return ffi.cast("ht_host_law_step", address)
        if law.compiled and not getattr(config, "DISABLE_JIT", False):
            try:
                with _compiling:
                    entry = _compiled(law.step, self._memory.dtype, RETURNS[law.returns])
            except NumbaError as error:
                raise LawError(
                    f"law {law.label}: numba cannot compile its step: {_first_line(error)}; "
                    "compiled = False does without"
                ) from None
            return ffi.cast("ht_host_law_step", entry.address)
        self._callback = ffi.callback("ht_host_law_step", self._call, error=-1)
        return self._callback

    def _call(self, seen_at: CData, memory_at: CData, values_at: CData) -> int:
        """The step, uncompiled. The addresses are those of `_seen` and `_own`."""
        try:
            result = np.asarray(self.law.step(self._seen, self._own), float)
            if result.shape == (RETURNS[self.law.returns],):
                for k, value in enumerate(result):
                    values_at[k] = value
            return result.size if result.ndim == 1 else 0
        except Exception as error:
            self._error = error
            return -1

    @property
    def memory(self) -> np.record:
        """The values that the step reads and changes. A start makes them anew."""
        return self._own

    @property
    def handle(self) -> int:
        return int(ffi.cast("uintptr_t", self._law))

    def get(self, name: str) -> str | float:
        return self.law.label if parameter_name(name) == "scheme" else super().get(name)

    def set_many(self, values: Mapping[str, object]) -> None:
        values = {parameter_name(name): value for name, value in values.items()}
        for name in ("scheme", "table", "torque_levels", "load_mode", "predict"):
            if name in values:
                raise LawError(f"{name}: cannot be set, law {self.law.label} decides")
        super().set_many(values)

    def start(self) -> None:
        self._prepare()
        super().start()

    def confirm(self) -> None:
        h = self._law
        if h.wrong != lib.HT_HOST_LAW_RIGHT:
            text = f"law {self.law.label}: {self._what_was_wrong()}"
            h.wrong = lib.HT_HOST_LAW_RIGHT  # said once; the drive remains in FAULT
            raise LawError(
                f"{text}, {h.tick * float(self.drive.config.control.observer.ts_s):.6g} s "
                "after the reset; the gates are off"
            )

    def _what_was_wrong(self) -> str:
        h, returns = self._law, self.law.returns
        if h.wrong == lib.HT_HOST_LAW_FAILED:
            return f"its step failed: {self._reason()}"
        if h.wrong == lib.HT_HOST_LAW_SHAPE:
            shape = f"{h.count} numbers" if h.count else "an empty or nested array"
            return f"its step returned {shape}, needed are {RETURNS[returns]} ({returns})"
        if h.wrong == lib.HT_HOST_LAW_ORDER:
            return f"t1 = {h.value[3]:.6g} is after t2 = {h.value[4]:.6g}"
        word = returns == "vectors" and h.index < 3
        allowed = "a whole number 0 .. 63" if word else "0 .. 1"
        return f"{_VALUES[returns][h.index]} = {h.value[h.index]:.6g}: allowed is {allowed}"

    def _reason(self) -> str:
        """Why the step raised an exception. A compiled step tells it when it is called again,
        uncompiled."""
        error, self._error = self._error, None
        if error is None:
            try:
                self.law.step(self._seen, self._own)
            except Exception as again:
                error = again
        return f"{type(error).__name__}: {error}" if error else "an error in compiled code"


def controller_of(law: Law) -> Callable[[str, Mapping[str, object]], LawController]:
    """The controller for `SimulatedDrive(setup, controller=controller_of(law))`."""
    return partial(LawController, law)
