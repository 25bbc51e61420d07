"""Beliefs are drawn as values of nodes, in pictures, and from recordings as they were."""

import numpy as np

import gamms
from gamms import belief
from gamms.visual.constants import Layer
from gamms.visual.legend import ColorScale, LegendRows


def watched(make_ctx, add, **options):
    ctx = make_ctx(8)

    def watch(state):
        belief.observe(ctx, state)
        state["action"] = state["curr_pos"]

    add(ctx, "spy", 0, "red", sight=10.0, strategy=watch)
    add(ctx, "prey", 1, "blue", strategy=lambda state: state.update(action=min(7, state["curr_pos"] + 1)))
    ctx.visual.add_artist("belief", belief.artist("spy", "prey", **options))
    return ctx


def drawn(ctx):
    """The places of what the artist draws, and their colours."""
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero(commands.layer == Layer.VALUES)
    return {tuple(commands.points[commands.offsets[row]].tolist()): tuple(commands.color[row]) for row in rows}


def test_probable_nodes_are_drawn_in_the_colours_of_a_bar(make_ctx, add):
    ctx = watched(make_ctx, add)
    ctx.game.run(6)  # seen on node 1 in turn 0, not in sight from then on
    shown, chances = drawn(ctx), belief.belief_of(ctx, "spy").probability("prey")
    least = 0.01 * max(chances.values())
    assert {x for x, _ in shown} == {10.0 * node for node, chance in chances.items() if chance >= least}
    assert len(set(shown.values())) > 1
    artist = ctx.visual.artists.declared["belief"]
    assert isinstance(artist.data["legend"](ctx), ColorScale)
    ctx.game.eliminate("prey")
    assert drawn(ctx) == {}


def test_nodes_that_can_be_reached_are_drawn_in_one_colour(make_ctx, add):
    ctx = watched(make_ctx, add, can_be=True)
    ctx.game.run(3)
    shown = drawn(ctx)
    assert {x for x, _ in shown} == {10.0 * node for node in belief.belief_of(ctx, "spy").reachable("prey")}
    assert len(set(shown.values())) == 1
    assert isinstance(ctx.visual.artists.declared["belief"].data["legend"](ctx), LegendRows)
    ctx.game.eliminate("prey")
    assert drawn(ctx) == {}


def test_a_recording_shows_the_drawings(make_ctx, add, tmp_path):
    ctx = watched(make_ctx, add)
    ctx.record.start(tmp_path / "g.ggr")
    ctx.game.run(4)
    expected = drawn(ctx)
    ctx.record.stop()
    with gamms.create_context() as shown:
        for _ in shown.record.replay(tmp_path / "g.ggr"):
            pass
        assert drawn(shown) == expected
