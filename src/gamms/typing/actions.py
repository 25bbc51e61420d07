"""Checks of nodes, headings, positions, quaternions and strategies passed by callers."""

import dis
from collections.abc import Callable, Iterable, Mapping
from functools import partial, update_wrapper
from inspect import Parameter, iscoroutinefunction, unwrap
from math import hypot, isfinite
from types import CodeType
from typing import Any, cast

import numpy as np

from gamms import kernels
from gamms.arguments import (
    DescribedFunction,
    as_float,
    as_function_of,
    as_int,
    as_numbers,
    as_range,
    find_annotations,
    find_signature,
)
from gamms.deciding import Deciders, get_phase
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.agents import UNTURNED, AgentBlock, Position, Quat, get_speed
from gamms.ir.graph import as_mode, as_node_id, label_hint, split_mode
from gamms.text import as_code, shown
from gamms.typing.context import IContext
from gamms.typing.graph_engine import IGraph, OSMEdge

_STATES = ("state", "states")  # first parameters of strategies
_CONTEXT = "ctx"  # the first parameter of functions that make strategies
_STATE_TYPES = ("State", "AerialState", "dict", "Dict", "Mapping")
_CONTEXT_TYPES = ("Context", "IContext", "HostContext")
_NO_STATE = (TypeError, AttributeError)  # errors of strategies that are called with a context instead of a state

Function = Callable[..., Any]


def as_node(value: object, graph: IGraph) -> int:
    """Return an action that must be the id of a node of a graph, as an int."""
    try:
        return as_int(value, "A node id")
    except BadType:
        raise BadType(
            f"An action must be a node id or a dict with 'node_id', not {shown(value)} ({type(value).__name__})."
            f"{label_hint(value, graph)}"
        ) from None


def find_parallel_edges(state: Mapping[str, Any], ctx: IContext) -> dict[int, list[OSMEdge]]:
    """Return node -> the edges to it that the action of an agent may name, for nodes to which several of them lead."""
    if "legal_edges" not in state and "fork" not in state:  # the state of a program's own loop
        return {}
    found: dict[int, list[OSMEdge]] = {}
    for id in state["legal_edges"]:
        edge = ctx.graph.graph.get_edge(id)
        found.setdefault(edge.target, []).append(edge)
    return {node: edges for node, edges in found.items() if len(edges) > 1}


def check_mode(ctx: IContext, block: AgentBlock, value: object) -> str | None:
    """Return the mode of a new agent on the ground: the name of an edge attribute, or None for all edges.

    Raises:
        BadType, UnknownName (KeyError), BadValue: no edge has the attribute, or its values are no booleans or numbers.
    """
    if block.trusts_nodes:  # a replay, in which no agent chooses its way, but which may go on as a game
        known = as_mode(value) if isinstance(value, (str, Mapping)) else None
        if known is not None:
            ctx.graph.storage.note_mode(known)
        return known
    mode = as_mode(value)
    if mode is not None:
        ctx.graph.routes.select_mode(split_mode(mode)[0])
    return mode


_NO_GRAPH = " Attach a graph first, such as ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))."


def check_node(graph: IGraph, block: AgentBlock, value: object) -> int:
    """Return the id of a node of the graph; if the block trusts nodes, of any 64-bit integer.

    Raises:
        UnknownName (KeyError): the node does not exist.
        BadType: not an integer.
    """
    node = as_node_id(value, "A node id", graph)
    is_known = -(1 << 63) <= node < 1 << 63 if block.trusts_nodes else graph.has_node(node)
    if not is_known:
        nodes = [*graph.get_nodes()]
        raise UnknownName("node", node, nodes, "" if nodes else _NO_GRAPH)
    return node


def find_above(graph: IGraph, node: int, z: float) -> Position:
    """Return the position above a node; (0, 0, z) for an unknown trusted node, whose position is set later."""
    if not graph.has_node(node):
        return (0.0, 0.0, z)
    _, x, y = graph.get_node(node)
    return (x, y, z)


def as_heading(heading: object) -> tuple[float, float]:
    """Return `(cos, sin)` of length 1 from a pair of any length."""
    try:
        x, y = cast("Iterable[object]", heading)
    except (TypeError, ValueError):
        raise BadValue(f"An orientation must be a pair (cos, sin), not {shown(heading)}.") from None
    cos = as_float(x, "An orientation")
    sin = as_float(y, "An orientation")
    scale = max(abs(cos), abs(sin))  # scale first, so that no square overflows or vanishes
    if scale == 0.0:
        raise BadValue("An orientation must not be (0, 0). Use None to clear it.")
    cos = cos / scale
    sin = sin / scale
    length = hypot(cos, sin)
    return cos / length, sin / length


