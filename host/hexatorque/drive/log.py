"""A board's memory over power cycles: its log of events, and its counters."""

from __future__ import annotations

import csv
import io
import math
import struct
from collections.abc import Iterator
from typing import NamedTuple

from ..firmware import EVENTS, limits, reset_cause, warnings
from ..firmware import lib as firmware
from ..plant.vsd import PHASES
from ..serial import LinkError, wire
from ..serial.client import Client
from ..serial.dictionary import Dictionary
from ..serial.wire import Op, Status

#: Temperatures of an event.
TEMPERATURES = ("winding_degC", "device_degC", "sink_degC")


class Event(NamedTuple):
    """An event, the drive as it was then."""

    sequence: int
    event: str
    powered_s: int
    gates_s: int
    causes: list[str]  #: faults of a trip, warnings, the cause of a reset
    state: str
    scheme: str
    limits: list[str]
    vdc_V: float
    currents_A: dict[str, float]
    speed_rpm: float
    winding_degC: float | None  #: of the hottest phase; None: nothing tells it
    device_degC: float | None  #: of the power stage's hottest leg, by its model
    sink_degC: float | None  #: of the heat sink, by its thermistor

    @property
    def temperatures_degC(self) -> list[float | None]:
        return [getattr(self, name) for name in TEMPERATURES]


class Log(NamedTuple):
    counters: wire.Counters
    trips: dict[str, int]  #: by the name of their fault
    events: list[Event]  #: the latest first

    def as_json(self) -> dict:
        counters = self.counters._asdict()
        del counters["trips"], counters["events"]
        return {**counters, "trips": self.trips, "events": [one._asdict() for one in self.events]}

    def as_csv(self) -> str:
        """The events, a line each."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(
            ["sequence", "event", "powered_s", "gates_s", "causes", "state", "scheme", "limits",
             "vdc_V", *(f"i_{phase}_A" for phase in PHASES), "speed_rpm", *TEMPERATURES]
        )  # fmt: skip
        for one in self.events:
            table.writerow(
                [one.sequence, one.event, one.powered_s, one.gates_s, "; ".join(one.causes),
                 one.state, one.scheme, "; ".join(one.limits), f"{one.vdc_V:.6g}",
                 *(f"{value:.6g}" for value in one.currents_A.values()),
                 f"{one.speed_rpm:.6g}",
                 *("" if degC is None else f"{degC:.6g}" for degC in one.temperatures_degC)]
            )  # fmt: skip
        return text.getvalue()


def fetch_log(client: Client, dictionary: Dictionary) -> Log | None:
    """The log; None: the board has none. Events in its flash are read with the gates off only:
    while the drive is at work the log has those that wait for it."""
    reply = client.ask(Op.LIST, struct.pack("<BH", wire.COUNTERS, 0))
    if reply.status == Status.ID:
        return None
    if reply.status != Status.DONE:
        raise client.refused(reply, "log")
    try:
        counters = wire.parse_counters(reply.payload, len(dictionary.faults))
        events = list(_events(client, dictionary, counters.events))
    except wire.WireError as error:
        raise LinkError(f"{client.url}: {error}") from None
    trips = {row.name: n for row, n in zip(dictionary.faults, counters.trips) if n}
    return Log(counters, trips, events)


def _events(client: Client, dictionary: Dictionary, count: int) -> Iterator[Event]:
    before: int | None = None
    for row in range(count):
        reply = client.ask(Op.LIST, struct.pack("<BH", wire.EVENTS, row))
        if reply.status == Status.STATE:
            return
        if reply.status == Status.ID:  # it has been emptied, or this one is damaged
            continue
        if reply.status != Status.DONE:
            raise client.refused(reply, "log")
        found = wire.parse_event(reply.payload, row)
        if before is None or found.sequence < before:  # else a new event has moved the rows
            before = found.sequence
            yield _named(found, client, dictionary)


def _named(one: wire.Event, client: Client, dictionary: Dictionary) -> Event:
    name = EVENTS.get(one.event, f"event {one.event}")
    causes = dictionary.causes(one.faults) + warnings(one.warnings)
    if one.event == firmware.HT_EVENT_START:
        causes = [reset_cause(one.reset)]
    schemes = dictionary.parameters["scheme"].choices
    scheme = schemes[one.scheme] if one.scheme < len(schemes) else str(one.scheme)
    return Event(
        one.sequence, name, one.powered_s, one.gates_s, causes, client.state(one.state).name,
        scheme, limits(one.limits), one.vdc_V, dict(zip(PHASES, one.currents_A)), one.speed_rpm,
        *(None if math.isnan(degC := getattr(one, name)) else degC for name in TEMPERATURES),
    )  # fmt: skip


def forget_log(client: Client) -> None:
    """Empty the log of its events; the counters stay."""
    reply = client.ask(Op.FORGET_LOG)
    if reply.status == Status.DONE:
        return
    state = client.state(reply.state)
    if reply.status == Status.STATE and state.at_work:
        raise LinkError(
            "empty the log: only while the gates are off; stop the drive first "
            f"(state {state.name})",
            reply.status,
        )
    raise client.refused(reply, "empty the log")
