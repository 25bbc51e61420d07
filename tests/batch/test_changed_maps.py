"""Games of batches in which plain functions change the map, ask sensors that err, or draw as agents do."""

import pytest
from batch_scenes import check_games, scene

from gamms.errors import BadValue

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
ERRING = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.5}, "next": {"type": "NEIGHBOR"}}
UNITS = [{}, {"speed_unit": "metres"}, {"speed_unit": "metres", "decide": "arrival"}, {"legal": "any"}]


def wander(state):
    """Go by what is seen and legal."""
    state["action"] = state["legal"][(len(state["sensor"]["near"][1]) + state["turn"]) % len(state["legal"])]


def is_due(ctx):
    """Return whether a game changes now: each in a turn of its own, and some do not."""
    return ctx.seed % 3 > 0 and ctx.game.turn == 2 + ctx.seed % 4


def add_bridge(ctx):
    """Connect two corners by an edge."""
    if is_due(ctx):
        ctx.graph.graph.add_edge({"id": 900, "source": 0, "target": 24, "length": 5.0})
        ctx.graph.graph.add_edge({"id": 901, "source": 24, "target": 0, "length": 5.0})


def add_island(ctx):
    """Add a node next to an agent, and put the agent there a turn later."""
    here = ctx.agent.get_agent("red_0")
    if is_due(ctx):
        ctx.graph.graph.add_node({"id": 500, "x": 3.0, "y": 3.0})
        ctx.graph.graph.add_edge({"id": 900, "source": here.current_node_id, "target": 500, "length": 4.0})
        ctx.graph.graph.add_edge({"id": 901, "source": 500, "target": 7, "length": 4.0})
    elif ctx.graph.graph.has_node(500) and ctx.game.turn % 4 == 0:
        here.current_node_id = 500


def found_colony(ctx):
    """Add a node and put an agent there at once."""
    if is_due(ctx):
        ctx.graph.graph.add_node({"id": 500, "x": 3.0, "y": 3.0})
        ctx.graph.graph.add_edge({"id": 900, "source": 500, "target": 7, "length": 4.0})
        ctx.agent.get_agent("red_0").current_node_id = 500


def stretch(ctx):
    """Change the length of an edge."""
    if is_due(ctx):
        ctx.graph.graph.update_edge({"id": 1, "length": 7.0 + ctx.seed})


def build_wall(ctx):
    """Add a building that hides agents."""
    if is_due(ctx):
        ctx.graph.add_obstacles([[(5, 0, 9), (5, 40, 9), (5, 0, 0), (5, 40, 0)]])


def ask_erring_sensors(ctx):
    """Score what a sensor shows that errs."""
    if is_due(ctx):
        ctx.game.scores["seen"] += len(ctx.game.observation("red_0")["sensor"]["near"][1])


def draw(ctx):
    """Draw as an agent does."""
    if is_due(ctx):
        ctx.game.scores["luck"] += ctx.game.observation("red_0")["draw"].below(100)
        ctx.game.scores["luck"] += int(ctx.game.observation("blue_0")["rng"].integers(100))


ACTS = [add_bridge, add_island, found_colony, stretch, build_wall, ask_erring_sensors, draw]


def built(act, settings=None, phase="after", strategies=None, **options):
    """Return a context with a game in which a rule acts, between rules of the core and functions."""
    options = {"max_turns": 7, "sensors": ERRING, **options}
    world = scene([TAG, FLAGS], settings=settings or {}, **options)
    world = world.replace(**{"teams.red.sensors": ["near", "next"], "teams.blue.sensors": ["near"]})
    ctx = world.build(seed=1, strategies=strategies or {"red": wander})
    if settings and "speed_unit" in settings:
        for agent in ctx.agent.create_iter():
            agent.speed = 25.0
    ctx.game.on_illegal = "stay"
    ctx.game.add(act, phase=phase)
    ctx.game.add(lambda ctx: ctx.game.scores.update(nodes=len([*ctx.graph.graph.get_nodes()])), name="count")
    return ctx


@pytest.mark.parametrize(("settings", "phase"), [(UNITS[0], "before"), *((unit, "after") for unit in UNITS)])
@pytest.mark.parametrize("act", ACTS)
def test_games_that_differ_by_what_functions_do_are_those_alone(act, settings, phase):
    with built(act, settings, phase) as ctx:
        check_games(ctx, seeds=[1, 2, 3])


def test_a_route_over_several_nodes_in_a_game_without_speeds_is_refused():
    def roam(state):
        here = state["curr_pos"]
        state["action"] = [here, (here * 7) % 25, (here * 3 + state["turn"]) % 25]

    with (
        built(draw, {"legal": "any"}, strategies={"red": roam}) as ctx,
        ctx.game.batch(2) as games,
        pytest.raises(
            BadValue, match=r"'red_0' chooses a route over several nodes, or back to its own.*go it in several turns"
        ),
    ):
        games.step()
