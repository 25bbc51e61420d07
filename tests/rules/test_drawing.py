"""Rules draw themselves: by name, so that anybody can replace them; what they need is in the recording."""

import numpy as np
import pytest

import gamms
from gamms.ir.draw import DrawKind
from gamms.rules import capture_flag, tag, territory
from gamms.visual.artist import ArtistGroup
from gamms.visual.constants import Layer
from gamms.visual.drawers.rules import as_text, find_ids_in_text


@pytest.fixture
def game(tmp_path):
    """Two of each team on a row of nodes, a flag at each end, and ground for both."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        fill(ctx)
        for name, team, node in (("r0", "red", 0), ("r1", "red", 1), ("b0", "blue", 8), ("b1", "blue", 5)):
            ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=staying)
        ctx.game.add(territory.published({node: "red" if node < 5 else "blue" for node in range(10)}))
        ctx.game.add(tag("blue", "red", hops=0, score=2))
        ctx.game.add(capture_flag({"red": 0, "blue": 9}, goal=None))
        yield ctx


def fill(ctx):
    ctx.graph.add_nodes(range(10), x=np.arange(10) * 10.0, y=np.zeros(10))
    ctx.graph.add_edges(range(18), sources=[*range(9), *range(1, 10)], targets=[*range(1, 10), *range(9)])


def staying(state):
    state["action"] = state["curr_pos"]


def go(ctx, name, node):
    ctx.agent.get_agent(name).current_node_id = node


def on_layer(ctx, layer, kind=None):
    """What is drawn there: the points of each command."""
    commands = ctx.visual.draw_commands()
    is_meant = (commands.layer == layer) & (True if kind is None else commands.kind == kind)
    return [commands.points[commands.offsets[row] : commands.offsets[row + 1]] for row in np.flatnonzero(is_meant)]


def test_a_game_that_begins_again_has_no_marks(game):
    game.game.step()
    go(game, "r1", 5)
    game.game.step()
    game.game.reset()
    assert on_layer(game, 25) == []


def test_a_carried_flag_glides_with_its_carrier_and_leaves_a_square_below_agents(game):
    go(game, "r0", 9)
    game.game.step()

    def poles_on(layer):  # of a place and two ends
        return [pole[0].tolist() for pole in on_layer(game, layer, DrawKind.POLYGON) if len(pole) == 3]

    assert (poles_on(Layer.FLAGS), poles_on(Layer.GOALS)) == ([[90.0, 0.0]], [[0.0, 0.0]])
    assert Layer.GOALS < Layer.AGENTS
    agent = game.agent.get_agent("r0")
    agent.get_state()["action"] = 8
    agent.set_state()
    game.visual.simulate()
    game.visual.drawing.motion.begin_turn()
    shown = game.visual.artists.list_shown()
    share = {name: shown[name] for name in ("flags", "flags beneath")}
    half = ArtistGroup(game, share).draw_artists(0.5)
    corners = np.diff(half.offsets)
    poles = half.points[half.offsets[:-1][corners == 3]]
    assert poles.tolist() == [[0.0, 0.0], [85.0, 0.0]]
    squares = half.points[half.offsets[:-1][(corners == 5) & (half.width > 0)]]
    assert squares.tolist() == [[90.0, 0.0], [0.0, 0.0]]


def test_an_artist_that_was_there_first_stays(game):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        fill(ctx)
        ctx.visual.add_artist("territory", {"drawer": lambda *_: None})
        ctx.game.add(territory.published({0: "red"}))
        assert on_layer(ctx, 12) == []


def test_ids_are_kept_as_short_text():
    ids = [0, 1, 2, 3, 9, 11, 12]
    assert as_text(np.array(ids)) == "0..3 9 11..12"
    assert np.array_equal(find_ids_in_text("11..12 0..3 9", np.arange(-1, 14)), np.isin(np.arange(-1, 14), ids))
    assert find_ids_in_text("-5..-4 -1", np.array([-6, -5, -4, -3, -1, 0])).tolist() == [
        False,
        True,
        True,
        False,
        True,
        False,
    ]


def test_a_territory_of_more_nodes_than_there_is_memory_for_is_drawn_where_there_are_nodes(game):
    game.game.data["territories"] = {"land": {"red": "0..99999999999"}}
    whole = len(game.visual.draw_commands())
    game.game.data["territories"] = {"land": {"red": "0..99"}}
    assert whole == len(game.visual.draw_commands())


def test_of_very_many_flags_and_territories_only_some_are_drawn(game):
    game.game.data["flags"] = {"bases": dict.fromkeys(range(10**5), 0), "carriers": {}}
    game.game.data["territories"] = {"territory": {f"team {number}": "0..9" for number in range(10**5)}}
    assert 500 < len(game.visual.draw_commands()) < 5_000


@pytest.mark.parametrize("kept", [5, {"land": 3}, {"land": {"red": 4}}, {"land": {"red": "1..x"}}])
def test_values_of_a_program_under_the_same_names_do_no_harm(game, kept):
    game.game.data["territories"] = kept
    game.game.data["flags"] = {"bases": 3, "carriers": {}}
    assert len(game.visual.draw_commands()) > 0
