"""Draw three pictures of docs/protection.md: what the limits of the dc link change in
examples/brake.toml and examples/dip.toml, and how examples/flying.toml catches its shaft.

`python tools/draw_limits.py [FOLDER]`
"""

import contextlib
import sys
from pathlib import Path

import numpy as np

import hexatorque
from hexatorque.analysis.plots import LABEL, LEGEND, TITLE, new_figure, save
from hexatorque.drive.interface import DriveFault
from hexatorque.drive.simulated import SimulatedDrive

ROOT = Path(__file__).parents[1]
#: Example -> its level, and what is drawn: seconds.
EXAMPLES = {"brake": ("vdc_high_V", 2.9, 8.5), "dip": ("vdc_low_V", 3.9, 4.9)}


def draw(name: str, folder: Path) -> None:
    level, begin_s, end_s = EXAMPLES[name]
    example = hexatorque.load(ROOT / "examples" / f"{name}.toml")
    figure, axes = new_figure(1, 3, 3.2)
    for setup, text, colour in (
        (example.changed(**{f"controller__{level}": 0.0}), "without a level: trips", "#999999"),
        (example, f"{level} = {example.parameter(level):g} V", "#d55e00"),
    ):
        sim = SimulatedDrive(setup, samples_per_period=1)
        with contextlib.suppress(DriveFault):
            sim.run_profile(setup.profile)
        rec = sim.take()
        time_s = np.arange(len(rec["vdc_V"])) / rec.rate_Hz
        shown = slice(int(begin_s * rec.rate_Hz), int(end_s * rec.rate_Hz), 5)
        for ax, channel, label in zip(
            axes.flat,
            ("vdc_V", "plant.speed_rpm", "plant.torque_Nm"),
            ("dc link, V", "speed, r/min", "torque, N m"),
            strict=True,
        ):
            ax.plot(time_s[shown], rec[channel][shown], color=colour, linewidth=0.9, label=text)
            ax.set_ylabel(label, **LABEL)
            ax.set_xlabel("time, s", **LABEL)
    axes.flat[0].legend(**LEGEND, loc="best")
    axes.flat[0].set_title(example.title, **TITLE)
    save(figure, folder / f"limits-{name}.png")


def draw_flying(folder: Path) -> None:
    example = hexatorque.load(ROOT / "examples/flying.toml")
    sim = SimulatedDrive(example, samples_per_period=1)
    sim.run_profile(example.profile)
    rec = sim.take()
    part = slice(int(1.9 * rec.rate_Hz), int(2.9 * rec.rate_Hz))
    time_s = np.arange(len(rec["vdc_V"]))[part] / rec.rate_Hz

    def flux_Wb(of: str) -> np.ndarray:
        return np.hypot(rec[f"{of}psi_alpha_Wb"], rec[f"{of}psi_beta_Wb"])[part]

    figure, (axes,) = new_figure(1, 3, 4.0)
    axes[0].plot(time_s, flux_Wb("plant."), color="#d9dde3", linewidth=4, label="of the machine")
    axes[0].plot(time_s, flux_Wb(""), color="#d55e00", linewidth=1.2, label="as the drive knows it")
    axes[0].set_ylim(bottom=0.0)
    axes[0].legend(**LEGEND, loc="best")
    axes[1].plot(time_s, rec["plant.i_u1_A"][part], color="#0072b2", linewidth=0.8)
    axes[2].plot(time_s, rec["plant.speed_rpm"][part], color="#d55e00")
    for ax, label in zip(axes, ("flux, Wb", "current of u1, A", "speed, r/min"), strict=True):
        ax.set_ylabel(label, **LABEL)
        ax.set_xlabel("time, s", **LABEL)
    axes[0].set_title(example.title, **TITLE)
    save(figure, folder / "flying.png")


def main(folder: Path) -> None:
    for name in EXAMPLES:
        draw(name, folder)
    draw_flying(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
