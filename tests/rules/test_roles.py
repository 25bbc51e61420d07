"""Roles: rules that are about some agents of a team, chosen by name or by attribute."""

import sys
from pathlib import Path

import pytest

from gamms.errors import BadType, BadValue, MissingKey, UnknownName
from gamms.game.plan import find_first_called
from gamms.rules import (
    Conflicts,
    arrive,
    by_priority,
    capture_flag,
    contacts,
    discover,
    hold,
    idleness,
    idleness_table,
    none_left,
    reach,
    resource,
    respawn,
    tag,
    territory,
)
from gamms.scenario import Scenario
from gamms.scenario.documents import ScenarioError
from gamms.solve import solve
from gamms.strategies import stay

sys.path.append(str(Path(__file__).parents[1] / "batch"))
from batch_scenes import assert_as_alone, assert_as_played

TRUCK = {"team": "red", "names": ["truck"]}
DRONES = {"team": "red", "where": {"kind": "drone"}}


def kinds_of(ctx, kind):
    return [
        (event["agent"], event.get("other", event.get("node"))) for event in ctx.game.events if event["kind"] == kind
    ]


@pytest.mark.parametrize("role", [TRUCK, {"team": "red", "names": "truck"}, {"team": "red", "where": {"heavy": True}}])
def test_only_agents_with_the_role_tag(road, role):
    ctx = road(truck=("red", 3), car=("red", 5), ann=("blue", 3), bob=("blue", 5))
    ctx.agent.get_agent("truck").heavy = True
    ctx.agent.get_agent("car").heavy = 1
    ctx.game.add(tag(role, "blue", then="eliminate"))
    ctx.game.step()
    assert kinds_of(ctx, "tag") == [("truck", "ann")]
    assert ctx.game.scores == {"red": 1}


def test_only_agents_with_the_role_are_in_contact_or_are_tagged(road):
    ctx = road(truck=("red", 3), car=("red", 3), ann=("blue", 3))
    ctx.game.add(tag("blue", TRUCK))
    ctx.game.step()
    assert kinds_of(ctx, "tag") == [("ann", "truck")]
    assert [one.b for one in contacts(ctx, "blue", TRUCK)] == ["truck"]
    assert [one.b for one in contacts(ctx, lambda agent: agent.name == "ann", TRUCK)] == ["truck"]


def test_attributes_may_be_in_the_description_of_an_agent_and_its_type_is_one(road):
    ctx = road(a=("red", 3), ann=("blue", 3), bob=("blue", 3))
    ctx.agent.create_agent("fly", type="AERIAL", start_node_id=3, team="red", speed=1.0, meta={"kind": "drone"})
    roles = (
        DRONES,
        {"team": "red", "where": {"type": "aerial"}},
        {"team": "red", "names": ["fly"], "where": {"type": "basic"}},
    )
    met = [{one.a for one in contacts(ctx, role, "blue", air=True)} for role in roles]
    assert met == [{"fly"}, {"fly"}, set()]


def test_agents_that_come_later_or_change_have_the_role_from_then_on(road):
    ctx = road(old=("red", 3), ann=("blue", 3))
    ctx.agent.get_agent("old").kind = "car"
    ctx.game.add(lambda ctx: None)  # it may create agents
    ctx.game.add(tag(DRONES, "blue", then=lambda ctx, tagger, tagged: None))
    ctx.game.step()
    ctx.agent.create_agent("new", start_node_id=3, team="red", kind="drone")
    ctx.game.step()
    ctx.agent.delete_agent("new")
    ctx.game.step()
    ctx.agent.get_agent("old").kind = "drone"
    ctx.game.step()
    assert [(event["turn"], event["agent"]) for event in ctx.game.events if event["kind"] == "tag"] == [
        (2, "new"),
        (4, "old"),
    ]


def test_the_game_ends_when_an_agent_with_the_role_reaches_the_goal(road):
    ctx = road(car=("red", 3, 4, 5), truck=("red", 2, 3, 4), ann=("blue", 9))
    ctx.game.add(reach(TRUCK, 4))
    result = ctx.game.run(5)
    assert (result.turns, result.winner, kinds_of(ctx, "reach")) == (2, "red", [("truck", 4)])


