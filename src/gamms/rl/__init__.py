"""Learning: the games of a scenario as environments of PettingZoo and Gymnasium.

    env = gamms.rl.parallel_env(gamms.scenario.load("tag.yaml"), team="red")

`learners.py` has the learning agents in the games of a batch, as arrays; read it first. `team_env.py` (PettingZoo:
several agents in one game) and `gym_envs.py` (Gymnasium: one agent, or many games) are built on it; `processes.py`
plays many games in several processes. `interface.py` has the common parts of environments: spaces, pictures and copies.
`turns.py` has turns for rewards and for copies, `heads.py` decodes actions, `deeds.py` lists declared deeds, `sb3.py`
is for Stable-Baselines3, `tensor_env.py` for TorchRL, `observations.py` has observations of nodes, `policies.py` saves
and plays trained policies, and `networks.py` computes their answers. `evaluation.py` compares strategies on maps
against opponents, and `populations.py` plays the strategies of two teams against each other. `environments.py` has the
functions that users call, and the names for `gymnasium.make`. A client of scenarios, batches and experiments: May
import: `experiment` and below. To add an observation or a reward write a function of arrays: see docs/learning.md.
"""

from importlib.util import find_spec

from gamms.errors import suggest_names as _suggest_names
from gamms.rl.environments import parallel_env, sb3_env, single_agent_env, torchrl_env, vector_env
from gamms.rl.evaluation import Evaluation, evaluate
from gamms.rl.learners import Learners, Observation, Reward, default_observation, straight_observation
from gamms.rl.observations import graph, neighbourhood, pursuit_observation
from gamms.rl.policies import FOR_SCENARIOS as FOR_SCENARIOS
from gamms.rl.policies import opponents, policy, save_policy, trained_pursuers
from gamms.rl.populations import Population, ppo_learner
from gamms.rl.turns import Turn

__all__ = [
    "Evaluation",
    "Learners",
    "Observation",
    "Population",
    "Reward",
    "Turn",
    "default_observation",
    "evaluate",
    "graph",
    "neighbourhood",
    "opponents",
    "parallel_env",
    "policy",
    "ppo_learner",
    "pursuit_observation",
    "save_policy",
    "sb3_env",
    "single_agent_env",
    "straight_observation",
    "torchrl_env",
    "trained_pursuers",
    "vector_env",
]

_suggest_names(__name__, __all__)

if find_spec("gymnasium") is not None:
    from gamms.rl.environments import register

    register()
