"""One seed, one game: a reset with another seed draws again what the scenario draws from the seed."""

from io import BytesIO

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gamms import recorder, scenario
from gamms.demo import FILE
from gamms.errors import BadValue, Duplicate
from gamms.scenario import Scenario, ScenarioError

WALK = "gamms.strategies:random_walk"
CODE = """
import numpy as np

def drawn_node(ctx, name):
    return int(ctx.stream("test", name).integers(36))

def bases(ctx):
    return {"red": drawn_node(ctx, "red base"), "blue": drawn_node(ctx, "blue base")}

def weather(ctx):
    return {"wind": [float(ctx.rng.random()), float(ctx.rng.random())], "map": np.arange(3) + ctx.rng.integers(9)}

def plan(ctx):
    turn = int(ctx.stream("test", "plan").integers(4))
    def decide(state):
        legal = state["legal"]
        state["action"] = legal[(state["turn"] + turn + state["facts"]["shift"]) % len(legal)]
    return decide

def noise(ctx):
    level = float(ctx.stream("test", "noise").random())
    return lambda node_id, agent: (agent.name, node_id * level)

def map_strategy(agent_config):
    def make(start):
        def decide(state):
            state["action"] = state["legal"][(start + state["turn"]) % len(state["legal"])]
        return decide
    return {name: make(config["start_node_id"] + config["meta"]["luck"]) for name, config in agent_config.items()}

def toll(ctx, price):
    ctx.game.scores["tolls"] += price
    ctx.game.data["paid"] = ctx.game.data.get("paid", 0) + price

class Floods:
    __name__ = "floods"

    def prepare(self, ctx):
        edges = sorted(ctx.graph.graph.get_edges())
        closed = int(ctx.stream("test", "flood").integers(len(edges)))
        ctx.graph.graph.remove_edge(edges[closed])
        ctx.game.publish(flooded=closed)
        ctx.game.emit("flood", edge=closed)
        ctx.game.scores["floods"] = closed

    def drawer(self, ctx, data):
        pass

    def __call__(self, ctx):
        ctx.game.scores["rain"] += ctx.game.facts["flooded"]

def floods():
    return Floods()
"""
GRID = {"map": {"grid": {"width": 6, "height": 6}}, "max_turns": 8, "seed": 1}


def drawn(name):
    return {"function": "drawing:drawn_node", "with": {"name": name}}


GAMES = {
    "random places": {
        "teams": {
            "red": {"count": 3, "strategy": WALK},
            "blue": {"count": 2, "apart": 20, "from": {"team": "red", "at_least": 10}, "strategy": WALK},
        }
    },
    "flags, territory and tags": {
        "sensors": {"eyes": {"type": "AGENT_RANGE", "sensor_range": 30}},
        "teams": {
            "red": {"count": 2, "near": 0, "within": 20, "sensors": ["eyes"], "strategy": WALK},
            "blue": {"count": 2, "near": 35, "within": 20, "sensors": ["eyes"], "strategy": "gamms.strategies:chase"},
        },
        "facts": {
            "ground": {"function": "gamms.rules.territory:by_distance", "with": {"bases": {"red": 0, "blue": 35}}}
        },
        "rules": [
            {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "hops": 1, "territory": "ground"}},
            {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 35}, "territory": "ground", "goal": None}},
        ],
        "conflicts": {"capacity": 1},
    },
    "what functions draw": {
        "sensors": {"noise": {"function": "drawing:noise"}, "near": {"type": "NEIGHBOR"}},
        "teams": {
            "red": {
                "count": 2,
                "sensors": ["noise", "near"],
                "strategy": "drawing:plan",
                "meta": {"luck": drawn("luck")},
            },
            "blue": {
                "agents": [{"name": "ann"}, {"name": "bob", "node": 7}],
                "strategy": "drawing",
                "meta": {"luck": drawn("fate")},
            },
            "air": {"count": 2, "type": "aerial", "speed": 3, "altitude": 9, "strategy": "drawing:plan_flight"},
        },
        "facts": {"weather": {"function": "drawing:weather"}, "shift": drawn("shift")},
        "data": {"prize": {"at": drawn("prize"), "weather": {"function": "drawing:weather"}}},
        "rules": [
            {"rule": "capture_flag", "with": {"flags": {"function": "drawing:bases"}, "goal": None}},
            {"rule": "drawing:toll", "with": {"price": drawn("price")}},
            "drawing:floods",
            {"rule": "reach", "with": {"team": "red", "nodes": drawn("goal")}},
        ],
    },
}
CODE += """
def plan_flight(ctx):
    way = tuple(ctx.stream("test", "flight").normal(size=3).tolist())
    def decide(state):
        state["action"] = way
    return decide
"""


