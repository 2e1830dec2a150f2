"""The data beside docs/protocol.md: its examples, made by the firmware byte by byte, and the rules
about two parameters.

`python tests/firmware/link/protocol_examples.py` writes both files anew.
"""

from __future__ import annotations

import struct
import sys
import textwrap
from pathlib import Path

sys.path.append(str(Path(__file__).parents[3] / "tools"))
import doc_page
from device import (
    CHANNELS,
    HELLO,
    LIST,
    MARK,
    NONCE,
    OPEN,
    PARAMETERS,
    START,
    STATUS,
    STOP,
    STREAM,
    WRITE,
    Device,
    frame,
)

from hexatorque.firmware import decimal, ffi, lib, parameters

PAGE = Path(__file__).parents[3] / "docs" / "protocol.md"
FILE = PAGE.parent / "data" / "protocol-examples.txt"
#: An invented CRC, because every change of a text in the tables changes the real one.
DICTIONARY = 0xBEEF0BAD
#: Fast interrupts between a request and the reading of the reply.
STEP = 60

#: Fields as (code of struct, name). The code z is a text.
REQUEST = "B opcode, B id, H session, H dictionary"
REPLY = "B opcode, B id, B status, B state, H faults, I tick"
SAMPLE = "B type, B number, I tick"
PAYLOADS = {
    (HELLO, False): "",
    (HELLO, True): "H protocol, I dictionary CRC, f rate, I bytes/s for streams, "
    "H parameter rows, H channel rows, H fault rows, H state rows, H longest body, "
    "B streams, B channels of a stream, B channels of a capture, "
    "B session in force, I memory, H watchdog ms, z device, z build",
    (LIST, False): "B kind, H row",
    (LIST, True): "B kind, H row, z name",
    (OPEN, False): "H nonce, I mark",
    (OPEN, True): "I mark",
    (WRITE, False): "H parameter, f value",
    (WRITE, True): "I tick of the change, f value",
    (STREAM, False): "B stream, B channels, H decimation",
    (STREAM, True): "I bytes/s of all streams, I bytes/s allowed",
    (
        STATUS,
        True,
    ): "B flags, B capture, H ms left, I damaged, I overruns, I dropped, I mark, B set",
}
#: Shown in hexadecimal.
HEXADECIMAL = {"opcode", "type", "session", "dictionary", "dictionary CRC", "nonce", "mark"}


def fields(layout: str) -> list[tuple[str, str]]:
    return [tuple(field.split(" ", 1)) for field in layout.split(", ")] if layout else []


def taken_apart(body: bytes, layout: list[tuple[str, str]]) -> tuple[list[str], list[str]]:
    """The bytes of every field, with its meaning."""
    groups, says, at = [], [], 0
    for code, name in layout:
        if code == "z":
            end = body.index(0, at) + 1
            value = repr(body[at : end - 1].decode())
        else:
            end = at + struct.calcsize("<" + code)
            (number,) = struct.unpack("<" + code, body[at:end])
            value = f"0x{number:0{2 * (end - at)}X}" if name in HEXADECIMAL else f"{number:g}"
            if code in "HI" and name not in HEXADECIMAL:
                value = str(number)
        groups.append(body[at:end].hex().upper())
        says.append(f"{name} {value}")
        at = end
    assert at == len(body), (body.hex(), layout)
    return groups, says


