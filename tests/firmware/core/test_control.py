"""ht_control: the result of a control step is the one that the papers define for its scheme.

State words are read back from the compare registers; directions, vectors and duties are recomputed
here from geometry. The latency is checked on a machine without resistance, whose flux is the sum of
the applied volt-seconds.
"""

import itertools

import numpy as np
import pytest
from campaigns import examples
from control_step import control_step
from hypothesis import given, settings
from hypothesis import strategies as st
from unwritten import unwritten

from hexatorque.firmware import ffi, lib

TS, VDC, PERIOD = 1e-4, 300.0, 10000
SCHEMES = {
    "dtc1": lib.HT_DTC1, "dtc2": lib.HT_DTC2, "dtc3": lib.HT_DTC3,
    "fdr": lib.HT_FDR, "ddr": lib.HT_DDR, "ddr-ml": lib.HT_DDR_ML,
}  # fmt: skip
TABLES = {lib.HT_TABLE_45_135: (45, 135), lib.HT_TABLE_75_105: (75, 105)}
THETA = np.deg2rad([0, 30, 120, 150, 240, 270])
T = np.array([np.cos(THETA), np.sin(THETA), np.cos(5 * THETA), np.sin(5 * THETA)]) / 3
L = (48, 56, 60, 28, 12, 14, 15, 7, 3, 35, 51, 49)
ML = (57, 52, 24, 44, 30, 13, 6, 11, 39, 19, 33, 50)
S = (54, 25, 36, 26, 45, 22, 9, 38, 27, 37, 18, 41)
ZEROS = (0, 21, 42, 63)


def vector(word):
    """alpha, beta, x, y in units of Vdc."""
    return T @ (word >> np.arange(5, -1, -1) & 1)


def config(scheme="ddr", **changes):
    cfg = ffi.new("ht_control_config *")
    lib.ht_control_select(cfg, SCHEMES[scheme])
    cfg.shadow, cfg.predict = True, True
    cfg.period.counts = PERIOD
    cfg.build_current_A = 3.0
    law = cfg.table_law
    law.table = lib.HT_TABLE_45_135
    law.hold_on_zero = True
    law.flux_band_Wb = 0.003
    law.torque_band_Nm, law.torque_inner_Nm = 0.3, 0.173
    law.xy.kp_pu_A, law.xy.ki_ts_pu_A = 0.1, 2.5e-4
    cfg.observer.ts_s, cfg.observer.inv_ts = TS, 1 / TS
    cfg.observer.rs_ohm = 6.0
    cfg.observer.sigma_ls_H, cfg.observer.inv_sigma_ls = 0.028, 1 / 0.028
    cfg.observer.lxy_H, cfg.observer.torque_gain = 0.0144, 3.0
    cfg.observer.omega_gain = 0.02
    cfg.dead.dead_pu, cfg.dead.i_zero_A = 0.02, 0.05
    for name, value in changes.items():
        owner = cfg
        *path, last = name.split("__")
        for part in path:
            owner = getattr(owner, part)
        setattr(owner, last, value)
    if "period__shortest" not in changes:
        cfg.period.shortest = shortest_of(cfg)
    return cfg


def shortest_of(cfg):
    """Counts of the dead time, or one: no gate pulse has a least length."""
    counts = cfg.dead.dead_pu * cfg.period.counts
    return max(1, int(np.ceil(counts - 0.01))) if 0 <= counts <= 32767 else 1


class Drive:
    """Control core with a state of its own; `step` returns the three words and
    the compare registers."""

    def __init__(self, cfg):
        self.cfg, self.state = cfg, unwritten("ht_control_state *")
        self.out = unwritten("ht_compare *")
        assert lib.ht_control_check(cfg) == lib.HT_CONFIG_OK
        lib.ht_control_reset(self.cfg, self.state, [{"p": [0.0] * 6}])

    def step(self, i=(0.0,) * 6, torque=0.0, flux=0.4, vdc=VDC, build=False):
        control_step(self.cfg, self.state, self.out, i, torque, flux, vdc, build)
        return words(self.out, self.cfg.period.counts)

    def place(self, psi, psi_xy=0j):
        """Set currents and an estimate so that the step decides at psi, psi_xy. The machine stands
        still: it has no torque, and no voltage is pending."""
        self.state.observer.psi_Wb = [psi.real, psi.imag]
        i_xy = psi_xy / self.cfg.observer.lxy_H
        return (3 * T.T @ [0, 0, i_xy.real, i_xy.imag]).tolist()


def words(out, period):
    s = [out.start]
    for compare in (out.ca, out.cb):
        toggles = sum(1 << (5 - leg) for leg in range(6) if compare[leg] != period)
        s.append(s[-1] ^ toggles)
    return tuple(s)


def shares(out, period):
    """Share of the period that each leg is high."""
    counts = np.arange(period)
    start = [out.start >> (5 - leg) & 1 for leg in range(6)]
    levels = [s ^ (counts >= a) ^ (counts >= b) for s, a, b in zip(start, out.ca, out.cb)]
    return np.mean(levels, axis=1)


def direction(table, sector, torque_up, flux_up):
    angle = TABLES[table][0 if flux_up else 1] * (1 if torque_up else -1)
    return (30 * sector + angle - 15) // 30 % 12


def keeps_guards(out, period, first):
    """Check that the registers keep the guards, and that the words have six bits."""
    if not 0 <= out.start <= 63:
        return False
    for leg in range(6):
        a, b = out.ca[leg], out.cb[leg]
        if not (first < a <= period and first < b <= period):
            return False
        if a < period and b < period and not a < b:
            return False
    return True


def is_valid(out, period, first):
    """The same, and that all legs switch at the table law's two instants."""
    if not keeps_guards(out, period, first):
        return False
    used = [{c for c in regs if c < period} for regs in (out.ca, out.cb)]
    return all(len(u) <= 1 for u in used)


def quiet(scheme, **changes):
    """A drive without latency and resistance. It decides on exactly the given state."""
    options = {"predict": False, "observer__rs_ohm": 0.0, "dead__dead_pu": 0.0}
    return Drive(config(scheme, **(options | changes)))


def all_choices():
    """Every table, sector, torque demand and flux demand."""
    return itertools.product(TABLES, range(12), (-5, 5), (0.2, 0.6))


def at(drive, sector, torque, flux, psi_xy=0j):
    """Step at |psi| = 0.4 in the middle of a sector; returns words and k."""
    psi = 0.4 * np.exp(1j * np.deg2rad(30 * sector))
    s = drive.step(drive.place(psi, psi_xy), torque, flux)
    st_ = drive.state
    assert st_.sector == sector
    assert st_.table_law.flux_level == (flux > 0.4)
    assert np.sign(st_.table_law.torque_level) == np.sign(torque)
    return s, direction(drive.cfg.table_law.table, sector, torque > 0, flux > 0.4)


def test_dtc1_applies_one_large_vector():
    for table, *demand in all_choices():
        s, k = at(quiet("dtc1", table_law__table=table), *demand)
        assert s == (L[k],) * 3


