"""The study of commissioning: what it calls true is the set-up's, and it sees what is wrong."""

import pytest
from campaigns import SHARE

from hexatorque import setups
from hexatorque.evidence.studies import commissioning as study


def row(name="1: 5 kW", error=0.01, **changes):
    values = {value: [2.0, 2.0 * (1 + error), 0.1] for value in (*study.ALLOWED, "friction")}
    return {
        "name": name, "power_kW": 5.0, "values": values, "mistakes": [], "lost": "",
        "gates": "", "phases": [values["R_s"]] * 6, "largest_pu": 0.7, "duration_s": 30.0,
        **changes,
    }  # fmt: skip


def wrong(**changes):
    return row("paper-b", expected=["u1: reads nothing"], named=True, **changes)


RESULT = {
    "quick": False,
    "machines": [row()] * 20,
    "built_in": [row("paper-b")],
    "miswirings": [wrong()] * 30,
}


def test_a_good_result_has_no_failure(tmp_path):
    assert study.failures(RESULT) == []
    table, built_in, miswired = study.grid(RESULT)
    assert table[2][0] == ["R_s", "2 %", "20 of 20", "1 %", "1 %", "1 %", "20 of 20"]
    assert table[2][-1] == ["friction", "–", "–", "1 %", "1 %", "1 %", "20 of 20"]
    assert table[2][1][-1] == "20 of 20"
    assert built_in[2][0] == ["R_s", "2.02 (+1.0 %)"]
    assert miswired[2] == [["paper-b", "30 of 30", "70 %"]]
    assert len(study.grid(RESULT)) == 3
    assert study.plot(RESULT, tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_too_many_errors_are_a_failure_and_nothing_found_is_an_error():
    far = row(error=0.03)
    lost = row(values={}, lost="over-current")
    assert study.failures({**RESULT, "machines": [far] + [row()] * 19}) == []
    lines = study.failures({**RESULT, "machines": [far] * 2 + [row()] * 18})
    assert lines == [
        f"{name}: within 2 % on 18 of 20 machines, needed are 95 %"
        for name in ("R_s", "R_s of the worst phase")
    ]
    assert len(study.failures({**RESULT, "machines": [lost] * 2 + [row()] * 18})) == 8


def test_an_uncertainty_that_is_too_small_is_a_failure():
    """A machine's phases hold only if all six do."""
    near = row(values={**row()["values"], "L_m": [2.0, 2.02, 0.01]})
    lines = study.failures({**RESULT, "machines": [near] * 3 + [row()] * 17})
    assert lines == ["L_m: stated ± holds 17 of 20, needed are 90 %"]
    one_off = row(phases=[[2.0, 2.02, 0.1]] * 5 + [[2.0, 2.02, 0.01]])
    assert study.failures({**RESULT, "machines": [one_off] * 2 + [row()] * 18}) == []
    lines = study.failures({**RESULT, "machines": [one_off] * 3 + [row()] * 17})
    assert lines == [f"{study.WORST}: stated ± holds 17 of 20, needed are 90 %"]


def test_a_mistake_without_name_and_a_large_current_are_failures():
    silent = wrong() | {"named": False}
    assert study.failures({**RESULT, "miswirings": [silent]}) == [
        "paper-b: u1: reads nothing: not named: nothing"
    ]
    large = row(largest_pu=1.2)
    assert study.failures({**RESULT, "built_in": [large]}) == [
        "1: 5 kW: a current 1.20 times the limit"
    ]


@pytest.mark.parametrize("name", study.BUILT_IN)
def test_thirty_different_mistakes_that_are_set_ups(name):
    setup = study.disturbed(study.doubted(name), 0)
    cases = study.miswirings(setup)
    assert len(cases) == 30
    changed = [str(sorted(setup.changed(**changes).summary().items())) for _, changes in cases]
    assert len({*changed, str(sorted(setup.summary().items()))}) == 31


def test_truth_and_belief():
    setup = study.disturbed(study.doubted("paper-b"), 4)
    plain = setups.load("paper-b")
    true = study.truth(setup, 0.1)
    assert true["σL_s"] == pytest.approx(plain.parameter("sigma_ls_H"))
    assert setup.parameter("sigma_ls_H") == pytest.approx(0.7 * true["σL_s"])
    ohms = 0.5 * (setup["inverter.r_switch_ohm"] + setup["inverter.r_diode_ohm"])
    assert true["R_s"] == pytest.approx(plain["machine.rs_ohm"] + ohms)
    # 2 us at 10 kHz are 2 % of the dc link's voltage.
    drop_V = 0.5 * (setup["inverter.v_switch_V"] + setup["inverter.v_diode_V"])
    assert true["dead-time voltage"] == pytest.approx(0.02 * plain["inverter.vdc_V"] + drop_V)
    assert sum(setup["machine.drs_ohm"]) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("number", [7, 28, 29])
def test_a_mistake_on_a_machine(number):
    """Currents that are exchanged, encoder counts and pole pairs that are told wrong."""
    setup = study.disturbed(study.doubted("small-2kw"), 0)
    words, changes = study.miswirings(setup)[number]
    found = study.miswired(setup, words, changes)
    assert found["named"] and 0 < found["largest_pu"] < 1
    assert not any(" 0 pole pairs" in line for line in found["mistakes"])


@pytest.mark.skipif(not SHARE, reason="commissions two machines: HT_WHOLE runs it")
def test_quick_study():
    result = study.study(quick=True)
    assert study.failures(result) == []
