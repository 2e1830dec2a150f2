"""Laws outside the firmware: what they see, what becomes of what they return, and how they are
stopped. The plant's edges and currents tell, not the registers.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hexatorque
from hexatorque import laws
from hexatorque.analysis.metrics import metrics
from hexatorque.cli.main import main
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.experiments.operating_points import Point, measure_all
from hexatorque.firmware import ffi
from hexatorque.laws import VECTORS, Law, LawError, centred, controller_of, record, vector, vectors
from hexatorque.laws.law import SEEN
from hexatorque.plant.legs import HIGH, OFF

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "own_law.py"
TRANSFORM = np.array(
    [f(n * np.deg2rad([0, 30, 120, 150, 240, 270])) / 3 for n in (1, 5) for f in (np.cos, np.sin)]
)


def setup(**changes):
    return hexatorque.load("paper-a-feasible").changed(
        timing__latency="predicted",
        controller__calibration_s=0.005,
        controller__build_s=0.1,
        **changes,
    )


def started(law, samples=1, checked=True, **changes):
    """A drive that has just come to RUN, at rest, without load."""
    if not checked:  # a law that holds no flux
        changes |= {"controller__flux_check": 0.0, "controller__encoder_trip_rpm": 0.0}
    sim = SimulatedDrive(setup(**changes), samples, controller=controller_of(law))
    sim.start()
    sim.run(0.105 + 2 * sim.period_s, record=False)
    assert sim.state == "run"
    return sim


# -- what a law sees ----------------------------------------------------------------------


def test_the_record_is_the_struct():
    struct = ffi.typeof("ht_host_law_seen")
    assert [name for name, _ in struct.fields] == list(SEEN.names)
    for name, field in struct.fields:
        dtype, offset = SEEN.fields[name]
        assert (offset, dtype.itemsize) == (field.offset, ffi.sizeof(field.type)), name


EXAMPLE_LAW = laws.find(str(EXAMPLE))
FCS = laws.find("fcs-mpc")
SEEN_BY_WATCH: list = []


class Watch(Law):
    """The reference whose currents move most, uncompiled, keeping what it saw."""

    returns = "vectors"
    compiled = False

    def memory(self, parameters):
        return FCS.memory(parameters)

    @staticmethod
    def step(seen, memory):
        SEEN_BY_WATCH.append({name: np.copy(seen[name]) for name in SEEN.names})
        return FCS.step(seen, memory)


def test_what_is_predicted_comes_true():
    """Currents and flux that step k sees ahead are those that step k + 1 has sampled, within what
    the prediction's first order leaves: far less than they change in a period."""
    SEEN_BY_WATCH.clear()
    sim = started(Watch(), controller__control_mode="torque", controller__torque_ref_Nm=6.0)
    sim.run(0.04, record=False)
    sim.check()
    ahead, then = SEEN_BY_WATCH[200:-1], SEEN_BY_WATCH[201:]
    for what, sampled, scale in (
        ("i_A", "sampled_i_A", 0.15), ("i_xy_A", "sampled_i_xy_A", 0.15),
        ("psi_Wb", "sampled_psi_Wb", 0.05),
    ):  # fmt: skip
        miss = [abs(b[sampled] - a[what]) for a, b in zip(ahead, then)]
        moves = [abs(b[sampled] - a[sampled]) for a, b in zip(ahead, then)]
        assert np.mean(miss) < scale * np.mean(moves), what
    last = SEEN_BY_WATCH[-1]
    phases = np.array([last["sampled_i_A"].real, last["sampled_i_A"].imag,
                       last["sampled_i_xy_A"].real, last["sampled_i_xy_A"].imag])  # fmt: skip
    np.testing.assert_allclose(TRANSFORM @ last["phases_A"], phases, atol=1e-5)
    np.testing.assert_allclose(
        last["rotor_Wb"], last["psi_Wb"] - last["sigma_ls_H"] * last["i_A"], atol=1e-6
    )
    assert last["torque_ref_Nm"] == 6.0 and last["pole_pairs"] == 2
    assert [s["period"] for s in SEEN_BY_WATCH] == list(range(len(SEEN_BY_WATCH)))


# -- what becomes of what it returns --------------------------------------------------------


V_XY = 0.04 * np.exp(1j * np.pi / 12)  # no phase is without current


