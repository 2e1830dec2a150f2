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
SUM_A, ZERO_A = 0.6, 0.15
#: All legs are commanded high for this share of the period.
VDC_V, HIGH = 360.0, 0.25
#: Residual of a terminal that is at the wrong rail for a whole period.
SWING_V = VDC_V / 3


class Watch:
    """The circuit and its watch."""

    def __init__(self, lxy_H=L, rs_ohm=R, omega_rad_s=0.0):
        self.cfg = ffi.new("ht_leg_loss_config *")
        self.cfg.least_V2 = LEAST_V**2
        self.cfg.gain = 0.05
        self.cfg.l_per_ts_ohm = lxy_H / TS
        self.cfg.sum_A, self.cfg.zero_A = SUM_A, ZERO_A
        self.cfg.hold, self.cfg.wait = HOLD, WAIT
        self.state = unwritten("ht_leg_loss_state *")
        lib.ht_leg_loss_reset(self.state)
        lib.ht_leg_loss_tolerate(self.state, rs_ohm, lxy_H, omega_rad_s)
        self.applied = ffi.new("ht_applied *")
        self.applied.s = [63, 0, 0]
        self.applied.t = [0.0, HIGH, 1.0]
        self.period = ffi.new("ht_leg_loss_period *")
        self.period.applied, self.period.vdc_V = self.applied, VDC_V
        self.period.rs_ohm = rs_ohm
        self.six = [ffi.new("ht_six *"), ffi.new("ht_six *")]
        self.i = np.zeros(2)
        self.seen = np.zeros(2)

    def watch(self, command, begin, end, six):
        """One period: x-y voltage and currents, and the phase currents at its end."""
        self.six[0].p = self.six[1].p
        self.six[1].p = list(six)
        self.period.begin_A, self.period.end_A = self.six
        pairs = [{"x": v[0], "y": v[1]} for v in (command, begin, end)]
        lib.ht_leg_loss_step(self.cfg, self.state, self.period, *pairs)
        return self.state.found

    def step(self, command, error=0.0, others=None, without=None, flux_A=None):
        """One period. command, error: six leg voltages. others: six phase currents that the
        sensors add, such as an error of theirs. without: the current in alpha-beta is such that
        this leg carries none. flux_A: phase currents without any in x-y."""
        made = XY @ (command + error)
        self.i = DECAY * self.i + (1 - DECAY) / R * made
        extra = np.zeros(6) if others is None else others
        seen = self.i + XY @ extra
        six = 3 * XY.T @ self.i + extra + (0.0 if flux_A is None else flux_A)
        if without is not None:
            six -= 3 * six[without] * TRANSFORM[:2].T @ (3 * TRANSFORM[:2, without])
        before, self.seen = self.seen, seen
        return self.watch(XY @ command, before, seen, six)

    @property
    def named(self):
        loss = lib.ht_leg_loss_of(self.state.found)
        return PHASES[loss.leg], "lower" if loss.lower else "upper"


def commands(rng, amplitude=60.0):
    """Leg voltages of a drive: any, and different in each period."""
    return rng.uniform(-amplitude, amplitude, 6)


@pytest.mark.parametrize("switch", ("upper", "lower"))
@pytest.mark.parametrize("leg", range(6))
def test_leg_and_switch_are_named(leg, switch):
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


def steadily(watch, residual_V, six, periods=400, degrees=0.0):
    """The residual points to u1, whose lower switch seems not to conduct; or so many degrees on."""
    watch.six[1].p = list(six)
    angle = np.radians(degrees)
    command = [-residual_V * np.cos(angle), -residual_V * np.sin(angle)]
    for _ in range(periods):
        watch.watch(command, [0.0, 0.0], [0.0, 0.0], six)
    return bool(watch.state.found)


SHAPE = 0.5 * np.array([2, 2, -1, -1, -1, -1])


def test_no_leg_is_named_whose_current_does_not_fit():
    """Current out of u1 flows through its upper switch, so its lower one makes no residual then.
    Current into u1 would flow through the upper diode; or an arc takes a voltage from it."""
    diode_V = (1 - HIGH) * SWING_V
    for times in (1.1, 1.9, 3.0):
        assert not steadily(Watch(), times * LEAST_V, SHAPE)
    for share in (0.1, 0.45, 0.7, 1.0):
        assert steadily(Watch(), share * diode_V, -SHAPE), share
    assert steadily(Watch(), 1.9 * LEAST_V, 0.1 * SHAPE)  # no current


