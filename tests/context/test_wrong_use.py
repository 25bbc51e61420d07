"""A wrong use of a right object is answered where it is used: the error says how it is used."""

import inspect
import operator

import pytest

import gamms
from gamms import osm
from gamms.errors import BadType, UnknownName
from gamms.game.result import summarize_errors
from gamms.rules import last_team, tag
from gamms.sensor import SensorType, agent_range, neighbor
from gamms.sensor import range as range_sensor
from gamms.strategies import goto, stay
from gamms.testing import check_rule


@pytest.fixture
def town():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.agent.create_agent("bob", start_node_id=1, team="blue", strategy=stay)
        yield ctx


SENSORS = {"eyes": agent_range(), "near": neighbor(), "street": range_sensor()}
PAIR = "A sensor gives the pair (kind, data): write _, seen = state['sensor']['eyes']."


def note_of(town, strategy):
    """Return what is noted at the error of a strategy of an agent with sensors."""
    town.agent.create_agent("ann", start_node_id=0, team="red", sensors=SENSORS, strategy=strategy)
    with pytest.raises((AttributeError, TypeError)) as caught:
        town.game.step()
    return caught.value.__notes__[-1]


@pytest.mark.parametrize(
    "strategy",
    [
        lambda state: state["sensor"]["eyes"].items(),
        lambda state: state["sensor"]["eyes"]["bob"],
        lambda state: [name for name, _ in state["sensor"]["eyes"]],
        lambda state: state["sensor"]["eyes"](),
        lambda state: min(state["sensor"]["eyes"]),
    ],
)
def test_the_pair_of_a_sensor_that_is_used_as_its_data_is_explained(town, strategy):
    assert note_of(town, strategy) == f"In the strategy of agent 'ann', in turn 0. {PAIR}"


def test_the_attribute_of_a_pair_names_the_sensor_that_gave_it(town):
    assert note_of(town, lambda state: state["sensor"]["near"].data).endswith("state['sensor']['near'].")


def test_the_pair_of_a_sensor_is_explained_to_plans_and_coroutines(town):
    async def look(state):
        state["sensor"]["eyes"].items()

    assert PAIR in note_of(town, look)
    town.agent.delete_agent("ann")
    town.game.command("red", lambda states: states["ann"]["sensor"]["eyes"].items())
    assert note_of(town, stay) == f"In the plan of team 'red', in turn 0. {PAIR}"


def test_other_errors_with_tuples_have_no_hint_of_sensors(town):
    assert note_of(town, lambda state: (*state["legal"], 1).pop()) == "In the strategy of agent 'ann', in turn 0."


def set_attribute(state):
    state.visits = 3


def add_to_a_legal_node(state):
    state["legal"][0] += 1


@pytest.mark.parametrize(
    ("strategy", "hint"),
    [
        (lambda state: state["legal"].pop(), "has the nodes that state['action'] may be, and cannot be changed."),
        (add_to_a_legal_node, "has the nodes that state['action'] may be, and cannot be changed."),
        (lambda state: state["curr_pos"]["x"], "is the id of a node: ctx.graph.graph.get_node(…) has its x and y."),
        (set_attribute, "Set state.action; notes belong into state['memory']."),
        (lambda state: state["memory"].visits, "Keys are read and set in brackets: write ['visits']."),
    ],
)
def test_a_value_of_the_state_that_is_taken_for_another_kind_is_explained(town, strategy, hint):
    assert note_of(town, strategy).endswith(hint)


@pytest.mark.parametrize(
    ("strategy", "hint"),
    [
        (lambda state: state["visits"], "The state has: 'curr_pos', "),
        (lambda state: state["memory"]["visits"], "has no such key yet: read state['memory'].get('visits', …)."),
        (lambda state: state["sensor"]["camera"], "Its sensors are: 'eyes', 'near', 'street'."),
        (lambda state: state["sensor"]["eyes"][1]["bbo"], "Sensor 'eyes' shows now: 'bob'."),
    ],
)
def test_a_missing_key_is_looked_for_in_the_dict_that_lacks_it(town, strategy, hint):
    town.agent.create_agent("ann", start_node_id=0, team="red", sensors=SENSORS, strategy=strategy)
    with pytest.raises(KeyError) as caught:
        town.game.step()
    assert hint in caught.value.__notes__[-1]


