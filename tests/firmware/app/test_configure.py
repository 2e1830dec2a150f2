"""From parameters to what the control step and the checks use, and the tables' answers to numbers
that are in no table."""

import functools
import math
import re
from pathlib import Path

import numpy as np
import pytest

from hexatorque import firmware
from hexatorque.firmware import Controller, FirmwareError, ffi, lib

TABLES = Path(__file__).resolve().parents[3] / "firmware" / "app"

DEADBEAT = {"scheme": "db-dtfc", "load_mode": "shadow", "predict": "on"}


def controller(**values):
    return Controller("f28377s", values)


def control(**values):
    made = controller(**values)
    return made, made.drive.config.control


@pytest.mark.parametrize("scheme, own", [("ddr", 3), ("dtc3", 5)])
def test_torque_levels_are_the_schemes_or_those_asked_for(scheme, own):
    for asked, levels in (("auto", own), ("2", 2), ("3", 3), ("5", 5)):
        _, config = control(scheme=scheme, torque_levels=asked)
        assert config.table_law.torque_levels == levels


@pytest.mark.parametrize(
    "kappa, from_pu, turned_from_pu",
    [(1.0, 0.53, 0.3), (1.0, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.53, 0.3)],
)
def test_the_carrier_turns_where_that_lowers_the_ripple(kappa, from_pu, turned_from_pu):
    """A zero sequence that is clamped at every voltage wants it at every voltage."""
    values = {**DEADBEAT, "kappa": kappa, "kappa_from_pu": from_pu}
    _, config = control(**values)
    assert config.modulator.turn_pu == pytest.approx(turned_from_pu)
    _, config = control(**values, carrier_turn="always")
    assert config.modulator.turn_pu == 0.0
    _, config = control(**values, carrier_turn="off")
    assert config.modulator.turn_pu > 10.0  # no inverter makes that voltage


def test_a_step_may_limit_legs_where_two_periods_of_it_make_little_xy_current():
    """Twelve-step operation makes x-y of half the difference of two vectors of 2/3 V_dc, 30 degrees
    apart. L_xy on both sides of the one in which two periods of it make a fifth of the trip."""
    xy_pu = 2 / 3 * math.sin(math.radians(15))
    trip_A, vdc_max_V, f_isr_Hz = 20.0, 450.0, 10e3
    edge_H = 2 * xy_pu * vdc_max_V / f_isr_Hz / (0.2 * trip_A)
    for lxy_H, reach_pu in ((1.03 * edge_H, 1.0), (0.97 * edge_H, 1 / math.sqrt(3))):
        _, config = control(
            **{**DEADBEAT, "lxy_H": lxy_H, "i_trip_A": trip_A, "vdc_max_V": vdc_max_V}
        )
        assert config.deadbeat_law.reach_pu == pytest.approx(reach_pu, rel=1e-3)


@pytest.mark.parametrize("clamp, kappa", [("largest", 0.0), ("alternating", 0.7)])
def test_interleaved_sets_clamp_legs_that_alternate_and_no_others(clamp, kappa):
    """The modulator takes their place where legs are missing, and always centres."""
    values = {**DEADBEAT, "scheme": "db-ipwm", "kappa": 0.7, "kappa_from_pu": 0.38}
    _, config = control(**values, clamp=clamp)
    assert config.interleaved_law.positions.kappa == pytest.approx(kappa)
    assert config.interleaved_law.positions.kappa_from_pu == pytest.approx(0.38)
    assert config.modulator.kappa == 0.0 and not config.modulator.alternate


@pytest.mark.parametrize("scheme, turned", [("foc", False), ("foc-24", True)])
def test_field_orientation_has_the_carrier_of_its_scheme(scheme, turned):
    for asked in ("auto", "off", "always"):
        _, config = control(**{**DEADBEAT, "scheme": scheme, "carrier_turn": asked, "kappa": 1.0})
        assert (config.modulator.turn_pu == 0.0) == turned
        assert turned or config.modulator.turn_pu > 10.0  # no inverter makes that voltage
        assert config.modulator.kappa == 0.0


