"""cffi opens the firmware's library without a compiler, so it works out by itself where each member
of a structure lies. Here a compiler says the same."""

import subprocess

import layout
import pytest

from hexatorque.boards.tools import program


def compiled(source):
    return subprocess.run(
        [program("cc"), *layout.OPTIONS, "-x", "c", "-"], input=source, text=True,
        capture_output=True,
    )  # fmt: skip


def test_a_compiler_lays_structures_out_as_cffi_does():
    source = layout.source()
    assert source.count("sizeof(ht_drive)") == 1 and source.count("ht_service_setup") > 3
    done = compiled(source)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("piece", ["sizeof(ht_drive) == ", "offsetof(ht_snapshot, faults) == "])
def test_a_difference_is_found(piece):
    done = compiled(layout.source().replace(piece, piece + "1"))
    assert done.returncode and "static assertion failed" in done.stderr
