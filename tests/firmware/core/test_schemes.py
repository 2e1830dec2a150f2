"""ht_schemes.def: the values of its rows follow from the papers and from geometry."""

import numpy as np
import pytest

from hexatorque.firmware import ffi, lib, parameters

THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
NAMES = parameters()["scheme"].choices
ROWS = {name: lib.ht_scheme_describe(number) for number, name in enumerate(NAMES)}
RADIUS = {"L": 2 / 3 * np.cos(np.pi / 12), "ML": np.sqrt(2) / 3}


def group(radius):
    """Vectors of one length, by direction: complex (alpha-beta, x-y), units of Vdc."""
    words = np.arange(64)[:, None] >> np.arange(5, -1, -1) & 1
    a, b, x, y = T @ words.T
    found = np.isclose(np.hypot(a, b), radius)
    ab, xy = (a + 1j * b)[found], (x + 1j * y)[found]
    order = np.argsort(np.angle(ab))
    assert len(order) == 12
    return ab[order], xy[order]


def zero_xy_mean(vectors):
    """The mean alpha-beta vector without x-y voltage. The shares of the vectors add up to 1."""
    ab, xy = (np.array(part) for part in zip(*vectors))
    rows = np.array([np.ones(len(xy)), xy.real, xy.imag])
    shares = np.linalg.lstsq(rows, np.array([1.0, 0, 0]), rcond=None)[0]
    assert np.allclose(rows @ shares, [1, 0, 0]) and (shares > 0).all()
    return shares @ ab


def corners(row):
    """The mean vectors that the scheme can hold for any time."""
    large, medium = group(RADIUS["L"]), group(RADIUS["ML"])
    if row.vectors in (lib.HT_VECTORS_SINGLE, lib.HT_VECTORS_MODULATED):
        # Any x-y voltage: the first scheme ignores it, in the modulator it gives way. Then the
        # means of all vectors together are the dodecagon of the large ones.
        return large[0]
    if row.vectors in (lib.HT_VECTORS_VIRTUAL, lib.HT_VECTORS_CENTRED, lib.HT_VECTORS_TURNED):
        # What two sets with centred legs reach without x-y voltage is the same polygon.
        ab, xy = large if row.group == lib.HT_L else medium
        three = [[(ab[k - 1], xy[k - 1]), (ab[k], xy[k]), (ab[k - 11], xy[k - 11])]
                 for k in range(12)]  # fmt: skip
        return np.array([zero_xy_mean(vectors) for vectors in three])
    return np.array([zero_xy_mean(pair) for pair in zip(zip(*large), zip(*medium))])


