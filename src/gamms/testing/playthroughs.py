"""Playthroughs: a game as text that people read and compare, turn by turn.

For each agent a turn shows its place, its legal nodes, what its sensors and others tell it, the action that it wants,
and its move; then messages, deeds, events, scores, facts and the end of the game. The idea is that of the playthroughs
of OpenSpiel (Lanctot et al., "OpenSpiel: A framework for reinforcement learning in games", 2019): stored as a golden
file, the text makes a change of a game a difference that a person can read.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple
from zlib import crc32

from gamms.arguments import as_context, as_count, as_items, as_known, explain_call_errors
from gamms.context import Context
from gamms.plain import Plain, as_json, to_plain
from gamms.text import make_printable_line
from gamms.typing import IAgent

_LONGEST = 160  # characters of a value
_DIGITS = 8  # significant digits of a float
_LOGS = ("messages", "deeds", "events")
_KNOWN = {"hears": "inbox", "does already": "doing", "was blocked": "blocked"}  # label -> key of states


class Outcome(NamedTuple):
    """What a turn has led to, or the start of a game, as plain values.

    Attributes:
        places: living agent -> its place, by the keys `curr_pos`, `edge` and `offset_m` of states.
        teams: living agent -> its team.
        paths: agent -> the nodes of its move, its start first; for agents on the ground that have moved or stayed.
        messages: the messages that were sent in this turn, as in `ctx.game.messages`.
        deeds: the deeds of this turn, as in `Result.deeds`.
        events: the events of this turn, as in `ctx.game.events`.
        scores: all scores.
        facts: the facts that are published to everybody.
        over: the reason of the end, the winner and whether the game was truncated; None: it goes on.
    """

    places: Mapping[str, Mapping[str, Plain]]
    teams: Mapping[str, Plain]
    paths: Mapping[str, Sequence[int]]
    messages: Sequence[Mapping[str, Plain]]
    deeds: Sequence[Mapping[str, Plain]]
    events: Sequence[Mapping[str, Plain]]
    scores: Mapping[Plain, Plain]
    facts: Mapping[str, Plain]
    over: Mapping[str, Plain] | None


class Transcript:
    """Collects the text of a game, from the states and outcomes that any simulator of it gives.

    Args:
        title: the first lines.
        start: the start of the game.
        agents: the agents that are shown; None: all.
    """

    def __init__(self, title: Sequence[str], start: Outcome, agents: frozenset[str] | None = None) -> None:
        self._agents = agents
        self._asked: list[tuple[list[str], Mapping[str, Plain]]] = []  # lines about the knowledge of agents; states
        self._last = start
        self._scores = _write_items(_take_scores(start.scores))
        self._facts = _write_items(start.facts)
        self._lines = [*title, *self._list_places(start)]
        self._lines += [f"fact {name}: {text}" for name, text in self._facts.items()]
        self._lines += [f"score {name}: {text}" for name, text in self._scores.items()]

    def add_state(self, state: Mapping[str, Plain]) -> None:
        """Add the state of an agent before it decides; the action is read from it at the end of the turn."""
        if self._is_shown(state["name"]):
            self._asked.append((self._describe_state(state), state))

    def end_turn(self, turn: int, outcome: Outcome) -> None:
        """Add the actions of the agents whose states were added, and the outcome of the turn.

        Args:
            turn: the number of the turn, from 1.
            outcome: the outcome.
        """
        self._lines += ["", f"Turn {turn}"]
        for known, state in self._asked:
            name = state["name"]
            move = _write_move(state, outcome.paths.get(name), outcome.places.get(name))
            self._lines += [*known, f"    wants {_write_action(state)}{move}"]
        self._asked.clear()
        messages = [one for one in outcome.messages if self._is_shown(one["sender"], *one["heard"], *one["overheard"])]
        deeds = [one for one in outcome.deeds if self._is_shown(one["agent"])]
        self._lines += [f"  message {_write_entry(one)}" for one in messages]
        self._lines += [f"  deed {_write_entry(one)}" for one in deeds]
        self._lines += [f"  event {_write_entry(one)}" for one in outcome.events]
        scores = _write_items(_take_scores(outcome.scores))
        gone = dict.fromkeys(self._scores.keys() - scores.keys(), "0")
        self._lines += [f"  score {name}: {text}" for name, text in _list_changes(self._scores, scores | gone)]
        facts = _write_items(outcome.facts)
        self._lines += [f"  fact {key}: {text}" for key, text in _list_changes(self._facts, facts)]
        self._lines += [f"  fact {key} is withdrawn" for key in self._facts if key not in facts]
        if outcome.over is not None:
            over = [f"{key} {_write(outcome.over[key])}" for key in ("reason", "winner", "truncated")]
            self._lines.append(f"  end: {', '.join(over)}")
        self._scores = scores
        self._facts = facts
        self._last = outcome

    def write(self) -> str:
        """Return the text so far, which ends with the places of the agents."""
        return "\n".join([*self._lines, "", *self._list_places(self._last), ""])

    def _is_shown(self, *names: str) -> bool:
        """Return whether one of some agents is shown."""
        return self._agents is None or not self._agents.isdisjoint(names)

    def _is_public(self, key: str, fact: Plain) -> bool:
        """Return whether a fact that an agent knows is published to everybody."""
        public = self._last.facts
        # NOTE: identity first, for facts with an entry for each node of a city, which all agents know
        return key in public and (fact is public[key] or _write(fact) == self._facts[make_printable_line(key)])

    def _list_places(self, outcome: Outcome) -> list[str]:
        """Return a line for each team: where its living agents are."""
        by_team: dict[str, list[str]] = {}
        for name in sorted(outcome.places):
            if self._is_shown(name):
                place = f"{make_printable_line(name)} at {_write_place(outcome.places[name])}"
                by_team.setdefault(_write(outcome.teams[name]), []).append(place)
        return [f"team {team}: {', '.join(places)}" for team, places in sorted(by_team.items())]

    def _describe_state(self, state: Mapping[str, Plain]) -> list[str]:
        """Return the lines about what an agent knows when it decides."""
        here = f"{make_printable_line(state['name'])} at {_write_place(state)}"
        lines = [f"  {here}, may go to {_write(list(state['legal']))}" if state.get("legal") else f"  {here}"]
        seen = {name: data for name, (_, data) in state.get("sensor", {}).items()}
        lines += [f"    sensor {name}: {text}" for name, text in _write_items(seen).items()]
        lines += [f"    {label}: {_write(state[key])}" for label, key in _KNOWN.items() if state.get(key)]
        private = {key: one for key, one in state["facts"].items() if not self._is_public(key, one)}
        return lines + [f"    knows {key}: {text}" for key, text in _write_items(private).items()]


@explain_call_errors
def playthrough(ctx: Context, turns: int = 5, agents: Iterable[str] | None = None) -> str:
    """Play the next turns of a game, and return them as text that people read and compare.

    The same game has the same text on every machine: floats have eight significant digits, and a long value is cut and
    followed by its length and its CRC-32, so that any change of it is seen. Agents of a plan of arrays have no states:
    their moves are not shown. Of agents that decide at arrivals the first decision of a turn is shown.

    Args:
        ctx: the context, with agents, strategies and rules.
        turns: the number of turns, as for `ctx.game.run`; fewer if the game ends.
        agents: the names of the agents whose places, knowledge, actions, messages and deeds are shown, with all events,
            scores and facts; None: all agents.

    Raises:
        BadType, BadValue: an argument is impossible.
        UnknownName (KeyError): there is no such agent.
    """
    as_context(ctx, "playthrough")
    count = as_count(turns, "turns", 0)
    names = None if agents is None else frozenset(as_items(agents, "agents", "names"))
    for name in sorted(names or ()):
        as_known(name, "agent", ctx.agent.agents)
    game = ctx.game
    logs = {name: len(getattr(game.internals.state, name)) for name in _LOGS}
    rules = ", ".join(make_printable_line(rule.name) for rule in game.rules)
    columns = ctx.graph.columns()
    size = f"{len(columns.node_ids)} nodes, {len(columns.edge_ids)} edges"
    scenario = game.internals.scenario or {}
    name = f"{make_printable_line(str(scenario['name']))}, " if scenario.get("name") else ""
    title = [f"{name}seed {ctx.seed}, {size}, after turn {game.turn}", f"rules: {rules or 'none'}"]
    transcript = Transcript(title, _find_outcome(ctx, logs), names)

    def note_states(_: list[IAgent], states: list[dict[str, Plain]]) -> None:
        for state in states:
            transcript.add_state(state)

    def note_turn() -> None:
        transcript.end_turn(game.turn, _find_outcome(ctx, logs))

    observers = game.internals.after_observing
    listeners = ctx.visual.after_turn
    observers.append(note_states)
    listeners.append(note_turn)
    try:
        game.run(count)
    finally:
        observers.remove(note_states)
        listeners.remove(note_turn)
    return transcript.write()


def _find_outcome(ctx: Context, logs: dict[str, int]) -> Outcome:
    """Return the outcome of a turn; `logs` has the lengths of the logs before it, and is updated."""
    game = ctx.game
    state = game.internals.state
    living = [agent for agent in ctx.agent.create_iter() if agent.alive]
    new = {}
    for name, length in logs.items():
        entries = getattr(state, name)
        new[name] = entries[length:]
        logs[name] = len(entries)
    return Outcome(
        places={agent.name: _find_place(agent) for agent in living},
        teams={agent.name: agent.team for agent in living},
        paths={name: move.path for name, move in game.moves.items()},
        scores=dict(game.scores),
        facts=dict(game.facts),
        over=game.over,
        **new,
    )


def _find_place(agent: IAgent) -> dict[str, Plain]:
    """Return the place of an agent by the keys of states."""
    position = getattr(agent, "position", None)
    if position is not None:
        return {"curr_pos": position}
    return {"curr_pos": agent.current_node_id, "edge": agent.edge, "offset_m": agent.offset_m}


def _write_place(state: Mapping[str, Plain]) -> str:
    """Return where an agent is: a node, the ends of an edge and the distance from its source, or a position."""
    edge = state.get("edge")
    return _write(state["curr_pos"]) if edge is None else f"{edge[0]}-{edge[1]} + {_write(state['offset_m'])}"


def _write_action(state: Mapping[str, Plain]) -> str:
    """Return the action of an agent, and the messages that it sends."""
    sent = state.get("outbox")
    text = _write(state["action"]) if "action" in state else "nothing"
    return f"{text}, says {_write(sent)}" if sent else text


def _write_move(state: Mapping[str, Plain], path: Sequence[int] | None, place: Mapping[str, Plain] | None) -> str:
    """Return the nodes of a move, each once where the agent pauses, and its end on an edge; "" for one in the air.

    Args:
        state: the state of the agent before the move.
        path: the nodes; None: the agent was in the air, or is not known any more.
        place: the place of the agent after the turn; None: it is out.
    """
    if path is None:
        return ""
    nodes = [node for node, _ in groupby(path)]
    moved = [" ".join(map(str, nodes))] if len(nodes) > 1 else []
    if place is not None and place.get("edge") is not None and _write_place(place) != _write_place(state):
        moved.append(f"onto {_write_place(place)}")
    return f", moves {' '.join(moved)}" if moved else ", stays"


def _write_entry(entry: Mapping[str, Plain]) -> str:
    """Return an entry of a log, without its turn."""
    return _write({key: one for key, one in entry.items() if key != "turn"}, is_sorted=False)


def _write_items(values: Mapping[Plain, Plain]) -> dict[str, str]:
    """Return the texts of the keys and values of a mapping, in the order of the keys."""
    return dict(sorted((make_printable_line(str(key)), _write(one)) for key, one in values.items()))


def _list_changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return the keys whose texts have changed, with the new texts, sorted."""
    return [(key, text) for key, text in sorted(after.items()) if before.get(key) != text]


def _take_scores(scores: Mapping[Plain, Plain]) -> dict[Plain, Plain]:
    """Return the scores that are not zero, whole ones as integers; a score that was never counted is zero."""
    found = {key: one for key, one in scores.items() if one}
    return {key: int(one) if isinstance(one, float) and one.is_integer() else one for key, one in found.items()}


def _write(value: Plain, *, is_sorted: bool = True) -> str:
    """Return a value as JSON on one line; a long one is cut, and followed by its length and its CRC-32.

    Args:
        value: the value.
        is_sorted: whether the keys of mappings are sorted.
    """
    text = make_printable_line(json.dumps(_round(as_json(to_plain(value))), ensure_ascii=False, sort_keys=is_sorted))
    if len(text) <= _LONGEST:
        return text
    return f"{text[:_LONGEST]}… ({len(text)} characters, CRC-32 {crc32(text.encode()):08x})"


def _round(value: Plain) -> Plain:
    """Return a JSON value whose floats have few digits."""
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}")
    if isinstance(value, dict):
        return {key: _round(one) for key, one in value.items()}
    return [_round(one) for one in value] if isinstance(value, list) else value
