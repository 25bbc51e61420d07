"""The result of a game: read, show, save and load it; and collect values while a game is played."""

import json
import os
from collections import Counter
from collections.abc import Callable, Container, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_function_of, as_key, as_path, as_target, as_text, refuse_suffix
from gamms.compat import Surface
from gamms.errors import BadFile, Duplicate, UnknownName, nearest
from gamms.folders import as_kind, read_bytes, write_whole
from gamms.game.strategy_specs import draw_members
from gamms.ir.game_state import CollectedNumbers, cut_log, describe_reason, is_shown_number
from gamms.ir.graph import find_usable_edges, list_forbidden_paths, split_mode
from gamms.ir.messages import make_message_table
from gamms.ir.tables import add_latlon, make_frame, make_table
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.text import make_printable_line, reason, shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.graph_engine import IGraphEngine
from gamms.typing.logger import ILogger

if TYPE_CHECKING:
    import pandas as pd

_LONG = 1e15  # numbers from here on are printed in full
_COUNTS = ("alive", "moves", "blocked", "illegal", "errors", "overruns")  # of an agent


def list_opponents(deciders: Iterable[tuple[Hashable, object]], seed: int) -> dict[str, dict[Hashable, str]]:
    """Return the entry `opponents` of a provenance, or nothing if no team plays a pool; see `draw_members`."""
    drawn = draw_members(deciders, seed)
    return {"opponents": drawn} if drawn else {}


