"""Wrong names in Python: the error names the thing, the value, what there is, and the way out."""

import importlib
import pickle

import pytest

import gamms
from gamms import rules, strategies
from gamms.rules import tag
from gamms.strategies import goto, random_walk, stay


@pytest.fixture
def town():
    """A grid with two red agents, which have a sensor, and one blue agent."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 6))
        eyes = {"eyes": gamms.sensor.agent_range(range_m=30)}
        ctx.agent.create_team("red", [0, 1], sensors=eyes, strategy=stay)
        ctx.agent.create_agent("anna", start_node_id=5, team="blue", strategy=random_walk)
        yield ctx


def decided_by(ctx, strategy):
    """Play a turn in which one agent has another strategy."""
    ctx.agent.get_agent("red_0").strategy = strategy
    ctx.game.step()


AGENTS = "Unknown agent 'bob'. There are: 'red_0', 'red_1', 'anna'."
NODES = "Unknown node 99. There are, among others: 0, 1, 2, 3, 4, 5, 6, 7."
WRONG = {
    "an agent": (lambda ctx: ctx.agent.get_agent("bob"), AGENTS),
    "an agent of the dict": (lambda ctx: ctx.agent.agents["bob"], AGENTS),
    "a team of a batch": (lambda ctx: ctx.game.batch(2, most_agents={"rde": 3}), "'rde'. Did you mean 'red'?"),
    "a team": (lambda ctx: ctx.agent.teams["rde"], "Unknown team 'rde'. Did you mean 'red'?"),
    "a keyword of batches": (
        lambda ctx: ctx.game.batch(num_game=2),
        "batch takes no keyword 'num_game'. Did you mean 'num_games'?",
    ),
    "a keyword of the class of contexts": (
        lambda _: gamms.Context(seed=1),
        "Context takes no keyword 'seed'. Call gamms.create_context(…), which makes a context and its engines.",
    ),
    "a keyword of pictures": (
        lambda ctx: ctx.visual.save("a.svg", widht=3),
        "A picture takes no keyword 'widht'. Did you mean 'width'?",
    ),
    "a keyword of environments": (
        lambda _: gamms.rl.parallel_env(None, teem="red"),
        "parallel_env takes no keyword 'teem'. Did you mean 'team'?",
    ),
    "a keyword of experiments": (
        lambda _: gamms.experiment.run(None, sed=3),
        "run takes no keyword 'sed'. Did you mean 'seeds'?",
    ),
    "a keyword of robots": (
        lambda _: gamms.bridge.drive("anna", print, spee=3),
        "drive takes no keyword 'spee'. There are: agent, feed, send, limit_s, arrive_m, checks, clock.",
    ),
    "a keyword of rendering": (
        lambda _: gamms.rendering.render("game.ggr", "a.svg", turn=3),
        "render takes no keyword 'turn'. There are: path, out, options, map, show.",
    ),
    "a keyword of map files": (
        lambda _: gamms.osm.graph_from_file("a.osm", resolutoin=3),
        "graph_from_file takes no keyword 'resolutoin'. Did you mean 'resolution'?",
    ),
    "a keyword of areas": (
        lambda _: gamms.osm.graph_from_point(60, 25, 9, osm_typ="walk"),
        "A graph of an area takes no keyword 'osm_typ'. Did you mean 'osm_type'?",
    ),
    "a range": (
        lambda ctx: ctx.agent.create_team("g", [3], sensors={"eyes": gamms.sensor.agent_range(range_m=-3)}),
        "range_m of gamms.sensor.agent_range() must not be negative, not -3.0.",
    ),
    "a file of a scenario": (
        lambda _: gamms.scenario.load("hnt.yaml"),
        "There is no file 'hnt.yaml' for a scenario. Did you mean 'hunt.yaml'?",
    ),
    "a file of a recording": (
        lambda _: gamms.rendering.render("gme.ggr", "a.svg"),
        "There is no file 'gme.ggr' for a recording. Did you mean 'game.ggr'?",
    ),
    "a file of a map": (
        lambda ctx: ctx.graph.load("hunt.gamms"),
        "There is no file 'hunt.gamms' for a map.",
    ),
    "a file of a page": (
        lambda _: gamms.web.map_page("hnt.yaml"),
        "There is no file 'hnt.yaml' for a map. Did you mean 'hunt.yaml'?",
    ),
    "a program": (
        lambda _: gamms.bridge.Process(["hnt.yaml"]),
        "There is no file 'hnt.yaml' for a program. Did you mean 'hunt.yaml'?",
    ),
    "a recording": (
        lambda _: gamms.web.page("game.ggr"),
        "page takes a recording, as gamms.recorder.open gives it, not 'game.ggr'.",
    ),
    "a column of a table": (
        lambda _: gamms.experiment.Table({"turns": [3]})["turnz"],
        "Unknown column 'turnz'. Did you mean 'turns'?",
    ),
    "a context of a filter": (
        lambda _: gamms.belief.Filter(3, gamms.belief.random_walk(), ["anna"]),
        "Filter takes a context, as gamms.create_context gives it, not 3.",
    ),
    "a context of a map": (lambda _: gamms.osm.helsinki(None), "helsinki takes a context, as gamms.create_context"),
    "a goal of a model of motion": (
        lambda ctx: gamms.belief.Filter(ctx, gamms.belief.to_goals([99]), ["anna"]),
        NODES,
    ),
    "a state of a belief": (lambda ctx: gamms.belief.observe(ctx, 3), "state must be a dict, not 3 (int)."),
    "an agent of an artist": (
        lambda _: gamms.belief.artist(3, "anna"),
        "The name of an agent must be a string, not 3 (int).",
    ),
    "a graph to check": (
        lambda _: gamms.testing.check_graph(3),
        "check_graph takes a function that makes an empty graph, not 3.",
    ),
    "a level of the log": (
        lambda _: gamms.create_context(logger_config={"level": "EROR"}),
        "level of logger_config must be 'CRITICAL' or",
    ),
    "a format of pictures": (
        lambda ctx: ctx.visual.save("a.mp4"),
        "cannot be saved as '.mp4': use .svg, .png, .pdf. For a film use ctx.visual.film(), or gamms.rendering.render",
    ),
    "a sensor": (
        lambda ctx: ctx.sensor.get_sensor("eys"),
        "Unknown sensor 'eys'. There are: 'red_0/eyes', 'red_1/eyes'.",
    ),
    "a sensor of an agent": (
        lambda ctx: ctx.agent.get_agent("red_0").sensors["eys"],
        "Unknown key 'eys'. Did you mean 'eyes'?",
    ),
    "a factory of sensors": (
        lambda _: gamms.sensor.agent_rnge,
        "gamms.sensor has no attribute 'agent_rnge'. Did you mean 'agent_range'?",
    ),
    "a strategy": (lambda _: strategies.chas, "gamms.strategies has no attribute 'chas'. Did you mean 'chase'?"),
    "a strategy unlike any": (
        lambda _: strategies.zigzag,
        "gamms.strategies has no attribute 'zigzag'. There are, among others: 'assign', 'chase', 'first',",
    ),
    "an argument of a strategy": (
        lambda ctx: goto(ctx, traget=3),
        "goto takes no keyword 'traget'. Did you mean 'target'?",
    ),
    "a node of a strategy": (lambda ctx: goto(ctx, 99), NODES),
    "a package": (lambda _: gamms.strategy, "gamms has no attribute 'strategy'. Did you mean 'strategies'?"),
    "a function of gamms": (
        lambda _: gamms.creat_context,
        "gamms has no attribute 'creat_context'. Did you mean 'create_context'?",
    ),
    "a rule": (lambda _: rules.reech, "gamms.rules has no attribute 'reech'. Did you mean 'reach'?"),
    "an argument of a rule": (
        lambda _: tag("red", "blue", the="respawn"),
        "tag takes no keyword 'the'. Did you mean 'then'?",
    ),
    "an attribute of the graph": (
        lambda ctx: ctx.graph.graph.nods,
        "ctx.graph.graph has no attribute 'nods'. Did you mean 'add_nodes' or 'get_nodes'?",
    ),
    "a keyword of contexts": (
        lambda _: gamms.create_context(sed=1),
        "create_context takes no keyword 'sed'. Did you mean 'seed'?",
    ),
    "a graph engine": (lambda _: gamms.create_context("MEMROY"), "Unknown graph engine 'MEMROY'. Use Engine.MEMORY"),
    "a backend": (
        lambda _: gamms.create_context(vis_engine="pygme"),
        "Unknown visual engine 'pygme'. Use gamms.visual.Engine.NO_VIS, PYGAME, OFFSCREEN or WEB.",
    ),
    "a setting that is set": (
        lambda ctx: setattr(ctx.game, "speed_units", "m"),
        "ctx.game has no 'speed_units'. Did you mean 'speed_unit'? What rules remember belongs into ctx.game.data.",
    ),
    "a note of a rule": (lambda ctx: setattr(ctx.game, "hideouts", {}), "The settings are: legal"),
    "a setting that is read": (
        lambda ctx: ctx.game.max_turn,
        "ctx.game has no attribute 'max_turn'. Did you mean 'max_turns'?",
    ),
    "a part of the context": (
        lambda ctx: ctx.agents,
        "ctx has no attribute 'agents'. There is ctx.game.agents and ctx.agent.agents.",
    ),
    "a verb of the graph": (
        lambda ctx: ctx.graph.shortst_path,
        "ctx.graph has no attribute 'shortst_path'. Did you mean 'shortest_path'?",
    ),
    "a verb of pictures": (lambda ctx: ctx.visual.sve, "ctx.visual has no attribute 'sve'. Did you mean 'save'?"),
    "a node": (lambda ctx: ctx.graph.graph.get_node(99), NODES),
    "a start": (lambda ctx: ctx.agent.create_agent("d", start_node_id=99), NODES),
    "the end of a path": (lambda ctx: ctx.graph.shortest_path(0, 99), NODES),
    "a map function": (lambda _: gamms.graph.gird, "gamms.graph has no attribute 'gird'. Did you mean 'grid'?"),
    "a keyword of a grid": (
        lambda _: gamms.graph.grid(3, colums=4),
        "grid takes no keyword 'colums'. Did you mean 'columns'?",
    ),
    "a keyword of places": (
        lambda ctx: ctx.graph.place(3, ner=(0, 0)),
        "place takes no keyword 'ner'. Did you mean 'near'?",
    ),
    "a keyword of runs": (
        lambda ctx: ctx.game.run(max_turn=3),
        "run takes no keyword 'max_turn'. Did you mean 'max_turns'?",
    ),
    "a channel": (
        lambda ctx: (ctx.game.add_channel("radio", range_m=3), ctx.game.remove_channel("radoi")),
        "Unknown channel 'radoi'. Did you mean 'radio'?",
    ),
    "a fact": (
        lambda ctx: (ctx.game.publish(exits=(3,)), ctx.game.facts["exit"]),
        "Unknown key 'exit'. Did you mean 'exits'?",
    ),
    "a phase": (
        lambda ctx: ctx.game.add(print, phase="befor"),
        "phase must be 'before' or 'deeds' or 'after', not 'befor'.",
    ),
    "a value of a result": (
        lambda ctx: ctx.game.result().winer,
        "result has no attribute 'winer'. Did you mean 'winner'?",
    ),
    "a verb of a scenario": (
        lambda _: gamms.scenario.from_gallery("pursuit").bild,
        "scenario has no attribute 'bild'. Did you mean 'build'?",
    ),
    "a picture": (
        lambda ctx: ctx.visual.save("x.jpgg"),
        "A picture cannot be saved as '.jpgg': use .svg, .png, .pdf. For a film use",
    ),
}


PACKAGES = [
    "belief", "bridge", "experiment", "graph", "llm", "osm", "planning", "recorder", "rendering", "rl", "rules",
    "scenario", "sensor", "solve", "strategies", "suite", "testing", "tournament", "web",
]  # fmt: skip


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_answers_an_unknown_name_with_those_that_it_has(package):
    module = getattr(gamms, package)
    known = max((name for name in module.__all__ if name.islower()), key=len, default=max(module.__all__, key=len))
    with pytest.raises(AttributeError) as caught:
        getattr(module, f"{known}_")
    assert str(caught.value) == f"gamms.{package} has no attribute '{known}_'. Did you mean {known!r}?"
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_recording_names_the_known_name_like_an_unknown_one(town, tmp_path):
    town.record.start(tmp_path / "game.ggr")
    town.record.stop()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording, pytest.raises(AttributeError) as caught:
        _ = recording.warnin
    assert str(caught.value) == "recording has no attribute 'warnin'. Did you mean 'warning'?"


@pytest.mark.parametrize("thing", WRONG)
def test_an_error_names_the_thing_and_what_there_is(town, thing, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, said = WRONG[thing]
    for name in ("hunt.yaml", "game.ggr"):
        (tmp_path / name).touch()
    with pytest.raises((LookupError, AttributeError, TypeError, ValueError, NotImplementedError, OSError)) as caught:
        call(town)
    assert said in str(caught.value)


def test_a_file_of_another_kind_is_not_suggested(tmp_path):
    (tmp_path / "hunt.mp4").touch()
    with pytest.raises(FileNotFoundError, match=r"^There is no file '.*hunts\.yaml' for a scenario\.$"):
        gamms.scenario.load(tmp_path / "hunts.yaml")


STATE = (
    "'curr_pos', 'sensor', 'name', 'team', 'turn', 'legal', 'draw', 'rng', 'memory', 'team_memory', 'facts', "
    "'blocked', 'fork'"
)


@pytest.mark.parametrize(
    ("strategy", "note"),
    [
        (lambda state: state["legl"], "In the strategy of agent 'red_0', in turn 0. Did you mean 'legal'?"),
        (
            lambda state: state["mail"],
            f"In the strategy of agent 'red_0', in turn 0. The state has: {STATE}.",
        ),
        (lambda state: state["facts"][3], "In the strategy of agent 'red_0', in turn 0."),
        (
            lambda state: state["draw"].chose(state["legal"]),
            "In the strategy of agent 'red_0', in turn 0. Did you mean 'choice'?",
        ),
        (lambda state: state.legals, "In the strategy of agent 'red_0', in turn 0. Did you mean 'legal'?"),
        (lambda state: state["sensor"]["eys"], "In the strategy of agent 'red_0', in turn 0. Its sensors are: 'eyes'."),
    ],
)
def test_a_strategy_that_reads_a_misspelt_name_is_told_the_right_one(town, strategy, note):
    with pytest.raises((KeyError, AttributeError)) as caught:
        decided_by(town, strategy)
    assert caught.value.__notes__ == [note]


def test_a_look_for_an_agent_that_is_not_there_is_warned_about(town):
    said = []
    town.logger.warning, before = said.append, town.logger.warning
    try:
        town.visual.set_agent_visual("bob", color="red")
        town.visual.set_agent_visual("anna", color="red")
    finally:
        town.logger.warning = before
    assert said == [f"set_agent_visual: {AGENTS} It is shown once it exists."]


@pytest.mark.parametrize(
    ("attribute", "way_out"), [("sped", "Did you mean 'speed'?"), ("x9", "There are, among others: 'alive'")]
)
def test_a_wrong_attribute_of_an_agent_is_answered_in_rules_and_strategies(town, attribute, way_out):
    def read(_):
        getattr(town.agent.get_agent("anna"), attribute)

    with pytest.raises(AttributeError) as caught:
        decided_by(town, read)
    assert way_out in caught.value.__notes__[0]
    town.agent.get_agent("red_0").strategy = stay
    town.game.add(read)
    with pytest.raises(AttributeError) as caught:
        town.game.step()
    assert way_out in caught.value.__notes__[0]


def test_at_most_173_names_are_listed_on_the_context_and_its_parts(town):
    parts = [town, town.agent, town.sensor, town.game, town.graph, town.visual, town.record]
    assert sum(not name.startswith("_") for part in parts for name in dir(part)) <= 173


def test_a_setting_is_suggested_although_it_is_not_listed(town):
    with pytest.raises(AttributeError, match="Did you mean 'speed_unit'"):
        _ = town.game.speed_unt
    assert "speed_unit" not in dir(town.game)


def test_dir_lists_public_names_alone_and_old_paths_can_still_be_imported(town):
    town.visual.picture(".svg")  # which imports modules that only GAMMS uses
    hidden = {name for name in dir(gamms) if not name.startswith("__")} - {*gamms._HOMES, *gamms._MODULES}
    assert hidden == set()
    for package in (gamms.agent, gamms.game, gamms.graph, gamms.memory, gamms.typing, gamms.visual, rules, strategies):
        assert {name for name in dir(package) if not name.startswith("__")} == set(package.__all__)
    assert importlib.import_module("gamms.game.settings").Settings
    assert importlib.import_module("gamms.AgentEngine.agent_engine").AgentEngine is gamms.agent.AgentEngine
    assert gamms.plain.to_plain


def test_a_name_that_stands_elsewhere_is_found_there(town):
    for owner, name, place in (
        (town, "create_agent", "ctx.agent.create_agent"),
        (town, "add_node", "ctx.graph.add_node"),
        (gamms, "tag", "gamms.rules.tag"),
        (gamms, "random_walk", "gamms.strategies.random_walk"),
    ):
        with pytest.raises(AttributeError) as caught:
            getattr(owner, name)
        assert str(caught.value).endswith(f" has no attribute {name!r}. There is {place}.")
