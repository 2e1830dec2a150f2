"""Cross compilers and emulators: where they are, how to install them, building."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

from ..scenario import ScenarioError

#: Program -> Debian packages that bring it.
PACKAGES = {
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "avr-gcc": "gcc-avr avr-libc",
}


class MissingTool(ScenarioError):
    """Something that has to be installed first."""


class BuildError(ScenarioError):
    """The firmware did not build."""


def program(name: str) -> str | None:
    """Path of a program, first beside the running Python."""
    beside = Path(sys.executable).parent / name
    return str(beside) if beside.exists() else shutil.which(name)


def missing(*names: str) -> str | None:
    """None, or one line that says what is not installed and how to get it."""
    absent = [name for name in names if program(name) is None]
    if "arm-none-eabi-gcc" in names and not absent:
        asked = [program("arm-none-eabi-gcc"), "-print-file-name=libc_nano.a"]
        found = subprocess.run(asked, capture_output=True, text=True).stdout.strip()
        absent += [] if Path(found).is_absolute() else ["arm-none-eabi-gcc"]
    if absent:
        packages = " ".join(PACKAGES[name] for name in absent)
        return f"{', '.join(absent)} not found: apt-get install {packages}"
    for name in ("cmake", "ninja"):
        if program(name) is None:
            return f"{name} not found: pip install {name}"
    return None


def need(*names: str) -> None:
    line = missing(*names)
    if line:
        raise MissingTool(line)


def source_root() -> Path:
    """The folder of CMakeLists.txt: inside the installed package, or of the work tree."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "source", package.parents[1]):
        if (folder / "CMakeLists.txt").exists() and (folder / "firmware").is_dir():
            return folder
    raise BuildError("the firmware's sources are not installed with this package")


def _build_folder(source: Path, preset: str) -> Path:
    if os.access(source, os.W_OK) and (source / "Makefile").exists():
        return source / "build" / preset
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "hexatorque" / preset


def build(preset: str) -> Path:
    """Build a CMake preset; the folder of its images. Does nothing where nothing changed."""
    source = source_root()
    folder = _build_folder(source, preset)
    folder.mkdir(parents=True, exist_ok=True)
    cmake, ninja = program("cmake"), program("ninja")
    steps = (
        [cmake, "--preset", preset, "-B", folder, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={ninja}"],
        [cmake, "--build", folder],
    )
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for step in steps:
            done = subprocess.run(step, cwd=source, capture_output=True, text=True)
            if done.returncode:
                text = (done.stdout + done.stderr).strip()
                raise BuildError(f"building {preset} failed:\n{text}")
    return folder
