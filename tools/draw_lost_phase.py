"""Draw the pictures of docs/lost-phase.md that no study draws: the run of examples/lost-phase.toml
around the loss, the torque that is left without each one and each two of the phases, and the moment
of a loss of each kind under some schemes.

`python tools/draw_lost_phase.py [FOLDER]`
"""

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np

import hexatorque
from hexatorque import setups
from hexatorque.analysis.plots import LABEL, LEGEND, PHASE_COLOUR, TITLE, new_figure, save
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import ffi, lib
from hexatorque.parallel import each
from hexatorque.plant.legs import KINDS
from hexatorque.plant.vsd import PHASES

ROOT = Path(__file__).parents[1]
BEFORE_S, AFTER_S = 0.06, 0.19
MODES = ("least-loss", "most-torque")
RATED_A = 2.6
#: The moment of a loss.
MOMENT_SCHEMES = ("dtc1", "ddr", "db-dtfc")
MOMENT_RPM, MOMENT_NM, MOMENT_BEFORE_S, MOMENT_AFTER_S = 300.0, 2.5, 0.02, 0.06


def example(path: Path) -> None:
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
            ax.plot(time_ms[near], rec[f"plant.i_{phase}_A"][near], color=PHASE_COLOUR[phase],
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


def left_Nm(derating: Any, legs: int, mode: str) -> float:
    """Torque that the firmware allows without these legs; NaN where it refuses."""
    lost = ffi.new("ht_lost_legs *")
    if not lib.ht_lost_legs_of(
        lib.HT_WINDING_30,
        lib.ht_lost_legs_paired(lib.HT_WINDING_30, legs) if mode == MODES[1] else legs,
        lost,
    ):
        return np.nan
    i_A = lib.ht_derated_A(lost, derating.rated_A)
    return float(lib.ht_derated_Nm(derating, i_A, lib.ht_derated_Wb(derating, i_A)))


def derating(path: Path) -> None:
    figure, axes = new_figure(1, 2, 4.4)
    setup = setups.load("paper-a-feasible").changed(controller__i_rated_A=RATED_A)
    config = ffi.new("ht_derating_config *")
    config[0] = SimulatedDrive(setup).controller.drive.config.derating
    for ax, mode in zip(axes[0], MODES, strict=True):
        left = np.array(
            [[left_Nm(config, 32 >> a | 32 >> b, mode) for b in range(6)] for a in range(6)]
        )
        ax.imshow(left, cmap="YlGn", vmin=0.0, vmax=6.0)
        for a, b in itertools.product(range(6), repeat=2):
            text = "–" if np.isnan(left[a, b]) else f"{left[a, b]:.2f}"
            ax.text(b, a, text, ha="center", va="center", fontsize=9)
        ax.set_xticks(range(6), PHASES)
        ax.set_yticks(range(6), PHASES)
        ax.grid(False)
        ax.set_title(f"Torque left, N m: {mode}", **TITLE)
        ax.set_xlabel("lost phases (one on the diagonal; –: refused)", **LABEL)
    save(figure, path)


def moment(task: tuple[str, str]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time in ms from the loss, and the channels. u1 is lost while its current is largest."""
    scheme, kind = task
    setup = setups.load("paper-a-feasible").changed(
        controller__scheme=scheme,
        controller__ride_through=MODES[0],
        controller__i_rated_A=RATED_A,
        timing__latency="predicted",
        sensors__i_noise_A=0.025,
    )
    sim = SimulatedDrive(setup, 4)
    sim.start()
    sim.run(0.36, record=False)
    sim.set("speed_ref_rpm", MOMENT_RPM)
    sim.run(0.3, record=False)
    sim.set("load_Nm", MOMENT_NM)
    sim.run(0.3, record=False)
    sign = -1.0 if kind == "lower" else 1.0
    before_A = now_A = 0.0
    while not (before_A > now_A > 1.0):  # just beyond the crest
        sim.run(5e-4, record=False)
        before_A, now_A = now_A, sign * sim.controller.channel("i_u1_A")
    sim.discard()
    # One period later the current is there again.
    sim.break_leg("u1", kind, 60 / (2 * MOMENT_RPM))
    sim.run(60 / (2 * MOMENT_RPM) + MOMENT_AFTER_S)
    rec = sim.take()
    names = [*(f"plant.i_{phase}_A" for phase in PHASES), "plant.torque_Nm", "warnings"]
    time_ms = 1e3 * (np.arange(len(rec["warnings"])) / rec.rate_Hz - 60 / (2 * MOMENT_RPM))
    near = time_ms > -1e3 * MOMENT_BEFORE_S
    return time_ms[near], {name: np.asarray(rec[name])[near] for name in names}


def moments(path: Path) -> None:
    tasks = list(itertools.product(MOMENT_SCHEMES, KINDS[1:]))
    figure, axes = new_figure(
        2 * len(MOMENT_SCHEMES), len(KINDS) - 1, 13.0, width_in=12.0, sharex=True, sharey="row"
    )
    for n, (time_ms, seen) in enumerate(each(moment, tasks)):
        scheme, kind = tasks[n]
        row, column = 2 * (n // (len(KINDS) - 1)), n % (len(KINDS) - 1)
        currents, torque = axes[row, column], axes[row + 1, column]
        for phase in PHASES:
            dash = "-" if phase[1] == "1" else "--"
            currents.plot(time_ms, seen[f"plant.i_{phase}_A"], dash, color=PHASE_COLOUR[phase],
                          linewidth=0.8, label=phase)  # fmt: skip
        torque.plot(time_ms, seen["plant.torque_Nm"], color="#d55e00", linewidth=0.6)
        found_ms = time_ms[np.flatnonzero(seen["warnings"])[0]]
        for ax in (currents, torque):
            ax.axvline(0.0, color="#666d78", linewidth=0.9, linestyle="--")
            ax.axvline(found_ms, color="#666d78", linewidth=0.9, linestyle=":")
        currents.set_title(f"{scheme}, {kind}: {found_ms:.1f} ms", **TITLE)
        if column == 0:
            currents.set_ylabel("phase currents, A", **LABEL)
            torque.set_ylabel("torque, N m", **LABEL)
    for ax in axes[-1]:
        ax.set_xlabel("ms after the loss of u1", **LABEL)
    axes[0, 0].legend(**LEGEND, loc="lower left", ncols=3)
    save(figure, path)


def main(folder: Path) -> None:
    example(folder / "lost-phase-example.png")
    derating(folder / "lost-phase-derating.png")
    moments(folder / "lost-phase-moments.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
