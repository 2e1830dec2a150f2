"""The port server: one process per port, which alone has it open.

    python -m hexatorque.serial.server PORT BAUD[,BAUD...]

The first client starts it (transport.py); it ends by itself a second after the last one left.
Clients speak the board's own protocol to it over a socket, without COBS and CRC: a u16 length
before each body (exchange.py). Requests go to the board one at a time under the server's own
session, so ids, sessions and the numbers of streams are changed on the way. A board that
answers nothing, a port that is gone and the line's counters have bodies of their own (`Notice`).

The drive stops when the client that started it leaves or is silent for 250 ms. Should this
process stand still or die, the board's watchdog stops the drive.

One thread, no numpy: it starts quickly and nothing in here waits.
"""

from __future__ import annotations

import fcntl
import json
import os
import select
import signal
import socket
import struct
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from .. import __version__
from . import LinkError, port, runtime, wire
from .exchange import PULSE_S, Busy, NoReply, Notice, Unpacker, is_process, packed
from .wire import Op, Reply, Request, Status

#: A client that started the drive beats every 80 ms.
SILENT_S = 0.25
#: A session that clients have is kept by a request in this time. Later than a client's own
#: heartbeat, or both ask when only one needs to.
HEARTBEAT_S = 0.1
#: The server ends when nobody has been there for so long.
LINGER_S = 1.0
#: Without a request under way the port is read this often: few wake-ups at full speed.
READ_S = 0.01
#: What waits for a client that does not read, bytes. Samples beyond are left out, which their
#: ticks tell; at the full 1.25 Mbaud this is more than a minute.
WAITING_BYTES = 8 << 20
#: A client that asks without reading the replies is not served beyond this.
WAITING_REQUESTS = 8
#: Time for a reply besides its time on the line; USB adapters keep bytes for 16 ms.
REPLY_S = 0.05
#: The same for a virtual board, which is a process that others may hold up; its watchdog is
#: held up with it.
PROCESS_REPLY_S = 0.25
#: On a line that spoils a fifth of its frames three tries lose one GET in eight, eight tries one
#: in a hundred (`hexatorque evidence studies line`). What a process serves loses nothing, but may
#: be late.
TRIES = 8
PROCESS_TRIES = 3
#: For each baud rate when several are tried.
PROBE_TRIES = 4
#: A computer's own ports are mostly silent, and who looks for a board waits for all of them. In a
#: quick probe they get one try a rate. They have no USB adapter that keeps bytes for 16 ms.
QUICK_REPLY_S = 0.02
#: A reply to HELLO on the line, names and build included.
HELLO_BYTES = 150


def tries(url: str) -> int:
    return PROCESS_TRIES if is_process(url) else TRIES


def reply_s(url: str, baud: int, line_bytes: int) -> float:
    """How long to wait for a reply, until which at most so many bytes are on the line."""
    wait_s = PROCESS_REPLY_S if is_process(url) else REPLY_S
    return line_bytes * 10 / baud + wait_s