def get_heading(action: dict[str, Any]) -> Any:
    """Return the heading in an action dict, or None to follow moves; () if the dict has no heading.

    Raises:
        BadValue, BadType: the dict has no `node_id`, or an invalid orientation.
    """
    if "node_id" not in action:
        raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
    if "orientation" not in action:
        return ()
    heading = action["orientation"]
    return None if heading is None else as_heading(heading)


def as_position(value: object) -> Position:
    """Return `(x, y, z)`, finite."""
    x, y, z = as_numbers(value, "A position", "(x, y, z)")
    return (x, y, z)


def as_quat(value: object) -> Quat:
    """Return `(w, x, y, z)` of length 1 from a quaternion of any length; all zeros mean no rotation."""
    w, x, y, z = as_numbers(value, "A quat", "(w, x, y, z)")
    return kernels.normalize_quaternion((w, x, y, z)) or UNTURNED


def make_level_quat(heading: object) -> Quat:
    """Return the rotation that faces `(cos, sin)`, of any length, without pitch and roll; None: no rotation."""
    return UNTURNED if heading is None else kernels.make_rotation(as_heading(heading))


def step_once(position: Position, direction: object, speed: float) -> Position:
    """Return the position after one step of `speed` map units; a direction of length 0 does not move."""
    parts = as_numbers(direction, "A direction", "(dx, dy, dz)")
    scale = max(map(abs, parts))
    if scale == 0.0:
        return position
    parts = [part / scale for part in parts]
    length = hypot(*parts)
    x, y, z = (at + part / length * speed for at, part in zip(position, parts, strict=True))
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise BadValue(f"A step of {speed} from {position} exceeds the range of floats. Use a smaller speed.")
    return (x, y, z)


def resolve_flight(block: AgentBlock, row: int, action: object) -> tuple[Position | None, Quat | None]:
    """Return the position and the quaternion after the action of a flying agent; None for an unchanged value.

    Raises:
        BadType, BadValue: not an action of a flying agent.
    """
    if isinstance(action, dict):
        quat = as_quat(action["quat"]) if "quat" in action else None
        if "direction" not in action:
            return None, quat
        return _find_position_ahead(block, row, action["direction"], action.get("distance")), quat
    if isinstance(action, (tuple, np.ndarray)):
        return _find_position_ahead(block, row, action, None), None
    raise BadType(
        "The action of an aerial agent must be a tuple (dx, dy, dz) or a dict with 'direction' or 'quat', "
        f"not {shown(action)} ({type(action).__name__})."
    )


def get_position(block: AgentBlock, row: int) -> Position:
    """Return the position of a flying agent.

    Raises:
        BadType: the agent is on the ground.
    """
    position: Position | None = block.flights.get_position(row)
    if position is None:
        raise BadType(f"Agent {block.names[row]!r} does not fly.")
    return position


def _find_position_ahead(block: AgentBlock, row: int, direction: object, distance: object) -> Position:
    speed = get_speed(block, row) or 0.0
    if distance is None:
        return step_once(get_position(block, row), direction, speed)
    far = as_range(distance, "A distance")
    if far > speed:
        raise BadValue(f"A distance of {far:g} is more than the speed of agent {block.names[row]!r}, {speed:g}.")
    return step_once(get_position(block, row), direction, far)


# -- strategies, and functions that make them ----------------------------------------------------------------------


def make_strategy(ctx: IContext, given: object) -> Any:
    """Return a value that is a strategy, or the strategy that it makes in a context.

    A function makes strategies if its first parameter is `ctx`, or is annotated as a context. It is a strategy if this
    parameter is `state`, or is annotated as a state, if the function sets "action" or returns nothing, or if it is
    written in C. Any other function is called with the context, which must not be changed during the call: it makes
    strategies if it returns a function.

    Raises:
        BadType: neither; or it needs more arguments than the context; or this cannot be determined.
        BadValue: it was made for another context.
    """
    is_maker = is_factory(given)
    function = cast("Function", given)
    if is_maker is None:
        is_maker = _is_returning_function(ctx, function)
    if not is_maker:
        return _check_strategy(ctx, as_function_of(given, "A strategy", "the state"))
    _refuse_missing(function)
    made = function(ctx)
    if not callable(made):
        raise BadType(f"{as_code(given)} returns {shown(made)}, which is not a strategy.")
    return _check_strategy(ctx, made)


def plan_in(ctx: IContext, given: object) -> Any:
    """Return a value that is the plan of a team, or the plan that it makes in a context.

    A strategy that it makes, and a strategy of `gamms.strategies`, becomes a plan that decides for one agent after
    another. Other values are returned unchanged.

    Raises:
        BadType, BadValue: see `make_strategy`.
    """
    is_ours = str(getattr(given, "__module__", "")).startswith("gamms.strategies.")
    is_plan = not callable(given) or (is_factory(given) is False and not is_ours)
    made: Any = given if is_plan else make_strategy(ctx, given)
    first = None if is_plan else _find_first_parameter(made)
    if is_plan or (made is given and not is_ours) or (first is not None and first.name == "states"):
        return made

    def plan(states: dict[str, object]) -> None:
        for state in states.values():
            made(state)

    async def awaited_plan(states: dict[str, object]) -> None:
        for state in states.values():
            await made(state)

    found: Any = update_wrapper(awaited_plan if _is_awaited(made) else plan, made)
    del found.__wrapped__  # which takes a state
    return found


