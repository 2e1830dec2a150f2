"""ht_interleaved_law and ht_interleaved: the law against an ideal machine that takes its edges; the
positions against the ripple of the pulses, computed from their spectrum; and what the registers
must hold whatever goes in.
"""

import itertools

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from legs import least_xy_rails
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TS, VDC = 1e-4, 300.0
SIGMA_LS, LXY, RS, GAIN = 0.028, 0.0144, 6.0, 3.0
RHO = SIGMA_LS / LXY
COUNTS, SHORTEST = 10000, 60
#: Legs are clamped from here on, over the next 0.02 Vdc.
CLAMPED_PU = 0.36
#: Legs of each set in the order of the law, and where they lie.
LEGS = ((0, 2, 4), (5, 1, 3))
ANGLE = np.deg2rad([0, 30, 120, 150, 240, 270])
SET1 = 0b101010


def pair(z):
    return [z.real, z.imag]


def machine():
    return ffi.new("ht_observer_config *", {
        "ts_s": TS, "inv_ts": 1 / TS, "rs_ohm": RS, "sigma_ls_H": SIGMA_LS,
        "inv_sigma_ls": 1 / SIGMA_LS, "lxy_H": LXY, "torque_gain": GAIN,
    })  # fmt: skip


def level(word, leg):
    return word >> (5 - leg) & 1


class Law:
    def __init__(self, together=0.0, gain=1.0, f_isr_Hz=1 / TS, dead=0.0, shortest=SHORTEST,
                 counts=COUNTS, alternate=False):  # fmt: skip
        self.cfg = ffi.new("ht_interleaved_law_config *")
        self.cfg.deadbeat = ffi.new("ht_deadbeat_law_config *", [gain, 0.0, 16.0, 1.0])[0]
        self.configure(together, f_isr_Hz, alternate)
        self.state = unwritten("ht_interleaved_law_state *")
        lib.ht_interleaved_law_reset(self.state)
        self.period = ffi.new("ht_period *", [counts, 0, shortest])
        self.dead = ffi.new("ht_dead_time *", [dead, 0.1])
        self.six = ffi.new("ht_six *")
        self.before = 0

    def configure(self, together, f_isr_Hz=1 / TS, alternate=False):
        lib.ht_interleaved_configure(
            ffi.addressof(self.cfg.positions), RHO, f_isr_Hz, together,
            1.0 if alternate else 0.0, CLAMPED_PU,
        )  # fmt: skip
        assert lib.ht_interleaved_law_check(self.cfg)

    def step(self, psi, psi_xy, rotor, torque, flux, turn=0.0, vdc=VDC, rs=RS, i=(0j, 0j)):
        """One period. Returns what the registers and the observer are told."""
        seen = ffi.new(
            "ht_voltage_law_input *",
            [pair(psi), pair(rotor), pair(psi_xy), [pair(i[0]), pair(i[1])], turn, rs, torque,
             flux, vdc],
        )  # fmt: skip
        pwm = ffi.new("ht_modulator_input *", [self.dead, self.six, self.period, self.before])
        out, applied = unwritten("ht_compare *"), unwritten("ht_applied *")
        toggles = unwritten("ht_toggles *")
        lib.ht_interleaved_law_pattern(
            self.cfg, machine(), self.state, seen, pwm, out, applied, toggles
        )
        self.before = applied.s[2]
        return out, applied, toggles


