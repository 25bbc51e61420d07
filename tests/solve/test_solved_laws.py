"""Random small games of shipped rules have the values of the same games with a plain rule that does nothing.

States of the first are in the columns of a batch; those of the second are played one by one in a context.
"""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from solved_games import GRAPHS, scene

from gamms.errors import BadValue
from gamms.solve import best_response, solve
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
    """Return the value of a game, and the positions from which it goes on; or the kind of its error."""
    try:
        if strategy is None:
            solution = solve(game, reward=reward)
        else:
            solution = best_response(game, team="blue", against=strategy, reward=reward).solution
    except BadValue as error:
        return str(error).split(":")[0]
    table = solution.table
    places = np.where(table.alive, table.nodes, -1)[np.diff(table.offsets) > 0]  # lots may decide who is out at the end
    return round(solution.value, 9), {tuple(row) for row in places.tolist()}


@given(pairs(), st.sampled_from(["score", "win", "turns"]), st.sampled_from([None, stay, chase]))
def test_games_in_columns_have_the_values_and_positions_of_games_in_contexts(pair, reward, strategy):
    assert found(pair[0], reward, strategy) == found(pair[1], reward, strategy)
