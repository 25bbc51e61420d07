"""Functions that make environments from a scenario."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_count, explain_call_errors
from gamms.errors import BadValue
from gamms.game.batch import MostAgents
from gamms.plugins import require_extra
from gamms.rl.learners import Learners, Moves, Observation, Reward
from gamms.scenario import Scenario, from_gallery
from gamms.workers import refuse_in_worker

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode

    from gamms.rl.gym_envs import AgentEnv, GamesEnv
    from gamms.rl.interface import ActionForm, MaskPlace, RenderMode
    from gamms.rl.sb3 import SlotsEnv
    from gamms.rl.team_env import TeamEnv
    from gamms.rl.tensor_env import TensorEnv


@explain_call_errors
def parallel_env(  # noqa: PLR0913 - what a game is, who learns in it, and what they get
    scenario: Scenario,
    *,
    team: str | Sequence[str] | None = None,
    others: Mapping[str, Any] | None = None,
    observation: Observation | None = None,
    reward: Reward | None = None,
    seed: int = 0,
    most_agents: MostAgents | None = None,
    mask: "MaskPlace" = "observation",
    actions: "ActionForm" = "pair",
    render_mode: "RenderMode" = None,
    maps: Sequence[Any] | Mapping[str, Any] | None = None,
    moves: Moves = "nodes",
) -> "TeamEnv":
    """Return a scenario as a `pettingzoo.ParallelEnv`, in which the agents of a team learn.

    The observation of an agent is `{"observation": numbers, "action_mask": (actions,)}`. Action k goes to the k-th node
    of `state["legal"]`; 0 stays, and so does an illegal action. If the scenario declares deeds, actions are pairs of a
    move and a deed, and masks cover both. Flying agents have a `Box` without a mask. Other teams play their own
    strategies.

    Args:
        scenario: see `gamms.scenario.load`.
        team: the learning team, or several; None: all.
        others: strategies of other agents and teams, which replace the scenario's; `env.set_others` changes them.
        observation: maps an `ArrayView` to numbers for the agents of a team, (games, agents, …); None:
            `default_observation`.
        reward: maps a `Turn` to numbers, (games, agents) or (games,); None: the change of the score of the team.
        seed: the seed of the run, from which the seeds of all its games are derived; runs share no game. The seeds of
            games are 2 ** 62 and larger: test with smaller ones. `reset(seed=[7])` begins the game of `play(seed=7)`.
        most_agents: the most agents of each team over a game, or team -> number or names; docs/batches.md. Agents that
            a rule creates take these names, and learn with their team.
        mask: "observation": observations are dicts with the mask; "info": observations are numbers alone, in a plain
            `Box`, and masks are in the infos.
        actions: "pair": with deeds, an action is a pair of a move and a deed; "discrete": an action is a single number,
            `move * deeds + deed`, with at most 4,096 values.
        render_mode: "rgb_array": `render` returns pictures; "human": a window shows the game; None: neither.
        maps: several maps instead of that of the scenario; the seed of each game draws one; see `Scenario.batch`.
        moves: "nodes": as above; "edges": action k takes the k-th edge of `state["legal_edges"]`, from 1, and 0 is
            action 0 of "nodes".

    Raises:
        UnknownName (KeyError): the team does not exist.
        BadType, BadValue: an argument has a wrong type or value; or no rule gives scores, and no reward is given.
        MissingExtra (ImportError): PettingZoo is not installed.
    """
    with require_extra("An environment of PettingZoo", "rl"):
        from gamms.rl.interface import EnvInterface, EnvRecipe, choose_engine
        from gamms.rl.team_env import TeamEnv
    window = choose_engine(render_mode)
    games: dict[str, Any] = {
        "others": others,
        "observation": observation,
        "reward": reward,
        "seed": seed,
        "most_agents": most_agents,
        "maps": maps,
        "moves": moves,
    }
    learners = Learners(scenario, teams=team, vis_engine=window, **games)
    with _close_on_error(learners):
        env = TeamEnv(EnvInterface(learners, mask, actions), scenario.spec.name, render_mode)
    form: dict[str, Any] = {"mask": mask, "actions": actions, "render_mode": render_mode}
    env.recipe = EnvRecipe(parallel_env, scenario, {"team": team, **games, **form})
    return env


@explain_call_errors
def single_agent_env(  # noqa: PLR0913 - as above
    scenario: Scenario,
    *,
    agent: str,
    others: Mapping[str, Any] | None = None,
    observation: Observation | None = None,
    reward: Reward | None = None,
    seed: int = 0,
    mask: "MaskPlace" = "observation",
    actions: "ActionForm" = "pair",
    render_mode: "RenderMode" = None,
    maps: Sequence[Any] | Mapping[str, Any] | None = None,
    moves: Moves = "nodes",
) -> "AgentEnv":
    """Return a scenario as a `gymnasium.Env`, in which one agent learns.

    Args:
        scenario: see `parallel_env`.
        agent: the learning agent.
        others: see `parallel_env`.
        observation: see `parallel_env`.
        reward: see `parallel_env`.
        seed: see `parallel_env`.
        mask: see `parallel_env`.
        actions: see `parallel_env`.
        render_mode: see `parallel_env`.
        maps: see `parallel_env`.
        moves: see `parallel_env`.

    Raises:
        UnknownName (KeyError): the agent does not exist.
        BadType, BadValue: see `parallel_env`.
        MissingExtra (ImportError): Gymnasium is not installed.
    """
    with require_extra("An environment of Gymnasium", "rl"):
        from gamms.rl.gym_envs import AgentEnv, make_spec
        from gamms.rl.interface import EnvInterface, EnvRecipe, choose_engine
    window = choose_engine(render_mode)
    games: dict[str, Any] = {
        "agent": agent,
        "others": others,
        "observation": observation,
        "reward": reward,
        "seed": seed,
        "maps": maps,
        "moves": moves,
    }
    learners = Learners(scenario, vis_engine=window, **games)
    with _close_on_error(learners):
        env = AgentEnv(EnvInterface(learners, mask, actions), scenario.spec.name, render_mode)
    options: dict[str, Any] = {**games, "mask": mask, "actions": actions}
    env.spec = make_spec(single_agent_env, scenario, options)
    env.recipe = EnvRecipe(single_agent_env, scenario, {**options, "render_mode": render_mode})
    return env


@explain_call_errors
def vector_env(  # noqa: PLR0913 - what a game is, who learns in it, and what they get
    scenario: Scenario,
    *,
    num_games: int,
    team: str | Sequence[str] | None = None,
    agent: str | None = None,
    others: Mapping[str, Any] | None = None,
    observation: Observation | None = None,
    reward: Reward | None = None,
    seed: int = 0,
    most_agents: MostAgents | None = None,
    mask: "MaskPlace" = "observation",
    actions: "ActionForm" = "pair",
    autoreset_mode: "AutoresetMode | str" = "SAME_STEP",
    render_mode: "RenderMode" = None,
    workers: int = 1,
    threads: int = 1,
    maps: Sequence[Any] | Mapping[str, Any] | None = None,
    moves: Moves = "nodes",
) -> "GamesEnv":
    """Return many games of a scenario as a `gymnasium.vector.VectorEnv`, with a slot for each game and learning agent.

    The compiled core plays the games if it supports all parts of the scenario (docs/batches.md). They equal the games
    of `parallel_env` with the same seeds.

    Args:
        scenario: see `parallel_env`.
        num_games: the number of games.
        team: see `parallel_env`.
        agent: the only learning agent, instead of a team.
        others: see `parallel_env`.
        observation: see `parallel_env`.
        reward: see `parallel_env`.
        seed: see `parallel_env`.
        most_agents: see `parallel_env`.
        mask: see `parallel_env`.
        actions: see `parallel_env`.
        autoreset_mode: when a finished game is reset, as `gymnasium.vector.AutoresetMode` or by its name: "SAME_STEP",
            "NEXT_STEP" or "DISABLED".
        render_mode: "rgb_array": `render` returns a picture for each slot, which is black for games other than game 0;
            "human": a window shows game 0; None: neither. Game 0 is then also played in a context of its own.
        workers: the number of processes, each of which plays a share of the games; 1: this process. The games do not
            depend on it. Functions are sent to the processes by the names of their modules, and get the games of one
            process. An error in a process is raised here and closes the environment, and so does the end of a process
            (`gamms.workers.WorkerDied`).
        threads: the number of threads of each process that play its games, if the core supports all their parts
            (docs/batches.md). The games do not depend on it.
        maps: several maps instead of that of the scenario; the seed of each game draws one; see `Scenario.batch`.
            `observation` and `reward` are called for the games of each map.
        moves: see `parallel_env`.

    Raises:
        UnknownName (KeyError): the team does not exist.
        BadType, BadValue: see `parallel_env`; or there are more processes than games.
        TooLarge: the games would not fit into memory.
        MissingExtra (ImportError): Gymnasium is not installed.
    """
    with require_extra("An environment of Gymnasium", "rl"):
        from gamms.rl.gym_envs import GamesEnv, parse_mode
        from gamms.rl.interface import EnvInterface, EnvRecipe, choose_engine, prepare
        from gamms.rl.processes import ProcessesEnv
    mode = parse_mode(autoreset_mode)
    window = choose_engine(render_mode)
    several = as_count(workers, "workers", least=1) > 1
    if several:
        refuse_in_worker()
        if workers > as_count(num_games, "num_games"):
            raise BadValue(f"workers is {workers}, and there are {num_games} games: at most one process for each.")
    games: dict[str, Any] = {
        "agent": agent,
        "others": others,
        "observation": observation,
        "reward": reward,
        "most_agents": most_agents,
        "threads": as_count(threads, "threads"),
        "maps": maps,
        "moves": moves,
    }
    options: dict[str, Any] = {"team": team, **games, "mask": mask, "actions": actions, "autoreset_mode": mode}
    counts: dict[str, Any] = {"num_games": num_games, "seed": seed, "workers": workers}
    played: dict[str, Any] = {"num_games": num_games, "vis_engine": window}
    if several:
        played = {"num_games": 1}
    learners = Learners(scenario, teams=team, seed=seed, **played, **games)
    with _close_on_error(learners):
        interface = EnvInterface(learners, mask, actions)
        if several:
            make = partial(vector_env, scenario, **options)
            env: GamesEnv = ProcessesEnv(interface, scenario.spec.name, mode, render_mode, **counts, make=make)
        else:
            prepare(learners, render_mode)
            env = GamesEnv(interface, scenario.spec.name, mode, render_mode)
    env.recipe = EnvRecipe(vector_env, scenario, {**options, "render_mode": render_mode, **counts})
    return env


def sb3_env(scenario: Scenario, *, num_games: int, **options: Any) -> "SlotsEnv":
    """Return many games of a scenario as a `VecEnv` of Stable-Baselines3, with a slot for each game and learning agent.

    Args:
        scenario: see `parallel_env`.
        num_games: the number of games.
        options: see `vector_env`; all but `autoreset_mode`, which Stable-Baselines3 decides.

    Raises:
        MissingExtra (ImportError): Stable-Baselines3 is not installed.
        UnknownName, BadType, BadValue, TooLarge: see `vector_env`.
    """
    with require_extra("An environment of Stable-Baselines3", "train"):
        from gamms.rl.sb3 import SlotsEnv
    if "autoreset_mode" in options:
        raise BadValue("sb3_env has no autoreset_mode: in a VecEnv of Stable-Baselines3, games begin in the same step.")
    return SlotsEnv(vector_env(scenario, num_games=num_games, **options))


@contextmanager
def _close_on_error(learners: Learners) -> Iterator[None]:
    """Close the learners if making an environment fails."""
    try:
        yield
    except BaseException:
        learners.close()
        raise


@explain_call_errors
def torchrl_env(  # noqa: PLR0913 - what environments are given
    scenario: Scenario,
    *,
    num_games: int,
    team: str | Sequence[str] | None = None,
    others: Mapping[str, Any] | None = None,
    observation: Observation | None = None,
    reward: Reward | None = None,
    seed: int = 0,
    most_agents: MostAgents | None = None,
    threads: int = 1,
    maps: Sequence[Any] | Mapping[str, Any] | None = None,
    moves: Moves = "nodes",
) -> "TensorEnv":
    """Return many games of a scenario as an `EnvBase` of TorchRL.

    Teams are groups: `(team, "observation")`, (games, agents, …), `(team, "action_mask")`, and so on. The tensors are
    on the CPU and share the memory of the games' arrays; `env.to("cuda")` copies them to a GPU in each turn. Functions
    for `observation` and `reward` get and return NumPy arrays.

    Args:
        scenario: see `parallel_env`.
        num_games: the number of games, which is the batch size.
        team: see `parallel_env`.
        others: see `parallel_env`.
        observation: see `parallel_env`.
        reward: see `parallel_env`.
        seed: see `parallel_env`.
        most_agents: see `parallel_env`.
        threads: see `vector_env`.
        maps: see `vector_env`.
        moves: see `parallel_env`.

    Raises:
        UnknownName (KeyError): the team does not exist.
        BadType, BadValue: see `parallel_env`.
        TooLarge: the games would not fit into memory.
        MissingExtra (ImportError): TorchRL is not installed.
    """
    with require_extra("An environment of TorchRL", "torchrl"):
        from gamms.rl.tensor_env import TensorEnv
    return TensorEnv(
        Learners(
            scenario,
            num_games,
            teams=team,
            others=others,
            observation=observation,
            reward=reward,
            seed=seed,
            most_agents=most_agents,
            threads=threads,
            maps=maps,
            moves=moves,
        )
    )


# -- the names for gymnasium.make ---------------------------------------------------------------------------------


IDS = {  # environment -> its game in the gallery, and its default learning agent
    "gamms/GridTag-v0": ("grid_tag", "red_0"),
    "gamms/HelsinkiPursuit-v0": ("helsinki_pursuit", "red_0"),
    "gamms/CaptureTheFlag-v0": ("capture_the_flag", "red_0"),
    "gamms/Pursuit-v0": ("pursuit", "pursuers_0"),
    "gamms/Competition-v0": ("competition", "attackers_0"),
}


def register() -> None:
    """Register the scenarios that come with GAMMS, for `gymnasium.make` and `gymnasium.make_vec`."""
    import gymnasium

    for name in IDS:
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="gamms.rl.environments:make_registered",
                vector_entry_point="gamms.rl.environments:make_registered_vec",
                kwargs={"game": name},  # not `id`, which is an argument of `gymnasium.make` itself
            )


def _load_registered(name: str) -> Scenario:
    """Return the scenario of a registered environment."""
    return from_gallery(IDS[name][0])


def make_registered(game: str, agent: str | None = None, **options: Any) -> "AgentEnv":
    """Return the environment of one agent; for `options` see `single_agent_env`."""
    return single_agent_env(_load_registered(game), agent=agent or IDS[game][1], **options)


def make_registered_vec(game: str, num_envs: int, agent: str | None = None, **options: Any) -> "GamesEnv":
    """Return an environment of `num_envs` games; for `options` see `vector_env`."""
    return vector_env(_load_registered(game), num_games=num_envs, agent=agent or IDS[game][1], **options)
