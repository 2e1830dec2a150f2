"""Values that others have published, for comparison with ours."""

from __future__ import annotations

from .run import Run

#: By set-up: `source`, `point` (text), `speed_rpm`, `load_Nm`, and `schemes`: scheme -> figure
#: of merit -> value. `f_sw_rel` is relative to DTC1. `why_thd`: why ours may be far from it.
Reference = dict[str, dict]


def reference_values(reference: Reference, run: Run) -> dict[str, float]:
    """The published values for the run's set-up and scheme. Empty if there are none, or if they
    belong to another operating point (speed or load differs by more than 2 %)."""
    entry = reference.get(run.setup, {})
    for key, value in (("speed_rpm", run.speed_ref_rpm), ("load_Nm", run.load_Nm)):
        if key in entry and abs(value - entry[key]) > 0.02 * abs(entry[key]):
            return {}
    return entry.get("schemes", {}).get(run.scheme, {})
