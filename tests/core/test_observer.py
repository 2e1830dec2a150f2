"""ht_observer: the voltage model against a double-precision integral, the
prediction and the hybrid model against an exact simulation of a six-phase
induction machine (paper B's data). The predictor has no rotor parameter.
"""

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from hexatorque.firmware import ffi, lib

TS, RS, RR, LLS, LLR, LM = 100e-6, 6.0, 2.2, 14.4e-3, 14.4e-3, 256e-3
LS, LR = LLS + LM, LLR + LM
SIGMA_LS = LS - LM**2 / LR
LXY = LLS
PSI, OMEGA, VDC = 0.4, 250.0, 300.0


def config(**changes):
    values = {
        "ts_s": TS, "inv_ts": 1 / TS, "rs_ohm": RS, "sigma_ls_H": SIGMA_LS,
        "inv_sigma_ls": 1 / SIGMA_LS, "lxy_H": LXY, "torque_gain": 3.0, "omega_gain": 0.02,
        "hybrid_gain": 0.0, "rotor_decay": TS * RR / LR, "rotor_drive": TS * RR * LM / LR,
        "lm_over_lr": LM / LR,
    }  # fmt: skip
    return ffi.new("ht_observer_config *", values | changes)


def vsd(ab=0j, xy=0j):
    return ffi.new("ht_vsd *", [[ab.real, ab.imag], [xy.real, xy.imag]])


def cplx(pair, names="alpha beta"):
    a, b = names.split()
    return complex(getattr(pair, a), getattr(pair, b))


def start(i=0j):
    state = ffi.new("ht_observer_state *")
    lib.ht_observer_reset(config(), state, vsd(i))
    return state


def f32(z):
    return complex(np.complex64(z))


value = st.floats(-300, 300, width=32)
phasor = st.tuples(value, value).map(lambda p: complex(*p))


def test_reset_is_demagnetised():
    state = start(3 - 4j)
    assert (cplx(state.psi_Wb), state.omega_sync_rad_s) == (0, 0)
    assert cplx(state.i_prev_A.ab) == 3 - 4j


@given(st.lists(st.tuples(phasor, phasor, phasor), min_size=1, max_size=40), st.integers(1, 8))
@settings(max_examples=80, deadline=None)
def test_update_is_the_integral_of_the_voltage_model(samples, pole_pairs):
    cfg = config(torque_gain=3.0 * pole_pairs)
    i_last, psi = 0j, 0j
    state = start(i_last)
    for v, i10, ixy in samples:
        i = f32(i10 / 10)
        now = lib.ht_observer_update(cfg, state, vsd(v), vsd(i, ixy), 0, 1 / PSI**2)
        psi += TS * (v - RS * (i_last + i) / 2)
        i_last = i
        assert cplx(now.psi_Wb) == pytest.approx(psi, abs=2e-6)
        assert cplx(state.psi_Wb) == cplx(now.psi_Wb)
        torque = 3 * pole_pairs * (psi.conjugate() * i).imag
        assert now.torque_Nm == pytest.approx(torque, rel=1e-4, abs=2e-3)
        assert cplx(now.psi_xy_Wb, "x y") == pytest.approx(LXY * ixy, rel=1e-6, abs=1e-9)
        assert cplx(state.i_prev_A.ab) == i


@pytest.mark.parametrize("omega", (250.0, -250.0, 12.0, 600.0))
def test_omega_sync_finds_the_speed_of_a_rotating_flux(omega):
    cfg, state = config(rs_ohm=0.0), start()
    psi = [PSI * np.exp(1j * omega * TS * n) for n in range(600)]
    last = 0j
    for p in psi:
        lib.ht_observer_update(cfg, state, vsd((p - last) / TS), vsd(), 0, 1 / PSI**2)
        last = p
    assert state.omega_sync_rad_s == pytest.approx(omega, rel=2e-3)


def test_omega_sync_is_a_first_order_low_pass():
    cfg, state = config(rs_ohm=0.0, omega_gain=0.1), start()
    p = PSI + 0j
    lib.ht_observer_update(cfg, state, vsd(p / TS), vsd(), 0, 1 / PSI**2)
    assert state.omega_sync_rad_s == 0
    for n in range(1, 30):
        new = p * np.exp(1j * OMEGA * TS)
        lib.ht_observer_update(cfg, state, vsd((new - p) / TS), vsd(), 0, 1 / PSI**2)
        p = new
        want = np.sin(OMEGA * TS) / TS * (1 - 0.9**n)
        assert state.omega_sync_rad_s == pytest.approx(want, rel=2e-4)


