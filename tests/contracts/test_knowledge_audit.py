"""`check_strategy` finds decisions by what an agent cannot know, and passes strategies that decide by their states."""

from collections.abc import Callable
from typing import Any

import pytest

import gamms
from gamms.testing import check_strategy

_Strategy = Callable[[dict[str, Any]], None]
_board: dict[str, Any] = {}  # what strategies share behind the back of the game


def _choose(state: dict[str, Any], number: object) -> None:
    legal = state["legal"]
    state["action"] = legal[hash(number) % len(legal)]


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