@dataclass(eq=False, repr=False)
class Result(Surface):
    """The result of one game, finished or not.

    Two results are equal if everything except timings and provenance is equal. `print(result)` and notebooks show a
    table.

    Attributes:
        turns: the number of turns played.
        scores: key -> score; rules choose the keys.
        winner: the winner by the rules; None: no winner.
        reason: the reason of the end: given by a rule, or "max_turns", "closed" (the context ended) or "unfinished".
        truncated: whether the game was stopped before its end.
        events: the events emitted by rules, in order: each with `turn` and `kind`.
        agents: name -> team, alive, node (at the end), moves (turns with a move), blocked (turns in which a conflict, a
            rule or a closed edge stopped the move), illegal, errors, overruns (counts).
        errors: errors of strategies, in order: turn, agent, kind ("illegal", "error", "overrun"), message.
        deeds: deeds of agents, in order: turn, agent, deed, at (the node), and the fields of the deed.
        messages: messages that agents sent by channels, in order: turn, channel, sender, to, body, size (bytes), heard
            and overheard (agent -> the turn in which it gets the message), lost, jammed (agents).
        timings: seconds by phase: decide (including sensing), resolve, apply, rules, draw. If strategies search, for
            example `gamms.planning.mcts`, also two counts: `searched`, the decisions made by a search, and `given_up`,
            the decisions left to the script for lack of time.
        seed: the seed of the context.
        collected: name -> columns of collected values.
        provenance: further data to repeat the game: the versions of `gamms`, `python` and `numpy`, the `scenario` (None
            if a program built the game), `strategies` (agent -> module and name, at the end of the game), and
            `opponents` (team -> the member that it has drawn), if teams play pools of strategies.
    """

    _called = "result"

    turns: int
    scores: dict[Any, float]
    winner: Any
    reason: str
    truncated: bool
    events: list[dict[str, Any]]
    agents: dict[str, dict[str, Any]]
    errors: list[dict[str, Any]]
    timings: dict[str, float]
    seed: int
    deeds: list[dict[str, Any]] = field(default_factory=list)
    messages: list[dict[str, Any]] = field(default_factory=list)
    collected: dict[str, dict[str, list[Any]]] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def _make_later(self, make: Callable[[], Mapping[str, Any]]) -> None:
        """Set `agents` and `provenance` when one of them is read first, to what the function returns."""
        del self.agents
        del self.provenance
        self._make = make

    if not TYPE_CHECKING:  # type checkers know the attributes

        def __getattr__(self, name: str) -> Any:
            make = vars(self).get("_make")
            for key, value in make().items() if make is not None else ():
                vars(self).setdefault(key, value)  # others may have set it since
            vars(self).pop("_make", None)
            return vars(self)[name] if name in vars(self) else super().__getattr__(name)

    def __getstate__(self) -> dict[str, Any]:
        """Return all attributes, also those that are made when they are read first."""
        _ = self.agents
        return vars(self)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; keys that are not strings are converted to text."""
        plain: dict[str, Any] = _make_plain({name: getattr(self, name) for name in self.__dataclass_fields__})
        return plain

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result as JSON, without timings: the same game gives the same bytes. An existing file is replaced.

        Raises:
            MissingFolder: the folder does not exist.
            BadValue: the suffix is that of a recording, a picture, or another kind of file.
        """
        file = as_target(path)
        refuse_suffix(file, "A result", ".json")
        plain = {"format": _FORMAT, **self.to_dict()}
        del plain["timings"]
        write_whole(file, (json.dumps(plain, indent=1) + "\n").encode(), through_links=True)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Result":
        """Read a result written by `save`, `gamms run` or `gamms demo`; no code named in the file is imported.

        Timings are empty, and keys that were not strings are text.

        Raises:
            BadFile (ValueError): the file is not a result; the message says where.
            TooLarge (ValueError): it would take more memory than is allowed.
            OSError: it cannot be read.
        """
        file: Path = as_path(path, "path")
        refuse_above(file.stat().st_size * _BYTES_PER_LETTER, f"Reading {str(file)!r}")
        try:
            plain = json.loads(read_bytes(file.resolve()))
        except (ValueError, RecursionError) as error:
            raise BadFile(f"{str(file)!r} is not a result: {reason(error)}.") from None
        if not isinstance(plain, dict) or plain.get("format") != _FORMAT:
            raise BadFile(f"{str(file)!r} is not a result: it has no 'format' {_FORMAT!r}. Result.save writes one.")
        try:
            as_kind(plain, _StoredResult)
        except BadFile as error:
            raise BadFile(f"{str(file)!r} is not a result: {error}.") from None
        if any(len({*map(len, table.values())}) > 1 for table in plain["collected"].values()):
            raise BadFile(f"{str(file)!r} is not a result: 'collected' has columns of different lengths.")
        return cls(timings={}, **{name: plain[name] for name in _StoredResult.__annotations__})

    def table(self, name: str, *, lat_lon: IGraphEngine | None = None) -> dict[str, "np.ndarray[Any, Any]"]:
        """Return one table as columns of equal length, in a form that pandas and polars accept.

        The tables `agents`, `teams`, `scores`, `errors`, `deeds`, `messages` and `events` always exist; each kind of
        event and each collected name is a table, too. docs/game.md lists the columns.

        Args:
            name: the name of the table.
            lat_lon: the map, `ctx.graph`, to add the columns `lat` and `lon` of the nodes.

        Raises:
            UnknownName (KeyError): there is no such table.
            BadValue (ValueError): `lat_lon` is given, but the table has no nodes or the map has no CRS.
        """
        tables = self._make_tables()
        if as_key(name, "The name of a table") not in tables:
            raise UnknownName("table", name, tables)
        table = make_table(tables[name])
        return table if lat_lon is None else add_latlon(table, lat_lon.columns())

    def to_pandas(self, name: str, *, lat_lon: IGraphEngine | None = None) -> "pd.DataFrame":
        """Return one table as a pandas data frame; see `table`.

        Raises:
            UnknownName (KeyError): there is no such table.
            MissingExtra (ImportError): pandas is not installed.
        """
        return make_frame(self.table(name, lat_lon=lat_lon))

    def _make_tables(self) -> dict[str, Any]:
        events: dict[str, Any] = {}
        for event in self.events:
            events.setdefault(event["kind"], []).append({key: event[key] for key in event if key != "kind"})
        return {
            **events,
            **self.collected,
            "events": {key: [event[key] for event in self.events] for key in ("turn", "kind")},
            "errors": self.errors or {"turn": [], "agent": [], "kind": [], "message": []},
            "deeds": self.deeds or {"turn": [], "agent": [], "deed": [], "at": []},
            "messages": make_message_table(self.messages),
            "scores": {"of": list(self.scores), "score": list(self.scores.values())},
            "agents": [{"agent": name, **summary} for name, summary in self.agents.items()],
            "teams": self._list_team_rows(),
        }

    def _list_team_rows(self) -> dict[str, list[Any]]:
        """Return one row per team: the numbers of its agents, living agents and moves, and its score."""
        by_team: dict[Any, list[dict[str, Any]]] = {}
        for one in self.agents.values():
            by_team.setdefault(one["team"], []).append(one)
        return {
            "team": list(by_team),
            "agents": [len(agents) for agents in by_team.values()],
            "alive": [sum(one["alive"] for one in agents) for agents in by_team.values()],
            "moves": [sum(one["moves"] for one in agents) for agents in by_team.values()],
            "score": [self.scores.get(team, 0) for team in by_team],
        }

    def row(self) -> dict[str, Any]:
        """Return a summary of the game as one row of plain values, for tables of many games.

        Its keys are reason, winner, truncated and turns; `opponent.<team>`, the member of its pool that a team has
        drawn; `score.<team>` and other scores; counts by team:
        `agents.<team>`, `alive.<team>`, `moves.<team>`, `blocked.<team>`, `illegal.<team>`, `errors.<team>` and
        `overruns.<team>`; and `collector.<name>`, the last value of each collector of the game.
        """
        teams = list(dict.fromkeys(one["team"] for one in self.agents.values()))
        row = {
            "reason": self.reason,
            "winner": _make_plain(self.winner),
            "truncated": self.truncated,
            "turns": self.turns,
        }
        row |= {f"opponent.{team}": name for team, name in self.provenance.get("opponents", {}).items()}
        row |= {f"score.{of}": _make_plain(score) for of, score in ({**dict.fromkeys(teams, 0), **self.scores}).items()}
        for team in teams:
            agents = [one for one in self.agents.values() if one["team"] == team]
            row[f"agents.{team}"] = len(agents)
            row |= {f"{count}.{team}": sum(one[count] for one in agents) for count in _COUNTS}
        of_game = {name: table["value"] for name, table in self.collected.items() if "agent" not in table}
        return row | {
            f"collector.{name}": _make_plain(values[-1]) if values else None for name, values in of_game.items()
        }

    def headline(self) -> str:
        """Return the winner, the number of turns and the reason in one line."""
        end = "no team won" if self.winner is None else f"{self.winner} won"
        turns = "1 turn" if self.turns == 1 else f"{self.turns} turns"
        return make_printable_line(f"{end} after {turns}: {describe_reason(self.reason)}")

    def _list_shown_tables(self) -> Iterator[list[tuple[str, ...]]]:
        """Yield the tables for `print` and notebooks, each with its header."""
        teams = self._list_team_rows()
        yield [tuple(teams), *(tuple(map(_format_cell, row)) for row in zip(*teams.values(), strict=True))]
        others = [
            (_format_cell(of), _format_cell(score)) for of, score in self.scores.items() if of not in teams["team"]
        ]
        if others:
            yield [("", "score"), *others]

    def __repr__(self) -> str:
        scores = shown(dict(self.scores))
        end = f"winner={shown(self.winner)}, reason={shown(self.reason)}"
        return f"Result(turns={self.turns}, {end}, scores={scores}, seed={self.seed})"

    def __str__(self) -> str:
        """Return the headline and a table of the teams."""
        lines = [f"{self.headline()} (seed {self.seed})"]
        for rows in self._list_shown_tables():
            widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
            lines.append("")
            for first, *others in rows:
                cells = [first.ljust(widths[0]), *map(str.rjust, others, widths[1:])]
                lines.append("  ".join(cells).rstrip())
        if self.errors:
            kinds = ", ".join(
                f"{number} {kind}" for kind, number in Counter(one["kind"] for one in self.errors).items()
            )
            lines += ["", f"What strategies did wrong (result.errors): {make_printable_line(kinds)}"]
        if self.provenance.get("information") == "full":
            lines += ["", "Strategies that look ahead had full information."]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the headline and the tables as HTML, for notebooks."""
        parts = [f"<b>{escape(self.headline())}</b> (seed {self.seed})"]
        for header, *rows in self._list_shown_tables():
            cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows]
            head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
            parts.append(f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>")
        return "".join(parts)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Result):
            return NotImplemented
        compared = [name for name in self.__dataclass_fields__ if name not in ("timings", "provenance")]
        return all(_make_plain(getattr(self, name)) == _make_plain(getattr(other, name)) for name in compared)

    __hash__ = None  # type: ignore[assignment] # it is mutable


class _Event(TypedDict):
    turn: int
    kind: str


class _Error(_Event):
    agent: str
    message: str


class _Agent(TypedDict):
    alive: bool
    moves: int
    team: Any


class _Deed(TypedDict):
    turn: int
    agent: str
    deed: str


class _Message(TypedDict):
    turn: int
    channel: str
    sender: str
    to: Any
    body: Any
    size: int
    heard: dict[str, Any]
    overheard: dict[str, Any]
    lost: list[Any]
    jammed: list[Any]


class _CollectedColumns(TypedDict):
    turn: list[Any]
    value: list[Any]


class _StoredResult(TypedDict):
    """A result in a file."""

    turns: int
    scores: dict[str, Any]
    winner: Any
    reason: str
    truncated: bool
    events: list[_Event]
    agents: dict[str, _Agent]
    errors: list[_Error]
    deeds: list[_Deed]
    messages: list[_Message]
    seed: int
    collected: dict[str, _CollectedColumns]
    provenance: dict[str, Any]


def _format_cell(value: object) -> str:
    """Return the text of a table cell."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return format(value, "g") if is_number and abs(value) < _LONG else make_printable_line(str(value))  # type: ignore[arg-type] # a number


