"""Play random games through random faults, and check what must hold whatever fails.

    python scripts/simulate_faults.py --seed 1 [--minutes 10]

A seed decides the scenario, the players, the faults and their turns. `PARTS` are the parts of scenarios, `PLAYERS` the
people, models, robots and programs that take part, `FAULTS` the faults. Players wait by a simulated clock. What must
hold:

* with faults and players = without: no fault may change what agents do (`INVARIANTS`, after each game);
* alone = batch = resumed, and replay = original;
* rows resumed = rows fresh;
* only faults make players late, by no more than their time, and each choice counts once;
* no file is half-written, nor left;
* no process, descriptor or thread is left (`check_resources`);
* each fault is one logged sentence (`strike`);
* memory is flat (`play` for contexts, `check_flat` for turns, `Memory` for the rest);
* a run takes at most 6 CPU-s (`run_seed`), and ends (`failure_of`).

A failure prints the seed, the commit, and the parts, players and faults without which the run succeeds. The model is
the simulator of TigerBeetle (https://docs.tigerbeetle.com/concepts/safety/).
"""

import argparse
import asyncio
import ctypes
import gc
import io
import logging
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
import weakref
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, NoReturn

from fault_players import (
    ANSWER_S,
    BRIEF_S,
    LATE_S,
    TROUBLES,
    Model,
    ModelServer,
    Person,
    RoadSimulator,
    add_robot,
    remove_programs,
    send_no_fixes,
)
from fault_scenarios import MEASURE, PARTS, WALK, Draws, fail, press_ctrl_c

import gamms
from gamms import bridge, experiment, recordings, web
from gamms.context import Context
from gamms.errors import GammsError, WriteConflict
from gamms.game.result import Result
from gamms.recorder import RecorderBusy, Recording, RecordingError
from gamms.scenario import Scenario
from gamms.web.streams import Streams

HERE = Path(__file__).parent
TURNS = 8
GAMES = 3  # of a batch
SEEDS = 2  # of an experiment
INTERPRETED_EVERY = 20
MOST_CPU_S = 6.0  # of a run, which takes at most 2 on an idle machine; memory and caches that others use make it slower
TRIES = 3  # to keep within it
MOST_S = 60  # of a run, before it counts as one that hangs
TRAVEL_S = 2.0  # that robots take at most
ROBOT_S = 5.0  # that a turn waits for a robot which does not come
GRACE_S = 10.0  # for threads and processes that have been told to end
FLAT_EVERY = 4  # runs
BLOCK_TURNS = 256  # of recordings, which write so many turns at once
LONG_TURNS = 10
IN_WINDOWS = {"_Arrival"}  # classes of which a robot keeps the last ones, at most 50
WARM_RUNS = 20  # after which memory does not grow
FLAT = 300, 50_000  # objects and bytes by which memory may grow with each run, for caches
OF_PROCESS = {"gamms recordings"}  # threads that serve all contexts of the process, and end with it
CHOOSE_NODES = {"random_walk", "wander"}  # strategies
OF_PLAYERS = {"llm", "choice", "traffic_late"}  # events of players, who change nothing in the game

# -- scenarios --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A scenario and its faults, as drawn; dropping a part, a fault, a rule or agents leaves the others as they are.

    Attributes:
        seed: the seed of all draws.
        parts: names of `PARTS` and `PLAYERS`.
        faults: pairs of a turn and a name of `FAULTS`, sorted.
        dropped_rules: numbers of rules that are left out.
        count: the number of agents in each team on the ground.
    """

    seed: int
    parts: tuple[str, ...]
    faults: tuple[tuple[int, str], ...]
    dropped_rules: tuple[int, ...] = ()
    count: int = 2

    def draws(self, *purpose: object) -> Draws:
        """Return the random numbers of a purpose."""
        return Random(repr((self.seed, *purpose)))

    def scenario(self) -> Scenario:
        """Return the scenario of the parts."""
        team = {"count": self.count, "strategy": WALK}
        made: dict[str, Any] = {
            "map": {"grid": {"rows": 5, "columns": 5}},
            "teams": {"red": team, "blue": team},
            "max_turns": TURNS,
        }
        for name in self.parts:
            if name in PARTS:
                made = merge(made, PARTS[name](self.draws("part", name)))
        if order := made.get("settings", {}).get("order"):
            made["settings"]["order"] = [[team for team in one if team in made["teams"]] for one in order]
        rules = [rule for number, rule in enumerate(made.get("rules", [])) if number not in self.dropped_rules]
        return Scenario(folder=HERE, **{**made, "rules": rules})


def merge(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Return two nested mappings as one; lists follow each other."""
    merged = dict(one)
    for key, value in other.items():
        if isinstance(value, dict) and key in one:
            merged[key] = merge(one[key], value)
        elif isinstance(value, list) and key in one:
            merged[key] = one[key] + value
        else:
            merged[key] = value
    return merged


def draw_case(seed: int) -> Case:
    """Draw the parts of a scenario, its players and its faults."""
    draw = Random(f"case {seed}")
    parts = tuple(name for name in (*PARTS, *PLAYERS) if draw.random() < 0.5)
    names = draw.choices([*FAULTS], [fault.weight for fault in FAULTS.values()], k=draw.randint(2, 6))
    if "worker killed" in names:  # to start two processes takes most of the time of a run
        names = ["worker killed"]
        parts = tuple(name for name in parts if name in PARTS)
    faults = {(draw.randrange(TURNS), name) for name in names}  # a fault draws by its turn, so the same happens once
    return Case(seed, parts, tuple(sorted(faults)))


# -- a run ------------------------------------------------------------------------------------------------------------


class Broken(AssertionError):
    """An invariant does not hold."""

    def __init__(self, invariant: str, words: object) -> None:
        super().__init__(f"{invariant}: {words}")
        self.invariant = invariant


def hold(invariant: str, is_so: object, words: object = "") -> None:
    """Raise `Broken` unless an invariant holds."""
    if not is_so:
        raise Broken(invariant, words)


