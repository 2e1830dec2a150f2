"""Draw pictures of docs/protection.md: what the limits of the dc link change in examples/brake.toml
and examples/dip.toml, how a ramp and a hot winding change a run, and how examples/flying.toml
catches its shaft. And what examples/magnet.toml and examples/symmetrical.toml show.

`python tools/draw_limits.py [FOLDER]`
"""

import contextlib
import sys
from pathlib import Path

import numpy as np

import hexatorque
from hexatorque import setups
from hexatorque.analysis.plots import LABEL, LEGEND, TITLE, new_figure, save
from hexatorque.drive.interface import DriveFault
from hexatorque.drive.simulated import SimulatedDrive

ROOT = Path(__file__).parents[1]
GREY, RED, BLUE = "#999999", "#d55e00", "#0072b2"
SPEED, TORQUE = ("plant.speed_rpm", "speed, r/min"), ("plant.torque_Nm", "torque, N m")
LINK = (("vdc_V", "dc link, V"), SPEED, TORQUE)
#: Example -> its level, and what is drawn: seconds.
EXAMPLES = {"brake": ("vdc_high_V", 2.9, 8.5), "dip": ("vdc_low_V", 3.9, 4.9)}
MOTION = """setup = "paper-a-feasible"
title = "Up by a ramp, down by a stop"
[controller]
ramp_up_rpm_s = 1500
ramp_down_rpm_s = 1500
ramp_jerk_rpm_s2 = 6000
[load]
kind = "fan"
at_rpm = 1000
[profile]
duration_s = 3.6
speed_rpm = [[0.5, 1000]]
load_Nm = 5
set = [[2.2, "motion", "stop"]]
samples_per_period = 1
"""
#: Temperatures change 200 times as fast as they would.
HEAT = """setup = "paper-a-feasible"
title = "A fan that is too large: 200 times as fast"
[heat]
winding_K_W = 0.5
frame_K_W = 0.35
winding_s = 60
frame_s = 900
time_lapse = 200
[load]
kind = "fan"
at_rpm = 900
[controller]
winding_limit_degC = 110
winding_trip_degC = 130
[profile]
duration_s = 16
speed_rpm = [[0.4, 900]]
load_Nm = 14
samples_per_period = 1
"""


def run(setup: hexatorque.Setup) -> tuple[np.ndarray, hexatorque.Recording]:
    """Times and recording of its profile, to its end or to the trip."""
    sim = SimulatedDrive(setup, samples_per_period=1)
    with contextlib.suppress(DriveFault):
        sim.run_profile(setup.profile)
    rec = sim.take()
    return np.arange(len(rec["vdc_V"])) / rec.rate_Hz, rec


def draw(
    runs: list, panels: tuple, begin_s: float, end_s: float, title: str, path: Path, every: int = 5
) -> None:
    """runs: set-up, text, colour; panels: channel, label."""
    figure, axes = new_figure(1, len(panels), 3.2)
    for setup, text, colour in runs:
        time_s, rec = run(setup)
        shown = slice(int(begin_s * rec.rate_Hz), int(end_s * rec.rate_Hz), every)
        for ax, (channel, label) in zip(axes.flat, panels, strict=True):
            ax.plot(time_s[shown], rec[channel][shown], color=colour, linewidth=0.9, label=text)
            ax.set_ylabel(label, **LABEL)
            ax.set_xlabel("time, s", **LABEL)
    axes.flat[0].legend(**LEGEND, loc="best")
    axes.flat[0].set_title(title, **TITLE)
    save(figure, path)


def draw_link(name: str, folder: Path) -> None:
    level, begin_s, end_s = EXAMPLES[name]
    example = hexatorque.load(ROOT / "examples" / f"{name}.toml")
    without = example.changed(**{f"controller__{level}": 0.0})
    runs = [
        (without, "without a level: trips", GREY),
        (example, f"{level} = {example.parameter(level):g} V", RED),
    ]
    draw(runs, LINK, begin_s, end_s, example.title, folder / f"limits-{name}.png")


