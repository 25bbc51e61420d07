"""Undeclared sensors show what is seen from where the agents are drawn; asking them changes nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.ir.draw import DrawKind
from gamms.ir.geometry import are_within
from gamms.sensor import SensorType
from gamms.strategies import random_walk
from gamms.visual.artist import ArtistGroup
from gamms.visual.legend import list_blocks

SENSORS = 15
QUIET = {"level": "CRITICAL"}


def drawn(ctx, kind, layer=SENSORS):
    """The points of the commands of a kind on a layer."""
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero((commands.layer == layer) & (commands.kind == kind))
    return [commands.points[commands.offsets[row] : commands.offsets[row + 1]] for row in rows]


def rings(ctx):
    return {tuple(points[0].tolist()) for points in drawn(ctx, DrawKind.CIRCLE)}


@pytest.fixture
def road():
    """Two agents that walk east along a road, and see each other."""
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        for number, name in enumerate(("anna", "ben")):
            ctx.sensor.create_sensor(f"{name}_eyes", SensorType.AGENT_RANGE, sensor_range=25.0)
            ctx.agent.create_agent(
                name,
                start_node_id=2 * number,
                team=name,
                sensors=[f"{name}_eyes"],
                strategy=lambda state: state.update(action=max(state["legal"])),
            )
        yield ctx


def test_rings_and_fields_are_where_the_agents_are_at_the_end_of_a_turn(road):
    road.game.run(3)
    assert rings(road) == {(30.0, 0.0), (50.0, 0.0)}
    centers = {round(float(field[:, 0].mean()), 6) for field in drawn(road, DrawKind.POLYGON) if field[:, 0].min() > 1}
    assert centers == {30.0, 50.0}


def test_a_declared_sensor_shows_its_last_data_as_in_1_0_0(road):
    road.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    road.visual.set_sensor_visual("anna_eyes", layer=SENSORS)
    road.game.run(3)
    assert rings(road) == {(40.0, 0.0)}  # where ben was when anna looked


KINDS = [
    (SensorType.RANGE, {"sensor_range": 25.0}),
    (SensorType.AGENT_RANGE, {"sensor_range": 40.0, "detection": 0.5}),
    (SensorType.AGENT_ARC, {"sensor_range": 40.0, "fov": 2.0, "detection": [(0, 1.0), (50, 0.0)]}),
    (SensorType.OCCLUDED_MAP, {"sensor_range": 25.0}),
    (SensorType.OCCLUDED_AGENT, {"sensor_range": 45.0, "detection": 0.7}),
    (SensorType.AERIAL_AGENT, {"sensor_range": 60.0, "detection": 0.5}),
    (SensorType.OCCLUDED_AERIAL, {"sensor_range": 60.0}),
]


def played(seed, turns, is_drawn, path=None):
    """A game of agents with a sensor of each kind, and all that they saw."""
    log = []
    with gamms.create_context(seed=seed, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.graph.add_obstacle_face(0, (15, 0, 9), (15, 25, 9), (15, 0, 0), (15, 25, 0), 1)
        for number, (kind, given) in enumerate(KINDS):
            ctx.sensor.create_sensor(f"s_{number}", kind, **given)
            flies = "AERIAL" in kind.name
            more = {"type": AgentType.AERIAL, "speed": 5.0} if flies else {"strategy": random_walk}
            agent = ctx.agent.create_agent(f"a_{number}", start_node_id=3 * number, sensors=[f"s_{number}"], **more)
            if flies:
                agent.position = (20.0, 20.0, 30.0)
        if path is not None:
            ctx.record.start(path, created=0, provenance="")
        for _ in range(turns):
            ctx.game.step()
            if is_drawn:
                before = [repr(sensor.data) for sensor in ctx.sensor.sensors.values()]
                ctx.visual.draw_commands()
                assert [repr(sensor.data) for sensor in ctx.sensor.sensors.values()] == before
            log.append({name: repr(agent.state["sensor"]) for name, agent in ctx.agent.agents.items()})
        result = ctx.game.result()
    return log, result


@settings(max_examples=8)
@given(seed=st.integers(0, 2**20))
def test_pictures_change_nothing_that_sensors_see(seed):
    assert played(seed, 4, is_drawn=True) == played(seed, 4, is_drawn=False)


def test_pictures_change_nothing_that_is_recorded(tmp_path):
    for is_drawn in (True, False):
        played(1, 4, is_drawn, tmp_path / str(is_drawn))
    assert (tmp_path / "True.ggr").read_bytes() == (tmp_path / "False.ggr").read_bytes()


# -- behind walls -------------------------------------------------------------------------------------------------


@pytest.fixture
def yard():
    """A square of 21 by 21 nodes with a wall through it, and an agent before the middle of the wall."""
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(21, 21, spacing=5.0))
        ctx.graph.add_obstacle_face(0, (52.5, 20, 9), (52.5, 80, 9), (52.5, 20, 0), (52.5, 80, 0), 1)
        ctx.agent.create_agent("anna", start_node_id=10 * 21 + 9)  # at (45, 50)
        yield ctx


@pytest.mark.parametrize("kind", [SensorType.OCCLUDED_MAP, SensorType.OCCLUDED_AGENT])
def test_the_field_of_an_occluded_sensor_ends_at_the_walls(yard, kind):
    sensor = yard.sensor.create_sensor("eyes", kind, sensor_range=30.0)
    yard.agent.get_agent("anna").register_sensor("eyes", sensor)
    sensor.sense(10 * 21 + 9)
    for outline in (sensor.last_view().outline, sensor.view_from(10 * 21 + 9, "anna").outline):
        nodes = yard.graph.columns().xy
        near = np.hypot(*(nodes - (45.0, 50.0)).T) < 29.0  # not on the rim
        is_free = yard.graph.visible(np.array([45.0, 50.0, 1.6]), np.column_stack([nodes, np.full(len(nodes), 1.6)]))
        assert are_within(nodes[near], outline).tolist() == is_free[near].tolist()
        assert 20 < int((near & ~is_free).sum()) < int(near.sum()) / 2


@pytest.mark.parametrize("kind", ["AERIAL", "AERIAL_AGENT", "AGENT_RANGE"])
def test_an_occluded_sensor_has_the_reach_of_the_unoccluded_one(yard, kind):
    names = [kind, {"AGENT_RANGE": "OCCLUDED_AGENT"}.get(kind, f"OCCLUDED_{kind}")]
    is_in_air = kind != "AGENT_RANGE"
    views = []
    for name in names:
        eye = yard.sensor.create_sensor(name, SensorType[name], sensor_range=60.0)
        if is_in_air:
            eye.at = (45.0, 50.0, 30.0)
        eye.sense(10 * 21 + 9)
        views.append(eye.last_view())
    free, blocked = views
    assert blocked.reach.tolist() == free.outline.tolist()
    assert len(free.reach) == 0
    assert len(free.outline) > 20
    assert (len(blocked.outline) == 0, len(blocked.dashed) > 0) == (is_in_air, is_in_air)


@pytest.mark.parametrize("count", [1, 8])
def test_the_field_of_view_of_a_drone_past_walls_is_dashed_and_moves_with_it(yard, count):
    eyes = {"eye": gamms.sensor.occluded_aerial_agent(range_m=20.0)}
    for number in range(count):
        place = (20.0 + number, 30.0, 20.0)
        at = {"start_node_id": 0, "type": AgentType.AERIAL, "position": place, "speed": 5.0}
        yard.agent.create_agent(f"drone_{number}", **at, sensors=eyes, team="red", strategy=fly_east)
    yard.visual.drawing.motion.begin_turn()
    yard.game.step()
    yard.visual.drawing.motion.begin_turn()
    assert "range, if nothing blocks it" in {row.name for row in legend_rows(yard)}
    before, after = (dashed_lines(yard, share) for share in (0.0, 1.0))
    assert len(after) > 20
    assert np.allclose(after - before, (5.0, 0.0))
    assert np.allclose(after.mean(axis=0), (25.0 + (count - 1) / 2, 30.0), atol=1.0)


def fly_east(state):
    """Fly along the x axis."""
    state["action"] = (5.0, 0.0, 0.0)


def legend_rows(ctx):
    """Return the rows of the legend that a picture shows."""
    return [row for block in list_blocks(ctx, ctx.visual.artists.list_shown()) for row in getattr(block, "rows", ())]


def dashed_lines(ctx, share):
    """Return the points of the lines that the artists of sensors draw, after a share of the last turn."""
    artists = {
        name: one for name, one in ctx.visual.artists.list_shown().items() if name.startswith(("sensor_", "sights"))
    }
    commands = ArtistGroup(ctx, artists).draw_artists(share)
    is_line = np.repeat(commands.kind == DrawKind.LINE, np.diff(commands.offsets))
    assert not (commands.kind == DrawKind.POLYGON).any()
    return commands.points[is_line]


def test_areas_are_measured_again_when_a_wall_goes(yard):
    sensor = yard.sensor.create_sensor("eyes", SensorType.OCCLUDED_MAP, sensor_range=20.0)
    sensor.sense(10 * 21 + 9)
    assert sensor.last_view().outline[:, 0].max() < 60.0
    yard.graph.remove_obstacle_face(0)
    assert sensor.last_view().outline[:, 0].max() == pytest.approx(65.0, abs=0.1)


# -- many sensors -----------------------------------------------------------------------------------------------


@pytest.fixture
def crowd():
    """A function from a number of agents, a team for each, and a kind of sensor to a context in which all look."""

    def made(count, team=lambda number: "red", kind=SensorType.AGENT_RANGE, nodes=(44,)):
        ctx = gamms.create_context(seed=1)
        ctx.graph.attach_networkx_graph(gamms.graph.grid(10, 10))
        for number in range(count):
            ctx.sensor.create_sensor(f"s{number}", kind, sensor_range=15.0)
            at = nodes[number % len(nodes)]
            ctx.agent.create_agent(
                f"a{number}", start_node_id=at, team=team(number), sensors=[f"s{number}"]
            ).get_state()
        return ctx

    return made


def fields(ctx):
    """The alpha of each filled field of view."""
    commands = ctx.visual.draw_commands()
    is_field = (commands.kind == DrawKind.POLYGON) & (commands.width == 0.0)
    return commands.color[is_field, 3].tolist()


def opacity(alphas):
    return 1.0 - float(np.prod([1.0 - alpha / 255 for alpha in alphas]))


def test_few_fields_of_view_are_drawn_one_by_one(crowd):
    assert len(fields(crowd(6))) == 6


def test_many_fields_of_view_of_a_team_are_one(crowd):
    alphas = fields(crowd(20))
    assert len(alphas) == 1
    assert opacity(alphas) < 0.2


def test_fields_of_view_of_a_team_that_are_apart_stay_so(crowd):
    assert len(fields(crowd(7, nodes=(0, 99)))) == 2


def test_fields_of_view_of_many_colours_never_hide_the_map(crowd):
    alphas = fields(crowd(20, team=lambda number: f"team {number}"))
    assert len(alphas) > 4
    assert opacity(alphas) < 0.45


def test_agents_that_are_seen_keep_their_rings(crowd):
    artists = crowd(20, team=lambda number: "red" if number % 2 else "blue").visual.artists.list_shown(0)
    assert "rings" in artists
    assert "sights" in artists
    assert not [name for name in artists if name.startswith("sensor_")]


def test_views_of_many_sensors_are_left_out_with_sensors_false(crowd):
    ctx = crowd(20)
    assert "sights" not in ctx.visual.artists.list_shown(0, sensors=False)