#: Directions of the legs' residuals in x-y, degrees, of a terminal that is too high.
AXES = np.degrees(np.arctan2(XY[1], XY[0]))


def apart(one, other):
    """Degrees between two directions."""
    return np.abs((one - other + 180) % 360 - 180)


def phases_of(degrees):
    """Phase currents whose vector in alpha-beta has this angle; 1 A at most."""
    return 3 * TRANSFORM[:2].T @ [np.cos(np.radians(degrees)), np.sin(np.radians(degrees))]


@pytest.mark.parametrize("flux", range(24))
def test_a_steady_residual_speaks_for_the_leg_whose_current_it_opposes_in_its_own_direction(flux):
    """Not more than half of what a diode would make. Only within 20 degrees of a leg's direction it
    is that leg's. Between two legs' directions it may be either's, so none is named; unless only
    the one has a current that it opposes."""
    six = phases_of(15 * flux + 7)
    assert np.min(np.abs(six)) > 0.5 * ZERO_A
    opposed = np.where(six > 0, AXES + 180, AXES)  # of the residual of an arc
    named = set()
    for degrees in np.arange(0.7, 360.0, 3.0):
        watch = Watch()
        if steadily(watch, 1.5 * LEAST_V, six, degrees=degrees):
            leg = PHASES.index(watch.named[0])
            off = apart(degrees, opposed)
            if abs(six[leg]) > ZERO_A:
                assert off[leg] < 20
                assert watch.named[1] == ("upper" if six[leg] > 0 else "lower")
            else:
                assert min(off[leg], 180 - off[leg]) < 20
            named.add(leg)
    assert named == set(range(6))


@pytest.mark.parametrize("arc_V", (15.0, 30.0, 60.0, 120.0, 350.0))
@pytest.mark.parametrize("leg", range(6))
def test_an_arc_of_any_voltage_names_its_own_leg(leg, arc_V):
    """It takes its voltage from the leg's current, whatever the leg is commanded. At some of the
    angles of the current in alpha-beta another leg has none, and its direction is 30 degrees
    away."""
    for degrees in np.arange(0.0, 360.0, 15.0) + 3.0:
        six = phases_of(degrees)
        if abs(six[leg]) < 2 * ZERO_A:
            continue
        watch = Watch()
        against = AXES[leg] + (180 if six[leg] > 0 else 0)
        assert steadily(watch, arc_V / 3, six, degrees=against)
        assert watch.named == (PHASES[leg], "upper" if six[leg] > 0 else "lower")


def expected_evidence(residual, low, begin, end, limit_V):
    """Of one period, [leg][upper, lower]: twice what the residual along the leg's axis has beyond
    half of what the diode makes; the residual itself without current; against the loss what is more
    than noise while the other switch conducts. If the low pass is within 20 degrees of the leg's
    axis, a residual against the current counts whole, as that of an arc; if it is not, a residual
    without current does not speak for the loss."""
    made = np.zeros((6, 2))
    towards = np.degrees(np.arctan2(low[1], low[0]))
    for leg, lower in itertools.product(range(6), range(2)):
        axis = 3 * XY[:, leg] * (1 if lower else -1)
        along = float(axis @ residual)
        off = apart(towards, AXES[leg] + (0 if lower else 180))
        through = [(-1 if lower else 1) * i for i in (begin[leg], end[leg])]
        diode = SWING_V * ((1 - HIGH) if lower else HIGH)
        if min(through) > ZERO_A:  # in the direction that the switch would carry
            made[leg, lower] = 2 * (min(along, diode) - diode / 2)
            if off < 20:
                made[leg, lower] = max(made[leg, lower], along)
        elif max(through) < -ZERO_A:
            made[leg, lower] = -max(abs(along) - 2 * limit_V, 0)
        elif min(off, 180 - off) < 20 or along < 0:
            made[leg, lower] = along
    return made


