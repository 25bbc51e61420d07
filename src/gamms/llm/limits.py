"""Limits on asking a language model: the settings of a strategy, and the usage counted in a game."""

import asyncio
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from json import dumps
from typing import Any, Literal, TypedDict, Unpack, get_args

from gamms.arguments import as_bool, as_choice, as_count, as_float, as_mapping, as_positive
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.llm.decisions import ANSWERED, EVENT, Decision
from gamms.plain import Plain, to_plain
from gamms.text import shown

Constraint = Literal["schema", "tool", "text"]

_OWN = ("model", "messages", "stream", "n", "response_format", "tools", "tool_choice")  # set by strategies
_OF_ANSWERS = ("max_tokens", "max_completion_tokens")
_TOTALS = "llm"  # the key in ctx.game.data
_TOKENS_PER_PRICE = 1e6  # tokens that a price is for


class Options(TypedDict, total=False):
    """Keywords of `Strategy` that control how it asks the server and how much it may use."""

    seconds: float
    """The longest time in seconds for one decision, over all its calls; 30."""
    attempts: int
    """The most calls for one decision, until an answer counts; 3."""
    answer_tokens: int
    """The most tokens of an answer; 1000."""
    max_calls: int | None
    """The most calls in a game; None: no limit."""
    max_tokens: int | None
    """The most tokens in a game, questions and answers together; None: no limit."""
    max_cost: float | None
    """The most that a game may cost, in the currency of the prices; None: no limit."""
    price_in: float
    """The price of a million tokens of questions; 0."""
    price_out: float
    """The price of a million tokens of answers; 0."""
    at_once: int
    """The most requests at the same time; 8."""
    constrain: Constraint
    """How answers are constrained: by a JSON schema, as arguments of a tool, or by instructions alone; "schema"."""
    notes: bool
    """Whether to ask for a reason (`why`) and for a `note` of the model to itself, for its next question; False."""
    request: Mapping[str, Plain]
    """Further fields of each request, such as `{"temperature": 0}`; the value None removes a field."""
    key_variable: str | None
    """The environment variable that holds the key, if the client is the address of a server."""


@dataclass(frozen=True)
class Settings:
    """Checked options, with defaults; see `Options`."""

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
    notes: bool = False
    request: Mapping[str, Plain] = field(default_factory=dict)

    @classmethod
    def from_options(cls, **given: Unpack[Options]) -> "Settings":
        """Check options and return the settings.

        Raises:
            UnknownName (KeyError): an option does not exist.
            BadType, BadValue: a value is impossible.
        """
        known = Options.__annotations__
        for name in given:
            if name in ("api_key", "key"):
                raise BadValue(f"{name} is not a keyword: give key_variable, the name of an environment variable.")
            if name not in known:
                raise UnknownName("keyword of gamms.llm.Strategy:", name, (*known, "template", "fallback", "calls"))
        checked = {name: _CHECKS[name](value, name) for name, value in given.items() if name in _CHECKS}
        settings = cls(**checked)
        if settings.max_cost is not None and not settings.price_in and not settings.price_out:
            raise BadValue("max_cost needs price_in and price_out: the prices of a million tokens.")
        return settings

    def compute_cost(self, input_tokens: int, output_tokens: int) -> float:
        """Return the cost of these tokens."""
        return (input_tokens * self.price_in + output_tokens * self.price_out) / _TOKENS_PER_PRICE

    @property
    def identity(self) -> dict[str, Plain]:
        """The settings by which strategies share an account; those that were added later are left out by default."""
        return {name: value for name, value in asdict(self).items() if name != "notes" or value}

    @property
    def fields(self) -> dict[str, Plain]:
        """The fields that these settings add to every request."""
        given = dict(self.request)
        longest = {} if any(name in given for name in _OF_ANSWERS) else {"max_tokens": self.answer_tokens}
        return {name: value for name, value in {**longest, **given}.items() if value is not None}

    @property
    def longest_answer(self) -> int:
        """The largest number of tokens that an answer can have."""
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
        raise BadType(f"{name} must be representable as JSON, not {shown(given)}.") from None
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
    "notes": as_bool,
    "request": _request,
}


@dataclass
class TokenUsage:
    """Counts of calls, of question tokens and of answer tokens."""

    calls: int = 0
    input_tokens: int = 0
    output_tokens: int = 0

    def add(self, input_tokens: int, output_tokens: int, calls: int = 0) -> None:
        """Add to all three counts."""
        self.calls += calls
        self.input_tokens += input_tokens
        self.output_tokens += output_tokens


