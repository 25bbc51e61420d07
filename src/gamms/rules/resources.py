"""What agents use up: amounts such as fuel, which moves, turns and deeds cost, and deeds that take time to be ready."""

from collections.abc import Collection, Hashable, Iterable, Mapping
from functools import partial
from itertools import pairwise, takewhile
from math import dist, isfinite
from typing import Annotated, Any, NamedTuple

from gamms.arguments import as_choice, as_count, as_int, as_mapping, as_name, as_range
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import GraphColumns, shortest_edges
from gamms.rules.endings import as_teams, refuse_unknown, state_of
from gamms.rules.visits import EdgesGoneAlong
from gamms.text import shown, shown_as_called
from gamms.typing import AgentType, IAgent, Rule
from gamms.typing.game import TEAMS, Leg, Move
from gamms.visual.drawers.standings import COOLDOWNS, RESOURCES, render_amounts, render_cooldowns

_EMPTY = ("stay", "eliminate")
_SLACK = 1e-9  # of what is needed: an amount that is just enough must not fail by rounding


@shown_as_called
def resource(  # noqa: PLR0913 - all that a rule is, in one call
    name: str,
    start: float,
    *,
    per_metre: float = 0,
    per_edge: float = 0,
    per_turn: float = 0,
    per_deed: Mapping[str, float] | None = None,
    recharge: Mapping[Any, float] | None = None,
    capacity: float | None = None,
    empty: str = "stay",
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
) -> Rule:
    """Make a rule by which agents use up an amount each, such as fuel, and may recharge it on some nodes.

    A move or a deed that needs more than is left is refused as a whole, deeds first, in the order in which the action
    has them; `state["blocked"]` says why. At the end of a turn an agent pays for what it has done, an edge when it gets
    to the end of it, then for the turn, as far as there is something left; then it recharges. An agent that has nothing
    left at the end of its turn is an event `empty` with `agent` and `resource`. One that comes back after it was out
    has the `start` again.

    Each agent knows what it has: `state["facts"][name]` is its own amount.

    Args:
        name: of the resource, its facts, and the key of its state.
        start: what each agent has at first.
        per_metre: the price of a map unit: along the edges, in a straight line where there is none and in the air.
        per_edge: the price of an edge.
        per_turn: the price of a turn.
        per_deed: deed -> its price.
        recharge: node -> what an agent gets at the end of each turn there; one that flies, where that node is nearest.
        capacity: what an agent has at most; None: what it has at first.
        empty: what comes of an agent that has nothing left: "stay" where it is, or "eliminate".
        teams: a team, or several; None: all agents.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, a node is not on the map, or a deed is not declared.
    """
    begin, full = as_range(start, "start"), as_range(start if capacity is None else capacity, "capacity")
    if begin > full or not isfinite(begin):
        raise BadValue(f"start must be finite and at most the capacity, {full:g}, not {begin:g}.")
    prices = {} if per_deed is None else as_mapping(per_deed, "per_deed")
    rates = {} if recharge is None else as_mapping(recharge, "recharge")
    tank = _Tank(
        as_name(name, "a resource"),
        begin,
        full,
        as_range(per_metre, "per_metre"),
        as_range(per_edge, "per_edge"),
        as_range(per_turn, "per_turn"),
        {deed: as_range(price, f"per_deed[{shown(deed)}]") for deed, price in prices.items()},
        {as_int(node, "A node to recharge"): as_range(rate, f"recharge[{node}]") for node, rate in rates.items()},
        as_choice(empty, "empty", _EMPTY) == "eliminate",
        as_teams(teams),
    )
    lengths = _Lengths()

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


class _Lengths:
    """The lengths of moves on the map as it is."""

    def __init__(self) -> None:
        self._of: tuple[GraphColumns | None, dict[tuple[int, int], float]] = (None, {})

    def of(self, ctx: Context, leg: Leg) -> float:
        """Return how long an edge is that an agent has gone along, closed since or not; removed: from end to end."""
        try:
            return float(EdgesGoneAlong(ctx)[leg.edge].length)
        except UnknownName:
            return dist(*ctx.graph.graph.positions([leg.source, leg.target]).tolist())

    def along(self, ctx: Context, path: tuple[int, ...]) -> float:
        """Return how long a path is, in map units."""
        columns = ctx.graph.columns()
        if self._of[0] is not columns:
            self._of = columns, shortest_edges(columns)
        return sum(self._between(ctx, *ends) for ends in pairwise(path) if ends[0] != ends[1])

    def _between(self, ctx: Context, source: int, target: int) -> float:
        known = self._of[1].get((source, target))
        return dist(*ctx.graph.graph.positions([source, target]).tolist()) if known is None else known


