"""The environment of Gymnasium: its own checker passes, seeds decide everything, and an agent's
action is what the inverter does."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is missing: pip install gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import hexatorque.gym  # noqa: E402
from hexatorque import InputError, laws  # noqa: E402
from hexatorque.gym import IDS, SixPhaseDrive, tracking  # noqa: E402
from hexatorque.gym.environment import VOLTAGE_PU, XY_PU  # noqa: E402
from hexatorque.gym.reward import Passed  # noqa: E402
from hexatorque.plant.loop import PLANT_CHANNELS  # noqa: E402

TORQUE = [name for name, _ in PLANT_CHANNELS].index("torque_Nm")


def made(level, **more):
    return gymnasium.make(IDS[level], **more)


def run(env, actions, **reset):
    """Observations, rewards and the last info."""
    seen, rewards = [env.reset(**reset)[0]], []
    for action in actions:
        observed, reward, terminated, truncated, info = env.step(action)
        seen.append(observed)
        rewards.append(reward)
        if terminated or truncated:
            break
    return np.array(seen), rewards, info


@pytest.mark.parametrize("level", IDS)
def test_gymnasium_s_own_checker_passes(level):
    check_env(SixPhaseDrive(level=level, episode_s=0.01), skip_render_check=True)


@pytest.mark.parametrize("level", IDS)
def test_the_seed_decides_all(level):
    env = made(level)
    env.action_space.seed(5)
    actions = [env.action_space.sample() for _ in range(60)]
    first, again, other = (run(env, actions, seed=seed) for seed in (3, 3, 4))
    assert np.array_equal(first[0], again[0]) and first[1] == again[1] and first[2] == again[2]
    assert not np.array_equal(first[0], other[0])


class Zero(laws.Law):
    """What the agent below commands, as a law of one's own."""

    @staticmethod
    def step(seen, memory):
        return laws.centred(0.2 * VOLTAGE_PU + 0j, 0.1j * XY_PU)


def test_a_voltage_is_what_a_law_of_the_same_voltage_makes():
    """Mean voltages of the legs over a period, from the edges of the simulated inverter."""
    env = SixPhaseDrive(level="voltage")
    env.reset(seed=1, options={"speed_rpm": 0.0})
    for _ in range(3):  # the pattern in the registers, and the one that is decided
        env.step(np.array([0.2, 0.0, 0.0, 0.1], np.float32))
    drive = env.drive
    drive.log_edges(1000)
    legs, begun = np.array(drive.inverter.leg), drive.periods
    env.step(np.array([0.2, 0.0, 0.0, 0.1], np.float32))
    edges = drive.edges
    counts = round(drive.period_s * float(drive.controller.map.pwm_clock_Hz))
    wanted = np.array(laws.centred(0.2 * VOLTAGE_PU + 0j, 0.1j * XY_PU))
    for leg in range(6):
        own = edges[edges[:, 1] == leg]
        at = np.concatenate([[0], own[:, 0] - begun * counts, [counts]])
        states = np.concatenate([[legs[leg]], own[:, 2]])
        high, off = (np.diff(at)[states == state].sum() / counts for state in (1, 2))
        assert high - 1e-3 <= wanted[leg] <= high + off + 1e-3  # a diode decides the dead time


def test_a_state_word_is_what_the_legs_do_a_period_later():
    env = SixPhaseDrive(level="switching")
    env.reset(seed=2, options={"speed_rpm": 0.0})
    word = 48
    for _ in range(3):
        env.step(word)
    assert [int(state) for state in env.drive.inverter.leg] == [1, 1, 0, 0, 0, 0]


def test_the_torque_level_is_the_firmware_s_scheme():
    values = {"controller.scheme": "db-dtfc", "timing.latency": "predicted"}
    env = SixPhaseDrive("paper-b", "torque", set=values)
    env.reset(seed=1, options={"load_Nm": 0.0, "references": [(0.0, 100.0)]})
    for _ in range(300):  # the reference is taken over by the slow interrupt
        _, _, _, _, info = env.step(np.array([0.5], np.float32))
    assert env.drive.controller.channel("torque_ref_Nm") == pytest.approx(
        0.5 * env.drive.controller.number("torque_limit_Nm"), rel=1e-6
    )
    assert info["torque_Nm"] == pytest.approx(
        env.drive.controller.channel("torque_ref_Nm"), rel=0.1
    )


def test_references_are_followed_at_their_times():
    env = SixPhaseDrive(level="voltage", episode_s=0.01)
    _, info = env.reset(seed=1, options={"references": [(0.0, 1.0), (0.005, -2.0)]})
    asked = [info["reference"]]
    over = False
    while not over:
        *_, over, info = env.step(np.zeros(4, np.float32))
        asked.append(info["reference"])
    assert len(asked) == 101
    assert asked == [1.0] * 50 + [-2.0] * 51


def test_a_trip_ends_the_episode_and_names_its_cause():
    env = SixPhaseDrive(level="switching")
    env.reset(seed=1, options={"speed_rpm": 0.0})
    terminated = truncated = False
    while not (terminated or truncated):
        _, reward, terminated, truncated, info = env.step(48)
    assert terminated and reward == -100.0 and info["faults"]
    assert not any(env.drive.gate_mistake)


