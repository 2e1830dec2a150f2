"""The port server: the one process that has a port open.

    python -m hexatorque.serial.server PORT BAUD[,BAUD...]

The first client starts it (transport.py). It ends one second after the last client has left. If it
does not run or dies, the board's watchdog stops the drive. Its work is in sharing.py.

It does not import numpy, so it starts quickly.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from .. import system
from . import LinkError, port, runtime, wire
from .exchange import Busy, NoReply, is_process
from .sharing import REPLY_S, Server, random_number, reply_s, tries
from .wire import Op

#: A server that was killed has its port no longer than this.
ENDING_S = 1.0
#: Tries at each baud rate if there are several.
PROBE_TRIES = 4
#: In a quick probe, the computer's own ports get one try per baud rate and this time. Mostly no
#: board is connected to them, and a search waits for all ports. They have no USB adapter.
QUICK_REPLY_S = 0.02
#: Of the bytes that came instead of a reply, this many are looked at.
MOST_HEARD_BYTES = 4096
#: Bytes of a reply to HELLO on the line, with names and build.
HELLO_BYTES = 150


def _probe(line: port.Line, bauds: tuple[int, ...], quick: bool) -> int:
    """The baud rate at which a board answers. NoReply if there is none."""
    if is_process(line.url) or "://" in line.url:
        bauds = bauds[:1]  # the rate has no effect
    adapter = os.path.basename(os.path.realpath(line.url)).startswith(("ttyUSB", "ttyACM"))
    quick = quick and len(bauds) > 1 and not adapter
    heard = ""
    each = 1 if quick else tries(line.url) if len(bauds) == 1 else PROBE_TRIES
    for at, baud in enumerate(bauds):
        if at:
            line.change_baud(baud)
        splitter = wire.Splitter()
        came = b""
        sent = wire.frame(wire.request(Op.HELLO, random_number(1), 0, 0))
        for _ in range(each):
            line.write(sent)
            # Without a session no stream runs, so no samples come before the reply.
            line_bytes = len(sent) + HELLO_BYTES
            wait_s = QUICK_REPLY_S if quick else REPLY_S
            end_s = time.monotonic() + reply_s(baud, line_bytes, wait_s)
            while select.select([line], [], [], max(0.0, end_s - time.monotonic()))[0]:
                data = line.read()
                came = (came + data)[-MOST_HEARD_BYTES:]
                if any(body[0] == wire.REPLY + Op.HELLO for body in splitter.push(data)):
                    return baud
        heard = heard or _heard(came, sent)
    rates = " or ".join(str(baud) for baud in bauds)
    raise NoReply(f"{line.url}: no reply to HELLO at {rates} baud{heard}")


def _heard(came: bytes, sent: bytes) -> str:
    """The bytes that came instead of a reply, for the end of a line."""
    if not came:
        return ""
    if sent.strip(b"\0") in came:
        return ": the request itself comes back (an echo, or crossed wires)"
    return ": other bytes come (another baud rate, or another device)"


def _opened(url: str, baud: int) -> port.Line:
    """The port, opened. This process has the lock, so another server that has the port is about to
    end: one that is killed loses its lock a little earlier than its port."""
    end_s = time.monotonic() + ENDING_S
    while True:
        try:
            return port.Line(url, baud)
        except Busy:
            holder = system.holder_of(url)
            ending = holder is None or system.runs_module(holder.pid, f"{__package__}.server")
            if not ending or time.monotonic() > end_s:
                raise
            time.sleep(0.02)


def _lock(path: Path, url: str) -> int | None:
    """The lock of this port's server, or None if another one has it."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        if not system.lock(file):
            os.close(file)
            return None
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file), os.stat(path)):
                break
        os.close(file)  # the lock of a server that was just ending
    row = runtime.Locked(
        os.getpid(),
        system.command_of(os.getpid()),
        datetime.now().astimezone().isoformat(timespec="seconds"),
        url,
    )
    os.ftruncate(file, 0)
    os.write(file, json.dumps(row._asdict()).encode())
    return file


def _report(**words: object) -> None:
    """Report to the process that started this one and waits for it."""
    with suppress(OSError):
        os.write(1, json.dumps(words).encode() + b"\n")
    _to_nowhere(1)


def _to_nowhere(file: int) -> None:
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, file)
    os.close(nothing)


def main(url: str, bauds: tuple[int, ...], quick: bool) -> int:
    system.detach()
    os.chdir("/")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    # Resolve the name now: a link may later point to another device.
    lock, path, log = (runtime.port_path(url, suffix) for suffix in ("lock", "sock", "log"))
    held = _lock(lock, url)
    if held is None:
        _report(held=True)
        return 0
    line = None
    try:
        line = _opened(url, bauds[0])
        baud = _probe(line, bauds, quick)
        listener, secret = system.listen(path)
        listener.listen(64)
        listener.setblocking(False)
        _report(ready=True)
        Server(line, baud, listener, secret).run()
    except LinkError as error:
        kind = {"busy": isinstance(error, Busy), "silent": isinstance(error, NoReply)}
        _report(error=str(error), mistake=error.mistake, **kind)
    except OSError as error:
        text = f"{url}: {error.strerror or error}"
        _report(error=text, mistake=False, busy=False, silent=False)
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # it is ending
        path.unlink(missing_ok=True)
        if line:
            line.close()
        system.remove_locked(lock, held)
    _to_nowhere(2)
    with suppress(PermissionError):  # on Windows, of a client that is just starting another server
        log.unlink(missing_ok=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], tuple(map(int, sys.argv[2].split(","))), "quick" in sys.argv[3:]))
