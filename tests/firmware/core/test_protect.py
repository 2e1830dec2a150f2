"""ht_protect: the faults that turn the gates off. They are compared with steady states from the
machines' phasor equations, and with the documented bounds."""

import math
import tomllib
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from campaigns import examples
from hypothesis import given, settings
from hypothesis import strategies as st

import hexatorque
from hexatorque.firmware import FAULTS, PHASE_LOST, ffi, lib, parameters

SETUPS = Path(hexatorque.__file__).parent / "setups" / "builtin"
LOOKS = 50  # HT_STUCK_LOOKS
BIG = 1e9
NAN, INF = math.nan, math.inf


@lru_cache
def printed(setup):
    """(pole pairs, R_r, L_s, L_r, L_m), flux reference and load of a setup."""
    data = tomllib.loads((SETUPS / f"{setup}.toml").read_text())
    m = {key: entry["value"] for key, entry in data["machine"].items()}
    machine = (
        m["pole_pairs"],
        m["rr_ohm"],
        m["lls_H"] + m["lm_H"],
        m["llr_H"] + m["lm_H"],
        m["lm_H"],
    )
    return machine, data["controller"]["flux_ref_Wb"]["value"], data["point"]["load_Nm"]["value"]


#: Pole pairs, R_r, L_s, L_r, L_m of four machines: both papers', one with large leakage, and a
#: large one with small leakage.
MACHINES = [
    printed("paper-a")[0],
    printed("paper-b")[0],
    (4, 1.0, 0.120, 0.110, 0.090),
    (3, 0.02, 0.0300, 0.0302, 0.0295),
]


def sigma(machine):
    _, _, ls, lr, lm = machine
    return 1 - lm**2 / (ls * lr)


def pull_out(machine):
    """Slip, rad/s, of the largest torque at given stator flux."""
    _, rr, _, lr, _ = machine
    return rr / (sigma(machine) * lr)


def current(machine, slip, psi=1.0):
    """Stator current that belongs to a stator flux `psi`, from the equations of both
    windings in the flux's frame: psi = L_s i_s + L_m i_r, 0 = R_r i_r + j slip psi_r."""
    _, rr, ls, lr, lm = machine
    return np.linalg.solve([[ls, lm], [1j * slip * lm, rr + 1j * slip * lr]], [psi, 0])[0]


def at(slow_Hz):
    """What the check of the encoder knows of the slow interrupt."""
    return {"slow_Hz": slow_Hz, "slow_turns_s": 0.5 / np.pi / slow_Hz}


def config(machine=MACHINES[0], **changes):
    pole_pairs, rr, ls, lr, lm = machine
    values = {
        "i_trip_A": BIG, "i_ab_trip_A": BIG, "i_sum_trip_A": BIG, "vdc_min_V": 0.0,
        "vdc_max_V": BIG, "flux_trip_Wb": 1e5, "speed_trip_rpm": BIG, "encoder_trip_rpm": 0.0,
        "flux_check": 0.0, "stuck_counts": 0.0, "ls_H": ls, "sigma": sigma(machine),
        "no_load_A": 1.0,
        "slip_gain": rr * (lm / lr) ** 2, "rpm_per_rad_s": 30 / np.pi / pole_pairs,
        "flux_gain": 1.0, "encoder_gain": 1.0, "rotor_gain": 1.0,
    } | at(1000.0)  # fmt: skip
    return ffi.new("ht_protect_config *", values | changes)


def fresh():
    state = ffi.new("ht_protect_state *")
    state.circle2 = state.speed_error_rpm = state.flux_Wb.alpha = state.flux_Wb.beta = 99.0
    for leg in range(6):
        state.count[leg] = state.other[leg] = state.same[leg] = 99
    lib.ht_protect_reset(state)
    return state


def seen(psi, i, speed=0.0, rr_scale=1.0):
    """Control state after a step that estimated `psi` at a current `i`."""
    control = ffi.new("ht_control_state *")
    control.estimate.psi_Wb = [psi.real, psi.imag]
    control.observer.i_A = [i.real, i.imag]
    control.observer.omega_sync_rad_s, control.observer.rr_scale = speed, rr_scale
    return control


def slow(cfg, state, control, speed_rpm):
    return lib.ht_protect_slow(cfg, state, control, speed_rpm)


def turn(control, slow_Hz):
    """Flux and current until the next slow interrupt."""
    by = np.exp(1j * control.observer.omega_sync_rad_s / slow_Hz)
    for vector in (control.estimate.psi_Wb, control.observer.i_A):
        turned = by * (vector.alpha + 1j * vector.beta)
        vector.alpha, vector.beta = turned.real, turned.imag


def bit(fault):
    return getattr(lib, f"HT_FAULT_{fault}")


def test_reset_clears_everything():
    state = fresh()
    assert bytes(ffi.buffer(state)) == bytes(ffi.sizeof(state[0]))


def test_every_fault_is_a_bit_of_its_own_and_has_a_name():
    assert sorted(FAULTS) == [1 << k for k in range(len(FAULTS))]
    assert len(set(FAULTS.values())) == len(FAULTS)
    # The others are macros in C: an enumerator has 16 bits there.
    bits = [getattr(lib, name) for name in dir(lib) if name.startswith("HT_FAULT_")]
    assert sorted([*bits, PHASE_LOST]) == [1 << k for k in range(16)]


# --- flux against the circle diagram ---------------------------------------------------


