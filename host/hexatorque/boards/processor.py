"""Processor in the loop: the firmware on another processor controls a plant that runs here.

The processor runs one control period at a time. `WatchedController` runs the firmware on this
computer and logs the same registers, for comparison. The protocol is in firmware/pil and its
folder host.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np

from ..errors import HexatorqueError
from ..firmware import (
    DEVICES,
    STATE_TABLE,
    CData,
    Controller,
    FirmwareError,
    Snapshot,
    State,
    Store,
    causes,
    channels,
    ffi,
    lib,
    snapshot_of,
)


class TargetError(HexatorqueError, RuntimeError):
    """The target does not answer, or its answer is wrong."""


_ERRORS = {
    lib.HT_LINK_SILENT: "no reply in time",
    lib.HT_LINK_CLOSED: "the target has ended",
    lib.HT_LINK_BROKEN: "a frame did not arrive whole (CRC)",
    lib.HT_LINK_ANSWER: "a reply that does not fit the request",
    lib.HT_LINK_REFUSED: "the target refuses the request",
    lib.HT_LINK_PARTED: "host and target see different hardware",
}


def _fields(struct: CData) -> dict[str, int]:
    """The fields of a C struct of numbers, by name."""
    return {name: getattr(struct, name) for name, _ in ffi.typeof(struct).item.fields}


class Log:
    """The log of register images, one after every period, of either kind of controller."""

    def __init__(self, log: CData) -> None:
        self._log = log
        self._rows = np.empty((0, log.width), np.uint16)

    def begin(self, periods: int) -> None:
        """Make room for the next `periods` periods that are logged."""
        self._rows = np.empty((periods, self._log.width), np.uint16)
        self._log.image = ffi.cast("uint16_t *", self._rows.ctypes.data)
        self._log.capacity = periods
        self._log.rows = 0

    @property
    def images(self) -> np.ndarray:
        """The images, (periods, words) uint16. `image_names` names the columns."""
        return self._rows[: self._log.rows]


def image_names(controller: Controller) -> list[str]:
    """TI's names of the registers whose words are in an image."""
    m = controller.map
    found = ffi.new("uint32_t[]", lib.HT_MIRROR_MAX)
    count = lib.ht_mirror_addresses(m, found)
    line = ffi.new("char[64]")
    names: list[str] = []
    for address in found[0:count]:
        lib.ht_regfile_name(controller.registers, address, line)
        name = ffi.string(line).decode() or f"register 0x{address:04X}"
        names.append(f"{name} (high)" if names[-1:] == [name] else name)
    return [*names, "accesses (low)", "accesses (high)", "violations (low)", "violations (high)"]


class WatchedController(Controller):
    """The firmware on the host, with a log of its registers."""

    entries = ("ht_watch_fast", "ht_watch_slow", "ht_watch_channels")

    def __init__(self, device: str, values: Mapping[str, object]) -> None:
        super().__init__(device, values)
        self._watch = ffi.new("ht_watch *")
        lib.ht_watch_init(self._watch, self.drive, self.registers)
        self.log = Log(self._watch.log)

    @property
    def handle(self) -> int:
        return int(ffi.cast("uintptr_t", self._watch))


