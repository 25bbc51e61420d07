"""Marks of tags, outs and arrivals in the replay of a browser are those of pictures."""

import pytest

import gamms
from gamms import recorder
from gamms.rules import arrive, none_left, tag
from gamms.strategies import goto
from gamms.visual.artist import ArtistGroup
from gamms.visual.captions import captions_of
from gamms.visual.drawers.marks import drawn_marks


def staying(state):
    state["action"] = state["curr_pos"]


@pytest.fixture(scope="module")
def game(tmp_path_factory):
    """A page, and what Python says: two robots arrive, two thieves go out on a node, a scout is tagged there."""
    folder, said = tmp_path_factory.mktemp("game"), []
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 6))
        agents = {"robot_0": ("robots", 0, 3), "robot_1": ("robots", 5, 3), "guard": ("guards", 13)}
        agents |= {"thief_0": ("thieves", 14, 13), "thief_1": ("thieves", 12, 13), "scout": ("scouts", 19, 13)}
        for name, (team, node, *target) in agents.items():
            strategy = goto(ctx, target[0]) if target else staying
            ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=strategy)
        ctx.game.add(arrive("robots", 3))
        ctx.game.add(tag("guards", "thieves", then="eliminate"))
        ctx.game.add(tag("guards", "scouts"))
        ctx.game.add(none_left("robots", winner="robots"))
        ctx.record.start(folder / "game.ggr")
        while not ctx.game.is_over:
            ctx.game.step()
            artists = ctx.visual.artists.shown()
            ArtistGroup(ctx, artists).commands()
            marks = [mark for artist in artists.values() for mark in drawn_marks(artist)]
            rights = {mark.name: round(mark.shift[0] * mark.least_px) for mark in marks}
            pale = {mark.name for mark in marks if mark.color[3] < 255}
            said.append((rights, pale, [caption.words for caption in captions_of(ctx.visual.drawing.events.of_turn())]))
        ctx.record.stop()
    with recorder.open(folder / "game.ggr") as recording:
        recording.save(folder / "game.html")
    return folder / "game.html", said


MARKS = """gamms.views[0].scene.marks.map(({name, px, py, sign, color}) => {
  const {scene} = gamms.views[0], agent = scene.replay.state.byName.get(name);
  const node = sign === "tag" ? 13 : agent.node;
  const [x, y] = scene.camera.toScreen(10 * (node % 6), 10 * Math.floor(node / 6));
  return {name, sign, right: Math.round(px - x), down: py - y - scene.discPx, isPale: color.startsWith("rgba")};
})"""


@pytest.mark.parametrize("zooms", [0, 6])
def test_marks_are_where_pictures_have_them_and_keep_their_size(chromium, game, zooms):
    page, (path, said) = chromium, game
    page.open(path)
    for _ in range(zooms):
        page.key("+")
    for turn, (rights, pale, _) in enumerate(said, 1):
        page.value(f"gamms.seek({turn})")
        page.settle()
        marks = page.value(MARKS)
        assert {mark["name"]: mark["right"] for mark in marks} == rights
        assert {mark["name"] for mark in marks if mark["isPale"]} == pale
        assert [mark["down"] for mark in marks] == pytest.approx([16.5] * len(marks))
    signs = {"robot_0": "tick", "robot_1": "tick", "thief_0": "cross", "thief_1": "cross", "scout": "tag"}
    assert {mark["name"]: mark["sign"] for mark in marks} == signs
    assert page.messages == []


def test_what_happened_is_said_as_films_say_it(chromium, game):
    page, (path, said) = chromium, game
    page.open(path)
    words = page.value(
        "gamms.views[0].replay.overview.happenings.filter(({isMajor}) => !isMajor).map(({words}) => words)"
    )
    assert words == [sentence for *_, sentences in said for sentence in sentences]
    assert "robot_0 arrives at node 3" in words
