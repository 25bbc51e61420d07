"""Messages that arrive are arcs in the colours of their senders, in replays too; fog hides those of others."""

import re

import numpy as np
import pytest

import gamms
from gamms.visual.appearance import TEAM_COLORS
from gamms.visual.artist import ArtistGroup
from gamms.visual.constants import Layer
from gamms.visual.drawers.messages import make_message_legend
from gamms.visual.fog import Fog

BLUE, RED = TEAM_COLORS[:2]
NODES = {"anna": 0, "ben": 10, "rita": 20, "rob": 30}


@pytest.fixture
def street():
    """Two agents of blue and two of red on a street; each sends once to its team, rita is an eavesdropper."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 40))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=10)

        def strategy(state):
            if state["turn"] == 0 and state["name"] in ("anna", "rob"):
                state["outbox"].append({"channel": "radio", "to": state["team"], "body": 1})
            state["action"] = state["curr_pos"]

        for name, node in NODES.items():
            team = "blue" if name in ("anna", "ben") else "red"
            ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=strategy, sensors=["eyes"])
        ctx.game.add_channel("radio", range_m=205, eavesdroppers="rita")
        yield ctx


def arcs(ctx):
    """Return what is drawn on the layer of messages: (x where it begins, x where it ends, colour, alpha)."""
    commands = ctx.visual.draw_commands()
    found = set()
    for row in (commands.layer == Layer.MESSAGES).nonzero()[0]:
        points = commands.points[commands.offsets[row] : commands.offsets[row + 1]]
        *color, alpha = commands.color[row].tolist()
        found.add((round(float(points[0, 0])), round(float(points[-1, 0])), tuple(color), alpha))
    return found


ALL = {(0, 100, BLUE, 200), (0, 200, BLUE, 90), (300, 200, RED, 200)}


def test_an_arc_leads_from_the_sender_to_each_that_hears_it_next(street):
    assert arcs(street) == set()
    street.game.step()
    assert arcs(street) == ALL
    street.game.step()
    assert arcs(street) == set()


def test_the_legend_says_what_an_arc_is_while_there_is_one(street):
    def words():
        picture = street.visual.picture(".svg", 800, 400, labels=False, scale_bar=False).decode()
        return "message" in re.findall(r">([^<>]+)</text>", picture)

    assert not words()
    street.game.step()
    assert words()


def test_the_fog_of_a_team_shows_messages_that_its_agents_send_hear_and_overhear(street):
    street.game.step()
    Fog(street, "blue").look()
    assert arcs(street) == {(0, 100, BLUE, 200)}  # that it is overheard, it does not know
    Fog(street, "red").look()
    rings = {one for one in arcs(street) if one[0] == one[1]}
    assert rings == {(200, 200, BLUE, 90)}  # the sender is out of sight
    assert arcs(street) - rings == {(300, 200, RED, 200)}
    street.agent.get_agent("rita").current_node_id = 1
    fog = Fog(street, "red")
    shown = []

    def look(*_):
        fog.look()
        shown.append(arcs(street))

    street.game.internals.after_observing.append(look)
    street.game.step()
    assert shown == [{(0, 10, BLUE, 90), (300, 10, RED, 200)}]


def test_an_unheard_message_is_a_ring_that_grows_and_fades(street):
    street.game.add_channel("whisper", range_m=1)

    def whisper(state):
        state["outbox"].append({"channel": "whisper", "to": "ben", "body": 1})
        state["action"] = state["curr_pos"]

    street.agent.get_agent("anna").register_strategy(whisper)
    street.game.step()
    street.game.step()

    def rings(share):
        commands = ArtistGroup(street, {"messages": street.visual.artists.list_shown()["messages"]}).draw_artists(share)
        assert np.unique(commands.points, axis=0).tolist() == [[0.0, 0.0]]
        [(*color, ink)] = np.unique(commands.color, axis=0).tolist()
        assert tuple(color) == BLUE
        return commands.size, ink

    first, ink = rings(0.0)
    last, faint = rings(1.0)
    assert ((first < last).all(), ink > faint > 50) == (True, True)
    [row] = make_message_legend(street).rows
    assert row.name == "message that nobody hears"
    assert make_message_legend(street, {"rita", "rob"}) is None


@pytest.mark.parametrize("kind", list(gamms.agent.AgentType))
@pytest.mark.parametrize("columns", [5, 200])  # so large and so small are the discs of agents
@pytest.mark.parametrize("is_hidden", [False, True])
def test_rings_of_messages_lie_outside_the_signs_of_agents(kind, columns, is_hidden):
    def shout(state):
        if state["name"] == "anna":
            state["outbox"].append({"channel": "radio", "to": "ben", "body": 1})
        state["action"] = state["curr_pos"] if kind == gamms.agent.AgentType.BASIC else (0.0, 0.0, 0.0)

    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, columns))
        aloft = {"speed": 1.0} if kind == gamms.agent.AgentType.AERIAL else {}
        for node, (name, team) in enumerate({"anna": "red", "ben": "blue"}.items()):
            eyes = {"eyes": gamms.sensor.agent_range(range_m=1.0)}
            ctx.agent.create_agent(
                name, type=kind, start_node_id=node, team=team, strategy=shout, sensors=eyes, **aloft
            )
        ctx.game.add_channel("radio", range_m=30, loss=0.0 if is_hidden else 1.0)
        ctx.game.step()
        if is_hidden:
            Fog(ctx, "blue").look()
        picture = ctx.visual.picture(".svg", 800, 600, labels=False, scale_bar=False, legend=False).decode()
    groups = re.findall(r'<g fill="(\w+|#\w+)"(.*?)>(.*?)</g>', picture)
    sizes = [(ink, style, float(size)) for ink, style, circles in groups for size in re.findall(r' r="(.*?)"', circles)]
    of_message = [size for ink, style, size in sizes if ink == "none" and "stroke-opacity" in style]
    inks = {f"#{bytes(color).hex()}" for color in (BLUE, RED)}
    of_agents = [size for ink, _, size in sizes if ink in inks]
    of_flyers = [size for ink, style, size in sizes if ink == "none" and "stroke-opacity" not in style]
    assert max(of_message) > 2.0 + max(of_agents + of_flyers)


def test_messages_of_agents_that_are_gone_are_left_out(street):
    street.game.step()
    street.agent.delete_agent("anna")
    assert arcs(street) == {(300, 200, RED, 200)}
