"""docs/errata.md: the checks that it names exist. The checks that belong to no other file are
here."""

import re
from pathlib import Path

import doc_page
import numpy as np
import pytest

from hexatorque import setups
from hexatorque.evidence.papers import ENTRIES
from hexatorque.experiments import operating_points

ROOT = Path(__file__).parents[4]
PAGE = ROOT / "docs" / "errata.md"
TEXT = PAGE.read_text()


def test_named_checks_exist():
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", TEXT)
    assert len(named) > 20
    for file, function in named:
        source = (ROOT / file).read_text()
        assert not function or f"def {function}(" in source, f"{file}::{function}"
    figures = set(re.findall(r"`([AB]-?T?\d+)`", TEXT))
    assert len(figures) > 8
    assert figures <= set(ENTRIES)


def test_every_entry_names_its_check():
    entries = TEXT[TEXT.index("## Paper A") : TEXT.index("## Values")].split("\n**")[1:]
    assert len(entries) > 18
    for entry in entries:
        assert re.search(r"`tests/|`[AB]-?T?\d+`", entry), entry.splitlines()[0]


def test_every_assumed_value_is_listed():
    """The list has every assumed value and no other."""
    listed = {
        (setup, section, key)
        for setup, section, keys in doc_page.read_data(PAGE, "assumed")[1:]
        for key in re.findall(r"\w+", keys)
    }
    assumed = {
        (name, section, key)
        for name in ("paper-a", "paper-b")
        for section, entries in setups.load(name).values.items()
        for key, value in entries.items()
        if value.tag == "assumed"
    }
    assert listed == assumed


def test_rated_point_of_paper_a_is_out_of_reach():
    """By the back-EMF alone."""
    setup = setups.load("paper-a")
    omega = 1350 * 2 * np.pi / 60 * setup["machine.pole_pairs"]
    emf_V = omega * setup.parameter("flux_ref_Wb")
    assert emf_V == pytest.approx(169.6, abs=0.1)
    vdc_V = setup["inverter.vdc_V"]
    # Vectors without x-y mean give 1/sqrt 3 around the circle. 12-step operation of large vectors
    # has the highest possible fundamental.
    assert vdc_V / np.sqrt(3) < 144.4 < 2 * vdc_V / np.pi < 159.2 < emf_V


@pytest.mark.parametrize(
    ("changes", "held"), [({}, False), ({"controller__flux_ref_Wb": 0.4}, True)]
)
def test_fdr_holds_the_rated_point_of_paper_a_only_with_less_flux(changes, held):
    setup = setups.load("paper-a").changed(controller__scheme="fdr", **changes)
    failure = operating_points.holds(operating_points.Point(setup, 1350, 10))
    assert (failure is None) == held


def test_xy_gains_are_in_units_of_vdc():
    """With gains per volt, the fifth harmonic at 100 r/min and 10 N m stays as large as FDR's."""
    setup = setups.load("paper-a-feasible")
    volt = setup["inverter.vdc_V"]
    changes = {
        "fdr": {"controller__scheme": "fdr"},
        "per unit": {},
        "per volt": {"controller__kp_xy_pu_A": 0.1 / volt, "controller__ki_xy_pu_As": 2.5 / volt},
    }
    fifth = {
        name: operating_points.measure(
            operating_points.Point(setup.changed(**change), 100, 10)
        ).metrics["h5_pct"]
        for name, change in changes.items()
    }
    assert fifth["per unit"] < 0.3 * fifth["fdr"]
    assert fifth["per volt"] > 0.8 * fifth["fdr"]


def test_leakages_of_paper_b_are_equal():
    setup = setups.load("paper-b")
    assert setup["machine.lls_H"] == setup["machine.llr_H"] == 14.4e-3


def test_sigma_of_paper_b():
    """sigma L_s is the inductance of a stator with a shorted rotor: L_ls + L_m || L_lr, which is
    below L_s. The printed form is above 1 and depends on the unit of inductance."""
    lm, ll = 256e-3, 14.4e-3
    ls = lr = lm + ll
    transient = ll + lm * ll / (lm + ll)
    right = 1 - lm**2 / (ls * lr)
    assert right == pytest.approx(transient / ls, rel=1e-12)
    assert right == pytest.approx(0.104, abs=5e-4)
    assert setups.load("paper-b").controller_values()["sigma_ls_H"] == pytest.approx(
        transient, rel=1e-9
    )
    printed = (1 - lm**2) / (ls * lr)
    assert printed == pytest.approx(12.8, abs=0.05)
    assert (1 - 256**2) / (270.4 * 270.4) < 0  # the same in millihenry


@pytest.mark.parametrize("scheme", ["dtc1", "dtc2", "dtc3"])
def test_torque_error_that_the_comparators_leave(scheme):
    """The mean of reference minus estimate at 2 N m is between 0 and H_A = 0.173 N m at 500 r/min.
    At 2500 r/min it is larger, but below H_B = 0.3 N m."""
    setup = setups.load("paper-b").changed(controller__scheme=scheme)
    error = {}
    for rpm in (500, 2500):
        rec = operating_points.measure(operating_points.Point(setup, rpm, 2)).recording
        error[rpm] = float(np.mean(rec["torque_ref_Nm"] - rec["torque_Nm"]))
    assert 0.02 < error[500] < 0.173 < error[2500] < 0.3