def valid(law, before, out, applied, toggles):
    """What the PWM and the observer rely on."""
    p = law.period
    assert out.start == applied.s[0] and applied.s[1] == applied.s[2] and out.start < 64
    assert applied.before == before
    for leg in range(6):
        toggled = level(applied.s[0] ^ applied.s[1], leg)
        assert out.cb[leg] == p.counts
        if toggled:
            assert p.shortest <= out.ca[leg] <= p.counts - p.shortest
            assert toggles.t[leg] == pytest.approx(out.ca[leg] / p.counts, abs=1e-6)
        else:
            assert out.ca[leg] == p.counts and toggles.t[leg] == 1.0
    edges = applied.s[0] ^ applied.s[1]
    assert applied.later == edges and applied.close == 0
    edge0 = before ^ applied.s[0]
    assert applied.rising == (edge0 & applied.s[0]) | (edges & applied.s[1])
    assert applied.falling == (edge0 & before) | (edges & applied.s[0])
    high = np.array([
        1 - toggles.t[leg] if level(applied.s[1], leg) > level(applied.s[0], leg)
        else toggles.t[leg] if level(applied.s[1], leg) < level(applied.s[0], leg)
        else level(applied.s[0], leg)
        for leg in range(6)
    ])  # fmt: skip
    mean = applied.mean_pu
    ab = (high * np.exp(1j * ANGLE)).sum() / 3
    xy = (high * np.exp(5j * ANGLE)).sum() / 3
    np.testing.assert_allclose([mean.ab.alpha, mean.ab.beta], pair(ab), atol=2e-6)
    np.testing.assert_allclose([mean.xy.x, mean.xy.y], pair(xy), atol=2e-6)
    return ab, xy


class Machine:
    """Ideal: the sets' fluxes are the integrals of their voltages less the drops, the rotor flux
    turns with constant length. What the law sees is the state at the period's begin."""

    def __init__(self, rotor, turn, psi=None):
        self.rotor, self.turn = complex(rotor), turn
        self.psi = self.rotor if psi is None else psi
        self.psi_xy = 0j

    def set_flux(self, a):
        return self.psi + (1, -1)[a] * np.conj(self.psi_xy)

    def run(self, ab, xy):
        i = (self.psi - self.rotor) / SIGMA_LS
        self.psi += TS * (VDC * ab - RS * i)
        self.psi_xy += TS * (VDC * xy - RS * self.psi_xy / LXY)
        self.rotor *= np.exp(1j * self.turn)

    def torque(self):
        return GAIN / SIGMA_LS * (np.conj(self.rotor) * self.psi).imag


def settled(law, motor, torque, flux, periods=408):
    """Torque and flux of the sets at the begins of their halves, over the last 48 periods. Where
    the sets are together by turns, they join or part in the middle of these."""
    rows = []
    for n in range(periods):
        state = law.state.positions
        sets = [state.quarter & 1] if not state.joined else [] if state.quarter & 1 else [0, 1]
        for a in sets if n >= periods - 48 else []:
            off = law.state.off_pu[a]
            mean = motor.set_flux(a) - VDC * TS * complex(off.alpha, off.beta)
            rows.append((GAIN / SIGMA_LS * (np.conj(motor.rotor) * mean).imag, abs(mean)))
        before = law.before
        out = law.step(motor.psi, motor.psi_xy, motor.rotor, torque, flux, motor.turn)
        motor.run(*valid(law, before, *out))
    return np.array(rows)


ENDS = [(0.0, False), (1.0, False), (1.0, True)]
JOINS = [(1 / 2, False), (31 / 64, True)]


@pytest.mark.parametrize("turn", [0.0, 0.012, -0.03, 0.039])
@pytest.mark.parametrize(
    ("degrees", "together", "alternate"),
    [(degrees, *end) for end in ENDS for degrees in range(0, 360, 15)]
    + [(degrees, *join) for join in JOINS for degrees in range(0, 360, 60)],
)
def test_each_set_has_the_torque_and_the_flux_at_its_begins(degrees, together, alternate, turn):
    """From every direction, at low and high voltage, with pulses placed or legs clamped, and where
    set 2 joins set 1 or leaves it. The compare values are rounded, and edges keep the shortest
    pulse from the samples: the set makes up for it."""
    rotor = 0.36 * np.exp(1j * np.deg2rad(degrees))
    law = Law(together, alternate=alternate)
    found = settled(law, Machine(rotor, turn), 1.5, 0.4)
    assert found[:, 0].mean() == pytest.approx(1.5, abs=0.02)
    assert np.abs(found[:, 0] - 1.5).max() < 0.12
    assert found[:, 1].mean() == pytest.approx(0.4, rel=2e-3)
    assert np.abs(found[:, 1] - 0.4).max() < 0.006


