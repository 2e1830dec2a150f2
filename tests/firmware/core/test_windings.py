"""Windings whose sets are 0 or 60 degrees apart, against geometry in double precision: the planes
of each of the 64 states, sectors and directions, and modulation that leaves nothing in x-y.

With the sets' vectors s1 and s2 in the stator's axes, alpha + j beta = (s1 + s2)/2 and
x - j y = (s1 - s2)/2.
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

DISPLACEMENT_DEG = {lib.HT_WINDING_30: 30, lib.HT_WINDING_0: 0, lib.HT_WINDING_60: 60}
ALIKE = (lib.HT_WINDING_0, lib.HT_WINDING_60)
LARGE = {lib.HT_WINDING_0: lib.HT_L0, lib.HT_WINDING_60: lib.HT_L60}
PERIOD = 7500
WORDS = np.array([[word >> (5 - leg) & 1 for leg in range(6)] for word in range(64)])


def angles(winding):
    return np.deg2rad([0, 0, 120, 120, 240, 240] + DISPLACEMENT_DEG[winding] * np.array([0, 1] * 3))


def planes(winding, six):
    """alpha + j beta and x + j y by their definition."""
    parts = 2 / 3 * np.asarray(six) * np.exp(1j * angles(winding))
    s1, s2 = parts[..., ::2].sum(-1), parts[..., 1::2].sum(-1)
    return (s1 + s2) / 2, np.conj(s1 - s2) / 2


def complex_of(v):
    return complex(v.ab.alpha, v.ab.beta), complex(v.xy.x, v.xy.y)


@pytest.mark.parametrize("winding", DISPLACEMENT_DEG)
def test_every_state_has_the_vector_of_its_winding(winding):
    for word, levels in enumerate(WORDS):
        want = planes(winding, levels)
        for v in (lib.ht_vector[word], lib.ht_vsd_from_six([{"p": levels.tolist()}])):
            assert complex_of(lib.ht_vsd_turned(winding, v)) == pytest.approx(want, abs=2e-7)


@pytest.mark.parametrize("winding", DISPLACEMENT_DEG)
def test_every_leg_has_the_column_of_its_winding(winding):
    for leg, one in enumerate(np.eye(6)):
        want = planes(winding, one)
        assert complex_of(lib.ht_transform[winding][leg]) == pytest.approx(want, abs=3e-8)


@pytest.mark.parametrize("winding", DISPLACEMENT_DEG)
def test_currents_of_any_size(winding):
    for six in np.random.default_rng(1).normal(0, 20, (50, 6)):
        got = lib.ht_vsd_turned(winding, lib.ht_vsd_from_six([{"p": six.tolist()}]))
        assert complex_of(got) == pytest.approx(planes(winding, six), abs=3e-5)


@pytest.mark.parametrize("winding", ALIKE)
def test_large_vectors_have_nothing_in_xy(winding):
    ab, xy = planes(winding, WORDS)
    alike = {word for word in range(64) if abs(xy[word]) < 1e-9 and abs(ab[word]) > 1e-9}
    assert max(abs(ab)) == pytest.approx(2 / 3) == pytest.approx(lib.ht_longest_pu(winding))
    words = list(lib.ht_group[LARGE[winding]])
    assert set(words) == alike and len(alike) == 6
    for k, word in enumerate(words):
        assert ab[word] == pytest.approx(2 / 3 * np.exp(1j * np.pi / 3 * (k // 2)))


@pytest.mark.parametrize("winding", ALIKE)
@pytest.mark.parametrize("k", range(12))
def test_direct_current_flows_in_twelve_directions(winding, k):
    words = ffi.new("uint16_t[3]")
    lib.ht_vectors_alike(LARGE[winding], k, words)
    ab, xy = planes(winding, WORDS[list(words)])
    mean = 0.5 * ab[0] + 0.5 * ab[1]  # the second lasts from the middle to the end
    assert words[1] == words[2] and abs(xy).max() < 1e-9
    assert np.degrees(np.angle(mean)) % 360 == pytest.approx(30 * k)
    assert abs(mean) > 0.577


@pytest.mark.parametrize("edge", range(0, 360, 30))
def test_sector_of_six_changes_at_every_edge(edge):
    for eps, s in ((1e-3, edge // 30 + 1), (-1e-3, edge // 30)):
        for size in (1e-6, 0.4, 3.7e5):
            turn = np.deg2rad(edge + eps)
            v = {"alpha": size * np.cos(turn), "beta": size * np.sin(turn)}
            assert lib.ht_sector_of_six(v) == s % 12


@pytest.mark.parametrize("s", range(12))
@pytest.mark.parametrize("torque_up", [False, True])
@pytest.mark.parametrize("flux_up", [False, True])
def test_direction_moves_torque_and_flux_over_the_whole_sector(s, torque_up, flux_up):
    k = lib.ht_direction(lib.HT_TABLE_60_120, s, torque_up, flux_up)
    v = np.exp(1j * np.pi / 3 * (k // 2))
    for degrees in (30 * s - 29.99, 30 * s - 15, 30 * s - 0.01):
        effect = v * np.exp(-1j * np.deg2rad(degrees))
        assert (effect.imag > 0) == torque_up
        assert (effect.real > 0) == flux_up
    # A pair of sectors around the middle between two vectors: 60 and 120 degrees from it.
    middle = np.exp(1j * np.pi / 3 * (s // 2))
    angle = abs(np.degrees(np.angle(v / middle)))
    assert angle == pytest.approx(60 if flux_up else 120)


@pytest.mark.parametrize("s", range(12))
def test_direction_along_the_flux_is_the_nearest_of_six_on_the_torques_side(s):
    psi = np.exp(1j * np.deg2rad(30 * s - 15))
    for ahead, side in ((True, 1), (False, -1)):
        k = lib.ht_direction_along(lib.HT_TABLE_60_120, s, ahead)
        angle = side * np.degrees(np.angle(np.exp(1j * np.pi / 3 * (k // 2)) / psi))
        assert 0 < angle < 60


class Modulator:
    """A period after the other; the legs at every count."""

    def __init__(self, winding, kappa=0.0, dead=0.0):
        self.winding = winding
        self.cfg = ffi.new("ht_modulator_config *", [kappa, 0.0, 0.3, True])
        lib.ht_modulator_wind(self.cfg, winding)
        self.state = unwritten("ht_modulator_state *")
        lib.ht_modulator_reset(self.state)
        self.dead = ffi.new("ht_dead_time *", [dead, 0.05])
        self.counts = ffi.new("ht_period *", [PERIOD, 0, 1])
        self.out, self.applied = unwritten("ht_compare *"), unwritten("ht_applied *")
        self.toggles, self.before = unwritten("ht_toggles *"), 0

    def step(self, ab, xy=0j, i_A=(0.0,) * 6):
        """Levels of the legs, (counts, 6)."""
        v = ffi.new("ht_vsd *", [[ab.real, ab.imag], [xy.real, xy.imag]])
        legs = ffi.new("ht_vsd *", lib.ht_modulator_legs(self.winding, v))
        currents = ffi.new("ht_six *", [list(i_A)])
        given = ffi.new("ht_modulator_input *", [self.dead, currents, self.counts, self.before])
        lib.ht_modulator_step(
            self.cfg, self.state, legs, given, self.out, self.applied, self.toggles
        )
        self.before = self.applied.s[2]
        counts = np.arange(PERIOD)[:, None]
        start = WORDS[self.out.start][None, :] > 0
        return start ^ (counts >= np.array(list(self.out.ca))[None, :])


voltages = st.builds(
    lambda size, turn: size * np.exp(1j * turn), st.floats(0, 0.57), st.floats(0, 7)
)


@given(st.sampled_from(ALIKE), st.lists(voltages, min_size=1, max_size=4), st.floats(0, 1))
@settings(max_examples=examples(60), deadline=None)
def test_both_sets_switch_alike(winding, commands, kappa):
    """No instant has an x-y voltage, whatever the zero sequence, and the mean is the command. Two
    legs that should switch together may be one count apart, by rounding."""
    modulator = Modulator(winding, kappa)
    for command in commands:
        levels = modulator.step(command)
        ab, xy = planes(winding, levels)
        assert (abs(xy) > 1e-9).sum() <= 3
        assert abs(ab.mean() - command) < 3 / PERIOD


@given(
    st.sampled_from(ALIKE), voltages, st.floats(0, 0.2), st.floats(0, 7),
)  # fmt: skip
@settings(max_examples=examples(60), deadline=None)
def test_an_xy_voltage_is_made_where_there_is_room(winding, command, size, turn):
    """Each set takes its own part, s1 = ab + conj xy and s2 = ab - conj xy, and both are within
    the hexagon's circle of 0.577."""
    wanted = size * np.exp(1j * turn)
    command *= max(0.0, 1 - size / 0.577)
    levels = Modulator(winding).step(command, wanted)
    ab, xy = planes(winding, levels)
    assert abs(ab.mean() - command) < 3 / PERIOD and abs(xy.mean() - wanted) < 3 / PERIOD


