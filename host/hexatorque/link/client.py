"""Requests and their replies, the session and its heartbeat, and who gets which frames."""

from __future__ import annotations

import contextlib
import queue
import random
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from . import LinkError, wire
from .transport import BUSY_S, Transport
from .wire import Op, Reply, Status

#: Three of these fit a board's watchdog of 250 ms.
HEARTBEAT_S = 0.08
#: A client that died leaves its session to the board for a second.
OPEN_PATIENCE_S = 1.6

_REFUSED = {
    Status.ID: "no such parameter or channel",
    Status.VALUE: "value not finite, out of range or not a choice",
    Status.STATE: "not allowed in state {state}",
    Status.CONFIG: "parameters do not fit together",
    Status.PORT: "the hardware cannot do this",
    Status.TURNING: "the machine turns faster than start_max_rpm; wait until it stands",
    Status.OPCODE: "the board does not know this request",
    Status.LENGTH: "the board expects another length of this request",
    Status.NO_SESSION: "the session has ended",
    Status.DICTIONARY: "the board's dictionary has changed, open it again",
    Status.OTHER_SESSION: "another client has a session",
    Status.BUDGET: "more than the line carries",
    Status.CAPTURE: "the board's capture is not in a state for this",
    Status.NO_STREAM: "all of the board's streams are in use",
    Status.FIELD: "the board refuses a part of this request",
    Status.MEMORY: "larger than the board's memory",
    Status.SAMPLING: "can change only while nothing is streamed or captured",
}
#: Refusals of what was asked for, not of when.
_MISTAKES = (
    Status.ID, Status.VALUE, Status.CONFIG, Status.PORT, Status.LENGTH, Status.BUDGET,
    Status.NO_STREAM, Status.FIELD, Status.MEMORY,
)  # fmt: skip


@dataclass
class Counters:
    """What went wrong since the client was opened."""

    damaged: int = 0  #: frames that came damaged, or made no sense
    retries: int = 0
    reconnects: int = 0


class NoReply(LinkError):
    """The line is there, but no board that answers."""


#: Gets a batch of bodies, in the reader's thread: must not wait.
Sink = Callable[[list[bytes]], None]


