"""A game that is served while it is played: what is sent to whom, and who may do what."""

import io
import json
import random
import re
import socket
import subprocess
import sys
import threading
import time
import zlib
from contextlib import suppress

import browser
import httpx
import pytest
from shown_game import ShownGame

import gamms
from gamms import recorder, scenario, strategies, web
from gamms.errors import BadType, BadValue, MissingExtra, NetworkError
from gamms.ir.packing import to_bytes
from gamms.knowledge.sides import list_sides
from gamms.recorder.errors import Damaged
from gamms.typing import OpCodes
from gamms.web import columns, server, streams
from gamms.web.live import list_numbers
from gamms.web.painter import Painter

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


def connect(url, **options):
    """Connect without pings, which would draw from the global `random`, also in the tests after this one."""
    from websockets.sync import client

    return client.connect(url, proxy=None, ping_interval=None, **options)


def hang_up(connection):
    """End a connection without a word, and its thread that reads."""
    with suppress(OSError):  # the other side was first
        connection.socket.shutdown(socket.SHUT_RDWR)


class Client:
    """A client that has joined by a link: `bytes` is the game that it was sent, `told` its messages."""

    def __init__(self, link):
        address, _, token = link.partition("#")
        url = address.replace("http", "ws") + "live"
        self.socket = connect(url, max_size=None, legacy=True, close_timeout=1)
        self.bytes, self.told = b"", []
        self.say(token=token)

    def say(self, **message):
        self.socket.send(json.dumps(message))

    def read(self, until, seconds=60.0):
        """Read messages until a condition holds."""
        while not until(self):
            found = self.socket.recv(timeout=seconds)
            if isinstance(found, str):
                self.told.append(json.loads(found))
            else:
                found = zlib.decompress(found)
                self.bytes = found if found.startswith(columns.MAGIC) else self.bytes + found

    def read_turns(self, turns):
        """Read until so many turns are there; return the game."""
        self.read(lambda client: client.bytes[8:] and self.game().turns >= turns)
        return self.game()

    def game(self):
        return ShownGame(self.bytes)

    def parts(self):
        """The first turn of each part that it was sent, and whether that is whole."""
        return [(part["first"], part["is_whole"]) for part in self.game().sent]


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


def test_each_team_receives_the_contents_of_a_cut_of_the_recording(join, tmp_path):
    with web.serve(HUNT, speed=None, is_paused=True, record=tmp_path / "game.ggr") as live:
        clients = {name: join(live.links[name]) for name in ("everything", "red", "blue")}
        for client in clients.values():
            client.read(lambda client: client.bytes)
        live.pace.pause(is_paused=False)
        assert live.wait(60).turns == 40
        sent = {name: client.read_turns(40) for name, client in clients.items()}
    with recorder.open(tmp_path / "game.ggr") as whole:
        state = whole.detached(0).make_keyframe(0)
        header = {**whole.header, "world": whole.graph.packed, "sides": list_sides(whole.header, state)}
        with Painter(header, state) as painter:
            painter.begin()
            for log in whole.logs():
                painter.add(log)
            expected = ShownGame(
                columns.MAGIC + columns.frame({"world": columns.frame([0])[4:]}) + painter.encode_part()
            )
        assert list(sent["everything"].captions()) == list(expected.captions())
        for team in ("everything", "red", "blue"):
            stream = io.BytesIO()
            if team == "everything":
                stream.write(whole.content())
            else:
                whole.cut(stream, team)
            with recorder.open(io.BytesIO(stream.getvalue())) as cut:
                known = [state.agents for state in cut]
            assert [places(one.agents) for one in sent[team]] == [places(one) for one in known]
            assert sent[team].header.get("audience", "everything") == team
            assert ("seed" in sent[team].header) == (team == "everything")
    assert {len(state.agents["name"]) for state in sent["red"]} > {2}


def places(agents):
    return dict(zip(agents["name"].tolist(), agents["node"].tolist(), strict=True))


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


def test_all_are_told_how_many_others_watch_as_they_come_and_go_at_most_once_a_second(join):
    with web.serve(HUNT, is_paused=True) as live:
        links = [live.links[name] for name in ("everything", "admin", "red")]
        begun = time.monotonic()
        clients = [join(link) for link in (*links, *[live.url] * 5)]

        def watching(client):
            return [one["watching"] for one in client.told if one["type"] == "status"]

        for client in clients:
            client.read(lambda client: watching(client)[-1:] == [7])
        clients.pop().socket.close()
        for client in clients:
            client.read(lambda client: watching(client)[-1:] == [6])
        seconds = time.monotonic() - begun
        assert max(len(watching(client)) for client in clients) <= 2 + seconds  # one of them when it joined


def test_who_comes_late_receives_all_that_those_received_who_came_early(join):
    short = HUNT.replace(max_turns=15)
    audiences = [web.links.Audience(), web.links.Audience("red"), web.links.Audience(agents=frozenset({"blue_1"}))]
    with web.serve(short, speed=None, is_paused=True) as live:
        links = [live.link(web.links.LinkPermissions(f"link {one}", one)) for one in audiences]
        early = [join(link) for link in links]
        for client in early:
            client.read(lambda client: client.bytes)
        live.pace.pause(is_paused=False)
        known = [contents(client.read_turns(15)) for client in early]
        early[1].socket.close()
        for link, one in zip(links, known, strict=True):
            again = join(link)
            assert contents(again.read_turns(15)) == one
        live.link(web.links.LinkPermissions("blue", web.links.Audience("blue")))
        late = join(live.links["blue"])  # the first of its audience
        assert contents(late.read_turns(15))[0][-1][0] == places(list(late.game())[-1].agents)
        assert [state.agents["name"].tolist()[:2] for state in late.game()] == [["blue_0", "blue_1"]] * 16
        last = late.game()
    with short.build() as ctx:
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        following.get_stream(web.links.Audience("blue"))
        for _ in range(15):
            ctx.game.step()
            following.get_stream(web.links.Audience("blue"))
        following.end()
        assert contents(sent_by(following.get_stream(web.links.Audience("blue")))) == contents(last)