def halves_of(law, motor, periods):
    """Which sets begin a half in each period, and of set 2's how many periods it lasts."""
    found = []
    for _ in range(periods):
        state, was = law.state.positions, law.before
        quarter, joined = state.quarter, state.joined
        motor.run(*valid(law, was, *law.step(
            motor.psi, motor.psi_xy, motor.rotor, 1.5, 0.4, motor.turn
        )))  # fmt: skip
        sets = {quarter & 1} if not joined else set() if quarter & 1 else {0, 1}
        found.append((quarter, sets, 1 if state.brief else 2))
    return found


@pytest.mark.parametrize("size", [0.05, 0.2, 0.3, 0.5])
@pytest.mark.parametrize("together", [0, 1, 16, 32, 63, 64])
def test_the_share_is_that_of_the_carriers_in_which_the_sets_begin_together(together, size):
    """At every voltage. Set 1 begins a half in every second period; set 2 with it, or between, or
    else, where it joins or leaves, a half of one period, such that no period is without a half of
    either set."""
    law = Law(together / 64)
    found = halves_of(law, Machine(0.36, size * VDC * TS / 0.4), 3 * 256)[256:]
    halves = [0, 0]
    ends = [0, found[0][0] & 1]
    for n, (quarter, sets, lasts) in enumerate(found):
        assert (0 in sets) == (quarter % 2 == 0)
        for a in (0, 1):
            if a in sets:
                assert n <= 1 or ends[a] == n
                ends[a] = n + (lasts if a else 2)
                halves[a] += 1
    both = sum(sets == {0, 1} and lasts == 2 for _, sets, lasts in found)
    brief = sum(1 in sets and lasts == 1 for _, sets, lasts in found)
    between = 0 < together < 64
    assert brief == (4 if between else 0)
    # The half in which set 2 joins takes the place of one that it would begin together with set 1.
    assert both == 2 * (2 * together - (1 if between else 0))
    assert halves == [256, 256 + (2 if between else 0)]


def test_the_first_step_is_that_of_the_equations():
    """In complex numbers: the set's flux goes to w = (a + j b) r, turned by the half."""
    rng = np.random.default_rng(37)
    for _ in range(200):
        rotor = 0.36 * np.exp(2j * np.pi * rng.random())
        psi = rotor * (1.1 + 0.02 * rng.standard_normal() + 0.05j * rng.standard_normal())
        psi_xy = 0.002 * complex(*rng.standard_normal(2))
        torque, turn = rng.uniform(-3, 3), rng.uniform(-0.03, 0.03)
        own = psi + np.conj(psi_xy)
        flux = abs(own) + rng.uniform(-0.004, 0.004)
        law = Law()
        _, applied, toggles = law.step(psi, psi_xy, rotor, torque, flux, turn)
        b = torque * SIGMA_LS / (GAIN * abs(rotor) ** 2)
        limited = abs(own) + np.clip(flux - abs(own), -0.2 * VDC * TS, 0.2 * VDC * TS)
        a = np.sqrt(max(limited**2 / abs(rotor) ** 2 - b * b, 0.01))
        w, tau = (a + 1j * b) * rotor, 2 * turn
        e = (1j * tau - tau**2 / 2) * w + w - own
        if abs(e) > 0.5 * 2 * VDC * TS:
            continue
        x = e / (2 * TS * VDC) + RS * (w - rotor) / SIGMA_LS * (1 + 0.5j * tau) / VDC
        u = np.array([(x * np.exp(-1j * ANGLE[leg])).real for leg in LEGS[0]])
        d = 0.5 + u - 0.5 * (u.max() + u.min())
        # The first half of set 1 rises. A pulse moves towards 1/8, by 0.06 at most.
        for k, leg in enumerate(LEGS[0]):
            placed = law.state.positions.set[0].delta[k]
            assert abs(placed) <= 0.06 + 1e-6
            at = 2 * (1 - d[k]) + 4 * (1 - d[k]) * placed
            late = law.state.positions.set[0].moves >> (5 - leg) & 1
            got = 1 + law.state.positions.set[0].next[k] / COUNTS if late else toggles.t[leg]
            if abs(at - 1) > SHORTEST / COUNTS:
                assert got == pytest.approx(at, abs=2e-4)
        # Set 2 has not begun: it is at zero.
        assert applied.s[0] & ~SET1 == 0 and applied.s[1] & ~SET1 == 0


