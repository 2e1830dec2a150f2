"""The FMU of a controller or of a whole drive: sources, binaries, model description in one file."""

from __future__ import annotations

import hashlib
import importlib.util
import re
import struct
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import numpy as np

from .. import firmware, system
from ..boards.tools import BuildError, program
from ..chips import EXACT, SOURCES
from ..drive.parts import SHORTEST_STEP_S, friction_Nms, sensors
from ..drive.simulated import SimulatedDrive
from ..plant.breaks import breaks_of
from ..plant.legs import KINDS, OPEN
from ..plant.load_kinds import LOADS
from ..setups import Setup, SetupError, parameters
from ..to_c import plant
from .description import build_description, identifier, model_description
from .variables import starts, variables

#: Folders of the firmware that the FMU has; of the last one only one of the two interfaces.
FOLDERS = (
    "core", "app", "link", "port", "port/c2000", "port/host", "port/fmu/variables", "port/fmu",
)  # fmt: skip
#: What `hexatorque fmu` writes for the sources.
MADE = "ht_fmu_made.h"
INITIAL = "ht_fmu_initial.h"
DATA = "ht_plant_data.h"
#: What the build system otherwise defines: a tool may compile without options.
DEFINED = {
    "HT_GATES_ACTIVE_LOW": "0",
    "HT_FMU_MADE": f'"{MADE}"',
    "HT_INITIAL_VALUES": f'"{INITIAL}"',
}
HIDDEN = ("-O2", "-shared", "-fvisibility=hidden")

#: zig's names of systems -> folder in an FMU of version 2 and of version 3, suffix. There is no
#: name for arm64 in version 2: there one file serves both processors of macOS.
ZIG = {
    "x86_64-linux-gnu.2.17": ("linux64", "x86_64-linux", ".so"),
    "x86_64-windows-gnu": ("win64", "x86_64-windows", ".dll"),
    "x86_64-macos": ("darwin64", "x86_64-darwin", ".dylib"),
    "aarch64-macos": ("darwin64", "aarch64-darwin", ".dylib"),
}
HERE = system.zig_target()


def _alone(text: str, of: str) -> str:
    """Source text that needs no options: all headers lie in the same folder, and what it asks the
    build system for is defined in it."""
    defined = DEFINED | ({"HT_FMU_PLANT": "1"} if of == "drive" else {})
    used = [f"#define {n} {v}" for n, v in defined.items() if re.search(rf"\b{n}\b", text)]
    flat = re.sub(r'(#include ")(?:[\w.]+/)+', r"\1", text)
    return "".join(f"{line}\n" for line in used) + flat


def sources(setup: Setup, of: str, version: int) -> dict[str, str]:
    """The files in `sources`: name -> text, without the one that has the token."""
    found = {}
    for folder in FOLDERS:
        for path in sorted((SOURCES / folder).iterdir()):
            other = path.name.startswith(f"ht_fmi{5 - version}")
            if path.suffix in (".c", ".h", ".def") and not other:
                found[path.name] = _alone(path.read_text(encoding="utf-8"), of)
    literals = {name: repr(np.float32(v).item()) for name, v in starts(setup).items()}
    lines = [f"#define HT_INITIAL_{name} ({text}f)" for name, text in literals.items()]
    found[INITIAL] = "\n".join([f"/* The parameters of {setup.name}. */", *lines]) + "\n"
    return found | (_plant(setup) if of == "drive" else _encoder(setup))


def _encoder(setup: Setup) -> dict[str, str]:
    """The set-up's encoder in C."""
    made, period_s = _controller(setup)
    data = plant.initialiser(sensors(setup, made, period_s))
    text = f"""\
/* The encoder of {setup.name}. */
static const struct plant_sensors sensors_data = {data};
"""
    return {DATA: text, **plant.translate_encoder()}


def _plant(setup: Setup) -> dict[str, str]:
    """The plant in C and how it is at the beginning."""
    sim = SimulatedDrive(setup)
    sim.inverter.more = 0  # its row has the columns that every set-up has
    parts = {
        "machine": sim._machine, "load": sim._load,
        "inverter": sim.inverter, "sensors": sim.sensors, "timing": sim._timing,
        "map": sim._map, "pwm": sim._pwm, "gates": sim._gates,
    }  # fmt: skip
    lines = [
        f"static const struct plant_{name} {name}_data = {plant.initialiser(part)};"
        for name, part in parts.items()
    ]
    opens = breaks_of("open", 0.0, 1e-3 * setup["inverter.bounce_ms"])
    numbers = {
        "LOAD_KIND": LOADS.index(setup["load.kind"]),
        "LOAD_AT_RPM": float(setup["load.at_rpm"]),
        "VISCOUS_NMS": friction_Nms(setup),
        "INERTIA_KGM2": float(setup["machine.inertia_kgm2"]),
        "SWING_PER_S": float(sim._swing_per_s),
        "WINDINGS_STEP_S": float(sim._windings_step_s),
        "SHORTEST_STEP_S": SHORTEST_STEP_S,
        "OPEN_KIND": OPEN,
        "OPENS": len(opens),
    }
    text = "\n".join(
        [
            f"/* The plant of {setup.name} at the beginning. */",
            *(f"#define {name} {value!r}" for name, value in numbers.items()),
            *lines,
            f"static const double y_data[8] = {plant.initialiser(sim.plant_state)};",
            "/* When an open leg's contact opens and closes, and what it does then. */",
            f"static const double opens_s[OPENS] = {{{', '.join(repr(s) for s, _ in opens)}}};",
            "static const int64_t opens_kind[OPENS] = "
            f"{{{', '.join(str(KINDS.index(kind)) for _, kind in opens)}}};",
        ]
    )
    return {DATA: text + "\n", **plant.translate(sim._machine.dtype)}


