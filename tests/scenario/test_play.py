"""The same scenario and seed play the same game, wherever it comes from."""

import gc
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import networkx as nx
import pytest

import gamms
from gamms import scenario
from gamms.errors import Outdated
from gamms.game.plan import find_first_called
from gamms.graph import visibility
from gamms.scenario import Scenario, ScenarioError

CODE = """
import json, sys
from gamms import scenario
for file in sys.argv[1:]:
    data = scenario.load(file).play(seed=11).to_dict()
    del data["timings"]
    print(json.dumps(data, sort_keys=True))
"""
STRATEGIES = ["players:wander", "players:by_global_chance", "players"]


def told(result):
    data = result.to_dict()
    del data["timings"]
    return json.loads(json.dumps(data, sort_keys=True))


def test_processes_agree(folder, made):
    games = [made({"teams.red.strategy": strategy}) for strategy in STRATEGIES]
    files = [folder / f"{number}.json" for number in range(len(games))]
    for file, one in zip(files, games, strict=True):
        file.write_text(json.dumps(one.to_dict()))
    printed = subprocess.check_output(
        [sys.executable, "-W", "error", "-c", CODE, *map(str, files)],
        env={**os.environ, "PYTHONHASHSEED": "0" if os.environ.get("PYTHONHASHSEED") == "4" else "4"},
        text=True,
    )
    assert [json.loads(line) for line in printed.splitlines()] == [told(one.play(seed=11)) for one in games]


def test_the_seed_of_the_file_is_the_usual_one(made):
    one = made()
    assert one.play() == one.play(seed=3)
    assert one.play().seed == 3


def test_sensors_of_a_file_may_be_wrong_and_late(made):
    errors = {"position_noise_m": 2.5, "false_alarm_rate": 0.5, "delay_turns": 2}
    with made({f"sensors.eyes.{name}": value for name, value in errors.items()}).build() as ctx:
        notice = ctx.agent.get_agent("anna").sensors["eyes"].notice
        assert {name: getattr(notice, name) for name in errors} == errors


PLANS = {
    "states": "players:spread",
    "parameters": {"function": "players:spread", "with": {"step": 2}},
    "arrays": {"function": "players:walk", "arrays": True},
    "made": {"function": "players:planned", "with": {"node": 3}},
}


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_a_plan_of_the_file_decides_for_its_team(folder, made, plan):
    one = made({"teams.red.strategy": None, "teams.red.plan": plan})
    with one.build() as ctx:
        assert list(ctx.game.plans) == ["red"]
        result = ctx.game.run()
        ctx.game.reset(seed=8)
        again = ctx.game.run()
    assert not result.errors
    assert sum(agent["moves"] for name, agent in result.agents.items() if name.startswith("red")) > 0
    assert again == one.play(seed=8)
    assert Scenario(folder=folder, **one.to_dict()).play() == result


def test_a_plan_that_was_taken_away_stays_away(made):
    with made({"teams.red.strategy": None, "teams.red.plan": "players:spread"}).build() as ctx:
        ctx.game.command("red", None)
        ctx.game.reset(seed=8)
        assert not ctx.game.plans


def test_wrong_plans_are_named(made):
    for change, message in (
        ({"teams.red.plan": "players:spread"}, "teams.red.strategy: is never asked, because the team has a plan"),
        (
            {"teams.blue.plan": "players:spread", "teams.blue.strategy": None},
            "strategy: is never asked",
        ),
        ({"teams.red.plan": "players:spred", "teams.red.strategy": None}, "teams.red.plan: .*'spred'.*'spread'"),
        (
            {"teams.red.plan": {"function": "players:spread", "with": {"stop": 1}}, "teams.red.strategy": None},
            "teams.red.plan.with.stop: .*'step'",
        ),
    ):
        with pytest.raises(ScenarioError, match=message):
            made(change).play()


