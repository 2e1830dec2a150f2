"""Finding boards: every serial port, and the virtual boards that run, is asked who it is."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from . import LinkError, runtime
from .client import Client, NoReply
from .drive import BAUDS


@dataclass(frozen=True)
class Found:
    port: str
    baud: int
    device: str
    build: str
    dictionary: str
    where: str  #: what the port is: the adapter's name, or which virtual board
    shared: bool  #: another process holds it, and lets this one take part


def find(baud: int | None = None) -> list[Found]:
    """The boards that answer, in order of their ports. A port that a program holds is not
    touched, unless it is one of ours and shares it."""
    virtual = {board.port: board for board in runtime.announced()}
    where = {port: board.title for port, board in virtual.items()}
    for port in list_ports.comports():
        where.setdefault(port.device, port.description or "serial port")
    taken = _held({os.path.realpath(port): port for port in where}, virtual)
    bauds = (baud,) if baud else BAUDS
    with ThreadPoolExecutor(max(1, len(where))) as pool:
        asked = [pool.submit(_ask, port, bauds, where[port], port in taken) for port in where]
        found = [future.result() for future in asked]
    return sorted((board for board in found if board), key=lambda board: board.port)


def only(baud: int | None = None) -> Found:
    """The only board there is."""
    found = find(baud)
    if not found:
        raise LinkError("no board found; give its port (--device)")
    if len(found) > 1:
        ports = ", ".join(board.port for board in found)
        raise LinkError(f"{len(found)} boards found, choose one: {ports}", mistake=True)
    return found[0]


def _ask(port: str, bauds: tuple[int, ...], where: str, taken: bool) -> Found | None:
    if taken and not runtime.relay_path(port).exists():
        return None
    for baud in bauds:
        try:
            client = Client(port, baud, patience_s=0.0)
        except LinkError:
            return None
        try:
            hello = client.hello()
            shared = client.transport.relayed
        except NoReply:
            continue
        except LinkError:
            return None
        finally:
            client.close()
        crc = f"{hello.crc:08x}"
        return Found(port, baud, hello.device, hello.build, crc, where, shared)
    return None


def _held(ports: dict[str, str], virtual: dict[str, runtime.Announced]) -> set[str]:
    """Which of these (real path -> name) another process has open, as far as this user can
    see. A virtual board has its own end open."""
    held = set()
    for handle in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            name = ports.get(os.readlink(handle))
        except OSError:
            continue
        if name is None:
            continue
        pid = int(handle.parts[2])
        if pid != os.getpid() and (name not in virtual or virtual[name].pid != pid):
            held.add(name)
    return held
