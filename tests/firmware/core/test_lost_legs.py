"""ht_lost_legs against a circuit that knows nothing of its axes: the six legs drive the currents of
alpha-beta through sigma L_s, against a rotor flux that turns, and those of x-y through L_xy. Each
phase has its resistance; that of set 2 may be larger. The terminal of a lost leg takes the voltage
that keeps its current at zero. Magnets may induce a fifth harmonic in x-y.
"""

import itertools

import numpy as np
import pytest
from unwritten import unwritten

from hexatorque.firmware import ffi, lib
from hexatorque.plant.machines import DISPLACEMENTS_DEG
from hexatorque.plant.vsd import ANGLES_RAD, PHASES, inverse, transform

R, SIGMA_L, L_XY, TS, VDC = 1.8, 0.025, 0.01, 1e-4, 250.0
OMEGA, ROTOR_WB = 190.0, 0.55
STEPS = 200
L = np.array([SIGMA_L, SIGMA_L, L_XY, L_XY])
#: Current of each phase from those of the planes, for sets 30 degrees apart.
PHASE = np.column_stack(
    [np.cos(ANGLES_RAD), np.sin(ANGLES_RAD), np.cos(5 * ANGLES_RAD), np.sin(5 * ANGLES_RAD)]
)
#: Resistance of set 2 less the mean of both sets.
DIFFERENCES = (0.0, 0.5, -0.4)
CARRIED = {30: (*PHASES, "u1+v2", "u2+w1", "w2+v1", "u1+w1+v1", "u2+w2+v2")}
CARRIED |= {deg: (*PHASES, "u1+w1+v1", "u2+w2+v2") for deg in (0, 60)}


def word(phases):
    return sum(32 >> PHASES.index(phase) for phase in phases)


def legs_of(mask):
    return [leg for leg in range(6) if mask & 32 >> leg]


#: Fifth harmonic that magnets induce in x-y.
HARMONICS_V = (0.0, 20.0)


class Circuit:
    def __init__(self, lost, seed=0, set2_ohm=0.0, displacement_deg=30, harmonic_V=0.0):
        self.harmonic_V = harmonic_V
        self.transform, self.phase = transform(displacement_deg), inverse(displacement_deg)
        self.phase_ohm = R + set2_ohm * np.array([-1, 1] * 3)
        self.lost = [PHASES.index(phase) for phase in lost]
        rng = np.random.default_rng(seed)
        free = self._free()
        self.i = free @ rng.uniform(-5, 5, free.shape[1])
        if set2_ohm:  # the law keeps the current that is left to choose at zero
            self.i -= self._across() * (self._across() @ self.i)
        self.angle = rng.uniform(0, 2 * np.pi)

    def _free(self):
        """The currents that the remaining phases can carry, as columns."""
        _, sizes, rows = np.linalg.svd(self.phase[self.lost])
        return rows[np.sum(sizes > 1e-9) :].T

    def _across(self):
        """The x-y current that one lost leg leaves to choose, as a unit vector."""
        if len(self.lost) > 1:
            return np.zeros(4)
        (leg,) = self.lost
        return np.array([0, 0, -self.phase[leg, 3], self.phase[leg, 2]])

    def harmonic(self, angle):
        five = 5 * angle + 0.7
        return self.harmonic_V * np.array([0, 0, np.cos(five), np.sin(five)])

    def coming(self):
        """The harmonic in the middle of the period that begins."""
        return self.harmonic(self.angle + 0.5 * OMEGA * TS)

    def rotor(self):
        return ROTOR_WB * np.array([np.cos(self.angle), np.sin(self.angle)])

    def _slope(self, i, angle, legs_V):
        induced = OMEGA * ROTOR_WB * np.array([-np.sin(angle), np.cos(angle), 0, 0])
        induced += self.harmonic(angle)
        drops = self.transform @ (self.phase_ohm * (self.phase @ i))
        rest = (self.transform @ legs_V - drops - induced) / L
        column = self.transform[:, self.lost] / L[:, None]
        # Only differences matter where a whole set is lost: the smallest solution.
        more = np.linalg.lstsq(
            self.phase[self.lost] @ column, -self.phase[self.lost] @ rest, rcond=None
        )[0]
        legs_V = legs_V.copy()
        legs_V[self.lost] += more
        across = self._across()
        v, extra = self.transform @ legs_V, drops - R * i
        return rest + column @ more, v - extra + across * (across @ extra)

    def period(self, legs_V):
        """Constant leg voltages for a period. Returns the mean voltages of the planes. What a phase
        drops more than R i is taken off: the firmware's R i is to be right for the rest. It
        does not do so for the x-y voltage that one lost leg leaves to choose."""
        dt = TS / STEPS
        mean = np.zeros(4)
        for _ in range(STEPS):
            half, _ = self._slope(self.i, self.angle, legs_V)
            slope, v = self._slope(self.i + 0.5 * dt * half, self.angle + 0.5 * dt * OMEGA, legs_V)
            self.i = self.i + dt * slope
            self.angle += dt * OMEGA
            mean += v / STEPS
        assert np.allclose(self.phase[self.lost] @ self.i, 0.0, atol=1e-9)
        return mean


