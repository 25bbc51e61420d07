"""The argument of array strategies, also used by learners: the agents of one strategy in all games at once."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_count, as_edges, as_key, as_numbers_of
from gamms.core import observe, sight
from gamms.core.moves import NO_EDGE
from gamms.core.turn import LearnerStep, TurnsOfGames
from gamms.errors import BadType, BadValue, UnknownAttribute, UnknownName
from gamms.game.array_functions.aims import ActionFinder
from gamms.game.block.columns import get_or_make, lock
from gamms.game.block.sensing import (
    SHOWING_AGENTS,
    SHOWING_NODES,
    VisibleAgentPairs,
    VisibleNodes,
    find_search,
    find_seen_agents,
    find_seen_nodes,
    list_sensor_names,
)
from gamms.game.block.state import Arrays, GameArrays, MapViewMixin
from gamms.game.block.strategy_steps import LOOKING, AskedSteps, collect_looks, has_plain_looks, make_search
from gamms.game.block.vectors import (
    Encoder,
    ObservationVectors,
    RoadDistances,
    Vectors32,
    find_distances,
    get_legal_buffers,
    make_distances,
    write_in_threads,
    write_vectors,
)
from gamms.game.conflicts import flatten
from gamms.game.lasting import DeedReader, DeedsInProgress
from gamms.game.messages import OutgoingMessages, ReceivedMessages
from gamms.game.movement.legal_moves import Movement, MovesInContexts, Places
from gamms.game.movement.routes import RouteTable
from gamms.game.random_streams import ArrayDraws
from gamms.game.strategy_specs import CoreStep, get_strategy_spec
from gamms.ir.deeds import ArrayDeeds
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.readonly import ShallowCopyMixin, copy_locked
from gamms.text import as_code, shown

ArrayStrategy = Callable[["ArrayView"], Any]
"""Returns indices of legal nodes, array-like (games, agents); see docs/batches.md."""

T = TypeVar("T")
V = TypeVar("V", bound="ArrayView")
_NO_CHOICES = flatten(np.zeros(0), np.int64)
_TURNS_AHEAD = 100  # if learners could be on all nodes within as many turns, all distances by road are searched before
_NO_PAIRS = flatten(np.zeros(0), np.int64), flatten(np.zeros(0), np.int64), flatten(np.zeros(0), np.uint8)


def _make_nameless_error(verb: str) -> BadValue:
    """Return the error of an array strategy that calls a verb without having its name in its code."""
    name = verb.partition(" ")[0]
    return BadValue(
        f"Batches call an array strategy that uses {verb} game by game, and the code of this one does not name "
        f"{name}: call {name} in the strategy itself, or in a function of your program that it calls."
    )


class ArrayView(MapViewMixin, ShallowCopyMixin, Mapping[str, Any]):
    """The agents of one strategy in many games, as arrays (games, agents).

    A view has the keys of `state` in array form. `view["curr_pos"]` are node ids; `view["legal"]` are the ids of legal
    nodes, (games, agents, most), padded with -1; `view["mask"]` is the mask of the agents to decide for. `name` and
    `team` have one entry for each agent, `turn` has one for each game. `sensor` and `inbox` map the names of sensors
    and channels to observations and messages.

    Attributes:
        games: (games,) the number of each game in the batch.
        agents: (agents,) the number of each agent in the roster, ascending.
        node: (games, agents) the row of each agent's node.
        mask: (games, agents) the living agents to decide for; at arrivals and in a view by `only`, a part of them.
        turn: (games,) the number of turns played.
        draw: random numbers, one for each agent.
        streets: the graph.
        roster: the agents of every game.
        memory_of: (all agents,) the number of each agent's memory; agents of a team may share one.
    """

    _not_pickled = (
        "A view can neither be pickled nor copied deeply, because it shows its games as they are now. Copy the arrays "
        "that you need, such as view['curr_pos'].copy()."
    )
    _deeds: list[ArrayDeeds] | None = None  # the deeds of the agents, in order; None: no strategy is deciding
    _outboxes: list[OutgoingMessages] | None = None  # their messages, in order; None: no strategy is deciding
    _channels: Iterable[str] = ()  # the names of the channels with an inbox
    _named: IntArray | None = None  # the edges that the agents take, -1: none; None: no strategy is deciding
    _aims: ActionFinder | None = None  # the actions of agents with speeds toward nodes, in single games
    _width: int | None = None  # the number of actions that vectors have entries for; None: that of the map

    def __init__(self, state: GameArrays, games: IntArray, agents: IntArray) -> None:
        self._state = state
        self.games = copy_locked(games)  # other views and the batch may have it, too
        self.agents = copy_locked(agents)
        self.streets, self._movement, self._shared = state.make_map_data(games, agents)
        self.roster = state.roster
        if state.apart and not state.apart.keys().isdisjoint(games.tolist()):
            apart = MovesInContexts(state.apart, self.roster.names, self.streets, state.reading)
            self._movement = self._movement.add_contexts(apart)
        self.memory_of = state.memory_of
        self.node: IntArray = state.select_values(state.node, games, agents)
        self.mask: BoolArray = state.select_values(state.alive, games, agents)
        self.turn = state.turn[games]
        self._counts: IntArray | None = None
        self.draw = ArrayDraws(self._draw_keys, self.turn[:, None])
        self._whole = self.mask
        self._sights = dict[Hashable, VisibleAgentPairs]()

    def _draw_keys(self) -> BitArray:
        """Return the keys of the draws of the agents, (games, agents)."""
        keys: BitArray = self._state.select_values(self._state.draw_keys(), self.games, self.agents)
        return keys

    def _lock(self) -> None:
        """Make the arrays read-only for strategies."""
        for name in ("node", "mask", "turn"):
            setattr(self, name, copy_locked(getattr(self, name)))

    def __getitem__(self, key: str) -> Any:
        if key in _VALUES:
            return _VALUES[key](self)
        if key in _OTHERWISE:
            raise UnknownName(f"key of a view: use {_OTHERWISE[key]} instead of", key)
        raise UnknownName("key of a view", key, tuple(_VALUES))

    if not TYPE_CHECKING:  # checkers report unknown names themselves

        def __getattr__(self, name: str) -> object:
            """Raise an error that says what to use."""
            raise UnknownAttribute("A view", name, dir(type(self)), {"flows": " Use gamms.belief.GamesFilter."}.get)

    def __iter__(self) -> Iterator[str]:
        return iter(_VALUES)

    def __len__(self) -> int:
        return len(_VALUES)

    @property
    def num_actions(self) -> int:
        """The number of actions in masks and vectors: the most legal nodes of any node, on all maps of learners.

        Raises:
            BadValue: an agent has more than 4096 legal nodes.
        """
        return count_actions(self) if self._width is None else self._width

    @property
    def counts(self) -> IntArray:
        """The number of legal nodes of each agent, including its own."""
        if self._counts is None:
            counts = self._movement.count_legal(self.node, get_numbers(self, np.s_[:, :]))
            self._counts = counts if self._state.flights is None else np.where(self._in_air, 1, counts)
            if self._deeds is not None:  # a strategy must not write to it
                self._counts = copy_locked(self._counts)
        return self._counts

    @property
    def flies(self) -> bool:
        """Whether all agents of the view fly; then a strategy returns offsets of flights."""
        return bool(self.roster.flies[self.agents].all())

    @property
    def _in_air(self) -> BoolArray:
        """Whether each agent flies, (games, agents); legal is only the node below it."""
        return np.broadcast_to(self.roster.flies[self.agents], self.node.shape)

    def _get_heights(self) -> FloatArray:
        heights = np.zeros(self.node.shape)
        flies, xyz = self._state.get_air_positions(self.games, self.agents)
        heights[:, flies] = xyz[..., 2]
        return heights

    def legal_rows(self, which: Any = np.s_[:, :]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of each agent, (games, agents, most), and a mask of valid entries.

        Args:
            which: an index of some agents of the view.
        """
        rows, is_legal = self._movement.find_legal(self.node[which], get_numbers(self, which))
        if self._state.flights is None:
            return rows, is_legal
        is_legal[..., 1:] &= ~self._in_air[which][..., None]
        most = int(is_legal.sum(axis=-1).max(initial=1))
        return rows[..., :most], is_legal[..., :most]

    def _get_time(self) -> FloatArray:
        return self._state.time[self.games]

    def _get_doings(self) -> DeedsInProgress:
        reader: DeedReader | None = self._state.doings
        if reader is None:
            raise UnknownName("key of a view: as ctx.game.deeds declares no deed that lasts, it has no", "doing")
        return reader.read(self.games, self.agents, self.turn, self._get_time())

    def _get_legal_nodes(self) -> IntArray:
        rows, is_legal = self.legal_rows()
        return np.where(is_legal, self.streets.get_ids(rows), -1)

    def _get_legal_edges(self) -> IntArray:
        found = self._movement.list_legal_edges(self.node, get_numbers(self, np.s_[:, :]))
        return np.where(self._in_air[..., None], -1, found)

    def _compute_places(self) -> Places:
        """Return the positions of the agents; in games by metres, some may be on edges."""
        found = self._movement.make_places(self.node, get_numbers(self, np.s_[:, :]))
        flies, xyz = self._state.get_air_positions(self.games, self.agents)
        found.xy[:, flies] = xyz[..., :2]
        return found

    def action_to(self, nodes: Any) -> IntArray:
        """Return the actions that lead to these node ids, (games, agents); -1 if a node is not legal.

        Raises:
            BadType, BadValue: the ids are not integers, or do not broadcast to (games, agents).
            UnknownName (KeyError): a node is not on the map.
        """
        wanted = self.streets.rows(as_array(nodes, "nodes", "integers", self.node.shape))
        actions = self._movement.find_action(self.node, get_numbers(self, np.s_[:, :]), wanted)
        return actions if self._state.flights is None else np.where(self._in_air & (actions > 0), -1, actions)

    def towards(self, targets: IntArray, which: Any = np.s_[:, :], allowed: BoolArray | None = None) -> IntArray:
        """Return the actions that move agents toward nodes, as the strategies of `gamms.strategies` do.

        For agents with speeds, these are not numbers of legal nodes, but lead as far as the turn allows.

        Args:
            targets: rows of nodes.
            which: an index of the agents of the view, (games, agents).
            allowed: (nodes,) the nodes that may be entered, including the targets; None: all.

        Returns:
            The actions; -1 if there is no path.

        Raises:
            BadType, BadValue: the targets are not rows of nodes.
        """
        node = self.node[which]
        games, agents = get_numbers(self, which)
        asked = node.ravel(), np.broadcast_to(self.streets.check_rows(targets, "targets"), node.shape).ravel()
        if self._aims is not None:
            return self._aims.find_action_towards(*asked, (games.ravel(), agents.ravel()), allowed).reshape(node.shape)
        if not self._movement.acts_by_paths:
            return self._movement.find_action_towards(*asked, allowed).reshape(node.shape)
        if self._deeds is None:
            raise BadValue("view.towards of agents with speeds works only while a strategy decides.")
        raise _make_nameless_error("view.towards of agents with speeds")

    def take_edges(self, edges: object) -> None:
        """Make agents take edges, whatever moves the strategy returns for them.

        Args:
            edges: the ids of edges, (games, agents), of those in `view["legal_edges"]`; -1: the agent moves as the
                strategy returns. Agents outside the view's mask are skipped.

        Raises:
            BadType, BadValue: they are not integers, or no strategy is deciding.
        """
        if self._named is None:
            raise BadValue("view.take_edges works only while a strategy decides: games.step takes 'edges', too.")
        wanted = as_edges(edges, "edges", self.node.shape)
        np.copyto(self._named, wanted, where=self.mask & (wanted >= 0))

    def only(self, asked: BoolArray) -> Self:
        """Return a view for a part of a strategy that decides only for the agents in `asked`, (games, agents).

        Its arrays contain all agents; its draws count only for the agents in its mask.
        """
        narrowed = copy(self)
        narrowed.mask = self.mask & as_array(asked, "asked", "booleans", self.node.shape)
        narrowed.draw = self.draw.only(narrowed.mask)
        return narrowed

    def of(self, agents: IntArray) -> "ArrayView":
        """Return a view of other agents in the same games, by their numbers in the roster, ascending."""
        numbers = as_numbers_of(agents, "agents", len(self.roster.names), "agents").reshape(-1)
        return widen(ArrayView(self._state, self.games, numbers), self._width)

    def in_games(self, which: IntArray) -> "ArrayView":
        """Return a view of the same agents in some games of this view, by index, ascending."""
        places = as_numbers_of(which, "which", len(self.games), "games").reshape(-1)
        return widen(ArrayView(self._state, self.games[places], self.agents), self._width)

    def ask(self, strategy: Callable[..., object]) -> Any:
        """Return what another strategy chooses for the agents in the mask, which go on drawing where it has stopped.

        Args:
            strategy: an array strategy, for example of a policy; or one of `gamms.strategies`, for agents along one
                edge a turn; or a function that makes it, such as `chase`.

        Returns:
            The actions, (games, agents), 0 for other agents and where the strategy chooses nothing; of agents that
            fly, their offsets, (games, agents, 3).

        Raises:
            BadType: the strategy is called agent by agent.
            BadValue: it looks for agents by sensors that err or look from the air, or the agents have speeds or fly.
        """
        name = as_code(strategy)
        spec = get_strategy_spec(self._make_strategy(strategy))
        if spec.array_form is not None:
            return self._call(spec.array_form, name)
        if spec.core_steps is None:
            raise BadType(
                f"view.ask needs an array strategy or one of gamms.strategies, not {name}, which is called agent by "
                "agent: write it with @gamms.array_strategy."
            )
        self._refuse_to_ask(name, spec.core_steps)
        state = self._state
        key = "asked", spec.core_steps, self.agents.tobytes()
        asked = get_or_make(state.asked, key, lambda: AskedSteps(state, spec.core_steps or (), self.agents))
        drawn = np.broadcast_to(self.draw.count, self.node.shape).astype(np.int64)
        found: IntArray = asked.choose(self.games, self.mask, drawn)
        self.draw.go_to(drawn)
        return found

    def _make_strategy(self, strategy: object) -> Any:
        """Return a strategy, or the strategy that a function makes in the context of the map."""
        state = self._state
        if state.strategy_in is None:
            return strategy
        known: tuple[object, Any] | None = state.asked.get(id(strategy))
        if known is None or known[0] is not strategy:
            known = strategy, state.strategy_in(strategy)
            state.asked[id(strategy)] = known
        return known[1]

    def _refuse_to_ask(self, name: str, steps: Sequence[CoreStep]) -> None:
        """Refuse to let agents of the view decide by the steps of a strategy if the core cannot do that."""
        state = self._state
        if not state.movement.is_plain or self.flies:
            raise BadValue(f"view.ask({name}) is for agents that move along one edge a turn.")
        agents = [state.roster.agents[number] for number in self.agents.tolist()]
        looks = any(step.kind in LOOKING for step in steps)
        if looks and not (all(map(has_plain_looks, agents)) and not state.roster.flies.any()):
            raise BadValue(
                f"view.ask({name}) looks for agents: its own need sensors of agents that neither err nor report late, "
                "and no agent of the game flies."
            )

    def do(self, deed: str, where: Any, /, **fields: object) -> None:
        """Make agents do a deed besides moving, as declared in `ctx.game.deeds`; deeds keep the order of the calls.

        Args:
            deed: the name of the deed.
            where: a mask of agents, (games, agents); agents outside the view's mask are skipped.
            fields: one value for all, or an array (games, agents). Agents are numbers in the roster, nodes are rows;
                -1, or None in other fields, omits an optional field.

        Raises:
            UnknownName (KeyError): there is no such deed or field.
            BadType, BadValue: a field is missing or impossible, an agent already does this deed, or no strategy is
                deciding.
        """
        if self._deeds is None:
            raise BadValue("view.do works only while a strategy decides: it is not for games.observe.")
        chosen = as_array(where, "where", "booleans", self.node.shape) & self.mask
        for earlier in self._deeds:
            if earlier.kind == deed and chosen[earlier.at, np.searchsorted(self.agents, earlier.agents)].any():
                raise BadValue(f"An agent does {deed!r} twice in a turn: give each call of view.do other agents.")
        who = (self.games, self.agents)
        order = len(self._deeds)
        self._deeds.append(self._state.deeds.check_deeds(deed, fields, chosen, who, self.node, order))

    def send(self, channel: str, where: Any, body: object, to: object = None) -> None:
        """Make agents send one message each by a channel, like `state["outbox"]`; messages keep the order of the calls.

        Args:
            channel: the name of the channel.
            where: a mask of agents, (games, agents); agents outside the view's mask are skipped.
            body: one plain value for all, or an array whose first axes are games and agents.
            to: an agent, a team, or None for everybody on the channel; or an array (games, agents) of numbers in the
                roster.

        Raises:
            UnknownName (KeyError): there is no such channel, agent or team.
            BadType, BadValue: a team may not use the channel, a body is not plain, or no strategy is deciding.
        """
        radio = self._state.radio
        if radio is None:
            raise BadValue(f"Channel {shown(channel)} cannot be used: the game has no channels. Declare it before.")
        if self._outboxes is None:
            raise BadValue("view.send works only while a strategy decides.")
        chosen = as_array(where, "where", "booleans", self.node.shape) & self.mask
        who = (self.games, self.agents)
        order = len(self._outboxes)
        self._outboxes.append(radio.check_messages(channel, chosen, who, to, body, order))

    def heard(self, channel: str) -> ReceivedMessages:
        """Return the messages from a channel in the inboxes of the agents in the mask.

        Raises:
            UnknownName (KeyError): there is no such channel, or the games are only observed.
        """
        radio = self._state.radio
        if self._outboxes is None:
            raise UnknownName("channel of games that are observed", channel, ())
        if radio is None:
            raise UnknownName("channel", channel, ())
        return radio.find_heard(channel, self.games, self.turn, self.agents, self.mask)

    def seen(self, *names: str) -> VisibleAgentPairs:
        """Return the agents that sensors show to the agents in the mask, as pairs; no agent sees itself.

        Args:
            names: names of sensors; none: all sensors that show agents. A named sensor at a fixed place also shows its
                own agent.

        Raises:
            UnknownName (KeyError): no agent carries a sensor of this name that shows agents.
        """
        key = as_key(names, "The name of a sensor")
        if key not in self._sights:
            self._sights[key] = self._look_with_sensors(names)
        found = self._sights[key]
        return found if self.mask is self._whole else found.of(self.mask[found.at, found.viewers])

    def _look_with_sensors(self, names: tuple[str, ...]) -> VisibleAgentPairs:
        """Return the pairs that sensors of these names, or all sensors, show to all agents of the view."""
        state = self._state
        key = ("seen", self.agents.tobytes(), names)
        are_all = len(self.games) == len(state)
        known: VisibleAgentPairs | None = state.now.get(key)
        if known is not None:
            return known if are_all else known.in_games(self.games)
        found = find_seen_agents(state, self.games, self.agents, self._whole, names, self._get_all_positions)
        lock(found[1:])  # other views get them, too
        if are_all:
            state.now[key] = found
        return found

    def _get_all_positions(self) -> FloatArray | None:
        """Return the positions of all agents of these games, (games, all agents, 2); None: all are on their nodes."""
        if not self._movement.leaves_nodes:
            return None
        return ArrayView(self._state, self.games, np.arange(len(self.roster.names)))._compute_places().xy

    def seen_nodes(self, *names: str) -> VisibleNodes:
        """Return the nodes that sensors show to the agents in the mask: NEIGHBOR, MAP, RANGE, ARC and OCCLUDED_MAP.

        Args:
            names: names of sensors; none: all sensors that show nodes.

        Raises:
            UnknownName (KeyError): no agent carries a sensor of this name that shows nodes.
            BadValue: a sensor is of a user's class.
            TooLarge: the agents see more than 268 million nodes together.
        """
        named = as_key(names, "The name of a sensor")
        with self._state.reading():
            return find_seen_nodes(self._state, self.games, self.agents, self.node, self.mask, named)

    def enemies(self) -> VisibleAgentPairs:
        """Return the visible agents of other teams, as pairs; an agent without a team (None) is an enemy of all."""
        found = self.seen()
        return found.of(~self._are_mates(found))

    def mates(self) -> VisibleAgentPairs:
        """Return the visible agents of the same team, as pairs."""
        found = self.seen()
        return found.of(self._are_mates(found))

    def _are_mates(self, found: VisibleAgentPairs) -> BoolArray:
        """Return whether each pair is of the same team, (pairs,)."""
        return self.roster.are_mates(self.agents[found.viewers], found.others)

    def vector(self, others: int = 4) -> ObservationVectors:
        """Return observations as vectors of equal length, (games, agents, entries).

        The entries are `x` and `y`, the agent's position; for each action `is_legal`, `dx` and `dy`; for each of the
        nearest `others` visible agents `is_seen`, `is_mate`, `dx`, `dy` and `road`. Offsets are straight-line, and
        `road` is the length of the shortest path from the agent's node to the other's: at most 2, and 2 without a path.
        The unit is half of the longer side of the map, and the origin is its center.

        Raises:
            BadValue: an agent has more than 4096 legal nodes.
            TooLarge: the vectors would not fit into memory.
        """
        return self._encode_vectors(as_count(others, "others", least=0), 0, 1)

    def _encode_vectors(self, others: int, more: int, threads: int) -> ObservationVectors:
        """Return vectors with `more` additional entries: 0, except the last one, n / (n + 100) after n turns."""
        encoder = self._make_encoder(others)
        found = encoder.allocate_vectors(self.mask, more)
        xy = self._compute_places().xy if self._movement.leaves_nodes else None
        places = np.arange(len(self.games))
        observers = self._get_observers(self.mask, places * len(self.agents), are_looking=others > 0)
        rooms = encoder.make_scratch(self._make_road_distances().take_roads(), threads)
        write_vectors(observers, encoder.make_output(found, xy), places, rooms)
        return found

    def _make_road_distances(self) -> RoadDistances:
        """Return the distances by road for vectors, in all games."""
        state = self._state
        return get_or_make(state.shared, "road distances", lambda: RoadDistances(state.roads))

    def _make_encoder(self, others: int) -> Encoder:
        """Return an encoder for vectors with `others` other agents."""
        agents = len(self.roster.names)
        actions = self.num_actions
        key = "encoder", agents, others, actions
        return get_or_make(self._shared, key, lambda: Encoder([self.streets.columns.xy], agents, others, actions))

    def _get_observers(self, mask: BoolArray, rows: IntArray, *, are_looking: bool = True) -> observe.Observers:
        """Return the agents in the form of the core.

        Args:
            mask: the living agents, in rows of the output.
            rows: (games,) the first row of each game.
            are_looking: whether they see other agents.
        """
        streets = self.streets
        choice = _NO_CHOICES
        if self._movement.are_plain(self.agents) and not self._in_air.any():
            offsets, targets = get_or_make(
                self._shared, "along edges", lambda: get_legal_buffers(streets.offsets, streets.targets)
            )
        else:
            nodes, is_legal = self.legal_rows()
            counts = is_legal.sum(axis=-1).reshape(-1)
            choice = flatten(np.arange(len(counts)), np.int64)
            offsets, targets = get_legal_buffers(np.concatenate(([0], np.cumsum(counts))), nodes[is_legal])
        search = find_search(self._state) if self._has_plain_looks else None
        pairs = _NO_PAIRS
        if are_looking and search is None:
            found = self.seen()
            number = self.node.size
            counts = np.bincount(found.at * self.node.shape[1] + found.viewers, minlength=number)
            first = np.concatenate(([0], np.cumsum(counts)))
            pairs = flatten(first, np.int64), flatten(found.nodes, np.int64), flatten(self._are_mates(found), np.uint8)
        games = flatten(self.games, np.int64), flatten(rows, np.int64)
        of_maps = self._state.no_node, self._make_road_distances().first, self._find_first_road_of_modes()
        return self._make_observers(mask, games, (choice, offsets, targets), (search, *pairs), of_maps)

    def _make_observers(
        self,
        mask: BoolArray,
        games: tuple[Any, Any],
        legal: tuple[Any, Any, Any],
        seen: tuple[Any, ...],
        first: tuple[IntArray, IntArray, IntArray],
    ) -> observe.Observers:
        """Return the agents of the view in the form of the core; see `observe.Observers`.

        Args:
            mask: the living agents, in rows of the output.
            games: the numbers of the games, and the first row of each.
            legal: the legal nodes.
            seen: the search for visible agents, or the pairs of agents.
            first: (all games,) the first node of the map of each game, and of its roads in the tables of distances;
                (agents,) the offset of the roads that each agent may use.
        """
        roster = self.roster
        state = self._state
        visible = observe.VisibleAgents(
            *seen,
            viewers=flatten(self.agents, np.int64),
            node=flatten(state.node, np.int64),
            alive=flatten(state.alive.view(np.uint8), np.uint8),
            team=flatten(roster.team_of, np.int64),
            nobody=roster.nobody,
        )
        is_asked = flatten(mask.view(np.uint8), np.uint8)
        return observe.Observers(
            len(self.agents),
            *games,
            is_asked,
            *legal,
            first_node=first[0].data,
            first_road=first[1].data,
            mode_first=flatten(first[2], np.int64),
            turn=flatten(state.turn, np.int64),
            seen=visible,
        )

    def _find_first_road_of_modes(self) -> IntArray:
        """Return the offset from the first road of a game to the roads that each agent may use, (agents,)."""
        movement = self._state.movement
        if not movement.modes:
            return np.zeros(len(self.agents), np.int64)
        found: IntArray = movement.mode_of[self.agents] * self._state.roads.tables.stride
        return found

    @property
    def _has_plain_looks(self) -> bool:
        """Whether the core finds the agents that all sensors show, from nodes."""
        return not (self._movement.leaves_nodes or self._state.noted)

    @property
    def living(self) -> BoolArray:
        """Whether each agent is alive, (games, all agents)."""
        return copy_locked(self._state.alive[self.games])

    @property
    def is_there(self) -> BoolArray:
        """Whether each agent is in the game, dead or alive, (games, all agents); others have not entered yet."""
        return copy_locked(self._state.is_there[self.games])

    @property
    def _blocked(self) -> BoolArray:
        """Whether a conflict stopped the last move of each agent, (games, agents)."""
        blocked: BoolArray = self._state.select_values(self._state.blocked, self.games, self.agents)
        return blocked

    def routes(self, weight: str | None = "length") -> RouteTable:
        """Return a table of distances and next actions, by rows of nodes; `weight` is as in `graph.distance`.

        All batches on equal graphs share these tables; tables of other graphs are kept up to 512 MB.
        """
        if self._movement.obey_turns(self.agents):
            raise BadValue(
                "view.routes has a row for each node, and agents of this view obey turn restrictions: their paths "
                "depend on the edges by which they came. view.towards knows turns."
            )
        return self._movement.get_routes(weight)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return the stored arrays of a strategy for all games of the batch; the first call stores `make(games)`.

        Index the arrays with `games`.
        """
        return self._state.keep(key, make)

    def _call(self, form: ArrayStrategy, name: str) -> Any:
        """Return the checked result of an array strategy: actions, (games, agents), or offsets of agents that fly."""
        given = form(self)
        if not self.flies:
            return self._check_actions(given, name)
        return as_flights(given, f"{name}: what an agent that flies does", self.node.shape, self.mask)

    def _check_actions(self, given: object, by: str) -> IntArray:
        """Return actions as integers (games, agents), 0 for dead agents.

        Args:
            given: the actions.
            by: the function that returned them, for messages.

        Raises:
            BadType, BadValue: they are not integers, have a wrong shape, or are not numbers of legal nodes.
        """
        actions = as_actions(given, self.node.shape, by)
        chosen = np.where(self.mask, actions.astype(np.int64, copy=False), 0)
        # NOTE: one comparison, because a negative number is a large one when unsigned (benchmarks: batches).
        is_wrong = chosen.view(np.uint64) >= self.counts.view(np.uint64)
        if self._aims is not None:
            is_wrong &= ~self._aims.are_known(chosen)
        if is_wrong.any():
            game, agent = np.argwhere(is_wrong)[0]
            raise BadValue(
                f"{by}: action {chosen[game, agent]} of agent {self.roster.name(self.agents[agent])} in game "
                f"{self.games[game]}, turn {self.turn[game]}, is not the number of a legal node: it has "
                f"{self.counts[game, agent]}, numbered from 0."
            )
        return chosen


def as_flights(given: object, what: str, shape: tuple[int, int], mask: BoolArray | None = None) -> FloatArray:
    """Return given flights as a checked array of these numbers of games and agents; those not in a mask may be NaN."""
    flights = as_array(given, what, "numbers")
    are_of_shape = flights.shape == (*shape, 3) and flights.dtype.kind != "b"
    if not are_of_shape or not np.isfinite(flights if mask is None else flights[mask]).all():
        raise BadValue(
            f"{what} are finite numbers (dx, dy, dz), an array {(*shape, 3)}, not {flights.dtype} of the shape "
            f"{flights.shape}."
        )
    return flights.astype(np.float64)


def as_actions(given: object, shape: tuple[int, ...], by: str) -> IntArray:
    """Return actions as an array of integers, one for each game and agent.

    Args:
        given: the actions.
        shape: the numbers of games and agents.
        by: the function that returned them, for messages.

    Raises:
        BadType, BadValue: they are not integers, or have a wrong shape.
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


