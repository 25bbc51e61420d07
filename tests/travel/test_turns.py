"""Agents that obey turn restrictions: what is legal follows from the edges by which they came."""

import random
from itertools import product

import numpy as np
import pytest

import gamms
from gamms import belief, planning, rl, solve, strategies
from gamms.errors import BadType, BadValue, NoPath
from gamms.game import IllegalAction
from gamms.rules import Conflicts, discover, tag
from gamms.scenario import Scenario, ScenarioError

CAR = {"attribute": "drive", "turns": True}
SIDE = 4


def draw_roads(seed):
    """Return id -> (source, target, whether cars may use it, forbidden sequences of edges that begin with it)."""
    draw = random.Random(seed)
    cells = [divmod(i, SIDE) for i in range(SIDE * SIDE)]
    near = [
        (i, j) for i, a in enumerate(cells) for j, b in enumerate(cells) if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1
    ]
    ends = [*near, (5, 6), (6, 5), (9, 5)]  # parallel roads
    leaving = {node: [id for id, (source, _) in enumerate(ends) if source == node] for node in range(len(cells))}
    roads = {}
    for id, (source, target) in enumerate(ends):
        forbidden = []
        for after in leaving[target]:
            if draw.random() < 0.2:
                forbidden.append([after])
            elif draw.random() < 0.2:
                forbidden.append([after, draw.choice(leaving[ends[after][1]])])
        roads[id] = source, target, draw.random() < 0.95, forbidden
    return roads


