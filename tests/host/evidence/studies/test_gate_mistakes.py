"""A campaign fails if a gate was commanded what no power stage may see, whatever else it judges."""

from dataclasses import asdict

import pytest

from hexatorque import setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import (
    arcs,
    commissioning,
    lost_phase,
    low_speed,
    transients,
    wrong_lxy,
)
from hexatorque.experiments.acceptance import accept
from hexatorque.experiments.operating_points import NotReached

MISTAKE = "a gate pulse of"


def of_lost_phases(campaign):
    case = lost_phase.Case(
        1, "db-dtfc", "u1", "open", "off" if campaign != "goes on" else "least-loss"
    )
    row = {"campaign": campaign, **asdict(lost_phase.run(campaign, case))}
    return lost_phase.failures({"rows": [row]})


def of_arcs():
    row = {"campaign": "stops", **asdict(arcs.run(arcs.Case(30_000, "db-dtfc", "u1")))}
    rights = [{**row, "outcome": "right", "error": ""}] * 999  # one more is within what is allowed
    return arcs.failures({"rows": [row, *rights]})


def of_wrong_lxy():
    case = wrong_lxy.Case(50_000, 1.0, "db-dtfc", "u1", "open")
    return wrong_lxy.failures({"rows": [asdict(wrong_lxy.run(case))]})


def of_low_speed():
    case = low_speed.Case("voltage", "ddr", 30.0, 10.0)  # only the hybrid's errors are judged
    return low_speed.failures({"rows": [asdict(case) | asdict(low_speed.run(case, 1.5))]})


def of_transients():
    row = transients.course(setups.load("small-2kw"), "ddr")
    return transients.failures({"machines": [{"schemes": {"ddr": row}, "wrong": []}]})


def of_commissioning():
    setup = setups.load("paper-b")
    row = {"name": "paper-b", "power_kW": 1.0, **commissioning.measured(setup, ("encoder",))}
    return commissioning.failures({"machines": [], "built_in": [row], "miswirings": []})


CAMPAIGNS = {
    **{f"lost phases, {name}": (of_lost_phases, name) for name in lost_phase.RUN},
    "arcs": (of_arcs,),
    "wrong L_xy": (of_wrong_lxy,),
    "low speed": (of_low_speed,),
    "transients": (of_transients,),
    "commissioning": (of_commissioning,),
}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_short_pulse_fails_a_campaign(name, monkeypatch):
    failures, *of = CAMPAIGNS[name]
    monkeypatch.setattr(SimulatedDrive, "short_pulses", 1)
    lines = [line for line in failures(*of) if MISTAKE in line]
    assert len(lines) == 1


def test_a_drive_with_a_short_pulse_is_not_accepted(monkeypatch):
    """The campaign of machines judges by this run."""
    setup, course = setups.load("small-2kw"), ((0.5, 0),)
    assert accept(setup, course).state == "idle"
    monkeypatch.setattr(SimulatedDrive, "short_pulses", 1)
    with pytest.raises(NotReached, match=MISTAKE):
        accept(setup, course)
