"""ht_modulator against a counter that counts, and against its definition derived here once more
from the legs' angles: commands, zero sequence, sectors, senses of the carriers.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from legs import SETS, T, follow_leg, least_xy_rails
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TURN_PU = 0.3
PERIOD = 7500

floats32 = st.floats(width=32, allow_nan=True, allow_infinity=True)
anything = st.one_of(
    st.sampled_from([0.0, -0.0, np.nan, np.inf, -np.inf, 3e38, 1e-40]), st.floats(-2, 2), floats32
)
periods = st.one_of(st.sampled_from([8, 9, 15000, 65535]), st.integers(8, 15000))


class Modulator:
    def __init__(
        self, kappa=0.0, kappa_from=0.0, turn=TURN_PU, dead=0.0, period=PERIOD, alternate=False,
        pulse=0.0,
    ):  # fmt: skip
        """dead, pulse: dead time and shortest gate pulse, shares of the period."""
        self.cfg = ffi.new("ht_modulator_config *", [kappa, kappa_from, turn, alternate])
        assert lib.ht_modulator_check(self.cfg)
        self.state = unwritten("ht_modulator_state *")
        lib.ht_modulator_reset(self.state)
        self.dead = ffi.new("ht_dead_time *", [dead, 0.05])
        self.out = unwritten("ht_compare *")
        self.applied = unwritten("ht_applied *")
        self.toggles = unwritten("ht_toggles *")
        self.period, self.before = period, 0
        self.shortest = min(max(1, int(np.ceil((dead + pulse) * period - 0.01))), period // 2)
        self.counts = ffi.new("ht_period *", [period, 0, self.shortest])

    def step(self, v, i_A=(0.0,) * 6):
        """One period for the voltage [alpha, beta, x, y]; returns the voltage as it was left."""
        wanted = ffi.new("ht_vsd *", [list(v[:2]), list(v[2:])])
        currents = ffi.new("ht_six *", [list(i_A)])
        given = ffi.new("ht_modulator_input *", [self.dead, currents, self.counts, self.before])
        lib.ht_modulator_step(
            self.cfg, self.state, wanted, given, self.out, self.applied, self.toggles
        )
        self.before = self.applied.s[2]
        return np.array([wanted.ab.alpha, wanted.ab.beta, wanted.xy.x, wanted.xy.y])

    def levels(self):
        """The six legs at every count of the period: set or cleared at 0, toggled at CA, CB. A
        compare at 0 would beat the start level; one at `period` or beyond never comes."""
        counts = np.arange(self.period)
        legs = []
        for leg in range(6):
            a, b = self.out.ca[leg], self.out.cb[leg]
            assert a > 0 and b > 0
            legs.append((self.out.start >> (5 - leg) & 1) ^ (counts >= a) ^ (counts >= b))
        return np.array(legs)

    def mean(self):
        applied = self.applied
        return np.array(
            [
                applied.mean_pu.ab.alpha,
                applied.mean_pu.ab.beta,
                applied.mean_pu.xy.x,
                applied.mean_pu.xy.y,
            ]
        )


def commands(v, kappa=0.0):
    """High time of each leg: the voltage seen along the leg, plus the set's zero sequence."""
    u = 3 * T.T @ np.asarray(v, float)
    for legs in SETS:
        one = u[legs]
        centred = 0.5 - 0.5 * (one.max() + one.min())
        clamped = 1 - one.max() if -one.min() < one.max() else -one.min()
        u[legs] = one + centred + kappa * (clamped - centred)
    return u


