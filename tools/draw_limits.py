"""Draw two pictures of docs/protection.md: what the limits of the dc link change in
examples/brake.toml and examples/dip.toml.

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


def main(folder: Path) -> None:
    for name in EXAMPLES:
        draw(name, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
