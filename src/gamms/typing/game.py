"""What programs and the turn engine give each other: states, actions, strategies, plans, rules, resolvers."""

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

from gamms.core.ask import Key
from gamms.ir.agents import Position, Quat
from gamms.ir.graph import FloatArray
from gamms.plain import Plain
from gamms.text import module_of
from gamms.typing.sensor_engine import SensorType

if TYPE_CHECKING:
    from numpy.random import Generator


T = TypeVar("T")
Where = TypeVar("Where")  # where an agent is
Wish = TypeVar("Wish")  # what it may do

NodeId = int | np.integer[Any]
"""What is taken for the id of a node; what is given back is an int."""


class NodeAction(TypedDict):
    """Move to a node, face somewhere, and do something besides."""

    node_id: NotRequired[NodeId]
    """May be left out where there is `do`: then the agent stays."""
    do: NotRequired[Mapping[str, Any]]
    """Deeds that `ctx.game.deeds` declares -> the values of their fields."""
    orientation: NotRequired[tuple[float, float] | None]
    """`(cos, sin)` of the heading, of any length but zero; None: follow the moves again."""


class AerialAction(TypedDict, total=False):
    """Fly, turn, do something besides, or all of it."""

    do: Mapping[str, Any]
    """Deeds that `ctx.game.deeds` declares -> the values of their fields."""

    direction: Sequence[float] | FloatArray
    """`(dx, dy, dz)`, of any length: the agent moves by its speed; all zeros: it stays."""
    distance: float
    """How far it moves in this direction, map units, from 0 to its speed; left out, by its speed."""
    quat: Sequence[float]
    """`(w, x, y, z)`, of any length: how the agent is turned from now on."""


Action = NodeId | Sequence[int] | NodeAction
"""Of an agent on the ground: a node id; of one with a speed also the nodes on the way, one after the other.

In games by metres also None: it stops where it is.
"""


class Draws(Protocol):
    """Random numbers of one agent; in every turn they follow from the seed, its name and the turn alone."""

    def random(self) -> float:
        """Return a number in [0, 1)."""

    def below(self, n: int) -> int:
        """Return an integer from 0 to `n - 1`, each as likely."""

    def choice(self, options: Sequence[T]) -> T:
        """Return one of the options, each as likely."""

    def bits(self) -> int:
        """Return 64 random bits."""


class PrivateFork(Protocol):
    """A copy of the game for the agents that decide: what they know, and the start values of all else."""

    @property
    def game(self) -> Any:  # the game engine's own class, which states do not know
        """The copy, with a context of its own, `game.ctx`, in which no agent has a strategy."""

    @property
    def names(self) -> tuple[str, ...]:
        """The agents that it is for."""

    @property
    def own(self) -> Callable[[T], T]:
        """Returns what a function is in the copy that closes over the game, or over an agent of it."""


class PrivateForks(Protocol):
    """Gives copies of the game to look ahead in, while the agent decides."""

    def __call__(self, seed: int, *, information: Literal["private", "full"] = "private") -> PrivateFork:
        """Return a copy that has what the agents know that decide; all its random numbers follow from the seed."""


class OutgoingMessage(TypedDict):
    """A message that an agent sends: an item of `state["outbox"]`."""

    channel: str
    """The name of a channel."""
    to: Any  # of a team: any value that can be a key of a dict
    """The name of an agent, a team, or None for all on the channel."""
    body: Plain
    """A plain value, such as numbers, texts, lists and dicts of these."""


class Message(TypedDict):
    """A message that an agent hears: an item of `state["inbox"]`."""

    channel: str
    """The name of the channel."""
    sender: str
    """The agent that has sent it."""
    to: Any  # as above
    """Whom it is for: an agent, a team, or None for all on the channel."""
    body: Plain
    """What it says."""
    turn: int
    """The `state["turn"]` in which it was sent."""
    overheard: bool
    """Whether it is for others, and the agent is one of the channel's eavesdroppers."""


