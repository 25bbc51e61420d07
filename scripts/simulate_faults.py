"""Play random games through random faults, and check what must hold whatever fails.

    python scripts/simulate_faults.py --seed 1 [--minutes 10]

A seed decides the scenario, the faults and their turns. `PARTS` are the parts of scenarios, `FAULTS` the faults,
`INVARIANTS` what must hold after a game. Without a fault, a game and its faulty twin end alike: no fault may change
what agents do. A failure prints the seed, the commit, and the parts and faults without which the run succeeds. The
model is the simulator of TigerBeetle (https://docs.tigerbeetle.com/concepts/safety/).
"""

import argparse
import gc
import io
import logging
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "llm"))

from loopback import LoopbackServer

import gamms
from gamms import bridge, experiment, llm, recordings, web
from gamms.context import Context
from gamms.errors import GammsError, WriteConflict
from gamms.game.result import Result
from gamms.recorder import Recording, RecordingError
from gamms.scenario import Scenario
from gamms.web.people import People
from gamms.web.streams import Streams

HERE = Path(__file__).parent
TURNS = 8
GAMES = 3  # of a batch, and of an experiment
INTERPRETED_EVERY = 20
SOON_S = 0.03  # the time that late people and models are given
GRACE_S = 10.0  # for threads and processes that have been told to end
FLAT_BYTES = 150_000_000  # growth of the process from the 20th run on
WALK = "gamms.strategies:random_walk"
OF_PROCESS = {"gamms recordings"}  # threads that serve all contexts of the process, and end with it
ANSWERS = {"llm", "choice"}  # events of players whose fallback decides as the game's own strategy does

Draws = Random


# -- scenarios --------------------------------------------------------------------------------------------------------


def draw_map(draw: Draws) -> dict[str, Any]:
    """Draw a grid of at least 25 nodes, in the middle of which roads may be closed."""
    closed = draw.choice([[], [[[5.0, 5.0], [15.0, 5.0], [15.0, 15.0], [5.0, 15.0]]]])
    grid = {"rows": draw.randint(5, 7), "columns": draw.randint(5, 7), "spacing": draw.choice([4.0, 10.0])}
    return {"map": {"grid": grid, "closed": closed}}


def draw_classes(draw: Draws) -> dict[str, Any]:
    """Draw agents of other speeds and kinds, on the ground and in the air."""
    unit = draw.choice(["edges", "metres"])
    teams = {"red": {"speed": draw.choice([1.0, 2.0])}, "blue": {"speed": draw.choice([1.0, 3.0])}}
    if draw.random() < 0.5:
        air = {"count": draw.randint(1, 2), "type": "aerial", "speed": draw.choice([4.0, 30.0]), "altitude": 9.0}
        teams["air"] = {**air, "strategy": WALK}
    return {"settings": {"speed_unit": unit}, "teams": teams}


def draw_strategies(draw: Draws) -> dict[str, Any]:
    """Draw strategies that look at others."""
    names = ["gamms.strategies:chase", "gamms.strategies:flee", "simulate_faults:wander"]
    teams = {team: {"strategy": draw.choice(names), "sensors": ["near"]} for team in ("red", "blue")}
    return {"sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}, "teams": teams}


RULES: list[dict[str, Any]] = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "hops": 1}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}},
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "metres": 6, "mutual": True}},
    {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}},
    {"rule": "hold", "with": {"nodes": [12, 7], "turns": 2, "ends": False, "score": 1}},
    {"rule": "discover", "with": {"nodes": {3: "flag", 18: [1, 2]}, "hops": 1}},
    {"rule": "resource", "with": {"name": "fuel", "start": 6, "per_turn": 1, "recharge": {6: 2}}},
    {"rule": "respawn", "with": {"after": 2}},
    {"rule": "simulate_faults:collect_toll"},
]


def draw_rules(draw: Draws) -> dict[str, Any]:
    """Draw up to four rules."""
    return {"rules": draw.sample(RULES, draw.randint(1, 4))}


