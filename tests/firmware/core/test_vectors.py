"""The firmware is compared with the test vectors of tests/vectors, which are for any language.
The vectors are compared with the printed values of the papers, and with the statements of their
README."""

import itertools
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.papers.both import vectors
from hexatorque.evidence.papers.engine.law import Law
from hexatorque.evidence.papers.paper_a import virtual_vectors
from hexatorque.evidence.papers.paper_b import tables
from hexatorque.firmware import ffi, lib

VECTORS = Path(__file__).parents[2] / "vectors"
GROUP = {"L": lib.HT_L, "ML": lib.HT_ML, "S": lib.HT_S}
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
LARGE_XY_DEG = [(75 + 150 * k) % 360 for k in range(12)]


def rows(file, table=None):
    """Rows as dicts."""
    content = json.loads((VECTORS / f"{file}.json").read_text())
    assert content["format"] == "hexatorque-vectors-1"
    found = content["tables"][table or file]
    return [dict(zip(found["columns"], row, strict=True)) for row in found["rows"]]


# --- the firmware -----------------------------------------------------------------


def test_states_are_those_of_the_firmware():
    cases = rows("states")
    assert [c["word"] for c in cases] == list(range(64))
    for c in cases:
        v = lib.ht_vector[c["word"]]
        got = v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y
        assert got == pytest.approx([c[a] for a in ("alpha", "beta", "x", "y")], abs=1e-6)
        assert lib.ht_nearest_zero[c["word"]] == c["nearest_zero"]
        if c["k"] is not None:
            assert lib.ht_group[GROUP[c["group"]]][c["k"]] == c["word"]
    assert sum(c["k"] is not None for c in cases) == 36


def test_sectors_are_those_of_the_firmware():
    cases = rows("sectors")
    assert {c["sector"] for c in cases} == set(range(12))
    for c in cases:
        assert lib.ht_sector({"alpha": c["alpha"], "beta": c["beta"]}) == c["sector"]


def test_switching_table_is_that_of_the_firmware():
    number = {"45/135": lib.HT_TABLE_45_135, "75/105": lib.HT_TABLE_75_105}
    cases = rows("switching")
    assert len({tuple(c.values())[:4] for c in cases}) == 2 * 12 * 4
    for c in cases:
        k = lib.ht_direction(number[c["table"]], c["sector"], c["torque"] > 0, c["flux"] > 0)
        assert k == c["k"]


def test_duties_are_those_of_the_firmware():
    cases = rows("duties")
    assert len(cases) == 2 * 12 * 37
    for c in cases:
        p = lib.ht_duty(GROUP[c["group"]], c["k"], {"x": c["v_x"], "y": c["v_y"]})
        assert (p.t1, p.t2) == pytest.approx((c["T1"], c["T2"]), abs=2e-6)


def test_compare_registers_are_those_of_the_firmware():
    for c in rows("compare"):
        words = [63 * (c["sequence"] >> b & 1) for b in (2, 1, 0)]
        out, applied = ffi.new("ht_compare *"), ffi.new("ht_applied *")
        points = {"t1": c["T1"], "t2": c["T2"]}
        period = ffi.new("ht_period *", [c["period"], c["first"], c["shortest"]])
        lib.ht_pattern_counts(words, points, period, out, applied)
        assert out.start == 63 * c["start"]
        assert list(out.ca) == [c["CA"]] * 6 and list(out.cb) == [c["CB"]] * 6, c


def law(scheme):
    return Law(setups.load("paper-b").changed(controller__scheme=scheme))


def flux(degrees):
    return 0.02 * np.exp(1j * np.deg2rad(degrees))


def test_decisions_are_those_of_the_firmware():
    laws = {scheme: law(scheme) for scheme in ("dtc1", "dtc2", "dtc3")}
    cases = rows("decisions")
    assert len(cases) == 12 * (4 + 4 + 8)
    for c in cases:
        k = lib.ht_direction(lib.HT_TABLE_75_105, c["sector"], c["d_m"] > 0, c["d_psi"] > 0)
        for side, word in ((180, c["word_against"]), (0, c["word_along"])):
            psi_xy = flux(LARGE_XY_DEG[k] + side)
            demand = c["sector"], c["d_m"], bool(c["d_psi"])
            assert laws[c["scheme"]].words(*demand, psi_xy) == (word,) * 3


