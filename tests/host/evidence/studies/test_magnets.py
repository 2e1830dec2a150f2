"""Machines with magnets in the study of machines: they lie around those that are built in, what is
asked of them is what they carry, and the drive knows no more than the data sheet."""

import math

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.studies import machines, magnets
from hexatorque.evidence.studies.truths import SCATTER
from hexatorque.plant.machines.magnet_parameters import Parameters
from hexatorque.setups.design import REACH_PU, USABLE


def of(number):
    true = magnets.truth(number)
    return true, Parameters(**true.machine)


def test_drawn_machines_keep_the_ratios_of_the_built_in_ones():
    """L_d i over psi_f does not depend on power, voltage, speed and poles; both values are off by
    the scatter."""
    known = {one.name: one for one in magnets.builtin()}
    errors = []
    for number in range(magnets.DRAWN):
        true, drawn = of(number)
        one = known[true.name.split("like ")[1]]
        built = Parameters(**one.machine_values())
        current_A = built.current_A(one["rated.torque_Nm"], built.psi_f_Wb) / math.sqrt(2)
        ratios = (
            p.ld_H * i_A / p.psi_f_Wb
            for p, i_A in ((drawn, true.sheet["current_A"]), (built, current_A))
        )
        errors.append(math.log(next(ratios) / next(ratios)))
        assert drawn.lq_H >= drawn.ld_H and 0.13 < drawn.lxy_H / drawn.ld_H < 0.42
    spread = math.sqrt(sum(e * e for e in errors) / len(errors))
    assert spread == pytest.approx(math.sqrt(2) * SCATTER, rel=0.2)


@pytest.mark.parametrize("number", [*range(0, magnets.DRAWN, 9), *magnets.numbers(False)[-3:]])
def test_the_true_machine_carries_its_rated_torque_at_its_rated_speed(number):
    """The voltage equation in the frame of the rotor, at the currents of the least current."""
    true, p = of(number)
    i_d, i_q = p.least_current(true.sheet["torque_Nm"])
    omega = true.sheet["speed_rpm"] * math.pi / 30 * p.pole_pairs
    v_d = p.rs_ohm * i_d - omega * p.lq_H * i_q
    v_q = p.rs_ohm * i_q + omega * (p.psi_f_Wb + p.ld_H * i_d)
    assert math.hypot(v_d, v_q) == pytest.approx(USABLE * REACH_PU * true.sheet["vdc_V"], rel=0.02)
    assert math.hypot(i_d, i_q) == pytest.approx(math.sqrt(2) * true.sheet["current_A"], rel=1e-3)


def test_the_drive_knows_the_sheet_and_not_the_machine():
    true = magnets.truth(3)
    told = magnets.told(true)
    setup = machines.drive(true, told.setup, 3)
    for name in ("rs_ohm", "ld_H", "lq_H", "lxy_H", "psi_f_Wb", "cogging_Nm", "start_deg"):
        assert setup[f"machine.{name}"] == pytest.approx(true.machine[name])
    before, after = setups.parameters(told.setup), setups.parameters(setup)
    assert {n: v for n, v in after.items() if v != before[n]} == {}
    assert after["emf5_share"] == after["emf7_share"] == 0 < min(true.machine["emf_share"][:2])
    assert setup["sensors.i_noise_A"] > 0 and any(setup["machine.drs_ohm"])
    flux, allowed = true.machine["psi_f_Wb"] / told.setup["machine.psi_f_Wb"], magnets.FLUX
    assert allowed[0] - 1e-3 < flux < allowed[1] + 1e-3 and abs(flux - 1) > 1e-3


def test_no_speed_is_asked_at_which_the_magnets_drive_current_by_themselves():
    for number in magnets.numbers(False):
        true, p = of(number)
        told = magnets.told(true)
        assert told.fast * told.speed_rpm < p.ceiling_rpm(true.sheet["vdc_V"])


@pytest.mark.parametrize(
    "number",
    [
        # The flux fell behind the magnets beyond the pull-out while they braked in field weakening.
        7,
        45,
        # So little friction that the rotor still swings when the current turns to the second angle.
        73,
        82,
    ],
)
def test_machines_that_a_drive_once_lost_are_driven(number):
    found = machines.row(number, magnets.WAY)
    assert found["tried"][found["written"]]["reason"] == ""


def test_no_torque_is_left_where_all_current_weakens():
    """The search ends at a current along the d axis alone, whatever its last place."""
    _, p = of(14)
    for n in range(1000):
        most_A = 40 + 0.37 * n
        assert p.most_torque_Nm(1e5, p.psi_f_Wb, 10.0, most_A, 0.9) >= 0


@pytest.mark.parametrize("number, pu", [(14, 0.5), (14, 1.2), (86, 1.0), (85, 0.9), (85, 1.5)])
def test_the_most_torque_is_that_of_all_currents_the_voltage_drives(number, pu):
    """Against a grid of currents: within current and flux, and |R i + j omega psi| within the
    voltage."""
    true, p = of(number)
    most_A, flux_Wb = 2 * p.current_A(true.sheet["torque_Nm"], 0.0), 1.2 * p.psi_f_Wb
    voltage_V = 0.5 * true.sheet["vdc_V"]
    omega = pu * p.pole_pairs * true.sheet["speed_rpm"] * np.pi / 30
    size, angle = np.linspace(0, most_A, 800)[:, None], np.linspace(np.pi / 2, np.pi, 800)
    i = size * np.exp(1j * angle)
    psi = p.psi_f_Wb + p.ld_H * i.real + 1j * p.lq_H * i.imag
    may = (abs(psi) <= flux_Wb) & (abs(p.rs_ohm * i + 1j * omega * psi) <= voltage_V)
    torque = 3 * p.pole_pairs * (p.psi_f_Wb + (p.ld_H - p.lq_H) * i.real) * i.imag
    found = p.most_torque_Nm(omega, flux_Wb, voltage_V, most_A, 1.0)
    assert found == pytest.approx(np.where(may, torque, 0).max(), rel=0.01)
