"""Parameters that do not fit together are refused with the keys, their values and the limit."""

import re

import numpy as np
import pytest

from hexatorque.firmware import Controller, FirmwareError, ffi, lib, parameters

#: A machine with magnets that fits.
MAGNET = {"machine": "magnet", "psi_f_Wb": 0.15, "scheme": "ddr"}
#: For each misfit a change of the defaults, and what the message must say.
CASES = {
    "TORQUE_BANDS": (
        {"torque_inner_Nm": 0.6},
        "torque_inner_Nm = 0.6 N m: allowed is up to torque_band_Nm = 0.5 N m",
    ),
    "FLUX_MIN": ({"flux_min_Wb": 0.7}, "allowed is up to flux_ref_Wb = 0.6 Wb"),
    "VDC_TRIPS": ({"vdc_min_V": 400.0}, "vdc_min_V = 400 V: must be below vdc_max_V = 400 V"),
    "FLUX_TRIP": ({"flux_trip_Wb": 0.6}, "flux_ref_Wb = 0.6 Wb: must be below flux_trip_Wb"),
    "I_TRIP": (
        {"i_trip_A": 27.0},
        "i_trip_A = 27 A: allowed is up to 0.885 i_full_A = 26.55 A",
    ),
    "VDC_MAX": ({"vdc_max_V": 480.0}, "allowed is up to 0.95 vdc_full_V = 475 V"),
    "PERIOD": ({"f_isr_Hz": 1000.0}, "f_isr_Hz = 1000 Hz: the PWM's counter"),
    "RATIO": ({"f_slow_Hz": 300.0}, "f_isr_Hz = 10000 Hz, f_slow_Hz = 300 Hz: the ratio"),
    "RELEASE": ({"torque_release_Nm": -0.5}, "torque_release_Nm = -0.5 N m, torque_band_Nm = 0.5"),
    "WRITE": (
        {"load_mode": "immediate", "f_isr_Hz": 2e4, "write_delay_us": 25.0},
        "write_delay_us = 25 us, f_isr_Hz = 20000 Hz",
    ),
    "DEAD_TIME": ({"f_isr_Hz": 5e4, "dead_time_us": 15.0}, "dead_time_us = 15 us, f_isr_Hz"),
    "ROTOR": ({"rr_ohm": 1000.0, "lr_H": 0.1}, "rr_ohm = 1000 ohm, lr_H = 0.1 H"),
    "LOST_LEGS": (
        {"lost_legs": 48, "scheme": "db-dtfc", "ride_through": "least-loss", "i_rated_A": 5.0},
        "lost_legs = 48, predict = on: a drive can do without legs only with load_mode = shadow",
    ),
    "LOST_RIDE": (
        {"lost_legs": 32, "scheme": "db-dtfc", "i_rated_A": 5.0},
        "lost_legs = 32, ride_through = off: a start without legs needs ride_through",
    ),
    "RATED": (
        {"ride_through": "most-torque"},
        "ride_through = most-torque, i_rated_A = 0 A: to go on without a leg needs the rated",
    ),
    "MIN_PULSE": (
        {"f_isr_Hz": 5e4, "min_pulse_us": 7.8},
        "min_pulse_us = 7.8 us, f_isr_Hz = 50000 Hz: allowed is up to 7.7 us: a period",
    ),
    "I_AB_TRIP": (
        {"i_ab_trip_A": 33.1},
        "i_ab_trip_A = 33.1 A: allowed is up to 1.1 i_full_A = 33 A",
    ),
    "COMPARATOR_I": (
        {"comparator_above_pu": 0.3, "i_trip_A": 22.5},
        "comparator_above_pu = 0.3, i_trip_A = 22.5 A: allowed is 0.092 to 0.25: a comparator's",
    ),
    "COMPARATOR_VDC": (
        {"comparator_above_pu": 0.3, "i_trip_A": 15.0, "vdc_full_V": 500.0, "vdc_max_V": 450.0},
        "comparator_above_pu = 0.3, vdc_max_V = 450 V: allowed is 0.092 to 0.2: the comparator's",
    ),
    "SALIENCY": (
        {"machine": "magnet", "ld_H": 0.03, "scheme": "ddr"},
        "ld_H = 0.03 H, sigma_ls_H = 0.025 H: allowed is 1e-06 to 0.025 H: with magnets L_d",
    ),
    "CEILING": (
        {"machine": "magnet", "psi_f_Wb": 0.2, "scheme": "ddr"},
        "speed_trip_rpm = 6000 r/min, psi_f_Wb = 0.2 Wb: allowed is 1 to 5513 r/min: with",
    ),
    "ABSOLUTE": (
        {**MAGNET, "rotor_start": "absolute", "absolute_counts_rev": 143},
        "absolute_counts_rev = 143, pole_pairs = 2: allowed is 144 and more: with",
    ),
    "XY_STEP": (
        {**MAGNET, "scheme": "dtc2", "lxy_H": 5e-4},
        "scheme = dtc2, lxy_H = 0.0005 H: allowed is lxy_H = 0.0007543 H and more: with",
    ),
    "WINDING": (
        {"displacement_deg": "60", "scheme": "ddr"},
        "scheme = ddr, displacement_deg = 60: where the sets are 0 or 60 degrees apart, the large",
    ),
    "WINDING_ALIKE": (
        {"displacement_deg": "0", "scheme": "db-dtfc", "clamp": "alternating"},
        "carrier_turn = auto, displacement_deg = 0: where the sets are 0 or 60 degrees apart, both",
    ),
    "VDC_HIGH": (
        {"vdc_high_V": 390.0},
        "vdc_high_V = 390 V: allowed is up to 0.97 vdc_max_V = 388 V",
    ),
    "VDC_LOW": (
        {"vdc_low_V": 150.0},
        "vdc_low_V = 150 V, vdc_min_V = 150 V: the level must be 0 (off), or above 1.03 times",
    ),
    "VDC_LEVELS": (
        {"vdc_low_V": 300.0, "vdc_high_V": 320.0},
        "vdc_band_V = 10 V, vdc_high_V = 320 V: between vdc_low_V and vdc_high_V there must be",
    ),
    "VDC_BAND": (
        {"vdc_high_V": 350.0, "link_F": 100e-6},
        "vdc_band_V = 10 V, link_F = 0.0001 F: allowed is 74.24 V and more: the torque answers the",
    ),
    "STOP_TIME": (
        {"ramp_down_rpm_s": 500.0, "ramp_jerk_rpm_s2": 250.0},
        "stop_s = 10 s, ramp_down_rpm_s = 500 r/min/s: allowed is 14 s and more: a stop by",
    ),
    "LEAST_LOSS": (
        {**MAGNET, "flux_least_loss": "on"},
        "flux_least_loss = on, machine = magnet: with magnets the iron's loss must be told (iron_",
    ),
    "HEAT_LEVELS": (
        {"winding_limit_degC": 160.0},
        "winding_limit_degC = 160 degC: allowed is up to winding_trip_degC = 145 degC",
    ),
    "HEAT_AMBIENT": (
        {"winding_K_W": 0.5, "ambient_degC": 120.0},
        "winding_limit_degC = 120 degC, ambient_degC = 120 degC: with heat watched (winding_K_W)",
    ),
    "HEAT_TIMES": (
        {"winding_K_W": 0.5, "winding_s": 0.05},
        "winding_s = 0.05 s, frame_s = 1800 s: allowed is 0.08001 s and more: with heat watched",
    ),
    "SHORT_KIND": (
        {"trip_state": "short-circuit"},
        "trip_state = short-circuit, machine = induction: only magnets need a short circuit",
    ),
    "SHORT_BEARS": (
        {**MAGNET, "trip_state": "short-circuit", "magnets_bear_A": 21.8},
        "magnets_bear_A = 21.8 A, trip_state = short-circuit: allowed is 21.87 A and more: the "
        "current of a short circuit",
    ),
    "SHORT_SEEN": (
        {**MAGNET, "trip_state": "short-circuit", "magnets_bear_A": 26.6},
        "magnets_bear_A = 26.6 A, i_full_A = 30 A: with trip_state = short-circuit the sensors",
    ),
    "XY_RIPPLE": (
        {"scheme": "db-ipwm", "lxy_H": 1e-3},
        "f_isr_Hz = 10000 Hz, lxy_H = 0.001 H: allowed is 1.076e+04 Hz and more: the ripple",
    ),
    "HEAT_RS": (
        {"rs_tells": "resistance", "observer": "compensated"},
        "rs_tells = resistance, adapt_s = 1 s: R_s tells something only with an induction machine",
    ),
    "PRECHARGE": (
        {"precharge_V": 154.0},
        "precharge_V = 154 V, vdc_min_V = 150 V: the level must be 0 (no relay), or above 1.03",
    ),
    "BRAKE": (
        {"brake_open_s": 0.2, "brake_Nm": -6.0, "torque_negative_Nm": 5.0},
        "brake_Nm = -6 N m, torque_limit_Nm = 15 N m: with a brake (brake_open_s) the torque",
    ),
    "CHOPPER_TRIP": (
        {"chopper_on_V": 389.0, "chopper_off_V": 380.0},
        "chopper_on_V = 389 V: allowed is up to 0.97 vdc_max_V = 388 V",
    ),
    "CHOPPER_LEVELS": (
        {"chopper_on_V": 360.0, "chopper_off_V": 358.0},
        "chopper_off_V = 358 V: allowed is up to 0.99 chopper_on_V = 356.4 V",
    ),
    "CHOPPER_OFF": (
        {"chopper_on_V": 360.0},
        "chopper_off_V = 0 V, vdc_min_V = 150 V: with a chopper (chopper_on_V) the first must be",
    ),
    "WINDING_NTC": (
        {"winding_ntc_ohm": 10e3, "winding_trip_degC": 170.0, "ntc_pull_up_ohm": 25e3},
        "ntc_pull_up_ohm = 25000 ohm, winding_ntc_ohm = 10000 ohm: allowed is 621.1 to 2.223e+04 "
        "ohm: the readings must tell",
    ),
    "SINK_NTC": (
        {"sink_ntc_ohm": 1e3, "ntc_pull_up_ohm": 50.0},
        "ntc_pull_up_ohm = 50 ohm, sink_ntc_ohm = 1000 ohm: allowed is 62.11 to 3038 ohm: the",
    ),
    "DEVICE_LEVELS": (
        {"device_limit_degC": 131.0},
        "device_limit_degC = 131 degC: allowed is up to device_trip_degC = 130 degC",
    ),
    "DEVICE_AMBIENT": (
        {"device_K_W": 1.0, "device_limit_degC": 40.0},
        "device_limit_degC = 40 degC, ambient_degC = 40 degC: with a model of the power stage",
    ),
    "FLUX_BRAKE": (
        {**MAGNET, "flux_brake_share": 0.3, "vdc_high_V": 350.0},
        "flux_brake_share = 0.3, machine = magnet: with magnets it must be 0",
    ),
    "FLUX_BRAKE_LEVEL": (
        {"flux_brake_share": 0.3},
        "flux_brake_share = 0.3, vdc_high_V = 0 V: the flux is raised while the upper level",
    ),
    "FLUX_BRAKE_VOLTAGE": (
        {"flux_brake_share": 0.3, "vdc_high_V": 350.0, "field_weakening": "off"},
        "flux_brake_share = 0.3, field_weakening = off: with a share the second must be on",
    ),
    "FLUX_BRAKE_TRIP": (
        {"flux_brake_share": 0.3, "vdc_high_V": 350.0, "flux_trip_Wb": 0.93},
        "flux_brake_share = 0.3, flux_trip_Wb = 0.93 Wb: 1.2 times the raised flux, (1 + flux",
    ),
    "QUICK_STOP_TIME": (
        {"quick_stop_rpm_s": 500.0, "ramp_down_rpm_s": 1000.0, "speed_trip_rpm": 6000.0},
        "stop_s = 10 s, quick_stop_rpm_s = 500 r/min/s: allowed is 12 s and more: a quick stop",
    ),
    "RIDE_SHORT": (
        {
            **MAGNET,
            "trip_state": "short-circuit",
            "magnets_bear_A": 25.0,
            "ride_through": "least-loss",
            "i_rated_A": 5.0,
        },
        "ride_through = least-loss, trip_state = short-circuit: a short circuit brakes with all",
    ),
    "TORQUE_MEAN": ({"torque_mean_s": 0.49}, "torque_mean_s = 0.49 s, f_slow_Hz = 100 Hz: with it"),
}


