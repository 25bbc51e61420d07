"""The phase of a turn in which strategies decide: the game cannot be changed, and all values are read-only.

A `DecidePhase` belongs to a context and is shared by its engines. The turn engine sets its `agent` while a strategy or
a plan runs. A verb that changes something is marked with `@refused_while_deciding`, a class whose attributes may not be
set is `Guarded`, and an attribute that holds what can change is `Protected`.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from copy import deepcopy
from functools import wraps
from operator import attrgetter
from threading import RLock, get_ident
from types import UnionType
from typing import Any, ClassVar, Generic, NamedTuple, Self, SupportsIndex, TypeVar, cast, overload

from gamms.arguments import as_int, refuse_call
from gamms.errors import BadType, BadValue, IllegalMutation
from gamms.readonly import NotPickled, ShallowCopyMixin, Shareable, freeze, set_attributes
from gamms.text import shown

T = TypeVar("T")
PartOfContext = TypeVar("PartOfContext", bound="ContextPart")
Method = TypeVar("Method", bound=Callable[..., Any])


class Deciders(NamedTuple):
    """A decider other than a strategy of one agent: a plan, awaited strategies, or a function that may make one."""

    described: str  # at the beginning of a sentence, such as "The plan of team 'red'"
    names: tuple[str, ...]  # the names of the agents
    is_maker: bool = False  # whether it is called to find out whether it returns a strategy


AWAITED = Deciders("A strategy that is awaited", ())
UNREAD = Deciders("The reader of the last turn", ())
"""In place of agents that decide: no strategy is running, and the end of the last turn is made when it is read."""
_of_task: ContextVar[tuple[Any, Any]] = ContextVar("gamms_decider", default=(None, AWAITED))


class UnknownLook(dict[str, Any]):
    """Stands for the last state of an agent, or the last data of a sensor, that the batch of a game has not kept.

    Args:
        note: called with the error that is raised when it is read; None: nothing is called.
    """

    __slots__ = ("note",)

    def __init__(self, note: Callable[[BadValue], object] | None = None) -> None:
        super().__init__()
        self.note = note

    def copy(self) -> "UnknownLook":
        """Return itself: it has no values."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> "UnknownLook":
        return UNKNOWN_LOOK


UNKNOWN_LOOK = UnknownLook()


def refuse_unknown_look(look: object, of: str) -> None:
    """Refuse to read the last state of an agent, or the last data of a sensor, that the batch has not kept.

    Args:
        look: the state or the data.
        of: the agent or the sensor, in words.

    Raises:
        BadValue: it was not kept.
    """
    if type(look) is UnknownLook:
        error = BadValue(
            f"The batch of this game has not kept what {of} has sensed before this turn. It keeps it if the code of a "
            "plain function reads agent.state, or sensor.data of agent.sensors, by these names; in games.context(i), "
            "it is known after the next turn. games.record(…) writes a recording that has it for all turns."
        )
        if look.note is not None:
            look.note(error)
        raise error