@pytest.mark.parametrize("winding", ALIKE)
def test_beyond_the_hexagon_legs_are_limited_alike(winding):
    for turn in np.arange(0, 2 * np.pi, 0.1):
        levels = Modulator(winding).step(0.9 * np.exp(1j * turn), 0.3 + 0.1j)
        _, xy = planes(winding, levels)
        assert (abs(xy) > 1e-9).sum() <= 3


@pytest.mark.parametrize("winding", ALIKE)
def test_the_dead_times_correction_is_alike(winding):
    """Without an x-y current two legs each have the same current, or at 60 degrees the opposite."""
    for turn in np.arange(0, 2 * np.pi, 0.1):
        i_A = 5 * np.cos(turn - angles(winding))
        levels = Modulator(winding, dead=0.02).step(0.4 * np.exp(1j * (turn + 0.5)), 0j, i_A)
        _, xy = planes(winding, levels)
        assert (abs(xy) > 1e-9).sum() <= 3


def test_a_winding_of_30_degrees_keeps_turn_and_clamped_legs():
    cfg = ffi.new("ht_modulator_config *", [0.5, 0.2, 0.3, True])
    lib.ht_modulator_wind(cfg, lib.HT_WINDING_30)
    assert cfg.alternate and cfg.turn_pu == pytest.approx(0.3)


def test_what_physics_forbids_is_not_driven():
    from hexatorque.firmware import schemes

    for winding in ALIKE:
        driven = {
            name for n, name in enumerate(schemes())
            if lib.ht_scheme_drives(lib.ht_scheme_describe(n), winding)
        }  # fmt: skip
        assert driven == {"dtc1", "db-dtfc", "foc"}
    assert all(
        lib.ht_scheme_drives(lib.ht_scheme_describe(n), lib.HT_WINDING_30)
        for n in range(len(schemes()))
    )