def test_values_that_a_strategy_puts_into_its_state_do_not_hide_its_error(town):
    def strategy(state):
        state["sensor"] = 5
        raise KeyError("own")

    town.agent.create_agent("ann", start_node_id=0, strategy=strategy)
    with pytest.raises(KeyError, match="own"):
        town.game.step()


@pytest.mark.parametrize(
    ("rule", "hint"),
    [
        (lambda ctx: [name.team for name in ctx.agent.agents], "'bob' is the name of an agent: loop over ctx.game."),
        (lambda ctx: [name["team"] for name in ctx.agent.agents], "'bob' is the name of an agent: loop over ctx.game."),
        (lambda ctx: ctx.game.agents["bob"], "It is a list: loop over it, or call ctx.agent.get_agent(name)."),
        (lambda ctx: ctx.game.data["met"], "has no such key yet: begin with ctx.game.data.setdefault('met', …)."),
        (lambda ctx: ctx.graph.graph.get_node(0)["x"], "have attributes: write .name, not ['name']."),
    ],
)
def test_values_that_a_rule_takes_for_another_kind_are_explained(town, rule, hint):
    town.game.add(rule)
    with pytest.raises((AttributeError, KeyError, TypeError)) as caught:
        town.game.step()
    assert hint in caught.value.__notes__[-1]


def replace_state(states):
    states["ann"] = 1


def drop_state(states):
    del states["ann"]


@pytest.mark.parametrize("plan", [replace_state, drop_state])
@pytest.mark.parametrize("settings", [{}, {"time_budget": 1e-9}, {"team_memory": True}])
def test_a_plan_that_replaces_a_state_errs(town, plan, settings):
    town.agent.create_agent("ann", start_node_id=0, team="red")
    town.game.configure(settings)
    town.game.command("red", plan)
    if "time_budget" in settings:
        town.game.on_error = "stay"
        assert town.game.run(1).errors[0]["kind"] == "overrun"
        return
    with pytest.raises(BadType, match=r"A plan sets states\['ann'\]\['action'\] = …, and leaves states\['ann'\] in"):
        town.game.step()


def test_actions_of_a_plan_belong_to_names_in_any_order(town):
    def plan(states):
        states["ann"] = states.pop("ann") | {"action": 4}
        states["cid"]["action"] = 6

    for name, node in (("ann", 0), ("cid", 5)):
        town.agent.create_agent(name, start_node_id=node, team="red")
    town.game.command("red", plan)
    assert town.game.run(1).errors == []
    assert [town.agent.get_agent(name).current_node_id for name in ("ann", "cid")] == [4, 6]


def test_a_plan_that_loops_over_names_is_told_so(town):
    town.agent.create_agent("ann", start_node_id=0, team="red")
    town.game.command("red", lambda states: [state["legal"] for state in states])
    with pytest.raises(TypeError) as caught:
        town.game.step()
    assert "'ann' is the name of an agent: its state is states[name]" in caught.value.__notes__[-1]


@pytest.mark.parametrize(
    ("action", "flaw"),
    [
        ({"node_id": 1, "orientaton": (0, 1)}, "Unknown key of an action 'orientaton'. Did you mean 'orientation'?"),
        ({"nodeid": 1}, "Unknown key of an action 'nodeid'. Did you mean 'node_id'?"),
        (
            {"node_id": 1, "note": "x"},
            "Unknown key of an action 'note'. There are: 'node_id', 'edge', 'do', 'orientation'.",
        ),
        ({"node_id": 1, 7: 8}, "Unknown key of an action 7. There are: 'node_id', 'edge', 'do', 'orientation'."),
        ({"node_id": 1, "orientation": (0, 1)}, None),
    ],
)
def test_an_unknown_key_of_an_action_is_refused(town, action, flaw):
    def strategy(state):
        state["action"] = action

    town.agent.create_agent("ann", start_node_id=0, strategy=strategy)
    assert [error["message"] for error in town.game.run(1).errors] == [f"UnknownName: {flaw}"] * (flaw is not None)