def contents(game):
    """What a page shows of a game: agents and slots after each turn, and captions; no turn twice, and none missing."""
    following = [(part["first"], part["is_whole"]) for part in game.sent]
    ends = [part["first"] + part["turns"] for part in game.sent]
    for (first, is_whole), end in zip(following[1:], ends, strict=False):
        assert first == end - is_whole
    assert following[0][1], "it begins with a part that is whole"
    return [(places(state.agents), pack_values(state.slots)) for state in game], list(game.captions())


def pack_values(slots):
    return {slot: to_bytes(value, slot) for slot, value in slots.items()}


def test_who_comes_late_to_a_long_game_receives_its_last_turns(monkeypatch):
    monkeypatch.setattr(streams, "_MOST_BYTES", 10_000)
    monkeypatch.setattr(streams, "_MOST_PARTS", 32)
    red = web.links.Audience("red")
    with HUNT.build() as ctx:
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        for turn in range(70):
            if turn == 5:
                ctx.graph.graph.remove_edge(0)
            if turn == 50:
                early = following.get_stream(red)
            ctx.game.step()
        following.end()
        nodes = [agent.current_node_id for agent in ctx.agent.create_iter()]
        sent = {}
        for audience in (red, web.links.Audience()):
            sent[audience] = sent_by(get_whole_stream(following, audience))
            states, _ = contents(sent[audience])
            assert 20 < len(states) < 50
            assert all("world" in slots for _, slots in states[1:]), "the map has changed before"
        assert following.get_stream(red) is early
    assert list(sent[web.links.Audience()])[-1].agents["node"].tolist() == nodes


@pytest.mark.parametrize(("turns", "most_bytes", "first"), [(200, 1 << 20, 192), (1, 1000, 199)])
def test_a_spectator_who_is_behind_begins_again_at_a_keyframe(monkeypatch, turns, most_bytes, first):
    monkeypatch.setattr(streams, "_KEYFRAME_BYTES", most_bytes)  # summed over the times that turns are encoded
    monkeypatch.setattr(streams, "_MOST_BYTES", 4000)
    with HUNT.build() as ctx:
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        stream = following.get_stream(web.links.Audience())
        messages, place, dropped = stream.read(stream.last_keyframe)
        assert (sent(stream, messages).sent[0]["is_whole"], place.turns, dropped) == (True, 0, 0)
        for _ in range(200 // turns):
            ctx.game.run(max_turns=turns)
            assert get_whole_stream(following, web.links.Audience()) is stream
        messages, place, dropped = stream.read(place)
        again = sent(stream, messages).sent[0]
        assert (again["is_whole"], again["first"]) == (True, first)
        assert (dropped, place.turns) == (first, 200)
        assert sum(len(message) for messages, _ in stream._parts for message in messages) < 8000


def get_whole_stream(following, audience):
    """The stream of an audience, with all turns that are played."""
    for _ in range(following.count_pieces(audience)):
        stream = following.get_stream(audience)
    return stream


def sent(stream, messages):
    """What a stream has given out in messages, as a game."""
    return ShownGame(b"".join(map(zlib.decompress, [*stream.opening, *messages])))


def sent_by(stream):
    """All that a stream has given out, as a game."""
    return sent(stream, [message for messages, _ in stream._parts for message in messages])


def test_a_player_of_two_agents_sees_what_both_see_though_they_look_one_after_the_other():
    quiet = {"level": "CRITICAL"}
    with gamms.create_context(game={"order": [["red"], ["blue"]]}, logger_config=quiet) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=12.0)
        for name, node, team in (("red_0", 0, "red"), ("red_1", 1, "red"), ("blue_0", 15, "blue")):
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=["eyes"], strategy=lambda state: None)
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        stream = following.get_stream(web.links.Audience(agents=frozenset({"red_0", "blue_0"})))
        ctx.game.run(max_turns=3)
        following.end()
        names = [state.agents["name"].tolist() for state in sent_by(stream)]
    assert names == [["red_0", "blue_0", "red_1"]] * 4


def test_a_team_sees_who_came_in_sight_between_the_end_of_a_game_and_the_turn_with_which_it_goes_on():
    with HUNT.build() as ctx:
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        stream = following.get_stream(web.links.Audience("red"))
        ctx.game.run(max_turns=1)
        following.end()
        ctx.agent.get_agent("blue_0").current_node_id = ctx.agent.get_agent("red_0").current_node_id
        ctx.game.run(max_turns=2)
        following.end()
        known = [state.agents["name"].tolist() for state in sent_by(stream)]
    assert known[0] == ["red_0", "red_1"]
    assert "blue_0" in known[1]


def test_an_error_in_a_turn_is_raised_where_the_turn_is_played(tmp_path):
    with HUNT.build() as ctx:
        ctx.record.start(tmp_path / "game.ggr")
        following = streams.Streams(ctx.graph.columns)
        ctx.record.follow(following)
        stream = following.get_stream(web.links.Audience())
        ctx.record.write(OpCodes.AGENT_CURRENT_NODE, {"agent_name": "no agent", "node_id": 5})
        ctx.game.step()
        with pytest.raises(Damaged, match="does not fit"):
            following.get_stream(web.links.Audience())  # in the thread of the server
        with pytest.raises(Damaged, match="does not fit"):
            ctx.game.step()
        assert following.get_stream(web.links.Audience()) is None
        assert stream.read(stream.last_keyframe)[1].turns == 0


