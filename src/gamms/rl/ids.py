"""The scenarios that come with GAMMS, registered for `gymnasium.make` and `gymnasium.make_vec`."""

from typing import TYPE_CHECKING, Any

import gymnasium

from gamms.rl.environments import single_agent_env, vector_env
from gamms.scenario import Scenario, from_gallery

if TYPE_CHECKING:
    from gamms.rl.gym_envs import AgentEnv, GamesEnv

IDS = {  # environment -> its game in the gallery, and its default learning agent
    "gamms/GridTag-v0": ("grid_tag", "red_0"),
    "gamms/HelsinkiPursuit-v0": ("helsinki_pursuit", "red_0"),
    "gamms/CaptureTheFlag-v0": ("capture_the_flag", "red_0"),
    "gamms/Pursuit-v0": ("pursuit", "pursuers_0"),
    "gamms/Competition-v0": ("competition", "attackers_0"),
}


def register() -> None:
    """Register the environments with Gymnasium."""
    for name in IDS:
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="gamms.rl.ids:make",
                vector_entry_point="gamms.rl.ids:make_vec",
                kwargs={"game": name},  # not `id`, which is an argument of `gymnasium.make` itself
            )


def scenario(name: str) -> Scenario:
    """Return the scenario of a registered environment."""
    return from_gallery(IDS[name][0])


def make(game: str, agent: str | None = None, **options: Any) -> "AgentEnv":
    """Return the environment of one agent; for `options` see `single_agent_env`."""
    return single_agent_env(scenario(game), agent=agent or IDS[game][1], **options)


def make_vec(game: str, num_envs: int, agent: str | None = None, **options: Any) -> "GamesEnv":
    """Return an environment of `num_envs` games; for `options` see `vector_env`."""
    return vector_env(scenario(game), num_games=num_envs, agent=agent or IDS[game][1], **options)