def test_the_warning_after_a_run_keeps_the_question_mark_of_a_hint(town):
    town.agent.create_agent("ann", start_node_id=0, strategy=lambda state: state.update(action={"edgs": 1}))
    assert summarize_errors(town.game.run(1).errors).endswith("Did you mean 'edge'? See result.errors.")


def test_a_misspelt_key_of_a_flight_is_refused(town):
    def strategy(state):
        state["action"] = {"direction": (1, 0, 0), "distanc": 2}

    town.agent.create_agent("ann", type="aerial", start_node_id=0, speed=5.0, strategy=strategy)
    (error,) = town.game.run(1).errors
    assert error["message"].endswith("Unknown key of an action 'distanc'. Did you mean 'distance'?")


def test_agents_and_parts_of_a_context_have_no_items(town):
    bob = town.agent.get_agent("bob")
    with pytest.raises(BadType, match=r"An agent is neither a list nor a dict. Write agent.team."):
        bob["team"]
    with pytest.raises(BadType, match=r"ctx.agent is neither .* ctx.agent.get_agent\(name\) returns an agent"):
        town.agent["bob"]
    with pytest.raises(BadType, match=r"ctx is neither a list nor a dict. Write ctx.graph."):
        town["graph"]
    for part in (bob, town, town.agent, town.game):
        with pytest.raises(TypeError):
            list(part)
    assert list(town.agent.create_iter()) == [bob]


def test_games_of_a_batch_are_not_its_items(town):
    town.game.add(last_team())
    with town.game.batch(2) as games:
        with pytest.raises(BadType, match=r"batch.result\(0\) is the result of its first game"):
            games[0]
        with pytest.raises(BadType, match=r"run takes no keyword 'turns'. Did you mean 'max_turns'?"):
            games.run(turns=3)
        with pytest.raises(AttributeError, match="Did you mean 'result'"):
            games.results  # noqa: B018 - raises


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        ("over", "A rule ends a game: ctx.game.end(reason, winner=…)."),
        ("scores", "Set its values: ctx.game.scores['red'] += 1."),
        ("rules", "Call ctx.game.add(rule) and ctx.game.remove(name)."),
        ("agents", "ctx.game.agents cannot be set."),
    ],
)
def test_attributes_that_are_only_read_say_what_a_rule_does_instead(town, name, way_out):
    with pytest.raises(AttributeError, match=f"ctx.game.{name} cannot be set") as caught:
        setattr(town.game, name, 1)
    assert str(caught.value).endswith(way_out)


def test_tracks_take_names(town):
    assert town.game.tracks(["bob"]) == town.game.tracks([town.agent.get_agent("bob")])
    with pytest.raises(UnknownName, match="Did you mean 'bob'"):
        town.game.tracks(["bbo"])
    with pytest.raises(BadType, match="agents must be a list of agents or their names, not 'bob'"):
        town.game.tracks("bob")


class Chaser:
    def __call__(self, state):
        state["action"] = state["curr_pos"]


def test_a_class_is_not_taken_for_a_strategy(town):
    with pytest.raises(BadType, match=r"Chaser is a class: pass an object of it, Chaser\(\)"):
        town.agent.create_agent("ann", start_node_id=0, strategy=Chaser)
    town.agent.create_agent("ann", start_node_id=0, strategy=Chaser())


def test_a_function_that_resolves_conflicts_is_shown_where_it_belongs(town):
    def first_wins(moves, ctx):
        """Do nothing."""

    with pytest.raises(BadType, match=r"Write gamms.rules.Conflicts\(resolve=first_wins\)"):
        town.game.conflicts = first_wins


