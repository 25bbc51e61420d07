"""Rules about resources: amounts, for example fuel, spent by moves, turns and deeds, and deeds with a cooldown."""

from collections.abc import Collection, Hashable, Iterable, Mapping
from functools import partial
from itertools import pairwise, takewhile
from math import dist, inf, isfinite
from typing import Annotated, Any, NamedTuple

import numpy as np

from gamms.arguments import as_choice, as_count, as_mapping, as_name, as_range, show_as_call
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.game.deeds import get_fields
from gamms.game.roles import as_teams_and_roles, is_among
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import GraphColumns, as_node_id, find_shortest_edges
from gamms.rules.endings import get_state, refuse_unknown
from gamms.rules.meetings import TraveledEdges
from gamms.text import shown
from gamms.typing import AgentType, IAgent, Rule
from gamms.typing.game import TEAMS, Leg, Move
from gamms.visual.drawers.standings import COOLDOWNS, RESOURCES, render_amounts, render_cooldowns

_EMPTY = ("stay", "eliminate")
_SLACK = 1e-9  # tolerance: rounding must not refuse an amount that is just enough


@show_as_call
def resource(  # noqa: PLR0913 - all that a rule is, in one call
    name: str,
    start: float,
    *,
    per_metre: float = 0,
    per_edge: float | str = 0,
    per_turn: float = 0,
    per_deed: Mapping[str, float] | None = None,
    recharge: Mapping[Any, float] | None = None,
    capacity: float | None = None,
    empty: str = "stay",
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
) -> Rule:
    """Make a rule that gives each agent an amount, for example of fuel, to spend and to recharge on some nodes.

    A move or a deed that needs more than is left is refused as a whole; deeds are checked first, in the order of the
    action; `state["blocked"]` has the reason. At the end of a turn an agent pays for its deeds and moves (an edge when
    it reaches its end), then for the turn, as far as the amount lasts; then it recharges. An agent that has nothing
    left at the end of its turn is an event `empty` with `agent` and `resource`. An agent that returns after it was
    eliminated has the `start` amount again.

    Each agent knows its own amount: `state["facts"][name]`.

    Args:
        name: name of the resource, of its facts, and the key of its state.
        start: initial amount of each agent.
        per_metre: price of a map unit: along edges; in a straight line for moves without an edge and in the air.
        per_edge: price of an edge; a text: the edge attribute with the price of each, where true is 1, and false or no
            value is 0. Agents that have nothing left may then take edges that cost nothing.
        per_turn: price of a turn.
        per_deed: deed -> its price.
        recharge: node -> amount gained at the end of each turn there; for flying agents, if this is their nearest node.
        capacity: maximum amount of each agent; None: the initial amount.
        empty: effect on an agent that has nothing left: "stay" where it is, or "eliminate".
        teams: teams or roles with the resource, one or several; None: all agents.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map, no edge has the
            attribute, or a deed is not declared.
    """
    begin = as_range(start, "start")
    full = as_range(start if capacity is None else capacity, "capacity")
    if begin > full or not isfinite(begin):
        raise BadValue(f"start must be finite and at most the capacity, {full:g}, not {begin:g}.")
    prices = {} if per_deed is None else as_mapping(per_deed, "per_deed")
    rates = {} if recharge is None else as_mapping(recharge, "recharge")
    tank = _ResourceRule(
        as_name(name, "a resource"),
        begin,
        full,
        as_range(per_metre, "per_metre"),
        as_name(per_edge, "an edge attribute") if isinstance(per_edge, str) else as_range(per_edge, "per_edge"),
        as_range(per_turn, "per_turn"),
        {deed: as_range(price, f"per_deed[{shown(deed)}]") for deed, price in prices.items()},
        {as_node_id(node, "A node to recharge"): as_range(rate, f"recharge[{node}]") for node, rate in rates.items()},
        as_choice(empty, "empty", _EMPTY) == "eliminate",
        as_teams_and_roles(teams),
    )
    lengths = _MoveLengths(tank.per_edge)

    def resource(ctx: Context) -> None:
        tank.charge(ctx, lengths)

    def check(ctx: Context) -> None:
        tank.check(ctx, lengths)

    return declared(
        resource,
        RuleSpec(
            prepare=tank.prepare,
            check=check,
            drawer=render_amounts,
            teams=sorted(tank.teams or (), key=str),
            rank=Rank.RESOURCES,
            key=tank.name,
            disclose=tank.disclose,
        ),
    )


