"""Two people and two strategies play on loopback, on two pages of a real browser: with mouse, fingers and keys."""

import json
import math
import zlib

import pytest
from shown_game import ShownGame

from gamms import recorder, scenario, web
from gamms.web.columns import MAGIC


def agent(name, node, strategy="gamms.strategies:random_walk"):
    """Return an agent of a scenario."""
    return {"name": name, "node": node, "strategy": strategy}


MATCH = scenario.Scenario(
    name="Two people, two strategies",
    seed=5,
    map={"grid": {"width": 6, "height": 6}},
    sensors={"eyes": {"type": "AGENT_RANGE", "sensor_range": 15}},
    teams={
        "red": {"agents": [agent("rita", 0, "human"), agent("rob", 5)], "sensors": ["eyes"]},
        "blue": {"agents": [agent("bea", 35, "human"), agent("bill", 30)], "sensors": ["eyes"]},
    },
    settings={"deeds": {"wave": {"how": ["left", "right"]}}},
    max_turns=3,
)


def place_of(page, node):
    """Return where a node is on the page."""
    return page.value(
        "(({scene: {world, camera}}) => {"
        f"const row = world.rowOf.get({node});"
        "return camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]); })(gamms.views[0])"
    )


def click_button(page, words):
    """Click the button of a question that begins with some words."""
    box = f"[...document.querySelectorAll('.ask button')].find((one) => one.textContent.startsWith('{words}'))"
    click_middle(page, box)


def click_middle(page, element):
    """Click the middle of an element."""
    page.click(
        *page.value(
            f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({element}.getBoundingClientRect())"
        )
    )


def asked(page, turn):
    """Wait until the page asks for the move of a turn."""
    page.wait(f"window.gamms?.player?.question?.turn === {turn} && gamms.turns === {turn}")
    page.wait("performance.now() - gamms.player.chosenAt > 400")  # a click before is the second of a double click
    page.wait_for_frame()


def received(page):
    """Return the game that came over the wire."""
    frames = [zlib.decompress(one) for one in page.frames if isinstance(one, bytes)]
    first = max(i for i, one in enumerate(frames) if one.startswith(MAGIC))
    return ShownGame(b"".join(frames[first:]))


@pytest.fixture
def pages(chromium):
    with chromium.another() as other:
        yield chromium, other


def test_two_people_play_by_mouse_fingers_and_keys(pages, tmp_path):
    path = tmp_path / "game.ggr"
    rita, bea = pages
    with web.serve(MATCH, speed=None, record=path) as live:
        rita.open(live.players["rita"])
        bea.open(live.players["bea"], 390, 780, touch=True, dark=True)
        asked(rita, 0)
        asked(bea, 0)
        rita.click(*place_of(rita, 1))
        rita.wait("document.querySelector('.ask').textContent.includes('Waiting for others')")
        bea.touch("touchStart", place_of(bea, 34))
        bea.touch("touchEnd")
        asked(rita, 1)
        asked(bea, 1)
        bea.call("Page.navigate", url="about:blank")
        for key in ("ArrowUp", "ArrowLeft", "Enter"):
            rita.key(key)
        bea.open(live.players["bea"], 390, 780, touch=True, dark=True)
        asked(bea, 1)
        click_middle(bea, "document.querySelector('.deed input')")
        click_button(bea, "Stay")
        asked(rita, 2)
        asked(bea, 2)
        rita.key("1")
        rita.key("Enter")
        bea.touch("touchStart", place_of(bea, 28))
        bea.touch("touchEnd")
        result = live.wait(60)
        rita.wait("gamms.turns === 3")
        assert rita.messages == bea.messages == []
        sent = received(rita)
        assert {name for state in sent for name in state.agents["name"].tolist()} == {"rita"}
        assert not any(name in sent.said() for name in ("rob", "bea", "bill"))
        assert not any(name in one for name in ("rob", "bea", "bill") for one in rita.frames if isinstance(one, str))
    with recorder.open(path) as recording:
        ways = [dict(zip(state.agents["name"], state.agents["node"], strict=True)) for state in recording]
        assert [(nodes["rita"], nodes["bea"]) for nodes in ways] == [(0, 35), (1, 34), (0, 34), (1, 28)]
        choices = [event for event in recording.events() if event["kind"] == "choice"]
    assert [json.loads(one["action"]) for one in choices if one["agent"] == "bea"] == [
        {"move": 34},
        {"move": 34, "do": {"wave": {"how": "left"}}},
        {"move": 28},
    ]
    assert result.deeds == [{"turn": 2, "agent": "bea", "deed": "wave", "at": 34, "how": "left"}]
    people = {name: web.human(choices=path) for name in ("rita", "bea")}
    again = MATCH.play(strategies=people, record=tmp_path / "again.ggr")
    assert again == result