class Client:
    """One board at the other end of a line."""

    def __init__(self, url: str, baud: int, patience_s: float = BUSY_S) -> None:
        """`patience_s`: how long a port is waited for that another process has."""
        self.url = url
        self.counters = Counters()
        #: Low half of the dictionary's CRC, for requests that name rows of it.
        self.dictionary = 0
        #: Names of the states, from the dictionary.
        self.states: tuple[str, ...] = ()
        #: Called when the board is there again, with a session if there was one; not in
        #: the reader's thread. May raise LinkError to give up.
        self.on_return: list[Callable[[], None]] = []
        self.latest: Reply | None = None
        self.status: wire.StatusReply | None = None
        self.in_session = False
        #: Why this client cannot be used any more.
        self.broken: LinkError | None = None
        self._nonce = random.SystemRandom().randint(1, 0xFFFF)
        #: The board's mark; 0 before the first session. Another one means that it was reset.
        self.mark = 0
        self._id = random.randrange(256)
        self._splitter = wire.Splitter()
        self._one_at_a_time = threading.RLock()
        self._replies: queue.SimpleQueue[Reply | None] = queue.SimpleQueue()
        self._awaited: tuple[int, int, Callable[[Reply], None] | None] | None = None
        self._asked_s = 0.0
        self._sinks: list[Sink | None] = [None] * wire.STREAMS
        self._data_sinks: list[Sink] = []
        self._closing = threading.Event()
        self._returned = threading.Event()
        self._heart: threading.Thread | None = None
        self.transport = Transport(url, baud, self._octets, self._lost, self._back, patience_s)
        self.transport.start()

    # -- what comes in (the reader's thread) ----------------------------------------

    def _octets(self, octets: bytes) -> None:
        samples: tuple[list[bytes], ...] = ([], [], [], [])
        data: list[bytes] = []
        for body in self._splitter.push(octets):
            kind = body[0]
            if wire.SAMPLE <= kind < wire.SAMPLE + wire.STREAMS:
                samples[kind - wire.SAMPLE].append(body)
            elif kind >= wire.REPLY:
                # Samples before a reply belong to what was in force before it.
                self._deliver(samples)
                self._reply(body)
            elif kind == wire.DATA:
                data.append(body)
            else:
                self.counters.damaged += 1
        self._deliver(samples)
        if data:
            for sink in tuple(self._data_sinks):
                sink(data)

    def _deliver(self, samples: tuple[list[bytes], ...]) -> None:
        for stream, bodies in enumerate(samples):
            if bodies:
                sink = self._sinks[stream]
                if sink:
                    sink(bodies.copy())
                bodies.clear()

    def _reply(self, body: bytes) -> None:
        try:
            reply = wire.parse_reply(body)
        except wire.WireError:
            self.counters.damaged += 1
            return
        awaited = self._awaited
        if awaited is None or (reply.op, reply.id) != awaited[:2]:
            return  # the reply to a repetition, or to one that was given up
        self._awaited = None
        self.latest = reply
        if awaited[2] and reply.status == Status.DONE:
            awaited[2](reply)
        self._replies.put(reply)

    def _lost(self, reason: str) -> None:
        self._replies.put(None)

    def _back(self) -> None:
        self._splitter.restart()
        self._returned.set()

    @property
    def damaged(self) -> int:
        return self.counters.damaged + self._splitter.damaged

    # -- requests --------------------------------------------------------------------

    def ask(
        self, op: int, payload: bytes = b"", accepted: Callable[[Reply], None] | None = None
    ) -> Reply:
        """The board's reply, whatever it says. `accepted` is called in the reader's thread
        before any frame that comes after the reply to a request that is carried out."""
        with self._one_at_a_time:
            if self.broken:
                raise self.broken
            if op in wire.NEEDS_SESSION and not self.in_session:
                self.open_session()
            reply = self._ask(op, payload, accepted)
            if reply.status == Status.NO_SESSION and self.in_session:
                # The board forgot: it was reset, or this process slept for a second.
                self._resume()
                reply = self._ask(op, payload, accepted)
            return reply

    def _ask(
        self, op: int, payload: bytes = b"", accepted: Callable[[Reply], None] | None = None
    ) -> Reply:
        self._id = (self._id + 1) & 0xFF
        octets = wire.frame(wire.request(op, self._id, self._nonce, self.dictionary, payload))
        while not self._replies.empty():
            self._replies.get()
        wait_s = self.transport.reply_s(len(octets) + wire.reply_bytes(op, len(payload)))
        for attempt in range(self.transport.tries):
            self._awaited = (op, self._id, accepted)
            self.counters.retries += attempt > 0
            self._asked_s = time.monotonic()
            self.transport.write(octets)
            try:
                reply = self._replies.get(timeout=wait_s)
            except queue.Empty:
                continue
            if reply is None:
                raise LinkError(f"{self.url}: unplugged")
            return reply
        self._awaited = None
        raise NoReply(
            f"{self.url}: no reply to {Op(op).name} within {wait_s * self.transport.tries:.2g} s"
        )

    def do(
        self,
        op: int,
        payload: bytes = b"",
        what: str = "",
        accepted: Callable[[Reply], None] | None = None,
    ) -> Reply:
        """The reply to a request that is carried out; LinkError about `what` otherwise."""
        reply = self.ask(op, payload, accepted)
        if reply.status != Status.DONE:
            raise self.refused(reply, what or Op(op).name.lower())
        return reply

    def refused(self, reply: Reply, what: str) -> LinkError:
        text = _REFUSED.get(reply.status, f"status {reply.status}")
        with contextlib.suppress(wire.WireError):
            text = wire.refusal(reply) or text
        if reply.status == Status.STATE and reply.faults:
            text += "; clear the fault first"
        return LinkError(
            f"{what}: {text.format(state=self.state_name(reply.state))}",
            reply.status,
            reply.status in _MISTAKES,
        )

    def state_name(self, state: int) -> str:
        return self.states[state] if state < len(self.states) else str(state)

    def hello(self) -> wire.Hello:
        try:
            return wire.parse_hello(self.do(Op.HELLO).payload)
        except wire.WireError as error:
            raise LinkError(f"{self.url}: {error}") from None

    def get_status(self) -> wire.StatusReply:
        try:
            self.status = wire.parse_status(self.do(Op.STATUS).payload)
        except wire.WireError as error:
            raise LinkError(f"{self.url}: STATUS: {error}") from None
        return self.status

    # -- session ---------------------------------------------------------------------

    def open_session(self) -> None:
        """Take the session, and keep it by a heartbeat. One that somebody who died left
        behind is waited for."""
        with self._one_at_a_time:
            end = time.monotonic() + OPEN_PATIENCE_S
            while True:
                reply = self._ask(Op.OPEN, wire.open_session(self._nonce, _new_mark()))
                if reply.status == Status.DONE:
                    self._take_mark(reply)
                    break
                if reply.status != Status.OTHER_SESSION or time.monotonic() > end:
                    raise self.refused(reply, self.url)
                time.sleep(0.1)
            self.in_session = True
            self._returned.clear()
            if self._heart is None:
                self._heart = threading.Thread(
                    target=self._beat, name=f"heartbeat of {self.url}", daemon=True
                )
                self._heart.start()

    def _take_mark(self, reply: Reply) -> None:
        try:
            self.mark = wire.parse_open(reply.payload)
        except wire.WireError as error:
            raise LinkError(f"{self.url}: OPEN: {error}") from None

    def _beat(self) -> None:
        """Keep the session while nothing else is asked; take it again after an unplugging."""
        while not self._closing.wait(max(0.0, self._asked_s + HEARTBEAT_S - time.monotonic())):
            if self.broken:
                return
            if not self.transport.plugged:
                self._closing.wait(HEARTBEAT_S)
                continue
            try:
                with self._one_at_a_time:
                    if self._returned.is_set():
                        self._resume()
                    elif time.monotonic() - self._asked_s >= HEARTBEAT_S:
                        self.status = wire.parse_status(self.ask(Op.STATUS).payload)
                        if not self.status.ours:
                            self._resume()
            except (LinkError, wire.WireError):
                # Who asks for something next gets the error; the board helps itself.
                self._closing.wait(HEARTBEAT_S)

    def _resume(self) -> None:
        """A session again on a board that lost it; those who had streams set them again."""
        self.in_session = False
        self.open_session()
        for listener in tuple(self.on_return):
            try:
                listener()
            except LinkError as error:
                if error.mistake:
                    self.broken = error
                raise
        self.counters.reconnects += 1

    def close(self) -> None:
        """End the session, which stops a drive that the watchdog guards, and the line."""
        self._closing.set()
        if self._heart:
            self._heart.join()
        try:
            if self.in_session and self.transport.plugged and not self.broken:
                with self._one_at_a_time:
                    self._ask(Op.CLOSE)
        except LinkError:
            pass  # nobody there: the watchdog stops the drive
        finally:
            self.in_session = False
            self.transport.close()

    # -- frames that nobody asked for --------------------------------------------------

    def take_stream(self) -> int:
        """A free stream of the board."""
        with self._one_at_a_time:
            for stream, sink in enumerate(self._sinks):
                if sink is None:
                    self._sinks[stream] = _nobody
                    return stream
        raise LinkError(f"{self.url}: all {wire.STREAMS} streams are in use", mistake=True)

    def ask_stream(
        self,
        stream: int,
        payload: bytes,
        sink: Sink,
        begun: Callable[[Reply], None],
    ) -> Reply:
        """Ask for the stream of a STREAM's payload, under the number `stream`.
        `begun(reply)` comes before its first samples, in the reader's thread."""

        def accepted(reply: Reply) -> None:
            begun(reply)
            self._sinks[stream] = sink

        return self.ask(Op.STREAM, bytes((stream,)) + payload[1:], accepted)

    def free_stream(self, stream: int) -> None:
        """End a stream."""
        try:
            if self.in_session and not self.broken:
                self.ask(Op.STREAM, wire.stream(stream, (), 1))
        except LinkError:
            pass  # it ends with the session
        finally:
            self._sinks[stream] = None

    def listen(self, sink: Sink) -> Callable[[], None]:
        """Get capture data; returns what ends it."""
        self._data_sinks.append(sink)
        return lambda: self._data_sinks.remove(sink)


def _new_mark() -> int:
    """For every OPEN another one: a board that was reset must not take the one that it had."""
    return random.SystemRandom().randint(1, 0xFFFFFFFF)


def _nobody(bodies: list[bytes]) -> None:
    """Sink of a stream that is being set."""
