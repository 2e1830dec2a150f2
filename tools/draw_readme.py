"""Draw README's first picture: the x-y currents of two schemes, and the loss of a phase.

`python tools/draw_readme.py [FILE]`
"""

import sys
from pathlib import Path

import numpy as np

import hexatorque
from hexatorque.analysis.metrics import i_xy_A
from hexatorque.analysis.plots import COLOUR, INK, PHASE_COLOUR, new_figure, save, thin
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.experiments.comparison import points
from hexatorque.experiments.operating_points import fine_samples, measure
from hexatorque.plant.vsd import PHASES

ROOT = Path(__file__).parents[1]
SETUP, SCHEMES = "paper-a-feasible", ("fdr", "ddr")
SHOWN_S = 0.4
BEFORE_S, AFTER_S = 0.06, 0.14
LABEL = {"fontsize": 11, "color": INK}
TITLE = {"fontsize": 12, "fontweight": "bold", "color": INK}


def main(path: Path) -> None:
    figure, axes = new_figure(2, 2, 6.0, width_in=8.0)
    for ax, scheme in zip(axes[0], SCHEMES, strict=True):
        point = points([SETUP], [scheme])[0]
        run = measure(point, samples_per_period=fine_samples(point.setup))
        rec = run.recording
        shown = slice(-round(SHOWN_S * rec.rate_Hz), None)
        time_ms = 1e3 * (rec.time_s[shown] - rec.time_s[shown][0])
        for values, name in zip(i_xy_A(rec), ("i_x", "i_y"), strict=True):
            ax.plot(*thin(time_ms, values[shown]), color=COLOUR[name], linewidth=1.0,
                    label=f"${name}$")  # fmt: skip
        ax.set_title(f"x–y currents, {scheme}: {run.metrics['ixy_rms_A']:.2f} A", **TITLE)
        ax.set_ylim(-0.65, 0.65)
        ax.set_ylabel("A", **LABEL)
    setup = hexatorque.load(ROOT / "examples/lost-phase.toml")
    (lost_s, lost, _kind), *_ = setup.profile.broken
    sim = SimulatedDrive(setup)
    sim.run_profile(setup.profile)
    rec = sim.take()
    time_ms = 1e3 * (rec.time_s - lost_s)
    near = (time_ms > -1e3 * BEFORE_S) & (time_ms < 1e3 * AFTER_S)
    found_ms = time_ms[np.flatnonzero(rec["warnings"])[0]]
    for phase in PHASES:
        axes[1, 0].plot(*thin(time_ms[near], rec[f"plant.i_{phase}_A"][near]),
                        color=PHASE_COLOUR[phase], label=phase,
                        linewidth=2.2 if phase == lost else 0.9)  # fmt: skip
    axes[1, 0].set_ylim(-5.5, 5.5)
    axes[1, 0].set_title(f"Phase {lost} opens: currents", **TITLE)
    axes[1, 0].set_ylabel("A", **LABEL)
    axes[1, 1].plot(*thin(time_ms[near], rec["plant.torque_Nm"][near]), color=COLOUR["torque"],
                    linewidth=0.9)  # fmt: skip
    axes[1, 1].set_ylim(0, 5)
    axes[1, 1].set_title(f"Phase {lost} opens: torque", **TITLE)
    axes[1, 1].set_ylabel("N m", **LABEL)
    for ax in axes[1]:
        ax.axvline(0.0, color=INK, linewidth=1.2, linestyle="--")
    for ax in axes.flat:
        ax.tick_params(labelsize=10)
        ax.set_xlabel("ms after the loss" if ax in axes[1] else "ms", **LABEL)
    for ax in axes[:, 0]:
        ax.legend(frameon=False, fontsize=10, labelcolor=INK, loc="lower left", ncols=6,
                  columnspacing=0.6, handlelength=0.8, borderaxespad=0.1)  # fmt: skip
    save(figure, path)
    print(f"{path}: found after {found_ms:.2f} ms")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images/readme.png")
