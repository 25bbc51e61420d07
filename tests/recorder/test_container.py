"""What is written is read: logs, header, keyframes; by turn, as arrays, by kind of event; the same bytes each time."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings import HEADER, logs_of, opened, read_all, walk, written

from gamms.errors import BadType, BadValue
from gamms.ir import events as codes
from gamms.recorder import RecordingError, Writer
from gamms.recorder.formats import blocks
from gamms.recorder.formats.chunks import FORMS

numbers = st.integers(-(2**63), 2**63 - 1) | st.integers(0, 5)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(st.characters()) | st.binary(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text() | st.integers() | st.tuples(st.integers(), st.text()), inner, max_size=3)
    ),
    max_leaves=5,
)
floats = st.floats() | st.sampled_from([0.0, -0.0, 0.1, 1e300, float("inf")])
flights = st.tuples(numbers, numbers, floats, floats, floats).map(lambda data: (codes.AERIAL_AGENT_FLIGHT, data))
quats = st.tuples(numbers, *[floats] * 4).map(lambda data: (codes.AERIAL_AGENT_TURN, data))
kinds = numbers.filter(lambda kind: kind not in FORMS)
entries = st.tuples(numbers, numbers).map(list) | st.tuples(kinds, plain).map(lambda event: [event])
entries |= (flights | quats).map(lambda event: [event])
logs = st.lists(entries, max_size=8).map(lambda parts: [one for part in parts for one in part])
games = st.lists(logs, max_size=8)


def entries_of(log):
    """The moves and events of a log, each a tuple, with the number of moves before it."""
    moves, found, at = 0, [], 0
    while at < len(log):
        if type(log[at]) is tuple:
            found.append((moves, *log[at]))
            at += 1
        else:
            moves, at = moves + 1, at + 2
    return found


FEWER = settings(max_examples=12)  # each is a whole recording


# -- there and back ---------------------------------------------------------------------------------------------


@FEWER
@given(games, st.integers(1, 5), st.integers(1, 200), st.booleans())
def test_every_log_is_read_as_it_was_added(game, turns, size, keyframes):
    reader, found = read_all(written(game, turns=turns, size=size, keyframes=keyframes))
    assert repr(found) == repr(game)  # which tells True from 1, and a tuple from a list
    assert (reader.turns, reader.is_complete, reader.warning) == (len(game), True, None)


@FEWER
@given(games, st.integers(1, 4), st.data())
def test_arrays_and_events_agree_with_the_logs(game, turns, data):
    reader = opened(written(game, turns=turns))
    start = data.draw(st.integers(0, len(game)))
    stop = data.draw(st.integers(start, len(game)))
    found = zip(*(column.tolist() for column in reader.moves(start, stop)), strict=True)
    flat = [(turn, [one for one in game[turn] if type(one) is not tuple]) for turn in range(start, stop)]
    assert list(found) == [(turn, *moves[i : i + 2]) for turn, moves in flat for i in range(0, len(moves), 2)]
    events = [(turn, *event) for turn in range(start, stop) for event in entries_of(game[turn])]
    assert repr(list(reader.events(start, stop))) == repr(events)
    kinds = {kind for _, _, kind, _ in events[::2]}
    assert repr(list(reader.events(start, stop, kinds))) == repr([event for event in events if event[2] in kinds])


def test_turns_that_are_not_there_are_refused():
    reader = opened(written(walk(1, 3)))
    for call in (lambda: reader.log(3), lambda: reader.log(-1), lambda: reader.keyframe(4), lambda: reader.moves(2, 1)):
        with pytest.raises(BadValue, match="this recording has"):
            call()


def test_unknown_blocks_are_skipped():
    game = walk(2, 4)
    data = written(game, turns=2, close=False)
    key = blocks.decode_head(data[8 : 8 + blocks.HEAD_SIZE]).crc
    stranger = blocks.make_block(ord("Z"), b"of a later version", key, blocks.BlockCounts(2))
    first = blocks.decode_head(data[8 : 8 + blocks.HEAD_SIZE]).end + 8
    assert logs_of(opened(data[:first] + stranger + data[first:])) == game


# -- the same bytes ---------------------------------------------------------------------------------------------


@FEWER
@given(games, st.integers(1, 4))
def test_recording_a_read_recording_gives_the_same_bytes(game, turns):
    first = written(game, turns=turns)
    reader = opened(first)
    assert written(logs_of(reader), reader.header, turns=turns) == first


# -- refusals ---------------------------------------------------------------------------------------------------

BAD_LOGS = [[1], [1, 2, 3], [1.5, 2], ["a", "b"], [1, 2**63], [(1, 2, 3)], [("a", 1)], [(2**63, 1)], [1, (1, 2), 3]]
BAD_LOGS += [[(kind, data)] for kind in (0x01100020, 0x01100021) for data in (None, (), (1, 2), (1, 2, 3, 4, "z"))]
BAD_LOGS += [[(0x01100020, [1, 2, 3.0, 4.0, 5.0])], [(0x01100020, (1, 2.5, 3.0, 4.0, 5.0))]]
BAD_LOGS += [[(0x01100020, (1, 2**63, 3.0, 4.0, 5.0))], [(0x01100021, (1, 2.0, 3.0, 4.0, 10**400))]]
BAD_LOGS += [[(1, {object()})], [(1, object())], [(1, np.array(["a"]))], [None, None], [(1, [1j])]]


@pytest.mark.parametrize("log", BAD_LOGS, ids=range(len(BAD_LOGS)))
def test_a_bad_log_is_refused_and_changes_nothing(log):
    stream = io.BytesIO()
    writer = Writer(stream, HEADER, seconds=None)
    writer.add_turn([1, 2])
    with pytest.raises((BadType, BadValue)):
        writer.add_turn([0, 7, *log])
    writer.add_turn([3, 4])
    writer.close()
    assert stream.getvalue() == written([[1, 2], [3, 4]])


def test_a_header_and_keyframes_must_be_plain_dicts():
    for header in ([], {"a": object()}):
        with pytest.raises(BadType):
            Writer(io.BytesIO(), header)
    stream = io.BytesIO()
    writer = Writer(stream, HEADER, seconds=None)
    writer.add_turn([1, 2])
    with pytest.raises(BadType, match="type object"):
        writer.keyframe({"a": object()})
    writer.add_turn([3, 4])
    writer.close()
    assert stream.getvalue() == written([[1, 2], [3, 4]])


@pytest.mark.parametrize("options", [{"turns": 0}, {"turns": 2**17}, {"size": 0}], ids=repr)
def test_impossible_blocks_are_refused(options):
    with pytest.raises(BadValue, match="cannot be"):
        Writer(io.BytesIO(), {}, **options)


def test_a_block_of_more_bytes_than_its_head_can_say_is_refused(monkeypatch):
    monkeypatch.setattr(blocks, "MOST_BODY", 10)
    assert blocks.make_block(1, bytes(10), 0, blocks.BlockCounts())[blocks.HEAD_SIZE :] == bytes(10)
    with pytest.raises(BadValue, match="11 bytes cannot be recorded at once; at most 10 can"):
        blocks.make_block(1, bytes(11), 0, blocks.BlockCounts())


def test_a_closed_recording_takes_nothing_more():
    writer = Writer(io.BytesIO(), {})
    writer.close()
    writer.close()
    for call in (lambda: writer.add_turn([]), lambda: writer.keyframe({}), writer.flush):
        with pytest.raises(RecordingError, match="Nothing more"):
            call()


def turns_of_blocks(data):
    return [head.turns for head in heads_of(data) if head.type == blocks.TURNS]


def heads_of(data):
    at, heads = len(blocks.MAGIC), []
    while at < len(data):
        heads.append(blocks.decode_head(data[at : at + blocks.HEAD_SIZE]))
        at += heads[-1].end
    return heads


def test_a_block_of_many_agents_has_32_turns_too():
    assert turns_of_blocks(written(walk(10, 200))) == [64, 64, 64, 8]
    assert turns_of_blocks(written(walk(400, 40), size=1600)) == [32, 8]
    assert turns_of_blocks(written(walk(400, 40), size=1600 * 9 // 64)) == [9, 9, 9, 9, 4]


def test_a_finished_recording_ends_with_its_number_of_turns():
    data = written(walk(2, 9), turns=4, keyframes=True)
    assert bytes(head.type for head in heads_of(data)) == b"HKTTTE"
    assert heads_of(data)[-1][4:8] == (9, 0, 0, 0)
    assert opened(data).is_complete
    assert not opened(data[: -blocks.HEAD_SIZE]).is_complete


# -- size -------------------------------------------------------------------------------------------------------


def test_a_random_walk_takes_less_than_half_a_byte_for_each_move():
    game = walk(1000, 128)
    assert len(written(game, {}, keyframes=True)) < 0.5 * 128_000


def test_a_random_walk_takes_six_tenths_of_a_byte_on_large_lattices():
    game = walk(1000, 64, n=500)
    data = written(game, {})
    assert len(data) < 0.6 * 64_000
    assert logs_of(opened(data)) == game


def test_agents_that_stand_still_take_next_to_nothing():
    assert len(written([[n for row in range(1000) for n in (row, 3 * row)]] * 64, {})) < 3000