class Steady(Law):
    """A constant x-y voltage, which makes direct x-y current and no torque."""

    @staticmethod
    def step(seen, memory):
        return centred(0j, V_XY)


def test_duty_ratios_arrive_with_the_dead_time_compensated():
    """Direct current is voltage over resistance: in x-y 10 V over 1.8 ohm. Without compensation the
    legs would lose 2.3 us of 100 us at 250 V to either side, together 3.7 V in x-y."""
    sim = started(Steady(), checked=False, machine__drs_ohm=[0.0] * 6)
    sim.run(1.5, record=False)  # the flux of the build-up decays
    sim.run(0.02)
    rec = sim.take()
    i_xy = np.mean(rec["plant.i_x_A"]) + 1j * np.mean(rec["plant.i_y_A"])
    assert abs(i_xy / (250.0 * V_XY / 1.8) - 1) < 0.01
    assert rec.meta["f_sw_Hz"] == pytest.approx(5000, rel=0.01)  # one toggle a leg and period


@pytest.mark.parametrize("seed", range(3))
def test_centred_is_the_transform_and_midway_between_the_rails(seed):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        v, v_xy = 0.4 * rng.random() * np.exp(2j * np.pi * rng.random()), 0.05 * rng.random()
        duty = np.array(centred(v, v_xy + 0j))
        mean = TRANSFORM @ duty
        np.testing.assert_allclose(mean, [v.real, v.imag, v_xy, 0], atol=1e-12)
        for legs in (slice(0, 6, 2), slice(1, 6, 2)):
            assert duty[legs].max() + duty[legs].min() == pytest.approx(1)


@pytest.mark.parametrize(("size", "xy"), [(0.577, 0.02), (0.56, 0.1), (0.62, 0.1)])
def test_where_xy_does_not_fit_it_gives_way_first(size, xy):
    for angle in np.linspace(0, 2 * np.pi, 25):
        v = size * np.exp(1j * angle)
        duty = np.array(centred(v, xy + 0j))
        assert duty.min() >= 0 and duty.max() <= 1
        if size < 0.5773:
            assert abs((TRANSFORM @ duty)[0] + 1j * (TRANSFORM @ duty)[1] - v) < 1e-9


class Words(Law):
    """Goes through state words in a known order: three of them a period."""

    returns = "vectors"

    @staticmethod
    def step(seen, memory):
        n = np.int64(seen.period)
        return vectors((n * 7) % 64, (n * 11 + 5) % 64, (n * 13 + 2) % 64, 0.3, 0.6)


def test_state_words_are_on_the_legs_one_period_later():
    sim = started(Words(), checked=False, controller__stuck_trip_A=0.0)
    n0 = int(sim.controller._law.seen.period)
    begin = sim.periods
    state = sim.inverter.leg.copy()
    sim.log_edges(2000)
    sim.run(20 * sim.period_s, record=False)
    counts = sim._timing.period
    checked = 0
    for k in range(2, 20):
        n = n0 + k - 1  # decided in the period before
        for share, word in ((0.25, n * 7), (0.55, n * 11 + 5), (0.97, n * 13 + 2)):
            at = (begin + k + share) * counts
            levels = state.copy()
            for time, leg, level in sim.edges:
                if time <= at:
                    levels[leg] = level
            wanted = [word % 64 >> (5 - leg) & 1 for leg in range(6)]
            assert not np.any(levels == OFF)
            assert [int(level == HIGH) for level in levels] == wanted, (k, share)
            checked += 1
    assert checked == 54


def test_compiled_and_uncompiled_are_the_same_law():
    class Uncompiled(type(EXAMPLE_LAW)):
        compiled = False

    recordings = []
    for law in (EXAMPLE_LAW, Uncompiled()):
        sim = started(law, 12, controller__speed_ref_rpm=100.0)
        sim.run(0.04)
        sim.check()
        recordings.append(sim.take())
    one, two = recordings
    for name in ("plant.psi_alpha_Wb", "plant.torque_Nm", "plant.i_x_A"):
        np.testing.assert_allclose(one[name], two[name], atol=0.05)
    assert one.meta["scheme"] == "own-law"


