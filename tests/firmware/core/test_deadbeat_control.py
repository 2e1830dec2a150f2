"""ht_control with the deadbeat law: what it needs, its bookkeeping of the patterns on the legs,
and the change between laws in flight.
"""

import numpy as np
import pytest
from campaigns import examples
from control_step import control_step
from hypothesis import given, settings
from hypothesis import strategies as st
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TS, VDC, PERIOD = 1e-4, 300.0, 10000
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3


def config(scheme=lib.HT_DB_DTFC, rs_ohm=6.0, dead_pu=0.02, period=PERIOD, **changes):
    cfg = ffi.new("ht_control_config *")
    lib.ht_control_select(cfg, scheme)
    cfg.shadow, cfg.predict, cfg.period.counts = True, True, period
    cfg.build_current_A = 3.0
    law = cfg.table_law
    law.flux_band_Wb, law.torque_band_Nm, law.torque_inner_Nm = 0.003, 0.3, 0.173
    law.xy.kp_pu_A, law.xy.ki_ts_pu_A = 0.1, 2.5e-4
    cfg.deadbeat_law.gain, cfg.deadbeat_law.xy_ki_per_A = 1.0, 2e-3
    cfg.deadbeat_law.xy_free_A2, cfg.deadbeat_law.reach_pu = 4.4**2, 1.0
    cfg.modulator.kappa, cfg.modulator.kappa_from_pu, cfg.modulator.turn_pu = 1.0, 0.53, 0.3
    cfg.observer.ts_s, cfg.observer.inv_ts, cfg.observer.rs_ohm = TS, 1 / TS, rs_ohm
    cfg.observer.sigma_ls_H, cfg.observer.inv_sigma_ls = 0.028, 1 / 0.028
    cfg.observer.lxy_H, cfg.observer.torque_gain, cfg.observer.omega_gain = 0.0144, 3.0, 0.02
    cfg.dead.dead_pu, cfg.dead.i_zero_A = dead_pu, 0.05
    for name, value in changes.items():
        setattr(cfg, name, value)
    cfg.period.shortest = max(1, int(np.ceil(dead_pu * period - 0.01)))
    return cfg


class Control:
    def __init__(self, cfg):
        assert lib.ht_control_check(cfg) == lib.HT_CONFIG_OK
        self.cfg, self.state = cfg, unwritten("ht_control_state *")
        self.out = unwritten("ht_compare *")
        lib.ht_control_reset(cfg, self.state, [{"p": [0.0] * 6}])

    def change(self, cfg):
        lib.ht_control_switch_over(self.cfg, cfg, self.state)
        self.cfg = cfg

    def step(self, i=(0.0,) * 6, torque=0.0, flux=0.4, vdc=VDC, build=False):
        control_step(self.cfg, self.state, self.out, i, torque, flux, vdc, build)

    def estimate(self):
        return complex(self.state.estimate.psi_Wb.alpha, self.state.estimate.psi_Wb.beta)

    def decided(self):
        return complex(self.state.decided.psi_Wb.alpha, self.state.decided.psi_Wb.beta)

    def shares(self):
        """Share of the period that each leg is high, from the registers."""
        counts, out = np.arange(self.cfg.period.counts), self.out
        start = [out.start >> (5 - leg) & 1 for leg in range(6)]
        levels = [s ^ (counts >= a) ^ (counts >= b) for s, a, b in zip(start, out.ca, out.cb)]
        return np.mean(levels, axis=1)


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, lib.HT_CONFIG_OK),
        ({"predict": False}, lib.HT_CONFIG_PREDICTION),
        ({"shadow": False, "predict": False}, lib.HT_CONFIG_PREDICTION),
        ({"shadow": False}, lib.HT_CONFIG_PREDICTION),
        ({"rs_ohm": 0.0144 / (4.9 * TS)}, lib.HT_CONFIG_SAMPLING),
        ({"rs_ohm": 0.0144 / (5.1 * TS)}, lib.HT_CONFIG_OK),
        ({"rs_ohm": np.nan}, lib.HT_CONFIG_MACHINE),
    ],
)
def test_what_the_law_needs(changes, status):
    assert lib.ht_control_check(config(**changes)) == status
    if "rs_ohm" not in changes:  # the table law needs none of it
        assert lib.ht_control_check(config(lib.HT_DDR, **changes)) == lib.HT_CONFIG_OK


@pytest.mark.parametrize("part", ("deadbeat_law", "modulator"))
def test_a_value_out_of_range_is_the_schemes_fault(part):
    cfg = config()
    if part == "modulator":
        cfg.modulator.kappa = 1.01
    else:
        cfg.deadbeat_law.gain = 0.0
    assert lib.ht_control_check(cfg) == lib.HT_CONFIG_SCHEME