def test_only_agents_with_the_role_arrive(road):
    ctx = road(car=("red", 3, 4), truck=("red", 2, 3, 4), ann=("blue", 9))
    ctx.game.add(arrive(TRUCK, [4]))
    ctx.game.run(3)
    assert kinds_of(ctx, "arrive") == [("truck", 4)]


def test_the_game_ends_when_no_agent_with_the_role_is_left(road):
    ctx = road(car=("red", 1), truck=("red", 4), ann=("blue", 4))
    ctx.game.add(tag("blue", "red", then="eliminate"))
    ctx.game.add(none_left(TRUCK, winner="blue"))
    result = ctx.game.run(3)
    assert (result.turns, result.winner) == (1, "blue")
    assert result.reason == "all agents of red/truck arrived or were eliminated"


def test_a_role_that_no_agent_has_ends_no_game(road):
    ctx = road(car=("red", 1), ann=("blue", 4))
    ctx.game.add(
        lambda ctx: ctx.agent.create_agent("truck", start_node_id=4, team="red") if ctx.game.turn == 2 else None
    )
    ctx.game.add(tag("blue", "red", then="eliminate"))
    ctx.game.add(none_left(TRUCK))
    assert ctx.game.run(9).turns == 2


def test_only_agents_with_the_role_return(road):
    ctx = road(car=("red", 4), truck=("red", 4), ann=("blue", 4), bob=("blue", 4))
    ctx.game.add(tag("blue", "red", then="eliminate"), name="out")
    ctx.game.add(respawn(teams=[TRUCK]))
    ctx.game.step()
    ctx.game.remove("out")
    ctx.game.run(3)
    assert [agent.name for agent in ctx.game.agents if agent.team == "red"] == ["truck"]


def test_only_agents_with_the_role_hold_a_place_and_others_contest_it(road):
    ctx = road(car=("red", 4), truck=("red", 2, 3, 4), ann=("blue", 9))
    ctx.game.add(hold(4, 2, teams=TRUCK))
    ctx.game.add(hold([8, 9], 2, teams=[TRUCK, "blue"], ends=False, key="east"))
    result = ctx.game.run(9)
    assert (result.turns, result.winner) == (3, "red")
    assert [event["team"] for event in ctx.game.events if event["kind"] == "hold"] == ["blue", "red"]


def test_only_agents_with_the_role_discover_patrol_and_need_fuel(road):
    ctx = road(car=("red", 4, 5, 6), truck=("red", 2, 3, 2), ann=("blue", 3))
    ctx.game.add(discover([3, 5], teams=TRUCK))
    ctx.game.add(idleness([2, 4], teams=TRUCK))
    ctx.game.add(resource("fuel", 1, per_edge=1, teams=[TRUCK]))
    ctx.game.run(2)
    assert [(event["agent"], event["node"]) for event in ctx.game.events if event["kind"] == "discover"] == [
        ("truck", 3)
    ]
    assert idleness_table(ctx)["visits"].tolist() == [1, 0]
    assert [ctx.agent.get_agent(name).current_node_id for name in ("car", "truck")] == [6, 3]


@pytest.mark.parametrize(
    ("rules", "end"),
    [
        ([tag("red", "blue", ends=True)], (1, "red")),
        ([tag("red", "blue", ends=True, mutual=True)], (1, None)),
        ([tag(TRUCK, "blue", ends=True), tag("green", "blue")], (2, "red")),
        ([tag("red", "blue", ends=True), tag("blue", "green", ends=True)], (1, None)),
    ],
)
def test_a_tag_may_end_the_game(road, rules, end):
    ctx = road(
        car=("red", 3), truck=("red", 4, 4, 5), ann=("blue", 3), bob=("blue", 5, 5), cy=("blue", 8), g=("green", 8)
    )
    for rule in rules:
        ctx.game.add(rule)
    result = ctx.game.run(4)
    assert (result.turns, result.winner, result.reason) == (*end, "an agent was tagged")
    assert not result.truncated


