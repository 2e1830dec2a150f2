"""A little XCP master: packets by ASAM's tables, written down here once more, over the second line
of a virtual board or its serial one. It uses nothing of the host's code but the board itself."""

import struct
from collections.abc import Callable

from device import CHANNELS, PARAMETERS, Device

from hexatorque import firmware
from hexatorque.firmware import ffi, lib

RES, ERR, EV = 0xFF, 0xFE, 0xFD
SYNCH, ACTIVE, UNKNOWN, SYNTAX, RANGE, PROTECTED, DENIED = 0, 0x11, 0x20, 0x21, 0x22, 0x23, 0x24
PAGE, MODE, SEGMENT, SEQUENCE, CONFIG, MEMORY, GENERIC = 0x26, 0x27, 0x28, 0x29, 0x2A, 0x30, 0x31
CHANNELS_AT, PARAMETERS_AT = 0x1000, 0x2000
START, STOP, CLEAR = 8, 9, 10


class Refused(Exception):
    """An error of the slave: its code, and what follows it."""

    def __init__(self, code: int, detail: bytes) -> None:
        super().__init__(f"0x{code:02X}")
        self.code, self.detail = code, detail


def framed(packet: bytes, counter: int, serial: bool) -> bytes:
    raw = struct.pack("<HH", len(packet), counter & 0xFFFF) + packet
    if not serial:
        return raw
    raw += b"\0" * (len(raw) % 2)
    return raw + struct.pack("<H", sum(struct.unpack(f"<{len(raw) // 2}H", raw)) & 0xFFFF)


def frame_length(packet: int, serial: bool) -> int:
    return len(framed(bytes(packet), 0, serial))


class Master:
    """device: where the drive is; serial: over the line that the link has, else the second one."""

    def __init__(self, device: Device, serial: bool = False, connect: bool = True) -> None:
        self.device, self.serial = device, serial
        board = device.controller
        self.put: Callable[[bytes], int] = board.put if serial else board.put_net
        self.take: Callable[[], bytes] = board.take if serial else board.take_net
        self.xcp = ffi.addressof(board.board, "xcp_serial" if serial else "xcp_net")
        self.sent = self.came = 0
        self.raw = b""
        self.packets: list[bytes] = []  #: DTOs and events that came, in order
        if connect:
            self.connect()

    def receive(self) -> list[bytes]:
        self.raw += self.take()
        found = []
        while len(self.raw) >= 4:
            n, counter = struct.unpack_from("<HH", self.raw)
            length = frame_length(n, self.serial)
            if len(self.raw) < length:
                break
            packet = self.raw[4 : 4 + n]
            assert self.raw[:length] == framed(packet, counter, self.serial)
            assert counter == self.came & 0xFFFF, "a frame was lost"
            self.came += 1
            self.raw = self.raw[length:]
            found.append(packet)
        return found

    def answer(self, packet: bytes, patience: int = 100) -> bytes | None:
        raw = framed(packet, self.sent, self.serial)
        self.sent += 1
        assert self.put(raw) == len(raw)
        for _ in range(patience):
            self.device.tick()
            came = self.receive()
            answers = [p for p in came if p[0] in (RES, ERR)]
            self.packets += [p for p in came if p[0] not in (RES, ERR)]
            assert len(answers) <= 1
            if answers:
                return answers[0]
        return None

    def ask(self, layout: str, *values: object) -> bytes:
        """Send a command. Returns what its answer has behind the first octet."""
        got = self.answer(struct.pack("<" + layout, *values))
        assert got is not None, "no answer"
        if got[0] == ERR:
            raise Refused(got[1], got[2:])
        return got[1:]

    def code(self, layout: str, *values: object) -> int:
        """The error's code, or RES."""
        try:
            self.ask(layout, *values)
        except Refused as refused:
            return refused.code
        return RES

    # -- commands -------------------------------------------------------------------------

    def connect(self) -> bytes:
        return self.ask("BB", 0xFF, 0)

    def disconnect(self) -> None:
        self.ask("B", 0xFE)

    def read(self, address: int, n: int = 4) -> bytes:
        return self.ask("BBBBI", 0xF4, n, 0, 0, address)

    def value(self, address: int) -> float:
        return struct.unpack("<f", self.read(address))[0]

    def write(self, address: int, *values: float) -> None:
        self.ask("BHBI", 0xF6, 0, 0, address)
        self.ask(f"BB{len(values)}f", 0xF0, 4 * len(values), *values)

    def user(self, opcode: int) -> None:
        self.ask("BB", 0xF1, opcode)

    def _allocate(self, lists: tuple[tuple[int, int, list[list[int]]], ...]) -> None:
        self.ask("B", 0xD6)
        self.ask("BBH", 0xD5, 0, len(lists))
        for k, (_, _, odts) in enumerate(lists):
            self.ask("BBHB", 0xD4, 0, k, len(odts))
        for k, (_, _, odts) in enumerate(lists):
            for j, addresses in enumerate(odts):
                self.ask("BBHBB", 0xD3, 0, k, j, len(addresses))

    def lists(self, *lists: tuple[int, int, list[list[int]]], start: bool = True) -> list[int]:
        """Allocate lists (event, prescaler, addresses of each packet). Returns their first
        packets."""
        self._allocate(lists)
        firsts = []
        for k, (event, prescaler, odts) in enumerate(lists):
            for j, addresses in enumerate(odts):
                self.ask("BBHBB", 0xE2, 0, k, j, 0)
                for address in addresses:
                    self.ask("BBBBI", 0xE1, 0xFF, 4, 0, address)
            self.ask("BBHHBB", 0xE0, 0x10, k, event, prescaler, 0)
            firsts += self.ask("BBH", 0xDE, 2, k)
        if start:
            self.ask("BB", 0xDD, 1)
        return firsts


def channel(name: str) -> int:
    return CHANNELS_AT + 4 * CHANNELS[name]


def parameter(name: str) -> int:
    return PARAMETERS_AT + 4 * PARAMETERS[name]


def everything(device: Device) -> list[float]:
    return [lib.ht_drive_get(device.drive, k) for k in range(lib.ht_param_count())]


def single(value: float) -> float:
    return struct.unpack("f", struct.pack("f", value))[0]


#: Smallest and largest value of every parameter, as the firmware has them.
RANGES = [(single(r.min), single(r.max)) for r in firmware.parameters("f28377s").values()]


def in_range(device: Device) -> bool:
    return all(low <= x <= high for (low, high), x in zip(RANGES, everything(device)))
