"""The scenarios that come with GAMMS, as environments that `gymnasium.make` and `gymnasium.make_vec` know by name."""

import atexit
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium

from gamms.rl.environments import single_agent_env, vector_env
from gamms.scenario import Scenario, load

if TYPE_CHECKING:
    from gamms.rl.gym_envs import AgentEnv, GamesEnv

_FOLDER = Path(__file__).parent.parent / "data"


class Shipped(NamedTuple):
    """A scenario that comes with GAMMS.

    Attributes:
        name: of its file.
        agent: that learns, unless another one is named.
        code: of its own: the name of a file -> that of the one that comes with GAMMS.
    """

    name: str
    agent: str = "red_0"
    code: tuple[tuple[str, str], ...] = ()


_COMPETITION = (("strategies.py", "competition.py.txt"), ("rules.py", "competition_rules.py.txt"))
IDS = {
    "gamms/GridTag-v0": Shipped("grid_tag.yaml"),
    "gamms/HelsinkiPursuit-v0": Shipped("helsinki_pursuit.yaml"),
    "gamms/CaptureTheFlag-v0": Shipped("capture_the_flag.yaml"),
    "gamms/Pursuit-v0": Shipped("pursuit.yaml", "pursuers_0", (("strategies.py", "pursuit.py.txt"),)),
    "gamms/Competition-v0": Shipped("competition.yaml", "attackers_0", _COMPETITION),
}


def register() -> None:
    """Let Gymnasium know the environments."""
    for name in IDS:
        if name not in gymnasium.registry:
            gymnasium.register(
                name, entry_point="gamms.rl.ids:make", vector_entry_point="gamms.rl.ids:make_vec", kwargs={"id": name}
            )


def scenario(name: str) -> Scenario:
    """Return the scenario of an environment, by its name."""
    shipped = IDS[name]
    return load((_folder(shipped) if shipped.code else _FOLDER) / shipped.name)


@cache
def _folder(shipped: Shipped) -> Path:
    """Return a folder that has a scenario and its code until the program ends."""
    folder = Path(mkdtemp(prefix="gamms-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    for file, source in ((shipped.name, shipped.name), *shipped.code):
        (folder / file).write_bytes((_FOLDER / source).read_bytes())
    return folder


def make(id: str, agent: str | None = None, **options: Any) -> "AgentEnv":
    """Return the environment of one agent; `options` are those of `single_agent_env`."""
    return single_agent_env(scenario(id), agent=agent or IDS[id].agent, **options)


def make_vec(id: str, num_envs: int, agent: str | None = None, **options: Any) -> "GamesEnv":
    """Return so many games; `options` are those of `vector_env`."""
    return vector_env(scenario(id), num_games=num_envs, agent=agent or IDS[id].agent, **options)
