"""A fake board that makes mistakes on request, which a real board cannot. It follows
docs/protocol.md and uses none of the client's code."""

import binascii
import os
import struct
import threading
import time
import tty


def cobs_encode(data: bytes) -> bytes:
    """By definition: groups of up to 254 bytes without zero, each led by its length + 1;
    a group shorter than 254 stands for a zero behind it, except at the end."""
    out, group = bytearray(), bytearray()
    for place, byte in enumerate(data):
        if byte:
            group.append(byte)
        if not byte:
            out += bytes([len(group) + 1]) + group
            group.clear()
        elif len(group) == 254:
            out += b"\xff" + group
            group.clear()
            if place == len(data) - 1:
                return bytes(out)
    return bytes(out + bytes([len(group) + 1]) + group)


def cobs_decode(raw: bytes) -> bytes:
    out = bytearray()
    while raw:
        length = raw[0]
        out += raw[1:length]
        raw = raw[length:]
        if raw and length < 255:
            out.append(0)
    return bytes(out)


def frame(body: bytes) -> bytes:
    checked = body + struct.pack("<I", binascii.crc32(body))
    return b"\0" + cobs_encode(checked) + b"\0"


def parameter(row, live, low, high, initial, name, unit="", choices=""):
    texts = b"".join(t.encode() + b"\0" for t in (name, unit, choices, f"the {name}"))
    return struct.pack("<BHBBfff", 0, row, 0, live, low, high, initial) + texts


ROWS = [
    parameter(0, 1, 0, 2, 1, "scheme", choices="dtc1|fdr|ddr"),
    parameter(1, 1, -400, 400, 0, "speed_ref_rpm", "r/min"),
    parameter(2, 0, 0, 20, 2.3, "dead_time_us", "us"),
    b"\x01\x00\x00\x00" + b"speed_rpm\0r/min\0measured speed\0",
    b"\x01\x01\x00\x00" + b"torque_Nm\0N m\0estimated torque\0",
    b"\x02\x00\x00\x01\x00" + b"over-current\0a phase\0",
    *(bytes([3, row, 0]) + name + b"\0" for row, name in enumerate(
        (b"idle", b"calibrate", b"build", b"run", b"fault"))),
]  # fmt: skip
COUNTS = (3, 2, 1, 5)


class Peer:
    """`faults`: what it does to the next requests, one word each: `mute`, `damage`, `late`,
    `twice`, `cut`. All requests come into `requests`, executed ones into `executed`."""

    def __init__(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self.rows = list(ROWS)
        self.crc = binascii.crc32(b"".join(self.rows))
        self.protocol = 2
        self.values = {0: 1.0, 1: 0.0, 2: 2.3}
        self.additions: bytes | None = None  # LIST's row of kind 4; None: a board of version 2.0
        self.words = (0, 0)  # LIST's row of kind 6: all fault bits
        self.refuse: dict[int, tuple[int, bytes]] = {}  # opcode -> status, payload
        self.faults: list[str] = []
        self.requests: list[bytes] = []
        self.executed: list[int] = []
        self.state, self.tick, self.session, self.mark = 0, 1000, 0, 0
        self.capture = (0, b"")
        self._last = (b"", b"")
        self._left = b""
        self._closing = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing = True
        self._thread.join(2)
        os.close(self._slave)

    def write(self, raw: bytes) -> None:
        os.write(self._master, raw)

    def sample(self, stream: int, number: int, tick: int, *values: float) -> bytes:
        head = struct.pack("<BBI", 0x40 + stream, number & 0xFF, tick & 0xFFFFFFFF)
        return frame(head + struct.pack(f"<{len(values)}f", *values))

    def _run(self) -> None:
        import select

        while not self._closing:
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            try:
                raw = os.read(self._master, 4096)
            except OSError:
                break
            *parts, self._left = (self._left + raw).split(b"\0")
            for part in filter(None, parts):
                checked = cobs_decode(part)
                body = checked[:-4]
                assert checked[-4:] == struct.pack("<I", binascii.crc32(body)), "a damaged request"
                self._request(body)
        os.close(self._master)

    def _request(self, body: bytes) -> None:
        self.requests.append(body)
        fault = self.faults.pop(0) if self.faults else ""
        if fault == "mute":
            return
        if self._last[0] != body:
            self._last = (body, frame(self._execute(*struct.unpack_from("<BBHH", body), body[6:])))
        raw = self._last[1]
        if fault == "damage":
            raw = raw[:5] + bytes([raw[5] ^ 0x10 or 1]) + raw[6:]
        if fault == "cut":
            raw = raw[:7] + b"\0"
        if fault == "late":
            time.sleep(0.35)
        self.write(raw * (2 if fault == "twice" else 1))

    def _execute(self, op, id, session, dictionary, payload) -> bytes:
        status, answer = 0, b""
        if op in self.refuse:
            status, answer = self.refuse[op]
        elif op in (6, 7, 8, 10, 11, 12) and dictionary != self.crc & 0xFFFF:
            status = 19
        elif op in (4, 7, 8, 10, 11, 12, 14, 15, 16) and session != self.session:
            status = 18
        elif op == 2 and payload[0] == 4 and self.additions is None:
            status, answer = 1, b"\xff\xff"
        else:
            self.executed.append(op)
            answer = self._answer(op, session, payload)
        head = struct.pack("<BBBBHI", op + 0x80, id, status, self.state, 0, self.tick)
        return head + answer

    def _answer(self, op, session, payload) -> bytes:
        if op == 1:
            numbers = struct.pack(
                "<HIfI4HHBBBBIH", self.protocol, self.crc, 10000.0, 112500, *COUNTS, 508,
                4, 32, 16, bool(self.session), 20480, 250,
            )  # fmt: skip
            return numbers + b"peer\0test\0"
        if op == 2:
            kind, row = struct.unpack("<BH", payload)
            if kind == 4:
                return payload + self.additions
            if kind == 6:
                return payload + struct.pack("<II", *self.words)
            return self.rows[sum(COUNTS[:kind]) + row]
        if op == 3:
            self.session, mark = struct.unpack("<HI", payload)
            self.mark = self.mark or mark
            return struct.pack("<I", self.mark)
        if op == 4:
            self.session = 0
        if op == 5:
            flags = bool(self.session) | (session == self.session) << 1
            flags |= (self.words[0] > 0xFFFF) << 3
            return struct.pack("<BBHIIIIB", flags, self.capture[0], 0, 7, 8, 9, self.mark, 1)
        if op == 6:
            ids = struct.unpack(f"<{len(payload) // 2}H", payload)
            return struct.pack(f"<{len(ids)}f", *(self.values[i] for i in ids))
        if op == 7:
            pairs = list(struct.iter_unpack("<Hf", payload))
            self.values.update(pairs)
            return struct.pack(f"<I{len(pairs)}f", self.tick, *(self.values[i] for i, _ in pairs))
        if op == 11:
            return struct.pack("<II", 1000, 112500)
        if op == 13:
            return self.capture[1]
        return b""