def test_a_strategy_of_the_caller_takes_the_place_of_a_plan_for_the_whole_team_alone(made):
    def stay(state):
        state["action"] = state["curr_pos"]

    one = made({"teams.red.strategy": None, "teams.red.plan": "players:spread"})
    assert one.play(strategies={"red": stay}).agents["red_0"]["moves"] == 0
    with pytest.raises(ScenarioError, match=r"teams.red.plan: decides for 'red_0' as well"):
        one.play(strategies={"red_0": stay})


def test_a_file_names_ranks_that_decide_conflicts_alone_and_in_a_batch(made, folder):
    (folder / "ranks.py").write_text("""
from gamms.rules import by_rank

@by_rank
def last_first(name, team):
    return -ord(name[-1])
""")
    one = made({"conflicts.resolve": "ranks:last_first"})
    with one.batch(seeds=[3, 4]) as games:
        assert "conflicts" not in (find_first_called(games.game, games.roster) or "")
        games.run()
        assert [games.result(number) == one.play(seed=seed) for number, seed in enumerate(games.seeds)] == [True, True]


@pytest.mark.parametrize(
    ("code", "hint"),
    [
        ("def f(config): return 3", "not a dict"),
        ("def f(config): return dict.fromkeys(config, 3)", "not a strategy"),
        ("def f(config): return config['nobody']", "KeyError"),
        ("f = 3", "is not a function, but 3"),
    ],
)
def test_a_map_strategy_that_gives_something_else_is_an_error(made, folder, code, hint):
    (folder / "mapping.py").write_text(code.replace("def f", "def map_strategy").replace("f = ", "map_strategy = "))
    with pytest.raises(ScenarioError, match=hint) as raised:
        made({"teams.red.strategy": "mapping"}).build()
    assert raised.value.path == "teams.red.strategy"


STREETS = """<osm version="0.6">
<node id="1" lat="60.170" lon="24.940"/><node id="2" lat="60.171" lon="24.940"/><node id="3" lat="60.171" lon="24.943"/>
<way id="7"><nd ref="1"/><nd ref="2"/><tag k="highway" v="service"/><tag k="name" v="Yard"/></way>
<way id="8"><nd ref="2"/><nd ref="3"/><tag k="highway" v="footway"/></way>
</osm>"""


def speeds_on(folder, **given):
    town = {"path": "town.osm", "resolution": 1000.0, **given}
    with scenario.Scenario(map={"file": town}, teams={"red": {"count": 1}}, folder=folder).build() as ctx:
        return {ctx.graph.edge_attributes(edge)["speed_kph"] for edge in ctx.graph.graph.get_edges()}


def test_a_map_is_for_any_mode_of_travel_of_gamms_or_of_a_file_in_the_folder(folder):
    (folder / "town.osm").write_text(STREETS)
    assert speeds_on(folder, osm_type="walk") == {5.0}
    assert speeds_on(folder, osm_type=["drive_service", "walk"]) == {20.0, 5.0}
    assert speeds_on(folder, osm_type="drive_service") == {20.0}
    (folder / "mine.toml").write_text('[runner]\nextends = "walk"\nhighways = { service = 11, footway = 12 }\n')
    assert speeds_on(folder, osm_type="runner", modes="mine.toml") == {11.0, 12.0}
    assert speeds_on(folder, osm_type="robot", modes="mine.toml") == {6.0}


def test_the_map_of_helsinki_has_several_modes():
    game = scenario.Scenario(map={"helsinki": {"osm_type": ["walk", "drive"]}}, teams={"red": {"count": 1}})
    with game.build() as ctx:
        assert {"walk", "drive"} <= ctx.graph.edge_attributes(0).keys()