@pytest.mark.parametrize("half", [0, 1])
def test_an_edge_is_commanded_earlier_by_what_the_dead_time_delays_it(half):
    """In a rising half the dead time delays a leg whose current flows out of it, in a falling one
    the leg whose current flows into it: by all of it from i_zero on, and in proportion below."""
    dead, i_zero_A = 0.02, 0.1

    def edges(i_A):
        law, motor = Law(dead=dead), turning(0.3)
        for leg in range(6):
            law.six.p[leg] = i_A
        for _ in range(2 * half + 1):
            *_, toggles = law.step(motor.rotor - 0.002j, 0j, motor.rotor, 0.0, 0.4, motor.turn)
        state = law.state.positions.set[0]
        return np.array([
            1 + state.next[k] / COUNTS if state.moves >> (5 - leg) & 1 else toggles.t[leg]
            for k, leg in enumerate(LEGS[0])
        ])  # fmt: skip

    none = edges(0.0)
    free = np.abs(none - 1) > dead  # an edge keeps its distance from the sample
    assert free.sum() >= 2
    for i_A in (-5 * i_zero_A, -i_zero_A, -i_zero_A / 2, i_zero_A / 4, i_zero_A, 5 * i_zero_A):
        share = 0.5 + 0.5 * np.clip((i_A, -i_A)[half] / i_zero_A, -1, 1)
        np.testing.assert_allclose((edges(i_A) - none)[free], (0.5 - share) * dead, atol=2e-4)


def ripple(d, delta, samples=4800):
    """Fluxes of the sets without their means, over one period of the carrier, from ideal pulses."""
    t = (np.arange(samples) + 0.5) / samples
    flux = []
    for a in (0, 1):
        centre = (0.5, 0.75)[a] + np.array(delta[a])
        from_centre = np.abs((t - centre[:, None] + 0.5) % 1 - 0.5)
        # The share of each sample that is high: exact to first order, so that slopes are smooth.
        high = np.clip((np.array(d[a])[:, None] / 2 - from_centre) * samples + 0.5, 0, 1)
        v = 2 / 3 * (high * np.exp(1j * ANGLE[list(LEGS[a])])[:, None]).sum(axis=0)
        p = np.cumsum(v - v.mean()) / samples
        flux.append(p - p.mean())
    return flux


def cost(d, delta, quad, weight=2.0):
    """Current and torque ripple squared: those of x-y are rho times as large."""
    one, two = ripple(d, delta)
    ab, xy = 0.5 * (one + two), 0.5 * np.conj(one - two)
    currents = (np.abs(ab) ** 2 + RHO**2 * np.abs(xy) ** 2).mean() / (1 + RHO**2)
    torque = ((ab * np.conj(quad)).real ** 2).mean()
    return (currents + weight * torque) / (1 + weight)


