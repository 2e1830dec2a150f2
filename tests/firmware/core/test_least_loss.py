"""The flux of least loss: none found by search has less loss, and the flux rises at once and falls
after its wait."""

import math
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib

#: Pole pairs, R_s, R_r, L_ls, L_lr, L_m, and iron: W/Wb^2 per rad/s, per (rad/s)^2.
MACHINES = {
    "small": (1, 6.7, 6.9, 5.3e-3, 12.8e-3, 614e-3),
    "leaky": (2, 1.8, 2.0, 10e-3, 15e-3, 284e-3),
    "large": (2, 0.016, 0.011, 0.2e-3, 0.3e-3, 14e-3),
}
IRONS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (2.0, 2.0))
FLOOR, MOST, WAIT = 0.2, 1.0, 5


def machine(name, hysteresis=0.0, eddy=0.0):
    """iron: shares of the copper loss at 300 rad/s without load."""
    pole_pairs, rs, rr, lls, llr, lm = MACHINES[name]
    copper_W_Wb2 = 3 * rs / (lls + lm) ** 2
    return SimpleNamespace(
        p=pole_pairs, rs=rs, rr=rr, lls=lls, llr=llr, lm=lm,
        kh=hysteresis * copper_W_Wb2 / 300, ke=eddy * copper_W_Wb2 / 300**2,
    )  # fmt: skip


def config(m, floor=FLOOR, wait=WAIT, gain=0.0):
    lr, ls = m.llr + m.lm, m.lls + m.lm
    sigma_ls = ls - m.lm**2 / lr
    return ffi.new(
        "ht_least_loss_config *",
        {
            "error_gain": gain, "per_Nm": lr / (3 * m.p * m.lm**2), "ls2_H2": ls**2,
            "across2_H2": sigma_ls**2, "rotor_ohm": m.rr * (m.lm / lr) ** 2,
            "hysteresis_ohm": m.kh / 3, "eddy_ohm": m.ke / 3, "reach_Nm_Wb2": 1.0,
            "floor_Wb": floor, "wait": wait,
        },
    )  # fmt: skip


def given(m, torque=1.0, omega=0.0, limited=False, made=None, rr_scale=1.0):
    made = torque if made is None else made
    return ffi.new("ht_least_loss_input *", [torque, made, omega, m.rs, rr_scale, limited])


def loss_W(m, flux, torque, omega):
    """By the equivalent circuit in complex numbers: the slip at which this flux makes this torque,
    found by bisection below pull-out. NaN beyond it."""

    def currents(slip):
        rotor = m.rr + 1j * slip * (m.llr + m.lm)
        i = np.linalg.solve([[m.lls + m.lm, m.lm], [1j * slip * m.lm, rotor]], [flux, 0])
        return i, 3 * m.p * (flux * i[0]).imag

    sigma = 1 - m.lm**2 / ((m.lls + m.lm) * (m.llr + m.lm))
    low, high = 0.0, m.rr / (sigma * (m.llr + m.lm))
    if currents(high)[1] < torque:
        return math.nan
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if currents(middle)[1] > torque else (middle, high)
    (stator, rotor), _ = currents(low)
    copper = 3 * (m.rs * abs(stator) ** 2 + m.rr * abs(rotor) ** 2)
    return copper + flux**2 * (m.kh * omega + m.ke * omega**2)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("iron", IRONS, ids=str)
def test_no_flux_found_by_search_has_less_loss(name, iron):
    m = machine(name, *iron)
    for omega, torque in product((0.0, 30.0, 300.0), (0.1, 10.0)):
        flux = lib.ht_least_loss_Wb(config(m), given(m, omega=omega), torque)
        found = loss_W(m, flux, torque, omega)
        fluxes = flux * np.geomspace(0.3, 3, 301)
        searched = np.nanmin([loss_W(m, other, torque, omega) for other in fluxes])
        assert found <= searched * (1 + 1e-5)


def test_either_sign_of_torque_and_speed_has_the_same_flux():
    m = machine("leaky", 1.0, 1.0)
    one = lib.ht_least_loss_Wb(config(m), given(m, omega=200.0), 5.0)
    for omega, torque in product((-200.0, 200.0), (-5.0, 5.0)):
        assert lib.ht_least_loss_Wb(config(m), given(m, omega=omega), torque) == one


