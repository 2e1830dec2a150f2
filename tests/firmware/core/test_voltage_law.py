"""What the laws that command a voltage share, and how the drive's rows of laws are dispatched."""

import numpy as np
import pytest

from hexatorque.firmware import Controller, ffi, lib

PREDICTED = {"load_mode": "shadow", "predict": "on"}
NO_LAW = (lib.HT_LAWS, lib.HT_LAWS + 1, 0xFFFF)


def machine(ts, rs_ohm=6.0):
    values = {"ts_s": ts, "inv_ts": 1 / ts, "rs_ohm": rs_ohm, "sigma_ls_H": 0.028, "lxy_H": 0.0144}
    return ffi.new("ht_observer_config *", values)


def numbers(value):
    """What a member of a configuration holds, the members of a struct one by one."""
    if not isinstance(value, ffi.CData):
        return value
    of = ffi.typeof(value)
    parts = list(value) if of.kind == "array" else [getattr(value, name) for name, _ in of.fields]
    return [numbers(part) for part in parts]


def control(scheme):
    """A configuration and its state, as a drive has them; the drive must be kept."""
    made = Controller("f28377s", {**PREDICTED, "scheme": scheme})
    cfg = ffi.new("ht_control_config *", made.drive.config.control)
    state = ffi.new("ht_control_state *")
    lib.ht_control_reset(cfg, state, ffi.new("ht_six *"))
    return cfg, state


def test_the_least_sampling_frequency_is_five_per_time_constant():
    for rs, sigma_ls, lxy in ((6.0, 0.028, 0.0144), (6.0, 0.01, 0.0144), (1.8, 0.025, 0.01)):
        shortest_s = min(sigma_ls, lxy) / rs
        assert lib.ht_voltage_law_least_Hz(rs, sigma_ls, lxy) == pytest.approx(5 / shortest_s)
    for ts, fits in ((0.19 * 0.0144 / 6, True), (0.21 * 0.0144 / 6, False)):
        assert lib.ht_voltage_law_fast_enough(machine(ts)) == fits
    assert not lib.ht_voltage_law_fast_enough(machine(1e-4, np.nan))


@pytest.mark.parametrize("law", NO_LAW)
@pytest.mark.parametrize("scheme", ["ddr", "db-dtfc", "foc", "db-ipwm"])
def test_a_law_that_does_not_exist_is_refused(scheme, law):
    """With the reason, whatever else the configuration says."""
    cfg, _ = control(scheme)
    assert lib.ht_control_check(cfg) == lib.HT_CONFIG_OK
    cfg.law = law
    assert lib.ht_control_check(cfg) == lib.HT_CONFIG_LAW
    assert not lib.ht_law_commands_voltage(law)


@pytest.mark.parametrize("lost", [0, 0b100000])
@pytest.mark.parametrize("law", NO_LAW)
def test_a_law_that_does_not_exist_makes_no_voltage(law, lost):
    """It takes over from none of the others: whatever torque is asked for, all legs get the same
    mean, and no law's state moves. A drive without a leg then only gets what its lost leg asks
    for, which is independent of the torque as well."""
    seen = []
    for torque_Nm in (0.0, 5.0, -50.0):
        cfg, state = control("db-dtfc")
        cfg.law = law
        if lost:
            assert lib.ht_control_lose(cfg, state, lost, 0.0)
        parts = [ffi.addressof(state, name) for name in ("table_law", "deadbeat_law", "foc_law")]
        before = [bytes(ffi.buffer(part)) for part in parts]
        out = ffi.new("ht_compare *")
        means = []
        for _ in range(6):
            given = ffi.new("ht_control_input *", {"vdc_V": 300.0, "torque_ref_Nm": torque_Nm,
                                                   "flux_ref_Wb": 0.6})  # fmt: skip
            lib.ht_control_step(cfg, state, given, False, out)
            mean = state.next.mean_pu
            means.append((mean.ab.alpha, mean.ab.beta, mean.xy.x, mean.xy.y))
        assert [bytes(ffi.buffer(part)) for part in parts] == before
        if not lost:
            np.testing.assert_allclose(means, 0.0, atol=1e-4)
        seen.append(means)
    assert seen[0] == seen[1] == seen[2]


@pytest.mark.parametrize("scheme", ["ddr", "dtc3", "db-dtfc", "foc", "foc-24", "db-ipwm"])
def test_the_law_of_a_scheme_is_configured_and_accepted(scheme):
    """A configuration in memory that may hold anything: what the law uses does not depend on it."""
    made = Controller("f28377s", {**PREDICTED, "scheme": scheme})
    row = lib.ht_scheme_describe(made.drive.config.control.scheme)
    results = []
    for fill in (b"\x00", b"\x5a"):
        cfg = ffi.new("ht_control_config *")
        ffi.buffer(cfg)[:] = fill * ffi.sizeof(cfg[0])
        cfg.observer = made.drive.config.control.observer
        given = ffi.new("ht_law_setting *", {"scheme": row, "machine": ffi.addressof(cfg.observer),
                                             "vdc_max_V": 400.0, "kappa": 1.0})  # fmt: skip
        lib.ht_control_select(cfg, made.drive.config.control.scheme)
        lib.ht_control_configure(cfg, given)
        name = ("table_law", "deadbeat_law", "foc_law", "interleaved_law")[row.law]
        own = getattr(cfg, name)
        used = [numbers(getattr(own, key)) for key in dir(own) if not key.startswith("xy")]
        modulator = [getattr(cfg.modulator, key) for key in dir(cfg.modulator)]
        results.append((used, modulator))
    assert results[0] == results[1]