def test_evidence_adds_up_and_the_switch_with_clearly_the_most_is_named():
    rng = np.random.default_rng(7)
    named = 0
    for _ in range(60):
        watch = Watch()
        leg, upper = rng.integers(6), rng.integers(2)
        axis = 3 * XY[:, leg] * (-1 if upper else 1)
        six = rng.normal(0, 1.0, 6) * (rng.random(6) < 0.7)
        sums, mean2, low = np.zeros((6, 2)), 0.0, np.zeros(2)
        for _ in range(150):
            before = six
            six = rng.normal(0, 1.0, 6) * (rng.random(6) < 0.7)
            six[4:] = -six[0:2] - six[2:4]  # no sum of a set
            residual = rng.uniform(0, 60) * axis + rng.normal(0, 8, 2)
            watch.six[1].p = list(before)
            count = watch.state.count
            mean2 += 0.05 * (residual @ residual - mean2)
            low += 0.05 * (residual - low)
            found = watch.watch(-residual, [0, 0], [0, 0], six)
            if watch.state.count == 0:
                sums[:] = 0
                continue
            sums = np.maximum(sums + expected_evidence(residual, low, before, six, LEAST_V), 0)
            kept = [[e.upper_V, e.lower_V] for e in watch.state.leg]
            np.testing.assert_allclose(kept, sums, rtol=1e-3, atol=0.05)
            most = np.sort(sums.ravel())[::-1]
            clear = most[0] - most[1] - max(2.5 * HOLD * LEAST_V, 5 * np.sqrt(mean2))
            if abs(clear) > 0.5:
                assert bool(found) == (clear > 0 and count > HOLD)
            if found:
                assert found == 1 + np.argmax(sums.ravel())
                named += 1
                break
    assert named > 30


def test_without_a_leg_half_the_residual_counts_whatever_current_flows():
    """It has one direction then, which names no leg."""
    shape = 0.5 * np.array([2, 0, -1, -1, -1, 1])
    for times, without, found in ((0.9, 0, False), (0.45, 16, False), (0.6, 16, True)):
        watch = Watch()
        watch.state.without = without
        assert steadily(watch, times * LEAST_V, shape) == found
    assert not steadily(Watch(), 1.1 * LEAST_V, SHAPE)


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


@pytest.mark.parametrize("leg", range(6))
def test_the_least_current_counts_against_the_next(leg):
    """In whatever order the legs have more and more, or less and less."""
    for least_A, dead in ((0.2, 0x20 >> leg), (0.4, 0)):
        for sizes in ([1, 2, 3, 4, 5], [5, 4, 3, 2, 1], [2, 5, 1, 4, 3]):
            watch = Watch()
            for n, size in zip((n for n in range(6) if n != leg), sizes):
                watch.state.leg[n].sum_A = size
            watch.state.leg[leg].sum_A = least_A
            assert lib.ht_leg_loss_dead(watch.state) == dead


def test_a_switch_is_named_after_the_set_number_of_periods():
    """And one more, in which the judgement is made; there is far more than enough evidence."""
    rng = np.random.default_rng(7)
    watch = Watch()
    for _ in range(100):
        watch.step(commands(rng))
    error = np.array([-200.0, 0, 0, 0, 0, 0])
    large = 0
    while watch.step(commands(rng), error, without=0) == 0:
        large += watch.state.count != 0
    assert large == HOLD
    assert watch.named == ("u1", "upper")


@pytest.mark.parametrize("leg", range(1, 6))
def test_a_small_sum_makes_a_larger_residual_necessary(leg):
    """Half of the sum from which a sensor is wrong: the residual must be 1.5 times as large. The
    current does not flow in u1, whose loss this residual means."""
    for sum_A, times, found in (
        (0.0, 1.1, True), (0.5 * SUM_A, 1.4, False), (0.5 * SUM_A, 1.6, True),
        (1.1 * SUM_A, 5, False),
    ):  # fmt: skip
        watch = Watch()
        six = np.zeros(6)
        six[leg] = sum_A
        others = [k for k in range(2 - leg % 2, 6, 2) if k != leg]  # of its set, but not u1
        six[others] += 40.0 * np.array([1, -1] if len(others) == 2 else [0])
        assert steadily(watch, times * LEAST_V, six) == found, (sum_A, times)


@pytest.mark.parametrize("current_A", ([20.0, 0.0], [0.0, -20.0], [12.0, 16.0]))
@pytest.mark.parametrize(("times", "found"), ((0.95, False), (1.05, True)))
def test_current_in_x_and_y_raises_the_limit(current_A, times, found):
    """By what resistance that is wrong by 30 % makes of it, at standstill; squares are added."""
    watch = Watch()
    residual_V = times * np.hypot(LEAST_V, 0.3 * R * 20.0)
    for _ in range(600):
        v = R * np.array(current_A) - [residual_V, 0.0]
        watch.watch(v, current_A, current_A, np.zeros(6))
    assert bool(watch.state.found) == found