def open_town(roads, seed=1):
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(
        range(SIDE * SIDE),
        [10.0 * (i % SIDE) for i in range(SIDE * SIDE)],
        [10.0 * (i // SIDE) for i in range(SIDE * SIDE)],
    )
    for id, (source, target, may_drive, forbidden) in roads.items():
        signs = {"forbidden_turns": {"drive": forbidden}} if forbidden else {}
        length = 9.0 if id == len(roads) - 1 else 10.0
        ctx.graph.add_edge(
            {
                "id": id,
                "source": source,
                "target": target,
                "length": length,
                "drive": may_drive,
                "on_foot": True,
                **signs,
            }
        )
    return ctx


def list_legal(roads, lengths, history, node):
    """Return the ids of the legal edges after a history of edges, as docs/maps.md says it."""
    out = [id for id, (source, _, may_drive, _) in roads.items() if source == node and may_drive]
    if not history:
        return out

    def is_free(edge):
        walk = [*history, edge]
        return not any(walk[place + 1 :] in roads[first][3] for place, first in enumerate(walk))

    last = history[-1]
    back = [id for id in out if roads[id][:2] == roads[last][1::-1] and lengths[id] == lengths[last]]
    return [id for id in out if id not in back and is_free(id)] or [id for id in back if is_free(id)]


@pytest.mark.parametrize("seed", range(4))
def test_lengths_to_all_nodes_after_an_edge_are_those_of_the_shortest_paths(seed):
    roads = draw_roads(seed)
    with open_town(roads) as ctx:
        routes, weights = ctx.graph.routes, {id: ctx.graph.get_edge(id).length for id in roads}
        for edge, (_, node, may_drive, _) in roads.items():
            if not may_drive:
                continue
            far = routes.distances_with_turns(node, None, "length", None, "drive", [edge])
            for target in ctx.graph.get_nodes():
                if target not in far:
                    with pytest.raises(NoPath):
                        routes.shortest_path_edges(node, target, turns="drive", driven=[edge])
                elif target != node:
                    path = routes.shortest_path_edges(node, target, turns="drive", driven=[edge])
                    assert far[target] == pytest.approx(sum(weights[id] for id in path))


@pytest.fixture
def corner():
    """A context with a road from node 0 over 1 to 2, and one from 1 to 3 into which cars from 0 may not turn."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(range(4), [0.0, 10.0, 20.0, 10.0], [0.0, 0.0, 0.0, 10.0])
    for id, ends in enumerate([(0, 1), (1, 0), (1, 2), (2, 1), (1, 3), (3, 1)]):
        signs = {"forbidden_turns": {"drive": [[4]]}} if id == 0 else {}
        ctx.graph.add_edge({"id": id, "source": ends[0], "target": ends[1], "length": 10.0, "drive": True, **signs})
    yield ctx
    ctx.terminate()


def follow(*nodes):
    """Return a strategy that goes to these nodes, one in a turn, and the states in which it decided."""
    seen = []
    rest = [*nodes]

    def strategy(state):
        seen.append((state.turn, state.legal, state.legal_edges))
        state["action"] = rest.pop(0) if rest else state.curr_pos

    return strategy, seen


@pytest.mark.parametrize("seed", range(4))
def test_legal_nodes_and_edges_are_those_of_a_plain_reading_of_the_edges_driven(seed):
    roads = draw_roads(seed)
    with open_town(roads) as ctx:
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        history = {"a": [], "b": []}
        where = {"a": 0, "b": 10}
        compared = []

        def drive(state):
            own = history[state.name]
            assert state.curr_pos == where[state.name]
            edges = list_legal(roads, lengths, own, state.curr_pos)
            assert state.legal_edges == tuple(edges)
            assert {*state.legal} == {state.curr_pos, *(roads[edge][1] for edge in edges)}
            assert state.legal[0] == state.curr_pos
            compared.append(len(edges))
            chosen = state.draw.below(len(edges) + 1)
            if chosen == len(edges):
                state["action"] = state.curr_pos
                return
            edge = edges[chosen]
            if state.draw.below(2):
                state["action"] = {"edge": edge}
            else:  # the cheapest of parallel edges, then the first
                state["action"] = roads[edge][1]
                edge = min((id for id in edges if roads[id][1] == roads[edge][1]), key=lambda one: (lengths[one], one))
            own.append(edge)
            where[state.name] = roads[edge][1]

        for name, node in where.items():
            ctx.agent.create_agent(name, start_node_id=node, mode=CAR, strategy=drive)
        for _ in range(150):
            ctx.game.step()
            for name, own in history.items():
                if not list_legal(roads, lengths, own, where[name]):  # the signs leave no way: place it elsewhere
                    where[name] = (where[name] + 7) % (SIDE * SIDE)
                    ctx.agent.get_agent(name).current_node_id = where[name]
                    own.clear()
        assert len(compared) == 300
        assert sum(compared) > 300


def test_waiting_keeps_the_last_edge_and_a_place_by_a_rule_has_none(corner):
    car, seen = follow(1, 1, 1)
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    for _ in range(3):
        corner.game.step()
    assert [legal for _, legal, _ in seen] == [(0, 1), (1, 2), (1, 2)]
    assert [edges for *_, edges in seen] == [(0,), (2,), (2,)]
    agent.current_node_id = 3
    assert corner.game.internals.parts.turns.list_legal(["car"]) == {"car": (3, 1)}
    agent.current_node_id = 2
    corner.game.step()
    agent.current_node_id = 1
    corner.game.step()
    assert seen[-1][1:] == ((1, 0, 2, 3), (1, 2, 4))


def test_after_a_return_to_its_start_an_agent_begins_there_even_if_it_stood_there(corner):
    car, seen = follow(2, 1)
    cop, _ = follow(0, 1)
    corner.agent.create_agent("car", start_node_id=1, mode=CAR, team="b", strategy=car)
    corner.agent.create_agent("cop", start_node_id=0, team="a", strategy=cop)
    corner.game.add(tag("a", "b", then="respawn"))
    for _ in range(3):
        corner.game.step()
    assert corner.game.events[1]["kind"] == "respawned"
    assert [legal for _, legal, _ in seen] == [(1, 0, 2, 3), (2, 1), (1, 0, 2, 3)]


def test_traffic_turns_back_only_where_nothing_else_is_legal(corner):
    car, seen = follow(1, 2, 1, 3)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    for _ in range(5):
        corner.game.step()
    assert [legal for _, legal, _ in seen] == [(0, 1), (1, 2), (2, 1), (1, 0, 3), (3, 1)]


@pytest.mark.parametrize("action", [3, {"edge": 4}, [3], {"node_id": 3, "orientation": (1.0, 0.0)}])
def test_a_forbidden_turn_is_an_illegal_action_whose_error_names_the_turn(corner, action):
    actions = [1, action]
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR)
    agent.strategy = lambda state: state.update(action=actions[state["turn"]])
    corner.game.on_illegal = "raise"
    corner.game.step()
    with pytest.raises(IllegalAction, match="along edge 0 from node 0, and a turn restriction forbids it"):
        corner.game.step()
    corner.game.on_illegal = "stay"
    corner.game.step()
    assert agent.current_node_id == 1
    assert "turn restriction" in corner.game.errors[0]["message"]
    agent.strategy = lambda state: state.update(action=2)
    corner.game.step()
    assert agent.current_node_id == 2


def test_agents_of_other_modes_do_not_know_turns(corner):
    seen = {}
    for name, mode in (("plain", None), ("drive", "drive"), ("no", {"attribute": "drive", "turns": False})):
        strategy, seen[name] = follow(1, 3)
        corner.agent.create_agent(name, start_node_id=0, mode=mode, strategy=strategy)
    for _ in range(2):
        corner.game.step()
    assert {agent.current_node_id for agent in corner.agent.create_iter()} == {3}
    assert corner.game.internals.state.driven == {}


def test_snapshots_forks_and_resets_keep_the_edges_driven(corner):
    car, _ = follow(1)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    corner.game.step()
    legal = corner.game.internals.parts.turns.list_legal
    before = corner.game.snapshot()
    with corner.game.fork(0).ctx as fork:
        assert fork.game.internals.parts.turns.list_legal(["car"]) == {"car": (1, 2)}
    corner.agent.get_agent("car").strategy = lambda state: state.update(action=2)
    corner.game.step()
    assert legal(["car"]) == {"car": (2, 1)}
    corner.game.restore(before)
    assert legal(["car"]) == {"car": (1, 2)}
    corner.game.reset()
    assert legal(["car"]) == {"car": (0, 1)}
    assert corner.game.internals.state.driven == {}


def test_a_resumed_recording_knows_by_which_edge_agents_came(corner, tmp_path):
    car, _ = follow(1, 1, 2)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    corner.record.start(tmp_path / "game.ggr")
    for _ in range(3):
        corner.game.step()
    corner.record.stop()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        for turn, legal in enumerate([(0, 1), (1, 2), (1, 2), (2, 1)]):
            with recording.resume(turn) as again:
                assert again.game.internals.parts.turns.list_legal(["car"]) == {"car": legal}


def test_a_closed_road_behind_an_agent_lets_it_begin_there(corner):
    car, _ = follow(1)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    corner.game.step()
    corner.graph.close_roads([0])
    assert corner.game.internals.parts.turns.list_legal(["car"]) == {"car": (1, 0, 2, 3)}
    corner.graph.open_roads([0])
    assert corner.game.internals.parts.turns.list_legal(["car"]) == {"car": (1, 2)}


def test_a_road_behind_an_agent_that_is_closed_to_its_mode_lets_it_begin_there(corner):
    goes = strategies.goto(corner, 3)
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR)
    agent.strategy = lambda state: goes(state) if state["turn"] else state.update(action=1)
    corner.game.on_illegal = "raise"
    corner.game.step()
    corner.graph.graph.update_edge({"id": 0, "drive": False})
    corner.game.step()
    assert agent.current_node_id == 3


def test_a_road_that_opens_while_an_agent_drives_on_a_forbidden_path_stays_forbidden(corner):
    corner.graph.graph.update_edge({"id": 0, "forbidden_turns": {"drive": [[2, 3]]}})
    corner.graph.close_roads([3])
    car, _ = follow(1, 2)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    for _ in range(2):
        corner.game.step()
    corner.graph.open_roads([3])
    assert corner.game.internals.parts.turns.list_legal(["car"]) == {"car": (2,)}


def test_an_edge_from_a_node_to_itself_keeps_no_agent_from_turning_back(corner):
    corner.graph.graph.add_edge({"id": 9, "source": 2, "target": 2, "length": 5.0, "drive": True})
    goes = strategies.goto(corner, 3)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=goes)
    for _ in range(4):
        corner.game.step()
    assert corner.agent.get_agent("car").current_node_id == 3
    assert corner.graph.shortest_path(0, 3, turns="drive") == [0, 1, 2, 1, 3]
    assert corner.graph.routes.edges_onward(2, turns="drive") == [3]


def test_an_edge_that_is_elsewhere_now_was_not_driven(corner):
    corner.graph.graph.update_edge({"id": 0, "forbidden_turns": {"drive": [[2, 3]]}})
    car, seen = follow(1, 2)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    for _ in range(2):
        corner.game.step()
    assert corner.game.internals.state.driven == {"car": (0, 2)}
    corner.graph.graph.remove_edge(0)
    corner.graph.graph.add_edge({"id": 0, "source": 3, "target": 0, "length": 10.0, "drive": True})
    corner.game.step()
    assert seen[-1][1:] == ((2, 1), (3,))
    assert not corner.game.errors


def test_an_agent_without_turns_has_driven_nothing_even_with_the_name_of_one_that_has(corner):
    car, _ = follow(1)
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=car)
    corner.game.step()
    corner.agent.delete_agent("car")
    again, _ = follow(1, 3)
    corner.agent.create_agent("car", start_node_id=0, strategy=again)
    for _ in range(2):
        corner.game.step()
    assert corner.game.internals.parts.turns.legality.find_driven("car") == ()
    assert corner.agent.get_agent("car").current_node_id == 3


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """A folder with the file of a map with restrictions."""
    folder = tmp_path_factory.mktemp("town")
    with open_town(draw_roads(7)) as ctx:
        ctx.graph.save(folder / "town.gamms")
    return folder


def drive_in(folder, strategy="gamms.strategies:random_walk", speed=None, settings=None, **more):
    cars = {"count": 2, "mode": CAR, "strategy": strategy, "sensors": {"near": {"type": "NEIGHBOR"}}}
    walkers = {"count": 1, "mode": "on_foot", "strategy": "gamms.strategies:random_walk"}
    by_metres = {} if speed is None else {"speed_unit": "metres"}
    return Scenario(
        map={"file": "town.gamms"},
        max_turns=12,
        teams={"cars": cars if speed is None else {**cars, "speed": speed}, "walkers": walkers},
        settings={**by_metres, **(settings or {})},
        folder=folder,
        **more,
    )


def score_edges(ctx):
    """Score the edges of the last moves and the times at their ends."""
    legs = [leg for move in (ctx.game.moves or {}).values() for leg in move.legs]
    points = sum(leg.edge * 7 + leg.source + 100 * leg.until for leg in legs)
    ctx.game.scores["cars"] = 1.01 * ctx.game.scores.get("cars", 0) + points


def close_and_place(ctx):
    """Score the last moves, close and open roads, and place a car anywhere."""
    score_edges(ctx)
    turn = ctx.game.turn
    if turn % 5 == 2:
        ctx.graph.close_roads([turn % 7, 20])
    if turn % 5 == 4:
        ctx.graph.open_roads([(turn - 2) % 7, 20])
    if turn % 4 == 3:
        ctx.agent.get_agent("cars_1").current_node_id = (turn * 5) % 16


def leave(ctx):
    """Score the last moves, and change what games of a batch share."""
    score_edges(ctx)
    if ctx.game.turn == 4:
        ctx.graph.add_node({"id": 100, "x": 3.0, "y": 4.0})


def drive_anyhow(state):
    """Take a legal edge or node, or a route."""
    kind = state.draw.below(3)
    edges = state.legal_edges
    if kind == 0 and edges:
        state["action"] = {"edge": edges[state.draw.below(len(edges))]}
    elif kind == 1:
        state["action"] = state.legal[state.draw.below(len(state.legal))]
    else:
        state["action"] = [state.draw.below(16)]  # often illegal


@gamms.array_strategy
def take_first_edges(view):
    """Take the first legal edge in some turns, and go to the last legal node in others."""
    edges = view["legal_edges"]
    if edges.shape[-1] and view.turn[0] % 3 == 0:
        view.take_edges(edges[..., 0])
    return (view["legal"] >= 0).sum(axis=-1) - 1


@gamms.array_strategy
def go_around(view):
    """Go toward one node after the other."""
    targets = (view.turn[:, None] // 5 * 7 + 3 * view.agents) % (SIDE * SIDE)
    return np.maximum(view.towards(targets), 0)


DRIVERS = {"anyhow": drive_anyhow, "edges": take_first_edges, "around": go_around, "walk": None}
TAG = {"rule": "tag", "with": {"taggers": "walkers", "tagged": "cars", "then": "respawn"}}


@pytest.mark.parametrize("speed", [None, 17.0])
@pytest.mark.parametrize("driver", DRIVERS)
def test_a_game_in_a_batch_is_the_game_alone(town, driver, speed):
    strategies = {} if DRIVERS[driver] is None else {"strategies": {"cars": DRIVERS[driver]}}
    order = {"order": [["walkers"], ["cars"]]}
    functions = f"{__name__}:{{}}".format
    for more in (
        {"rules": [TAG], "conflicts": {"capacity": 1}, "settings": order},
        {"rules": [TAG, functions("close_and_place")]},
        {"rules": [{"rule": functions("leave"), "phase": "before"}]},
    ):
        scenario = drive_in(town, speed=speed, allow=[__name__], **more)
        with scenario.batch(2, **strategies) as games:
            games.run()
            assert not games.detached
            for game, seed in enumerate(games.seeds):
                assert games.result(game) == scenario.play(seed=seed, **strategies)


def test_a_batch_goes_on_with_the_edges_driven(town):
    with drive_in(town).build(seed=5) as ctx:
        for _ in range(4):
            ctx.game.step()
        legal = ctx.game.internals.parts.turns.list_legal(["cars_0", "cars_1"])

        def check_legal(games):
            for row in games.observe("cars")["legal"]:
                shown = {f"cars_{place}": tuple(nodes[nodes >= 0].tolist()) for place, nodes in enumerate(row)}
                assert shown == legal

        with ctx.game.batch(2) as games:
            check_legal(games)
            before = games.columns()
            games.run()
            nodes = games.columns()["node"]
            games.load(before, turn=4)
            check_legal(games)
            games.run()
            assert (games.columns()["node"] == nodes).all()
            for others in (before["driven"] + 10**6, np.full_like(before["driven"], -2)):
                with pytest.raises(BadValue, match="'driven' has"):
                    games.load({**before, "driven": others}, turn=4)


@pytest.mark.parametrize("speed", [None, 17.0])
def test_views_and_learners_have_the_legal_nodes_of_agents_that_obey_turns(town, speed):
    pytest.importorskip("gymnasium")
    env = rl.vector_env(
        drive_in(town, speed=speed), team="cars", num_games=3, reward=lambda turn: turn.after.node * 0.0 + 1.0
    )
    _, infos = env.reset(seed=3)
    for turn in range(10):
        mask = infos["action_mask"]
        assert mask.any(axis=1).all()
        *_, infos = env.step(mask.shape[1] - 1 - mask[:, ::-1].argmax(axis=1) if turn % 2 else mask.argmax(axis=1))
    env.close()


@pytest.mark.parametrize("speed", [None, 17.0])
def test_given_actions_are_legal_by_the_edges_driven(town, speed, tmp_path):
    scenario = drive_in(town, strategy=None, speed=speed)
    with scenario.batch(3, record=True) as games:
        rng = np.random.default_rng(1)
        with pytest.raises(BadValue, match="legal"):
            games.step({"cars": np.full((3, 2), 9)})
        for _ in range(12):
            legal = games.observe("cars")["legal"]
            for number in range(3):
                known = games.context(number).game.internals.parts.turns.list_legal(["cars_0", "cars_1"])
                shown = {f"cars_{place}": tuple(row[row >= 0].tolist()) for place, row in enumerate(legal[number])}
                assert shown == known
            games.step({"cars": rng.integers(0, (legal >= 0).sum(axis=-1))})
        for number in range(3):  # with the given actions, and the games end as before
            games.record(number, tmp_path / f"{number}.ggr")
            with gamms.recorder.open(tmp_path / f"{number}.ggr") as recording, recording.resume(12) as ctx:
                ends = [ctx.agent.get_agent(f"cars_{place}").current_node_id for place in range(2)]
            assert ends == games.observe("cars")["curr_pos"][number].tolist()


GOING = {
    "goto": lambda ctx, draw: strategies.goto(ctx, draw.randrange(16)),
    "patrol": lambda ctx, draw: strategies.patrol(ctx, draw.sample(range(16), 3)),
    "follow": lambda ctx, draw: strategies.follow_path(ctx, draw.sample(range(16), 5)),
    "waypoints": lambda ctx, _: strategies.random_waypoints(ctx),
    "walk": lambda _, __: strategies.random_walk,
    "chase": lambda ctx, _: strategies.chase(ctx),
    "flee": lambda ctx, _: strategies.flee(ctx),
    "guard": lambda ctx, draw: strategies.guard(ctx, draw.randrange(16), 30.0),
    "sweep": lambda ctx, _: strategies.sweep(ctx),
    "intercept": lambda ctx, _: strategies.intercept(ctx),
    "assign": lambda ctx, _: strategies.assign(ctx),
    "meet": lambda ctx, draw: strategies.intercept(ctx, draw.sample(range(16), 2)),
    "escape": lambda ctx, draw: strategies.safest_exit(ctx, draw.sample(range(16), 2)),
}


@pytest.mark.parametrize("seed", range(2))
def test_drivers_make_no_forbidden_turn(seed):
    roads = draw_roads(seed)
    draw = random.Random(seed)
    with open_town(roads, seed) as ctx:
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        going = {**GOING, "anyhow": lambda _, __: drive_anyhow}
        for number, (name, make) in enumerate(going.items()):
            agent = ctx.agent.create_agent(
                name,
                start_node_id=number,
                mode=CAR,
                team="ab"[number % 2],
                strategy=make(ctx, draw),
                sensors={"eyes": gamms.sensor.agent_range(range_m=25)},
            )
            assert agent.mode == "drive with turns"
        history = {name: [] for name in going}
        moved = 0
        for _ in range(40):
            ctx.game.step()
            for agent in ctx.agent.create_iter():
                legs = ctx.game.tracks([agent])[0].legs
                assert len(legs) < 2
                for leg in legs:
                    assert leg.edge in list_legal(roads, lengths, history[agent.name], leg.source)
                    history[agent.name].append(leg.edge)
                    moved += 1
                assert not legs or legs[-1].target == agent.current_node_id
        assert moved > 100
        assert {error["agent"] for error in ctx.game.errors} <= {"anyhow"}


def test_an_agent_that_obeys_turns_with_a_speed_in_edges_is_refused_wherever_it_comes_from(corner):
    message = r"moves by one edge or by metres\. Agent 'car' has mode='drive with turns' and speed=2.0 in edges"
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=strategies.random_walk)
    corner.game.step()
    before = agent.current_node_id, corner.game.internals.state.driven
    agent.speed = 2.0
    for play in (corner.game.step, lambda: corner.game.batch(2), lambda: corner.game.fork(0).step()):
        with pytest.raises(BadValue, match=message):
            play()
    agent.speed = None
    assert (agent.current_node_id, corner.game.internals.state.driven, corner.game.turn) == (*before, 1)
    corner.agent.create_agent("late", start_node_id=0, mode=CAR, speed=1.0)
    with pytest.raises(BadValue, match=r"Agent 'late' .* leave out its speed, or set .*speed_unit = 'metres'"):
        corner.game.step()
    corner.game.speed_unit = "metres"
    corner.game.step()
    corner.game.speed_unit = "edges"
    with pytest.raises(BadValue, match="Agent 'late' has"):
        corner.game.step()


@pytest.mark.parametrize("is_new", [False, True])
def test_a_rule_cannot_give_an_agent_of_a_batch_both_turns_and_a_speed_in_edges(corner, is_new):
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=strategies.random_walk)

    def hurry(ctx):
        if ctx.game.turn == 3 and is_new:
            ctx.agent.create_agent("new", start_node_id=0, mode=CAR, speed=2.0)
        elif ctx.game.turn == 3:
            ctx.agent.get_agent("car").speed = 2.0

    corner.game.add(hurry)
    with corner.game.batch(2) as games, pytest.raises(BadValue, match="moves by one edge or by metres"):
        games.run(6)


def test_scenarios_refuse_turns_with_speeds_in_edges_by_their_path(town):
    ann = {"name": "ann", "mode": CAR, "node": 0}
    for team, path in (
        ({"count": 2, "mode": CAR, "speed": 2.0}, r"teams\.cars\.speed: An agent .* Agent 'cars_0'"),
        ({"agents": [{**ann, "speed": 2.0}]}, r"agents \(ann\), speed: .* Agent 'ann'"),
        ({"agents": [ann], "speed": 2.0}, r"teams\.cars\.speed: .* Agent 'ann'"),
    ):
        scenario = Scenario(map={"file": "town.gamms"}, max_turns=2, teams={"cars": team}, folder=town)
        for make in (lambda one: one.build(seed=1), lambda one: one.batch(2)):
            with pytest.raises(ScenarioError, match=path):
                make(scenario)
        scenario.replace(settings={"speed_unit": "metres"}).play(seed=1)


def test_an_agent_that_obeys_turns_takes_the_exit_that_its_legal_routes_reach_first(corner):
    car = corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=strategies.safest_exit(corner, [3]))
    places = []
    for _ in range(4):
        corner.game.step()
        places.append(car.current_node_id)
    assert places == [1, 2, 1, 3]  # on the map 3 is next to 1


def test_an_agent_that_obeys_turns_discovers_what_lies_along_the_edges_of_its_mode(corner):
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, team="a", strategy=strategies.stay)
    corner.game.add(discover([0, 1, 2, 3], hops=2))
    corner.game.step()
    assert sorted(event["node"] for event in corner.game.events) == [0, 1, 2, 3]


def test_an_enemy_that_obeys_turns_is_met_on_its_legal_route(corner):
    eyes = {"eyes": gamms.sensor.agent_range(range_m=100)}
    met = []
    for mode in (CAR, "drive"):
        corner.agent.create_agent("prey", start_node_id=0, mode=mode, team="b", strategy=strategies.stay)
        corner.agent.create_agent("car", start_node_id=2, team="a", mode=CAR, sensors=eyes)
        corner.agent.get_agent("car").strategy = strategies.intercept(corner, [3])
        corner.game.step()
        met.append(corner.agent.get_agent("car").current_node_id)
        for name in ("prey", "car"):
            corner.agent.delete_agent(name)
    assert met == [2, 1]  # by the signs the enemy turns at 2, on the map it goes from 1 to 3


def test_goto_takes_the_shortest_route_that_obeys_turns(corner):
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=strategies.goto(corner, 3))
    where = []
    for _ in range(4):
        corner.game.step()
        where.append(agent.current_node_id)
    assert where == corner.graph.shortest_path(0, 3, turns="drive")[1:]


def open_fork(edges):
    """Return a context with nodes 0 to 2 and these edges: id, ends, length, and the edges that must not follow."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(range(3), [0.0, 10.0, 20.0], [0.0, 0.0, 5.0])
    for id, (source, target), length, forbidden in edges:
        signs = {"forbidden_turns": {"drive": [forbidden]}} if forbidden else {}
        ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": length, "drive": True, **signs})
    return ctx


@pytest.mark.parametrize("length", [10.0, 9.0])
@pytest.mark.parametrize("make", [strategies.goto, lambda ctx, node: strategies.patrol(ctx, [node])])
def test_strategies_take_the_parallel_road_from_which_the_route_goes_on(make, length):
    roads = [(7, (0, 1), length, [2]), (5, (0, 1), 10.0, []), (3, (1, 0), 10.0, []), (2, (1, 2), 10.0, [])]
    with open_fork(roads) as ctx:
        agent = ctx.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=make(ctx, 2))
        for node in (1, 2):
            ctx.game.step()
            assert agent.current_node_id == node
        assert ctx.game.internals.state.named_edges == {"car": (2, 2)}


def test_the_nearest_enemy_is_chased_in_whatever_order_edges_were_added():
    with open_fork([(9, (0, 2), 30.0, []), (3, (0, 1), 10.0, [])]) as ctx:
        eyes = {"eyes": gamms.sensor.agent_range(range_m=100)}
        chaser = ctx.agent.create_agent(
            "car", start_node_id=0, mode=CAR, team="a", sensors=eyes, strategy=strategies.chase(ctx)
        )
        for name, node in (("far", 2), ("near", 1)):
            ctx.agent.create_agent(name, start_node_id=node, team="b", strategy=strategies.stay)
        ctx.game.step()
        assert chaser.current_node_id == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda ctx: (setattr(ctx.game, "speed_unit", "metres"), setattr(ctx.game, "decide", "arrival")),
            "'car' obeys .* decide='turn'",
        ),
        (lambda ctx: setattr(ctx.game, "legal", "any"), r"'car' has mode=.* leave out mode=.*\.respawn\(agent, node\)"),
    ],
)
def test_games_that_do_not_know_turns_refuse_them(corner, change, message):
    corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=strategies.random_walk)
    change(corner)
    with pytest.raises(BadValue, match=message):
        corner.game.step()