def test_prediction_needs_shadow_load():
    for load_mode, predict, predicts in (
        ("shadow", "on", True),
        ("shadow", "off", False),
        ("immediate", "on", False),
        ("immediate", "off", False),
    ):
        _, config = control(load_mode=load_mode, predict=predict, scheme="ddr")
        assert config.predict == predicts


@pytest.mark.parametrize(
    "changes, text",
    [
        ({"load_mode": "immediate"}, "needs load_mode = shadow and predict = on"),
        ({"predict": "off"}, "needs load_mode = shadow and predict = on"),
        ({"f_isr_Hz": 2000.0, "rs_ohm": 30.0}, "needs a higher f_isr_Hz"),
    ],
)
def test_what_the_deadbeat_law_needs(changes, text):
    with pytest.raises(FirmwareError, match=text):
        controller(**{**DEADBEAT, **changes})


def test_a_rotor_without_resistance_needs_no_magnetising_current():
    made, _ = control(rr_ohm=0.0, observer="voltage")
    assert made.drive.config.protect.magnetise_A_Wb == 0.0
    made, _ = control(rr_ohm=2.0)
    assert made.drive.config.protect.magnetise_A_Wb > 0.0


#: Machines and rates that are unlike in everything.
DRIVES = [
    {"sigma_ls_H": 0.025, "lm_H": 0.284, "lr_H": 0.299, "rr_ohm": 2.0, "pole_pairs": 1,
     "f_isr_Hz": 10000.0, "f_slow_Hz": 50.0, "flux_ref_Wb": 0.6, "lxy_H": 0.01,
     "i_sum_trip_A": 2.0, "loss_check": 0.009, "vdc_max_V": 400.0},
    {"sigma_ls_H": 0.006, "lm_H": 0.051, "lr_H": 0.054, "rr_ohm": 0.3, "pole_pairs": 4,
     "f_isr_Hz": 16000.0, "f_slow_Hz": 40.0, "flux_ref_Wb": 0.35, "lxy_H": 0.002,
     "i_sum_trip_A": 5.0, "loss_check": 0.02, "vdc_max_V": 700.0, "vdc_full_V": 800.0},
]  # fmt: skip


@pytest.mark.parametrize("v", DRIVES)
def test_the_checks_know_the_machine(v):
    """Inductances by their definitions: sigma = 1 - L_m^2/(L_s L_r), so L_s - sigma L_s is
    L_m^2/L_r. The rotor's winding seen from the stator has R_r (L_m/L_r)^2. A low pass of time
    constant tau, looked at once in T, takes T/(T + tau) of each difference."""
    made, _ = control(**v)
    c = made.drive.config.protect
    ratio, slow_s = v["lm_H"] / v["lr_H"], 1 / v["f_slow_Hz"]
    ls_H = v["sigma_ls_H"] + v["lm_H"] * ratio
    found = {name: getattr(c, name) for name in dir(c)}
    wanted = {
        "ls_H": ls_H,
        "sigma": 1 - v["lm_H"] ** 2 / (ls_H * v["lr_H"]),
        "no_load_A": v["flux_ref_Wb"] / ls_H,
        "slip_gain": v["rr_ohm"] * ratio**2,
        "rpm_per_rad_s": 60 / (2 * np.pi) / v["pole_pairs"],
        "flux_gain": slow_s / (slow_s + 0.2),
        "encoder_gain": slow_s / (slow_s + 0.05),
        "rotor_gain": slow_s / (slow_s + v["lr_H"] / v["rr_ohm"] / 30),
        # r falls behind by tau dr/dt, and L_r/R_r dr/dt needs (1 - sigma) L_s times that current.
        "magnetise_A_Wb": 30 / (ls_H - v["sigma_ls_H"]),
        "slow_Hz": 1 / slow_s,
        "slow_turns_s": slow_s / (2 * np.pi),
    }
    assert {name: found[name] for name in wanted} == pytest.approx(wanted, rel=1e-5)


