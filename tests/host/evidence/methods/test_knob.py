"""The study of `thd_share`: its points, its table and picture, and what the page says of it."""

import csv
from pathlib import Path

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


def test_the_sets_step_together_at_high_voltage_alone(result):
    """With both sets in phase the torque has the ripple of both, which a quarter between them
    cancels: twice as much and more. Below 0.22 V_dc the sets come together without a step."""
    assert knob.failures(result) == []
    by = {(row["m_pu"], row["thd_share"]): row for row in result["rows"]}
    for row in result["rows"]:
        assert row["f_sw_Hz"] == pytest.approx(knob.F_SW_HZ, rel=0.05)
    ratios = {m: by[m, 0.76]["td_Nm"] / by[m, 0.74]["td_Nm"] for m in knob.QUICK_VOLTAGES_PU}
    assert ratios[0.1] == pytest.approx(1.0, abs=0.1) and ratios[0.5] > 1.8
    assert by[0.5, 0.76]["thd_inf_pct"] < 0.9 * by[0.5, 0.74]["thd_inf_pct"]
    for m_pu in knob.QUICK_VOLTAGES_PU:
        assert by[m_pu, 0.0]["td_Nm"] < 0.6 * by[m_pu, 1.0]["td_Nm"]
        assert by[m_pu, 1.0]["thd_inf_pct"] < 0.9 * by[m_pu, 0.0]["thd_inf_pct"]


def test_table_and_picture(result, tmp_path):
    ((_, heads, lines),) = knob.grid(result)
    assert len(lines) == 2 and all(len(line) == len(heads) for line in lines)
    assert "–" not in "".join(map("".join, lines))
    assert knob.plot(result, tmp_path / "knob.png").stat().st_size > 10_000


def test_a_point_that_is_not_held_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(knob.bench, "measure", lambda *_, **__: None)
    lost = knob.study(quick=True)
    assert len(knob.failures(lost)) == len(lost["rows"]) == 8
    ((_, _, lines),) = knob.grid(lost)
    assert all(line[3:] == ["–"] * 4 for line in lines)


def test_the_page_tells_the_steps_that_the_table_has():
    text = " ".join((DOCS / "interleaved.md").read_text().split())
    with (DOCS / "data" / "knob.csv").open() as file:
        rows = list(csv.DictReader(file))
    voltages = {float(row["V_dc"]) for row in rows}
    assert voltages == set(knob.VOLTAGES_PU) and len(rows) == len(voltages) * len(MACHINES)

    def of(row, share):
        return [float(figure) for figure in row[f"thd_share {share:g}"].split(" · ")]

    def ratios(figure, one, other, first_pu, last_pu=1.0):
        return [
            of(row, one)[figure] / of(row, other)[figure]
            for row in rows
            if first_pu <= float(row["V_dc"]) <= last_pu
        ]

    td, thd = (ratios(figure, 0.76, 0.74, 0.3) for figure in (0, 1))
    assert f"Td rises {min(td):.1f} to {max(td):.1f} times" in text
    assert f"THD∞ falls to {min(thd):.2f} to {max(thd):.2f} times" in text
    # Free of steps: a twentieth of the share changes as little as it does in a continuous knob.
    for lower, higher in ((0.7, 0.74), (0.74, 0.76)):
        assert max(ratios(0, higher, lower, 0.0, 0.2)) < 1.1
    low = [abs(1 - ratio) for ratio in ratios(1, 0.74, 0.0, 0.4)]
    assert max(low) <= 0.03
    most = max(*ratios(0, 0.76, 0.74, 0.25, 0.4), *ratios(0, 0.74, 0.7, 0.25, 0.4))
    assert f"change Td up to {most:.1f} times" in text
    little = ratios(0, 0.25, 0.0, 0.25, 0.25)
    assert f"0.25 has {min(little):.2f} to {max(little):.2f} times the Td of 0" in text