def test_positions_go_down_the_slope_of_the_ripple():
    """One of three pulses moves in a half, by a step in proportion to the slope of J in its
    position, which is found here by differences."""
    rng = np.random.default_rng(3)
    factors = []
    for trial in range(60):
        law = Law(f_isr_Hz=1600.0)
        state = ffi.addressof(law.state.positions)
        rotor = 0.36 * np.exp(2j * np.pi * rng.random())
        x = 0.42 * np.exp(2j * np.pi * rng.random())
        d = []
        for a in (0, 1):
            u = (x * np.exp(-1j * ANGLE[list(LEGS[a])])).real
            d.append(0.5 + u - 0.5 * (u.max() + u.min()))
            for k in range(3):
                state.set[a].half_d[k] = d[a][k] / 2
                state.set[a].delta[k] = rng.uniform(-0.1, 0.1) * min(d[a][k], 1 - d[a][k])
        a, k = trial % 2, trial % 3
        state.quarter, state.turn = a, k
        law.state.begun = True
        delta = [[state.set[s].delta[n] for n in range(3)] for s in (0, 1)]
        command = ffi.new(
            "ht_interleaved_command *", [pair(x), pair(1j * rotor / 0.36), [0.45, 0.0]]
        )
        pwm = ffi.new("ht_modulator_input *", [law.dead, law.six, law.period, 0])
        lib.ht_interleaved_step(
            ffi.addressof(law.cfg.positions), state, command, a, False, pwm,
            unwritten("ht_compare *"), unwritten("ht_applied *"), unwritten("ht_toggles *"),
        )  # fmt: skip
        moved = state.set[a].delta[k] - delta[a][k]
        if not 1e-4 < abs(moved) < 0.95 * law.cfg.positions.cap:
            continue
        if abs(state.set[a].delta[k]) > 0.99 * 0.45 * min(d[a][k], 1 - d[a][k]):
            continue
        near = []
        for shift in (1e-3, -1e-3):
            changed = [list(row) for row in delta]
            changed[a][k] += shift
            near.append(cost(d, changed, 1j * rotor / 0.36))
        factors.append(-moved / ((near[0] - near[1]) / 2e-3))
    assert len(factors) >= 20
    assert np.min(factors) > 0
    np.testing.assert_allclose(factors, np.median(factors), rtol=0.03)


@pytest.mark.parametrize(
    ("together", "size", "place"),
    [(0.0, 0.02, 1 / 8), (0.0, 0.2, 1 / 8), (1.0, 0.02, 1 / 8), (1.0, 0.2, 1 / 8), (1.0, 0.3, 0)],
)
def test_at_low_voltage_pulses_lie_an_eighth_of_the_carrier_early(together, size, place):
    """So the sample is clear of them, wherever they were before. Where the sets begin together at
    a higher voltage they lie in the middle."""
    law, motor = Law(together), turning(size)
    rng = np.random.default_rng(2)
    for one in law.state.positions.set:
        one.delta = rng.uniform(-0.05, 0.05, 3).tolist()
    for _ in range(200):
        pattern_of(law, motor)
    places = [list(one.delta) for one in law.state.positions.set]
    np.testing.assert_allclose(places, place, atol=1e-5)


@pytest.mark.parametrize("size", [0.1, 0.25, 0.5])
def test_for_the_least_distortion_the_sets_begin_together_and_turn(size):
    """In every second 30 degrees one rises while the other falls, as the modulator of db-dtfc has
    it."""
    law = Law(1.0)
    senses = []
    motor = Machine(0.4, size * VDC * TS / 0.4)
    for n in range(700):
        was = law.before
        quarter = law.state.positions.quarter
        out, applied, toggles = law.step(motor.psi, motor.psi_xy, motor.rotor, 0.0, 0.4, motor.turn)
        motor.run(*valid(law, was, out, applied, toggles))
        state = law.state.positions
        assert state.together and (state.joined or n == 0)
        if n > 120 and quarter in (0, 2):
            v = law.state.v_pu[0]
            angle = np.rad2deg(np.angle(complex(v.alpha, v.beta))) % 60
            start = [applied.s[0] & SET1 != 0, applied.s[0] & ~SET1 != 0]
            senses.append((angle, start[0] != start[1], state.opposite))
    assert len(senses) > 250 and 0.2 < np.mean([opposite for _, opposite, _ in senses]) < 0.8
    for angle, opposite, told in senses:
        assert opposite == told
        if min(abs(angle - edge) for edge in (0, 30, 60)) > 8:
            assert opposite == (angle < 30)


