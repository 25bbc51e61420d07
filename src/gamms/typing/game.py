"""Data that programs and the turn engine exchange: states, actions, strategies, plans, rules, resolvers."""

import re
from collections.abc import Awaitable, Callable, Hashable, Mapping, Sequence
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Generic,
    Literal,
    NamedTuple,
    NotRequired,
    Protocol,
    TypedDict,
    TypeVar,
    overload,
)

import numpy as np

from gamms.core.ask import StateKey
from gamms.ir.agents import Position, Quat
from gamms.ir.graph import FloatArray
from gamms.plain import Plain
from gamms.text import find_module
from gamms.typing.sensor_engine import SensorType

if TYPE_CHECKING:
    from numpy.random import Generator


T = TypeVar("T")
PositionT = TypeVar("PositionT")  # where an agent is
ActionT = TypeVar("ActionT")  # the type of its actions

NodeId = int | np.integer[Any]
"""Any type accepted as a node id; returned ids are ints."""


class NodeAction(TypedDict):
    """An action of an agent on the ground: a move, a heading and deeds."""

    node_id: NotRequired[NodeId]
    """The target node. May be missing if there is `do`: then the agent stays."""
    do: NotRequired[Mapping[str, Any]]
    """Deeds, as declared by `ctx.game.deeds` -> the values of their fields."""
    orientation: NotRequired[tuple[float, float] | None]
    """The heading `(cos, sin)`, of any nonzero length; None: follow the moves again."""


class EdgeAction(TypedDict):
    """An action of an agent on the ground that names the edge that it takes, and deeds."""

    edge: NodeId
    """The id of an edge that begins on the agent's node, or that it is on: one of `state["legal_edges"]`."""
    do: NotRequired[Mapping[str, Any]]
    """Deeds, as declared by `ctx.game.deeds` -> the values of their fields."""
    orientation: NotRequired[tuple[float, float] | None]
    """The heading `(cos, sin)`, of any nonzero length; None: follow the moves again."""


class AerialAction(TypedDict, total=False):
    """An action of a flying agent: a move, a rotation and deeds."""

    do: Mapping[str, Any]
    """Deeds, as declared by `ctx.game.deeds` -> the values of their fields."""

    direction: Sequence[float] | FloatArray
    """The direction `(dx, dy, dz)`, of any length: the agent moves by its speed; all zeros: it stays."""
    distance: float
    """The distance to move in this direction, map units, from 0 to the speed; default: the speed."""
    quat: Sequence[float]
    """The new rotation `(w, x, y, z)`, of any length."""


Action = NodeId | Sequence[int] | NodeAction | EdgeAction
"""The action of an agent on the ground: a node id; with a speed also the list of nodes on the path, which is
illegal without a speed.

In games by metres also None: the agent stops where it is.
"""


class Draws(Protocol):
    """Random numbers of one agent; in every turn they depend only on the seed, the agent's name and the turn."""

    def random(self) -> float:
        """Return a number in [0, 1)."""

    def below(self, n: int) -> int:
        """Return an integer from 0 to `n - 1`, with equal probabilities."""

    def choice(self, options: Sequence[T]) -> T:
        """Return one of the options, with equal probabilities."""

    def bits(self) -> int:
        """Return 64 random bits."""


class PrivateFork(Protocol):
    """A copy of the game with the knowledge of the deciding agents, and start values for everything unknown."""

    @property
    def game(self) -> Any:  # Any: the game engine has its own class
        """The copy, with its own context, `game.ctx`, in which no agent has a strategy."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the deciding agents."""

    @property
    def own(self) -> Callable[[T], T]:
        """A function that rebinds a function, which closes over the game or an agent, to the copy."""


class PrivateForks(Protocol):
    """Makes copies of the game for simulations by a deciding agent."""

    def __call__(self, seed: int, *, information: Literal["private", "full"] = "private") -> PrivateFork:
        """Return a copy with the knowledge of the deciding agents; all its random numbers follow from the seed."""