def layout_of(body: bytes) -> list[tuple[str, str]]:
    if body[0] >= 0x80:
        detail = "H detail" if len(body) == 12 and body[2] else ""
        return fields(REPLY) + fields(detail or PAYLOADS.get((body[0] & 0x7F, True), ""))
    if body[0] >= 0x40:
        return fields(SAMPLE) + [("f", "value")] * ((len(body) - 6) // 4)
    channels = [("H", "channel")] * body[7] if body[0] == STREAM else []
    return fields(REQUEST) + fields(PAYLOADS.get((body[0], False), "")) + channels


def wrapped(label: str, words: list[str], joint: str = " ") -> list[str]:
    """Words in lines of up to 100 characters behind a label."""
    text = textwrap.fill(
        joint.join(word.replace(" ", "\0") for word in words),
        width=100,
        initial_indent=f"{label:7}",
        subsequent_indent=" " * 7,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return text.replace("\0", " ").splitlines()


def shown(body: bytes) -> list[str]:
    raw = frame(body)
    raw = raw if body[0] < 0x40 else raw[1:]  # the board sends no zero before a frame
    who = "host" if body[0] < 0x40 else "board"
    groups, says = taken_apart(body, layout_of(body))
    return [
        *wrapped(who, [f"{byte:02X}" for byte in raw]),
        *wrapped("  body", groups),
        *wrapped("", says, ", "),
    ]


def example_device() -> Device:
    device = Device(session=False)
    device.service.dictionary = DICTIONARY
    device.build = ffi.new("char[]", b"example")
    device.service.setup.build = device.build
    device.dictionary = DICTIONARY & 0xFFFF
    return device


def dialogue() -> list[tuple[str, list[bytes]]]:
    """The examples: for each part a heading, the bodies of the requests and the board's replies."""
    device = example_device()

    def ask(op: int, layout: str = "", *values: object, replies: int = 1, **head: int):
        body = device.request(op, struct.pack("<" + layout, *values), **head)
        device.put(frame(body))
        came: list[bytes] = []
        while len(came) < replies:
            device.tick(STEP)
            came += device.receive()
        return [body, *came]

    parts = [
        ("HELLO: who is there? No session, no dictionary yet", ask(HELLO, dictionary=0)),
        ("LIST: row 0 of the states", ask(LIST, "BH", 3, 0)),
        ("OPEN: begin a session, bring a mark", ask(OPEN, "HI", NONCE, MARK)),
    ]
    device.session = NONCE
    speed, poles = PARAMETERS["speed_ref_rpm"], PARAMETERS["pole_pairs"]
    parts += [
        ("WRITE: speed_ref_rpm = 250", ask(WRITE, "Hf", speed, 250.0)),
        ("A refusal: pole_pairs = 2.5 is no whole number", ask(WRITE, "Hf", poles, 2.5)),
    ]
    ids = CHANNELS["vdc_V"], CHANNELS["state"]
    parts += [
        (
            "STREAM: vdc_V and state, every 100th fast interrupt; its first two samples",
            ask(STREAM, "BBHHH", 0, 2, 100, *ids, replies=3),
        ),
        ("STREAM without channels ends it", ask(STREAM, "BBH", 0, 0, 1)),
        ("START: the watchdog is armed from here on", ask(START)),
        ("STATUS: keeps session and drive alive", ask(STATUS)),
        ("STOP: without a session, from anybody", ask(STOP, session=0, dictionary=0)),
    ]
    return parts


def text() -> str:
    parts = []
    for heading, bodies in dialogue():
        parts.append("\n".join([heading, *(line for b in bodies for line in shown(b)), ""]))
    return "\n".join(parts)


def misfits() -> list[list[str]]:
    """The rules about two parameters: number, and what is needed."""
    names, rows = list(parameters()), []
    for number in range(1, lib.HT_MISFITS):
        row = lib.ht_misfit_describe(number)
        first, second = names[row.first], names[row.second]
        if row.share:
            times = "" if row.share == 1 else f"{decimal(row.share):g} "
            needed = f"{first} {'≤' if row.touch else '<'} {times}{second}"
        else:
            said = ffi.string(lib.ht_misfit_demand(number)).decode()
            needed = f"{', '.join(dict.fromkeys((first, second)))}: {said}"
        rows.append([f"{number}", needed])
    return rows


def main() -> None:
    FILE.write_text(text())
    doc_page.keep_data(PAGE, "misfits", ["number", "needed"], misfits())


if __name__ == "__main__":
    main()
