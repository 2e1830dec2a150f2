"""ht_pattern against the hardware it is for.

Counts: a model of the up-counter with set/clear at zero and toggle at CA and CB
(one action per count, CBU before CAU before ZERO) must reproduce S1 S2 S3.
Volt-seconds: each leg's voltage is followed edge by edge in double precision
through several periods, with the dead time acting as a delay that a reversed
command cancels.
"""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

LEGS = range(6)
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3

VIRTUAL = [
    tuple(lib.ht_group[group][(k + d) % 12] for d in (-1, 0, 1))
    for group in (lib.HT_L, lib.HT_ML)
    for k in range(12)
]
SINGLE = [(w, w, w) for g in range(3) for w in lib.ht_group[g]] + [
    (z,) * 3 for z in (0, 21, 42, 63)
]

words = st.integers(0, 63)
triples = st.one_of(
    st.sampled_from(VIRTUAL), st.sampled_from(SINGLE), st.tuples(words, words, words)
)
points = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1, width=32))
ordered = st.tuples(points, points).map(sorted)
periods = st.one_of(st.sampled_from([8, 9, 15000, 65535]), st.integers(8, 15000))


def bit(word, leg):
    return word >> (5 - leg) & 1


def counts(s, t1, t2, period, first=0):
    out, applied = ffi.new("ht_compare *"), ffi.new("ht_applied *")
    lib.ht_pattern_counts(s, {"t1": t1, "t2": t2}, period, first, out, applied)
    return out, applied


def leg_edges(out, leg, period, first):
    """(count, level) of one period of the counter, the level before it unknown.

    A dict keeps the last action at a count: written in rising priority, it is
    what the action qualifier does. Counts from `period` on are never reached.
    """
    action = {first: "start", out.ca[leg]: "toggle", out.cb[leg]: "toggle"}
    level = "lost"
    edges = []
    for count in sorted(action):
        if count >= period:
            break
        if action[count] == "start":
            level = bit(out.start, leg)
        else:
            assert level != "lost", "a toggle swallowed the start level"
            level = 1 - level
        edges.append((count, level))
    return edges


def check_counts(s, t1, t2, period, first):
    out, applied = counts(s, t1, t2, period, first)
    used = {1: set(), 2: set()}
    for leg in LEGS:
        edges = leg_edges(out, leg, period, first)
        want = [bit(w, leg) for w in s]
        assert edges[0] == (first, want[0])
        changes = [i for i in (1, 2) if want[i] != want[i - 1]]
        assert [level for _, level in edges[1:]] == [want[i] for i in changes]
        for i, (count, _) in zip(changes, edges[1:], strict=True):
            used[i].add(count)
    assert len(used[1]) <= 1 and len(used[2]) <= 1  # all legs switch together

    c1, c2 = (round(applied.t[i] * period) for i in (1, 2))
    assert first < c1 < c2 < period
    assert applied.t[0] == pytest.approx(first / period, rel=1e-6, abs=1e-9)
    assert used[1] <= {c1} and used[2] <= {c2}
    assert tuple(applied.s) == tuple(s)
    for c, t, low, high in ((c1, t1, first + 1, period - 2), (c2, t2, c1 + 1, period - 1)):
        target = first + t * period
        inside = low <= target <= high
        assert abs(c - min(target, period)) <= (0.51 if inside else 2.0)


@pytest.mark.parametrize("s", VIRTUAL + SINGLE)
def test_every_pattern_of_the_schemes(s):
    rng = np.random.default_rng(sum(s))
    corners = [(0, 0), (0, 1), (1, 1), (0, 0.5), (0.5, 0.5), (0.5, 1)]
    for period in (8, 9, 100, 10000, 15000):
        for t1, t2 in corners + [sorted(p) for p in rng.uniform(0, 1, (5, 2))]:
            check_counts(s, t1, t2, period, 0)


