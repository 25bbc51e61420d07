"""Signs of rules keep their size in a window, however near a person looks."""

import numpy as np
import pytest

from gamms.rules import capture_flag, tag

RULES = {
    "out": lambda: tag("blue", "red", then="eliminate"),
    "flag": lambda: capture_flag({"red": 1, "blue": 2}),
}


def staying(state):
    state["action"] = state["curr_pos"]


def extent(pixels, color, x, y):
    """How wide and how high it is what has a color around a point of the window, in pixels."""
    rows, columns = np.nonzero((np.abs(pixels.astype(int) - color) < 12).all(axis=2))
    near = (np.abs(rows - y) < 60) & (np.abs(columns - x) < 60)
    return [np.ptp(columns[near]), np.ptp(rows[near])]


@pytest.mark.parametrize("name", RULES)
def test_the_wheel_leaves_signs_as_large_as_they_are(ctx, person, seen, name):
    for agent in ctx.agent.agents.values():
        agent.register_strategy(staying)
    for agent in ("red_0", "blue_0"):  # together, or clear of the home of the flag
        ctx.agent.get_agent(agent).current_node_id = 1 if name == "out" else 0
    ctx.game.add(RULES[name]())
    ctx.game.step()
    view, color = ctx.visual._render_manager, ctx.visual.drawing.group_colors()["red"]
    place, found, scales = view.world_to_screen(10.0, 0.0), [], []
    for notches in (0, 3, 6):
        person.point(*place)
        person.turn_wheel(notches)
        while not found or view.scale == scales[-1] or not ctx.visual._scene.is_sharp(view.camera()):
            ctx.visual.update()
            if not scales:
                break
        person.point(1, 1)  # because the panel of an agent would cover the sign
        ctx.visual.update()
        found.append(extent(seen(ctx), color, *view.world_to_screen(10.0, 0.0)))
        scales.append(view.scale)
    assert scales[2] > 2 * scales[0]
    assert np.ptp(found, axis=0).max() <= 1
    assert np.min(found) > 10