def test_the_resistances_in_use_count_not_the_configured_ones():
    m = machine("leaky")
    hot = SimpleNamespace(**{**vars(m), "rs": 1.4 * m.rs, "rr": 1.4 * m.rr})
    alike = lib.ht_least_loss_Wb(config(m), given(hot, rr_scale=1.4), 5.0)
    assert alike == pytest.approx(lib.ht_least_loss_Wb(config(m), given(m), 5.0), rel=1e-6)
    other = SimpleNamespace(**{**vars(m), "rr": 1.4 * m.rr})
    assert lib.ht_least_loss_Wb(config(m), given(m, rr_scale=1.4), 5.0) == pytest.approx(
        lib.ht_least_loss_Wb(config(other), given(other), 5.0), rel=1e-6
    )


class Steps:
    def __init__(self, **changes):
        self.m = machine("leaky")
        self.cfg = config(self.m, **changes)
        self.st = ffi.new("ht_least_loss_state *")
        lib.ht_least_loss_reset(self.st, MOST)

    def __call__(self, *torques, most=MOST, **changes):
        """The flux after each step."""
        return [
            lib.ht_least_loss_step(self.cfg, self.st, given(self.m, t, **changes), most)
            for t in torques
        ]

    def of(self, torque):
        return lib.ht_least_loss_Wb(self.cfg, given(self.m), torque)


def test_the_flux_falls_after_the_wait_to_the_largest_that_was_asked_for_meanwhile():
    step = Steps()
    assert FLOOR < step.of(1.0) < step.of(2.0) < MOST
    fluxes = step(1.0, 2.0, *[1.0] * (2 * WAIT - 2))
    assert fluxes[: WAIT - 1] == [MOST] * (WAIT - 1)
    assert fluxes[WAIT - 1 : -1] == pytest.approx([step.of(2.0)] * WAIT)
    assert fluxes[-1] == pytest.approx(step.of(1.0))


def test_the_flux_rises_at_once_and_the_wait_begins_again():
    step = Steps()
    step(*[1.0] * WAIT)
    fluxes = step(*[1.0] * (WAIT - 1), 3.0, *[1.0] * (WAIT - 1))
    assert fluxes[: WAIT - 1] == pytest.approx([step.of(1.0)] * (WAIT - 1))
    assert fluxes[WAIT - 1 :] == pytest.approx([step.of(3.0)] * WAIT)


def test_the_flux_stays_between_floor_and_most():
    step = Steps()
    assert step(*[0.0] * WAIT)[-1] == pytest.approx(FLOOR)
    assert step(1e6) == [MOST]
    # The parameter flux_ref_Wb may change at any time, also to below the floor.
    assert step(1e6, most=0.6) == pytest.approx([0.6])
    assert step(0.0, most=0.1) == pytest.approx([0.1])
    assert step(1e6, most=2.0) == [2.0]


def test_a_torque_that_lacks_flux_gets_all_of_it_at_once():
    step = Steps()
    step(*[1.0] * WAIT)
    assert step(1.0, limited=True) == [MOST]


@pytest.mark.parametrize("strange", (math.nan, math.inf, -math.inf))
def test_a_torque_or_speed_that_is_no_number_leaves_the_parameter_s_flux(strange):
    for changes in ({"torque": strange}, {"made": strange}, {"omega": strange}):
        step = Steps(gain=0.1)
        step(*[1.0] * WAIT)
        values = {"torque": 1.0, **changes}
        flux = lib.ht_least_loss_step(step.cfg, step.st, given(step.m, **values), MOST)
        # An estimate alone does not count, and none of them is remembered.
        assert flux == (pytest.approx(step.of(1.0)) if "made" in changes else MOST)
        assert step(*[1.0] * WAIT, made=1.0)[-1] == pytest.approx(step.of(1.0))


def test_a_machine_without_any_loss_keeps_the_parameter_s_flux():
    m = SimpleNamespace(**{**vars(machine("leaky")), "rs": 0.0, "rr": 0.0})
    st = ffi.new("ht_least_loss_state *")
    lib.ht_least_loss_reset(st, MOST)
    assert lib.ht_least_loss_step(config(m), st, given(m), MOST) == MOST


def test_the_torque_that_the_tables_make_counts_not_the_one_they_were_asked_for():
    """At light load their reference is up to 40 % above their torque; the ripple is averaged."""
    step = Steps(gain=1 / 101, wait=50)
    rng = np.random.default_rng(3)
    for made in 1.0 + rng.normal(0, 0.5, 3000):
        (flux,) = step(1.4, made=made)
    assert flux == pytest.approx(step.of(1.0), rel=0.08)
    assert flux < 0.95 * step.of(1.4)
    # It is a difference: a step of the reference counts at once.
    assert step(2.4, made=1.0)[0] == pytest.approx(step.of(2.0), rel=0.05)
