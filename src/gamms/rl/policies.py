"""Policies in files: save them with the hashes of their scenario and spaces, and play them as strategies."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, NamedTuple, cast

import msgspec
import numpy as np

from gamms.arguments import as_bool, as_context, as_function_of, as_items, as_path, as_target
from gamms.errors import BadFile, BadType, BadValue, MissingFile
from gamms.folders import write_whole
from gamms.game.array_functions.declarations import array_strategy
from gamms.game.array_functions.view import ArrayView, count_actions, widen
from gamms.game.batch import list_digests
from gamms.game.block.columns import get_sensors
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import refuse_above
from gamms.plugins import require_extra
from gamms.rl.deeds import get_choices
from gamms.rl.heads import AXES, refuse_mixed
from gamms.rl.learners import (
    Float32Array,
    Learners,
    Moves,
    Observation,
    count_edge_actions,
    default_observation,
    limit_to_reach,
    straight_observation,
)
from gamms.rl.networks import Architecture, Logits, Network, add_metadata, load_onnx_logits, read_network
from gamms.rl.observations import pursuit_observation
from gamms.rl.turns import Turn
from gamms.scenario import Scenario
from gamms.sensor.catalog import KINDS
from gamms.strategies import pool
from gamms.text import find_module, shown
from gamms.typing import IAgent, IContext
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import ISensor

Maker = Callable[[IContext], Callable[[Any], None]]

_PURSUIT = Path(__file__).parents[1] / "data" / "pursuit.safetensors"
_KEY = "gamms"  # key in the metadata of a file
_WITHOUT_ROADS = "default"  # the name of `straight_observation`, which was the default when files were first written
_NAMED: Mapping[str, Observation] = {
    _WITHOUT_ROADS: straight_observation,
    "default with roads": default_observation,
    "pursuit": pursuit_observation,
}
_MOST_METADATA = 1 << 18  # bytes
_MOST_MAPS = 2048  # whose digests fit into the metadata
_TURNING = ("orientation", "quat", "at")  # settings of sensors that depend on the map, or change during a game
_TIMES_SIZE = 8  # of a file: memory for its weights in 64 bits, and for reading them
_PICKLES = (".zip", ".pt", ".pth", ".pkl")
_BY_SUFFIX = (".safetensors", ".onnx", *_PICKLES)

Count = Annotated[int, msgspec.Meta(ge=1, le=1 << 24)]
_Text = Annotated[str, msgspec.Meta(max_length=500)]


class PolicySpaces(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The observation and action spaces of a policy.

    Attributes:
        observation: the shape of one agent's observation.
        actions: the number of actions.
        function: the observation function: its module and name; or "pursuit", "default with roads", or "default",
            which is the default observation without distances by road.
        deeds: the number of deed choices; 0: no deeds are declared.
        flies: whether it is for flying agents, whose actions are three numbers: see `heads`.
        legal: for flying agents, and where actions take edges, the number of legal nodes that the default observation
            has entries for; else 0.
        edges: True: actions take edges, by the numbers of legal edges, from 1. Other files do not have it.
    """

    observation: Annotated[list[Count], msgspec.Meta(max_length=8)]
    actions: Count
    function: _Text = _WITHOUT_ROADS
    deeds: Annotated[int, msgspec.Meta(ge=0, le=1 << 16)] = 0
    flies: bool = False
    legal: Annotated[int, msgspec.Meta(ge=0, le=1 << 24)] = 0
    edges: bool | msgspec.UnsetType = msgspec.UNSET

    @property
    def numbers(self) -> int:
        """The number of outputs of a network: one for each action and each deed choice."""
        return self.actions + self.deeds

    @property
    def digest(self) -> str:
        """The SHA-256, in hexadecimal."""
        named = msgspec.structs.asdict(self)
        for name in [name for name in ("deeds", "flies", "legal", "edges") if named[name] in (0, msgspec.UNSET)]:
            del named[name]
        return hashlib.sha256(msgspec.json.encode(named)).hexdigest()


