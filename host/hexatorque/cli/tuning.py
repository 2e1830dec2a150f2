"""`tune`: the parameters of a drive, optimised on its simulation."""

from __future__ import annotations

import math
import shlex
import sys

import click

from . import completion, options
from .group import examples
from .output import console_of, print_json
from .working import compile_now, working

#: The study, in the folder of the results.
JOURNAL = "study.journal"


@click.command(
    "tune",
    epilog=examples(
        "tune mine.toml",
        "tune mine.toml --points 1450:36,300:36 --weights ripple=2,fsw=0",
        "tune mine.toml --scheme dtc3 --trials 200 -o out/dtc3 --resume",
        "tune paper-b --set controller.f_isr_Hz=20000",
        note="Weights: ripple, thd, fsw, loss, speed; 0 leaves one out.",
    ),
)
@options.of_setup
@options.value(
    "--scheme",
    metavar="NAME",
    help="scheme to tune; default: the set-up's",
    shell_complete=completion.scheme,
)
@options.settings
@options.value(
    "--points",
    metavar="RPM:NM,...",
    help="operating points that count; default: three, from the rated values",
)
@options.value(
    "--weights", metavar="NAME=W,...", help="weights of the figures; default: 1 each, speed 0.5"
)
@options.value(
    "--trials",
    metavar="N",
    type=options.whole,
    default=96,
    help="candidates in all, those of a resumed study too",
)
@options.value("--seed", metavar="N", type=options.whole, default=1, help="seed of the search")
@options.value(
    "--jobs", metavar="N", type=options.whole, help="parallel runs; default: number of cores"
)
@options.folder("out/tune")
@click.option("--resume", is_flag=True, help="go on with the study in the folder")
@options.as_json
def tune(
    setup, scheme, settings, points, weights, trials, seed, jobs, output, resume, as_json
) -> int:
    """Optimise a set-up's controller on its own simulation.

    Comparator bands or kappa, x-y gains, observer and speed loop move, as far as the scheme uses
    them. Candidates that trip, or that lose speed or flux at an operating point, are out; the
    chosen one also holds with R_s, L_m, sigma L_s and the inertia 30 % wrong. Writes a set-up with
    the tuned values and a report with the trade-off. The same seed gives the same result, with any
    number of jobs, and after an interruption as well.
    """
    from .. import setups
    from ..tuning import aim, course, report, search, tuning

    console = console_of(as_json)
    for name, number, least in (("--trials", trials, 1), ("--jobs", jobs, 1), ("--seed", seed, 0)):
        if number is not None and not least <= number <= 100_000:
            raise options.Mistake(f"{name}: {number}: allowed range is {least} .. 100000")
    search.library()
    loaded = setups.load(setup)
    values = options.settings_given(settings)
    for key in values:
        if key.startswith("profile."):
            raise options.Mistake(f"--set {key}: a set-up is tuned at points, without its profile")
    if scheme is not None:
        names = options.schemes_given(scheme)
        if len(names) > 1:
            raise options.Mistake(f"--scheme: {scheme}: one scheme is needed")
        values = options.settings_beside(settings, "--scheme", "which scheme is tuned")
        loaded = loaded.with_scheme(names[0])
    loaded = loaded.changed(values)
    where = course.read_points(points) if points is not None else course.usual_points(loaded)
    counts = aim.read_weights(weights or "")
    request = tuning.Request(loaded, tuple(where), counts, seed, trials)
    course.check_points(loaded, where)
    report.make_folder(output)
    compile_now()
    runs = trials + 2 * len(tuning.errors_of(loaded)) + 1
    with working(console, "tuning", runs * course.simulated_s(loaded, where)) as work:
        tuned = tuning.tune(
            request,
            output / JOURNAL,
            resume,
            jobs,
            work.advance,
            lambda number, best: work.call(
                f"tuning: {number} of {max(number, trials)} candidates, aim {_percent(best)}"
            ),
        )
        work.begin("writing the report")
        command = shlex.join(["hexatorque", *(sys.argv[1:] or ["tune", setup])])
        try:
            result = report.write(tuned, setup, output, command)
        except OSError as error:
            raise options.Mistake(f"{error.filename}: {error.strerror}") from None
    if as_json:
        print_json(result)
        return 0
    _show(console, tuned, result)
    if result["trials"] > trials:
        console.print(
            f"the study had {result['trials']} candidates already: --trials {trials} adds none",
            highlight=False,
        )
    return 0


def _percent(aim: float) -> str:
    return f"{100 * (math.exp(aim) - 1):+.0f} %"


def _lines_of_errors(errors) -> list[str]:
    """Each error that the drive did not hold: when, and why. None is not held after tuning
    alone: such a candidate is not chosen."""
    lines = []
    for name, (before, after) in errors.items():
        if after:
            lines.append(f"{name}: held neither before nor after tuning: {after}")
        elif before:
            lines.append(f"{name}: held after tuning; before tuning: {before}")
    return lines


def _show(console, tuned, result) -> None:
    from rich.table import Table
    from rich.text import Text

    from ..tuning import report

    table = Table(title=f"{result['setup']}, {result['scheme']}", title_justify="left")
    for heading in ("point", "figure", "before", "after", "change"):
        table.add_column(heading, justify="left" if heading in ("point", "figure") else "right")
    last = ""
    for point, title, unit, a, b, digits in report.rows_of_figures(tuned):
        if point != last:
            table.add_section()
        shown = "" if point == last else point
        last = point
        texts = (f"{a:.{digits}f}", f"{b:.{digits}f}", report.change(a, b))
        table.add_row(shown, Text(f"{title} [{unit}]"), *texts)
    console.print(table)
    table = Table()
    for heading in ("parameter", "before", "after", "unit"):
        table.add_column(heading, justify="right" if heading in ("before", "after") else "left")
    for name, a, b, unit in report.rows_of_parameters(tuned):
        table.add_row(name, f"{a:.4g}", f"{b:.4g}", unit)
    if tuned.better:
        console.print(table)
    else:
        console.print("no candidate is better than the set-up as it is", highlight=False)
    for line in _lines_of_errors(tuned.errors):
        console.print(line, highlight=False, markup=False)
    console.print(
        f"aim {_percent(tuned.best.aim)}: the weighted mean of the changes above, less is better; "
        f"{result['trials']} candidates, {result['lost']} of them do not hold their points",
        highlight=False,
    )
    console.print(
        f"report: {result['report']}: the trade-off between ripple and f_sw", highlight=False
    )
    what = "tuned" if tuned.better else "as it was"
    console.print(
        f"{result['file']}: {what}; next: hexatorque check {shlex.quote(str(result['file']))}",
        highlight=False,
    )
