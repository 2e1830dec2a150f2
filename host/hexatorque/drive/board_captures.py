"""Burst captures: what triggers them, and bringing them over."""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Sequence

import numpy as np

from ..recording.recording import RecordingError
from ..serial import LinkError, wire
from ..serial.client import Client
from ..serial.dictionary import Dictionary
from ..serial.wire import CaptureReply, CaptureState, Hello, Op
from .captures import Trigger, check

#: Without data for so long, what is missing is asked for again.
QUIET_S = 0.15
#: So often in a row without anything new.
PATIENCE = 6
#: Values asked for at a time: a fifth of a second at 1.25 Mbaud.
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
    """Set the board's capture; returns its number."""
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


def wait(client: Client, timeout_s: float | None, manual: bool) -> CaptureReply:
    """Until the capture is complete. `manual`: trigger it as soon as that counts."""
    end = None if timeout_s is None else time.monotonic() + timeout_s
    while True:
        at = client.get_status().capture
        if at == CaptureState.COMPLETE:
            return state(client)
        if at == CaptureState.NONE:
            raise LinkError("capture: none is armed")
        if at == CaptureState.WAITING and manual:
            client.do(Op.TRIGGER, what="trigger")
            manual = False
        if end is not None and time.monotonic() > end:
            what = CaptureState(at).name.lower()
            raise LinkError(f"capture: not complete within {timeout_s:g} s ({what})")
        time.sleep(0.02)


def upload(client: Client, capture: CaptureReply) -> np.ndarray:
    """(samples, channels) float32 of a complete capture, the oldest first."""
    total = capture.samples * len(capture.channels)
    values = np.zeros(total, np.float32)
    there = np.zeros(total, bool)

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
                there[first : first + len(chunk)] = True
                heard_s = time.monotonic()

    silence = client.listen(sink)
    try:
        fruitless = 0
        while not there.all():
            first = int(np.argmin(there))
            behind = there[first : first + READ_VALUES]
            count = int(np.argmax(behind)) if behind.any() else len(behind)
            before = int(there.sum())
            client.do(Op.READ, struct.pack("<II", first, count), "capture")
            heard_s = time.monotonic()
            while not there[first : first + count].all():
                if time.monotonic() - heard_s > QUIET_S:
                    break
                time.sleep(0.002)
            fruitless = 0 if there.sum() > before else fruitless + 1
            if fruitless == PATIENCE:
                raise LinkError(f"{client.url}: the board does not send the capture's data")
    finally:
        silence()
    if zlib.crc32(values.astype("<f4").tobytes()) != capture.crc:
        raise LinkError(f"{client.url}: the capture's CRC does not fit its data")
    return values.reshape(capture.samples, len(capture.channels))