def write(page, element, words):
    """Click a field and type into it."""
    click_middle(page, element)
    for letter in words:
        page.key(letter)


def test_people_write_to_each_other_on_their_turns(pages, tmp_path):
    radio = {"radio": {"range_m": 500, "max_bytes_per_turn": 40}, "wire": {"hops": 1, "teams": ["red"]}}
    game, path = MATCH.replace(channels=radio), tmp_path / "game.ggr"
    rita, bea = pages
    with web.serve(game, speed=None, record=path) as live:
        rita.open(live.players["rita"], 1280, 800)
        bea.open(live.players["bea"], 390, 844, touch=True, dark=True)
        asked(rita, 0)
        asked(bea, 0)
        assert bea.value("document.querySelector('.outbox').children[0].hidden")  # there is one channel alone
        write(rita, "document.querySelector('.outbox .body')", "1 <b>at 7 or so, or later than that? ok</b>")
        assert rita.value("gamms.player.selected") is None  # the 1 is no move
        assert rita.value("gamms.look.labels") == "auto"
        click_button(rita, "Stay")
        rita.wait("document.querySelector('.ask .words').textContent.includes('takes 40 of each agent')")
        rita.value("document.querySelector('.outbox .body').value = ''")
        write(rita, "document.querySelector('.outbox .body')", "<b>at 7, ok?</b>")
        rita.wait("performance.now() - gamms.player.chosenAt > 400")
        click_button(rita, "Stay")
        click_button(bea, "Stay")
        asked(bea, 1)
        assert bea.value("document.querySelector('.inbox').textContent") == "rita radio <b>at 7, ok?</b>"
        assert bea.value("document.querySelector('.outbox').textContent").endswith("to rita")
        click_button(bea, "Stay")
        asked(rita, 1)
        click_button(rita, "Stay")
        for page in (rita, bea):
            asked(page, 2)
            click_button(page, "Stay")
        result = live.wait(60)
        assert rita.messages == bea.messages == []
    assert [(one["sender"], one["to"], one["body"]) for one in result.messages] == [("rita", None, "<b>at 7, ok?</b>")]
    people = {name: web.human(choices=path) for name in ("rita", "bea")}
    assert game.play(strategies=people, record=tmp_path / "again.ggr") == result


def test_on_a_phone_nothing_covers_a_choice_or_the_source_of_the_map(chromium):
    rita = {"agents": [agent("rita", 0, "human")], "sensors": ["eyes"]}
    match = scenario.Scenario(
        seed=1, map={"helsinki": {}}, sensors={"eyes": {"type": "AGENT_RANGE", "range_m": 60}}, teams={"red": rita}
    )
    with web.serve(match, speed=None) as live:
        chromium.open(live.players["rita"], 390, 844, touch=True)
        asked(chromium, 0)
        disc = chromium.value("gamms.views[0].scene.discs.map(({radius}) => radius)")
        boxes = chromium.value(
            "['.ask', '.credit', '.live', '.head', '.bar'].map((one) => document.querySelector(one)"
            ".getBoundingClientRect()).map(({left, top, right, bottom}) => [left, top, right, bottom])"
        )
    assert max(disc) <= 12.0
    for i, (left, top, right, low) in enumerate(boxes):
        for other in boxes[:i]:
            assert right <= other[0] or other[2] <= left or low <= other[1] or other[3] <= top