def test_the_game_begins_again_with_another_seed_and_other_numbers(join):
    with web.serve(HUNT, speed=None) as live:
        first = live.wait(60)
        admin = join(live.links["admin"])
        admin.read(lambda client: client.told)
        known = {one["path"]: one for one in admin.told[0]["numbers"]}
        assert known["teams.red.count"]["value"] == 2
        count = "teams.red.count"
        for wrong in (
            *({"type": "restart", "numbers": {count: number}} for number in (10**9, 10**400, -1, True, "7")),
            *({"type": "restart", "numbers": numbers} for numbers in ({"map.grid.width": 3}, [], {"seed": 5})),
            *({"type": "speed", "speed": speed} for speed in (10**400, 0, 1001, True, "7")),
        ):
            admin.told.clear()
            admin.say(**wrong)
            admin.read(lambda client: any(one["type"] == "refused" for one in client.told))
        for wrong in (99, 2.5, "7", None):
            admin.told.clear()
            admin.say(type="restart", numbers={count: wrong})
            admin.read(lambda client: any(one["type"] == "refused" for one in client.told))
            refused = [one["words"] for one in admin.told if one["type"] == "refused"]
            assert refused == [f"{count} must be a whole number from 1 to 10, not {wrong!r}."]
        assert live.wait(0.0) is first
        admin.say(type="restart", seed=9, numbers={"teams.red.count": 3, "max_turns": 12})
        admin.read(lambda client: client.bytes and client.game().turns == 12)
        again = live.wait(60)
    assert (again.turns, again.seed, len(again.agents)) == (12, 9, 5)


def test_numbers_that_cannot_be_built_are_refused_in_one_page_and_the_game_goes_on(join):
    back = {"rule": "respawn", "with": {"after": 3}}
    limited = HUNT.replace(rules=[{"rule": "time_limit", "with": {"turns": 8}}, back])
    with web.serve(limited, is_paused=True) as live:
        admin, other = join(live.links["admin"]), join(live.links["admin"])
        admin.say(type="step")
        other.read_turns(1)
        playing = live.ctx
        for path, words in (
            ("rules.1.with.after", r"item 2 of rules \(respawn\): respawn raised BadValue: after must be at least 1"),
            ("teams.red.within", r"teams\.red: only 1 of 2 agents could be placed, within 0"),
        ):
            admin.told.clear()
            admin.say(type="restart", numbers={path: 0})
            admin.read(lambda client: any(one["type"] == "refused" for one in client.told))
            [refused] = [one["words"] for one in admin.told if one["type"] == "refused"]
            assert re.match(rf"Not restarted: {words}", refused)
            with live._trying:
                assert live.ctx is playing
        assert live.scenario is limited
        other.say(type="step")
        admin.read_turns(2)
        other.read_turns(2)
        assert all(one["type"] == "status" and one["error"] is None for one in other.told)
        admin.say(type="restart", numbers={"rules.0.with.turns": 3})
        admin.say(type="pause", paused=False)
        admin.say(type="speed", speed=None)
        assert live.wait(60) is not None
        other.read(lambda client: client.game().turns == 3)
        assert len(contents(other.game())[0]) == 4


def test_numbers_with_which_the_first_turn_fails_are_refused_and_no_person_plays_the_turn_that_is_tried(join):
    faults = ["too fast"]

    def err(state):
        if live.ctx.game.turn == 1 and faults:
            raise ZeroDivisionError(faults.pop())

    with web.serve(HUNT, is_paused=True, strategies={"red": err}) as live:
        admin = join(live.links["admin"])
        admin.say(type="step")
        admin.read_turns(1)
        playing = live.ctx
        admin.told.clear()
        live._options = live._options | {"strategies": {"red": err, "blue": web.human("ben", joins_within=9e5)}}
        admin.say(type="restart", numbers={"max_turns": 5})
        admin.read(lambda client: any(one["type"] == "refused" for one in client.told))
        [refused] = [one["words"] for one in admin.told if one["type"] == "refused"]
        assert refused == "Not restarted: too fast"
        with live._trying:
            assert (live.ctx, live.scenario, live.streams.turns) == (playing, HUNT, 1)
        admin.say(type="pause", paused=False)
        admin.say(type="restart", numbers={"max_turns": 0})
        admin.read(lambda client: client.bytes and client.game().turns == 0)
        admin.read(lambda client: client.told[-1].get("over"))
        assert live.wait(60).turns == 0


def test_an_error_in_a_game_that_a_page_has_restarted_is_shown_and_the_next_restart_plays(join):
    faults = []

    def err_later(state):
        if state["turn"] == 2 and faults:
            raise ZeroDivisionError(faults.pop())

    heard = []
    with web.serve(HUNT.replace(max_turns=4), speed=None, strategies={"red": err_later}) as live:
        live.when_failed.append(heard.append)
        assert live.wait(60).turns == 4
        faults.append("too fast")
        admin = join(live.links["admin"])
        admin.say(type="restart", numbers={"max_turns": 5})
        admin.read(lambda client: client.told and "too fast" in str(client.told[-1].get("error")))
        assert "too fast" in str(heard[0].__cause__ or heard[0])
        assert live.wait(0.0) is None
        admin.say(type="restart", numbers={"max_turns": 6})
        admin.read(lambda client: client.bytes and client.game().turns == 6)
        assert live.wait(60).turns == 6