@dataclass
class Run:
    """A game that is played through its faults.

    Attributes:
        case: the scenario and its faults.
        scenario: its scenario.
        folder: the folder of its files.
        ctx: its context, which is recorded.
        clock: the clock of the players.
        truth: the result of the game without faults, which is in `truth.ggr`.
        warnings: the warnings and errors that have been logged.
        log: a sentence for each fault.
        files: the number of files of the recording, as `fill_disk` begins another one.
        server: the server of the models.
        roads: the simulator of roads; None: there is none.
        lates: the number of decisions of people and models that faults have prevented.
        warned: the names of the models of whose fallback a warning has told.
        began: the turn in which the file of the recording was begun.
        notes: turn -> what the game was after it.
    """

    case: Case
    scenario: Scenario
    folder: Path
    ctx: Context
    clock: bridge.SimulatedClock
    truth: Result
    warnings: list[str]
    log: list[str] = field(default_factory=list)
    files: int = 0
    server: ModelServer = field(default_factory=ModelServer)
    roads: RoadSimulator | None = None
    lates: int = 0
    warned: set[str] = field(default_factory=set)
    began: int = 0
    notes: dict[int, dict[str, Any]] = field(default_factory=dict)

    @property
    def seed(self) -> int:
        """The seed of the game."""
        return self.case.seed

    @property
    def obedient(self) -> Scenario:
        """The scenario of experiments, whose red agents obey orders, and whose games collect values."""
        teams = {"teams.red.strategy": "fault_scenarios:obey", "facts": {"orders": str(self.folder / "orders")}}
        rules = [rule for rule in self.scenario.to_dict().get("rules", []) if rule["rule"] != MEASURE["rule"]]
        return self.scenario.replace(**teams, rules=[*rules, MEASURE])

    def play_rows(self, out: str = "rows") -> experiment.Rows:
        """Play the rest of the experiment in a folder, of two lengths of games, each of which is a task."""
        vary = {"max_turns": [TURNS, TURNS - 2]}
        return experiment.run(self.obedient, range(SEEDS), vary, out=self.folder / out)

    def list_walkers(self) -> list[Any]:
        """Return the agents on the ground that decide in the next turn."""
        is_over = self.ctx.game.over is not None
        return [] if is_over else [one for one in self.ctx.game.agents if one.type != gamms.agent.AgentType.AERIAL]

    def draw_walker(self, draw: Draws) -> Any:
        """Draw an agent on the ground that decides in the next turn; None: there is none."""
        walking = self.list_walkers()
        return draw.choice(walking) if walking else None

    def list_free(self) -> list[Any]:
        """Return the agents that a person or a model may play: their strategies choose nodes, and no paths."""
        return [one for one in self.list_walkers() if getattr(one.strategy, "__name__", "") in CHOOSE_NODES]

    def draw_player(self, draw: Draws, kind: type, add: Callable[..., None], **options: Any) -> Any:
        """Draw the strategy of an agent that a player of a kind plays; let one join by `add` if there is none.

        None: there is no agent for a player.
        """
        walking = self.list_walkers()
        played = [one for one in walking if isinstance(one.strategy, kind)]
        free = self.list_free()
        if not played and free:
            played = [draw.choice(free)]
            add(self, played[0], **options)
        return draw.choice(played).strategy if played else None

    @contextmanager
    def fork(self) -> Iterator[Context]:
        """Fork the game, without its players."""
        with ExitStack() as stack:
            for agent in self.ctx.agent.create_iter():  # eliminated ones, too
                if isinstance(agent.strategy, (Person, Model)):
                    stack.enter_context(played_by(agent, agent.strategy.own))
            ctx = self.ctx.game.fork(1).ctx
        with ctx:
            remove_programs(ctx)
            yield ctx

    def record(self) -> None:
        """Begin another file of the recording."""
        self.files += 1
        self.began = self.ctx.game.turn
        self.ctx.record.start(self.folder / f"live {self.files}.ggr")

    def note(self) -> None:
        """Note what the game is after a turn."""
        game = self.ctx.game
        agents = {one.name: (one.current_node_id, one.alive) for one in self.ctx.agent.create_iter()}
        self.notes[game.turn] = {"agents": agents, "scores": dict(game.scores), "over": game.over}

    def step(self, most_s: float = ANSWER_S) -> None:
        """Play a turn; a player who fails may hold it for so many seconds, or until the deadline."""
        began = self.clock.now()
        self.ctx.game.step()
        parts = len(self.ctx.game.order or ("all",))
        most_s += BRIEF_S + parts * (BRIEF_S + TRAVEL_S)  # for roads, and for others and robots in each part
        hold("a turn waits no longer than it may", self.clock.now() - began <= most_s, self.clock.now() - began)

    @property
    def decision_s(self) -> float:
        """The longest time for decisions in a turn."""
        return min(ANSWER_S, self.ctx.game.deadline_s or inf)


Told = list[str]  # what the library says of a fault, in messages of errors, warnings and events


class Fault(NamedTuple):
    """A fault: its function, which returns what was said of it or None if it could not happen; and what it must say.

    Attributes:
        strike: lets it happen.
        says: the pattern of the one sentence about it; None: there is none, because nothing is lost.
        weight: how often it is drawn.
    """

    strike: Callable[[Run, Draws], Told | None]
    says: str | None
    weight: float = 1.0


def play(case: Case) -> list[str]:
    """Play a case; return a sentence for each fault.

    Raises:
        Broken: an invariant does not hold.
    """
    before = resources()
    with heard() as warnings, tempfile.TemporaryDirectory(prefix="gamms-faults-", ignore_cleanup_errors=True) as folder:
        run = begin(case, Path(folder), warnings)
        known = weakref.ref(run.ctx)
        with run.ctx:
            for turn, name in case.faults:
                play_until(run, turn)
                if run.ctx.game.turn < TURNS:  # several in a turn may play a turn each
                    strike(run, turn, name)
                    run.note()
            play_until(run, TURNS)
            if run.ctx.record.is_open:
                run.ctx.record.stop()
            for check in INVARIANTS.values():
                check(run)
        log = run.log
        del run
        gc.collect()
        hold("memory is flat", known() is None, "the context is still in memory")
        check_resources(before)
        return log


def play_until(run: Run, turn: int) -> None:
    """Play until so many turns are over, and note each."""
    while run.ctx.game.turn < min(turn, TURNS) and run.ctx.game.over is None:
        run.ctx.game.step()
        run.note()


