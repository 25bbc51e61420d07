"""Five games go the same way, turn by turn, with the library and in programs that were written without it.

Both draw the same random numbers (`keyed.py`). By default a few plays of each are compared, long ones in part;
`GAMMS_ALL_PLAYS=1` compares 36 of each to their ends, which takes some ten minutes.
"""

import os
import random
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import patrolling
import periodic_visibility
import plain_competition
import plain_patrolling
import plain_periodic_visibility
import plain_radio_search
import plain_tag_on_helsinki
import pytest
import radio_search
import tag_on_helsinki
from code_lines import code_lines

import gamms
from gamms import scenario

ROOT = Path(__file__).parents[2]
DATA = ROOT / "src" / "gamms" / "data" / "gallery"
CUP = ("competition.yaml", "competition_rules.py", "competition.py")
ALL = 36
IS_COMPLETE = os.environ.get("GAMMS_ALL_PLAYS") == "1"


class Match(NamedTuple):
    """A play that both programs are about to begin."""

    ctx: Any
    turns: Any  # an iterator of what the other program says after each turn: places, scores, and perhaps more
    more: Any = None  # what the library says of the rest


def places_in(ctx):
    return {agent.name: agent.current_node_id for agent in ctx.game.agents if agent.name != "drone"}


def map_of(ctx):
    """Return nodes and edges of the map of a game as plain values."""
    columns = ctx.graph.columns()
    ids, ends = columns.node_ids, (columns.sources, columns.targets)
    edges = zip(*(ids[rows].tolist() for rows in ends), columns.lengths.tolist(), strict=True)
    return dict(zip(ids.tolist(), map(tuple, columns.xy.tolist()), strict=True)), list(edges)


def match_of_patrolling(seed):
    on, is_clever, turns = (1.0, 0.9, 0.5)[seed % 3], seed % 2 == 0, 500
    ctx = patrolling.build(seed, on, is_clever)
    fence = patrolling.POSTS, places_in(ctx), patrolling.NEEDED
    return Match(ctx, plain_patrolling.play(seed, *fence, on, is_clever, turns))


def match_of_periodic_visibility(seed):
    places = random.Random(seed).sample(range(periodic_visibility.SIDE**2), 3 + seed % 3)
    ctx = periodic_visibility.build(seed, places)
    limits = periodic_visibility.EVERY, periodic_visibility.TURNS
    return Match(ctx, plain_periodic_visibility.play(seed, *map_of(ctx), places_in(ctx), *limits))


def match_of_radio_search(seed):
    drawn = random.Random(seed).sample(range(radio_search.SIDE**2), 7)
    ctx = radio_search.build(seed, drawn[:4], drawn[4:])

    def drone_and_messages():
        sent = [message for message in ctx.game.messages if message["turn"] == ctx.game.turn]
        outcomes = [(message["body"]["who"], list(message["heard"]), message["lost"]) for message in sent]
        return pytest.approx(ctx.agent.get_agent("drone").position, abs=1e-9), outcomes

    return Match(ctx, plain_radio_search.play(seed, *map_of(ctx), places_in(ctx)), drone_and_messages)


def match_of_tag_on_helsinki(seed):
    ctx = tag_on_helsinki.build(seed, random.Random(seed).sample(nodes_of_helsinki(), 100))
    return Match(ctx, plain_tag_on_helsinki.play(seed, *map_of(ctx), places_in(ctx)))


@cache
def nodes_of_helsinki():
    with gamms.create_context() as ctx:
        gamms.osm.helsinki(ctx)
        return ctx.graph.columns().node_ids.tolist()


def match_of_competition(seed):
    ctx = scenario.from_gallery("competition").build(seed=seed)
    faces = [ctx.graph.get_obstacle_face(face) for face in ctx.graph.get_obstacle_faces()]
    walls = [(face.br[:2], face.bl[:2], face.br[2], face.tr[2]) for face in faces]
    game = places_in(ctx), list(ctx.game.facts["candidates"]), walls
    return Match(ctx, plain_competition.play(seed, *map_of(ctx), *game))


