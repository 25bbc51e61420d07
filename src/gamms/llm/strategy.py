"""The strategy that asks a language model, in every turn, for each agent that has it."""

import json
import os
from collections.abc import Awaitable, Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Unpack

from gamms.arguments import as_function_of, as_name, as_text
from gamms.context import Context
from gamms.deciding import phase_of
from gamms.errors import BadType, BadValue, GammsError
from gamms.game.snapshots import own
from gamms.llm import server
from gamms.llm.asking import Asking
from gamms.llm.decisions import ANSWERED, Decision, DecisionFile, digest
from gamms.llm.limits import Account, Options, Settings
from gamms.llm.questions import (
    PROTOCOL,
    Choice,
    Describe,
    Question,
    WrongAnswer,
    as_template,
    choice_of,
    parsed,
    question_of,
)
from gamms.plain import Plain
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing.game import AerialState, State

if TYPE_CHECKING:
    from openai import AsyncOpenAI

_TOOL = "decide"  # the name of the schema, and of the tool


class MissingDecision(GammsError, LookupError):
    """A game is played without a server, and what an agent asks was not recorded."""


class Strategy:
    """Let a language model decide, through any server with the interface of OpenAI's chat completions.

    One object may be the strategy of many agents of a game, which are asked at the same time. A model can choose legal
    moves, declared deeds and messages, and nothing else; where it does not in time or within the limits, the fallback
    decides. Each decision is an event "llm" of the result.

    Args:
        client: an `openai.AsyncOpenAI`, or the address of a server; None: play what is recorded in `calls` alone.
        model: its name.
        instructions: what the model is to do, in words.
        template: of the text that says how things are: a text with `$moves` and others, or a function of the state.
        fallback: the strategy that decides where the model does not.
        calls: a file of what was asked and answered: what is in it is not asked again, and all else is added; or a
            recording of the game, which is only read.
        options: see `Options`.

    Raises:
        UnknownName (KeyError): there is no such option.
        BadType, BadValue (ValueError): an argument is impossible.
        BadFile (ValueError): `calls` is another kind of file.
        MissingFile, MissingFolder (FileNotFoundError): it is not there, and needed; it has no folder.
        MissingKey (KeyError): the environment variable of the key is not set.
        MissingExtra (ImportError): the library `openai` is not installed.
    """

    new_files = ("calls",)  # which scenarios look for in their folders
    variables = ("key_variable",)  # which the user of a scenario names, and its file never does

    def __init__(
        self,
        client: "AsyncOpenAI | str | None",
        model: str,
        instructions: str,
        *,
        template: str | Describe | None = None,
        fallback: Callable[[Any], Awaitable[None] | None] = stay,
        calls: str | os.PathLike[str] | None = None,
        **options: Unpack[Options],
    ) -> None:
        self._model, self._instructions = as_name(model, "a model"), as_text(instructions, "instructions")
        self._template = as_template(template)
        self._settings = Settings.of(**options)
        self._fallback = as_function_of(fallback, "fallback", "the state")
        self._client = _client_of(client, options.get("key_variable"))
        if client is None and calls is None:
            raise BadValue("Without a client there is nothing to ask: give calls=, the file of what was recorded.")
        self._file = DecisionFile(calls, must_exist=client is None)
        described = str(getattr(template, "__qualname__", template))
        name = digest([model, instructions, described, asdict(self._settings)])
        self._account = Account(f"{model} {name[:8]}", self._settings)
        self._ctx: Context | None = None

    def __repr__(self) -> str:
        """Name the model and the address of the server, without anything secret."""
        where = "no server" if self._client is None else server.host_of(self._client)
        return f"Strategy({shown(self._model)}, {where}, calls={self._file})"

    def __deepcopy__(self, memo: dict[int, Any]) -> "Strategy":
        """Return a strategy for a copy of the game, with the same client and file."""
        twin = object.__new__(Strategy)
        twin.__dict__.update(self.__dict__)
        twin._fallback, twin._ctx = own(self._fallback, memo), None
        twin._account = Account(self._account.name, self._settings)
        return twin

    def prepare(self, ctx: Context) -> None:
        """Get to know the game: its map, its limits, and the account that is shared by strategies like this one.

        Raises:
            BadValue: it plays in another context.
        """
        if self._ctx is not None and self._ctx is not ctx and not self._ctx.is_terminated():
            raise BadValue(f"{self!r} plays in another context already: make another gamms.llm.Strategy for this one.")
        self._ctx = ctx
        rules = [named.rule for named in ctx.game.rules]
        known = [rule for rule in rules if isinstance(rule, Account) and rule.name == self._account.name]
        self._account = known[0] if known else Account(self._account.name, self._settings)
        if not known:
            ctx.game.add(self._account)

    async def __call__(self, state: State | AerialState) -> None:
        """Ask what an agent does, and write it into its state.

        Raises:
            BadType: it was made the plan of a team.
            MissingDecision: there is no client, and this was not recorded.
        """
        if "curr_pos" not in state:
            raise BadType("A gamms.llm.Strategy decides for one agent: make it the strategy of each, not a plan.")
        question = question_of(state, self._ctx, self._template)
        request = self._request(question)
        key = digest([self._seed(), state.get("turn", 0), state.get("name", ""), request])
        known, client = self._file.get(key), self._client
        if client is not None and (known is None or known.outcome != ANSWERED):
            choice, decision = await self._asked(client, question, request, state, key)
            self._file.add(decision)
        elif known is not None:
            choice, decision = self._recorded(known, question, state), known
        else:
            who = f"agent {shown(state.get('name'))} asks in turn {state.get('turn', 0) + 1}"
            raise MissingDecision(
                f"What {who} is not in {self._file}: the game, its seed, the template or the instructions are others "
                "than those that were recorded. Give a client to ask."
            )
        if self._ctx is not None:
            self._account.note(decision, is_counted=decision is not known)
        if choice is None:
            answer = self._fallback(state)
            if answer is not None:
                await answer
            return
        state["action"] = choice.action
        if choice.messages:
            state["outbox"].extend(choice.messages)  # type: ignore[arg-type] # plain values of their kinds

    def _seed(self) -> int | None:
        """Return the seed of the game, which is kept from strategies that ask for it."""
        if self._ctx is None:
            return None
        with phase_of(self._ctx).suspended(changes_world=False):
            return self._ctx.seed

    # -- what is asked ------------------------------------------------------------------------------------------

    def _request(self, question: Question) -> dict[str, Plain]:
        """Return the fields of the first request of a decision."""
        settings, schema = self._settings, question.schema
        fields = ", ".join(f'"{name}"' for name in schema["properties"])
        said = f"with the fields {fields}"
        form: dict[str, Plain] = {}
        if settings.constrain == "schema":
            named = {"name": _TOOL, "strict": True, "schema": schema}
            form = {"response_format": {"type": "json_schema", "json_schema": named}}
        elif settings.constrain == "tool":
            function = {"name": _TOOL, "strict": True, "parameters": schema}
            chosen = {"type": "function", "function": {"name": _TOOL}}
            form = {"tools": [{"type": "function", "function": function}], "tool_choice": chosen}
        else:
            said = f"that fits this JSON schema: {json.dumps(schema)}"
        system = f"{self._instructions}\n\n{PROTOCOL.format(answer=said)}"
        messages = [{"role": "system", "content": system}, {"role": "user", "content": question.text}]
        return {"model": self._model, "messages": messages, **form, **settings.fields}

    def _recorded(self, known: Decision, question: Question, state: State | AerialState) -> Choice | None:
        """Return the choice of a recorded decision; None where the fallback decided, or the answer is not legal."""
        if known.answer is None:
            return None
        try:
            return choice_of(parsed(known.answer), question, state, self._ctx)
        except WrongAnswer:
            return None

    async def _asked(
        self, client: "AsyncOpenAI", question: Question, request: dict[str, Plain], state: State | AerialState, key: str
    ) -> tuple[Choice | None, Decision]:
        """Ask the server, and return what was chosen and decided."""
        asking = Asking(client, self._settings, self._account, self._ctx)
        outcome = await asking.outcome(request, question, state)
        spent = asking.spent
        cost = self._settings.cost(spent.input_tokens, spent.output_tokens)
        turn, agent = state.get("turn", 0) + 1, state.get("name", "")
        counts = spent.calls, spent.input_tokens, spent.output_tokens
        return asking.choice, Decision(turn, agent, key, outcome, asking.answer, *counts, cost, asking.log)


def _client_of(client: object, key_variable: str | None) -> "AsyncOpenAI | None":
    if client is None:
        return None
    if isinstance(client, str):
        return server.connect(client, key_variable)
    if key_variable is not None:
        raise BadValue("key_variable is for the address of a server: a client has its key already.")
    return server.as_client(client)
