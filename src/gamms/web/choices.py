"""Questions to people about their agents, and checks of their answers: moves, directions, deeds and messages."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from types import NoneType
from typing import Any

from gamms import recorder
from gamms.clocks import Clock
from gamms.context import Context
from gamms.errors import BadFile, BadValue, GammsError
from gamms.game.channels import check_outboxes, find_receivers
from gamms.game.deeds import check_wanted_deeds, parse_field
from gamms.plain import Plain, as_json
from gamms.text import reason, shown
from gamms.typing.actions import find_parallel_edges
from gamms.web.links import Refused

EVENT = "choice"
"""The kind of events that hold choices, in results and recordings."""

CHOSEN = "chosen"
"""The outcome of an answered question; other outcomes are the reason why the default strategy decided."""

_MOST_MOVES = 5000
_FARTHEST = 1e9  # the maximum component of a direction
_KEYS = ("question", "move", "edge", "do", "messages")  # the keys of a choice
_KEYS_IN_THE_AIR = ("question", "direction", "distance", "do", "messages")
_MOST_MESSAGES = 8  # in one choice
_MOST_HEARD = 20  # received messages that are shown to a person


class RefusedChoice(Refused):
    """A rejected choice; the question stays open.

    Attributes:
        why: "late", "foreign", "illegal" or "duplicate".
    """

    def __init__(self, why: str, message: str) -> None:
        super().__init__(message)
        self.why = why


@dataclass
class Question:
    """A question to a person about an agent, and the answer once it is given.

    Attributes:
        number: the number of the question in the game, from 1.
        agent: the name of the agent.
        turn: the number of turns played.
        moves: the legal nodes, the agent's own node first; an item None means stopping on an edge. None for flying
            agents.
        speed: the speed of a flying agent, map units per turn.
        here: the agent's node, or its position (x, y, z).
        edges: the edges to each node to which several lead: `edge`, its id; `to`, the node; `length` and `attributes`.
        deeds: the available deeds: deed -> field -> `kind`, `choices` (None: any value) and `is_required`.
        channels: the available channels: name -> `to`, the possible receivers, and `bytes`, the maximum number of bytes
            per turn (None: no limit).
        inbox: the last received messages, as JSON.
        doing: the deed that lasts and that the agent is doing, as in its state; None: it does none.
        limit_s: the time that the person has for the answer, seconds.
        began: the time when the question was asked, or when the person first connected, by the clock.
        until: the deadline, by the clock.
        wake: called when the question changes.
        clock: the clock of the game.
        action: the chosen value of `state["action"]`, once the person has answered.
        chosen: the choice as JSON; None: no answer yet.
        took_s: the time that the person took, seconds.
        is_over: whether the game has stopped waiting for the answer.
    """

    number: int
    agent: str
    turn: int
    moves: tuple[int | None, ...] | None
    speed: float
    here: Plain
    edges: list[dict[str, Plain]]
    deeds: dict[str, dict[str, dict[str, Plain]]]
    channels: dict[str, dict[str, Plain]]
    inbox: list[Plain]
    doing: Plain
    limit_s: float
    began: float
    until: float
    wake: Callable[[], object]
    clock: Clock
    action: Any = None
    chosen: str | None = None
    took_s: float = 0.0
    is_over: bool = False

    def as_message(self) -> dict[str, Plain]:
        """Return the question as the JSON message that is sent to the person."""
        moves: Plain = None if self.moves is None else list(self.moves)
        asked = {"question": self.number, "agent": self.agent, "turn": self.turn, "here": self.here, "moves": moves}
        left = round(max(self.until - self.clock.now(), 0.0), 3)
        offered: dict[str, Plain] = {"speed": self.speed, "deeds": self.deeds, "channels": self.channels}
        if self.doing is not None:
            offered["doing"] = self.doing
        if self.edges:
            offered["edges"] = list(self.edges)
        return {**asked, **offered, "inbox": self.inbox, "left_s": left, "is_chosen": self.chosen is not None}


@dataclass(frozen=True)
class Choice:
    """The decision for an agent that a person plays, with the fields of an event of the kind "choice".

    Attributes:
        turn: the number of the turn, from 1.
        agent: the name of the agent.
        person: the name of the person.
        outcome: "chosen", or the reason why the default strategy decided.
        action: the choice as JSON; None: the person made no choice.
        seconds: the time that the person took.
    """

    turn: int
    agent: str
    person: str
    outcome: str
    action: str | None
    seconds: float


# -- questions ------------------------------------------------------------------------------------------------------


def list_moves(state: Mapping[str, Any]) -> tuple[int | None, ...] | None:
    """Return the legal nodes of an agent, its own node first, and None for stopping on an edge; None: it flies."""
    here = state["curr_pos"]
    if isinstance(here, tuple):
        return None
    on_edge = (None,) if state.get("edge") else ()
    return (*(state.get("legal") or (here,)), *on_edge)[:_MOST_MOVES]


def list_edges(state: Mapping[str, Any], ctx: Context) -> list[dict[str, Plain]]:
    """Return the edges among which a person can choose: those to nodes to which several edges lead."""
    graph = ctx.graph.graph
    edges = chain.from_iterable(find_parallel_edges(state, ctx).values())
    return [
        {"edge": one.id, "to": one.target, "length": one.length, "attributes": as_json(graph.edge_attributes(one.id))}
        for one in edges
    ]


def _list_names_in_sight(state: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of agents in the sensor data of a state."""
    for _, data in state.get("sensor", {}).values():
        if isinstance(data, Mapping):
            yield from (name for name in data if isinstance(name, str))


