"""An object of each public class, and of others that public calls return."""

import contextlib
import io
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import gamms
from gamms import (
    belief,
    bridge,
    experiment,
    graph,
    memory,
    osm,
    planning,
    recordings,
    rl,
    rules,
    sensor,
    solve,
    strategies,
    suite,
    tournament,
    visual,
    web,
)
from gamms.rendering import Fog, RenderOptions
from gamms.scenario import Scenario
from gamms.sensor.catalog import KINDS

WALKERS = {name: {"count": 2, "strategy": "gamms.strategies:random_walk"} for name in ("red", "blue")}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
HUNT = Scenario(map={"grid": {"rows": 4, "columns": 4}}, max_turns=9, teams=WALKERS, rules=[TAG])
DUEL = Scenario(
    map={"grid": {"rows": 2, "columns": 2}},
    max_turns=1,
    teams={"cat": {"agents": [{"name": "tom", "node": 0}]}, "mouse": {"agents": [{"name": "jerry", "node": 3}]}},
    rules=[{"rule": "tag", "with": {"taggers": "cat", "tagged": "mouse", "hops": 1}}],
)
Instances = dict[str, Any]


def instances(folder: Path, closing: contextlib.ExitStack) -> Instances:
    """Return the objects by name; files are in the folder, and `closing` ends what has to be ended."""
    return {
        **parts_of_a_game(closing),
        **values_of_a_turn(),
        **parts_of_a_batch(closing),
        **sensors(closing),
        **pictures(closing),
        **bridges(folder, closing),
        **stores(folder, closing),
        **recording_files(folder, closing),
        **maps(folder),
        **values(),
        **solutions(),
        **studies(),
        **pages(folder, closing),
    }


def parts_of_a_game(closing: contextlib.ExitStack) -> Instances:
    stream = io.BytesIO()
    ctx = HUNT.build(seed=1)
    closing.callback(ctx.terminate)
    ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=30)
    agent = ctx.agent.get_agent("red_0")
    agent.meta = {"fuel": 3}
    agent.register_sensor("eyes", ctx.sensor.get_sensor("eyes"))
    options = {"start_node_id": 0, "position": (0.0, 0.0, 5.0), "speed": 2.0}
    kite = ctx.agent.create_agent("kite", type="AERIAL", **options)
    ctx.graph.add_obstacle_face(0, (1, 1, 3), (5, 1, 3), (1, 1, 0), (5, 1, 0), 1)
    ctx.record.start(stream)
    ctx.game.run(2)
    ctx.record.stop()
    stream.seek(0)
    state = ctx.game.observation("red_0")
    recording = gamms.recorder.open(stream)
    closing.callback(recording.close)
    known = belief.observe(ctx, state)
    return {
        "context": ctx,
        "internal context": ctx.ictx,
        "game": ctx.game,
        "agent": agent,
        "kite": kite,
        "agents": ctx.agent.agents,
        "teams": ctx.agent.teams,
        "team": ctx.agent.create_team("crowd", [0, 1]),
        "sensor": ctx.sensor.get_sensor("eyes"),
        "graph engine": ctx.graph,
        "graph": ctx.graph.graph,
        "routes": ctx.graph.routes,
        "isochrones": ctx.graph.isochrone(0, 10.0),
        "node": ctx.graph.graph.get_node(0),
        "edge": ctx.graph.graph.get_edge(0),
        "face": ctx.graph.get_obstacle_face(0),
        "columns": ctx.graph.columns(),
        "agent engine": ctx.agent,
        "sensor engine": ctx.sensor,
        "memory engine": ctx.ictx.memory,
        "recorder": ctx.record,
        "pictures": ctx.visual,
        "artists": ctx.visual.artists,
        "settings": ctx.game.settings(),
        "moves": ctx.game.moves,
        "facts": ctx.game.facts,
        "scores": ctx.game.scores,
        "events": ctx.game.events,
        "rules": ctx.game.rules,
        "rng": ctx.rng,
        "snapshot": ctx.game.snapshot(),
        "fork": ctx.game.fork(1),
        "state": state,
        "state of a kite": ctx.game.observation("kite"),
        "draws": state["draw"],
        "belief": known,
        "sighting": belief.Sighting(1, 0, "red_0", None, 0.0),
        "filter": belief.Filter(ctx, belief.random_walk(), ["blue_0"]),
        "recording": recording,
        "state of a recording": recording[1],
        "robot": bridge.SimulatedRobot(ctx, "red_0"),
        "strategy": strategies.chase(ctx),
    }