class Peer:
    """A client's end of the socket."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.unpacker = Unpacker()
        self.out = bytearray()
        self.heard_s = time.monotonic()
        self.generation = 0  #: of the session that it takes part in; 0: none
        self.pending = 0  #: requests without a reply
        self.pulse_s = 0.0  #: when a pulse is due, while there are some
        self.told: tuple[int, int] | None = None  #: counters
        self.gone = False

    def fileno(self) -> int:
        return self.socket.fileno()

    def flush(self) -> None:
        if self.out:
            try:
                del self.out[: self.socket.send(memoryview(self.out)[: 1 << 18])]
            except BlockingIOError:
                pass
            except OSError:
                self.out.clear()  # its end is seen when it is read


class Job:
    """A request to the board, of a client or of the server itself."""

    def __init__(
        self,
        op: int,
        payload: bytes = b"",
        peer: Peer | None = None,
        request: Request | None = None,
        done: Callable[[Reply], None] | None = None,
        failed: Callable[[], None] | None = None,
    ) -> None:
        self.op, self.payload, self.peer, self.request = op, payload, peer, request
        self.done, self.failed = done, failed
        self.sent = b""  #: on the line
        self.id = 0
        self.session = False  #: was sent under the session
        self.always_session = False
        self.left = 0  #: tries
        self.wait_s = self.deadline_s = 0.0
        self.marked = False  #: a mark was placed for it


class Slot:
    """A stream of the board that a client has."""

    def __init__(self, peer: Peer, number: int) -> None:
        self.peer, self.number = peer, number
        self.live = False


class Server:
    def __init__(self, line: port.Line, baud: int, listener: socket.socket) -> None:
        self.line, self.baud, self.listener = line, baud, listener
        self.tries = tries(line.url)
        self.peers: list[Peer] = []
        self.queue: deque[Job] = deque()
        self.job: Job | None = None
        self.splitter = wire.Splitter()
        self.confused = 0  #: frames without sense
        self.retries = 0
        self.session = False
        self.nonce = _random(2)
        self.generation = 1
        self.slots: list[Slot | None] = [None] * wire.STREAMS
        self.starter: Peer | None = None
        self.reader: Peer | None = None  #: who gets a capture's data
        self._out = b""
        self._id = _random(1)
        self._asked_s = 0.0
        self._read_s = min(READ_S, 15_000 / baud)
        self._read_due_s = 0.0
        self._alone_s = time.monotonic()

    # -- the loop --------------------------------------------------------------------------

    def run(self) -> None:
        """Until the last client has left, or the port is gone."""
        try:
            while self._turn():
                pass
        except OSError:
            for peer in self.peers:
                self._send(peer, bytes((Notice.LOST,)))
        finally:
            self._farewell()

    def _turn(self) -> bool:
        # What is overdue at this moment, and has not come by the end of the select, is late:
        # this process may have stood still in between.
        now_s = time.monotonic()
        if self.job is None and self.queue:
            self._begin(self.queue.popleft(), now_s)
        reads: list = [self.listener]
        reads += [peer for peer in self.peers if peer.pending < WAITING_REQUESTS]
        if self.job or now_s >= self._read_due_s:
            reads.append(self.line)
        writes: list = [peer for peer in self.peers if peer.out]
        if self._out:
            writes.append(self.line)
        wait_s = max(0.0, min(self._due_s()) - now_s)
        readable, _, _ = select.select(reads, writes, [], wait_s)
        if self.line in readable:
            self._read_line()
        if self._out:
            self._out = self._out[self.line.write(self._out) :]
        for peer in readable:
            if isinstance(peer, Peer):
                self._read_peer(peer)
        if self.listener in readable:
            self._accept()
        self._overdue(now_s)
        for peer in self.peers:
            peer.flush()
        return bool(self.peers or now_s < self._alone_s + LINGER_S)

    def _due_s(self) -> list[float]:
        due = [time.monotonic() + 1.0]
        if self.job:
            due.append(self.job.deadline_s)
        else:
            due.append(self._read_due_s if self._read_due_s > time.monotonic() else due[0])
        if self._kept():
            due.append(self._asked_s + HEARTBEAT_S)
        if self.starter and not self.starter.pending:
            due.append(self.starter.heard_s + SILENT_S)
        due += [peer.pulse_s for peer in self.peers if peer.pending]
        if not self.peers:
            due.append(self._alone_s + LINGER_S)
        return due

    def _overdue(self, now_s: float) -> None:
        job, starter = self.job, self.starter
        if job and now_s > job.deadline_s:
            self._unanswered(job)
        if starter and not starter.pending and now_s > starter.heard_s + SILENT_S:
            self.starter = None
            self._put(Job(Op.STOP))
        quiet = not self.job and not self.queue and now_s > self._asked_s + HEARTBEAT_S
        if quiet and self._kept():
            self._put(Job(Op.STATUS))
        for peer in self.peers:
            if peer.pending and now_s > peer.pulse_s:
                peer.pulse_s = now_s + PULSE_S
                self._send(peer, bytes((Notice.PULSE,)))

    def _kept(self) -> bool:
        """Whether somebody needs the session."""
        return self.session and any(peer.generation == self.generation for peer in self.peers)

    def _farewell(self) -> None:
        """The session's end stops a drive that was started in it."""
        with suppress(OSError):
            if self.session:
                self._id = (self._id + 1) & 0xFF
                self.line.write(wire.frame(wire.request(Op.CLOSE, self._id, self.nonce, 0)))
        for peer in self.peers:
            peer.flush()
            peer.socket.close()

    # -- the line --------------------------------------------------------------------------

    def _begin(self, job: Job, now_s: float) -> None:
        peer = job.peer
        if not job.sent:
            job.id = self._id = (self._id + 1) & 0xFF
            mine = peer is None or peer.generation == self.generation
            job.session = job.always_session or (self.session and mine)
            session = self.nonce if job.session else 0
            dictionary = job.request.dictionary if job.request else 0
            job.sent = wire.frame(wire.request(job.op, job.id, session, dictionary, job.payload))
            job.left = self.tries
            size = len(job.sent) + wire.reply_bytes(job.op, len(job.payload))
            job.wait_s = reply_s(self.line.url, self.baud, size)
            if job.op in wire.SLOW:
                job.wait_s += wire.SLOW_S
        else:
            self.retries += 1
        self.job = job
        job.left -= 1
        if not self._out:
            self._out = job.sent
            self._out = self._out[self.line.write(self._out) :]
        if job.session:
            self._asked_s = now_s
        job.deadline_s = now_s + job.wait_s

    def _unanswered(self, job: Job) -> None:
        """Again, but not before a STOP; a START not after one."""
        self.job = None
        if job.left and job.op == Op.STATUS and job.peer is None and self.queue:
            return  # the heartbeat: what waits is one as well
        if job.op == Op.START and job.peer and job.peer.gone:
            self._put(Job(Op.STOP))  # it may have been carried out
            return
        if job.left:
            at = 0
            while job.op != Op.STOP and at < len(self.queue) and self.queue[at].op == Op.STOP:
                at += 1
            self.queue.insert(at, job)
            return
        if job.op == Op.STOP and job.peer is None:
            self._put(Job(Op.STOP))
            return
        if job.op == Op.START:
            self.starter = job.peer  # as above
        self._fail(job, f"no reply to {_name(job.op)} within {self.tries * job.wait_s:.2g} s")

    def _fail(self, job: Job, why: str) -> None:
        if job.failed:
            job.failed()
        if job.peer and job.request:
            head = bytes((Notice.FAILED, job.request.op, job.request.id))
            self._answered(job.peer, head + why.encode())

    def _read_line(self) -> None:
        data = self.line.read()
        self._read_due_s = time.monotonic() + self._read_s
        for body in self.splitter.push(data):
            kind = body[0]
            if wire.SAMPLE <= kind < wire.SAMPLE + wire.STREAMS:
                slot = self.slots[kind - wire.SAMPLE]
                if slot and slot.live:
                    self._send(slot.peer, bytes((wire.SAMPLE + slot.number,)) + body[1:])
            elif kind == wire.DATA:
                if self.reader:
                    self._send(self.reader, body)
            elif wire.REPLY <= kind < Notice.GREETING:
                try:
                    self._reply(wire.parse_reply(body))
                except wire.WireError:
                    self.confused += 1
            else:
                self.confused += 1

    def _reply(self, reply: Reply) -> None:
        job = self.job
        if job is None or (reply.op, reply.id) != (job.op, job.id):
            return  # the reply to a repetition, or to one that was given up
        self.job = None
        if job.session and reply.status == Status.NO_SESSION:
            self._session_lost()
        status = _status(reply)
        if job.op == Op.STATUS and status:
            if job.session and not status.ours:
                self._session_lost()
            if status.mark == 0 and not job.marked:
                self._place_mark(job)
                return
        if job.done:
            job.done(reply)
        elif job.peer:
            self._pass_on(job, reply)

    # -- clients ---------------------------------------------------------------------------

    def _accept(self) -> None:
        try:
            connection, _ = self.listener.accept()
        except OSError:
            return  # gone again
        connection.setblocking(False)
        peer = Peer(connection)
        greeting = {
            "pid": os.getpid(),
            "version": __version__,
            "port": self.line.url,
            "baud": self.baud,
            "clients": len(self.peers),
        }
        self.peers.append(peer)
        peer.out += packed(bytes((Notice.GREETING,)) + json.dumps(greeting).encode())
        self._tell_counters(peer)

    def _tell_counters(self, peer: Peer) -> None:
        counters = (self.splitter.damaged + self.confused, self.retries)
        if counters != peer.told:
            peer.told = counters
            peer.out += packed(struct.pack("<BII", Notice.COUNTERS, *counters))

    def _send(self, peer: Peer, body: bytes) -> None:
        if peer.gone or len(peer.out) > WAITING_BYTES:
            return
        self._tell_counters(peer)
        peer.out += packed(body)

    def _answered(self, peer: Peer, body: bytes) -> None:
        """The reply to a request, or that there is none; goes even to who reads slowly."""
        peer.pending -= 1
        peer.heard_s = max(peer.heard_s, time.monotonic())  # it waited for this
        if not peer.gone:
            self._tell_counters(peer)
            peer.out += packed(body)

    def _pass_on(self, job: Job, reply: Reply, **changes: Any) -> None:
        """A reply as that to what the client asked."""
        assert job.peer and job.request
        reply = reply._replace(op=job.request.op, id=job.request.id, **changes)
        self._answered(job.peer, wire.reply(*reply))

    def _read_peer(self, peer: Peer) -> None:
        try:
            data = peer.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._leave(peer)
            return
        peer.heard_s = time.monotonic()
        try:
            for body in peer.unpacker.push(data):
                request = wire.parse_request(body)
                if not peer.pending:
                    peer.pulse_s = peer.heard_s + PULSE_S
                peer.pending += 1
                self._ask(peer, request)
        except (wire.WireError, struct.error):
            self._leave(peer)  # not a client

    def _leave(self, peer: Peer) -> None:
        self.peers.remove(peer)
        peer.gone = True
        peer.socket.close()
        if self.reader is peer:
            self.reader = None
        for job in [job for job in self.queue if job.peer is peer and not job.sent]:
            self.queue.remove(job)
            if job.failed:
                job.failed()
        self._release(peer, None)
        if not self.peers:
            self._alone_s = time.monotonic()

    def _put(self, job: Job) -> None:
        """In line; a STOP before all others, and no START behind one that came later."""
        if job.op != Op.STOP:
            self.queue.append(job)
            return
        starts = [other for other in self.queue if other.op == Op.START]
        at = 0
        while at < len(self.queue) and self.queue[at].op == Op.STOP:
            at += 1
        self.queue.insert(at, job)
        if self.job and self.job.op == Op.START:
            self.job.left = 0
        for other in starts:
            self.queue.remove(other)
            self._fail(other, "start: withdrawn, somebody has stopped the drive")

    def _ask(self, peer: Peer, request: Request) -> None:
        op = request.op
        if op == Op.OPEN:
            self._open(peer, request)
        elif op == Op.CLOSE:
            self._release(peer, request)
        elif op == Op.STREAM and request.payload:
            self._stream(peer, request)
        else:
            job = Job(op, request.payload, peer, request)
            if op in (Op.START, Op.STOP, Op.READ):
                job.done = lambda reply: self._commanded(job, reply)
            self._put(job)

    def _commanded(self, job: Job, reply: Reply) -> None:
        """A drive that was started has a client that answers for it; a capture that is read
        has one that gets it."""
        peer = job.peer
        assert peer
        if reply.status == Status.DONE:
            if job.op == Op.STOP:
                self.starter = None
            elif job.op == Op.READ:
                self.reader = None if peer.gone else peer
            elif peer.gone:
                self._put(Job(Op.STOP))
            else:
                self.starter = peer
        self._pass_on(job, reply)

    # -- the session -----------------------------------------------------------------------

    def _session_lost(self) -> None:
        """The board was reset, or this process stood still for a second: the drive is off and
        the streams have ended. Clients open their session again, as with a board."""
        self.session = False
        self.generation += 1
        self.slots = [None] * wire.STREAMS
        self.starter = None

    def _new_mark(self) -> bytes:
        """OPEN's payload; another mark each time, or a reset would not show."""
        return wire.open_session(self.nonce, _random(4))

    def _place_mark(self, status: Job) -> None:
        """Give a board that was reset its mark, by a session that ends at once; then ask again."""
        status.marked, status.sent = True, b""
        close = Job(Op.CLOSE, done=lambda reply: None)
        close.always_session = True
        open_ = Job(Op.OPEN, self._new_mark(), done=lambda reply: None)
        self.queue.extendleft((status, close, open_))

    def _open(self, peer: Peer, request: Request) -> None:
        if self.session:
            job = Job(Op.STATUS, peer=peer, request=request)
            job.always_session = True
            job.done = lambda reply: self._joined(job, reply)
        else:
            job = Job(Op.OPEN, self._new_mark(), peer, request)
            job.done = lambda reply: self._opened(job, reply)
        self._put(job)

    def _joined(self, job: Job, reply: Reply) -> None:
        assert job.peer and job.request
        if not self.session:  # it was lost
            self._open(job.peer, job.request)
            return
        job.peer.generation = self.generation
        status = _status(reply)
        self._pass_on(job, reply, payload=status.mark.to_bytes(4, "little") if status else b"")

    def _opened(self, job: Job, reply: Reply) -> None:
        assert job.peer
        if reply.status == Status.DONE:
            if not self.session:
                self.session = True
                self.generation += 1
            job.peer.generation = self.generation
        self._pass_on(job, reply)

    def _release(self, peer: Peer, request: Request | None) -> None:
        """A client leaves the session: what it began ends. The last one ends the session."""
        if self.starter is peer:
            self.starter = None
            self._put(Job(Op.STOP))
        for number, slot in enumerate(self.slots):
            if slot and slot.peer is peer:
                self._end_stream(number, slot)
        was = peer.generation == self.generation
        peer.generation = 0
        if was and self.session and not self._kept():
            job = Job(Op.CLOSE, peer=peer, request=request)
            job.always_session = True
            job.done = lambda reply: self._closed(job, reply)
            self._put(job)
        elif request:
            self._answer(peer, request, Status.DONE)

    def _closed(self, job: Job, reply: Reply) -> None:
        if self.session:
            self._session_lost()
        if job.request:
            self._pass_on(job, reply, status=Status.DONE, payload=b"")

    def _answer(self, peer: Peer, request: Request, status: Status) -> None:
        """A reply that is not the board's; state and tick are."""
        job = Job(Op.STATUS, peer=peer, request=request)
        job.done = lambda reply: self._pass_on(job, reply, status=status, payload=b"")
        self._put(job)

    # -- streams ---------------------------------------------------------------------------

    def _stream(self, peer: Peer, request: Request) -> None:
        """Another number for the board's stream than the client's own."""
        number, ends = request.payload[0], request.payload[1:2] == b"\0"
        mine = [k for k, s in enumerate(self.slots) if s and (s.peer, s.number) == (peer, number)]
        free = [k for k, s in enumerate(self.slots) if s is None]
        if not mine and (ends or not free):
            self._answer(peer, request, Status.DONE if ends else Status.NO_STREAM)
            return
        at = (mine or free)[0]
        slot = self.slots[at] = self.slots[at] or Slot(peer, number)

        def free_unless_live() -> None:
            if self.slots[at] is slot and not slot.live:
                self.slots[at] = None

        def done(reply: Reply) -> None:
            if self.slots[at] is slot:
                if reply.status == Status.DONE:
                    slot.live = not ends
                    if peer.gone:
                        self._end_stream(at, slot)
                free_unless_live()
            self._pass_on(job, reply)

        payload = bytes((at,)) + request.payload[1:]
        job = Job(Op.STREAM, payload, peer, request, done, free_unless_live)
        self._put(job)

    def _end_stream(self, number: int, slot: Slot) -> None:
        """For a client that does not need it any more."""
        slot.live = False

        def free(*_: object) -> None:
            if self.slots[number] is slot:
                self.slots[number] = None

        self._put(Job(Op.STREAM, wire.stream(number, (), 1), done=free, failed=free))


