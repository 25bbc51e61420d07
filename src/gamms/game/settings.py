"""Settings of a game, checked on assignment; plans of teams; and rules in the order of their calls.

A rule is a function. `RuleSpec` is its declaration, and `get_rule_spec` returns the declaration of any rule.
"""

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from inspect import iscoroutinefunction
from itertools import islice
from typing import Any, Literal, NamedTuple, TypeVar, Unpack

from gamms.arguments import (
    as_bool,
    as_count,
    as_function_of,
    as_items,
    as_key,
    as_known,
    as_name,
    as_positive,
    as_text,
    spell_out_options,
)
from gamms.clocks import WALL_CLOCK, Clock, as_clock
from gamms.core.rules import Rule as CoreRule
from gamms.deciding import ContextPart, get_phase, refuse_to_judges, refuse_while_deciding
from gamms.errors import BadType, BadValue, Duplicate, GammsError, UnknownName, nearest
from gamms.game.channels import Channel, as_channel, as_channels
from gamms.game.deeds import as_deeds, list_lasting, make_plain_declarations
from gamms.game.hints import explain_rule_error
from gamms.game.roles import Role, get_team
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnly, ReadOnlyMapping
from gamms.text import as_code, shown
from gamms.typing.context import HostContext
from gamms.typing.game import ChannelOptions, IConflicts, Rule

R = TypeVar("R", bound=Rule)

_ALWAYS_NOTED = ("legal", "on_illegal", "on_error", "speed_unit", "time_budget", "deadline_s", "max_turns")
_TRAVEL = ("turn_seconds", "weight", "decide")
_ORDER_FORM = "lists of teams, each team once, such as [['cops'], ['robber']]"
_CHOICES = {
    "legal": ("edges", "any"),
    "on_illegal": ("stay", "raise"),
    "on_error": ("raise", "stay"),
    "speed_unit": ("edges", "metres", "metres_per_second"),
    "decide": ("turn", "arrival"),
    "information": ("private", "full"),
}


class Plan(NamedTuple):
    """A function that decides for all living agents of a team."""

    function: Callable[[Any], Any]  # a `TeamPlan`; of arrays an `ArrayPlan`
    arrays: bool = False  # whether it takes arrays and returns nodes


