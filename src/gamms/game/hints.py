"""What code of a user probably meant, from the error that it raised; made once, when the error ends a run."""

import ast
import linecache
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import islice
from types import FrameType, TracebackType
from typing import Any

from gamms.errors import UnknownAttribute, nearest
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext

States = Sequence[Mapping[str, Any]]

_OF_TUPLES = " Nodes, edges, moves and contacts have attributes: write .name, not ['name']."

_FEW = 8  # keys that a hint lists
_PAIR = 2  # the kind and the data of a sensor
_PAIR_ERRORS = re.compile(r"tuple indices must be|SensorType|'tuple' object")  # of code that takes a pair for data
_SET_ATTRIBUTE = re.compile(r"'(State|AerialState)' object has no attribute '(\w+)'")
_NO_ITEMS = re.compile(r"indices must be|is not subscriptable|does not support item")
_UNCHANGEABLE = re.compile(r"does not support item|has no attribute '(append|remove|pop|insert|extend)'")


def explain_strategy_error(error: BaseException, states: States, plan: Mapping[str, Any] | None) -> str:
    """Return the hint for a strategy or a plan that has raised an error; "" if there is none.

    Args:
        error: the error.
        states: the state of each of its agents; none for a plan of arrays.
        plan: the argument of a plan; None: it is a strategy.
    """
    indexed = find_indexed_object(error)
    return (
        _explain_pair(error, indexed, states)
        or _explain_state(error, indexed, states, plan)
        or _explain_type(error, indexed, plan or (), "its state is states[name]; loop over states.values()")
        or UnknownAttribute.hint_of(error)
    )


def explain_rule_error(error: BaseException, ctx: HostContext) -> str:
    """Return the hint for a rule that has raised an error; "" if there is none."""
    indexed = find_indexed_object(error)
    if type(error) is KeyError and indexed is not None and indexed is ctx.game.data:
        key = shown(error.args[0])
        return f" ctx.game.data has no such key yet: begin with ctx.game.data.setdefault({key}, …)."
    if indexed is None and type(error) is TypeError and "tuple indices must be" in str(error):
        return _OF_TUPLES
    way_out = "loop over ctx.game.agents, or call ctx.agent.get_agent"
    return _explain_type(error, indexed, ctx.agent.agents, way_out) or UnknownAttribute.hint_of(error)


def _explain_pair(error: BaseException, indexed: object, states: States) -> str:
    """Return a hint for code that uses the value of a sensor, the pair (kind, data), as its data."""
    sensed = [(name, pair) for state in states for name, pair in _list_sensors(state).items()]
    names: list[str] = []
    if type(error) is AttributeError:
        names = [name for name, pair in sensed if pair is error.obj]
    elif type(error) is TypeError and indexed is not None:
        names = [name for name, pair in sensed if pair is indexed]
    elif type(error) is TypeError and _PAIR_ERRORS.search(str(error)):
        names = [name for name, _ in sensed]
    if not names:
        return ""
    return f" A sensor gives the pair (kind, data): write _, seen = state['sensor'][{shown(names[0])}]."


def _explain_state(error: BaseException, indexed: object, states: States, plan: Mapping[str, Any] | None) -> str:
    """Return a hint for code that reads or sets a key that a state lacks, or changes a read-only value."""
    key = error.args[0] if type(error) is KeyError and error.args else None
    if key is not None and plan is not None and indexed is plan:
        return f" Its agents are: {', '.join(map(shown, plan))}."
    for state in states:
        if key is not None and indexed is not None:
            hint = _explain_missing_key(key, indexed, state)
        elif key is not None and plan is None:
            hint = _explain_unknown_key(key, state)
        else:
            hint = _explain_misuse(error, indexed, state)
        if hint:
            return hint
    return ""


