#!/usr/bin/env python3
"""Write gem_motor.json: what gym-electric-motor's six-phase machine (SixPhasePMSM) does under given
phase voltages. Nothing of hexatorque is used.

Its equations, its transformation and its load are called as they are and integrated by scipy. One
thing is chosen: `electrical_ode` gets the electrical speed, as its docstring says. The environments
of version 3.0.3 hand it the speed of the shaft; with p pole pairs the shaft then gets p/2 of the
energy of the air gap.

    build/peers/bin/python tests/vectors/gem_motor.py     (`make bench-peers` installs it)
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
from gym_electric_motor.physical_systems.electric_motors import SixPhasePMSM
from gym_electric_motor.physical_systems.mechanical_loads import PolynomialStaticLoad
from scipy.integrate import solve_ivp

PERIOD_S, PERIODS = 0.8e-3, 250
PHASES = ("a1", "b1", "c1", "a2", "b2", "c2")
#: Constants that differ from its own, the speed at the beginning in rad/s, friction in N m s, and
#: the size of the currents that the voltages are to drive, A.
MACHINES: dict[str, tuple[dict, float, float, float]] = {
    "default": ({}, 100.0, 0.002, 120.0),
    # Eldeeb, Hackl, Horlbeck, Kullick, PEDS 2017: L_q is 2.7 times L_d.
    "salient": (
        dict(p=3, r_s=0.8, l_d=6.4e-3, l_q=17.4e-3, l_x=0.9e-3, l_y=0.9e-3, psi_PM=0.1746,
             j_rotor=0.01),
        100.0, 0.002, 8.0,
    ),
}  # fmt: skip


class Run:
    def __init__(self, constants: dict, friction_Nms: float) -> None:
        self.motor = SixPhasePMSM(motor_parameter=constants)
        self.p = self.motor.motor_parameter
        self.load = PolynomialStaticLoad(dict(a=0.0, b=friction_Nms, c=0.0))
        self.load.set_j_rotor(self.p["j_rotor"])

    def phases(self, i: np.ndarray, epsilon: float) -> np.ndarray:
        return self.motor.q_inv(i, epsilon)

    def slopes(self, state: np.ndarray, volts: np.ndarray, pole_pairs: float) -> np.ndarray:
        """Of i_d, i_q, i_x, i_y, the electrical angle, the shaft's speed, and of four energies."""
        i, epsilon, omega = state[:4], state[4], state[5]
        u = self.motor.q(volts, epsilon)
        electrical = self.motor.electrical_ode(state[:5], u, pole_pairs * omega)
        torque = self.motor.torque(i)
        of_phases = self.phases(i, epsilon)
        # What l_x other than l_y gives the shaft by energy; its torque has no such part.
        xy = 3 * self.p["p"] * (self.p["l_y"] - self.p["l_x"]) * i[2] * i[3]
        return np.array(
            [
                *electrical[:4],
                self.p["p"] * omega,
                *self.load.mechanical_ode(0.0, [omega], torque),
                volts @ of_phases,
                self.p["r_s"] * of_phases @ of_phases,
                torque * omega,
                xy * omega,
            ]
        )

    def follow(self, state: np.ndarray, volts: np.ndarray, pole_pairs: float) -> np.ndarray:
        return solve_ivp(
            lambda _, y: self.slopes(y, volts, pole_pairs),
            (0, PERIOD_S), state, "DOP853", rtol=1e-10, atol=1e-10,
        ).y[:, -1]  # fmt: skip

    def kept_J(self, i: np.ndarray) -> float:
        """In the inductances."""
        return 1.5 * float(np.array([self.p[name] for name in ("l_d", "l_q", "l_x", "l_y")]) @ i**2)


