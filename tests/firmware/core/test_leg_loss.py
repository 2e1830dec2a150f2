"""ht_leg_loss watches a circuit that is solved here in closed form: the six legs' voltages drive
the x-y currents through R and L_xy, each sampling period with constant voltage. What a leg makes
differs from its command by a voltage that is chosen. The firmware sees command and currents.
"""

import itertools

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque.firmware import ffi, lib
from hexatorque.plant.vsd import ANGLES_RAD, PHASES, TRANSFORM

R, L, TS, LEAST_V = 1.8, 0.01, 1e-4, 4.2
HOLD, WAIT = 10, 100
DECAY = np.exp(-R * TS / L)
XY = TRANSFORM[2:]
#: What the firmware's difference quotient makes of R i + L di/dt: 1 + R Ts/2L.
EXACT = 1 + 0.5 * R * TS / L
SUM_A = 0.6


class Watch:
    """The circuit and its watch."""

    def __init__(self, lxy_H=L, rs_ohm=R, omega_rad_s=0.0):
        self.cfg = ffi.new("ht_leg_loss_config *")
        self.cfg.least_V2 = LEAST_V**2
        self.cfg.gain = 0.05
        self.cfg.l_per_ts_ohm = lxy_H / TS
        self.cfg.sum_A = SUM_A
        self.cfg.hold, self.cfg.wait = HOLD, WAIT
        self.state = unwritten("ht_leg_loss_state *")
        lib.ht_leg_loss_reset(self.state)
        lib.ht_leg_loss_tolerate(self.state, rs_ohm, lxy_H, omega_rad_s)
        self.rs_ohm = rs_ohm
        self.i = np.zeros(2)
        self.seen = np.zeros(2)

    def step(self, command, error=0.0, others=None, without=None):
        """One period. command, error: six leg voltages. others: six phase currents that the
        sensors add, such as an error of theirs. without: the current in alpha-beta is such that
        this leg carries none."""
        made = XY @ (command + error)
        self.i = DECAY * self.i + (1 - DECAY) / R * made
        extra = np.zeros(6) if others is None else others
        seen = self.i + XY @ extra
        six = 3 * XY.T @ self.i + extra
        if without is not None:
            six -= 3 * six[without] * TRANSFORM[:2].T @ (3 * TRANSFORM[:2, without])
        pairs = [{"x": v[0], "y": v[1]} for v in (XY @ command, self.seen, seen)]
        lib.ht_leg_loss_step(self.cfg, self.state, *pairs, [{"p": list(six)}], self.rs_ohm)
        self.seen = seen
        return self.state.found

    @property
    def named(self):
        loss = lib.ht_leg_loss_of(self.state.found - 1)
        return PHASES[loss.leg], "lower" if loss.lower else "upper"


def commands(rng, amplitude=60.0):
    """Leg voltages of a drive: any, and different in each period."""
    return rng.uniform(-amplitude, amplitude, 6)


@pytest.mark.parametrize("switch", ("upper", "lower"))
@pytest.mark.parametrize("leg", range(6))
def test_the_direction_of_the_residual_names_leg_and_switch(leg, switch):
    rng = np.random.default_rng(leg)
    watch = Watch()
    for _ in range(300):
        assert watch.step(commands(rng)) == 0
    error = np.zeros(6)
    error[leg] = -60.0 if switch == "upper" else 60.0  # its terminal: too low, too high
    periods = 0
    while watch.step(commands(rng), error, without=leg) == 0:
        periods += 1
        assert periods < 60
    # A third of 60 V grows by 5 % of what is missing; 4.2 V take five periods.
    assert periods >= HOLD
    assert watch.named == (PHASES[leg], switch)


@pytest.mark.parametrize("volts", (-60.0, 60.0))
@pytest.mark.parametrize("leg", range(6))
def test_the_voltage_that_was_missing_is_added_up_from_its_first_period_on(leg, volts):
    """Also of the periods before the low pass was large: of five, it has forgotten a tenth."""
    watch = Watch()
    error = np.zeros(6)
    error[leg] = volts
    periods = 1
    while watch.step(np.zeros(6), error, without=leg) == 0:
        periods += 1
        assert periods < 60
    missing = periods * XY @ error
    added = [watch.state.sum_V.x, watch.state.sum_V.y]
    np.testing.assert_allclose(added, missing, atol=0.05 * np.hypot(*missing))


def steadily(watch, residual_V, six):
    """The residual points along x: to u1, whose lower switch seems not to conduct."""
    none, minus = {"x": 0.0, "y": 0.0}, {"x": -residual_V, "y": 0.0}
    for _ in range(100):
        lib.ht_leg_loss_step(watch.cfg, watch.state, minus, none, none, [{"p": list(six)}], R)
    return bool(watch.state.found)