def test_numbers_that_can_be_chosen_are_those_of_a_scenario_but_for_nodes_and_keys_with_dots():
    meta = {"pay": -1.5, "debt": -2, "half": 0.5, "many": [{"x": 4}, 5], "node": 3, "a.b": 7, "is_fast": True}
    made = HUNT.replace(**{"teams.red.meta": meta, "teams.red.near": 24})
    found = {one["path"]: tuple(one.values())[1:] for one in list_numbers(made) if "blue" not in one["path"]}
    assert found == {
        "sensors.eyes.range_m": (25, 0, 100, 1),
        "teams.red.count": (2, 1, 10, 1),
        "teams.red.within": (20, 0, 80, 1),
        "teams.red.meta.pay": (-1.5, -6.0, 1.0, 0.035),
        "teams.red.meta.debt": (-2, -8, 10, 1),
        "teams.red.meta.half": (0.5, 0, 2.0, 0.01),
        "teams.red.meta.many.0.x": (4, 0, 16, 1),
        "max_turns": (40, 0, 160, 1),
    }
    slow = HUNT.replace(
        **{"teams.red.speed": 0.5, "conflicts.capacity": 1, "rules": [], "teams.red.meta": {"turns": 0}}
    )
    lows = {one["path"]: one["low"] for one in list_numbers(slow)}
    assert [lows[key] for key in ("teams.red.speed", "conflicts.capacity", "teams.red.meta.turns")] == [0.01, 1, 0]
    many = HUNT.replace(**{"teams.red.meta": {f"key_{number}": number for number in range(99)}})
    assert len(list(list_numbers(many))) == 60


def test_a_chosen_number_changes_neither_the_bounds_nor_the_kind_of_the_next_choice(join):
    made = HUNT.replace(**{"teams.red.meta": {"price": 0.5}, "max_turns": 8})
    with web.serve(made, speed=None) as live:
        live.wait(60)
        admin = join(live.links["admin"])
        for chosen in ({"teams.red.meta.price": 1, "max_turns": 2}, {"teams.red.meta.price": 0.25, "max_turns": 7}):
            turns = chosen["max_turns"]
            admin.say(type="restart", numbers=chosen)
            admin.read(lambda client, turns=turns: client.bytes and client.game().turns == turns)
            admin.read(lambda client: client.told and client.told[-1].get("over"))
            assert [one for one in admin.told if one["type"] == "refused"] == []
            shown = {one["path"]: [*one.values()][1:] for one in admin.told[-1]["numbers"]}
            assert shown["teams.red.meta.price"] == [chosen["teams.red.meta.price"], 0, 2.0, 0.01]
            assert shown["max_turns"] == [turns, 0, 32, 1]


def test_a_context_whose_server_is_closed_goes_on_unwatched():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.random_walk)
        with web.serve(ctx, speed=None) as served:
            ctx.game.step()
            assert served.streams.turns == 1
        ctx.game.step()
        assert (served.streams.turns, ctx.game.turn) == (1, 2)
        later = web.serve(ctx, speed=None)
    later.close()  # once the context has ended


def test_closing_a_server_waits_until_the_turn_of_its_game_has_ended():
    decides = threading.Event()

    def ponder(state):
        decides.set()
        time.sleep(0.15)
        state["action"] = state["curr_pos"]

    with web.serve(HUNT, speed=None, strategies={"red": ponder}) as served:
        assert decides.wait(60)
    assert "gamms game" not in {thread.name for thread in threading.enumerate()}
    assert served.ctx.is_terminated()


def test_the_game_begins_again_when_its_file_changes(join, tmp_path):
    path = tmp_path / "hunt.json"
    path.write_text(json.dumps(HUNT.to_dict()))
    with web.serve(scenario.load(path), speed=None, watch=True) as live:
        assert live.wait(60).turns == 40
        watcher = join(live.links["admin"])
        path.write_text("{")
        watcher.read(lambda client: client.told and client.told[-1]["error"])
        path.write_text(json.dumps({**HUNT.to_dict(), "max_turns": 7}))
        watcher.read(lambda client: client.bytes and client.game().turns == 7)
        assert live.wait(60).turns == 7


STAY = "def stay(state):\n    state['action'] = state['curr_pos']\n"