class DecidePhase(NotPickled):
    """The state of the decision phase of a context: the agents that decide now.

    Every part of a context holds its phase, so no part is pickled.

    Attributes:
        agent: the agent whose strategy is running, or `Deciders`; AWAITED: asyncio tasks decide, each for the agents
            set by `decide_in_this_task`; None, UNREAD: no strategy is running. Any: the class depends on the agent
            engine.
        read_turn: if `agent` is UNREAD, makes the states of agents, and the data of their sensors, of the last turn.
        are_moves_unread: whether it makes the moves of that turn, too.
        are_memories_known: whether the program has read memories of agents, which it may hold.
        moment: a unique object while the world cannot change, because agents with built-in sensors decide; None: the
            world may change.
        epoch: a number that rises whenever the plan of a turn may change: the agents and their teams, speeds,
            strategies and sensors, but not which of them live; settings, rules, plans and collectors; sensor settings.
            See `core.turn.TurnPlan`.
        setting_changes: the number of changes of game settings.
        sensor_changes: the number of changes of sensor settings, and of added and removed sensors.
        owner_changes: the number of changes of sensor owners.
        strategy_changes: the number of changes of agents' strategies.
        known_names: attributes of agents that were checked for misspellings already.
        agent_kinds: class of agents -> its subclass with the attributes of this context.
        created: called with the names and start places of agents that were created; None: there is no game yet.
        judge: the function that only looks or judges now, at the beginning of a sentence, such as "A sensor": it may
            not change the game; "": there is none.
        player: the identifier of the thread that plays a turn; None: no turn is played.
    """

    __slots__ = (
        *("_is_reading", "_reading", "agent", "agent_kinds", "are_memories_known", "are_moves_unread"),
        *("created", "epoch", "judge", "known_names", "moment", "owner_changes", "player"),
        *("read_turn", "sensor_changes", "setting_changes", "strategy_changes"),
    )
    _not_pickled = (
        "A context cannot be pickled, and neither can what belongs to it; copy.deepcopy copies it. To continue a game "
        "in another process, build its scenario there, or record it and use Recording.resume."
    )

    def __init__(self) -> None:
        self.agent: Any = None
        self.read_turn: Callable[[], None] | None = None
        self.are_moves_unread = False
        self.are_memories_known = False
        self._reading = RLock()
        self._is_reading = False
        self.moment: object = None
        self.known_names = set[str]()
        self.agent_kinds: dict[type, type] = {}
        self.created: Callable[[Iterable[tuple[str, Any]]], None] | None = None
        self.player: int | None = None
        self.judge = ""
        self.epoch = 0
        self.setting_changes = 0
        self.sensor_changes = 0
        self.owner_changes = 0
        self.strategy_changes = 0

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Refuse to be pickled, unless it is that of objects without a context."""
        return "UNDECIDED" if self is UNDECIDED else super().__reduce_ex__(protocol)

    def __deepcopy__(self, memo: dict[int, Any]) -> "DecidePhase":
        """Return a new phase in which no agent decides, for copies of parts of a context."""
        return DecidePhase()

    def decide_in_this_task(self, agent: object) -> None:
        """Set the agent or `Deciders` for which this asyncio task, and tasks started by it, decide."""
        _of_task.set((self, agent))

    def drop_plans(self) -> None:
        """Let the plans of turns be made again, because what they depend on may have changed."""
        self.epoch += 1

    def change_settings(self) -> None:
        """Count a change of game settings."""
        self.setting_changes += 1
        self.drop_plans()

    def change_sensors(self) -> None:
        """Count a change of sensor settings, or an added or removed sensor."""
        self.sensor_changes += 1
        self.drop_plans()

    def change_strategies(self) -> None:
        """Count a change of the strategies of agents."""
        self.strategy_changes += 1
        self.drop_plans()

    @property
    def is_deciding(self) -> bool:
        """Whether a strategy or a plan is running."""
        return self.agent is not None and self.agent is not UNREAD

    def leave_unread(self, read_turn: Callable[[], None] | None, *, with_moves: bool = False) -> None:
        """Make the end of the last turn when it is read first, or before anything changes; None: it is forgotten.

        Args:
            read_turn: makes it.
            with_moves: whether the moves of the turn are made, too, so that other engines may not even look before.
        """
        self.read_turn = read_turn
        self.are_moves_unread = with_moves
        if read_turn is not None:
            self.agent = UNREAD
        elif self.agent is UNREAD:
            self.agent = None

    def read_last_turn(self) -> None:
        """Make the end of the last turn, unless it is made."""
        if self.read_turn is not None:
            with self._reading:  # other threads that read wait until it is made
                self._read()

    def _read(self) -> None:
        read_turn = self.read_turn
        if read_turn is None or self._is_reading:
            return
        self._is_reading = True
        self.agent = None
        try:
            read_turn()
        finally:
            self._is_reading = False
            self.leave_unread(None)

    def list_names(self) -> tuple[str, ...]:
        """Return the names of the agents that decide here."""
        deciders = self._find_deciders()
        return deciders.names if isinstance(deciders, Deciders) else (deciders.name,)

    def _find_deciders(self) -> Any:
        if self.agent is not AWAITED:
            return self.agent
        phase, deciders = _of_task.get()
        return deciders if phase is self else AWAITED

    def refuse(self, action: str, *, changes_game: bool = False) -> None:
        """Raise IllegalMutation if a strategy is running, BadValue if another thread plays a turn.

        Otherwise, make the end of the last turn if it is not made, before the action changes its data.

        Args:
            action: the action, in words.
            changes_game: whether it changes the game, so that it is also refused to `judge`.
        """
        self.refuse_other_threads(action)
        if self.agent is UNREAD:
            self.read_last_turn()
        if self.agent is not None:
            deciders = self._find_deciders()
            who = deciders.described if isinstance(deciders, Deciders) else f"The strategy of agent {deciders.name!r}"
            raise IllegalMutation(
                f"{who} may not {action}: while agents decide, nothing changes. "
                "It may set state['action'], and write into state['memory'] and state['team_memory']. Changes of "
                "anything else belong in a rule: ctx.game.add(rule)."
            )
        if changes_game and self.judge:
            raise IllegalMutation(
                f"{self.judge} may not {action}: agents have not all decided and moved yet, and only rules change the "
                "game then. It may write scores, events, ctx.game.data and own attributes of agents. Changes of "
                "anything else belong in a rule: ctx.game.add(rule)."
            )

    def refuse_look(self, action: str) -> None:
        """Do as `refuse` for an action of other engines on which the states of the last turn do not depend."""
        if self.is_deciding or self.are_moves_unread:
            self.refuse(action)
        self.refuse_other_threads(action)

    def read_moves(self) -> None:
        """Make the moves of the last turn, unless they are made."""
        if self.are_moves_unread:
            self.read_last_turn()

    def refuse_other_threads(self, action: str) -> None:
        """Raise BadValue if another thread plays a turn."""
        if self.player is not None and self.player != get_ident() and self.agent is not AWAITED:
            raise BadValue(
                f"Another thread plays a turn of this game right now: it is too early to {action}. Use a context in "
                "one thread at a time, or make one for each thread."
            )

    def protect_value(self, value: T) -> T:
        """The value; while a strategy is running, a read-only copy of it."""
        return cast("T", freeze(value)) if self.is_deciding else value

    @contextmanager
    def suspend(self, *, changes_world: bool = True) -> Iterator[None]:
        """Lift the restrictions while a strategy runs: for code of the program such as drawers, or read-only code.

        Args:
            changes_world: whether agents that decide may see another world, or states of the last turn depend on the
                changes. Otherwise the end of the last turn stays unread.
        """
        self.read_moves()
        if changes_world and not (self.is_deciding or self.judge):
            yield
            return
        agent = self.agent
        judge = self.judge
        self.agent = None
        self.judge = ""
        if changes_world:
            self.moment = None
        try:
            yield
        finally:
            self.agent = None if agent is UNREAD and self.read_turn is None else agent
            self.judge = judge


UNDECIDED = DecidePhase()  # the phase of objects without a context, in which no agent ever decides


def get_phase(ctx: object) -> DecidePhase:
    """Return the phase of a context; for foreign context classes, a phase in which no agent ever decides."""
    phase = getattr(ctx, "_phase", None)
    return phase if isinstance(phase, DecidePhase) else UNDECIDED


class Guarded(Shareable):
    """Mix-in: while a strategy is running, public attributes can be neither set nor deleted."""

    __slots__ = ()

    _phase: DecidePhase  # NOTE: without a default, which would make every look at it slow (benchmarks: turns)
    _called: ClassVar[str] = "it"  # what programs call such an object

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; refused while a strategy is running."""
        if name[0] != "_":
            phase = getattr(self, "_phase", UNDECIDED)  # a subclass may set attributes before it begins
            if phase.agent is not None or phase.player is not None:
                phase.refuse(f"set {self._called}.{name}")
        object.__setattr__(self, name, value)

    def __setstate__(self, state: object) -> None:
        """Become a copy, without checking the attributes again."""
        set_attributes(self, state)

    def __delattr__(self, name: str) -> None:
        """Delete an attribute; refused while a strategy is running."""
        if name[0] != "_":
            self._phase.refuse(f"delete {self._called}.{name}")
        object.__delattr__(self, name)


