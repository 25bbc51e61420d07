"""After an error in any function that a turn calls, the turn is taken back unless all had moved, and the game goes on.

To write the golden file again: `python tests/game/test_errors_in_turns.py`.
"""

import json
from pathlib import Path

import pytest

import gamms
from gamms.errors import GammsError
from gamms.rules import Conflicts, tag
from gamms.sensor import SensorType

GOLDEN = Path(__file__).with_suffix(".json")
TURN = 3  # from which on an error is raised


class Fault:
    """Raises an error once."""

    def __init__(self, ctx):
        self.is_due = True
        self._ctx = ctx

    def __call__(self):
        if self.is_due and self._ctx.game.turn >= TURN:
            self.is_due = False
            raise ZeroDivisionError


def rule_before(ctx, fault):
    ctx.game.add(lambda ctx: _score(ctx, fault), phase="before", name="faulty")


def rule_of_deeds(ctx, fault):
    ctx.game.add(lambda ctx: _score(ctx, fault), phase="deeds", name="faulty")


def rule_after(ctx, fault):
    ctx.game.add(lambda ctx: _score(ctx, fault), name="faulty")


def _score(ctx, fault):
    ctx.game.scores["red"] += 1
    ctx.game.emit("scored")
    fault()


def check(ctx, fault):
    def rule(ctx):
        return None

    rule.check = lambda ctx: fault()
    ctx.game.add(rule, name="faulty")


def effect_of_tags(ctx, fault):
    ctx.game.add(tag("red", "blue", then=lambda ctx, agent, by: fault(), hops=9), name="faulty")


def strategy(ctx, fault):
    def faulty(state):
        walk(state)
        state["memory"]["asked"] = state["turn"]
        fault()

    ctx.agent.agents["bert"].register_strategy(faulty)


def plan(ctx, fault):
    def faulty(states):
        for state in states.values():
            walk(state)
        fault()

    ctx.game.command("blue", faulty)


def plan_of_arrays(ctx, fault):
    def faulty(view):
        fault()
        return view.nodes

    ctx.game.command("blue", faulty, arrays=True)


def resolver(ctx, fault):
    def resolve(contest, ctx):
        fault()
        return [mover.agent for mover in contest.movers][: contest.places]

    ctx.game.conflicts = Conflicts(capacity=1, resolve=resolve)


def sensor(ctx, fault):
    ctx.agent.agents["bert"].register_sensor("own", ctx.sensor.from_function("own", fault))


def collector(ctx, fault):
    ctx.game.collect("turns", lambda ctx: fault() or ctx.game.turn)


def illegal_move(ctx, fault):
    def lost(state):
        walk(state)
        try:
            fault()
        except ZeroDivisionError:
            state["action"] = 99

    ctx.game.on_illegal = "raise"
    ctx.agent.agents["bert"].register_strategy(lost)


ENTRIES = (
    *(rule_before, rule_of_deeds, rule_after, check, effect_of_tags, strategy, plan, plan_of_arrays, resolver, sensor),
    *(collector, illegal_move),
)
WAYS = {
    "by edges": {},
    "in parts": {"order": [["red"], ["blue"]]},
    "by metres": {"speed_unit": "metres"},
    "at arrivals": {"speed_unit": "metres", "decide": "arrival"},
}


def walk(state):
    state["memory"].setdefault("path", []).append(state["curr_pos"])
    state["outbox"].append({"channel": "radio", "to": None, "body": state["turn"]})
    node = state["legal"][state["rng"].integers(len(state["legal"]))]
    state["action"] = {"node_id": node, "do": {"mark": None}}


def told(entry, way):
    """What is left of a turn in which an entry raises, and of the two turns after it."""
    settings = {"deeds": {"mark": None}, **WAYS[way]}
    with gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}, game=settings) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 3, 10.0))
        ctx.sensor.create_sensor("all", SensorType.AGENT)
        ctx.game.add_channel("radio", range_m=20.0, delay_turns=1)
        for name, node, team in (("anna", 0, "red"), ("bert", 2, "blue"), ("carl", 5, "blue")):
            speed = 10.0 if WAYS[way].get("speed_unit") else None
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=["all"], strategy=walk, speed=speed)
        fault = Fault(ctx)
        entry(ctx, fault)
        with pytest.raises((ZeroDivisionError, GammsError)) as raised:
            ctx.game.run(300)
        assert not fault.is_due, raised.value
        after = _told_of(ctx)
        ctx.game.run(2)
        return {
            "error": [type(raised.value).__name__, *getattr(raised.value, "__notes__", [])],
            "after it": after,
            "later": _told_of(ctx),
        }


def _told_of(ctx):
    agents = {name: [one.current_node_id, one.prev_node_id] for name, one in ctx.agent.agents.items()}
    return {
        "turn": ctx.game.turn,
        "agents": agents,
        "edges": {name: [one.edge, one.offset_m] for name, one in ctx.agent.agents.items()},
        "memories": {name: dict(memory) for name, memory in ctx.game.memories.items()},
        "scores": dict(ctx.game.scores),
        "events": list(ctx.game.events),
        "deeds": [[one["turn"], one["agent"]] for one in ctx.game.internals.state.deeds],
        "messages": [[one["turn"], one["sender"], one["heard"]] for one in ctx.game.internals.state.messages],
        "over": ctx.game.over,
    }


def golden():
    return {f"{entry.__name__}, {way}": told(entry, way) for entry in ENTRIES for way in WAYS}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.__name__)
def test_an_error_takes_the_turn_back_unless_all_agents_have_moved(entry, way):
    known = json.loads(GOLDEN.read_text())
    assert json.loads(json.dumps(told(entry, way))) == known[f"{entry.__name__}, {way}"]


if __name__ == "__main__":
    lines = [f"{json.dumps(case)}: {json.dumps(said)}" for case, said in golden().items()]
    GOLDEN.write_text("{\n" + ",\n".join(lines) + "\n}\n")