@pytest.mark.parametrize("sign", (-1, 1))
def test_no_leg_is_named_that_carries_current(sign):
    """u1 carries a quarter of what the six carry together."""
    shape = sign * np.array([2, 2, -1, -1, -1, -1])
    assert not steadily(Watch(), 1.9 * LEAST_V, 0.5 * shape)
    assert steadily(Watch(), 1.9 * LEAST_V, 0.02 * shape)


def test_current_through_the_other_switch_says_nothing_against_a_residual_that_is_large():
    """Current into a leg flows through its lower switch, current out of it through the upper one.
    Wrong parameters would hardly make twice the residual that counts."""
    shape = 0.5 * np.array([2, 2, -1, -1, -1, -1])
    assert steadily(Watch(), 2.1 * LEAST_V, shape)
    assert not steadily(Watch(), 2.1 * LEAST_V, -shape)
    assert not steadily(Watch(), 5.0 * LEAST_V, -shape)


def test_without_a_leg_half_the_residual_counts_whatever_current_flows():
    """It has one direction then, which names no leg."""
    shape = 0.5 * np.array([2, 0, -1, -1, -1, 1])
    for times, without, found in ((0.9, 0, False), (0.45, 16, False), (0.6, 16, True)):
        watch = Watch()
        watch.state.without = without
        assert steadily(watch, times * LEAST_V, shape) == found
    assert not steadily(Watch(), 1.1 * LEAST_V, shape)


@pytest.mark.parametrize(
    ("currents", "dead"),
    (
        ([0.0, 0.1, 2, -1, -2, 0.9], 0x10), ([0.0, 2.9, 2, 0.1, -2, -3], 0x04),
        ([0.0, 0.7, 2, 1.3, -2, -2], 0), ([0.0, 2, 0, -1, 0, -1], 0),
    ),
)  # fmt: skip
def test_the_dead_leg_is_the_one_without_current(currents, dead):
    """u1 is lost already. A second leg is named only if the others carry more than three times its
    current. If it is of the same set, the third one has no return path: not to be told."""
    watch = Watch()
    watch.state.without = 0x20
    assert steadily(watch, LEAST_V, np.array(currents))
    assert lib.ht_leg_loss_dead(watch.state) == dead


@pytest.mark.parametrize(("lost", "loaded"), list(itertools.permutations(range(6), 2)))
def test_no_current_is_two_percent_of_all_six_legs(lost, loaded):
    """`loaded` and another leg of its set carry 1000 A each, so the limit is 40 A. The residual is
    not so large that current through the other switch would say nothing."""
    back = next(k for k in range(loaded % 2, 6, 2) if k not in (loaded, lost))
    none = {"x": 0.0, "y": 0.0}
    x, y = -1.9 * LEAST_V * 3 * XY[:, lost]
    for current_A, found in ((39.0, True), (43.0, False)):
        watch = Watch()
        six = np.zeros(6)
        six[loaded], six[back], six[lost] = 1000.0, -1000.0, current_A
        six[(lost + 2) % 6] -= current_A  # no sum of a set
        for _ in range(100):
            lib.ht_leg_loss_step(
                watch.cfg, watch.state, {"x": x, "y": y}, none, none, [{"p": list(six)}], R
            )
        assert bool(watch.state.found) == found
        assert not found or watch.named[0] == PHASES[lost]


@pytest.mark.parametrize("leg", range(6))
def test_a_small_sum_makes_a_larger_residual_necessary(leg):
    """Half of the sum from which a sensor is wrong: the residual must be 1.5 times as large. The
    current does not flow in u1, whose loss this residual means."""
    for sum_A, times, found in (
        (0.0, 1.1, True), (0.5 * SUM_A, 1.4, False), (0.5 * SUM_A, 1.6, True),
        (1.1 * SUM_A, 5, False),
    ):  # fmt: skip
        watch = Watch()
        none, minus = {"x": 0.0, "y": 0.0}, {"x": -times * LEAST_V, "y": 0.0}
        six = np.zeros(6)
        six[leg] = sum_A
        others = [k for k in range(2 - leg % 2, 6, 2) if k != leg]  # of its set, but not u1
        six[others] += 40.0 * np.array([1, -1] if len(others) == 2 else [0])
        for _ in range(300):
            lib.ht_leg_loss_step(watch.cfg, watch.state, minus, none, none, [{"p": list(six)}], R)
        assert bool(watch.state.found) == found, (sum_A, times)


