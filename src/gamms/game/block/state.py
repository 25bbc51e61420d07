"""The state of the games of a batch: its columns, scores, events, errors, and the memory of rules and strategies."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from copy import copy, deepcopy
from functools import partial
from itertools import chain
from operator import itemgetter
from sys import float_info
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import rules, sight
from gamms.core.flight import TurnFlights
from gamms.errors import BadType, BadValue
from gamms.game.block.columns import AgentTable, PlayedGame
from gamms.game.decisions import COUNT_OF
from gamms.game.deeds import DeclaredDeeds
from gamms.game.messages import MessageTraffic
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.roads import MultiMapStreets, RoadMap
from gamms.game.movement.streets import StreetGraph
from gamms.game.slots import COUNTED
from gamms.game.strategy_specs import draw_shares
from gamms.ir.columns import Failure, GameLog
from gamms.ir.deeds import DeedLog
from gamms.ir.game_state import is_of_reader
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion
from gamms.ir.schema import NUMBERS
from gamms.kernels.draws import BitArray
from gamms.plain import MOST_WHOLE
from gamms.progress import TurnInterrupted
from gamms.readonly import copy_locked
from gamms.text import shown
from gamms.typing.actions import make_strategy

_MOST_EXACT = 1 << 53  # scores are floats in columns
STOPPED = {"tag": "other", "respawned": "agent", "eliminated": "agent"}  # event kind -> field of the stopped agent
NAMED = {"tag": "other", "take": "flag", "drop": "flag", "capture": "flag"}  # core event kind -> its second field
Arrays = dict[str, Any]  # name -> an array whose first axis is the games
Purpose = tuple[str | int, ...]
Drawn = tuple[str, Any]  # "purposes" and several purposes, "agents" and a purpose, or "pools" and None
Heading = tuple[float, float] | None
Columns = dict[Hashable, np.ndarray[Any, Any]]
"""The state of games as arrays (games, …) by name, as `Batch.columns` returns it."""


class Limit(NamedTuple):
    """The least and the largest value of a column."""

    least: float
    most: float

    def __str__(self) -> str:
        return (
            "numbers of at least 0 and less than 1" if self == _SHARE else f"numbers from {self.least} to {self.most}"
        )


_SHARE = Limit(0.0, float(np.nextafter(1.0, 0.0)))  # of an edge
_FINITE = Limit(-float_info.max, float_info.max)


def is_exact_float(score: object) -> bool:
    """Return whether a score is a number that float64 represents exactly."""
    return isinstance(score, float) or (type(score) is int and abs(score) <= _MOST_EXACT)


class Scores(dict[Hashable, FloatArray]):
    """The scores of all games: key -> float64 (games,), or objects if a game has a score that float64 cannot hold.

    Attributes:
        ranks: key -> (games,) positive integers that ascend in the order in which a game first set its keys; 0: not
            set in the game.
        are_floats: key -> (games,) whether a value other than an integer was added.
    """

    def __init__(self, games: int) -> None:
        super().__init__()
        self.ranks: dict[Hashable, IntArray] = {}
        self.are_floats: dict[Hashable, BoolArray] = {}
        self._games = games
        self._last_rank = 0

    @property
    def columns(self) -> tuple[dict[Hashable, Any], ...]:
        """The scores, ranks and float flags, key -> (games,) each."""
        return self, self.ranks, self.are_floats

    def add(self, key: Hashable, games: IntArray, points: float | FloatArray, order: IntArray | None = None) -> None:
        """Add points to the score of a key in games; a game may occur several times.

        Args:
            key: the key of the score.
            games: the numbers of the games.
            points: one number for all, or one for each entry of `games`.
            order: the position of each entry among additions to several keys, ascending; None: only this key.
        """
        if not isinstance(points, int) and np.isnan(np.asarray(points, np.float64)).any():
            raise BadType(f"The score of {shown(key)} must be a number, not {shown(points)}.")
        if key not in self:
            self._add_columns(key)
        if not isinstance(points, int):
            self.are_floats[key][games] = True
        np.add.at(self[key], games, points)
        ranks = self.ranks[key]
        new = np.flatnonzero(ranks[games] == 0)[::-1]  # reversed: the first entry of a game is written last
        ranks[games[new]] = self._last_rank + 1 + (0 if order is None else order[new])
        self._last_rank += order is None

    def add_several(self, keys: Sequence[Hashable], games: IntArray, of: IntArray, points: float | FloatArray) -> None:
        """Add points to the scores `keys[of[i]]` of `games[i]`, in this order; `games` and `of` are (pairs,)."""
        for number in np.flatnonzero(np.bincount(of)).tolist():
            those = np.flatnonzero(of == number)
            each = points if isinstance(points, int | float) else points[those]
            self.add(keys[number], games[those], each, those)
        self._last_rank += len(of)

    def take(self, keys: Sequence[Hashable], sums: FloatArray, first: IntArray, are_floats: BoolArray) -> None:
        """Set the scores to which points were added to the values that the core computed, (games, keys) each.

        Args:
            keys: the keys of the scores.
            sums: the scores.
            first: integers that ascend in the order in which points were first added in a game; -1 if none were.
            are_floats: whether a value other than an integer was added.
        """
        last = self._last_rank
        for number, key in enumerate(keys):
            is_set = first[:, number] >= 0
            if not is_set.any():
                continue
            if key not in self:
                self._add_columns(key)
            self[key][is_set] = sums[is_set, number]
            self.are_floats[key] |= are_floats[:, number]
            ranks = self.ranks[key]
            is_new = is_set & (ranks == 0)
            ranks[is_new] = last + 1 + first[is_new, number]
        self._last_rank = last + 2 + int(first.max(initial=0))

    def _add_columns(self, key: Hashable) -> None:
        """Add the columns of a new key."""
        self[key] = np.zeros(self._games, np.float64)
        self.are_floats[key] = np.zeros(self._games, np.bool_)
        self.ranks[key] = np.zeros(self._games, np.int64)

    def put(self, games: int | IntArray, scores: Mapping[Hashable, float]) -> None:
        """Set all scores of a game, or of several games to the same values."""
        for key in self:
            if key not in scores:
                self[key][games] = 0.0
                self.ranks[key][games] = 0
        for rank, (key, points) in enumerate(scores.items(), 1):
            if key not in self:
                self._add_columns(key)
            if not is_exact_float(points) and self[key].dtype != object:
                self[key] = self[key].astype(object)
            self[key][games] = points
            self.are_floats[key][games] = type(points) is not int
            self.ranks[key][games] = rank
        self._last_rank = max(self._last_rank, len(scores))

    def get_scores(self, game: int) -> dict[Any, Any]:
        """Return the scores of a game, key -> number, in the order in which the keys were first set."""
        ranks = [(column.item(game), key) for key, column in self.ranks.items()]
        return {key: self._get_score(key, game) for rank, key in sorted(ranks, key=itemgetter(0)) if rank}

    def _get_score(self, key: Hashable, game: int) -> Any:
        points = self[key].item(game)
        return points if self.are_floats[key].item(game) else int(points)


class EmittedEvents(NamedTuple):
    """Events of one kind that were emitted together.

    Attributes:
        kind: the kind of the events.
        games: (events,) the number of each event's game.
        turns: (events,) the turn of each event.
        fields: name -> a list with a value for each event.
    """

    kind: str
    games: IntArray
    turns: IntArray
    fields: Mapping[str, list[Any]]

    @classmethod
    def from_entry(cls, game: int, entry: Mapping[str, Any]) -> "EmittedEvents":
        """Return the event of one log entry of a game."""
        fields = {name: [value] for name, value in entry.items() if name not in ("turn", "kind")}
        return cls(entry["kind"], np.array([game]), np.array([entry["turn"]]), fields)


class CoreEvents(NamedTuple):
    """Events logged by the core; arrays are (events,). See `gamms.core.rules`.

    Attributes:
        games, turns, rules, kinds, agents, others: the numbers that the core logs.
        nodes: the ids of the nodes.
        flags: for each rule number, the teams of its flags.
        times: the time of each tag within its turn, from 0 to 1.
        has_times: whether the entries of tags have times.
    """

    games: IntArray
    turns: IntArray
    rules: IntArray
    kinds: IntArray
    agents: IntArray
    others: IntArray
    nodes: IntArray
    flags: tuple[tuple[Hashable, ...], ...]
    times: FloatArray
    has_times: bool

    def select(self, which: BoolArray | IntArray) -> "CoreEvents":
        """Return the events selected by a mask or by indices."""
        games, turns, rules, kinds, agents, others, nodes = (column[which] for column in self[:7])
        times = self.times[which]
        return CoreEvents(games, turns, rules, kinds, agents, others, nodes, self.flags, times, self.has_times)

    def make_entries(self, names: Sequence[str]) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the game and the log entry of each event; `names` are the agents' names."""
        columns = (*self[:7], self.times)
        for game, turn, rule, number, agent, other, node, time in zip(*map(np.ndarray.tolist, columns), strict=True):
            kind = rules.KINDS[number]
            entry = {"turn": turn, "kind": kind, "agent": names[agent]}
            if kind in NAMED:
                entry[NAMED[kind]] = names[other] if kind == "tag" else self.flags[rule][other]
            entry["node"] = node
            if self.has_times and kind == "tag":
                entry["time"] = turn - 1 + time
            yield game, entry