def test_evidence_is_gathered_until_the_residual_is_below_half_of_its_limit():
    watch = Watch()
    gathered = []
    for times in (0.95, 1.05, 0.55, 0.45, 0.55):
        steadily(watch, times * LEAST_V, SHAPE, periods=150)
        gathered.append(watch.state.count > 0)
    assert gathered == [False, True, True, False, False]


def test_a_residual_that_meets_legs_without_current_by_chance_names_none():
    """Of a machine whose L_xy is far from what the firmware believes: large in each period, in any
    direction, in proportion to the change of an x-y current that does not grow. The low pass is
    beyond its limit for much of the time."""
    rng = np.random.default_rng(3)
    watch, large, last = Watch(), 0, np.zeros(2)
    for _ in range(20_000):
        six = rng.normal(0, 2.0, 6)
        six[4:] = -six[0:2] - six[2:4]
        now = rng.normal(0, 100.0, 2)
        watch.watch(now - last, [0, 0], [0, 0], six)
        last = now
        large += watch.state.count > 0
    assert large > 5000 and watch.state.found == 0


def test_a_wrong_sensor_rules_a_loss_out_for_a_time():
    watch = Watch()
    wrong = np.array([0.0, 2 * SUM_A, 0.0, 0.0, 0.0, 0.0])
    assert not steadily(watch, 5 * LEAST_V, wrong, periods=30)
    assert not steadily(watch, 5 * LEAST_V, np.zeros(6), periods=WAIT)
    assert watch.state.wait == 0
    assert steadily(watch, 5 * LEAST_V, np.zeros(6), periods=WAIT)


def test_the_smallest_voltage_that_is_found():
    """Three times the least residual, as long as it drives no current: for a current, wrong
    parameters are tolerated."""
    for share, found in ((0.95, False), (1.05, True)):
        watch = Watch()
        error = np.zeros(6)
        error[3] = share * 3 * LEAST_V / EXACT
        for _ in range(500):
            watch.step(np.zeros(6), error)
            watch.i[:] = watch.seen[:] = 0.0
        assert bool(watch.state.found) == found


@pytest.mark.parametrize(
    ("share", "least_V", "may_be"),
    ((0.39, LEAST_V, False), (0.41, LEAST_V, True), (0.0, LEAST_V, False), (2.0, 0.0, False)),
)
@pytest.mark.parametrize("degrees", (0.0, 40.0, 170.0, 300.0))
def test_a_small_part_of_the_limit_may_be_an_arc(share, least_V, may_be, degrees):
    """Of the set-up of paper A an arc of 5 V makes 0.53 of the limit."""
    watch = Watch()
    watch.cfg.least_V2 = least_V**2
    watch.state.low_V.x = share * LEAST_V * np.cos(np.radians(degrees))
    watch.state.low_V.y = share * LEAST_V * np.sin(np.radians(degrees))
    assert lib.ht_leg_loss_maybe(watch.cfg, watch.state) == may_be


def test_a_short_disturbance_is_no_loss():
    """Evidence is gathered for HOLD periods at least."""
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


def with_a_dead_sensor(watch, leg, hertz):
    """It reads 0 A. The legs do what they are told, and carry 10 A."""
    for k in range(6000):
        flux_A = 10.0 * np.cos(2 * np.pi * hertz * TS * k - ANGLES_RAD)
        wrong = np.zeros(6)
        wrong[leg] = -flux_A[leg]
        watch.step(np.zeros(6), others=wrong, flux_A=flux_A)
    return bool(watch.state.found)


@pytest.mark.parametrize("hertz", (1.0, 5.0, 30.0))
@pytest.mark.parametrize("leg", range(6))
def test_a_dead_sensor_is_no_loss(leg, hertz):
    assert not with_a_dead_sensor(Watch(), leg, hertz)


def test_a_dead_sensor_does_make_a_residual():
    """Without its set's sum it would be taken for a loss: the test above can fail."""
    watch = Watch()
    watch.cfg.sum_A = 100.0
    assert with_a_dead_sensor(watch, 0, 30.0)


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
        assert lib.ht_control_lose(cfg, control, lost, 0.0) == lost
    watch.state[0] = control.leg_loss
    rng = np.random.default_rng(1)
    error = np.zeros(6)
    error[0] = -5.5 * LEAST_V  # the residual is less than twice its limit
    found = [watch.step(commands(rng), error) for _ in range(200)]
    assert bool(found[-1]) == bool(lost)


