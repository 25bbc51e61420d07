"""The scenarios that come with GAMMS, as environments that `gymnasium.make` and `gymnasium.make_vec` know by name."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium

from gamms.rl.environments import single_agent_env, vector_env
from gamms.scenario import load

if TYPE_CHECKING:
    from gamms.rl.gym_envs import AgentEnv, GamesEnv

FOLDER = Path(__file__).parent.parent / "data"
IDS = {
    "gamms/GridTag-v0": "grid_tag.yaml",
    "gamms/HelsinkiPursuit-v0": "helsinki_pursuit.yaml",
    "gamms/CaptureTheFlag-v0": "capture_the_flag.yaml",
}
_AGENT = "red_0"  # that learns, unless another one is named


def register() -> None:
    """Let Gymnasium know the environments."""
    for name, file in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="gamms.rl.ids:make",
                vector_entry_point="gamms.rl.ids:make_vec",
                kwargs={"file": file},
            )


def make(file: str, agent: str = _AGENT, **options: Any) -> "AgentEnv":
    """Return the environment of one agent; `options` are those of `single_agent_env`."""
    return single_agent_env(load(FOLDER / file), agent=agent, **options)


def make_vec(file: str, num_envs: int, agent: str = _AGENT, **options: Any) -> "GamesEnv":
    """Return so many games; `options` are those of `vector_env`."""
    return vector_env(load(FOLDER / file), num_games=num_envs, agent=agent, **options)
