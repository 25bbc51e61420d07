"""The agent room: agents by name, each a view of one row of `ir.agents.AgentColumns`.

Read `member.py` first, then `agent.py` and `aerial.py`, which add standing and flying. May import: typing, kernels, ir
and below, never another room; moves are written by the game room, through `IMoves`. To record or sense something new
about agents, add a column and a property.
"""

from gamms.agent.aerial import AerialAgent
from gamms.agent.agent import Agent
from gamms.agent.engine import AgentEngine
from gamms.agent.member import Member
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, IAgentEngine
from gamms.typing.opcodes import OpCodes

NoOpAgent = IAgent  # in 1.0.0, too, a name that cannot be instantiated

__all__ = [
    "AerialAgent",
    "Agent",
    "AgentEngine",
    "AgentType",
    "IAerialAgent",
    "IAgent",
    "IAgentEngine",
    "Member",
    "NoOpAgent",
    "OpCodes",
]
