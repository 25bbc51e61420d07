"""The law of batches where agents come and go: each game is the one that is played alone, to the byte."""

import re
from pathlib import Path

import pytest
from batch_scenes import check_games, plain
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import GammsError
from gamms.rules import Conflicts, contacts, none_left, reach, time_limit
from gamms.scenario import Scenario
from gamms.strategies import random_walk, stay

FOLDER = Path(__file__).parent
LAW = settings(
    max_examples=5,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
IN_GAME = re.compile(r"In game (\d+) of a batch")
NAMES = ("a", "b", "bb", "m", "r0", "zz")  # before, between and after those of the start

WAYS = {
    "edges": st.fixed_dictionaries({"speed": st.sampled_from([None, None, 1.0, 2.0, 1.5])}),
    "metres": st.fixed_dictionaries({"speed": st.sampled_from([3.0, 7.0, 14.0]), "decide": st.just("turn")}),
    "arrivals": st.fixed_dictionaries({"speed": st.sampled_from([7.0, 14.0, 25.0]), "decide": st.just("arrival")}),
}
KINDS = st.lists(st.sampled_from(["walk", "stay", "goto", "greedy", "chase"]), min_size=1, max_size=3, unique=True)
TEAMS = st.sampled_from([["red"], ["blue"], ["red", "blue"]])
ORDERS = [{}, {}, {"order": [["red"], ["blue"]]}, {"order": [["blue"], ["red"]]}]
grids = st.builds(
    lambda rows, columns: {"grid": {"rows": rows, "columns": columns, "spacing": 10.0}},
    st.integers(2, 4),
    st.integers(2, 5),
)


@st.composite
def rules(draw, way, speed):
    """Rules of agents that come and go, and shipped rules, in any order and phase."""
    near = [{}, {"hops": 1}] + ([{"metres": 6.0}, {"euclid": 6.0}] if way != "edges" else [])
    born = {
        "rule": "lives:born",
        "with": {
            "names": draw(st.lists(st.sampled_from(NAMES), min_size=1, max_size=4)),
            "every": draw(st.integers(1, 4)),
            "kinds": draw(KINDS),
            "teams": draw(TEAMS),
            "speed": draw(st.sampled_from([None, speed])),
            "alike": draw(st.sampled_from([1, 2, 3, 5])),
        },
    }
    die = {
        "rule": "lives:die",
        "with": {"share": draw(st.sampled_from([0.1, 0.3])), "delete": draw(st.sampled_from([0.0, 0.5]))},
    }
    tag = {
        "taggers": "blue",
        "tagged": "red",
        "then": draw(st.sampled_from(["respawn", "eliminate"])),
        **draw(st.sampled_from(near)),
    }
    shipped = [
        {"rule": "tag", "with": tag},
        {"rule": "reach", "with": {"team": "red", "nodes": [0], "winner": "red"}},
        {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 3}, "goal": 4}},
        {"rule": "arrive", "with": {"team": "red", "nodes": [1]}},
        {"rule": "respawn", "with": {"after": 2}},
        {"rule": "none_left", "with": {"team": "red", "winner": "blue"}},
        {"rule": "lives:dig"},
        {"rule": "lives:replace", "with": {"share": 0.2, "back": 0.5}},
        {"rule": "lives:tell", "with": draw(st.sampled_from(near))},
        die,
    ]
    some = draw(st.lists(st.sampled_from(range(len(shipped))), min_size=1, max_size=5, unique=True))
    chosen = draw(st.permutations([born, *(shipped[i] for i in some)]))
    phases = st.sampled_from(["before", "deeds", "after", "after"])
    return [{**one, "phase": draw(phases)} if one["rule"].startswith("lives:") else one for one in chosen]


