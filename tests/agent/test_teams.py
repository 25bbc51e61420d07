"""Teams that are created together: agents like others, read and written as arrays."""

import numpy as np
import pytest

import gamms
from gamms.errors import BadType, BadValue, Duplicate, TooLarge, UnknownName
from gamms.sensor import SensorType


@pytest.fixture
def ctx():
    with gamms.create_context(seed=4, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        yield ctx


def described(agents):
    fields = ("name", "team", "current_node_id", "prev_node_id", "alive", "speed", "orientation", "strategy", "type")
    return [tuple(getattr(agent, field) for field in fields) for agent in agents]


def test_sensors_and_columns_are_those_of_the_members(ctx):
    team = ctx.agent.create_team("red", np.array([0, 6]), sensors=["near"], columns={"fuel": [1.5, 2], "speed": 2})
    assert [agent.fuel for agent in team] == [1.5, 2]
    assert team["speed"].tolist() == [2, 2]
    assert team.sense("near")[1].tolist() == list(team.agents[1].get_state()["sensor"]["near"][1])
    with pytest.raises(BadType, match=r"senses with a sensor or its id, not \['near'\]"):
        team.sense(["near"])


def test_values_are_set_where_a_mask_says(ctx):
    team = ctx.agent.create_team("red", [0, 1, 2], columns={"fuel": 5})
    team.set("fuel", [1, 2, 3], where=team.node_ids > 0)
    assert team["fuel"].tolist() == [5, 2, 3]
    team.set("alive", False, where=[True, False, False])
    assert team.alive.tolist() == [False, True, True]
    with pytest.raises(ValueError, match="read-only"):
        team["fuel"][0] = 9
    with pytest.raises(BadValue, match="fuel: one value, or 3"):
        team.set("fuel", [1, 2])
    with pytest.raises(BadValue, match="ud800: one value, or 3"):
        team.set("\ud800", [1, 2])
    with pytest.raises(BadType, match="where="):
        team.set("fuel", 1, where=[0, 1, 1])
    with pytest.raises(UnknownName, match="fuel"):
        team["fule"]


def test_arrays_of_a_team_are_read_only(ctx):
    team = ctx.agent.create_team("red", [0, 1])
    for array in (team.node_ids, team.alive, team["speed"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("column", "values", "wrong"),
    [
        ("current_node_id", [7, 8, 99], UnknownName),
        ("prev_node_id", [7, 8, 99], UnknownName),
        ("strategy", [gamms.strategies.random_walk, None, 3], BadType),
        ("team", ["x", "y", []], BadType),
        ("orientation", [(0, 1), (0, 1), (0, "x")], BadType),
        ("speed", [2, 3, -1], BadValue),
        ("alive", [False, True, 2], BadType),
        ("node_ids", [1, 1, 1], BadValue),
        ("name", ["a", "b", "c"], BadValue),
        ("sensors", 1, BadValue),
        ("_row", 0, BadValue),
    ],
)
@pytest.mark.parametrize("has_lost_one", [False, True])
def test_all_are_set_or_none(ctx, column, values, wrong, has_lost_one):
    team = ctx.agent.create_team("red", [0, 1, 2])
    if has_lost_one:
        ctx.agent.delete_agent("red_1")
    before = described(team)
    with pytest.raises(wrong):
        team.set(column, values)
    assert described(team) == before


def test_a_team_has_the_values_of_its_members_as_they_are(ctx):
    for number, values in enumerate(([1, "a"], [[1], [2, 3]], [None, "a"], [True, "b"])):
        team = ctx.agent.create_team(f"red{number}", [0, 1], columns={"tag": values})
        assert team["tag"].tolist() == [agent.tag for agent in team] == values
    team.set("tag", iter([5, 6]))
    assert team["tag"].tolist() == [5, 6]


def test_wrong_queries_of_a_team_are_explained(ctx):
    team = ctx.agent.create_team("red", [0, 1])
    for index in (0, slice(0, 1), None):
        with pytest.raises(BadType, match=r"the name of an attribute, not .*; team.agents has the members"):
            team[index]
    with pytest.raises(BadType, match="must be a string, not 3"):
        team.set(3, 5)
    for name in ("name", "names"):
        with pytest.raises(AttributeError, match=f"team.{name} cannot be set: it is fixed"):
            setattr(team, name, "blue")
    team.set("hat", "tall", where=[True, False])
    with pytest.raises(UnknownName, match=r"Unknown attribute of Agent\('red_1', current_node_id=1\): 'hat'"):
        team["hat"]


def test_names_and_agents_are_in_their_team(ctx):
    team, other = ctx.agent.create_team("red", [3, 4]), ctx.agent.create_team("blue", [5])
    assert "red_1" in team
    assert ctx.agent.storage.list_created() == []
    assert team.agents[1] in team
    assert not any(one in team for one in ("red_2", "blue_0", other.agents[0], 1, None))
    with ctx.game.fork(1).ctx as copy:
        assert copy.agent.agents["red_1"] not in team


def test_a_keyword_that_teams_lack_is_refused_with_what_to_write(ctx):
    with pytest.raises(BadType, match=r"no keyword 'speed'\. Members get it by columns=\{'speed': …\}"):
        ctx.agent.create_team("red", [0], speed=2)
    with pytest.raises(BadType, match=r"'sensor'\. Did you mean 'sensors'"):
        ctx.agent.create_team("red", [0], sensor="near")
    assert ctx.agent.agents == {}


def test_a_deleted_member_stays_in_its_team(ctx):
    team = ctx.agent.create_team("red", [3, 4, 5], columns={"fuel": 5})
    ctx.agent.delete_agent("red_1")
    assert "red_1" in team
    assert team.agents[1] in team
    assert (len(team), team.node_ids.tolist(), team.alive.tolist()) == (3, [3, 4, 5], [True, True, True])
    team.set("speed", [2, 3, 4])
    team.set("fuel", 7, where=[False, True, True])
    assert (team["speed"].tolist(), team["fuel"].tolist()) == ([2, 3, 4], [5, 7, 7])
    assert [agent.speed for agent in ctx.agent.agents.values()] == [2, 4]


def test_members_beside_a_deleted_one_are_read_and_moved_without_being_made(ctx):
    team = ctx.agent.create_team("red", [0, 12, 1])
    ctx.agent.delete_agent("red_1")
    team.move([near := ctx.graph.graph.neighborhoods[0][1], 12, 1])
    assert (team.node_ids.tolist(), team.alive.tolist()) == ([near, 12, 1], [True, True, True])
    assert ctx.agent.storage.list_created() == []


def test_another_agent_of_the_name_of_a_deleted_member_is_no_member(ctx):
    team = ctx.agent.create_team("red", [3, 4, 5])
    ctx.agent.delete_agent("red_1")
    assert ctx.agent.create_agent("red_1", start_node_id=9) not in team
    assert team.node_ids.tolist() == [3, 4, 5]


def test_all_move_or_none(ctx):
    team = ctx.agent.create_team("red", [0, 12])
    for _ in range(20):
        before = team.node_ids
        wanted = team.random_actions()
        assert all(node in ctx.graph.graph.neighborhoods[here] for here, node in zip(before, wanted, strict=True))
        team.move(wanted)
        assert team.node_ids.tolist() == wanted.tolist()
    before = team.node_ids.tolist()
    with pytest.raises(BadValue, match="there is no edge"):
        team.move([before[0], (before[1] + 12) % 25])
    with pytest.raises(BadValue, match="1 node_ids"):
        team.move([0])
    assert team.node_ids.tolist() == before


def test_the_first_member_that_cannot_go_is_named(ctx):
    team = ctx.agent.create_team("red", [12, 0, 24])  # red_1 is in a corner: that it cannot go is known first
    with pytest.raises(BadValue, match="Agent 'red_0' cannot move to node 24: there is no edge from node 12"):
        team.move([24, 24, 0])
    team.set("alive", False, where=[True, False, False])
    with pytest.raises(BadValue, match="Agent 'red_1' cannot move to node 24"):
        team.move([24, 24, 0])
    with pytest.raises(BadValue, match="Agent 'red_2' cannot move to node -1"):
        team.move([24, 0, -1])
    team.move([24, 1, 24])
    assert team.node_ids.tolist() == [12, 1, 24]


@pytest.mark.parametrize("number", [60, 300])
def test_a_team_moves_along_open_roads(ctx, number):
    team, graph = ctx.agent.create_team("red", [0] * number), ctx.graph
    columns = graph.columns()
    edge = int(columns.edge_ids[(columns.sources == 0) & (columns.targets == 1)][0])
    assert set(team.random_actions().tolist()) == {0, 1, 5}
    graph.close_roads([edge])
    assert set(team.random_actions().tolist()) == {0, 5}
    with pytest.raises(BadValue, match="'red_3' cannot move to node 1"):
        team.move([5, 0, 0, *[1] * (number - 3)])
    graph.open_roads([edge])
    team.move([5, 0, 0, *[1] * (number - 3)])


def test_many_looks_at_neighbours_show_what_few_do(ctx):
    ctx.graph.close_roads([3, 9])
    nodes, sensor = np.arange(1000) % 25, ctx.sensor.get_sensor("near")
    many, few = sensor.sense_many(nodes), sensor.sense_many(range(25))
    assert [look.tolist() for look in many] == [few[node].tolist() for node in nodes.tolist()]
    with pytest.raises(UnknownName, match="node 25"):
        sensor.sense_many([*nodes, 25])


def test_members_with_neither_strategy_nor_sensors_are_not_made_in_turns(ctx):
    team = ctx.agent.create_team("red", [0, 1, 2])
    ctx.agent.create_agent("blue", start_node_id=3, strategy=gamms.strategies.random_walk)
    ctx.game.add(gamms.rules.time_limit(9))
    ctx.game.step()
    assert [agent.name for agent in ctx.agent.storage.list_created()] == ["blue"]
    ctx.agent.get_agent("red_1").register_strategy(gamms.strategies.random_walk)
    ctx.game.step()
    assert [agent.name for agent in ctx.agent.storage.list_created()] == ["red_1", "blue"]
    result = ctx.game.run()
    assert (result.agents["red_0"]["moves"], team.node_ids[[0, 2]].tolist()) == (0, [0, 2])
    assert result.agents["red_1"]["moves"] > 0


def test_a_team_that_cannot_be_created_changes_nothing(ctx):
    ctx.agent.create_agent("red_1", start_node_id=0)
    with pytest.raises(Duplicate, match="red_1"):
        ctx.agent.create_team("red", [0, 1])
    with pytest.raises(UnknownName, match="99"):
        ctx.agent.create_team("blue", [0, 99])
    with pytest.raises(UnknownName, match="99"):
        ctx.agent.create_team("blue", [0, 99], sensors=["near"])
    with pytest.raises(BadValue, match="fuel"):
        ctx.agent.create_team("blue", [0, 1], columns={"fuel": [1]})
    with pytest.raises(BadType, match="strategy"):
        ctx.agent.create_team("blue", [0, 1], strategy=5)
    for column in ("name", "names", "node_ids", "agents", "team", "strategy", "sensors", "start_node_id", "type"):
        with pytest.raises(BadValue, match=f"'{column}' cannot be one of columns="):
            ctx.agent.create_team("blue", [0, 1], columns={column: ["a", "b"]})
    with pytest.raises(BadType, match="name of a column must be a string, not 3"):
        ctx.agent.create_team("blue", [0, 1], columns={3: [1, 2]})
    with pytest.raises(UnknownName, match=r"Unknown sensor 'nearr'. Did you mean 'near'\?"):
        ctx.agent.create_team("blue", [0, 1], sensors=["nearr"])
    with pytest.raises(UnknownName, match="nearr"):
        ctx.agent.create_team("blue", [0, 1], sensors={"eyes": "nearr"})
    assert list(ctx.agent.agents) == ["red_1"]


def test_a_team_that_comes_while_a_recording_runs_is_in_arrays_and_recorded_as_agents_are_one_by_one(tmp_path):
    def wander(state):
        state["action"] = state["draw"].choice(state["legal"])

    def recorded(file, create):
        ctx = gamms.create_context(seed=2)
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.agent.create_agent("anna", start_node_id=7, strategy=wander)
        ctx.record.start(file)
        ctx.game.step()
        create(ctx.agent)
        ctx.game.run(max_turns=6)
        ctx.agent.delete_agent("red_1")
        ctx.game.run(max_turns=6)
        ctx.record.stop()
        with gamms.create_context() as again:
            for _ in again.record.replay(file):
                pass
            there = [(name, one.team, one.current_node_id, vars(one)) for name, one in again.agent.agents.items()]
        with gamms.recorder.open(file) as recording:
            return ctx.agent.block.has_teams, there, [str(state.agents) for state in recording]

    def each(agents):
        for name, start, fuel in (("red_0", 3, 1.5), ("red_1", 4, 2.5), ("red_2", 3, 4.5)):
            agents.create_agent(name, start_node_id=start, sensors=[], strategy=wander, team="red", fuel=fuel)

    def at_once(agents):
        agents.create_team("red", [3, 4, 3], strategy=wander, columns={"fuel": [1.5, 2.5, 4.5]})

    (is_in_arrays, *found), (_, *expected) = (recorded(tmp_path / one.__name__, one) for one in (at_once, each))
    assert is_in_arrays
    assert found == expected


def test_attributes_of_agents_are_found_by_their_rows_whether_or_not_members_were_made(ctx):
    ctx.agent.create_agent("anna", start_node_id=0, fuel=1)
    ctx.agent.create_team("red", [0, 1, 2, 3])
    ctx.agent.create_agent("bert", start_node_id=0)
    ctx.agent.get_agent("red_3").fuel = 3
    ctx.agent.get_agent("red_1").fuel = 2
    found = ctx.agent.storage.get_attributes()
    assert list(found.items()) == [(0, {"fuel": 1}), (2, {"fuel": 2}), (4, {"fuel": 3})]
    ctx.agent.delete_agent("anna")
    ctx.agent.create_team("blue", [0, 1], columns={"fuel": [4, 5]})
    found = ctx.agent.storage.get_attributes()
    assert list(found.items()) == [(1, {"fuel": 2}), (3, {"fuel": 3}), (5, {"fuel": 4}), (6, {"fuel": 5})]


def test_a_new_attribute_much_like_a_known_one_is_warned_about(caplog):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        team = ctx.agent.create_team("red", [0, 1], columns={"energy": 5})
        for name in ("enrgy", "current_nod_id"):
            team.set(name, 1)
        team.set("enrgy", 2)
        team.set("fuel", 3)
        team.set("energies", 3)
    assert [one.getMessage() for one in caplog.records if one.levelname == "WARNING"] == [
        "Team 'red': Unknown attribute 'enrgy'. Did you mean 'energy'? It is stored as an attribute.",
        "Team 'red': Unknown attribute 'current_nod_id'. Did you mean 'current_node_id'? It is stored as an attribute.",
    ]


def test_attributes_of_a_team_that_are_those_of_its_members_say_how_they_are_read_and_set(ctx):
    team = ctx.agent.create_team("red", [0, 1], columns={"energy": 5})
    with pytest.raises(AttributeError, match=r"no attribute 'energy': team\['energy'\] is that of its members"):
        _ = team.energy
    for name in ("energy", "alive", "node_ids"):
        with pytest.raises(AttributeError, match=rf"team.{name} cannot be set: team.set\('{name}', …\)"):
            setattr(team, name, 7)
    assert team["energy"].tolist() == [5, 5]


@pytest.mark.parametrize(
    ("nodes", "wrong"),
    [
        (range(4 * 10**9), "team of 4000000000 agents, of which 23 would fit, would take about 1676"),
        (range(1 << 70), "would fit, would take about an astronomical amount of memory"),
        (np.zeros(24, np.int64), "team of 24 agents, of which 23 would fit"),
        ((0 for _ in iter(int, 1)), "team of 24 or more agents, of which 23 would fit"),
    ],
)
def test_a_team_that_would_not_fit_says_so_before_it_is_made(ctx, nodes, wrong):
    with gamms.limits.allowing(23 * 450), pytest.raises(TooLarge, match=wrong):
        ctx.agent.create_team("red", nodes)
    assert not ctx.agent.agents
    with gamms.limits.allowing(23 * 450):
        assert len(ctx.agent.create_team("red", np.zeros(23, np.int64))) == 23
        with pytest.raises(TooLarge, match="team of 23 agents, of which 7 would fit"):
            ctx.agent.create_team("blue", [0] * 23, sensors=["near"])


_LARGE = 1 << 31  # the first id that signed integers of 32 bits do not hold


def _build(ctx):
    """Add a node of a large id while agents are about to move, and put one there."""
    ctx.graph.graph.add_node({"id": _LARGE, "x": 500.0, "y": 500.0})
    ctx.game.respawn("red_1", node=_LARGE)


def test_a_member_goes_to_a_node_of_a_large_id_that_was_not_there_when_it_was_asked(ctx):
    team = ctx.agent.create_team("red", [3, 4, 3])
    ctx.game.command("red", lambda arrays: arrays.choose([1, 1, 1]), arrays=True)
    ctx.game.add(_build, phase="deeds")
    ctx.game.step()
    assert team.node_ids[1] == _LARGE


def test_a_member_on_a_node_that_was_the_last_of_the_map_is_named(ctx):
    ctx.agent.create_team("red", [3, 24])
    ctx.graph.graph.remove_node(24)
    ctx.game.command("red", lambda arrays: arrays.choose([0, 0]), arrays=True)
    with pytest.raises(UnknownName, match="24"):
        ctx.game.step()


def test_the_reason_why_a_member_stopped_is_forgotten_in_the_next_turn(ctx):
    ctx.agent.create_team("red", [*range(1, 25), *[20] * 16])
    goes = iter([True, False])
    ctx.game.command("red", lambda arrays: np.where((arrays.nodes == 1) & next(goes), 6, arrays.nodes), arrays=True)
    ctx.game.conflicts = gamms.rules.Conflicts(1)
    for _ in range(2):
        ctx.game.step()
    assert ctx.game.observation("red_0")["blocked"] is None
    assert ctx.game.result().agents["red_0"]["blocked"] == 1
