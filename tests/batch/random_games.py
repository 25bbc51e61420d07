"""Random games: maps, teams, rules, strategies, sensors and channels, to be played in batches and alone."""

from dataclasses import dataclass, field
from math import inf

import numpy as np
from hypothesis import strategies as st
from random_players import (
    CALLED,
    CHANNELS,
    DEEDS,
    FLYING,
    NODES,
    PACED,
    TAKEN,
    FirstOnly,
    agreed,
    attentive,
    busy,
    caller,
    curious,
    go_on,
    rash,
    strike,
)

import gamms
from gamms.game.settings import get_rule_spec
from gamms.rules import (
    Conflicts,
    arrive,
    at_random,
    by_priority,
    capture_flag,
    cooldown,
    discover,
    hold,
    last_team,
    nobody,
    none_left,
    payoff,
    reach,
    resource,
    respawn,
    tag,
    territory,
    time_limit,
)
from gamms.strategies import random_walk

LENGTHS = (0.5, 0.7, 1.1, 0.5, 0.7, 1.1, 1e-9)
TEAMS = ("red", "blue", "green", None)

nodes, teams = st.sampled_from(NODES), st.sampled_from(TEAMS[:3])
scores = st.sampled_from([0, 1, 2, 0.1])
distances = st.one_of(
    st.just({}),
    st.fixed_dictionaries({"hops": st.sampled_from([0, 1, 2.5])}),
    st.fixed_dictionaries({"metres": st.sampled_from([0.7, 1.9])}),
    st.fixed_dictionaries({"euclid": st.sampled_from([1, 1.5])}),
)
owners = st.dictionaries(nodes, st.sampled_from(TEAMS), min_size=4)
places = st.lists(nodes, min_size=1, max_size=4, unique=True)


@st.composite
def tags(draw):
    keywords = draw(distances) | draw(
        st.fixed_dictionaries(
            {"then": st.sampled_from(["respawn", "eliminate"]), "score": scores},
            optional={
                "territory": st.one_of(owners, st.just("land")),
                "mutual": st.booleans(),
                "passing": st.booleans(),
                "crossing": st.booleans(),
                "air": st.booleans(),
            },
        )
    )
    return tag(draw(teams), draw(teams), **keywords)


