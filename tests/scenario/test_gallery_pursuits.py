"""Games of the gallery in which some chase, guard or look for others keep their rules."""

import math
from itertools import chain, pairwise

import networkx as nx
import numpy as np
import pytest

from gamms import belief, recorder, scenario
from gamms.rules import idleness_table

SHOWN = (3, 8, 13, 18, 24)
START = {"taxi": (10, 4), "bus": (8, 3), "underground": (4, 3), "black": (0, 5)}


class Board:
    """Follows a game of Scotland Yard by the lines that agents took, with its own board and its own tickets."""

    def __init__(self, ctx):
        lines = nx.MultiDiGraph(ctx.graph.to_networkx()).edges(data=True)
        self.lines = {data["id"]: (source, target, data["ticket"]) for source, target, data in lines}
        self.at = {name: agent.current_node_id for name, agent in ctx.agent.agents.items()}
        self.left = {(name, kind): few[name == "mr_x"] for name in self.at for kind, few in START.items()}
        self.possible, self.tickets, self.winner, self.is_caught = set(), [], None, False

    def go(self, turn, taken):
        """Follow a turn, given the line that each agent took, and where: name -> edge."""
        detectives = [name for name in self.at if name != "mr_x"]
        used = {}
        for name in [*detectives, "mr_x"]:
            if name in taken:
                source, target, used[name] = self.lines[taken[name]]
                assert self.at[name] == source
                self.at[name] = target
                self.left[name, used[name]] -= 1
                if name != "mr_x":
                    self.left["mr_x", used[name]] += 1
            if name == detectives[-1]:
                assert len({self.at[one] for one in detectives}) == len(detectives)
                self.is_caught = self.at["mr_x"] in {self.at[one] for one in detectives}
        assert min(self.left.values()) >= 0
        police = {self.at[name] for name in detectives}
        self.possible -= police
        if "mr_x" in used:
            ways = self.lines.values()
            self.possible = {b for a, b, kind in ways if kind == used["mr_x"] and a in self.possible} - police
        self.tickets.append(used.get("mr_x"))
        if turn in SHOWN:
            self.possible = {self.at["mr_x"]}
        if self.is_caught or self.at["mr_x"] in police or turn == 24:
            self.winner = (
                "mr_x" if turn == 24 and self.at["mr_x"] not in police and not self.is_caught else "detectives"
            )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_independent_referee_finds_the_tickets_the_stations_of_mr_x_and_the_winner(seed):
    with scenario.from_gallery("scotland_yard").build(seed) as ctx:
        board = Board(ctx)
        edges = sorted(board.lines)
        while not ctx.game.is_over:
            assert board.winner is None
            ctx.game.step()
            taken = [(visit.agent, visit.edge) for visit in ctx.game.visits(nodes=[], edges=edges)]
            assert len(dict(taken)) == len(taken), "one line in a turn"
            board.go(ctx.game.turn, dict(taken))
            if board.is_caught:  # before he could move
                break
            assert {name: agent.current_node_id for name, agent in ctx.agent.agents.items()} == board.at
            assert ctx.game.facts["tickets"] == tuple(board.tickets)
            assert ctx.game.facts["possible"] == tuple(sorted(board.possible))
            assert board.at["mr_x"] in board.possible or ctx.game.turn < 3 or board.winner
            for (name, kind), left in board.left.items():
                known = ctx.game.facts_of(ctx.agent.get_agent(name))
                assert known.get(f"mr_x_{kind}" if name == "mr_x" else kind, 0) == left
        assert ctx.game.is_over
        result = ctx.game.result()
    assert (result.winner, result.errors) == (board.winner, [])
    shown = [(one["turn"], one["kind"]) for one in result.events if one["kind"] == "shown"]
    assert shown == [(turn, "shown") for turn in SHOWN if turn <= result.turns]
    assert len({*board.tickets}) > 1


def test_scotland_yard_in_a_batch_is_the_game_alone():
    game = scenario.from_gallery("scotland_yard").replace(max_turns=8)
    with game.batch(2, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(2))


@pytest.mark.parametrize(("place", "winner"), [((110, 140), "intruder"), ((20, 20), "guards")])
def test_an_intruder_wins_if_no_guard_is_as_near_to_the_target(place, winner):
    with scenario.from_gallery("target_guarding").build() as ctx:
        for name, (x, y) in {"intruder_0": place, "guards_0": (60, 60), "guards_1": (180, 95)}.items():
            ctx.agent.get_agent(name).current_node_id = ctx.graph.nearest_node(x, y)
        assert ctx.game.run().winner == winner