class ContextPart(Guarded, ShallowCopyMixin):
    """Mix-in: a part of a context, which is copied only together with the context."""

    __slots__ = ()
    _not_pickled = DecidePhase._not_pickled

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Stay itself in a copy of something else, such as `ctx.game.data`; `memo` has the copies, by `id()`."""
        return self


def add_copies(memo: dict[int, Any], copies: dict[int, Any]) -> None:
    """Add the copies of one `copy.deepcopy` to the memo of another.

    Args:
        memo: the memo that gets them.
        copies: the other memo. Its list of the objects that must live as long as their ids are known is under its own
            id, which a later object may have.
    """
    kept = copies.pop(id(copies), [])
    memo.update(copies)
    memo.setdefault(id(memo), []).extend(kept)


def copy_part(part: PartOfContext, memo: dict[int, Any], attributes: object = None) -> PartOfContext:
    """Return a copy of a part for a copy of its context.

    Args:
        part: the part.
        memo: the memo of `copy.deepcopy`, to which the copy is added.
        attributes: earlier attributes of the part, as from `object.__getstate__`; None: the present ones.
    """
    kind = type(part)
    twin = kind.__new__(kind)
    memo[id(part)] = twin
    twin.__setstate__(deepcopy(part.__getstate__() if attributes is None else attributes, memo))
    return twin


def refuse_while_deciding(method: Method) -> Method:
    """Refuse a verb while a strategy is running, before it does anything."""
    return _guard_method(method, makes_last_turn=True)


def refuse_to_judges(method: Method) -> Method:
    """Refuse a verb that changes the game while a strategy is running, and to functions that only look or judge."""
    return _guard_method(method, makes_last_turn=True, changes_game=True)


def leave_last_turn(method: Method) -> Method:
    """Refuse a verb while a strategy is running; the end of the last turn is not made for it.

    The verb replaces it, or does not affect it.
    """
    return _guard_method(method, makes_last_turn=False)


def _guard_method(method: Method, *, makes_last_turn: bool, changes_game: bool = False) -> Method:
    @wraps(method)
    def guarded(self: Guarded, /, *args: object, **kwargs: object) -> Any:
        phase = self._phase
        if phase.agent is not None or phase.player is not None:
            action = f"call {self._called}.{method.__name__}"
            if makes_last_turn or phase.is_deciding:
                phase.refuse(action, changes_game=changes_game)
            else:
                phase.refuse_other_threads(action)
        try:
            return method(self, *args, **kwargs)
        except TypeError as error:
            refuse_call(error, method, f"{self._called}.{method.__name__}", (self, *args), kwargs)
            raise

    return cast("Method", guarded)


def lift_decide_phase(method: Method) -> Method:
    """Decorate a read-only method that calls code of the program, such as drawers, to lift the restrictions."""

    @wraps(method)
    def suspending(self: Guarded, /, *args: object, **kwargs: object) -> Any:
        try:
            if self._phase.agent is None:
                return method(self, *args, **kwargs)
            with self._phase.suspend():
                return method(self, *args, **kwargs)
        except TypeError as error:
            refuse_call(error, method, f"{self._called}.{method.__name__}", (self, *args), kwargs)
            raise

    return cast("Method", suspending)


class Protected(Generic[T]):
    """An attribute of a `Guarded` object; strategies see a read-only copy of its value.

    Args:
        kind: the required type of the value, such as `dict | None`.
        part: the attribute of the object on which the value is stored under the same name; None: the object itself.
    """

    def __init__(self, kind: type | UnionType, part: str | None = None) -> None:
        self._kind = kind
        self._part = part

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"_{name}" if self._part is None else name
        self._read = attrgetter(self._name if self._part is None else f"{self._part}.{self._name}")

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Guarded, owner: type) -> T: ...
    def __get__(self, instance: Guarded | None, owner: type) -> Any:
        if instance is None:
            return self
        value = self._read(instance)
        phase = instance._phase
        # NOTE: the first test saves a call in each read of `ctx.game.data` by a rule, a fifth of its time.
        return value if phase.agent is None or not phase.is_deciding else freeze(value)

    def __set__(self, instance: Guarded, value: T) -> None:
        if not isinstance(value, self._kind):
            kind = getattr(self._kind, "__name__", self._kind)
            raise BadType(f"{self._name.lstrip('_')} must be a {kind}, not {shown(value)} ({type(value).__name__}).")
        if self._kind is int:
            as_int(value, self._name.lstrip("_"))
        object.__setattr__(instance if self._part is None else getattr(instance, self._part), self._name, value)