def distance(machine, psi, i, state=None, cfg=None):
    """The distance that one check finds, in no-load currents of this flux."""
    state = state or fresh()
    cfg = cfg or config(machine, no_load_A=abs(psi) / machine[2])
    slow(cfg, state, seen(psi, i), 0.0)
    return math.sqrt(state.circle2)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("size", (0.05, 0.6, 3.0))
def test_every_steady_state_lies_on_the_circle(machine, size):
    for share in np.linspace(-1, 1, 41):
        for angle in (0.0, 0.7, -2.0):
            psi = size * np.exp(1j * angle)
            i = current(machine, share * pull_out(machine), psi)
            # At pull-out the circle is parallel to q, so rounding has the largest effect there.
            near = 2e-2 if abs(share) > 0.9 else 1e-4
            assert distance(machine, psi, i) < near / sigma(machine) / 10


@given(
    st.floats(0.02, 0.5), st.floats(0.02, 0.5), st.floats(0.1, 20), st.floats(-0.9, 0.9),
    st.floats(0.01, 5.0),
)  # fmt: skip
@settings(max_examples=examples(200), deadline=None)
def test_any_machine_lies_on_its_circle(leak_s, leak_r, rr, share, size):
    lm = 0.2
    machine = 1, rr, lm * (1 + leak_s), lm * (1 + leak_r), lm
    i = current(machine, share * pull_out(machine), size)
    assert distance(machine, size + 0j, i) < 2e-4 / sigma(machine)


def off_circle(machine, z):
    """The distance of z = (q, t), in no-load currents, from the machine's nearest steady state up
    to pull-out, by a search over the slip."""
    slips = pull_out(machine) * np.concatenate([-np.geomspace(1e3, 1e-6, 400), [0.0],
                                                np.geomspace(1e-6, 1e3, 400)])  # fmt: skip

    def apart(slip):
        return abs(z - machine[2] * current(machine, slip))

    for _ in range(6):
        best = int(np.argmin([apart(s) for s in slips]))
        slips = np.linspace(slips[max(best - 1, 0)], slips[min(best + 1, len(slips) - 1)], 41)
    return min(apart(s) for s in slips)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("wrong", (0.5, 0.7, 0.9, 1.2, 1.6, np.exp(0.3j), np.exp(-0.3j)))
@pytest.mark.parametrize("share", (-0.2, 0.0, 0.2))
def test_a_wrong_flux_is_at_its_distance_from_the_circle(machine, wrong, share):
    """The estimate is too small, too large or turned. The current is the same, but relative to the
    estimate."""
    psi = 0.4 * np.exp(0.5j)
    i = current(machine, share * pull_out(machine), psi)
    estimate = psi * wrong
    z = machine[2] * i / estimate
    assert distance(machine, estimate, i) == pytest.approx(
        off_circle(machine, z), rel=2e-3, abs=1e-4
    )
    # Without load the distance is along the axis: from the no-load point, unless the other end is
    # nearer.
    if share == 0 and not np.imag(wrong) and z.real < (1 + 1 / sigma(machine)) / 2:
        assert distance(machine, estimate, i) == pytest.approx(abs(1 / wrong - 1), rel=1e-4)


def test_a_current_beyond_pull_out_is_off_the_circle():
    """The current across the flux is larger than in any steady state, so it is above the circle."""
    machine = MACHINES[0]
    centre = (1 + 1 / sigma(machine)) / 2
    i = (3.0 + 2 * centre * 1j) * 0.4 / machine[2]
    expected = np.hypot(3 - centre, 2 * centre) - (centre - 1)
    assert distance(machine, 0.4 + 0j, i) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("rotor_rad_s", (-400.0, 400.0))
def test_a_flux_offset_gives_the_rms_of_its_current(machine, rotor_rad_s):
    """The estimate turns on its circle, and the machine's flux has an offset. The offset stands
    still, so its current is that of the machine at a slip of minus the rotor's speed. Relative to
    the turning flux this current turns, so its rms value is its magnitude / sqrt 2."""
    psi, offset = 0.5, 0.004 - 0.003j
    extra = current(machine, -rotor_rad_s, offset)
    cfg, state = config(machine, flux_gain=1e-3, no_load_A=psi / machine[2]), fresh()
    turns = psi * np.exp(2j * np.pi * np.arange(0, 400, 0.0391))
    for estimate in turns:
        slow(cfg, state, seen(estimate, estimate / machine[2] + extra), 0.0)
    want = machine[2] * abs(extra) / psi / math.sqrt(2)
    assert math.sqrt(state.circle2) == pytest.approx(want, rel=0.03)


def looks_until(fault, cfg, control, speed_rpm=0.0, most=2000):
    """The number of the first check, from 1, that reports `fault`. All later ones must report
    it."""
    state = fresh()
    reports = []
    for _ in range(most):
        reports.append(slow(cfg, state, control, speed_rpm))
        turn(control, cfg.slow_Hz)
    assert set(reports) <= {0, bit(fault)}
    if not any(reports):
        return None
    first = next(n for n, r in enumerate(reports, 1) if r)
    assert all(reports[first - 1 :])
    return first