class EventLog(GameLog[EmittedEvents | CoreEvents]):
    """The log of the events of all games."""

    def show(self, game: int, entries: list[dict[str, Any]]) -> None:
        """Set the log of a game to a list, which is not copied."""
        self._of_game[game] = entries

    def add(self, kind: str, games: IntArray, turns: IntArray, fields: Mapping[str, list[Any]]) -> None:
        """Log events, one for each entry of `games`; the events of a game are in order."""
        self._pending.append(EmittedEvents(kind, games, turns, fields))

    def take(self, events: CoreEvents) -> None:
        """Log events of games in the core."""
        self._pending.append(events)

    def take_new(self, read: IntArray, games: IntArray) -> list[EmittedEvents]:
        """Return the events of games that were not read yet, game by game, and count them as read.

        `read` is the number of events that were read in each game of the batch.
        """
        found = []
        for game in games.tolist():
            entries = self.list_entries(game)
            found += [EmittedEvents.from_entry(game, entry) for entry in entries[read[game] :]]
            read[game] = len(entries)
        return found

    def _list_entries(self, noted: EmittedEvents | CoreEvents) -> Iterator[tuple[int, dict[str, Any]]]:
        if isinstance(noted, CoreEvents):
            yield from noted.make_entries(self._names)
            return
        kind, games, turns, fields = noted
        for number, turn, *values in zip(games.tolist(), turns.tolist(), *fields.values(), strict=True):
            yield number, {"turn": turn, "kind": kind, **dict(zip(fields, values, strict=True))}


class ErrorLog(GameLog[tuple[Failure, int]]):
    """The log of the errors of agents in all games."""

    def add(self, failure: Failure, turn: int) -> None:
        """Log an error in a turn."""
        self._pending.append((failure, turn))

    def _list_entries(self, noted: tuple[Failure, int]) -> Iterator[tuple[int, dict[str, Any]]]:
        failure, turn = noted
        name = self._names[failure.agent]
        yield failure.game, {"turn": turn, "agent": name, "kind": failure.kind, "message": failure.message}


def _tell_nobody(failure: Failure) -> None:
    """Do nothing; the default of `GameArrays.tell`."""


def _refuse_other_arrays(made: object, games: int) -> None:
    """Refuse the return value of `make` in `keep(key, make)` unless it is a dict of arrays (games, …)."""
    if not isinstance(made, dict):
        raise BadType(f"make of keep(key, make) returns name -> array, not {shown(made)}.")
    for name, array in made.items():
        if not isinstance(array, np.ndarray) or array.shape[:1] != (games,):
            raise BadValue(
                f"make({games}) of keep(key, make) returns arrays whose first axis is {games} games, and "
                f"{shown(name)} is {shown(array)}."
            )