def test_every_misfit_has_a_case():
    assert [f"HT_MISFIT_{name}" for name in CASES] == sorted(
        (name for name in dir(lib) if name.startswith("HT_MISFIT_") and name[-4:] != "NONE"),
        key=lambda name: getattr(lib, name),
    )
    assert lib.ht_misfit_describe(0) == lib.ht_misfit_describe(lib.HT_MISFITS) == ffi.NULL


@pytest.mark.parametrize("name", CASES)
def test_a_misfit_is_told(name):
    changes, text = CASES[name]
    running = Controller("f28377s", {})
    before = {key: running.get(key) for key in parameters()}
    for refused in (lambda: running.set_many(changes), lambda: Controller("f28377s", changes)):
        with pytest.raises(FirmwareError) as error:
            refused()
        assert "do not fit together" in str(error.value) and text in str(error.value)
        assert "\n" not in str(error.value)
    assert {key: running.get(key) for key in parameters()} == before


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("SALIENCY", "ld_H"),
        ("CEILING", "speed_trip_rpm"),
        ("ABSOLUTE", "absolute_counts_rev"),
        ("XY_STEP", "lxy_H"),
        ("VDC_BAND", "vdc_band_V"),
    ],
)
def test_the_end_of_the_told_range_is_taken(name, key):
    """The text's number is rounded, but not into what is refused."""
    changes, text = CASES[name]
    end = re.search(r"allowed is (?:.* to |lxy_H = )?([\d.e+-]+)", text)
    Controller("f28377s", {**changes, key: float(end[1])})


