"""One game between two entries: its seeds, the questions to each entry, and the row of the game."""

import hmac
import re
from collections.abc import Mapping
from contextlib import ExitStack
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, NotRequired, TypedDict

from gamms.context import Context
from gamms.plain import as_json, select_plain, to_plain
from gamms.scenario import Scenario
from gamms.scenario.code import name_private_package
from gamms.text import make_printable, make_printable_line, remove_addresses, shown
from gamms.tournament.host import frame_question
from gamms.tournament.players import Answer, EntryFault, EntryProcess, Fault, Launcher
from gamms.typing.agent_engine import AgentType
from gamms.typing.sensor_engine import SensorType

MOST_TURNS = 1000  # turns of a game without a limit of its own
MOST_SAID = 1000  # letters of each text in a row that an entry chooses
_TELLING = re.compile("error|denied|not found", re.IGNORECASE)  # words in a line of a log that tell why a program ended
_OWN = (
    "draw",
    "rng",
    "memory",
    "team_memory",
    "fork",
    "outbox",
    "name",
    "team",
)  # keys of a state that the host of an entry supplies itself


class Fixture(NamedTuple):
    """A game to play.

    Attributes:
        id: the digest of everything that determines the game.
        entries: team -> the entry that plays it.
        seed: the label from which, with the secret of the run, all seeds of the game follow.
        round: the round of the tournament, from 1.
    """

    id: str
    entries: dict[str, str]
    seed: int
    round: int


class Row(TypedDict):
    """The row of a finished game.

    Attributes:
        id, round, seed: see `Fixture`.
        run: the SHA-256 of the secret of its run; tables of older versions do not have it.
        entries: team -> the entry that played it.
        winner: the team that won; None: neither.
        reason: why the game ended.
        truncated: whether the game stopped at its limit of turns.
        turns: the number of turns.
        scores: team -> its score.
        faults: team -> the fault by which it lost, a key of `FAULTS`.
        details: team -> a description of the fault.
    """

    id: str
    run: NotRequired[str]
    round: int
    seed: int
    entries: dict[str, str]
    winner: str | None
    reason: str
    truncated: bool
    turns: int
    scores: dict[str, float]
    faults: dict[str, str]
    details: dict[str, str]


class Run(TypedDict):
    """One run of a tournament.

    Attributes:
        sha256: the SHA-256 of the secret.
        secret: the secret; None: the run has not ended.
        is_given: whether the caller gave the secret.
        entries: name -> digest of the entry.
        seeds: the labels of the games of each pair of entries.
        rounds: the number of rounds of a Swiss tournament; None: every entry plays every other.
    """

    sha256: str
    secret: str | None
    is_given: bool
    entries: dict[str, str]
    seeds: list[int]
    rounds: int | None


def make_seed(secret: str, *names: str | int) -> int:
    """Return the first 62 bits of the HMAC-SHA-256 of the names, joined by "/", under the secret.

    Neither the secret nor other seeds can be computed from them.
    """
    digest = hmac.digest(secret.encode(), "/".join(map(str, names)).encode(), "sha256")
    return int.from_bytes(digest[:8], "big") >> 2


def hash_secret(secret: str) -> str:
    """Return the SHA-256 of a secret, which is published before its games."""
    return sha256(secret.encode()).hexdigest()


def _stay(states: Mapping[str, dict[str, Any]]) -> None:
    """Keep all agents where they are: a plan for a team."""
    for state in states.values():
        state["action"] = (0.0, 0.0, 0.0) if isinstance(state["curr_pos"], tuple) else state["curr_pos"]


