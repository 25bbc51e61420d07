"""Rules of scenarios in which agents are born, die, and find roads closed, others in games of other seeds."""

from contextlib import suppress

import gamms
from gamms.errors import GammsError
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


def evade(state):
    """Go to the last legal node, unless something was in the way; remember nothing."""
    state["action"] = state["legal"][-1 - len(state["blocked"] or "") % len(state["legal"])]


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


def change(ctx, share, every):
    """Change rules, strategies, sensors, collectors or settings, or change them back, by the seed modulo `every`."""
    draw = ctx.stream("changes", ctx.game.turn, ctx.seed % every)
    for act in CHANGES:
        if draw.random() < share:
            act(ctx, int(draw.integers(1000)))


def count_living(ctx):
    """Count the living agents; a rule and a collector."""
    living = sum(agent.alive for agent in ctx.agent.create_iter())
    ctx.game.scores["living"] += living
    return living


def _change_rules(ctx, lot):
    known = {rule.name for rule in ctx.game.rules}
    if "living" in known:
        ctx.game.remove("living")
    elif lot % 2:
        ctx.game.add(count_living, name="living", phase=("before", "deeds", "after")[lot % 3])
    if "late tag" in known and lot % 3:
        ctx.game.remove("late tag")
    elif "late tag" not in known and lot % 3 == 0:
        ctx.game.add(gamms.rules.tag("red", "blue", then="respawn"), name="late tag")
    spare = [rule for rule in ctx.game.rules if rule.spec.core_form is not None and rule.name != "late tag"]
    if spare and lot % 5 == 0:
        ctx.game.remove(spare[0].name)


def _change_strategies(ctx, lot):
    agents = sorted(ctx.agent.agents)
    agent = ctx.agent.agents[agents[lot % len(agents)]]
    agent.strategy = (random_walk, stay, evade, goto(ctx, 0))[lot % 4]


def _change_sensors(ctx, lot):
    agents = sorted(ctx.agent.agents)
    agent = ctx.agent.agents[agents[lot % len(agents)]]
    name = f"late_{agent.name}"
    if name in agent.sensors:
        agent.deregister_sensor(name)
    elif name not in ctx.sensor.sensors:
        sensor = ctx.sensor.create_sensor(name, sensor_type="AGENT_RANGE", sensor_range=15.0)
        agent.register_sensor(name, sensor)
    elif lot % 2:
        ctx.sensor.get_sensor(name).range = 5.0 + lot % 20


def _change_conflicts(ctx, lot):
    ctx.game.conflicts = (None, gamms.rules.Conflicts(capacity=1), FIRST)[lot % 3]


class FirstByName:
    """A conflict resolver: of those that come to the same node, only the one that is first by name may move there."""

    def resolve(self, moves, ctx):
        """Return who may not move."""
        first = {}
        for move in sorted(moves.values(), key=lambda one: one.agent):
            first.setdefault(move.end, move.agent)
        return [name for name, move in moves.items() if first[move.end] != name]


FIRST = FirstByName()


def _change_collectors(ctx, lot):
    if lot % 5 == 0:
        with suppress(GammsError):  # it collects already
            ctx.game.collect("late", count_living, every=1 + lot % 3)


def _change_values(ctx, lot):
    data = sorted(key for key in ctx.game.data if isinstance(key, str))
    if lot % 7 == 0 and data:
        del ctx.game.data[data[lot % len(data)]]
    if lot % 7 == 1:
        ctx.game.scores["odd"] = lot % 2 == 0
    if lot % 7 == 2:
        ctx.reseed(lot)
    if lot % 7 == 3:
        ctx.game.publish(flags={"lost": lot})
    if lot % 7 == 4:
        ctx.game.events.clear()


def _change_columns(ctx, lot):
    """Change what the columns of all games do not hold: speeds, teams, settings, and the map besides its roads."""
    agents = sorted(ctx.agent.agents)
    agent = ctx.agent.agents[agents[lot % len(agents)]]
    if lot % 5 == 0 and agent.speed is not None:
        agent.speed = 1.0 + lot % 3 if ctx.game.speed_unit == "edges" else 7.0 + lot % 9
    if lot % 5 == 1 and ctx.game.order is None:  # else it may be another while agents move, which is refused
        agent.team = ("red", "blue")[lot % 2]
    if lot % 5 == 2:
        ctx.game.on_illegal = ("stay", "raise")[lot % 2]
    edges = [*ctx.graph.graph.get_edges()]
    if lot % 5 == 3 and edges:
        ctx.graph.graph.remove_edge(edges[lot % len(edges)])


CHANGES = (
    *(_change_rules, _change_strategies, _change_sensors, _change_conflicts, _change_collectors, _change_values),
    _change_columns,
)
