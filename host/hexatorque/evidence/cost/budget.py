"""`hexatorque evidence budget`: what the firmware costs on embedded processors, held against the
limits in firmware/budget.toml. Instructions: `count`. Stack: `stack`. Sizes: here.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

from ... import chips, firmware, setups
from ...boards import tools
from ...experiments.operating_points import Progress
from ...setups import Setup
from ...setups.derived import WRITTEN_WITHIN
from ...setups.review import BOTH_SETS
from . import count, stack

#: The machine whose instructions and stack are limited.
MACHINE = "mps2-an386"
#: The drive's entry points, by their caller: two interrupts and the background.
ENTRIES = {
    "fast interrupt": ("ht_drive_fast_isr",),
    "slow interrupt": ("ht_drive_slow_isr",),
    "commands": ("ht_drive_init", "ht_drive_set", "ht_drive_start", "ht_drive_stop",
                 "ht_drive_clear"),
}  # fmt: skip
#: The only library function that the fast interrupt may call.
ALLOWED_CALLS = {"sqrtf"}
#: The Cortex-M4F's images, compiled file by file at -O2 like those of all other targets.
BY_FILE = "mps2-by-file"
#: Targets whose sizes are measured -> CMake preset, prefix of its binary utilities.
TARGETS = {
    "host": ("host", ""),
    MACHINE: (BY_FILE, "arm-none-eabi-"),
    "atmega2560": ("avr", "avr-"),
}
#: Folders of the firmware whose sizes count; the last one only where it is compiled.
ROOMS = ("core", "app", "port/c2000")
XCP = "link/xcp"
#: The scheme whose positions count from a fifth of the voltage on, and a set-up in which they do.
PLACING, PLACED = "db-ipwm", "paper-b"
#: A machine with magnets, and a scheme of each law that drives it.
MAGNETS, OF_MAGNETS = "magnet-interior", ("ddr", "db-dtfc", "foc")
#: Both ends of the knob of PLACING, and the aims for its instructions: mean, largest.
PLACED_SHARES, PLACED_AIMS = (0.0, 1.0), (2000, 2300)
ESTIMATED = ("ddr", "db-dtfc", "foc", PLACING)
#: Sampling frequencies at which the page holds the estimate against the period.
SAMPLED_HZ = (8e3, 12e3, 16e3)


def _stack(preset: str) -> tuple[dict, list[str]]:
    """The deepest path from each kind of entry, and the library functions that the fast interrupt
    calls."""
    folder = tools.build(preset, "count")
    objects = tools.objects(folder, "ht_core", "count").values()
    graph = stack.call_graph(folder / count.IMAGE, objects)
    paths = {}
    for kind, entries in ENTRIES.items():
        size, path = max(stack.deepest(graph, entry) for entry in entries)
        paths[kind] = {"bytes": size, "path": path}
    return paths, sorted(stack.library_calls(graph, "ht_drive_fast_isr") - ALLOWED_CALLS)


def _sections(folder: Path, prefix: str, *names: str) -> dict[str, int]:
    """Bytes of code and constants of these folders of the firmware."""
    rooms = [tools.source_root() / "firmware" / name for name in names]
    built = tools.objects(folder, "ht_core", "ht_app")
    objects = [file for source, file in built.items() if source.parent in rooms]
    listed = subprocess.run(
        [f"{prefix}size", "-A", *objects], capture_output=True, text=True, check=True
    ).stdout
    sections = re.findall(r"^(\.\S+)\s+(\d+)\s+\d+$", listed, re.MULTILINE)
    total = {"code": 0, "constants": 0}
    for name, size in sections:
        if name.startswith(".text"):
            total["code"] += int(size)
        elif name.startswith((".rodata", ".data", ".bss")):
            total["constants"] += int(size)
    return total


def _sizes(preset: str, prefix: str) -> dict[str, int]:
    """Bytes of code and constants of core, app and C2000 driver, of one drive's data, and of XCP's
    code and constants."""
    folder = tools.build(preset, "ht_app", "ht_sizes")
    total = _sections(folder, prefix, *ROOMS)
    (drive,) = tools.objects(folder, "ht_sizes").values()
    named = subprocess.run(
        [f"{prefix}nm", "--print-size", drive], capture_output=True, text=True, check=True
    ).stdout
    (size,) = re.findall(r"^\S+ (\S+) \w ht_one_drive$", named, re.MULTILINE)
    return {**total, "drive": int(size, 16), "xcp": sum(_sections(folder, prefix, XCP).values())}


def _image_bytes(preset: str) -> int:
    """Bytes of code and constants in the counting image."""
    image = tools.build(preset, "count") / count.IMAGE
    listed = subprocess.run(
        ["arm-none-eabi-size", image], capture_output=True, text=True, check=True
    ).stdout
    return int(listed.splitlines()[1].split()[0])


def _estimate(setup: Setup, scheme: str) -> dict:
    """Lower and upper estimate of the cycles of a scheme's fast interrupt on a C28x."""
    at = setups.load(PLACED) if scheme == PLACING else setup
    jumps, others = count.branches(at.with_scheme(scheme), BY_FILE)
    low, high = (others * plain + jumps * jump for plain, jump in chips.C28X_CYCLES)
    return {
        "branches": round(jumps), "other_instructions": round(others),
        "low_cycles": round(low), "high_cycles": round(high),
    }  # fmt: skip