def test_an_example_of_ten_lines_keeps_torque_and_flux():
    point = Point(setup(), 100.0, 10.0, EXAMPLE_LAW)
    (run,) = measure_all([point], fine=True)
    assert run.scheme == "own-law"
    assert run.metrics["torque_ripple_td_Nm"] < 0.1
    assert run.metrics["flux_Wb"] == pytest.approx(0.6, rel=0.01)


# -- laws that are stopped ------------------------------------------------------------------


def nonsense(values, kind="duties", is_compiled=True):
    class Nonsense(Law):
        name = "nonsense"
        returns = kind
        compiled = is_compiled

        @staticmethod
        def step(seen, memory):
            return values

    return Nonsense()


HALF = (0.5,) * 6


@pytest.mark.parametrize("is_compiled", [True, False])
@pytest.mark.parametrize(
    ("values", "kind", "says"),
    [
        ((0.5, np.nan, 0.5, 0.5, 0.5, 0.5), "duties", "duty ratio of leg u2 = nan: allowed is 0"),
        ((0.5, 0.5, 0.5, 0.5, 0.5, 1.01), "duties", "duty ratio of leg v2 = 1.01: allowed is 0 .."),
        ((-0.1, 0.5, 0.5, 0.5, 0.5, 0.5), "duties", "duty ratio of leg u1 = -0.1"),
        ((0.5,) * 5, "duties", "its step returned 5 numbers, needed are 6"),
        ((64.0, 0.0, 0.0, 0.5, 1.0), "vectors", "state word s0 = 64: allowed is a whole number"),
        ((1.0, 0.5, 0.0, 0.5, 1.0), "vectors", "state word s1 = 0.5: allowed is a whole number"),
        ((1.0, 0.0, 0.0, 0.5, np.inf), "vectors", "instant t2 = inf: allowed is 0 .. 1"),
        ((1.0, 0.0, 0.0, 0.6, 0.5), "vectors", "t1 = 0.6 is after t2 = 0.5"),
    ],
)
def test_nonsense_is_named_and_the_gates_go_off(values, kind, says, is_compiled):
    sim = SimulatedDrive(setup(), 1, controller=controller_of(nonsense(values, kind, is_compiled)))
    sim.start()
    with pytest.raises(LawError, match="law nonsense: ") as error:
        sim.run(0.2)
    assert says in str(error.value) and str(error.value).endswith("the gates are off")
    assert sim.state == "fault" and sim.faults == ["external trip"]
    assert np.all(sim.inverter.leg == OFF)
    sim.run(0.01)  # and they stay off
    assert np.all(sim.inverter.leg == OFF)


class Fails(Law):
    name = "fails"
    compiled = False

    @staticmethod
    def step(seen, memory):
        if seen.period > 3:
            raise RuntimeError("out of ideas")
        return HALF


class FailsCompiled(Fails):
    compiled = True


@pytest.mark.parametrize("law", [Fails, FailsCompiled])
def test_a_step_that_raises_is_named_with_its_reason(law):
    sim = SimulatedDrive(setup(), 1, controller=controller_of(law()))
    sim.start()
    with pytest.raises(LawError, match="law fails: its step failed: RuntimeError: out of ideas"):
        sim.run(0.2)
    assert np.all(sim.inverter.leg == OFF)


def test_a_nested_array_is_a_wrong_shape():
    sim = SimulatedDrive(
        setup(), 1, controller=controller_of(nonsense([list(HALF)], "duties", False))
    )
    sim.start()
    with pytest.raises(LawError, match="an empty or nested array, needed are 6"):
        sim.run(0.2)


def test_laws_that_cannot_be_used():
    with pytest.raises(LawError, match="returns = 'volts': choose one of duties, vectors"):
        SimulatedDrive(setup(), 1, controller=controller_of(nonsense(HALF, "volts")))
    immediate = hexatorque.load("paper-a-feasible").changed(timing__latency="immediate")
    with pytest.raises(LawError, match=r'it needs timing\.latency = "predicted"'):
        SimulatedDrive(immediate, 1, controller=controller_of(nonsense(HALF)))
    with pytest.raises(LawError, match="numba cannot compile its step"):
        SimulatedDrive(setup(), 1, controller=controller_of(nonsense({"a": object})))
    sim = SimulatedDrive(setup(), 1, controller=controller_of(nonsense(HALF)))
    with pytest.raises(LawError, match="scheme: cannot be set, law nonsense decides"):
        sim.set("scheme", "ddr")


