"""A port that cannot be opened, by its system's own words: in use, not there, not allowed."""

import errno
import importlib.util
import re
import socket
from pathlib import Path

import pytest
import serial

from hexatorque import system
from hexatorque.cli.main import main
from hexatorque.serial import LinkError, port
from hexatorque.serial.exchange import Busy

SERIALWIN32 = (
    Path(importlib.util.find_spec("serial").origin).parent / "serialwin32.py"
).read_text()
#: What pyserial says on Windows. {!r} is an exception of Windows.
CANNOT_OPEN = "could not open port {!r}: {!r}"
CANNOT_SET = "Cannot configure port, something went wrong. Original message: {!r}"
ABSENT = "no such device"
BUSY = "in use by another program, or this user may not open it"
#: The exception as Python prints it there, in two languages, and what the command says.
OF_WINDOWS = {
    "in use": ("PermissionError(13, 'Access is denied.', None, 5)", BUSY),
    "in use, German": ("PermissionError(13, 'Zugriff verweigert', None, 5)", BUSY),
    "shared": ("PermissionError(13, 'The process cannot access the file', None, 32)", BUSY),
    "absent": ("FileNotFoundError(2, 'Das System kann nicht finden', None, 2)", ABSENT),
    "no path": ("FileNotFoundError(2, 'The system cannot find the path', None, 3)", ABSENT),
    "unplugged": ("OSError(22, 'A device attached to the system is not functioning.', None, 31)",
                  ABSENT),
}  # fmt: skip


class _Printed:
    """An exception of Windows, which only Windows can make."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def raising(monkeypatch, error):
    def opened(self):
        raise error

    monkeypatch.setattr(serial.Serial, "open", opened)
    monkeypatch.setattr(system, "holder_of", lambda _: None)
    monkeypatch.setattr(system, "is_other_device", lambda _: False)


def test_pyserial_says_so_in_the_words_that_are_tested():
    words = re.sub(r"['\"]\s*\n\s*['\"]", "", SERIALWIN32)
    assert f'SerialException("{CANNOT_OPEN}".format(self.portstr, ctypes.WinError()))' in words
    assert CANNOT_SET in words


@pytest.mark.parametrize("case", OF_WINDOWS)
def test_windows_errors_are_told_in_one_line(case, monkeypatch):
    printed, says = OF_WINDOWS[case]
    error = serial.SerialException(CANNOT_OPEN.format("COM3", _Printed(printed)))
    assert error.errno is None
    raising(monkeypatch, error)
    monkeypatch.setattr(system, "UNKNOWN_HOLDER", BUSY.removeprefix("in use by "))
    with pytest.raises(LinkError) as refused:
        port.Line("COM3", 1_000_000)
    assert str(refused.value) == f"COM3: {says}"
    assert isinstance(refused.value, Busy) == (says == BUSY)


def test_a_baud_rate_that_windows_refuses_is_told(monkeypatch):
    printed = _Printed("OSError(22, 'The parameter is incorrect.', None, 87)")
    raising(monkeypatch, serial.SerialException(CANNOT_SET.format(printed)))
    with pytest.raises(LinkError, match=r"^COM3: the port refuses 3000000 baud$"):
        port.Line("COM3", 3_000_000)


def test_another_error_of_windows_keeps_its_text(monkeypatch):
    printed = _Printed("OSError(22, 'The semaphore timeout period has expired.', None, 121)")
    raising(monkeypatch, serial.SerialException(CANNOT_OPEN.format("COM3", printed)))
    with pytest.raises(LinkError, match=r"^COM3: could not open port .* expired") as refused:
        port.Line("COM3", 115200)
    assert "\n" not in str(refused.value) and not isinstance(refused.value, Busy)


@pytest.mark.parametrize(
    ("number", "says"),
    [(errno.EACCES, "permission denied"), (errno.ENOENT, ABSENT), (errno.EBUSY, "in use by")],
)
def test_linux_errors_are_told_in_one_line(number, says, monkeypatch):
    raising(monkeypatch, serial.SerialException(number, f"could not open port: {number}"))
    with pytest.raises(LinkError, match=f"^/dev/ttyUSB7: {says}"):
        port.Line("/dev/ttyUSB7", 115200)


@pytest.fixture
def no_board_stays(monkeypatch):
    """A board that is served after all ends at once."""
    monkeypatch.setattr("hexatorque.boards.virtual.serve", lambda *_, **__: None)


@pytest.mark.parametrize("option", ["--tcp", "--xcp"])
def test_a_tcp_port_in_use_is_told_in_one_line(option, no_board_stays, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        number = taken.getsockname()[1]
        assert main(["board", "serve", option, str(number)]) != 0
    err = capsys.readouterr().err
    named = f"--tcp {number}" if option == "--tcp" else f"XCP port {number}"
    assert err.strip().splitlines()[-1] == f"hexatorque: {named}: in use by another program"


def test_a_udp_port_in_use_is_told_in_one_line(no_board_stays, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        number = taken.getsockname()[1]
        assert main(["board", "serve", "--xcp", str(number)]) != 0
    assert capsys.readouterr().err.strip().endswith("in use by another program")


@pytest.mark.parametrize(
    ("number", "says"),
    [
        # Python has Windows' own numbers 10048 and 10013 under these names there.
        (errno.EADDRINUSE, "in use by another program"),
        (errno.EACCES, "not allowed: taken by the system or by a service"),
        (errno.EADDRNOTAVAIL, "some words"),
    ],
)
def test_why_a_program_cannot_listen(number, says):
    assert port.not_listening(OSError(number, "some words")) == says