def test_a_game_is_solved_with_the_edges_that_agents_have_driven(corner, tmp_path):
    corner.graph.add_node({"id": 4, "x": 100.0, "y": 0.0})
    corner.graph.save(tmp_path / "corner.gamms")
    rules = [{"rule": "reach", "with": {"team": "car", "nodes": [3], "score": 1}}]
    values = {}
    for obeys in (False, True):
        car = {"name": "car", "node": 0, "mode": {"attribute": "drive", "turns": obeys}}
        teams = {"car": {"agents": [car]}, "post": {"agents": [{"name": "post", "node": 4}]}}
        drive = Scenario(map={"file": "corner.gamms"}, max_turns=6, teams=teams, rules=rules, folder=tmp_path)
        values[obeys] = solve.solve(drive, discount=0.5).value
    # by the map 0, 1, 3; by the signs 0, 1, 2, 1, 3
    assert values[True] == pytest.approx(values[False] * 0.5**2)
    assert values[True] > 0


@gamms.array_strategy
def towards_three(view):
    return view.towards(np.full(view.node.shape, 3))


@pytest.mark.parametrize("settings", [{}, {"speed_unit": "metres"}])
def test_array_strategies_go_toward_nodes_by_legal_turns(corner, settings):
    for name, value in settings.items():
        setattr(corner.game, name, value)
    agent = corner.agent.create_agent("car", start_node_id=0, mode=CAR, strategy=towards_three(corner))
    where = []
    for _ in range(4):
        corner.game.step()
        where.append(agent.current_node_id)
    assert where == [1, 2, 1, 3]