@pytest.fixture(scope="module", params=GAMES)
def game(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("games")
    (folder / "drawing.py").write_text(CODE)
    return Scenario(folder=folder, **GRID, **GAMES[request.param])


def recorded(ctx):
    """A game's result, its recording, and what its agents were told last."""
    file = BytesIO()
    with ctx:
        ctx.record.start(file, sensed=True)
        result = ctx.game.run()
        ctx.record.stop()
        states = [agent.state for agent in ctx.agent.create_iter()]
        shown = [(state["sensor"], repr(state["facts"])) for state in states if state]
        return result, file.getvalue(), repr(shown), list(ctx.visual.artists.list_shown())


@settings(max_examples=4)
@example(seeds=[1], plays=False)
@example(seeds=[5, 1], plays=True)
@given(seeds=st.lists(st.integers(0, 2**40), min_size=1, max_size=3), plays=st.booleans())
def test_a_game_that_is_reset_to_a_seed_is_the_game_of_that_seed(game, seeds, plays):
    ctx = game.build()
    for seed in seeds:
        if plays:
            ctx.game.run(3)
        ctx.game.reset(seed)
    assert recorded(ctx) == recorded(game.build(seed=seeds[-1]))


def test_games_of_a_batch_are_those_of_their_seeds(game):
    with game.batch(3, seed=1) as games, game.batch(1, seed=1) as one:
        one.reset(seeds=[4])
        for seeds in (range(1, 4), [9, 5, 5]):
            games.reset(seeds=seeds)
            games.run()
            assert games.is_in_arrays
            for number, seed in enumerate(seeds):
                alone, together = game.play(seed=seed), games.result(number)
                alone.timings = together.timings
                assert alone == together
        one.run()
        assert one.result(0).events == game.play(seed=4).events


def test_games_whose_maps_have_other_nodes_for_each_seed_are_refused_by_a_batch(tmp_path):
    code = """
class Settlers:
    __name__ = "settlers"
    def prepare(self, ctx):
        ctx.graph.graph.add_node({"id": 100 + ctx.seed, "x": 1.0, "y": ctx.seed})
    def __call__(self, ctx):
        pass

def settlers():
    return Settlers()
"""
    (tmp_path / "settling.py").write_text(code)
    game = Scenario(folder=tmp_path, **GRID, **GAMES["random places"], rules=["settling:settlers"])
    with pytest.raises(BadValue, match="differ between the games with the seeds 1 and 2"):
        game.batch(2, seed=1)


def test_collectors_that_a_rule_has_added_are_added_again_for_another_seed(tmp_path):
    (tmp_path / "watching.py").write_text("""
def watch(every):
    def rule(ctx):
        pass

    rule.prepare = lambda ctx: ctx.game.collect("seed", lambda ctx: ctx.seed, every=every)
    return rule
""")
    spec = {
        "name": "watched",
        "map": {"grid": {"rows": 2, "columns": 2, "spacing": 1}},
        "teams": {"red": {"count": 1, "strategy": WALK}},
        "rules": [{"rule": "watching:watch", "with": {"every": 2}}],
        "max_turns": 4,
    }
    with Scenario(**spec, folder=str(tmp_path)).build(1) as ctx:
        for seed in (1, 2, 3):
            ctx.game.reset(seed)
            assert ctx.game.run().collected["seed"] == {"turn": [2, 4], "value": [seed, seed]}
        with pytest.raises(Duplicate):
            ctx.game.collect("seed", lambda ctx: ctx.seed)


def test_a_game_is_that_of_its_seed_also_after_a_snapshot_of_another_seed(game):
    ctx = game.build(seed=3)
    ctx.game.run(2)
    of_another = ctx.game.snapshot()
    ctx.game.reset(5)
    ctx.game.run(1)
    ctx.game.restore(of_another)
    ctx.game.reset(7)
    assert recorded(ctx) == recorded(game.build(seed=7))


def test_the_demo_is_drawn_again():
    game = scenario.load(FILE).replace(max_turns=4)
    with game.build() as ctx:
        ctx.game.run()
        ctx.game.reset(5)
        assert ctx.game.run() == game.play(seed=5)


def test_the_first_seed_plays_the_first_game_again(game):
    with game.build() as ctx:
        first = ctx.game.run()
        ctx.game.reset(5)
        second = ctx.game.run()
        ctx.game.reset()
        assert ctx.game.run() == second
        ctx.game.reset(ctx.game.internals.scenario["seed"])
        assert ctx.game.run() == first == game.play()


def changed_game_after_reset(game, change):
    """Return a game that was changed, and then reset with a seed: it is the one built with that seed and changed so."""

    def seen(ctx):
        with ctx:
            game, metas = ctx.game, [agent.meta for agent in ctx.agent.create_iter()]
            rules = [(one.name, one.phase) for one in game.rules]
            return rules, metas, game.run(), repr(game.data), repr(game.facts)

    first, second = game.build(), game.build(seed=5)
    change(first)
    first.game.run(2)
    first.game.reset(5)
    change(second)
    assert seen(first) == seen(second)
    return first


def test_changes_of_the_program_before_the_first_turn_stay(tmp_path):
    (tmp_path / "drawing.py").write_text(CODE)
    game = Scenario(folder=tmp_path, **GRID, **GAMES["what functions draw"])

    def mine(state):
        state["action"] = state["curr_pos"]

    def rule(ctx):
        pass

    def change(ctx):
        ctx.agent.get_agent("red_0").current_node_id = 20
        ctx.agent.get_agent("red_1").strategy = mine
        ctx.agent.get_agent("air_0").position = (1.0, 2.0, 3.0)
        ctx.agent.get_agent("ann").meta = {"luck": 3}
        ctx.agent.delete_agent("bob")
        ctx.sensor.get_sensor("red_0/noise").function = lambda: "silence"
        ctx.game.publish(shift=1, extra=2)
        ctx.game.data["paid"] = 7
        del ctx.game.data["prize"]
        ctx.game.scores["bonus"] = 4
        ctx.game.emit("hello")
        ctx.game.remove("reach")
        ctx.game.add(rule, name="mine")
        ctx.game.collect("turn", lambda ctx: ctx.game.turn)

    first = changed_game_after_reset(game, change)
    assert first.agent.get_agent("red_1").strategy is mine


def test_changes_of_the_program_stay_where_only_places_are_drawn():
    game = Scenario(
        **GRID, **GAMES["random places"], rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}]
    )

    def change(ctx):
        ctx.agent.get_agent("red_0").current_node_id = 20
        ctx.agent.get_agent("red_1").meta = {"luck": 3}
        ctx.game.publish(extra=2)
        ctx.game.data["paid"] = 7
        ctx.game.scores["bonus"] = 4
        ctx.game.emit("hello")
        ctx.game.remove("tag")
        ctx.game.add(lambda ctx: None, name="mine")

    changed_game_after_reset(game, change)


