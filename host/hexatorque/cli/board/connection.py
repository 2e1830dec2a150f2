"""A board as the commands of this group use it: found, opened, set, watched until a signal."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from ...errors import HexatorqueError
from ...given import parameter_name
from ..options import Mistake

if TYPE_CHECKING:
    from ...drive.board import BoardDrive
    from ...serial.client import Client

#: Short names of what an operator changes most.
SHORT_NAMES = {"speed": "speed_ref_rpm", "torque": "torque_ref_Nm"}


def open_drive(device: str | None, baud: int | None) -> BoardDrive:
    """Importing takes as long as finding the board, so both are done in parallel."""
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


def full_name(name: str) -> str:
    """A parameter's name from a short name, or from a set-up's key controller.NAME."""
    name = parameter_name(name)
    return SHORT_NAMES.get(name, name)


def assignments(texts: Iterable[str]) -> dict[str, object]:
    """NAME=VALUE, or controller.NAME=VALUE as in a set-up. The values stay text: the drive knows
    what its parameter makes of it."""
    values: dict[str, object] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise Mistake(f"{text!r}: write NAME=VALUE")
        values[full_name(name)] = value
    return values


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


def start_drive(drive: BoardDrive, values: dict[str, object]) -> None:
    """Set values and start. If the start is refused, all values are as before. Mistake if the drive
    would trip on the way to its speed reference."""
    from ...drive.trips import WAY_TO_SPEED, too_fast
    from ...firmware import IDLE

    # A START is allowed in the state idle only. A board of protocol 2.0 does not tell that idle is
    # not at work: there, this first START would begin with the values of before.
    now = drive.condition
    if now.at_work and now.name != IDLE:
        drive.start()  # is refused, with the reason
    known = [name for name in values if name in drive.params]
    before = drive.get_many(list(dict.fromkeys([*WAY_TO_SPEED, *known])))
    wanted = {**before, **_allowed(drive, values)}
    start_mode, control_mode, asked_rpm, trip_rpm = (wanted[name] for name in WAY_TO_SPEED)
    if too_fast(start_mode, control_mode, asked_rpm, trip_rpm):
        raise Mistake(
            f"speed_ref_rpm = {asked_rpm:g} r/min: the drive would trip at speed_trip_rpm = "
            f"{trip_rpm:g} r/min"
        )
    drive.set_many(values)
    try:
        drive.start()
    except HexatorqueError:
        with suppress(HexatorqueError):  # the line may be gone
            drive.set_many({name: before[name] for name in known})
        raise


def _allowed(drive: BoardDrive, values: dict[str, object]) -> dict:
    """As they are read back. One that the drive will refuse is left out."""
    found = {}
    for name in drive.params.keys() & values.keys():
        with suppress(HexatorqueError):
            row = drive.params[name]
            found[name] = row.show(row.parse(values[name]))
    return found


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
