"""A virtual board: firmware and plant in one process, with a pseudo-terminal as serial port.

board = VirtualBoard(hexatorque.load("paper-b"))
with Terminal() as line:
    print(line.port)          # what a client opens
    serve(board, line, until=lambda: False)

The link's code is the same as in a board's image, with the driver of the SCI and the register
model below it. The line carries as many bytes per simulated second as its baud rate allows.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import time
import tty
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from .. import __version__, firmware
from ..drive.simulated import SimulatedDrive
from ..firmware import FirmwareError, ffi, lib
from ..recording.recording import Recording
from ..setups import Setup
from .own_recording import OwnRecording
from .store_file import FileStore
from .xcp_port import XcpLine, XcpPort

#: Simulated seconds between two transfers of bytes on the line, at real-time speed, and when the
#: client has sent nothing for QUIET_S. Bytes from the client end a turn at once, so only a stream
#: waits for the longer turn.
TURN_S = 0.002
QUIET_TURN_S = 0.010
QUIET_S = 0.006
#: A process that could not run for longer than this does not catch up. On a busy computer the
#: client could not run either, and its heartbeats would then be too late in simulated time.
LATE_S = 0.05
#: Memory for captures, in values, as in the image for the F28377S.
CAPTURE_VALUES = 20480


class SerialBoard(XcpLine, Protocol):
    """What a board's controller is beside the drive: its end of the line, and of XCP's."""

    baud: int

    @property
    def parameter_set(self) -> str: ...

    def put(self, raw: bytes) -> int: ...

    def take(self) -> bytes: ...


class BoardController(firmware.Controller):
    """A drive with its link, and the other end of its line."""

    entries = ("ht_virtual_fast", "ht_virtual_slow", "ht_virtual_channels")

    def __init__(
        self,
        device: str,
        values: Mapping[str, object],
        baud: int | None,
        watchdog_ms: int,
        store: firmware.Store | None = None,
    ) -> None:
        super().__init__(device, values, store=store)
        self.baud = baud or self.port.board.baud
        self.board = ffi.new("ht_virtual_board *")
        self._texts = [ffi.new("char[]", t.encode()) for t in (f"virtual {device}", __version__)]
        self._memory = ffi.new("uint32_t[]", CAPTURE_VALUES)
        setup = ffi.new("ht_service_setup *")
        setup.device, setup.build = self._texts
        setup.watchdog_ms = watchdog_ms
        setup.memory = self._memory
        setup.memory_size = CAPTURE_VALUES
        setup.store = self.store.handle
        if not lib.ht_virtual_init(self.board, self.drive, self.port, setup, self.baud):
            most = self.map.sci_clock_Hz // 16
            least = self.map.sci_clock_Hz // (8 * 65536) + 1
            raise FirmwareError(f"baud = {self.baud}: allowed range is {least} .. {most}")
        self._out = np.empty(65536, np.uint16)

    @property
    def handle(self) -> int:
        return int(ffi.cast("uintptr_t", self.board))

    def put(self, raw: bytes) -> int:
        """Send bytes to the board. Returns how many fitted into the buffer."""
        return self._put(self.board.serial, raw)

    def take(self) -> bytes:
        """The bytes that the board has sent since the last call."""
        return self._take(self.board.serial)

    def put_net(self, raw: bytes) -> int:
        """The same on the second line, which is XCP's."""
        return self._put(self.board.net, raw)

    def take_net(self) -> bytes:
        return self._take(self.board.net)

    def _put(self, line: firmware.CData, raw: bytes) -> int:
        cells = np.frombuffer(raw, np.uint8).astype(np.uint16)
        pointer = ffi.cast("uint16_t *", cells.ctypes.data)
        return lib.ht_virtual_put(ffi.addressof(line), pointer, len(cells))

    def _take(self, line: firmware.CData) -> bytes:
        pointer = ffi.cast("uint16_t *", self._out.ctypes.data)
        n = lib.ht_virtual_take(ffi.addressof(line), pointer, len(self._out))
        return self._out[:n].astype(np.uint8).tobytes()