def xy_fluxes():
    """Twelve x-y fluxes. None of them is perpendicular to a large vector."""
    for degrees in range(7, 367, 30):
        yield 0.02 * np.exp(1j * np.deg2rad(degrees))


def test_dtc2_takes_the_vector_of_the_pair_that_lowers_the_xy_flux():
    for table, *demand in all_choices():
        for psi_xy in xy_fluxes():
            s, k = at(quiet("dtc2", table_law__table=table), *demand, psi_xy)
            assert s[0] == s[1] == s[2]
            assert s[0] in (L[k], ML[k])
            assert vector(s[0])[2:] @ [psi_xy.real, psi_xy.imag] < 0


def test_dtc3_levels_choose_the_pair():
    for table, sector, torque, flux in all_choices():
        for size, level, strong in ((0.2, 1, S), (5, 2, L)):
            for psi_xy in xy_fluxes():
                drive = quiet("dtc3", table_law__table=table)
                s, k = at(drive, sector, np.sign(torque) * size, flux, psi_xy)
                assert abs(drive.state.table_law.torque_level) == level
                assert s[0] == s[1] == s[2]
                assert s[0] in (ML[k], strong[k])
                assert vector(s[0])[2:] @ [psi_xy.real, psi_xy.imag] < 0


def test_fdr_applies_three_large_vectors_for_fixed_times():
    for table, *demand in all_choices():
        drive = quiet("fdr", table_law__table=table)
        s, k = at(drive, *demand, 0.02 + 0.01j)
        assert s == tuple(L[(k + d) % 12] for d in (-1, 0, 1))
        assert {c for c in drive.out.ca if c != PERIOD} == {round((2 - np.sqrt(3)) * PERIOD)}
        assert {c for c in drive.out.cb if c != PERIOD} == {round((np.sqrt(3) - 1) * PERIOD)}


@pytest.mark.parametrize(("scheme", "group"), (("ddr", L), ("ddr-ml", ML)))
def test_ddr_realises_its_xy_command(scheme, group):
    """The x-y current is opposed, within the limit, and the registers give the
    commanded x-y voltage to within the guards."""
    i_xy = 0.08 - 0.11j
    limit = 0.032692 if group is L else 0.089316
    wanted = np.clip([-0.2 * i_xy.real, -0.2 * i_xy.imag], -limit, limit)
    for table, *demand in all_choices():
        drive = quiet(scheme, table_law__table=table)
        s, k = at(drive, *demand, 0.0144 * i_xy)
        assert s == tuple(group[(k + d) % 12] for d in (-1, 0, 1))
        command = [drive.state.v_xy_pu.x, drive.state.v_xy_pu.y]
        np.testing.assert_allclose(command, wanted, atol=1e-5)
        t = [0, drive.state.next.t[1], drive.state.next.t[2], 1]
        mean = np.diff(t) @ np.array([vector(w) for w in s])
        np.testing.assert_allclose(mean[2:], command, atol=4 / PERIOD)


def xy_harmonics(scheme, emf, sense=1, periods=3000):
    """Fifth and seventh x-y harmonic, in units of Vdc, of what the table law applies while a flux
    of 200 Hz and the torque are to rise: no period has a zero vector. `emf`: what magnets induce of
    both then, which the law is told; None: an induction machine. Magnets turn in this sense. Also
    the words of the first period."""
    drive = config(scheme)  # it owns the memory of its part
    cfg = drive.table_law
    state = ffi.new("ht_table_law_state *")
    lib.ht_table_law_reset(state)
    decided, psi_xy, told = (ffi.new(f"ht_{n} *") for n in ("estimate", "xy", "induced"))
    command, s = ffi.new("ht_xy *"), ffi.new("uint16_t[3]")
    seen = ffi.new("ht_vector_law_input *")
    seen.decided, seen.psi_xy_Wb, seen.torque_ref_Nm, seen.flux_ref_Wb = decided, psi_xy, 5.0, 0.5
    step = 2 * np.pi * 200.0 * TS
    found, first = np.zeros(2, complex), []
    orders = np.array([5, -7])
    for n in range(periods):
        angle = 0.1 + n * step
        decided.psi_Wb = [0.4 * np.cos(angle), 0.4 * np.sin(angle)]
        seen.sector = lib.ht_sector(decided.psi_Wb)
        if emf is not None:
            e = sum(size * np.exp(1j * k * (angle + step / 2)) for k, size in zip(orders, emf))
            told.v_pu, told.omega_rad_s = [e.real, e.imag], sense * 2 * np.pi * 200.0
            seen.induced = told
        p = lib.ht_table_law_step(ffi.addressof(cfg), state, seen, command, s)
        seen.before = s[2]
        first = first or list(s)
        t = np.array([0, p.t1, p.t2, 1])[:, None]
        v = np.array([complex(*vector(w)[2:]) for w in s])[:, None]
        turned = np.exp(-1j * orders * (angle + step * t))
        found += (v * np.diff(turned, axis=0)).sum(axis=0) / (-1j * orders * step)
    return found / periods, first


@pytest.mark.parametrize("induced", [(0.1, -0.2), (-0.05, 0.02), (0.9, -0.9)])
def test_a_regulated_table_adds_what_is_induced_within_its_limit(induced):
    """Without a current in x-y there is nothing else."""
    drive = config("ddr")
    limit = drive.table_law.xy_limit_pu
    told = ffi.new("ht_induced *", {"v_pu": list(induced), "omega_rad_s": 100.0})
    decided = ffi.new("ht_estimate *", {"psi_Wb": [0.4, 0.0]})
    seen = ffi.new("ht_vector_law_input *", {
        "decided": decided, "psi_xy_Wb": ffi.new("ht_xy *"), "torque_ref_Nm": 5.0,
        "flux_ref_Wb": 0.5, "induced": told, "sector": lib.ht_sector([0.4, 0.0]),
    })  # fmt: skip
    state, command = ffi.new("ht_table_law_state *"), ffi.new("ht_xy *")
    lib.ht_table_law_reset(state)
    law = ffi.addressof(drive, "table_law")
    lib.ht_table_law_step(law, state, seen, command, ffi.new("uint16_t[3]"))
    assert [command.x, command.y] == pytest.approx(np.clip(induced, -limit, limit), abs=1e-6)


