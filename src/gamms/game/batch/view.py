"""What array forms of strategies get, and what a learner observes: the agents of a strategy in all games at once."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from copy import copy
from typing import Any, Self, TypeVar

import numpy as np

from gamms.arguments import as_array, as_count, as_key, as_numbers_of
from gamms.core import observe, strategies
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.channels import Heard, Outbox
from gamms.game.batch.columns import kept_in
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.flows import Flows
from gamms.game.batch.movement import STOP, Movement, Places
from gamms.game.batch.roads import OpenRoads
from gamms.game.batch.routes import RouteTable
from gamms.game.batch.sensing import SHOWING_AGENTS, SHOWING_NODES, Seen, SeenNodes, covered, names_of, seen, seen_nodes
from gamms.game.batch.state import Arrays, GameArrays, NotTakenUp
from gamms.game.batch.strategy_steps import made_looks
from gamms.game.batch.vectors import Encoder, Vectors, legal_of
from gamms.game.conflicts import flat
from gamms.game.random_streams import ViewDraws
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.readonly import locked
from gamms.text import shown

ArrayStrategy = Callable[["ArrayView"], Any]
"""Returns the numbers of legal nodes, (games, agents), which NumPy makes an array of; see docs/batches.md."""

T = TypeVar("T")
V = TypeVar("V", bound="ArrayView")
_NO_CHOICES = flat(np.zeros(0), np.int64)
_NO_PAIRS = flat(np.zeros(0), np.int64), flat(np.zeros(0), np.int64), flat(np.zeros(0), np.uint8)


class ArrayView(Mapping[str, Any]):
    """The agents that one strategy decides for, in all games that are played: arrays (games, agents).

    It has the keys of `state` that have an array form: `view["curr_pos"]` are the ids of nodes, `view["legal"]` those
    of legal nodes (games, agents, most), behind the last one -1, `view["mask"]` which agents are alive; `name` and
    `team` are one for each agent, `turn` one for each game; `sensor` and `inbox` have by name what sensors show and
    what came by channels.

    Attributes:
        games: (games,) numbers in the batch.
        agents: (agents,) numbers in the roster: the names in their order.
        node: rows of nodes.
        mask: which agents are asked: those that are alive; of a part of a strategy, those that it decides for.
        turn: (games,) how many turns were played.
        draw: random numbers, one for each agent.
        streets: the graph.
        roster: the agents of every game.
        memory_of: (all agents,) the number of the memory that each shares with its team, or has for itself.
    """

    _deeds: list[ArrayDeeds] | None = None  # what the agents do besides moving, in order; None: they are not asked
    _outboxes: list[Outbox] | None = None  # what they send, likewise
    _channels: Iterable[str] = ()  # by which messages may have come
    _may_aim = False  # whether actions may lead towards nodes that are not legal

    def __init__(self, state: GameArrays, games: IntArray, agents: IntArray) -> None:
        self._state = state
        self.games = games
        self.agents = agents
        self.streets, self._movement, self._shared = state.world(games)
        self.roster, self.memory_of = state.roster, state.memory_of
        self.node: IntArray = state.chosen(state.node, games, agents)
        self.mask: BoolArray = state.chosen(state.alive, games, agents)
        self.turn = state.turn[games]
        self._known = dict[str, IntArray]()
        self.draw = ViewDraws(state.chosen(state.draw_keys(), games, agents), self.turn)
        self._whole, self._sights = self.mask, dict[Hashable, Seen]()

    def _lock(self) -> None:
        """Let a strategy read the view, and not write into it."""
        for name in ("games", "agents", "node", "mask", "turn"):
            setattr(self, name, locked(getattr(self, name)))

    def __getitem__(self, key: str) -> Any:
        if key in _VALUES:
            return _VALUES[key](self)
        if key in _OTHERWISE:
            raise UnknownName(f"key of a view: use {_OTHERWISE[key]} instead of", key)
        raise UnknownName("key of a view", key, tuple(_VALUES))

    def __iter__(self) -> Iterator[str]:
        return iter(_VALUES)

    def __len__(self) -> int:
        return len(_VALUES)

    @property
    def _choices(self) -> IntArray:
        """What is legal for each agent, by the numbers of its movement."""
        if "all" not in self._known:
            self._known["all"] = self._movement.choices(self.node, numbers_in(self, np.s_[:, :]))
        return self._known["all"]

    @property
    def counts(self) -> IntArray:
        """How many nodes are legal for each agent, its own included."""
        if "counts" not in self._known:
            self._known["counts"] = self._movement.counts(self._choices)
            if self._deeds is not None:  # strategies cannot write into it
                self._known["counts"] = locked(self._known["counts"])
        return self._known["counts"]

    @property
    def flies(self) -> bool:
        """Whether all agents of the view fly; a form that decides for such returns how far they fly."""
        return bool(self.roster.flies[self.agents].all())

    def _heights(self) -> FloatArray:
        known = self._state.heights
        return np.zeros(self.node.shape) if known is None else known[np.ix_(self.games, self.agents)]

    def legal_rows(self, which: Any = np.s_[:, :]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of each agent, (games, agents, most), and which of these count.

        Args:
            which: an index of the agents of the view that are asked for.
        """
        return self._movement.legal(self._choices[which])

    def _time(self) -> FloatArray:
        now = self._movement.now
        return now[self.games] if len(now) else np.zeros(len(self.games))

    def _legal(self) -> IntArray:
        rows, is_legal = self.legal_rows()
        return np.where(is_legal, self.streets.ids_of(rows), -1)

    def _places(self) -> Places:
        """Return where the agents are: in games by metres some may be on edges."""
        if len(self._movement.edge):
            return self._movement.places(self.node, numbers_in(self, np.s_[:, :]))
        known, rows = self._state.places, np.ix_(self.games, self.agents)
        if known is None:
            shape = self.node.shape
            return Places(np.full((*shape, 3), -1), np.zeros(shape), self.streets.columns.xy[self.node])
        return Places(known.edge[rows], known.offset_m[rows], known.xy[rows])

    def action_to(self, nodes: Any) -> IntArray:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal.

        Raises:
            BadType, BadValue: they are no integers, or do not broadcast to (games, agents).
            UnknownName (KeyError): one is not on the map.
        """
        wanted = self.streets.rows(as_array(nodes, "nodes", "integers", self.node.shape))
        return self._movement.action_to(self._choices, wanted)

    def towards(self, targets: IntArray, which: Any = np.s_[:, :], allowed: BoolArray | None = None) -> IntArray:
        """Return the actions by which agents go towards nodes, as the strategies of `gamms.strategies` do.

        Of agents with speeds these are no numbers of legal nodes, but lead as far as the turn goes.

        Args:
            targets: rows of nodes.
            which: an index of the agents of the view, (games, agents), that go there.
            allowed: (nodes,) which may be entered, the targets among them; None: all.

        Returns:
            -1 where no path leads there.
        """
        if self._movement.has_aims and not self._may_aim:
            raise NotTakenUp("view.towards of agents with speeds")
        node, (games, agents) = self.node[which], numbers_in(self, which)
        ends = np.broadcast_to(targets, node.shape).ravel()
        found = self._movement.towards(node.ravel(), ends, (games.ravel(), agents.ravel()), allowed)
        return found.reshape(node.shape)

    def only(self, asked: BoolArray) -> Self:
        """Return a view for a part of a strategy that decides for some agents, (games, agents), in its `mask`.

        Its arrays are those of all agents; what it draws counts for those in its mask.
        """
        narrowed = copy(self)
        narrowed.mask = self.mask & as_array(asked, "asked", "booleans", self.node.shape)
        narrowed.draw = self.draw.only(narrowed.mask)
        return narrowed

    def of(self, agents: IntArray) -> "ArrayView":
        """Return the view of other agents in the same games, by their numbers in the roster, ascending."""
        numbers = as_numbers_of(agents, "agents", len(self.roster.names), "agents").reshape(-1)
        return ArrayView(self._state, self.games, numbers)

    def in_games(self, which: IntArray) -> "ArrayView":
        """Return the view of the same agents in some of its games, by their places, ascending."""
        places = as_numbers_of(which, "which", len(self.games), "games").reshape(-1)
        return ArrayView(self._state, self.games[places], self.agents)

    def sees(self, *names: str) -> BoolArray:
        """Return who sees whom, (games, agents, all agents); see `seen`."""
        return self.seen(*names).mask

    def do(self, deed: str, where: Any, /, **fields: object) -> None:
        """Let agents do something besides moving, as `ctx.game.deeds` declares it; in the order of the calls.

        Args:
            deed: what.
            where: (games, agents) which agents do it; those that are not in the mask do not.
            fields: a value for all, or an array (games, agents). Agents are given by their numbers in the roster,
                nodes by their rows; -1, in other fields None, leaves out a field that need not be given.

        Raises:
            UnknownName (KeyError): there is no such deed or field.
            BadType, BadValue: a field is missing or impossible, an agent does this already, or no strategy is asked.
        """
        if self._deeds is None:
            raise BadValue("Deeds are done by strategies that are asked: view.do is not for games.observe.")
        chosen = as_array(where, "where", "booleans", self.node.shape) & self.mask
        for earlier in self._deeds:
            if earlier.kind == deed and chosen[earlier.at, np.searchsorted(self.agents, earlier.agents)].any():
                raise BadValue(f"An agent does {deed!r} twice in a turn: give each call of view.do other agents.")
        who, order = (self.games, self.agents), len(self._deeds)
        self._deeds.append(self._state.deeds.checked(deed, fields, chosen, who, self.node, order))

    def send(self, channel: str, where: Any, body: object, to: object = None) -> None:
        """Let agents send a message each by a channel, as `state["outbox"]` does; in the order of the calls.

        Args:
            channel: its name.
            where: (games, agents) which agents send; those that are not in the mask do not.
            body: a plain value for all, or an array whose first axes are games and agents.
            to: an agent, a team, or None for all on the channel; or an array (games, agents) of numbers in the roster.

        Raises:
            UnknownName (KeyError): there is no such channel, agent or team.
            BadType, BadValue: a team may not use the channel, a body is not plain, or no strategy is asked.
        """
        radio = self._state.radio
        if radio is None:
            raise BadValue(f"Channel {shown(channel)} cannot be used: the game has no channels. Declare it before.")
        if self._outboxes is None:
            raise BadValue("view.send cannot be used: it is for strategies that are asked.")
        chosen = as_array(where, "where", "booleans", self.node.shape) & self.mask
        who, order = (self.games, self.agents), len(self._outboxes)
        self._outboxes.append(radio.checked(channel, chosen, who, to, body, order))

    def heard(self, channel: str) -> Heard:
        """Return what is in the inboxes of the agents in the mask that came by a channel.

        Raises:
            UnknownName (KeyError): there is no such channel, or the games are only observed.
        """
        radio = self._state.radio
        if radio is None or self._outboxes is None:
            raise UnknownName("channel of games that are observed", channel, ())
        return radio.heard(channel, self.games, self.turn, self.agents, self.mask)

    def seen(self, *names: str) -> Seen:
        """Return which agents the sensors show, of kinds that show agents, to those in the mask; no agent sees itself.

        Args:
            names: of the sensors; none: all. A sensor that is named, and looks from a fixed place, shows its own agent.

        Raises:
            UnknownName (KeyError): no agent carries such a sensor that shows agents.
        """
        key = as_key(names, "The name of a sensor")
        if key not in self._sights:
            self._sights[key] = self._looked(names)
        found = self._sights[key]
        return found if self.mask is self._whole else found.of(self.mask[found.at, found.viewers])

    def _looked(self, names: tuple[str, ...]) -> Seen:
        """Return what sensors of these names show to all agents of the view, or all sensors; see `seen`."""
        state, key = self._state, ("seen", self.agents.tobytes(), names)
        are_all = len(self.games) == len(state)
        known: Seen | None = state.now.get(key)
        if known is not None:
            return known if are_all else known.in_games(self.games)
        found = seen(state, self.games, self.agents, self._whole, names, self._xy_of_all)
        if are_all:
            state.now[key] = found
        return found

    def _xy_of_all(self) -> FloatArray:
        """Return where all agents of these games are, (games, all agents, 2)."""
        return ArrayView(self._state, self.games, np.arange(len(self.roster.names)))._places().xy

    def seen_nodes(self, *names: str) -> SeenNodes:
        """Return which nodes the sensors show to those in the mask: NEIGHBOR, MAP, RANGE, ARC and OCCLUDED_MAP.

        Args:
            names: of the sensors; none: all.

        Raises:
            UnknownName (KeyError): no agent carries such a sensor that shows nodes.
            BadValue: a sensor is of a class of its own.
            TooLarge: the agents see more than 268 million nodes together.
        """
        named = as_key(names, "The name of a sensor")
        return seen_nodes(self._state, self.games, self.agents, self.node, self.mask, named)

    def covered(self) -> BoolArray:
        """Return on which nodes the sensors would show agents with some probability, (games, agents, nodes)."""
        return covered(self._state, self.games, self.agents, self.node, self.mask)

    def enemies(self) -> Seen:
        """Return which agents of other teams the sensors show; an agent of no team (None) is an enemy of all."""
        found = self.seen()
        return found.of(~self._are_mates(found))

    def mates(self) -> Seen:
        """Return which agents of their own teams the sensors show."""
        found = self.seen()
        return found.of(self._are_mates(found))

    def _are_mates(self, found: Seen) -> BoolArray:
        """Return which of those that are seen are of the team of the agent that sees them, (pairs,)."""
        return self.roster.are_mates(self.agents[found.viewers], found.others)

    def vector(self, others: int = 4) -> Vectors:
        """Return what the agents observe as numbers, (games, agents, entries): a vector of one length for each.

        The entries are `x` and `y`, the own place; of each action `is_legal`, `dx` and `dy`; of each of so many nearest
        `others` that sensors show `is_seen`, `is_mate`, `dx` and `dy`. Offsets are those in a straight line; 1 is half
        of the longer side of the map, whose centre is 0.

        Raises:
            BadValue: an agent may go to more than 4096 nodes.
            TooLarge: vectors of so many others would not fit into memory.
        """
        return self._encoded(as_count(others, "others", least=0), 0, 1)

    def _encoded(self, others: int, more: int, threads: int) -> Vectors:
        """Return vectors, with so many more entries, 0 but the last one: the share n / (n + 100) after n turns."""
        encoder = self._encoder(others)
        found = encoder.made(self.mask, more)
        xy = self._places().xy if self._movement.leaves_nodes else None
        places = np.arange(len(self.games))
        observers = self._observers(self.mask, places * len(self.agents), are_looking=others > 0)
        encoder.write(observers, found, places, xy=xy, threads=threads)
        return found

    def _encoder(self, others: int) -> Encoder:
        """Return what makes vectors with so many others."""
        agents, actions = len(self.roster.names), self._movement.width
        key = "encoder", agents, others, actions
        return kept_in(self._shared, key, lambda: Encoder(self.streets, agents, others, actions))

    def _observers(self, mask: BoolArray, rows: IntArray, *, are_looking: bool = True) -> observe.Observers:
        """Return the agents as the core takes them.

        Args:
            mask: which are asked, in rows as they are written.
            rows: (games,) the first row of each game.
            are_looking: whether they see others.
        """
        roster, state, streets = self.roster, self._state, self.streets
        choice = _NO_CHOICES
        if self._movement.are_plain(self.agents):
            offsets, targets = kept_in(self._shared, "along edges", lambda: legal_of(streets.offsets, streets.targets))
        else:
            nodes, is_legal = self.legal_rows()
            counts = is_legal.sum(axis=-1).reshape(-1)
            choice = flat(np.arange(len(counts)), np.int64)
            offsets, targets = legal_of(np.concatenate(([0], np.cumsum(counts))), nodes[is_legal])
        looks = self._plain_looks()
        pairs = _NO_PAIRS
        if are_looking and looks is None:
            found, number = self.seen(), self.node.size
            counts = np.bincount(found.at * self.node.shape[1] + found.viewers, minlength=number)
            first = np.concatenate(([0], np.cumsum(counts)))
            pairs = flat(first, np.int64), flat(found.nodes, np.int64), flat(self._are_mates(found), np.uint8)
        seen = observe.Seen(
            looks,
            *pairs,
            viewers=flat(self.agents, np.int64),
            node=flat(state.node, np.int64),
            alive=flat(state.alive.view(np.uint8), np.uint8),
            team=flat(roster.team_of, np.int64),
            are_mates=flat(roster.are_teams(), np.uint8),
        )
        columns = flat(self.games, np.int64), flat(rows, np.int64), flat(mask.view(np.uint8), np.uint8)
        turn = flat(state.turn, np.int64)
        return observe.Observers(len(self.agents), *columns, choice, offsets, targets, turn=turn, seen=seen)

    def _plain_looks(self) -> strategies.SensorTable | None:
        """Return the sensors of all agents, if the core has all that they show; else None."""
        state, movement, places = self._state, self._movement, self._state.places
        if movement.leaves_nodes or state.noted:
            return None
        if places is not None and (places.edge[..., 0] >= 0).any():
            return None
        if "looks" not in state.shared:
            state.shared["looks"] = made_looks(state, [True] * len(self.roster.names))
        found: strategies.SensorTable = state.shared["looks"]
        return found

    @property
    def living(self) -> BoolArray:
        """Which agents are alive, (games, all agents)."""
        return locked(self._state.alive[self.games])

    @property
    def is_there(self) -> BoolArray:
        """Which agents are in the game, dead or alive, (games, all agents); the others have not come yet."""
        return locked(self._state.is_there[self.games])

    @property
    def _blocked(self) -> BoolArray:
        """Which agents conflicts have stopped in the last turn, (games, agents)."""
        blocked: BoolArray = self._state.chosen(self._state.blocked, self.games, self.agents)
        return blocked

    def routes(self, weight: str | None = "length") -> RouteTable:
        """Return how far it is to nodes, and which action leads there, by rows; `weight` as for `graph.distance`.

        All batches on equal graphs share these tables, and those of other graphs are kept up to 512 MB.
        """
        return self._movement.routes(weight)

    def flows(self) -> Flows:
        """Return what spreads along the edges: random walks, probabilities that diffuse, and which nodes are in reach.

        What it works out is kept for the batch.
        """
        return kept_in(self._shared, "flows", lambda: Flows(self.streets))

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a strategy remembers of all games of the batch, at first what `make(games)` gives.

        Index its arrays with `games`.
        """
        return self._state.keep(key, make, is_new=bool(self._state.takes_up[self.agents].all()))

    def _checked(self, given: object, by: str, *, may_aim: bool = False) -> IntArray:
        """Return actions as integers (games, agents), 0 for those that are not alive.

        Args:
            given: the actions.
            by: what has given them, for messages.
            may_aim: whether they may be those of `towards`.

        Raises:
            BadType, BadValue: they are no integers, too many or too few, or one is not the number of a legal node.
        """
        actions = as_actions(given, self.node.shape, by)
        chosen = np.where(self.mask, actions.astype(np.int64, copy=False), self._movement.idle)  # 64 bits hold STOP
        may_aim &= self._movement.has_aims
        leads_on = None if chosen.max(initial=0) < STOP else (chosen >= STOP) & (may_aim | ~self.mask)
        if leads_on is not None and leads_on.all():
            return chosen
        # NOTE: one comparison, for a negative number is a large one without its sign (benchmarks: batches).
        is_wrong = chosen.view(np.uint64) >= self._counts_of(leads_on).view(np.uint64)
        if is_wrong.any():
            game, agent = np.argwhere(is_wrong)[0]
            raise BadValue(
                f"{by}: action {chosen[game, agent]} of agent {self.roster.name(self.agents[agent])} in game "
                f"{self.games[game]}, turn {self.turn[game]}, is not the number of a legal node: it has "
                f"{self.counts[game, agent]}, numbered from 0."
            )
        return chosen

    def _counts_of(self, leads_on: BoolArray | None) -> IntArray:
        """Return how many numbers of actions are legal; of agents that lead on, any number; None: none does."""
        if leads_on is None:
            return self.counts
        which = np.nonzero(~leads_on)
        found = np.full(self.node.shape, np.iinfo(np.int64).max)
        found[which] = self._movement.counts(self._movement.choices(self.node[which], numbers_in(self, which)))
        return found


