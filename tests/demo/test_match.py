"""The game of the demo is a scenario file like any other."""

import subprocess
import sys
from math import dist

import pytest

from gamms import scenario
from gamms.demo import FILE, Team, capture_the_flag

FIVE = (Team("red", 5), Team("blue", 5))


def test_the_demo_plays_the_file_as_it_is():
    assert capture_the_flag(FIVE, 600) == scenario.load(FILE)
    assert capture_the_flag(FIVE, 20).play(seed=3) == scenario.load(FILE).replace(
        **{"rules.time_limit.with.turns": 20}
    ).play(seed=3)


def test_nothing_goes_wrong_and_flags_change_hands():
    result = capture_the_flag(FIVE, 600).play(seed=1)
    assert result.errors == []
    assert {"take", "capture", "tag"} <= {event["kind"] for event in result.events}
    assert result.scores[result.winner] > 0


def test_intruders_are_tagged_where_they_are_and_sent_home():
    with capture_the_flag(FIVE, 300).build(seed=2) as ctx:
        territory = ctx.game.facts["territory"]
        while ctx.game.step():
            for event in ctx.game.events:
                if event["kind"] == "tag" and event["turn"] == ctx.game.turn:
                    tagger, other = (ctx.agent.get_agent(event[key]) for key in ("agent", "other"))
                    assert territory[event["node"]] == tagger.team != other.team
                    assert other.current_node_id == ctx.game.start_node(other)


@pytest.mark.parametrize("size", [1, 40, 200])
def test_a_team_of_any_size_finds_room_around_its_flag(size):
    game = capture_the_flag((Team("cats", size), Team("dogs", 2)), 5)
    with game.build(seed=1) as ctx:
        flag = ctx.graph.graph.get_node(ctx.game.facts["flags"]["cats"]["node"])
        within = game.spec.teams["cats"].within
        places = [ctx.graph.graph.get_node(agent.current_node_id) for agent in ctx.agent.teams["cats"]]
        assert len({place.id for place in places}) == size
        assert all(dist((place.x, place.y), (flag.x, flag.y)) <= within for place in places)


def test_the_demo_needs_no_extra(tmp_path):
    code = (
        "import sys; extras = ['pyproj', 'osmium', 'osmnx', 'scipy', 'numba', 'pygame', 'av', 'PIL']\n"
        "sys.modules |= dict.fromkeys(extras)\n"
        "from gamms.cli import main; sys.argv = ['gamms', 'demo', '--max-turns', '3', '--out', 'out']; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Wrote out" in done.stdout, done.stderr