@pytest.mark.parametrize("scheme", ("ddr", "fdr"))
def test_with_magnets_the_order_of_a_virtual_vector_follows_the_rotation(scheme):
    """In x-y the vector before the middle one lies at -150 degrees from it, and the one behind at
    150: they drive a current to one side and take it back. In the frame of a harmonic, which turns
    by n w T_s in a period, the three do not add to 0. While the flux crosses a sector they stand
    still and the harmonic turns by n * 30 degrees, which leaves sin(n * 15)/(n * 15). The fifth is
    0.9 % of Vdc, half of what magnets with 4 % induce. The other order has the other side."""
    turns = 2 * np.pi * 200.0 * TS * np.array([5, -7])
    edges = np.exp(-1j * turns * np.array([[0], [2 - np.sqrt(3)], [np.sqrt(3) - 1], [1]]))
    three = np.exp(1j * np.deg2rad([[-150], [0], [150]])) * np.hypot(*vector(L[0])[2:])
    one, other = ((v * np.diff(edges, axis=0)).sum(axis=0) / turns for v in (three, three[::-1]))
    left = np.sinc(np.array([5, 7]) * 15 / 180)
    found, words_ = xy_harmonics(scheme, None)
    np.testing.assert_allclose(np.abs(found), np.abs(one * left), rtol=0.02)
    forwards, turned = xy_harmonics(scheme, (0.0, 0.0))
    if scheme == "fdr":  # regulates nothing in x-y: there the order counts for little
        assert turned == words_
        return
    np.testing.assert_allclose(np.abs(forwards), np.abs(other * left), rtol=0.05)
    assert turned == words_[::-1]
    for sense in (-1, 0, np.nan):
        assert xy_harmonics(scheme, (0.0, 0.0), sense, periods=1)[1] == words_


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_demand_for_no_torque_gives_the_nearest_zero_vector(scheme):
    for sector in range(12):
        drive = quiet(scheme)
        s, _ = at(drive, sector, 5, 0.6)
        zero = drive.step(torque=0.0)
        assert drive.state.table_law.torque_level == 0
        assert zero[0] == zero[1] == zero[2]
        assert zero[0] in ZEROS
        assert (zero[0] ^ s[2]).bit_count() == min((z ^ s[2]).bit_count() for z in ZEROS)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_v0_is_the_only_zero_vector_if_configured(scheme):
    others = 0
    for sector in range(12):
        drive = quiet(scheme, only_v0=True)
        s, _ = at(drive, sector, 5, 0.6)
        others += min((z ^ s[2]).bit_count() for z in ZEROS) < s[2].bit_count()
        assert drive.step(torque=0.0) == (0, 0, 0)
    assert others > 0  # the nearest one would be another


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("torque", (0.1, -0.1))  # inside the band, so no active vector is needed
def test_low_flux_replaces_a_zero_vector(scheme, torque):
    """Below (1 - flux_hold) of the reference the vector nearest to the flux is
    applied, on the side of the torque error."""
    group = {"ddr-ml": ML, "dtc3": S}.get(scheme, L)
    for sector in range(12):
        drive = quiet(scheme, table_law__flux_hold=0.05)
        placed = 0.37 * np.exp(1j * np.deg2rad(30 * sector))
        s = drive.step(drive.place(placed), torque, flux=0.4)
        assert drive.state.table_law.torque_level == 0
        k = sector if torque > 0 else (sector - 1) % 12
        assert s[1] in (group[k], ML[k])
        assert vector(s[1])[:2] @ [placed.real, placed.imag] > 0


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("torque", (0.1, -0.1))
@pytest.mark.parametrize(("flux_hold", "psi"), [(0.05, 0.39), (0.0, 0.1)])  # 0 = never
def test_flux_that_is_not_low_leaves_the_zero_vector(scheme, torque, flux_hold, psi):
    for sector in range(12):
        drive = quiet(scheme, table_law__flux_hold=flux_hold)
        placed = psi * np.exp(1j * np.deg2rad(30 * sector))
        assert drive.step(drive.place(placed), torque, flux=0.4)[0] in ZEROS
        assert drive.state.table_law.torque_level == 0


@pytest.mark.parametrize("hold", (True, False))
def test_xy_integrators_hold_during_zero_vectors_if_configured(hold):
    drive = quiet("ddr", table_law__hold_on_zero=hold)
    i_xy = drive.place(0.4 + 0j, 0.0144 * (0.05 + 0.02j))
    drive.step(i_xy, 5.0)
    used = bytes(ffi.buffer(ffi.addressof(drive.state.table_law.xy)))
    drive.step(i_xy, 0.0)
    assert drive.state.table_law.torque_level == 0
    assert (bytes(ffi.buffer(ffi.addressof(drive.state.table_law.xy))) == used) == hold


def test_xy_integrators_continue_while_the_flux_is_raised():
    drive = quiet("ddr", table_law__flux_hold=0.05)
    i_xy = drive.place(0.3 + 0j, 0.0144 * (0.05 + 0.02j))
    drive.step(i_xy, 0.0)
    assert drive.state.table_law.torque_level == 0
    assert drive.state.table_law.xy.against.x != 0


@pytest.mark.parametrize("levels", (2, 3, 5))
def test_the_torque_comparator_has_the_configured_number_of_levels(levels):
    drive = quiet("fdr", table_law__torque_levels=levels)
    seen = []
    for torque in (0.1, 0.2, 0.4, 0.2, 0.1, -0.1, -0.2, -0.4, 0.0):
        drive.step(drive.place(0.4 + 0j), torque)
        seen.append(drive.state.table_law.torque_level)
    want = {
        2: [0, 0, 1, 1, 1, 1, 1, -1, -1],
        3: [0, 0, 1, 1, 1, 0, 0, -1, 0],
        5: [0, 1, 2, 2, 1, 0, -1, -2, 0],
    }
    assert seen == want[levels]


def test_xy_regulator_turns_with_the_flux():
    """The integrators of the two frames after one step from zero."""
    for degrees in range(0, 360, 25):
        drive = quiet("ddr")
        turn = np.exp(1j * np.deg2rad(degrees))
        drive.step(drive.place(0.4 * turn, 0.0144 * (0.05 - 0.03j)), 5.0)
        xy = drive.state.table_law.xy
        error = -2.5e-4 * (0.05 - 0.03j)
        with_, against = (complex(p.x, p.y) for p in (getattr(xy, "with"), xy.against))
        assert with_ == pytest.approx(error / turn, abs=1e-8)
        assert against == pytest.approx(error * turn, abs=1e-8)


# --- latency ------------------------------------------------------------------


def flux_of(applied):
    """The volt-seconds of an `ht_applied` in units of the period, without dead time."""
    t = [0.0, applied.t[0], applied.t[1], applied.t[2], 1.0]
    states = [applied.before, *applied.s]
    if applied.s[0] == applied.s[1] == applied.s[2]:
        t[2:4] = 1.0, 1.0
    return np.diff(t) @ np.array([vector(w) for w in states])


def complex_flux(estimate):
    return complex(estimate.psi_Wb.alpha, estimate.psi_Wb.beta)


