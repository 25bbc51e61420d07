"""Maps that change in the middle of turns: states that are opened or replayed are those of the game, turn by turn."""

import io
import time
from copy import deepcopy

import numpy as np
from games import copied, empty_context, everything, grid_context, recorded, replayed
from hypothesis import given, settings
from test_random_games import Programme, programmes, without_what_a_pause_hides

import gamms
from gamms.plain import to_plain

SIMULATE = 1


def test_an_agent_may_be_put_on_a_node_that_is_removed_in_the_same_turn(ctx):
    def play(ctx):
        ctx.agent.create_agent("a", start_node_id=0)
        ctx.visual.simulate()
        ctx.agent.get_agent("a").current_node_id = 4
        ctx.agent.create_agent("b", start_node_id=4)
        ctx.agent.create_agent("c", start_node_id=4, type=1, speed=1.0)
        ctx.graph.graph.remove_node(4)
        ctx.visual.simulate()

    data = recorded(play, ctx)
    again, _ = replayed(data)
    assert again.agent.get_agent("a").current_node_id == again.agent.get_agent("b").current_node_id == 4
    assert again.agent.get_agent("c").position == (10.0, 10.0, 0.0)
    assert everything(again) == everything(ctx)
    assert copied(data) == data


def test_a_map_may_vanish_below_its_agents(ctx):
    def play(ctx):
        ctx.agent.create_agent("a", start_node_id=3)
        ctx.agent.create_agent("kite", start_node_id=5, type=1, speed=1.0)
        for node in range(9):
            ctx.graph.graph.remove_node(node)
        ctx.visual.simulate()

    again, _ = replayed(recorded(play, ctx))
    assert everything(again) == everything(ctx)


def test_a_map_that_is_loaded_late_gives_the_same_bytes_however_long_it_took():
    def play(ctx, seconds):
        ctx.visual.simulate()
        time.sleep(seconds)
        for _ in range(2):
            ctx.visual.simulate()
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2, 1.0))
        ctx.agent.create_agent("a", start_node_id=3)
        ctx.visual.simulate()

    quick, slow = (recorded(lambda ctx, wait=wait: play(ctx, wait), empty_context()) for wait in (0.0, 0.6))
    assert quick == slow
    with gamms.recorder.open(io.BytesIO(quick)) as recording:
        assert [len(recording.state(turn).graph.columns().node_ids) for turn in range(5)] == [0, 0, 0, 0, 4]


def test_an_opened_recording_knows_which_node_is_below_a_flyer_when_the_map_has_changed(ctx):
    def play(ctx):
        ctx.agent.create_agent("kite", start_node_id=4, type=1, speed=1.0)
        ctx.visual.simulate()
        ctx.graph.graph.add_node({"id": 20, "x": 10.0, "y": 11.0})
        ctx.graph.graph.remove_node(4)
        ctx.visual.simulate()

    rec = gamms.recorder.open(io.BytesIO(recorded(play, ctx)))
    assert [rec[turn].agents["node"].tolist() for turn in (1, 2)] == [[4], [20]]


# -- the law ------------------------------------------------------------------------------------------------------

COLUMNS = ("node", "previous", "x", "y", "z", "quat_w", "quat_x", "quat_y", "quat_z")


def columns_of(ctx):
    """What `Recording.state` says of agents."""
    rows = []
    for agent in ctx.agent.create_iter():
        place = (*agent.position, *agent.quat) if agent.type else (None,) * 7
        rows.append((agent.current_node_id, agent.prev_node_id, *place))
    columns = np.array(rows, np.float64).reshape(-1, len(COLUMNS)).T
    return [agent.name for agent in ctx.agent.create_iter()], dict(zip(COLUMNS, columns, strict=True))


def values_of(ctx):
    found = ctx.record.components.get_recorded()[1]
    fields = {
        name: {field: one for field, one in values.items() if field != "name"} for name, (_, values) in found.items()
    }
    return to_plain(fields)


@settings(max_examples=24)
@given(programmes, programmes)
def test_opened_and_replayed_states_are_those_of_the_game_turn_by_turn(before, after):
    ctx, live = grid_context(), []
    programme = Programme(ctx)
    programme.do(without_what_a_pause_hides(before))

    def play(ctx):
        ctx.visual.after_turn.append(lambda: live.append(deepcopy((everything(ctx), columns_of(ctx), values_of(ctx)))))
        programme.do(without_what_a_pause_hides(after))

    data = recorded(play, ctx)
    again = empty_context(seed=2)
    for turn, _ in enumerate(one for one in again.record.replay(io.BytesIO(data)) if one["opCode"] == SIMULATE):
        assert everything(again) == live[turn][0]
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        assert rec.turns == len(live)
        assert [rec[turn].components for turn in range(rec.turns, 0, -1)] == [one[2] for one in reversed(live)]
        for (told, (found_names, columns), components), state in zip(live, list(rec)[1:], strict=True):
            assert state.components == components
            assert state.agents["name"].tolist() == found_names
            assert state.graph.packed == told["world"]
            for name, column in columns.items():
                np.testing.assert_array_equal(state.agents[name].astype(np.float64), column)
        told = [step for step in rec.steps() if step["event"] == "AERIAL_AGENT_POSITION"]
        flights = [(step["turn"], step["data"]["agent_name"], *step["data"]["position"]) for step in told]
        assert list(zip(*(one.tolist() for one in rec.table("positions").values()), strict=True)) == flights
    assert copied(data) == data
