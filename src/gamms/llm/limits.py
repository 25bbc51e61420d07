"""What asking a language model may take: the settings of a strategy, and what was spent in a game."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from json import dumps
from typing import Any, Literal, TypedDict, Unpack, get_args

from gamms.arguments import as_choice, as_count, as_float, as_mapping, as_positive
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.llm.decisions import ANSWERED, EVENT, Decision
from gamms.plain import Plain, to_plain
from gamms.text import shown

Constraint = Literal["schema", "tool", "text"]

_OWN = ("model", "messages", "stream", "n", "response_format", "tools", "tool_choice")  # fields that strategies set
_OF_ANSWERS = ("max_tokens", "max_completion_tokens")
_TOTALS = "llm"  # the key in ctx.game.data
_PER = 1e6  # tokens that a price is for


class Options(TypedDict, total=False):
    """The keywords of `Strategy` that say how a server is asked, and what that may take."""

    seconds: float
    """How long a decision may take, with all its calls; 30."""
    attempts: int
    """How often a server is asked for a decision, until there is an answer that counts; 3."""
    answer_tokens: int
    """How long an answer may be; 1000."""
    max_calls: int | None
    """How often the server is asked in a game; None: no limit."""
    max_tokens: int | None
    """How many tokens questions and answers of a game may have; None: no limit."""
    max_cost: float | None
    """What a game may cost, in the currency of the prices; None: no limit."""
    price_in: float
    """Of a million tokens of questions; 0."""
    price_out: float
    """Of a million tokens of answers; 0."""
    at_once: int
    """How many requests may be under way at once; 8."""
    constrain: Constraint
    """How answers are constrained: by a JSON schema, as the arguments of a tool, or by words alone; "schema"."""
    request: Mapping[str, Plain]
    """Further fields of each request, such as `{"temperature": 0}`; None leaves one out."""
    key_variable: str | None
    """The environment variable that holds the key, where the client is the address of a server."""


@dataclass(frozen=True)
class Settings:
    """The same, checked and with defaults; see `Options`."""

    seconds: float = 30.0
    attempts: int = 3
    answer_tokens: int = 1000
    max_calls: int | None = None
    max_tokens: int | None = None
    max_cost: float | None = None
    price_in: float = 0.0
    price_out: float = 0.0
    at_once: int = 8
    constrain: Constraint = "schema"
    request: Mapping[str, Plain] = field(default_factory=dict)

    @classmethod
    def of(cls, **given: Unpack[Options]) -> "Settings":
        """Check options.

        Raises:
            UnknownName (KeyError): there is no such option.
            BadType, BadValue: a value is impossible.
        """
        known = Options.__annotations__
        for name in given:
            if name in ("api_key", "key"):
                raise BadValue(
                    f"{name} is none of the keywords: give key_variable, the name of an environment variable."
                )
            if name not in known:
                raise UnknownName("keyword of gamms.llm.Strategy:", name, (*known, "template", "fallback", "calls"))
        checked = {name: _CHECKS[name](value, name) for name, value in given.items() if name in _CHECKS}
        settings = cls(**checked)
        if settings.max_cost is not None and not settings.price_in and not settings.price_out:
            raise BadValue("max_cost needs price_in and price_out: the prices of a million tokens.")
        return settings

    def cost(self, input_tokens: int, output_tokens: int) -> float:
        """Return what tokens cost."""
        return (input_tokens * self.price_in + output_tokens * self.price_out) / _PER

    @property
    def fields(self) -> dict[str, Plain]:
        """The fields of every request that these settings say."""
        given = dict(self.request)
        longest = {} if any(name in given for name in _OF_ANSWERS) else {"max_tokens": self.answer_tokens}
        return {name: value for name, value in {**longest, **given}.items() if value is not None}

    @property
    def longest_answer(self) -> int:
        """How many tokens an answer can have."""
        said = [self.fields.get(name) for name in _OF_ANSWERS]
        return max([one for one in said if isinstance(one, int)], default=self.answer_tokens)


def _price(value: object, name: str) -> float:
    number = as_float(value, name)
    if number < 0.0:
        raise BadValue(f"{name} must not be negative, not {number}.")
    return number


def _request(value: object, name: str) -> dict[str, Plain]:
    given = as_mapping(value, name)
    for key in given:
        if not isinstance(key, str) or key in _OWN:
            raise BadValue(f"{name} cannot set {shown(key)}, which gamms.llm.Strategy sets itself.")
    try:
        dumps(given, allow_nan=False)
    except (TypeError, ValueError):
        raise BadType(f"{name} must be what JSON can hold, not {shown(given)}.") from None
    plain: dict[str, Plain] = to_plain(given)
    return plain


_CHECKS: dict[str, Any] = {
    "seconds": as_positive,
    **dict.fromkeys(("attempts", "answer_tokens", "at_once"), as_count),
    **dict.fromkeys(
        ("max_calls", "max_tokens"), lambda value, name: None if value is None else as_count(value, name, 0)
    ),
    "max_cost": lambda value, name: None if value is None else _price(value, name),
    **dict.fromkeys(("price_in", "price_out"), _price),
    "constrain": lambda value, name: as_choice(value, name, get_args(Constraint)),
    "request": _request,
}


@dataclass
class Spent:
    """What was asked for: how often, and the tokens of questions and answers."""

    calls: int = 0
    input_tokens: int = 0
    output_tokens: int = 0

    def add(self, input_tokens: int, output_tokens: int, calls: int = 0) -> None:
        """Add to all three."""
        self.calls += calls
        self.input_tokens += input_tokens
        self.output_tokens += output_tokens


class Account:
    """What strategies of the same settings have spent in a game, and what they have decided in this turn.

    It is a rule that emits each decision as an event, after the turn, and keeps the totals in `ctx.game.data`.

    Args:
        name: of the strategies: equal where they share their limits.
        settings: of the strategies.
    """

    __name__ = "llm"

    def __init__(self, name: str, settings: Settings) -> None:
        self.name, self._settings = name, settings
        self._pending: list[tuple[str, int, Decision]] = []
        self._spent = Spent()  # in this turn; all of it is kept where no game counts turns
        self._gate: tuple[asyncio.AbstractEventLoop, asyncio.Semaphore] | None = None

    def __repr__(self) -> str:
        return self.__name__

    def __deepcopy__(self, memo: dict[int, Any]) -> "Account":
        """Return an account for a copy of the game, which has the totals."""
        return Account(self.name, self._settings)

    def __call__(self, ctx: Context) -> None:
        """Emit what was decided in the turn, in the order of the names, and add it to the totals."""
        turn = ctx.game.turn
        decided = [one for _, _, one in sorted(self._pending, key=lambda item: item[:2]) if one.turn == turn]
        for one in decided:
            ctx.game.emit(EVENT, **one.as_event())
        before, spent = self._before(ctx), self._spent
        before.add(spent.input_tokens, spent.output_tokens, spent.calls)
        fallbacks = [one for one in decided if one.outcome != ANSWERED]
        already = _count(self._totals(ctx), "fallbacks")
        totals = {
            **before.__dict__,
            "cost": self._settings.cost(before.input_tokens, before.output_tokens),
            "fallbacks": already + len(fallbacks),
        }
        if fallbacks and not already:
            first = fallbacks[0]
            ctx.logger.warning(
                f"Agent {shown(first.agent)} plays its fallback in turn {turn}: {first.outcome}. Further ones are in "
                f"result.table({EVENT!r})."
            )
        ctx.game.data[_TOTALS] = {**_as_dict(ctx.game.data.get(_TOTALS)), self.name: totals}
        self._pending, self._spent = [], Spent()

    def gate(self, at_once: int) -> asyncio.Semaphore:
        """Return what lets only so many requests be under way, in the event loop that is running."""
        loop = asyncio.get_running_loop()
        if self._gate is None or self._gate[0] is not loop:
            self._gate = loop, asyncio.Semaphore(at_once)
        return self._gate[1]

    def reserve(self, ctx: Context | None, input_tokens: int, output_tokens: int) -> str:
        """Count a call with all the tokens that it may take; return the limit that it would break, "" if none."""
        settings, spent, total = self._settings, self._spent, self._before(ctx)
        total.add(spent.input_tokens + input_tokens, spent.output_tokens + output_tokens, spent.calls + 1)
        wanted = {
            "max_calls": total.calls,
            "max_tokens": total.input_tokens + total.output_tokens,
            "max_cost": settings.cost(total.input_tokens, total.output_tokens),
        }
        for name, amount in wanted.items():
            limit = getattr(settings, name)
            if limit is not None and amount > limit:
                return name
        self._spent.add(input_tokens, output_tokens, 1)
        return ""

    def settle(self, reserved: tuple[int, int], tokens: tuple[int, int]) -> None:
        """Count what a call has taken in place of what was reserved for it."""
        self._spent.add(tokens[0] - reserved[0], tokens[1] - reserved[1])

    def note(self, decision: Decision, *, is_counted: bool) -> None:
        """Keep a decision of this turn; `is_counted`: its calls were reserved."""
        self._pending.append((decision.agent, len(self._pending), decision))
        if not is_counted:
            self._spent.add(decision.input_tokens, decision.output_tokens, decision.calls)

    def _before(self, ctx: Context | None) -> Spent:
        """Return what was spent before this turn."""
        totals = {} if ctx is None else self._totals(ctx)
        return Spent(*[_count(totals, name) for name in Spent.__dataclass_fields__])

    def _totals(self, ctx: Context) -> Mapping[str, Plain]:
        return _as_dict(_as_dict(ctx.game.data.get(_TOTALS)).get(self.name))


def _as_dict(value: Plain) -> Mapping[str, Plain]:
    """Return a mapping of the game's data, which may be from a recording of any origin."""
    return value if isinstance(value, Mapping) else {}


def _count(totals: Mapping[str, Plain], name: str) -> int:
    value = totals.get(name)
    return value if type(value) is int and value > 0 else 0