def draw_conflicts(draw: Draws) -> dict[str, Any]:
    """Draw the capacity of nodes and who wins."""
    resolve = draw.choice(["at_random", {"by_priority": ["blue", "red"]}])
    return {"conflicts": {"capacity": draw.choice([1, 2]), "among": draw.choice(["all", "team"]), "resolve": resolve}}


def draw_channels(draw: Draws) -> dict[str, Any]:
    """Draw a channel, which `wander` uses."""
    radio = {"range_m": draw.choice([9.0, 30.0]), "delay_turns": draw.choice([1, 2]), "loss": draw.choice([0.0, 0.3])}
    return {"channels": {"radio": radio | {"relay": draw.random() < 0.3}}}


def draw_deeds(_: Draws) -> dict[str, Any]:
    """Declare deeds, which `wander` does."""
    return {"settings": {"deeds": {"scan": {"node": "node"}, "rest": {}}}}


def draw_sensors(draw: Draws) -> dict[str, Any]:
    """Draw sensors that err."""
    eyes = [
        {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.7},
        {"type": "AGENT_RANGE", "sensor_range": 35.0, "delay_turns": 2, "position_noise_m": 9.0},
        {"type": "AGENT", "false_alarm_rate": 0.4},
        {"type": "OCCLUDED_AGENT", "sensor_range": 35.0, "fov": 2.5},
    ]
    return {"sensors": {"eyes": draw.choice(eyes)}, "teams": {team: {"sensors": ["eyes"]} for team in ("red", "blue")}}


def draw_lives(_: Draws) -> dict[str, Any]:
    """Let agents come and go."""
    return {"rules": [{"rule": "simulate_faults:come_and_go"}]}


def draw_order(_: Draws) -> dict[str, Any]:
    """Let teams move in turn."""
    return {"settings": {"order": [["blue"], ["red", "air"]]}}


PARTS: dict[str, Callable[[Draws], dict[str, Any]]] = {
    "map": draw_map,
    "classes": draw_classes,
    "strategies": draw_strategies,
    "rules": draw_rules,
    "conflicts": draw_conflicts,
    "channels": draw_channels,
    "deeds": draw_deeds,
    "sensors": draw_sensors,
    "births and deaths": draw_lives,
    "order": draw_order,
}


def wander(state: dict[str, Any]) -> None:
    """Walk, talk, do and remember, as follows from what the agent knows."""
    before = [value for turn, value in state["memory"].items() if turn < state["turn"]]
    lot = state["draw"].below(1000) + sum(before) + len(state.get("inbox", ()))
    state["memory"][state["turn"]] = lot
    node = state["legal"][lot % len(state["legal"])]
    do = {"scan": {"node": node}} if lot % 2 else {"rest": None}
    state["action"] = {"node_id": node, "do": do} if "deeds" in state else node
    if lot % 3 == 0 and "outbox" in state:
        state["outbox"].append({"channel": "radio", "to": None, "body": lot % 9})


def collect_toll(ctx: Context) -> None:
    """Let teams pay on every third node, and count it in the data of the game."""
    paid = ctx.game.data.setdefault("toll", {})
    for agent in ctx.game.agents:
        if agent.current_node_id % 3 == 0:
            paid[agent.name] = paid.get(agent.name, 0) + 1
            ctx.game.scores[agent.team] = ctx.game.scores.get(agent.team, 0) - 1
            ctx.game.emit("toll", agent=agent.name, times=paid[agent.name])


def come_and_go(ctx: Context) -> None:
    """Let an agent come in the second turn, and one leave in the fifth."""
    if ctx.game.turn == 2:
        walk = gamms.strategies.random_walk
        ctx.agent.create_agent("newcomer", team="blue", start_node_id=ctx.seed % 25, strategy=walk)
    if ctx.game.turn == 5 and "red_1" in ctx.agent.agents:
        ctx.agent.delete_agent("red_1")


def obey(state: dict[str, Any]) -> None:
    """Walk at random; carry out, once, the order in the file that the facts name."""
    orders = Path(state["facts"]["orders"])
    if orders.exists() and state["turn"] == 2:
        order = orders.read_text()
        orders.unlink()
        ORDERS[order]()
    gamms.strategies.random_walk(state)