def begin(case: Case, folder: Path, warnings: list[str]) -> Run:
    """Play the game without players and faults, and begin it with them."""
    scenario = case.scenario()
    truth = scenario.play(seed=case.seed, record=folder / "truth.ggr")
    ctx = scenario.build(seed=case.seed)
    clock = bridge.SimulatedClock()
    ctx.game.clock = clock
    run = Run(case, scenario, folder, ctx, clock, truth, warnings)
    run.play_rows("fresh")
    for name in case.parts:
        if name in PLAYERS:
            PLAYERS[name](run, case.draws("players", name))
    run.record()
    return run


# -- players ----------------------------------------------------------------------------------------------------------


def add_person(run: Run, agent: Any, *, is_here: bool = True) -> None:
    """Let a person play an agent from now on."""
    person = Person(agent.name, agent.strategy)
    agent.strategy = person
    person.open_page(run.ctx, is_here=is_here)


def add_model(run: Run, agent: Any) -> None:
    """Let a language model play an agent from now on."""
    agent.strategy = Model(f"model {agent.name}", agent.strategy, run.server)


def add_people(run: Run, draw: Draws) -> None:
    """Let one or two people play."""
    for _ in range(draw.randint(1, 2)):
        add_to_free(run, draw, add_person)


def add_models(run: Run, draw: Draws) -> None:
    """Let one or two language models play."""
    for _ in range(draw.randint(1, 2)):
        add_to_free(run, draw, add_model)


def add_to_free(run: Run, draw: Draws, add: Callable[[Run, Any], None]) -> None:
    """Let a player join for an agent that has none, if there is one."""
    free = run.list_free()
    if free:
        add(run, draw.choice(free))


def add_robots(run: Run, draw: Draws) -> None:
    """Let one or two robots drive agents."""
    walking = [agent.name for agent in run.list_walkers()]
    for name in draw.sample(walking, min(draw.randint(1, 2), len(walking))):
        add_robot(run.ctx, name, run.clock)


def add_roads(run: Run, _: Draws) -> None:
    """Let a program simulate the roads."""
    run.roads = RoadSimulator(run.clock)
    run.ctx.game.add(bridge.traffic(run.roads, wait_s=ANSWER_S), phase="before")


PLAYERS: dict[str, Callable[[Run, Draws], None]] = {
    "people": add_people,
    "models": add_models,
    "robots": add_robots,
    "roads": add_roads,
}
"""Name -> what lets players of this kind join a game."""


def strike(run: Run, turn: int, name: str) -> None:
    """Let a fault happen, and check what must hold after each."""
    fault = FAULTS[name]
    count = len(run.warnings)
    told = fault.strike(run, run.case.draws("fault", turn, name))
    if told is None:
        return
    told += run.warnings[count:]
    expected = 0 if fault.says is None else 1
    invariant = "each fault is one logged sentence"
    hold(invariant, len(told) == expected, f"of {name!r} was said {told}")
    for sentence in told:
        hold(invariant, re.search(str(fault.says), sentence), f"of {name!r} was said {sentence!r}")
        hold(invariant, "\n" not in sentence.strip(), f"of {name!r} was said {sentence!r}")
    run.log.append(f"turn {turn}: {name}: {' '.join(told) or 'nothing was lost'}")


# -- resources --------------------------------------------------------------------------------------------------------


class Resources(NamedTuple):
    """What a process holds."""

    descriptors: frozenset[str]
    threads: frozenset[str]
    processes: frozenset[str]


def resources() -> Resources:
    """Return what this process holds."""
    targets = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # the descriptor of this list is closed
            targets.add(f"{descriptor.name} {descriptor.readlink()}")
    children: set[str] = set()
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):  # the thread has ended
            children.update((task / "children").read_text().split())
    return Resources(
        frozenset(targets), frozenset(one.name for one in threading.enumerate()) - OF_PROCESS, frozenset(children)
    )


def check_resources(before: Resources) -> None:
    """Check that nothing is left that a run has opened."""
    until = time.monotonic() + GRACE_S
    gc.collect()
    while (left := [now - then for now, then in zip(resources(), before, strict=True)]) != [set()] * 3:
        if time.monotonic() > until:
            raise Broken("no process, descriptor or thread is left", [*map(sorted, left)])
        time.sleep(0.01)


@contextmanager
def heard() -> Iterator[list[str]]:
    """Collect the warnings and errors that GAMMS logs.

    Raises:
        Broken: Python warns of something that GAMMS has left, such as a task whose error no one has read.
    """
    sentences: list[str] = []
    others: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            (sentences if record.name == "gamms" else others).append(record.getMessage())

    listener = Listener(logging.WARNING)
    loggers = [logging.getLogger(name) for name in ("gamms", "asyncio", "py.warnings")]
    logging.captureWarnings(True)
    for logger in loggers:
        logger.addHandler(listener)
        logger.propagate = False
    try:
        yield sentences
        hold("each fault is one logged sentence", not others, others)
    finally:
        logging.captureWarnings(False)
        for logger in loggers:
            logger.propagate = True
            logger.removeHandler(listener)


@contextmanager
def limited(kind: int, most: int) -> Iterator[None]:
    """Lower a limit of the system for this process."""
    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(kind, before)


@contextmanager
def played_by(agent: Any, strategy: Any) -> Iterator[None]:
    """Let an agent have another strategy."""
    before = agent.strategy
    agent.strategy = strategy
    try:
        yield
    finally:
        agent.strategy = before


@contextmanager
def ruled_by(game: Any, call: Callable[[], None], draw: Draws) -> Iterator[None]:
    """Let a game have a rule that calls a function before agents move."""
    rule = game.add(lambda _: call(), phase=draw.choice(["before", "deeds"]), name="fault")
    try:
        yield
    finally:
        game.remove(rule)


def error_of(call: Callable[[], object], *kinds: type[BaseException]) -> Told:
    """Return the message of the error that a call raises; nothing if it succeeds."""
    try:
        call()
    except kinds as error:
        return [str(error) or type(error).__name__]
    return []