def make_asked_view(state: GameArrays, games: IntArray, agents: IntArray, here: BoolArray | None = None) -> ArrayView:
    """Return a view for a strategy to decide with; `here` restricts its mask, (all games, all agents)."""
    view = ArrayView(state, games, agents)
    if here is not None:
        view.mask = view.mask & here[np.ix_(games, agents)]
        view._whole = view.mask
    view._deeds = []
    view._outboxes = []
    if state.radio is not None:
        view._channels = state.radio.channels
    view._lock()
    return view


def lead_along(view: ArrayView, edges: IntArray, actions: IntArray) -> IntArray:
    """Return actions with those that lead to the ends of legal edges, by their ids, or `NO_EDGE` or `STOP`.

    Agents with speeds find the ends of edges themselves; see `moves.OneEdgeMovers`.
    """
    if view._movement.depends_on_speeds:
        return np.where(edges == NO_EDGE, actions, 0)
    columns = view._movement.columns
    rows = kernels.find_rows(columns.edge_ids, edges, columns.edge_order)
    ends = np.where(edges >= 0, columns.targets[rows], view.node)
    numbers = view._movement.find_action(view.node, get_numbers(view, np.s_[:, :]), ends)
    return np.where(edges == NO_EDGE, actions, np.maximum(numbers, 0))


