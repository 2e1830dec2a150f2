"""`hexatorque evidence speed`: speed of the simulation and of studies, cost of the firmware.

Speed is a ratio (simulated seconds per wall second), the cost is counted in host
instructions of one fast interrupt, drivers and protection included.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ... import firmware
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import MOST_EDGES, Point, Progress, approach
from ...setups import Setup, SetupError
from ...sweeps.study import Study
from ...system import usable_cores, workers_MB

if TYPE_CHECKING:
    from rich.table import Table

SECONDS = 1.0
REPEATS = 7
STUDY_RUNS = 24  #: runs a core of the study that is timed
STUDY_METRICS = ("speed_rpm", "torque_ripple_Nm", "f_sw_Hz")
TRACE_S = 0.6  #: duration that is replayed for counting, from the drive's start


def realtime_factors(setup: Setup, progress: Progress | None = None) -> dict[str, float]:
    """Simulated seconds per second of real time on one core, after a first run, at the set-up's
    operating point: for the loop alone, and with the full recording (4 plant samples per period
    and all channels). The best of several runs, because other work only slows a run down."""
    sim = approach(Point(setup, setup["point.speed_rpm"], setup["point.load_Nm"]), progress)
    factors = {}
    for name, record in (("loop", False), ("recording", True)):
        values = []
        for _ in range(REPEATS):
            sim.wall_s = 0.0
            sim.run(SECONDS, record=record, progress=progress)
            values.append(SECONDS / sim.wall_s)
            sim.discard()
        factors[name] = max(values)
    return factors


def write_trace(setup: Setup, path: Path) -> None:
    """The drive's registers in every period from the start on, for
    `count_instructions`. The capture unit is not among them: speed by edges per time."""
    sim = SimulatedDrive(setup.changed(controller__speed_period_rpm=0.0), 1)
    controller = sim.controller
    m, words = controller.map, controller.register_words()
    rows: list[str] = []

    def run(duration_s: float) -> None:
        for _ in range(round(duration_s / sim.period_s)):
            sim.run(sim.period_s, record=False)
            adc = words[list(m.adc_result)] >> m.adc_shift
            position = int(words[m.eqep]) | int(words[m.eqep + 1]) << 16
            rows.append(f"{' '.join(map(str, adc))} {position} {int(len(rows) % every == 0)}")

    every = controller.fast_per_slow
    # All parameters stand before the start: the replay then is the run itself.
    sim.set("speed_ref_rpm", setup["point.speed_rpm"])
    sim.start()
    run(TRACE_S)
    values = "\n".join(f"{v:.9g}" for v in controller.drive.params.v)
    device = firmware.DEVICES.index(setup["timing.device"])
    lines = [f"device {device} periods {len(rows)}", "params", values, *rows, ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def instructions(
    setup: Setup, counter: Path, progress: Progress | None = None
) -> dict[str, dict[str, int]]:
    """Instructions on this computer, per scheme: of the fast interrupt, register model included,
    and of the control step in it."""
    result = {}
    for scheme in firmware.schemes():
        with tempfile.TemporaryDirectory() as folder:
            trace = Path(folder) / "trace.txt"
            write_trace(setup.with_scheme(scheme), trace)
            try:
                done = subprocess.run([counter, trace], capture_output=True, text=True)
            except OSError as error:
                raise SetupError(f"{counter}: {error.strerror}") from None
        found = re.fullmatch(r"isr (\d+) (\d+) step (\d+) (\d+) periods (\d+)\s*", done.stdout)
        if done.returncode or not found:
            raise SetupError(f"{counter}: {done.stderr.strip() or 'no result'}")
        names = ("isr_mean", "isr_max", "step_mean", "step_max", "periods")
        result[scheme] = dict(zip(names, map(int, found.groups())))
        if progress:
            progress(TRACE_S)
    return result


def limits(setup: Setup, plant: Path, progress: Progress | None = None) -> dict[str, float]:
    """The loop's speed with a plant in plain C (`limit.factors`)."""
    from .limit import factors

    sim = approach(Point(setup, setup["point.speed_rpm"], setup["point.load_Nm"]), progress)
    capacity = round(SECONDS / sim.period_s) * MOST_EDGES
    return factors(sim, plant, SECONDS, capacity, REPEATS)