@pytest.mark.parametrize("row", parameters().values(), ids=lambda row: row.name)
def test_a_limit_that_the_drive_tells_is_taken_again(row):
    """It keeps a float, which may be a little beyond the table's decimal number."""
    for end, beyond in ((row.min, -np.inf), (row.max, np.inf)):
        kept = np.float32(end)
        assert row.parse(row.show(float(kept))) == kept
        if not row.choices:
            with pytest.raises(FirmwareError, match=f"{row.name} = .*: allowed range is"):
                row.parse(float(np.nextafter(kept, np.float32(beyond))))


def test_a_misfit_is_told_beside_a_parameter_at_its_limit():
    """The told range is found by the drive's own values."""
    changes, text = CASES["CEILING"]
    with pytest.raises(FirmwareError) as error:
        Controller("f28377s", {**changes, "build_s": 0.01})
    assert text in str(error.value)


def test_a_demand_that_no_value_meets_names_the_other_parameter():
    """6000 s of stop_s, whose range ends at 3600 s."""
    with pytest.raises(FirmwareError, match="no value in its range is enough, change ramp_down"):
        Controller("f28377s", {"ramp_down_rpm_s": 1.0, "speed_trip_rpm": 6000.0})


def test_the_write_takes_its_time_from_the_pulses():
    changes = {"load_mode": "immediate", "f_isr_Hz": 5e4, "write_delay_us": 9.0}
    with pytest.raises(FirmwareError, match=r"allowed is up to 3\.2 us"):
        Controller("f28377s", {**changes, "min_pulse_us": 3.3})


