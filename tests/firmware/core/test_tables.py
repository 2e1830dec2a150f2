"""ht_tables is compared with a derivation from the six phase angles alone.

The generated tables are compared with numpy linear algebra that uses only the winding geometry (0,
30, 120, 150, 240, 270 degrees; amplitude-invariant transform), and with the word lists and
switching digits that the papers print.
"""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hexatorque.firmware import lib

ROOT = Path(__file__).parents[3]
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
BITS = (np.arange(64)[:, None] >> np.arange(5, -1, -1)) & 1  # u1 is the most significant
VECTORS = BITS @ T.T  # (64, 4): alpha beta x y, pu of Vdc
ZEROS = (0, 21, 42, 63)

GOLDEN = {
    lib.HT_L: (48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49),
    lib.HT_ML: (57, 52, 24, 44, 30, 13, 6, 11, 39, 19, 33, 50),
    lib.HT_S: (54, 25, 36, 26, 45, 22, 9, 38, 27, 37, 18, 41),
}
MAGNITUDE = {
    lib.HT_L: 2 / 3 * np.cos(np.deg2rad(15)),
    lib.HT_ML: np.sqrt(2) / 3,
    lib.HT_S: 2 / 3 * np.cos(np.deg2rad(75)),
}
TABLE_II = "771004 773100 677300 467700 047710 007731 006773 004677 100477 310077 730067 770046"


def row(vsd):
    return np.array([vsd.ab.alpha, vsd.ab.beta, vsd.xy.x, vsd.xy.y])


def degrees(alpha, beta):
    return np.rad2deg(np.arctan2(beta, alpha)) % 360


def virtual(group, k):
    return [lib.ht_group[group][(k + d) % 12] for d in (-1, 0, 1)]


def duty_solution(group, k):
    """(3, 3): rows t1 t2 t3; columns: constant, factor of vx, factor of vy."""
    words = virtual(group, k)
    matrix = np.vstack([VECTORS[words][:, 2:].T, np.ones(3)])
    return np.linalg.solve(matrix, np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float))


def test_transform_follows_from_the_phase_angles():
    got = np.array([row(lib.ht_transform[lib.HT_WINDING_30][leg]) for leg in range(6)]).T
    np.testing.assert_allclose(got, T, atol=3e-8)
    np.testing.assert_allclose(got @ got.T, np.eye(4) / 3, atol=1e-7)


def test_all_64_vectors_follow_from_the_phase_angles():
    got = np.array([row(lib.ht_vector[w]) for w in range(64)])
    np.testing.assert_allclose(got, VECTORS, atol=6e-8)


@pytest.mark.parametrize("group", GOLDEN)
def test_groups_are_the_printed_words(group):
    assert tuple(lib.ht_group[group]) == GOLDEN[group]


@pytest.mark.parametrize("group", GOLDEN)
def test_groups_contain_the_vectors_of_one_size_in_order_of_angle(group):
    size = np.hypot(VECTORS[:, 0], VECTORS[:, 1])
    assert sorted(lib.ht_group[group]) == sorted(
        np.flatnonzero(abs(size - MAGNITUDE[group]) < 1e-9)
    )
    for k, word in enumerate(lib.ht_group[group]):
        assert degrees(*VECTORS[word, :2]) == pytest.approx(15 + 30 * k, abs=1e-9)


def test_group_sizes_fill_the_64_states():
    size = np.round(np.hypot(VECTORS[:, 0], VECTORS[:, 1]), 9)
    count = dict(zip(*np.unique(size, return_counts=True), strict=True))
    assert [count[round(MAGNITUDE[g], 9)] for g in GOLDEN] == [12, 12, 12]
    assert count[round(1 / 3, 9)] == 24
    assert count[0.0] == 4


def test_large_vectors_advance_150_degrees_in_xy():
    for k, word in enumerate(lib.ht_group[lib.HT_L]):
        vsd = lib.ht_vector[word]
        assert degrees(vsd.xy.x, vsd.xy.y) == pytest.approx((75 + 150 * k) % 360, abs=1e-4)


