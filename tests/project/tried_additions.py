"""Tries a scheme, a law, a chip, a machine model and a kind of rotor in simulations, for
test_adding.py.

    python tried_additions.py SETUP.toml

runs drives of this set-up with the package that Python finds, and prints what it found as JSON.
"""

import json
import sys

import numpy as np

from hexatorque import firmware, setups
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.errors import HexatorqueError
from hexatorque.plant import machine, machines
from hexatorque.plant.load import load_record
from hexatorque.plant.vsd import TRANSFORM
from hexatorque.serial import wire
from hexatorque.serial.client import Client

#: Mechanical speed from which the machine coasts, rad/s, and for how long.
COAST_RAD_S, COAST_S = 100.0, 0.02
#: Calibration and build-up are over after this time; then the drive runs for a while.
STARTED_S, RUN_S = 0.06, 0.02
#: Part of Vdc that a leg gives: low, high, both switches off (the dead time).
LEVEL = (0.0, 1.0, 0.5)


def coasting(setup) -> dict:
    """Without gate pulses and without load: the machine's slope of speed at the beginning, and its
    speed after a time."""
    drive = SimulatedDrive(setup)
    model = machines.model(setup["machine.model"])
    record = model.make(model.Parameters(**setup.machine_values()))
    drive.plant_state[6] = COAST_RAD_S
    slope = np.zeros(8)
    load = load_record("constant", 0.0, 1000.0)
    machine.derivative(record, load, drive.plant_state, np.zeros(4), slope)
    drive.run(COAST_S)
    return {
        "slope_rad_s2": float(slope[6]),
        "from_rad_s": COAST_RAD_S,
        "to_rad_s": float(drive.plant_state[6]),
        "time_s": COAST_S,
        "inertia_kgm2": setup["machine.inertia_kgm2"],
        "viscous_Nms": setup["machine.viscous_Nms"],
    }


def mean_voltages(drive: SimulatedDrive, first: int) -> np.ndarray:
    """Mean of the legs' voltage in each period from `first` on, in alpha, beta, x and y."""
    counts = drive.controller.period_counts
    mean = np.zeros((drive.periods, 6))
    since, level = [first * counts] * 6, [0.0] * 6
    ends = [(drive.periods * counts, leg, 0) for leg in range(6)]
    for at, leg, state in [*drive.edges.tolist(), *ends]:
        begin = since[leg]
        while begin < at:
            period = begin // counts
            end = min(at, (period + 1) * counts)
            mean[period, leg] += level[leg] * (end - begin) / counts
            begin = end
        since[leg], level[leg] = at, LEVEL[state]
    return mean[first:] @ TRANSFORM.T


def most_toggles(edges: np.ndarray, first: int, counts: int) -> int:
    """Levels that a leg takes in one period, at most. The dead time is none."""
    levels = edges[(edges[:, 2] != 2) & (edges[:, 0] >= first * counts)]
    place = np.stack([levels[:, 0] // counts, levels[:, 1]])
    return int(np.unique(place, axis=1, return_counts=True)[1].max())


def running(setup) -> dict:
    """What the drive does once it runs."""
    drive = SimulatedDrive(setup, samples_per_period=1)
    drive.start()
    drive.run(STARTED_S)
    drive.take()
    drive.log_edges(100_000)
    first = drive.periods
    drive.run(RUN_S)
    voltage = mean_voltages(drive, first)[10:]  # by then every leg has changed once
    words = drive.controller.register_words()
    recording = drive.take()
    return {
        "state": drive.state,
        "faults": drive.faults,
        "scheme": drive.get("scheme"),
        "speed_rpm": drive.speed_rpm,
        "violations": recording.meta["register_violations"],
        "interrupts": drive.periods,
        "torque_Nm": float(recording["plant.torque_Nm"][-100:].mean()),
        "most_toggles": most_toggles(drive.edges, first, drive.controller.period_counts),
        "main_pu": np.hypot(voltage[:, 0], voltage[:, 1]).tolist(),
        "xy_pu": np.hypot(voltage[:, 2], voltage[:, 3]).tolist(),
        "registers": {f"{at:04X}": int(words[at]) for at in (0x7021, 0x6805, 0x6810, 0x7053)},
    }


def of_kind(setup, model: str) -> dict:
    """The resistances in use, over the configured ones, and the torque of the same machine with the
    rotor of another model."""
    own = {"machine.model": model, "controller.scheme": "ddr"}
    drive = SimulatedDrive(setup.changed(own), samples_per_period=1)
    drive.start()
    drive.run(STARTED_S + RUN_S)
    state = drive.controller.drive.control.observer
    recording = drive.take()
    return {
        "kind": drive.get("machine"),
        "state": drive.state,
        "rs": float(state.rs_ohm / np.float32(drive.get("rs_ohm"))),
        "rr": state.rr_scale,
        "torque_Nm": float(recording["plant.torque_Nm"][-100:].mean()),
    }


def rows() -> dict:
    """What is known of the rows that were added to the tables."""
    ffi, lib = firmware.ffi, firmware.lib
    client = object.__new__(Client)
    client.states = firmware.STATE_TABLE
    reply = wire.Reply(wire.Op.START, 1, 15, len(firmware.STATES) - 1, 0, 0, b"")
    refused = client.refused(reply, "start")
    packet, port = ffi.new("ht_packet *"), ffi.new("ht_port *")
    lib.ht_port_bind(port, ffi.NULL, firmware.board_of("f28377s"))
    listed = {}
    for kind, row in ((wire.Kind.STATE, firmware.STATES), (wire.Kind.FAULT, firmware.FAULTS)):
        lib.ht_packet_begin(packet)
        assert lib.ht_dictionary_add(packet, port, kind, len(row) - 1)
        told = wire.parse_row(bytes(packet.octet[0 : packet.n]), kind, len(row) - 1)
        listed[kind.name] = told.name
    said = []
    for act in (
        lambda: firmware.Controller("f28377s", {"flux_band_Wb": 0.5}),
        lambda: setups.load("paper-b").changed({"controller.flux_band_Wb": 0.5}),
    ):
        try:
            act()
        except HexatorqueError as error:
            said.append(str(error))
    return {
        "state": firmware.STATE_TABLE[-1]._asdict(),
        "listed": listed,
        "faults": firmware.causes(max(firmware.FAULTS) | 1),
        "limits": firmware.limits(max(firmware.LIMITS)),
        "event": firmware.EVENTS[max(firmware.EVENTS)],
        "warnings": firmware.warnings(max(firmware.WARNINGS)),
        "refused": [str(refused), refused.mistake],
        "set": firmware.PARAMETER_SETS[-1],
        "misfit": said[0].removeprefix("controller set-up: "),
        "set-up": said[1],
    }


def main() -> None:
    setup = setups.load(sys.argv[1])
    found = {
        "schemes": firmware.schemes(),
        "devices": firmware.DEVICES,
        "coasting": coasting(setup),
        "running": running(setup),
        "law": running(setup.with_scheme("flux-pi")),
        "predicted": {name: firmware.needs_prediction(name) for name in firmware.schemes()},
        "kinds": {
            kind: of_kind(setup, model)
            for kind, model in (("solid", "induction-solid"), ("induction", "induction"))
        },
        "rows": rows(),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