@pytest.mark.parametrize(
    ("given", "path", "words"),
    [
        ({"osm_type": "runer", "modes": "mine.toml"}, "map.file.osm_type", "Did you mean 'runner'"),
        ({"modes": "mine.toml"}, "map.file.modes", "name one of its modes as osm_type"),
        ({"osm_type": "runner", "modes": "none.toml"}, "map.file.modes", "none.toml"),
        ({"osm_type": "runner", "modes": "../mine.toml"}, "map.file.modes", "leads out of the folder"),
        ({"osm_type": "runner", "modes": "bad.toml"}, "map.file.modes", "not a TOML file"),
    ],
)
def test_a_mode_of_travel_that_is_none_is_refused_by_its_place(made, folder, given, path, words):
    (folder / "town.osm").write_text(STREETS)
    (folder / "mine.toml").write_text('[runner]\nextends = "walk"\n')
    (folder / "bad.toml").write_text("[runner")
    with pytest.raises(ScenarioError, match=words) as raised:
        made(map={"file": {"path": "town.osm", **given}}).check()
    assert raised.value.path == path


def test_a_saved_map_is_a_map(made, folder):
    with made().build() as ctx:
        ctx.graph.save(folder / "town.gamms")
    assert made(map={"file": "town.gamms"}).play() == made().play()
    with pytest.raises(ScenarioError, match=r"^map\.file\.resolution: town\.gamms is not an OpenStreetMap file"):
        made(map={"file": {"path": "town.gamms", "resolution": 5.0}}).build()


def test_the_map_is_loaded_once_and_no_game_changes_it(made, folder):
    (folder / "worlds.py").write_text("""
import networkx as nx
calls = []

def make():
    assert not calls, "loaded twice"
    calls.append(1)
    G = nx.path_graph(60)
    for i in G:
        G.nodes[i].update(x=float(i), y=0.0, names=["a"])
    return G
""")
    one = made(map={"generator": "worlds:make"}).replace(**{"teams.red.within": 10.0, "teams.blue.agents.bert.node": 5})
    first = one.play()
    with one.build() as ctx:
        ctx.graph.graph.remove_node(40)
        ctx.graph.graph.node_attributes(1)["names"].append("b")
    assert one.play() == first
    assert one.replace(max_turns=3).play().turns == 3
    with one.build() as ctx:
        assert ctx.graph.graph.has_node(40)


@pytest.fixture
def looking(made):
    """Makes the scenario with a team that looks at streets, too."""
    sensors = {
        "near": {"type": "NEIGHBOR"},
        "eyes": {"type": "AGENT_RANGE", "sensor_range": 30},
        "streets": {"type": "RANGE", "sensor_range": 25},
    }
    return lambda: made(sensors=sensors).replace(**{"teams.red.sensors": ["near", "streets"]})


def test_a_game_that_changes_the_map_leaves_those_alone_that_share_it(looking):
    one = looking()
    first = told(one.play())
    with one.build() as other, one.build() as changed:
        other.game.run(max_turns=4)
        before = other.graph.graph.neighborhoods[1], list(other.graph.graph.get_edges()), other.graph.columns()
        changed.graph.close_roads(list(range(8)))
        changed.graph.graph.add_node({"id": 99, "x": 1.0, "y": 2.0})
        changed.graph.add_obstacle_face(**WALL)
        changed.game.run(max_turns=4)
        assert changed.graph.graph.neighborhoods[0] != other.graph.graph.neighborhoods[0]
        after = other.graph.graph.neighborhoods[1], list(other.graph.graph.get_edges()), other.graph.columns()
        assert after == before
        assert list(other.graph.get_obstacle_faces()) == []
        other.game.run()
        assert told(other.game.result()) == first
        changed.game.reset()
        assert list(changed.graph.graph.get_edges()) != after[1]  # what was changed before the first turn stays
    assert told(one.play()) == first


def test_games_in_threads_share_a_map_and_are_those_played_alone(looking):
    one, seeds = looking(), range(3)
    alone = [told(looking().play(seed=seed)) for seed in seeds]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(len(seeds)) as pool:
            together = list(pool.map(lambda seed: told(one.play(seed=seed)), seeds))
    finally:
        sys.setswitchinterval(interval)
    assert together == alone


WALL = {"face_id": 0, "tr": (15, 12, 9), "tl": (15, -2, 9), "br": (15, 12, 0), "bl": (15, -2, 0), "type": 0}


