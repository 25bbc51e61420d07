"""Declares array strategies and array rules, and calls them in single games.

A single game is passed as a batch of one game: functions get the same view and the same turn as in a batch.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from functools import WRAPPER_ASSIGNMENTS, partial, update_wrapper
from itertools import takewhile
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_context, as_function_of, as_numbers_of
from gamms.deciding import get_phase
from gamms.errors import BadType
from gamms.game.array_functions.aims import ActionFinder, make_flight_action
from gamms.game.array_functions.turn import ArrayRule, ArrayTurn
from gamms.game.array_functions.view import ArrayStrategy, ArrayView, make_asked_view
from gamms.game.block.columns import AgentTable, find_decider, get_mode
from gamms.game.block.initial_state import LastTurn, make_movement
from gamms.game.block.sensing import note_sensors
from gamms.game.block.state import STOPPED, GameArrays
from gamms.game.deeds import DeclaredDeeds, check_value
from gamms.game.lasting import DeedReader
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.legality import Legality
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.routes import RoutesWithTurns
from gamms.game.movement.travel import find_usable_graph
from gamms.game.settings import RuleSpec, declared
from gamms.game.strategy_specs import F, StrategySpec, declare, get_strategy_spec, make_form_key
from gamms.ir.game_state import KEPT
from gamms.ir.graph import IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.readonly import ReadOnlyMapping
from gamms.typing import IContext
from gamms.typing.context import HostContext

_CACHE = "array functions"  # the key of `ctx.game.internals.kept`
_ONE = np.zeros(1, np.int64)  # the numbers of the games in a block of one game


def array_strategy(
    form: ArrayStrategy | None = None, /, *, of: object = None, begins: object = None
) -> Callable[[IContext], Callable[[Any], None]]:
    """Decorator: make a strategy from a function of an `ArrayView`, for batches and single games.

    The decorated name is a function that makes the strategy, like `gamms.strategies.chase`: use `strategy=hunt(ctx)`,
    or `strategies={"red": hunt}` in a scenario. The function is called once per turn for all agents with this strategy;
    in a single game, the view has one game.

    Args:
        form: returns the actions: indices of legal nodes, (games, agents), or the result of `view.towards`; for flying
            agents, offsets in map units, (games, agents, 3).
        of: not supported; passing it raises an error.
        begins: not supported; passing it raises an error.

    Raises:
        BadType: `form` is not callable, or `of` or `begins` is given.
    """
    _refuse_second_form(of, begins, "array_strategy")
    function: ArrayStrategy = as_function_of(form, "An array strategy", "a view")
    name = getattr(function, "__name__", "array strategy")

    def make(ctx: IContext) -> Callable[[Any], None]:
        as_context(ctx, name)

        def strategy(state: dict[str, Any]) -> None:
            act_in_arrays(cast("HostContext", ctx), state, function, name)

        declare(strategy, StrategySpec(array_form=function))
        return _copy_docstring(strategy, function)

    return _copy_docstring(make, function)


def array_rule(
    form: ArrayRule | None = None, /, *, of: object = None, begins: object = None
) -> Callable[[IContext], None]:
    """Decorator: make a rule from a function of an `ArrayTurn`, for batches and single games.

    The decorated name is the rule: use `ctx.game.add(storm)`, or `rules: [{rule: my_module:storm}]` in a scenario. In a
    single game, the turn has one game.

    Args:
        form: applies the rule to all games of the turn.
        of: not supported; passing it raises an error.
        begins: not supported; passing it raises an error.

    Raises:
        BadType: `form` is not callable, or `of` or `begins` is given.
    """
    _refuse_second_form(of, begins, "array_rule")
    function: ArrayRule = as_function_of(form, "An array rule", "a turn")
    name = getattr(function, "__name__", "array rule")

    def rule(ctx: IContext) -> None:
        as_context(ctx, name)
        turn = _SingleGameTurn(cast("HostContext", ctx))
        turn._lock()
        try:
            function(turn)
        finally:
            turn._close()

    return declared(_copy_docstring(rule, function), RuleSpec(array_form=function, is_array_function=True))


def _refuse_second_form(of: object, begins: object, decorator: str) -> None:
    if of is not None or begins is not None:
        raise BadType(
            f"{decorator} takes neither of= nor begins=: pass the array function itself, {decorator}(function). It "
            "plays one game as it plays a batch, and needs no other function beside it."
        )


def _copy_docstring(function: F, form: Callable[..., object]) -> F:
    """Give a function the name and the docstring of a form, but not its annotations."""
    made: Any = update_wrapper(function, form, [one for one in WRAPPER_ASSIGNMENTS if "annot" not in one])
    del made.__wrapped__
    return function


# -- a block of one game ----------------------------------------------------------------------------------------------


class _CachedMapData(NamedTuple):
    """The movement of the agents of a game, and the data computed for its map.

    Attributes:
        version: the revision of the map, and the other values that the movement depends on.
        movement: the movement of the agents.
        shared: the data that array functions share.
    """

    version: tuple[object, ...]
    movement: Movement
    shared: dict[Hashable, Any]


def _get_map_data(ctx: HostContext, roster: AgentTable) -> _CachedMapData:
    """Return the movement of the agents of a game, and the data computed for its map."""
    revision = ctx.graph.graph.revision
    cache = ctx.game.internals.kept
    version = revision, get_phase(ctx).epoch, tuple([agent.speed for agent in roster.agents])
    known: _CachedMapData | None = cache.get(_CACHE)
    if known is None or revision is None or known.version != version:
        is_same_map = known is not None and revision is not None and known.version[0] == revision
        shared = known.shared if known is not None and is_same_map else {}
        known = _CachedMapData(version, make_movement(ctx.game, roster, may_reopen=True), shared)
        cache[_CACHE] = known
    return known


def _make_block(ctx: HostContext) -> GameArrays:
    """Return the game of a context as a block of one game."""
    game = ctx.game
    block = ctx.agent.block
    roster = AgentTable.of(ctx.agent.agents.values())
    world = _get_map_data(ctx, roster)
    streets = world.movement.streets
    nodes = streets.rows([[agent.current_node_id for agent in roster.agents]])
    state = GameArrays(roster, world.movement, [ctx.seed], nodes)
    state.take_game(game)
    state.alive[0] = [agent.alive for agent in roster.agents]
    state.turn[0] = game.turn
    state.shared = world.shared
    state.facts = cast("dict[str, Any]", ReadOnlyMapping(game.facts))
    state.kept = game.data.get(KEPT, {})
    state.unchecked = game.internals.unchecked_arrays
    state.deeds = DeclaredDeeds(game.deeds, partial(check_value, ctx=ctx), roster.names, streets)
    if state.deeds.lasting:
        values = game.internals.state
        state.doings = DeedReader(game.settings(), roster.names, roster.list_teams(), lambda _: values.data)
    if state.flights is not None:
        flying: list[Any] = [roster.agents[number] for number in state.flyers.tolist()]
        state.position[0] = [agent.position for agent in flying]
        state.start_position[0] = [game.start_node(agent) for agent in flying]
    for number, name in enumerate(roster.names):
        place = block.get_edge_position(block.find_row(name))
        if place is not None:
            state.movement.put_on(number, place)
    if state.movement.traffic is not None:
        state.movement.traffic.put_driven(roster.names, game.internals.state.driven)
    state.previous[0] = streets.rows([agent.prev_node_id for agent in roster.agents])
    if roster.obey_turns and state.movement.by_metres:
        state.apart[0] = lambda: game
    state.reading = partial(get_phase(ctx).suspend, changes_world=False)
    return state


# -- strategies -------------------------------------------------------------------------------------------------------


class _Decisions(NamedTuple):
    """The actions of the agents that an array function has decided for.

    Attributes:
        asked: the number of times that agents had been asked; see `TurnEngine`.
        waiting: the agents that have not taken their actions, name -> index in the view.
        view: the agents.
        drawn: (agents,) the number of draws of each agent in this turn.
        given: (1, agents) the actions, or (1, agents, 3) the offsets of flights.
        deeds: agent -> deed -> its fields.
        messages: agent -> its messages, as entries of `state["outbox"]`.
    """

    asked: int
    waiting: dict[str, int]
    view: ArrayView
    drawn: IntArray
    given: Any
    deeds: dict[str, dict[str, dict[str, Any]]]
    messages: dict[str, list[dict[str, Any]]]


def act_in_arrays(ctx: HostContext, state: dict[str, Any], function: ArrayStrategy, name: str) -> None:
    """Set the action of an agent; the first one that is asked lets the function decide for all, as in a batch."""
    with get_phase(ctx).suspend(changes_world=False):
        asked = ctx.game.internals.parts.turns.asked
        cache = ctx.game.internals.kept
    key = (_CACHE, make_form_key(function), "quat" in state)
    agent = state["name"]
    known: _Decisions | None = cache.get(key)
    if known is None or known.asked != asked or agent not in known.waiting:
        known = _decide_for_agents(ctx, state, function, name)
        cache[key] = known
    view = known.view
    place = known.waiting.pop(agent)
    done = known.deeds.get(agent, {})
    state["draw"].go_to(int(known.drawn[place]) or None)
    state.get("outbox", []).extend(known.messages.get(agent, ()))
    if view.flies:
        state["action"] = make_flight_action(known.given[0, place].tolist(), ctx.agent.agents[agent].speed, done)
        return
    edge = -1 if view._named is None else int(view._named[0, place])
    if edge >= 0:
        state["action"] = {"edge": edge, "do": done} if done else {"edge": edge}
        return
    number = int(known.given[0, place])
    action: Any = None if view._aims is None else view._aims.get_action(number)
    if action is None:
        action = state["legal"][number]
    if isinstance(action, dict):
        state["action"] = {**action, "do": done} if done else action
        return
    state["action"] = {"node_id": action, "do": done} if done else action


def _decide_for_agents(ctx: HostContext, state: dict[str, Any], function: ArrayStrategy, name: str) -> _Decisions:
    """Call an array function for an agent that is asked, and for all others that it decides for at this moment."""
    with get_phase(ctx).suspend(changes_world=False):
        block = _make_block(ctx)
        turns = ctx.game.internals.parts.turns
        data = ctx.game.data
        agents = _find_agents_asked_together(ctx, block, state["name"], function)
        routes = {number: _find_routes(ctx, turns.legality, block.roster, number) for number in agents.tolist()}
        _show(ctx, block, state)
        asked = turns.asked if turns.is_deciding else -1
        here, drawn = _find_deciding_agents(ctx, block, state)
    view = make_asked_view(block, _ONE, agents, here)
    view._named = np.full(view.node.shape, -1)
    if view._movement.acts_by_paths or block.roster.obey_turns:
        graphs = [find_usable_graph(ctx, mode) for mode in (None, *view._movement.modes)]
        view._aims = ActionFinder(graphs, view._movement, routes)
    view.draw = view.draw.after(drawn[:, agents]).only(view.mask)
    given = view._call(function, name)
    if block.kept:
        data[KEPT] = block.kept
    names = block.roster.names
    deeds: dict[str, dict[str, dict[str, Any]]] = {}
    for one in view._deeds or ():
        for number, fields in zip(one.agents.tolist(), block.deeds.numbering.list_fields(one), strict=True):
            deeds.setdefault(names[number], {})[one.kind] = fields
    messages: dict[str, list[dict[str, Any]]] = {}
    for box in view._outboxes or ():
        for number, to, body in zip(box.senders.tolist(), box.to, box.bodies, strict=True):
            messages.setdefault(names[number], []).append({"channel": box.channel, "to": to, "body": body})
    waiting = {name: place for place, name in enumerate(view["name"]) if view.mask[0, place]}
    drawn = np.broadcast_to(view.draw.count, view.node.shape)[0]
    return _Decisions(asked, waiting, view, drawn, given, deeds, messages)


def _find_routes(ctx: HostContext, legality: Legality, roster: AgentTable, number: int) -> RoutesWithTurns | None:
    """Return the routes of an agent that obeys turn restrictions, by its number; None: it does not."""
    agent = roster.agents[number]
    mode = get_mode(agent)
    if mode is None or not split_mode(mode)[1]:
        return None
    place = getattr(agent, "edge", None)
    graph = find_usable_graph(ctx, mode)
    return RoutesWithTurns(graph, mode, agent.current_node_id, legality.find_driven(agent.name), place)


def _find_agents_asked_together(ctx: HostContext, block: GameArrays, name: str, function: ArrayStrategy) -> IntArray:
    """Return the numbers of the agents that a function decides for together with one that is asked.

    An agent is asked alone with a time budget, or outside of a turn, and if another strategy calls its array strategy.
    """
    game = ctx.game
    roster = block.roster
    own = np.array([roster.names.index(name)])
    if not game.internals.parts.turns.is_deciding or game.time_budget is not None:
        return own
    key = make_form_key(function)
    part_of = roster.find_parts(game.order)
    forms = [get_strategy_spec(find_decider(agent, game.plans)).array_form for agent in roster.agents]
    has_function = np.array([form is not None and make_form_key(form) == key for form in forms], np.bool_)
    found = np.flatnonzero(has_function & (part_of == part_of[own]) & (roster.flies == roster.flies[own]))
    return found if own[0] in found else own


def _find_deciding_agents(ctx: HostContext, block: GameArrays, state: dict[str, Any]) -> tuple[BoolArray, IntArray]:
    """Return which agents decide now with one that is asked, and how many numbers each has drawn, (1, all agents)."""
    turns = ctx.game.internals.parts.turns
    names = block.roster.names
    here = np.array([[name == state["name"] for name in names]])
    drawn = np.zeros(here.shape, np.int64)
    drawn[here] = state["draw"].mark() or 0
    if turns.is_deciding and turns.asked_part is not None and ctx.game.time_budget is None:
        order, part = turns.asked_part
        number_of = {name: number for number, name in enumerate(names)}
        here[0, [number_of[order.names[i]] for i in part.select_present(part.members)]] = True
        for slot in order.slots.list_made():
            drawn[0, number_of[slot.name]] = slot.get_marks()[0] or 0
    return here, drawn


def _show(ctx: HostContext, block: GameArrays, state: dict[str, Any]) -> None:
    """Add the data of a single game that views show beyond `_make_block`, for an agent that is asked."""
    game = ctx.game
    roster = block.roster
    turns = game.internals.parts.turns
    if game.team_memory:
        block.share_memories()
    block.time[0] = state.get("time", 0.0)
    blocked = game.internals.state.blocked
    block.blocked[0] = ["in conflict" in (blocked.get(one) or "") for one in roster.names]
    note_sensors(block, with_nodes=True)
    block.find_game = lambda _: game
    if game.channels:
        turns.messages.follow()
        gone = {name: team for name, (team, _) in game.internals.state.departed.items()}
        block.radio = turns.messages.share(roster.get_teams_by_name(), roster.find_parts(None), gone)


# -- rules ------------------------------------------------------------------------------------------------------------


class _SingleGameTurn(ArrayTurn):
    """The turn of a single game: its verbs change the game of the context immediately."""

    def __init__(self, ctx: HostContext) -> None:
        state = _make_block(ctx)
        super().__init__(state, _ONE)
        game = ctx.game
        roster = state.roster
        block = ctx.agent.block
        self._ctx = ctx
        self._game = game
        self._is_moving = game.is_moving
        state.change_roads = lambda _, verb, edges: getattr(ctx.graph, verb)(edges)
        state.events.show(0, game.events)
        state.scores.put(0, game.scores)
        self._scores_before = state.scores.get_scores(0)
        state.placed[0] = [block.find_row(name) in block.placed for name in roster.names]
        now = game.turn + game.is_moving
        of_now = takewhile(lambda event: event["turn"] == now, reversed(game.events))
        out = {event["agent"] for event in of_now if event["kind"] == "eliminated"}
        state.fell[0] = [name in out for name in roster.names]
        self.took_part = np.zeros(self.node.shape, np.bool_)
        moves: TurnMoves | None = game.internals.state.moves
        if moves is not None:
            self.starts, self.ends, self.took_part, self.paths = LastTurn.from_moves(
                moves, roster, state.movement, self.node
            )
            for number in np.flatnonzero(roster.flies & self.took_part[0]).tolist():
                state.placed[0, number] |= moves.is_displaced(moves.order.index_of[roster.names[number]])
        state.deed_log = game.internals.state.deed_log
        self._rows_in_log = np.array([game.internals.state.row])

    def _close(self) -> None:
        """Write scores and kept arrays to the game."""
        for key, points in self._state.scores.get_scores(0).items():
            if self._scores_before.get(key) != points:
                self._game.scores[key] = points
        if self._state.kept:
            self._game.data[KEPT] = self._state.kept

    def _note(self, kind: str, at: IntArray, fields: Mapping[str, list[Any]]) -> None:
        for i in range(len(at)):
            self._game.emit(kind, **{name: values[i] for name, values in fields.items()})

    def _note_place(self, kind: str, at: IntArray, agents: IntArray) -> None:
        """Add no event: the verbs of the game do."""

    def _end(self, _: int, how: dict[str, Any]) -> None:
        self._game.end(**how)

    def _take_out(self, at: IntArray, agents: IntArray) -> None:
        super()._take_out(at, agents)
        for number in agents.tolist():
            self._game.eliminate(self.roster.names[number])

    def _put_back(self, at: IntArray, agents: IntArray) -> None:
        for number in agents.tolist():
            self._game.respawn(self.roster.names[number])
            self._state.start[0, number] = self.streets.rows(self.roster.agents[number].current_node_id)
        super()._put_back(at, agents)

    def start_of(self, agents: IntArray) -> IntArray:
        """Return the start node of each agent, (1, agents); for a flying agent, the node nearest to its start."""
        agents = as_numbers_of(agents, "agents", len(self.roster.names), "agents").reshape(-1)
        starts = [self._game.start_node(self.roster.names[number]) for number in agents.tolist()]
        nearest = self._ctx.graph.graph.nearest_node
        return self.streets.rows([[one if isinstance(one, int) else nearest(*one[:2]) for one in starts]])

    def stops(self, at: IntArray, agents: IntArray) -> IntArray:
        """Return how often agents were tagged, respawned or eliminated so far."""
        at, agents = self._check_pairs(at, agents)
        counts = Counter(one.get(STOPPED[one["kind"]]) for one in self._game.events if one["kind"] in STOPPED)
        return np.array([counts[self.roster.names[number]] for number in agents[at == 0].tolist()], np.int64)