def test_the_cops_catch_a_robber_beside_them_before_it_moves():
    with scenario.from_gallery("cops_and_robber").build() as ctx:
        node = ctx.agent.get_agent("robber").current_node_id
        ctx.agent.get_agent("cops_0").current_node_id = max(ctx.graph.distances(source=node, weight=None, cutoff=1))
        result = ctx.game.run()
    assert result.winner == "cops"
    assert [(event["turn"], event["node"]) for event in result.events if event["kind"] == "tag"] == [(1, node)]


def test_every_runner_leaves_or_is_caught_as_none_is_patient_for_ever():
    result = scenario.from_gallery("interception").play()
    assert sum(result.scores.values()) == 5
    assert result.turns > 60, "these runners have waited"


def test_hunters_in_fog_never_exclude_the_node_of_a_deer():
    with scenario.from_gallery("hunt_in_fog").replace(max_turns=30).build() as ctx:
        while not ctx.game.is_over:
            ctx.game.step()
            known = belief.belief_of(ctx, "hunters_0")
            for deer in ctx.agent.teams["deer"]:
                assert deer.current_node_id in known.reachable(deer.name) or not deer.alive


def test_saboteurs_close_bridges_alone_and_these_open_again_after_twenty_turns():
    closed_in, opened_in = {}, {}
    with scenario.from_gallery("sabotage").build() as ctx:
        bridges = {id for id in ctx.graph.get_edges() if ctx.graph.get_edge(id).length > 20}
        while not ctx.game.is_over:
            ctx.game.step()
            closed = set(ctx.graph.closed_roads)
            closed_in.update(dict.fromkeys(closed - closed_in.keys(), ctx.game.turn))
            opened_in.update(dict.fromkeys(closed_in.keys() - closed - opened_in.keys(), ctx.game.turn))
    assert closed_in.keys() <= bridges
    assert opened_in
    assert {opened_in[id] - closed_in[id] for id in opened_in} == {20}


def test_drones_find_a_hiker_but_a_robot_has_to_get_there():
    result = scenario.from_gallery("search_by_drones").play()
    (found,) = [event for event in result.events if event["kind"] == "tag"]
    assert found["agent"].startswith("robot")
    assert result.winner == "searchers"


def test_the_dog_wins_when_fifteen_sheep_are_in_the_pen():
    with scenario.from_gallery("herding").build() as ctx:
        result = ctx.game.run()
        nodes = [ctx.graph.get_node(event["node"]) for event in result.events if event["kind"] == "penned"]
    assert all(node.x**2 + (node.y - 120) ** 2 <= 35**2 for node in nodes)
    assert result.winner == "dogs"
    assert len(nodes) == result.scores["dogs"] >= 15


class Referee:
    """Follows a bomb disposal by the actions and the tracks of the agents alone, with its own clock."""

    def __init__(self, seconds, turn_seconds):
        self.full = seconds / turn_seconds
        self.left, self.doing, self.found = {}, {}, []

    def note(self, ctx):
        end = ctx.game.turn
        moves = ctx.game.internals.state.moves
        tracks = {slot.name: moves.get_track(i) for i, slot in enumerate(moves.slots)}
        tagged = {event["other"] for event in ctx.game.events if event["turn"] == end and event["kind"] == "tag"}
        for agent in ctx.agent.teams["experts"]:
            name = agent.name
            wanted = agent.state["action"]
            if isinstance(wanted, dict) and name not in self.doing:
                self.doing[name] = wanted["do"]["disarm"], end - 1
                self.found.append((name, "begun", end - 1))
            if name in self.doing:
                bomb, begun = self.doing[name]
                assert set(tracks[name].path) == {bomb}, "it stays"
                done = begun + self.left.get((name, bomb), self.full)
                arrival = end - 1 + min(self.arrival(track, bomb) for name, track in tracks.items() if "thugs" in name)
                stop = arrival if name in tagged else end + 1
                if done <= min(end, stop):
                    self.finish(name, "done", done)
                    self.left.pop((name, bomb), None)
                elif name in tagged:
                    self.left[name, bomb] = done - stop
                    self.finish(name, "interrupted", stop)

    def finish(self, name, kind, time):
        del self.doing[name]
        self.found.append((name, kind, time))

    def arrival(self, track, node):
        """When a thug comes to a node in a turn: from the distances along its roads."""
        times = [leg.until for leg in track.legs if node == (leg.target if leg.end == 1.0 else leg.source)]
        is_there = track.path == (node,) and not track.legs
        return 0.0 if is_there else min((time for time in times if time > 0), default=9.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bombs_are_disarmed_at_the_times_of_an_independent_referee(seed):
    with scenario.from_gallery("bomb_disposal").build(seed) as ctx:
        referee = Referee(45, 10)
        ctx.game.add(referee.note)
        result = ctx.game.run()
    kinds = ("begun", "done", "interrupted")
    found = [(one["agent"], one["kind"], one["time"]) for one in result.events if one["kind"] in kinds]
    assert {kind for _, kind, _ in found} == set(kinds)
    for (agent, kind, time), (other, expected, exact) in zip(sorted(found), sorted(referee.found), strict=True):
        assert (agent, kind) == (other, expected)
        assert time == pytest.approx(exact, abs=1e-9)


def test_a_bomb_disposal_of_a_batch_is_the_game_alone():
    game = scenario.from_gallery("bomb_disposal").replace(max_turns=25)
    with game.batch(2, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(2))
        assert not games.detached


def read_visits(recording, team, metres):
    """Return node -> the times in turns at which agents of a team are on it, from the positions of a recording."""
    columns = recording.graph.columns()
    place = dict(zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True))
    times = {node: [] for node in place}
    before = {}
    for state in recording:
        agents = state.agents
        for name, of, node, xy in zip(agents["name"], agents["team"], agents["node"], state.xy(), strict=True):
            if of == team and before.get(name) != node:
                back = math.dist(place[node], xy) / metres
                times[node].append(state.turn - back)
            before[name] = node
    return {node: sorted(found) for node, found in times.items()}


