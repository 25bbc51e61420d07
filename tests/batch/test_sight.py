"""What agents of a batch see is what the sensors show them in a game that is played alone."""

from contextlib import contextmanager

import numpy as np
import pytest
from batch_scenes import part, scene

from gamms.errors import TooLarge, UnknownName
from gamms.game.block.sensing import VisibleAgentPairs
from gamms.strategies import goto, mix

FIELD = {"fov": 2.0, "orientation": (0.6, 0.8)}


def halved(distances):
    """A probability that falls with the distance."""
    return np.exp2(-distances / 20.0)


def agents_seen(games, number, viewer, sensor):
    """Name -> node of those that an agent sees, in a game of a batch."""
    view = games.observe("red")
    names = [*games.observe("blue")["name"], *view["name"]]
    seen = view.seen(sensor)
    here = (seen.at == number) & (seen.viewers == view["name"].index(viewer))
    nodes = view.streets.ids(seen.nodes[here]).tolist()
    return dict(zip([sorted(names)[other] for other in seen.others[here].tolist()], nodes, strict=True))


@pytest.mark.parametrize(
    ("kind", "keywords"),
    [
        ("AGENT", {}),
        ("AGENT", {"team": "blue"}),
        ("AGENT_RANGE", {"sensor_range": 20.0}),
        ("AGENT_RANGE", {"sensor_range": 0.0}),
        ("AGENT_RANGE", {"sensor_range": 28.3, "exclude": ["blue"]}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "at": 12}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "at": (13.0, 22.0), "detection": 0.6}),
        ("AGENT_RANGE", {"sensor_range": 40.0, "detection": [(0.0, 1.0), (30.0, 0.2)]}),
        ("AGENT_RANGE", {"sensor_range": 40.0, "detection": halved}),
        ("AGENT_RANGE", {"sensor_range": 40.0, "position_noise_m": 9.0}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "at": 12, "position_noise_m": 7.0, "detection": 0.7}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "false_alarm_rate": 1.5}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "false_alarm_rate": 2.5, "position_noise_m": 9.0, "detection": 0.5}),
        ("AGENT_RANGE", {"sensor_range": 25.0, "at": 12, "false_alarm_rate": 1.5, "team": "red"}),
        ("AGENT_RANGE", {"sensor_range": 35.0, "delay_turns": 2}),
        ("AGENT_RANGE", {"sensor_range": 35.0, "delay_turns": 2, "exclude": ["red", "blue"]}),
        ("AGENT", {"false_alarm_rate": 0.5, "position_noise_m": 4.0}),
        ("AGENT_ARC", {"sensor_range": 30.0, "at": 12, **FIELD}),
        ("AGENT_ARC", {"sensor_range": 30.0, **FIELD}),
        ("AGENT_ARC", {"sensor_range": 30.0, "false_alarm_rate": 1.5, **FIELD}),
        ("AGENT_ARC", {"sensor_range": 30.0, "at": 12, "false_alarm_rate": 3.5, **FIELD}),
        ("AGENT_ARC", {"sensor_range": 30.0, "delay_turns": 1, **FIELD}),
        ("OCCLUDED_AGENT", {"sensor_range": 35.0, "false_alarm_rate": 1.5, **FIELD}),
        ("OCCLUDED_AGENT", {"sensor_range": 35.0}),
        ("OCCLUDED_AGENT", {"sensor_range": 35.0, "at": 7, "team": ["red"], **FIELD}),
    ],
)
def test_agents_see_whom_their_sensors_show(kind, keywords):
    with scene(max_turns=4).build(seed=1) as ctx:
        ctx.graph.add_obstacle_face(0, tr=(33, 14, 8), tl=(5, 12, 8), br=(33, 14, 0), bl=(5, 12, 0), type=14)
        ctx.agent.get_agent("red_2").orientation = (3.0, 4.0)
        for name, agent in ctx.agent.agents.items():
            agent.register_sensor("eye", ctx.sensor.create_sensor(f"{name}/eye", kind, **keywords))
        games = ctx.game.batch(seeds=[2, 1])
        ctx.game.add(part, phase="before")
        with games, ctx.game.batch(seeds=[1]) as slow:
            for _ in range(4):
                for viewer in ("red_0", "red_2"):
                    expected = ctx.game.observation(viewer)["sensor"]["eye"][1]
                    assert agents_seen(games, 1, viewer, "eye") == expected
                many, one = (batch.observe("red").seen("eye") for batch in (games, slow))
                assert [column[many.at == 1].tolist() for column in many[2:]] == [column.tolist() for column in one[2:]]
                games.step()
                slow.step()
                ctx.game.step()


