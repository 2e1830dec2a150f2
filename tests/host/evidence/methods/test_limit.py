"""The limit of all pulse patterns: its ripple against integrals, a closed form and the plant, and
its optimum against random patterns."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from hexatorque import setups
from hexatorque.errors import InputError
from hexatorque.evidence.methods import bench, carrier, limit
from hexatorque.evidence.methods.methods import methods, variants
from hexatorque.evidence.methods.places import TWENTY, Place
from hexatorque.evidence.studies import limit as study
from hexatorque.plant.vsd import ANGLES_RAD, INVERSE, SETS, TRANSFORM

DATA = Path(__file__).resolve().parents[4] / "docs/data"
PLACE = TWENTY[6]  # paper A's machine at 0.5 V_dc
STEPS = 20_000
TAU = (np.arange(STEPS) + 0.5) / STEPS


def angle_of(v_pu, rows=None):
    """An angle of the voltage, of paper A's machine unless rows say otherwise."""
    turn = np.array([v_pu / abs(v_pu)])
    setup = PLACE.base
    if rows is None:
        rows = carrier.ripple_rows(setup, carrier.steady_state(setup, PLACE, 0.6), turn)[0]
    return limit._Angle(INVERSE[:, :2] @ [v_pu.real, v_pu.imag], rows)


V_PU = 0.5 * np.exp(0.2j)


def some(v_pu=V_PU, weight=2.0, seed=1, count=40):
    """Random patterns of random kinds."""
    rng = np.random.default_rng(seed)
    every = angle_of(v_pu).kinds(weight)
    kinds = every[rng.choice(len(every.pulses), count, replace=False)]
    return kinds, kinds.random(rng)


def states(patterns, x):
    """(n, 6, STEPS): of the legs over the pattern, from the edges; a leg without edges is where its
    set's rail is."""
    found = np.zeros((len(x), 6, STEPS))
    for n, times in enumerate(patterns.edges(x)):
        for leg in range(6):
            for begin, end in times[leg][: patterns.pulses[n, leg]]:
                found[n, leg] += (TAU - begin) % 1 < end - begin
            if patterns.pulses[n, leg] == 0:
                found[n, leg] = patterns.rails[n, leg % 2] > 0
    return found


@pytest.mark.parametrize("seed", range(3))
def test_the_products_are_integrals_over_the_states(seed):
    """In time, from the legs' states alone: integral of what differs from the mean, its own mean
    taken off, the products' mean. The pattern with N pulses lasts N/6 of one with a pulse a leg."""
    patterns, x = some(seed=seed)
    high = states(patterns, x)
    assert set(np.unique(high)) == {0, 1}
    ripple = np.cumsum(high - high.mean(axis=2, keepdims=True), axis=2) / STEPS
    ripple -= ripple.mean(axis=2, keepdims=True)
    lasts = patterns.pulses.sum(axis=1)[:, None, None] / 6
    integrals = np.einsum("nat,nbt->nab", ripple, ripple) / STEPS * lasts**2
    assert patterns.products(x) == pytest.approx(integrals, abs=3e-5)
    assert np.abs(integrals).max() > 3e-3


def test_every_free_value_is_a_pattern_with_the_mean_voltage():
    v_pu = 0.55 * np.exp(0.4j)
    patterns, x = some(v_pu)
    alpha, beta, x_pu, y_pu = TRANSFORM @ states(patterns, 3 * x).mean(axis=2).T
    assert alpha + 1j * beta == pytest.approx(v_pu, abs=2e-3)
    assert np.hypot(x_pu, y_pu).max() < 2e-3