@given(triples, ordered, periods)
@settings(max_examples=250, deadline=None)
def test_shadow_load(s, t, period):
    check_counts(s, *t, period, 0)


@given(triples, ordered, periods, st.floats(0, 0.9))
@settings(max_examples=250, deadline=None)
def test_immediate_load(s, t, period, share):
    check_counts(s, *t, period, min(int(share * period), period - 4))


def test_paper_a_equations_17_18():
    """Fixed duties of the first virtual vector at TBPRD + 1 = 15000."""
    out, _ = counts(VIRTUAL[0], 2 - np.sqrt(3), np.sqrt(3) - 1, 15000)
    assert out.start == 49
    assert list(out.ca) == [15000, 15000, 15000, 15000, 15000, 4019]
    assert list(out.cb) == [15000, 15000, 10981, 15000, 15000, 15000]


def test_unused_registers_hold_the_period():
    for s1 in range(64):
        out, _ = counts((s1, 63 - s1, 63 - s1), 0.5, 0.5, 100)
        assert list(out.cb) == [100] * 6
        assert list(out.ca) == [50] * 6


# --- volt-seconds ---------------------------------------------------------


def follow_leg(commands, dead, outward, end):
    """Exact upper-level intervals of a leg: `commands` = [(time, level), ...] in
    order, all legs low before. While both switches are off the current decides:
    flowing out it holds the leg low, flowing in it holds it high."""
    edges, level, pending = [], 0, None
    for time, command in [*commands, (np.inf, None)]:
        if pending is not None and pending <= time:
            level = 1 - level
            edges.append((pending, level))
            pending = None
        if command is None:
            break
        if pending is not None and command == level:
            pending = None  # switched back before the delay was over
        elif pending is None and command != level:
            late = dead if bool(command) == outward else 0.0
            pending = time + late
            if late == 0.0:
                level, pending = command, None
                edges.append((time, level))
    on = np.zeros(end)
    for n in range(end):
        knots = [(-1.0, 0), *edges, (np.inf, None)]
        for (a, state), (b, _) in itertools.pairwise(knots):
            if state:
                on[n] += max(0.0, min(b, n + 1) - max(a, n))
    return on


def applied_sequence(patterns, period, first):
    """ht_applied of consecutive periods, all legs low before the first."""
    before, sequence = 0, []
    for s, (t1, t2) in patterns:
        _, applied = counts(s, t1, t2, period, first)
        applied.before, before = before, s[2]
        sequence.append(applied)
    return sequence


def compare_volt_seconds(patterns, outward, dead, period, first=0):
    sequence = applied_sequence(patterns, period, first)
    current = {"p": [20.0 if out else -20.0 for out in outward]}
    config = {"dead_pu": dead, "inv_2i_zero": 10.0}
    spill = ffi.new("ht_spill *")
    got = []
    for applied in sequence:
        v = lib.ht_volt_seconds(applied, [config], [current], [current], spill)
        got.append([v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y])
    on = np.empty((6, len(sequence)))
    for leg in LEGS:
        commands = [
            (n + a.t[e], bit(a.s[e], leg)) for n, a in enumerate(sequence) for e in range(3)
        ]
        on[leg] = follow_leg(commands, np.float32(dead), outward[leg], len(sequence))
    want = (T @ on).T
    np.testing.assert_allclose(got, want, atol=1e-6)  # each period on its own
    np.testing.assert_allclose(np.sum(got, axis=0), want.sum(axis=0), atol=3e-6)


signs = st.lists(st.booleans(), min_size=6, max_size=6)
dead_times = st.one_of(st.sampled_from([0.0, 0.05]), st.floats(0, 0.05))
#: action points with pulses about as long as the dead time, also across periods
short = st.floats(0, 0.06)
tight = st.one_of(
    ordered,
    st.tuples(short, short).map(sorted),
    st.tuples(short, short).map(lambda t: sorted(1 - x for x in t)),
    st.tuples(short, short).map(lambda t: [t[0], 1 - t[1]]),
    st.tuples(points, short).map(lambda t: [t[0] * 0.9, t[0] * 0.9 + t[1]]),
)
sequences = st.lists(st.tuples(triples, tight), min_size=1, max_size=6)