#: A period's change of the x-y current, A; the inductance of the parameter takes 100 V for 1 A.
CHANGE_A = 0.5


def changes(periods=200, leg=0):
    """Changes of the x-y current, most of them along one leg's direction."""
    rng = np.random.default_rng(leg)
    along = 3 * XY[:, leg]
    return CHANGE_A * (along + rng.normal(0, 0.3, (periods, 2)))


def changing(watch, all_A, share=1.0, across=0.0, more_V=(0.0, 0.0), learns=True, sum_A=0.0):
    """Periods with these changes, in a machine that has this share of the L_xy that the firmware
    believes. No leg carries current. across: a residual that the change does not explain, relative
    to the one that a wrong L_xy makes. sum_A: of each set, with another sign in each
    period. Returns the number of the period in which a leg is named."""
    for n, change_A in enumerate(all_A):
        l_ohm = L / TS
        turned = np.array([-change_A[1], change_A[0]]) * (1 if n % 2 else -1)
        v = share * l_ohm * change_A - (1 - share) * l_ohm * across * turned - np.array(more_V)
        if not learns:
            watch.state.learnt = True
        six = [sum_A if n % 2 else -sum_A] * 2 + [0.0] * 4
        if watch.watch(v, -change_A, [0.0, 0.0], six):
            return n
    return None


def believed(watch):
    """L_xy in units of the parameter's."""
    return 1 + watch.state.more_ohm / watch.cfg.l_per_ts_ohm


@pytest.mark.parametrize("share", (0.25, 0.6, 0.8, 1.3, 2.0, 4.1))
@pytest.mark.parametrize("leg", range(6))
def test_a_wrong_inductance_is_learnt_from_what_would_name_a_leg(leg, share):
    """Each residual is (L believed - L) di/dt: one L_xy explains all of them, whatever the
    directions. Without the learning a leg is named."""
    assert changing(Watch(), changes(leg=leg), share, learns=False) is not None
    watch = Watch()
    assert changing(watch, changes(leg=leg), share) is None
    assert believed(watch) == pytest.approx(share, rel=1e-4)
    assert watch.state.count == 0


@pytest.mark.parametrize("share", (0.23, 4.3))
def test_no_inductance_is_learnt_that_no_machine_has(share):
    """The parameter is at most 4.2 times the true one, or the true one 4.2 times the parameter."""
    watch = Watch()
    assert changing(watch, changes(), share) is not None
    assert believed(watch) == 1


@pytest.mark.parametrize(("explained", "learnt"), ((0.94, False), (0.96, True)))
@pytest.mark.parametrize("share", (0.5, 1.8))
def test_the_inductance_must_explain_95_percent_of_the_residual_squared(share, explained, learnt):
    """A part across the change leaves 1/(1 + part^2) of the square to the inductance."""
    watch = Watch()
    found = changing(watch, changes(30), share, across=np.sqrt(1 / explained - 1))
    assert (believed(watch) != 1) == learnt
    if learnt:  # the part across has no share in it
        assert believed(watch) == pytest.approx(share, rel=1e-3)
    else:
        assert found is not None


#: Of each sensor, A, r.m.s.
NOISE_A = 0.025


def noisy(watch, all_A, seed):
    """Changes of the x-y current in a sound machine, and sensors that add noise. Returns the share
    of the residual's square that is the noise's."""
    rng, error, share = np.random.default_rng(seed), np.zeros(6), watch.cfg.l_per_ts_ohm * TS / L
    wrong_V2 = noise_V2 = 0.0
    for change_A in all_A:
        was, error = error, rng.normal(0, NOISE_A, 6)
        wrong_V2 += np.sum(((share - 1) * change_A) ** 2)
        noise_V2 += np.sum((share * XY @ (error - was)) ** 2)
        seen = change_A + XY @ (error - was)
        assert not watch.watch(L / TS * change_A, np.zeros(2), seen, error)
    return noise_V2 / (noise_V2 + wrong_V2)


