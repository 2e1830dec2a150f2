"""Published machines in front of drives that know their plates alone: inertia, circuit and load are
what the plate makes `hexatorque new` believe, the machine is the published one."""

import pytest
from campaigns import part

from hexatorque import setups
from hexatorque.experiments.acceptance import accept
from hexatorque.experiments.operating_points import Point, measure
from hexatorque.setups import estimate, new
from hexatorque.setups.keys import TIMING_OWNS
from hexatorque.setups.published import machines

NAMES = (
    "motulator 2.2 kW",
    "Krause 3 hp",
    "Trzynadlowski 30 hp",
    "ifoc 8 poles",
    "Ong 1 hp",
    "4 kW 400 V",
    "37 kW 400 V",
    "150 hp 460 V",
    "Krause 50 hp",
    "Krause 500 hp",
    "5.5 kW 220/380 V",
)
CASES = [(name, told) for told in (False, True) for name in NAMES]


def drive(name: str, told: bool):
    """The set-up with the true machine, and its plate's values."""
    (machine,) = (m for m in machines() if m.name == name)
    one = estimate.examples(machine)[0]
    plate, circuit = one.plate, one.circuit
    text = plate.told(**({"power_factor": plate.power_factor} if told else {}))
    believed = setups.parse(new.from_nameplate(text, "x"), "x")
    values = setups.parameters(believed)
    fixed = {f"controller__{n}": v for n, v in values.items() if n not in TIMING_OWNS}
    true = {f"machine__{n}": getattr(circuit, n) for n in ("rs_ohm", "rr_ohm", "lm_H")}
    leakages = dict.fromkeys(("machine__lls_H", "machine__llr_H", "machine__lxy_H"), circuit.lls_H)
    return believed.changed(**fixed, **true, **leakages), plate, circuit


@pytest.mark.parametrize(("name", "told"), part(CASES, 5))
def test_a_drive_that_knows_the_plate_drives_the_machine(name, told):
    """Rated speed and torque in both directions; and rated torque at 3 % of rated speed, where the
    stator resistance takes much of the voltage: the true flux is within 12 % of its reference."""
    setup, plate, circuit = drive(name, told)
    assert accept(setup).state == "idle"
    slow = Point(setup.changed(load__kind="constant"), 0.03 * plate.speed_rpm, circuit.torque_Nm)
    flux_Wb = measure(slow, names=("flux_Wb", "speed_rpm")).metrics["flux_Wb"]
    assert flux_Wb == pytest.approx(setup.parameter("flux_ref_Wb"), rel=0.12)
