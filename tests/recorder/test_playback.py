"""Any turn of a recording that is replayed can be shown: what is there then is what a replay up to it gives."""

import io

import pytest
from games import recorded as recorded_of
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadValue
from gamms.recorder.keyframes import capture_state

TURNS = 9


def move(state):
    state["action"] = max(state["legal"]) if state["turn"] % 2 else min(state["legal"])


def recorded():
    """A game in which agents move, score, come and go, are drawn by the program, and facts and the map change."""
    stream = io.BytesIO()
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for name in ("anna", "bert"):
            ctx.agent.create_agent(name, start_node_id=0, team=name[0], strategy=move)
        ctx.visual.add_artist("dot", {"drawer": lambda ctx, data: ctx.visual.render_circle(ctx.game.turn, 0, 1)})
        ctx.game.publish(seen=[])

        @ctx.game.add
        def rule(ctx):
            turn = ctx.game.turn
            ctx.game.publish(seen=[*ctx.game.facts["seen"], turn])
            ctx.game.data.setdefault("turns", []).append(turn)
            if turn % 3 == 0:
                ctx.game.scores["a"] += 1
                ctx.game.emit("capture", agent="anna")
            if turn == 4:
                ctx.game.eliminate("bert")
            if turn == 5:
                ctx.agent.create_agent("cleo", start_node_id=5, team="c")
                ctx.graph.graph.remove_edge(0)
                ctx.agent.get_agent("anna").register_sensor("eye", ctx.sensor.create_sensor("eye", "RANGE"))
            if turn == 7:
                ctx.agent.delete_agent("bert")
                ctx.visual.set_agent_visual("anna", color="red")
                ctx.sensor.delete_sensor("eye")
            if turn == TURNS:
                ctx.game.end("enough", winner="a")

        ctx.record.start(stream)
        ctx.game.run(max_turns=20)
    return stream.getvalue()


GAME = recorded()


def facts_of(ctx):
    """All that is there now, as text, in which what is not a number equals itself."""
    plain = {key: getattr(value, "tolist", lambda value=value: value)() for key, value in capture_state(ctx).items()}
    drawn = {name: commands.points.tolist() for name, commands in ctx.visual.artists.drawings.commands.items()}
    game = ctx.game
    return repr((plain, game.turn, game.events, dict(game.facts), len(ctx.graph.columns().edge_ids), drawn))


class Player:
    """A replay into a context whose visual engine takes the playback, as a window does."""

    def __init__(self, ctx, start=0):
        self.ctx, self.taken = ctx, []
        ctx.visual.show_playback = self.taken.append
        self.records = ctx.record.replay(io.BytesIO(GAME), start=start)

    def play(self):
        """Replay one turn."""
        for record in self.records:
            if record["opCode"] == gamms.typing.OpCodes.SIMULATE.value:
                return

    @property
    def playback(self):
        return self.taken[-1]


@pytest.fixture(scope="module")
def truth():
    """What a replay from the beginning to the end shows after each turn."""
    with gamms.create_context() as ctx:
        player = Player(ctx)
        found = {}
        for turn in range(1, TURNS + 1):
            player.play()
            found[turn] = facts_of(ctx)
        return found


@given(st.lists(st.integers(1, TURNS), max_size=6))
def test_a_turn_is_the_same_however_one_gets_there(truth, turns):
    with gamms.create_context() as ctx:
        player = Player(ctx)
        player.play()
        for turn in turns:
            player.playback.seek(turn)
            assert facts_of(ctx) == truth[turn]
            if turn < TURNS:
                player.play()
                assert (player.playback.turn, facts_of(ctx)) == (turn + 1, truth[turn + 1])


def test_a_replay_that_has_ended_can_be_played_again_from_any_turn(truth):
    with gamms.create_context() as ctx:
        player = Player(ctx)
        assert list(player.records)
        player.playback.seek(2)
        player.playback.play_turn()
        assert (player.playback.turn, facts_of(ctx)) == (3, truth[3])
        assert not ctx.record.is_replaying


def test_a_turn_that_is_not_there_is_refused():
    with gamms.create_context() as ctx:
        player = Player(ctx)
        player.play()
        with pytest.raises(BadValue, match="has 9 turns"):
            player.playback.seek(10)
    with gamms.create_context() as ctx, pytest.raises(BadValue, match="has 9 turns"):
        Player(ctx, 10).play()


def test_agents_of_a_game_that_is_replayed_join_those_of_a_game_that_is_recorded():
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.agent.create_agent("dora", start_node_id=0)
        data = recorded_of(lambda ctx: list(ctx.record.replay(io.BytesIO(GAME))), ctx)
    with gamms.recorder.open(io.BytesIO(data)) as recording:
        assert [state.agents["name"].tolist() for state in recording[:2]] == [["dora"], ["dora", "anna", "bert"]]


def test_an_open_recording_is_replayed_and_stays_open(tmp_path):
    path = tmp_path / "game.ggr"
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_team("red", [0], strategy=gamms.strategies.random_walk)
        ctx.game.run(4, record=path)
    with gamms.recorder.open(path) as recording:
        places = []
        for start in (0, 2):
            with gamms.create_context() as ctx:
                for _ in ctx.record.replay(recording, start=start):
                    pass
                places.append(ctx.agent.get_agent("red_0").current_node_id)
        assert places == [recording[-1].agents["node"][0]] * 2
