"""`hexatorque board commission`: measure wiring, machine and load of a board's drive."""

from __future__ import annotations

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
        note="The steps: wiring, resistance, inductance, encoder, rotor, magnetisation, mechanics.",
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
@options.file("--out", metavar="FILE.toml", help="a set-up with the measured values")
@options.board
@options.as_json
def commission(steps, current, travel, turns, speed, out, device, baud, as_json) -> int:
    """Measure wiring, machine and load, and set the parameters accordingly.

    The gates switch. Steps up to `rotor` need a free shaft that may turn a little, `magnetisation`
    a machine that runs without load. `mechanics` measures friction and a fan's torque. Ctrl-C
    stops it, and so does the board if this command dies. Wrong wiring ends it with a line for each
    mistake and exit code 1.
    """
    from ...commissioning.excitation import Limits
    from ...commissioning.result import set_up_of_board
    from ...commissioning.sequence import STEPS, default_current_A, with_needs
    from ...commissioning.sequence import commission as run

    wanted = list(STEPS) if steps is None else [part.strip() for part in steps.split(",")]
    for name in wanted:
        if name not in STEPS:
            raise Mistake(f"no step {name!r}: choose from {', '.join(STEPS)}")
    if out is not None and "rotor" not in wanted and not {"magnetisation", "mechanics"} & {*wanted}:
        raise Mistake("--out: a set-up needs the step rotor at least")
    for name, value in (("travel", travel), ("turns", turns), ("speed", speed)):
        if value is not None and (line := refusal(name, value)):
            raise Mistake(f"--{line}")
    console = console_of(as_json, highlight=False)
    names = with_needs(wanted)
    with (
        until_signal(at_once=True),
        open_drive(device, baud) as drive,
        working(console, "beginning") as work,
    ):

        def begin(step: str) -> None:
            number = names.index(step) + 1
            work.begin(f"step {number} of {len(names)}, {step}: {STEPS[step]}")

        limit_A = default_current_A(drive) if current is None else current
        limits = Limits(limit_A, travel, speed or 0.0)
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


def _write(file: Path, text: str) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Mistake(f"{file}: {error.strerror}") from None