flags = st.builds(
    capture_flag,
    st.dictionaries(teams, nodes, min_size=1),
    territory=st.one_of(st.none(), owners, st.just("land")),
    goal=st.sampled_from([None, 1, 2]),
    score=scores,
    passing=st.booleans(),
    announce=st.sampled_from([True, True, False]),
    key=st.sampled_from(["flags", "more flags"]),
)
goals = st.one_of(
    st.builds(
        reach,
        st.dictionaries(teams, st.one_of(places, st.just("starts of red")), min_size=1),
        score=scores,
        passing=st.booleans(),
    ),
    st.builds(reach, teams, places, winner=teams, score=scores),
)
held = st.builds(
    hold,
    places,
    st.integers(1, 3),
    every=st.booleans(),
    score=scores,
    ends=st.booleans(),
    teams=st.one_of(st.none(), st.lists(teams, min_size=1)),
    key=st.sampled_from(["hold", "camp"]),
)
found = st.builds(
    discover,
    places,
    hops=st.sampled_from([0, 1, 2]),
    score=scores,
    teams=st.one_of(st.none(), st.lists(teams, min_size=1)),
    key=st.sampled_from(["discovered", "seen"]),
)
back = st.builds(respawn, st.integers(1, 3), times=st.sampled_from([None, 1]), teams=st.sampled_from([None, "red"]))
paid = st.builds(
    payoff,
    st.just({"tag": {"agent": 0.3, "other": -0.7}, "hold": {"team": 1 / 3}, "capture": {"agent": 5, "flag": -2}}),
    zero_sum=st.booleans(),
    key=st.sampled_from(["payoff", "wages"]),
)
fuel = st.builds(
    resource,
    st.sampled_from(["fuel", "water"]),
    st.sampled_from([0, 2, 3.5]),
    per_metre=st.sampled_from([0, 0.6]),
    per_edge=st.sampled_from([0, 0.5]),
    per_turn=st.sampled_from([0, 0.1]),
    recharge=st.dictionaries(nodes, st.sampled_from([0.3, 1]), max_size=3),
    capacity=st.sampled_from([3.5, 5]),
    empty=st.sampled_from(["stay", "eliminate"]),
    teams=st.sampled_from([None, "red", ["blue", "green"]]),
)
ends = st.one_of(
    st.builds(time_limit, st.integers(1, 9), st.sampled_from(["red", None])),
    st.builds(last_team),
    st.builds(none_left, teams, teams),
    st.builds(arrive, teams, places, score=scores, passing=st.booleans()),
)
ways_to_score = (tags(), flags, goals, fuel, held, found, back, paid, ends)
rules = st.lists(
    st.sampled_from(ways_to_score).flatmap(lambda rule: rule),
    max_size=7,
    unique_by=lambda rule: get_rule_spec(rule).key or id(rule),
)
conflicts = st.builds(
    Conflicts,
    st.one_of(st.sampled_from([None, 1, 2, "room"]), st.dictionaries(nodes, st.integers(0, 2), min_size=1)),
    st.sampled_from(["all", "team"]),
    edge_capacity=st.one_of(st.none(), st.integers(1, 2), st.dictionaries(st.integers(0, 12), st.integers(0, 2))),
    allow_swaps=st.booleans(),
    resolve=st.sampled_from([at_random(), nobody(), by_priority(["blue", None, "red", "green"])]),
)
phases = st.sampled_from(["before", "deeds", "after"])
orders = st.one_of(
    st.none(),
    st.permutations(TEAMS).flatmap(
        lambda teams: st.integers(1, 4).map(lambda n: [one for k in range(n) if (one := list(teams[k::n]))])
    ),
)


KINDS = [
    {"type": "AGENT_RANGE", "sensor_range": 4.0},
    {"type": "AGENT"},
    {"type": "AGENT_RANGE", "sensor_range": 1.6, "detection": [[0.0, 0.9], [1.5, 0.4]]},
    {"type": "AGENT_RANGE", "sensor_range": 2.5, "position_noise_m": 0.8},
    {"type": "AGENT_RANGE", "sensor_range": 3.0, "delay_turns": 2, "detection": 0.7},
    {"type": "AGENT_RANGE", "sensor_range": 2.0, "false_alarm_rate": 0.6},
    {"type": "AGENT", "delay_turns": 1, "position_noise_m": 0.4, "false_alarm_rate": 0.3},
    {"type": "AGENT_RANGE", "sensor_range": 2.5, "at": (3.0, 0.5), "false_alarm_rate": 0.8, "delay_turns": 1},
    {"type": "AGENT_ARC", "sensor_range": 3.0, "fov": 2.0, "detection": 0.6, "delay_turns": 1},
    {"type": "AGENT_RANGE", "sensor_range": 5.0, "team": "red"},
    {"type": "AGENT", "exclude": ["a0"], "delay_turns": 2},
    {"type": "OCCLUDED_AGENT", "sensor_range": 5.0, "detection": 0.8},
    {"type": "OCCLUDED_AGENT", "sensor_range": 4.0, "fov": 3.0, "false_alarm_rate": 0.5},
    {"type": "NEIGHBOR"},
    {"type": "RANGE", "sensor_range": 1.2},
    {"type": "ARC", "sensor_range": 2.5, "fov": 1.5},
    {"type": "MAP"},
    {"type": "OCCLUDED_MAP", "sensor_range": 3.0},
    {"type": "RANGE", "sensor_range": 1.5, "at": 5},
]