def _list_sensors(state: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return the pairs (kind, data) of the sensors in a state, without values that the strategy has put there."""
    given = state.get("sensor")
    named = given.items() if isinstance(given, dict) else ()
    return {name: pair for name, pair in named if isinstance(pair, tuple) and len(pair) == _PAIR}


def _explain_missing_key(key: object, indexed: object, state: Mapping[str, Any]) -> str:
    """Return a hint for a key that a part of a state lacks."""
    if indexed is state:
        return nearest(key, state) or f" The state has: {', '.join(map(shown, state))}."
    sensors = _list_sensors(state)
    if indexed is state.get("sensor"):
        if not sensors:
            return " It has no sensors: give it some, create_agent(…, sensors={…})."
        return f" Its sensors are: {', '.join(map(shown, sensors))}."
    for name in ("memory", "team_memory"):
        if indexed is state.get(name):
            return f" state['{name}'] has no such key yet: read state['{name}'].get({shown(key)}, …)."
    sensor = next((sensor for sensor, (_, data) in sensors.items() if data is indexed), None)
    return "" if sensor is None else f" Sensor {shown(sensor)} shows now: {_join_first_keys(sensors[sensor][1])}."


def _join_first_keys(data: Iterable[object]) -> str:
    """Return the first few keys of the data of a sensor."""
    return ", ".join(map(shown, islice(data, _FEW))) or "nothing"


def _explain_unknown_key(key: object, state: Mapping[str, Any]) -> str:
    """Return a hint for a missing key of an object that is not known: probably a sensor, or a key of the state."""
    sensors = _list_sensors(state)
    if nearest(key, sensors):
        return f" Its sensors are: {', '.join(map(shown, sensors))}."
    if not isinstance(key, str):
        return ""
    return nearest(key, state) or f" The state has: {', '.join(map(shown, state))}."


def _explain_misuse(error: BaseException, indexed: object, state: Mapping[str, Any]) -> str:
    """Return a hint for code that takes a value of a state for another kind of value."""
    words = str(error)
    found = _SET_ATTRIBUTE.match(words)
    if type(error) is AttributeError and found is not None and found[1] == type(state).__name__:
        return nearest(found[2], dir(state)) or " Set state.action; notes belong into state['memory']."
    legal = state.get("legal")
    is_legal = (legal is indexed or legal is getattr(error, "obj", None)) and legal is not None
    if is_legal and _UNCHANGEABLE.search(words):
        return " state['legal'] has the nodes that state['action'] may be, and cannot be changed."
    is_place = type(indexed) is int and indexed == state.get("curr_pos") and _NO_ITEMS.search(words)
    if is_place:
        return " state['curr_pos'] is the id of a node: ctx.graph.graph.get_node(…) has its x and y."
    return ""


def _explain_type(error: BaseException, indexed: object, names: Container[str], way_out: str) -> str:
    """Return a hint for code that takes a value of another kind for a dict or a list, or a name for an agent.

    Args:
        error: the error.
        indexed: the object that was indexed.
        names: the names of agents.
        way_out: how the code gets the object that belongs to a name.
    """
    taken = error.obj if type(error) is AttributeError else indexed
    if isinstance(taken, str):
        return f" {shown(taken)} is the name of an agent: {way_out}." if taken in names else ""
    if type(error) is IndexError and isinstance(indexed, (list, tuple)):
        return f" Its length is {len(indexed)}; a path to the node itself has one node: look at the length first."
    if type(error) is not TypeError or indexed is None:
        return ""
    fields = getattr(type(indexed), "_fields", None)
    if isinstance(indexed, tuple) and fields is not None:
        return f" {type(indexed).__name__} has attributes: {', '.join(f'.{name}' for name in fields)}."
    if type(indexed) is list and _NO_ITEMS.search(str(error)):
        has_agents = bool(indexed) and isinstance(indexed[0], IAgent)
        return " It is a list: loop over it" + (", or call ctx.agent.get_agent(name)." if has_agents else ".")
    return ""


def find_indexed_object(error: BaseException) -> Any:
    """Return the object that was indexed, `x` of `x[key]`, where that raised an error.

    The source of the line is read, and no code of the user runs: only names, keys of plain dicts, tuples and lists, and
    attributes of objects of GAMMS are followed.

    Returns:
        The object; None if another operation has raised the error, or if the object is not known.
    """
    step = error.__traceback__
    if step is None:
        return None
    while step.tb_next is not None:
        step = step.tb_next
    try:
        expression = ast.parse(f"({_read_failed_code(step)}\n)", mode="eval").body
    except (SyntaxError, ValueError):
        return None
    return _evaluate_expression(expression.value, step.tb_frame) if isinstance(expression, ast.Subscript) else None


def _read_failed_code(step: TracebackType) -> str:
    """Return the source of the operation that failed; "" if it is not at hand."""
    code = step.tb_frame.f_code
    first, last, begin, end = next(islice(code.co_positions(), step.tb_lasti // 2, None), (None, None, None, None))
    if first is None or last is None or begin is None or end is None:
        return ""
    lines = [linecache.getline(code.co_filename, line, step.tb_frame.f_globals) for line in range(first, last + 1)]
    text = [line.encode() for line in lines]  # columns count bytes
    text[-1] = text[-1][:end]
    text[0] = text[0][begin:]
    return b"".join(text).decode(errors="replace")


def _evaluate_expression(expression: ast.expr, frame: FrameType) -> Any:
    """Return the value of an expression in a frame; None if it is not known without running code of the user."""
    if isinstance(expression, ast.Constant):
        return expression.value
    if isinstance(expression, ast.Name):
        return frame.f_locals.get(expression.id, frame.f_globals.get(expression.id))
    if isinstance(expression, ast.Attribute):
        owner = _evaluate_expression(expression.value, frame)
        return getattr(owner, expression.attr, None) if _is_ours(owner) else None
    if isinstance(expression, ast.Subscript) and isinstance(expression.slice, (ast.Constant, ast.Name)):
        return _get_item(_evaluate_expression(expression.value, frame), _evaluate_expression(expression.slice, frame))
    return None


def _get_item(owner: object, key: object) -> Any:
    """Return an item of a plain dict, tuple or list, or of a mapping of GAMMS; None if it has none."""
    if not isinstance(owner, (dict, tuple, list, ReadOnlyMapping)) or not isinstance(key, (str, int)):
        return None
    if type(owner) not in {dict, tuple, list} and not _is_ours(owner):
        return None
    items: Any = owner
    try:
        return items[key]
    except (LookupError, TypeError):
        return None


def _is_ours(value: object) -> bool:
    return type(value).__module__.startswith("gamms.")