def turned(v):
    """Set 2's carrier runs opposite to set 1's: even one of the twelve sectors from 0 degrees."""
    angle = np.degrees(np.arctan2(v[1], v[0])) % 360
    return np.hypot(v[0], v[1]) > TURN_PU and int(angle // 30) % 2 == 0


def polar(size, degrees, xy=0j):
    angle = np.deg2rad(degrees)
    return np.array([size * np.cos(angle), size * np.sin(angle), xy.real, xy.imag])


def decided(v):
    """True if in each set one leg alone has the largest command: it is the one to clamp."""
    u = 3 * T.T @ v
    return all(abs(u[legs].max() + u[legs].min()) > 1e-4 for legs in SETS)


@given(
    st.lists(st.lists(anything, min_size=4, max_size=4), min_size=1, max_size=4),
    st.lists(anything, min_size=6, max_size=6),
    st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 0.5), periods, st.booleans(),
    st.floats(0, 0.5),
)  # fmt: skip
@settings(max_examples=examples(400), deadline=None)
def test_every_input_gives_a_pattern_without_hazard(
    vs, i_A, kappa, start, turn, dead, period, alternate, pulse
):
    """Count 0 would swallow the start level; a compare at the period's last count or before is
    a toggle, at `period` none. CB is not used, so CA = CB cannot happen. Every toggle is the
    shortest pulse away from both ends, where the leg may have an edge too."""
    modulator = Modulator(kappa, start, turn, dead, period, alternate, pulse)
    for v in vs:
        before = modulator.before
        modulator.step(v, i_A)
        out, applied = modulator.out, modulator.applied
        least = modulator.shortest
        assert all(least <= a <= period - least or a == period for a in out.ca)
        assert set(out.cb) == {period}
        assert out.start <= 63
        moves = sum(1 << (5 - leg) for leg in range(6) if out.ca[leg] < period)
        assert (applied.before, applied.s[0]) == (before, out.start)
        assert applied.s[1] == applied.s[2] == out.start ^ moves == modulator.before
        assert applied.later == moves and applied.close == 0
        assert (applied.rising | applied.falling | applied.close) & 0xFFC0 == 0
        levels = modulator.levels()
        assert np.array_equal(levels[:, -1], [modulator.before >> (5 - k) & 1 for k in range(6)])
        np.testing.assert_allclose(modulator.mean(), T @ levels.mean(1), atol=1e-6)


sizes, angles = st.floats(0, 0.52), st.floats(0, 360)
small_xy = st.complex_numbers(max_magnitude=0.05)


@given(sizes, angles, small_xy, st.sampled_from([0.0, 0.4, 1.0]))
@settings(max_examples=examples(300), deadline=None)
def test_mean_voltage_is_the_command(size, degrees, xy, kappa):
    """Two periods, one with rising and one with falling edges, counted one by one. A count is
    1/7500; each of the transform's rows adds up at most two thirds of six of them by half."""
    v = polar(size, degrees, xy)
    assume(kappa == 0 or decided(v))
    modulator = Modulator(kappa)
    for _ in range(2):
        left = modulator.step(v)
        np.testing.assert_allclose(left, v, atol=1e-6)
        mean = T @ modulator.levels().mean(1)
        np.testing.assert_allclose(mean, v, atol=1.2 * 0.5 / PERIOD * 2 + 5e-5)
        wanted = commands(v, kappa)
        np.testing.assert_allclose(modulator.levels().mean(1), wanted, atol=0.51 / PERIOD + 4e-5)


def test_legs_rise_and_fall_by_turns():
    modulator = Modulator()
    v = polar(0.2, 40)
    seen = []
    for _ in range(6):
        modulator.step(v)
        seen.append((modulator.out.start, modulator.before))
    assert seen == [(0, 63), (63, 0)] * 3


EDGES = [30.0 * k for k in range(12)]


@pytest.mark.parametrize("degrees", [e + d for e in EDGES for d in (-15, -0.01, 0.01)])
def test_the_turn_goes_by_the_sector_of_the_voltage(degrees):
    v = polar(0.45, degrees)
    modulator = Modulator()
    for n in range(4):
        modulator.step(v)
        falling = n % 2 == 1
        start = (0x2A if falling else 0) | (0x15 if falling != turned(v) else 0)
        assert modulator.out.start == start