def test_tables_of_routes_by_nodes_refuse_agents_that_obey_turns(town):
    with drive_in(town).batch(2) as games, pytest.raises(BadValue, match=r"view\.towards knows turns"):
        games.observe("cars").routes()


def draw_block(seed, columns):
    """Return the roads of two rows of nodes with one parallel road, as `draw_roads` does."""
    draw = random.Random(seed)
    pairs = [(i, i + 1) for i in range(2 * columns - 1) if i % columns < columns - 1]
    pairs += [(i, i + columns) for i in range(columns)]
    ends = [*pairs, *(pair[::-1] for pair in pairs), (0, 1)]
    leaving = {node: [id for id, (source, _) in enumerate(ends) if source == node] for node in range(2 * columns)}
    roads = {}
    for id, (source, target) in enumerate(ends):
        rests = [[after] for after in leaving[target] if draw.random() < 0.3]
        after = draw.choice(leaving[target])
        roads[id] = source, target, True, [*rests, [after, draw.choice(leaving[ends[after][1]])]]
    return roads


def count_moves_to_capture(roads, start, obeying):
    """Return the number of moves until cops, who move first, catch the last agent; None: they cannot force it.

    A plain enumeration of (node, the last two edges) of each agent; cops may differ in whether they obey turns.
    """
    lengths = dict.fromkeys(roads, 10.0)

    def list_moves(place, obeys):
        node, driven = place
        edges = list_legal(roads, lengths, [*driven] if obeys else [], node)
        return [place, *((roads[edge][1], (*driven, edge)[-2:] if obeys else ()) for edge in edges)]

    def list_positions(position):
        side, places = position
        if places[-1][0] in [node for node, _ in places[:-1]]:
            return []
        moving = range(len(places) - 1) if side == 0 else [len(places) - 1]
        ways = [list_moves(one, obeying[i]) if i in moving else [one] for i, one in enumerate(places)]
        return [(1 - side, after) for after in product(*ways)]

    first = 0, tuple((node, ()) for node in start)
    after = {}
    waiting = [first]
    while waiting:
        position = waiting.pop()
        if position not in after:
            after[position] = list_positions(position)
            waiting += after[position]
    moves = {position: 0 for position, ways in after.items() if not ways}
    for count in range(1, len(after)):
        new = [
            position
            for position, ways in after.items()
            if position not in moves and (any, all)[position[0]](way in moves for way in ways)
        ]
        if not new:
            return moves.get(first)
        moves |= dict.fromkeys(new, count)
    return moves.get(first)