class Legs:
    """The firmware's side."""

    def __init__(self, lost, set2_ohm=0.0, displacement_deg=30):
        self.lost = unwritten("ht_lost_legs *")
        winding = DISPLACEMENTS_DEG.index(displacement_deg)
        assert lib.ht_lost_legs_of(winding, word(lost), self.lost) == word(lost)
        if set2_ohm:
            lib.ht_lost_legs_differ(self.lost, set2_ohm)
        m = self.machine = ffi.new("ht_observer_config *")
        m.ts_s, m.inv_ts, m.rs_ohm = TS, 1 / TS, R
        m.sigma_ls_H, m.inv_sigma_ls, m.lxy_H = SIGMA_L, 1 / SIGMA_L, L_XY

    def voltage(self, v, begin, end):
        got = lib.ht_lost_legs_voltage(self.lost, self.machine, R, vsd(v), xy(begin), xy(end))
        return np.array([got.ab.alpha, got.ab.beta, got.xy.x, got.xy.y])

    def expected(self, v, i, rotor):
        got = lib.ht_lost_legs_expected(
            self.lost, self.machine, R, vsd(v), ab(i), ab(rotor), OMEGA * TS
        )
        return np.array([got.alpha, got.beta])

    def command(self, v_pu, i, rotor, harmonic_V=None):
        self.machine.rotor = int(harmonic_V is not None)  # HT_ROTOR_MAGNET
        seen = ffi.new("ht_voltage_law_input *")
        seen.psi_Wb, seen.rotor_Wb = ab(rotor + SIGMA_L * i[:2]), ab(rotor)
        seen.turn_rad, seen.rs_ohm, seen.vdc_V = OMEGA * TS, R, VDC
        if harmonic_V is not None:
            seen.emf_V = xy(harmonic_V)
        out = lib.ht_lost_legs_command(self.lost, self.machine, seen, vsd(v_pu))
        return np.array([out.ab.alpha, out.ab.beta, out.xy.x, out.xy.y])


def ab(v):
    return {"alpha": v[0], "beta": v[1]}


def xy(v):
    return {"x": v[2], "y": v[3]}


def vsd(v):
    return {"ab": ab(v), "xy": xy(v)}


differences = pytest.mark.parametrize("set2_ohm", DIFFERENCES)
harmonics = pytest.mark.parametrize("harmonic_V", HARMONICS_V)
lost_phases = pytest.mark.parametrize(
    ("displacement_deg", "lost"),
    [(deg, name.split("+")) for deg, names in CARRIED.items() for name in names],
)


@harmonics
@differences
@lost_phases
def test_the_voltage_that_acts_does_not_depend_on_the_lost_legs_command(
    displacement_deg, lost, set2_ohm, harmonic_V
):
    """It is the one whose flux follows with the mean resistance, as the observer has it. What
    magnets induce in x-y is subtracted from both."""
    legs = Legs(lost, set2_ohm, displacement_deg)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        circuit = Circuit(lost, seed, set2_ohm, displacement_deg, harmonic_V)
        command = rng.uniform(0, VDC, 6)
        begin, induced = circuit.i, circuit.coming()
        true = circuit.period(command) - induced
        for _ in range(3):
            command[circuit.lost] = rng.uniform(0, VDC)
            seen = legs.voltage(circuit.transform @ command - induced, begin, circuit.i)
            # What is left to choose is not zero at the end of the period.
            np.testing.assert_allclose(seen, true, atol=0.02 + 0.35 * abs(set2_ohm))


@harmonics
@differences
@lost_phases
def test_the_expected_voltage_comes_about(displacement_deg, lost, set2_ohm, harmonic_V):
    """Within what the currents change the drop, R Ts/sigma L_s of the voltage."""
    legs = Legs(lost, set2_ohm, displacement_deg)
    for seed in range(5):
        circuit = Circuit(lost, seed, set2_ohm, displacement_deg, harmonic_V)
        command = np.random.default_rng(seed).uniform(0, VDC, 6)
        acts = circuit.transform @ command - circuit.coming()
        expected = legs.expected(acts, circuit.i, circuit.rotor())
        true = circuit.period(command)[:2]
        np.testing.assert_allclose(expected, true, atol=0.01 * VDC)