class UsageAccount:
    """The usage of all strategies with the same settings in a game, and their decisions in this turn.

    The account is a rule. After each turn it emits every decision as an event and stores the totals in
    `ctx.game.data`.

    Args:
        name: the name of the account; strategies with equal names share their limits.
        settings: the settings of the strategies.
    """

    __name__ = "llm"

    def __init__(self, name: str, settings: Settings) -> None:
        self.name = name
        self._settings = settings
        self._pending: list[tuple[float, Decision]] = []  # time within the turn, decision
        self._spent = TokenUsage()  # usage in this turn; without a game that counts turns, all usage
        self._gate: tuple[asyncio.AbstractEventLoop, asyncio.Semaphore] | None = None

    def __repr__(self) -> str:
        return self.__name__

    def __deepcopy__(self, memo: dict[int, Any]) -> "UsageAccount":
        """Return an account for a copy of the game; the copy of the game holds the totals."""
        return UsageAccount(self.name, self._settings)

    def __call__(self, ctx: Context) -> None:
        """Emit the decisions of the turn, sorted by agent, and add them to the totals."""
        turn = ctx.game.turn
        decided = [one for _, one in sorted(self._pending, key=lambda item: item[1].agent) if one.turn == turn]
        for one in decided:
            ctx.game.emit(EVENT, **one.as_event())
        before = self._find_earlier_usage(ctx)
        spent = self._spent
        before.add(spent.input_tokens, spent.output_tokens, spent.calls)
        fallbacks = [one for one in decided if one.outcome != ANSWERED]
        already = _count(self._find_totals(ctx), "fallbacks")
        totals = {
            **before.__dict__,
            "cost": self._settings.compute_cost(before.input_tokens, before.output_tokens),
            "fallbacks": already + len(fallbacks),
        }
        if fallbacks and not already:
            first = fallbacks[0]
            ctx.logger.warning(
                f"Agent {shown(first.agent)} plays its fallback in turn {turn}: {first.outcome}. Further ones are in "
                f"result.table({EVENT!r})."
            )
        ctx.game.data[_TOTALS] = {**_as_dict(ctx.game.data.get(_TOTALS)), self.name: totals}
        self._pending = []
        self._spent = TokenUsage()

    def get_gate(self, at_once: int) -> asyncio.Semaphore:
        """Return the semaphore of the running event loop that bounds the number of requests at the same time."""
        loop = asyncio.get_running_loop()
        if self._gate is None or self._gate[0] is not loop:
            self._gate = loop, asyncio.Semaphore(at_once)
        return self._gate[1]

    def reserve(self, ctx: Context | None, input_tokens: int, output_tokens: int) -> str:
        """Count a call with all tokens that it may take; return the name of the limit that it would break, or ""."""
        settings = self._settings
        spent = self._spent
        total = self._find_earlier_usage(ctx)
        total.add(spent.input_tokens + input_tokens, spent.output_tokens + output_tokens, spent.calls + 1)
        wanted = {
            "max_calls": total.calls,
            "max_tokens": total.input_tokens + total.output_tokens,
            "max_cost": settings.compute_cost(total.input_tokens, total.output_tokens),
        }
        for name, amount in wanted.items():
            limit = getattr(settings, name)
            if limit is not None and amount > limit:
                return name
        self._spent.add(input_tokens, output_tokens, 1)
        return ""

    def settle(self, reserved: tuple[int, int], tokens: tuple[int, int]) -> None:
        """Replace the reserved tokens of a call by the tokens that it took."""
        self._spent.add(tokens[0] - reserved[0], tokens[1] - reserved[1])

    def note(self, decision: Decision, time: float, *, is_counted: bool) -> None:
        """Store a decision of this turn.

        Earlier decisions of the agent at this time or later are dropped: the turn was begun before, and has failed.

        Args:
            decision: the decision.
            time: the time within the turn, for agents that decide on arrival.
            is_counted: whether its calls were reserved already.
        """
        self._pending = [one for one in self._pending if one[1].agent != decision.agent or one[0] < time]
        self._pending.append((time, decision))
        if not is_counted:
            self._spent.add(decision.input_tokens, decision.output_tokens, decision.calls)

    def _find_earlier_usage(self, ctx: Context | None) -> TokenUsage:
        """Return the usage before this turn."""
        totals = {} if ctx is None else self._find_totals(ctx)
        return TokenUsage(*[_count(totals, name) for name in TokenUsage.__dataclass_fields__])

    def _find_totals(self, ctx: Context) -> Mapping[str, Plain]:
        return _as_dict(_as_dict(ctx.game.data.get(_TOTALS)).get(self.name))


def _as_dict(value: Plain) -> Mapping[str, Plain]:
    """Return `value` if it is a mapping, else {}; the game's data may come from any recording."""
    return value if isinstance(value, Mapping) else {}


def _count(totals: Mapping[str, Plain], name: str) -> int:
    value = totals.get(name)
    return value if type(value) is int and value > 0 else 0
