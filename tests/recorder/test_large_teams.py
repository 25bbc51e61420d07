"""Recordings of large teams: copied, followed, cut off and damaged."""

import io
import random
from pathlib import Path

import numpy as np
import pytest
from fuzzing import check, text_of
from games import empty_context
from recordings import opened, read_all, walk, written

import gamms
from gamms.recorder import RecordingError
from gamms.recorder.formats import blocks

AGENTS, TURNS = 2400, 8  # so that a move needs two bytes and a block is large
TABLES = Path(__file__).parent / "samples/ours/large_team_with_tables.ggr"


@pytest.fixture(scope="module")
def played():
    """A recording, what its stream held after each turn, and where the agents were then."""
    stream, held, nodes = io.BytesIO(), [], []
    ctx = empty_context()
    ctx.graph.attach_networkx_graph(gamms.graph.grid(10, 150))
    starts = np.random.default_rng(1).integers(0, 1500, AGENTS)
    red = ctx.agent.create_team("red", starts, strategy=gamms.strategies.random_walk)
    ctx.record.start(stream)
    for _ in range(TURNS):
        ctx.game.step()
        held.append(stream.getvalue())
        nodes.append(red.node_ids.tolist())
    ctx.record.stop()
    return stream.getvalue(), held, nodes


def nodes_in(data):
    with gamms.recorder.open(io.BytesIO(data)) as recording:
        return [state.agents["node"].tolist() for state in recording][1:]


def test_all_that_happened_can_be_read_while_a_large_team_is_recorded(played):
    data, held, nodes = played
    assert nodes_in(data) == nodes
    assert [nodes_in(part) for part in (held[0], held[4])] == [nodes[:1], nodes[:5]]


def test_a_copy_of_a_recording_of_a_large_team_has_the_same_bytes(played):
    data, _, _ = played
    copy = io.BytesIO()
    with empty_context() as ctx:
        ctx.record.start(copy)
        for _ in ctx.record.replay(io.BytesIO(data)):
            pass
        ctx.record.stop()
    assert copy.getvalue() == data


def test_a_recording_of_an_earlier_version_whose_columns_have_tables_says_the_same_for_ever():
    assert read_all(TABLES.read_bytes())[1] == walk(2500, 8, n=300)


def test_damaged_recordings_of_large_teams_are_refused_or_give_a_prefix():
    for data in (TABLES.read_bytes(), written(walk(2500, 8, n=300), turns=8, keyframes=True)):
        logs = text_of(read_all(data)[1])
        for number in range(6):
            check(f"large/{number}", [(data, logs)])


def heads_of(data):
    at = len(blocks.MAGIC)
    while at < len(data):
        head = blocks.decode_head(data[at : at + blocks.HEAD_SIZE], at)
        yield head
        at = head.end


def test_a_recording_of_a_large_team_that_is_cut_off_anywhere_is_read_up_to_its_last_whole_block(played):
    data, _, _ = played
    ends = [head.end for head in heads_of(data)]
    for size in sorted({*random.Random(1).sample(range(len(data)), 12), *ends, *(end - 1 for end in ends)}):
        if size < ends[0]:
            with pytest.raises(RecordingError):
                opened(data[:size])
        else:
            assert opened(data[:size]).turns == (TURNS if size >= ends[-2] else 0)