def die() -> None:
    """End this process without a word."""
    os.kill(os.getpid(), signal.SIGKILL)


def press_ctrl_c() -> None:
    """Interrupt this program as Ctrl-C does."""
    signal.raise_signal(signal.SIGINT)


ORDERS = {"die": die, "interrupt": press_ctrl_c}


@dataclass(frozen=True)
class Case:
    """A scenario and its faults, as drawn; dropping a part or a fault leaves the others as they are.

    Attributes:
        seed: the seed of all draws.
        parts: names of `PARTS`.
        faults: pairs of a turn and a name of `FAULTS`, sorted.
    """

    seed: int
    parts: tuple[str, ...]
    faults: tuple[tuple[int, str], ...]

    def draws(self, *purpose: object) -> Draws:
        """Return the random numbers of a purpose."""
        return Random(repr((self.seed, *purpose)))

    def scenario(self) -> Scenario:
        """Return the scenario of the parts."""
        team = {"count": 2, "strategy": WALK}
        made: dict[str, Any] = {
            "map": {"grid": {"rows": 5, "columns": 5}},
            "teams": {"red": team, "blue": team},
            "max_turns": TURNS,
        }
        for name in self.parts:
            made = merge(made, PARTS[name](self.draws("part", name)))
        if order := made.get("settings", {}).get("order"):
            made["settings"]["order"] = [[team for team in one if team in made["teams"]] for one in order]
        return Scenario(folder=HERE, **made)


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
    """Draw the parts of a scenario, and its faults."""
    draw = Random(f"case {seed}")
    parts = tuple(name for name in PARTS if draw.random() < 0.5)
    names = draw.choices([*FAULTS], [fault.weight for fault in FAULTS.values()], k=draw.randint(2, 6))
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
        truth: the result of the game without faults, which is in `truth.ggr`.
        warnings: the warnings and errors that have been logged.
        log: a sentence for each fault.
        files: the number of files of the recording, as `fill_disk` begins another one.
    """

    case: Case
    scenario: Scenario
    folder: Path
    ctx: Context
    truth: Result
    warnings: list[str]
    log: list[str] = field(default_factory=list)
    files: int = 0

    @property
    def seed(self) -> int:
        """The seed of the game."""
        return self.case.seed

    @property
    def obedient(self) -> Scenario:
        """The scenario of experiments, whose red agents obey orders."""
        teams = {"teams.red.strategy": "simulate_faults:obey", "facts": {"orders": str(self.folder / "orders")}}
        return self.scenario.replace(**teams)

    def play_rows(self, **options: Any) -> experiment.Rows:
        """Play the rest of the experiment."""
        return experiment.run(self.obedient, range(GAMES), out=self.folder / "rows", **options)

    def walker(self, draw: Draws) -> Any:
        """Return an agent on the ground that decides in the next turn; None: there is none."""
        walking = [agent for agent in self.ctx.game.agents if agent.type != gamms.agent.AgentType.AERIAL]
        return draw.choice(walking) if walking and self.ctx.game.over is None else None

    def record(self) -> None:
        """Begin another file of the recording."""
        self.files += 1
        self.ctx.record.start(self.folder / f"live {self.files}.ggr")


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
                while run.ctx.game.turn < turn and run.ctx.game.step():
                    pass
                if run.ctx.game.turn < TURNS:  # several in a turn may play a turn each
                    strike(run, turn, name)
            run.ctx.game.run(max(TURNS - run.ctx.game.turn, 0))
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


def begin(case: Case, folder: Path, warnings: list[str]) -> Run:
    """Play the game without faults, and begin it with them."""
    scenario = case.scenario()
    truth = scenario.play(seed=case.seed, record=folder / "truth.ggr")
    ctx = scenario.build(seed=case.seed)
    run = Run(case, scenario, folder, ctx, truth, warnings)
    experiment.run(run.obedient, range(GAMES), out=folder / "fresh")
    run.record()
    return run


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
    """Collect the warnings and errors that are logged."""
    sentences: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            sentences.append(record.getMessage())

    listener = Listener(logging.WARNING)
    logger = logging.getLogger("gamms")
    logger.addHandler(listener)
    logger.propagate = False
    try:
        yield sentences
    finally:
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
    """Let a person be asked who does not answer: the default strategy decides."""
    agent = run.walker(draw)
    if agent is None:
        return None
    ctx = run.ctx
    count = len(ctx.game.events)
    with played_by(agent, web.human("late", seconds=SOON_S, joins_within=SOON_S, otherwise=agent.strategy)):
        people = People.open(ctx)
        if draw.random() < 0.5:
            people.come("late")
        ctx.game.step()
    ctx.game.remove(people)
    return events_since(ctx, count, "choice")


def time_out(run: Run, draw: Draws) -> Told | None:
    """Let a language model be asked that does not answer, or answers nonsense: the fallback decides."""
    agent = run.walker(draw)
    if agent is None:
        return None
    ctx = run.ctx
    count = len(ctx.game.events)
    stopped = threading.Event()
    server = LoopbackServer()
    server.script = draw.choice([lambda _: stopped.wait(5.0) and {"move": 0}, lambda _: b"nonsense"])
    try:
        strategy = llm.Strategy(
            server.url, f"model {draw.random()}", "Go.", seconds=SOON_S, attempts=1, fallback=agent.strategy
        )
        with played_by(agent, strategy):
            ctx.game.step()
    finally:
        stopped.set()
        server.close()
    decided = events_since(ctx, count, "llm")
    hold("each decision of a model is an event", len(decided) == 1, decided)
    return []


def lose_robot(run: Run, draw: Draws) -> Told | None:
    """Let a robot stop that drives an agent in a fork of the game."""
    agent = run.walker(draw)
    if agent is None:
        return None
    return drive_in_fork(run, agent.name, bridge.SimulatedClock(), lambda: None)


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
    agent = run.walker(draw)
    if agent is None:
        return None
    x, y = agent.xy
    clock = JumpingClock(draw.randint(1, 9))
    return drive_in_fork(run, agent.name, clock, lambda: {"x": x - 500.0, "y": y, "t": clock.now()})


def drive_in_fork(run: Run, name: str, clock: bridge.SimulatedClock, source: Any) -> Told:
    """Play a turn of a fork in which a robot drives an agent; return what is said of it."""
    with run.ctx.game.fork(1).ctx as ctx:
        count = len(ctx.game.events)
        ctx.game.add(bridge.drive(name, source, limit_s=5.0, clock=clock))
        ctx.game.step()
        return events_since(ctx, count, "robot_late")


def be_slow(run: Run, _: Draws) -> Told | None:
    """Let the simulator of roads not answer in time, in a fork: the roads stay as they are."""
    if run.ctx.game.over is not None:
        return None
    with run.ctx.game.fork(1).ctx as ctx, bridge.Udp(listen=("127.0.0.1", 0), to=("127.0.0.1", 9)) as link:
        count = len(ctx.game.events)
        ctx.game.add(bridge.traffic(link, wait_s=SOON_S), phase="before")
        ctx.game.step()
        return events_since(ctx, count, "traffic_late")


def watch_slowly(run: Run, _: Draws) -> Told | None:
    """Let a spectator follow who reads nothing until the turn is over, and then all of it."""
    ctx = run.ctx
    following = Streams(ctx.graph.columns)
    ctx.record.follow(following)
    stream = following.of(web.links.Audience())
    ctx.game.step()
    messages, place, dropped = stream.read(stream.last_keyframe)
    hold("a slow spectator loses nothing", messages and dropped == 0, (place, dropped))
    ctx.record.unfollow(following)
    following.close()
    return []


def kill_worker(run: Run, _: Draws) -> Told | None:
    """Kill the process that plays a game of an experiment: another one plays it."""
    (run.folder / "orders").write_text("die")
    run.play_rows(workers=1)
    (run.folder / "orders").unlink(missing_ok=True)
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
    with limited(resource.RLIMIT_FSIZE, draw.randrange(100, 300)):
        told = error_of(run.play_rows, OSError)
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

    def fail() -> None:
        raise ValueError("a fault of the strategy")

    return fail_once(run, draw, fail, ValueError)


def fail_once(run: Run, draw: Draws, fail: Callable[[], None], kind: type[BaseException]) -> Told | None:
    """Let a decision fail: the turn is not counted. It begins again, or a snapshot is restored that was taken before.

    In an order of play, the teams that have moved before the error stay where they went, until a snapshot is restored.
    """

    def decide(state: dict[str, Any]) -> None:
        """Begin to decide, and fail."""
        state["action"] = state["legal"][-1]
        fail()

    agent = run.walker(draw)
    if agent is None:
        return None
    game = run.ctx.game
    is_restored = game.order is not None or draw.random() < 0.5
    if is_restored:
        run.ctx.record.stop()  # a game that is recorded cannot be restored
    before = game.snapshot()
    turn = game.turn
    with played_by(agent, decide):
        told = error_of(game.step, kind)
    hold("a turn that fails is not counted", game.turn == turn, game.turn)
    if is_restored:
        game.restore(before)
        run.record()
    return told


def interrupt_rows(run: Run, _: Draws) -> Told | None:
    """Press Ctrl-C in an experiment, which goes on later."""
    (run.folder / "orders").write_text("interrupt")
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
    with run.ctx.game.fork(1).ctx as ctx:
        return error_of(lambda: ctx.record.start(run.folder / f"live {run.files}.ggr"), FileExistsError, RecordingError)


FAULTS = {
    "late person": Fault(be_late, "choice.*(no choice in time|not there)"),
    "model timeout": Fault(time_out, "plays its fallback"),
    "dead robot": Fault(lose_robot, "robot_late.*no fix"),
    "clock jump": Fault(put_clock_forward, "robot_late.*waited_s"),
    "slow simulator": Fault(be_slow, "traffic_late"),
    "slow spectator": Fault(watch_slowly, None),
    "worker killed": Fault(kill_worker, None, weight=0.2),
    "disk full": Fault(fill_disk, "File too large|No space"),
    "disk full of rows": Fault(fill_disk_of_rows, "File too large|No space"),
    "file cut": Fault(cut_file, "."),
    "Ctrl-C": Fault(interrupt, "KeyboardInterrupt"),
    "Ctrl-C in an experiment": Fault(interrupt_rows, "KeyboardInterrupt"),
    "strategy that raises": Fault(raise_error, "a fault of the strategy"),
    "descriptor shortage": Fault(run_out_of_descriptors, "Too many open files"),
    "two writers": Fault(write_twice, "Another|already|is being"),
}


# -- invariants -------------------------------------------------------------------------------------------------------


def plain(result: Result) -> dict[str, Any]:
    """Return a result without what says how it was played, and without the events of players that failed."""
    values = result.to_dict()
    for name in ("timings", "provenance"):
        del values[name]
    values["events"] = [event for event in values["events"] if event["kind"] not in ANSWERS]
    return values


def compare(invariant: str, one: dict[str, Any], other: dict[str, Any]) -> None:
    """Check that two results are equal; name the values that differ."""
    differing = {name: (one[name], other.get(name)) for name in one if one[name] != other.get(name)}
    hold(invariant, not differing, differing)


def check_faulty(run: Run) -> None:
    """With its faults, the game has ended as without them."""
    compare("with faults = without", plain(run.truth), plain(run.ctx.game.result()))


def check_batch(run: Run) -> None:
    """In a batch, the game is the one that is played alone, and its recording has the same bytes."""
    with run.scenario.batch(GAMES, seed=run.seed, record=True) as games:
        games.run()
        compare("alone = batch", plain(run.truth), plain(games.result(0)))
        games.record(0, run.folder / "batch.ggr")
    same = (run.folder / "batch.ggr").read_bytes() == (run.folder / "truth.ggr").read_bytes()
    hold("alone = batch", same, "the bytes of the recordings differ")


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
        there = {*ctx.agent.agents}
        compare("alone = resumed", ends_of(run.truth, there), ends_of(ctx.game.result(), there))


def ends_of(result: Result, names: set[str]) -> dict[str, Any]:
    """Return the part of a result that is not counted from where the game was resumed, for agents of these names."""
    kept = ("team", "alive", "node")
    agents = {name: [agent[key] for key in kept] for name, agent in result.agents.items() if name in names}
    return {"agents": agents, "scores": result.scores, "turns": result.turns, "winner": result.winner}


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
    expected = {agent.name: agent.xy for agent in run.ctx.agent.create_iter()}
    hold("replay = original", places == expected, (places, expected))


def check_rows(run: Run) -> None:
    """An experiment that was interrupted goes on to the rows of one that was not."""
    rows = run.play_rows()
    hold("rows resumed = rows fresh", [*rows] == [*experiment.load(run.folder / "fresh")], [*rows])
    for file in ("rows.csv", "rows.jsonl"):
        same = (run.folder / "rows" / file).read_bytes() == (run.folder / "fresh" / file).read_bytes()
        hold("rows resumed = rows fresh", same, file)


FILES = re.compile(r"truth.ggr|live \d+.ggr|batch.ggr|(rows|fresh)(/(journal|rows|experiment)\.\w+)?")


def check_files(run: Run) -> None:
    """Only the files that the run was asked for exist."""
    found = [path.relative_to(run.folder).as_posix() for path in run.folder.rglob("*")]
    left = [name for name in found if not FILES.fullmatch(name)]
    hold("no file is half-written", not left, left)


INVARIANTS: dict[str, Callable[[Run], None]] = {
    "with faults = without": check_faulty,
    "alone = batch": check_batch,
    "alone = resumed": check_resumed,
    "replay = original": check_replayed,
    "rows resumed = rows fresh": check_rows,
    "no file is half-written": check_files,
}
"""What is checked at the end of a run; `strike` checks sentences and resources after each fault, `play` memory."""


# -- runs -------------------------------------------------------------------------------------------------------------


def failure_of(case: Case) -> str | None:
    """Return what fails in a case; None: nothing."""
    try:
        play(case)
    except Broken as error:
        return str(error)
    except Exception:  # noqa: BLE001 - any other error is a failure, too
        return traceback.format_exc()
    return None


def minimize(case: Case) -> Case:
    """Drop parts and faults of a case that fails, as long as it fails."""
    for name in case.parts:
        fewer = replace(case, parts=tuple(one for one in case.parts if one != name))
        case = fewer if failure_of(fewer) else case
    for number in reversed(range(len(case.faults))):
        fewer = replace(case, faults=case.faults[:number] + case.faults[number + 1 :])
        case = fewer if failure_of(fewer) else case
    return case


def report(case: Case, words: str) -> str:
    """Return the report of a case that fails."""
    least = minimize(case)
    git = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=HERE, capture_output=True, text=True, check=False)
    core = "compiled" if gamms.core.is_compiled else "interpreted"
    return (
        f"seed {case.seed} fails at commit {git.stdout.strip()} ({core}): {words}\n"
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
    words = failure_of(case)
    return None if words is None else report(case, words)


def resident_bytes() -> int:
    """Return how much memory this process has."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


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
    llm.connect("http://127.0.0.1:9")  # imports what the first run would have to pay for
    until = time.monotonic() + 60.0 * options.minutes
    seed = options.seed
    failures = 0
    longest = 0.0
    early_bytes = 0
    while seed == options.seed or time.monotonic() < until:
        began = cpu_seconds()
        words = run_seed(seed)
        longest = max(longest, cpu_seconds() - began)
        early_bytes = early_bytes if seed - options.seed > INTERPRETED_EVERY else resident_bytes()
        if resident_bytes() > early_bytes + FLAT_BYTES:
            words = f"memory is flat: {resident_bytes()} bytes at seed {seed}, {early_bytes} at the beginning"
        if words is not None:
            print(words, flush=True)
            failures += 1
        seed += 1
    print(f"{failures} failures in {seed - options.seed} runs from seed {options.seed}; {longest:.1f} CPU-s at most")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