def test_the_idleness_of_two_patrols_is_that_of_an_independent_reading_of_the_recording(tmp_path):
    with scenario.from_gallery("two_patrols").build() as ctx:
        result = ctx.game.run(record=str(tmp_path / "patrols.ggr"))
        tables = {team: idleness_table(ctx, team) for team in ("cyclic", "random")}
    with recorder.open(tmp_path / "patrols.ggr") as recording:
        visits = {team: read_visits(recording, team, metres=14) for team in tables}
    for team, table in tables.items():
        for node, times in visits[team].items():
            gaps = [later - time for time, later in pairwise(times) if later - time > 1e-9]
            row = table["node"].tolist().index(node)
            assert table["visits"][row] == len(gaps) + 1
            average = sum(gaps) / len(gaps) if gaps else math.nan
            assert table["average"][row] == pytest.approx(average, abs=1e-9, nan_ok=True)
            assert table["worst"][row] == pytest.approx(max([*gaps, times[0], 400 - times[-1]]), abs=1e-9)
    closed_form = 36 * 40 / (3 * 14)  # T / (k v), in turns
    assert tables["cyclic"]["average"] == pytest.approx(closed_form, abs=1e-9)
    assert tables["cyclic"]["worst"] == pytest.approx(closed_form, abs=1e-9)
    for turn, score in zip(*(result.collected["worst_cyclic"][key] for key in ("turn", "value")), strict=True):
        begun = [[time for time in times if time <= turn] for times in visits["cyclic"].values()]
        idle = [max([later - time for time, later in pairwise([0, *times, turn])]) for times in begun]
        assert score == pytest.approx(10 * max(idle), abs=1e-8)
    assert (result.turns, result.winner) == (400, None)
    assert result.scores == {"random": pytest.approx(10 * tables["random"]["worst"].max(), abs=1e-8)}
    assert result.scores["random"] > 20 * closed_form


def test_two_patrols_that_are_reset_collect_what_a_game_of_that_seed_collects():
    game = scenario.from_gallery("two_patrols").replace(max_turns=25)
    with game.build(1) as ctx:
        ctx.game.collect("mine", lambda ctx: ctx.game.turn)
        for seed in (1, 2):
            ctx.game.reset(seed)
            result = ctx.game.run()
            assert result.collected.pop("mine")["value"] == list(range(1, 26))
            assert result.collected == game.play(seed=seed).collected
            assert result.collected["worst_random"]["turn"] == [10, 20]
    with game.batch(2, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(2))
        assert not games.detached


