"""A target that is a real board on a serial port."""

from __future__ import annotations

import contextlib
import errno
import time
import weakref

import serial

from ..firmware import ffi, lib
from ..serial.port import error_number
from ..setups import SetupError
from .processor import Target, TargetError

#: Default baud rate: that of the boards' images.
BAUD = lib.ht_link_baud()
#: Longest time for a reply. At 9600 baud a reply takes half a second on the line.
TIMEOUT_S = 2.0
#: Ends a frame that the target may have received only in part.
FRAME_END = b"\0"
#: A line is quiet if nothing comes for this long. A USB adapter delays bytes less than that.
QUIET_S = 0.1
#: A line that is not quiet after this time is not a target's.
NEVER_QUIET_S = 2.0

_WHY: dict[int | None, str] = {
    errno.ENOENT: "no such port",
    errno.EACCES: "no permission (on Debian: adduser to the group dialout)",
    errno.EBUSY: "busy, another program has it",
    errno.EAGAIN: "busy, another program has it",
    errno.ENOTTY: "not a serial port",
}


def _known() -> str:
    from serial.tools import list_ports

    names = [port.device for port in list_ports.comports()]
    return f"; there is {', '.join(names)}" if names else "; there is none on this machine"


def _open(name: str, baud: int) -> serial.Serial:
    """Open a port for this program alone: a path, or an address that pyserial knows. SetupError
    if that fails."""
    if baud <= 0:
        raise SetupError(f"baud = {baud}: a positive rate")
    try:
        port = serial.serial_for_url(
            name, baudrate=baud, exclusive=True, timeout=QUIET_S, write_timeout=TIMEOUT_S
        )
    except (OSError, ValueError) as error:  # SerialException is an OSError
        number = error_number(error)
        why = _WHY.get(number, str(error).splitlines()[0])
        raise SetupError(f"{name}: {why}{_known() if number == errno.ENOENT else ''}") from None
    with contextlib.suppress(AttributeError, ValueError, OSError):
        port.set_low_latency_mode(True)  # FTDI: 1 ms instead of 16 ms a reply
    return port


class BoardTarget(Target):
    """A board whose image is already running. It is not reset for a run: first the bytes that an
    earlier run left on the line or in the board are dropped, then `init` makes a new drive."""

    def __init__(self, name: str, baud: int = BAUD, timeout_s: float = TIMEOUT_S) -> None:
        super().__init__()
        self.name, self.baud = name, baud
        self._port = _open(name, baud)
        self._end = weakref.finalize(self, self._port.close)
        try:
            line = self._port.fileno()
        except (AttributeError, OSError):
            self.close()
            raise SetupError(f"{name}: not a port with a file descriptor") from None
        self.link.local = ffi.NULL
        self.link.to_target = self.link.from_target = line
        self.link.timeout_ms = round(timeout_s * 1000)
        try:
            self._synchronise()
        except BaseException:
            self.close()
            raise

    def _synchronise(self) -> None:
        """Wait until the line is quiet and the target waits for a request."""
        try:
            self._port.write(FRAME_END)
            never = time.monotonic() + NEVER_QUIET_S
            while self._port.read(4096):
                if time.monotonic() > never:
                    raise TargetError(
                        f"{self.name}: the line does not get quiet (is this image one for "
                        f"processor in the loop?)"
                    )
        except serial.SerialTimeoutException:
            raise TargetError(f"{self.name}: the port takes no bytes") from None
        except serial.SerialException:
            raise TargetError(f"{self.name}: the port is gone (unplugged?)") from None

    def close(self) -> None:
        self._end()

    def why_down(self) -> str:
        link = self.link
        if link.error == lib.HT_LINK_SILENT and link.heard:
            return (
                f" ({link.heard} bytes came, but no reply in them: is the board's rate "
                f"{self.baud} baud?)"
            )
        if link.error == lib.HT_LINK_SILENT:
            return (
                f" ({link.timeout_ms / 1000:g} s; is the board on, with an image for processor "
                f"in the loop at {self.baud} baud?)"
            )
        if link.error == lib.HT_LINK_CLOSED:
            return " (the port is gone: unplugged?)"
        return ""
