"""Draw docs/images/lost-phase.png: the run of examples/lost-phase.toml around the loss.

`python tools/draw_lost_phase.py [FILE.png]`
"""

import sys
from pathlib import Path

import numpy as np

import hexatorque
from hexatorque.analysis.plots import LABEL, LEGEND, TITLE, new_figure, save
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.vsd import PHASES

ROOT = Path(__file__).parents[1]
#: Colours that colour-blind readers can distinguish, the same for legs that are 90 degrees apart.
COLOURS = dict(
    zip(PHASES, ("#0072b2", "#e69f00", "#009e73", "#009e73", "#cc79a7", "#0072b2"), strict=True)
)
BEFORE_S, AFTER_S = 0.06, 0.19


def main(path: Path) -> None:
    setup = hexatorque.load(ROOT / "examples/lost-phase.toml")
    (lost_s, lost, _kind), *_ = setup.profile.broken
    sim = SimulatedDrive(setup)
    sim.run_profile(setup.profile)
    rec = sim.take()
    time_ms = 1e3 * (np.arange(len(rec["plant.torque_Nm"])) / rec.rate_Hz - lost_s)
    near = (time_ms > -1e3 * BEFORE_S) & (time_ms < 1e3 * AFTER_S)
    far = time_ms > -1e2
    found_ms = time_ms[np.flatnonzero(rec["warnings"])[0]]
    figure, axes = new_figure(2, 2, 5.6)
    for ax, numbers in zip(axes[:, 0], ("1", "2"), strict=True):
        for phase in (name for name in PHASES if name[1] == numbers):
            ax.plot(time_ms[near], rec[f"plant.i_{phase}_A"][near], color=COLOURS[phase],
                    linewidth=1.1, label=phase)  # fmt: skip
        ax.set_ylim(-5, 5)
        ax.legend(**LEGEND, loc="lower right", ncols=3)
        ax.set_ylabel("phase currents, A", **LABEL)
        ax.set_title(f"Set {numbers}" + (f": {lost} opens" if lost[1] == numbers else ""), **TITLE)
    axes[0, 1].plot(time_ms[far], rec["plant.torque_Nm"][far], color="#d55e00", linewidth=0.7)
    axes[0, 1].set_ylabel("torque, N m", **LABEL)
    axes[0, 1].set_ylim(0, 4.5)
    axes[0, 1].set_title("Torque under 3 N m of load", **TITLE)
    axes[1, 1].plot(time_ms[far], rec["plant.speed_rpm"][far], color="#5b4fa2", linewidth=1.3)
    axes[1, 1].set_ylabel("speed, r/min", **LABEL)
    axes[1, 1].set_ylim(270, 310)
    axes[1, 1].set_title("Speed", **TITLE)
    for ax in axes.flat:
        ax.axvline(0.0, color="#666d78", linewidth=0.9, linestyle="--")
        ax.axvline(found_ms, color="#666d78", linewidth=0.9, linestyle=":")
        ax.set_xlabel("ms after the loss (dashed); dotted: found", **LABEL)
    save(figure, path)
    print(f"{path}: found after {found_ms:.2f} ms")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images/lost-phase.png")
