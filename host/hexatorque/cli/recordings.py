"""Commands on recordings: `plot` and `convert`."""

from __future__ import annotations

from pathlib import Path

import click

from ..given import listed, real
from ..recording.formats import PART, suffixes_text
from . import completion, options
from .group import examples
from .output import complain, console_of, print_json


@click.command(
    epilog=examples(
        "plot out/reversal.npz",
        "plot sil.npz@0.4 bench.csv --channels torque_Nm,speed_rpm --window -0.01,0.1",
        "plot sil.npz scope.csv --map CH1=i_u1_A*100 --map CH2=i_u2_A*100 --shift 0.4",
    )
)
@click.argument(
    "files",
    metavar="FILE[@S]...",
    nargs=-1,
    required=True,
    shell_complete=completion.files,
    help=f"{suffixes_text()}, or {PART} of one never closed; @S: time of its trigger",
)
@options.value(
    "--channels", metavar="A,B,...", help="channels to draw; default: the main ones that all have"
)
@options.value(
    "--align",
    metavar="HOW",
    help="event at time 0: trigger, start or none; default: none with --shift, trigger if "
    "all have one, else start if several",
)
@options.value("--window", metavar="T0,T1", help="seconds to show, after alignment")
@options.of_tables
@options.file(
    "-o", "--output", metavar="FILE.png", default=Path("out/plot.png"), help="the picture"
)
@options.as_json
def plot(files, channels, align, window, maps, shift, output, as_json) -> int:
    """Draw recordings over each other, with their differences.

    Draws recordings of simulation, emulated processor and bench over each other, aligned by
    their trigger.
    """
    from rich.markup import escape
    from rich.table import Table

    from ..analysis import overlay
    from ..recording import mapping
    from ..recording.formats import RecordingError

    window_s = seconds_window(window)
    if align not in (None, *overlay.ALIGNMENTS):
        known = ", ".join(overlay.ALIGNMENTS)
        raise RecordingError(f"--align {align}: choose from {known}")
    if output.suffix != ".png":
        raise RecordingError(f"{output}: a picture is a .png")
    console = console_of(as_json)
    shift_s = mapping.shift(shift)
    if align is None and shift_s is not None:
        align = "none"
    traces = overlay.read(files, maps, shift_s)
    for trace in traces:
        _complain_of(trace.file, trace.rec)
    how = overlay.align(traces, align)
    asked = None if channels is None else [n.strip() for n in channels.split(",")]
    names = overlay.chosen(traces, asked)
    traces = overlay.cut(traces, window_s)
    try:
        picture = overlay.plot(traces, names, how, output)
    except OSError as error:
        raise RecordingError(f"{output}: {error.strerror}") from None
    result = overlay.summary(traces, names, how)
    if len(traces) > 1:
        table = Table(title=f"rms difference from {escape(traces[0].label)}", title_justify="left")
        for heading in ("channel", "unit", *(escape(t.label) for t in traces[1:])):
            table.add_column(heading)
        for name, row in result["channels"].items():
            rms = row["rms_difference"][1:]
            table.add_row(name, row["unit"], *("–" if v is None else f"{v:.4g}" for v in rms))
        console.print(table)
    console.print(f"picture: {picture}", highlight=False)
    if as_json:
        print_json({**result, "picture": str(picture)})
    return 0


def seconds_window(text: str | None) -> tuple[float, float] | None:
    """The seconds of a --window option."""
    from ..recording.formats import RecordingError

    if text is None:
        return None
    try:
        begin_s, end_s = map(real, listed(text))
    except ValueError:
        begin_s = end_s = float("nan")
    if not float("-inf") < begin_s < end_s < float("inf"):
        raise RecordingError(f"--window {text}: two times in s that ascend, as in -0.01,0.1")
    return begin_s, end_s


def _complain_of(file: str, rec) -> None:
    """Remarks from reading a file, on standard error."""
    if rec.notes:
        complain(f"{file}: {'; '.join(rec.notes)}")


@click.command(
    epilog=examples(
        "convert out/bench.npz.part out/bench.mf4",
        "convert scope.csv scope.npz --map CH1=i_u1_A*100 --map CH2=i_u2_A*100",
        "convert C1.csv C2.csv both.npz --map C1.Ampl=i_u1_A*100 --map C2.Ampl=i_u2_A*100",
    )
)
@click.argument(
    "files",
    metavar="FILE...",
    nargs=-1,
    required=True,
    shell_complete=completion.files,
    help="several are joined: a channel is STEM.NAME, after its file",
)
@click.argument(
    "new",
    metavar="NEW",
    type=click.Path(path_type=Path),
    shell_complete=completion.files,
    help=f"a name that ends in {suffixes_text()}",
)
@options.of_tables
def convert(files, new, maps, shift) -> int:
    """Convert a recording into another kind of file, or join several.

    The suffix of the new name selects the kind. A .part file is a recording that was never
    closed. Several files are those of one recording, such as an oscilloscope's with a channel
    each: they need the same rate, start and length.
    """
    from ..recording import mapping
    from ..recording.formats import RecordingError, check_output
    from ..recording.joining import joined
    from ..recording.recording import Recording

    output = check_output(new)
    if files[1:] and new.exists():  # it may be a channel's file, if NEW was forgotten
        raise RecordingError(f"{new} is there already: several files are joined into a new one")
    recs = [Recording.load(file) for file in files]
    rec = joined(files, recs) if files[1:] else recs[0]
    (rec,) = mapping.mapped([" and ".join(files)], [rec], maps, mapping.shift(shift))
    for file, one in zip(files, recs, strict=True):
        _complain_of(file, one)
    count = len(rec.channels)
    print(f"{rec.save(output)}: {len(rec)} samples of {count} channel{'s' * (count != 1)}")
    return 0
