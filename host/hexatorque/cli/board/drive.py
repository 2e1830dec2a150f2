"""Commands for the drive of a board: find it, see how it is, start, stop and set it."""

from __future__ import annotations

import time

import click

from .. import completion, options
from ..group import examples
from ..output import complain, console_of, print_json, say, tripped
from .connection import assignments, before_start, open_drive, start_drive, until_signal


@click.command("list", epilog=examples("board list"))
@options.baud
@options.as_json
def list_boards(baud, as_json) -> int:
    """Boards that answer on serial ports, and virtual ones."""
    from rich.table import Table

    from ...serial import devices

    found, busy = devices.find(baud)
    for port in busy:
        complain(str(port))
    if as_json:
        print_json([vars(board) for board in found])
        return 0 if found else 1
    if not found:
        complain(devices.NONE)
        return 1
    table = Table()
    for heading in ("port", "device", "build", "baud", "what it is"):
        table.add_column(heading)
    for board in found:
        where = f"{board.where}, in use by other clients" if board.shared else board.where
        table.add_row(board.port, board.device, board.build, str(board.baud), where)
    console_of(as_json, highlight=False).print(table)
    return 0


@click.command(epilog=examples("board status --json"))
@options.board
@options.as_json
def status(device, baud, as_json) -> int:
    """State, faults, warnings and counters of the drive."""
    from ...drive.board import parameter_set
    from ...firmware import warnings
    from ...serial.wire import CaptureState

    with open_drive(device, baud) as drive:
        status = drive.client.get_status()
        capture = status.capture
        faults, snapshot, reset = drive.faults, drive.snapshot, drive.reset
        limits = drive.limits
        now = drive.latest(("warnings", "torque_limit_Nm", "speed_rpm"))
        warned = now and warnings(int(now["warnings"]))
        data = {
            "port": drive.client.url,
            "device": drive.hello.device,
            "build": drive.hello.build,
            "reset": reset and reset.cause,
            "watchdog_resets": reset and reset.watchdogs,
            "state": drive.state,
            "speed_rpm": now and now["speed_rpm"],
            "faults": faults,
            "warnings": warned,
            "torque_limit_Nm": now and now["torque_limit_Nm"],
            "limits": limits,
            "parameters": parameter_set(status.set),
            "guarded": status.guarded,
            "session": status.in_session,
            "capture": CaptureState(capture).name.lower()
            if capture < len(CaptureState)
            else capture,
            "damaged": status.damaged,
            "overruns": status.overruns,
            "dropped": status.dropped,
        }
    if as_json:
        say(as_json, {**data, "latest_fault": snapshot})
        return 0
    told = "not known: other clients use the streams" if warned is None else ", ".join(warned)
    left = "not known" if now is None else f"{now['torque_limit_Nm']:.3g}"
    speed = "not known" if now is None else f"{now['speed_rpm']:.1f}"
    words = {
        "reset": "not known" if reset is None else reset.cause,
        "watchdog_resets": "not known" if reset is None else str(reset.watchdogs),
        "speed_rpm": speed,
        "faults": ", ".join(faults),
        "warnings": told,
        "torque_limit_Nm": left,
        "limits": "not known" if limits is None else ", ".join(_since(limits)),
    }
    say(as_json, data | {name: text or "none" for name, text in words.items()})
    if snapshot:
        print(f"{'latest fault':>16}  tick {snapshot['tick']}: {', '.join(snapshot['faults'])}")
    return 0


def _since(limits: dict[str, float]) -> list[str]:
    """Limits that act, and for how long."""
    return [f"{name} (for {seconds:.1f} s)" for name, seconds in limits.items()]


@click.command(
    epilog=examples("board start --scheme ddr --speed 400", "board start --set build_s=1")
)
@options.before_start
@options.duration
@options.board
@options.as_json
def start(duration, device, baud, as_json, **before) -> int:
    """Start the drive and guard it; Ctrl-C or SIGTERM stops it.

    The gates switch and the machine turns. If this command dies, the board stops by itself.
    """
    from ...firmware import IDLE, State

    console = console_of(as_json, highlight=False)
    values = before_start(**before)
    with until_signal() as ended, open_drive(device, baud) as drive:
        start_drive(drive, values)
        end = None if duration is None else time.monotonic() + duration
        was = State("")
        acted: dict[str, float] = {}
        while was.at_work and not ended.is_set() and (end is None or time.monotonic() < end):
            now = drive.condition
            if now != was:
                console.print(f"{drive.time_s:8.2f} s  {now.name}")
            was = now
            limits = drive.limits or {}
            for name in limits.keys() ^ acted.keys():
                what = "acts" if name in limits else "acts no more"
                began_s = drive.time_s - limits.get(name, 0.0)
                console.print(f"{began_s:8.2f} s  limit: {name} {what}")
            acted = limits
            # Where a board does not tell what its states are, each may be at work: a fault ends it.
            if drive.faults:
                was = drive.condition  # it may have tripped since the look above
                break
            if now.at_work:
                ended.wait(0.1)
        faults, trip = drive.faults, drive.trip
        if was.at_work:
            drive.stop()
    if as_json:
        print_json(
            {
                "state": was.name,
                "faults": faults,
                "trip": trip.as_json() if trip else None,
                "stopped": str(drive.stopped) if drive.stopped else None,
            }
        )
    if drive.resets:
        from ...serial import RESET_VALUES

        complain(f"the board was reset; {RESET_VALUES}")
        return 1
    if drive.stopped:
        complain(str(drive.stopped))
        return 1
    if was.name == IDLE:
        console.print("stopped by somebody else")
    return tripped(was.name, faults, trip)


@click.command(epilog=examples("board stop"))
@options.board
@options.as_json
def stop(device, baud, as_json) -> int:
    """Stop the drive, whoever started it."""
    with open_drive(device, baud) as drive:
        drive.stop()
        say(as_json, {"state": drive.state}, f"{drive.client.url}: {drive.state}")
    return 0


@click.command(epilog=examples("board clear"))
@options.board
@options.as_json
def clear(device, baud, as_json) -> int:
    """Clear the latched faults."""
    with open_drive(device, baud) as drive:
        drive.clear()
        say(as_json, {"state": drive.state}, f"{drive.client.url}: {drive.state}")
    return 0


@click.command("set", epilog=examples("board set speed=400", "board set rs_ohm=1.7 scheme=ddr"))
@click.argument(
    "values",
    metavar="NAME=VALUE...",
    nargs=-1,
    required=True,
    shell_complete=completion.assignment,
    help="parameters with their new values",
)
@options.board
@options.as_json
def set_parameters(values, device, baud, as_json) -> int:
    """Set parameters, all or none; a drive that runs follows at once.

    `speed` is short for speed_ref_rpm, `torque` for torque_ref_Nm. `hexatorque board params list`
    shows all parameters and their ranges.
    """
    wanted = assignments(values)
    with open_drive(device, baud) as drive:
        drive.set_many(wanted)
        say(as_json, drive.get_many(list(wanted)))
    return 0