@pytest.fixture
def watched(tmp_path):
    """`gamms run hunt.json --web --watch`: where it is, its links by name, and what it prints of errors."""
    plain = {**HUNT.to_dict(), "max_turns": 1}
    (tmp_path / "hunt.json").write_text(json.dumps(plain))
    (tmp_path / "mine.py").write_text(STAY)
    options = ["--web", "--watch", "--strategy", "red=mine.py:stay"]
    command = [sys.executable, "-m", "gamms", "run", "hunt.json", *options]
    with (
        (tmp_path / "errors").open("w") as errors,
        subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        links = {}
        while "watch as blue" not in links:
            name, _, link = process.stdout.readline().strip().rpartition(" ")
            links[name.strip()] = link
        yield tmp_path, links, (tmp_path / "errors").read_text
        assert process.poll() is None, "it serves until it is ended"
        process.terminate()
        process.stdout.close()


def test_watching_reports_the_error_of_a_changed_file_and_goes_on_when_it_is_mended(join, watched):
    folder, links, errors = watched
    admin = join(links["pause and change"])
    admin.read(lambda client: client.told and client.told[-1]["over"])
    typo = [{"rule": "time_limit", "with": {"tuns": 2}}]
    wrong = {
        "Did you mean 'turns'?": ("hunt.json", json.dumps({**HUNT.to_dict(), "rules": typo})),
        "this is not JSON": ("hunt.json", "{"),
        "lost": ("mine.py", STAY.replace("state['curr_pos']", "lost")),
        "SyntaxError": ("mine.py", STAY[:-3]),
    }
    for words, (name, text) in wrong.items():
        before = (folder / name).read_text()
        (folder / name).write_text(text)
        admin.read(lambda client, words=words: client.told and words in str(client.told[-1]["error"]))
        assert words in errors()
        (folder / name).write_text(before)
        admin.read(lambda client: client.told and client.told[-1]["error"] is None and client.told[-1]["over"])
    (folder / "mine.py").write_text(STAY.replace("state['curr_pos']", "min(state['legal'])"))
    (folder / "hunt.json").write_text(json.dumps({**HUNT.to_dict(), "max_turns": 2, "rules": []}))
    admin.read(lambda client: client.bytes and client.game().turns == 2)
    moves = [state.agents["node"].tolist()[:2] for state in admin.game()]
    assert moves[0] != moves[2], "the code of --strategy is read again, too"


def test_a_program_hears_of_wrong_files_and_waits_for_right_ones(tmp_path):
    path = tmp_path / "hunt.json"
    path.write_text(json.dumps({**HUNT.to_dict(), "max_turns": 3}))
    heard, is_heard = [], threading.Event()
    with web.serve(scenario.load(path), speed=None, watch=True) as live:
        live.when_failed.append(lambda error: heard.append(error) or is_heard.set())
        assert live.wait(60).turns == 3
        path.write_text(json.dumps({**HUNT.to_dict(), "rules": [{"rule": "time_limit", "with": {"tuns": 2}}]}))
        assert is_heard.wait(60)
        assert live.wait(0.1) is None
        assert isinstance(heard[0], scenario.ScenarioError)
        path.write_text(json.dumps({**HUNT.to_dict(), "max_turns": 4}))
        assert live.wait(60).turns == 4


def test_a_program_that_opens_a_window_else_serves_its_turns(join):
    keywords = {"simulation_time_constant": 0.001, "title": "Anna"}
    with gamms.create_context(vis_engine=gamms.visual.Engine.WEB, vis_kwargs=keywords, seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.sensor.create_sensor("next", gamms.sensor.SensorType.NEIGHBOR)
        anna = ctx.agent.create_agent("anna", start_node_id=0, sensors=["next"], team="red")
        assert "red" in ctx.visual.live.links
        client, nodes = join(ctx.visual.live.url), []
        client.read(lambda client: client.told)
        for _ in range(20):
            state = anna.get_state()
            state["action"] = state["sensor"]["next"][1][-1]
            anna.set_state()
            ctx.visual.simulate()
            nodes.append(anna.current_node_id)
            client.read(lambda client: client.bytes)  # it is there from the first turn on
        shown = client.read_turns(19)
        client.socket.close()
    assert [state.agents["node"].tolist() for state in shown] == [[node] for node in nodes]


def last_nodes(client):
    return list(client.game())[-1].agents["node"].tolist()


def test_a_recording_that_begins_and_ends_while_a_game_is_served_is_whole(join, tmp_path):
    with HUNT.build() as ctx, web.serve(ctx, speed=None) as live:
        client = join(live.url)
        client.read(lambda client: client.bytes)
        ctx.game.step()
        ctx.record.start(tmp_path / "part.ggr")
        for _ in range(5):
            ctx.game.step()
        ctx.record.stop()
        ctx.game.step()
        nodes = [agent.current_node_id for agent in ctx.agent.create_iter()]
        with recorder.open(tmp_path / "part.ggr") as part:
            assert part.turns == 5
        client.read(lambda client: client.game().turns == 1 and last_nodes(client) == nodes)  # it was begun again


# -- what is refused --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paused():
    """A served game that stands still."""
    with web.serve(HUNT, is_paused=True) as live:
        yield live


def test_a_token_that_is_not_known_opens_nothing(paused, join):
    from websockets.exceptions import ConnectionClosed

    for link in (paused.url[:-1] + "!", paused.url.partition("#")[0] + "#", paused.url + "a" * 1000):
        client = join(link)
        with pytest.raises(ConnectionClosed) as closed:
            client.read(lambda client: client.told or client.bytes)
        assert closed.value.rcvd.code == 4401


def test_another_origin_or_host_is_refused(paused):
    from websockets.exceptions import InvalidStatus

    address = paused.url.partition("#")[0]
    with (
        pytest.raises(InvalidStatus, match="403"),
        connect(address.replace("http", "ws") + "live", origin="http://evil.example"),
    ):
        pass
    with httpx.Client(trust_env=False) as client:
        page = client.get(address)
        assert page.status_code == 200
        assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
        assert "connect-src 'self'" in page.headers["content-security-policy"]
        assert page.headers["cache-control"] == "no-store"
        assert client.get(address, headers={"host": "evil.example"}).status_code == 403
        assert client.get(address + "live").status_code == 404
        assert client.get(address + "../../etc/passwd").status_code == 404


def test_answers_are_sent_without_waiting_for_more(paused):
    ends, seconds = time.monotonic() + 60.0, 60.0
    with httpx.Client(trust_env=False) as client:
        while seconds >= 0.035:  # Nagle's algorithm waits 0.04 s, each time; other programs may take as long at times
            begun = time.monotonic()
            assert begun < ends
            client.get(paused.url.partition("#")[0] + "nothing")  # whose head and body are sent one after the other
            seconds = time.monotonic() - begun


def test_a_client_that_sends_too_many_messages_is_disconnected(join, paused):
    from websockets.exceptions import ConnectionClosed

    client = join(paused.url)
    with pytest.raises(ConnectionClosed) as closed:
        for _ in range(200):
            client.say(type="step")  # refused, but no nonsense
        client.read(lambda client: False, seconds=10.0)
    assert closed.value.rcvd.code == 1008


def test_a_message_is_a_mapping_of_a_small_depth(join, paused):
    def nested(depth):
        return [nested(depth - 1)] if depth else 7

    client = join(paused.url)
    client.read(lambda client: client.told)
    counts = paused.connections[-1].counts
    step = {"type": "step"}  # which is refused, but well formed
    messages = [({**step, "a": nested(15)}, 0), ({**step, "a": nested(16)}, 1), ([7], 2), (7, 3)]
    for number, (message, bad) in enumerate(messages, 1):
        client.socket.send(json.dumps(message))
        ends = time.monotonic() + 60.0
        while counts["received"] < number or counts["bad"] + counts["refused"] < number:
            assert time.monotonic() < ends
            time.sleep(1e-3)
        assert counts["bad"] == bad


def hostile(draw):
    """A message that makes no sense, is too large, or comes out of turn."""
    kinds = ["pause", "step", "speed", "restart", "choose", "join", "", 7, None, "__class__", "status"]
    values = [None, True, -1, 1e308, 10**18, "x" * draw.randrange(200), [], {}, {"a": {"b": []}}, "\ud800", "<script>"]
    keys = ["type", "paused", "speed", "seed", "numbers", "agent", "turn", "choice", "token", "\u0000"]
    made = draw.randrange(6)
    if made == 0:
        return draw.randbytes(draw.randrange(300))
    if made == 1:
        return "[" * draw.randrange(2000)
    if made == 2:
        return json.dumps({"type": draw.choice(kinds), "numbers": {"teams.red.count": draw.choice(values)}})
    if made == 3:
        return "".join(chr(draw.randrange(1, 0xD7FF)) for _ in range(draw.randrange(300)))
    if made == 4 and draw.random() < 0.2:
        return "y" * draw.randrange(4096, 100_000)
    return json.dumps({key: draw.choice(values) for key in draw.sample(keys, 4)} | {"type": draw.choice(kinds)})


def attack(live, link, messages):
    """Send hostile messages, in as many connections as it takes."""
    from websockets.exceptions import ConnectionClosed

    draw, sent = random.Random(7), 0
    while sent < messages:
        client = Client(link)
        try:
            while sent < messages:
                client.socket.send(hostile(draw))
                sent += 1
        except ConnectionClosed:
            pass
        hang_up(client.socket)


@pytest.mark.parametrize("messages", [400, pytest.param(10_000, marks=pytest.mark.slow)])
def test_hostile_messages_change_nothing(messages, join):
    with web.serve(HUNT, is_paused=True) as live:
        witness = join(live.links["red"])
        witness.read(lambda client: client.bytes)
        before = live.ctx.game.turn, live.scenario, live.pace.speed, live.pace.is_paused, live._seed
        attack(live, live.links["red"], messages)
        assert (live.ctx.game.turn, live.scenario, live.pace.speed, live.pace.is_paused, live._seed) == before
        live.pace.step()
        witness.read(lambda client: client.parts())
        assert live._thread.is_alive()


def test_nothing_of_others_is_on_the_wire_of_a_team(join):
    hidden = HUNT.replace(**{"teams.blue.meta": {"plan": "the secret plan"}, "sensors.eyes.sensor_range": 1})
    with web.serve(hidden, speed=None, is_paused=True) as live:
        spectator, red = join(live.url), join(live.links["red"])
        for client in (spectator, red):
            client.read(lambda client: client.bytes)
        live.pace.pause(is_paused=False)
        live.wait(60)
        texts = [found.said() for found in (spectator.read_turns(40), red.read_turns(40))]
    assert "secret" in texts[0]
    assert "blue_0" in texts[0]
    assert "secret" not in texts[1]
    known = re.sub("'words': 'blue_0 is tagged by red_.', 'agent': 'blue_0'", "", texts[1])
    assert known != texts[1]
    assert "blue_0" not in re.sub("'names': ['blue_0']", "", known)


def test_no_name_or_look_of_an_agent_out_of_sight_is_on_the_wire_of_a_team(join):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(7, 7))
        ctx.sensor.create_sensor("eyes", gamms.sensor.SensorType.AGENT_RANGE, sensor_range=12.0)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["eyes"], strategy=strategies.stay)
        ctx.agent.create_agent("zqspy", start_node_id=48, team="blue", strategy=strategies.stay)
        ctx.visual.set_graph_visual()
        ctx.visual.set_agent_visual("zqspy", color="hotpink")
        with web.serve(ctx) as live:
            spectator, red = join(live.url), join(live.links["red"])
            for client in (spectator, red):
                client.read(lambda client: client.told)
            for size in range(5, 15):
                ctx.visual.set_agent_visual("zqspy", color="hotpink", size=size)
                before = spectator.bytes, red.bytes
                ctx.game.step()
                spectator.read(lambda client, before=before: client.bytes != before[0])
                red.read(lambda client, before=before: client.bytes != before[1])
            found = [client.read_turns(3) for client in (spectator, red)]
            said = [one.said() for one in found]
    assert [word in text for text in said for word in ("zqspy", "hotpink")] == [True, False, False, False]