def as_actions(given: object, shape: tuple[int, ...], by: str) -> IntArray:
    """Return actions as an array of integers, one for each game and agent.

    Args:
        given: the actions.
        shape: games and agents.
        by: what has given them, for messages.

    Raises:
        BadType, BadValue: they are no integers, or too many or too few.
    """
    try:
        actions = np.asarray(given)
    except ValueError:  # lists of several lengths
        actions = np.array(None)
    if actions.size and actions.dtype.kind not in "iu":
        raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.")
    if actions.shape != shape:
        raise BadValue(
            f"{by}: there is one action for each game and agent, an array {shape}, "
            f"not one of the shape {actions.shape}."
        )
    return actions


def movement_in(view: ArrayView) -> Movement:
    """Return how the agents of a view go; for the strategies of GAMMS."""
    return view._movement


def numbers_in(view: ArrayView, which: Any) -> tuple[IntArray, IntArray]:
    """Return the numbers of games in the batch and of agents in the roster, of some agents of a view."""
    shape = view.node.shape
    return np.broadcast_to(view.games[:, None], shape)[which], np.broadcast_to(view.agents, shape)[which]


def views_by_map(view: ArrayView) -> Iterator[tuple[IntArray, ArrayView]]:
    """Yield the views of games with the same roads, and their places in a view."""
    for _, places in view._state.roads.by_map(view.games):
        yield places, view.in_games(places)


