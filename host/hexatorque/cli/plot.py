"""Commands on recordings: `plot` and `convert`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..recording.formats import PART, suffixes_text
from .common import console_of, print_json


def add(commands: argparse._SubParsersAction) -> None:
    suffixes = suffixes_text()
    plot = commands.add_parser(
        "plot",
        help="recordings over each other, and how far they are apart",
        description="Draw recordings of simulation, emulated processor and bench over each other, "
        "aligned by their trigger.",
        epilog="examples:\n  hexatorque plot out/reversal.npz\n"
        "  hexatorque plot sil.npz@0.4 bench.csv --channels torque_Nm,speed_rpm --window -0.01,0.1",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    plot.add_argument(
        "file", nargs="+", metavar="FILE[@S]",
        help=f"recording ({suffixes}, or {PART} of one never closed); @S: time of its trigger",
    )  # fmt: skip
    plot.add_argument("--channels", metavar="A,B,...", help="default: the main ones all have")
    plot.add_argument(
        "--align", metavar="HOW",
        help="trigger, start or none; default: trigger if all have one, else start if several",
    )  # fmt: skip
    plot.add_argument("--window", metavar="T0,T1", help="seconds to show, after alignment")
    plot.add_argument("--json", action="store_true", help="rms differences on standard output")
    plot.add_argument("-o", "--output", type=Path, default=Path("out/plot.png"), metavar="FILE.png")
    plot.set_defaults(call=_plot)

    convert = commands.add_parser(
        "convert",
        help="a recording into another kind of file",
        description=f"Write a recording again by the new name's suffix: {suffixes}. "
        f"From a {PART} file it saves a recording that was never closed.",
        epilog="example:\n  hexatorque convert out/bench.npz.part out/bench.mf4",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    convert.add_argument("file", metavar="FILE")
    convert.add_argument("output", type=Path, metavar="NEW")
    convert.set_defaults(call=_convert)


def _plot(args: argparse.Namespace) -> int:
    from rich.markup import escape
    from rich.table import Table

    from ..analysis import overlay
    from ..recording.recording import RecordingError

    window_s = _window(args.window)
    if args.align not in (None, *overlay.ALIGNMENTS):
        known = ", ".join(overlay.ALIGNMENTS)
        raise RecordingError(f"--align {args.align}: choose from {known}")
    if args.output.suffix != ".png":
        raise RecordingError(f"{args.output}: a picture is a .png")
    console = console_of(args.json)
    traces = overlay.read(args.file)
    for trace in traces:
        _say_notes(trace.file, trace.rec)
    how = overlay.align(traces, args.align)
    asked = None if args.channels is None else [n.strip() for n in args.channels.split(",")]
    names = overlay.chosen(traces, asked)
    traces = overlay.cut(traces, window_s)
    try:
        picture = overlay.plot(traces, names, how, args.output)
    except OSError as error:
        raise RecordingError(f"{args.output}: {error.strerror}") from None
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
    if args.json:
        print_json({**result, "picture": str(picture)})
    return 0


def _window(text: str | None) -> tuple[float, float] | None:
    """The seconds of a --window option."""
    from ..recording.recording import RecordingError

    if text is None:
        return None
    try:
        begin_s, end_s = map(float, text.split(","))
    except ValueError:
        begin_s = end_s = float("nan")
    if not float("-inf") < begin_s < end_s < float("inf"):
        raise RecordingError(f"--window {text}: two times in s that ascend, as in -0.01,0.1")
    return begin_s, end_s


def _say_notes(file: str, rec) -> None:
    """What reading a file brought up, on standard error."""
    if rec.notes:
        print(f"hexatorque: {file}: {'; '.join(rec.notes)}", file=sys.stderr)


def _convert(args: argparse.Namespace) -> int:
    from ..recording.formats import check_output
    from ..recording.recording import Recording

    output = check_output(args.output)
    rec = Recording.load(args.file)
    _say_notes(args.file, rec)
    print(f"{rec.save(output)}: {len(rec)} samples of {len(rec.channels)} channels")
    return 0