def events_since(ctx: Context, count: int, *kinds: str) -> Told:
    """Return the events of these kinds after the first `count` ones, as text."""
    return [str(event) for event in ctx.game.events[count:] if event["kind"] in kinds]


# -- faults -----------------------------------------------------------------------------------------------------------


def be_late(run: Run, draw: Draws) -> Told | None:
    """Let a person answer too late: the answer is refused, and the default strategy decides."""
    return delay_person(run, draw, LATE_S)


def leave(run: Run, draw: Draws) -> Told | None:
    """Let a person leave for a turn: the default strategy decides."""
    return delay_person(run, draw, inf)


def delay_person(run: Run, draw: Draws, delay_s: float) -> Told | None:
    """Delay the next answer of a person; a new one has not come yet."""
    person = run.draw_player(draw, Person, add_person, is_here=False)
    if person is None:
        return None
    person.delays.append(delay_s)
    count = len(run.ctx.game.events)
    run.step(run.decision_s)
    person.come()
    return note_late(run, count, "choice")


def time_out(run: Run, draw: Draws) -> Told | None:
    """Let a language model not answer, or answer nonsense: the fallback decides."""
    model = run.draw_player(draw, Model, add_model)
    if model is None:
        return None
    count = len(run.ctx.game.events)
    model.trouble = draw.choice([*TROUBLES])
    run.step(run.decision_s)
    model.trouble = None
    told = note_late(run, count, "llm")
    is_first = model.name not in run.warned
    run.warned.add(model.name)
    return [] if is_first else told  # the first one of a model is a warning, too


def note_late(run: Run, count: int, kind: str) -> Told:
    """Return the events after the first `count` ones by which a player has not decided, as text, and count them."""
    told = [str(event) for event in run.ctx.game.events[count:] if event["kind"] == kind and is_late(event)]
    run.lates += len(told)
    return told


def is_late(event: Mapping[str, Any]) -> bool:
    """Return whether an event says that a person or a model has not decided."""
    return event["kind"] in DECIDED and event["outcome"] != DECIDED[event["kind"]]


DECIDED = {"choice": "chosen", "llm": "answer"}  # kind of event -> the outcome of a decision


def lose_robot(run: Run, draw: Draws) -> Told | None:
    """Let a robot stop that drives an agent in a fork of the game: nothing comes, or its thread waits for a fix."""
    agent = run.draw_walker(draw)
    if agent is None:
        return None
    clock = bridge.SimulatedClock()
    with bridge.Feed(draw.choice([lambda: None, send_no_fixes()]), clock=clock) as feed:
        told = drive_in_fork(run, agent.name, clock, feed)
    hold("a turn waits no longer than it may", clock.now() <= ROBOT_S + 0.1, clock.now())
    return told


class JumpingClock(bridge.SimulatedClock):
    """A clock that is put forward by a day, once."""

    def __init__(self, sleeps: int) -> None:
        super().__init__()
        self._left = sleeps

    def sleep(self, seconds: float) -> None:
        """Advance the clock."""
        self._left -= 1
        super().sleep(86400.0 if self._left == 0 else seconds)


def put_clock_forward(run: Run, draw: Draws) -> Told | None:
    """Put the clock of a robot forward by a day, while a turn of a fork waits for the robot."""
    agent = run.draw_walker(draw)
    if agent is None:
        return None
    x, y = agent.xy
    clock = JumpingClock(draw.randint(1, 9))
    run.clock.sleep(86400.0)  # between two turns, this makes no one late
    return drive_in_fork(run, agent.name, clock, lambda: {"x": x - 500.0, "y": y, "t": clock.now()})


def drive_in_fork(run: Run, name: str, clock: bridge.SimulatedClock, source: Any) -> Told:
    """Play a turn of a fork in which a robot drives an agent; return what is said of it."""
    with run.fork() as ctx:
        count = len(ctx.game.events)
        ctx.game.add(bridge.drive(name, source, limit_s=ROBOT_S, clock=clock))
        ctx.game.step()
        return events_since(ctx, count, "robot_late")


def be_slow(run: Run, draw: Draws) -> Told | None:
    """Let the simulator of roads not answer in time: the roads stay as they are, and a late answer has no effect."""
    if run.ctx.game.over is not None:
        return None
    if run.roads is None:
        add_roads(run, draw)
    if run.ctx.game.turn in run.roads.turns:
        return None  # the turn has failed, and its answer still counts
    count = len(run.ctx.game.events)
    normal_s = run.roads.delay_s
    run.roads.delay_s = LATE_S
    run.step()
    run.roads.delay_s = normal_s
    return events_since(run.ctx, count, "traffic_late")


def watch_slowly(run: Run, _: Draws) -> Told | None:
    """Let a spectator follow who reads nothing until two turns are over, and then all of them."""
    ctx = run.ctx
    turn = ctx.game.turn
    following = Streams(ctx.graph.columns)
    ctx.record.follow(following)
    stream = following.get_stream(web.links.Audience())
    begin = stream.last_keyframe
    play_until(run, turn + 2)
    waited, *_ = stream.read(begin)
    following.get_stream(web.links.Audience())
    messages, place, dropped = stream.read(begin)
    hold("a slow spectator loses nothing", dropped == 0, dropped)
    hold("a slow spectator loses nothing", place.turns == ctx.game.turn - turn, place)
    hold("no turn waits for a spectator", len(waited) < 2 and len(messages) <= 2, (waited, messages))
    ctx.record.unfollow(following)
    following.close()
    return []


def kill_worker(run: Run, draw: Draws) -> Told | None:
    """Kill the process that plays a game of an experiment: another one plays it."""
    seed = draw.randrange(SEEDS)
    (run.folder / "orders").write_text("die 0")
    out = run.folder / "killed"
    vary = {"max_turns": [TURNS]}
    rows = experiment.run(run.obedient, [seed], vary, out=out, workers=1)  # more games would take more processes
    (run.folder / "orders").unlink(missing_ok=True)
    fresh = [row for row in experiment.load(run.folder / "fresh") if (row["seed"], row["max_turns"]) == (seed, TURNS)]
    hold("rows resumed = rows fresh", [*rows] == fresh, [*rows])
    shutil.rmtree(out)
    return []