@pytest.mark.parametrize(("gain", "wrong"), [(0.05, 0.5), (0.05, 0.55), (0.01, 0.4), (1.0, 0.5)])
def test_the_flux_check_trips_when_the_low_pass_reaches_the_threshold(gain, wrong):
    """There is no load, and the estimated flux is `wrong` times too large: d = 1/wrong - 1. Its
    mean square after n checks is d^2 (1 - (1 - gain)^n)."""
    machine, limit = MACHINES[0], 0.7
    d = 1 / wrong - 1
    n = np.arange(1, 2000)
    want = n[d**2 * (1 - (1 - gain) ** n) > limit**2][0]
    control = seen(0.6 * wrong + 0j, current(machine, 0.0, 0.6))
    unit = 0.6 * wrong / machine[2]
    cfg = config(machine, flux_check=limit, flux_gain=gain, no_load_A=unit)
    assert looks_until("FLUX", cfg, control) == want


@pytest.mark.parametrize("sign", (1, -1))
def test_flux_threshold_is_at_its_documented_value(sign):
    machine, limit = MACHINES[0], 0.45
    for near, found in ((0.999, None), (1.001, 1)):
        i = current(machine, 0.0, 0.6) * (1 + sign * near * limit)
        cfg = config(machine, flux_check=limit, no_load_A=0.6 / machine[2])
        assert looks_until("FLUX", cfg, seen(0.6 + 0j, i)) == found


def test_flux_limit_is_in_amperes():
    """The limit is in amperes: at half the flux the same distance in amperes trips."""
    machine = MACHINES[0]
    for size in (0.6, 0.3):
        i = current(machine, 0.0, size) + 0.5
        assert distance(machine, size + 0j, i, cfg=config(machine)) == pytest.approx(0.5, rel=1e-4)


def test_a_flux_check_of_zero_turns_the_check_off():
    machine = MACHINES[0]
    control = seen(0.6 + 0j, 5 * current(machine, 0.0, 0.6))
    assert looks_until("FLUX", config(machine, flux_check=1e-6), control) == 1
    assert looks_until("FLUX", config(machine, flux_check=0.0), control) is None


@pytest.mark.parametrize(("machine", "least"), [(MACHINES[0], 0.2), (MACHINES[3], 0.4)])
def test_a_rotor_flux_that_still_rises_is_no_wrong_flux(machine, least):
    """Direct current of 2.5 no-load currents builds the flux. Where the stator's flux has its
    reference, it stays there. The rotor's flux follows its own equation,
    dr/dt = (R_r/L_r)((1 - sigma) L_s i - r). Without this equation the same current would be a
    wrong flux."""
    _, rr, ls, lr, _ = machine
    psi_ref, slow_s = 0.6, 0.01
    rises = knows_rises(machine, slow_s)
    most = {}
    for name, changes in {"risen": rises, "not known": {"magnetise_A_Wb": 0.0}}.items():
        cfg = config(machine, no_load_A=psi_ref / ls, flux_gain=slow_s / 0.2, **changes)
        state, r, most[name], build = fresh(), 0.0, 0.0, True
        for _ in range(300):
            for _ in range(100):
                i = 2.5 * psi_ref / ls if build else (psi_ref - r) / (sigma(machine) * ls)
                r += slow_s / 100 * rr / lr * ((1 - sigma(machine)) * ls * i - r)
                psi = r + sigma(machine) * ls * i
                build = build and psi < psi_ref
            control = seen(psi + 0j, i + 0j)
            if build:
                lib.ht_protect_follow(cfg, state, control)
            else:
                slow(cfg, state, control, 0.0)
            most[name] = max(most[name], math.sqrt(state.circle2))
    assert r == pytest.approx((1 - sigma(machine)) * psi_ref, rel=0.01)
    assert most["risen"] < 0.1
    assert most["not known"] > least


def knows_rises(machine, slow_s):
    """The gains that the drive has (ht_configure.c): a low pass of L_r/R_r/30, and the current by
    which the rotor flux changes, dr/dt = R_r (L_m/L_r)^2 (i - r/((1 - sigma) L_s))."""
    _, rr, ls, lr, _ = machine
    return {
        "rotor_gain": 1 / (1 + lr / (30 * rr * slow_s)),
        "magnetise_A_Wb": 30 / ((1 - sigma(machine)) * ls),
    }


def off_while_the_flux_moves(machine, wrong=1.0, slow_s=0.01):
    """The least and the largest rms distance that the check finds, and the largest current that
    the change takes, in no-load currents. The stator flux falls to 55 % and rises again, in a fifth
    of the rotor's time constant each, under a torque that swings. The rotor flux r follows
    d|r|/dt = ((1 - sigma) L_s i - |r|) R_r/L_r, i along r, integrated with small steps. The
    estimate is 1/`wrong` of the stator flux."""
    _, rr, ls, lr, _ = machine
    s, tau, steps = sigma(machine), lr / rr, 50
    ramp_s, flux_gain = max(0.2 * tau, 3 * slow_s), 1 / (1 + 0.2 / slow_s)
    cfg = config(
        machine, no_load_A=0.6 / wrong / ls, flux_gain=flux_gain, **knows_rises(machine, slow_s)
    )
    state, r = fresh(), (1 - s) * 0.6
    state.rotor_Wb, state.i_A.alpha = 0.6 / wrong - s * 0.6, 0.6 / ls
    found, takes = [], []
    for time_s in np.arange(0.0, 2 * tau + 2 * ramp_s, slow_s / steps)[1:]:
        down = np.clip(time_s / ramp_s, 0, 1) - np.clip((time_s - tau) / ramp_s - 1, 0, 1)
        size = 0.6 * (1 - 0.45 * down)
        across = 0.35 * size * math.sin(4 * math.pi * time_s / tau)
        psi = math.sqrt(size**2 - across**2) + 1j * across
        i = (psi - r) / (s * ls)
        change = (1 - s) * ls * i.real - r
        r += slow_s / steps / tau * change
        takes.append(abs(change) / (1 - s) / 0.6)
        if len(takes) % steps == 0:
            slow(cfg, state, seen(psi / wrong, i), 0.0)
            found.append(math.sqrt(state.circle2))
    late = found[int(0.2 / slow_s) :]
    return min(late), max(found), max(takes)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_flux_reference_that_moves_is_no_wrong_flux(machine):
    """What remains comes from the samples: the current at the end of a slow period stands for the
    whole period."""
    _, worst, takes = off_while_the_flux_moves(machine)
    assert takes > 0.8
    assert worst < 0.2