# -- memory ---------------------------------------------------------------------------------


class Counts(Law):
    name = "counts"

    def memory(self, parameters):
        return record(count=0, last=1j, gains=[1.0, parameters["rs_ohm"]])

    @staticmethod
    def step(seen, memory):
        memory.count += 1
        memory.last = memory.last * 1j
        return centred(0j, 0j)


def test_memory_begins_anew_at_each_start():
    sim = started(Counts(), checked=False)
    own = sim.controller._own
    assert own.count == sim.controller._law.seen.period > 0
    assert own.gains[1] == pytest.approx(1.8) and abs(own.last) == 1
    sim.run(0.01)
    sim.stop()
    sim.run(0.01)
    stopped = int(own.count)
    sim.start()
    sim.run(0.105 + 3 * sim.period_s)
    assert 0 < sim.controller._own.count < 10 < stopped


# -- references -----------------------------------------------------------------------------


def seen_of(**values):
    row = np.zeros(1, SEEN).view(np.recarray)[0]
    for name, value in values.items():
        row[name] = value
    return row


def test_fcs_mpc_takes_the_vector_of_the_lowest_cost():
    """Against the winding's equations, written out for all 64 vectors."""
    law = laws.find("fcs-mpc")
    rng = np.random.default_rng(4)
    memory = law.memory({})
    ts, ls, lxy, rs, vdc = 1e-4, 0.025, 0.01, 1.8, 250.0
    zeros = 0
    for _ in range(40):
        rotor = 0.55 * np.exp(2j * np.pi * rng.random())
        i = rng.normal(0, 3) + 1j * rng.normal(0, 3)
        i_xy = 0.3 * (rng.normal() + 1j * rng.normal())
        omega, torque = rng.normal(0, 150), rng.uniform(-10, 10)
        seen = seen_of(
            rotor_Wb=rotor, i_A=i, psi_Wb=rotor + ls * i, i_xy_A=i_xy, omega_rad_s=omega,
            torque_ref_Nm=torque, flux_ref_Wb=0.6, vdc_V=vdc, rs_ohm=rs, ts_s=ts, sigma_ls_H=ls,
            lxy_H=lxy, pole_pairs=2, before=rng.integers(64),
        )  # fmt: skip
        rotor2 = rotor * np.exp(1j * omega * ts)
        i_q = torque / (3 * 2 * abs(rotor))
        along = np.sqrt(0.36 - (ls * i_q) ** 2)
        wanted = ((along - abs(rotor)) / ls + 1j * i_q) * rotor2 / abs(rotor2)
        costs = []
        for word in range(64):
            legs = np.array([word >> (5 - k) & 1 for k in range(6)])
            v = vdc * TRANSFORM @ legs
            i2 = (rotor + ls * i + ts * (v[0] + 1j * v[1] - rs * i) - rotor2) / ls
            xy2 = i_xy + ts / lxy * (v[2] + 1j * v[3] - rs * i_xy)
            costs.append(abs(wanted - i2) ** 2 + memory.xy * abs(xy2) ** 2)
        chosen = int(law.step(seen, memory)[0])
        assert costs[chosen] <= min(costs) * (1 + 1e-4)
        zeros += np.abs(VECTORS[chosen, 0]) < 1e-9
    assert zeros < 40


def test_virtual_vectors_have_no_xy_voltage():
    """Each along its direction; the zero vector's own mean is 0."""
    from hexatorque.laws.vv_mpc import LARGE_SHARE, MEANS, PAIRS

    size = 1 / (np.sqrt(3) * np.cos(np.pi / 12))
    for k in range(12):
        large, medium = VECTORS[PAIRS[k, 0]], VECTORS[PAIRS[k, 1]]
        assert abs(LARGE_SHARE * large[1] + (1 - LARGE_SHARE) * medium[1]) < 1e-9
        assert MEANS[k] == pytest.approx(size * np.exp(1j * np.deg2rad(15 + 30 * k)), abs=1e-9)
    assert MEANS[12] == 0


