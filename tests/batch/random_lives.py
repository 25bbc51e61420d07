"""Random games that follow from a seed: agents come and go, rules change, functions raise; in a batch and alone."""

import random
import re
from dataclasses import dataclass, field

import lives
from batch_scenes import plain

import gamms
from gamms import rules
from gamms.errors import GammsError

NAMES = ("a", "b", "bb", "m", "r0", "zz")  # before, between and after those of the start
KINDS = ("walk", "stay", "goto", "greedy", "chase")
LOOKS = (
    {"sensor_type": "AGENT"},
    {"sensor_type": "AGENT_RANGE", "sensor_range": 15.0},
    {"sensor_type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.7, "delay_turns": 1},
    {"sensor_type": "AGENT_RANGE", "sensor_range": 25.0, "false_alarm_rate": 0.5},
    {"sensor_type": "NEIGHBOR"},
)
SPEEDS = {"edges": [None, None, 1.0, 2.0, 1.5], "metres": [3.0, 7.0, 14.0], "arrivals": [7.0, 14.0, 25.0]}
IN_GAME = re.compile(r"In game (\d+) of a batch")


class Fault(Exception):
    """An error that a function raises once in a game."""


@dataclass
class Faults:
    """The errors that functions raise, once each.

    Attributes:
        left: (seed of a game, turn, place) -> the error.
    """

    left: dict = field(default_factory=dict)

    def meet(self, seed, turn, place):
        """Raise the error of a place, if there is one."""
        kind = self.left.pop((seed, turn, place), None)
        if kind is not None:
            raise kind(f"planted {place}")


@dataclass
class RandomGame:
    """A game and a batch of it.

    Attributes:
        ctx: the context of the game.
        seeds: the seeds of the games of the batch.
        reserved: team -> the names of agents that have a row before they come.
        faults: the errors that functions raise, where they are planted.
        planted: the errors to plant in the batch.
        is_stepped: whether the batch is played turn by turn.
    """

    ctx: object
    seeds: list
    reserved: dict
    faults: Faults
    planted: dict
    is_stepped: bool


def make_game(seed, size=None):
    """Return the random game of a seed, with a batch of `size` games; None: of 8 games, or of 40."""
    lot = random.Random(seed)
    way = lot.choice(["edges", "edges", "metres", "arrivals"])
    speed = lot.choice(SPEEDS[way])
    max_turns = lot.choice([4, 8, 12])
    ctx = gamms.create_context(seed=6, logger_config={"level": "CRITICAL"}, game={"max_turns": max_turns})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(lot.randint(2, 4), lot.randint(2, 5), spacing=10.0))
    if way != "edges":
        ctx.game.speed_unit = "metres"
        ctx.game.decide = "turn" if way == "metres" else "arrival"
    ctx.game.order = lot.choice([None, None, [["red"], ["blue"]], [["blue"], ["red"]]])
    capacity = lot.choice([None, {"capacity": 1}, {"capacity": None, "edge_capacity": 1}])
    if capacity is not None:
        ctx.game.conflicts = rules.Conflicts(**capacity)
    size = size or lot.choice([*[8] * 9, 40])
    seeds = lot.sample(range(2**40), size)
    planted = {}
    for place in lot.choices(["strategy", "before", "deeds", "after"], k=lot.choice([0, 0, 0, 1, 3])):
        planted[lot.choice(seeds), lot.randrange(max_turns), place] = lot.choice([Fault, KeyboardInterrupt])
    faults = Faults()
    for team in ("red", "blue"):
        for number in range(lot.randint(1, 2)):
            _create_agent(ctx, lot, f"{team[0]}{number}", team, speed, faults)
    for rule, phase in _draw_rules(lot, way, speed, has_faults=bool(planted)):
        ctx.game.add(rule, phase=phase)
    if any(place != "strategy" for *_, place in planted):
        for phase in ("before", "deeds", "after"):
            ctx.game.add(_make_rule_with_faults(faults, phase), phase=phase)
    changes = random.Random(-seed)  # another lot than that of the games without changes
    if changes.random() < 0.7:
        change = _call(lives.change, share=changes.choice([0.05, 0.2]), every=changes.choice([1, 2, 3, 50]))
        ctx.game.add(change, phase=changes.choice(["before", "deeds", "after"]))
    all_names = [f"{name}_{turn}" for name in NAMES for turn in range(4)]
    reserved = {"red": lot.sample(all_names, 8)} if lot.random() < 0.4 else {}
    return RandomGame(ctx, seeds, reserved, faults, planted, lot.random() < 0.4)


def _create_agent(ctx, lot, name, team, speed, faults):
    kind = lot.choice(["walk", "walk", "stay", "greedy", "greedy", "chase"])
    strategy = _make_greedy(faults) if kind == "greedy" else lives.make_strategy(ctx, kind)
    given = {} if speed is None else {"speed": speed}
    look = lot.choice([None, *LOOKS])
    if kind == "chase":
        look = LOOKS[0]
    if look is not None:
        ctx.sensor.create_sensor(f"eye_{name}", **look)
        given["sensors"] = [f"eye_{name}"]
    ctx.agent.create_agent(name, start_node_id=lot.randint(0, 3), team=team, strategy=strategy, **given)


def _make_greedy(faults):
    def greedy(state):
        """Go to the node chosen least often; a turn that is played again is counted once."""
        turn, chosen = state["turn"], state["memory"].setdefault("chosen", {})
        chosen.pop(turn, None)
        counts = [*chosen.values()]
        node = min(state["legal"], key=lambda one: (counts.count(one), one))
        if state["blocked"]:
            node = state["legal"][len(state["blocked"]) % len(state["legal"])]
        if "sensor" in state and len(str(state["sensor"])) % 7 == 0:
            node = state["legal"][-1]
        faults.meet(state["facts"]["key"], turn, "strategy")
        chosen[turn] = node
        state["action"] = node

    return greedy