class _MoveLengths:
    """The lengths of moves on the present map, and the prices of their edges.

    Args:
        per_edge: the price of each edge, or the edge attribute that has it.
    """

    def __init__(self, per_edge: float | str) -> None:
        self._of: tuple[GraphColumns | None, dict[tuple[int, int], float]] = (None, {})
        self._per_edge = per_edge
        self._prices: tuple[GraphColumns | None, dict[int, float]] = (None, {})

    def price_edges(self, ctx: Context, agent: IAgent, move: Move) -> float:
        """Return the price of the edges whose ends an agent reaches by a move.

        Raises:
            BadValue: the price of an edge is not a number, or less than 0.
        """
        steps = [(start, end) for start, end in pairwise(move.path) if start != end]
        if not isinstance(self._per_edge, str):
            return len(steps) * self._per_edge
        if move.legs:
            edges: list[int | None] = [leg.edge for leg in move.legs if leg.begin < leg.end == 1.0]
        else:
            legality = ctx.game.internals.parts.turns.legality
            mode = getattr(agent, "mode", None)
            edges = [legality.find_edge(mode, *ends) for ends in steps]
        return sum([self._price(ctx, self._per_edge, edge) for edge in edges if edge is not None])

    def _price(self, ctx: Context, name: str, edge: int) -> float:
        columns = ctx.graph.columns()
        if self._prices[0] is not columns:
            self._prices = columns, find_edge_prices(columns, name)
        price = self._prices[1].get(edge)
        if price is None:  # it costs nothing, or a rule has closed it since
            _, closed = ctx.graph.storage.list_roads()
            price = _as_price(closed[edge].get(name), name, edge) if edge in closed else 0.0
        return price

    def measure_leg(self, ctx: Context, leg: Leg) -> float:
        """Return the length of an edge, open or closed; for a removed edge, the straight line between its ends."""
        try:
            return float(TraveledEdges(ctx)[leg.edge].length)
        except UnknownName:
            return dist(*ctx.graph.graph.positions([leg.source, leg.target]).tolist())

    def measure_path(self, ctx: Context, path: tuple[int, ...]) -> float:
        """Return the length of a path, in map units."""
        columns = ctx.graph.columns()
        if self._of[0] is not columns:
            self._of = columns, find_shortest_edges(columns)
        return sum(self._measure_move(ctx, *ends) for ends in pairwise(path) if ends[0] != ends[1])

    def _measure_move(self, ctx: Context, source: int, target: int) -> float:
        known = self._of[1].get((source, target))
        return dist(*ctx.graph.graph.positions([source, target]).tolist()) if known is None else known


def find_edge_prices(columns: GraphColumns, name: str) -> dict[int, float]:
    """Return id -> price of the edges that have an attribute.

    Raises:
        BadValue: a value is neither true nor false nor a number of at least 0.
    """
    ids = columns.edge_ids
    values = columns.edge_attributes.get(name, {})
    return {(edge := int(ids[row])): _as_price(value, name, edge) for row, value in values.items()}


def _as_price(value: object, name: str, edge: int) -> float:
    """Return the price of an edge from its attribute: true is 1, and false or None 0."""
    if value is None:
        return 0.0
    is_number = isinstance(value, (bool, int, float, np.bool_, np.number))
    if not is_number or not 0.0 <= float(value) < inf:  # type: ignore[arg-type] # it is a number
        raise BadValue(
            f"The edge attribute {name!r} is no price: of edge {edge} it is {shown(value)}, and prices are true, "
            "false, or numbers of at least 0."
        )
    return float(value)  # type: ignore[arg-type] # as above


