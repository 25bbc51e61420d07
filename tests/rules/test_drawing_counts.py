"""What rules count is drawn, in a game and in its replay: places, what agents have left, deeds that cool down."""

import numpy as np
import pytest

import gamms
from gamms.ir.draw import DrawKind
from gamms.rules import cooldown, discover, hold, resource
from gamms.visual.legend import list_blocks

RULES = {
    "held": lambda: hold([4, 5], 4),
    "discovered": lambda: discover([2, 7]),
    "resources": lambda: resource("fuel", 40, per_turn=10),
    "cooldowns": lambda: cooldown("shout", 3),
}


@pytest.fixture
def hill():
    """Two agents on a road of ten nodes that stay where they are: ann on node 2, bob on node 4."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
        ctx.game.deeds = {"shout": None}
        for name, team, node in (("ann", "red", 2), ("bob", "blue", 4)):
            ctx.agent.create_agent(name, start_node_id=node, team=team)
        ctx.agent.get_agent("ann").register_strategy(shout_at_first)
        yield ctx


def shout_at_first(state):
    state["action"] = {"node_id": state["curr_pos"], "do": {"shout": None} if state["turn"] == 0 else {}}


def signs_on(ctx, layer):
    """The signs that are drawn on a layer: color, place, and corners in pixels right of it and below."""
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero((commands.layer == layer) & (commands.kind == DrawKind.POLYGON))
    return [
        (tuple(commands.color[row][:3].tolist()), place.tolist(), np.array(corners))
        for row in rows
        for place, *corners in [commands.points[commands.offsets[row] : commands.offsets[row + 1]]]
    ]


def share_of(arc):
    """Return which share of a circle an arc is, which goes clockwise from the top, and back."""
    right, down = arc[len(arc) // 2]
    return np.arctan2(right, -down) / (2 * np.pi) % 1.0 or 1.0


def signs(ctx):
    shown = ctx.visual.artists.list_shown()
    return {row.sign for block in list_blocks(ctx, shown) if hasattr(block, "rows") for row in block.rows}


def test_an_arc_around_an_agent_gets_shorter_until_it_can_do_the_deed_again(hill):
    hill.game.add(RULES["cooldowns"]())
    shares = []
    for _ in range(4):
        hill.game.step()
        shares += [share_of(arc) for *_, arc in signs_on(hill, 22)]
    assert shares == pytest.approx([1.0, 2 / 3, 1 / 3])
    assert "timer" in signs(hill)  # the legend stays the same when nothing cools down