def values_of_a_turn() -> Instances:
    """The arguments and results of functions that are called in a turn."""
    found: dict[str, Any] = {}

    def resolve(contest, ctx):
        found["contest"] = contest
        return contest.movers[: contest.places]

    def meet(ctx):
        found["contact"] = rules.contacts(ctx, "red", "blue", hops=9)[0]
        found["move"] = next(iter(ctx.game.moves.values()))

    def look_ahead(state):
        found["model"] = planning.Model(state, rollout=strategies.stay)
        state["action"] = state["curr_pos"]

    @gamms.array_rule
    def look(turn):
        found["turn of array rules"] = turn

    with HUNT.replace(rules=[]).build(seed=1) as ctx:
        ctx.agent.create_team("crowd", [0, 0])
        ctx.agent.create_agent("planner", start_node_id=0, team="red", strategy=look_ahead)
        ctx.game.command("crowd", wait, arrays=True)
        ctx.game.conflicts = rules.Conflicts(resolve=resolve)
        ctx.game.add(meet)
        ctx.game.add(look)
        ctx.game.run(2)
        found["plan"] = ctx.game.plans["crowd"]
    learners = rl.Learners(HUNT, 2, teams="red", reward=rewarded)
    learners.observe()
    learners.step(np.zeros((2, 2), int))
    return {**found, **_given, "learners": learners}


_given: Instances = {}  # what the functions below were called with: they stand here to be pickled


def wait(team):
    _given["arrays of a team"] = team
    return team.choose(team.counts - 1)


def rewarded(turn):
    _given["turn of learners"] = turn
    return turn.after.mask * 1.0


def parts_of_a_batch(closing: contextlib.ExitStack) -> Instances:
    games = HUNT.batch(2, seed=1)
    closing.callback(games.close)
    games.step()
    view = games.observe("red")
    return {
        "batch": games,
        "view": view,
        "streets": view.streets,
        "routes of a view": view.routes(),
        "draws of a view": view.draw,
        "vector": view.vector(),
        "enemies": view.enemies(),
        "roster": games.roster,
        "played game": games.game,
        "context of a batch": games.context(0),
        "scores of a batch": games.scores,
        "result": games.result(0),
        "columns of a batch": games.columns(),
        "filter of games": belief.GamesFilter(view.streets.columns, belief.random_walk(), games=2, targets=2),
    }


def sensors(closing: contextlib.ExitStack) -> Instances:
    """A sensor of each kind."""
    ctx = HUNT.build(seed=1)
    closing.callback(ctx.terminate)
    made = {f"sensor {kind.name}": ctx.sensor.create_sensor(kind.name, kind) for kind in KINDS}
    return {**made, "sensor of a function": ctx.sensor.from_function("fuel", lambda: 40)}


def pictures(closing: contextlib.ExitStack) -> Instances:
    ctx = HUNT.build(seed=1)
    closing.callback(ctx.terminate)
    eyes = ctx.sensor.create_sensor("eyes", "AGENT_RANGE", range_m=25.0)
    ctx.agent.create_agent("ann", start_node_id=0, team="green", sensors=[eyes])
    circle = visual.Circle(40, 20, radius=4)
    return {
        "fog": Fog(ctx, "green"),
        "circle": circle,
        "rectangle": visual.Rectangle(0, 0, width=20, height=20),
        "colors": visual.Color(),
        "look of an agent": visual.AgentData("ann"),
        "look of a graph": visual.GraphData(),
        "artist": visual.Artist(ctx, visual.Shape.Circle, layer=5),
        "camera": visual.RenderManager(ctx),
        "options of a picture": RenderOptions(last=4),
        "no pictures": gamms.create_context(vis_engine=visual.Engine.NO_VIS).visual,
    }


def bridges(folder: Path, closing: contextlib.ExitStack) -> Instances:
    ctx = HUNT.build(seed=1)
    closing.callback(ctx.terminate)
    link = closing.enter_context(bridge.Udp(to=("127.0.0.1", 9)))
    server = closing.enter_context(bridge.WebSocketServer())
    program = closing.enter_context(bridge.Process(["cat"]))
    tracks = {"ann": [{"t": 10.0 * i, "x": 8.0 * i, "y": 0.0} for i in range(4)]}
    fits = bridge.recording_from_tracks(tracks, ctx, folder / "rides.ggr", turn_seconds=20.0)
    return {
        "feed": bridge.Feed(),
        "link": link,
        "program": program,
        "server of a bridge": server,
        "connection to ROS": bridge.RosBridge(None, (0.0, 0.0), "map", None, Counter()),
        "drive": bridge.drive("red_0", bridge.Feed()),
        "checks": bridge.FixChecks(),
        "fix": bridge.Fix(t=1.0, x=0.0, y=0.0),
        "simulated clock": bridge.SimulatedClock(),
        "clock of the machine": bridge.WallClock(),
        "fit of a track": fits[0],
    }


