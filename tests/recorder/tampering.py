"""Games with every shipped rule and strategy, and recordings of them in which stored values are others."""

import copy
import io
import random

import numpy as np
from recordings import opened

import gamms
from gamms import rules, strategies
from gamms.bridge import SimulatedRobot, drive
from gamms.errors import GammsError
from gamms.recorder import Writer
from gamms.rules import territory

QUIET = {"level": "CRITICAL"}
JUNK = [
    *(None, True, 0, -1, 3, 7, 99, 1 << 40, 1 << 63, -(1 << 70), 10**400, 0.5, -0.5, float("nan"), float("inf")),
    *(
        "",
        "anna",
        "red0",
        "blue1",
        "red",
        "x" * 40,
        b"",
        b"abc",
        [],
        [1, 2],
        ["a", ["b"]],
        [None],
        (),
        (1, "a"),
        (3, 2),
    ),
    *(10**18, -(10**18), [10**18], {"red0": 10**18}, {"red0": -(10**15)}, 1e300, -1e300),
    *({}, {"a": 1}, {"red0": 3}, {"red": "red0"}, {1: {}}, {"red0": "x"}, set(), {1, "b"}, {99}, frozenset()),
    *(np.zeros(0), np.arange(3), np.zeros((2, 2))),
]
KEYS = ["nobody", "red", "blue0", "red0", 5, None, (1, 2)]
PARTS = ("data", "memories", "team_memories", "facts", "scores", "events", "starts", "turn", "named_edges", "driven")


class Builder:
    """Makes contexts with agents; or, after a fresh resume, gives strategies to those that are there."""

    def __init__(self, ctx=None, **game):
        self.is_new = ctx is None
        self.ctx = ctx
        if ctx is None:
            self.ctx = gamms.create_context(seed=3, logger_config=QUIET, game=game or None)
            self.ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5, 10.0))
            self.ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=30)

    def team(self, name, *members, nodes=range(25), **options):
        for number, strategy in enumerate(members):
            if self.is_new:
                options |= {"start_node_id": nodes[number], "team": name, "sensors": ["eyes"]}
                self.ctx.agent.create_agent(f"{name}{number}", strategy=strategy, **options)
            else:
                self.ctx.agent.get_agent(f"{name}{number}").strategy = strategy

    def rules(self, *added):
        for rule in added:
            self.ctx.game.add(rule)
        return self.ctx


def tags(ctx=None):
    make = Builder(ctx)
    ctx = make.ctx
    make.team("red", strategies.chase(ctx), strategies.intercept(ctx), strategies.assign(ctx))
    exits = strategies.safest_exit(ctx, [24])
    make.team("blue", strategies.flee(ctx), exits, strategies.random_walk, nodes=[24, 23, 22])
    paid = {"tag": {"agent": 1, "other": -1}}
    return make.rules(
        rules.tag("red", "blue", then="eliminate", score=2),
        rules.tag("blue", "red", hops=1),
        rules.respawn(1, times=5),
        rules.payoff(paid, zero_sum=True),
        rules.time_limit(50),
        rules.last_team(),
    )


def flags(ctx=None, **game):
    make = Builder(ctx, **game)
    ctx = make.ctx
    speed = {"speed": 13.0} if game else {}
    patrol = strategies.patrol(ctx, [0, 12])
    make.team("red", strategies.goto(ctx, 24), patrol, strategies.random_waypoints(ctx, pause=1), **speed)
    circle = strategies.follow_path(ctx, [24, 3, 7], repeat=True)
    swept = strategies.unblock(strategies.sweep(ctx, by_sight=True))
    make.team("blue", strategies.goto(ctx, 0), circle, swept, nodes=[24, 23, 22], **speed)
    ctx.game.conflicts = rules.Conflicts()
    return make.rules(
        territory.published(territory.halves(ctx)),
        rules.tag("red", "blue", territory="territory", mutual=True),
        rules.capture_flag({"red": 0, "blue": 24}, territory="territory", goal=9),
        rules.respawn(2, teams="red"),
        rules.time_limit(40),
    )


