"""A port that clients share: the thread of the port server.

Clients use the board's protocol over a socket, but without COBS and CRC: each body follows its
u16 length (exchange.py). The server sends requests to the board one at a time, in its own session.
It therefore changes ids, sessions and stream numbers on the way. Further messages (`Notice`)
report that the board does not answer, that the port is gone, and the line's counters.

The drive stops if the client that started it leaves, or sends nothing for 250 ms. Nothing in this
thread waits.
"""

from __future__ import annotations

import json
import os
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from secrets import compare_digest
from typing import Any

from .. import __version__
from . import port, wire
from .exchange import PULSE_S, Notice, Unpacker, is_process, packed
from .wire import Op, Reply, Request, Status

#: The drive stops if the client that started it is silent for this long. Its heartbeat comes
#: every 80 ms.
SILENT_S = 0.25
#: If there was no request for this long, the server sends one to keep the session. This is longer
#: than a client's heartbeat, so that not both send one.
HEARTBEAT_S = 0.1
#: The server ends if it has had no client for this long.
LINGER_S = 1.0
#: While no request waits for its reply, the port is read this often. So there are few wake-ups
#: when samples come at full speed.
READ_S = 0.01
#: Most bytes that wait for a client that does not read. Further samples are dropped, which the
#: ticks show. At the full 1.25 Mbaud this is more than a minute.
WAITING_BYTES = 8 << 20
#: With this many unanswered requests, no more are read from a client.
WAITING_REQUESTS = 8
#: Longest time for a reply, besides its time on the line. USB adapters delay bytes by 16 ms. The
#: board's watchdog waits for 250 ms, so two requests in a row may be lost.
REPLY_S = 0.05
#: On a line that damages a fifth of its frames, three tries lose one GET in eight, and eight tries
#: lose one in a hundred (`hexatorque evidence studies line`). A virtual board may answer late: it
#: is a process that may have to wait for the processor.
TRIES = 8
PROCESS_TRIES = 16


def tries(url: str) -> int:
    return PROCESS_TRIES if is_process(url) else TRIES


def reply_s(baud: int, line_bytes: int, wait_s: float = REPLY_S) -> float:
    """How long to wait for a reply if at most `line_bytes` are on the line before its end."""
    return line_bytes * 10 / baud + wait_s


class Peer:
    """A connected client."""

    def __init__(self, connection: socket.socket, secret: bytes = b"") -> None:
        self.socket = connection
        self.secret = secret  #: with which it still has to begin
        self.unpacker = Unpacker()
        self.out = bytearray()
        self.heard_s = time.monotonic()
        self.generation = 0  #: generation of the session that the client has joined; 0: none
        self.pending = 0  #: requests without a reply
        self.pulse_s = 0.0  #: when the next pulse is due if a request is pending
        self.sent_counters: tuple[int, int] | None = None  #: the latest that the client got
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
                self.out.clear()  # reading the socket will show that it is closed


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
        self.sent = b""  #: the frame on the line
        self.id = 0
        self.session = False  #: was sent in the session
        self.always_session = False
        self.left = 0  #: tries that are left
        self.wait_s = self.deadline_s = 0.0
        self.marked = False  #: the board's mark was set for it


class Slot:
    """A stream of the board that belongs to a client."""

    def __init__(self, peer: Peer, number: int) -> None:
        self.peer, self.number = peer, number
        self.live = False