@pytest.mark.parametrize("size", [0.37, 0.42])
def test_the_laws_positions_go_down_the_slope_in_the_middle_of_the_half(size):
    """The torque is the flux across the rotor's there, a period after the half's begin."""
    law, motor, factors = Law(f_isr_Hz=1600.0), turning(size), []
    for n in range(700):
        state = law.state.positions
        a, k = state.quarter & 1, state.turn
        delta = [list(one.delta) for one in state.set]
        quad = 1j * motor.rotor / abs(motor.rotor) * np.exp(1j * motor.turn)
        pattern_of(law, motor)
        moved = state.set[a].delta[k] - delta[a][k]
        d = [[2 * half for half in one.half_d] for one in state.set]
        free = abs(state.set[a].delta[k]) < 0.44 * min(d[a][k], 1 - d[a][k])
        if n < 100 or not free or not 1e-4 < abs(moved) < 0.95 * law.cfg.positions.cap:
            continue
        near = []
        for shift in (1e-3, -1e-3):
            changed = [list(row) for row in delta]
            changed[a][k] += shift
            near.append(cost(d, changed, quad))
        factors.append(-moved / ((near[0] - near[1]) / 2e-3))
    assert len(factors) > 200
    ends = np.percentile(factors, [5, 95])
    np.testing.assert_allclose(ends, np.median(factors), rtol=0.01)


def test_the_steady_voltage_is_that_of_set_1():
    law = Law()
    cfg, state = ffi.addressof(law.cfg.positions), ffi.addressof(law.state.positions)
    pwm = ffi.new("ht_modulator_input *", [law.dead, law.six, law.period, 0])
    kept = []
    for n, v in enumerate((0.3, 0.2j, -0.4 + 0j, 0.1j)):
        command = ffi.new("ht_interleaved_command *", [pair(v + 0j), [0, 1], pair(v + 0j)])
        told = [unwritten(f"ht_{name} *") for name in ("compare", "applied", "toggles")]
        lib.ht_interleaved_step(cfg, state, command, n % 2, n == 0, pwm, *told)
        kept.append(complex(state.steady_pu.alpha, state.steady_pu.beta))
    assert kept == pytest.approx([0.3, 0.3, -0.4, -0.4])


@pytest.mark.parametrize("size", [0.03, 0.06, 0.1])
def test_sets_that_begin_at_once_tell_what_each_would_tell_alone(size):
    """How far the flux of each is off its mean. At low voltage pulses are not in the middle."""
    law = Law(1.0)
    cfg, state = ffi.addressof(law.cfg.positions), ffi.addressof(law.state.positions)
    rng = np.random.default_rng(9)
    for _ in range(20):
        state.together = state.joined = True
        for one in state.set:
            one.half_d = rng.uniform(0.1, 0.4, 3).tolist()
            one.delta = rng.uniform(-0.05, 0.05, 3).tolist()
        v = size * np.exp(2j * np.pi * rng.random((2, 1)))
        commands = ffi.new("ht_interleaved_command[2]", [[pair(z), [0, 1], pair(z)] for (z,) in v])
        alone = [ffi.new("ht_interleaved_state *", state[0]) for _ in commands]
        off = ffi.new("ht_ab[2]", [[np.nan, np.nan]] * 2)
        pwm = ffi.new("ht_modulator_input *", [law.dead, law.six, law.period, 0])
        told = [unwritten(f"ht_{name} *") for name in ("compare", "applied", "toggles")]
        lib.ht_interleaved_both(cfg, state, commands, True, pwm, off, *told)
        for a, one in enumerate(alone):
            one.opposite = state.opposite
            found = lib.ht_interleaved_step(cfg, one, commands + a, a, False, pwm, *told)
            assert (off[a].alpha, off[a].beta) == (found.alpha, found.beta)
            assert abs(complex(found.alpha, found.beta)) > 1e-5


