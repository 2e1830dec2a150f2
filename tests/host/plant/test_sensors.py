"""The result registers are compared with the sensors of a set-up: a converter of the stated
resolution over -full..full (currents) and 0..full (dc link), left-justified in 12 bits, and the
quadrature counter modulo 2^32. Register addresses and justification are from the manuals of both
devices.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from plant_calls import filter_currents, sample
from scipy.integrate import solve_ivp

from hexatorque import firmware, setups
from hexatorque.drive import parts
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.machines.induction import Parameters, make

DEVICES = {  # results, justification, position counter
    "f28335": (range(0x7108, 0x710F), 4, 0x6B00),
    "f28377s": ((0x0B00, 0x0B20, 0x0B01, 0x0B21, 0x0B02, 0x0B22, 0x0B03), 0, 0x5100),
}
FULL_A, FULL_V, PPR = 20.0, 500.0, 1500
#: The machine has leakage only, so currents are fluxes divided by 10 mH. This is exact enough.
MACHINE = make(Parameters(2, 1.0, 1.0, 10e-3, 10e-3, 1e-9, 10e-3, 1.0))
ANGLES = np.radians([0, 30, 120, 150, 240, 270])


class Bench:
    def __init__(self, device, **sensors):
        setup = setups.load("paper-b").changed(
            sensors__i_full_A=FULL_A, sensors__vdc_full_V=FULL_V, sensors__encoder_ppr=PPR,
            **{f"sensors__{k}": v for k, v in sensors.items()},
        )  # fmt: skip
        layout = getattr(firmware.lib, f"ht_{device}")
        board = SimpleNamespace(slow_channel=(6, 7))
        chip = SimpleNamespace(map=layout, port=SimpleNamespace(eqep=layout.eqep, board=board))
        self.sensors = parts.sensors(setup, chip, 1e-4)
        results, self.shift, self.qposcnt = DEVICES[device]
        self.results = list(results)

    def read(self, i_A=(0.0,) * 6, vdc=0.0, theta=0.0):
        """Counts of six currents and the dc link, as the driver takes them, and position."""
        regs = np.full(0x8000, 0xA5A5, np.uint16)
        regs[self.qposcnt + 0x16] = 0x25A5  # QCAPCTL: capture unit off
        rows = [f(n * ANGLES) for n in (1, 5) for f in (np.cos, np.sin)]
        y = np.zeros(8)
        y[:4] = 10e-3 * np.array(rows) @ i_A / 3
        y[7] = theta
        sample(self.sensors, MACHINE, y, vdc, regs)
        words = [int(w) for w in regs[self.results]]
        assert all(w % (1 << self.shift) == 0 for w in words)
        position = int(regs[self.qposcnt]) + 0x10000 * int(regs[self.qposcnt + 1])
        regs[self.results] = 0xA5A5
        regs[self.qposcnt : self.qposcnt + 2] = 0xA5A5
        regs[self.qposcnt + 0x16] += 0x8000
        assert np.all(regs == 0xA5A5)  # nothing else is touched
        return [w >> self.shift for w in words], position


@pytest.mark.parametrize(("device", "flag"), (("f28335", 0x7119), ("f28377s", 0x7403)))
def test_end_of_the_conversion_shows(device, flag):
    """ADCST.INT_SEQ1 or ADCINTFLG.ADCINT1 is set, and the other bits stay."""
    regs = np.zeros(0x8000, np.uint16)
    regs[flag] = 0x0008
    sample(Bench(device).sensors, MACHINE, np.zeros(8), 0.0, regs)
    assert regs[flag] == 0x0009


@pytest.fixture(params=DEVICES)
def device(request):
    return request.param


def balanced(u):
    """Six different phase currents with `u` in u1 and without zero sequence."""
    return np.array([u, 0.3 * u, -0.7 * u, 0.5 * u, -0.3 * u, -0.8 * u])


@pytest.mark.parametrize("bits", [12, 10, 8])
@pytest.mark.parametrize("u", [0.0, 0.001, 1.234, -7.77, 19.0])
def test_currents_are_read_to_the_nearest_step(device, bits, u):
    counts, _ = Bench(device, adc_bits=bits).read(balanced(u))
    step = 1 << (12 - bits)
    for i_A, got in zip(balanced(u), counts):
        exact = 2048 + i_A * 2048 / FULL_A
        assert got % step == 0
        assert abs(got - exact) <= step / 2 + 1e-3  # nearest step


def test_one_count_is_one_step_at_the_middle_between_two(device):
    lsb = FULL_A / 2048
    for counts in (0.49, -0.49, 0.51, -0.51, 1.49, 1.51):
        got, _ = Bench(device).read(balanced(counts * lsb))
        assert got[0] == 2048 + round(counts)


@pytest.mark.parametrize("bits", [12, 10, 6])
def test_currents_saturate_at_both_ends(device, bits):
    top = 4096 - (1 << (12 - bits))
    bench = Bench(device, adc_bits=bits)
    assert bench.read(balanced(FULL_A))[0][0] == top
    assert bench.read(balanced(-FULL_A))[0][0] == 0
    assert bench.read(balanced(1e4))[0] == [top, top, 0, top, 0, 0, 0]
    assert bench.read(balanced(-1e4))[0] == [0, 0, top, 0, top, top, 0]
    assert bench.read(vdc=1e5)[0][6] == top
    assert bench.read(vdc=-5.0)[0][6] == 0


def test_offset_and_gain_are_those_of_the_set_up(device):
    offset = (0.5, -0.25, 0.0, 1.0, -2.0, 0.1)
    counts, _ = Bench(device, i_offset_A=offset, i_gain=[1.1] * 6).read(balanced(5.0), vdc=250.0)
    for i_A, o, got in zip(balanced(5.0), offset, counts):
        assert abs(got - (2048 + (1.1 * i_A + o) * 2048 / FULL_A)) <= 0.501
    assert counts[6] == 2048  # the gain belongs to the current sensors only


def test_the_dc_link_is_read_to_the_nearest_step(device):
    bench = Bench(device)
    for vdc in (0.0, 0.05, 0.07, 123.4, 300.0, 499.8):
        assert bench.read(vdc=vdc)[0][6] == math.floor(vdc * 4096 / FULL_V + 0.5)
    assert Bench(device, adc_bits=10).read(vdc=300.0)[0][6] == 4 * math.floor(614.4 + 0.5)


def test_the_position_counter_counts_quarter_lines(device):
    bench, turn = Bench(device), 2 * math.pi
    per_rev = 4 * PPR
    for counts in (0, 1, 17, 65535, 65536, 1234567, -1, -2, -65536, -65537, -987654):
        for part in (0.001, 0.5, 0.999):
            theta = (counts + part) / per_rev * turn
            assert bench.read(theta=theta)[1] == counts % 2**32


def test_position_wraps(device):
    bench, turn = Bench(device), 2 * math.pi
    for counts in (2**31, 2**32 - 1, 2**32, 2**32 + 5, 3 * 2**32 + 7, -(2**32) - 3):
        assert bench.read(theta=(counts + 0.5) / (4 * PPR) * turn)[1] == counts % 2**32


def test_gain_of_each_phase(device):
    gain = [1.0, 1.1, 0.9, 1.2, 0.8, 1.05]
    exact, _ = Bench(device).read(balanced(5.0))
    counts, _ = Bench(device, i_gain=gain).read(balanced(5.0))
    expected = 2048 + (np.array(exact[:6]) - 2048) * gain
    assert np.abs(np.array(counts[:6]) - expected).max() <= 1.5


def test_noise_is_white_normal_and_seeded(device):
    """The noise has 20 counts rms. The test checks mean, spread, independence from sample to sample
    and between phases, and the share beyond two sigma. The tolerances are those of 4000 samples."""
    rms_A = 20 * 2 * FULL_A / 4096
    bench = Bench(device, i_noise_A=rms_A, noise_seed=7)
    draws = np.array([bench.read()[0][:6] for _ in range(4000)]) - 2048.0
    assert np.abs(draws.mean(axis=0)).max() < 5 * 20 / np.sqrt(4000)
    assert np.abs(draws.std(axis=0) / 20 - 1).max() < 0.06
    assert np.mean(np.abs(draws) > 40) == pytest.approx(0.0455, abs=0.008)
    correlation = np.corrcoef(np.hstack([draws[:-1], draws[1:]]).T) - np.eye(12)
    assert np.abs(correlation).max() < 0.08
    again = Bench(device, i_noise_A=rms_A, noise_seed=7)
    assert np.array_equal(draws[0] + 2048, again.read()[0][:6])
    other = Bench(device, i_noise_A=rms_A, noise_seed=8)
    assert not np.array_equal(draws[0] + 2048, other.read()[0][:6])


def state_of(i_A):
    rows = [f(n * ANGLES) for n in (1, 5) for f in (np.cos, np.sin)]
    y = np.zeros(8)
    y[:4] = 10e-3 * np.array(rows) @ i_A / 3
    return y


def test_filter_follows_straight_lines_exactly(device):
    """Currents change their slope every few microseconds and pass an RC filter, computed as a
    differential equation. The converter must read its output."""
    corner_Hz = 20e3
    bench = Bench(device, i_filter_Hz=corner_Hz)
    rng = np.random.default_rng(4)
    times = np.cumsum(rng.uniform(0.1e-6, 30e-6, 40))
    size = rng.normal(0, 5, 40)
    last, at, filtered = 0.0, 0.0, 0.0
    for t, u in zip(times, size):
        filter_currents(bench.sensors, MACHINE, state_of(balanced(u)), t - at)

        def slope(s, f, last=last, at=at, u=u, t=t):
            return 2 * np.pi * corner_Hz * (last + (u - last) * s / (t - at) - f)

        filtered = solve_ivp(slope, (0, t - at), [filtered], rtol=1e-9, atol=1e-9).y[0, -1]
        last, at = u, t
        np.testing.assert_allclose(bench.sensors.i_filtered_A, balanced(filtered), atol=1e-6)
    counts, _ = bench.read(balanced(last))
    exact = 2048 + balanced(filtered) * 2048 / FULL_A
    assert np.abs(np.array(counts[:6]) - exact).max() <= 0.51
    assert abs(filtered - last) > 0.1


def test_filtered_drive_lags_by_its_time_constant():
    """In the loop, the firmware's current lags the machine's by 1/(2 pi f_c), whatever the instant
    of the sample. Without a filter there is no lag."""
    setup = setups.load("paper-b").changed(timing__latency="predicted")
    lag_s = {}
    for corner_Hz in (0.0, 1500.0):
        sim = SimulatedDrive(setup.changed(sensors__i_filter_Hz=corner_Hz))
        sim.start()
        sim.run(0.4, record=False)
        sim.set("speed_ref_rpm", 1500)
        sim.run(0.4, record=False)
        sim.run(0.4)
        sim.check()
        rec = sim.take()
        sensed, true = rec["i_u1_A"][::4], rec["plant.i_u1_A"][::4]
        t = np.arange(len(true)) * sim.period_s
        window = np.hanning(len(t))
        spectrum = np.abs(np.fft.fft(true * window, 2**18))[: 2**17]
        w = 2 * np.pi * np.argmax(spectrum) / 2**18 / sim.period_s
        phasors = [np.sum(x * window * np.exp(-1j * w * t)) for x in (true, sensed)]
        lag_s[corner_Hz] = np.angle(phasors[0] / phasors[1]) / w
    assert abs(lag_s[0.0]) < 5e-6
    assert lag_s[1500.0] == pytest.approx(1 / (2 * np.pi * 1500), rel=0.05)


def test_a_frozen_sensor_keeps_its_register(device):
    """Only its own register is frozen. This holds for the six currents and the dc link."""
    for held in range(7):
        bench = Bench(device)
        bench.sensors.hold[held] = 1
        regs = np.zeros(0x8000, np.uint16)
        regs[bench.results] = 123 << bench.shift
        y = np.zeros(8)
        y[:4] = 10e-3 * 3.0
        sample(bench.sensors, MACHINE, y, 400.0, regs)
        same = [int(w) >> bench.shift == 123 for w in regs[bench.results]]
        assert same == [channel == held for channel in range(7)]


def test_a_frozen_encoder_continues_at_the_shafts_position(device):
    bench = Bench(device)
    count = 2 * np.pi / (4 * PPR)
    assert bench.read(theta=100.5 * count)[1] == 100
    bench.sensors.hold[7] = 1
    assert bench.read(theta=900.5 * count)[1] == 100
    bench.sensors.hold[7] = 0
    assert bench.read(theta=950.5 * count)[1] == 950
