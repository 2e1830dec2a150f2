"""ht_observer: the voltage model is compared with a double-precision integral, the prediction and
the hybrid model with an exact simulation of a six-phase induction machine (paper B's data). The
predictor has no rotor parameter.
"""

from functools import lru_cache

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from unwritten import unwritten

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


def ab(z=0j):
    return {"alpha": z.real, "beta": z.imag}


def xy(z):
    return {"x": z.real, "y": z.imag}


def cplx(pair, names="alpha beta"):
    a, b = names.split()
    return complex(getattr(pair, a), getattr(pair, b))


def start(i=0j):
    state = unwritten("ht_observer_state *")
    lib.ht_observer_reset(config(), state, ab(i))
    return state


def f32(z):
    return complex(np.complex64(z))


value = st.floats(-300, 300, width=32)
phasor = st.tuples(value, value).map(lambda p: complex(*p))


def test_reset_is_demagnetised():
    state = start(3 - 4j)
    assert (cplx(state.psi_Wb), state.omega_sync_rad_s) == (0, 0)
    assert cplx(state.i_A) == 3 - 4j


@given(st.lists(st.tuples(phasor, phasor), min_size=1, max_size=40), st.integers(1, 8))
@settings(max_examples=80, deadline=None)
def test_update_is_the_integral_of_the_voltage_model(samples, pole_pairs):
    cfg = config(torque_gain=3.0 * pole_pairs)
    i_last, psi = 0j, 0j
    state = start(i_last)
    for v, i10 in samples:
        i = f32(i10 / 10)
        now = lib.ht_observer_update(cfg, state, ab(v), ab(i), 0, 1 / PSI**2)
        psi += TS * (v - RS * (i_last + i) / 2)
        i_last = i
        assert cplx(now.psi_Wb) == pytest.approx(psi, abs=2e-6)
        assert cplx(state.psi_Wb) == cplx(now.psi_Wb)
        torque = 3 * pole_pairs * (psi.conjugate() * i).imag
        assert now.torque_Nm == pytest.approx(torque, rel=1e-4, abs=2e-3)
        assert cplx(state.i_A) == i


@pytest.mark.parametrize("omega", (250.0, -250.0, 12.0, 600.0))
def test_omega_sync_finds_the_speed_of_a_rotating_flux(omega):
    cfg, state = config(rs_ohm=0.0), start()
    psi = [PSI * np.exp(1j * omega * TS * n) for n in range(600)]
    last = 0j
    for p in psi:
        lib.ht_observer_update(cfg, state, ab((p - last) / TS), ab(), 0, 1 / PSI**2)
        last = p
    assert state.omega_sync_rad_s == pytest.approx(omega, rel=2e-3)


def test_omega_sync_is_a_first_order_low_pass():
    cfg, state = config(rs_ohm=0.0, omega_gain=0.1), start()
    p = PSI + 0j
    lib.ht_observer_update(cfg, state, ab(p / TS), ab(), 0, 1 / PSI**2)
    assert state.omega_sync_rad_s == 0
    for n in range(1, 30):
        new = p * np.exp(1j * OMEGA * TS)
        lib.ht_observer_update(cfg, state, ab((new - p) / TS), ab(), 0, 1 / PSI**2)
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
    """The exact discrete machine at constant speed: transition of the fluxes, and effect of 1 V."""
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
            got = lib.ht_observer_predict(cfg, state, now[0], ab(v), ab(i))
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
    """For each period (true flux, estimated flux, true rotor flux, estimated rotor flux), from a
    steady state. The voltage is measured with an offset."""
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
        lib.ht_observer_update(cfg, state, ab(v + offset_V), ab(i), omega * TS, 1 / PSI**2)
        rows.append((flux[0], cplx(state.psi_Wb), flux[1], cplx(state.psi_r_Wb)))
    return np.array(rows).T


@pytest.mark.parametrize("omega", (-OMEGA, 0.0, 20.0, OMEGA))
def test_hybrid_follows_the_machine(omega):
    psi, got, psi_r, got_r = follow(CROSSOVER, omega, 6000)
    assert np.abs(got_r - psi_r).max() < 0.001 * PSI
    assert np.abs(got - psi).max() < 0.001 * PSI


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
        lib.ht_observer_update(cfg, state, ab(v), ab(i[n]), 20.0 * TS, 1 / PSI**2)
    assert cplx(state.psi_Wb) == pytest.approx(psi[-1], abs=0.01 * PSI)


