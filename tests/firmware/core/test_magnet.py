"""What differs with magnets, against numpy: the direction of an angle, the least current and its
flux, torque limits by search, what the harmonics induce in x-y, and observer and prediction against
an exact machine.
"""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from hexatorque.firmware import ffi, lib

TS = 1e-4


class Machine(NamedTuple):
    r: float
    ld: float
    lq: float
    psi_f: float
    p: int


MACHINES = {
    "interior": Machine(0.8, 6.4e-3, 17.4e-3, 0.1746, 3),
    "surface": Machine(1.096, 2.142e-3, 2.142e-3, 0.0734, 5),
}
SMALL = Machine(0.0643, 0.125e-3, 0.126e-3, 4.7e-3, 5)


def pair(z):
    return [float(z.real), float(z.imag)]


def as_complex(p):
    return complex(p.alpha, p.beta)


@pytest.fixture(params=MACHINES)
def machine(request):
    return MACHINES[request.param]


def magnet(machine, e5=0j, e7=0j):
    _, ld, lq, psi_f, p = machine
    m = ffi.new("ht_magnet_config *")
    m.psi_f_Wb, m.inv_psi_f, m.ld_H, m.lq_H = psi_f, 1 / psi_f, ld, lq
    m.inv_ld, m.saliency_H, m.share, m.torque_gain = 1 / ld, ld - lq, (ld - lq) / ld, 3 * p
    m.emf5_Wb, m.emf7_Wb = pair(psi_f * e5), pair(psi_f * e7)
    return m


def observer(machine, pull_Hz=0.0):
    r, _, lq, _, p = machine
    c = ffi.new("ht_observer_config *")
    c.ts_s, c.inv_ts, c.rs_ohm, c.lxy_H = TS, 1 / TS, r, 1e-3
    c.sigma_ls_H, c.inv_sigma_ls, c.torque_gain = lq, 1 / lq, 3 * p
    c.hybrid_gain = 2 * np.pi * pull_Hz * TS
    c.omega_gain = 0.02
    c.rotor = lib.HT_ROTOR_MAGNET
    c.magnet = magnet(machine)[0]
    return c


@given(st.floats(0, 1))
def test_direction_of_an_angle(turns):
    found = as_complex(lib.ht_unit(turns))
    assert abs(found - np.exp(2j * np.pi * float(np.float32(turns)))) < 5e-7


@pytest.mark.parametrize("turns", [np.nan, np.inf, -np.inf, -1.0, 1e30])
def test_a_number_that_is_no_angle_gives_a_finite_direction(turns):
    assert abs(abs(as_complex(lib.ht_unit(turns))) - 1) < 1e-6


@pytest.mark.parametrize("share", [-1.5, -1.0, -0.3, 0.0, 0.4, 1.0, 1.5])
def test_least_current(machine, share):
    """Against a search over all i_d."""
    _, ld, lq, psi_f, p = machine
    m = magnet(machine)
    torque = share * 10.0 if ld < lq else share * 5.0
    i = lib.ht_magnet_least_A(m, torque)
    made = 3 * p * (psi_f + (ld - lq) * i.d) * i.q
    assert made == pytest.approx(torque, rel=0.01, abs=1e-6)
    d = np.linspace(-30, 1, 30001)
    q = torque / (3 * p * (psi_f + (ld - lq) * d))
    assert np.hypot(i.d, i.q) <= np.hypot(d, q).min() * 1.01 + 1e-6
    flux = lib.ht_magnet_flux_Wb(m, i)
    assert flux == pytest.approx(np.hypot(psi_f + ld * i.d, lq * i.q), rel=1e-5)


