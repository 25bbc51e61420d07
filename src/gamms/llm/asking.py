"""The calls for one decision: ask until an answer counts, within the limits of time, calls, tokens and money."""

import asyncio
import json
from contextlib import suppress
from typing import TYPE_CHECKING

from gamms.context import Context
from gamms.llm import server
from gamms.llm.decisions import ANSWERED, WRONG
from gamms.llm.limits import Settings, TokenUsage, UsageAccount
from gamms.llm.questions import Answer, Question, WrongAnswer, answer_in, find_objects
from gamms.plain import Plain
from gamms.typing.game import AerialState, State

if TYPE_CHECKING:
    from openai import AsyncOpenAI

_BACKOFF_S = 0.5  # seconds before the second attempt; each further wait is twice as long
_RESERVED_SHARE = 0.1  # share and least number of seconds of a turn that are left for the fallback
_RESERVED_S = 0.25
_MOST_OF_AN_ANSWER = 2000  # characters that are kept and shown to the model again
_TIMEOUT = "timeout"


class ModelQuery:
    """Get one decision from a server.

    Args:
        client: the client of the server.
        settings: the settings of the strategy.
        account: the account of the game.
        ctx: the context of the game; None: the strategy runs in an event loop of the program.

    Attributes:
        answer: the answer of the model; None: no valid answer.
        log: the outcome of each call, as plain values.
        spent: the calls and tokens of all attempts.
    """

    def __init__(self, client: "AsyncOpenAI", settings: Settings, account: UsageAccount, ctx: Context | None) -> None:
        self._client = client
        self._settings = settings
        self._account = account
        self._ctx = ctx
        self.answer: Answer | None = None
        self.log: list[dict[str, Plain]] = []
        self.spent = TokenUsage()
        self._end = 0.0

    async def ask(self, request: dict[str, Plain], question: Question, state: State | AerialState) -> str:
        """Ask the server and return "answer", or the reason why no answer counts."""
        loop = asyncio.get_running_loop()
        settings = self._settings
        deadline = None if self._ctx is None else self._ctx.game.deadline_s
        last = None if deadline is None else loop.time() + _find_time_to_ask(deadline)
        with suppress(TimeoutError):
            async with asyncio.timeout_at(last), self._account.get_gate(settings.at_once):
                self._end = min(loop.time() + settings.seconds, last or float("inf"))
                async with asyncio.timeout_at(self._end):
                    return await self._ask_repeatedly(request, question, state)
        return _TIMEOUT

    async def _ask_repeatedly(self, request: dict[str, Plain], question: Question, state: State | AerialState) -> str:
        outcome = ""
        messages = request["messages"]
        wait = 0.0
        for number in range(self._settings.attempts):
            await asyncio.sleep(wait)
            wait = 0.0
            body = {**request, "messages": messages}
            reserved = len(json.dumps(body)), self._settings.longest_answer  # a token has at least one byte
            limit = self._account.reserve(self._ctx, *reserved)
            if limit:
                return f"limit: {limit}"
            reply = await self._call(body, reserved)
            if reply.text is None:
                outcome = reply.problem
                wait = max(reply.wait_s, _BACKOFF_S * 2**number)
                if not reply.is_passing or asyncio.get_running_loop().time() + wait >= self._end:
                    return outcome
                continue
            try:
                objects = server.remove_secrets(find_objects(reply.text))
                self.answer = answer_in(objects, question, state, self._ctx)
            except WrongAnswer as error:
                outcome = f"{WRONG}{error}"
                said = {"role": "assistant", "content": reply.text[:_MOST_OF_AN_ANSWER]}
                again = {"role": "user", "content": f"That does not count: {error}. Answer again."}
                messages = [*messages, said, again]
            else:
                return ANSWERED
        return outcome

    async def _call(self, body: dict[str, Plain], reserved: tuple[int, int]) -> server.Reply:
        """Send one request and count its tokens; if the server does not report them, count all reserved tokens."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        reply = server.Reply(None, _TIMEOUT)
        try:
            reply = await server.ask(self._client, body)
            return reply
        finally:
            tokens = reserved if reply.tokens is None else reply.tokens
            self._account.settle(reserved, tokens)
            self.spent.add(*tokens, calls=1)
            entry = {
                "outcome": reply.problem or ANSWERED,
                "asked": body["messages"][-1]["content"],
                "answered": None if reply.text is None else reply.text[:_MOST_OF_AN_ANSWER],
                "input_tokens": tokens[0],
                "output_tokens": tokens[1],
                "seconds": round(loop.time() - began, 3),
            }
            self.log.append(entry)


def _find_time_to_ask(deadline_s: float) -> float:
    """Return how many seconds of a turn the model may take before the fallback plays."""
    return max(deadline_s / 2, deadline_s - max(_RESERVED_SHARE * deadline_s, _RESERVED_S))