def stores(folder: Path, closing: contextlib.ExitStack) -> Instances:
    path = memory.PathLike(str(folder / "games.db"))
    in_file = memory.SqliteStore("games", path)
    closing.callback(in_file.close)
    in_memory = memory.MemoryStore("visits")
    in_memory.create_map("nodes", {"id": int}, primary_key="id")
    return {"path": path, "store in a file": in_file, "store in memory": in_memory}


def recording_files(folder: Path, closing: contextlib.ExitStack) -> Instances:
    for seed in (1, 2):
        HUNT.play(seed=seed, record=str(folder / f"{seed}.ggr"))
    one, other = (closing.enter_context(gamms.recorder.open(folder / f"{seed}.ggr")) for seed in (1, 2))
    reader = closing.enter_context(gamms.recorder.Reader(folder / "1.ggr"))
    writer = gamms.recorder.Writer(io.BytesIO(), {})
    return {
        "recording in a file": one,
        "reader": reader,
        "writer": writer,
        "difference": recordings.first_difference(one, other),
    }


def maps(folder: Path) -> Instances:
    bend = folder / "bend.geojson"
    bend.write_text('{"type": "LineString", "coordinates": [[24.94, 60.17], [24.95, 60.17], [24.95, 60.18]]}')
    roads = osm.graph_from_geojson(bend, resolution=400.0)
    heights = folder / "N60E024.hgt"
    np.zeros((1201, 1201), ">i2").tofile(heights)
    bike = osm.modes()["bike"]
    return {
        "graph of a file": roads,
        "report": osm.report(roads, bend),
        "heights": osm.Elevation(heights),
        "mode": bike,
        "access": bike({"highway": "residential"}),
        "graph of networkx": graph.grid(2, 2),
    }


def values() -> Instances:
    return {
        "scenario": HUNT,
        "spec": HUNT.spec,
        "rule": rules.tag("red", "blue"),
        "conflicts": rules.Conflicts(capacity={1: 2}, edge_capacity="lanes"),
        "resolver": rules.by_priority(["red"]),
        "conflicts with a resolver": rules.Conflicts(resolve=rules.by_priority(["red"])),
        "random walk": belief.random_walk(0.1),
        "goals": belief.to_goals({1: 2.0, 3: 1.0}),
        "mixture": belief.mixture({belief.random_walk(): 1.0, belief.to_goals([3]): 2.0}),
        "language model": gamms.llm.Strategy("http://localhost:1/v1", "m", "Go."),
        "declaration of a sensor": sensor.agent_range(range_m=3.0),
    }


def solutions() -> Instances:
    solution = solve.solve(DUEL)
    chased = solve.pursuit(graph.grid(2, 2))
    seen = []
    solve.solve(DUEL, reward=lambda turn: seen.append(turn) or turn.gains["cat"])
    stay = strategies.stay
    return {
        "solution": solution,
        "choice": solution.policy("cat")[0],
        "solved strategy": solution.strategy("cat"),
        "transition": seen[0],
        "matrix game": solve.matrix_game([[1, -1], [-1, 1]]),
        "double oracle": solve.double_oracle(DUEL),
        "response": solve.best_response(DUEL, team="cat", against=stay),
        "pursuit": chased,
        "exact pursuers": chased.strategy("pursuers"),
        "population": rl.Population(DUEL, {"cat": [stay], "mouse": [stay]}, games=2),
        "evaluation on maps": rl.evaluate(DUEL, {"stay": stay}, team="cat", games=2),
        "evaluation": solve.evaluate(DUEL, stay, team="cat", opponents={"stay": stay}, games=2),
    }


def studies() -> Instances:
    rows = experiment.Rows([{"seed": 1, "turns": 9}], ("seed",), DUEL)
    pairs = [("rock", "scissors"), ("scissors", "paper"), ("paper", "rock")]  # the winner first
    won = {"round": 0, "faults": {}, "scores": {"red": 2, "blue": 0}, "winner": "red"}
    played = [{"seed": seed, "entries": {"red": one, "blue": two}, **won} for one, two in pairs for seed in range(3)]
    table = tournament.Table(played, entries=["paper", "rock", "scissors"])
    summary = suite.references()
    return {
        "rows": rows,
        "table": summary,
        "sample": experiment.sample({"teams.cops.count": (1, 8)}, n=4),
        "verification": experiment.Verification("0" * 64, 4, ("row",), (), ()),
        "task": suite.tasks()[0],
        "results of the suite": suite.Results(summary, {"duel": rows}),
        "table of a tournament": table,
        "standing": table.standings()[0],
        "rating": table.ratings()[0],
        "payoff": table.payoffs()["paper", "rock"],
        "cycle": table.cycles()[0],
    }


def pages(folder: Path, closing: contextlib.ExitStack) -> Instances:
    served = web.study(HUNT, people="red", consent="Do you agree?", out=folder / "study")
    return {
        "live game": closing.enter_context(web.serve(HUNT, is_paused=True)),
        "study": closing.enter_context(served),
    }