def fill_disk(run: Run, draw: Draws) -> Told | None:
    """Let the disk be full while the game is recorded: the game goes on, and the file has the turns before."""
    ctx = run.ctx
    turn = ctx.game.turn
    file = run.folder / f"live {run.files}.ggr"
    if not ctx.record.is_open:
        return None

    def record_on() -> None:
        ctx.game.step()
        ctx.record.stop()

    with limited(resource.RLIMIT_FSIZE, file.stat().st_size + draw.randrange(40)):
        told = error_of(record_on, RecordingError)
    if ctx.record.is_open:
        told += error_of(ctx.record.stop, RecordingError)
    hold("a turn is counted once", ctx.game.turn <= turn + 1, ctx.game.turn)
    check_prefix(run, file)
    file.unlink()
    run.record()
    return told


def fill_disk_of_rows(run: Run, draw: Draws) -> Told | None:
    """Let the disk be full while an experiment writes rows, which goes on later."""
    run.ctx.record.stop()  # or its disk would be full, too
    with limited(resource.RLIMIT_FSIZE, draw.randrange(100, 1500)):
        told = error_of(run.play_rows, OSError)
    run.record()
    if not told:
        check_rows(run)  # they were written before, or are small
        return None
    return told


def fill_disk_of_file(run: Run, draw: Draws) -> Told | None:
    """Let the disk be full while a file is replaced, which stays as it was."""
    name, save = draw.choice([("saved.gamms", run.ctx.graph.save), ("saved.json", run.truth.save)])
    file = run.folder / name
    save(file)
    before = file.read_bytes()
    if run.ctx.record.is_open:
        run.ctx.record.stop()  # or its disk would be full, too
    with limited(resource.RLIMIT_FSIZE, draw.randrange(len(before))):
        told = error_of(lambda: save(file), OSError)
    hold("no file is half-written", file.read_bytes() == before, name)
    file.unlink()
    run.record()
    return told


def cut_file(run: Run, draw: Draws) -> Told | None:
    """Cut a recording anywhere: it opens to its first turns, from which the game goes on to the same end."""
    data = (run.folder / "truth.ggr").read_bytes()
    part = io.BytesIO(data[: draw.randrange(len(data))])
    try:
        with gamms.recorder.open(part) as recording:
            assert_goes_on(run, recording, recording.turns)
            return [] if recording.warning is None else [recording.warning]
    except RecordingError as error:
        return [str(error)]


def interrupt(run: Run, draw: Draws) -> Told | None:
    """Press Ctrl-C while an agent decides; see `fail_once`."""
    return fail_once(run, draw, press_ctrl_c, KeyboardInterrupt)


def raise_error(run: Run, draw: Draws) -> Told | None:
    """Let a strategy raise an error; see `fail_once`."""
    return fail_once(run, draw, fail, ValueError)


def fail_once(run: Run, draw: Draws, fail: Callable[[], None], kind: type[BaseException]) -> Told | None:
    """Let a decision or a rule fail before agents have moved: the turn is taken back.

    It begins again, or a snapshot is restored that was taken before.
    """

    def decide(state: dict[str, Any]) -> None:
        """Begin to decide, and fail."""
        state["action"] = state["legal"][-1]
        fail()

    async def wait_and_decide(state: dict[str, Any]) -> None:
        """Fail when players have decided, or while they do."""
        await asyncio.sleep(draw.choice([0.1, 1.0]))
        decide(state)

    agent = run.draw_walker(draw)
    if agent is None:
        return None
    game = run.ctx.game
    is_restored = draw.random() < 0.3
    if is_restored:
        run.ctx.record.stop()  # a game that is recorded cannot be restored
    before = game.snapshot()
    turn = game.turn
    failing = [played_by(agent, decide), played_by(agent, wait_and_decide), ruled_by(game, fail, draw)]
    with draw.choice(failing):
        told = error_of(game.step, kind)
    hold("a turn that fails is not counted", game.turn == turn, game.turn)
    if is_restored:
        game.restore(before)
        run.record()
    return told


def fail_in_batch(run: Run, draw: Draws) -> Told | None:
    """Press Ctrl-C in a batch, or let a strategy raise an error in it; it goes on to the ends of games alone."""
    number = draw.randrange(GAMES)
    (run.folder / "orders").write_text(f"{draw.choice(['interrupt', 'fail'])} {number}")
    with run.obedient.batch(GAMES, seed=0) as games:
        told = error_of(games.run, KeyboardInterrupt, ValueError)
        (run.folder / "orders").unlink(missing_ok=True)
        games.run()
        compare("alone = batch", plain(run.obedient.play(seed=number)), plain(games.result(number)))
    return told or None  # all games were over before


def interrupt_rows(run: Run, draw: Draws) -> Told | None:
    """Press Ctrl-C in an experiment, which goes on later."""
    (run.folder / "orders").write_text(f"interrupt {draw.randrange(2 * SEEDS)}")
    told = error_of(run.play_rows, KeyboardInterrupt)
    is_left = (run.folder / "orders").exists()
    (run.folder / "orders").unlink(missing_ok=True)
    return None if is_left else told  # all games had been played, or were over before


def run_out_of_descriptors(run: Run, draw: Draws) -> Told | None:
    """Let there be no descriptors: what opens files is refused, and works afterwards."""
    file = run.folder / "short.ggr"
    calls: list[Callable[[], object]] = [
        lambda: run.scenario.play(seed=run.seed, record=file),
        lambda: gamms.recorder.open(run.folder / "truth.ggr").close(),
        lambda: run.ctx.graph.save(run.folder / "short.gamms"),
        run.play_rows,
        lambda: bridge.Udp(to=("127.0.0.1", 9)).close(),
    ]
    call = draw.choice(calls)
    lowest = os.dup(0)  # the lowest number that is free
    os.close(lowest)
    with limited(resource.RLIMIT_NOFILE, lowest):
        told = error_of(call, OSError, GammsError)
    call()
    file.unlink(missing_ok=True)
    (run.folder / "short.gamms").unlink(missing_ok=True)
    return told


