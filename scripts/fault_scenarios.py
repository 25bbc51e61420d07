"""The parts of the scenarios of `simulate_faults.py`, and the strategies and rules that they name.

Worker processes of experiments import this file, so it imports little.
"""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import gamms
from gamms.context import Context

WALK = "gamms.strategies:random_walk"

Draws = Random


def draw_map(draw: Draws) -> dict[str, Any]:
    """Draw a grid of at least 25 nodes, in the middle of which roads may be closed."""
    closed = draw.choice([[], [[[5.0, 5.0], [15.0, 5.0], [15.0, 15.0], [5.0, 15.0]]]])
    grid = {"rows": draw.randint(5, 7), "columns": draw.randint(5, 7), "spacing": draw.choice([4.0, 10.0])}
    return {"map": {"grid": grid, "closed": closed}}


def draw_classes(draw: Draws) -> dict[str, Any]:
    """Draw agents of other speeds and kinds, on the ground and in the air."""
    unit = draw.choice(["edges", "metres"])
    teams = {"red": {"speed": draw.choice([1.0, 2.0])}, "blue": {"speed": draw.choice([1.0, 3.0])}}
    if draw.random() < 0.5:
        air = {"count": draw.randint(1, 2), "type": "aerial", "speed": draw.choice([4.0, 30.0]), "altitude": 9.0}
        teams["air"] = {**air, "strategy": WALK}
    return {"settings": {"speed_unit": unit}, "teams": teams}


def draw_strategies(draw: Draws) -> dict[str, Any]:
    """Draw strategies that look at others."""
    names = ["gamms.strategies:chase", "gamms.strategies:flee", "fault_scenarios:wander"]
    teams = {team: {"strategy": draw.choice(names), "sensors": ["near"]} for team in ("red", "blue")}
    return {"sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}, "teams": teams}


MEASURE = {"rule": "fault_scenarios:measure"}
RULES: list[dict[str, Any]] = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "hops": 1}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}},
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "metres": 6, "mutual": True}},
    {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}},
    {"rule": "hold", "with": {"nodes": [12, 7], "turns": 2, "ends": False, "score": 1}},
    {"rule": "discover", "with": {"nodes": {3: "flag", 18: [1, 2]}, "hops": 1}},
    {"rule": "resource", "with": {"name": "fuel", "start": 6, "per_turn": 1, "recharge": {6: 2}}},
    {"rule": "respawn", "with": {"after": 2}},
    {"rule": "fault_scenarios:collect_toll"},
    {"rule": "fault_scenarios:levy", "phase": "before"},
    {"rule": "fault_scenarios:levy", "phase": "deeds"},
    MEASURE,
]


def draw_rules(draw: Draws) -> dict[str, Any]:
    """Draw up to four rules."""
    return {"rules": draw.sample(RULES, draw.randint(1, 4))}


def draw_conflicts(draw: Draws) -> dict[str, Any]:
    """Draw the capacity of nodes and who wins."""
    resolve = draw.choice(["at_random", {"by_priority": ["blue", "red"]}, "fault_scenarios:let_last_win"])
    return {"conflicts": {"capacity": draw.choice([1, 2]), "among": draw.choice(["all", "team"]), "resolve": resolve}}


def draw_channels(draw: Draws) -> dict[str, Any]:
    """Draw a channel, which `wander` uses."""
    radio = {"range_m": draw.choice([9.0, 30.0]), "delay_turns": draw.choice([1, 2]), "loss": draw.choice([0.0, 0.3])}
    return {"channels": {"radio": radio | {"relay": draw.random() < 0.3}}}


def draw_deeds(draw: Draws) -> dict[str, Any]:
    """Declare deeds, which `wander` does; one of them lasts."""
    dig = {"fields": {"node": "node"}, "turns": draw.choice([0.5, 2.5]), "on_interrupt": "resume"}
    dig |= {"interrupted_by": draw.choice([[], ["move"]]), "blocks_moving": draw.random() < 0.5}
    return {"settings": {"deeds": {"scan": {"node": "node"}, "rest": {}, "dig": dig}}}


def draw_sensors(draw: Draws) -> dict[str, Any]:
    """Draw sensors that err."""
    eyes = [
        {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.7},
        {"type": "AGENT_RANGE", "sensor_range": 35.0, "delay_turns": 2, "position_noise_m": 9.0},
        {"type": "AGENT", "false_alarm_rate": 0.4},
        {"type": "OCCLUDED_AGENT", "sensor_range": 35.0, "fov": 2.5},
    ]
    return {"sensors": {"eyes": draw.choice(eyes)}, "teams": {team: {"sensors": ["eyes"]} for team in ("red", "blue")}}


def draw_lives(draw: Draws) -> dict[str, Any]:
    """Let an agent come, in any phase of a turn, and one go after it."""
    come = {"rule": "fault_scenarios:come", "phase": draw.choice(["before", "deeds", "after"])}
    return {"rules": [come, {"rule": "fault_scenarios:go"}]}


