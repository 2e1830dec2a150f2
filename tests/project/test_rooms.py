"""Which part of the host's package may import which.

The imports are read from the sources, including those inside functions: a circle that closes only
when a function runs is still a circle. If a table names modules as text (the formats of recordings,
the figures, the studies), these are not imports, because the code that looks them up depends only
on their interface.
"""

import ast
from pathlib import Path

import pytest

HOST = Path(__file__).resolve().parents[2] / "host"
#: Modules whose imports close no circle, and why.
NO_CIRCLE = {
    "hexatorque": "gives the package's public names when they are asked for, and its own modules "
    "ask it for the version only, or for modules",
}


def name_of(file: Path, root: Path) -> str:
    return ".".join(file.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def imports_of(file: Path, root: Path, known: set[str]) -> set[str]:
    """The modules among `known` that a file imports, wherever in it."""
    package = list(file.relative_to(root).parts[:-1])
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*up, *([node.module] if node.module else [])])
            # An imported name is a module itself, or it is defined in the module that is named.
            names = {f"{base}.{alias.name}" for alias in node.names}
            found |= names & known
            if names - known:
                found.add(base)
    return found & known


def graph_of(root: Path) -> dict[str, set[str]]:
    files = {name_of(file, root): file for file in root.rglob("*.py")}
    return {name: imports_of(file, root, set(files)) for name, file in files.items()}


def circle_in(graph: dict[str, set[str]]) -> list[str]:
    """One circle, its first module again at the end; empty if there is none."""
    done: set[str] = set()

    def follow(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name not in done:
            for other in sorted(graph[name]):
                if found := follow(other, [*path, name]):
                    return found
            done.add(name)
        return []

    for name in sorted(graph):
        if found := follow(name, []):
            return found
    return []


@pytest.fixture(scope="module")
def graph():
    return graph_of(HOST)


def room(name: str) -> str:
    return (name.split(".") + [""])[1]


def test_the_product_needs_no_evidence(graph):
    """Evidence is about the product, so only the commands may import it."""
    users = {name for name, used in graph.items() if "evidence" in map(room, used)}
    assert {room(name) for name in users} == {"evidence", "cli"}


def test_nothing_needs_the_commands(graph):
    users = {name for name, used in graph.items() if "cli" in map(room, used)}
    assert {room(name) for name in users} == {"__main__", "cli"}


def test_there_are_no_circles(graph):
    assert set(NO_CIRCLE) <= set(graph)
    assert circle_in({name: used - set(NO_CIRCLE) for name, used in graph.items()}) == []


def test_the_package_is_asked_for_its_version_only():
    """By its own modules: the reason why it is in the table."""
    names = set()
    for file in HOST.rglob("*.py"):
        depth = len(file.relative_to(HOST).parts) - 1
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and not node.module and node.level == depth:
                names |= {alias.name for alias in node.names}
    modules = {path.stem for path in (HOST / "hexatorque").iterdir()}
    assert names - modules <= {"__version__", "_firmware"}  # the latter is the compiled module


def test_the_check_sees_what_it_looks_for(tmp_path):
    """The check finds imports of all forms, at the top and in functions."""
    for name, text in {
        "p/__init__.py": "",
        "p/a.py": "from . import b\nimport p.c\n",
        "p/b.py": "def f():\n    from .q.d import thing\n",
        "p/c.py": "from .q import d as other\n",
        "p/q/__init__.py": "word = 1\n",
        "p/q/d.py": "import os\nfrom . import word\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    graph = graph_of(tmp_path)
    assert graph == {
        "p": set(), "p.a": {"p.b", "p.c"}, "p.b": {"p.q.d"}, "p.c": {"p.q.d"},
        "p.q": set(), "p.q.d": {"p.q"},
    }  # fmt: skip
    assert circle_in(graph) == []
    (tmp_path / "p/q/d.py").write_text("def f():\n    from ..a import b\n")
    assert circle_in(graph_of(tmp_path)) == ["p.a", "p.b", "p.q.d", "p.a"]
