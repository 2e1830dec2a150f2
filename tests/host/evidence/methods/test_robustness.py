"""Each error reaches the part of the drive that it is about, and the limits are checked."""

import numpy as np
import pytest

from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.methods import robustness
from hexatorque.evidence.methods.robustness import (
    ERRORS,
    MACHINE_ERRORS,
    PARTS,
    POINTS,
    Error,
)
from hexatorque.evidence.methods.variants import VARIANTS, Variant
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
    for error in (*ERRORS, *MACHINE_ERRORS):
        for name, factor in error.factors.items():
            wrong = robustness.wrong_setup("paper-b", error, VARIANTS[-1])
            right = robustness.wrong_setup("paper-b", ERRORS[0], VARIANTS[-1])
            assert wrong.parameter(name) == pytest.approx(factor * right.parameter(name))
            assert (wrong.machine_values() == right.machine_values()) == (error.knee == 0)


def test_noise_and_saturation_are_of_the_machine_that_they_are_about():
    """The machine takes more current than a drive believes that is told of no saturation."""
    errors = {error.name: error for error in MACHINE_ERRORS}
    for name in ("paper-b", "large-110kw"):
        noisy = robustness.wrong_setup(name, errors["noise 0.4 % of the range"], VARIANTS[-2])
        assert noisy["sensors.i_noise_A"] == pytest.approx(0.004 * noisy["sensors.i_full_A"])
    row = robustness.run(POINTS[-1], errors["the machine saturates"], VARIANTS[-2])
    right = robustness.run(POINTS[-1], ERRORS[0], VARIANTS[-2])
    assert row.figures["thd_inf_pct"] < 0.97 * right.figures["thd_inf_pct"]


def test_a_setting_that_the_drive_refuses_is_no_trip():
    wrong = Error("L_xy × 0.2", {"lxy_H": 0.2})
    row = robustness.run(("small-2kw", 500.0, 6.7), wrong, Variant("db-dtfc"))
    assert row.lost.startswith("refused: ") and robustness._cell(vars(row)) == "refused"


def test_what_is_lost_is_named():
    row = robustness.run(POINTS[-1], Error("", {"i_trip_A": 0.1}), VARIANTS[0])
    assert "over-current" in row.lost and not row.figures


def _result():
    figures = {key: 1.0 for key in robustness.FIGURES}
    rows = [
        {"setup": p[0], "speed_rpm": p[1], "load_Nm": p[2], "error": e.name, "variant": v.label,
         "figures": dict(figures), "lost": "", "part": number}
        for number, part in enumerate(PARTS)
        for p in part.points for e in part.errors[:2] for v in part.variants
    ]  # fmt: skip
    return {"rows": rows}


def test_tables_picture_and_limits(tmp_path):
    result = _result()
    assert robustness.failures(result) == []
    assert [len(rows) for _, _, rows in robustness.grid(result)] == [2] * (
        len(POINTS) + len(PARTS[1].points)
    )
    path = robustness.plot(result, tmp_path / "robustness.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000
    ours = [row for row in result["rows"] if row["variant"] == "db-dtfc"]
    ours[0]["lost"] = "over-current"
    ours[1]["figures"]["thd_inf_pct"] = 1.1
    lines = robustness.failures(result)
    assert [line.split(": ")[-1] for line in lines] == [
        "over-current", "THD∞ [%] 1.1, best other 1",
    ]  # fmt: skip


def test_the_limits_of_the_interleaved_law():
    result = _result()
    ours = [row for row in result["rows"] if row["variant"] == robustness.INTERLEAVED.label]
    wrong = [row for row in ours if row["error"] in robustness.WRONG]
    for row in ours:
        row["figures"]["torque_ripple_td_Nm"] = 0.5
    wrong[0]["figures"]["torque_ripple_td_Nm"] = 0.61
    wrong[1]["figures"]["torque_ripple_td_Nm"] = 1.1
    wrong[2]["lost"] = "over-current"
    lines = [line.split(": ")[-1] for line in robustness.failures(result)]
    assert sorted(lines) == sorted(
        ["Td 0.61 N m, allowed 0.6", "Td 1.1 N m, allowed 0.6", "Td 1.1 N m, of db-dtfc 1",
         "over-current"]
    )  # fmt: skip
