"""One game between two entries: what each is asked, and the row that comes of it."""

import hashlib
import re
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from gamms.bridge.lines import line_of
from gamms.context import Context
from gamms.plain import as_json, plain_subset, to_plain
from gamms.scenario import Scenario
from gamms.scenario.code import private_package
from gamms.text import printable, printable_line, shown, without_address
from gamms.tournament.host import framed
from gamms.tournament.players import Answer, Fault, Faulty, Launcher, Player
from gamms.typing.agent_engine import AgentType
from gamms.typing.sensor_engine import SensorType

MOST_TURNS = 1000  # of a game that has no bound of its own
MOST_SAID = 1000  # letters of what an entry makes a row say
_TELLING = re.compile("error|denied|not found", re.IGNORECASE)  # in the line of a log that says why a program ended
_OWN = ("draw", "rng", "memory", "team_memory", "fork", "outbox", "name", "team")  # what an entry makes for itself


class Fixture(NamedTuple):
    """A game that is to be played.

    Attributes:
        id: the digest of all that it follows from.
        entries: team -> the entry that plays it.
        seed: of the game.
        round: in which it is played, from 1.
    """

    id: str
    entries: dict[str, str]
    seed: int
    round: int


class Row(TypedDict):
    """A game that was played.

    Attributes:
        id, round, seed: see `Fixture`.
        entries: team -> the entry that played it.
        winner: the team that won; None: neither.
        reason: why it ended.
        truncated: whether it stopped before it was over.
        turns: how many were played.
        scores: team -> its score.
        faults: team -> by which fault it lost, a key of `FAULTS`.
        details: team -> what the fault was, in words.
    """

    id: str
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


def own_seed(seed: int, team: str) -> int:
    """Return the seed of what an entry draws, from which that of the game does not follow."""
    return int.from_bytes(hashlib.sha256(f"tournament/{seed}/{team}".encode()).digest()[:7], "big")


def _stay(states: Mapping[str, dict[str, Any]]) -> None:
    """Let agents stay where they are: a plan."""
    for state in states.values():
        state["action"] = (0.0, 0.0, 0.0) if isinstance(state["curr_pos"], tuple) else state["curr_pos"]


class _Side:
    """The team that an entry plays: its plan in the game, and its first fault."""

    def __init__(self, player: Player, ctx: Context, team: str, start: Mapping[str, Any]) -> None:
        self._player, self._ctx, self._team = player, ctx, team
        self._is_python = not player.launcher.entry.command
        self._asked = 0
        self.fault: Fault | None = None
        try:
            player.begin(self._message("start", start))
        except Faulty as error:
            self.fault = error.fault

    def plan(self, states: dict[str, dict[str, Any]]) -> None:
        """Ask the entry what its agents do; without an answer they stay, and the game is over."""
        try:
            if self.fault is None:
                self._take(states, self._answer(states))
        except Faulty as error:
            self.fault = error.fault
        if self.fault is not None:
            _stay(states)

    def _answer(self, states: dict[str, dict[str, Any]]) -> Answer:
        self._asked += 1
        agents = {name: _sent(state) for name, state in states.items()}
        shares = any("team_memory" in state for state in states.values())
        question: dict[str, Any] = {"question": self._asked, "agents": agents, "shares_memory": shares}
        if not self._is_python:
            question = {"question": self._asked, "agents": {name: _as_json(one) for name, one in agents.items()}}
        return self._player.ask(self._message("turn", question), self._asked)

    def _take(self, states: dict[str, dict[str, Any]], answer: Answer) -> None:
        for name in (*answer.actions, *answer.outbox):
            if name not in states:
                raise Faulty("illegal", f"it decided for {shown(name)}, which is not one of its living agents")
        for name, messages in answer.outbox.items():
            if "outbox" not in states[name]:
                raise Faulty("illegal", "it sent a message, and the game has no channels")
            states[name]["outbox"] += messages
        for name, action in answer.actions.items():
            states[name]["action"] = action

    def _message(self, kind: str, fields: Mapping[str, Any]) -> bytes:
        return framed({"type": kind, **fields}) if self._is_python else line_of(kind, fields) + b"\n"

    def find_illegal(self) -> None:
        """Note as a fault what the game has refused to do for its agents."""
        agents = self._ctx.agent.agents
        for error in self._ctx.game.errors:
            if self.fault is None and agents[error["agent"]].team == self._team:
                self.fault = Fault("illegal", f"{error['agent']} in turn {error['turn']}: {error['message']}")


def _forfeit(sides: Mapping[str, _Side]) -> tuple[str | None, str]:
    """Return who wins a game in which an entry has a fault, and why it ended."""
    faults = {team: side.fault.kind for team, side in sides.items() if side.fault is not None}
    others = [team for team in sides if team not in faults]
    return (others[0] if others else None), ", ".join(
        f"{team} lost by its fault: {faults[team]}" for team in sorted(faults)
    )


