"""The direction that a rotor of a known angle is pulled to: the nearest of twelve."""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib

COUNTS_REV = 7200


@pytest.mark.parametrize("first_deg", [0, 15])
def test_a_known_rotor_is_pulled_to_the_nearest_direction(first_deg):
    cfg = ffi.new("ht_alignment_config *", {
        "known": True, "ticks": 100, "counts_rev": COUNTS_REV, "pole_pairs": 3,
        "first": first_deg // 15,
    })  # fmt: skip
    state = ffi.new("ht_alignment_state *")
    directions = np.exp(1j * np.deg2rad(first_deg + 30 * np.arange(12)))
    for counts in [*range(50, COUNTS_REV, 100), COUNTS_REV - 1]:
        state.electrical = counts
        lib.ht_alignment_begin(cfg, state, 0)
        rotor = np.exp(2j * np.pi * counts / COUNTS_REV)
        assert state.direction == np.argmax((directions * rotor.conj()).real)