def write_twice(run: Run, draw: Draws) -> Told | None:
    """Let two write the same file or folder: the second is refused."""
    if draw.random() < 0.5:
        rows = run.folder / "rows"
        with gamms.folders.lock_folder(rows):
            return error_of(run.play_rows, WriteConflict)
    with run.fork() as ctx:
        start = partial(ctx.record.start, run.folder / f"live {run.files}.ggr", overwrite=draw.random() < 0.5)
        return error_of(start, FileExistsError, RecorderBusy)


def kill_player(run: Run, draw: Draws) -> Told | None:
    """Kill a program that records a game: soon after its last turn, the file has all turns."""
    file = run.folder / "killed.ggr"
    turns = draw.randint(1, TURNS)
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # of forks of programs with threads
        program = os.fork()
    if program == 0:
        with suppress(BaseException):
            ctx = run.scenario.build(seed=run.seed)
            ctx.record.start(file)
            ctx.game.run(turns)
            signal.pause()
        os._exit(1)
    until = time.monotonic() + GRACE_S
    try:
        while count_turns(file) < min(turns, run.truth.turns) and time.monotonic() < until:
            time.sleep(0.02)
    finally:
        os.kill(program, signal.SIGKILL)
        os.waitpid(program, 0)
    hold("turns are saved soon", count_turns(file) == min(turns, run.truth.turns), count_turns(file))
    check_prefix(run, file)
    file.unlink()
    return []


def count_turns(file: Path) -> int:
    """Return the turns in a recording that is still written; -1: it has none yet."""
    try:
        with gamms.recorder.open(file) as recording:
            return recording.turns
    except (FileNotFoundError, RecordingError):
        return -1


def lose_program(run: Run, draw: Draws) -> Told | None:
    """Let a program that simulates roads end, or say nothing, in a fork of the game: the roads stay as they are."""
    if run.ctx.game.over is not None:
        return None
    command, wait_s = draw.choice([("read turn", ANSWER_S), ("cat > /dev/null", 0.02)])
    with run.fork() as ctx, bridge.Process(["sh", "-c", command]) as link:
        count = len(ctx.game.events)
        ctx.game.add(bridge.traffic(link, wait_s=wait_s), phase="before")
        began = time.monotonic()
        ctx.game.step()
        hold("a turn waits no longer than it may", time.monotonic() - began < ANSWER_S / 2, "for a program")
        return events_since(ctx, count, "traffic_late")


FAULTS = {
    "late person": Fault(be_late, "choice.*(no choice in time|not there)"),
    "person who leaves": Fault(leave, "choice.*(no choice in time|not there)"),
    "model timeout": Fault(time_out, "plays its fallback|'llm'", weight=2.0),
    "dead robot": Fault(lose_robot, "robot_late.*no fix"),
    "clock jump": Fault(put_clock_forward, "robot_late.*waited_s"),
    "slow simulator": Fault(be_slow, "traffic_late"),
    "slow spectator": Fault(watch_slowly, None),
    "worker killed": Fault(kill_worker, None, weight=0.2),
    "disk full": Fault(fill_disk, "File too large|No space"),
    "disk full of rows": Fault(fill_disk_of_rows, "File too large|No space"),
    "disk full of a file": Fault(fill_disk_of_file, "File too large|No space"),
    "file cut": Fault(cut_file, "."),
    "Ctrl-C": Fault(interrupt, "KeyboardInterrupt", weight=2.0),
    "Ctrl-C in an experiment": Fault(interrupt_rows, "KeyboardInterrupt"),
    "strategy that raises": Fault(raise_error, "a fault of the strategy", weight=2.0),
    "descriptor shortage": Fault(run_out_of_descriptors, "Too many open files"),
    "two writers": Fault(write_twice, "Another|already|is being"),
    "player killed": Fault(kill_player, None, weight=0.3),
    "program lost": Fault(lose_program, "traffic_late", weight=0.5),
    "failure in a batch": Fault(fail_in_batch, "KeyboardInterrupt|a fault of the strategy"),
}


# -- invariants -------------------------------------------------------------------------------------------------------


def plain(result: Result) -> dict[str, Any]:
    """Return a result without what says how it was played, and without the events of players that failed."""
    values = result.to_dict()
    for name in ("timings", "provenance"):
        del values[name]
    values["events"] = [event for event in values["events"] if event["kind"] not in OF_PLAYERS]
    return values


def compare(invariant: str, one: dict[str, Any], other: dict[str, Any]) -> None:
    """Check that two results are equal; name the values that differ."""
    differing = {name: (one[name], other.get(name)) for name in one if one[name] != other.get(name)}
    hold(invariant, not differing, differing)


def check_faulty(run: Run) -> None:
    """With its faults, the game has ended as without them."""
    compare("with faults = without", plain(run.truth), plain(run.ctx.game.result()))


def check_players(run: Run) -> None:
    """Only faults have made players late, and each decision is one event."""
    invariant = "only faults make players late"
    events = run.ctx.game.events
    for agent in run.ctx.agent.create_iter():
        if isinstance(agent.strategy, Person):
            hold(invariant, not agent.strategy.flaws, agent.strategy.flaws)
            hold("no question is left", not agent.strategy.list_questions(), agent.strategy.list_questions())
    late = [event for event in events if is_late(event)]
    hold(invariant, len(late) == run.lates, f"{run.lates} by faults, and {late}")
    decided = Counter((event["turn"], event["agent"]) for event in events if event["kind"] in DECIDED)
    hold("each choice counts once", set(decided.values()) <= {1}, decided)
    hold(invariant, not events_since(run.ctx, 0, "robot_late"), events)


def check_batch(run: Run) -> None:
    """In a batch, the game is the one that is played alone, and its recording has the same bytes."""
    with run.scenario.batch(GAMES, seed=run.seed, record=True) as games:
        games.run()
        compare("alone = batch", plain(run.truth), plain(games.result(0)))
        games.record(0, run.folder / "batch.ggr")
        other = games.result(GAMES - 1)
    same = (run.folder / "batch.ggr").read_bytes() == (run.folder / "truth.ggr").read_bytes()
    hold("alone = batch", same, "the bytes of the recordings differ")
    compare("alone = batch", plain(run.scenario.play(seed=run.seed + GAMES - 1)), plain(other))