@pytest.mark.parametrize(
    ("role", "error", "message"),
    [
        ({"team": "red"}, BadValue, "needs names or where"),
        ({"names": ["a"]}, BadValue, "has no team"),
        ({"team": "red", "name": ["a"]}, UnknownName, "Unknown key of a role 'name'. Did you mean 'names'"),
        ({"team": "red", "names": []}, BadValue, "names of a role is empty"),
        ({"team": "red", "where": {}}, BadValue, "where of a role is empty"),
        ({"team": "red", "where": {"kind": ["drone"]}}, BadType, "must be a text, a number or a bool"),
        ({"team": ["red"], "names": ["a"]}, BadType, "The team of a role"),
    ],
)
def test_a_role_that_says_nothing_is_refused(role, error, message):
    for make in (lambda: tag(role, "blue"), lambda: respawn(teams=[role]), lambda: arrive(role, 3)):
        with pytest.raises(error, match=message):
            make()


@pytest.mark.parametrize(
    ("role", "message"),
    [
        ({"team": "rad", "names": ["truck"]}, "Unknown team 'rad'. Did you mean 'red'"),
        ({"team": "red", "names": ["trukc"]}, "Unknown agent of team 'red': 'trukc'. Did you mean 'truck'"),
        ({"team": "red", "names": ["ann"]}, "Unknown agent of team 'red': 'ann'. There are: 'car', 'truck'"),
        ({"team": None, "names": ["truck"]}, "Unknown agent of team None: 'truck'. There are none"),
        (
            {"team": "red", "where": {"kin": "drone"}},
            "Unknown attribute of the agents of team 'red': 'kin'. Did you mean 'kind'",
        ),
        (
            {"team": "red", "where": {"kind": "dron"}},
            "Unknown kind of the agents of team 'red': 'dron'. Did you mean 'drone'",
        ),
    ],
)
def test_names_and_attributes_that_no_agent_has_are_refused_when_the_game_begins(road, role, message):
    ctx = road(car=("red", 3), truck=("red", 3), ann=("blue", 3))
    ctx.agent.get_agent("car").kind = "drone"
    ctx.game.add(tag(role, "blue"))
    with pytest.raises(UnknownName) as caught:
        ctx.game.step()
    assert message in str(caught.value)


SCENE = {
    "map": {"grid": {"width": 4, "height": 4}},
    "max_turns": 30,
    "teams": {
        "red": {
            "strategy": "gamms.strategies:random_walk",
            "agents": [
                {"name": "truck", "meta": {"kind": "car"}},
                {"name": "d1", "meta": {"kind": "drone"}},
                {"name": "d2", "meta": {"kind": "drone"}},
            ],
        },
        "blue": {"count": 5, "strategy": "gamms.strategies:random_walk"},
    },
}
RULES = [
    {"rule": "tag", "with": {"taggers": DRONES, "tagged": "blue", "then": "eliminate"}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": TRUCK, "then": "eliminate"}},
    {"rule": "respawn", "with": {"teams": [{"team": "blue", "names": ["blue_0", "blue_1"]}]}},
    {"rule": "none_left", "with": {"team": TRUCK, "winner": "blue"}},
]


FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 15}, "goal": 9, "teams": ["blue", DRONES]}}
HOLD = {"rule": "hold", "with": {"nodes": [5, 6], "turns": 3, "teams": DRONES}}
CATCH = {"rule": "tag", "with": {"taggers": "blue", "tagged": {"team": "red", "names": ["d2"]}, "ends": True}}


@pytest.mark.parametrize("first", [[], [HOLD], [CATCH], [FLAGS]])
def test_a_game_with_roles_in_a_batch_is_the_game_alone(first):
    scenario = Scenario(**SCENE, rules=[*first, *RULES])
    with scenario.batch(seeds=range(12)) as games:
        assert (find_first_called(games.game, games.roster) is None) == (HOLD not in first)
        games.run()
        assert_as_played(games, scenario)
        results = [games.result(number) for number in range(12)]
    assert {result.winner for result in results} >= {"blue"}
    taggers = {event["agent"] for result in results for event in result.events if event["kind"] == "tag"}
    assert {"d1", "d2"} <= taggers
    assert "truck" not in taggers


