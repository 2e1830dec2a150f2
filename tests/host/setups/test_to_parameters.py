"""The parameters of a set-up: they are complete, and the simulation uses the same ones."""

import numpy as np
import pytest
from flux_tables import Iron, written

from hexatorque import firmware, setups
from hexatorque.chips import range_of
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.firmware import Controller
from hexatorque.plant.machines import constants_of
from hexatorque.setups.review import review
from hexatorque.setups.to_parameters import NOT_ON_A_BOARD, not_on_a_board

VARIANTS = [
    {},
    {"timing__latency": "none", "sensors__sample_delay_us": 1.5},
    {"timing__latency": "shadow", "inverter__v_diode_V": 1.0, "inverter__r_switch_ohm": 0.1},
    {"machine__psi_knee_Wb": 0.4, "controller__i_trip_A": 7.0, "controller__zero_hold": False},
]


@pytest.mark.parametrize("changes", VARIANTS)
@pytest.mark.parametrize("name", setups.builtin_names())
def test_the_simulation_runs_with_them(name, changes):
    setup = setups.load(name)
    known = constants_of(setup["machine.model"])
    changes = {k: v for k, v in changes.items() if k[:9] != "machine__" or k[9:] in known}
    if firmware.needs_prediction(setup["controller.scheme"]):
        apart_deg = setup.machine_values()["displacement_deg"]
        setup = setup.changed(controller__scheme="ddr" if apart_deg == 30 else "dtc1")
    setup = setup.changed(**changes)
    values = setups.parameters(setup)
    sim = SimulatedDrive(setup)
    assert list(values) == list(firmware.parameters())
    for parameter, value in values.items():
        used = sim.get(parameter)
        if isinstance(value, str):
            assert used == value, parameter
        else:
            assert np.float32(used) == np.float32(value), parameter


def test_what_the_set_up_does_not_decide_is_the_firmwares_default():
    setup = setups.load("paper-b")
    fresh = Controller(setup["timing.device"], {})
    values = setups.parameters(setup)
    others = set(values) - set(setup.controller_values())
    assert "speed_ref_rpm" in others and len(others) > 10
    for name in others:
        assert firmware.parameters()[name].parse(values[name]) == pytest.approx(
            firmware.parameters()[name].parse(fresh.get(name)), rel=1e-6
        )


def test_derived_values_from_first_principles():
    """sigma L_s is L_s - L_m^2/L_r, the encoder has four counts a line, and the drop is the mean of
    switch and diode."""
    setup = setups.load("paper-b").changed(
        inverter__v_switch_V=2.0,
        inverter__v_diode_V=1.0,
        inverter__r_diode_ohm=0.3,
        timing__latency="immediate",
        timing__isr_us=12.0,
        sensors__sample_delay_us=1.0,
        controller__flux_ref_Wb=0.5,
    )
    values = setups.parameters(setup)
    machine = setup.machine_values()
    lr_H = machine["llr_H"] + machine["lm_H"]
    assert values["sigma_ls_H"] == pytest.approx(
        machine["lls_H"] + machine["lm_H"] - machine["lm_H"] ** 2 / lr_H
    )
    assert values["encoder_counts_rev"] == 4 * setup["sensors.encoder_ppr"]
    assert values["drop_V"] == pytest.approx(1.5)
    assert values["rs_ohm"] == pytest.approx(machine["rs_ohm"] + 0.15)
    assert (values["load_mode"], values["write_delay_us"]) == ("immediate", 13.0)
    assert values["flux_trip_Wb"] == pytest.approx(1.25)


STAGE = {
    "inverter.v_switch_V": 1.2, "inverter.v_diode_V": 1.2, "inverter.r_switch_ohm": 0.02,
    "inverter.r_diode_ohm": 0.01, "heat.switch_K_W": [0.1, 0.2, 0.3, 0.4],
    "heat.switch_s": [0.01, 0.1, 1.0, 2.0], "heat.diode_K_W": [0.1, 0.1, 0.1, 0.1],
    "heat.diode_s": [0.3, 0.3, 0.3, 0.3], "heat.devices_degC": 30.0,
}  # fmt: skip


def test_the_heat_of_the_devices_from_first_principles():
    """A current that stands flows through a leg's switch and diode in turn: half of a loss by the
    thresholds heats the switch, and all commutations do. 80 K make it 32 % more resistive."""
    base = setups.load("paper-b").changed(STAGE)
    cold = base.changed({"inverter.r_switch_ohm": 0.0, "inverter.r_diode_ohm": 0.0})
    plain = setups.parameters(cold)
    assert plain["device_K_W"] == pytest.approx(0.5) and plain["device_nJ_VA"] == 0
    assert plain["device_s"] == pytest.approx(0.001 + 0.02 + 0.3 + 0.8)
    assert setups.parameters(cold.changed({"heat.time_lapse": 10.0}))["device_s"] == (
        pytest.approx(0.1121)
    )
    assert setups.parameters(base)["device_ohm"] == (
        pytest.approx(0.5 * (0.02 * (1 + 80 * 4e-3) + 0.01 * (1 + 80 * 2e-3)))
    )
    # 5 mJ at 500 V and 20 A: as much as 0.5 uJ/VA times 10 kHz and 250 V, 1.25 V.
    energies = {"inverter.e_on_mJ": 3.0, "inverter.e_off_mJ": 2.0, "inverter.e_ref_V": 500.0,
                "inverter.e_ref_A": 20.0}  # fmt: skip
    switched = setups.parameters(cold.changed(energies))
    volts = 500e-9 * float(switched["f_isr_Hz"]) * cold["inverter.vdc_V"]
    assert switched["device_nJ_VA"] == pytest.approx(500.0)
    assert switched["device_K_W"] == pytest.approx((0.6 + volts) / (1.2 + volts))
    # A diode that is the hotter one, and a heat sink, with and without a thermistor.
    diode = cold.changed({"heat.diode_K_W": [1.0] * 4, "heat.sink_K_W": 0.05})
    values = setups.parameters(diode)
    assert values["device_K_W"] == pytest.approx(2.0 + 0.3)
    assert values["device_s"] == pytest.approx(0.3)
    seen = setups.parameters(diode.changed({"sensors.sink_ntc_ohm": 5e3}))
    assert seen["device_K_W"] == pytest.approx(2.0)


