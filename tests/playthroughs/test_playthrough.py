"""What a playthrough shows, and what it leaves as it was."""

import re
from zlib import crc32

import pytest
from typer.testing import CliRunner

import gamms
from gamms import cli
from gamms.errors import UnknownName
from gamms.testing import playthrough


@pytest.fixture
def ctx():
    """Ann at one end of a line of five nodes, and Bob two nodes further; both go to node 1."""
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 1))
        eyes = {"eyes": gamms.sensor.agent_range(range_m=20)}

        def go(state):
            state["action"] = 1

        ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=go, sensors=eyes)
        ctx.agent.create_agent("bob", start_node_id=2, team="blue", strategy=go)
        yield ctx


def lines_of(ctx, turns=1, agents=None):
    return [line.strip() for line in playthrough(ctx, turns, agents).splitlines()]


def test_a_text_has_places_knowledge_actions_and_what_rules_say(ctx):
    ctx.game.add(gamms.rules.tag("red", "blue", then="eliminate", score=1.0))
    ctx.game.add(gamms.rules.last_team())
    assert playthrough(ctx, 3) == (
        "seed 3, 5 nodes, 8 edges, after turn 0\n"
        "rules: tag, last_team\n"
        'team "blue": bob at 2\n'
        'team "red": ann at 0\n'
        "\n"
        "Turn 1\n"
        "  ann at 0, may go to [0, 1]\n"
        '    sensor eyes: {"bob": 2}\n'
        "    wants 1, moves 0 1\n"
        "  bob at 2, may go to [2, 1, 3]\n"
        "    wants 1, moves 2 1\n"
        '  event {"kind": "tag", "agent": "ann", "other": "bob", "node": 1}\n'
        '  event {"kind": "eliminated", "agent": "bob", "node": 1}\n'
        "  score red: 1\n"
        '  end: reason "last team", winner "red", truncated false\n'
        "\n"
        'team "red": ann at 1\n'
    )


def test_a_fact_for_one_agent_is_in_its_knowledge_only(ctx):
    ctx.game.publish(flag=4)
    ctx.game.publish(to="bob", code=[1, 2])
    lines = lines_of(ctx)
    assert lines.count("fact flag: 4") == 1
    assert lines.count("knows code: [1, 2]") == 1
    assert lines.index("knows code: [1, 2]") > lines.index("bob at 2, may go to [2, 1, 3]")


def test_a_fact_without_a_value_is_known_to_its_agent(ctx):
    ctx.game.publish(to="bob", code=None)
    assert "knows code: null" in lines_of(ctx)


def test_a_score_that_is_zero_again_is_a_change(ctx):
    ctx.game.scores["red"] = 2

    def forfeit(ctx):
        ctx.game.scores["red"] = 0

    ctx.game.add(forfeit)
    lines = lines_of(ctx)
    assert lines[4] == "score red: 2"
    assert "score red: 0" in lines


def test_the_reason_why_an_agent_was_blocked_is_in_its_next_turn(ctx):
    ctx.agent.get_agent("bob").register_strategy(lambda state: state.update(action=4))
    lines = lines_of(ctx, 2, ["bob"])
    assert lines[lines.index("Turn 1") + 2] == "wants 4, stays"
    assert lines[lines.index("Turn 2") + 2].startswith("was blocked: ")


def test_a_change_in_the_part_that_is_cut_changes_the_text(ctx):
    long = [*range(100, 200)]
    ctx.game.publish(long=long)
    whole = str(long)
    found = re.search(r"^fact long: (.*)… \((\d+) characters, CRC-32 (\w+)\)$", playthrough(ctx, 0), re.MULTILINE)
    assert whole.startswith(found[1])
    assert (int(found[2]), found[3]) == (len(whole), f"{crc32(whole.encode()):08x}")


def test_only_the_chosen_agents_are_shown_with_all_events(ctx):
    ctx.game.add(gamms.rules.tag("red", "blue"))
    text = playthrough(ctx, 1, ["bob"])
    assert "ann at" not in text
    assert "bob at 2" in text
    assert '"agent": "ann", "other": "bob"' in text
    with pytest.raises(UnknownName, match="bop"):
        playthrough(ctx, 1, ["bop"])


def test_a_game_goes_on_as_it_would_without_its_text(ctx):
    ctx.game.add(gamms.rules.tag("red", "blue", then="respawn"))
    played = ctx.game.fork(1)
    told = ctx.game.fork(1)
    playthrough(told.ctx, 2)
    told.step()
    played.run(3)
    assert told.result().events == played.result().events
    assert told.scores == played.scores
    assert told.internals.after_observing == [] == told.ctx.visual.after_turn


def test_the_command_prints_the_text_of_the_file():
    file = gamms.scenario.gallery()["grid_tag"]
    run = CliRunner().invoke(
        cli.app, ["scenario", "playthrough", str(file), "--turns", "2", "--agent", "red_0", "--seed", "7"]
    )
    with gamms.scenario.from_gallery("grid_tag").build(7) as ctx:
        assert run.output == playthrough(ctx, 2, ["red_0"])
