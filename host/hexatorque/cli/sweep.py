"""`sweep`: many runs, one table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from . import completion, options
from .group import examples
from .output import console_of, print_failure, print_json
from .working import working

#: Failures that are printed; the table has all.
SHOWN = 5
#: Set-up of a study without a file.
SETUP = "paper-a-feasible"


@click.command(
    "sweep",
    epilog=examples(
        "sweep efficiency --setup paper-b",
        "sweep examples/sweep.toml",
        "sweep --setup paper-b --grid point.speed_rpm=500:2500:5 --schemes dtc1,ddr \\\n"
        "    --metric torque_ripple_Nm --metric f_sw_Hz",
        "sweep examples/sweep.toml -o out/sweep --resume",
        "sweep examples/sweep.toml --scheduler tcp://10.0.0.1:8786",
    ),
)
@click.argument(
    "file",
    metavar="[FILE.toml | STUDY]",
    required=False,
    shell_complete=completion.sweep,
    help="file of a study, or the name of a ready-made one",
)
@options.setup(None, f"the file's, or {SETUP}")
@options.value(
    "--grid",
    metavar="SECTION.KEY=A:B:N",
    multiple=True,
    help="N values of a key of the set-up, from A to B; or SECTION.KEY=V,V,...; may be repeated",
)
@options.settings
@options.value(
    "--schemes",
    metavar="A,B,...",
    help="control schemes; default: the file's, or the set-up's",
    shell_complete=completion.schemes,
)
@options.value(
    "--metric",
    "metrics",
    metavar="NAME",
    multiple=True,
    help="a column of the table; may be repeated; default: the file's, or all",
    shell_complete=completion.metric,
)
@options.value("--cycle", metavar="FILE.csv", help="a drive cycle in place of the study's")
@options.value(
    "--jobs", metavar="N", type=options.whole, help="parallel runs; default: number of cores"
)
@options.value("--scheduler", metavar="ADDRESS", help="Dask cluster that makes the runs")
@options.value(
    "--time-limit", metavar="S", type=options.seconds, default="300", help="longest time of a run"
)
@options.folder("out/sweep")
@click.option("--resume", is_flag=True, help="go on with the study in the folder")
@options.as_json
def sweep(
    file,
    setup,
    grid,
    settings,
    schemes,
    metrics,
    cycle,
    jobs,
    scheduler,
    time_limit,
    output,
    resume,
    as_json,
) -> int:
    """Make many runs with other values, and one table.

    Runs every combination of the values, or the file's study, on all cores or on a cluster.
    Ready-made studies for any set-up: efficiency, pareto, sensitivity, cycle.
    Writes a table (CSV and Parquet) and a map. The row of a run that fails has the reason. An
    interrupted study goes on with --resume.
    """
    if file is None and not grid:
        raise options.Mistake("give a FILE.toml, a study's name or --grid KEY=A:B:N")
    if scheduler is None:
        from ..sweeps.workers import load_ahead

        load_ahead()
    from ..sweeps import files, space
    from ..sweeps.errors import StudyError
    from ..sweeps.study import JOURNAL

    changes: dict[str, Any] = {"vary": dict(space.read_text(text, "--grid") for text in grid)}
    changes["set"] = options.settings_given(settings)
    if setup:
        changes["setup"] = setup
    if schemes:
        changes["schemes"] = options.schemes_given(schemes)
    if metrics:
        changes["metrics"] = [n.strip() for text in metrics for n in text.split(",")]
    if cycle:
        changes["cycle"] = cycle
    if file is None:
        study = files.make({"setup": SETUP, **changes})
    else:
        study = files.read(Path(file), changes)
    console = console_of(as_json)
    failed = _run(console, study, output, resume, jobs, scheduler, time_limit)
    written = study.save(output)
    try:
        written.append(study.map(output / "map.png"))
    except StudyError as error:
        console.print(str(error), highlight=False, markup=False)
    for number, why in list(study.failures.items())[:SHOWN]:
        print_failure(console, f"run {number}: {why}")
    if failed > SHOWN:
        console.print(f"and {failed - SHOWN} more, in the table", highlight=False)
    console.print(
        f"{len(study)} runs, {failed} failed: {', '.join(map(str, written))}", highlight=False
    )
    if as_json:
        named = {"table": str(written[0]), "files": [str(path) for path in written]}
        journal = str(output / JOURNAL)
        failures = {str(number): why for number, why in study.failures.items()}
        print_json({"runs": len(study), "failures": failures, **named, "journal": journal})
    return 1 if failed else 0


def _run(console, study, output, resume, jobs, scheduler, limit_s) -> int:
    """Run the study under a bar, or, elsewhere than on a terminal, with lines; the number of runs
    that failed."""
    if not console.is_terminal:
        with working(console, "running", len(study), "runs") as work:
            study.run(output, resume, jobs, None, scheduler, limit_s, lambda row: work.advance(1))
        return len(study.failures)
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=len(study))

        def each(row) -> None:
            failed = len(study.results.failures)
            what = f"{failed} failed" if failed else "running"
            bar.update(task, advance=1, description=what)

        study.run(output, resume, jobs, None, scheduler, limit_s, each)
    return len(study.failures)