@pytest.mark.parametrize("share", (0.6, 0.7, 1.5))
@pytest.mark.parametrize("seed", range(10))
def test_noise_does_not_hide_that_an_inductance_explains_the_residual(seed, share):
    """Only the noise is in the sums of the sets, and these tell how large it is."""
    watch = Watch(share * L)
    part = noisy(watch, 0.55 * changes(200, leg=seed % 6), seed)
    assert part > 0.015
    assert believed(watch) * share == pytest.approx(1, abs=0.06)


@pytest.mark.parametrize(("explained", "learnt"), ((0.78, False), (0.83, True)))
def test_noise_makes_a_fifth_of_the_residual_squared_at_most(explained, learnt):
    """The sums show noise that would explain more. But a small arc is as large."""
    watch = Watch()
    changing(watch, 2 * changes(60), 0.5, np.sqrt(1 / explained - 1), sum_A=0.4)
    assert (believed(watch) != 1) == learnt


def test_what_is_learnt_is_the_least_squares_fit_of_the_periods_that_gathered_evidence():
    rng = np.random.default_rng(2)
    watch, seen = Watch(), []
    for change_A in changes(200, leg=3):
        v = 0.6 * L / TS * change_A + rng.normal(0, 3.0, 2)
        residual = L / TS * change_A - v
        assert not watch.watch(v, -change_A, [0.0, 0.0], np.zeros(6))
        if watch.state.more_ohm:
            seen.append((change_A, residual))
            break
        if watch.state.count:
            seen.append((change_A, residual))
    all_A, all_V = (np.concatenate(column) for column in zip(*seen))
    (slope,), *_ = np.linalg.lstsq(all_A[:, None], all_V, rcond=None)
    assert len(seen) > HOLD
    assert watch.state.more_ohm == pytest.approx(-slope, rel=1e-4)


def test_a_residual_that_stays_names_its_leg_although_something_was_learnt():
    """A lost leg may look like a wrong L_xy at first. Then the evidence is gathered once more."""
    watch, all_A = Watch(), changes(400)
    learnt = next(n for n, change in enumerate(all_A) if changing(watch, [change], 0.6) is None
                  and watch.state.learnt)  # fmt: skip
    l_ohm = watch.state.more_ohm
    more_V = 20 * 3 * XY[:, 0]
    again = changing(watch, all_A[learnt + 1 :], 0.6, more_V=more_V)
    assert HOLD <= again <= HOLD + 3
    assert watch.named == ("u1", "lower")
    assert watch.state.more_ohm == l_ohm


def test_it_is_learnt_again_after_the_residual_was_small():
    watch = Watch()
    for share in (0.6, 1.2, 0.5):
        assert changing(watch, changes(), share) is None
        assert believed(watch) == pytest.approx(share, rel=1e-4)
        assert not watch.state.learnt


@pytest.mark.parametrize("share", (0.45, 1.0, 2.2))
@pytest.mark.parametrize("switch", ("upper", "lower"))
@pytest.mark.parametrize("noise_A", (0.0, NOISE_A))
@pytest.mark.parametrize("leg", range(6))
def test_a_lost_leg_is_named_whatever_the_inductance_is_believed_to_be(leg, noise_A, switch, share):
    """A healthy machine whose vectors are large, then a loss. No L_xy explains a voltage that keeps
    to one direction while the current changes in all."""
    rng = np.random.default_rng(leg)
    watch = Watch(share * L)
    for _ in range(2000):
        assert watch.step(commands(rng, 100.0), others=rng.normal(0, noise_A, 6)) == 0
    error = np.zeros(6)
    error[leg] = -90.0 if switch == "upper" else 90.0
    for _ in range(100):
        noise = rng.normal(0, noise_A, 6)
        if watch.step(commands(rng, 100.0), error, noise, leg):
            break
    assert watch.named == (PHASES[leg], switch)


def test_without_a_leg_nothing_is_learnt():
    """One direction of the residual is all that is left: another leg is lost."""
    watch = Watch()
    watch.state.without = 32
    assert changing(watch, changes(), 0.6) is not None
    assert watch.state.more_ohm == 0


def learnt_slowly(share, amplitude=60.0, seconds=2.0, every=100, error=None, **state):
    """L_xy that is learnt over the true one, by a watch that takes `share` of the true one, from
    the periods of slow interrupts."""
    rng = np.random.default_rng(7)
    watch = Watch(lxy_H=share * L)
    for name, value in state.items():
        setattr(watch.state, name, value)
    for n in range(round(seconds / TS)):
        watch.step(commands(rng, amplitude), error)
        if n % every == 0:
            lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.05)
    return share + watch.state.more_ohm * TS / L


