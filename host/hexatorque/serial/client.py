"""The client of one board: requests and replies, the session with its heartbeat, and the
distribution of samples.

The port server (server.py) has the serial line, repeats requests, and has the board's own session.
"""

from __future__ import annotations

import contextlib
import queue
import random
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from ..firmware import State
from ..results import RESULTS, text_of
from . import RESET_VALUES, LinkError, wire
from .exchange import PULSE_S, NoReply, Notice
from .transport import MISSED_PULSES, Transport
from .wire import Op, Reply, Status

#: Interval of the heartbeat. Three of them fit into the board's watchdog time of 250 ms.
HEARTBEAT_S = 0.08
#: Without a session, STATUS is requested this often to find out whether the board was reset.
LOOK_S = 1.0
#: Intervals of attempts to open a lost port again: a serial port, and one on the network.
RETURN_S, RETURN_SOCKET_S = 0.2, 1.0
#: Longest wait for OPEN. If a server died, the board keeps its session for a second.
OPEN_WAIT_S = 1.6


@dataclass
class Counters:
    """Errors since the client was opened."""

    damaged: int = 0  #: frames with a wrong CRC, or with unknown contents
    retries: int = 0
    reconnects: int = 0


class Stopped(NamedTuple):
    """A drive was stopped because the program that had started it did not run for a while."""

    tick: int  #: of the board
    silent_ms: int

    def __str__(self) -> str:
        return f"stopped at tick {self.tick}: {self.why('this program')}"

    def why(self, who: str) -> str:
        return f"{who} was silent for {self.silent_ms} ms"


#: Takes a batch of bodies. It is called in the reader's thread and must not wait.
Sink = Callable[[list[bytes]], None]


