"""The package for an index, in dist/: the sdist and a wheel for each system, made and checked here.

    python tools/wheels.py           all of them; needs the extra `dist`
    python tools/wheels.py windows   only the wheel of this system

Wheels differ in the firmware's library only. zig compiles it for every system from the sources in
the sdist. What is checked: `twine check`; each system's compiler lays structures out as cffi does;
each library has every name that Python asks for; the recipe for conda can be read and has the
package's version and dependencies; and in an empty environment, without a compiler, the wheel for
this computer installs and the tutorial runs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from typing import Any

import layout
from wheel.wheelfile import WheelFile

import hexatorque
from hexatorque import system
from hexatorque._firmware import ffi, lib
from hexatorque.chips import EXACT

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
#: Always the same: zig keeps what it has compiled by its path.
WORK = ROOT / "build" / "dist"
#: Name of a system -> zig's name, tag of the wheel, name of the library.
SYSTEMS = {
    "linux": ("x86_64-linux-gnu.2.17", "manylinux_2_17_x86_64", "libhexatorque.so"),
    "linux-arm64": ("aarch64-linux-gnu.2.17", "manylinux_2_17_aarch64", "libhexatorque.so"),
    "windows": ("x86_64-windows-gnu", "win_amd64", "libhexatorque.dll"),
    "macos": ("x86_64-macos.11.0", "macosx_11_0_x86_64", "libhexatorque.dylib"),
    "macos-arm64": ("aarch64-macos.11.0", "macosx_11_0_arm64", "libhexatorque.dylib"),
}
TUTORIAL = "tests/project/test_tutorial.py::test_every_command_and_picture"


def run(*words: str | Path, **more: Any) -> None:
    if subprocess.run([str(word) for word in words], **more).returncode:
        raise SystemExit(f"wheels: {' '.join(str(word) for word in words[:5])} ... has failed")


def zig(name: str, *words: str | Path) -> None:
    """In a folder below the tree: above zig's own files their paths are other ones, and zig
    compiles the C library again."""
    run(sys.executable, "-m", "ziglang", "cc", "-target", SYSTEMS[name][0], *words, cwd=WORK)


def compiled(name: str, source: Path, folder: Path) -> bytes:
    """The firmware's library for a system."""
    output = folder / name / SYSTEMS[name][2]
    output.parent.mkdir()
    firmware = source / "firmware"
    include = [f"-I{firmware / room}" for room in layout.FOLDERS]
    words: list[str | Path] = [
        *EXACT,
        "-O3",
        "-shared",
        "-DHT_GATES_ACTIVE_LOW=0",
        *include,
        "-o",
        output,
    ]
    if name == "windows":  # a library gives only what is declared so, or listed
        exports = folder / name / "exports.def"
        rows = [f"{n} {'' if function else 'DATA'}" for n, function in wanted().items()]
        exports.write_text("\n".join(["EXPORTS", *rows, ""]), encoding="ascii")
        words.append(exports)
    else:
        words += ["-fPIC", "-s"]  # without -s the C library is that of the C tests
    zig(name, *words, *sources(firmware), "-lm")
    check = folder / name / "layout.c"
    check.write_text(layout.source(), encoding="utf-8")
    zig(name, "-std=c11", *include, "-c", check, "-o", check.with_suffix(".o"))
    image = output.read_bytes()
    missing = [name for name in wanted() if name.encode() + b"\0" not in image]
    if missing:
        raise SystemExit(f"wheels: {output.name} for {name} lacks {', '.join(missing)}")
    return image


def sources(firmware: Path) -> list[Path]:
    """What CMake compiles into the library."""
    return [path for room in layout.FOLDERS for path in sorted((firmware / room).glob("*.c"))]


def wanted() -> dict[str, bool]:
    """What Python takes from the library: its functions and tables. True: a function."""
    names = [name for name in dir(lib) if not name.startswith("HT_")]  # those are numbers
    return {name: ffi.typeof(getattr(lib, name)).kind == "function" for name in names}