class _ResourceRule(NamedTuple):
    """The checked arguments of `resource`. The state of a game is in `ctx.game.data`."""

    name: str
    start: float
    full: float
    per_metre: float
    per_edge: float | str
    per_turn: float
    per_deed: dict[str, float]
    recharge: dict[int, float]
    eliminates: bool
    teams: frozenset[Hashable] | None

    def prepare(self, ctx: Context) -> None:
        """Check the arguments against the game, and publish the amounts."""
        refuse_unknown(ctx, self.recharge)
        if isinstance(self.per_edge, str):
            columns = ctx.graph.columns()
            if self.per_edge not in columns.edge_attributes:
                raise UnknownName("edge attribute", self.per_edge, sorted(columns.edge_attributes))
            find_edge_prices(columns, self.per_edge)
        for deed in self.per_deed:
            get_fields(deed, ctx.game.deeds)
        if self.teams is None:
            ctx.game.publish(**{self.name: self.start})  # for agents created later
        for agent in self._list_agents(ctx):
            if agent.name not in self._get_state(ctx)["amounts"]:
                self._give(ctx, agent, self.start)

    def disclose(self, data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
        """Return the amounts that the named agents have left."""
        state = data.get(RESOURCES, {}).get(self.name, {})
        own = {
            key: {name: number for name, number in state.get(key, {}).items() if name in names}
            for key in ("amounts", "flights")
        }
        return {RESOURCES: {self.name: {"turn": state.get("turn", -1), **own}}}

    def check(self, ctx: Context, lengths: _MoveLengths) -> None:
        """Refuse moves and deeds that cost more than is left."""
        state = self._get_state(ctx)
        moves = ctx.game.moves
        deeds: dict[str, list[str]] = {}
        for deed in ctx.game.performed():
            deeds.setdefault(deed.agent, []).append(deed.kind)
        if state["turn"] != ctx.game.turn:  # with an order of play a turn has several checks
            flying = [agent.name for agent in self._list_agents(ctx) if _is_flying(agent)]
            counts = ctx.game.counts
            state["flights"] = {name: _count_moves(counts, name) for name in flying}
            state["turn"] = ctx.game.turn
        for agent in ctx.game.agents:
            if not self._is_counted(agent):
                continue
            left = state["amounts"].get(agent.name, self.start)
            is_empty = left <= 0
            for kind in deeds.get(agent.name, ()):
                price = self.per_deed.get(kind, 0.0)
                if price > left * (1 + _SLACK):
                    ctx.game.refuse(agent, f"it needs {price:g} {self.name}, and {left:g} is left", kind)
                else:
                    left -= price
            if _is_flying(agent):
                price = self.per_metre * (agent.speed or 0.0)
            else:
                price = self._price(ctx, agent, moves[agent.name], lengths)
            if is_empty and (price > 0 or not isinstance(self.per_edge, str)):
                ctx.game.refuse(agent, f"its {self.name} is used up")
            elif price > left * (1 + _SLACK):
                ctx.game.refuse(agent, f"it needs {price:g} {self.name}, and {left:g} is left")

    def charge(self, ctx: Context, lengths: _MoveLengths) -> None:
        """Charge agents for their moves and deeds, recharge them, and apply `empty` to agents with nothing left."""
        state = self._get_state(ctx)
        moves = ctx.game.moves
        used = dict.fromkeys((agent.name for agent in self._list_agents(ctx)), self.per_turn)
        for deed in ctx.game.performed():
            if deed.agent in used:
                used[deed.agent] += self.per_deed.get(deed.kind, 0.0)
        out_now = _find_eliminated_agents(ctx)
        counts = ctx.game.counts
        for agent in self._list_agents(ctx):
            name = agent.name
            if not agent.alive and name not in out_now:
                self._give(ctx, agent, self.start)
                continue
            if _is_flying(agent):
                flights = _count_moves(counts, name) - state["flights"].get(name, 0)
                price = flights * self.per_metre * (agent.speed or 0.0)
            else:
                price = self._price(ctx, agent, moves[name], lengths) if name in moves else 0.0
            before = state["amounts"].get(name, self.start)
            rest = before - price - used[name]
            rest = 0.0 if rest <= before * _SLACK else rest
            rest = min(self.full, rest + self.recharge.get(agent.current_node_id, 0.0))
            self._give(ctx, agent, rest)
            if rest <= 0 < before:
                ctx.game.emit("empty", agent=name, resource=self.name)
            if rest <= 0 and self.eliminates:
                ctx.game.eliminate(agent)

    def _give(self, ctx: Context, agent: IAgent, amount: float) -> None:
        """Set the amount of an agent, and publish it to the agent."""
        amounts = self._get_state(ctx)["amounts"]
        if amounts.get(agent.name) != amount:
            amounts[agent.name] = amount
            ctx.game.publish(to=agent, **{self.name: amount})

    def _get_state(self, ctx: Context) -> dict[str, Any]:
        full = self.full if isfinite(self.full) else self.start
        return get_state(ctx, RESOURCES, self.name, {"full": full, "amounts": {}, "turn": -1, "flights": {}})

    def _list_agents(self, ctx: Context) -> list[IAgent]:
        """Return the agents that have the resource, including dead ones, ordered by name."""
        return [agent for _, agent in sorted(ctx.agent.agents.items()) if self._is_counted(agent)]

    def _is_counted(self, agent: IAgent) -> bool:
        return is_among(agent, self.teams)

    def _price(self, ctx: Context, agent: IAgent, move: Move, lengths: _MoveLengths) -> float:
        has_edges = any(start != end for start, end in pairwise(move.path))
        if move.legs:
            metres = sum([abs(leg.end - leg.begin) * lengths.measure_leg(ctx, leg) for leg in move.legs])
        else:
            metres = lengths.measure_path(ctx, move.path) if has_edges and self.per_metre else 0.0
        return lengths.price_edges(ctx, agent, move) + metres * self.per_metre


def _count_moves(counts: Mapping[str, Mapping[str, int]], name: str) -> int:
    """Return how often an agent has moved; 0 before its first decision."""
    return counts[name]["moves"] if name in counts else 0


def _is_flying(agent: IAgent) -> bool:
    return agent.type is AgentType.AERIAL


def _find_eliminated_agents(ctx: Context) -> set[str]:
    """Return the names of the agents that were eliminated in this turn."""
    turn = ctx.game.turn + ctx.game.is_moving  # of what happens now
    events = takewhile(lambda event: event["turn"] == turn, reversed(ctx.game.events))
    return {event["agent"] for event in events if event["kind"] == "eliminated"}


def _find_cooldowns(kind: str, data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return the number of turns that named agents must wait before they may repeat a deed."""
    known = data.get(COOLDOWNS, {}).get(kind, {}).get("left", {})
    return {COOLDOWNS: {kind: {"left": {name: more for name, more in known.items() if name in names}}}}


@show_as_call
def cooldown(deed: str, turns: int) -> Rule:
    """Make a rule that forbids an agent to repeat a deed for a number of turns.

    During this time the deed is refused, and `state["blocked"]` names the turn in which it is ready, counted as in
    `result.deeds`. Other agents are not affected.

    Args:
        deed: the deed, as `ctx.game.deeds` declares it.
        turns: number of turns in which it may not be repeated.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, the deed is not declared.
    """
    kind = as_name(deed, "a deed")
    wait = as_count(turns, "turns")

    def left(ctx: Context) -> dict[str, int]:
        agents: dict[str, int] = get_state(ctx, COOLDOWNS, kind, {"of": wait, "left": {}})["left"]
        return agents

    def prepare(ctx: Context) -> None:
        get_fields(kind, ctx.game.deeds)
        left(ctx)

    def check(ctx: Context) -> None:
        for one in ctx.game.performed(kind):
            if one.agent in left(ctx):
                ctx.game.refuse(one.agent, f"it is ready in turn {ctx.game.turn + 1 + left(ctx)[one.agent]}", kind)

    def cooldown(ctx: Context) -> None:
        known = left(ctx)
        later = {name: more - 1 for name, more in known.items() if more > 1}
        known.clear()
        known.update(later)
        known.update((one.agent, wait) for one in ctx.game.performed(kind))

    return declared(
        cooldown,
        RuleSpec(
            prepare=prepare,
            check=check,
            drawer=render_cooldowns,
            rank=Rank.RESOURCES,
            key=f"cooldown of {kind}",
            disclose=partial(_find_cooldowns, kind),
        ),
    )
