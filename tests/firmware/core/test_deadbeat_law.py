"""ht_deadbeat_law against the machine it is for: an ideal one takes the voltage for one period
and must then have the torque and the flux that were asked for; and against the law's equations,
derived here once more in complex numbers.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TS, VDC = 1e-4, 300.0
SIGMA_LS, LXY, RS, GAIN = 0.028, 0.0144, 6.0, 3.0
STEP = VDC * TS
REACH, XY_SHARE, XY_LIMIT = 1.0, 0.4, 0.1
FREE_A = 4.0


def machine(**changes):
    values = {
        "ts_s": TS, "inv_ts": 1 / TS, "rs_ohm": RS, "sigma_ls_H": SIGMA_LS,
        "inv_sigma_ls": 1 / SIGMA_LS, "lxy_H": LXY, "torque_gain": GAIN,
    }  # fmt: skip
    return ffi.new("ht_observer_config *", values | changes)


def pair(z):
    return [z.real, z.imag]


class Law:
    def __init__(self, gain=1.0, ki=0.0, reach_pu=1.0):
        self.cfg = ffi.new("ht_deadbeat_law_config *", [gain, ki, FREE_A**2, reach_pu])
        assert lib.ht_deadbeat_law_check(self.cfg)
        self.state = unwritten("ht_deadbeat_law_state *")
        lib.ht_deadbeat_law_reset(self.state)

    def step(self, psi, rotor, torque, flux, turn=0.0, psi_xy=0j, i_xy=0j, rs=RS, vdc=VDC):
        seen = ffi.new(
            "ht_voltage_law_input *",
            [
                pair(psi),
                pair(rotor),
                pair(psi_xy),
                [[0, 0], pair(i_xy)],
                turn,
                rs,
                torque,
                flux,
                vdc,
            ],
        )
        v = lib.ht_deadbeat_law_step(self.cfg, machine(), self.state, seen)
        return complex(v.ab.alpha, v.ab.beta), complex(v.xy.x, v.xy.y)


def torque_of(psi, rotor):
    return GAIN / SIGMA_LS * (rotor.conjugate() * psi).imag


def after(psi, rotor, v, turn):
    """Flux and rotor flux one period later; the current's drop is that of the period's start."""
    i = (psi - rotor) / SIGMA_LS
    return psi + TS * (VDC * v - RS * i), rotor * np.exp(1j * turn)


angles = st.floats(0, 2 * np.pi)
fluxes = st.floats(0.3, 0.6)
sizes = st.one_of(st.just(0.0), st.floats(1e-3, 0.6))


@given(angles, fluxes, st.floats(-2, 2), st.floats(-0.03, 0.03), st.floats(-0.3, 0.3),
       st.floats(-0.002, 0.002))  # fmt: skip
@settings(max_examples=examples(300), deadline=None)
def test_an_ideal_machine_has_flux_and_torque_after_one_period(
    angle, flux, torque, turn, other, longer
):
    """Where the voltage reaches: torque exactly, but for the series of second order; the length
    is that of psi* on the r of the period's start, which turns with it."""
    rotor = 0.95 * flux * np.exp(1j * angle)
    slip = np.arcsin(torque * SIGMA_LS / GAIN / (abs(rotor) * flux))
    psi = flux * np.exp(1j * (angle + slip))
    # The reference: a little more torque, a little more flux.
    wanted, length = torque + other, flux + longer
    v, xy = Law().step(psi, rotor, wanted, length, turn)
    assume(abs(v - RS * (psi - rotor) / SIGMA_LS / VDC) < 0.999 * REACH)
    psi2, rotor2 = after(psi, rotor, v, turn)
    assert abs(torque_of(psi2, rotor2) - wanted) < 2e-3 + GAIN / SIGMA_LS * abs(turn) ** 3 / 6
    assert abs(abs(psi2) - length) < 1e-4
    assert xy == 0


