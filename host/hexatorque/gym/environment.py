"""One drive as an environment of Gymnasium."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces

from .. import firmware
from ..drive.interface import finite
from ..drive.simulated import SimulatedDrive
from ..errors import InputError
from ..experiments.prepare import magnetise
from ..given import choice
from ..plant.loop import PLANT_CHANNELS
from ..plant.vsd import PHASES, TRANSFORM
from ..setups import Setup, load, parameters
from ..setups.design import Design, rad_s
from .acting import Switching, Voltage
from .reward import Passed, tracking

#: Level of action -> the environment's name for `gymnasium.make`.
IDS = {
    "torque": "hexatorque/Torque-v0",
    "voltage": "hexatorque/Voltage-v0",
    "switching": "hexatorque/Switching-v0",
}
#: What an action of 1 is: mean voltage in alpha-beta and in x-y, units of V_dc. The inverter's
#: largest mean voltage is 0.62.
VOLTAGE_PU, XY_PU = 0.65, 0.2
#: Length of an episode, and for how long a reference holds at least and at most: where the agent
#: follows a torque, and where it follows a speed.
TORQUE_TIMES_S, SPEED_TIMES_S = (0.2, 0.01, 0.05), (2.0, 0.3, 0.8)
#: Speeds and torques are drawn up to this share of what the drive can have at its full flux.
DRAWN = 0.8
#: The bench that holds the speed, where the agent follows a torque; the time in which it brings the
#: drive there, in so many steps, and in which the drive settles.
BENCH_KGM2, RAMP_S, RAMP_STEPS, SETTLE_S = 1e3, 0.1, 40, 0.02
#: Observations are cut off beyond this.
FARTHEST = 2.0
#: True values in a period.
SAMPLES = 4

_OPTIONS = ("speed_rpm", "references", "load_Nm")
_CHANNELS = {name: k for k, (name, _) in enumerate(firmware.channels())}
_MEASURED = [_CHANNELS[f"i_{phase}_A"] for phase in PHASES]
_SEEN = [_CHANNELS[name] for name in ("speed_rpm", "torque_Nm", "psi_alpha_Wb", "psi_beta_Wb")]
_VDC = _CHANNELS["vdc_V"]
_TRUE = {name: k for k, (name, _) in enumerate(PLANT_CHANNELS)}


class SixPhaseDrive(gymnasium.Env):
    """The firmware's protections, sensors and latency, and an agent in place of a part of it.

    setup: name, file or `Setup`; level: what the agent decides in each step, "torque" (the
    reference of the set-up's scheme), "voltage" (mean voltages of a period) or "switching" (the six
    legs' states); set: other values for keys of the set-up; periods: control periods of a step;
    episode_s: length of an episode; reward: a function of `Passed`. InputError if one of them is
    wrong.

    drive: the `SimulatedDrive` of the episode, from the first `reset` on. docs/gym.md says what is
    observed.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self,
        setup: str | Path | Setup = "paper-a-feasible",
        level: str = "voltage",
        set: Mapping[str, Any] | None = None,
        periods: int = 1,
        episode_s: float | None = None,
        reward: Callable[[Passed], float] = tracking,
    ) -> None:
        self.level = choice(level, IDS)
        if self.level not in IDS:
            raise InputError(f"level = {level!r}: choose one of {', '.join(IDS)}")
        if isinstance(periods, bool) or periods != int(periods) or periods < 1:
            raise InputError(f"periods = {periods!r}: a whole number from 1 on is needed")
        self._follows_speed = self.level == "torque"
        times_s = SPEED_TIMES_S if self._follows_speed else TORQUE_TIMES_S
        length_s = times_s[0] if episode_s is None else finite(episode_s)
        if length_s is None or length_s <= 0:
            raise InputError(f"episode_s = {episode_s!r}: a time above 0 s is needed")
        self.periods, self.reward = periods, reward
        self._hold_s = times_s[1:]
        given = setup if isinstance(setup, Setup) else load(setup)
        self.setup = self._prepared(given.changed(dict(set)) if set else given)
        values = parameters(self.setup)
        design = Design(self.setup, values.__getitem__)
        self._limit_Nm = float(values["torque_limit_Nm"])
        self._trip_A, self._flux_Wb = float(values["i_trip_A"]), float(values["flux_ref_Wb"])
        self._top_rpm = DRAWN * min(design.base_rpm(), 0.9 * float(values["speed_trip_rpm"]))
        self._period_s = 1 / float(values["f_isr_Hz"])
        self._steps = max(1, round(length_s / (periods * self._period_s)))
        self.drive: SimulatedDrive | None = None
        self.action_space: spaces.Space = (
            spaces.Discrete(64)
            if self.level == "switching"
            else spaces.Box(-1.0, 1.0, (1 if self._follows_speed else 4,), np.float32)
        )
        acted = 6 if self.level == "switching" else self.action_space.shape[0]  # type: ignore[index]
        self._acted = np.zeros(acted, np.float32)
        self.observation_space = spaces.Box(-FARTHEST, FARTHEST, (10 + acted,), np.float32)

    def _prepared(self, setup: Setup) -> Setup:
        """In torque mode. Where the agent follows a torque, a bench holds the speed."""
        changes: dict[str, Any] = {"controller.control_mode": "torque", "load.kind": "constant"}
        if not self._follows_speed:
            changes |= {"timing.latency": "predicted", "machine.inertia_kgm2": BENCH_KGM2}
        return setup.changed(changes)

    # -- episodes --------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """A drive at its flux, and where the agent follows a torque at its speed. The seed decides
        speed, load, references and the noise of the sensors. options: `speed_rpm`, `load_Nm`, and
        `references`, pairs of time in s and value, in N m or r/min."""
        super().reset(seed=seed)
        options = options or {}
        for name in options:
            if name not in _OPTIONS:
                raise InputError(f"options: {name!r}: choose from {', '.join(_OPTIONS)}")
        speed_rpm = self._option(options, "speed_rpm", self._drawn(self._top_rpm))
        load_Nm = self._option(options, "load_Nm", self._drawn(0.5 * self._limit_Nm))
        self._references = self._listed(options)
        self._times_s = [at_s for at_s, _ in self._references]
        noise = int(self.np_random.integers(1, 1_000_000_000))
        law = {"voltage": Voltage, "switching": Switching}.get(self.level)
        setup = self.setup.changed({"sensors.noise_seed": noise})
        self.drive = drive = SimulatedDrive(setup, SAMPLES, law() if law else firmware.Controller)
        magnetise(drive, 0.01)
        drive.check()
        if self._follows_speed:
            drive.set("load_Nm", load_Nm)
        else:
            for step in range(1, RAMP_STEPS + 1):
                drive.plant_state[6] = rad_s(speed_rpm) * step / RAMP_STEPS
                drive.run(RAMP_S / RAMP_STEPS, record=False)
            drive.run(SETTLE_S, record=False)
            drive.check()
        self._taken, self._transitions = 0, drive.transitions
        self._acted[:] = 0.0
        _, channels = drive.rows(1)
        return self._observed(channels[-1]), self._told(None)

    def _drawn(self, most: float) -> float:
        return float(self.np_random.uniform(-most, most))

    def _option(self, options: Mapping[str, Any], name: str, drawn: float) -> float:
        if name not in options:
            return drawn
        number = finite(options[name])
        if number is None:
            raise InputError(f"options: {name} = {options[name]!r}: a finite number is needed")
        return number

    def _listed(self, options: Mapping[str, Any]) -> list[tuple[float, float]]:
        """Times and references, as shares of the largest one."""
        most = self._top_rpm if self._follows_speed else DRAWN * self._limit_Nm
        drawn, at_s = [], 0.0
        while at_s < self._steps * self.periods * self._period_s:
            drawn.append((at_s, self._drawn(most)))
            at_s += float(self.np_random.uniform(*self._hold_s))
        given = options.get("references", drawn)
        try:
            pairs = [(float(at_s), float(value)) for at_s, value in given]
        except (TypeError, ValueError):
            pairs = []
        if not pairs or not np.isfinite(pairs).all() or pairs != sorted(pairs) or pairs[0][0] > 0:
            raise InputError(
                f"options: references = {given!r}: pairs of time and value are needed, the first "
                "at 0 s, their times in order"
            )
        return pairs

    @property
    def reference(self) -> float:
        """The present reference: torque in N m, or speed in r/min."""
        now_s = self._taken * self.periods * self._period_s
        return self._references[bisect_right(self._times_s, now_s + 1e-9) - 1][1]

    # -- steps -----------------------------------------------------------------------------------

    def step(self, action: Any) -> tuple[np.ndarray, SupportsFloat, bool, bool, dict[str, Any]]:
        drive = self.drive
        if drive is None:
            raise InputError("step: reset the environment first")
        self._act(drive, action)
        reference = self.reference
        plant, channels = drive.rows(self.periods)
        tripped = drive.state != firmware.RUN
        what, most = ("speed_rpm", self._top_rpm) if self._follows_speed else (
            "torque_Nm", self._limit_Nm)  # fmt: skip
        before, self._transitions = self._transitions, drive.transitions
        passed = Passed(
            plant,
            (plant[:, _TRUE[what]] - reference) / most,
            np.hypot(plant[:, _TRUE["i_x_A"]], plant[:, _TRUE["i_y_A"]]) / self._trip_A,
            self._transitions - before,
            tripped,
        )
        self._taken += 1
        over = self._taken >= self._steps and not tripped
        return (
            self._observed(channels[-1]), float(self.reward(passed)), tripped, over,
            self._told(passed),
        )  # fmt: skip

    def _act(self, drive: SimulatedDrive, action: Any) -> None:
        if self.level == "switching":
            word = np.asarray(action)
            if word.size != 1 or word.dtype.kind not in "iu" or not 0 <= int(word) < 64:
                raise InputError(f"action = {action!r}: a state word 0 .. 63 is needed")
            memory = drive.controller.memory  # type: ignore[attr-defined]
            memory["word"], memory["acting"] = int(word), 1
            self._acted[:] = [int(word) >> bit & 1 for bit in range(5, -1, -1)]
            return
        size = self._acted.size
        values = np.asarray(action, np.float32)
        if values.shape != (size,) or not np.isfinite(values).all():
            raise InputError(
                f"action = {action!r}: {size} finite numbers within -1 .. 1 are needed"
            )
        values = np.clip(values, -1.0, 1.0)
        self._acted[:] = values
        if self._follows_speed:
            drive.set("torque_ref_Nm", float(values[0]) * self._limit_Nm)
            return
        memory = drive.controller.memory  # type: ignore[attr-defined]
        memory["v"] = VOLTAGE_PU * complex(values[0], values[1])
        memory["v_xy"] = XY_PU * complex(values[2], values[3])
        memory["acting"] = 1

    def _observed(self, row: np.ndarray) -> np.ndarray:
        """The firmware's values at the end of a step."""
        most = self._top_rpm if self._follows_speed else self._limit_Nm
        speed_rpm, torque_Nm, alpha_Wb, beta_Wb = row[_SEEN]
        seen = [
            self.reference / most,
            speed_rpm / self._top_rpm,
            torque_Nm / self._limit_Nm,
            alpha_Wb / self._flux_Wb,
            beta_Wb / self._flux_Wb,
            *(TRANSFORM @ row[_MEASURED] / self._trip_A),
            row[_VDC] / self.setup["inverter.vdc_V"],
            *self._acted,
        ]
        known = np.nan_to_num(np.asarray(seen, np.float32), nan=0.0)
        return np.clip(known, -FARTHEST, FARTHEST)

    def _told(self, passed: Passed | None) -> dict[str, Any]:
        """Further values: time, reference, true mean values, and the faults of a trip."""
        drive = self.drive
        assert drive is not None
        told: dict[str, Any] = {"time_s": drive.time_s, "reference": self.reference}
        if passed is not None:
            mean = passed.plant.mean(axis=0)
            told |= {
                "torque_Nm": float(mean[_TRUE["torque_Nm"]]),
                "speed_rpm": float(mean[_TRUE["speed_rpm"]]),
                "transitions": passed.transitions,
            }
            if passed.tripped:
                told["faults"] = tuple(drive.faults)
        return told
