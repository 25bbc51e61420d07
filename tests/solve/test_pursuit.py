"""Pursuits in turns end as a NumPy program, the general solver and played games say."""

import sys
from itertools import product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solved_games import GRAPHS, PURSUIT
from solved_games import pursuit as pursuit_game

import gamms
from gamms.errors import BadType, BadValue, GammsError, TooLarge, UnknownName
from gamms.game.plan import find_first_called
from gamms.limits import allowing
from gamms.solve import (
    PursuitSolution,
    TableSolution,
    cop_number,
    exact_evader,
    exact_pursuers,
    nash_conv,
    pursuit,
    solve,
)
from gamms.solve.pursuit import recognize_pursuit
from gamms.solve.solution import make_setup, solve_table
from gamms.strategies import chase, random_walk, stay

pursuits = sys.modules["gamms.solve.pursuit"]  # the package has a function of this name
DISCOUNT = 0.5  # of the program below, so that values tell the number of turns, and are exact
FIRST = ("pursuers", "evader")
RANDOM = {"random 1", "random 4", "random 6"}


def program(graph, pursuers, exits, first):
    """Return the values of all positions at the start of a turn, by places of the pursuers and then of the evader."""
    nodes = list(graph)
    ways = [[nodes.index(end) for end in {node, *graph[node]}] for node in nodes]
    size = len(nodes)
    places = np.indices((size,) * (pursuers + 1))
    is_met = (places[:-1] == places[-1]).any(axis=0)
    is_out = np.isin(places[-1], [nodes.index(node) for node in exits])

    def after_pursuers(values):
        for axis in range(pursuers):
            values = np.stack([values.take(ways[row], axis).max(axis) for row in range(size)], axis)
        return values

    def after_evader(values):
        return np.stack([values[..., ways[row]].min(-1) for row in range(size)], -1)

    halves = [after_pursuers, after_evader] if first == "pursuers" else [after_evader, after_pursuers]
    values = np.zeros(is_met.shape)
    while True:
        later = np.where(is_met, 1.0, np.where(is_out, -1.0, DISCOUNT * values))
        new = halves[0](np.where(is_met, 1.0, halves[1](later)))
        if np.array_equal(new, values):
            return values
        values = new


def turns_of(value):
    """The number of turns after which a position of this value ends."""
    return 1 + round(np.log(abs(value)) / np.log(DISCOUNT))


def check(graph, pursuers, exits, first, positions):
    """Check that a solution has the outcomes of the program."""
    solution = pursuit(graph, pursuers=pursuers, exits=exits, moves_first=first)
    values = program(graph, pursuers, exits, first)
    nodes = list(graph)
    for position in positions:
        start = {f"pursuer_{number}": nodes[row] for number, row in enumerate(position[:-1])}
        start["evader"] = nodes[position[-1]]
        value = values[tuple(position)]
        assert solution.value_at(start) == np.sign(value), (position, value)
        is_met = position[-1] in position[:-1]
        assert solution.captures(start) == ((0 if is_met else turns_of(value)) if value > 0 else None)
        assert solution.escapes(start) == (turns_of(value) if value < 0 else None)


@st.composite
def graphs(draw):
    """Return a graph of up to six nodes, directed or not, perhaps in several parts."""
    nodes = draw(st.integers(1, 6))
    pairs = st.tuples(st.integers(0, nodes - 1), st.integers(0, nodes - 1))
    graph = draw(st.sampled_from([nx.Graph, nx.DiGraph, nx.MultiDiGraph]))()
    graph.add_nodes_from(range(nodes))
    graph.add_edges_from(draw(st.lists(pairs, max_size=14)))
    return graph


@given(graphs(), st.integers(1, 3), st.data(), st.sampled_from(FIRST))
def test_all_positions_on_small_graphs_end_as_the_program_says(graph, pursuers, data, first):
    exits = data.draw(st.lists(st.sampled_from(list(graph)), max_size=len(graph) - 1, unique=True))
    check(graph, pursuers, exits, first, product(range(len(graph)), repeat=pursuers + 1))


@pytest.mark.parametrize("first", FIRST)
@pytest.mark.parametrize("exits", [(), [(0, 0), (5, 2)]])
def test_positions_of_a_street_grid_end_as_the_program_says(first, exits):
    graph = nx.grid_2d_graph(6, 5)
    graph.remove_edges_from([((1, 1), (1, 2)), ((3, 2), (4, 2)), ((2, 4), (3, 4))])
    positions = np.random.default_rng(5).integers(0, len(graph), (500, 3))
    check(graph, 2, exits, first, positions.tolist())