def voltages(run: Run, state: np.ndarray, wanted: np.ndarray, rng: np.random.Generator):
    """Voltages of the phases that drive about the wanted currents, with noise in all planes, and
    with a zero sequence in each set, which must not matter."""
    w = run.p["p"] * state[5]
    drop = run.p["r_s"] * wanted
    u = np.array(
        [
            drop[0] - w * run.p["l_q"] * wanted[1],
            drop[1] + w * (run.p["l_d"] * wanted[0] + run.p["psi_PM"]),
            *drop[2:],
        ]
    )
    u += rng.normal(0, 0.2 * np.abs(drop).max(), 4)
    zero = np.repeat(rng.normal(0, 2, 2), 3)
    return np.round(run.phases(u, state[4] + 0.5 * w * PERIOD_S) + zero, 2)


def record(name: str) -> dict:
    constants, omega, friction_Nms, size_A = MACHINES[name]
    run = Run(constants, friction_Nms)
    rng = np.random.default_rng(34)
    begin = np.array([0.0, 0.0, 0.0, 0.0, 0.3, omega, 0.0, 0.0, 0.0, 0.0])
    state, rows = begin, []
    for period in range(PERIODS):
        if period % 25 == 0:
            wanted = size_A * np.array([-0.3, 1.0, 0.3, 0.3]) * rng.uniform(-1, 1, 4)
            wanted[1] = np.copysign(max(abs(wanted[1]), 0.5 * size_A), wanted[1])
        volts = voltages(run, state, wanted, rng)
        state = run.follow(state, volts, run.p["p"])
        i, epsilon = state[:4], state[4]
        values = [*run.phases(i, epsilon), run.motor.torque(i), state[5], epsilon]
        rows.append([*volts.tolist(), *(round(float(value), 6) for value in values)])
    given, lost, shaft, xy = state[6:]
    return {
        "constants": {**run.p, "j_total": run.load.j_total, "friction": friction_Nms},
        "begin": {"i": 0.0, "epsilon": begin[4], "omega": begin[5]},
        "energy_J": {
            "terminals": given,
            "copper": lost,
            "inductances": run.kept_J(state[:4]) - run.kept_J(begin[:4]),
            "shaft": shaft,
            "x_y": xy,
        },
        "columns": [
            *(f"u_{phase}" for phase in PHASES), *(f"i_{phase}" for phase in PHASES),
            "torque", "omega", "epsilon",
        ],
        "rows": rows,
    }  # fmt: skip


def text(tables: dict) -> str:
    """Each row in its own line."""
    parts = []
    for name, table in tables.items():
        head = {key: value for key, value in table.items() if key != "rows"}
        lines = ",\n".join(json.dumps(row) for row in table["rows"])
        parts.append(f'{json.dumps(name)}: {json.dumps(head)[:-1]}, "rows": [\n{lines}]}}')
    head = {
        "format": "hexatorque-vectors-1",
        "from": f"gym-electric-motor {version('gym-electric-motor')}",
        "period_s": PERIOD_S,
    }
    return f'{json.dumps(head)[:-1]},\n"tables": {{\n' + ",\n".join(parts) + "}}\n"


def as_in_its_environments() -> float:
    """Energy of the shaft over that of the air gap if `electrical_ode` gets the shaft's speed."""
    run = Run({}, 0.0)
    begin = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 100.0, 0.0, 0.0, 0.0, 0.0])
    state = begin
    for _ in range(25):
        u = np.array([0.0, 8.0, 0.0, 0.0])
        state = run.follow(state, run.phases(u, state[4]), 1)
    given, lost, shaft, _ = state[6:]
    return shaft / (given - lost - run.kept_J(state[:4]))


if __name__ == "__main__":
    tables = {name: record(name) for name in MACHINES}
    Path(__file__).with_name("gem_motor.json").write_text(text(tables))
    for name, table in tables.items():
        energy = table["energy_J"]
        gap = energy["terminals"] - energy["copper"] - energy["inductances"]
        print(f"{name}: the shaft gets {energy['shaft'] / gap:.4f} of the air gap's energy")
    print(f"as in its environments: {as_in_its_environments():.4f}")
