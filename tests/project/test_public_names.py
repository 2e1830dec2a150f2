"""The names at the top of the package: each is the object that its module defines, a type
checker sees the same ones, and importing the package alone loads nothing heavy."""

import ast
import importlib
import json
import subprocess
import sys

import pytest

import hexatorque

#: Modules that take long to import.
HEAVY = ("numpy", "numba", "matplotlib", "cffi", "rich", "serial")


def fresh(code: str) -> str:
    """The output of a new Python process."""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout


@pytest.mark.parametrize("name", hexatorque.__all__)
def test_a_name_is_its_module_s_object(name):
    value = getattr(hexatorque, name)
    assert value is getattr(importlib.import_module(value.__module__), name)
    assert value.__doc__, f"{name} has no docstring, and the reference shows it"


def test_a_type_checker_sees_the_same_names():
    with open(hexatorque.__file__) as file:
        tree = ast.parse(file.read())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {alias.name: f.module for f in block.body for alias in f.names}
    assert seen == hexatorque._HOMES
    assert set(seen) == set(hexatorque.__all__)


def test_another_name_is_an_error():
    with pytest.raises(AttributeError, match="no attribute 'Simulation'"):
        _ = hexatorque.Simulation
    assert set(hexatorque.__all__) <= set(dir(hexatorque))


def test_import_loads_nothing_heavy():
    loaded = json.loads(fresh("import hexatorque, json, sys; print(json.dumps(list(sys.modules)))"))
    assert not [name for name in HEAVY if name in loaded]
    assert [name for name in loaded if name.startswith("hexatorque.")] == []