class _EntrySide:
    """The team that an entry plays: its plan in the game, and its first fault."""

    def __init__(self, player: EntryProcess, ctx: Context, team: str, start: Mapping[str, Any]) -> None:
        self._player = player
        self._ctx = ctx
        self._team = team
        self._is_python = not player.launcher.entry.command
        self._asked = 0
        self.fault: Fault | None = None
        try:
            player.begin(self._encode_message("start", start))
        except EntryFault as error:
            self.fault = error.fault

    def plan(self, states: dict[str, dict[str, Any]]) -> None:
        """Ask the entry for its agents' actions; without an answer the agents stay and the game ends."""
        try:
            if self.fault is None:
                self._take(states, self._answer(states))
        except EntryFault as error:
            self.fault = error.fault
        if self.fault is not None:
            _stay(states)

    def _answer(self, states: dict[str, dict[str, Any]]) -> Answer:
        self._asked += 1
        agents = {name: _get_data(state) for name, state in states.items()}
        shares = any("team_memory" in state for state in states.values())
        question: dict[str, Any] = {"question": self._asked, "agents": agents, "shares_memory": shares}
        if not self._is_python:
            question = {"question": self._asked, "agents": {name: _as_json(one) for name, one in agents.items()}}
        return self._player.ask(self._encode_message("turn", question), self._asked)

    def _take(self, states: dict[str, dict[str, Any]], answer: Answer) -> None:
        for name in (*answer.actions, *answer.outbox):
            if name not in states:
                raise EntryFault("illegal", f"it decided for {shown(name)}, which is not one of its living agents")
        for name, messages in answer.outbox.items():
            if "outbox" not in states[name]:
                raise EntryFault("illegal", "it sent a message, and the game has no channels")
            states[name]["outbox"] += messages
        for name, action in answer.actions.items():
            states[name]["action"] = action

    def _encode_message(self, kind: str, fields: Mapping[str, Any]) -> bytes:
        if self._is_python:
            return frame_question({"type": kind, **fields})
        from gamms.bridge.lines import encode_line

        return encode_line(kind, fields) + b"\n"

    def find_illegal(self) -> None:
        """Record an illegal action of the team's agents as a fault."""
        agents = self._ctx.agent.agents
        for error in self._ctx.game.errors:
            if self.fault is None and agents[error["agent"]].team == self._team:
                self.fault = Fault("illegal", f"{error['agent']} in turn {error['turn']}: {error['message']}")


def _forfeit(sides: Mapping[str, _EntrySide]) -> tuple[str | None, str]:
    """Return the winner of a game in which an entry has a fault, and the reason for the end."""
    faults = {team: side.fault.kind for team, side in sides.items() if side.fault is not None}
    others = [team for team in sides if team not in faults]
    return (others[0] if others else None), ", ".join(
        f"{team} lost by its fault: {faults[team]}" for team in sorted(faults)
    )


class _Referee:
    """A rule that ends the game when an entry has a fault."""

    def __init__(self, sides: Mapping[str, _EntrySide]) -> None:
        self._sides = sides
        self.__name__ = "referee"

    def __call__(self, ctx: Context) -> None:
        for side in self._sides.values():
            side.find_illegal()
        if any(side.fault for side in self._sides.values()):
            winner, reason = _forfeit(self._sides)
            ctx.game.end(reason, winner=winner)


def play(
    scenario: Scenario, secret: str, fixture: Fixture, launchers: Mapping[str, Launcher], record: Path | None = None
) -> tuple[Row, dict[str, bytes]]:
    """Play a game; return its row and, by team, the log of the entry.

    Args:
        scenario: the scenario of the game.
        secret: the secret of the run.
        fixture: who plays which team, with which seed.
        launchers: entry name -> launcher.
        record: the file of a recording; None: do not record.
    """
    with ExitStack() as open_things:
        ctx = open_things.enter_context(scenario.build(make_seed(secret, fixture.seed)))
        game = ctx.game
        game.on_illegal = "stay"
        game.time_budget = None
        players = {
            team: open_things.enter_context(EntryProcess(launchers[one])) for team, one in fixture.entries.items()
        }
        sides = {
            team: _EntrySide(
                player, ctx, team, _start(ctx, team, make_seed(secret, fixture.seed, team), player.launcher)
            )
            for team, player in players.items()
        }
        for team, side in sides.items():
            game.command(team, side.plan)
        game.add(_Referee(sides))
        if record is not None:
            ctx.record.start(record, overwrite=True)
        result = game.run(max_turns=game.max_turns or MOST_TURNS)
        faults = {team: side.fault for team, side in sides.items() if side.fault is not None}
    winner, reason = _forfeit(sides) if faults else (result.winner, result.reason)
    row = Row(
        id=fixture.id,
        run=hash_secret(secret),
        round=fixture.round,
        seed=fixture.seed,
        entries=fixture.entries,
        winner=winner if winner in fixture.entries else None,
        reason=reason,
        truncated=result.truncated and not faults,
        turns=result.turns,
        scores={team: float(result.scores.get(team, 0)) for team in fixture.entries},
        faults={team: fault.kind for team, fault in faults.items()},
        details={team: _make_readable(players[team], fault.detail)[:MOST_SAID] for team, fault in faults.items()},
    )
    return row, {
        team: _make_readable(player, player.log.decode(errors="replace")).encode() for team, player in players.items()
    }


