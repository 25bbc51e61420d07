"""What a batch remembers of its games: where agents are, scores, events, deeds, and what rules and strategies keep."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from copy import copy, deepcopy
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.core import rules
from gamms.errors import BadType, BadValue, GammsError
from gamms.game.batch.channels import Radio
from gamms.game.batch.columns import Failure, GameLog, Roster, some_rows
from gamms.game.batch.deeds import DeclaredDeeds, DeedLog
from gamms.game.batch.flights import Flights
from gamms.game.batch.movement import Movement, Places
from gamms.game.batch.roads import RoadMap, StreetsOfMaps
from gamms.game.batch.scores import Scores
from gamms.game.decisions import COUNT_OF
from gamms.game.slots import COUNTED
from gamms.game.streets import StreetGraph
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import NUMBERS
from gamms.kernels.draws import BitArray
from gamms.readonly import locked
from gamms.text import shown

KEPT = "array functions"  # the key of `ctx.game.data` for the arrays that functions keep in a game alone
STOPPED = {"tag": "other", "respawned": "agent", "eliminated": "agent"}  # kind of event -> the agent that it stops
NAMED = {"tag": "other", "take": "flag", "drop": "flag", "capture": "flag"}  # by events of the core, beside an agent
Arrays = dict[str, Any]  # name -> an array whose first axis is the games
Purpose = tuple[str | int, ...]
Heading = tuple[float, float] | None
Columns = dict[Hashable, np.ndarray[Any, Any]]
"""What the next turns of games follow from, arrays (games, …) by name: `Batch.columns`."""


class NotTakenUp(GammsError):
    """The core cannot hold a part of a game, in words; the games are played one after the other then."""


class Emitted(NamedTuple):
    """Events of one kind that were emitted together.

    Attributes:
        kind: of all.
        games: (events,)
        turns: (events,)
        fields: name -> (events,) values.
    """

    kind: str
    games: IntArray
    turns: IntArray
    fields: Mapping[str, list[Any]]

    @classmethod
    def of(cls, game: int, entry: Mapping[str, Any]) -> "Emitted":
        """Return an event that is in the log of a game."""
        fields = {name: [value] for name, value in entry.items() if name not in ("turn", "kind")}
        return cls(entry["kind"], np.array([game]), np.array([entry["turn"]]), fields)

    def those(self, which: BoolArray) -> "Emitted":
        """Return some of the events."""
        return some_rows(self, which)


class CoreEvents(NamedTuple):
    """Events that the core has noted, (events,) each; see `gamms.core.rules`.

    Attributes:
        games, turns, rules, kinds, agents, others: as the core has them.
        nodes: their ids.
        flags: of each number of a rule, the teams whose flags it has.
    """

    games: IntArray
    turns: IntArray
    rules: IntArray
    kinds: IntArray
    agents: IntArray
    others: IntArray
    nodes: IntArray
    flags: tuple[tuple[Hashable, ...], ...]

    def those(self, which: BoolArray | IntArray) -> "CoreEvents":
        """Return some of the events: which, (events,), or their places."""
        games, turns, rules, kinds, agents, others, nodes = (column[which] for column in self[:7])
        return CoreEvents(games, turns, rules, kinds, agents, others, nodes, self.flags)

    def emitted(self, names: Sequence[str]) -> Iterator[Emitted]:
        """Yield the events of one kind together, those of one game in their order; `names` are those of the agents."""
        is_first = np.diff(self.games, prepend=-1) != 0
        run = np.cumsum(is_first | (np.diff(self.kinds, prepend=-1) != 0))
        run -= np.maximum.accumulate(np.where(is_first, run, 0))  # of events of one kind, in its game
        keys = run * len(rules.KINDS) + self.kinds
        for key in np.unique(keys).tolist():
            some, kind = self.those(keys == key), rules.KINDS[key % len(rules.KINDS)]
            fields: dict[str, list[Any]] = {"agent": [names[agent] for agent in some.agents.tolist()]}
            if kind in NAMED:
                others = zip(some.rules.tolist(), some.others.tolist(), strict=True)
                fields[NAMED[kind]] = [names[one] if kind == "tag" else self.flags[rule][one] for rule, one in others]
            fields["node"] = some.nodes.tolist()
            yield Emitted(kind, some.games, some.turns, fields)


class EventLog(GameLog[Emitted | CoreEvents]):
    """The events of all games, as they were emitted.

    Args:
        num_games: of the batch.
        names: of the agents.
    """

    def __init__(self, num_games: int, names: Sequence[str]) -> None:
        super().__init__(num_games)
        self._names = names
        self._unread: dict[Hashable, list[Emitted]] = {}  # reader -> what it has not read yet
        self._read_before: dict[Hashable, int] = {}  # reader -> how many events of each game it had read at the start

    def begin(self, games: IntArray, entries: Sequence[dict[str, Any]]) -> None:
        """Let some games begin with events of earlier turns."""
        super().begin(games, entries)
        for reader, number in self._read_before.items():
            self._unread[reader] += [Emitted.of(game, entry) for game in games.tolist() for entry in entries[number:]]

    def read(self, reader: Hashable, number: int) -> None:
        """Let a reader go on after the first events of each game, of which it had read so many before the batch."""
        self._read_before[reader] = number
        self._unread[reader] = [
            Emitted.of(game, entry) for game in range(len(self._of_game)) for entry in self.of(game)[number:]
        ]

    def is_read_by(self, reader: Hashable) -> bool:
        """Whether it is known what a reader has read."""
        return reader in self._unread

    def add(self, kind: str, games: IntArray, turns: IntArray, fields: Mapping[str, list[Any]]) -> Emitted:
        """Note events and return them, one for each of these games; of one game they are in their order."""
        emitted = Emitted(kind, games, turns, fields)
        self._pending.append(emitted)
        for unread in self._unread.values():
            unread.append(emitted)
        return emitted

    def take(self, events: CoreEvents) -> None:
        """Note events of games in the core."""
        self._pending.append(events)
        for unread in self._unread.values():
            unread.extend(events.emitted(self._names))

    def note(self, game: int, entries: Sequence[Mapping[str, Any]]) -> None:
        """Let readers find events that are in the log of a game already."""
        for unread in self._unread.values():
            unread += [Emitted.of(game, entry) for entry in entries]

    def new(self, reader: Hashable, games: IntArray) -> list[Emitted]:
        """Return the events of some games since the last call for a reader and these, at first all so far."""
        if reader not in self._unread:
            self._unread[reader] = [
                Emitted.of(game, entry) for game in range(len(self._of_game)) for entry in self.of(game)
            ]
        known = [(one, np.isin(one.games, games)) for one in self._unread[reader]]
        self._unread[reader] = [one.those(~is_new) for one, is_new in known if not is_new.all()]
        return [one.those(is_new) for one, is_new in known if is_new.any()]

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that takes back all that is noted from now on."""
        undo_log = super().checkpoint()
        unread = {reader: [*noted] for reader, noted in self._unread.items()}

        def undo() -> None:
            undo_log()
            self._unread = unread

        return undo

    def forget(self, games: IntArray) -> None:
        """Forget the events of some games."""
        super().forget(games)
        for unread in self._unread.values():
            unread[:] = [emitted.those(~np.isin(emitted.games, games)) for emitted in unread]

    def clear(self) -> None:
        """Forget the events of all games."""
        super().clear()
        for unread in self._unread.values():
            unread.clear()

    def _entries(self, noted: Emitted | CoreEvents) -> Iterator[tuple[int, dict[str, Any]]]:
        if isinstance(noted, CoreEvents):
            for emitted in noted.emitted(self._names):
                yield from self._entries(emitted)
            return
        kind, games, turns, fields = noted
        for number, turn, *values in zip(games.tolist(), turns.tolist(), *fields.values(), strict=True):
            yield number, {"turn": turn, "kind": kind, **dict(zip(fields, values, strict=True))}


