"""One context plays in one thread at a time: other threads hear that it is too early to change anything."""

from threading import Event, Thread

import pytest

import gamms
from gamms.errors import BadValue

CHANGES = {
    "step": lambda ctx: ctx.game.step(),
    "run": lambda ctx: ctx.game.run(1),
    "reset": lambda ctx: ctx.game.reset(),
    "a node": lambda ctx: ctx.graph.graph.add_node({"id": 99, "x": 0.0, "y": 0.0}),
    "an edge": lambda ctx: ctx.graph.graph.remove_edge(0),
    "an agent": lambda ctx: ctx.agent.create_agent("new", start_node_id=0),
    "an attribute": lambda ctx: setattr(ctx.agent.get_agent("a"), "fuel", 3),
    "a setting": lambda ctx: setattr(ctx.game, "max_turns", 3),
}


@pytest.mark.parametrize("change", CHANGES)
def test_another_thread_cannot_change_a_game_while_a_turn_is_played(change):
    in_turn, tried = Event(), Event()
    said = []

    def wait(_):
        in_turn.set()
        tried.wait(5)

    def try_it(ctx):
        in_turn.wait(5)
        try:
            CHANGES[change](ctx)
        except BadValue as error:
            said.append(str(error))
        tried.set()

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("a", start_node_id=4)
        ctx.game.add(wait)
        other = Thread(target=try_it, args=(ctx,))
        other.start()
        ctx.game.step()
        other.join()
        assert len(said) == 1
        assert said[0].startswith("Another thread plays a turn of this game right now")
        ctx.game.remove(wait)
        CHANGES[change](ctx)
