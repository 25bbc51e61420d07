"""What agents do in random games, and the plain rules of these."""

import zlib
from itertools import accumulate

import numpy as np

import gamms
from gamms.rules import contacts
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
from gamms.typing.sensor_engine import SensorType

CHANNELS = ("radio", "mesh", "whisper")
NODES = [17, 5, 32, 20, 8, 35, 23, 100_007, 0, 2, 41, 11, 3, 29]  # ids that are no rows, in no order

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


def curious(state):
    """Do what follows from all that the agent sees, knows and remembers, and from why its last action was not done."""
    if state["draw"].below(12) == 0:
        state["memory"]["ahead"] = state["fork"](state["turn"]).game.turn
    attentive(state, state["blocked"])


def go_on(state):
    """Return the last legal node."""
    return state["legal"][-1]


def rash(state):
    """Do what follows from all that the agent sees, and raise an error sometimes."""
    attentive(state, "raises")


def attentive(state, *more):
    """Do what follows from all that the agent sees, knows and remembers."""
    legal, memory, shared = state["legal"], state["memory"], state.get("team_memory", {})
    sights = {name: (str(kind), [*data.items()]) for name, (kind, data) in state["sensor"].items() if kind in SHOWN}
    sights |= {name: (str(kind), data) for name, (kind, data) in state["sensor"].items() if kind not in SHOWN}
    places = [
        [getattr(seen, "xy", None) for seen in data.values()]
        for _, data in state["sensor"].values()
        if hasattr(data, "values")
    ]
    facts = {name: repr(value) for name, value in state["facts"].items() if name in ("land", "flags")}
    known = [
        sights,
        places,
        facts,
        [*memory.items()],
        sorted(shared.items(), key=str),
        state["name"],
        state["team"],
        state["turn"],
    ]
    known += [state.get(key) for key in ("inbox", "edge", "offset_m", "xy", "time")]
    lot = zlib.crc32(repr([*known, legal, state["curr_pos"], *more, state["draw"].below(3)]).encode())
    memory[state["turn"]] = lot % 97
    if lot % 3 == 0:
        shared[state["name"]] = shared.get(state["name"], 0) + 1
    state["action"] = legal[lot % len(legal)] if lot % 11 else lot % 50
    if "edge" in state and lot % 7 == 0:
        state["action"] = None
    elif lot % 13 < 4 and "strolls" in state["facts"]:
        state["action"] = stroll(state["curr_pos"], lot)
    if lot % 17 == 0 and more == ("raises",):
        raise ValueError("a lot")
    if lot % 5 == 0:
        messages = [
            {"channel": CHANNELS[lot % 2], "to": [None, "red", "a0"][lot % 3], "body": [lot % 9]}
            for _ in range(lot % 4)
        ]
        state.get("outbox", []).extend(messages)
    if "deeds" in state and lot % 2:
        do = {"scan": {"node": legal[-1]}, "rest": None} if lot % 4 == 1 else {"mark": {"size": lot % 5, "how": "far"}}
        state["action"] = {"node_id": state["action"], "do": do}


def drift(state):
    """Fly, turn, hover, do and send what follows from all that an agent that flies sees, knows and remembers."""
    memory, shared, draw = state["memory"], state.get("team_memory", {}), state["draw"]
    sights = {name: (str(kind), repr(data)) for name, (kind, data) in state["sensor"].items()}
    known = [sights, [*memory.items()], sorted(shared.items()), state["name"], state["team"], state["turn"]]
    known += [state["curr_pos"], state["quat"], state["legal"], state.get("inbox"), state["blocked"], draw.below(3)]
    lot = zlib.crc32(repr(known).encode())
    memory[state["turn"]] = lot % 97
    if lot % 3 == 0:
        shared[state["name"]] = shared.get(state["name"], 0) + 1
    way = (draw.random() - 0.5, draw.random() - 0.5, (lot % 5 - 2) / 4)
    wanted = [way, np.array(way), {"direction": way}, {"direction": way, "distance": lot % 4 / 8}, (0.0, 0.0, 0.0)]
    wanted += [{"direction": way, "quat": (lot % 3, 1.0, lot % 7, 0.5)}, {"quat": (1.0, 0.0, 0.0, lot % 5)}, "nowhere"]
    state["action"] = wanted[lot % 8]
    if "deeds" in state and lot % 2 and isinstance(state["action"], dict):
        do = {"rest": None} if lot % 4 == 1 else {"mark": {"size": lot % 5, "how": "far"}}
        state["action"] = state["action"] | {"do": do}
    if lot % 5 == 0:
        state.get("outbox", []).append({"channel": CHANNELS[lot % 2], "to": None, "body": [lot % 9]})


@gamms.array_strategy
def glide(view):
    """Fly towards the node that is seen first, or away from where the agent is."""
    seen, shape = view.seen_nodes(), (*view.node.shape, 3)
    ways = np.stack([view["xy"][..., 0], 3.0 - view["xy"][..., 1], 1.0 - view["z"]], axis=-1)
    at, viewers, nodes = (column[::-1] for column in (seen.at, seen.viewers, seen.nodes))
    x, y = (axis[nodes] for axis in view.streets.axes)
    ways[at, viewers, :2] = np.stack([x, y], axis=-1) - view["xy"][at, viewers]
    return np.where(view.draw.random()[..., None] < 0.7, ways, np.zeros(shape))