# --- prediction against the machine ---------------------------------------

FROM_FLUX = np.linalg.inv([[LS, LM], [LM, LR]])


def stator_current(flux):
    return FROM_FLUX[0] @ flux


def torque_Nm(flux):
    return 3.0 * (np.conj(flux[0]) * stator_current(flux)).imag


@lru_cache
def transition(omega):
    """Exact discrete machine at constant speed: fluxes, and effect of 1 V."""
    augmented = np.zeros((3, 3), complex)
    augmented[:2, :2] = -np.diag([RS, RR]) @ FROM_FLUX + np.diag([0, 1j * omega])
    augmented[0, 2] = 1.0
    exact = expm(augmented * TS)
    return exact[:2, :2], exact[:2, 2]


def machine_after(flux, v, omega):
    """Fluxes (stator, rotor) one period later under a constant voltage."""
    keep, drive = transition(omega)
    return keep @ flux + drive * v


def operating_point(torque, angle):
    """Fluxes and slip speed of a steady state at |psi_s| = PSI."""

    def at(slip):
        # 0 = -Rr i_r - j slip psi_r in the frame of the stator flux
        ratio = (-RR * FROM_FLUX[1, 0]) / (RR * FROM_FLUX[1, 1] + 1j * slip)
        return PSI * np.exp(1j * angle) * np.array([1, ratio])

    low, high = -20.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if torque_Nm(at(middle)) < torque else (low, middle)
    return at(low), low


@pytest.mark.parametrize("torque", (-2.0, 0.0, 2.0))
@pytest.mark.parametrize("omega", (-OMEGA, 10.0, OMEGA))
def test_prediction_against_the_exact_machine(omega, torque):
    cfg, state = config(), start()
    errors, changes = [], []
    for angle in np.deg2rad(np.arange(3, 360, 15)):
        flux, slip = operating_point(torque, angle)
        i = stator_current(flux)
        assert torque_Nm(flux) == pytest.approx(torque, abs=1e-6)
        state.omega_sync_rad_s = omega + slip
        now = ffi.new("ht_estimate *")
        now.psi_Wb = [flux[0].real, flux[0].imag]
        now.torque_Nm = torque_Nm(flux)
        for k in (None, *range(12)):
            v = 0j if k is None else VDC * 0.644 * np.exp(1j * np.deg2rad(15 + 30 * k))
            end = machine_after(flux, v, omega)
            got = lib.ht_observer_predict(cfg, state, now, vsd(v), vsd(i))
            assert cplx(got.psi_Wb) == pytest.approx(end[0], abs=5e-4)
            errors.append(got.torque_Nm - torque_Nm(end))
            changes.append(torque_Nm(end) - torque)
    largest = np.max(np.abs(changes))
    assert largest > 0.4
    assert np.max(np.abs(errors)) < 0.05 * largest
    assert np.sqrt(np.mean(np.square(errors))) < 0.03 * np.sqrt(np.mean(np.square(changes)))


# --- hybrid observer: the same machine, followed over many periods ---------

CROSSOVER = 2 * np.pi * 2.0  # rad/s


def follow(gain, omega, periods, offset_V=0j):
    """(true flux, estimated flux, true rotor flux, estimated) per period, from a
    steady state, under a voltage measured with an offset."""
    flux, slip = operating_point(1.5, 0.0)
    cfg = config(hybrid_gain=gain * TS, kind=lib.HT_OBSERVER_HYBRID if gain else 0)
    state = start(stator_current(flux))
    state.psi_Wb = [flux[0].real, flux[0].imag]
    state.psi_r_Wb = [flux[1].real, flux[1].imag]
    u = RS * stator_current(flux) + 1j * (omega + slip) * flux[0]
    rows = []
    for n in range(periods):
        v = u * np.exp(1j * (omega + slip) * TS * (n + 0.5))
        flux = machine_after(flux, v, omega)
        i = stator_current(flux)
        lib.ht_observer_update(cfg, state, vsd(v + offset_V), vsd(i), omega, 1 / PSI**2)
        rows.append((flux[0], cplx(state.psi_Wb), flux[1], cplx(state.psi_r_Wb)))
    return np.array(rows).T


