"""Strategies cannot write into the arrays that they are handed, nor make them writable."""

from collections.abc import Mapping
from queue import SimpleQueue

import numpy as np
import pytest

import gamms
from gamms.game import TeamArrays
from gamms.game.block.columns import AgentTable
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import GraphColumns, RowMapping

OPENED = (StreetGraph, GraphColumns, AgentTable, TeamArrays, RowMapping)


def arrays_in(path, thing, seen):
    """Yield the arrays that public names lead to, with their paths."""
    if isinstance(thing, np.ndarray):
        yield path, thing
    if any(thing is one for one in seen):
        return
    seen.append(thing)
    if isinstance(thing, Mapping) and not isinstance(thing, RowMapping) and "view" not in type(thing).__name__.lower():
        for key, value in thing.items():
            yield from arrays_in(f"{path}[{key!r}]", value, seen)
    elif isinstance(thing, OPENED) or "view" in type(thing).__name__.lower():
        for name in dir(thing):
            if name[0] != "_" and not callable(getattr(type(thing), name, None)) and name != "agents_of":
                yield from arrays_in(f"{path}.{name}", getattr(thing, name, None), seen)


def writable(path, thing):
    """Return the arrays whose memory can be written to, by what can be reached from them."""
    found = []
    for name, array in arrays_in(path, thing, []):
        owner = array
        while isinstance(owner, np.ndarray) and owner.base is not None:
            owner = owner.base
        if not isinstance(owner, bytes):
            found.append(name)
        else:
            with pytest.raises(ValueError, match="cannot set WRITEABLE"):
                array.setflags(write=True)
    return found


SCENE = gamms.scenario.Scenario(
    map={"grid": {"width": 5, "height": 5}},
    teams={
        "red": {"count": 2, "near": 0, "within": 20, "strategy": "gamms.strategies:stay"},
        "blue": {"count": 2, "near": 24, "within": 20, "strategy": "gamms.strategies:random_walk"},
    },
    rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
    max_turns=3,
)
HANDED = {"living", "is_there", "memory_of", "node", "agents", "counts", "games", "mask", "turn"}
STREETS = {"axes", "counts", "legal", "offsets", "targets"}


@pytest.mark.parametrize("is_batch", [True, False], ids=["in a batch", "in a game alone"])
def test_no_array_of_a_view_can_be_written_to(is_batch):
    told = SimpleQueue()  # which is not looked at as what the strategy keeps

    def look(view):
        told.put((writable("view", view), {path for path, _ in arrays_in("view", view, [])}))
        return np.zeros(view.node.shape, np.int64)

    if is_batch:
        batch = SCENE.batch(2, strategies={"red": gamms.array_strategy(look)})
        batch.step()
    else:
        SCENE.play(seed=0, strategies={"red": gamms.array_strategy(look)})
    found, seen = told.get()
    assert found == []
    assert {f"view.{name}" for name in HANDED} | {f"view.streets.{name}" for name in STREETS} <= seen
    assert {"view.roster.team_of", "view.roster.keys", "view.streets.columns.targets"} <= seen


def test_no_array_of_a_plan_can_be_written_to():
    found = []

    def plan(arrays):
        found.extend(writable("arrays", arrays))
        found.append(len(list(arrays_in("arrays", arrays, []))))
        return arrays.nodes

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for number in range(3):
            ctx.agent.create_agent(f"a{number}", start_node_id=number, team="red")
        ctx.game.command("red", plan, arrays=True)
        ctx.game.run(2)
    assert found == [5, 5]
