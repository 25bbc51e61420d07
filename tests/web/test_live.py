"""A game that is served while it is played: what is sent to whom, and who may do what."""

import io
import json

import pytest

from gamms import recorder, scenario, web
from gamms.web.pages import drawn_log

HUNT = scenario.Scenario(
    name="hunt",
    seed=3,
    map={"grid": {"width": 7, "height": 7}},
    sensors={"eyes": {"type": "AGENT_RANGE", "sensor_range": 25}},
    teams={
        "red": {"count": 2, "near": 0, "within": 20, "sensors": ["eyes"], "strategy": "gamms.strategies:random_walk"},
        "blue": {"count": 2, "near": 48, "within": 20, "sensors": ["eyes"], "strategy": "gamms.strategies:random_walk"},
    },
    rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
    max_turns=40,
)


class Client:
    """A client that has joined by a link: `bytes` is the recording that it was sent, `told` its messages."""

    def __init__(self, link):
        from websockets.sync.client import connect

        address, _, token = link.partition("#")
        url = address.replace("http", "ws") + "live"
        self.socket = connect(url, proxy=None, max_size=None, legacy=True, close_timeout=1)
        self.bytes, self.told = b"", []
        self.say(token=token)

    def say(self, **message):
        self.socket.send(json.dumps(message))

    def read(self, until, seconds=10.0):
        """Read messages until a condition holds."""
        while not until(self):
            found = self.socket.recv(timeout=seconds)
            if isinstance(found, str):
                self.told.append(json.loads(found))
            else:
                self.bytes = found if found.startswith(b"MMGR") else self.bytes + found

    def read_turns(self, turns):
        """Read until so many turns are there; return the recording."""
        self.read(lambda client: client.bytes[8:] and self.recording().turns >= turns)
        return self.recording()

    def recording(self):
        return recorder.open(io.BytesIO(self.bytes))


@pytest.fixture
def join():
    """What joins by a link; clients leave at the end."""
    clients = []

    def joined(link):
        clients.append(Client(link))
        return clients[-1]

    yield joined
    for client in clients:
        client.socket.close()


def test_each_team_is_sent_what_a_cut_of_the_recording_holds(join, tmp_path):
    with web.serve(HUNT, speed=None, is_paused=True, record=tmp_path / "game.ggr") as live:
        clients = {name: join(live.links[name]) for name in ("everything", "red", "blue")}
        for client in clients.values():
            client.read(lambda client: client.bytes)
        live.pace.set(is_paused=False)
        assert live.wait(10).turns == 40
        sent = {name: client.read_turns(40) for name, client in clients.items()}
    with recorder.open(tmp_path / "game.ggr") as whole:
        assert repr(list(sent["everything"].logs())) == repr([drawn_log(log) for log in whole.logs()])
        for team in ("red", "blue"):
            stream = io.BytesIO()
            whole.cut(stream, team)
            with recorder.open(io.BytesIO(stream.getvalue())) as cut:
                known = [state.agents for state in cut]
                assert [state.agents["name"].tolist() for state in sent[team]] == [
                    one["name"].tolist() for one in known
                ]
                assert [state.agents["node"].tolist() for state in sent[team]] == [
                    one["node"].tolist() for one in known
                ]
            assert sent[team].header["audience"] == team
            assert "seed" not in sent[team].header
    assert {len(state.agents["name"]) for state in sent["red"]} > {2}


def test_only_the_admin_link_steps_and_pauses(join):
    with web.serve(HUNT, is_paused=True) as live:
        admin, spectator = join(live.links["admin"]), join(live.url)
        for message in ({"type": "step"}, {"type": "pause", "paused": False}, {"type": "restart"}):
            spectator.say(**message)
            spectator.read(lambda client: client.told and client.told[-1]["type"] == "refused")
            spectator.told.clear()
        assert live.streams.turns == 0
        admin.say(type="step")
        assert spectator.read_turns(1).turns == 1
        assert live.streams.turns == 1
