"""`hexatorque board`: a virtual board to open with the link's commands."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path

from .common import compiling
from .link import baud

EXAMPLES = """examples:
  hexatorque board --virtual                       paper A's machine; prints the port
  hexatorque board --virtual --setup paper-b --load 1 --link /tmp/board
  hexatorque board --virtual --store bench.store   keeps what `hexatorque params keep` keeps
  hexatorque board --virtual --fast 5              five times as fast as the clock
  hexatorque board --virtual --machine mps2-an386  the firmware on an emulated Cortex-M4F
in another terminal:
  hexatorque start --speed 400
"""


def add(commands: argparse._SubParsersAction) -> None:
    board = commands.add_parser(
        "board",
        help="a virtual board: firmware and plant behind a serial port",
        description="Run firmware and plant in one process that serves the serial protocol on a "
        "pseudo-terminal, as the image on a DSP does on its serial port. Ends with Ctrl-C.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    board.add_argument("--virtual", action="store_true", help="required: what else runs here")
    board.add_argument("--setup", default="paper-a-feasible", metavar="NAME|FILE")
    board.add_argument("--load", type=float, metavar="NM", help="brake on the shaft; default: none")
    board.add_argument(
        "--machine", metavar="NAME",
        help="firmware and link on an emulated processor: mps2-an386, mps2-an500",
    )  # fmt: skip
    board.add_argument("--baud", type=baud, metavar="N", help="default: the device's own")
    pace = board.add_mutually_exclusive_group()
    pace.add_argument("--realtime", action="store_true", help="as fast as the clock (default)")
    pace.add_argument(
        "--fast", type=float, default=1.0, metavar="N", help="N times as fast; so is the line"
    )
    board.add_argument(
        "--store", type=Path, metavar="FILE",
        help="the board's memory for `params keep`: made if missing; default: it has none",
    )  # fmt: skip
    board.add_argument("--link", type=Path, metavar="PATH", help="a fixed name for the port")
    board.add_argument(
        "--record", type=Path, metavar="FILE", help="the simulation's own recording, at the end"
    )
    board.add_argument("--json", action="store_true", help="the port as JSON, in one line")
    board.set_defaults(call=_board)


def _board(args: argparse.Namespace) -> int:
    import json

    from .. import setups
    from ..boards.virtual import Terminal, serve
    from ..recording.formats import check_output
    from ..serial import runtime

    if not args.virtual:
        raise setups.SetupError(
            "board: say --virtual; a real board needs no command: plug it in, `hexatorque devices`"
        )
    if args.record is not None:
        check_output(args.record)
    ended = []
    with compiling():
        made = _make(args)
    with made as board, Terminal() as line, _name(args.link, line.port):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: ended.append(True))
        if args.load is not None:
            board.sim.set("load_Nm", args.load)
        file = runtime.announce(line.port, board.title, board.controller.baud)
        try:
            if args.json:
                said = json.dumps({"port": line.port, "baud": board.controller.baud,
                                   "title": board.title,
                                   "parameters": board.controller.parameter_set})  # fmt: skip
            else:
                said = f"{board.title} on {args.link or line.port}, Ctrl-C ends it"
                if args.store:
                    said += f"\nparameters: {board.controller.parameter_set} ({args.store})"
            print(said, flush=True)
            serve(board, line, until=lambda: bool(ended), record=args.record is not None)
        finally:
            file.unlink(missing_ok=True)
        if args.record is not None:
            board.take().save(args.record)
            print(f"recording: {args.record}", file=sys.stderr)
    return 0


def _make(args: argparse.Namespace):
    from .. import setups

    setup = setups.load(args.setup)
    if args.load is not None and setup["load.kind"] == "constant":
        # One that pulls would drag an idle machine along, which could then not be started.
        setup = setup.changed(load__kind="friction")
    if args.machine is None:
        from ..boards.virtual import VirtualBoard

        return VirtualBoard(setup, args.baud, args.fast, args.store)
    from ..boards.emulated import EmulatedBoard

    return EmulatedBoard(setup, args.machine, args.baud, args.fast, store=args.store)


class _name:
    """A symbolic link while it is needed."""

    def __init__(self, path: Path | None, port: str) -> None:
        self._path = path
        self._port = port

    def __enter__(self) -> None:
        from ..serial.runtime import announced
        from ..setups import SetupError

        if self._path is None:
            return
        if self._path.is_symlink() and self._target().startswith("/dev/pts/"):
            if self._target() in (board.port for board in announced()):
                raise SetupError(f"{self._path}: is the name of another board that runs")
            self._path.unlink()  # of a board that was killed
        try:
            self._path.symlink_to(self._port)
        except OSError as error:
            raise SetupError(f"{self._path}: {error.strerror}") from None

    def __exit__(self, *_: object) -> None:
        if self._path is not None and self._target() == self._port:
            self._path.unlink(missing_ok=True)

    def _target(self) -> str:
        try:
            return os.readlink(self._path)
        except OSError:
            return ""
