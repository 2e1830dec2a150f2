"""The temperatures of the power stage's legs, against their equation."""

import numpy as np
import pytest

from hexatorque.firmware import Controller, ffi, lib

STAGE = {
    "device_K_W": 1.2, "device_s": 0.4, "device_ohm": 0.03, "device_nJ_VA": 180.0, "drop_V": 1.1,
}  # fmt: skip
VDC_V, F_HZ, SLOW_HZ = 300.0, 10e3, 100.0


@pytest.fixture
def make():
    kept = []

    def made(**values):
        kept.append(Controller("f28377s", STAGE | values))
        state = ffi.new("ht_device_heat_state *")
        lib.ht_device_heat_reset(state)
        return ffi.addressof(kept[-1].drive.config.device_heat), state

    return made


def loss_W(i_A):
    """Conduction, and one turn-on and turn-off in each period."""
    i_A = np.abs(i_A)
    return 1.1 * i_A + 0.03 * i_A**2 + 180e-9 * F_HZ * VDC_V * i_A


def run(one, currents_A, seconds, powered=True):
    squares = ffi.new("float[6]", [float(i) ** 2 for i in currents_A])
    for _ in range(round(seconds * SLOW_HZ)):
        lib.ht_device_heat_step(*one, squares, powered, VDC_V)
    return np.array(list(one[1].rise_K))


@pytest.mark.parametrize("seed", range(4))
def test_rises_are_those_of_the_equation(make, seed):
    rng = np.random.default_rng(seed)
    tau_s, r_K_W = rng.uniform(0.2, 5.0), rng.uniform(0.1, 3.0)
    one = make(device_s=tau_s, device_K_W=r_K_W)
    expected, t = np.zeros(6), 0.3
    for powered in (True, True, False, True):
        currents = rng.uniform(0, 30, 6)
        end = r_K_W * loss_W(currents) if powered else np.zeros(6)
        expected = end + (expected - end) * np.exp(-t / tau_s)
        found = run(one, currents, t, powered)
        # A slow interrupt's step of a first order lag: half of 10 ms over tau of the change.
        assert found == pytest.approx(expected, abs=0.03 * r_K_W * loss_W(30.0))
    lib.ht_device_heat_reset(one[1])
    assert not any(one[1].rise_K)


def test_the_worst_leg_at_standstill_counts(make):
    """A direct current of the amplitude in one leg, against the same current turning: its loss is
    up to twice the mean of a sine's, and the hottest leg is the one that has it."""
    amplitude = 20.0
    standing = [share * amplitude for share in (1.0, 0.87, 0.5, 0.0, 0.5, 0.87)]
    one, other = make(), make()
    stands = run(one, standing, 5.0)
    turns = run(other, [amplitude / np.sqrt(2)] * 6, 5.0)
    assert lib.ht_device_heat_degC(one[1], 50.0) == pytest.approx(50 + stands[0], abs=1e-3)
    assert stands.argmax() == 0 and stands[0] == pytest.approx(1.2 * loss_W(amplitude), rel=1e-3)
    angle = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    mean = 1.2 * np.mean(loss_W(amplitude * np.sin(angle)))
    assert mean < turns.max() < 1.12 * mean
    assert 1.35 < stands.max() / turns.max() < 2


def test_without_a_thermal_resistance_the_devices_are_as_warm_as_the_heat_sink(make):
    one = make(device_K_W=0.0)
    assert not run(one, [30.0] * 6, 1.0).any()
    assert lib.ht_device_heat_degC(one[1], 63.0) == 63.0
