"""ht_pattern is compared with the hardware.

Counts: a model of the up-counter with set/clear at zero and toggle at CA and CB (one action per
count, CBU before CAU before ZERO) must reproduce S1 S2 S3. Volt-seconds: each leg's voltage is
followed edge by edge in double precision through several periods. The dead time acts as a delay,
and a reversed command cancels it.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from legs import follow_leg
from unwritten import unwritten

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


def counts(s, t1, t2, period, first=0, shortest=1):
    out, applied = unwritten("ht_compare *"), ffi.new("ht_applied *")
    lib.ht_pattern_counts(
        s, {"t1": t1, "t2": t2}, [{"counts": period, "first": first, "shortest": shortest}], out,
        applied,
    )  # fmt: skip
    return out, applied


def leg_edges(out, leg, period, first):
    """(count, level) of one period of the counter. The level before it is unknown.

    A dict keeps the last action at a count. The actions are written in rising priority, so this is
    the action that the qualifier performs. Counts from `period` on are never reached.
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


def check_counts(s, t1, t2, period, first, shortest=1):
    out, applied = counts(s, t1, t2, period, first, shortest)
    played = tuple(applied.s)  # what became of the words
    used = {1: set(), 2: set()}
    for leg in LEGS:
        edges = leg_edges(out, leg, period, first)
        want = [bit(w, leg) for w in played]
        assert edges[0] == (first, want[0])
        changes = [i for i in (1, 2) if want[i] != want[i - 1]]
        assert [level for _, level in edges[1:]] == [want[i] for i in changes]
        for i, (count, _) in zip(changes, edges[1:], strict=True):
            used[i].add(count)
        at = [count for count, _ in edges] + [period]
        assert min(np.diff(at)) >= shortest  # every pulse, whatever the next period begins with
    assert len(used[1]) <= 1 and len(used[2]) <= 1  # all legs switch together

    assert applied.t[0] == pytest.approx(first / period, rel=1e-6, abs=1e-9)
    if played[0] == played[1] == played[2]:
        assert (applied.t[1], applied.t[2]) == (1, 1) and not used[1] | used[2]
    else:
        c1, c2 = (round(applied.t[i] * period) for i in (1, 2))
        assert used[1] <= {c1} and used[2] <= {c2}
    target = [first, *(min(first + t * period, period) for t in (t1, t2)), period]
    if min(np.diff(target)) >= shortest + 1:  # each word has its time
        assert played == tuple(s)
        if len(set(s)) > 1:
            assert (c1, c2) == pytest.approx(target[1:3], abs=0.51)
    return played