def patterns_of(drive, steps, **changes):
    """Run with changing references and currents; yields (state, words, applied
    pattern that this step committed)."""
    rng = np.random.default_rng(7)
    for _ in range(steps):
        s = drive.step(torque=rng.uniform(-2, 2), flux=0.4, i=drive.currents, **changes)
        yield s, drive.state.next if drive.cfg.shadow else drive.state.active


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("shadow", "first"), ((True, 0), (False, 0), (False, 1234)))
def test_flux_is_the_volt_seconds_of_the_pattern_on_the_legs(scheme, shadow, first):
    """A pattern counts in the period after its step under immediate load, one
    period later under shadow load."""
    cfg = config(
        scheme, shadow=shadow, predict=False, period__first=first,
        observer__rs_ohm=0.0, dead__dead_pu=0.0,
    )  # fmt: skip
    drive = Drive(cfg)
    drive.currents = (3 * T.T @ [1.0, 0.5, 0.05, -0.02]).tolist()
    psi, waiting, last = 0j, [np.zeros(4)] if shadow else [], 0
    for n, (s, applied) in enumerate(patterns_of(drive, 300)):
        assert complex_flux(drive.state.estimate) == pytest.approx(psi, abs=5e-6), n
        assert applied.before == last
        assert tuple(applied.s) == s
        assert applied.t[0] == pytest.approx(first / PERIOD)
        waiting.append(flux_of(applied))
        pu = waiting.pop(0)
        psi += TS * VDC * complex(pu[0], pu[1])
        last = s[2]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_prediction_is_the_next_estimate(scheme):
    """Without resistance and with steady currents the prediction must be exact. The comparators
    must see the flux of the next sample, with dead time. No delay continues into the next period:
    pulses are longer than the dead time."""
    drive = Drive(config(scheme, observer__rs_ohm=0.0, dead__dead_pu=0.05))
    drive.currents = (3 * T.T @ [2.0, 1.5, 0.6, 0.5]).tolist()  # x-y command at its limit
    expected, carried = None, 0
    for _ in patterns_of(drive, 400):
        state = drive.state
        if expected is not None:
            assert complex_flux(state.estimate) == pytest.approx(expected, abs=1e-6)
        expected = complex_flux(state.decided)
        carried |= state.carry.legs
        assert is_valid(drive.out, PERIOD, 0)
        angle = np.rad2deg(np.angle(expected))
        if abs((angle + 15) % 30) > 1e-3 and abs(expected) > 1e-6:
            assert state.sector == int((angle + 15) // 30) % 12
    assert not carried


@pytest.mark.parametrize("shadow", (True, False))
def test_dead_time_depends_on_the_current_at_each_edge(shadow):
    """There is one vector a period, so all edges are at its start. The signs of the currents change
    from sample to sample. A rising edge loses the dead time if the current flows out. A falling
    edge gains it if the current flows in."""
    cfg = config(
        "dtc1", shadow=shadow, predict=False, observer__rs_ohm=0.0, dead__dead_pu=0.05
    )  # fmt: skip
    drive = Drive(cfg)
    rng = np.random.default_rng(11)
    i_begin = rng.choice([-5.0, 5.0], 6)
    lib.ht_control_reset(cfg, drive.state, [{"p": i_begin.tolist()}])
    psi, last, waiting = 0j, np.zeros(6), [0, 0] if shadow else [0]
    for _ in range(300):
        i_end = rng.choice([-5.0, 5.0], 6)
        (word,) = set(drive.step(i_end, torque=rng.uniform(-2, 2)))
        waiting.append(word)
        level = waiting.pop(0) >> np.arange(5, -1, -1) & 1
        late = (level > last) & (i_begin > 0), (level < last) & (i_begin < 0)
        pu = T[:2] @ (level - 0.05 * (late[0].astype(float) - late[1]))
        psi += TS * VDC * complex(*pu)
        assert complex_flux(drive.state.estimate) == pytest.approx(psi, abs=1e-5)
        last, i_begin = level, i_end


@pytest.mark.parametrize("scheme", ("dtc2", "dtc3"))
def test_predicted_xy_flux_is_that_of_the_next_pattern(scheme):
    """This holds for the build-up's last virtual vector and for single vectors."""
    drive = Drive(config(scheme, dead__dead_pu=0.0))
    i = T.T @ [3.0, 1.5, 0.9, -0.6]
    steps = [drive.step(i, build=True) for _ in range(3)]
    assert len(set(steps[-1])) > 1
    for n in range(20):
        coming = drive.state.next
        t = [0, *list(coming.t)[1:], 1]
        mean = np.diff(t) @ np.array([vector(w)[2:] for w in coming.s])
        drive.step(i, torque=0.5 * (-1) ** n)
        i_xy = T[2:] @ i
        want = 0.0144 * i_xy + TS * (VDC * mean - 6.0 * i_xy)
        got = drive.state.psi_xy_Wb
        np.testing.assert_allclose([got.x, got.y], want, atol=1e-6)


@pytest.mark.parametrize("scheme", ("dtc2", "dtc3"))
def test_predicted_xy_flux_of_magnets_lacks_what_they_induce_in_the_middle(scheme):
    """Of the period that comes, whose begin the sample is."""
    omega = 900.0
    cfg = config(scheme, dead__dead_pu=0.0, special=True)
    cfg.observer.rotor = lib.HT_ROTOR_MAGNET
    m = cfg.observer.magnet
    m.psi_f_Wb, m.inv_psi_f, m.ld_H, m.lq_H, m.inv_ld = 0.2, 5.0, 0.028, 0.028, 1 / 0.028
    m.emf5_Wb, m.emf7_Wb = [0.03, 0.01], [0.0, -0.01]
    drive = Drive(cfg)
    i = T.T @ [3.0, 1.5, 0.9, -0.6]
    inputs = ffi.new(
        "ht_control_input *", {"vdc_V": VDC, "flux_ref_Wb": 0.2, "turn_rad": omega * TS}
    )
    inputs.inv_flux_ref2, inputs.i_A.p = 25.0, list(3 * i)
    for n in range(12):
        axis = np.exp(1j * (0.3 + n * omega * TS))
        inputs.axis, inputs.torque_ref_Nm = [axis.real, axis.imag], 0.5 * (-1) ** n
        drive.state.observer.omega_sync_rad_s = omega
        coming = drive.state.next
        t = [0, *list(coming.t)[1:], 1]
        mean = np.diff(t) @ np.array([vector(w)[2:] for w in coming.s])
        lib.ht_control_step(cfg, drive.state, inputs, False, drive.out)
        middle = axis * np.exp(0.5j * drive.state.observer.omega_sync_rad_s * TS)
        e = lib.ht_magnet_induced_V(ffi.addressof(m), [middle.real, middle.imag], omega)
        i_xy = 3 * T[2:] @ i
        want = 0.0144 * i_xy + TS * (VDC * mean - [e.x, e.y] - 6.0 * i_xy)
        got = drive.state.psi_xy_Wb
        np.testing.assert_allclose([got.x, got.y], want, atol=1e-5)


def test_without_prediction_the_decision_uses_the_estimate():
    drive = Drive(config("fdr", predict=False))
    drive.currents = [0.0] * 6
    for _ in patterns_of(drive, 50):
        assert complex_flux(drive.state.decided) == complex_flux(drive.state.estimate)


# --- build-up -------------------------------------------------------------------


def test_build_up_pulls_the_flux_along_15_degrees():
    drive = Drive(config("dtc1", observer__rs_ohm=0.0, dead__dead_pu=0.0))
    for _ in range(200):
        s = drive.step(build=True)
        assert s in ((L[11], L[0], L[1]), (0, 0, 0), (63, 63, 63), (21,) * 3, (42,) * 3)
    psi = complex_flux(drive.state.estimate)
    step = 0.59772 * VDC * TS
    assert 0.4 <= abs(psi) <= 0.4 + step
    assert np.rad2deg(np.angle(psi)) == pytest.approx(15, abs=0.1)
    assert s[0] in ZEROS


@pytest.mark.parametrize("only_v0", (False, True))
def test_build_up_ends_in_the_zero_vector_nearest_to_the_last_state(only_v0):
    """The legs switch from the state at the end of the virtual vector, not from its first one."""
    drive = Drive(config("dtc1", only_v0=only_v0))
    pulls = drive.step(build=True)
    assert pulls == (L[11], L[0], L[1])
    s = drive.step(build=True, flux=0.0)
    if only_v0:
        assert s == (0, 0, 0)
    else:
        (zero,) = set(s)
        assert zero == min(ZEROS, key=lambda z: (z ^ pulls[2]).bit_count())


def test_build_up_stops_at_the_current_limit():
    for size, blocked in ((2.9, False), (3.1, True)):
        drive = Drive(config("ddr"))
        i = 3 * T.T @ [size * np.cos(0.3), size * np.sin(0.3), 0, 0]
        s = drive.step(i, build=True)
        assert (s[0] in ZEROS) == blocked


# --- any input ------------------------------------------------------------------

wild = st.one_of(
    st.floats(width=32),
    st.floats(-20, 20, width=32),
    st.sampled_from([np.nan, np.inf, -np.inf, 3.4e38]),
)
sample = st.tuples(st.lists(wild, min_size=6, max_size=6), wild, wild, wild)


@given(
    st.sampled_from(list(SCHEMES)),
    st.sampled_from([(True, 0), (False, 0), (False, 4)]),
    st.booleans(),
    st.sampled_from([2, 3, 5]),
    st.sampled_from([(9, 0), (10, 0), (10000, 0), (65535, 0), (10000, 4999)]),
    st.lists(sample, min_size=1, max_size=5),
)
@settings(max_examples=examples(250), deadline=None)
def test_any_input_gives_a_pattern_that_the_pwm_can_realise(
    scheme, load, predict, levels, timing, samples
):
    shadow, first = load
    period, first = (timing[0], 0) if shadow else (timing[0], max(timing[1], first))
    first = min(first, (period - 1) // 2 - 1)
    cfg = config(
        scheme, shadow=shadow, predict=predict, table_law__torque_levels=levels,
        period__counts=period, period__first=first,
    )  # fmt: skip
    drive = Drive(cfg)
    for build in (False, True):
        for i, torque, flux, vdc in samples:
            inputs = ffi.new("ht_control_input *")
            inputs.i_A.p = i
            inputs.torque_ref_Nm, inputs.flux_ref_Wb, inputs.vdc_V = torque, flux, vdc
            inputs.inv_flux_ref2 = flux
            lib.ht_control_step(cfg, drive.state, inputs, build, drive.out)
            assert is_valid(drive.out, period, first)
            assert all(0 <= w <= 63 for w in words(drive.out, period))
            assert 0 <= drive.state.sector <= 11
            assert -2 <= drive.state.table_law.torque_level <= 2


@pytest.mark.parametrize("legs", [0b100000, 0b000110, 0b010101])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_any_scheme_gives_a_pattern_without_a_leg(scheme, legs):
    """Each leg has an instant of its own then."""
    drive = Drive(config(scheme))
    assert lib.ht_control_lose(drive.cfg, drive.state, legs, 0.0) & legs == legs
    for k in range(50):
        i = 3 * np.cos(THETA - 0.02 * k)
        drive.step(i, torque=0.5)
        assert keeps_guards(drive.out, PERIOD, 0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_without_a_leg_the_other_legs_make_the_voltage_of_the_table(scheme):
    """No vector of the table can be had without u1: each other leg switches once, at any instant.
    At rest, without resistance and current, what acts along u1 meets L_xy in series with sigma L_s
    (ht_lost_legs.h); beta is across. So the flux moves where the table wants it to, with the length
    of the table's voltage. Near the axis of u1 five legs cannot make all of that."""
    length = 0.43754 if scheme == "ddr-ml" else 0.5  # of a virtual vector, half the dc link
    for sector in range(12):
        drive = quiet(scheme)
        lib.ht_control_lose(drive.cfg, drive.state, 0b100000, 0.0)
        _, k = at(drive, sector, 5, 0.6)
        assert set(drive.out.cb) == {PERIOD}
        ca, start = np.array(list(drive.out.ca)), drive.out.start >> np.arange(5, -1, -1) & 1
        alpha, beta, x, _ = T @ np.where(start == 1, ca, PERIOD - ca) / PERIOD
        acts = complex((alpha - x) / (1 + 0.0144 / 0.028), beta)
        acts *= np.exp(-1j * np.deg2rad(30 * k + 15))
        if k in (11, 0, 5, 6):
            assert 0.39 < abs(acts) < length
            assert abs(acts.imag) < 0.02
        else:
            assert acts == pytest.approx(length, abs=1e-4)


@pytest.mark.parametrize(
    ("scheme", "torque", "group", "length"),
    [
        ("ddr", 5, L, 0.5),  # half the dc link
        ("dtc3", 5, L, 0.5),
        ("ddr-ml", 5, ML, 0.43754),  # of its virtual vectors
        ("dtc3", 0.2, S, np.hypot(*vector(S[0])[:2])),  # of its single vectors
        ("dtc3", -0.2, S, np.hypot(*vector(S[0])[:2])),
        ("dtc3", -5, L, 0.5),
    ],
)
def test_voltage_of_the_table_without_legs(scheme, torque, group, length):
    """It points where the table's vector points, with a length that depends on the group."""
    cfg = config(scheme)
    decided, none = ffi.new("ht_estimate *"), ffi.new("ht_xy *")
    for sector in range(12):
        law = ffi.new("ht_table_law_state *")
        lib.ht_table_law_reset(law)
        decided.psi_Wb.alpha = 0.4 * np.cos(np.deg2rad(30 * sector))
        decided.psi_Wb.beta = 0.4 * np.sin(np.deg2rad(30 * sector))
        seen = ffi.new("ht_vector_law_input *")
        seen.decided, seen.psi_xy_Wb, seen.sector = decided, none, sector
        seen.torque_ref_Nm, seen.flux_ref_Wb = torque, 0.6
        v = lib.ht_table_law_voltage(ffi.addressof(cfg, "table_law"), law, seen)
        along = vector(group[direction(cfg.table_law.table, sector, torque > 0, True)])[:2]
        wanted = along * length / np.hypot(*along)
        assert [v.ab.alpha, v.ab.beta] == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize("scheme", ["dtc1", "ddr"])
def test_without_a_leg_the_xy_flux_is_predicted_for_every_scheme(scheme):
    """Across the axis of u1, along y, the x-y current is free: L_xy i, and what a pattern and the
    resistance add, less than a quarter of it here."""
    drive = Drive(config(scheme))
    lib.ht_control_lose(drive.cfg, drive.state, 0b100000, 0.0)
    drive.step(3 * T.T @ [0, 0, 0, 2.0])
    assert drive.state.psi_xy_Wb.y == pytest.approx(2.0 * drive.cfg.observer.lxy_H, rel=0.25)


# --- configuration ----------------------------------------------------------------


def after_twenty_periods():
    drive = Drive(config("ddr"))
    for n in range(20):
        drive.step((0.05, -0.02, 0.01, 0.03, -0.04, 0.06), torque=(-1) ** n)
    law = drive.state.table_law
    assert law.torque_level != 0 and law.xy.against.x != 0
    return drive, bytes(ffi.buffer(drive.state))


def test_another_scheme_of_the_same_law_keeps_the_state():
    drive, before = after_twenty_periods()
    lib.ht_control_switch_over(config("ddr"), drive.cfg, drive.state)
    assert bytes(ffi.buffer(drive.state)) == before


def test_a_new_control_law_starts_from_its_reset_state():
    """The estimates of the machine and the next pattern do not belong to the law, so they stay."""
    drive, before = after_twenty_periods()
    state, other = drive.state, config("ddr")
    other.law = lib.HT_LAW_TABLE + 1
    lib.ht_control_switch_over(other, drive.cfg, state)
    law = state.table_law
    assert (law.torque_level, law.flux_level) == (0, 1)
    assert not any(bytes(ffi.buffer(ffi.addressof(law.xy))))
    begin = ffi.offsetof("ht_control_state", "table_law")
    assert bytes(ffi.buffer(state))[:begin] == before[:begin]


def test_low_pattern_has_no_edges():
    out = unwritten("ht_compare *")
    lib.ht_control_low_pattern(config(), out)
    assert out.start == 0
    assert [*out.ca, *out.cb] == [PERIOD] * 12


def test_six_currents_are_transformed_by_the_vsd_matrix():
    rng = np.random.default_rng(3)
    for six in rng.uniform(-30, 30, (50, 6)):
        v = lib.ht_vsd_from_six([{"p": six.tolist()}])
        np.testing.assert_allclose([v.ab.alpha, v.ab.beta, v.xy.x, v.xy.y], T @ six, atol=1e-5)


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, lib.HT_CONFIG_OK),
        ({"table_law__torque_levels": 4}, lib.HT_CONFIG_SCHEME),
        ({"table_law__torque_levels": 0}, lib.HT_CONFIG_SCHEME),
        ({"scheme_": lib.HT_SCHEMES}, lib.HT_CONFIG_SCHEME),
        ({"table_law__table": 2}, lib.HT_CONFIG_SCHEME),
        ({"period__counts": 7}, lib.HT_CONFIG_TIMING),
        ({"period__first": 1}, lib.HT_CONFIG_TIMING),
        ({"shadow": False, "period__first": 5000}, lib.HT_CONFIG_TIMING),
        ({"shadow": False, "period__first": 4999}, lib.HT_CONFIG_OK),
        ({"observer__ts_s": 0.0}, lib.HT_CONFIG_TIMING),
        ({"observer__ts_s": np.nan}, lib.HT_CONFIG_TIMING),
        ({"dead__dead_pu": -0.01}, lib.HT_CONFIG_TIMING),
        ({"dead__dead_pu": 0.51}, lib.HT_CONFIG_TIMING),
        ({"dead__dead_pu": np.nan}, lib.HT_CONFIG_TIMING),
        # Dead times of a period of 8 counts, whose shortest pulse may be 4: half of it, and more.
        ({"period__counts": 8, "period__shortest": 4, "dead__dead_pu": 0.5}, lib.HT_CONFIG_OK),
        ({"period__counts": 8, "period__shortest": 4, "dead__dead_pu": 0.51}, lib.HT_CONFIG_TIMING),
        ({"dead__i_zero_A": 0.0}, lib.HT_CONFIG_TIMING),
        ({"period__shortest": 0, "dead__dead_pu": 0.0}, lib.HT_CONFIG_TIMING),
        ({"period__shortest": 5001}, lib.HT_CONFIG_TIMING),
        ({"period__shortest": 5000}, lib.HT_CONFIG_OK),
        ({"period__shortest": 198}, lib.HT_CONFIG_TIMING),  # shorter than the dead time
        ({"shadow": False, "period__first": 1001, "period__shortest": 4500}, lib.HT_CONFIG_TIMING),
        ({"shadow": False, "period__first": 1000, "period__shortest": 4500}, lib.HT_CONFIG_OK),
        ({"table_law__xy_limit_pu": 0.0}, lib.HT_CONFIG_SCHEME),
        ({"table_law__xy_limit_pu": np.nan}, lib.HT_CONFIG_SCHEME),
        ({"table_law__xy_limit_pu": 1.0}, lib.HT_CONFIG_SCHEME),
        ({"table_law__xy_limit_pu": 1.0, "table_law__regulated": False}, lib.HT_CONFIG_OK),
        ({"table_law__group": 3}, lib.HT_CONFIG_SCHEME),
        ({"table_law__vectors": lib.HT_VECTORS_VIRTUAL + 1}, lib.HT_CONFIG_SCHEME),
        ({"table_law__group": 5}, lib.HT_CONFIG_SCHEME),
        ({"table_law__table": lib.HT_TABLE_60_120 + 1}, lib.HT_CONFIG_SCHEME),
        # The large vectors of sets that are not 30 degrees apart have a table of their own.
        ({"table_law__table": lib.HT_TABLE_60_120}, lib.HT_CONFIG_SCHEME),
        (
            {"table_law__table": lib.HT_TABLE_60_120, "table_law__group": lib.HT_L0},
            lib.HT_CONFIG_SCHEME,
        ),
        (
            {
                "table_law__table": lib.HT_TABLE_60_120,
                "table_law__group": lib.HT_L0,
                "table_law__vectors": lib.HT_VECTORS_SINGLE,
            },
            lib.HT_CONFIG_OK,
        ),
        ({"observer__winding": 3}, lib.HT_CONFIG_MACHINE),
        ({"observer__rotor_decay": -0.01}, lib.HT_CONFIG_MACHINE),
        ({"observer__rs_ohm": -1.0}, lib.HT_CONFIG_MACHINE),
        ({"observer__rs_ohm": np.nan}, lib.HT_CONFIG_MACHINE),
        ({"observer__sigma_ls_H": 0.0}, lib.HT_CONFIG_MACHINE),
        ({"observer__inv_sigma_ls": np.inf}, lib.HT_CONFIG_MACHINE),
        ({"observer__lxy_H": np.inf}, lib.HT_CONFIG_MACHINE),
        ({"observer__lxy_H": 0.0}, lib.HT_CONFIG_MACHINE),
        ({"observer__kind": 3}, lib.HT_CONFIG_MACHINE),
        ({"observer__rotor": lib.HT_ROTORS}, lib.HT_CONFIG_MACHINE),
        ({"observer__rotor_decay": np.nan}, lib.HT_CONFIG_MACHINE),
        ({"observer__rotor_decay": 0.5}, lib.HT_CONFIG_MACHINE),
        ({"observer__rotor_decay": 0.49}, lib.HT_CONFIG_OK),
    ],
)
def test_bad_configurations_are_refused_with_the_reason(changes, status):
    changes = dict(changes)
    scheme = changes.pop("scheme_", None)
    cfg = config(**changes)
    if scheme is not None:
        cfg.scheme = scheme
    assert lib.ht_control_check(cfg) == status