@harmonics
@differences
@lost_phases
def test_the_remaining_legs_make_the_voltage_that_a_law_asks_for(
    displacement_deg, lost, set2_ohm, harmonic_V
):
    legs = Legs(lost, set2_ohm, displacement_deg)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        circuit = Circuit(lost, seed, set2_ohm, displacement_deg, harmonic_V)
        induced = OMEGA / VDC * np.array([[0, -1], [1, 0]]) @ circuit.rotor()
        asked = np.concatenate([induced + rng.uniform(-0.05, 0.05, 2), rng.uniform(-0.05, 0.05, 2)])
        harmonic = circuit.coming() if harmonic_V else None
        v_pu = legs.command(asked, circuit.i, circuit.rotor(), harmonic)
        made = VDC * circuit.phase @ v_pu
        true = circuit.period(made)
        np.testing.assert_allclose(true[:2] / VDC, asked[:2], atol=0.01)
        if len(lost) == 1:
            across = circuit._across()[2:]
            np.testing.assert_allclose(across @ v_pu[2:], across @ asked[2:], atol=1e-6)
        for leg in (0, 1):  # each set fits between the rails
            phases = made[leg::2] / VDC
            assert np.ptp(phases) <= 1.0


@pytest.mark.parametrize("phase", PHASES)
def test_the_other_legs_of_the_set_keep_the_terminal_between_the_rails(phase):
    """The diodes of a leg that is off conduct beyond the rails. With both other legs at the lower
    one, the terminal is the lost phase's voltage and half of it above; so they must be there
    while that is positive."""
    legs = Legs([phase])
    leg = PHASES.index(phase)
    others = [n for n in range(6) if n % 2 == leg % 2 and n != leg]
    for turn in np.arange(0, 2 * np.pi, 0.2):
        rotor = 0.4 * np.array([np.cos(turn), np.sin(turn)])
        asked = OMEGA / VDC * np.array([-rotor[1], rotor[0], 0, 0])
        v_pu = legs.command(asked, np.zeros(4), rotor)
        duty = PHASE @ v_pu
        centred = duty - 0.5 * (duty[leg % 2 :: 2].max() + duty[leg % 2 :: 2].min())
        up = PHASE[leg, :2] @ asked[:2]
        if abs(up) > 0.1:
            assert np.sign(up) * centred[others].min() < 0.0
            rail = centred[others].min() if up > 0 else -centred[others].max()
            assert rail == pytest.approx(-0.5, abs=0.01)


@pytest.mark.parametrize("phase", PHASES)
def test_a_law_that_asks_for_too_much_leaves_no_room_to_move_the_terminal(phase):
    """Across the lost phase the other two legs of its set are then farther apart than the rails.
    Moving both would only bend the voltage. Their sum is zero, and what is asked for across comes
    through whole, for the modulator to cut."""
    legs = Legs([phase])
    leg = PHASES.index(phase)
    across = np.array([-np.sin(ANGLES_RAD[leg]), np.cos(ANGLES_RAD[leg])])
    others = [n for n in range(6) if n % 2 == leg % 2 and n != leg]
    for size, moved in ((0.1, True), (2.0, False)):
        asked = np.concatenate([size * across, [0.0, 0.0]])
        v_pu = legs.command(asked, np.zeros(4), 0.3 * across)
        assert across @ v_pu[:2] == pytest.approx(size, rel=1e-5)
        assert (abs((PHASE @ v_pu)[others].sum()) > 1e-3) == moved


def largest_share(mask, phase=PHASE):
    """Amplitude in alpha-beta over that of the most loaded phase: by search over all currents
    that the remaining phases can carry with a turning current in alpha-beta."""
    lost = legs_of(mask)
    _, sizes, rows = np.linalg.svd(phase[lost])
    free = rows[np.sum(sizes > 1e-9) :].T
    if np.linalg.matrix_rank(free[:2], 1e-9) < 2:
        return 0.0
    # i = free z; alpha-beta: cos, sin. z = particular + null: what remains is searched.
    particular = np.linalg.pinv(free[:2])
    vt = np.linalg.svd(free[:2])[2]
    null = vt[2:].T
    best = 0.0
    grid = np.linspace(-1.2, 1.2, 121) if null.shape[1] else [0.0]
    for c, d in itertools.product(grid, grid):
        z = particular + (null @ [[c, d]] if null.shape[1] else 0.0)
        best = max(best, 1 / np.linalg.norm(phase @ free @ z, axis=1).max())
    return best


def test_the_leg_90_degrees_away():
    for leg, angle in enumerate(ANGLES_RAD):
        paired = legs_of(lib.ht_lost_legs_paired(lib.HT_WINDING_30, 32 >> leg))
        (other,) = set(paired) - {leg}
        assert abs(np.cos(angle - ANGLES_RAD[other])) < 1e-9
    assert [lib.ht_lost_legs_paired(lib.HT_WINDING_30, n) for n in (0, 33, 0x2A)] == [0, 33, 0x2A]