def try_entry(scenario: Scenario, secret: str, seed: int, sides: tuple[str, str], launcher: Launcher) -> str | None:
    """Ask an entry once, in a game in which the other side stays; return why it cannot play, or None if it can.

    Args:
        scenario: the scenario of the game.
        secret: the secret of the run.
        seed: the label of the game.
        sides: the team that the entry plays, and the other one.
        launcher: the launcher of the entry.
    """
    team, other = sides
    with ExitStack() as open_things:
        ctx = open_things.enter_context(scenario.build(make_seed(secret, seed)))
        ctx.game.on_illegal = "stay"
        ctx.game.time_budget = None
        player = open_things.enter_context(EntryProcess(launcher))
        side = _EntrySide(player, ctx, team, _start(ctx, team, make_seed(secret, seed, team), launcher))
        ctx.game.command(team, side.plan)
        ctx.game.command(other, _stay)
        ctx.game.add(_Referee({team: side}))
        if side.fault is None:
            ctx.game.run(max_turns=1)
        fault = side.fault
    if fault is None:
        return None
    reason = f"{fault.kind}: {_make_readable(player, fault.detail)}"
    if fault.kind == "exit":
        lines = _make_readable(player, player.log.decode(errors="replace")).splitlines()
        telling = [line for line in lines if _TELLING.search(line)] or lines
        reason += f" ({telling[-1].strip()})" if telling else ""
    return make_printable_line(reason)[:MOST_SAID]


def _make_readable(player: EntryProcess, text: str) -> str:
    """Return a text about an entry, printable, and without folders and addresses that change from run to run."""
    entry = player.launcher.entry
    text = text.replace(player.scratch, "~")
    if entry.copy:
        text = text.replace(entry.copy, entry.published).replace(f"{name_private_package(Path(entry.copy))}.", "")
    return remove_addresses(make_printable(text))


def _start(ctx: Context, team: str, seed: int, launcher: Launcher) -> dict[str, Any]:
    """Return the start message of an entry: its team, all agents by name and team, its own seed."""
    start = {
        "team": team,
        "seed": seed,
        "max_turns": ctx.game.max_turns,
        "move_seconds": launcher.allowed.move_s,
    }
    if not launcher.entry.command:
        return {
            **start,
            "agents": {agent.name: _make_keywords(agent, team, ctx) for agent in ctx.agent.agents.values()},
        }
    graph = ctx.graph.columns()
    ids = graph.node_ids
    ends = zip(graph.edge_ids.tolist(), ids[graph.sources].tolist(), ids[graph.targets].tolist(), strict=True)
    return {
        **start,
        "agents": {agent.name: agent.team for agent in ctx.agent.agents.values()},
        "map": {
            "nodes": [[id, *xy] for id, xy in zip(ids.tolist(), graph.xy.tolist(), strict=True)],
            "edges": [[*edge, length] for edge, length in zip(ends, graph.lengths.tolist(), strict=True)],
        },
    }


def _make_keywords(agent: Any, team: str, ctx: Context) -> dict[str, Any]:  # Any: an agent, with attributes of its own
    """Return the arguments that create an agent in an entry's context; opponents start on the map's first node."""
    own = agent.team == team
    node = agent.current_node_id if own else int(ctx.graph.columns().node_ids[0])
    keywords: dict[str, Any] = {"team": agent.team, "start_node_id": node}
    if agent.type is AgentType.AERIAL:
        keywords |= {"type": "AERIAL", "position": agent.position if own else (0.0, 0.0, 0.0)}
    if own and getattr(agent, "speed", None) is not None:
        keywords["speed"] = agent.speed
    if own:
        keywords["meta"] = to_plain(agent.meta)
    return keywords


def _get_data(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data in a state, which is all that an entry receives."""
    sent = {key: value for key, value in state.items() if key not in _OWN}
    sent["facts"] = select_plain(state["facts"])
    sent["sensor"] = {
        name: (kind, to_plain(data) if kind is SensorType.CUSTOM else data)
        for name, (kind, data) in state["sensor"].items()
    }
    return sent


def _as_json(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return a state as JSON values; each sensor becomes a pair: the name of its kind, and its data."""
    sensors = {name: [kind.name, as_json(to_plain(data))] for name, (kind, data) in state["sensor"].items()}
    rest = {key: as_json(to_plain(value)) for key, value in state.items() if key != "sensor"}
    return {**rest, "sensor": sensors}
