"""Agents with a mode use only the edges that their mode may use; everything that they do follows."""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief, rl, solve, strategies
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.graph import find_usable_edges
from gamms.rules import Conflicts, at_random, discover, tag
from gamms.scenario import Scenario, ScenarioError
from gamms.sensor import agent_range, neighbor

LAWS = settings(
    max_examples=12,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
NODES = 12
DECIDING = {
    "walk": lambda ctx: strategies.random_walk,
    "chase": lambda ctx: strategies.chase(ctx, otherwise=strategies.random_walk),
    "flee": lambda ctx: strategies.flee(ctx, otherwise=strategies.random_walk),
    "goto": lambda ctx: strategies.goto(ctx, 7, otherwise=strategies.random_walk),
    "patrol": lambda ctx: strategies.patrol(ctx, [0, 5, 11]),
    "waypoints": strategies.random_waypoints,
    "guard": lambda ctx: strategies.guard(ctx, 4, 30.0),
    "intercept": lambda ctx: strategies.intercept(ctx, [2, 9]),
    "confine": strategies.intercept,
    "exit": lambda ctx: strategies.safest_exit(ctx, [3, 8]),
    "sweep": strategies.sweep,
    "assign": strategies.assign,
    "believe": strategies.follow_belief,
}
UNITS = {
    "edges": [None, 1.5, 2],
    "metres": [None, 8.0, 25.0],
    "metres_per_second": [None, 8.0, 25.0, float("inf")],
    "at arrivals": [None, 8.0, 25.0],
    "one edge": [None],
}
VALUES = [True, False, 0, 30, 0.0, 12.5, None]


def reference(value):
    """Return whether an edge may be used, in the words of the documentation."""
    return value is True or (value is not None and value is not False and value > 0)


@st.composite
def maps(draw):
    """Nodes on a plane, and edges between them: (source, target, length, what their attribute says)."""
    node = st.integers(0, NODES - 1)
    edge = st.tuples(node, node, st.sampled_from([5.0, 10.0, 14.0]), st.sampled_from(VALUES))
    loop = [(i, (i + 1) % NODES, 10.0, draw(st.sampled_from(VALUES))) for i in range(NODES)]
    return [*loop, *draw(st.lists(edge, min_size=6, max_size=40)), (0, 1, 10.0, True), (1, 0, 10.0, 3)]


def open_map(edges, *, is_cut):
    """Return a context with a map, with the edges that may be used only if it is cut."""
    ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"})
    angles = np.linspace(0, 6, NODES)
    ctx.graph.add_nodes(range(NODES), 20 * np.cos(angles), 20 * np.sin(angles))
    for id, (source, target, length, value) in enumerate(edges):
        if not is_cut or reference(value):
            given = {"id": id, "source": source, "target": target, "length": length}
            own = 1.0 + id % 5 / 2  # seconds of cars; others need more or less time
            times = {"travel_time": own} if is_cut else {"travel_time": 0.5 + id % 3, "travel_time:car": own}
            ctx.graph.add_edge(given | times | ({} if value is None else {"car": value}))
    return ctx


def open_game(edges, agents, unit, *, is_cut, conflicts=None):
    """Return a context with a game, in which all agents have the mode, or the map has no other edges."""
    ctx = open_map(edges, is_cut=is_cut)
    ctx.game.speed_unit = {"at arrivals": "metres"}.get(unit, unit if unit.startswith("metres") else "edges")
    ctx.game.decide = "arrival" if unit == "at arrivals" else "turn"
    ctx.game.weight = "travel_time" if unit == "metres_per_second" else "length"
    ctx.game.conflicts = conflicts
    for number, (name, node, speed) in enumerate(agents):
        ctx.agent.create_agent(
            f"a{number}",
            start_node_id=node,
            team="rb"[number % 2],
            strategy=DECIDING[name](ctx),
            sensors={"eyes": agent_range(range_m=25), "near": neighbor()},
            mode=None if is_cut else "car",
            **({} if speed is None else {"speed": speed}),
        )
    ctx.game.add(tag("r", "b"))
    return ctx


def play(ctx, turns=8):
    """Return where agents were after each turn, what was legal, and what went wrong."""
    found = []
    with ctx:
        for _ in range(turns):
            ctx.game.step()
            for agent in ctx.agent.create_iter():
                state = agent.state
                known = state.get("legal"), state.get("sensor")
                found.append((agent.name, agent.alive, agent.current_node_id, agent.edge, agent.offset_m, known))
        errors = [(one["turn"], one["agent"]) for one in ctx.game.result().errors]
        return found, ctx.game.result().scores, errors


@pytest.mark.parametrize("unit", sorted(UNITS))
@LAWS
@given(data=st.data(), edges=maps())
def test_a_game_in_which_all_have_a_mode_is_the_game_on_the_map_of_the_mode(unit, data, edges):
    agent = st.tuples(st.sampled_from(sorted(DECIDING)), st.integers(0, NODES - 1), st.sampled_from(UNITS[unit]))
    agents = data.draw(st.lists(agent, min_size=2, max_size=5))
    conflicts = data.draw(st.sampled_from([None, Conflicts(1, resolve=at_random())]))
    games = [open_game(edges, agents, unit, is_cut=is_cut, conflicts=conflicts) for is_cut in (False, True)]
    assert play(games[0]) == play(games[1])


@LAWS
@given(edges=maps())
def test_the_graph_of_a_mode_has_the_edges_where_the_attribute_is_true_or_above_zero(edges):
    with open_map(edges, is_cut=False) as ctx, open_map(edges, is_cut=True) as cut:
        graph = ctx.graph.routes.select_mode("car")
        assert [*graph.get_edges()] == [*cut.graph.get_edges()]
        assert [graph.neighborhoods[node] for node in range(NODES)] == [
            cut.graph.graph.neighborhoods[node] for node in range(NODES)
        ]
        for node in range(NODES):
            assert graph.distance(0, node) == cut.graph.distance(0, node)
            assert graph.distance(0, node, "travel_time") == cut.graph.distance(0, node, "travel_time")
        assert find_usable_edges(ctx.graph.columns(), "car").sum() == len([*cut.graph.get_edges()])


def test_agents_of_several_modes_use_their_own_edges_at_any_time():
    rng = np.random.default_rng(5)
    with gamms.create_context(seed=2) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5, spacing=10.0))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "car": bool(rng.random() < 0.6), "foot": float(rng.random() < 0.8)})
        ctx.game.speed_unit = "metres"
        modes = ["car", "foot", None]
        for number, mode in enumerate(modes):
            ctx.agent.create_agent(
                f"a{number}", start_node_id=12, mode=mode, speed=17.0, strategy=strategies.random_walk
            )
        may_use = {mode: {*ctx.graph.routes.select_mode(mode).get_edges()} for mode in modes[:2]}
        may_use[None] = {*ctx.graph.get_edges()}
        used = set()
        for _ in range(60):
            ctx.game.step()
            for number, mode in enumerate(modes):
                edges = {leg.edge for leg in ctx.game.moves[f"a{number}"].legs}
                assert edges <= may_use[mode]
                used |= {(mode, edge) for edge in edges}
        assert len(used) > 30


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_an_action_along_edges_that_the_mode_may_not_use_is_illegal(unit):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes([0, 1], [0.0, 10.0], [0.0, 0.0])
        ctx.graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 10.0, "car": 0})
        ctx.graph.add_edge({"id": 1, "source": 1, "target": 0, "length": 10.0, "car": 50})
        ctx.game.speed_unit = unit
        agent = ctx.agent.create_agent(
            "a", start_node_id=0, mode="car", strategy=lambda state: state.update(action=1), speed=20.0
        )
        ctx.game.step()
        assert agent.state["legal"] == (0,)
        assert agent.current_node_id == 0
        assert [error["kind"] for error in ctx.game.result().errors] == ["illegal"]


