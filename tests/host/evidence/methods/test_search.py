"""The search that both comparisons share: what it covers, how it refines, and how it continues."""

import numpy as np
import pytest

from hexatorque import firmware, laws
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.methods import bench, fsw, references, search
from hexatorque.evidence.methods.methods import (
    FAMILIES,
    MODULATED,
    OURS,
    OWN,
    SAMPLES,
    controller,
    methods,
    variants,
)
from hexatorque.evidence.methods.places import MACHINES, PLACES, TWENTY
from hexatorque.evidence.papers.engine.job import Job

BY_NAME = {method.name: method for method in methods()}
#: Search, point, method.
TASKS = (
    (fsw.SEARCH, TWENTY[0], variants()[0]),
    (references.SEARCH, PLACES[3], BY_NAME["dtc1"]),
    (references.SEARCH, PLACES[3], BY_NAME["dtc3"]),
)
tasks = pytest.mark.parametrize(
    ("way", "place", "method"), TASKS, ids=lambda task: getattr(task, "name", None)
)


def test_twenty_points_on_two_machines_in_all_quadrants():
    assert len(TWENTY) == len(set(TWENTY)) == 20
    assert {place.setup for place in TWENTY} == {"paper-a-feasible", "paper-b"}
    assert any(place.speed_rpm < 0 for place in TWENTY)
    assert any(place.torque_Nm < 0 for place in TWENTY)


def test_all_schemes_and_references_are_compared_on_four_machines():
    assert {name.split()[0] for name in BY_NAME} == {*firmware.schemes(), *laws.names()}
    assert len({place.setup for place in PLACES}) == len(MACHINES) == 4
    assert len(references.LIMITS_HZ) >= 6
    assert {method.family for method in methods()} == set(FAMILIES)


def test_every_scheme_has_sixty_settings():
    for scheme in (*firmware.table_schemes(), OURS):
        own = [variant.extent for variant in variants() if variant.scheme == scheme]
        assert sum(extent.cover + sum(extent.rounds) for extent in own) >= 60


def test_every_method_has_the_same_budget():
    assert len({(method.extent, method.quick) for method in methods()}) == 1
    # Every pair of a figure and a limit is refined in each round.
    targets = references.SEARCH.targets
    assert set(methods()[0].extent.rounds) == {len(targets)}
    assert len(set(targets)) == len(references.LIMITS_HZ) * len(references.JUDGED)


def test_what_is_a_choice_has_no_part_of_the_budget_for_values():
    """Where our law is clamped is not searched in a variant that is clamped, or is not."""
    variants = [method for method in methods() if method.scheme == OURS]
    assert len(variants) == 4
    for method in variants:
        free, fixed = {axis.name for axis in method.axes}, {name for name, _ in method.fixed}
        assert not free & fixed
        assert ({"kappa", "clamp"} <= free) == method.name.endswith(" free")
        assert method.name.endswith(" free") or "kappa" in fixed


def test_a_latin_hypercube_has_one_setting_in_each_interval():
    at = search.latin_hypercube(np.random.default_rng(1), 16, 4)
    for axis in at.T:
        assert sorted((16 * axis).astype(int)) == list(range(16))


CORNERS = [(TWENTY[1], variant) for variant in variants()]
CORNERS += [(PLACES[3], method) for method in methods()]


@pytest.mark.parametrize(
    ("place", "method"),
    CORNERS,
    ids=[f"{method.name} {place.name[0]}" for place, method in CORNERS],
)
def test_the_drive_takes_every_corner(place, method):
    """Except that the firmware refuses so few samples in a time constant of paper B's machine."""
    free = len(method.axes)
    for share in (0.0, 0.5, 1.0):
        if share == 0.0 and place is PLACES[3] and method.family == MODULATED:
            continue
        row = method.values(place.base, np.full(free, share))
        law = method.law(place.base, row)
        setup = bench.bench_setup(place.base, method.scheme, controller(row))
        sim = SimulatedDrive(
            setup, SAMPLES, laws.controller_of(law) if law else firmware.Controller
        )
        assert 1 / sim.period_s == pytest.approx(row["f_isr_Hz"])
        assert sim.controller.get("scheme") == method.name.split()[0]


