"""GAMMS: games between teams of agents on graphs and real road networks.

    import gamms

    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(networkx_graph)
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"])

Packages and names are loaded when they are first used. Start reading at `context.py`, which builds and wires the
others.
"""

import typing as _typing
from importlib import import_module as _import_module

from gamms import compat
from gamms.errors import UnknownAttribute as _UnknownAttribute

if _typing.TYPE_CHECKING:  # for completion and type checkers; at run time names come on first use
    # ruff: isort: off
    from gamms import agent, graph, memory, sensor, typing, visual
    from gamms import belief as belief, bridge as bridge, context as context, core as core, errors as errors
    from gamms import experiment as experiment, game as game
    from gamms import limits as limits, llm as llm, osm as osm, planning as planning
    from gamms import recorder as recorder, recordings as recordings, rendering as rendering, rl as rl, rules as rules
    from gamms import scenario as scenario, solve as solve, strategies as strategies, suite as suite
    from gamms import testing as testing
    from gamms import tournament as tournament, web as web
    from gamms.context import Context, InternalContext, create_context
    from gamms.game.array_functions.declarations import array_rule, array_strategy
    from gamms.typing import logger
    from gamms.versions import __version__ as __version__

__all__ = [
    "Context",
    "InternalContext",
    "agent",
    "array_rule",
    "array_strategy",
    "create_context",
    "graph",
    "logger",
    "memory",
    "sensor",
    "typing",
    "visual",
]

_MODULES = {
    *(
        "agent",
        "belief",
        "bridge",
        "context",
        "core",
        "errors",
        "experiment",
        "game",
        "graph",
        "limits",
        "llm",
        "memory",
        "osm",
        "planning",
        "recorder",
        "recordings",
        "rendering",
    ),
    *(
        "rl",
        "rules",
        "scenario",
        "sensor",
        "solve",
        "strategies",
        "suite",
        "testing",
        "tournament",
        "typing",
        "visual",
        "web",
    ),
}
_HOMES = {
    **dict.fromkeys(("Context", "InternalContext", "create_context"), "gamms.context"),
    **dict.fromkeys(("array_rule", "array_strategy"), "gamms.game.array_functions.declarations"),
    "logger": "gamms.typing",
    "__version__": "gamms.versions",
}

compat.install()


if not _typing.TYPE_CHECKING:  # which would take every misspelt name for one that is there

    def __getattr__(name: str) -> _typing.Any:
        if name in _HOMES:
            found = getattr(_import_module(_HOMES[name]), name)
            globals()[name] = found
            return found
        found = _import_module(f"gamms.{name}") if name in _MODULES else compat.resolve(name)
        if found is None:
            if name.startswith("_"):
                raise _UnknownAttribute(__name__, name, ())
            raise _UnknownAttribute(__name__, name, sorted({*_HOMES, *_MODULES}), compat.describe_place)
        return found


def __dir__() -> list[str]:
    # Without modules that only GAMMS uses: they are in the globals once they were imported.
    return sorted({name for name in globals() if name.startswith("__")} | {*_HOMES, *_MODULES})
