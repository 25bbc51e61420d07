"""Functions that look or judge, before all agents have decided and moved: they write values, and change no game."""

import networkx as nx
import pytest

import gamms
from gamms.errors import IllegalMutation

CHANGES = {
    "place": lambda ctx: setattr(ctx.agent.get_agent("ann"), "current_node_id", 3),
    "life": lambda ctx: setattr(ctx.agent.get_agent("ann"), "alive", False),
    "elimination": lambda ctx: ctx.game.eliminate("ann"),
    "return": lambda ctx: ctx.game.respawn("ann"),
    "speed": lambda ctx: setattr(ctx.agent.get_agent("ann"), "speed", 2),
    "team": lambda ctx: setattr(ctx.agent.get_agent("ann"), "team", "blue"),
    "heading": lambda ctx: setattr(ctx.agent.get_agent("ann"), "orientation", (1.0, 0.0)),
    "strategy": lambda ctx: setattr(ctx.agent.get_agent("ann"), "strategy", None),
    "column": lambda ctx: ctx.agent.create_team("green", [1]),
    "birth": lambda ctx: ctx.agent.create_agent("new", start_node_id=0),
    "death": lambda ctx: ctx.agent.delete_agent("ann"),
    "sensor": lambda ctx: ctx.sensor.create_sensor("new", "neighbor"),
    "equipment": lambda ctx: ctx.agent.get_agent("ann").deregister_sensor("odd"),
    "range": lambda ctx: setattr(ctx.sensor.get_sensor("near"), "range", 3.0),
    "setting": lambda ctx: setattr(ctx.game, "max_turns", 9),
    "rule": lambda ctx: ctx.game.add(len, name="rule"),
    "collector": lambda ctx: ctx.game.collect("turns", lambda ctx: ctx.game.turn),
    "channel": lambda ctx: ctx.game.add_channel("radio", range_m=9.0),
    "end": lambda ctx: ctx.game.end("enough"),
    "edge": lambda ctx: ctx.graph.graph.remove_edge(0),
    "node": lambda ctx: ctx.graph.graph.add_node({"id": 99, "x": 0.0, "y": 0.0}),
    "road": lambda ctx: ctx.graph.close_roads([0]),
    "obstacle": lambda ctx: ctx.graph.remove_obstacle_face(0),
    "seed": lambda ctx: ctx.reseed(7),
    "end of the context": lambda ctx: ctx.terminate(),
}
JUDGES = ["sensor", "check", "conflicts"]
WHO = {"sensor": "A sensor", "check": "A check", "conflicts": "A function of conflicts"}


class Resolver:
    """Lets all agents go on, and calls a function."""

    def __init__(self, act):
        self._act = act

    def resolve(self, moves, ctx):
        self._act(ctx)
        return set()


def open_game(judge, act):
    """Return a context with a game of two agents in which a function acts that looks or judges."""
    ctx = gamms.create_context(game={"max_turns": 3}, seed=1)
    ctx.graph.attach_networkx_graph(nx.convert_node_labels_to_integers(nx.grid_2d_graph(4, 4)))
    ctx.sensor.create_sensor("near", "range", range_m=2.0)

    def look(node):
        if judge == "sensor":
            act(ctx)
        return node

    ctx.sensor.from_function("odd", look)
    for name, node in (("ann", 5), ("ben", 10)):
        ctx.agent.create_agent(name, start_node_id=node, team="red", strategy=gamms.strategies.random_walk)
    ctx.agent.get_agent("ann").register_sensor("odd", ctx.sensor.get_sensor("odd"))
    ctx.agent.get_agent("ann").register_sensor("near", ctx.sensor.get_sensor("near"))

    def rest(ctx):
        pass

    rest.check = act if judge == "check" else len_of_moves
    ctx.game.add(rest, phase="deeds")
    if judge == "conflicts":
        ctx.game.conflicts = Resolver(act)
    return ctx


def len_of_moves(ctx):
    """Refuse nothing."""
    return len(ctx.game.moves)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("judge", JUDGES)
def test_a_function_that_looks_or_judges_changes_no_game_alone_or_in_a_batch(judge, change):
    with open_game(judge, CHANGES[change]) as ctx:
        places = [agent.current_node_id for agent in ctx.game.agents]
        with ctx.game.batch(2) as games:
            with pytest.raises(IllegalMutation, match=f"^{WHO[judge]} may not .* belong in a rule: ctx.game.add"):
                games.step()
            assert games.turn.tolist() == [0, 0]
        with pytest.raises(IllegalMutation, match=f"^{WHO[judge]} may not "):
            ctx.game.step()
        assert [agent.current_node_id for agent in ctx.game.agents] == places
        assert (ctx.game.turn, ctx.game.max_turns, len(ctx.game.rules)) == (0, 3, 1)


def write_values(ctx):
    ctx.game.scores["calls"] += 1
    ctx.game.data["calls"] = ctx.game.data.get("calls", 0) + 1
    ctx.game.emit("called", times=ctx.game.data["calls"])
    ann = ctx.agent.get_agent("ann")
    ann.calls = getattr(ann, "calls", 0) + 1
    ctx.game.publish(calls=ann.calls)


@pytest.mark.parametrize("judge", JUDGES)
def test_it_writes_values_as_alone(judge):
    with open_game(judge, write_values) as ctx, ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
        games.run()
        assert games.is_in_arrays
        for number in range(3):
            alone.game.reset(seed=number)
            assert alone.game.run().events == games.result(number).events
            assert games.result(number).scores == {"calls": 3}


@pytest.mark.parametrize("judge", JUDGES)
def test_after_it_was_refused_the_game_may_be_changed_and_goes_on(judge):
    faults = iter([1, 0, 0, 0, 0, 0])

    def act(ctx):
        if next(faults):
            ctx.game.max_turns = 7

    with open_game(judge, act) as ctx:
        with pytest.raises(IllegalMutation):
            ctx.game.step()
        ctx.game.max_turns = 2
        assert ctx.game.run().turns == 2