def test_a_mode_that_is_no_attribute_is_refused_with_the_nearest_name():
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "drive": 30.0, "name": "Main Street"})
        with pytest.raises(UnknownName, match=r"Unknown mode 'driv'. Did you mean 'drive'?"):
            ctx.agent.create_agent("a", start_node_id=0, mode="driv")
        with pytest.raises(BadValue, match=r"'name' is no mode: of edge 0 it is 'Main Street'"):
            ctx.agent.create_agent("a", start_node_id=0, mode={"attribute": "name"})
        with pytest.raises(BadType, match="not 3"):
            ctx.agent.create_agent("a", start_node_id=0, mode=3)
        with pytest.raises(BadType, match=r"not {'attribute': None}"):
            ctx.agent.create_agent("a", start_node_id=0, mode={"attribute": None})
        with pytest.raises(BadValue, match="flies over all edges"):
            ctx.agent.create_agent("a", start_node_id=0, mode="drive", type="AERIAL", speed=1.0)
        assert not ctx.agent.agents
        agent = ctx.agent.create_agent("a", start_node_id=0, mode={"attribute": "drive"})
        with pytest.raises(AttributeError, match="fixed when the agent is created"):
            agent.mode = None
        assert agent.mode == "drive"


def test_a_game_whose_moves_need_no_edges_refuses_modes():
    with gamms.create_context(game={"legal": "any"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "drive": True})
        ctx.agent.create_agent("a", start_node_id=0, mode="drive", strategy=strategies.random_walk)
        with pytest.raises(BadValue, match=r"Agent 'a' has mode='drive'.*leave out mode="):
            ctx.game.step()


