"""The agent engine: agents by name, each a view of one row of an `ir.agents.AgentBlock`, which owns every change.

Read `agent.py` first. May import: typing, kernels, ir and below, never another engine. To record or sense a new value
of agents, add a column to the block, its event, and a property.
"""

from gamms.agent.agent import AerialAgent, Agent, BaseAgent
from gamms.agent.engine import AgentEngine
from gamms.agent.teams import Team
from gamms.errors import list_names as _list_names
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, IAgentEngine
from gamms.typing.recorder import OpCodes

NoOpAgent = IAgent  # 1.0.0 also has this name, and it cannot be instantiated there either

__all__ = [
    "AerialAgent",
    "Agent",
    "AgentEngine",
    "AgentType",
    "BaseAgent",
    "IAerialAgent",
    "IAgent",
    "IAgentEngine",
    "NoOpAgent",
    "OpCodes",
    "Team",
]
_list_names(__name__, __all__)
