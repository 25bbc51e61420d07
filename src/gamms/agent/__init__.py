"""The agent room: agents by name, each a view of one row of `ir.agents.AgentColumns`.

Read `agent.py` first. May import: typing, kernels, ir and below, never another room; moves are written by the game
room, through `IMoves`. To record or sense something new about agents, add a column and a property.
"""

from typing import Any

from gamms.agent.agent import Agent
from gamms.agent.engine import AgentEngine
from gamms.errors import NotYetAttribute
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, IAgentEngine
from gamms.typing.opcodes import OpCodes

NoOpAgent = IAgent  # in 1.0.0, too, a name that cannot be instantiated

__all__ = [
    "Agent",
    "AgentEngine",
    "AgentType",
    "IAerialAgent",
    "IAgent",
    "IAgentEngine",
    "NoOpAgent",
    "OpCodes",
]


LATER = {"AerialAgent": "aerial agents"}


def __getattr__(name: str) -> Any:
    if name in LATER:
        raise NotYetAttribute(LATER[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