def expected(psi, rotor, torque, flux, turn, gain=1.0):
    """The law's equations, in double precision: the voltage, and the step asked for as a
    share of one period at V_dc, before it is limited."""
    size = abs(psi)
    along = psi / size if size else 0j
    radial = np.clip(flux - size, -0.1 * STEP, 0.1 * STEP)
    r2 = max(abs(rotor) ** 2, 1e-8)
    b = torque * SIGMA_LS / (GAIN * r2)
    a = np.sqrt(max((size + radial) ** 2 / r2 - b * b, 0.01))
    reference = (a + 1j * b) * rotor
    turned = reference * (1 - turn**2 / 2 + 1j * turn)
    e = turned - reference + gain * (reference - psi)
    most, asked = REACH * STEP, abs(e) / STEP
    if abs(e) > most:
        left = np.sqrt(max(most**2 - radial**2, most**2 / 4))
        tangential = np.clip((along.conjugate() * e).imag, -left, left)
        inward = tangential**2 / (2 * size) if size else 0.0
        e = (radial - inward + 1j * tangential) * along
    return (e / TS + RS * (psi - rotor) / SIGMA_LS) / VDC, asked


@given(angles, sizes, angles, st.floats(0.05, 0.6), st.floats(-20, 20), fluxes,
       st.floats(-0.3, 0.3), st.floats(0.1, 1.0))  # fmt: skip
@example(0.0, 0.0, 1.5, 0.5999999999999999, 0.0, 0.5, 6.103515625e-05, 0.5)  # no flux, just there
@settings(max_examples=examples(400), deadline=None)
def test_voltage_by_the_laws_equations(a, size, b, length, torque, flux, turn, gain):
    psi, rotor = size * np.exp(1j * a), length * np.exp(1j * b)
    v, _ = Law(gain).step(psi, rotor, torque, flux, turn)
    want, asked = expected(psi, rotor, torque, flux, turn, float(np.float32(gain)))
    if abs(asked - REACH) > 1e-3:  # just there, rounding decides whether it is within reach
        assert abs(v - want) < 2e-4


def test_out_of_reach_the_flux_comes_first_and_torque_has_at_least_half():
    psi = rotor = 0.4 + 0j
    for torque, way in ((40, 1), (-40, -1)):
        v, _ = Law().step(psi, rotor, torque, 0.8)
        assert v.imag == pytest.approx(way * np.sqrt(REACH**2 - 0.1**2), rel=1e-4)
        # The rest of the tenth goes into following the circle.
        assert v.real == pytest.approx(0.1 - v.imag**2 * STEP / (2 * 0.4), rel=1e-3)


def span(v, v_xy):
    """Largest distance of two legs of a set, units of Vdc: up to 1 both fit between the rails."""
    phases = np.deg2rad([[0, 120, 240], [30, 150, 270]])
    legs = v.real * np.cos(phases) + v.imag * np.sin(phases)
    legs += v_xy.real * np.cos(5 * phases) + v_xy.imag * np.sin(5 * phases)
    return np.ptp(legs, axis=1).max()


@pytest.mark.parametrize("torque", (40, -40))
def test_beyond_a_share_of_the_trip_an_xy_current_gets_its_voltage(torque):
    """A torque step out of reach makes the modulator limit legs, and limited legs make an x-y
    voltage that nobody asked for. With a large x-y current both sets fit, with the voltage that
    takes 0.4 of it away up to 0.07 V_dc."""
    for angle in np.arange(0, 2 * np.pi, 0.05):
        turned = np.exp(1j * angle)
        against = 0.07 * np.exp(-1j * 3 * angle)
        for i_A, fits in ((0.999 * FREE_A, False), (1.001 * FREE_A, True), (np.nan, True)):
            v, _ = Law().step(0.4 * turned, 0.4 * turned, torque, 0.4, i_xy=complex(0, i_A))
            assert (span(v, 0j) <= 1 and span(v, against) <= 1.001) == fits
            if fits:
                assert abs(v) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("torque", (40, -40))
def test_a_law_that_must_not_make_xy_current_asks_for_what_both_sets_can_make(torque):
    for angle in np.arange(0, 2 * np.pi, 0.05):
        turned = np.exp(1j * angle)
        for reach_pu, fits in ((1.0, False), (0.577, True)):
            v, _ = Law(reach_pu=reach_pu).step(0.4 * turned, 0.4 * turned, torque, 0.4)
            assert (span(v, 0j) <= 1.03) == fits  # along the circle, not its tangent
            assert abs(v) > 0.9 * reach_pu