@given(phasor, phasor)
@settings(max_examples=60, deadline=None)
def test_predicted_xy_flux_is_that_of_the_exact_equation(v, i100):
    i = f32(i100 / 100)
    got = lib.ht_observer_predict_xy(config(), start(), xy(v), xy(i))
    decay = np.exp(-RS / LXY * TS)
    exact = LXY * (i * decay + v / RS * (1 - decay))
    change = abs(exact - LXY * i)
    assert cplx(got, "x y") == pytest.approx(exact, abs=0.03 * change + 1e-6)


def test_prediction_does_not_change_the_state():
    state, now = start(1 + 2j), ffi.new("ht_estimate *")
    before = bytes(ffi.buffer(state))
    lib.ht_observer_predict(config(), state, now[0], ab(100 + 50j), ab(1 + 2j))
    lib.ht_observer_predict_xy(config(), state, xy(100 + 50j), xy(1 + 2j))
    assert bytes(ffi.buffer(state)) == before


@pytest.mark.parametrize("turn_rad", [0.02, 0.1, 0.3, 0.45])
@pytest.mark.parametrize("sign", [1, -1])
def test_current_model_is_stable_at_large_steps(turn_rad, sign):
    """Without current the rotor flux may only decay, however far the rotor turns in a period. Its
    natural decay is almost zero here."""
    cfg = ffi.new("ht_observer_config *")
    cfg.ts_s, cfg.inv_ts, cfg.hybrid_gain = 2e-4, 5e3, 1e-3
    cfg.rotor_decay, cfg.rotor_drive, cfg.lm_over_lr = 1e-9, 1e-9, 0.95
    cfg.kind = lib.HT_OBSERVER_HYBRID
    state = start()
    state.psi_r_Wb.alpha = 0.5
    nothing = ab()
    for _ in range(20_000):
        lib.ht_observer_update(cfg, state, nothing, nothing, sign * turn_rad, 4.0)
    assert np.hypot(state.psi_r_Wb.alpha, state.psi_r_Wb.beta) < 0.51


# --- compensated voltage model: the controller hides what the observer gets wrong -----

DC_RATIO = 0.1  # dc filter's corner and correction gain, relative to the flux's speed
COMPENSATED, HYBRID = lib.HT_OBSERVER_COMPENSATED, lib.HT_OBSERVER_HYBRID


def controlled(kind, omega, torque, offset_V, seconds):
    """For each period (flux speed, currents, true minus estimated flux) of a machine at constant
    speed. Its controller turns the estimate on its circle, as DTC does. The only error of the
    voltage is a dc error."""
    flux, slip = operating_point(torque, 0.0)
    speed = omega + slip
    cfg, state = config(kind=kind), start(stator_current(flux))
    state.psi_Wb = [flux[0].real, flux[0].imag]
    state.omega_sync_rad_s = speed
    v_out, i_out = ffi.new("ht_ab *"), ffi.new("ht_ab *")
    (((a, b), (c, d)), (e, f)) = (x.tolist() for x in transition(omega))
    (g, h), (s, r) = FROM_FLUX[0].tolist(), flux.tolist()
    got, i = cplx(state.psi_Wb), g * s + h * r
    rows = []
    for target in PSI * np.exp(1j * speed * TS * np.arange(1, round(seconds / TS))):
        v = complex((target - got) / TS + RS * i)
        u = v - offset_V
        s, r = a * s + b * r + e * u, c * s + d * r + f * u
        i = g * s + h * r
        v_out.alpha, v_out.beta = v.real, v.imag
        i_out.alpha, i_out.beta = i.real, i.imag
        now = lib.ht_observer_update(cfg, state, v_out[0], i_out[0], 0, 1 / PSI**2)
        got = complex(now.psi_Wb.alpha, now.psi_Wb.beta)
        rows.append((i, s - got))
    i, error = np.array(rows).T
    return speed, i, error