class Target:
    """A target runs drives, one at a time; this one runs in this process, but uses the codec as
    the others do. Use it as a context; `SimulatedDrive` takes its `controller`."""

    name = "local"

    def __init__(self) -> None:
        self.link = ffi.new("ht_link *")
        self._local = ffi.new("ht_pil_line *")
        self.link.local = self._local
        lib.ht_link_reset(self.link)

    def controller(self, device: str, values: Mapping[str, object]) -> TargetController:
        return TargetController(self, device, values)

    def why_down(self) -> str:
        """Text for the end of an error message: why the link has failed, as far as known."""
        return ""

    def close(self) -> None:
        """End it. May be called again."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class TargetController(Controller):
    """The firmware on a target. The drive on the host only checks values and gives the timing
    that follows from them. It never runs."""

    entries = ("ht_link_fast", "ht_link_slow", "ht_link_channels")

    def __init__(
        self,
        target: Target,
        device: str,
        values: Mapping[str, object],
        store: Store | None = None,
    ) -> None:
        super().__init__(device, values, store=store)
        self._target, self._link = target, target.link
        link = target.link
        self._own_registers = self.registers
        self.registers = ffi.addressof(link.registers)
        self.processor = target.name
        self._check_identity()
        lib.ht_link_init(link, DEVICES.index(device), ffi.addressof(self.drive.params))
        self.confirm()
        self._check(link.result, "controller set-up")
        self.log = Log(link.log)

    def _check_identity(self) -> None:
        answer, own = ffi.new("ht_pil_identity *"), ffi.new("ht_pil_identity *")
        lib.ht_link_hello(self._link, answer)
        self.confirm()
        lib.ht_pil_identify(own)
        there, here = _fields(answer), _fields(own)
        if not there["registers"]:  # this target reports its calls instead of registers
            there["registers"] = here["registers"]
        if there != here:
            differ = ", ".join(
                f"{name} {there[name]}, here {here[name]}"
                for name in here
                if there[name] != here[name]
            )
            raise TargetError(
                f"{self.processor}: another version of the firmware runs there ({differ})"
            )

    @property
    def handle(self) -> int:
        return int(ffi.cast("uintptr_t", self._link))

    def confirm(self) -> None:
        if self._link.error:
            raise TargetError(
                f"{self.processor}: {_ERRORS[self._link.error]}{self._target.why_down()}"
            )

    def _request(self, opcode: int, argument: int = 0, value: float = 0.0) -> int:
        lib.ht_link_request(self._link, opcode, argument, value)
        self.confirm()
        return self._link.result

    @property
    def condition(self) -> State:
        return STATE_TABLE[self._link.state]

    @property
    def state(self) -> str:
        return self.condition.name

    @property
    def faults(self) -> list[str]:
        return causes(self._link.faults)

    @property
    def snapshot(self) -> Snapshot | None:
        kept = ffi.new("ht_snapshot *")
        lib.ht_link_snapshot(self._link, kept)
        self.confirm()
        return snapshot_of(kept)

    def channel(self, name: str) -> float:
        return self._link.channels[[n for n, _ in channels()].index(name)]

    def number(self, name: str) -> float:
        self._check(self._request(lib.HT_OP_PIL_GET, self.parameters[name].id), name)
        return self._link.value

    def set_many(self, values: Mapping[str, object]) -> None:
        """Set several values, or none if one is refused. The link sets one value at a time, so
        after a refusal the former values are written back."""
        for name, value in values.items():
            if name not in self.parameters:
                raise FirmwareError(f"no controller parameter {name!r}")
            self.parameters[name].parse(value)
        done: dict[str, object] = {}
        for name, value in values.items():
            before = self.get(name)
            try:
                self._put(name, value)
            except FirmwareError:
                for changed, old in reversed(done.items()):
                    self._put(changed, old)
                raise
            done[name] = before

    def _put(self, name: str, value: object) -> None:
        row, asked = self.parameters[name], f"{name} = {value}"
        result = self._request(lib.HT_OP_PIL_SET, row.id, row.parse(value))
        if result == lib.HT_ERROR_CONFIG:  # the link does not say why: the same check on the host
            params = ffi.new("ht_params *")
            for other in self.parameters.values():
                params.v[other.id] = self.number(other.name)
            params.v[row.id] = row.parse(value)
            raise FirmwareError(f"{asked}: {self._why_unfit(params)}")
        self._check(result, asked)

    def start(self) -> None:
        self._check(self._request(lib.HT_OP_PIL_START), "start")

    def stop(self) -> None:
        self._request(lib.HT_OP_PIL_STOP)

    def clear(self) -> None:
        self._check(self._request(lib.HT_OP_PIL_CLEAR), "clear")