def flags_by_metres(ctx=None):
    return flags(ctx, speed_unit="metres")


def marks(state):
    strategies.random_walk(state)
    state["action"] = {"node_id": state["action"], "do": {"mark": 1}}


def places(ctx=None):
    make = Builder(ctx, deeds={"mark": {"what": "integer"}})
    ctx = make.ctx
    make.team("red", marks, strategies.sweep(ctx, repeat=True), strategies.guard(ctx, 12, 30.0))
    mixed = strategies.mix(0.5, strategies.patrol(ctx, [3, 8]), strategies.stay)
    several = strategies.first(strategies.chase(ctx, otherwise=None), strategies.patrol(ctx, [1, 2]))
    make.team("blue", marks, mixed, several, nodes=[24, 23, 22])
    return make.rules(
        rules.hold([0, 1, 2], 3, ends=False, score=1),
        rules.discover({3: "x", 7: "y"}, hops=1, score=1),
        rules.resource("fuel", 50.0, per_edge=1, per_metre=0.1, per_deed={"mark": 2}, recharge={12: 5}),
        rules.cooldown("mark", 2),
        rules.reach({"red": "starts of blue", "blue": [0]}, score=1),
        rules.arrive("blue", [4]),
        rules.none_left("blue"),
        rules.time_limit(50),
    )


def beliefs(ctx=None):
    make = Builder(ctx)
    follow = strategies.follow_belief(make.ctx)
    make.team("red", follow, follow)
    make.team("blue", strategies.random_walk, strategies.random_walk, nodes=[24, 23])
    return make.rules(rules.tag("red", "blue"), rules.time_limit(30))


@gamms.array_rule
def storm(turn):
    kept = turn.keep("storm", lambda games: {"level": np.zeros((games, 2)), "count": np.zeros(games, np.int64)})
    kept["level"][:] += 1
    kept["count"] += 1


@gamms.array_strategy
def count_and_stay(view):
    kept = view.keep("count", lambda games: {"last": np.zeros((games, 3), np.int64)})
    kept["last"][:] += 1
    return np.zeros(view.node.shape, np.int64)


def arrays(ctx=None):
    make = Builder(ctx)
    counting = count_and_stay(make.ctx)
    make.team("red", counting, counting, strategies.random_walk)
    return make.rules(storm, rules.time_limit(30))


def robots(ctx=None):
    make = Builder(ctx)
    make.team("red", strategies.patrol(make.ctx, [0, 5]))
    robot = SimulatedRobot(make.ctx, "red0", speed=20.0)
    return make.rules(drive("red0", robot, limit_s=2.0), rules.time_limit(30))


def names_edges(state):
    state["action"] = {"edge": state["draw"].choice(state["legal_edges"])}


def cars(ctx=None):
    make = Builder(ctx)
    graph = make.ctx.graph.graph
    if make.is_new:
        leaving = {}
        for id in graph.get_edges():
            leaving.setdefault(graph.get_edge(id).source, []).append(id)
        for id in [*graph.get_edges()]:
            then = leaving[graph.get_edge(id).target][0]
            last = leaving[graph.get_edge(then).target][0]
            graph.update_edge({"id": id, "drive": True, "forbidden_turns": {"drive": [[then, last]]}})
    mode = {"attribute": "drive", "turns": True}
    make.team("red", strategies.random_walk, strategies.random_waypoints(make.ctx), nodes=[12, 3], mode=mode)
    make.team("blue", names_edges, nodes=[24])
    return make.rules(rules.time_limit(30))


GAMES = {one.__name__: one for one in (tags, flags, flags_by_metres, places, beliefs, arrays, robots, cars)}


