"""The stub of the cffi module declares only names that the module has."""

import ast
from importlib.resources import files

from hexatorque import _firmware


def test_what_the_stub_names_is_there():
    tree = ast.parse((files("hexatorque") / "_firmware.pyi").read_text())
    names = [node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)]
    assert names == ["ffi", "lib"]
    assert all(hasattr(_firmware, name) for name in names)
    (described,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    methods = [node.name for node in described.body if isinstance(node, ast.FunctionDef)]
    members = [*methods, *(n.target.id for n in described.body if isinstance(n, ast.AnnAssign))]
    assert {"new", "NULL"} <= set(members)
    assert [name for name in members if not hasattr(_firmware.ffi, name)] == []