def test_the_smallest_voltage_that_is_found():
    """Three times the least residual, as long as it drives no current: for a current, wrong
    parameters are tolerated."""
    for share, found in ((0.95, False), (1.05, True)):
        watch = Watch()
        error = np.zeros(6)
        error[3] = share * 3 * LEAST_V / EXACT
        for _ in range(300):
            watch.step(np.zeros(6), error)
            watch.i[:] = watch.seen[:] = 0.0
        assert bool(watch.state.found) == found


def test_a_short_disturbance_is_no_loss():
    """The residual must point the same way for HOLD periods after it has become large."""
    watch = Watch()
    error = np.zeros(6)
    error[2] = 60.0
    for _ in range(6):
        watch.step(np.zeros(6), error)
    for _ in range(300):
        assert watch.step(np.zeros(6)) == 0


def test_wrong_parameters_are_no_loss():
    """The fifth and the seventh harmonic flow in x-y. R and L_xy are wrong by 30 %."""
    for r_share, l_share in ((1.3, 1.3), (0.7, 0.7), (1.3, 0.7), (0.7, 1.3)):
        for order, omega in ((5, 30.0), (5, 190.0), (7, 100.0)):
            watch = Watch(l_share * L, r_share * R, omega_rad_s=omega)
            size_A = 5.0
            impedance = R + 1j * order * omega * L
            for k in range(4000):
                v = size_A * impedance * np.exp(1j * order * omega * TS * k)
                command = 3 * XY.T @ [v.real, v.imag]
                assert watch.step(command) == 0, (r_share, l_share, order, omega)


@pytest.mark.parametrize("omega", (0.0, 40.0, -300.0, 2000.0))
def test_what_is_tolerated_is_the_error_of_the_impedance_behind_the_filter(omega):
    """Both parameters wrong by the same share are an impedance wrong by this share. The filter of
    2 ms lets 1/|1 + j 6 omega tau| of the reactance's harmonic through."""
    watch = Watch(omega_rad_s=omega)
    reactance = 6 * omega * L / abs(1 + 6j * omega * 0.002)
    wanted = (0.3 * abs(R + 1j * reactance)) ** 2
    assert watch.state.tolerance_ohm2 == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("hertz", (1.0, 5.0, 30.0))
@pytest.mark.parametrize("leg", range(6))
def test_a_dead_sensor_is_no_loss(leg, hertz):
    """It reads 0 A. The legs do what they are told, and carry 10 A."""
    watch = Watch()
    angle = ANGLES_RAD[leg]
    for k in range(6000):
        phase = 2 * np.pi * hertz * TS * k
        wrong = np.zeros(6)
        wrong[leg] = -10.0 * np.cos(phase - angle)
        assert watch.step(np.zeros(6), others=wrong) == 0


def test_a_dead_sensor_does_make_a_residual():
    """Without its set's sum it would be taken for a loss: the test above can fail."""
    watch = Watch()
    watch.cfg.sum_A = 100.0
    for k in range(6000):
        wrong = np.zeros(6)
        wrong[0] = -10.0 * np.cos(2 * np.pi * 30.0 * TS * k)
        watch.step(np.zeros(6), others=wrong)
    assert watch.state.found


def test_what_is_not_finite_is_no_loss():
    """The over-current trip and the check of the estimates find it."""
    for value in (np.nan, np.inf):
        watch = Watch()
        for _ in range(2 * HOLD):
            with np.errstate(invalid="ignore"):
                assert watch.step(np.full(6, value)) == 0


def test_the_first_loss_counts():
    watch = Watch()
    for leg in (1, 4):
        error = np.zeros(6)
        error[leg] = 90.0
        for _ in range(200):
            watch.step(np.zeros(6), error, without=leg)
    assert watch.named == ("u2", "lower")


@pytest.mark.parametrize("lost", (0, 0b001000))
def test_while_a_leg_is_off_a_leg_that_carries_current_may_be_lost(lost):
    """The currents that remain are not those of a healthy machine, so they tell nothing."""
    watch = Watch()
    control, cfg = ffi.new("ht_control_state *"), ffi.new("ht_control_config *")
    lib.ht_control_reset(cfg, control, [{"p": [0.0] * 6}])
    if lost:
        assert lib.ht_control_lose(cfg, control, lost) == lost
    watch.state[0] = control.leg_loss
    rng = np.random.default_rng(1)
    error = np.zeros(6)
    error[0] = -5.5 * LEAST_V  # the residual is less than twice its limit
    found = [watch.step(commands(rng), error) for _ in range(200)]
    assert bool(found[-1]) == bool(lost)