@pytest.mark.parametrize(
    ("graph", "number"),
    [
        (nx.path_graph(1), 1),
        (nx.balanced_tree(2, 3), 1),
        (nx.complete_graph(5), 1),
        (nx.wheel_graph(7), 1),
        (nx.cycle_graph(7), 2),
        (nx.grid_2d_graph(3, 4), 2),
        (nx.icosahedral_graph(), 2),
        (nx.petersen_graph(), 3),
        (nx.heawood_graph(), 3),
        (nx.dodecahedral_graph(), 3),
        (nx.empty_graph(2), 2),
        (nx.hoffman_singleton_graph(), None),
    ],
)
def test_cop_numbers_are_those_of_the_literature(graph, number):
    assert cop_number(graph, most=2 if number is None else 3) == number


def test_a_placement_of_the_pursuers_wins_against_all_answers_of_the_evader():
    solution = pursuit(nx.cycle_graph(8), pursuers=2)
    assert (solution.value, solution.captures()) == (1.0, 2)
    assert solution.value_at({}) == min(solution.values("evader").values())
    assert pursuit(nx.cycle_graph(8)).captures() is None
    assert pursuit(nx.cycle_graph(3), exits=[1]).start["evader"] != 1


def played_by(cops, robber, first, exits=(), graph="random 4", **more):
    """A game of cops and a robber in turns, who know all."""
    order = [["cops"], ["robbers"]] if first == "pursuers" else [["robbers"], ["cops"]]
    reach = {"rule": "reach", "with": {"team": "robbers", "nodes": list(exits)}}
    rules = [PURSUIT[0], reach, *PURSUIT[1:]] if exits else PURSUIT
    settings = {"order": order, "information": "full"}
    return pursuit_game(graph, cops, [robber], settings=settings, **more).replace(rules=rules)


GAMES = st.tuples(
    st.sampled_from(sorted(RANDOM | {"square", "path", "cycle", "star", "fan", "one way", "parts"})),
    st.lists(st.integers(0, 3), min_size=1, max_size=2),
    st.integers(0, 3),
    st.sampled_from(FIRST),
    st.sampled_from([(), (3,), (0, 2)]),
)


@given(
    GAMES,
    st.sampled_from([None, 1, 3]),
    st.sampled_from([1.0, 0.5]),
    st.sampled_from(["cops", "robbers"]),
    st.sampled_from(["win", "score"]),
)
def test_a_scenario_has_the_values_of_the_general_solver(game, turns, discount, team, reward):
    graph, cops, robber, first, exits = game
    scenario = played_by(cops, robber, first, exits, graph).replace(max_turns=turns)
    if exits:
        scenario = scenario.replace(**{"rules.1.with.score": 2})
    by_places = solve(scenario, team=team, reward=reward, discount=discount)
    teams = (team, "robbers" if team == "cops" else "cops")
    setup = make_setup(scenario, teams, {}, turns=None, seed=None, max_states=100_000)
    try:
        general = solve_table(setup, reward, discount, team)
    except BadValue:
        assert by_places.value == 0  # no side can win
        return
    assert isinstance(by_places, PursuitSolution)
    assert isinstance(general, TableSolution)
    assert by_places.value == general.value
    assert by_places.sees == general.sees
    table = general.table
    for state in np.flatnonzero(table.level == 0 if turns else np.diff(table.offsets) > 0).tolist():
        places = dict(zip(table.roster.names, table.nodes[state].tolist(), strict=True))
        assert by_places.value_at(places) == general.value_at(places), places


@given(GAMES)
def test_exact_play_against_exact_play_takes_as_many_turns_as_the_solution_says(game):
    graph, cops, robber, first, exits = game
    scenario = played_by(cops, robber, first, exits, graph, turns=30)
    solution = pursuit(GRAPHS[graph], pursuers=len(cops), exits=exits, moves_first=first)
    start = {**{f"pursuer_{number}": node for number, node in enumerate(cops)}, "evader": robber}
    both = {"cops": solution.strategy("pursuers"), "robbers": solution.strategy("evader")}
    result = scenario.play(strategies=both)
    caught, escaped = solution.captures(start), solution.escapes(start)
    if caught is not None:
        assert (result.winner, result.turns) == ("cops", max(1, caught))
    elif escaped is not None:
        assert (result.winner, result.turns) == ("robbers", escaped)
    else:
        assert (result.winner, result.turns) == (None, 30)
    with scenario.batch(2, strategies=both) as games:
        games.run(warn=False)
        assert find_first_called(games.game, games.roster) is None
        assert games.result(0) == scenario.play(games.seeds[0], both)