# -- files ------------------------------------------------------------------------------------------------------


def summarize_errors(errors: Sequence[Mapping[str, Any]]) -> str:
    """Return a summary of the errors of strategies in one line; there is at least one error."""
    kinds = ", ".join(f"{number} {kind}" for kind, number in sorted(Counter(one["kind"] for one in errors).items()))
    first = errors[0]
    message = make_printable_line(first["message"])[:200].rstrip(".")
    return (
        f"Strategies erred ({kinds}), that of agent {first['agent']!r} first, in turn {first['turn']}: "
        f"{message}{'' if message.endswith('?') else '.'} See result.errors."
    )


def warn_of_idle(
    teams: Iterable[Hashable], decided: Container[Hashable], named: set[Hashable], warn: Callable[[str], object]
) -> None:
    """Log a warning that lists teams for which nothing decides.

    Args:
        teams: all teams; None: agents without one.
        decided: the teams that have a strategy or a plan.
        named: the teams that were named before; those that are named now are added.
        warn: logs a warning.
    """
    idle = [team for team in dict.fromkeys(teams) if team not in decided and team not in named]
    named.update(idle)
    if idle:
        listed = ", ".join("agents without a team" if team is None else f"team {shown(team)}" for team in idle)
        warn(
            f"No strategy decides for: {listed}. They stay where they are. Give them a strategy, or "
            "gamms.strategies.stay if this is intended."
        )


