"""A drive on a board. It has the same methods as `simulated.SimulatedDrive` and runs in real time.

with BoardDrive.open("/dev/ttyUSB0") as drive:
    drive.set("scheme", "ddr")
    drive.start()
    drive.run(0.6)
    drive.set("speed_ref_rpm", 400)
    drive.run(1.0)
    recording = drive.take()

At the end of the block the client closes its session, and a drive that was started in it stops.
If the process dies, the board's watchdog stops the drive.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from types import MappingProxyType

import numpy as np

from .. import __version__
from ..firmware import (
    LIMITS,
    PARAMETER_SETS,
    FirmwareError,
    Parameter,
    Snapshot,
    State,
    misfit_text,
    row_of,
    warnings,
)
from ..given import pairs, parameter_name
from ..recording.journal import TICK_HZ
from ..recording.recording import DECIMATION, FIRST_TICK, STARTED, Recording, clock_text
from ..serial import BAUDS, BOARD_RESET, LinkError, LinkInputError, clock, runtime, wire
from ..serial.client import Client, Stopped
from ..serial.dictionary import fetch, fetch_reset
from ..serial.stream import Stream, decimation_for, on_a_grid
from ..serial.wire import Op, Status
from . import board_captures, captures, limiting, log
from .interface import DriveVerbs, Progress, finite, seconds

#: Quantities of a profile that the board cannot set: the test bench has to.
PLANT = {"load_Nm": "N m", "vdc_V": "V"}
#: `latest`: fast interrupts per sample, which any line carries, and how long it waits for one.
LATEST_DECIMATION, LATEST_S = 200, 1.0


class BoardDrive(DriveVerbs):
    """A drive on a serial line, with the methods of a simulated drive. Use `open` to get one.

    hello: what the board says of itself: `device`, `build`, `f_isr_Hz`, `watchdog_ms` and its
    limits; dictionary: its parameters, channels, faults and states; record: the channels that `run`
    records; operator: see `open`; client: the connection, for requests of one's own. Every error of
    the line is a LinkError; a wrong name or value is an InputError too.
    """

    @classmethod
    def open(
        cls,
        url: str | None = None,
        baud: int | None = None,
        record: Sequence[str] | None = None,
        rate_Hz: float | None = None,
        operator: Callable[[str, float], None] | None = None,
    ) -> BoardDrive:
        """Connect to a board.

        url: a device, a pseudo-terminal or `socket://host:port`. Without it, the only board
        that answers is taken; LinkError if there are none or several.
        baud: the baud rate. Without it, the rates of the supplied images are tried.
        record, rate_Hz: the channels and the rate that `run` records. The default is as many
        channels as a stream can have, at the highest rate that the line carries.
        operator(name, value): called when a profile changes `load_Nm` or `vdc_V`, because only
        the test bench can change these.
        """
        if url is None:
            from ..serial.devices import only

            found = only(baud)
            url, baud = found.port, found.baud
        bauds = (baud,) if baud else runtime.bauds_for(url, BAUDS)
        return cls(Client(url, bauds), record, rate_Hz, operator)

    def __init__(
        self,
        client: Client,
        record: Sequence[str] | None = None,
        rate_Hz: float | None = None,
        operator: Callable[[str, float], None] | None = None,
    ) -> None:
        if not isinstance(client, Client):
            raise LinkInputError(f"client = {client!r}: BoardDrive.open(PORT) connects to a board")
        self.client = client
        self._recorder: Stream | None = None
        try:
            self.hello, self.dictionary = fetch(self.client)
            self.operator = operator
            if record is None:
                record = [row.name for row in self.dictionary.channels]
                record = record[: self.hello.stream_channels]
            self.dictionary.channel_ids(record)
            self.record = tuple(record)
            if rate_Hz is not None:
                decimation_for(self.hello.f_isr_Hz, rate_Hz)  # refuse a wrong rate at once
            self._rate_Hz = rate_Hz
            self.client.on_return.append(self._same_board)
            self._opened_tick = self._now_tick()
            self.client.on_forgotten.append(self._board_restarted)
            self._since_tick = self._opened_tick
            self._opened_s = time.monotonic()
            self._opened_wall_s = time.time()
            self._armed: clock.Reading | None = None
        except BaseException:
            self.client.close()
            raise

    def _same_board(self) -> None:
        """After an interruption, check that the board runs the same firmware as before."""
        hello = self.client.hello()
        if hello.crc != self.dictionary.crc:
            raise LinkError(
                f"{self.client.url}: the board now runs another firmware; open the drive again",
                mistake=True,
            )

    def _board_restarted(self) -> None:
        self._opened_tick = 0

    def _now_tick(self) -> int:
        return self._latest().tick

    def close(self) -> None:
        self.client.close()

    @property
    def resets(self) -> int:
        """How often the board was reset since this drive was opened, as the board reports it.
        A reset sets the parameters to their saved or initial values and ends all streams."""
        return self.client.resets

    @property
    def on_reset(self) -> list[Callable[[], None]]:
        """Functions that are called after a reset, once the board answers again. They do not
        run in the thread that reads the line, so they may send requests. They must return soon,
        because the heartbeat waits for them."""
        return self.client.on_reset

    # -- properties ------------------------------------------------------------------------

    @property
    def params(self) -> Mapping[str, Parameter]:
        return MappingProxyType(self.dictionary.parameters)

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        return tuple((row.name, row.unit) for row in self.dictionary.channels)

    @property
    def time_s(self) -> float:
        return time.monotonic() - self._opened_s

    def _time_of_tick(self, tick: int) -> float:
        ticks = (tick - self._opened_tick) & 0xFFFFFFFF
        if ticks >= 0x80000000:  # before the drive was opened here
            ticks -= 0x100000000
        return ticks / self.hello.f_isr_Hz

    @property
    def condition(self) -> State:
        return self.client.state(self._latest().state)

    @property
    def faults(self) -> list[str]:
        self.client.get_status()
        return self.dictionary.causes(self.client.faults)

    def _latest(self) -> wire.Reply:
        """A new reply. Every one has the state and the faults."""
        self.client.get_status()
        assert self.client.latest
        return self.client.latest

    @property
    def reset(self) -> wire.Reset | None:
        """Why the board started, and how often a watchdog has reset it; None: it does not tell."""
        return fetch_reset(self.client)

    @property
    def snapshot(self) -> Snapshot | None:
        try:
            found = wire.parse_snapshot(self.client.do(Op.SNAPSHOT).payload)
        except wire.WireError as error:
            raise LinkError(f"{self.client.url}: SNAPSHOT: {error}") from None
        if found is None:
            return None
        if self.dictionary.minor >= wire.MINOR_OF_FAULTS:
            kept = self.client.fault_words().kept
            if kept & wire.LOW_FAULTS == found["faults"]:  # no other fault has come in between
                found["faults"] = kept
        return {
            **found,
            "state": self.client.state(found["state"]).name,
            "faults": self.dictionary.causes(found["faults"]),
            "warnings": warnings(found["warnings"]),
        }

    @property
    def log(self) -> log.Log | None:
        """The board's log of events and its counters; None: it has none."""
        if self.dictionary.minor < wire.MINOR_OF_LOG:
            return None
        return log.fetch_log(self.client, self.dictionary)

    def forget_log(self) -> None:
        """Empty the board's log of its events. The counters stay."""
        log.forget_log(self.client)

    @property
    def limits(self) -> dict[str, float] | None:
        """The limits that act, and for how many seconds; None: the board does not tell."""
        if self.dictionary.minor < wire.MINOR_OF_LOG:
            return None
        return limiting.acting(self.client, self.hello.f_isr_Hz)

    # -- parameters --------------------------------------------------------------------------

    def _parameter(self, name: str) -> Parameter:
        """LinkInputError if there is none of this name, or of the set-up's key controller.NAME."""
        try:
            return row_of(self.params, name)
        except FirmwareError as error:
            raise LinkInputError(str(error)) from None

    def get(self, name: str) -> str | float:
        return self.get_many([name])[parameter_name(name)]

    def get_many(self, names: list[str]) -> dict[str, str | float]:
        """The values of these parameters, name -> number in its unit, or the name of a choice."""
        rows = [self._parameter(name) for name in names]
        values: dict[str, str | float] = {}
        for at in range(0, len(rows), wire.GET_MOST):
            part = rows[at : at + wire.GET_MOST]
            ids = struct.pack(f"<{len(part)}H", *(row.id for row in part))
            reply = self.client.do(Op.GET, ids, "get")
            numbers = self._numbers(f"{len(part)}f", reply.payload, "GET")
            values.update((row.name, _shown(row, v)) for row, v in zip(part, numbers))
        return values

    def get_all(self) -> dict[str, str | float]:
        """The values of all parameters."""
        return self.get_many(list(self.params))

    def set_many(self, values: Mapping[str, object]) -> None:
        """Write several parameters. The board takes over all of them in one fast interrupt, or
        none if it refuses one. Of more than a request holds, those are written that change. The
        error is a LinkError; if a name or a value is wrong it is an InputError too, and names the
        nearest parameter or the allowed range."""
        values = {parameter_name(name): value for name, value in pairs(values).items()}
        if not values:
            return
        if self.operator and len(values) == 1 and (name := next(iter(values))) in PLANT:
            number = finite(values[name])
            if number is None:
                raise LinkInputError(f"{name} = {values[name]}: a finite number is needed")
            self.operator(name, number)
            return
        for name in values:
            if name in PLANT:
                raise LinkInputError(f"{name}: belongs to the test bench, a board cannot set it")
        rows = [self._parameter(name) for name in values]
        try:
            numbers = [row.parse(value) for row, value in zip(rows, values.values())]
        except FirmwareError as error:
            raise LinkInputError(str(error)) from None
        wanted = np.array(numbers, np.float32)
        if len(rows) > wire.WRITE_MOST:  # those that are in force already need not be written
            present = self.get_many([row.name for row in rows])
            other = [np.float32(r.parse(present[r.name])) != v for r, v in zip(rows, wanted)]
            rows, wanted = [row for row, o in zip(rows, other) if o], wanted[other]
            if not rows:
                return
            if len(rows) > wire.WRITE_MOST:
                raise LinkError(
                    f"{len(rows)} parameters at once: up to {wire.WRITE_MOST}", mistake=True
                )
        payload = b"".join(struct.pack("<Hf", row.id, number) for row, number in zip(rows, wanted))
        reply = self.client.ask(Op.WRITE, payload)
        if reply.status != Status.DONE:
            raise self._refused(reply, values)
        self.taken_tick, *now = self._numbers(f"I{len(rows)}f", reply.payload, "WRITE")
        for row, asked, got in zip(rows, wanted, now):
            if asked != np.float32(got):
                raise LinkError(f"{row.name}: {got:g} is in force instead of {asked:g}")

    def store_parameters(self) -> None:
        """Save the present parameters on the board, except the references. The board starts with
        them from now on. It refuses to save while the gates are on."""
        self._write_store(Op.SAVE, "keep the parameters")

    def forget_parameters(self) -> None:
        """Delete the saved parameters. The board starts with its built-in ones from now on. The
        present values do not change."""
        self._write_store(Op.FORGET, "forget the parameters")

    def _write_store(self, op: Op, what: str) -> None:
        reply = self.client.ask(op)
        if reply.status == Status.DONE:
            return
        if reply.status == Status.STORE and reply.payload == b"\xff\xff":
            raise LinkError(
                f"{what}: this image keeps no parameters: built without a store (a virtual board: "
                "started without --store FILE)",
                reply.status,
            )
        if reply.status == Status.STATE:
            state = self.client.state(reply.state)
            why = (
                "only while the gates are off; stop the drive first"
                if state.at_work
                else "not while the board streams or captures; end that first"
            )
            raise LinkError(f"{what}: {why} (state {state.name})", reply.status)
        raise self.client.refused(reply, what)

    @property
    def parameter_set(self) -> str:
        """The set of parameters that the board took when it started. Parameters that were
        written or saved later do not change this."""
        return parameter_set(self.client.get_status().set)

    def _refused(self, reply: wire.Reply, values: Mapping[str, object]) -> LinkError:
        """The error for a refused WRITE: it names the parameter and the allowed range."""
        what = ", ".join(f"{name} = {value}" for name, value in values.items())
        if len(reply.payload) == 2:
            (id,) = struct.unpack("<H", reply.payload)
            if reply.status == Status.CONFIG:
                text = misfit_text(id, lambda n: values[n] if n in values else self.get(n))
                return LinkInputError(f"{what}: {text}", reply.status)
            for name, row in self.params.items():
                if row.id != id:
                    continue
                what = f"{name} = {values.get(name)}"
                if reply.status == Status.VALUE:
                    allowed = (
                        f"one of {', '.join(row.choices)}"
                        if row.choices
                        else f"{row.min:.9g} .. {row.max:.9g} {row.unit}".rstrip()
                        + (", whole numbers only" if row.whole else "")
                    )
                    return LinkInputError(f"{what}: allowed is {allowed}", reply.status)
                if reply.status == Status.STATE:
                    state = self.client.state(reply.state)
                    why = (
                        "can change only while the gates are off"
                        if state.at_work
                        else "can change only after the trip is cleared: hexatorque board clear"
                    )
                    return LinkError(f"{what}: {why} (state {state.name})", reply.status)
        return self.client.refused(reply, what)

    def _numbers(self, layout: str, payload: bytes, what: str) -> tuple:
        try:
            return wire.unpack(layout, payload)
        except wire.WireError as error:
            raise LinkError(f"{self.client.url}: {what}: {error}") from None

    # -- commands ------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the drive. If this process ends, the board stops the drive by itself."""
        self.client.stopped = None
        self.client.do(Op.START, what="start")

    @property
    def stopped(self) -> Stopped | None:
        """The drive was stopped because this process did not run for a while after `start`."""
        return self.client.stopped

    def check(self) -> None:
        """Raise DriveFault if the drive has tripped, and LinkError if it was stopped because this
        process did not run for a while."""
        super().check()
        if self.stopped:
            raise LinkError(str(self.stopped))

    def stop(self) -> None:
        self.client.do(Op.STOP, what="stop")

    def clear(self) -> None:
        self.client.do(Op.CLEAR, what="clear")

    # -- time and recordings -------------------------------------------------------------------

    def run(self, duration_s: float, record: bool = True, progress: Progress | None = None) -> None:
        """Wait for `duration_s` of real time, and record unless `record` is False. This does not
        check the board's state; `check` does."""
        if not record:
            self.discard()
        elif self._recorder is None:
            self._recorder = self.stream(self.record, self._rate_Hz)
            self._since_tick = self._opened_tick
        duration_s = seconds(duration_s)
        begin = done = time.monotonic()
        while (left := begin + duration_s - time.monotonic()) > 0:
            time.sleep(min(left, 0.05))
            if self.client.broken:
                raise self.client.broken
            if self._recorder and self._recorder.ended:
                raise self._recorder.ended
            if progress:
                now = time.monotonic()
                progress(min(now, begin + duration_s) - min(done, begin + duration_s))
                done = now

    def discard(self) -> None:
        if self._recorder:
            self._recorder.close()
            self._recorder = None

    def take(self) -> Recording:
        """End the recording and return it. Its time axis comes from the board's ticks. Time 0 is
        when the drive was opened or, if that was later, the board's latest reset. Lost samples
        are NaN."""
        recorder = self._recorder
        if recorder is None:
            raise LinkError("nothing was recorded", mistake=True)
        self.discard()
        blocks = recorder.waiting()
        ticks = np.concatenate([np.empty(0, np.int64), *(t for t, _ in blocks)])
        values = np.concatenate(
            [np.empty((0, len(recorder.channels)), np.float32), *(v for _, v in blocks)]
        )
        grid = on_a_grid(ticks, values, recorder.decimation)
        first = int(ticks[0]) if len(ticks) else self._since_tick
        start_s = ((first - self._since_tick) & 0xFFFFFFFF) / recorder.f_isr_Hz
        meta = {
            **self.meta(),
            STARTED: clock_text(self._opened_wall_s),
            FIRST_TICK: first,
            DECIMATION: recorder.decimation,
            TICK_HZ: recorder.f_isr_Hz,
            "gaps": recorder.gaps,
            "lost_samples": recorder.lost,
            "damaged_samples": recorder.damaged,
            **({"ended": BOARD_RESET} if recorder.ended else {}),
        }
        return self._recording(recorder.rate_Hz, recorder.channels, grid, meta, start_s)

    def _recording(
        self, rate_Hz: float, names: Sequence[str], table: np.ndarray, meta: dict, start_s: float
    ) -> Recording:
        units = {row.name: row.unit for row in self.dictionary.channels}
        data = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}
        return Recording(rate_Hz, data, {name: units[name] for name in names}, meta, start_s)

    def meta(self) -> dict:
        """Metadata for a recording: the board's identity, all parameters, the error counters."""
        status = self.client.get_status()
        state, faults = self.state, self.faults
        values = self.get_all()
        return {
            "hexatorque": __version__,
            "device": self.hello.device,
            "build": self.hello.build,
            "dictionary": f"{self.dictionary.crc:08x}",
            "port": self.client.url,
            "scheme": values.get("scheme"),
            "parameters": {"controller": values},
            "state": state,
            "faults": faults,
            "limits": {str(bit): name for bit, name in LIMITS.items()},
            **self.line_counters(),
            "board_counters": {
                "damaged": status.damaged,
                "overruns": status.overruns,
                "dropped": status.dropped,
            },
        }

    def clock(self, earlier: clock.Reading | None = None) -> clock.Clock:
        """The relation between the board's tick and this computer's clock, read now."""
        return clock.Clock(self.hello.f_isr_Hz, clock.read(self.client), earlier)

    def line_counters(self) -> dict[str, int]:
        """Errors on the line that this computer has counted."""
        return {
            "crc_errors": self.client.damaged,
            "retries": self.client.counters.retries,
            "reconnects": self.client.counters.reconnects,
        }

    def _can_follow(self, names: AbstractSet[str], breaks: bool) -> None:
        if breaks:
            raise LinkError("profile: broken: only a simulated drive can break a leg", mistake=True)
        if not self.operator and names & set(PLANT):
            raise LinkError(
                f"profile: {', '.join(sorted(names & set(PLANT)))}: a board cannot set this; "
                "open the drive with an operator that can",
                mistake=True,
            )
        for name in names - set(PLANT):
            self._parameter(name)

    def stream(
        self,
        channels: tuple[str, ...] | list[str],
        rate_Hz: float | None = None,
        decimation: int | None = None,
    ) -> Stream:
        """Open a stream of samples. `decimation` is in fast interrupts per sample. Give either
        `rate_Hz` or `decimation`; without both the stream is as fast as the line allows."""
        if rate_Hz is not None and decimation is not None:
            raise LinkError("rate_Hz and decimation: give one of them", mistake=True)
        self.hello = self.client.hello()  # f_isr_Hz is a parameter
        if rate_Hz is not None:
            decimation = decimation_for(self.hello.f_isr_Hz, rate_Hz)
        return Stream(self.client, self.hello, self.dictionary, channels, decimation)

    @property
    def warnings(self) -> list[str] | None:
        """The drive's warnings, until `clear` or the next start. None if other clients use all
        streams or the whole line."""
        now = self.latest(("warnings",))
        return None if now is None else warnings(int(now["warnings"]))

    def latest(self, names: Sequence[str]) -> dict[str, float] | None:
        """The channels' values now, name -> number in its unit. None if other clients use all
        streams or the whole line."""
        try:
            with self.stream(tuple(names), rate_Hz=self.hello.f_isr_Hz / LATEST_DECIMATION) as one:
                block = one.read(LATEST_S)
        except LinkError as error:
            if error.mistake:
                return None
            raise
        return None if block is None else dict(zip(names, map(float, block[1][-1])))

    # -- captures --------------------------------------------------------------------------------

    def arm(
        self,
        channels: Sequence[str],
        samples: int,
        pre: int = 0,
        trigger: str = "manual",
        prescaler: int = 1,
    ) -> None:
        board_captures.arm(
            self.client, self.hello, self.dictionary, channels, samples, pre, trigger, prescaler
        )
        self._armed = clock.read(self.client, 1)

    def trigger(self) -> None:
        self.client.do(Op.TRIGGER, what="trigger")

    def cancel(self) -> None:
        self.client.do(Op.CANCEL, what="cancel")

    def captured(
        self,
        timeout_s: float | None = None,
        now: bool = False,
        full: Callable[[], None] | None = None,
        uploaded: Callable[[float], None] | None = None,
        started: bool = False,
    ) -> Recording:
        """As for every drive. `uploaded` is called with the share of the data that has come.
        `started`: for this capture; LinkError if the drive ends before the trigger."""
        dictionary = self.dictionary if started else None
        found = board_captures.wait(self.client, timeout_s, now, dictionary)
        if full:
            full()
        return self._upload(found, uploaded)

    def _upload(
        self, found: wire.CaptureReply, uploaded: Callable[[float], None] | None
    ) -> Recording:
        self.hello = self.client.hello()  # f_isr_Hz is a parameter
        when = self.clock(self._armed).when(found.tick)  # the clocks drift: read this at once
        table = board_captures.upload(self.client, found, uploaded)
        rate_Hz = self.hello.f_isr_Hz / found.prescaler
        names = [self.dictionary.channels[id].name for id in found.channels]
        meta = {
            **self.meta(),
            **when,
            **captures.metadata(found.tick, found.pre, found.prescaler, self.hello.f_isr_Hz),
        }
        return self._recording(rate_Hz, names, table, meta, -found.pre / rate_Hz)


def parameter_set(number: int) -> str:
    """The text for STATUS's number of the parameter set."""
    return PARAMETER_SETS[number] if number < len(PARAMETER_SETS) else str(number)


def _shown(row: Parameter, value: float) -> str | float:
    """The value as a person would write it: the shortest decimal number with this float32."""
    if row.choices and value == int(value) and 0 <= value < len(row.choices):
        return row.show(value)
    return float(str(np.float32(value))) if math.isfinite(value) else value
