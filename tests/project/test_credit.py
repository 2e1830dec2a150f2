"""What a citation needs: one version, one title, and a paper within its journal's bounds. What the
texts of the repository's host ask a reader to do can be done."""

import json
import re
from pathlib import Path

import pytest

import hexatorque
from hexatorque.cli.main import app

ROOT = Path(__file__).resolve().parents[2]


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def field(name: str, of: str) -> str:
    return re.search(rf'^{name}: "?(.*?)"?$', of, re.M).group(1)


def test_citation_archive_and_paper_name_the_same_work():
    citation, paper = text("CITATION.cff"), text("paper/paper.md")
    archive = json.loads(text(".zenodo.json"))
    assert field("version", citation) == archive["version"] == hexatorque.__version__
    assert field("title", citation) == field("title", paper) == archive["title"]
    assert field("license", citation) == archive["license"] == "MIT"
    keywords = citation.partition("\nkeywords:\n")[2].partition("\nreferences:")[0]
    assert [line.removeprefix("  - ") for line in keywords.splitlines()] == archive["keywords"]


def test_the_paper_cites_each_work_that_it_lists():
    cited = set(re.findall(r"@([a-z]+\d{4})", text("paper/paper.md")))
    listed = re.findall(r"^@\w+\{(\w+),", text("paper/paper.bib"), re.M)
    assert cited == set(listed) and len(listed) == len(cited)


def test_the_paper_has_the_length_that_its_journal_wants():
    body = text("paper/paper.md").split("---", 2)[2]
    assert 250 <= len(body.split()) <= 1750


def test_the_container_makes_the_demo():
    container = json.loads(text(".devcontainer/devcontainer.json"))
    command = container["postCreateCommand"]
    assert command == "make demo" and re.search(r"^demo:", text("Makefile"), re.M)
    (image,) = re.findall(r"^python:3\.(\d+)-", container["image"])
    assert int(image) >= int(
        re.search(r'requires-python = ">=3\.(\d+)"', text("pyproject.toml"))[1]
    )


TEMPLATES = sorted(str(path.relative_to(ROOT)) for path in (ROOT / ".github").rglob("*.*"))
ASKING = ("SECURITY.md", "CONTRIBUTING.md", "paper/criteria.md", *TEMPLATES)


@pytest.mark.parametrize("name", ASKING)
def test_what_a_text_asks_for_exists(name):
    """Targets of make, commands and files, in the text of a page or of a form."""
    asked = text(name)
    for target in re.findall(r"`make ([\w-]+)`", asked):
        assert re.search(rf"^(\S+ )*{target}( \S+)*:", text("Makefile"), re.M), target
    for word in re.findall(r"`hexatorque ([\w-]+)", asked):
        assert word in app.commands or word in ("--version", "--help"), word
    for path in re.findall(r"\.ci/\w+|(?:firmware|tests|docs|tools)/[\w/-]+\.\w+", asked):
        assert (ROOT / path).exists(), path


def test_the_forms_are_forms():
    """Each field has an id of its own and a label."""
    yaml = pytest.importorskip("yaml", reason="no PyYAML: HT_EXTRAS=docs make test")
    forms = [name for name in TEMPLATES if "ISSUE_TEMPLATE" in name and "config" not in name]
    assert len(forms) == 2
    for name in forms:
        form = yaml.safe_load(text(name))
        fields = [part for part in form["body"] if part["type"] != "markdown"]
        assert form["name"] and form["description"] and fields
        assert len({part["id"] for part in fields}) == len(fields)
        assert all(part["attributes"]["label"] for part in fields)


def test_each_criterion_that_is_met_says_where():
    rows = re.findall(r"^\| (.*?) \| (.*?) \| (.*?) \|$", text("paper/criteria.md"), re.M)[1:]
    assert len(rows) == 16
    for criterion, met, where in rows:
        assert where != "–" or not met.startswith("yes"), criterion
        for name in re.findall(r"`([\w.]+(?:/\w*)?)`", where):
            assert (ROOT / name).exists() or (ROOT / "paper" / name).exists(), name


UNRELEASED = text("CHANGELOG.md").partition("\n## ")[2].partition("\n### First release")[0]


def test_the_changelog_names_what_there_is():
    """Commands and pages of the newest version. Its entries are short."""
    named = re.findall(r"`hexatorque ([a-z][^`]*)`", UNRELEASED)
    assert len(named) > 15
    for words in named:
        command = app
        for word in words.split():
            if not hasattr(command, "commands"):
                break
            assert word in command.commands, words
            command = command.commands[word]
    for page in re.findall(r"docs/[\w-]+\.md", UNRELEASED):
        assert (ROOT / page).exists(), page
    entries = re.findall(r"^- (.*?)(?=^- |^### |\Z)", UNRELEASED, re.M | re.S)
    assert len(entries) > 100 and max(len(entry.split()) for entry in entries) <= 80


def test_no_command_has_an_old_name():
    """A command that was renamed before a release is gone: nothing is hidden or outdated."""

    def old(command, path=()):
        if command.hidden or command.deprecated:
            yield path
        for name, child in getattr(command, "commands", {}).items():
            yield from old(child, (*path, name))

    assert list(old(app)) == []