class Server:
    def __init__(
        self, line: port.Line, baud: int, listener: socket.socket, secret: bytes = b""
    ) -> None:
        """secret: the bytes with which each client begins."""
        self.line, self.baud, self.listener, self.secret = line, baud, listener, secret
        self.tries = tries(line.url)
        self.peers: list[Peer] = []
        self.queue: deque[Job] = deque()
        self.job: Job | None = None
        self.splitter = wire.Splitter()
        self.unknown = 0  #: frames of unknown contents
        self.retries = 0
        self.session = False
        self.nonce = random_number(2)
        self.generation = 1
        self.slots: list[Slot | None] = [None] * wire.STREAMS
        self.starter: Peer | None = None
        self.reader: Peer | None = None  #: who gets a capture's data
        self.state = 0  #: of the drive, in the latest reply
        self._out = b""
        self._id = random_number(1)
        self._asked_s = 0.0
        self._read_s = min(READ_S, 15_000 / baud)
        self._read_due_s = 0.0
        self._alone_s = time.monotonic()

    # -- the loop --------------------------------------------------------------------------

    def run(self) -> None:
        """Serve until the last client has left, or the port is gone."""
        try:
            while self._step():
                pass
        except OSError:
            for peer in self.peers:
                self._send(peer, bytes((Notice.LOST,)))
        finally:
            self._end_session()

    def _step(self) -> bool:
        # A deadline counts as missed only if it had passed at this moment and nothing has come by
        # the end of the select. This process may not have run in between.
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
        if self._session_needed():
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
            state = self.state
            self._put(Job(Op.STOP, done=lambda reply: self._was_silent(starter, state, reply)))
        quiet = not self.job and not self.queue and now_s > self._asked_s + HEARTBEAT_S
        if quiet and self._session_needed():
            self._put(Job(Op.STATUS))
        for peer in self.peers:
            if peer.pending and now_s > peer.pulse_s:
                peer.pulse_s = now_s + PULSE_S
                self._send(peer, bytes((Notice.PULSE,)))

    def _session_needed(self) -> bool:
        """Whether a client needs the session."""
        return self.session and any(peer.generation == self.generation for peer in self.peers)

    def _end_session(self) -> None:
        """End the session, which stops a drive that was started in it, and disconnect all."""
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
            job.wait_s = reply_s(self.baud, size)
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
        """Repeat a request that got no reply. A STOP in the queue goes first."""
        self.job = None
        if job.left and job.op == Op.STATUS and job.peer is None and self.queue:
            return  # a heartbeat; the waiting request serves as one as well
        if job.op == Op.START and job.peer and job.peer.gone:
            self._put(Job(Op.STOP))  # the START may have been carried out
            return
        if job.left:
            at = 0
            while job.op != Op.STOP and at < len(self.queue) and self.queue[at].op == Op.STOP:
                at += 1
            self.queue.insert(at, job)
            return
        if job.op == Op.STOP and job.peer is None:
            self._put(Job(Op.STOP, done=job.done))
            return
        if job.op == Op.START:
            self.starter = job.peer  # the START may have been carried out
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
                    self.unknown += 1
            else:
                self.unknown += 1

    def _reply(self, reply: Reply) -> None:
        job = self.job
        if job is None or (reply.op, reply.id) != (job.op, job.id):
            return  # a second reply to a repeated request, or a reply that came too late
        self.job = None
        self.state = reply.state
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
            return  # it has already left
        connection.setblocking(False)
        peer = Peer(connection, self.secret)
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
        counters = (self.splitter.damaged + self.unknown, self.retries)
        if counters != peer.sent_counters:
            peer.sent_counters = counters
            peer.out += packed(struct.pack("<BII", Notice.COUNTERS, *counters))

    def _send(self, peer: Peer, body: bytes) -> None:
        if peer.gone or len(peer.out) > WAITING_BYTES:
            return
        self._tell_counters(peer)
        peer.out += packed(body)

    def _answered(self, peer: Peer, body: bytes) -> None:
        """Send the reply to a request, or that there is none. Unlike a sample it is never
        dropped."""
        peer.pending -= 1
        peer.heard_s = max(peer.heard_s, time.monotonic())  # it was waiting, not silent
        if not peer.gone:
            self._tell_counters(peer)
            peer.out += packed(body)

    def _pass_on(self, job: Job, reply: Reply, **changes: Any) -> None:
        """Send the board's reply to the client, with the id of the client's request."""
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
        if not data or not compare_digest(data[: len(peer.secret)], peer.secret):
            self._leave(peer)
            return
        data, peer.secret = data[len(peer.secret) :], b""
        peer.heard_s = time.monotonic()
        try:
            for body in peer.unpacker.push(data):
                request = wire.parse_request(body)
                if not peer.pending:
                    peer.pulse_s = peer.heard_s + PULSE_S
                peer.pending += 1
                self._ask(peer, request)
        except (wire.WireError, struct.error):
            self._leave(peer)  # these bytes do not come from a client

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
        """Queue a request. A STOP goes before all others and withdraws every waiting START."""
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
            self._fail(other, "start: withdrawn, a client has stopped the drive")

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
        """Note which client has started the drive, and which client reads the capture."""
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

    def _was_silent(self, peer: Peer, state: int, reply: Reply) -> None:
        """Tell the client that its drive was stopped, unless that had ended by itself before."""
        if not peer.gone and reply.state != state:
            silent_ms = round(1e3 * SILENT_S)
            peer.out += packed(struct.pack("<BIH", Notice.STOPPED, reply.tick, silent_ms))

    # -- the session -----------------------------------------------------------------------

    def _session_lost(self) -> None:
        """The board was reset, or this process did not run for a second. The drive is off and the
        streams have ended. Clients open their session again, as they would on a board."""
        self.session = False
        self.generation += 1
        self.slots = [None] * wire.STREAMS
        self.starter = None

    def _new_mark(self) -> bytes:
        """OPEN's payload. The mark is a new one each time; otherwise a reset would not show."""
        return wire.open_session(self.nonce, random_number(4))

    def _place_mark(self, status: Job) -> None:
        """Set the mark of a board that was reset, by a session that ends at once. Then request
        STATUS again."""
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
        if not self.session:  # it was lost in the meantime
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
        """A client leaves the session. Its streams end, and so does the drive that it started.
        When the last client leaves, the session ends."""
        if self.starter is peer:
            self.starter = None
            self._put(Job(Op.STOP))
        for number, slot in enumerate(self.slots):
            if slot and slot.peer is peer:
                self._end_stream(number, slot)
        was = peer.generation == self.generation
        peer.generation = 0
        if was and self.session and not self._session_needed():
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
        """Send a reply of the server itself, with the board's latest state and tick."""
        job = Job(Op.STATUS, peer=peer, request=request)
        job.done = lambda reply: self._pass_on(job, reply, status=status, payload=b"")
        self._put(job)

    # -- streams ---------------------------------------------------------------------------

    def _stream(self, peer: Peer, request: Request) -> None:
        """Pass on STREAM. The board's stream gets another number than the client's."""
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
        """End a stream of the board that its client no longer needs."""
        slot.live = False

        def free(*_: object) -> None:
            if self.slots[number] is slot:
                self.slots[number] = None

        self._put(Job(Op.STREAM, wire.stream(number, (), 1), done=free, failed=free))


def _name(op: int) -> str:
    return Op(op).name if op in tuple(Op) else f"request {op}"


def random_number(size: int) -> int:
    """A random number of `size` bytes, not 0."""
    return int.from_bytes(os.urandom(size), "little") or 1


def _status(reply: Reply) -> wire.StatusReply | None:
    if reply.op != Op.STATUS or reply.status != Status.DONE:
        return None
    with suppress(wire.WireError):
        return wire.parse_status(reply.payload)
    return None