def watchdog_ms(factor: float) -> int:
    """The watchdog time of a board that runs `factor` times as fast as real time."""
    if not 0.01 <= factor <= 100:
        raise FirmwareError(f"factor = {factor:g}: allowed range is 0.01 .. 100")
    return round(lib.HT_SERVICE_WATCHDOG_MS * max(1.0, factor))


class VirtualBoard:
    """Firmware and plant. baud: the line's rate, in simulated time; factor: the speed relative to
    real time, by which the watchdog time is multiplied; store: the file in which the board saves
    its parameters; without it, it cannot save any."""

    def __init__(
        self,
        setup: Setup,
        baud: int | None = None,
        factor: float = 1.0,
        store: Path | None = None,
    ) -> None:
        self.file = FileStore(store) if store else None
        make = partial(BoardController, baud=baud, watchdog_ms=watchdog_ms(factor), store=self.file)
        self.factor = factor
        try:
            self.sim = SimulatedDrive(setup, controller=make)
        except BaseException:
            self.close()
            raise
        controller = self.sim.controller
        assert isinstance(controller, BoardController)
        self.controller: SerialBoard = controller

    @property
    def title(self) -> str:
        return f"virtual {self.sim.setup['timing.device']}, {self.sim.setup.name}"

    def close(self) -> None:
        """End it. May be called again."""
        if self.file:
            self.file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self, duration_s: float, record: bool = False) -> None:
        """Simulate `duration_s`. `record`: the simulation records samples for `take`."""
        self.sim.follow_timers()  # a client may have changed f_isr_Hz
        self.sim.run(duration_s, record=record)

    def take(self) -> Recording:
        """The simulation's own recording, with which a client's recording can be compared."""
        return self.sim.take()


class Terminal:
    """A pseudo-terminal in raw mode. `port` is the name of the end for clients."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)  # kept open: a client that leaves does not end the line
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        #: Number of bytes that were dropped because the client did not read them.
        self.lost = 0

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._master)
        os.close(self._slave)

    def wait(self, seconds: float, *others: socket.socket) -> None:
        """Wait until bytes come, also from `others`, but not longer than `seconds`."""
        sources: list[int | socket.socket] = [self._master, *others]
        select.select(sources, [], [], max(0.0, seconds))

    def read(self) -> bytes:
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def write(self, raw: bytes) -> None:
        """Send bytes to the client. As on a wire, bytes that do not fit its buffer are lost."""
        while raw:
            try:
                sent = os.write(self._master, raw)
            except OSError as error:
                if error.errno not in (errno.EAGAIN, errno.EIO):
                    raise
                self.lost += len(raw)
                return
            raw = raw[sent:]


def serve(
    board: VirtualBoard,
    line: Terminal,
    until: Callable[[], bool],
    record: OwnRecording | None = None,
    xcp: XcpPort | None = None,
) -> None:
    """Run the board and the line, `board.factor` times as fast as real time, until `until()`.
    `record`: where the simulation's own samples go; `xcp`: the network port for XCP."""
    speed = max(1.0, board.factor)
    begun = time.monotonic()
    done_s = busy_s = 0.0
    waiting = b""
    while not until():
        quiet = done_s - busy_s > QUIET_S * speed
        turn_s = (QUIET_TURN_S if quiet else TURN_S) * speed
        due_s = (time.monotonic() - begun) * board.factor
        if due_s - done_s > LATE_S * board.factor:  # this process did not run: do not catch up
            begun += (due_s - done_s) / board.factor - TURN_S
            continue
        if due_s - done_s < turn_s:
            sources = xcp.sources if xcp else []
            line.wait((turn_s - (due_s - done_s)) / board.factor, *sources)
            if not waiting:
                waiting = line.read()
            due_s = (time.monotonic() - begun) * board.factor
        elif not waiting:
            waiting = line.read()
        if waiting:
            waiting = waiting[board.controller.put(waiting) :]
            busy_s = done_s
        if xcp and xcp.pass_to(board.controller):
            busy_s = done_s
        step_s = min(due_s - done_s, 10 * TURN_S * speed)
        board.run(step_s, record is not None)
        done_s += step_s
        if record:
            record.keep()
        sent = board.controller.take()
        if sent:
            line.write(sent)
        if xcp:
            xcp.pass_from(board.controller)
