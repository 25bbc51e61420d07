"""Rules of scenarios in which agents are born, die, and find roads closed, others in games of other seeds."""

import gamms
from gamms.rules import contacts
from gamms.strategies import chase, goto, random_walk, stay


def greedy(state):
    """Go to the legal node that the agent has chosen least often, unless something was in its way."""
    chosen = state["memory"].setdefault("chosen", {})
    node = min(state["legal"], key=lambda one: (chosen.get(one, 0), one))
    chosen[node] = chosen.get(node, 0) + 1
    if state["blocked"]:
        chosen[node] += len(state["blocked"]) % 3
    state["action"] = node


def make_strategy(ctx, kind):
    """Return a strategy, which may be another function in each call."""
    if kind == "goto":
        return goto(ctx, 0)
    if kind == "chase":
        return chase(ctx)
    return {"walk": random_walk, "stay": stay, "greedy": greedy}[kind]


def born(ctx, names, every, kinds, teams, speed, alike):
    """Create agents: who, when and where depends on the seed, modulo `alike`."""
    turn = ctx.game.turn
    seed = ctx.seed % alike
    draw = ctx.stream("births", turn)
    if (turn + seed) % every or len(ctx.agent.agents) > 9:
        return
    name = f"{names[(turn + seed) % len(names)]}_{turn if seed % 2 else seed}"
    if name in ctx.agent.agents:
        return
    nodes = [*ctx.graph.graph.get_nodes()]
    kind = kinds[int(draw.integers(len(kinds)))]
    given = {"sensors": {"all": gamms.sensor.agent()}} if kind == "chase" else {}
    if speed is not None and ord(name[0]) % 2:  # agents of one name have one speed and team in all games
        given["speed"] = speed
    node = nodes[int(draw.integers(len(nodes)))]
    team = teams[len(name) % len(teams)]
    ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=make_strategy(ctx, kind), **given)
    ctx.game.emit("born", agent=name, node=node)


def die(ctx, share, delete):
    """Let agents die, leave for good or come back, by the seed."""
    draw = ctx.stream("deaths", ctx.game.turn)
    for agent in [*ctx.agent.create_iter()]:
        lot = draw.random()
        if lot < share * delete and len(ctx.agent.agents) > 1:
            ctx.agent.delete_agent(agent.name)
        elif lot < share and agent.alive:
            ctx.game.eliminate(agent)
        elif lot < 1.5 * share:
            ctx.game.respawn(agent)


def replace(ctx, share, back):
    """Delete agents, and create others under their names at once, where they were or at node 0, by the seed."""
    draw = ctx.stream("replace", ctx.game.turn)
    for agent in [*ctx.agent.create_iter()]:
        if draw.random() < share:
            given = {} if agent.speed is None else {"speed": agent.speed}
            node = 0 if draw.random() < back else agent.current_node_id
            strategy = agent.strategy
            ctx.agent.delete_agent(agent.name)
            ctx.agent.create_agent(agent.name, start_node_id=node, team=agent.team, strategy=strategy, **given)


def dig(ctx):
    """Close and open roads by the seed."""
    draw = ctx.stream("dig", ctx.game.turn)
    edges = [*ctx.graph.graph.get_edges()]
    if edges and draw.random() < 0.7:
        ctx.graph.close_roads([edges[int(draw.integers(len(edges)))]])
    if draw.random() < 0.5:
        ctx.graph.open_roads([one for one in ctx.graph.closed_roads if draw.random() < 0.5])


def tell(ctx, **near):
    """Record all that a rule sees of agents, of their moves and of who meets whom."""
    game = ctx.game
    agents = sorted(game.agents, key=lambda one: one.name)
    seen = []
    for one, track in zip(agents, game.tracks(agents), strict=True):
        place = [one.current_node_id, one.prev_node_id, one.edge, one.offset_m, game.start_node(one)]
        seen.append([one.name, place, list(track.path), list(track.times), [list(leg) for leg in track.legs]])
    met = [[one.a, one.b, one.time] for one in contacts(ctx, "red", "blue", **near)]
    moves = [[name, move.start, move.end] for name, move in game.moves.items()]
    game.emit("told", seen=seen, met=met, moves=moves)
