"""The worked examples of docs/protocol.md are the frames of firmware and client, byte by byte."""

import re
import struct

import doc_page
import numpy as np
import protocol_examples
from peer import cobs_decode

from hexatorque.firmware import PARAMETER_SETS, lib
from hexatorque.results import RESULTS
from hexatorque.serial import wire


def blocks(text):
    """[[(host or board, frame, body, text), ...] of every example]"""
    found = []
    for block in text.split("\n\n"):
        parts = re.split(r"^(host  |board )", block, flags=re.MULTILINE)[1:]
        messages = []
        for who, rest in zip(parts[::2], parts[1::2]):
            raw, body = rest.split("  body")
            body, text = re.match(r"((?:\s+[0-9A-F]+)+)\n(.*)", body, re.DOTALL).groups()
            frame, body = bytes.fromhex(raw), bytes.fromhex("".join(body.split()))
            messages.append((who.strip(), frame, body, " ".join(text.split())))
        found.append(messages)
    return found


EXAMPLES = blocks(protocol_examples.FILE.read_text())
MESSAGES = [message for example in EXAMPLES for message in example]
KINDS = ("parameter", "channel", "fault", "state")


def test_the_pages_examples_are_the_boards_present_frames():
    kept = protocol_examples.FILE.read_text()
    assert kept == protocol_examples.text(), "run python tests/firmware/link/protocol_examples.py"


def test_the_firmware_answers_the_pages_requests_with_the_pages_replies():
    assert len(EXAMPLES) >= 10
    device = protocol_examples.example_device()
    for example in EXAMPLES:
        (asker, request, _, _), *answers = example
        assert asker == "host" and answers
        device.put(request)
        came = b""
        for _ in range(5):
            device.tick(protocol_examples.STEP)
            came += device.controller.take()
            if came.count(b"\0") >= len(answers):
                break
        assert came == b"".join(frame for _, frame, _, _ in answers), example


def test_every_frame_holds_its_body():
    for who, frame, body, _ in MESSAGES:
        assert frame[-1] == 0 and (frame[0] == 0) == (who == "host")
        assert wire.unframe(frame.strip(b"\0")) == body
        assert wire.frame(body).strip(b"\0") == frame.strip(b"\0")
        checked = cobs_decode(frame.strip(b"\0"))
        assert checked[:-4] == body


def plain(cell):
    """The words of a table's cell."""
    return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", cell).replace("`", "")


def numbered(heading):
    """{number: words} of the page's table below a heading."""
    text = protocol_examples.PAGE.read_text().split(f"### {heading}\n")[1].split("\n##")[0]
    rows = re.findall(r"^\| (\d+) \| ([^|]*) \|", text, re.MULTILINE)
    assert [int(number) for number, _ in rows] == sorted({int(number) for number, _ in rows})
    return {int(number): plain(words) for number, words in rows}


def test_the_page_has_the_tables_text_for_each_status():
    texts = {number: row.text.replace("{state}", "…") for number, row in RESULTS.items()}
    assert numbered("Status") == {0: "done", **texts}


def test_the_table_of_misfits_is_the_firmwares():
    rows = doc_page.read_data(protocol_examples.PAGE, "misfits")[1:]
    assert rows == protocol_examples.misfits(), (
        "run python tests/firmware/link/protocol_examples.py"
    )
    assert rows[0] == ["1", "torque_inner_Nm ≤ torque_band_Nm"]
    assert rows[4] == ["5", "i_trip_A ≤ 0.885 i_full_A"]
    assert len(rows) == lib.HT_MISFITS - 1


def test_the_page_has_the_tables_text_for_each_set():
    for number, text in enumerate(PARAMETER_SETS):
        assert f" {number} {text}" in protocol_examples.PAGE.read_text()


def says(text):
    """{name: value} of the line below a body."""
    return dict(part.rsplit(" ", 1) for part in re.sub(r"'.*?'", "text", text).split(", "))


def test_the_client_reads_and_writes_the_pages_frames():
    replies = {}
    for who, _, body, text in MESSAGES:
        said = says(text)
        if who == "host":
            request = wire.parse_request(body)
            assert request.op == int(said["opcode"], 16) and request.id == int(said["id"])
            assert request.session == int(said["session"], 16)
            assert body == wire.request(*request)
        elif body[0] >= wire.REPLY:
            reply = wire.parse_reply(body)
            assert (reply.op | 0x80) == int(said["opcode"], 16)
            numbers = (reply.id, reply.status, reply.state, reply.faults, reply.tick)
            names = ("id", "status", "state", "faults", "tick")
            assert numbers == tuple(int(said[name]) for name in names)
            replies[reply.op, reply.status, len(replies)] = (reply, said)
        else:
            sample = np.frombuffer(body, wire.sample_type(2))[0]
            assert (sample["number"], sample["tick"]) == (int(said["number"]), int(said["tick"]))
            assert sample["values"].tolist() == [250.0, 0.0]
    by_op = {op: found for (op, status, _), found in replies.items() if status == 0}
    hello = wire.parse_hello(by_op[wire.Op.HELLO][0].payload)
    said = by_op[wire.Op.HELLO][1]
    assert hello.protocol == wire.PROTOCOL == int(said["protocol"])
    assert hello.crc == int(said["dictionary CRC"], 16)
    assert hello.budget == int(said["bytes/s for streams"])
    assert hello.rows == tuple(int(said[f"{kind} rows"]) for kind in KINDS)
    assert (hello.device, hello.build) == ("virtual f28377s", "example")
    reply, said = by_op[wire.Op.OPEN]
    assert wire.parse_open(reply.payload) == int(said["mark"], 16)
    reply, said = by_op[wire.Op.STATUS]
    status = wire.parse_status(reply.payload)
    assert status.ours and status.guarded and status.mark == int(said["mark"], 16)
    assert status.watchdog_ms == int(said["ms left"])
    assert wire.parse_row(by_op[wire.Op.LIST][0].payload, 3, 0).name == "idle"
    (refused,) = (found for (_, status, _), found in replies.items() if status)
    assert refused[0].status == wire.Status.VALUE
    assert refused[0].payload == struct.pack("<H", int(refused[1]["detail"]))