FLYING = {"walk": random_walk, "stay": stay, "drift": drift, "glide": glide, "none": None}


def stroll(node, lot):
    """Return a list of nodes, most of which follow each other, that may wait, turn back, or lead nowhere."""
    number, steps = NODES.index(node), [0, 1, -1, 6, -6, 7, -7, 1]
    numbers = accumulate([steps[lot // 8**i % 8] for i in range(lot % 5)], initial=number)
    return [NODES[number % 14] for number in numbers][lot % 2 :]


def agreed(states):
    """Let each agent of a team do what it would do by itself, but for the first."""
    for state in states.values():
        (drift if "quat" in state else attentive)(state)
    first = next(iter(states.values()))
    first["action"] = first["legal"][0] if first["legal"] else (0.0, 0.0, 0.0)


SHOWN = (SensorType.AGENT, SensorType.AGENT_RANGE)


def strike(ctx):
    """Let agents that are marked go back, or out if they are marked much; end the game if several rest."""
    for deed in ctx.game.performed("mark"):
        ctx.game.emit("marked", agent=deed.agent, at=deed.at)
        if "whom" in deed.values:
            (ctx.game.eliminate if deed.values["size"] > 0.7 else ctx.game.respawn)(deed.values["whom"])
    if ctx.game.turn == 4 and len(ctx.game.performed("rest")) > 2:
        ctx.game.end("rest")


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
            [getattr(agent, one, None) for one in ("position", "prev_position", "quat")],
        ]
        seen.append([agent.name, place, list(track.path), list(track.times), [list(leg) for leg in track.legs]])
    moves = [[name, move.start, move.end, list(move.path)] for name, move in game.moves.items()]
    done = [[deed.agent, deed.kind, deed.at, dict(deed.values)] for deed in game.performed()]
    game.emit("seen", agents=seen, moves=moves, deeds=done)


def recall(ctx):
    """Note what agents have sensed when they decided last, and what their sensors have shown."""
    for agent in ctx.agent.create_iter():
        state = agent.state
        shown = {key: str(state[key]) for key in ("turn", "curr_pos", "sensor", "legal") if key in state}
        ctx.game.emit("recalled", by=agent.name, state=shown, data=[str(one.data) for one in agent.sensors.values()])


def push(ctx):
    """Put agents elsewhere, out of the game, or back where they are, by lots."""
    draw = ctx.stream("push", ctx.game.turn)
    for agent in ctx.game.agents:
        lot = draw.random()
        if lot < 0.04:
            ctx.game.eliminate(agent)
        elif lot < 0.2:
            ctx.game.respawn(agent)
        elif hasattr(agent, "position") and lot < 0.4:
            agent.position = (*agent.position[:2], lot)
            agent.quat = (1.0, lot, 0.0, 0.0)
        elif lot < 0.3:
            agent.current_node_id = NODES[int(draw.integers(14))] if lot < 0.25 else agent.current_node_id


def recruit(ctx):
    """Let agents come, others in games of other seeds, and move those that have come."""
    named, turn = "bzy"[ctx.seed % 2 :], ctx.game.turn
    for name in named:
        if f"{name}9" not in ctx.agent.agents and (turn + ord(name)) % 4 == ctx.seed % 3:
            like = ctx.agent.get_agent(min(ctx.agent.agents))
            last = [one for one in ctx.agent.create_iter() if one.team == like.team and one.name[1:] != "9"][-1]
            given = {"team": like.team, "strategy": last.strategy, "speed": like.speed, "sensors": dict(last.sensors)}
            given |= {"start_node_id": NODES[(turn + ctx.seed) % 14], "rank": turn}
            given = {key: value for key, value in given.items() if value is not None}
            ctx.agent.create_agent(f"{name}9", **given)
            break
    ctx.game.scores["ranks"] = sum(getattr(agent, "rank", 0) for agent in ctx.game.agents)


def desert(ctx):
    """Let agents leave for good, others in games of other seeds, but not the last one."""
    draw, known = ctx.stream("desert", ctx.game.turn), sorted(ctx.agent.agents)
    if draw.random() < 0.3 and len(known) > 1:
        ctx.agent.delete_agent(known[int(draw.integers(len(known)))])


def refuse(ctx):
    """Refuse moves and deeds by lots."""
    draw = ctx.stream("refuse", ctx.game.turn)
    for name in ctx.game.moves:
        lot = draw.random()
        if lot < 0.2:
            ctx.game.refuse(name, "a lot", None if lot < 0.1 or not ctx.game.deeds else "scan")
    if draw.random() < 0.1:
        ctx.game.max_turns = 9


def refuses(_):
    """Do nothing but what the check does."""


refuses.check = refuse


def dig(ctx):
    """Close roads at random, others in each game, and open or remove some."""
    draw, graph = ctx.stream("dig", ctx.game.turn), ctx.graph
    lot = draw.random()
    if lot < 0.5 and (edges := [*graph.graph.get_edges()]):
        graph.close_roads([edges[int(draw.integers(len(edges)))] for _ in range(1 + int(3 * draw.random()))])
    elif lot < 0.7:
        graph.open_roads([edge for edge in graph.closed_roads if draw.random() < 0.6][::-1])
    elif lot > 0.97 and (edges := [*graph.graph.get_edges()]):
        graph.graph.remove_edge(edges[int(draw.integers(len(edges)))])
    ctx.game.scores["open"] = len(list(graph.graph.get_edges())) if lot < 0.8 else 0


def alter(ctx):
    """Do what games of a batch cannot share: change a setting, or look for agents whose sensors may err."""
    draw = ctx.stream("alter", ctx.game.turn)
    lot = draw.random()
    living = [agent for agent in ctx.game.agents if lot < 0.2]
    if lot < 0.1:
        ctx.game.max_turns += lot < 0.05
    elif living:
        state = ctx.game.observation(living[int(draw.integers(len(living)))])
        ctx.game.emit("observed", by=state["name"], seen=len(str(state["sensor"])))


def purge(ctx):
    """Let a team lose all its agents."""
    if ctx.game.turn == 1:
        for agent in ctx.game.agents:
            if agent.team == "red":
                ctx.game.eliminate(agent)


def meet(ctx):
    """Put agents elsewhere that others meet, and count it in an attribute; note distances, and end the game."""
    game = ctx.game
    for contact in contacts(ctx, "red", "blue"):
        one = ctx.agent.get_agent(contact.a)
        one.met = getattr(one, "met", 0) + 1
        game.emit("met", agent=one.name, times=one.met, at=contact.a_node)
        if one.met % 2 and hasattr(ctx.agent.get_agent(contact.b), "current_node_id"):
            ctx.agent.get_agent(contact.b).current_node_id = game.start_node(contact.b)
    near = sum(ctx.graph.distance(one.current_node_id, 20) < 3 for one in game.agents)
    game.emit("near", number=near, turn_before=game.last_turn, errors=len(game.errors), is_over=game.is_over)
    if near > 4:
        game.end("near", winner=max(sorted(map(str, game.scores)), default=None))


def collect_toll(ctx):
    """Have teams pay at some nodes, remember how often, and draw from the stream of the game."""
    paid = ctx.game.data.setdefault("toll", {})
    ctx.game.scores["luck"] += int(ctx.rng.integers(9))
    for agent in ctx.game.agents:
        if agent.current_node_id % 3 == 0:
            paid[agent.name] = paid.get(agent.name, 0) + 1
            ctx.game.emit("toll", agent=agent.name, times=paid[agent.name])


class FirstOnly:
    """A conflict resolver: of those that come to the same node, only the one that is last by name may move there."""

    def resolve(self, moves, ctx):
        last = {move.end: name for name, move in moves.items()}
        ctx.game.scores["contests"] += 1
        for agent in ctx.game.agents[:: 2 + ctx.seed % 3]:
            agent.contests = getattr(agent, "contests", 0) + 1
        return {name for name, move in moves.items() if last[move.end] != name} if ctx.game.turn % 3 else set()


TAKEN = {
    "game": lambda ctx: [ctx.game.turn, dict(ctx.game.scores), len(ctx.game.events), ctx.game.over is None],
    "agent": lambda agent: [agent.current_node_id, agent.prev_node_id, agent.edge, agent.offset_m, agent.alive],
}
CALLED = {
    "alter": alter,
    "desert": desert,
    "dig": dig,
    "look": look,
    "meet": meet,
    "push": push,
    "recall": recall,
    "recruit": recruit,
    "refuses": refuses,
    "purge": purge,
    "toll": collect_toll,
}


def caller(ctx):
    """Make a strategy that walks at random, tells where it is, and goes by what it hears."""
    names = sorted(name for name, channel in ctx.game.channels.items() if channel.teams is None)

    @gamms.array_strategy
    def call(view):
        actions = view.draw.below(view.counts)
        for name in names:
            heard, count = view.heard(name), np.zeros(view.node.shape, np.int64)
            bodies = [body if isinstance(body, int) else len(body) for body in heard.bodies]
            np.add.at(count, (heard.at, heard.hearers), np.array(bodies, np.int64) + heard.turns)
            view.send(name, (view.turn[:, None] + actions) % 2 == 0, view["curr_pos"])
            view.send(name, view.turn[:, None] % 4 == actions, 7, to="a0")  # which a0 cannot send
            actions = (actions + count) % view.counts
        return actions

    return call(ctx)


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
    "search": follow_belief,
    "exit": lambda ctx: safest_exit(ctx, [8, 35]),
    "unblock": lambda ctx: unblock(chase(ctx), after=1),
    "skip": lambda ctx: first(chase(ctx, None), unblock(flee(ctx, None), after=1)),
    "mix": lambda ctx: mix(0.5, random_walk, first(chase(ctx, None), follow_path(ctx, [8, 35], repeat=True))),
}
