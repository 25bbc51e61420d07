"""Random small games of shipped rules have the values of the same games with a plain rule that does nothing.

States of the first are in the columns of a batch; those of the second are played one by one in a context. In the first,
interchangeable agents are sorted; values and strategies are those of the same games with all agents apart.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solved_games import GRAPHS, scene

from gamms.errors import BadValue
from gamms.solve import best_response, solve
from gamms.solve.solution import TableSolution, find_rewards, make_setup
from gamms.solve.stages import StateGroup, ValueIteration
from gamms.solve.table import explore
from gamms.strategies import chase, stay

TEAMS = ("red", "blue")
GRAPH_NAMES = ("pair", "square", "path", "star", "fan")


@st.composite
def pairs(draw):
    """Return a game of red and blue with shipped rules, and the same game with a plain rule that does nothing."""
    graph = draw(st.sampled_from(GRAPH_NAMES))
    nodes = st.sampled_from(sorted(GRAPHS[graph]))
    sizes = draw(st.sampled_from([(1, 1), (2, 1), (1, 2)]))
    teams = {}
    for team, size in zip(TEAMS, sizes, strict=True):
        teams[team] = {"agents": [{"name": f"{team}_{i}", "node": draw(nodes)} for i in range(size)]}
    taggers = draw(st.sampled_from(TEAMS))
    tag = {"taggers": taggers, "tagged": TEAMS[TEAMS[0] == taggers], "score": draw(st.sampled_from([1, 2.5]))}
    tag["then"] = draw(st.sampled_from(["eliminate", "respawn"]))
    tag["hops"] = draw(st.sampled_from([0, 1]))
    more = [
        "last_team",
        {"rule": "reach", "with": {"team": "red", "nodes": draw(nodes), "score": 1}},
        {"rule": "arrive", "with": {"team": "blue", "nodes": [draw(nodes)], "score": 1}},
        {"rule": "time_limit", "with": {"turns": 3, "winner": draw(st.sampled_from(TEAMS))}},
    ]
    rules = [{"rule": "tag", "with": tag}, *draw(st.lists(st.sampled_from(more), unique_by=str))]
    given = {"settings": {"order": [[taggers], [tag["tagged"]]]}} if draw(st.booleans()) else {}
    if draw(st.booleans()):
        given["conflicts"] = {"resolve": {"by_priority": draw(st.permutations(TEAMS))}}
    given["turns"] = draw(st.integers(1, 4))
    return tuple(scene(graph, teams, each, **given) for each in (rules, [*rules, "solved_games:nothing"]))


def found(game, reward, strategy):
    """Return the value of a game and its states in which it goes on; or the kind of its error, and None."""
    try:
        if strategy is None:
            solution = solve(game, reward=reward)
        else:
            solution = best_response(game, team="blue", against=strategy, reward=reward).solution
    except BadValue as error:
        return str(error).split(":")[0], None
    return round(solution.value, 9), solution.table


def positions(table, groups):
    """Return the positions from which a game goes on, with groups of agents sorted."""
    places = np.where(table.alive, table.nodes, -1)[np.diff(table.offsets) > 0]  # lots may decide who is out at the end
    for group in groups:
        places[:, group] = np.sort(places[:, group], axis=1)
    return {tuple(row) for row in places.tolist()}


@given(pairs(), st.sampled_from(["score", "win", "turns"]), st.sampled_from([None, stay, chase]))
def test_games_in_columns_have_the_values_and_positions_of_games_in_contexts(pair, reward, strategy):
    (value, table), (expected, other) = (found(game, reward, strategy) for game in pair)
    groups = () if table is None or table.sorted_agents is None else table.sorted_agents.groups
    if groups and other is None:
        assert "draws random numbers" in expected  # between agents that make no difference
        return
    assert value == expected
    assert table is other is None or positions(table, groups) == positions(other, groups)


@st.composite
def games_of_teams(draw):
    """Return a game in which some agents of red, or of blue, are interchangeable."""
    graph = draw(st.sampled_from(["pair", "square", "star", "one way"]))
    nodes = st.sampled_from(sorted(GRAPHS[graph]))
    sizes = draw(st.sampled_from([(2, 1), (1, 2), (2, 2), (3, 1)] if graph == "pair" else [(2, 1), (1, 2), (3, 1)]))
    teams = {}
    for team, size in zip(TEAMS, sizes, strict=True):
        teams[team] = {"agents": [{"name": f"{team}_{i}", "node": draw(nodes)} for i in range(size)]}
    taggers = draw(st.sampled_from(TEAMS))
    tagged = TEAMS[TEAMS[0] == taggers]
    hops = draw(st.sampled_from([0, 1]))
    rules = [{"rule": "tag", "with": {"taggers": taggers, "tagged": tagged, "hops": hops, "then": "eliminate"}}]
    rules += draw(st.sampled_from([[], ["last_team"], [{"rule": "arrive", "with": {"team": "red", "nodes": [0]}}]]))
    given = {"settings": {"order": [list(part) for part in draw(st.permutations([["red"], ["blue"]]))]}}
    return scene(graph, teams, rules, turns=draw(st.integers(1, 5)), **(given if draw(st.booleans()) else {}))


@settings(max_examples=10)
@given(games_of_teams(), st.sampled_from(["score", "turns"]))
def test_values_and_strategies_with_agents_sorted_are_those_with_agents_apart(game, reward):
    setup = make_setup(game, TEAMS, {}, turns=None, seed=None, max_states=100_000)
    try:
        apart = explore(setup, by_winner=False)
        stages = ValueIteration(apart, find_rewards(apart, reward, 1.0, "red"), 1e-9)
    except BadValue:
        return  # draws, or no points
    every, solution = TableSolution(apart, stages, "red", reward), solve(game, reward=reward)
    assert solution.table.sorted_agents is not None
    assert len(solution.table) <= len(apart)
    for state in np.flatnonzero(np.diff(apart.offsets)).tolist():
        turn = int(apart.level[state])
        places = apart.name_nodes(np.where(apart.alive[state], apart.nodes[state], -1).tolist())
        try:
            value = every.value_at(places, turn)
        except BadValue:
            continue  # agents that are out are in several places
        assert solution.value_at(places, turn) == pytest.approx(value, abs=1e-9)
        for side, team in enumerate(TEAMS):
            if apart.order * (1 - 2 * side) <= 0:
                policy = solution.policy(team, places, turn)
                assert sure(apart, stages, state, turn, side, policy) == pytest.approx(value, abs=1e-8)


def sure(table, stages, state, turn, side, policy):
    """Return the value that a policy of a team that moves first, or simultaneously, guarantees in a state."""
    rows, columns = table.sizes[state].tolist()
    grid = (table.offsets[state] + np.arange(rows * columns)).reshape(1, rows, columns)
    payoffs = stages.compute_payoffs(StateGroup(np.array([state]), grid), stages.count_turns_left(turn, side))[0]
    payoffs = payoffs if side == 0 else -payoffs.T
    number_of = {tuple(table.name_actions(state, side, one).items()): one for one in range(len(payoffs))}
    gains = [choice.share * payoffs[number_of[tuple(sorted_as(choice.nodes, number_of))]] for choice in policy]
    return (1 - 2 * side) * sum(gains).min()


def sorted_as(nodes, actions):
    """Return agent -> node as pairs, in the order in which actions name agents."""
    return [(name, nodes[name]) for name, _ in next(iter(actions))]
