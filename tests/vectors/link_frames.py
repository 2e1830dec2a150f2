"""Golden frames of the serial link (docs/protocol.md), for generate.py. CRC and COBS are computed
by their definitions, without a library and without hexatorque."""

from __future__ import annotations

import struct

#: Of the requests.
SESSION, DICTIONARY, MARK = 0x1234, 0xBEEF, 0x89ABCDEF


def crc32(raw: bytes) -> int:
    """Bit by bit, the lowest first."""
    remainder = 0xFFFFFFFF
    for byte in raw:
        for bit in range(8):
            out = (remainder ^ (byte >> bit)) & 1
            remainder = (remainder >> 1) ^ (0xEDB88320 if out else 0)
    return remainder ^ 0xFFFFFFFF


def stuffed(raw: bytes) -> bytes:
    """COBS: blocks of up to 254 bytes without a zero, each behind its length + 1. After a block of
    less than 254 bytes the body has a zero, except after the last one."""
    out, rest = b"", raw
    while True:
        length = min((rest + b"\0").index(0), 254)
        out += bytes([length + 1]) + rest[:length]
        full, rest = length == 254, rest[length:]
        if not rest:
            return out
        rest = rest if full else rest[1:]


def closed(body: bytes) -> bytes:
    return body + struct.pack("<I", crc32(body))


def frame(body: bytes) -> bytes:
    return b"\0" + stuffed(closed(body)) + b"\0"


def bodies() -> list[tuple[str, bytes]]:
    def request(op: int, layout: str = "", *values: object) -> bytes:
        return struct.pack("<BBHH" + layout, op, op + 6, SESSION, DICTIONARY, *values)

    def reply(op: int, status: int, layout: str = "", *values: object) -> bytes:
        head = struct.pack("<BBBBHI", op + 0x80, op + 6, status, 3, 0x0041, 0x01020300)
        return head + struct.pack("<" + layout, *values)

    return [
        ("HELLO", struct.pack("<BBHH", 1, 7, 0, 0)),
        ("LIST row 2 of the faults", request(2, "BH", 2, 2)),
        ("LIST all bits of the faults", request(2, "BH", 6, 0)),
        ("LIST the log's counters", request(2, "BH", 7, 0)),
        ("LIST the latest event", request(2, "BH", 8, 0)),
        ("LIST the third limit", request(2, "BH", 9, 2)),
        ("OPEN", struct.pack("<BBHHHI", 3, 9, 0, DICTIONARY, SESSION, MARK)),
        ("CLOSE", request(4)),
        ("STATUS", request(5)),
        ("GET parameters 0, 256, 7", request(6, "3H", 0, 256, 7)),
        ("WRITE two values", request(7, "HfHf", 0, 3.0, 9, -1500.5)),
        ("START", request(8)),
        ("STOP without a session", struct.pack("<BBHH", 9, 15, 0, 0)),
        ("CLEAR", request(10)),
        ("STREAM 3 channels, every 4th", request(11, "BBH3H", 1, 3, 4, 2, 3, 8)),
        ("STREAM ends", request(11, "BBH", 1, 0, 1)),
        ("ARM falling through 0.25",
         request(12, "BBHIIHf2H", 2, 2, 10, 1000, 250, 9, 0.25, 9, 10)),
        ("CAPTURE", request(13)),
        ("READ values 600 to 659", request(14, "II", 600, 60)),
        ("TRIGGER", request(15)),
        ("CANCEL", request(16)),
        ("SNAPSHOT", request(17)),
        ("SAVE", request(18)),
        ("FORGET", request(19)),
        ("FORGET_LOG", request(20)),
        ("reply to HELLO", reply(1, 0, "HIfI4HHBBBBIH", 2, 0x0BADBEEF, 10000.0, 112500,
                                 62, 27, 13, 5, 508, 4, 32, 16, 1, 20480, 250)
         + b"board\0build\0"),
        ("reply to OPEN", reply(3, 0, "I", MARK)),
        ("reply to WRITE, refused", reply(7, 2, "H", 9)),
        ("reply to STREAM, over the budget", reply(11, 21, "H", 7)),
        ("reply to STATUS", reply(5, 0, "BBHIIIIB", 7, 2, 180, 3, 0, 1000000, MARK, 1)),
        ("reply to STATUS, faults beyond 16 bits",
         reply(5, 0, "BBHIIIIB", 8, 0, 0, 0, 0, 0, MARK, 0)),
        ("reply to LIST, all bits of the faults", reply(2, 0, "BHII", 6, 0, 0x10041, 0x10000)),
        ("reply to LIST, the log's counters",
         reply(2, 0, "BHBHHHIIIffff3H", 7, 0, 1, 12, 2, 1, 7200, 3601, 5, 312.5, 21.25, 1460.0,
               96.0, 3, 0, 1)),
        ("reply to LIST, an event",
         reply(2, 0, "BHBBBBIIIIHHf6fffff", 8, 0, 2, 3, 4, 1, 17, 7000, 3600, 0x10001, 0x0400,
               0x10, 311.0, 1.5, -1.5, 2.5, -2.5, 0.5, -0.5, -1450.0, 94.5, 101.5, 61.0)),
        ("reply to LIST, a limit",
         reply(2, 0, "BHHBII", 9, 2, 4, 1, 0x01020000, 0x01020300) + b"dc link low\0vdc_low_V\0"),
        ("sample of stream 1", struct.pack("<BBI3f", 0x41, 255, 0xFFFFFFFF, 1.5, -0.0, 311.0)),
        ("data of a capture", struct.pack("<BBI5f", 0x50, 3, 600, *(0.1 * k for k in range(5)))),
        ("shortest body", b"\x05\x00"),
        *((f"{n} bytes without a zero", bytes(1 + k % 255 for k in range(n)))
          for n in (249, 250, 251, 253, 254, 255, 504, 508)),
        *((f"{n} zeros", bytes(n)) for n in (2, 254, 508)),
        ("254 bytes and a zero", bytes([7]) * 254 + b"\0"),
        ("254 bytes, a zero, 253 bytes", bytes([7]) * 254 + b"\0" + bytes([9]) * 253),
    ]  # fmt: skip


def damaged() -> list[tuple[str, bytes]]:
    """Bytes between two zeros that are no frame."""
    good = stuffed(closed(struct.pack("<BBHH", 5, 1, SESSION, DICTIONARY)))
    inside = closed(b"\x05\x01\x34")
    return [
        ("a wrong bit", bytes([*good[:3], good[3] ^ 0x10, *good[4:]])),
        ("the last byte is missing", good[:-1]),
        ("a byte more", good + b"\x01"),
        ("body of one byte", stuffed(closed(b"\x05"))),
        ("no body", stuffed(closed(b""))),
        ("less than a CRC", b"\x03\x01\x02"),
        ("body of 509 bytes", stuffed(closed(bytes([7]) * 509))),
        ("CRC with its bytes in the other order",
         stuffed(inside[:-4] + inside[:-5:-1])),
        ("CRC not inverted", stuffed(b"\x05\x01\x34" + struct.pack("<I", crc32(b"\x05\x01\x34")
                                                                   ^ 0xFFFFFFFF))),
        ("last block longer than what is left", b"\x20" + good[1:]),
    ]  # fmt: skip


def tables() -> dict[str, tuple[list[str], list[list]]]:
    return {
        "frames": (["what", "body", "crc", "frame"],
                   [[what, body.hex(), f"{crc32(body):08x}", frame(body).hex()]
                    for what, body in bodies()]),
        "damaged": (["what", "bytes"], [[what, raw.hex()] for what, raw in damaged()]),
    }  # fmt: skip
