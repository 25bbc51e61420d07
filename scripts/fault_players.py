"""People, language models, robots and a simulator of roads for `simulate_faults.py`, with fakes at their far ends.

Only the page of a person, the HTTP server of a model, the motion of a robot and the program at the other end of a link
are fakes: each gets and returns the JSON that it would get and return over a network. A player says what the agent's
own strategy decides, so a game goes on in the same way with it. All wait by the clock of the game, which is simulated.
"""

import asyncio
import importlib
import json
import re
from collections.abc import AsyncIterator, Callable, Mapping
from math import inf
from typing import Any

import openai

from gamms import bridge, llm
from gamms.context import Context
from gamms.web.choices import RefusedChoice
from gamms.web.people import Human, People

HTTP = importlib.import_module(openai.DefaultAsyncHttpxClient.__mro__[1].__module__.partition(".")[0])
ANSWER_S = 30.0  # the time for an answer, and for changes of the roads
BRIEF_S = 0.5  # the time that players take
LATE_S = 2.0 * ANSWER_S
EDGES = list(range(20))
ROBOT_SPEED = 20.0  # meters per second
MOVE = re.compile(r"^(\d+): go to node (\d+)", re.MULTILINE)

Strategy = Callable[[Any], Any]


def decide(strategy: Strategy, state: Any) -> Any:
    """Return the action that a strategy decides, and leave the state without one."""
    strategy(state)
    return state.pop("action")


def split_action(action: Any) -> tuple[int | None, dict[str, Any]]:
    """Return the node and the deeds of an action; None: the agent stops on its edge."""
    if isinstance(action, Mapping):
        return action.get("node_id"), dict(action.get("do") or {})
    return action, {}


# -- people -----------------------------------------------------------------------------------------------------------


class Person(Human):
    """A person who decides as the strategy of the agent does, and the page that sends the choices.

    Args:
        name: the name of the agent.
        own: the strategy.

    Attributes:
        delays: the delays of the next answers in seconds; `inf`: there is no answer. Without one, answers are brief.
        flaws: the refusals of choices that were in time.
    """

    def __init__(self, name: str, own: Strategy) -> None:
        super().__init__(name, ANSWER_S, ANSWER_S, self._decide_instead, None)
        self.own = own
        self.delays = list[float]()
        self.flaws = list[str]()
        self._action: Any = None
        self._newest = 0  # number of the last question that was read
        self._open = set[int]()  # numbers of the questions on the page
        self._late = set[int]()  # numbers of questions that are answered too late

    async def __call__(self, state: Any) -> None:
        """Decide, and say it on the page."""
        self._action = decide(self.own, state)
        await super().__call__(state)

    def _decide_instead(self, state: Any) -> None:
        state["action"] = self._action

    def open_page(self, ctx: Context, *, is_here: bool) -> None:
        """Open the page, on which questions appear; `is_here`: and come to it."""
        self._page = People.open(ctx)
        self._page.changed.append(self._read_page)
        if is_here:
            self.come()

    def list_questions(self) -> list[Any]:
        """Return the questions on the page."""
        return self._page.list_questions(str(self.name))

    def come(self) -> None:
        """Open the link of the person."""
        self._page.mark_present(str(self.name))

    def _read_page(self) -> None:
        """Read the questions, and answer those that are new."""
        questions = json.loads(json.dumps(self._page.list_questions(str(self.name))))
        self._open = {question["question"] for question in questions}
        for question in questions:
            number = question["question"]
            if number > self._newest:
                self._newest = number
                delay = self.delays.pop() if self.delays else BRIEF_S
                if delay > ANSWER_S:
                    self._late.add(number)
                if delay < inf:
                    node, deeds = split_action(self._action)
                    choice = {"question": number, "move": node, "do": deeds}
                    asyncio.get_running_loop().call_later(delay, self._send, json.dumps(choice))

    def _send(self, line: str) -> None:
        choice = json.loads(line)
        number = choice["question"]
        try:
            self._page.choose(str(self.name), choice)
        except RefusedChoice as error:
            if error.why != "late" or (number in self._open and number not in self._late):
                self.flaws.append(str(error))
        else:
            if number in self._late:
                self.flaws.append(f"The late answer to question {number} was accepted.")


# -- language models --------------------------------------------------------------------------------------------------


