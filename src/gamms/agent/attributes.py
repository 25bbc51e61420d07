"""Attributes of the caller's that can change, such as dicts: strategies see read-only copies of them."""

from typing import Any

from gamms.deciding import phase_of
from gamms.typing.agent_engine import IAgent


class Attribute:
    """An attribute of the caller's; while a strategy runs, reading it returns a read-only copy.

    Args:
        name: the name; its value is in the `__dict__` of the agent.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, agent: IAgent | None, owner: type) -> Any:
        if agent is None or self._name not in agent.__dict__:
            raise AttributeError(f"{owner.__name__!r} object has no attribute {self._name!r}")
        return phase_of(agent).shown(agent.__dict__[self._name])

    def __set__(self, agent: IAgent, value: object) -> None:
        agent.__dict__[self._name] = value

    def __delete__(self, agent: IAgent) -> None:
        del agent.__dict__[self._name]


def guarded_kind(kind: type, kinds: dict[type, type]) -> type:
    """Return the subclass of a class of agents that has the attributes of one context, so that the class has none.

    Args:
        kind: the class of an agent.
        kinds: of the context: class -> that subclass, which is added.
    """
    # NOTE: with `__getattr__` no class would be needed, but all else is read half as fast (benchmarks: the loop).
    found = kinds.get(kind)
    if found is None:
        copied = {name: getattr(kind, name) for name in ("__module__", "__qualname__", "__doc__")}
        found = kinds[kind] = type(kind)(kind.__name__, (kind,), {"__slots__": (), **copied})
        kinds[found] = found
    return found