def _tell_nobody(failure: Failure) -> None:
    """Do nothing: no agent of a plain function has done something wrong."""


def _refuse_other_arrays(made: object, games: int) -> None:
    """Refuse what `make` of `keep` gave if it is no dict of arrays with the games first."""
    if not isinstance(made, dict):
        raise BadType(f"make of keep(key, make) returns name -> array, not {shown(made)}.")
    for name, array in made.items():
        if not isinstance(array, np.ndarray) or array.shape[:1] != (games,):
            raise BadValue(
                f"make({games}) of keep(key, make) returns arrays whose first axis is {games} games, and "
                f"{shown(name)} is {shown(array)}."
            )


def _as_made(key: Hashable, named: str, first: Arrays, made: object) -> Arrays:
    """Return what is kept of a game that has begun, in arrays as `make` of `keep` makes them for one game."""
    _refuse_other_arrays(made, 1)
    like: Arrays = made  # type: ignore[assignment] # which was checked
    given, wanted = ({name: np.shape(one) for name, one in those.items()} for those in (first, like))
    for name in wanted | given:
        if given.get(name) != wanted.get(name):
            raise BadValue(
                f"What begins of {named} returns under {shown(key)} is not what keep(key, make) makes for one game: "
                f"{shown(name)} has the shape {given.get(name)}, not {wanted.get(name)}; None: it is not there. Of a "
                "mapping by the names of agents, arrays.roster.column(values, default) makes one, (1, agents)."
            )
        own, kind = np.asarray(first[name]).dtype, like[name].dtype
        if not np.can_cast(own, kind, "same_kind") and like[name].size:
            raise BadValue(f"begins of {named} returns {shown(name)} of {own} under {shown(key)}, not of {kind}.")
    return {name: np.asarray(first[name]).astype(one.dtype) for name, one in like.items()}


