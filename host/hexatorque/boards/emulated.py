"""The virtual board with its firmware on an emulated processor: the drive and its link run in
QEMU and use the emulated machine's serial port; the plant is here, in lock-step with them.

with EmulatedBoard(scenario.load("paper-b"), "mps2-an386") as board, Terminal() as line:
    print(line.port)
    serve(board, line, until=lambda: False)
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from ..drive.simulated import SimulatedDrive
from ..firmware import FirmwareError
from ..setups import Setup
from . import tools
from .emulator_process import MACHINES, NEEDS, TIMEOUT_S, ProcessTarget, fifos, qemu
from .processor import TargetController
from .store_file import FileStore
from .virtual import VirtualBoard, watchdog_ms

#: Machines with a serial port for the link.
BOARDS = ("mps2-an386", "mps2-an500")
BAUD = 1_250_000
#: What the divider of their serial port makes of 25 MHz.
BAUD_RANGE = (25_000_000 // 0xFFFFF + 1, 25_000_000 // 16)
IMAGE = "firmware/port/mps2/board"
#: The serial port's other end: FIFOs uart.in and uart.out of the working directory. A socket
#: is full after some 300 single octets; QEMU's own pseudo-terminals drop them until they have
#: noticed that there is a client, once a second.
SERIAL = ("-chardev", "pipe,id=uart,path=uart", "-serial", "chardev:uart")


class BoardProcess(ProcessTarget):
    """QEMU with the image of the board."""

    def __init__(
        self, machine: str, baud: int, watchdog_ms: int, timeout_s: float, store: Path | None
    ) -> None:
        self.baud = baud
        self._store = store
        self._setup = np.array([baud, watchdog_ms], "<u4")
        tools.need(*NEEDS[machine])
        image = tools.build(MACHINES[machine]) / IMAGE
        super().__init__(machine, qemu(machine, image, SERIAL), timeout_s)

    def prepare(self, place: Path) -> list[int]:
        (place / "setup").write_bytes(self._setup.tobytes())
        if self._store:
            (place / "store").symlink_to(self._store.absolute())
        self.uart = fifos(place, "uart.in", "uart.out")
        return self.uart


class EmulatedController(TargetController):
    """A drive on that process, and the other end of its line."""

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
        self._to_board, self._from_board = target.uart

    def put(self, octets: bytes) -> int:
        """Octets onto the line, to the board. Returns how many found room."""
        try:
            return os.write(self._to_board, octets) if octets else 0
        except BlockingIOError:
            return 0

    def take(self) -> bytes:
        """Octets that the board has sent."""
        try:
            return os.read(self._from_board, 65536)
        except BlockingIOError:
            return b""


class EmulatedBoard(VirtualBoard):
    """`baud` is the line's in simulated time. Where `factor` is more than this computer can
    do, simulated time passes more slowly, and so does the watchdog's."""

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
        # What it holds decides how both ends begin; the image has the same file.
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
