"""`hexatorque board serve`: a virtual board for the other commands to open."""

from __future__ import annotations

import json
import os
import signal
import sys
from contextlib import closing, nullcontext
from pathlib import Path

import click

from ... import system
from .. import options
from ..group import examples
from ..options import Mistake
from ..working import compiling

#: Of a longer recording the end is told before it is written: that takes a while.
LONG_S = 60.0


@click.command(
    epilog=examples(
        "board serve",
        "board serve --setup paper-b --load 1 --link board",
        "board serve --set sensors.i_noise_A=0.02",
        "board serve --store bench.store",
        "board serve --fast 5",
        "board serve --break u1=open@5",
        "board serve --trip-pin 5",
        "board serve --machine mps2-an386",
        "board serve --xcp 5555",
        note="In another terminal: hexatorque board start --speed 400",
    )
)
@options.setup("paper-a-feasible")
@options.settings
@options.value(
    "--load",
    metavar="NM",
    type=options.number,
    help="torque of a brake on the shaft; default: none",
)
@options.value(
    "--machine",
    metavar="NAME",
    help="run the firmware on an emulated processor: mps2-an386 (Cortex-M4F), mps2-an500 "
    "(Cortex-M7)",
)
@options.baud
@options.value(
    "--fast",
    metavar="N",
    type=options.number,
    default=1.0,
    help="run N times as fast as the clock, and the line as well",
)
@options.file(
    "--store",
    metavar="FILE",
    help="the board's memory for `board params keep`: made if missing; default: none",
)
@options.value(
    "--break",
    "breaks",
    metavar="PHASE=KIND",
    type=options.break_given,
    multiple=True,
    help="this phase's leg is open, blocked, or its upper or lower switch is dead; u1=open@2.5: "
    "from 2.5 s on. May be repeated",
)
@options.value(
    "--trip-pin",
    "pulls",
    metavar="S[+LENGTH]",
    type=options.trip_pin_given,
    multiple=True,
    help="the power stage pulls the trip pin low after S seconds, for 1 ms or LENGTH seconds. May "
    "be repeated",
)
@options.value(
    "--xcp",
    metavar="PORT",
    type=int,
    help="an XCP slave on this TCP and UDP port of this computer as well; 5555 is XCP's own, 0 any",
)
@options.value(
    "--tcp",
    metavar="PORT",
    type=options.http_port,
    help="a TCP port of this computer in place of a pseudo-terminal; 0: a free one. On Windows "
    "there is nothing else",
)
@options.file("--link", metavar="PATH", help="a fixed name for the pseudo-terminal")
@options.file("--record", metavar="FILE", help="the simulation's own recording")
@options.as_json
def serve(
    setup,
    settings,
    load,
    machine,
    baud,
    fast,
    store,
    breaks,
    pulls,
    tcp,
    xcp,
    link,
    record,
    as_json,
) -> int:
    """A virtual board: firmware and plant behind a serial port.

    Runs firmware and plant in one process that serves the serial protocol on a pseudo-terminal or
    a TCP port, as the image on a DSP does on its serial port. Prints the port. Ends with Ctrl-C.
    """
    from ...boards.own_recording import OwnRecording
    from ...boards.virtual import TRIP_PIN_S
    from ...boards.virtual import serve as serve_board
    from ...boards.xcp_port import XcpPort
    from ...recording.formats import check_output
    from ...serial import runtime

    if record is not None:
        check_output(record)
    ended = []
    with compiling():
        made = _make(setup, settings, load, machine, baud, fast, store)
    network = nullcontext() if xcp is None else closing(XcpPort(xcp))
    with made as board, network as port, _line(tcp) as line, _name(link, line.port):
        for sign in system.ENDING:
            signal.signal(sign, lambda *_: ended.append(True))
        if load is not None:
            board.sim.set("load_Nm", load)
        for phase, kind, after_s in breaks:
            board.sim.break_leg(phase, kind, after_s)
        for after_s, for_s in pulls:
            board.pull_trip_pin(after_s, for_s or TRIP_PIN_S)
        announcement = runtime.Announcement(line.port, board.title, board.controller.baud)
        own = None if record is None else OwnRecording(board.sim, record, _tell)
        try:
            if as_json:
                facts = {"port": line.port, "baud": board.controller.baud, "title": board.title,
                         "parameters": board.controller.parameter_set}  # fmt: skip
                if port is not None:
                    facts["xcp"] = port.number
                said = json.dumps(facts)
            else:
                said = f"{board.title} on {link or line.port}, Ctrl-C ends it"
                if store:
                    said += f"\nparameters: {board.controller.parameter_set} ({store})"
                if port is not None:
                    said += f"\nXCP: TCP and UDP port {port.number}"
            print(said, flush=True)
            serve_board(board, line, until=lambda: bool(ended), record=own, xcp=port)
        finally:
            announcement.close()
        if own is not None:
            if own.seconds > LONG_S:
                _tell(f"writing {own.seconds:.0f} s to {record}")
            own.close()
            _tell(f"recording: {', '.join(map(str, own.paths))}")
    return 0


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _make(name, settings, load, machine, baud, fast, store):
    from ... import setups

    setup = setups.load(name).changed(options.settings_given(settings))
    if load is not None and setup["load.kind"] == "constant":
        # One that pulls would drag an idle machine along, which could then not be started.
        setup = setup.changed(load__kind="friction")
    if machine is None:
        from ...boards.virtual import VirtualBoard

        return VirtualBoard(setup, baud, fast, store)
    from ...boards.emulated import EmulatedBoard

    return EmulatedBoard(setup, machine, baud, fast, store=store)


def _line(tcp: int | None):
    from ...boards.virtual import new_line
    from ...serial.port import not_listening

    try:
        return new_line(tcp)
    except OSError as error:
        raise Mistake(f"--tcp {tcp}: {not_listening(error)}") from None


class _name:
    """A symbolic link while it is needed."""

    def __init__(self, path: Path | None, port: str) -> None:
        self._path = path
        self._port = port

    def __enter__(self) -> None:
        from ...serial.runtime import announced

        if self._path is None:
            return
        if "://" in self._port:
            raise Mistake(f"--link {self._path}: a TCP port has no other name")
        if self._path.is_symlink() and system.is_pseudo_terminal(self._target()):
            if self._target() in (board.port for board in announced()):
                raise Mistake(f"{self._path}: is the name of another board that runs")
            self._path.unlink()  # of a board that was killed
        try:
            self._path.symlink_to(self._port)
        except OSError as error:
            raise Mistake(f"{self._path}: {error.strerror}") from None

    def __exit__(self, *_: object) -> None:
        if self._path is not None and self._target() == self._port:
            self._path.unlink(missing_ok=True)

    def _target(self) -> str:
        if self._path is None:
            return ""
        try:
            return os.readlink(self._path)
        except OSError:
            return ""