IN_AIR = [
    {"type": "AERIAL", "sensor_range": 2.0, "fov": 2.0},
    {"type": "AERIAL_AGENT", "sensor_range": 2.5},
    {"type": "OCCLUDED_AERIAL_AGENT", "sensor_range": 3.0, "detection": 0.7},
    {"type": "AERIAL_AGENT", "sensor_range": 9.0, "fov": 2.0, "position_noise_m": 0.3, "delay_turns": 1},
    {"type": "OCCLUDED_AERIAL", "sensor_range": 3.0},
    {"type": "OCCLUDED_AERIAL_AGENT", "sensor_range": 5.0, "fov": 3.0, "false_alarm_rate": 0.8},
    {"type": "AERIAL_AGENT", "sensor_range": 4.0, "at": (3.0, 0.5, 1.5), "false_alarm_rate": 0.5, "delay_turns": 2},
]
flights = st.fixed_dictionaries(
    {
        "agents": st.lists(st.integers(0, 10), min_size=1, max_size=3, unique=True),
        "strategies": st.lists(st.sampled_from(sorted(FLYING)), min_size=1, max_size=3),
        "speeds": st.lists(st.sampled_from([0.0, 0.3, 1.0, 5.0]), min_size=1, max_size=2),
        "places": st.lists(st.sampled_from([None, (2.5, 0.5, 0.2), (-4.0, 9.0, 1.0)]), min_size=1, max_size=2),
        "eyes": st.lists(st.sets(st.integers(0, len(IN_AIR) - 1), max_size=2), min_size=1, max_size=2),
    }
)


def paced(**more):
    """Return how agents go that have speeds, and some strategies."""
    left_out = {"guard", "intercept", "cut off"} if more else set()
    speeds = [None, 1e-9, 0.3, 0.5, 1.0, 1.9, 3, 40.0, inf] if more else [None, 0.4, 1.0, 1.5, 2, 2.7, 3, inf]
    return st.fixed_dictionaries(
        {
            "speeds": st.lists(st.sampled_from(speeds), min_size=1, max_size=3),
            "strategies": st.lists(st.sampled_from(sorted(PACED.keys() - left_out)), max_size=3),
            **more,
        }
    )


by_metres = {
    "speed_unit": st.sampled_from(["metres", "metres", "metres_per_second"]),
    "weight": st.sampled_from(["length", "slow", "travel_time"]),
}
JUMPING = ["chase", "flee", "guard", "assign", "intercept", "cut off", "sweep"]
JUMPS = [
    {},
    {"speed_unit": "metres", "decide": "arrival", "speeds": [0.4, None]},
    {"speed_unit": "metres_per_second", "turn_seconds": 3.0, "speeds": [0.4, 1.0]},
]
MOTIONS = {
    "one edge": st.none(),
    "anywhere": st.sampled_from(JUMPS).map(lambda more: {"legal": "any", "strategies": [*JUMPING], **more}),
    "edges": paced(),
    "metres": paced(decide=st.just("turn"), **by_metres),
    "metres, at arrivals": paced(decide=st.just("arrival"), **by_metres),
}


@st.composite
def streets_between(draw):
    """Nodes in two rows, odd streets between them, some one-way or not there, and further ones anywhere."""
    kinds = [(length, way) for way in ("both", "both", "both", "forth", "back", "none") for length in LENGTHS]
    pairs = [(i, i + step) for i in range(14) for step in (1, 6, 7) if i + step < 14]
    drawn = draw(st.lists(st.sampled_from(kinds), min_size=len(pairs), max_size=len(pairs)))
    edges = []
    for (start, end), (length, way) in zip(pairs, drawn, strict=True):
        edges += [(start, end, length)] if way in ("both", "forth") else []
        edges += [(end, start, length)] if way in ("both", "back") else []
    number = st.integers(0, 13)
    return edges + draw(st.lists(st.tuples(number, number, st.sampled_from(LENGTHS)), max_size=6))