def _name(op: int) -> str:
    return Op(op).name if op in tuple(Op) else f"request {op}"


def _random(size: int) -> int:
    """Not 0."""
    return int.from_bytes(os.urandom(size), "little") or 1


def _status(reply: Reply) -> wire.StatusReply | None:
    if reply.op != Op.STATUS or reply.status != Status.DONE:
        return None
    with suppress(wire.WireError):
        return wire.parse_status(reply.payload)
    return None


# -- the process ---------------------------------------------------------------------------


def _probe(line: port.Line, bauds: tuple[int, ...], quick: bool) -> int:
    """The rate at which a board answers."""
    if is_process(line.url) or "://" in line.url:
        bauds = bauds[:1]  # whatever the rate
    adapter = os.path.basename(os.path.realpath(line.url)).startswith(("ttyUSB", "ttyACM"))
    quick = quick and len(bauds) > 1 and not adapter
    each = 1 if quick else tries(line.url) if len(bauds) == 1 else PROBE_TRIES
    for at, baud in enumerate(bauds):
        if at:
            line.change_baud(baud)
        splitter = wire.Splitter()
        sent = wire.frame(wire.request(Op.HELLO, _random(1), 0, 0))
        for _ in range(each):
            line.write(sent)
            # Nothing streams before a session, so that no sample goes before the reply.
            line_bytes = len(sent) + HELLO_BYTES
            within_s = reply_s(line.url, baud, line_bytes)
            if quick:
                within_s = line_bytes * 10 / baud + QUICK_REPLY_S
            end_s = time.monotonic() + within_s
            while select.select([line], [], [], max(0.0, end_s - time.monotonic()))[0]:
                if any(body[0] == wire.REPLY + Op.HELLO for body in splitter.push(line.read())):
                    return baud
    rates = " or ".join(str(baud) for baud in bauds)
    raise NoReply(f"{line.url}: no reply to HELLO at {rates} baud")