def scaling(setup: Setup) -> dict[str, float]:
    """A study on one core and on all: runs a second from the first row to the last, and the memory
    that only a worker has, in MB, while it works."""
    cores = usable_cores()
    found: dict[str, float] = {"cores": cores}
    for name, jobs in (("one", 1), ("all", cores)):
        loads_Nm = [setup["point.load_Nm"] * (1 + 0.001 * k) for k in range(STUDY_RUNS * jobs)]
        study = Study(setup, {"point.load_Nm": loads_Nm}, STUDY_METRICS)
        times_s: list[float] = []
        memory_MB = 0.0
        for _ in study.rows(jobs=jobs):
            times_s.append(time.perf_counter())
            memory_MB = max([memory_MB, *workers_MB()])
        # The first row of each worker is the start: loading and compiling.
        found[name] = (len(times_s) - jobs) / (times_s[-1] - times_s[jobs - 1])
        found["worker_MB"] = memory_MB
    return found


def bench(
    setup: Setup, counter: Path | None, plant: Path | None, progress: Progress | None = None
) -> dict:
    """{"setup", "realtime_factor": {scheme: {"loop", "recording"}}, "limit": {scheme: factors},
    "study", "instructions"}; None where a program is not given."""
    if counter is not None and not shutil.which(counter):
        raise SetupError(f"{counter}: no such program; `make bench` builds it")
    by_scheme = {name: setup.changed(controller__scheme=name) for name in ("ddr", "fdr", "dtc1")}
    return {
        "setup": setup.name,
        "realtime_factor": {n: realtime_factors(s, progress) for n, s in by_scheme.items()},
        "limit": {n: limits(s, plant, progress) for n, s in by_scheme.items()} if plant else None,
        "study": scaling(by_scheme["ddr"]),
        "instructions": instructions(setup, counter, progress) if counter else None,
    }


def tables(result: dict) -> list[Table]:
    """The results as tables for the terminal."""
    from rich.table import Table

    speed = Table(title="simulated seconds per wall second, one core", title_justify="left")
    for heading in ("scheme", "loop alone", "with recording"):
        speed.add_column(heading, justify="left" if heading == "scheme" else "right")
    for scheme, row in result["realtime_factor"].items():
        speed.add_row(scheme, f"{row['loop']:.0f}", f"{row['recording']:.0f}")
    tables = [speed]
    if result["limit"]:
        tables.append(_limit_table(result["limit"]))
    tables.append(_study_table(result["study"]))
    if not result["instructions"]:
        return tables
    cost = Table(title="host instructions per period", title_justify="left")
    for heading in ("scheme", "step mean", "step max", "step / fdr", "interrupt mean", "max"):
        cost.add_column(heading, justify="left" if heading == "scheme" else "right")
    base = result["instructions"]["fdr"]["step_mean"]
    for scheme, row in result["instructions"].items():
        counts = [str(row[key]) for key in ("step_mean", "step_max", "isr_mean", "isr_max")]
        cost.add_row(scheme, *counts[:2], f"{row['step_mean'] / base:.2f}", *counts[2:])
    return [*tables, cost]


def _limit_table(limits: dict[str, dict[str, float]]) -> Table:
    from rich.table import Table

    title = "the same with the plant in plain C, by processor time: same edges, steps and results"
    found = Table(title=title, title_justify="left")
    found.add_column("scheme")
    for heading in ("loop", "loop, C plant", "ratio", "plant alone", "in C"):
        found.add_column(heading, justify="right")
    for scheme, row in limits.items():
        names = ("loop", "limit", "plant", "plain_c")
        loop, limit, plant, plain_c = (f"{row[name]:.0f}" for name in names)
        ratio = f"{row['loop'] / row['limit']:.2f}"
        found.add_row(scheme, loop, limit, ratio, plant, plain_c)
    return found


def _study_table(row: dict[str, float]) -> Table:
    from rich.table import Table

    found = Table(title="a study in processes: runs a second", title_justify="left")
    for heading in ("one core", "all cores", "cores", "share of cores x one", "MB a worker"):
        found.add_column(heading, justify="right")
    share = row["all"] / (row["cores"] * row["one"])
    numbers = (row["one"], row["all"], row["cores"], share, row["worker_MB"])
    found.add_row(*(f"{value:.{digits}f}" for value, digits in zip(numbers, (1, 1, 0, 2, 0))))
    return found
