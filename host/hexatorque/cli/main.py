"""The `hexatorque` command: every subcommand is one call into the package.

Exit codes: 0 done; 1 it ran, but a drive tripped or did not reach its point, a study
found what must not be, or a target differs from the host or does not answer;
2 the command line, a file or a value is wrong; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .. import __version__
from ..errors import HexatorqueError
from ..evidence.papers import ENTRIES
from ..evidence.studies import STUDIES
from ..recording.formats import suffixes_text
from . import link, monitor, pil, plot, record, serve
from .common import (
    compile_now,
    compiling,
    console_of,
    point_options,
    print_json,
    progress,
    schemes_given,
)

EXAMPLES = """examples:
  hexatorque compare                                  both papers, all schemes
  hexatorque compare --setup paper-b --schemes dtc1,dtc2,dtc3
  hexatorque compare --setup paper-a-feasible --schemes fdr,ddr --speed 400 --load 7.5
  hexatorque run examples/reversal.toml -o out/reversal.npz
  hexatorque plot out/reversal.npz bench.csv          recordings over each other
  hexatorque setups paper-b                           every value and where it is from
  hexatorque reproduce all                            every figure and table of both papers
  hexatorque pil --schemes ddr                        the firmware on an emulated Cortex-M4F
  hexatorque verify faults                            3240 faults, and what the gates do
  hexatorque verify line                              the serial link on a line that spoils octets
