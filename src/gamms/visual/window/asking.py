"""Questions to a person: where an agent should go next."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType

Answer = int | tuple[float, float, float]
_UP, _DOWN = (0, 0, 1), (0, 0, -1)


class Walk:
    """Which node an agent on the ground goes to: 0 stays, 1 and up are its out-neighbours, in order.

    A number is typed digit by digit; it counts as soon as no longer one could be meant, or with Enter.

    Args:
        ctx: the context.
        name: of the agent.
        here: the node it is on.
    """

    def __init__(self, ctx: IContext, name: str, here: int) -> None:
        graph = ctx.graph.graph
        self.name, self.answer, self.typed = name, None, ""
        others = [node for node in graph.get_neighbors(here) if node != here]
        self.options = dict(enumerate([here, *others]))
        self.places: FloatArray = np.asarray(graph.positions(list(self.options.values())), np.float64)

    answer: Answer | None

    @property
    def words(self) -> str:
        """The text of the question."""
        last = len(self.options) - 1
        typed = f" {self.typed}_" if self.typed else ""
        return f"{self.name}: click a node, or type its number (0 stays{f', 1 to {last}' if last else ''}){typed}"

    def type_digit(self, digit: int) -> None:
        """Take one more digit; one that leads to no option is forgotten, with what was typed before it."""
        for typed in (f"{self.typed}{digit}", str(digit)):
            meant = [number for number in self.options if str(number).startswith(typed)]
            if meant:
                self.typed = typed
                if len(meant) == 1:
                    self.confirm()
                return
        self.typed = ""

    def erase(self) -> None:
        """Forget the last digit."""
        self.typed = self.typed[:-1]

    def confirm(self) -> None:
        """Choose what was typed."""
        if self.typed:
            self.answer, self.typed = self.options.get(int(self.typed)), ""

    def choose(self, number: int) -> None:
        """Choose the option of that number."""
        self.answer = self.options[number]


class Flight:
    """Which way an agent in the air goes: towards a point, up, down, or nowhere."""

    def __init__(self, name: str, here: tuple[float, float, float]) -> None:
        self.name, self.here = name, here
        self.answer: Answer | None = None

    @property
    def words(self) -> str:
        """The text of the question."""
        return f"{self.name}: click where to fly; up and down arrow climb and descend; 0 stays"

    def point_at(self, x: float, y: float) -> None:
        """Fly towards a world point."""
        self.answer = (x - self.here[0], y - self.here[1], 0)

    def climb(self, step: int) -> None:
        """Fly up (1) or down (-1)."""
        self.answer = _UP if step > 0 else _DOWN

    def type_digit(self, digit: int) -> None:
        """0 stays."""
        if digit == 0:
            self.answer = (0, 0, 0)


Question = Walk | Flight


def question(ctx: IContext, name: str, state: dict[str, Any]) -> Question:
    """What to ask about an agent.

    Raises:
        UnknownName (KeyError): there is no such agent, or it is on no node.
    """
    agent = ctx.agent.get_agent(name)
    if agent.type == AgentType.AERIAL:
        return Flight(name, state["curr_pos"])
    return Walk(ctx, name, state["curr_pos"])