def vectors_in(view: ArrayView, others: int, more: int, threads: int) -> Vectors:
    """Return the vectors of a view with further entries; see `Encoder.encode`."""
    return view._encoded(others, more, threads)


def observers_in(view: ArrayView) -> observe.Observers:
    """Return the agents of a view as the core takes them."""
    return view._observers(view.mask, np.arange(len(view.games)) * len(view.agents))


def lasting_in(
    view: ArrayView, agents: IntArray, others: int, mask: BoolArray
) -> tuple[Encoder, observe.Observers, BoolArray, OpenRoads] | None:
    """Return what writes the vectors of agents after any turn, as long as the games are on their map.

    Args:
        view: of the games.
        agents: numbers in the roster, in any order.
        others: how many others vectors have.
        mask: (all games, agents) which are alive, in whose rows vectors are written; it may change.

    Returns:
        And (all games, all agents) who is alive, and which roads are open. None: turns change what agents see, or where
        they may go, in other columns than these.
    """
    those = view.of(agents)
    if not those._movement.are_plain(agents) or those._plain_looks() is None:
        return None
    return (
        those._encoder(others),
        those._observers(mask, view.games * len(agents)),
        view._state.alive,
        view._state.roads,
    )


class _ByName(Mapping[str, T]):
    """What sensors show, or channels have brought, to the agents of a view; worked out when it is read."""

    def __init__(self, names: Iterable[str], ask: Callable[[str], T]) -> None:
        self._names, self._ask = tuple(names), ask

    def __getitem__(self, name: str) -> T:
        return self._ask(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _sensors(view: ArrayView) -> Mapping[str, Seen | SeenNodes]:
    agents = view.roster.agents
    of_nodes = names_of(agents, view.agents, SHOWING_NODES)
    names = sorted({*names_of(agents, view.agents, SHOWING_AGENTS), *of_nodes})
    return _ByName(names, lambda name: view.seen_nodes(name) if name in of_nodes else view.seen(name))


_VALUES: dict[str, Callable[[ArrayView], Any]] = {
    "curr_pos": lambda view: view.streets.ids_of(view.node),
    "edge": lambda view: view._places().edge,
    "offset_m": lambda view: view._places().offset_m,
    "xy": lambda view: view._places().xy,
    "z": lambda view: view._heights(),
    "legal": lambda view: view._legal(),
    "mask": lambda view: view.mask,
    "name": lambda view: tuple(view.roster.names[number] for number in view.agents.tolist()),
    "team": lambda view: tuple(view.roster.teams[team] for team in view.roster.team_of[view.agents].tolist()),
    "turn": lambda view: view.turn,
    "time": lambda view: view._time(),
    "draw": lambda view: view.draw,
    "facts": lambda view: view._state.facts,
    "sensor": _sensors,
    "blocked": lambda view: view._blocked,
    "deeds": lambda view: view._state.deeds.declared,
    "inbox": lambda view: _ByName(view._channels, view.heard),
}

_OTHERWISE = {  # keys of `state` -> what is there instead
    "memory": "view.keep(key, make)",
    "team_memory": "view.keep(key, make) and view.memory_of",
    "rng": "view.draw",
    "outbox": "view.send(channel, where, body)",
    "action": "what the form returns, and view.do(deed, where)",
    "quat": "view['xy'] of two turns",
    "fork": "ctx.game.batch",
}