_MOST_NAMED = 3  # agents, in a warning
_IS_NAMED = ("agents that cannot move",)


def warn_of_stuck_agents(
    ctx: HostContext,
    named: set[Hashable],
    seeds_at: Mapping[str, Mapping[int, int]] | None = None,
    *,
    has_learners: bool = False,
) -> None:
    """Log a warning with agents that decide but cannot move on the map as it is, once.

    Args:
        ctx: the context.
        named: what was named before; this warning is added.
        seeds_at: agent -> the nodes on which it begins in several games, each with the seed of a game; None: it is
            where the context has it.
        has_learners: whether agents without a strategy get their actions from outside.
    """
    found = [] if _IS_NAMED in named else [*_list_stuck_agents(ctx, seeds_at or {}, has_learners), *_list_traps(ctx)]
    if found:
        named.add(_IS_NAMED)
        more = f" and {len(found) - _MOST_NAMED:,} more" if len(found) > _MOST_NAMED else ""
        ctx.logger.warning(
            f"Agents cannot move: {', '.join(found[:_MOST_NAMED])}{more}. Start them elsewhere, such as at "
            "ctx.graph.place(…, mode=…), open roads, load a larger map, or give a speed; or give them "
            "gamms.strategies.stay if this is intended."
        )


def _list_stuck_agents(
    ctx: HostContext, seeds_at: Mapping[str, Mapping[int, int]], has_learners: bool
) -> Iterator[str]:
    block = ctx.agent.block
    columns = ctx.graph.columns()
    exits = {}  # mode -> ids of the nodes from which an edge leads away
    for mode in {*block.modes}:
        leads_away = columns.sources != columns.targets
        if mode is not None:
            leads_away &= find_usable_edges(columns, mode)
        exits[mode] = {*columns.node_ids[columns.sources[leads_away]].tolist()}
    flyers = {*block.flyers}
    strategies = ctx.agent.storage.list_strategies()
    agents = zip(block.names, strategies, block.teams, block.get_ids(block.node), strict=True)
    for row, (name, strategy, team, node) in enumerate(agents):
        is_asked = strategy is not None or has_learners or team in ctx.game.plans
        if not (is_asked and block.alive[row]) or getattr(strategy, "__name__", "") == "stay":
            continue
        mode = block.modes[row]
        starts = seeds_at.get(name, {node: None})
        stuck_at = [] if row in flyers or ctx.game.legal == "any" else [*starts.keys() - exits[mode]]
        if stuck_at:
            whose = "" if mode is None else f" for its mode {split_mode(mode)[0]!r}"
            when = "" if len(starts) == 1 else f", where the seed {starts[stuck_at[0]]} lets it begin"
            yield f"{name!r} (no open edge{whose} leads away from node {stuck_at[0]}{when})"
        elif block.speed[row] == 0.0:
            yield f"{name!r} (its speed is 0)"