def test_all_sensors_together_show_each_agent_once_and_none_itself():
    with scene().build(seed=1) as ctx:
        agent = ctx.agent.get_agent("red_1")
        for name, keywords in {"far": {"at": 12, "sensor_range": 1e9}, "near": {"sensor_range": 20.0}}.items():
            agent.register_sensor(name, ctx.sensor.create_sensor(name, "AGENT_RANGE", **keywords))
        with ctx.game.batch(2) as games:
            view = games.observe("red")
            assert view.seen().mask[:, 1].tolist() == [[True, True, True, True, False, True]] * 2
            assert view.seen("far").mask[:, 1].all()
            assert not view.seen().mask[:, [0, 2]].any()
            assert view.enemies().mask[:, 1].tolist() == [[True, True, True, False, False, False]] * 2
            assert set(view["sensor"]) == {"far", "near"}
            some = view.only(np.array([[False, False, True], [False, True, True]]))
            assert some.seen().mask[:, 1].any(axis=1).tolist() == [False, True]
            with pytest.raises(UnknownName, match="'fra'"):
                view.seen("fra")


def test_a_mask_that_takes_too_much_memory_is_refused():
    none = np.zeros(0, np.int64)
    with pytest.raises(TooLarge, match="Use the pairs"):
        _ = VisibleAgentPairs((3000, 300, 302), none, none, none, none).mask


@contextmanager
def on_edges(kind, keywords, decide, strategies):
    """Open a game by metres on hilly ground with a tunnel and a wall, in which agents go by strategies."""
    settings = {"speed_unit": "metres", "decide": decide}
    with scene(max_turns=9, settings=settings).build(seed=1) as ctx:
        ctx.graph.add_obstacle_face(0, tr=(33, 14, 8), tl=(5, 12, 8), br=(33, 14, 0), bl=(5, 12, 0), type=14)
        for node, z in ((7, 20.0), (12, 3.0)):
            ctx.graph.graph.update_node({"id": node, "z": z, "underground": node == 7})
        for i, (name, agent) in enumerate(ctx.agent.agents.items()):
            agent.register_sensor("eye", ctx.sensor.create_sensor(f"{name}/eye", kind, sensor_range=35.0, **keywords))
            agent.orientation = (0.0, 1.0) if i == 4 else None
            agent.register_strategy(strategies[agent.team](ctx))
            agent.speed = (1.7, 3.0, 13.0)[i % 3]
        yield ctx


by_metres = pytest.mark.parametrize(
    ("kind", "keywords"),
    [
        ("OCCLUDED_AGENT", {}),
        ("OCCLUDED_AGENT", {"at": 12, "detection": 0.7}),
        ("OCCLUDED_AGENT", {"at": (13.0, 22.0), "position_noise_m": 4.0, "delay_turns": 1}),
        ("OCCLUDED_AGENT", {"false_alarm_rate": 1.5, **FIELD}),
        ("AGENT_ARC", FIELD),
        ("AGENT_ARC", {"false_alarm_rate": 1.5, "detection": 0.6, "delay_turns": 1, **FIELD}),
        ("AGENT_RANGE", {"false_alarm_rate": 2.0, "position_noise_m": 4.0}),
        ("AGENT", {"false_alarm_rate": 1.0}),
    ],
)


@by_metres
def test_agents_on_edges_see_whom_their_sensors_show(kind, keywords):
    to_and_fro = {team: lambda ctx: mix(0.5, goto(ctx, 0), goto(ctx, 24)) for team in ("red", "blue")}
    # Of late reports the last look of a turn counts.
    keywords = {name: value for name, value in keywords.items() if name != "delay_turns"}
    with on_edges(kind, keywords, "turn", to_and_fro) as ctx, ctx.game.batch(seeds=[2, 1]) as games:
        ctx.game.add(part, phase="before")
        with ctx.game.batch(seeds=[1]) as slow:
            for _ in range(6):
                for viewer in ("red_0", "red_1", "red_2"):
                    expected = ctx.game.observation(viewer)["sensor"]["eye"][1]
                    for batch, number in ((games, 1), (slow, 0)):
                        assert agents_seen(batch, number, viewer, "eye") == expected
                for batch in (games, slow):
                    batch.step()
                ctx.game.step()
