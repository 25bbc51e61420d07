"""Marks of tags, outs and arrivals in the replay of a browser are those of pictures."""

import pytest

import gamms
from gamms import recorder
from gamms.rules import arrive, none_left, tag
from gamms.strategies import goto
from gamms.visual.artist import ArtistGroup
from gamms.visual.captions import write_captions
from gamms.visual.drawers.marks import get_drawn_marks


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
            artists = ctx.visual.artists.list_shown()
            ArtistGroup(ctx, artists).draw_artists()
            marks = [mark for artist in artists.values() for mark in get_drawn_marks(artist)]
            rights = {mark.name: round(mark.shift[0] * mark.least_px) for mark in marks}
            said.append((rights, [caption.words for caption in write_captions(ctx.visual.drawing.events.list_last())]))
        ctx.record.stop()
    with recorder.open(folder / "game.ggr") as recording:
        recording.save(folder / "game.html")
    return folder / "game.html", said


MARKS = """gamms.views[0].scene.marks.map(({name, px, py}, i) => {
  const {scene} = gamms.views[0], drawings = [...scene.replay.state.drawings.values()];
  const places = drawings.flatMap((one) => [...(one.get("marks")?.get("places") ?? [])]);
  const [x, y] = scene.camera.toScreen(places[2 * i], places[2 * i + 1]);
  return {name, right: Math.round(px - x), down: py - y};
})"""


@pytest.mark.parametrize("zooms", [0, 6])
def test_marks_are_where_pictures_have_them_and_keep_their_size(chromium, game, zooms):
    page, (path, said) = chromium, game
    page.open(path)
    for _ in range(zooms):
        page.key("+")
    for turn, (rights, _) in enumerate(said, 1):
        page.value(f"gamms.seek({turn})")
        page.settle()
        marks = page.value(MARKS)
        assert {mark["name"]: mark["right"] for mark in marks} == rights
        assert [mark["down"] for mark in marks] == pytest.approx([12.0] * len(marks))
    assert {mark["name"] for mark in marks} == {"robot_0", "robot_1", "thief_0", "thief_1", "scout"}
    assert page.messages == []


def test_events_are_described_as_in_films(chromium, game):
    page, (path, said) = chromium, game
    page.open(path)
    words = page.value(
        "gamms.views[0].replay.timeline.captions.filter(({isMajor}) => !isMajor).map(({words}) => words)"
    )
    assert words == [sentence for *_, sentences in said for sentence in sentences]
    assert "robot_0 arrives at node 3" in words