class JammerOptions(TypedDict, total=False):
    """Where nothing is heard: around `agent`, all agents of `team`, or the place `at`."""

    radius_m: float
    """How far around it, map units; always needed."""
    agent: str
    """The name of an agent."""
    team: Any  # any value that can be a key of a dict
    """A team."""
    at: int | tuple[float, float]
    """A node, or (x, y)."""


class ChannelOptions(TypedDict, total=False):
    """The keywords of `ctx.game.add_channel`; one of `range_m`, `hops` and `line_of_sight` is needed, all must hold.

    Attributes:
        range_m: how far agents hear each other, in metres in a straight line, for agents in the air in space. Default:
            None, however far.
        hops: how far agents hear each other, in edges from the node of the sender in their direction. Default: None,
            however far.
        line_of_sight: whether buildings, and all other obstacles, block messages. Default: False.
        relay: whether agents on the channel pass messages on, or the agents and teams that do; each time takes
            `delay_turns`. Default: False.
        loss: the probability that a message is lost on its way to an agent, or pairs (metres, probability) with
            straight lines between them. Default: 0.
        delay_turns: the number of turns after which a message is in the inbox, at least 1. Default: 1.
        max_bytes_per_turn: the most bytes that the bodies of an agent's messages may have in a turn. Default: None, any
            number.
        jammers: the places where nothing is heard; a jammer that is dead jams nothing. Default: none.
        teams: a team, or a list, tuple or set of teams, that may use the channel. Default: None, all teams.
        eavesdroppers: an agent or team, or a list, tuple or set of them, that hear all messages that reach them.
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
    eavesdroppers: Any  # as for `teams`, of agents, too


class _AgentState(dict[str, Any], Generic[Where, Wish]):
    """What the states of all agents have in common."""

    __slots__ = ()

    curr_pos: Where
    """The id of the node that the agent is on; of one in the air `(x, y, z)`, map units."""
    sensor: dict[str, tuple[SensorType, Any]]
    """Name -> kind of sensor, and what it has sensed; `docs/sensors.md` has the shape for each kind."""
    legal: Sequence[int]
    """The ids of the nodes that the agent may move to, its own first; on an edge its ends, then what lies beyond. Of an
    agent in the air `()`: it is not bound to nodes."""
    edge: tuple[int, int, int] | None
    """In games by metres: the edge it is on, as the ids of the nodes it leads from and to and its own, or None."""
    offset_m: float
    """In games by metres: how far from the source of its edge it is, map units; 0.0 on a node."""
    xy: tuple[float, float]
    """In games by metres: where on the map it is."""
    time: float
    """Where agents decide at each arrival: how much of the turn is over, from 0 to 1."""
    name: str
    """The agent's name."""
    team: Any  # any value that can be a key of a dict
    """The agent's team; None: no team."""
    turn: int
    """How many turns were played before this one."""
    draw: Draws
    """The agent's own random numbers, fast."""
    rng: "Generator"
    """The agent's own random numbers as a NumPy generator, for distributions."""
    memory: dict[Any, Any]
    """The agent's own dict, which lasts for the game."""
    team_memory: dict[Any, Any]
    """A copy of what the team remembers; what is written into it is known to the team in the next turn. Not there with
    `ctx.game.team_memory = False`."""
    facts: Mapping[str, Any]
    """What was published to all, to the team and to the agent; read-only all the way down."""
    blocked: str | None
    """Why the agent did not do in its last turn what it wanted; None: it did."""
    fork: PrivateForks
    """Gives copies of the game to look ahead in, as far as the agent knows it: `fork(seed).game`, as `gamms.planning`
    uses it."""
    deeds: Mapping[str, Mapping[str, Any]]
    """What agents may do besides moving, as `ctx.game.deeds` declares it; only where that declares something."""
    inbox: list[Message]
    """The messages that have arrived for it; only where the game has channels."""
    outbox: list[OutgoingMessage]
    """What it sends: append to it; only where the game has channels."""
    action: Wish | None
    """What the agent does, such as the id of a node, or `(dx, dy, dz)` in the air: set by the strategy."""

    @property
    def sensors(self) -> dict[str, Any]:
        """Name -> what the sensor has sensed, without its kind; a fresh dict."""
        return {name: data for name, (_, data) in self["sensor"].items()}

    if TYPE_CHECKING:  # the keys have the types of the attributes

        @overload  # type: ignore[override] # no other key is there
        def __getitem__(self, key: Literal["curr_pos"], /) -> Where: ...
        @overload
        def __getitem__(self, key: Literal["quat"], /) -> Quat: ...
        @overload
        def __getitem__(self, key: Literal["sensor"], /) -> dict[str, tuple[SensorType, Any]]: ...
        @overload
        def __getitem__(self, key: Literal["legal"], /) -> Sequence[int]: ...
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
        def __getitem__(self, key: Literal["inbox"], /) -> list[Message]: ...
        @overload
        def __getitem__(self, key: Literal["outbox"], /) -> list[OutgoingMessage]: ...
        @overload
        def __getitem__(self, key: Literal["action"], /) -> Wish | None: ...
        def __getitem__(self, key: str, /) -> Any: ...
        @overload  # type: ignore[override] # as above
        def __setitem__(self, key: Literal["action"], value: Wish | None, /) -> None: ...
        @overload
        def __setitem__(self, key: Literal["memory", "team_memory"], value: dict[Any, Any], /) -> None: ...
        @overload
        def __setitem__(self, key: Literal["outbox"], value: list[OutgoingMessage], /) -> None: ...
        def __setitem__(self, key: str, value: Any, /) -> None: ...


