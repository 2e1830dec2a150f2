"""`hexatorque monitor`: a board in a browser on this computer."""

from __future__ import annotations

import argparse
import os
import sys
import threading
from pathlib import Path

from .link import PORT, baud, open_drive, until_told


def add(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "monitor",
        help="a board's live traces, parameters and commands as a local web page",
        description="Serve a web page on 127.0.0.1: live traces, parameters, start and stop, "
        "burst captures, recordings. Ctrl-C ends it and stops a drive that was started there.",
        epilog=f"example:\n  hexatorque monitor\n{PORT}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--device",
        metavar="PORT",
        help="/dev/ttyUSB0, socket://host:port; default: the only board",
    )
    parser.add_argument("--baud", type=baud, metavar="N", help="default: those of the images")
    parser.add_argument("--port", type=_port, default=0, metavar="P", help="default: a free one")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/monitor"), metavar="DIR",
        help="for recordings; default: out/monitor",
    )  # fmt: skip
    parser.set_defaults(call=_monitor)


def _port(text: str) -> int:
    if text.isdigit() and int(text) < 65536:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r}: allowed range is 0 .. 65535")


def _monitor(args: argparse.Namespace) -> int:
    from ..monitor.desk import Desk
    from ..monitor.server import Server
    from ..serial import LinkError

    with until_told() as told, open_drive(args) as drive, Desk(drive, args.output) as desk:
        try:
            server = Server(desk, args.port)
        except OSError as error:
            reason = error.strerror or error
            raise LinkError(f"--port {args.port}: {reason}", mistake=True) from None
        with server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            print(f"{drive.hello.device} at {drive.client.url}; Ctrl-C ends and stops the drive")
            print(server.url, flush=True)
            if not args.no_browser:
                _browse(server.url)
            told.wait()
            server.shutdown()
    return 0


def _browse(url: str) -> None:
    """Open a browser, if there is a screen: one in the terminal would take it over."""
    import webbrowser

    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(url)
