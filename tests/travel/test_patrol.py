"""A patrol on a ring road, against attacks of a known duration: each is caught just when arithmetic says so."""

from itertools import accumulate
from math import cos, pi, sin

import pytest

import gamms
from gamms.rules import contacts
from gamms.strategies import patrol

LENGTHS = [31.0, 47.5, 20.0, 66.0, 12.5, 38.0]
SPEED = 7.3
ATTACKS = [(1 + i % 5, 3 + 4 * i, 4 + i % 7) for i in range(15)]  # node, first turn, turns


def is_caught(node, first, turns):
    """Whether the patrol is at a node within these turns."""
    far, ring = [0.0, *accumulate(LENGTHS)][node], sum(LENGTHS)
    begin, end = SPEED * (first - 1), SPEED * (first - 1 + turns)
    return any(begin < far + lap * ring <= end for lap in range(20))


@pytest.mark.parametrize("attack", ATTACKS, ids=str)
def test_an_attack_is_caught_when_the_patrol_comes_by_in_time(attack):
    node, first, turns = attack
    game = {"speed_unit": "metres", "decide": "arrival", "on_illegal": "raise"}
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=game) as ctx:
        size = len(LENGTHS)
        angles = [2 * pi * i / size for i in range(size)]
        ctx.graph.add_nodes(range(size), [40 * cos(one) for one in angles], [40 * sin(one) for one in angles])
        ctx.graph.add_edges(range(size), range(size), [(i + 1) % size for i in range(size)], LENGTHS)
        beat = patrol(ctx, [*range(1, size), 0])
        ctx.agent.create_agent("patrol", start_node_id=0, team="guards", speed=SPEED, strategy=beat)
        caught = []

        def attacks(ctx):
            if ctx.game.turn == first - 1:
                ctx.agent.create_agent("thief", start_node_id=node, team="thieves", speed=1.0)

        def watch(ctx):
            if first <= ctx.game.turn < first + turns:
                caught.extend(contacts(ctx, "guards", "thieves"))

        ctx.game.add(attacks, phase="before")
        ctx.game.add(watch)
        ctx.game.run(first + turns)
    assert bool(caught) is is_caught(node, first, turns)


def test_both_kinds_of_attacks_are_among_them():
    assert {is_caught(*attack) for attack in ATTACKS} == {True, False}
