"""The page about a machine of one's own works as it says (`pages`)."""

import csv
import os
import re

from pages import DOCS, PART, follow

from hexatorque.setups import estimate
from hexatorque.setups.published import machines

PAGE = (DOCS / "own-machine.md").read_text()


def test_every_command(terminals):
    follow(PAGE, terminals)
    assert {"first.npz", "first.png"} <= set(os.listdir(terminals.folder / "out"))


def test_every_command_is_run():
    assert not [part for part in PART.finditer(PAGE) if part["what"] == "not run"]


def test_the_ranges_are_those_of_the_code():
    table = PAGE.split("<!-- compared with the code: spread -->")[1]
    rows = {
        m[1]: m.groups()[1:] for m in re.finditer(r"(?m)^\| (.+?) \| ([\d.]+) \| ([\d.]+) ", table)
    }
    spread = estimate.spread()
    names = {"R_s": "rs_ohm", "R_r": "rr_ohm", "leakages, σL_s": "lls_H", "L_m": "lm_H"}
    for shown, name in (*names.items(), ("flux", "flux_Wb")):
        digits = 2 if name == "flux_Wb" else 1
        factors = spread.factors[name]
        assert rows[shown] == tuple(f"{factors[told]:.{digits}f}" for told in (True, False)), shown
    assert rows["inertia"] == (f"{spread.inertia:.1f}",) * 2
    assert f"{len(machines())} published machines" in PAGE


def shares(name):
    """The rows of the page's data; a cell "a of b" as (a, b)."""
    with (DOCS / "data" / f"machines-{name}.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return [
        {
            key: tuple(map(int, cell.split(" of "))) if cell[:1].isdigit() else cell
            for key, cell in row.items()
        }
        for row in rows
    ]


def test_the_figures_of_the_campaign_are_those_of_its_tables():
    ways = [row for row in shares("driven") if row["scheme"] == "as `new` writes it"]
    told = re.findall(r"(?m)^\| ([^|]+) \| (\d+) of (\d+) \| (\d+) %", PAGE)
    assert len(told) == len(ways) - 1  # those of the magnets are on their page
    for row, (way, *figures) in zip(ways, told):
        both = zip(row["drawn machines"], row["published machines"])
        assert row["told"].startswith(way)
        assert [int(f) for f in figures[:2]] == [sum(pair) for pair in both], way
    said = [row for row in shares("what-check-said-before") if "new" not in row["scheme"]]
    columns = list(said[0])[1:]
    (passed, held), (doubted, ran), (bad, failed) = (
        (sum(row[c][1] for row in said), sum(row[c][0] for row in said)) for c in columns
    )
    text = " ".join(PAGE.split())
    assert f"passes {held} of {passed} were driven ({100 * held / passed:.1f} %" in text
    assert f"calls bad {failed} of {bad} failed ({100 * failed / bad:.0f} %" in text
    assert f"of {doubted} in doubt {doubted - ran}," in text