def test_strategies_are_prepared_for_every_seed():
    class Walker:
        def prepare(self, ctx):
            self.way = int(ctx.stream("way").integers(100))

        def __call__(self, state):
            state["action"] = state["legal"][(self.way + state["turn"]) % len(state["legal"])]

    teams = {"red": {"agents": [{"name": "ann", "node": 14}]}}
    game = Scenario(**GRID, teams=teams)
    with game.build(strategies={"red": Walker()}) as ctx:
        for seed in range(6):
            ctx.game.reset(seed)
            assert ctx.game.run() == game.play(seed=seed, strategies={"red": Walker()})


def test_a_seed_by_which_not_all_can_be_placed_leaves_the_game_as_it_was(tmp_path):
    teams = {
        "red": {"count": 1, "strategy": WALK},
        "blue": {"count": 1, "from": {"team": "red", "at_least": 45}, "strategy": WALK},
    }
    game = Scenario(**GRID, teams=teams)

    def fits(seed):
        try:
            game.build(seed).terminate()
        except ScenarioError:
            return False
        return True

    good, bad = (next(seed for seed in range(100) if fits(seed) is wanted) for wanted in (True, False))
    with game.build(good) as ctx:
        first = ctx.game.run()
        with pytest.raises(ScenarioError, match="only 0 of 1 agents could be placed"):
            ctx.game.reset(bad)
        assert ctx.seed == good
        assert ctx.game.run() == first


def test_a_game_that_goes_on_from_a_recording_begins_there_with_any_seed(game):
    data = recorded(game.build())[1]
    with recorder.open(BytesIO(data)) as recording, recording.resume(4, ctx=game.build()) as ctx:
        nodes, facts = [agent.current_node_id for agent in ctx.game.agents], repr(ctx.game.facts)
        ctx.game.reset(5)
        assert ([agent.current_node_id for agent in ctx.game.agents], repr(ctx.game.facts)) == (nodes, facts)
        ctx.game.run(2)
        ctx.game.reset(6)
        assert (ctx.game.turn, ctx.seed) == (4, 6)
        assert ([agent.current_node_id for agent in ctx.game.agents], repr(ctx.game.facts)) == (nodes, facts)


def test_places_are_drawn_again_for_every_seed():
    game = Scenario(**GRID, **GAMES["random places"])
    with game.build() as ctx:
        starts = set()
        for seed in range(20):
            ctx.game.reset(seed)
            starts.add(tuple(agent.current_node_id for agent in ctx.game.agents))
            assert ctx.game.start_node("red_0") == ctx.agent.get_agent("red_0").prev_node_id
    assert len(starts) == 20