def test_the_turn_comes_from_its_voltage_on_and_goes_below_with_a_hysteresis():
    modulator = Modulator()
    found = []
    for size in (0.29, 0.299, 0.301, 0.29, 0.286, 0.284, 0.29, 0.301):
        modulator.step(polar(size, 15))
        found.append(modulator.state.opposite)
    assert found == [False, False, True, True, True, False, False, True]
    never = Modulator(turn=100.0)
    never.step(polar(0.57, 15))
    assert not never.state.opposite


def test_a_turn_puts_set_2s_edges_at_the_periods_start_and_nowhere_near_it():
    """From one sector to the next, legs of set 2 keep their sense. They then end a period high
    and begin the next one low: an edge at count 0, written as start level and no compare."""
    modulator = Modulator()
    modulator.step(polar(0.45, 29.9))  # set 1 rises, set 2 falls
    assert modulator.before == 0x2A
    modulator.step(polar(0.45, 30.1))  # both fall: set 2 goes high at once
    out, applied = modulator.out, modulator.applied
    assert out.start == 0x3F and applied.before == 0x2A
    assert min(out.ca) > 1
    assert applied.rising & 0x15 == 0x15  # at the start
    assert applied.falling == 0x3F & ~applied.close


@given(st.floats(0.001, 0.52), angles, small_xy)
@settings(max_examples=150, deadline=None)
def test_clamped_legs_stay_on_their_rail(size, degrees, xy):
    v = polar(size, degrees + 7, xy)  # at 0 degrees two legs of set 2 have equal commands
    assume(decided(v))
    modulator = Modulator(kappa=1.0)
    modulator.step(v)
    u = 3 * T.T @ v
    for legs in SETS:
        one = u[legs]
        largest = np.argmax(np.abs(one)) * 2 + legs.start
        assert modulator.out.ca[largest] == PERIOD
        assert bool(modulator.out.start >> (5 - largest) & 1) == (u[largest] > 0)


@pytest.mark.parametrize("degrees", 7.5 + 15 * np.arange(24))
@pytest.mark.parametrize("size", (0.35, 0.5))
def test_alternating_rails_are_those_with_the_least_xy_ripple(degrees, size):
    v = polar(size, degrees)
    least = least_xy_rails(v, turned(v))
    modulator = Modulator(1.0, alternate=True)
    mean = []
    for _ in range(2):  # both carriers' flanks
        modulator.step(v)
        levels = modulator.levels()
        mean.append(levels.mean(1))
        for legs, rail in zip(SETS, least):
            assert [row.all() if rail else not row.any() for row in levels[legs]].count(True) == 1
    np.testing.assert_allclose(T @ np.mean(mean, axis=0), v, atol=2e-4)


def shares_high(start, sizes, degrees):
    """(n, 6) of the period, of voltages of these sizes; kappa comes in from `start` on."""
    high = []
    for size in sizes:
        modulator = Modulator(1.0, start)
        modulator.step(polar(size, degrees))
        high.append(modulator.levels().mean(1))
    return np.array(high)


@pytest.mark.parametrize("degrees", np.arange(4, 360, 7.5))
def test_kappa_comes_without_a_jump(degrees):
    """Centred up to `kappa_from`, clamped from the end of the ramp on. In between, a leg moves
    by no more than its share of the way: half of the range that a set leaves free, and what the
    voltage itself moves it by."""
    start, ramp = 0.45, 0.02
    sizes = np.linspace(start - 0.01, start + ramp + 0.01, 321)
    high = shares_high(start, sizes, degrees)
    for size, legs in zip(sizes, high):
        if not start < size < start + ramp:
            wanted = commands(polar(size, degrees), float(size > start))
            np.testing.assert_allclose(legs, wanted, atol=0.51 / PERIOD + 4e-5)
    step = sizes[1] - sizes[0]
    most = 0.5 * (1 - 1.5 * start) * 1.1 * step / ramp + step + 2 / PERIOD
    assert np.abs(np.diff(high, axis=0)).max() < most