def list_deeds(state: Mapping[str, Any], own: tuple[str, ...], ctx: Context) -> dict[str, dict[str, dict[str, Plain]]]:
    """Return the deeds that a person can choose; agents in fields are the person's or visible, sensors the person's."""
    known = {*own, *_list_names_in_sight(state)}
    offered: dict[str, dict[str, dict[str, Plain]]] = {}
    for deed, fields in state.get("deeds", {}).items():
        offered[deed] = {}
        for key, declared in fields.items():
            kind, choices, is_required = parse_field(declared)
            given: list[Plain] | None = [as_json(one) for one in choices] if kind == "choice" else None
            if kind == "agent":
                given = [name for name in sorted(known) if name in ctx.agent.agents]
            elif kind == "team":
                given = [as_json(team) for team in ctx.agent.teams]
            elif kind == "sensor":
                carried = (ctx.agent.get_agent(name).sensors.values() for name in own)
                given = [one.sensor_id for one in chain.from_iterable(carried)]
            offered[deed][key] = {"kind": kind, "choices": given, "is_required": is_required}
    return offered


def list_channels(state: Mapping[str, Any], own: tuple[str, ...], ctx: Context) -> dict[str, dict[str, Plain]]:
    """Return channel -> its possible receivers (`to`) and its limit (`bytes`).

    Receivers are None (everyone), teams, the person's other agents, visible agents, and senders of received messages.
    """
    if "outbox" not in state:
        return {}
    me = state["name"]
    heard = [message["sender"] for message in state["inbox"]]
    teams = {agent.name: agent.team for agent in ctx.agent.create_iter()}
    known = sorted(({*own, *heard, *_list_names_in_sight(state)} - {me}) & teams.keys())
    offered: dict[str, dict[str, Plain]] = {}
    for name, channel in ctx.game.channels.items():
        if channel.is_for(teams[me]):
            named = [team for team in ctx.agent.teams if isinstance(team, str | int) and channel.is_for(team)]
            others = [
                to
                for to in (*named, *known)
                if any(one != me and channel.is_for(teams[one]) for one in find_receivers(to, teams))
            ]
            offered[name] = {"to": [None, *dict.fromkeys(others)], "bytes": channel.max_bytes_per_turn}
    return offered


def list_inbox(state: Mapping[str, Any]) -> list[Plain]:
    """Return the last received messages of a state, as JSON."""
    return [as_json(dict(message)) for message in state.get("inbox", ())[-_MOST_HEARD:]]


# -- choices --------------------------------------------------------------------------------------------------------


def select_recorded(choice: Mapping[str, Plain]) -> dict[str, Plain]:
    """Return the part of a choice that is recorded: without `question`, and without empty `edge`, `do`, `messages`."""
    return {
        key: value
        for key, value in choice.items()
        if key != "question" and (key not in ("do", "messages") or value) and (key != "edge" or value is not None)
    }


def list_messages(choice: Choice) -> list[Any]:
    """Return the messages in a choice."""
    return [] if choice.action is None else json.loads(choice.action).get("messages", [])


def as_action(choice: Mapping[str, Any]) -> Any:
    """Convert a checked choice to a value for `state["action"]`."""
    do = {"do": choice["do"]} if choice.get("do") else {}
    if "direction" in choice:
        direction = tuple(map(float, choice["direction"]))
        distance = {"distance": choice["distance"]} if "distance" in choice else {}
        return {"direction": direction, **distance, **do} if do or distance else direction
    if choice.get("edge") is not None:
        return {"edge": choice["edge"], **do}
    if do and choice["move"] is not None:
        return {"node_id": choice["move"], **do}
    return do or choice["move"]