class UnknownSetting(GammsError, AttributeError):
    """An attribute was set that a game does not have."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        hint = nearest(name, known) or f" The settings are: {', '.join(known)}."
        super().__init__(f"ctx.game has no {name!r}.{hint} What rules remember belongs into ctx.game.data.")


_ENDS = " A rule ends a game: ctx.game.end(reason, winner=…)."
_WAYS_OUT = {  # attributes that are only read -> what a rule writes instead
    "over": _ENDS,
    "is_over": _ENDS,
    "scores": " Set its values: ctx.game.scores['red'] += 1.",
    "rules": " Call ctx.game.add(rule) and ctx.game.remove(name).",
}


class Settings(ContextPart):
    """The settings of one game.

    Attributes:
        legal: "edges": a move follows edges or stays; "any": it may lead to any node.
        on_illegal: the effect of an illegal or invalid action: "stay", counted in the result, or "raise".
        on_error: the effect of an error in a strategy: "raise", or "stay", counted in the result.
        speed_unit: the unit of `agent.speed` of agents on the ground: "edges" per turn, "metres" per turn, or
            "metres_per_second". By metres, agents may be anywhere on an edge; see docs/travel.md.
        turn_seconds: the duration of a turn, for speeds in metres per second, and for deeds that last some seconds.
        weight: the edge weight of shortest paths of agents by metres, as in `graph.shortest_path`. With "travel_time"
            and speeds in metres per second, no agent is faster on an edge than its length and its travel time allow.
        decide: when agents by metres decide: every "turn", or at each "arrival" at a node.
        conflicts: resolves conflicts of moves, for example `gamms.rules.Conflicts`; None: all moves are made.
        time_budget: seconds for one call of a strategy or plan; the decision of a slower call is dropped, and counted
            as an overrun. None: no limit.
        deadline_s: seconds per turn for all awaited strategies and plans together; late ones are cancelled, and counted
            as overruns. None: no limit.
        clock: the clock of all that is awaited: `deadline_s`, people and language models. None: that of the machine.
        default_action: the action of an agent whose strategy or plan was too slow, or has raised with
            `on_error="stay"`: "stay", an action, or a function that returns one from the agent's state. If it is not
            legal, the agent stays.
        plans: team -> the plan for all its agents; see `Game.command`.
        team_memory: whether agents of a team share `state["team_memory"]`; otherwise their states have none.
        order: None: all agents decide and move simultaneously. Or lists of teams, for example `[["cops"], ["robber"]]`:
            in each turn, the teams of the first list decide and move simultaneously, then those of the next list, which
            see these moves.
        deeds: actions besides moving: deed -> field -> its kind; see docs/deeds.md.
        channels: channels for messages: name -> keywords; see `add_channel`.
        information: "private": copies of the game for looking ahead contain the knowledge of their agents, see
            docs/planning.md; "full": agents may get complete copies.
        max_turns: `run` ends the game after this number of turns, counted from its start; None: only rules end it.
    """

    legal: Literal["edges", "any"] = "edges"
    on_illegal: Literal["stay", "raise"] = "stay"
    on_error: Literal["raise", "stay"] = "raise"
    speed_unit: Literal["edges", "metres", "metres_per_second"] = "edges"
    turn_seconds: float = 1.0
    weight: str = "length"
    decide: Literal["turn", "arrival"] = "turn"
    conflicts: IConflicts | None = None
    time_budget: float | None = None
    deadline_s: float | None = None
    clock: Clock = WALL_CLOCK
    default_action: Any = "stay"  # an action of any form, or a function that returns one
    plans: Mapping[Any, Plan] = ReadOnlyMapping({})
    team_memory: bool = True
    order: Sequence[Sequence[Any]] | None = None
    deeds: Mapping[str, Mapping[str, Any]] = ReadOnlyMapping({})
    channels: Mapping[str, Channel] = ReadOnlyMapping({})
    information: Literal["private", "full"] = "private"
    max_turns: int | None = None
    _called = "ctx.game"
    _settings_now: tuple[int, dict[str, Any]] = -1, {}  # an epoch, and the settings then
    _is_closed = False  # whether unknown attribute names are refused

    def __setattr__(self, name: str, value: object) -> None:
        """Set a setting, after a check of its value.

        Raises:
            BadValue, BadType: the value is invalid.
            UnknownSetting (AttributeError): there is no setting or attribute of this name.
        """
        check = _CHECKS.get(name)
        if name[0] != "_":
            self._phase.refuse(f"set ctx.game.{name}", changes_game=check is not None)
        if check is None and self._is_closed and not name.startswith("_"):
            self._refuse_unknown(name)
        object.__setattr__(self, name, value if check is None else check(name, value))
        if check is not None:
            self._phase.change_settings()
        if name == "deeds":
            self._follow_deeds()

    def _follow_deeds(self) -> None:
        """Let rules play the declared deeds that last."""

    def _refuse_unknown(self, name: str) -> None:
        """Refuse to set an attribute that is no setting: one that a game lacks, or one that is only read."""
        known = getattr(type(self), name, None)
        if isinstance(known, property) and known.fset is None:
            raise ReadOnly(f"ctx.game.{name} cannot be set.{_WAYS_OUT.get(name, '')}")
        if known is None and not hasattr(self, name):
            raise UnknownSetting(name, _CHECKS)

    def settings(self) -> dict[str, Any]:
        """Return all settings, for `configure`."""
        return {name: getattr(self, name) for name in _CHECKS}

    @refuse_while_deciding
    def settings_now(self) -> dict[str, Any]:
        """Return all settings, read-only; the same dict is returned until a setting changes."""
        if self._settings_now[0] != self._phase.epoch:
            self._settings_now = self._phase.epoch, self.settings()
        return self._settings_now[1]

    def plain_settings(self) -> dict[str, Any]:
        """Return the settings with plain values, including defaults, for `configure`."""
        plain = {name: getattr(self, name) for name in _ALWAYS_NOTED}
        plain.update((name, getattr(self, name)) for name in _TRAVEL if getattr(self, name) != getattr(Settings, name))
        default = self.default_action
        channels = {name: one.list_options() for name, one in self.channels.items()}
        declared = {"order": self.order, "deeds": make_plain_declarations(self.deeds), "channels": channels}
        plain.update((name, value) for name, value in declared.items() if value)
        if not self.team_memory:
            plain["team_memory"] = False
        if self.information != "private":
            plain["information"] = self.information
        return {**plain, "default_action": default} if isinstance(default, (str, int)) else plain

    @refuse_to_judges
    def configure(self, given: object) -> None:
        """Set several settings from a dict.

        Raises:
            UnknownName (KeyError): there is no such setting.
            BadValue, BadType: as for one setting.
        """
        if not isinstance(given, dict):
            raise BadType(f"game= must be a dict of settings, not {shown(given)}.")
        for name in given:
            as_known(name, "setting of a game", _CHECKS)
        checked = {name: check_setting(name, value) for name, value in given.items()}
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        self._phase.change_settings()
        if "deeds" in checked:
            self._follow_deeds()

    @refuse_to_judges
    @spell_out_options()
    def add_channel(self, name: str, **options: Unpack[ChannelOptions]) -> Channel:
        """Add a channel, by which agents send the messages in `state["outbox"]`.

        Args:
            name: a name that no other channel has.
            options: see `ChannelOptions`.

        Raises:
            Duplicate: there is a channel of this name.
            BadValue, BadType: an option is impossible, or the channel has no range.
            UnknownName (KeyError): there is no such option.
        """
        channel = as_channel(name, options)
        if name in self.channels:
            raise Duplicate("a channel", name)
        self.channels = {**self.channels, name: channel}
        return channel

    @refuse_to_judges
    def remove_channel(self, name: str) -> None:
        """Remove a channel; messages under way on it do not arrive.

        Raises:
            UnknownName (KeyError): there is no such channel.
        """
        if as_key(name, "The name of a channel") not in self.channels:
            raise UnknownName("channel", name, self.channels)
        self.channels = {key: one for key, one in self.channels.items() if key != name}


def refuse_unused(settings: Settings) -> None:
    """Refuse settings that have no effect.

    Raises:
        BadValue: a setting has no effect together with the others.
    """
    for name in _TRAVEL:
        value = getattr(settings, name)
        needs_seconds = name == "turn_seconds"
        if needs_seconds and any(one.seconds is not None for one in list_lasting(settings.deeds).values()):
            continue
        idle = ("edges", "metres") if needs_seconds else ("edges",)
        if value != getattr(Settings, name) and settings.speed_unit in idle:
            unit = "metres_per_second" if needs_seconds else "metres"
            raise BadValue(
                f"ctx.game.{name} = {shown(value)} counts nothing with ctx.game.speed_unit = {settings.speed_unit!r}: "
                f"set ctx.game.speed_unit = {unit!r}."
            )
    if settings.decide == "arrival" and getattr(settings.conflicts, "allow_swaps", True) is False:
        raise BadValue(
            "Conflicts(allow_swaps=False) counts nothing with ctx.game.decide = 'arrival': agents that exchange nodes "
            "pass each other on an edge, and are on no node then. Allow it, or set ctx.game.decide = 'turn'."
        )


def _check_choice(name: str, value: object) -> str:
    known = _CHOICES[name]
    if value not in known:
        hint = nearest(value, known) or f" Use one of: {', '.join(map(repr, known))}."
        raise BadValue(f"ctx.game.{name} cannot be {shown(value)}.{hint}")
    return str(value)


def _check_plans(name: str, value: object) -> Mapping[Any, Plan]:
    """Return a read-only mapping from teams to plans; a plain function becomes a plan of states."""
    if not isinstance(value, Mapping):
        raise BadType(f"ctx.game.{name} must be a dict of teams and plans, not {shown(value)}.")
    plans = {}
    for team, plan in value.items():
        function, given = plan if isinstance(plan, Plan) else (plan, False)
        arrays = as_bool(given, "arrays")
        as_function_of(function, "A plan", f"the {'arrays' if arrays else 'states'} of its team")
        plans[as_key(team, "A team")] = Plan(function, arrays)
    return ReadOnlyMapping(plans)


def as_order(name: str, value: object) -> tuple[tuple[Any, ...], ...] | None:
    """Return the order of play as tuples of teams.

    Raises:
        BadType, BadValue: it is not lists of different teams.
    """
    if value is None:
        return None
    groups = as_items(value, f"ctx.game.{name}", _ORDER_FORM)
    order = tuple(tuple(as_items(teams, f"Each item of ctx.game.{name}", "teams")) for teams in groups)
    teams = [as_key(team, "A team") for group in order for team in group]
    twice = next((team for team in teams if teams.count(team) > 1), None)
    if twice is not None or not all(order) or not order:
        flaw = "has an empty list" if twice is None else f"names team {shown(twice)} twice"
        raise BadValue(f"ctx.game.{name} {flaw}: it needs {_ORDER_FORM}.")
    return order


def _check_conflicts(name: str, value: object) -> Any:
    if value is not None and (isinstance(value, type) or not callable(getattr(value, "resolve", None))):
        is_resolver = callable(value) and not isinstance(value, type)
        way_out = f" Write gamms.rules.Conflicts(resolve={as_code(value)})." if is_resolver else ""
        raise BadType(
            f"ctx.game.{name} must have a method resolve(moves, ctx), as the object gamms.rules.Conflicts() has, not "
            f"{shown(value)}.{way_out}"
        )
    return value


def _check_seconds(name: str, value: object) -> float | None:
    return None if value is None else as_positive(value, f"ctx.game.{name}", hint="; None means no bound.")


def _check_duration(name: str, value: object) -> float:
    return as_positive(value, f"ctx.game.{name}")


def _check_action(_: str, value: object) -> Any:
    if isinstance(value, str) and value != "stay":
        raise BadValue(f'ctx.game.default_action must be "stay", an action or a function, not {shown(value)}.')
    return as_function_of(value, "A default action", "the state") if callable(value) else value


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(_CHOICES, _check_choice),
    "turn_seconds": _check_duration,
    "weight": lambda name, value: as_text(value, f"ctx.game.{name}"),
    "conflicts": _check_conflicts,
    "time_budget": _check_seconds,
    "deadline_s": _check_seconds,
    "clock": lambda _, value: as_clock(value),
    "default_action": _check_action,
    "plans": _check_plans,
    "team_memory": lambda name, value: as_bool(value, f"ctx.game.{name}"),
    "order": as_order,
    "deeds": lambda _, value: as_deeds(value),
    "channels": lambda _, value: as_channels(value),
    "max_turns": lambda name, value: None if value is None else as_count(value, f"ctx.game.{name}", 0),
}


def check_setting(name: str, value: object) -> Any:  # Any: of the type of the setting
    """Return the value of a setting in the form that a game keeps.

    Raises:
        BadValue, BadType: the value is invalid.
    """
    return _CHECKS[name](name, value)


PHASES = ("before", "deeds", "after")


class Rank(IntEnum):
    """The position of a rule in its phase; rules of equal rank are called in the order of adding."""

    USUAL = 0  # rules that move or tag agents, and deeds that last, which end after tags
    RESOURCES = 1
    PLACES = 2  # rules about the positions of agents
    RESPAWNS = 3
    PAYOFFS = 4  # points for events of the other rules
    END = 5
    LATE_DEEDS = 6  # interruptions of deeds by the rules before


@dataclass(frozen=True, kw_only=True)
class RuleSpec:
    """The declaration of a rule, in addition to its function of the context.

    `declared` attaches a spec to a rule. A user's rule may have the first seven fields as attributes of the function.

    Any: the turns and states of batches are classes of packages that import this module.

    Attributes:
        prepare: called with the context when the rule is added, to look at the map and to publish facts.
        check: called with the context after all have decided, to refuse moves and deeds.
        teams: the teams and roles that the rule mentions; see `RuleSet.check_new`.
        owners: teams or other owners that the rule mentions; a name that resembles that of a team is refused.
        starts_of: texts of teams whose starts the rule reads.
        may_create_agents: whether the rule calls a function of the user, which may create agents.
        drawer: draws the rule: `drawer(ctx, data)`. It reads only `ctx.game.data`, so that replays look the same. Or
            the name of a kind of artist that the visual engine has.
        disclose: called with `ctx.game.data`, which it must not change, and names of agents; returns the part that
            these know, for copies that look ahead. Without it, copies have the state after `prepare`.
        rank: a `Rank`; rules of higher rank are called later in the phase.
        key: the key of the rule's state in `ctx.game.data`; unique.
        reads_owners: the names of facts with owners of nodes, which may be roles, that the rule reads.
        act_as_one: makes one rule from the `parts` of all rules of a phase with the same function here; it is called in
            place of the first of them.
        parts: the parts for `act_as_one`.
        finds: what the rule looks for; of rules of one phase that look for the same, only the first by the text of its
            call has an effect, which is warned about. None: it is compared with none.
        brings_back: whether eliminated agents respawn, so that learners wait for it.
        uses_scores: whether the rule adds to scores or compares them, so that learners get rewards.
        last_turn: the turn after which the rule ends the game, for progress displays.
        array_form: applies the rule to many games: called with a `batch.turn.ArrayTurn`; None: batches play game by
            game.
        core_form: called with a `block.in_core.RuleBuilder`; returns the rule of the core. None: the core of batches
            does not have it.
        player: called with a context; returns a function without arguments that does there what the rule does, and that
            is kept from turn to turn. None: the rule itself is called.
        needs_ground: whether that form is for games in which no agent flies.
        prepare_arrays: called with the state of a batch at its start, to publish facts as arrays.
        facts_of: called with the state of a batch and the numbers of games; returns the fact under the key of the rule
            in each of these games. None: the fact does not change.
        begin_arrays: called with the context and the state of a batch; returns the arrays that the form of the core
            keeps about the game of the context, which may have begun: key -> name -> array of one game.
        show_arrays: called with the context, the state of a batch of its game alone, or its `GameRow`, the new events,
            and how many of the last turn are from later rules, None: unknown; writes what the form of the core keeps
            about the game into the context.
        is_array_function: whether the rule was made from its array form.
        follows_tags: whether the rule is called after the first rules of its rank that act as one, which are tags.
    """

    prepare: Callable[[Any], object] | None = None
    check: Callable[[Any], object] | None = None
    teams: Collection[Hashable] = ()
    owners: Collection[Hashable] = ()
    starts_of: Collection[str] = ()
    may_create_agents: bool = False
    drawer: Callable[..., object] | str | None = None
    disclose: Callable[[Mapping[str, Any], Collection[str]], Mapping[str, Any]] | None = None
    rank: int = Rank.USUAL
    key: str | None = None
    reads_owners: Collection[str] = ()
    act_as_one: Callable[[Sequence[Any]], Rule] | None = None
    parts: Sequence[Any] = ()
    finds: object = None
    brings_back: bool = False
    uses_scores: bool = False
    last_turn: int | None = None
    array_form: Callable[[Any], None] | None = None
    core_form: Callable[[Any], CoreRule] | None = None
    player: Callable[[Any], Callable[[], object]] | None = None
    needs_ground: bool = False
    prepare_arrays: Callable[[Any], object] | None = None
    facts_of: Callable[[Any, Any], Sequence[Any]] | None = None
    begin_arrays: Callable[[Any, Any], Mapping[Hashable, dict[str, Any]]] | None = None
    show_arrays: Callable[[Any, Any, list[dict[str, Any]], int | None], object] | None = None
    is_array_function: bool = False
    follows_tags: bool = False


_FEW_OWNERS = 20  # that are compared with teams
_SPEC = "_rule_spec"
_ATTRIBUTES = ("prepare", "check", "teams", "drawer", "disclose", "rank", "key")  # of users' rules
_OF_WRAPPED = ("brings_back", "uses_scores", "last_turn")
_NOTHING = RuleSpec(may_create_agents=True)  # of users' rules


def declared(rule: R, spec: RuleSpec) -> R:
    """Attach a declaration to a rule, and return the rule."""
    rule.__dict__[_SPEC] = spec
    return rule


def get_rule_spec(rule: object) -> RuleSpec:
    """Return the declaration of a rule, including attributes set by a user.

    A function that wraps a rule by `functools.wraps` is prepared and drawn like that rule, but may behave differently:
    it is called itself, and never joined with other rules.
    """
    spec: RuleSpec = getattr(rule, _SPEC, _NOTHING)
    if spec is getattr(getattr(rule, "__wrapped__", None), _SPEC, None):
        wrapped = {name: getattr(spec, name) for name in (*_ATTRIBUTES, *_OF_WRAPPED)}
        spec = RuleSpec(**wrapped, may_create_agents=True)
    own = {name: value for name in _ATTRIBUTES if (value := getattr(rule, name, None)) is not None}
    return replace(spec, **own) if own else spec


class NamedRule(NamedTuple):
    """A rule that was added to a game."""

    name: str
    rule: Rule
    phase: str  # one of PHASES

    @property
    def spec(self) -> RuleSpec:
        """The declaration of the rule; the core only has forms of rules of the phase "after"."""
        spec = get_rule_spec(self.rule)
        if self.phase == "after" or spec.core_form is None:
            return spec
        return replace(spec, core_form=None, prepare_arrays=None, begin_arrays=None, show_arrays=None)

    def __repr__(self) -> str:
        """Return the name, the rule as source code, and the phase."""
        return f"NamedRule({self.name!r}, {as_code(self.rule)}, phase={self.phase!r})"


def as_called(rules: Iterable[NamedRule]) -> list[NamedRule]:
    """Return rules as they are called: those of one phase with the same `act_as_one` are joined into one rule."""
    return [named for _, named in group_rules(rules)]


def group_rules(rules: Iterable[NamedRule]) -> list[tuple[list[NamedRule], NamedRule]]:
    """Return (rules, joined rule) for each group of rules that are called as one, in the order of their first rules."""
    groups: dict[Hashable, list[NamedRule]] = {}
    for one in rules:
        join = one.spec.act_as_one
        groups.setdefault(one.name if join is None else (one.phase, join), []).append(one)
    return [(group, join_rules(group)) for group in groups.values()]


def join_rules(group: Sequence[NamedRule]) -> NamedRule:
    """Return the rule that does the work of a group of rules that act as one."""
    if len(group) == 1:
        return group[0]
    join: Any = group[0].spec.act_as_one  # the same of all
    parts = [part for one in sorted(group, key=lambda one: as_code(one.rule)) for part in one.spec.parts]
    return NamedRule(" and ".join([one.name for one in group]), join(parts), group[0].phase)


class RuleTable:
    """An immutable table of the rules of a game; snapshots share it.

    Args:
        rules: the rules, by rank, then in the order of adding.

    Attributes:
        rules: the rules.
        of_phase: phase -> (rules, joined rule) for each group of rules that are called as one.
        phases: the phases in which a rule is called.
        prepared: what was called to prepare each rule, if anything.
        drawings: name of an artist -> (its drawing function, its layer).
    """

    def __init__(self, rules: tuple[NamedRule, ...]) -> None:
        self.rules = rules
        self.of_phase = {phase: group_rules([one for one in rules if one.phase == phase]) for phase in PHASES}
        specs = [(one, one.spec) for one in rules]
        self._checks = [(one, spec.check) for one, spec in specs if spec.check is not None]
        self._own = frozenset(one.name for one in rules if getattr(one.rule, _SPEC, None) is None)
        self._attributes = [_list_declared_attributes(one.rule) for one in rules]
        self.prepared = [spec.prepare for _, spec in specs]
        self.phases = frozenset(one.phase for one in rules)
        self.drawings: dict[str, tuple[Any, int]] = {}
        for one, spec in specs:
            if isinstance(spec.drawer, str):
                self.drawings[spec.drawer] = spec.drawer, 0
            elif spec.drawer is not None:
                artist = str(getattr(spec.drawer, "artist", f"rule_{one.name}"))
                self.drawings.setdefault(artist, (spec.drawer, getattr(spec.drawer, "layer", 12)))

    @property
    def checks(self) -> list[tuple[NamedRule, Callable[[Any], object]]]:
        """The rules that check moves and deeds, each with its function as it is set now."""
        if not self._own:  # NOTE: nothing is looked for in games of shipped rules (benchmarks: turns)
            return self._checks
        declared = {one.name: check for one, check in self._checks if one.name not in self._own}
        found = [(one, declared.get(one.name) or getattr(one.rule, "check", None)) for one in self.rules]
        return [(one, check) for one, check in found if check is not None]

    @property
    def may_act_before_moves(self) -> bool:
        """Whether a rule checks moves and deeds, or executes deeds, or may do so later."""
        return "deeds" in self.phases or bool(self._own or self._checks)

    @property
    def act_before_moves(self) -> bool:
        """Whether a rule checks moves and deeds, or executes deeds."""
        return "deeds" in self.phases or bool(self.checks)

    def list_changed(self) -> list[NamedRule]:
        """Return the rules whose attributes have changed since this table was made."""
        return [
            one
            for one, known in zip(self.rules, self._attributes, strict=True)
            if _list_declared_attributes(one.rule) != known
        ]


_NO_RULES = RuleTable(())
_NO_DRAWINGS: Mapping[str, tuple[Any, int]] = {}


def _list_declared_attributes(rule: object) -> list[Any]:
    """Return the attributes of a user's rule that declare it."""
    return [getattr(rule, name, None) for name in _ATTRIBUTES]


