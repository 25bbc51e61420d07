"""Attributes of agents that programs set while they are recorded."""

import io

import pytest

import gamms
from gamms.ir import events as kinds
from gamms.recorder import RecordingError
from gamms.recorder import open as opened
from gamms.recorder.replaying import Replayer
from gamms.strategies import stay


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1) as made:
        made.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        yield made


def recorded(ctx, rule, turns=3, file=None):
    """Play some turns with a rule, and return the recording."""
    file = io.BytesIO() if file is None else file
    ctx.game.add(rule)
    ctx.record.start(file, sensed=True)
    ctx.game.run(turns)
    ctx.record.stop()
    file.seek(0)
    return opened(file)


def energies(ctx):
    return {agent.name: getattr(agent, "energy", None) for agent in ctx.agent.create_iter()}


def test_an_attribute_that_is_deleted_is_gone_from_its_turn_on(ctx):
    ctx.agent.create_team("ant", [0, 4], strategy=stay, columns={"energy": [1, 2]})
    solo = ctx.agent.create_agent("solo", start_node_id=3, strategy=stay, energy=3, path=[1])

    def starve(ctx):
        if ctx.game.turn == 2:
            del ctx.agent.get_agent("ant_1").energy
            del solo.energy, solo.path
        elif ctx.game.turn == 3:
            solo.energy = 9

    file, again = io.BytesIO(), io.BytesIO()
    with recorded(ctx, starve, turns=4, file=file) as recording:
        for turn, expected in ((1, (1, 2, 3)), (2, (1, None, None)), (3, (1, None, 9)), (4, (1, None, 9))):
            with recording.resume(turn) as then:
                assert tuple(energies(then).values()) == expected
                assert hasattr(then.agent.get_agent("solo"), "path") == (turn < 2)
            attributes = recording.detached(turn).agents.columns["attributes"]
            assert tuple(one.get("energy") for one in attributes) == expected
    assert energies(ctx) == {"ant_0": 1, "ant_1": None, "solo": 9}
    with gamms.create_context() as other:
        file.seek(0)
        other.record.start(again)
        assert sum(1 for _ in other.record.replay(file)) > 0
        other.record.stop()
        assert tuple(energies(other).values()) == (1, None, 9)
    again.seek(0)
    with opened(again) as second:
        assert [one.get("energy") for one in second.detached(2).agents.columns["attributes"]] == [1, None, None]


def test_a_replay_sets_attributes_and_writes_them_again(ctx):
    ctx.agent.create_agent("a", start_node_id=0, strategy=stay)

    def note(ctx):
        ctx.agent.get_agent("a").seen = [ctx.game.turn, {"x": (1.5, None)}]

    file, again = io.BytesIO(), io.BytesIO()
    with recorded(ctx, note, file=file), gamms.create_context() as other:
        file.seek(0)
        other.record.start(again)
        assert sum(1 for _ in other.record.replay(file)) > 0
        other.record.stop()
        assert other.agent.get_agent("a").seen == [3, {"x": (1.5, None)}]
        again.seek(0)
        with opened(again) as second:
            assert second.detached(2).agents.columns["attributes"] == [{"seen": [2, {"x": (1.5, None)}]}]


def test_an_attribute_that_becomes_unwritable_leaves_the_recording(ctx, caplog):
    agent = ctx.agent.create_agent("a", start_node_id=0, strategy=stay, tool=1)

    def lend(ctx):
        agent.tool = object() if ctx.game.turn == 2 else ctx.game.turn

    with recorded(ctx, lend) as recording:
        found = [dict(recording.detached(turn).agents.columns["attributes"][0]) for turn in range(4)]
    assert found == [{"tool": 1}, {"tool": 1}, {}, {"tool": 3}]
    assert "Agent 'a' has 'tool' with something in it that is no plain value" in caplog.text


def test_attributes_that_a_rule_sets_one_by_one_are_one_event(ctx):
    agents = [ctx.agent.create_agent(f"a{i}", start_node_id=i, strategy=stay) for i in range(9)]

    def tire(ctx):
        for agent in agents:
            agent.energy = ctx.game.turn

    with recorded(ctx, tire) as recording:
        assert recording.counts()["AGENT_ATTRIBUTE"] == 3


def test_a_team_sees_the_attributes_of_its_own_agents_alone(ctx):
    for name, team in (("r", "red"), ("b", "blue")):
        ctx.agent.create_agent(name, start_node_id=0, team=team, strategy=stay, energy=0)

    def tire(ctx):
        for agent in ctx.game.agents:
            agent.energy = ctx.game.turn

    own = io.BytesIO()
    with recorded(ctx, tire) as recording:
        recording.cut(own, "red")
    own.seek(0)
    with opened(own) as seen:
        agents = seen.detached(3).agents.columns
        assert dict(zip(agents["names"], agents["attributes"], strict=True))["r"] == {"energy": 3}
        assert {"energy": 3} not in [
            one for name, one in zip(agents["names"], agents["attributes"], strict=True) if name != "r"
        ]


@pytest.mark.parametrize("name", ["_block", "get_state", "name"])
def test_a_recording_cannot_set_read_only_attributes(ctx, name):
    ctx.agent.create_agent("a", start_node_id=0)
    replayer = Replayer(ctx)
    replayer.state.agents.names = {0: "a"}
    with pytest.raises(RecordingError, match="is no attribute of agent 'a'"):
        replayer.apply(kinds.AGENT_ATTRIBUTE, {"numbers": [0], "name": name, "values": [5]})


class Heard:
    """A follower that keeps the values of attributes that it was told."""

    def __init__(self):
        self.values = []

    def begin(self, header, state):
        """Begin."""

    def hear(self, log, *, is_over):
        self.values += [data["values"] for kind, data in kinds.list_events(log) if kind == kinds.AGENT_ATTRIBUTE]


def test_followers_hear_of_attributes_set_after_they_began(ctx):
    agent, follower = ctx.agent.create_agent("a", start_node_id=0), Heard()
    ctx.record.start(io.BytesIO())
    agent.energy = 1
    ctx.record.follow(follower)
    agent.energy = 2
    ctx.visual.simulate()
    assert follower.values == [[2]]
