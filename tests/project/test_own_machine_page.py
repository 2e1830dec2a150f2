"""The page about a machine of one's own works as it says (`pages`)."""

import os
import re

from pages import DOCS, PART, follow

from hexatorque.setups import estimate
from hexatorque.setups.published import machines

PAGE = (DOCS / "own-machine.md").read_text()


def test_every_command(terminals):
    follow(PAGE, terminals)
    assert {"first.npz", "first.png"} <= set(os.listdir(terminals.folder / "out"))


def test_every_command_is_run():
    assert not [part for part in PART.finditer(PAGE) if part["what"] == "not run"]


def test_the_ranges_are_those_of_the_code():
    table = PAGE.split("<!-- compared with the code: spread -->")[1]
    rows = {
        m[1]: m.groups()[1:] for m in re.finditer(r"(?m)^\| (.+?) \| ([\d.]+) \| ([\d.]+) ", table)
    }
    spread = estimate.spread()
    names = {"R_s": "rs_ohm", "R_r": "rr_ohm", "leakages, σL_s": "lls_H", "L_m": "lm_H"}
    for shown, name in (*names.items(), ("flux", "flux_Wb")):
        digits = 2 if name == "flux_Wb" else 1
        factors = spread.factors[name]
        assert rows[shown] == tuple(f"{factors[told]:.{digits}f}" for told in (True, False)), shown
    assert rows["inertia"] == (f"{spread.inertia:.1f}",) * 2
    assert f"{len(machines())} published machines" in PAGE
