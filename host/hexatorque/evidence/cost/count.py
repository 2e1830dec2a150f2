"""Instructions of the fast interrupt, counted on an emulated Cortex-M4F that replays
what the drive's registers held in a simulated run, period by period. Exact, and the same
on every machine with the same compiler.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ... import firmware
from ...boards import emulator_process, tools
from ...boards.processor import TargetError, WatchedController, image_names
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import Progress
from ...setups import Setup

if TYPE_CHECKING:
    from rich.table import Table

#: Durations of the replay: from the flux, or the rotor's alignment, to the load; from there on.
RUN_UP_S, LOADED_S = 0.35, 0.3
#: Emulated time of an instruction, and of a SysTick tick.
INSTRUCTION_S, TICK_S = 1024e-9, 1 / 25e6
#: As in firmware/port/mps2/count_main.c.
SAMPLES = 64
IMAGE = Path("firmware/port/mps2/count")
#: No replay takes longer, by far.
TIMEOUT_S = 300


#: A drive that starts without u1, of a winding whose set 2 the firmware turns.
WITHOUT_A_LEG = {
    "machine__displacement_deg": 60,
    "controller__lost_legs": 32, "controller__ride_through": "least-loss",
    "controller__i_rated_A": 5.0,
}  # fmt: skip


def _load_at_s(setup: Setup) -> float:
    return setup.parameter("calibration_s") + setup.parameter("build_s") + RUN_UP_S


def write_trace(setup: Setup, path: Path) -> np.ndarray:
    """The input of `count_main.c`; returns the telemetry channels at its end. The capture
    unit is not among the kept registers: speed by edges per time."""
    setup = setup.changed(controller__speed_period_rpm=0.0)
    sim = SimulatedDrive(setup, 1, WatchedController)
    controller = sim.controller
    assert isinstance(controller, WatchedController)
    load_at_s = _load_at_s(setup)
    periods = round((load_at_s + LOADED_S) / sim.period_s)
    controller.log.begin(periods)
    # All parameters stand before the start: the replay then is the run itself.
    sim.set("speed_ref_rpm", setup["point.speed_rpm"])
    values = np.array(list(controller.drive.params.v), "<f4")
    sim.start()
    sim.run(load_at_s)
    sim.set("load_Nm", setup["point.load_Nm"])
    sim.run(LOADED_S)
    sim.check()
    images, columns = controller.log.images, image_names(controller)
    every = controller.fast_per_slow
    rows = np.empty((periods, 10), "<u2")
    first = next(n for n, name in enumerate(columns) if name.endswith(".ADCRESULT0"))
    for n in range(7):
        rows[:, n] = images[:, first + n] >> controller.map.adc_shift
    rows[:, 7] = images[:, columns.index("EQEP1.QPOSCNT")]
    rows[:, 8] = images[:, columns.index("EQEP1.QPOSCNT (high)")]
    rows[:, 9] = np.arange(periods) % every == 0
    device = firmware.DEVICES.index(setup["timing.device"])
    head = np.array([device, len(values), periods & 0xFFFF, periods >> 16], "<u2")
    path.write_bytes(head.tobytes() + values.tobytes() + rows.tobytes())
    recording = sim.take()
    return np.array([recording[name][-1] for name, _ in firmware.channels()], "<f4")


def _image(machine: str, preset: str | None) -> Path:
    """The counting image, built by the machine's preset or by another one."""
    return tools.build(preset or emulator_process.MACHINES[machine], "count") / IMAGE


def _emulate(machine: str, image: Path, folder: Path, *options: str) -> None:
    """Run the counting image, in `folder`."""
    command = [*emulator_process.qemu(machine, image), *options]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        raise TargetError(f"{machine}: no end after {TIMEOUT_S} s") from None
    if done.returncode:
        raise TargetError(f"{machine}: the replay ended with status {done.returncode}")


