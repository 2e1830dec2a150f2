"""`hexatorque board compare`: a bench's recordings beside the simulation of the same."""

from __future__ import annotations

import itertools
import sys

import click

from ...given import listed, real
from ...setups.keys import MOST_NM
from .. import completion, options
from ..group import examples
from ..options import Mistake
from ..output import console_of, print_json
from ..recordings import seconds_window
from ..working import compile_now, working

#: Highest speed of a --speed option.
MOST_RPM = 1e5


@click.command(
    epilog=examples(
        "board compare mine.toml run.npz",
        "board compare mine.toml scope.npz --map CH5=speed_rpm*300 --load 4",
        "board compare mine.toml low.mf4 high.mf4 --load 0:0,1.5:10 -o out/twin",
    )
)
@options.of_setup
@click.argument(
    "recordings",
    metavar="RECORDING...",
    nargs=-1,
    required=True,
    shell_complete=completion.files,
    help="a board's recordings with torque_ref_Nm, speed_rpm, flux and phase currents, or an "
    "oscilloscope's with phase currents",
)
@options.value(
    "--load",
    metavar="NM|T:NM,...",
    help="load torque, or its steps in the recording's time; default: 0",
)
@options.value("--window", metavar="T0,T1", help="seconds of the recordings to compare")
@options.value(
    "--speed",
    metavar="RPM",
    type=options.number,
    help="speed of an oscilloscope's recording without speed_rpm; default: the set-up's point",
)
@options.of_tables
@options.folder("out/board-compare")
@options.as_json
def compare(setup, recordings, load, window, speed, maps, shift, output, as_json) -> int:
    """Find the parameter of a set-up that differs from the bench.

    Simulates the recorded run, lists the differences, and names the parameter that explains them
    best.
    Ends with 1 if they differ by more than the expected noise.
    """
    from rich.table import Table
    from rich.text import Text

    from ... import setups
    from ...recording import mapping
    from ...recording.formats import RecordingError
    from ...recording.recording import Recording
    from ...twin import bench, fit, report

    console = console_of(as_json, highlight=False)
    loaded = setups.load(setup)
    loads = _loads(load)
    window_s = seconds_window(window)
    if speed is not None and not abs(speed) <= MOST_RPM:
        raise Mistake(f"--speed {speed:g}: allowed range is -{MOST_RPM:g} .. {MOST_RPM:g} r/min")
    recs = [Recording.load(file) for file in recordings]
    recs = mapping.mapped(recordings, recs, maps, mapping.shift(shift))
    benches = [
        bench.read(rec, file, loaded, window_s, loads, speed)
        for rec, file in zip(recs, recordings, strict=True)
    ]
    if load is None:
        for one in benches:
            one.notes.append("a recording does not carry the load torque: 0 N m is taken (--load)")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{output}: {error.strerror}") from None
    compile_now()
    with working(console, "comparing", fit.simulated_s(loaded, benches)) as work:
        found = fit.compare(loaded, benches, loads, progress=work.advance)
        work.begin("writing the report")
        command = " ".join(["hexatorque", *sys.argv[1:]])
        try:
            pictures, page = report.write(found, output, command)
        except OSError as error:
            raise RecordingError(f"{error.filename}: {error.strerror}") from None
    for title, headings, rows in (
        (
            f"{loaded.name}: bench - simulation",
            report.QUANTITY_HEADINGS,
            report.quantity_rows(found),
        ),
        ("one parameter alone", report.PARAMETER_HEADINGS, report.parameter_rows(found)),
    ):
        table = Table(title=Text(title), title_justify="left")
        for heading in headings:
            table.add_column(heading)
        for row in rows:
            table.add_row(*map(Text, row))
        console.print(table)
    for one in benches:
        for note in one.notes:
            console.print(Text(f"{one.label}: {note}"))
    for line in (*found.notes, *report.verdict(found)):
        console.print(Text(line))
    console.print(Text(f"report: {page}"))
    if as_json:
        files = {"pictures": [str(path) for path in pictures], "report": str(page)}
        print_json({**report.as_json(found), **files})
    return int(found.differs)


def _loads(text: str | None) -> tuple[tuple[float, float], ...]:
    """Steps (time in s, torque) of a --load option."""
    from ...twin.shaft import NO_LOAD

    if text is None:
        return NO_LOAD
    steps = []
    for part in listed(text):
        at, colon, value = part.rpartition(":")
        try:
            steps.append((real(at) if colon else float("-inf"), real(value)))
        except ValueError:
            steps.append((float("nan"), 0.0))
    times = [time_s for time_s, _ in steps]
    ascend = all(a < b for a, b in itertools.pairwise(times))
    finite = all(abs(value) <= MOST_NM and time_s < float("inf") for time_s, value in steps)
    if not (ascend and finite):
        raise Mistake(
            f"--load {text}: write NM, or T:NM,T:NM with times in s that ascend; torques up to "
            f"{MOST_NM:.0f} N m either way"
        )
    return tuple(steps)