class Model:
    """A language model that decides as the strategy of the agent does.

    Attributes:
        name: its name.
        trouble: a name of `TROUBLES`; None: it answers.
    """

    def __init__(self, name: str, own: Strategy, server: "ModelServer") -> None:
        self.name = name
        self.own = own
        self.trouble: str | None = None
        self._action: Any = None
        self._strategy = llm.Strategy(
            server.client, name, "Go.", seconds=ANSWER_S, attempts=2, fallback=self._decide_instead
        )
        server.models[name] = self

    def prepare(self, ctx: Context) -> None:
        """Join a game."""
        self._strategy.prepare(ctx)

    async def __call__(self, state: Any) -> None:
        """Decide, and say it through the server."""
        self._action = decide(self.own, state)
        await self._strategy(state)

    def _decide_instead(self, state: Any) -> None:
        state["action"] = self._action

    def answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return the answer to a request: the number of the move, and the deeds."""
        text = request["messages"][1]["content"]
        numbers = {int(node): int(number) for number, node in MOVE.findall(text)}
        node, deeds = split_action(self._action)
        said = {deed: True if fields is None else fields for deed, fields in deeds.items()}
        return {"move": numbers.get(node, 0), "do": said}


class ModelServer:
    """The HTTP server of all models of a game, in the event loop of the game.

    Attributes:
        client: its client.
        models: name -> model.
    """

    def __init__(self) -> None:
        self.models = dict[str, Model]()
        http = openai.DefaultAsyncHttpxClient(transport=HTTP.MockTransport(self._respond), trust_env=False)
        self.client = openai.AsyncOpenAI(base_url="http://models.invalid/v1", api_key="none", http_client=http)

    async def _respond(self, request: Any) -> Any:
        asked = json.loads(request.content)
        model = self.models[asked["model"]]
        text = json.dumps(model.answer(asked))
        status = 200
        delay = BRIEF_S
        if model.trouble is not None:
            status, delay, text = TROUBLES[model.trouble]
        await asyncio.sleep(delay)
        usage = {"prompt_tokens": 100, "completion_tokens": 10}
        said = {"choices": [{"index": 0, "message": {"role": "assistant", "content": text}}], "usage": usage}
        return HTTP.Response(status, headers={"content-type": "application/json"}, content=stream(said))


async def stream(body: Any) -> AsyncIterator[bytes]:
    """Send the body of a response."""
    yield json.dumps(body).encode()


TROUBLES: dict[str, tuple[int, float, str]] = {
    "silence": (200, LATE_S, '{"move": 0}'),
    "nonsense": (200, BRIEF_S, "I would rather not."),
    "illegal move": (200, BRIEF_S, '{"move": 999}'),
    "busy": (503, BRIEF_S, ""),
    "empty": (200, BRIEF_S, ""),
}
"""Name -> the status, the delay in seconds, and the text of a server that gives no answer."""


# -- robots and roads -------------------------------------------------------------------------------------------------


class RoadSimulator(bridge.Link):
    """A program that simulates roads: it answers the line of each turn after a delay; late answers would close roads.

    Attributes:
        delay_s: the delay, seconds.
        turns: the turns that have been answered.
    """

    def __init__(self, clock: bridge.Clock) -> None:
        super().__init__(clock)
        self.delay_s = BRIEF_S
        self.turns = set[int]()
        self._time = clock
        self._answers = list[tuple[float, bytes]]()  # when each comes, and its line

    def close(self) -> None:
        """Do nothing, because nothing is open."""

    def _transmit(self, line: bytes) -> bool:
        turn = json.loads(line)["turn"]
        close = EDGES if self.delay_s > ANSWER_S else []
        answer = json.dumps({"gamms": 1, "type": "roads", "turn": turn, "close": close}).encode()
        self._answers.append((self._time.now() + self.delay_s, answer))
        return True

    def _read_waiting_lines(self) -> None:
        now = self._time.now()
        for _, line in [one for one in self._answers if one[0] <= now]:
            self._take(line)
            self.turns.add(json.loads(line)["turn"])
        self._answers = [one for one in self._answers if one[0] > now]


async def send_no_fixes() -> Any:
    """Wait for fixes that never come, in the thread of a feed."""
    await asyncio.Event().wait()
    yield {}


def add_robot(ctx: Context, name: str, clock: bridge.Clock) -> None:
    """Let a robot drive an agent; it arrives in each turn."""
    robot = bridge.SimulatedRobot(ctx, name, clock=clock, speed=ROBOT_SPEED)
    ctx.game.add(bridge.drive(name, robot, clock=clock))


def remove_programs(ctx: Context) -> None:
    """Remove the robots of a game, and the simulator of its roads."""
    for named in ctx.game.rules:
        if isinstance(named.rule, bridge.Drive) or named.name == "traffic":
            ctx.game.remove(named)