class _RulePlayer(NamedTuple):
    """Plays rules that are called as one.

    Attributes:
        group: the rules.
        named: the joined rule.
        play: plays it.
    """

    group: Sequence[NamedRule]
    named: NamedRule
    play: Callable[[], object]


def _sort_rules(rules: Sequence[NamedRule]) -> tuple[NamedRule, ...]:
    """Return rules by rank, then in their order; a rule that follows tags comes after them, or else first."""
    specs = {one.name: one.spec for one in rules}
    tags = next((place for place, one in enumerate(rules) if specs[one.name].act_as_one is not None), -1)

    def place_of(numbered: tuple[int, NamedRule]) -> tuple[int, float]:
        place, one = numbered
        spec = specs[one.name]
        return spec.rank, tags + 0.5 if spec.follows_tags else place

    return tuple(one for _, one in sorted(enumerate(rules), key=place_of))


class RuleSet:
    """The rules of one game, and changes to them.

    Attributes:
        now: the current rules; a new table after each change.
        unchecked: rules whose teams have not been checked since they were added; see `check_new`.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self.unchecked: list[NamedRule] = []
        self.now = _NO_RULES
        self._players: dict[str, list[_RulePlayer]] = {}  # by phase

    @property
    def rules(self) -> tuple[NamedRule, ...]:
        """The rules; a new tuple after each change."""
        return self.now.rules

    def replace(self, rules: RuleTable) -> None:
        """Replace all rules, without changing artists."""
        self._set(rules)

    def _set(self, rules: RuleTable) -> None:
        self.now = rules
        self._players.clear()
        get_phase(self._ctx).drop_plans()

    def add(self, rule: Rule, phase: str, name: str | None) -> None:
        """Add a rule; see `Game.add`."""
        if callable(getattr(rule, "resolve", None)) and (isinstance(rule, type) or not callable(rule)):
            raise BadType(f"{shown(rule)} resolves conflicts of moves and is not a rule: set it as ctx.game.conflicts.")
        if iscoroutinefunction(as_function_of(rule, "A rule", "the context")):
            raise BadType(f"A rule must not be an async def, and {_find_name(rule)} is one: it is not awaited.")
        taken = {one.name for one in self.rules}
        if name is not None and as_name(name, "a rule") in taken:
            raise Duplicate("a rule", name)
        spec = get_rule_spec(rule)
        if spec.key is not None and any(one.spec.key == spec.key for one in self.rules):
            raise Duplicate("a rule with a key", spec.key)
        named = NamedRule(_find_free_name(_find_name(rule), taken) if name is None else name, rule, phase)
        if spec.prepare is not None:
            spec.prepare(self._ctx)
        self.put(RuleTable(_sort_rules((*self.rules, named))))
        self.unchecked.append(named)

    def renew(self) -> None:
        """Take attributes into account that were set after their rules were added; call it when a game begins.

        Raises:
            Duplicate: two rules have the same key.
        """
        changed = self.now.list_changed()
        if not changed:
            return
        keys = [key for one in self.rules if (key := one.spec.key) is not None]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise Duplicate("a rule with a key", twice)
        before = {one.name: prepare for one, prepare in zip(self.rules, self.now.prepared, strict=True)}
        for one in changed:
            prepare = one.spec.prepare
            if prepare is not None and prepare != before[one.name]:
                prepare(self._ctx)
        self.put(RuleTable(_sort_rules(self.rules)))
        self.unchecked += [one for one in changed if one not in self.unchecked]

    def remove(self, wanted: str | Rule | NamedRule) -> None:
        """Remove a rule; see `Game.remove`."""
        for named in self.rules:
            if wanted in (named, named.name, named.rule):
                self.put(RuleTable(tuple(one for one in self.rules if one is not named)))
                return
        name = wanted if isinstance(wanted, str) else _find_name(wanted)
        raise UnknownName("rule", name, [named.name for named in self.rules])

    def put(self, rules: RuleTable) -> None:
        """Replace all rules, and update their artists."""
        before = self.now.drawings
        self._set(rules)
        if before != rules.drawings:
            visual = self._ctx.visual
            artists: Any = getattr(visual, "artists", None)  # a caller's engine may have none
            withdraw = visual.remove_artist if artists is None else artists.withdraw
            for artist in sorted(before.keys() - rules.drawings.keys()):
                withdraw(artist)
            self.propose_artists(before)

    def propose_artists(self, known: Mapping[str, tuple[Any, int]] = _NO_DRAWINGS) -> None:
        """Add the artists of the rules to the visual engine.

        Args:
            known: name of an artist -> its drawing function and its layer, for those that it has already.
        """
        visual = self._ctx.visual
        artists: Any = getattr(visual, "artists", None)  # a caller's engine may have none
        propose = visual.add_artist if artists is None else artists.propose
        for artist, drawing in self.now.drawings.items():
            if known.get(artist) != drawing and not (artists is None and isinstance(drawing[0], str)):
                propose(artist, {"drawer": drawing[0], "layer": drawing[1]})

    def apply(self, phase: str, state: GameState) -> bool:
        """Call the rules of a phase, including rules that are added meanwhile, without rules that are removed.

        If a rule of the phase "before" ends the game, the rest is skipped. Return whether a rule was called.

        Args:
            phase: the phase.
            state: the state of the game.
        """
        known = self.now
        seen = known.rules
        called = self._list_players(phase)
        was_called = False
        while True:
            for player in called:
                now = player if self.now is known else self._make_player_of_rest(player)
                if now is None:
                    continue
                try:
                    now.play()
                except Exception as error:
                    _add_place(error, now.named, phase, state, self._ctx)
                    raise
                was_called = True
                if phase == "before" and state.over is not None:
                    return True
            if self.now is known:
                return was_called
            known = self.now
            added = [one for one in known.rules if one not in seen]
            if not added:
                return was_called
            seen = (*seen, *added)
            called = [self._make_player(*one) for one in group_rules([one for one in added if one.phase == phase])]

    def _list_players(self, phase: str) -> "list[_RulePlayer]":
        """Return what plays the rules of a phase."""
        called = self._players.get(phase)
        if called is None:
            called = [self._make_player(*one) for one in self.now.of_phase[phase]]
            self._players[phase] = called
        return called

    def _make_player(self, group: Sequence[NamedRule], named: NamedRule) -> "_RulePlayer":
        """Return what plays rules that are called as one."""
        player = get_rule_spec(named.rule).player
        play = partial(named.rule, self._ctx) if player is None else player(self._ctx)
        return _RulePlayer(group, named, play)

    def _make_player_of_rest(self, player: "_RulePlayer") -> "_RulePlayer | None":
        """Return what plays those of the rules that were not removed; None: all were."""
        left = [one for one in player.group if one in self.rules]
        if len(left) == len(player.group):
            return player
        return self._make_player(left, join_rules(left)) if left else None

    def check(self, state: GameState) -> bool:
        """Call the `check` of each rule, to refuse moves and deeds; return whether there are any."""
        for named, check in self.now.checks:
            try:
                check(self._ctx)
            except Exception as error:
                _add_place(error, named, "check", state, self._ctx)
                raise
        return bool(self.now.checks)

    def check_new(self) -> None:
        """Refuse new rules that mention a team that never had agents and was not declared by `create_team`.

        So are rules that mention a role with names or attributes that no agent of its team has. If a rule of the user
        may create its agents, a warning is logged instead, unless the name resembles that of another team. New rules
        without an effect are warned about, too.

        Raises:
            UnknownName (KeyError): a rule mentions such a team or role.
        """
        block = self._ctx.agent.block  # without making agents of large teams
        teams = sorted({*block.teams, *block.team_rows} - {None}, key=str)
        may_come = any(one.spec.may_create_agents for one in self.rules)
        for named in [one for one in self.unchecked if one in self.rules]:
            for team in _find_unknown_teams(named.spec, teams):
                if not may_come or nearest(team, teams):
                    raise UnknownName("team", team, teams, _explain_missing_agents(team, named.name))
                self._ctx.logger.warning(f"{named.name}: {UnknownName('team', team, teams)} No agent plays for it.")
            self._check_roles(named, may_come=may_come)
            self._warn_of_idle(named)
        self.unchecked.clear()

    def _check_roles(self, named: NamedRule, *, may_come: bool) -> None:
        """Refuse a rule with a role that no agent has; see `check_new`."""
        for role in [one for one in named.spec.teams if isinstance(one, Role)]:
            members = self._ctx.agent.teams.get(role.team, [])
            flaw = role.find_flaw(members) if members or role.team is None else None
            if flaw is not None and not may_come:
                flaw.add_note(f"The rule {named.name!r} mentions it.")
                raise flaw
            if flaw is not None:
                self._ctx.logger.warning(f"{named.name}: {flaw} No agent has this role.")

    def _warn_of_idle(self, named: NamedRule) -> None:
        """Log a warning if a rule looks for the same as an earlier rule, so that one of them has no effect."""
        wanted = named.spec.finds
        for other in self.rules[: self.rules.index(named)] if wanted is not None else ():
            if other.phase == named.phase and other.spec.finds == wanted:
                first = min((other, named), key=lambda one: as_code(one.rule))
                self._ctx.logger.warning(
                    f"The rules {other.name!r} and {named.name!r} look for the same agents at the same distances: only "
                    f"{first.name!r} has an effect, the first by the text of its call, {as_code(first.rule)}."
                )


def _find_unknown_teams(spec: RuleSpec, teams: Sequence[Hashable]) -> Iterator[Hashable]:
    """Yield the teams that a rule mentions and that are not among the teams of a game."""
    named = dict.fromkeys(map(get_team, spec.teams))
    yield from (team for team in named if team not in teams and team is not None)
    yield from (text for text in spec.starts_of if text not in map(str, teams))
    others = [team for team in teams if team not in spec.owners]
    unknown = (owner for owner in spec.owners if owner not in teams and owner is not None)
    yield from (owner for owner in islice(unknown, _FEW_OWNERS) if nearest(owner, others))


def _explain_missing_agents(team: Hashable, rule: str) -> str:
    """Return the hint for a rule that mentions a team without agents."""
    way_out = (
        f"declare it by ctx.agent.create_team({shown(team)}, [])"
        if isinstance(team, str)
        else "create one of them before the game begins"
    )
    return f" The rule {rule!r} mentions it, and no agent plays for it: if its agents come later, {way_out}."


def _add_place(error: Exception, named: NamedRule, phase: str, state: GameState, ctx: HostContext) -> None:
    error.add_note(
        f"In the rule {named.name!r} (phase {phase!r}), in turn {state.turn}.{explain_rule_error(error, ctx)}"
    )


def _find_name(rule: object) -> str:
    while not hasattr(rule, "__name__") and hasattr(rule, "func"):  # functools.partial
        rule = rule.func
    return str(getattr(rule, "__name__", type(rule).__name__))


def _find_free_name(name: str, taken: set[str]) -> str:
    """Return the name, with the first number that makes it unique."""
    number = 1
    free = name
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    return free