@pytest.mark.parametrize("s", VIRTUAL + SINGLE)
def test_counts_give_every_pattern_of_the_schemes(s):
    rng = np.random.default_rng(sum(s))
    corners = [(0, 0), (0, 1), (1, 1), (0, 0.5), (0.5, 0.5), (0.5, 1)]
    for period in (8, 9, 100, 10000, 15000):
        for t1, t2 in corners + [sorted(p) for p in rng.uniform(0, 1, (5, 2))]:
            for shortest in (1, period // 3, period // 2):
                check_counts(s, t1, t2, period, 0, shortest)


def shortest_from(share, period, first=0):
    return max(1, int(share * (period - first) / 2))


@given(triples, ordered, periods, st.floats(0, 1))
@settings(max_examples=examples(250), deadline=None)
def test_counts_give_the_pattern_with_shadow_load(s, t, period, share):
    check_counts(s, *t, period, 0, shortest_from(share, period))


@given(triples, ordered, periods, st.floats(0, 0.49), st.floats(0, 1))
@settings(max_examples=examples(250), deadline=None)
def test_counts_give_the_pattern_with_immediate_load(s, t, period, late, share):
    first = int(late * period)
    check_counts(s, *t, period, first, shortest_from(share, period, first))


@pytest.mark.parametrize(
    ("t", "words", "instants"),
    (
        ((0.26, 0.7), (1, 2, 3), (0.4, 0.7)),  # the first word: lengthened, left out
        ((0.24, 0.7), (2, 2, 3), (0.1, 0.7)),
        ((0.3, 0.78), (1, 2, 3), (0.4, 0.7)),  # the last word
        ((0.5, 0.88), (1, 2, 2), (0.5, 0.5)),
        ((0.45, 0.75), (1, 2, 3), (0.4, 0.7)),  # the second word, which the first makes room for
        ((0.55, 0.65), (1, 3, 3), (0.65, 0.65)),
        ((0.05, 0.1), (3, 3, 3), (1.0, 1.0)),  # two words that are too short
        ((0.9, 0.95), (1, 1, 1), (1.0, 1.0)),
    ),
)
def test_a_word_that_is_too_short_is_lengthened_or_left_out_whichever_is_nearer(t, words, instants):
    """The shortest pulse is 30 % of a period, which begins at 10 %."""
    t = [x - 0.1 for x in t]  # the action points count from there
    _, applied = counts((1, 2, 3), *t, 10000, 1000, 3000)
    assert tuple(applied.s) == words
    assert (applied.t[1], applied.t[2]) == pytest.approx(instants, abs=1e-4)


def test_counts_of_fixed_duties_are_those_of_paper_a_equations_17_18():
    """The fixed duties of the first virtual vector at TBPRD + 1 = 15000."""
    out, _ = counts(VIRTUAL[0], 2 - np.sqrt(3), np.sqrt(3) - 1, 15000)
    assert out.start == 49
    assert list(out.ca) == [15000, 15000, 15000, 15000, 15000, 4019]
    assert list(out.cb) == [15000, 15000, 10981, 15000, 15000, 15000]


def test_unused_registers_hold_the_period():
    for s1 in range(64):
        out, _ = counts((s1, 63 - s1, 63 - s1), 0.5, 0.5, 100)  # one instant: from s1 to 63 - s1
        assert list(out.cb) == [100] * 6
        assert list(out.ca) == [50] * 6


# --- volt-seconds ---------------------------------------------------------


def volt_seconds(applied, dead, i_begin, i_end, carry, xy=True):
    """The mean voltage alpha, beta, x, y. `carry` is input and output."""
    begin, end = ffi.new("ht_six *", {"p": i_begin}), ffi.new("ht_six *", {"p": i_end})
    flow = lib.ht_flow_at_edges(applied, *(lib.ht_flow_of(i, dead) for i in (begin, end)))
    v = lib.ht_volt_seconds(applied, ffi.NULL, dead, flow, begin, end, carry, carry, xy)
    return [v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y]


def applied_sequence(patterns, dead, period, first):
    """The ht_applied of consecutive periods. All legs are low before the first."""
    before, sequence = 0, []
    for s, (t1, t2) in patterns:
        _, applied = counts(s, t1, t2, period, first)
        lib.ht_applied_finish(applied, before, [{"dead_pu": dead}])
        before = applied.s[2]
        sequence.append(applied)
    return sequence


def compare_volt_seconds(patterns, outward, dead, period, first=0):
    sequence = applied_sequence(patterns, dead, period, first)
    config = ffi.new("ht_dead_time *", {"dead_pu": dead, "i_zero_A": 0.05})
    current = [20.0 if out else -20.0 for out in outward]
    carry = ffi.new("ht_carry *")
    got = []
    for applied in sequence:
        got.append(volt_seconds(applied, config, current, current, carry))
    on = np.empty((6, len(sequence)))
    for leg in LEGS:
        commands = [
            (n + a.t[e], bit(a.s[e], leg)) for n, a in enumerate(sequence) for e in range(3)
        ]
        on[leg] = follow_leg(commands, np.float32(dead), outward[leg], len(sequence))
    want = (T @ on).T
    np.testing.assert_allclose(got, want, atol=1e-6)  # each period is independent
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
@settings(max_examples=examples(400), deadline=None)
def test_volt_seconds_with_shadow_load_follow_every_edge(patterns, outward, dead):
    compare_volt_seconds(patterns, outward, dead, 10000)


@given(sequences, signs, dead_times, st.integers(0, 4999))
@settings(max_examples=examples(300), deadline=None)
def test_volt_seconds_with_immediate_load_follow_every_edge(patterns, outward, dead, first):
    compare_volt_seconds(patterns, outward, dead, 10000, first)


@pytest.mark.parametrize("outward", (True, False))
def test_delay_that_ends_in_the_next_period(outward):
    """An edge is 1 % before the period's end, and the dead time is 5 %. So 4 % continue in the next
    period."""
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
    lib.ht_applied_finish(applied, applied.before, dead)
    v = volt_seconds(applied, dead, [i_begin] * 6, [i_end] * 6, ffi.new("ht_carry *"))
    return (v[0] + v[2]) * 1.5  # only u1 switches


def test_small_currents_shift_in_part_and_current_is_interpolated():
    _, applied = counts((0, 32, 32), 0.25, 0.5, 10000)
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.04, "i_zero_A": 0.5})
    for i, late in ((-1, 0), (-0.5, 0), (-0.25, 0.25), (0, 0.5), (0.25, 0.75), (0.5, 1), (1, 1)):
        assert mean_on_u1(applied, dead, i, i) == pytest.approx(0.75 - 0.04 * late, abs=1e-6)
    # 0.2 A at the edge, a quarter into the period
    late = 0.5 + 0.2
    assert mean_on_u1(applied, dead, 0.3, -0.1) == pytest.approx(0.75 - 0.04 * late, abs=1e-6)