def _list_traps(ctx: HostContext) -> Iterator[str]:
    columns = ctx.graph.columns()
    for mode in sorted({mode for mode in ctx.agent.block.modes if mode is not None and split_mode(mode)[1]}):
        paths = list_forbidden_paths(columns).get(split_mode(mode)[0], [])
        rows = [tuple(kernels.find_rows(columns.edge_ids, np.array(path), columns.edge_order)) for path in paths]
        ends = (columns.sources, columns.targets, columns.lengths)
        edges = kernels.find_edges_without_turn(*ends, find_usable_edges(columns, mode), rows)
        if len(edges) and paths:
            yield f"any {mode!r} after edge {columns.edge_ids[edges[0]]} (no legal turn, as after {len(edges):,} edges)"


MANY_TURNS = 100_000  # after which a game that nothing limits may never end


def warn_of_no_end(logger: ILogger) -> None:
    """Log a warning that games which nothing limits have gone on for `MANY_TURNS` turns."""
    logger.warning(
        f"After {MANY_TURNS:,} turns no rule has ended the game, and nothing limits its turns: it may never end. Give "
        "run(max_turns=…), or set max_turns of the game or scenario."
    )


def find_misspelled_names(keys: Iterable[object], winner: object, names: Iterable[object]) -> list[str]:
    """Return a warning for each key of scores, and for a winner, that resembles the name of a team or an agent."""
    named = dict.fromkeys(names)
    others = sorted(key for key in keys if isinstance(key, str) and key not in named)[:_MOST_SCORES]
    wrong = {f"Scores of {shown(key)} are of": key for key in others}
    if isinstance(winner, str) and winner not in named:
        wrong[f"The winner {shown(winner)} is"] = winner
    hints = {what: nearest(name, named) for what, name in wrong.items()}
    return [f"{what} no team and no agent.{hint}" for what, hint in hints.items() if hint]


_MOST_SCORES = 16  # the maximum number of keys that are checked
_FORMAT = "gamms result 1"
_BYTES_PER_LETTER = 40  # of memory for each byte of JSON; the worst case is `{"":0}`


def _make_plain(value: object) -> Plain:
    """Return a value in a form that JSON can store."""
    if isinstance(value, np.generic):  # before numbers and text: some of its scalars are these, too
        return value.item()
    if value is None or isinstance(value, (str, int, float)):
        return value
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): _make_plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_make_plain(one) for one in value]
    if isinstance(value, (set, frozenset)):
        return sorted((_make_plain(one) for one in value), key=str)
    return value.tolist() if isinstance(value, np.ndarray) else str(value)


class Collector(NamedTuple):
    """A collector; see `Game.collect`.

    Attributes:
        fn, every, per: the arguments of `Game.collect`.
        columns: the values so far.
        marked: column -> the number of entries that snapshots need.
    """

    fn: Callable[[Any], Any]
    every: int
    per: str
    columns: dict[str, list[Any]]
    marked: dict[str, int]