class Streets:
    """The ways of a map that one mode may use, read from its columns alone."""

    def __init__(self, columns, mode):
        self.xy = dict(zip(columns.node_ids.tolist(), columns.xy, strict=True))
        self.ends, self.lines, self.graph = {}, {}, nx.DiGraph()
        ends = [columns.node_ids[rows].tolist() for rows in (columns.sources, columns.targets)]
        edges = zip(columns.edge_ids.tolist(), *ends, columns.lengths.tolist(), strict=True)
        for row, (id, source, target, length) in enumerate(edges):
            if columns.edge_attributes[mode].get(row, 0.0) > 0.0:
                line = np.array(columns.polylines.get(row, [self.xy[source], self.xy[target]]))
                self.ends[id], self.lines[id] = (source, target), line
                if length < self.graph.get_edge_data(source, target, {"length": math.inf})["length"]:
                    self.graph.add_edge(source, target, length=length, line=line)

    def part(self, id, begin, end):
        """Return the points of an edge between two shares of its length."""
        line = self.lines[id]
        inner = [one for one in far_along(line) / length_of(line) if min(begin, end) < one < max(begin, end)]
        shares = np.array([begin, *(inner if begin < end else inner[::-1]), end])
        return points_at(line, shares * length_of(line))

    def ends_of(self, place, is_start):
        """Return the nodes next to a place -> the points from the place to the node, or else from the node to it."""
        node, id, share = place
        if id < 0:
            return {node: self.xy[node][None]}
        source, target = self.ends[id]
        ways = {target: self.part(id, share, 1.0)} if is_start else {source: self.part(id, 0.0, share)}
        if self.graph.has_edge(target, source):
            ways |= {source: self.part(id, share, 0.0)} if is_start else {target: self.part(id, 1.0, share)}
        return ways

    def path(self, before, after):
        """Return the points of the shortest way from one place (node, edge, share) to another."""
        ways = []
        if min(before[1], after[1]) >= 0 and set(self.ends[before[1]]) == set(self.ends[after[1]]):
            share = after[2] if self.ends[before[1]] == self.ends[after[1]] else 1 - after[2]
            if share >= before[2] or self.graph.has_edge(*self.ends[before[1]][::-1]):
                ways.append(self.part(before[1], before[2], share))
        for start, head in self.ends_of(before, is_start=True).items():
            nodes = nx.single_source_dijkstra_path(self.graph, start, cutoff=60, weight="length")
            for end, tail in self.ends_of(after, is_start=False).items():
                lines = [self.graph.edges[leg]["line"] for leg in pairwise(nodes.get(end, []))]
                ways += [np.concatenate([head, *lines, tail])] if end in nodes else []
        return min(ways, key=length_of)


def far_along(line):
    return np.concatenate([[0.0], np.hypot(*np.diff(line, axis=0).T).cumsum()])


def length_of(line):
    return far_along(line)[-1]


def points_at(line, metres):
    return np.stack([np.interp(metres, far_along(line), values) for values in line.T], axis=1)


def places_of(state):
    """Return the place of each agent at the end of a turn: its node, edge (-1 on a node) and share of the edge."""
    agents = state.agents
    on_nodes = np.full(len(agents["name"]), -1)
    columns = (agents["node"], agents.get("edge", on_nodes), np.nan_to_num(agents.get("edge_share", on_nodes)))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return dict(zip(agents["name"].tolist(), rows, strict=True))


@pytest.fixture(scope="module")
def streets():
    """Return the streets of Helsinki for cars and for walkers."""
    with scenario.from_gallery("checkpoints").build() as ctx:
        return {mode: Streets(ctx.graph.columns(), mode) for mode in ("walk", "drive")}


@pytest.mark.parametrize(("seed", "why"), [(1, "officer"), (3, "exit"), (4, "car")])
def test_a_referee_with_streets_for_each_mode_finds_the_ways_and_the_winner(tmp_path, streets, seed, why):
    with scenario.from_gallery("checkpoints").build(seed) as ctx:
        edges = ctx.graph.columns().edge_ids.tolist()
        ctx.game.collect("used", lambda ctx: [(visit.agent, visit.edge) for visit in ctx.game.visits(edges=edges)])
        result = ctx.game.run(record=str(tmp_path / "game.ggr"))
    with recorder.open(tmp_path / "game.ggr") as recording:
        states = list(recording)
    mode_of = {name: "walk" if name.startswith("officer") else "drive" for name in states[0].agents["name"].tolist()}
    used = {mode: set() for mode in streets}
    for agent, edge in chain.from_iterable(result.collected["used"]["value"]):
        used[mode_of[agent]].add(edge)
    assert all(used[mode] <= streets[mode].lines.keys() for mode in streets)
    assert used["walk"] - streets["drive"].lines.keys(), "officers leave the roads"
    for before, after in pairwise(states):
        paths = {}
        alive = dict(zip(before.agents["name"].tolist(), before.agents["alive"].tolist(), strict=True))
        for name, place in places_of(before).items():
            if alive[name]:
                line = streets[mode_of[name]].path(place, places_of(after)[name])
                reach = 5 * (1.5 if mode_of[name] == "walk" else 8)
                assert length_of(line) <= reach + 1e-2, "no way of its mode is as short as its move"
                paths[name] = points_at(line, np.linspace(0, reach, 4001))
        evader = paths["evader_0"]
        far = {name: np.hypot(*(evader - path).T).min() for name, path in paths.items()}
        found = {
            "officer": min(metres for name, metres in far.items() if name.startswith("officer")) < 0.05,
            "car": min(metres for name, metres in far.items() if name.startswith("police")) < 10,
            "exit": places_of(after)["evader_0"][:2] in {(node, -1) for node in (5677, 103, 8445, 6659, 112, 3617)},
        }
        assert found == {**dict.fromkeys(found, False), **({why: True} if after is states[-1] else {})}
    assert result.winner == ("evader" if why == "exit" else "police")


def test_checkpoints_of_a_batch_are_the_game_alone():
    game = scenario.from_gallery("checkpoints").replace(max_turns=15)
    with game.batch(2, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(2))