class Equipment(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The speed and the sensors of an agent.

    Attributes:
        speed: the speed; None: along one edge in a turn.
        sensors: name -> the type of the sensor, and for a built-in one the digest of its settings, without those
            that depend on the map or change during a game.
    """

    speed: float | None
    sensors: Annotated[dict[_Text, _Text], msgspec.Meta(max_length=100)]

    @classmethod
    def from_agent(cls, agent: IAgent) -> "Equipment":
        """Return the equipment of an agent."""
        sensors = {name: _describe_sensor(sensor) for name, sensor in sorted(get_sensors(agent).items())}
        return cls(None if agent.speed is None else float(agent.speed), sensors)

    def is_same(self, other: "Equipment") -> bool:
        """Return whether other equipment is the same, as far as the settings of its sensors are known."""
        if self.speed != other.speed or self.sensors.keys() != other.sensors.keys():
            return False
        pairs = [(one, other.sensors[name]) for name, one in self.sensors.items()]
        return all(mine.startswith(theirs) or theirs.startswith(mine) for mine, theirs in pairs)


def _describe_sensor(sensor: ISensor) -> str:
    """Return the type of a sensor, and for a built-in one the digest of its settings."""
    kind = KINDS.get(sensor.type)
    name: str = sensor.type.name
    if kind is None or not kind.is_of(sensor):
        return f"{name} "
    settings = [item for item in sorted(kind.list_keywords(sensor).items()) if item[0] not in _TURNING]
    return f"{name} {hashlib.sha256(repr(settings).encode()).hexdigest()[:16]}"


class PolicyDescription(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The description of a policy in its file.

    Attributes:
        version: the version of this format.
        scenario: the name of the scenario.
        digests: the digests of the scenario's parts; see `Scenario.digests`. The rules' digest decides where the policy
            may play.
        spaces: the spaces.
        spaces_digest: the digest of the spaces.
        teams: the teams that it was trained for.
        agent: the only agent that it was trained for.
        network: the architecture of the weights in a safetensors file.
        maps: the digest of each map that it was trained on; see `Scenario.digests`. Empty in files of older versions,
            for which `digests` has the only map.
        equipment: the sensors and the speeds with which agents were trained. Empty in files of older versions, for
            which the digest of the scenario's sensors decides.
    """

    scenario: _Text
    digests: Annotated[dict[_Text, _Text], msgspec.Meta(max_length=100)]
    spaces: PolicySpaces
    spaces_digest: _Text
    teams: Annotated[list[_Text], msgspec.Meta(max_length=1000)]
    agent: _Text | None = None
    network: Architecture | None = None
    maps: Annotated[list[_Text], msgspec.Meta(max_length=_MOST_MAPS)] = []
    equipment: Annotated[list[Equipment], msgspec.Meta(max_length=1000)] = []
    version: Annotated[int, msgspec.Meta(ge=1, le=1)] = 1


def save_policy(  # noqa: PLR0913 - those of the environments
    model: Any,
    path: object,
    env: object,
    *,
    team: str | None = None,
    agent: str | None = None,
    observation: Observation | None = None,
    shared: int | None = None,
    maps: Sequence[Any] | Mapping[str, Any] | None = None,
    moves: Moves | None = None,
) -> None:
    """Write a trained policy into a file, with the hashes of its scenario and spaces.

    Args:
        model: for a file `.safetensors`, a model of Stable-Baselines3, an `nn.Sequential` of PyTorch that gives a
            number for each action, or its layers as a list of pairs of arrays, weight (out, in) and bias (out,), and
            names of functions such as "tanh"; for a file `.onnx`, the path of an ONNX model that takes `observation`.
        path: the file, which is replaced.
        env: the environment of the training; or a scenario, with `team`, `agent`, `observation`, `maps` and `moves`.
        team: the team that was trained; None: all.
        agent: the only agent that was trained.
        observation: see `parallel_env`.
        shared: for a network that returns a single number and is evaluated for each action: the number of first entries
            of an observation that all actions share, which the entries of the action follow. None: the network returns
            numbers for all actions.
        maps: the maps of the training, if they were several; see `Scenario.batch`.
        moves: see `parallel_env`; None: "nodes".

    Raises:
        BadType: the model has other layers, or the environment is not one of gamms.rl.
        BadValue: the model does not fit the environment, or the file has another suffix.
        MissingExtra (ImportError): the library of the file is not installed.
    """
    file = as_target(path)
    if file.suffix not in _BY_SUFFIX[:2]:
        raise BadValue(f"A policy is saved as .safetensors or .onnx, not as {shown(file.name)}.")
    if isinstance(env, Scenario):
        options: dict[str, Any] = {"observation": observation, "maps": maps, "moves": moves or "nodes"}
        with Learners(env, teams=team, agent=agent, reward=_give_no_reward, **options) as learners:
            found = _describe(learners)
    elif any(one is not None for one in (team, agent, observation, maps, moves)):
        raise BadValue(
            "team=, agent=, observation=, maps= and moves= are for a scenario: an environment knows its own."
        )
    else:
        found = _describe(_find_learners(env))
    if file.suffix == ".onnx":
        _save_onnx(model, file, found)
        return
    with require_extra("A policy in safetensors", "rl"):
        from safetensors.numpy import save
    network = read_network(model, shared)
    network.check(_count_entries(found.spaces), found.spaces.numbers)
    described = msgspec.structs.replace(found, network=network.architecture)
    weights = {name: np.ascontiguousarray(one) for name, one in network.weights.items()}
    write_whole(file, save(weights, {_KEY: msgspec.json.encode(described).decode()}), through_links=True)


def policy(
    path: object,
    *,
    observation: Observation | None = None,
    sample: bool = False,
    trusted: bool = False,
    other_scenario: bool = False,
) -> Maker:
    """Return a saved policy as a strategy: `scenario.play(strategies={"red": gamms.rl.policy("red.safetensors")})`.

    It is made in a context, like the strategies of `gamms.strategies`: `policy(path)(ctx)`. In batches it works on
    arrays, and plays the same games. It plays on every map on which agents have at most as many legal nodes as on the
    maps of its training, or on any map if the network is `shared`; see `save_policy`.

    Args:
        path: a file written by `save_policy`; or, with `trusted`, a model of Stable-Baselines3 (`.zip`) or of PyTorch
            (`.pt`, `.pth`).
        observation: the observation function of the training; None: the default of the version that wrote the file.
            Pickles do not name it: give `straight_observation` for those of versions without distances by road.
        sample: draw actions by their probabilities, repeatably by the seed; else take the best action.
        trusted: you trust the file to run any code. Pickles need it, because reading one runs code in it.
        other_scenario: allow rules, and sensors and speeds of the agents, other than those of the training, if the
            spaces are the same.

    Raises:
        BadFile: the file is not a policy, or is damaged.
        BadValue: the policy does not fit the observation; or later, when a strategy is made, the rules, or when it
            decides, the agents or the map.
        MissingFile (FileNotFoundError): the file does not exist.
        MissingExtra (ImportError): the library of the file is not installed.
    """
    if observation is not None:
        as_function_of(observation, "observation", "a view")
    loaded = _load_policy(as_path(path, "path"), as_bool(trusted, "trusted"))
    player = _PolicyOptions(loaded, observation, as_bool(sample, "sample"), as_bool(other_scenario, "other_scenario"))
    return _make_factory(player)


def opponents(
    members: Iterable[Any] | Mapping[str, Any],
    weights: Iterable[float] | None = None,
    *,
    observation: Observation | None = None,
    sample: bool = False,
    other_scenario: bool = False,
) -> Maker:
    """Return a pool of opponents, of which each team draws one for each game; see `gamms.strategies.pool`.

    `rl.vector_env(scenario, num_games=64, team="red", others={"blue": rl.opponents(["early.safetensors", flee])})`.

    Args:
        members: strategies, functions that make them in a context, and paths of saved policies; or name -> one of
            these.
        weights: the weight of each member, proportional to its probability; None: all are equal.
        observation: the observation function of the saved policies; see `policy`.
        sample: whether they draw their actions; see `policy`.
        other_scenario: whether they play with other rules, sensors and speeds; see `policy`.

    Raises:
        BadFile, MissingFile: a path is not that of a policy.
        BadType, BadValue: see `gamms.strategies.pool` and `policy`.
    """

    def load(member: object) -> object:
        if not isinstance(member, str | PathLike):
            return member
        return policy(member, observation=observation, sample=sample, other_scenario=other_scenario)

    if isinstance(members, Mapping):
        return pool({name: load(one) for name, one in members.items()}, weights)
    return pool([load(one) for one in as_items(members, "members", "strategies and paths of policies")], weights)


def played_policy(
    ctx: IContext,
    path: str,
    observation: Observation | None = None,
    sample: bool = False,
    other_scenario: bool = False,
) -> Callable[[Any], None]:
    """Return the strategy for a scenario file: `{function: gamms.rl:policy, with: {path: red.safetensors}}`.

    A scenario file cannot trust a pickle.
    """
    return policy(path, observation=observation, sample=sample, other_scenario=other_scenario)(ctx)


played_policy.files = ("path",)  # type: ignore[attr-defined] # which scenarios look for in their folders


def trained_pursuers(ctx: IContext) -> Callable[[Any], None]:
    """Make the strategy of pursuers of a trained policy that ships with GAMMS, for any map.

    It was trained in districts of cities, for two pursuers along one edge a turn, in turns with an exact evader, with
    full sight. It observes by `pursuit_observation`, and draws its actions by the game's seed. Its card, `pursuit.json`
    in the folder `data` of the package, has the maps of the training and the results in other cities.

    Args:
        ctx: the context of the game.

    Raises:
        MissingExtra (ImportError): safetensors is not installed.
    """
    return policy(_PURSUIT, sample=True, other_scenario=True)(ctx)


# -- playing ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _LoadedPolicy:
    """A policy read from a file; other processes read the file again."""

    file: Path
    described: PolicyDescription | None  # None: a pickle
    network: Network | None  # None: an ONNX model
    logits: Logits | None  # of an ONNX model

    def __reduce__(self) -> tuple[Any, ...]:
        return _load_policy, (self.file, self.file.suffix in _PICKLES)

    def __deepcopy__(self, _: object) -> "_LoadedPolicy":
        return self

    @property
    def is_shared(self) -> bool:
        """Whether its network is evaluated for each action."""
        return self.network is not None and self.network.architecture.shared is not None


class _PolicyOptions(NamedTuple):
    """A policy, and the options with which it plays."""

    policy: _LoadedPolicy
    observation: Observation | None
    sample: bool
    other_scenario: bool


def _make_factory(player: _PolicyOptions) -> Maker:
    """Return the factory of a policy's strategies."""
    play = _make_array_form(player)  # refuses an observation that does not fit
    make: Any = partial(_make_strategy, player=player)  # which other processes can get, unlike a closure
    make.__name__ = make.__qualname__ = play.__name__
    return cast("Maker", make)


def _make_strategy(ctx: IContext, *, player: _PolicyOptions) -> Callable[[Any], None]:
    """Return the strategy of a policy in a context."""
    as_context(ctx, "A policy")
    described = player.policy.described
    if described is not None and not player.other_scenario:
        _refuse_other_rules(player.policy.file, described, cast("HostContext", ctx))
    return array_strategy(_make_array_form(player))(ctx)


@lru_cache(maxsize=256)
def _make_array_form(player: _PolicyOptions) -> Any:
    """Return the array form of a policy, one for all agents, so that a batch evaluates them together."""
    loaded, given, sample, _ = player
    described = loaded.described
    needs = "" if described is None else described.spaces.function
    observe = given or _NAMED.get(needs, default_observation)
    if described is not None and needs not in _NAMED and given is None:
        raise BadValue(
            f"{loaded.file} was trained with the observation {needs}: give that to rl.policy(path, observation=…)."
        )
    of_each = getattr(observe, "of_each", False)
    alone = described is not None and described.agent is not None

    def play_policy(view: ArrayView) -> IntArray | FloatArray:
        if described is not None and not player.other_scenario:
            _refuse_other_equipment(loaded.file, described, view)
        by_edges = described is not None and described.spaces.edges is True
        legal = count_actions(view)
        view = widen(view, _count_actions(loaded, legal, flies=view.flies))
        num_actions = view.num_actions
        if by_edges:
            legal = count_edge_actions(view)
            num_actions = _count_edge_actions(loaded, legal)
        counts = 1 + (view["legal_edges"] >= 0).sum(axis=-1) if by_edges else view.counts
        if view.flies:
            return _choose_flight(player, observe, view)
        choices = get_choices(view, view["deeds"])
        deeds = 0 if choices is None else len(choices)
        heads = 1 if choices is None else 2
        actions = np.zeros((heads, *view.node.shape), np.int64)
        uniform = [view.draw.random() for _ in range(heads)] if sample else None
        for whole, columns in [(view, np.arange(len(view.agents)))] if of_each else _list_views(view, alone):
            rows = np.searchsorted(whole.agents, view.agents[columns])
            values = np.asarray(observe(whole))[:, rows]
            fitting = _fit(loaded, legal, num_actions, deeds, values.shape[2:])
            masks = [np.arange(fitting.actions) < np.where(view.mask, counts, 1)[..., None]]
            masks += [] if choices is None else [choices.compute_masks(view)]
            shape = masks[0].shape[0], len(columns)
            mask = np.concatenate(masks, axis=2)[:, columns].reshape(shape[0] * shape[1], -1)
            asked = view.mask[:, columns].ravel()
            logits = _evaluate(fitting.evaluate, values.reshape(-1, *values.shape[2:]), mask, asked)
            for head, part in enumerate(np.split(logits, [fitting.actions], axis=1)[:heads]):
                drawn = None if uniform is None else uniform[head][:, columns].ravel()
                actions[head][:, columns] = _choose_actions(part, drawn).reshape(shape)
        if choices is not None:
            choices.do(actions[1], view)
        return _take_edges(view, actions[0]) if by_edges else actions[0]

    play_policy.__name__ = f"policy({loaded.file.name!r})"
    play_policy.__qualname__ = play_policy.__name__
    return play_policy


def _take_edges(view: ArrayView, actions: IntArray) -> IntArray:
    """Make agents take the legal edges of these numbers, from 1; return the moves of the others, who stay."""
    edges = view["legal_edges"]
    if edges.shape[-1]:
        taken = np.take_along_axis(edges, np.maximum(actions - 1, 0)[..., None], axis=-1)[..., 0]
        view.take_edges(np.where(actions > 0, taken, -1))
    return np.zeros_like(actions)


def _choose_flight(player: _PolicyOptions, observe: Observation, view: ArrayView) -> FloatArray:
    """Return the flights of agents in a single game, decoded as in their environment."""
    if player.sample:
        raise BadValue("sample=True draws moves and deeds: agents that fly do what is best, without it.")
    if not getattr(observe, "of_each", False):
        raise BadValue(
            "To play flying agents, the observation of a policy must depend on each agent alone, and declare this: "
            "observation.of_each = True."
        )
    values = np.asarray(observe(view))
    choices = get_choices(view, view["deeds"])
    deeds = 0 if choices is None else len(choices)
    fitting = _fit(player.policy, AXES, AXES, deeds, values.shape[2:])
    mask = np.ones((len(view.agents), AXES + deeds), np.bool_)
    numbers = np.clip(fitting.evaluate({"observation": values[0], "action_mask": mask}), -1.0, 1.0)[None]
    if choices is not None:
        best = np.where(choices.compute_masks(view), np.nan_to_num(numbers[..., AXES:]), -np.inf).argmax(axis=2)
        choices.do(best, view)
    reach_m = np.array([view.roster.agents[number].speed or 0.0 for number in view.agents.tolist()])
    return limit_to_reach(numbers[..., :AXES].astype(np.float64), reach_m, view.node.shape)


def _list_views(view: ArrayView, alone: bool) -> Iterator[tuple[ArrayView, IntArray]]:
    """Yield the views that learners had in training, with the columns of the agents to decide for."""
    if alone:
        for column, number in enumerate(view.agents.tolist()):
            yield view.of(np.array([number])), np.array([column])
        return
    teams = view["team"]
    for team in dict.fromkeys(teams):
        columns = np.array([column for column, one in enumerate(teams) if one == team])
        yield view.of(view.roster.members(team)), columns


def _evaluate(network: Logits, values: Float32Array, mask: BoolArray, asked: BoolArray) -> Float32Array:
    """Return numbers for actions, (rows, actions): those of the network for the rows asked, 0 for others."""
    logits = np.where(mask, np.float32(0.0), np.float32(-np.inf))
    if asked.any():
        parts = {"observation": values[asked], "action_mask": mask[asked]}
        logits[asked] = np.where(mask[asked], network(parts), -np.inf)
    return logits


def _choose_actions(logits: Float32Array, uniform: FloatArray | None) -> IntArray:
    """Return an action for each row: the best one, or with numbers from 0 to 1, one drawn by its probability."""
    best: IntArray = logits.argmax(axis=1)
    if uniform is None:
        return best
    weights = np.exp((logits - logits.max(axis=1, keepdims=True)).astype(np.float64))
    sums = np.cumsum(weights, axis=1)
    drawn: IntArray = (sums <= uniform[:, None] * sums[:, -1:]).sum(axis=1)
    return np.where(np.isfinite(sums[:, -1]), np.minimum(drawn, logits.shape[1] - 1), best)


class _FittingPolicy(NamedTuple):
    """A policy that fits a game.

    Attributes:
        actions: the number of actions that it gives numbers for, at least as many as there are on the map.
        evaluate: its evaluation function.
    """

    actions: int
    evaluate: Logits


def _count_actions(loaded: _LoadedPolicy, legal: int, *, flies: bool) -> int:
    """Return the number of actions that observations have entries for, on a map with this number of legal nodes.

    Raises:
        BadValue: the policy does not fly where the agents do, or an agent may have more legal nodes than in training.
    """
    if loaded.described is None:
        return legal
    spaces = loaded.described.spaces
    if spaces.edges is True and not flies:
        return max(spaces.legal, legal)
    if flies != spaces.flies:
        where = ("on the ground", "that fly")
        raise BadValue(f"{loaded.file} was trained for agents {where[spaces.flies]}, not for those {where[flies]}.")
    known = spaces.legal or legal if flies else spaces.actions
    if legal > known and not loaded.is_shared:
        raise BadValue(
            f"{loaded.file} was trained on maps with at most {known} legal nodes of an agent, and here are {legal}: "
            "train it with maps= of which one has as many, or save a network for each action with shared=."
        )
    return max(known, legal)


def _count_edge_actions(loaded: _LoadedPolicy, here: int) -> int:
    """Return the number of actions by edges of a policy, on a map with this number.

    Raises:
        BadValue: the map has more.
    """
    assert loaded.described is not None  # noqa: S101 - it says that actions take edges
    known = loaded.described.spaces.actions
    if here > known and not loaded.is_shared:
        raise BadValue(
            f"{loaded.file} was trained on maps with at most {known - 1} edges from a node, and here are {here - 1}: "
            "train it with maps= of which one has as many, or save a network for each action with shared=."
        )
    return max(known, here)


@lru_cache(maxsize=64)
def _fit(loaded: _LoadedPolicy, legal: int, width: int, deeds: int, observed: tuple[int, ...]) -> _FittingPolicy:
    """Return a policy that fits a game.

    Args:
        loaded: the policy.
        legal: the largest number of legal actions on the map; for flying agents, the number of axes.
        width: the number of actions of the policy on the map.
        deeds: the number of deed choices.
        observed: the shape of one agent's observation.

    Raises:
        BadValue: its deeds or its observations differ from those of the training.
    """
    entries = int(np.prod(observed))
    actions = width
    network = loaded.network
    if loaded.described is not None:
        spaces = loaded.described.spaces
        fits = observed == tuple(spaces.observation)
        if network is not None and loaded.is_shared:
            number = network.count_actions(entries, _count_entries(spaces), spaces.numbers)
            actions = width if number is None else number - deeds
            fits = actions >= legal
        if deeds != spaces.deeds or not fits:
            raise BadValue(_explain_misfit(loaded.file, spaces, (width, deeds, observed)))
    if network is None:
        return _FittingPolicy(actions, cast("Logits", loaded.logits))
    try:
        network.check(entries, actions + deeds)
    except BadValue as error:
        raise BadValue(f"{loaded.file} does not fit this game: {error}") from None
    return _FittingPolicy(actions, network.make_logits(actions + deeds))


def _explain_misfit(file: Path, spaces: PolicySpaces, here: tuple[int, int, tuple[int, ...]]) -> str:
    """Return a message on a policy of other spaces than a game's: its actions, deeds and shape of observations."""
    actions, deeds, observed = here
    of_deeds = f" and {spaces.deeds} choices of deeds" if spaces.deeds else ""
    numbers = f"{actions} and {deeds}" if deeds else actions
    return (
        f"{file} was trained with {spaces.actions} actions{of_deeds} and observations of the shape "
        f"{tuple(spaces.observation)} ({spaces.function}); here are {numbers}, of the shape {observed}. Play it in "
        "games like those it was trained in, with observation= as it was."
    )


def _refuse_other_rules(file: Path, described: PolicyDescription, ctx: HostContext) -> None:
    """Refuse the rules of a scenario that a policy was not trained with; other games have no digests."""
    known = ctx.game.internals.digests
    if known is None:
        return
    digests = known()
    for part in ("rules",) if described.equipment else ("rules", "sensors"):
        if digests[part] != described.digests.get(part):
            scenario = f"the scenario {shown(described.scenario)}" if described.scenario else "a scenario"
            raise BadValue(
                f"{file} was trained in {scenario}, which has other {part} than this game: "
                "rl.policy(path, other_scenario=True) lets it play all the same."
            )


def _refuse_other_equipment(file: Path, described: PolicyDescription, view: ArrayView) -> None:
    """Refuse agents with sensors or speeds that a policy was not trained with."""
    for number in view.agents.tolist() if described.equipment else ():
        agent = view.roster.agents[number]
        here = Equipment.from_agent(agent)
        if not any(one.is_same(here) for one in described.equipment):
            raise BadValue(
                f"{file} was trained for agents with other sensors, or with another speed, than {shown(agent.name)} "
                "has: rl.policy(path, other_scenario=True) lets it play all the same."
            )


# -- files --------------------------------------------------------------------------------------------------------


def _load_policy(file: Path, trusted: bool) -> _LoadedPolicy:
    if file.suffix not in _BY_SUFFIX:
        raise BadFile(
            f"{file} is not a policy: policies are {', '.join(_BY_SUFFIX[:2])}, or, if you trust it, "
            f"{', '.join(_PICKLES)}."
        )
    if not file.is_file():
        raise MissingFile("a policy", file)
    if file.suffix in _PICKLES and not trusted:
        raise BadValue(
            f"{file} is a pickle, and reading one runs the code that is in it: rl.policy(path, trusted=True) if you "
            "know who made it. gamms.rl.save_policy writes files that are data alone."
        )
    status = file.stat()
    refuse_above(status.st_size * _TIMES_SIZE, f"The policy {file} of {status.st_size:,} bytes")
    return _read(file.absolute(), (status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=16)
def _read(file: Path, _stamp: tuple[int, int]) -> _LoadedPolicy:
    if file.suffix == ".onnx":
        logits, metadata = load_onnx_logits(file.read_bytes(), str(file))
        return _LoadedPolicy(file, _parse_description(metadata.get(_KEY), file), None, logits)
    if file.suffix in _PICKLES:
        return _LoadedPolicy(file, None, read_network(_unpickle(file)), None)
    with require_extra("A policy in safetensors", "rl"):
        from safetensors import SafetensorError, safe_open
    try:
        with safe_open(file, framework="numpy") as opened:
            kinds = {name: opened.get_slice(name).get_dtype() for name in opened.keys()}  # noqa: SIM118 - it is no dict
            others = sorted({kind for kind in kinds.values() if kind != "F32"})
            if others:
                raise BadFile(f"{file}: the weights of a policy are of the type F32, not {', '.join(others)}.")
            described = _parse_description((opened.metadata() or {}).get(_KEY), file)
            weights = {name: np.array(opened.get_tensor(name)) for name in kinds}
    except SafetensorError as error:
        raise BadFile(f"{file} is not a safetensors file, or is damaged: {error}.") from None
    if described.network is None:
        raise BadFile(f"{file} does not say what network its weights are of.")
    network = Network(described.network, weights)
    try:
        network.check(_count_entries(described.spaces), described.spaces.numbers)
    except BadValue as error:
        raise BadFile(f"{file} is damaged: {error}") from None
    return _LoadedPolicy(file, described, network, None)


def _parse_description(text: str | None, file: Path) -> PolicyDescription:
    """Return the description in the metadata of a file."""
    if text is None:
        raise BadFile(f"{file} has no metadata of GAMMS: gamms.rl.save_policy writes a policy with them.")
    if len(text) > _MOST_METADATA:
        raise BadFile(f"{file} has {len(text):,} bytes of metadata, more than {_MOST_METADATA:,}.")
    try:
        described = msgspec.json.decode(text, type=PolicyDescription)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise BadFile(f"{file} has metadata that GAMMS does not know: {error}.") from None
    if described.spaces.digest != described.spaces_digest:
        raise BadFile(f"{file} is damaged: the spaces that it names do not have the hash that it names.")
    return described


def _unpickle(file: Path) -> Any:
    """Return a model of Stable-Baselines3 or PyTorch; this runs the code in the file."""
    with require_extra(f"The policy {file}", "train"):
        if file.suffix == ".zip":
            from gamms.rl.sb3 import load_model

            return load_model(file)
        from torch import load

        return load(file, map_location="cpu", weights_only=False)


def _save_onnx(model: object, file: Path, found: PolicyDescription) -> None:
    source = as_path(model, "The model saved as .onnx")
    if not source.is_file():
        raise MissingFile("an ONNX model", source)
    data = source.read_bytes()
    logits, _ = load_onnx_logits(data, str(source))
    actions = found.spaces.numbers
    shape = found.spaces.observation
    given = {"observation": np.zeros((1, *shape), np.float32), "action_mask": np.ones((1, actions), np.float32)}
    made = logits(given).shape
    if made != (1, actions):
        raise BadValue(f"{source} gives numbers of the shape {made} for one agent, and (1, {actions}) are needed.")
    write_whole(file, add_metadata(data, _KEY, msgspec.json.encode(found).decode()), through_links=True)


# -- what was trained -----------------------------------------------------------------------------------------------


def _describe(learners: Learners) -> PolicyDescription:
    """Return the description of a policy trained by these learners."""
    refuse_mixed(learners, range(len(learners.names)), "a policy")
    shape = list(np.asarray(learners.observe()).shape[2:])
    function = learners.observation
    name = f"{find_module(function)}:{getattr(function, '__qualname__', type(function).__name__)}"
    named = next((known for known, one in _NAMED.items() if one is function), name[:500])
    flies = learners.all_fly
    actions = AXES if flies else learners.num_actions
    deeds = 0 if learners.deeds is None else len(learners.deeds)
    by_edges = learners.by_edges and not flies
    legal = learners.num_legal if flies or by_edges else 0
    spaces = PolicySpaces(shape, actions, named, deeds, flies, legal, by_edges or msgspec.UNSET)
    digests = list_digests(learners.games)
    if len(digests) > _MOST_MAPS:
        raise BadValue(
            f"A policy lists at most {_MOST_MAPS:,} maps of its training, not {len(digests):,}: save it with a "
            "scenario and some of them, rl.save_policy(model, path, scenario, team=…, maps=[…])."
        )
    number_of = {name: number for number, name in enumerate(learners.games.roster.names)}
    agents = [learners.games.roster.agents[number_of[name]] for name in learners.names]
    return PolicyDescription(
        learners.scenario.spec.name,
        digests[0],
        spaces,
        spaces.digest,
        list(map(str, learners.teams)),
        learners.agent,
        maps=list(dict.fromkeys(one["map"] for one in digests)),
        equipment=_remove_copies(Equipment.from_agent(agent) for agent in agents),
    )


def _remove_copies(found: Iterable[Equipment]) -> list[Equipment]:
    """Return different equipment, in the order of the agents."""
    different: list[Equipment] = []
    for one in found:
        if one not in different:
            different.append(one)
    return different


def _find_learners(env: Any) -> Learners:
    """Return the learners of an environment, inside any wrappers."""
    inner = env
    for _ in range(100):
        known = inner if isinstance(inner, Learners) else getattr(inner, "learners", None)
        if isinstance(known, Learners):
            return known
        inner = next((one for one in _list_wrapped_environments(inner) if one is not None and one is not inner), None)
        if inner is None:
            break
    raise BadType(f"env must be an environment of gamms.rl, or a scenario, not {shown(env)}.")


def _list_wrapped_environments(env: object) -> Iterator[Any]:
    """Yield the environments that an environment may wrap."""
    for name in ("venv", "env", "unwrapped", "par_env", "aec_env"):
        yield getattr(env, name, None)
    yield next(iter(getattr(env, "envs", ())), None)


def _count_entries(spaces: PolicySpaces) -> int:
    return int(np.prod(spaces.observation))


def _give_no_reward(turn: Turn) -> FloatArray:
    return np.zeros(turn.after.node.shape)


FOR_SCENARIOS: Mapping[str, Callable[..., Any]] = {"policy": played_policy, "trained_pursuers": trained_pursuers}
