# cython: binding=False, auto_pickle=False, embedsignature=True, embedsignature.format=clinic
"""The phases of a turn, and the order in which they are played: in one game, and in the games of a batch.

All agents decide before any moves. With an order of play, a turn has parts, in which some of the agents decide and
move; the rules follow the last part.

| phase    | what happens                                | in one game      | in a batch  | in the core              |
|----------|---------------------------------------------|------------------|-------------|--------------------------|
| before   | rules of the phase "before"                 | `before`         | `before`    |                          |
| decide   | living agents choose or are given moves     | `play_decisions` | `_decide`   | `OneEdgeMovers.decide`   |
| act      | rules refuse moves and deeds, and do deeds; | `_act`           | `_act`      | `OneEdgeMovers.settle`   |
|          | agents that they put elsewhere stay         |                  |             |                          |
| give way | agents that lose conflicts stay             | `give_way`       | `_give_way` | `OneEdgeMovers.give_way` |
| move     | agents move                                 | `move`           | `_move`     | `OneEdgeMovers.move`     |
| join     | the move becomes a part of the turn         | `_join`          |             | `OneEdgeMovers.move`     |
| send     | messages are sent                           | `_send`          | `_send`     |                          |
| after    | rules, which may end the game; collectors   | `after`          | `after`     | `rules.play`             |
| end      | pictures, windows and recordings            | `end`            |             |                          |

`TurnDriver` plays the phases that turns need, a `TurnPlan`: in one game (`GameTurn` and `game.turn.TurnEngine`), and in
a batch (`game.batch_engine.BatchEngine`), where an entry plays a phase in all games. The core plays consecutive phases
of a batch in which no function is called at once; if none is called in the whole turn, there is no plan: `play` plays
turns, and `play_step` a step of learners.

In the core, games share only the map and the arguments of rules; they can be played in any order and on several
threads. Agents that move along several edges, or by metres, override what differs: `by_edges.EdgeMovers`,
`by_metres.MetreMovers`. Agents that decide on arrival decide and give way several times per turn: `arrivals.play`, or
in phases of their own instead of the first, `arrivals.play_phase`.
"""

from __future__ import annotations

from threading import get_ident
from time import perf_counter
from typing import Any

from gamms.core import arrivals, block, conflicts, moves, observe, rules
from gamms.core.agents import AgentColumns, AgentView, MoveColumns, MovingAgents, NodeNumbers
from gamms.core.ask import DecidingAgent, SensorCall, ask_each
from gamms.core.block import INT64
from gamms.core.conflicts import Contests, MoveRequests
from gamms.core.rules import Events, GameColumns

try:
    import cython  # type: ignore[import-untyped]
except ImportError:  # Cython is not needed to run the text
    from contextlib import nullcontext
    from types import SimpleNamespace

    cython = SimpleNamespace(nogil=nullcontext())

DECIDE = 0
SETTLE = 1
MOVE = 2
ENOUGH_UNREAD = 8  # turns whose states were not read make up for one whose states were
MOST_ASKED = 63  # turns for which agents are asked after the states of a turn were read
NOT_ASKED = -1  # instead of the version of the sensors: agents are not asked one by one
SENSOR = "A sensor"
"""Who looks while agents decide; see `deciding.DecidePhase.judge`."""
PHASES = (DECIDE, SETTLE, MOVE)
"""What `play_phases` plays, besides the phases of `arrivals`."""


class PastPlaces:
    """Where the agents of a single game were after its last turns; those of turn t are in row t modulo `turns`.

    Attributes:
        turns: the number of turns that are kept; 0: none.
        node: (turns * agents,) the nodes.
        edge, share, motion: the same for positions on edges, see `rules.GameColumns` and `ir.progress.Motion`; empty in
            games without positions between nodes.
        motions: (agents,) the present motions.
    """

    def __init__(
        self,
        turns: int,
        node: memoryview[int],
        edge: memoryview[int],
        share: memoryview[float],
        motion: memoryview[int],
        motions: memoryview[int],
    ) -> None:
        self.turns = turns
        self.node = node
        self.edge = edge
        self.share = share
        self.motion = motion
        self.motions = motions

    def note(self, games: rules.GameColumns) -> int:
        """Keep the places of agents after a turn."""
        first = games.turn[0] % self.turns * games.agents
        for i in range(games.agents):
            self.node[first + i] = games.node[i]
        for i in range(len(self.motions)):
            self.edge[first + i] = games.edge[i]
            self.share[first + i] = games.share[i]
            self.motion[first + i] = self.motions[i]
        return 0


class Player:
    """The data with which one thread plays games.

    Attributes:
        games: the columns of all games.
        movers: the agents, and how they move.
        arrivals: moves by metres with decisions on arrival; None: not used.
        first: the first rule, if `has_rules`.
        until: (games,) the number of parts of turns after which the game stops; 0: it is not played.
        map_of: (games,) the number of each game's map.
        map: the number of the map whose games are played.
        stop: (1,) not 0: all games stop at once, each between two turns, or before the next game of a phase.
        past: keeps the places of agents after turns of a single game.
    """

    def __init__(
        self,
        games: rules.GameColumns,
        movers: moves.OneEdgeMovers,
        at_arrivals: arrivals.Arrivals | None,
        first: rules.Rule | None,
        until: memoryview[int],
        map_of: memoryview[int],
        map: int,
        stop: memoryview[int],
        past: PastPlaces,
    ) -> None:
        self.stop = stop
        self.map_of = map_of
        self.map = map
        self.past = past
        self.games = games
        self.movers = movers
        self.arrivals = at_arrivals
        self.at_arrivals = at_arrivals is not None
        self.first = first
        self.has_rules = first is not None
        self.until = until


def decide(p: Player, game: int) -> int:
    """Let the agents of a part of a turn decide."""
    if p.at_arrivals:
        return arrivals.play(p.games, p.arrivals, game)  # type: ignore[arg-type] # there are some
    return p.movers.decide(p.games, game)


def move(p: Player, game: int) -> int:
    """Let the agents of a part of a turn give way to each other and go, and apply the rules after the last part."""
    if not p.at_arrivals:
        p.movers.give_way(p.games, game)
    p.movers.move(p.games, game)
    if p.has_rules and p.movers.part[game] == 0:
        rules.play(p.first, game)  # type: ignore[arg-type] # there is one
    return 0


def play_phase(p: Player, phase: int, game: int) -> int:
    """Play a phase of a part of a turn of a game; see `PHASES`."""
    if phase > MOVE:
        return arrivals.play_phase(p.games, p.arrivals, p.arrivals.travelers, phase, game)  # type: ignore[arg-type, union-attr]
    if phase == DECIDE:
        return decide(p, game)
    p.movers.settle(p.games, game)
    return move(p, game) if phase == MOVE else 0