def _purpose_keys(seeds: Sequence[int], purposes: Sequence[Purpose]) -> BitArray:
    """Return the hashes of seeds and purposes, (seeds, purposes)."""
    return np.array([[kernels.purpose_key(seed, *one) for one in purposes] for seed in seeds], np.uint64)


def _repeated(first: Arrays, games: int) -> Arrays:
    return {name: np.repeat(one, games, axis=0) for name, one in first.items()}


class World(NamedTuple):
    """Where agents of some games go.

    Attributes:
        streets: of their map; of several maps, what is the same on all.
        movement: how the agents go there.
        shared: what was worked out for this map, or these.
    """

    streets: StreetGraph
    movement: Movement
    shared: dict[Hashable, Any]


class GameArrays:
    """The state of all games of a batch.

    Attributes:
        roster: the agents of each game.
        movement: how they go.
        streets: where they go.
        seeds: of the games.
        node, start: (games, agents) rows of nodes: where agents are, and where they began.
        previous: (games, agents) rows of nodes that agents have come from, where plain functions are called.
        alive: (games, agents)
        is_there: (games, agents) which agents are in the game, dead or alive; the others may come.
        turn: (games,) how many turns were played.
        scores: key -> (games,) numbers.
        counts: of moves, of conflicts and of what was illegal, (games, agents) each.
        errors: of each game, in order.
        failures: what agents have decided wrongly by functions in a part of the turn, and the turn; the core notes it
            with what it finds.
        tell: lets an agent know what it did wrong.
        deeds: what agents may do besides moving.
        deed_log: what they did; None: nothing.
        radio: by what agents send messages, and what was sent; None: by nothing.
        places: where agents on the ground are in games that are played one by one; None: on their nodes.
        flights: the agents that fly; None: none do.
        noted, noted_nodes: agent -> its sensors that are asked themselves which agents, or nodes, they show.
        sighted: game and agent -> such a sensor -> others, and the rows of nodes where they are reported.
        sighted_nodes: game and agent -> such a sensor -> the rows of the nodes that it shows.
        covered: game and agent -> a sensor that turns with it -> the rows of the nodes on which it would show agents.
        look: asks these sensors in some games; None: they were asked.
        reading: the context in which sensors are called.
        change_roads: closes or opens roads in some games; see `PointedContext.change_roads`.
        over: of each game how it ended: reason, winner, truncated; None while it goes on.
        is_going: (games,) which have not ended.
        roads: which are open in each game.
        stops: (games, agents) how often an agent was tagged, put back or eliminated.
        headings: of each game, the headings of agents that were set during the game, by number; see `AgentBlock`.
        turning: games, agents and the headings that these have chosen in the part of a turn that is under way.
        placed: (games, agents) which were put where they are since they moved in this turn.
        fell: (games, agents) which rules of the phase "deeds" have eliminated in this turn.
        numbers: the further numbers of agents, name -> (games, agents); see `ir.schema.NUMBERS`.
        kept: what rules and strategies remember: key -> name -> an array whose first axis is the games.
        first, first_by: what they remember of a game that has begun, likewise, as arrays of one game; and which does.
        has_begun: whether games begin after some turns; what forms keep of these must be in `first` then.
        takes_up: (agents,) whether all that the strategy of an agent keeps of these turns is in `first`.
        why_not_first: why it is not.
        facts: what rules have published, by name, in a form that each says.
        events: of all games.
        blocked: (games, agents) whether conflicts have stopped an agent in the last turn.
        shared: what was worked out once for all games, from what does not change, by what it is.
        now: what was worked out of how the games are now, by what it is; emptied when they change.
        no_node: (games,) 0: the number of the first node in games on one map.
        memory_of: (agents,) the number of the memory that an agent shares with its team, or has for itself.
    """

    why_not_first = ""

    def __init__(self, roster: Roster, movement: Movement, seeds: Sequence[int], start: IntArray) -> None:
        self.roster, self.seeds = roster, list(seeds)
        games, shape = len(seeds), (len(seeds), len(roster.names))
        self.start, self.node = start, start.copy()
        self.previous = start.copy()
        self.alive: BoolArray = np.tile(roster.is_first, (games, 1))
        self.is_there = self.alive.copy()
        self.turn = np.zeros(games, np.int64)
        self.scores = Scores(games)
        self.counts = {name: np.zeros(shape, np.int64) for name in COUNTED}
        self.errors: list[list[dict[str, Any]]] = [[] for _ in seeds]
        self.over, self.is_going = list[dict[str, Any] | None]([None] * games), np.ones(games, np.bool_)
        self.stops, self.blocked = np.zeros(shape, np.int64), np.zeros(shape, np.bool_)
        self.placed, self.fell = np.zeros((2, *shape), np.bool_)
        self.flights = Flights(roster, games) if roster.flies.any() else None
        self.numbers = {one.name: np.full(shape, one.initial, one.kind) for one in NUMBERS}
        self.headings: list[dict[int, Heading]] = [{} for _ in seeds]
        self.turning: list[tuple[int, int, Heading]] = []
        self.events = EventLog(games, roster.names)
        self.failures: list[tuple[Failure, int]] = []
        self.radio: Radio | None = None
        self.deed_log: DeedLog | None = None
        self._purposes: dict[tuple[Purpose, ...], BitArray] = {}
        self._draw_keys: dict[str, BitArray] = {}  # by purpose
        self._seeds: IntArray | None = None  # as an array
        self._be_on(movement)

    def _be_on(self, movement: Movement) -> None:
        """Begin to note what depends on a map."""
        movement.begin(self.node.shape)
        self.movement = movement
        if self.flights is not None:
            movement.leaves_nodes = True
        self.streets = movement.streets
        self.roads = movement.all_roads
        self._of_maps: World | None = None  # of games that have several maps
        self.deeds = DeclaredDeeds({}, None, self.roster, movement.streets)
        self.kept, self.first, self.has_begun = dict[Hashable, Arrays](), dict[Hashable, Arrays](), False
        self.first_by, self.takes_up = dict[Hashable, str](), np.zeros(len(self.roster.names), np.bool_)
        self.facts = dict[str, Any]()
        self.shared: dict[Hashable, Any] = {}
        self.places: Places | None = None
        self.noted: dict[int, list[str]] = {}
        self.noted_nodes: dict[int, list[str]] = {}
        self.now = dict[Hashable, Any]()
        self.sighted: dict[tuple[int, int], dict[str, tuple[IntArray, IntArray]]] = {}
        self.sighted_nodes: dict[tuple[int, int], dict[str, IntArray]] = {}
        self.covered: dict[tuple[int, int], dict[str, IntArray]] = {}
        self.look: Callable[[IntArray], None] | None = None
        self.reading: Callable[[], AbstractContextManager[None]] = nullcontext
        self.change_roads: Callable[[IntArray, str, Sequence[int]], None] | None = None
        self.tell: Callable[[Failure], None] = _tell_nobody
        self.memory_of = locked(np.arange(len(self.roster.names)))
        self.no_node = np.zeros(len(self), np.int64)
        self._makers: dict[Hashable, Callable[[int], Arrays]] = {}

    def on_map(self, movement: Movement, roster: Roster) -> Self:
        """Return the same games on another map: what does not depend on the map, they share."""
        twin = copy(self)
        twin.roster = roster
        twin._be_on(movement)
        return twin

    def __len__(self) -> int:
        return len(self.seeds)

    def reset(self, games: IntArray, seeds: Sequence[int], start: IntArray) -> None:
        """Begin some games again, before `InitialState.put`."""
        for game, seed in zip(games.tolist(), seeds, strict=True):
            self.seeds[game], self.over[game], self.errors[game] = seed, None, []
            self.headings[game] = {}
        self.start[games] = self.node[games] = self.previous[games] = start
        self.alive[games] = self.is_there[games] = self.roster.is_first
        self.is_going[games] = True
        self.put_roads(games, None)
        self.movement.clear(games)
        for numbers in chain.from_iterable(one.values() for one in self.scores.columns):
            numbers[games] = 0
        for key, make in self._makers.items():
            for name, rows in make(len(games)).items():
                self.kept[key][name][games] = rows
        for purposes, keys in self._purposes.items():
            keys[games] = _purpose_keys(seeds, purposes)
        for purpose, drawn in self._draw_keys.items():
            drawn[games] = kernels.first_key_rows(self.purposes(purpose)[games, None], self.roster.keys[None])
        self._seeds = None
        self.now.clear()
        for log in self._logs:
            log.forget(games)

    @property
    def _logs(self) -> Iterator[GameLog[Any]]:
        """The logs of all games that are noted as arrays."""
        yield from (log for log in (self.events, self.radio, self.deed_log) if log is not None)

    def put_roads(self, games: IntArray, roads: RoadMap | None) -> None:
        """Let games have a map on which other roads are open; None: that of the start."""
        self.roads.put(games, roads)
        self.movement.roads = self.roads if self.roads.are_closed else None

    def world(self, games: IntArray) -> World:
        """Return where agents of some games go."""
        if not self.roads.are_closed:
            return World(self.streets, self.movement, self.shared)
        number = self.roads.number[games]
        if len(games) and (number != number[0]).any():
            if self._of_maps is None:
                self._of_maps = World(StreetsOfMaps(self.streets), self.movement, self.roads.shared)
            return self._of_maps
        roads = self.roads.of(int(games[0])) if len(games) else None
        if roads is None:
            return World(self.streets, self.movement.at_start(), self.shared)
        self.roads.use(roads)
        if roads.world is None:
            roads.world = World(roads.streets, self.movement.on(roads), roads.shared)
        found: World = roads.world
        return found

    def share_memories(self) -> None:
        """Let the agents of each team share a memory; those of no team have their own."""
        teams, team_of = self.roster.teams, self.roster.team_of
        shares = np.array([team is not None for team in teams], np.bool_)[team_of]
        numbers = np.where(shares, team_of, len(teams) + np.arange(len(team_of)))
        self.memory_of = locked(np.unique(numbers, return_inverse=True)[1])

    def columns(self) -> Columns:
        """Return what the next turns follow from, copies by name, (games, …) each.

        That is where agents are and what rules and strategies remember, and not the turn, scores, seeds and logs, deeds
        and messages, and how agents moved in the last turn.
        """
        return {name: one.copy() for name, one in self._remembered().items()}

    def _remembered(self) -> Columns:
        found: Columns = {"node": self.node, "start": self.start, "alive": self.alive, "is_there": self.is_there}
        found.update(dict[Hashable, Any](self.numbers))
        if self.flights is not None:
            found.update(dict[Hashable, Any](self.flights.remembered))
        found |= {name: getattr(self.movement, name) for name in self.movement.remembers}
        found |= {(key, name): one for key, those in self.kept.items() for name, one in those.items()}
        if any("stops" in those for those in self.kept.values()):  # a rule compares them with what they were
            found["stops"] = self.stops
        return found

    def _refuse_others(self, columns: Columns, mine: Columns) -> None:
        """Refuse columns that are not those of as many such games, whose columns are `mine`."""
        shapes, given = ({name: np.shape(one) for name, one in those.items()} for those in (mine, columns))
        wrong = [name for name in shapes | given if given.get(name) != shapes.get(name)]
        if wrong:
            raise BadValue(
                f"columns are those of as many such games, after a turn of these: {shown(wrong[0])} has the shape "
                f"{given.get(wrong[0])}, not {shapes.get(wrong[0])}; None: it is not there."
            )
        nodes, edges = self.streets.num_nodes, len(self.streets.columns.edge_ids)
        limits: dict[Hashable, tuple[int, int]] = dict.fromkeys(("node", "start", "previous"), (0, nodes))
        limits |= {"begun": (-1, nodes), "edge": (-1, edges)}
        for name, values in columns.items():
            numbers, kind = np.asarray(values), mine[name].dtype
            if not np.can_cast(numbers.dtype, kind, "same_kind"):
                raise BadValue(f"The column {name!r} is of {kind}, not of {numbers.dtype}.")
            if name in limits:
                least, end = limits[name]
                others = numbers[(numbers < least) | (numbers >= end)]
                if len(others):
                    raise BadValue(f"The column {name!r} has numbers from {least} to {end - 1}, not {others[0]}.")

    def load(self, columns: Columns, turn: int, scores: Mapping[Hashable, FloatArray | float]) -> None:
        """Put all games where others were, by their `columns`, without events and errors."""
        mine = self._remembered()
        self._refuse_others(columns, mine)
        for name, values in mine.items():
            values[:] = columns[name]
        self.turn[:], self.is_going[:], self.blocked[:] = turn, True, False
        self.over[:] = [None] * len(self)
        for errors in filter(None, self.errors):
            errors.clear()
        for numbers in chain.from_iterable(one.values() for one in self.scores.columns):
            numbers[:] = 0
        for key, points in scores.items():
            self.scores.add(key, np.arange(len(self)), points)
        for log in self._logs:
            log.clear()
        self.now.clear()

    def chosen(self, column: Any, games: IntArray, agents: IntArray | None = None) -> Any:
        """Return a copy of a column (games, agents) of some games and agents, ascending; None: of all agents."""
        # NOTE: `take` costs half of an index, and several times as much as a copy of all (benchmarks: batches).
        of_games = column if len(games) == len(self) else column.take(games, axis=0)
        if agents is None or len(agents) == column.shape[1]:
            return of_games.copy() if of_games is column else of_games
        return of_games.take(agents, axis=1)

    def keep(self, key: Hashable, make: Callable[[int], Arrays], *, is_new: bool = False) -> Arrays:
        """Return what a rule or a strategy remembers of all games; at first what `make(games)` gives.

        `is_new` says whether it remembers nothing of the turns before the batch unless `first` has it.
        """
        known = self.kept.get(key)
        if known is None:
            if not callable(make):
                raise BadType(f"make of keep(key, make) is a function of the number of games, not {shown(make)}.")
            first = self.first.get(key)
            if first is not None:
                named = self.first_by.get(key)
                make = partial(_repeated, first if named is None else _as_made(key, named, first, make(1)))
            elif self.has_begun and not is_new:
                why = f"it is not known what is kept under {shown(key)} of the turns before the batch"
                raise NotTakenUp(why + self.why_not_first)
            known = make(len(self))
            _refuse_other_arrays(known, len(self))
            self.kept[key], self._makers[key] = known, make
        return known

    def checkpoint(self, more: Sequence[np.ndarray[Any, Any]]) -> Callable[[], None]:
        """Return a function that takes back all that happens from now on, also in these other columns."""
        by_key: list[dict[Any, Any]] = [*self.scores.columns, *self.kept.values()]
        columns = [
            self.node,
            self.previous,
            self.alive,
            self.turn,
            self.stops,
            self.placed,
            self.blocked,
            self.is_going,
        ]
        columns += [
            *more,
            *(getattr(self.movement, name) for name in self.movement.remembers),
            *self.counts.values(),
            *self.numbers.values(),
            *(() if self.flights is None else self.flights.columns),
            *chain.from_iterable(map(dict.values, by_key)),
        ]
        copies = [deepcopy(column) if column.dtype == object else column.copy() for column in columns]
        known = [(one, {*one}) for one in (*by_key, self.kept, self._makers)]
        over = [*self.over]
        headings = [*self.headings]
        undo_logs = [*(log.checkpoint() for log in self._logs), self.roads.checkpoint()]
        num_errors = [len(errors) for errors in self.errors]

        def undo() -> None:
            for column, values in zip(columns, copies, strict=True):
                column[...] = values
            for one, keys in known:
                for key in one.keys() - keys:
                    del one[key]
            self.over[:] = over
            self.headings[:] = headings
            for undo_log in undo_logs:
                undo_log()
            self.movement.roads = self.roads if self.roads.are_closed else None
            for errors, number in zip(self.errors, num_errors, strict=True):
                del errors[number:]
            self.now.clear()

        return undo

    def turn_agents(self) -> None:
        """Let agents that live turn as they have chosen in a part of a turn, after its moves."""
        for game, agent, heading in self.turning:
            if self.alive[game, agent]:
                self.headings[game] = {**self.headings[game], agent: heading}
        self.turning.clear()

    def note_failure(self, failure: Failure, turn: int | None = None) -> None:
        """Note in the log of a game what an agent did wrong, and let it know; `turn` is when, None: now."""
        game, agent, kind, message = failure
        self.counts[COUNT_OF.get(kind, kind)][game, agent] += 1
        name, when = self.roster.names[agent], int(self.turn[game]) if turn is None else turn
        self.errors[game].append({"turn": when, "agent": name, "kind": kind, "message": message})

    def purposes(self, *purpose: str | int) -> BitArray:
        """Return the hash of the seed and a purpose of each game, (games,); see `kernels.purpose_key`."""
        return self.several_purposes(purpose)[:, 0]

    def several_purposes(self, *purposes: Purpose) -> BitArray:
        """Return the same of several purposes, (games, purposes)."""
        keys = self._purposes.get(purposes)
        if keys is None:
            keys = self._purposes[purposes] = _purpose_keys(self.seeds, purposes)
        return keys

    def seeds_of(self, games: IntArray) -> IntArray:
        """Return the seeds of some games."""
        if self._seeds is None:
            self._seeds = np.array(self.seeds)
        return self._seeds[games]

    def draw_keys(self, purpose: str = "agent") -> BitArray:
        """Return the keys of what agents draw for a purpose, (games, agents); see `kernels.first_key_rows`."""
        if purpose not in self._draw_keys:
            self._draw_keys[purpose] = kernels.first_key_rows(self.purposes(purpose)[:, None], self.roster.keys[None])
        return self._draw_keys[purpose]
