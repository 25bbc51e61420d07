"""A networkx graph, agents that are deleted and created again, and everything one can read from them."""

import networkx as nx
from shapely.geometry import LineString

import gamms

G = nx.DiGraph()
for i, (x, y) in enumerate([(0, 0), (10, 0), (10, 10), (0, 10), (5, 20)]):
    G.add_node(i, x=float(x), y=float(y))
for count, (a, b) in enumerate([(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 2), (0, 2)]):
    line = LineString([(G.nodes[a]["x"], G.nodes[a]["y"]), (G.nodes[b]["x"], G.nodes[b]["y"])])
    G.add_edge(a, b, id=count, length=line.length, linestring=line)

ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
ctx.graph.attach_networkx_graph(G)
graph = ctx.graph.graph
log = [
    [node, [graph.get_node(node).x, graph.get_node(node).y], sorted(graph.get_neighbors(node))]
    for node in sorted(graph.get_nodes())
]
for id in sorted(graph.get_edges()):
    edge = graph.get_edge(id)
    log.append([edge.id, edge.source, edge.target, round(edge.length, 9), list(edge.linestring.coords)])

for i in range(6):
    ctx.agent.create_agent(f"agent_{i}", start_node_id=i % 5, meta={"team": i % 2}, size=i)
for agent in list(ctx.agent.create_iter()):
    log.append([agent.name, agent.type.name, agent.current_node_id, agent.prev_node_id, agent.meta, agent.size])
    if agent.meta["team"]:
        ctx.agent.delete_agent(agent.name)
ctx.agent.delete_agent("agent_7")
agents = ctx.agent.create_iter()
ctx.agent.create_agent("agent_1", start_node_id=3)
for _ in range(2):
    for agent in agents:
        state = agent.get_state()
        state["action"] = min(graph.get_neighbors(state["curr_pos"]))
        agent.set_state()
        log.append([agent.name, agent.current_node_id, agent.prev_node_id, [round(a, 9) for a in agent.orientation]])
        log.append(sorted(agent.state))


def refused(call, *args, **kwargs):
    try:
        call(*args, **kwargs)
    except KNOWN as error:
        return next(kind.__name__ for kind in type(error).__mro__ if kind in KNOWN)
    return None


KNOWN = (KeyError, ValueError, TypeError, AttributeError, NotImplementedError)


def act(action):
    agent = ctx.agent.get_agent("agent_0")
    agent.get_state()["action"] = action
    agent.set_state()


errors = {
    "duplicate agent": refused(ctx.agent.create_agent, "agent_0", start_node_id=0),
    "no start": refused(ctx.agent.create_agent, "new"),
    "unknown agent": refused(ctx.agent.get_agent, "nobody"),
    "unknown sensor": refused(ctx.sensor.get_sensor, "nothing"),
    "unknown type": refused(ctx.sensor.create_sensor, "s", "NEAR"),
    "custom type": refused(ctx.sensor.create_sensor, "s", gamms.sensor.SensorType.CUSTOM),
    "unknown node": refused(act, 99),
    "text": refused(act, "north"),
    "a dict without a node": refused(act, {}),
    "a bad orientation": refused(act, {"node_id": 0, "orientation": (1.0,)}),
    "no strategy": refused(ctx.agent.get_agent("agent_0").step),
    "read-only": refused(ctx.agent.create_agent, "new2", start_node_id=0, state={}),
    "unknown graph engine": refused(gamms.create_context, graph_engine="ram", logger_config={"level": "CRITICAL"}),
    "unknown visual engine": refused(gamms.create_context, vis_engine="window", logger_config={"level": "CRITICAL"}),
    "none of these": refused(act, 0),
}
ctx.terminate()
ctx.terminate()
outcome = {"log": log, "errors": errors, "after": [ctx.is_terminated(), ctx.agent.get_agent("agent_0").name]}
