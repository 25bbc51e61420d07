"""Other programs learn where agents are, and change the roads before a turn."""

import json
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.bridge import Process, Udp, positions, publish, traffic
from gamms.bridge.lines import RoadChanges
from gamms.bridge.rules import change_roads
from gamms.errors import BadType, UnknownName


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4, spacing=10.0))
        for node, name in enumerate(("bert", "anna")):
            agent = ctx.agent.create_agent(name, start_node_id=node, team=name[0])
            agent.strategy = lambda state: state.update(action=max(state["legal"]))
        yield ctx


# -- positions ------------------------------------------------------------------------------------------------------


def test_positions_are_published_after_each_turn_in_the_order_of_the_names(ctx):
    heard = []
    ctx.game.add(publish(heard.append))
    ctx.game.run(2)
    first = {"gamms": 1, "type": "position", "turn": 1, "agent": "anna", "team": "a", "node": 2, "x": 20.0, "y": 0.0}
    assert heard[0] == first
    assert [(one["type"], one["turn"], one.get("agent")) for one in heard] == [
        ("position", 1, "anna"),
        ("position", 1, "bert"),
        ("turn", 1, None),
        ("position", 2, "anna"),
        ("position", 2, "bert"),
        ("turn", 2, None),
    ]
    assert heard[2] == {"gamms": 1, "type": "turn", "turn": 1, "agents": 2, "crs": None, "over": None}


def test_only_the_agents_that_were_named_are_published(ctx):
    heard = []
    ctx.game.add(publish(heard.append, agents=["bert"]))
    ctx.game.step()
    assert [one.get("agent") for one in heard] == ["bert", None]


def test_the_last_turn_says_how_the_game_has_ended(ctx):
    heard = []
    ctx.game.add(publish(heard.append, agents=["anna"]))
    ctx.game.add(gamms.rules.reach("a", 3))
    ctx.game.run(9)
    assert [one["type"] for one in heard] == ["position", "turn"] * 2
    assert heard[-1]["over"]["winner"] == "a"


def test_on_a_map_with_a_crs_positions_are_degrees_too():
    with gamms.create_context(seed=1) as ctx:
        gamms.osm.helsinki(ctx)
        node = ctx.graph.find("Mannerheimintie & Kaivokatu").node
        ctx.agent.create_agent("anna", start_node_id=node)
        options = {"type": "AERIAL", "position": (385_800.0, 6_672_200.0, 50.0), "speed": 1.0}
        ctx.agent.create_agent("kite", start_node_id=node, **options)
        anna, kite = positions(ctx)
        assert (anna["lat"], anna["lon"]) == pytest.approx((60.1698, 24.9384), abs=1e-4)
        assert (kite["x"], kite["y"], kite["z"]) == options["position"]
        assert ctx.graph.graph.from_latlon(lat=kite["lat"], lon=kite["lon"]) == pytest.approx(
            (kite["x"], kite["y"]), abs=0.01
        )


def test_messages_are_lines_that_any_program_reads(ctx):
    ctx.agent.create_agent("carl", start_node_id=0, team=("a", "tuple"))
    with Udp(listen=("127.0.0.1", 0)) as listener, Udp(to=listener.address) as link:
        ctx.game.add(publish(link))
        ctx.game.step()
        lines = [json.loads(listener._socket.recv(9_999)) for _ in range(4)]
        assert [one.get("team") for one in lines] == ["a", "b", "('a', 'tuple')", None]


def test_whom_and_where_to_publish_is_checked(ctx):
    with pytest.raises(BadType, match="a link or to a function"):
        publish("ws://localhost:1")
    with pytest.raises(UnknownName, match="anna"):
        ctx.game.add(publish(print, agents=["ana"]))
    with pytest.raises(BadType, match="names of agents"):
        publish(print, agents="anna")


# -- roads ----------------------------------------------------------------------------------------------------------


def program(*answers):
    """Start a program that answers the k-th line that it gets with the k-th of these."""
    lines = [json.dumps(one) for one in answers]
    code = f"import sys\nfor line, _ in zip({lines!r}, sys.stdin): print(line, flush=True)"
    return Process([sys.executable, "-c", code])


def edge_between(ctx, source, target):
    columns = ctx.graph.columns()
    rows = (columns.node_ids[columns.sources] == source) & (columns.node_ids[columns.targets] == target)
    return int(columns.edge_ids[rows][0])