class OutgoingMessage(TypedDict):
    """A message to send: an item of `state["outbox"]`."""

    channel: str
    """The name of a channel."""
    to: Any  # a team may be any value that can be a dict key
    """The name of an agent, a team, or None for all on the channel."""
    body: Plain
    """A plain value: numbers, texts, lists and dicts of these."""


class Message(TypedDict):
    """A received message: an item of `state["inbox"]`."""

    channel: str
    """The name of the channel."""
    sender: str
    """The name of the agent that sent it."""
    to: Any  # as above
    """The receiver: an agent, a team, or None for all on the channel."""
    body: Plain
    """The content."""
    turn: int
    """The `state["turn"]` in which it was sent."""
    overheard: bool
    """Whether the message is for others, and the agent received it as an eavesdropper."""


class JammerOptions(TypedDict, total=False):
    """A jammer of a channel: around `agent`, around all agents of `team`, or at the place `at`."""

    radius_m: float
    """The radius in which nothing is heard, map units; required."""
    agent: str
    """The name of an agent."""
    team: Any  # any value that can be a dict key
    """A team."""
    at: int | tuple[float, float]
    """A node, or (x, y)."""


class ChannelOptions(TypedDict, total=False):
    """The keywords of `ctx.game.add_channel`; at least one of `range_m`, `hops` and `line_of_sight`; all must hold.

    Attributes:
        range_m: maximum straight-line distance between agents, in metres, in 3D for flying agents. Default: None, no
            limit.
        hops: maximum distance in edges from the sender to the receiver. Default: None, no limit.
        line_of_sight: whether buildings and other obstacles block messages. Default: False.
        relay: whether agents on the channel forward messages, or the agents and teams that do; each step takes
            `delay_turns`. Default: False.
        loss: probability that a message is lost on its way to an agent, or pairs (metres, probability) with linear
            interpolation. Default: 0.
        delay_turns: number of turns after which a message arrives, at least 1. Default: 1.
        max_bytes_per_turn: limit on the total size of the bodies of an agent's messages per turn. Default: None, no
            limit.
        jammers: jammers of the channel; a dead jammer has no effect. Default: none.
        teams: a team, or a list, tuple or set of teams, that may use the channel. Default: None, all teams.
        eavesdroppers: an agent or team, or a list, tuple or set of them, that receive all messages that reach them.
            Default: none.
    """

    range_m: float | None
    hops: int | None
    line_of_sight: bool
    relay: bool | Sequence[Any]
    loss: float | Sequence[tuple[float, float]]
    delay_turns: int
    max_bytes_per_turn: int | None
    jammers: Sequence[JammerOptions]
    teams: Any  # a team, or several in a list, tuple or set
    eavesdroppers: Any  # as for `teams`; may include agents