@pytest.mark.parametrize("machine", MACHINES)
def test_a_flux_reference_that_moves_hides_no_wrong_flux(machine):
    """A flux estimate that is 1.6 times too small: without load this is 0.6, in amperes 0.33 where
    the flux is at 55 %. Torque leaves some less."""
    least, _, _ = off_while_the_flux_moves(machine, wrong=1.6)
    assert least > 0.25


def test_the_rotor_flux_that_is_followed_has_the_length_of_both_components():
    cfg = config(MACHINES[0], rotor_gain=0.5)
    state = fresh()
    for _ in range(60):
        lib.ht_protect_follow(cfg, state, seen(0.3 + 0.4j, 0j))
    assert state.rotor_Wb == pytest.approx(0.5, rel=1e-5)


# --- encoder ---------------------------------------------------------------------------


def turning(machine, shaft_rpm, share, psi=0.6, rr_scale=1.0):
    """The control state of the steady state at a share of the pull-out slip."""
    slip = share * pull_out(machine)
    speed = shaft_rpm * np.pi / 30 * machine[0] + slip
    return seen(psi * 1j, current(machine, slip, psi * 1j), speed, rr_scale)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("shaft_rpm", (-3000.0, -40.0, 0.0, 1500.0))
def test_shaft_speed_of_every_steady_state(machine, shaft_rpm):
    for share in np.linspace(-1, 1, 21):
        state = fresh()
        slow(config(machine), state, turning(machine, shaft_rpm, share), shaft_rpm)
        assert state.speed_error_rpm == pytest.approx(0, abs=2e-6 * abs(shaft_rpm) + 5e-3)


#: Slow interrupts a second.
SLOW_HZ = st.sampled_from([20.0, 100.0, 500.0, 1000.0])


def mean_errors(slow_Hz, flux_at, told_at, measured_rpm, seconds=0.5):
    """The mean error of the speed after each look. `flux_at`: the flux at a time, `told_at`: the
    electrical speed that the observer tells then, `measured_rpm`: from a time to another."""
    cfg = config(MACHINES[1], encoder_gain=1 / (1 + 0.05 * slow_Hz), **at(slow_Hz))
    state, found = fresh(), []
    lib.ht_protect_follow(cfg, state, seen(flux_at(0.0), 0j, told_at(0.0)))
    for n in range(1, round(seconds * slow_Hz) + 1):
        was, now = (n - 1) / slow_Hz, n / slow_Hz
        slow(cfg, state, seen(flux_at(now), 0j, told_at(now)), measured_rpm(was, now))
        found.append(state.speed_error_rpm)
    return np.array(found)


@settings(max_examples=examples(200), deadline=None)
@given(
    st.floats(-6000, 6000), SLOW_HZ, st.floats(0.0, 0.2), st.floats(0.0, 6.3), st.floats(-1.0, 1.0),
)  # fmt: skip
def test_a_ripple_of_the_fluxs_angle_goes_out_of_the_mean(rpm, slow_Hz, ripple, begin, off):
    """A scheme moves the flux to and fro along its circle, and beats with the looks. The observer
    tells a speed that is off by up to a radian in a slow period. The turns between the looks add
    up, so their mean is wrong by an angle over the mean's 50 ms only, and by the error of the arc
    tangent."""
    electrical = rpm * np.pi / 30 * MACHINES[1][0]

    def flux_at(t):
        wobble = ripple * np.sin(2 * np.pi * 0.317 * slow_Hz * t + begin)
        return 0.4 * np.exp(1j * (electrical * t + wobble))

    errors = mean_errors(
        slow_Hz, flux_at, lambda t: electrical + off * slow_Hz, lambda was, now: rpm
    )
    radians_s = 2 * ripple / (0.05 + 1 / slow_Hz) + 0.01 * slow_Hz * (abs(off) + 2 * ripple > 0.3)
    allowed_rpm = (radians_s + 0.003 * slow_Hz) * 30 / np.pi / MACHINES[1][0]
    assert np.abs(errors).max() < allowed_rpm + 1e-3 * abs(rpm)


@settings(max_examples=examples(200), deadline=None)
@given(st.floats(0.05, 2.5), st.floats(0.0, 0.08), SLOW_HZ, st.booleans())
def test_the_length_of_the_flux_tells_nothing_of_its_speed(length, takes_s, slow_Hz, back):
    """The observer divides by the square of the reference's length: it tells the speed of a short
    flux too low, of a long one too high. The length jumps, or takes its time."""
    rpm = -4500.0 if back else 4500.0
    electrical = rpm * np.pi / 30 * MACHINES[1][0]

    def share_at(t):
        done = min(1.0, max(0.0, t - 0.1) / takes_s) if takes_s else float(t > 0.1)
        return 1 + (length - 1) * done

    def flux_at(t):
        return 0.4 * share_at(t) * np.exp(1j * electrical * t)

    def told_at(t):
        """Within a radian in a slow period of the truth."""
        told = electrical * share_at(t) ** 2
        return np.clip(told, electrical - slow_Hz, electrical + slow_Hz)

    errors = mean_errors(slow_Hz, flux_at, told_at, lambda was, now: rpm)
    assert np.abs(errors).max() < 0.01 * slow_Hz * 30 / np.pi / MACHINES[1][0] + 1.0