@pytest.mark.parametrize("scheme", ("dtc2", "dtc3"))
def test_selection_by_xy_flux_is_that_of_the_firmware(scheme):
    decide = law(scheme)
    cases = rows("selection")
    assert len(cases) == 144
    for c in cases:
        group = "ML" if c["table"] == 2 else "L"
        # If torque and flux have to rise, direction k is chosen in sector k - 2.
        got = decide.words((c["k"] - 2) % 12, decide.full_level, True, flux(30 * c["xy_sector"]))
        assert got == (lib.ht_group[GROUP[group]][c["k"]],) * 3


def test_virtual_vectors_are_those_of_the_firmware():
    fdr = law("fdr")
    for c in rows("paper_a", "table_2"):
        assert fdr.words((c["k"] - 2) % 12, 1, True) == (c["word1"], c["word2"], c["word3"])


# --- the print --------------------------------------------------------------------


def test_paper_a_is_as_printed():
    for c in rows("paper_a", "table_1"):
        sample, r_ab, r_xy, share = vectors.TABLE_I[c["group"]]
        assert (c["sample"], round(c["alpha_beta"], 4), round(c["x_y"], 4)) == (sample, r_ab, r_xy)
        assert round(c["share_pct"], 2) == share
    ours = [tuple(c.values())[1:] for c in rows("paper_a", "table_2")]
    assert ours == list(virtual_vectors.TABLE_II)


def test_paper_b_is_as_printed():
    for name, printed in (("table_1", tables.TABLE_I), ("table_2a", tables.TABLE_I),
                          ("table_2b", tables.TABLE_II_B)):  # fmt: skip
        ours = {(c["d_m"], c["d_psi"]): c["vector"] for c in rows("paper_b", name)}
        assert ours == printed
    row = rows("paper_b", "table_3")
    assert [c["table"] for c in row] == tables.TABLE_III_V60
    assert {c["vector"] for c in row} == {60}
    ours = {(c["d_m"], c["d_psi"]): c["virtual"] for c in rows("paper_b", "table_4")}
    assert ours == {
        demand: f"V_{'L' if abs(demand[0]) == 2 else 'S'}{number}"
        for demand, number in tables.TABLE_IV.items()
    }
    pairs = {c["virtual"]: (c["vector1"], c["vector2"]) for c in rows("paper_b", "table_4")}
    assert pairs["V_L3"] == (60, 24) and pairs["V_S3"] == (36, 24)  # section V-A


# --- what README.md says ----------------------------------------------------------


def test_duties_give_the_commanded_volt_seconds():
    bits = np.arange(64)[:, None] >> np.arange(5, -1, -1) & 1
    xy = bits @ np.exp(5j * THETA) / 3
    words = {g: {c["k"]: c["word"] for c in rows("states") if c["group"] == g} for g in ("L", "ML")}
    for c in rows("duties"):
        t = np.array([c["t1"], c["t2"], c["t3"]])
        three = [words[c["group"]][(c["k"] + d) % 12] for d in (-1, 0, 1)]
        assert t @ xy[three] == pytest.approx(c["v_x"] + 1j * c["v_y"], abs=1e-10)
        assert t.sum() == pytest.approx(1, abs=1e-11)
        limit = {"L": 0.0326920, "ML": 0.0893163}[c["group"]]
        reach = max(abs(c["v_x"]), abs(c["v_y"])) / limit
        assert c["where"] == (
            "edge" if abs(reach - 1) < 1e-5 else "inside" if reach < 1 else "outside"
        )
        if c["where"] != "outside":
            assert t.min() > -1e-7
            assert (c["T1"], c["T2"]) == pytest.approx((t[0], t[0] + t[1]), abs=1e-7)
        assert 0 <= c["T1"] <= c["T2"] <= 1
        assert c["T1"] == pytest.approx(np.clip(t[0], 0, 1), abs=1e-11)
        assert c["T2"] == pytest.approx(np.clip(t[0] + t[1], c["T1"], 1), abs=1e-11)


def counter(c):
    """The level after each change of an up-counter. Its compare events have a higher priority than
    its start."""
    events = {c["first"]: "start", c["CA"]: "toggle"}
    assert c["CB"] not in events or c["CB"] == c["period"]
    events[c["CB"]] = "toggle"
    level, levels = None, []
    for count in sorted(events):
        if count >= c["period"]:
            break
        level = c["start"] if events[count] == "start" else 1 - level
        levels.append((count, level))
    return levels


