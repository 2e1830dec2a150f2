"""A board as the commands of this group use it: found, opened, set, watched until a signal."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ..options import Mistake, real

if TYPE_CHECKING:
    from ...drive.board import BoardDrive
    from ...serial.client import Client

#: Short names of what an operator changes most.
SHORT_NAMES = {"speed": "speed_ref_rpm", "torque": "torque_ref_Nm"}


def open_drive(device: str | None, baud: int | None) -> BoardDrive:
    """To import what a drive needs takes as long as to find the board: both at once."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        client = pool.submit(_client, device, baud)
        from ...drive.board import BoardDrive

        return BoardDrive(client.result())


def _client(url: str | None, baud: int | None) -> Client:
    from ...serial import BAUDS, runtime
    from ...serial.client import Client

    if url is None:
        from ...serial import devices

        found = devices.only(baud)
        url, baud = found.port, found.baud
    return Client(url, baud or runtime.bauds_for(url, BAUDS))


def assignments(texts: Iterable[str]) -> dict[str, object]:
    """NAME=VALUE with the values as text; what a parameter makes of it is known by the board."""
    values: dict[str, object] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise Mistake(f"{text!r}: write NAME=VALUE")
        values[SHORT_NAMES.get(name, name)] = value
    return values


def set_values(drive: BoardDrive, values: dict[str, object]) -> None:
    """Set values that may be text: numbers where the parameter takes numbers, choices in capital
    or small letters."""
    typed = dict(values)
    for name, value in values.items():
        row = drive.params.get(name)
        if row is None or not isinstance(value, str):
            continue
        if row.choices:
            typed[name] = next((one for one in row.choices if one.lower() == value.lower()), value)
            continue
        try:
            typed[name] = real(value)
        except ValueError:
            raise Mistake(f"{name} = {value!r}: a number is needed") from None
    drive.set_many(typed)


def before_start(
    scheme: str | None, speed: float | None, others: Sequence[str]
) -> dict[str, object]:
    """The parameters that --scheme, --speed and --set ask for."""
    values: dict[str, object] = {}
    if scheme is not None:
        values["scheme"] = scheme
    if speed is not None:
        values["speed_ref_rpm"] = speed
    return {**values, **assignments(others)}


@contextmanager
def until_signal(at_once: bool = False) -> Iterator[threading.Event]:
    """Set by Ctrl-C and SIGTERM, so that work ends where it may; a second one interrupts,
    or the first `at_once`."""
    ended = threading.Event()

    def end(*_: object) -> None:
        if at_once or ended.is_set():
            raise KeyboardInterrupt
        ended.set()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