OWNED = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "territory": "territory", "mutual": True}},
    {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 15}, "territory": "territory", "goal": 9}},
]
GROUND = {"function": "gamms.rules.territory:by_distance", "with": {"bases": [[TRUCK, 0], [DRONES, 3], ["blue", 12]]}}


def test_a_game_whose_territory_belongs_to_roles_is_in_a_batch_the_game_alone():
    scenario = Scenario(**SCENE, rules=OWNED, facts={"territory": GROUND})
    with scenario.batch(seeds=range(6)) as games:
        assert find_first_called(games.game, games.roster) is None
        games.run()
        assert_as_played(games, scenario)
        tags = [event for number in range(6) for event in games.result(number).events if event["kind"] == "tag"]
    with scenario.build(seed=0) as ctx:
        owners = ctx.game.facts["territory"]
    assert {event["agent"] for event in tags} >= {"truck", "d1", "blue_0"}
    for event in tags:
        name = event["agent"]
        owner = {"truck": {"team": "red", "names": ("truck",)}, "d1": DRONES, "d2": DRONES}.get(name, "blue")
        assert owners[event["node"]] == owner


@pytest.mark.parametrize("more", [{"rules": RULES}, {"rules": OWNED, "facts": {"territory": GROUND}}])
def test_attributes_that_a_rule_changes_in_a_batch_count_in_their_game_only(more):
    def change(ctx):
        if ctx.game.turn == ctx.seed % 5:
            ctx.agent.get_agent("d1").kind = "car"

    scenario = Scenario(**SCENE, **more)
    with scenario.build(seed=3) as ctx:
        ctx.game.add(change)
        with ctx.game.batch(8) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


def test_only_agents_with_the_role_take_flags_and_bring_them_home(road):
    ctx = road(
        truck=("red", 2, 3, 4, 3, 2, 1, 0), car=("red", 2, 3, 4, 4, 3, 2, 1, 0), foe=("blue", 4, 3, 2, 1, 0, 1, 2, 3, 4)
    )
    ctx.game.add(capture_flag({"red": 0, "blue": 4}, goal=None, teams=[{"team": "red", "names": ["car"]}]))
    result = ctx.game.run(9)
    assert [(one["kind"], one["agent"]) for one in result.events] == [("take", "car"), ("capture", "car")]
    assert result.scores == {"red": 1}


@pytest.mark.parametrize("is_fact", [False, True])
def test_only_agents_with_the_role_that_owns_a_node_tag_there(road, is_fact):
    ctx = road(truck=("red", 3), car=("red", 5), ann=("blue", 3), bob=("blue", 5), spy=("red", 5))
    heavy = {"team": "red", "where": {"heavy": True}}
    ground = territory.by_distance(ctx, [(TRUCK, [0, 3]), (heavy, 5)])
    assert (ground[2], ground[5]) == (TRUCK, heavy)
    ctx.agent.get_agent("truck").heavy = True
    ctx.game.add(territory.published(ground))
    ctx.game.add(tag("red", "blue", territory="territory" if is_fact else ground, then=lambda *_: None))
    ctx.game.step()
    assert kinds_of(ctx, "tag") == [("truck", "ann")]
    ctx.agent.get_agent("car").heavy = True
    ctx.agent.create_agent("amy", start_node_id=3, team="red", heavy=True)
    ctx.game.step()
    assert sorted(kinds_of(ctx, "tag")[1:]) == [("car", "bob"), ("truck", "ann")]


def test_a_flag_is_home_on_the_nodes_of_a_role_of_its_carrier(road):
    ctx = road(truck=("red", 3, 4, 3, 2, 1, 0))
    ctx.agent.create_team("blue", [])
    cars = {"team": "red", "names": ["car", "truck"]}
    ground = territory.halves(ctx, teams=[TRUCK, cars]) | {2: {"team": "blue", "names": ["b"]}, 3: "blue"}
    ctx.agent.create_agent("car", start_node_id=9, team="red", strategy=stay)
    ctx.agent.create_agent("b", start_node_id=9, team="blue", strategy=stay)
    ctx.game.add(capture_flag({"blue": 4}, goal=None, territory=ground))
    result = ctx.game.run(5)
    assert [(one["kind"], one["node"], one["turn"]) for one in result.events] == [("take", 4, 1), ("capture", 1, 4)]


