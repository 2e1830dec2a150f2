"""The zero that an absolute encoder tells is compared with a shaft of whole counts and an encoder
whose readings are exact fractions of a revolution.
"""

import re
from fractions import Fraction
from math import floor
from pathlib import Path

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

COUNTS_REV, POLE_PAIRS = 8192, 5
NONE = 0xFFFFFFFF
#: 5 electrical degrees, and a line.
LINE, NEAR = 4, 4 + COUNTS_REV // (POLE_PAIRS * 72)


class Shaft:
    """first: what the counter shows at the beginning; at: counts of the shaft at which the absolute
    encoder reads 0; way: 1, or -1 where it reads less when the counter counts up."""

    def __init__(self, readings=1000, first=0, at=0, way=1, counts_rev=COUNTS_REV):
        self.config = ffi.new("ht_absolute_config *")
        self.config.used = True
        lib.ht_absolute_configure(self.config, counts_rev, readings, way < 0, POLE_PAIRS)
        self.state = ffi.new("ht_absolute_state *")
        self.readings, self.at, self.way, self.counts_rev = readings, at, way, counts_rev
        self.shaft, self.counter, self.stuck, self.adds = 0, first, None, 0

    def reading(self):
        if self.stuck is not None:
            return self.stuck
        turned = self.way * Fraction(self.shaft - self.at, self.counts_rev)
        return (floor(turned * self.readings) + self.adds) % self.readings

    def look(self, moved=0, reading=None):
        """A look after the shaft has moved. Returns whether the zero is known."""
        self.shaft += moved
        self.counter = (self.counter + moved) % 2**32
        told = self.reading() if reading is None else reading
        lib.ht_absolute_step(self.config, self.state, self.counter, moved, told)
        return self.state.known

    def zero_off(self):
        """By how many counts the zero is wrong."""
        shown = (self.counter - self.state.reference + 2**31) % 2**32 - 2**31
        off = self.shaft - self.at - shown
        return (off + self.counts_rev // 2) % self.counts_rev - self.counts_rev // 2

    def known(self):
        assert [self.look(), self.look()] == [False, True]
        return self


def tolerance(readings):
    return NEAR + floor(np.float32(2) * np.float32(COUNTS_REV) / np.float32(readings))


@pytest.mark.parametrize("readings", [360, 1000, 4096, 8192, 65537, 2**20, 2**24])
@pytest.mark.parametrize("way", [1, -1])
def test_the_zero_is_right_within_half_a_reading(readings, way):
    rng = np.random.default_rng(3)
    for at in rng.integers(-COUNTS_REV, COUNTS_REV, examples(40)):
        first = int(rng.choice([0, 2**31 - 90, 2**32 - 90, rng.integers(2**32)]))
        shaft = Shaft(readings, first, int(at), way).known()
        # Of a place within a reading the middle is told; the counter tells whole counts.
        assert abs(shaft.zero_off()) <= COUNTS_REV / readings / 2 + 1


@given(
    st.lists(st.integers(-4000, 4000), min_size=1, max_size=15),
    st.sampled_from([360, 1000, 4096, 65537, 2**24]),
    st.sampled_from([1, -1]),
    st.sampled_from([0, 2**31 - 300, 2**32 - 300]) | st.integers(0, 2**32 - 1),
)
@settings(max_examples=examples(80), deadline=None)
def test_readings_that_are_right_stay_so_at_every_speed(moves, readings, way, first):
    shaft = Shaft(readings, first, 77, way).known()
    for moved in moves:
        # The last count of a reading may flicker, and a reading may be a slow period old.
        shaft.adds = moved % 2
        late = shaft.reading()
        assert shaft.look(moved, late if moved % 3 == 0 else None)
        assert abs(shaft.zero_off()) <= 1.5 * COUNTS_REV / readings + 1


@pytest.mark.parametrize("way", [1, -1])
def test_a_coarse_reading_that_flickers_is_borne_at_standstill(way):
    """A reading is 23 counts wide. The first is at one end of it, later ones are not."""
    rng = np.random.default_rng(5)
    shaft = Shaft(360, at=-22 * way, way=way).known()
    for moved in rng.integers(-LINE, LINE, examples(2000), endpoint=True):
        shaft.adds = int(rng.integers(2))
        assert shaft.look(int(moved))


@pytest.mark.parametrize("readings", [360, 1000, 2**20])
@pytest.mark.parametrize("way", [1, -1])
def test_a_slip_beyond_the_tolerance_is_found_by_the_third_look(readings, way):
    step = COUNTS_REV // readings + 1
    for slip in (tolerance(readings) + step, -tolerance(readings) - step, COUNTS_REV // 2):
        shaft = Shaft(readings, way=way).known()
        shaft.counter = (shaft.counter + slip) % 2**32
        assert [shaft.look() for _ in range(3)] == [True, True, False]
        # Two readings that agree tell the zero of the counts as they are now.
        assert shaft.look() and abs(shaft.zero_off()) <= step


@pytest.mark.parametrize("way", [1, -1])
def test_the_zero_goes_with_the_shaft_however_far_it_turns(way):
    """Of 4000 counts no whole number of revolutions fits into the counter's 2^32."""
    shaft = Shaft(1000, 0, 77, way, counts_rev=4000).known()
    for moved in (10**9 + 1, 10**9, 7, -(10**9), 0, 10**9, 10**9, 10**9, 0):
        assert shaft.look(moved)
        assert abs(shaft.zero_off()) <= 4 / 2 + 1


def test_within_the_tolerance_slips_add_up():
    shaft = Shaft(2**20).known()
    looks = 0
    while shaft.look() and looks < 100:
        shaft.counter = (shaft.counter + 1) % 2**32
        looks += 1
    assert NEAR <= looks <= NEAR + 4


@pytest.mark.parametrize("wrong", ["stuck", "reversed", "missing"])
def test_a_wrong_reading_is_found_before_a_thirtieth_of_a_turn(wrong):
    shaft = Shaft(4096).known()
    if wrong == "reversed":
        shaft.way = -1
    if wrong == "stuck":
        shaft.stuck = shaft.reading()
    while shaft.look(5, NONE if wrong == "missing" else None):
        assert shaft.shaft < COUNTS_REV / 30
    assert shaft.shaft > 0


@pytest.mark.parametrize("told", [NONE, 1000, 65535, 500])
def test_two_wrong_readings_are_noise(told):
    shaft = Shaft(1000).known()
    for _ in range(3):
        assert shaft.look(0, told) and shaft.look(0, told) and shaft.look()
    assert abs(shaft.zero_off()) <= COUNTS_REV / 1000


@pytest.mark.parametrize("told", [NONE, 1000, 2**31])
def test_what_is_no_reading_tells_no_zero(told):
    shaft = Shaft(1000)
    assert not any(shaft.look(0, told) for _ in range(20))


def test_no_zero_is_known_before_the_shaft_stands():
    shaft = Shaft(4096)
    assert not any(shaft.look(moved) for moved in (700, 90, -LINE - 1, LINE + 1) * 5)
    assert [shaft.look(LINE), shaft.look(-LINE)] == [False, True]


def test_the_coarsest_encoder_has_a_reading_each_5_electrical_degrees():
    assert lib.ht_absolute_least(POLE_PAIRS) == 360 * POLE_PAIRS / 5


def test_the_misfits_text_tells_the_fewest_readings():
    """A string of C cannot ask the function."""
    table = Path(__file__).resolve().parents[3] / "firmware/app/ht_misfits.def"
    row = re.search(r"^HT_RULE\(ABSOLUTE,.*", table.read_text(encoding="utf-8"), re.M)[0]
    assert f"at least {lib.ht_absolute_least(1.0):g} times" in row