def _as_made(first: Arrays, made: Arrays, is_first: BoolArray) -> Arrays:
    """Return the memory of a game that has begun, with the shapes and data types that `make` makes.

    Args:
        first: the memory of one game.
        made: the arrays that `make` made for one game.
        is_first: (agents,) which agents are in the game; the memory may have rows for these alone.

    Raises:
        BadValue: the memory has other names or shapes.
    """
    found = {name: _add_missing_rows(first.get(name), like, is_first) for name, like in made.items()}
    shapes, wanted = ({name: one.shape for name, one in those.items()} for those in (found, made))
    if shapes != wanted:
        raise BadValue(
            f"The arrays that were kept before the batch have the shapes {shapes}, not {wanted}, which make(1) of "
            "keep(key, make) makes."
        )
    for name, one in found.items():
        kind = made[name].dtype
        if one.dtype.kind not in "biuf" or (kind.kind in "iu" and not np.isfinite(one).all()):
            raise BadValue(f"The array {name!r} that was kept has {shown(one)}, which is not {kind}.")
    return {name: one.astype(made[name].dtype) for name, one in found.items()}


def _add_missing_rows(given: object, like: np.ndarray[Any, Any], is_first: BoolArray) -> np.ndarray[Any, Any]:
    """Return an array of one game, with the rows of `like` for the agents that are to come if it lacks them."""
    array = np.asarray(given)
    number = np.count_nonzero(is_first)
    if array.shape != (1, number, *like.shape[2:]) or like.shape[1:2] != is_first.shape:
        return array
    found = like.astype(array.dtype)
    found[:, is_first] = array
    return found


def _repeat_arrays(first: Arrays, games: int) -> Arrays:
    return {name: np.repeat(one, games, axis=0) for name, one in first.items()}


class MapData(NamedTuple):
    """The graph, the movement, and cached data of games with the same open roads, or of several maps.

    Attributes:
        streets: the graph; for several maps, the parts that do not differ.
        movement: the movement of the agents.
        shared: data computed for the map, or for all maps, by key.
    """

    streets: StreetGraph
    movement: Movement
    shared: dict[Hashable, Any]


class GameColumn(NamedTuple):
    """A column with a row for each game of a batch.

    Attributes:
        name: its name.
        kind: the type of its values.
        axis: "agent", "flyer" (an agent that flies), "team" or "game": a row has a value for each of them; or
            "walker" or "traveler", an agent in games with speeds in edges, or in metres; or "driver", an agent in games
            by edges in which some obey turn restrictions.
        begins: what a game begins with: the name of values of `GameArrays.reset`; "": zeros.
        is_loaded: whether `columns` returns the column, and `load` sets it.
        width: the numbers in a value; 0: it is one number.
        depends_on: the column without which its values mean nothing, and which is loaded with it; "": none.
    """

    name: str
    kind: type
    axis: str = "agent"
    begins: str = ""
    is_loaded: bool = False
    width: int = 0
    depends_on: str = ""


COLUMNS = (
    GameColumn("node", np.int64, begins="start", is_loaded=True),
    GameColumn("start", np.int64, begins="home", is_loaded=True),
    GameColumn("previous", np.int64, begins="start"),
    GameColumn("alive", np.bool_, begins="is_first", is_loaded=True),
    GameColumn("is_there", np.bool_, begins="is_first", is_loaded=True),
    GameColumn("plays", np.bool_, "team", "plays"),
    GameColumn("turn", np.int64, "game"),
    GameColumn("is_going", np.bool_, "game", "is_going"),
    GameColumn("stops", np.int64),
    GameColumn("blocked", np.bool_),
    GameColumn("placed", np.bool_),
    GameColumn("fell", np.bool_),
    GameColumn("position", np.float64, "flyer", "nowhere", is_loaded=True, width=3),
    GameColumn("previous_position", np.float64, "flyer", "nowhere", is_loaded=True, width=3),
    GameColumn("quat", np.float64, "flyer", "nowhere", is_loaded=True, width=4),
    GameColumn("start_position", np.float64, "flyer", "nowhere", width=3),
    GameColumn("wanted_position", np.float64, "flyer", "nowhere", width=3),
    GameColumn("wanted_quat", np.float64, "flyer", "nowhere", width=4),
    GameColumn("has_flown", np.bool_, "flyer"),
    GameColumn("begun", np.int64, "walker", "on_node", is_loaded=True),
    GameColumn("covered", np.float64, "walker", is_loaded=True),
    GameColumn("driven", np.int64, "driver", "on_node", is_loaded=True, depends_on="previous"),
    GameColumn("edge", np.int64, "traveler", "on_node", is_loaded=True),
    GameColumn("share", np.float64, "traveler", is_loaded=True),
    GameColumn("motion", np.int64, "traveler", is_loaded=True),
    GameColumn("time", np.float64, "game"),
)
"""The columns of all games. Starts, checkpoints, `columns` and `load` follow from these entries."""
_NO_AGENTS = np.zeros(0, np.int64)
_OF_SOME = ("flyer", "walker", "driver", "traveler")  # axes that are empty in most batches


NO_STOP = np.iinfo(np.int64).max