def test_a_key_that_is_read_as_an_attribute_is_answered_with_the_key(town):
    assert note_of(town, lambda state: state["sensor"]["street"][1].nodes).endswith("It is a key: write ['nodes'].")
    town.agent.delete_agent("ann")
    town.game.publish(goal=3)
    assert note_of(town, lambda state: state.facts.goal).endswith("It is a key: write ['goal'].")


def test_a_key_that_is_read_as_an_attribute_is_answered_in_rules(town):
    town.game.emit("toll", node=4)
    town.game.add(lambda ctx: ctx.game.events[0].node)
    with pytest.raises(AttributeError) as caught:
        town.game.step()
    assert caught.value.__notes__[-1].endswith("It is a key: write ['node'].")


@pytest.mark.parametrize(
    ("keys", "hint"),
    [
        ({"acton": 1}, "Unknown key of the state 'acton'. Did you mean 'action'?"),
        ({"outbx": []}, "Unknown key of the state 'outbx'. Did you mean 'outbox'?"),
        (
            {"move": 1},
            "Unknown key of the state 'move'. There are: 'action', 'outbox', 'memory', 'team_memory'.",
        ),
        ({"outbox": []}, "legal are [0, 1, 4]"),
    ],
)
def test_a_missing_action_is_explained_by_the_key_that_was_set_instead(town, keys, hint):
    def strategy(state):
        state.update(keys)

    town.agent.create_agent("ann", start_node_id=0, team="red", strategy=strategy)
    (error,) = town.game.run(1).errors
    assert error["message"].startswith("IllegalAction: state['action'] was not set")
    assert error["message"].endswith(hint)


def test_a_missing_action_of_a_plan_is_explained_too(town):
    def plan(states):
        for state in states.values():
            state["acton"] = 1

    town.agent.create_agent("ann", start_node_id=0, team="red")
    town.game.command("red", plan)
    (error,) = town.game.run(1).errors
    assert error["message"].endswith("Did you mean 'action'?")


DECLARED = "Declare it: sensors={'eyes': gamms.sensor.agent_range()}."


@pytest.mark.parametrize("given", ["agent_range", "AGENT_RANGE", SensorType.AGENT_RANGE, agent_range])
def test_the_name_of_a_kind_is_not_taken_for_a_sensor(town, given):
    for sensors in ({"eyes": given}, given):
        with pytest.raises((BadType, UnknownName)) as caught:
            town.agent.create_agent("ann", start_node_id=0, sensors=sensors)
        assert str(caught.value).endswith(DECLARED)
    assert "ann" not in town.agent.agents


def test_an_unknown_id_in_a_dict_of_sensors_is_refused(town):
    town.sensor.create_sensor("near", "NEIGHBOR")
    with pytest.raises(UnknownName, match=r"Unknown sensor 'naer'. Did you mean 'near'\?"):
        town.agent.create_agent("ann", start_node_id=0, sensors={"eyes": "naer"})
    town.agent.create_agent("ann", start_node_id=0, sensors={"eyes": "near"})


def test_the_name_of_a_kind_in_a_list_is_skipped_as_in_1_0_0_with_a_warning_that_says_how(town, caplog):
    town.logger.setLevel("WARNING")
    town.agent.create_agent("ann", start_node_id=0, sensors=["agent_range"])
    assert caplog.records[-1].getMessage().endswith(DECLARED)