@pytest.mark.parametrize("radians", (2.5, -2.5, 8.0, -8.0))
def test_half_a_turn_off_and_a_quick_start_are_told(radians):
    """Up to half a turn in a slow period may be missing in what the observer tells. A shaft that
    speeds up evenly makes the mean turn of the speeds at both looks, however far it is."""
    slow_Hz, rpm_of = 10.0, 30 / np.pi / MACHINES[1][0]
    if abs(radians) < np.pi:  # the observer is wrong by so much all the time
        errors = mean_errors(
            slow_Hz, lambda t: 0.4 * np.exp(50j * t), lambda t: 50.0 - radians * slow_Hz,
            lambda was, now: 50.0 * rpm_of,
        )  # fmt: skip
    else:
        rise = 2 * radians * slow_Hz**2  # rad/s^2
        errors = mean_errors(
            slow_Hz, lambda t: 0.4 * np.exp(0.5j * rise * t**2), lambda t: rise * t,
            lambda was, now: 0.5 * rise * (was + now) * rpm_of,
        )  # fmt: skip
    assert np.abs(errors).max() < 0.01 * slow_Hz * rpm_of + 1.0


def test_a_flux_that_is_not_known_yet_has_the_speed_that_the_observer_tells():
    machine, state = MACHINES[0], fresh()
    slow(config(machine), state, seen(0.6j, 0j, 100.0), 0.0)
    assert state.speed_error_rpm == pytest.approx(-100.0 * 30 / np.pi / machine[0], rel=1e-5)


@pytest.mark.parametrize("scale", (0.7, 1.4))
def test_slip_uses_the_adapted_rotor_resistance(scale):
    machine = MACHINES[1]
    hot = machine[0], machine[1] * scale, *machine[2:]
    state = fresh()
    slow(config(machine), state, turning(hot, 900.0, 0.4, rr_scale=scale), 900.0)
    assert state.speed_error_rpm == pytest.approx(0, abs=5e-3)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("shaft_rpm", (1000.0, -1000.0))
@pytest.mark.parametrize("factor", (0.0, -1.0, 0.5, 2.0))  # stuck, reversed, lines, lines
def test_wrong_encoder_is_found_in_time(machine, shaft_rpm, factor):
    limit, gain = 150.0, 1 / 6
    cfg = config(machine, encoder_trip_rpm=limit, encoder_gain=gain)
    control = turning(machine, shaft_rpm, 0.3)
    assert looks_until("ENCODER", cfg, control, shaft_rpm, most=300) is None
    n = np.arange(1, 300)
    off = abs((factor - 1) * shaft_rpm) * (1 - (1 - gain) ** n)
    assert looks_until("ENCODER", cfg, control, factor * shaft_rpm) == n[off > limit][0]


@pytest.mark.parametrize("sign", (1, -1))
def test_encoder_threshold_is_at_its_documented_value(sign):
    machine = MACHINES[0]
    control = turning(machine, 500.0, 0.2)
    for near, found in ((149.9, None), (150.1, 1)):
        cfg = config(machine, encoder_trip_rpm=150.0)
        assert looks_until("ENCODER", cfg, control, 500.0 + sign * near) == found
    assert looks_until("ENCODER", config(machine), control, sign * 1e5) is None  # off


@pytest.mark.parametrize("slow_Hz", (10.0, 40.0, 100.0, 200.0, 500.0, 1000.0))
@pytest.mark.parametrize("rpm_per_s", (5000.0, -13000.0, 100000.0))
def test_a_shaft_that_reverses_is_no_wrong_encoder(slow_Hz, rpm_per_s):
    """The measured speed is the mean since the look before, and the flux's speed is, too. What the
    observer tells lags behind the flux by 5 ms: it only says how many whole turns there were."""
    pole_pairs, top_rpm = MACHINES[1][0], 2000.0
    lag_s = 0.005
    if abs(rpm_per_s) * np.pi / 30 * pole_pairs * (lag_s + 1 / slow_Hz) / slow_Hz > 1.5:
        pytest.skip("a quarter of a turn in a slow period is not told")
    begin_s, end_s = 0.1, 0.1 + 2 * top_rpm / abs(rpm_per_s)

    def rpm_at(t):
        return -np.sign(rpm_per_s) * top_rpm + rpm_per_s * (np.clip(t, begin_s, end_s) - begin_s)

    def turned(t):
        """Turns of the shaft since 0."""
        at_s = np.linspace(0.0, t, 2001)
        return np.trapezoid(rpm_at(at_s), at_s) / 60

    def flux_at(t):
        return 0.4 * np.exp(2j * np.pi * pole_pairs * turned(t))

    errors = mean_errors(
        slow_Hz,
        flux_at,
        lambda t: rpm_at(t - lag_s) * np.pi / 30 * pole_pairs,
        lambda was, now: (turned(now) - turned(was)) * slow_Hz * 60,
        seconds=end_s + 0.1,
    )
    assert np.abs(errors).max() < 1.0 + 0.01 * slow_Hz * 30 / np.pi / pole_pairs * (
        abs(rpm_per_s) * np.pi / 30 * pole_pairs * lag_s / slow_Hz > 0.15
    )