def test_a_team_is_told_that_the_game_has_failed_and_the_host_why(join):
    def fails(state):
        raise ValueError(f"{state['name']} is lost")

    with web.serve(HUNT, speed=None, is_paused=True, strategies={"blue": fails}) as live:
        host, red = join(live.url), join(live.links["red"])
        for client in (host, red):
            client.read(lambda client: client.bytes)
        live.pace.pause(is_paused=False)
        with suppress(ValueError):
            live.wait(60)
        for client in (host, red):
            client.read(lambda client: client.told and client.told[-1].get("error"))
    assert red.told[-1]["error"] == "the game has failed"
    assert "blue_0 is lost" in host.told[-1]["error"]


@pytest.fixture
def many_connections():
    """What opens many connections to a served game, each of which sends the same bytes and then nothing."""
    opened = []

    def many(live, count, data=b""):
        port = int(live.url.partition("#")[0].rstrip("/").rpartition(":")[2])
        for _ in range(count):
            opened.append(socket.create_connection(("127.0.0.1", port)))
            opened[-1].sendall(data)
        return opened

    yield many
    for one in opened:
        one.close()


def frame(opcode, data=b"", *, is_last=True):
    """A frame of a client, masked by zeros."""
    return bytes([opcode | is_last << 7, 128 | len(data), 0, 0, 0, 0]) + data


