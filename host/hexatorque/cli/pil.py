"""The firmware on other processors: `pil` and `budget`."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..recording.formats import suffixes_text
from .common import compile_now, console_of, point_options, print_json, progress, schemes_given


def add(commands: argparse._SubParsersAction) -> None:
    pil = commands.add_parser(
        "pil",
        help="processor in the loop: the firmware on an emulated Cortex-M or a board, held against "
        "the host's",
        description="Run schemes through two seconds of transients, or a scenario, once with the "
        "firmware on the host and once on an emulated processor or a board, and compare all "
        "registers and channels bit by bit. The emulator needs gcc-arm-none-eabi and "
        "qemu-system-arm, a board its image (docs/pil.md).",
        epilog="examples:\n  hexatorque pil\n  hexatorque pil --setup paper-b --schemes dtc1,dtc3\n"
        "  hexatorque pil examples/reversal.toml -o out/reversal-pil.npz\n"
        "  hexatorque pil --device /dev/ttyUSB1 --schemes ddr",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    pil.add_argument("scenario", nargs="?", metavar="SCENARIO.toml", help="as for run")
    point_options(pil, "paper-a-feasible")
    pil.add_argument(
        "--machine",
        metavar="NAME",
        help="mps2-an386 (Cortex-M4F, default), mps2-an500 (Cortex-M7), atmega2560 (16-bit int)",
    )
    pil.add_argument("--device", metavar="PORT", help="a board's serial port, e.g. /dev/ttyUSB1")
    pil.add_argument("--baud", type=int, metavar="N", help="its rate; default: the images'")
    pil.add_argument("--json", action="store_true", help="results on standard output")
    pil.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR|FILE",
        help=f"with a scenario: FILE, {suffixes_text()}",
    )
    pil.set_defaults(call=_pil)

    budget = commands.add_parser(
        "budget",
        help="instructions, stack and size of the firmware on embedded processors",
        description="Count the instructions of the fast interrupt on an emulated Cortex-M4F, its "
        "stack and the firmware's size, and hold them against firmware/budget.toml. Needs "
        "gcc-arm-none-eabi and qemu-system-arm.",
        epilog="examples:\n  hexatorque budget -o docs\n  hexatorque budget --profile ddr",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    budget.add_argument("--setup", default="paper-a-feasible", metavar="NAME|FILE")
    budget.add_argument("--profile", metavar="SCHEME", help="where a scheme's instructions go")
    budget.add_argument("--json", action="store_true")
    budget.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="write budget.json and budget.md there"
    )
    budget.set_defaults(call=_budget)


def _target(args: argparse.Namespace):
    """Name of what `pil` runs on, and a function that gives a fresh one for a run."""
    from ..boards import emulator_process, pil_board
    from ..setups import SetupError

    if args.device is not None:
        if args.machine is not None:
            raise SetupError("--machine: not with --device")
        baud = pil_board.BAUD if args.baud is None else args.baud
        return args.device, lambda: pil_board.BoardTarget(args.device, baud)
    if args.baud is not None:
        raise SetupError("--baud: only with --device")
    machine = args.machine or "mps2-an386"
    if machine not in emulator_process.MACHINES:
        known = ", ".join(emulator_process.MACHINES)
        raise SetupError(f"no machine {machine!r}: choose from {known}")
    return machine, lambda: emulator_process.emulator(machine)


def _pil(args: argparse.Namespace) -> int:
    from .. import setups
    from ..drive import comparison
    from ..evidence.studies import pil
    from ..recording.formats import check_output

    console = console_of(args.json)
    name, target_of_run = _target(args)
    if args.scenario:
        given = [f"--{n}" for n in ("setup", "schemes", "speed", "load", "latency")
                 if getattr(args, n) is not None]  # fmt: skip
        if given:
            raise setups.SetupError(f"{', '.join(given)}: not with a scenario file")
        setup = setups.load(args.scenario)
        output = check_output(args.output or Path("out") / f"{setup.name}-pil.npz")
        todo = [(setup, setup.profile, output)]
    else:
        setup = comparison.at_point(
            args.setup or "paper-a-feasible", args.speed, args.load, args.latency
        )
        output = args.output or Path("out/pil")
        comparison.make_folder(output)
        each = [setup.changed(controller__scheme=name) for name in schemes_given(args.schemes)]
        todo = [
            (s, pil.transients(s), output / f"recordings/{s.name}-{s['controller.scheme']}.npz")
            for s in each
        ]
    outcomes = []
    compile_now()
    with progress(console) as bar:
        total = 2 * sum(profile.duration_s for _, profile, _ in todo)
        task = bar.add_task(name, total=total)
        for setup, profile, file in todo:
            with target_of_run() as target:
                outcome = pil.compare(setup, profile, target, lambda s: bar.advance(task, s))
            outcome.recording.save(file)
            outcomes.append(outcome)
    console.print(pil.table(outcomes))
    for outcome in outcomes:
        for line in outcome.failures():
            console.print(f"[bold red]failed[/] {line}", highlight=False)
    console.print(f"recordings: {todo[0][2].parent}", highlight=False)
    if args.json:
        print_json([outcome.as_json() for outcome in outcomes])
    return 1 if any(outcome.failures() for outcome in outcomes) else 0


def _budget(args: argparse.Namespace) -> int:
    from .. import setups
    from ..boards import tools
    from ..evidence.cost import budget, count

    console = console_of(args.json)
    tools.need("arm-none-eabi-gcc", "qemu-system-arm")
    setup = setups.load(args.setup)
    if args.profile:
        (scheme,) = schemes_given(args.profile)
        result = count.profile(setup.changed(controller__scheme=scheme))
        tables, failures = count.profile_tables(result, scheme), []
    else:
        with progress(console) as bar:
            task = bar.add_task("counting", total=None)
            result = budget.measure(setup, lambda seconds: bar.advance(task, seconds))
        tables, failures = budget.tables(result), budget.exceeded(result, budget.limits())
        if args.output:
            budget.write(result, args.output)
    for table in tables:
        console.print(table)
    for line in failures:
        console.print(f"[bold red]over budget[/] {line}", highlight=False)
    if args.json:
        print_json(result)
    return 1 if failures else 0