def get_movement(view: ArrayView) -> Movement:
    """Return the movement of the agents of a view; for the strategies of GAMMS."""
    return view._movement


def get_nodes(view: ArrayView, agents: IntArray) -> IntArray:
    """Return the rows of the present nodes of agents, by their numbers, in all games of the batch: (games, agents)."""
    return view._state.node[:, agents]


def find_driven_edges(view: ArrayView, agent: int) -> list[tuple[int, ...]]:
    """Return the ids of the edges by which an agent has come to its node in each game; see `GameState.driven`.

    Args:
        view: the view of an agent that obeys turn restrictions, or of another one in its games.
        agent: the number of the agent in the roster.
    """
    traffic = view._state.movement.traffic
    assert traffic is not None  # noqa: S101 - the agent obeys turns in a game by edges
    return [traffic.list_driven(game, agent) for game in view.games.tolist()]


def count_actions(view: ArrayView) -> int:
    """Return the number of actions of the games of a view, for which it may have more entries; see `widen`."""
    state = view._state
    return state.movement.width if state.width is None else state.width


def set_width(view: ArrayView, width: int) -> None:
    """Set the number of actions in all games with the map and the strategies of a view, at least that of the map."""
    view._state.width = width


def widen(view: ArrayView, width: int | None) -> ArrayView:
    """Return the view with another number of actions that vectors have entries for.

    Args:
        view: the view.
        width: the number, at least that of the map; None: that of the map.
    """
    if width == view._width:
        return view
    widened = copy(view)
    widened._width = width
    return widened