class BatchColumns:
    """The columns that the games on all maps of a batch share.

    Args:
        roster: the agents of each game.
        seeds: the seed of each game.
        movements: the movement of the agents on each map.

    Attributes:
        seeds: the seed of each game.
        movements: see above.
        node: (games, agents) the row of the current node of each agent.
        start: (games, agents) the row of its start node; -1: it was not in the game at the start.
        previous: (games, agents) rows of the previous nodes; up to date where plain functions are called.
        alive: (games, agents) whether each agent is alive.
        plays: (games, teams) whether each team has, or had, an agent in the game.
        is_there: (games, agents) whether each agent is in the game, dead or alive; the others have not entered yet.
        turn: (games,) the number of turns played.
        scores: key -> (games,) numbers.
        counts: name -> (games, agents) the numbers of moves, conflicts and illegal actions.
        errors: the errors of agents in all games.
        failures: failed decisions of functions in the current part of the turn, with the turn; the core logs them
            together with its own.
        deed_log: the deeds of all games.
        radio: the channels and their messages; None: the games have no channels.
        stop_at: (games,) the turn at which the last run stopped each game; `NO_STOP`: it had no limit.
        stop: (1,) 1: Ctrl-C was pressed in a turn that can be taken back.
        first_game: the number in the batch of game 0; not 0 for a game that has columns of its own.
        flyers: (flying agents,) their numbers in the roster, ascending.
        flights: the positions and flights of the flying agents; None: no agent flies.
        position, previous_position: (games, flying agents, 3) map units: where each is, and was before its last flight.
        quat: (games, flying agents, 4) the rotation of each.
        start_position, wanted_position, wanted_quat, has_flown: see `core.flight.TurnFlights`.
        begun: (games, agents) by edges, the rows of the nodes at the ends of partly covered edges; -1: none.
        covered: (games, agents) the covered shares of these edges.
        driven: (games, agents) by edges, what agents have driven that obey turns; see `core.by_edges.TrafficStates`.
        edge: (games, agents) by metres, the rows of the edges that agents are on; -1: none.
        share: (games, agents) the share of the edge behind each agent.
        motion: (games, agents) its motion on the edge, see `ir.progress.Motion`.
        time: (games,) the time in the turn, from 0 to 1, at which the asked agents decide.
        over: for each game, the reason, winner and truncation of its end; None while it continues.
        is_going: (games,) whether each game continues.
        stops: (games, agents) how often each agent was tagged, respawned or eliminated.
        headings: for each game, agent number -> heading set during the game; see `AgentBlock`.
        turning: (game, agent, heading) triples chosen in the current part of the turn.
        placed: (games, agents) whether a rule has placed the agent since its move in this turn.
        fell: (games, agents) whether a rule of the phase "deeds" has eliminated the agent in this turn.
        numbers: name -> (games, agents) additional numbers of agents; see `ir.schema.NUMBERS`.
        events: the events of all games.
        blocked: (games, agents) whether a conflict stopped the agent in the last turn.
        drawn: what follows from the seeds of games: kind and purpose -> (games, …); see `GameArrays.draw_rows`.
    """

    node: IntArray
    start: IntArray
    previous: IntArray
    alive: BoolArray
    is_there: BoolArray
    plays: BoolArray
    turn: IntArray
    is_going: BoolArray
    stops: IntArray
    blocked: BoolArray
    placed: BoolArray
    fell: BoolArray
    position: FloatArray
    previous_position: FloatArray
    quat: FloatArray
    start_position: FloatArray
    wanted_position: FloatArray
    wanted_quat: FloatArray
    has_flown: BoolArray
    begun: IntArray
    covered: FloatArray
    driven: IntArray
    edge: IntArray
    share: FloatArray
    motion: IntArray
    time: FloatArray

    def __init__(self, roster: AgentTable, seeds: Sequence[int], movements: Sequence[Movement]) -> None:
        self.seeds = list(seeds)
        self.movements = movements
        games = len(seeds)
        shape = (games, len(roster.names))
        self.flyers = np.flatnonzero(roster.flies)
        walks = any(one.depends_on_speeds and not one.by_metres for one in movements)
        travels = any(one.by_metres for one in movements)
        shapes = {
            "agent": shape,
            "flyer": (games, len(self.flyers)),
            "walker": shape if walks else (games, 0),
            "driver": shape if any(one.has_driven for one in movements) else (games, 0),
            "traveler": shape if travels else (games, 0),
            "team": (games, len(roster.teams)),
            "game": (games,),
        }
        for one in COLUMNS:
            setattr(self, one.name, np.zeros(shapes[one.axis] + (one.width,) * bool(one.width), one.kind))
        self.scores = Scores(games)
        self.counts = {name: np.zeros(shape, np.int64) for name in COUNTED}
        self.errors = ErrorLog(games, roster.names)
        self.over = list[dict[str, Any] | None]([None] * games)
        self.flights = self._make_flights() if len(self.flyers) else None
        self.numbers = {one.name: np.full(shape, one.initial, one.kind) for one in NUMBERS}
        self.headings: list[dict[int, Heading]] = [{} for _ in seeds]
        self.turning: list[tuple[int, int, Heading]] = []
        self.events = EventLog(games, roster.names)
        self.failures: list[tuple[Failure, int]] = []
        self.first_game = 0
        self.stop_at = np.full(games, NO_STOP)
        self.stop = np.zeros(1, np.int64)
        self.radio: MessageTraffic | None = None
        self.deed_log = DeedLog(games)
        self.drawn: dict[Drawn, np.ndarray[Any, Any]] = {}
        self._shared = (*vars(self), "_shared")  # the names of all these

    def _make_flights(self) -> TurnFlights:
        """Return the object of the core that moves flying agents in the columns."""
        columns: list[Any] = [getattr(self, one.name) for one in COLUMNS if one.axis == "flyer"]
        memory: list[Any] = [
            one.view(np.uint8 if one.dtype == np.bool_ else one.dtype).reshape(-1).data for one in columns
        ]
        return TurnFlights(self.flyers.astype(np.int64).data, *memory)

    def take_moves(self, other: "GameArrays", game: int, pairs: IntArray) -> None:
        """Take what agents have done in the present or last turn of a game; see `CoreGames.take_moves`."""
        mine, theirs = pairs
        for name in ("fell", "stops"):
            getattr(self, name)[0, mine] = getattr(other, name)[game, theirs]
        if self.motion.size and other.motion.size:
            stays = (self.edge[0, mine] < 0) == (other.edge[game, theirs] < 0)  # where it was before the function
            self.motion[0, mine[stays]] = other.motion[game, theirs[stays]]
        flying = [pair for pair in pairs.T.tolist() if pair[0] in self.flyers and pair[1] in other.flyers]
        for mine, theirs in flying:
            here, there = np.searchsorted(self.flyers, mine), np.searchsorted(other.flyers, theirs)
            for name in ("wanted_position", "wanted_quat", "has_flown"):
                getattr(self, name)[0, here] = getattr(other, name)[game, there]

    def run_until(self, game: int) -> int | None:
        """Return the turn at which the last run stops a game; None: it had no limit."""
        turn = int(self.stop_at[game])
        return None if turn == NO_STOP else turn

    def get_shared_values(self) -> dict[str, Any]:
        """Return the attributes that the state of the games on another map has, too, by name."""
        return {name: getattr(self, name) for name in self._shared}


