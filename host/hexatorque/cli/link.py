"""Commands for a board on the serial link, virtual or real."""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .common import console_of

PORT = """
The port is found by itself if there is one board; see `hexatorque devices`. All hexatorque
commands share a port.
"""


def seconds(text: str) -> float:
    """An option's time."""
    with suppress(ValueError):
        if 0 < float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"{text!r}: a time above 0 s is needed")


def baud(text: str) -> int:
    """An option's line rate."""
    if text.isdecimal() and int(text) > 0:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r}: a rate above 0 is needed")


def command(to, name: str, help: str, call, example: str) -> argparse.ArgumentParser:
    """A command that talks to one board."""
    parser = to.add_parser(
        name,
        help=help,
        description=f"{help[0].upper()}{help[1:]}.",
        epilog=f"example:\n  hexatorque {example}\n{PORT}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    if name != "devices":
        parser.add_argument(
            "--device",
            metavar="PORT",
            help="/dev/ttyUSB0, socket://host:port; default: the only board",
        )
    parser.add_argument("--baud", type=baud, metavar="N", help="default: those of the images")
    parser.add_argument("--json", action="store_true", help="result on standard output")
    parser.set_defaults(call=call)
    return parser


def add(commands: argparse._SubParsersAction) -> None:
    command(
        commands,
        "devices",
        "boards that answer on serial ports, and virtual ones",
        _devices,
        "devices",
    )
    command(commands, "status", "state, faults and counters of the drive", _status, "status --json")
    start = command(
        commands,
        "start",
        "start the drive and guard it; Ctrl-C or SIGTERM stops it",
        _start,
        "start --scheme ddr --speed 400",
    )
    before_start_options(start)
    start.add_argument("--duration", type=seconds, metavar="S", help="default: until Ctrl-C")
    command(commands, "stop", "stop the drive, whoever started it", _stop, "stop")
    command(commands, "clear", "clear the latched faults", _clear, "clear")
    speed = command(commands, "speed", "set the speed reference", _speed, "speed 400")
    speed.add_argument("speed", type=float, metavar="RPM")
    scheme = command(commands, "scheme", "set the control scheme", _scheme, "scheme ddr")
    scheme.add_argument("scheme", metavar="NAME")

    params = commands.add_parser(
        "params",
        help="list, get, set, save and load the parameters of a board, and have it keep them",
        description="The parameters of a board, by its own list. `save` and `load` are a file on "
        "this computer; `keep` and `forget` are the board's own memory, which survives power-off.",
    ).add_subparsers(dest="action", metavar="ACTION", required=True)
    command(params, "list", "all parameters with value, unit, range", _list, "params list")
    get = command(params, "get", "values of parameters", _get, "params get rs_ohm scheme")
    get.add_argument("name", nargs="+", metavar="NAME")
    set_ = command(
        params, "set", "set parameters, all or none", _set, "params set rs_ohm=1.7 scheme=ddr"
    )
    set_.add_argument("value", nargs="+", metavar="NAME=VALUE")
    save = command(params, "save", "write all parameters to a file", _save, "params save b.toml")
    save.add_argument("file", type=Path, metavar="FILE.toml")
    load = command(
        params, "load", "set what a file names, all or none", _load, "params load b.toml"
    )
    load.add_argument("file", type=Path, metavar="FILE.toml")
    command(
        params, "keep", "the board keeps its parameters over a power-off; gates off only",
        _keep, "params keep",
    )  # fmt: skip
    command(
        params, "forget", "the board forgets what it kept and starts with built-in parameters",
        _forget, "params forget",
    )  # fmt: skip


def before_start_options(parser: argparse.ArgumentParser) -> None:
    """What is set before a start."""
    parser.add_argument("--scheme", metavar="NAME")
    parser.add_argument("--speed", type=float, metavar="RPM")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="any other parameter"
    )


# -- helpers ----------------------------------------------------------------------------


