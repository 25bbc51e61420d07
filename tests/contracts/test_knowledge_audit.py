"""`check_strategy` finds decisions by what an agent cannot know, and passes strategies that decide by their states."""

import asyncio
from collections.abc import Callable
from typing import Any
from zlib import crc32

import pytest

import gamms
from gamms.errors import BadType
from gamms.testing import check_strategy

_Strategy = Callable[[dict[str, Any]], None]
_board: dict[str, Any] = {}  # what strategies share behind the back of the game


def _choose(state: dict[str, Any], number: object) -> None:
    legal = state["legal"]
    state["action"] = legal[crc32(repr(number).encode()) % len(legal)]


def _tell_all(state: dict[str, Any]) -> None:
    """Decide for an agent of the other team, and put all that it knows on the board."""
    _board.update(
        gold=state["facts"].get("gold", 0),
        key=state["facts"].get("key", ""),
        rng=state["rng"].random(),
        draw=state["draw"].below(1000),
        bodies=[one["body"] for one in state["inbox"]],
        place=state["curr_pos"],
    )
    state["outbox"].append({"channel": "radio", "to": "red", "body": {"turn": state["turn"], "at": [3, "x"]}})
    state["action"] = state["legal"][0]


def _make_ctx(range_m: float = 1e9) -> gamms.Context:
    ctx = gamms.create_context(seed=1)
    _board["ctx"] = ctx
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
    ctx.game.add_channel("radio", range_m=range_m)
    ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
    for name, team, start in [("ann", "red", 0), ("bob", "red", 5), ("cat", "blue", 30), ("dan", "blue", 35)]:
        ctx.agent.create_agent(name, start_node_id=start, team=team, sensors=["near"])
    ctx.agent.get_agent("ann").register_strategy(_tell_all)
    ctx.agent.get_agent("bob").register_strategy(_call_ann)
    ctx.agent.get_agent("cat").register_strategy(_share_with_team)
    ctx.game.publish(to="red", gold=3, grid=[1, {"a": 2.5}])
    ctx.game.publish(to="ann", key="door")
    ctx.game.publish(public=1)
    return ctx


def _call_ann(state: dict[str, Any]) -> None:
    state["outbox"].append({"channel": "radio", "to": "ann", "body": "now"})
    gamms.strategies.random_walk(state)


def _share_with_team(state: dict[str, Any]) -> None:
    state["team_memory"]["cat"] = state["curr_pos"]
    state["outbox"].append({"channel": "radio", "to": "blue", "body": state["turn"]})
    _choose(state, state["draw"].below(100))


def _place_of(name: str) -> int:
    place: int = _board["ctx"].agent.get_agent(name).current_node_id
    return place


def _read_sent() -> list[Any]:
    return [one["body"] for one in _board["ctx"].game.messages if one["sender"] == "ann"]


LEAKS: dict[str, Callable[[], object]] = {
    "a place that the board shows": lambda: _board["place"],
    "a place read from the agent": lambda: _place_of("ann"),
    "a place of another agent": lambda: _place_of("bob"),
    "a distance": lambda: abs(_place_of("ann") - 35),
    "all places": lambda: tuple(one.current_node_id for one in _board["ctx"].agent.create_iter()),
    "a node that was left": lambda: _board["ctx"].agent.get_agent("bob").prev_node_id,
    "the stream of another": lambda: _board["rng"],
    "a draw of another": lambda: _board["draw"],
    "the parity of a draw": lambda: _board["draw"] % 2,
    "a fact of a team": lambda: _board["gold"],
    "a fact of an agent": lambda: _board["key"],
    "the length of a fact": lambda: len(_board["key"]),
    "the inbox of another": lambda: repr(_board["bodies"]),
    "the last message to another": lambda: repr(_board["bodies"][-1:]),
    "a message that others have sent": lambda: repr(_read_sent()),
    "a part of a message": lambda: sum(one["turn"] for one in _read_sent()),
}


@pytest.mark.parametrize("leak", LEAKS)
def test_a_decision_by_hidden_knowledge_is_found(leak: str) -> None:
    read = LEAKS[leak]

    def decide(state: dict[str, Any]) -> None:
        _choose(state, read())

    range_m = 1e9 if "another" in leak else 1.0  # messages to this agent would be known
    with pytest.raises(AssertionError, match=r"when only the (places|draws|messages|facts) (of|to) other agents"):
        check_strategy(decide, lambda: _make_ctx(range_m), "dan", turns=6)
    check_strategy(decide, lambda: _make_ctx(range_m), "dan", turns=6, knowledge=False)


def _remember(state: dict[str, Any]) -> None:
    state["memory"]["turns"] = state["memory"].get("turns", 0) + 1
    _choose(state, state["memory"]["turns"] + len(state["inbox"]) + state["team_memory"].get("cat", 0))


def _answer(state: dict[str, Any]) -> None:
    for one in state["inbox"]:
        state["outbox"].append({"channel": "radio", "to": one["sender"], "body": one["body"]})
    _choose(state, state["facts"]["public"] + _board["ctx"].game.turn)


@pytest.mark.parametrize("strategy", [gamms.strategies.random_walk, _remember, _answer, _share_with_team])
def test_a_strategy_that_decides_by_its_state_passes(strategy: _Strategy) -> None:
    check_strategy(strategy, _make_ctx, "dan", turns=6)


