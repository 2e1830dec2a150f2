"""`hexatorque evidence pil`: compares processor in the loop with software in the loop.

The same simulation runs twice from the same seeds: once with the firmware in this process, once
with the firmware on a target. Everything that the firmware writes and sends must be the same, bit
for bit. The loop is chaotic, so any difference would grow until it shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ... import firmware
from ...boards.processor import Target, TargetController, WatchedController, image_names
from ...drive.simulated import SimulatedDrive
from ...experiments.operating_points import Progress
from ...recording.recording import Recording
from ...setups import Profile, Setup, SetupError

if TYPE_CHECKING:
    from rich.table import Table

#: Controllers that keep a log of their registers.
Logged = WatchedController | TargetController
#: Length of the profile with transients around a set-up's operating point, and when it asks for
#: speed. A drive that gives no torque by then is waited for: one that aligns magnets takes longer.
DURATION_S, BEGIN_S = 2.0, 0.4


@dataclass
class Outcome:
    """The result of a run on the target. `difference` is None if it equals the run on the host.
    Otherwise it names the first difference."""

    setup: str
    scheme: str
    processor: str
    recording: Recording
    state: str
    faults: list[str]
    snapshot: firmware.Snapshot | None
    steps: int
    steps_per_s: float
    difference: str | None

    def as_json(self) -> dict:
        return {
            "setup": self.setup,
            "scheme": self.scheme,
            "processor": self.processor,
            "identical": self.difference is None,
            "difference": self.difference,
            "steps": self.steps,
            "steps_per_s": self.steps_per_s,
            "state": self.state,
            "faults": self.faults,
            "snapshot": self.snapshot,
        }

    def failures(self) -> list[str]:
        """The failures of this run, one line each."""
        lines = []
        if self.difference is not None:
            lines.append(f"{self.scheme}: {self.difference}")
        if self.faults:
            lines.append(f"{self.scheme}: the drive tripped: {', '.join(self.faults)}")
        return lines


def transients(setup: Setup) -> Profile:
    """Two seconds with all transients: start, speed step, load step, reversal, and a change to
    another scheme and back while the drive runs."""
    scheme = setup["controller.scheme"]
    schemes = [s for s in firmware.schemes() if _allowed(setup, s)]
    other = schemes[(schemes.index(scheme) + 1) % len(schemes)]
    speed, load = setup["point.speed_rpm"], setup["point.load_Nm"]
    ready_s = sum(float(setup.parameter(name)) for name in ("calibration_s", "build_s"))
    later_s = max(0.0, ready_s - BEGIN_S)
    return Profile(
        duration_s=later_s + DURATION_S,
        speed_rpm=((later_s + BEGIN_S, speed), (later_s + 1.7, -speed)),
        load_Nm=((later_s + 0.9, load), (later_s + 1.6, 0.0)),
        set=((later_s + 1.2, "scheme", other), (later_s + 1.5, "scheme", scheme)),
        samples_per_period=1,
    )


def _allowed(setup: Setup, scheme: str) -> bool:
    """Whether a drive in this state may change to the scheme."""
    try:
        setup.changed(controller__scheme=scheme)
    except SetupError:
        return False
    return True


def _first_difference(
    host: Logged, target: Logged, periods: int, per_period: int, a: Recording, b: Recording
) -> str | None:
    """The first difference between two runs, or None. Registers and access counts are compared
    first, then the firmware's telemetry, then the plant, then the snapshot of a fault. All are
    compared bit by bit."""
    images = host.log.images, target.log.images
    if images[0].shape != images[1].shape or len(images[0]) != periods:
        return f"{len(images[0])} periods logged on the host, {len(images[1])} on the target"
    where = np.argwhere(images[0] != images[1])
    if len(where):
        period, column = where[0]
        i, j = (int(image[period, column]) for image in images)
        name = image_names(host)[column]
        return f"period {period}: {name} is 0x{i:04X} on the host, 0x{j:04X} on the target"
    for name in a.channels:
        differ = np.flatnonzero(a[name].view(np.uint32) != b[name].view(np.uint32))
        if len(differ):
            n = differ[0]
            period = n // per_period
            return (
                f"period {period}: {name} is {a[name][n]!r} on the host, "
                f"{b[name][n]!r} on the target"
            )
    x: Mapping[str, object] = host.snapshot or {}
    y: Mapping[str, object] = target.snapshot or {}
    for name in x or y:
        here, there = repr(x.get(name)), repr(y.get(name))  # NaN equals NaN
        if here != there:
            return f"fault snapshot: {name} is {here} on the host, {there} on the target"
    return None


def compare(
    setup: Setup, profile: Profile, target: Target, progress: Progress | None = None
) -> Outcome:
    """Runs a profile on the host and on the target and compares the two."""
    sil, here, a = _run(setup, profile, WatchedController, progress)
    pil, there, b = _run(setup, profile, target.controller, progress)
    return Outcome(
        setup=setup.name,
        scheme=str(setup["controller.scheme"]),
        processor=target.name,
        recording=b,
        state=there.state,
        faults=there.faults,
        snapshot=there.snapshot,
        steps=pil.periods,
        steps_per_s=pil.periods / pil.wall_s,
        difference=_first_difference(here, there, sil.periods, sil.samples_per_period, a, b),
    )


def _run(
    setup: Setup,
    profile: Profile,
    controller: Callable[..., Logged],
    progress: Progress | None,
) -> tuple[SimulatedDrive, Logged, Recording]:
    sim = SimulatedDrive(setup, profile.samples_per_period, controller)
    logged = sim.controller
    assert isinstance(logged, Logged)
    logged.log.begin(round(profile.duration_s / sim.period_s))
    sim.run_profile(profile, progress)
    return sim, logged, sim.take()


def table(outcomes: list[Outcome]) -> Table:
    """The table for the terminal."""
    from rich.table import Table

    table = Table(
        title=f"{outcomes[0].setup} on {outcomes[0].processor}, compared with the host",
        title_justify="left",
    )
    for heading in ("scheme", "registers and channels", "steps", "steps per s", "state"):
        table.add_column(heading, justify="right" if heading.startswith("steps") else "left")
    for row in outcomes:
        equal = "identical" if row.difference is None else "[bold red]differ[/]"
        table.add_row(row.scheme, equal, str(row.steps), f"{row.steps_per_s:.0f}", row.state)
    return table
