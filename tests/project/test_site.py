"""The site: the pages that its hook writes from the program are complete, and every page can be
reached. `make docs` checks all links in strict mode."""

import csv
import importlib
import inspect
import re
from dataclasses import is_dataclass
from pathlib import Path

import pytest
import site_hook

import hexatorque
from hexatorque import firmware
from hexatorque.cli import main

ROOT = Path(__file__).resolve().parents[2]
CONFIG = (ROOT / "mkdocs.yml").read_text()


def test_every_page_is_in_the_navigation_once():
    pages = re.findall(r"^ .*?(\S+\.md)$", CONFIG[CONFIG.index("\nnav:") :], re.M)
    written = {path.name for path in (ROOT / "docs").glob("*.md")}
    generated = {*site_hook.FROM_ROOT, "gallery.md"} | {
        f"reference/{name}.md" for name in ("commands", "python", "parameters", "channels")
    }
    assert sorted(pages) == sorted(written | generated)


def test_every_table_of_data_is_a_page_that_a_page_leads_to():
    """A page of the documentation links to the file. On the site the link leads to the table."""
    for path in (ROOT / "docs/data").glob("*.csv"):
        page = site_hook.data_page(path)
        (leads,) = re.findall(r"^From (.*)\. The table as a file", page, re.M)
        assert re.findall(r"\]\(\.\./(\S+\.md)\)", leads), f"no page leads to {path.name}"
        with path.open() as file:
            rows = list(csv.reader(file))
        lines = [line for line in page.splitlines() if line.startswith("| ")]
        assert len(lines) == len(rows) + 1  # and the line below the head
        assert len({line.replace("\\|", "").count("|") for line in lines}) == 1


def test_a_link_to_data_leads_to_its_page():
    class Pages:
        file = type("File", (), {"src_uri": "results.md"})

        def get_file_from_path(self, path):
            return path in ("data/verdicts.md", "data/verdicts.csv")

        def documentation_pages(self):
            return []

    def led(text):
        return site_hook.on_page_markdown(text, Pages, None, Pages())

    assert led("[all](data/verdicts.csv)") == "[all](data/verdicts.md)"
    Pages.file.src_uri = "data/verdicts.md"
    assert led("[all](verdicts.csv)") == "[all](verdicts.csv)"


def test_nothing_is_loaded_from_elsewhere():
    assert "font: false" in CONFIG and "://" not in CONFIG
    assert "url(" not in (ROOT / "docs/stylesheets/site.css").read_text()


def test_parameters_and_channels_are_complete():
    page = site_hook.parameters_page()
    for row in firmware.parameters().values():
        assert f"| `{row.name}` |" in page and site_hook.cell(row.help) in page
        assert all(f"`{choice}`" in page for choice in row.choices)
    page = site_hook.channels_page()
    for name, unit in firmware.channels():
        assert re.search(rf"^\| `{name}` \| {re.escape(unit)} \| \S", page, re.M), name
    for bit, name in firmware.FAULTS.items():
        assert f"| {name} | `0x{bit:04X}` |" in page


def test_every_public_name_is_in_the_reference():
    page = site_hook.python_page()
    for name in hexatorque.__all__:
        value = getattr(hexatorque, name)
        assert f"::: {value.__module__}.{name}\n" in page


#: Every class and function on the page "Python": its room and its name.
ON_THE_PAGE = [(room, name) for room, names in site_hook.PYTHON.items() for name in names]


@pytest.mark.parametrize(("room", "name"), ON_THE_PAGE)
def test_every_public_member_is_on_the_page(room, name):
    """The page shows what has a text: a method that overrides one without a text of its own has
    that one's, as in `help`. A field stands in the text of its class."""
    value = getattr(importlib.import_module(f"hexatorque.{room}"), name)
    assert value.__doc__
    if not isinstance(value, type):
        return
    ours = [base for base in value.__mro__ if base.__module__.startswith("hexatorque")]
    texts = " ".join(base.__doc__ or "" for base in ours)
    for member in (member for member in dir(value) if not member.startswith("_")):
        owner = next(base for base in value.__mro__ if member in vars(base))
        found = vars(owner)[member]
        if owner not in ours:
            continue
        if callable(found) or isinstance(found, property | classmethod | staticmethod):
            assert inspect.getdoc(getattr(value, member)), f"{value.__name__}.{member}"
        else:
            assert re.search(rf"\b{member}\b", texts), f"{value.__name__}.{member}"
    fields = {name for base in ours for name in inspect.get_annotations(base)}
    for field in (field for field in fields | made(ours) if not field.startswith("_")):
        assert re.search(rf"\b{field}\b", texts), f"{value.__name__}.{field}"


def made(classes):
    """What the classes' `__init__` give their objects."""
    own = [one for one in classes if "__init__" in vars(one) and not is_dataclass(one)]
    text = "\n".join(inspect.getsource(one.__init__) for one in own)
    return set(re.findall(r"^ +self\.(\w+)(?:: [^=\n]+)? =", text, re.M))


@pytest.mark.skipif(not hasattr(main, "app"), reason="commands are not a tree yet")
def test_every_command_is_in_the_reference():
    page = site_hook.commands_page()
    for words in ("run", "compare", "board serve", "board params load", "evidence papers"):
        assert f"## hexatorque {words}\n" in page
    assert "--setup" in page and "| argument | what |" in page


def test_links_of_the_home_page_lead_from_docs():
    page = site_hook.read_root("README.md")
    assert "](tutorial.md)" in page and "](contributing.md#the-map)" in page
    assert "](images/readme.png)" in page and "](docs/" not in page


def test_equations():
    pytest.importorskip("latex2mathml", reason="HT_EXTRAS=docs make test")

    def drawn(text):
        return site_hook.equation(text, "math", "math", {}, None)

    assert "<mfrac>" in drawn(r"\frac{d\psi}{dt} = v - R_s i")
    assert "http" not in drawn(r"a_b").replace("http://www.w3.org/1998/Math/MathML", "")
    with pytest.raises(ValueError, match="not understood"):
        drawn(r"\begin{aligned} a &= b \end{aligned}")
    found = 0
    for path in (ROOT / "docs").glob("*.md"):
        text = path.read_text()
        assert "$$" not in text, f"{path.name}: write an equation as a ```math block"
        for block in re.findall(r"^```math\n(.*?)^```", text, re.S | re.M):
            found += 1
            drawn(block)
        for line in re.sub(r"^```.*?^```$", "", text, flags=re.S | re.M).splitlines():
            for piece in re.findall(r"\$`([^`]+)`\$", line):
                found += 1
                assert site_hook.mathml(piece, "inline").startswith("<math")
            # No root, derivative, fraction of a square or sum squared is written as plain text.
            plain = re.sub(r"`[^`]*`", "", line)
            assert not re.search(r"√[^\d√]*[²(]|\bd\w+/dt\b|\)²|²/", plain), f"{path.name}: {line}"
    assert found >= 50


@pytest.mark.parametrize(
    "origin",
    [
        "https://code.example/drives/hexatorque.git",
        "https://someone:secret@code.example/drives/hexatorque",
        "ssh://git@code.example:2222/drives/hexatorque.git",
        "git@code.example:drives/hexatorque.git",
    ],
)
def test_the_site_links_to_the_repository_that_its_clone_came_from(origin):
    assert site_hook.web_address(origin) == "https://code.example/drives/hexatorque"


@pytest.mark.parametrize("origin", ["", "/home/me/drives", "file:///home/me/drives", "C:/drives"])
def test_a_clone_of_a_folder_has_no_link_to_a_repository(origin):
    assert site_hook.web_address(origin) is None