def test_exact_agents_solve_each_map_of_a_batch_once(monkeypatch):
    exits = {"exits": [0]}
    scenario = played_by([5, 2], 3, "pursuers", exits["exits"]).replace(
        map={"grid": {"rows": 3, "columns": 3}}, max_turns=9
    )
    for team, name in (("cops", "exact_pursuers"), ("robbers", "exact_evader")):
        plays = {"function": f"gamms.solve:{name}", "with": exits}
        scenario = scenario.replace(**{f"teams.{team}.strategy": plays})
    maps = [{"grid": {"rows": 3, "columns": 3}}, {"grid": {"rows": 2, "columns": 5}}]
    solved_maps = []
    find = pursuits.PursuitTable._find
    monkeypatch.setattr(pursuits.PursuitTable, "_find", lambda *args: solved_maps.append(args) or find(*args))
    with scenario.batch(8, maps=maps) as games:
        games.run(warn=False)
        assert (find_first_called(games.game, games.roster), len(solved_maps)) == (None, 2)
        for number in range(8):
            of_map = scenario.replace(map=maps[games.maps[number]])
            with of_map.build() as ctx:
                solution = pursuit(ctx.graph, pursuers=2, **exits)
            start = {"pursuer_0": 5, "pursuer_1": 2, "evader": 3}
            ends = [one for one in (solution.captures(start), solution.escapes(start)) if one is not None]
            assert games.turn[number] == (ends or [9])[0]
            assert games.result(number) == of_map.play(games.seeds[number])


def test_exact_agents_refuse_games_that_are_not_in_turns():
    scenario = played_by([0], 3, "pursuers", graph="path", turns=2)
    with pytest.raises(BadValue, match=r"ctx\.game\.order is \(\)"):
        scenario.replace(**{"settings.order": None}).play(strategies={"cops": exact_pursuers, "robbers": stay})
    with pytest.raises(BadValue, match="has 1 and 2"):
        two = {"agents": [{"name": "ann", "node": 3}, {"name": "ben", "node": 2}]}
        scenario.replace(**{"teams.robbers": two}).play(strategies={"cops": stay, "robbers": exact_evader})


@pytest.mark.parametrize("robbers", [stay, chase, random_walk, gamms.strategies.flee])
def test_exact_pursuers_need_no_more_turns_against_other_evaders(robbers):
    scenario = played_by([0, 1], 24, "pursuers").replace(map={"grid": {"rows": 5, "columns": 5}})
    solution = solve(scenario, reward="win", team="cops")
    result = scenario.play(strategies={"cops": solution.strategy(), "robbers": robbers})
    assert result.winner == "cops"
    assert result.turns <= solution.captures()


def test_a_pursuer_that_cannot_win_comes_near_and_an_evader_that_cannot_lose_stays_away():
    graph = nx.cycle_graph(8)
    solution = pursuit(graph)
    assert solution.policy("pursuers", {"pursuer_0": 0, "evader": 3})[0].nodes == {"pursuer_0": 1}
    assert solution.policy("evader", {"pursuer_0": 0, "evader": 3})[0].nodes == {"evader": 4}


def test_a_solution_of_a_scenario_is_exact_and_has_no_gain_by_best_responses():
    scenario = played_by([0], 3, "pursuers", graph="path", turns=6)
    solution = solve(scenario, reward="win", team="cops")
    assert (solution.value, solution.bound, solution.is_exact, solution.error) == (1.0, "exact", True, 0.0)
    assert solution.captures() == 4
    assert solution.value_at({}, turn=3) == 0.0  # three turns are left
    assert solution.value_at({"robber_0": 1}, turn=5) == 1.0
    assert solution.nash_conv() == 0.0
    assert solution.exploitability({"cops": stay}) == 0.5
    assert nash_conv(scenario, {team: solution.strategy(team) for team in ("cops", "robbers")}, reward="win") == 0.0
    assert len(solution.table) == len(
        solve_table(
            make_setup(scenario, ("cops", "robbers"), {}, turns=None, seed=None, max_states=1000), "win", 1.0, "cops"
        ).table
    )


EYES = {"eyes": {"type": "AGENT"}}