@st.composite
def scenarios(draw, way):
    """A scenario in which agents come and go, and its maps; None: one map."""
    how = draw(WAYS[way])
    maps = draw(st.lists(grids, min_size=1, max_size=3))
    speed = how.pop("speed")
    teams = {}
    for team in ("red", "blue"):
        agents = []
        for number in range(draw(st.integers(1, 2))):
            strategy = draw(st.sampled_from(["gamms.strategies:random_walk", "gamms.strategies:stay", "lives:greedy"]))
            agent = {"name": f"{team[0]}{number}", "node": draw(st.integers(0, 3)), "strategy": strategy}
            agents.append(agent if speed is None else {**agent, "speed": speed})
        teams[team] = {"agents": agents}
    moving = {} if way == "edges" else {"speed_unit": "metres", **how}
    capacity = draw(st.sampled_from([None, {"capacity": 1}, {"capacity": None, "edge_capacity": 1}]))
    more = {} if capacity is None else {"conflicts": capacity}
    scenario = Scenario(
        map=maps[0],
        teams=teams,
        rules=draw(rules(way, speed)),
        sensors={"all": {"type": "AGENT"}},
        settings={**moving, **draw(st.sampled_from(ORDERS))},
        max_turns=draw(st.sampled_from([4, 8, 12])),
        folder=FOLDER,
        **more,
    )
    return scenario, maps if len(maps) > 1 else None


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("is_stepped", [False, True])
@LAW
@given(data=st.data(), seeds=st.lists(st.integers(0, 2**40), min_size=1, max_size=6, unique=True))
def test_games_in_which_agents_come_and_go_are_those_that_are_played_alone(way, is_stepped, data, seeds):
    scenario, maps = data.draw(scenarios(way))
    with scenario.batch(seeds=seeds, maps=maps) as games:
        error = None
        try:
            while is_stepped and games.step().any():
                pass
            games.run()
        except GammsError as raised:
            error = raised
        if error is not None:
            number = int(IN_GAME.search(" ".join(error.__notes__))[1])
            with pytest.raises(type(error), match=re.escape(str(error))):
                alone(scenario, maps, games, number)
            return
        for number in range(len(seeds)):
            assert repr(plain(games.result(number))) == repr(plain(alone(scenario, maps, games, number)))


def alone(scenario, maps, games, number):
    """Play a game of a batch alone."""
    one = scenario if maps is None else scenario.replace(map=maps[games.maps[number]])
    return one.play(seed=games.seeds[number])


def grid_game(rows, columns, **settings):
    """Return a context with a grid, without agents."""
    ctx = gamms.create_context(seed=1, game=settings)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(rows, columns))
    return ctx