def draw_motion(folder: Path) -> None:
    ramp = setups.parse(MOTION, "motion")
    straight = ramp.changed(
        controller__ramp_up_rpm_s=0.0, controller__ramp_down_rpm_s=0.0,
        controller__ramp_jerk_rpm_s2=0.0,
    )  # fmt: skip
    runs = [(straight, "no ramp", GREY), (ramp, "1500 r/min a second", RED)]
    draw(runs, (SPEED, TORQUE), 0.3, 3.6, ramp.title, folder / "limits-motion.png")


def draw_heat(folder: Path) -> None:
    watched = setups.parse(HEAT, "heat")
    runs = [
        (watched.changed(controller__winding_K_W=0.0), "not watched", GREY),
        (watched, "limit 110 °C, trip 130 °C", RED),
    ]
    panels = (
        ("plant.winding_degC", "winding, °C"),
        SPEED,
        ("torque_limit_Nm", "torque limit, N m"),
    )
    draw(runs, panels, 0.4, 16.0, watched.title, folder / "limits-heat.png", 500)


def draw_flying(folder: Path) -> None:
    example = hexatorque.load(ROOT / "examples/flying.toml")
    time_s, rec = run(example)
    part = slice(int(1.9 * rec.rate_Hz), int(2.9 * rec.rate_Hz))
    time_s = time_s[part]

    def flux_Wb(of: str) -> np.ndarray:
        return np.hypot(rec[f"{of}psi_alpha_Wb"], rec[f"{of}psi_beta_Wb"])[part]

    figure, (axes,) = new_figure(1, 3, 4.0)
    axes[0].plot(time_s, flux_Wb("plant."), color="#d9dde3", linewidth=4, label="of the machine")
    axes[0].plot(time_s, flux_Wb(""), color=RED, linewidth=1.2, label="as the drive knows it")
    axes[0].set_ylim(bottom=0.0)
    axes[0].legend(**LEGEND, loc="best")
    axes[1].plot(time_s, rec["plant.i_u1_A"][part], color=BLUE, linewidth=0.8)
    axes[2].plot(time_s, rec["plant.speed_rpm"][part], color=RED)
    for ax, label in zip(axes, ("flux, Wb", "current of u1, A", "speed, r/min"), strict=True):
        ax.set_ylabel(label, **LABEL)
        ax.set_xlabel("time, s", **LABEL)
    axes[0].set_title(example.title, **TITLE)
    save(figure, folder / "flying.png")


def draw_example(name: str, begin_s: float, end_s: float, folder: Path) -> None:
    """Speed, torque and the currents of a phase and of x-y."""
    example = hexatorque.load(ROOT / "examples" / f"{name}.toml")
    time_s, rec = run(example)
    part = slice(int(begin_s * rec.rate_Hz), int(end_s * rec.rate_Hz), 5)
    time_s = time_s[part]
    figure, (axes,) = new_figure(1, 3, 3.2)
    axes[0].plot(time_s, rec["plant.speed_rpm"][part], color=RED, linewidth=0.9)
    axes[1].plot(time_s, rec["plant.torque_Nm"][part], color=GREY, linewidth=0.9, label="true")
    axes[1].plot(time_s, rec["torque_Nm"][part], color=RED, linewidth=0.5, label="estimated")
    axes[2].plot(time_s, rec["plant.i_u1_A"][part], color=BLUE, linewidth=0.5, label="of u1")
    xy_A = np.hypot(rec["plant.i_x_A"], rec["plant.i_y_A"])[part]
    axes[2].plot(time_s, xy_A, color=RED, linewidth=0.9, label="in x-y, amplitude")
    low, high = axes[2].get_ylim()
    axes[2].set_ylim(low, high + 0.25 * (high - low))  # room for the legend
    axes[1].legend(**LEGEND, loc="best")
    axes[2].legend(**LEGEND, loc="upper right")
    for ax, label in zip(axes, (SPEED[1], TORQUE[1], "current, A"), strict=True):
        ax.set_ylabel(label, **LABEL)
        ax.set_xlabel("time, s", **LABEL)
    axes[1].set_title(example.title, **TITLE)
    save(figure, folder / f"{name}.png")


def main(folder: Path) -> None:
    for name in EXAMPLES:
        draw_link(name, folder)
    draw_motion(folder)
    draw_heat(folder)
    draw_flying(folder)
    draw_example("magnet", 0.0, 5.0, folder)
    draw_example("symmetrical", 0.0, 3.0, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images")