@pytest.mark.parametrize("unit", ["edges", "metres"])
@pytest.mark.parametrize("mode", ["drive", "ferry"])
def test_an_agent_stays_where_all_edges_of_its_mode_are_closed_until_they_open(unit, mode):
    with gamms.create_context(seed=1, game={"speed_unit": unit}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3, spacing=1.0))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "drive": True, **({"ferry": 15.0} if edge < 2 else {})})
        agent = ctx.agent.create_agent("a", start_node_id=0, speed=1, mode=mode, strategy=strategies.goto(ctx, 1))
        closed = ctx.graph.close_roads([*ctx.graph.get_edges()])
        ctx.game.run(2)
        assert (agent.state["legal"], agent.current_node_id) == ((0,), 0)
        with pytest.raises(UnknownName, match="Unknown mode 'length'"):
            ctx.graph.routes.select_mode("length")
        ctx.graph.open_roads(closed)
        ctx.game.run(4)
        assert agent.current_node_id == 1


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"speed": 2.0},
        {"speed_unit": "metres", "speed": 25.0},
        {"speed_unit": "metres", "weight": "toll", "speed": 25.0},
    ],
)
@pytest.mark.parametrize("mode", [None, "drive"])
def test_waypoints_are_nodes_that_the_agent_can_reach(settings, mode):
    rest = {"max_turns": 25, **settings}
    speed = {"speed": rest.pop("speed")} if "speed" in rest else {}
    with gamms.create_context(seed=4, game=rest) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, spacing=10.0))
        if mode is None and "weight" not in settings:  # the other nodes have no edges to the first ones
            for edge in [*ctx.graph.get_edges()]:
                if (ctx.graph.get_edge(edge).source < 8) != (ctx.graph.get_edge(edge).target < 8):
                    ctx.graph.remove_edge(edge)
        for edge in [*ctx.graph.get_edges()]:
            is_near = max(ctx.graph.get_edge(edge)[1:3]) < 8
            toll = 1.0 if is_near or mode is not None else np.inf
            ctx.graph.update_edge({"id": edge, "drive": is_near, "toll": toll})
        ctx.agent.create_agent("a", start_node_id=0, mode=mode, strategy=strategies.random_waypoints(ctx), **speed)
        drawn = set()
        nodes = []
        with ctx.game.batch(seeds=[4]) as games:
            for _ in range(25):
                games.step()
                nodes.append(games.columns()["node"].tolist())
        for turn in range(25):
            ctx.game.step()
            drawn.add(ctx.game.memories["a"]["random_waypoints"][0])
            assert nodes[turn] == [[ctx.agent.get_agent("a").current_node_id]]
        assert drawn <= {*range(8)}
        assert len(drawn) > 3