PRIORITIES = [[TRUCK, "blue", "red"], ["blue", DRONES, "red"], [DRONES, {"team": "blue", "names": ["b"]}, "red"]]


@pytest.mark.parametrize(("order", "winner"), [*zip(PRIORITIES, ["truck", "b", "d"], strict=True)])
def test_roles_have_priorities_of_their_own_in_conflicts(road, order, winner):
    ctx = road(truck=("red", 3, 4), b=("blue", 5, 4))
    ctx.agent.create_agent("d", start_node_id=3, team="red", kind="drone", strategy=lambda s: s.update(action=4))
    ctx.game.conflicts = Conflicts(capacity=1, resolve=by_priority(order))
    ctx.game.step()
    assert [agent.name for agent in ctx.game.agents if agent.current_node_id == 4] == [winner]


def test_errors_of_priorities_name_missing_and_repeated_teams(road):
    for twice in (["red", "red"], [TRUCK, "red", TRUCK]):
        with pytest.raises(BadValue, match="twice"):
            by_priority(twice)
    for order in ([TRUCK, "blue"], [DRONES, "blue"]):
        ctx = road(car=("red", 3, 4), b=("blue", 5, 4))
        ctx.game.conflicts = Conflicts(capacity=1, resolve=by_priority(order))
        with pytest.raises(MissingKey, match="team 'red' of agent 'car'"):
            ctx.game.step()


@pytest.mark.parametrize("order", [[TRUCK, "blue", "red"], [DRONES, "blue", "red"]])
def test_priorities_of_roles_in_a_file_are_those_of_a_batch(order):
    scenario = Scenario(**SCENE, conflicts={"capacity": 1, "resolve": {"by_priority": order}})
    with scenario.batch(seeds=range(4)) as games:
        games.run(warn=False)
        assert_as_played(games, scenario)
    with pytest.raises(ScenarioError, match="has no agent 'trock'"):
        scenario.replace(**{"conflicts.resolve.by_priority": [{"team": "red", "names": ["trock"]}, *order]}).check()
    with pytest.raises(ScenarioError, match="leaves out team 'red'"):
        scenario.replace(**{"conflicts.resolve.by_priority": ["blue"]}).check()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"team": "rod", "names": ["truck"]}, "with.taggers.team: unknown team 'rod'. Did you mean 'red'"),
        (
            {"team": "red", "names": ["trock"]},
            "with.taggers.names: team 'red' has no agent 'trock'. Did you mean 'truck'",
        ),
        ({"team": "red", "wher": {"kind": "drone"}}, "Unknown key of a role 'wher'"),
    ],
)
def test_files_with_unknown_roles_are_refused(given, message):
    ground = {"function": "gamms.rules.territory:by_distance", "with": {"bases": [[given, 0], ["blue", 12]]}}
    with pytest.raises((ScenarioError, TypeError, UnknownName)) as caught:
        Scenario(**SCENE, facts={"territory": ground}).check()
    assert message.rpartition(": ")[2] in str(caught.value)
    with pytest.raises((ScenarioError, TypeError, UnknownName)) as caught:
        Scenario(**SCENE, rules=[{"rule": "tag", "with": {"taggers": given, "tagged": "blue"}}]).check()
    assert message in str(caught.value)


@pytest.mark.parametrize(("role", "value"), [(TRUCK, -2.0), ({"team": "red", "names": ["car"]}, -3.0), ("red", -2.0)])
def test_a_solver_knows_who_has_the_role(role, value):
    red = [{"name": "truck", "node": 2}, {"name": "car", "node": 3}]
    scenario = Scenario(
        map={"grid": {"width": 4, "height": 1}},
        teams={"red": {"agents": red}, "blue": {"agents": [{"name": "ann", "node": 0}]}},
        rules=[{"rule": "reach", "with": {"team": role, "nodes": [0]}}],
        max_turns=4,
    )
    assert solve(scenario, team="red", reward="turns").value == value
