"""Annotations may name what is imported for type checkers alone; Python 3.14 evaluates them when they are asked for."""

import sys

import pytest

from gamms import scenario
from gamms.errors import BadType

IS_LAZY = sys.version_info >= (3, 14)
CODE = """
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nowhere import Context, Nodes, State


def cautious(ctx: Context, step: Nodes) -> Nodes:
    def strategy(state: State) -> None:
        state["action"] = state["curr_pos"] + step

    return strategy


def count(ctx: Context) -> Nodes:
    ctx.game.data["turns"] = ctx.game.data.get("turns", 0) + 1


def further(node_id: Nodes) -> Nodes:
    return node_id + 1


class Board:
    def __init__(self, marks: Nodes = 0) -> None:
        self.marks = marks
"""


def test_annotations_that_cannot_be_evaluated_are_no_error(tmp_path):
    code = CODE if IS_LAZY else f"from __future__ import annotations\n{CODE}"
    (tmp_path / "players.py").write_text(code)
    exec(code, players := {})
    game = scenario.Scenario(
        map={"grid": {"width": 9, "height": 1}},
        max_turns=3,
        teams={
            "red": {
                "agents": [{"name": "ann", "node": 0}],
                "strategy": {"function": "players:cautious", "with": {"step": 1}},
            }
        },
        rules=["players:count"],
        folder=tmp_path,
    )
    with game.build() as ctx:
        [ann] = ctx.agent.create_iter()
        further = ctx.sensor.from_function("further", players["further"])
        board = ctx.record.component({"marks": int})(players["Board"])("board", 2)
        ctx.game.run()
        assert (ann.current_node_id, ctx.game.data["turns"]) == (3, 3)
        further.sense(ann.current_node_id)
        assert (further.data, board.marks) == (4, 2)
        with ctx.game.fork(seed=1).ctx as twin:
            assert twin.game.run(max_turns=2).turns == 5
        with pytest.raises(BadType, match=r"alone, and cautious\(ctx: .*Context.*, step: .*Nodes.*\).* is not"):
            ctx.game.add(players["cautious"])
