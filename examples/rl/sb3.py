"""Two pursuers learn to catch an evader with Stable-Baselines3: one policy for both, on hundreds of games at once.

    python examples/rl/sb3.py                # trains, then plays 500 games that it has not seen against `chase`
    python examples/rl/sb3.py --record pursuit.ggr && gamms render pursuit.ggr pursuit.mp4

What they observe and get is in pursuit.py, as for ppo.py.
"""

import torch
from pursuit import SCENARIO, compare, observe, options_of, reward
from sb3_contrib import MaskablePPO

from gamms import rl

TURNS = 32  # of each game in an iteration


def train(seed, file, iterations, games):
    """Train a policy with one seed, and save it."""
    env = rl.sb3_env(SCENARIO, num_games=games, team="red", observation=observe, reward=reward, seed=seed)
    model = MaskablePPO(
        "MultiInputPolicy",
        env,
        n_steps=TURNS,
        batch_size=env.num_envs * TURNS // 4,
        n_epochs=4,
        learning_rate=7e-4,
        ent_coef=0.02,
        gamma=0.99,
        seed=seed,
        device="cpu",
        **env.rollouts,
    )
    model.learn(iterations * TURNS * env.num_envs)
    rl.save_policy(model, file, env)
    env.close()


if __name__ == "__main__":
    given = options_of(__doc__, iterations=60, games=256)
    torch.set_num_threads(1)  # small networks are faster so, and the same seed gives the same policy
    compare(lambda seed, file: train(seed, file, given.iterations, given.games), given)