def foc(**changes):
    cfg = config()
    lib.ht_control_select(cfg, lib.HT_FOC)
    cfg.foc_law.alpha_ts, cfg.modulator.turn_pu = 0.3, 0.3
    for name, value in changes.items():
        owner, key = name.split("__")
        setattr(getattr(cfg, owner), key, value)
    return cfg


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, lib.HT_CONFIG_OK),
        ({"foc_law__alpha_ts": 0.6}, lib.HT_CONFIG_SCHEME),
        ({"modulator__turn_pu": np.nan}, lib.HT_CONFIG_SCHEME),
        # A sampling period of a fifth of the machine's shortest time constant.
        ({"observer__rs_ohm": 0.2 * 0.028 / TS}, lib.HT_CONFIG_SAMPLING),
    ],
)
def test_what_field_orientation_needs(changes, status):
    assert lib.ht_control_check(foc(**changes)) == status


def test_a_scheme_that_does_not_exist_selects_nothing():
    cfg = config("ddr")
    lib.ht_control_select(cfg, lib.HT_SCHEMES)
    assert cfg.table_law.regulated and cfg.table_law.vectors == lib.HT_VECTORS_VIRTUAL
    assert lib.ht_control_check(cfg) == lib.HT_CONFIG_SCHEME


def test_drops_of_the_devices_lower_the_estimated_flux():
    """Each leg loses the threshold against its current: all of it if the current is above i_zero, a
    proportional part below. The flux changes by that much less."""
    for i_u1 in (5.0, -5.0, 0.06, -0.06, 0.02, -0.02):
        i = np.array([i_u1, 0.0, -i_u1, 0.0, 0.0, 0.0])
        flux = []
        for drop_V in (0.0, 1.35):
            cfg = config(drop_V=drop_V, dead__dead_pu=0.0, observer__rs_ohm=0.0)
            drive = Drive(cfg)
            drive.step(i)
            before = complex_flux(drive.state.estimate)
            drive.step(i)
            flux.append(complex_flux(drive.state.estimate) - before)
        share = np.clip(i / 0.05, -1, 1)  # i_zero_A
        lost = 1.35 * T[:2] @ share * TS
        assert flux[0] - flux[1] == pytest.approx(lost[0] + 1j * lost[1], rel=2e-3)
        assert abs(flux[0] - flux[1]) > 0


