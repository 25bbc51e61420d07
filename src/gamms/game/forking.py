"""Forks: a detached copy of a game, whose random streams follow from another seed."""

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from types import CellType, FunctionType, MethodType
from typing import Any, cast

from gamms.game.deciders import Plan
from gamms.game.snapshots import SnapshotTaker, copied
from gamms.game.turn import TurnMoves
from gamms.ir.game_state import GameState

Memo = dict[int, Any]  # id() of an object -> what takes its place in the fork; see `copy.deepcopy`

_UNKNOWN = object()


def copy_game(source: SnapshotTaker, target: SnapshotTaker, memo: Memo) -> None:
    """Copy all of a game into the game of a new context, whose map, agents and sensors are copies already.

    Args:
        source: the parts of the game.
        target: those of the new game.
        memo: has the context, its engines, agents and sensors.
    """
    source.turns.update_counts()
    for agent in source.ctx.agent.agents.values():
        memo[id(agent)].strategy = own(agent.strategy, memo)
    for sensor in target.ctx.sensor.sensors.values():
        if getattr(sensor, "function", None) is not None:
            sensor.function = own(sensor.function, memo)
    players = {name: deepcopy(agent, memo) for name, agent in source.state.players.items()}
    _copy_state(source.state, target.state, memo)
    target.state.players.update(players)
    settings = source.settings.settings()
    settings["plans"] = {team: Plan(own(plan.function, memo), plan.arrays) for team, plan in settings["plans"].items()}
    target.settings.configure({name: own(value, memo) for name, value in settings.items()})
    target.rules.rules = tuple([one._replace(rule=own(one.rule, memo)) for one in source.rules.rules])
    target.collectors.copy_from(source.collectors, lambda fn: own(fn, memo))
    _renew_states(target)
    moves: TurnMoves | None = source.state.moves
    if moves is not None:
        target.state.moves = moves.of_agents(lambda agent: deepcopy(agent, memo))


def _copy_state(source: GameState, target: GameState, memo: Memo) -> None:
    target.turn, target.last_turn = source.turn, source.last_turn
    target.scores.update(source.scores)
    target.data.update(copied(source.data, memo))
    target.facts.update(source.facts)
    target.timings.update(source.timings)
    target.over = copied(source.over, memo)
    target.team_memories = copied(source.team_memories, memo)
    for name, memory in source.memories.items():
        target.memory_of(name).update(copied(memory, memo))
    target.counts = {name: counts.copy() for name, counts in source.counts.items()}
    target.share_logs(source)


def _renew_states(target: SnapshotTaker) -> None:
    """Put the memories and the random numbers of the fork into the last states of its agents."""
    slots = {slot.name: slot for slot in target.turns.order().slots}
    for name, agent in target.ctx.agent.agents.items():
        state, slot = cast("dict[str, Any]", agent.state), slots.get(name)
        if "memory" in state:
            state["memory"] = target.state.memory_of(name)
            state["team_memory"] = copied(state.get("team_memory"))
            for key, value in (("draw", slot and slot.draws), ("rng", slot and slot.rng)):
                if value is None:
                    state.pop(key, None)
                else:
                    state[key] = value


def own(value: object, memo: Memo) -> Any:
    """Return what a strategy, rule or setting is in a fork.

    A function that closes over the context, an agent or another part of the game becomes one that closes over that of
    the fork; all else that it holds is shared. Objects are copied; those that cannot be copied are shared.
    """
    if value is None or isinstance(value, (FunctionType, MethodType, partial)):
        return _rebound(value, memo)
    trial = dict(memo)
    try:
        made = deepcopy(value, trial)
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        return value
    memo.update(trial)
    return made


def _rebound(value: object, memo: Memo) -> Any:
    known = memo.get(id(value), _UNKNOWN)
    if known is not _UNKNOWN:
        return known
    rebind = _REBOUND.get(type(value))
    return value if rebind is None else rebind(value, memo)


def _rebound_function(function: FunctionType, memo: Memo) -> FunctionType:
    memo[id(function)] = function  # it may close over itself
    cells = function.__closure__ or ()
    made = tuple([_rebound_cell(cell, memo) for cell in cells])
    if all(new is cell for new, cell in zip(made, cells, strict=True)):
        return function
    twin = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__, made)
    twin.__kwdefaults__, twin.__annotations__ = function.__kwdefaults__, function.__annotations__
    twin.__module__, twin.__qualname__, twin.__doc__ = function.__module__, function.__qualname__, function.__doc__
    twin.__dict__.update(function.__dict__)
    memo[id(function)] = twin
    return twin


def _rebound_cell(cell: CellType, memo: Memo) -> CellType:
    try:
        value = cell.cell_contents
    except ValueError:  # nothing was assigned yet
        return cell
    made = _rebound(value, memo)
    return cell if made is value else CellType(made)


def _rebound_method(method: MethodType, memo: Memo) -> Any:
    instance = own(method.__self__, memo)
    return method if instance is method.__self__ else MethodType(method.__func__, instance)


def _rebound_partial(function: "partial[Any]", memo: Memo) -> Any:
    args = [_rebound(one, memo) for one in function.args]
    keywords = {name: _rebound(one, memo) for name, one in function.keywords.items()}
    made = partial(_rebound(function.func, memo), *args, **keywords)
    made.__dict__.update(function.__dict__)
    return made


def _rebound_items(values: list[Any] | tuple[Any, ...], memo: Memo) -> Any:
    items = [_rebound(one, memo) for one in values]
    return values if all(new is one for new, one in zip(items, values, strict=True)) else type(values)(items)


def _rebound_values(values: dict[Any, Any], memo: Memo) -> dict[Any, Any]:
    items = {key: _rebound(one, memo) for key, one in values.items()}
    return values if all(items[key] is one for key, one in values.items()) else items


_REBOUND: dict[type, Callable[[Any, Memo], Any]] = {
    FunctionType: _rebound_function,
    MethodType: _rebound_method,
    partial: _rebound_partial,
    tuple: _rebound_items,
    list: _rebound_items,
    dict: _rebound_values,
}
