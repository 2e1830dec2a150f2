"""The index pulse is compared with an encoder that turns count by count: its line is high over a
few counts of each revolution, and its counter may slip.
"""

import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import ffi, lib

COUNTS_REV, POLE_PAIRS = 720, 5
#: A line, and 5 electrical degrees.
NEAR = 4 + COUNTS_REV // (POLE_PAIRS * 72)


class Encoder:
    """first: what the counter shows at the beginning; at, width: where the index line is high,
    counts of the shaft."""

    def __init__(self, first=0, at=100, width=1):
        self.config = ffi.new("ht_index_config *")
        self.config.used, self.config.counts_rev = True, COUNTS_REV
        self.config.near_counts = lib.ht_index_near_counts(COUNTS_REV, POLE_PAIRS)
        self.state = ffi.new("ht_index_state *")
        self.counter, self.shaft, self.at, self.width = first, 0, at, width
        self.latched, self.cut, self.indices = None, False, 0

    def high(self):
        return not self.cut and (self.shaft - self.at) % COUNTS_REV < self.width

    def turn(self, counts, look=7):
        """A look every `look` counts. Returns whether the angle is known."""
        step = 1 if counts > 0 else -1
        for k in range(abs(counts)):
            before = self.high()
            self.shaft += step
            self.counter = (self.counter + step) % 2**32
            if self.high() and not before:
                self.latched = self.counter
                self.indices += 1
            if k % look == 0:
                self.look()
        self.look()
        return self.state.known

    def look(self):
        shown = ffi.new("ht_capture *")
        shown.index, shown.index_position = self.latched is not None, self.latched or 0
        self.latched = None
        lib.ht_index_step(self.config, self.state, self.counter, shown)


def test_the_tolerance_is_a_line_and_5_electrical_degrees():
    assert lib.ht_index_near_counts(COUNTS_REV, POLE_PAIRS) == NEAR == 6
    assert lib.ht_index_near_counts(8192, 4) == 4 + int(8192 / 4 * 5 / 360)


@given(
    st.lists(st.integers(-1500, 1500), min_size=1, max_size=12),
    st.sampled_from([0, 2**31 - 300, 2**32 - 300]) | st.integers(0, 2**32 - 1),
    st.integers(1, 4), st.integers(0, COUNTS_REV - 1), st.integers(1, 900),
)  # fmt: skip
@settings(max_examples=examples(60), deadline=None)
def test_an_encoder_that_counts_right_is_known_from_its_first_index_on(
    moves, first, width, at, look
):
    encoder = Encoder(first, at, width)
    for counts in moves:
        known = encoder.turn(counts, look)
        assert known == (encoder.indices > 0)
        if known:
            # The shaft's way from the index, however often the counter wraps
            shown = (encoder.counter - encoder.state.reference + 2**31) % 2**32 - 2**31
            off = (shown - (encoder.shaft - at)) % COUNTS_REV
            assert min(off, COUNTS_REV - off) < width


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("slip", [NEAR + 1, -NEAR - 1, 50, 360, -200])
def test_counts_that_slip_are_found_at_the_next_index(slip, way):
    encoder = Encoder()
    assert encoder.turn(way * COUNTS_REV)
    encoder.counter = (encoder.counter + slip) % 2**32
    assert not encoder.turn(way * COUNTS_REV)
    # Two in a row agree again, with the counts as they are now.
    assert encoder.turn(way * COUNTS_REV)
    assert (
        encoder.state.reference - encoder.at - encoder.counter + encoder.shaft
    ) % COUNTS_REV == 0


def test_a_small_slip_in_each_revolution_adds_up():
    encoder = Encoder()
    known = []
    for _ in range(2 + NEAR):
        known.append(encoder.turn(COUNTS_REV))
        encoder.counter += 1
    # The sixth count too many is borne, the seventh is not.
    assert known == [True] * (NEAR + 1) + [False]


@pytest.mark.parametrize("way", [1, -1])
def test_a_lost_index_is_found_an_eighth_of_a_revolution_late(way):
    encoder = Encoder(at=0 if way > 0 else COUNTS_REV)
    assert encoder.turn(way * COUNTS_REV)
    encoder.cut = True
    assert encoder.turn(way * COUNTS_REV, look=1)
    assert not encoder.turn(way * (COUNTS_REV // 8 + NEAR + 1), look=1)


def test_an_index_at_a_false_place_is_found():
    encoder = Encoder()
    assert encoder.turn(COUNTS_REV)
    encoder.at += 40
    assert not encoder.turn(COUNTS_REV)


def test_nothing_is_known_while_it_is_not_used():
    encoder = Encoder()
    encoder.config.used = False
    assert not encoder.turn(3 * COUNTS_REV)
