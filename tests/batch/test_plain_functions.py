"""Plain functions in batches that are played together: one context is pointed at each game for the time of a call."""

import math
import random
import zlib
from copy import deepcopy

import numpy as np
import pytest
from batch_scenes import assert_as_alone, assert_as_played, scene
from random_games import KINDS
from random_players import look

import gamms
from gamms.errors import BadValue
from gamms.rules import Conflicts
from gamms.sensor import SensorType

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
OUT = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
BACK = {"rule": "respawn", "with": {"after": 2}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
SENSORS = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}, "next": {"type": "NEIGHBOR"}}


def check(ctx, seeds=(1, 2, 3)):
    """Check that the games of a batch are those that are played alone, and that they stay together."""
    with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
        assert games.is_in_arrays
        games.run()
        assert_as_alone(games, alone)
        assert not games.detached
        assert games.is_in_arrays


def tell(ctx):
    """Publish what strategies look at."""
    ctx.game.publish(alarm=ctx.game.turn % 3)
    ctx.game.publish(secret=len(ctx.game.events) % 2)
    ctx.game.scores["told"] += len(ctx.game.facts_of("red")) + len(ctx.game.facts_of("blue_1"))


def decide(state):
    """Decide by all that an agent gets, and remember."""
    memory, shared = state["memory"], state["team_memory"]
    memory["asked"] = memory.get("asked", 0) + 1
    shared["last"] = state["name"]
    seen = sorted(state["sensor"]["near"][1].values())
    lot = sum(seen) + len(state["sensor"]["next"][1]) + memory["asked"] + len(shared) + state["draw"].below(5)
    lot += int(state["rng"].integers(3)) + len(state["blocked"] or "") + sum(state["facts"].values())
    if lot % 11 == 10:
        return
    state["action"] = [*state["legal"], 999][lot % (len(state["legal"]) + (lot % 7 == 0))]