channels = st.fixed_dictionaries(
    {},
    optional={
        "delay_turns": st.integers(1, 3),
        "relay": st.sampled_from([True, ["red"], ["a0", "blue"]]),
        "loss": st.sampled_from([0.3, [[0.0, 0.0], [2.0, 0.9]]]),
        "max_bytes_per_turn": st.sampled_from([2, 3, 7]),
        "teams": st.sampled_from([["red"], ["red", "blue"]]),
        "eavesdroppers": st.sampled_from([["a0"], ["green", "b1"]]),
        "jammers": st.sampled_from(
            [
                [{"at": [4.5, 0.5], "radius_m": 1.5}, {"at": 5, "radius_m": 0.5}],
                [{"agent": "a0", "radius_m": 1.0}],
                [{"team": "blue", "radius_m": 0.5}],
            ]
        ),
    },
)
reaches = st.fixed_dictionaries(
    {},
    optional={
        "range_m": st.sampled_from([0.5, 2.5, 9.0]),
        "hops": st.sampled_from([1, 2, 5]),
        "line_of_sight": st.just(True),
    },
).filter(bool)
walls = st.lists(st.tuples(st.integers(0, 13), st.booleans(), st.sampled_from([0.5, 3.0])), max_size=4)


@dataclass
class Drawn:
    """A game that was drawn at random."""

    agents: dict[str, tuple]
    streets: list[tuple]
    rules: list = field(default_factory=list)
    conflicts: object = None
    early: set = frozenset()
    order: list | None = None
    motion: dict | None = None
    deeds: list | None = None
    called: list = ()
    asked: str = ""
    channels: dict = field(default_factory=dict)
    shared: bool = True
    eyes: list = ((0,),)
    collected: list = ()
    max_turns: int = 10
    heights: list | None = None
    walls: list = ()
    is_bent: bool = False
    reserved: dict | None = None
    default_action: object = None  # where strategies may raise
    flights: dict | None = None  # of some agents, which fly
    closed: set = frozenset()  # numbers of streets that are closed at the start
    on_illegal: str = "stay"
    has_checks: bool = True  # of deeds
    modes: list = ()  # of agents: edge attributes, or None

    @property
    def moves_before(self):
        """Whether rules may put agents elsewhere, or decide who goes, before agents decide."""
        return (
            bool(self.early)
            or any(phase == "before" for _, phase in self.called)
            or "before" in (self.deeds or ())
            or self.order is not None
        )

    @property
    def flyers(self):
        """The names of the agents that fly."""
        return {name for number, name in enumerate(self.agents) if self.flights and number in self.flights["agents"]}

    def open(self):
        """Return a context with the game."""
        ctx = gamms.create_context(seed=6, logger_config={"level": "CRITICAL"}, game={"max_turns": self.max_turns})
        ctx.game.deeds, ctx.game.channels = {} if self.deeds is None else DEEDS, self.channels
        self._draw_map(ctx)
        for number, name in enumerate(self.agents):
            self._create_agent(ctx, number, name)
        for team in TEAMS[:3]:
            ctx.agent.create_team(team, [])  # rules mention teams that have no agents in some games
        for name in (self.motion or {}).keys() - {"strategies", "speeds"}:
            setattr(ctx.game, name, self.motion[name])
        self._add_rules(ctx)
        for every, per in self.collected:
            ctx.game.collect(f"{per} {every}", TAKEN[per], every, per)
        ctx.game.conflicts, ctx.game.order = self.conflicts, self.order
        ctx.game.team_memory, ctx.game.on_illegal = self.shared, self.on_illegal
        if self.default_action is not None:
            ctx.game.on_error, ctx.game.default_action = "stay", self.default_action
        if self.modes or (self.motion or {}).get("speeds") or "speed_unit" in (self.motion or {}):
            ctx.game.publish(strolls=True)  # routes over several nodes are for games with paths
        if "p" in self.asked:
            ctx.game.command(ctx.agent.get_agent(min(self.agents)).team, agreed)
        return ctx

    def _draw_map(self, ctx):
        for number, node in enumerate(NODES):
            z = {} if self.heights is None else {"z": self.heights[number]}
            ctx.graph.graph.add_node({"id": node, "x": number % 7, "y": number // 7, "room": number % 4, **z})
        for number, (source, target, length) in enumerate(self.streets):
            edge = {
                "source": NODES[source],
                "target": NODES[target],
                "length": length,
                "slow": 2.0 - length if number % 7 else inf,
            }
            edge["travel_time"] = 0.2 + number % 3 / 4
            if self.modes:
                edge |= {"car": number % 3 > 0, "foot": float(number % 4)}
                edge |= {"travel_time:car": 0.1 + number % 5 / 3, "slow:foot": 1.0 + number % 2 if number % 6 else inf}
            if self.is_bent and number % 3:
                (x, y), (x1, y1) = divmod(source, 7)[::-1], divmod(target, 7)[::-1]
                between = [(x + 0.4, y - 0.3), (x1 - 0.2, y1 + 0.7)][: number % 3]
                edge["linestring"] = [(x, y), *between, (x1, y1)]
            ctx.graph.graph.add_edge({"id": number * 7 % 71, **edge})
        ctx.graph.close_roads([number * 7 % 71 for number in self.closed if number < len(self.streets)])
        for number, is_upright, height in self.walls:
            x, y = number % 7 + 0.5, number // 7 - 0.5
            ends = ((x, y), (x, y + 1)) if is_upright else ((x, y), (x + 1, y))
            ctx.graph.add_obstacles(np.array([[(*end, z) for z in (height, 0) for end in ends]]))

    def _create_agent(self, ctx, number, name):
        (team, node), motion = self.agents[name], self.motion or {}
        made = [random_walk if self.deeds is None else busy, *(PACED[one](ctx) for one in motion.get("strategies", ()))]
        made += [caller(ctx)] if self.motion is None else []
        if name[0] in self.asked:
            made = [rash if self.default_action is not None else curious if "w" in self.asked else attentive]
        sees = []
        for kind in self.eyes[number % len(self.eyes)]:
            given = KINDS[kind]
            known = f"{given['type']} {kind}" if "at" in given and kind % 2 else f"eye {kind} of {name}"
            if known not in ctx.sensor.sensors:
                ctx.sensor.create_sensor(known, **given)
            sees.append(known)
        given, flies = {"strategy": made[number % len(made)]}, self.flights and number in self.flights["agents"]
        if flies:
            given = self._flying(ctx, number, name)
            sees += given.pop("sees")
        if self.modes and not flies:
            given["mode"] = self.modes[number % len(self.modes)]
        agent = ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=sees, **given)
        if motion.get("speeds") and not flies:
            agent.speed = motion["speeds"][number % len(motion["speeds"])]

    def _flying(self, ctx, number, name):
        speed, place, strategy, eyes = (
            self.flights[key][number % len(self.flights[key])] for key in ("speeds", "places", "strategies", "eyes")
        )
        made, sees = FLYING[strategy], [f"eye {eye} of {name} in the air" for eye in eyes]
        for sensor, eye in zip(sees, eyes, strict=True):
            ctx.sensor.create_sensor(sensor, **IN_AIR[eye])
        given = {} if place is None else {"position": place}
        return given | {
            "type": "AERIAL",
            "speed": speed,
            "strategy": made(ctx) if strategy == "glide" else made,
            "sees": sees,
        }

    def _add_rules(self, ctx):
        ctx.game.add(territory.published({node: "red" if node < 20 else "blue" for node in NODES}, "land"))
        for number, rule in enumerate(self.rules):
            ctx.game.add(rule, phase="before" if number in self.early else "after")
        for phase in self.deeds or ():
            ctx.game.add(strike, phase=phase)
        for kind in ("scan", "mark") if self.deeds and self.has_checks else ():
            ctx.game.add(cooldown(kind, 2), phase=self.deeds[0])
        if self.deeds is not None and self.has_checks:
            prices = {"rest": 0.4, "mark": 0.7, "scan": 1}
            ctx.game.add(resource("power", 3, per_deed=prices, per_edge=0.2, recharge=dict.fromkeys(NODES[::3], 2)))
        for name, phase in self.called:
            ctx.game.add(CALLED[name], phase=phase)


@st.composite
def games(draw, how=tuple(MOTIONS), in_air=False):
    """A random game, in which agents go in one of some ways; `in_air`: some fly."""
    number = draw(st.sampled_from([2, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11]))
    several = draw(st.lists(st.tuples(st.sampled_from(TEAMS), nodes), min_size=number, max_size=number))
    agents = {f"{'abc'[i % 3]}{i}": place for i, place in enumerate(several)}
    default_action = draw(st.sampled_from([None, None, "stay", 5, go_on]))
    motion = MOTIONS[how[0]] if len(how) == 1 else st.sampled_from(how).flatmap(MOTIONS.get)
    motion, conflicts_now = draw(motion), draw(st.one_of(st.none(), conflicts, st.just(FirstOnly())))
    if motion is not None and motion.get("decide") == "arrival":
        conflicts_now = (
            None if isinstance(conflicts_now, Conflicts) and not conflicts_now.allow_swaps else conflicts_now
        )
        motion = motion | {"strategies": [one for one in motion["strategies"] if one != "assign"]}  # which gives paths
    has_plain_parts = draw(st.sampled_from([False, False, True]))
    if not has_plain_parts and isinstance(conflicts_now, FirstOnly):
        conflicts_now = None
    asked = draw(st.sampled_from(["", "a", "bc", "abc", "p", "bcw", "abcw"]))
    called = draw(st.one_of(st.just([]), st.lists(st.tuples(st.sampled_from(sorted(CALLED)), phases), max_size=3)))
    kinds = st.lists(st.integers(0, len(KINDS) - 1), min_size=1, max_size=3, unique=True)
    return Drawn(
        agents,
        draw(streets_between()),
        rules=draw(rules),
        conflicts=conflicts_now,
        early=draw(st.sets(st.integers(0, 9), max_size=2)),
        order=draw(orders),
        motion=motion,
        deeds=draw(st.one_of(st.none(), st.lists(phases, max_size=2))),
        called=called if has_plain_parts else (),
        asked=asked if has_plain_parts else "",
        channels={
            name: options | draw(reaches)
            for name, options in draw(st.dictionaries(st.sampled_from(CHANNELS), channels, max_size=3)).items()
        },
        shared=draw(st.sampled_from([True, True, False])),
        eyes=draw(st.lists(kinds, min_size=1, max_size=3)),
        collected=sorted(
            draw(st.one_of(st.just([]), st.sets(st.tuples(st.integers(1, 3), st.sampled_from(sorted(TAKEN))))))
            if has_plain_parts
            else ()
        ),
        max_turns=draw(st.sampled_from([1, 2, 10, 10, 10, 10])),
        heights=draw(
            st.one_of(st.none(), st.none(), st.lists(st.sampled_from([0.0, 0.4, 2.0]), min_size=14, max_size=14))
        ),
        walls=draw(st.one_of(st.just([]), walls)),
        is_bent=draw(st.booleans()),
        reserved={agents[min(agents)][0]: ["b9", "y9", "z9"]},
        default_action=default_action,
        flights=draw(flights) if in_air else None,
        closed=draw(st.sets(st.integers(0, 40), max_size=4)),
        on_illegal=draw(st.sampled_from(["stay", "stay", "stay", "raise"])),
        has_checks=draw(st.booleans()),
    )
