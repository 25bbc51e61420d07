"""The checks of rules and strategies: they pass what plays fair and say what does not."""

import asyncio
import functools
import itertools
import random
import types

import numpy as np
import pytest

import gamms
from gamms.game.hidden_state import HiddenState
from gamms.rules import Conflicts, capture_flag, contacts, last_team, reach, tag, territory, time_limit
from gamms.sensor import SensorType
from gamms.strategies import (
    assign,
    chase,
    first,
    flee,
    follow_belief,
    follow_path,
    goto,
    guard,
    intercept,
    mix,
    patrol,
    random_walk,
    random_waypoints,
    safest_exit,
    stay,
    sweep,
    unblock,
)
from gamms.testing import check_rule, check_strategy

AGENTS = {
    f"{team}{i}": (team, node)
    for team, nodes in (("red", (0, 1, 2)), ("blue", (6, 7, 8)))
    for i, node in enumerate(nodes)
}


def make_ctx(shuffled=None, strategy=random_walk):
    ctx = gamms.create_context(seed=2, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    names = list(AGENTS)
    if shuffled is not None:
        random.Random(shuffled).shuffle(names)
    for name in names:
        team, node = AGENTS[name]
        eyes = ctx.sensor.create_sensor(f"eyes of {name}", SensorType.AGENT_RANGE, sensor_range=15.0)
        ctx.agent.create_agent(name, start_node_id=node, team=team, sensors={"eyes": eyes}, strategy=strategy)
    ctx.game.publish(post=4, posts=[0, 4])
    return ctx


WEST = {node: "red" if node < 4 else "blue" for node in range(9)}


@pytest.mark.parametrize(
    "rule",
    [
        tag("red", "blue", mutual=True),
        tag("red", "blue", hops=1, then="eliminate"),
        tag("red", "blue", metres=10, territory=WEST, mutual=True),
        reach({"red": "starts of blue", "blue": "starts of red"}),
        capture_flag({"red": 0, "blue": 8}, territory=WEST, goal=3),
        capture_flag({"red": 0, "blue": 8}),
        time_limit(5),
        last_team(),
        territory.published(WEST),
    ],
)
def test_shipped_rules_play_fair(rule):
    check_rule(rule, make_ctx, turns=15)


def count(ctx):
    """A rule that respawns one agent in every third turn, and remembers where it should."""
    data = ctx.game.data.setdefault("count", {"turns": 0})
    data["turns"] += 1
    if data["turns"] % 3 == 0:
        ctx.game.respawn("red0")


def test_a_rule_of_ones_own_may_play_fair():
    check_rule(count, make_ctx)
    check_rule(count, lambda: make_ctx())  # noqa: PLW0108 - without `shuffled`, its order is not looked at


def counting(counter, every):
    def rule(ctx):
        if next(counter) % every == 0:
            ctx.game.respawn("red0")

    return rule


def test_a_rule_that_remembers_elsewhere_is_found():
    with pytest.raises(
        AssertionError, match=r"reset and played again went differently: after turn \d+.*ctx\.game\.data"
    ):
        check_rule(counting(itertools.count(), 7), make_ctx)


def test_a_rule_that_forgets_with_the_turns_but_not_with_the_game_is_found():
    seen = set()

    def once_per_context(ctx):
        if id(ctx.game) not in seen and len(seen) < 2 and ctx.game.turn == 3:
            ctx.game.emit("welcome")
        if ctx.game.turn == 30:
            seen.add(id(ctx.game))

    with pytest.raises(AssertionError, match="went differently: its events"):
        check_rule(once_per_context, make_ctx)


def test_a_rule_that_mixes_games_up_is_found():
    last = {}

    def rule(ctx):
        if ctx.game.turn == 1:
            last.clear()
        before = last.get("node")
        last["node"] = ctx.agent.get_agent("blue0").current_node_id
        if before == last["node"]:
            ctx.game.respawn("red0")
        ctx.game.scores["calls"] = last["calls"] = last.get("calls", 0) + 1

    with pytest.raises(AssertionError, match="takes turns with another one"):
        check_rule(rule, make_ctx)


def test_a_rule_with_a_dice_of_its_own_is_found():
    dice = np.random.default_rng()

    def rule(ctx):
        ctx.game.emit("dice", value=float(dice.random()))

    with pytest.raises(AssertionError, match=r"draw from ctx\.stream"):
        check_rule(rule, make_ctx)


def test_a_rule_that_prefers_who_was_created_first_is_found():
    def rule(ctx):
        for agent in ctx.agent.create_iter():
            if agent.team == "red":
                ctx.game.respawn(agent)
                return

    with pytest.raises(AssertionError, match=r"created in another order \(shuffled=1\).*ctx\.game\.agents"):
        check_rule(rule, make_ctx)
    check_rule(rule, lambda: make_ctx())  # noqa: PLW0108 - as above


def test_a_rule_that_remembers_agents_is_found():
    def rule(ctx):
        for contact in contacts(ctx, "red", "blue"):
            ctx.game.data.setdefault("met", []).append(ctx.agent.get_agent(contact.a))

    with pytest.raises(AssertionError, match=r"plain values only; ctx\.game\.data\['met'\]\[0\] is of type Agent"):
        check_rule(rule, make_ctx)


def test_a_game_that_is_not_the_same_itself_is_named():
    dice = random.Random()

    def whim(state):
        state["action"] = dice.choice(state["legal"])

    with pytest.raises(AssertionError, match="make_ctx must always make the same game"):
        check_rule(count, lambda: make_ctx(strategy=whim))
    with pytest.raises(AssertionError, match="give its context a seed"):
        check_rule(count, gamms.create_context)


# -- strategies -------------------------------------------------------------------------------------------------------

SHIPPED = {
    "stay": lambda _: stay,
    "random_walk": lambda _: random_walk,
    "goto": lambda ctx: goto(ctx, 8),
    "follow_path": lambda ctx: follow_path(ctx, [4, 8, 0], repeat=True),
    "patrol": lambda ctx: patrol(ctx, [0, 8]),
    "chase": chase,
    "flee": flee,
    "guard": lambda ctx: guard(ctx, 4, 10.0),
    "intercept": intercept,
    "intercept with goals": lambda ctx: intercept(ctx, [0, 2]),
    "assign": assign,
    "safest_exit": lambda ctx: safest_exit(ctx, [0, 2]),
    "sweep": lambda ctx: sweep(ctx, repeat=True),
    "random_waypoints": lambda ctx: random_waypoints(ctx, pause=1),
    "unblock": lambda ctx: unblock(chase(ctx)),
    "follow_belief": follow_belief,
    "mixed": lambda ctx: first(chase(ctx, otherwise=None), mix(0.5, patrol(ctx, [0, 8]), random_walk)),
}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_strategies_play_fair(name):
    def make():
        ctx = make_ctx()
        ctx.agent.get_agent("red0").register_strategy(SHIPPED[name](ctx))
        ctx.game.conflicts = Conflicts() if name == "unblock" else None
        return ctx

    check_strategy(None, make, "red0", turns=20)


def test_a_strategy_may_use_seeded_draws_and_change_its_sensor_data():
    def strategy(state):
        state["sensor"]["eyes"][1].clear()
        state["memory"]["turns"] = state["memory"].get("turns", 0) + 1
        state["team_memory"].setdefault("been", set()).add(state["curr_pos"])
        state["action"] = random.choice(state["legal"])

    check_strategy(strategy, make_ctx, "red0")


DICE = random.Random()  # seeded by nothing


def goes(node_of):
    def strategy(state):
        state["action"] = node_of(state)

    return strategy


def restless(counter):
    return goes(lambda state: state["legal"][next(counter) % len(state["legal"])])


@pytest.mark.parametrize(
    ("strategy", "message"),
    [
        (restless(itertools.count()), r"reset and played again, the strategy chose \d in turn \d+.*state\['memory'\]"),
        (goes(lambda state: DICE.choice(state["legal"])), r"Draw from state\['rng'\]"),
        (
            goes(lambda state: 8 if state["turn"] == 3 else state["curr_pos"]),
            r"in turn 3 .*not legal.*state\['legal'\]",
        ),
        (lambda state: None, "not legal.*was not set"),
        (lambda state: state.update(action=state["curr_pos"], turn=0), r"in turn 1 .*changed state\['turn'\] to 0"),
        (lambda state: state.update(action=state["curr_pos"], legal=[1]), r"changed state\['legal'\]"),
        (
            lambda state: state.update(action=state["curr_pos"], plan=[1]),
            r"put 'plan' into its state.*state\['memory'\]",
        ),
        (
            lambda state: state.update(action=state["curr_pos"], memory={"x": 1}),
            r"replaced or removed state\['memory'\]",
        ),
        (lambda state: state.update(action=state["curr_pos"], team_memory={}), r"removed state\['team_memory'\]"),
        (lambda state: state.update(action=state.pop("curr_pos")), r"replaced or removed state\['curr_pos'\]"),
        (lambda state: state["facts"].update(post=3), "ReadOnly: .*read-only view.*is read-only"),
        (lambda state: state["facts"]["posts"].append(3), "in turn 0 .* raised AttributeError"),
    ],
)
def test_a_strategy_that_does_not_play_fair_is_found(strategy, message):
    with pytest.raises(AssertionError, match=message):
        check_strategy(strategy, make_ctx, "red0")


def test_a_strategy_that_remembers_earlier_games_is_found():
    games = []

    def strategy(state):
        if state["turn"] == 0 and state["memory"] is not None:
            games.append(state["rng"])
        state["action"] = state["legal"][min(len(games), 3) - 1] if len(games) > 2 else state["curr_pos"]

    with pytest.raises(AssertionError, match="in a new game of the same seed"):
        check_strategy(strategy, make_ctx, "red0")


def test_a_strategy_that_remembers_turns_that_are_undone_is_found():
    asked = [0]

    def strategy(state):
        asked[0] = asked[0] + 1 if state["turn"] else 0
        state["action"] = state["legal"][asked[0] // 16 % len(state["legal"])]

    with pytest.raises(AssertionError, match="when the game is restored and played on"):
        check_strategy(strategy, make_ctx, "red0")


def test_a_strategy_that_changes_the_world_is_found():
    worlds = []

    def make():
        worlds.append(make_ctx())
        return worlds[-1]

    def strategy(state):
        worlds[-1].agent.get_agent("blue1").current_node_id = 4
        state["action"] = state["curr_pos"]

    with pytest.raises(AssertionError, match=r"'red0' may not set agent"):
        check_strategy(strategy, make, "red0")
    with make_ctx() as world, pytest.raises(AssertionError, match="a new context at every call"):
        check_strategy(stay, lambda: world, "red0")


def test_an_awaited_strategy_is_checked_too():
    async def fair(state):
        await asyncio.sleep(0)
        state["action"] = state["legal"][int(state["rng"].integers(len(state["legal"])))]

    async def unfair(state):
        await asyncio.sleep(0)
        state["action"] = DICE.choice(state["legal"])

    async def wrong(state):
        await asyncio.sleep(0)
        raise ValueError("no")

    check_strategy(fair, make_ctx, "red0")
    for strategy, message in ((unfair, r"Draw from state\['rng'\]"), (wrong, "in turn 0 .* raised ValueError: no")):
        with pytest.raises(AssertionError, match=message):
            check_strategy(strategy, make_ctx, "red0")


def test_an_agent_without_a_strategy_has_none_to_check():
    with pytest.raises(AssertionError, match="has no strategy to check"):
        check_strategy(None, lambda: make_ctx(strategy=None), "red0")
    with pytest.raises(KeyError, match="Did you mean 'red0'"):
        check_strategy(stay, make_ctx, "red00")


# -- state that a snapshot does not hold ----------------------------------------------------------------------------

SEEN = []
calls = 0


def in_a_closure():
    seen = []

    def rule(ctx):
        seen.append(ctx.game.turn)

    return rule


def in_a_number_of_a_closure():
    number = 0

    def rule(ctx):
        nonlocal number
        number += 1

    return rule


def in_a_default():
    def rule(ctx, seen={}):  # noqa: B006 - this is what is looked for
        seen[ctx.game.turn] = True

    return rule


def in_a_global():
    def rule(ctx):
        SEEN.append(ctx.game.turn)

    return rule


def in_a_global_number():
    def rule(ctx):
        global calls  # noqa: PLW0603 - this is what is looked for
        calls += 1

    return rule


class Memory:
    """Remembers turns."""

    shared = {}  # noqa: RUF012 - this is what is looked for

    def __init__(self):
        self.turns = set()
        self.notes = Notes()

    def __call__(self, ctx):
        self.turns.add(ctx.game.turn)

    def note(self, ctx):
        self.notes.last = ctx.game.turn


class Notes:
    __slots__ = ("last",)

    def __init__(self):
        self.last = None


def in_an_attribute_of_a_class():
    def rule(ctx):
        Memory.shared["turn"] = ctx.game.turn

    return rule


def in_a_function_that_it_calls():
    helper = in_a_closure()

    def rule(ctx):
        helper(ctx)

    return rule


def in_an_attribute_of_the_function():
    def rule(ctx):
        rule.turn = ctx.game.turn

    rule.turn = 0
    return rule


def in_an_argument_of_a_partial_function():
    return functools.partial(lambda seen, ctx: seen.append(ctx.game.turn), [])


def in_dice_that_it_does_not_use():
    dice = random.Random(3)

    def rule(ctx):
        dice.random()

    return rule


def in_an_iterator():
    turns = iter([*range(99)])

    def rule(ctx):
        next(turns, None)

    return rule


def in_a_cycle():
    turns = itertools.cycle("abc")

    def rule(ctx):
        next(turns)

    return rule


def in_an_array():
    counts = np.zeros((2, 2))

    def rule(ctx):
        counts[1, 0] = 7.0

    return rule


HIDDEN = [
    (in_a_closure, r"The closure variable 'seen' of rule\(\) changed from \[\] to \[[01], [12]"),
    (in_a_number_of_a_closure, r"The closure variable 'number' of rule\(\) changed from 0 to 10"),
    (in_a_default, r"The default argument 'seen' of rule\(\) changed"),
    (in_a_global, "The global variable 'SEEN' changed"),
    (in_a_global_number, r"The global variable 'calls' changed from \d+ to \d+"),
    (Memory, "The attribute 'turns' of Memory changed from set"),
    (lambda: Memory().note, "The attribute 'notes' of Memory changed"),
    (in_an_attribute_of_a_class, "The global variable 'Memory' changed"),
    (in_a_function_that_it_calls, r"The closure variable 'seen' of rule\(\) changed"),
    (in_an_attribute_of_the_function, r"The attribute 'turn' of rule\(\) changed from 0 to (9|10)"),
    (in_an_argument_of_a_partial_function, "The argument 0 of a partial function changed"),
    (in_dice_that_it_does_not_use, r"The closure variable 'dice' of rule\(\) changed in the game"),
    (in_an_iterator, r"The closure variable 'turns' of rule\(\) changed in the game"),
    (in_a_cycle, r"The closure variable 'turns' of rule\(\) changed in the game"),
    (in_an_array, r"The closure variable 'counts' of rule\(\) changed from array\(\[\[0\., 0.*to array\(\[\[0.*\[7"),
]


@pytest.mark.parametrize(("make_rule", "message"), HIDDEN, ids=[make.__name__ for make, _ in HIDDEN])
def test_a_rule_that_remembers_in_what_a_snapshot_does_not_hold_is_found(make_rule, message):
    with pytest.raises(AssertionError, match=rf"{message}.*Keep it in ctx\.game\.data"):
        check_rule(make_rule(), make_ctx, turns=10)


@pytest.mark.parametrize(("make_rule", "message"), HIDDEN, ids=[make.__name__ for make, _ in HIDDEN])
def test_a_strategy_that_remembers_in_what_a_snapshot_does_not_hold_is_found(make_rule, message):
    rule = make_rule()

    def strategy(state):
        rule(types.SimpleNamespace(game=types.SimpleNamespace(turn=state["turn"])))
        state["action"] = state["curr_pos"]

    with pytest.raises(AssertionError, match=rf"{message}.*Keep it in state\['memory'\]"):
        check_strategy(strategy, make_ctx, "red0", turns=10)


ITERATORS = {
    "list": lambda: iter([3, 1, 2]),
    "tuple": lambda: iter((3, 3, 3)),
    "text": lambda: iter("aaa"),
    "range": lambda: iter(range(3)),
    "values": lambda: iter({1: 2, 3: 2}.values()),
    "set": lambda: iter({1, 2}),
    "reversed": lambda: reversed([1, 1]),
    "enumerate": lambda: enumerate("aaa"),
    "zip": lambda: zip([1, 1], [2, 2], strict=True),
    "map": lambda: map(str, [1, 1]),
    "filter": lambda: filter(None, [1, 1]),
    "chain": lambda: itertools.chain([1, 1], [1]),
    "cycle": lambda: itertools.cycle([1, 1]),
    "islice": lambda: itertools.islice([1, 1], 2),
    "repeat": lambda: itertools.repeat(1, 2),
    "product": lambda: itertools.product([1, 2], [3]),
}


@pytest.mark.parametrize("make", ITERATORS.values(), ids=ITERATORS)
def test_an_iterator_is_seen_to_go_on_and_nothing_is_taken_from_it(make):
    lots, known = make(), [*itertools.islice(make(), 4)]

    def draw():
        return next(lots)

    hidden = HiddenState(draw)
    assert hidden.describe_change("Keep it.") == ""
    taken = [draw()]
    assert hidden.describe_change("Keep it.").startswith("The closure variable 'lots' of draw() changed")
    assert [*taken, *itertools.islice(lots, 3)] == known


def test_a_method_as_a_strategy_that_writes_to_its_object_is_found():
    class Raider:
        def __init__(self):
            self.target = None

        def play(self, state):
            self.target = state["action"] = state["curr_pos"]

    with pytest.raises(
        AssertionError, match=r"The attribute 'target' of Raider changed from None to 0.*state\['memory'\]"
    ):
        check_strategy(Raider().play, make_ctx, "red0")


def test_a_rule_that_an_undone_turn_changes_is_found():
    played = {}

    def rule(ctx):
        if ctx.game.turn == 1:
            played.clear()
        played[len(played)] = True
        ctx.game.scores["turns"] = len(played)

    with pytest.raises(AssertionError, match=r"another one|restored from a snapshot.*'played' of rule\(\)"):
        check_rule(rule, make_ctx)


class Map:
    def __init__(self):
        self.nodes = (1, 2)

    @functools.cached_property
    def sum(self):
        return sum(self.nodes)


def test_constants_and_caches_are_no_hidden_state():
    bases, table, places = {"red": 0}, np.arange(9), Map()

    @functools.cache
    def way(node):
        return [node, node + 1]

    def rule(ctx, far=(1, 2), names={"a": [1]}):  # noqa: B006 - it is only read
        way(places.sum + bases["red"] + int(table[1]) + len(far) + len(names) + len(AGENTS))
        ctx.game.data["turn"] = ctx.game.turn

    check_rule(rule, make_ctx)