def test_a_trip_in_alpha_beta_comes_before_all_readings_are_at_their_limits():
    """However large a balanced current is, its readings end at 88.5 % of the range in the worst
    case. Then they show a magnitude of 1.1 times the range in every direction."""
    largest = []
    for degrees in np.arange(0, 360, 0.5):
        phases = 1000 * np.cos(np.deg2rad(degrees) - np.deg2rad([0, 30, 120, 150, 240, 270]))
        six = {"p": np.clip(phases, -0.885, 0.885).tolist()}
        seen = lib.ht_vsd_from_six([six]).ab
        largest.append(np.hypot(seen.alpha, seen.beta))
    assert 1.1 < min(largest) < 1.11


def test_a_start_without_legs_needs_a_law_that_looks_ahead():
    changes = {"lost_legs": 32, "ride_through": "least-loss", "i_rated_A": 5.0}
    with pytest.raises(FirmwareError, match="lost_legs = 32"):
        Controller("f28377s", {**changes, "scheme": "ddr", "predict": "off"})
    assert Controller("f28377s", {**changes, "scheme": "db-dtfc"}).get("lost_legs") == 32


@pytest.mark.parametrize(
    "changes",
    [
        {"torque_inner_Nm": 0.5},
        {"flux_min_Wb": 0.6},
        {"i_trip_A": 26.5},
        {"torque_release_Nm": -0.49},
        {"f_slow_Hz": 1000.0},
        {"load_mode": "immediate", "f_isr_Hz": 2e4, "write_delay_us": 24.9},
        {"load_mode": "shadow", "f_isr_Hz": 2e4, "write_delay_us": 25.0},
        {"f_isr_Hz": 5e4, "min_pulse_us": 7.69},
        {"load_mode": "immediate", "f_isr_Hz": 5e4, "write_delay_us": 9.0, "min_pulse_us": 3.19},
        {"i_ab_trip_A": 33.0},
        {"comparator_above_pu": 0.25, "i_trip_A": 22.5},
        {"vdc_full_V": 500.0, "vdc_max_V": 475.0},
        {"comparator_above_pu": 0.2, "i_trip_A": 15.0, "vdc_full_V": 500.0, "vdc_max_V": 450.0},
    ],
)
def test_what_just_fits_is_taken(changes):
    controller = Controller("f28377s", {})
    controller.set_many(changes)
    assert all(controller.get(name) == pytest.approx(value) for name, value in changes.items())