def test_compare_registers_give_the_sequence():
    cases = rows("compare")
    assert {c["sequence"] for c in cases} == set(range(8))
    assert min(c["T1"] for c in cases) == 0  # they include the hazards
    assert any(0 < c["T1"] == c["T2"] < 1 for c in cases)
    for c in cases:
        first, period, shortest = c["first"], c["period"], c["shortest"]
        s = [c["sequence"] >> b & 1 for b in (2, 1, 0)]
        ends = [min(first + c[t] * period, period) for t in ("T1", "T2")] + [period]
        begins = [first, *ends[:-1]]
        levels = counter(c)
        lasts = np.diff([count for count, _ in levels] + [period])
        assert lasts.min() >= shortest
        words = itertools.groupby(zip(s, begins, ends), lambda word: word[0])
        wanted = [(level, sum(end - begin for _, begin, end in group)) for level, group in words]
        if min(time for _, time in wanted) >= shortest + 0.5:  # every level has its time
            assert [level for _, level in levels] == [level for level, _ in wanted]
            assert lasts == pytest.approx([time for _, time in wanted], abs=1.0)
        high = sum(time for (_, level), time in zip(levels, lasts) if level)
        # Each of two edges moves by half of the shortest pulse at most, or, where there is no room
        # for two, by less than a whole one.
        most = shortest if period - first >= 4 * shortest else 2 * shortest
        assert abs(high - sum(time for level, time in wanted if level)) <= most + 1.0


def test_sectors_follow_from_the_angle():
    for c in rows("sectors"):
        angle = np.rad2deg(np.arctan2(c["beta"], c["alpha"])) - 30 * c["sector"]
        assert abs((angle + 180) % 360 - 180) < 15


def test_selection_table_is_a_half_plane():
    for c in rows("selection"):
        angle = (30 * c["xy_sector"] - LARGE_XY_DEG[c["k"]] + 180) % 360 - 180
        assert c["table"] == (2 if abs(angle) < 90 else 1)


# --- the files --------------------------------------------------------------------


def test_regeneration_gives_identical_files():
    script = VECTORS / "generate.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_generator_does_not_import_hexatorque():
    """It runs in an interpreter that cannot import the package."""
    script = VECTORS / "generate.py"
    code = (
        "import runpy, sys; sys.modules['hexatorque'] = None; sys.argv = ['x', '--check']; "
        f"sys.path.insert(0, {str(VECTORS)!r}); "
        f"runpy.run_path({str(script)!r}, run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_c_tables_hold_the_numbers_of_the_json_files(tmp_path):
    """The test reads the header itself: every number of the columns that C uses."""
    made = tmp_path / "vectors.h"
    subprocess.run([sys.executable, VECTORS / "header.py", made], check=True)
    text = made.read_text()
    code = {"45/135": 0, "75/105": 1, "dtc1": 0, "dtc2": 1, "dtc3": 2, "L": 0, "ML": 1}
    used = {
        ("states", "states"): ("alpha", "beta", "x", "y", "nearest_zero"),
        ("paper_a", "table_2"): ("sequence", "word1", "word2", "word3"),
        ("sectors", "sectors"): ("alpha", "beta", "sector"),
        ("switching", "switching"): ("table", "sector", "torque", "flux", "k"),
        ("selection", "selection"): ("k", "xy_sector", "table"),
        ("decisions", "decisions"): (
            "scheme", "sector", "d_m", "d_psi", "word_against", "word_along",
        ),
        ("duties", "duties"): ("group", "k", "v_x", "v_y", "T1", "T2"),
        ("compare", "compare"): (
            "T1", "T2", "sequence", "period", "first", "shortest", "start", "CA", "CB",
        ),
    }  # fmt: skip
    bodies = re.findall(r"_rows\[(\d+)\] HT_ROM = \{\n(.*?)\n\};", text, re.S)
    assert len(bodies) == len(used)
    for (count, body), ((file, table), columns) in zip(bodies, used.items(), strict=True):
        wanted = []
        for c in rows(file, table):
            for column in columns:
                value = c[column]
                if table == "table_2" and column == "sequence":
                    wanted += map(int, value)
                else:
                    wanted.append(code[value] if isinstance(value, str) else value)
        got = [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", body)]
        assert int(count) == len(rows(file, table))
        assert got == pytest.approx(wanted, rel=1e-8, abs=1e-11)


def test_files_are_small():
    sizes = [file.stat().st_size for file in VECTORS.glob("*.json")]
    assert len(sizes) == 12 and max(sizes) < 300_000