def notes_of_devices(**shares):
    """The notes of `check` on the devices of a drive that is told these shares of the plant's."""
    base = setups.load("paper-b").changed(STAGE)
    right = setups.parameters(base)
    told = {f"controller.{key}": share * right[key] for key, share in shares.items()}
    found = review(base.changed(told), ())
    return [(f.subject, f.verdict) for f in found if "devices" in f.subject and f.advice]


@pytest.mark.parametrize("shares", [{}, {"device_K_W": 1.0}])
def test_check_says_nothing_where_the_drive_is_told_the_plants_devices(shares):
    assert notes_of_devices(**shares) == []


RISE, TIME = "rise of the devices as the drive computes it", "time constant of the devices"


@pytest.mark.parametrize(
    ("shares", "subject"),
    [
        ({"device_K_W": 0.0}, RISE),
        ({"device_K_W": 0.8}, RISE),
        ({"device_ohm": 100.0, "device_K_W": 1.0}, RISE),
        ({"device_s": 2.0}, TIME),
    ],
)
def test_check_says_where_the_drive_is_told_other_devices_than_the_plant_has(shares, subject):
    ((told, verdict),) = notes_of_devices(**shares)
    assert told.startswith(subject) and verdict == "note"


#: A drive with magnets, with what a file must give.
MAGNET = """
[machine]
model = "magnet"
pole_pairs = 3
rs_ohm = 0.8
psi_f_Wb = 0.17
ld_H = 6.4e-3
lq_H = 17.4e-3
lxy_H = 0.9e-3
inertia_kgm2 = 0.01
[inverter]
vdc_V = 500
dead_time_us = 2
[sensors]
i_full_A = 40
vdc_full_V = 800
encoder_ppr = 2048
[timing]
device = "f28377s"
latency = "predicted"
"""


@pytest.mark.parametrize(
    "path", [f"{section}.{key}" for section, keys in setups.KEYS.items() for key in keys]
)
def test_what_is_said_to_stay_with_the_plant_changes_no_parameter_and_all_else_does(path, tmp_path):
    section, key = path.split(".")
    common = {
        "timing.latency": "immediate", "inverter.e_ref_V": 600.0, "inverter.e_ref_A": 10.0,
        "inverter.link_F": 1e-3, "inverter.chopper_on_V": 560.0, "inverter.chopper_off_V": 550.0,
        "controller.vdc_max_V": 570.0, "sensors.vdc_full_V": 800.0, "inverter.line_Hz": 50.0,
        "inverter.source_H": 1e-3, "inverter.precharge_ohm": 10.0, "inverter.e_on_mJ": 1.0,
        "heat.switch_K_W": [0.1, 0.1, 0.1, 0.1], "load.holding_Nm": 5.0,
        "inverter.r_switch_ohm": 0.1, "inverter.r_diode_ohm": 0.1,
        "sensors.winding_ntc_ohm": 10e3, "sensors.sink_ntc_ohm": 10e3,
    }  # fmt: skip
    induction = section != "machine" or key == "model" or key in constants_of("induction")
    setup = (
        setups.load("paper-b").changed(
            {"machine.psi_knee_Wb": 1.0, "controller.precharge_V": 200.0, **common}
        )
        if induction
        else setups.parse(MAGNET, "magnet").changed(common)
    )
    if path == "machine.model":
        pytest.skip("the other keys go with it")
    if section == "rated" or key == "vdc_V":  # at this point the devices are looked at
        setup = setup.changed({"controller.device_K_W": 1.0})
    if path.startswith("heat.diode"):  # the hotter kind tells
        setup = setup.changed({"heat.diode_K_W": [1.0, 1.0, 1.0, 1.0]})
    if path == "heat.sink_K_W":  # a thermistor tells the rest
        setup = setup.changed({"sensors.sink_ntc_ohm": 0.0})
    spec = setups.KEYS[section][key]
    before = setup[path]
    if spec.kind == "choice":
        other = next((c for c in reversed(spec.choices) if c != before), None)
        if other is None:
            pytest.skip("one choice only")
    elif path in ("machine.leads", "sensors.i_wires"):
        other = list(before)[::-1]
    elif spec.kind in ("phases", "harmonics", "pairs"):
        other = [1.01 * v + 1e-4 for v in before]
    elif spec.kind == "integer":
        other = before - 1 if before > spec.min else before + 1
    elif spec.kind == "file":
        machine = (setup[f"machine.{name}"] for name in ("psi_f_Wb", "ld_H", "lq_H"))
        most_A = 1.1 * setup.parameter("i_ab_trip_A")
        other = written(tmp_path / "map.csv", Iron(*machine).rows(most_A, 17))
    else:
        other = 1.01 * before if before else 0.5 * min(1.0, spec.max)
    changed = setup.changed(**{f"{section}__{key}": other})
    same = setups.parameters(changed) == setups.parameters(setup)
    assert same == (key in NOT_ON_A_BOARD.get(section, ())), path
    assert same == (path in not_on_a_board(changed))


def test_a_range_that_is_read_from_the_table_is_the_firmwares():
    row = firmware.parameters()["flux_min_Wb"]
    assert range_of("flux_min_Wb") == pytest.approx((row.min, row.max))
