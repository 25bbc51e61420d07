"""People who play in a served game, over real WebSockets: who may choose what, and what they are sent."""

import pytest
from test_live import Client

import gamms
from gamms import recorder, scenario, web

DUEL = scenario.Scenario(
    name="duel",
    seed=3,
    map={"grid": {"width": 6, "height": 1}},
    sensors={"eyes": {"type": "AGENT_RANGE", "sensor_range": 15}},
    teams={
        "red": {"agents": [{"name": "rita", "node": 0}], "sensors": ["eyes"], "strategy": "human"},
        "blue": {"agents": [{"name": "bob", "node": 5}], "sensors": ["eyes"], "strategy": "human"},
    },
    max_turns=3,
)


class Player(Client):
    """A client who plays."""

    def question(self, turn):
        """Wait for the question of a turn and return it."""

        def asked(client):
            return any(self._of(one, turn) for one in client.told)

        self.read(asked)
        return next(found for one in self.told if (found := self._of(one, turn)))

    @staticmethod
    def _of(message, turn):
        if message["type"] != "questions":
            return None
        return next((one for one in message["questions"] if one["turn"] == turn and not one["is_chosen"]), None)

    def refused(self, **message):
        """Say something that is refused; return why."""
        count = sum(one["type"] == "refused" for one in self.told)
        self.say(type="choose", **message)
        self.read(lambda client: sum(one["type"] == "refused" for one in client.told) > count)
        return [one["words"] for one in self.told if one["type"] == "refused"][-1]

    def go(self, turn, node):
        """Choose a node in a turn."""
        self.say(type="choose", question=self.question(turn)["question"], move=node)


@pytest.fixture
def join():
    """What joins by a link; players leave at the end."""
    players = []

    def joined(link):
        players.append(Player(link))
        return players[-1]

    yield joined
    for player in players:
        player.socket.close()


def everything_in(player):
    """Return all that a player was sent, as text."""
    return player.game().said() + repr(player.told)


def test_two_people_play_one_leaves_and_returns_and_the_recording_has_it(join, tmp_path):
    path = tmp_path / "game.ggr"
    with web.serve(DUEL, speed=None, record=path) as live:
        assert list(live.players) == ["rita", "bob"]
        red, blue = join(live.players["rita"]), join(live.players["bob"])
        red.go(0, 1)
        blue.go(0, 4)
        red.question(1)
        red.socket.close()
        blue.go(1, 3)
        red = join(live.players["rita"])
        red.go(1, 2)
        red.go(2, 2)
        blue.go(2, 3)
        result = live.wait(60)
    assert [result.agents[name]["node"] for name in ("rita", "bob")] == [2, 3]
    with recorder.open(path) as recording:
        assert [state.agents["node"].tolist() for state in recording] == [[0, 5], [1, 4], [2, 3], [2, 3]]
        assert [event["person"] for event in recording.events() if event["kind"] == "choice"] == ["bob", "rita"] * 3
    again = tmp_path / "again.ggr"
    DUEL.play(strategies={name: web.human(choices=path) for name in ("red", "blue")}, record=again)
    with recorder.open(again) as recording:
        assert recording[3].agents["node"].tolist() == [2, 3]


def test_two_on_one_link_are_told_of_each_other(join):
    with web.serve(DUEL, speed=None) as live:
        first = join(live.players["rita"])
        other = join(live.players["bob"])

        def pages(client):
            return [one["pages"] for one in client.told if one["type"] == "questions"][-1:]

        first.read(lambda client: pages(client) == [1])
        second = join(live.players["rita"])
        for client in (first, second):
            client.read(lambda client: pages(client) == [2])
        first.go(0, 1)
        assert "the first choice counts" in second.refused(question=second.question(0)["question"], move=0)
        second.socket.close()
        first.read(lambda client: pages(client) == [1])
        other.go(0, 4)
        other.question(1)
        assert pages(other) == [1]


def test_a_hostile_player_can_neither_choose_for_another_nor_twice_nor_late(join):
    with web.serve(DUEL, speed=None) as live:
        red, blue = join(live.players["rita"]), join(live.players["bob"])
        mine, other = red.question(0)["question"], blue.question(0)["question"]
        assert "another player" in red.refused(question=other, move=4)
        assert "may not go to 5" in red.refused(question=mine, move=5)
        red.say(type="choose", question=mine, move=1)
        assert "answered already" in red.refused(question=mine, move=0)
        spectator = join(live.links["red"])
        assert "only allows watching" in spectator.refused(question=other, move=4)
        blue.say(type="choose", question=other, move=4)
        red.question(1)
        assert "not open" in red.refused(question=mine, move=0)
        assert live.ctx.agent.get_agent("rita").current_node_id == 1
        assert live.ctx.agent.get_agent("bob").current_node_id == 4


def test_a_player_is_sent_nothing_of_those_who_are_out_of_sight_and_nothing_of_what_they_chose(join):
    with web.serve(DUEL, speed=None) as live:
        red, blue = join(live.players["rita"]), join(live.players["bob"])
        blue.go(0, 4)
        red.question(0)
        red.go(0, 0)
        red.read_turns(1)
        assert "bob" not in everything_in(red)
        blue.go(1, 3)
        red.go(1, 1)  # and now they are 20 apart, which is still too far
        blue.go(2, 2)
        red.go(2, 1)
        live.wait(60)
        assert list(red.read_turns(3).captions()) == []
        assert "bob" not in everything_in(red)


def test_the_end_of_a_served_game_does_not_wait_for_people(join):
    with web.serve(DUEL, speed=None) as live:
        join(live.players["rita"]).question(0)
    assert live.wait(1) is None
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=web.human(seconds=0.05, joins_within=0.05))
        with web.serve(ctx, speed=None) as live:
            assert list(live.players) == ["anna"]
            assert ctx.game.run(1).events[0]["outcome"] == "not there"