def test_another_process_closes_opens_and_slows_roads(ctx):
    edge = edge_between(ctx, 2, 3)
    closed = {"type": "roads", "turn": 0, "close": [edge]}
    slow = {"type": "roads", "turn": 1, "open": [edge], "travel_time": {edge: 99.5}}
    anna = ctx.agent.get_agent("anna")
    with program(closed, slow) as link:
        ctx.game.add(traffic(link, wait_s=60.0), phase="before")
        ctx.game.step()
        assert (anna.current_node_id, ctx.graph.closed_roads) == (2, [edge])
        ctx.game.step()
        assert (anna.current_node_id, ctx.graph.closed_roads) == (3, [])
        assert ctx.graph.edge_attributes(edge)["travel_time"] == 99.5
        assert ctx.game.events == []


def test_a_slowed_road_takes_agents_of_all_modes_the_same_time(ctx):
    edge, other = edge_between(ctx, 2, 3), edge_between(ctx, 1, 2)
    times = {"travel_time:walk": 20.0, "travel_time:drive": 4.0}
    for one in (edge, other):
        ctx.graph.update_edge({"id": one, "walk": 5.0, "drive": 30.0, **times})
    with program({"type": "roads", "turn": 0, "travel_time": {edge: 60}}) as link:
        ctx.game.add(traffic(link, wait_s=60.0), phase="before")
        ctx.game.step()
    walked, driven = (ctx.graph.routes.select_mode(mode).weights("travel_time") for mode in ("walk", "drive"))
    assert (sorted(walked.tolist()), sorted(driven.tolist())) == ([20.0, 60.0], [4.0, 60.0])


def test_a_game_goes_on_where_no_answer_comes(ctx):
    with program() as link:
        ctx.game.add(traffic(link, wait_s=0.02), phase="before")
        ctx.game.step()
        assert ctx.game.events == [{"turn": 0, "kind": "traffic_late", "waited_s": 0.02}]
        assert ctx.agent.get_agent("anna").current_node_id == 2


def test_a_recorded_game_with_traffic_replays_without_the_other_process(ctx, tmp_path):
    edge = edge_between(ctx, 2, 3)
    with program({"type": "roads", "turn": 0, "close": [edge], "travel_time": {edge_between(ctx, 0, 1): 7}}) as link:
        ctx.game.add(traffic(link, wait_s=60.0), phase="before")
        ctx.record.start(tmp_path / "game")
        ctx.game.step()
        ctx.record.stop()
    with gamms.create_context() as again:
        for _ in again.record.replay(tmp_path / "game.ggr"):
            pass
        assert again.graph.closed_roads == [edge]
        assert again.graph.edge_attributes(edge_between(again, 0, 1))["travel_time"] == 7


ids = st.one_of(st.integers(-3, 9), st.sampled_from([1 << 70, -(1 << 70), (1 << 63) - 1]))


@settings(max_examples=12)
@given(
    st.lists(
        st.builds(
            RoadChanges,
            turn=st.just(0),
            close=st.lists(ids, max_size=9),
            open=st.lists(ids, max_size=9),
            travel_time=st.dictionaries(ids, st.floats(1e-300, 1e300), max_size=5),
        ),
        max_size=4,
    )
)
def test_no_message_about_roads_breaks_a_game(messages):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4, spacing=10.0))
        ctx.agent.create_agent("anna", start_node_id=1, strategy=lambda state: state.update(action=max(state["legal"])))
        edges = len(ctx.graph.columns().edge_ids)
        for message in messages:
            assert change_roads(ctx, message) >= 0
            ctx.game.step()
        assert len(ctx.graph.columns().edge_ids) + len(ctx.graph.closed_roads) == edges


def test_edges_that_are_not_there_are_counted_each_once(ctx):
    edge, other = edge_between(ctx, 2, 3), edge_between(ctx, 0, 1)
    wanted = {"close": [edge, 901, 901], "open": [902, other], "travel_time": {edge: 5.0, 903: 1.0}}
    assert change_roads(ctx, RoadChanges(turn=0, **wanted)) == 4  # the other one is not closed
    assert ctx.graph.closed_roads == [edge]


def test_traffic_needs_a_link():
    with pytest.raises(BadType, match="traffic needs a link"):
        traffic(print)