def slip_of(machine, psi, load):
    """The slip below pull-out at which the load is held, by bisection."""
    low, high = 0.0, pull_out(machine)
    for _ in range(50):
        slip = (low + high) / 2
        torque = 3 * machine[0] * psi * current(machine, slip, psi).imag
        low, high = (slip, high) if torque < load else (low, slip)
    return slip


@pytest.mark.parametrize("setup", ("paper-a", "paper-b"))
@pytest.mark.parametrize("wrong", (0.7, 1.3))
@pytest.mark.parametrize("sign", (1, -1))
def test_rotor_resistance_wrong_by_a_third_trips_nothing(setup, wrong, sign):
    """At the papers' flux and load, with the default levels."""
    machine, psi, load = printed(setup)
    pole_pairs, rr, *rest = machine
    slip = slip_of(machine, psi, load)
    control = turning(machine, 900.0, sign * slip / pull_out(machine), psi)
    cfg = config(
        (pole_pairs, rr * wrong, *rest),
        encoder_trip_rpm=parameters()["encoder_trip_rpm"].initial,
        flux_check=parameters()["flux_check"].initial,
    )
    state = fresh()
    for _ in range(5):
        assert slow(cfg, state, control, 900.0) == 0
        turn(control, cfg.slow_Hz)
    error_rpm = sign * (wrong - 1) * slip * 30 / np.pi / pole_pairs
    assert state.speed_error_rpm == pytest.approx(error_rpm, abs=0.05)


@pytest.mark.parametrize("bad", (NAN, INF, -INF))
@pytest.mark.parametrize("where", ("psi", "i", "both"))
def test_slow_checks_treat_nan_as_wrong(bad, where):
    machine = MACHINES[0]
    cfg = config(machine, flux_check=0.7, encoder_trip_rpm=150.0)
    psi = complex(bad, 0.1) if where != "i" else 0.6 + 0j
    i = complex(bad, 0.1) if where != "psi" else 2.0 + 0j
    assert slow(cfg, fresh(), seen(psi, i), 0.0) & bit("FLUX")


@pytest.mark.parametrize("bad", (NAN, INF, -INF))
def test_the_encoder_check_treats_nan_as_wrong(bad):
    machine = MACHINES[0]
    cfg = config(machine, encoder_trip_rpm=150.0)
    good = turning(machine, 0.0, 0.0)
    assert slow(cfg, fresh(), good, bad) == bit("ENCODER")
    for name in ("omega_sync_rad_s", "rr_scale"):
        control = turning(machine, 0.0, 0.5)
        setattr(control.observer, name, bad)
        assert slow(cfg, fresh(), control, 0.0) == bit("ENCODER")
    control = turning(machine, 0.0, 0.0)
    control.estimate.psi_Wb.alpha = NAN
    assert slow(cfg, fresh(), control, 0.0) == bit("ENCODER")


def test_no_flux_and_no_current_is_no_fault():
    cfg = config(flux_check=0.7, encoder_trip_rpm=150.0)
    assert slow(cfg, fresh(), seen(0j, 0j), 0.0) == 0


def test_both_slow_faults_are_reported_together():
    machine = MACHINES[0]
    cfg = config(machine, flux_check=0.7, encoder_trip_rpm=150.0)
    control = seen(0.6 + 0j, 5 * current(machine, 0.0, 0.6))
    assert slow(cfg, fresh(), control, 500.0) == bit("FLUX") | bit("ENCODER")


# --- stuck sensor ----------------------------------------------------------------------

NEXT = {0: 2, 2: 4, 4: 0, 1: 3, 3: 5, 5: 1}  # u, v, w of set 1 and of set 2


def watch(looks, leg=0, limit=100.0, elsewhere=None):
    """The report of each check of `leg`. `looks` are pairs of its reading and the sum of its set's
    other two. The shares of these two, and all other channels, change all the time."""
    cfg, state = config(stuck_counts=limit), fresh()
    samples = ffi.new("ht_samples *")
    reports = []
    for n, (own, other) in enumerate(looks):
        for channel in range(7):
            samples.adc[channel] = (n * 977 + channel * 131) % 4096
        share = n * 977 % (other + 1)
        samples.adc[NEXT[leg]], samples.adc[NEXT[NEXT[leg]]] = share, other - share
        samples.adc[leg] = int(own)
        reports.append(lib.ht_protect_stuck(cfg, state, samples, leg))
        assert state.same[leg] <= LOOKS
    assert set(reports) <= {0, bit("STUCK")}
    for k in range(6):  # nothing of the other legs is touched
        assert k == leg or (state.count[k], state.other[k], state.same[k]) == (0, 0, 0)
    return [r != 0 for r in reports]


def literally(looks, limit):
    """A reading is stuck if it has not changed for more than LOOKS checks, and the sum of the other
    two has changed by `limit` or more since then. Before the first check all readings are 0."""
    changed, at, last, out = -1, 0, 0, []
    for n, (own, other) in enumerate(looks):
        if own != last:
            changed, at, last = n, other, own
        out.append(n - changed > LOOKS and abs(other - at) >= limit)
    return out


runs = st.lists(st.tuples(st.integers(0, 3), st.integers(1, 130)), min_size=1, max_size=6)


