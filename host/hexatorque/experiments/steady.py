"""Measure one operating point of a simulated drive: `hexatorque.measure`.

run = hexatorque.measure("paper-b", scheme="dtc1", speed_rpm=1000, load_Nm=2)
wide = hexatorque.measure("paper-b", scheme="dtc1", speed_rpm=1000, load_Nm=2,
                          set={"controller.torque_band_Nm": 0.6})
run.recording.plot("torque")
print(run.metrics["torque_ripple_Nm"], wide.metrics["torque_ripple_Nm"])
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import laws
from ..analysis.run import Run
from ..errors import InputError
from ..laws.law import Law
from ..setups import Setup, SetupError, load, parameters
from ..setups.design import Design
from . import operating_points
from .operating_points import Point, Progress, fine_samples


def measure(
    setup: str | Path | Setup,
    scheme: str | Law | None = None,
    speed_rpm: float | None = None,
    load_Nm: float | None = None,
    set: Mapping[str, Any] | None = None,
    samples_per_period: int | None = None,
    progress: Progress | None = None,
) -> Run:
    """Simulate a drive to a steady state and measure it there.

    setup: a `Setup`, the name of a built-in one, or a file; scheme: a scheme's name, a law's name
    or file, or a `Law` of your own, the set-up's scheme by default; speed_rpm, load_Nm: where to
    measure, in r/min and N m, by default the set-up's `point`, or half of rated speed and torque;
    set: other values of the set-up's keys, as in `Setup.changed`; samples_per_period: samples of
    the plant that are recorded in a control period, by default 20 or a little more, so that the
    torque between the control instants is seen; progress: called with the simulated seconds that
    have passed.

    The drive starts, reaches the speed without load, gets the load, settles, and is recorded for
    10 fundamental cycles, 0.5 to 10 s. The result has `metrics`, name -> number in the unit that
    the name ends with (`analysis.metrics.UNITS`), and `recording`. `hexatorque compare` measures in
    the same way.

    InputError if a name or a value is wrong; DriveFault if the drive trips; NotReached if it does
    not reach the speed.
    """
    loaded = setup if isinstance(setup, Setup) else load(setup)
    if set:
        loaded = loaded.changed(set)
    point = under(at_point(loaded, speed_rpm, load_Nm), scheme)
    samples = fine_samples(point.setup) if samples_per_period is None else samples_per_period
    return operating_points.measure(point, progress, samples)


def at_point(setup: Setup, speed_rpm: float | None = None, load_Nm: float | None = None) -> Setup:
    """A set-up at an operating point; an argument that is given replaces the set-up's own value.
    Without either the point is at half of rated speed and torque. SetupError if the load is above
    the torque limit."""
    given = {"point.speed_rpm": speed_rpm, "point.load_Nm": load_Nm}
    setup = setup.changed({path: value for path, value in given.items() if value is not None})
    if setup["point.speed_rpm"] == 0:
        if speed_rpm is not None:
            raise SetupError(f"{setup.name}: speed_rpm (--speed) = 0: another speed is needed")
        half_rpm, half_Nm = Design(setup, parameters(setup).__getitem__).steady_point
        setup = setup.changed({"point.speed_rpm": half_rpm, "point.load_Nm": half_Nm})
    torque, limit = setup["point.load_Nm"], setup.parameter("torque_limit_Nm")
    if abs(torque) > limit:
        raise SetupError(
            f"load {torque:g} N m: allowed range is -{limit:g} .. {limit:g} N m (torque limit)"
        )
    return setup


def under(setup: Setup, scheme: str | Law | None) -> Point:
    """The set-up's operating point under a scheme or a law, with `timing.latency` as it needs."""
    speed_rpm, load_Nm = setup["point.speed_rpm"], setup["point.load_Nm"]
    if scheme is None:
        return Point(setup, speed_rpm, load_Nm)
    if not isinstance(scheme, (str, Law)):
        raise InputError(f"scheme = {scheme!r}: a name, a file of a law, or a Law is needed")
    law = scheme if isinstance(scheme, Law) else laws.find(laws.named(scheme))
    if law is None:
        return Point(setup.with_scheme(str(scheme)), speed_rpm, load_Nm)
    return Point(setup.changed({"timing.latency": "predicted"}), speed_rpm, load_Nm, law)