CALLS = {
    "a verb without a name": (
        lambda ctx: ctx.game.emit(node=3),
        "ctx.game.emit is called as emit(kind, **data); 'kind' is missing.",
    ),
    "facts without a name": (
        lambda ctx: ctx.game.publish("goal", 3),
        "ctx.game.publish is called as publish(to=…, **facts); too many arguments without a name.",
    ),
    "an agent's node without a name": (
        lambda ctx: ctx.agent.create_agent("ann", 0),
        (
            "ctx.agent.create_agent is called as create_agent(name, start_node_id=…, sensors=…, team=…, strategy=…, "
            "orientation=…, speed=…, type=…, …, **attributes); too many arguments without a name."
        ),
    ),
    "a fork without a seed": (lambda ctx: ctx.game.fork(), "ctx.game.fork is called as fork(seed); 'seed' is missing."),
    "a path without an end": (
        lambda ctx: ctx.graph.shortest_path(3),
        (
            "ctx.graph.shortest_path is called as shortest_path(source, target, weight=…, most_edges=…, turns=…); "
            "'target' is missing."
        ),
    ),
    "a rule with a context": (
        lambda ctx: tag(ctx, "red", "blue"),
        (
            "tag is called as tag(taggers, tagged, hops=…, metres=…, euclid=…, crossing=…, air=…, passing=…, …); "
            "too many arguments without a name."
        ),
    ),
    "a strategy without its goal": (
        goto,
        "goto is called as goto(ctx, target, otherwise=…); 'target' is missing.",
    ),
    "a misspelt keyword": (
        lambda ctx: ctx.game.fork(sead=3),
        "ctx.game.fork is called as fork(seed); it takes no keyword 'sead'. Did you mean 'seed'?",
    ),
    "a keyword of a method": (
        lambda ctx: ctx.game.end("over", winer="red"),
        (
            "ctx.game.end is called as end(reason, winner=…, truncated=…); it takes no keyword 'winer'. "
            "Did you mean 'winner'?"
        ),
    ),
    "scenery with its arguments in the wrong order": (
        lambda ctx: osm.scenery_from_file(ctx, "city.osm"),
        (
            "scenery_from_file takes a context, as gamms.create_context gives it, not 'city.osm'. "
            "Call it as scenery_from_file('city.osm', ctx)."
        ),
    ),
    "streets of a context": (
        lambda ctx: osm.graph_from_file(ctx, "city.osm"),
        (
            "graph_from_file takes no context. The context gets what it returns: "
            "ctx.graph.attach_networkx_graph(gamms.osm.graph_from_file(…))."
        ),
    ),
    "streets of a place and a context": (
        lambda ctx: osm.create_osm_graph("Kluuvi", ctx),
        (
            "create_osm_graph takes no context. The context gets what it returns: "
            "ctx.graph.attach_networkx_graph(gamms.osm.create_osm_graph(…))."
        ),
    ),
    "walls of a context": (
        lambda ctx: osm.obstacle_from_file("city.osm", ctx),
        (
            "obstacle_from_file takes no context. The context gets what it returns: "
            "ctx.graph.add_obstacles(gamms.osm.obstacle_from_file(…))."
        ),
    ),
    "a check with its arguments in the wrong order": (
        lambda ctx: check_rule(lambda: ctx, last_team()),
        (
            "A rule must be a function of the context alone, and <lambda>() is not. "
            "If it makes such a function, call it, <lambda>(…), and pass what it returns."
        ),
    ),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_call_that_does_not_fit_is_answered_with_the_right_one(town, call):
    wrong, said = CALLS[call]
    with pytest.raises(BadType) as caught:
        wrong(town)
    assert str(caught.value) == said
    assert caught.value.__context__ is None or caught.value.__suppress_context__


def test_errors_of_the_code_of_a_call_stay_as_they_are(town):
    town.game.add(lambda ctx: len(3))
    with pytest.raises(TypeError, match="has no len") as caught:
        town.game.step()
    assert type(caught.value) is TypeError
    with pytest.raises(TypeError, match="object cannot be interpreted"):
        town.game.batch(2, seeds=map(operator.index, ["x"]))


def test_help_shows_signatures_that_can_be_read():
    engine = gamms.create_context().agent
    shown = str(inspect.signature(engine.create_agent))
    assert shown.startswith("(name: str, *, start_node_id, sensors=(), team")
    assert len(shown) < 300
    assert engine.create_agent.__doc__.startswith("Create an agent")
