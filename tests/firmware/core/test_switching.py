"""ht_switching is compared with geometry: the sector with arctan2 in double precision, the tables
with the signs of psi x v (torque) and psi . v (flux).
"""

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.firmware import lib

TABLES = {lib.HT_TABLE_45_135: (45, 135), lib.HT_TABLE_75_105: (75, 105)}
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
TMVCL = {lib.HT_L: 0.0326920, lib.HT_ML: 0.0893163}


def sector(alpha, beta):
    return lib.ht_sector({"alpha": alpha, "beta": beta})


def sector_of_angle(degrees):
    return int(np.floor((degrees + 15) / 30)) % 12


def vector(word):
    bits = np.array([word >> b & 1 for b in range(5, -1, -1)])
    return np.array([bits @ f(n * THETA) for n in (1, 5) for f in (np.cos, np.sin)]) / 3


def on_circle(degrees, size):
    """A float32 point near an angle, and the exact angle of that point."""
    a, b = (
        np.float32(size * np.cos(np.deg2rad(degrees))),
        np.float32(size * np.sin(np.deg2rad(degrees))),
    )
    return float(a), float(b), np.rad2deg(np.arctan2(float(b), float(a)))


def test_sector_agrees_with_arctan2_on_a_dense_grid():
    rng = np.random.default_rng(1)
    for degrees in np.arange(-360, 360, 0.0731):
        a, b, exact = on_circle(degrees, 10 ** rng.uniform(-3, 3))
        assert sector(a, b) == sector_of_angle(exact), degrees


@pytest.mark.parametrize("edge", range(15, 375, 30))
def test_sector_changes_at_every_edge(edge):
    s = (edge + 15) // 30 % 12
    for size in (1e-6, 0.4, 1.0, 3.7e5):
        for eps in (2e-5, 1e-4, 1e-2):
            a, b, _ = on_circle(edge + eps, size)
            assert sector(a, b) == s
            a, b, _ = on_circle(edge - eps, size)
            assert sector(a, b) == (s - 1) % 12
        a, b, _ = on_circle(edge, size)
        assert sector(a, b) in (s, (s - 1) % 12)


def test_sector_on_the_axes():
    assert [sector(1, 0), sector(0, 1), sector(-1, 0), sector(0, -1)] == [0, 3, 6, 9]
    assert sector(1, -0.0) == 0
    assert sector(-1, -0.0) == 6


special = st.one_of(st.floats(width=32), st.sampled_from([0.0, -0.0, np.inf, -np.inf, np.nan]))


@given(special, special)
@settings(max_examples=examples(300), deadline=None)
def test_sector_is_valid_for_any_input(alpha, beta):
    assert 0 <= sector(alpha, beta) <= 11


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("s", range(12))
def test_tables_from_first_principles(table, s):
    psi = np.exp(1j * np.deg2rad(30 * s))
    for torque_up in (False, True):
        for flux_up in (False, True):
            k = lib.ht_direction(table, s, torque_up, flux_up)
            assert 0 <= k <= 11
            effect = np.conj(psi) * np.exp(1j * np.deg2rad(15 + 30 * k))
            assert (effect.imag > 0) == torque_up  # psi x v
            assert (effect.real > 0) == flux_up  # psi . v
            angle = abs(np.rad2deg(np.angle(effect)))
            assert angle == pytest.approx(TABLES[table][0 if flux_up else 1], abs=1e-9)


@pytest.mark.parametrize("s", range(12))
def test_direction_along_the_flux_is_the_nearest_on_the_torques_side(s):
    """It is the direction nearest to the flux on the side of the torque."""
    psi = np.exp(1j * np.deg2rad(30 * s))
    for ahead in (False, True):
        k = lib.ht_direction_along(lib.HT_TABLE_75_105, s, ahead)
        assert 0 <= k <= 11
        effect = np.conj(psi) * np.exp(1j * np.deg2rad(15 + 30 * k))
        assert np.rad2deg(np.angle(effect)) == pytest.approx(15 if ahead else -15, abs=1e-9)


def test_direction_turns_with_the_sector():
    for table in TABLES:
        for up in ((0, 0), (0, 1), (1, 0), (1, 1)):
            first = lib.ht_direction(table, 0, *up)
            for s in range(12):
                assert lib.ht_direction(table, s, *up) == (first + s) % 12


def test_sector_0_is_as_printed_in_paper_b_table_1():
    words = [
        lib.ht_group[lib.HT_L][lib.ht_direction(lib.HT_TABLE_75_105, 0, torque_up, flux_up)]
        for torque_up, flux_up in ((1, 1), (1, 0), (0, 1), (0, 0))
    ]
    assert words == [60, 28, 35, 3]


def flux_margins(table):
    """The effect on the flux over the width of each sector, the corners of the box, and both
    groups. It is positive if it has the demanded sign."""
    for group, limit in TMVCL.items():
        for s in range(12):
            for up in ((0, 0), (0, 1), (1, 0), (1, 1)):
                k = lib.ht_direction(table, s, *up)
                v = np.array([vector(lib.ht_group[group][(k + d) % 12]) for d in (-1, 0, 1)])
                for corner in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                    rhs = [limit * corner[0], limit * corner[1], 1]
                    mean = np.linalg.solve(np.vstack([v[:, 2:].T, np.ones(3)]), rhs) @ v[:, :2]
                    for degrees in (30 * s - 15, 30 * s + 15):
                        psi = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
                        yield (1 if up[1] else -1) * (mean @ psi)


def test_only_45_135_keeps_the_flux_sign_over_the_box():
    assert min(flux_margins(lib.HT_TABLE_45_135)) > 0
    assert min(flux_margins(lib.HT_TABLE_75_105)) < 0