@pytest.mark.parametrize(
    ("seed", "columns", "obeying", "starts"),
    [
        (3, 3, (True, True), [(0, 5), (4, 2)]),
        (10, 3, (True, True), [(0, 5), (4, 2)]),
        (4, 3, (False, True), [(0, 5), (4, 2)]),
        (2, 2, (True, True, True), [(0, 1, 3), (2, 2, 1)]),
        (3, 2, (True, False, True), [(0, 1, 3), (2, 2, 1)]),
    ],
)
def test_exact_play_of_agents_that_obey_turns_is_that_of_a_plain_enumeration(tmp_path, seed, columns, obeying, starts):
    roads = draw_block(seed, columns)
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes(range(2 * columns), [i % columns for i in range(2 * columns)], [0.0] * 2 * columns)
        for id, (source, target, _, forbidden) in roads.items():
            signs = {"forbidden_turns": {"drive": forbidden}} if forbidden else {}
            ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": 10.0, "drive": True, **signs})
        ctx.graph.save(tmp_path / "block.gamms")
    modes = [{"attribute": "drive", "turns": obeys} for obeys in obeying]

    def run_anywhere(state):
        state["action"] = {"edge": state.rng.choice(state.legal_edges)} if state.legal_edges else state.curr_pos

    ends = set()
    for start in starts:
        *cops, prey = [{"node": node, "mode": mode} for node, mode in zip(start, modes, strict=True)]
        scene = Scenario(
            map={"file": "block.gamms"},
            folder=tmp_path,
            teams={
                "cops": {"agents": [{"name": f"cop_{i}", **cop} for i, cop in enumerate(cops)]},
                "prey": {"agents": [{"name": "prey", **prey}]},
            },
            rules=[{"rule": "tag", "with": {"taggers": "cops", "tagged": "prey", "then": "eliminate"}}, "last_team"],
            settings={"order": [["cops"], ["prey"]]},
            max_turns=12,
        )
        moves = count_moves_to_capture(roads, start, obeying)
        exact = {"cops": solve.exact_pursuers, "prey": solve.exact_evader}
        played = scene.play(strategies=exact)
        assert played.errors == []
        assert (played.turns, played.winner) == ((12, None) if moves is None else ((moves + 1) // 2, "cops"))
        ends.add(moves)
        with scene.batch(2, strategies=exact | {"prey": run_anywhere}) as games:
            games.run()
            for number, one in enumerate(games.seeds):
                result = games.result(number)
                assert result == scene.play(seed=one, strategies=exact | {"prey": run_anywhere})
                assert moves is None or result.turns <= (moves + 1) // 2
    assert len(ends) > 1


@pytest.mark.parametrize("seed", range(3))
def test_where_an_agent_can_be_follows_from_the_edges_that_it_can_have_driven(seed):
    roads = draw_roads(seed)
    with open_town(roads, seed) as ctx:
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        watcher = ctx.agent.create_agent("watcher", start_node_id=5, team="a")
        watcher.register_sensor("eyes", ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=11.0))
        car = ctx.agent.create_agent("car", start_node_id=6, team="b", mode=CAR, strategy=strategies.random_walk)
        known = {(node, ()) for node in range(SIDE * SIDE)}
        in_view = {4, 5, 6, 1, 9}
        sizes = set()

        def watch(state):
            nonlocal known
            state["action"] = state.curr_pos
            seen = state.sensors["eyes"]
            if state.turn:
                for node, driven in [*known]:
                    for edge in list_legal(roads, lengths, [*driven], node):
                        known.add((roads[edge][1], (*driven, edge)[-2:]))
            if "car" in seen:
                known = {(seen["car"], ())}
            known = {(node, driven) for node, driven in known if node not in in_view or "car" in seen}
            known = known or {(node, ()) for node in range(SIDE * SIDE) if node not in in_view}
            found = belief.observe(ctx, state).reachable("car")
            assert found == {node for node, _ in known}
            assert car.current_node_id in found
            sizes.add(len(found))

        watcher.strategy = watch
        for _ in range(25):
            ctx.game.step()
        assert ctx.game.errors == []
        assert len(sizes) > 3


def walk_by_chance(roads, lengths, chances):
    """Return the probabilities of (node, edges driven) after a random move, each neighbor and none equally likely."""
    found = dict.fromkeys(chances, 0.0)
    for (node, driven), chance in chances.items():
        edge_to = {}
        for edge in list_legal(roads, lengths, [*driven], node):
            known = edge_to.get(roads[edge][1], edge)
            edge_to[roads[edge][1]] = min((lengths[edge], edge), (lengths[known], known))[1]
        share = chance / (1 + len(edge_to))
        found[node, driven] += share
        for edge in edge_to.values():
            after = roads[edge][1], (*driven, edge)[-2:]
            found[after] = found.get(after, 0.0) + share
    return found


@pytest.mark.parametrize("seed", range(2))
def test_probabilities_of_an_agent_that_obeys_turns_are_those_of_a_plain_filter_over_the_edges_driven(seed):
    roads = draw_roads(seed)
    with open_town(roads, seed) as ctx:
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        watcher = ctx.agent.create_agent("watcher", start_node_id=5, team="a")
        watcher.register_sensor("eyes", ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=11.0))
        ctx.agent.create_agent("car", start_node_id=6, team="b", mode=CAR, strategy=strategies.random_walk)
        in_view = {4, 5, 6, 1, 9}
        anywhere = {(node, ()): 1.0 for node in range(SIDE * SIDE)}
        known = anywhere
        hidden = 0

        def watch(state):
            nonlocal known, hidden
            state["action"] = state.curr_pos
            seen = state.sensors["eyes"].get("car")
            before = walk_by_chance(roads, lengths, known) if state.turn else known
            possible = set(range(SIDE * SIDE)) - in_view if seen is None else {seen}
            known = {key: chance for key, chance in before.items() if key[0] in possible and chance > 0.0}
            known = known or {key: chance for key, chance in anywhere.items() if key[0] in possible}
            total = sum(known.values())
            known = {key: chance / total for key, chance in known.items()}
            by_node = {}
            for (node, _), chance in known.items():
                by_node[node] = by_node.get(node, 0.0) + chance
            found = belief.observe(ctx, state)
            assert found.probability("car") == pytest.approx(by_node)
            assert by_node.keys() <= found.reachable("car")
            hidden += seen is None

        watcher.strategy = watch
        for _ in range(20):
            ctx.game.step()
        assert ctx.game.errors == []
        assert 3 < hidden < 20