class Client:
    """One board at the other end of a line."""

    def __init__(
        self, url: str, bauds: int | tuple[int, ...], connect: Callable[..., Transport] = Transport
    ) -> None:
        """bauds: the baud rate; of several, the one at which the board answers is taken.
        connect(url, bauds, bodies, lost): makes the transport."""
        self.url = url
        self.counters = Counters()
        #: Low half of the dictionary's CRC, for requests that name rows of it.
        self.dictionary = 0
        #: The states, from the dictionary.
        self.states: tuple[State, ...] = ()
        #: Called when the board answers again after an interruption, and the session is open
        #: again if there was one. Not in the reader's thread. A LinkError gives the board up.
        self.on_return: list[Callable[[], None]] = []
        #: Called at once when a reset of the board is noticed. Must not wait or send requests.
        self.on_forgotten: list[Callable[[], None]] = []
        #: Called after a reset when the session is open again. May send requests.
        self.on_reset: list[Callable[[], None]] = []
        #: Number of resets of the board since this client was opened.
        self.resets = 0
        #: The board's mark, a number that it loses in a reset (docs/protocol.md); 0: not known.
        self.mark = 0
        self.latest: Reply | None = None
        self.status: wire.StatusReply | None = None
        self._more_faults = 0  # beyond those in every reply, at the latest STATUS
        #: The drive was stopped because this process was silent after its latest START.
        self.stopped: Stopped | None = None
        self.in_session = False
        #: Why this client cannot be used any more.
        self.broken: LinkError | None = None
        self._nonce = random.SystemRandom().randint(1, 0xFFFF)
        self._id = random.randrange(256)
        self._one_at_a_time = threading.RLock()
        self._replies: queue.SimpleQueue[Reply | LinkError] = queue.SimpleQueue()
        self._awaited: tuple[int, int, Callable[[Reply], None] | None] | None = None
        self._asked_s = time.monotonic()
        self._sinks: list[Sink | None] = [None] * wire.STREAMS
        self._data_sinks: list[Sink] = []
        self._line_counters: tuple[int, int] | None = None  # the server's latest counters
        self._resuming = False  # until session and streams have been opened again
        self._returning = False  # until then, if a session is needed
        self._unreported_resets = 0  # resets for which `on_reset` has not been called yet
        self._closing = threading.Event()
        self._wake = threading.Event()
        bauds = (bauds,) if isinstance(bauds, int) else bauds
        self.transport = connect(url, bauds, self._bodies, self._lost)
        self.transport.start()
        self._keeper = threading.Thread(target=self._keep, name=f"keeper of {url}", daemon=True)
        self._keeper.start()

    # -- received bodies (in the reader's thread) -----------------------------------

    def _bodies(self, bodies: list[bytes]) -> None:
        samples: tuple[list[bytes], ...] = ([], [], [], [])
        data: list[bytes] = []
        for body in bodies:
            kind = body[0]
            if wire.SAMPLE <= kind < wire.SAMPLE + wire.STREAMS:
                samples[kind - wire.SAMPLE].append(body)
            elif wire.REPLY <= kind < Notice.GREETING:
                # Samples before a reply belong to the stream as it was before the reply.
                self._deliver(samples)
                self._reply(body)
            elif kind == wire.DATA:
                data.append(body)
            elif kind == Notice.COUNTERS:
                self._count(*struct.unpack_from("<II", body, 1))
            elif kind == Notice.FAILED:
                self._failed(body)
            elif kind == Notice.STOPPED:
                self.stopped = Stopped(*struct.unpack_from("<IH", body, 1))
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
            return  # the reply to a request that timed out
        self._awaited = None
        self.latest = reply
        if awaited[2] and reply.status == Status.DONE:
            awaited[2](reply)
        self._replies.put(reply)

    def _failed(self, body: bytes) -> None:
        awaited = self._awaited
        if awaited and (body[1], body[2]) == awaited[:2]:
            self._awaited = None
            self._replies.put(NoReply(f"{self.url}: {body[3:].decode()}"))

    def _count(self, damaged: int, retries: int) -> None:
        """Add the line's errors since this client was opened."""
        before = self._line_counters
        if before is not None:
            self.counters.damaged += damaged - before[0]
            self.counters.retries += retries - before[1]
        self._line_counters = (damaged, retries)

    def _lost(self) -> None:
        self._returning = True
        self._line_counters = None
        self._replies.put(LinkError(f"{self.url}: {self.transport.reason}"))
        self._wake.set()

    @property
    def damaged(self) -> int:
        return self.counters.damaged

    # -- requests --------------------------------------------------------------------

    def ask(
        self, op: int, payload: bytes = b"", accepted: Callable[[Reply], None] | None = None
    ) -> Reply:
        """Send a request and return the board's reply, even a refusal. LinkError without a reply.
        If the request is carried out, `accepted` is called in the reader's thread before any
        frame that follows the reply."""
        with self._one_at_a_time:
            if self.broken:
                raise self.broken
            if op in wire.NEEDS_SESSION and not self.in_session:
                self.open_session()
            reply = self._ask(op, payload, accepted)
            if reply.status == Status.NO_SESSION and self.in_session:
                # The board was reset, or the port server did not run for a second.
                resets = self.resets
                self._resume()
                if self.resets != resets:
                    raise LinkError(
                        f"{self.url}: the board was reset; {RESET_VALUES}; "
                        f"{Op(op).name} was not carried out"
                    )
                reply = self._ask(op, payload, accepted)
            return reply

    def _ask(
        self, op: int, payload: bytes = b"", accepted: Callable[[Reply], None] | None = None
    ) -> Reply:
        self._id = (self._id + 1) & 0xFF
        while not self._replies.empty():
            self._replies.get()
        self._awaited = (op, self._id, accepted)
        self._asked_s = time.monotonic()
        self.transport.write(wire.request(op, self._id, self._nonce, self.dictionary, payload))
        missed, heard = 0, self.transport.heard
        while missed < MISSED_PULSES:
            try:
                found = self._replies.get(timeout=PULSE_S)
            except queue.Empty:
                # A reply that came while this process did not run counts as well.
                missed = missed + 1 if heard == self.transport.heard else 0
                heard = self.transport.heard
                continue
            if isinstance(found, LinkError):
                raise found
            return found
        self._awaited = None
        raise self.transport.hung()

    def do(
        self,
        op: int,
        payload: bytes = b"",
        what: str = "",
        accepted: Callable[[Reply], None] | None = None,
    ) -> Reply:
        """Send a request and return the reply. LinkError, naming `what`, if it is refused."""
        reply = self.ask(op, payload, accepted)
        if reply.status != Status.DONE:
            raise self.refused(reply, what or Op(op).name.lower())
        return reply

    def refused(self, reply: Reply, what: str) -> LinkError:
        state = self.state(reply.state).name
        text = text_of(reply.status, state)
        with contextlib.suppress(wire.WireError):
            text = wire.refusal(reply) or text
        if reply.status == Status.STATE and self.faults and reply.op not in wire.SLOW:
            text += "; clear the fault first"
        row = RESULTS.get(reply.status)
        return LinkError(f"{what}: {text}", reply.status, row is not None and row.mistake)

    def state(self, number: int) -> State:
        """The state of this number; one that the board does not list is unknown."""
        return self.states[number] if number < len(self.states) else State(str(number))

    def hello(self) -> wire.Hello:
        try:
            return wire.parse_hello(self.do(Op.HELLO).payload)
        except wire.WireError as error:
            raise LinkError(f"{self.url}: {error}") from None

    def get_status(self) -> wire.StatusReply:
        with self._one_at_a_time:
            reply = self.do(Op.STATUS)
            try:
                self.status = wire.parse_status(reply.payload)
            except wire.WireError as error:
                raise LinkError(f"{self.url}: STATUS: {error}") from None
            self._take_mark(self.status.mark)
            more = self.fault_words().latched if self.status.more_faults else 0
            self._more_faults = more & ~wire.LOW_FAULTS
            return self.status

    def fault_words(self) -> wire.FaultWords:
        """All bits of the faults, from a board of version 2.3."""
        reply = self.do(Op.LIST, struct.pack("<BH", wire.FAULTS, 0))
        try:
            return wire.parse_fault_words(reply.payload)
        except wire.WireError as error:
            raise LinkError(f"{self.url}: {error}") from None

    @property
    def faults(self) -> int:
        """The latched bits, as the latest replies have them."""
        return self._more_faults | (self.latest.faults if self.latest else 0)

    # -- session ---------------------------------------------------------------------

    def open_session(self) -> None:
        """Open the session; the heartbeat keeps it open. If a port server that died has left a
        session on the board, wait until that ends."""
        with self._one_at_a_time:
            end = time.monotonic() + OPEN_WAIT_S
            while True:
                reply = self._ask(Op.OPEN, wire.open_session(self._nonce, self._nonce))
                if reply.status == Status.DONE:
                    break
                if reply.status != Status.OTHER_SESSION or time.monotonic() > end:
                    raise self.refused(reply, self.url)
                time.sleep(0.1)
            try:
                mark = wire.parse_open(reply.payload)
            except wire.WireError as error:
                raise LinkError(f"{self.url}: OPEN: {error}") from None
            self.in_session = True
            self._take_mark(mark)
            self._wake.set()

    def _take_mark(self, mark: int) -> None:
        """Take the board's mark. If it is not the known one, the board was reset."""
        known, self.mark = self.mark, mark
        if known and mark != known:
            self.resets += 1
            self._unreported_resets += 1
            for listener in tuple(self.on_forgotten):
                listener()
            self._wake.set()

    def _keep(self) -> None:
        """The thread that sends heartbeats, and that opens the port and the session again after
        they were lost."""
        while not self._closing.is_set() and not self.broken:
            self._wake.wait(self._pause_s())
            self._wake.clear()
            if self._closing.is_set():
                return
            try:
                if self.transport.plugged or self.transport.again():
                    self.keep_up()
                else:
                    self._closing.wait(self._return_s)
            except (LinkError, wire.WireError):
                # The next request gets the error. The board stops the drive by itself.
                self._closing.wait(HEARTBEAT_S)

    @property
    def _return_s(self) -> float:
        return RETURN_SOCKET_S if "://" in self.url else RETURN_S

    def _pause_s(self) -> float:
        if self._returning or not self.transport.plugged:
            return 0.0
        every_s = HEARTBEAT_S if self.in_session else LOOK_S
        return max(0.0, self._asked_s + every_s - time.monotonic())

    def keep_up(self) -> None:
        """Do what is due: open the session again, send a heartbeat, report a reset."""
        with self._one_at_a_time:
            if self._returning:
                self._resume()
            elif self._pause_s() == 0.0:
                status = self.get_status()
                if self.in_session and not status.ours:
                    self._resume()
        while self._unreported_resets:
            self._unreported_resets -= 1
            for listener in tuple(self.on_reset):
                listener()

    def _resume(self) -> None:
        """Open the session again. The owners of streams then set their streams again."""
        self._returning = True
        if self.in_session or self._resuming:
            self._resuming, self.in_session = True, False
            self.open_session()
        else:
            self.get_status()
        for listener in tuple(self.on_return):
            try:
                listener()
            except LinkError as error:
                if error.mistake:
                    self.broken = error
                raise
        self._returning = self._resuming = False
        self.counters.reconnects += 1

    def close(self) -> None:
        """End the session and the connection. A drive that was started in the session stops."""
        self._closing.set()
        self._wake.set()
        if threading.current_thread() is not self._keeper:
            self._keeper.join()
        try:
            if self.in_session and self.transport.plugged and not self.broken:
                with self._one_at_a_time:
                    self._ask(Op.CLOSE)
        except LinkError:
            pass  # the board cannot be reached: its watchdog stops the drive
        finally:
            self.in_session = False
            self.transport.close()

    # -- frames that nobody asked for --------------------------------------------------

    def take_stream(self) -> int:
        """Reserve a stream of the board. Returns its number."""
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
        """Send STREAM with this payload for the stream number `stream`. `begun(reply)` is called
        in the reader's thread, before the first samples."""

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
            pass  # the stream ends with the session
        finally:
            self._sinks[stream] = None

    def forget_stream(self, stream: int) -> None:
        """Free the number of a stream that the board has lost."""
        self._sinks[stream] = None

    def listen(self, sink: Sink) -> Callable[[], None]:
        """Pass capture data to `sink`. Returns a function that ends this."""
        self._data_sinks.append(sink)
        return lambda: self._data_sinks.remove(sink)


def _nobody(bodies: list[bytes]) -> None:
    """The sink of a stream that is being set: it drops the samples."""
