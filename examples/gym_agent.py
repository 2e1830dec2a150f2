"""An agent for the environment `hexatorque/Voltage-v0`: three numbers, found by the cross-entropy
method in less than a minute. python examples/gym_agent.py [SET-UP]

The agent turns the stator flux as fast as it sees it turn, and adds a voltage along the flux for
its length, one across it for the torque, and one against the x-y current. The three numbers are the
gains of these. Each candidate drives the same episode; the best quarter says where the next ones
are drawn.
"""

import sys

import gymnasium
import numpy as np

import hexatorque.gym

EPISODES, CANDIDATES, ROUNDS = 1, 8, 4


def score(env: gymnasium.Env, gains: np.ndarray, seeds: range) -> float:
    """Mean reward of a step, over whole episodes."""
    length, torque, xy = gains
    rewards = []
    for seed in seeds:
        seen, _ = env.reset(seed=seed)
        flux, over = complex(seen[3], seen[4]), False
        while not over:
            before, flux = flux, complex(seen[3], seen[4])
            turn = flux * before.conjugate()  # since the step before
            along = flux / max(abs(flux), 1e-3)
            feed = 1j * flux * turn.imag / max(abs(turn), 1e-3)
            v = feed / FLUX_PER_STEP + along * (
                length * (1 - abs(flux)) + 1j * torque * (seen[0] - seen[2])
            )
            action = np.array([v.real, v.imag, -xy * seen[7], -xy * seen[8]], np.float32)
            seen, reward, tripped, ended, _ = env.step(np.clip(action, -1, 1))
            rewards.append(reward)
            over = tripped or ended
    return float(np.mean(rewards))


setup = sys.argv[1] if len(sys.argv) > 1 else "paper-a-feasible"
env = gymnasium.make("hexatorque/Voltage-v0", setup=setup, episode_s=0.1)
drive = env.unwrapped.setup
#: What an action of 1 adds to the flux in a step, in units of the flux reference.
FLUX_PER_STEP = (
    hexatorque.gym.environment.VOLTAGE_PU * drive["inverter.vdc_V"]
    / (drive.parameter("f_isr_Hz") * drive.parameter("flux_ref_Wb"))
)  # fmt: skip

draw = np.random.default_rng(1)
mean, spread = np.log([5.0, 0.5, 1.0]), np.full(3, 1.0)
found = (-np.inf, np.exp(mean))
for number in range(ROUNDS):
    candidates = np.exp(mean + spread * draw.normal(size=(CANDIDATES, 3)))
    scores = [score(env, gains, range(EPISODES)) for gains in candidates]
    order = np.argsort(scores)
    found = max(found, (scores[order[-1]], candidates[order[-1]]), key=lambda one: one[0])
    best = np.log(candidates[order[-CANDIDATES // 4 :]])
    mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05
    print(f"round {number + 1}: best so far {found[0]:.4f}, gains {found[1].round(3)}", flush=True)
again = range(100, 103)
nothing = score(env, np.zeros(3), again)
print(f"other episodes: {score(env, found[1], again):.4f}; without gains {nothing:.4f}")