def test_a_target_with_a_goal_is_believed_on_the_shortest_route_that_obeys_turns(corner):
    chances = []

    def watch(state):
        state["action"] = state.curr_pos
        known = belief.observe(corner, state)
        chances.append(known.probability("car", belief.to_goals([3], wander=0.0)))

    eyes = {"eyes": gamms.sensor.agent_range(range_m=1.0)}
    corner.agent.create_agent("watcher", start_node_id=0, team="a", strategy=watch, sensors=eyes)
    corner.agent.create_agent("car", start_node_id=0, team="b", mode=CAR, strategy=strategies.goto(corner, 3))
    for _ in range(5):
        corner.game.step()
    assert chances == [{0: 1.0}, {1: 1.0}, {2: 1.0}, {1: 1.0}, {3: 1.0}]


def test_by_metres_a_target_that_obeys_turns_is_believed_on_the_edges_of_its_route(corner):
    corner.game.speed_unit = "metres"
    chances = []

    def watch(state):
        state["action"] = None
        known = belief.observe(corner, state)
        chances.append((known.probability("car", belief.to_goals([3], wander=0.0)), known.reachable("car")))

    eyes = {"eyes": gamms.sensor.agent_range(range_m=1.0)}
    corner.agent.create_agent("watcher", start_node_id=0, team="a", strategy=watch, sensors=eyes)
    car = corner.agent.create_agent("car", start_node_id=0, team="b", mode=CAR, speed=5.0)
    car.strategy = strategies.goto(corner, 3)
    for _ in range(9):
        corner.game.step()
    # 10 metres along each of the edges 0, 2, 3 and 4; an agent on an edge counts for the node behind it
    assert [found for found, _ in chances] == [{node: 1.0} for node in (0, 0, 1, 1, 2, 2, 1, 1, 3)]
    assert chances[-1][1] == {0, 1, 2, 3}  # turns exclude nothing of agents with a speed


