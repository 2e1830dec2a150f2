"""Evidence from the firmware on other processors: `pil` and `budget`."""

from __future__ import annotations

from pathlib import Path

import click

from ...recording.formats import suffixes_text
from .. import completion, options
from ..group import examples
from ..options import Mistake, schemes_given, settings_given
from ..output import console_of, print_failure, print_json
from ..working import compile_now, working


@click.command(
    epilog=examples(
        "evidence pil",
        "evidence pil --setup paper-b --schemes dtc1,dtc3",
        "evidence pil examples/reversal.toml -o out/reversal-pil.npz",
        "evidence pil --device /dev/ttyUSB1 --schemes ddr",
    )
)
@options.scenario(required=False)
@options.point("paper-a-feasible")
@options.value(
    "--machine",
    metavar="NAME",
    help="mps2-an386 (Cortex-M4F, default), mps2-an500 (Cortex-M7), atmega2560 (16-bit int)",
)
@options.value("--device", metavar="PORT", help="a board's serial port, e.g. /dev/ttyUSB1")
@options.baud
@options.file(
    "-o",
    "--output",
    metavar="DIR|FILE",
    help=f"folder; with a scenario its recording: {suffixes_text()}",
)
@options.as_json
def pil(
    scenario, setup, schemes, speed, load, settings, machine, device, baud, output, as_json
) -> int:
    """The firmware on another processor, bit by bit against the host's.

    Processor in the loop: runs schemes through two seconds of transients, or a scenario, once
    with the firmware on the host and once on an emulated processor or a board, and compares all
    registers and channels. The emulator needs gcc-arm-none-eabi and qemu-system-arm, a board
    its image (docs/pil.md).
    """
    from ... import setups
    from ...evidence.studies import pil
    from ...experiments import steady, written
    from ...recording.formats import check_output

    console = console_of(as_json)
    name, target_of_run = _target(machine, device, baud)
    if scenario:
        at_a_point = {"setup": setup, "schemes": schemes, "speed": speed, "load": load}
        given = [f"--{option}" for option, value in at_a_point.items() if value is not None]
        if given:
            raise Mistake(f"{', '.join(given)}: not with a scenario file")
        loaded = setups.load(scenario).changed(settings_given(settings))
        file = check_output(output or Path("out") / f"{loaded.name}-pil.npz")
        todo = [(loaded, loaded.profile, file)]
    else:
        loaded = setups.load(setup or "paper-a-feasible").changed(settings_given(settings))
        loaded = steady.at_point(loaded, speed, load)
        folder = output or Path("out/pil")
        written.make_folder(folder)
        each = [loaded.with_scheme(name) for name in schemes_given(schemes)]
        todo = [
            (s, pil.transients(s), folder / f"recordings/{s.name}-{s['controller.scheme']}.npz")
            for s in each
        ]
    outcomes = []
    compile_now()
    total_s = 2 * sum(profile.duration_s for _, profile, _ in todo)
    with working(console, name, total_s) as work:
        for one, profile, file in todo:
            with target_of_run() as target:
                outcome = pil.compare(one, profile, target, work.advance)
            outcome.recording.save(file)
            outcomes.append(outcome)
    console.print(pil.table(outcomes))
    failures = [line for outcome in outcomes for line in outcome.failures()]
    for line in failures:
        print_failure(console, line)
    console.print(f"recordings: {todo[0][2].parent}", highlight=False)
    if as_json:
        print_json([outcome.as_json() for outcome in outcomes])
    return 1 if failures else 0


def _target(machine: str | None, device: str | None, baud: int | None):
    """Name of what `pil` runs on, and a function that gives a fresh one for a run."""
    from ...boards import emulator_process, pil_board

    if device is not None:
        if machine is not None:
            raise Mistake("--machine: not with --device")
        rate = pil_board.BAUD if baud is None else baud
        return device, lambda: pil_board.BoardTarget(device, rate)
    if baud is not None:
        raise Mistake("--baud: only with --device")
    machine = machine or "mps2-an386"
    if machine not in emulator_process.MACHINES:
        known = ", ".join(emulator_process.MACHINES)
        raise Mistake(f"no machine {machine!r}: choose from {known}")
    return machine, lambda: emulator_process.emulator(machine)


@click.command(epilog=examples("evidence budget -o docs", "evidence budget --profile ddr"))
@options.setup("paper-a-feasible")
@options.value(
    "--profile",
    metavar="SCHEME",
    help="a scheme's instructions, function by function",
    shell_complete=completion.scheme,
)
@options.file("-o", "--output", metavar="DIR", help="write budget.json and budget.md there")
@options.as_json
def budget(setup, profile, output, as_json) -> int:
    """Instructions, stack and size of the firmware on embedded processors.

    Counts the instructions of the fast interrupt on an emulated Cortex-M4F, its stack and the
    firmware's size, and holds them against firmware/budget.toml. Needs gcc-arm-none-eabi and
    qemu-system-arm.
    """
    from ... import setups
    from ...boards import tools
    from ...evidence.cost import budget, count

    console = console_of(as_json)
    tools.need("arm-none-eabi-gcc", "qemu-system-arm")
    loaded = setups.load(setup)
    if profile:
        (scheme,) = schemes_given(profile)
        with working(console, f"counting instructions of {scheme}"):
            result = count.profile(loaded.with_scheme(scheme))
        tables, failures = count.profile_tables(result, scheme), []
    else:
        with working(console, "counting instructions") as work:
            result = budget.measure(loaded, work.advance)
        tables, failures = budget.tables(result), budget.exceeded(result, budget.limits())
        if output:
            budget.write(result, output)
    for table in tables:
        console.print(table)
    for line in failures:
        print_failure(console, line, "over budget")
    if as_json:
        print_json(result)
    return 1 if failures else 0