def test_drops_act_on_the_predicted_xy_flux():
    i = np.array([5.0, 0.02, -5.0, 0.0, 0.0, -0.06])
    psi_xy = []
    for drop_V in (0.0, 1.35):
        drive = Drive(config("dtc2", drop_V=drop_V, dead__dead_pu=0.0))
        drive.step(i)
        psi_xy.append(complex(drive.state.psi_xy_Wb.x, drive.state.psi_xy_Wb.y))
    lost = 1.35 * T[2:] @ np.clip(i / 0.05, -1, 1) * TS
    assert psi_xy[0] - psi_xy[1] == pytest.approx(lost[0] + 1j * lost[1], rel=2e-3)


def test_drops_lower_whatever_voltage_acts():
    """Two drives, the second with drops, apply the same vectors to the same currents. In all four
    components they differ by the drops alone."""
    i = np.array([5.0, 0.02, -5.0, 0.0, 0.0, -0.06])
    drives = [Drive(config("dtc2", drop_V=v, dead__dead_pu=0.0)) for v in (0.0, 1.35)]
    flux, psi_xy = [], []
    for drive in drives:
        drive.state.observer.psi_Wb = [0.4, 0.0]
    for _ in range(5):
        free, lossy = (drive.step(i, torque=5.0) for drive in drives)
        assert free == lossy
        states = [drive.state for drive in drives]
        flux.append([complex_flux(state.estimate) for state in states])
        psi_xy.append([complex(state.psi_xy_Wb.x, state.psi_xy_Wb.y) for state in states])
    gains = np.diff(flux, axis=0)  # the first sample is left out: there was no current before it
    lost = 1.35 * T @ np.clip(i / 0.05, -1, 1) * TS  # i_zero_A
    for values, wanted in ((gains, lost[:2]), (np.array(psi_xy), lost[2:])):
        assert min(np.ptp(values[:, 0].real), np.ptp(values[:, 0].imag)) > 0.001  # vectors act
        difference = values[:, 0] - values[:, 1]
        np.testing.assert_allclose(difference.real, wanted[0], atol=2e-7)
        np.testing.assert_allclose(difference.imag, wanted[1], atol=2e-7)