def test_no_dead_time_gives_the_commanded_volt_seconds():
    for s in VIRTUAL:
        _, applied = counts(s, 0.3, 0.6, 10000)
        dead = ffi.new("ht_dead_time *", {"dead_pu": 0, "i_zero_A": 0.05})
        lib.ht_applied_finish(applied, s[0], dead)
        carry = ffi.new("ht_carry *")
        six = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0]
        v = volt_seconds(applied, dead, six, six, carry)
        legs = np.array([[bit(w, leg) for leg in LEGS] for w in s])
        want = T @ (np.array([0.3, 0.3, 0.4]) @ legs)
        np.testing.assert_allclose(v, want, atol=3e-7)
        assert carry.legs == 0


def mean_levels(sequence, leg, dead, i_zero, current):
    """The share of each period in which a leg is high. current[n] and current[n + 1] are its
    current at the ends of period n. An edge is late by the dead time times the share of current
    that opposes it, but no later than the leg's next edge. A delay that remains at the period's end
    continues until the leg's first edge in the next period."""
    means, left = [], 0.0
    for a, begin, end in zip(sequence, current, current[1:]):
        levels = [bit(w, leg) for w in (a.before, *a.s)]
        knots = [0.0, *a.t, 1.0]
        high = sum(level * (q - p) for level, p, q in zip(levels, knots, knots[1:]))
        edges = [(a.t[e], levels[e + 1]) for e in range(3) if levels[e + 1] != levels[e]]
        ends = [t for t, _ in edges[1:]] + [1.0]
        late = min(left, edges[0][0] if edges else 1.0)
        high -= late if levels[0] else -late
        left = 0.0
        for (t, level), until in zip(edges, ends):
            outward = np.clip(0.5 + 0.5 * (begin + t * (end - begin)) / i_zero, 0, 1)
            late = dead * (outward if level else 1 - outward)
            if until == 1.0:
                left = max(0.0, late - (1 - t))
            late = min(late, until - t)
            high -= late if level else -late
        means.append(high)
    return means


amperes = st.one_of(
    st.sampled_from([-5.0, -0.05, 0.0, 0.05, 5.0]), st.floats(-0.25, 0.25, width=32)
)
six_amperes = st.lists(amperes, min_size=6, max_size=6)


@given(sequences, st.lists(six_amperes, min_size=7, max_size=7), dead_times, st.integers(0, 4999))
@settings(max_examples=examples(400), deadline=None)
def test_volt_seconds_are_right_for_any_currents(patterns, currents, dead, first):
    """Legs with a clear current direction, legs with currents around zero, and legs with short
    pulses, under shadow load (first = 0) and immediate load."""
    for start in (0, first):
        sequence = applied_sequence(patterns, dead, 10000, start)
        config = ffi.new("ht_dead_time *", {"dead_pu": dead, "i_zero_A": 0.05})
        carry = ffi.new("ht_carry *")
        got = [
            volt_seconds(a, config, currents[n], currents[n + 1], carry)
            for n, a in enumerate(sequence)
        ]
        current = np.float32(currents[: len(sequence) + 1]).T.astype(float)
        i_zero = float(np.float32(0.05))
        means = [
            mean_levels(sequence, leg, float(np.float32(dead)), i_zero, current[leg])
            for leg in LEGS
        ]
        np.testing.assert_allclose(got, (T @ means).T, atol=2e-6)


@given(sequences, six_amperes)
@settings(max_examples=60, deadline=None)
def test_without_x_and_y_alpha_and_beta_are_the_same(patterns, current):
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.05, "i_zero_A": 0.05})
    carries = ffi.new("ht_carry[2]")
    for a in applied_sequence(patterns, 0.05, 10000, 0):
        whole = volt_seconds(a, dead, current, current, carries + 0)
        half = volt_seconds(a, dead, current, current, carries + 1, xy=False)
        assert half[:2] == whole[:2]


