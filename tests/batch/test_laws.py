"""The law of batches: whatever is played in arrays is played as the turn engine plays it, event by event."""

import re
import zlib
from itertools import accumulate

import numpy as np
from batch_scenes import plain
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import gamms
from gamms.rules import (
    Conflicts,
    at_random,
    by_priority,
    capture_flag,
    cooldown,
    hold,
    last_team,
    nobody,
    payoff,
    reach,
    resource,
    respawn,
    tag,
    territory,
    time_limit,
)
from gamms.strategies import (
    assign,
    chase,
    first,
    flee,
    follow_path,
    goto,
    guard,
    intercept,
    mix,
    patrol,
    random_walk,
    random_waypoints,
    sweep,
)
from gamms.typing.sensor_engine import SensorType

LAWS = settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
LARGE = settings(LAWS, phases=[Phase.generate])  # games are too large to be made smaller in reasonable time
TEAMS = ("red", "blue", "green", None)
NODES = [3 * number + 2 for number in range(14)]  # ids that are no rows

nodes, teams = st.sampled_from(NODES), st.sampled_from(TEAMS[:3])
scores = st.sampled_from([0, 1, 2, 0.1])
distances = st.one_of(
    st.just({}),
    st.fixed_dictionaries({"hops": st.sampled_from([0, 1, 2.5])}),
    st.fixed_dictionaries({"metres": st.sampled_from([0.7, 1.9])}),
    st.fixed_dictionaries({"euclid": st.sampled_from([1, 1.5])}),
)
owners = st.dictionaries(nodes, st.sampled_from(TEAMS), min_size=4)
places = st.lists(nodes, min_size=1, max_size=4, unique=True)


@st.composite
def tags(draw):
    keywords = draw(distances) | draw(
        st.fixed_dictionaries(
            {"then": st.sampled_from(["respawn", "eliminate"]), "score": scores},
            optional={
                "territory": st.one_of(owners, st.just("land")),
                "mutual": st.booleans(),
                "passing": st.booleans(),
                "crossing": st.booleans(),
            },
        )
    )
    return tag(draw(teams), draw(teams), **keywords)


flags = st.builds(
    capture_flag,
    st.dictionaries(teams, nodes, min_size=1),
    territory=st.one_of(st.none(), owners, st.just("land")),
    goal=st.sampled_from([None, 1, 2]),
    score=scores,
    passing=st.booleans(),
)
goals = st.builds(
    reach,
    st.dictionaries(teams, st.one_of(places, st.just("starts of red")), min_size=1),
    score=scores,
    passing=st.booleans(),
)
held = st.builds(
    hold,
    places,
    st.integers(1, 3),
    every=st.booleans(),
    score=scores,
    ends=st.booleans(),
    teams=st.one_of(st.none(), st.lists(teams, min_size=1)),
)
back = st.builds(respawn, st.integers(1, 3), times=st.sampled_from([None, 1]), teams=st.sampled_from([None, "red"]))
paid = st.builds(
    payoff,
    st.just({"tag": {"agent": 0.3, "other": -0.7}, "hold": {"team": 1 / 3}, "capture": {"agent": 5, "flag": -2}}),
    zero_sum=st.booleans(),
)
fuel = st.builds(
    resource,
    st.sampled_from(["fuel", "water"]),
    st.sampled_from([0, 2, 3.5]),
    per_metre=st.sampled_from([0, 0.6]),
    per_edge=st.sampled_from([0, 0.5]),
    per_turn=st.sampled_from([0, 0.1]),
    recharge=st.dictionaries(nodes, st.sampled_from([0.3, 1]), max_size=3),
    capacity=st.sampled_from([3.5, 5]),
    empty=st.sampled_from(["stay", "eliminate"]),
    teams=st.sampled_from([None, "red", ["blue", "green"]]),
)
ends = st.one_of(st.builds(time_limit, st.integers(3, 9)), st.builds(last_team))
rules = st.tuples(
    st.lists(tags(), max_size=2), *(st.lists(one, max_size=1) for one in (flags, goals, fuel, held, back, paid, ends))
).map(lambda lists: [rule for some in lists for rule in some])
conflicts = st.builds(
    Conflicts,
    st.one_of(st.sampled_from([None, 1, 2, "room"]), st.dictionaries(nodes, st.integers(0, 2), min_size=1)),
    st.sampled_from(["all", "team"]),
    edge_capacity=st.one_of(st.none(), st.integers(1, 2), st.dictionaries(st.integers(0, 12), st.integers(0, 2))),
    allow_swaps=st.booleans(),
    resolve=st.sampled_from([at_random(), nobody(), by_priority(["blue", None, "red", "green"])]),
)
phases = st.sampled_from(["before", "deeds", "after"])
orders = st.one_of(
    st.none(),
    st.permutations(TEAMS).flatmap(
        lambda teams: st.integers(1, 4).map(lambda n: [one for k in range(n) if (one := list(teams[k::n]))])
    ),
)