def turning(size):
    """A machine without torque whose voltage has this size, in units of V_dc."""
    return Machine(0.4, size * VDC * TS / 0.4)


def pattern_of(law, motor):
    """A period in steady state: start levels, instants, and whether both halves begin in it."""
    state = law.state.positions
    even = state.quarter in (0, 2)
    was = law.before
    out = law.step(motor.psi, motor.psi_xy, motor.rotor, 0.0, 0.4, motor.turn)
    ab, xy = valid(law, was, *out)
    motor.run(ab, xy)
    return out, even and state.joined


@pytest.mark.parametrize(("size", "dead"), [(0.4, 0.0), (0.5, 0.0), (0.5, 0.0055)])
def test_clamped_legs_are_those_with_the_least_xy_ripple(size, dead):
    """Of each set one leg stays on its rail for the whole half: of the four choices the one with
    the least x-y ripple, under carriers whose sense is that of the half. No pulse is too short
    where the clamped leg changes. The dead time's share of an edge, in either direction, gives a
    clamped leg none."""
    law, motor = Law(1.0, alternate=True, dead=dead), turning(size)
    rng = np.random.default_rng(37)
    last, seen = [None] * 6, []
    for n in range(1600):
        direction = motor.rotor * np.exp(1j * (np.pi / 2 + motor.turn))  # in the middle of the half
        law.six.p[0:6] = rng.choice([-1.0, 1.0], 6)
        (out, applied, _), both = pattern_of(law, motor)
        edges = [(0, applied.before ^ applied.s[0], leg) for leg in range(6)]
        edges += [(out.ca[leg], applied.s[0] ^ applied.s[1], leg) for leg in range(6)]
        for at, changed, leg in edges:
            if level(changed, leg):
                time = n * COUNTS + at
                assert last[leg] is None or time - last[leg] >= SHORTEST
                last[leg] = time
        if n < 200:
            continue
        if both:
            begun = direction, applied.s[0], law.state.positions.opposite
            toggled = applied.s[0] ^ applied.s[1]
        elif begun:
            toggled |= applied.s[0] ^ applied.s[1]
            seen.append((*begun, toggled))
    rails = 0
    for direction, start, opposite, toggled in seen:
        angle = np.rad2deg(np.angle(direction)) % 15
        v = size * direction / abs(direction)
        if not 2 < angle < 13:
            continue
        still = [[leg for leg in LEGS[a] if not level(toggled, leg)] for a in (0, 1)]
        assert [len(legs) for legs in still] == [1, 1]
        wanted = least_xy_rails(np.array([v.real, v.imag, 0, 0]), opposite)
        assert tuple(level(start, legs[0]) for legs in still) == wanted
        rails += 1
    assert rails > 400


def test_legs_are_clamped_above_their_voltage_and_by_choice():
    """Toggles of a half: six below the voltage, or if no legs alternate, else four."""
    for size, alternate, toggles in ((0.34, True, 6), (0.4, True, 4), (0.4, False, 6)):
        law, motor = Law(1.0, alternate=alternate), turning(size)
        count = 0
        for n in range(700):
            (_, applied, _), _ = pattern_of(law, motor)
            if n >= 200:
                count += (applied.s[0] ^ applied.s[1]).bit_count()
        assert count / 250 == pytest.approx(toggles, abs=0.1)


NUMBERS = st.one_of(
    st.floats(-3, 3, width=32),
    st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 1e30, -1e30, 1e-38]),
)
Z = st.builds(complex, NUMBERS, NUMBERS)


