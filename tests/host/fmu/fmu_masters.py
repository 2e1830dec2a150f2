"""Masters for the controller FMU: FMPy's classes under one set of names, and the simulation's plant
beside it."""

import math
import zipfile

import numpy as np

from hexatorque import firmware
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.fmu import controller

LEGS = ("u1", "u2", "w1", "w2", "v1", "v2")
STATUS = ("ok", "warning", "discard", "error")
#: FMI's names of the types, in the order in which the outputs are read.
TYPES = {2: ("Real", "Integer", "Boolean"), 3: ("Float64", "Int32", "Boolean", "Int64")}


def made_once(kept, place, key, setup, *arguments, **named):
    """Set-up, file and folder of an FMU by its key; arguments: of `controller.write`."""
    if key not in kept:
        path, folder = place / f"{len(kept)}.fmu", place / f"{len(kept)}"
        controller.write(path, setup, *arguments, only_here=True, **named)
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        kept[key] = setup, path, folder
    return kept[key]


#: References, load and breaks before a period.
COURSES = {
    "controller": {
        20: {"run": True, "speed_ref_rpm": 200.0},
        1800: {"speed_ref_rpm": -150.0},
        2500: {"run": False},
    },
    "drive": {
        20: {"run": True, "speed_ref_rpm": 200.0},
        1500: {"load_Nm": 0.4, "vdc_V": 290.0},
        1700: {"break_u1": 1},
        2000: {"break_u1": 0},
        2200: {"run": False},
    },
}


def command(sim, given):
    """What an FMU gets, to the simulation."""
    sim.set_many({n: given[n] for n in ("speed_ref_rpm", "load_Nm", "vdc_V") if n in given})
    if "break_u1" in given:
        sim.break_leg("u1", ("none", "open")[given["break_u1"]])
    if given.get("run") is True:
        sim.start()
    if given.get("run") is False:
        sim.stop()


class Fmu:
    """One instance of an unpacked FMU. `said`: what its logger has told, (status, line)."""

    def __init__(self, folder, guid=None):
        from fmpy import fmi2, fmi3, read_model_description

        self.description = read_model_description(str(folder))
        self.version = int(self.description.fmiVersion[0])
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.said = []
        self.questions = {}
        self.fmu = (fmi2.FMU2Slave if self.version == 2 else fmi3.FMU3Slave)(
            guid=guid or self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        if self.version == 2:
            callbacks = fmi2.fmi2CallbackFunctions()
            callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
                lambda _, name, status, category, line: self._log(status, line)
            )
            self.fmu.instantiate(callbacks=callbacks)
        else:
            self.fmu.instantiate(
                logMessage=lambda _, status, category, line: self._log(status, line)
            )
        self.time_s = 0.0
        self.period_s = float(self.description.defaultExperiment.stepSize)

    def _log(self, status, line):
        self.said.append((STATUS[status], line.decode()))

    def _kind(self, name):
        kind = self.variables[name].type
        if kind == "Enumeration":
            return "Integer" if self.version == 2 else "Int64"
        return kind

    def begin(self, **values):
        """Initialise with these values; a dot in a name is written __."""
        if self.version == 2:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.set(**values)
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        values = {name.replace("__", "."): value for name, value in values.items()}
        for kind in TYPES[self.version]:
            names = [name for name in values if self._kind(name) == kind]
            if names:
                references = [self.variables[name].valueReference for name in names]
                set_them = getattr(self.fmu, f"set{kind}")
                set_them(references, [values[name] for name in names])

    def get(self, *names):
        # Some tests ask for the same hundred names after each of thousands of steps.
        if names not in self.questions:
            rows = []
            for kind in TYPES[self.version]:
                of_kind = [name for name in names if self._kind(name) == kind]
                if of_kind:
                    references = [self.variables[name].valueReference for name in of_kind]
                    rows.append((getattr(self.fmu, f"get{kind}"), references, of_kind))
            self.questions[names] = rows
        found = {}
        for ask, references, of_kind in self.questions[names]:
            found |= zip(of_kind, ask(references))
        return [found[name] for name in names]

    def step(self, step_s=None):
        step_s = self.period_s if step_s is None else step_s
        self.fmu.doStep(self.time_s, step_s)
        self.time_s += step_s

    def bytes_of(self, kept):
        """A kept state as bytes."""
        name = "serializeFMUstate" if self.version == 2 else "serializeFMUState"
        return getattr(self.fmu, name)(kept)

    def go_back(self, raw):
        name = "deSerializeFMUstate" if self.version == 2 else "deserializeFMUState"
        self.fmu.setFMUState(getattr(self.fmu, name)(raw))

    @property
    def outputs(self):
        """Bits of all outputs."""
        names = [v.name for v in self.variables.values() if v.causality == "output"]
        return np.array(self.get(*names), float).tobytes()


class Plant:
    """A simulation, period by period. `inputs`: what the controller's sensors saw in the latest
    one, as the FMU takes it."""

    def __init__(self, setup):
        self.sim = SimulatedDrive(setup, 1)
        self.rows = np.empty((1, len(firmware.channels())), np.float32)

    def step(self):
        sim = self.sim
        position_rad = float(sim.plant_state[7])  # the samples are taken at the period's beginning
        self.rows[:] = 0
        sim._advance(1, np.empty((0, 10)), self.rows)
        sim.periods += 1
        m, words = sim.controller.map, sim.controller.register_words()
        counts = [int(words[at]) >> m.adc_shift for at in m.adc_result]
        i_full_A, vdc_full_V = (sim.controller.number(n) for n in ("i_full_A", "vdc_full_V"))
        self.inputs = {
            f"i_{leg}_A": (n - 2048) * i_full_A / 2048 for leg, n in zip(LEGS, counts)
        } | {"vdc_V": counts[6] * vdc_full_V / 4096, "position_rad": position_rad}

    @property
    def channels(self):
        return [float(x) for x in self.rows[0]]

    @property
    def registers(self):
        """What the PWM's registers say: start level, both compare registers as shares of the
        period, and whether the trip latch is off, of each leg."""
        port, m = self.sim.controller.port, self.sim.controller.map
        words = self.sim.controller.register_words()
        period = int(words[port.leg[0] + m.tbprd]) + 1
        action = m.aqctla if port.shadow else m.aqsfrc
        rows = []
        for base in port.leg:
            rows.append(
                (
                    int(words[base + action]) & 3 == 2,
                    min(int(words[base + m.cmpa]), period) / period,
                    min(int(words[base + m.cmpb]), period) / period,
                    not int(words[base + m.tzflg]) & 4,
                )
            )
        return rows


def registers_of(fmu):
    found = fmu.get(
        *(f"{what}_{leg}" for leg in LEGS for what in ("start", "toggle_a", "toggle_b", "gate"))
    )
    rows = [found[4 * k : 4 * k + 4] for k in range(6)]
    return [(bool(s), a, b, bool(g)) for s, a, b, g in rows]


def same(a, b):
    """Equal numbers; NaN equals NaN."""
    return all(x == y or (math.isnan(x) and math.isnan(y)) for x, y in zip(a, b, strict=True))