@pytest.mark.parametrize("name", NAMES)
def test_reach_is_the_circle_inside_the_polygon_of_mean_vectors(name):
    points = corners(ROWS[name])
    following = np.roll(points, -1)
    # Distance of each edge from the origin: |p x q| / |q - p|.
    edges = np.abs((np.conj(points) * following).imag) / np.abs(following - points)
    assert ROWS[name].reach_pu == pytest.approx(edges.min(), abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_only_interleaved_sets_have_a_ripple_in_xy_that_is_reckoned_with(name):
    row = ROWS[name]
    interleaved = row.vectors == lib.HT_VECTORS_INTERLEAVED
    assert (lib.ht_scheme_xy_ripple_pu(row) > 0) == interleaved
    assert lib.ht_scheme_xy_ripple_pu(row) >= 0


#: Vectors, their group, levels of the torque comparator, and whether x-y is regulated.
OF_THE_PAPERS = {
    "dtc1": (lib.HT_VECTORS_SINGLE, lib.HT_L, 3, False),
    "dtc2": (lib.HT_VECTORS_PAIR, lib.HT_L, 3, False),
    "dtc3": (lib.HT_VECTORS_PAIR_SMALL, lib.HT_L, 5, False),
    "fdr": (lib.HT_VECTORS_VIRTUAL, lib.HT_L, 3, False),
    "ddr": (lib.HT_VECTORS_VIRTUAL, lib.HT_L, 3, True),
    "ddr-ml": (lib.HT_VECTORS_VIRTUAL, lib.HT_ML, 3, True),
    "db-dtfc": (lib.HT_VECTORS_MODULATED, lib.HT_L, 0, False),
    "foc": (lib.HT_VECTORS_CENTRED, lib.HT_L, 0, False),
    "foc-24": (lib.HT_VECTORS_TURNED, lib.HT_L, 0, False),
    "db-ipwm": (lib.HT_VECTORS_INTERLEAVED, lib.HT_L, 0, False),
}


def test_levels_vectors_and_regulators_are_those_of_the_papers():
    assert OF_THE_PAPERS == {
        name: (row.vectors, row.group, row.torque_levels, row.regulated)
        for name, row in ROWS.items()
    }


def test_the_law_and_whether_it_commands_a_voltage():
    commands = {name: lib.ht_law_commands_voltage(row.law) for name, row in ROWS.items()}
    laws = {
        "db-dtfc": lib.HT_LAW_DEADBEAT, "foc": lib.HT_LAW_FOC, "foc-24": lib.HT_LAW_FOC,
        "db-ipwm": lib.HT_LAW_INTERLEAVED,
    }  # fmt: skip
    assert commands == {name: name in laws for name in NAMES}
    assert {name: row.law for name, row in ROWS.items() if row.law != lib.HT_LAW_TABLE} == laws


def test_xy_limit_is_that_of_the_regulated_group():
    limits = {name: lib.ht_scheme_xy_limit_pu(row) for name, row in ROWS.items()}
    assert limits == {
        "dtc1": 0, "dtc2": 0, "dtc3": 0, "fdr": 0,
        "ddr": lib.ht_tmvcl_pu[lib.HT_L], "ddr-ml": lib.ht_tmvcl_pu[lib.HT_ML], "db-dtfc": 0,
        "foc": 0, "foc-24": 0, "db-ipwm": 0,
    }  # fmt: skip


#: The groups of vectors that a scheme without virtual or modulated vectors may apply.
GROUPS = {
    lib.HT_VECTORS_SINGLE: ["L"], lib.HT_VECTORS_PAIR: ["L", "ML"],
    lib.HT_VECTORS_PAIR_SMALL: ["L", "ML", "S"],
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_xy_step_is_what_the_vectors_of_a_period_move_the_flux_by(name):
    row = ROWS[name]
    step_pu = lib.ht_scheme_xy_step_pu(row, lib.HT_WINDING_30)
    parts = {g: np.abs(group(radius)[1]).max() for g, radius in RADIUS.items()}
    parts["S"] = np.abs(group(2 / 3 * np.cos(np.deg2rad(75)))[1]).max()
    if row.vectors in GROUPS:
        assert step_pu == pytest.approx(max(parts[g] for g in GROUPS[row.vectors]), abs=1e-6)
    elif row.vectors == lib.HT_VECTORS_VIRTUAL:
        # The first and the last of the three last for 2 - sqrt(3) of the period, and what the first
        # one moves is the farthest.
        farthest = (2 - np.sqrt(3)) * parts["L" if row.group == lib.HT_L else "ML"]
        assert farthest < step_pu < 1.3 * farthest
    else:
        assert parts["L"] / 3 - 1e-6 <= step_pu <= parts["ML"] + 1e-6


def test_the_longest_vector_is_the_large_one():
    assert lib.ht_longest_pu(lib.HT_WINDING_30) == pytest.approx(RADIUS["L"], abs=1e-6)


def test_numbers_are_those_of_the_parameter():
    row = parameters()["scheme"]
    assert (row.min, row.max) == (0, lib.HT_SCHEMES - 1)
    assert len(row.choices) == lib.HT_SCHEMES and row.whole
    assert row.choices[lib.HT_DDR_ML] == "ddr-ml"
    assert row.initial == lib.HT_DDR
    for number in range(lib.HT_SCHEMES, 2**16):
        assert lib.ht_scheme_describe(number) == ffi.NULL, number
