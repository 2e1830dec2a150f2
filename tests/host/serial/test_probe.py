"""Looking for a board: how often each port is asked, and which ones are asked again."""

import os
import tty

import pytest

from hexatorque.serial import devices, server
from hexatorque.serial.exchange import NoReply

BAUDS = (1_250_000, 937_500, 115_200)


class MuteLine:
    """A port of the computer that nobody answers on: one end of a pseudo-terminal."""

    url = "/dev/ttyS7"

    def __init__(self):
        self.near, self.far = os.openpty()
        tty.setraw(self.far)
        self.asked = {BAUDS[0]: 0}

    def fileno(self):
        return self.near

    def change_baud(self, baud):
        self.asked[baud] = 0

    def write(self, data):
        self.asked[list(self.asked)[-1]] += 1
        return len(data)


@pytest.mark.parametrize(
    ("bauds", "quick", "each"), [(BAUDS, True, 1), (BAUDS, False, 4), (BAUDS[:1], True, 8)]
)
def test_a_silent_port_is_asked_so_often_at_each_rate(bauds, quick, each):
    line = MuteLine()
    with pytest.raises(NoReply, match=r"no reply to HELLO at 1250000( or \d+)* baud$"):
        server._probe(line, bauds, quick)
    assert line.asked == dict.fromkeys(bauds, each)
    os.close(line.near)
    os.close(line.far)


class TalkingLine(MuteLine):
    """It gives `said` for each request, or the request itself."""

    url = "/dev/pts/7"

    def __init__(self, said):
        super().__init__()
        self.said = said

    def write(self, data):
        return os.write(self.far, self.said or data)

    def read(self):
        return os.read(self.near, 4096)


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (b"", "baud: the request itself comes back (an echo, or crossed wires)"),
        (b"login: ", "baud: other bytes come (another baud rate, or another device)"),
        (bytes(5000), "baud: other bytes come (another baud rate, or another device)"),
    ],
)
def test_what_comes_instead_of_a_reply_is_told(said, told):
    line = TalkingLine(said)
    tty.setraw(line.near)
    with pytest.raises(NoReply) as caught:
        server._probe(line, BAUDS[:1], False)
    assert str(caught.value).endswith(told)
    os.close(line.near)
    os.close(line.far)


def test_an_adapter_is_asked_as_often_in_a_quick_probe(monkeypatch):
    line = MuteLine()
    monkeypatch.setattr(line, "url", "/dev/ttyUSB7", raising=False)
    with pytest.raises(NoReply):
        server._probe(line, BAUDS, True)
    assert line.asked == dict.fromkeys(BAUDS, 4)
    os.close(line.near)
    os.close(line.far)


@pytest.mark.parametrize("answers", [{"/dev/a"}, set()])
def test_silent_ports_are_asked_again_only_when_no_board_answers(monkeypatch, answers):
    asked = []

    def ask(port, bauds, where, quick):
        asked.append((port, quick))
        if port in answers:
            return devices.Found(port, bauds[0], "d", "b", "c", where, False)
        return NoReply(f"{port}: silent")

    ports = [type("Port", (), {"device": p, "description": ""}) for p in ("/dev/a", "/dev/b")]
    monkeypatch.setattr(devices, "_ask", ask)
    monkeypatch.setattr(devices.list_ports, "comports", lambda: ports)
    monkeypatch.setattr(devices.runtime, "announced", lambda: [])
    assert [board.port for board in devices.find()[0]] == sorted(answers)
    again = [] if answers else [("/dev/a", False), ("/dev/b", False)]
    assert sorted(asked, key=lambda row: (not row[1], row[0])) == [
        ("/dev/a", True), ("/dev/b", True), *again,
    ]  # fmt: skip
