"""`make dist`: what differs between the wheels of the systems, and what does not."""

import json
import subprocess
from pathlib import Path

import pytest
import wheels
from ccs_projects import CMAKE
from stand_in_compiler import needs_cmake
from wheel.wheelfile import WheelFile

from hexatorque._firmware import lib

#: An object of its own, not in the library.
SIZES = wheels.ROOT / "firmware" / "tools" / "ht_sizes.c"


@pytest.fixture
def ours(tmp_path, monkeypatch):
    """A wheel of this computer."""
    monkeypatch.setattr(wheels, "DIST", tmp_path)
    path = tmp_path / "hexatorque-1.2-py3-none-linux_x86_64.whl"
    with WheelFile(path, "w") as wheel:
        wheel.writestr("hexatorque/drive.py", "drive = 1\n")
        wheel.writestr("hexatorque/libhexatorque.so", b"ours")
        wheel.writestr(
            "hexatorque-1.2.dist-info/WHEEL",
            "Wheel-Version: 1.0\nRoot-Is-Purelib: false\nTag: py3-none-linux_x86_64\n\n",
        )
    return path


@pytest.mark.parametrize("name", wheels.SYSTEMS)
def test_a_wheel_differs_in_library_and_tag(name, ours):
    _, tag, library = wheels.SYSTEMS[name]
    path = wheels.write(name, ours, b"theirs")
    assert path.name == f"hexatorque-1.2-py3-none-{tag}.whl"
    with WheelFile(path) as wheel:  # compares each file with its row of RECORD
        assert sorted(wheel.namelist()) == sorted(
            ["hexatorque/drive.py", f"hexatorque/{library}", "hexatorque-1.2.dist-info/WHEEL",
             "hexatorque-1.2.dist-info/RECORD"]
        )  # fmt: skip
        assert wheel.read(f"hexatorque/{library}") == b"theirs"
        assert wheel.read("hexatorque/drive.py") == b"drive = 1\n"
        lines = wheel.read("hexatorque-1.2.dist-info/WHEEL").decode().split("\n")
        assert [line for line in lines if "Tag" in line] == [f"Tag: py3-none-{tag}"]


def test_a_library_has_all_that_python_takes():
    """Windows gives what is listed only. Functions and tables are listed in different ways."""
    names = wheels.wanted()
    assert names["ht_drive_init"] and not names["ht_f28335"]
    assert all(hasattr(lib, name) for name in names) and len(names) > 150
    assert not [name for name in names if name.startswith("HT_")]


@needs_cmake
def test_zig_compiles_what_cmake_compiles(tmp_path):
    said = ("-DHT_PYTHON_MODULE=ON", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON")
    subprocess.run([CMAKE, "-S", wheels.ROOT, "-B", tmp_path, *said], check=True)
    commands = json.loads((tmp_path / "compile_commands.json").read_text(encoding="utf-8"))
    files = {Path(command["file"]) for command in commands} - {SIZES}
    assert sorted(files) == sorted(wheels.sources(wheels.ROOT / "firmware"))


def test_a_system_that_is_none_is_named(ours, monkeypatch):
    monkeypatch.setattr(wheels, "WORK", ours.parent / "work")
    with pytest.raises(SystemExit, match="no system 'amiga': choose from linux, "):
        wheels.main(["amiga"])


@pytest.mark.parametrize(
    "row, other",
    [
        ("- numba >=0.61", "- numba >=0.60"),
        ('version: "', 'version: "1'),
        ("    - rich >=13\n", ""),
    ],
)
def test_a_recipe_for_conda_that_differs_is_refused(row, other, tmp_path, monkeypatch):
    pytest.importorskip("rattler_build", reason="make dist installs it")
    for name in ("conda/recipe.yaml", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text((wheels.ROOT / name).read_text())
    monkeypatch.setattr(wheels, "ROOT", tmp_path)
    wheels.check_recipe()
    recipe = tmp_path / "conda" / "recipe.yaml"
    assert row in recipe.read_text()
    recipe.write_text(recipe.read_text().replace(row, other))
    with pytest.raises(SystemExit, match="another version or other dependencies"):
        wheels.check_recipe()