@pytest.fixture
def tables_made(monkeypatch):
    """How many visibility tables were worked out."""
    made, work_out = [], visibility.compute_visibility
    monkeypatch.setattr(visibility, "compute_visibility", lambda *given: made.append(given) or work_out(*given))
    return made


def test_no_game_gets_the_visibility_table_of_another_map(made, tables_made):
    one = made()
    free = table_of(one)
    walled = table_of(one, lambda ctx: ctx.graph.add_obstacle_face(**WALL))
    without = table_of(one, lambda ctx: ctx.graph.graph.remove_node(1))
    assert len(tables_made) == 3
    assert table_of(one) == free
    assert table_of(one, lambda ctx: ctx.graph.add_obstacle_face(**WALL)) == walled
    assert len(tables_made) == 3
    assert 2 in free[0]
    assert 2 not in walled[0]
    assert 1 not in without[0]


def test_a_shared_visibility_table_follows_the_changes_of_its_own_game(made):
    one = made()
    table_of(one)
    with one.build() as ctx:
        before = ctx.graph.visibility(radius=30.0, path=False)
        ctx.graph.add_obstacle_face(**WALL)
        with pytest.raises(Outdated):
            before.from_node(0)
        assert 2 not in ctx.graph.visibility(radius=30.0, path=False).from_node(0)
        with pytest.raises(ValueError, match="read-only"):
            before.seen.rows[0] = 1
    assert 2 in table_of(one)[0]


def table_of(one, change=lambda ctx: None):
    with one.build() as ctx:
        change(ctx)
        table = ctx.graph.visibility(radius=30.0, path=False)
        return {node: table.from_node(node).tolist() for node in ctx.graph.graph.get_nodes()}


def test_many_games_leave_nothing_behind(made, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))  # others put their files elsewhere
    one = made(max_turns=2)
    one.play()
    gc.collect()
    files, modules, objects = set(tmp_path.iterdir()), set(sys.modules), len(gc.get_objects())
    for seed in range(60):
        one.play(seed=seed)
    gc.collect()
    assert set(sys.modules) == modules
    assert len(gc.get_objects()) < objects + 800
    assert set(tmp_path.iterdir()) == files


def test_a_context_is_terminated_when_building_fails(made, monkeypatch):
    opened = []
    create = gamms.scenario.scenario.create_context
    monkeypatch.setattr(
        gamms.scenario.scenario, "create_context", lambda *a, **k: opened.append(create(*a, **k)) or opened[-1]
    )
    with pytest.raises(ScenarioError):
        made({"rules.1": "referee:explode"}).build()
    assert [ctx.is_terminated() for ctx in opened] == [True]


def test_a_generator_that_gives_no_graph_is_an_error():
    given = {"map": {"generator": "networkx:number_of_nodes"}, "teams": {"red": {"count": 1}}}
    assert nx.number_of_nodes(nx.path_graph(3)) == 3
    with pytest.raises(ScenarioError, match=r"^map\.generator\.with\.G: is missing"):
        Scenario(allow=["networkx"], **given).build()
    given["map"] = {"generator": {"function": "networkx:density", "with": {"G": 3}}}
    with pytest.raises(ScenarioError, match=r"^map\.generator: density raised AttributeError"):
        Scenario(allow=["networkx"], **given).build()


def test_a_rule_has_the_name_that_the_file_gives_it(made):
    game = made({"rules.0.name": "catch", "rules.1.phase": "before"})
    with game.build() as ctx:
        assert [(rule.name, rule.phase) for rule in ctx.game.rules] == [("catch", "after"), ("count_turns", "before")]
        ctx.game.remove("catch")
        assert not [event for event in ctx.game.run().events if event["kind"] == "tag"]
    assert game.replace(**{"rules.catch.with.score": 9}).spec.rules[0].with_["score"] == 9
    with pytest.raises(ScenarioError, match=r"item 2 of rules \(catch\).*There is already a rule named 'catch'"):
        made({"rules.0.name": "catch", "rules.1.name": "catch"}).build()