SIGHT = """(({scene, replay}) => ({
  nodes: [...scene.sightOfTeam.nodes].map((row) => scene.world.nodeIds[row]).sort((a, b) => a - b),
  seen: Object.fromEntries([...replay.sensed].map(([name, [look]]) => [name, look.agents.map((one) => one.name)])),
}))(gamms.views[0])"""
"""What gives the nodes that are in sight, and which agents each of a person's agents reports."""
INSIDE = """(() => {
  const { scene } = gamms.views[0], { px, py } = scene.discOf("rita"), half = 5 * scene.camera.scale;
  const ink = (sensors) => {
    scene.paint({ ...gamms.look, sensors }, 1, false);
    return [...scene.to.getImageData((px + half) * scene.ratio, (py - half) * scene.ratio, 1, 1).data].join();
  };
  return [ink(gamms.look.sensors), ink(false)];
})()"""
"""What gives the color between streets beside an agent, as it is shown and without what sensors see."""


def test_a_person_sees_how_far_the_agents_see_before_each_move(chromium):
    team = {
        "agents": [{"name": "rita", "node": 14}, {"name": "rob", "node": 8}],
        "strategy": "human",
        "sensors": ["eyes"],
    }
    match = MATCH.replace(**{"teams.red": team, "teams.blue.agents": [agent("bill", 17, "gamms.strategies:stay")]})
    xy = {node: (10 * (node % 6), 10 * (node // 6)) for node in range(36)}

    def near(*places):
        return [node for node, at in xy.items() if any(math.dist(at, xy[place]) <= 15 for place in places)]

    with web.serve(match, speed=None) as live:
        page = chromium.open(live.players["red"])
        asked(page, 0)
        assert page.value(SIGHT) == {"nodes": near(14, 8), "seen": {"rita": ["rob"], "rob": ["rita"]}}
        assert len(set(page.value(INSIDE))) == 2
        page.click(*place_of(page, 15))
        page.wait("gamms.player.question?.agent === 'rob'")
        page.wait("performance.now() - gamms.player.chosenAt > 400")
        click_button(page, "Stay")
        asked(page, 1)
        assert page.value(SIGHT) == {"nodes": near(15, 8), "seen": {"rita": ["rob"], "rob": ["rita"]}}
        page.click(*place_of(page, 16))
        page.wait("gamms.player.question?.agent === 'rob'")
        page.wait("performance.now() - gamms.player.chosenAt > 400")
        click_button(page, "Stay")
        asked(page, 2)
        assert page.value(SIGHT) == {"nodes": near(16, 8), "seen": {"rita": ["bill"], "rob": []}}
        assert page.value("gamms.views[0].scene.discs.map((one) => one.name).sort()") == ["bill", "rita", "rob"]


def test_pages_say_how_many_others_watch_and_that_a_link_is_open_twice(pages):
    first, second = pages
    words = "document.querySelector('.live .words').textContent"
    with web.serve(MATCH, speed=None) as live:
        first.open(live.players["rita"])
        asked(first, 0)
        first.wait(f"{words} === 'nobody else watching'")
        assert "pages" not in first.value("document.querySelector('.ask').textContent")
        second.open(live.players["rita"])
        for page in pages:
            asked(page, 0)
            page.wait(f"{words} === '1 other watching'")
            page.wait("document.querySelector('.ask').textContent.includes('This link is open on 2 pages')")
        second.call("Page.navigate", url="about:blank")
        first.wait(f"{words} === 'nobody else watching'")
        first.wait("!document.querySelector('.ask').textContent.includes('2 pages')")