def _version(compiler: str) -> str:
    text = subprocess.run([compiler, "--version"], capture_output=True, text=True).stdout
    return text.splitlines()[0]


def measure(setup: Setup, progress: Progress | None = None) -> dict:
    """Measure everything that docs/budget.json contains. Without its compiler, a target is left
    out of the sizes."""
    tools.need("arm-none-eabi-gcc", "qemu-system-arm")
    stacks, calls = _stack("mps2")
    sizes = {"host": _sizes(*TARGETS["host"]), MACHINE: _sizes(*TARGETS[MACHINE])}
    if tools.missing("avr-gcc") is None:
        sizes["atmega2560"] = _sizes(*TARGETS["atmega2560"])
    instructions, used = count.instructions(setup, MACHINE, progress)
    return {
        MACHINE: {
            **instructions,
            "placed": placed(),
            "magnets": with_magnets(),
            "stack_bytes": max(row["bytes"] for row in stacks.values()),
            "stack": stacks,
            "stack_used_bytes": used,
            "library_calls": calls,
            "image_bytes": _image_bytes("mps2"),
            "image_by_file_bytes": _image_bytes(BY_FILE),
        },
        "sizes": sizes,
        "c28x_estimate": {scheme: _estimate(setup, scheme) for scheme in ESTIMATED},
        "setup": setup.name,
        "compiler": _version("arm-none-eabi-gcc"),
        "options": tools.optimisation(tools.build("mps2", "count"), "ht_core"),
    }


def placed() -> list[dict]:
    """The instructions of PLACING at points where its positions count; where both sets begin
    together, with clamped legs, which take more."""
    setup = setups.load(PLACED).with_scheme(
        PLACING, controller__clamp="alternating", controller__kappa_from_pu=0.0
    )
    return [
        {"thd_share": share, **count.of_a_run(setup.changed(controller__thd_share=share), MACHINE)}
        for share in PLACED_SHARES
    ]


def with_magnets() -> dict[str, dict]:
    """The instructions of a scheme of each law on a machine with magnets."""
    setup = setups.load(MAGNETS)
    return {scheme: count.of_a_run(setup.with_scheme(scheme), MACHINE) for scheme in OF_MAGNETS}


def limits() -> dict:
    return chips.budget()