@given(st.floats(0.3, 0.7), angles, st.complex_numbers(min_magnitude=0.05, max_magnitude=0.5))
@settings(max_examples=examples(200), deadline=None)
def test_x_and_y_give_way_first(size, degrees, xy):
    v = polar(size, degrees, xy)
    modulator = Modulator()
    left = modulator.step(v)
    np.testing.assert_allclose(left[:2], np.float32(v[:2]))

    def ranges(share):
        u = 3 * T.T @ (v * [1, 1, share, share])
        return np.array([np.ptp(u[legs]) for legs in SETS])

    def most(share):
        return ranges(share).max()

    share = left[2:] @ v[2:] / (v[2:] @ v[2:])
    np.testing.assert_allclose(left[2:], share * v[2:], atol=1e-6)
    if most(1) <= 1 - 1e-6:
        assert share == pytest.approx(1)
    elif most(0) >= 1:  # alpha-beta alone does not fit: legs will be limited
        assert -1e-6 <= share <= 1 + 1e-6
    else:  # it fits, and so does alpha-beta as a whole
        assert -1e-6 <= share <= 1 + 1e-6 and most(share) <= 1 + 1e-5
        # A set's range is convex in the share, so each set allows this much at least.
        none, all_of_it = ranges(0), ranges(1)
        allowed = [(1 - a) / (b - a) for a, b in zip(none, all_of_it) if b > 1]
        assert share >= min(allowed, default=1) - 1e-4
        mean = T @ modulator.levels().mean(1)
        np.testing.assert_allclose(mean[:2], v[:2], atol=3e-4)


def test_six_legs_on_rails_far_beyond_the_reach():
    """Twelve-step operation: the large vector in the voltage's direction."""
    large = (48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49)
    for k, word in enumerate(large):
        modulator = Modulator()
        modulator.step(polar(30.0, 15 + 30 * k))
        assert modulator.out.start == word and set(modulator.out.ca) == {PERIOD}


@pytest.mark.parametrize(
    "i_A",
    (5.0, 0.02, 0.0, -0.03, -5.0, (5, -5, 0.02, -0.03, 0, -0.01), (-0.02, 0.04, -5, 5, 0.01, 5)),
)
def test_dead_time_is_made_up_for(i_A):
    """Mean of a rising and a falling period: all legs' edges late by the dead time where the
    current opposes them, in part around zero. What is commanded is what the legs make."""
    dead = 0.023
    modulator = Modulator(dead=dead)
    v = polar(0.25, 70, 0.01 + 0.02j)
    currents_A = np.broadcast_to(i_A, 6)
    share = np.clip(0.5 + 0.5 * currents_A / 0.05, 0, 1)
    high = np.zeros(6)
    for rising in (True, False):
        modulator.step(v, currents_A)
        late = dead * (share if rising else 1 - share)
        high += modulator.levels().mean(1) + (-late if rising else late)
    np.testing.assert_allclose(T @ high / 2, v, atol=2e-4)
    # Not only in the plane of the sum: every leg has its own time.
    np.testing.assert_allclose(high / 2, commands(v), atol=2e-4)


@pytest.mark.parametrize("at", range(3))
@pytest.mark.parametrize("wrong", (-0.1, np.nan))
def test_values_out_of_range_are_refused(at, wrong):
    values = [0.5, 0.5, 0.3]
    values[at] = wrong
    assert not lib.ht_modulator_check(ffi.new("ht_modulator_config *", values))
    assert not lib.ht_modulator_check(ffi.new("ht_modulator_config *", [1.1, 0.5, 0.3]))


def volt_seconds(modulator, slots, i_A, carry):
    """Mean voltage of the modulator's latest period as the firmware reckons it."""
    applied = modulator.applied
    applied.own = 2
    slots[1] = modulator.toggles[0]
    flow = lib.ht_flow_of(i_A, modulator.dead)
    flow = lib.ht_flow_at_edges(applied, flow, flow)
    v = lib.ht_volt_seconds(applied, slots, modulator.dead, flow, i_A, i_A, carry, carry, True)
    return [v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y]


