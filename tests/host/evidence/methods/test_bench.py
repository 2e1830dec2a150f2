"""The test bench of the comparisons against the usual procedure: the drive's own speed loop, two
seconds of settling, half a second of recording."""

import itertools
import math
import re
from pathlib import Path

import pytest
from campaigns import part

from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.methods import bench
from hexatorque.evidence.methods.places import TWENTY
from hexatorque.experiments.operating_points import MOST_EDGES

PAGE = Path(__file__).parents[4] / "docs" / "results.md"
CASES = [
    (place, scheme)
    for place, scheme in itertools.product(TWENTY, ("dtc1", "ddr", "db-dtfc"))
    if place.torque_Nm and abs(place.speed_rpm) > 20  # half a second holds two cycles
]


def by_the_speed_loop(scheme, place):
    setup = bench.bench_setup(place.base, scheme, {}).changed(
        controller__control_mode="speed",
        machine__inertia_kgm2=place.base["machine.inertia_kgm2"],
    )
    sim = SimulatedDrive(setup, bench.SAMPLES)
    sim.start()
    sim.run(0.4, record=False)
    sim.set("speed_ref_rpm", float(place.speed_rpm))
    sim.run(0.5 + abs(place.speed_rpm) / 1000, record=False)
    sim.set("load_Nm", math.copysign(1.0, place.speed_rpm) * place.torque_Nm)
    sim.run(2.0, record=False)
    sim.check()
    sim.log_edges(round(0.5 / sim.period_s + 100) * MOST_EDGES)
    start, begin = sim.inverter.leg.copy(), sim.periods
    sim.run(0.5)
    return bench.figures(sim.take(), sim.edges_since(begin, start))


@pytest.mark.parametrize(("place", "scheme"), part(CASES, 6), ids=str)
def test_the_bench_differs_from_a_speed_loop_by_what_the_page_tells(place, scheme):
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    told = re.search(
        r"Td differs by up to (\d+) % and THD∞ by up to (\d+) %; "
        r"`dtc1`'s THD∞ is up to (\d+) % lower", text,
    )  # fmt: skip
    td_pct, thd_pct, lower_pct = map(float, told.groups())
    ours, theirs = bench.measure(scheme, {}, place), by_the_speed_loop(scheme, place)
    for name, below, above in (
        ("td_Nm", td_pct, td_pct),
        ("thd_inf_pct", lower_pct if scheme == "dtc1" else thd_pct, thd_pct),
    ):
        assert 1 - below / 100 <= ours[name] / theirs[name] <= 1 + above / 100, name
