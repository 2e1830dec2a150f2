"""Runs that need no simulation, and that can hang or kill their process. Worker processes import
this file."""

import os
import signal
import time
from pathlib import Path

from hexatorque.sweeps.work import Row, do

#: A run with this load ...
HANGS, DIES, DIES_ONCE, TAKES_TIME = 1.0, 2.0, 3.0, 4.0


def trick(work, cases):
    """What a worker does in place of a run. Its figure is the speed of the case."""
    do(work, [])  # refuses another version
    rows = []
    for case in cases:
        load_Nm = case.values.get("point.load_Nm")
        mark = Path(work.setup.title) / f"died-{case.number}"
        if load_Nm == HANGS:
            time.sleep(600)
        elif load_Nm == DIES or (load_Nm == DIES_ONCE and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        elif load_Nm == TAKES_TIME:
            time.sleep(0.1)
        rows.append(Row(case.number, (case.values["point.speed_rpm"] / 3,)))
    return rows


def tricked(workers_class):
    """These workers, which do the trick in place of the run."""

    class Tricked(workers_class):
        def submit(self, function, *arguments):
            return super().submit(trick, *arguments)

    return Tricked
