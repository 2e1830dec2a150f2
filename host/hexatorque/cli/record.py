"""Commands that record a board: `stream`, `capture` and `watch`."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .link import (
    before_start,
    before_start_options,
    command,
    console_for,
    open_drive,
    say,
    seconds,
    set_values,
    tripped,
    until_told,
)

#: Samples per second of what only an eye looks at.
WATCH_HZ = 200.0


def add(commands: argparse._SubParsersAction) -> None:
    stream = command(
        commands,
        "stream",
        "record channels into a file as they come; Ctrl-C ends it",
        _stream,
        "stream i_u1_A torque_Nm speed_rpm --rate 2000 -o run.csv",
    )
    stream.add_argument("channel", nargs="+", metavar="CH")
    pace = stream.add_mutually_exclusive_group()
    pace.add_argument("--rate", type=float, metavar="HZ", help="default: what the line carries")
    pace.add_argument("--decimation", type=int, metavar="N", help="every N-th fast interrupt")
    stream.add_argument("--duration", type=seconds, metavar="S", help="default: until Ctrl-C")
    _started(stream)

    capture = command(
        commands,
        "capture",
        "capture channels into the board's memory, at every fast interrupt, and bring them over",
        _capture,
        "capture i_u1_A i_v1_A torque_Nm --samples 4000 --pre 1000 \\\n"
        "      --trigger rising:torque_Nm:5 -o step.npz",
    )
    capture.add_argument("channel", nargs="+", metavar="CH")
    capture.add_argument("--samples", type=int, default=1000, metavar="N", help="default: 1000")
    capture.add_argument("--pre", type=int, default=0, metavar="N", help="before the trigger")
    capture.add_argument(
        "--prescaler", type=int, default=1, metavar="N", help="one sample in N interrupts"
    )
    capture.add_argument(
        "--trigger",
        default="manual",
        metavar="T",
        help="rising:CH:LEVEL, falling:…, above:…, below:…, fault, command, manual (at once)",
    )
    capture.add_argument(
        "--timeout", type=seconds, metavar="S", help="give up after; default: until Ctrl-C"
    )
    _started(capture)

    watch = command(
        commands,
        "watch",
        "channels as moving curves in the terminal; Ctrl-C ends it",
        _watch,
        "watch speed_rpm torque_Nm",
    )
    watch.add_argument("channel", nargs="+", metavar="CH")
    watch.add_argument("--window", type=seconds, default=5.0, metavar="S", help="default: 5 s")
    watch.add_argument("--duration", type=seconds, metavar="S", help="default: until Ctrl-C")


def _started(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--start", action="store_true", help="start the drive first, stop it after")
    before_start_options(parser)


@contextmanager
def running(args: argparse.Namespace, drive) -> Iterator[None]:
    """The drive as --start and its company ask for; stopped in the end if it was started."""
    set_values(drive, before_start(args))
    if not args.start:
        yield
        return
    drive.start()
    try:
        yield
    finally:
        drive.stop()


def _stream(args: argparse.Namespace) -> int:
    from ..drive.recorder import Recorder
    from ..recording.formats import check_output
    from ..serial import BOARD_RESET

    check_output(args.output)
    console = console_for(args)
    with until_told() as told, open_drive(args) as drive, running(args, drive):
        faulted = not args.start and drive.state == "fault"  # before: it does not trip here
        stream = drive.stream(args.channel, args.rate, args.decimation)
        wanted = None if args.duration is None else max(1, round(args.duration * stream.rate_Hz))
        console.print(f"{len(stream.channels)} channels at {stream.rate_Hz:.6g} Hz")
        with stream, Recorder(drive, args.output, stream) as recorder:
            _write(drive, stream, recorder, wanted, told, console)
            state, faults = drive.state, drive.faults
            ended = BOARD_RESET if stream.ended else "user" if told.is_set() else "duration"
            path = recorder.close(ended, state=state, faults=faults)
    summary = {
        "file": str(path),
        "samples": recorder.samples,
        "rate_Hz": stream.rate_Hz,
        "gaps": stream.gaps,
        "lost_samples": stream.lost,
        **drive.line_counters(),
        "state": state,
        "faults": faults,
        "ended": ended,
    }
    say(args, summary)
    if stream.ended:
        print(f"hexatorque: {stream.ended}", file=sys.stderr)
        return 1
    return 0 if faulted else tripped(state, faults)


def _write(drive, stream, recorder, wanted: int | None, told: threading.Event, console) -> None:
    """Until so many samples are written, told, or the board is reset."""
    from ..serial import LinkError

    plugged = True
    while not told.is_set() and (wanted is None or recorder.samples < wanted):
        try:
            block = stream.read(0.1)
        except LinkError:
            if stream.ended is None:
                raise
            return
        if plugged != drive.client.transport.plugged:
            plugged = not plugged
            console.print("back again" if plugged else "unplugged: waiting for the board")
        if block is not None:
            ticks, values = block
            if wanted is not None:
                left = wanted - recorder.samples
                ticks, values = ticks[:left], values[:left]
            recorder.put(ticks, values)


def _capture(args: argparse.Namespace) -> int:
    from ..recording.formats import check_output

    check_output(args.output)
    with until_told(at_once=True), open_drive(args) as drive:
        drive.arm(args.channel, args.samples, args.pre, args.trigger, args.prescaler)
        try:
            with running(args, drive):
                recording = drive.captured(args.timeout, args.trigger == "manual")
        except BaseException:
            drive.cancel()
            raise
    recording.save(args.output)
    summary = {
        "file": str(args.output),
        "samples": len(recording),
        "rate_Hz": recording.rate_Hz,
        "trigger_tick": recording.meta["trigger_tick"],
        "state": recording.meta["state"],
        "faults": recording.meta["faults"],
    }
    say(args, summary)
    return tripped(summary["state"], summary["faults"]) if args.start else 0


def _watch(args: argparse.Namespace) -> int:
    import numpy as np
    from rich.live import Live

    from .curves import Curves

    with until_told() as told, open_drive(args) as drive:
        rate_Hz = min(WATCH_HZ, drive.hello.f_isr_Hz)
        with drive.stream(args.channel, rate_Hz=rate_Hz) as stream:
            units = [stream.units[name] for name in stream.channels]
            curves = Curves(stream.channels, units, args.window)
            end = None if args.duration is None else time.monotonic() + args.duration
            with Live(console=console_for(args), auto_refresh=False) as live:
                while not told.wait(0.1) and (end is None or time.monotonic() < end):
                    for ticks, values in stream.waiting():
                        curves.add(ticks / stream.f_isr_Hz, values)
                    if stream.ended:
                        raise stream.ended
                    live.update(curves.drawn(live.console.width), refresh=True)
    if args.json:
        latest = curves.latest()
        print(json.dumps({n: v for n, v in zip(stream.channels, np.asarray(latest).tolist())}))
    return 0
