"""People as players: the strategy that asks a person, and the exchange of questions and choices with the server.

The game asks in its own thread; the server delivers answers in another. `Human` is the strategy, one for each person.
`People` is a rule of the game that stores the questions of the current turn, accepts at most one choice for each, and
emits the choices as events.
"""

import asyncio
import json
import os
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from threading import Lock
from typing import Any

from gamms.arguments import as_function_of, as_name, as_positive
from gamms.context import Context
from gamms.errors import BadType, BadValue, Duplicate
from gamms.game.snapshots import get_counterpart
from gamms.plain import Plain, as_json
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing.game import AerialState, State
from gamms.web.choices import (
    CHOSEN,
    EVENT,
    Choice,
    Question,
    RefusedChoice,
    as_action,
    list_channels,
    list_deeds,
    list_edges,
    list_inbox,
    list_messages,
    list_moves,
    make_action,
    read_choices,
    select_recorded,
)
from gamms.web.links import PartOfServer

_MARGIN_S = 0.2  # questions end before the deadline of the turn, so that the person's default strategy can decide


@dataclass
class Person:
    """A person who plays in a game.

    Attributes:
        name: the name of the person; by default the name of the team or the agent.
        agents: the names of the person's agents.
        is_here: whether the person has opened the link at least once.
    """

    name: str
    agents: tuple[str, ...]
    is_here: bool = False


