"""Columns of agents and views of their rows, with a context and a journal that fit on one screen."""

from array import array

import pytest

from gamms.core.agents import AgentColumns, AgentView, MoveColumns, MovingAgents
from gamms.core.block import INT64, Block, BlockColumn
from gamms.ir.journal import CLOSED, PLAIN, Journal


class Phase:
    """In which no agent decides."""

    agent = None


class Columns(AgentColumns):
    """Three agents on the nodes 5, 6 and 7."""

    def __init__(self, journal=PLAIN):
        block = Block([BlockColumn("node", INT64, 0), BlockColumn("previous", INT64, 0)])
        block.add(3)
        self.show(block.row("node"), block.row("previous"))
        for row in range(3):
            self.node[row] = self.previous[row] = 5 + row
        self.progress, self._changed, self.journal = [None] * 3, set(), journal


class View(AgentView):
    """The agent in a row, which can go to the nodes 5 to 7."""

    def __init__(self, block, row, *carried):
        self._phase, self._block, self._row, self._carried = Phase(), block, row, carried
        self._near, self._last, self.acts = dict.fromkeys((5, 6, 7), (5, 6, 7)), [{}], []

    def _act(self, action):
        self.acts.append(action)

    def _last_state(self):
        return "as it was"

    def _refuse_without_action(self):
        raise KeyError("no action") from None

    def sense(self):
        return {"eyes": "on an edge"}


class Look:
    """A sensor that shows the node from which it has looked last."""

    type = "LOOK"

    def __init__(self):
        self.data = [None]

    def sense(self, node):
        self.data[0] = node


def test_a_move_writes_the_node_and_the_one_before_and_is_known_as_a_change():
    columns = Columns()
    columns.move(1, -(2**63))
    assert (columns.node.tolist(), columns.previous.tolist()) == ([5, -(2**63), 7], [5, 6, 7])
    assert columns._changed == {1}


@pytest.mark.parametrize("row", [-1, 3, 2**62])
def test_no_agent_is_in_a_row_that_there_is_not(row):
    columns = Columns()
    with pytest.raises(IndexError, match=str(row)):
        columns.move(row, 1)
    with pytest.raises(IndexError, match=str(row)):
        View(columns, row).get_state()


def test_a_journal_notes_moves_by_the_numbers_of_agents():
    journal = Journal(["a", "b", "c"])
    journal.ids = [4, 9, 2]
    columns = Columns(journal)
    columns.move(1, 7)
    columns.move(2, 5)
    assert journal.log == [9, 7, 2, 5]
    columns.journal = PLAIN
    columns.move(1, 5)
    assert len(journal.log) == 4


def test_nothing_moves_once_the_journal_is_closed():
    columns = Columns(CLOSED)
    view = View(columns, 0)
    view._last[0] = {"action": 6}
    view.set_state()
    columns.move(0, 6)
    assert (columns.node.tolist(), view.get_state()) == ([5, 6, 7], "as it was")


def test_a_state_has_what_the_sensors_see_and_is_a_fresh_one():
    look, near = Look(), [None]
    view = View(Columns(), 1, ("near", near, "NEIGHBOR", None), ("look", look.data, None, look))
    state = view.get_state()
    assert state == {"curr_pos": 6, "sensor": {"near": ("NEIGHBOR", [5, 6, 7]), "look": ("LOOK", 6)}}
    assert view._last[0] is state
    assert near[0] is state["sensor"]["near"][1]
    assert view.get_state() is not state


def test_an_agent_on_an_edge_senses_from_there():
    columns = Columns()
    columns.progress[1] = "half"
    assert View(columns, 1).get_state() == {"curr_pos": 6, "sensor": {"eyes": "on an edge"}}


def test_a_legal_node_is_a_move_and_anything_else_an_act():
    view = View(Columns(), 0)
    for action in (6, 8, True, "6", None):
        view._last[0] = {"action": action}
        view.set_state()
    assert view._block.node[0] == 6
    assert view.acts == [8, True, "6", None]


def test_a_state_without_an_action_is_refused():
    with pytest.raises(KeyError, match="no action"):
        View(Columns(), 0).set_state()


def test_neither_is_done_while_agents_decide():
    view, asked = View(Columns(), 0), []
    view._phase.agent, view._phase.refuse = "anna", asked.append
    view.get_state()
    view._last[0] = {"action": 6}
    view.set_state()
    assert asked == ["call agent.get_state", "call agent.set_state"]


def column(*numbers):
    return memoryview(array(INT64, numbers))


def test_moves_begin_where_agents_are_and_are_counted_where_they_lead_elsewhere():
    columns, counts = Columns(), memoryview(array("i", [0, 0]))
    moves = MoveColumns(starts := column(0, 0), ends := column(0, 0))
    moving = MovingAgents(columns, column(2, 0), counts)
    moving.begin(moves)
    assert starts.tolist() == ends.tolist() == [7, 5]
    ends[1] = 6
    moving.count(moves)
    assert counts.tolist() == [0, 1]


def test_agents_of_rows_that_are_not_there_begin_nowhere():
    moving = MovingAgents(Columns(), column(3), memoryview(array("i", [0])))
    with pytest.raises(IndexError):
        moving.begin(MoveColumns(column(0), column(0)))