def test_a_prediction_does_not_change_the_stored_delay():
    """`left` and `over` are different objects, so the stored delay stays for the period itself."""
    late, back = applied_sequence(
        [((0, 0, 32), (0.5, 0.99)), ((32, 32, 0), (0.5, 0.99))], 0.05, 10000, 0
    )
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.05, "i_zero_A": 0.05})
    begin = ffi.new("ht_six *", {"p": [5.0] * 6})
    left, over = ffi.new("ht_carry *"), ffi.new("ht_carry *")
    flow = lib.ht_flow_of(begin, dead)
    lib.ht_volt_seconds(late, ffi.NULL, dead, flow, begin, begin, left, left, True)
    assert left.legs == 32 and left.shift[0] == pytest.approx(0.04, abs=1e-6)
    before = bytes(ffi.buffer(left))
    ahead = lib.ht_volt_seconds(back, ffi.NULL, dead, flow, begin, begin, left, over, True)
    assert bytes(ffi.buffer(left)) == before and over.legs == 0
    now = lib.ht_volt_seconds(back, ffi.NULL, dead, flow, begin, begin, left, left, True)
    assert bytes(ffi.buffer(ffi.new("ht_vsd *", ahead))) == bytes(
        ffi.buffer(ffi.new("ht_vsd *", now))
    )
    assert left.legs == 0
    (plain,) = applied_sequence([((0, 32, 32), (0.5, 0.9))], 0.05, 10000, 0)
    for pattern in (back, plain):  # if no delay remains, `over` is cleared
        over.legs = 63
        lib.ht_volt_seconds(pattern, ffi.NULL, dead, flow, begin, begin, left, over, True)
        assert over.legs == 0


@settings(max_examples=examples(200))
@given(st.tuples(words, words, words, words), st.lists(points, min_size=3, max_size=3), points)
def test_high_is_the_share_of_the_period_in_which_a_leg_is_high(pattern, instants, own):
    """Counted at 4000 instants. With `own` each leg has one instant of its own."""
    applied, high = ffi.new("ht_applied *"), unwritten("ht_six *")
    toggles = ffi.new("ht_toggles[2]")
    applied.before, applied.s = pattern[0], pattern[1:]
    applied.t = sorted(instants)
    at = (np.arange(4000) + 0.5) / 4000
    for n in (0, 2):
        applied.own = n
        t = np.array([list(applied.t)] * 6)
        if n:
            applied.s[2] = applied.s[1]
            t[:, 1] = applied.t[0] + (applied.t[2] - applied.t[0]) * own * np.arange(6) / 5
            toggles[1].t = list(t[:, 1])
        lib.ht_applied_high(applied, toggles, high)
        now = [pattern[0], *applied.s]
        for leg in LEGS:
            level = np.array([bit(word, leg) for word in now])[np.searchsorted(t[leg], at)]
            assert high.p[leg] == pytest.approx(level.mean(), abs=1e-3)


def test_current_flow_is_the_part_above_the_zero_current():
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.02, "i_zero_A": 0.25})
    flow = lib.ht_flow_of([{"p": [0.25, 0.249, -0.249, -0.25, 9.0, -9.0]}], dead)
    assert (flow.out, getattr(flow, "in")) == (0b100010, 0b000101)
    nothing = lib.ht_flow_of([{"p": [np.nan] * 6}], dead)
    assert (nothing.out, getattr(nothing, "in")) == (0, 0)


def test_edges_at_the_start_use_the_currents_at_the_start():
    """If the only edges of a leg are at the start, it does not matter that its current changes sign
    later."""
    dead = ffi.new("ht_dead_time *", {"dead_pu": 0.02, "i_zero_A": 0.25})
    out, none, into = ({"out": o, "in": i} for o, i in ((63, 0), (0, 0), (0, 63)))
    for first, later in ((0, 0b000011), (100, 0b110011)):
        _, applied = counts((0b110000, 0b110001, 0b110011), 0.3, 0.6, 10000, first)
        lib.ht_applied_finish(applied, 0, dead)  # u1, u2 at the start, v2 and v1 later
        for begin, end in ((out, none), (out, into), (into, none), (into, out)):
            flow = lib.ht_flow_at_edges(applied, begin, end)
            assert flow.out == (63 & ~later if begin is out else 0)
            assert getattr(flow, "in") == (63 & ~later if begin is into else 0)
        flow = lib.ht_flow_at_edges(applied, none, out)
        assert (flow.out, getattr(flow, "in")) == (0, 0)