def play(p: Player, begin: int, end: int) -> int:
    """Play the games `begin` to `end - 1`, each until it is over or its number of turns is reached."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.map_of[game] != p.map or p.until[game] == 0:
            continue
        p.movers.take_game(p.games, game)
        while not p.games.over[game] and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            if p.stop[0]:
                return 0
            decide(p, game)
            move(p, game)
            if p.past.turns > 0 and p.movers.part[game] == 0:
                p.past.note(p.games)
    return 0


def play_phases(p: Player, phase: int, begin: int, end: int) -> int:
    """Play a phase of those games from `begin` to `end - 1` whose turns are not played."""
    parts = p.movers.parts
    for game in range(begin, end):
        if p.stop[0]:
            return 0
        if p.map_of[game] == p.map and p.games.turn[game] * parts + p.movers.part[game] < p.until[game]:
            p.movers.take_game(p.games, game)
            play_phase(p, phase, game)
    return 0


def play_aside(p: Player, begin: int, end: int) -> int:
    """Call `play` without the GIL."""
    with cython.nogil:
        play(p, begin, end)
    return 0


def play_phases_aside(p: Player, phase: int, begin: int, end: int) -> int:
    """Do what `play_phases` does, and let other threads of Python go on meanwhile."""
    with cython.nogil:
        play_phases(p, phase, begin, end)
    return 0


class TurnsOfGames:
    """The turns that the games of a batch play, and which of them are over.

    Attributes:
        going: (games,) 0: a rule has ended the game.
        turn: (games,) the number of turns played.
        last: the turn at which all games end; -1: there is none.
        parts: the number of parts of a turn.
        until: (games,) see `Player`.
        over: (games,) 1: a rule has ended the game.
    """

    def __init__(
        self,
        going: memoryview[int],
        turn: memoryview[int],
        last: int,
        parts: int,
        until: memoryview[int],
        over: memoryview[int],
    ) -> None:
        self.going = going
        self.turn = turn
        self.last = last
        self.parts = parts
        self.until = until
        self.over = over


def begin_turns(t: TurnsOfGames, most: int) -> int:
    """Let the games that are not over play some turns, at most `most`."""
    for game in range(len(t.turn)):
        t.over[game] = not t.going[game]
        t.until[game] = 0
        until = t.turn[game] + most
        if t.last >= 0:
            until = min(until, t.last)
        if t.going[game] and t.turn[game] < until:
            t.until[game] = until * t.parts
    return 0


class LearnerStep:
    """A step of learners in the games of a batch, as one thread plays it: `play_step`.

    Attributes:
        turns: the turns of the games.
        learners: what the learners choose and get.
        given: (games * agents,) the given actions of all agents; receives those of the learners.
        score: (games * teams,) the scores of the teams.
        teams: the number of teams.
        observers: the learners as observers, in the same order.
        output: receives their vectors and legal actions.
        last: holds the vectors and legal actions of games that begin again, from before.
        room: working memory.
        first: (maps,) the number of the first node of each map, see `Observers.first_node`.
        first_node: `Observers.first_node`, which receives that of the next map of a game.
        num_ended: the number of learners that ended in the last step.
        num_begun: the number of games that began again in it.
    """

    def __init__(
        self,
        turns: TurnsOfGames,
        learners: observe.LearnerTurn,
        given: memoryview[int],
        score: memoryview[float],
        teams: int,
        observers: observe.Observers,
        output: observe.VectorObservations,
        last: observe.VectorObservations,
        room: observe.NearestAgents,
        first: memoryview[int],
        first_node: memoryview[int],
    ) -> None:
        self.turns = turns
        self.learners = learners
        self.given = given
        self.score = score
        self.teams = teams
        self.observers = observers
        self.output = output
        self.last = last
        self.room = room
        self.first = first
        self.first_node = first_node
        self.num_ended = 0
        self.num_begun = 0


def play_step(
    s: LearnerStep, players: list[Player], starts: list[block.GameStarts], waits: bool, begin: int, end: int
) -> int:
    """Play a turn of the games `begin` to `end - 1` with the actions of learners; write their rewards and observations.

    The reward of a learner is the change of the score of its team. Games that end begin again if they may.

    Args:
        s: the step.
        players: play the games, those on each map.
        starts: begin games again, on each map in turn; empty: none begins.
        waits: whether games begin in the turn after the one in which they end.
        begin: the first game.
        end: the number behind the last one.
    """
    with cython.nogil:
        for game in range(begin, end):
            take_actions(s, s.learners, s.observers.seen, game)
    for player in players:
        play_aside(player, begin, end)
    s.num_ended = 0
    s.num_begun = 0
    with cython.nogil:
        for game in range(begin, end):
            s.num_ended += end_step(s, s.learners, s.observers.seen, game)
    player = players[0]
    if s.room.lacks or player.stop[0]:  # the observations are not complete, or the turn is taken back
        return 0
    ended = s.learners.was_over if waits else s.learners.over
    for streets, one in enumerate(starts):
        _begin_aside(s, one, streets, ended, begin, end)
    return 0


def take_actions(s: LearnerStep, t: observe.LearnerTurn, seen: observe.VisibleAgents, game: int) -> int:
    """Give the actions of the learners of a game to their agents, and note the scores of their teams."""
    observe.begin_turn(t, game)
    for learner in range(t.agents):
        row = game * t.agents + learner
        agent = seen.viewers[learner]
        s.given[game * seen.agents + agent] = t.moves[row]
        t.earned[row] = s.score[game * s.teams + seen.team[agent]]
    return 0


def end_step(s: LearnerStep, t: observe.LearnerTurn, seen: observe.VisibleAgents, game: int) -> int:
    """Write what the learners of a game get and see after a turn; return the number of those that ended."""
    for learner in range(t.agents):
        row = game * t.agents + learner
        t.earned[row] = s.score[game * s.teams + seen.team[seen.viewers[learner]]] - t.earned[row]
    show_game(s, t, game)
    return observe.end_turn(t, game)


def show_game(s: LearnerStep, t: observe.LearnerTurn, game: int) -> int:
    """Write whether a game is over, and what its learners see."""
    why = s.turns.over[game]
    is_last = s.turns.last >= 0 and s.turns.turn[game] >= s.turns.last
    t.over[game] = why > 0 or is_last
    t.late[game] = why == rules.BY_TIME or (is_last and why == 0)
    return observe.observe_turn(t, s.observers, s.output, s.room, game)


def _begin_aside(
    s: LearnerStep, starts: block.GameStarts, streets: int, ended: memoryview[int], begin: int, end: int
) -> int:
    """Begin those games from `begin` to `end - 1` again that have ended, may begin, and begin on these streets."""
    with cython.nogil:
        for game in range(begin, end):
            can_begin = ended[game] and s.learners.may_begin[game] and not s.learners.begun[game]
            if can_begin and starts.streets[starts.next[game]] == streets:
                _begin_again(s, s.learners, starts, streets, game)
    return 0


def _begin_again(s: LearnerStep, t: observe.LearnerTurn, starts: block.GameStarts, streets: int, game: int) -> int:
    """Begin a game again; keep what its learners have seen, and write what they see now."""
    observe.keep_rows(s.output, s.last, game * t.agents, t.agents)
    block.begin_game(starts, game)
    s.first_node[game] = s.first[streets]
    t.may_begin[game] -= 1
    t.begun[game] = 1
    s.num_begun += 1
    return show_game(s, t, game)


# -- the order of phases -------------------------------------------------------------------------------------------

PHASES_OF_PART = ("decide", "act", "give way", "move", "join")
"""The phases of each part of a turn, in order; see the table above."""
PHASES_OF_PLAN = (*PHASES_OF_PART, "send")


class Entry:
    """A phase in the plan of a turn.

    Attributes:
        phase: its name.
        part: the part of the turn.
        time: where the time that it takes is counted.
        play: plays it; called with the part.
    """

    def __init__(self, phase: str, part: int, time: str, play: Any) -> None:
        self.phase = phase
        self.part = part
        self.time = time
        self.play = play


class TurnPlan:
    """The phases that turns need, in order.

    Attributes:
        epoch: the epoch of the context in which it is valid; see `DecidePhase`.
        order: the agents of one game; None in batches.
        entries: the phases.
    """

    def __init__(self, epoch: int, order: Any, entries: list[Entry]) -> None:
        self.epoch = epoch
        self.order = order
        self.entries = entries

    def list_entries_from(self, part: int) -> list[Entry]:
        """Return the phases from a part of the turn on."""
        return [entry for entry in self.entries if entry.part >= part]

    def list_entries_after(self, last: Entry) -> list[Entry]:
        """Return the phases after a phase of this plan or an earlier one."""
        played = last.part, PHASES_OF_PLAN.index(last.phase)
        return [one for one in self.entries if (one.part, PHASES_OF_PLAN.index(one.phase)) > played]


class TurnDriver:
    """Plays turns: a subclass has the phases, of one game or of the games of a batch.

    Attributes:
        phase: the phase of the context, whose epoch says whether a plan is valid.
        phases: name -> (where its time is counted, the function that plays it, which is called with the part).
        plan_now: the plan of the last turn; None: there is none.
        spent: name -> the time that the phases have taken, s.
        first: the first part of the turn that was not played before.
        part: the number of the current part, in the order of play.
    """

    def __init__(self, phase: Any) -> None:
        self.phase = phase
        self.phases: dict[str, Any] = {}
        self.plan_now: TurnPlan | None = None
        self.spent: dict[str, float] = {}
        self.first = 0
        self.part = 0

    def plan(self) -> TurnPlan:
        """Return the phases of a turn; they stay the same until `epoch` is larger."""
        raise NotImplementedError

    def run_before_moves(self) -> bool:
        """Apply the rules before the moves; return whether there are moves."""
        raise NotImplementedError

    def begin_moves(self, plan: TurnPlan) -> int:
        """Prepare the phases of the plan."""
        raise NotImplementedError

    def lose_moves(self, error: BaseException) -> None:
        """Undo the begun moves of a turn after an error."""
        raise NotImplementedError

    def end_moves(self) -> int:
        """Tidy up after the phases of the plan, also after an error."""
        return 0

    def run_after_moves(self) -> int:
        """Apply the rules after the moves, and collect the values of the turn."""
        raise NotImplementedError

    def end(self) -> int:
        """Show the end of the turn, also after an error in a rule: the agents have moved."""
        return 0

    def is_cut_short(self) -> bool:
        """Return whether later parts of the turn are not played."""
        return False

    def make_plan(self, order: Any, needed: list[set[str]], sends: bool) -> TurnPlan:
        """Return a plan.

        Args:
            order: the agents of one game; None in batches.
            needed: the phases that each part of the turn needs.
            sends: whether messages are sent.
        """
        each = [(phase, part) for part, several in enumerate(needed) for phase in PHASES_OF_PART if phase in several]
        if sends:
            each.append(("send", len(needed)))
        entries = [Entry(phase, part, *self.phases[phase]) for phase, part in each]
        return TurnPlan(self.phase.epoch, order, entries)

    def play_turn(self) -> int:
        """Play a turn; see the table of phases above.

        Raises:
            BadValue: the order of play lacks a team.
            MissingKey (KeyError): the priorities of `by_priority` lack a team.
        """
        if not self.run_before_moves():
            return 0
        plan = self.plan_now
        if plan is None or plan.epoch != self.phase.epoch:
            plan = self.plan()
        self.begin_moves(plan)
        try:
            self.play_moves(plan)
        except BaseException as error:
            self.lose_moves(error)
            raise
        finally:
            self.end_moves()
        try:
            self.run_after_moves()
        finally:
            self.end()
        return 0

    def play_moves(self, plan: TurnPlan) -> int:
        """Let all agents observe, decide and move, part by part."""
        entries = plan.entries if self.first == 0 else plan.list_entries_from(self.first)
        played = self.play_entries(entries, plan.epoch)
        while played < len(entries):  # a function has changed what the plan depends on
            last = entries[played - 1]
            plan = self.plan()
            entries = plan.list_entries_after(last)
            played = self.play_entries(entries, plan.epoch)
        return 0

    def play_entries(self, entries: list[Entry], epoch: int) -> int:
        """Play phases one after the other, and count the time that each takes.

        If a rule ends the game, the later parts of the turn are not played.

        Returns:
            The number of phases played: not all if the epoch of the context has risen.
        """
        spent = self.spent
        phase = self.phase
        began = perf_counter()
        for number in range(len(entries)):
            entry = entries[number]
            if entry.part > self.part and entry.phase != "send" and self.is_cut_short():
                continue
            entry.play(entry.part)
            now = perf_counter()
            spent[entry.time] += now - began
            began = now
            if phase.epoch != epoch:
                return number + 1
        return len(entries)


# -- turns of one game ---------------------------------------------------------------------------------------------


class ShippedDecisions:
    """The decisions of those agents of one game whose strategies the core has; a subclass keeps their memories.

    Attributes:
        games: the columns of all agents, by name, dead or alive.
        movers: decides for them.
        decides: (agents,) whether the core has the strategy of each agent.
        rows: (agents,) the row of each agent in the block.
        places: (numbers,) the place of each node on the map, by its number in the block; -1: it is not on the map.
        ids: (places,) the id of each node on the map.
        remembers: whether some strategies have memories.
    """

    def __init__(
        self,
        games: GameColumns,
        movers: moves.OneEdgeMovers,
        decides: memoryview[int],
        rows: memoryview[int],
        places: memoryview[int],
        ids: memoryview[int],
        *,
        remembers: bool,
    ) -> None:
        self.games = games
        self.movers = movers
        self.decides = decides
        self.rows = rows
        self.places = places
        self.ids = ids
        self.remembers = remembers

    def take_memories(self, *, are_known: bool) -> bool:
        """Prepare the memories for a turn; return False if one has a form that strategies do not write.

        Args:
            are_known: whether they are as after the last turn that was decided here; else they are read from the game.
        """
        raise NotImplementedError

    def show_memories(self, *, of_start: bool) -> None:
        """Show the present memories in the game, or those before the last turn."""
        raise NotImplementedError

    def load_places(self, columns: AgentColumns) -> bool:
        """Take where the agents are, and which are alive; return False if a living one is not on the map.

        Args:
            columns: the agents.
        """
        games = self.games
        for i in range(games.agents):
            number = columns._nodes[self.rows[i]]
            place = self.places[number] if number < len(self.places) else -1
            is_alive = columns._lives[self.rows[i]]
            if place < 0 and is_alive:
                return False
            games.node[i] = max(place, 0)
            games.alive[i] = is_alive
        return True

    def decide(self, turn: int, to: MoveColumns) -> int:
        """Write where the agents go that are alive.

        Args:
            turn: the number of turns played.
            to: receives the ends of moves.
        """
        games = self.games
        games.turn[0] = turn
        self.movers.decide(games, 0)
        for i in range(games.agents):
            if games.alive[i] and self.decides[i]:
                to.ends[i] = self.ids[self.movers.ends[i]]
        return 0


class UnreadStates:
    """The start of a turn whose states of agents were not made, because the core has decided.

    Attributes:
        shipped: has decided.
        order, part: the agents.
        memory: the number columns of the agents, as in `core.block.Block`.
        turn: the number of turns played.
        blocked: why earlier actions of agents were not executed; None: all were.
        team_memories: the memories of teams.
    """

    def __init__(
        self,
        shipped: ShippedDecisions,
        order: Any,
        part: Any,
        memory: bytes,
        turn: int,
        blocked: Any,
        team_memories: dict[Any, Any],
    ) -> None:
        self.shipped = shipped
        self.order = order
        self.part = part
        self.memory = memory
        self.turn = turn
        self.blocked = blocked
        self.team_memories = team_memories


class PartInCore:
    """The agents of a part of a turn that are asked one by one, and the agents that move.

    Attributes:
        individuals: the agents with a strategy of their own.
        sensors, numbers: for each of them, its sensors and the index of its slot.
        looks: for each group of equal sensors of them, a function that returns their shared search.
        version: the version of the sensors.
        moving: all agents, dead or alive.
        count: their number.
        has_starts: whether the nodes of all agents are written before they decide; not if plans decide for all.
        see_world_only: whether all sensors look only at the graph and the agents.
        has_plans: whether plans decide for some agents.
        is_paced: whether some agents may be on an edge.
        ground: the rows of the agents of the part that are on the ground; see `AgentColumns.move_all`.
        is_all_ground: whether these are all agents.
    """

    def __init__(
        self,
        individuals: list[DecidingAgent],
        sensors: list[tuple[SensorCall, ...]],
        numbers: list[int],
        looks: list[Any],
        version: int,
        moving: MovingAgents,
        count: int,
        *,
        has_starts: bool,
        see_world_only: bool,
        has_plans: bool,
        is_paced: bool,
        ground: Any,
        is_all_ground: bool,
    ) -> None:
        self.individuals = individuals
        self.sensors = sensors
        self.numbers = numbers
        self.looks = looks
        self.version = version
        self.moving = moving
        self.count = count
        self.has_starts = has_starts
        self.see_world_only = see_world_only
        self.has_plans = has_plans
        self.is_paced = is_paced
        self.ground = ground
        self.is_all_ground = is_all_ground


class Answers:
    """The answers of the agents of a part of a turn; a subclass handles those other than a legal node.

    Attributes:
        state: the state of the game.
        slots: the slots of all agents.
        starts: the node of each agent, by slot.
        ends: the node that each agent moves to, by slot, as a view of an array.
        moves: the starts and ends as arrays of the core; None: use `starts` and `ends`.
        actions: slot -> its action, if it flies, turns or does deeds; a new dict for each part.
        paths: the paths of agents that do more than to move along one edge; None: there are none.
        awaited: awaitables to collect.
        written: (slot, changed copy of the team memory) of each agent that changed it.
        failures: (slot, kind, message) of each failure.
    """

    def begin(self, slots: Any, starts: Any, ends: Any, moves: MoveColumns | None) -> int:
        """Start a new part of a turn.

        Args:
            slots: the slots of the agents.
            starts: the node of each agent.
            ends: a writable copy of `starts`; None: it is made when necessary.
            moves: both as arrays of the core.
        """
        self.slots = slots
        self.starts = starts
        self.moves = moves
        self.actions: dict[int, Any] = {}
        self.paths: Any = None
        self.ends = starts if ends is None else ends
        if self.written or self.failures or self.awaited:
            self.forget()
        return 0

    def forget(self) -> int:
        """Reset the lists that few games use."""
        self.written: list[Any] = []
        self.failures: list[Any] = []
        self.awaited: list[Any] = []
        return 0


class TurnMovesInCore:
    """The moves of one turn by slot.

    Attributes:
        order: the agents.
        starts, ends: the nodes where the move of each agent begins and ends.
        slots: the slots of the agents.
        took_part: (agents,) whether each took part; the others stay, and have no move.
        actions: slot -> its action, if it flies, turns or does deeds.
        columns: the starts and ends as arrays of the core; None: not known yet.
        paths: the paths of agents that do more than to move along one edge; None: there are none.
        applied: the version of the agents when these moves were made, by agents with paths; -1: not known.
        by_names: agent -> its move, for agents on the ground; None: not made yet.
    """

    def __init__(
        self,
        order: Any,
        starts: Any,
        ends: Any,
        actions: dict[int, Any],
        columns: MoveColumns | None = None,
        paths: Any = None,
        took_part: bytes | None = None,
    ) -> None:
        self.took_part = order.moving.lives if took_part is None else took_part
        self.order = order
        self.starts = starts
        self.ends = ends
        self.actions = actions
        self.columns = columns
        self.paths = paths
        self.applied = -1
        self.slots = order.slots
        self.by_names: dict[str, Any] | None = None

    def get_core_columns(self) -> MoveColumns:
        """Return the starts and ends of all moves as arrays of the core."""
        raise NotImplementedError

    def are_steps(self, block: AgentColumns) -> bool:
        """Return whether all agents that took part did on the ground, each along at most one edge."""
        order = self.order
        agents: Any = block
        if agents.travellers or order.whole.on_ground is not None:
            return False
        if order.entries != agents.structure.entries:
            has_same_rows = order.rows_version == agents.rows.version and not agents.removed
            if order.entries < 0 or not has_same_rows:
                return False
        return self.paths is None or self.paths.are_steps()


class GameTurn(TurnDriver):
    """Plays the turns of one game; a subclass has the phases that few games need, and handles uncommon answers.

    Attributes:
        state: the state of the game.
        answers: collects the decisions.
        travel: finds the paths of agents by metres.
        near: node id -> the nodes that are legal along one edge.
        asked: the number of times that the agents of a part were asked to decide.
        asked_part: the order and the agents of the last time; None: there was none.
        is_deciding: whether agents are observing and deciding now.
        is_moving: whether agents are deciding and moving now.
        seed_changes: the number of changes of the context's seed.
        observers: called in every turn with the agents and their states before any agent decides, in order; see
            `game.turn.Observer`.
        order_now: the agents; None: they are not known.
        moves_of: the agents with which the moves of the turn began.
        checked: the last plan whose teams may all play.
        rules, collectors: those of the game.
        groups: the order of play of the current turn.
        conflicting: the agents in the form of the core, if ranks decide conflicts; None: they are not known.
        whole: the moves of the parts of the turn that were played.
        make_moves: makes the moves of a turn: a subclass of `TurnMovesInCore`.
        shipped: decides for agents whose strategies the core has; None: all are asked.
        shipped_epoch, shipped_seeds, shipped_revision: the epoch, the changes of the seed, and the revision of the map
            when `shipped` was looked for.
        look_again: the turn in which `shipped` is looked for again if it is None.
        makes_states: whether agents are asked in any case, so that their states are made.
        ask_until: the turn until which agents are asked all the same, because the states of turns are read.
        asks_for: the number of turns for which all were last asked for this reason.
        unread_turns: the number of turns since then whose states were not read.
        revised: the object that counts the changes of the map.
        unread: the start of the last turn if its states were not made; None: they were, or are not wanted.
        reader: `_read_states`, as `DecidePhase.read_turn`.
        are_memories_in_core: whether the memories of agents for which the core decides are newer there than in the
            game.
    """

    def __init__(self, phase: Any, state: Any, make_moves: Any) -> None:
        super().__init__(phase)
        self.shipped: ShippedDecisions | None = None
        self.shipped_epoch = -1
        self.shipped_seeds = -1
        self.shipped_revision: Any = None
        self.look_again = 0
        self.makes_states = False
        self.ask_until = 0
        self.asks_for = 0
        self.unread_turns = 0
        self.revised: Any = None
        self.unread: UnreadStates | None = None
        self._named: list[Any] = []  # all agents in the order of names, without an order of turns
        self._named_of: Any = None  # their block, and its version
        self.reader: Any = self._read_states
        self.are_memories_in_core = False
        self.state = state
        self.make_moves = make_moves
        self.near: Any = {}
        self.asked = 0
        self.asked_part: Any = None
        self.is_deciding = False
        self.is_moving = False
        self.seed_changes = 0
        self.observers: list[Any] = []
        self.order_now: Any = None
        self.moves_of: Any = None
        self.checked: Any = None
        self.rules: Any = None
        self.collectors: Any = None
        self.groups: Any = None
        self.conflicting: NodeConflicts | None = None
        self.whole: Any = None
        self.travel: Any
        self.answers: Any
        self._ctx: Any

    def get_order(self) -> Any:
        """Return the agents in the order of a turn, dead or alive."""
        raise NotImplementedError

    def _check(self, plan: TurnPlan) -> None:
        """Refuse to play a plan if a team is left out."""
        raise NotImplementedError

    def _follow_order(self) -> None:
        """Notice that a rule has changed the order of play, and count the moves of orders that were replaced."""
        raise NotImplementedError

    def _apply_rules(self, phase: str) -> None:
        """Apply the rules of a phase."""
        raise NotImplementedError

    def _collect(self) -> None:
        """Collect the values of the turn."""
        raise NotImplementedError

    def _show(self) -> None:
        """Show the end of the turn in pictures, windows and recordings."""
        raise NotImplementedError

    def _show_missed(self) -> None:
        """Show the end of the turn, unless that has begun."""
        raise NotImplementedError

    def _publish(self, order: Any, part: Any, answers: Any) -> None:
        """Publish errors, team memories and messages, after all agents have decided."""
        raise NotImplementedError

    def _leave_closed_edges(self, order: Any, indices: Any) -> None:
        """Move agents on removed edges to the node that they passed last."""
        raise NotImplementedError

    def _show_row(self, order: Any, memory: bytes, turn: int, blocked: Any) -> None:
        """Show the game of another moment: the number columns of the agents, and why they are blocked."""
        raise NotImplementedError

    def _copy_team_memories(self) -> dict[Any, Any]:
        """Return a copy of the memories of teams."""
        raise NotImplementedError

    def _read_states(self) -> None:
        """Call `make_states`; Ctrl-C waits until it has returned."""
        raise NotImplementedError

    def _get_drawn(self, order: Any) -> Any:
        """Return agents whose random streams were used in this turn, and the positions of these."""
        raise NotImplementedError

    def _draw_again(self, order: Any, drawn: Any) -> None:
        """Let random streams continue from earlier positions in this turn."""
        raise NotImplementedError

    def _split(self, order: Any, part: Any) -> tuple[Any, Any]:
        """Return the agents of a part that are asked, None: there are none; and those for which the core decides."""
        raise NotImplementedError

    def _find_shipped(self, order: Any) -> None:
        """Set `shipped` and `look_again` for the agents of an order."""
        raise NotImplementedError

    def _prepare_first(self, order: Any, part: Any) -> None:
        """Compute the neighborhoods of agents that are asked."""
        raise NotImplementedError

    def _tell_observers(self, order: Any, part: Any, observers: Any) -> Any:
        """Return the observers that need the states of the agents of a part; the others observe now."""
        raise NotImplementedError

    def _observe_first(self, order: Any, part: Any, observers: Any) -> dict[int, Any]:
        """Return slot -> state, for parts in which all agents have to observe before any decides."""
        raise NotImplementedError

    def _ask_at_arrivals(self, order: Any, part: Any, observers: Any) -> Any:
        """Return the moves of a part whose agents decide first, then on each arrival."""
        raise NotImplementedError

    def _ask_part(self, answers: Any, part: Any, seen: Any) -> None:
        """Call the strategies and plans of a part; `seen` has the states of agents by slot, None: they observe now."""
        raise NotImplementedError

    def _ask_plans(self, answers: Any, part: Any, seen: Any) -> None:
        """Call the plans of a part; see `_ask_part`."""
        raise NotImplementedError

    def _await_answers(self, answers: Any) -> None:
        """Wait for the answers of awaitables."""
        raise NotImplementedError

    def stop_losers(self, moves: Any) -> Any:
        """Keep the agents where they are that lose conflicts; return their slots, and where they wanted to go."""
        raise NotImplementedError

    def _apply_actions(self, moves: Any, part: Any, block: Any) -> None:
        """Write positions on edges, headings and flights of a part to the columns of the agents."""
        raise NotImplementedError

    def run_before_moves(self) -> bool:
        """Apply the rules before the moves; return whether there are moves."""
        state = self.state
        if state.parts_played is None and "before" in self.rules.now.phases:
            self._apply_rules("before")
            return state.over is None
        return True

    def repeat_moves(self) -> int:
        """Let all agents observe, decide and move, without what comes before and after; the turn is not counted."""
        plan = self.plan()
        self.begin_moves(plan)
        self.makes_states = True
        try:
            self.play_moves(plan)
        finally:
            self.makes_states = False
            self.end_moves()
        return 0

    def begin_moves(self, plan: TurnPlan) -> int:
        """Refuse a plan in which a team is left out, and prepare its phases."""
        order = plan.order
        if order.moving.take_lives():
            order.begin_more()
        if plan is not self.checked or order.may_be_refused:
            self._check(plan)
            self.checked = plan
        self.moves_of = order
        self.groups = order.groups
        self.spent = self.state.timings
        self.first = self.state.parts_played or 0
        self.part = self.first
        self.is_moving = True
        order.block.placed.clear()
        return 0

    def end_moves(self) -> int:
        """Tidy up after the phases of the plan."""
        self.is_moving = False
        if self.order_now is not self.moves_of:
            self._follow_order()
        return 0

    def run_after_moves(self) -> int:
        """Count the turn, apply the rules after the moves, and collect the values of the turn."""
        state = self.state
        state.turn += 1
        state.parts_played = None
        if "after" in self.rules.now.phases:
            self._apply_rules("after")
        if self.collectors.by_name:
            self._collect()
        return 0

    def end(self) -> int:
        """Show the end of the turn, also after an error in a rule: the turn counts for recordings and windows."""
        began = perf_counter()
        try:
            self._show()
        except KeyboardInterrupt:  # perhaps before it began
            self._show_missed()
            raise
        self.state.timings["draw"] += perf_counter() - began
        return 0

    def is_cut_short(self) -> bool:
        """Return whether a rule has ended the game."""
        return self.state.over is not None

    def list_living(self) -> list[Any]:
        """Return the living agents in the order of names."""
        order = self.order_now
        phase = self.phase
        if order is None or phase.agent is None or not phase.is_deciding:
            agents = self._ctx.agent
            block = agents.block
            if order is None or order.block is not block or order.entries != block.structure.entries:
                if not block.has_teams:
                    # NOTE: a changed set of agents requires no new order here, which costs more (decision 0057).
                    return self._select_living(block, agents)
                order = self.get_order()
        moving: MovingAgents = order.moving
        return moving.select_living(order.list_agents(self._ctx.agent.agents) if order.agents is None else order.agents)

    def _select_living(self, block: Any, agents: Any) -> list[Any]:
        """Return the living agents of a block in the order of names, without an order of turns."""
        key = self._named_of
        if key is None or key[0] is not block or key[1] != block.structure.entries:
            self._named = [agents.agents[name] for name in sorted(agents.agents)]
            self._named_of = block, block.structure.entries
        columns: AgentColumns = block
        found = []
        for one in self._named:
            agent: AgentView = one
            if columns._lives[agent._row]:
                found.append(agent)
        return found

    def play_decisions(self, number: int) -> int:
        """Let the agents of a part of the turn observe and decide."""
        state = self.state
        order = self.order_now
        part = order.parts[number]
        self.part = number
        if number > self.first:
            state.moves = self.whole  # for those that decide now
            if order.moving.take_lives():
                order.begin_more()
        if part.decides_at_arrivals:
            moves = self._ask_at_arrivals(order, part, self.observers)
        else:
            moves = self.ask(order, part, self.observers)
        state.moves = moves
        if order.whole.paced:
            moves.let_stand(order.moving.select_present(order.whole.paced), self.travel)
        return 0

    def ask(self, order: Any, part: Any, observers: Any, paths: Any = None) -> Any:
        """Return the moves that the agents of a part choose; `paths` receives paths by metres.

        Agents do not see each other's decisions: while a strategy runs, nothing can change, so all agents observe the
        same state even though each observes just before it decides. If a sensor may look at more than the world, all
        agents observe first.
        """
        answers = self.answers
        if observers:
            observers = self._tell_observers(order, part, observers)
        if observers or paths is not None or not self.decide_in_core(order, part):
            if self.phase.read_turn is not None:
                self.forget_states()
            self.decide(order, part, observers, paths)
        blocked = self.state.blocked
        if order.has_channels or blocked.known or blocked.stopped or answers.failures or answers.written:
            self._publish(order, part, answers)
        if answers.ends is answers.starts:
            answers.get_writable_ends()
        return self.make_moves(order, answers.starts, answers.ends, answers.actions, answers.moves, answers.paths)

    def decide_in_core(self, order: Any, part: Any) -> bool:
        """Let the core decide for the agents of a part whose strategies it has, and ask the others first.

        The states of the former are made when one is read; see `make_states`.

        Returns:
            False: all have to be asked.
        """
        phase = self.phase
        state = self.state
        if self.makes_states or state.turn < self.ask_until or order.slots.table.turn == state.turn:
            return False  # in the last case, a program has drawn the numbers of this turn from the state of an agent
        is_known = self.shipped_epoch == phase.epoch and self.shipped_seeds == self.seed_changes
        if self.shipped is None:
            is_known = is_known and state.turn < self.look_again
        else:
            is_known = is_known and self.shipped_revision == self.revised.revision
        if not is_known:
            self._find_shipped(order)
            self.shipped_epoch = phase.epoch
            self.shipped_seeds = self.seed_changes
            self.shipped_revision = self.revised.revision
        shipped = self.shipped
        if shipped is None or (shipped.remembers and phase.are_memories_known):
            return False
        block = order.block
        rest, own = self._split(order, part)
        if own is None or not shipped.load_places(block):
            return False
        if self.unread is not None and self.unread.shipped is not shipped:
            self.forget_states()
        is_unread = phase.read_turn is self.reader
        if shipped.remembers and not shipped.take_memories(are_known=is_unread):
            return False
        if is_unread:
            self.unread_turns += 1
        self.are_memories_in_core = shipped.remembers
        to = self._ask_none(order, part) if rest is None else self._ask_rest(order, rest)
        shipped.decide(state.turn, to)
        if shipped.remembers and block.is_noting:
            shipped.show_memories(of_start=False)
        blocked = state.blocked
        before = blocked.copy_blocked() if blocked.known or blocked.stopped else None
        known = self._copy_team_memories() if state.team_memories else {}
        self.unread = UnreadStates(shipped, order, own, bytes(block.games.memory), state.turn, before, known)
        phase.leave_unread(self.reader)
        return True

    def _ask_none(self, order: Any, part: Any) -> MoveColumns:
        """Return the moves of a part none of whose agents is asked: so far, all stay."""
        asked = part.in_core
        if asked is None:
            asked = part.prepare(order, NOT_ASKED)
            part.in_core = asked
        return self._begin_answers(order, asked)

    def _begin_answers(self, order: Any, asked: PartInCore) -> MoveColumns:
        """Return new moves of all agents, who stay so far, and collect the answers of a part in them."""
        both: Any = memoryview(bytearray(16 * asked.count)).cast(INT64)  # type: ignore[call-overload] # as in `block`
        starts = both[: asked.count]
        ends = both[asked.count :]
        to = MoveColumns(starts, ends)
        asked.moving.begin(to)
        self.answers.begin(order.slots, starts, ends, to)
        return to

    def _ask_rest(self, order: Any, rest: Any) -> MoveColumns:
        """Ask some agents of a part; return the moves of all, the others stay so far."""
        phase = self.phase
        unread = self.unread if phase.read_turn is self.reader else None
        self.unread = None
        phase.leave_unread(None)
        try:
            self.decide(order, rest)
        except BaseException:
            if unread is not None:
                self.unread = unread
                phase.leave_unread(self.reader)
            raise
        moves: MoveColumns = self.answers.moves
        return moves

    def make_states(self, part: Any = None) -> None:
        """Make the states of agents, and the data of their sensors, of the last turn that the core has decided.

        Args:
            part: the only agents whose states are made now; None: all.
        """
        unread = self.unread
        if unread is None:
            return
        phase = self.phase
        state = self.state
        order = unread.order
        if part is None:
            # NOTE: deciding twice takes longer, so programs that read every turn do without (benchmarks: turns).
            self.asks_for = 1 if self.unread_turns >= ENOUGH_UNREAD else min(2 * self.asks_for + 1, MOST_ASKED)
            self.unread_turns = 0
            self.ask_until = unread.turn + 1 + self.asks_for
        else:
            phase.leave_unread(None)
        self.unread = None
        now = bytes(order.block.games.memory), state.turn, state.blocked
        lives = order.moving.lives
        drawn = None if state.turn == unread.turn else self._get_drawn(order)
        player = phase.player
        team_memories = state.team_memories
        try:
            phase.player = get_ident()
            state.team_memories = unread.team_memories
            if unread.shipped.remembers:
                unread.shipped.show_memories(of_start=True)
            self._show_row(order, unread.memory, unread.turn, unread.blocked)
            order.slots.table.begin_again()
            order.moving.take_lives()
            self.decide(order, unread.part if part is None else part)
        finally:
            phase.player = player
            state.team_memories = team_memories
            self._show_row(order, *now)
            order.moving.let_take_part(lives)
            if drawn:
                self._draw_again(order, drawn)
            if part is None:
                self.are_memories_in_core = False
            else:
                self.unread = unread
                phase.leave_unread(self.reader)
                if unread.shipped.remembers and order.block.is_noting:
                    unread.shipped.show_memories(of_start=False)

    def read_states_of_turn(self) -> None:
        """Make the states of this turn before random numbers are drawn from the state of an agent."""
        if self.unread is not None and self.unread.turn == self.state.turn:
            self.phase.read_last_turn()

    def read_memories(self) -> None:
        """Make the states of the last turn, and with them the memories of agents for which the core has decided."""
        if self.unread is not None and self.unread.shipped.remembers:
            self.phase.read_last_turn()

    def show_memories(self) -> None:
        """Show the memories of agents for which the core decides, while others are asked."""
        if self.shipped is not None and self.shipped.remembers and self.are_memories_in_core:
            self.shipped.show_memories(of_start=False)

    def forget_states(self) -> None:
        """Do not make the states of the last turn, which others replace."""
        unread = self.unread
        self.unread = None
        if self.phase.read_turn is self.reader:
            self.phase.leave_unread(None)
            if unread is not None and unread.shipped.remembers:
                unread.shipped.show_memories(of_start=False)
                self.are_memories_in_core = False

    def decide(self, order: Any, part: Any, observers: Any = (), paths: Any = None) -> Any:
        """Return the decisions of the agents of a part, without publishing them; `paths` receives paths by metres."""
        phase = self.phase
        answers = self.answers
        if order.block.flyers:
            order.block.locate()  # the nodes below
        asked = part.in_core
        if asked is None or asked.version != phase.sensor_changes:
            asked = part.prepare(order, phase.sensor_changes)
            part.in_core = asked
        if asked.has_starts:
            self._begin_answers(order, asked)
        else:
            answers.begin(order.slots, order.get_nodes(), None, None)
        answers.paths = paths
        if asked.is_paced:
            self._leave_closed_edges(order, part.select_present(part.paced))
            self.travel.prepare(len(order.block))
        self.asked += 1
        self.asked_part = (order, part)
        self.is_deciding = True
        phase.moment = object() if asked.see_world_only else None
        phase.judge = SENSOR
        try:
            if self.asked == 1 and asked.individuals:
                self._prepare_first(order, part)
            if observers or not asked.see_world_only:
                self._ask_part(answers, part, self._observe_first(order, part, observers))
            elif asked.individuals:
                alike = []
                for look in asked.looks:
                    alike.append(look())  # noqa: PERF401 - a comprehension is not compiled as well
                ask_each(
                    answers,
                    phase,
                    asked.individuals,
                    asked.sensors,
                    asked.numbers,
                    answers.moves,
                    self.near,
                    alike,
                    asked.moving,
                    self.travel,
                )
                phase.agent = None
                if asked.has_plans:
                    self._ask_plans(answers, part, None)
            else:
                self._ask_part(answers, part, None)
            if answers.awaited:
                self._await_answers(answers)
        except BaseException:
            answers.drop()
            raise
        finally:
            phase.agent = None
            phase.moment = None
            phase.judge = ""
            self.is_deciding = False
        return answers

    def fit_moves(self) -> Any:
        """Return the moves of the turn for the present agents: a rule may have created and deleted agents."""
        moves = self.state.moves
        if moves.order is not self.order_now:
            moves = moves.fit_to_order(self.order_now)
            self.state.moves = moves
        return moves

    def move(self, number: int) -> int:
        """Move the agents of a part of the turn."""
        moves = self.fit_moves()
        order = moves.order
        part = order.parts[number]
        moving = part.in_core
        if moving is None:
            moving = part.prepare(order, NOT_ASKED)
        block = order.block
        ends = moves.ends
        agents = moving.moving
        if not agents.are_all or moves.took_part is not agents.lives:
            agents.leave_out(moves.starts, ends, moves.took_part)
        block.move_all(moving.ground, ends if moving.is_all_ground else part.select_ground(ends))
        moving.moving.count(moves.get_core_columns() if moves.columns is None else moves.columns)
        if not moving.has_starts:
            order.end(ends)
        if moving.is_paced or moves.actions:
            self._apply_actions(moves, part, block)
        if block.placed:
            rows = order.selection.rows
            block.placed.difference_update([rows[i] for i in order.moving.select_present(part.members)])
        if moves.paths is not None and not (block.placed or order.has_parts or block.flyers):
            moves.applied = block.version
        return 0

    def give_way(self, number: int) -> int:  # noqa: ARG002 - as all phases
        """Resolve conflicts, and stop the losers."""
        moves = self.fit_moves()
        agents = self.conflicting
        if agents is not None and agents.let_all_go(moves, self.state.turn):
            return 0
        stopped, places = self.stop_losers(moves)
        if len(stopped) > 0:
            self.state.blocked.add_conflicts(moves.order.names, stopped, places)
            moves.slots.show_blocked(stopped)
        return 0


class NodeConflicts:
    """The agents of one game with conflicts, which the core resolves on nodes.

    Attributes:
        numbers: numbers the nodes.
        rows: the starts and the ends of moves as numbers of places.
        room: the number of nodes for which there is working memory.
        order: the agents, in the form of the turn engine.
        takes_part, took_part: (agents,) whether each takes part, the others are in no conflict; and the same as bytes.
        conflicts: the conflicts.
        allow_swaps: whether they allowed agents to exchange nodes, when working memory was made.
        contests, requests: working memory, and the moves in the form of `core.conflicts`.
        found: (agents,) the agents that stay.
    """

    def __init__(self, numbers: NodeNumbers, rows: MoveColumns, found: memoryview[int]) -> None:
        self.takes_part = bytearray(len(found))
        self.took_part: bytes | None = None
        self.numbers = numbers
        self.rows = rows
        self.found = found
        self.room = -1
        self.order: Any = None
        self.conflicts: Any = None
        self.allow_swaps = True
        self.contests: Contests
        self.requests: MoveRequests

    def let_all_go(self, moves: TurnMovesInCore, turn: int) -> bool:
        """Return whether no agent has to stay in a turn on nodes; False also if that is not known."""
        if moves.order is not self.order or moves.columns is None or moves.paths is not None or moves.actions:
            return False
        is_same: bool = self.conflicts.allow_swaps == self.allow_swaps
        if moves.took_part is not self.took_part:
            self.let_take_part(moves.took_part)
        return is_same and self.write(moves.columns) and self.resolve(turn) == 0

    def let_take_part(self, took_part: bytes) -> None:
        """Leave other agents out from now on."""
        self.takes_part[:] = took_part
        self.took_part = took_part

    def write(self, moves: MoveColumns) -> bool:
        """Write the numbers of the starts and the ends of moves; return whether there is room for them."""
        self.numbers.write_moves(moves, self.rows)
        return self.numbers.room == self.room

    def resolve(self, turn: int) -> int:
        """Resolve the conflicts of the moves that were written; return the number of agents that stay, in `found`."""
        if conflicts.resolve(self.contests, self.requests, 0, turn) == 0:
            return 0
        return conflicts.find_losers(self.contests, self.found)


# -- shipped rules of one game ------------------------------------------------------------------------------------


class RuleOfGame:
    """A shipped rule in one game.

    Attributes:
        rule: the rule in the core; or a `Tagging`, for contacts alone.
        events: the events of the rules of the game.
        in_each_turn: functions of the context that are called before each turn.
    """

    def __init__(self, events: Events) -> None:
        self.events = events
        self.in_each_turn: list[Any] = []
        self.rule: Any = None

    def play(self, ctx: Any) -> list[Any]:
        """Apply the rule to the game; return the kind, the agent and the flag of each event."""
        rules.play(self.rule, 0)
        return [] if self.events.count == 0 else self.tell(ctx)

    def tell(self, ctx: Any) -> list[Any]:
        """Report the events of the core to the context; return the same as `play`."""
        raise NotImplementedError


class RuleMoves:
    """The moves of the agents of one game in a turn, as rules of the core read them, and these rules.

    Attributes:
        games: the columns of the agents.
        numbers: numbers the nodes.
        slots: (agents,) the move of each agent; -1: it took no part.
        game: takes the moves.
        order: the agents whose moves `slots` has; None: not known yet.
        seeds: how often the seed had changed when draws were last derived from it.
        rules: makes the rules, and keeps them by key; None: none was made.
    """

    def __init__(self, game: MovesForRules, games: GameColumns, slots: memoryview[int]) -> None:
        self.game = game
        self.games = games
        self.numbers = game.numbers
        self.slots = slots
        self.order: Any = None
        self.seeds = -1
        self.rules: Any = None

    def take_steps(self, moves: TurnMovesInCore, columns: AgentColumns) -> int:
        """Take the moves of agents along at most one edge each."""
        if moves.order is not self.order:
            self.slots = self.find_slots(moves.order, columns)
            self.order = moves.order
        taken = moves.get_core_columns() if moves.columns is None else moves.columns
        rules.take_moves(self.games, taken, columns.numbers, self.slots, moves.took_part)
        block: Any = columns
        if block.placed:
            self.note_placed(block)
        return 0

    def follow_agents(self) -> None:
        """Take agents that have come or left."""
        raise NotImplementedError

    def follow(self, ctx: Any) -> None:
        """Take the tracks of agents that may have moved along several edges, or parts of edges."""
        raise NotImplementedError

    def find_slots(self, order: Any, block: Any) -> memoryview[int]:
        """Return the slot of each agent in an order, (agents,); -1: it has none."""
        raise NotImplementedError

    def note_placed(self, block: Any) -> None:
        """Note the agents that were relocated after their moves."""
        raise NotImplementedError

    def has_room(self) -> bool:
        """Return whether the tables of the rules have room for all nodes and edges that are numbered."""
        known = self.rules
        game = self.game
        if known is None or known.pieces is not game.pieces or game.edge_numbers.count > game.keys:
            return False
        is_enough: bool = self.numbers.count <= known.most_numbers
        return is_enough

    def get_rule(self, ctx: Any, form: Any, key: Any) -> Any:
        """Return the rule of a form, ready to be played."""
        while True:
            if not self.has_room():
                self.renew_rules()
            known = self.rules
            found = known.kept.get(key)
            if found is None:
                found = known.make(form, key)
            for function in found.in_each_turn:
                function(ctx)
            if self.numbers.count <= known.most_numbers:  # no further nodes were numbered
                return found

    def renew_rules(self) -> None:
        """Make the rules again, with more room."""
        raise NotImplementedError


class MovesForRules:
    """The moves of a game for its rules: of the present turn, as long as nothing has changed.

    Attributes:
        phase: the phase of the context.
        state: the state of the game.
        numbers: numbers of the nodes.
        edge_numbers: numbers of the edges that agents may be on; empty in games that count edges.
        pieces: working memory for contacts.
        keys: the number of nodes or edges for which it has room.
        turns: the turn engine.
        block: the agents.
        bound: the column `node` of these agents that rules read; the block has another one when its memory has moved.
        revised: the object that counts the changes of the map.
        revision: the revision of the map.
        epoch: the epoch of the agents.
        turn_number: (1,) the number of turns played, for rules.
        steps, tracks: take moves along at most one edge each, and other moves; None: there were no others.
        now: the moves; None: they are not taken yet.
    """

    def __init__(
        self, phase: Any, state: Any, turns: GameTurn, numbers: NodeNumbers, revised: Any, revision: Any
    ) -> None:
        self.phase = phase
        self.state = state
        self.turns = turns
        self.numbers = numbers
        self.edge_numbers: NodeNumbers
        self.pieces: Any = None
        self.keys = 0
        self.revised = revised
        self.revision = revision
        self.epoch = -1
        self.block: AgentColumns
        self.bound: object = None
        self.turn_number: memoryview[int]
        self.steps: RuleMoves
        self.tracks: RuleMoves | None = None
        self.now: RuleMoves | None = None
        self._moves: Any = None
        self._version = 0
        self._turn = 0

    def is_of_map(self) -> bool:
        """Return whether the map and the settings are the same as before."""
        is_same: bool = self.revision == self.revised.revision and self.epoch == self.phase.epoch
        return is_same

    def begin(self, ctx: Any) -> int:
        """Take the present agents, and the number of the turn."""
        if self.epoch != self.phase.epoch:
            self.take_agents(ctx)
        if self.bound is not self.block.node:
            self.bind_columns()
        self.turn_number[0] = self.state.turn
        return 0

    def get_turn_moves(self, ctx: Any) -> Any:
        """Return the moves of this turn."""
        self.begin(ctx)
        state = self.state
        number = state.turn
        moves = state.moves
        now = self.now
        is_known = now is not None and moves is self._moves and self._turn == number
        # NOTE: before agents are moved, rules may undo their moves without changing a version.
        if not is_known or self._version != self.block.version or self.turns.is_moving:
            now = self.follow_moves(ctx, moves)
            self._moves = moves
            self._version = self.block.version
            self._turn = number
            self.now = now
        seeds = self.turns.seed_changes
        if now.seeds != seeds:  # type: ignore[union-attr] # it is known now
            now.draw_by(ctx, seeds)  # type: ignore[union-attr]
        return now

    def take_agents(self, ctx: Any) -> None:
        """Take the present agents."""
        raise NotImplementedError

    def bind_columns(self) -> None:
        """Let rules read the memory that the block of agents uses now."""
        raise NotImplementedError

    def make_tracks(self) -> RuleMoves:
        """Return new columns for moves of the present agents along several edges, or parts of edges."""
        raise NotImplementedError

    def follow_moves(self, ctx: Any, moves: Any) -> RuleMoves:
        """Take the moves of the turn; return them for rules."""
        if moves is not None and moves.are_steps(self.block):
            self.steps.take_steps(moves, self.block)
            return self.steps
        if self.tracks is None:
            self.tracks = self.make_tracks()
        self.tracks.follow(ctx)
        return self.tracks

    def get_any_moves(self, ctx: Any) -> RuleMoves:
        """Return the present agents, for rules that do not depend on how they have moved."""
        self.begin(ctx)
        return self.steps


class GamePlayer:
    """Plays a shipped rule in the game of a context, by calling it.

    Args:
        ctx: the context.
        find_game: returns the moves for rules of a context.
        form: builds the rule.
        play: called with the rule and the context; None: the rule is played as it is.
        follows: whether the rule depends on how agents have moved.
    """

    def __init__(self, ctx: Any, find_game: Any, form: Any, play: Any, *, follows: bool) -> None:
        self.ctx = ctx
        self.find_game = find_game
        self.form = form
        self.key = id(form)
        self.play = play
        self.follows = follows
        self.game: MovesForRules | None = None

    def __call__(self) -> None:
        """Play a turn."""
        game = self.game
        if game is None or not game.is_of_map():
            game = self.find_game(self.ctx)
            self.game = game
        moves = game.get_turn_moves(self.ctx) if self.follows else game.get_any_moves(self.ctx)
        rule = moves.get_rule(self.ctx, self.form, self.key)
        if self.play is None:
            rule.play(self.ctx)
        else:
            self.play(rule, self.ctx)