def _lock(path: Path, url: str) -> int | None:
    """The lock of this port's server, or None if another one has it."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            return None
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file), os.stat(path)):
                break
        os.close(file)  # of one that was just ending
    row = runtime.Locked(
        os.getpid(),
        port.command_of(os.getpid()),
        datetime.now().astimezone().isoformat(timespec="seconds"),
        url,
    )
    os.ftruncate(file, 0)
    os.write(file, json.dumps(row._asdict()).encode())
    return file


def _say(**words: object) -> None:
    """To who started this process, which then waits no longer."""
    with suppress(OSError):
        os.write(1, json.dumps(words).encode() + b"\n")
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 1)
    os.close(nothing)


def main(url: str, bauds: tuple[int, ...], quick: bool) -> int:
    if os.fork():
        os._exit(0)  # nobody needs to wait for the server
    os.chdir("/")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    # Now: where a name leads to may change.
    lock, path, log = (runtime.port_path(url, suffix) for suffix in ("lock", "sock", "log"))
    held = _lock(lock, url)
    if held is None:
        _say(held=True)
        return 0
    line = None
    try:
        line = port.Line(url, bauds[0])
        baud = _probe(line, bauds, quick)
        path.unlink(missing_ok=True)  # of one that was killed
        listener = socket.socket(socket.AF_UNIX)
        with runtime.short(path) as address:
            listener.bind(address)
        listener.listen(64)
        listener.setblocking(False)
        _say(ready=True)
        Server(line, baud, listener).run()
    except LinkError as error:
        kind = {"busy": isinstance(error, Busy), "silent": isinstance(error, NoReply)}
        _say(error=str(error), mistake=error.mistake, **kind)
    except OSError as error:
        text = f"{url}: {error.strerror or error}"
        _say(error=text, mistake=False, busy=False, silent=False)
    finally:
        path.unlink(missing_ok=True)
        if line:
            line.close()
        lock.unlink(missing_ok=True)
    log.unlink(missing_ok=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], tuple(map(int, sys.argv[2].split(","))), "quick" in sys.argv[3:]))
