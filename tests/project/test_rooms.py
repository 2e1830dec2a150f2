"""Which part of the host's package may import which, and which file of the firmware may call which.

The imports are read from the sources, including those inside functions: a circle that closes only
when a function runs is still a circle. If a table names modules as text (the formats of recordings,
the figures, the studies), these are not imports, because the code that looks them up depends only
on their interface.
"""

import ast
import re
from pathlib import Path

import pytest

HOST = Path(__file__).resolve().parents[2] / "host"
FIRMWARE = HOST.parent / "firmware"
#: Modules whose imports close no circle, and why.
NO_CIRCLE = {
    "hexatorque": "gives the package's public names when they are asked for, and its own modules "
    "ask it for the version only, or for modules",
}

#: The floors of the house, the lowest first. A room needs rooms on lower floors only.
FLOORS = (
    {"build", "chips", "errors", "plant", "system"},
    {"parallel"},
    {"given", "results", "to_c"},
    {"firmware"},
    {"laws", "recording", "setups"},
    {"serial"},
    {"analysis", "drive"},
    {"boards", "commissioning", "experiments"},
    {"fmu", "gym", "monitor", "sweeps", "tuning", "twin"},
    {"evidence"},
    {"cli"},
    {"__main__"},
)
#: Rooms that need one on their own floor or a higher one, and why.
STAIRS = {("recording", "analysis"): "a recording draws itself"}


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


def test_a_room_needs_lower_floors_only(graph):
    """So a drive needs no evaluation, and nothing but experiments and what is above them knows how
    a drive is measured."""
    floor_of = {name: floor for floor, rooms in enumerate(FLOORS) for name in rooms}
    assert {room(name) for name in graph} - {""} == set(floor_of)
    up = {
        (room(name), room(other)): f"{name} needs {other}"
        for name, used in graph.items()
        for other in used
        if room(name) != room(other) and room(name) and room(other)
        and floor_of[room(other)] >= floor_of[room(name)]
    }  # fmt: skip
    assert set(up) == set(STAIRS), up


def test_a_study_does_not_need_the_report_of_a_comparison(graph):
    """What `compare` writes: its pictures and pages would be loaded into every worker."""
    written = "hexatorque.experiments.written"
    assert {room(name) for name, used in graph.items() if written in used} == {"cli"}


def test_private_names_stay_in_their_module():
    """Names that begin with an underscore; `_firmware` opens the compiled library."""
    taken = {
        f"{name_of(file, HOST)}: {alias.name}"
        for file in HOST.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name.startswith("_") and alias.name not in ("__version__", "_firmware")
        and node.module != "__future__"
    }  # fmt: skip
    assert taken == set()


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
    assert names - modules <= {"__version__", "_firmware"}  # the latter opens the compiled library


#: Files with imports of all forms.
IMPORTS = {
    "p/__init__.py": "",
    "p/a.py": "from . import b\nimport p.c\n",
    "p/b.py": "def f():\n    from .q.d import thing\n",
    "p/c.py": "from .q import d as other\n",
    "p/q/__init__.py": "word = 1\n",
    "p/q/d.py": "import os\nfrom . import word\n",
}


def test_the_check_sees_what_it_looks_for(tmp_path):
    """The check finds imports of all forms, at the top and in functions."""
    for name, text in IMPORTS.items():
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


def code_of(file: Path) -> str:
    """A C file without its comments."""
    return re.sub(r"/\*.*?\*/", " ", file.read_text(), flags=re.S)


def calls_of(files: list[Path]) -> dict[str, set[str]]:
    """The other files whose functions a C file names."""
    texts = {file.stem: code_of(file) for file in files}
    defined = r"^(?!static)\w[\w \*]*?\b(ht_\w+)\([^;{]*\)\s*\{"
    home = {name: stem for stem, text in texts.items() for name in re.findall(defined, text, re.M)}
    return {
        stem: {home[name] for name in re.findall(r"\bht_\w+", text) if name in home} - {stem}
        for stem, text in texts.items()
    }


def test_no_files_of_the_firmware_call_each_other():
    files = [file for room in ("core", "app", "link") for file in (FIRMWARE / room).glob("*.c")]
    graph = calls_of(files)
    assert {"ht_configure", "ht_drive"} <= set(graph) and sum(map(len, graph.values())) > 50
    assert circle_in(graph) == []


def laws_named(folder: Path) -> dict[str, set[str]]:
    """Law -> the files that name it or its functions, except the header of all laws, which
    includes its header, and the tables of laws and schemes."""
    rows = re.findall(r"^HT_\w+_LAW\((\w+), (\w+)\)", code_of(folder / "core/ht_laws.def"), re.M)
    found: dict[str, set[str]] = {law: set() for _, law in rows}
    for file in folder.rglob("*.[ch]"):
        text = code_of(file)
        if file.name == "ht_control.h":
            text = re.sub(r"^#include .*", "", text, flags=re.M)
        for number, law in rows:
            if re.search(rf"\bHT_LAW_{number}\b|\b(ht_)?{law}_law", text):
                found[law].add(file.name)
    return found


def test_no_law_is_named_outside_its_row():
    """A law's own files name it, its row does, and the rows of its schemes do. What else named it
    would have to be known and extended with every new law."""
    named = laws_named(FIRMWARE)
    assert len(named) >= 3
    expected = {law: {f"ht_{law}_law.c", f"ht_{law}_law.h"} for law in named}
    # Without a leg this law is the deadbeat one, whose gains it has anyway.
    expected["deadbeat"] |= expected["interleaved"]
    assert named == expected


def test_the_firmwares_checks_see_what_they_look_for(tmp_path):
    for name, text in {
        "a.c": "void ht_a(int x)\n{\n    ht_b(x);\n}\nvoid ht_c(void)\n{\n}\n",
        "b.c": "/* ht_c */ static void ht_d(void)\n{\n}\nht_t *ht_b(int x,\n  int y)\n{\n}\n",
        "core/ht_laws.def": "HT_VECTOR_LAW(ONE, one)\n",
        "core/ht_one_law.c": "int ht_one_law_step;\n",
        "app/other.c": "if (law == HT_LAW_ONE) {}\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    files = sorted(tmp_path.glob("*.c"))
    assert calls_of(files) == {"a": {"b"}, "b": set()}
    (tmp_path / "b.c").write_text("void ht_b(void)\n{\n    ht_c();\n}\n")
    assert circle_in(calls_of(files)) == ["a", "b", "a"]
    assert laws_named(tmp_path) == {"one": {"ht_one_law.c", "other.c"}}


def test_texts_that_a_board_tells_are_ascii():
    """The link carries octets below 128, and a client takes others for damage."""
    assert [path.name for path in FIRMWARE.rglob("*.def") if not path.read_text().isascii()] == []