def test_slopes_are_differences():
    patterns, x = some()
    of_edges = patterns.of_edges()
    costs, slopes = patterns.costs(x, of_edges)
    assert costs == pytest.approx(
        np.einsum("nab,nab->n", patterns.weights, patterns.products(x)), rel=1e-9
    )
    for n, step in enumerate(1e-5 * np.eye(patterns.free)):
        ends = [patterns.costs(x + sign * step, of_edges)[0] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(slopes[:, n], abs=1e-9), n


def centred(legs_pu):
    """Of each row of legs: a pulse of each in the middle, zero sequences between the rails."""
    n = len(legs_pu)
    patterns = limit.Patterns(
        legs_pu, np.ones((n, 6), int), np.zeros((n, 2), int), np.zeros((n, 6, 6))
    )
    x = np.zeros((n, patterns.free))
    begin, end = np.moveaxis(patterns.edges(x)[:, :, 0], 2, 0)
    x[:, : -2 : 2 * limit.PULSES - 1] = 0.5 - (end - begin) / 2
    return patterns, x


@pytest.mark.parametrize("m", [0.1, 0.5, 1.0, 1.15])
def test_one_three_phase_set_has_the_distortion_of_centred_modulation(m):
    """The closed form of space-vector modulation, m: amplitude over V_dc/2 (Hava, Kerkman, Lipo,
    IEEE Trans. Power Electron. 14(1), 1999)."""
    turn = np.exp(1j * np.pi / 3 * (np.arange(2000) + 0.5) / 2000)
    patterns, x = centred((INVERSE[:, :2] @ [m / 2 * turn.real, m / 2 * turn.imag]).T)
    legs = list(SETS[0])
    own = 2 * TRANSFORM[:2, legs]  # of this set alone
    mean = np.einsum("ka,kb,nab->", own, own, patterns.products(x)[:, legs][:, :, legs]) / 2000
    s3 = math.sqrt(3)
    form = 1.5 * m**2 - 4 * s3 / np.pi * m**3 + (27 / 16 - 81 * s3 / (64 * np.pi)) * m**4
    assert mean == pytest.approx(form / 288, rel=1e-4)


def test_a_salient_machine_has_its_torque_by_its_two_inductances():
    """From a small change of the stator flux, through both axes, without the formula."""
    setup = setups.load("magnet-interior")
    place = Place("magnet-interior", 500, 2.0)
    at = carrier.steady_state(setup, place, 0.0)
    m = setup.machine_values()
    id_A, iq_A = carrier.Design(setup, setup.parameter).unsaturated.least_current(2.0)
    turned = np.exp(0.7j)
    rows = carrier.ripple_rows(setup, at, np.array([turned]))[0]
    # The frame of the steady state lies along its stator flux.
    psi = complex(m["psi_f_Wb"] + m["ld_H"] * id_A, m["lq_H"] * iq_A)
    to_dq = psi / abs(psi) / turned

    def torque_Nm(more):
        here = psi + more * to_dq
        i = complex((here.real - m["psi_f_Wb"]) / m["ld_H"], here.imag / m["lq_H"])
        return 3 * m["pole_pairs"] * (here.conjugate() * i).imag

    assert torque_Nm(0) == pytest.approx(2.0)
    for leg in range(6):
        column = 1e-6 * complex(*TRANSFORM[:2, leg])
        change = (torque_Nm(column) - torque_Nm(-column)) / 2e-6
        assert rows[4, leg] == pytest.approx(change, rel=1e-6)


def test_no_random_pattern_is_below_the_optimum():
    """Of the same numbers of pulses, and of any: the optimum of each kind is below a thousand
    random ones of its kind, and the front's below all kinds."""
    kinds = angle_of(V_PU).kinds(2.0)
    start = kinds[np.repeat(np.arange(len(kinds.pulses)), 2)]
    x, costs = start.minimised(start.random(np.random.default_rng(3)), 60)
    assert (costs <= start.costs(x, start.of_edges())[0] + 1e-15).all()
    for kind in np.random.default_rng(4).choice(len(costs) // 2, 12, replace=False):
        own = start[np.full(1000, 2 * kind)]
        tried = own.costs(own.random(np.random.default_rng(5)), own.of_edges())[0]
        assert tried.min() > costs[2 * kind : 2 * kind + 2].min()


@pytest.fixture(scope="module")
def front():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(limit, "WEIGHTS", (0.0, 2.0, 32.0))
        return limit.front(PLACE.base, PLACE, 3e3, 0.6, quick=True)


def test_the_front_trades_one_figure_for_the_other(front):
    td, thd = zip(*((one.ripple.td_Nm, one.ripple.thd_inf_pct) for one in front))
    assert (np.diff(td) < 0).all() and (np.diff(thd) > 0).all()


def test_the_front_is_in_inverse_proportion_to_the_switching_frequency(front, monkeypatch):
    monkeypatch.setattr(limit, "WEIGHTS", limit.WEIGHTS[:1])
    twice = limit.front(PLACE.base, PLACE, 6e3, 0.6, quick=True)[0].ripple
    assert 2 * twice.td_Nm == pytest.approx(front[0].ripple.td_Nm)
    assert 2 * twice.thd_inf_pct == pytest.approx(front[0].ripple.thd_inf_pct, rel=0.02)


def whole_period_thd_pct(pulses, starts):
    """The least distortion of patterns over a whole fundamental that were found, and their f_sw:
    all legs alike, mirrored after half a period, so the first half of one leg's edges is free.
    Nothing stands still here; the ripple is what remains without the fundamental."""
    setup, flux_Wb = PLACE.base, 0.6
    at = carrier.steady_state(setup, PLACE, flux_Wb)
    vdc_V, f1_Hz = setup["inverter.vdc_V"], abs(at.omega_rad_s) / (2 * np.pi)
    m_pu = abs(at.v_V) / vdc_V
    rows = carrier.ripple_rows(setup, at, np.ones(1))[0][:4]
    weights = np.repeat((rows.T @ rows)[0], 2 * pulses)
    later = ANGLES_RAD[:, None] / (2 * np.pi)
    signs = (-1.0) ** np.arange(pulses)
    both = np.tile([*signs, *-signs], 6) * weights
    order = np.diff(np.eye(pulses), axis=0)  # also: the last edge comes before the mirrored first
    order = np.vstack([order, np.eye(pulses)[0] - np.eye(pulses)[-1]])
    room = np.append(np.zeros(pulses - 1), 0.5)

    def fundamental(x):
        turned = 2 * signs * np.exp(-2j * np.pi * x) / np.pi
        total = turned.sum()
        return abs(total), (-2j * np.pi * turned * total.conjugate()).real / abs(total)

    def ripple_A2(x):
        apart = x[:, None] - (np.concatenate([x, x + 0.5]) + later).ravel()
        apart -= np.floor(apart)
        y = apart * (1 - apart)
        pairs = both * signs[:, None]
        size, by_x = fundamental(x)
        known = (at.per_H / (2 * np.pi)) ** 2
        value = -0.5 * (pairs * y * y).sum() - known * size**2
        slopes = -2 * (pairs * y * (1 - 2 * apart)).sum(axis=1) - 2 * known * size * by_x
        return 50 * value, 50 * slopes

    rng, found = np.random.default_rng(7), []
    for _ in range(starts):
        at_x = (np.arange(pulses) + 0.5) * 0.5 / pulses
        wave = m_pu * np.sin(2 * np.pi * (at_x + rng.random())) + rng.normal(0, 0.08, pulses)
        done = minimize(
            ripple_A2, np.sort(at_x - signs * wave * 0.5 / pulses), jac=True, method="SLSQP",
            constraints=[
                {"type": "eq", "fun": lambda x: fundamental(x)[0] - m_pu,
                 "jac": lambda x: fundamental(x)[1]},
                {"type": "ineq", "fun": lambda x: order @ x + room, "jac": lambda x: order},
            ], options={"maxiter": 300, "ftol": 1e-9},
        )  # fmt: skip
        if abs(fundamental(done.x)[0] - m_pu) < 1e-6 and (order @ done.x + room).min() > -1e-9:
            found.append(done.fun / 50)
    return 100 * math.sqrt(min(found)) * vdc_V / f1_Hz / abs(at.i_A), pulses * f1_Hz


@pytest.mark.parametrize("pulses", [9, 11, 15])
def test_patterns_over_a_whole_fundamental_come_to_the_limit(front, pulses):
    """Another model and another search: with so few pulses of a leg in a fundamental the best that
    is found is the limit, within what the turning voltage makes of them. The front here has few
    angles; what the page prints has all of them."""
    thd_pct, f_sw_Hz = whole_period_thd_pct(pulses, 40)
    least_pct = front[0].ripple.thd_inf_pct * 3e3 / f_sw_Hz
    assert thd_pct == pytest.approx(least_pct, rel=0.03)
    with (DATA / "limit.csv").open() as file:
        (printed,) = [
            float(row["THD∞ [%]"])
            for row in csv.DictReader(file)
            if (row["point"], row["pattern"]) == ("paper A, 900 r/min, 10 N m", "limit, w = 0")
        ]
    assert thd_pct == pytest.approx(printed * 4e3 / f_sw_Hz, rel=0.02)


def test_sharing_the_switching_out_is_never_worse_than_an_equal_one(monkeypatch):
    """Two angles of which one has eight times the cost of the other: shares of 2 to 1."""
    rows = np.zeros((5, 6))
    rows[:5, 0] = 1.0
    every = [limit._Angle(np.zeros(6), rows)] * 2
    products = [np.zeros((1, 6, 6)), np.zeros((1, 6, 6))]
    products[0][0, 0, 0], products[1][0, 0, 0] = 8.0, 1.0
    at = carrier.steady_state(PLACE.base, PLACE, 0.6)
    found = limit._ripple(at, 0.5, every, products, 1.0, 1.0)
    assert found.td_Nm**2 == pytest.approx((8 / (4 / 3) ** 2 + 1 / (2 / 3) ** 2) / 2)
    assert found.td_Nm**2 < (8 + 1) / 2


def test_what_the_drive_has_is_above_the_limit_and_near_its_own_pattern(front):
    """`db-dtfc` clamped and turned, on the plant with dead time, at 0.5 V_dc."""
    method = next(v for v in variants() if v.name == "db-dtfc κ=1")
    values = method.values(PLACE.base, np.array([0.6, 0.9]))
    assert values["carrier_turn"] == "always"
    found = bench.measure("db-dtfc", values, PLACE, window_s=0.1)
    own = carrier.ripple(PLACE.base, PLACE, found["f_sw_Hz"], found["flux_Wb"], True, 1.0)
    least = 3e3 / found["f_sw_Hz"]
    for name, n in (("td_Nm", -1), ("thd_inf_pct", 0)):
        assert found[name] == pytest.approx(getattr(own, name), rel=0.1), name
        assert found[name] > least * getattr(front[n].ripple, name)


def test_carrier_modulation_is_one_of_the_patterns():
    """The same products as the line's own closed form, at any angle."""
    v_pu = 0.45 * np.exp(1j * np.linspace(0, 6, 40))
    patterns, x = centred((INVERSE[:, :2] @ [v_pu.real, v_pu.imag]).T)
    duty = carrier.duty_ratios(v_pu)
    for a, b in ((0, 0), (0, 2), (1, 4), (5, 5)):
        expected = carrier.product(duty[a], duty[b])
        assert patterns.products(x)[:, a, b] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "f_sw_Hz", "words"),
    [
        ({"speed_rpm": 4000}, 3e3, "beyond linear modulation: allowed range is 0 .. 0.577 V_dc"),
        ({"torque_Nm": 1e4}, 3e3, "cannot give"),
        ({}, 100.0, "(--f-sw) = 100 Hz: allowed range is"),
        ({}, math.nan, "allowed range is"),
    ],
)
def test_what_cannot_be_is_refused_before_the_search(change, f_sw_Hz, words):
    with pytest.raises(InputError) as refused:
        limit.front(PLACE.base, replace(PLACE, **change), f_sw_Hz, 0.6)
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(("name", "carriers"), [("paper-b", 4), ("symmetrical", 0)])
def test_the_study_has_every_winding_and_names_what_is_below_it(
    name, carriers, tmp_path, monkeypatch
):
    monkeypatch.setattr(limit, "WEIGHTS", (0.0, 8.0))
    monkeypatch.setattr(limit, "STARTS", 1)
    monkeypatch.setattr(limit, "QUICK_ANGLES", 2)
    told = []
    where = study.at_point(setups.load(name))
    result = study.study([where], 4e3, quick=True, tell=lambda: told.append(1))
    assert len(told) == study.pieces([where], True)
    assert study.failures(result) == []
    ((_, heads, rows),) = study.grid(result)
    assert len(rows) == 2 + carriers and all(len(row) == len(heads) for row in rows)
    for row in rows:
        assert all(math.isfinite(float(cell)) for cell in row[3:])
    marks = {where[0]: {"foc": (9.0, 0.1)}}
    assert study.plot(result, tmp_path / "limit.png", marks).stat().st_size > 15_000
    if carriers:
        for one in result["points"][0]["limit"]:
            one["thd_inf_pct"] *= 1.5
        assert any("carrier, turned is below" in line for line in study.failures(result))


