"""Links between the pages lead somewhere: the file, and the heading in it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])


def anchors(page: Path) -> set[str]:
    """The names that GitHub gives a page's headings."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.S | re.M)
    titles = re.findall(r"^#+ (.*)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if target.startswith(("http:", "https:")):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), f"{page.name}: {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{page.name}: {target}"


def test_errata_table_names_what_there_is():
    """Files and functions in docs/chip-errata.md exist."""
    page = (ROOT / "docs" / "chip-errata.md").read_text()
    port = ROOT / "firmware" / "port" / "c2000"
    sources = "\n".join(f.read_text() for f in port.rglob("*.[ch]"))
    for word in re.findall(r"`([\w./*]+)`", page[page.index("## F28335") :]):
        if "/" in word or word.endswith((".c", ".h", ".cmd")):
            found = [*ROOT.glob(word), *port.glob(word)]
            assert found or word == "utilities/transfer", word
        elif word.islower():
            assert re.search(rf"\b{word}\(", sources), word
