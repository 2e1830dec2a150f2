"""Cross compilers and emulators: finding them, how to install them, and building with them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

from .. import system
from ..chips import SOURCES
from ..setups import SetupError

#: Program -> the Debian packages that contain it.
PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "avr-gcc": "gcc-avr avr-libc",
    "libsimavr": "libsimavr-dev libelf-dev",
    "clang": "clang",
}
#: The entries that are libraries -> the header that must exist.
HEADERS = {"libsimavr": "simavr/sim_avr.h"}


class MissingTool(SetupError):
    """A program that is needed is not installed."""


class BuildError(SetupError):
    """Building the firmware failed."""


def program(name: str) -> str | None:
    """Path of a program; a program beside the running Python comes first."""
    beside = Path(sys.executable).parent / name
    return str(beside) if beside.exists() else shutil.which(name)


def _present(name: str) -> bool:
    compiler = program("cc")
    if name in HEADERS:
        text = f"#include <{HEADERS[name]}>\n"
        asked = [compiler or "cc", "-E", "-x", "c", "-"]
        return (
            bool(compiler)
            and not subprocess.run(asked, input=text, capture_output=True, text=True).returncode
        )
    found = program(name)
    if name == "arm-none-eabi-gcc" and found:
        asked = [found, "-print-file-name=libc_nano.a"]
        return Path(subprocess.run(asked, capture_output=True, text=True).stdout).is_absolute()
    return found is not None


def missing(*names: str) -> str | None:
    """One line that names the missing programs and how to install them; None if all are there."""
    absent = [name for name in names if not _present(name)]
    if absent:
        packages = " ".join(PACKAGES[name] for name in absent)
        return f"{', '.join(absent)} not found: apt-get install {packages}"
    for name in ("cmake", "ninja"):
        if program(name) is None:
            return f"{name} not found: pip install {name}"
    return None


def need(*names: str) -> None:
    """MissingTool names the programs that are missing."""
    if not system.EMULATORS_RUN:
        raise MissingTool("emulated processors run on Linux and macOS only")
    line = missing(*names)
    if line:
        raise MissingTool(line)


def source_root() -> Path:
    """The folder of CMakeLists.txt: inside the installed package, or of the work tree."""
    return SOURCES.parent


def _build_folder(source: Path, preset: str) -> Path:
    if os.access(source, os.W_OK) and (source / "Makefile").exists():
        return source / "build" / preset
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    place = zlib.crc32(str(source).encode())  # a build folder belongs to one source folder
    return Path(cache) / "hexatorque" / f"{preset}-{place:08x}"


def run(step: list, folder: Path | None = None) -> None:
    """Run one step of a build."""
    done = subprocess.run(step, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        text = (done.stdout + done.stderr).strip()
        raise BuildError(f"{' '.join(map(str, step))} failed:\n{text}")


def _digest(source: Path) -> str:
    files = [source / "CMakeLists.txt", source / "CMakePresets.json"]
    files += [path for part in ("cmake", "firmware") for path in (source / part).rglob("*")]
    crc = 0
    for path in sorted(path for path in files if path.is_file()):
        crc = zlib.crc32(path.relative_to(source).as_posix().encode(), crc)
        crc = zlib.crc32(path.read_bytes(), crc)
    return f"{crc:08x}"


def build(preset: str, *targets: str) -> Path:
    """Build these targets of a CMake preset, or all of them. Returns the folder of the images.

    After any change of the sources everything is compiled. An installed file keeps the time of its
    origin. That time may lie before an object file's, so times do not tell what has changed."""
    source = source_root()
    folder = _build_folder(source, preset)
    folder.mkdir(parents=True, exist_ok=True)
    cmake, ninja, digest = program("cmake"), program("ninja"), _digest(source)
    with (folder / ".lock").open("w", encoding="utf-8") as lock:
        system.lock(lock.fileno(), wait=True)
        built = folder / ".built"
        same = built.exists() and built.read_text(encoding="utf-8") == digest
        fresh = [] if same else ["--fresh"]  # without cache and object files
        built.unlink(missing_ok=True)
        configure = [cmake, "--preset", preset, "-B", folder, "-G", "Ninja", *fresh]
        run([*configure, f"-DCMAKE_MAKE_PROGRAM={ninja}"], source)
        run([cmake, "--build", folder, *(["--target", *targets] if targets else [])], source)
        built.write_text(digest, encoding="utf-8")
    return folder


def objects(folder: Path, *libraries: str) -> dict[Path, Path]:
    """The object file of each source of these libraries or programs, in a build folder."""
    rows = json.loads((folder / "compile_commands.json").read_text(encoding="utf-8"))
    found = {}
    for row in rows:
        output = folder / row["output"]
        if any(f"{name}.dir" in output.parts for name in libraries):
            found[Path(row["file"])] = output
    return found


def optimisation(folder: Path, library: str) -> str:
    """A library's optimisation options: the level, and whether it is optimised when linked."""
    rows = json.loads((folder / "compile_commands.json").read_text(encoding="utf-8"))
    command = next(row["command"] for row in rows if f"{library}.dir" in row["output"]).split()
    level = [word for word in command if word.startswith("-O")][-1]  # the last one counts
    return " ".join([level, *(word for word in command if word == "-flto")])


def main() -> int:
    """Print one line for each missing program of any target. Returns 1 if one is missing."""
    lines = [missing(name) for name in PACKAGES]
    print(*(line for line in lines if line), sep="\n", end="\n" if any(lines) else "")
    return int(any(lines))


if __name__ == "__main__":
    raise SystemExit(main())
