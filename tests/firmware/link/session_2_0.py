"""A session between a client and a virtual board of protocol 2.0, as its bytes were on the line
(tests/vectors/session_2_0.json). It stays as it is: it says what compatible means."""

import json
import struct
from pathlib import Path
from typing import NamedTuple

from device import opened

FILE = Path(__file__).parents[2] / "vectors" / "session_2_0.json"
REPLY = 0x80
LIST, GET, WRITE, STREAM, ARM = 2, 6, 7, 11, 12
#: What no client of version 2.0 asks. It shows what a board of that version answers.
LATER = (LIST, 0x14, 0x15, 0x3F)


class Exchange(NamedTuple):
    request: bytes
    reply: bytes
    then: list[bytes]  #: samples and data up to the next request

    @property
    def op(self) -> int:
        return self.request[0]

    @property
    def payload(self) -> bytes:
        return self.request[6:]

    @property
    def of_later_version(self) -> bool:
        return self.op in LATER and (self.op != LIST or self.payload[0] > 3)


def exchanges() -> list[Exchange]:
    table = json.loads(FILE.read_text())["tables"]["frames"]
    assert table["columns"] == ["from", "bytes"]
    found: list[Exchange] = []
    asked = b""
    for who, raw in table["rows"]:
        body = opened(bytes.fromhex(raw))
        if who == "host":
            asked = body
        elif body[0] >= REPLY:
            assert body[:2] == bytes((asked[0] | REPLY, asked[1]))
            found.append(Exchange(asked, body, []))
        else:
            found[-1].then.append(body)
    return found


SESSION = exchanges()


def names(kind: int) -> list[str]:
    """Names of the parameters (0) or channels (1) in the recorded dictionary, by row."""
    rows = {}
    for one in SESSION:
        if one.op == LIST and one.payload[0] == kind and not one.of_later_version:
            (row,) = struct.unpack_from("<H", one.payload, 1)
            rows[row] = one.reply[10:][{0: 17, 1: 4}[kind] :].split(b"\0")[0].decode()
    return [rows[row] for row in range(len(rows))]


def parts(op: int, payload: bytes) -> list[tuple[str, bytes]]:
    """The payload of a request in parts; the kind of a part is `parameter`, `channel` (an id) or
    empty."""
    if op == GET:
        return [("parameter", payload[at : at + 2]) for at in range(0, len(payload), 2)]
    if op == WRITE:
        pairs = [payload[at : at + 6] for at in range(0, len(payload), 6)]
        return [part for pair in pairs for part in (("parameter", pair[:2]), ("", pair[2:]))]
    if op in (STREAM, ARM):
        head = 4 if op == STREAM else 18
        ids = [("channel", payload[at : at + 2]) for at in range(head, len(payload), 2)]
        if op == ARM:
            return [("", payload[:12]), ("channel", payload[12:14]), ("", payload[14:18]), *ids]
        return [("", payload[:head]), *ids]
    return [("", payload)]
