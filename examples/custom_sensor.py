"""Bring information from outside the graph into the state: a radio on which a dispatcher announces a place."""

import gamms
from gamms.sensor import SensorType

SIZE = 8
CALLS = {1: 60, 12: 7, 25: 56}  # turn -> the node that is announced

ctx = gamms.create_context(seed=3)


@ctx.sensor.custom(name="RADIO")
class Radio(gamms.typing.ISensor):
    """`data`: what was announced last, and how far the listener is from it; None before the first call."""

    def __init__(self, ctx, sensor_id):
        self.ctx, self._id = ctx, sensor_id
        self._place, self._data = None, None

    @property
    def sensor_id(self):
        """The sensor's name."""
        return self._id

    @property
    def type(self):
        """The decorator replaces this by SensorType.RADIO."""
        return SensorType.CUSTOM

    @property
    def data(self):
        """What was sensed last."""
        return self._data

    def sense(self, node_id):
        """Listen at a node."""
        if self._place is not None:
            here, there = (self.ctx.graph.get_node(id) for id in (node_id, self._place))
            self._data = {"place": there, "distance": abs(there.x - here.x) + abs(there.y - here.y)}

    def update(self, data):
        """Take in an announcement; the world outside calls this."""
        self._place = data["place"]

    def set_owner(self, owner):
        """Anybody may listen."""


def respond(state):
    """A strategy: walk towards the announced place."""
    _, options = state["sensor"]["near"]
    kind, call = state["sensor"]["radio"]
    assert kind is SensorType.RADIO
    if call is None:
        state["action"] = state["curr_pos"]
        return
    nodes = [ctx.graph.get_node(node) for node in options]
    state["action"] = min(nodes, key=lambda node: abs(node.x - call["place"].x) + abs(node.y - call["place"].y)).id


with ctx:
    nodes = range(SIZE * SIZE)
    ctx.graph.add_nodes(nodes, [node % SIZE for node in nodes], [node // SIZE for node in nodes])
    ends = [(a, b) for a in nodes for b in (a + 1, a + SIZE) if b in nodes and not (b == a + 1 and b % SIZE == 0)]
    ends += [(b, a) for a, b in ends]
    ctx.graph.add_edges(range(len(ends)), [a for a, _ in ends], [b for _, b in ends])

    radio = Radio(ctx, "radio")
    ctx.sensor.add_sensor(radio)
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    medic = ctx.agent.create_agent("medic", start_node_id=0, sensors=["near", "radio"], strategy=respond)

    for turn in range(1, 41):
        if turn in CALLS:
            radio.update({"place": CALLS[turn]})
            print(f"turn {turn:2d}: the radio announces node {CALLS[turn]}")
        before = medic.current_node_id
        medic.step()
        if medic.current_node_id == radio.data["place"].id != before:
            print(f"turn {turn:2d}: the medic is there")