def _make_rule_with_faults(faults, phase):
    def fail(ctx):
        faults.meet(ctx.seed, ctx.game.turn, phase)

    return fail


def publish_seed(ctx):
    """Tell strategies in which game they are."""
    ctx.game.publish(key=ctx.seed)


def _draw_rules(lot, way, speed, *, has_faults):
    """Return rules of agents that come and go, and shipped rules, each with its phase."""
    near = lot.choice([{"hops": 1}, {"metres": 12.0}, {"euclid": 12.0}, {"hops": 0}, {"hops": 2}])
    born = {
        "names": lot.sample(NAMES, lot.randint(1, 4)),
        "every": lot.randint(1, 3),
        "kinds": lot.sample(KINDS, lot.randint(1, 3)),
        "teams": lot.choice([["red"], ["blue"], ["red", "blue"]]),
        "speed": speed if way != "edges" or lot.random() < 0.5 else None,
        "alike": lot.choice([1, 2, 3, 5]),
    }
    if has_faults:  # memories stay when a turn is taken back
        born["kinds"] = ["walk" if kind == "greedy" else kind for kind in born["kinds"]]
    die = {"share": lot.choice([0.1, 0.3]), "delete": lot.choice([0.0, 0.5])}
    tag = {"then": lot.choice(["respawn", "eliminate"]), **near}
    own = [
        _call(lives.die, **die),
        _call(lives.dig),
        _call(lives.replace, share=0.2, back=0.5),
        _call(lives.tell, **near),
        _call(visits),
    ]
    shipped = [
        rules.tag("blue", "red", **tag),
        rules.reach("red", 0, winner="red"),
        rules.capture_flag({"red": 0, "blue": 3}, goal=4),
        rules.hold([0, 2], 1, ends=False),
        rules.arrive("red", 1),
        rules.respawn(2),
        rules.none_left("red", "blue"),
    ]
    chosen = lot.sample([*own, *shipped], lot.randint(1, 5))
    found = [(one, None if one in shipped else lot.choice(["before", "deeds", "after", "after"])) for one in chosen]
    found.append((_call(lives.born, **born), lot.choice(["before", "deeds", "after", "after"])))
    lot.shuffle(found)
    return [(publish_seed, "before"), *((one, phase or "after") for one, phase in found)]


def _call(function, **given):
    """Return a rule that calls a function with arguments."""

    def rule(ctx):
        function(ctx, **given)

    return rule


def visits(ctx):
    """Record who was where in the turn."""
    ctx.game.emit("visits", of=[(one.agent, one.node, one.time) for one in ctx.game.visits()])


def find_difference(game):
    """Play the batch and each game alone; return what differs as words; "": nothing does."""
    with game.ctx.game.batch(seeds=game.seeds, most_agents=game.reserved) as played:
        game.faults.left = dict(game.planted)
        error = None
        try:
            _play(game, played)
        except GammsError as raised:
            error = raised
        game.faults.left = {}
        number = 0
        if error is not None:
            found = IN_GAME.search(" ".join(getattr(error, "__notes__", [])))
            if found is None:
                return f"{type(error).__name__}: {error} names no game"
            number = int(found[1])
        results = [] if error is not None else [plain(played.result(i)) for i in range(len(game.seeds))]
    with game.ctx.game.fork(0).ctx as alone:
        if error is not None:
            return _compare_errors(game, alone, error, number)
        for number, seed in enumerate(game.seeds):
            alone.game.reset(seed=seed)
            wanted = plain(alone.game.run())
            if repr(wanted) != repr(results[number]):
                if any(at == seed and place == "after" for at, _, place in game.planted):
                    wanted = _play_with_faults(game, alone, seed)  # the last game is played as alone
                    if repr(wanted) == repr(results[number]):
                        continue
                return f"game {number}: {_describe(wanted, results[number])}"
    return ""


def _play(game, played):
    while not played.is_over.all():
        try:
            if game.is_stepped:
                played.step()
            else:
                played.run(warn=False)
        except (Fault, KeyboardInterrupt):
            pass


def _play_with_faults(game, alone, seed):
    game.faults.left = dict(game.planted)
    alone.game.reset(seed=seed)
    while True:
        try:
            result = alone.game.run()
        except (Fault, KeyboardInterrupt):
            continue
        game.faults.left = {}
        return plain(result)


def _compare_errors(game, alone, error, number):
    alone.game.reset(seed=game.seeds[number])
    try:
        alone.game.run()
    except GammsError as raised:
        if type(raised) is type(error) and str(raised) == str(error):
            return ""
        return f"alone {type(raised).__name__}: {raised}, in the batch {type(error).__name__}: {error}"
    return f"in the batch {type(error).__name__}: {error}"


def _describe(wanted, got):
    """Return the first difference between two results as words."""
    for key in wanted:
        one, other = wanted[key], got[key]
        if repr(one) == repr(other):
            continue
        if isinstance(one, list):
            for i in range(max(len(one), len(other))):
                pair = [repr(some[i]) if i < len(some) else "nothing" for some in (one, other)]
                if pair[0] != pair[1]:
                    return f"{key}[{i}] {pair[0][:300]} and not {pair[1][:300]}"
        if isinstance(one, dict):
            for name in {**one, **other}:
                if repr(one.get(name)) != repr(other.get(name)):
                    return f"{key}[{name}] {one.get(name)!r} and not {other.get(name)!r}"
            return f"{key}: order of {list(one)} and not {list(other)}"
        return f"{key} {one!r} and not {other!r}"
    return "?"