def write(name: str, pure: Path, image: bytes) -> Path:
    """The wheel of a system: that of this computer with another library and tag."""
    tag, library = f"py3-none-{SYSTEMS[name][1]}", SYSTEMS[name][2]
    path = DIST / f"{'-'.join(pure.name.split('-')[:2])}-{tag}.whl"
    with WheelFile(pure) as old, WheelFile(path, "w") as new:
        for info in old.infolist():
            base = info.filename.rpartition("/")[2]
            if base.startswith("libhexatorque."):
                new.writestr(info.filename.replace(base, library), image)
            elif base == "WHEEL" and ".dist-info/" in info.filename:
                lines = old.read(info.filename).decode().splitlines()
                kept = [line for line in lines if line and not line.startswith("Tag: ")]
                new.writestr(info.filename, "\n".join([*kept, f"Tag: {tag}", "", ""]))
            elif base != "RECORD":
                new.writestr(info, old.read(info.filename))
    return path


def try_out(wheel: Path, folder: Path) -> None:
    """Install the wheel into an empty environment and follow the tutorial there. No program can be
    found but Python and the shell that reads the tutorial's commands."""
    venv.create(folder / "empty", with_pip=True)
    python = folder / "empty" / "bin" / "python"
    programs = folder / "programs"
    programs.mkdir()
    (programs / "bash").symlink_to(shutil.which("bash") or "/bin/bash")
    alone = {**os.environ, "PATH": str(programs), "CC": "no-compiler"}
    quiet = ("--quiet", "--disable-pip-version-check", "--only-binary", ":all:")
    run(python, "-m", "pip", "install", *quiet, wheel, "pytest", env=alone)
    # Not from the tree: `host` is not in the tests' path.
    run(python, "-m", "pytest", "-q", "-p", "no:cacheprovider", TUTORIAL, cwd=ROOT, env=alone)


def check_recipe() -> None:
    """Let conda's builder read the recipe, and compare it with the package."""
    from rattler_build import Stage0Recipe, VariantConfig

    recipe = Stage0Recipe.from_file(ROOT / "conda" / "recipe.yaml")
    chosen = {"python": ["3.11"], "c_compiler": ["gcc"], "c_stdlib": ["sysroot"]}
    (variant,) = recipe.render(VariantConfig(chosen))
    found = variant.recipe.to_dict()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    # What pip calls matplotlib has a graphical toolkit there.
    listed = [row.replace("matplotlib>", "matplotlib-base>") for row in project["dependencies"]]
    listed.append(f"python{project['requires-python']}")
    told = [row.replace(" ", "") for row in found["requirements"]["run"]]
    if found["package"]["version"] != hexatorque.__version__ or sorted(told) != sorted(listed):
        raise SystemExit("wheels: conda/recipe.yaml has another version or other dependencies")


def main(names: list[str]) -> int:
    for name in names:
        if name not in SYSTEMS:
            raise SystemExit(f"wheels: no system {name!r}: choose from {', '.join(SYSTEMS)}")
    DIST.mkdir(exist_ok=True)
    for path in [*DIST.glob("*.whl"), *DIST.glob("*.tar.gz")]:
        path.unlink()
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    build = (sys.executable, "-m", "uv", "build", "--quiet")
    run(*build, "--sdist", "--out-dir", DIST, ROOT)
    (sdist,) = DIST.glob("*.tar.gz")
    run(*build, "--wheel", "--out-dir", WORK / "here", sdist)
    (here,) = (WORK / "here").glob("*.whl")
    shutil.unpack_archive(sdist, WORK / "source")  # Python 3.11.2 knows no filters
    (source,) = (WORK / "source").iterdir()
    for name in names or SYSTEMS:
        path = write(name, here, compiled(name, source, WORK))
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e6:.1f} MB", flush=True)
    made = [sdist, *DIST.glob("*.whl")]
    run(sys.executable, "-m", "twine", "check", "--strict", *made)
    check_recipe()
    ours = [name for name in names or SYSTEMS if SYSTEMS[name][0] == system.zig_target()]
    for name in ours:
        (wheel,) = DIST.glob(f"*{SYSTEMS[name][1]}.whl")
        try_out(wheel, WORK)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
