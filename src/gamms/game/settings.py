"""What a game is played by: settings that are checked when they are set."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

from gamms.arguments import as_count, as_float, as_function_of
from gamms.deciding import Guarded, refused_while_deciding
from gamms.errors import BadType, BadValue, GammsError, UnknownName, nearest
from gamms.game.deciders import Plan, as_plans
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.game import IConflicts

_CHOICES = {
    "legal": ("edges", "any"),
    "on_illegal": ("stay", "raise"),
    "on_error": ("raise", "stay"),
    "speed_unit": ("edges", "metres"),
}


class UnknownSetting(GammsError, AttributeError):
    """An attribute of a game is set that it does not have."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        hint = nearest(name, known) or f" The settings are: {', '.join(known)}."
        super().__init__(f"ctx.game has no {name!r}.{hint} What rules remember belongs into ctx.game.data.")


class Settings(Guarded):
    """The settings of one game.

    Attributes:
        legal: "edges": a move follows edges out of the node, or stays; "any": it may lead to any node.
        on_illegal: what an action that is not legal, or nonsense, leads to: "stay", counted in the result, or "raise".
        on_error: what a strategy that raises leads to: "raise", or "stay", counted in the result.
        speed_unit: what `agent.speed` of an agent on the ground counts per turn: "edges" or "metres".
        conflicts: what decides where moves conflict, such as `gamms.rules.Conflicts`; None: all moves are made.
        time_budget: seconds that a strategy or a plan may take; what takes longer does not count, and is noted as an
            overrun. None: no bound.
        deadline_s: seconds in a turn for all strategies and plans that are awaited; those that have not ended then are
            cancelled, and noted as overruns. None: no bound.
        default_action: what an agent does whose strategy or plan has taken too long, or has raised with
            `on_error="stay"`: "stay", an action, or a function from the agent's state to one. An agent for which it is
            not legal stays.
        plans: team -> what decides for all its agents; see `Game.command`.
        max_turns: `run` ends a game when so many turns were played, before it included; None: when a rule says so.
    """

    legal: Literal["edges", "any"] = "edges"
    on_illegal: Literal["stay", "raise"] = "stay"
    on_error: Literal["raise", "stay"] = "raise"
    speed_unit: Literal["edges", "metres"] = "edges"
    conflicts: IConflicts | None = None
    time_budget: float | None = None
    deadline_s: float | None = None
    default_action: Any = "stay"  # an action of any form, or a function that gives one
    plans: Mapping[Any, Plan] = ReadOnlyMapping({})
    max_turns: int | None = None
    _called = "ctx.game"
    _is_closed = False  # whether all attributes are there, so that another name is a misspelt one

    def __setattr__(self, name: str, value: object) -> None:
        """Set a setting if its value is valid.

        Raises:
            BadValue, BadType: it cannot be set to that.
            UnknownSetting (AttributeError): there is no such setting, nor any other attribute of that name.
        """
        check = _CHECKS.get(name)
        if name[0] != "_":
            self._phase.refuse(f"set ctx.game.{name}")
        if check is None and self._is_closed and not name.startswith("_") and not hasattr(self, name):
            raise UnknownSetting(name, _CHECKS)
        object.__setattr__(self, name, value if check is None else check(name, value))

    def settings(self) -> dict[str, Any]:
        """Return all settings; `configure` takes them."""
        return {name: getattr(self, name) for name in _CHECKS}

    def plain_settings(self) -> dict[str, Any]:
        """Return the settings that are plain values, defaults included; `configure` takes them."""
        plain = {name: getattr(self, name) for name in (*_CHOICES, "time_budget", "deadline_s", "max_turns")}
        default = self.default_action
        return {**plain, "default_action": default} if isinstance(default, (str, int)) else plain

    @refused_while_deciding
    def configure(self, given: object) -> None:
        """Set several settings from a dict.

        Raises:
            UnknownName (KeyError): there is no such setting.
            BadValue, BadType: as for one setting.
        """
        if not isinstance(given, dict):
            raise BadType(f"game= must be a dict of settings, not {shown(given)}.")
        for name in given:
            if name not in _CHECKS:
                raise UnknownName("setting of a game", name, _CHECKS)
        checked = {name: _CHECKS[name](name, value) for name, value in given.items()}
        for name, value in checked.items():
            object.__setattr__(self, name, value)


def _choice(name: str, value: object) -> str:
    known = _CHOICES[name]
    if value not in known:
        hint = nearest(value, known) or f" Use one of: {', '.join(map(repr, known))}."
        raise BadValue(f"ctx.game.{name} cannot be {shown(value)}.{hint}")
    return str(value)


def _conflicts(name: str, value: object) -> Any:
    if value is not None and not callable(getattr(value, "resolve", None)):
        raise BadType(
            f"ctx.game.{name} must have a method resolve(moves, ctx), such as gamms.rules.Conflicts; {shown(value)}."
        )
    return value


def _seconds(name: str, value: object) -> float | None:
    if value is None:
        return None
    seconds = as_float(value, f"ctx.game.{name}")
    if seconds <= 0.0:
        raise BadValue(f"ctx.game.{name} must be positive, not {seconds}; None means no bound.")
    return seconds


def _action(_: str, value: object) -> Any:
    if isinstance(value, str) and value != "stay":
        raise BadValue(f'ctx.game.default_action must be "stay", an action or a function, not {shown(value)}.')
    return as_function_of(value, "A default action", "the state") if callable(value) else value


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(_CHOICES, _choice),
    "conflicts": _conflicts,
    "time_budget": _seconds,
    "deadline_s": _seconds,
    "default_action": _action,
    "plans": as_plans,
    "max_turns": lambda name, value: None if value is None else as_count(value, f"ctx.game.{name}", 0),
}