class State(_AgentState[int, Action]):
    """What an agent on the ground knows when it decides: the argument of its strategy.

    It is a dict whose keys are attributes, too: `state.legal` is `state["legal"]`. An attribute of a key that is not
    there raises AttributeError. Only `state.action` can be set.

    `curr_pos` and `sensor` are always there, also in the plain dict that `agent.get_state()` returns, which has keys
    alone. The others are put there by `ctx.game`.
    """

    __slots__ = ()

    node: int
    """The id of the node that the agent is on: `state["curr_pos"]`."""


class AerialState(_AgentState[Position, tuple[float, float, float] | FloatArray | AerialAction]):
    """What an aerial agent knows when it decides: the argument of its strategy; see `State`."""

    __slots__ = ()

    quat: Quat
    """How the agent is turned: `(w, x, y, z)` of length 1."""


for _class in (_AgentState, State, AerialState):
    for _name in _class.__annotations__:
        setattr(_class, _name, Key("curr_pos" if _name == "node" else _name))

Strategy = Callable[[State], None]
"""Decides for an agent on the ground: it reads the state and sets `state["action"]`."""
AerialStrategy = Callable[[AerialState], None]
"""Decides for an aerial agent."""
AsyncStrategy = Callable[[Any], Awaitable[None]]
"""Decides for an agent that `ctx.game` waits for, such as an `async def`. Any: `State` or `AerialState`."""

PRIVATE_MODULES = "_gamms_scenario_"  # begins the names of packages that hold the code of a scenario, before a hash
_PRIVATE = re.compile(rf"{PRIVATE_MODULES}[0-9a-f]+\.")


def strategy_name(strategy: object) -> str | None:
    """Return the module of a strategy and its name there, the same in every folder; None if there is none."""
    if strategy is None:
        return None
    module = _PRIVATE.sub("", module_of(strategy))
    return f"{module}:{getattr(strategy, '__qualname__', type(strategy).__qualname__)}"


# -- rules and conflicts ---------------------------------------------------------------------------------------------


