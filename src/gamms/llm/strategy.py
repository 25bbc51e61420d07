"""The strategy that asks a language model in every turn for the action of each of its agents."""

import json
import os
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, Unpack

from gamms.arguments import as_function_of, as_name, as_text
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.errors import BadType, BadValue, GammsError
from gamms.game.snapshots import get_counterpart
from gamms.llm import server
from gamms.llm.asking import ModelQuery
from gamms.llm.decisions import ANSWERED, Decision, DecisionFile, digest
from gamms.llm.limits import Options, Settings, UsageAccount
from gamms.llm.questions import (
    NOTES,
    PROTOCOL,
    Choice,
    Describe,
    Question,
    WrongAnswer,
    answer_in,
    as_template,
    make_question,
    parse_recorded,
    remember,
)
from gamms.plain import Plain
from gamms.readonly import ShallowCopyMixin
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing.game import AerialState, State

if TYPE_CHECKING:
    from openai import AsyncOpenAI

_TOOL = "decide"  # the name of the schema, and of the tool


class MissingDecision(GammsError, LookupError):
    """The game is played without a server, and no recorded decision answers an agent's question."""


class Strategy(ShallowCopyMixin):
    """Decide with a language model, through any server with the interface of OpenAI's chat completions.

    One object may be the strategy of many agents of a game, which are asked at the same time. A model can choose only
    legal moves, declared deeds and messages; if it does not choose in time or within the limits, the fallback
    decides. Each decision is an event "llm" of the result.

    Args:
        client: an `openai.AsyncOpenAI`, or the address of a server; None: play only decisions recorded in `calls`.
        model: the name of the model.
        instructions: the task of the model, in words.
        template: the template of the text that describes a state: a text with `$moves` and other parts, or a function
            of the state.
        fallback: the strategy that decides if the model does not.
        calls: a file of requests and decisions: requests that it holds are not sent again, and new ones are appended;
            or a recording of the game, which is only read.
        options: see `Options`.

    Raises:
        UnknownName (KeyError): an option does not exist.
        BadType, BadValue (ValueError): an argument is impossible.
        BadFile (ValueError): `calls` is another kind of file.
        MissingFile, MissingFolder (FileNotFoundError): a required file, or the folder of `calls`, does not exist.
        MissingKey (KeyError): the environment variable of the key is not set.
        MissingExtra (ImportError): the library `openai` is not installed.
    """

    _not_pickled = (
        "A gamms.llm.Strategy cannot be pickled, because it holds a connection and its key. Make it in the other "
        "process, or name it in a scenario."
    )
    new_files = ("calls",)  # arguments that scenarios resolve in their folders
    variables = ("key_variable",)  # arguments that only the user of a scenario gives, never its file

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
        self._model = as_name(model, "a model")
        self._instructions = as_text(instructions, "instructions")
        self._template = as_template(template)
        self._settings = Settings.from_options(**options)
        self._fallback = as_function_of(fallback, "fallback", "the state")
        self._client = _find_client(client, options.get("key_variable"))
        if client is None and calls is None:
            raise BadValue("Without a client, decisions must be recorded: give calls=, the file that holds them.")
        self._file = DecisionFile(calls, must_exist=client is None)
        described = str(getattr(template, "__qualname__", template))
        name = digest([model, instructions, described, self._settings.identity])
        self._account = UsageAccount(f"{model} {name[:8]}", self._settings)
        self._ctx: Context | None = None

    def __repr__(self) -> str:
        """Name the model and the address of the server, without secrets."""
        where = "no server" if self._client is None else server.find_host(self._client)
        return f"Strategy({shown(self._model)}, {where}, calls={self._file})"

    def __deepcopy__(self, memo: dict[int, Any]) -> "Strategy":
        """Return a strategy for a copy of the game, with the same client and file."""
        twin = object.__new__(Strategy)
        twin.__dict__.update(self.__dict__)
        twin._fallback = get_counterpart(self._fallback, memo)
        ctx = memo.get(id(self._ctx))  # None: it is not copied together with its context
        twin._ctx = ctx
        twin._account = UsageAccount(self._account.name, self._settings)
        if ctx is not None:
            twin._account = get_counterpart(self._account, memo)
        return twin

    def prepare(self, ctx: Context) -> None:
        """Join a game: remember its context, and share the account of strategies with the same settings.

        Raises:
            BadValue: the strategy plays in another context.
        """
        if self._ctx is not None and self._ctx is not ctx and not self._ctx.is_terminated():
            raise BadValue(f"{self!r} is already used in another context: make a new gamms.llm.Strategy for this one.")
        self._ctx = ctx
        rules = [named.rule for named in ctx.game.rules]
        known = [rule for rule in rules if isinstance(rule, UsageAccount) and rule.name == self._account.name]
        self._account = known[0] if known else UsageAccount(self._account.name, self._settings)
        if not known:
            ctx.game.add(self._account)

    async def __call__(self, state: State | AerialState) -> None:
        """Ask the model for the agent's action, and write the action into the state.

        Raises:
            BadType: the strategy is used as the plan of a team.
            MissingDecision: the decision was not recorded, and there is no client to ask.
        """
        if "curr_pos" not in state:
            raise BadType("A gamms.llm.Strategy decides for one agent: register it for each agent, not as a plan.")
        question = make_question(state, self._ctx, self._template, notes=self._settings.notes)
        request = self._request(question)
        key = digest([self._get_seed(), state.get("turn", 0), state.get("name", ""), request])
        known = self._file.get(key)
        client = self._client
        if client is not None and (known is None or known.outcome != ANSWERED):
            choice, decision = await self._ask_server(client, question, request, state, key)
            self._file.add(decision)
        elif known is not None:
            choice = self._find_recorded_choice(known, question, state)
            decision = known
        else:
            who = f"agent {shown(state.get('name'))} in turn {state.get('turn', 0) + 1}"
            raise MissingDecision(
                f"The decision of {who} is not in {self._file}: the game, its seed, the template or the instructions "
                "differ from the recorded ones. Give a client to ask a model."
            )
        if self._ctx is not None:
            self._account.note(decision, state.get("time", 0.0), is_counted=decision is not known)
        if choice is None:
            remember(state.get("memory"), flaw=decision.flaw)
            answer = self._fallback(state)
            if answer is not None:
                await answer
            return
        remember(state.get("memory"), note=choice.note)
        state["action"] = choice.action
        if choice.messages:
            state["outbox"].extend(choice.messages)  # type: ignore[arg-type] # plain values of their kinds

    def _get_seed(self) -> int | None:
        """Return the seed of the game, which strategies otherwise may not read."""
        if self._ctx is None:
            return None
        with get_phase(self._ctx).suspend(changes_world=False):
            return self._ctx.seed

    # -- the request --------------------------------------------------------------------------------------------

    def _request(self, question: Question) -> dict[str, Plain]:
        """Return the fields of the first request of a decision."""
        settings = self._settings
        schema = question.schema
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
        system += f"\n{NOTES}" if settings.notes else ""
        messages = [{"role": "system", "content": system}, {"role": "user", "content": question.text}]
        return {"model": self._model, "messages": messages, **form, **settings.fields}

    def _find_recorded_choice(self, known: Decision, question: Question, state: State | AerialState) -> Choice | None:
        """Return the choice of a recorded decision; None if the fallback decided, or if the answer is not legal."""
        if known.answer is None:
            return None
        try:
            return answer_in(parse_recorded(known.answer), question, state, self._ctx).choice
        except WrongAnswer:
            return None

    async def _ask_server(
        self, client: "AsyncOpenAI", question: Question, request: dict[str, Plain], state: State | AerialState, key: str
    ) -> tuple[Choice | None, Decision]:
        """Ask the server, and return the choice and the decision."""
        asking = ModelQuery(client, self._settings, self._account, self._ctx)
        outcome = await asking.ask(request, question, state)
        spent = asking.spent
        cost = self._settings.compute_cost(spent.input_tokens, spent.output_tokens)
        turn = state.get("turn", 0) + 1
        agent = state.get("name", "")
        counts = spent.calls, spent.input_tokens, spent.output_tokens
        answer = asking.answer
        written = None if answer is None else json.dumps(answer.given, sort_keys=True)
        choice = None if answer is None else answer.choice
        return choice, Decision(turn, agent, key, outcome, written, *counts, cost, asking.log)


def _find_client(client: object, key_variable: str | None) -> "AsyncOpenAI | None":
    if client is None:
        return None
    if isinstance(client, str):
        return server.connect(client, key_variable)
    if key_variable is not None:
        raise BadValue("key_variable is for the address of a server: a client has its key already.")
    return server.as_client(client)
