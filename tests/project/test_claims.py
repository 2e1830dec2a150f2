"""Every number in README's table of claims comes from what its row links to."""

import csv
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from doc_page import read_data

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.methods.fsw import SLOW_HZ

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def rows_of_claims(text: str) -> dict[str, str]:
    """Page that a row links to first -> its claim."""
    table = text.split("| claim | measured |\n|---|---|\n")[1].split("\n\n")[0]
    found = {}
    for line in table.splitlines():
        claim, link = (cell.strip() for cell in line.strip("|").split(" | "))
        page = re.search(r"\]\(docs/([\w-]+\.md#?[\w-]*)\)", link)[1]
        assert page not in found, f"two claims link to {page}: only one would be tested"
        found[page] = claim
    return found


README = (ROOT / "README.md").read_text()
CLAIMS = rows_of_claims(README)
#: Beyond twelve, README has digits.
WORDS = (
    *("one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)


def numbers(text: str) -> list[str]:
    """The numbers of a claim, in order. A name, such as Cortex-M4F, has none."""
    text = re.sub(r"Cortex-M\d\w?|16-bit|κ = \d", "", text)
    for number, word in enumerate(WORDS, 1):
        text = re.sub(rf"\b{word}\b", str(number), text, flags=re.IGNORECASE)
    return re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", text)


def table_after(page: str, heading: str) -> list[list[str]]:
    """The cells of the first table behind this text, without its head."""
    text = (DOCS / page).read_text().split(heading, 1)[1]
    lines = re.search(r"^\|.*?(?=^[^|]|\Z)", text, re.S | re.M)[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def errors_of_the_model() -> list[str]:
    (row,) = table_after("model.md", "## Measured errors")
    worst = max(float(cell) for cell in row[1:])
    assert worst < 3e-9
    assert "It covers 0.5 s" in (DOCS / "model.md").read_text()
    return ["3e-9"]


def low_speed() -> list[str]:
    """Flux in per cent and speed in r/min of the hybrid observer under each scheme. Six points a
    cell."""
    page = (DOCS / "observers.md").read_text()
    heads, *rows = read_data(DOCS / "observers.md", "low-speed")
    hybrid = [row for row in rows if row[0].startswith("hybrid") and "late" not in row[0]]
    flux, speed = [], []
    for row in hybrid:
        for cell in row[1:]:
            a, b = re.fullmatch(r"([+-][\d.]+) %, ([\d.]+)", cell).groups()
            flux.append(abs(float(a)))
            speed.append(float(b))
    beyond = [error for error in flux if error > 2]
    assert f"the flux was {beyond[0]} % low for one half second" in page
    changes = [round(100 * abs(float(head.split("× ")[1]) - 1)) for head in heads[2:]]
    speed_rpm = math.ceil(max(speed))
    return [
        str(changes[0]), str(changes[2]), "2",
        str(len(beyond)), str(6 * len(flux)), str(beyond[0]), str(speed_rpm),
    ]  # fmt: skip


def faults() -> list[str]:
    done = [tuple(map(int, row["failures / runs"].split(" / "))) for row in data("faults")]
    assert sum(failures for failures, _ in done) == 0
    return [str(sum(runs for _, runs in done))]


def budget() -> list[str]:
    ddr = json.loads((DOCS / "budget.json").read_text())["mps2-an386"]["ddr"]
    return [str(round(ddr["mean"]))]


def data(name: str) -> list[dict[str, str]]:
    with (DOCS / "data" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def geometric(values: list[float]) -> float:
    return math.exp(sum(map(math.log, values)) / len(values))


def equal_f_sw() -> list[str]:
    """The ratio of κ = 1 is to tables sampled at 20 kHz at most; that to freely sampled ones
    follows from the values."""
    rows = data("equal-f-sw")
    torque, currents = (
        [row for row in rows if row["figure"] == figure] for figure in ("Td [N m]", "THD∞ [%]")
    )
    sampled = re.search(r"sampling frequency \(3 to (\d+) kHz\)", (DOCS / "results.md").read_text())
    free = [
        float(row["db-dtfc κ=1"]) / float(row["best table setting"])
        for row in torque
        if row["best table setting"]
    ]
    ratio = [geometric([float(row["ratio κ=1"]) for row in own]) for own in (torque, currents)]
    return [
        *(f"{mean:.2f}" for mean in ratio), str(round(SLOW_HZ / 1e3)), str(len(torque)), sampled[1],
        f"{geometric(free):.2f}", str(sum(value > 1 for value in free)),
    ]  # fmt: skip


def papers() -> list[str]:
    return [str(len({row["figure"] for row in data("verdicts")})), "2"]


EXPECTED = {
    "model.md#measured-errors": errors_of_the_model,
    "observers.md#low-speed-measured": low_speed,
    "protection.md#campaign": faults,
    "pil.md": list,
    "budget.md": budget,
    "results.md#at-equal-switching-frequency": equal_f_sw,
    "results.md": papers,
}


def test_every_claim_has_a_source_and_every_source_a_claim():
    assert list(CLAIMS) == list(EXPECTED)


def test_no_claim_hides_behind_another():
    """Of two rows that link to the same place, one would not be tested. So it is for a new row."""
    begin = README.index("| claim | measured |")
    row = "| Five of 7 drives fly. | [model](docs/{}) |\n"
    after = README.index("\n\n", begin) + 1
    with pytest.raises(AssertionError, match=r"two claims link to pil\.md"):
        rows_of_claims(README[:after] + row.format("pil.md") + README[after:])
    new = rows_of_claims(README[:after] + row.format("model.md") + README[after:])
    assert numbers(new["model.md"]) == ["5", "7"] and list(new) != list(EXPECTED)


@pytest.mark.parametrize("page", CLAIMS)
def test_numbers_of_a_claim_are_those_of_its_source(page):
    assert numbers(CLAIMS[page]) == EXPECTED[page](), CLAIMS[page]


def test_times_below_the_picture_are_those_of_the_example_and_of_the_study():
    told = re.search(
        r"It takes ([\d.]+) ms here, and ([\d.]+) ms in the median of (\d+) phases", README
    ).groups()
    example = setups.load(ROOT / "examples" / "lost-phase.toml")
    ((broken_s, *_),) = example.profile.broken
    sim = SimulatedDrive(example, 1)
    sim.run_profile(example.profile)
    rec = sim.take()
    found_s = rec.time_s[np.flatnonzero(rec["warnings"])[0]]
    assert float(told[0]) == pytest.approx(1e3 * (found_s - broken_s), abs=0.06)
    page = (DOCS / "lost-phase.md").read_text()
    _, count, median = re.search(r"\| open \| (\d+) of (\d+) \| ([\d.]+) ms", page).groups()
    assert told[1:] == (median, count)


def test_page_of_lost_phases_tells_how_many_arcs_it_has_seen():
    text = " ".join((DOCS / "lost-phase.md").read_text().split())
    runs, went_on = re.search(
        r"All (\d+) runs have been made: .*? each of the (\d+) drives that were to go on did", text
    ).groups()
    rows = table_after("lost-phase.md", "A phase opens with an arc:")
    named, of = zip(*(map(int, row[1].split(" of ")) for row in rows))
    assert str(sum(named)) == str(sum(of)) == runs and sum(of) >= 2000
    assert {cell for row in rows for cell in row[2:4]} == {"0"}
    on = [tuple(map(int, row["as it should be"].split(" of "))) for row in data("arcs")]
    assert sum(right for right, _ in on) == sum(asked for _, asked in on) == int(went_on)
    assert {row["a sound leg switched off"] for row in data("arcs")} == {"0"}


def test_page_tells_what_freely_sampled_tables_reach():
    *_, mean, above = equal_f_sw()
    text = " ".join((DOCS / "results.md").read_text().split())
    told = re.search(
        r"Against freely sampled tables .*? geometric mean (\S+) .*? (\w+) points", text
    )
    assert (told[1], told[2]) == (mean, {"3": "three"}[above])


def test_torque_of_all_phases_at_the_rated_current_needs_the_flux_that_is_told():
    """T = 3 p L_m^2/L_r i_d i_q, and the stator flux is |L_s i_d + j sigma L_s i_q|."""
    setup = setups.load("paper-a-feasible")
    lls_H, llr_H, lm_H = (setup[f"machine.{name}"] for name in ("lls_H", "llr_H", "lm_H"))
    ls_H, lr_H = lls_H + lm_H, llr_H + lm_H
    sigma_ls_H = ls_H - lm_H**2 / lr_H
    text = " ".join((DOCS / "lost-phase.md").read_text().split())
    told = re.search(
        r"i_rated_A = ([\d.]+) A .*? give ([\d.]+) N m at ([\d.]+) Wb, and ([\d.]+) N m at the "
        r"set-up's ([\d.]+) Wb",
        text,
    )
    i_rated_A, most_Nm, best_Wb, at_Nm, flux_Wb = map(float, told.groups())
    i_A = np.sqrt(2) * i_rated_A
    i_d = np.linspace(0.05, 0.9999, 20_000) * i_A
    i_q = np.sqrt(i_A**2 - i_d**2)
    torque_Nm = 3 * setup["machine.pole_pairs"] * lm_H**2 / lr_H * i_d * i_q
    psi_Wb = np.hypot(ls_H * i_d, sigma_ls_H * i_q)
    assert torque_Nm.max() == pytest.approx(most_Nm, abs=0.05)
    assert psi_Wb[torque_Nm.argmax()] == pytest.approx(best_Wb, abs=0.005)
    assert np.interp(flux_Wb, psi_Wb, torque_Nm) == pytest.approx(at_Nm, abs=0.05)
