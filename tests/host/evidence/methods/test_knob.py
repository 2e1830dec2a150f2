"""The study of `thd_share`: its points, its table and picture, and what the page says of it."""

import csv
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


def _squares(rows, duty, centres):
    """Mean squares of the currents and the torque, of pulses around these middles."""
    edges = np.stack([centres - duty / 2, centres + duty / 2], axis=-1)
    apart = edges[:, :, None, :, None] - edges[:, None, :, None, :]
    apart -= np.floor(apart)
    kinds = np.multiply.outer([1.0, -1.0], [1.0, -1.0])
    products = -((apart * (1 - apart)) ** 2 / 24 * kinds).sum(axis=(-1, -2))
    return np.einsum("ka,kb,nab->nk", rows, rows, products)


def _least(rows, duty, weight, room):
    """Mean squares where the law's cost J is least, over the positions of all six pulses."""
    rng = np.random.default_rng(37)
    carriers = np.array([0.5, 0.75] * 3)
    at = rng.uniform(-1, 1, (48, 6)) * room
    step = np.full(len(at), 0.05)

    def costs(x):
        squares = _squares(rows, duty, carriers + x)
        current = squares[:, :4].sum(axis=1) / (rows[:4, 0] ** 2).sum()
        return current + weight * squares[:, 4] / ((rows[4] ** 2).sum() / 3)

    least = costs(at)
    for _ in range(60):
        slopes = np.stack([costs(at + e) - costs(at - e) for e in 1e-5 * np.eye(6)], axis=1)
        way = slopes / np.abs(slopes).max(axis=1, keepdims=True)
        there = np.clip(at - step[:, None] * way, -room, room)
        now = costs(there)
        better = now < least
        at[better], least[better] = there[better], now[better]
        step *= np.where(better, 1.2, 0.5)
    return _squares(rows, duty, carriers + at[least.argmin(), None])[0]


def _ideal_td(m_pu, shares):
    """Td with the best positions of all on paper B's machine, without a scale."""
    place = knob.at_voltage(MACHINES[1].place, m_pu)
    steady = carrier.steady_state(place.base, place, place.base.parameter("flux_ref_Wb"))
    turn = np.exp(1j * np.pi / 3 * (np.arange(4) + 0.5) / 4)
    rows = carrier.ripple_rows(place.base, steady, turn)
    duty = carrier.duty_ratios(steady.v_V * turn / place.base["inverter.vdc_V"]).T
    room = 0.45 * np.minimum(duty, 1 - duty)
    return [
        np.sqrt(np.mean([
            _least(r, d, 2 - 2 * share, most)[4] for r, d, most in zip(rows, duty, room)
        ]))
        for share in shares
    ]  # fmt: skip


def test_the_least_cost_of_all_positions_steps_too():
    """So it is the weight that steps, not the way in which the law looks for the positions."""
    low, before, after, high = _ideal_td(0.29, (0.5, 0.65, 0.74, 1.0))
    assert before == pytest.approx(low, rel=0.4) and after == pytest.approx(high, rel=0.05)
    text = " ".join((DOCS / "interleaved.md").read_text().split())
    assert f"the least J of all positions has {after / before:.1f} times the Td at 0.74" in text


def test_no_positions_bring_the_sets_in_phase_above_029():
    """A pulse has to stay in its halves, so its middle moves by half of the shorter of pulse and
    gap at most; in phase the pulses of both sets are an eighth off their carriers."""
    angles = np.exp(1j * np.deg2rad(np.arange(0, 360, 1)))

    def room(m_pu):
        duty = carrier.duty_ratios(m_pu * angles)
        return 0.5 * np.minimum(duty, 1 - duty).min()

    assert room(1 / np.sqrt(12)) == pytest.approx(1 / 8, abs=1e-3)
    assert room(0.28) > 1 / 8 > room(0.3)
