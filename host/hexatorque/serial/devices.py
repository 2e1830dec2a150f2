"""Finding boards: every serial port and every running virtual board is asked for its identity."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

from serial.tools import list_ports

from . import BAUDS, LinkError, runtime
from .client import Client
from .exchange import Busy, NoReply
from .transport import Transport


@dataclass(frozen=True)
class Found:
    port: str
    baud: int
    device: str
    build: str
    dictionary: str
    where: str  #: the adapter's name, or the virtual board's
    shared: bool  #: other clients use it as well


#: `hexatorque board serve` needs no hardware.
NONE = "no board found; start a virtual one in a second terminal: hexatorque board serve"


def find(baud: int | None = None) -> tuple[list[Found], list[Busy]]:
    """The boards that answer, in the order of their ports; and the ports that other programs have
    open. Those are left alone, unless the program is the port's server."""
    answers = _ask_all(baud)
    found = [answer for answer in answers if isinstance(answer, Found)]
    return found, [answer for answer in answers if isinstance(answer, Busy)]


def only(baud: int | None = None) -> Found:
    """The only board that answers. LinkError if there are none or several."""
    answers = _ask_all(baud)
    found = [answer for answer in answers if isinstance(answer, Found)]
    if not found:
        why = "".join(f"; {answer}" for answer in answers if isinstance(answer, Busy))
        raise LinkError(f"{NONE}, or give its port (--device){why}")
    if len(found) > 1:
        ports = ", ".join(board.port for board in found)
        raise LinkError(f"{len(found)} boards found, choose one: {ports}", mistake=True)
    return found[0]


def _ask_all(baud: int | None) -> list[Found | LinkError]:
    """Ask every port once. If no board answers, ask the silent ports again, with more attempts and
    more time."""
    where = {board.port: board.title for board in runtime.announced()}
    for port in list_ports.comports():
        where.setdefault(port.device, port.description or "serial port")
    bauds = (baud,) if baud else BAUDS
    ports = sorted(where)
    with ThreadPoolExecutor(max(1, len(ports))) as pool:
        answers = list(pool.map(lambda port: _ask(port, bauds, where[port], True), ports))
        if not any(isinstance(answer, Found) for answer in answers):
            silent = [n for n, answer in enumerate(answers) if isinstance(answer, NoReply)]
            again = pool.map(lambda n: _ask(ports[n], bauds, where[ports[n]], False), silent)
            for n, answer in zip(silent, list(again)):
                answers[n] = answer
    return answers


def _ask(port: str, bauds: tuple[int, ...], where: str, quick: bool) -> Found | LinkError:
    bauds = bauds if len(bauds) == 1 else runtime.bauds_for(port, bauds)
    try:
        client = Client(port, bauds, partial(Transport, quick=quick))
    except LinkError as error:
        return error
    try:
        hello = client.hello()
    except LinkError as error:
        return error
    finally:
        client.close()
    crc = f"{hello.crc:08x}"
    transport = client.transport
    return Found(port, transport.baud, hello.device, hello.build, crc, where, transport.shared)