@pytest.mark.parametrize(
    ("changes", "is_pursuit"),
    [
        ({}, True),
        ({"settings.information": "private"}, False),
        (
            {
                "settings.information": "private",
                "sensors": EYES,
                **{f"teams.{t}.sensors": ["eyes"] for t in ("cops", "robbers")},
            },
            True,
        ),
        ({"settings.information": "private", "sensors": EYES, "teams.cops.sensors": ["eyes"]}, False),
        ({"settings.order": None}, False),
        ({"settings.legal": "any"}, False),
        ({"rules.0.with.hops": 1}, False),
        ({"rules.0.with.passing": False}, False),
        ({"rules.0.with.then": "respawn"}, False),
        ({"rules.0.with.mutual": True}, False),
        ({"rules.1": {"rule": "none_left", "with": {"team": "robbers"}}}, True),
        ({"rules.1": {"rule": "none_left", "with": {"team": "robbers", "winner": "robbers"}}}, False),
        ({"rules": [*PURSUIT, {"rule": "none_left", "with": {"team": "robbers", "winner": "robbers"}}]}, False),
        ({"rules": PURSUIT[:1]}, False),
        ({"rules": [*PURSUIT, {"rule": "time_limit", "with": {"turns": 5, "winner": "robbers"}}]}, False),
        ({"rules": [{"rule": "reach", "with": {"team": "robbers", "nodes": [4]}}, *PURSUIT]}, False),
        ({"rules": [*PURSUIT, {"rule": "reach", "with": {"team": "cops", "nodes": [4]}}]}, False),
        ({"rules": [*PURSUIT, "solved_games:nothing"]}, False),
        ({"teams.robbers.agents": [{"name": "robbers_0", "node": 3}, {"name": "robbers_1", "node": 2}]}, False),
        ({"teams.cops.agents": [{"name": "cops_0", "node": 0, "speed": 2}]}, False),
    ],
)
def test_only_pursuits_in_turns_with_full_sight_are_recognized(changes, is_pursuit):
    scenario = played_by([0], 3, "pursuers", graph="path", turns=4).replace(**changes)
    setup = make_setup(scenario, ("cops", "robbers"), {}, turns=None, seed=None, max_states=1000)
    assert (recognize_pursuit(setup, "win", 1.0) is not None) == is_pursuit
    assert recognize_pursuit(setup, "turns", 1.0) is None


def test_what_cannot_be_solved_or_played_is_refused_by_name():
    graph = nx.path_graph(5)
    with pytest.raises(BadType, match=r"networkx graph or ctx\.graph, not 'street'"):
        pursuit("street")
    with pytest.raises(BadValue, match="no nodes"):
        cop_number(nx.Graph())
    with pytest.raises(BadValue, match="pursuers"):
        pursuit(graph, pursuers=0)
    with pytest.raises(BadValue, match="moves_first"):
        pursuit(graph, moves_first="evaders")
    with pytest.raises(UnknownName, match="node 9"):
        pursuit(graph, exits=[9])
    with pytest.raises(BadType, match="exits must be several nodes"):
        pursuit(graph, exits=3)
    with pytest.raises(BadValue, match="All nodes are exits"):
        pursuit(graph, exits=range(5))
    with allowing("1M"), pytest.raises(TooLarge, match="5 pursuers on 30 nodes"):
        pursuit(nx.path_graph(30), pursuers=5)
    solution = pursuit(graph)
    with pytest.raises(UnknownName, match="agent 'cop'"):
        solution.captures({"cop": 3})
    with pytest.raises(UnknownName, match="node 7"):
        solution.value_at({"evader": 7})
    with pytest.raises(BadValue, match="is over without this agent"):
        solution.value_at({"evader": None})
    with pytest.raises(UnknownName, match="team"):
        solution.strategy("cops")
    with pytest.raises(BadValue, match="no table"):
        solution.table  # noqa: B018 - it is explored when it is read
    with pytest.raises(BadValue, match="no best responses"):
        solution.nash_conv()
    cops = {"cops": solution.strategy("pursuers"), "robbers": stay}
    with pytest.raises(BadValue, match="pursuers=2"):
        played_by([0, 1], 3, "pursuers", graph="path", turns=2).play(strategies=cops)
    with pytest.raises(BadValue, match=r"moves_first='pursuers', and ctx\.game\.order"):
        played_by([0], 3, "evader", graph="path", turns=2).play(strategies=cops)
    with pytest.raises(GammsError, match="another map, of 5 nodes"):
        played_by([0], 3, "pursuers", graph="star", turns=2).play(strategies=cops)


def test_labels_of_networkx_are_found_on_the_map_of_a_game():
    graph = nx.relabel_nodes(nx.path_graph(4), dict(enumerate("abcd")))
    nx.set_node_attributes(graph, {label: {"x": float(x), "y": 0.0} for x, label in enumerate(graph)})
    solution = pursuit(graph)
    ctx = gamms.create_context(seed=1, game={"order": [["cops"], ["robbers"]]})
    ctx.graph.attach_networkx_graph(graph)
    nodes = ctx.graph.networkx_labels()
    ctx.agent.create_agent("cop", start_node_id=nodes["a"], team="cops", strategy=solution.strategy("pursuers")(ctx))
    ctx.agent.create_agent(
        "robber", start_node_id=nodes["c"], team="robbers", strategy=solution.strategy("evader")(ctx)
    )
    ctx.game.step()
    assert [one.current_node_id for one in ctx.game.agents] == [nodes["b"], nodes["d"]]
    ctx.terminate()
