"""One process can hold a port; a relay lets others of the same user share it.

Whoever holds the port listens on a socket (`runtime.relay_path`) and speaks the same protocol
there as the board does: `Client` cannot tell the two apart. Requests go through the holder's
own client, one at a time, so session, heartbeat and watchdog are the holder's. Streams are
handed out per connection and end with it; a drive that was started through the relay stops
when who started it is gone or silent.
"""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
from pathlib import Path

from . import LinkError, runtime, wire
from .client import Client
from .wire import Op, Reply, Request, Status

#: A client that started the drive beats every 80 ms.
SILENT_S = 0.25
#: Batches of samples that wait for a slow reader; then it loses some, as its ticks tell.
WAITING = 2000


class Relay:
    """Listens until closed."""

    @classmethod
    def beside(cls, client: Client) -> Relay | None:
        """A relay for the port that this client holds; None if none can be made."""
        try:
            return cls(client, runtime.relay_path(client.url))
        except (LinkError, OSError):
            return None

    def __init__(self, client: Client, path: Path) -> None:
        self.client = client
        self.path = path
        self._peers: set[_Peer] = set()
        self._lock = threading.Lock()
        self._socket = socket.socket(socket.AF_UNIX)
        # Who holds the port owns the name: what is there was left by one that died.
        path.unlink(missing_ok=True)
        self._socket.bind(str(path))
        self._socket.listen()
        client.transport.serves = True
        self._thread = threading.Thread(target=self._accept, name="relay", daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with self._lock:
                self._peers.add(_Peer(self, connection))

    def gone(self, peer: _Peer) -> None:
        with self._lock:
            self._peers.discard(peer)

    def drive_changed_hands(self, by: _Peer) -> None:
        """The one that commanded last is the one whose silence stops the drive."""
        with self._lock:
            for peer in self._peers:
                peer.started = peer.started and peer is by

    def close(self) -> None:
        self.path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join()
        with self._lock:
            peers = list(self._peers)
        for peer in peers:
            peer.end()


class _Peer:
    """One connection."""

    def __init__(self, relay: Relay, connection: socket.socket) -> None:
        self._relay = relay
        self._client = relay.client
        self._connection = connection
        #: This one's START is what the drive runs on.
        self.started = False
        self._streams: dict[int, int] = {}  # its number -> the board's
        self._out: queue.Queue[bytes | None] = queue.Queue()
        self._silence = self._client.listen(self._send_bodies)
        self._sender = threading.Thread(target=self._send, name="relay out", daemon=True)
        self._reader = threading.Thread(target=self._serve, name="relay in", daemon=True)
        self._sender.start()
        self._reader.start()

    def end(self) -> None:
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._reader.join()

    # -- to the client -----------------------------------------------------------------------

    def _send(self) -> None:
        while (octets := self._out.get()) is not None:
            with contextlib.suppress(OSError):
                self._connection.sendall(octets)

    def _send_bodies(self, bodies: list[bytes]) -> None:
        """In the reader's thread of the port: does not wait."""
        if self._out.qsize() < WAITING:
            self._out.put(b"".join(wire.frame(body) for body in bodies))

    # -- from the client ---------------------------------------------------------------------

    def _serve(self) -> None:
        splitter = wire.Splitter()
        try:
            while True:
                self._connection.settimeout(SILENT_S if self.started else None)
                octets = self._connection.recv(4096)
                if not octets:
                    return
                for body in splitter.push(octets):
                    self._answer(wire.parse_request(body))
        except (OSError, wire.WireError):
            pass  # gone, silent while it drives, or not a client
        finally:
            self._leave()

    def _leave(self) -> None:
        try:
            if self.started:
                self._client.do(Op.STOP)
        except LinkError:
            pass  # the watchdog does it
        finally:
            self._relay.gone(self)
            self._silence()
            for stream in self._streams.values():
                self._client.free_stream(stream)
            self._out.put(None)
            self._connection.close()

    def _answer(self, request: Request) -> None:
        try:
            if request.op == Op.STREAM and request.payload:
                self._stream(request)
            else:
                self._reply(request, self._carry_out(request))
        except (LinkError, ValueError):
            pass  # no answer from the board: none from here

    def _reply(self, request: Request, reply: Reply) -> None:
        self._out.put(wire.frame(wire.reply(request.op, request.id, *reply[2:])))

    def _carry_out(self, request: Request) -> Reply:
        op, client = request.op, self._client
        if self._stale(request):
            return self._refuse(Status.DICTIONARY)
        if op in (Op.OPEN, Op.CLOSE):
            # The session is the holder's.
            done = client.ask(Op.STOP if op == Op.CLOSE and self.started else Op.STATUS)
            self.started = self.started and op != Op.CLOSE
            mark = client.mark.to_bytes(4, "little")
            return done._replace(payload=mark if op == Op.OPEN else b"")
        reply = client.ask(op, request.payload)
        if reply.status == Status.DONE and op in (Op.START, Op.STOP):
            self.started = op == Op.START
            self._relay.drive_changed_hands(self)
        return reply

    def _stale(self, request: Request) -> bool:
        other = request.dictionary != self._client.dictionary
        return other and request.op in wire.NEEDS_DICTIONARY

    def _refuse(self, status: Status, payload: bytes = b"") -> Reply:
        return self._client.ask(Op.STATUS)._replace(status=status, payload=payload)

    def _stream(self, request: Request) -> None:
        """Another number for the board's stream than the client's own."""
        client, mine = self._client, request.payload[0]
        if self._stale(request):
            self._reply(request, self._refuse(Status.DICTIONARY))
            return
        if mine not in self._streams:
            try:
                self._streams[mine] = client.take_stream()
            except LinkError:
                self._reply(request, self._refuse(Status.VALUE, bytes(2)))
                return
        kind = bytes((wire.SAMPLE + mine,))

        def sink(bodies: list[bytes]) -> None:
            self._send_bodies([kind + body[1:] for body in bodies])

        # The reply goes out in the reader's thread: before the first sample.
        reply = client.ask_stream(
            self._streams[mine], request.payload, sink, lambda r: self._reply(request, r)
        )
        if reply.status != Status.DONE:
            self._reply(request, reply)
        if request.payload[1:2] == bytes(1):
            client.free_stream(self._streams.pop(mine))