def make_action(choice: Mapping[str, Plain], question: Question, ctx: Context | None) -> Any:
    """Check a choice, and convert it to a value for `state["action"]`.

    A choice has `question`; `move`, and perhaps `edge`, or `direction` and `distance`; `do`; and `messages`.

    Raises:
        RefusedChoice: the choice is illegal.
    """
    known = _KEYS if question.moves is not None else _KEYS_IN_THE_AIR
    for key in choice:
        if key not in known:
            raise RefusedChoice(
                "illegal", f"A choice for {shown(question.agent)} has {', '.join(known)}, not {shown(key)}."
            )
    if question.moves is None:
        _check_flight(choice, question)
    elif type(choice.get("move", "")) not in (int, NoneType) or choice["move"] not in question.moves:
        raise RefusedChoice("illegal", f"Agent {shown(question.agent)} may not go to {shown(choice.get('move'))} now.")
    offered = {(one["to"], one["edge"]) for one in question.edges}
    edge = choice.get("edge")
    if edge is not None and (type(edge) is not int or (choice.get("move"), edge) not in offered):
        raise RefusedChoice(
            "illegal",
            f"Agent {shown(question.agent)} may not take edge {shown(edge)} to {shown(choice.get('move'))} now.",
        )
    do = _check_deeds(choice.get("do") or {}, question, ctx)
    _check_messages(choice.get("messages") or [], question, ctx)
    return as_action({**choice, "do": do})


def _check_flight(choice: Mapping[str, Plain], question: Question) -> None:
    direction = choice.get("direction")
    is_right = isinstance(direction, list) and len(direction) == 3
    if not is_right or not all(type(one) in (int, float) and abs(one) < _FARTHEST for one in direction or ()):
        raise RefusedChoice("illegal", f"A direction is three numbers, dx, dy and dz, not {shown(direction)}.")
    distance = choice.get("distance", 0.0)
    if type(distance) not in (int, float) or not 0.0 <= distance <= question.speed:
        raise RefusedChoice(
            "illegal", f"Agent {shown(question.agent)} flies 0 to {question.speed} a turn, not {shown(distance)}."
        )


def _check_deeds(given: Plain, question: Question, ctx: Context | None) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise RefusedChoice(
            "illegal", f"The deeds of an agent must be a mapping from deeds to fields, not {shown(given)}."
        )
    done: dict[str, Any] = {}
    for deed, fields in given.items():
        offered = question.deeds.get(deed)
        values = {} if fields is None else fields
        if offered is None or not isinstance(values, Mapping):
            raise RefusedChoice("illegal", f"There is no deed {shown(deed)} with {shown(fields)}.")
        for key, value in values.items():
            choices = offered.get(key, {}).get("choices")
            if isinstance(choices, list) and value is not None and value not in choices:
                raise RefusedChoice("illegal", f"The field {key!r} of {shown(deed)} cannot be {shown(value)} now.")
        done[deed] = dict(values)
    if not done or ctx is None:
        return {}
    try:
        return check_wanted_deeds(done, ctx.game.deeds, ctx)
    except GammsError as error:
        raise RefusedChoice("illegal", reason(error)) from None


def _check_messages(given: Plain, question: Question, ctx: Context | None) -> None:
    """Raise for messages that no channel accepts; error messages name no agent out of sight."""
    if not isinstance(given, list) or len(given) > _MOST_MESSAGES:
        raise RefusedChoice("illegal", f"Messages are a list of at most {_MOST_MESSAGES}, not {shown(given)}.")
    for message in given:
        values = message if isinstance(message, Mapping) else {}
        name = values.get("channel")
        to = values.get("to")
        offered = question.channels.get(name) if isinstance(name, str) else None
        if offered is None:
            raise RefusedChoice("illegal", f"Agent {shown(question.agent)} has no channel for {shown(message)}.")
        if not any(type(one) is type(to) and one == to for one in offered["to"]):
            raise RefusedChoice(
                "illegal", f"Agent {shown(question.agent)} cannot send to {shown(to)} by {shown(name)}."
            )
    if given and ctx is not None:
        teams = {agent.name: agent.team for agent in ctx.agent.create_iter()}
        _, flaws = check_outboxes([(ctx.agent.get_agent(question.agent), given)], ctx.game.channels, teams)
        if flaws:
            raise RefusedChoice("illegal", flaws[0][1].partition("]: ")[2])


# -- recordings ------------------------------------------------------------------------------------------------------


def read_choices(path: str | os.PathLike[str]) -> dict[tuple[int, str], list[Choice]]:
    """Return the choices in a recording: (turn, agent) -> choices in order.

    Raises:
        BadValue: the recording contains no choices.
    """
    found: dict[tuple[int, str], list[Choice]] = {}
    with recorder.open(path) as recording:
        for event in recording.events():
            if event["kind"] == EVENT:
                found.setdefault((event["turn"], str(event.get("agent"))), []).append(_read_choice(event))
    if not found:
        raise BadValue(f"{str(path)!r} contains no choices of people: only strategies played.")
    return found


def _read_choice(event: Mapping[str, Plain]) -> Choice:
    """Convert an event, possibly from an untrusted file, to a choice."""
    turn = event["turn"]
    seconds = event.get("seconds")
    agent, person, outcome = (event.get(name) for name in ("agent", "person", "outcome"))
    action = event.get("action")
    if not all(isinstance(one, str) for one in (agent, person, outcome, action or "")) or type(seconds) is not float:
        raise BadFile(f"Turn {turn} of the recording has an event {EVENT!r} that is no choice: {shown(event)}.")
    return Choice(turn, str(agent), str(person), str(outcome), action, seconds)
