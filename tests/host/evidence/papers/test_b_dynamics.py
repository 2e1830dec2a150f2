"""Speed and load steps under the three schemes."""

import numpy as np
import pytest

from hexatorque.evidence.papers.paper_b import dynamics
from hexatorque.evidence.papers.paper_b.dynamics import SPEED_STEP, response
from hexatorque.recording.recording import Recording


def test_response_of_a_known_speed():
    """The speed returns to 1000 r/min from an overshoot of 50 r/min with 80 ms. Settling time and
    overshoot are known in closed form."""
    t = np.arange(10_000) / 1e4
    late = np.maximum(t - 0.1, 0)
    speed = np.where(t < 0.1, 1000.0, 2000 - 1000 * np.exp(-late / 0.005))
    speed += np.where(t < 0.1, 0.0, 50 * np.exp(-late / 0.08))
    rec = Recording(1e4, {"plant.speed_rpm": speed, "plant.torque_Nm": 1 + (t > 0.1)})
    found = response(rec, SPEED_STEP, 0.1)
    # 50 exp(-t / 80 ms) = 20 r/min, when the faster part is already zero; the filter adds 10 ms.
    assert found["settling_ms"] == pytest.approx(80 * np.log(2.5), abs=0.5)
    peak = (2000 - 1000 * np.exp(-late / 0.005) + 50 * np.exp(-late / 0.08)).max() - 2000
    assert found["overshoot_pct"] == pytest.approx(peak / 25, rel=0.05)
    assert found["torque_max_Nm"] == pytest.approx(2.0)


def within(t_s, speed, target, band):
    """The first instant from which the speed stays in the band, searched backwards."""
    last = np.nonzero(np.abs(speed - target) > band)[0][-1]
    return t_s[last + 1]


@pytest.mark.parametrize(("figure", "begin_rpm"), [("b17", 1000.0), ("b18", 2000.0)])
def test_step_responses_agree_with_their_recordings(figure, begin_rpm, job, tmp_path):
    made = getattr(dynamics, figure)(job)
    for scheme, rec in made.recordings.items():
        t_s, speed = rec.time_s, rec["plant.speed_rpm"]
        assert rec.duration_s == pytest.approx(1.0)
        assert speed[:900] == pytest.approx(begin_rpm, abs=4)
        assert speed[-500:] == pytest.approx(2000, abs=8)
        m = made.metrics[scheme]
        settled = 1e3 * (within(t_s, speed, 2000, 20) - dynamics.STEPS_S[0])
        assert m["settling_ms"] == pytest.approx(settled, rel=0.1)
        # Before and after, the torque is that of the brake. In between J dw/dt is added.
        torque = rec["plant.torque_Nm"]
        after = {"b17": 0.3, "b18": 2.0}[figure]
        assert torque[:900].mean() == pytest.approx(0.3, abs=0.05)
        assert torque[-2000:].mean() == pytest.approx(after, abs=0.08)
        gained = 0.003 * (speed[2000] - speed[1000]) * np.pi / 30
        load = 0.3 if figure == "b17" else 2.0
        assert torque[1000:2000].sum() / 1e4 - load * 0.1 == pytest.approx(gained, abs=0.012)
    settling = [row["settling_ms"] for row in made.metrics.values()]
    assert max(settling) < 1.05 * min(settling)
    required = [v for v in made.verdicts if v.required]
    assert len(required) == 2 and {v.verdict for v in required} == {"match"}
    made.draw(tmp_path / "step.png")
    assert (tmp_path / "step.png").stat().st_size > 20_000


def test_unequal_schemes_are_reported():
    rows = {
        s: {"settling_ms": 300.0, "overshoot_pct": 2.0, "deviation_pct": 6.0}
        for s in ("dtc1", "dtc2", "dtc3")
    }
    assert not any(v.broken for v in dynamics._verdicts(rows, "overshoot"))
    rows["dtc3"] = {"settling_ms": 330.0, "overshoot_pct": 9.5, "deviation_pct": 6.0}
    assert [v.broken for v in dynamics._verdicts(rows, "overshoot")][:2] == [True, True]
    assert [v.broken for v in dynamics._verdicts(rows, "deviation")][:2] == [True, False]
    # A scheme that does not settle is not equal.
    rows["dtc2"]["settling_ms"] = float("nan")
    assert dynamics._verdicts(rows, "overshoot")[0].broken
