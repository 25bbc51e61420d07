"""Rules, strategies and maps of the golden games: what they do depends on the seed and the turn alone."""

import gamms
from gamms.rules import contacts
from gamms.strategies import random_walk


def explore(state):
    """Go to the legal node that the agent has chosen least often."""
    chosen = state["memory"].setdefault("chosen", {})
    node = min(state["legal"], key=lambda one: (chosen.get(one, 0), one))
    chosen[node] = chosen.get(node, 0) + (1 if state["blocked"] is None else 2)
    state["action"] = node


def watch(state):
    """Go by the number of agents in sight, and by a draw."""
    sights = [data for kind, data in state["sensor"].values() if isinstance(data, dict)]
    seen = sum(map(len, sights))
    state["action"] = state["legal"][(seen + state["draw"].below(3)) % len(state["legal"])]


def call(state):
    """Walk at random; send the own node by radio in each second turn, and the number of messages heard."""
    random_walk(state)
    if state["turn"] % 2 == 0:
        state["outbox"].append({"channel": "radio", "to": None, "body": [state["curr_pos"], len(state["inbox"])]})


def work(state):
    """Begin long deeds and short ones in turn; go on meanwhile."""
    random_walk(state)
    kinds = [{"defuse": state["curr_pos"]}, {"shout": None}, {"rest": None}, {}]
    chosen = kinds[(state["turn"] + len(state["name"])) % len(kinds)]
    state["action"] = {"node_id": state["action"], "do": chosen}


# -- agents that come and go --------------------------------------------------------------------------------------


def give_birth(ctx, every=3, speed=None, sensors=False):
    """Create an agent in each `every`-th turn: its name is used again after its death."""
    turn = ctx.game.turn
    name = f"{'amz'[(turn + ctx.seed) % 3]}{ctx.seed % 4}"
    if (turn + ctx.seed) % every or name in ctx.agent.agents:
        return
    given = {} if speed is None else {"speed": speed}
    if sensors:
        given["sensors"] = {"near": gamms.sensor.agent_range(range_m=25)}
    draw = ctx.stream("births", turn)
    team = ("red", "blue")[turn % 2]
    strategy = (random_walk, explore)[turn % 2]
    nodes = [*ctx.graph.graph.get_nodes()]
    node = nodes[int(draw.integers(len(nodes)))]
    ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=strategy, **given)
    ctx.game.emit("born", agent=name, node=node)


def bury(ctx, share=0.15):
    """Eliminate, delete and bring back agents by draws."""
    draw = ctx.stream("deaths", ctx.game.turn)
    for agent in [*ctx.agent.create_iter()]:
        lot = draw.random()
        if lot < share / 2 and len(ctx.agent.agents) > 2:
            ctx.agent.delete_agent(agent.name)
        elif lot < share and agent.alive:
            ctx.game.eliminate(agent)
        elif lot < 2 * share:
            ctx.game.respawn(agent)


def reinforce(ctx):
    """Create and delete the agent `red_9`, for which a row may be reserved."""
    turn = ctx.game.turn + ctx.seed % 3
    if turn % 5 == 2 and "red_9" not in ctx.agent.agents:
        first = ctx.agent.get_agent("red_0")
        ctx.agent.create_agent("red_9", start_node_id=ctx.seed % 25, team="red", strategy=first.strategy)
    elif turn % 5 == 0 and "red_9" in ctx.agent.agents:
        ctx.agent.delete_agent("red_9")


def delete_carrier(ctx):
    """Delete the agent that carries a flag, in the turn after it has taken it."""
    for flag in ctx.game.facts["flags"].values():
        if flag["carrier"] in ctx.agent.agents and ctx.seed % 2:
            ctx.agent.delete_agent(flag["carrier"])


def tell(ctx, **near):
    """Record what a rule sees of agents, of their moves and of who meets whom."""
    game = ctx.game
    agents = sorted(game.agents, key=lambda one: one.name)
    seen = []
    for one, track in zip(agents, game.tracks(agents), strict=True):
        place = [one.current_node_id, one.prev_node_id, one.edge, one.offset_m, game.start_node(one)]
        seen.append([one.name, place, list(track.path), list(track.times)])
    met = [[one.a, one.b, one.time] for one in contacts(ctx, "red", "blue", **near)]
    game.emit("told", seen=seen, met=met, moves=[[name, one.start, one.end] for name, one in game.moves.items()])


# -- changes of one game among many -------------------------------------------------------------------------------


def is_due(ctx):
    """Return whether a game changes now: one of four never does, and the others in different turns."""
    return ctx.seed % 4 > 0 and ctx.game.turn == 1 + ctx.seed % 3


def pay(ctx):
    """Score the nodes of agents."""
    ctx.game.scores["paid"] += sum(agent.current_node_id for agent in ctx.game.agents) % 7


def add_rule(ctx):
    """Add a rule."""
    if is_due(ctx):
        ctx.game.add(pay)


def close_road(ctx):
    """Close roads, and open them two turns later."""
    edges = [*ctx.graph.graph.get_edges()]
    if is_due(ctx):
        ctx.graph.close_roads([edges[(ctx.seed * 5) % len(edges)], edges[(ctx.seed * 7 + 1) % len(edges)]])
    elif ctx.game.turn == 3 + ctx.seed % 3:
        ctx.graph.open_roads([*ctx.graph.closed_roads])


def add_edge(ctx):
    """Connect two corners of a grid of 25 nodes."""
    if is_due(ctx):
        ctx.graph.graph.add_edge({"id": 900, "source": 0, "target": 24, "length": 5.0})
        ctx.graph.graph.add_edge({"id": 901, "source": 24, "target": 0, "length": 5.0})


def create_scout(ctx):
    """Create an agent that has a sensor, and decides by it."""
    if is_due(ctx):
        eyes = ctx.sensor.create_sensor("eyes of the scout", "agent_range", range_m=25.0)
        ctx.agent.create_agent("scout", start_node_id=ctx.seed % 25, team="blue", sensors=[eyes], strategy=watch)


def change_agents(ctx):
    """Change a strategy, a team, an attribute and the data of the game."""
    if is_due(ctx):
        ctx.agent.get_agent("red_0").strategy = explore
        ctx.agent.get_agent("red_1").team = "blue"
        ctx.agent.get_agent("blue_0").tired = ctx.seed
        ctx.game.data["changed"] = {"turn": ctx.game.turn}


# -- maps ---------------------------------------------------------------------------------------------------------


def make_town():
    """Return a grid of streets with footpaths, one-way streets for cars, speeds by mode, and forbidden turns."""
    town = gamms.graph.grid(5, 5, spacing=10.0)
    for number, (_, _, data) in enumerate(town.edges(data=True)):
        data["id"] = number
    ends = {data["id"]: (source, target) for source, target, data in town.edges(data=True)}
    leaving = {node: [edge for edge, (source, _) in ends.items() if source == node] for node in town.nodes}
    for _, target, data in town.edges(data=True):
        edge = data["id"]
        data["drive"] = edge % 6 != 5
        data["walk"] = float(1 + edge % 3)
        if edge % 4 == 1:
            data["forbidden_turns"] = {"drive": [[leaving[target][edge % len(leaving[target])]]]}
    return town
