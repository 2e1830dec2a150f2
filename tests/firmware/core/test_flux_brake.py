"""Flux braking: how far the flux is raised, whatever is measured."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

MOST, NORMAL, HOLD = 0.9, 0.6, 5
CHECK = 0.7
#: A machine that bears the raised flux.
FREE = {
    "limits": True, "may": True, "torque_share": 0.0, "flux_Wb": NORMAL, "along_A": 2.0,
    "most_A": 20.0, "off2": 0.0, "turns_V": 200.0, "omega_rad_s": 100.0,
}  # fmt: skip
ANY = st.floats(width=32, allow_nan=True, allow_infinity=True)


class Brake:
    def __init__(self, share=0.5, check=CHECK):
        raise_Wb = share * NORMAL
        per_check = 1 / check**2 if check else 0.0
        values = [NORMAL + raise_Wb, raise_Wb, HOLD, per_check]
        self.config = ffi.new("ht_flux_brake_config *", values)
        self.state = ffi.new("ht_flux_brake_state *")

    def __call__(self, normal=NORMAL, **changes):
        values = ffi.new("ht_flux_brake_input *", {**FREE, **changes})
        return lib.ht_flux_brake_step(self.config, self.state, values, normal)


def test_it_is_raised_while_the_level_limits_and_for_a_while_after():
    brake = Brake()
    assert brake(limits=False) == pytest.approx(NORMAL)
    assert brake() == pytest.approx(MOST)
    after = [brake(limits=False) for _ in range(HOLD + 1)]
    assert after == pytest.approx([MOST] * (HOLD - 1) + [NORMAL] * 2)


def test_without_a_share_or_where_the_machine_does_not_bear_it_nothing_is_added():
    assert Brake(share=0.0)() == pytest.approx(NORMAL)
    brake = Brake()
    brake()
    assert brake(may=False) == pytest.approx(NORMAL)
    assert brake(limits=False) == pytest.approx(NORMAL)  # nor does it come back


def test_the_torque_keeps_half_of_the_squared_current():
    flux = Brake()(along_A=12.0)
    # The flux with which the measured inductance takes most_A/sqrt(2) along the flux.
    inductance = NORMAL / 12.0
    assert flux == pytest.approx(20.0 / math.sqrt(2) * inductance, rel=1e-6)
    assert Brake()(along_A=100.0) == pytest.approx(NORMAL)  # it never falls below


def test_the_voltage_turns_a_tenth_more_than_the_raised_flux():
    assert Brake()(omega_rad_s=-250.0) == pytest.approx(0.9 * 200.0 / 250.0)
    assert Brake()(omega_rad_s=400.0) == pytest.approx(NORMAL)


def test_a_current_that_saturation_makes_ends_below_the_check_of_the_flux():
    fluxes = [Brake()(off2=(share * CHECK) ** 2) for share in (0.3, 0.4, 0.5, 0.6)]
    assert fluxes[0] == pytest.approx(MOST) and NORMAL < fluxes[1] < MOST
    assert fluxes[2:] == pytest.approx([NORMAL] * 2)
    assert Brake(check=0.0)(off2=1e9) == pytest.approx(MOST)


def test_the_more_torque_the_level_leaves_the_less_flux_is_added():
    fluxes = [Brake()(torque_share=share) for share in (0.0, 0.5, 1.0, 2.0)]
    assert fluxes == pytest.approx([MOST, (MOST + NORMAL) / 2, NORMAL, NORMAL])


@given(
    values=st.fixed_dictionaries({
        name: st.booleans() if isinstance(value, bool) else ANY for name, value in FREE.items()
    }),
    normal=st.floats(0.0, 2.0, width=32),
)  # fmt: skip
def test_whatever_is_measured_the_flux_is_the_normal_one_or_more_up_to_the_raised_one(
    values, normal
):
    brake = Brake()
    brake()
    flux = brake(normal, **values)
    normal = float(ffi.new("float *", normal)[0])
    assert flux == normal or normal < flux <= brake.config.most_Wb
    assert 0.0 <= brake.state.left <= HOLD


@pytest.mark.parametrize("name", [k for k, v in FREE.items() if isinstance(v, float)])
def test_what_is_no_number_adds_nothing(name):
    assert Brake()(**{name: math.nan}) == pytest.approx(NORMAL)