@pytest.mark.parametrize("machine", [*MACHINES.values(), SMALL], ids=[*MACHINES, "24 V"])
@pytest.mark.parametrize("iron", [0.0, 0.03, 0.3, 3.0, 30.0])
@pytest.mark.parametrize("share", [-1.5, 0.0, 0.01, 0.1, 0.5, 1.5])
def test_no_current_found_by_search_has_less_loss(machine, share, iron):
    """iron: its loss with the flux of the magnets alone, over the copper's with the current that
    this flux has in L_d. At 30 the magnets' flux is nearly taken away."""
    r, ld, lq, psi_f, p = machine
    k = iron * r / ld**2
    torque = share * 3 * p * psi_f * 0.3 * psi_f / lq

    def across(d):
        return torque / (3 * p * (psi_f + (ld - lq) * d))

    def loss_W(d, q):
        return 3 * (r * (d**2 + q**2) + k * ((psi_f + ld * d) ** 2 + (lq * q) ** 2))

    i = lib.ht_magnet_least_loss_A(magnet(machine), r, k, torque)
    assert across(i.d) == pytest.approx(i.q, rel=2e-3, abs=1e-9)
    bounds = (-1.5 * psi_f / ld, 0.5 * psi_f / ld)
    least = minimize_scalar(
        lambda d: loss_W(d, across(d)), bounds=bounds, method="bounded",
        options={"xatol": 1e-9 * psi_f / ld},
    )  # fmt: skip
    assert loss_W(i.d, across(i.d)) <= least.fun * (1 + 1e-4) + 1e-9


def test_without_iron_the_least_loss_is_that_of_the_least_current(machine):
    m = magnet(machine)
    for torque in (-3.0, 0.0, 0.2, 7.0):
        one = lib.ht_magnet_least_loss_A(m, machine.r, 0.0, torque)
        two = lib.ht_magnet_least_A(m, torque)
        assert (one.d, one.q) == (two.d, two.q)


def test_without_any_loss_there_is_no_current_of_least_loss(machine):
    assert np.isnan(lib.ht_magnet_least_loss_A(magnet(machine), 0.0, 0.0, 1.0).d)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.6, 0.95])
def test_the_least_flux_with_which_a_current_makes_a_torque(machine, share):
    m, psi_f = magnet(machine), machine.psi_f
    i_A = 0.6 * psi_f / machine.lq
    most_Wb = 1.3 * psi_f
    torque = share * lib.ht_magnet_most_Nm(m, i_A, most_Wb)
    fluxes = np.linspace(0.2 * psi_f, most_Wb, 3001)
    enough = [lib.ht_magnet_most_Nm(m, i_A, flux) >= torque for flux in fluxes]
    expected = fluxes[np.argmax(enough)]
    found = lib.ht_magnet_needed_Wb(m, i_A, torque, 0.2 * psi_f, most_Wb)
    assert found == pytest.approx(expected, abs=1.1 * psi_f / 256 + 1e-3 * psi_f)
    assert lib.ht_magnet_most_Nm(m, i_A, found) >= torque
    beyond = 1.1 * lib.ht_magnet_most_Nm(m, i_A, most_Wb)
    assert lib.ht_magnet_needed_Wb(m, i_A, beyond, 0.2 * psi_f, most_Wb) == np.float32(most_Wb)


@pytest.mark.parametrize("flux_pu", [0.3, 0.6, 0.9, 1.0, 1.3, 2.0])
@pytest.mark.parametrize("i_A", [1.0, 4.0, 12.0, 25.0, 60.0])
def test_most_torque_of_a_current_and_a_flux(machine, i_A, flux_pu):
    """By search over the currents' angle: within both limits, and short of the torque at which more
    angle gives less."""
    _, ld, lq, psi_f, p = machine
    flux = flux_pu * psi_f
    found = lib.ht_magnet_most_Nm(magnet(machine), i_A, flux)
    d = np.linspace(-i_A, i_A, 4001)
    sizes = np.linspace(0, 1, 401)[:, None]
    id_A, iq_A = sizes * d, sizes * np.sqrt(i_A**2 - d**2)
    within = np.hypot(psi_f + ld * id_A, lq * iq_A) <= flux * 1.0005
    torque = 3 * p * (psi_f + (ld - lq) * id_A) * iq_A
    best = np.where(within, torque, 0).max()
    along = np.linspace(-flux, flux, 20001)
    active = psi_f + (ld - lq) / ld * (along - psi_f)
    pull_out = (3 * p / lq * active * np.sqrt(flux**2 - along**2)).max()
    assert found == pytest.approx(min(best, 0.9 * pull_out), rel=0.02, abs=0.02)