MATCHES = {  # game -> what begins a play, whether its rules end it, how many plays and turns are compared by default
    "competition": (match_of_competition, True, 1, 40),
    "periodic visibility": (match_of_periodic_visibility, True, 2, 100),
    "radio search": (match_of_radio_search, True, 2, 150),
    "patrolling": (match_of_patrolling, False, 3, 100),
    "tag on Helsinki": (match_of_tag_on_helsinki, False, 1, 5),
}


@pytest.mark.parametrize(
    ("game", "seed"),
    [(game, seed) for game, (*_, plays, _) in MATCHES.items() for seed in range(ALL if IS_COMPLETE else plays)],
)
def test_a_game_goes_the_same_way_without_the_library(game, seed):
    make, ends, _, most = MATCHES[game]
    match = make(seed)
    with match.ctx as ctx:
        for turn, (places, scores, *more) in enumerate(match.turns, 1):
            ctx.game.step()
            assert ctx.game.turn == turn, "the game with the library has ended before"
            assert places_in(ctx) == places, f"turn {turn}"
            assert without_zeros(ctx.game.scores) == without_zeros(scores), f"turn {turn}"
            assert match.more is None or match.more() == tuple(more), f"turn {turn}"
            if turn == most and not IS_COMPLETE:
                return
        assert ctx.game.is_over == ends


def without_zeros(scores):
    return {team: score for team, score in scores.items() if score}


def end_of(ctx):
    """Return how a game stands, without empty memories and the counts of moves, which begin with a resumed game."""
    memories = {name: dict(memory) for name, memory in ctx.game.memories.items() if memory}
    result = ctx.game.result()
    return result.turns, result.scores, result.reason, result.events, result.messages, places_in(ctx), memories


@pytest.mark.parametrize("game", ["periodic visibility", "radio search", "patrolling"])
def test_a_game_goes_on_the_same_way_from_a_turn_of_its_recording_and_from_a_snapshot(game, tmp_path):
    make, path = MATCHES[game][0], tmp_path / "game.ggr"
    with make(2).ctx as ctx:
        ctx.record.start(path)
        ctx.game.run(30)
        ctx.record.stop()
        end = end_of(ctx)
    with make(2).ctx as ctx:
        ctx.game.run(6)
        snapshot = ctx.game.snapshot()
        ctx.game.run(5)
        ctx.game.restore(snapshot)
        ctx.game.run(24)
        assert end_of(ctx) == end
    with gamms.recorder.open(path) as recording:
        for turn in (0, 1, 2, 5, 12):
            with make(2).ctx as ctx:
                recording.resume(turn, ctx=ctx).game.run(30 - turn)
                assert end_of(ctx) == end, turn


HERE, EXAMPLES = ROOT / "tests" / "rebuilt_games", ROOT / "examples"
ROADS = HERE / "plain_roads.py"
FILES = {  # the game, as the page calls it -> its files with the library, and without
    "flag competition": ([DATA / name for name in CUP], [HERE / "plain_competition.py", ROADS]),
    "periodic visibility": ([EXAMPLES / "periodic_visibility.py"], [HERE / "plain_periodic_visibility.py"]),
    "search from the air, with radio": ([HERE / "radio_search.py"], [HERE / "plain_radio_search.py"]),
    "patrolling": ([EXAMPLES / "patrolling.py"], [HERE / "plain_patrolling.py"]),
    "50 against 50 on Helsinki": ([HERE / "tag_on_helsinki.py"], [HERE / "plain_tag_on_helsinki.py", ROADS]),
}


def test_the_page_has_the_true_numbers_of_lines():
    page = (ROOT / "docs" / "comparison.md").read_text()
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    shown = {cells[0].partition("](")[0].lstrip("["): tuple(cells[1:3]) for cells in rows}
    for game, files in FILES.items():
        assert shown[game] == tuple(str(sum(map(code_lines, some))) for some in files), game