@st.composite
def maps(draw):
    """Nodes in two rows, with streets of odd lengths, some of them one-way."""
    return draw(st.lists(st.tuples(st.sampled_from([0.5, 0.7, 1.1]), st.booleans()), min_size=33, max_size=33))


DEEDS = {"scan": {"node": "node"}, "mark": {"whom": "agent?", "size": "number", "how": ["near", "far"]}, "rest": {}}


def busy(state):
    """Walk at random, and do several things."""
    legal, draw, do = state["legal"], state["draw"], {}
    node = legal[draw.below(len(legal))]
    if draw.random() < 0.5:
        do["scan"] = {"node": node}
    if draw.random() < 0.4:
        do["mark"] = {"size": draw.random(), "how": "near"} | ({"whom": "a0"} if state["name"] < "b" else {})
    if draw.random() < 0.3:
        do["rest"] = None
    state["action"] = {"node_id": node, "do": do} if do else node


def busy_in_arrays(view):
    actions = view.draw.below(view.counts)
    view.do("scan", view.draw.random() < 0.5, node=view.movement.nodes(view.choices, actions))
    marks = view.only(view.draw.random() < 0.4)
    is_early = np.array([name < "b" for name in view["name"]])
    view.do("mark", marks.mask, size=marks.draw.random(), how="near", whom=np.where(is_early, 0, -1))
    view.do("rest", view.draw.random() < 0.3)
    return actions


busy.array_form = busy_in_arrays


def curious(state):
    """Do what follows from all that the agent sees, knows and remembers, and from why its last action was not done."""
    attentive(state, state["blocked"])


# What games leave arrays for: an agent that is asked comes, or one whose sensor draws for several or reports late;
# or one asks why a rule in arrays has refused its move.
LEAVE = re.compile("comes with the s|comes with a sensor that reports late|why a rule has refused a move")


def attentive(state, *more):
    """Do what follows from all that the agent sees, knows and remembers."""
    legal, memory, shared = state["legal"], state["memory"], state.get("team_memory", {})
    sights = {name: (str(kind), [*data.items()]) for name, (kind, data) in state["sensor"].items() if kind in SHOWN}
    sights |= {name: (str(kind), data) for name, (kind, data) in state["sensor"].items() if kind not in SHOWN}
    facts = {name: repr(value) for name, value in state["facts"].items() if name in ("land", "flags")}
    known = [sights, facts, [*memory.items()], sorted(shared.items()), state["name"], state["team"], state["turn"]]
    known += [state.get(key) for key in ("inbox", "edge", "offset_m", "xy")]
    lot = zlib.crc32(repr([*known, legal, state["curr_pos"], *more, state["draw"].below(3)]).encode())
    memory[state["turn"]] = lot % 97
    if lot % 3 == 0:
        shared[state["name"]] = shared.get(state["name"], 0) + 1
    state["action"] = legal[lot % len(legal)] if lot % 11 else lot % 50
    if "edge" in state and lot % 7 == 0:
        state["action"] = None
    elif lot % 13 < 4:
        state["action"] = stroll(state["curr_pos"], lot)
    if lot % 5 == 0:
        messages = [{"channel": "radio", "to": [None, "red", "a0"][lot % 3], "body": [lot % 9]} for _ in range(lot % 4)]
        state.get("outbox", []).extend(messages)
    if "deeds" in state and lot % 2:
        do = {"scan": {"node": legal[-1]}, "rest": None} if lot % 4 == 1 else {"mark": {"size": lot % 5, "how": "far"}}
        state["action"] = {"node_id": state["action"], "do": do}