def build(rules=(), strategies=None, **more):
    teams = {
        team: {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": [*SENSORS]}
        for team in ("red", "blue")
    }
    return scene(rules, teams=teams, sensors=SENSORS, **more).build(seed=1, strategies=strategies)


def test_a_plain_rule_that_publishes_the_flags_itself_is_played_game_by_game():
    with build([FLAGS], max_turns=20) as ctx:
        ctx.game.add(lambda ctx: ctx.game.publish(flags={"lost": ctx.seed}))
        check(ctx)


def test_facts_that_are_published_for_functions_of_arrays_are_those_of_their_games():
    @gamms.array_strategy
    def look(view):
        return np.where(view["facts"]["alarm"] > 0, view.counts - 1, 0)

    with build(strategies={"red": look}) as ctx:
        ctx.game.publish(alarm=0)
        ctx.game.add(tell)
        check(ctx)


def draw(ctx):
    ctx.game.scores["drawn"] += int(ctx.rng.integers(1 << 20))


OF_ONE = {
    "heading": (lambda ctx, one: setattr(one, "orientation", (0.6, 0.8)), lambda _, one: one.orientation),
    "place": (lambda _, one: setattr(one, "current_node_id", 12), lambda _, one: one.current_node_id),
    "life": (lambda _, one: setattr(one, "alive", False), lambda ctx, _: [agent.name for agent in ctx.game.agents]),
    "attribute": (lambda _, one: setattr(one, "mark", 1), lambda _, one: getattr(one, "mark", None)),
    "draws": (lambda ctx, _: draw(ctx), lambda ctx, _: draw(ctx) if ctx.game.turn > 6 else None),
    "fact": (lambda ctx, _: ctx.game.publish(mark=1), lambda ctx, _: [*ctx.game.facts.items()]),
    "own fact": (
        lambda ctx, one: ctx.game.publish(to=one, mark=1),
        lambda ctx, _: [*ctx.game.facts_of("red_1").items()],
    ),
    "road": (lambda ctx, _: ctx.graph.close_roads([0]), lambda ctx, _: ctx.graph.closed_roads),
}
"""Name -> a function that changes a value of a game, and one that reads it; both get an agent."""


@pytest.mark.parametrize(("change", "read"), OF_ONE.values(), ids=OF_ONE)
@pytest.mark.parametrize("seed", [1, 3, 5])
def test_what_one_game_alone_shows_is_not_shown_in_the_next(change, read, seed):
    def act(ctx):
        if ctx.seed == seed and ctx.game.turn == 3:
            change(ctx, ctx.agent.get_agent("red_1"))
        ctx.game.scores["seen"] += zlib.crc32(repr(read(ctx, ctx.agent.get_agent("red_1"))).encode()) % 1009

    with build() as ctx:
        ctx.game.add(act)
        check(ctx, seeds=(1, 2, 3, 4, 5))


def test_strategies_look_ahead_in_copies_of_their_games():
    def look_ahead(state):
        game = state["fork"](state["turn"]).game
        game.step()
        state["action"] = state["legal"][len(game.agents) % len(state["legal"])]

    with build([TAG], {"red": look_ahead}, max_turns=4) as ctx, ctx.game.batch(2) as games:
        games.run()
        with ctx.game.fork(0).ctx as alone:
            assert_as_alone(games, alone)


switch = {"is_on": False}


def trip(ctx):
    ctx.game.data.setdefault("tripped", []).append(ctx.game.turn)
    ctx.game.scores["luck"] += int(ctx.stream("trip", ctx.game.turn).integers(9))
    ctx.game.publish(trips=len(ctx.game.data["tripped"]))
    if switch["is_on"] and ctx.seed == 2:
        raise ZeroDivisionError("tripped")
    ctx.game.emit("trips", number=len(ctx.game.data["tripped"]))


def stumble(state):
    decide(state)
    if switch["is_on"] and state["name"] == "red_2" and state["memory"]["asked"] % 2:
        raise ZeroDivisionError("stumbled")


def raise_in_step_of(games):
    """Let functions raise in a step; return the caught error."""
    switch["is_on"] = True
    try:
        with pytest.raises(ZeroDivisionError) as caught:
            games.step()
    finally:
        switch["is_on"] = False
    return caught


def test_what_functions_wrote_in_a_turn_that_one_raises_stays_as_in_a_game_alone():
    with build([], {"red": decide}, max_turns=6) as ctx:
        ctx.game.publish(trips=0)
        ctx.game.add(trip, phase="before")
        with ctx.game.batch(seeds=[1, 2, 3]) as games:
            for _ in range(4):
                games.step()
            raise_in_step_of(games)
            games.step()
            trips = [games.result(number).events[-1]["number"] for number in range(3)]
        ctx.game.reset(seed=2)
        ctx.game.run(4)
        raise_in_step_of(ctx.game)
        ctx.game.step()
        alone = ctx.game.events[-1]["number"]
    assert trips == [6, 6, 5]  # the rule was called in the game before and in that which raised
    assert alone == 6


@pytest.mark.parametrize("phase", ["before", "after"])
@pytest.mark.parametrize("strategy", [decide, stumble])
def test_no_game_has_played_a_turn_in_which_one_raises(phase, strategy):
    with build([OUT, BACK], {"red": strategy}) as ctx:
        ctx.game.on_illegal = "stay"
        ctx.game.publish(trips=0)
        ctx.game.add(trip, phase=phase)
        with ctx.game.batch(seeds=[1, 2, 3]) as games:
            for _ in range(4):
                games.step()
            before = [games.result(number) for number in range(3)]
            caught = raise_in_step_of(games)
            assert any(note.startswith("In game ") for note in caught.value.__notes__)
            assert games.turn.tolist() == [4, 4, 4]
            assert games.is_in_arrays
            assert [games.result(number) for number in range(3)] == before
            games.run()
            assert games.detached == {}


def test_functions_that_draw_globally_draw_what_they_draw_in_games_alone():
    def gamble(state):
        state["action"] = state["legal"][random.randrange(len(state["legal"]))]

    def cast(ctx):
        if ctx.game.turn == 3:
            ctx.game.scores["cast"] += int(np.random.randint(9))  # noqa: NPY002 - as programs for 1.0.0 do

    scenario = scene([TAG])
    with scenario.batch(3, strategies={"red": gamble}) as games:
        games.run()
        assert_as_played(games, scenario, {"red": gamble})
    with build([TAG]) as ctx:
        ctx.game.add(cast)
        check(ctx)


def roll(ctx):
    """Draw from the global generators by their names."""
    ctx.game.scores["rolled"] += random.randrange(9) + [np.random.randint(9) for _ in range(2)][0]  # noqa: NPY002, RUF015


def roll_shuffled(ctx):
    """Draw by another function of Python's module, in a function of this one."""
    ctx.game.scores["rolled"] += [pick(range(9)), 1][0]


def roll_imported(ctx):
    """Draw by a module that is imported where it is needed."""
    import random as lots

    ctx.game.scores["rolled"] += lots.randrange(9)


pick = random.choice


@pytest.mark.parametrize("draw", [roll, roll_shuffled, roll_imported])
def test_games_whose_functions_draw_globally_by_name_are_played_one_after_the_other(draw, caplog):
    def rule(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
        draw(ctx)

    with build([TAG]) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            calls = [said for said in caplog.messages if said.startswith("seed")]
            assert len(calls) == games.turn.sum()
            assert games.is_in_arrays
            assert_as_alone(games, alone)


def test_a_game_that_draws_globally_goes_on_with_its_draws_when_it_follows_another_plan():
    def rule(ctx):
        roll(ctx)
        if (ctx.game.turn, ctx.seed) == (3, 1):
            ctx.game.max_turns = 6

    with build([TAG]) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def test_what_plain_functions_remember_is_in_no_columns():
    said = r"columns needs games that the core plays completely; .* strategy decide"
    with build([TAG], {"red": decide}) as ctx, ctx.game.batch(2) as games, pytest.raises(BadValue, match=said):
        games.columns()


class Load:
    """What an agent carries, in an object of a class of the program."""

    def __init__(self):
        self.weight = 0


def load(ctx):
    """Change objects that are attributes of agents, and refer to other agents."""
    for agent in ctx.game.agents:
        agent.load.weight += agent.current_node_id
        mate = ctx.agent.get_agent(agent.mate.name)
        ctx.game.emit("loaded", by=agent.load.weight, mate=agent.mate.current_node_id, is_mate=agent.mate is mate)
        if agent.current_node_id % 4 == 0:
            agent.mate = ctx.game.agents[0]


@pytest.mark.parametrize("turns", [0, 2])
def test_attributes_that_are_objects_are_those_of_their_games(turns):
    with build([OUT, BACK]) as ctx:
        agents = [*ctx.agent.create_iter()]
        for number, agent in enumerate(agents):
            agent.load = Load()
            agent.mate = agents[number - 1]
        ctx.game.add(load)
        for _ in range(turns):
            ctx.game.step()
        weights = [agent.load.weight for agent in agents]
        check(ctx, seeds=range(40))
        assert [agent.load.weight for agent in agents] == weights


def wander(state):
    """Go to a legal node or towards another, along a list of nodes, stop, or set no action."""
    lot = state["draw"].below(7)
    state["memory"]["asked"] = state["memory"].get("asked", 0) + 1
    if lot < 4:
        state["action"] = state["legal"][(lot + state["memory"]["asked"]) % len(state["legal"])]
    elif lot == 4:
        state["action"] = [state["curr_pos"], state["legal"][-1]]
    elif lot == 5:
        state["action"] = 24 if len(state["blocked"] or "") % 2 else None


WAYS = {
    "several edges": ({}, [2.7, None, 1]),
    "parts of edges": ({}, [0.4]),
    "metres": ({"speed_unit": "metres"}, [3.0, 15.0, None]),
    "far": ({"speed_unit": "metres_per_second", "turn_seconds": 2.0}, [33.0, math.inf]),
}


def open_on_way(way, rules, strategies=None):
    """Return a context with a game whose agents have speeds, and are stopped by conflicts."""
    settings, speeds = WAYS[way]
    ctx = build(rules, strategies)
    for name, value in settings.items():
        setattr(ctx.game, name, value)
    for number, agent in enumerate(ctx.agent.create_iter()):
        agent.speed = speeds[number % len(speeds)]
    ctx.game.conflicts = Conflicts(capacity=1, allow_swaps=False)
    ctx.game.on_illegal = "stay"
    return ctx


@pytest.mark.parametrize("way", WAYS)
def test_a_turn_in_which_an_agent_with_a_speed_raises_is_taken_back(way):
    def fall_once(state):
        state["memory"]["asked"] = state["turn"]  # memories stay when the turn is taken back
        wander(state)
        if switch["is_on"] and state["name"] == "red_2":
            raise ZeroDivisionError("fell")

    with open_on_way(way, [OUT, BACK], {"red": fall_once}) as ctx:
        ctx.game.add(look, phase="before")
        with ctx.game.batch(seeds=[1, 2, 3]) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(3):
                games.step()
            raise_in_step_of(games)
            games.run()
            assert games.detached == {}
            assert_as_alone(games, alone)


def tire(ctx):
    """Change attributes of agents: numbers, lists and arrays, as a whole and in place; some agents have none."""
    for agent in [*ctx.game.agents]:
        lot = (agent.current_node_id + ctx.game.turn + ctx.seed) % 6
        known = [getattr(agent, name, None) for name in ("tired", "visited", "spent", "rank")]
        ctx.game.emit("knows", agent=agent.name, of=[repr(one) for one in known])
        if lot == 0:
            agent.tired = getattr(agent, "tired", 0) + 1
        elif lot == 1:
            agent.visited = [*getattr(agent, "visited", []), agent.current_node_id]
        elif lot == 2 and hasattr(agent, "visited"):
            agent.visited.append(-1)
        elif lot == 3:
            agent.spent = np.arange(2.0) + ctx.game.turn
        elif lot == 4 and hasattr(agent, "spent"):
            agent.spent[0] += 1.0
        elif hasattr(agent, "tired"):
            del agent.tired


def visit(ctx):
    """Change attributes of agents in place alone."""
    for agent in ctx.game.agents:
        agent.visited.append(agent.current_node_id)
        ctx.game.emit("visits", nodes=[*agent.visited])


def visit_first(ctx):
    """Set an attribute of agents that have none, and change it in place in the same call."""
    for agent in ctx.game.agents:
        if not hasattr(agent, "visited"):
            agent.visited = [ctx.seed]
    visit(ctx)


@pytest.mark.parametrize(
    ("rule", "attributes"),
    [(tire, {}), (tire, {"rank": 3, "visited": [7]}), (visit, {"visited": [7]}), (visit_first, {})],
)
@pytest.mark.parametrize("phase", ["before", "after"])
def test_attributes_of_agents_are_those_of_their_games(phase, rule, attributes):
    with build([OUT, BACK], {"red": decide}) as ctx:
        ctx.game.on_illegal = "stay"
        ctx.game.publish(alarm=0)
        for name, value in attributes.items():
            for agent in ctx.agent.create_iter():
                setattr(agent, name, value if name == "rank" else [*value])
        before = deepcopy([vars(agent) for agent in ctx.agent.create_iter()])
        ctx.game.add(rule, phase=phase)
        check(ctx, seeds=[1, 2, 3, 4])
        assert [vars(agent) for agent in ctx.agent.create_iter()] == before


def attend(state):
    """Decide by all that sensors show."""
    memory = state["memory"]
    memory["asked"] = memory.get("asked", 0) + 1
    known = [state["sensor"], state["blocked"], memory["asked"], state["draw"].below(3)]
    state["action"] = state["legal"][zlib.crc32(repr(known).encode()) % len(state["legal"])]


def on_streets(kind):
    """Return a kind of sensor as it is on streets that are ten times as long."""
    scaled = {name: 10 * kind[name] for name in ("sensor_range", "position_noise_m") if name in kind}
    others = {"exclude": ["red"]} if "exclude" in kind else {}
    places = {"at": (20.0, 20.0)} if type(kind.get("at")) is tuple else {}
    return {**kind, **scaled, **others, **places}


def open_with_sensors(sensors, way):
    settings, speeds = WAYS[way] if way else ({}, [None])
    one = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": [*sensors]}
    game = scene([TAG], teams={"red": one, "blue": one}, sensors=sensors)
    ctx = game.build(seed=1, strategies={"red": attend, "blue": attend})
    for name, value in settings.items():
        setattr(ctx.game, name, value)
    for number, agent in enumerate(ctx.agent.create_iter()):
        agent.speed = speeds[number % len(speeds)]
    return ctx


@pytest.mark.parametrize("numbers", [[0, 2, 3], [4, 5], [8], [12, 13], [15], [18, 14]])
def test_what_any_sensor_shows_is_observed_between_turns(numbers):
    sensors = {f"eye {number}": on_streets(KINDS[number]) for number in numbers}
    with open_with_sensors(sensors, None) as ctx, ctx.game.batch(seeds=[1, 2, 3]) as games:
        for _ in range(4):
            games.step()
            view = games.observe("red")
            for number in range(3):
                shown = games.context(number).game.observation("red_1")["sensor"]
                for name in sensors:
                    kind, data = shown[name]
                    if hasattr(view["sensor"][name], "others"):
                        mask = view["sensor"][name].mask[number, 1]
                        assert {view.roster.names[i] for i in np.flatnonzero(mask)} == {*data}, (kind, name)
                    else:
                        nodes = np.flatnonzero(view["sensor"][name].mask[number, 1])
                        known = data["nodes"] if isinstance(data, dict) else data
                        assert {*view.streets.ids(nodes).tolist()} == {*known}, (kind, name)
        assert games.detached == {}


class Compass:
    """A sensor of a program, which derives from nothing."""

    sensor_id, type = "compass", SensorType.CUSTOM

    def __init__(self):
        self.data, self.owner = None, None

    def sense(self, node_id):
        self.data = [node_id, self.owner]

    def update(self, data):
        pass

    def set_owner(self, owner):
        self.owner = owner


@pytest.mark.parametrize("way", [None, "several edges", "metres"])
def test_sensors_of_programs_are_asked_in_the_game_of_their_agent(way):
    def log(node_id, agent):
        return [node_id, agent.name, agent.prev_node_id, agent.edge, agent.xy, agent.alive]

    with open_with_sensors({"near": {"type": "NEIGHBOR"}}, way) as ctx:
        for agent in ctx.agent.create_iter():
            agent.register_sensor("log", ctx.sensor.from_function(f"log of {agent.name}", log))
            agent.register_sensor("compass", Compass())
        check(ctx, seeds=[1, 2, 3])


@pytest.mark.parametrize("phase", ["before", "after"])
def test_an_observation_has_the_memory_of_the_agent_in_its_game(phase):
    def remember(state):
        state["memory"]["at"] = state["curr_pos"]
        state["action"] = state["draw"].choice(state["legal"])

    def tell_memories(ctx):
        known = [dict(ctx.game.observation(agent)["memory"]) for agent in ctx.game.agents]
        ctx.game.emit("known", memories=known)

    with scene().build(seed=1, strategies={"red": remember, "blue": remember}) as ctx:
        ctx.game.add(tell_memories, phase=phase)
        ctx.game.step()
        check(ctx)