class _Tank(NamedTuple):
    """The arguments of the rule, checked. What happens in a game is in `ctx.game.data`."""

    name: str
    start: float
    full: float
    per_metre: float
    per_edge: float
    per_turn: float
    per_deed: dict[str, float]
    recharge: dict[int, float]
    eliminates: bool
    teams: frozenset[Hashable] | None

    def prepare(self, ctx: Context) -> None:
        """Check the arguments against the game, and publish the amounts."""
        refuse_unknown(ctx, self.recharge)
        for deed in self.per_deed:
            _check_declared(ctx, deed)
        if self.teams is None:
            ctx.game.publish(**{self.name: self.start})  # for agents that come later
        for agent in self._agents(ctx):
            if agent.name not in self._state(ctx)["amounts"]:
                self._give(ctx, agent, self.start)

    def disclose(self, data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
        """Return what some agents have left."""
        state = data.get(RESOURCES, {}).get(self.name, {})
        own = {
            key: {name: number for name, number in state.get(key, {}).items() if name in names}
            for key in ("amounts", "flights")
        }
        return {RESOURCES: {self.name: {"turn": state.get("turn", -1), **own}}}

    def check(self, ctx: Context, lengths: _Lengths) -> None:
        """Refuse what costs more than is left."""
        state, moves = self._state(ctx), ctx.game.moves
        deeds: dict[str, list[str]] = {}
        for deed in ctx.game.performed():
            deeds.setdefault(deed.agent, []).append(deed.kind)
        if state["turn"] != ctx.game.turn:  # with an order of play there are several checks in a turn
            flying = [agent.name for agent in self._agents(ctx) if _flies(agent)]
            state["flights"] = {name: _num_moves(ctx, name) for name in flying}
            state["turn"] = ctx.game.turn
        for agent in ctx.game.agents:
            if not self._counts(agent):
                continue
            left = state["amounts"].get(agent.name, self.start)
            is_empty = left <= 0
            for kind in deeds.get(agent.name, ()):
                price = self.per_deed.get(kind, 0.0)
                if price > left * (1 + _SLACK):
                    ctx.game.refuse(agent, f"it needs {price:g} {self.name}, and {left:g} is left", kind)
                else:
                    left -= price
            if _flies(agent):
                price = self.per_metre * (agent.speed or 0.0)
            else:
                price = self._price(ctx, moves[agent.name], lengths)
            if is_empty:
                ctx.game.refuse(agent, f"its {self.name} is used up")
            elif price > left * (1 + _SLACK):
                ctx.game.refuse(agent, f"it needs {price:g} {self.name}, and {left:g} is left")

    def charge(self, ctx: Context, lengths: _Lengths) -> None:
        """Let agents pay for what they did, recharge them, and put out those that have nothing left."""
        state, moves = self._state(ctx), ctx.game.moves
        used = dict.fromkeys((agent.name for agent in self._agents(ctx)), self.per_turn)
        for deed in ctx.game.performed():
            if deed.agent in used:
                used[deed.agent] += self.per_deed.get(deed.kind, 0.0)
        out_now = _eliminated(ctx)
        for agent in self._agents(ctx):
            name = agent.name
            if not agent.alive and name not in out_now:
                self._give(ctx, agent, self.start)
                continue
            if _flies(agent):
                flights = _num_moves(ctx, name) - state["flights"].get(name, 0)
                price = flights * self.per_metre * (agent.speed or 0.0)
            else:
                price = self._price(ctx, moves[name], lengths) if name in moves else 0.0
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
        """Set what an agent has, and let it know."""
        amounts = self._state(ctx)["amounts"]
        if amounts.get(agent.name) != amount:
            amounts[agent.name] = amount
            ctx.game.publish(to=agent, **{self.name: amount})

    def _state(self, ctx: Context) -> dict[str, Any]:
        full = self.full if isfinite(self.full) else self.start
        return state_of(ctx, RESOURCES, self.name, {"full": full, "amounts": {}, "turn": -1, "flights": {}})

    def _agents(self, ctx: Context) -> list[IAgent]:
        """Return the agents that have the resource, dead ones too, in the order of their names."""
        return [agent for _, agent in sorted(ctx.agent.agents.items()) if self._counts(agent)]

    def _counts(self, agent: IAgent) -> bool:
        return self.teams is None or agent.team in self.teams

    def _price(self, ctx: Context, move: Move, lengths: _Lengths) -> float:
        edges = sum(start != end for start, end in pairwise(move.path))
        if move.legs:
            metres = sum([abs(leg.end - leg.begin) * lengths.of(ctx, leg) for leg in move.legs])
        else:
            metres = lengths.along(ctx, move.path) if edges and self.per_metre else 0.0
        return edges * self.per_edge + metres * self.per_metre


def _check_declared(ctx: Context, deed: str) -> None:
    if deed not in ctx.game.deeds:
        raise UnknownName("deed" if ctx.game.deeds else "deed, as ctx.game.deeds declares none:", deed, ctx.game.deeds)


def _num_moves(ctx: Context, name: str) -> int:
    """Return how often an agent has moved; one that was not asked yet has no counts."""
    counts = ctx.game.counts.get(name)
    return counts["moves"] if counts else 0


def _flies(agent: IAgent) -> bool:
    return agent.type is AgentType.AERIAL


def _eliminated(ctx: Context) -> set[str]:
    """Return the names of the agents that went out in this turn."""
    turn = ctx.game.turn + ctx.game.is_moving  # of what happens now
    events = takewhile(lambda event: event["turn"] == turn, reversed(ctx.game.events))
    return {event["agent"] for event in events if event["kind"] == "eliminated"}


def _cooling(kind: str, data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return for how many turns more some agents may not do a deed."""
    known = data.get(COOLDOWNS, {}).get(kind, {}).get("left", {})
    return {COOLDOWNS: {kind: {"left": {name: more for name, more in known.items() if name in names}}}}


@shown_as_called
def cooldown(deed: str, turns: int) -> Rule:
    """Make a rule by which an agent that has done something may not do it again in so many turns.

    It is refused until then, and `state["blocked"]` names the turn in which it is ready, by its number in
    `result.deeds`. Another agent may do it meanwhile.

    Args:
        deed: what is done, as `ctx.game.deeds` declares it.
        turns: in how many turns it may not be done again.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, there is no such deed.
    """
    kind, wait = as_name(deed, "a deed"), as_count(turns, "turns")

    def left(ctx: Context) -> dict[str, int]:
        agents: dict[str, int] = state_of(ctx, COOLDOWNS, kind, {"of": wait, "left": {}})["left"]
        return agents

    def prepare(ctx: Context) -> None:
        _check_declared(ctx, kind)
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
            disclose=partial(_cooling, kind),
        ),
    )