class RecordedGame:
    """A game after five turns, as a recording begins with it.

    Attributes:
        build: makes the game anew.
        header: of the recording.
        begin: the first keyframe.
    """

    def __init__(self, build):
        self.build = build
        stream = io.BytesIO()
        with build() as ctx:
            ctx.game.run(5)
            ctx.record.start(stream)
            ctx.game.step()
            ctx.record.stop()
        reader = opened(stream.getvalue())
        self.header = copy.deepcopy(reader.header)
        self.begin = copy.deepcopy(reader.keyframe(0)[1])

    def written(self, begin):
        """Return the bytes of a recording that begins with another keyframe."""
        stream = io.BytesIO()
        writer = Writer(stream, self.header)
        writer.keyframe(begin)
        writer.close()
        return stream.getvalue()

    def changed(self, path, value):
        """Return the bytes of the recording with another value at a path in its keyframe."""
        return self.written(put(self.begin, path, lambda _: value))

    def mutant(self, rng):
        """Return the bytes of the recording with other values somewhere; None: such a file cannot be written."""
        begin = self.begin
        part = rng.choice([one for one in PARTS if one in begin])
        places = [(part, *path) for path in paths(begin[part])]
        for _ in range(rng.choice((1, 1, 1, 2))):
            begin = spoiled(begin, rng.choice(places), rng)
        try:
            return self.written(begin)
        except GammsError:
            return None


def paths(value, path=()):
    """Yield the paths of all values in a value."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, (list, tuple)) else ()
    for key, one in items:
        yield from paths(one, (*path, key))


def put(value, path, change):
    """Return a copy of a value in which the value at a path is changed; an unknown path changes nothing."""
    if not path:
        return change(value)
    key, *rest = path
    if isinstance(value, dict):
        return {one: put(inner, rest, change) if one == key else inner for one, inner in value.items()}
    if not isinstance(value, (list, tuple)):
        return value
    return type(value)([put(inner, rest, change) if one == key else inner for one, inner in enumerate(value)])


def spoiled(value, path, rng):
    """Return a copy of a value in which a value at a path is another one, is missing, or has another key."""
    junk = copy.deepcopy(rng.choice(JUNK))
    how = rng.random()
    if how < 0.1 and len(path) > 1:
        return put(value, path[:-1], lambda known: _without(known, path[-1]))
    if how < 0.2 and len(path) > 2:
        key = rng.choice(KEYS)
        return put(value, path[:-1], lambda known: _with_key(known, path[-1], key))
    return put(value, path, lambda _: junk)


def _without(known, key):
    return {one: inner for one, inner in known.items() if one != key} if isinstance(known, dict) else known


def _with_key(known, key, other):
    return {other if one == key else one: inner for one, inner in known.items()} if isinstance(known, dict) else known


def go_on(game, data, how):
    """Resume a recording and play on: in a game that was built, in one without rules and strategies, or in a batch."""
    with gamms.recorder.open(io.BytesIO(data)) as recording:
        if how == "fresh":
            with recording.resume(0) as ctx:
                game.build(ctx)
                ctx.game.run(2)
            return
        with game.build() as ctx:
            recording.resume(0, ctx=ctx)
            if how == "batch":
                games = ctx.game.batch(2)
                games.step()
                games.step()
                games.result(0)
            else:
                ctx.game.run(2)


def fuzz(name, seed, count):
    """Go on from so many mutants of a game: each works or raises, and none takes long or much memory."""
    game = RecordedGame(GAMES[name])
    for number in range(count):
        rng = random.Random(f"{name}/{seed}/{number}")
        data = game.mutant(rng)
        if data is None:
            continue
        try:
            go_on(game, data, rng.choice(["built", "built", "fresh", "batch"]))
        except MemoryError as error:
            raise AssertionError(f"mutant {name}/{seed}/{number}: {error}") from error
        except Exception:  # noqa: BLE001 - of a rule or a strategy that cannot go on from a value
            continue