class _AgentState(dict[str, Any], Generic[PositionT, ActionT]):
    """The common part of the states of all agents."""

    __slots__ = ()

    curr_pos: PositionT
    """The node id of the agent; for a flying agent its position `(x, y, z)`, map units."""
    sensor: dict[str, tuple[SensorType, Any]]
    """Name -> (type of sensor, its data); `docs/sensors.md` has the shape of the data for each type."""
    legal: Sequence[int]
    """The node ids to which the agent may move, its own first; on an edge its ends, then the nodes beyond. For a flying
    agent `()`: it is not bound to nodes."""
    legal_edges: tuple[int, ...]
    """The ids of the edges that the action `{"edge": id}` may name, in ascending order: those that lead from the
    node of the agent to other nodes, and that its mode may use; between two nodes the edge that it is on, and the one
    back. Found when they are first read. `()` in games with `legal="any"`, and in the air."""
    edge: tuple[int, int, int] | None
    """In games by metres: the edge of the agent (source id, target id, edge id), or None on a node."""
    offset_m: float
    """In games by metres: the distance from the source of its edge, map units; 0.0 on a node."""
    xy: tuple[float, float]
    """In games by metres: its position on the map."""
    time: float
    """If agents decide at arrivals: the elapsed part of the turn, from 0 to 1."""
    name: str
    """The agent's name."""
    team: Any  # any value that can be a dict key
    """The agent's team; None: no team."""
    turn: int
    """The number of turns played before this turn."""
    draw: Draws
    """The agent's own random numbers."""
    rng: "Generator"
    """The agent's own random numbers as a NumPy generator, for distributions."""
    memory: dict[Any, Any]
    """The agent's own dict, which is kept for the whole game."""
    team_memory: dict[Any, Any]
    """A copy of the team's memory; changes become known to the team in the next turn. Missing if `ctx.game.team_memory`
    is False."""
    facts: Mapping[str, Any]
    """Facts published to all, to the team and to the agent; read-only including all nested values."""
    blocked: str | None
    """The reason why the agent's last action was not performed; None: it was performed."""
    fork: PrivateForks
    """Makes copies of the game with the agent's knowledge, for simulations: `fork(seed).game`; used by
    `gamms.planning`."""
    deeds: Mapping[str, Mapping[str, Any]]
    """The deeds declared by `ctx.game.deeds`; only if there are any."""
    doing: Mapping[str, Any] | None
    """The deed that the agent is doing: its `kind`, `since`, `left` and `values`; None: it does none. Only if
    `ctx.game.deeds` declares deeds that last."""
    inbox: list[Message]
    """The received messages; only if the game has channels."""
    outbox: list[OutgoingMessage]
    """The messages to send: append to it; only if the game has channels."""
    action: ActionT | None
    """The action, for example a node id, or `(dx, dy, dz)` in the air: set by the strategy."""

    def __missing__(self, key: str) -> Any:
        """Find the legal edges when they are first read (KeyError: the state has no such key)."""
        if key != "legal_edges" or "fork" not in self:
            raise KeyError(key)
        knows_map: Any = self["fork"]
        found = knows_map.list_legal_edges(self)
        super().__setitem__(key, found)
        return found

    @property
    def sensors(self) -> dict[str, Any]:
        """Name -> data of the sensor, without its type; a fresh dict."""
        return {name: data for name, (_, data) in self["sensor"].items()}

    if TYPE_CHECKING:  # the keys have the same types as the attributes

        @overload  # type: ignore[override] # no other key is there
        def __getitem__(self, key: Literal["curr_pos"], /) -> PositionT: ...
        @overload
        def __getitem__(self, key: Literal["quat"], /) -> Quat: ...
        @overload
        def __getitem__(self, key: Literal["sensor"], /) -> dict[str, tuple[SensorType, Any]]: ...
        @overload
        def __getitem__(self, key: Literal["legal"], /) -> Sequence[int]: ...
        @overload
        def __getitem__(self, key: Literal["legal_edges"], /) -> tuple[int, ...]: ...
        @overload
        def __getitem__(self, key: Literal["edge"], /) -> tuple[int, int, int] | None: ...
        @overload
        def __getitem__(self, key: Literal["offset_m", "time"], /) -> float: ...
        @overload
        def __getitem__(self, key: Literal["xy"], /) -> tuple[float, float]: ...
        @overload
        def __getitem__(self, key: Literal["name"], /) -> str: ...
        @overload
        def __getitem__(self, key: Literal["team"], /) -> Any: ...
        @overload
        def __getitem__(self, key: Literal["turn"], /) -> int: ...
        @overload
        def __getitem__(self, key: Literal["draw"], /) -> Draws: ...
        @overload
        def __getitem__(self, key: Literal["rng"], /) -> "Generator": ...
        @overload
        def __getitem__(self, key: Literal["memory", "team_memory"], /) -> dict[Any, Any]: ...
        @overload
        def __getitem__(self, key: Literal["facts"], /) -> Mapping[str, Any]: ...
        @overload
        def __getitem__(self, key: Literal["blocked"], /) -> str | None: ...
        @overload
        def __getitem__(self, key: Literal["fork"], /) -> PrivateForks: ...
        @overload
        def __getitem__(self, key: Literal["deeds"], /) -> Mapping[str, Mapping[str, Any]]: ...
        @overload
        def __getitem__(self, key: Literal["doing"], /) -> Mapping[str, Any] | None: ...
        @overload
        def __getitem__(self, key: Literal["inbox"], /) -> list[Message]: ...
        @overload
        def __getitem__(self, key: Literal["outbox"], /) -> list[OutgoingMessage]: ...
        @overload
        def __getitem__(self, key: Literal["action"], /) -> ActionT | None: ...
        def __getitem__(self, key: str, /) -> Any: ...
        @overload  # type: ignore[override] # as above
        def __setitem__(self, key: Literal["action"], value: ActionT | None, /) -> None: ...
        @overload
        def __setitem__(self, key: Literal["memory", "team_memory"], value: dict[Any, Any], /) -> None: ...
        @overload
        def __setitem__(self, key: Literal["outbox"], value: list[OutgoingMessage], /) -> None: ...
        def __setitem__(self, key: str, value: Any, /) -> None: ...