@pytest.mark.parametrize("torque", [-12.0, -3.0, 0.0, 2.0, 8.0, 12.0])
@pytest.mark.parametrize("begin", [-9.0, 0.0, 6.0])
def test_flux_that_has_a_torque(machine, begin, torque):
    """Applied again and again it has torque and length, from any torque, without running away."""
    _, ld, lq, psi_f, p = machine
    m = magnet(machine)
    scale = psi_f * p / (0.1746 * 3) * 1.0
    begin, torque = begin * scale, torque * scale
    flux = lib.ht_magnet_flux_Wb(m, lib.ht_magnet_least_A(m, torque))
    i = lib.ht_magnet_least_A(m, begin)
    d, q = psi_f + ld * i.d, lq * i.q
    for _ in range(4):
        r = psi_f + (ld - lq) * (d - psi_f) / ld
        now = ffi.new("ht_dq *", [d, q])
        wanted = lib.ht_magnet_wanted_Wb(m, r, now[0], flux, torque)
        d, q = wanted.d, wanted.q
        assert np.hypot(d, q) < 1.6 * flux
    made = 3 * p / lq * q * (psi_f + (ld - lq) * (d - psi_f) / ld)
    assert np.hypot(d, q) == pytest.approx(flux, rel=1e-4)
    assert made == pytest.approx(torque, rel=0.01, abs=1e-4)


