"""Evidence from simulation on this computer: `papers`, `studies` and `speed`."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ...evidence.papers import ENTRIES
from ...evidence.studies import KEEPING, RUNS, STUDIES
from .. import completion, options
from ..group import examples
from ..options import Mistake, settings_given
from ..output import console_of, print_failure, print_json
from ..working import compile_now, working

if TYPE_CHECKING:
    from rich.console import Console


@click.command(
    epilog=examples(
        "evidence papers A10 B-T6",
        "evidence papers all --quick -o out/papers",
        "evidence papers references --rivals 2",
    )
)
@click.argument(
    "ids",
    metavar="ID...",
    nargs=-1,
    required=True,
    shell_complete=completion.figure,
    help=f"all, {', '.join(ENTRIES)}",
)
@options.quick
@click.option(
    "--rivals",
    type=click.IntRange(1, 8),
    default=1,
    show_default=True,
    help="REFERENCES: how many times the search's budget the rivals of our laws get, beside a "
    "comparison with equal budgets",
)
@options.folder("out/papers")
@options.as_json
def papers(ids, quick, rivals, output, as_json) -> int:
    """Both papers' figures and tables, beside the printed values.

    Makes figures and tables of the papers again: ID.json, ID.png and recordings of each, and
    index.html with all verdicts. An interrupted run continues there.
    """
    from ...evidence.papers.engine import page, reproduce
    from ...system import usable_cores

    names = reproduce.chosen(ids)
    reproduce.make_folder(output)
    console = console_of(as_json)
    compile_now()
    with working(console, "beginning") as work:
        numbers = itertools.count(1)

        def begin(name: str):
            work.begin(f"{name} ({next(numbers)} of {len(names)})")
            return work.advance

        jobs = min(usable_cores(), reproduce.MOST_JOBS)
        outcome = reproduce.reproduce(names, output, quick, begin, jobs, rivals)
    console.print(page.console_table(outcome.figures))
    for name, reason in outcome.failed.items():
        print_failure(console, f"{name}: {reason}")
    for name, verdict in outcome.broken():
        print_failure(console, f"{name}: {verdict.what}: {verdict.verdict}, must hold")
    console.print(
        f"page: {output / 'index.html'}: open it in a browser; each figure has its verdict",
        highlight=False,
    )
    if as_json:
        print_json({"figures": outcome.figures, "failed": outcome.failed})
    return 1 if outcome.failed or outcome.broken() else 0


@click.command(epilog=examples("evidence studies faults", "evidence studies all --quick"))
@click.argument(
    "names",
    metavar="STUDY...",
    nargs=-1,
    required=True,
    shell_complete=completion.study,
    help=f"all, {', '.join(STUDIES)}",
)
@options.quick
@options.folder("out/studies")
@options.as_json
def studies(names, quick, output, as_json) -> int:
    """Studies of how far to trust simulation and firmware.

    Runs studies of accuracy, low speed, light load and faults; a table, a picture and the
    numbers of each. An interrupted long study continues there.
    """
    from importlib import import_module

    for name in names:
        if name not in ("all", *STUDIES):
            raise Mistake(f"no study {name!r}: choose from all, {', '.join(STUDIES)}")
    names = list(STUDIES) if "all" in names else list(dict.fromkeys(names))
    _make(output)
    console = console_of(as_json)
    compile_now()
    results = {}
    failures = []
    for name in names:
        module = import_module(f".{STUDIES[name]}", "hexatorque.evidence.studies")
        keeping = {"folder": output / RUNS} if name in KEEPING else {}
        with working(console, name) as work:
            results[name] = module.study(quick, work.advance, **keeping)
            work.begin(f"{name}: drawing")
            picture = _written(module, name, results[name], output)
        failures += _told(module, results[name], picture, console)
    if as_json:
        print_json(results)
    return 1 if failures else 0


def _make(output: Path) -> None:
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Mistake(f"{output}: {error.strerror}") from None


def _written(module, name: str, result: dict, output: Path) -> Path:
    """The numbers and the picture of a study, in the folder. Returns the picture."""
    from ...recording.formats import RecordingError

    try:
        (output / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        return module.plot(result, output / f"{name}.png")
    except OSError as error:
        raise RecordingError(f"{error.filename}: {error.strerror}") from None


def _told(module, result: dict, picture: Path, console: Console) -> list[str]:
    """Prints a study's tables and its failures. Returns the failures."""
    from ...evidence.studies.grids import for_terminal

    console.print("\n".join([module.TITLE, *filter(None, [getattr(module, "NOTE", "")])]))
    for table in for_terminal(module.grid(result)):
        console.print(table)
    console.print(f"picture: {picture}", highlight=False)
    failures = module.failures(result)
    for line in failures:
        print_failure(console, line)
    return failures


@click.command(
    epilog=examples(
        "evidence limit",
        "evidence limit --setup paper-b --speed 2500 --load 2",
        "evidence limit --setup mine.toml --methods",
    )
)
@options.at_point("the points at which all methods are compared")
@options.value(
    "--f-sw",
    metavar="HZ",
    type=options.number,
    default=4000.0,
    show_default=True,
    help="mean switching frequency of a switch",
)
@click.option(
    "--methods",
    is_flag=True,
    help="simulate every method too, and draw its front: some minutes a point",
)
@options.quick
@options.folder("out/limit")
@options.as_json
def limit(setup, speed, load, settings, f_sw, methods, quick, output, as_json) -> int:
    """The least ripple that any pulse pattern can have.

    Computes least torque ripple, least distortion and the compromises between them at a switching
    frequency, beside carrier modulation; writes numbers and a picture. With --methods
    every method is searched at the point, and its front drawn.
    """
    from ... import setups
    from ...evidence.studies import limit as study
    from ...experiments import steady

    points = study.of_the_comparison()
    if setup is not None:
        loaded = setups.load(setup).changed(settings_given(settings))
        points = [study.at_point(steady.at_point(loaded, speed, load))]
    elif speed is not None or load is not None or settings:
        raise Mistake("--speed, --load, --set: --setup is needed too")
    if methods:
        study.can_have_methods(points)
        compile_now()
    _make(output)
    console = console_of(as_json)
    with working(console, "the limit", study.pieces(points, quick), "searches") as work:
        result = study.study(points, f_sw, quick, work.advance)
        if methods:
            work.begin("every method")
            there = study.reached(points, result, output / RUNS, work.advance)
            result["methods"] = study.best(there, f_sw)
        picture = _written(study, "limit", result, output)
        if methods:
            study.draw_fronts(there, output / f"{study.FRONTS}.png")
    failures = _told(study, result, picture, console)
    if as_json:
        print_json(result)
    return 1 if failures else 0


@click.command(
    epilog=examples(
        "evidence speed",
        "evidence speed --counter build/host/tests/c/count_instructions \\\n"
        "    --plant build/host/tests/c/libplant.so",
    )
)
@options.setup("paper-a-feasible")
@options.file("--counter", metavar="PROGRAM", help="instruction counter; `make bench` builds it")
@options.file("--plant", metavar="LIBRARY", help="the plant in plain C; `make bench` builds it")
@options.as_json
def speed(setup, counter, plant, as_json) -> int:
    """Speed of the simulation and of studies, instructions of the firmware on this computer."""
    from ... import setups
    from ...evidence.cost import bench

    console = console_of(as_json)
    with working(console, "measuring") as work:
        result = bench.bench(setups.load(setup), counter, plant, work.advance)
    for table in bench.tables(result):
        console.print(table)
    if as_json:
        print_json(result)
    return 0
