"""A board's dictionary: the parameters, channels, faults and states that the board lists.

Dictionaries are saved in the user's cache directory, named by their CRC. A saved one is used
only if its CRC is right.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..firmware import Parameter, State, decimal
from ..given import suggest
from . import LinkError, LinkInputError, wire
from .client import Client
from .wire import Hello, Kind, Op, Status


@dataclass(frozen=True)
class Dictionary:
    crc: int
    parameters: dict[str, Parameter]
    channels: tuple[wire.ChannelRow, ...]
    faults: tuple[wire.FaultRow, ...]
    states: tuple[State, ...]
    minor: int  #: of the board's protocol

    def causes(self, bits: int) -> list[str]:
        """Names of fault bits."""
        return [fault.name for fault in self.faults if bits & fault.bit]

    def channel_ids(self, names: Sequence[str]) -> tuple[int, ...]:
        ids = {row.name: id for id, row in enumerate(self.channels)}
        for name in names:
            if name not in ids:
                raise LinkInputError(f"no channel {name!r}{suggest(name, ids)}")
        return tuple(ids[name] for name in names)


def fetch(client: Client) -> tuple[Hello, Dictionary]:
    """Read the board's identity, and its dictionary unless that is in the cache."""
    hello = client.hello()
    client.dictionary = hello.crc & 0xFFFF
    rows = kept(hello)
    if rows is None:
        rows = _ask(client, hello)
        _keep(hello.crc, rows)
    try:
        dictionary = _parse(hello, rows, _additions(client, hello))
    except wire.WireError as error:
        raise LinkError(f"{client.url}: {error}") from None
    client.states = dictionary.states
    return hello, dictionary


def _additions(client: Client, hello: Hello) -> wire.Additions:
    """Not in the cache: the dictionary's CRC does not cover it."""
    reply = client.ask(Op.LIST, struct.pack("<BH", wire.ADDITIONS, 0))
    if reply.status == Status.ID:
        return wire.Additions()  # a board of version 2.0
    if reply.status != Status.DONE:
        raise client.refused(reply, "list")
    return wire.parse_additions(reply.payload, hello)


def fetch_reset(client: Client) -> wire.Reset | None:
    """Why the board started; None: it does not know, or is of an earlier version."""
    reply = client.ask(Op.LIST, struct.pack("<BH", wire.RESET, 0))
    if reply.status == Status.ID:
        return None
    if reply.status != Status.DONE:
        raise client.refused(reply, "list")
    try:
        return wire.parse_reset(reply.payload)
    except wire.WireError as error:
        raise LinkError(f"{client.url}: {error}") from None


def _keys(hello: Hello) -> list[tuple[Kind, int]]:
    return [(kind, row) for kind, count in zip(Kind, hello.rows) for row in range(count)]


def _ask(client: Client, hello: Hello) -> list[bytes]:
    rows = [client.do(Op.LIST, struct.pack("<BH", *key)).payload for key in _keys(hello)]
    crc = zlib.crc32(b"".join(rows))
    if crc != hello.crc:
        raise LinkError(
            f"{client.url}: the dictionary's CRC is {crc:08x}, the board says {hello.crc:08x}"
        )
    return rows


def _parse(hello: Hello, rows: list[bytes], more: wire.Additions) -> Dictionary:
    parsed: dict[Kind, list] = {kind: [] for kind in Kind}
    for (kind, row), payload in zip(_keys(hello), rows):
        parsed[kind].append(wire.parse_row(payload, kind, row))
    parameters = {
        row.name: Parameter(
            id, row.name, row.unit, decimal(row.min), decimal(row.max), decimal(row.initial),
            row.live, tuple(row.choices.split("|")) if row.choices else (), row.help, row.whole,
        )
        for id, row in enumerate(parsed[Kind.PARAMETER])
    }  # fmt: skip
    names = [row.name for row in parsed[Kind.STATE]]
    states = tuple(map(State.of, names, more.states)) or tuple(map(State, names))
    return Dictionary(
        hello.crc, parameters, tuple(parsed[Kind.CHANNEL]), tuple(parsed[Kind.FAULT]), states,
        more.minor,
    )  # fmt: skip


def _file(crc: int) -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "hexatorque" / f"dictionary-{crc:08x}"


def _keep(crc: int, rows: list[bytes]) -> None:
    path = _file(crc)
    partial = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(b"".join(struct.pack("<H", len(row)) + row for row in rows))
        partial.replace(path)
    except OSError:
        pass  # next time the board is asked again


def kept(hello: Hello) -> list[bytes] | None:
    """The rows of a dictionary in the cache; None if it is not there or damaged."""
    try:
        raw = _file(hello.crc).read_bytes()
    except OSError:
        return None
    rows, at = [], 0
    while at + 2 <= len(raw):
        end = at + 2 + struct.unpack_from("<H", raw, at)[0]
        rows.append(raw[at + 2 : end])
        at = end
    if len(rows) != sum(hello.rows) or zlib.crc32(b"".join(rows)) != hello.crc:
        return None
    return rows