def _controller(setup: Setup) -> tuple[firmware.Controller, float]:
    """The firmware with the set-up's parameters, and its period. It says what it refuses."""
    made = firmware.Controller(setup["timing.device"], parameters(setup))
    return made, made.period_counts / float(made.map.pwm_clock_Hz)


def _made(setup: Setup, token: str) -> str:
    return (
        "/* The set-up of this FMU. */\n"
        f'#define HT_FMU_TOKEN "{token}"\n'
        f"#define HT_FMU_BOARD ht_board_{setup['timing.device']}\n"
        f"#define HT_FMU_VDC_V ((double){float(setup['inverter.vdc_V'])!r}L)\n"
    )


def has_zig() -> bool:
    """Whether the optional package that compiles for other systems is installed."""
    return importlib.util.find_spec("ziglang") is not None


def compiled(compiler: list[str], folder: Path, output: Path) -> bytes:
    """The binary of the sources in a folder."""
    files = sorted(path.name for path in folder.glob("*.c"))
    command = [*compiler, *EXACT, *HIDDEN, "-o", str(output), *files, "-lm"]
    if output.suffix != ".dll":
        command.insert(len(compiler), "-fPIC")
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise BuildError(f"{' '.join(compiler)} failed:\n{done.stderr.strip()}")
    return output.read_bytes()


def fat(*images: bytes) -> bytes:
    """One file for macOS of the images for several processors."""
    align = 14
    at = 1 << align
    head, body = struct.pack(">II", 0xCAFEBABE, len(images)), b""
    for image in images:
        cpu, kind = struct.unpack("<II", image[4:12])
        head += struct.pack(">IIIII", cpu, kind, at + len(body), len(image), align)
        body += image + bytes(-len(image) % (1 << align))
    return head.ljust(at, b"\0") + body


def _binaries(
    of: str, folder: Path, out: Path, version: int, only_here: bool, progress: Callable[[str], None]
) -> dict[str, bytes]:
    """Path in the FMU -> binary."""
    if not has_zig():
        found = program("cc") or program("gcc") or program("clang")
        if HERE not in ZIG or found is None:
            raise SetupError("fmu: no compiler for it here: pip install 'hexatorque[fmu]'")
        targets = {HERE: [found]}
    else:
        zig = [sys.executable, "-m", "ziglang", "cc", "-target"]
        targets = {name: [*zig, name] for name in ZIG if not only_here or name == HERE}
    images: dict[str, list[bytes]] = {}
    for name, compiler in targets.items():
        progress(name)
        place, suffix = ZIG[name][version - 2], ZIG[name][2]
        image = compiled(compiler, folder, out / f"{name}{suffix}")
        images.setdefault(f"binaries/{place}/{identifier(of)}{suffix}", []).append(image)
    return {path: fat(*parts) if len(parts) > 1 else parts[0] for path, parts in images.items()}


def licence() -> str:
    """The package's licence, which has to be with its sources."""
    files = metadata.files("hexatorque") or []
    own = [path for path in files if path.match("*.dist-info/licenses/LICENSE")]
    return (
        own[0].read_text(encoding="utf-8")
        if own
        else (SOURCES.parent / "LICENSE").read_text(encoding="utf-8")
    )


def write(
    path: Path,
    setup: Setup,
    of: str = "controller",
    version: int = 2,
    only_here: bool = False,
    progress: Callable[[str], None] = lambda name: None,
) -> list[str]:
    """Write the FMU of a set-up. of: its kind (`variables.KINDS`); version: of FMI, 2 or 3;
    only_here: without binaries for other systems; progress: called with the name of each system.
    Returns what systems it has binaries for."""
    _, period_s = _controller(setup)  # what the firmware refuses is told before all else
    files = sources(setup, of, version)
    code = [name for name in files if name.endswith(".c")]
    found = variables(setup, of)
    description = model_description(of, version, setup.title, "", period_s, found, code)
    token = _token([description, *(t.encode() for pair in files.items() for t in pair)])
    description = model_description(of, version, setup.title, token, period_s, found, code)
    files[MADE] = _made(setup, token)
    with tempfile.TemporaryDirectory() as place:
        folder, out = Path(place, "sources"), Path(place, "out")
        folder.mkdir()
        out.mkdir()
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        binaries = _binaries(of, folder, out, version, only_here, progress)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        for name, image in binaries.items():
            archive.writestr(name, image)
        for name, text in files.items():
            archive.writestr(f"sources/{name}", text)
        archive.writestr(
            "sources/buildDescription.xml", build_description(of, code, " ".join(EXACT))
        )
        archive.writestr("documentation/licenses/license.txt", licence())
    return [name.split("/")[1] for name in binaries]


def _token(parts: list[bytes]) -> str:
    """A token of all that the FMU is made of, in the form of a GUID."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    text = digest.hexdigest()
    return "{" + "-".join((text[:8], text[8:12], text[12:16], text[16:20], text[20:32])) + "}"