def exceeded(result: dict, limit: dict) -> list[str]:
    """The limits that are exceeded, one line each."""
    found = result[MACHINE]
    bound = limit[MACHINE]
    lines = []

    def hold(what: str, value: float, most: float) -> None:
        if not value <= most:
            lines.append(f"{what}: {value:g}, limit {most:g}")

    for kind in ("mean", "max"):
        for scheme, most in bound[kind].items():
            hold(f"{scheme}, {kind} instructions", found[scheme][kind], most)
    longest = {"smooth": found["placed"][0], "clean": found["placed"][1], **found["magnets"]}
    for name, most in bound["longest"].items():
        hold(f"{name}, longest interrupt", longest[name]["max"], most)
    for scheme, most in limit["c28x_cycles"].items():
        hold(f"{scheme}, C28x cycles", result["c28x_estimate"][scheme]["high_cycles"], most)
    ratio = found["ddr"]["mean"] / found["fdr"]["mean"]
    hold("ddr over fdr", round(ratio, 3), bound["ddr_over_fdr"])
    hold("stack, bytes", found["stack_bytes"], bound["stack_bytes"])
    hold("image, bytes", found["image_bytes"], bound["image_bytes"])
    for target, rows in limit["sizes"].items():
        for what, most in rows.items():
            if target in result["sizes"]:
                hold(f"{target}, {what}, bytes", result["sizes"][target][what], most)
    for name in found["library_calls"]:
        lines.append(f"the fast interrupt calls {name}")
    return lines


def write(result: dict, folder: Path) -> list[Path]:
    """Write budget.json and budget.md."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / "budget.json", folder / "budget.md"]
    files[0].write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    files[1].write_text(page(result, limits()), encoding="utf-8")
    return files


PAGE = """\
# Budget

This page is generated by `make budget` (`hexatorque evidence budget -o docs`); do not edit it. The
numbers are in `budget.json`, the limits in `firmware/budget.toml`. `hexatorque evidence budget`
fails if a limit is exceeded.

## Instructions
Cortex-M4F, {compiler}, {options}. The run is one second of `{setup}`, from the start over the flux
build-up to the rated load. It is replayed on QEMU's mps2-an386, whose clock under `-icount` counts
instructions exactly. *Interrupt* is the whole fast interrupt, *step* is `ht_control_step` in it.
Means are taken while the drive runs, maxima from the start on.

{instructions}