@settings(max_examples=examples(150), deadline=None)
@given(
    st.lists(st.tuples(Z, Z, Z, NUMBERS, NUMBERS, NUMBERS, NUMBERS, NUMBERS), min_size=1,
             max_size=9),
    st.sampled_from([(8, 1), (8, 4), (9, 4), (10000, 60), (10000, 5000), (65535, 1),
                     (65535, 32767)]),
    st.floats(0, 0.5, width=32), st.integers(0, 63), st.sampled_from([0, 1, 32, 64]),
    st.booleans(), st.integers(0, 63),
)  # fmt: skip
def test_every_input_gives_a_valid_pattern(
    inputs, period, dead, before, together, alternate, carrier
):
    """NaN and infinity as well, and the state recovers: it holds numbers again."""
    counts, shortest = period
    law = Law(together / 64, dead=min(dead, shortest / counts), counts=counts,
              shortest=shortest, alternate=alternate)  # fmt: skip
    law.before, law.state.positions.carrier = before, carrier
    for psi, psi_xy, rotor, torque, flux, turn, vdc, current in inputs:
        for leg in range(6):
            law.six.p[leg] = current
        was = law.before
        valid(law, was, *law.step(psi, psi_xy, rotor, torque, flux, turn, vdc, i=(psi, psi_xy)))
    for leg in range(6):
        law.six.p[leg] = 0.0
    motor = Machine(0.36, 0.03)
    for _ in range(40):
        was = law.before
        ab, xy = valid(law, was, *law.step(0.4 + 0j, 0j, 0.36 + 0j, 0.0, 0.4, 0.0))
    assert np.isfinite([motor.psi.real, abs(ab), abs(xy)]).all()
    for a, k in itertools.product((0, 1), range(3)):
        assert 0 <= law.state.positions.set[a].half_d[k] <= 0.5
        assert abs(law.state.positions.set[a].delta[k]) <= 0.2251
        assert np.isfinite([law.state.off_pu[a].alpha, law.state.off_pu[a].beta]).all()


@pytest.mark.parametrize("size", [0.01, 0.3, 0.55, 0.6, 0.7, 2.0])
def test_every_sector_and_its_edges(size):
    """Steps of the flux in all directions, up to what no legs can make: a leg on its rail does not
    toggle, and no pulse is shorter than the shortest."""
    law = Law()
    last = [None] * 6
    time = 0
    for k in range(4 * 360):
        direction = np.exp(1j * np.deg2rad(15 * (k // 8) + (k % 8 - 4) * 1e-5))
        goal = size * 2 * VDC * TS * direction
        was = law.before
        out, applied, toggles = law.step(0.36 - goal, 0j, 0.36 + 0j, 0.0, 0.36)
        valid(law, was, out, applied, toggles)
        for leg in range(6):
            for at, change in ((0, level(was ^ applied.s[0], leg)),
                               (out.ca[leg], level(applied.s[0] ^ applied.s[1], leg))):  # fmt: skip
                if change:
                    assert last[leg] is None or time + at - last[leg] >= SHORTEST
                    last[leg] = time + at
        time += COUNTS


#: Each value of the positions: at the end of its range, and beyond.
POSITIONS = {
    "alike": ([-1.0, 1.0], [-1.01, 1.01, np.nan]),
    "cap": ([1e-6, 0.06], [0.0, -1.0, 0.061, np.inf, np.nan]),
    "together": ([0, 64], [65]),
    "kappa": ([0.0, 1.0], [-0.01, 1.01, np.nan]),
    "kappa_from_pu": ([0.0], [-0.01, np.nan]),
}


@pytest.mark.parametrize("name", POSITIONS)
def test_each_value_of_the_positions_has_a_range_of_which_nan_is_no_part(name):
    def fits(value):
        cfg = Law().cfg
        setattr(cfg.positions, name, value)
        return lib.ht_interleaved_law_check(cfg)

    good, bad = POSITIONS[name]
    assert all(fits(value) for value in good)
    assert not any(fits(value) for value in bad)


def test_the_law_refuses_what_its_deadbeat_law_refuses():
    cfg = Law().cfg
    cfg.deadbeat.gain = 0.0
    assert not lib.ht_interleaved_law_check(cfg)