def phases(alpha, beta, x, y):
    return 3 * T.T @ [alpha, beta, x, y]


@pytest.mark.parametrize("found", (0, 3))
@pytest.mark.parametrize("leg", range(6))
def test_a_loss_corrects_the_flux_by_the_voltage_that_was_missing(leg, found):
    """x-y shows this voltage until the loss is found, and it acted along the leg's axis. Where a
    leg is known to be lost from the start, none was missing."""
    drive = Drive(config())
    drive.state.observer.psi_Wb = [0.3, -0.2]
    drive.state.leg_loss.found = found
    drive.state.leg_loss.sum_V = [50.0, -30.0]
    assert lib.ht_control_lose(drive.cfg, drive.state, 32 >> leg, 0.0)
    a, b = 3 * T[:2, leg], 3 * T[2:, leg]
    missing_Wb = TS * (b @ [50.0, -30.0]) * a
    wanted = np.array([0.3, -0.2]) + (missing_Wb if found else 0.0)
    psi = drive.state.observer.psi_Wb
    np.testing.assert_allclose([psi.alpha, psi.beta], wanted, atol=1e-6)


def test_a_loss_of_a_set_corrects_the_flux_along_both_axes():
    drive = Drive(config())
    drive.state.observer.psi_Wb = [0.3, -0.2]
    drive.state.leg_loss.found = 3
    drive.state.leg_loss.sum_V = [50.0, -30.0]
    assert lib.ht_control_lose(drive.cfg, drive.state, 0b101010, 0.0)
    lost = drive.state.lost
    assert lost.axes == 2
    wanted = np.array([0.3, -0.2])
    for axis in lost.axis:
        missing = TS * np.dot([axis.b.x, axis.b.y], [50.0, -30.0])
        wanted += missing * np.array([axis.a.alpha, axis.a.beta])
        assert abs(missing) > 1e-4
    psi = drive.state.observer.psi_Wb
    np.testing.assert_allclose([psi.alpha, psi.beta], wanted, atol=1e-6)


def test_what_is_learnt_of_the_inductance_stays_without_a_leg_until_the_next_start():
    """The machine is the same."""
    drive = Drive(config())
    drive.state.leg_loss.more_ohm = 3.0
    assert lib.ht_control_lose(drive.cfg, drive.state, 0b010000, 0.0)
    assert drive.state.leg_loss.more_ohm == 3.0
    lib.ht_control_reset(drive.cfg, drive.state, [{"p": [0.0] * 6}])
    assert drive.state.leg_loss.more_ohm == 0.0