def get_pool_shares(view: ArrayView) -> FloatArray:
    """Return the numbers by which members of pools are drawn for the teams of the agents of a view, (games, agents)."""
    shares: FloatArray = view._state.select_values(view._state.draw_pool_shares(), view.games, view.agents)
    return shares


def get_numbers(view: ArrayView, which: Any) -> tuple[IntArray, IntArray]:
    """Return the game numbers and the roster numbers of some agents of a view."""
    shape = view.node.shape
    return np.broadcast_to(view.games[:, None], shape)[which], np.broadcast_to(view.agents, shape)[which]


def split_by_map(view: ArrayView) -> Iterator[tuple[IntArray, ArrayView]]:
    """Yield (indices, view) for each group of games of a view with the same open roads."""
    for _, places in view._state.roads.group_by_map(view.games):
        yield places, view.in_games(places)


def list_lasting_deeds(view: ArrayView) -> list[tuple[int, float]]:
    """Return the index of each deed that lasts among the declared ones, and how many turns it takes."""
    reader: DeedReader | None = view._state.doings
    return [] if reader is None else reader.lengths


def encode_vectors(view: ArrayView, others: int, more: int, threads: int) -> ObservationVectors:
    """Return the vectors of a view with additional entries; see `Encoder.allocate_vectors`."""
    return view._encode_vectors(others, more, threads)