class State(_AgentState[int, Action]):
    """The knowledge of an agent on the ground when it decides: the argument of its strategy.

    A dict whose keys are also attributes: `state.legal` is `state["legal"]`. The attribute of a missing key raises
    AttributeError. Only `state.action` can be set.

    `curr_pos` and `sensor` always exist, also in the plain dict returned by `agent.get_state()`, which has no
    attributes. `ctx.game` sets the others.
    """

    __slots__ = ()

    node: int
    """The node id of the agent: `state["curr_pos"]`."""


class AerialState(_AgentState[Position, tuple[float, float, float] | FloatArray | AerialAction]):
    """The knowledge of a flying agent when it decides: the argument of its strategy; see `State`."""

    __slots__ = ()

    quat: Quat
    """The rotation `(w, x, y, z)` as a unit quaternion."""


STATE_KEYS = frozenset(name for kind in (_AgentState, State, AerialState) for name in kind.__annotations__) - {"node"}
"""The keys of states."""
SET_BY_STRATEGIES = ("action", "outbox", "memory", "team_memory")
"""The keys of states that a strategy sets or writes into."""
for _class in (_AgentState, State, AerialState):
    for _name in _class.__annotations__:
        setattr(_class, _name, StateKey("curr_pos" if _name == "node" else _name))

Strategy = Callable[[State], None]
"""A function that decides for an agent on the ground: it reads the state and sets `state["action"]`."""
AerialStrategy = Callable[[AerialState], None]
"""A function that decides for a flying agent."""
AsyncStrategy = Callable[[Any], Awaitable[None]]
"""An asynchronous strategy, for example an `async def`. Any: `State` or `AerialState`."""

PRIVATE_MODULES = "_gamms_scenario_"  # prefix of the names of packages with the code of a scenario, before a hash
_PRIVATE = re.compile(rf"{PRIVATE_MODULES}[0-9a-f]+\.")


def find_strategy_name(strategy: object) -> str | None:
    """Return the module and the name of a strategy, independent of the folder; None if it has none."""
    if strategy is None:
        return None
    module = _PRIVATE.sub("", find_module(strategy))
    return f"{module}:{getattr(strategy, '__qualname__', type(strategy).__qualname__)}"


# -- rules and conflicts ---------------------------------------------------------------------------------------------


class Leg(NamedTuple):
    """The part of an edge that an agent covers in a turn, in games by metres, or if its action names the edge."""

    source: int  # node id
    target: int  # node id
    edge: int  # id
    begin: float  # position at `since`, as a share of the edge from its source
    end: float  # position at `until`; less than `begin` on the way back
    since: float  # time within the turn, from 0 to 1
    until: float
    back: int | None = None  # id of the edge in the opposite direction, by which agents turn around

    @property
    def street(self) -> int:
        """The id shared by the edge and its opposite edge."""
        return self.edge if self.back is None else min(self.edge, self.back)

    def share_at(self, time: float) -> float:
        """Return the position, as a share of the edge, at a time from `since` to `until`."""
        if self.until <= self.since:
            return self.end
        return self.begin + (self.end - self.begin) * (time - self.since) / (self.until - self.since)


class EdgePlace(NamedTuple):
    """The position of an agent on an edge."""

    edge: int  # id

    def __str__(self) -> str:
        """Return a text that names the edge."""
        return f"edge {self.edge}"


