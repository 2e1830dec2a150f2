"""The virtual board with its firmware on an emulated processor.

The drive and its link run in QEMU and use the emulated machine's serial port. The plant runs in
this process, in lock-step with them.

with EmulatedBoard(hexatorque.load("paper-b"), "mps2-an386") as board, new_line() as line:
    print(line.port)
    serve(board, line, until=lambda: False)
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from .. import system
from ..drive.simulated import SimulatedDrive
from ..firmware import FirmwareError
from ..setups import Setup
from . import tools
from .emulator_process import MACHINES, NEEDS, TIMEOUT_S, ProcessTarget, qemu
from .processor import TargetController
from .store_file import FileStore
from .virtual import VirtualBoard, watchdog_ms

#: Machines whose images use a serial port for the link.
BOARDS = ("mps2-an386", "mps2-an500")
BAUD = 1_250_000
#: Baud rates that the divider of their serial port makes from 25 MHz.
BAUD_RANGE = (25_000_000 // 0xFFFFF + 1, 25_000_000 // 16)
IMAGE = "firmware/port/mps2/board"
#: The other end of the serial port: the FIFOs uart.in and uart.out in the working directory; xcp.in
#: and xcp.out are those of the second port. A
#: socket would be full after some 300 single bytes. QEMU's own pseudo-terminals drop bytes until
#: they notice a client, for which they look only once a second.
SERIAL = (
    "-chardev", "pipe,id=uart,path=uart", "-serial", "chardev:uart",
    "-chardev", "pipe,id=xcp,path=xcp", "-serial", "chardev:xcp",
)  # fmt: skip


class BoardProcess(ProcessTarget):
    """QEMU, running the image of the board."""

    def __init__(
        self, machine: str, baud: int, watchdog_ms: int, timeout_s: float, store: Path | None
    ) -> None:
        self.baud = baud
        self._store = store
        self._setup = np.array([baud, watchdog_ms], "<u4")
        tools.need(*NEEDS[machine])
        image = tools.build(MACHINES[machine], "board") / IMAGE
        super().__init__(machine, qemu(machine, image, SERIAL), timeout_s)

    def prepare(self, place: Path) -> list[int]:
        (place / "setup").write_bytes(self._setup.tobytes())
        if self._store:
            (place / "store").symlink_to(self._store.absolute())
        # QEMU opens both for reading and writing, so that neither of us waits for the other.
        self.lines = []
        for name, how in itertools.product(("uart", "xcp"), ("in", "out")):
            system.fifo(place / f"{name}.{how}")
            mode = os.O_RDWR if how == "in" else os.O_RDONLY
            self.lines.append(os.open(place / f"{name}.{how}", mode | os.O_NONBLOCK))
        return self.lines


class EmulatedController(TargetController):
    """The drive in that process, and the other end of its line."""

    entries = ("ht_link_fast", "ht_link_slow_unseen", "ht_link_channels")

    def __init__(
        self,
        target: BoardProcess,
        device: str,
        values: Mapping[str, object],
        store: FileStore | None,
    ) -> None:
        super().__init__(target, device, values, store)
        self.baud = target.baud
        self._to_board, self._from_board, self._to_xcp, self._from_xcp = target.lines

    def put(self, raw: bytes) -> int:
        """Send bytes to the board. Returns how many fitted into the buffer."""
        return _put(self._to_board, raw)

    def take(self) -> bytes:
        """The bytes that the board has sent since the last call."""
        return _take(self._from_board)

    def put_net(self, raw: bytes) -> int:
        """The same on the second line, which is XCP's."""
        return _put(self._to_xcp, raw)

    def take_net(self) -> bytes:
        return _take(self._from_xcp)


def _put(file: int, raw: bytes) -> int:
    try:
        return os.write(file, raw) if raw else 0
    except BlockingIOError:
        return 0


def _take(file: int) -> bytes:
    try:
        return os.read(file, 65536)
    except BlockingIOError:
        return b""


class EmulatedBoard(VirtualBoard):
    """A virtual board on an emulated processor. baud: the line's rate, in simulated time; factor:
    the speed relative to real time. If this computer is too slow for `factor`, simulated time
    passes more slowly, the watchdog's time included."""

    def __init__(
        self,
        setup: Setup,
        machine: str = BOARDS[0],
        baud: int | None = None,
        factor: float = 1.0,
        timeout_s: float = TIMEOUT_S,
        store: Path | None = None,
    ) -> None:
        if machine not in BOARDS:
            raise FirmwareError(f"machine = {machine!r}: choose one of {', '.join(BOARDS)}")
        baud = BAUD if baud is None else baud
        least, most = BAUD_RANGE
        if not least <= baud <= most:
            raise FirmwareError(f"baud = {baud}: allowed range is {least} .. {most}")
        self.factor = factor
        self.machine = machine
        # The store's contents decide how host and image start. Both have the same file.
        self.file = FileStore(store) if store else None
        try:
            self.target = BoardProcess(machine, baud, watchdog_ms(factor), timeout_s, store)
        except BaseException:
            super().close()
            raise
        try:
            make = partial(EmulatedController, self.target, store=self.file)
            self.sim = SimulatedDrive(setup, controller=make)
        except BaseException:
            self.close()
            raise
        controller = self.sim.controller
        assert isinstance(controller, EmulatedController)
        self.controller = controller

    @property
    def title(self) -> str:
        return f"{self.machine}, {self.sim.setup.name}"

    def close(self) -> None:
        self.target.close()
        super().close()