class MapViewMixin:
    """Mix-in: a view or a turn of games on one map."""

    _state: "GameArrays"

    @property
    def map(self) -> int:
        """The number of the map of these games, as in `games.maps`; 0 if there is one."""
        return self._state.map_number

    @property
    def map_spec(self) -> Any:
        """A copy of the map's entry in `maps=`, or in the scenario; None if a program has built the game."""
        return deepcopy(self._state.map_spec)


class GameRow(NamedTuple):
    """What rules and strategies of the core remember of one game of a batch, as of a batch of this game alone.

    Attributes:
        roster, streets, stops, kept: see `GameArrays`; with one row.
        of_arrays: the part of `kept` that belongs to array functions.
    """

    roster: AgentTable
    streets: StreetGraph
    stops: IntArray
    kept: Mapping[Hashable, Arrays]
    of_arrays: dict[Hashable, Arrays]

    @classmethod
    def from_game(cls, state: "GameArrays", game: int) -> "GameRow":
        """Return a copy of the stored state of a game."""
        row = np.s_[game : game + 1]
        kept = {key: {name: one[row].copy() for name, one in several.items()} for key, several in state.kept.items()}
        of_arrays = {key: those for key, those in kept.items() if key not in state.of_core}
        return cls(state.roster, state.streets, state.stops[row].copy(), kept, of_arrays)

    @property
    def keeps_for_agents(self) -> bool:
        """Whether array functions may keep values of each agent, by its number in the roster."""
        return any(one.ndim > 1 for several in self.of_arrays.values() for one in several.values())


