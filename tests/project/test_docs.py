"""Links between the pages lead somewhere: the file, and the heading in it."""

import csv
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


#: Files that a command writes or a reader has, and one of TI's.
ELSEWHERE = {
    "my-drive.toml", "mine.toml", "mine-tuned.toml", "recording.json", "run.json", "table.json",
    "budget.json", "dslite.sh",
}  # fmt: skip
#: A name without a folder, or with a part of it, is a file of one of these.
HOMES = [
    ROOT,
    *(ROOT / "firmware" / room for room in ("", "core", "app", "link", "port", "port/c2000")),
    *(ROOT / "host/hexatorque" / room for room in ("", "plant", "analysis", "drive", "laws")),
    ROOT / "tests/c/fuzz",
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_exist(page):
    shown = re.sub(r"^```.*?^```|^    .*?$", "", page.read_text(), flags=re.S | re.M)
    named = re.findall(r"`([\w./-]+\.(?:py|c|h|def|md|json|toml|sh))`", shown)
    named += re.findall(r"`((?:firmware|host|tests|tools|docs|examples)/[\w/]*)`", shown)
    for path in named:
        if not path.startswith("out/") and path not in ELSEWHERE:
            assert any((home / path).exists() for home in HOMES), path


def test_reader_of_readme_and_tutorial_finds_the_way():
    """Where the switching table is, the dead-time model, THD's definition, START, Table IV."""
    assert "docs/tutorial.md#where-things-are" in (ROOT / "README.md").read_text()
    text = (ROOT / "docs/tutorial.md").read_text()
    for line, place in {
        "the switching table": "ht_switching.c",
        "the dead-time model": "plant/pwm.py",
        "THD's definition": "analysis/spectrum.py",
        "the START request": "protocol.md#0x08-start",
        "Table IV of paper A": "paper_a/table4.py",
    }.items():
        (row,) = [row for row in text.splitlines() if row.startswith(f"| {line}")]
        assert place in row
    switching = (ROOT / "firmware/core/ht_switching.c").read_text()
    assert "ht_direction" in switching
    assert "def thd_pct" in (ROOT / "host/hexatorque/analysis/spectrum.py").read_text()
    assert "dead band" in (ROOT / "host/hexatorque/plant/pwm.py").read_text()


@pytest.mark.parametrize("chip", ["f28335", "f28377s"])
def test_errata_table_names_what_there_is(chip):
    """Files and functions in the tables of docs/chip-errata.md exist."""
    with (ROOT / "docs" / "data" / f"errata-{chip}.csv").open() as file:
        cells = [row["done"] for row in csv.DictReader(file)]
    port = ROOT / "firmware" / "port" / "c2000"
    sources = "\n".join(f.read_text() for f in port.rglob("*.[ch]"))
    named = [word for cell in cells for word in re.findall(r"(?:^|`)([\w./*]+)(?:`|$)", cell)]
    assert len(named) > 8
    for word in named:
        if "/" in word or word.endswith((".c", ".h", ".cmd")):
            found = [*ROOT.glob(word), *port.glob(word)]
            assert found or word == "utilities/transfer", word
        elif word.islower() and word not in ("nothing", "none"):
            assert re.search(rf"\b{word}\(", sources), word


@pytest.mark.parametrize(
    ("page", "figure", "source", "told"),
    [
        ("README.md", r"(\d+) runs with injected faults", "docs/protection.md", "{} runs; periods"),
        ("README.md", r"of `ddr` takes (\d+) instructions", "docs/budget.md", "| ddr | {} |"),
        ("docs/safety.md", r"([\d.]+) periods \(median\), (\d+) \(longest\)",
         "docs/data/faults.csv", ",{} / {},"),
        ("docs/safety.md", r"1 … (\d+) periods", "docs/data/faults.csv", " / {},"),
        ("docs/safety.md", r"([\d.]+) ms \(median\)", "docs/lost-phase.md", "| {} ms |"),
        ("docs/safety.md", r"([\d.]+) electrical periods", "docs/lost-phase.md", "| {} |"),
        ("docs/safety.md", r"(\d+) losses", "docs/lost-phase.md", "of {} losses"),
    ],
)  # fmt: skip
def test_figures_that_are_told_twice_agree(page, figure, source, told):
    """The second page is generated."""
    found = re.findall(figure, (ROOT / page).read_text())
    assert found
    for values in found:
        values = (values,) if isinstance(values, str) else values
        assert told.format(*values) in (ROOT / source).read_text(), values