CollectorMark = tuple[Collector, dict[str, tuple[list[Any], int]]]
"""A collector and its columns at a moment: each list with its length."""


class Collectors:
    """The collectors of one game.

    Attributes:
        by_name: the collectors.
    """

    def __init__(self) -> None:
        self.by_name: dict[str, Collector] = {}
        self._replaceable: frozenset[str] = frozenset()

    @contextmanager
    def allow_replacing(self, names: frozenset[str]) -> Iterator[None]:
        """Let functions that add collectors with these names add them again within the block, in the same places."""
        self._replaceable = names
        try:
            yield
        finally:
            self._replaceable = frozenset()

    def add(self, name: str, fn: Callable[[Any], Any], every: int, per: str) -> None:
        """Add a collector; see `Game.collect`."""
        if name in self.by_name and name not in self._replaceable:
            raise Duplicate("a collector", name)
        as_choice(as_text(per, "per"), "per", ("game", "agent"))
        as_function_of(fn, f"Collector {shown(name)}", "the context" if per == "game" else "an agent")
        names = ("turn", "value") if per == "game" else ("turn", "agent", "value")
        columns: dict[str, list[Any]] = {column: [] for column in names}
        self.by_name[name] = Collector(fn, every, per, columns, dict.fromkeys(names, 0))

    def collect(self, turn: int, ctx: HostContext, agents: Callable[[], Sequence[IAgent]]) -> None:
        """Collect the values of a turn; `agents` returns the living agents."""
        for fn, every, per, columns, _ in self.by_name.values():
            if turn % every:
                continue
            for agent in agents() if per == "agent" else (None,):
                value = deepcopy(fn(ctx if agent is None else agent))
                columns["turn"].append(turn)
                if agent is not None:
                    columns["agent"].append(agent.name)
                columns["value"].append(value)

    def list_last_numbers(self, turn: int) -> dict[str, CollectedNumbers]:
        """Return the numbers among the last values that were due up to a turn; see `GameState.collected`."""
        numbers: dict[str, CollectedNumbers] = {}
        for name, one in self.by_name.items():
            turns = one.columns["turn"]
            due = turn - turn % one.every
            begin = len(turns)
            while begin and turns[begin - 1] == due:
                begin -= 1
            values = map(_as_number, one.columns["value"][begin:])
            names = one.columns["agent"][begin:] if one.per == "agent" else [""]
            found = {key: value for key, value in zip(names, values, strict=False) if value is not None}
            if found:
                numbers[name] = found if one.per == "agent" else found[""]
        return numbers

    def get_tables(self) -> dict[str, dict[str, list[Any]]]:
        """Return the collected columns, by name."""
        return {name: {key: list(column) for key, column in one.columns.items()} for name, one in self.by_name.items()}

    def copy_from(self, other: "Collectors", own: Callable[[Any], Any]) -> None:
        """Copy the collectors of another game; see `take_copies`."""
        self.take_copies(other.snapshot(), own)

    def take_copies(self, before: Mapping[str, CollectorMark], own: Callable[[Any], Any]) -> None:
        """Copy collectors of another game.

        Args:
            before: the result of `snapshot` in that game.
            own: returns the counterpart of a function in this game.
        """
        for name, (one, marks) in before.items():
            columns = {key: entries[:length] for key, (entries, length) in marks.items()}
            self.by_name[name] = one._replace(fn=own(one.fn), columns=columns, marked=dict.fromkeys(columns, 0))

    def snapshot(self) -> dict[str, CollectorMark]:
        """Return the collectors and their columns, for `restore`."""
        marks = {}
        for name, one in self.by_name.items():
            one.marked.update((key, len(column)) for key, column in one.columns.items())
            marks[name] = one, {key: (column, len(column)) for key, column in one.columns.items()}
        return marks

    def restore(self, before: dict[str, CollectorMark]) -> None:
        """Restore the collectors and their columns."""
        self.by_name = {name: one for name, (one, _) in before.items()}
        for one, marks in before.values():
            for key, (entries, length) in marks.items():
                one.columns[key] = cut_log(one.columns[key], entries, length, one.marked[key])
                one.marked[key] = length


def _as_number(value: object) -> float | None:
    """Return a collected value if charts can show it; else None."""
    number = value.item() if isinstance(value, np.generic) else value
    return number if is_shown_number(number) else None