@pytest.mark.parametrize("omega", (-OMEGA, 0.0, 20.0, OMEGA))
def test_hybrid_follows_the_machine(omega):
    psi, got, psi_r, got_r = follow(CROSSOVER, omega, 6000)
    assert np.abs(got_r - psi_r).max() < 0.02 * PSI
    assert np.abs(got - psi).max() < 0.005 * PSI


def test_hybrid_bounds_what_an_offset_does_to_the_voltage_model():
    offset = 0.5 - 0.3j
    psi, got, *_ = follow(0.0, OMEGA, 8000, offset)
    assert got[-1] - psi[-1] == pytest.approx(offset * 0.8, rel=0.02)  # grows for ever
    psi, got, *_ = follow(CROSSOVER, OMEGA, 8000, offset)
    settled = (got - psi)[-2000:].mean()
    assert settled == pytest.approx(offset / CROSSOVER, rel=0.05)


def test_hybrid_finds_an_unknown_initial_flux():
    cfg, state = config(hybrid_gain=CROSSOVER * TS, kind=lib.HT_OBSERVER_HYBRID), start()
    flux, slip = operating_point(1.5, 0.0)
    i = stator_current(flux) * np.exp(1j * (20.0 + slip) * TS * np.arange(12000))
    psi = flux[0] * np.exp(1j * (20.0 + slip) * TS * np.arange(12000))
    for n in range(1, len(i)):
        v = (psi[n] - psi[n - 1]) / TS + RS * (i[n] + i[n - 1]) / 2
        lib.ht_observer_update(cfg, state, vsd(v), vsd(i[n]), 20.0, 1 / PSI**2)
    assert cplx(state.psi_Wb) == pytest.approx(psi[-1], abs=0.01 * PSI)


@given(phasor, phasor)
@settings(max_examples=60, deadline=None)
def test_predicted_xy_flux(v, i100):
    i = f32(i100 / 100)
    now = ffi.new("ht_estimate *")
    now.psi_xy_Wb = [LXY * i.real, LXY * i.imag]
    got = lib.ht_observer_predict(config(), start(), now, vsd(xy=v), vsd(xy=i))
    decay = np.exp(-RS / LXY * TS)
    exact = LXY * (i * decay + v / RS * (1 - decay))
    change = abs(exact - LXY * i)
    assert cplx(got.psi_xy_Wb, "x y") == pytest.approx(exact, abs=0.03 * change + 1e-6)


def test_prediction_leaves_the_state_alone():
    state, now = start(1 + 2j), ffi.new("ht_estimate *")
    before = bytes(ffi.buffer(state)), bytes(ffi.buffer(now))
    lib.ht_observer_predict(config(), state, now, vsd(100, 50), vsd(1, 2))
    assert (bytes(ffi.buffer(state)), bytes(ffi.buffer(now))) == before


@pytest.mark.parametrize("turn_rad", [0.02, 0.1, 0.3, 0.45])
@pytest.mark.parametrize("sign", [1, -1])
def test_current_model_is_stable_at_large_steps(turn_rad, sign):
    """Without current the rotor flux may only decay, however far the rotor turns in a
    period; its own decay is set to almost nothing here."""
    cfg = ffi.new("ht_observer_config *")
    cfg.ts_s, cfg.inv_ts, cfg.hybrid_gain = 2e-4, 5e3, 1e-3
    cfg.rotor_decay, cfg.rotor_drive, cfg.lm_over_lr = 1e-9, 1e-9, 0.95
    cfg.kind = lib.HT_OBSERVER_HYBRID
    state = start()
    state.psi_r_Wb.alpha = 0.5
    nothing = ffi.new("ht_vsd *")
    for _ in range(20_000):
        lib.ht_observer_update(cfg, state, nothing, nothing, sign * turn_rad / cfg.ts_s, 4.0)
    assert np.hypot(state.psi_r_Wb.alpha, state.psi_r_Wb.beta) < 0.51