def open_drive(args: argparse.Namespace):
    """To import what a drive needs takes as long as to find the board: both at once."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        client = pool.submit(_client, args.device, args.baud)
        from ..drive.board import BoardDrive

        return BoardDrive(client.result())


def _client(url: str | None, baud: int | None):
    from ..serial import BAUDS, runtime
    from ..serial.client import Client

    if url is None:
        from ..serial import devices

        found = devices.only(baud)
        url, baud = found.port, found.baud
    return Client(url, baud or runtime.bauds_for(url, BAUDS))


def console_for(args: argparse.Namespace):
    return console_of(args.json, highlight=False)


def tripped(state: str, faults: list[str]) -> int:
    """The exit code after a drive has run."""
    if state == "fault":
        print(f"hexatorque: the drive tripped: {', '.join(faults)}", file=sys.stderr)
        return 1
    return 0


def say(args: argparse.Namespace, data: dict, text: str | None = None) -> int:
    if args.json:
        print(json.dumps(data, indent=1))
    elif text is not None:
        print(text)
    else:
        for key, value in data.items():
            print(f"{key:>16}  {value:.6g}" if isinstance(value, float) else f"{key:>16}  {value}")
    return 0


def _assignments(texts: list[str]) -> dict[str, object]:
    """NAME=VALUE; a value that is a number is one, whatever the parameter makes of it."""
    from ..serial import LinkError

    values: dict[str, object] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise LinkError(f"{text!r}: write NAME=VALUE", mistake=True)
        values[name.strip()] = value.strip()
    return values


def set_values(drive, values: dict[str, object]) -> None:
    """Set values that may be text: numbers where the parameter takes numbers."""
    from ..serial import LinkError

    typed = dict(values)
    for name, value in values.items():
        row = drive.params.get(name)
        if row is not None and not row.choices and isinstance(value, str):
            try:
                typed[name] = float(value)
            except ValueError:
                raise LinkError(f"{name} = {value!r}: a number is needed", mistake=True) from None
    drive.set_many(typed)


def before_start(args: argparse.Namespace) -> dict[str, object]:
    values: dict[str, object] = {}
    if args.scheme is not None:
        values["scheme"] = args.scheme
    if args.speed is not None:
        values["speed_ref_rpm"] = args.speed
    return {**values, **_assignments(args.set)}


@contextmanager
def until_told(at_once: bool = False) -> Iterator[threading.Event]:
    """Set by Ctrl-C and SIGTERM, so that work ends where it may; a second one interrupts,
    or the first `at_once`."""
    told = threading.Event()

    def tell(*_: object) -> None:
        if at_once or told.is_set():
            raise KeyboardInterrupt
        told.set()

    before = {number: signal.signal(number, tell) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield told
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# -- commands -----------------------------------------------------------------------------


def _devices(args: argparse.Namespace) -> int:
    from rich.table import Table

    from ..serial import devices

    found = devices.find(args.baud)
    if args.json:
        print(json.dumps([vars(board) for board in found], indent=1))
        return 0 if found else 1
    if not found:
        print("hexatorque: no board found", file=sys.stderr)
        return 1
    table = Table()
    for heading in ("port", "device", "build", "baud", "what it is"):
        table.add_column(heading)
    for board in found:
        where = f"{board.where}, in use by other clients" if board.shared else board.where
        table.add_row(board.port, board.device, board.build, str(board.baud), where)
    console_for(args).print(table)
    return 0


def _status(args: argparse.Namespace) -> int:
    from ..drive.board import parameter_set
    from ..serial.wire import CaptureState

    with open_drive(args) as drive:
        status = drive.client.get_status()
        capture = status.capture
        data = {
            "port": drive.client.url,
            "device": drive.hello.device,
            "build": drive.hello.build,
            "state": drive.state,
            "faults": drive.faults,
            "parameters": parameter_set(status.set),
            "guarded": status.guarded,
            "session": status.in_session,
            "capture": CaptureState(capture).name.lower() if capture < 6 else capture,
            "damaged": status.damaged,
            "overruns": status.overruns,
            "dropped": status.dropped,
            "latest_fault": drive.snapshot,
        }
    if args.json:
        return say(args, data)
    data["faults"] = ", ".join(data["faults"]) or "none"
    snapshot = data.pop("latest_fault")
    say(args, data)
    if snapshot:
        print(f"{'latest fault':>16}  tick {snapshot['tick']}: {', '.join(snapshot['faults'])}")
    return 0


def _start(args: argparse.Namespace) -> int:
    console = console_for(args)
    with until_told() as told, open_drive(args) as drive:
        set_values(drive, before_start(args))
        drive.start()
        end = None if args.duration is None else time.monotonic() + args.duration
        was = ""
        while not told.is_set() and (end is None or time.monotonic() < end):
            now = drive.state
            if now != was:
                console.print(f"{drive.time_s:8.2f} s  {now}")
            was = now
            if now in ("idle", "fault"):
                break
            told.wait(0.1)
        faults = drive.faults
        if was not in ("idle", "fault"):
            drive.stop()
    if args.json:
        print(json.dumps({"state": was, "faults": faults}))
    if drive.resets:
        from ..serial import RESET_VALUES

        print(f"hexatorque: the board was reset; {RESET_VALUES}", file=sys.stderr)
        return 1
    if was == "idle":
        console.print("stopped by somebody else")
    return tripped(was, faults)


def _stop(args: argparse.Namespace) -> int:
    with open_drive(args) as drive:
        drive.stop()
        return say(args, {"state": drive.state}, f"{drive.client.url}: {drive.state}")


def _clear(args: argparse.Namespace) -> int:
    with open_drive(args) as drive:
        drive.clear()
        return say(args, {"state": drive.state}, f"{drive.client.url}: {drive.state}")


def _speed(args: argparse.Namespace) -> int:
    return _change(args, {"speed_ref_rpm": args.speed})


def _scheme(args: argparse.Namespace) -> int:
    return _change(args, {"scheme": args.scheme})


def _set(args: argparse.Namespace) -> int:
    return _change(args, _assignments(args.value))


def _change(args: argparse.Namespace, values: dict[str, object]) -> int:
    with open_drive(args) as drive:
        set_values(drive, values)
        return say(args, drive.get_many(list(values)))


def _get(args: argparse.Namespace) -> int:
    with open_drive(args) as drive:
        return say(args, drive.get_many(args.name))


def _list(args: argparse.Namespace) -> int:
    from rich.table import Table

    with open_drive(args) as drive:
        values = drive.get_all()
        rows = drive.params
        started_with = drive.parameter_set
    if args.json:
        data = {
            name: {
                "value": values[name], "unit": row.unit, "min": row.min, "max": row.max,
                "choices": row.choices, "live": row.live, "help": row.help,
            }
            for name, row in rows.items()
        }  # fmt: skip
        return say(args, data)
    table = Table(caption=f"the board started with its parameters {started_with}")
    for heading in ("name", "value", "unit", "allowed", "while running", "what it is"):
        table.add_column(heading)
    for name, row in rows.items():
        value = values[name]
        shown = f"{value:.6g}" if isinstance(value, float) else value
        allowed = ", ".join(row.choices) or f"{row.min:g} .. {row.max:g}"
        table.add_row(name, shown, row.unit, allowed, "yes" if row.live else "no", row.help)
    console_for(args).print(table)
    return 0


def _save(args: argparse.Namespace) -> int:
    from ..recording.recording import RecordingError

    with open_drive(args) as drive:
        values = drive.get_all()
        head = f"# {drive.hello.device}, {drive.hello.build}, {drive.dictionary.crc:08x}\n"
        rows = drive.params
    lines = [
        f"{name} = {json.dumps(value)}" + (f"  # {rows[name].unit}" if rows[name].unit else "")
        for name, value in values.items()
    ]
    try:
        args.file.parent.mkdir(parents=True, exist_ok=True)
        args.file.write_text(head + "[parameters]\n" + "\n".join(lines) + "\n")
    except OSError as error:
        raise RecordingError(f"{args.file}: {error.strerror}") from None
    return say(args, {"file": str(args.file), "parameters": len(values)})


def _keep(args: argparse.Namespace) -> int:
    with open_drive(args) as drive:
        drive.store_parameters()
        return say(
            args, {"kept": True},
            f"{drive.client.url}: kept; the board starts with these parameters from now on "
            "(references start at their built-in values)",
        )  # fmt: skip


def _forget(args: argparse.Namespace) -> int:
    with open_drive(args) as drive:
        drive.forget_parameters()
        return say(
            args, {"kept": False},
            f"{drive.client.url}: forgotten; the board starts with its built-in parameters from "
            "now on, those in force stay until then",
        )  # fmt: skip


def _load(args: argparse.Namespace) -> int:
    """Only what differs is set: others may be such that cannot change now."""
    values = _parameters_of(args.file)
    with open_drive(args) as drive:
        before = drive.get_many(list(values))
        changed = {
            name: value
            for name, value in values.items()
            if drive.params[name].parse(value) != drive.params[name].parse(before[name])
        }
        drive.set_many(changed)
    return say(args, {"file": str(args.file), "changed": {n: values[n] for n in changed}})


def _parameters_of(path: Path) -> dict[str, object]:
    import tomllib

    from ..serial import LinkError

    try:
        data = tomllib.loads(path.read_text())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise LinkError(f"{path}: {reason}", mistake=True) from None
    values = data.get("parameters")
    if set(data) != {"parameters"} or not isinstance(values, dict):
        raise LinkError(f"{path}: one table [parameters] is needed", mistake=True)
    return values