def _replay(
    setup: Setup, machine: str, folder: Path, preset: str | None = None
) -> dict[str, np.ndarray]:
    """Instructions per period: "isr", "step", "slow", the "state" after each,
    and the bytes of "stack" that the fast interrupt took."""
    channels = write_trace(setup, folder / "trace")
    _emulate(machine, _image(machine, preset), folder, "-icount", "shift=10")
    data = np.fromfile(folder / "counts", "<u4")
    width = len(channels)
    # The emulated drive must give the same bits as the simulated drive.
    if data[-width:].tobytes() != channels.tobytes():
        raise TargetError(f"{machine}: the replay does not end where the simulation does")
    empty, rows = data[0], data[1:-width].reshape(-1, 5)
    counted = np.rint((rows[:, :3] - float(empty)) * (TICK_S / INSTRUCTION_S)).astype(int)
    return {
        "isr": counted[:, 0],
        "step": counted[:, 1],
        "slow": counted[:, 2],
        "state": rows[:, 3],
        "stack": rows[:, 4],
    }


def _of_a_run(setup: Setup, machine: str) -> tuple[dict, int]:
    """The row of `instructions`, and the bytes of stack."""
    with tempfile.TemporaryDirectory() as folder:
        counts = _replay(setup, machine, Path(folder))
    running = (counts["state"] == firmware.lib.HT_STATE_RUN) & (counts["step"] > 0)
    row = {
        "mean": round(float(counts["isr"][running].mean()), 1),
        "max": int(counts["isr"].max()),
        "step_mean": round(float(counts["step"][running].mean()), 1),
        "step_max": int(counts["step"].max()),
        "slow_max": int(counts["slow"].max()),
    }
    return row, int(counts["stack"].max())


def of_a_run(setup: Setup, machine: str) -> dict:
    """The row of `instructions` for the set-up's scheme."""
    return _of_a_run(setup, machine)[0]


def instructions(
    setup: Setup, machine: str, progress: Progress | None = None
) -> tuple[dict[str, dict], int]:
    """Instructions per period, {scheme: {"mean", "max", "step_mean", "step_max", "slow_max"}}: of
    the fast interrupt, of the control step in it, and of the slow interrupt. Means are of the
    running drive; `max` includes its start. Also the most bytes of stack that the fast interrupt
    used, a drive without a leg included."""
    result = {}
    used = 0
    for scheme in firmware.schemes():
        result[scheme], stack_bytes = _of_a_run(setup.with_scheme(scheme), machine)
        used = max(used, stack_bytes)
        if progress:
            progress(_load_at_s(setup) + LOADED_S)
    with tempfile.TemporaryDirectory() as folder:  # the deepest path leads there
        without = setup.with_scheme("db-dtfc", **WITHOUT_A_LEG)
        used = max(used, int(_replay(without, machine, Path(folder))["stack"].max()))
    return result, used


def _symbols(image: Path) -> dict[int, str]:
    """Address -> name of every function."""
    listed = subprocess.run(
        ["arm-none-eabi-nm", image], capture_output=True, text=True, check=True
    ).stdout
    rows = re.findall(r"^(\S+) [tT] ([^$]\S*)$", listed, re.MULTILINE)
    return {int(address, 16) & ~1: name for address, name in rows}


def _lines(image: Path, addresses: list[int]) -> list[list[tuple[str, str]]]:
    """Address -> its functions as (function, file:line), the innermost inlined one first."""
    asked = "".join(f"{a:#x}\n" for a in addresses)
    text = subprocess.run(
        ["arm-none-eabi-addr2line", "-f", "-i", "-a", "-e", image],
        input=asked, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    result: list[list[tuple[str, str]]] = []
    rows = iter(text.splitlines())
    for row in rows:
        if row.startswith("0x"):
            result.append([])
        else:
            result[-1].append((row, Path(next(rows)).name.split(" ")[0]))
    return result


def _branches(image: Path) -> set[int]:
    """Addresses of all branches, calls and returns."""
    text = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", image],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    pattern = (
        r"^\s+([0-9a-f]+):\s+(?:b(?!f[ci]|ic|kpt)\w*(?:\.[nw])?|cbn?z|tb[bh]|pop.*pc|ldm.*pc)\b"
    )
    return {int(found, 16) for found in re.findall(pattern, text, re.MULTILINE)}