class Leg(NamedTuple):
    """What an agent covers of one edge in a turn, in games by metres; on one that stands there, nothing."""

    source: int  # node id
    target: int  # node id
    edge: int  # id
    begin: float  # share of the edge from its source, at `since`
    end: float  # at `until`; less than `begin` on the way back
    since: float  # of the turn, from 0 to 1
    until: float
    back: int | None = None  # id of the edge by which one turns round on this one

    @property
    def street(self) -> int:
        """The id that the edge and the one back have in common."""
        return self.edge if self.back is None else min(self.edge, self.back)

    def share_at(self, time: float) -> float:
        """Return the share of the edge that is behind the agent at a time from `since` to `until`."""
        if self.until <= self.since:
            return self.end
        return self.begin + (self.end - self.begin) * (time - self.since) / (self.until - self.since)


class EdgePlace(NamedTuple):
    """Where an agent is that is not on a node."""

    edge: int  # id

    def __str__(self) -> str:
        """Name the edge."""
        return f"edge {self.edge}"


class Track(NamedTuple):
    """How an agent has moved in a turn: nodes, and from 0 to 1 when it is at each of them.

    In games that count edges it is at the last node until 1. In games by metres it is on the edges of `legs` while
    these last, and on its nodes at all other times.
    """

    path: tuple[int, ...]
    times: tuple[float, ...]
    legs: tuple[Leg, ...] = ()


Rule = Callable[[Any], object]
"""Is called with the `gamms.Context` in every turn; what it returns is ignored.

Any: `Context` is made of what is declared here and cannot be named here; a rule says it itself:
`def rule(ctx: gamms.Context) -> None`.
"""

TeamPlan = Callable[[dict[str, Any]], Awaitable[None] | None]
"""Decides for a team: it is called with the states of its agents by name, and sets `state["action"]` in each.

Any: `State`, or `AerialState` of agents that fly.
"""


TEAMS, OWNERS = "teams", "teams, or other owners"

Team = Annotated[Hashable, TEAMS]
"""A parameter of a function that makes rules, which names teams: a scenario file is checked for misspelt ones."""


def team_parameters(make_rule: Callable[..., object]) -> dict[str, str]:
    """Return the parameters of a function whose annotations say that they name teams: name -> TEAMS or OWNERS."""
    notes = ((name, getattr(one, "__metadata__", ())) for name, one in make_rule.__annotations__.items())
    return {name: note for name, some in notes for note in some if note in (TEAMS, OWNERS)}


class Move(NamedTuple):
    """What one agent on the ground is about to do, or has done, in a turn."""

    agent: str
    team: Any
    start: int  # node id
    end: int  # node id; the start for one that stays
    path: tuple[int, ...]  # node ids from start to end; only the start for one that stays
    legs: tuple[Leg, ...] = ()  # in games by metres: what it covers of which edges

    @property
    def places(self) -> "tuple[int | EdgePlace, int | EdgePlace]":
        """Where it starts and where it ends: ids of nodes, or edges."""
        if not self.legs:
            return self.start, self.end
        first, last = self.legs[0], self.legs[-1]
        begins, ends = first.since == 0.0 and 0.0 < first.begin < 1.0, 0.0 < last.end < 1.0
        return EdgePlace(first.edge) if begins else self.start, EdgePlace(last.edge) if ends else self.end


class Deed(NamedTuple):
    """What one agent does in a turn besides moving."""

    agent: str
    team: Any
    kind: str  # as declared
    at: int  # id of the node where it is, or above which it flies
    values: Mapping[str, Any]  # of its fields


class IConflicts(Protocol):
    """Decides which agents have to stay where moves get in each other's way."""

    @property
    def resolve(self) -> Callable[[Mapping[str, Move], Any], set[str]]:
        """The method `resolve(moves, ctx)`, which returns the names of the agents that must stay where they are.

        `moves` are all moves of this turn by name, in the order of the names, stayers included. The answer must not
        depend on that order, nor on anything but the moves and the context. For the type of `ctx` see `Rule`.
        """