@pytest.mark.parametrize("begin", [-1.5, -1.0, -0.3, 0.0, 0.3, 0.5])
@pytest.mark.parametrize("load", [0.05, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("saliency", [1.0, 1.5, 2.7, 4.1])
def test_a_step_of_torque_and_flux_asks_for_little_more_current_than_it_needs(
    saliency, load, begin
):
    """load: the torque over that of the current psi_f/L_d without saliency. At once the law asks
    for no more current along d than the old or the new torque needs, and a seventh of psi_f/L_d;
    in the end for what the new one needs."""
    p, ld, psi_f = 3, 2e-3, 0.06
    lq = saliency * ld
    m = magnet(Machine(0.1, ld, lq, psi_f, p))
    torque = load * 3 * p * psi_f**2 / ld
    before, after = lib.ht_magnet_least_A(m, begin * torque), lib.ht_magnet_least_A(m, torque)
    flux = lib.ht_magnet_flux_Wb(m, after)
    d, q = psi_f + ld * before.d, lq * before.q
    for n in range(6):
        now = ffi.new("ht_dq *", [d, q])
        wanted = lib.ht_magnet_reference_Wb(
            m, psi_f + (ld - lq) * (d - psi_f) / ld, now[0], flux, torque
        )
        d, q = wanted.d, wanted.q
        if n == 0:
            id_A = (d - psi_f) / ld
            assert min(before.d, after.d) - psi_f / ld / 7 < id_A < psi_f / ld / 7
            assert q > 0
    assert [d, q] == pytest.approx([psi_f + ld * after.d, lq * after.q], rel=0.01)


def test_flux_that_a_voltage_turns(machine):
    """In steady state |R i + j omega psi| is the voltage, to first order in R."""
    r, p = machine.r, machine.p
    for torque, omega in ((3.0, 1500.0), (-3.0, 1500.0), (3.0, -1500.0)):
        flux = lib.ht_magnet_turned_Wb(200.0, omega, r, torque, 3 * p)
        across = torque / (3 * p * flux)  # the part of the current across the flux
        needed = abs(r * 1j * across + 1j * omega * flux)
        assert needed == pytest.approx(200.0, rel=1e-3)
    assert lib.ht_magnet_turned_Wb(200.0, 0.0, r, 3.0, 3 * p) > 100
    assert np.isfinite(lib.ht_magnet_turned_Wb(1.0, 1e4, r, 1e4, 3 * p))


@pytest.mark.parametrize("omega", [40.0, -700.0, 1500.0])
def test_the_largest_torque_of_a_voltage(machine, omega):
    """From there on the root of the flux that the voltage turns has no value. Braking, and at
    standstill, the voltage sets no end."""
    r, p, reach_V = machine.r, machine.p, 30.0
    most = lib.ht_magnet_driven_Nm(reach_V, abs(omega), r, 3 * p)
    drop2 = [4 * abs(omega) * r * share * most / (3 * p) for share in (0.999, 1.001)]
    assert drop2[0] < reach_V**2 < drop2[1]
    torque = np.copysign(1.5 * most, omega)
    flux = lib.ht_magnet_turned_Wb(reach_V, omega, r, torque, 3 * p)
    assert flux == pytest.approx(reach_V / 2 / abs(omega), rel=1e-5)
    for other in (-abs(omega), 0.0):
        assert lib.ht_magnet_driven_Nm(reach_V, other, r, 3 * p) > 1e6


def turned_with(machine, cfg, i_dq, omega, periods, adapt):
    """The observer's state after so many periods of the exact machine, which turns with a constant
    current that the voltage keeps; `adapt` is called with both in every hundredth."""
    r, ts = machine[0], cfg.ts_s
    exact, state = Exact(machine, omega), ffi.new("ht_observer_state *")
    lib.ht_magnet_align(cfg, state, pair(i_dq), pair(1 + 0j))
    state.omega_sync_rad_s = omega
    v_dq = r * i_dq + 1j * omega * exact.flux(i_dq, 0.0)
    v_dq *= np.sinc(omega * ts / 2 / np.pi)  # mean of a period
    for n in range(1, periods + 1):
        axis, middle = (np.exp(1j * omega * ts * k) for k in (n, n - 0.5))
        lib.ht_magnet_update(
            cfg, state, pair(v_dq * middle), pair(i_dq * axis), omega * ts, pair(axis), 0.0
        )
        if n % 100 == 0:
            adapt(cfg, state)
    return state


def learn(cfg, state):
    """R, with a time constant of ten periods."""
    lib.ht_magnet_adapt(cfg, state, 0.1)


@pytest.mark.parametrize("share", [0.7, 1.5])
@pytest.mark.parametrize(("turned", "learns"), [(0.2, True), (2.0, False)])
def test_a_wrong_resistance_is_learnt_where_the_magnets_induce_little(
    machine, share, turned, learns
):
    """The exact machine turns with a constant current across the magnets, and the pull bounds what
    the wrong R does. The voltage keeps this current; psi_f is told 5 % too large. At a fifth of
    the drop R comes within 3 %, at twice the drop it stays as it is."""
    r, _, lq, psi_f, _ = machine
    i_dq = complex(0, 0.5 * psi_f / lq)
    drop_V = r * abs(i_dq)
    cfg = observer(machine, 3 * drop_V / psi_f / 2 / np.pi)
    cfg.rs_ohm, cfg.magnet.psi_f_Wb = r / share, 1.05 * psi_f
    state = turned_with(machine, cfg, i_dq, turned * drop_V / psi_f, 15000, learn)
    assert state.rs_ohm == pytest.approx(r if learns else r / share, rel=0.03)
    lib.ht_magnet_adapt(cfg, state, 0.0)
    assert state.rs_ohm == pytest.approx(r / share)


@pytest.mark.parametrize("share", [0.85, 1.15])
@pytest.mark.parametrize("turned", [-8.0, 2.0, 8.0])
def test_a_wrong_flux_is_learnt_where_the_magnets_induce_much(machine, share, turned):
    """The exact machine turns with a constant current across its magnets, and R is exact. Where
    they induce less than four times the drop, or too little of the dc link, psi_f stays as it is.
    An R that is 30 % wrong moves it by less than 0.3/8."""
    r, _, lq, psi_f, _ = machine
    i_dq = complex(0, 0.5 * psi_f / lq)
    omega = turned * r * abs(i_dq) / psi_f
    flux_V = abs(omega) * psi_f

    def learnt(least_V, r_share=1.0):
        cfg = observer(machine, 3 * r * abs(i_dq) / psi_f / 2 / np.pi)
        cfg.rs_ohm = r * r_share
        cfg.magnet.psi_f_Wb = share * psi_f
        ts = min(TS, 0.2 / abs(omega))
        cfg.ts_s, cfg.inv_ts, cfg.hybrid_gain = ts, 1 / ts, cfg.hybrid_gain / TS * ts
        state = turned_with(
            machine, cfg, i_dq, omega, 12000,
            lambda cfg, of: lib.ht_magnet_adapt_flux(cfg, of, 0.1, least_V),
        )  # fmt: skip
        found = share + state.more_Wb / psi_f
        lib.ht_magnet_adapt_flux(cfg, state, 0.0, least_V)
        assert state.more_Wb == 0
        return found

    assert learnt(0.5 * flux_V) == pytest.approx(1.0 if abs(turned) > 4 else share, abs=0.01)
    assert learnt(2.0 * flux_V) == pytest.approx(share, abs=1e-6)
    if abs(turned) > 4:
        assert abs(learnt(0.0, 1.3) - 1.0) < 0.3 / 8 + 0.01


def test_what_the_harmonics_induce_in_xy(machine):
    """From the six coils' voltages, with sets 30 degrees apart."""
    psi_f = machine.psi_f
    shares, phases, omega = (0.08, 0.05), (0.7, -1.1), 900.0
    m = magnet(machine, shares[0] * np.exp(1j * phases[0]), shares[1] * np.exp(1j * phases[1]))
    coils = np.deg2rad([0, 30, 120, 150, 240, 270])
    for angle in np.linspace(0, 2 * np.pi, 13):
        volts = -omega * psi_f * np.sin(angle - coils)
        for order, share, phase in zip((5, 7), shares, phases):
            volts -= omega * psi_f * share * np.sin(order * (angle - coils) + phase)
        x, y = np.cos(5 * coils) @ volts / 3, np.sin(5 * coils) @ volts / 3
        found = lib.ht_magnet_induced_V(m, pair(np.exp(1j * angle)), omega)
        np.testing.assert_allclose([found.x, found.y], [x, y], atol=2e-4 * omega * psi_f * 0.1)


class Exact:
    """Stator flux of the machine under a constant voltage and at constant speed."""

    def __init__(self, machine, omega):
        self.r, self.ld, self.lq, self.psi_f, self.p = machine
        self.omega = omega

    def current(self, psi, angle):
        frame = psi * np.exp(-1j * angle)
        return complex((frame.real - self.psi_f) / self.ld, frame.imag / self.lq) * np.exp(
            1j * angle
        )

    def flux(self, i_dq, angle):
        return complex(self.psi_f + self.ld * i_dq.real, self.lq * i_dq.imag) * np.exp(1j * angle)

    def torque(self, psi, i):
        return 3 * self.p * (psi.conjugate() * i).imag

    def after(self, psi, angle, v, dt):
        def slope(t, z):
            d = v - self.r * self.current(complex(*z), angle + self.omega * t)
            return [d.real, d.imag]

        found = solve_ivp(slope, (0, dt), [psi.real, psi.imag], rtol=1e-10, atol=1e-12).y[:, -1]
        return complex(*found)


@pytest.mark.parametrize("omega", [0.0, 300.0, -900.0, 1900.0])
def test_prediction_of_one_period(machine, omega):
    """Up to 0.19 rad a period. R i at the period's begin counts for all of it: half of what it
    changes by is missing in the flux. Torque within 2 % of what 10 A make."""
    exact, cfg = Exact(machine, omega), observer(machine)
    state = ffi.new("ht_observer_state *")
    rng = np.random.default_rng(1)
    for _ in range(20):
        angle, i_dq = rng.uniform(0, 6), complex(*rng.normal(0, 5, 2))
        axis = np.exp(1j * angle)
        psi = exact.flux(i_dq, angle)
        v = 1j * omega * psi + complex(*rng.normal(0, 20, 2))
        lib.ht_magnet_align(cfg, state, pair(i_dq * axis), pair(axis))
        state.omega_sync_rad_s = omega
        assert as_complex(state.psi_Wb) == pytest.approx(psi, rel=1e-5)
        now, r = ffi.new("ht_estimate *"), ffi.new("ht_ab *")
        now.psi_Wb = pair(psi)
        then = lib.ht_magnet_predict(cfg, state, now[0], pair(v), pair(i_dq * axis), pair(axis), r)
        psi_1 = exact.after(psi, angle, v, TS)
        angle_1 = angle + omega * TS
        i_1 = exact.current(psi_1, angle_1)
        missing = 0.5 * exact.r * TS * abs(exact.current(psi_1, angle_1) - i_dq * axis)
        assert abs(as_complex(then.psi_Wb) - psi_1) < 1.1 * missing + 1e-5 * exact.psi_f
        assert abs(as_complex(r) - (psi_1 - exact.lq * i_1)) < 4e-3 * exact.psi_f
        largest = 3 * exact.p * exact.psi_f * 10
        assert abs(then.torque_Nm - exact.torque(psi_1, i_1)) < 0.02 * largest


@pytest.mark.parametrize("r_error", [0.7, 1.3])
def test_the_pull_bounds_what_a_wrong_resistance_does(machine, r_error):
    """At standstill the pull g leaves (R error) i / g; the voltage model alone would run away."""
    exact = Exact(machine, 0.0)
    axis, i_dq = 1 + 0j, complex(0, 5)
    pull_Hz = 20.0
    cfg = observer(machine, pull_Hz)
    cfg.rs_ohm = r_error * exact.r
    state = ffi.new("ht_observer_state *")
    lib.ht_magnet_align(cfg, state, pair(i_dq), pair(axis))
    v = exact.r * i_dq
    for _ in range(5000):
        lib.ht_magnet_update(cfg, state, pair(v), pair(i_dq), 0.0, pair(axis), 0.0)
    left = as_complex(state.psi_Wb) - exact.flux(i_dq, 0.0)
    expected = (1 - r_error) * exact.r * i_dq / (2 * np.pi * pull_Hz)
    assert left == pytest.approx(expected, rel=0.02)


def test_deadbeat_law_adds_what_the_harmonics_induce_in_xy(machine):
    """Beside its own command, in units of the dc link's voltage."""
    law, state = ffi.new("ht_deadbeat_law_config *"), ffi.new("ht_deadbeat_law_state *")
    law.gain, law.xy_free_A2, law.reach_pu = 1.0, 1e6, 1.0
    seen = ffi.new("ht_voltage_law_input *", {"vdc_V": 600.0, "rs_ohm": machine.r})
    seen.psi_Wb = seen.rotor_Wb = pair(complex(machine.psi_f))
    seen.psi_xy_Wb, seen.flux_ref_Wb = [1e-4, -2e-4], machine.psi_f
    commands = []
    for emf_V in ([0.0, 0.0], [30.0, -12.0]):
        lib.ht_deadbeat_law_reset(state)
        seen.emf_V = emf_V
        v = lib.ht_deadbeat_law_step(law, observer(machine), state, seen)
        commands.append([v.xy.x, v.xy.y])
    assert np.subtract(*commands[::-1]) == pytest.approx([30 / 600, -12 / 600], abs=1e-6)
    assert min(map(abs, commands[0])) > 1e-4


@pytest.mark.parametrize("angle_deg", [0, 90, 200, 315])
@pytest.mark.parametrize(("share", "learns"), [(0.97, True), (1.03, False)])
def test_r_is_learnt_up_to_half_of_the_drop_in_every_direction(machine, angle_deg, share, learns):
    cfg, i_A = observer(machine, 5.0), 4.0
    state = ffi.new("ht_observer_state *")
    state.rs_ohm, state.i_A = machine.r, pair(i_A * np.exp(1j * np.deg2rad(angle_deg)))
    state.omega_sync_rad_s = share * 0.5 * machine.r * i_A / machine.psi_f
    state.gap_Wb = pair(0.01 * np.exp(1j * np.deg2rad(angle_deg)))
    lib.ht_magnet_adapt(cfg, state, 0.1)
    assert (abs(state.rs_ohm / machine.r - 1) > 1e-5) == learns


def test_deadbeat_law_has_the_torque_after_one_period(machine):
    """On the exact machine at standstill, where the voltage reaches: torque steps both ways, with
    the flux of the least current."""
    exact = Exact(machine, 0.0)
    cfg = observer(machine)
    law, state = ffi.new("ht_deadbeat_law_config *"), ffi.new("ht_deadbeat_law_state *")
    law.gain, law.xy_free_A2, law.reach_pu = 1.0, 1e6, 1.0
    m = ffi.addressof(cfg, "magnet")
    for begin, end in ((0.0, 2.0), (2.0, -1.0), (3.0, 4.0)):
        lib.ht_deadbeat_law_reset(state)
        first, last = (lib.ht_magnet_least_A(m, t) for t in (begin, end))
        i = complex(first.d, first.q)
        psi = exact.flux(i, 0.0)
        seen = ffi.new("ht_voltage_law_input *")
        seen.psi_Wb, seen.rotor_Wb = pair(psi), pair(psi - exact.lq * i)
        seen.rs_ohm, seen.vdc_V = exact.r, 600.0
        seen.torque_ref_Nm, seen.flux_ref_Wb = end, lib.ht_magnet_flux_Wb(m, last)
        v = lib.ht_deadbeat_law_step(law, cfg, state, seen)
        psi_1 = exact.after(psi, 0.0, 600.0 * as_complex(v.ab), TS)
        made = exact.torque(psi_1, exact.current(psi_1, 0.0))
        assert made == pytest.approx(end, abs=0.02 * abs(end - begin) + 0.02)


@given(
    st.integers(0, 8191), st.integers(-20000, 20000), st.integers(1, 64),
    st.sampled_from([8192, 4096, 4_000_000, 12]),
)  # fmt: skip
def test_the_electrical_angle_is_counted_exactly(electrical, moved, pole_pairs, counts):
    found = lib.ht_electrical(electrical % counts, moved, pole_pairs, counts)
    assert found == (electrical % counts + moved * pole_pairs) % counts


@pytest.mark.parametrize("direction_deg", [15, 105, 225])
@pytest.mark.parametrize("i_xy", [1.2 - 0.7j, -4 + 3j, 0j])
def test_how_far_a_current_in_xy_turns_a_rotor_that_direct_current_holds(
    machine, direction_deg, i_xy
):
    """The angle without torque, by search, with 5 and 3 % of fifth and seventh harmonic: within
    0.3 degrees where the x-y current is as large."""
    _, ld, lq, psi_f, _ = machine
    e5, e7, i = 0.05 * np.exp(0.4j), 0.03 * np.exp(2j), 5 * np.exp(1j * np.deg2rad(direction_deg))

    def torque(ahead):
        axis = i / abs(i) * np.exp(1j * ahead)
        dq = i / axis
        induced = 1j * psi_f * (e5 * axis**5 - np.conj(e7 * axis**7))
        return (psi_f + (ld - lq) * dq.real) * dq.imag + (induced * np.conj(i_xy)).real

    rest = brentq(torque, -0.5, 0.5, xtol=1e-9)
    seen = {"ab": pair(i), "xy": pair(i_xy)}
    found = lib.ht_magnet_pulled_rad(magnet(machine, e5, e7), pair(i / abs(i)), seen)
    assert found == pytest.approx(rest, rel=0.04, abs=1e-6 + np.deg2rad(0.3) * abs(i_xy / i))


def test_no_current_turns_no_rotor_aside(machine):
    none = {"ab": [0.0, 0.0], "xy": [1.0, 1.0]}
    assert lib.ht_magnet_pulled_rad(magnet(machine, 0.05), [1.0, 0.0], none) == 0.0


def aligned(known, path, counts=8192, pole_pairs=3, ticks=1000, electrical=0, first=1, along=0):
    """`path(tick, direction in degrees)`: electrical degrees of the shaft from its beginning.
    Direction 0 lies at 15 degrees, or with `first` 0 at 0; `along` is the last one."""
    cfg, state = ffi.new("ht_alignment_config *"), ffi.new("ht_alignment_state *")
    cfg.known, cfg.ticks, cfg.counts_rev, cfg.pole_pairs = known, ticks, counts, pole_pairs
    cfg.first = first
    state.electrical = electrical
    lib.ht_alignment_begin(cfg, state, along)
    at = 0
    for tick in range(1, 8 * ticks):
        to = round(path(tick, 15 * first + 30 * state.direction) / 360 / pole_pairs * counts)
        state.electrical = lib.ht_electrical(state.electrical, to - at, pole_pairs, counts)
        at = to
        result = lib.ht_alignment_step(cfg, state, tick)
        if result != lib.HT_ALIGNING:
            return result, state.electrical / counts * 360, tick
    raise AssertionError("it never ends")


@pytest.mark.parametrize("at_first", [0, 100, -170])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("along", [0, 5, 11])
def test_alignment_ends_in_the_last_direction_from_a_quarter_of_a_turn_ahead(
    at_first, first, along
):
    asked = []

    def path(t, to):
        asked.append(to)
        return (to - asked[0] + 180) % 360 - 180 - at_first if t > 50 else 0

    result, degrees, tick = aligned(False, path, first=first, along=along)
    assert result == lib.HT_ALIGNED and tick == 1000
    last = 15 * first + 30 * along
    assert asked[-1] == last and (asked[0] - last) % 360 == 90
    assert degrees == pytest.approx(last, abs=0.2)


@pytest.mark.parametrize(
    "path",
    [
        lambda t, to: 0,  # the current is too small for the friction
        lambda t, to: 100 - to,  # the encoder counts backwards
        lambda t, to: to + 40 * np.sin(t / 30),  # it never rests
    ],
)
def test_an_alignment_that_the_encoder_does_not_show_is_refused(path):
    assert aligned(False, path)[0] == lib.HT_NOT_ALIGNED


@pytest.mark.parametrize("sign", [1, -1])
def test_a_rotor_that_goes_round_ends_it(sign):
    """After two turns."""
    result, _, tick = aligned(False, lambda t, to: 3 * sign * t)
    assert result == lib.HT_NOT_ALIGNED and tick == pytest.approx(240, abs=1)


def test_a_shaft_that_swings_is_waited_for():
    def path(t, to):
        return to + 30 * np.exp(-t / 700) * np.sin(t / 30)

    result, _, tick = aligned(False, path)
    assert result == lib.HT_ALIGNED and 1000 < tick <= 4000


@pytest.mark.parametrize("error, result", [(0, 1), (10, 1), (60, 2), (180, 2), (-90, 2)])
@pytest.mark.parametrize("first", [0, 1])
def test_a_known_angle_is_checked(error, result, first):
    """The rotor goes where the current pulls it; from an angle that is wrong it goes too far."""
    true = 200.0
    electrical = round((true + error) % 360 / 360 * 8192)
    found, _, _ = aligned(True, lambda t, to: to - true, electrical=electrical, first=first)
    assert found == result


def shorted(machine, omega, start, turns=1.0, most_step=1e-3):
    """Exact currents along both axes after all terminals were connected:
    L_d i_d' = w L_q i_q - R i_d and L_q i_q' = -w (L_d i_d + psi_f) - R i_q."""
    r, ld, lq, psi_f, _ = machine

    def slope(_, i):
        return [(omega * lq * i[1] - r * i[0]) / ld, (-omega * (ld * i[0] + psi_f) - r * i[1]) / lq]

    end = 2 * np.pi * turns / omega
    found = solve_ivp(slope, (0, end), start, rtol=1e-10, atol=1e-10, max_step=most_step * end)
    return found.y


@pytest.mark.parametrize("omega", [1.0, 30.0, 300.0, 1500.0, 10000.0])
@pytest.mark.parametrize("across_A", [-5.0, 0.0, 5.0, 15.0])
def test_peak_current_of_a_short_circuit(machine, omega, across_A):
    found = lib.ht_magnet_short_A(magnet(machine), machine.r, omega, across_A)
    exact = max(
        np.hypot(*shorted(machine, omega, [0.0, sign * across_A])).max() for sign in (-1, 1)
    )
    assert abs(found / max(exact, 1e-9) - 1) < 0.01


def test_a_short_circuit_at_no_resistance_swings_to_twice_what_it_settles_at(machine):
    """Flux that cannot change opposes the magnets after half a turn: i_d = -2 psi_f/L_d."""
    found = lib.ht_magnet_short_A(magnet(machine), 0.0, 1000.0, 0.0)
    assert abs(found / (2 * machine.psi_f / machine.ld) - 1) < 2e-3


@given(st.floats(1e-5, 1.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_largest_voltage_between_two_terminals(psi_f, five, seven):
    """Whatever phases the harmonics have: a search over phases and angle comes near it, and none
    is above it."""
    found = lib.ht_magnet_terminal_Wb(psi_f, five, seven) / psi_f
    theta = np.linspace(0, 2 * np.pi, 721)
    # Between terminals 120 degrees apart each order that is no multiple of three has sqrt(3).
    peaks = []
    for a in (0, np.pi):
        for b in (0, np.pi):
            wave = np.cos(theta) + five * np.cos(5 * theta + a) + seven * np.cos(7 * theta + b)
            peaks.append(np.sqrt(3) * wave.max())
    assert abs(max(peaks) / found - 1) < 1e-3


@pytest.mark.parametrize("active_Wb", [0.0, -0.05, np.inf])
def test_where_torque_has_no_slope_the_wanted_flux_is_still_of_its_length(machine, active_Wb):
    """The torque is the flux across times the active flux: where there is none, no step has it."""
    m = magnet(machine)
    wanted = lib.ht_magnet_wanted_Wb(m, active_Wb, [machine.psi_f, 0.0], machine.psi_f, 5.0)
    assert wanted.d > 0
    if np.isfinite(active_Wb):
        assert np.hypot(wanted.d, wanted.q) < 100 * machine.psi_f