def test_an_agent_that_came_draws_by_the_seed_of_its_own_game():
    def births(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("walker", start_node_id=24, team="red", strategy=random_walk)
        if ctx.game.turn == 3:
            ctx.agent.create_agent("yx"[ctx.seed % 2], start_node_id=0, team="red", strategy=stay)
        if ctx.game.turn == 4 and ctx.seed == 7:
            ctx.game.eliminate("x")

    with grid_game(7, 7, max_turns=13) as ctx:
        ctx.agent.create_agent("base", start_node_id=0, team="red", strategy=stay)
        ctx.game.add(births)
        for seeds in ([7], [5, 6, 7], [9, 6, 7], [11, 8, 7]):
            check_games(ctx, seeds=seeds)


def test_an_agent_that_is_created_after_the_moves_is_where_it_was_created():
    def reinforce(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("late", start_node_id=8, team="red", strategy=stay)

    with grid_game(3, 3, max_turns=3) as ctx:
        ctx.agent.create_agent("early", start_node_id=5, team="red", speed=2, strategy=stay)
        ctx.game.add(reinforce)
        ctx.game.add(reach("red", 0))
        [result] = check_games(ctx, 1)
        assert result.events == []


def test_an_agent_that_stands_still_in_the_turn_of_a_birth_was_there_all_the_time():
    def birth(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("new", start_node_id=6, team="blue", strategy=stay)

    def meet(ctx):
        ctx.game.emit("met", found=[(one.b, one.time) for one in contacts(ctx, "red", "blue", euclid=12.0)])

    with grid_game(4, 5, speed_unit="metres", max_turns=1) as ctx:
        ctx.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
        ctx.agent.create_agent("blue", start_node_id=0, team="blue", speed=5.0, strategy=random_walk)
        ctx.game.add(birth)
        ctx.game.add(meet)
        results = check_games(ctx, seeds=[5, 6])
        assert results[0].events[0]["found"] == [("blue", 0.0)]


def test_an_agent_hears_once_why_it_was_stopped_on_arrival():
    def circle(state):
        """Go around, and stop after having been told of several reasons."""
        at = (0, 1, 3, 2).index(state["curr_pos"])
        state["action"] = (0, 1, 3, 2)[(at + (1 if state["name"] < "c" else -1)) % 4]
        if state["blocked"] and ";" in state["blocked"]:
            state["action"] = None

    with grid_game(2, 2, speed_unit="metres", decide="arrival", max_turns=3) as ctx:
        ctx.game.conflicts = Conflicts(capacity=None, edge_capacity=1)
        for name, node, speed in (("a", 0, 17.0), ("b", 0, 17.0), ("c", 3, 11.0), ("d", 3, 11.0)):
            ctx.agent.create_agent(name, start_node_id=node, team="red", speed=speed, strategy=circle)
        [result] = check_games(ctx, seeds=[1])
        assert sum(agent["blocked"] for agent in result.agents.values()) > 0


@pytest.mark.parametrize("ends_with", ["the last agent deleted", "no agent ever"])
def test_none_left_ends_the_game_of_a_team_that_had_agents(ends_with):
    def leave_or_come(ctx):
        if ends_with == "the last agent deleted":
            ctx.agent.delete_agent("red")
        elif ctx.seed == 6:  # in another game of the batch
            ctx.agent.create_agent("late", start_node_id=2, team="green", strategy=stay)

    with grid_game(3, 3, max_turns=3) as ctx:
        ctx.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
        ctx.agent.create_agent("blue", start_node_id=1, team="blue", strategy=stay)
        ctx.game.add(lambda ctx: leave_or_come(ctx) if ctx.game.turn == 1 else None)
        ctx.game.add(none_left("red" if ends_with == "the last agent deleted" else "green"))
        results = check_games(ctx, seeds=[5, 6])
        assert [result.turns for result in results] == ([1, 1] if ends_with == "the last agent deleted" else [3, 3])


def test_a_team_that_is_not_in_a_game_does_not_lead_it():
    def come(ctx):
        ctx.game.scores["red"] = -2
        ctx.game.scores["blue"] = -1
        if ctx.seed == 6 and ctx.game.turn == 1:
            ctx.agent.create_agent("late", start_node_id=2, team="green", strategy=stay)

    with grid_game(3, 3) as ctx:
        ctx.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
        ctx.agent.create_agent("blue", start_node_id=1, team="blue", strategy=stay)
        ctx.game.add(come)
        ctx.game.add(time_limit(2))
        results = check_games(ctx, seeds=[5, 6])
        assert [result.winner for result in results] == ["blue", "green"]


def test_an_agent_does_not_make_the_move_of_a_deleted_agent_of_its_name():
    def replace(ctx):
        if ctx.game.turn > 0:
            ctx.agent.delete_agent("red")
            ctx.agent.create_agent("red", start_node_id=4, team="red", strategy=random_walk)

    with grid_game(3, 3, max_turns=4) as ctx:
        ctx.agent.create_agent("red", start_node_id=4, team="red", strategy=random_walk)
        ctx.game.add(replace, phase="deeds")
        results = check_games(ctx, seeds=[5, 6])
        assert [result.agents["red"]["node"] for result in results] == [4, 4]


def test_an_agent_replaced_in_each_part_of_a_turn_was_never_there_at_its_begin():
    def replace(ctx):
        ctx.agent.delete_agent("blue")
        ctx.agent.create_agent("blue", start_node_id=0, team="blue", strategy=stay)

    def see(ctx):
        [track] = ctx.game.tracks([ctx.agent.get_agent("blue")])
        ctx.game.emit("seen", times=track.times)

    with grid_game(1, 2, max_turns=2, order=[["red"], ["blue"]]) as ctx:
        for team in ("red", "blue"):
            ctx.agent.create_agent(team, start_node_id=0, team=team, strategy=stay)
        ctx.game.add(replace, phase="deeds")
        ctx.game.add(see, phase="deeds")
        [result] = check_games(ctx, seeds=[6])
        assert [event["times"] for event in result.events] == [(1.0,)] * 4