def test_an_agent_discovers_the_nodes_ahead_along_the_edges_of_its_mode():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4, spacing=10.0))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "drive": ctx.graph.get_edge(edge).target < 2, "walk": True})
        ctx.game.add(discover([0, 1, 2], hops=2))
        for team, mode in (("cars", "drive"), ("walkers", "walk")):
            ctx.agent.create_agent(f"a {mode}", start_node_id=0, team=team, mode=mode, strategy=strategies.stay)
        ctx.game.step()
        found = {(event["team"], event["node"]) for event in ctx.game.events if event["kind"] == "discover"}
        assert found == {("cars", 0), ("cars", 1), ("walkers", 0), ("walkers", 1), ("walkers", 2)}


def test_a_mode_stays_known_when_its_last_edge_is_removed(tmp_path):
    def demolish(ctx):
        if ctx.game.turn == 2:
            for edge in (0, 1):
                ctx.graph.remove_edge(edge)

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        for edge in (0, 1):
            ctx.graph.update_edge({"id": edge, "ferry": True})
        agent = ctx.agent.create_agent("a", start_node_id=0, mode="ferry", strategy=strategies.random_walk)
        ctx.game.add(demolish)
        ctx.record.start(tmp_path / "game.ggr")
        with ctx.game.batch(2) as games:
            games.run(4)
            assert [games.result(number).turns for number in range(2)] == [4, 4]
        ctx.game.run(4)
        ctx.record.stop()
        assert agent.state["legal"] == (agent.current_node_id,)
        assert [*ctx.graph.routes.select_mode("ferry").get_edges()] == []
        ctx.game.restore(ctx.game.snapshot())
        with ctx.game.fork(0).ctx as fork:
            fork.game.step()
            assert fork.agent.get_agent("a").current_node_id == agent.current_node_id
        with pytest.raises(UnknownName, match="Unknown mode 'fery'"):
            ctx.graph.routes.select_mode("fery")
    with (
        gamms.recorder.open(tmp_path / "game.ggr") as recording,
        recording.resume(3, {"a": strategies.random_walk}) as again,
    ):
        again.game.step()
        assert again.agent.get_agent("a").current_node_id == agent.current_node_id


def test_a_keyword_whose_text_names_an_edge_attribute_warns_once_that_it_changes_no_route(caplog):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.graph.update_edge({"id": 0, "car_cost": 2.0})
        for name in "abc":
            ctx.agent.create_agent(name, start_node_id=0, weight="car_cost", color="red")
        ctx.graph.update_edge({"id": 1, "highway": "residential"})
        ctx.agent.create_agent("d", start_node_id=0, kind="highway")
        assert ctx.agent.get_agent("a").weight == "car_cost"
    told = [record.message for record in caplog.records if "changes no route" in record.message]
    assert len(told) == 2
    assert "mode='car_cost'" in told[0]
    assert "mode=" not in told[1]
    assert "attributes of edges with numbers" in told[1]


def test_a_recording_and_a_fork_keep_the_modes_of_agents(tmp_path):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "drive": edge % 3})
        agent = ctx.agent.create_agent("a", start_node_id=0, mode="drive", strategy=strategies.random_walk)
        ctx.record.start(tmp_path / "game.ggr")
        for _ in range(5):
            ctx.game.step()
        ctx.record.stop()
        with ctx.game.fork(0).ctx as fork:
            assert fork.agent.get_agent("a").mode == "drive"
            fork.game.step()
            ctx.game.step()
            assert fork.agent.get_agent("a").current_node_id == agent.current_node_id
    with gamms.create_context(seed=1) as again:
        for _ in again.record.replay(tmp_path / "game.ggr"):
            assert again.agent.get_agent("a").mode == "drive"


FLEET = {
    "map": {"grid": {"rows": 4, "columns": 4, "spacing": 10.0}},
    "max_turns": 5,
    "teams": {
        "police": {
            "count": 3,
            "mode": "drive",
            "strategy": "gamms.strategies:random_walk",
            "agents": [{"name": "anna", "mode": {"attribute": "walk"}}],
        },
        "drones": {"count": 1, "type": "aerial", "speed": 5.0},
    },
}


