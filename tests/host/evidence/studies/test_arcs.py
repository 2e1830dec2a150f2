"""The campaign of phases that open with an arc: its quick form holds, and it can fail."""

from types import SimpleNamespace

import pytest

from hexatorque import firmware
from hexatorque.evidence.studies import arcs
from hexatorque.plant.vsd import PHASES


@pytest.fixture(scope="module")
def result():
    return arcs.study(quick=True)


def test_every_phase_is_named_and_the_drive_goes_on(result):
    assert arcs.failures(result) == []


def test_tables_count_every_run(result):
    rows = result["rows"]
    by_arc, by_contact, on = arcs.grid(result)
    for _, _, lines in (by_arc, by_contact):
        assert sum(int(line[1].split(" of ")[1]) for line in lines) == len(rows) > 40
    assert sum(int(line[1].split(" of ")[1]) for line in on[2]) == sum(
        row["campaign"] == "goes on" for row in rows
    )


def test_the_picture_is_drawn(result, tmp_path):
    assert arcs.plot(result, tmp_path / "arcs.png").stat().st_size > 10_000


def test_the_whole_campaign_has_every_phase_under_every_scheme():
    cases = arcs.cases(quick=False)
    assert sum(len(own) for own in cases.values()) >= 2000
    for own in cases.values():
        assert {(c.scheme, c.phase) for c in own} == {
            (scheme, phase) for scheme in firmware.schemes() for phase in PHASES
        }
        assert len({c.seed for c in own}) == len(own)
    modes = {(c.scheme, c.phase, c.mode) for c in cases["goes on"]}
    assert len(modes) == 2 * len(PHASES) * len(firmware.schemes())
    assert {c.scheme for c in arcs.cases(quick=True)["stops"]} == set(firmware.schemes())


def test_what_is_drawn_covers_contacts_and_fuses(result):
    rows = result["rows"]
    most_V = arcs.MOST_VDC * result["vdc_V"]
    volts = sorted(row["arc_V"] for row in rows)
    assert arcs.LEAST_V <= volts[0] < 10 and 0.5 * most_V < volts[-1] <= most_V
    assert {arcs._kind(row) for row in rows} == set(arcs.KINDS)
    for row in rows:
        assert row["bounce_ms"] == 0 or 1 <= row["bounce_ms"] <= 20
    assert len({round(row["figures"]["found_ms"], 3) for row in rows if row["figures"]}) > 10


def row(**values):
    case = {"scheme": "ddr", "phase": "u1"}
    return {
        "campaign": "goes on", "case": case, "arc_V": 30.0, "speed_rpm": 100.0, "load_Nm": 1.0,
        "outcome": "right", "error": "", "figures": {"sound_off": 0.0},
    } | values  # fmt: skip


@pytest.mark.parametrize(
    ("bad", "number", "failed"),
    (
        (row(outcome="sound", error="sound: w1 named"), 1, 1),
        (row(figures={"sound_off": 1.0}, error="a sound leg is off"), 1, 1),
        (row(outcome="late", error="late: nothing"), 1, 0),
        (row(outcome="late", error="late: nothing"), 6, 6),
        (row(error="stopped: overcurrent"), 6, 6),
    ),
)
def test_a_sound_leg_and_too_many_other_errors_are_failures(bad, number, failed):
    rows = [row() for _ in range(1000 - number)] + [bad] * number
    assert len(arcs.failures({"rows": rows})) == failed


def test_a_drive_that_does_not_run_before_the_loss_is_an_error(monkeypatch):
    monkeypatch.setattr(arcs.lost_phase, "settle_at", lambda sim, *_: sim.stop())
    result = arcs.run(arcs.Case(30_000, "ddr", "u1"))
    assert (result.outcome, result.error) == ("other", "idle before the loss: ")


@pytest.mark.parametrize(
    ("warnings", "state", "outcome"),
    (
        (32, "fault", "right"), (32 + 64, "run", "right"), (16, "run", "sound"),
        (48, "run", "sound"), (0, "run", "late"), (0, "fault", "other"),
    ),
)  # fmt: skip
def test_outcomes(warnings, state, outcome):
    controller = SimpleNamespace(channel={"warnings": float(warnings)}.__getitem__)
    assert arcs._outcome(SimpleNamespace(controller=controller, state=state), "u1") == outcome
