"""Each error reaches the part of the drive that it is about, and the limits are checked."""

import numpy as np
import pytest

from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import robustness
from hexatorque.evidence.studies.robustness import ERRORS, POINTS, VARIANTS, Error, Variant
from hexatorque.experiments.prepare import other_dead_time
from hexatorque.plant.legs import OFF


@pytest.mark.parametrize("by_us", [-0.5, 0.5])
def test_the_gates_have_another_dead_time_and_the_firmware_does_not_know(by_us):
    setup = Variant("db-dtfc").setup("paper-b")
    sim = SimulatedDrive(setup, 1)
    other_dead_time(by_us)(sim)
    sim.start()
    sim.run(0.36, record=False)
    sim.log_edges(2000)
    sim.run(0.005, record=False)
    pauses = []
    for leg in range(6):
        own = sim.edges[sim.edges[:, 1] == leg]
        pause = (own[:-1, 2] == OFF) & (own[1:, 2] != OFF)
        pauses += list(np.diff(own[:, 0])[pause])
    clock_Hz = float(sim.controller.map.pwm_clock_Hz)
    assert min(pauses) / clock_Hz == pytest.approx((2.0 + by_us) * 1e-6, abs=1e-8)
    assert sim.controller.number("dead_time_us") == 2.0
    assert sim.controller.registers.violations == 0


def test_a_factor_changes_the_controller_and_not_the_machine():
    for error in ERRORS:
        for name, factor in error.factors.items():
            wrong = robustness.wrong_setup("paper-b", error, VARIANTS[-1])
            right = robustness.wrong_setup("paper-b", ERRORS[0], VARIANTS[-1])
            assert wrong.parameter(name) == pytest.approx(factor * right.parameter(name))
            assert wrong.machine_values() == right.machine_values()


def test_what_is_lost_is_named():
    row = robustness.run(POINTS[-1], Error("", {"i_trip_A": 0.1}), VARIANTS[0])
    assert "over-current" in row.lost and not row.figures


def _result():
    figures = {key: 1.0 for key in robustness.FIGURES}
    rows = [
        {"setup": p[0], "speed_rpm": p[1], "load_Nm": p[2], "error": e.name, "variant": v.label,
         "figures": dict(figures), "lost": ""}
        for p in POINTS for e in ERRORS[:2] for v in VARIANTS
    ]  # fmt: skip
    return {"rows": rows}


def test_tables_picture_and_limits(tmp_path):
    result = _result()
    assert robustness.failures(result) == []
    assert [len(rows) for _, _, rows in robustness.grid(result)] == [2] * len(POINTS)
    path = robustness.plot(result, tmp_path / "robustness.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000
    ours = [row for row in result["rows"] if row["variant"] == "db-dtfc"]
    ours[0]["lost"] = "over-current"
    ours[1]["figures"]["thd_inf_pct"] = 1.1
    lines = robustness.failures(result)
    assert [line.split(": ")[-1] for line in lines] == [
        "over-current", "THD∞ [%] 1.1, best other 1",
    ]  # fmt: skip
