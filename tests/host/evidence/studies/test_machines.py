"""The study of machines of all sizes: its machines are what their plates say, and its verdicts are
those of its runs."""

import math

import pytest

from hexatorque import firmware
from hexatorque.evidence.studies import machines
from hexatorque.setups.nameplate import circuit_of


@pytest.mark.parametrize("number", range(0, 200, 23))
def test_machines_are_physical_and_always_the_same(number):
    plate, circuit, inertia_kgm2 = machines.machine(number)
    assert machines.machine(number) == (plate, circuit, inertia_kgm2)
    assert circuit == circuit_of(plate)
    assert 0.37 <= plate.power_kW <= 250 and plate.current_A < machines.MOST_A
    assert 0.6 < plate.efficiency < 0.98 and 0.69 < plate.power_factor < 0.93
    ls_H, lr_H = circuit.lls_H + circuit.lm_H, circuit.llr_H + circuit.lm_H
    assert 0.02 < 1 - circuit.lm_H**2 / (ls_H * lr_H) < 0.2
    assert 1e3 * plate.power_kW == pytest.approx(circuit.torque_Nm * plate.speed_rpm * math.pi / 30)


def test_the_drive_knows_the_plate_and_not_the_machine():
    plate, circuit, inertia_kgm2 = machines.machine(3)
    setup = machines.drive(plate, circuit, inertia_kgm2)
    assert setup["machine.lls_H"] == circuit.lls_H and setup["machine.rr_ohm"] == circuit.rr_ohm
    ls_H, lr_H = circuit.lls_H + circuit.lm_H, circuit.llr_H + circuit.lm_H
    sigma_ls_H = ls_H - circuit.lm_H**2 / lr_H
    assert abs(setup.parameter("sigma_ls_H") / sigma_ls_H - 1) > 0.02
    assert setup["machine.inertia_kgm2"] == pytest.approx(inertia_kgm2, rel=1e-4)


@pytest.fixture(scope="module")
def result():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machines, "QUICK", 2)
        return machines.study(quick=True)


def test_the_default_scheme_drives_them(result, tmp_path):
    assert [m["schemes"]["ddr"]["passed"] for m in result["machines"]] == [True, True]
    assert [m["written"]["passed"] for m in result["machines"]] == [True, True]
    assert machines.failures(result) == []
    (table,) = machines.tables(result)
    assert len(table.rows) == len(firmware.schemes()) + 1
    path = machines.plot(result, tmp_path / "machines.png")
    assert path.read_bytes()[:4] == b"\x89PNG"


def test_too_few_are_a_failure(result):
    lost = {"allowed": True, "passed": False, "reason": "tripped", "bad": []}
    first = result["machines"][0]
    worse = {"machines": [{**first, "written": lost, "schemes": {"ddr": lost, "fdr": lost}}]}
    assert machines.failures(worse) == [
        "as new writes it: 0 of 1, needed are 98 %",
        "fdr: 0 of 1, needed are 90 %",
        "ddr: 0 of 1, needed are 98 %",
    ]
    foreseen = {"machines": [{**first, "schemes": {"fdr": {**lost, "allowed": 0}}}]}
    assert machines.failures(foreseen) == []