def some_states(count):
    rng = np.random.default_rng(4)
    for _ in range(count):
        rotor = 0.55 * np.exp(2j * np.pi * rng.random())
        i = rotor / abs(rotor) * (2.2 + rng.normal(0, 0.4) + 1j * rng.normal(3, 0.4))
        yield seen_of(
            rotor_Wb=rotor, i_A=i, psi_Wb=rotor + 0.025 * i, omega_rad_s=rng.normal(0, 150),
            torque_ref_Nm=10.0, flux_ref_Wb=0.6, vdc_V=250.0, rs_ohm=1.8, ts_s=1e-4,
            sigma_ls_H=0.025, lxy_H=0.01, pole_pairs=2, before=rng.integers(64),
        )  # fmt: skip


def error_after(seen, v_pu):
    """Squared error of the current at the end of a period with the mean voltage v_pu."""
    rotor2 = seen.rotor_Wb * np.exp(1j * seen.omega_rad_s * seen.ts_s)
    i_q = seen.torque_ref_Nm / (3 * seen.pole_pairs * abs(rotor2))
    flux = np.sqrt(seen.flux_ref_Wb**2 - (seen.sigma_ls_H * i_q) ** 2)
    wanted = ((flux - abs(rotor2)) / seen.sigma_ls_H + 1j * i_q) * rotor2 / abs(rotor2)
    psi2 = seen.psi_Wb + seen.ts_s * (seen.vdc_V * v_pu - seen.rs_ohm * seen.i_A)
    return abs(wanted - (psi2 - rotor2) / seen.sigma_ls_H) ** 2


def test_vv_mpc_takes_the_best_virtual_vector():
    law = laws.find("vv-mpc")
    best = [1 / (np.sqrt(3) * np.cos(np.pi / 12)) * np.exp(1j * np.pi * (k / 6 + 1 / 12))
            for k in range(12)] + [0]  # fmt: skip
    for seen in some_states(40):
        s0, s1, s2, t1, t2 = law.step(seen, None)
        shares = (t1, t2 - t1, 1 - t2)
        mean = sum(share * VECTORS[int(s)] for s, share in zip((s0, s1, s2), shares))
        assert abs(mean[1]) < 1e-6
        least = min(error_after(seen, v) for v in best)
        assert error_after(seen, mean[0]) <= least * (1 + 1e-3) + 1e-6


def test_lvv_mpc_takes_the_best_share_of_the_best_virtual_vector():
    law = laws.find("lvv-mpc")
    size = 1 / (np.sqrt(3) * np.cos(np.pi / 12))
    v = size * np.exp(1j * np.pi * (np.arange(12) / 6 + 1 / 12))[:, None] * np.linspace(0, 1, 400)
    for seen in some_states(40):
        alpha, beta, x, y = TRANSFORM @ np.array(law.step(seen, None))
        chosen = alpha + 1j * beta
        assert abs(x + 1j * y) < 1e-9
        if abs(chosen) > 1e-6:
            assert np.degrees(np.angle(chosen)) % 30 == pytest.approx(15, abs=1e-6)
        assert error_after(seen, chosen) <= error_after(seen, v).min() + 1e-4


def test_dtc_svm_answers_in_first_order():
    """An ideal winding behind the committed period: torque and flux go to their references with
    the pole 1 - alpha T_s, together."""
    law = laws.find("dtc-svm")
    memory = law.memory({})
    ts, ls, rs, vdc, pairs, omega = 1e-4, 0.028, 6.0, 300.0, 1, 100.0
    rotor, i = 0.36 + 0j, 1.4 + 0j
    psi = rotor + ls * i
    start = abs(psi)
    v = 1j * omega * psi + rs * i
    torques, fluxes = [], []
    for k in range(80):
        ahead = psi + ts * (v - rs * i)
        rotor2 = rotor * np.exp(1j * omega * ts)
        seen = seen_of(
            psi_Wb=ahead, rotor_Wb=rotor2, i_A=(ahead - rotor2) / ls, sampled_psi_Wb=psi,
            sampled_i_A=i, omega_rad_s=omega, vdc_V=vdc, rs_ohm=rs, ts_s=ts, sigma_ls_H=ls,
            lxy_H=0.014, pole_pairs=pairs, flux_ref_Wb=start + (0.003 if k >= 20 else 0),
            torque_ref_Nm=0.3 if k >= 20 else 0.0,
        )  # fmt: skip
        alpha, beta, *_ = TRANSFORM @ np.array(law.step(seen, memory))
        psi, rotor, v = ahead, rotor2, vdc * (alpha + 1j * beta)
        i = (psi - rotor) / ls
        torques.append(3 * pairs / ls * (np.conj(rotor) * psi).imag)
        fluxes.append(abs(psi))
    answer = 1 - 0.7 ** np.arange(60)
    np.testing.assert_allclose(torques[20:], 0.3 * answer, atol=0.03 * 0.3)
    np.testing.assert_allclose(fluxes[20:], start + 0.003 * answer, atol=0.1 * 0.003)