class Track(NamedTuple):
    """The movement of an agent in a turn: nodes, and the time from 0 to 1 at which it is at each of them.

    In games that count edges it stays at the last node until time 1. In games by metres it is on the edges of `legs`
    during their times, and on its nodes at all other times. The first node of an agent that begins the turn on an edge
    is the node that it passed last, with the time 0: `ctx.game.visits` tells both apart.

    Attributes:
        path: node ids.
        times: the time at each of them.
        legs: in games by metres, the parts of edges that the agent covers, in order; in games that count edges, the
            edges that its action has named, or all if it obeys turn restrictions, else none.
    """

    path: tuple[int, ...]
    times: tuple[float, ...]
    legs: tuple[Leg, ...] = ()


class Visit(NamedTuple):
    """An agent on a node, or on an edge, from one time to another.

    Times are numbers of turns since the start of the game: 4.25 is a quarter into the fifth turn.
    """

    agent: str
    team: Any
    node: int | None  # its id; None: the agent is on an edge
    edge: int | None  # the id of the edge in the direction in which the agent moves
    time: float
    until: float  # the same for an agent that passes a node; not later than the end of the turn


Rule = Callable[[Any], object]
"""A function that is called with the `gamms.Context` in every turn; its result is ignored.

Any: `Context` cannot be imported here; annotate your rule: `def rule(ctx: gamms.Context) -> None`.
"""

TeamPlan = Callable[[dict[str, Any]], Awaitable[None] | None]
"""A function that decides for a team: it is called with the states by agent name, and sets `state["action"]` in each.

Any: `State`, or `AerialState` for flying agents.
"""


TEAMS = "teams"
OWNERS = "teams, or other owners"

Team = Annotated[Hashable, TEAMS]
"""A parameter of a rule that names teams: scenario files are checked for misspelled teams."""


Member = Annotated[Hashable | Mapping[str, Any], TEAMS]
"""The same for a team or a role: some agents of a team, such as `{"team": "red", "names": ["truck"]}`."""


def find_team_parameters(make_rule: Callable[..., object]) -> dict[str, str]:
    """Return the parameters of a function that are annotated as teams: name -> TEAMS or OWNERS."""
    found: dict[str, str] = {}
    for name, annotation in make_rule.__annotations__.items():
        notes = [note for note in getattr(annotation, "__metadata__", ()) if note in (TEAMS, OWNERS)]
        if notes:
            found[name] = notes[-1]
    return found


class Move(NamedTuple):
    """The move of one agent on the ground in a turn, before or after it is made."""

    agent: str
    team: Any
    start: int  # node id
    end: int  # node id; the start if the agent stays
    path: tuple[int, ...]  # node ids from start to end; only the start if the agent stays
    legs: tuple[Leg, ...] = ()  # as those of its `Track`

    @property
    def places(self) -> "tuple[int | EdgePlace, int | EdgePlace]":
        """The start and the end: node ids, or places on edges."""
        if not self.legs:
            return self.start, self.end
        first = self.legs[0]
        last = self.legs[-1]
        begins = first.since == 0.0 and 0.0 < first.begin < 1.0
        ends = 0.0 < last.end < 1.0
        return EdgePlace(first.edge) if begins else self.start, EdgePlace(last.edge) if ends else self.end


class Deed(NamedTuple):
    """A deed of one agent in a turn, in addition to its move."""

    agent: str
    team: Any
    kind: str  # as declared
    at: int  # node id of the agent, or of the nearest node below it
    values: Mapping[str, Any]  # of its fields


class IConflicts(Protocol):
    """Decides which agents must stay if moves conflict."""

    @property
    def resolve(self) -> Callable[[Mapping[str, Move], Any], set[str]]:
        """The method `resolve(moves, ctx)`, which returns the names of the agents that must stay.

        `moves` has all moves of this turn by name, sorted by name, including agents that stay. The result must depend
        only on the moves and the context, not on their order. For the type of `ctx` see `Rule`.
        """