def mark_edges(ctx):
    """Let cars use the edges around the first nodes only."""
    for edge in [*ctx.graph.get_edges()]:
        source, target = ctx.graph.get_edge(edge)[1:3]
        ctx.graph.update_edge({"id": edge, "walk": True, "drive": 30.0 if max(source, target) < 6 else 0.0})


def test_agents_of_a_scenario_start_where_their_mode_can_leave(tmp_path):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, spacing=10.0))
        mark_edges(ctx)
        ctx.graph.save(tmp_path / "town.gamms")
        assert {*ctx.graph.place(6, mode="drive")} == {0, 1, 2, 3, 4, 5}
        with pytest.raises(BadValue, match="Only 6 of 7"):
            ctx.graph.place(7, mode={"attribute": "drive"})
    fleet = Scenario(**{**FLEET, "map": {"file": "town.gamms"}}, folder=tmp_path)
    for seed in range(5):
        with fleet.build(seed=seed) as ctx:
            modes = {agent.name: getattr(agent, "mode", None) for agent in ctx.agent.create_iter()}
            assert modes["anna"] == "walk"
            assert modes["police_0"] == "drive"
            assert all(agent.current_node_id < 6 for agent in ctx.agent.create_iter() if agent.team == "police")
            ctx.game.run()
            assert all(ctx.agent.get_agent(f"police_{i}").current_node_id < 6 for i in range(3))


def test_a_scenario_refuses_the_mode_of_a_flying_team():
    with pytest.raises(ScenarioError, match=r"teams\.drones\.mode"):
        Scenario(**{**FLEET, "teams": {"drones": {**FLEET["teams"]["drones"], "mode": "walk"}}})


def test_an_error_about_the_mode_of_an_agent_names_the_agent():
    for of_team, of_agent, path in ((None, "driv", "teams.red.agents.0.mode"), ("driv", None, "teams.red.mode")):
        agents = [{"name": "truck", "mode": of_agent}]
        teams = {"red": {"agents": agents, "mode": of_team}}
        with pytest.raises(ScenarioError, match="Unknown mode 'driv'") as caught:
            Scenario(map={"grid": {"rows": 2, "columns": 2}}, max_turns=1, teams=teams).build(seed=1)
        assert caught.value.path == path


def chase_in(folder, name, **more):
    """Return a scenario on a map of the folder: a learner and its prey."""
    sees = {"sensors": {"eyes": {"type": "agent"}, "near": {"type": "neighbor"}}, **more}
    teams = {
        "cop": {"agents": [{"name": "cop", "node": 0}], **sees},
        "prey": {"agents": [{"name": "prey", "node": 8}], **sees},
    }
    rules = [{"rule": "tag", "with": {"taggers": "cop", "tagged": "prey", "score": 1, "then": "eliminate"}}]
    metres = {"settings": {"speed_unit": "metres"}} if more.get("speed") == 15.0 else {}
    return Scenario(folder=folder, map={"file": name}, max_turns=4, teams=teams, rules=rules, **metres)


@pytest.fixture
def maps_of_cars(tmp_path):
    """A folder with a map whose edges say where cars may go, and the map with these edges only."""
    for name in ("whole", "cars"):
        rng = np.random.default_rng(3)
        with gamms.create_context() as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=10.0))
            for edge in [*ctx.graph.get_edges()]:
                may_use = bool(rng.random() < 0.75)
                ctx.graph.update_edge({"id": edge, "car": may_use})
                if name == "cars" and not may_use:
                    ctx.graph.remove_edge(edge)
            ctx.graph.save(tmp_path / f"{name}.gamms")
    return tmp_path