def check_resumed(run: Run) -> None:
    """Resumed from any turn of its recording, the game ends in the same way."""
    with gamms.recorder.open(run.folder / "truth.ggr") as recording:
        assert_goes_on(run, recording, run.case.draws("resumed").randint(0, recording.turns))


def assert_goes_on(run: Run, recording: Recording, turn: int) -> None:
    """Check that the game goes on from a turn of a recording as it went on without faults."""
    built = run.scenario.build(seed=run.seed)
    newcomers = {name for name in recording.state(turn).agents["name"] if name not in built.agent.agents}
    strategies = dict.fromkeys(newcomers, gamms.strategies.random_walk)
    with recording.resume(turn, strategies, ctx=built) as ctx:
        ctx.game.run(max(run.truth.turns - turn, 0))
        compare("alone = resumed", ends_of(run.truth), ends_of(ctx.game.result()))
        compare("alone = resumed", logs_of(run.truth), logs_of(ctx.game.result()))


def ends_of(result: Result) -> dict[str, Any]:
    """Return the part of a result that is not counted from where the game was resumed; deleted agents are in it."""
    kept = ("team", "alive", "node")
    agents = {name: [agent[key] for key in kept] for name, agent in result.agents.items()}
    return {"agents": agents, "scores": result.scores, "turns": result.turns, "winner": result.winner}


def logs_of(result: Result) -> dict[str, Any]:
    """Return what a recording has, too, of what a result lists."""
    return {name: getattr(result, name) for name in ("events", "deeds", "messages")}


def check_prefix(run: Run, file: Path) -> None:
    """Check that a recording that could not be finished has turns of the game, as they were."""
    with gamms.recorder.open(file) as recording, gamms.recorder.open(run.folder / "truth.ggr") as truth:
        for turn in range(recording.turns + 1) if recording.turns else ():
            state = recording.state(turn)
            places = [truth.state(then).agents["node"].tolist() for then in range(truth.turns + 1)]
            hold("no file is half-written", state.agents["node"].tolist() in places, recording.warning)


def check_replayed(run: Run) -> None:
    """Each file of the recording is whole, and the last one replays to the same places."""
    for file in sorted(run.folder.glob("live *.ggr")):
        recordings.verify(file)
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(run.folder / f"live {run.files}.ggr"):
            pass
        places = {agent.name: agent.xy for agent in ctx.agent.create_iter()}
        compare("replay = original", logs_of(run.ctx.game.result()), logs_of(ctx.game.result()))
    expected = {agent.name: agent.xy for agent in run.ctx.agent.create_iter()}
    hold("replay = original", places == expected, (places, expected))
    with gamms.recorder.open(run.folder / f"live {run.files}.ggr") as recording:
        for turn in (turn for turn in run.notes if turn > run.began):
            compare("replay = original", run.notes[turn], view_of(recording.state(turn - run.began)))


def view_of(state: gamms.recorder.State) -> dict[str, Any]:
    """Return a state of a recording as `Run.note` notes it."""
    columns = [state.agents[name].tolist() for name in ("name", "node", "alive")]
    agents = {name: (node, alive) for name, node, alive in zip(*columns, strict=True)}
    return {"agents": agents, "scores": state.scores, "over": state.over}


def check_rows(run: Run) -> None:
    """An experiment that was interrupted goes on to the rows of one that was not."""
    rows = run.play_rows()
    hold("rows resumed = rows fresh", [*rows] == [*experiment.load(run.folder / "fresh")], [*rows])
    for fresh in sorted((run.folder / "fresh").iterdir()):
        one, other = fresh.read_bytes(), (run.folder / "rows" / fresh.name).read_bytes()
        same = sorted(one.splitlines()) == sorted(other.splitlines()) if fresh.name == "journal.jsonl" else one == other
        hold("rows resumed = rows fresh", same, fresh.name)


def check_flat(run: Run) -> None:
    """Every few runs: a game takes no more memory with each turn, neither recorded nor with players and spectators.

    What it lists of its turns grows: events, as dicts, and numbers.
    """
    if run.seed % FLAT_EVERY or any(name == "worker killed" for _, name in run.case.faults):  # which takes long, too
        return
    parts = tuple(name for name in run.case.parts if name in ("map", "order", "conflicts"))
    scenario = Case(run.seed, parts, ()).scenario().replace(max_turns=None)
    file = run.folder / "long.ggr"
    with scenario.build(seed=run.seed) as ctx:
        ctx.record.start(file)
        ctx.game.run(2 * BLOCK_TURNS)
        before = count_blocks()
        ctx.game.run(BLOCK_TURNS)
        grown = (count_blocks() - before) / BLOCK_TURNS
    file.unlink()
    hold("memory is flat", grown < 0.5, f"{grown} more objects with each recorded turn")
    with scenario.build(seed=run.seed) as ctx:
        ctx.game.clock = bridge.SimulatedClock()
        long = replace(run, ctx=ctx, clock=ctx.game.clock, server=ModelServer())
        for add in PLAYERS.values():
            add(long, run.case.draws("long"))
        play_watched(ctx, LONG_TURNS)
        before = count_instances()
        play_watched(ctx, LONG_TURNS)
        grown = [kind for kind, count in (count_instances() - before).items() if count >= LONG_TURNS / 2]
        hold("memory is flat", not grown, f"more {grown} with each turn")


def count_blocks() -> int:
    """Return the number of objects of Python."""
    gc.collect()
    return sys.getallocatedblocks()


def count_instances() -> Counter[type]:
    """Return the number of objects of each class of GAMMS, and of tasks."""
    gc.collect()
    kinds = Counter(map(type, gc.get_objects()))
    known = [kind for kind in kinds if str(kind.__module__).startswith(("gamms", "_asyncio"))]
    return Counter({kind: kinds[kind] for kind in known if kind.__name__ not in IN_WINDOWS})


def play_watched(ctx: Context, turns: int) -> None:
    """Play turns, with another spectator in each."""
    for _ in range(turns):
        following = Streams(ctx.graph.columns)
        ctx.record.follow(following)
        ctx.game.step()
        ctx.record.unfollow(following)
        following.close()


