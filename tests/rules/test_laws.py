"""Laws that all rules keep: the order of creation never counts, and what they remember is in one place."""

from copy import deepcopy

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.rules import (
    capture_flag,
    contacts,
    cooldown,
    discover,
    hold,
    last_team,
    one_to_one,
    payoff,
    reach,
    resource,
    respawn,
    tag,
    territory,
    time_limit,
)
from gamms.strategies import random_walk

LAWS = settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow])
SIDE = 4


def freeze(ctx, tagger, tagged):
    ctx.game.data.setdefault("frozen", {})[tagged.name] = ctx.game.turn
    ctx.game.scores[tagger.name] += 1


def meet(ctx):
    """A rule of a caller's own."""
    for contact in one_to_one(contacts(ctx, lambda agent: agent.team != "red", "red", hops=1)):
        ctx.game.emit("met", who=list(contact[:2]), apart=contact.distance)


GAMES = {
    "tag": lambda: [tag("red", "blue", mutual=True), time_limit(9)],
    "tag from afar": lambda: [tag("red", "blue", metres=20, then=freeze), tag("blue", "red", euclid=10.0)],
    "elimination": lambda: [tag("red", "blue", hops=1, then="eliminate", air=True), last_team(), meet],
    "race": lambda: [tag("red", "blue"), reach({"red": "starts of blue", "blue": [15, 11]}, score=2)],
    "flags": lambda: [
        territory.published({node: "red" if node < 8 else "blue" for node in range(SIDE**2)}),
        tag("red", "blue", territory="territory", mutual=True),
        capture_flag({"red": 1, "blue": 14}, territory="territory", goal=3),
    ],
    "places": lambda: [hold([5, 6, 9, 10], 2, score=1, ends=False), discover({0: "flag", 15: "decoy"}, score=3)],
    "resources": lambda: [
        resource("fuel", 90, per_metre=1, per_deed={"shout": 5}, recharge={5: 20, 6: 20}),
        resource("water", 4, per_turn=1, recharge={0: 2, 15: 2}, empty="eliminate", teams=["red", "blue"]),
        cooldown("shout", 2),
        respawn(2, times=2),
    ],
    "pay-offs": lambda: [
        *(tag("red", "blue", then="eliminate", mutual=True, score=0), respawn()),
        payoff({"tag": {"agent": 2, "other": -1}, "eliminated": {"agent": -1}}, zero_sum=True),
    ],
    "flags at home": lambda: [capture_flag({"red": 5, "blue": 10}, goal=None), tag("red", "blue", then="eliminate")],
}


def shouting(state):
    random_walk(state)
    if "deeds" in state and isinstance(state["action"], int) and state["draw"].random() < 0.5:
        state["action"] = {"node_id": state["action"], "do": {"shout": None}}


def open_game(rules, agents, seed=3):
    """Agents `(team, node)` by name; all walk about at random."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}, game={"deeds": {"shout": None}})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIDE, SIDE))
    for team in ("red", "blue", "green"):
        ctx.agent.create_team(team, [])  # some games have no agents of a team
    for name, (team, node) in agents.items():
        speed = {"0": 2, "1": 1.5, "2": 0.5}.get(name[-1])
        kind = {"type": AgentType.AERIAL, "speed": 8.0} if name.startswith("drone") else {"speed": speed}
        ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=shouting, **kind)
    for rule in rules:
        ctx.game.add(rule)
    return ctx


def played(rules, agents, conflicts=None, **keywords):
    with open_game(rules, agents, **keywords) as ctx:
        ctx.game.conflicts = conflicts
        return ctx.game.run(9)


places = st.lists(
    st.tuples(st.sampled_from(["red", "blue", "green", None]), st.integers(0, SIDE**2 - 1)), min_size=2, max_size=9
)


@pytest.mark.parametrize("game", GAMES)
@LAWS
@given(places=places, shuffled=st.randoms(use_true_random=False), drones=st.integers(0, 2))
def test_any_order_of_creation_gives_the_same_result(game, places, shuffled, drones):
    agents = {f"drone{i}" if i < drones else f"agent{i}": place for i, place in enumerate(places)}
    order = list(agents)
    shuffled.shuffle(order)
    expected = played(GAMES[game](), agents)
    assert played(GAMES[game](), {name: agents[name] for name in order}) == expected


@pytest.mark.parametrize("game", GAMES)
@LAWS
@given(places=places)
def test_a_game_that_is_played_again_is_the_same_and_so_is_one_with_the_same_rules(game, places):
    agents = {f"agent{i}": place for i, place in enumerate(places)}
    rules = GAMES[game]()
    with open_game(rules, agents) as ctx:
        begun = deepcopy(ctx.game.data)
        first = ctx.game.run(9)
        ctx.game.reset()
        assert ctx.game.data == begun
        assert ctx.game.run(9) == first
        ctx.game.reset(seed=8)
        other = ctx.game.run(9)
    assert played(rules, agents) == first  # they were used before, in another context
    assert played(GAMES[game](), agents, seed=8) == other


@LAWS
@given(places=places, shuffled=st.randoms(use_true_random=False))
def test_the_order_in_which_rules_that_refuse_count_and_end_games_are_added_never_counts(places, shuffled):
    rules = [
        *(hold(node, 2, score=1, key=f"hill {node}") for node in range(0, SIDE**2, 3)),
        *(resource("fuel", 90, per_metre=1, empty="eliminate"), cooldown("shout", 2)),
        *(tag("red", "blue", then="eliminate", score=3), tag("blue", "red", then="eliminate"), respawn(2, times=3)),
        *(discover({0: "flag", 15: "decoy"}, score=2), payoff({"tag": {"agent": 3, "other": -3}}, key="more")),
        *(reach({"red": 15, "blue": 0}), last_team(), time_limit(8, "blue"), time_limit(8)),
        payoff({"empty": {"agent": -1}, "hold": {"team": 2}}, zero_sum=True),
    ]
    agents = {f"agent{i}": place for i, place in enumerate(places)}
    expected = played(rules, agents)
    shuffled.shuffle(rules)
    one = played(rules, agents)
    for result in (expected, one):
        result.events.sort(key=str)  # of one turn, they are in the order of the rules
    assert one == expected


@pytest.mark.parametrize("game", GAMES)
def test_two_games_that_take_turns_with_the_same_rules_do_not_notice_each_other(game):
    agents = {f"agent{i}": (["red", "blue"][i % 2], 3 * i) for i in range(6)}
    rules = GAMES[game]()
    expected = [played(rules, agents, seed=seed) for seed in (1, 2)]
    with open_game(rules, agents, seed=1) as one, open_game(rules, agents, seed=2) as two:
        for _ in range(9):
            results = [one.game.run(1), two.game.run(1)]
        assert results == expected