def test_the_reward_is_the_mean_error_the_xy_current_and_the_transitions():
    plant = np.zeros((4, len(PLANT_CHANNELS)), np.float32)
    passed = Passed(plant, np.array([0.1, -0.3, 0.1, 0.1]), np.full(4, 0.5), 6, False)
    assert tracking(passed) == pytest.approx(-(0.15 + 0.2 * 0.5 + 0.002 * 6))
    assert tracking(passed._replace(tripped=True)) == -100.0


def test_a_reward_of_one_s_own_sees_the_truth():
    seen = []

    def reward(passed):
        seen.append(passed)
        return 1.5

    env = SixPhaseDrive(level="voltage", reward=reward, periods=3)
    env.reset(seed=1)
    assert env.step(np.zeros(4, np.float32))[1] == 1.5
    assert seen[0].plant.shape == (12, len(PLANT_CHANNELS))
    assert seen[0].error[0] * env._limit_Nm + env.reference == pytest.approx(
        seen[0].plant[0, TORQUE], abs=1e-5
    )


@pytest.mark.parametrize(
    ("more", "words"),
    (
        ({"level": "voltag"}, "choose one of torque, voltage, switching"),
        ({"periods": 0}, "periods = 0"),
        ({"episode_s": -1}, "episode_s = -1"),
        ({"setup": "paper-z"}, "paper-z"),
        ({"set": {"machine.rs_oh": 1}}, "rs_ohm"),
    ),
)
def test_a_wrong_environment_is_refused_in_one_line(more, words):
    with pytest.raises(InputError) as refused:
        SixPhaseDrive(**more)
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("options", (
    {"speed": 1}, {"speed_rpm": "fast"}, {"references": []}, {"references": [(1.0, 2.0)]},
    {"references": [(0.0, float("nan"))]}, {"references": 3},
))  # fmt: skip
def test_wrong_options_are_refused(options):
    with pytest.raises(InputError, match="options"):
        SixPhaseDrive().reset(options=options)


@pytest.mark.parametrize(("level", "action"), (
    ("switching", 64), ("switching", -1), ("switching", 1.5), ("voltage", np.zeros(3)),
    ("voltage", np.array([0, 0, np.nan, 0])), ("torque", 0.5),
))  # fmt: skip
def test_a_wrong_action_is_refused(level, action):
    env = SixPhaseDrive(level=level, episode_s=0.01)
    with pytest.raises(InputError, match="reset"):
        env.step(0)
    env.reset(seed=1)
    with pytest.raises(InputError, match="action"):
        env.step(action)


def equal(one, other):
    """Whether two results are the same: arrays, and infos by name."""
    if isinstance(one, dict):
        return sorted(one) == sorted(other) and all(equal(one[name], other[name]) for name in one)
    return one.dtype == other.dtype and np.array_equal(one, other)


@pytest.mark.parametrize(("mode", "more"), ((None, {"cores": 2}), ("async", {})))
@pytest.mark.parametrize("level", IDS)
def test_many_in_processes_are_many_in_one(level, mode, more):
    """Also beyond the end of an episode, and where one of them trips."""
    given = {"num_envs": 3, "episode_s": 0.004, "set": {"controller.i_trip_A": 6.0}}
    alone = gymnasium.make_vec(IDS[level], vectorization_mode="sync", **given)
    many = gymnasium.make_vec(IDS[level], vectorization_mode=mode, **given, **more)
    try:
        assert many.action_space == alone.action_space
        assert many.observation_space == alone.observation_space
        options = {"references": [(0.0, 0.5)]}
        results = [envs.reset(seed=3, options=options) for envs in (alone, many)]
        assert all(map(equal, *results))
        many.action_space.seed(5)
        trips = 0
        for _ in range(60):
            actions = many.action_space.sample()
            results = [envs.step(actions) for envs in (alone, many)]
            assert all(map(equal, *results))
            trips += results[0][2].any()
        assert bool(trips) == (level != "torque")  # the scheme limits the current
    finally:
        many.close()


def test_what_many_cannot_do_is_told_in_one_line():
    with pytest.raises(InputError, match=r"^num_envs = 0: a whole number from 1 on is needed$"):
        hexatorque.gym.Many(0)
    with pytest.raises(InputError, match=r"^level = 'best'"):
        hexatorque.gym.Many(2, level="best")
    many = hexatorque.gym.Many(2, cores=2)
    with pytest.raises(InputError, match="options"):
        many.reset(options={"speed": 1})
    seen, _ = many.reset(seed=1)  # the line is in step again
    assert seen.shape == many.observation_space.shape
    many.close()


def test_the_package_alone_does_not_import_gymnasium():
    import subprocess
    import sys

    code = "import hexatorque, sys; hexatorque.SimulatedDrive; print('gymnasium' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert found.stdout.split() == ["False"]
    assert hexatorque.gym.IDS