@pytest.mark.parametrize("more", [{}, {"speed": 2.0}, {"speed": 15.0}])
def test_learners_with_a_mode_observe_and_do_what_those_on_the_map_of_the_mode_do(maps_of_cars, more):
    pytest.importorskip("gymnasium")
    played = []
    for name, mode in (("cars", {}), ("whole", {"mode": "car"})):
        env = rl.vector_env(
            chase_in(maps_of_cars, f"{name}.gamms", **mode, **more),
            team="cop",
            num_games=6,
            others={"prey": strategies.random_walk},
        )
        observed, infos = env.reset(seed=3)
        rows = []
        for turn in range(10):
            mask = infos["action_mask"]
            actions = mask.argmax(axis=1) if turn % 2 else mask.shape[1] - 1 - mask[:, ::-1].argmax(axis=1)
            rows.append((observed["observation"].tolist(), mask.tolist()))
            observed, rewards, *_, infos = env.step(actions)
            rows.append(rewards.tolist())
        env.close()
        played.append(rows)
    assert played[0] == played[1]


@pytest.mark.parametrize("order", [None, [["cop"], ["prey"]]])
def test_a_game_of_agents_with_a_mode_has_the_value_of_the_game_on_the_map_of_the_mode(maps_of_cars, order):
    more = {} if order is None else {"settings": {"order": order}}
    whole = chase_in(maps_of_cars, "whole.gamms", mode="car").replace(**more)
    cars = chase_in(maps_of_cars, "cars.gamms").replace(**more)
    assert solve.solve(whole).value == pytest.approx(solve.solve(cars).value, abs=1e-9)


@pytest.mark.parametrize(
    "modes", [("car", "car", None), (None, None, "car"), ("car", None, None), ("car", "foot", None)]
)
def test_exact_pursuers_of_several_modes_catch_when_the_solver_says(tmp_path, modes):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 3))
        for edge in [*ctx.graph.get_edges()]:
            ctx.graph.update_edge({"id": edge, "car": edge % 4 != 1, "foot": edge % 3 != 0})
        ctx.graph.save(tmp_path / "town.gamms")
    order = ["cop", "prey"] if modes[0] else ["prey", "cop"]
    *cops, prey = [{} if mode is None else {"mode": mode} for mode in modes]
    caught = []
    for start in ((0, 2, 5), (4, 0, 2), (1, 1, 3), (5, 3, 0)):
        scene = Scenario(
            map={"file": "town.gamms"},
            folder=tmp_path,
            teams={
                "cop": {"agents": [{"name": f"cop_{i}", "node": start[i], **own} for i, own in enumerate(cops)]},
                "prey": {"agents": [{"name": "prey", "node": start[2], **prey}]},
            },
            rules=[{"rule": "tag", "with": {"taggers": "cop", "tagged": "prey", "then": "eliminate"}}, "last_team"],
            settings={"order": [[team] for team in order], "information": "full"},
            max_turns=4,
        )
        players = {"cop": solve.exact_pursuers, "prey": solve.exact_evader}
        played = scene.play(strategies=players)
        assert (played.winner == "cop") == (solve.solve(scene, team="cop").value > 0.5)
        with scene.batch(2, strategies=players) as games:
            games.run()
            assert games.result(1).turns == played.turns
        caught.append(played.winner)
    assert "cop" in caught


def test_what_can_be_believed_of_an_agent_follows_its_mode():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.add_nodes([0, 1, 2], [0.0, 10.0, 20.0], [0.0, 0.0, 0.0])
        ways = [(0, 1, True), (1, 0, True), (1, 2, False), (2, 1, True)]
        for id, (source, target, car) in enumerate(ways):
            ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": 10.0, "car": car})
        eyes = ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=1.0)
        watcher = ctx.agent.create_agent("watcher", start_node_id=0, sensors=["eyes"], team="a")
        ctx.agent.create_agent(
            "truck", start_node_id=0, team="b", mode="car", strategy=lambda state: state.update(action=1)
        )
        ctx.agent.create_agent("walker", start_node_id=0, team="b", strategy=lambda state: state.update(action=1))
        known = []

        def watch(state):
            state["action"] = 0
            found = belief.observe(ctx, state)
            chances = found.probabilities(["truck", "walker"]).round(3).tolist()
            known.append((found.reachable("truck"), found.reachable("walker"), chances))

        watcher.strategy = watch
        for _ in range(3):
            ctx.game.step()
        assert eyes.type.name == "AGENT_RANGE"
        assert known[2][0] == {1}
        assert known[2][1] == {1, 2}
        assert known[2][2][0][2] == 0.0 < known[2][2][1][2]
