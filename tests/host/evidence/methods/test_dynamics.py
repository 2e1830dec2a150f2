"""The law's torque step in the closed loop, and the study's tables and limits."""

import pytest

from hexatorque.evidence.methods import dynamics
from hexatorque.evidence.methods.variants import VARIANTS, Variant


@pytest.mark.parametrize("step", dynamics.TORQUE_STEPS[-2:-1])
def test_torque_rises_as_fast_as_under_dtc1(step):
    ours, dtc1 = (
        dynamics.torque_steps(Variant(s), *step, progress=None) for s in ("db-dtfc", "dtc1")
    )
    # When a switch turns on depends on last bits, which other versions of the libraries round
    # differently. So the limit is wider than dynamics.RISE_LIMIT.
    for way in ("rise_up_ms", "rise_down_ms"):
        assert ours[way] <= 1.2 * dtc1[way]
    assert ours["overshoot_pct"] < 8


def _result():
    torque = {"rise_up_ms": 1.0, "rise_down_ms": 0.5, "overshoot_pct": 5.0}
    speed = {"settling_ms": 500.0, "overshoot_rpm": 10.0, "deviation_rpm": 200.0, "peak_A": 4.0}
    rows = [
        {"test": test, "setup": "paper-b", "speed_rpm": 2500.0, "variant": v.label,
         "figures": dict(torque if "↔" in test else speed), "lost": ""}
        for test in ("-2 ↔ 2 N m", *dynamics.TESTS)
        for v in VARIANTS
    ]  # fmt: skip
    return {"rows": rows}


def test_tables_picture_and_limits(tmp_path):
    result = _result()
    assert dynamics.failures(result) == []
    ((_, _, table),) = dynamics.grid(result)
    assert len(table) == 4
    path = dynamics.plot(result, tmp_path / "dynamics.png")
    assert path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 20_000
    slow, lost = (r for r in result["rows"] if r["variant"] == "db-dtfc" and r["test"][0] in "-s")
    slow["figures"]["rise_up_ms"] = 1.2
    lost["lost"] = "over-current"
    first, second = dynamics.failures(result)
    assert "rise_up_ms 1.20, dtc1 1.00" in first
    assert second.endswith("sag: over-current")


@pytest.mark.parametrize("step", (dynamics.TORQUE_STEPS[1], dynamics.TORQUE_STEPS[3]))
def test_the_interleaved_law_steps_as_fast_as_the_deadbeat_law(step):
    """At the same switching frequency. The sets begin a step a quarter of a carrier apart, which is
    little beside what the voltage takes for it."""
    theirs = dynamics.torque_steps(Variant("db-dtfc"), *step, None)
    ours = dynamics.torque_steps(Variant("db-ipwm", 20e3), *step, None)
    for way in ("rise_up_ms", "rise_down_ms"):
        assert ours[way] <= 1.25 * theirs[way]
    assert ours["overshoot_pct"] <= theirs["overshoot_pct"]