#: What one may add to a drive, and its limits.
ADDED = {
    "winding_K_W": 0.4, "winding_s": 45.0, "frame_K_W": 0.25, "frame_s": 900.0, "rs_ohm": 4.5,
    "rs_degC": 30.0, "ambient_degC": 35.0, "adapt_s": 1.5, "observer": "hybrid",
    "crossover_Hz": 1.0, "rs_tells": "resistance",
    "device_K_W": 1.2, "device_s": 0.3, "device_nJ_VA": 150.0,
    "fan_s": 7.0, "brake_open_s": 0.15, "brake_close_s": 0.12, "brake_Nm": 3.0,
    "precharge_V": 240.0, "vdc_min_V": 150.0, "chopper_on_V": 340.0, "chopper_off_V": 330.0,
    "vdc_high_V": 360.0, "vdc_low_V": 200.0, "vdc_band_V": 12.0, "kp_speed_Nms_rad": 0.4,
    "flux_brake_share": 0.2, "flux_check": 0.3, "flux_wait_s": 0.72, "flux_min_Wb": 0.05,
    "encoder_trip_rpm": 150.0, "encoder_counts_rev": 8192.0,
    "iron_hysteresis_A_Wb": 0.9, "iron_eddy_S": 0.003,
    "ramp_up_rpm_s": 900.0, "ramp_down_rpm_s": 700.0, "ramp_jerk_rpm_s2": 5000.0,
    "motion": "quick-stop", "quick_stop_rpm_s": 4000.0, "ki_speed_Nm_rad": 2.5,
    "start_max_rpm": 20.0, "speed_period_rpm": 100.0,
}  # fmt: skip