def test_a_leak_into_the_memory_is_found() -> None:
    def decide(state: dict[str, Any]) -> None:
        state["memory"]["enemy"] = _place_of("ann")
        state["action"] = state["legal"][0]

    with pytest.raises(AssertionError, match=r"the strategy wrote .*enemy.* into state\['memory'\]"):
        check_strategy(decide, _make_ctx, "dan", turns=3)


def _come_later(ctx: gamms.Context) -> None:
    if ctx.game.turn == 1:
        ctx.agent.create_agent("eve", start_node_id=0, team="red", strategy=_stay)


def _stay(state: dict[str, Any]) -> None:
    state["action"] = state["legal"][0]


def _fly_east(state: dict[str, Any]) -> None:
    state["action"] = (1.0, 0.0, 0.0)


def _plan(states: dict[str, dict[str, Any]]) -> None:
    for state in states.values():
        state["outbox"].append({"channel": "radio", "to": "red", "body": state["turn"]})
        _stay(state)


async def _call_later(state: dict[str, Any]) -> None:
    await asyncio.sleep(0)
    _plan({state["name"]: state})


def _add_kite(ctx: gamms.Context) -> None:
    ctx.agent.create_agent("kite", type="AERIAL", start_node_id=0, speed=5.0, team="red", strategy=_fly_east)


UNSEEN: dict[str, tuple[Callable[[gamms.Context], object], Callable[[], object]]] = {
    "an agent that comes later": (
        lambda ctx: ctx.game.add(_come_later),
        lambda: "eve" in _board["ctx"].agent.agents and _place_of("eve"),
    ),
    "a drone that draws nothing": (_add_kite, lambda: _board["ctx"].agent.get_agent("kite").position),
    "messages of a plan": (lambda ctx: ctx.game.command("red", _plan), lambda: repr(_read_sent())),
    "messages of an asynchronous strategy": (
        lambda ctx: ctx.agent.get_agent("ann").register_strategy(_call_later),
        lambda: repr(_read_sent()),
    ),
}


def _make_quiet(change: Callable[[gamms.Context], object]) -> gamms.Context:
    """Make a game in which others stay, draw nothing and are not heard."""
    ctx = _make_ctx(1.0)
    for name in ("ann", "bob", "cat"):
        ctx.agent.get_agent(name).register_strategy(_stay)
    change(ctx)
    return ctx


@pytest.mark.parametrize("leak", UNSEEN)
def test_a_leak_from_any_agent_is_found(leak: str) -> None:
    change, read = UNSEEN[leak]
    with pytest.raises(AssertionError, match=r"when only the (places|messages) of other agents"):
        check_strategy(lambda state: _choose(state, read()), lambda: _make_quiet(change), "dan", turns=8)


class _Prepared:
    """A strategy that adds a channel before the first turn."""

    def prepare(self, ctx: gamms.Context) -> None:
        ctx.game.add_channel("telephone", range_m=1.0)

    def __call__(self, state: dict[str, Any]) -> None:
        state["outbox"].append({"channel": "telephone", "to": "blue", "body": 1})
        _stay(state)


def _take_edge(state: dict[str, Any]) -> None:
    state["action"] = {"edge": state["legal_edges"][-1]}


def _count_edges(state: dict[str, Any]) -> None:
    _choose(state, len(_board["ctx"].graph.columns().edge_ids))


def _close_roads(ctx: gamms.Context) -> None:
    graph = ctx.graph.graph
    for edge in [edge for edge in graph.get_edges() if graph.get_edge(edge).source == _place_of("bob")][:1]:
        graph.remove_edge(edge)


def _add_namesake(ctx: gamms.Context) -> None:
    ctx.agent.create_agent("red", start_node_id=1, team="red", strategy=_stay)


@pytest.mark.parametrize(
    ("strategy", "change"),
    [
        (_Prepared(), lambda _: None),
        (_take_edge, lambda _: None),
        (_count_edges, lambda ctx: ctx.game.add(_close_roads)),
        (_stay, _add_namesake),
        (_stay, lambda ctx: ctx.game.add(lambda ctx: ctx.game.turn == 2 and ctx.agent.delete_agent("ann"))),
    ],
    ids=["prepared", "edges", "roads that others close", "a team and an agent of one name", "an agent that goes"],
)
def test_a_strategy_that_uses_only_the_knowledge_of_its_agent_passes(
    strategy: _Strategy, change: Callable[[gamms.Context], object]
) -> None:
    check_strategy(strategy, lambda: _make_quiet(change), "dan", turns=4)


def test_a_strategy_that_is_not_asked_is_not_passed() -> None:
    def make_planned() -> gamms.Context:
        return _make_quiet(lambda ctx: ctx.game.command("blue", _plan))

    with pytest.raises(AssertionError, match=r"was not asked in 3 turns.* the plan of team 'blue' decides for it"):
        check_strategy(_stay, make_planned, "dan", turns=3)
    with pytest.raises(AssertionError, match=r"'dan' has no strategy to check: .*A plan of its team is checked as"):
        check_strategy(None, make_planned, "dan", turns=3)
    with pytest.raises(AssertionError, match="in a game of at least one turn"):
        check_strategy(_stay, _make_ctx, "dan", turns=0)


def test_arguments_of_another_type_are_refused() -> None:
    with pytest.raises(BadType, match="A strategy"):
        check_strategy(3, _make_ctx, "dan")  # type: ignore[arg-type] # which is tested
    with pytest.raises(BadType, match="knowledge must be True or False, not 'no'"):
        check_strategy(_stay, _make_ctx, "dan", knowledge="no")  # type: ignore[arg-type] # which is tested