def parts(signal, speed):
    """The dc part, and the part that turns with the flux, over the last third."""
    late = np.arange(len(signal))[-len(signal) // 3 :]
    basis = np.stack([np.ones(len(late)), np.exp(1j * speed * TS * late)], axis=1)
    return np.linalg.lstsq(basis, signal[late], rcond=None)[0]


@pytest.mark.parametrize(
    ("omega", "torque"), [(OMEGA, 1.5), (-OMEGA, 1.5), (OMEGA, -1.5), (100.0, 0.0), (-100.0, 2.0)]
)
def test_compensated_bounds_the_true_flux_offset(omega, torque):
    """The estimate is free of dc, so the correction must cancel the error of the voltage: offset +
    g sigma L_s i_dc = 0 with g = 0.1 |speed|. The machine's flux offset e drives i_dc = e/L(0).
    L(0) = L_s (1 - j w sigma T_r)/(1 - j w T_r) is its operational inductance for a field that
    stands still, and w is the rotor's speed."""
    offset = 0.5 - 0.3j
    seconds = 2.0 if abs(omega) == OMEGA else 6.0  # it settles slowly at low speed
    speed, i, error = controlled(COMPENSATED, omega, torque, offset, seconds)
    i_dc = -offset / (DC_RATIO * abs(speed) * SIGMA_LS)
    tr = LR / RR
    standing = LS * (1 - 1j * omega * SIGMA_LS / LS * tr) / (1 - 1j * omega * tr)
    assert parts(i, speed)[0] == pytest.approx(i_dc, rel=0.03)
    assert parts(error, speed)[0] == pytest.approx(standing * i_dc, rel=0.03)
    assert abs(standing * i_dc) < 0.3 * PSI  # smaller than the machine's flux, a real bound


@pytest.mark.parametrize("omega", (OMEGA, -OMEGA))
def test_offset_of_the_pure_voltage_model_grows_without_end(omega):
    offset = 0.5 - 0.3j
    _, _, error = controlled(lib.HT_OBSERVER_VOLTAGE, omega, 1.5, offset, 1.0)
    t = TS * np.arange(1, len(error) + 1)
    assert np.abs(error + offset * t).max() < 0.01 * abs(offset)


@pytest.mark.parametrize("omega", (OMEGA, -OMEGA, 60.0))
def test_compensation_hardly_disturbs_the_fundamental(omega):
    """The filter passes 0.1/(0.1 + j) of the fundamental. The correction integrates this at 0.1
    w."""
    speed, i, error = controlled(COMPENSATED, omega, 2.0, 0j, 1.0 if abs(omega) == OMEGA else 8.0)
    turning = parts(error, speed)[1]
    unit = SIGMA_LS * parts(i, speed)[1]
    sign = 1j * np.sign(speed)
    assert abs(turning) < 1.03 * DC_RATIO**2 * abs(unit)
    assert turning == pytest.approx(
        -(DC_RATIO**2) / (sign * (DC_RATIO + sign)) * unit, abs=5e-4 * abs(unit)
    )


def test_compensated_does_not_change_the_flux_at_standstill():
    """At standstill the compensation does nothing: a dc flux is then correct."""
    flux, _ = operating_point(0.0, 0.3)
    i = stator_current(flux)
    cfg, state = config(kind=COMPENSATED, omega_gain=0.0), start(i)
    state.psi_Wb = [flux[0].real, flux[0].imag]
    for _ in range(2000):
        lib.ht_observer_update(cfg, state, ab(RS * i), ab(i), 0, 1 / PSI**2)
    assert cplx(state.psi_Wb) == pytest.approx(flux[0], abs=2e-4)
    assert cplx(state.i_dc_A) == 0


@pytest.mark.parametrize("speed", (0.0, OMEGA, -OMEGA, 1e7, np.nan))
@pytest.mark.parametrize("bad", (np.nan, np.inf, -np.inf))
@pytest.mark.parametrize("kind", range(3))
def test_a_current_of_nan_stays_visible(kind, bad, speed):
    cfg, state = config(kind=kind, hybrid_gain=CROSSOVER * TS), start()
    state.omega_sync_rad_s = speed
    lib.ht_observer_update(cfg, state, ab(100), ab(complex(bad, 1)), 0, 1 / PSI**2)
    assert not np.isfinite(state.psi_Wb.alpha)
    for _ in range(50):  # nor does the estimate come back by itself
        lib.ht_observer_update(cfg, state, ab(100), ab(1), 0, 1 / PSI**2)
        assert not np.isfinite(state.psi_Wb.alpha)


@pytest.mark.parametrize("speed", (np.nan, np.inf, -np.inf))
def test_a_speed_of_nan_stays_visible(speed):
    """With NaN the compensation has its full gain. The estimate soon exceeds every bound, so that
    the flux checks find it."""
    cfg, state = config(kind=COMPENSATED), start(2 + 0j)
    state.psi_Wb, state.omega_sync_rad_s = [PSI, 0.0], speed
    for _ in range(1000):
        lib.ht_observer_update(cfg, state, ab(RS * 2), ab(2), 0, 1 / PSI**2)
    assert not abs(cplx(state.psi_Wb)) < 10 * PSI


def test_dc_filter_cannot_overshoot():
    """At a speed above 1/(0.1 Ts) the filter's gain must not exceed one."""
    cfg, state = config(kind=COMPENSATED, omega_gain=0.0), start()
    state.omega_sync_rad_s = 1e7
    lib.ht_observer_update(cfg, state, ab(), ab(3 - 2j), 0, 1 / PSI**2)
    assert cplx(state.i_dc_A) == 3 - 2j


# --- adaptation of the resistances ----------------------------------------------------


SETTLED_S = 0.8  # ten times 1/crossover


def adapted(speed, torque, rs=1.0, rr=1.0, seconds=SETTLED_S, gain=None):
    """The state of the hybrid observer after it has followed the exact machine in steady state,
    with a flux that turns at `speed`. The resistances start at `rs` and `rr` times the machine's.
    When the observer has settled, they are adapted every 100th period. Also returns the machine's
    flux and current."""
    flux, slip = operating_point(torque, 0.0)
    i = stator_current(flux)
    periods = round(seconds / TS)
    turn = np.exp(1j * speed * TS * np.arange(periods + 1))
    mean = np.diff(turn) / (1j * speed * TS) if speed else turn[1:]
    v_V = np.diff(turn) * flux[0] / TS + RS * i * mean  # exact mean voltage of a period
    cfg, state = config(kind=HYBRID, hybrid_gain=CROSSOVER * TS), start(i)
    state.psi_Wb = [flux[0].real, flux[0].imag]
    state.psi_r_Wb = [flux[1].real, flux[1].imag]
    state.omega_sync_rad_s = speed
    state.rs_ohm, state.rr_scale = rs * RS, rr
    v_ab, i_ab = ffi.new("ht_ab *"), ffi.new("ht_ab *")
    omega_r = speed - slip
    for n, (v, z) in enumerate(zip(v_V.tolist(), (i * turn[1:]).tolist(), strict=True), 1):
        v_ab.alpha, v_ab.beta = v.real, v.imag
        i_ab.alpha, i_ab.beta = z.real, z.imag
        lib.ht_observer_update(cfg, state, v_ab[0], i_ab[0], omega_r * TS, 1 / PSI**2)
        if gain is not None and n % 100 == 0 and n * TS > SETTLED_S:
            lib.ht_observer_adapt(cfg, state, gain)
    return cfg, state, flux * turn[-1], i * turn[-1]


def trace(speed, flux, i):
    """h: the difference of the models per relative error of R_r, at flux speed `speed`."""
    x = (i / flux[1]).imag / (i / flux[1]).real
    return speed * LM / LR * flux[1] * x / (1 + 1j * x)


@pytest.mark.parametrize("torque", (-2.0, 0.7, 2.0))
@pytest.mark.parametrize("speed", (-90.0, -30.0, 0.0, 8.0, 60.0))
def test_models_differ_as_documented(speed, torque):
    """(g0 + j w) D = r i - q h. Half the difference of two opposite errors cancels the effects that
    both have: second order and discretisation."""

    def gap(**wrong):
        _, state, flux, i = adapted(speed, torque, **wrong)
        return cplx(state.gap_Wb), flux, i

    for r, q in ((0.05, 0.0), (0.0, 0.05), (0.05, 0.05), (0.05, -0.05)):
        more, flux, i = gap(rs=1 - r, rr=1 - q)  # r, q: the errors of the observer's resistances
        less, *_ = gap(rs=1 + r, rr=1 + q)
        from_rs, from_rr = r * RS * i, -q * trace(speed, flux, i)
        got = (CROSSOVER + 1j * speed) * (more - less) / 2
        allowed = 0.02 * (abs(from_rs) + abs(from_rr)) + 2e-3
        assert got == pytest.approx(from_rs + from_rr, abs=allowed)


CASES = [(40.0, 2.0), (40.0, -2.0), (-40.0, 2.0), (-40.0, -2.0), (15.0, 1.5), (-70.0, -1.0)]


@pytest.mark.parametrize(("speed", "torque"), CASES)
@pytest.mark.parametrize(("rs", "rr"), [(0.75, 1.0), (1.0, 1.35), (0.8, 0.75), (1.3, 0.8)])
def test_resistances_converge_to_the_machine(speed, torque, rs, rr):
    _, state, *_ = adapted(speed, torque, rs, rr, seconds=4.0, gain=0.2)
    assert state.rs_ohm == pytest.approx(RS, rel=0.005)
    assert state.rr_scale == pytest.approx(1.0, abs=0.005)


#: Share of an error that one slow interrupt removes at `adapt_s` = 1 and 100 Hz.
GAIN = 1 / 101


@pytest.mark.parametrize(
    ("speed", "torque", "rs"),
    [(40.0, 0.0, 1.0), (-60.0, 0.0, 1.0), (40.0, 0.0, 0.97), (-60.0, 0.0, 0.97),
     (0.0, 1.5, 1.0), (0.0, -1.5, 1.0)],
)  # fmt: skip
def test_rotor_resistance_stays_if_nothing_depends_on_it(speed, torque, rs):
    """Without load, or with a flux that does not turn, R_s converges and R_r stays as it is."""
    _, state, *_ = adapted(speed, torque, rs, 1.3, seconds=4.0, gain=0.05)
    assert state.rs_ohm == pytest.approx(RS, rel=0.005)
    assert state.rr_scale == pytest.approx(1.3, abs=0.005)


@pytest.mark.parametrize("torque", (1.5, -1.5))
def test_a_converging_rs_hardly_moves_rr_where_the_flux_stands_still(torque):
    """While R_s converges, the flux that should stand still shifts. This looks like a speed, and so
    like an error of R_r. The change of R_r must be a small part of R_s's error; the slower the
    adaptation, the smaller it is."""
    moved = []
    for gain, seconds in ((5 * GAIN, 4.0), (GAIN, 12.0)):
        _, state, *_ = adapted(0.0, torque, 0.97, 1.3, seconds=seconds, gain=gain)
        assert state.rs_ohm == pytest.approx(RS, rel=0.005)
        moved.append(abs(state.rr_scale - 1.3))
    assert moved[1] < 0.03 / 4
    assert moved[1] < moved[0] / 3


def test_one_step_takes_the_share_of_the_error():
    """At low speed one step with gain 0.1 removes 0.1 of R_s's error. Where R_r has a strong trace,
    it removes about as much of R_r's error."""
    for rs in (0.95, 1.05):
        cfg, state, *_ = adapted(5.0, 2.0, rs=rs)
        lib.ht_observer_adapt(cfg, state, 0.1)
        assert state.rs_ohm - rs * RS == pytest.approx(0.1 * (1 - rs) * RS, rel=0.1)
    for rr in (0.95, 1.05):
        cfg, state, *_ = adapted(40.0, 2.0, rr=rr)
        lib.ht_observer_adapt(cfg, state, 0.1)
        assert 0.3 < (state.rr_scale - rr) / (0.1 * (1 - rr)) < 1.2


@pytest.mark.parametrize("sign", (1, -1))
def test_adaptation_fades_out_at_high_speed(sign):
    def step(speed):
        cfg, state, *_ = adapted(sign * speed, 2.0, 0.8, 1.2)
        lib.ht_observer_adapt(cfg, state, 0.1)
        return (state.rs_ohm - 0.8 * RS) / (0.2 * RS), (1.2 - state.rr_scale) / 0.2

    slow, fast = np.array([step(40.0), step(400.0)])
    assert np.all(slow > 0.01)
    assert np.all(np.abs(fast) < 0.1 * slow)


def any_state(draw_from):
    """A state with these values, the last first: psi_r, gap, i, speed, R_s, R_r."""
    state = start()
    for pair in (state.psi_r_Wb, state.gap_Wb, state.i_A):
        pair.alpha, pair.beta = draw_from.pop(), draw_from.pop()
    state.omega_sync_rad_s = draw_from.pop()
    state.rs_ohm, state.rr_scale = draw_from.pop(), draw_from.pop()
    return state


anything = st.floats(width=32) | st.floats(-1e3, 1e3, width=32)


@given(st.lists(anything, min_size=7, max_size=7), anything, anything, st.floats(0, 1, width=32))
@settings(max_examples=examples(200), deadline=None)
def test_resistances_in_use_stay_between_bounds(values, rs, rr, gain):
    """The resistances stay within 0.25 to 2.4 (stator) and 0.5 to 1.6 (rotor) of the configured
    ones, for any input, NaN included.
    Without a usable observation they do not change, so they start inside the bounds."""
    cfg = config(kind=HYBRID, hybrid_gain=CROSSOVER * TS)
    state = any_state([1.3, RS * 0.7, *values])
    lib.ht_observer_adapt(cfg, state, gain)
    for _ in range(2):
        assert 0.2499 * RS <= state.rs_ohm <= 2.4001 * RS
        assert 0.4999 <= state.rr_scale <= 1.6001
        # The trace is normal, but the resistances in use are outside the bounds. They return at
        # once.
        state = any_state([rr, rs, 40.0, 1.0, 1.0, 0.0, 0.01, 0.0, 0.3])
        lib.ht_observer_adapt(cfg, state, max(gain, 1e-3))


@pytest.mark.parametrize("sign", (1, -1))
def test_both_bounds_are_reached(sign):
    cfg = config(kind=HYBRID, hybrid_gain=CROSSOVER * TS)
    for name, configured, low, high in (("rs_ohm", RS, 0.25, 2.4), ("rr_scale", 1.0, 0.5, 1.6)):
        state = start()
        state.psi_r_Wb, state.omega_sync_rad_s = [0.4, 0.0], 40.0
        state.i_A = [1.5, 1.5]
        along = 1.5 + 1.5j if name == "rs_ohm" else -trace(40.0, [0, 0.4], 1.5 + 1.5j)
        gap = sign * 100 * along / (CROSSOVER + 40j)
        state.gap_Wb = [gap.real, gap.imag]
        lib.ht_observer_adapt(cfg, state, 1.0)
        assert getattr(state, name) == pytest.approx(
            (high if sign > 0 else low) * configured, rel=1e-5
        )


@pytest.mark.parametrize("gain", (0.0, -1.0, np.nan))
def test_no_gain_returns_to_the_configured_resistances(gain):
    cfg, state, *_ = adapted(40.0, 2.0, 0.8, 1.3, seconds=0.1)
    lib.ht_observer_adapt(cfg, state, gain)
    assert (state.rs_ohm, state.rr_scale) == (RS, 1.0)


@pytest.mark.parametrize(("i", "psi_r"), [(0j, 0.4 + 0j), (1.5 + 1j, 0j), (0j, 0j)])
def test_no_adaptation_without_current_or_rotor_flux(i, psi_r):
    cfg, state = config(kind=HYBRID, hybrid_gain=CROSSOVER * TS), start(i)
    state.psi_r_Wb, state.gap_Wb = [psi_r.real, psi_r.imag], [0.1, -0.2]
    state.omega_sync_rad_s, state.rs_ohm, state.rr_scale = 40.0, 5.0, 1.25
    lib.ht_observer_adapt(cfg, state, 0.5)
    assert (state.rs_ohm, state.rr_scale) == (5.0, 1.25)


def test_adaptation_changes_only_the_resistances():
    cfg, state, *_ = adapted(40.0, 2.0, 0.8, 1.3, seconds=0.1)
    before = ffi.new("ht_observer_state *", state[0])
    lib.ht_observer_adapt(cfg, state, 0.1)
    assert state.rs_ohm != before.rs_ohm
    assert state.rr_scale != before.rr_scale
    before.rs_ohm, before.rr_scale = state.rs_ohm, state.rr_scale
    assert bytes(ffi.buffer(before)) == bytes(ffi.buffer(state))


def test_reset_returns_to_the_configured_resistances():
    state = start()
    state.rs_ohm, state.rr_scale = 1.0, 0.7
    lib.ht_observer_reset(config(), state, ab())
    assert (state.rs_ohm, state.rr_scale) == (RS, 1.0)


@pytest.mark.parametrize("kind", range(3))
def test_the_voltage_model_uses_the_adapted_stator_resistance(kind):
    """Half of the configured value is used in the update and in both planes of the prediction."""
    v, i_last, i = 20 - 5j, 1 + 2j, 2 - 1j
    cfg, state = config(kind=kind), start(i_last)
    state.rs_ohm = RS / 2
    lib.ht_observer_update(cfg, state, ab(v), ab(i), 0, 1 / PSI**2)
    assert cplx(state.psi_Wb) == pytest.approx(TS * (v - RS / 2 * (i_last + i) / 2), rel=1e-5)
    now = ffi.new("ht_estimate *")
    after = lib.ht_observer_predict(cfg, state, now[0], ab(v), ab(i))
    assert cplx(after.psi_Wb) == pytest.approx(TS * (v - RS / 2 * i), rel=1e-5)
    after_xy = lib.ht_observer_predict_xy(cfg, state, xy(3 + 1j), xy(2 + 4j))
    want = LXY * (2 + 4j) + TS * (3 + 1j - RS / 2 * (2 + 4j))
    assert cplx(after_xy, "x y") == pytest.approx(want, rel=1e-5)


@pytest.mark.parametrize("scale", (0.6, 1.0, 1.5))
def test_the_current_model_uses_the_adapted_rotor_resistance(scale):
    """At standstill with constant current, psi_r approaches L_m i with the time constant L_r/(scale
    R_r)."""
    i, periods = 1.5 - 0.5j, 2000
    cfg, state = config(kind=HYBRID), start(i)
    state.psi_r_Wb, state.rr_scale = [0.0, 0.3], scale
    for _ in range(periods):
        lib.ht_observer_update(cfg, state, ab(), ab(i), 0, 1 / PSI**2)
    left = np.exp(-periods * TS * scale * RR / LR)
    assert cplx(state.psi_r_Wb) == pytest.approx(LM * i + (0.3j - LM * i) * left, rel=1e-3)


@settings(max_examples=examples(40), deadline=None)
@given(
    st.floats(0.1, 0.6), st.floats(-np.pi, np.pi), phasor, st.floats(-1500, 1500),
    st.floats(0, 1500), st.floats(0.7, 1.4), st.integers(1, 20_000),
    st.randoms(use_true_random=False),
)  # fmt: skip
def test_a_flux_that_coasts_follows_the_current_model(
    size, angle, current, omega, swing, scale, periods, draw
):
    """Against the rotor's equation d psi_r/dt = (j w - R_r/L_r) psi_r, whose integral in double
    precision is known for any course of the speed. The current ends at once."""
    state = start()
    i = current * 0.02
    psi = size * np.exp(1j * angle)
    state.psi_Wb, state.i_A, state.rr_scale = ab(psi), ab(i), scale
    phase = draw.uniform(0, 6)
    turns = np.cumsum(TS * (omega + swing * np.sin(phase + 1e-3 * np.arange(periods))))
    counts = np.rint(turns / 2e-3)  # of an encoder
    cfg = config()
    for moved in np.diff(counts, prepend=0.0):
        lib.ht_observer_coast(cfg, state, 2e-3 * moved)
    left = (psi - SIGMA_LS * i) * np.exp(1j * turns[-1] - scale * RR / LR * TS * periods)
    assert abs(cplx(state.psi_Wb) - left) < 4e-3 * abs(psi - SIGMA_LS * i) + 1e-6
    assert cplx(state.psi_r_Wb) == pytest.approx(cplx(state.psi_Wb) * LR / LM, rel=1e-5)
    assert cplx(state.i_A) == 0


@pytest.mark.parametrize("kind", (0, 1, 2))
def test_a_pull_by_all_of_it_is_the_current_model(kind):
    """Every observer: the flux of currents that turn with the rotor, as it is in steady state."""
    cfg = config(kind=kind, hybrid_gain=0.01 if kind == 2 else 0.0)
    state = start()
    turn, i = 0.03, 2.0 + 0j
    for _ in range(10_000):
        i *= np.exp(1j * turn)
        lib.ht_observer_follow(cfg, state, ab(i), turn)
        lib.ht_observer_update(cfg, state, ab(0j), ab(i), turn, 0.0)
        now = lib.ht_observer_pull(cfg, state, 1.0, turn / TS)
    assert abs(cplx(now.psi_Wb) - LS * i) < 2e-3 * LS * abs(i)
    assert abs(now.torque_Nm) < 1e-2
    assert state.omega_sync_rad_s == pytest.approx(turn / TS)


def test_a_resistance_is_adapted_where_it_has_not_come_to_a_limit():
    """There it may be anything beyond: a third and three times are surely no copper's."""
    cfg, state = config(), start()
    for share in (0.9, 1.0, 1.1):
        lib.ht_observer_begin_with(cfg, state, share * RS)
        assert lib.ht_observer_adapted_ohm(cfg, state) == np.float32(share * RS)
    for share in (0.01, 100.0):
        lib.ht_observer_begin_with(cfg, state, share * RS)
        assert lib.ht_observer_adapted_ohm(cfg, state) == 0.0