def test_legs_that_were_just_switched_off_are_no_other_loss():
    """Their diodes carry on what flowed. The check waits for as long as after a wrong sensor."""
    drive = Drive(config())
    drive.cfg.leg_loss.wait = 100
    assert lib.ht_control_lose(drive.cfg, drive.state, 0b010000, 0.0)
    assert drive.state.leg_loss.wait == 100


def test_without_a_leg_the_decision_counts_on_what_the_rotor_induces():
    """u2 is lost and no leg makes a voltage. The terminal of u2 follows the machine: along its axis
    this depends on the rotor's flux, here seen from the stator and in both components."""
    drive = Drive(config(observer__rs_ohm=0.5))
    assert lib.ht_control_lose(drive.cfg, drive.state, 0b010000, 0.0)
    drive.state.observer.psi_Wb = [0.3, 0.4]
    drive.state.observer.omega_sync_rad_s = 150.0
    a, b = 3 * T[:2, 1], 3 * T[2:, 1]
    i_ab = np.array([1.5, -2.0])
    i = phases(*i_ab, *(-(a @ i_ab) * b))
    assert i[1] == pytest.approx(0.0, abs=1e-9)
    drive.step(i)
    state, observer = drive.state, drive.cfg.observer
    psi = np.array([state.estimate.psi_Wb.alpha, state.estimate.psi_Wb.beta])
    rotor = psi - observer.sigma_ls_H * i_ab
    turn = TS * state.observer.omega_sync_rad_s
    none = {"ab": [0.0, 0.0], "xy": [0.0, 0.0]}
    rs_ohm = state.observer.rs_ohm
    lost, machine, watched = (
        ffi.addressof(owner, name)
        for owner, name in ((state, "lost"), (drive.cfg, "observer"), (state, "observer"))
    )
    v = lib.ht_lost_legs_expected(lost, machine, rs_ohm, none, list(i_ab), list(rotor), turn)
    wanted = lib.ht_observer_predict(machine, watched, state.estimate, v, list(i_ab))
    assert complex_flux(state.decided) == pytest.approx(complex_flux(wanted), abs=1e-7)
    assert np.hypot(v.alpha, v.beta) > 5.0


@pytest.mark.parametrize("scheme", ("dtc1", "ddr"))
def test_the_current_at_an_edge_lies_between_the_samples_in_their_order(scheme):
    """Currents around zero decide at each edge what the dead time does."""
    drive = Drive(config(scheme, dead__i_zero_A=0.3, observer__rs_ohm=0.0))
    dead = ffi.addressof(drive.cfg, "dead")
    rng = np.random.default_rng(3)
    right, turned = [], []
    before = np.zeros(6)
    for _ in range(100):
        state = ffi.new("ht_control_state *", drive.state[0])
        now = phases(*rng.uniform(-0.3, 0.3, 4))
        drive.step(now, torque=rng.uniform(-5, 5))
        begin, end = (ffi.new("ht_six *", {"p": list(six)}) for six in (before, now))
        flow = lib.ht_flow_at_edges(
            ffi.addressof(state, "active"), state.flow, lib.ht_flow_of(end, dead)
        )
        over = ffi.new("ht_carry *")
        for found, ends in ((right, (begin, end)), (turned, (end, begin))):
            v = lib.ht_volt_seconds(
                ffi.addressof(state, "active"), state.toggles, dead, flow, *ends,
                ffi.addressof(state, "carry"), over, False,
            )  # fmt: skip
            gained = complex_flux(drive.state.estimate) - complex_flux(state.estimate)
            found.append(abs(gained - TS * VDC * complex(v.ab.alpha, v.ab.beta)))
        before = now
    assert max(right) < 1e-6
    assert max(turned) > 1e-5


@pytest.mark.parametrize("sector", range(12))
def test_without_shadow_registers_a_rotor_is_aligned_by_the_vector_of_its_direction(sector):
    """Below the limit the period's mean voltage lies along it, above it there is none."""
    drive = Drive(config("dtc1", shadow=False, predict=False, dead__dead_pu=0.0))
    seen = ffi.new("ht_control_input *")
    seen.vdc_V = VDC
    for i_A, pulled in ((2.9, True), (3.1, False)):
        along = np.exp(1j * np.deg2rad(15 + 30 * sector))
        seen.i_A.p = (3 * T.T @ [i_A * along.real, i_A * along.imag, 0, 0]).tolist()
        lib.ht_control_align(drive.cfg, drive.state, seen, sector, drive.out)
        high = shares(drive.out, PERIOD)
        mean = complex(*(T @ high)[:2])
        if pulled:
            assert abs(mean) > 0.4 and abs(np.angle(mean / along)) < 1e-3
        else:
            assert np.abs(T @ high).max() < 1e-12


@pytest.mark.parametrize("missing", ["shadow", "predict"])
def test_legs_may_be_lost_where_the_law_looks_ahead(missing):
    cfg = config()
    assert lib.ht_control_can_lose(cfg)
    setattr(cfg, missing, False)
    assert not lib.ht_control_can_lose(cfg)


@pytest.mark.parametrize("displacement_deg", [0, 30, 60])
@pytest.mark.parametrize("degrees", [-15, *range(1, 45, 4), *range(45, 360, 31)])
def test_a_shaft_of_any_winding_is_caught_by_the_vector_nearest_to_its_flux_step(
    displacement_deg, degrees
):
    """There are twelve: with 0 and 60 degrees six, and the means of two beside each other. The step
    goes from the flux that is there to the reference, which lies in the same direction while the
    shaft stands."""
    cfg = config("dtc1", shadow=False, predict=False)
    if displacement_deg != 30:
        cfg.observer.winding, cfg.table_law.group = {
            0: (lib.HT_WINDING_0, lib.HT_L0), 60: (lib.HT_WINDING_60, lib.HT_L60),
        }[displacement_deg]  # fmt: skip
        cfg.table_law.table = lib.HT_TABLE_60_120
    drive = Drive(cfg)
    along = np.exp(1j * np.deg2rad(degrees))
    drive.state.observer.psi_Wb = [0.2 * along.real, 0.2 * along.imag]
    lib.ht_control_catch_begin(cfg, drive.state, [{"p": [0.0] * 6}])
    drive.state.observer.psi_Wb = [0.2 * along.real, 0.2 * along.imag]
    seen = ffi.new("ht_control_input *")
    seen.vdc_V, seen.flux_ref_Wb, seen.inv_flux_ref2 = VDC, 0.4, 1 / 0.16
    lib.ht_control_catch(cfg, drive.state, seen, drive.out)
    legs = np.deg2rad(
        np.array([0, 0, 120, 120, 240, 240]) + displacement_deg * np.array([0, 1] * 3)
    )
    mean = np.exp(1j * legs) @ shares(drive.out, PERIOD) / 3
    assert abs(mean) > 0.57
    assert abs(np.angle(mean / along, deg=True)) < 15.01