def executed(
    setup: Setup, machine: str = "mps2-an386", preset: str | None = None
) -> tuple[Path, Counter[int]]:
    """The image, and how often the instruction at each address ran in SAMPLES fast
    interrupts of the running drive."""
    image = _image(machine, preset)
    names = _symbols(image)
    begin = next(a for a, name in names.items() if name == "ht_drive_fast_isr")
    end = next(a for a, name in names.items() if name == "profile_end")
    with tempfile.TemporaryDirectory() as folder:
        _replay(setup, machine, Path(folder), preset)
        (Path(folder) / "profile").touch()
        log = Path(folder) / "log"
        # One instruction per translated block, and no chained blocks: then QEMU logs each one.
        _emulate(machine, image, Path(folder), "-singlestep", "-d", "exec,nochain", "-D", str(log))
        counted: Counter[int] = Counter()
        inside = False
        interrupts = 0
        pattern = re.compile(r"\[[0-9a-f]+/([0-9a-f]+)/")
        with log.open(encoding="utf-8") as file:
            for line in file:
                found = pattern.search(line)
                if not found:
                    continue
                address = int(found[1], 16)
                if address == begin:
                    inside = True
                    interrupts += 1
                elif address == end:
                    inside = False
                if inside:
                    counted[address] += 1
    if interrupts != SAMPLES:
        raise TargetError(f"{machine}: {interrupts} interrupts in the log, not {SAMPLES}")
    return image, counted


def branches(setup: Setup, preset: str) -> tuple[float, float]:
    """Mean numbers of instructions of a fast interrupt: branches, calls and returns, and all
    others, in the Cortex-M4F image that `preset` builds."""
    image, counted = executed(setup, preset=preset)
    places = _branches(image)
    jumps = sum(n for address, n in counted.items() if address in places)
    return jumps / SAMPLES, (counted.total() - jumps) / SAMPLES


def profile(setup: Setup, machine: str = "mps2-an386") -> dict[str, list[tuple[str, float]]]:
    """The instructions of a scheme's fast interrupt by function: mean numbers per interrupt,
    largest first, by "symbol" (compiled function), "function" (source function, inlined ones
    counted separately) and source "line"."""
    image, counted = executed(setup, machine)
    names = _symbols(image)
    starts = np.array(sorted(names))
    by: dict[str, Counter[str]] = {"symbol": Counter(), "function": Counter(), "line": Counter()}
    addresses = sorted(counted)
    for address, places in zip(addresses, _lines(image, addresses)):
        n = counted[address]
        start = int(starts[np.searchsorted(starts, address, "right") - 1])
        by["symbol"][names[start]] += n
        by["function"][places[0][0]] += n
        by["line"][f"{places[0][1]} {places[0][0]}"] += n
    return {
        kind: [(name, n / SAMPLES) for name, n in total.most_common()] for kind, total in by.items()
    }


def instruction_table(result: dict) -> Table:
    """The instructions as a table for the terminal."""
    from rich.table import Table

    table = Table(title="Cortex-M4F instructions per period", title_justify="left")
    headings = ("scheme", "interrupt mean", "max", "/ fdr", "step mean", "max", "/ fdr", "slow max")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "scheme" else "right")
    base = result["fdr"]
    for scheme, row in result.items():
        table.add_row(
            scheme, f"{row['mean']:.0f}", str(row["max"]), f"{row['mean'] / base['mean']:.2f}",
            f"{row['step_mean']:.0f}", str(row["step_max"]),
            f"{row['step_mean'] / base['step_mean']:.2f}", str(row["slow_max"]),
        )  # fmt: skip
    return table


def profile_tables(result: dict, scheme: str, rows: int = 40) -> list:
    """The profile of a scheme as tables for the terminal."""
    from rich.table import Table

    tables = []
    for kind, entries in result.items():
        total = sum(n for _, n in entries)
        table = Table(
            title=f"{scheme}: {total:.0f} instructions a fast interrupt, by {kind}",
            title_justify="left",
        )
        table.add_column(kind)
        table.add_column("mean", justify="right")
        for name, n in entries[:rows]:
            table.add_row(name, f"{n:.1f}")
        tables.append(table)
    return tables