seed = st.integers(0, 2**31)


@given(runs, seed, st.sampled_from(range(6)), st.sampled_from((0.5, 100.0, 2000.5, 4000.0)))
@settings(max_examples=100, deadline=None)
def test_stuck_means_an_unchanged_reading(steps, seed, leg, limit):
    """Sequences of readings that stay constant for some time and then change, or do not."""
    own = [value for value, length in steps for _ in range(length)]
    other = np.random.default_rng(seed).integers(0, 4096, len(own)).tolist()
    looks = list(zip(own, other))
    assert watch(looks, leg, limit) == literally(looks, limit)


@given(seed, st.sampled_from((2, 20, 4096)))
@settings(max_examples=40, deadline=None)
def test_reading_that_moves_never_trips(seed, most):
    """The reading moves by any step except 0, modulo 4096, or by one count every 50 checks."""
    rng = np.random.default_rng(seed)
    steps, other = rng.integers(1, most, 300), rng.integers(0, 4096, 300).tolist()
    assert not any(watch(zip(np.cumsum(steps) % 4096, other), limit=1.0))
    crawling = [(2000 + n // LOOKS, b) for n, b in enumerate(other)]
    assert not any(watch(crawling, limit=1.0))


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("sign", (1, -1))
def test_a_stuck_sensor_trips_at_exactly_the_limit(leg, sign):
    for moved, trips in ((100, True), (99, False)):
        looks = [(2048, 2000)] + [(2048, 2000 + sign * moved)] * 200
        reports = watch(looks, leg)
        assert reports == [n > LOOKS and trips for n in range(201)]


@pytest.mark.parametrize("leg", range(6))
def test_a_stuck_sensor_shows_only_in_the_sum_of_the_other_two(leg):
    """`watch` changes each of the other two, and every other channel, all the time. A load does the
    same at standstill if it acts perpendicular to the axis of the phase."""
    assert not any(watch([(2048, 2000)] * 300, leg, limit=1.0))


def test_a_reading_that_moves_again_is_not_stuck():
    looks = [(2048, 2000)] + [(2048, 2500)] * 30 + [(2048, 2050)] * 100
    assert not any(watch(looks))


def test_a_stuck_limit_of_zero_turns_the_check_off():
    assert not any(watch([(2048, 0)] + [(2048, 4095)] * 200, limit=0.0))


def test_stuck_counters_saturate():
    """A counter of 16 bits would wrap after 65536 checks."""
    reports = watch([(2048, 2000)] + [(2048, 3000)] * 66000)
    assert not any(reports[: LOOKS + 1])
    assert all(reports[LOOKS + 1 :])


# --- samples ---------------------------------------------------------------------------

LIMITS = {
    "i_trip_A": 25.0, "i_sum_trip_A": 2.0, "vdc_min_V": 150.0, "vdc_max_V": 400.0,
    "speed_trip_rpm": 2000.0, "i_ab_trip_A": 30.0, "flux_trip_Wb": 1.5,
}  # fmt: skip


def sampled(i_A=(0,) * 6, vdc=250.0, speed=0.0, powered=True):
    at_hand = ffi.new("ht_control_input *")
    at_hand.i_A.p = list(i_A)
    at_hand.vdc_V = vdc
    return lib.ht_protect_samples(config(**LIMITS), at_hand, speed, powered)


def loop(leg, value):
    """Currents with `value` in one phase. In each set they add up to zero."""
    i = np.zeros(6)
    i[leg], i[NEXT[leg]] = value, -value
    return i


@pytest.mark.parametrize("powered", (True, False))
@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("sign", (1, -1))
def test_each_phase_trips_at_its_own_current_limit(leg, sign, powered):
    assert sampled(loop(leg, sign * 24.999), powered=powered) == 0
    assert sampled(loop(leg, sign * 25.001), powered=powered) == bit("OVERCURRENT")
    for bad in (NAN, sign * INF):
        i = np.zeros(6)
        i[leg] = bad
        want = bit("OVERCURRENT") | (bit("CURRENT_SUM") if powered else 0)
        assert sampled(i, powered=powered) == want


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("sign", (1, -1))
def test_a_phase_trips_however_small_the_others_are(leg, sign):
    """In the star, its current may return in halves; before the offsets are known, not at all."""
    shared = np.zeros(6)
    shared[leg], shared[NEXT[leg]], shared[NEXT[NEXT[leg]]] = 1.0, -0.5, -0.5
    for i, powered in ((shared, True), (np.eye(6)[leg], False)):
        assert sampled(sign * 24.999 * i, powered=powered) == 0
        assert sampled(sign * 25.001 * i, powered=powered) == bit("OVERCURRENT")


@pytest.mark.parametrize("sign", (1, -1))
def test_six_currents_below_the_limit_are_no_fault(sign):
    """Six currents below the limit are no fault, however large they are together."""
    assert sampled([sign * 24.999] * 6, powered=False) == 0
    assert sampled([sign * 25.001] * 6, powered=False) == bit("OVERCURRENT")


@pytest.mark.parametrize("leg", range(6))
@pytest.mark.parametrize("sign", (1, -1))
def test_the_current_sum_of_each_set_trips_at_its_limit(leg, sign):
    for value, want in ((1.999, 0), (2.001, bit("CURRENT_SUM"))):
        i = np.array([5.0, 7.0, -9.0, 4.0, 4.0, -11.0])  # both sets: 0
        i[leg] += sign * value
        assert sampled(i) == want
        assert sampled(i, powered=False) == 0  # offsets are not known yet


def test_sum_is_not_taken_across_the_sets():
    """Errors that cancel between the sets are found."""
    assert sampled([3, -3, 0, 0, 0, 0]) == bit("CURRENT_SUM")


@pytest.mark.parametrize("powered", (True, False))
def test_speed_and_voltage_trip_at_their_bounds(powered):
    for value, want in ((1999.9, 0), (2000.1, bit("OVERSPEED")), (INF, bit("OVERSPEED"))):
        assert sampled(speed=value, powered=powered) == want
        assert sampled(speed=-value, powered=powered) == want
    assert sampled(speed=NAN, powered=powered) == bit("OVERSPEED")
    high, low = bit("VDC_HIGH"), bit("VDC_LOW")
    for value, want in (
        (150.01, 0), (150.0, 0), (149.99, low), (-INF, low), (-250.0, low),
        (399.99, 0), (400.0, 0), (400.01, high), (INF, high), (NAN, high | low),
    ):  # fmt: skip
        assert sampled(vdc=value, powered=powered) == want


@given(st.lists(st.booleans(), min_size=4, max_size=4))
def test_all_faults_of_the_samples_are_reported_together(present):
    over, unbalanced, fast, low = present
    i = loop(3, 26.0 if over else 1.0)
    i[0] += 3.0 if unbalanced else 0.0
    got = sampled(i, 100.0 if low else 250.0, -3000.0 if fast else 0.0)
    names = ("OVERCURRENT", "CURRENT_SUM", "OVERSPEED", "VDC_LOW")
    assert got == sum(bit(name) for name, yes in zip(names, present) if yes)


# --- results of the control step -------------------------------------------------------


def result(i=0j, psi=0.6 + 0j, torque=0.0, decided=0.0, reference=0.0, xy=0j):
    control = seen(psi, i)
    control.estimate.torque_Nm, control.decided.torque_Nm = torque, decided
    control.v_xy_pu = [xy.real, xy.imag]
    return lib.ht_protect_results(config(**LIMITS), control, reference)


def test_magnitude_of_the_current_trips_at_its_bound():
    for angle in np.arange(0, 2 * np.pi, 0.1):
        assert result(i=29.99 * np.exp(1j * angle)) == 0
        assert result(i=30.01 * np.exp(1j * angle)) == bit("OVERCURRENT")
    for bad in (NAN, INF, -INF):
        assert result(i=complex(bad, 0)) == result(i=complex(0, bad)) == bit("OVERCURRENT")


@pytest.mark.parametrize("sign", (1, -1))
def test_each_component_of_the_flux_trips_at_its_bound(sign):
    for unit in (1, 1j):
        assert result(psi=unit * sign * 1.499) == 0
        assert result(psi=unit * sign * 1.501) == bit("FLUX")
        assert result(psi=unit * sign * 0.99e6) == bit("FLUX")
        assert result(psi=unit * sign * 1.01e6) == bit("NONFINITE")
    for bad in (NAN, sign * INF):
        assert result(psi=complex(bad, 0)) == result(psi=complex(0, bad)) == bit("NONFINITE")


@pytest.mark.parametrize("name", ("torque", "decided", "reference"))
@pytest.mark.parametrize("sign", (1, -1))
def test_torques_that_are_not_finite_trip(name, sign):
    assert result(**{name: sign * 0.99e6}) == 0
    for bad in (sign * 1.01e6, sign * INF, NAN):
        assert result(**{name: bad}) == bit("NONFINITE")


@pytest.mark.parametrize("sign", (1, -1))
def test_xy_command_that_is_not_finite_trips(sign):
    """One beyond the link voltage is a number, too."""
    for unit in (1, 1j):
        assert result(xy=unit * sign * 1.3) == 0
        assert result(xy=unit * sign * 0.99e6) == 0
        assert result(xy=unit * sign * 1.01e6) == bit("NONFINITE")
    for bad in (NAN, sign * INF):
        assert result(xy=complex(bad, 0)) == result(xy=complex(0, bad)) == bit("NONFINITE")


def test_each_value_has_its_own_bounds():
    """Each value has its own bound, also if many others are near theirs."""
    assert result(torque=0.99e6, decided=-0.99e6, reference=0.99e6, xy=0.99e6 - 0.99e6j) == 0
    assert result(torque=0.99e6, psi=2j) == bit("FLUX")
    assert result(torque=9e4, decided=9e4, reference=1.01e6) == bit("NONFINITE")
    assert result(xy=0.8 + 1.1e6j) == result(xy=1.1e6 + 0.8j) == bit("NONFINITE")


def test_all_faults_of_the_results_are_reported_together():
    assert result(torque=NAN, psi=2j) == bit("NONFINITE")
    assert result(i=31j, psi=2j) == bit("OVERCURRENT") | bit("FLUX")
    assert result(i=31j, torque=NAN) == bit("OVERCURRENT") | bit("NONFINITE")
    assert result() == 0


def test_an_encoder_trip_of_zero_turns_the_check_with_magnets_off():
    """A shaft whose encoder stops at once."""
    for most_counts, fault in ((5.0, bit("ENCODER")), (0.0, 0)):
        cfg = config(counts_quick=0.5, counts_slow=0.01, most_counts=most_counts)
        state = fresh()
        state.counts_quick = state.counts_slow = 40.0
        found = [lib.ht_protect_encoder(cfg, state, 0.0) for _ in range(20)]
        assert found[-1] == fault