def get_observers(view: ArrayView) -> observe.Observers:
    """Return the agents of a view in the form of the core."""
    return view._get_observers(view.mask, np.arange(len(view.games)) * len(view.agents))


class _LazyMapping(Mapping[str, T]):
    """A mapping of sensor or channel names to data for the agents of a view, computed on access."""

    def __init__(self, names: Iterable[str], ask: Callable[[str], T]) -> None:
        self._names = tuple(names)
        self._ask = ask

    def __getitem__(self, name: str) -> T:
        return self._ask(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _list_sensor_pairs(view: ArrayView) -> Mapping[str, VisibleAgentPairs | VisibleNodes]:
    agents = view.roster.agents
    of_nodes = list_sensor_names(agents, view.agents, SHOWING_NODES)
    names = sorted({*list_sensor_names(agents, view.agents, SHOWING_AGENTS), *of_nodes})
    return _LazyMapping(names, lambda name: view.seen_nodes(name) if name in of_nodes else view.seen(name))


_VALUES: dict[str, Callable[[ArrayView], Any]] = {
    "curr_pos": lambda view: view.streets.get_ids(view.node),
    "edge": lambda view: view._compute_places().edge,
    "offset_m": lambda view: view._compute_places().offset_m,
    "xy": lambda view: view._compute_places().xy,
    "z": lambda view: view._get_heights(),
    "legal": lambda view: view._get_legal_nodes(),
    "legal_edges": lambda view: view._get_legal_edges(),
    "mask": lambda view: view.mask,
    "name": lambda view: tuple(view.roster.names[number] for number in view.agents.tolist()),
    "team": lambda view: tuple(view.roster.teams[team] for team in view.roster.team_of[view.agents].tolist()),
    "turn": lambda view: view.turn,
    "time": lambda view: view._get_time(),
    "draw": lambda view: view.draw,
    "facts": lambda view: view._state.facts,
    "sensor": _list_sensor_pairs,
    "blocked": lambda view: view._blocked,
    "deeds": lambda view: view._state.deeds.declared,
    "doing": lambda view: view._get_doings(),
    "inbox": lambda view: _LazyMapping(view._channels, view.heard),
}

_OTHERWISE = {  # keys of `state` without array form -> the replacement
    "memory": "view.keep(key, make)",
    "team_memory": "view.keep(key, make) and view.memory_of",
    "rng": "view.draw",
    "outbox": "view.send(channel, where, body)",
    "action": "what the form returns, and view.do(deed, where)",
    "quat": "view['xy'] of two turns",
    "fork": "ctx.game.batch",
}


class TurnColumns(Protocol):
    """The columns of learners that a writer fills, (games, learners), and their form in the core."""

    core: observe.LearnerTurn
    alive: BoolArray
    counts: IntArray
    over: BoolArray
    was_over: BoolArray
    begun: BoolArray
    may_begin: np.ndarray[Any, np.dtype[np.uint8]]


class LearnerWriter:
    """Lets the core play the moves of learners, and write their rewards, ends and observations, in all games.

    Args:
        turn: the turns of the learners.
        observers: the learners in the form of the core.
        outputs: the form of their vectors and legal actions, now and before games begin again.
        rooms: scratch buffers; for each, a thread plays and writes a part of the games.
        first: (maps + 1,) the index of the first node of each map among the nodes of all maps.
        first_node: (games,) the index of the first node of each game's map.

    Attributes:
        values: (games, learners, entries) the vectors that were written last.
        legal: (games, learners, actions) the legal actions that were written last.
        begins: whether games that end begin again in a step, if they may.
        waits: whether they do so in the step after the one in which they end.
        last_values, last_legal: of games that have begun again in a step, the vectors and legal actions before.
        begun: the numbers of these games.
    """

    values: Vectors32
    legal: BoolArray
    last_values: Vectors32
    last_legal: BoolArray
    begun: IntArray

    def __init__(
        self,
        turn: TurnColumns,
        observers: observe.Observers,
        outputs: tuple[observe.VectorObservations, observe.VectorObservations],
        rooms: list[observe.NearestAgents],
        first: IntArray,
        first_node: IntArray,
    ) -> None:
        self._columns = turn
        self._turn = turn.core
        self._shape = turn.alive.shape
        self._games: Any = flatten(np.arange(self._shape[0]), np.int64)  # memoryviews are not subscriptable
        self._get_observers = observers
        self._output, self._last_output = outputs
        self._rooms = rooms
        self._first = first
        self._first_node = first_node
        self._steps: list[LearnerStep] = []
        self.begins = False
        self.waits = False
        self.begun = np.zeros(0, np.int64)
        self._make_arrays()
        self.last_values, self.last_legal = self._make_pair(self._last_output)

    def move(self, maps: IntArray) -> None:
        """Set the map of each game by its number, (games,)."""
        self._first_node[:] = self._first[maps]

    def _make_arrays(self) -> None:
        """Make arrays for new vectors and legal actions."""
        self.values, self.legal = self._make_pair(self._output)

    def _make_pair(self, output: observe.VectorObservations) -> tuple[Vectors32, BoolArray]:
        """Return arrays for vectors and legal actions, to which the core writes from now on."""
        values = np.empty((*self._shape, output.entries), np.float32)
        legal = np.empty((*self._shape, output.actions), np.bool_)
        buffers: Any = values.reshape(-1).data, legal.view(np.uint8).reshape(-1).data
        output.take(*buffers)
        return values, legal

    def take_back(self) -> None:
        """Write what the learners see after a turn was taken back."""
        self._columns.over[:] = self._columns.was_over
        self._columns.may_begin[:] = 0  # some threads may have begun games
        self.begun = self.begun[:0]
        self.look()

    def look(self, which: IntArray | None = None) -> None:
        """Write what the learners see into new arrays.

        Args:
            which: the numbers of the games in which it has changed; None: all.
        """
        values = self.values
        legal = self.legal
        self._make_arrays()
        games = self._games
        if which is not None:
            self.values[:] = values
            self.legal[:] = legal
            games = flatten(which, np.int64)

        def write_part(room: observe.NearestAgents, begin: int, end: int) -> None:
            observe.observe_turns_aside(self._turn, self._get_observers, self._output, room, games, begin, end)

        write_in_threads(write_part, len(games), self._rooms)

    def begin_step(
        self, turns: TurnsOfGames, given: "memoryview[int]", score: "memoryview[float]", teams: int
    ) -> list[LearnerStep]:
        """Return a step for each thread, which writes into new arrays; see `core.turn.LearnerStep`."""
        if not self._steps:
            of_games = turns, self._turn, given, score, teams, self._get_observers, self._output, self._last_output
            maps = flatten(self._first, np.int64), flatten(self._first_node, np.int64)
            self._steps = [LearnerStep(*of_games, room, *maps) for room in self._rooms]
        for room in self._rooms:
            room.searches = len(self._rooms) == 1
            room.lacks = False
        self._make_arrays()
        return self._steps

    def end_step(self) -> None:
        """Look again if the threads of a step lack distances by road, which only one thread may search."""
        self.begun = np.zeros(0, np.int64)
        if sum(step.num_begun for step in self._steps):
            self.begun = np.flatnonzero(self._columns.begun)
        if any(room.lacks for room in self._rooms):
            self.look()

    @property
    def num_ended(self) -> int:
        """The number of learners that ended in the last step."""
        return sum(step.num_ended for step in self._steps)


def make_writer(
    views: Sequence[ArrayView], maps: IntArray, agents: IntArray, turn: TurnColumns, others: int | None, threads: int
) -> LearnerWriter | None:
    """Return a writer for learners.

    Args:
        views: a view of the games on each map; a view may contain no games.
        maps: (games,) the number of the map of each game.
        agents: the numbers of the learners in the roster, in any order.
        turn: the columns of their turns.
        others: the number of other agents in a vector, whose last entry is n / (n + 100) after n turns; None: no
            vectors are written, only legal actions.
        threads: the number of threads that write.

    Returns:
        The writer; None if what learners see changes with more than the columns of the core, or sensors differ between
        maps.
    """
    those = [view.of(agents) for view in views]
    own = those[0]
    if own.roster.flies[agents].any() or not all(one._movement.are_plain(agents) for one in those):
        return None
    looks = [collect_looks(one.roster, [True] * len(one.roster.names)) for one in those]
    are_alike = all(one == looks[0] for one in looks) and all(one._has_plain_looks for one in those)
    if others is not None and not are_alike:
        return None
    streets = [one.streets for one in those]
    xy = [one.columns.xy for one in streets]
    first = np.cumsum([0, *(one.num_nodes for one in streets)])
    first_node = first[maps]
    search = None
    if others is not None:
        sensors = sight.SensorTable(*looks[0], len(own.roster.teams))
        search = make_search(own._state, sensors, np.concatenate(xy))
    seen = search, *_NO_PAIRS
    ends = np.cumsum(np.concatenate([one.counts for one in streets]))
    legal = get_legal_buffers(np.concatenate(([0], ends)), np.concatenate([one.targets for one in streets]))
    games = np.arange(len(maps))
    numbers = flatten(games, np.int64), flatten(games * len(agents), np.int64)
    observers = own._make_observers(
        turn.alive, numbers, (_NO_CHOICES, *legal), seen, (first_node, np.zeros_like(games), np.zeros_like(agents))
    )
    encoder = Encoder(xy, len(own.roster.names), others or 0, count_actions(own))
    ways = None
    vectors = encoder.allocate_vectors(turn.alive, 1)
    if others is None:
        vectors = vectors._replace(values=vectors.values[..., :0])
    else:
        ways = make_distances(streets)
        if turn.alive.size * _TURNS_AHEAD >= first[-1]:
            find_distances(ways, streets, _find_largest_squared_radius(looks[0], agents))
    vectors = vectors._replace(counts=turn.counts)
    outputs = encoder.make_output(vectors), encoder.make_output(vectors)
    return LearnerWriter(turn, observers, outputs, encoder.make_scratch(ways, threads), first, first_node)


def _find_largest_squared_radius(looks: tuple[Any, Any, Any], agents: IntArray) -> float:
    """Return the largest squared radius of the sensors of agents, see `collect_looks`; -1: they have none."""
    begins, squares, _ = looks
    of_agents = [square for agent in agents.tolist() for square in squares[begins[agent] : begins[agent + 1]]]
    return max(of_agents, default=-1.0)
