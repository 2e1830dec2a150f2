"""Commands that record a board: `stream`, `capture` and `watch`."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from .. import options
from ..group import examples
from ..options import Mistake
from ..output import complain, console_of, print_json, say, tripped
from .connection import before_start, open_drive, start_drive, until_signal

if TYPE_CHECKING:
    from rich.console import Console

    from ...drive.board import BoardDrive
    from ...drive.recorder import Recorder
    from ...serial.stream import Stream

#: Samples per second of what only an eye looks at.
WATCH_HZ = 200.0

#: For a recording of a drive that this command starts.
started = options.together(
    click.option("--start", is_flag=True, help="start the drive first, stop it after"),
    options.before_start,
)


@contextmanager
def running(drive: BoardDrive, values: dict[str, object], start: bool) -> Iterator[None]:
    """A drive with these values set; started and in the end stopped if asked for."""
    if not start:
        drive.set_many(values)
        yield
        return
    start_drive(drive, values)
    try:
        yield
    finally:
        drive.stop()


@click.command(epilog=examples("board stream i_u1_A torque_Nm speed_rpm --rate 2000 -o run.csv"))
@options.channels
@options.recording
@options.value(
    "--rate",
    metavar="HZ",
    type=options.number,
    help="samples per second; default: the highest that the line carries",
)
@options.value(
    "--decimation", metavar="N", type=options.whole, help="take every N-th fast interrupt"
)
@options.duration
@started
@options.board
@options.as_json
def stream(
    channels, output, rate, decimation, duration, start, device, baud, as_json, **before
) -> int:
    """Record channels into a file as they come; Ctrl-C ends it."""
    from ...drive.recorder import Recorder
    from ...firmware import FAULT
    from ...recording.formats import check_output
    from ...serial import BOARD_RESET

    if rate is not None and decimation is not None:
        raise Mistake("--decimation: not with --rate")
    check_output(output)
    values = before_start(**before)
    console = console_of(as_json, highlight=False)
    with (
        until_signal() as ended,
        open_drive(device, baud) as drive,
        running(drive, values, start),
    ):
        faulted = not start and drive.state == FAULT  # before: it does not trip here
        stream = drive.stream(channels, rate, decimation)
        wanted = None if duration is None else max(1, round(duration * stream.rate_Hz))
        count = len(stream.channels)
        with stream, Recorder(drive, output, stream) as recorder:
            console.print(f"{count} channel{'s' * (count > 1)} at {stream.rate_Hz:.6g} Hz")
            _write(drive, stream, recorder, wanted, ended, console)
            state, faults, trip = drive.state, drive.faults, drive.trip
            state = drive.state if faults else state  # it may have tripped in between
            why = BOARD_RESET if stream.ended else "user" if ended.is_set() else "duration"
            why = str(drive.stopped or why)
            stream.close()  # its share of the line is free now
            warned = None if stream.ended else drive.warnings
            path = recorder.close(why, state=state, faults=faults, warnings=warned)
    summary = {
        "file": str(path),
        "samples": recorder.samples,
        "rate_Hz": stream.rate_Hz,
        "gaps": stream.gaps,
        "lost_samples": stream.lost,
        **drive.line_counters(),
        "state": state,
        "faults": faults,
        "warnings": warned,
        "ended": why,
    }
    say(as_json, summary if as_json else summary | {"warnings": _told(warned)})
    if stream.ended:
        complain(str(stream.ended))
        return 1
    if drive.stopped:
        complain(why)
        return 1
    return 0 if faulted else tripped(state, faults, trip)


def _told(warned: list[str] | None) -> str:
    return "not known" if warned is None else ", ".join(warned) or "none"


def _write(
    drive: BoardDrive,
    stream: Stream,
    recorder: Recorder,
    wanted: int | None,
    ended: threading.Event,
    console: Console,
) -> None:
    """Until so many samples are written, a signal comes, the board is reset, or the drive was
    stopped because this process did not run."""
    from ...serial import LinkError

    plugged = True
    while not ended.is_set() and (wanted is None or recorder.samples < wanted):
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
            left = len(ticks) if wanted is None else wanted - recorder.samples
            recorder.put(ticks[:left], values[:left])
        if drive.stopped:
            for ticks, values in stream.waiting() if wanted is None else []:
                recorder.put(ticks, values)
            return


@click.command(
    epilog=examples(
        "board capture i_u1_A i_v1_A torque_Nm --samples 4000 --pre 1000 \\\n"
        "      --trigger rising:torque_Nm:5 -o step.npz"
    )
)
@options.channels
@options.recording
@options.value("--samples", metavar="N", type=options.whole, default=1000, help="number of samples")
@options.value(
    "--pre", metavar="N", type=options.whole, default=0, help="samples before the trigger"
)
@options.value(
    "--prescaler", metavar="N", type=options.whole, default=1, help="one sample in N interrupts"
)
@options.value(
    "--trigger",
    metavar="T",
    default="manual",
    help="rising:CH:LEVEL, falling:…, above:…, below:…, fault, command, manual (at once)",
)
@options.value(
    "--timeout",
    metavar="S",
    type=options.seconds,
    help="give up after this time; default: until Ctrl-C, with --start until the drive ends",
)
@started
@options.board
@options.as_json
def capture(
    channels,
    output,
    samples,
    pre,
    prescaler,
    trigger,
    timeout,
    start,
    device,
    baud,
    as_json,
    **before,
) -> int:
    """Capture channels into the board's memory and download them.

    The board takes a sample at every fast interrupt, which no serial line could carry.
    """
    from ...recording.formats import check_output

    check_output(output)
    values = before_start(**before)
    with until_signal(at_once=True), open_drive(device, baud) as drive:
        drive.arm(channels, samples, pre, trigger, prescaler)
        try:
            with running(drive, values, start):
                recording = drive.captured(timeout, trigger == "manual", started=start)
        except BaseException:
            drive.cancel()
            raise
        recording.meta["warnings"] = drive.warnings
    if drive.stopped:
        recording.meta["ended"] = str(drive.stopped)
    recording.save(output)
    summary = {
        "file": str(output),
        "samples": len(recording),
        "rate_Hz": recording.rate_Hz,
        "trigger_tick": recording.meta["trigger_tick"],
        "state": recording.meta["state"],
        "faults": recording.meta["faults"],
        "warnings": recording.meta["warnings"],
    }
    say(as_json, summary if as_json else summary | {"warnings": _told(summary["warnings"])})
    if drive.stopped:
        complain(str(drive.stopped))
        return 1
    return tripped(summary["state"], summary["faults"]) if start else 0


@click.command(epilog=examples("board watch speed_rpm torque_Nm"))
@options.channels
@options.value("--window", metavar="S", type=options.seconds, default=5.0, help="seconds to show")
@options.duration
@options.board
@options.as_json
def watch(channels, window, duration, device, baud, as_json) -> int:
    """Channels as moving curves in the terminal; Ctrl-C ends it."""
    from rich.live import Live

    from .curves import Curves

    with until_signal() as ended, open_drive(device, baud) as drive:
        rate_Hz = min(WATCH_HZ, drive.hello.f_isr_Hz)
        with drive.stream(channels, rate_Hz=rate_Hz) as stream:
            units = [stream.units[name] for name in stream.channels]
            curves = Curves(stream.channels, units, window)
            end = None if duration is None else time.monotonic() + duration
            with Live(console=console_of(as_json, highlight=False), auto_refresh=False) as live:
                while not ended.wait(0.1) and (end is None or time.monotonic() < end):
                    for ticks, values in stream.waiting():
                        curves.add(ticks / stream.f_isr_Hz, values)
                    if stream.ended:
                        raise stream.ended
                    live.update(curves.drawn(live.console.width), refresh=True)
    if as_json:
        print_json(dict(zip(stream.channels, curves.latest().tolist())))
    return 0
