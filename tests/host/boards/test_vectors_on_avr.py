"""The core's test vectors with 16-bit int: right, and the host's bits."""

import subprocess
import sys
from pathlib import Path

import pytest

from hexatorque.boards import emulator_process, tools

ROOT = Path(__file__).resolve().parents[3]
HERE = ROOT / "tests/c/targets"
CORE = sorted((ROOT / "firmware/core").glob("*.c"))
FLAGS = ["-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno",
         f"-I{ROOT / 'firmware/core'}", f"-I{ROOT / 'tests/c'}", "-I."]  # fmt: skip


@pytest.fixture(autouse=True)
def tables(tmp_path, monkeypatch):
    """The folder with the header of the vectors is the current one."""
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, ROOT / "tests/vectors/header.py", "vectors.h"], check=True)


def on_host(program: Path, folder: Path) -> str:
    image = folder / "on_host"
    tools.run([tools.program("cc"), *FLAGS, program, *CORE, "-o", image, "-lm"])
    return subprocess.run([image], capture_output=True, text=True).stdout


def on_avr(program: Path, folder: Path) -> str:
    image = folder / "on_avr"
    tools.run(
        ["avr-gcc", "-mmcu=atmega2560", *FLAGS, f'-DPROGRAM="{program}"', HERE / "avr_main.c",
         *CORE, "-o", image, "-lm"]
    )  # fmt: skip
    command = [*emulator_process.avr(image), "-"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    text, status = done.stdout.rsplit("status ", 1)
    assert int(status) == 0, text
    return text


def test_vectors(tmp_path, need):
    need("atmega2560")
    assert on_avr(ROOT / "tests/c/test_vectors.c", tmp_path) == "all passed\n"


def test_bits(tmp_path, need):
    need("atmega2560")
    expected = on_host(HERE / "vector_bits.c", tmp_path)
    assert on_avr(HERE / "vector_bits.c", tmp_path) == expected
    assert [line.split()[0] for line in expected.splitlines()] == [
        "states", "sectors", "duties", "compare",
    ]  # fmt: skip


def test_a_wrong_vector_fails(tmp_path, need):
    """The failure comes out of the machine: one count of one row changed."""
    need("atmega2560")
    text = (ROOT / "tests/c/test_vectors.c").read_text()
    (tmp_path / "wrong.c").write_text(text.replace("c.ca[leg] == r.ca", "c.ca[leg] == r.ca + 1"))
    with pytest.raises(AssertionError, match="vectors: compare, row 0"):
        on_avr(tmp_path / "wrong.c", tmp_path)