"""


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="hexatorque",
        description="Direct torque control of six-phase drives: simulate the C firmware.",
        epilog=EXAMPLES,
        formatter_class=raw,
    )
    parser.add_argument("--version", action="version", version=f"hexatorque {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    suffixes = suffixes_text()

    compare = commands.add_parser(
        "compare",
        help="schemes side by side at one operating point",
        description="Run schemes to a steady state and compare them with the papers' numbers.",
        epilog="example:\n  hexatorque compare --setup paper-b --schemes dtc1,dtc3 --speed 1500",
        formatter_class=raw,
    )
    point_options(compare, "both papers")
    compare.add_argument("--json", action="store_true", help="metrics on standard output")
    compare.add_argument("-o", "--output", type=Path, default=Path("out/compare"), metavar="DIR")
    compare.set_defaults(call=_compare)

    run = commands.add_parser(
        "run",
        help="one scenario with a speed and load profile",
        description="Run a scenario file and write the recording.",
        epilog="example:\n  hexatorque run examples/reversal.toml -o out/reversal.csv",
        formatter_class=raw,
    )
    run.add_argument("scenario", metavar="SCENARIO.toml")
    run.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"recording, {suffixes}")
    run.add_argument("--json", action="store_true", help="summary on standard output")
    run.set_defaults(call=_run)

    plot.add(commands)
    pil.add(commands)

    setups = commands.add_parser("setups", help="built-in set-ups, each value with its source")
    setups.add_argument("name", nargs="*", metavar="NAME|FILE")
    setups.add_argument("--json", action="store_true")
    setups.add_argument("--schema", action="store_true", help="JSON Schema of their files")
    setups.set_defaults(call=_setups)

    schemes = commands.add_parser("schemes", help="control schemes, their source and options")
    schemes.add_argument("--json", action="store_true")
    schemes.set_defaults(call=_schemes)

    reach = commands.add_parser(
        "reach",
        help="highest speed that each scheme holds",
        description="Highest speed at which a scheme holds the load with its full flux reference.",
        epilog="example:\n  hexatorque reach --setup paper-b --load 2",
        formatter_class=raw,
    )
    reach.add_argument("--setup", default="paper-a-feasible", metavar="NAME|FILE")
    reach.add_argument("--schemes", metavar="A,B,...", help="default: all")
    reach.add_argument("--load", type=float, metavar="NM", help="default: the set-up's point")
    reach.add_argument("--json", action="store_true")
    reach.set_defaults(call=_reach)

    verify = commands.add_parser(
        "verify",
        help="what simulation and firmware can be trusted for",
        description="Run studies of accuracy, low speed, light load and faults; "
        "a table, a picture and the numbers of each.",
        epilog="examples:\n  hexatorque verify faults\n  hexatorque verify all --quick",
        formatter_class=raw,
    )
    verify.add_argument("study", nargs="+", metavar="STUDY", help=f"all, {', '.join(STUDIES)}")
    verify.add_argument("--quick", action="store_true", help="fewer cases, shorter runs")
    verify.add_argument("--json", action="store_true", help="results on standard output")
    verify.add_argument("-o", "--output", type=Path, default=Path("out/verify"), metavar="DIR")
    verify.set_defaults(call=_verify)

    reproduce = commands.add_parser(
        "reproduce",
        help="both papers' figures and tables, beside what the papers print",
        description="Make figures and tables of the papers again: ID.json, ID.png and recordings "
        "of each, and index.html with all verdicts. Interrupted, it goes on where it was.",
        epilog="examples:\n  hexatorque reproduce A10 B-T6\n"
        "  hexatorque reproduce all --quick -o out/papers",
        formatter_class=raw,
    )
    reproduce.add_argument("id", nargs="+", metavar="ID", help=f"all, {', '.join(ENTRIES)}")
    reproduce.add_argument("--quick", action="store_true", help="fewer points, shorter windows")
    reproduce.add_argument("--json", action="store_true", help="verdicts on standard output")
    reproduce.add_argument("-o", "--output", type=Path, default=Path("out/papers"), metavar="DIR")
    reproduce.set_defaults(call=_reproduce)

    serve.add(commands)
    link.add(commands)
    record.add(commands)
    monitor.add(commands)

    bench = commands.add_parser("bench", help="speed of the simulation, cost of the firmware")
    bench.add_argument("--setup", default="paper-a-feasible", metavar="NAME|FILE")
    bench.add_argument(
        "--counter", type=Path, metavar="PROGRAM", help="instruction counter built by CMake"
    )
    bench.add_argument("--json", action="store_true")
    bench.set_defaults(call=_bench)
    return parser


def _compare(args: argparse.Namespace) -> int:
    from ..analysis.report import console_table
    from ..drive import comparison
    from ..evidence.papers.printed_values import PAPER
    from ..recording.recording import RecordingError

    console = console_of(args.json)
    names = [args.setup] if args.setup else comparison.DEFAULT_SETUPS
    comparison.make_folder(args.output)
    todo = comparison.points(
        names, schemes_given(args.schemes), args.speed, args.load, args.latency
    )
    compile_now()
    with progress(console) as bar:
        task = bar.add_task("comparing", total=sum(point.simulated_s for point in todo))
        compared = comparison.compare(todo, PAPER, lambda seconds: bar.advance(task, seconds))
        bar.update(task, description="writing the report")
        command = " ".join(["hexatorque", *(sys.argv[1:] or ["compare"])])
        try:
            written = comparison.write(compared, args.output, command)
        except OSError as error:
            raise RecordingError(f"{error.filename}: {error.strerror}") from None
    for table in console_table(compared.runs, PAPER):
        console.print(table)
    for label, reason in compared.failed:
        console.print(f"[bold red]failed[/] {label}: {reason}", highlight=False)
    console.print(f"report: {written[-1]}", highlight=False)
    if args.json:
        print_json(compared.as_json())
    return 1 if compared.failed else 0


def _run(args: argparse.Namespace) -> int:
    from .. import setups
    from ..drive.simulated import SimulatedDrive
    from ..recording.formats import check_output

    console = console_of(args.json)
    setup = setups.load(args.scenario)
    output = check_output(args.output or Path("out") / f"{setup.name}.npz")
    with compiling():
        sim = SimulatedDrive(setup, setup.profile.samples_per_period)
    with progress(console) as bar:
        task = bar.add_task(setup.name, total=setup.profile.duration_s)
        sim.run_profile(setup.profile, lambda seconds: bar.advance(task, seconds))
    recording = sim.take()
    recording.save(output)
    summary = {
        "scenario": setup.name,
        "file": str(output),
        "duration_s": recording.duration_s,
        "samples": len(recording),
        "state": sim.controller.state,
        "faults": sim.controller.faults,
        "final_speed_rpm": sim.speed_rpm,
        "f_sw_Hz": recording.meta["f_sw_Hz"],
        "realtime_factor": recording.duration_s / sim.wall_s,
    }
    if args.json:
        print_json(summary)
    else:
        for key, value in summary.items():
            shown = f"{value:.4g}" if isinstance(value, float) else value
            console.print(f"{key:>16}  {shown}", highlight=False)
    if sim.controller.state == "fault":
        print(f"hexatorque: the drive tripped: {', '.join(sim.controller.faults)}", file=sys.stderr)
        return 1
    return 0


def _setups(args: argparse.Namespace) -> int:
    from rich.table import Table

    from .. import setups

    if args.schema:
        print_json(setups.json_schema())
        return 0
    loaded = [setups.load(name) for name in args.name or setups.builtin_names()]
    if args.json:
        print_json({s.name: setups.describe(s) for s in loaded})
        return 0
    console = console_of(False)
    for setup in loaded:
        table = Table(title=f"{setup.name}\n{setup.title}\n{setup.paper}", title_justify="left")
        for heading in ("section", "key", "value", "unit", "tag", "note"):
            table.add_column(heading, justify="right" if heading == "value" else "left")
        for section, rows in setups.describe(setup).items():
            for key, row in rows.items():
                table.add_row(
                    section, key, setups.show(row["value"]), row["unit"], row["tag"], row["note"]
                )
            table.add_section()
        console.print(table)
    return 0


def _schemes(args: argparse.Namespace) -> int:
    from rich.table import Table

    from ..analysis.schemes import OPTIONS, SCHEMES

    if args.json:
        print_json({"schemes": SCHEMES, "options": OPTIONS})
        return 0
    console = console_of(False)
    table = Table(title="schemes (controller.scheme)", title_justify="left", show_lines=True)
    for heading in ("name", "source", "vectors in a period", "torque levels", "x-y currents"):
        table.add_column(heading)
    for name, row in SCHEMES.items():
        table.add_row(name, row["source"], row["vectors"], row["torque_levels"], row["xy"])
    console.print(table)
    table = Table(title="options of every scheme", title_justify="left")
    for heading in ("key", "choices", "what it decides"):
        table.add_column(heading)
    for key, row in OPTIONS.items():
        table.add_row(key, row["choices"], row["help"])
    console.print(table)
    return 0


def _reach(args: argparse.Namespace) -> int:
    from rich.table import Table

    from .. import setups
    from ..drive.operating_points import reach_all

    console = console_of(args.json)
    setup = setups.load(args.setup)
    if args.load is not None:
        setup = setup.changed(point__load_Nm=args.load)
    load_Nm = setup["point.load_Nm"]
    names = schemes_given(args.schemes)
    variants = [setup.changed(controller__scheme=name) for name in names]
    compile_now()
    with progress(console) as bar:
        task = bar.add_task("searching", total=None)
        speeds = reach_all(variants, load_Nm, lambda seconds: bar.advance(task, seconds))
    result = dict(zip(names, speeds))
    if args.json:
        print_json({"setup": setup.name, "load_Nm": load_Nm, "reachable_rpm": result})
        return 0
    table = Table(title=f"{setup.name}, {load_Nm:g} N m, full flux", title_justify="left")
    table.add_column("scheme")
    table.add_column("reachable speed [r/min]", justify="right")
    for name, speed in result.items():
        table.add_row(name, f"{speed:.0f}")
    console.print(table)
    return 0


def _verify(args: argparse.Namespace) -> int:
    from importlib import import_module

    from rich.markup import escape

    from ..recording.recording import RecordingError
    from ..setups import SetupError

    for name in args.study:
        if name not in ("all", *STUDIES):
            raise SetupError(f"no study {name!r}: choose from all, {', '.join(STUDIES)}")
    names = list(STUDIES) if "all" in args.study else list(dict.fromkeys(args.study))
    try:
        args.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SetupError(f"{args.output}: {error.strerror}") from None
    console = console_of(args.json)
    compile_now()
    results = {}
    failures = []
    for name in names:
        module = import_module(f"hexatorque.evidence.studies.{STUDIES[name]}")
        with progress(console) as bar:
            task = bar.add_task(name, total=None)
            result = module.study(args.quick, lambda seconds, t=task, b=bar: b.advance(t, seconds))
        for table in module.tables(result):
            console.print(table)
        try:
            (args.output / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
            picture = module.plot(result, args.output / f"{name}.png")
        except OSError as error:
            raise RecordingError(f"{error.filename}: {error.strerror}") from None
        console.print(f"picture: {picture}", highlight=False)
        for line in module.failures(result):
            failures.append(line)
            console.print(f"[bold red]failed[/] {escape(line)}", highlight=False)
        results[name] = result
    if args.json:
        print_json(results)
    return 1 if failures else 0


def _reproduce(args: argparse.Namespace) -> int:
    from rich.markup import escape

    from ..evidence.papers.engine import page, reproduce

    names = reproduce.chosen(args.id)
    reproduce.make_folder(args.output)
    console = console_of(args.json)
    compile_now()
    with progress(console) as bar:
        tasks: list = []

        def begin(name: str):
            for task in tasks:
                bar.update(task, visible=False)
            tasks.append(bar.add_task(f"{name} ({len(tasks) + 1} of {len(names)})", total=None))
            return lambda seconds, task=tasks[-1]: bar.advance(task, seconds)

        outcome = reproduce.reproduce(names, args.output, args.quick, begin)
    console.print(page.console_table(outcome.figures))
    for name, reason in outcome.failed.items():
        console.print(f"[bold red]failed[/] {name}: {escape(reason)}", highlight=False)
    for name, verdict in outcome.broken():
        text = f"{name}: {verdict.what}: {verdict.verdict}, must hold"
        console.print(f"[bold red]failed[/] {escape(text)}", highlight=False)
    console.print(f"page: {args.output / 'index.html'}", highlight=False)
    if args.json:
        print_json({"figures": outcome.figures, "failed": outcome.failed})
    return 1 if outcome.failed or outcome.broken() else 0


def _bench(args: argparse.Namespace) -> int:
    from .. import setups
    from ..evidence.cost import bench

    console = console_of(args.json)
    with progress(console) as bar:
        task = bar.add_task("measuring", total=None)
        result = bench.bench(
            setups.load(args.setup), args.counter, lambda seconds: bar.advance(task, seconds)
        )
    for table in bench.tables(result):
        console.print(table)
    if args.json:
        print_json(result)
    return 0


def main(argv: list[str] | None = None) -> int:
    """Entry point. A user's mistake ends in one line on standard error."""
    argv = list(sys.argv[1:] if argv is None else argv)
    # Else a window that begins with a minus sign is taken for an option.
    if "--window" in argv[:-1]:
        at = argv.index("--window")
        argv[at : at + 2] = [f"--window={argv[at + 1]}"]
    args = _parser().parse_args(argv)
    try:
        return args.call(args)
    except KeyboardInterrupt:
        print("hexatorque: interrupted", file=sys.stderr)
        return 130
    except HexatorqueError as error:
        for line in str(error).splitlines():  # of a file all mistakes together
            print(f"hexatorque: {line}", file=sys.stderr)
        return error.exit_code
    except ArithmeticError as error:  # compiled code of the plant knows no other errors
        print(f"hexatorque: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    raise SystemExit(main())
