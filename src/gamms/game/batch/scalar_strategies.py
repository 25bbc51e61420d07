"""Strategies and plans without an array form in games that are played in arrays: asked as the turn engine asks them."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gamms.deciding import phase_of
from gamms.game.batch.channels import Outbox
from gamms.game.batch.columns import Failure, PlayedGame, agents_of, decider_of
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.flights import Flown, InAir
from gamms.game.batch.movement import AIMS, BY_HOPS, STOP, Route
from gamms.game.batch.rule_fork import RuleFork
from gamms.game.batch.scalar_rules import RuleContext
from gamms.game.batch.sight import Seen, SeenInSpace, look_of, lookouts, seen_from_air
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import SHOWING_NODES
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.unknown import NeedsTurnEngine
from gamms.game.batch.view import ArrayView
from gamms.game.channels import Outgoing
from gamms.game.decisions import Decisions
from gamms.game.facts import PrivateForks
from gamms.game.legality import IllegalAction, Legality, ResolvedAction
from gamms.game.messages import Inboxes
from gamms.game.order import Part
from gamms.game.random_streams import DrawTable
from gamms.game.slots import AgentSlot, restart_draws
from gamms.game.snapshots import copies_of
from gamms.ir.agents import Position, Quat
from gamms.ir.game_state import GameState, in_conflict
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.readonly import ReadOnlyMapping
from gamms.typing import AgentType, IAgent
from gamms.typing.game import EdgePlace
from gamms.typing.on_edges import PassedNode
from gamms.typing.sensor_engine import FROM_AIR, ISensor, SensorType

# From how many games on arrays are not slower, see decisions 0057 and 0058: where agents are asked, where they decide
# at arrivals, where their strategies may need their context, and where rules are called.
FEWEST, FEWEST_AT_ARRIVALS, FEWEST_IN_CONTEXT, FEWEST_CALLED = 16, 32, 64, 32
_MOST_ASKED = 4  # one in so many agents, where rules are called, too
_NOTHING: Mapping[str, Any] = {}
_REMEMBERED = ("memories", "team_memories", "blocked", "delayed_looks")  # of a game that has begun


class Players:
    """The agents of one game that are asked one by one.

    Args:
        begun: what the game was when the batch began.

    Attributes:
        state: what they remember and know, and why their last actions were not done.
        slots: number in the roster -> what the turn engine holds of each.
        living: the numbers of those that were asked last.
        part: the slots of these, and what is needed to ask them.
        made_for: the context and the number of its cast that the slots were made for.
        inboxes: what they hear there.
    """

    inboxes: Inboxes

    def __init__(self, begun: GameState) -> None:
        self.state = GameState(**copies_of(begun, _REMEMBERED))
        self.slots: dict[int, AgentSlot] = {}
        self.living: list[int] = []
        self.part: tuple[list[AgentSlot], Part]
        self.made_for: tuple[RuleFork | None, int] = None, 0

    def show_blocked(self, name: str) -> None:
        """Let the next state of an agent say why its last action was not done."""
        for slot in self.slots.values():
            if slot.name == name:
                slot.show_blocked()


class Answers(NamedTuple):
    """What agents do that were asked one by one.

    Attributes:
        actions: (games, agents)
        deeds, outboxes: what they do besides, and send.
        routes: ways that they give by nodes.
        flights: what those do that fly.
        failures: what they do wrong.
    """

    actions: IntArray
    deeds: list[ArrayDeeds]
    outboxes: list[Outbox]
    routes: list[Route]
    flights: list[Flown]
    failures: list[Failure]


class _Done(NamedTuple):
    """What the agents of one game do, by their places among those that were asked.

    Attributes:
        ends: the nodes that they go to.
        actions: of those that do more.
        messages: that they send.
        ways: of those that give their way by nodes.
        failures: what they do wrong.
    """

    ends: Sequence[int]
    actions: Mapping[int, ResolvedAction]
    messages: list[Outgoing]
    ways: Mapping[int, ResolvedAction]
    failures: list[Failure]

    def deeds(self) -> Iterator[tuple[int, int, str, Any]]:
        """Yield what they do besides: the agent, which of its deeds, its kind, and fields."""
        for i, action in self.actions.items():
            for order, (kind, values) in enumerate((action.deeds or _NOTHING).items()):
                yield i, order, kind, values

    def flights(self) -> Iterator[tuple[int, Position | None, Quat | None]]:
        """Yield which of them fly, where to and how turned."""
        for i, (*_, position, quat, _) in self.actions.items():
            if position is not None or quat is not None:
                yield i, position, quat


class _Targets(Legality):
    """Says which nodes agents want to go to, on ways that the movement of arrays finds, or the ways that they give.

    Attributes:
        legal: name -> the nodes that are legal for an agent now, of those that do not just go along one edge.
    """

    def __init__(self, fork: RuleFork) -> None:
        super().__init__(fork.ctx, fork.parts.settings)
        self._fork = fork
        self.legal: dict[str, tuple[int, ...]] = {}

    def travelled(self, mover: AgentSlot, here: int, wanted: int | list[int] | None) -> ResolvedAction:
        """Return where an agent wants to get in a game by metres."""
        if isinstance(wanted, list):
            if self._settings.decide == "arrival":
                self._fork.refuse("it gives the nodes of its way")
            return super().travelled(mover, here, wanted)
        if wanted is not None and (mover.speed is None or wanted not in self.legal.get(mover.name, ())):
            super().travelled(mover, here, wanted)  # which may find that it cannot
        return ResolvedAction(-1 if wanted is None else wanted, (here,))

    def walked(self, mover: AgentSlot, here: int, nodes: list[int], is_route: bool) -> ResolvedAction:
        """Return where an agent wants to get."""
        if is_route or nodes[0] not in self.legal.get(mover.name, ()):
            found = super().walked(mover, here, nodes, is_route)
            if is_route:
                is_plain = found.progress is None and len(found.path) == len({*found.path}) <= 2
                return ResolvedAction(found.end, (here,)) if is_plain else found
        return ResolvedAction(nodes[0], (here,))


class _Shown(NamedTuple):
    """Stands for a sensor of which arrays have said what it shows."""

    type: SensorType
    sees_world_only: bool = True

    def sense(self, node_id: int) -> None:
        """Leave what is shown."""


class _NoForks(PrivateForks):
    """Stands for `state["fork"]`, which copies a game that the turn engine plays."""

    __slots__ = ("_fork",)

    def __init__(self, fork: RuleFork) -> None:
        super().__init__(None)
        self._fork = fork

    def __call__(self, *_: object, **__: object) -> Any:
        """Refuse to copy the game."""
        self._fork.refuse("it looks ahead in copies of the game")


class ScalarStrategies:
    """Asks agents, one after the other in each game of a turn, with the states that they get in games played alone.

    Args:
        context: in which agents look around and decide, as far as arrays do not say what they see.
        state: of all games.
        agents: their numbers in the roster, ascending.
        players: of each game; None: none was asked yet.
    """

    def __init__(
        self, context: RuleContext, state: GameArrays, agents: IntArray, players: list[Players | None]
    ) -> None:
        self._context, self._state, self.agents, self._players = context, state, agents, players
        self._numbers = frozenset(agents.tolist())
        self._is_exact: dict[str, BoolArray] = {}  # sensor -> (agents,) whether it shows agents where they are
        self._cells_in_air: dict[str, dict[int, list[Any]]] = {}  # likewise, of those that look from the air
        self._cells: dict[str, dict[int, list[Any]]] = {}  # sensor -> agent -> what it shows, where arrays say that
        self._fork: RuleFork | None = None  # for which it was worked out what follows
        self._needs_game: dict[int, bool] = {}  # agent -> whether it must be asked in the context of its game
        self._counting: list[tuple[int, ISensor]] = []  # agents, and sensors that are asked there and count looks
        self._facts: list[Callable[[GameArrays, int], Mapping[str, Any]]] = []
        self._targets: _Targets

    def functions(self) -> list[Callable[..., object]]:
        """Return the strategies and plans, those of the context in which agents are asked: objects are copies there."""
        fork, roster = self._context.fork, self._state.roster
        plans, known = fork.game.settings()["plans"], fork.ctx.agent.agents
        agents = [known.get(roster.names[number], roster.agents[number]) for number in self.agents.tolist()]
        deciders = [decider_of(agent, plans) for agent in agents]
        return [decider for decider in deciders if decider is not None]

    def _of(self, game: int) -> Players:
        found = self._players[game]
        if found is None:
            begun = self._context.start().internals.state
            found = self._players[game] = Players(begun)
        return found

    # -- why actions were not done ----------------------------------------------------------------------------------

    def note_blocked(self, game: int, agent: int, why: str | None) -> None:
        """Note why an agent does not do what it wanted; None: arrays do not have the words."""
        if agent in self._numbers:
            name, players = self._state.roster.names[agent], self._of(game)
            blocked = players.state.blocked
            if why is None:
                blocked[name] = self._context.fork.unknown("why a rule has refused a move")
            elif isinstance(blocked.get(name, ""), str):
                blocked.add(name, why)
            players.show_blocked(name)

    def note_stopped(self, turn: ArrayTurn, stopped: BoolArray, ends: IntArray | None) -> None:
        """Note that agents, (games, agents), were stopped by conflicts on the way to places; None: by rules."""
        columns = self._state.movement.columns
        for at, agent in np.argwhere(stopped).tolist():
            place = 0 if ends is None else int(ends[at, agent]) - len(columns.node_ids)
            end = columns.node_ids.item(place) if place < 0 else EdgePlace(columns.edge_ids.item(place))
            why = None if ends is None else in_conflict(end)
            self.note_blocked(int(turn.games[at]), agent, why)

    def forget_blocked(self, turn: ArrayTurn, agents: Sequence[int], games: Sequence[int] | None = None) -> None:
        """Forget why the last actions of agents were not done, which do something else now."""
        for at in range(len(turn.games)) if games is None else games:
            players = self._players[int(turn.games[at])]
            if players is None or not players.state.blocked:
                continue
            for number in [number for number in agents if turn.alive[at, number]]:
                name = self._state.roster.names[number]
                if players.state.blocked.pop(name, None) is not None:
                    players.show_blocked(name)

    # -- asking -----------------------------------------------------------------------------------------------------

    def decide(self, turn: ArrayTurn, agents: IntArray, asked: BoolArray | None) -> Answers:
        """Ask some agents.

        Args:
            turn: of the games.
            agents: their numbers in the roster.
            asked: (games, all agents) which are asked of those that live; None: all.
        """
        state, view = self._state, ArrayView(self._state, turn.games, agents, asked)
        node, alive, numbers = state.streets.ids(view.node).tolist(), view.mask.tolist(), agents.tolist()
        deeds, sent, routes = list[tuple[int, int, int, str, Any]](), list[tuple[int, Outgoing]](), list[Route]()
        flights, failures, in_air = list[Flown](), list[Failure](), self._in_air(turn, agents)
        self._look_at(self._context.fork)
        shown_by: list[tuple[dict[int, list[Any]], list[dict[str, Any]]]] = [
            *((cells, self._shown(view, name, cells)) for name, cells in self._cells.items()),
            *((cells, self._shown_in_air(view, name, cells)) for name, cells in self._cells_in_air.items()),
        ]

        def ask(fork: RuleFork, at: int) -> None:
            if not any(alive[at]):
                return
            self._look_at(fork)
            fork.put_flyers(in_air[at])
            for cells, data in shown_by:
                for i, number in enumerate(numbers):
                    if number in cells:
                        cells[number][0] = fork.in_order(data[at * len(numbers) + i])
            columns = [i for i, is_living in enumerate(alive[at]) if is_living]
            living = [numbers[i] for i in columns]
            done = self._ask(fork, turn, at, living, [node[at][i] for i in columns])
            for i, end in zip(columns, done.ends, strict=True):
                node[at][i] = end
            routes.extend(Route(at, living[i], action) for i, action in done.ways.items())
            deeds.extend((at, living[i], *deed) for i, *deed in done.deeds())
            flights.extend(Flown(at, living[i], xyz, quat) for i, xyz, quat in done.flights())
            sent.extend((int(turn.games[at]), message) for message in done.messages)
            failures.extend(done.failures)

        needs_game = any(self._needs_game[number] for number in numbers)
        try:
            self._context.ask(turn, "the strategies of agents", ask, needs_game=needs_game)
        except BaseException:
            for players in filter(None, self._players):  # as in a game alone
                restart_draws(players.slots.values())
            raise
        ends = np.array(node, np.int64).reshape(view.node.shape)
        done = state.deeds.from_plain(deeds, turn.node)
        return Answers(self._actions(view, ends), done, self._outboxes(sent), routes, flights, failures)

    def _in_air(self, turn: ArrayTurn, agents: IntArray) -> list[dict[int, InAir]]:
        """Return where those of some agents are that fly, in each game."""
        flyers = self._state.flyers
        if flyers is None:
            return [{}] * len(turn.games)
        numbers = np.intersect1d(flyers.agents, agents, assume_unique=True)
        places = flyers.places(turn.games, np.searchsorted(flyers.agents, numbers))
        return [dict(zip(numbers.tolist(), of_game, strict=True)) for of_game in places]

    def _actions(self, view: ArrayView, ends: IntArray) -> IntArray:
        """Return the actions that lead to or towards nodes; -1: it stops where it is."""
        if self._state.movement.leaves_nodes:
            stops = ends < 0
            rows = self._state.streets.rows(np.where(stops, self._state.streets.ids(view.node), ends))
            return np.where(stops | ~view.mask, STOP, AIMS + rows)
        found = view.action_to(ends)
        is_far = found < 0
        return np.where(is_far, BY_HOPS + self._state.streets.rows(ends), found) if is_far.any() else found

    def _outboxes(self, sent: Sequence[tuple[int, Outgoing]]) -> list[Outbox]:
        """Return messages, each with its game, as arrays have them."""
        number, counts = self._context.fork.number, Counter[tuple[int, str]]()
        boxes: dict[str, list[tuple[int, int, Any, Any, int]]] = {}
        for game, one in sent:
            order = counts[game, one.sender]
            counts[game, one.sender] += 1
            boxes.setdefault(one.channel, []).append((game, number[one.sender], one.to, one.body, order))
        found = []
        for channel, those in boxes.items():
            games, senders, receivers, bodies, orders = zip(*those, strict=True)
            to = np.fromiter(receivers, object, len(those))
            found.append(Outbox(channel, np.array(games), np.array(senders), to, list(bodies), np.array(orders)))
        return found

    def _ask(self, fork: RuleFork, turn: ArrayTurn, at: int, living: list[int], starts: list[int]) -> _Done:
        """Ask agents of a game."""
        players = self._of(game := int(turn.games[at]))
        state, turns, settings = players.state, fork.parts.turns, fork.parts.settings
        state.turn = int(turn.turn[at])
        slots, part = self._part(players, fork, game, living)
        for facts in self._facts:
            state.facts.update(facts(self._state, game))
        if self._state.radio is not None:
            state.messages = self._state.radio.of(game)
        here = dict(zip(living, starts, strict=True))

        def observe(slot: AgentSlot) -> dict[str, Any]:
            node, agent, sensed = here[fork.number[slot.name]], slot.agent, dict[str, Any]()
            where: Any = agent.xy if slot.travels and agent.edge is not None else node
            for sensor, (key, last, *_, look) in zip(agent.sensors.values(), slot.carried, strict=True):
                (look or sensor).sense(where if getattr(sensor, "looks_from_points", False) else node)
                sensed[key] = sensor.type, last[0]
            found = turns.observed(slot, node, sensed, decisions, players.inboxes)
            self._targets.legal[slot.name] = found["legal"]
            return found

        decisions = Decisions(settings, state, phase_of(fork.ctx), self._targets, observe).begin(slots, starts)
        try:
            turns.ask_part(part, decisions, self._state.seeds[game])
            if decisions.awaited:
                fork.refuse("it is awaited")
            fork.raise_notes()
        except IllegalAction:  # which is what is refused here is, too, where that raises
            fork.raise_notes()
            raise
        finally:
            decisions.drop()
        failed = decisions.failed
        deciding = [slots[i] for i in part.observing if i not in failed]
        messages, unsent = turns.outboxes.read(deciding) if settings.channels else ([], [])
        self.forget_blocked(turn, living, [at])
        failures = self._failures(game, state, decisions.close(), unsent)
        if any(action.heading != () for action in decisions.actions.values()):
            raise NeedsTurnEngine("it turns agents")
        ways = {i: one for i, one in decisions.actions.items() if one.times or one.progress or len(one.path) > 1}
        ends, leaves_nodes = list[int](decisions.ends), self._state.movement.leaves_nodes
        if leaves_nodes:
            ends = [decisions.actions[i].end if i in decisions.actions else -1 for i in range(len(slots))]
        for i in ways:
            ends[i] = -1 if leaves_nodes else starts[i]
        return _Done(ends, decisions.actions, messages, ways, failures)

    def _failures(
        self,
        game: int,
        state: GameState,
        blocked: Sequence[tuple[int, str]],
        unsent: Sequence[tuple[AgentSlot, str]],
    ) -> list[Failure]:
        """Return what agents of a game did wrong, and what they cannot send; `state` forgets it."""
        number, errors, state.errors = self._context.fork.number, state.errors, []
        wrong = [
            Failure(game, False, number[error["agent"]], error["kind"], error["message"], why)
            for error, (_, why) in zip(errors, blocked, strict=True)
        ]
        return wrong + [Failure.illegal(game, number[by.name], why, is_unsent=True) for by, why in unsent]

    def _part(self, players: Players, fork: RuleFork, game: int, living: list[int]) -> tuple[list[AgentSlot], Part]:
        """Return what is needed to ask these agents."""
        if self._state.movement.leaves_nodes:
            fork.parts.turns.travel.now = self._targets.travel.now = float(self._state.movement.now[game])
        settings = fork.parts.settings
        if players.made_for != (fork, fork.casting):
            players.made_for, players.slots, players.living = (fork, fork.casting), {}, [-1]
            state, agents, players.inboxes = players.state, fork.ctx.agent, Inboxes(fork.ctx, players.state)
            state.facts.update(fork.facts)
            state.agent_facts, state.team_facts = fork.private_facts
            forks, table = _NoForks(fork), DrawTable(self._state.seeds[game], state)
            facts = ReadOnlyMapping(state.facts)
            for number in self.agents.tolist():
                agent = agents.agents[self._state.roster.names[number]]
                access = agents.storage.turn_access(agent)
                slot = AgentSlot(agent, access, state, table, facts, settings, forks)
                slot.carried = tuple(
                    (name, *rest)
                    if (cell := self._cell(name, number)) is None
                    else (name, cell, None, _Shown(agent.sensors[name].type))
                    for name, *rest in slot.carried
                )
                players.slots[number] = slot
        if self._counting:
            fork.continue_looks(players.state, self._counting, self._state.looks[game])
        if players.living != living:
            slots, block = [players.slots[number] for number in living], fork.ctx.agent.block
            players.living, players.part = living, (slots, Part(slots, None, block.progress, settings))
        return players.part

    def _look_at(self, fork: RuleFork) -> None:
        """Work out once for a context which sensors arrays have, and which agents must be asked in it."""
        if fork is self._fork:
            return
        self._fork, self._cells, self._counting, self._targets = fork, {}, [], _Targets(fork)
        self._is_exact, self._cells_in_air = {}, {}
        plans, movement = self._context.start().settings()["plans"], self._state.movement
        own, by_metres = fork.parts.settings.plans, movement.leaves_nodes
        self._facts = [spec.facts_in_game for spec in fork.specs_in_arrays if spec.facts_in_game is not None]
        has_reserved = not self._state.roster.is_first.all()
        for number in self.agents.tolist():
            agent = self._state.roster.agents[number]
            there = fork.ctx.agent.agents[agent.name]  # whose strategy is another if it closes over the context
            needs_game = has_reserved or decider_of(there, own) is not decider_of(agent, plans)
            needs_game |= by_metres or (bool(movement.remembers) and (agent.speed or 0.0) % 1.0 > 0.0)
            for name, sensor in getattr(agent, "sensors", {}).items():
                look = look_of(sensor, agent)
                if look is not None and look.quat is not None:
                    self._cells_in_air.setdefault(name, {})[number] = [None]
                elif look is not None:
                    self._cells.setdefault(name, {})[number] = [None]
                    is_exact = self._is_exact.setdefault(name, np.zeros(len(self._state.roster.names), np.bool_))
                    is_exact[number] = not look.errs
                elif not (_sees_from_node(sensor) or sensor.type in FROM_AIR):
                    needs_game = True
                    if _counts_looks(sensor):
                        self._counting.append((number, there.sensors[name]))
            self._needs_game[number] = needs_game

    def _cell(self, name: str, number: int) -> list[Any] | None:
        """Return where it is put what a sensor of an agent shows; None: arrays do not say that."""
        return self._cells.get(name, {}).get(number) or self._cells_in_air.get(name, {}).get(number)

    def _shown_in_air(self, view: ArrayView, name: str, cells: Collection[int]) -> list[dict[str, Any]]:
        """Return what a sensor shows to agents from the air, likewise."""
        whom = np.array([number for number in view.agents.tolist() if number in cells], np.int64)
        looks = lookouts(view.roster, whom, [name]) if len(whom) else []
        asked = view.mask[:, np.searchsorted(view.agents, whom)]
        found = seen_from_air(self._state, view.games, asked, looks)
        kinds, flies = (AgentType.BASIC, AgentType.AERIAL), view.roster.flies[found.others].tolist()
        shown = [(kinds[is_flying], tuple(xyz)) for is_flying, xyz in zip(flies, found.xyz.tolist(), strict=True)]
        return self._by_agent(view, whom, found, shown)

    def _shown(self, view: ArrayView, name: str, cells: Collection[int]) -> list[dict[str, Any]]:
        """Return what a sensor shows to agents, as `data` has it, game by game; nothing to those without one."""
        whom = np.array([number for number in view.agents.tolist() if number in cells], np.int64)
        if not len(whom):
            return [{}] * (len(view.games) * len(view.agents))
        found = view.of(whom).seen(name)
        nodes = view.streets.ids(found.nodes).tolist()
        if self._state.movement.leaves_nodes:
            self._locate(nodes, view.games, found, self._is_exact[name][whom])
        return self._by_agent(view, whom, found, nodes)

    def _by_agent(
        self, view: ArrayView, whom: IntArray, found: Seen | SeenInSpace, shown: Sequence[Any]
    ) -> list[dict[str, Any]]:
        """Return what is shown of the others that some agents see by the names of these, game by game and by agent."""
        looking = found.at * len(view.agents) + np.searchsorted(view.agents, whom)[found.viewers]
        order = np.lexsort((self._context.fork.rank[found.others], looking)).tolist()
        names, others = view.roster.names, found.others.tolist()
        listed = [(names[others[i]], shown[i]) for i in order]
        ends = np.cumsum(np.bincount(looking, minlength=view.node.size)).tolist()
        return [dict(listed[a:b]) for a, b in pairwise([0, *ends])]

    def _locate(self, nodes: list[int], games: IntArray, found: Seen, is_exact: BoolArray) -> None:
        """Have nodes that are shown say where on edges agents are, if those who look, (viewers,), see that exactly."""
        which, movement = (games[found.at], found.others), self._state.movement
        on = np.flatnonzero(is_exact[found.viewers] & (movement.on_edge(which) >= 0))
        places = movement.places(found.nodes[on], (which[0][on], which[1][on]))
        columns = (one.tolist() for one in (on, *places))
        for i, edge, offset, xy in zip(*columns, strict=True):
            nodes[i] = PassedNode(nodes[i], tuple(edge), offset, tuple(xy))


def _sees_from_node(sensor: ISensor) -> bool:
    """Whether what a sensor shows follows from the node that it looks from."""
    look = sensor.nodes_in_arrays() if sensor.type in SHOWING_NODES and hasattr(sensor, "nodes_in_arrays") else ""
    return not isinstance(look, str) and not look.turns


def _counts_looks(sensor: ISensor) -> bool:
    """Whether what a sensor shows follows from how often it has looked, or what it saw before."""
    return hasattr(sensor, "notice") and bool(sensor.notice.needs_look)


def why_slower(game: PlayedGame, asked: Sequence[IAgent], num_games: int, *, are_called: bool) -> str | None:
    """Return why so many games, of which some agents are asked one by one, would be slower in arrays; None: not."""
    plans = game.settings()["plans"]
    deciders = [decider_of(agent, plans) for agent in asked]
    fewest = (FEWEST_AT_ARRIVALS if game.settings()["decide"] == "arrival" else FEWEST) if deciders else 1
    if any(getattr(one, "__closure__", one) is not None for one in deciders):
        fewest = FEWEST_IN_CONTEXT
    if are_called:
        if len(asked) * _MOST_ASKED > len(agents_of(game)):
            return "rules and strategies without array forms"
        fewest = max(fewest, FEWEST_CALLED)
    return f"fewer than {fewest} games" if num_games < fewest else None


def why_not_asked(game: PlayedGame, agents: Sequence[IAgent]) -> str | None:
    """Return why agents cannot be asked one by one in games in arrays, in words; None: they can."""
    sensors = [(agent, sensor) for agent in agents for sensor in getattr(agent, "sensors", {}).values()]
    reasons = [
        (not all(getattr(sensor, "sees_world_only", False) for _, sensor in sensors), "sensors that may see more"),
        (
            any(_counts_looks(one) and look_of(one, by) is None for by, one in sensors),
            "a sensor of a class of its own that draws",
        ),
        (game.ctx.agent.block.has_teams, "agents of a team in arrays"),
    ]
    return next((why for is_so, why in reasons if is_so), None)