@pytest.mark.parametrize("v", [one | ADDED for one in DRIVES])
def test_limits_outputs_and_losses_know_drive_and_machine(v):
    """Times in slow interrupts, low passes as above, the machine's loss in its own quantities."""
    made, _ = control(**v)
    c, slow_s = made.drive.config, 1 / v["f_slow_Hz"]
    ratio = v["lm_H"] / v["lr_H"]
    main_H = ratio * v["lm_H"]
    ls_H = v["sigma_ls_H"] + main_H
    # At a slip w_s a flux psi makes 3 P psi^2 w_s/R_r of the rotor seen from the stator; the circle
    # diagram's top is at half of the current that the leakage alone would leave.
    by_slip = 3 * v["pole_pairs"] * (v["encoder_trip_rpm"] * v["pole_pairs"] * np.pi / 30) / (
        v["rr_ohm"] * ratio**2
    )  # fmt: skip
    pull_out = 0.8 * 3 * v["pole_pairs"] * (1 / v["sigma_ls_H"] - 1 / ls_H) / 2
    # The winding loses heat to the frame, which takes it and loses it to the air.
    fastest_Hz = 1 / 45 + (1 + 0.25 / 0.4) / 900
    steps = math.floor(1 / 32 / (slow_s * fastest_Hz)) + 1
    step_s = steps * slow_s
    zero_degC = 20 - 1 / 0.00393  # where the line of copper's resistance ends

    def low_pass(time_s):
        return slow_s / (slow_s + time_s)

    wanted = {
        "least_loss.error_gain": low_pass(1.0),
        "least_loss.per_Nm": 1 / (3 * v["pole_pairs"] * main_H),
        "least_loss.ls2_H2": ls_H**2,
        "least_loss.across2_H2": v["sigma_ls_H"] ** 2,
        "least_loss.rotor_ohm": v["rr_ohm"] * ratio**2,
        "least_loss.hysteresis_ohm": v["iron_hysteresis_A_Wb"] / 3,
        "least_loss.eddy_ohm": v["iron_eddy_S"] / 3,
        "pull_out_Nm_Wb2": pull_out,
        "least_loss.reach_Nm_Wb2": min(by_slip, pull_out),
        "least_loss.wait": int(0.72 / slow_s),
        "flux_brake.raise_Wb": 0.2 * v["flux_ref_Wb"],
        "flux_brake.most_Wb": 1.2 * v["flux_ref_Wb"],
        "flux_brake.hold": 0.1 / slow_s,
        "flux_brake.per_check": 1 / 0.3**2,
        "heat.steps": steps,
        "heat.sample_gain": 1 / 3,
        "heat.more_gain": 1 / 11,
        # A leg has a look in seven fast interrupts, and four more for a period of four.
        "heat.look_turns": v["f_isr_Hz"] * slow_s / 7 + 4,
        "heat.to_frame": step_s / 45,
        "heat.per_W_K": step_s / 45 * 6 * 0.4,
        "heat.to_ambient": step_s / 900,
        "heat.frame_per_W_K": step_s / 900 * 0.25,
        "heat.frame_per_rise": step_s / 900 * 0.25 / (6 * 0.4),
        "heat.ohm_per_K": 4.5 / (30 - zero_degC),
        "heat.ambient_K": 35 - zero_degC,
        "heat.settled": 6 * 1.5 / slow_s,
        "heat.rs_tells": 2,
        "heat.heed": 1.0,
        "device_heat.gain": low_pass(0.3),
        "device_heat.share_V": 150e-9 * v["f_isr_Hz"],
        "outputs.precharge_V": 240.0,
        "outputs.rearm_V": 150.0,
        "outputs.stands": 0.1 / slow_s,
        "outputs.opens": 0.15 / slow_s,
        "outputs.closes": 0.12 / slow_s,
        "outputs.fan_after": 7 / slow_s,
        "outputs.chopper_on_V": 340.0,
        "outputs.chopper_off_V": 330.0,
        "vdc.above_V": 348.0,
        "vdc.below_V": 212.0,
        "vdc.per_band": 1 / 12,
        "ramp.up_rpm": 900 * slow_s,
        "ramp.down_rpm": 700 * slow_s,
        "ramp.jerk_rpm": 5000 * slow_s**2,
        "stop.down_rpm": 4000 * slow_s,
        "stop.jerk_rpm": 0.0,
        "speed.ki_ts_Nms_rad": 2.5 * slow_s,
        "measure.rpm_per_count": 60 / slow_s / 8192,
        "sets.gain": low_pass(0.05),
        "lxy_gain": low_pass(0.3),
        "omega_mean_gain": low_pass(0.2),
        "build_gain": low_pass(0.1),
        "built": 2.5 * 0.1 / slow_s,
        "adapt_gain": low_pass(1.5),
        "protect.counts_quick": 1 / (1 + 3e-4 * v["f_isr_Hz"]),
        "protect.most_counts": 150 * 8192 / 60 / v["f_isr_Hz"],
    }
    found = {name: functools.reduce(getattr, name.split("."), c) for name in wanted}
    assert found == pytest.approx(wanted, rel=1e-5)


MAGNET = {
    "machine": "magnet", "psi_f_Wb": 0.17, "ld_H": 6.4e-3, "sigma_ls_H": 17.4e-3, "rs_ohm": 0.8,
    "pole_pairs": 3, "emf5_share": 0.04, "emf5_deg": 30.0, "emf7_share": 0.02, "emf7_deg": -60.0,
    "speed_trip_rpm": 700.0, "torque_limit_Nm": 9.0,
}  # fmt: skip


def test_the_laws_know_the_magnets():
    made, c = control(**MAGNET)
    m = c.observer.magnet
    wanted = {
        "psi_f_Wb": 0.17, "inv_psi_f": 1 / 0.17, "ld_H": 6.4e-3, "lq_H": 17.4e-3,
        "inv_ld": 1 / 6.4e-3, "saliency_H": 6.4e-3 - 17.4e-3, "share": 1 - 17.4 / 6.4,
        "torque_gain": 9.0,
    }  # fmt: skip
    assert {name: getattr(m, name) for name in wanted} == pytest.approx(wanted, rel=1e-5)
    assert made.drive.config.protect.inv_psi_f == pytest.approx(1 / 0.17)