def stroll(node, lot):
    """Return a list of nodes, most of which follow each other, that may wait, turn back, or lead nowhere."""
    number, steps = NODES.index(node), [0, 1, -1, 6, -6, 7, -7, 1]
    numbers = accumulate([steps[lot // 8**i % 8] for i in range(lot % 5)], initial=number)
    return [NODES[number % 14] for number in numbers][lot % 2 :]


def agreed(states):
    """Let each agent of a team do what it would do by itself, but for the first."""
    for state in states.values():
        attentive(state)
    first = next(iter(states.values()))
    first["action"] = first["legal"][0]


SHOWN = (SensorType.AGENT, SensorType.AGENT_RANGE)


def strike(ctx):
    """Let agents that are marked go back, or out if they are marked much; end the game if several rest."""
    for deed in ctx.game.performed("mark"):
        ctx.game.emit("marked", agent=deed.agent, at=deed.at)
        if "whom" in deed.values:
            (ctx.game.eliminate if deed.values["size"] > 0.7 else ctx.game.respawn)(deed.values["whom"])
    if ctx.game.turn == 4 and len(ctx.game.performed("rest")) > 2:
        ctx.game.end("rest")


def strike_in_arrays(turn):
    done = turn.performed("mark")
    others, is_out = done.values["whom"], done.values["size"] > 0.7
    for number in range(max(np.bincount(done.at), default=0)):  # the marks of a game one after the other
        rank = np.arange(len(done.at)) - np.searchsorted(done.at, done.at)
        those = rank == number
        turn.emit("marked", done.at[those], agents={"agent": done.agents[those]}, nodes={"at": done.nodes[those]})
        out, back = those & (others >= 0) & is_out, those & (others >= 0) & ~is_out
        turn.eliminate(done.at[out], others[out])
        turn.respawn(done.at[back], others[back])
    resting = np.bincount(turn.performed("rest").at, minlength=len(turn.games))
    ended = np.flatnonzero((turn.turn == 4) & (resting > 2))
    turn.end(ended, "rest", [None] * len(ended))


strike.array_form = strike_in_arrays


def look(ctx):
    """Note all that a rule sees of agents and how they move."""
    game, seen = ctx.game, []
    for agent, track in zip(game.agents, game.tracks(game.agents), strict=True):
        place = [
            agent.current_node_id,
            agent.prev_node_id,
            agent.edge,
            agent.offset_m,
            *agent.xy,
            game.start_node(agent),
        ]
        seen.append([agent.name, place, list(track.path), list(track.times), [list(leg) for leg in track.legs]])
    moves = [[name, move.start, move.end, list(move.path)] for name, move in game.moves.items()]
    done = [[deed.agent, deed.kind, deed.at, dict(deed.values)] for deed in game.performed()]
    game.emit("seen", agents=seen, moves=moves, deeds=done)


def push(ctx):
    """Put agents elsewhere, out of the game, or back where they are, by lots."""
    draw = ctx.stream("push", ctx.game.turn)
    for agent in ctx.game.agents:
        lot = draw.random()
        if lot < 0.04:
            ctx.game.eliminate(agent)
        elif lot < 0.2:
            ctx.game.respawn(agent)
        elif lot < 0.3:
            agent.current_node_id = NODES[int(draw.integers(14))] if lot < 0.25 else agent.current_node_id


def recruit(ctx):
    """Let agents come, others in games of other seeds, and move those that have come."""
    named, turn = "bzy"[ctx.seed % 2 :], ctx.game.turn
    for name in named:
        if f"{name}9" not in ctx.agent.agents and (turn + ord(name)) % 4 == ctx.seed % 3:
            like = ctx.agent.get_agent(min(ctx.agent.agents))
            given = {"team": like.team, "strategy": like.strategy, "speed": like.speed, "sensors": dict(like.sensors)}
            given |= {"start_node_id": NODES[(turn + ctx.seed) % 14], "rank": turn}
            given = {key: value for key, value in given.items() if value is not None}
            ctx.agent.create_agent(f"{name}9", **given)
            break
    ctx.game.scores["ranks"] = sum(getattr(agent, "rank", 0) for agent in ctx.game.agents)


def refuse(ctx):
    """Refuse moves and deeds by lots."""
    draw = ctx.stream("refuse", ctx.game.turn)
    for name in ctx.game.moves:
        lot = draw.random()
        if lot < 0.2:
            ctx.game.refuse(name, "a lot", None if lot < 0.1 or not ctx.game.deeds else "scan")


def refuses(_):
    """Do nothing but what the check does."""


refuses.check = refuse


class FirstOnly:
    """A conflict resolver: of those that come to the same node, only the one that is last by name may move there."""

    def resolve(self, moves, ctx):
        last = {move.end: name for name, move in moves.items()}
        return {name for name, move in moves.items() if last[move.end] != name} if ctx.game.turn % 3 else set()


TAKEN = {
    "game": lambda ctx: [ctx.game.turn, dict(ctx.game.scores), len(ctx.game.events), ctx.game.over is None],
    "agent": lambda agent: [agent.current_node_id, agent.prev_node_id, agent.edge, agent.offset_m, agent.alive],
}
CALLED = {"look": look, "push": push, "recruit": recruit, "refuses": refuses}


KINDS = [
    {"type": "AGENT_RANGE", "sensor_range": 4.0},
    {"type": "AGENT"},
    {"type": "AGENT_RANGE", "sensor_range": 1.6, "detection": [[0.0, 0.9], [1.5, 0.4]]},
    {"type": "AGENT_RANGE", "sensor_range": 2.5, "position_noise_m": 0.8},
    {"type": "AGENT_RANGE", "sensor_range": 3.0, "delay_turns": 2, "detection": 0.7},
    {"type": "AGENT_RANGE", "sensor_range": 2.0, "false_alarm_rate": 0.6},
    {"type": "AGENT", "delay_turns": 1, "position_noise_m": 0.4, "false_alarm_rate": 0.3},
    {"type": "AGENT_RANGE", "sensor_range": 2.5, "at": (3.0, 0.5), "false_alarm_rate": 0.8, "delay_turns": 1},
    {"type": "AGENT_ARC", "sensor_range": 3.0, "fov": 2.0, "detection": 0.6, "delay_turns": 1},
]


def open_game(
    streets,
    agents,
    rules,
    conflicts,
    early=(),
    order=None,
    motion=None,
    deeds=None,
    called=(),
    asked="",
    channels=None,
    shared=True,
    kinds=(0,),
    collected=(),
):
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"}, game={"max_turns": 10})
    ctx.game.deeds = {} if deeds is None else DEEDS
    for number, node in enumerate(NODES):
        ctx.graph.graph.add_node({"id": node, "x": number % 7, "y": number // 7, "room": number % 4})
    pairs = [(i, i + step) for i in range(14) for step in (1, 6, 7) if i + step < 14][: len(streets)]
    edge = 0
    for (start, end), (length, is_one_way) in zip(pairs, streets, strict=False):
        for source, target in [(start, end), (end, start)][: 1 if is_one_way else 2]:
            ways = {
                "id": edge,
                "source": NODES[source],
                "target": NODES[target],
                "length": length,
                "slow": 2.0 - length,
            }
            ctx.graph.graph.add_edge(ways)
            edge += 1
    motion = motion or {}
    for number, (name, (team, node)) in enumerate(agents.items()):
        made = [random_walk if deeds is None else busy, *(PACED[one](ctx) for one in motion.get("strategies", ()))]
        kind = KINDS[kinds[number % len(kinds)]]
        sees = [ctx.sensor.create_sensor(f"eyes of {name}", **kind).sensor_id]
        if asked and number % 2:
            sees.append(ctx.sensor.create_sensor(f"feet of {name}", "NEIGHBOR").sensor_id)
        if name[0] in asked:
            made = [curious if "w" in asked else attentive]
        agent = ctx.agent.create_agent(
            name, start_node_id=node, team=team, strategy=made[number % len(made)], sensors=sees
        )
        if motion.get("speeds"):
            agent.speed = motion["speeds"][number % len(motion["speeds"])]
    for name in motion.keys() - {"strategies", "speeds"}:
        setattr(ctx.game, name, motion[name])
    ctx.game.add(territory.published({node: "red" if node < 20 else "blue" for node in NODES}, "land"))
    for number, rule in enumerate(rules):
        ctx.game.add(rule, phase="before" if number in early else "after")
    for phase in deeds or ():
        ctx.game.add(strike, phase=phase)
    for kind in ("scan", "mark") if deeds else ():
        ctx.game.add(cooldown(kind, 2), phase=deeds[0])
    if deeds is not None and "speed_unit" not in (motion or {}):  # what is used up by edges has no form by metres
        prices = {"rest": 0.4, "mark": 0.7, "scan": 1}
        ctx.game.add(resource("power", 3, per_deed=prices, per_edge=0.2, recharge=dict.fromkeys(NODES[::3], 2)))
    for name, phase in called:
        ctx.game.add(CALLED[name], phase=phase)
    for every, per in collected:
        ctx.game.collect(f"{per} {every}", TAKEN[per], every, per)
    ctx.game.conflicts, ctx.game.order, ctx.game.channels = conflicts, order, channels or {}
    ctx.game.team_memory = shared
    if "p" in asked:
        ctx.game.command(ctx.agent.get_agent(min(agents)).team, agreed)
    return ctx


RADIOS = [
    {"range_m": 2.5, "delay_turns": 1},
    {"hops": 2, "relay": True, "loss": 0.3},
    {"range_m": 9.0, "teams": ["red"]},
]


PACED = {
    "goto": lambda ctx: goto(ctx, 17),
    "patrol": lambda ctx: patrol(ctx, [5, 32, 20]),
    "waypoints": lambda ctx: random_waypoints(ctx, pause=1),
    "chase": chase,
    "assign": lambda ctx: assign(ctx, patience=1),
    "intercept": intercept,
    "cut off": lambda ctx: intercept(ctx, [8, 35]),
    "sweep": lambda ctx: sweep(ctx, repeat=True),
    "sweep by sight": lambda ctx: sweep(ctx, by_sight=True, repeat=True),
    "flee": flee,
    "guard": lambda ctx: guard(ctx, 23, 1.9),
    "mix": lambda ctx: mix(0.5, random_walk, first(chase(ctx, None), follow_path(ctx, [8, 35], repeat=True))),
}
BY_EDGES = {"guard", "intercept", "cut off"}
motions = st.one_of(
    st.none(),
    st.just({"legal": "any", "strategies": ["chase", "flee", "guard", "assign", "intercept", "cut off", "sweep"]}),
    st.fixed_dictionaries(
        {
            "speed_unit": st.just("metres"),
            "weight": st.sampled_from(["length", "slow"]),
            "decide": st.sampled_from(["turn", "arrival"]),
            "speeds": st.lists(st.sampled_from([None, 0.3, 0.5, 1.0, 1.9, 3]), min_size=1, max_size=3),
            "strategies": st.lists(
                st.sampled_from(sorted(PACED.keys() - {"guard", "intercept", "cut off"})), max_size=3
            ),
        }
    ),
    st.fixed_dictionaries(
        {
            "speeds": st.lists(st.sampled_from([None, 0.4, 1.0, 1.5, 2, 2.7, 3]), min_size=1, max_size=3),
            "strategies": st.lists(st.sampled_from(sorted(PACED)), max_size=3),
        }
    ),
)


@LARGE
@given(
    streets=maps(),
    places=st.lists(st.tuples(st.sampled_from(TEAMS), nodes), min_size=2, max_size=9),
    rules=rules,
    conflicts=st.one_of(st.none(), conflicts, st.just(FirstOnly())),
    seeds=st.lists(st.integers(0, 2**62), min_size=1, max_size=3),
    restart=st.tuples(st.integers(0, 9), st.integers(0, 2)),
    early=st.sets(st.integers(0, 9), max_size=2),
    order=orders,
    motion=motions,
    deeds=st.one_of(st.none(), st.lists(phases, max_size=2)),
    called=st.one_of(st.just([]), st.lists(st.tuples(st.sampled_from(sorted(CALLED)), phases), max_size=3)),
    asked=st.sampled_from(["", "a", "bc", "abc", "p", "bcw", "abcw"]),
    radio=st.sampled_from([None, *RADIOS]),
    shared=st.sampled_from([True, True, False]),
    kinds=st.lists(st.integers(0, len(KINDS) - 1), min_size=1, max_size=3),
    collected=st.one_of(st.just([]), st.sets(st.tuples(st.integers(1, 3), st.sampled_from(sorted(TAKEN))))),
)
def test_a_game_of_a_batch_is_the_game_that_is_played_alone(
    streets,
    places,
    rules,
    conflicts,
    seeds,
    restart,
    early,
    order,
    motion,
    deeds,
    called,
    asked,
    radio,
    shared,
    kinds,
    collected,
):
    channels = None if radio is None else {"radio": radio}
    called = [one for one in called if one[0] != "recruit" or asked in ("", "a")]  # teams that are asked get no others
    agents = {f"{'abc'[i % 3]}{i}": place for i, place in enumerate(places)}
    if motion is not None and motion.get("decide") == "arrival":
        conflicts = conflicts if isinstance(conflicts, Conflicts) and conflicts.allow_swaps else None
        motion = motion | {"strategies": [one for one in motion["strategies"] if one != "assign"]}  # which gives paths
    with (
        open_game(
            streets,
            agents,
            rules,
            conflicts,
            early,
            order,
            motion,
            deeds,
            called,
            asked,
            channels,
            shared,
            kinds,
            sorted(collected),
        ) as ctx,
        ctx.game.batch(seeds=seeds, most_agents={agents[min(agents)][0]: ["b9", "y9", "z9"]}) as games,
    ):
        assert games.slow is None or "game by game" in games.slow or "agent by agent" in games.slow, games.slow
        for _ in range(restart[0]):
            games.step()
        games.reset([restart[1] % len(seeds)])
        games.run()
        gives_nodes = "gives the nodes" if motion is not None and motion.get("decide") == "arrival" else "no reason"
        assert all(LEAVE.search(why) or gives_nodes in why for why in games.detached.values()), games.detached
        with ctx.game.fork(0).ctx as alone:
            for number, seed in enumerate(seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


def test_agents_that_are_put_back_while_on_an_edge_stay_there():
    agents, motion = {"a0": ("red", 2), "b1": ("blue", 11)}, {"speed_unit": "metres", "speeds": [0.3]}
    with (
        open_game([(1.1, False)] * 33, agents, [], None, motion=motion, deeds=["deeds"]) as ctx,
        ctx.game.batch(8) as games,
        ctx.game.fork(0).ctx as alone,
    ):
        assert games.slow is None
        games.run()
        assert any(event["kind"] == "respawned" for event in games.result(0).events)
        for number, seed in enumerate(games.seeds):
            alone.game.reset(seed=seed)
            assert plain(games.result(number)) == plain(alone.game.run())
