"""`hexatorque board monitor`: a board in a browser on this computer."""

from __future__ import annotations

import threading
from pathlib import Path

import click

from ... import system
from .. import options
from ..group import examples
from ..options import Mistake
from ..output import complain
from .connection import open_drive, until_signal


@click.command(epilog=examples("board monitor"))
@options.value(
    "--port",
    metavar="P",
    type=options.http_port,
    default="0",
    help="port of the page; 0: a free one",
)
@click.option("--no-browser", is_flag=True, help="print the address only")
@options.file(
    "-o", "--output", metavar="DIR", default=Path("out/monitor"), help="folder for recordings"
)
@options.board
def monitor(port, no_browser, output, device, baud) -> int:
    """A local web page with a board's traces, parameters and commands.

    Serves a web page on 127.0.0.1: live traces, parameters, start and stop, burst captures,
    recordings. Ctrl-C ends it and stops a drive that was started there.
    """
    from ...monitor.monitored_drive import MonitoredDrive
    from ...monitor.server import Server
    from ...serial.port import not_listening

    with (
        until_signal() as ended,
        open_drive(device, baud) as drive,
        MonitoredDrive(drive, output, say=complain) as monitored,
    ):
        try:
            server = Server(monitored, port)
        except OSError as error:
            raise Mistake(f"--port {port}: {not_listening(error)}") from None
        with server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            where = f"{drive.hello.device} at {drive.client.url}"
            print(f"{where}; Ctrl-C ends this, and a drive that was started here")
            print(server.url, flush=True)
            if not no_browser:
                _browse(server.url)
            ended.wait()
            server.shutdown()
    return 0


def _browse(url: str) -> None:
    """Open a browser, if there is a screen: one in the terminal would take it over."""
    import webbrowser

    if system.has_screen():
        webbrowser.open(url)