@tasks
def test_a_larger_budget_continues_the_same_search(counted, tmp_path, way, place, method):
    """What was found with the smaller budget is still there, so a method cannot lose by it."""
    job = Job(False, tmp_path)
    once = search.settings(job, way, place, method, 1)
    assert len(once) == len(counted) == method.extent.settings
    twice = search.settings(job, way, place, method, 2)
    assert twice[: len(once)] == once and len(twice) == 2 * len(once) == len(counted)
    assert search.settings(job, way, place, method, 1) == once  # it sees its own part
    assert len(counted) == len(twice)
    assert search.settings(Job(False, tmp_path / "anew"), way, place, method, 2) == twice


@tasks
def test_an_interrupted_search_continues(replaced, counted, tmp_path, way, place, method):
    whole = search.settings(Job(False, tmp_path / "whole"), way, place, method)
    stand_in, job = bench.measure, Job(False, tmp_path)

    def interrupted(*case):
        if len(calls) == method.extent.cover + 3:
            raise KeyboardInterrupt
        return stand_in(*case)

    calls = replaced(interrupted)
    with pytest.raises(KeyboardInterrupt):
        search.settings(job, way, place, method)
    calls = replaced(stand_in)
    assert search.settings(job, way, place, method) == whole
    assert len(calls) == sum(method.extent.rounds)  # the first round was kept
    assert search.settings(job, way, place, method) == whole
    assert len(calls) == sum(method.extent.rounds)


def test_the_refinement_comes_closer_to_the_limit(unequal, tmp_path):
    """Td times f_sw is constant, so the best setting is the one nearest to the limit."""
    way, place, method = TASKS[0]
    rows = search.settings(Job(False, tmp_path), way, place, method)
    first = search.best(search.held(rows[: method.extent.cover]), "td_Nm", 3e3)
    last = search.best(search.held(rows), "td_Nm", 3e3)
    assert first["td_Nm"] > last["td_Nm"] >= 0.1
    slow = search.best(search.held(rows), "td_Nm", 3e3, fsw.SLOW_HZ)
    assert slow["f_isr_Hz"] <= fsw.SLOW_HZ and slow["td_Nm"] >= last["td_Nm"]


def test_the_search_comes_to_just_below_each_limit(counted, tmp_path):
    """Td times f_sw is constant: the best setting is the one nearest to the limit. A random search
    with as many settings leaves gaps of several per cent."""
    for name in ("foc", "dtc1", "fcs-mpc"):
        job = Job(False, tmp_path)
        rows = search.held(search.settings(job, references.SEARCH, PLACES[3], BY_NAME[name]))
        least_Hz = min(row["f_sw_Hz"] for row in rows)
        for limit_Hz in references.LIMITS_HZ:
            row = search.best(rows, "td_Nm", limit_Hz)
            if limit_Hz > 1.1 * least_Hz and limit_Hz < 3.6e3:
                assert row["f_sw_Hz"] > 0.97 * limit_Hz, (name, limit_Hz)


def test_only_the_rivals_get_the_larger_budget(counted, tmp_path):
    points = references.searched(Job(True, tmp_path), 3)
    tried = {}
    for scheme, *_ in counted:
        tried[scheme] = tried.get(scheme, 0) + 1
    once = len(MACHINES) * methods()[0].quick.settings
    for scheme in OWN:
        assert tried[scheme] == sum(method.scheme == scheme for method in methods()) * once
    assert tried["foc"] == 3 * once
    assert len(points) == len(MACHINES)


def test_a_refused_setting_is_one_that_does_not_hold_the_point(tmp_path):
    place = MACHINES[2].place  # high inductance: the firmware wants more samples
    row = search.measure(references.SEARCH, BY_NAME["foc"], place, np.zeros(1), Job(True, tmp_path))
    assert "f_isr_Hz" in row and not search.held([row])


def test_a_drive_that_does_not_hold_the_point_is_left_out():
    place = type(PLACES[3])("paper-b", 4100, 6.0)
    values = variants()[0].values(place.base, np.full(3, 0.4))
    assert bench.measure("dtc1", values, place, window_s=0.05) is None