class _Referee:
    """A rule that ends the game when an entry has a fault."""

    def __init__(self, sides: Mapping[str, _Side]) -> None:
        self._sides = sides
        self.__name__ = "referee"

    def __call__(self, ctx: Context) -> None:
        for side in self._sides.values():
            side.find_illegal()
        if any(side.fault for side in self._sides.values()):
            winner, reason = _forfeit(self._sides)
            ctx.game.end(reason, winner=winner)


def play(
    scenario: Scenario, fixture: Fixture, launchers: Mapping[str, Launcher], record: Path | None = None
) -> tuple[Row, dict[str, bytes]]:
    """Play a game, and return its row, and by team what the entry has written besides its answers.

    Args:
        scenario: of the game.
        fixture: who plays which team, with which seed.
        launchers: of the entries, by name.
        record: the file of a recording; None: it is not recorded.
    """
    with ExitStack() as open_things:
        ctx = open_things.enter_context(scenario.build(fixture.seed))
        game = ctx.game
        game.on_illegal, game.time_budget = "stay", None
        players = {team: open_things.enter_context(Player(launchers[one])) for team, one in fixture.entries.items()}
        sides = {
            team: _Side(player, ctx, team, _start(ctx, team, fixture, player.launcher))
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
        round=fixture.round,
        seed=fixture.seed,
        entries=fixture.entries,
        winner=winner if winner in fixture.entries else None,
        reason=reason,
        truncated=result.truncated and not faults,
        turns=result.turns,
        scores={team: float(result.scores.get(team, 0)) for team in fixture.entries},
        faults={team: fault.kind for team, fault in faults.items()},
        details={team: _said(players[team], fault.detail)[:MOST_SAID] for team, fault in faults.items()},
    )
    return row, {team: _said(player, player.log.decode(errors="replace")).encode() for team, player in players.items()}


def trial(scenario: Scenario, seed: int, sides: tuple[str, str], launcher: Launcher) -> str | None:
    """Ask an entry once, in a game in which the other side stays, and return why it cannot play; None: it can.

    Args:
        scenario: of the game.
        seed: of the game.
        sides: the team that it plays, and the other one.
        launcher: of the entry.
    """
    team, other = sides
    with ExitStack() as open_things:
        ctx = open_things.enter_context(scenario.build(seed))
        ctx.game.on_illegal, ctx.game.time_budget = "stay", None
        player = open_things.enter_context(Player(launcher))
        fixture = Fixture("", {team: launcher.entry.name}, seed, 0)
        side = _Side(player, ctx, team, _start(ctx, team, fixture, launcher))
        ctx.game.command(team, side.plan)
        ctx.game.command(other, _stay)
        ctx.game.add(_Referee({team: side}))
        if side.fault is None:
            ctx.game.run(max_turns=1)
        fault = side.fault
    if fault is None:
        return None
    reason = f"{fault.kind}: {_said(player, fault.detail)}"
    if fault.kind == "exit":
        lines = _said(player, player.log.decode(errors="replace")).splitlines()
        telling = [line for line in lines if _TELLING.search(line)] or lines
        reason += f" ({telling[-1].strip()})" if telling else ""
    return printable_line(reason)[:MOST_SAID]


def _said(player: Player, text: str) -> str:
    """Return a text about an entry, printable, and without folders and addresses that change from run to run."""
    entry = player.launcher.entry
    text = text.replace(player.scratch, "~")
    if entry.copy:
        text = text.replace(entry.copy, entry.published).replace(f"{private_package(Path(entry.copy))}.", "")
    return without_address(printable(text))


def _start(ctx: Context, team: str, fixture: Fixture, launcher: Launcher) -> dict[str, Any]:
    """Return what an entry is given before the first turn: its team, all agents by name and team, its own seed."""
    start = {
        "team": team,
        "seed": own_seed(fixture.seed, team),
        "max_turns": ctx.game.max_turns,
        "move_seconds": launcher.allowed.move_s,
    }
    if not launcher.entry.command:
        return {**start, "agents": {agent.name: _keywords(agent, team, ctx) for agent in ctx.agent.agents.values()}}
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


def _keywords(agent: Any, team: str, ctx: Context) -> dict[str, Any]:  # Any: an agent, with attributes of its own
    """Return how an entry's context creates an agent: its own as they are, the others on the first node of the map."""
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


def _sent(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of a state is data: an entry gets nothing else."""
    sent = {key: value for key, value in state.items() if key not in _OWN}
    sent["facts"] = plain_subset(state["facts"])
    sent["sensor"] = {
        name: (kind, to_plain(data) if kind is SensorType.CUSTOM else data)
        for name, (kind, data) in state["sensor"].items()
    }
    return sent


def _as_json(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same as what JSON can hold; sensors are pairs of the name of their kind and what they show."""
    sensors = {name: [kind.name, as_json(to_plain(data))] for name, (kind, data) in state["sensor"].items()}
    rest = {key: as_json(to_plain(value)) for key, value in state.items() if key != "sensor"}
    return {**rest, "sensor": sensors}