@given(sequences, signs, dead_times)
@settings(max_examples=400, deadline=None)
def test_volt_seconds_shadow(patterns, outward, dead):
    compare_volt_seconds(patterns, outward, dead, 10000)


@given(sequences, signs, dead_times, st.integers(0, 4999))
@settings(max_examples=300, deadline=None)
def test_volt_seconds_immediate(patterns, outward, dead, first):
    compare_volt_seconds(patterns, outward, dead, 10000, first)


@pytest.mark.parametrize("outward", (True, False))
def test_delay_that_ends_in_the_next_period(outward):
    """An edge 1 % before the period's end, 5 % dead time: 4 % spill over."""
    patterns = [((0, 0, 32), (0.5, 0.99)), ((32, 32, 0), (0.5, 0.99)), ((0, 0, 0), (1, 1))]
    compare_volt_seconds(patterns, [outward] * 6, 0.05, 10000)


@pytest.mark.parametrize("outward", (True, False))
@pytest.mark.parametrize(
    "back", (((32, 32, 32), (1, 1)), ((32, 0, 0), (0.02, 0.5)), ((32, 32, 0), (0.01, 0.02)))
)
def test_delay_that_a_later_edge_of_the_next_period_cancels(back, outward):
    """The leg is switched back 2 % into the next period, before its 4 % are over."""
    s, t = back
    compare_volt_seconds([((0, 0, 32), (0.5, 0.99)), back], [outward] * 6, 0.05, 10000)
    mirrored = (tuple(32 - w for w in s), t)
    compare_volt_seconds(
        [((32, 32, 32), (1, 1)), ((32, 32, 0), (0.5, 0.99)), mirrored], [outward] * 6, 0.05, 10000
    )


def mean_on_u1(applied, dead, i_begin, i_end):
    spill = ffi.new("ht_spill *")
    begin, end = {"p": [i_begin] * 6}, {"p": [i_end] * 6}
    v = lib.ht_volt_seconds(applied, [dead], [begin], [end], spill)
    return (v.ab.alpha + v.xy.x) * 1.5  # only u1 switches


def test_small_currents_shift_in_part_and_current_is_interpolated():
    _, applied = counts((0, 32, 32), 0.25, 0.5, 10000)
    dead = {"dead_pu": 0.04, "inv_2i_zero": 1 / (2 * 0.5)}
    for i, late in ((-1, 0), (-0.5, 0), (-0.25, 0.25), (0, 0.5), (0.25, 0.75), (0.5, 1), (1, 1)):
        assert mean_on_u1(applied, dead, i, i) == pytest.approx(0.75 - 0.04 * late, abs=1e-6)
    # 0.2 A at the edge, a quarter into the period
    late = 0.5 + 0.2
    assert mean_on_u1(applied, dead, 0.3, -0.1) == pytest.approx(0.75 - 0.04 * late, abs=1e-6)


def test_no_dead_time_gives_the_commanded_volt_seconds():
    for s in VIRTUAL:
        _, applied = counts(s, 0.3, 0.6, 10000)
        applied.before = s[0]
        spill = ffi.new("ht_spill *")
        six = {"p": [1.0, -2.0, 3.0, -4.0, 5.0, -6.0]}
        v = lib.ht_volt_seconds(applied, [{"dead_pu": 0, "inv_2i_zero": 10}], [six], [six], spill)
        legs = np.array([[bit(w, leg) for leg in LEGS] for w in s])
        want = T @ (np.array([0.3, 0.3, 0.4]) @ legs)
        np.testing.assert_allclose([v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y], want, atol=3e-7)
        assert spill.legs == 0