def draw_order(_: Draws) -> dict[str, Any]:
    """Let teams move in turn."""
    return {"settings": {"order": [["blue"], ["red", "air"]]}}


def draw_deadline(_: Draws) -> dict[str, Any]:
    """Give players less time in a turn than they are given by themselves."""
    return {"settings": {"deadline_s": 5.0}}


PARTS: dict[str, Callable[[Draws], dict[str, Any]]] = {
    "map": draw_map,
    "classes": draw_classes,
    "strategies": draw_strategies,
    "rules": draw_rules,
    "conflicts": draw_conflicts,
    "channels": draw_channels,
    "deeds": draw_deeds,
    "sensors": draw_sensors,
    "births and deaths": draw_lives,
    "order": draw_order,
    "deadline": draw_deadline,
}


def wander(state: dict[str, Any]) -> None:
    """Walk, talk, do and remember, as follows from what the agent knows."""
    memory = state["memory"]
    before = [memory[turn] for turn in range(state["turn"]) if turn in memory]
    lot = state["draw"].below(1000) + sum(before) + len(state.get("inbox", ()))
    memory[state["turn"]] = lot
    node = state["legal"][lot % len(state["legal"])]
    do = [{"scan": {"node": node}}, {"rest": None}, {"dig": {"node": state["curr_pos"]}}][lot % 3]
    do = {"rest": None} if state.get("doing") else do
    state["action"] = {"node_id": node, "do": do} if "deeds" in state else node
    if lot % 4 == 0 and "outbox" in state:
        state["outbox"].append({"channel": "radio", "to": None, "body": lot % 9})


def collect_toll(ctx: Context) -> None:
    """Let teams pay on every third node, and count it in the data of the game."""
    paid = ctx.game.data.setdefault("toll", {})
    for agent in ctx.game.agents:
        if agent.current_node_id % 3 == 0:
            paid[agent.name] = paid.get(agent.name, 0) + 1
            ctx.game.scores[agent.team] = ctx.game.scores.get(agent.team, 0) - 1
            ctx.game.emit("toll", agent=agent.name, times=paid[agent.name])


def let_last_win(contest: Any, ctx: Context) -> list[str]:  # noqa: ARG001 - as functions of conflicts are called
    """Let the agents with the last names win."""
    return sorted(mover.agent for mover in contest.movers)[-contest.places :]


def levy(ctx: Context) -> None:
    """Before agents move, let a team pay a drawn price, emit an event of it, and close or open a road."""
    teams = sorted({agent.team for agent in ctx.game.agents})
    team = teams[ctx.game.turn % len(teams)]
    amount = int(ctx.rng.integers(1, 9))
    ctx.game.scores[team] -= amount
    ctx.game.emit("levy", team=team, amount=amount)
    closed = ctx.graph.closed_roads
    if closed:
        ctx.graph.open_roads(closed)
    else:
        ctx.graph.close_roads([amount])


def measure(ctx: Context) -> None:
    """Do nothing in turns; see `collect_distances`."""


def collect_distances(ctx: Context) -> None:
    """Collect how far agents are east, and how many there are."""
    ctx.game.collect("east", lambda agent: agent.xy[0], every=2, per="agent")
    ctx.game.collect("agents", lambda ctx: len(ctx.game.agents))


measure.prepare = collect_distances  # type: ignore[attr-defined] # as rules have it


def come(ctx: Context) -> None:
    """Let an agent come in the second turn, once: teams that move in turn have more calls of the phase "deeds"."""
    if ctx.game.turn == 2 and "newcomer" not in ctx.agent.agents:
        walk = gamms.strategies.random_walk
        ctx.agent.create_agent("newcomer", team="blue", start_node_id=ctx.seed % 25, strategy=walk)


def go(ctx: Context) -> None:
    """Let an agent leave after five turns."""
    if ctx.game.turn == 5 and "red_1" in ctx.agent.agents:
        ctx.agent.delete_agent("red_1")


def obey(state: dict[str, Any]) -> None:
    """Walk at random; carry out, once, the order in the file that the facts name, after some games without it."""
    orders = Path(state["facts"]["orders"])
    if state["turn"] == 2 and state["name"] == "red_0" and orders.exists():
        order, games = orders.read_text().split()
        if games == "0":
            orders.unlink()
            ORDERS[order]()
        else:
            orders.write_text(f"{order} {int(games) - 1}")
    gamms.strategies.random_walk(state)


def die() -> None:
    """End this process without a word."""
    os.kill(os.getpid(), signal.SIGKILL)


def press_ctrl_c() -> None:
    """Interrupt this program as Ctrl-C does."""
    signal.raise_signal(signal.SIGINT)


def fail() -> None:
    """Raise an error."""
    raise ValueError("a fault of the strategy")


ORDERS = {"die": die, "interrupt": press_ctrl_c, "fail": fail}