def is_factory(given: object) -> bool | None:
    """Return whether a value makes strategies, without calling it; None if this is unknown."""
    code = getattr(given.func if type(given) is DescribedFunction else given, "__code__", None)
    if code is not None and code.co_argcount and code.co_varnames[0] in _STATES:  # NOTE: called for each agent
        return False
    function = given if callable(given) else None
    first = None if function is None else _find_first_parameter(function)
    if function is None or first is None or first.kind is Parameter.VAR_POSITIONAL or _is_awaited(function):
        return False
    kind = getattr(first.annotation, "__name__", str(first.annotation)).rpartition(".")[2]
    if first.name == _CONTEXT or kind in _CONTEXT_TYPES:
        return True
    makes_others = getattr(find_annotations(given).get("return"), "__origin__", None) is Callable  # such as rules
    if makes_others or first.name in _STATES or kind in _STATE_TYPES:
        return False
    return None if isinstance(given, type) or _may_return(_find_code(function)) else False


def _is_awaited(given: Function) -> bool:
    return iscoroutinefunction(given) or iscoroutinefunction(getattr(given, "__call__", None))  # noqa: B004 - it is looked at


def _find_first_parameter(given: Function) -> Parameter | None:
    """Return the first parameter that a caller passes; None without parameters, or for a function in C."""
    try:
        parameters = find_signature(given).parameters.values()
    except (TypeError, ValueError):
        return None
    return next((one for one in parameters if one.kind not in (Parameter.KEYWORD_ONLY, Parameter.VAR_KEYWORD)), None)


def _find_code(given: Function) -> CodeType | None:
    """Return the code of a function, or of the call method of an object; None if it is written in C."""
    while isinstance(given, partial):
        given = given.func
    plain = unwrap(getattr(given, "__func__", given))
    code = getattr(plain, "__code__", None) or getattr(type(plain).__call__, "__code__", None)
    return code if isinstance(code, CodeType) else None


def _may_return(code: CodeType | None) -> bool:
    """Return whether a function returns a value, and does not use "action" as a key or a keyword."""
    if code is None or any(one == "action" or (isinstance(one, tuple) and "action" in one) for one in code.co_consts):
        return False
    return any(value is not None for value in _list_returned_constants(dis.get_instructions(code)))


def _list_returned_constants(instructions: Iterable[dis.Instruction]) -> Iterable[object]:
    """Yield the constants that a function returns, and a mark for each computed value."""
    before = None
    for one in instructions:
        if one.opname == "RETURN_CONST":
            yield one.argval
        elif one.opname == "RETURN_VALUE":
            yield one if before is None or before.opname != "LOAD_CONST" else before.argval
        before = one


def _is_returning_function(ctx: IContext, given: Function) -> bool:
    """Return whether a function returns a function when it is called with the context."""
    phase = get_phase(ctx)
    name = as_code(given)
    phase.read_last_turn()
    before = phase.agent
    phase.agent = Deciders(f"{name}, which is called to see whether it makes a strategy,", (), is_maker=True)
    try:
        return callable(given(ctx))
    except _NO_STATE:
        return False
    except Exception as error:
        raise BadType(
            f"{name} may be a strategy, or make one: called with the context, it raises {type(error).__name__}: "
            f"{error} Name its first parameter state if it is a strategy, and ctx if it makes one."
        ) from error
    finally:
        phase.agent = before


def _refuse_missing(given: Function) -> None:
    """Refuse functions that need more arguments than the context to make a strategy.

    Raises:
        BadType: it needs more.
    """
    try:
        find_signature(given).bind(None)
    except TypeError:
        raise BadType(
            f"{as_code(given)} makes a strategy, but needs more than the context: call it, "
            f"{as_code(given)}(…), and pass what it returns, or pass lambda ctx: {as_code(given)}(ctx, …)."
        ) from None


def _check_strategy(ctx: IContext, strategy: Function) -> Any:
    """Return a strategy, if it was not made for another context.

    Raises:
        BadValue: it was made for another context.
    """
    if isinstance(strategy, DescribedFunction) and any(
        isinstance(one, IContext) and one is not ctx for one in strategy.list_held()
    ):
        raise BadValue(
            f"{shown(strategy)} was made for another context and uses its map and agents. Make it with this context."
        )
    return strategy