@given(st.complex_numbers(max_magnitude=0.02), st.complex_numbers(max_magnitude=2))
@settings(max_examples=100, deadline=None)
def test_xy_takes_a_share_of_the_predicted_current(psi_xy, i_xy):
    _, xy = Law().step(0.4 + 0j, 0.38 + 0j, 0.0, 0.4, psi_xy=psi_xy, i_xy=i_xy)
    assert abs(xy + XY_SHARE * psi_xy / STEP) < 1e-4
    left = psi_xy + VDC * TS * xy
    assert abs(left) <= (1 - XY_SHARE) * abs(psi_xy) + 1e-6


@pytest.mark.parametrize("sense", (1, -1))
def test_xy_integrators_remove_a_mean_error_in_either_frame(sense):
    """An x-y current that stands still in the frame turning with or against the flux drives the
    voltage up, against it, as far as the limit. The sample counts, not the prediction."""
    law = Law(ki=1e-3)
    first = None
    for n in range(4000):
        turn = np.exp(1j * 0.03 * n)
        i_xy = 0.2 * (turn if sense > 0 else turn.conjugate())
        _, xy = law.step(0.4 * turn, 0.38 * turn, 0.0, 0.4, i_xy=i_xy)
        seen = xy / i_xy
        if n == 20:
            first = seen
    assert first.real < -1e-3
    assert seen.real < 5 * first.real
    assert max(abs(xy.real), abs(xy.imag)) <= XY_LIMIT + 1e-6
    lib.ht_deadbeat_law_reset(law.state)
    assert not any(bytes(ffi.buffer(law.state)))


odd = st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-42])
any_value = st.one_of(odd, st.floats(width=32))


@given(st.lists(any_value, min_size=13, max_size=13))
@settings(max_examples=examples(400), deadline=None)
def test_no_input_spoils_the_state(values):
    law = Law(ki=1e-3)
    z = [complex(a, b) for a, b in zip(values[0:8:2], values[1:8:2])]
    law.step(z[0], z[1], values[8], values[9], values[10], z[2], z[3], values[11], values[12])
    state = np.frombuffer(bytes(ffi.buffer(law.state)), "<f4")
    assert np.all(np.abs(state) <= np.float32(XY_LIMIT))  # NaN would not be
    v, xy = law.step(0.4 + 0j, 0.38 + 0j, 1.0, 0.4)
    assert np.isfinite([v, xy]).all()


@pytest.mark.parametrize(
    "values",
    (
        (0.0, 0.0, 1.0), (1.1, 0.0, 1.0), (np.nan, 0.0, 1.0), (1.0, -1e-3, 1.0),
        (1.0, np.nan, 1.0), (1.0, np.inf, 1.0), (1.0, 0.0, 0.0), (1.0, 0.0, np.nan),
    ),
)  # fmt: skip
def test_values_out_of_range_are_refused(values):
    assert not lib.ht_deadbeat_law_check(ffi.new("ht_deadbeat_law_config *", values))


#: A value in its range; the ends of the range; values beyond them.
RANGES = {
    "gain": (1.0, [1e-6, 1.0], [0.0, -0.1, 1.001]),
    "xy_ki_per_A": (2e-3, [0.0, 1e29], [-1e-9, 1e30]),
    "xy_free_A2": (16.0, [1e-6], [0.0, -1.0]),
    "reach_pu": (1.0, [0.5, 1.0], [0.499, 1.001]),
}


@pytest.mark.parametrize("name", RANGES)
def test_each_value_has_a_range_of_which_nan_is_no_part(name):
    usual = {key: row[0] for key, row in RANGES.items()}

    def fits(value):
        return lib.ht_deadbeat_law_check(ffi.new("ht_deadbeat_law_config *", usual | {name: value}))

    _, good, bad = RANGES[name]
    assert all(fits(value) for value in good)
    assert not any(fits(value) for value in [*bad, np.nan])