def test_what_the_methods_reach_at_a_point_of_a_set_up_that_is_not_built_in(tmp_path, monkeypatch):
    """No method has less than the limit of the machine that is given; with twice the leakage its
    currents have less distortion than with the built-in one."""
    monkeypatch.setattr(limit, "WEIGHTS", (0.0, 32.0))
    monkeypatch.setattr(limit, "STARTS", 2)
    monkeypatch.setattr(limit, "QUICK_ANGLES", 4)
    some = [method for method in methods() if method.name in ("foc", "db-ipwm smooth")]
    monkeypatch.setattr(study, "methods", lambda: some)
    base = setups.load("paper-b")
    found = {}
    for factor in (1.0, 2.0):
        more_H = factor * base["machine.lxy_H"]
        where = study.at_point(base.changed(machine__lxy_H=more_H))
        assert where[2].base["machine.lxy_H"] == more_H
        result = study.study([where], 4e3, quick=True)
        there = study.reached([where], result, tmp_path)
        result["methods"] = study.best(there, 8e3)
        found[factor] = result
        at = there[where[0]]
        for row in [row for rows in at.rows.values() for row in rows]:
            for key in ("td_Nm", "thd_inf_pct"):
                assert row[key] > 0.97 * at.least_at_1kHz[key] * 1e3 / row["f_sw_Hz"]
        assert study.draw_fronts(there, tmp_path / "fronts.png").stat().st_size > 15_000
        assert study.plot(result, tmp_path / "limit.png").stat().st_size > 15_000
        ((_, heads, rows),) = study.grid(result)
        assert [row[2] for row in rows[-2:]] == ["foc, at its best", "db-ipwm smooth, at its best"]
        assert all(len(row) == len(heads) for row in rows)
    one, two = (result["methods"][where[0]]["db-ipwm smooth"] for result in found.values())
    assert two["thd_inf_pct"]["thd_inf_pct"] < 0.8 * one["thd_inf_pct"]["thd_inf_pct"]
    kept = len(list(tmp_path.glob("*.json")))
    assert kept == 4  # of each method on each machine: another machine has settings of its own
    monkeypatch.setattr(study, "each_at_each", lambda *_: {where[2]: {"foc": []}})
    with pytest.raises(InputError, match="no method holds the point"):
        study.reached([where], result, tmp_path)