`ddr` is {ratio:.2f} times `fdr` (limit {ratio_limit:g}; paper A's run times: 1.95). The goal for
the mean of `ddr` is {goal} instructions: {verdict}. `hexatorque evidence budget --profile ddr`
shows where the instructions go.

Where its positions count (`{placed}`), `{placing}` takes {smooth} in the mean and {smooth_max} at
most; with `thd_share = 1` and clamped legs, whose sets decide in one interrupt, {clean} and
{clean_max}. The aims, {aim} and {aim_max}, are missed: positions take 330, finding a lost leg 85 to
88 (45 to 49 where the law needs the x–y voltage anyway). Beside `{placing}` the other schemes take
up to 7 more, and up to 19 in the interrupt that changes over.

With magnets (`{magnets}`): {of_magnets}. The maxima are of the start, where the rotor is aligned.

The fast interrupt calls no library function{calls}; square roots are the processor's own.

## Estimate for a C28x
**This is an estimate; nothing has run on that processor.** The build lets TI's compiler work file
by file (`--opt_level=2`). The table has the instructions of a Cortex-M4F compiled in this way at
-O2. Branches, calls and returns count 4 to 7 cycles, the depth of the C28x's pipeline, others 1 to
1.5, without wait states. The last columns are the upper estimate's share of the period at that
f_isr. `{placing}` runs on `{placed}`, where
its positions count; with `thd_share` above 0 it takes {both} times as long. Where less than
{left:.0f} % is left, `hexatorque check` has a note.

{estimates}

## Stack
Bytes, Cortex-M4F, from `-fstack-usage` along the deepest path of the call graph (disassembly; no
calls through pointers, no recursion). In the replay the fast interrupt used {measured} at most.

{stack}

All three on one stack, with the {exception} bytes that each interrupt adds by itself: {together}.

## Sizes
Bytes of core, app and C2000 driver (atmega2560: without driver; constants: with the texts of the
parameter and channel tables), of the data of one drive, and of [XCP](xcp.md), which an image has or
has not; compiled file by file at -O2 (atmega2560: the app at -Os). The image that is counted above,
compiled as stated there, has {image} bytes instead of {image_by_file}.

{sizes}
"""


def _rows(headings: tuple[str, ...], rows: list[tuple]) -> str:
    lines = ["| " + " | ".join(headings) + " |", "|---|" + "---:|" * (len(headings) - 1)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def _estimates(found: dict[str, dict]) -> str:
    clocks = {name: firmware.board_of(name).map.system_clock_Hz for name in chips.DEVICES}
    times = [f"us, {name}, {1e-6 * clock:.0f} MHz" for name, clock in clocks.items()]
    slowest = min(clocks, key=clocks.__getitem__)
    shares = [f"{slowest}, {1e-3 * f:g} kHz" for f in SAMPLED_HZ]
    rows = []
    for scheme, row in found.items():
        low, high = row["low_cycles"], row["high_cycles"]
        rows.append(
            (
                scheme, row["other_instructions"], row["branches"],
                *(f"{1e6 * low / c:.0f} to {1e6 * high / c:.0f}" for c in clocks.values()),
                *(f"{100 * high * f / clocks[slowest]:.0f} %" for f in SAMPLED_HZ),
            )
        )  # fmt: skip
    return _rows(("scheme", "instructions", "branches", *times, *shares), rows)


def page(result: dict, limit: dict) -> str:
    """The text of budget.md."""
    found, bound = result[MACHINE], limit[MACHINE]
    schemes = [name for name in found if isinstance(found[name], dict) and "mean" in found[name]]
    rows = [
        (name, f"{row['mean']:.0f}", bound["mean"][name], row["max"], bound["max"][name],
         f"{row['step_mean']:.0f}", row["step_max"])
        for name, row in ((name, found[name]) for name in schemes)
    ]  # fmt: skip
    headings = ("scheme", "interrupt, mean", "limit", "max", "limit", "step, mean", "max")
    goal = limit["goals"]["ddr_mean"]
    deepest = {kind: row["bytes"] for kind, row in found["stack"].items()}
    smooth, clean = found["placed"]
    together = sum(deepest.values()) + 2 * stack.EXCEPTION_BYTES
    return PAGE.format(
        compiler=result["compiler"], options=result["options"], setup=result["setup"],
        instructions=_rows(headings, rows),
        ratio=found["ddr"]["mean"] / found["fdr"]["mean"], ratio_limit=bound["ddr_over_fdr"],
        goal=goal, verdict="met" if found["ddr"]["mean"] <= goal else "not met",
        calls=f" but {', '.join(found['library_calls'])}" if found["library_calls"] else "",
        magnets=MAGNETS,
        of_magnets="; ".join(
            f"`{scheme}` {row['mean']:.0f} in the mean, {row['max']} at most"
            for scheme, row in found["magnets"].items()
        ),
        placing=PLACING, placed=PLACED, aim=PLACED_AIMS[0], aim_max=PLACED_AIMS[1],
        smooth=f"{smooth['mean']:.0f}", smooth_max=smooth["max"],
        clean=f"{clean['mean']:.0f}", clean_max=clean["max"], left=100 - 100 * WRITTEN_WITHIN,
        both=BOTH_SETS,
        estimates=_estimates(result["c28x_estimate"]),
        image=found["image_bytes"], image_by_file=found["image_by_file_bytes"],
        exception=stack.EXCEPTION_BYTES,
        stack=_rows(
            ("entry", "bytes", "path"),
            [
                (kind, row["bytes"], " → ".join(row["path"]))
                for kind, row in found["stack"].items()
            ],
        ),
        together=together, measured=found["stack_used_bytes"],
        sizes=_rows(
            ("target", "code", "constants", "data of a drive", "XCP"),
            [(name, *row.values()) for name, row in result["sizes"].items()],
        ),
    )  # fmt: skip


def tables(result: dict) -> list:
    """The results as tables for the terminal."""
    from rich.table import Table

    found = result[MACHINE]
    memory = Table(title="stack and size, bytes", title_justify="left")
    memory.add_column("")
    memory.add_column("bytes", justify="right")
    for kind, row in found["stack"].items():
        memory.add_row(f"{MACHINE}, stack of {kind}", str(row["bytes"]))
    for target, row in result["sizes"].items():
        for what, size in row.items():
            memory.add_row(f"{target}, {what}", str(size))
    schemes = {k: v for k, v in found.items() if isinstance(v, dict) and "mean" in v}
    return [count.instruction_table(schemes), memory]
