"""Rules that exchange messages with other programs in every turn: positions of agents, and changes of the roads."""

from collections.abc import Callable, Iterable

import numpy as np

from gamms.arguments import as_context, as_items, as_range, show_as_call
from gamms.bridge.feeds import Message, Send
from gamms.bridge.lines import RoadChanges
from gamms.bridge.links import Link
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import name_mode_time
from gamms.plain import as_json
from gamms.text import shown
from gamms.typing import AgentType, IAgent, Rule

_DECIMALS = 3
_DEGREES = 8
_LAST = Rank.END + 1  # after the rules that decide whether the game is over
_SLOWEST_S = 1e9


@show_as_call
def publish(to: Link | Send, agents: Iterable[str] | None = None) -> Rule:
    """Make a rule that sends the positions of agents to other programs after each turn.

    It sends a message "position" for each living agent, and then one "turn"; docs/bridge.md describes their fields.

    Args:
        to: a link, or a function that is called with each message, a dict.
        agents: names of the agents to publish; None: all.

    Raises:
        BadType: `to` or `agents` has a wrong type.
        UnknownName (KeyError): an agent does not exist, when the rule is added to a game.
    """
    send = find_sender(to)
    names = None if agents is None else frozenset(as_items(agents, "agents", "names of agents"))

    def prepare(ctx: Context) -> None:
        for name in sorted(names or ()):
            ctx.agent.get_agent(name)

    def publish(ctx: Context) -> None:
        messages = positions(ctx)
        for message in messages:
            if names is None or message["agent"] in names:
                send(message)
        over = ctx.game.over
        send(
            _make_message(
                "turn", ctx, agents=len(messages), crs=ctx.graph.crs, over=None if over is None else as_json(over)
            )
        )

    return declared(publish, RuleSpec(prepare=prepare, rank=_LAST))


def positions(ctx: Context) -> list[Message]:
    """Return the positions of the living agents as messages, sorted by name.

    Raises:
        BadType: `ctx` is not a context.
    """
    agents = as_context(ctx, "gamms.bridge.positions").game.agents
    places = [_find_xyz(agent) for agent in agents]
    messages = [
        _make_message(
            "position", ctx, agent=agent.name, team=_convert_team(agent.team), node=agent.current_node_id, **place
        )
        for agent, place in zip(agents, places, strict=True)
    ]
    if ctx.graph.crs is not None and agents:
        xy = np.array([(place["x"], place["y"]) for place in places], np.float64)
        lat, lon = ctx.graph.graph.to_latlon(xy[:, 0], xy[:, 1])
        for message, one, other in zip(
            messages, lat.round(_DEGREES).tolist(), lon.round(_DEGREES).tolist(), strict=True
        ):
            message["lat"] = one
            message["lon"] = other
    return messages


@show_as_call
def traffic(link: Link, wait_s: float = 5.0) -> Rule:
    """Make a rule for the phase "before" that lets another program close, open and slow roads.

    Before each turn it sends a message "turn", and waits for a line "roads" with the same number. If none comes in
    time, the roads stay as they are, and an event `traffic_late` is emitted. Ids of edges that are not on the map are
    counted in `link.counts["unknown"]`.

    Args:
        link: the link to the program.
        wait_s: the longest wait of a turn for the line in seconds.

    Raises:
        BadType, BadValue: an argument has a wrong type or value.
    """
    if not isinstance(link, Link):
        raise BadType(f"traffic needs a link, such as gamms.bridge.Process([…]), not {shown(link)}.")
    seconds = as_range(wait_s, "wait_s")

    def traffic(ctx: Context) -> None:
        turn = ctx.game.turn
        link.send(_make_message("turn", ctx))
        roads = link.roads(turn, seconds)
        if roads is None:
            ctx.game.emit("traffic_late", waited_s=seconds)
        else:
            link.counts["unknown"] += change_roads(ctx, roads)

    return traffic


def change_roads(ctx: Context, roads: RoadChanges) -> int:
    """Close, open and slow roads; return the number of named edges that do not exist."""
    graph = ctx.graph.graph
    closed = frozenset(ctx.graph.closed_roads)
    opened = [edge for edge in dict.fromkeys(roads.open) if edge in closed]
    if opened:
        ctx.graph.open_roads(opened)
    shut = [edge for edge in dict.fromkeys(roads.close) if _is_edge(ctx, edge)]
    slowed = {edge: seconds for edge, seconds in roads.travel_time.items() if _is_edge(ctx, edge)}
    of_modes = [name for name in ctx.graph.columns().edge_attributes if name.startswith(name_mode_time(""))]
    for edge, seconds in slowed.items():
        graph.update_edge({"id": edge, **dict.fromkeys(("travel_time", *of_modes), min(seconds, _SLOWEST_S))})
    if shut:
        ctx.graph.close_roads(shut)
    wanted = len(set(roads.open)) + len(set(roads.close)) + len(roads.travel_time)
    return wanted - len(opened) - len(shut) - len(slowed)


def find_sender(to: object) -> Callable[[Message], object]:
    """Return the function that sends messages to `to`: the link's `send`, or `to` itself.

    Raises:
        BadType: `to` is neither a link nor a function.
    """
    send = to.send if isinstance(to, Link) else to
    if not callable(send):
        raise BadType(f"Messages go to a link or to a function that takes a dict, not {shown(to)}.")
    return send


def _is_edge(ctx: Context, edge: int) -> bool:
    try:
        ctx.graph.graph.get_edge(edge)
    except (UnknownName, BadValue):
        return False
    return True


def _convert_team(team: object) -> str | int | None:
    return team if team is None or type(team) in (str, int) else str(team)  # type: ignore[return-value] # as it says


def _find_xyz(agent: IAgent) -> dict[str, float]:
    if agent.type == AgentType.AERIAL:
        return {axis: round(value, _DECIMALS) for axis, value in zip("xyz", agent.position, strict=True)}
    x, y = agent.xy
    return {"x": round(x, _DECIMALS), "y": round(y, _DECIMALS)}


def _make_message(kind: str, ctx: Context, **fields: object) -> Message:
    return {"gamms": 1, "type": kind, "turn": ctx.game.turn, **fields}