@pytest.mark.parametrize("name", laws.names())
def test_every_reference_holds_a_point(name):
    (run,) = measure_all([Point(setup(), 300.0, 8.0, laws.find(name))], fine=True)
    assert run.metrics["flux_Wb"] == pytest.approx(0.6, rel=0.03)
    assert run.metrics["speed_rpm"] == pytest.approx(300, rel=0.01)
    # The resistances of the sets differ: only a law that controls x-y removes what follows.
    assert (run.metrics["delta_i_A"] < 0.1) == (name in ("fcs-mpc", "dtc-svm"))
    assert metrics(run.recording)["torque_ripple_td_Nm"] < 0.6


# -- files and the command ------------------------------------------------------------------

C_LAW = r"""
#include "ht_host_law.h"
const uint32_t ht_law_returns_vectors = 1, ht_law_memory_bytes = 4;
int32_t ht_law_step(const void *seen, void *memory, float *values)
{
    const ht_host_law_seen *s = seen;
    float *calls = memory;
    *calls += 1.0f;
    values[0] = values[1] = values[2] = (s->torque_ref_Nm > 100.0f) ? 48.0f : 0.0f;
    values[3] = values[4] = 1.0f;
    return (*calls > 50.0f) ? 3 : 5;
}
"""


@pytest.mark.skipif(not shutil.which("cc"), reason="a C compiler")
def test_a_law_in_c(tmp_path):
    source = tmp_path / "lazy.c"
    source.write_text(C_LAW)
    folders = [ROOT / "firmware" / f for f in ("core", "app", "port", "port/c2000", "port/host")]
    include = [f"-I{folder}" for folder in folders]
    library = tmp_path / "lazy.so"
    subprocess.run(["cc", "-shared", "-fPIC", *include, source, "-o", library], check=True)
    sim = SimulatedDrive(setup(), 1, controller=controller_of(laws.find(str(library))))
    sim.start()
    with pytest.raises(LawError, match="law lazy: its step returned 3 numbers, needed are 5"):
        sim.run(0.2)
    assert sim.controller._law.seen.period == 51


def test_files_without_a_law(tmp_path):
    broken, empty, library = (tmp_path / name for name in ("broken.py", "empty.py", "empty.so"))
    broken.write_text("1 / 0\n")
    empty.write_text("from hexatorque.laws import Law\n")
    library.write_bytes(b"")
    for path, says in (
        (broken, "ZeroDivisionError: division by zero"), (empty, "defines no class"),
        (library, "cannot be loaded"), (tmp_path / "none.py", "no such file"),
    ):  # fmt: skip
        with pytest.raises(LawError, match=says):
            laws.find(str(path))
    assert laws.find("ddr") is None


def test_compare_takes_references_and_files(tmp_path, capsys):
    schemes = f"dtc1,fcs-mpc,{EXAMPLE}"
    arguments = ["compare", "--setup", "paper-b", "--schemes", schemes, "-o", str(tmp_path)]
    assert main(arguments) == 0
    table = capsys.readouterr().out
    for label in ("DTC1", "FCS-MPC", "OWN-LAW"):
        assert label in table
    report = (tmp_path / "report.html").read_text()
    assert "OWN-LAW" in report and "FCS-MPC" in report


def test_compare_names_what_it_cannot_find(capsys):
    assert main(["compare", "--schemes", "ddr,fcs"]) == 2
    said = capsys.readouterr().err
    assert "no scheme 'fcs'" in said and "fcs-mpc" in said


def test_a_vector_is_one_word():
    assert vector(48) == (48, 48, 48, 1, 1)