def test_a_searcher_that_obeys_turns_follows_its_belief_about_a_target_that_does(corner):
    eyes = {"eyes": gamms.sensor.agent_range(range_m=1.0)}
    searcher = corner.agent.create_agent("car", start_node_id=0, mode=CAR, team="a", sensors=eyes)
    searcher.strategy = strategies.follow_belief(corner, motion=belief.random_walk(stay=1.0))
    corner.agent.create_agent("prey", start_node_id=3, team="b", mode=CAR, strategy=strategies.stay)
    places = []
    for _ in range(7):
        corner.game.step()
        places.append(searcher.current_node_id)
    assert places[-1] == 3
    assert corner.game.errors == []


def test_a_planner_places_agents_that_obey_turns_where_their_turns_can_have_led_them(corner):
    placed = {"mate": set(), "prey": set()}

    def plan(state):
        state["action"] = state.curr_pos
        model = planning.Model(state, opponents="gamms.strategies:random_walk", rollout="gamms.strategies:random_walk")
        for number in range(30 if state.turn == 2 else 0):
            model.sample(number)
            for name, nodes in placed.items():
                nodes.add(model.ctx.agent.get_agent(name).current_node_id)
            model.play(1, {})

    eyes = {"eyes": gamms.sensor.agent_range(range_m=1.0)}
    corner.agent.create_agent("planner", start_node_id=0, team="a", strategy=plan, sensors=eyes)
    for name, team in (("mate", "a"), ("prey", "b")):
        car = corner.agent.create_agent(name, start_node_id=0, team=team, mode=CAR)
        car.strategy = strategies.follow_path(corner, [1, 2])
    for _ in range(3):
        corner.game.step()
    assert placed == {"mate": {0, 1, 2}, "prey": {1, 2}}  # node 3 is two edges away, behind a forbidden turn


def test_the_mode_says_in_all_forms_that_turns_count(corner, town):
    assert corner.agent.create_agent("a", start_node_id=0, mode="drive with turns").mode == "drive with turns"
    assert len({*corner.graph.place(2, mode=CAR)}) == 2
    corner.agent.create_team("cars", [0, 2], columns={"mode": [CAR, "drive"]})
    assert sorted(str(agent.mode) for agent in corner.agent.create_iter() if agent.team == "cars") == [
        "drive",
        "drive with turns",
    ]
    with pytest.raises(BadType, match="must be True or False"):
        corner.agent.create_agent("b", start_node_id=0, mode={"attribute": "drive", "turns": "drive"})
    with pytest.raises(BadValue, match="select_mode takes no 'turns'"):
        corner.graph.routes.select_mode(CAR)
    with drive_in(town).build(seed=1) as ctx:
        assert ctx.agent.get_agent("cars_0").mode == "drive with turns"
    with pytest.raises(ScenarioError, match="turns"):
        Scenario(map={"file": "town.gamms"}, max_turns=2, teams={"a": {"mode": {**CAR, "turns": 3}}}, folder=town)


# -- by metres --------------------------------------------------------------------------------------------------------


def follow_signs(ctx, roads, lengths, history):
    """Check the edges that agents have entered in the last turn, and note them; return how many there are."""
    entered = 0
    for agent in ctx.agent.create_iter():
        own = history[agent.name]
        for leg in ctx.game.tracks([agent])[0].legs:
            assert leg.begin <= leg.end  # no agent turns back on an edge
            if leg.begin == 0.0 < leg.end:
                assert leg.edge in list_legal(roads, lengths, own, leg.source)
                own.append(leg.edge)
                entered += 1
    return entered


def move_anyhow(state):
    """Take a random legal node or edge, go on along two random nodes, or stop."""
    kind = state.draw.below(5)
    if kind == 0:
        state["action"] = None
    elif kind == 1 and state.legal_edges:
        state["action"] = {"edge": state.legal_edges[state.draw.below(len(state.legal_edges))]}
    else:
        state["action"] = state.legal[state.draw.below(len(state.legal))]