FLOODS = {
    "pings": frame(9),
    "pongs": frame(10, b"a"),
    "empty parts": frame(0, is_last=False),
}


@pytest.mark.parametrize("kind", FLOODS)
@pytest.mark.parametrize("has_joined", [True, False])
def test_a_connection_that_sends_a_flood_of_frames_ends_and_others_go_on(join, kind, has_joined):
    with web.serve(HUNT, speed=None, is_paused=True) as live:
        witness = join(live.url)
        witness.read(lambda client: client.bytes)
        address, _, token = live.url.partition("#")
        port = int(address.rstrip("/").rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=60) as flooding:
            flooding.sendall(
                f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
            )
            if has_joined:
                flooding.sendall(frame(1, json.dumps({"token": token}).encode()))
            if kind == "empty parts":
                flooding.sendall(frame(1, is_last=False))
            sent = 0
            with suppress(ConnectionError):  # it is ended by the other side
                while sent < 1_000_000:
                    flooding.sendall(FLOODS[kind] * 1000)
                    sent += 1000
            assert sent < 1_000_000
        live.pace.pause(is_paused=False)
        assert live.wait(60) is not None
        assert witness.read_turns(1).turns


def test_a_client_may_ping_now_and_then_and_send_a_message_in_parts(join):
    with web.serve(HUNT, speed=None, is_paused=True) as live:
        client = join(live.url)
        for _ in range(30):
            client.socket.ping()
        client.socket.send(['{"type"', ': "no', 'thing"}'])
        client.read(lambda client: any("This type of message is unknown" in str(one) for one in client.told))


HALF = [b"", b"GET / HTTP/1.1\r\nHost: ", b"POST /live HTTP/1.1\r\nContent-Length: 9\r\n"]
PAGE = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n"


@pytest.mark.parametrize("data", [*HALF, PAGE], ids=["nothing", "half a line", "half a head", "a page"])
def test_connections_that_ask_for_nothing_more_make_room_for_spectators(data, many_connections, join, monkeypatch):
    for name, value in {"_MOST_CONNECTIONS": 4, "_MOST_SPECTATORS": 4, "_MOST_STRANGERS": 4, "_MOST_QUIET": 8}.items():
        monkeypatch.setattr(server, name, value)
    with web.serve(HUNT, is_paused=True) as live:
        port = int(live.url.partition("#")[0].rstrip("/").rpartition(":")[2])
        many_connections(live, 60, data % port if b"%d" in data else data)  # three times as many as there may be
        spectator = join(live.url)
        spectator.read(lambda client: client.bytes)
        with httpx.Client(trust_env=False) as client:
            assert client.get(live.url.partition("#")[0]).status_code == 200


def test_connections_that_ask_for_nothing_end_after_some_time(many_connections, monkeypatch):
    monkeypatch.setattr(server, "_QUIET_S", 0.1)
    with web.serve(HUNT, is_paused=True) as live:
        connections = many_connections(live, 20, HALF[1])
        for one in connections:
            one.settimeout(60.0)
            with suppress(ConnectionError):
                assert one.recv(1) == b""


def test_spectators_who_do_not_say_their_token_make_room_for_others(join, monkeypatch):
    from websockets.exceptions import ConnectionClosed

    monkeypatch.setattr(server, "_MOST_STRANGERS", 3)
    with web.serve(HUNT, is_paused=True) as live:
        address = live.url.partition("#")[0].replace("http", "ws") + "live"
        silent = [connect(address, close_timeout=1, legacy=True) for _ in range(5)]
        spectator = join(live.url)
        spectator.read(lambda client: client.bytes)
        with pytest.raises(ConnectionClosed) as closed:
            silent[0].recv(timeout=60.0)
        assert closed.value.rcvd.code == 1013  # after which a page tries again
        for one in silent:
            hang_up(one)


def test_players_and_admins_come_in_where_all_places_of_spectators_are_taken(join, monkeypatch):
    from websockets.exceptions import ConnectionClosed

    monkeypatch.setattr(server, "_MOST_SPECTATORS", 2)
    with web.serve(HUNT, is_paused=True) as live:
        for _ in range(2):
            join(live.url).read(lambda client: client.bytes)
        with pytest.raises(ConnectionClosed) as closed:
            join(live.url).read(lambda client: client.bytes)
        assert closed.value.rcvd.code == 1013
        admin = join(live.links["admin"])
        admin.read(lambda client: client.told)
        assert admin.told[0]["control"]


def test_a_call_whose_body_does_not_come_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(server, "_BODY_S", 0.05)
    with web.study(HUNT, people="red", consent="Do you agree?", out=tmp_path) as study:
        address, _, token = study.link("P1").partition("#")
        port = int(address.rpartition("/")[0].rpartition(":")[2])
        head = f"POST /participant HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAuthorization: Bearer {token}\r\n"
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.settimeout(60.0)
            client.sendall(f"{head}Content-Length: 99\r\n\r\n{{".encode())
            assert b" 408 " in client.recv(100)


