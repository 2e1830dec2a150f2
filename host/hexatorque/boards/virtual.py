"""A virtual board: firmware and plant in one process, with a pseudo-terminal or a TCP port as
serial port.

board = VirtualBoard(hexatorque.load("paper-b"))
with new_line() as line:
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
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from .. import __version__, firmware, system
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
#: How long a power stage that has found a fault holds the trip pin low, if nothing else is told.
TRIP_PIN_S = 0.001
#: Memory for captures, in values, as in the image for the F28377S.
CAPTURE_VALUES = 20480


class SerialBoard(XcpLine, Protocol):
    """The part of a board's controller beside the drive: its end of the line, and of XCP's."""

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
        setup.log = self.store.log
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

    _ran_s = 0.0
    #: Coming levels of the trip pin: when, and which.
    _pin: tuple[tuple[float, int], ...] = ()

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

    def pull_trip_pin(self, after_s: float, for_s: float = TRIP_PIN_S) -> None:
        """Pull the trip pin low in `after_s` simulated seconds, as a power stage does that reports
        a fault, and release it `for_s` later."""
        low_s = self._ran_s + after_s
        self._pin = tuple(sorted([*self._pin, (low_s, 0), (low_s + for_s, 1)]))

    def run(self, duration_s: float, record: bool = False) -> None:
        """Simulate `duration_s`. `record`: the simulation records samples for `take`."""
        self.sim.follow_timers()  # a client may have changed f_isr_Hz
        end_s = self._ran_s + duration_s
        while self._pin and self._pin[0][0] <= end_s:
            (at_s, level), self._pin = self._pin[0], self._pin[1:]
            self._run(at_s - self._ran_s, record)
            self.sim.controller.set_trip_pin(level)
        self._run(end_s - self._ran_s, record)

    def _run(self, duration_s: float, record: bool) -> None:
        if duration_s > 0:
            self.sim.run(duration_s, record=record)
            self._ran_s += duration_s

    def take(self) -> Recording:
        """The simulation's own recording, with which a client's recording can be compared."""
        return self.sim.take()


class Line(Protocol):
    """A virtual board's end of the line. `port` is the name of the clients' end, `lost` the number
    of bytes that were dropped because the client did not read them."""

    port: str
    lost: int

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def wait(self, seconds: float, *others: socket.socket) -> None:
        """Wait until bytes come, also from `others`, but not longer than `seconds`."""

    def read(self) -> bytes: ...

    def write(self, raw: bytes) -> None:
        """Send bytes to the client. As on a wire, bytes that do not fit its buffer are lost."""


class Terminal:
    """A pseudo-terminal in raw mode."""

    def __init__(self) -> None:
        # The clients' end is kept open: a client that leaves does not end the line.
        self._master, self._slave, self.port = system.pseudo_terminal()
        self.lost = 0

    def __enter__(self) -> Self:
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
        while raw:
            try:
                sent = os.write(self._master, raw)
            except OSError as error:
                if error.errno not in (errno.EAGAIN, errno.EIO):
                    raise
                self.lost += len(raw)
                return
            raw = raw[sent:]


class Tcp:
    """A TCP port of this computer. One client at a time has it. Without one, bytes are lost as on
    a wire that ends nowhere."""

    def __init__(self, number: int = 0) -> None:
        """number: 0 for a free one. OSError if it is taken."""
        self._listener = socket.create_server(("127.0.0.1", number))
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.lost = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._drop()
        self._listener.close()

    def _drop(self) -> None:
        if self._client:
            self._client.close()
        self._client = None

    def wait(self, seconds: float, *others: socket.socket) -> None:
        select.select([self._client or self._listener, *others], [], [], max(0.0, seconds))

    def read(self) -> bytes:
        try:
            if self._client is None:
                self._client, _ = self._listener.accept()
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            raw = self._client.recv(4096)
        except BlockingIOError:
            return b""
        except OSError:
            raw = b""
        if not raw:  # it has left
            self._drop()
        return raw

    def write(self, raw: bytes) -> None:
        while raw and self._client:
            try:
                raw = raw[self._client.send(raw) :]
            except BlockingIOError:
                break
            except OSError:
                self._drop()
        self.lost += len(raw)


def new_line(tcp: int | None = None) -> Line:
    """A line of its own kind for each system: a pseudo-terminal where there are any, else a TCP
    port. tcp: a TCP port of this number everywhere, 0 for a free one."""
    if tcp is None and system.PSEUDO_TERMINALS_EXIST:
        return Terminal()
    return Tcp(tcp or 0)


def serve(
    board: VirtualBoard,
    line: Line,
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
        if record:
            record.keep()
        board.run(step_s, record is not None)
        done_s += step_s
        sent = board.controller.take()
        if sent:
            line.write(sent)
        if xcp:
            xcp.pass_from(board.controller)
