"""Links between the pages lead somewhere: the file, and the heading in it."""

import csv
import re
from pathlib import Path

import pytest

from hexatorque.chips import BOARDS
from hexatorque.firmware import lib, parameters
from hexatorque.monitor import deadman

ROOT = Path(__file__).resolve().parents[2]
#: With what the repository's host shows beside them.
ROOTS = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "paper/criteria.md",
         ".github/pull_request_template.md")  # fmt: skip
PAGES = sorted([*(ROOT / name for name in ROOTS), *(ROOT / "docs").glob("*.md")])


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
    ROOT / "paper",
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
        ("docs/firmware.md", r"sampling switch \((\d+) Ω, ([\d.]+) pF\)",
         "docs/first-spin.md", "{1} pF behind {0} Ω"),
        ("docs/first-spin.md", r"\*(GPIO84) and (GPIO72)\* choose the boot mode in reset",
         "docs/flash.md", "{1} and {0} high (get mode; as delivered, boots from flash)"),
        ("docs/first-spin.md", r"take the probe's (supply) jumpers out",
         "docs/first-spin.md", "(USB) is isolated from the DSP's only when all jumpers beside the "
         "probe (3.3 V, 5 V, ground) are taken out, and then the DSP's side needs a {} of its own"),
        ("docs/first-spin.md", r"Record the channel `(\w+)` for ten minutes",
         "firmware/app/ht_channels.def", "HT_CONTROL_CHANNEL({}, "),
        ("docs/first-spin.md", r"resistor decides: (\d+ kΩ) to ground",
         "docs/data/demands-48-V.csv", "add: {} to ground at each of the twelve inputs"),
        ("docs/first-spin.md", r"resistor decides: (\d+ kΩ) to ground",
         "docs/data/demands-mains.csv", "add {} to ground at IN+"),
    ],
)  # fmt: skip
def test_figures_that_are_told_twice_agree(page, figure, source, told):
    """Most of the second ones are generated."""
    found = re.findall(figure, told_by(page))
    assert found
    for values in found:
        values = (values,) if isinstance(values, str) else values
        assert told.format(*values) in told_by(source), values


def told_by(page: str) -> str:
    """Without the breaks of lines."""
    return " ".join((ROOT / page).read_text(encoding="utf-8").split())


def initial(*names: str) -> tuple[float, ...]:
    return tuple(parameters()[name].initial for name in names)


def codes(header: str, prefix: str) -> tuple[float, ...]:
    """The values of an enumeration."""
    text = (ROOT / "firmware" / header).read_text()
    return tuple(float(n) for n in re.findall(rf"\b{prefix}\w+ = (\d+)", text))


def of_every_board(name: str) -> float:
    (value,) = {getattr(getattr(lib, f"ht_board_{board}"), name) for board in BOARDS}
    return value


@pytest.mark.parametrize(
    ("page", "text", "source"),
    [
        ("docs/first-spin.md", r"`min_pulse_us`, (\d) µs by default and at least",
         lambda: initial("min_pulse_us")),
        ("docs/first-spin.md", r"`min_pulse_us`, (\d) µs by default and at least",
         lambda: (of_every_board("min_pulse_us"),)),
        ("docs/first-spin.md",
         r"`dead_time_us`, ([\d.]+) µs by default.*? \[minimum\]\S+ is (\d) µs",
         lambda: (*initial("dead_time_us"), of_every_board("dead_min_us"))),
        ("docs/firmware.md", r"in a debugger: (\d) done, (\d) crystal missing, (\d) no lock, "
         r"(\d) wrong frequency, (\d) parameters refused, (\d+) the start has not ended",
         lambda: codes("port/c2000/image/ht_image.h", "HT_START_")),
        ("docs/safety.md", r"session watchdog, (\d+) ms; .*page: (\d+) s",
         lambda: (lib.HT_SERVICE_WATCHDOG_MS, deadman.SILENT_S + deadman.START_S)),
        ("docs/protection.md", r"After `restart_count` of them \((\d+)\), each less than "
         r"`restart_wait_s` \((\d+) s\)", lambda: initial("restart_count", "restart_wait_s")),
    ],
)  # fmt: skip
def test_figures_of_pages_are_those_of_the_firmware(page, text, source):
    found = re.findall(text, told_by(page))
    assert len(found) == 1
    told = (found[0],) if isinstance(found[0], str) else found[0]
    assert tuple(map(float, told)) == pytest.approx(source())


def test_resistors_of_an_inverting_driver_are_told_once():
    (section,) = re.findall(r"## Gate drivers that invert(.*?) ## ", told_by("docs/firmware.md"))
    assert "first-spin.md#the-power-stage" in section and "Ω" not in section


def test_safety_page_says_what_the_drive_leaves_to_others():
    """A hanging load, an overload of the motor, restarts: what the page says is what the parameters
    do, and what it asks for is among the demands on the power stage."""
    safety, spin = told_by("docs/safety.md"), told_by("docs/first-spin.md")
    bullets = re.split(r" - \*\*", safety.split("## What the drive does not do")[1].split("## ")[0])
    load, heat, restarts, link = bullets[1:]
    assert "A hanging load falls" in load and "a brake that closes by spring" in load
    assert "STOP and every fault take the gates off" in load
    assert "by software only, and not by default" in heat and "into the trip chain" in heat
    models = ("winding_K_W", "device_K_W", "winding_ntc_ohm", "sink_ntc_ohm")
    assert initial(*models) == (0.0,) * len(models)
    assert "the motor's thermal switches into the trip pin's chain" in spin
    assert "hardware only" in restarts and "a reset forgets these trips" in restarts
    count, wait_s = (parameters()[name] for name in ("restart_count", "restart_wait_s"))
    assert "A client may change both parameters" in restarts and count.live and wait_s.live
    assert "after three a start must wait for a minute" in safety
    assert (count.initial, wait_s.initial) == (3, 60)
    assert "does not notice a dc-link sensor" in link