@pytest.mark.parametrize("i_A", np.random.default_rng(7).uniform(-5, 5, (5, 6)).tolist())
@pytest.mark.parametrize("scheme", [lib.HT_DB_DTFC, lib.HT_DB_IPWM])
def test_the_law_sees_six_currents_by_the_vsd_matrix(scheme, i_A):
    cfg = config(scheme)
    if scheme == lib.HT_DB_IPWM:
        cfg.special, cfg.interleaved_law.deadbeat = True, cfg.deadbeat_law
        lib.ht_interleaved_configure(
            ffi.addressof(cfg.interleaved_law.positions), 2.0, 1 / TS, 0.0, 0.0, 0.36
        )
    control = Control(cfg)
    control.step(i=i_A)
    seen = control.state.observer.i_A
    np.testing.assert_allclose([seen.alpha, seen.beta], T[:2] @ i_A, atol=1e-5)


def test_the_law_knows_the_resistance_in_use():
    """Not the configured one. The voltage has the drop of the next period, and makes up for that
    of this one, in which the flux falls behind."""
    i, rotor = 2.0 - 1.0j, 0.4 + 0j
    psi = rotor + 0.028 * i
    made = []
    for rs_ohm in (2.0, 12.0):
        control = Control(config(dead_pu=0.0))
        observer = control.state.observer
        observer.psi_Wb = control.state.estimate.psi_Wb = [psi.real, psi.imag]
        # The drop of the period that ended is none: the current was the opposite at its begin.
        observer.rs_ohm, observer.i_A = rs_ohm, [-i.real, -i.imag]
        torque = 3.0 * (np.conj(psi) * i).imag
        control.step(3 * T.T @ [i.real, i.imag, 0.0, 0.0], torque, abs(psi))
        v = control.state.next.mean_pu.ab
        made.append(complex(v.alpha, v.beta) * VDC)
    assert (made[1] - made[0]) / 10.0 == pytest.approx(2 * i, rel=0.1)


