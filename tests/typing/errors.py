"""A wrong keyword, key or name is an error at its line."""

import gamms
from gamms.sensor import SensorType

ctx = gamms.create_context(seed=1)
ctx.sensor.create_sensor("a", SensorType.RANGE, range=5.0)  # type: ignore[call-overload]
ctx.sensor.create_sensor("b", SensorType.RANGE, sensor_range="far")  # type: ignore[call-overload]
ctx.sensor.create_sensor("c", SensorType.RANGE, sensor_range=5.0)
ctx.sensor.create_sensor("d", SensorType.RANGE).observer_height  # type: ignore[attr-defined]
ctx.sensor.create_sensor("e", SensorType.OCCLUDED_MAP).observer_height
ctx.agent.create_agent("f", start_node=0)  # type: ignore[call-overload]
ctx.agent.create_agent("g", start_node_id="0")  # type: ignore[call-overload]
ctx.agent.create_agent("h", start_node_id=0, sensors=5)  # type: ignore[call-overload]
ctx.agent.create_agent("i", type=gamms.agent.AgentType.AERIAL, start_node_id=0, position=5)  # type: ignore[call-overload]
ctx.agent.create_agent("j", start_node_id=0, home=0, energy=7)


def strategy(state: gamms.typing.State) -> None:
    state["action"] = "north"  # type: ignore[call-overload]
    state["acton"] = 3  # type: ignore[call-overload]
    state["legal"].append(3)  # type: ignore[attr-defined]
    state["action"] = state["current_node"]  # type: ignore[call-overload]
    state["action"] = state["curr_pos"] + state["turn"]
    state["outbox"].append({"channel": "radio", "to": "red", "text": "hello"})  # type: ignore[typeddict-item,typeddict-unknown-key]
    state["outbox"].append({"channel": "radio", "to": "red", "body": [message["turn"] for message in state["inbox"]]})


def misnamed(state: gamms.typing.Stat) -> None:  # type: ignore[name-defined]
    pass


def rule(ctx: gamms.Context) -> None:
    ctx.gme.end("over")  # type: ignore[attr-defined]
    ctx.agent.create_itr()  # type: ignore[attr-defined]
    ctx.game.end("over")
    ctx.game.eliminate(5)  # type: ignore[arg-type]
    ctx.game.agents[0].name.real  # type: ignore[attr-defined]
    ctx.game.agents["red_0"]  # type: ignore[call-overload]
    ctx.game.eliminate(ctx.game.agents[0])


def flying(state: gamms.typing.AerialState) -> None:
    state["action"] = 3  # type: ignore[call-overload]


ctx.agent.create_agent("k", start_node_id=0, strategy=flying)  # type: ignore[arg-type]
ctx.agent.create_agent("l", start_node_id=0, strategy=rule)  # type: ignore[arg-type]
ctx.game.add(rule)
ctx.game.add(5)  # type: ignore[call-overload]
ctx.game.add_channel("radio", range=50)  # type: ignore[call-arg]
ctx.game.add_channel("radio", range_m=50, loss=[(0, 0.1), (50, 0.5)], jammers=[{"agent": "g", "radius_m": 5}])
gamms.strategies.chase(ctx, otherwse=None)  # type: ignore[call-arg]
ctx.visual.set_graph_visual(node_size=2, edge_color="red", draw_id=True).set_layer(3)
ctx.visual.set_graph_visual(node_sise=2.0)  # type: ignore[call-arg]
ctx.visual.set_graph_visual(edge_color=5)  # type: ignore[arg-type]
ctx.visual.set_agent_visual("f", colour="red")  # type: ignore[call-arg]
ctx.visual.set_agent_visual("f", color=(1, 2, 3), size=3.0, image_path=None)
ctx.visual.set_agent_visual("f", size="large")  # type: ignore[arg-type]
ctx.visual.set_sensor_visual("a", node_color="red", layer=30)
ctx.visual.set_sensor_visual("a", layers=30)  # type: ignore[call-arg]
ctx.visual.set_obstacle_visual(color_map={1: "red"}, fill=True)
ctx.visual.set_obstacle_visual(color_map="red")  # type: ignore[arg-type]
ctx.visual.set_values(nodes={0: 1.0}, cmap="magma")
ctx.visual.set_values(node={0: 1.0})  # type: ignore[call-arg]
ctx.visual.save("a.png", widht=100)  # type: ignore[call-arg]
gamms.rules.tag("red", "blue", meters=5)  # type: ignore[call-arg]
gamms.rules.tag("red", "blue", metres="near")  # type: ignore[arg-type]
gamms.rules.reach("red", [0], winner="blue").add  # type: ignore[attr-defined]
