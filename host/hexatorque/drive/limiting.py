"""The limits that keep a drive's torque from its reference, as a board tells them."""

from __future__ import annotations

import struct

from ..serial import LinkError, wire
from ..serial.client import Client
from ..serial.wire import Op, Status


def acting(client: Client, f_isr_Hz: float) -> dict[str, float]:
    """Those that act, and for how many seconds."""
    rows = fetch_limits(client)
    assert client.latest
    now = client.latest.tick
    return {row.name: ((now - row.since) & 0xFFFFFFFF) / f_isr_Hz for row in rows if row.acts}


def fetch_limits(client: Client) -> list[wire.LimitRow]:
    """All limits that the board knows."""
    rows: list[wire.LimitRow] = []
    while True:
        reply = client.ask(Op.LIST, struct.pack("<BH", wire.LIMITS, len(rows)))
        if reply.status == Status.ID:
            return rows
        if reply.status != Status.DONE:
            raise client.refused(reply, "limits")
        try:
            rows.append(wire.parse_limit(reply.payload, len(rows)))
        except wire.WireError as error:
            raise LinkError(f"{client.url}: {error}") from None