FILES = re.compile(r"truth.ggr|live \d+.ggr|batch.ggr|(rows|fresh)(/(journal|rows|experiment|series)\.\w+)?")


def check_files(run: Run) -> None:
    """Only the files that the run was asked for exist."""
    found = [path.relative_to(run.folder).as_posix() for path in run.folder.rglob("*")]
    left = [name for name in found if not FILES.fullmatch(name)]
    hold("no file is half-written", not left, left)


INVARIANTS: dict[str, Callable[[Run], None]] = {
    "with faults = without": check_faulty,
    "only faults make players late": check_players,
    "alone = batch": check_batch,
    "alone = resumed": check_resumed,
    "replay = original": check_replayed,
    "rows resumed = rows fresh": check_rows,
    "memory is flat": check_flat,
    "no file is half-written": check_files,
}
"""What is checked at the end of a run; `strike` checks sentences and resources after each fault, `play` memory."""


# -- runs -------------------------------------------------------------------------------------------------------------


def failure_of(case: Case) -> str | None:
    """Return what fails in a case; None: nothing."""
    before = signal.signal(signal.SIGALRM, stop_hanging)
    signal.alarm(MOST_S)
    try:
        play(case)
    except Broken as error:
        return str(error)
    except Exception:  # noqa: BLE001 - any other error is a failure, too
        return traceback.format_exc()
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return None


def stop_hanging(*_: object) -> NoReturn:
    """Let a run fail that does not end."""
    raise Broken("a run ends", f"not within {MOST_S} s")


def minimize(case: Case, words: str) -> Case:
    """Drop parts of a case, as long as it fails in the same way."""
    kind = kind_of(words)
    while True:
        fails = (one for one in list_smaller(case) if (now := failure_of(one)) is not None and kind_of(now) == kind)
        smaller = next(fails, None)
        if smaller is None:
            return case
        case = smaller


def kind_of(words: str) -> str:
    """Return the invariant or the class of error in the words of a failure."""
    line = words.strip().splitlines()[-1] if words.startswith("Traceback") else words
    return line.partition(":")[0]


def list_smaller(case: Case) -> Iterator[Case]:
    """Yield the cases without one of the faults, parts, rules and agents."""
    for number in range(len(case.faults)):
        yield replace(case, faults=case.faults[:number] + case.faults[number + 1 :])
    for name in case.parts:
        yield replace(case, parts=tuple(one for one in case.parts if one != name))
    rules = len(case.scenario().spec.rules) + len(case.dropped_rules)
    for number in sorted({*range(rules)} - {*case.dropped_rules}):
        yield replace(case, dropped_rules=(*case.dropped_rules, number))
    if case.count > 1:
        yield replace(case, count=1)


def report(case: Case, words: str, least: Case) -> str:
    """Return the report of a case that fails, with its smallest form that does."""
    git = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False)
    core = "compiled" if gamms.core.is_compiled else "interpreted"
    return (
        f"seed {case.seed} fails at commit {git.stdout.strip()} ({core}): {words}\n"
        f"  case: {least}\n"
        f"  parts: {', '.join(least.parts) or 'none'}\n"
        f"  faults: {', '.join(f'{name} in turn {turn}' for turn, name in least.faults) or 'none'}\n"
        f"  scenario: {least.scenario().to_dict()}"
    )


def run_seed(seed: int) -> str | None:
    """Play a seed, every twentieth interpreted in another process; return the report of a failure."""
    if seed % INTERPRETED_EVERY == 0 and gamms.core.is_compiled:
        words = [sys.executable, __file__, "--seed", str(seed)]
        done = subprocess.run(
            words, env={**os.environ, "GAMMS_CORE": "python"}, capture_output=True, text=True, check=False
        )
        return (done.stdout + done.stderr) if done.returncode else None
    case = draw_case(seed)
    used = []
    while not used or (used[-1] > MOST_CPU_S and len(used) < TRIES):
        began = cpu_seconds()
        words = failure_of(case)
        used.append(cpu_seconds() - began)
        if words is not None:
            return report(case, words, minimize(case, words))
    if min(used) > MOST_CPU_S:
        return report(case, f"a run takes at most {MOST_CPU_S} CPU-s: {min(used):.1f}", case)
    return None


class _AllocatorInfo(ctypes.Structure):
    """What `mallinfo2` of the GNU C library returns."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


def allocated_bytes() -> int:
    """Return the bytes that this process has allocated, such as arrays, without small objects of Python."""
    mallinfo2 = ctypes.CDLL(None).mallinfo2
    mallinfo2.restype = _AllocatorInfo
    info = mallinfo2()
    return int(info.uordblks + info.hblkhd)


class Memory:
    """The growth of this process over many runs, after the first ones, which fill caches."""

    def __init__(self) -> None:
        self._runs = 0
        self._early: tuple[int, int] = 0, 0  # objects of Python, and bytes

    def check_run(self) -> str | None:
        """Count a run; return what has grown, if anything has."""
        gc.collect()
        now = sys.getallocatedblocks(), allocated_bytes()
        self._runs += 1
        if self._runs <= WARM_RUNS:
            self._early = now
            return None
        for what, new, old, most in zip(("objects", "bytes"), now, self._early, FLAT, strict=True):
            if new - old > most * self._runs:
                return f"memory is flat: {new - old} more {what} after {self._runs - WARM_RUNS} runs"
        return None


def cpu_seconds() -> float:
    """Return the processor time of this process and of those that it has started and that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Play random games through random faults.")
    parser.add_argument("--seed", type=int, default=1, help="the first seed")
    parser.add_argument("--minutes", type=float, default=0.0, help="further seeds are played for so long")
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start what runs in the background without it
    failure_of(Case(0, tuple(PLAYERS), ()))  # imports what the first run would have to pay for
    gc.collect()
    gc.freeze()  # or each run would look through all modules a dozen times: a third of its time
    until = time.monotonic() + 60.0 * options.minutes
    seed = options.seed
    failures = 0
    memory = Memory()
    while seed == options.seed or time.monotonic() < until:
        words = run_seed(seed) or memory.check_run()
        if words is not None:
            print(words, flush=True)
            failures += 1
        seed += 1
    print(f"{failures} failures in {seed - options.seed} runs from seed {options.seed}")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
