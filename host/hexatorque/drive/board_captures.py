"""Burst captures on a board: arm them, wait for them, upload them."""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Callable, Sequence

import numpy as np

from ..recording.recording import RecordingError
from ..serial import LinkError, wire
from ..serial.client import Client
from ..serial.dictionary import Dictionary
from ..serial.wire import CaptureReply, CaptureState, Hello, Op
from .captures import Trigger, check

#: If no data came for this long, the missing values are requested again.
QUIET_S = 0.15
#: The upload fails after this many requests in a row that brought no new value.
MOST_FRUITLESS = 6
#: Values per request: a fifth of a second at 1.25 Mbaud.
READ_VALUES = 6000


def arm(
    client: Client,
    hello: Hello,
    dictionary: Dictionary,
    channels: Sequence[str],
    samples: int,
    pre: int,
    trigger: str,
    prescaler: int,
) -> int:
    """Arm the board's capture. Returns its number. LinkError for settings out of range."""
    try:
        what = Trigger.parse(trigger)
        check(samples, pre, prescaler)
    except RecordingError as error:
        raise LinkError(str(error), mistake=True) from None
    ids = dictionary.channel_ids(channels)
    if not 1 <= len(ids) <= hello.capture_channels:
        raise LinkError(
            f"{len(ids)} channels: a capture has 1 to {hello.capture_channels}", mistake=True
        )
    most = hello.memory // len(ids)
    if samples > most:
        raise LinkError(
            f"samples = {samples}: allowed range is 1 .. {most} with {len(ids)} channels",
            mistake=True,
        )
    (on,) = dictionary.channel_ids((what.channel,)) if what.channel else (0,)
    payload = struct.pack(
        f"<BBHIIHf{len(ids)}H",
        len(ids), what.number, prescaler, samples, pre, on, what.level, *ids,
    )  # fmt: skip
    return client.do(Op.ARM, payload).payload[0]


def state(client: Client) -> CaptureReply:
    try:
        return wire.parse_capture(client.do(Op.CAPTURE).payload)
    except wire.WireError as error:
        raise LinkError(f"{client.url}: CAPTURE: {error}") from None


def wait(
    client: Client, timeout_s: float | None, manual: bool, dictionary: Dictionary | None = None
) -> CaptureReply:
    """Wait until the capture is complete. `manual`: send TRIGGER as soon as the samples before
    the trigger are there. `dictionary`: its drive has been started for this capture. LinkError
    after `timeout_s` (None: never), if none is armed, or if that drive ends before the trigger."""
    end = None if timeout_s is None else time.monotonic() + timeout_s
    ended = False
    while True:
        at = client.get_status().capture
        if at == CaptureState.COMPLETE:
            return state(client)
        if client.stopped:
            raise LinkError(str(client.stopped))
        if at == CaptureState.NONE:
            raise LinkError("capture: none is armed")
        if dictionary and at in (CaptureState.FILLING, CaptureState.WAITING):
            now = _ended(client, dictionary)
            if now and ended:  # once more: the end may be what triggers
                raise LinkError(f"capture: {now} before the trigger")
            ended = bool(now)
        if at == CaptureState.WAITING and manual:
            client.do(Op.TRIGGER, what="trigger")
            manual = False
        if end is not None and time.monotonic() > end:
            what = CaptureState(at).name.lower()
            raise LinkError(f"capture: not complete within {timeout_s:g} s ({what})")
        time.sleep(0.02)


def _ended(client: Client, dictionary: Dictionary) -> str:
    """How the drive has ended, by the latest reply; "" while it is at work."""
    assert client.latest
    now = client.state(client.latest.state)
    if now.at_work:
        return ""
    causes = ", ".join(dictionary.causes(client.faults))
    return f"the drive tripped ({causes})" if causes else f"the drive stopped (state {now.name})"


def upload(
    client: Client, capture: CaptureReply, progress: Callable[[float], None] | None = None
) -> np.ndarray:
    """Read a complete capture: (samples, channels) float32, oldest sample first. LinkError if
    data stay away or the CRC is wrong. `progress` is called with the share that has come."""
    total = capture.samples * len(capture.channels)
    values = np.zeros(total, np.float32)
    arrived = np.zeros(total, bool)

    heard_s = time.monotonic()

    def sink(bodies: list[bytes]) -> None:
        nonlocal heard_s
        for body in bodies:
            try:
                number, first, chunk = wire.parse_data(body)
            except wire.WireError:
                client.counters.damaged += 1
                continue
            if number == capture.number and first + len(chunk) <= total:
                values[first : first + len(chunk)] = chunk
                arrived[first : first + len(chunk)] = True
                heard_s = time.monotonic()

    stop_listening = client.listen(sink)
    try:
        fruitless = 0
        while not arrived.all():
            first = int(np.argmin(arrived))
            part = arrived[first : first + READ_VALUES]
            count = int(np.argmax(part)) if part.any() else len(part)
            before = int(arrived.sum())
            if progress:
                progress(before / total)
            client.do(Op.READ, struct.pack("<II", first, count), "capture")
            heard_s = time.monotonic()
            while not arrived[first : first + count].all():
                if time.monotonic() - heard_s > QUIET_S:
                    break
                time.sleep(0.002)
            fruitless = 0 if arrived.sum() > before else fruitless + 1
            if fruitless == MOST_FRUITLESS:
                raise LinkError(f"{client.url}: the board does not send the capture's data")
    finally:
        stop_listening()
    if zlib.crc32(values.astype("<f4").tobytes()) != capture.crc:
        raise LinkError(f"{client.url}: the capture's CRC does not fit its data")
    return values.reshape(capture.samples, len(capture.channels))
