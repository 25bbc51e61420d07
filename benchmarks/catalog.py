"""The cases that are measured, what each is measured against, and how long it may take.

Frequent: one call. Targeted: one behaviour. Scenario: a whole game. `make()` of a case returns two functions, the case
and its floor, that return how many operations they did.
"""

from typing import NamedTuple

import batches
import cases
import experiments
import learning
import parts
import seeing
import teams
from pictures import film, first_frame, zoom
from worlds import ST


class Case(NamedTuple):
    """One line of the table."""

    name: str
    unit: str
    make: object
    floor: str  # what it is measured against
    aim: float | None = None  # how many times the floor it may take


# Floors of several cases
READY = "copies of ready answers"
WITHIN = "`graph.within` from as many new places"
LOOP = "bare Python that builds the same states"
KEYS = "bare Python that builds states of ten keys"
BY_HAND = "the paper's loop over our agents"
RESET = "the same games by `reset` and `run`"
CELLS = "a grid of cells in NumPy"
STREAM = "an int32 kernel of NumPy"
KEYED = "an int32 kernel of NumPy with keyed draws"
FREE = "the same turns without conflicts"
DEATHLESS = "the same turns in which all live"

CASES = [
    Case("frequent: sense RANGE 50 m again", "sense", cases.sense(ST.RANGE, 100, again=True), READY, 1.5),
    Case("frequent: sense ARC 50 m again", "sense", cases.sense(ST.ARC, 100, again=True), READY),
    Case("targeted: sense RANGE first, 20x20 grid", "sense", cases.sense(ST.RANGE, 20), READY),
    Case("targeted: sense RANGE first, 100x100 grid", "sense", cases.sense(ST.RANGE, 100), READY),
    Case("targeted: sense RANGE first, 300x300 grid", "sense", cases.sense(ST.RANGE, 300), READY),
    Case("targeted: sense AGENT among 1,000", "sense", cases.sense(ST.AGENT, 100, again=True, agents=1000), READY),
    Case(
        "targeted: sense AGENT_RANGE among 1,000",
        "sense",
        cases.sense(ST.AGENT_RANGE, 100, again=True, agents=1000),
        READY,
    ),
    Case("targeted: build a 100x100 grid one by one", "item", cases.build, "plain dicts of tuples"),
    Case("targeted: import", "process", cases.start_up, "`import numpy`", 0.3),
    Case(
        "targeted: a path of up to 300 m among 90,000 nodes",
        "path",
        cases.near_paths,
        "Dijkstra's algorithm in bare Python",
        1.0,
    ),
    Case("targeted: AGENT after a move among 10,000", "look", cases.agent_look_after_a_move, READY),
    Case(
        "targeted: OCCLUDED_AGENT after a move among 100,000",
        "look",
        lambda: cases.agent_look_after_a_move(100_000, ST.OCCLUDED_AGENT, sensor_range=20.0),
        READY,
    ),
    Case(
        "targeted: AGENT_RANGE with false alarms among 10,000",
        "look",
        lambda: cases.agent_look_after_a_move(10_000, ST.AGENT_RANGE, sensor_range=20.0, false_alarm_rate=0.5),
        READY,
    ),
    Case(
        "targeted: contacts within 5 of 2,000 agents",
        "agent",
        cases.near_in_a_straight_line,
        "cells in bare Python",
        2.0,
    ),
    Case("targeted: neighbourhoods among 490,000", "node", cases.neighborhoods_beyond_what_is_kept, "slices of lists"),
    Case("targeted: RANGE from 15,000 places in turn", "look", cases.views_from_many_places, READY),
    Case("targeted: looks of many agents, RANGE of 10,000 on 100,000 nodes", "agent-step", cases.looks_of_many, WITHIN),
    Case("targeted: open a saved map, 90,000 nodes", "map", cases.open_map, "inflating its arrays"),
    Case("targeted: states of a recording, 10 agents", "state", cases.recorded_states, "copies of ten lists"),
    Case("scenario: the paper's loop, 10 agents", "agent-step", cases.loop(10), LOOP, 2.0),
    Case("scenario: the paper's loop, 1,000 agents", "agent-step", cases.loop(1000), LOOP, 2.0),
    Case("scenario: the paper's loop, 10,000 agents", "agent-step", cases.loop(10000), LOOP, 2.0),
    Case(
        "scenario: 1,000 agents look around in Helsinki",
        "agent-step",
        cases.crowded_city,
        "bare Python that copies ready answers",
        2.0,
    ),
    Case("scenario: turns of 1,000 agents", "agent-step", cases.turns(), BY_HAND, 1.1),
    Case("scenario: turns of 1,000 agents, capacity 1", "agent-step", cases.turns(capacity=1), BY_HAND, 1.5),
    Case("scenario: turns of 10 agents, ten keys", "agent-step", cases.turns_of(10, 20), KEYS, 1.8),
    Case("scenario: turns of 10 agents, ten keys, with a seed", "agent-step", cases.turns_of(10, 20, seed=1), KEYS),
    Case("scenario: turns of 1,000 agents, ten keys", "agent-step", cases.turns_of(1000, 100), KEYS, 1.8),
    Case("scenario: turns of 10,000 agents, ten keys", "agent-step", cases.turns_of(10_000, 316), KEYS, 1.8),
    Case("scenario: turns of 100,000 agents, ten keys", "agent-step", cases.turns_of(100_000, 316), KEYS, 1.8),
    Case("scenario: turns of 10 flyers", "agent-step", cases.flyers(), "bare Python that finds the nodes below"),
    Case("scenario: turns of 100 agents by metres", "agent-step", cases.by_metres(), KEYS),
    Case("scenario: messages of 100 agents to all", "delivery", cases.messages(100), "dicts that are put into lists"),
    Case("scenario: 300 agents that share a memory", "agent-step", cases.memories(300), "dicts copied and compared"),
    Case("scenario: a game of 5 against 5 after a reset", "game", lambda: batches.one_by_one(is_fresh=False), KEYS),
    Case("scenario: a game of 5 against 5 in a new context", "game", lambda: batches.one_by_one(is_fresh=True), KEYS),
    Case("scenario: 5 against 5 by reset(seed)", "game", lambda: batches.of_scenario(is_fresh=False), KEYS),
    Case("scenario: 5 against 5 by play(seed)", "game", lambda: batches.of_scenario(is_fresh=True), KEYS),
    Case(
        "scenario: 1,024 games of 5 against 5 in a batch, beside play",
        "agent-step",
        lambda: batches.of_helsinki(is_fresh=True),
        "the same games by `play`",
        1 / 40,
    ),
    Case("scenario: 1,024 games of 5 against 5 in a batch", "agent-step", batches.of_helsinki, RESET),
    Case("scenario: 32,768 games of 5 against 5 in a batch", "agent-step", batches.of_many, "4,096 games in a batch"),
    Case(
        "scenario: 4,096 games of two pursuers, vectors in a batch",
        "agent-step",
        seeing.pursuit,
        "a kernel of NumPy that makes the vectors alone",
    ),
    Case("scenario: 64 agents with views of 5 nodes in a batch", "agent-step", seeing.views, RESET, 1 / 10),
    Case(
        "learning: 1,024 games of two pursuers in a vector environment",
        "agent-step",
        learning.many_games,
        "the environment of one game",
        1 / 40,
    ),
    Case(
        "learning: 4,096 games of two pursuers in two processes, by the clock",
        "agent-step",
        learning.many_games_in_two_processes,
        "one process",
    ),
    Case(
        "learning: a game of two pursuers in an environment",
        "agent-step",
        learning.one_game,
        "`pursuit_v5` of PettingZoo",
        0.67,
    ),
    Case("experiments: games of the demo on two workers", "game", experiments.of_demo, "`play(seed)` of each", 1.15),
    Case("targeted: AGENT_RANGE among 100,000 agents, in a batch", "pair", seeing.crowd, CELLS, 2.0),
    Case("targeted: tag(euclid=5) of 100,000 agents in a batch", "agent-step", seeing.tags, CELLS, 2.0),
    Case("targeted: random walk of 102,400 agents in a batch", "agent-step", batches.walks, KEYED, 2.0),
    Case("scenario: 1,024 games with an order of play in a batch", "agent-step", parts.in_order, RESET),
    Case("scenario: 1,024 games with speeds in edges in a batch", "agent-step", parts.by_edges, RESET),
    Case("scenario: 1,024 games by metres in a batch", "agent-step", parts.by_metres, RESET),
    Case("scenario: 256 games by metres with tag(euclid=), in a batch", "agent-step", parts.with_close_tags, RESET),
    Case("scenario: 256 games with roads closed in each, in a batch", "agent-step", parts.with_closed_roads, RESET),
    Case("scenario: 256 games with a plain rule, in a batch", "agent-step", parts.with_plain_rule, RESET),
    Case("scenario: 256 games with a drone, in a batch", "agent-step", parts.with_a_drone, RESET),
    Case("scenario: 1,024 games with deeds in a batch", "agent-step", parts.with_deeds, RESET),
    Case("scenario: 1,024 games with messages in a batch", "agent-step", parts.with_messages, RESET),
    Case(
        "teams: random walk of 100,000, one stream", "agent-step", teams.walk(100_000, 316, is_keyed=False), STREAM, 1.5
    ),
    Case(
        "teams: random walk of 100,000, keyed draws", "agent-step", teams.walk(100_000, 316, is_keyed=True), KEYED, 2.0
    ),
    Case(
        "teams: random walk of 1,000,000, one stream",
        "agent-step",
        teams.walk(1_000_000, 1000, is_keyed=False),
        STREAM,
        1.5,
    ),
    Case(
        "teams: random walk of 1,000,000, keyed draws",
        "agent-step",
        teams.walk(1_000_000, 1000, is_keyed=True),
        KEYED,
        2.0,
    ),
    Case(
        "teams: random walk of 100,000, one stream, recorded with keyframes",
        "agent-step",
        teams.walk(100_000, 316, is_keyed=False, is_recorded=True),
        STREAM,
        2.5,
    ),
    Case(
        "teams: random walk of 1,000,000, one stream, recorded with keyframes",
        "agent-step",
        teams.walk(1_000_000, 1000, is_keyed=False, is_recorded=True),
        STREAM,
        2.5,
    ),
    Case(
        "targeted: a death and a return each turn, 1,000 one by one",
        "agent-step",
        teams.deaths(1000, 40, are_members=False),
        DEATHLESS,
        2.0,
    ),
    Case(
        "targeted: a death and a return each turn, 10,000 one by one",
        "agent-step",
        teams.deaths(10_000, 110, are_members=False),
        DEATHLESS,
        2.0,
    ),
    Case(
        "targeted: a death and a return each turn, a team of 20,000",
        "agent-step",
        teams.deaths(20_000, 150, are_members=True),
        DEATHLESS,
    ),
    Case(
        "targeted: a deletion and a creation each turn, 1,000 one by one",
        "agent-step",
        teams.deaths(1000, 40, are_members=False, are_deleted=True),
        DEATHLESS,
    ),
    Case(
        "targeted: a deletion and a creation each turn, a team of 20,000",
        "agent-step",
        teams.deaths(20_000, 150, are_members=True, are_deleted=True),
        DEATHLESS,
    ),
    Case("teams: conflicts of 20,000 on 400,000 nodes", "agent-step", teams.conflicts(20_000, 632), FREE),
    Case("teams: conflicts of 20,000 on 40,000 nodes", "agent-step", teams.conflicts(20_000, 200), FREE),
    Case("teams: conflicts of 20,000 side by side", "agent-step", teams.conflicts(20_000, 200, apart=False), FREE),
    Case("teams: conflicts of 100,000 on 1,000,000 nodes", "agent-step", teams.conflicts(100_000, 1000), FREE),
    Case("scenario: load Helsinki at 10 m", "map", cases.helsinki, "plain dicts of the same tuples"),
    Case("scenario: film Helsinki, 1280 x 720", "frame", film, "encoding its frames alone", 1.25),
    Case("scenario: window, first of 100,000 edges", "frame", first_frame, "drawing each street once"),
    Case("scenario: window, zoom, 99th percentile", "frame", zoom, "making one picture larger"),
]
