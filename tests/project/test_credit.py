"""What a citation needs: one version, one title, and a paper within its journal's bounds."""

import json
import re
from pathlib import Path

import hexatorque

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
    assert json.loads(text(".devcontainer/devcontainer.json"))["postCreateCommand"] == "make demo"
