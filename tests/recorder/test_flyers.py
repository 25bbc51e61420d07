"""Agents that fly: what is written of them is little, exact to the last bit, and found again at any turn."""

import io
import random
import struct

import numpy as np
import pytest
from fuzzing import parts_of, rebuilt
from games import act, copied, empty_context, everything, grid_context, recorded, replayed
from hypothesis import given, settings
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

names = st.sampled_from("abcd")
reals = st.floats(-50, 50) | st.sampled_from([-0.0, 0.1, 1e-300])
points = st.tuples(reals, reals, reals)
nodes = st.integers(0, 8)
steps = st.one_of(
    st.tuples(st.just("come"), names, nodes, points, st.booleans()),
    st.tuples(st.just("go"), names),
    st.tuples(st.just("act"), names, nodes, points, st.none() | st.tuples(reals, reals, reals, reals)),
    st.tuples(st.just("act"), names, nodes, points, st.none()),
    st.tuples(st.just("teleport"), names, nodes, points, st.booleans()),
    st.tuples(st.just("turn"), names, reals),
    st.tuples(st.just("pause")),
    st.just(("simulate",)),
    st.just(("simulate",)),
)
programmes = st.lists(steps, max_size=40)


class Programme:
    """Does the steps that are possible, and keeps what was so after each turn."""

    def __init__(self, ctx):
        self.ctx = ctx
        self.states = []
        for name, flies in (("a", True), ("b", False)):
            self.come(name, 4, (1.0, 2.0, 3.0), flies)

    def do(self, programme):
        self.states.append(state_of(self.ctx))
        for verb, *arguments in [*programme, ("simulate",)]:
            agent = self.ctx.agent.agents.get(arguments[0]) if arguments else None
            if (agent is None) == (verb in ("come", "simulate", "pause")):
                getattr(self, verb)(*([agent or arguments[0], *arguments[1:]] if arguments else ()))

    def come(self, name, node, position, flies):
        more = {"type": 1, "speed": 0.7, "position": position} if flies else {}
        self.ctx.agent.create_agent(name, start_node_id=node, **more)

    def go(self, agent):
        self.ctx.agent.delete_agent(agent.name)

    def act(self, agent, node, direction, quat):
        flight = direction if quat is None else {"direction": direction, "quat": quat}
        act(self.ctx, agent.name, flight if agent.type else node)

    def teleport(self, agent, node, position, to_node):
        if agent.type and not to_node:
            agent.position = position
        else:
            agent.current_node_id = node

    def turn(self, agent, x):
        agent.orientation = (x, 1.0)

    def pause(self):
        self.ctx.record.pause()
        self.ctx.record.play()

    def simulate(self):
        self.ctx.visual.simulate()
        self.states.append(state_of(self.ctx))


def state_of(ctx):
    """Who is where, and how turned, as the columns of a state, in bytes."""
    ctx.agent.block.locate()
    columns_ = ctx.agent.block
    places = [position or (np.nan,) * 3 for position in columns_.position]
    quats = [quat or (np.nan,) * 4 for quat in columns_.quat]
    floats_ = np.array([(*place, *quat) for place, quat in zip(places, quats, strict=True)]).reshape(-1, 7)
    return list(columns_.names), list(columns_.node), list(columns_.previous), floats_.tobytes()


def state_in(state):
    """The same of a state in a recording."""
    agents = state.agents
    axes = [agents[name] for name in ("x", "y", "z", "quat_w", "quat_x", "quat_y", "quat_z")]
    found = np.column_stack(axes).tobytes()
    return agents["name"].tolist(), agents["node"].tolist(), agents["previous"].tolist(), found


def game_of(programme):
    ctx = grid_context()
    player = Programme(ctx)
    return recorded(lambda _: player.do(programme), ctx), player


@settings(max_examples=12)
@given(programmes, st.randoms(use_true_random=False))
def test_every_state_is_what_was_live(programme, chance):
    data, player = game_of(programme)
    order = list(range(len(player.states)))
    chance.shuffle(order)
    with recorder.open(io.BytesIO(data)) as rec:
        assert rec.turns == len(order) - 1
        for turn in order:
            assert state_in(rec[turn]) == player.states[turn]


@settings(max_examples=12)
@given(programmes)
def test_a_replay_comes_to_the_same_and_its_copy_is_the_same_file(programme):
    data, player = game_of(programme)
    again, _ = replayed(data)
    assert everything(again) == everything(player.ctx)
    assert copied(data) == data


@settings(max_examples=12)
@given(programmes)
def test_positions_are_those_that_steps_tell(programme):
    data, _ = game_of(programme)
    with recorder.open(io.BytesIO(data)) as rec:
        told = [step for step in rec.steps() if step["event"] == "AERIAL_AGENT_POSITION"]
        rows = [(step["turn"], step["data"]["agent_name"], *step["data"]["position"]) for step in told]
        assert list(zip(*(column.tolist() for column in rec.table("positions").values()), strict=True)) == rows


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
    part[1] = b"".join(map(packed_bytes.packed, change(*packing.unpack_parts(part[1], 1 << 20, has_columns=True))))
    return rebuilt(random.Random(0), parts)


KIND, EMPTY, ONE = (packed_bytes.column(np.array([number])) for number in (TURN, 0, 1))


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