def no_error():
    return np.zeros(6)


@pytest.mark.parametrize("amplitude", (45.0, 200.0))
@pytest.mark.parametrize("share", (0.6, 0.8, 1.0, 1.2, 1.5))
def test_an_inductance_that_shows_all_the_time_is_learnt_in_the_slow_interrupt(share, amplitude):
    """x-y voltages of some 35 V, as a table without regulator makes them, at 10 A/ms; and such that
    30 % of L_xy makes a residual of 1.5 times the smallest limit."""
    found = learnt_slowly(share, amplitude, error=no_error())
    assert found == pytest.approx(EXACT, rel=0.03)


def test_where_the_xy_current_hardly_changes_nothing_is_learnt():
    """30 % of L_xy times this change is below the smallest limit."""
    assert learnt_slowly(1.3, 12.0, error=no_error()) == 1.3


def test_nothing_is_learnt_from_noise():
    """It would be a residual that shows, and an L_xy of next to nothing."""
    rng, watch = np.random.default_rng(3), Watch()
    noise_A = 1.3 * LEAST_V / (0.3 * L / TS) / np.sqrt(4 / 3)
    for n in range(20_000):
        watch.step(np.zeros(6), others=rng.normal(0, noise_A, 6))
        if n % 100 == 0:
            lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.05)
    assert watch.state.more_ohm == 0


@pytest.mark.parametrize(("part", "learns"), [(0.05, True), (0.3, False)])
def test_an_inductance_is_learnt_from_changes_that_are_louder_than_the_noise(part, learns):
    """part: of the square of the change, the noise's. So much too small would L_xy be learnt: the
    noise makes no voltage."""
    rng, watch = np.random.default_rng(4), Watch()
    change_A = 3.0 * LEAST_V / (0.3 * L / TS)
    noise_A = np.sqrt(part * change_A**2 * 3 / 4)
    noise = np.zeros(6)
    for n in range(40_000):
        before, noise = noise, rng.normal(0, noise_A, 6)
        angle = rng.uniform(0, 2 * np.pi)
        true = np.sqrt(1 - part) * change_A * np.array([np.cos(angle), np.sin(angle)])
        command = L / TS * true
        watch.watch(command, XY @ before, XY @ noise + true, noise)
        watch.state.count = 0  # no leg is suspected
        if n % 100 == 0:
            lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.05)
    assert (watch.state.more_ohm != 0) == learns
    assert 1 + watch.state.more_ohm * TS / L == pytest.approx(1 - part if learns else 1, abs=0.06)


@pytest.mark.parametrize("share", (0.2, 4.5))
def test_the_slow_interrupt_learns_no_inductance_that_no_machine_has(share):
    assert learnt_slowly(share, 200.0, error=no_error()) == share


def test_the_slow_interrupt_learns_nothing_without_a_leg():
    assert learnt_slowly(1.3, 200.0, error=no_error(), without=32) == 1.3


def test_while_a_leg_is_suspected_or_the_residual_is_unusual_the_slow_interrupt_learns_nothing():
    watch = Watch(lxy_H=1.3 * L)
    watch.state.now_V, watch.state.change_A = {"x": -3.0, "y": 0.0}, {"x": 1.0, "y": 0.0}
    watch.state.count = 1
    lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.5)
    assert watch.state.more_ohm == 0
    watch.state.count = 0
    lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.5)
    assert watch.state.more_ohm == pytest.approx(3.0)
    # Beyond the smallest limit and twice the usual residual.
    watch.state.now_V = {"x": -2.0 * 3.0 - LEAST_V, "y": 0.0}
    lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.5)
    assert watch.state.more_ohm == pytest.approx(3.0)


@pytest.mark.parametrize("bad", (np.nan, np.inf, -np.inf))
def test_the_slow_interrupt_learns_nothing_from_what_is_not_finite(bad):
    watch = Watch()
    watch.state.now_V, watch.state.change_A = {"x": bad, "y": 0.0}, {"x": 1.0, "y": 1.0}
    lib.ht_leg_loss_learn(watch.cfg, watch.state, watch.six[1], 0.5)
    assert watch.state.more_ohm == 0