def test_flux_is_the_volt_seconds_of_the_registers_also_over_changes_of_the_law():
    """Without resistance and dead time, flux is nothing but what the registers say. A change of
    the law must not lose or double a period: the pattern in the registers goes out yet."""
    rng = np.random.default_rng(3)
    schemes = [lib.HT_DB_DTFC, lib.HT_DDR, lib.HT_DB_DTFC, lib.HT_DTC1, lib.HT_DTC3]
    cfgs = [config(scheme, rs_ohm=0.0, dead_pu=0.0) for scheme in schemes]
    control = Control(cfgs[0])
    i = 3 * T.T @ [1.0, 0.5, 0.05, -0.02]
    psi, waiting = 0j, [np.zeros(6)]
    modulated = 0
    for n in range(400):
        if n % 7 == 6:
            control.change(cfgs[(n // 7) % len(cfgs)])
        control.step(i, rng.uniform(-2, 2), build=80 <= n < 100)
        assert control.estimate() == pytest.approx(psi, abs=5e-6), n
        alpha, beta, _, _ = T @ waiting.pop(0)
        psi += TS * VDC * complex(alpha, beta)
        waiting.append(control.shares())
        modulated += control.state.next.own != 0
    assert 100 < modulated < 300


@pytest.mark.parametrize("dead_pu", (0.0, 0.023, 0.2))
def test_prediction_is_the_next_estimate(dead_pu):
    """Without resistance and with steady currents nothing is uncertain: what the law sees now is
    the flux of the next sample, dead time included, also where a delay runs on."""
    control = Control(config(rs_ohm=0.0, dead_pu=dead_pu))
    i = 3 * T.T @ [2.0, 1.5, 0.6, 0.5]
    rng = np.random.default_rng(5)
    expected = None
    for _ in range(400):
        control.step(i, rng.uniform(-2, 2))
        if expected is not None:
            assert control.estimate() == pytest.approx(expected, abs=1e-6)
        expected = control.decided()


@pytest.mark.parametrize("length", (1.0, 0.8, 0.5, 0.3))
def test_a_short_flux_is_turned_as_fast_as_the_rotor(length):
    """Without current and resistance the flux is the rotor's. The observer's speed is too low by
    the square of its length over the reference's; the voltage must turn it with the rotor."""
    omega, flux_Wb = 300.0, 0.4
    cfg = config(rs_ohm=0.0, dead_pu=0.0)
    cfg.deadbeat_law.gain = 0.1
    control = Control(cfg)
    control.state.observer.psi_Wb = [length * flux_Wb, 0.0]
    control.state.observer.omega_sync_rad_s = omega * length**2
    control.step(flux=flux_Wb)
    alpha, beta, _, _ = T @ control.shares()
    turned = np.angle(control.decided() + TS * VDC * complex(alpha, beta))
    assert 0.8 * omega * TS < turned < 1.15 * omega * TS


def test_dead_time_and_prediction_leave_the_flux_at_its_reference():
    """No resistance, no current but what decides on the dead time: after the flux has come up, it
    stays where it is asked for to within a count of every leg."""
    control = Control(config(rs_ohm=0.0, dead_pu=0.023))
    i = 3 * T.T @ [2.0, 1.5, 0.0, 0.0]
    found = []
    for n in range(600):
        control.step(i)
        if n > 400:
            found.append(abs(control.decided()))
    assert np.abs(np.array(found) - 0.4).max() < 4 * VDC * TS / PERIOD + 1e-4


wild = st.one_of(
    st.floats(-20, 20, width=32), st.sampled_from([np.nan, np.inf, -np.inf, 3.4e38, 0.0])
)
sample = st.tuples(st.lists(wild, min_size=6, max_size=6), wild, wild, wild, st.booleans())


@given(
    st.lists(sample, min_size=1, max_size=6),
    st.lists(st.sampled_from([lib.HT_DB_DTFC, lib.HT_DDR, lib.HT_DTC2]), min_size=1, max_size=6),
    st.sampled_from([8, 9, 10, 10000, 65535]),
)
@settings(max_examples=examples(250), deadline=None)
def test_any_input_gives_a_pattern_that_the_pwm_can_realise(samples, schemes, period):
    """No compare at count 0, none equal to the other of its leg, none beyond the period."""
    control = Control(config(period=period))
    for n, (i, torque, flux, vdc, build) in enumerate(samples):
        control.change(config(schemes[n % len(schemes)], period=period))
        inputs = ffi.new("ht_control_input *")
        inputs.i_A.p = i
        inputs.torque_ref_Nm, inputs.flux_ref_Wb, inputs.vdc_V = torque, flux, vdc
        inputs.inv_flux_ref2 = flux
        lib.ht_control_step(control.cfg, control.state, inputs, build, control.out)
        assert control.out.start <= 63
        for a, b in zip(control.out.ca, control.out.cb):
            assert 0 < a <= period and 0 < b <= period
            assert a == period or b == period or a < b


def test_the_law_begins_with_its_state_reset():
    control = Control(config())
    for n in range(50):
        control.step((0.05, -0.02, 0.01, 0.03, -0.04, 0.06), torque=(-1) ** n)
    assert any(bytes(ffi.buffer(ffi.addressof(control.state.deadbeat_law))))
    before = bytes(ffi.buffer(control.state))
    control.change(config(rs_ohm=5.0))
    assert bytes(ffi.buffer(control.state)) == before  # the same law
    own = control.state.next.own
    control.change(config(lib.HT_DDR))
    assert not any(bytes(ffi.buffer(ffi.addressof(control.state.deadbeat_law))))
    assert not control.state.modulator.falling
    assert control.state.next.own == own != 0  # what is in the registers stays


@pytest.mark.parametrize("l_share", [0.85, 1.0, 1.5])
def test_the_aligning_current_comes_to_its_limit_and_not_beyond(l_share):
    """A machine at standstill by its voltage equation; what the registers make of the legs drives
    its currents. A period of the longest vector would move its current by more than half of the
    limit. The firmware knows the inductance 15 % too large, right, or a third too small, and R 20 %
    too small: what is missing in R is shared between R and what the control adds to it."""
    ld_H, r_ohm, limit_A = 1.7e-3, 1.0, 14.0
    cfg = config(period=PERIOD, build_current_A=limit_A, rs_ohm=0.8 * r_ohm)
    cfg.dead.dead_pu = 0.0
    cfg.observer.rotor = lib.HT_ROTOR_MAGNET
    cfg.observer.magnet.ld_H, cfg.observer.lxy_H = ld_H / l_share, 0.8 * ld_H
    assert TS * VDC * np.hypot(*T[:2] @ [1, 1, 0, 0, 0, 1]) / ld_H > 0.5 * limit_A
    control = Control(cfg)
    ab, xy, most_A = 0j, 1 + 2j, 0.0
    shown = ffi.new("ht_control_input *")
    applied = np.full(6, 0.5)
    for direction in (3, 0):
        along = np.exp(1j * np.deg2rad(15 + 30 * direction))
        for _ in range(100):
            shown.i_A.p = list(3 * T.T @ [ab.real, ab.imag, xy.real, xy.imag])
            shown.vdc_V = VDC
            lib.ht_control_align(cfg, control.state, shown, direction, control.out)
            v = VDC * T @ applied  # decided a period ago: shadow load
            ab += TS * (complex(*v[:2]) - r_ohm * ab) / ld_H
            xy += TS * (complex(*v[2:]) - r_ohm * xy) / (0.8 * ld_H)
            applied = control.shares()
            most_A = max(most_A, abs(ab))
        added_ohm = 0.25 * ld_H / l_share / TS
        assert abs(ab) == pytest.approx(limit_A * (1 - 0.2 / (1 + added_ohm)), rel=5e-3)
        assert abs(np.angle(ab / along)) < 0.01
        assert abs(xy) < 0.02 * limit_A
    assert most_A < 1.02 * limit_A
