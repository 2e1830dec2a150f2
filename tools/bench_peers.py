"""`make bench-peers`: the speed of two other simulators of drives beside that of this one.

Both are in Python, with three phases and an induction machine. Neither has six-phase control by
switching tables, so this says what a simulated second costs where, not which is better at the same
task. All sample at 10 kHz. Speed is simulated seconds per second of processor time, the best of
several runs, in turns. The others have an environment of their own, for they need libraries that
this package does not. The last two lines are environments for learning agents, both with six phases
and a torque to follow, a step for each period.

    tools/bench_peers.py build/peers/bin/python
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

REPEATS = 3
PERIOD_S = 100e-6
#: Simulated per run: the others take long, this one must not be too short to measure.
PEERS_S, OWN_S = 0.2, 1.0
#: What is computed, by the name of the function.
WHAT = {
    "own": "hexatorque: six phases, ddr, exact edges and dead time, the firmware's C code",
    "motulator": "motulator: three phases, current-vector control, switching-level carrier PWM",
    "gem": "gym-electric-motor: three phases, a switching state held for a period, no control",
    "own_gym": "hexatorque.gym: Switching-v0, exact edges, dead time, the firmware's protections",
    "gem_gym": "gym-electric-motor: Finite-TC-SIXPMSM-v0 at 24 V",
}


def own() -> Callable[[], float]:
    from hexatorque import setups
    from hexatorque.experiments.operating_points import Point, approach

    setup = setups.load("paper-a-feasible").changed(controller__scheme="ddr")
    sim = approach(Point(setup, setup["point.speed_rpm"], setup["point.load_Nm"]))

    def run() -> float:
        sim.run(OWN_S, record=False)
        return OWN_S

    return run


def motulator() -> Callable[[], float]:
    from motulator.drive import model, utils  # type: ignore[import-not-found]
    from motulator.drive.control import im  # type: ignore[import-not-found]

    def run() -> float:
        known = utils.InductionMachineInvGammaPars(n_p=2, R_s=3.7, R_R=2.1, L_sgm=0.021, L_M=0.224)
        machine = model.InductionMachine(
            utils.InductionMachinePars.from_inv_gamma_model_pars(known)
        )
        drive = model.Drive(
            model.VoltageSourceConverter(u_dc=540.0), machine, model.StiffMechanicalSystem(J=0.015)
        )
        drive.pwm = model.CarrierComparison()
        settings = im.CurrentReferenceCfg(known, max_i_s=10.6)
        law = im.CurrentVectorControl(known, settings, J=0.015, T_s=PERIOD_S, sensorless=False)
        law.ref.w_m = lambda t: 2 * 3.1416 * 25.0
        model.Simulation(drive, law).simulate(t_stop=PEERS_S)
        return PEERS_S

    return run


def gem() -> Callable[[], float]:
    import gym_electric_motor  # type: ignore[import-not-found]

    environment = gym_electric_motor.make("Finite-CC-SCIM-v0", tau=PERIOD_S)
    environment.reset(seed=1)

    def run() -> float:
        for period in range(round(PEERS_S / PERIOD_S)):
            *_, ended, _, _ = environment.step(period % 8)
            if ended:  # the current has passed its limit
                environment.reset()
        return PEERS_S

    return run


def own_gym() -> Callable[[], float]:
    import gymnasium

    import hexatorque.gym

    environment = gymnasium.make(
        hexatorque.gym.IDS["switching"], setup="paper-b", disable_env_checker=True
    )
    return lambda: agent(environment, lambda period: period % 64)


def gem_gym() -> Callable[[], float]:
    import gym_electric_motor

    environment = gym_electric_motor.make(
        "Finite-TC-SIXPMSM-v0", tau=PERIOD_S, supply={"u_nominal": 24.0}
    )
    return lambda: agent(environment, lambda period: (period % 8, period // 8 % 8))


def agent(environment: Any, action: Callable[[int], Any]) -> float:
    """Steps of an agent that goes through all states, whatever it sees."""
    environment.reset(seed=1)
    for period in range(round(PEERS_S / PERIOD_S)):
        _, _, terminated, truncated, _ = environment.step(action(period))
        if terminated or truncated:
            environment.reset()
    return PEERS_S


def serve(name: str) -> None:
    """Run once for each line that comes, and answer with the speed."""
    run = globals()[name]()
    print("ready", flush=True)
    for _ in sys.stdin:
        begin = time.process_time()
        seconds = run()
        print(seconds / (time.process_time() - begin), flush=True)


def main(peers: str) -> None:
    workers = {
        name: subprocess.Popen(
            [python, "-W", "ignore", __file__, "--serve", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for name in WHAT
        for python in [sys.executable if name.startswith("own") else peers]
    }

    def answer(name: str) -> str:
        worker = workers[name]
        assert worker.stdout is not None
        line = worker.stdout.readline()
        if not line:
            sys.exit(f"bench-peers: {name} has ended: exit code {worker.wait()}")
        return line

    for name in WHAT:
        answer(name)  # ready
    best = dict.fromkeys(WHAT, 0.0)
    for _ in range(REPEATS):
        for name, worker in workers.items():
            assert worker.stdin is not None
            print("run", file=worker.stdin, flush=True)
            best[name] = max(best[name], float(answer(name)))
    for worker in workers.values():
        worker.kill()
    print("simulated seconds per second of processor time, one core, 10 kHz")
    for name, text in WHAT.items():
        print(f"{best[name]:8.2f}  {text}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(sys.argv[2])
    elif len(sys.argv) == 2:
        main(sys.argv[1])
    else:
        sys.exit("usage: tools/bench_peers.py PYTHON_OF_THE_PEERS")