UNITS = {
    "metres": {"speed_unit": "metres"},
    "seconds": {"speed_unit": "metres_per_second", "turn_seconds": 2.0},
    "conflicts": {"speed_unit": "metres", "conflicts": Conflicts(1)},
}


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("seed", range(3))
def test_random_moves_by_metres_make_no_forbidden_turn(seed, unit):
    roads = draw_roads(seed)
    with open_town(roads, seed) as ctx:
        for name, value in UNITS[unit].items():
            setattr(ctx.game, name, value)
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        speeds = [4.0, 13.0, 10.0, 37.5, np.inf, None]
        for number, speed in enumerate(speeds):
            ctx.agent.create_agent(
                f"car_{number}", start_node_id=2 * number, speed=speed, mode=CAR, strategy=move_anyhow
            )
        history = {agent.name: [] for agent in ctx.agent.create_iter()}
        entered = 0
        for _ in range(60):
            ctx.game.step()
            entered += follow_signs(ctx, roads, lengths, history)
            for agent in ctx.agent.create_iter():
                here = agent.current_node_id
                if agent.edge is None and not list_legal(roads, lengths, history[agent.name], here):
                    agent.current_node_id = (here + 7) % (SIDE * SIDE)  # the signs leave no way: place it elsewhere
                    history[agent.name].clear()
        assert entered > 150
        assert ctx.game.errors == []


@pytest.mark.parametrize("seed", range(2))
def test_shipped_strategies_by_metres_make_no_forbidden_turn(seed):
    roads = draw_roads(seed)
    draw = random.Random(seed)
    with open_town(roads, seed) as ctx:
        ctx.game.speed_unit = "metres"
        lengths = {id: ctx.graph.get_edge(id).length for id in roads}
        for number, (name, make) in enumerate(GOING.items()):
            ctx.agent.create_agent(
                name,
                start_node_id=number,
                mode=CAR,
                speed=7.0 + 3.0 * number,
                team="ab"[number % 2],
                strategy=make(ctx, draw),
                sensors={"eyes": gamms.sensor.agent_range(range_m=25)},
            )
        history = {name: [] for name in GOING}
        entered = 0
        for _ in range(40):
            ctx.game.step()
            entered += follow_signs(ctx, roads, lengths, history)
        assert entered > 100
        assert ctx.game.errors == []


def test_the_legal_nodes_by_metres_are_those_of_all_walks_that_obey(corner):
    corner.game.speed_unit = "metres"
    agent = corner.agent.create_agent("car", start_node_id=0, speed=25.0, mode=CAR)
    legal = corner.game.internals.parts.turns.list_legal
    assert legal(["car"]) == {"car": (0, 1, 2)}  # the turn from 0 over 1 to 3 is forbidden
    agent.speed = 40.0
    assert legal(["car"]) == {"car": (0, 1, 2, 3)}  # 0, 1, 2, and back over 1 to 3


def test_an_agent_on_an_edge_goes_on_to_its_end(corner):
    corner.game.speed_unit = "metres"
    seen = []

    def drive(state):
        seen.append((state.legal, state.legal_edges, state["edge"]))
        state["action"] = 1

    corner.agent.create_agent("car", start_node_id=0, speed=4.0, mode=CAR, strategy=drive)
    for _ in range(2):
        corner.game.step()
    assert seen[1] == ((1, 2), (0,), (0, 1, 0))
    car = corner.agent.get_agent("car")
    corner.game.on_illegal = "raise"
    for back in ([0], [2]):
        car.strategy = lambda state, back=back: state.update(action=back)
        with pytest.raises(IllegalAction, match="does not turn back on an edge"):
            corner.game.step()


def test_a_list_of_nodes_takes_the_parallel_edge_from_which_it_may_go_on():
    roads = [(7, (0, 1), 9.0, [2]), (5, (0, 1), 10.0, []), (3, (1, 0), 10.0, []), (2, (1, 2), 10.0, [])]
    with open_fork(roads) as ctx:
        ctx.game.speed_unit = "metres"
        agent = ctx.agent.create_agent("car", start_node_id=0, speed=30.0, mode=CAR)
        for action, edges in (([1, 2], [5, 2]), (2, [5, 2]), ([1], [7])):
            agent.current_node_id = 2
            agent.current_node_id = 0
            agent.strategy = lambda state, action=action: state.update(action=action)
            ctx.game.step()
            assert [leg.edge for leg in ctx.game.tracks([agent])[0].legs] == edges


def test_a_game_by_metres_is_the_same_in_a_batch_from_a_snapshot_and_in_its_recording(town, tmp_path):
    cars = {"count": 3, "mode": CAR, "speed": 17.0, "strategy": "gamms.strategies:random_waypoints"}
    scenario = Scenario(
        map={"file": "town.gamms"}, max_turns=12, teams={"cars": cars}, settings={"speed_unit": "metres"}, folder=town
    )
    with scenario.batch(3) as games:
        games.run()
        assert not games.detached
        for number, seed in enumerate(games.seeds):
            assert games.result(number) == scenario.play(seed=seed)
        with pytest.raises(BadValue, match="by metres it does not know turn restrictions"):
            games.columns()
    with scenario.build(seed=4) as ctx:
        for _ in range(5):
            ctx.game.step()
        assert any(agent.edge is not None for agent in ctx.agent.create_iter())
        middle = ctx.game.snapshot()
        ends = []
        for _ in range(2):
            for _ in range(6):
                ctx.game.step()
            cars = [*ctx.agent.create_iter()]
            ends.append([(car.current_node_id, car.edge, car.offset_m) for car in cars])
            ends.append(dict(ctx.game.internals.state.driven))
            ctx.game.restore(middle)
        assert ends[:2] == ends[2:]
    with scenario.build(seed=4) as ctx:
        ctx.record.start(tmp_path / "game.ggr")
        known = []
        for _ in range(8):
            known.append(ctx.game.internals.parts.turns.list_legal([agent.name for agent in ctx.agent.create_iter()]))
            ctx.game.step()
        ctx.record.stop()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        for turn, legal in enumerate(known):
            with recording.resume(turn) as again:
                assert again.game.internals.parts.turns.list_legal([*legal]) == legal


def test_after_a_return_by_metres_an_agent_begins_there_and_a_loop_back_to_its_node_forgets_nothing(corner):
    corner.game.speed_unit = "metres"
    legal = corner.game.internals.parts.turns.list_legal
    go = {"action": [2, 1]}
    car = corner.agent.create_agent(
        "car", start_node_id=1, speed=20.0, mode=CAR, team="b", strategy=lambda state: state.update(go)
    )
    corner.game.step()
    assert car.current_node_id == 1
    assert legal(["car"]) == {"car": (1, 0, 3)}  # it came from 2, and does not turn back
    corner.agent.create_agent("cop", start_node_id=2, team="a", strategy=strategies.stay)
    corner.game.add(tag("a", "b", then="respawn"))
    go["action"] = [0, 1]
    corner.game.step()
    assert legal(["car"]) == {"car": (1, 2)}
    go["action"] = [2]
    corner.game.step()
    assert corner.game.events[-1]["kind"] == "respawned"
    assert legal(["car"]) == {"car": (1, 0, 2, 3)}