class People(PartOfServer):
    """The questions to the people of a game, and their choices; a rule that emits each choice as an event.

    Its methods are thread-safe. `People.get_people(ctx)` returns the instance of a game after a server has opened it.
    """

    __name__ = "people"

    def __init__(self) -> None:
        self._lock = Lock()
        self._ctx: Context | None = None
        self._persons: dict[str, Person] = {}
        self._questions: dict[int, tuple[str, Question]] = {}  # of the current turn: number -> person, question
        self._last = 0
        self._pending: list[tuple[float, Choice]] = []  # time within the turn, choice
        self._is_let_go = False
        self.changed: list[
            Callable[[], object]
        ] = []  # called in any thread when a question is added, answered or removed

    def __repr__(self) -> str:
        return self.__name__

    def __deepcopy__(self, memo: dict[int, Any]) -> "People":
        """Return an empty rule, because copies of the game ask no people."""
        return People()

    @classmethod
    def get_people(cls, ctx: Context) -> "People | None":
        """Return the people of a game; None if no server has opened it."""
        return next((named.rule for named in ctx.game.rules if isinstance(named.rule, cls)), None)

    @classmethod
    def open(cls, ctx: Context) -> "People":
        """Open a game to people, and return them."""
        people = cls.get_people(ctx)
        if people is None:
            people = cls()
            ctx.game.add(people)
        people._ctx = ctx
        people.look_up()
        return people

    @property
    def is_open(self) -> bool:
        """Return whether a server has opened the game."""
        return self._ctx is not None

    @property
    def persons(self) -> dict[str, Person]:
        """Name -> person."""
        with self._lock:
            return dict(self._persons)

    def look_up(self) -> None:
        """Find the people and their agents by the strategies of agents; call it again when strategies change.

        Raises:
            Duplicate: two people have the same name.
        """
        if self._ctx is None:
            return
        found: dict[str, Person] = {}
        for human, agents in _list_humans(self._ctx):
            name = human.name or _find_name(agents, self._ctx)
            if name in found:
                raise Duplicate("a person", name)
            known = self._persons.get(name)
            found[name] = Person(name, agents, is_here=known is not None and known.is_here)
        with self._lock:
            self._persons = found

    def find_person(self, agent: str) -> Person:
        """Return the person who plays an agent.

        Raises:
            BadValue: no person plays it.
        """
        for person in self.persons.values():
            if agent in person.agents:
                return person
        raise BadValue(f"Agent {shown(agent)} is not played by a person.")

    # -- for the server -------------------------------------------------------------------------------------------

    def mark_present(self, person: str) -> None:
        """Mark a person as present; the time for the first choice starts now."""
        with self._lock:
            known = self._persons.get(person)
            if known is None or known.is_here:
                return
            known.is_here = True
            mine = [question for name, question in self._questions.values() if name == person]
            for question in mine:
                now = question.clock.now()
                question.until = now + question.limit_s
                question.began = now
        for question in mine:
            question.wake()
        self._notify()

    def list_questions(self, person: str) -> list[dict[str, Plain]]:
        """Return the questions to a person in the current turn, including answered ones, as messages."""
        with self._lock:
            return [question.as_message() for name, question in self._questions.values() if name == person]

    def let_go(self) -> None:
        """Stop waiting for people: from now on, the default strategies decide."""
        with self._lock:
            self._is_let_go = True
            open_ones = [question for _, question in self._questions.values()]
            for question in open_ones:
                question.until = -inf
        for question in open_ones:
            question.wake()

    @property
    def is_waiting(self) -> bool:
        """Return whether a question is unanswered."""
        with self._lock:
            return any(question.chosen is None for _, question in self._questions.values())

    def choose(self, person: str, choice: Mapping[str, Plain]) -> None:
        """Accept the choice of a person, a dict: see `choices.make_action`.

        Raises:
            RefusedChoice: the choice is late, foreign, illegal or a duplicate; nothing has changed.
        """
        with self._lock:
            question = self._open_question(person, choice)
            action = make_action(choice, question, self._ctx)
            question.took_s = question.clock.now() - question.began
            question.action = action
            question.chosen = json.dumps(as_json(select_recorded(choice)), sort_keys=True)
        question.wake()
        self._notify()

    def _open_question(self, person: str, choice: Mapping[str, Plain]) -> Question:
        number = choice.get("question")
        if type(number) is not int:
            raise RefusedChoice("illegal", f"A choice has the number of its question, not {shown(number)}.")
        owner, question = self._questions.get(number, (None, None))
        if question is None:
            raise RefusedChoice("late", f"Question {number} is not open: its time is over, or it was never asked.")
        if owner != person:
            raise RefusedChoice("foreign", f"Question {number} is asked of another player.")
        if question.chosen is not None:
            raise RefusedChoice("duplicate", f"Question {number} was answered already; the first choice counts.")
        if question.is_over or question.clock.now() >= question.until:
            raise RefusedChoice("late", f"The time for question {number} is over.")
        return question

    # -- for the game ---------------------------------------------------------------------------------------------

    async def answer(self, state: Mapping[str, Any], seconds: float, joins_within: float) -> tuple[Any, Choice]:
        """Ask a person about an agent, and wait for the answer.

        Args:
            state: the state of the agent.
            seconds: the time for the answer.
            joins_within: the time for the answer if the person has not joined yet.

        Returns:
            The action, or None without an answer, and the choice to record.
        """
        loop = asyncio.get_running_loop()
        woken = asyncio.Event()

        def wake() -> None:
            with suppress(RuntimeError):  # the loop is closed: the game is over
                loop.call_soon_threadsafe(woken.set)

        person = self.find_person(state["name"])
        question = self._put(person, state, wake, seconds, joins_within)
        try:
            while question.chosen is None and (left := question.until - question.clock.now()) > 0:
                woken.clear()
                with suppress(TimeoutError):
                    await asyncio.wait_for(woken.wait(), left)
        except BaseException:
            self._take_back(question)
            raise
        finally:
            with self._lock:
                question.is_over = True
        if question.chosen is not None:
            outcome = CHOSEN
            took = question.took_s
        else:
            took = question.clock.now() - question.began
            outcome = "no choice in time" if person.is_here else "not there"
        choice = Choice(state["turn"] + 1, state["name"], person.name, outcome, question.chosen, round(took, 3))
        return question.action, choice

    def note(self, choice: Choice, time: float) -> None:
        """Store a choice until the end of the turn.

        Earlier choices of the agent at this time or later are dropped: the turn was begun before, and has failed.

        Args:
            choice: the choice.
            time: the time within the turn, for agents that decide on arrival.
        """
        self._pending = [one for one in self._pending if one[1].agent != choice.agent or one[0] < time]
        self._pending.append((time, choice))

    def __call__(self, ctx: Context) -> None:
        """Emit the choices of the turn in the order of agent names, and remove the questions."""
        with self._lock:
            self._questions.clear()
        for _, choice in sorted(self._pending, key=lambda one: one[1].agent):
            if choice.turn == ctx.game.turn:
                ctx.game.emit(EVENT, **{name: value for name, value in vars(choice).items() if name != "turn"})
        self._pending = []
        self._notify()

    def _put(
        self, person: Person, state: Mapping[str, Any], wake: Callable[[], None], seconds: float, joins_within: float
    ) -> Question:
        ctx = self._ctx
        assert ctx is not None  # noqa: S101 - people are asked where a server has opened the game
        limit = ctx.game.deadline_s
        latest = inf if limit is None else max(limit - _MARGIN_S, limit / 2)
        with self._lock:
            clock = ctx.game.clock
            now = clock.now()
            waits = seconds if person.is_here else joins_within
            until = -inf if self._is_let_go else now + min(waits, latest)
            self._last += 1
            question = Question(
                self._last,
                state["name"],
                state["turn"],
                list_moves(state),
                ctx.agent.get_agent(state["name"]).speed or 0.0,
                as_json(state["curr_pos"]),
                list_edges(state, ctx),
                list_deeds(state, person.agents, ctx),
                list_channels(state, person.agents, ctx),
                list_inbox(state),
                as_json(state.get("doing")),
                *(min(seconds, latest), now, until, wake, clock),
            )
            self._questions[question.number] = (person.name, question)
        self._notify()
        return question

    def _take_back(self, question: Question) -> None:
        """Remove a question whose turn was interrupted."""
        with self._lock:
            self._questions.pop(question.number, None)
        self._notify()

    def _notify(self) -> None:
        for callback in tuple(self.changed):
            callback()


