"""Commands that simulate: `run`, `compare` and `reach`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from . import options
from .group import examples
from .options import schemes_given
from .output import (
    console_of,
    print_failure,
    print_json,
    say,
    tripped,
)
from .working import compile_now, compiling, working


@click.command(
    epilog=examples(
        "run examples/reversal.toml -o out/reversal.csv",
        "run examples/reversal.toml --set controller.scheme=dtc3 --set machine.rs_ohm=7.2",
    )
)
@options.scenario(required=True)
@options.settings
@options.recording_or_none
@options.as_json
def run(scenario, settings, output, as_json) -> int:
    """Run one scenario with a speed and load profile.

    Runs a scenario file and writes the recording.
    """
    from .. import setups
    from ..drive.simulated import SimulatedDrive
    from ..firmware import BUILD, CALIBRATE, warnings
    from ..recording.formats import check_output

    console = console_of(as_json)
    setup = setups.load(scenario).changed(options.settings_given(settings))
    file = check_output(output or Path("out") / f"{setup.name}.npz")
    with compiling():
        sim = SimulatedDrive(setup, setup.profile.samples_per_period)
    with working(console, setup.name, setup.profile.duration_s) as work:
        sim.run_profile(setup.profile, work.advance)
        recording = sim.take()
        work.begin(f"writing {file}")
        recording.save(file)
    trip = sim.trip
    lost = warnings(int(sim.controller.channel("warnings")))
    left = sim.controller.channel("torque_limit_Nm")
    summary = {
        "scenario": setup.name,
        "file": str(file),
        "duration_s": recording.duration_s,
        "samples": len(recording),
        "state": sim.controller.state,
        "faults": sim.controller.faults,
        **({"warnings": lost, "torque_limit_Nm": left} if lost else {}),
        **({"trip": trip and trip.as_json()} if as_json else {}),
        "final_speed_rpm": sim.speed_rpm,
        "f_sw_Hz": recording.meta["f_sw_Hz"],
        "realtime_factor": recording.duration_s / sim.wall_s,
    }
    say(as_json, summary)
    if not as_json:
        print(f"recording: {file}: to see it, hexatorque plot {file}")
        if sim.state in (CALIBRATE, BUILD):
            takes_s = sum(float(setup.parameter(key)) for key in ("calibration_s", "build_s"))
            print(
                f"the profile ends in state {sim.state}, before the drive gives torque: "
                f"calibration and build-up take about {takes_s:.3g} s, profile.duration_s is "
                f"{setup.profile.duration_s:g} s"
            )
    return tripped(sim.state, sim.faults, trip)


@click.command(
    epilog=examples(
        "compare",
        "compare --setup paper-b --schemes dtc1,dtc3 --speed 1500 --load 1",
        "compare --setup paper-b --set controller.torque_band_Nm=0.6",
        "compare --schemes ddr,db-dtfc,fcs-mpc,examples/own_law.py",
    )
)
@options.point("both papers' set-ups", options.schemes_or_laws)
@options.folder("out/compare")
@options.as_json
def compare(setup, schemes, speed, load, settings, output, as_json) -> int:
    """Compare schemes at one operating point.

    Runs schemes to a steady state and compares them with the papers' numbers; without --setup
    on the set-ups of both papers.
    """
    from ..analysis.report import console_table
    from ..analysis.saying import sentences
    from ..evidence.papers.printed_values import PAPER
    from ..experiments import comparison, written
    from ..recording.formats import RecordingError

    console = console_of(as_json)
    names = [setup] if setup else comparison.DEFAULT_SETUPS
    written.make_folder(output)
    values = options.settings_beside(settings, "--schemes", "which schemes run")
    todo = comparison.points(names, schemes_given(schemes, laws=True), speed, load, values)
    compile_now()
    simulated_s = sum(point.simulated_s for point in todo)
    with working(console, f"comparing {len(todo)} runs", simulated_s) as work:
        compared = comparison.compare(todo, PAPER, work.advance)
        work.begin("writing the report", written.count_of_files(compared), "files")
        command = " ".join(["hexatorque", *(sys.argv[1:] or ["compare"])])
        try:
            files = written.write(compared, output, command, work.advance)
        except OSError as error:
            raise RecordingError(f"{error.filename}: {error.strerror}") from None
    for line in sentences(compared.runs, PAPER):
        console.print(line, highlight=False, markup=False)
    for table in console_table(compared.runs, PAPER):
        console.print(table)
    for label, reason in compared.failed:
        print_failure(console, f"{label}: {reason}")
    console.print(
        f"report: {files[-1]}: open it in a browser; *waveforms* shows currents and torque",
        highlight=False,
        markup=False,
    )
    if as_json:
        print_json(compared.as_json())
    return 1 if compared.failed else 0


#: Exit code of `reach` for each outcome of a scheme; the largest counts.
EXIT_CODES = {"held": 0, "none": 0, "tripped": 1, "not configured": 2}


@click.command(epilog=examples("reach --setup paper-b --load 2"))
@options.setup("paper-a-feasible")
@options.schemes
@options.load
@options.settings
@options.as_json
def reach(setup, schemes, load, settings, as_json) -> int:
    """Find the highest speed that each scheme holds.

    That is the highest speed at which a scheme holds the load with its full flux reference. Exit
    code 0: every scheme has a speed, which may be 0; 1: a drive tripped at every speed; 2: the
    set-up cannot be configured.
    """
    from rich.table import Table
    from rich.text import Text

    from .. import setups
    from ..experiments.operating_points import reach_all

    console = console_of(as_json)
    values = options.settings_beside(settings, "--schemes", "which schemes run")
    loaded = setups.load(setup).changed(values)
    if load is not None:
        loaded = loaded.changed(point__load_Nm=load)
    load_Nm = loaded["point.load_Nm"]
    names = schemes_given(schemes)
    variants = [loaded.with_scheme(name) for name in names]
    compile_now()
    with working(console, "searching") as work:
        found = reach_all(variants, load_Nm, work.advance)
    result = dict(zip(names, found))
    code = max(EXIT_CODES[one.outcome] for one in found)
    if as_json:
        print_json(
            {
                "setup": loaded.name,
                "load_Nm": load_Nm,
                "reachable_rpm": {name: one.rpm for name, one in result.items()},
                "schemes": {name: one.as_json() for name, one in result.items()},
            }
        )
        return code
    table = Table(title=f"{loaded.name}, {load_Nm:g} N m, full flux", title_justify="left")
    table.add_column("scheme")
    table.add_column("reachable speed [r/min]", justify="right")
    table.add_column("why not more")
    for name, one in result.items():
        shown = one.outcome if one.rpm is None else f"{one.rpm:.0f}"
        table.add_row(name, shown, Text(one.reason))
    console.print(table)
    return code
