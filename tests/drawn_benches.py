"""Benches that are drawn: machines with magnets, and windings of 0 and 60 degrees, of other sizes
than the built-in ones, that differ from their set-ups in nothing, one, two or three parameters. A
recording has four speeds under load of both signs, and a part without load."""

from dataclasses import dataclass

import numpy as np

from hexatorque import setups
from hexatorque.drive.interface import DriveFault
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.recording.recording import Recording
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.twin import bench, candidates

ANGLE = "encoder's angle"
MAGNETS = ("magnet-interior", "magnet-surface")
#: With sets 0 and 60 degrees apart.
WINDINGS = ("symmetrical-0", "symmetrical", "magnet-interior-0", "magnet-surface-60")
#: Between which sizes an error is drawn, in the candidate's unit; torques as shares of the rated
#: one, of friction at rated speed.
COMMON = {
    "R_s": (0.05, 0.3), "L_xy": (0.1, 0.3), "J": (0.05, 0.3), "friction": (0.05, 0.3),
    "load": (0.05, 0.3), "dead time": (0.3, 2.0), "V_dc sensor's gain": (0.03, 0.1),
    "gain of all current sensors": (0.03, 0.1), "gain of current sensor w1": (0.03, 0.1),
}  # fmt: skip
OF_MODEL = {
    "magnet": {"psi_f": (0.05, 0.2), "L_d": (0.05, 0.3), "L_q": (0.05, 0.3), ANGLE: (2.0, 10.0)},
    "induction": {"R_r": (0.05, 0.3), "L_m": (0.05, 0.2), "leakage": (0.05, 0.3)},
}
#: Share of rated speed and torque of the load, from which time on.
COURSE = ((0.25, 0.0), (0.8, 0.5), (0.8, -0.5), (0.4, -0.5), (0.12, 0.5))
PART_S = 0.3


@dataclass
class Drawn:
    """A set-up, its bench's true changes by parameter, the recording of this bench, and the load
    that its user knows."""

    setup: setups.Setup
    changes: dict[str, float]
    recording: Recording
    loads: tuple[tuple[float, float], ...]

    def bench(self) -> bench.Bench:
        return bench.make(self.recording, "bench", self.setup)


def set_up(name, rng):
    """A machine of this kind, its size, resistance and inertia twice or half. The controller's
    parameters are written down, and its rotor's angle is known."""
    plain = setups.load(name.removesuffix("-0").removesuffix("-60"))
    size, resistance, inertia = rng.choice([0.5, 1.0, 2.0], 3)
    machine = plain.machine_values()
    own = {
        key: machine[key] / size
        for key in ("ld_H", "lq_H", "lls_H", "llr_H", "lm_H", "lxy_H", "rr_ohm") if key in machine
    }  # fmt: skip
    own |= {"rs_ohm": machine["rs_ohm"] / size * resistance}
    own |= {"inertia_kgm2": machine["inertia_kgm2"] * size * inertia}
    own |= {"viscous_Nms": machine["viscous_Nms"] * size}
    if name.endswith("-0"):
        own["displacement_deg"] = 0
    if name.endswith("-60"):
        own["displacement_deg"] = 60
    full_A, rated_Nm = size * plain["sensors.i_full_A"], size * plain["rated.torque_Nm"]
    plain = plain.with_scheme("ddr" if name in MAGNETS else "dtc1").changed(
        sensors__i_full_A=full_A, sensors__i_noise_A=1e-3 * full_A, rated__torque_Nm=rated_Nm,
        point__load_Nm=size * plain["point.load_Nm"], controller__build_s=0.1,
        **{f"machine__{key}": value for key, value in own.items()},
    )  # fmt: skip
    if "psi_f_Wb" in machine:
        plain = plain.changed(
            controller__rotor_start="known", controller__rotor_zero_deg=15.0,
            machine__start_deg=15.0,
        )  # fmt: skip
    values = {f"controller__{k}": v for k, v in setups.parameters(plain).items()
              if k not in TIMING_OWNS}  # fmt: skip
    return plain.changed(**values)


def sizes(setup):
    return COMMON | OF_MODEL[setup["machine.model"]]


def _unit(name, setup):
    """What a size of this error is a share of."""
    rated_Nm = setup["rated.torque_Nm"]
    at = {"load": rated_Nm, "friction": rated_Nm / (setup["rated.speed_rpm"] * np.pi / 30)}
    return at.get(name, 1.0)


def errors(setup, count, rng):
    """So many errors, each drawn with its sign."""
    of = sizes(setup)
    names = rng.choice(list(of), count, replace=False)
    return {
        str(n): float(rng.uniform(*of[n]) * rng.choice([-1, 1])) * _unit(n, setup) for n in names
    }


def recorded(setup, changes, seed=99, course=COURSE):
    """What a board would stream at 1 kHz, and its load. DriveFault if the drive trips."""
    wrong, prepare = setup, []
    for one in candidates.suitable(setup, False, True):
        change = changes.get(one.name)
        if not change or one.name == "load":
            continue
        if one.name == "J":
            inertia = wrong["machine.inertia_kgm2"] * (1 + change)
            wrong = wrong.changed(machine__inertia_kgm2=inertia)
        elif one.name == "friction":
            wrong = wrong.changed(machine__viscous_Nms=wrong["machine.viscous_Nms"] + change)
        elif one.prepare:
            prepare.append(one.prepare(change))
        else:
            wrong = one.apply(wrong, change)
    drive = SimulatedDrive(wrong.changed(sensors__noise_seed=seed), 1)
    for one in prepare:
        one(drive)
    drive.run(0.003)
    drive.start()
    drive.run(drive.get("calibration_s") + drive.get("build_s") + 0.01)
    while drive.state != "run" and drive.time_s < 10:  # an aligned rotor swings
        drive.run(0.01)
    loads = [(float("-inf"), 0.0)]
    for speed, load in course:
        told_Nm = load * setup["rated.torque_Nm"]
        loads.append((drive.time_s, told_Nm))
        drive.set_many({
            "load_Nm": told_Nm + changes.get("load", 0.0),
            "speed_ref_rpm": speed * setup["rated.speed_rpm"],
        })  # fmt: skip
        drive.run(PART_S)
    drive.check()
    rec, every = drive.take(), round(1e-3 / drive.period_s)
    own = {n: data[::every] for n, data in rec.channels.items() if not n.startswith("plant.")}
    values = {name: drive.get(name) for name in drive.params}
    meta = {"scheme": values["scheme"], "parameters": {"controller": values}}
    return Recording(1 / drive.period_s / every, own, rec.units, meta), tuple(loads)


def draw(name, count, seed):
    """The bench with this number; another one in place of one that does not run."""
    rng = np.random.default_rng([*name.encode(), count, seed])
    while True:
        setup = set_up(name, rng)
        changes = errors(setup, count, rng)
        try:
            recording, loads = recorded(setup, changes)
        except (DriveFault, setups.SetupError):
            continue
        return Drawn(setup, changes, recording, loads)


def explanations(found):
    """Each set of parameters that explains the difference: name -> (change, deviation)."""
    if not found.named:
        return []
    sets = ([found.together] if found.together else []) + found.rivals
    several = [
        {
            c.name: (float(x), float(s))
            for c, x, s in zip(one.candidates, one.changes, one.deviations)
        }
        for one in sets
    ]
    one = found.cause
    return ([{one.candidate.name: (one.change, one.deviation)}] if one else []) + several