def test_a_short_circuit_may_take_as_much_of_the_sensors_range_as_a_trip():
    share = lib.ht_misfit_describe(lib.HT_MISFIT_I_TRIP).share
    told = ffi.string(lib.ht_misfit_demand(lib.HT_MISFIT_SHORT_SEEN)).decode()
    assert f"{share:.3g} times the second at most" in told


#: Other ways into the same misfit.
MORE = {
    "WINDING_ALIKE": [
        {"displacement_deg": "0", "scheme": "db-dtfc", "carrier_turn": "always"},
        {"displacement_deg": "60", "scheme": "db-dtfc", "carrier_turn": "always"},
    ],
    "HEAT_RS": [
        {"rs_tells": "resistance", "adapt_s": 0.0},
        {**MAGNET, "rs_tells": "resistance"},
    ],
    "HEAT_AMBIENT": [{"winding_K_W": 0.5, "ambient_degC": 130.0}],
    "DEVICE_AMBIENT": [{"device_K_W": 1.0, "device_limit_degC": 30.0}],
    "PRECHARGE": [{"precharge_V": 400.0}, {"precharge_V": 401.0}],
    "BRAKE": [
        {"brake_open_s": 0.2, "brake_Nm": 15.1},
        {"brake_open_s": 0.2, "brake_Nm": -15.1},
        {"brake_open_s": 0.2, "brake_Nm": -15.1, "torque_negative_Nm": 16.0},
    ],
}  # fmt: skip


@pytest.mark.parametrize(("name", "changes"), [(n, c) for n, cases in MORE.items() for c in cases])
def test_another_way_into_the_same_misfit(name, changes):
    demand = ffi.string(lib.ht_misfit_demand(getattr(lib, f"HT_MISFIT_{name}"))).decode()
    with pytest.raises(FirmwareError, match=re.escape(demand[:30])):
        Controller("f28377s", changes)


@pytest.mark.parametrize("changes", [
    {"brake_open_s": 0.2, "brake_Nm": 6.0, "torque_negative_Nm": 5.0},  # against the positive limit
    {"brake_open_s": 0.2, "brake_Nm": -5.0, "torque_negative_Nm": 5.0},
    {"brake_open_s": 0.2, "brake_Nm": -6.0},
    {"precharge_V": 399.0},
    {"displacement_deg": "60", "scheme": "db-dtfc", "carrier_turn": "off"},
    {**MAGNET, "flux_least_loss": "on", "iron_hysteresis_A_Wb": 1.0},
    {**MAGNET, "flux_least_loss": "on", "iron_eddy_S": 0.001},
])  # fmt: skip
def test_what_fits_in_another_way_is_taken(changes):
    Controller("f28377s", changes)


def test_a_time_in_counts_is_rounded_up():
    assert lib.ht_counts_up(0.0, 150e6) == 0
    assert lib.ht_counts_up(1.0, 150e6) == 150
    assert lib.ht_counts_up(1.001, 150e6) == 151
