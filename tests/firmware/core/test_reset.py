"""ht_control_reset: of what was before, nothing has an effect on what follows."""

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque.firmware import Controller, ffi, lib, parameters

CHOICES = {name: row.choices for name, row in parameters().items()}
#: With all that the step can do: devices' drops, a check for lost legs, an adapted resistance.
VALUES = {"load_mode": "shadow", "predict": "on", "drop_V": 1.5, "loss_check": 0.009}


def bits(value):
    return bytes(ffi.buffer(ffi.addressof(value)))


def numbers(value):
    """All of a struct."""
    if not isinstance(value, ffi.CData):
        return [value]
    if ffi.typeof(value).kind == "array":
        return [n for item in value for n in numbers(item)]
    return [n for name, _ in ffi.typeof(value).fields for n in numbers(getattr(value, name))]


def reset(cfg, state):
    lib.ht_control_reset(cfg, state, [{"p": [0.5, -0.2, 0.1, 0.3, -0.6, -0.1]}])


def lives(cfg, state, seed, steps=60):
    """What a drive with these samples does and estimates in each period."""
    rng = np.random.default_rng(seed)
    inputs, out = ffi.new("ht_control_input *"), ffi.new("ht_compare *")
    for n in range(steps):
        inputs.i_A.p = rng.uniform(-8.0, 8.0, 6).tolist()
        inputs.vdc_V, inputs.torque_ref_Nm = rng.uniform(200.0, 300.0), rng.uniform(-10.0, 10.0)
        inputs.flux_ref_Wb, inputs.inv_flux_ref2 = 0.6, 1 / 0.36
        inputs.turn_rad = rng.uniform(-0.05, 0.05)
        lib.ht_control_step(cfg, state, inputs, n < 5, out)
        lib.ht_observer_adapt(
            ffi.addressof(cfg, "observer"), ffi.addressof(state, "observer"), 0.02
        )
        yield [
            bits(part)
            for part in (
                out[0], state.estimate, state.decided, state.observer, state.i_A, state.i_xy_A,
                state.psi_xy_Wb, state.v_xy_pu, state.flow, state.leg_loss.low_V,
            )
        ] + [state.sector, state.carry.legs, state.leg_loss.found]  # fmt: skip


@pytest.mark.parametrize("observer", CHOICES["observer"])
@pytest.mark.parametrize("scheme", CHOICES["scheme"])
def test_nothing_of_what_was_before_remains(scheme, observer):
    """A drive in memory that was never written does the same as one after another life, and as one
    in memory that was all zero."""
    controller = Controller("f28377s", {**VALUES, "scheme": scheme, "observer": observer})
    cfg = ffi.addressof(controller.drive.config, "control")
    zero, used = ffi.new("ht_control_state *"), ffi.new("ht_control_state *")
    never_written = unwritten("ht_control_state *")
    reset(cfg, used)
    for _ in lives(cfg, used, seed=1):
        pass
    if lib.ht_law_commands_voltage(cfg.law):
        assert lib.ht_control_lose(cfg, used, 0b100000, 0.1)
    states = (zero, never_written, used)
    for state in states:
        reset(cfg, state)
    for n, (a, b, c) in enumerate(zip(*(lives(cfg, state, 2) for state in states))):
        assert a == b == c, n


def test_a_machine_without_flux_and_all_legs_low():
    controller = Controller("f28377s", VALUES)
    cfg, state = controller.drive.config.control, unwritten("ht_control_state *")
    reset(ffi.addressof(cfg), state)
    for estimate in (state.estimate, state.decided):
        assert (estimate.psi_Wb.alpha, estimate.psi_Wb.beta, estimate.torque_Nm) == (0, 0, 0)
    for pair in (state.psi_xy_Wb, state.v_xy_pu):
        assert (pair.x, pair.y) == (0, 0)
    for pattern in (state.active, state.next):
        assert (list(pattern.s), list(pattern.t), pattern.before) == ([0] * 3, [0, 1, 1], 0)
        mean = pattern.mean_pu
        assert (mean.ab.alpha, mean.ab.beta, mean.xy.x, mean.xy.y) == (0, 0, 0, 0)
        assert (pattern.rising, pattern.falling, pattern.later, pattern.close) == (0, 0, 0, 0)
    assert (state.observer.omega_sync_rad_s, state.sector, state.carry.legs) == (0, 0, 0)
    assert (state.leg_loss.found, state.lost.axes) == (0, 0)


@pytest.mark.parametrize("part", ("leg_loss", "modulator", "xy", "deadbeat_law", "speed"))
def test_parts_begin_at_zero(part):
    state = unwritten(f"ht_{part}_state *")
    getattr(lib, f"ht_{part}_reset")(state)
    assert not any(numbers(state[0]))


def test_laws_begin_without_a_demand_and_with_empty_integrators():
    table, foc = unwritten("ht_table_law_state *"), unwritten("ht_foc_law_state *")
    lib.ht_table_law_reset(table)
    assert (table.torque_level, table.flux_level) == (0, 1)
    lib.ht_foc_law_reset(foc)
    assert not foc.begun
    for vector in (foc.along, foc.integral_A, foc.wanted_A):
        assert (vector.alpha, vector.beta) == (0, 0)
    for xy in (table.xy, foc.xy):
        assert not any(numbers(xy))