class GameArrays(BatchColumns):
    """The state of all games of a batch, seen from one map.

    Args:
        roster: the agents of each game.
        movement: the movement of the agents on the map.
        seeds: the seed of each game.
        start: (games, agents) the rows of the nodes on which games begin; None: they have begun.
        columns: the columns that the games on other maps have, too; None: new ones.
        others: the movements on the other maps, for new columns.

    Attributes:
        roster: the agents of each game.
        movement: the movement of the agents.
        streets: the graph on which agents move.
        tell: called with each failure, to inform the agent.
        doings: reads what agents are doing; None: no deed lasts. Any: its class imports this module.
        deeds: the deeds that agents may do besides moving.
        apart: number of a game -> a function that returns it, if only its context knows which nodes are legal, and
            where agents are.
        noted, noted_nodes: agent -> its sensors that are called individually for agents, or for nodes.
        sighted: (game, agent) -> sensor in `noted` -> the visible agents, and the rows of nodes where they appear.
        sighted_nodes: (game, agent) -> sensor in `noted_nodes` -> the rows of the visible nodes.
        covered: (game, agent) -> a sensor that turns with the agent -> rows of the nodes where it would show agents.
        find_game: returns a game in a context that shows it as it is now, by its number; None: no context does.
        reading: returns the context manager in which sensors are called.
        take_own_arrays: returns the arrays that functions called game by game keep under a key, with the number of each
            game; None: none are called.
        change_roads: closes or opens roads in games; see `RowContexts.change_roads`.
        roads: the open roads of each game.
        kept: the memory of rules and strategies: key -> name -> array (games, …).
        makers: the function that makes the first arrays of some games, by key.
        first: the memory of turns before the batch, as `kept`, but arrays of one game.
        of_core: the keys of `kept` that belong to rules and strategies of the core.
        unchecked: the keys of `kept` whose arrays came from a recording and were not compared with `make` yet.
        facts: the facts that rules have published, by name.
        shared: data computed once for all games, by key; independent of the state.
        asked: decisions by the steps of strategies that views have asked, by strategy and agents.
        searches: find the agents that plain sensors show, by the names of the sensors.
        now: data computed from the current state, by key; cleared when the state changes.
        strategy_in: returns a strategy, or the strategy that a function makes; see `typing.actions.make_strategy`.
        map_number, map_spec: the number of the map among those of the batch, and its entry; see `GameInternals`.
        no_node: (games,) zeros: the number of the first node, for games on one map.
        memory_of: (agents,) the number of each agent's memory; agents of a team may share one.
        width: the number of actions of views that learners have set; None: that of the map.
    """

    def __init__(
        self,
        roster: AgentTable,
        movement: Movement,
        seeds: Sequence[int],
        start: IntArray | None,
        columns: BatchColumns | None = None,
        others: Sequence[Movement] = (),
    ) -> None:
        if columns is None:
            super().__init__(roster, seeds, [movement, *others])
        else:
            vars(self).update(columns.get_shared_values())
        self.roster = roster
        on_edges = (self.edge, self.share) if movement.by_metres else (self.begun, self.covered)
        movement.begin(*on_edges, self.motion, self.time, self.previous, self.driven)
        self.movement = movement
        if self.flights is not None:
            movement.leaves_nodes = True
        self.streets = movement.streets
        self.roads = movement.all_roads
        self._of_maps: MapData | None = None  # for games that differ in their open roads
        self.deeds = DeclaredDeeds({}, None, roster.names, movement.streets)
        self.kept = dict[Hashable, Arrays]()
        self.first = dict[Hashable, Arrays]()
        self.of_core = set[Hashable]()
        self.unchecked = set[Hashable]()
        self.facts = dict[str, Any]()
        self.shared: dict[Hashable, Any] = {}
        self.searches: dict[Hashable, sight.AgentSearch] = {}
        self.asked: dict[Hashable, Any] = {}
        self.apart: MutableMapping[int, Callable[[], PlayedGame]] = {}
        self.noted: dict[int, list[str]] = {}
        self.noted_nodes: dict[int, list[str]] = {}
        self.now = dict[Hashable, Any]()
        self.sighted: dict[tuple[int, int], dict[str, tuple[IntArray, IntArray]]] = {}
        self.sighted_nodes: dict[tuple[int, int], dict[str, IntArray]] = {}
        self.find_game: Callable[[int], PlayedGame] | None = None
        self.reading: Callable[[], AbstractContextManager[None]] = nullcontext
        self.take_own_arrays: Callable[[Hashable], Iterable[tuple[int, Arrays]]] | None = None
        self.change_roads: Callable[[IntArray, str, Sequence[int]], None] | None = None
        self.tell: Callable[[Failure], None] = _tell_nobody
        self.doings: Any = None
        self.memory_of = copy_locked(np.arange(len(self.roster.names)))
        self.no_node = np.zeros(len(self), np.int64)
        self.strategy_in: Callable[[object], Any] | None = None
        self.map_number = 0
        self.map_spec: Any = None
        self.width: int | None = None
        self.makers: dict[Hashable, Callable[[int], Arrays]] = {}
        if start is not None:
            self.reset(self.seeds, start)

    def view_on_map(self, movement: Movement, roster: AgentTable) -> "GameArrays":
        """Return the state of the same games seen from another map."""
        return GameArrays(roster, movement, self.seeds, None, self)

    def __len__(self) -> int:
        return len(self.seeds)

    def take_game(self, game: PlayedGame) -> None:
        """Note a game on the map: its number among the maps, its entry, and the context that makes strategies."""
        self.strategy_in = partial(make_strategy, game.ctx)
        self.map_number = game.internals.map_number
        self.map_spec = game.internals.map_spec

    def reset(self, seeds: Sequence[int], start: IntArray) -> None:
        """Reset all games to the start of their map; `InitialState` then adds the state of earlier turns."""
        is_first = self.roster.is_first
        plays = np.zeros(len(self.roster.teams), np.bool_)
        plays[self.roster.team_of[is_first]] = True
        home = np.where(is_first, start, -1)
        values = {"start": start, "home": home, "is_first": is_first, "plays": plays, "is_going": True}
        values |= {"nowhere": np.nan, "on_node": -1}
        for one in COLUMNS:
            getattr(self, one.name)[:] = values[one.begins] if one.begins else 0
        for key, rows in self.draw_rows(seeds).items() if self.seeds != seeds else ():
            self.drawn[key][:] = rows
        self.forget(np.arange(len(self)), seeds)

    @property
    def begun_columns(self) -> list[np.ndarray[Any, Any]]:
        """The columns with whose rows games begin, whatever their seeds."""
        return [*(getattr(self, one.name) for one in COLUMNS), *self.counts.values(), *self.numbers.values()]

    def forget(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Forget the values of games that begin with these seeds, besides columns."""
        for game, seed in zip(games.tolist(), seeds, strict=True):
            self.seeds[game] = seed
            if self.headings[game]:
                self.headings[game] = {}
            self.over[game] = None
        self.put_roads(games, None)
        for numbers in chain.from_iterable(one.values() for one in self.scores.columns):
            numbers[games] = 0
        for key, make in self.makers.items():
            for name, rows in make(len(games)).items():
                self.kept[key][name][games] = rows
        self.now.clear()
        for log in self._logs:
            log.forget(games)

    def draw_rows(self, seeds: Sequence[int]) -> dict[Drawn, np.ndarray[Any, Any]]:
        """Return rows of `drawn` for seeds: the hashes of purposes, the keys of agents, and the shares of pools."""
        found: dict[Drawn, np.ndarray[Any, Any]] = {}
        for key in self.drawn:
            found[key] = self._draw(key, seeds, found)
        return found

    def _draw(self, key: Drawn, seeds: Sequence[int], known: Mapping[Drawn, BitArray]) -> np.ndarray[Any, Any]:
        """Return rows for a key of `drawn`; `known` has those of the keys before it."""
        kind, purpose = key
        if kind == "seeds":
            return np.array(seeds)
        if kind == "purposes":
            return kernels.compute_purpose_keys(seeds, purpose)
        if kind == "agents":
            return kernels.compute_first_key_rows(known["purposes", ((purpose,),)], self.roster.keys[None])
        shares = draw_shares(known["purposes", (("pool",),)], self.roster.teams)
        return np.ascontiguousarray(shares[:, self.roster.team_of])

    def _find_drawn(self, key: Drawn) -> np.ndarray[Any, Any]:
        """Return what follows from the seeds of all games; it is computed on first use."""
        if key not in self.drawn:
            self.drawn[key] = self._draw(key, self.seeds, self.drawn)
        return self.drawn[key]

    @property
    def _logs(self) -> Iterator[GameLog[Any]]:
        """The logs that hold entries of many games as arrays."""
        yield from (self.events, self.errors, self.deed_log)
        if self.radio is not None:
            yield self.radio

    def put_roads(self, games: IntArray, roads: RoadMap | None) -> None:
        """Set the map of games, on which other roads are open; None: the map of the start."""
        self.roads.put(games, roads)

    def make_map_data(self, games: IntArray, agents: IntArray = _NO_AGENTS) -> MapData:
        """Return the graph, the movement and the cached data of games, for agents: with the edges that they may use.

        Without agents, the edges are all open ones.
        """
        if not self.roads.differ:
            return MapData(self.streets, self.movement, self.shared)
        number = self.roads.number[games]
        modes = self.movement.list_modes(agents)
        if len(modes) > 1 or (len(games) and (number != number[0]).any()):
            if self._of_maps is None:
                self._of_maps = MapData(MultiMapStreets(self.streets), self.movement, self.roads.shared)
            return self._of_maps
        roads = self.roads.get_map(int(games[0])) if len(games) else None
        if roads is not None:
            self.roads.use(roads)
        roads = self.roads.get_mode_map(roads, int(modes[0])) if len(modes) else roads
        if roads is None:
            return MapData(self.streets, self.movement.get_for_start(), self.shared)
        if roads.world is None:
            roads.world = MapData(roads.streets, self.movement.get_for_map(roads), roads.shared)
        found: MapData = roads.world
        return found

    def share_memories(self) -> None:
        """Make the agents of each team share one memory; agents without a team (None) keep their own."""
        teams = self.roster.teams
        team_of = self.roster.team_of
        shares = np.array([team is not None for team in teams], np.bool_)[team_of]
        numbers = np.where(shares, team_of, len(teams) + np.arange(len(team_of)))
        self.memory_of = copy_locked(np.unique(numbers, return_inverse=True)[1])

    def copy_columns(self) -> Columns:
        """Return copies of the positions of agents and of the memory of rules and strategies, name -> (games, …).

        The turn, scores, seeds, logs, deeds, messages, and the moves of the last turn are not included.
        """
        return {name: one.copy() for name, one in self._get_remembered_columns().items()}

    def _get_remembered_columns(self) -> Columns:
        are_all_first = self.roster.is_first.all()
        found: Columns = {
            one.name: getattr(self, one.name)
            for one in COLUMNS
            if (one.is_loaded and (one.axis not in _OF_SOME or getattr(self, one.name).size))
            or (one.axis == "team" and not are_all_first)  # else all teams play in all games
        }
        found.update(dict[Hashable, Any](self.numbers))
        found |= {(key, name): one for key, those in self.kept.items() for name, one in those.items()}
        earlier = {name for those in self.kept.values() for name in those}  # of columns, with which rules compare them
        earlier |= {one.depends_on for one in COLUMNS if getattr(self, one.name).size}
        return found | {one.name: getattr(self, one.name) for one in COLUMNS if one.name in earlier}

    def refuse_others(self, columns: Columns) -> None:
        """Refuse columns whose names, shapes, data types or values do not fit the columns of these games."""
        mine = self._get_remembered_columns()
        shapes, given = ({name: np.shape(one) for name, one in those.items()} for those in (mine, columns))
        wrong = [name for name in shapes | given if given.get(name) != shapes.get(name)]
        if wrong:
            raise BadValue(
                f"columns must come from the same number of games of this scenario, after a turn of these: "
                f"{shown(wrong[0])} has the shape {given.get(wrong[0])}, not {shapes.get(wrong[0])}; None: missing."
            )
        limits = self._list_limits()
        for name, values in columns.items():
            numbers = np.asarray(values)
            kind = mine[name].dtype
            if not np.can_cast(numbers.dtype, kind, "same_kind"):
                raise BadValue(f"The column {name!r} is of {kind}, not of {numbers.dtype}.")
            if name in limits:
                limit = limits[name]
                others = numbers[~((numbers >= limit.least) & (numbers <= limit.most))]  # NaN is among them
                if len(others):
                    raise BadValue(f"The column {name!r} has {limit}, not {others[0]}.")
        self._refuse_contradictions(columns)

    def _list_limits(self) -> "dict[Hashable, Limit]":
        """Return the limits of the columns; those of rules and strategies are checked by the core."""
        nodes = self.streets.num_nodes - 1
        edges = len(self.movement.columns.edge_ids) - 1
        first = 0 if self.roster.is_first.all() else -1
        limits: dict[Hashable, Limit] = {
            "node": Limit(0, nodes),
            "previous": Limit(0, nodes),
            "start": Limit(first, nodes),
            "begun": Limit(-1, nodes),
            "covered": _SHARE,
            "driven": Limit(-1, self.movement.num_states - 1),
            "edge": Limit(-1, edges),
            "share": _SHARE,
            "motion": Limit(min(Motion), max(Motion)),
            "stops": Limit(0, MOST_WHOLE),
        }
        return limits | {one.name: _FINITE for one in NUMBERS if one.kind is np.float64}

    def _refuse_contradictions(self, columns: Columns) -> None:
        """Refuse columns that fit alone, and not together.

        Raises:
            BadValue: the message names the column, the agent and its value.
        """
        for name, is_wrong, agents, why in self._find_contradictions(
            {key: np.asarray(one) for key, one in columns.items()}
        ):
            if is_wrong.any():
                game, number = np.argwhere(is_wrong)[0].tolist()
                agent = self.roster.names[agents[number]]
                value = np.asarray(columns[name])[game, number]
                raise BadValue(f"The column {name!r} has {value} for agent {agent!r} of game {game}, {why}.")

    def _find_contradictions(self, columns: Columns) -> Iterator[tuple[str, BoolArray, Sequence[int], str]]:
        """Yield the name of a column, a mask of its wrong values, the agents of the mask, and the reason."""
        everyone = range(len(self.roster.names))
        is_there = columns["is_there"]
        node = columns["node"]
        roads = self.movement.columns
        yield "alive", columns["alive"] & ~is_there, everyone, "who is not in the game by the column 'is_there'"
        yield "start", is_there & (columns["start"] < 0), everyone, "who is in the game by the column 'is_there'"
        if "edge" in columns:
            edge = columns["edge"]
            begins = roads.sources[edge] if len(roads.sources) else node
            yield "edge", (edge >= 0) & (begins != node), everyone, "and this edge does not begin at its 'node'"
        if "begun" in columns:
            begun = columns["begun"]
            nodes = self.streets.num_nodes
            is_joined = np.isin(node * nodes + begun, roads.sources * nodes + roads.targets)
            yield "begun", (begun >= 0) & ~is_joined, everyone, "and no edge leads there from its 'node'"
        if self.flights is not None:
            flyers = self.flyers.tolist()
            flies = is_there[:, flyers]
            for name in ("position", "previous_position"):
                is_known: BoolArray = np.all(np.isfinite(columns[name]), axis=-1)
                yield name, flies & ~is_known, flyers, "who is in the game and needs a position"
            is_endless: BoolArray = np.any(np.isinf(columns["quat"]), axis=-1)
            yield "quat", is_endless, flyers, "which is not a rotation"

    def load(
        self,
        columns: Columns,
        turn: int,
        scores: Mapping[Hashable, FloatArray | float],
        games: slice = slice(None),
    ) -> None:
        """Set the state of games from checked columns; the other games do not go on. Clear events and errors of all.

        Args:
            columns: the columns to set, with a row for each of these games.
            turn: the number of turns played.
            scores: the scores of these games.
            games: the games; all by default.
        """
        mine = self._get_remembered_columns()
        for name, values in columns.items():
            mine[name][games] = values
        self.turn[:] = turn
        self.is_going[:] = False
        self.is_going[games] = True
        self.blocked[:] = False
        self.over[:] = [None] * len(self)
        for numbers in chain.from_iterable(one.values() for one in self.scores.columns):
            numbers[:] = 0
        for key, points in scores.items():
            self.scores.add(key, np.arange(len(self))[games], points)
        for log in self._logs:
            log.clear()
        for key in filter(is_of_reader, self.kept):
            self.kept[key]["number"][:] = 0
        self.now.clear()

    def get_air_positions(self, games: IntArray, agents: IntArray) -> tuple[BoolArray, FloatArray]:
        """Return a mask of the flying agents, (agents,), and their positions, (games, flying agents, 3)."""
        flies: BoolArray = self.roster.flies[agents]
        return flies, self.position[np.ix_(games, np.searchsorted(self.flyers, agents[flies]))]

    def select_values(self, column: Any, games: IntArray, agents: IntArray | None = None) -> Any:
        """Return a copy of some rows and columns of (games, agents), by ascending numbers; None: all agents."""
        # NOTE: `take` costs half of an index, and several times as much as a copy of all (benchmarks: batches).
        of_games = column if len(games) == len(self) else column.take(games, axis=0)
        if agents is None or len(agents) == column.shape[1]:
            return of_games.copy() if of_games is column else of_games
        return of_games.take(agents, axis=1)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return the memory of a rule or a strategy in all games; the first call stores `make(games)`."""
        known = self.kept.get(key)
        if (known is None or key in self.unchecked) and not callable(make):
            raise BadType(f"make of keep(key, make) is a function of the number of games, not {shown(make)}.")
        if known is not None and key in self.unchecked:
            known = _as_made(known, make(1), self.roster.is_first)
            self.kept[key] = known
            self.unchecked.discard(key)
        if known is None:
            first = self.first.get(key)
            if first is not None:
                made = make(1)
                _refuse_other_arrays(made, 1)
                make = partial(_repeat_arrays, _as_made(first, made, self.roster.is_first))
            known = make(len(self))
            _refuse_other_arrays(known, len(self))
            for number, own in () if self.take_own_arrays is None else self.take_own_arrays(key):
                for name, array in own.items():
                    known[name][number] = array[0]
            self.kept[key] = known
            self.makers[key] = make
        return known

    def checkpoint(self, more: Sequence[np.ndarray[Any, Any]]) -> Callable[[], None]:
        """Return a function that undoes all later changes, including changes to the columns in `more`.

        What array functions have written into arrays that they keep stays, as in one game.
        """
        taken_back = [key for key in self.kept if self._is_taken_back(key)]
        by_key: list[dict[Any, Any]] = [*self.scores.columns, *map(self.kept.__getitem__, taken_back)]
        columns = [getattr(self, one.name) for one in COLUMNS]
        columns += [
            *more,
            *self.counts.values(),
            *self.numbers.values(),
            *self.drawn.values(),
            *chain.from_iterable(map(dict.values, by_key)),
        ]
        copies = [deepcopy(column) if column.dtype == object else column.copy() for column in columns]
        known = [(one, {*one}) for one in by_key]
        kept = {*self.kept}
        over = [*self.over]
        headings = [*self.headings]
        undo_logs = [*(log.checkpoint() for log in self._logs), self.roads.checkpoint()]

        def undo() -> None:
            for column, values in zip(columns, copies, strict=True):
                column[...] = values
            for one, keys in known:
                for key in one.keys() - keys:
                    del one[key]
            for key in filter(self._is_taken_back, self.kept.keys() - kept):
                del self.kept[key]
                self.makers.pop(key, None)
            self.over[:] = over
            self.headings[:] = headings
            for undo_log in undo_logs:
                undo_log()
            self.now.clear()

        return undo

    def _is_taken_back(self, key: Hashable) -> bool:
        """Return whether kept arrays go back with a turn: those of the core, and the numbers of events read."""
        return key in self.of_core or is_of_reader(key)

    def notice_interrupt(self) -> None:
        """Raise TurnInterrupted if the turn is to be taken back."""
        if self.stop[0]:
            raise TurnInterrupted

    def apply_headings(self) -> None:
        """Set the headings that living agents have chosen in the current part of the turn, after its moves."""
        for game, agent, heading in self.turning:
            if self.alive[game, agent]:
                self.headings[game] = {**self.headings[game], agent: heading}
        self.turning.clear()

    def note_failure(self, failure: Failure, turn: int | None = None) -> None:
        """Count a failure, and add it to the error log of its game; `turn` is the turn, None: the current one."""
        game = failure.game
        self.counts[COUNT_OF.get(failure.kind, failure.kind)][game, failure.agent] += 1
        self.errors.add(failure, int(self.turn[game]) if turn is None else turn)

    def refuse(self, failure: Failure, turn: int) -> None:
        """Note a failure in a turn, and inform the agent."""
        self.note_failure(failure, turn)
        self.tell(failure)

    def compute_purpose_keys(self, *purpose: str | int) -> BitArray:
        """Return the hash of each game's seed and a purpose, (games,); see `kernels.purpose_key`."""
        return self.compute_several_purpose_keys(purpose)[:, 0]

    def compute_several_purpose_keys(self, *purposes: Purpose) -> BitArray:
        """Return the hashes of each game's seed and each purpose, (games, purposes)."""
        return self._find_drawn(("purposes", purposes))

    def get_seeds(self, games: IntArray) -> IntArray:
        """Return the seeds of games, (games,)."""
        found: IntArray = self._find_drawn(("seeds", None))[games]
        return found

    def draw_pool_shares(self) -> FloatArray:
        """Return the numbers in [0, 1) by which members of pools are drawn for the teams of agents, (games, agents)."""
        self.compute_purpose_keys("pool")
        return self._find_drawn(("pools", None))

    def draw_keys(self, purpose: str = "agent") -> BitArray:
        """Return the keys of agents' draws for a purpose, (games, agents); see `kernels.compute_first_key_rows`."""
        self.compute_purpose_keys(purpose)
        return self._find_drawn(("agents", purpose))


def view_with_plan(state: GameArrays, roster: AgentTable, facts: Mapping[str, Any]) -> GameArrays:
    """Return the state of the same games on the same map, with other strategies and sensors, and with further facts."""
    seen = copy(state)
    seen.roster = roster
    seen.facts = {**state.facts, **facts}
    for name in ("searches", "asked", "now", "noted", "noted_nodes", "sighted", "sighted_nodes"):
        setattr(seen, name, {})
    return seen
