"""Agents that fly: what is written of them is little, exact to the last bit, and found again at any turn."""

import io
import random
import struct

import numpy as np
import pytest
from fuzzing import parts_of, rebuilt
from games import act, empty_context, grid_context, recorded, replayed
from hypothesis import given
from hypothesis import strategies as st
from recordings import opened, written

import gamms
from gamms import recorder
from gamms.ir import events as kinds
from gamms.ir import packed_bytes, packing
from gamms.recorder import Reader, RecordingError, Writer
from gamms.recorder.formats import blocks

FLIGHT, TURN = kinds.AERIAL_AGENT_FLIGHT, kinds.AERIAL_AGENT_TURN
DAMAGED = "numbers of bytes|data that are not numbers|left over|are stated"

# -- there and back ---------------------------------------------------------------------------------------------

bits = st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("<d", bits.to_bytes(8, "little"))[0])
floats = st.floats() | bits | st.sampled_from([0.0, -0.0, 0.1, 0.2, 0.30000000000000004])


@given(st.lists(st.tuples(st.integers(-2, 3), st.integers(), floats), max_size=40), st.integers(1, 3))
def test_flights_and_turns_come_back_to_the_last_bit(parts, turns):
    game = [
        [(FLIGHT, (number, node % 2**63, x, -x, 1.0)), number, 5, (TURN, (number, 1.0, x, x, 0.5))]
        for number, node, x in parts
    ]
    reader = opened(written(game, turns=turns))
    found = [reader.log(turn) for turn in range(reader.turns)]
    assert repr(found) == repr(game)


# -- games ------------------------------------------------------------------------------------------------------


def test_flights_are_reported_as_by_1_0_0():
    ctx = grid_context()
    ctx.agent.create_agent("kite", start_node_id=0, type=1, speed=10.0)

    def play(ctx):
        act(ctx, "kite", {"direction": (1.0, 0.0, 0.0), "quat": (2.0, 0.0, 0.0, 0.0)})
        ctx.visual.simulate()

    _, records = replayed(recorded(play, ctx))
    assert [(record["opCode"], record.get("data")) for record in records] == [
        (kinds.AERIAL_AGENT_POSITION, {"agent_name": "kite", "position": [10.0, 0.0, 0.0]}),
        (kinds.AGENT_PREV_NODE, {"agent_name": "kite", "node_id": 0}),
        (kinds.AERIAL_AGENT_QUATERNION, {"agent_name": "kite", "quat": [1.0, 0.0, 0.0, 0.0]}),
        (kinds.SIMULATE, {}),
        (kinds.TERMINATE, None),
    ]


def test_flights_by_name_and_by_number_are_one_table_in_their_order():
    ctx = grid_context()
    ctx.agent.create_agent("kite", start_node_id=0, type=1, speed=1.0)

    def play(ctx):
        for x in (1.0, 3.0):
            act(ctx, "kite", (1.0, 0.0, 0.0))
            data = {"agent_name": "kite", "position": [x + 1, 0.0, 0.0]}
            ctx.record.write(gamms.typing.OpCodes.AERIAL_AGENT_POSITION, data)
            ctx.agent.get_agent("kite").position = (x + 2, 0.0, 0.0)
        ctx.visual.simulate()

    with recorder.open(io.BytesIO(recorded(play, ctx))) as rec:
        table = rec.table("positions")
        assert table["x"].tolist() == [1.0, 2.0, 3.0, 4.0, 4.0, 5.0]
        assert table["agent"].tolist() == ["kite"] * 6
        assert rec.counts() == {"AERIAL_AGENT_POSITION": 6}
        assert rec[-1].agents["x"].tolist() == [5.0]


# -- size, keyframes --------------------------------------------------------------------------------------------


# -- damage -----------------------------------------------------------------------------------------------------


def changed(data, change):
    """A recording whose first block of turns has another body; `change` gets the values in it and the columns."""
    parts = parts_of(data)
    part = next(part for part in parts if part[0] == blocks.TURNS)
    part[1] = b"".join(map(packed_bytes.pack_bytes, change(*packing.unpack_parts(part[1], 1 << 20, has_columns=True))))
    return rebuilt(random.Random(0), parts)


KIND, EMPTY, ONE = (packed_bytes.encode_column(np.array([number])) for number in (TURN, 0, 1))


@pytest.mark.parametrize(
    "change",
    [
        lambda values, columns: (values, columns + b"\1"),
        lambda values, columns: (values, columns[:-1]),
        lambda values, columns: (values, columns, b"\1"),
        lambda values, columns: (b"\1", columns.replace(KIND + EMPTY, KIND + ONE, 1)),
        lambda values, columns: (values, columns.replace(KIND + EMPTY, KIND + ONE, 1)),
        lambda values, columns: (values, columns.replace(KIND, ONE, 1)),
    ],
)
def test_damaged_tracks_are_refused(change):
    game = [[(TURN, (0, *(struct.unpack("<d", bytes([n, 0, 0, 0, 0, 0, 0, 0]))[0] for n in (1, 1, 1, 1))))]]
    data = changed(written(game, {}), change)
    assert data != written(game, {})
    with pytest.raises(RecordingError, match=DAMAGED):
        opened(data).log(0)


def test_a_flight_of_who_is_not_there_is_no_part_of_a_replay():
    data = recorded(lambda ctx: ctx.visual.simulate())
    header, begin = Reader(io.BytesIO(data)).header, Reader(io.BytesIO(data)).keyframe(0)[1]
    for kind, numbers in ((FLIGHT, (3, 1, 0.0, 0.0, 0.0)), (TURN, (3, 1.0, 0.0, 0.0, 0.0))):
        stream = io.BytesIO()
        writer = Writer(stream, header)
        writer.keyframe(begin)
        writer.add_turn([(kind, numbers)])
        writer.close()
        with pytest.raises(RecordingError, match="cannot happen here"):
            replayed(stream.getvalue(), empty_context())