def test_which_losses_can_be_carried():
    """All 63: those of one leg, and of more where half of the rated current is left."""
    for mask in range(1, 64):
        lost = unwritten("ht_lost_legs *")
        off = lib.ht_lost_legs_of(lib.HT_WINDING_30, mask, lost)
        phases = legs_of(mask)
        alone = [s for s in (0, 1) if sum(leg % 2 == s for leg in phases) >= 2]
        closed = mask | sum(32 >> leg for leg in range(6) if leg % 2 in alone)
        share = largest_share(closed) if len(phases) > 1 else 0.577
        assert off == (closed if share > 0.4 else 0), (mask, share)
        assert lost.axes == (0 if off == 0 else 1 if len(phases) == 1 else 2)
    assert lib.ht_lost_legs_of(lib.HT_WINDING_30, 0, lost) == 0
    assert lib.ht_lost_legs_of(lib.HT_WINDING_30, 64, lost) == 0


@pytest.mark.parametrize("phases", (("u1", "u2"), ("u1", "w2"), ("v1", "v2")))
def test_two_legs_30_or_150_degrees_apart_leave_too_little(phases):
    assert largest_share(word(phases)) == pytest.approx(0.2887, rel=0.001)
    assert lib.ht_lost_legs_of(lib.HT_WINDING_30, word(phases), unwritten("ht_lost_legs *")) == 0


@pytest.mark.parametrize(
    ("phases", "share"), ((("v1",), 0.5774), (("u2", "w1"), 0.5774), (("u2", "w2", "v2"), 0.5))
)
def test_the_most_current_within_the_rated_one(phases, share):
    assert largest_share(word(phases)) == pytest.approx(share, rel=0.002)


@pytest.mark.parametrize("displacement_deg", [0, 60])
def test_windings_without_a_leg_90_degrees_away(displacement_deg):
    """One leg leaves half of the rated current, and so does a set. Two legs along one axis leave no
    turning current. Two others of different sets would leave half; the drive refuses them."""
    winding, phase = DISPLACEMENTS_DEG.index(displacement_deg), inverse(displacement_deg)
    lost = unwritten("ht_lost_legs *")
    for mask in (1, 2, 4, 8, 16, 32, 0x15, 0x2A):
        assert lib.ht_lost_legs_paired(winding, mask) == mask
        assert lib.ht_lost_legs_of(winding, mask, lost) == mask
        assert largest_share(mask, phase) == pytest.approx(0.5, rel=0.002)
        assert lib.ht_derated_A(lost, 1.0) == pytest.approx(0.5)
    for one, two in itertools.product((0, 2, 4), (1, 3, 5)):
        mask = 32 >> one | 32 >> two
        along = abs(np.dot(phase[one, :2], phase[two, :2])) > 0.99
        assert largest_share(mask, phase) == pytest.approx(0.0 if along else 0.5, abs=0.001)
        assert lib.ht_lost_legs_of(winding, mask, lost) == 0


@pytest.mark.parametrize("displacement_deg, phases", [(d, p) for d in CARRIED for p in CARRIED[d]])
def test_a_rotor_is_aligned_where_the_legs_force_the_least_current_on_xy(displacement_deg, phases):
    """Of the currents that the other legs can carry, the one with no more x-y current than it must
    have: by least squares, for each of twelve directions. The most loaded leg is known."""
    lost = unwritten("ht_lost_legs *")
    winding, phase = DISPLACEMENTS_DEG.index(displacement_deg), inverse(displacement_deg)
    legs = [PHASES.index(one) for one in phases.split("+")]
    lib.ht_lost_legs_of(winding, word(phases.split("+")), lost)
    first_deg = 15 if displacement_deg == 30 else 0
    forced = []
    for k in range(12):
        u = np.exp(1j * np.deg2rad(first_deg + 30 * k))
        i_ab = np.array([u.real, u.imag])
        i_xy = np.linalg.lstsq(phase[legs, 2:], -phase[legs, :2] @ i_ab, rcond=None)[0]
        currents = phase @ [*i_ab, *i_xy]
        assert np.abs(currents[legs]).max() < 1e-9
        forced.append(np.linalg.norm(i_xy))
        most_A = lib.ht_lost_legs_most_A(lost, ab(2.5 * i_ab))
        assert most_A == pytest.approx(2.5 * np.abs(currents).max(), rel=1e-5)
    best = lib.ht_lost_legs_aligning(lost)
    assert forced[best] == pytest.approx(min(forced), abs=1e-6)
    if len(legs) > 1:  # it is the same everywhere
        assert best == 0 and min(forced) == pytest.approx(max(forced))


def test_with_all_legs_a_rotor_is_aligned_in_direction_0():
    lost = unwritten("ht_lost_legs *")
    lib.ht_lost_legs_of(lib.HT_WINDING_30, 0, lost)
    assert lib.ht_lost_legs_aligning(lost) == 0