def test_addresses_and_options_that_cannot_be_are_refused(paused, monkeypatch):
    port = int(paused.url.partition("#")[0].rstrip("/").rpartition(":")[2])
    with pytest.raises(NetworkError, match=f"Port {port} .* port=0"):
        web.serve(HUNT, port=port)
    with pytest.raises(BadValue, match="allow_network=True"):
        web.serve(HUNT, host="0.0.0.0")
    for options, words in (
        ({"speed": 0}, "speed"),
        ({"port": 1 << 16}, "65535"),
        ({"north": 1}, "'north'"),
    ):
        with pytest.raises(BadValue, match=words):
            web.serve(HUNT, **options)
    with pytest.raises(BadType, match="a context or a scenario"):
        web.serve("hunt.yaml")
    with pytest.raises(BadType, match="title"):
        web.serve(HUNT, title=5)
    with HUNT.build() as ctx, pytest.raises(BadValue, match="seed= is for a scenario"):
        web.serve(ctx, seed=1)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(MissingExtra, match="web"):
        web.serve(HUNT)


# -- in a browser -----------------------------------------------------------------------------------------------------


def test_the_page_follows_the_game_and_shows_a_team_no_more_than_it_knows(chromium):
    name = "</script><img src=x onerror='window.attacked=true'>"
    with web.serve(HUNT.replace(name=name, max_turns=None), speed=10) as live:
        page = chromium.open(live.links["admin"])
        page.wait("gamms.turn >= 3")
        assert page.value("[gamms.isLive, document.querySelector('h1').textContent]") == [True, name]
        page.value("document.querySelector('[aria-label=\"Pause the game\"]').click()")
        page.wait("document.querySelector('.live .words').textContent.includes('paused')")
        assert live.pace.is_paused
        turn = live.ctx.game.turn
        page.value("document.querySelector('[aria-label=\"Play one turn of the game\"]').click()")
        page.wait(f"gamms.turns == {turn + 1} && gamms.turn == {turn + 1}")
        nodes = [agent.current_node_id for agent in live.ctx.agent.create_iter()]
        assert page.value(browser.NODES) == nodes
        page.key("Home")
        assert page.value("[gamms.turn == gamms.first, gamms.isLive]") == [True, False]
        assert page.messages == []
        page = chromium.open(live.url)  # late
        page.wait(f"gamms.first == 0 && gamms.turns == {turn + 1} && gamms.isLive")
        assert "since" not in page.value("document.querySelector('.live .words').textContent")
        assert [page.value(f"gamms.seek({turn}); gamms.turn"), page.messages] == [turn, []]
        chromium.open(live.links["red"], 390, 800, touch=True, scale=2)
        assert page.value("document.querySelector('.live .control').hidden")
        assert page.value("document.documentElement.scrollWidth") == 390
        assert set(page.value("[...gamms.views[0].replay.state.agents.keys()]")) <= {
            "red_0",
            "red_1",
            "blue_0",
            "blue_1",
        }
        assert page.value("[window.attacked, document.images.length]") == [None, 0]
        assert page.messages == []


def test_the_numbers_of_a_scenario_are_sliders_beside_the_map_for_those_who_may_restart(chromium):
    with web.serve(HUNT, speed=None) as live:
        page = chromium.open(live.links["admin"])
        page.wait("document.querySelector('.numbers input[type=range]') && gamms.turns == 40")
        assert page.value("gamms.panel.element.hidden") is False
        row = "[...document.querySelectorAll('.number-row')].find((one) => one.textContent == 'teams.red.count')"
        parts = f"[...{row}.querySelectorAll('input')].map((one) => [one.type, one.min, one.max, one.value])"
        assert page.value(parts) == [["number", "1", "10", "2"], ["range", "1", "10", "2"]]
        page.value(f"{row}.querySelector('[type=range]').value = 3")
        page.value(f"{row}.querySelector('[type=range]').dispatchEvent(new Event('input'))")
        assert page.value(f"{row}.querySelector('[type=number]').value") == "3"
        page.value("document.querySelector('.numbers button').click()")
        page.wait("gamms.views[0].replay.state.agents.size == 5")
        page.wait(f"{row}.querySelector('[type=number][value=\"3\"]')")  # a new field, with the number of the new game
        page.value(f"{row}.querySelector('[type=number]').value = '999'")
        assert page.value("document.querySelector('.numbers').checkValidity()") is False
        assert page.messages == []
        chromium.open(live.url).wait("gamms.turns == 40")
        assert page.value("document.querySelector('.numbers').hidden")


def test_a_team_that_is_sent_several_turns_at_once_sees_who_was_in_sight_before_them(chromium):
    near = HUNT.replace(rules=[], max_turns=8, **{"teams.blue.near": 9})
    with web.serve(near, speed=None, is_paused=True) as live:
        page = chromium.open(live.links["red"])
        assert page.value("gamms.turns") == 0  # before any agent has sensed
        live.pace.pause(is_paused=False)
        page.wait("gamms.turn === 8")
        assert page.value("gamms.views[0].replay.state.agents.size") > 2
        assert page.messages == []


def test_a_link_that_is_not_known_says_so(chromium, paused):
    chromium.call("Page.navigate", url="about:blank")
    chromium.call("Page.navigate", url=paused.url.partition("#")[0] + "#nonsense")
    chromium.wait("document.querySelector('.failure')?.textContent.includes('not known')")