@pytest.mark.parametrize("other", (lib.HT_L, lib.HT_S))
def test_medium_large_vectors_oppose_large_and_small_ones_in_xy(other):
    for k in range(12):
        a = VECTORS[lib.ht_group[other][k], 2:]
        b = VECTORS[lib.ht_group[lib.HT_ML][k], 2:]
        assert a @ b == pytest.approx(-np.linalg.norm(a) * np.linalg.norm(b), rel=1e-9)


def test_first_leg_is_the_first_one_that_is_high():
    for word in range(64):
        legs = [leg for leg in range(6) if BITS[word][leg]]
        assert lib.ht_first_leg[word] == (legs[0] if legs else 6)


def test_nearest_zero_needs_fewest_transitions():
    for word in range(64):
        zero = lib.ht_nearest_zero[word]
        assert zero in ZEROS
        assert np.allclose(VECTORS[zero], 0)
        fewest = min((word ^ z).bit_count() for z in ZEROS)
        assert (word ^ zero).bit_count() == fewest


@pytest.mark.parametrize("group", (lib.HT_L, lib.HT_ML))
def test_duty_rows_solve_the_voltage_equations(group):
    for k in range(12):
        want = duty_solution(group, k)
        r = lib.ht_duty_table[group][k]
        got = [[r.t1_0, r.t1_x, r.t1_y], [r.t2_0, r.t2_x, r.t2_y]]
        np.testing.assert_allclose(got, want[:2], rtol=2e-7, atol=2e-7)


@pytest.mark.parametrize("group", (lib.HT_L, lib.HT_ML))
def test_zero_command_gives_the_fixed_duties(group):
    t = (2 - np.sqrt(3), 2 * np.sqrt(3) - 3, 2 - np.sqrt(3))
    for k in range(12):
        np.testing.assert_allclose(duty_solution(group, k)[:, 0], t, atol=1e-12)


@pytest.mark.parametrize(("group", "printed"), ((lib.HT_L, 0.032692), (lib.HT_ML, 0.089316)))
def test_tmvcl_is_the_largest_box_with_duties_that_exist(group, printed):
    limits = []
    for k in range(12):
        solution = duty_solution(group, k)
        corners = np.array(list(itertools.product((1,), (-1, 1), (-1, 1)))).T
        steepest = (solution[:, 1:] @ corners[1:]).min(axis=1)
        limits.append((solution[:, 0] / -steepest).min())
    np.testing.assert_allclose(limits, limits[0], rtol=1e-9)  # identical for each k
    assert lib.ht_tmvcl_pu[group] == pytest.approx(limits[0], rel=1e-7)
    assert lib.ht_tmvcl_pu[group] == pytest.approx(printed, abs=5e-7)


def test_tmvcl_of_medium_large_vectors_is_1_plus_sqrt_3_times_larger():
    assert lib.ht_tmvcl_pu[1] / lib.ht_tmvcl_pu[0] == pytest.approx(1 + np.sqrt(3), rel=1e-6)


def digits(group, k):
    """Per leg 4 S1 + 2 S2 + S3 (paper A, Table II)."""
    s = [BITS[w] for w in virtual(group, k)]
    return "".join(str(d) for d in 4 * s[0] + 2 * s[1] + s[2])


def test_switching_sequences_are_those_of_paper_a_table_2():
    assert [digits(lib.HT_L, k) for k in range(12)] == TABLE_II.split()


def test_large_legs_never_pulse_twice_and_medium_large_legs_do():
    large = {d for k in range(12) for d in digits(lib.HT_L, k)}
    medium = {d for k in range(12) for d in digits(lib.HT_ML, k)}
    assert not large & {"2", "5"}
    assert {"2", "5"} <= medium


def test_generated_file_is_current():
    script = ROOT / "firmware" / "tools" / "generate_tables.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