@given(
    st.lists(st.tuples(st.floats(0, 0.7), angles, small_xy), min_size=2, max_size=8),
    st.lists(st.booleans(), min_size=6, max_size=6),
    st.sampled_from([0.0, 0.6, 1.0]),
    st.one_of(st.sampled_from([0.0, 0.05]), st.floats(0, 0.2)),
)
@settings(max_examples=examples(300), deadline=None)
def test_volt_seconds_of_modulated_periods(vs, outward, kappa, dead):
    """Every leg is followed through all periods, its edges late by the dead time where the
    current opposes them, across the periods' ends, with turns in between."""
    modulator = Modulator(kappa, 0.0, TURN_PU, dead)
    slots, carry = ffi.new("ht_toggles[2]"), ffi.new("ht_carry *")
    i_A = ffi.new("ht_six *", [[20.0 if out else -20.0 for out in outward]])
    got, edges = [], [[] for _ in range(6)]
    for n, (size, degrees, xy) in enumerate(vs):
        modulator.step(polar(size, degrees, xy), list(i_A.p))
        got.append(volt_seconds(modulator, slots, i_A, carry))
        levels = modulator.levels()
        for leg, own in enumerate(edges):
            own.append((n, int(levels[leg, 0])))
            own.append((n + modulator.out.ca[leg] / PERIOD, int(levels[leg, -1])))
    on = [follow_leg(own, np.float32(dead), outward[leg], len(vs)) for leg, own in enumerate(edges)]
    np.testing.assert_allclose(got, (T @ on).T, atol=2e-6)


#: Continuous space-vector modulation with 24 sectors: the states of half a carrier period in the
#: sectors 0..15, 15..30, 30..45 and 45..60 degrees (Eldeeb, dissertation, TU Munich 2019, table
#: 3.III; a1, the least significant bit, b1, c1, a2, b2, c2), and the zero state that ends it. The
#: rest follows by turns of 60 degrees. The second and the last but one are the same vector, and
#: share its time evenly.
SEQUENCES = (
    (56, 40, 41, 9, 11, 15, 7),
    (56, 57, 41, 9, 11, 3, 7),
    (0, 1, 9, 11, 27, 59, 63),
    (0, 8, 9, 11, 27, 31, 63),
)
#: Bit of each of our legs u1 u2 w1 w2 v1 v2 there.
BITS = (0, 3, 1, 4, 2, 5)


def words_of(sector):
    """The words of a sector of 24. Turned by 60 degrees, a leg takes over from one of its set,
    negated."""
    turns, first = divmod(sector, 4)
    levels = np.array([[word >> bit & 1 for bit in range(6)] for word in SEQUENCES[first]])
    for _ in range(turns):
        levels = 1 - levels[:, [1, 2, 0, 4, 5, 3]]
    return (levels << np.arange(6)).sum(1)


@pytest.mark.parametrize("sector", range(24))
@pytest.mark.parametrize("size", [0.1, 0.35, 0.55])
def test_centred_and_turned_is_24_sector_modulation(sector, size):
    modulator = Modulator(turn=0.0, period=60000)
    v = polar(size, 15 * sector + 6.0)
    modulator.step(v)
    levels = modulator.levels()
    words = (levels.T << np.array(BITS)).sum(1)
    starts = np.flatnonzero(np.diff(words, prepend=-1))
    times = np.diff(np.append(starts, len(words)))
    found = words[starts]
    expected = words_of(sector)
    if found[0] != expected[0]:  # the other half of the carrier's period
        found, times = found[::-1], times[::-1]
    assert list(found) == list(expected)
    assert abs(times[1] - times[-2]) <= 2 and abs(times[0] - times[-1]) <= 2
