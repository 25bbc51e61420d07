"""Mistakes of the first hour are answered by what the user wrote, and by what to write in its place."""

import pytest

import gamms
from gamms.errors import BadType, BadValue, UnknownName, UnknownType


def play(strategy, **options):
    """Play a turn of an agent on node 0 of a grid; return the agent's node, or raise what the game raises."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.game.on_illegal = "raise"
        agent = ctx.agent.create_agent("ann", start_node_id=0, strategy=strategy, **options)
        ctx.game.run(max_turns=1)
        return agent.current_node_id


@pytest.mark.parametrize("empty", [[], (), range(0)])
def test_a_draw_from_nothing_says_that_there_is_nothing_to_draw(empty):
    with pytest.raises(BadValue, match=r"choice was given an empty list.*there is nothing to draw"):
        play(lambda state: state["draw"].choice(empty))
    with pytest.raises(BadValue, match="needs 1 <= n"):
        play(lambda state: state["draw"].below(-1))


@pytest.mark.parametrize(
    "name", ["integers", "randint", "randrange", "uniform", "shuffle", "sample", "permutation", "normal"]
)
def test_a_draw_by_the_name_of_another_library_says_which_names_there_are(name):
    def draw(state):
        assert not hasattr(state["draw"], name)
        assert name not in dir(state["draw"])
        assert {"shuffle", "permutation", "normal"} <= {*dir(state["rng"])}
        getattr(state["draw"], name)(1)

    words = r"Write state\['draw'\]\.below\(n\) .*\.random\(\) .*\.choice\(items\); state\['rng'\]"
    with pytest.raises(AttributeError, match=rf"state\['draw'\] has no attribute '{name}'\. {words}"):
        play(draw)


def test_the_hint_for_an_unknown_draw_offers_the_draws_and_nothing_else():
    with pytest.raises(AttributeError) as caught:
        play(lambda state: state["draw"].lots())
    assert " There are: 'below', 'choice', 'random'." in caught.value.__notes__[0]


def test_an_agent_before_the_graph_is_told_to_attach_one():
    with gamms.create_context() as ctx:
        with pytest.raises(UnknownName, match=r"Unknown node 0.*Attach a graph first, such as ctx\.graph\.attach"):
            ctx.agent.create_agent("ann", start_node_id=0)
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        with pytest.raises(UnknownName, match=r"^(?!.*Attach)"):
            ctx.agent.create_agent("ann", start_node_id=9)


def test_an_agent_says_by_which_name_it_is_alive_unless_the_program_has_set_its_own():
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ann = ctx.agent.create_agent("ann", start_node_id=0)
        for name in ("is_active", "is_alive"):
            assert not hasattr(ann, name)
            assert name not in dir(ann)
            with pytest.raises(AttributeError, match=rf"has no attribute '{name}'. Write agent.alive."):
                getattr(ann, name)
        ann.is_active = [1]
        bob = ctx.agent.create_agent("bob", start_node_id=0, is_alive="of course")
        assert (ann.is_active, bob.is_alive) == ([1], "of course")
        assert "is_active" in dir(ann)


def test_a_range_that_is_no_number_is_refused_where_it_is_written():
    with pytest.raises(BadType, match=r"range_m of gamms\.sensor\.agent_range\(\) must be a number, not '60 m'"):
        gamms.sensor.agent_range(range_m="60 m")
    with pytest.raises(BadValue, match=r"range_m of .* must not be negative"):
        gamms.sensor.agent_arc(range_m=-1.0)
    with pytest.raises(BadType, match=r"fov of gamms\.sensor\.agent\(\)"):
        gamms.sensor.agent(fov="wide")


@pytest.mark.parametrize(
    ("kind", "offered"),
    [("agent-range", "agent_range"), ("AGENT-RANGE", "AGENT_RANGE"), ("Agent-Range", "AGENT_RANGE")],
)
def test_a_misspelt_sensor_is_offered_in_the_letters_of_the_file(kind, offered):
    with gamms.create_context() as ctx, pytest.raises(UnknownType, match=f"Did you mean '{offered}'"):
        ctx.sensor.create_sensor("eyes", kind)


def test_a_path_of_one_node_has_no_second_one():
    def follow(state):
        path = [state["curr_pos"]]
        state["action"] = path[1]

    with pytest.raises(IndexError) as caught:
        play(follow)
    assert "Its length is 1; a path to the node itself has one node" in caught.value.__notes__[0]
