"""The study of flux and voltage that change: healthy machines do not trip, a wrong flux is found,
and its verdicts are those of its runs."""

import copy

import pytest

from hexatorque.evidence.studies import transients


@pytest.fixture(scope="module")
def result():
    return transients.study(quick=True)


def test_healthy_machines_run_and_wrong_estimates_are_found(result, tmp_path):
    runs = [row for m in result["machines"] for row in m["schemes"].values()]
    assert len(runs) > len(result["machines"]) == transients.QUICK
    for row in runs:
        assert row["lost"] == "" and row["off_circle"] < 1 and row["largest_A"] < row["trip_A"]
    assert transients.failures(result) == []
    path = transients.plot(result, tmp_path / "transients.png")
    assert path.read_bytes()[:4] == b"\x89PNG"


def test_a_voltage_that_is_read_too_small_stops_every_drive_within_half_a_second(result):
    name = transients.WRONGS[0][0]
    rows = [row for m in result["machines"] for row in m["wrong"] if row["wrong"] == name]
    assert len(rows) == transients.QUICK
    assert all(row["before"] == [] and row["found"] and row["time_s"] < 0.5 for row in rows)


def test_the_check_of_the_flux_alone_finds_three_dead_sensors(result):
    name = transients.WRONGS[1][0]
    rows = [row for m in result["machines"] for row in m["wrong"] if row["wrong"] == name]
    found = [row for row in rows if "flux estimate" in row["found"]]
    assert len(found) >= 0.75 * len(rows)
    assert all(row["off"] < transients.WRONG for row in rows if row not in found)


def test_too_many_trips_and_too_few_finds_are_failures(result):
    worse = copy.deepcopy(result)
    for row in worse["machines"][0]["schemes"].values():
        row["lost"] = "drive tripped: flux estimate cannot be right"
    for m in worse["machines"]:
        m["wrong"][0].update(found="", off=0.5)
    runs = sum(len(m["schemes"]) for m in worse["machines"])
    lost = len(worse["machines"][0]["schemes"])
    assert transients.failures(worse) == [
        f"healthy: {runs - lost} of {runs} runs without a trip, needed are 97 %",
        f"{transients.WRONGS[0][0]}: 0 of {transients.QUICK} found, needed are 95 %",
    ]
    healthy, wrong = transients.tables(worse)
    assert len(healthy.rows) == len({s for m in result["machines"] for s in m["schemes"]})
    assert len(wrong.rows) == len(transients.WRONGS)
