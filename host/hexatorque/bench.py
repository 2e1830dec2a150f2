"""`hexatorque bench`: speed of the simulation, cost of the firmware.

Speed is a ratio (simulated seconds per wall second), the cost is counted in host
instructions of one fast interrupt, drivers and protection included.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from . import firmware
from .scenario import ScenarioError, Setup
from .sil import Simulation
from .study import Point, Progress, approach

SECONDS = 1.0
REPEATS = 7
TRACE_S = 0.6  #: of the drive's life, from the start, replayed for counting


def realtime_factors(setup: Setup, progress: Progress | None = None) -> dict[str, float]:
    """Simulated seconds per wall second, one core, warm, at the set-up's point: the
    loop alone, and with the full recording (4 plant samples a period and all telemetry
    channels). Best of a few: other work on the machine only ever slows it down."""
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
    """What the drive's sensors read from the start on, for `count_instructions`."""
    sim = Simulation(setup, 1)
    per_A = 4096 / (2 * setup["sensors.i_full_A"])
    sim.start()
    controller = sim.controller
    build_s = controller.get("calibration_s") + controller.get("build_s") + 0.05
    sim.run(build_s)
    sim.set("speed_ref_rpm", setup["point.speed_rpm"])
    sim.run(TRACE_S - build_s)
    rec = sim.take()
    # Back from amperes to counts: exact, the offsets being those just calibrated.
    offsets = np.array(list(controller.drive.offset_counts))
    raw = np.array([2048.0] * 6)
    calibrating = rec["state"] < firmware.STATES.index("build")
    counts = np.empty((len(rec), 7), int)
    for leg, phase in enumerate(("u1", "u2", "w1", "w2", "v1", "v2")):
        zero = np.where(calibrating, raw[leg], offsets[leg])
        counts[:, leg] = np.rint(rec[f"i_{phase}_A"] * per_A + zero)
    counts[:, 6] = np.rint(rec["vdc_V"] * 4096 / setup["sensors.vdc_full_V"])
    cpr = 4.0 * setup["sensors.encoder_ppr"]
    turns = rec["plant.theta_rad"].astype(float) / (2 * np.pi)
    position = np.floor(turns * cpr).astype(np.int64)
    every = round(controller.get("f_isr_Hz") / controller.get("f_slow_Hz"))
    values = list(controller.drive.params.v)
    with path.open("w") as file:
        device = firmware.DEVICES.index(setup["timing.device"])
        file.write(f"device {device} periods {len(rec)}\nparams\n")
        file.write("\n".join(f"{v:.9g}" for v in values) + "\n")
        for k in range(len(rec)):
            row = " ".join(map(str, counts[k]))
            file.write(f"{row} {position[k] & 0xFFFFFFFF} {int(k % every == 0)}\n")


def instructions(
    setup: Setup, counter: Path, progress: Progress | None = None
) -> dict[str, dict[str, int]]:
    """Host instructions per scheme: the fast interrupt (register model included) and
    the control step in it."""
    result = {}
    for scheme in firmware.schemes():
        with tempfile.TemporaryDirectory() as folder:
            trace = Path(folder) / "trace.txt"
            write_trace(setup.changed(controller__scheme=scheme), trace)
            try:
                done = subprocess.run([counter, trace], capture_output=True, text=True)
            except OSError as error:
                raise ScenarioError(f"{counter}: {error.strerror}") from None
        found = re.fullmatch(r"isr (\d+) (\d+) step (\d+) (\d+) periods (\d+)\s*", done.stdout)
        if done.returncode or not found:
            raise ScenarioError(f"{counter}: {done.stderr.strip() or 'no result'}")
        names = ("isr_mean", "isr_max", "step_mean", "step_max", "periods")
        result[scheme] = dict(zip(names, map(int, found.groups())))
        if progress:
            progress(TRACE_S)
    return result


def bench(setup: Setup, counter: Path | None, progress: Progress | None = None) -> dict:
    """{"setup", "realtime_factor": {scheme: {"loop", "recording"}}, "instructions"}."""
    if counter is not None and not counter.exists():
        raise ScenarioError(f"{counter}: no such program; `make bench` builds it")
    return {
        "setup": setup.name,
        "realtime_factor": {
            scheme: realtime_factors(setup.changed(controller__scheme=scheme), progress)
            for scheme in ("ddr", "fdr", "dtc1")
        },
        "instructions": instructions(setup, counter, progress) if counter else None,
    }


def tables(result: dict) -> list:
    """For the terminal."""
    from rich.table import Table

    speed = Table(title="simulated seconds per wall second, one core", title_justify="left")
    for heading in ("scheme", "loop alone", "with recording"):
        speed.add_column(heading, justify="left" if heading == "scheme" else "right")
    for scheme, row in result["realtime_factor"].items():
        speed.add_row(scheme, f"{row['loop']:.0f}", f"{row['recording']:.0f}")
    if not result["instructions"]:
        return [speed]
    cost = Table(title="host instructions per period", title_justify="left")
    for heading in ("scheme", "step mean", "step max", "step / fdr", "interrupt mean", "max"):
        cost.add_column(heading, justify="left" if heading == "scheme" else "right")
    base = result["instructions"]["fdr"]["step_mean"]
    for scheme, row in result["instructions"].items():
        counts = [str(row[key]) for key in ("step_mean", "step_max", "isr_mean", "isr_max")]
        cost.add_row(scheme, *counts[:2], f"{row['step_mean'] / base:.2f}", *counts[2:])
    return [speed, cost]
