"""`hexatorque board commission`: measure wiring, machine and load of a board's drive."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ...commissioning.choices import CHOICES, refusal
from .. import options
from ..group import examples
from ..options import Mistake
from ..output import complain, console_of, print_json
from ..working import working
from .connection import open_drive, until_signal


@click.command(
    epilog=examples(
        "board commission --current 8 --out mine.toml",
        "board commission --steps wiring --current 2",
        note="The steps: wiring, resistance, inductance, encoder, rotor, magnetisation, mechanics; "
        "with magnets: wiring, resistance, alignment, inductance, magnets, mechanics.",
    )
)
@options.value(
    "--steps", metavar="A,B,...", help="steps to do, beside those that they need; default: all"
)
@options.value(
    "--current",
    metavar="A",
    type=options.number,
    help="limit of all phase currents; default: the highest that the running drive needs",
)
@options.value(
    "--travel",
    metavar="REV",
    type=options.number,
    default=CHOICES["travel"].initial,
    help="the shaft's movement in the tests at standstill; beyond it the gates go off",
)
@options.value(
    "--turns",
    metavar="REV",
    type=options.number,
    default=CHOICES["turns"].initial,
    help="turns of the field in the step encoder, twice as many if the inertia is large; the shaft "
    "turns no further",
)
@options.value(
    "--speed",
    metavar="RPM",
    type=options.number,
    help="highest speed of the running drive; default: one that takes 0.3 of the dc-link voltage",
)
@click.option("--yes", is_flag=True, help="do not ask before magnets turn the shaft")
@options.file("--out", metavar="FILE.toml", help="a set-up with the measured values")
@options.board
@options.as_json
def commission(steps, current, travel, turns, speed, yes, out, device, baud, as_json) -> int:
    """Measure wiring, machine and load, and set the parameters accordingly.

    The gates switch. Steps up to `rotor` need a free shaft that may turn a little, `magnetisation`
    a machine that runs without load. `mechanics` measures friction and a fan's torque. With magnets
    `alignment` turns the shaft, `magnets` runs it without load. Ctrl-C stops it, and so does the
    board if this command dies. Wrong wiring ends it with a line for each mistake and exit code 1.
    """
    from ...commissioning.excitation import Limits
    from ...commissioning.kinds import KINDS, kind_of
    from ...commissioning.result import set_up_of_board
    from ...commissioning.sequence import commission as run
    from ...commissioning.sequence import default_current_A

    wanted = None if steps is None else [part.strip() for part in steps.split(",")]
    every = list(dict.fromkeys(step for kind in KINDS for step in kind.steps))
    for name in wanted or ():
        if name not in every:
            raise Mistake(f"no step {name!r}: choose from {', '.join(every)}")
    wholes = {kind.whole for kind in KINDS} | {"magnetisation", "mechanics"}
    if out is not None and wanted is not None and not wholes & {*wanted}:
        raise Mistake(
            "--out: a set-up needs the step rotor at least, with magnets the step magnets"
        )
    for name, value in (("travel", travel), ("turns", turns), ("speed", speed)):
        if value is not None and (line := refusal(name, value)):
            raise Mistake(f"--{line}")
    console = console_of(as_json, highlight=False)
    with (
        until_signal(at_once=True),
        open_drive(device, baud) as drive,
        working(console, "beginning") as work,
    ):
        limit_A = default_current_A(drive) if current is None else current
        limits = Limits(limit_A, travel, speed or 0.0)
        kind = kind_of(drive)
        names = kind.with_needs(wanted or tuple(kind.steps))
        if not yes:
            _agreed(drive, limits, turns, [step for step in kind.asks if step in names])

        def begin(step: str) -> None:
            number = names.index(step) + 1
            work.begin(f"step {number} of {len(names)}, {step}: {kind.steps[step]}")

        found = run(
            drive,
            limits,
            wanted,
            turns,
            lambda line: console.print(line, markup=False),
            begin=begin,
        )
        values = {} if found.mistakes else found.parameters(drive)
        text = ""
        if out is not None and not found.mistakes:
            text = set_up_of_board(found, drive)
    if text:
        _write(out, text)
    if as_json:
        print_json(
            {
                "mistakes": found.mistakes,
                "parameters": {
                    name: {"value": value.value, "uncertainty": value.uncertainty}
                    for name, value in values.items()
                },
            }
        )
    for line in found.mistakes:
        complain(line)
    if text:
        console.print(f"{out}: measured; next: hexatorque check {out}", markup=False)
    return 1 if found.mistakes else 0


def _agreed(drive, limits, turns, steps) -> None:
    """Tell what the steps do with the shaft, and ask."""
    from ...commissioning.plans import plan

    for step in steps:
        words = f"step {step}: the shaft {plan(drive, limits, step, turns).shaft}."
        if not sys.stdin.isatty():
            raise Mistake(f"{words} Nobody can be asked: agree with --yes")
        click.confirm(f"{words} Go on?", abort=True, err=True)


def _write(file: Path, text: str) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Mistake(f"{file}: {error.strerror}") from None
