"""What went wrong in recordings of gamms 1.0.0, each with its number in our list: it does not go wrong here."""

import enum
import io
import os
from pathlib import Path
from typing import Optional, Tuple  # noqa: UP035 - as programs for 1.0.0 spell them

import numpy as np
import pytest
from games import act, everything, grid_context, recorded, replayed

import gamms
from gamms.recorder import Reader

VERSIONS = pytest.mark.parametrize("version", [2, 3])


def records_of(play, **options):
    data = recorded(play, **options)
    return replayed(data, grid_context())[1]


# D8, D9 (an end while paused; a start after the end) are in test_drop_in.py


def a_bit_of_everything(ctx):
    @ctx.record.component(struct={"count": int})
    class Flag:
        pass

    ctx.agent.create_agent("a", start_node_id=0, sensors=["near", "map"], orientation=(1, 3))
    ctx.agent.create_agent("d", start_node_id=0, type=gamms.agent.AgentType.AERIAL, speed=0.7, sensors=["near"])
    flag = Flag("flag")
    for turn in range(3):
        act(ctx, "a", {"node_id": turn, "orientation": (turn, 1.0)})
        act(ctx, "d", {"direction": (1, turn, 2), "quat": (1, 2, turn, 0)})
        flag.count = turn
        ctx.visual.simulate()


@VERSIONS
def test_d13_refused_calls_are_not_in_the_file(version):
    def play(ctx):
        ctx.agent.create_agent("a", start_node_id=0)
        a = ctx.agent.get_agent("a")
        a.get_state()["action"] = 99
        for wrong in (
            lambda: ctx.agent.create_agent("a", start_node_id=1),
            lambda: ctx.agent.create_agent("b", start_node_id=99),
            lambda: ctx.agent.create_agent("b"),
            lambda: ctx.agent.create_agent("d", start_node_id=0, type=1),
            lambda: ctx.agent.create_agent("b", start_node_id=0, step=1),
            lambda: ctx.agent.create_agent("b", start_node_id=0, sensors=5),
            lambda: setattr(a, "current_node_id", 99),
            lambda: setattr(a, "prev_node_id", "x"),
            lambda: setattr(a, "orientation", (0, 0)),
            lambda: a.register_sensor("x", None),
            lambda: ctx.record.delete_component("nobody"),
            a.set_state,
        ):
            with pytest.raises((KeyError, ValueError, TypeError, AttributeError)):
                wrong()
        ctx.agent.delete_agent("nobody")
        a.deregister_sensor("nothing")

    assert [record["opCode"] for record in records_of(play, version=version)] == [0x01000000, 0]


def test_d13_a_creation_that_fails_half_way_leaves_no_gap_in_the_numbers():
    def play(ctx):
        ctx.agent.create_agent("a", start_node_id=0)
        sensor = ctx.sensor.get_sensor("near")
        set_owner, sensor.set_owner = sensor.set_owner, lambda _: 1 / 0
        with pytest.raises(ZeroDivisionError):
            ctx.agent.create_agent("b", start_node_id=1, sensors=["near"])
        sensor.set_owner = set_owner
        ctx.agent.create_agent("c", start_node_id=2)
        act(ctx, "c", 5)

    ctx = replayed(recorded(play))[0]
    assert [(one.name, one.current_node_id) for one in ctx.agent.create_iter()] == [("a", 0), ("c", 5)]


class Colour(enum.IntEnum):
    """An integer with a name."""

    RED = 3


@VERSIONS
def test_d14_unwritable_values_are_left_out_and_the_rest_is_whole(version):
    def play(ctx):
        meta = {"plan": print, "team": Colour.RED, "goal": np.int64(4), "inner": {"f": lambda: 0, "x": (1, 2)}}
        ctx.agent.create_agent("a", start_node_id=0, meta=meta, brain=object(), strategy=print, color=(1, 2, 3))
        meta["team"] = "changed later"
        act(ctx, "a", 1)
        ctx.visual.simulate()

    ctx = replayed(recorded(play, version=version), grid_context())[0]
    agent = ctx.agent.get_agent("a")
    assert agent.meta["team"] == 3
    assert agent.meta["goal"] == 4
    assert list(agent.meta["inner"].values()) in ([(1, 2)], [[1, 2]])  # version 2 has no tuples
    assert set(agent.meta) == {"team", "goal", "inner"}
    assert not hasattr(agent, "brain")
    assert agent.current_node_id == 1


def test_d14_values_of_the_game_that_are_not_plain_are_recorded_as_words_without_addresses():
    class Treasure:
        pass

    def play(ctx):
        ctx.game.data["kept"] = {"treasure": Treasure(), "at": 4}
        ctx.game.data["grid"] = np.zeros((2, 2))
        ctx.game.emit("found", what=Treasure(), who={"b", "a"})
        ctx.visual.simulate()
        ctx.game.data["grid"][0, 0] = 1
        ctx.visual.simulate()

    data = recorded(play)
    assert data == recorded(play)
    ctx = replayed(data)[0]
    assert ctx.game.data["kept"] == {"at": 4}
    assert ctx.game.data["grid"].tolist() == [[1, 0], [0, 0]]
    assert ctx.game.events[0]["who"] == {"a", "b"}
    assert " at 0x" not in ctx.game.events[0]["what"]


def test_d17_the_file_says_on_which_map_by_which_version_and_seed_it_was_made(ctx, tmp_path):
    data = recorded(a_bit_of_everything, created=5, provenance={"paper": "x"})
    header = Reader(io.BytesIO(data)).header
    assert (header["seed"], header["created"], header["provenance"]) == (1, 5, {"paper": "x"})
    assert header["package"]
    again = replayed(data)[0]
    assert again.graph.storage.pack() == ctx.graph.storage.pack()
    assert again.sensor.storage.describe_sensors() == ctx.sensor.storage.describe_sensors()
    for private in (os.uname().nodename, str(Path.home()), str(tmp_path)):
        assert private.encode() not in data


@VERSIONS
def test_d19_tuples_and_local_variables_called_name_work_in_components(version):
    def play(ctx):
        @ctx.record.component(struct={"way": Tuple[int, ...], "pair": Optional[Tuple[int, str]]})  # noqa: UP006, UP045
        class Route:
            def __init__(self, way=()):
                name = way
                self.way = name

        Route("r", (1, 2)).pair = (3, "x")

    route = replayed(recorded(play, version=version), grid_context())[0].record.get_component("r")
    assert (route.way, route.pair) == ((1, 2), (3, "x"))


def test_an_agent_whose_node_was_taken_away_is_still_in_a_later_recording():
    original = grid_context()
    original.agent.create_agent("a", start_node_id=4)
    original.graph.graph.remove_node(4)

    def play(ctx):
        act(ctx, "a", 5)
        ctx.visual.simulate()

    ctx, records = replayed(recorded(play, original))
    assert records[0]["data"] == {"agent_name": "a", "node_id": 4}
    assert everything(ctx) == everything(original)