def test_the_current_of_a_short_circuit_is_that_beyond_the_trip():
    """A shaft that is 10 % faster than the trip, which makes the limit's torque across the magnets
    or against them."""
    made, c = control(**MAGNET)
    omega = 1.1 * 700 * 2 * np.pi / 60 * 3
    across_A = 9.0 / (3 * 3 * 0.17)
    wanted = lib.ht_magnet_short_A(ffi.addressof(c.observer.magnet), 0.8, omega, across_A)
    found = lib.ht_magnet_trip_short_A(ffi.addressof(made.drive.config.params))
    assert found == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("degrees", ["30", "0", "60"])
def test_sets_that_are_alike_reach_no_further_than_one_of_them(degrees):
    """The dodecagon of sets 30 degrees apart is larger than the hexagon of each, 1/sqrt(3)."""
    made = controller(**DEADBEAT, displacement_deg=degrees, lxy_H=0.03)
    pu = lib.ht_control_reach_pu(ffi.addressof(made.drive.config.control))
    assert (pu > 0.58) if degrees == "30" else (pu == pytest.approx(1 / math.sqrt(3), rel=1e-5))


def test_what_is_not_wanted_has_no_level():
    without = dict.fromkeys(("chopper_on_V", "vdc_high_V", "vdc_low_V", "adapt_s", "fan_s"), 0.0)
    made, _ = control(**without)
    c = made.drive.config
    assert c.outputs.chopper_on_V > 1e6 and c.outputs.chopper_off_V > 1e6
    assert c.vdc.above_V > 1e6 and c.vdc.below_V < -1e6
    assert c.adapt_gain == 0 and c.outputs.fan_after == 0 and c.heat.steps == 0


@pytest.mark.parametrize("v", DRIVES)
def test_the_check_for_lost_legs_knows_drive_and_machine(v):
    """The residual is a voltage, a share of the largest dc link. Evidence is gathered for
    1 ms, and a wrong sensor rules a loss out for 10 ms."""
    _, config = control(**v)
    c, ts = config.leg_loss, 1 / v["f_isr_Hz"]
    assert c.least_V2 == pytest.approx((v["loss_check"] * v["vdc_max_V"]) ** 2, rel=1e-5)
    assert c.gain == pytest.approx(ts / (ts + 0.002), rel=1e-5)
    assert c.l_per_ts_ohm == pytest.approx(v["lxy_H"] / ts, rel=1e-5)
    assert c.sum_A == pytest.approx(0.3 * v["i_sum_trip_A"], rel=1e-5)
    assert c.zero_A == pytest.approx(0.25 * c.sum_A, rel=1e-5)
    assert (c.hold, c.wait) == (round(1e-3 / ts), round(1e-2 / ts))


def test_a_dead_time_that_the_power_stage_forbids_is_refused():
    """By the board's own range, also at the start."""
    made = controller()
    params = ffi.new("ht_params *", made.drive.params)
    row = firmware.parameters()["dead_time_us"].id
    for dead_time_us, result in ((0.0, lib.HT_ERROR_VALUE), (2.3, lib.HT_OK)):
        params.v[row] = dead_time_us
        assert lib.ht_drive_init(made.drive, made.port, params) == result


@pytest.mark.parametrize(
    ("name", "field"), (("dead_time_us", "dead_min_us"), ("min_pulse_us", "min_pulse_us"))
)
def test_a_board_without_a_shortest_time_has_the_tables_range(name, field):
    port = ffi.new("ht_port *")
    board = ffi.new("ht_board *", firmware.board_of("f28377s")[0])
    row = firmware.parameters()[name]
    for least_us in (0.0, 1.0):
        setattr(board, field, least_us)
        lib.ht_port_bind(port, ffi.NULL, board)
        span = lib.ht_param_range(port, row.id)
        assert span.min == max(least_us, row.min)
        assert span.max <= row.max


