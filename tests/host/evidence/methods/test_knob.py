"""The study of `thd_share`: its points, its table and picture, and what the page says of it."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from hexatorque.evidence.methods import carrier, knob
from hexatorque.evidence.methods.places import MACHINES

DOCS = Path(__file__).resolve().parents[4] / "docs"


@pytest.fixture(scope="module")
def result():
    return knob.study(quick=True)


@pytest.mark.parametrize("machine", MACHINES, ids=lambda machine: machine.name)
@pytest.mark.parametrize("m_pu", [0.1, 0.5])
def test_the_speed_has_the_voltage(machine, m_pu):
    place = knob.at_voltage(machine.place, m_pu)
    flux_Wb = place.base.parameter("flux_ref_Wb")
    v_V = carrier.steady_state(place.base, place, flux_Wb).v_V
    assert abs(v_V) / place.base["inverter.vdc_V"] == pytest.approx(m_pu, rel=5e-3)


def off_the_line(squares):
    """By how much squares over the share are off the line between their ends, in units of the
    larger end's."""
    shares = np.array(sorted(squares))
    found = np.array([squares[share] for share in shares])
    line = found[0] + (found[-1] - found[0]) * shares
    return np.abs(found - line) / found.max()


def test_ripple_and_distortion_squared_are_those_of_both_ends_by_turns(result):
    """So the knob has no step: each carrier has the ripple of one end or of the other, and where
    the sets join and part there is no more."""
    assert knob.failures(result) == []
    for row in result["rows"]:
        assert row["f_sw_Hz"] == pytest.approx(knob.F_SW_HZ, rel=0.05)
    for m_pu in knob.QUICK_VOLTAGES_PU:
        by = {row["thd_share"]: row for row in result["rows"] if row["m_pu"] == m_pu}
        for figure, _ in knob.FIGURES:
            assert max(off_the_line({s: row[figure] ** 2 for s, row in by.items()})) < 0.05
        assert by[0.0]["td_Nm"] < 0.6 * by[1.0]["td_Nm"]
        assert by[1.0]["thd_inf_pct"] < 0.9 * by[0.0]["thd_inf_pct"]


def test_table_and_picture(result, tmp_path):
    ((_, heads, lines),) = knob.grid(result)
    assert len(lines) == 2 and all(len(line) == len(heads) for line in lines)
    assert "–" not in "".join(map("".join, lines))
    assert knob.plot(result, tmp_path / "knob.png").stat().st_size > 10_000


def test_a_point_that_is_not_held_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(knob.bench, "measure", lambda *_, **__: None)
    lost = knob.study(quick=True)
    assert len(knob.failures(lost)) == len(lost["rows"]) == 6
    ((_, _, lines),) = knob.grid(lost)
    assert all(line[3:] == ["–"] * 3 for line in lines)


def test_the_page_tells_how_straight_the_knob_is():
    text = " ".join((DOCS / "interleaved.md").read_text().split())
    with (DOCS / "data" / "knob.csv").open() as file:
        rows = list(csv.DictReader(file))
    voltages = {float(row["V_dc"]) for row in rows}
    assert voltages == set(knob.VOLTAGES_PU) and len(rows) == len(voltages) * len(MACHINES)
    worst = 0.0
    for row in rows:
        cells = {s: row[f"thd_share {s:g}"].split(" · ") for s in knob.SHARES}
        for n in range(len(knob.FIGURES)):
            squares = {share: float(cell[n]) ** 2 for share, cell in cells.items()}
            worst = max(worst, *off_the_line(squares))
    assert f"within {math.ceil(100 * worst)} % of the larger one" in text
