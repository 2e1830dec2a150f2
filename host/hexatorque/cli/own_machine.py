"""Commands for a machine of one's own: `new` writes a set-up, `check` reviews it."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

import click

from . import options
from .group import examples
from .output import console_of, print_json

#: Width of a review that goes into a file or a pipe.
PIPED = 120
#: Colours of the verdicts.
STYLE = {"ok": "green", "note": "yellow", "doubtful": "bold yellow", "bad": "bold red"}


def at_terminal() -> bool:
    """Whether someone is there to answer."""
    return sys.stdin.isatty()


@click.command(
    "new",
    epilog=examples(
        "new mine.toml",
        'new mine.toml --nameplate "power_kW=7.5 voltage_V=400 current_A=7.8 \\\n'
        '    power_factor=0.82 frequency_Hz=50 speed_rpm=1455 poles=4"',
        'new mine.toml --circuit "pole_pairs=2 rs_ohm=1.8 rr_ohm=2 lls_H=10e-3 \\\n'
        '    llr_H=15e-3 lm_H=284e-3 current_A=6 vdc_V=300"',
        'new mine.toml --magnets "poles=10 ke_V=47 rs_ohm=1.1 ld_H=2.1e-3 current_A=3.5 \\\n'
        '    vdc_V=60 inertia_kgm2=0.03"',
        note="Each list may also have vdc_V, inertia_kgm2, lxy_H, i_full_A, vdc_full_V, "
        "dead_time_us, encoder_ppr, device, displacement_deg (30, 0 or 60 between the sets), "
        "phases (3 shows the result of rewinding to six "
        "phases); a nameplate may have power_factor, efficiency, pull_out, "
        "connection; the others torque_Nm and speed_rpm, a circuit flux_Wb, magnets lq_H. "
        "5,5 is 5.5.",
    ),
)
@click.argument("file", metavar="FILE.toml", type=click.Path(path_type=Path), help="the new set-up")
@options.value("--nameplate", metavar="NAME=VALUE,...", help="the machine's nameplate")
@options.value("--circuit", metavar="NAME=VALUE,...", help="its equivalent circuit per phase")
@options.value("--magnets", metavar="NAME=VALUE,...", help="data of a machine with magnets")
@click.option("--force", is_flag=True, help="replace a file that is there")
def new(file, nameplate, circuit, magnets, force) -> int:
    """Write a set-up for a machine of your own.

    The machine has six phases. Voltage and current of a nameplate are those of each of the two
    three-phase sets. Missing values are estimated, and tagged with the range in which they usually
    lie. The scheme is the one that `check` finds best. Without a list the command asks.
    """
    from ..setups import new as writing

    lists = {"--nameplate": nameplate, "--circuit": circuit, "--magnets": magnets}
    given = [name for name, text in lists.items() if text is not None]
    if len(given) > 1:
        raise options.Mistake(f"give one list, not {' and '.join(given)}")
    if not given and not at_terminal():
        raise options.Mistake(
            f"give one of {', '.join(lists)}: the command asks only at a terminal"
        )
    if file.suffix != ".toml":
        raise options.Mistake(f"{file}: the name must end with .toml")
    if file.exists() and not force:
        raise options.Mistake(f"{file} is there already; --force replaces it")
    title = file.stem.replace('"', "").replace("\\", "")
    if not given:
        from .questions import ask

        text = ask(title)
    elif circuit is not None:
        text = writing.from_circuit(circuit, title)
    elif magnets is not None:
        text = writing.from_magnets(magnets, title)
    else:
        text = writing.from_nameplate(nameplate, title)
    text, _, why, odd = writing.with_best_scheme(text, file.stem)
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise options.Mistake(f"{file}: {error.strerror}") from None
    for line in odd:
        print(f"note: {line}")
    if f"# {writing.NO_FACTOR}" in text:
        print("the plate has no power_factor: with it the ranges of R_s and L_m are narrower")
    print(f"scheme {writing.scheme_of(text)}: {why}")
    print(f"{file}: complete; next: hexatorque check {shlex.quote(str(file))}")
    return 0


@click.command(
    "check",
    epilog=examples(
        "check mine.toml",
        "check paper-b --schemes dtc1 --all",
        "check mine.toml --set inverter.vdc_V=560",
    ),
)
@options.of_setup
@options.schemes
@options.settings
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="show the whole table, also the rows that are in order",
)
@options.as_json
def check(setup, schemes, settings, everything, as_json) -> int:
    """Review a set-up before anything runs.

    Compares currents, voltages, steps and gains with their limits, suggests changes, gives the mean
    torque that each scheme holds, and names the schemes that are ready, and those of which an
    estimate decides. Ends with 1 if the drive cannot run with the values of the set-up, or if an
    estimate leaves it open: if a finding of all schemes is bad, or one of its own scheme or of a
    scheme that was asked for is bad or doubtful.
    """
    from .. import firmware, setups
    from ..setups.review import best, mean_torque_says, outcome, review

    loaded = setups.load(setup).changed(options.settings_given(settings))
    scheme = loaded.parameter("scheme")
    reviewed = options.schemes_given(schemes)
    own = reviewed if schemes else [scheme]
    # All of them: advice names those that are ready.
    known = review(loaded, firmware.schemes())
    first, why = best(known, firmware.schemes())
    findings = [f for f in known if f.scheme in ("", *reviewed)]
    bad = any(f.stops and f.scheme in ("", *own) for f in findings)
    name = shlex.join([setup, *(word for text in settings for word in ("--set", text))])
    reached = outcome(findings, reviewed, scheme, name, first)
    if as_json:
        rows = [finding.as_json() for finding in findings]
        print_json(
            {
                "setup": loaded.name,
                "ok": not bad,
                **reached.as_json(),
                "best": {"scheme": first, "why": why} if first else None,
                "findings": rows,
            }
        )
        return int(bad)
    console = console_of(False, highlight=False)
    if not console.is_terminal:
        console.width = int(os.environ.get("COLUMNS", PIPED))
    console.print(f"{loaded.name}: {loaded.title}", markup=False)
    if everything:
        console.print(_table(findings))
    shown = findings if everything else [f for f in findings if f.scheme in ("", *own)]
    _print_notes(console, shown, "" if everything else " (--all shows them)")
    if told := mean_torque_says(findings):
        console.print(told, markup=False)
    console.print(reached.text, markup=False)
    return int(bad)


def _print_notes(console, findings, rest: str) -> None:
    """The findings, the worst first. A line each, and one for the change; then how
    many there are, with the `rest` of this line."""
    from rich.markup import escape
    from rich.padding import Padding

    worst = list(STYLE)[:0:-1]
    shown = [f for verdict in worst for f in findings if f.verdict == verdict]
    for f in shown:
        limit = f": {f.value:.4g} {f.unit}".rstrip() + f", limit {f.limit:.4g}" if f.sign else ""
        of = f"{f.scheme}: " if f.scheme else ""
        console.print(f"[{STYLE[f.verdict]}]{f.verdict:4}[/]  {escape(of + f.what + limit)}")
        console.print(Padding(escape(f.advice), (0, 0, 0, 6), expand=False))
    with_limit = [f for f in findings if f.sign or f.verdict != "ok"]
    fine = len(with_limit) - len(shown)
    console.print(f"{fine} of {len(with_limit)} findings are in order{rest}")


def _table(findings):
    """The changes stand below the table, where there is room for them."""
    from rich.table import Table

    table = Table()
    for heading in ("scheme", "what", "value", "limit", "unit", "verdict"):
        table.add_column(heading, justify="right" if heading in ("value", "limit") else "left")
    scheme = ""
    for f in findings:
        if f.scheme != scheme:
            table.add_section()
            scheme = f.scheme
        limit = f"{f.sign} {f.limit:.4g}" if f.sign else ""
        verdict = f"[{STYLE[f.verdict]}]{f.verdict}[/]"
        table.add_row(f.scheme, f.what, f"{f.value:.4g}", limit, f.unit, verdict)
    return table