def test_a_period_of_too_few_counts_does_not_fit():
    made = controller()
    for clock_Hz, fits in ((8.01e4, True), (7.9e4, False), (6.55e8, True), (6.56e8, False)):
        misfit = lib.ht_misfit_of(ffi.addressof(made.drive.params), clock_Hz)
        assert (misfit != lib.HT_MISFIT_PERIOD) == fits


@pytest.mark.parametrize("f_slow_Hz", [295.0, 300.0, 99.5])
def test_a_ratio_on_either_side_of_a_whole_number_does_not_fit(f_slow_Hz):
    with pytest.raises(FirmwareError, match="the ratio must be a whole number"):
        controller(f_isr_Hz=10000.0, f_slow_Hz=f_slow_Hz)


def test_two_interrupts_of_one_rate_do_not_fit():
    """No board here has a PWM that is slow enough for it."""
    made = controller()
    params = ffi.new("ht_params *", made.drive.params)
    for name in ("f_isr_Hz", "f_slow_Hz"):
        params.v[firmware.parameters()[name].id] = 1000.0
    assert lib.ht_misfit_of(params, 5e7) == lib.HT_MISFIT_RATIO
    params.v[firmware.parameters()["f_slow_Hz"].id] = 500.0
    assert lib.ht_misfit_of(params, 5e7) != lib.HT_MISFIT_RATIO


@pytest.mark.parametrize(
    ("table", "macro", "describe"),
    (("ht_faults.def", "HT_FAULT", lib.ht_fault_describe),
     ("ht_warnings.def", "HT_WARNING", lib.ht_warning_describe)),
)  # fmt: skip
def test_bit_text_and_help_are_those_of_the_table(table, macro, describe):
    lines = (TABLES / table).read_text().splitlines()
    rows = [line for line in lines if line.startswith(f"{macro}(")]
    assert len(rows) >= 9
    for number, row in enumerate(rows):
        bit, text, help = re.fullmatch(rf'{macro}\(\w+, (\w+), "(.*?)", "(.*)"\)', row).groups()
        made = describe(number)
        assert made.bit == int(bit.rstrip("uL"), 0)
        assert ffi.string(made.name).decode() == text
        assert ffi.string(made.help).decode() == help


def test_a_row_of_the_faults_tells_its_bit_and_a_channel_holds_all_of_them():
    """The link finds a bit beyond the sixteenth by its row, and a float has 24 bits."""
    bits = [lib.ht_fault_describe(row).bit for row in range(lib.ht_fault_count())]
    assert bits == [1 << row for row in range(len(bits))]
    assert np.float32(sum(bits)) == sum(bits)


def test_numbers_that_are_in_no_table():
    made = controller()
    past = lib.ht_param_count()
    assert not lib.ht_param_valid(past, 0.0)
    assert lib.ht_param_describe(past) == ffi.NULL
    assert lib.ht_drive_get(made.drive, past) == 0.0
    span = lib.ht_param_range(made.port, past)
    assert (span.min, span.max) == (0.0, 0.0)
    assert lib.ht_fault_describe(lib.ht_fault_count()) == ffi.NULL
    for more in (0, 1, 1000):
        assert lib.ht_warning_describe(lib.ht_warning_count() + more) == ffi.NULL
    assert lib.ht_channel_describe(lib.ht_channel_count()) == ffi.NULL
    assert lib.ht_channel_read(made.drive, lib.ht_channel_count()) == 0.0
    assert ffi.string(lib.ht_state_name(lib.HT_STATES)) == b""


def test_one_channel_reads_as_all_of_them_do():
    made = controller()
    made.drive.torque_ref_Nm = 3.0
    made.drive.speed_rpm = -250.0
    made.drive.control.estimate.psi_Wb.alpha = 0.25
    count = lib.ht_channel_count()
    together = np.zeros(count, np.float32)
    lib.ht_channels_read(made.drive, ffi.cast("float *", together.ctypes.data))
    alone = [lib.ht_channel_read(made.drive, k) for k in range(count)]
    np.testing.assert_array_equal(together, np.float32(alone))
    assert np.count_nonzero(together) > 3