class Human:
    """The strategy of the agents that one person plays; made by `human`."""

    def __init__(
        self,
        name: str | None,
        seconds: float,
        joins_within: float,
        otherwise: Callable[[Any], Awaitable[None] | None],
        choices: "dict[tuple[int, str], list[Choice]] | None",
    ) -> None:
        self.name = name
        self._seconds = seconds
        self._joins_within = joins_within
        self._otherwise = otherwise
        self._choices = choices
        self._people: People | None = None
        self._played: Counter[tuple[int, str]] = Counter()  # (turn, agent) -> replayed choices

    def __repr__(self) -> str:
        return f"human({'' if self.name is None else repr(self.name)})"

    def __deepcopy__(self, memo: dict[int, Any]) -> "Human":
        """Return a strategy for a copy of the game."""
        return Human(
            self.name, self._seconds, self._joins_within, get_counterpart(self._otherwise, memo), self._choices
        )

    def prepare(self, ctx: Context) -> None:
        """Find the people of the game when it begins.

        Raises:
            BadValue: no server has opened the game.
        """
        prepare = getattr(self._otherwise, "prepare", None)
        if prepare is not None:
            prepare(ctx)
        if self._choices is not None:
            self._people = People.get_people(ctx)
            if self._people is None:
                self._people = People()
                ctx.game.add(self._people)
            return
        self._people = People.get_people(ctx)
        if self._people is None or not self._people.is_open:
            played = [agents for human, agents in _list_humans(ctx) if human is self]
            names = ", ".join(map(shown, played[0])) if played else "This agent"
            raise BadValue(
                f"{names}: a person plays, and nothing lets a person in here. Play it in the browser, with gamms run "
                "FILE --web or gamms.web.serve(...), or play it without people: give another strategy, with "
                "--strategy TEAM=CODE or strategies={...}."
            )
        self._people.look_up()

    async def __call__(self, state: State | AerialState) -> None:
        """Set the action of an agent to the person's choice; without one, call the default strategy."""
        if self._people is None or "curr_pos" not in state:
            raise BadType("gamms.web.human() decides for one agent of ctx.game: make it the strategy of each, no plan.")
        if self._choices is None:
            action, choice = await self._people.answer(state, self._seconds, self._joins_within)
        else:
            action, choice = self._find_recorded_choice(state, self._choices)
        self._people.note(choice, state.get("time", 0.0))
        if choice.outcome == CHOSEN:
            state["action"] = action
            if messages := list_messages(choice):
                state["outbox"] += messages
            return
        answer = self._otherwise(state)
        if answer is not None:
            await answer

    def _find_recorded_choice(
        self, state: Mapping[str, Any], choices: "dict[tuple[int, str], list[Choice]]"
    ) -> tuple[Any, Choice]:
        """Return the recorded action and choice of an agent in this turn."""
        key = state["turn"] + 1, state["name"]
        known = choices.get(key)
        if known is None:
            raise BadValue(f"The recording has no choice for agent {shown(key[1])} in turn {key[0]}.")
        choice = known[self._played[key] % len(known)]  # agents that decide on arrival have several in a turn
        self._played[key] += 1
        return (None if choice.action is None else as_action(json.loads(choice.action))), choice


def human(
    name: str | None = None,
    *,
    seconds: float = 60.0,
    joins_within: float = 600.0,
    otherwise: Callable[[Any], Awaitable[None] | None] = stay,
    choices: str | os.PathLike[str] | None = None,
) -> Human:
    """Return a strategy that asks one person in the browser; register it for each agent that the person plays.

    People join by links of `gamms.web.serve`. Without it, the game raises a BadValue when it begins.

    Args:
        name: the name of the person in links and recordings; None: the name of the team or the agent.
        seconds: the time for a choice.
        joins_within: the time that the game waits for a person who has not opened the link yet, in seconds.
        otherwise: the strategy that decides if the person makes no choice in time.
        choices: a recording (`.ggr`) whose choices are replayed instead of asking the person.

    Raises:
        BadType, BadValue (ValueError): an argument is invalid.
        RecordingError (ValueError): `choices` is not a recording.
    """
    return Human(
        None if name is None else as_name(name, "a person"),
        as_positive(seconds, "seconds"),
        as_positive(joins_within, "joins_within"),
        as_function_of(otherwise, "otherwise", "the state"),
        None if choices is None else read_choices(choices),
    )


def _list_humans(ctx: Context) -> Iterator[tuple[Human, tuple[str, ...]]]:
    """Yield each human strategy of a game, with the sorted names of its agents."""
    agents: dict[int, list[str]] = {}
    humans: dict[int, Human] = {}
    for agent in ctx.agent.create_iter():
        if isinstance(agent.strategy, Human):
            humans[id(agent.strategy)] = agent.strategy
            agents.setdefault(id(agent.strategy), []).append(agent.name)
    for key, one in humans.items():
        yield one, tuple(sorted(agents[key]))


def _find_name(agents: tuple[str, ...], ctx: Context) -> str:
    """Return the name of a single agent, or the team of several agents."""
    return agents[0] if len(agents) == 1 else str(ctx.agent.get_agent(agents[0]).team)
